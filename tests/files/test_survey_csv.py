"""Raw surveys, surveys, plans and logs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.errors import FileError
from inclinometry.files.bench_csv import read_plan, write_plan
from inclinometry.files.columns import SURVEY
from inclinometry.files.log_csv import read_log
from inclinometry.files.survey_csv import read_raw_survey, read_survey_csv, write_survey_csv

ANGLES = ("inclination", "azimuth", "toolface", "magnetic_toolface", "dip", "u_inclination", "u_azimuth", "u_toolface")


def text_file(folder, text):
    path = folder / "t.csv"
    path.write_text(text, "utf-8")
    return path


def test_a_raw_survey(tmp_path):
    header = "station,md_m,temperature_degC,accel_x,accel_y,accel_z,mag_1_nT,mag_2_nT,remark\n"
    raw = read_raw_survey(text_file(tmp_path, header + "a,10,20,1,2,3,4,5,first\n\nb,20.5,21,2,3,4,5,6,\n"))
    assert raw.md.tolist() == [10.0, 20.5]
    assert raw.channels["accelerometer"].tolist() == [[1, 2, 3], [2, 3, 4]]
    assert raw.channels["magnetometer"].tolist() == [[4, 5], [5, 6]]
    assert dict(raw.units) == {"accelerometer": "counts", "magnetometer": "nT"}
    assert raw.temperature.tolist() == [20, 21]
    assert dict(raw.extra) == {"station": ("a", "b"), "remark": ("first", "")}
    assert raw.lines.tolist() == [2, 4]
    assert len(raw) == 2


def test_feet_are_converted(tmp_path):
    raw = read_raw_survey(text_file(tmp_path, "md_ft,accel_x,accel_y\n0,1,2\n1000,2,3\n"))
    np.testing.assert_allclose(raw.md, [0.0, 304.8], rtol=1e-15)
    assert raw.temperature is None


@pytest.mark.parametrize(
    ("header", "rows", "wanted"),
    [
        ("md_m", ["10,1,2", "20,1,2", "20,1,2"], "input-order"),
        ("md_ft", ["10,1,2", "30,1,2", "20,1,2"], "input-order"),
        ("md", ["10,1,2"], "table-unit-missing"),
        ("depth", ["10,1,2"], "table-unit-missing"),
        ("md_m,md_ft", ["1,2,3,4"], "table-same"),
    ],
)
def test_depths_that_do_not_fit(tmp_path, header, rows, wanted):
    path = text_file(tmp_path, f"{header},accel_x,accel_y\n" + "\n".join(rows))
    with refused(wanted, error=FileError):
        read_raw_survey(path)


def survey(size=4, seed=1):
    rng = np.random.default_rng(seed)
    columns = {name: rng.uniform(0.0, 3.0, size) for name in ANGLES}
    columns |= {"md": np.cumsum(rng.uniform(1, 9, size)), "g_total": rng.normal(9.8, 0.01, size)}
    columns |= {"b_total": rng.normal(5e4, 9.0, size), "azimuth_reference": ("true",) * size, "flags": ("",) * size}
    return columns


def test_the_contract_of_the_survey_file(tmp_path):
    columns = survey() | {"flags": ["", "hot", "no dip; hot", ""], "azimuth_reference": "magnetic"}
    columns["azimuth"][1] = np.nan
    write_survey_csv(tmp_path / "s.csv", columns)
    lines = (tmp_path / "s.csv").read_text().splitlines()
    assert lines[0] == (
        "md_m,inclination_deg,azimuth_deg,azimuth_reference,toolface_deg,magnetic_toolface_deg,g_total,b_total_nT,"
        "dip_deg,u_inclination_deg,u_azimuth_deg,u_toolface_deg,flags"
    )
    cells = dict(zip(SURVEY, lines[2].split(","), strict=True))
    assert cells["azimuth_deg"] == ""
    assert cells["azimuth_reference"] == "magnetic"
    assert cells["flags"] == "hot"
    assert float(cells["inclination_deg"]) == pytest.approx(np.degrees(columns["inclination"][1]), abs=1e-10)
    assert float(cells["g_total"]) == columns["g_total"][1]


@settings(max_examples=50, deadline=None)
@given(st.data(), st.integers(1, 8))
def test_write_then_read_gives_the_same_survey(tmp_path_factory, data, size):
    path = tmp_path_factory.getbasetemp() / "survey.csv"
    # NaN stands for what a station could not determine
    columns = {n: data.draw(arrays(float, size, elements=st.floats(0, 3) | st.just(np.nan))) for n in ANGLES}
    columns |= {n: data.draw(arrays(float, size, elements=st.floats(1e-9, 1e6))) for n in ("g_total", "b_total")}
    columns["md"] = np.cumsum(data.draw(arrays(float, size, elements=st.floats(0.01, 1e3))))
    words = st.text(st.characters(exclude_categories=["C", "Z"]), max_size=8)
    columns["flags"] = tuple(data.draw(st.lists(words, min_size=size, max_size=size)))
    columns["azimuth_reference"] = ("grid",) * size
    write_survey_csv(path, columns)
    found = read_survey_csv(path)
    assert found["flags"] == columns["flags"]
    assert found["azimuth_reference"] == columns["azimuth_reference"]
    for name in ("md", "g_total", "b_total"):
        np.testing.assert_array_equal(found[name], columns[name])
    for name in ANGLES:
        # printed to 1e-10 deg
        np.testing.assert_allclose(found[name], columns[name], atol=2e-12)


def test_a_full_turn_prints_as_zero(tmp_path):
    write_survey_csv(tmp_path / "s.csv", {"md": [1.0], "azimuth": [2 * np.pi - 1e-15], "toolface": [-1e-15]})
    found = read_survey_csv(tmp_path / "s.csv")
    assert found["azimuth"].tolist() == [0.0]
    assert found["toolface"].tolist() == [0.0]
    assert np.isnan(found["dip"]).all()


@pytest.mark.parametrize(
    ("columns", "wanted"),
    [
        ({"md": [1.0], "incl": [1.0]}, "input-unknown"),
        ({"inclination": [1.0]}, "input-missing"),
        ({"md": [1.0], "dip": [1.0, 2.0]}, "input-shape"),
        ({"md": [1.0], "dip": [np.inf]}, "input-finite"),
        ({"md": [1.0], "flags": ["a\nb"]}, "file-characters"),
    ],
)
def test_surveys_that_cannot_be_written(tmp_path, columns, wanted):
    with refused(wanted):
        write_survey_csv(tmp_path / "s.csv", columns)
    assert list(tmp_path.iterdir()) == []


def test_a_survey_needs_all_its_columns(tmp_path):
    with refused("file-column", error=FileError, columns=("inclination_deg",)):
        read_survey_csv(text_file(tmp_path, "md_m\n1\n"))
    header = ",".join(SURVEY)
    with refused("input-order", error=FileError):
        read_survey_csv(text_file(tmp_path, f"{header}\n1{',' * 12}\n1{',' * 12}\n"))


@pytest.mark.parametrize("plan", [plans.twelve(), plans.half(), plans.two_face(), plans.rotations(0.3, 1.0)])
def test_plans_come_back(tmp_path, plan):
    path = tmp_path / f"{plan.name}.csv"
    write_plan(plan, path)
    found = read_plan(path)
    assert (found.name, tuple(found.roll_set)) == (plan.name, tuple(plan.roll_set))
    for name in ("azimuth", "inclination", "toolface"):
        # printed to 1e-10 deg
        np.testing.assert_allclose(getattr(found, name), getattr(plan, name), atol=2e-12)
    first = path.read_bytes()
    write_plan(found, path)
    assert path.read_bytes() == first


def test_plans_that_do_not_fit(tmp_path):
    with refused("table-unit-missing", error=FileError):
        read_plan(text_file(tmp_path, "azimuth,inclination_deg,toolface_deg\n1,2,3\n"))
    with refused("file-column", error=FileError, columns=("azimuth_deg",)):
        read_plan(text_file(tmp_path, "station\n1\n"))
    with refused("input-value", error=FileError, name="inclination_deg"):
        read_plan(text_file(tmp_path, "azimuth_deg,inclination_deg,toolface_deg\n1,200,3\n"))


def test_a_log(tmp_path):
    log = read_log(text_file(tmp_path, "time_s\tgyro_x_deg_h\tgyro_y_deg_h\tmark\n0\t1\t2\ta\n0.01\t3\t4\tb\n"))
    assert log.time.tolist() == [0.0, 0.01]
    assert log.channels["gyro"].tolist() == [[1, 2], [3, 4]]
    assert log.units["gyro"] == "deg/h"
    assert (log.findings[-1].code, log.findings[-1].values["names"]) == ("table-unused", ("mark",))
    assert len(log) == 2


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("time_s,gyro_x,gyro_y\n0,1,2\n0,1,2\n", "input-order"),
        ("time_d,gyro_x,gyro_y\n0,1,2\n", "table-near"),
        ("time,gyro_x,gyro_y\n0,1,2\n", "table-unit-missing"),
        ("gyro_x,gyro_y\n0,1\n", "file-column"),
        ("time_s\n0\n", "file-column"),
    ],
)
def test_logs_that_do_not_fit(tmp_path, text, wanted):
    with refused(wanted, error=FileError):
        read_log(text_file(tmp_path, text))
