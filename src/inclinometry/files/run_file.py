"""A run of a moving tool, of any length: `time_s`, the channels, `temperature_degC`, read block by block."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, BinaryIO, Final, NamedTuple, Protocol

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.readings import LARGEST
from inclinometry.digest import digest_file
from inclinometry.errors import FileError
from inclinometry.files.columns import LOG, UNIT_LABELS, channel, numbers_among
from inclinometry.files.parquet import _units
from inclinometry.files.profile import PLAIN, current
from inclinometry.files.signals import COLDEST, HOTTEST, read_signals
from inclinometry.files.table import ArrowNumbers, Block, LineReader, Progress, Table, _Body, _header_row, log_columns
from inclinometry.files.writing import replacing

# What the columns of a run mean, and whether their values can be: shared by all formats of a run.

_SPELLED: Final = {
    **{label.lower(): label for label in UNIT_LABELS.values()},
    **{key.lower(): label for key, label in UNIT_LABELS.items()},
    "m/s2": "m/s^2", "m/s²": "m/s^2", "µt": "uT", "°/s": "deg/s", "°/h": "deg/h",
}  # fmt: skip


class RunHeader(NamedTuple):
    """The columns of a run that are read.

    names : kind -> columns as the file names them.
    units : kind -> unit label.
    temperature : whether there is a temperature.
    notes : what a person should know.
    """

    names: Mapping[str, tuple[str, ...]]
    units: Mapping[str, str]
    temperature: bool
    notes: tuple[str, ...]

    @property
    def wanted(self) -> tuple[str, ...]:
        """Every column that is read, time first."""
        names = [name for kind in self.names.values() for name in kind]
        return ("time_s", *names, *(["temperature_degC"] if self.temperature else []))


def run_header(path: Path, header: Sequence[str], line: int, stated: Mapping[str, str] | None = None) -> RunHeader:
    """The columns of a run by their names, in a `line` (0: no text file), and by the units `stated` apart from them.

    Raises
    ------
    FileError
        As `open_run`.
    """
    named = {_with_unit(path, name, (stated or {}).get(name)): name for name in header}
    empty = np.empty(0)
    table = Table(
        path,
        tuple(named),
        MappingProxyType(dict.fromkeys(named, empty)),
        np.empty(0, dtype=np.int64),
        line,
        "",
    )
    unused = [f"column {name!r} is not known and was not used" for name in table.unknown(LOG)]
    try:
        table.require(["time_s"])
        signals = read_signals(table)
    except FileError as error:
        if line:
            raise
        raise FileError(error.problem, path=path) from None
    unused += [f"column {c.name!r} was not used" for c in map(channel, table.header) if c is not None and c.sd]
    names = {kind: tuple(named[name] for name in found) for kind, found in signals.names.items()}
    return RunHeader(
        MappingProxyType(names),
        MappingProxyType(signals.units),
        "temperature_degC" in table,
        tuple(unused),
    )


def _with_unit(path: Path, name: str, stated: str | None) -> str:
    """A column's name with the unit stated apart from it; FileError where the two contradict each other."""
    found = channel(name)
    plain_units = {"time_s": ("s", "seconds"), "temperature_degC": ("degc", "°c", "celsius", "deg c")}
    if not stated or (found is None and name not in plain_units):
        return name
    if found is None:
        if stated.strip().lower() not in plain_units[name]:
            raise FileError(f"column {name!r} has the unit {stated!r}, which its name contradicts", path=path)
        return name
    label = _SPELLED.get(stated.strip().lower())
    if label is None:
        known = ", ".join(UNIT_LABELS.values())
        raise FileError(f"column {name!r} has the unit {stated!r}, which is not known; use {known}", path=path)
    own = next((key for key, value in UNIT_LABELS.items() if value == found.unit and name.endswith(f"_{key}")), None)
    if own is not None:
        if found.unit != label:
            raise FileError(f"column {name!r} has the unit {stated!r}, which its name contradicts", path=path)
        return name
    key = next(key for key, value in UNIT_LABELS.items() if value == label)
    return f"{name}_{key}"


class Problem(NamedTuple):
    """A value that cannot be used: index of its row, what is wrong."""

    row: int
    text: str


