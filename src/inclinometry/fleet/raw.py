"""The counts of all runs, written once: files by tool, run and date, and a catalogue of them."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.digest import digest_file
from inclinometry.errors import FileError, InputError
from inclinometry.files.run_file import RunFile, open_run
from inclinometry.fleet.store import Store, folder_name

CATALOGUE: Final = "raw/_catalogue"
MOST_ROWS: Final = 1 << 26
"""Of a file; a longer run is several files."""
ROW_GROUP: Final = 1 << 20
_EXACT: Final = 1 << 24  # counts below are whole numbers of float32, which can say that a sample is missing
_EPOCH: Final = 1e8  # s; a time beyond is counted from 1970, one below from the start of the run


class Raw(NamedTuple):
    """A file of counts as the catalogue knows it.

    name : in the store. digest : SHA-256 of its bytes. size : bytes. mtime_ns : its last change when it was written.
    rows : samples. first_ns, last_ns : time of the first and the last; from 1970 where `absolute`.
    units : kind of triad -> (unit, number of sensors). temperature : whether it has one.
    source, source_digest : the file it was read from.
    gaps : steps of the clock of more than ten usual ones.
    """

    name: str
    tool: str
    run: str
    date: str
    digest: str
    size: int
    mtime_ns: int
    rows: int
    first_ns: int
    last_ns: int
    absolute: bool
    units: Mapping[str, tuple[str, int]]
    temperature: bool
    source: str
    source_digest: str
    gaps: int

    @property
    def partition(self) -> tuple[str, str, str]:
        """Tool, run, date."""
        return self.tool, self.run, self.date


def catalogue(store: Store) -> list[Raw]:
    """All files of counts, in the order of their names.

    Raises
    ------
    InputError
        There is no fleet at this address.
    """
    from deltalake import DeltaTable
    from deltalake.exceptions import TableNotFoundError

    try:
        table = DeltaTable(store.uri(CATALOGUE))
    except TableNotFoundError:
        raise InputError(f"{store.address}: there is no fleet here; `inclinometry fleet add` begins one") from None
    except OSError as error:
        raise InputError(f"{store.uri(CATALOGUE)} cannot be read ({str(error)[:300]})") from None
    columns = table.to_pyarrow_table().select(Raw._fields).to_pydict()
    # a few sets of channels in thousands of files
    units = {text: {kind: (unit, count) for kind, unit, count in json.loads(text)} for text in set(columns["units"])}
    columns["units"] = [units[text] for text in columns["units"]]
    found = [Raw(*row) for row in zip(*columns.values(), strict=True)]
    return sorted({raw.name: raw for raw in found}.values(), key=lambda raw: raw.name)


def record(store: Store, added: Sequence[Raw]) -> None:
    """Enter files into the catalogue, in one transaction."""
    import pyarrow as pa
    from deltalake import write_deltalake

    kinds = {"size": pa.int64(), "mtime_ns": pa.int64(), "rows": pa.int64(), "first_ns": pa.int64()}
    kinds |= {"last_ns": pa.int64(), "absolute": pa.bool_(), "temperature": pa.bool_(), "gaps": pa.int64()}
    schema = pa.schema([pa.field(name, kinds.get(name, pa.string())) for name in Raw._fields])
    rows = [raw._asdict() | {"units": json.dumps([[kind, *pair] for kind, pair in raw.units.items()])} for raw in added]
    if rows:
        write_deltalake(store.uri(CATALOGUE), pa.Table.from_pylist(rows, schema=schema), mode="append")


class About(NamedTuple):
    """What a run is of; `date` is the day it was made."""

    tool: str
    run: str
    date: date


def about(path: Path, pattern: str | None, tool: str | None, run: str | None, day: str | None) -> About:
    """What a file is of: what is stated, else what the pattern finds in its path; the name of the file is its run.

    Examples
    --------
    >>> about(Path("runs/IN-7/R3_2026-03-04.parquet"), "{tool}/{run}_{date}", None, None, None)
    About(tool='IN-7', run='R3', date=datetime.date(2026, 3, 4))
    """
    found: dict[str, str] = {}
    if pattern is not None:
        parts = re.split(r"\{(tool|run|date)\}", pattern)
        if len(parts) == 1:
            raise InputError(f"--pattern is {pattern!r}; it must hold {{tool}}, {{run}} or {{date}}")
        text = "".join(re.escape(p) if k % 2 == 0 else f"(?P<{p}>[^/]+?)" for k, p in enumerate(parts))
        stem = path.as_posix().removesuffix("".join(path.suffixes[-2:] if path.suffix == ".gz" else path.suffixes[-1:]))
        match = re.search(rf"(?:^|/){text}$", stem)
        if match is None:
            raise FileError(f"the pattern {pattern!r} does not fit its path {stem!r}", path=path)
        found = match.groupdict()
    serial, name = tool or found.get("tool"), run or found.get("run") or path.name.partition(".")[0]
    if not serial:
        raise FileError("it is not said which tool made it; give --tool, or --pattern with {tool}", path=path)
    when = day or found.get("date")
    if when is None:
        raise FileError("it is not said when it was made; give --date, or --pattern with {date}", path=path)
    try:
        return About(serial, name, date.fromisoformat(when))
    except ValueError:
        raise FileError(f"the date is {when!r}; write YYYY-MM-DD", path=path) from None


def add(
    store: Store, path: Path, what: About, known: Mapping[str, Raw], progress: Callable[[int], None] | None = None
) -> list[Raw]:
    """Write a run into the data set; what is to be entered into the catalogue, nothing where it is there already.

    Counts stay counts: int32 where every value is a whole number, else float32. Values that are missing are NaN. A file
    is named by its digest, so that adding it twice adds nothing.

    Parameters
    ----------
    known : name of each file in the catalogue -> its entry

    Raises
    ------
    FileError
        As `files.run_file.open_run`; no accelerometer and magnetometer; a clock that runs back, stands still or is set;
        other counts of the same run at the same time.
    InputError
        The store cannot be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    run = open_run(path, progress=progress)
    for kind in ("accelerometer", "magnetometer"):
        if kind not in run.names:
            raise FileError(f"it has no {kind}; a fleet's runs have accelerometers and magnetometers", path=path)
    units = {kind: (run.units[kind], len(names)) for kind, names in run.names.items()}
    whole = _whole(run, path)
    run = open_run(path)
    names = {kind: channel_names(kind, count) for kind, (_, count) in units.items()}
    kind_of = pa.int32() if whole else pa.float32()
    fields = [pa.field("time_ns", pa.int64(), nullable=False)]
    fields += [pa.field(name, kind_of, nullable=False) for found in names.values() for name in found]
    if run.header.temperature:
        fields.append(pa.field("temperature_degC", pa.float32(), nullable=False))
    metadata = {"inclinometry.tool": what.tool, "inclinometry.run": what.run, "inclinometry.date": str(what.date)}
    metadata["inclinometry.units"] = json.dumps({kind: unit for kind, (unit, _) in units.items()})
    schema = pa.schema(fields, metadata=metadata)
    folder = "/".join(
        ["raw", f"tool={folder_name(what.tool)}", f"run={folder_name(what.run)}", f"date={what.date.isoformat()}"]
    )
    origin = int(datetime(what.date.year, what.date.month, what.date.day, tzinfo=UTC).timestamp()) * 1_000_000_000
    added: list[Raw] = []
    for blocks in _parts(run):
        with store.staged(folder) as (scratch, publish):
            state = _State()
            with pq.ParquetWriter(scratch, schema, **encoding(schema)) as writer:
                held: list[Any] = []
                rows = 0
                for block in blocks:
                    time = state.times(block.time, origin, path)
                    columns = [time]
                    for kind, found in names.items():
                        columns += [block.channels[kind][:, place] for place in range(len(found))]
                    if run.header.temperature:
                        columns.append(block.temperature)
                    held.append(
                        [
                            np.ascontiguousarray(c, f.type.to_pandas_dtype())
                            for c, f in zip(columns, schema, strict=True)
                        ]
                    )
                    rows += len(time)
                    if rows >= ROW_GROUP:
                        rows, held = 0, _written(writer, held, schema)
                if held:
                    _written(writer, held, schema)
            if state.first == state.last and state.rows > 1:
                raise FileError(f"its clock stands still: {state.rows} rows have the same time", path=path)
            digest = digest_file(scratch)
            name = f"{folder}/part-{digest.removeprefix('sha256:')[:20]}.parquet"
            if name in known:
                continue
            _new(what, state, known, path)
            size = scratch.stat().st_size
            publish(name)
        stamp = store.stamp(name)
        added.append(
            Raw(
                name, what.tool, what.run, what.date.isoformat(), digest, size, 0 if stamp is None else stamp[1],
                state.rows, state.first, state.last, state.absolute, units, run.header.temperature,
                str(path), "", state.gaps,
            )
        )  # fmt: skip
    source = run.digest()
    return [raw._replace(source_digest=source) for raw in added]


