"""A continuous log: `time_s`, the channels, `temperature_degC`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from inclinometry.arrays import Array, frozen
from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.files.columns import KIND_PREFIX, LOG, channel, numbers_among
from inclinometry.files.signals import read_signals, read_temperature
from inclinometry.files.survey_csv import check_increasing
from inclinometry.files.table import Progress, Table, read_table

# A log sampled evenly, in SI units: what a noise analysis needs.

TO_SI = {
    "deg/h": ("rad/s", np.pi / 180.0 / 3600.0),
    "deg/s": ("rad/s", np.pi / 180.0),
    "g": ("m/s^2", STANDARD_GRAVITY),
    "mg": ("m/s^2", STANDARD_GRAVITY / 1000.0),
    "uT": ("nT", 1000.0),
    "mV": ("V", 0.001),
}
"""Unit of a column -> unit inside and what to multiply by; any other unit, counts among them, stays."""


@dataclass(frozen=True, eq=False)
class EvenLog:
    """Samples at equal intervals.

    start, dt : s; sample k was taken at start + k dt.
    channels : kind -> (n, m) in `units`.
    names : kind -> the m channels, e.g. "gyro_x".
    units : kind -> unit: rad/s, m/s^2, nT, V or counts.
    notes : columns that were not used.
    digest : SHA-256 of the file.
    """

    start: float
    dt: float
    channels: Mapping[str, Array]
    names: Mapping[str, tuple[str, ...]]
    units: Mapping[str, str]
    notes: tuple[str, ...]
    digest: str

    def __len__(self) -> int:
        return len(next(iter(self.channels.values())))


def read_even_log(path: str | Path, *, progress: Progress | None = None) -> EvenLog:
    """Read `time_s` and the channels of a log without gaps.

    Raises
    ------
    FileError
        As `table.read_table`; no channels; times that do not increase; a gap, two samples too near each other, or a
        sampling rate that changes, naming the line.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "log.csv").write_text("time_s,gyro_x_deg_s,gyro_y_deg_s\\n0,1,2\\n0.5,1,3\\n1,2,3\\n")
    ...     log = read_even_log(Path(folder, "log.csv"))
    >>> log.dt, log.units["gyro"], log.names["gyro"]
    (0.5, 'rad/s', ('gyro_x', 'gyro_y'))
    """
    table = read_table(path, progress, numeric=numbers_among(LOG), timed=True)
    unused = [f"column {name!r} is not known and was not used" for name in table.unknown(LOG)]
    time, signals = table.number("time_s"), read_signals(table)
    check_increasing(table, "time_s", time)
    dt = _interval(table, time)
    channels, units, names = {}, {}, {}
    for kind, values in signals.values.items():
        units[kind], factor = TO_SI.get(signals.units[kind], (signals.units[kind], 1.0))
        channels[kind] = frozen(values * factor)
        found = [channel(name) for name in signals.names[kind]]
        names[kind] = tuple(f"{KIND_PREFIX[kind]}_{c.axis}" for c in found if c is not None)
    return EvenLog(
        float(time[0]),
        dt,
        MappingProxyType(channels),
        MappingProxyType(names),
        MappingProxyType(units),
        tuple(unused),
        table.digest,
    )


def _interval(table: Table, time: Array) -> float:
    """The sampling interval, s; FileError where there is none."""
    if len(time) < 3:
        raise table.error(f"{len(time)} rows; an even sampling interval needs 3 or more", len(time) - 1)
    steps = np.diff(time)
    usual = float(np.median(steps))
    # departure of one interval from the usual one, as a share of it: stamps rounded to a digit of the interval pass
    most_jitter = 0.5
    # half a share of room: the stamps themselves are rounded
    odd = np.flatnonzero(np.abs(steps - usual) > most_jitter * usual * (1.0 + 1e-6))
    if odd.size:
        row = int(odd[0]) + 1
        what = f"{steps[row - 1]:.6g} s after the row before it; the samples are {usual:.6g} s apart"
        remedy = "cut the log at the gap and use the longer part, or resample it"
        raise table.error(f"time_s {time[row]:.12g} is {what}: {remedy}", row)
    dt = float((time[-1] - time[0]) / (len(time) - 1))
    off = (time - time[0]) / dt - np.arange(len(time))
    most_drift = 1.0  # departure of a sample from the even grid, in intervals
    if np.abs(off).max() > most_drift:
        row = int(np.argmax(np.abs(off)))
        what = f"{abs(off[row]):.3g} samples off an even spacing of {dt:.6g} s"
        raise table.error(f"time_s {time[row]:.12g} is {what}; use a log whose sampling rate does not change", row)
    return dt


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
    table = read_table(path, progress, numeric=numbers_among(LOG), timed=True)
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
