"""Long tables written block by block, whole or not at all: Parquet for anything long, CSV for the eye."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.core.errors import FileError
from inclinometry.io.atomic import replacing
from inclinometry.io.run_file import ENDINGS

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
    if ending not in ENDINGS:
        raise FileError(f"the name ends in {ending or 'nothing'!r}; allowed: {', '.join(ENDINGS)}", path=path)
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
