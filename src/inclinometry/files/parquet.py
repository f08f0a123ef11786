"""Survey tables as Parquet: the unit of each column in its name and its metadata, the file's head in the schema."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.digest import digest_file
from inclinometry.errors import FileError, InputError
from inclinometry.files._quantities import meaning
from inclinometry.files.exchange import Column, Sheet, SurveyFile, row_error, survey_of
from inclinometry.files.profile import PLAIN, current
from inclinometry.files.survey_csv import columns_of
from inclinometry.files.writing import replacing
from inclinometry.opening import opened

_HEADER: Final = b"inclinometry.header"


def read_parquet(path: str | Path, *, convention: str = "native", azimuth_reference: str | None = None) -> SurveyFile:
    """Read a survey from a Parquet file; names of columns as `six_axis.read_csv` knows them.

    A unit may stand in the name or in the column's metadata (`unit`, `units` or `uom`). Null is unknown.

    Parameters
    ----------
    path : str or Path
    convention, azimuth_reference : str
        As in `six_axis.read_csv`.

    Raises
    ------
    FileError
        Not Parquet or damaged; no rows; a column of numbers that is of another type, or a nested one; else as
        `six_axis.read_csv`, with the row.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_parquet(SurveyFile(md=[0, 30], tvd=[0, 29.5], header={"well": "A-1"}), Path(folder, "a.parquet"))
    ...     survey = read_parquet(Path(folder, "a.parquet"))
    >>> survey.tvd, survey.header["well"]
    (array([ 0. , 29.5]), 'A-1')
    """
    if current() != PLAIN:
        from inclinometry.files.six_axis import read_csv

        return read_csv(path, convention=convention, azimuth_reference=azimuth_reference)
    where = Path(path)
    table = _table(where)
    try:
        if table.num_rows == 0 or table.num_columns == 0:
            raise FileError("the file has no rows of values", path=where)
        units = _units(table.schema)
        columns: dict[str, Column] = {}
        for field in table.schema:
            columns[field.name] = _column(where, field, table.column(field.name), units.get(field.name))
        rows = np.arange(1, table.num_rows + 1)
        header = _header(where, table.schema.metadata or {})
        sheet = Sheet(where, columns, rows, units, "row", header=header, digest=digest_file(where))
    except UnicodeDecodeError as error:
        raise FileError(f"a text in it is no UTF-8 ({error.reason}); the file is damaged", path=where) from None
    return survey_of(sheet, convention=convention, azimuth_reference=azimuth_reference)


def _table(path: Path) -> Any:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with opened(path) as stream:
            # threads of its own that still run when the process ends have aborted it; a survey needs none
            table = pq.ParquetFile(stream, page_checksum_verification=True, pre_buffer=False).read(use_threads=False)
    except FileError:
        raise
    except (pa.ArrowException, OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or (str(error).strip().splitlines() or ["no more is known"])[0]
        raise FileError(f"not a Parquet file, or a damaged one ({reason[:200]}); write it again", path=path) from None
    names = table.column_names
    twice = next((name for place, name in enumerate(names) if name in names[:place]), None)
    if twice is not None:
        raise FileError(f"column {twice!r} appears twice; remove one", path=path)
    return table


def _units(schema: Any) -> dict[str, str]:
    """Units stated in the columns' metadata."""
    found = {}
    units = (b"unit", b"units", b"uom")
    for field in schema:
        metadata = field.metadata or {}
        stated = next((metadata[key] for key in units if metadata.get(key)), None)
        if stated is not None:
            found[field.name] = stated.decode("utf-8", "replace")
    return found


def _column(path: Path, field: Any, values: Any, unit: str | None) -> Column:
    """Numbers or texts, as the column's meaning asks."""
    import pyarrow.types as types

    try:
        what = meaning(field.name, unit, ())
        wanted = what is not None and what.unit is not None
    except InputError:
        wanted = False  # `survey_of` will say what is wrong
    kind = field.type
    numeric = types.is_floating(kind) or types.is_integer(kind) or types.is_decimal(kind)
    if wanted and not (numeric or types.is_null(kind)):
        problem = f"column {field.name!r} is of type {kind}; numbers are needed: convert it"
        raise row_error(path, problem, None)
    if numeric or types.is_null(kind):
        return np.array(values.cast("float64").to_numpy(zero_copy_only=False), dtype=np.float64)
    if types.is_boolean(kind):
        return tuple("" if v is None else "1" if v else "0" for v in values.to_pylist())
    if types.is_nested(kind) or types.is_binary(kind) or types.is_large_binary(kind):
        raise row_error(path, f"column {field.name!r} is of type {kind}; texts or numbers are needed: remove it", None)
    if types.is_temporal(kind):
        return tuple(
            "" if v is None else v.isoformat() if hasattr(v, "isoformat") else str(v) for v in values.to_pylist()
        )
    return tuple("" if v is None else str(v) for v in values.to_pylist())


def _header(path: Path, metadata: Mapping[bytes, bytes]) -> dict[str, str]:
    if _HEADER not in metadata:
        return {}
    try:
        found = json.loads(metadata[_HEADER])
    except ValueError as error:
        raise FileError(f"the header in the schema's metadata is damaged ({error})", path=path) from None
    if not isinstance(found, dict):
        raise FileError("the header in the schema's metadata is not a mapping of texts", path=path)
    return {str(key): str(value) for key, value in found.items()}


def write_parquet(file: SurveyFile, path: str | Path) -> None:
    """Write a survey as Parquet (zstd): float64 columns, null where unknown, texts and flags; see `read_parquet`.

    Examples
    --------
    See `read_parquet`.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    fields, arrays = [], []
    for column in columns_of(file):
        if isinstance(column.values, tuple):
            flag = column.name in ("used", "valid")
            kind = pa.bool_() if flag else pa.string()
            arrays.append(pa.array([v == "1" for v in column.values] if flag else list(column.values), kind))
            fields.append(pa.field(column.name, kind))
        else:
            arrays.append(pa.array(column.values, pa.float64(), from_pandas=True))
            unit = column.quantity.unit.label if column.quantity else ""
            fields.append(pa.field(column.name, pa.float64(), metadata={"unit": unit}))
    header = json.dumps(dict(file.header), ensure_ascii=False).encode()
    table = pa.Table.from_arrays(arrays, schema=pa.schema(fields, metadata={_HEADER: header}))
    with replacing(path) as stream:
        pq.write_table(table, stream, compression="zstd", compression_level=1, write_page_checksum=True)