class RunCheck:
    """Finds the first value that cannot be used, piece by piece of a run.

    Examples
    --------
    >>> check = RunCheck()
    >>> check.accept({"time_s": np.array([0.0, 1.0])})
    >>> check.problem({"time_s": np.array([1.0, 0.5])}).row
    1
    """

    def __init__(self) -> None:
        self._last = -np.inf

    def problem(self, columns: Mapping[str, Array]) -> Problem | None:
        """The first row with a time that is missing or goes back, or a value no sensor reports; None if all is well."""
        found = [_of_column(name, values) for name, values in columns.items()]
        found.append(self._backward(columns["time_s"]))
        return min((problem for problem in found if problem is not None), default=None)

    def accept(self, columns: Mapping[str, Array]) -> None:
        """The piece was well: the next one follows it."""
        if columns["time_s"].size:
            self._last = float(columns["time_s"][-1])

    def _backward(self, time: Array) -> Problem | None:
        before = np.concatenate([[self._last], time[:-1]])
        back = time < before
        if not back.any():
            return None
        row = int(np.argmax(back))
        return Problem(
            row,
            f"time_s {time[row]:.12g} is less than {before[row]:.12g} before it; time must not run backwards: sort the "
            "rows, or cut the run where the clock was set",
        )


def _of_column(name: str, values: Array) -> Problem | None:
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
    value = values[row]
    if np.isnan(value):
        return Problem(row, f"column {name!r} is empty; every row needs its time: fill it in or remove the row")
    if np.isinf(value):
        return Problem(row, f"column {name!r} is {value}; a value must be finite: correct it or leave it empty")
    doubt = ": is it in another unit?" if name == "temperature_degC" else ": correct it or leave it empty"
    return Problem(row, f"column {name!r} is {value:g}; allowed {low:g} to {high:g}{doubt}")


# A run as CSV: plain blocks of numbers are converted by Arrow, everything else line by line, as any other table.


class CsvRun:
    """A CSV file from its header on; see `run_file.Source`."""

    def __init__(self, path: Path, progress: Progress | None) -> None:
        self._profile = current()
        self._reader = LineReader(path, progress, self._profile, timed=True)
        self._blocks = self._reader.blocks()
        self._body, self._first = self._opened(path)
        names = self._body.names
        self.header: RunHeader = run_header(path, names, self._body.line)
        wanted = set(self.header.wanted)
        # columns that are not used may hold anything
        self._body.kinds = [(name, name in wanted, name in wanted) for name in names]
        self._body.parts = {name: [] for name in names if name in wanted}
        self._body.texts = {name: [] for name in names if name not in wanted}
        mark = re.escape(self._body.delimiter)
        self._nan = re.compile(rf"(^|{mark})[ \t]*[+-]?nan[ \t]*(?={mark}|$)", re.IGNORECASE)
        log_columns(self._body, "a run")
        self._pointed = False
        self._check = RunCheck()
        self._arrow: ArrowNumbers | None = None
        with suppress(ModuleNotFoundError):  # without Arrow, an extra, every block goes the careful way
            self._arrow = ArrowNumbers(names, self.header.wanted, self._body.delimiter)

    def _opened(self, path: Path) -> tuple[_Body, Block | None]:
        """The header, and what stands behind it in the same block."""
        for block in self._blocks:
            start = _header_row(block)
            if start is not None:
                known = numbers_among(LOG)
                body = _Body(path, block.lines[start], block.first + start, known, (), self._profile)
                return body, Block(block.first + start + 1, block.lines[start + 1 :], block.plain)
        raise FileError("the file is empty; a line of column names and rows of values are needed", path=path)

    def digest(self) -> str:
        """SHA-256 of what has been read: of the whole file once `columns` is exhausted."""
        return self._reader.digest

    def columns(self) -> Iterator[dict[str, Array]]:
        """Blocks of about a megabyte."""
        try:
            yield from self._pieces()
        except FileError as error:
            raise error.of_rows() if self._reader.rows else error from None

    def _pieces(self) -> Iterator[dict[str, Array]]:
        first, self._first = self._first, None
        if first is not None and first.lines:
            # the first block goes the careful way, which learns the decimal mark
            yield from self._careful(first)
        for block in self._blocks:
            # columns by Arrow; None where a block holds more than numbers with points, or the first points of the file,
            # as the careful way notes where they stand
            text = "\n".join(block.lines)
            if self._arrow is None or "#" in text or ("." in text and not self._pointed):
                quick = None
            else:
                found = self._arrow.convert(text)
                quick = None if found is None else self._scaled(found[0])
            if quick is None or self._check.problem(quick) is not None:
                yield from self._careful(block)
            elif len(quick["time_s"]):
                self._check.accept(quick)
                yield quick
        self._body.numbers.finish()

    def _scaled(self, columns: dict[str, Array]) -> dict[str, Array]:
        """In the units of the names, where a profile or the file's own name of a column has another."""
        turned = {name: (f, o) for name, f, o, _ in self._body.readings if (f, o) != (1.0, 0.0) and name in columns}
        return columns | {name: columns[name] * factor + offset for name, (factor, offset) in turned.items()}

    def _careful(self, block: Block) -> Iterator[dict[str, Array]]:
        lines = block.lines
        if any("nan" in line.lower() for line in lines):
            # twice: neighbours share the mark between them
            lines = [self._nan.sub(r"\1", self._nan.sub(r"\1", line)) for line in lines]
        self._pointed = self._pointed or any("." in line for line in lines)
        body = self._body
        body.add(Block(block.first, lines, block.plain))
        if not body.lines:
            return
        places = body.lines.pop()
        for cells in body.texts.values():
            cells.clear()
        columns = self._scaled({name: body.parts[name].pop() for name in self.header.wanted})
        problem = self._check.problem(columns)
        if problem is not None:
            raise FileError(problem.text, path=body.path, line=int(places[problem.row]))
        self._check.accept(columns)
        yield columns


