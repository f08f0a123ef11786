"""Date and time as people write them become seconds; what could be two dates is refused; packed files of every kind."""

from __future__ import annotations

import gzip
import json

import numpy as np
import pytest

from inclinometry.errors import FileError
from inclinometry.files.log_csv import read_log
from inclinometry.files.profile import Profile, reading_with
from inclinometry.files.run_file import open_run

CHANNELS = "accel_x_g,accel_y_g,accel_z_g"
WRITTEN = {
    "stamps": (f"timestamp,{CHANNELS}\n2026-05-01T23:59:59.990Z,0,0,1\n2026-05-02T00:00:00.0000Z,0,0,1\n", 0.01),
    "zones": (f"time,{CHANNELS}\n2026-05-01 12:00:00+02:00,0,0,1\n2026-05-01 10:00:01.5+00:00,0,0,1\n", 1.5),
    "German": (
        "Datum;Uhrzeit;accel_x_g;accel_y_g;accel_z_g\n28.02.2026;23:59:59,5;0,5;0;1\n01.03.2026;0:00:01,0;0;0;1\n",
        1.5,
    ),
    "years of two digits": (
        f"Year,Month,Day,Hour,Minute,Second,{CHANNELS}\n24,2,29,23,59,59.25,0,0,1\n24,3,1,0,0,0.5,0,0,1\n",
        1.25,
    ),
    "half days": (f"Date,Time,{CHANNELS}\n05/01/2026,11:59:59 AM,0,0,1\n05/01/2026,12:00:01 PM,0,0,1\n", 2.0),
    "months first": (f"Date,Time,{CHANNELS}\n05/30/2026,12:00,0,0,1\n05/31/2026,12:00,0,0,1\n", 86400.0),
    "the clock past midnight": (f"Time,{CHANNELS}\n23:59:59.5,0,0,1\n00:00:00.5,0,0,1\n", 1.0),
    "six columns": (
        f"Year,Month,Day,Hour,Minute,Second,{CHANNELS}\n2026,5,31,23,59,59.25,0,0,1\n2026,6,1,0,0,0.5,0,0,1\n",
        1.25,
    ),
    "an inertial unit's": (
        f"UTC_Year,UTC_Month,UTC_Day,UTC_Hour,UTC_Minute,UTC_Second,UTC_Nano,{CHANNELS}\n"
        "2026,5,31,23,59,59,250000000,0,0,1\n2026,6,1,0,0,0,500000000,0,0,1\n",
        1.25,
    ),
    "a clock in columns, past midnight": (
        f"Hour,Minute,Second,{CHANNELS}\n23,59,59.25,0,0,1\n0,0,0.5,0,0,1\n",
        1.25,
    ),
    "hours and minutes": (f"hh,min,{CHANNELS}\n9,59,0,0,1\n10,1.5,0,0,1\n", 150.0),
    "milliseconds": (f"Time (ms),{CHANNELS}\n100,0,0,1\n110,0,0,1\n", 0.01),
    "microseconds": (f"timestamp_us,{CHANNELS}\n100,0,0,1\n350,0,0,1\n", 0.00025),
    "a telephone's": (
        f"time,seconds_elapsed,{CHANNELS}\n1700000000000000000,0.5,0,0,1\n1700000000010000000,0.51,0,0,1\n",
        0.01,
    ),
}


@pytest.mark.parametrize("how", WRITTEN)
def test_time_as_it_is_written(tmp_path, how):
    text, step = WRITTEN[how]
    path = tmp_path / "log.csv"
    path.write_text(text)
    assert np.diff(read_log(path).time) == pytest.approx([step], abs=1e-9)
    run = np.concatenate([block.time for block in open_run(path).blocks()])
    assert np.diff(run) == pytest.approx([step], abs=1e-9)


