"""P7/17: the format's own example tells the axes; what is written reads back to the byte."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files.p7 import p7_file, read_p7, write_p7
from inclinometry.files.survey_file import SurveyFile
from inclinometry.orientation import angles, dip_angle, fields

from .surveys import same, saved

# The station of the sample code published with the format (B. Kampes, 2019, free to use), fields in the order of
# version 1.0: inclination 36.0, grid azimuth 75.43 with declination -2, so magnetic 77.43
EXAMPLE = (
    "M7,0,1,1,2014:09:17:13:15:22.0,1,1,1740.0,36.0, 75.43,41.92,158.75,1705.16,4.177509,3.972274,7.934024,"
    "10182.6299,36850.9976,52571.98776,-133.557428,304.220706,9.807103,65003.81429,71.921632,9.806986,65094.495067,"
    "71.939312,-2.0,0.0,"
)
DETAILS = "H7,1,5,1,Survey Details,{n},{unit},1,MD-Drillpipe,3,Corrected Depth,1,{az},AZIM,3,calc,0,0,0,0,,1,1"
HEAD = "IOGP,Example,7,1.0,1,2018:08:30,14:42:26,a.p717,me"


def p7(folder, *lines):
    path = folder / "a.p717"
    path.write_text("\n".join(lines) + "\n")
    return path


def example(folder, unit=1, az=8):
    return p7(folder, HEAD, "CC,0,0,0,a comment, with commas", DETAILS.format(n=1, unit=unit, az=az), EXAMPLE)


def magnetic(size=4):
    inclination, azimuth = np.radians(np.linspace(5, 60, size)), np.radians(np.linspace(20, 70, size))
    toolface = np.radians(np.linspace(10, 300, size))
    g, b = fields(azimuth, inclination, toolface, np.radians(72.0))
    n = np.arange(size)
    return SurveyFile(
        md=100.0 + 30.0 * n, inclination=inclination, azimuth=azimuth, azimuth_reference="magnetic", north=5.0 * n,
        east=3.0 * n, tvd=99.0 + 29.0 * n, g=9.81 * g, b=5e4 * b, toolface=toolface, magnetic_toolface=azimuth,
        measured={"g": np.full(size, 9.81), "b": np.full(size, 5e4), "dip": np.full(size, np.radians(72.0))},
        reference={"g": 9.8, "b": 50_100.0, "dip": 1.25, "declination": -0.05, "convergence": 0.01}, used=n != 2,
        times=tuple(f"2024-05-01T10:00:0{i}.25Z" for i in range(size)),
    )  # fmt: skip


def gyro(size=4):
    base = magnetic(size)
    w = fields(base.azimuth, base.inclination, base.toolface, np.radians(-60.0))[1] * 7.292115e-5
    return replace(
        base, b=None, w=w, azimuth_reference="true", magnetic_toolface=None, gyro_toolface=base.toolface,
        measured={"g": np.full(size, 9.81), "latitude": np.full(size, 1.04), "earth_rate": np.full(size, 7.29e-5)},
        reference={"g": 9.8, "latitude": 1.05, "earth_rate": 7.292e-5, "convergence": 0.01},
    )  # fmt: skip


def test_the_formats_example_has_iscwsa_axes(tmp_path):
    """Angles from the six axes equal those stated beside them, to the digits they are printed with."""
    survey = read_p7(example(tmp_path)).surveys[1]
    seen = angles(survey.g, survey.b)
    assert np.degrees(seen.inclination[0]) == pytest.approx(36.0, abs=0.005)
    # magnetic azimuth plus declination -2, convergence 0, is the grid azimuth stated
    assert np.degrees(seen.azimuth[0]) - 2.0 == pytest.approx(np.degrees(survey.azimuth[0]), abs=0.006)
    assert np.degrees(seen.toolface[0]) - 360.0 == pytest.approx(np.degrees(survey.toolface[0]), abs=1e-5)
    assert np.degrees(dip_angle(survey.g, survey.b)[0]) == pytest.approx(71.921632, abs=1e-5)
    assert np.linalg.norm(survey.g[0]) == pytest.approx(survey.measured["g"][0], abs=1e-6)
    assert np.linalg.norm(survey.b[0]) == pytest.approx(survey.measured["b"][0], abs=1e-3)
    assert survey.azimuth_reference == "grid"
    assert survey.times == ("2014-09-17T13:15:22.0Z",)


def test_records_are_kept_and_counted(tmp_path):
    found = read_p7(example(tmp_path))
    assert found.counts == {"IOGP": 1, "CC": 1, "H7": 1, "M7": 1}
    assert found.records == (HEAD, "CC,0,0,0,a comment, with commas", DETAILS.format(n=1, unit=1, az=8))
    write_p7(found, tmp_path / "b.p717")
    assert (tmp_path / "b.p717").read_text().splitlines()[:3] == list(found.records)
    assert same(read_p7(tmp_path / "b.p717").surveys[1], found.surveys[1])


@pytest.mark.parametrize("convention", ["iscwsa", "native", "specific-force", "z-up"])
@pytest.mark.parametrize("survey", [magnetic(), gyro()], ids=["M7", "G7"])
def test_round_trip_to_the_byte(tmp_path, survey, convention):
    """Angles are written to 1e-10 deg (2e-12 rad), rates to 1e-10 deg/h."""
    first, second = tmp_path / "a.p717", tmp_path / "b.p717"
    write_p7(p7_file(survey), first, convention=convention)
    found = read_p7(first, convention=convention)
    assert same(replace(found.surveys[1], extra={}), survey, rtol=1e-13)
    write_p7(found, second, convention=convention)
    assert second.read_bytes() == first.read_bytes()


def test_feet(tmp_path):
    found = read_p7(example(tmp_path, unit=5))
    assert found.surveys[1].md[0] == pytest.approx(1740.0 * 0.3048)
    assert found.surveys[1].north[0] == pytest.approx(41.92 * 0.3048)
    write_p7(found, tmp_path / "b.p717")
    assert ",1740,36,75.43,41.92,158.75,1705.16," in (tmp_path / "b.p717").read_text()


def test_two_surveys_and_unknown_records(tmp_path):
    magnetic_, gyro_ = p7_file(magnetic(), number=1), p7_file(gyro(), number=7)
    records = (magnetic_.records[0], magnetic_.records[1], gyro_.records[1], "ZZ,whatever", "")
    both = replace(magnetic_, surveys={**magnetic_.surveys, **gyro_.surveys}, records=records)
    write_p7(both, tmp_path / "a.p717")
    found = read_p7(tmp_path / "a.p717")
    assert list(found.surveys) == [1, 7]
    assert found.counts == {"IOGP": 1, "H7": 2, "ZZ": 1, "M7": 4, "G7": 4}
    assert found.records == records
    assert found.surveys[7].b is None


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("IOGP,", "XOGP,", 1, "file-section"),
        (",7,1.0", ",1,1.0", 1, "file-section"),
        (EXAMPLE, EXAMPLE[:-30], 4, "table-row-width"),
        (EXAMPLE, EXAMPLE.replace(",1,1,1740", ",1,1740.0,36.0"), 4, "input-value used"),
        (EXAMPLE, EXAMPLE.replace("1740.0", "NaN"), 4, "input-finite md (m)"),
        (EXAMPLE, EXAMPLE.replace("1740.0", ""), 4, "table-empty"),
        (EXAMPLE, EXAMPLE.replace("4.177509", "abc"), 4, "input-kind gx_m_s2"),
        (EXAMPLE, EXAMPLE.replace("36.0", "236.0"), 4, "input-value inclination_deg"),
        (EXAMPLE, EXAMPLE.replace("2014:09:17", "2014-09-17"), 4, "input-value time"),
        (EXAMPLE, EXAMPLE + "\n" + EXAMPLE, 5, "input-order"),
        (EXAMPLE, EXAMPLE + "\n" + "G7" + ",1" * 27, 5, "input-one-of M7"),
        (EXAMPLE, EXAMPLE.replace("M7,0,1", "M7,0,x"), 4, "input-kind survey"),
        (EXAMPLE, "", None, "file-section"),
        ("Details,1,1,", "Details,1,9,", 3, "table-unit"),
        ("Details,1,1,", "Details,2,1,", 4, "input-missing --depth-unit"),
        (",AZIM,3,calc,0,0,0,0,,1,1", "", 3, "table-row-width"),
        ("Corrected Depth,1,8", "Corrected Depth,1,9", None, "table-north"),
    ],
)
def test_one_error_with_its_line(tmp_path, old, new, line, words):
    path = example(tmp_path)
    text = path.read_text()
    if old not in text:
        raise ValueError(old)
    with refused(words, error=FileError) as caught:
        read_p7(saved(path, text.replace(old, new)))
    assert caught.value.line == line


def test_survey_details_cut_behind_the_north(tmp_path):
    path = example(tmp_path)
    wanted = read_p7(path).surveys[1]
    assert same(read_p7(saved(path, path.read_text().replace(",3,calc,0,0,0,0,,1,1", ""))).surveys[1], wanted)


def test_without_survey_details(tmp_path):
    path = p7(tmp_path, HEAD, EXAMPLE)
    found = read_p7(path, depth_unit="ft", azimuth_reference="grid").surveys[1]
    assert found.md[0] == pytest.approx(1740.0 * 0.3048)
    with refused("input-missing", error=FileError, names=("--depth-unit",)):
        read_p7(path, azimuth_reference="grid")
    with refused("table-units", error=FileError):
        read_p7(example(tmp_path), depth_unit="ft")


def test_a_shot_not_used_may_repeat_a_depth(tmp_path):
    path = p7(
        tmp_path, HEAD, DETAILS.format(n=1, unit=1, az=8), EXAMPLE.replace(",1,1,1740", ",1,0,1740"), EXAMPLE
    )  # fmt: skip
    np.testing.assert_array_equal(read_p7(path).surveys[1].used, [False, True])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"w": np.zeros((4, 3))}, "input-one-of b"),
        ({"b": None}, "input-one-of b"),
        ({"times": ("noon",) * 4}, "input-kind time"),
        ({"extra": {"p7_extension": ("a,b",) * 4}}, "file-characters"),
        ({"extra": {"p7_extension": ("a\nb",) * 4}}, "file-characters"),
    ],
)
def test_writer_refuses(tmp_path, change, words):
    with refused(words):
        write_p7(p7_file(replace(magnetic(), **change)), tmp_path / "a.p717")
    assert not list(tmp_path.iterdir())


def test_empty_and_missing_files(tmp_path):
    (tmp_path / "a").write_bytes(b"")
    for path in (tmp_path / "a", tmp_path / "none"):
        with pytest.raises(FileError):
            read_p7(path)


numbers = st.floats(-1e4, 1e4, allow_nan=False).map(lambda v: round(v, 6))


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(*[numbers] * 6, st.sampled_from(["", "1; 2", "ü"])), min_size=1, max_size=4))
def test_numbers_and_texts_survive(rows):
    values = np.array([row[:6] for row in rows])
    survey = SurveyFile(
        md=np.arange(len(rows)) * 9.5, g=values[:, :3] / 100.0, b=values[:, 3:],
        extra={"p7_extension": tuple(row[6] for row in rows)},
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a.p717")
        write_p7(p7_file(survey), path)
        found = read_p7(path)
        np.testing.assert_array_equal(found.surveys[1].g, survey.g + 0.0)
        np.testing.assert_array_equal(found.surveys[1].b, survey.b + 0.0)
        first = path.read_bytes()
        write_p7(found, path)
        assert path.read_bytes() == first


@pytest.mark.parametrize(("code", "metre"), [(1, 1.0), (5, 1.0 / 0.3048), (6, 3937.0 / 1200.0)])
def test_depths_in_the_unit_of_the_record(tmp_path, code, metre):
    """A foot of the US survey is 1200/3937 m."""
    records = (HEAD, DETAILS.format(n=1, unit=code, az=8))
    write_p7(replace(p7_file(magnetic()), records=records), tmp_path / "b.p717")
    cells = [line.split(",") for line in (tmp_path / "b.p717").read_text().splitlines() if line.startswith("M7")]
    assert [float(row[7]) for row in cells] == pytest.approx(metre * (100.0 + 30.0 * np.arange(4)), abs=1e-9)
    decimals = [len(row[7].partition(".")[2]) for row in cells]
    assert max(decimals) == (0 if code == 1 else 10)
    np.testing.assert_allclose(read_p7(tmp_path / "b.p717").surveys[1].md, 100.0 + 30.0 * np.arange(4), rtol=1e-12)
    with refused("file-section"):
        write_p7(replace(p7_file(magnetic(), number=2), records=records), tmp_path / "c.p717")
    with refused("table-row-width", error=FileError) as caught:
        read_p7(saved(tmp_path / "d.p717", f"{HEAD}\n{DETAILS.format(n='x', unit=1, az=8)}\n{EXAMPLE}\n"))
    assert caught.value.line == 2
