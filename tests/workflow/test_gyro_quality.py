"""Files of an in-run and an out-run: north, flags, limits."""

import json
from pathlib import Path

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.earth.site import Site
from inclinometry.errors import FileError
from inclinometry.files.limits import read_repeat_limits
from inclinometry.files.survey_csv import write_survey_csv
from inclinometry.workflow.gyro_quality import check_json, compare_run_files, comparison_json, read_run, run_checks

TEXT = """source = "contract"
inclination_deg = 0.1
azimuth_deg = 0.2
azimuth_steep_deg = 0.3
steep_below_deg = 5
stations = 3
interval_m = 10
"""


def write(path, inclination=30.0, azimuth=100.0, north="true", flags="", count=12):
    spread = lambda v: np.radians(np.broadcast_to(v, (count,)).astype(float))  # noqa: E731
    flags = [flags] * count if isinstance(flags, str) else flags
    columns = {"md": 30.0 * np.arange(count), "inclination": spread(inclination), "azimuth": spread(azimuth)}
    write_survey_csv(path, {**columns, "azimuth_reference": north, "flags": flags})
    return path


def test_the_file_s_columns_beyond_the_survey_do_not_matter(tmp_path):
    path = write(tmp_path / "a.csv")
    lines = path.read_text().splitlines()
    more = [lines[0] + ",scale,u_scale,root,K,temperature_degC", *(row + ",1,0.001,+,0.7,90" for row in lines[1:])]
    path.write_text("\n".join(more))
    found = compare_run_files(path, write(tmp_path / "b.csv", 30.1, 100.4))
    assert found.verdict == "pass"
    np.testing.assert_allclose(np.degrees(found.azimuth), 0.4, atol=1e-9)


def test_the_site_brings_both_to_one_north(tmp_path):
    one, two = write(tmp_path / "a.csv"), write(tmp_path / "b.csv", azimuth=98.0, north="grid")
    with refused("work-norths", norths=("true", "grid")):
        compare_run_files(one, two)
    # only the correction between the two is asked for, whatever north the site reports from
    for north in ("grid", "magnetic"):
        found = compare_run_files(one, two, Site(north_reference=north, convergence=np.radians(2.1)))
        np.testing.assert_allclose(np.degrees(found.azimuth), 0.1, atol=1e-9)
    with refused("earth-site-lacks", name="convergence"):
        compare_run_files(one, two, Site(declination=0.1))


@pytest.mark.parametrize("north", ["true", "grid", "magnetic"])
def test_of_runs_from_one_north_the_site_is_not_asked(tmp_path, north):
    files = write(tmp_path / "a.csv", north=north), write(tmp_path / "b.csv", azimuth=100.5, north=north)
    for site in (None, Site(latitude=0.9), Site(latitude=0.9, north_reference="grid")):
        found = compare_run_files(*files, site)
        assert found.verdict == "pass"
        np.testing.assert_allclose(np.degrees(found.azimuth), 0.5, atol=1e-9)


def test_the_same_run_twice_is_refused(tmp_path):
    path = write(tmp_path / "a.csv")
    copy = tmp_path / "b.csv"
    copy.write_bytes(path.read_bytes())
    for other in (path, copy):
        with refused("input-same-file", error=FileError, other="a.csv"):
            compare_run_files(path, other)
    # other bytes, the same azimuths; and the same from another north
    with refused("survey-runs-same", quantity="azimuth"):
        compare_run_files(path, write(tmp_path / "c.csv", inclination=30.1))
    with refused("survey-runs-same", quantity="azimuth"):
        compare_run_files(
            path, write(tmp_path / "d.csv", azimuth=98.0, north="grid"), Site(convergence=np.radians(2.0))
        )


def test_vertical_stations_have_no_azimuth_and_flags_are_judged(tmp_path):
    path = write(tmp_path / "a.csv", flags=["vertical|weak", "misfit", *[""] * 10])
    assert np.isnan(read_run(path).azimuth).tolist() == [True, *[False] * 11]
    checks, notes = run_checks(path)
    assert {c.name: c.stations for c in checks if c.verdict == "fail"} == {"flag misfit": (1,)}
    assert len(notes) == 2
    assert all(c.verdict == "pass" for c in run_checks(write(tmp_path / "b.csv"))[0])


def test_files_that_are_no_run(tmp_path):
    with refused("input-north", error=FileError, norths=("grid", "true")):
        read_run(write(tmp_path / "a.csv", north=["true"] * 11 + ["grid"]))
    with refused("input-value", error=FileError, name="inclination_deg"):
        read_run(write(tmp_path / "a.csv", inclination=np.where(np.arange(12) == 2, np.nan, 30.0)))


def test_everything_is_plain_data_in_degrees(tmp_path):
    found = compare_run_files(write(tmp_path / "a.csv"), write(tmp_path / "b.csv", azimuth=102.0))
    text = json.loads(json.dumps(comparison_json(found)))
    assert text["verdict"] == "fail"
    assert text["statistics"]["azimuth"]["mean_deg"] == pytest.approx(2.0, abs=1e-9)
    bad = next(c for c in text["checks"] if c["verdict"] == "fail")
    assert (bad["unit"], bad["stations"][0]) == ("deg", 1)
    assert bad["limit"] == pytest.approx(1.0)
    assert check_json(found.checks[0])["unit"] == "stations"


def test_the_shipped_limits_are_the_source_s():
    found = read_repeat_limits()
    values = np.degrees([found.inclination, found.azimuth, found.azimuth_steep, found.steep])
    np.testing.assert_allclose(values, [0.23, 1.0, 5.0, 10.0], rtol=1e-12)
    assert found.stations == 10
    assert "drillingforgas" in found.source


def test_limits_of_one_s_own(tmp_path):
    path = Path(tmp_path, "own.toml")
    path.write_text(TEXT)
    assert read_repeat_limits(path).name == "own"
    one, two = write(tmp_path / "a.csv", count=4), write(tmp_path / "b.csv", 30.05, 100.05, count=4)
    assert compare_run_files(one, two, limits=path).verdict == "pass"
    for line, instead, code, values in (
        ("stations = 3\n", "", "input-missing", {"names": ("stations",)}),
        (
            "stations = 3",
            "stations = 3.5",
            "input-kind",
            {"name": "stations", "value": 3.5, "expected": "whole"},
        ),
        ("inclination_deg", "dip_deg", "input-unknown", {"names": ("dip_deg",)}),
    ):
        path.write_text(TEXT.replace(line, instead))
        with refused(code, error=FileError, **values):
            read_repeat_limits(path)
    with refused("input-choice", name="limits", value="gyro-repaet", allowed=("gyro-repeat", "*.toml")):
        read_repeat_limits("gyro-repaet")
