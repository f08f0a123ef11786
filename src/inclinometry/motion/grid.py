"""The even grid behind a run's time stamps: interval and start, robust to jitter, rounding and dropped samples."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array, Index, finite
from inclinometry.core.errors import InputError

MOST_JITTER: Final = 0.3
"""Root mean square departure of stamps from the grid, in intervals, from which their places are no longer certain."""
MOST_SHARED: Final = 0.02
"""Share of stamps that may fall on a place that is taken."""
FIRST: Final = 64
"""Stamps the interval is searched with."""
CLEAR: Final = 0.7
"""Closeness of the first stamps' phases (1 - 2 (pi jitter)^2, of an interval) below which all are searched with."""
CERTAIN: Final = 1e-3
"""Uncertainty of an interval, as a share of it, below which a round one beside it is no chance."""
SHORTEST: Final = 2e-5
"""s, intervals between samples that are believed,"""
LONGEST: Final = 2.0
PLAUSIBLE: Final = (2e-4, 0.5)
"""and those that another unit is guessed from."""
TIME_UNITS: Final = {"milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9, "hours": 3600.0, "days": 86400.0}
_DIGITS: Final = (1, 2, 3, 4)
"""Significant digits of intervals and rates people choose."""


class Neighbour(NamedTuple):
    """The stamp before: the place nearest to it, and whether it was written late."""

    nearest: int
    late: bool


NOBODY: Final = Neighbour(-10, False)
"""Before the first stamp of a stretch."""


class Grid(NamedTuple):
    """Place k of the grid is at `start` + k `interval`.

    start, interval : s.
    jitter : root mean square departure of the stamps it was fitted to, s.
    """

    start: float
    interval: float
    jitter: float

    def places(self, time: Array, before: Neighbour, *, final: bool) -> tuple[Index, Array, Neighbour]:
        """Place of each stamp, departure from it in intervals, and what the stamps that follow need to know.

        The last stamp only helps with the one before it, unless it is `final`. A stamp nearest to the place of its
        neighbour, beside an empty place, belongs to the empty one: it was written late, or early.
        """
        position = (time - self.start) / self.interval
        nearest = np.rint(position).astype(np.intp)
        above = np.concatenate([[before.nearest], nearest[:-1]])
        below = np.concatenate([nearest[1:], nearest[-1:] + 1])
        late = (nearest - above >= 2) & (below == nearest)
        early = (nearest == above) & (below - nearest >= 2) & ~np.concatenate([[before.late], late[:-1]])
        number = nearest - late + early
        count = time.size if final else time.size - 1
        after = Neighbour(int(nearest[count - 1]), bool(late[count - 1])) if count else before
        return number[:count], (position - number)[:count], after


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
    Of intervals about the median step the one is taken that brings the first stamps' phases closest together; they are
    numbered, a straight line is fitted and numbers twice as many, until all are. The slope's standard deviation is
    s sqrt(12 / n^3); an interval or a rate of up to four digits within four of it is taken for what was meant.

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
    count = min(t.size, FIRST)
    start, interval, clear = _coarse(t[:count])
    if clear < CLEAR:
        # stamps that jitter this much hide the interval from a few of them
        count = t.size
        start, interval, _ = _coarse(t)
    while interval > 0.0:
        places = np.rint((t[:count] - start) / interval)
        start, interval = _line(places, t[:count])
        if count == t.size:
            break
        count = min(2 * count, t.size)
    if interval <= 0.0:
        return None
    places = np.rint((t - start) / interval)
    start, interval = _line(places, t)
    jitter = float(np.sqrt(np.mean((t - start - interval * places) ** 2)))
    interval = _meant(interval, jitter, t, known)
    start = t[0] + float(np.mean(t - t[0] - interval * places))
    grid = Grid(start, interval, float(np.sqrt(np.mean((t - start - interval * places) ** 2))))
    numbers, off, _ = grid.places(t, NOBODY, final=True)
    shared = float(np.mean(np.diff(numbers) < 1))
    good = shared <= MOST_SHARED and float(np.sqrt(np.mean(off**2))) <= MOST_JITTER
    # the first stamp's place is number 0
    return grid._replace(start=grid.start + interval * float(numbers[0])) if good else None


def unit_doubt(interval: float) -> str:
    """What is to be said of an interval that no sensor of a moving tool has; empty for a usual one.

    Parameters
    ----------
    interval : float
        s.

    Examples
    --------
    >>> unit_doubt(0.01), unit_doubt(5.0)
    ('', 'the stamps are 5 s apart; are they in milliseconds? time_s is in seconds: divide by 1000')
    """
    if SHORTEST <= interval <= LONGEST:
        return ""
    said = f"the stamps are {interval:.6g} s apart"
    for unit, factor in TIME_UNITS.items():
        if PLAUSIBLE[0] <= interval * factor <= PLAUSIBLE[1]:
            way = f"divide by {1.0 / factor:.6g}" if factor < 1.0 else f"multiply by {factor:.6g}"
            return f"{said}; are they in {unit}? time_s is in seconds: {way}"
    return f"{said}; a moving tool is sampled every {SHORTEST:g} to {LONGEST:g} s, in seconds"


def _coarse(t: Array) -> tuple[float, float, float]:
    """Start and interval that bring the phases of the stamps closest together, and how close: 1 is one phase."""
    usual = float(np.median(np.diff(t)))
    tried = usual * np.concatenate([[1.0], np.arange(0.7, 1.3, 0.1 / t.size)])
    phasor = np.concatenate(
        [
            np.exp(2j * np.pi * (t - t[0]) / some[:, None]).mean(axis=1)
            for some in np.array_split(tried, max(tried.size // 512, 1))
        ]
    )
    best = int(np.abs(phasor).argmax())
    start = float(t[0] + np.angle(phasor[best]) / (2.0 * np.pi) * tried[best])
    return start, float(tried[best]), float(np.abs(phasor[best]))


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
    if room > CERTAIN * interval:
        return interval
    for digits in _DIGITS:
        for candidate in (1.0 / float(f"{1.0 / interval:.{digits - 1}e}"), float(f"{interval:.{digits - 1}e}")):
            if abs(candidate - interval) <= room:
                return candidate
    return interval