def channel_names(kind: str, count: int) -> tuple[str, ...]:
    """Columns of a triad: accel_x, accel_y, accel_z, or accel_1 to accel_m.

    Examples
    --------
    >>> channel_names("magnetometer", 3), channel_names("gyro", 1)
    (('mag_x', 'mag_y', 'mag_z'), ('gyro_x',))
    """
    from inclinometry.constants import KIND_PREFIX
    from inclinometry.tabular import axes

    return tuple(f"{KIND_PREFIX[kind]}_{axis}" for axis in axes(count))


def encoding(schema: Any) -> dict[str, Any]:
    """How every Parquet file of a fleet is written: byte streams split, LZ4, page checksums, no dictionaries."""
    columns = {f.name: "BYTE_STREAM_SPLIT" for f in schema if f.name not in ("time_ns", "samples")}
    # a regular clock takes next to nothing as differences
    columns |= {f.name: "DELTA_BINARY_PACKED" for f in schema if f.name in ("time_ns", "samples")}
    return {
        "compression": "lz4",
        "use_dictionary": False,
        "column_encoding": columns,
        "write_page_checksum": True,
        "store_schema": True,
    }


def _whole(run: RunFile, path: Path) -> bool:
    """Whether every signal is a whole number that an int32 holds; reads the file once."""
    whole = True
    for block in run.blocks(1 << 16):
        for kind, values in block.channels.items():
            missing = np.isnan(values)
            if whole:
                whole = not missing.any() and bool((values == np.rint(values)).all() and np.abs(values).max() < 2**31)
            if missing.any() and run.units[kind] == "counts" and np.nanmax(np.abs(values), initial=0.0) >= _EXACT:
                raise FileError(
                    f"samples are missing and counts go beyond {_EXACT}, more than a float32 keeps; cut the gap out",
                    path=path,
                )
    return whole


