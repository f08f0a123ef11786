"""Tables as loggers, telephones, listings and spreadsheets write them: each read with one line of options at most."""

from __future__ import annotations

import gzip
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from tests.refusals import refused

from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.errors import FileError, InputError
from inclinometry.files._quantities import to_si
from inclinometry.files.bench_csv import read_bench
from inclinometry.files.casing_csv import read_casing
from inclinometry.files.excel import write_excel
from inclinometry.files.las import write_las
from inclinometry.files.log_csv import read_log
from inclinometry.files.p7 import p7_file, write_p7
from inclinometry.files.parquet import write_parquet
from inclinometry.files.position_csv import read_well
from inclinometry.files.profile import PLAIN, Profile, reading_with, with_constants
from inclinometry.files.run_file import open_run
from inclinometry.files.six_axis import read_six_axis
from inclinometry.files.survey_file import SurveyFile
from inclinometry.files.table import read_table
from inclinometry.files.table_formats import find_layout
from inclinometry.files.witsml import write_witsml
from inclinometry.orientation import fields

from .surveys import saved

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


def logged(names, columns, *layout, kinds, profile=None, units=None, **more):
    """A table of text, the profile and units it is read with, the kinds of channels in it."""
    return text(names, columns, *layout, **more), profile, units, kinds


def of(name, letters="XYZ"):
    """The names of a triad."""
    return [name.format(letter) for letter in letters]


M_S2, RAD_S = (STANDARD_GRAVITY * G).T, np.radians(W).T
STAMPS = [str(17 * 10**17 + int(1e9 * t)) for t in TIME]
RUNS = {
    "a logger with preamble and a row of units": logged(
        ["Time", *of("Acc{}"), *of("Mag{}")], [TIME, *G.T, *B.T], "\t",
        "Data logger DL-200\nSerial: 4711\nRate: 100 Hz\n\n", ["s", *["g"] * 3, *["uT"] * 3], kinds="ab",
    ),
    "an MPU logger in ms, g, deg/s, uT": logged(
        ["timestamp_ms", *of("a{}_g", XYZ), *of("g{}_dps", XYZ), *of("m{}_uT", XYZ)],
        [1000 * TIME + 17, *G.T, *W.T, *B.T], kinds="awb",
    ),
    "no names, blanks": (
        "\n".join("  ".join(f"{v:12.8f}" for v in row) for row in np.vstack([M_S2, RAD_S]).T) + "\n", "mpu", None, "aw",
    ),
    "phyphox, German": logged(
        ['"Time (s)"', *of('"Magnetic field {} (µT)"', XYZ)], [TIME, *B.T], "\t", comma=True, kinds="b"
    ),
    "phyphox": logged(
        ['"Time (s)"', *of('"Acceleration {} (m/s^2)"', XYZ), '"Absolute acceleration (m/s^2)"'],
        [TIME, *M_S2, np.linalg.norm(G, axis=1)], kinds="a",
    ),
    "Sensor Logger": logged(
        ["time", "seconds_elapsed", "z", "y", "x"], [STAMPS, TIME, *M_S2[::-1]],
        kinds="a", profile="sensor-logger-accelerometer",
    ),
    "an inertial unit in us with signs of units": logged(
        ["timestamp (us)", *of("gyro{} (°/s)"), *of("accel{} (m/s²)")], [1e6 * TIME, *W.T, *M_S2], ";", kinds="wa"
    ),
    "x-io": logged(
        ["Timestamp (us)", *of("Gyroscope {} (deg/s)"), *of("Accelerometer {} (g)")], [1e6 * TIME, *W.T, *G.T],
        kinds="wa",
    ),
    "x-io with more": logged(
        ["Time (s)", *of("Accelerometer {} (g)"), *of("Magnetometer {} (uT)"), "Barometer (hPa)"],
        [TIME, *G.T, *B.T, 1013 + TIME], kinds="ab",
    ),
    "ROS": logged(
        ["%time", "field.header.seq", "field.header.frame_id", *of("field.angular_velocity.{}", XYZ),
         *of("field.linear_acceleration.{}", XYZ)],
        [STAMPS, np.arange(6), ["imu"] * 6, *RAD_S, *M_S2], kinds="wa", profile="ros-imu",
    ),
    "an autopilot": logged(
        ["TimeUS", *of("Gyr{}"), *of("Acc{}")], [1e6 * TIME, *RAD_S, *M_S2], ", ", kinds="wa", units="rad/s,m/s2"
    ),
    "Xsens MT Manager": logged(
        ["PacketCounter",
         *(f"UTC_{one}" for one in ("Nano", "Year", "Month", "Day", "Hour", "Minute", "Second", "Valid")),
         *of("Acc_{}"), *of("Gyr_{}"), *of("Mag_{}")],
        [np.arange(6), 1e9 * TIME, *([v] * 6 for v in (2026, 5, 1, 12, 30, 59, 55)), *M_S2, *RAD_S, *(B / 50).T],
        "\t", "// General information:\n//  Update Rate: 100.0Hz\n", kinds="aw", profile="xsens-mtb",
    ),
}  # fmt: skip
KINDS = {"a": ("accelerometer", G * STANDARD_GRAVITY), "w": ("gyro", np.radians(W)), "b": ("magnetometer", B * 1000.0)}


