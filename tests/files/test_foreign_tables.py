"""Tables as loggers, telephones, listings and spreadsheets write them: each read with one line of options at most."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from scipy.io import savemat

from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.errors import FileError, InputError
from inclinometry.files.bench_csv import read_bench
from inclinometry.files.casing_csv import read_casing
from inclinometry.files.log_csv import TO_SI, read_log
from inclinometry.files.position_csv import read_well
from inclinometry.files.profile import reading_with, with_constants
from inclinometry.files.run_file import open_run
from inclinometry.files.six_axis import read_six_axis

TIME = np.arange(6) * 0.01
G = np.array([[0.1, 0.2, 0.97]] * 6) + 1e-3 * np.arange(18).reshape(6, 3)
W = np.array([[1.0, -2.0, 30.0]] * 6) + 0.1 * np.arange(18).reshape(6, 3)
B = np.array([[20.0, -3.0, 45.0]] * 6) + 0.01 * np.arange(18).reshape(6, 3)
MD = np.array([0.0, 100.0, 200.0, 300.0])
INC, AZI = np.array([0.0, 1.5, 3.25, 5.0]), np.array([60.0, 61.0, 62.5, 63.0])


def text(names, columns, mark=",", before="", units=None, comma=False):
    """A table of text."""
    rows = [mark.join(c if isinstance(c, str) else f"{c:.10g}" for c in row) for row in zip(*columns, strict=True)]
    rows = [row.replace(".", ",") for row in rows] if comma else rows
    return before + "\n".join([mark.join(names), *([mark.join(units)] if units else []), *rows]) + "\n"


XYZ = "xyz"
RUNS = {
    "a logger with preamble and a row of units": (
        text(
            ["Time", *(f"Acc{a}" for a in "XYZ"), *(f"Mag{a}" for a in "XYZ")],
            [TIME, *G.T, *B.T],
            "\t",
            "Data logger DL-200\nSerial: 4711\nRate: 100 Hz\n\n",
            ["s", *["g"] * 3, *["uT"] * 3],
        ),
        None,
        None,
        "ab",
    ),
    "an MPU logger in ms, g, deg/s, uT": (
        text(
            ["timestamp_ms", *(f"a{a}_g" for a in XYZ), *(f"g{a}_dps" for a in XYZ), *(f"m{a}_uT" for a in XYZ)],
            [1000 * TIME + 17, *G.T, *W.T, *B.T],
        ),
        None,
        None,
        "awb",
    ),
    "no names, blanks": (
        "\n".join("  ".join(f"{v:12.8f}" for v in row) for row in np.hstack([G * STANDARD_GRAVITY, np.radians(W)]))
        + "\n",
        "mpu",
        None,
        "aw",
    ),
    "phyphox, German": (
        text(['"Time (s)"', *(f'"Magnetic field {a} (µT)"' for a in XYZ)], [TIME, *B.T], "\t", comma=True),
        None,
        None,
        "b",
    ),
    "phyphox": (
        text(
            ['"Time (s)"', *(f'"Acceleration {a} (m/s^2)"' for a in XYZ), '"Absolute acceleration (m/s^2)"'],
            [TIME, *(G * STANDARD_GRAVITY).T, np.linalg.norm(G, axis=1)],
        ),
        None,
        None,
        "a",
    ),
    "Sensor Logger": (
        text(
            ["time", "seconds_elapsed", "z", "y", "x"],
            [[str(17 * 10**17 + int(1e9 * t)) for t in TIME], TIME, *(G * STANDARD_GRAVITY).T[::-1]],
        ),
        "sensor-logger-accelerometer",
        None,
        "a",
    ),
    "an inertial unit in us with signs of units": (
        text(
            ["timestamp (us)", *(f"gyro{a} (°/s)" for a in "XYZ"), *(f"accel{a} (m/s²)" for a in "XYZ")],
            [1e6 * TIME, *W.T, *(G * STANDARD_GRAVITY).T],
            ";",
        ),
        None,
        None,
        "wa",
    ),
    "x-io": (
        text(
            ["Timestamp (us)", *(f"Gyroscope {a} (deg/s)" for a in "XYZ"), *(f"Accelerometer {a} (g)" for a in "XYZ")],
            [1e6 * TIME, *W.T, *G.T],
        ),
        None,
        None,
        "wa",
    ),
    "x-io with more": (
        text(
            [
                "Time (s)",
                *(f"Accelerometer {a} (g)" for a in "XYZ"),
                *(f"Magnetometer {a} (uT)" for a in "XYZ"),
                "Barometer (hPa)",
            ],
            [TIME, *G.T, *B.T, 1013 + TIME],
        ),
        None,
        None,
        "ab",
    ),
    "ROS": (
        text(
            [
                "%time",
                "field.header.seq",
                "field.header.frame_id",
                *(f"field.angular_velocity.{a}" for a in XYZ),
                *(f"field.linear_acceleration.{a}" for a in XYZ),
            ],
            [
                [str(17 * 10**17 + int(1e9 * t)) for t in TIME],
                np.arange(6),
                ["imu"] * 6,
                *np.radians(W).T,
                *(G * STANDARD_GRAVITY).T,
            ],
        ),
        "ros-imu",
        None,
        "wa",
    ),
    "an autopilot": (
        text(
            ["TimeUS", *(f"Gyr{a}" for a in "XYZ"), *(f"Acc{a}" for a in "XYZ")],
            [1e6 * TIME, *np.radians(W).T, *(G * STANDARD_GRAVITY).T],
            ", ",
        ),
        None,
        "rad/s,m/s2",
        "wa",
    ),
    "Xsens MT Manager": (
        text(
            [
                "PacketCounter",
                "UTC_Nano",
                "UTC_Year",
                "UTC_Month",
                "UTC_Day",
                "UTC_Hour",
                "UTC_Minute",
                "UTC_Second",
                "UTC_Valid",
                *(f"{k}_{a}" for k in ("Acc", "Gyr", "Mag") for a in "XYZ"),
            ],
            [
                np.arange(6),
                1e9 * TIME,
                *([v] * 6 for v in (2026, 5, 1, 12, 30, 59, 55)),
                *(G * STANDARD_GRAVITY).T,
                *np.radians(W).T,
                *(B / 50).T,
            ],
            "\t",
            "// General information:\n//  Update Rate: 100.0Hz\n",
        ),
        "xsens-mtb",
        None,
        "aw",
    ),
}
KINDS = {"a": ("accelerometer", G * STANDARD_GRAVITY), "w": ("gyro", np.radians(W)), "b": ("magnetometer", B * 1000.0)}


@pytest.mark.parametrize("how", RUNS)
def test_a_run_of_another_instrument(tmp_path, how):
    content, profile, units, kinds = RUNS[how]
    (tmp_path / "run.txt").write_text(content, encoding="utf-8")
    with reading_with(profile, units):
        run = open_run(tmp_path / "run.txt")
        blocks = list(run.blocks())
        log = read_log(tmp_path / "run.txt")
    assert np.diff(np.concatenate([block.time for block in blocks])) == pytest.approx(np.full(5, 0.01), abs=1e-6)
    assert sorted(run.names) == sorted(KINDS[kind][0] for kind in kinds)
    for name, expected in (KINDS[kind] for kind in kinds):
        _, factor = TO_SI.get(run.units[name], ("", 1.0))
        found = np.concatenate([block.channels[name] for block in blocks]) * factor
        np.testing.assert_allclose(found, expected, rtol=2e-5)
        np.testing.assert_allclose(log.channels[name] * factor, expected, rtol=2e-5)


def test_arrays_of_other_programs(tmp_path):
    import h5py

    savemat(tmp_path / "a.mat", {"run": {"time_s": TIME, "accel_g": G, "gyro_deg_s": W}})
    np.savez(tmp_path / "a.npz", time_s=TIME, accel_g=G, gyro_deg_s=W)
    with h5py.File(tmp_path / "a.h5", "w") as stored:
        for name, values, unit in (("time", TIME, "s"), ("accel", G, "g"), ("gyro", W, "deg/s")):
            stored[f"imu/{name}"] = values
            stored[f"imu/{name}"].attrs["units"] = unit
        stored["gps/latitude"] = np.zeros(2)
    (tmp_path / "a.json").write_text(
        json.dumps({"time_s": TIME.tolist(), "accel_g": G.tolist(), "gyro_deg_s": W.tolist()})
    )
    for ending in ("mat", "npz", "h5", "json"):
        log = read_log(tmp_path / f"a.{ending}")
        assert log.units == {"accelerometer": "g", "gyro": "deg/s"}, ending
        np.testing.assert_allclose(log.channels["accelerometer"], G, rtol=1e-12)


WELLS = {
    "MD, INC, AZI in feet": (text(["MD", "INC", "AZI"], [MD / 0.3048, INC, AZI]), None, "ft,deg", "utf-8"),
    "a row of units in brackets": (
        text(["MD", "Inclination", "Azimuth True"], [MD, INC, AZI], units=["[m]", "[deg]", "[deg]"]),
        None,
        None,
        "utf-8",
    ),
    "a spreadsheet's text": (
        text(["MD (ft)", "Inc (deg)", "Azi True (deg)"], [MD / 0.3048, INC, AZI], "\t"),
        None,
        None,
        "utf-16",
    ),
    "no UTF-8": (text(["MD (m)", "Inc (°)", "Azi True (°)"], [MD, INC, AZI]), None, None, "latin-1"),
    "semicolons to the end": (
        "# exported\n" + text(["md_m", "inclination_deg", "azimuth_deg"], [MD, INC, AZI], ";").replace("\n", ";\n"),
        None,
        None,
        "utf-8",
    ),
    "German names and commas": (
        text(["Teufe (m)", "Neigung (Grad)", "Azimut (Grad)"], [MD, INC, AZI], ";", comma=True),
        "german.toml",
        None,
        "utf-8",
    ),
    "a preamble": (
        "ACME\nWell: A-7\n\n" + text(["MD (m)", "Inc (deg)", "Azi (deg)"], [MD, INC, AZI]),
        None,
        None,
        "utf-8",
    ),
}


@pytest.mark.parametrize("how", WELLS)
def test_a_survey_of_another_program(tmp_path, how, monkeypatch):
    monkeypatch.chdir(tmp_path)
    content, profile, units, encoding = WELLS[how]
    Path("german.toml").write_text(
        '[columns]\n"Teufe (m)" = "md_m"\n"Neigung (Grad)" = "inclination_deg"\n"Azimut (Grad)" = "azimuth_deg"\n'
    )
    Path("a.csv").write_bytes(content.encode(encoding))
    with reading_with(profile, units):
        profile = None if "True" in content else with_constants(azimuth_reference="true")
        with reading_with(profile):
            well = read_well("a.csv")
    np.testing.assert_allclose(well.md, MD, atol=1e-6)
    np.testing.assert_allclose(np.degrees(well.inclination), INC, atol=1e-6)
    np.testing.assert_allclose(np.degrees(well.azimuth), AZI, atol=1e-6)


def test_a_workbook_with_titles_and_a_listing_of_six_axes(tmp_path):
    book = openpyxl.Workbook()
    for row in [
        ("ACME Drilling",),
        ("Well:", "A-7"),
        (),
        ("MD (m)", "Incl (deg)", "Azim True (deg)"),
        *zip(MD.tolist(), INC.tolist(), AZI.tolist(), strict=True),
    ]:
        book.active.append(row)
    book.save(tmp_path / "a.xlsx")
    np.testing.assert_allclose(read_well(tmp_path / "a.xlsx").md, MD)
    names = ["Depth(m)", *(f"G{a}(g)" for a in XYZ), *(f"B{a}(nT)" for a in XYZ)]
    (tmp_path / "six.txt").write_text(
        text(names, [30.0 * np.arange(6), *G.T, *(1000 * B).T], "\t", "Run 3\nService company\n")
    )
    six = read_six_axis(tmp_path / "six.txt")
    np.testing.assert_allclose(six.g, G * STANDARD_GRAVITY)
    np.testing.assert_allclose(six.b, 1000 * B)


def test_readings_of_a_stand_and_of_a_probe_behind_a_preamble(tmp_path):
    names = ["azimuth_deg", "inclination_deg", "toolface_deg", *(f"accel_{a}" for a in XYZ)]
    columns = [np.arange(6) * 45.0, np.arange(6) * 20.0, np.arange(6) * 60.0, *(1600 * G).T]
    (tmp_path / "stand.txt").write_text(text(names, columns, "\t", "Stand 2; operator: N.N.\n"))
    np.testing.assert_allclose(read_bench(tmp_path / "stand.txt").channels["accelerometer"], 1600 * G)
    depth = 0.5 * np.arange(1, 9)
    faces = [300 + depth, -300 - depth, 100 + depth, -100 - depth]
    (tmp_path / "probe.csv").write_text(
        text(["DEPTH", "A0", "A180", "B0", "B180"], [depth, *faces], ",", "Project: Slope 4\nBorehole: BH-2\n")
    )
    with reading_with(None, "m"):
        assert len(read_casing(tmp_path / "probe.csv", "digi-25000").reading.depth) == 8


def test_no_unit_is_guessed_behind_a_preamble(tmp_path):
    (tmp_path / "a.txt").write_text("Logger\n\n" + text(["Time", *(f"Acc{a}" for a in "XYZ")], [TIME, *G.T], "\t"))
    with pytest.raises((FileError, InputError), match=r"'time_s' is missing|unit missing"):
        read_log(tmp_path / "a.txt")


def test_levels_of_a_readout(tmp_path):
    rows = "".join(f"{depth / 2:.1f}, 500, -480, 300, -290\n" for depth in range(40, 0, -1))
    (tmp_path / "a.gkn").write_text(f"GK 604M\n#READINGS:40\nFLEVEL,    A+,     A-,     B+,     B-\n{rows}")
    with reading_with(None, "m"):
        assert read_casing(tmp_path / "a.gkn", unit="digi-25000").reading.depth[0] == 0.5
