"""Smoothers over runs of any length: piece by piece, each with a lead-in and a tail that are thrown away."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Final

import numpy as np

from inclinometry.core.arrays import Array, Index
from inclinometry.motion.magnetic.stream import MagneticStream
from inclinometry.motion.result import Attitude, joined, refusals
from inclinometry.motion.samples import Samples
from inclinometry.motion.timing import rejoined
from inclinometry.motion.window_filter import WindowFilterSettings

MOST_SAMPLES: Final = 1_000_000
"""Samples smoothed at a time, some 300 MB."""
MOST_ROWS: Final = 20_000
"""Windows smoothed at a time."""
LEAD: Final = 60
"""Windows before and after a piece that are smoothed with it: by then attitudes no longer feel what lies beyond; what
the whole run would teach of the sensors' constant errors, a piece learns for itself."""

Smooth = Callable[[Samples], Attitude]


class SampleSmoother:
    """The smoother of gyro, gravity and field over one stretch; pieces are whole windows.

    Parameters
    ----------
    smooth : callable
        Samples -> rows, one a window.
    window : float
        s.
    most : int
        Samples of a piece, at the least.
    """

    def __init__(self, smooth: Smooth, window: float, most: int = MOST_SAMPLES) -> None:
        self._smooth, self._window, self._most = smooth, window, most
        self._held: list[Samples] = []
        self._size = 0
        self._lead = 0  # of the samples held, those whose rows are out already
        self._pieces = 0

    def push(self, samples: Samples) -> Attitude:
        """Rows of the pieces that became complete."""
        self._held.append(samples)
        self._size += len(samples)
        step = max(1, round(self._window / samples.interval))
        tail = LEAD * step
        wanted = self._lead + max(1, self._most // step) * step + tail
        parts: list[Attitude] = []
        while self._size >= wanted:
            whole = rejoined(self._held)
            parts.append(self._rows(whole.part(0, wanted), self._lead, wanted - tail))
            start = max(0, wanted - 2 * tail)
            self._lead = wanted - tail - start
            self._held, self._size = [_copied(whole.part(start, len(whole)))], len(whole) - start
            wanted = self._lead + max(1, self._most // step) * step + tail
        return joined(parts) if parts else refusals([], (), "smoother", "magnetic")

    def finish(self) -> Attitude:
        """The rest."""
        if not self._size:
            return refusals([], (), "smoother", "magnetic")
        found = self._rows(rejoined(self._held), self._lead, self._size)
        self._held, self._size, self._lead = [], 0, 0
        if self._pieces < 2:
            return found
        note = (
            f"the run was smoothed in {self._pieces} pieces that overlap by {2 * LEAD} windows; each learns the "
            "sensors' errors for itself"
        )
        return replace(found, notes=(*found.notes, note))

    def _rows(self, samples: Samples, start: int, stop: int) -> Attitude:
        """Rows of the windows that end with samples start + 1 to stop."""
        self._pieces += 1
        found = self._smooth(samples)
        slack = 0.5 * samples.interval
        low = samples.time[start] if start else -np.inf
        high = samples.time[stop - 1] if stop < len(samples) else np.inf
        return taken(found, np.flatnonzero((found.time >= low - slack) & (found.time <= high + slack)))


def _copied(samples: Samples) -> Samples:
    """Without what the samples are a part of."""

    def own(value: Array | None) -> Array | None:
        return None if value is None else value.copy()

    return replace(
        samples,
        time=samples.time.copy(),
        accel=own(samples.accel),
        mag=own(samples.mag),
        gyro=own(samples.gyro),
        temperature=own(samples.temperature),
        clipped=None if samples.clipped is None else samples.clipped.copy(),
    )


class WindowSmoother:
    """The smoother of magnetic windows, for runs without a gyro."""

    def __init__(
        self, stream: MagneticStream, settings: WindowFilterSettings | None = None, most: int = MOST_ROWS
    ) -> None:
        self._stream, self._settings, self._most = stream, settings, most
        self._parts: list[Attitude] = []

    def push(self, samples: Samples) -> Attitude:
        """No rows: all of them are needed first."""
        self._parts.append(self._stream.push(samples))
        return refusals([], (), "smoother", "magnetic")

    def finish(self) -> Attitude:
        """All rows."""
        from inclinometry.motion.window_smoother import smooth_windows

        rows = joined([*self._parts, self._stream.finish()])
        self._parts = []
        if not len(rows):
            return rows
        found = []
        for start in range(0, len(rows), self._most):
            first = max(0, start - LEAD)
            piece = taken(rows, np.arange(first, min(start + self._most + LEAD, len(rows))))
            part = smooth_windows(piece, self._settings)
            found.append(taken(part, np.arange(start - first, min(start + self._most, len(rows)) - first)))
        return joined(found)


def taken(rows: Attitude, which: Index) -> Attitude:
    """Some rows of a result.

    Examples
    --------
    >>> taken(refusals([1.0, 2.0], ["gap"], "magnetic", "magnetic"), np.array([1])).time
    array([2.])
    """
    columns = {f.name: getattr(rows, f.name)[which] for f in fields(Attitude) if f.name not in ("north", "notes")}
    return replace(rows, **columns)
