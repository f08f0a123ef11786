"""The even grid behind a run's time stamps: interval and start, robust to jitter, rounding and dropped samples."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array, Index, finite
from inclinometry.core.errors import InputError

MOST_OFF: Final = 0.45
"""Departure of a stamp from the grid, in intervals, from which its place is no longer certain."""
_DIGITS: Final = (1, 2, 3, 4)
"""Significant digits of intervals and rates people choose."""


class Grid(NamedTuple):
    """Place k of the grid is at `start` + k `interval`.

    start, interval : s.
    jitter : root mean square departure of the stamps it was fitted to, s.
    """

    start: float
    interval: float
    jitter: float

    def places(self, time: Array) -> tuple[Index, Array]:
        """Nearest place (n,) of each stamp and the departure (n,) from it, in intervals."""
        position = (time - self.start) / self.interval
        nearest = np.rint(position)
        return nearest.astype(np.intp), position - nearest


def fit_grid(time: ArrayLike, known: float | None = None) -> Grid | None:
    """Even grid through increasing stamps with some places empty; None where there is no such grid.

    Parameters
    ----------
    time : (n,) array_like
        s, n >= 2, strictly increasing, without gaps of more than a few intervals.
    known : float, optional
        Interval, s, to be kept when the stamps do not contradict it.

    Raises
    ------
    InputError
        Fewer than two stamps.

    Notes
    -----
    First interval: mean of the steps within half of their median; stamps are numbered by the rounded steps, a straight
    line is fitted, the stamps are numbered again by the line. The slope's standard deviation is s sqrt(12 / n^3); an
    interval or a rate of up to four digits within four of it is taken for what was meant.

    Examples
    --------
    300 Hz with stamps rounded to milliseconds:

    >>> grid = fit_grid(np.round(np.arange(500) / 300.0, 3))
    >>> round(1.0 / grid.interval, 6)
    300.0
    """
    t = finite(time, "time", (None,))
    if t.size < 2:
        raise InputError(f"{t.size} time stamps; a sampling interval needs 2 or more")
    steps = np.diff(t)
    usual = float(np.median(steps))
    usual = float(np.mean(steps[np.abs(steps - usual) <= 0.5 * usual]))
    places = np.concatenate([[0.0], np.cumsum(np.maximum(np.rint(steps / usual), 1.0))])
    start, interval = t[0], usual
    for _ in range(2):
        start, interval = _line(places, t)
        if interval <= 0.0:
            return None
        places = np.rint((t - start) / interval)
    start, interval = _line(places, t)
    jitter = float(np.sqrt(np.mean((t - start - interval * places) ** 2)))
    interval = _meant(interval, jitter, t, known)
    start = t[0] + float(np.mean(t - t[0] - interval * places))
    grid = Grid(start, interval, float(np.sqrt(np.mean((t - start - interval * places) ** 2))))
    numbers, off = grid.places(t)
    if numbers[0] != 0:  # the fitted start may lie a place beside the first stamp
        grid = grid._replace(start=grid.start + interval * float(numbers[0]))
    return grid if (np.diff(numbers) >= 1).all() and np.abs(off).max() <= MOST_OFF else None


def _line(places: Array, t: Array) -> tuple[float, float]:
    """Start and slope of the straight line through the stamps."""
    x, y = places - places.mean(), t - t[0]
    slope = float(x @ (y - y.mean()) / (x @ x)) if x.any() else 0.0
    return float(t[0] + y.mean() - slope * places.mean()), slope


def _meant(interval: float, jitter: float, t: Array, known: float | None) -> float:
    """The known or a round interval within the uncertainty of the one found; else the one found."""
    noise = jitter + float(np.spacing(np.abs(t).max()))
    room = 4.0 * noise * np.sqrt(12.0 / t.size**3) + 1e-9 * interval
    if known is not None and abs(known - interval) <= room:
        return known
    for digits in _DIGITS:
        for candidate in (1.0 / float(f"{1.0 / interval:.{digits - 1}e}"), float(f"{interval:.{digits - 1}e}")):
            if abs(candidate - interval) <= room:
                return candidate
    return interval