def _new(what: About, state: _State, known: Mapping[str, Raw], path: Path) -> None:
    """Refuse other counts of the same run at the same time."""
    for one in known.values():
        same = one.partition == (what.tool, what.run, what.date.isoformat())
        if same and state.first <= one.last_ns and one.first_ns <= state.last:
            raise FileError(
                f"run {what.run!r} of tool {what.tool!r} has these minutes already, of {one.source}; if it is another "
                "run, give it another name (--run)",
                path=path,
            )


class _State:
    """The clock of a part as it goes on."""

    def __init__(self) -> None:
        self.rows = self.first = self.last = self.gaps = 0
        self.absolute = False
        self._usual = 0

    def times(self, seconds: Array, origin: int, path: Path) -> Any:
        """Times of a block in ns; FileError where the clock runs back."""
        self.absolute = bool(seconds[0] > _EPOCH) if not self.rows else self.absolute
        if not self.absolute and seconds[-1] > _EPOCH:
            row = self.rows + int(np.argmax(seconds > _EPOCH)) + 1
            raise FileError(f"row {row}: the clock was set to the time of day; cut the run there", path=path)
        # whole and broken seconds apart: a double holds the ns of neither century nor run in one
        full = np.floor(seconds)
        time = full.astype(np.int64) * 1_000_000_000 + np.rint((seconds - full) * 1e9).astype(np.int64)
        time = time if self.absolute else time + origin
        steps = np.diff(time, prepend=self.last if self.rows else time[0])
        if not self._usual:
            self._usual = int(np.median(steps[1:])) if len(steps) > 1 else 0
        self.gaps += int((steps > 10 * self._usual).sum()) if self._usual else 0
        self.first = self.first if self.rows else int(time[0])
        self.rows, self.last = self.rows + len(time), int(time[-1])
        return time


def _written(writer: Any, held: list[Any], schema: Any) -> list[Any]:
    import pyarrow as pa

    columns = [np.concatenate(parts) if len(parts) > 1 else parts[0] for parts in zip(*held, strict=True)]
    writer.write_table(pa.Table.from_arrays([pa.array(c) for c in columns], schema=schema), row_group_size=ROW_GROUP)
    return []


def _parts(run: RunFile) -> Iterator[Iterator[Any]]:
    """The blocks of a run, those of one file at a time."""
    blocks = run.blocks(1 << 16)
    first = next(blocks, None)
    while first is not None:
        part = _Part(blocks, first)
        yield iter(part)
        first = part.next


class _Part:
    def __init__(self, blocks: Iterator[Any], first: Any) -> None:
        self._blocks, self.next = blocks, first

    def __iter__(self) -> Iterator[Any]:
        rows = 0
        while self.next is not None and rows < MOST_ROWS:
            block, self.next = self.next, next(self._blocks, None)
            rows += len(block.time)
            yield block
