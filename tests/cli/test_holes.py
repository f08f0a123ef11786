"""holes as a user runs it: many holes from one table, and each fault by its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from .tables import rows_of

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
    return run("holes surveys.csv --collars collars.csv", *(("--dip-down", dip) if dip else ()), *more)


def said(done, code):
    return [one for one in done.json["findings"] if one["code"] == code]


def ends(done):
    return {row["hole"]: [row["east_m"], row["north_m"], row["elevation_m"]] for row in done.json["holes"]}


def test_straight_holes_end_where_they_must(run, tables):
    done = holes(run, "-o", "positions.csv", "--json").ok()
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
    straight = {one["values"]["where"]: one["values"]["names"] for one in said(done, "holes-straight")}
    assert straight == {"single shot": "UP", "last shot": "H1"}
    rows = rows_of("positions.csv")
    assert [row["hole"] for row in rows] == ["H1"] * 3 + ["UP"] * 2 + ["V"] * 2
    assert float(rows[2]["east_m"]) == 1075.0
    # the other sign turns everything over
    up = ends(holes(run, "--json", dip="positive"))
    assert up["H1"][2] == pytest.approx(600.0 - wanted["H1"][2])


def test_the_sign_of_the_dip_is_never_guessed(run, tables):
    holes(run, dip=None).refused("[holes-dip-sign]", "--dip-down negative")
    # an inclination from the vertical has no sign to be asked for
    Path("surveys.csv").write_text("hole,depth_m,inclination_deg,azimuth_deg\nH1,100,30,90\n")
    done = holes(run, "--json", dip=None)
    assert ends(done)["H1"] == pytest.approx([1075.0, 2000.0, 300.0 - 150.0 * np.sin(np.pi / 3)])
    holes(run).refused("--dip-down does not apply to inclination_deg")
    # level holes lie the same under either sign
    Path("surveys.csv").write_text("hole,depth_m,dip_deg,azimuth_deg\nH1,100,0,90\n")
    assert holes(run, dip=None).status == 0


def test_an_arc_and_points_along_it(run):
    angles = np.linspace(0.0, 90.0, 10)
    rows = [f"A,{200.0 * np.radians(a):.9f},{90.0 - a:.9f},90" for a in angles]
    Path("surveys.csv").write_text("\n".join(["BHID,Depth,Dip,Azimuth", *rows]) + "\n")
    options = ("--profile", "drill-holes", "--dip-down", "positive", "--every-m", "10")
    done = run("holes", "surveys.csv", *options, "-o", "positions.csv", "--json").ok()
    # a quarter of a circle of 200 m; depths are written to 1e-9 m
    assert ends(done)["A"] == pytest.approx([200.0, 0.0, -200.0], abs=1e-6)
    assert done.json["holes"][0]["largest_dls_deg_30m"] == pytest.approx(np.degrees(30.0 / 200.0))
    found = rows_of("positions.csv")
    md, east, up = (np.array([float(row[name]) for row in found]) for name in ("md_m", "east_m", "elevation_m"))
    assert len(md) == 10 + 31
    assert np.allclose(np.hypot(east - 200.0, up), 200.0, atol=1e-5)


def test_azimuths_are_turned_to_the_grid(run, tables):
    found = ends(holes(run, "--azimuth-add-deg", "-90", "--json"))
    assert found["H1"] == pytest.approx([1000.0, 2075.0, 300.0 - 150.0 * np.sin(np.pi / 3)])


@pytest.mark.parametrize(
    ("old", "new", "line", "code"),
    [
        ("H1,100,-60,90", "H1,0,-60,90", 3, "holes-depth-order"),
        ("H1,0,-60,90", "H1,200,-60,90", 3, "holes-depth-order"),
        ("H1,100,-60,90", "H1,100,,90", 3, "table-empty"),
        ("H1,100,-60,90", "H1,100,-60,", 3, "table-empty"),
        ("H1,100,-60,90", "H1,100,-95,90", 3, "input-value"),
        ("H1,100,-60,90", "H1,100,-60,400", 3, "input-value"),
        ("H1,100,-60,90", "H1,160,-60,90", 2, "holes-end-above"),
        ("H1,100,-60,90", "H1,100,60,270", 2, "survey-half-turn"),
        ("UP,50", "up,50", 4, "holes-collar-missing"),
        ("UP,50", "UP,0", 4, "holes-length-unknown"),
    ],
)
def test_a_faulty_hole_is_named_and_refused_or_left_out(run, tables, old, new, line, code):
    Path("surveys.csv").write_text(SURVEYS.replace(old, new))
    hole = new[:2]
    holes(run, "-o", "positions.csv").refused("surveys.csv: Faulty holes: 1 of 3", f"{hole}, line {line}: ")
    assert not Path("positions.csv").exists()
    done = holes(run, "-o", "positions.csv", "--skip-faulty", "--json")
    assert done.status == 1
    assert "left out" in done.err
    assert len(done.json["holes"]) == 2
    assert list(done.json["faulty"]) == [hole]
    assert done.json["faulty"][hole]["code"] == "holes-left-out"
    (one,) = said(done, "holes-left-out")
    fault = one["values"]["fault"]
    assert code in (fault if isinstance(fault, str) else fault["code"])
    assert one["values"]["line"] == line
    assert Path("positions.csv").exists()


def test_each_hole_is_held_against_what_a_run_is(run):
    """A depth with a wrong digit in one of two even holes is doubted; nothing is refused, and positions are given."""
    depths = np.arange(0.0, 601.0, 30.0)
    rows = [f"{hole},{m:g},{-60.0 - m / 100.0:.1f},90" for hole in ("A", "B") for m in depths]
    text = "\n".join(["hole,depth_m,dip_deg,azimuth_deg", *rows]) + "\n"
    Path("surveys.csv").write_text(text.replace("B,300,", "B,310,"))
    done = run("holes", "surveys.csv", "--dip-down", "negative", "--json").ok()
    (one,) = said(done, "holes-run")
    inner = one["values"]["finding"]
    assert (one["severity"], one["values"]["hole"], inner["code"]) == ("warning", "B", "run-depth-digit")
    assert inner["rows"] == [11]
    assert len(done.json["holes"]) == 2


@pytest.mark.parametrize(
    ("old", "new", "code", "values"),
    [
        ("B,100,-62,92", "B,100,62,92", "run-station-misread", {"mistake": "other end", "station": 3}),
        ("B,50,-61,91", "B,50,-61,191", "run-station-misread", {"mistake": "one digit", "fits_azimuth_deg": 91.0}),
        ("B,100,-62,92", "B,100,0,0", "run-dogleg", {"station": 3}),
        ("C,100,-62,92", "C,100,-12,92", "run-station-misread", {"mistake": "one digit"}),
    ],
)
def test_a_shot_of_a_short_hole_that_no_hole_bends_to(run, old, new, code, values):
    rows = [f"{hole},{m},{-60 - m // 50},{90 + m // 50}" for hole in "ABCD" for m in (0, 50, 100)]
    text = "\n".join(["hole,depth_m,dip_deg,azimuth_deg", *rows]) + "\n"
    Path("surveys.csv").write_text(text)
    assert not said(run("holes surveys.csv --dip-down negative --json").ok(), "holes-run")
    Path("surveys.csv").write_text(text.replace(old, new))
    (one,) = said(run("holes surveys.csv --dip-down negative --json").ok(), "holes-run")
    inner = one["values"]["finding"]
    assert (one["values"]["hole"], inner["code"]) == (old[0], code)
    assert {name: inner["values"][name] for name in values} == values


@pytest.mark.parametrize("cells", ["-99,91", "99,91", "-61,-99", "-61,999", "-61,9999", "-999,91"])
def test_marks_of_an_empty_cell(run, cells):
    Path("surveys.csv").write_text(f"hole,depth_m,dip_deg,azimuth_deg\nA,0,-60,90\nA,50,{cells}\n")
    run("holes surveys.csv --dip-down negative").refused("[holes-faulty", "a usual mark of an empty cell")


def test_a_hole_that_goes_up_is_noted(run):
    Path("surveys.csv").write_text("hole,depth_m,dip_deg,azimuth_deg\nA,50,-60,90\nB,50,60,90\nC,50,-61,-45\n")
    (one,) = said(run("holes surveys.csv --dip-down negative --json").ok(), "holes-up")
    assert (one["severity"], one["values"]) == ("note", {"count": 1, "total": 3, "names": "B"})


def test_collars_on_the_grid_and_magnetic_shots(run):
    rows = "A,0,-60,100,grid\nA,50,-60,90,magnetic\nA,100,-60,90,magnetic\n"
    Path("surveys.csv").write_text(f"hole,depth_m,dip_deg,azimuth_deg,azimuth_reference\n{rows}")
    run("holes surveys.csv --dip-down negative").refused("[holes-norths")
    done = run("holes surveys.csv --dip-down negative --azimuth-add-deg 10 --json").ok()
    east, north, _ = ends(done)["A"]
    assert np.degrees(np.arctan2(east, north)) == pytest.approx(100.0)
    Path("surveys.csv").write_text(
        f"hole,depth_m,dip_deg,azimuth_deg,azimuth_reference\n{rows}".replace("grid", "true")
    )
    run("holes surveys.csv --dip-down negative --azimuth-add-deg 10").refused("[input-north")


def test_collars_that_are_double_or_alone(run, tables):
    Path("collars.csv").write_text(COLLARS + "H1,1,2,3,\nX9,1,2,3,\n")
    assert "H1, line 2: collars.csv:2,5: H1 occurs more than once." in holes(run).err
    Path("collars.csv").write_text(COLLARS + "X9,1,2,3,\n")
    (one,) = said(holes(run, "--json").ok(), "holes-collar-alone")
    assert one["values"] == {"count": 1, "names": "X9"}


def test_a_table_that_is_not_of_holes(run, tables):
    """What else the reader refuses: tests/files/test_holes_csv.py."""
    Path("surveys.csv").write_text(SURVEYS.replace("hole,depth_m", "label,depth_m"))
    holes(run).refused("Missing columns: hole.", "[file-column]")


def test_feet_and_nothing_left(run, tables):
    Path("surveys.csv").write_text("hole,depth_ft,dip_deg,azimuth_deg\nUP,100,30,0\n")
    assert ends(holes(run, "--json"))["UP"][2] == pytest.approx(30.0 + 15.24)
    Path("surveys.csv").write_text("hole,depth_m,dip_deg,azimuth_deg\nQ,100,30,0\n")
    holes(run, "--skip-faulty").refused("[holes-faulty]")


def test_the_table_for_people(run, tables):
    done = run("holes surveys.csv --dip-down negative").ok()
    assert "ends of the holes" in done.out
    assert "note" not in done.err
    done = run("holes", "surveys.csv", "--dip-down", "negative", "-v").ok()
    assert "[holes-no-collars]" in done.err
    assert "--every-m is 0" in holes(run, "--every-m", "0").err
