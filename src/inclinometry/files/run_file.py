"""A run of a moving tool, of any length: `time_s`, the channels, `temperature_degC`, read block by block."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, BinaryIO, Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.readings import LARGEST
from inclinometry.errors import FileError, out_of_order
from inclinometry.files.columns import LOG, channel, numbers_among
from inclinometry.files.frame import Frame, row_error, unused
from inclinometry.files.parquet import parquet_pieces
from inclinometry.files.signals import COLDEST, HOTTEST, read_signals
from inclinometry.files.table import TableFile
from inclinometry.files.text import Progress
from inclinometry.files.writing import joined, replacing
from inclinometry.findings import Finding


def _backward(time: Array, last: float) -> tuple[int, Finding] | None:
    before = np.concatenate([[last], time[:-1]])
    back = time < before
    if not back.any():
        return None
    row = int(np.argmax(back))
    return row, out_of_order("time_s", float(time[row]), float(before[row]), row + 1).finding


def _of_column(name: str, values: Array) -> tuple[int, Finding] | None:
    if name == "temperature_degC":
        low, high = COLDEST, HOTTEST
    else:
        low, high = -LARGEST, LARGEST
    bad = (values < low) | (values > high)
    if name == "time_s":
        bad |= np.isnan(values)
    if not bad.any():
        return None
    row = int(np.argmax(bad))
    value = float(values[row])
    if np.isnan(value):
        return row, Finding("table-empty", {"column": name})
    if np.isinf(value):
        return row, Finding("input-finite", {"name": name})
    return row, Finding("input-value", {"name": name, "value": value, "allowed": f"{low:g} .. {high:g}"})


BLOCK: Final = 1 << 15
"""Rows of a block: large enough for compiled loops, small enough for any memory."""


class RunBlock(NamedTuple):
    """Consecutive rows of a run as they stand in the file; NaN where a value is missing.

    time : (n,) s, finite, in whatever order the file has.
    channels : kind -> (n, m) signals in the unit of the file.
    temperature : (n,) degC, or None.
    """

    time: Array
    channels: Mapping[str, Array]
    temperature: Array | None


@dataclass(frozen=True, eq=False, repr=False)
class RunFile:
    """A run whose header has been read and whose rows have not.

    names : kind -> its columns, x, y, z or 1 to m. units : kind -> unit label, "counts" where the columns state none.
    findings : columns that are not read. wanted : every column that is read, time first.
    """

    path: Path
    names: Mapping[str, tuple[str, ...]]
    units: Mapping[str, str]
    findings: tuple[Finding, ...]
    wanted: tuple[str, ...]
    _table: TableFile

    def blocks(self, rows: int = BLOCK) -> Iterator[RunBlock]:
        """The rows from the first to the last, `rows` at a time; once only."""
        ready: list[dict[str, Array]] = []
        held = _Held(rows, ready.append)
        empty = True
        for piece in self._pieces():
            held.add(piece)
            empty = empty and not len(piece["time_s"])
            while ready:
                yield self._block(ready.pop(0))
        held.flush()
        yield from map(self._block, ready)
        if empty:
            raise FileError(Finding("file-empty", {"what": "rows"}), path=self.path)

    def _pieces(self) -> Iterator[dict[str, Array]]:
        """Column -> (n,) piece by piece; FileError for a value that no sensor reports and a time that goes back."""
        table, wanted, last = self._table, self.wanted, -np.inf
        for lines, found, _ in table.pieces(wanted, wanted, texts=False, nan=True):
            scaled = table.scaled(found)
            columns = {name: scaled[name] for name in wanted}
            problems = [_of_column(name, values) for name, values in columns.items()]
            problems.append(_backward(columns["time_s"], last))
            first = min(filter(None, problems), key=lambda problem: problem[0], default=None)
            if first is not None:
                raise row_error(table.path, first[1], int(lines[first[0]]), table.word)
            last = float(columns["time_s"][-1])
            yield columns

    def digest(self) -> str:
        """SHA-256 of the file, after `blocks` has been read to its end."""
        return self._table.digest

    def __repr__(self) -> str:
        columns = [name for names in self.names.values() for name in names]
        return f"RunFile: {self.path}; {', '.join(columns)}"

    def __reduce__(self) -> tuple[Any, ...]:
        # a copy opens the file again: rows are read once, and what reads them is of this process
        return open_run, (self.path,)

    def _block(self, columns: Mapping[str, Array]) -> RunBlock:
        channels = {kind: np.stack([columns[name] for name in names], axis=1) for kind, names in self.names.items()}
        return RunBlock(columns["time_s"], channels, columns.get("temperature_degC"))


def open_run(path: str | Path, *, progress: Progress | None = None) -> RunFile:
    """Open a run: any table `read_table` takes, Parquet where the name ends in .parquet.

    Columns are `time_s`, `accel_x` .. `accel_z` or `accel_1` .. `accel_m`, likewise `mag` and `gyro`, perhaps with a
    unit (`accel_x_g`), and `temperature_degC`. An empty cell, `nan` or null is a missing value, except in `time_s`.

    Parameters
    ----------
    path : str or Path
    progress : callable, optional
        Called with the number of bytes read so far (of a Parquet file, the share of its rows in bytes).

    Raises
    ------
    FileError
        Not found, not a table; a column missing, named twice, nearly known, of a unit that is not known or that
        contradicts the others.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     where = Path(folder, "run.csv")
    ...     _ = where.write_text("time_s,mag_x_uT,mag_y_uT,mag_z_uT\\n0,20,0,45\\n0.01,20,,45\\n")
    ...     run = open_run(where)
    ...     blocks = list(run.blocks())
    >>> run.units["magnetometer"], blocks[0].channels["magnetometer"]
    ('uT', array([[20.,  0., 45.], [20., nan, 45.]]))
    """
    where = Path(path)
    read = parquet_pieces if where.suffix.lower() == ".parquet" else None
    table = TableFile(where, progress, timed=True, read=None if read is None else partial(read, progress=progress))
    names = table.take(numbers_among(LOG))
    nothing = np.empty(0, dtype=np.int64)
    frame = Frame(where, dict.fromkeys(names, np.empty(0)), nothing, table.line, word=table.word)
    unknown = frame.unknown(LOG)
    frame.require(["time_s"])
    signals = read_signals(frame)
    left = unused(c.name for c in map(channel, names) if c is not None and c.sd)
    channels = [name for kind in signals.names.values() for name in kind]
    wanted = ("time_s", *channels, *["temperature_degC"] * ("temperature_degC" in names))
    table.log("a run", wanted)
    kinds, units = MappingProxyType(signals.names), MappingProxyType(signals.units)
    return RunFile(where, kinds, units, (*unknown, *left), wanted, table)


# Long tables written block by block, whole or not at all: Parquet for anything long, CSV for the eye.

ROWS: Final = 1 << 18
"""Rows of a row group: a few megabytes a column, so that readers need little memory."""


class OutField(NamedTuple):
    """A column of numbers to be written: its unit goes into the metadata; `double` where float32 is too coarse."""

    name: str
    unit: str
    double: bool = False


Write = Callable[[Mapping[str, Array]], None]


@contextmanager
def writing(path: str | Path, columns: Sequence[OutField], header: Mapping[str, str] | None = None) -> Iterator[Write]:
    """A function that appends rows to a table; the file appears when the block ends without an exception.

    Parquet where the name ends in .parquet: float32 (float64 where asked), zstd, byte stream split, page checksums, row
    groups of `ROWS`, `header` in its metadata under `inclinometry.header`. CSV where it ends in .csv: the shortest
    decimals that read back the same. NaN becomes null or an empty cell.
    """
    ending = checked_ending(path)
    form = _parquet if ending == ".parquet" else _csv
    with replacing(path) as stream, form(stream, _schema(columns, header or {})) as append:
        held = _Held(ROWS, append)
        kinds = {c.name: np.float64 if c.double else np.float32 for c in columns}
        yield lambda block: held.add({name: np.asarray(block[name], dtype=kind) for name, kind in kinds.items()})
        held.flush()


def checked_ending(path: str | Path) -> str:
    """The ending of a table's name; FileError where it is not one that can be written."""
    ending = Path(path).suffix.lower()
    if ending not in (".parquet", ".csv"):
        wrong = Finding("file-ending", {"ending": ending or "''", "allowed": (".parquet", ".csv")})
        raise FileError(wrong, path=path)
    return ending


