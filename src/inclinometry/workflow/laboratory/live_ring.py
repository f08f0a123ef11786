"""The last samples of an instrument in memory that never grows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from inclinometry.core.arrays import Array, Mask
from inclinometry.core.constants import KINDS
from inclinometry.io.instrument.sample import Sample


@dataclass(frozen=True, eq=False)
class Window:
    """Samples of a stretch of time, oldest first.

    time : (n,) s, on the clock of the feed.
    channels : kind -> (n, m).
    temperature : (n,) degC, NaN where there is none.
    faulty : (n,) bool, samples out of range or stuck.
    """

    time: Array
    channels: Mapping[str, Array]
    temperature: Array
    faulty: Mask

    def __len__(self) -> int:
        return len(self.time)

    @property
    def signals(self) -> Array:
        """All channels side by side, (n, c)."""
        parts = list(self.channels.values())
        return np.hstack(parts) if parts else np.zeros((len(self), 0))

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each column of `signals`: "accelerometer 1" ..."""
        return tuple(f"{kind} {i + 1}" for kind, x in self.channels.items() for i in range(x.shape[1]))

    @property
    def duration(self) -> float:
        """s, from the first sample to the last."""
        return float(self.time[-1] - self.time[0]) if len(self) else 0.0

    def split(self, row: Array) -> dict[str, Array]:
        """One row of `signals` (c,) as kind -> (m,)."""
        out, start = {}, 0
        for kind, x in self.channels.items():
            out[kind] = np.asarray(row[start : start + x.shape[1]])
            start += x.shape[1]
        return out


class Ring:
    """The newest samples, at most `capacity`; what is older is overwritten."""

    def __init__(self, capacity: int) -> None:
        self._capacity, self._count = capacity, 0
        self._kinds: dict[str, slice] = {}
        self._rows = np.zeros((0, 0))

    def __len__(self) -> int:
        return min(self._count, self._capacity)

    def put(self, sample: Sample) -> Array:
        """Add a sample; its signals side by side, (c,)."""
        signals = np.concatenate([sample.channels[kind] for kind in KINDS if kind in sample.channels])
        if not self._kinds:
            start = 0
            for kind in (kind for kind in KINDS if kind in sample.channels):
                stop = start + len(sample.channels[kind])
                self._kinds[kind], start = slice(start, stop), stop
            self._rows = np.zeros((self._capacity, 3 + start))
        row = self._rows[self._count % self._capacity]
        row[0], row[2] = sample.time, bool(sample.faults)
        row[1] = np.nan if sample.temperature is None else sample.temperature
        row[3:] = signals
        self._count += 1
        return signals

    def since(self, time: float) -> Window:
        """A copy of the samples not older than `time`."""
        size, end = len(self), self._count % self._capacity
        ordered = np.arange(end - size, end) % self._capacity if size else np.zeros(0, dtype=int)
        first = int(np.searchsorted(self._rows[ordered, 0], time)) if size else 0
        rows = self._rows[ordered[first:]]
        if not size:
            return Window(np.zeros(0), {}, np.zeros(0), np.zeros(0, dtype=bool))
        channels = {kind: rows[:, 3:][:, part] for kind, part in self._kinds.items()}
        return Window(rows[:, 0], channels, rows[:, 1], rows[:, 2] > 0.0)