@pytest.mark.parametrize("how", RUNS)
def test_a_run_of_another_instrument(tmp_path, how):
    content, profile, units, kinds = RUNS[how]
    with reading_with(profile, units):
        run = open_run(saved(tmp_path / "run.txt", content, encoding="utf-8"))
        blocks = list(run.blocks())
        log = read_log(tmp_path / "run.txt")
    assert np.diff(np.concatenate([block.time for block in blocks])) == pytest.approx(np.full(5, 0.01), abs=1e-6)
    assert sorted(run.names) == sorted(KINDS[kind][0] for kind in kinds)
    for name, expected in (KINDS[kind] for kind in kinds):
        _, factor = to_si(run.units[name])
        found = np.concatenate([block.channels[name] for block in blocks]) * factor
        np.testing.assert_allclose(found, expected, rtol=2e-5)
        np.testing.assert_allclose(log.channels[name] * factor, expected, rtol=2e-5)


def test_arrays_of_other_programs(tmp_path):
    import h5py

    np.savez(tmp_path / "a.npz", time_s=TIME, accel_g=G, gyro_deg_s=W)
    with h5py.File(tmp_path / "a.h5", "w") as stored:
        for name, values, unit in (("time", TIME, "s"), ("accel", G, "g"), ("gyro", W, "deg/s")):
            stored[f"imu/{name}"] = values
            stored[f"imu/{name}"].attrs["units"] = unit
        stored["gps/latitude"] = np.zeros(2)
    (tmp_path / "a.json").write_text(
        json.dumps({"time_s": TIME.tolist(), "accel_g": G.tolist(), "gyro_deg_s": W.tolist()})
    )
    for ending in ("npz", "h5", "json"):
        log = read_log(tmp_path / f"a.{ending}")
        assert log.units == {"accelerometer": "g", "gyro": "deg/s"}, ending
        np.testing.assert_allclose(log.channels["accelerometer"], G, rtol=1e-12)


WELLS = {
    "MD, INC, AZI in feet": (text(["MD", "INC", "AZI"], [MD / 0.3048, INC, AZI]), {"units": "ft,deg"}),
    "a row of units in brackets": (
        text(["MD", "Inclination", "Azimuth True"], [MD, INC, AZI], units=["[m]", "[deg]", "[deg]"]), {},
    ),
    "a spreadsheet's text": (
        text(["MD (ft)", "Inc (deg)", "Azi True (deg)"], [MD / 0.3048, INC, AZI], "\t"), {"encoding": "utf-16"},
    ),
    "no UTF-8": (text(["MD (m)", "Inc (°)", "Azi True (°)"], [MD, INC, AZI]), {"encoding": "latin-1"}),
    "semicolons to the end": (
        "# exported\n" + text(["md_m", "inclination_deg", "azimuth_deg"], [MD, INC, AZI], ";").replace("\n", ";\n"), {},
    ),
    "German names and commas": (
        text(["Teufe (m)", "Neigung (Grad)", "Azimut (Grad)"], [MD, INC, AZI], ";", comma=True),
        {"profile": "german.toml"},
    ),
    "a preamble": ("ACME\nWell: A-7\n\n" + text(["MD (m)", "Inc (deg)", "Azi (deg)"], [MD, INC, AZI]), {}),
}  # fmt: skip