# A run as Parquet, read in batches of rows so that no row group needs to fit into memory.

BATCH: Final = 1 << 15


class ParquetRun:
    """A Parquet file from its schema on; see `run_file.Source`."""

    def __init__(self, path: Path, progress: Progress | None) -> None:
        self._path, self._progress = path, progress
        with _opened(path) as file:
            schema = file.schema_arrow
            names = [field.name for field in schema]
            twice = next((name for place, name in enumerate(names) if name in names[:place]), None)
            if twice is not None:
                raise FileError(f"column {twice!r} appears twice; remove one", path=path)
            self.header: RunHeader = run_header(path, names, 0, _units(schema))
            _check_types(path, schema, self.header.wanted)
            self._rows = int(file.metadata.num_rows)

    def digest(self) -> str:
        """SHA-256 of the file."""
        try:
            return digest_file(self._path)
        except FileError as error:
            reason = f"it was there when it was opened ({error.problem}); leave it in place while it is read"
            raise FileError(f"cannot be read again: {reason}", path=self._path) from None

    def columns(self) -> Iterator[dict[str, Array]]:
        """Batches of rows."""
        done, size, check = 0, self._path.stat().st_size, RunCheck()
        with _opened(self._path) as file:
            wanted = list(self.header.wanted)
            for batch in file.iter_batches(batch_size=BATCH, columns=wanted, use_threads=False):
                columns = {name: _numbers(batch.column(name)) for name in wanted}
                problem = check.problem(columns)
                if problem is not None:
                    raise FileError(f"row {done + problem.row + 1}: {problem.text}", path=self._path)
                check.accept(columns)
                yield columns
                done += batch.num_rows
                if self._progress is not None:
                    self._progress(size * done // max(self._rows, 1))


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """The file, and what is wrong with it in words."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    buffer = 1 << 20
    try:
        with path.open("rb") as stream:
            # buffered reading: a file of one large row group is not read at once; no threads of its own
            yield pq.ParquetFile(stream, buffer_size=buffer, pre_buffer=False, page_checksum_verification=True)
    except FileNotFoundError:
        raise FileError("there is no such file; check the name", path=path) from None
    except (pa.ArrowException, OSError) as error:
        reason = getattr(error, "strerror", None) or (str(error).strip().splitlines() or ["no more is known"])[0]
        raise FileError(f"not a Parquet file, or a damaged one ({reason[:200]}); write it again", path=path) from None


def _check_types(path: Path, schema: Any, wanted: tuple[str, ...]) -> None:
    import pyarrow.types as types

    for name in wanted:
        kind = schema.field(name).type
        if not (types.is_floating(kind) or types.is_integer(kind) or types.is_decimal(kind) or types.is_null(kind)):
            raise FileError(f"column {name!r} is of type {kind}; numbers are needed: convert it", path=path)


def _numbers(values: Any) -> Array:
    """Float64, NaN for null."""
    return np.asarray(values.cast("float64").to_numpy(zero_copy_only=False), dtype=np.float64)


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


class Source(Protocol):
    """A file opened for reading from its first row."""

    header: RunHeader

    def columns(self) -> Iterator[dict[str, Array]]:
        """Pieces of the file, column -> (n,), checked."""
        ...

    def digest(self) -> str:
        """SHA-256 of the file, once `columns` is exhausted."""
        ...


@dataclass(frozen=True, eq=False, repr=False)
class RunFile:
    """A run whose header has been read and whose rows have not.

    path : where it is.
    header : which columns are read.
    """

    path: Path
    header: RunHeader
    _source: Source

    @property
    def names(self) -> Mapping[str, tuple[str, ...]]:
        """Kind -> its columns in the order x, y, z or 1 to m."""
        return self.header.names

    @property
    def units(self) -> Mapping[str, str]:
        """Kind -> unit label, "counts" where the columns state none."""
        return self.header.units

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should know about the columns."""
        return self.header.notes

    def blocks(self, rows: int = BLOCK) -> Iterator[RunBlock]:
        """The rows from the first to the last, `rows` at a time; once only.

        Raises
        ------
        FileError
            Naming line (CSV) or row (Parquet) and column: text in a number's place, a row of another length, an
            infinite or absurd value, a time that is missing; a file without rows.
        """
        held: list[dict[str, Array]] = []
        size = total = 0
        for piece in self._source.columns():
            held.append(piece)
            size += len(piece["time_s"])
            while size >= rows:
                whole = _joined(held)
                yield self._block({name: values[:rows] for name, values in whole.items()})
                held, size = [{name: values[rows:] for name, values in whole.items()}], size - rows
                total += rows
        if size:
            yield self._block(_joined(held))
        if not size + total:
            raise FileError("there are column names but no rows of values", path=self.path)

    def digest(self) -> str:
        """SHA-256 of the file; of a CSV only after `blocks` has been read to its end."""
        return self._source.digest()

    def __repr__(self) -> str:
        columns = [name for names in self.names.values() for name in names]
        return f"RunFile: {self.path}; {', '.join(columns)}"

    def __reduce__(self) -> tuple[Any, ...]:
        # a copy opens the file anew: rows are read once, and what reads them is of this process
        return open_run, (self.path,)

    def _block(self, columns: Mapping[str, Array]) -> RunBlock:
        channels = {kind: np.stack([columns[name] for name in names], axis=1) for kind, names in self.names.items()}
        return RunBlock(columns["time_s"], channels, columns.get("temperature_degC"))


def _joined(pieces: list[dict[str, Array]]) -> dict[str, Array]:
    if len(pieces) == 1:
        return pieces[0]
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}


