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
from scipy.io import savemat

from inclinometry.digest import digest_file
from inclinometry.errors import FileError, InclinometryError, InputError
from inclinometry.files.bench_csv import read_bench
from inclinometry.files.columns import LOG, numbers_among
from inclinometry.files.position_csv import read_well
from inclinometry.files.profile import Profile, read_profile, reading_with, shipped
from inclinometry.files.run_file import open_run
from inclinometry.files.table import read_table

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
        savemat(path, {name: values[:, None] for name, values in COLUMNS.items()})
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
    (tmp_path / "b.csv").write_text("MD,INC,AZI,azimuth_reference\n0,0,0,grid\n100,5,9,grid\n")
    with pytest.raises(FileError, match="md_m"):
        read_well(tmp_path / "b.csv")
    with reading_with(None, "ft,deg"):
        assert np.allclose(read_well(tmp_path / "b.csv").md, [0.0, 30.48])
    with pytest.raises(InputError, match="unit 'furlong' is not known"), reading_with(None, "furlong"):
        pass


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
    assert table.header == (
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
    with reading_with(Profile(columns={"MD (ft)": "md_m"})), pytest.raises(FileError, match="states a unit"):
        read_table(tmp_path / "a.csv")
    with reading_with(Profile(columns={"MD (ft)": "md_m"}, given={"MD (ft)": "ft"})):
        assert np.isclose(read_table(tmp_path / "a.csv").number("md_m")[0], 30.48)


def test_a_row_of_another_length_names_its_line(tmp_path):
    (tmp_path / "a.txt").write_text("accel_x accel_y\n1 2\n3\n")
    with pytest.raises(FileError, match="line 3: this row has 1 cells"), reading_with(Profile(separator=" ")):
        read_table(tmp_path / "a.txt")


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
        ('seperator = "tab"', "did you mean separator"),
        ('separator = "pipe"', "allowed: comma, semicolon, tab, space"),
        ("skip = -1", "a number of lines is needed"),
        ("skip = true", "a whole number is needed"),
        ("rate_hz = 0", "allowed 0 to"),
        ('[axes]\naccelerometer = ["x", "x", "z"]', "each axis once"),
        ('[columns]\nA = { name = "mag_x_nT", unit = "kg" }', "cannot be converted"),
        ("[columns]\nA = 3", "write"),
        ('units = ["parsec"]', "not known"),
        ("skip = ", "Invalid"),
    ],
)
def test_a_profile_that_cannot_be_meant(tmp_path, text, wanted):
    (tmp_path / "p.toml").write_text(text)
    with pytest.raises(FileError, match=wanted):
        read_profile(tmp_path / "p.toml")


def test_files_that_are_not_what_they_seem(tmp_path):
    for name, content in {
        "a.xlsx": b"PK\x03\x04nothing",
        "a.parquet": b"PAR1nothing",
        "a.h5": b"\x89HDF\r\n\x1a\nnothing",
        "a.mat": b"MATLAB 5.0 MAT-file nothing",
        "a.npz": b"PK\x03\x04nothing",
        "a.json": b'{"accel_x": [1, 2',
        "b.json": b'{"accel": [[1, 2], [3]]}',
        "c.json": b'{"name": "no columns"}',
        "a.csv.gz": gzip.compress(b"accel_x,accel_y\n1,2\n")[:-6],
    }.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InclinometryError):
            read_bench(tmp_path / name)


def test_what_would_swallow_memory_is_refused(tmp_path):
    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet()
    sheet.append([f"c{k}" for k in range(2000)])
    sheet.append([1.0] * 2000)
    book.save(tmp_path / "wide.xlsx")
    with pytest.raises(FileError, match="2,000 columns"):
        read_bench(tmp_path / "wide.xlsx")
    zeros = np.zeros(60_000_000)
    pq.write_table(pa.table({"accel_x": zeros, "accel_y": zeros}), tmp_path / "zeros.parquet")
    with pytest.raises(FileError, match="120,000,000 values"):
        read_bench(tmp_path / "zeros.parquet")
