"""Long signals thinned to what a page shows, in memory that does not grow: bins double when they run out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.motion.run_result import Envelope, Spectrogram

MOST_BINS: Final = 1500
"""Stretches of an envelope; never more than twice as many are held."""
MOST_COLUMNS: Final = 400
"""Columns of a spectrogram, likewise."""


class Envelopes:
    """Lowest, mean and highest value of c channels in bins of time.

    Examples
    --------
    >>> thin = Envelopes(["a"], ["nT"], 0.0, 1.0)
    >>> thin.push(np.arange(5000.0), np.arange(5000.0)[:, None])
    >>> found, = thin.done()
    >>> len(found.time), found.low[:3], found.high[-2:]
    (2500, array([0., 2., 4.]), array([4997., 4999.]))
    """

    def __init__(self, names: Sequence[str], units: Sequence[str], start: float, width: float) -> None:
        self._names, self._units = list(names), list(units)
        self._start, self._width = start, width
        shape = (2 * MOST_BINS, len(self._names))
        self._low, self._high = np.full(shape, np.inf), np.full(shape, -np.inf)
        self._sum, self._count = np.zeros(shape), np.zeros(2 * MOST_BINS)

    def push(self, time: Array, values: Array) -> None:
        """Take samples (n,) and their channels (n, c), in order of time."""
        if not len(time):
            return
        while time[-1] - self._start >= self._width * 2 * MOST_BINS:
            self._halve()
        place = ((time - self._start) / self._width).astype(np.intp)
        first = np.flatnonzero(np.diff(place, prepend=-1))
        bins = place[first]
        self._low[bins] = np.minimum(self._low[bins], np.minimum.reduceat(values, first))
        self._high[bins] = np.maximum(self._high[bins], np.maximum.reduceat(values, first))
        self._sum[bins] += np.add.reduceat(values, first)
        self._count[bins] += np.diff(first, append=len(time))

    def _halve(self) -> None:
        for held, empty, join in ((self._low, np.inf, np.minimum), (self._high, -np.inf, np.maximum)):
            held[:MOST_BINS] = join(held[::2], held[1::2])
            held[MOST_BINS:] = empty
        _halved(self._sum, MOST_BINS)
        _halved(self._count, MOST_BINS)
        self._width *= 2.0

    def done(self) -> tuple[Envelope, ...]:
        """What has been seen; bins without a sample are left out."""
        seen = np.flatnonzero(self._count)
        time = np.asarray(self._start + self._width * (seen + 0.5), dtype=np.float64)
        mean = self._sum[seen] / self._count[seen][:, None]
        return tuple(
            Envelope(name, unit, time, self._low[seen, k], mean[:, k], self._high[seen, k])
            for k, (name, unit) in enumerate(zip(self._names, self._units, strict=True))
        )


class Spectra:
    """Mean power spectra of equal stretches of time.

    Examples
    --------
    >>> thin = Spectra("noise", 0.0, 1.0, np.arange(3.0))
    >>> for second in range(2000):
    ...     thin.push(second + 0.5, np.full(3, float(second)))
    >>> found = thin.done()
    >>> found.density.shape, float(found.density[0, 0]), float(found.time[-1])
    ((500, 3), 1.5, 2000.0)
    """

    def __init__(self, what: str, start: float, width: float, frequency: Array) -> None:
        self._what, self._start, self._width, self._frequency = what, start, width, frequency
        self._sum, self._count = np.zeros((2 * MOST_COLUMNS, len(frequency))), np.zeros(2 * MOST_COLUMNS)

    def push(self, time: float, density: Array) -> None:
        """Take the spectrum (f,) of a window with this middle."""
        while time - self._start >= self._width * 2 * MOST_COLUMNS:
            _halved(self._sum, MOST_COLUMNS)
            _halved(self._count, MOST_COLUMNS)
            self._width *= 2.0
        place = int((time - self._start) / self._width)
        self._sum[place] += density
        self._count[place] += 1.0

    def done(self) -> Spectrogram:
        """What has been seen; NaN where no window was."""
        size = int(np.flatnonzero(self._count)[-1]) + 1 if self._count.any() else 0
        with np.errstate(invalid="ignore"):
            density = self._sum[:size] / self._count[:size, None]
        edges = np.asarray(self._start + self._width * np.arange(size + 1), dtype=np.float64)
        return Spectrogram(self._what, edges, self._frequency, density)


def _halved(held: Array, half: int) -> None:
    """Add up neighbours: the first half then covers what the whole did."""
    held[:half] = held[::2] + held[1::2]
    held[half:] = 0.0