@pytest.mark.parametrize("how", WELLS)
def test_a_survey_of_another_program(tmp_path, how, monkeypatch):
    monkeypatch.chdir(tmp_path)
    content, how = WELLS[how]
    Path("german.toml").write_text(
        '[columns]\n"Teufe (m)" = "md_m"\n"Neigung (Grad)" = "inclination_deg"\n"Azimut (Grad)" = "azimuth_deg"\n'
    )
    Path("a.csv").write_bytes(content.encode(how.get("encoding", "utf-8")))
    with reading_with(how.get("profile"), how.get("units")):
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
        assert len(read_casing(tmp_path / "probe.csv", "digi-25000")[0].reading.depth) == 8


def test_no_unit_is_guessed_behind_a_preamble(tmp_path):
    (tmp_path / "a.txt").write_text("Logger\n\n" + text(["Time", *(f"Acc{a}" for a in "XYZ")], [TIME, *G.T], "\t"))
    with refused("table-unit-missing", error=(FileError, InputError)):
        read_log(tmp_path / "a.txt")


def test_levels_of_a_readout(tmp_path):
    rows = "".join(f"{depth / 2:.1f}, 500, -480, 300, -290\n" for depth in range(40, 0, -1))
    (tmp_path / "a.gkn").write_text(f"GK 604M\n#READINGS:40\nFLEVEL,    A+,     A-,     B+,     B-\n{rows}")
    with reading_with(None, "m"):
        assert read_casing(tmp_path / "a.gkn", unit="digi-25000")[0].reading.depth[0] == 0.5


def test_the_names_of_euroc_stand_in_a_comment(tmp_path):
    """EuRoC's imu0/data.csv: nanoseconds of the day, names behind a #, units with powers in their brackets."""
    names = ["timestamp [ns]", *(f"w_RS_S_{a} [rad s^-1]" for a in XYZ), *(f"a_RS_S_{a} [m s^-2]" for a in XYZ)]
    stamps = [f"{1403636579758555392 + int(1e9 * t)}" for t in TIME]
    path = tmp_path / "data.csv"
    run = read_log(saved(path, "#" + text(names, [stamps, *np.radians(W).T, *(STANDARD_GRAVITY * G).T])))
    # 1.4e18 ns are known to 256 ns
    assert np.diff(run.time) == pytest.approx(0.01, abs=1e-6)
    assert run.channels["gyro"] == pytest.approx(np.radians(W), abs=1e-9)
    assert run.units["accelerometer"] == "m/s^2"
    # a comment of as many words above numbers with their own names stays a comment
    with refused("file-column", error=FileError, columns=("azimuth_deg",)):
        read_well(saved(path, "# one,two\nmd_m,inclination_deg\n0,1\n10,2\n"))


def test_shimmer_s_device_and_units_row(tmp_path):
    """Consensys: sep= in quotes, device and CAL around each name, a row of units; local_flux is none."""
    names = ["Timestamp_Unix", *(f"Accel_LN_{a}" for a in "XYZ"), *(f"Gyro_{a}" for a in "XYZ"), "Mag_X", "Battery"]
    names = [f"Shimmer_40AC_{name}_CAL" for name in names]
    units = ["ms", *["m/(s^2)*"] * 3, *["deg/s*"] * 3, "local_flux*", "mV"]
    columns = [[f"{1595926610034 + 1000 * t:.3f}" for t in TIME], *(STANDARD_GRAVITY * G).T, *W.T, TIME, TIME + 3900]
    path = tmp_path / "shimmer.csv"
    run = read_log(saved(path, text(names, columns, "\t", '"sep=\t"\n', units)))
    assert np.diff(run.time) == pytest.approx(0.01, abs=1e-6)
    assert run.channels["accelerometer"] == pytest.approx(STANDARD_GRAVITY * G, abs=1e-9)
    assert run.units["gyro"] == "deg/s"
    assert set(run.channels) == {"accelerometer", "gyro"}


