"""Survey tables as Parquet: the unit of each column in its name and its metadata, the file's head in the schema."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.errors import FileError, InputError, in_file, system_reason, wrong_kind
from inclinometry.files._quantities import quantities_by_column
from inclinometry.files.frame import Column, Frame
from inclinometry.files.profile import with_unit
from inclinometry.files.survey_file import SurveyFile, columns_of
from inclinometry.files.text import Progress
from inclinometry.files.writing import replacing
from inclinometry.findings import Finding
from inclinometry.opening import damaged, not_text

_HEADER: Final = b"inclinometry.header"


def parquet_pieces(path: Path, progress: Progress | None = None) -> Iterator[Frame]:
    """A Parquet file batch by batch, so that no row group needs to fit into memory; null is NaN or an empty text.

    A unit may stand in the name or in the column's metadata (`unit`, `units` or `uom`).
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        # buffered: a file of one large row group is not read at once; threads that still run at the end abort it
        stored = pq.ParquetFile(path, buffer_size=1 << 20, pre_buffer=False, page_checksum_verification=True)
        fields = list(stored.schema_arrow)
        twice = next((f.name for place, f in enumerate(fields) if f.name in [g.name for g in fields[:place]]), None)
        if twice is not None:
            raise FileError(Finding("input-repeated", {"name": "column", "value": twice}), path=path)
        bare = {with_unit(field.name, _unit(field)): field.name for field in fields}
        header = _header(stored.schema_arrow.metadata or {})
        total, done = stored.metadata.num_rows, 0
        for batch in chain(stored.iter_batches(1 << 15, use_threads=False), [None] * (not total)):
            columns = {
                name: np.empty(0) if batch is None else _column(place, batch.column(k))
                for k, (name, place) in enumerate(bare.items())
            }
            size = 0 if batch is None else batch.num_rows
            yield Frame(path, columns, np.arange(done + 1, done + size + 1), bare=bare, word="row", header=header)
            done += size
            if progress is not None:
                progress(path.stat().st_size * done // max(total, 1))
    except FileError:
        raise
    except InputError as error:
        raise in_file(error, path) from None
    except UnicodeDecodeError as error:
        raise FileError(not_text("utf-8", error.reason), path=path) from None
    except (pa.ArrowException, OSError, ValueError) as error:
        raise FileError(damaged("Parquet", system_reason(error)), path=path) from None


def _unit(field: Any) -> str | None:
    """The unit stated in a column's metadata."""
    metadata = field.metadata or {}
    stated = next((metadata[key] for key in (b"unit", b"units", b"uom") if metadata.get(key)), None)
    return None if stated is None else stated.decode("utf-8", "replace")


def _column(name: str, values: Any) -> Column:
    """Numbers, texts, or flags."""
    import pyarrow.types as types

    kind = values.type
    if types.is_floating(kind) or types.is_integer(kind) or types.is_decimal(kind) or types.is_null(kind):
        return np.array(values.cast("float64").to_numpy(zero_copy_only=False), dtype=np.float64)
    if types.is_nested(kind) or types.is_binary(kind) or types.is_large_binary(kind):
        raise wrong_kind(name, str(kind), "number")
    cells = ["" if v is None else v.isoformat() if hasattr(v, "isoformat") else v for v in values.to_pylist()]
    if types.is_boolean(kind):
        return np.array(cells, dtype=np.object_)
    return tuple(map(str, cells))


def _header(metadata: Mapping[bytes, bytes]) -> dict[str, str]:
    try:
        found = json.loads(metadata.get(_HEADER, b"{}"))
    except ValueError as error:
        raise InputError(damaged("JSON", error)) from None
    if not isinstance(found, dict):
        raise wrong_kind("inclinometry.header", str(found)[:40], "table")
    return {str(key): str(value) for key, value in found.items()}


def write_parquet(file: SurveyFile, path: str | Path) -> None:
    """Write a survey as Parquet (zstd): float64 columns, null where unknown, texts and flags."""
    known = quantities_by_column()
    columns = {
        name: [v == "1" for v in values] if name in ("used", "valid") else values
        for name, values in columns_of(file).items()
    }
    units = {name: known[name].unit.label for name, v in columns.items() if isinstance(v, np.ndarray)}
    write_table(columns, units, file.header, path)


def write_table(
    columns: Mapping[str, Array | Sequence[str] | Sequence[bool]],
    units: Mapping[str, str],
    header: Mapping[str, str],
    path: str | Path,
) -> None:
    """Write numbers (float64, null where NaN), texts and flags with the units of columns and the texts of a head."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    fields, arrays = [], []
    for name, values in columns.items():
        flags = len(values) > 0 and isinstance(values[0], bool)
        kind = pa.float64() if isinstance(values, np.ndarray) else pa.bool_() if flags else pa.string()
        fields.append(pa.field(name, kind, metadata={"unit": units[name]} if name in units else None))
        arrays.append(pa.array(values, kind, from_pandas=True))
    text = json.dumps(dict(header), ensure_ascii=False).encode()
    table = pa.Table.from_arrays(arrays, schema=pa.schema(fields, metadata={_HEADER: text}))
    with replacing(path) as stream:
        pq.write_table(table, stream, compression="zstd", compression_level=1, write_page_checksum=True)
