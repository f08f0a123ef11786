"""The counts of all runs, written once: files by tool, run and date, and a catalogue of them."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, date, datetime
from itertools import chain
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.digest import digest_file
from inclinometry.errors import FileError, out_of_range, refused
from inclinometry.files.run_file import RunFile, open_run
from inclinometry.findings import Finding
from inclinometry.fleet import checksums
from inclinometry.fleet.store import Store, folder_name

CATALOGUE: Final = "raw/_catalogue"
MOST_ROWS: Final = 1 << 26
"""Of a file; a longer run is several files."""
ROW_GROUP: Final = 1 << 20
_EXACT: Final = 1 << 24  # counts below are whole numbers of float32, which can say that a sample is missing
_EPOCH: Final = 1e8  # s; a time beyond is counted from 1970, one below from the start of the run


class Raw(NamedTuple):
    """A file of counts as the catalogue knows it.

    digest : SHA-256 of the file. rows : samples. gaps : steps of the clock of more than ten usual ones.
    first_ns, last_ns : time of the first and last sample, from 1970 where `absolute`.
    units : kind of triad -> (unit, number of sensors).
    source, source_digest : the file it was read from.
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
    table, have = checksums.opened_table(store, CATALOGUE, _broken)
    if table is None:
        raise refused("fleet-absent", {"address": store.address})

    def read() -> list[Raw]:
        names = [f"{CATALOGUE}/{path}" for path in pa.table(table.get_add_actions()).column("path").to_pylist()]
        for name in checksums.damaged(store, CATALOGUE, have, names):
            raise FileError(_broken("SHA-256"), path=store.uri(name))
        columns = table.to_pyarrow_table().select(Raw._fields).to_pydict()
        # a few sets of channels in thousands of files
        units = {text: {kind: (unit, n) for kind, unit, n in json.loads(text)} for text in set(columns["units"])}
        columns["units"] = [units[text] for text in columns["units"]]
        return [Raw(*row) for row in zip(*columns.values(), strict=True)]

    import pyarrow as pa

    found = checksums.guarded(read, store.uri(CATALOGUE), _broken)
    return sorted({raw.name: raw for raw in found}.values(), key=lambda raw: raw.name)


def _broken(reason: str) -> Finding:
    return Finding("fleet-table", {"reason": reason, "folder": CATALOGUE, "again": "add"})


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
        checksums.record(store, CATALOGUE)


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
            raise out_of_range("--pattern", pattern, "{tool}, {run}, {date}")
        text = "".join(re.escape(p) if k % 2 == 0 else f"(?P<{p}>[^/]+?)" for k, p in enumerate(parts))
        stem = path.as_posix().removesuffix("".join(path.suffixes[-2:] if path.suffix == ".gz" else path.suffixes[-1:]))
        match = re.search(rf"(?:^|/){text}$", stem)
        if match is None:
            raise FileError(Finding("fleet-pattern", {"pattern": pattern, "stem": stem}), path=path)
        found = match.groupdict()
    serial, name = tool or found.get("tool"), run or found.get("run") or path.name.partition(".")[0]
    if not serial:
        raise FileError(Finding("input-one-of", {"names": ("--tool", "--pattern {tool}")}), path=path)
    when = day or found.get("date")
    if when is None:
        raise FileError(Finding("input-one-of", {"names": ("--date", "--pattern {date}")}), path=path)
    try:
        return About(serial, name, date.fromisoformat(when))
    except ValueError:
        raise FileError(
            Finding("input-kind", {"name": "--date", "value": when, "expected": "date YYYY-MM-DD"}), path=path
        ) from None