def test_json_of_one_object_a_line(tmp_path):
    path = tmp_path / "a.jsonl"
    rows = [{"MD (m)": m, "INC (deg)": i, "AZIM_TN (deg)": a} for m, i, a in zip(MD, INC, AZI, strict=True)]
    well = read_well(saved(path, "\n".join(map(json.dumps, rows)) + "\n"))
    assert (np.degrees(well.inclination) == pytest.approx(INC), well.azimuth_reference) == (True, "true")
    for line, problem in (("[1, 2]", "table-json"), ('{"MD (m)": ', "file-format")):
        with refused(problem, error=FileError) as stop:
            read_well(saved(path, json.dumps(rows[0]) + "\n" + line + "\n"))
        assert stop.value.line == 2


@pytest.mark.parametrize(
    ("name", "north"),
    [
        *(("AZIM_TN", "true"), ("AZI_TRUE", "true"), ("Azimuth True North", "true"), ("AZIM_GN", "grid")),
        *(("AziGN", "grid"), ("AZI_GRID", "grid"), ("AZIM_MN", "magnetic"), ("AZI MAG", "magnetic")),
    ],
)
def test_the_north_in_the_name_of_the_azimuth(tmp_path, name, north):
    path = tmp_path / "a.csv"
    with reading_with(None, "m,deg"):
        assert read_well(saved(path, text(["MD", "INC", name], [MD, INC, AZI]))).azimuth_reference == north
        other = with_constants(azimuth_reference="grid" if north == "true" else "true")
        with reading_with(other), refused("input-north", error=FileError):
            read_well(path)


def test_degrees_minutes_and_seconds(tmp_path):
    path = tmp_path / "a.csv"
    rows = ["0,0°,0°00'", "30,10°30',120°15'30\"", "60,12.5,-1°30′36″"]
    well = read_well(saved(path, "\n".join(["MD (m),INC (deg),Azimuth true (deg)", *rows]) + "\n", encoding="utf-8"))
    assert np.degrees(well.inclination) == pytest.approx([0.0, 10.5, 12.5])
    assert np.degrees(well.azimuth) == pytest.approx([0.0, 120.0 + 15.5 / 60.0, -1.51])
    for cell, remedy in (("10 30 15", ("10.504167", "10°30'15\"")), ("-0:30", ("-0.5", "-0°30'"))):
        with refused("table-decimal", error=FileError) as stop:
            read_well(saved(path, f"MD (m),INC (deg),Azimuth true (deg)\n0,0,0\n30,1,{cell}\n", encoding="utf-8"))
        values = stop.value.finding.values
        assert (stop.value.line, values["readings"]) == (3, remedy)
    # minutes end at 60, and a length has none
    for row in ("30,10°75',20", "30°30',10,20"):
        with refused("input-kind", error=FileError):
            read_well(saved(path, f"MD (m),INC (deg),Azimuth true (deg)\n0,0,0\n{row}\n", encoding="utf-8"))


def test_a_number_that_stands_for_nothing(tmp_path):
    path = tmp_path / "a.csv"
    with refused("table-null", error=FileError) as stop:
        read_well(saved(path, "MD (m),INC (deg),AZI_TRUE (deg)\n0,0,0\n30,-999.25,-999.25\n60,3,20\n"))
    assert stop.value.line == 3
    with reading_with(None, null=-999.25):
        well = read_well(path)
    assert (well.md.tolist(), well.lines.tolist()) == ([0.0, 60.0], [2, 4])
    assert [(one.code, one.values["line"]) for one in well.findings] == [("work-rows-left-out", 3)]
    # half a station is none, and no gap either
    with reading_with(None, null=-999.25), refused("input-empty", error=FileError):
        read_well(saved(path, "MD (m),INC (deg),AZI_TRUE (deg)\n0,0,0\n30,-999.25,20\n60,3,20\n"))
    # one channel may pass through that value, two at once do not; what may not be empty is not
    path.write_text("time_s,mag_x_nT,mag_y_nT,mag_z_nT\n0,-999.25,1,2\n1,3,4,5\n")
    assert read_log(path).channels["magnetometer"][0, 0] == -999.25
    with refused("table-null", error=FileError):
        read_log(saved(path, "time_s,mag_x_nT,mag_y_nT,mag_z_nT\n0,-999.25,-999.25,2\n1,3,4,5\n"))
    with reading_with(None, null=-999.25), refused("table-empty", error=FileError):
        read_log(path)


