"""A run as Parquet, read in batches of rows so that no row group needs to fit into memory."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.core.digest import digest_file
from inclinometry.core.errors import FileError
from inclinometry.io._lines import Progress
from inclinometry.io._run_columns import RunCheck, RunHeader, run_header
from inclinometry.io.parquet import _units

BATCH: Final = 1 << 15
_BUFFER: Final = 1 << 20


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
        except OSError as error:
            reason = f"it was there when it was opened ({error.strerror}); leave it in place while it is read"
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

    try:
        with path.open("rb") as stream:
            # buffered reading: a file of one large row group is not read at once; no threads of its own
            yield pq.ParquetFile(stream, buffer_size=_BUFFER, pre_buffer=False, page_checksum_verification=True)
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
