"""A continuous log: `time_s`, the channels, `temperature_degC`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from inclinometry.core.arrays import Array, frozen
from inclinometry.io._channels import read_signals, read_temperature
from inclinometry.io._lines import Progress
from inclinometry.io.columns import LOG, numbers_among
from inclinometry.io.survey_csv import check_increasing
from inclinometry.io.table import read_table


@dataclass(frozen=True, eq=False)
class Log:
    """Samples in the order of time.

    time : (n,) s, strictly increasing.
    channels : kind -> (n, m) signals.
    temperature : (n,) degC, or None.
    units : kind -> unit of the signals.
    notes : findings of the reader.
    digest : SHA-256 of the file.
    """

    time: Array
    channels: Mapping[str, Array]
    temperature: Array | None
    units: Mapping[str, str]
    notes: tuple[str, ...]
    digest: str

    def __len__(self) -> int:
        return len(self.time)


def read_log(path: str | Path, *, progress: Progress | None = None) -> Log:
    """Read a log of any length.

    Raises
    ------
    FileError
        As `table.read_table`; no channels; times that do not increase, naming both lines.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "log.csv").write_text("time_s,gyro_x,gyro_y\\n0,1,2\\n0.01,1,3\\n")
    ...     len(read_log(Path(folder, "log.csv")))
    2
    """
    table = read_table(path, progress, numeric=numbers_among(LOG))
    unused = [f"column {name!r} is not known and was not used" for name in table.unknown(LOG)]
    time, signals = table.number("time_s"), read_signals(table)
    check_increasing(table, "time_s", time)
    return Log(
        time,
        MappingProxyType({kind: frozen(values) for kind, values in signals.values.items()}),
        read_temperature(table),
        MappingProxyType(signals.units),
        (*signals.notes, *unused),
        table.digest,
    )