def test_the_null_of_las_leaves_depths_out(tmp_path):
    path = tmp_path / "a.las"
    head = "~V\nVERS. 2.0 :\nWRAP. NO :\n~W\nSTRT.M 0 :\nSTOP.M 60 :\nSTEP.M 0 :\nNULL. -999.25 :\n~C\n"
    with refused("table-near", error=FileError):
        read_well(saved(path, f"{head}DEPT.M :\nINCL.DEG :\nAZIT.DEG :\n~A\n0 0 0\n30 -999.25 -999.25\n60 1.5 120\n"))
    assert read_well(saved(path, path.read_text().replace("AZIT", "AZITRUE"))).md.tolist() == [0.0, 60.0]


def test_a_report_in_pdf_is_refused_with_what_to_do(tmp_path):
    path = tmp_path / "report.pdf"
    path.write_bytes(b"%PDF-1.7\n%\xe2\xe3\xcf\xd3\n1 0 obj\n")
    with refused("file-kind", error=FileError):
        read_well(path)


@pytest.mark.parametrize(
    "head",
    [
        "# 2024.06.01 created by TopoDroid v 6.2\n# cave\n# from to tape compass clino (declination 4.5)\n",
        "From,To,Distance,Azimuth,Inclination\n",
        "*begin cave\n*data normal from to tape compass clino\n",
    ],
)
def test_the_legs_of_a_cave_are_named(tmp_path, head):
    path = tmp_path / "legs.csv"
    with refused("table-legs", error=FileError) as stop:
        read_well(saved(path, head + "0@cave,1@cave,5.20,45.0,-10.0,\n1@cave,2@cave,7.33,50.2,-35.5,L\n"))
    assert stop.value.line == head.count("\n")


@pytest.mark.parametrize("ending", ["las", "xml", "p717", "parquet", "xlsx"])
@pytest.mark.parametrize("packed", [False, True])
def test_a_survey_in_a_format_of_surveys_is_a_table_too(tmp_path, ending, packed):
    """Each is recognised by how it begins, whatever its name; packed or not, a row is the line it stands in."""
    g, b = fields(np.radians(AZI), np.radians(INC), np.zeros(len(MD)), 1.2)
    survey = SurveyFile(md=MD, inclination=np.radians(INC), azimuth=np.radians(AZI), azimuth_reference="true",
                        g=9.81 * g, b=5e4 * b)  # fmt: skip
    path = tmp_path / "well.dat"
    write = {"las": write_las, "xml": write_witsml, "parquet": write_parquet, "xlsx": write_excel}.get(ending)
    if write is None:
        write_p7(p7_file(survey), path)
    else:
        write(survey, path)
    if packed:
        path.write_bytes(gzip.compress(path.read_bytes()))
    well = read_well(path)
    assert well.azimuth_reference == "true"
    np.testing.assert_allclose(well.md, MD, rtol=1e-12)
    np.testing.assert_allclose(np.degrees(well.inclination), INC, atol=1e-9)
    np.testing.assert_allclose(np.degrees(well.azimuth), AZI, atol=1e-9)
    first = {"parquet": 1, "las": 36}.get(ending, 2)
    assert well.lines.tolist() == list(range(first, first + len(MD)))


def test_several_surveys_in_one_file_are_not_one_table(tmp_path):
    g, b = fields(np.radians(AZI), np.radians(INC), np.zeros(len(MD)), 1.2)
    one = p7_file(SurveyFile(md=MD, g=9.81 * g, b=5e4 * b))
    two = p7_file(SurveyFile(md=MD, g=9.81 * g, b=5e4 * b), number=2)
    both = replace(one, surveys={**one.surveys, **two.surveys}, records=(*one.records, two.records[1]))
    write_p7(both, tmp_path / "a.p717")
    with refused("file-surveys", error=FileError):
        read_well(tmp_path / "a.p717")


