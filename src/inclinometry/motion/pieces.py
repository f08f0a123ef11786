"""Smoothers over runs of any length: piece by piece, each with a lead-in and a tail that are thrown away."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any, Final

import numpy as np

from inclinometry.findings import Finding
from inclinometry.motion.checked import taken
from inclinometry.motion.magnetic.window import MagneticStream
from inclinometry.motion.result import Attitude, Samples, joined, refusals
from inclinometry.motion.timing import rejoined
from inclinometry.motion.window_filter import WindowFilterSettings
from inclinometry.motion.window_smoother import smooth_windows

MOST_ROWS: Final = 20_000
"""Windows smoothed at a time."""
LEAD: Final = 60
"""Windows before and after a piece that are smoothed with it: by then attitudes no longer feel what lies beyond; what
the whole run would teach of the sensors' constant errors, a piece learns for itself."""

Smooth = Callable[[Samples], Attitude]


class SampleSmoother:
    """The smoother of gyro, gravity and field over one stretch; pieces are whole windows (s).

    `most`: samples of a piece, at the least; a million take some 300 MB.
    """

    def __init__(self, smooth: Smooth, window: float, most: int = 1_000_000) -> None:
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
            # without what the samples are a part of
            rest = whole.part(start, len(whole))
            own: dict[str, Any] = {
                f.name: v.copy() for f in fields(rest) if isinstance(v := getattr(rest, f.name), np.ndarray)
            }
            self._held, self._size = [replace(rest, **own)], len(rest)
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
        said = Finding("motion-pieces", {"count": self._pieces, "overlap": 2 * LEAD}, severity="note")
        return replace(found, findings=(*found.findings, said))

    def _rows(self, samples: Samples, start: int, stop: int) -> Attitude:
        """Rows of the windows that end with samples start + 1 to stop."""
        self._pieces += 1
        found = self._smooth(samples)
        slack = 0.5 * samples.interval
        low = samples.time[start] if start else -np.inf
        high = samples.time[stop - 1] if stop < len(samples) else np.inf
        return taken(found, np.flatnonzero((found.time >= low - slack) & (found.time <= high + slack)))


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
