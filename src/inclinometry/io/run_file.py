"""A run of a moving tool, of any length: `time_s`, the channels, `temperature_degC`, read block by block."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple, Protocol

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.core.errors import FileError
from inclinometry.io._lines import Progress
from inclinometry.io._run_columns import RunHeader

BLOCK: Final = 1 << 15
"""Rows of a block: large enough for compiled loops, small enough for any memory."""

ENDINGS: Final = (".parquet", ".csv")


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


@dataclass(frozen=True, eq=False)
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

    def _block(self, columns: Mapping[str, Array]) -> RunBlock:
        channels = {kind: np.stack([columns[name] for name in names], axis=1) for kind, names in self.names.items()}
        return RunBlock(columns["time_s"], channels, columns.get("temperature_degC"))


def _joined(pieces: list[dict[str, Array]]) -> dict[str, Array]:
    if len(pieces) == 1:
        return pieces[0]
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}


def open_run(path: str | Path, *, progress: Progress | None = None) -> RunFile:
    """Open a run: Parquet where the name ends in .parquet, otherwise CSV in any of the usual dialects.

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
    source: Source
    if where.suffix.lower() == ".parquet":
        from inclinometry.io.run_parquet import ParquetRun

        source = ParquetRun(where, progress)
    else:
        from inclinometry.io.run_csv import CsvRun

        source = CsvRun(where, progress)
    return RunFile(where, source.header, source)
