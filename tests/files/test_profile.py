"""Any table by one reader: other formats, other layouts, other units and axes give the same readings."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from tests.refusals import refused

from inclinometry.digest import digest_file
from inclinometry.errors import FileError
from inclinometry.files import foreign
from inclinometry.files.bench_csv import read_bench
from inclinometry.files.columns import LOG, numbers_among
from inclinometry.files.position_csv import read_well
from inclinometry.files.profile import Profile, read_profile, reading_with, shipped
from inclinometry.files.run_file import open_run
from inclinometry.files.six_axis import read_survey
from inclinometry.files.table import read_table

from .surveys import saved

RNG = np.random.default_rng(3)
COLUMNS = {
    "azimuth_deg": RNG.uniform(0.0, 360.0, 9),
    "inclination_deg": RNG.uniform(0.0, 180.0, 9),
    "toolface_deg": RNG.uniform(0.0, 360.0, 9),
    **{f"accel_{axis}": RNG.normal(0.0, 800.0, 9) for axis in "xyz"},
}


def written(folder: Path, ending: str) -> Path:
    """The same table in another format."""
    path = folder / f"bench.{ending}"
    rows = list(zip(*(values.tolist() for values in COLUMNS.values()), strict=True))
    text = "\n".join([",".join(COLUMNS), *(",".join(map(repr, row)) for row in rows)]) + "\n"
    if ending == "csv":
        path.write_text(text)
    elif ending == "csv.gz":
        path.write_bytes(gzip.compress(text.encode()))
    elif ending == "txt":
        path.write_text(text.replace(",", "  "))
    elif ending == "xlsx":
        book = openpyxl.Workbook()
        for row in [tuple(COLUMNS), *rows]:
            book.active.append(row)
        book.save(path)
    elif ending == "parquet":
        pq.write_table(pa.table(COLUMNS), path)
    elif ending == "h5":
        with h5py.File(path, "w") as stored:
            for name, values in COLUMNS.items():
                stored[f"run/{name}"] = values
    elif ending == "npz":
        accel = np.stack([COLUMNS[f"accel_{axis}"] for axis in "xyz"], axis=1)
        np.savez(path, accel=accel, **{k: v for k, v in COLUMNS.items() if k.endswith("deg")})
    elif ending == "mat":
        with h5py.File(path, "w", userblock_size=512) as stored:
            for name, values in COLUMNS.items():
                stored[name] = values[None, :]
                stored[name].attrs["MATLAB_class"] = "double"
        with path.open("r+b") as stream:
            stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64")
    else:
        path.write_text(json.dumps({name: values.tolist() for name, values in COLUMNS.items()}))
    return path


@pytest.mark.parametrize("ending", ["csv", "csv.gz", "txt", "xlsx", "parquet", "h5", "npz", "mat", "json"])
def test_every_format_gives_the_same_readings(tmp_path, ending):
    path = written(tmp_path, ending)
    with reading_with(Profile(separator=" ") if ending == "txt" else None):
        readings = read_bench(path)
    expected = read_bench(written(tmp_path, "csv"))
    # a workbook is written with 16 digits
    digits = {"rtol": 1e-15 if ending == "xlsx" else 0.0, "atol": 0.0}
    np.testing.assert_allclose(readings.channels["accelerometer"], expected.channels["accelerometer"], **digits)
    np.testing.assert_allclose(readings.azimuth, expected.azimuth, **digits)
    assert readings.digest == digest_file(path)


def test_units_in_names_are_converted_and_units_that_are_nowhere_are_stated(tmp_path):
    (tmp_path / "a.csv").write_text(
        "MD (ft),Incl [rad],Azimuth Grid (deg),azimuth_reference\n0,0,0,grid\n100,0.1,9,grid\n"
    )
    well = read_well(tmp_path / "a.csv")
    assert np.allclose(well.md, [0.0, 30.48])
    assert np.allclose(well.inclination, [0.0, 0.1])
    with refused("table-unit-missing", error=FileError):
        read_well(saved(tmp_path / "b.csv", "MD,INC,AZI,azimuth_reference\n0,0,0,grid\n100,5,9,grid\n"))
    with reading_with(None, "ft,deg"):
        assert np.allclose(read_well(tmp_path / "b.csv").md, [0.0, 30.48])
    with refused("input-choice"), reading_with(None, "furlong"):
        pass


@pytest.mark.parametrize(("unit", "cells"), [("°F", "68,77"), ("K", "293.15,298.15"), ("degC", "20,25")])
def test_temperatures_are_converted(tmp_path, unit, cells):
    rows = "".join(f"{k},{k + 1},{k * k},{cell}\n" for k, cell in enumerate(cells.split(","), 1))
    (tmp_path / "a.csv").write_text(f"accel_x,accel_y,accel_z,Temp ({unit})\n{rows}", encoding="utf-8")
    assert read_bench(tmp_path / "a.csv").temperature == pytest.approx([20.0, 25.0])


def test_a_layout_that_is_stated_is_not_looked_for(tmp_path):
    """Two lines of names: where the second one counts, only a profile says so."""
    (tmp_path / "a.csv").write_text("Report\nfront,back\naccel_x,accel_y\n1,2\n3,4\n")
    with reading_with(Profile(skip=2)):
        assert read_table(tmp_path / "a.csv").number("accel_y").tolist() == [2.0, 4.0]
    # the first separator is the one of a text here
    (tmp_path / "b.csv").write_text("operator;accel_x\nA,B,C;1\nD,E,F;3\n")
    with reading_with(Profile(separator=";")):
        assert read_table(tmp_path / "b.csv").number("accel_x").tolist() == [1.0, 3.0]
    (tmp_path / "c.csv").write_text("accel_x,accel_y\nfront,back\n1,2\n")
    with reading_with(Profile(units_row=True, columns={"accel_x": "accel_x", "accel_y": "accel_y"})):
        assert read_table(tmp_path / "c.csv").number("accel_y").tolist() == [2.0]


def test_a_profile_lays_out_names_converts_and_turns(tmp_path):
    (tmp_path / "mine.toml").write_text(
        'title = "mine"\nseparator = "semicolon"\nskip = 2\nunits_row = true\n'
        '[columns]\nAx = "accel_x_g"\nAy = "accel_y_g"\nAz = "accel_z_g"\n'
        'Hx = { name = "mag_x_nT", unit = "gauss" }\nHy = { name = "mag_y_nT", unit = "gauss" }\n'
        'Hz = { name = "mag_z_nT", unit = "gauss" }\noperator = ""\n'
        '[axes]\naccelerometer = ["y", "-x", "z"]\n[constants]\nreference_dip_deg = 70\n'
    )
    (tmp_path / "log.txt").write_text(
        "Company\nprinted;by;us\nAx;Ay;Az;Hx;Hy;Hz;operator\ng;g;g;G;G;G;\n0,1;0,2;0,9;0,2;0;0,45;me\n"
    )
    with reading_with(tmp_path / "mine.toml"):
        table = read_table(tmp_path / "log.txt")
    assert table.names == (
        "accel_y_g", "accel_x_g", "accel_z_g", "mag_x_nT", "mag_y_nT", "mag_z_nT", "reference_dip_deg"
    )  # fmt: skip
    # x of the tool is y of the file, y of the tool its -x
    assert table.number("accel_x_g") == 0.2
    assert table.number("accel_y_g") == -0.1
    assert np.allclose(table.number("mag_x_nT"), 20_000.0)
    assert table.number("reference_dip_deg") == 70.0
    assert table.lines.tolist() == [5]


def test_a_unit_in_the_name_is_not_talked_away(tmp_path):
    (tmp_path / "a.csv").write_text("MD (ft),inclination_deg\n100,1\n")
    with (
        reading_with(Profile(columns={"MD (ft)": "md_m"})),
        refused("table-units", error=FileError),
    ):
        read_table(tmp_path / "a.csv")
    with reading_with(Profile(columns={"MD (ft)": "md_m"}, given={"MD (ft)": "ft"})):
        assert np.isclose(read_table(tmp_path / "a.csv").number("md_m")[0], 30.48)


def test_a_row_of_another_length_names_its_line(tmp_path):
    with refused("table-row-width", error=FileError), reading_with(Profile(separator=" ")):
        read_table(saved(tmp_path / "a.txt", "accel_x accel_y\n1 2\n3\n"))


def test_rows_without_names_and_time(tmp_path):
    rng = np.random.default_rng(1)
    values = rng.normal(size=(500, 6)).round(5)
    np.savetxt(tmp_path / "imu.log", values, fmt="%.5f")
    with reading_with("mpu"):
        table = read_table(tmp_path / "imu.log", numeric=numbers_among(LOG))
        blocks = list(open_run(tmp_path / "imu.log").blocks())
    assert np.allclose(table.number("gyro_z_rad_s"), values[:, 5])
    assert np.isclose(table.number("time_s")[-1], 4.99)
    assert np.allclose(blocks[0].channels["accelerometer"], values[:, :3])


@pytest.mark.parametrize("name", shipped())
def test_every_shipped_profile_can_be_read_and_says_what_it_is_for(name):
    assert len(read_profile(name).title) > 20


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ('seperator = "tab"', "table-near"),
        ('separator = "pipe"', "input-choice"),
        ("skip = -1", "input-value"),
        ("skip = true", "input-kind"),
        ("rate_hz = 0", "input-value"),
        ('[axes]\naccelerometer = ["x", "x", "z"]', "table-profile-entry"),
        ('[columns]\nA = { name = "mag_x_nT", unit = "kg" }', "table-unit-convert"),
        ("[columns]\nA = 3", "table-profile-entry"),
        ('units = ["parsec"]', "input-choice"),
        ("skip = ", "file-format"),
        ("rate_hz = 1e6", "input-value"),
        ("header = 1", "input-kind"),
        ("units = 3", "input-kind"),
        ('null = "x"', "input-kind"),
        ('[columns]\nA = { name = "mag_x", unit = "nT" }', "table-unit-missing"),
        ('[columns]\nA = { name = "mag_x_nT", units = "nT" }', "table-profile-entry"),
        ("[roll_sets]\na = [1, 1]", "table-profile-entry"),
        ("[roll_sets]\na = [0, 4]", "table-profile-entry"),
        ("[roll_sets]\na = [1, 4]\nb = [4, 6]", "table-profile-entry"),
        ("[roll_sets]\na = [1, 4.5]", "table-profile-entry"),
        ('[axes]\naccel = ["x", "y"]', "table-profile-entry"),
        ('[axes]\nthermometer = ["x", "y", "z"]', "table-profile-entry"),
        ("[constants]\nx = true", "input-kind"),
        ("[constants]\nx = [1, 2]", "input-kind"),
        ("[constants]\nx = nan", "input-kind"),
        ("[constants]\nx = 1979-05-27", "input-kind"),
        ('[axes]\naccelerometer = ["x", "y", "--z"]', "table-profile-entry"),
        ('convention = "z-up"\n[axes]\naccelerometer = ["x", "y", "z"]', "input-one-of"),
    ],
)
def test_a_profile_that_cannot_be_meant(tmp_path, text, wanted):
    with refused(wanted, error=FileError):
        read_profile(saved(tmp_path / "p.toml", text))


def test_files_that_are_not_what_they_seem(tmp_path):
    for name, content, wanted in (
        ("a.xlsx", b"PK\x03\x04nothing", "file-format"),
        ("a.parquet", b"PAR1nothing", "file-format"),
        ("a.h5", b"\x89HDF\r\n\x1a\nnothing", "file-format"),
        ("a.mat", b"MATLAB 5.0 MAT-file nothing", "file-kind"),
        ("a.npz", b"PK\x03\x04nothing", "file-format"),
        ("a.json", b'{"accel_x": [1, 2', "file-format"),
        ("b.json", b'{"accel": [[1, 2], [3]]}', "input-shape"),
        ("c.json", b'{"name": "no columns"}', "file-empty"),
        ("d.json", b"[1, 2]", "table-json"),
        ("a.csv.gz", gzip.compress(b"accel_x,accel_y\n1,2\n")[:-6], "file-format"),
    ):
        (tmp_path / name).write_bytes(content)
        with refused(wanted, error=FileError):
            read_bench(tmp_path / name)


def test_what_would_swallow_memory_is_refused(tmp_path):
    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet()
    sheet.append([f"c{k}" for k in range(2000)])
    sheet.append([1.0] * 2000)
    book.save(tmp_path / "wide.xlsx")
    with refused("file-large", error=FileError):
        read_bench(tmp_path / "wide.xlsx")
    zeros = np.zeros(60_000_000)
    pq.write_table(pa.table({"accel_x": zeros, "accel_y": zeros}), tmp_path / "zeros.parquet")
    with refused("file-large", error=FileError):
        read_bench(tmp_path / "zeros.parquet")


def test_a_packed_file_that_unpacks_to_too_much_is_refused(tmp_path, monkeypatch):
    """By the megabyte: one of two is unpacked where two are allowed, not where one is."""
    np.savez(tmp_path / "a.npz", accel=np.ones((50_000, 3)))
    (tmp_path / "a.npz.gz").write_bytes(gzip.compress((tmp_path / "a.npz").read_bytes()))
    monkeypatch.setattr(foreign, "MOST_UNPACKED", 2 << 20)
    assert len(read_table(tmp_path / "a.npz.gz")) == 50_000
    monkeypatch.setattr(foreign, "MOST_UNPACKED", 1 << 20)
    with refused("file-large", error=FileError):
        read_table(tmp_path / "a.npz.gz")


def test_texts_in_a_parquet_file(tmp_path):
    columns = {"station": ["A", "B", None], "accel_x": [1.0, 2.0, 3.0], "accel_y": [4, 6, 5]}
    pq.write_table(pa.table({name: values[:2] for name, values in columns.items()}), tmp_path / "a.parquet")
    assert read_bench(tmp_path / "a.parquet").station == ("A", "B")
    pq.write_table(pa.table(columns), tmp_path / "a.parquet")
    with refused("input-empty", error=FileError):
        read_bench(tmp_path / "a.parquet")


def test_axes_hold_for_the_columns_of_a_survey_as_for_channels(tmp_path):
    """As the convention stated to the reader itself."""
    from inclinometry.files.six_axis import read_six_axis

    text = "MD (m),Gx (g),Gy (g),Gz (g),Bx (nT),By (nT),Bz (nT)\n100,0.2,0.1,0.97,20000,10000,44000\n"
    (tmp_path / "six.csv").write_text(text)
    (tmp_path / "up.toml").write_text('convention = "z-up"\n')
    (tmp_path / "by.toml").write_text('[axes]\naccelerometer = ["-x", "y", "z"]\nmagnetometer = ["x", "-y", "-z"]\n')
    expected = read_six_axis(tmp_path / "six.csv", convention="z-up")
    for name in ("up.toml", "by.toml"):
        with reading_with(tmp_path / name):
            found = read_six_axis(tmp_path / "six.csv")
        np.testing.assert_allclose(found.g, expected.g, rtol=1e-12)
        np.testing.assert_allclose(found.b, expected.b, rtol=1e-12)


def test_sets_of_shots_keep_together(tmp_path):
    nan = [None, None, None]
    shots = {"mag": [[1, 2, 3], nan, [7, 8, 9], nan], "grav": [[1, 2, 3], [4, 5, 6], [7, 8, 9], nan]}
    with reading_with("sap6"), refused("table-empty", error=FileError):
        read_bench(saved(tmp_path / "a.json", json.dumps(shots)))
    shots["mag"][1] = [4, 5, 6]
    with reading_with("sap6"):
        assert len(read_bench(saved(tmp_path / "a.json", json.dumps(shots))).channels["accelerometer"]) == 3
    shots["grav"] = shots["grav"][:3]
    with reading_with("sap6"), refused("input-shape", error=FileError, name="grav"):
        read_bench(saved(tmp_path / "a.json", json.dumps(shots)))


WELL = "MD,INC,AZI\n0,0,0\n{}\n2000,20,21\n"


def test_a_layout_is_as_strict_as_none(tmp_path):
    stated = {"constants": {"azimuth_reference": "true"}, "units": ("m", "deg")}
    with reading_with(Profile(**stated)), refused("table-comment", error=FileError):
        read_well(saved(tmp_path / "hash.csv", WELL.format("#1000,80,90")))
    for rows, wanted in {"1,500;10;20\n2,000;20;21": "table-decimal", "1.000;10,5;20": "table-decimal-mixed"}.items():
        with reading_with(Profile(**stated)), refused(wanted, error=FileError):
            read_well(saved(tmp_path / "comma.csv", f"MD;INC;AZI\n0;0;0\n{rows}\n"))
    with reading_with(Profile(**stated)):
        assert read_well(saved(tmp_path / "comma.csv", "MD;INC;AZI\n0;0;0\n1500,5;10,25;20\n")).md[1] == 1500.5


def test_gzip_of_several_parts(tmp_path):
    parts = [b"accel_x,accel_y\n1,2\n", b"3,4\n", b"5,6\n"]
    (tmp_path / "a.csv.gz").write_bytes(b"".join(map(gzip.compress, parts)) + bytes(100))
    assert read_table(tmp_path / "a.csv.gz").number("accel_x").tolist() == [1.0, 3.0, 5.0]


@pytest.mark.parametrize("units", ["m,deg,mG,g", "g,mG,deg,m"])
def test_the_order_of_units_decides_nothing(tmp_path, units):
    from inclinometry.files.six_axis import read_six_axis

    with reading_with(None, units):
        found = read_six_axis(saved(tmp_path / "a.csv", "MD,GX,GY,GZ,BX,BY,BZ\n100,0.2,0.1,0.97,200,100,440\n"))
    np.testing.assert_allclose(found.g[0], 9.80665 * np.array([0.2, 0.1, 0.97]))
    np.testing.assert_allclose(found.b[0], [20_000.0, 10_000.0, 44_000.0])


def test_a_name_that_may_be_two_things_is_refused(tmp_path):
    (tmp_path / "a.csv").write_text("azimuth_deg,inclination_deg,toolface_deg,AX,AY,AZ\n0,0,0,1,2,1000\n")
    for units in ("deg,mg", "mg,deg"):
        with reading_with(None, units), refused("table-ambiguous", error=FileError):
            read_bench(tmp_path / "a.csv")
    with refused("input-choice"), reading_with(None, "F"):
        pass


def test_units_below_the_names_and_a_profile(tmp_path):
    (tmp_path / "a.txt").write_text("Ax;Ay;MD\nmg;mg;ft\n1;2;100\n")
    swapped = {"Ax": "accel_y_mg", "Ay": "accel_x_mg"}
    with reading_with(Profile(separator=";", units_row=True, columns=swapped)):
        table = read_table(tmp_path / "a.txt")
    assert (table.number("accel_x_mg"), table.number("accel_y_mg")) == (2.0, 1.0)
    assert np.isclose(table.number("md_m"), 30.48)
    with (
        reading_with(Profile(separator=";", units_row=True, columns={"MD": "md_m"})),
        refused("table-units", error=FileError),
    ):
        read_table(tmp_path / "a.txt")


def test_a_profile_may_not_contradict_a_unit_by_another_name(tmp_path):
    (tmp_path / "a.csv").write_text("MD (m),Gx (g)\n100,1\n")
    for columns in ({"MD (m)": "md_ft"}, {"Gx (g)": "accel_x_mg"}):
        with reading_with(Profile(columns=columns)), refused("table-units", error=FileError):
            read_table(tmp_path / "a.csv")


@pytest.mark.parametrize(
    "name", ["AZM", "Azi", "Azimuth", "AZIM", "AZIM_M", "AZIMT", "AZIMG", "Azim N", "HAZI", "Bearing"]
)
def test_a_name_without_a_north_states_none(tmp_path, name):
    with refused("table-north", error=FileError):
        read_well(saved(tmp_path / "a.csv", f"MD (m),INC (deg),{name} (deg)\n0,0,0\n100,5,9\n"))
    for north in ("magnetic", "true", "grid"):
        with reading_with(Profile(constants={"azimuth_reference": north})):
            assert read_well(tmp_path / "a.csv").azimuth_reference == north
        assert read_survey(tmp_path / "a.csv", azimuth_reference=north).azimuth_reference == north
    with refused("table-north", error=FileError):
        read_survey(tmp_path / "a.csv")


def test_hdf5_units_and_names(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as stored:
        for kind in ("accel", "mag"):
            for axis in "xyz":
                stored[f"{kind}/{axis}"] = np.arange(3.0)
        stored["MD"] = np.array([0.0, 1000.0, 2000.0])
        stored["MD"].attrs["units"] = "ft"
    table = read_table(tmp_path / "a.h5")
    assert {"accel_x", "mag_x"} <= set(table.names)
    assert np.isclose(table.number("md_m")[-1], 609.6)


def test_a_profile_holds_for_every_format(tmp_path):
    from inclinometry.files.six_axis import read_six_axis
    from inclinometry.workflow.convert import convert

    (tmp_path / "six.csv").write_text(
        "MD (m),Gx (g),Gy (g),Gz (g),Bx (nT),By (nT),Bz (nT)\n100,.2,.1,.97,1e4,2e4,4e4\n"
    )
    for ending in ("xlsx", "parquet", "las"):
        convert(tmp_path / "six.csv", tmp_path / f"six.{ending}")
        with reading_with(Profile(axes={"accelerometer": ("y", "x", "z")})):
            found = read_six_axis(tmp_path / f"six.{ending}")
        np.testing.assert_allclose(found.g[0], 9.80665 * np.array([0.1, 0.2, 0.97]), rtol=1e-9)


def test_profiles_that_are_not_there(tmp_path):
    with refused("input-choice", name="profile"):
        read_profile("sap7")
    with refused("file-absent", error=FileError):
        read_profile(tmp_path / "none.toml")
    (tmp_path / "bytes.toml").write_bytes(b"\xff")
    with refused("file-text", error=FileError):
        read_profile(tmp_path / "bytes.toml")


def test_what_a_profile_says_is_what_is_kept(tmp_path):
    (tmp_path / "p.toml").write_text(
        'title = "mine"\nheader = false\nrate_hz = 50\nnull = -1\nunits = ["ft"]\n'
        '[columns]\n1 = { name = "mag_x_nT", unit = "uT", blank = "0" }\n2 = ""\n'
        '[axes]\nmag = ["+y", "-z", "x"]\n[constants]\na = 1\nb = "two"\n[roll_sets]\none = [1, 4]\ntwo = [5, 6]\n'
    )
    found = read_profile(tmp_path / "p.toml")
    assert (found.title, found.header, found.rate_hz, found.null, found.units) == ("mine", False, 50.0, -1.0, ("ft",))
    assert (dict(found.columns), dict(found.given), dict(found.blank)) == (
        {"1": "mag_x_nT", "2": ""},
        {"1": "uT"},
        {"1": "0"},
    )
    assert dict(found.axes) == {"magnetometer": ("y", "-z", "x")}
    assert dict(found.constants) == {"a": 1.0, "b": "two"}
    assert dict(found.roll_sets) == {"one": (1, 4), "two": (5, 6)}
    assert (found.lays_out, found.states_layout) == (True, True)
    plain = Profile(title="x", columns={"A": "mag_x"}, units=("m",), null=1.0, roll_sets={"a": (1, 2)})
    assert (plain.lays_out, plain.states_layout) == (False, False)
    assert Profile(columns={"A": ""}).lays_out


def test_deviations_keep_their_sign_when_axes_are_turned(tmp_path):
    (tmp_path / "a.csv").write_text(
        "accel_x,accel_y,accel_z,accel_x_sd,accel_y_sd,accel_z_sd\n1,2,3,0.1,0.2,0.3\n4,6,5,0.1,0.2,0.3\n"
    )
    with reading_with(Profile(axes={"accelerometer": ("-z", "x", "-y")})):
        found = read_bench(tmp_path / "a.csv")
    np.testing.assert_array_equal(found.channels["accelerometer"], [[-3.0, 1.0, -2.0], [-5.0, 4.0, -6.0]])
    np.testing.assert_array_equal(found.sd["accelerometer"][0], [0.3, 0.1, 0.2])


def test_a_field_in_a_unit_that_channels_have_not_is_turned_into_nanotesla(tmp_path):
    found = read_bench(saved(tmp_path / "a.csv", "Bx (gauss),By (gauss),Bz (gauss)\n0.2,0.1,0.45\n0.3,0.2,0.4\n"))
    np.testing.assert_allclose(found.channels["magnetometer"][0], [20_000.0, 10_000.0, 45_000.0])
    assert found.units["magnetometer"] == "nT"
