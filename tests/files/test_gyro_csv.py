"""Gyro runs as files: what is written is read back, and what cannot be a run is refused with its line."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from tests.refusals import refused

from inclinometry.constants import FOOT
from inclinometry.errors import FileError
from inclinometry.files.columns import SURVEY
from inclinometry.files.gyro_csv import STATION, read_gyro_run, write_gyro_run, write_gyro_stations
from inclinometry.files.survey_csv import read_survey_csv

HEADER = "station,md_m,index_deg,temperature_degC,accel_x,accel_y,gyro_x_deg_h,gyro_y_deg_h,time_s"
ROWS = (
    "A,10,0,20,1,2,3,4,0",
    "A,10,90,20,2,-1,4,-3,60",
    "A,10,180,20,-1,-2,-3,-4,120",
    "B,40,0,21,1,2,3,4,300",
    "B,40,90,21,2,-1,4,-3,360",
    "B,40,180,21,-1,-2,-3,-4,420",
)


def text_file(folder, rows=ROWS, header=HEADER):
    path = folder / "raw.csv"
    path.write_text("\n".join([header, *rows]) + "\n", "utf-8")
    return path


def cell(column, row, value):
    """ROWS with one cell changed; rows from 0."""
    place = HEADER.split(",").index(column)
    changed = [list(line.split(",")) for line in ROWS]
    changed[row][place] = value
    return [",".join(line) for line in changed]


def without(*columns):
    """Header and rows without some columns."""
    keep = [n for n, name in enumerate(HEADER.split(",")) if name not in columns]
    header, *rows = ([line.split(",")[n] for n in keep] for line in (HEADER, *ROWS))
    return ",".join(header), [",".join(line) for line in rows]


def test_a_run(tmp_path):
    run = read_gyro_run(text_file(tmp_path))
    assert len(run) == 2
    assert run.labels == ("A", "B")
    assert run.station.tolist() == [0, 0, 0, 1, 1, 1]
    assert run.md.tolist() == [10.0, 40.0]
    np.testing.assert_allclose(run.index, np.tile([0.0, np.pi / 2, np.pi], 2), rtol=1e-15)
    assert run.channels["gyro"][1].tolist() == [4.0, -3.0]
    assert dict(run.letters) == {"accelerometer": "xy", "gyro": "xy"}
    assert dict(run.units) == {"accelerometer": "counts", "gyro": "deg/h"}
    assert run.mean(run.temperature).tolist() == [20.0, 21.0]
    assert run.time.tolist() == [0, 60, 120, 300, 360, 420]
    assert run.lines.tolist() == [2, 3, 4, 5, 6, 7]
    assert run.findings == ()
    assert run.digest.startswith("sha256:")


def test_what_may_be_absent(tmp_path):
    header, rows = without("temperature_degC", "time_s", "gyro_y_deg_h")
    run = read_gyro_run(text_file(tmp_path, rows, header))
    assert run.temperature is None
    assert run.time is None
    assert run.letters["gyro"] == "x"
    assert run.channels["gyro"].shape == (6, 1)
    # the notes name what is not used
    run = read_gyro_run(text_file(tmp_path, [f"{row},rough" for row in ROWS], f"{HEADER},hole_state"))
    assert [one.values["names"] for one in run.findings] == [("hole_state",)]


def test_three_axes_units_and_standard_deviations(tmp_path):
    header = "station,md_m,index_deg,accel_x_mg,accel_y_mg,accel_z_mg,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s"
    header += ",gyro_x_rad_s_sd,gyro_y_rad_s_sd,gyro_z_rad_s_sd"
    run = read_gyro_run(text_file(tmp_path, ["1,5,0,1,2,3,4e-5,5e-5,6e-5,1e-8,2e-8,3e-8"], header))
    assert dict(run.letters) == {"accelerometer": "xyz", "gyro": "xyz"}
    assert dict(run.units) == {"accelerometer": "mg", "gyro": "rad/s"}
    assert run.sd["gyro"].tolist() == [[1e-8, 2e-8, 3e-8]]
    assert "accelerometer" not in run.sd


def test_numbered_channels_keep_their_order_and_have_no_letters(tmp_path):
    header = "station,md_m,index_deg,accel_1,accel_2,accel_3,accel_4,gyro_2,gyro_1"
    run = read_gyro_run(text_file(tmp_path, ["1,5,0,1,2,3,4,60,50"], header))
    assert run.channels["accelerometer"].tolist() == [[1, 2, 3, 4]]
    assert run.channels["gyro"].tolist() == [[50, 60]]
    assert not any(run.letters.values())
    # of one kind numbered, of the other lettered; channels of other kinds are named as unused
    header = HEADER.replace("gyro_x_deg_h", "gyro_1_deg_h").replace("gyro_y_deg_h", "gyro_2_deg_h")
    run = read_gyro_run(text_file(tmp_path, [f"{row},30000,1000" for row in ROWS], f"{header},mag_x_nT,mag_y_nT"))
    assert run.channels["gyro"].shape == (6, 2)
    assert not run.letters.get("gyro")
    assert run.findings[-1].values["names"] == ("mag_x_nT", "mag_y_nT")


def test_a_run_upward_keeps_its_order_and_feet_are_converted(tmp_path):
    rows = ["1,300,0,1,2,3,4", "2,200,0,1,2,3,4", "3,100,0,1,2,3,4"]
    run = read_gyro_run(text_file(tmp_path, rows, "station,md_ft,index_deg,accel_x,accel_y,gyro_x_deg_h,gyro_y_deg_h"))
    np.testing.assert_allclose(run.md, [300 * FOOT, 200 * FOOT, 100 * FOOT], rtol=1e-15)


def spreads(names, values):
    """Header and rows with more columns."""
    return f"{HEADER},{names}", [f"{row},{values}" for row in ROWS]


def renamed(old, new):
    return HEADER.replace(old, new), ROWS


@pytest.mark.parametrize(
    ("header", "rows", "code"),
    [
        (HEADER, [*ROWS[:5], ROWS[0]], "gyro-station-again"),
        (HEADER, cell("md_m", 2, "11"), "readings-station-differs"),
        (HEADER, [r.replace("B,40", "B,10") for r in ROWS], "input-order"),
        (HEADER, [*ROWS, "C,30,0,20,1,2,3,4,900"], "input-order"),
        (HEADER, cell("station", 0, ""), "input-empty"),
        (HEADER, cell("index_deg", 4, "1e6"), "input-value index_deg"),
        (HEADER, cell("temperature_degC", 3, "500"), "input-value temperature_degC"),
        (*without("station"), "file-column station"),
        (*without("md_m"), "file-column md_m"),
        (*without("index_deg"), "file-column index_deg"),
        (*without("accel_x", "accel_y"), "file-column accel_x"),
        (*without("gyro_x_deg_h", "gyro_y_deg_h"), "file-column gyro_x"),
        (*renamed("index_deg", "index_rad"), "table-unit"),
        (*renamed("index_deg", "index"), "table-unit-missing"),
        (*renamed("md_m", "md"), "table-unit-missing"),
        (*renamed("time_s", "time"), "table-unit-missing"),
        (*spreads("gyro_x_deg_h_sd,gyro_y_deg_h_sd", "0,1"), "input-value gyro_x_deg_h_sd"),
    ],
)
def test_what_is_no_run(tmp_path, header, rows, code):
    with refused(code, error=FileError):
        read_gyro_run(text_file(tmp_path, rows, header))


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_an_index_in_radians_is_refused(tmp_path, turn):
    rows = list(ROWS)
    for row in range(6):
        rows[row] = cell("index_deg", row, repr(float(turn * np.radians(90.0 * (row % 3)))))[row]
    with refused("table-radians", error=FileError):
        read_gyro_run(text_file(tmp_path, rows))


@pytest.mark.parametrize("angles", [(0, 1, 2, 3), (0, 0, 0, 0), (0.5, 180.5, 0.5, 180.5), (0, 6, 0, 6)])
def test_small_whole_degrees_are_not_taken_for_radians(tmp_path, angles):
    rows = [f"1,10,{angle},1,2,3,4" for angle in angles]
    header = "station,md_m,index_deg,accel_x,accel_y,gyro_x_deg_h,gyro_y_deg_h"
    run = read_gyro_run(text_file(tmp_path, rows, header))
    np.testing.assert_allclose(np.degrees(run.index), angles, atol=1e-12)


NUMBERS = st.floats(-1e6, 1e6, allow_nan=False, allow_subnormal=False)


@settings(max_examples=40, deadline=None)
@given(st.data(), st.integers(1, 4), st.integers(1, 5), st.booleans(), st.sampled_from(["deg/h", "deg/s", "rad/s"]))
def test_write_then_read_gives_the_same_run(tmp_path_factory, data, stations, positions, upward, unit):
    path, size = tmp_path_factory.getbasetemp() / "run.csv", stations * positions
    axes = data.draw(st.integers(1, 3))
    index = np.radians(np.tile(np.arange(positions) * 100.0, stations))
    depth = np.cumsum(data.draw(arrays(float, stations, elements=st.floats(0.01, 1e3))))[:: -1 if upward else 1]
    channels = {
        "accelerometer": data.draw(arrays(float, (size, 2), elements=NUMBERS)),
        "gyro": data.draw(arrays(float, (size, axes), elements=NUMBERS)),
    }
    heat = data.draw(st.none() | arrays(float, size, elements=st.floats(-40, 200)))
    time = data.draw(st.none() | arrays(float, size, elements=st.floats(0, 1e6)))
    labels = [f"s{n + 1}" for n in np.repeat(np.arange(stations), positions)]
    letters = {"accelerometer": "xy", "gyro": "xyz"[:axes]}
    units = {"accelerometer": "m/s^2", "gyro": unit}
    write_gyro_run(path, station=labels, md=np.repeat(depth, positions), index=index, channels=channels,
                   letters=letters, units=units, temperature=heat, time=time)  # fmt: skip
    run = read_gyro_run(path)
    np.testing.assert_array_equal(run.md, depth)
    # printed to 1e-10 deg
    np.testing.assert_allclose(run.index, index, atol=2e-12)
    for kind, values in channels.items():
        np.testing.assert_array_equal(run.channels[kind], values)
    assert (dict(run.letters), dict(run.units)) == (letters, units)
    for found, given_ in ((run.temperature, heat), (run.time, time)):
        assert (found is None) == (given_ is None)
        if given_ is not None:
            np.testing.assert_array_equal(found, given_)
    assert [run.labels[n] for n in run.station] == labels


SCALE = 1.0 + 1.0 / 810.0


def stations():
    columns = {"md": [10.0, 20.0], "inclination": [0.1, 0.2], "azimuth": [1.0, np.nan], "flags": ["", "weak|scale"]}
    return columns | {
        "scale": [SCALE, np.nan], "u_scale": [1e-4, np.nan], "root": ["+", ""], "K": [0.7, np.nan],
        "temperature_degC": None, "gyro_x_corrected_deg_h": [7.5, np.nan], "gyro_y_corrected_deg_h": [-3.0, np.nan],
        "gyro_z_corrected_deg_h": None,
    }  # fmt: skip


def test_the_contract_of_the_station_file(tmp_path):
    write_gyro_stations(tmp_path / "s.csv", stations())
    lines = (tmp_path / "s.csv").read_bytes().decode().split("\n")
    assert lines[0] == ",".join([*SURVEY, *STATION])
    corrected = ",".join(f"gyro_{axis}_corrected_deg_h" for axis in "xyz")
    assert lines[0].endswith(f"flags,scale,u_scale,root,K,temperature_degC,{corrected}")
    # what is not known is blank, numbers keep every digit
    assert lines[1].split(",")[-8:] == [repr(SCALE), "0.0001", "+", "0.7", "", "7.5", "-3", ""]
    assert lines[2].split(",")[-9:] == ["weak|scale", *8 * [""]]


def test_the_station_file_is_a_survey_file(tmp_path):
    write_gyro_stations(tmp_path / "s.csv", stations())
    found = read_survey_csv(tmp_path / "s.csv")
    assert found["flags"] == ("", "weak|scale")
    np.testing.assert_allclose(found["inclination"], [0.1, 0.2], atol=2e-12)
    assert np.isnan(found["azimuth"][1])


def test_stations_need_their_columns(tmp_path):
    columns = stations()
    with refused("input-unknown", names=("north",)):
        write_gyro_stations(tmp_path / "s.csv", columns | {"north": [1.0, 2.0]})
    assert not (tmp_path / "s.csv").exists()


def test_as_a_table_and_written_again(tmp_path):
    run = read_gyro_run(text_file(tmp_path))
    table = run.to_dict()
    assert list(table) == [
        "station", "md_m", "index_deg", "temperature_degC", "time_s", "accel_x", "accel_y", "gyro_x_deg_h",
        "gyro_y_deg_h",
    ]  # fmt: skip
    assert table["station"] == ["A"] * 3 + ["B"] * 3
    assert table["md_m"].tolist() == [10.0] * 3 + [40.0] * 3
    assert table["index_deg"].tolist() == [0.0, 90.0, 180.0] * 2
    assert table["gyro_y_deg_h"].tolist() == [4.0, -3.0, -4.0] * 2
    same = {name: getattr(run, name) for name in ("index", "channels", "letters", "units", "temperature", "time")}
    write_gyro_run(tmp_path / "again.csv", station=table["station"], md=table["md_m"], **same)
    back = read_gyro_run(tmp_path / "again.csv").to_dict()
    assert set(back) == set(table)
    for name, values in table.items():
        np.testing.assert_array_equal(back[name], values)
    header, rows = without("temperature_degC", "time_s")
    assert not {"temperature_degC", "time_s"} & set(read_gyro_run(text_file(tmp_path, rows, header)).to_dict())
