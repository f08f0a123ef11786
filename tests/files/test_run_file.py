"""Runs as files: what is written comes back, blocks do not matter, and what cannot be read names its place."""

from __future__ import annotations

import pickle
import tracemalloc
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.digest import digest_file
from inclinometry.errors import FileError
from inclinometry.files.run_file import ROWS, OutField, open_run, writing

from .surveys import saved

COLUMNS = [OutField("time_s", "s", True), *(OutField(f"{k}_{a}", "") for k in ("accel", "mag", "gyro") for a in "xyz")]
HEADER = ",".join(c.name for c in COLUMNS)


def samples(count, seed=1):
    """Column -> values; one reading in fifty missing."""
    rng = np.random.default_rng(seed)
    found = {c.name: rng.standard_normal(count).astype(np.float32) for c in COLUMNS}
    for name in list(found)[1:]:
        found[name][rng.uniform(size=count) < 0.02] = np.nan
    return {**found, "time_s": np.arange(count) / 2000.0}


def write(path, data):
    with writing(path, COLUMNS, {"seed": "1"}) as append:
        append(data)


def read(path, rows=1 << 17):
    """Time and all channels side by side, in one piece."""
    run = open_run(path)
    blocks = list(run.blocks(rows))
    assert all(len(block.time) <= rows for block in blocks)
    channels = [np.concatenate([block.channels[kind] for block in blocks]) for kind in run.names]
    return np.concatenate([block.time for block in blocks]), np.concatenate(channels, axis=1)


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_what_is_written_comes_back_to_the_bit(tmp_path, ending):
    path, data = tmp_path / f"run.{ending}", samples(30_000)
    write(path, data)
    time, channels = read(path)
    # shortest decimals and float32 both return every bit of a float32 value
    assert np.array_equal(time, data["time_s"])
    wanted = np.stack([data[c.name] for c in COLUMNS[1:]], axis=1)
    if ending == "parquet":
        assert np.array_equal(channels, wanted, equal_nan=True)
    else:
        assert np.array_equal(channels.astype(np.float32), wanted, equal_nan=True)
    run = open_run(path)
    list(run.blocks())
    assert run.digest() == digest_file(path)


@pytest.mark.long
@settings(deadline=None, max_examples=20)
@given(rows=st.integers(1, 40_000))
def test_the_size_of_blocks_does_not_matter(rows):
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "run.csv")
        write(path, samples(20_000))
        whole, cut = read(path), read(path, max(rows, 500))
    assert np.array_equal(whole[0], cut[0])
    assert np.array_equal(whole[1], cut[1], equal_nan=True)


def test_a_file_does_not_depend_on_the_blocks_it_was_written_in(tmp_path):
    data = samples(ROWS + 1000)
    write(tmp_path / "a.parquet", data)
    with writing(tmp_path / "b.parquet", COLUMNS, {"seed": "1"}) as append:
        for start in range(0, ROWS + 1000, 77_777):
            append({name: values[start : start + 77_777] for name, values in data.items()})
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()
    assert pq.ParquetFile(tmp_path / "a.parquet").metadata.num_row_groups == 2


def test_the_dialects_of_csv(tmp_path):
    """Semicolons, decimal commas, comments, quotes, blank lines, a byte-order mark, trailing marks, nan."""
    rows = '\ufefftime_s;mag_1;mag_2;note\r\n# made by hand\r\n0,5;1;2,25;x\r\n\r\n1;nan;;y;\r\n1,5; NaN ;3;"z"\r\n'
    run = open_run(saved(tmp_path / "run.csv", rows, encoding="utf-8", newline=""))
    (block,) = run.blocks()
    assert block.time.tolist() == [0.5, 1.0, 1.5]
    wanted = [[1.0, 2.25], [np.nan, np.nan], [np.nan, 3.0]]
    assert np.array_equal(block.channels["magnetometer"], wanted, equal_nan=True)
    assert [(one.code, one.values["names"]) for one in run.findings] == [("table-unused", ("note",))]


def long_csv(path, spoil, line=60_000, count=80_000):
    """A run of several blocks, one line spoilt."""
    lines = [f"{0.001 * k:.6f},9.81,0.25,-1.5" for k in range(count)]
    lines[line - 2] = spoil(lines[line - 2])
    path.write_text("time_s,accel_x,accel_y,accel_z\n" + "\n".join(lines) + "\n")
    return path