def add(
    store: Store, path: Path, what: About, known: Mapping[str, Raw], progress: Callable[[int], None] | None = None
) -> list[Raw]:
    """Write a run into the data set; returns the new entries of the catalogue, none where it is there already.

    Counts stay counts: int32 where every value is a whole number, else float32. Missing values are NaN. A file is named
    by its digest, so adding it twice adds nothing.
    """
    import pyarrow as pa

    run = open_run(path, progress=progress)
    for kind in ("accelerometer", "magnetometer"):
        if kind not in run.names:
            raise FileError(Finding("input-missing", {"names": (kind,)}), path=path)
    units = {kind: (run.units[kind], len(names)) for kind, names in run.names.items()}
    whole = _whole(run, path)
    run = open_run(path)
    names = {kind: channel_names(kind, count) for kind, (_, count) in units.items()}
    kind_of = pa.int32() if whole else pa.float32()
    fields = [pa.field("time_ns", pa.int64(), nullable=False)]
    fields += [pa.field(name, kind_of, nullable=False) for found in names.values() for name in found]
    if "temperature_degC" in run.wanted:
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
            with row_groups(scratch, schema) as rows:
                for block in blocks:
                    columns = [state.times(block.time, origin, path)]
                    for kind, found in names.items():
                        columns += [block.channels[kind][:, place] for place in range(len(found))]
                    rows.add([*columns, block.temperature] if "temperature_degC" in run.wanted else columns)
            if state.first == state.last and state.rows > 1:
                raise FileError(Finding("fleet-clock-still", {"total": state.rows}), path=path)
            digest = digest_file(scratch)
            name = f"{folder}/part-{digest.removeprefix('sha256:')[:20]}.parquet"
            if name in known:
                continue
            for one in known.values():
                same = one.partition == (what.tool, what.run, what.date.isoformat())
                if same and state.first <= one.last_ns and one.first_ns <= state.last:
                    raise FileError(
                        Finding("fleet-overlap", {"tool": what.tool, "run": what.run, "source": one.source}), path=path
                    )
            size = scratch.stat().st_size
            publish(name)
        stamp = store.stamp(name)
        added.append(
            Raw(
                name, what.tool, what.run, what.date.isoformat(), digest, size, 0 if stamp is None else stamp[1],
                state.rows, state.first, state.last, state.absolute, units, "temperature_degC" in run.wanted,
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


class RowGroups:
    """Columns (n,) each, gathered into row groups of a Parquet file; `rows` so far."""

    def __init__(self, writer: Any, schema: Any) -> None:
        self._writer, self._schema = writer, schema
        self._held: list[Sequence[Any]] = []
        self.rows = self._waiting = 0

    def add(self, columns: Sequence[Any]) -> None:
        """Rows behind those before, as the schema has them."""
        kinds = [field.type.to_pandas_dtype() for field in self._schema]
        self._held.append([np.ascontiguousarray(c, kind) for c, kind in zip(columns, kinds, strict=True)])
        self.rows, self._waiting = self.rows + len(columns[0]), self._waiting + len(columns[0])
        if self._waiting >= ROW_GROUP:
            self.write()

    def write(self) -> None:
        """Write what is held."""
        import pyarrow as pa

        if self._held:
            arrays = [pa.array(np.concatenate(parts)) for parts in zip(*self._held, strict=True)]
            self._writer.write_table(pa.Table.from_arrays(arrays, schema=self._schema), row_group_size=ROW_GROUP)
        self._held, self._waiting = [], 0


@contextmanager
def row_groups(path: Path, schema: Any) -> Iterator[RowGroups]:
    """A Parquet file of a fleet to write into: byte streams split, LZ4, page checksums, no dictionaries."""
    import pyarrow.parquet as pq

    # a regular clock takes next to nothing as differences
    differences = ("time_ns", "samples")
    encoding = {f.name: "DELTA_BINARY_PACKED" if f.name in differences else "BYTE_STREAM_SPLIT" for f in schema}
    with pq.ParquetWriter(
        path, schema, compression="lz4", use_dictionary=False, column_encoding=encoding, write_page_checksum=True
    ) as writer:
        made = RowGroups(writer, schema)
        yield made
        made.write()


def _whole(run: RunFile, path: Path) -> bool:
    """Whether every signal is a whole number that an int32 holds; reads the file once."""
    whole = True
    for block in run.blocks(1 << 16):
        for kind, values in block.channels.items():
            missing = np.isnan(values)
            if whole:
                whole = not missing.any() and bool((values == np.rint(values)).all() and np.abs(values).max() < 2**31)
            if missing.any() and run.units[kind] == "counts" and np.nanmax(np.abs(values), initial=0.0) >= _EXACT:
                raise FileError(Finding("fleet-counts-large", {"most": _EXACT}), path=path)
    return whole


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
            raise FileError(Finding("fleet-clock-set", {"row": row}), path=path)
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


def _parts(run: RunFile) -> Iterator[Iterator[Any]]:
    """The blocks of a run, those of one file at a time."""
    blocks = run.blocks(1 << 16)
    for first in blocks:
        yield _part(first, blocks)


def _part(first: Any, blocks: Iterator[Any]) -> Iterator[Any]:
    rows = 0
    for block in chain([first], blocks):
        yield block
        rows += len(block.time)
        if rows >= MOST_ROWS:
            return
