"""Fewer samples without what would fold onto them: a low-pass before every n-th sample is taken."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, finite
from inclinometry.errors import InputError, out_of_range, refused
from inclinometry.findings import Finding, Value
from inclinometry.motion.magnetic.demodulate import Held
from inclinometry.motion.result import CHANNELS, Fault, Samples
from inclinometry.motion.turning import Turning
from inclinometry.tabular import check_record

# Sampling too slow for the rotation.


def aliasing_faults(turning: Turning, interval: float) -> list[Fault]:
    """Whether the phase between samples is ambiguous, and the rate that would be needed.

    Without a gyro a steady rotation faster than half a turn a sample looks like a slower one and cannot be told; one
    that changes its speed passes through half a turn and is.
    """
    if not turning.by:
        return []
    most_step = 0.75 * np.pi  # rotation between samples, rad, beyond which its direction is no longer sure
    share = turning.step / most_step
    turns = turning.span / (2.0 * np.pi)
    # turns by which gyro and field may differ, and of the turns made what a gyro's scale error leaves
    lost = abs(turning.lost) / (0.5 + 0.02 * turns)
    # lost turns with steps that are small are a matter of axes or of the field, not of sampling
    if not (share > 1.0 or (lost > 1.0 and turning.step > 0.5 * most_step)):
        return []
    turns_a_second = float(turning.step / interval / (2.0 * np.pi))
    samples_a_turn = 8.0  # to follow a speed that changes
    values = {"interval_s": interval, "speed_rpm": 60.0 * turns_a_second, "rate_Hz": samples_a_turn * turns_a_second}
    return [Fault("motion-sampled-slowly", values, "aliased", turning.by, True)]


# The even grid behind a run's time stamps: interval and start, robust to jitter, rounding and dropped samples.

MOST_JITTER: Final = 0.3
"""Root mean square departure of stamps from the grid, in intervals, from which their places are no longer certain."""


NOBODY: Final = (-10, False)
"""Before the first stamp of a stretch: the place nearest to the stamp before, and whether that was written late."""


class Grid(NamedTuple):
    """Place k of the grid is at `start` + k `interval`.

    start, interval : s.
    jitter : root mean square departure of the stamps it was fitted to, s.
    """

    start: float
    interval: float
    jitter: float

    def places(self, time: Array, before: tuple[int, bool], *, final: bool) -> tuple[Index, Array, tuple[int, bool]]:
        """Place of each stamp, departure from it in intervals, and what the stamps that follow need to know.

        The last stamp only helps with the one before it, unless it is `final`. A stamp nearest to the place of its
        neighbour, beside an empty place, belongs to the empty one: it was written late, or early.
        """
        position = (time - self.start) / self.interval
        nearest = np.rint(position).astype(np.intp)
        above = np.concatenate([[before[0]], nearest[:-1]])
        below = np.concatenate([nearest[1:], nearest[-1:] + 1])
        late = (nearest - above >= 2) & (below == nearest)
        early = (nearest == above) & (below - nearest >= 2) & ~np.concatenate([[before[1]], late[:-1]])
        number = nearest - late + early
        count = time.size if final else time.size - 1
        after = (int(nearest[count - 1]), bool(late[count - 1])) if count else before
        return number[:count], (position - number)[:count], after


def fit_grid(time: ArrayLike, known: float | None = None) -> Grid | None:
    """Even grid through increasing stamps (n,), s, with some places empty; None where there is no such grid.

    Of intervals about the median step the one is taken that brings the first stamps' phases closest together; they are
    numbered, a straight line is fitted and numbers twice as many, until all are. The slope's standard deviation is s
    sqrt(12 / n^3); an interval or a rate of up to four digits within four of it is taken for what was meant. A `known`
    interval, s, is kept when the stamps do not contradict it.
    """
    t = finite(time, "time", (None,))
    if t.size < 2:
        raise refused("input-few", {"name": "time stamps", "count": int(t.size), "least": 2})
    # stamps the interval is searched with
    count = min(t.size, 64)
    start, interval, clear = _coarse(t[:count])
    # closeness of the first stamps' phases, 1 - 2 (pi jitter)^2 of an interval
    if clear < 0.7:
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
    # share of stamps that may fall on a place that is taken
    good = shared <= 0.02 and float(np.sqrt(np.mean(off**2))) <= MOST_JITTER
    # the first stamp's place is number 0
    return grid._replace(start=grid.start + interval * float(numbers[0])) if good else None


def check_interval(interval: float) -> None:
    """Refuse an interval, s, that no sensor of a moving tool has.

    >>> check_interval(5.0)
    Traceback (most recent call last):
    inclinometry.errors.InputError: Stamps are 5 s apart: time_s seems to be in milliseconds. Multiply the stamps by
    0.001.
    """
    shortest = 2e-5  # s, intervals between samples that are believed
    longest = 2.0
    if shortest <= interval <= longest:
        return
    plausible = (2e-4, 0.5)  # s, those that another unit is guessed from
    units = {"milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9, "hours": 3600.0, "days": 86400.0}
    for unit, factor in units.items():
        if plausible[0] <= interval * factor <= plausible[1]:
            values: dict[str, Value] = {"interval_s": interval, "unit": unit, "factor": factor}
            raise InputError(Finding("motion-stamps-unit", values, severity="refused"))
    limits = {"interval_s": interval, "shortest_s": shortest, "longest_s": longest}
    raise InputError(Finding("motion-interval", limits, severity="refused"))


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
    margin = 4.0 * noise * np.sqrt(12.0 / t.size**3) + 1e-9 * interval
    if known is not None and abs(known - interval) <= margin:
        return known
    # beyond this share a round interval beside the one found may be chance
    if margin > 1e-3 * interval:
        return interval
    # significant digits of intervals and rates people choose
    for digits in (1, 2, 3, 4):
        for candidate in (1.0 / float(f"{1.0 / interval:.{digits - 1}e}"), float(f"{interval:.{digits - 1}e}")):
            if abs(candidate - interval) <= margin:
                return candidate
    return interval


def decimate(samples: Samples, factor: int) -> Samples:
    """Every `factor`-th sample of a run after a low-pass without delay.

    Parameters
    ----------
    samples : Samples
    factor : int
        1 to 1000.

    Returns
    -------
    Samples
        At `factor` times the interval. A sample's stamp is that of the middle of its filter: a live stream delivers 16
        new intervals late, but the stamps are not late. The first and last 16 new intervals of the run, where the
        filter is not full, are not returned. A sample is clipped when any under its filter was; temperature is taken,
        not filtered.

    Raises
    ------
    InputError
        A factor out of range, or one that leaves no interval.

    Notes
    -----
    Sinc under Kaiser's window (Oppenheim and Schafer, Discrete-Time Signal Processing, section 7.5.3), 32 taps per new
    sample, gain 1 at rest. Filtering before turning back mixes no rotation into another as long as it stays in the pass
    band: 0.3 x the new rate.

    Examples
    --------
    >>> time = np.arange(1000) / 1000.0
    >>> slow = decimate(Samples(time, 0.001, accel=np.tile([0.0, 0.0, 9.81], (1000, 1))), 10)
    >>> len(slow), round(float(slow.time[0]), 3), slow.accel[5].round(9)
    (68, 0.16, array([0.  , 0.  , 9.81]))
    """
    check_record(samples, Samples, "decimate")
    return DecimationStream(factor).push(samples)


class DecimationStream:
    """The same block by block, to the last bit; after a gap between blocks the filter begins again."""

    def __init__(self, factor: int) -> None:
        largest = 1000  # factor
        if not (isinstance(factor, int | np.integer) and 1 <= factor <= largest):
            raise out_of_range("factor", repr(factor), f"1, 2 .. {largest}")
        self._factor = int(factor)
        self._taps = low_pass(self._factor)
        self._held = Held()

    def push(self, samples: Samples) -> Samples:
        """Samples that became complete.

        Raises
        ------
        InputError
            Another interval or other triads than before, or a block that begins before the end of the last.
        """
        factor, size = self._factor, self._taps.size
        if not self._held.add(samples):
            self._held.clear()
            self._held.add(samples)
        count = len(self._held)
        if count < size:
            return _thinned(samples.part(0, 0), samples.time[:0], factor, self._taps)
        rows = (count - size) // factor + 1
        whole = (rows - 1) * factor + size
        thinned = _thinned(self._held.cut(0, whole), self._held.stamps(0, whole), factor, self._taps)
        self._held.drop(rows * factor)
        return thinned


@lru_cache(maxsize=32)
def low_pass(factor: int) -> Array:
    """Taps (32 factor + 1,), symmetric, sum 1; the single tap 1 for factor 1."""
    if factor == 1:
        return np.ones(1)
    half = 16 * factor
    place = np.arange(-half, half + 1)
    # up to 0.3 of the new rate the gain is 1 within 1e-5
    edge = (0.3 + 0.5) / factor  # twice the middle of the transition, cycles per sample
    # dB, of everything above half the new rate; 97 at its very edge
    taps = np.sinc(edge * place) * np.kaiser(2 * half + 1, 0.1102 * (100.0 - 8.7))
    taps = taps / taps.sum()
    taps.flags.writeable = False
    return np.asarray(taps)


def _thinned(samples: Samples, stamps: Array, factor: int, taps: Array) -> Samples:
    """Samples of which every one has its whole filter; none when there is not one."""
    size = taps.size
    rows = (len(samples) - size) // factor + 1 if len(samples) >= size else 0
    middle = slice((size - 1) // 2, (size - 1) // 2 + rows * factor, factor)
    columns: dict[str, Any] = {}
    for name in CHANNELS:
        values = getattr(samples, name)
        if values is not None:
            columns[name] = _filtered(values, factor, taps, rows)
    if samples.temperature is not None:
        columns["temperature"] = samples.temperature[middle]
    if samples.clipped is not None:
        total = np.concatenate([[0], np.cumsum(samples.clipped)])
        first = np.arange(rows) * factor
        columns["clipped"] = total[first + size] > total[first] if rows else np.zeros(0, dtype=np.bool_)
    return Samples(stamps[middle] if rows else stamps[:0], samples.interval * factor, **columns)


def _filtered(values: Array, factor: int, taps: Array, rows: int) -> Array:
    """Rows (rows, 3). Tap after tap over all rows: each sums its products in the same order, wherever it is cut."""
    out = np.zeros((3, rows))
    if not rows:
        return np.ascontiguousarray(out.T)
    whole = -(-values.shape[0] // factor) * factor
    padded = np.zeros((whole, 3))
    padded[: values.shape[0]] = values
    phases = np.ascontiguousarray(padded.reshape(-1, factor, 3).transpose(1, 2, 0))
    part = np.empty_like(out)
    for k, tap in enumerate(taps):
        first = k // factor
        np.multiply(phases[k % factor, :, first : first + rows], tap, out=part)
        out += part
    return np.ascontiguousarray(out.T)