SPOILT = {
    "text": (lambda s: s.replace("0.25", "broken"), "input-kind"),
    "short": (lambda s: s.rsplit(",", 1)[0], "table-row-width"),
    "long": (lambda s: s + ",7", "table-row-width"),
    "infinite": (lambda s: s.replace("0.25", "inf"), "input-finite"),
    "absurd": (lambda s: s.replace("0.25", "1e40"), "input-value"),
    "back": (lambda s: "59.0" + s[s.index(",") :], "input-order"),
    "no time": (lambda s: s[s.index(",") :], "table-empty"),
    "time nan": (lambda s: "nan" + s[s.index(",") :], "table-empty"),
}


def test_a_bad_line_soon_after_a_preamble_is_named(tmp_path):
    path = long_csv(tmp_path / "run.csv", lambda s: s.replace("0.25", "broken"), 5, 9)
    with refused("input-kind", error=FileError, name="accel_y"):
        list(open_run(saved(path, "# run 3\n\n" + path.read_text())).blocks())


def test_a_row_that_may_be_a_comment_is_refused_in_every_block(tmp_path):
    """Two blocks of a megabyte: the second one is read by columns, where a # would be text of the first of them."""
    rows = [f"{0.001 * k:.6f},9.81,0.25,-1.5" for k in range(80_000)]
    rows[60_000] = "#" + rows[60_000]
    (tmp_path / "run.csv").write_text("note,time_s,accel_x,accel_y,accel_z\n" + "".join(f"{r[:1]},{r}\n" for r in rows))
    with refused("table-comment", error=FileError) as caught:
        list(open_run(tmp_path / "run.csv").blocks())
    assert caught.value.line == 60_002


@pytest.mark.long
@pytest.mark.parametrize("case", SPOILT)
def test_a_bad_line_is_named(tmp_path, case):
    spoil, message = SPOILT[case]
    with refused(message, error=FileError):
        list(open_run(long_csv(tmp_path / "run.csv", spoil)).blocks())


@pytest.mark.long
def test_a_missing_reading_far_down_is_nan(tmp_path):
    for text in ("", "nan", "-NaN "):
        path = long_csv(tmp_path / "run.csv", lambda s, text=text: s.replace("0.25", text))
        _, channels = read(path)
        assert np.isnan(channels[59_998, 1])
        assert np.isnan(channels).sum() == 1


def test_a_bad_row_of_parquet_is_named(tmp_path):
    data = samples(70_000)
    for name, value, message in (
        ("mag_y", np.inf, "input-finite"),
        ("time_s", 0.0, "input-order"),
        ("time_s", np.nan, "table-empty"),
    ):
        spoilt = {name: values.copy() for name, values in data.items()}
        spoilt[name][66_000] = value
        write(tmp_path / "run.parquet", spoilt)
        with refused(message, error=FileError):
            list(open_run(tmp_path / "run.parquet").blocks())


HEADERS = {
    "accel_x,accel_y,accel_z": "column 'time_s' is missing",
    "time,accel_x,accel_y,accel_z": "unit missing: write time_s",
    "time_s,temperature_degC": "no channels",
}


@pytest.mark.parametrize("header", HEADERS)
def test_a_header_that_cannot_be_used(tmp_path, header):
    with refused("file-column", "table-unit-missing", error=FileError):
        open_run(saved(tmp_path / "run.csv", header + "\n1,2,3,4\n" if header else ""))


def parquet(path, units, names=("time_s", "gyro_x", "gyro_y", "gyro_z"), kind=None):
    kind = kind or pa.float64()
    fields = [pa.field(n, kind, metadata={"unit": u} if u else None) for n, u in zip(names, units, strict=True)]
    pq.write_table(pa.Table.from_arrays([pa.array([1], kind)] * len(names), schema=pa.schema(fields)), path)
    return path


def test_units_in_the_metadata_of_parquet(tmp_path):
    assert open_run(parquet(tmp_path / "a.parquet", ["s", "°/s", "deg/s", "deg_s"])).units == {"gyro": "deg/s"}
    named = ("time_s", "gyro_x_deg_h", "gyro_y_deg_h", "gyro_z_deg_h")
    assert open_run(parquet(tmp_path / "b.parquet", ["s", "deg/h", "", "deg/h"], named)).units == {"gyro": "deg/h"}
    with refused("table-units", error=FileError):
        open_run(parquet(tmp_path / "c.parquet", ["s", "rad/s", "", ""], named))
    with refused("table-units", error=FileError):
        open_run(parquet(tmp_path / "d.parquet", ["ms", "", "", ""]))
    with refused("table-unit", error=FileError):
        open_run(parquet(tmp_path / "e.parquet", ["s", "parsec", "", ""]))