def _schema(columns: Sequence[OutField], header: Mapping[str, str]) -> Any:
    import json

    import pyarrow as pa

    fields = [
        pa.field(c.name, pa.float64() if c.double else pa.float32(), metadata={"unit": c.unit} if c.unit else None)
        for c in columns
    ]
    text = json.dumps(dict(header), ensure_ascii=False).encode()
    return pa.schema(fields, metadata={b"inclinometry.header": text})


class _Held:
    """Collects rows and passes them on `rows` at a time, so that nothing depends on the blocks they came in."""

    def __init__(self, rows: int, append: Callable[[dict[str, Any]], None]) -> None:
        self._rows, self._append = rows, append
        self._parts: list[dict[str, Any]] = []
        self._size = 0

    def add(self, part: dict[str, Any]) -> None:
        self._parts.append(part)
        self._size += len(next(iter(part.values())))
        while self._size >= self._rows:
            whole = joined(self._parts)
            self._append({name: values[: self._rows] for name, values in whole.items()})
            self._parts = [{name: values[self._rows :] for name, values in whole.items()}]
            self._size -= self._rows

    def flush(self) -> None:
        if self._size:
            self._append(joined(self._parts))


def _table(columns: dict[str, Any], schema: Any) -> Any:
    import pyarrow as pa

    arrays = [pa.array(columns[field.name], field.type, from_pandas=True) for field in schema]
    return pa.Table.from_arrays(arrays, schema=schema)


@contextmanager
def _parquet(stream: BinaryIO, schema: Any) -> Iterator[Callable[[dict[str, Any]], None]]:
    import pyarrow.parquet as pq

    names = [field.name for field in schema]
    with pq.ParquetWriter(
        stream, schema, compression="zstd", compression_level=1, use_dictionary=False, use_byte_stream_split=names,
        write_page_checksum=True,
    ) as writer:  # fmt: skip
        yield lambda columns: writer.write_table(_table(columns, schema), row_group_size=ROWS)


@contextmanager
def _csv(stream: BinaryIO, schema: Any) -> Iterator[Callable[[dict[str, Any]], None]]:
    import pyarrow.csv as pc

    options = pc.WriteOptions(include_header=False, quoting_style="none")
    stream.write((",".join(field.name for field in schema) + "\n").encode())
    yield lambda columns: pc.write_csv(_table(columns, schema), stream, options)