def test_arrays_of_other_shapes(tmp_path):
    """One row as a column, columns as long as most; short ones are settings, nearly as long ones a mistake."""
    content = {"time_s": [TIME.tolist()], "accel_g": G.tolist(), "rate": [100.0], "name": "a"}
    path = tmp_path / "a.json"
    log = read_log(saved(path, json.dumps(content)))
    assert log.time.tolist() == TIME.tolist()
    np.testing.assert_allclose(log.channels["accelerometer"], G)
    with refused("input-shape", error=FileError, name="mag"):
        read_log(saved(path, json.dumps(content | {"mag": G[:4].tolist()})))
    assert set(read_log(saved(path, json.dumps(content | {"mag": G[:3].tolist()}))).channels) == {"accelerometer"}
    with refused("file-large", error=FileError):
        read_log(saved(path, json.dumps(content | {"wide": np.zeros((6, 1001)).tolist()})))
    # four sensors have numbers, their unit stays behind
    path.write_text(json.dumps(content | {"mag_nT": np.ones((6, 4)).tolist(), "temperature (degC)": [[20.5]] * 6}))
    log = read_log(path)
    assert log.channels["magnetometer"].shape == (6, 4)
    assert log.units["magnetometer"] == "nT"
    assert log.temperature.tolist() == [20.5] * 6


def test_what_a_listing_says_of_an_empty_cell(tmp_path):
    """A number that stands for nothing in one column is a value in another."""
    path = tmp_path / "a.txt"
    path.write_text("MD;INC;AZI;TF\n0;1;2;-1\n30;2;-1;5\n60;3;4;6\n")
    columns = {"MD": "md_m", "INC": "inclination_deg", "AZI": "azimuth_deg", "TF": "toolface_deg"}
    with reading_with(Profile(separator=";", columns=columns, blank={"TF": "-1"},
                              constants={"azimuth_reference": "true"})):  # fmt: skip
        well = read_well(path)
    assert np.isnan(well.toolface).tolist() == [True, False, False]
    assert np.degrees(well.azimuth[1]) == pytest.approx(-1.0)


LAYOUTS = {
    "names,of,columns\n1,2,3\n4,5,6\n": ("text, separated by comma", None),
    "# a comment\n\na;b\n1;2\n": ("text, separated by semicolon", None),
    "Company\nprinted\na;b;c\n1;2;3\n4;5;6\n": ("text, separated by semicolon, 2 lines before the names", 2),
    "a\tb\nm\tdeg\n1\t2\n": ("text, separated by tab, a line of units", 0),
    "1 2 3\n4 5 6\n": ("text, separated by space, no names of columns", 0),
    "MD INC\n--- ---\n1 2\n": ("text, separated by space", 0),
    "\n# nothing\n-----\n": ("text without a table", None),
    "": ("a table of its own format", None),
}


@pytest.mark.parametrize("content", LAYOUTS)
def test_a_layout_in_words(content):
    said, skip = LAYOUTS[content]
    profile, words = find_layout(content.splitlines())
    assert words == said
    assert (profile == PLAIN) == (skip is None)
    assert skip is None or profile.skip == skip


@pytest.mark.parametrize(
    "name", ['tool "A"', '"A"', '"', "a, b", "two\rlines", "two\nlines", 'all; of, "them"\r\nhere', "plain"]
)
def test_a_text_of_a_packed_table_is_one_cell(tmp_path, name):
    path = tmp_path / "a.json"
    table = read_table(saved(path, json.dumps([{"station": name, "md_m": 1.5}, {"station": "B", "md_m": 2.5}])))
    assert table.text("station") == (name.replace("\r", " ").replace("\n", " "), "B")
    assert table.number("md_m").tolist() == [1.5, 2.5]


def test_an_error_in_a_packed_table_names_its_row(tmp_path):
    for row in range(1, 10):
        rows = [{"md_m": float(k), "tvd_m": "x" if k == row else float(k)} for k in range(1, 12)]
        (tmp_path / "a.json").write_text(json.dumps(rows))
        with refused("input-kind", error=FileError, name="tvd_m"):
            read_table(tmp_path / "a.json", numeric=lambda _: True)


@pytest.mark.parametrize(
    "header", ["md_m;label (of tool, run)", '"md_m";"label (of tool, run)"', '"md_m","label;tool"']
)
def test_a_mark_inside_a_name_is_none_between_columns(tmp_path, header):
    path, mark = tmp_path / "a.csv", ";" if '";"' in header or '"' not in header else ","
    path.write_text(f"{header}\n1.5{mark}2\n3.5{mark}4\n")
    table = read_table(path, numeric=lambda name: name == "md_m")
    assert table.number("md_m").tolist() == [1.5, 3.5]
    assert len(table.columns) == 2
