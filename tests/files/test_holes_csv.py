"""Tables of drill holes: what their columns mean, in which unit, and what no table of holes may say."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.constants import FOOT
from inclinometry.errors import FileError
from inclinometry.files.holes_csv import hole_column, read_collars, read_shots, write_positions
from inclinometry.files.profile import reading_with
from inclinometry.survey.holes import drill_hole


def table(folder, text):
    path = folder / "holes.csv"
    path.write_text(text)
    return path


def test_shots_of_two_holes_in_turns_with_an_empty_cell(tmp_path):
    path = table(tmp_path, "BHID,At (ft),Dip (deg),Azimuth,lithology\nA,0,-60,10,ore\nB,0,-90,,\nA,100,-55,12,ore\n")
    with reading_with(None, "deg"):
        shots = read_shots(path)
    assert {hole: rows.tolist() for hole, rows in shots.rows.items()} == {"A": [0, 2], "B": [1]}
    np.testing.assert_allclose(shots.depth, [0.0, 0.0, 100.0 * FOOT])
    np.testing.assert_allclose(np.degrees(shots.dip), [-60.0, -90.0, -55.0])
    np.testing.assert_allclose(np.degrees(shots.azimuth), [10.0, np.nan, 12.0])
    assert shots.inclination is None
    path = table(tmp_path, "hole,depth_m,inclination_deg,azimuth_deg\nA,0,30,10\n")
    assert (np.degrees(read_shots(path).inclination).round(9).tolist(), read_shots(path).dip) == ([30.0], None)


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("hole,dip_deg,azimuth_deg\nA,1,2\n", 1, "file-column depth"),
        ("hole,depth_m,dip_deg\nA,1,2\n", 1, "file-column azimuth"),
        ("hole,depth_m,azimuth_deg\nA,1,2\n", 1, "input-one-of dip"),
        ("hole,depth_m,azimuth_deg,dip_deg,inc_deg\nA,1,2,3,4\n", 1, "input-one-of dip"),
        ("hole,depth_m,azimuth_deg,dip_deg\nA,1,2,3\n,2,2,3\n", 3, "input-empty"),
        ("holle,depth_m\nA,1\n", None, "file-column hole"),
        ("shaft,depth_m\nA,1\n", None, "file-column hole"),
        ("hole,BHID,depth_m\nA,A,1\n", None, "table-same"),
        ("hole,depth_m,at_ft\nA,1,1\n", None, "table-same"),
        ("hole,depth,dip_deg,azimuth_deg\nA,1,1,1\n", None, "table-unit-missing"),
        ("hole,depth_kg,dip_deg,azimuth_deg\nA,1,1,1\n", None, "table-unit"),
    ],
)
def test_shots_that_cannot_be_meant(tmp_path, text, line, words):
    with refused(words, error=FileError) as caught:
        read_shots(table(tmp_path, text))
    assert caught.value.line == line


def test_collars_and_their_ends(tmp_path):
    path = table(tmp_path, "hole,x_m,y_m,RL (ft),EOH (m)\nA,500,7000,100,50\nB,510,7010,0,\nA,501,7001,100,60\n")
    collars, _ = read_collars(path)
    assert list(collars) == ["A", "B"]
    assert [(c.east, c.north, c.end, c.line) for c in collars["A"]] == [
        (500.0, 7000.0, 50.0, 2),
        (501.0, 7001.0, 60.0, 4),
    ]
    assert collars["A"][0].elevation == pytest.approx(100.0 * FOOT)
    assert np.isnan(collars["B"][0].end)
    # without a column of ends there are none
    assert np.isnan(read_collars(table(tmp_path, "hole,x_m,y_m,z_m\nA,1,2,3\n"))[0]["A"][0].end)
    for text, line, words in (
        ("hole,x_m,y_m\nA,1,2\n", 1, "file-column"),
        ("hole,x_m,y_m,z_m\nA,1,2,3\nB,1,,3\n", 3, "input-empty"),
    ):
        with refused(words, error=FileError) as caught:
            read_collars(table(tmp_path, text))
        assert caught.value.line == line


def test_what_a_column_of_shots_is():
    names = ("Hole-ID", "Depth", "Survey Depth (ft)", "plunge", "inc_deg", "BRG", "assay", "Dip (kg)")
    assert [hole_column(n) for n in names] == ["hole", "depth", "depth", "dip", "inclination", "azimuth", "", ""]


def test_positions_are_written_from_the_collar(tmp_path):
    """A hole that dips 60 degrees towards the east, then bends by 3 degrees in 30 m; one straight down."""
    bent = drill_hole([0.0, 30.0, 60.0], np.radians([30.0, 30.0, 33.0]), np.radians([90.0, 90.0, 90.0])).path
    down = drill_hole([0.0, 10.0], [0.0, 0.0], [0.0, 0.0]).path
    write_positions(tmp_path / "p.csv", [("A", bent, (500.0, 7000.0, 100.0)), ("B", down, (1.0, 2.0, 3.0))])
    with (tmp_path / "p.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["hole"] for row in rows] == ["A", "A", "A", "B", "B"]
    second = {name: float(text) for name, text in rows[1].items() if name != "hole"}
    assert second == pytest.approx(
        {"md_m": 30.0, "inclination_deg": 30.0, "azimuth_deg": 90.0, "east_m": 515.0, "north_m": 7000.0,
         "elevation_m": 100.0 - 30.0 * np.cos(np.radians(30.0)), "dls_deg_30m": 0.0}, abs=1e-6
    )  # fmt: skip
    lengths = [row[name].partition(".")[2] for row in rows for name in ("east_m", "elevation_m", "dls_deg_30m")]
    assert max(map(len, lengths)) == 6
    assert float(rows[2]["dls_deg_30m"]) == pytest.approx(3.0, abs=1e-6)
    assert (rows[4]["east_m"], rows[4]["north_m"], rows[4]["elevation_m"]) == ("1", "2", "-7")
