"""Legs written for cave-survey programs, parsed by the grammar of each: positions as by minimum curvature."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.constants import FOOT
from inclinometry.files.cave import write_compass, write_survex, write_therion
from inclinometry.files.six_axis import read_survey, write_excel_csv
from inclinometry.files.survey_file import SurveyFile
from inclinometry.survey.path import minimum_curvature

from .surveys import same

MD = np.array([0.0, 30.0, 60.0, 95.0, 130.0])
INCLINATION = np.radians([0.0, 0.0, 20.0, 75.0, 100.0])
AZIMUTH = np.radians([0.0, 0.0, 350.0, 15.0, 20.0])
SURVEY = SurveyFile(
    md=MD, inclination=INCLINATION, azimuth=AZIMUTH, azimuth_reference="magnetic", reference={"declination": 0.05}
)

# After the documented examples: manual of Survex (DATA), Therion Book (centreline), page of Compass on its format.
SURVEX_EXAMPLE = """*begin entrance ; a comment
*units tape metres
*data normal from to tape compass clino
1 2 10.00 031 -05
2\t3 6.50 - -90
*end entrance
"""
THERION_EXAMPLE = """survey main -title "Test cave"
  centreline
    units compass clino grads
    data normal from to compass clino length
      1 2 100 -5 10
  endcentreline