def test_parquet_that_cannot_be_used(tmp_path):
    with refused("file-format", error=FileError):
        open_run(saved(tmp_path / "text.parquet", "time_s,mag_x\n"))
    with refused("file-absent", error=FileError):
        open_run(tmp_path / "none.parquet")
    names = ("time_s", "gyro_x", "gyro_y", "gyro_z")
    values = [pa.array([1.0]), *[pa.array([True])] * 3]
    pq.write_table(pa.Table.from_arrays(values, names=list(names)), tmp_path / "b.parquet")
    with refused("input-kind", error=FileError, name="gyro_x"):
        list(open_run(tmp_path / "b.parquet").blocks())
    with writing(tmp_path / "empty.parquet", COLUMNS):
        pass
    with refused("file-empty", error=FileError):
        list(open_run(tmp_path / "empty.parquet").blocks())
    with refused("file-empty", error=FileError):
        list(open_run(saved(tmp_path / "empty.csv", HEADER + "\n")).blocks())


def test_nothing_is_left_of_a_write_that_fails(tmp_path):
    def interrupted():
        with writing(tmp_path / "run.parquet", COLUMNS) as append:
            append(samples(1000))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert not list(tmp_path.iterdir())
    with refused("file-ending", error=FileError), writing("run.txt", COLUMNS):
        pass


def test_one_large_row_group_is_read_in_little_memory(tmp_path):
    """Python's own allocations while a row group of 24 MB passes through: a few blocks, whatever the file's length."""
    count = 600_000
    table = pa.table(samples(count))
    pq.write_table(table, tmp_path / "run.parquet", row_group_size=count)
    run = open_run(tmp_path / "run.parquet")
    tracemalloc.start()
    total = sum(len(block.time) for block in run.blocks(20_000))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert total == count
    assert peak < 30e6  # a batch of 65536 rows in float64 is 5 MB; three times that is held while blocks are cut


def test_temperatures_that_no_sensor_has_and_rows_of_comments_only(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time_s,mag_x,mag_y,temperature_degC\n# begin\n\n0,1,2,20\n1,2,3,401\n")
    with refused("input-value", error=FileError, name="temperature_degC") as caught:
        list(open_run(path).blocks())
    assert caught.value.line == 5
    (block,) = open_run(saved(path, "time_s,mag_x,mag_y,temperature_degC\n0,1,2,-100\n1,2,3,400\n2,2,3,\n")).blocks()
    np.testing.assert_array_equal(block.temperature, [-100.0, 400.0, np.nan])
    with refused("file-empty", error=FileError):
        list(open_run(saved(path, "time_s,mag_x,mag_y\n# nothing\n\n# more\n")).blocks())


def test_blocks_of_any_size_hold_all_rows_once(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time_s,mag_x,mag_y\n" + "".join(f"{k},{k + 1},{k * k}\n" for k in range(10)))
    for size, lengths in ((3, [3, 3, 3, 1]), (5, [5, 5]), (10, [10]), (11, [10])):
        blocks = list(open_run(path).blocks(size))
        assert [len(block.time) for block in blocks] == lengths
        assert np.concatenate([block.time for block in blocks]).tolist() == list(range(10))
        assert np.concatenate([block.channels["magnetometer"] for block in blocks])[-1].tolist() == [10.0, 81.0]


def test_a_run_is_shown_copied_and_its_progress_told(tmp_path):
    names = [f"{k}_{a}" for k in ("accel", "mag", "gyro") for a in "xyz"]
    for ending in ("csv", "parquet"):
        path = tmp_path / f"run.{ending}"
        write(path, samples(40_000))
        told = []
        run = open_run(path, progress=told.append)
        assert repr(run) == f"RunFile: {path}; {', '.join(names)}"
        copied = pickle.loads(pickle.dumps(run))
        assert sum(len(block.time) for block in run.blocks()) == 40_000
        # the rows of the copy are its own
        assert sum(len(block.time) for block in copied.blocks()) == 40_000
        assert told == sorted(told)
        assert told[-1] == path.stat().st_size
        assert len(told) > 1