def test_long_stamps_keep_their_microseconds_in_every_block(tmp_path):
    stamps = np.datetime64("2026-05-01T23:59:00", "us") + np.arange(60_000) * 2500
    rows = "".join(f"{stamp},0,0,1\n" for stamp in stamps)
    (tmp_path / "log.csv").write_text(f"time,{CHANNELS}\n{rows}")
    log = read_log(tmp_path / "log.csv")
    assert np.abs(log.time - np.arange(60_000) * 0.0025).max() < 1e-9
    assert log.channels["accelerometer"].shape == (60_000, 3)


@pytest.mark.parametrize(
    ("row", "says"),
    [
        ("05/02/2026,1:00", "line 3: .*the day or the month may stand first"),
        ("2026-05-01,noon", "line 3: '2026-05-01 noon' in column 'Date', 'Time' is no date and time"),
        ("2026-02-30,1:00", "line 3: .*is no date and time"),
    ],
)
def test_what_is_no_time_or_may_be_two(tmp_path, row, says):
    (tmp_path / "log.csv").write_text(f"Date,Time,{CHANNELS}\n05/01/2026,1:00,0,0,1\n{row},0,0,1\n")
    with pytest.raises(FileError, match=says):
        read_log(tmp_path / "log.csv")


@pytest.mark.parametrize("columns", ["Day,Hour,Minute", "Month,Day,Hour,Minute", "Hour,Second,Year", "Year,Month,Day"])
def test_half_a_date_or_half_a_clock_is_no_time(tmp_path, columns):
    cells = ",".join("1" * len(columns.split(",")))
    (tmp_path / "log.csv").write_text(f"{columns},{CHANNELS}\n{cells},0,0,1\n{cells},0,0,1\n")
    with pytest.raises(FileError, match="'time_s' is missing"):
        read_log(tmp_path / "log.csv")


def test_a_time_without_a_unit_is_not_guessed(tmp_path):
    (tmp_path / "log.csv").write_text(f"t,{CHANNELS}\n100,0,0,1\n110,0,0,1\n")
    with pytest.raises(FileError, match="'time_s' is missing"):
        read_log(tmp_path / "log.csv")
    with reading_with(Profile(units=("ms",))):
        assert np.diff(read_log(tmp_path / "log.csv").time) == pytest.approx([0.01])


@pytest.mark.parametrize("packed", [False, True])
def test_rows_of_arrays_are_counted_as_rows(tmp_path, packed):
    content = {"time_s": [0, 1, 0.5], **{f"accel_{axis}_g": [0, 0, 1] for axis in "xyz"}}
    path = tmp_path / ("log.json.gz" if packed else "log.json")
    text = json.dumps(content).encode()
    path.write_bytes(gzip.compress(text) if packed else text)
    for read in (read_log, lambda path: list(open_run(path).blocks())):
        with pytest.raises(FileError, match=r"log\.json(\.gz)?, row 3: time_s 0.5 is less"):
            read(path)


def test_packed_files_are_read_by_what_is_in_them(tmp_path):
    import openpyxl

    rows = [("time_s", "accel_x_g", "accel_y_g", "accel_z_g"), (0, 0, 0, 1), (1, 0, 0.25, 1)]
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(row)
    book.save(tmp_path / "log.xlsx")
    np.savez(tmp_path / "log.npz", **dict(zip(rows[0], np.array(rows[1:]).T, strict=True)))
    for name in ("log.xlsx", "log.npz"):
        packed = tmp_path / f"{name}.gz"
        packed.write_bytes(gzip.compress((tmp_path / name).read_bytes()))
        assert read_log(packed).channels["accelerometer"][1].tolist() == [0.0, 0.25, 1.0]
    (tmp_path / "cut.xlsx.gz").write_bytes(gzip.compress((tmp_path / "log.xlsx").read_bytes())[:-9])
    with pytest.raises(FileError, match=r"cut\.xlsx\.gz: damaged where it is compressed"):
        read_log(tmp_path / "cut.xlsx.gz")
