"""A continuous log: `time_s`, the channels, `temperature_degC`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from inclinometry.arrays import Array, frozen
from inclinometry.files._quantities import to_si
from inclinometry.files.columns import KIND_PREFIX, LOG, channel, numbers_among
from inclinometry.files.frame import Frame
from inclinometry.files.signals import read_signals, read_temperature
from inclinometry.files.survey_csv import check_increasing
from inclinometry.files.table import read_table
from inclinometry.files.text import Progress
from inclinometry.findings import Finding


@dataclass(frozen=True, eq=False)
class Log:
    """Samples in the order of time.

    time : (n,) s, strictly increasing. channels : kind -> (n, m) in `units`. temperature : (n,) degC, or None.
    findings : of the reader. digest : SHA-256 of the file. names : kind -> the m channels, e.g. "gyro_x".
    dt : s, of an evenly sampled log.
    """

    time: Array
    channels: Mapping[str, Array]
    temperature: Array | None
    units: Mapping[str, str]
    findings: tuple[Finding, ...]
    digest: str
    names: Mapping[str, tuple[str, ...]]
    dt: float = np.nan

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
    return _log(path, progress)[0]


def _log(path: str | Path, progress: Progress | None) -> tuple[Log, Frame]:
    table = read_table(path, progress, numeric=numbers_among(LOG), timed=True)
    time, signals = table.number("time_s"), read_signals(table)
    check_increasing(table, "time_s", time)
    found = {kind: [channel(name) for name in names] for kind, names in signals.names.items()}
    names = {kind: tuple(f"{KIND_PREFIX[kind]}_{c.axis}" for c in of if c is not None) for kind, of in found.items()}
    channels = MappingProxyType({kind: frozen(values) for kind, values in signals.values.items()})
    findings = (*signals.findings, *table.unknown(LOG))
    units = MappingProxyType(signals.units)
    return Log(time, channels, read_temperature(table), units, findings, table.digest, MappingProxyType(names)), table


def read_even_log(path: str | Path, *, progress: Progress | None = None) -> Log:
    """A log in rad/s, m/s^2, nT, V or counts; a gap or a sampling rate that changes is an error."""
    log, table = _log(path, progress)
    turned = {kind: to_si(unit) for kind, unit in log.units.items()}
    return replace(
        log,
        channels=MappingProxyType({kind: frozen(v * turned[kind][1]) for kind, v in log.channels.items()}),
        units=MappingProxyType({kind: unit for kind, (unit, _) in turned.items()}),
        findings=table.unknown(LOG),
        dt=_interval(table, log.time),
    )


def _interval(table: Frame, time: Array) -> float:
    """The sampling interval, s; FileError where there is none."""
    if len(time) < 3:
        raise table.error(Finding("input-few", {"name": "rows", "count": len(time), "least": 3}), len(time) - 1)
    steps = np.diff(time)
    usual = float(np.median(steps))
    # departure of one interval from the usual one, as a share of it: stamps rounded to a digit of the interval pass
    most_jitter = 0.5
    # half a share of room: the stamps themselves are rounded
    odd = np.flatnonzero(np.abs(steps - usual) > most_jitter * usual * (1.0 + 1e-6))
    if odd.size:
        row = int(odd[0]) + 1
        raise table.error(_uneven(row, time, (steps[row - 1] - usual) / usual), row)
    dt = float((time[-1] - time[0]) / (len(time) - 1))
    off = (time - time[0]) / dt - np.arange(len(time))
    most_drift = 1.0  # departure of a sample from the even grid, in intervals
    if np.abs(off).max() > most_drift:
        row = int(np.argmax(np.abs(off)))
        raise table.error(_uneven(row, time, off[row]), row)
    return dt


def _uneven(row: int, time: Array, off: float) -> Finding:
    return Finding("input-uneven", {"row": row + 1, "time_s": float(time[row]), "off": abs(float(off))})
