"""holes as a user runs it: many holes from one table, and each fault by its line."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

SURVEYS = """hole,depth_m,dip_deg,azimuth_deg
H1,0,-60,90
H1,100,-60,90
UP,50,30,0
V,0,-90,
V,40,-90,
"""
COLLARS = """Hole ID,X (m),Y (m),Z (m),EOH (m)
H1,1000,2000,300,150
UP,10,20,30,
V,0,0,0,
"""


@pytest.fixture
def tables(run):
    Path("surveys.csv").write_text(SURVEYS)
    Path("collars.csv").write_text(COLLARS)


def holes(run, *more, dip="negative"):
    return run("holes", "surveys.csv", "--collars", "collars.csv", *(("--dip-down", dip) if dip else ()), *more)


def ends(done):
    return {row["hole"]: [row["east_m"], row["north_m"], row["elevation_m"]] for row in done.json["holes"]}


def test_straight_holes_end_where_they_must(run, tables):
    done = holes(run, "-o", "positions.csv", "--json")
    assert done.status == 0, done.err
    # 150 m at 60 deg down to the east; 50 m at 30 deg up to the north; 40 m down
    wanted = {
        "H1": [1075.0, 2000.0, 300.0 - 150.0 * np.sin(np.pi / 3)],
        "UP": [10.0, 20.0 + 50.0 * np.cos(np.pi / 6), 55.0],
        "V": [0.0, 0.0, -40.0],
    }
    found = ends(done)
    assert list(found) == list(wanted)
    for name, place in wanted.items():
        assert found[name] == pytest.approx(place, abs=1e-9)
    assert any(note.startswith("a single shot: a straight hole: 1 hole(s), UP") for note in done.json["notes"])
    assert any("straight from the last shot" in note for note in done.json["notes"])
    with Path("positions.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["hole"] for row in rows] == ["H1"] * 3 + ["UP"] * 2 + ["V"] * 2
    assert float(rows[2]["east_m"]) == 1075.0
    # the other sign turns everything over
    up = ends(holes(run, "--json", dip="positive"))
    assert up["H1"][2] == pytest.approx(600.0 - wanted["H1"][2])


def test_the_sign_of_the_dip_is_never_guessed(run, tables):
    done = holes(run, dip=None)
    assert done.status == 2
    assert "dips are -90 to 30 deg" in done.err
    assert "--dip-down negative" in done.err
    # an inclination from the vertical has no sign to be asked for
    Path("surveys.csv").write_text("hole,depth_m,inclination_deg,azimuth_deg\nH1,100,30,90\n")
    done = holes(run, "--json", dip=None)
    assert ends(done)["H1"] == pytest.approx([1075.0, 2000.0, 300.0 - 150.0 * np.sin(np.pi / 3)])
    assert "leave it out" in holes(run).err
    # level holes lie the same under either sign
    Path("surveys.csv").write_text("hole,depth_m,dip_deg,azimuth_deg\nH1,100,0,90\n")
    assert holes(run, dip=None).status == 0


def test_an_arc_and_points_along_it(run):
    angles = np.linspace(0.0, 90.0, 10)
    rows = [f"A,{200.0 * np.radians(a):.9f},{90.0 - a:.9f},90" for a in angles]
    Path("surveys.csv").write_text("\n".join(["BHID,Depth,Dip,Azimuth", *rows]) + "\n")
    options = ("--profile", "drill-holes", "--dip-down", "positive", "--every-m", "10")
    done = run("holes", "surveys.csv", *options, "-o", "positions.csv", "--json")
    assert done.status == 0, done.err
    # a quarter of a circle of 200 m; depths are written to 1e-9 m
    assert ends(done)["A"] == pytest.approx([200.0, 0.0, -200.0], abs=1e-6)
    assert done.json["holes"][0]["largest_dls_deg_30m"] == pytest.approx(np.degrees(30.0 / 200.0))
    with Path("positions.csv").open(newline="") as stream:
        found = list(csv.DictReader(stream))
    md, east, up = (np.array([float(row[name]) for row in found]) for name in ("md_m", "east_m", "elevation_m"))
    assert len(md) == 10 + 31
    assert np.allclose(np.hypot(east - 200.0, up), 200.0, atol=1e-5)


def test_azimuths_are_turned_to_the_grid(run, tables):
    found = ends(holes(run, "--azimuth-add-deg", "-90", "--json"))
    assert found["H1"] == pytest.approx([1000.0, 2075.0, 300.0 - 150.0 * np.sin(np.pi / 3)])


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("H1,100,-60,90", "H1,0,-60,90", "H1 (line 3: depth 0 m again"),
        ("H1,0,-60,90", "H1,200,-60,90", "H1 (line 3: depth 100 m after 200 m"),
        ("H1,100,-60,90", "H1,100,,90", "H1 (line 3: dip is empty"),
        ("H1,100,-60,90", "H1,100,-60,", "H1 (line 3: azimuth is empty"),
        ("H1,100,-60,90", "H1,100,-95,90", "H1 (line 3: dip is beyond 90 deg"),
        ("H1,100,-60,90", "H1,100,-60,400", "H1 (line 3: azimuth is 400 deg"),
        ("H1,100,-60,90", "H1,160,-60,90", "H1 (line 2: the hole ends at 150 m, above its last shot at 160 m"),
        ("H1,100,-60,90", "H1,100,60,270", "H1 (line 2: the hole turns by 180"),
        ("UP,50", "up,50", "up (no collar in collars.csv (is it 'UP' there?)"),
        ("UP,50", "UP,0", "UP (line 4: a single shot at the collar"),
    ],
)
def test_a_faulty_hole_is_named_and_refused_or_left_out(run, tables, old, new, words):
    Path("surveys.csv").write_text(SURVEYS.replace(old, new))
    done = holes(run, "-o", "positions.csv")
    assert done.status == 2, done.out
    assert f"surveys.csv: 1 of 3 hole(s) faulty: {words}" in done.err
    assert not Path("positions.csv").exists()
    done = holes(run, "-o", "positions.csv", "--skip-faulty", "--json")
    assert done.status == 1
    assert "left out" in done.err
    assert len(done.json["holes"]) == 2
    assert len(done.json["faulty"]) == 1
    assert Path("positions.csv").exists()


def test_collars_that_are_double_or_alone(run, tables):
    Path("collars.csv").write_text(COLLARS + "H1,1,2,3,\nX9,1,2,3,\n")
    assert "H1 (2 collars in collars.csv, lines 2, 5)" in holes(run).err
    Path("collars.csv").write_text(COLLARS + "X9,1,2,3,\n")
    done = holes(run)
    assert done.status == 0
    assert "1 of the collars have no shots in surveys.csv: X9" in done.err


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ("name,depth_m,dip_deg,azimuth_deg", "no column names the hole"),
        ("hole,depth,dip_deg,azimuth_deg", "column 'depth' has no unit"),
        ("hole,depth_m,dip_kg,azimuth_deg", "column 'dip_kg' has the unit 'kg'"),
        ("hole,depth_m,other,azimuth_deg", "column 'dip' is missing"),
        ("hole,depth_m,dip_deg,inclination_deg", "column 'azimuth' is missing"),
        ("hole,hole_id,dip_deg,azimuth_deg", "2 columns name the hole"),
        ("hole,depth_m,depth_ft,azimuth_deg", "are both the depth"),
    ],
)
def test_a_table_that_is_not_of_holes(run, tables, header, words):
    Path("surveys.csv").write_text(SURVEYS.replace("hole,depth_m,dip_deg,azimuth_deg", header))
    done = holes(run)
    assert done.status == 2
    assert words in done.err


def test_feet_and_nothing_left(run, tables):
    Path("surveys.csv").write_text("hole,depth_ft,dip_deg,azimuth_deg\nUP,100,30,0\n")
    assert ends(holes(run, "--json"))["UP"][2] == pytest.approx(30.0 + 15.24)
    Path("surveys.csv").write_text("hole,depth_m,dip_deg,azimuth_deg\nQ,100,30,0\n")
    done = holes(run, "--skip-faulty")
    assert done.status == 2
    assert "none is left" in done.err


def test_the_table_for_people(run, tables):
    done = run("holes", "surveys.csv", "--dip-down", "negative")
    assert done.status == 0, done.err
    assert "ends of the holes" in done.out
    assert "no collars: every hole begins at 0, 0, 0" in done.out
    assert "--every-m is 0" in holes(run, "--every-m", "0").err