endsurvey
"""
COMPASS_EXAMPLE = (
    "SECRET CAVE\r\nSURVEY NAME: A\r\nSURVEY DATE: 7 10 79  COMMENT:Entrance Passage\r\nSURVEY TEAM:\r\n"
    "D.SMITH,R.BROWN,S.MURRAY\r\nDECLINATION: 1.00  FORMAT: DDDDLUDRADLN  CORRECTIONS: 2.00 3.00 4.00\r\n\r\n"
    "FROM TO  LENGTH BEARING  DIP    LEFT    UP  DOWN RIGHT\r\n\r\n"
    "A2  A1   12.00  135.00   5.00  0.00  4.00  0.50  0.00  Big Room\r\n"
    "A3  A4    4.25   15.00 -85.00  5.00  3.50  0.75  0.50\r\n\f"
)
FACTORS = {"metres": 1.0, "feet": FOOT, "degrees": 1.0, "grads": 0.9}


def parse_commands(text: str, comment: str, command: str) -> tuple[list[tuple[str, str, float, float, float]], float]:
    """Legs (from, to, m, deg, deg) and declination of Survex or Therion data; an unknown command is an error."""
    units = {"length": 1.0, "compass": 1.0, "clino": 1.0}
    order: list[str] = []
    found, declination, open_, inside = [], 0.0, 0, False
    same = {"tape": "length", "bearing": "compass", "gradient": "clino"}
    for line in text.splitlines():
        words = line.split(comment)[0].split()
        if not words:
            continue
        word = words[0].removeprefix(command).lower()
        is_command = line.strip().startswith(command) if command else not inside or word.isalpha()
        if not is_command:
            cells = dict(zip(order, words, strict=True))
            bearing = 0.0 if cells["compass"] == "-" else float(cells["compass"]) * units["compass"]
            length, clino = float(cells["length"]) * units["length"], float(cells["clino"]) * units["clino"]
            found.append((cells["from"], cells["to"], length, bearing, clino))
        elif word in ("begin", "survey", "centreline"):
            open_ += 1
        elif word in ("end", "endsurvey", "endcentreline"):
            open_, inside = open_ - 1, False
        elif word == "units":
            for name in words[1:-1]:
                units[same.get(name, name)] = FACTORS[words[-1]]
        elif word == "declination":
            declination = float(words[1]) * FACTORS[words[2]]
        elif word == "data":
            assert words[1] == "normal"
            order, inside = [same.get(name, name) for name in words[2:]], True
        else:
            assert word == "encoding", line
    assert open_ == 0
    return found, declination


def parse_compass(text: str) -> tuple[list[tuple[str, str, float, float, float]], float]:
    """Legs of a Compass survey: feet and degrees in the file whatever FORMAT says is shown."""
    assert text.endswith("\f")
    lines = text.split("\r\n")
    assert lines[1].startswith("SURVEY NAME:")
    assert re.match(r"SURVEY DATE: \d+ \d+ \d+", lines[2])
    assert lines[3].startswith("SURVEY TEAM:")
    head = re.match(r"DECLINATION: +(\S+)  FORMAT: (\w{12,15})  CORRECTIONS: \S+ \S+ \S+", lines[5])
    assert head
    form = head[2]
    assert (form[0], form[1] in "DIM", form[3]) == ("D", True, "D")
    assert (sorted(form[4:8]), sorted(form[8:11])) == (sorted("LUDR"), sorted("LAD"))
    assert lines[7].split()[:3] == ["FROM", "TO", "LENGTH"]
    assert lines[6] == lines[8] == ""
    found = []
    for line in lines[9:-1]:
        cells = line.split()
        assert all(len(name) <= 12 for name in cells[:2])
        assert len([float(cell) for cell in cells[2:9]]) == 7
        found.append((cells[0], cells[1], float(cells[2]) * FOOT, float(cells[3]), float(cells[4])))
    return found, float(head[1])


def read_legs(path: Path) -> tuple[list[tuple[str, str, float, float, float]], float]:
    text = path.read_bytes().decode()
    if path.suffix == ".dat":
        return parse_compass(text)
    return parse_commands(text, ";", "*") if path.suffix == ".svx" else parse_commands(text, "#", "")


@pytest.mark.parametrize(
    ("text", "ending", "legs"),
    [
        (SURVEX_EXAMPLE, "svx", [("1", "2", 10.0, 31.0, -5.0), ("2", "3", 6.5, 0.0, -90.0)]),
        (THERION_EXAMPLE, "th", [("1", "2", 10.0, 90.0, -4.5)]),
        (COMPASS_EXAMPLE, "dat", [("A2", "A1", 12.0 * FOOT, 135.0, 5.0), ("A3", "A4", 4.25 * FOOT, 15.0, -85.0)]),
    ],
)
def test_the_grammars_here_take_the_documented_examples(tmp_path, text, ending, legs):
    path = tmp_path / f"example.{ending}"
    path.write_bytes(text.encode())
    assert read_legs(path)[0] == [pytest.approx(leg) if isinstance(leg, float) else leg for leg in legs]


@pytest.mark.parametrize(("write", "ending"), [(write_survex, "svx"), (write_therion, "th"), (write_compass, "dat")])
def test_legs_lead_to_the_positions_of_minimum_curvature(tmp_path, write, ending):
    write(SURVEY, tmp_path / f"hole 7.{ending}")
    legs, declination = read_legs(tmp_path / f"hole 7.{ending}")
    assert declination == pytest.approx(np.degrees(0.05), abs=0.005)
    assert [(leg[0], leg[1]) for leg in legs] == [(str(k), str(k + 1)) for k in range(4)]
    at = np.zeros((5, 3))
    for k, (_, _, length, bearing, clino) in enumerate(legs):
        b, c = np.radians([bearing, clino])
        at[k + 1] = at[k] + length * np.array([np.cos(c) * np.cos(b), np.cos(c) * np.sin(b), -np.sin(c)])
    path = minimum_curvature(MD, INCLINATION, AZIMUTH)
    # lengths are written to 0.1 mm, angles to 0.0001 deg
    assert np.abs(at - np.column_stack([path.north, path.east, path.tvd])).max() < 5e-4


def test_a_survey_from_true_north_gets_no_declination(tmp_path):
    true = SurveyFile(md=MD, inclination=INCLINATION, azimuth=AZIMUTH, azimuth_reference="true",
                      reference={"declination": 0.05})  # fmt: skip
    write_survex(true, tmp_path / "a.svx")
    assert "declination" not in (tmp_path / "a.svx").read_text()
    assert "azimuths from true north" in (tmp_path / "a.svx").read_text()


def test_what_cannot_be_legs(tmp_path):
    lacking = SurveyFile(md=MD, inclination=INCLINATION)
    with refused("input-missing", names=("inclination_deg", "azimuth_deg")):
        write_survex(lacking, tmp_path / "a.svx")
    empty = SurveyFile(md=MD, inclination=INCLINATION, azimuth=[0, np.nan, 0, 0, 0], azimuth_reference="true")
    with refused("table-empty"):
        write_therion(empty, tmp_path / "a.th")
    two = SurveyFile(md=MD, inclination=INCLINATION, azimuth=AZIMUTH, azimuth_reference="magnetic",
                     reference={"declination": [0.05, 0.05, 0.05, 0.05, 0.06]})  # fmt: skip
    with refused("table-declination"):
        write_compass(two, tmp_path / "a.dat")
    assert not list(tmp_path.iterdir())


def test_a_spreadsheet_with_decimal_commas(tmp_path):
    survey = SurveyFile(md=MD, inclination=INCLINATION, azimuth=AZIMUTH, azimuth_reference="true",
                        extra={"remark": ("v 1.5; checked",) * 5})  # fmt: skip
    write_excel_csv(survey, tmp_path / "a.csv")
    data = (tmp_path / "a.csv").read_bytes()
    assert data.startswith(b"\xef\xbb\xbfmd_m;inclination_deg;")
    assert b'"v 1.5; checked"' in data
    assert same(read_survey(tmp_path / "a.csv"), survey, rtol=1e-12)


def test_one_station_is_no_leg_and_stations_not_used_are_none(tmp_path):
    one = SurveyFile(md=[0.0], inclination=[0.1], azimuth=[1.0], azimuth_reference="true")
    with refused("input-few", name="stations"):
        write_survex(one, tmp_path / "a.svx")
    used = SurveyFile(md=MD, inclination=INCLINATION, azimuth=AZIMUTH, azimuth_reference="true",
                      used=[True, True, False, True, True])  # fmt: skip
    write_survex(used, tmp_path / "a.svx")
    assert [leg[:2] for leg in read_legs(tmp_path / "a.svx")[0]] == [("0", "1"), ("1", "2"), ("2", "3")]
