"""Date and time as people write them become seconds; what could be two dates is refused; packed files of every kind."""

from __future__ import annotations

import gzip
import json

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files.log_csv import read_log
from inclinometry.files.profile import Profile, reading_with
from inclinometry.files.run_file import open_run

from .surveys import saved

CHANNELS = "accel_x_g,accel_y_g,accel_z_g"
WRITTEN = {
    "stamps": (f"timestamp,{CHANNELS}\n2026-05-01T23:59:59.990Z,0,0,1\n2026-05-02T00:00:00.0000Z,0,0,1\n", 0.01),
    "zones": (f"time,{CHANNELS}\n2026-05-01 12:00:00+02:00,0,0,1\n2026-05-01 10:00:01.5+00:00,0,0,1\n", 1.5),
    "west of Greenwich": (
        f"time,{CHANNELS}\n2026-05-01T20:30:00-03:30,0,0,1\n2026-05-02T00:00:01Z,0,0,1\n"
        "2026-05-01 23:00:02-0100,0,0,1\n",
        1.0,
    ),
    "German": (
        "Datum;Uhrzeit;accel_x_g;accel_y_g;accel_z_g\n28.02.2026;23:59:59,5;0,5;0;1\n01.03.2026;0:00:01,0;0;0;1\n",
        1.5,
    ),
    "years of two digits": (
        f"Year,Month,Day,Hour,Minute,Second,{CHANNELS}\n24,2,29,23,59,59.25,0,0,1\n24,3,1,0,0,0.5,0,0,1\n",
        1.25,
    ),
    "half days": (f"Date,Time,{CHANNELS}\n05/01/2026,11:59:59 AM,0,0,1\n05/01/2026,12:00:01 PM,0,0,1\n", 2.0),
    "half past midnight": (f"Date,Time,{CHANNELS}\n2026-05-01,12:30 a.m.,0,0,1\n2026-05-01,1:00 am,0,0,1\n", 1800.0),
    "the end of a day": (
        f"Date,Time,{CHANNELS}\n2026-05-01,23:59:59,0,0,1\n2026-05-01,24:00:00,0,0,1\n2026-05-02,00:00:01,0,0,1\n",
        1.0,
    ),
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
    "a clock in columns, past midnight": (f"Hour,Minute,Second,{CHANNELS}\n23,59,59.25,0,0,1\n0,0,0.5,0,0,1\n", 1.25),
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
    assert np.diff(read_log(saved(path, text)).time) == pytest.approx(step, abs=1e-9)
    run = np.concatenate([block.time for block in open_run(path).blocks()])
    assert np.diff(run) == pytest.approx(step, abs=1e-9)


def test_long_stamps_keep_their_microseconds_in_every_block(tmp_path):
    stamps = np.datetime64("2026-05-01T23:59:00", "us") + np.arange(60_000) * 2500
    rows = "".join(f"{stamp},0,0,1\n" for stamp in stamps)
    log = read_log(saved(tmp_path / "log.csv", f"time,{CHANNELS}\n{rows}"))
    assert np.abs(log.time - np.arange(60_000) * 0.0025).max() < 1e-9
    assert log.channels["accelerometer"].shape == (60_000, 3)


@pytest.mark.parametrize(
    ("row", "says"),
    [
        ("05/02/2026,1:00", "table-date"),
        ("2026-05-01,noon", "table-time"),
        ("2026-02-30,1:00", "table-time"),
        ("2026-02-03,25:00", "table-time"),
        ("2026-02-03,1:60", "table-time"),
        ("2026-02-03,1:00:61", "table-time"),
    ],
)
def test_what_is_no_time_or_may_be_two(tmp_path, row, says):
    with refused(says, error=FileError):
        read_log(saved(tmp_path / "log.csv", f"Date,Time,{CHANNELS}\n05/01/2026,1:00,0,0,1\n{row},0,0,1\n"))


@pytest.mark.parametrize("columns", ["Day,Hour,Minute", "Month,Day,Hour,Minute", "Hour,Second,Year", "Year,Month,Day"])
def test_half_a_date_or_half_a_clock_is_no_time(tmp_path, columns):
    cells = ",".join("1" * len(columns.split(",")))
    with refused("file-column", error=FileError, columns=("time_s",)):
        read_log(saved(tmp_path / "log.csv", f"{columns},{CHANNELS}\n{cells},0,0,1\n{cells},0,0,1\n"))


def test_a_time_without_a_unit_is_not_guessed(tmp_path):
    with refused("file-column", error=FileError, columns=("time_s",)):
        read_log(saved(tmp_path / "log.csv", f"t,{CHANNELS}\n100,0,0,1\n110,0,0,1\n"))
    with reading_with(Profile(units=("ms",))):
        assert np.diff(read_log(tmp_path / "log.csv").time) == pytest.approx([0.01])


@pytest.mark.parametrize("packed", [False, True])
def test_rows_of_arrays_are_counted_as_rows(tmp_path, packed):
    content = {"time_s": [0, 1, 0.5], **{f"accel_{axis}_g": [0, 0, 1] for axis in "xyz"}}
    path = tmp_path / ("log.json.gz" if packed else "log.json")
    text = json.dumps(content).encode()
    path.write_bytes(gzip.compress(text) if packed else text)
    for read in (read_log, lambda path: list(open_run(path).blocks())):
        with refused("input-order", error=FileError):
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
    with refused("file-format", error=FileError):
        read_log(tmp_path / "cut.xlsx.gz")


@pytest.mark.parametrize("names", ["Time", "Hour,Minute"])
@pytest.mark.parametrize(
    ("clocks", "hours"), [(("20:00", "05:00"), 9.0), (("23:00", "01:00"), 2.0), (("17:00", "06:00"), 0.0)]
)
def test_a_clock_without_a_date_goes_round_at_midnight(tmp_path, names, clocks, hours):
    """Back by more than half a day is the next one; by less it runs backwards, which is refused."""
    rows = [clock if names == "Time" else clock.replace(":", ",") for clock in (*clocks, clocks[1].replace("00", "30"))]
    (tmp_path / "log.csv").write_text(f"{names},{CHANNELS}\n" + "".join(f"{row},0,0,1\n" for row in rows))
    if not hours:
        with refused("input-order", error=FileError):
            read_log(tmp_path / "log.csv")
        return
    assert read_log(tmp_path / "log.csv").time.tolist() == [0.0, 3600.0 * hours, 3600.0 * hours + 1800.0]
    # two days on end
    again = rows[:1] + rows[1:2] + rows[:1] + rows[1:2]
    (tmp_path / "log.csv").write_text(f"{names},{CHANNELS}\n" + "".join(f"{row},0,0,1\n" for row in again))
    assert read_log(tmp_path / "log.csv").time.tolist() == [0.0, 3600.0 * hours, 86400.0, 86400.0 + 3600.0 * hours]


def test_comments_blanks_and_other_columns_stand_among_the_rows(tmp_path):
    """Line numbers stay those of the file; a time of the package's own besides counts, and the stamps are no column."""
    text = f"# logger 7\n   \nDate,note,Time,{CHANNELS}\n\n # begin\n2026-05-01,a,12:00:00,0,0,1\n  \n#\n"
    text += "2026-05-01,b,12:00:01.5,0,0.5,1\n# end\n"
    log = read_log(saved(tmp_path / "log.csv", text))
    assert (log.time.tolist(), log.channels["accelerometer"][1].tolist()) == ([0.0, 1.5], [0.0, 0.5, 1.0])
    assert [(one.code, one.values["names"]) for one in log.findings] == [("table-unused", ("note",))]
    with refused("table-row-width", error=FileError, cells=2, columns=6) as caught:
        read_log(saved(tmp_path / "log.csv", text + "2026-05-01,c\n"))
    assert caught.value.line == 11
    with refused("table-row-width", error=FileError, cells=4, columns=6):
        read_log(saved(tmp_path / "log.csv", text + "2026-05-01,c,12:00:02,1\n"))
    for own in ("time_s", "Time (s)"):
        (tmp_path / "log.csv").write_text(f"{own},Clock,{CHANNELS}\n5,12:00,0,0,1\n7,12:01,0,0,1\n")
        assert read_log(tmp_path / "log.csv").time.tolist() == [5.0, 7.0]


@pytest.mark.parametrize(
    ("rows", "step"),
    [
        (("1/2/2026,1:00", "13/2/2026,1:00"), None),  # the first may have been the second of January
        (("13/2/2026,1:00", "14/2/2026,1:00"), 86400.0),
        (("2/13/2026,1:00", "2/14/2026,1:00"), 86400.0),
        (("1.2.2026,1:00", "1.3.2026,1:00"), 28 * 86400.0),
        (("1-2-26,1:00", "1-2-26,2:30"), 5400.0),
        (("2/28/99,1:00", "3/1/99,1:00"), 86400.0),
        (("13/2/2026,1:00", "3/2/2026,1:00"), -10 * 86400.0),  # as the first one was
    ],
)
def test_the_order_of_day_and_month(tmp_path, rows, step):
    (tmp_path / "log.csv").write_text(f"Date,Time,{CHANNELS}\n" + "".join(f"{row},0,0,1\n" for row in rows))
    if step is None or step < 0.0:
        with refused("table-date", "input-order", error=FileError):
            read_log(tmp_path / "log.csv")
        return
    assert np.diff(read_log(tmp_path / "log.csv").time).tolist() == [step]