def open_run(path: str | Path, *, progress: Progress | None = None) -> RunFile:
    """Open a run: Parquet where the name ends in .parquet, otherwise any table `read_table` takes.

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
    native = where.suffix.lower() == ".parquet" and current() == PLAIN
    source: Source = (ParquetRun if native else CsvRun)(where, progress)
    return RunFile(where, source.header, source)


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
    groups of `ROWS`. CSV where it ends in .csv: the shortest decimals that read back the same. NaN becomes null or an
    empty cell.

    Parameters
    ----------
    path : str or Path
    columns : sequence of OutField
    header : name -> text, optional
        Kept in the metadata of a Parquet file under `inclinometry.header`.

    Raises
    ------
    FileError
        Another ending, a folder that cannot be written, a full disk.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     where = Path(folder, "run.csv")
    ...     with writing(where, [OutField("time_s", "s", True), OutField("mag_x", "nT")]) as write:
    ...         write({"time_s": np.array([0.0, 0.5]), "mag_x": np.array([48000.1, np.nan])})
    ...     where.read_text()
    'time_s,mag_x\\n0,48000.1\\n0.5,\\n'
    """
    ending = checked_ending(path)
    form = _parquet if ending == ".parquet" else _csv
    with replacing(path) as stream, form(stream, _schema(columns, header or {})) as append:
        held = _Held(columns, append)
        yield held.add
        held.flush()


def checked_ending(path: str | Path) -> str:
    """The ending of a table's name; FileError where it is not one that can be written."""
    ending = Path(path).suffix.lower()
    endings = (".parquet", ".csv")
    if ending not in endings:
        raise FileError(f"the name ends in {ending or 'nothing'!r}; allowed: {', '.join(endings)}", path=path)
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
    """Collects rows until there are enough for a row group, so that files do not depend on the blocks they came in."""

    def __init__(self, columns: Sequence[OutField], append: Callable[[dict[str, Any]], None]) -> None:
        self._kinds = {c.name: np.float64 if c.double else np.float32 for c in columns}
        self._append = append
        self._parts: list[dict[str, Any]] = []
        self._size = 0

    def add(self, block: Mapping[str, Array]) -> None:
        part = {name: np.asarray(block[name], dtype=kind) for name, kind in self._kinds.items()}
        self._parts.append(part)
        self._size += len(next(iter(part.values())))
        while self._size >= ROWS:
            whole = self._whole()
            self._append({name: values[:ROWS] for name, values in whole.items()})
            self._parts = [{name: values[ROWS:] for name, values in whole.items()}]
            self._size -= ROWS

    def flush(self) -> None:
        if self._size:
            self._append(self._whole())

    def _whole(self) -> dict[str, Any]:
        if len(self._parts) == 1:
            return self._parts[0]
        return {name: np.concatenate([part[name] for part in self._parts]) for name in self._kinds}


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
