"""Backward pass over the robust filter: every row with all rows before and after it, for what was recorded."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np

from inclinometry.arrays import Array
from inclinometry.errors import IdentifiabilityError
from inclinometry.motion._hole_direction import offset_of, turned
from inclinometry.motion.result import BITS, Attitude, Samples
from inclinometry.motion.window_filter import (
    Belief,
    RobustStream,
    Stream,
    WindowFilterSettings,
    attitude_of,
    measured,
    predicted_frame,
    process,
    transition,
)
from inclinometry.uncertainty import UNKNOWN

# A filter that is only run where it is wanted: the windows before are kept, and it catches up with them first.


class LazyStream:
    """A stream of whole windows that works only while its rows are asked for.

    Parameters
    ----------
    make : callable
        A fresh stream that gives one row a window.
    """

    def __init__(self, make: Callable[[], Stream]) -> None:
        self._make = make
        self._kept: deque[tuple[bool, Samples]] = deque()
        self._stream: Stream | None = None
        self._unwanted = 0

    def restart(self) -> None:
        """A gap: nothing before it holds for what comes."""
        self._kept.clear()
        self._stream = None

    def take(self, window: Samples, *, good: bool, wanted: bool) -> Attitude | None:
        """The window's row where it is wanted, None where there is none; `good`: it could be started from."""
        self._unwanted = 0 if wanted else self._unwanted + 1
        if self._stream is not None and _many(window, self._unwanted):
            self._stream = None  # what is kept now catches up as well
        # the newest windows; the first of them is one to start from
        self._kept.append((good, window))
        while _many(window, len(self._kept)):
            self._kept.popleft()
        while self._kept and not self._kept[0][0]:
            self._kept.popleft()
        if self._stream is not None:
            row = self._pushed(window)
            return row if wanted else None
        row = None
        if wanted and self._kept:
            self._stream = self._make()
            for _, one in self._kept:
                row = self._pushed(one)
        return row

    def _pushed(self, window: Samples) -> Attitude | None:
        """Row of a window; a filter that cannot start is given up."""
        if self._stream is None:
            return None
        try:
            found = self._stream.push(window)
        except IdentifiabilityError:
            self._stream = None
            return None
        return found if len(found) == 1 else None


def _many(window: Samples, count: int) -> bool:
    """Whether so many windows are more than are kept."""
    # the filter's bias and scale have settled after 120 s
    return count > 1 and (len(window) * count > 500_000 or len(window) * count * window.interval > 120.0)


def single(rows: Attitude | None) -> bool:
    """Whether there is a row with an attitude."""
    return rows is not None and len(rows) == 1 and not bool(np.isnan(rows.quaternion[0, 0]))


# Uncertainty of a mean from the samples themselves: correlation by batch means, rounding by its own law.


def batch_means(values: Array, batches: int) -> Array:
    """Means (b, c) of equal consecutive batches of the samples (n, c); the last n mod b samples are left out.

    Examples
    --------
    >>> batch_means(np.arange(5.0)[:, None], 2)[:, 0]
    array([0.5, 2.5])
    """
    length = len(values) // batches
    return np.asarray(values[: batches * length].reshape(batches, length, -1).mean(axis=1))


def covariance_of_mean(deviations: Array) -> Array:
    """Covariance (p, p) of the mean of batch means (b, p) that are given as deviations from their mean.

    S / b with S the covariance of the b batch means, times nu / (nu - p - 1), nu = b - 1: with S estimated,
    e' S^-1 e follows Hotelling's law, whose mean is that factor times p; so the normalised squared error has mean p.
    Correlation shorter than a batch is counted in full (batch means: Schmeiser 1982, Operations Research 30, 556-568).
    """
    count, size = deviations.shape
    freedom = count - 1
    centred = deviations - deviations.mean(axis=0)
    return np.asarray(centred.T @ centred / (freedom * count) * (freedom / (freedom - size - 1.0)))


def rounding_variance(values: Array, resolution: float) -> Array:
    """Variance (c,) of the mean of samples (n, c) that were rounded to a step, by the rounding alone.

    sum_k q^2 / (2 pi^2 k^2) exp(-4 pi^2 k^2 s^2 / q^2) (Widrow and Kollar, Quantization Noise, 2008, sec. 4): q^2/12
    without noise and nothing from s = q/2. The step q is the range over the number of distinct values less one, s^2
    the variance less q^2/12. A channel with one or two values has q^2/12; one that never changes takes the largest
    step of the others, or `resolution`.
    """
    distinct = np.array([np.unique(column).size for column in values.T])
    step = np.where(distinct > 1, np.ptp(values, axis=0) / np.maximum(distinct - 1, 1), 0.0)
    step = np.where(distinct > 1, step, step.max() if step.any() else resolution)
    noise = np.where(distinct > 2, np.maximum(values.var(axis=0) - step**2 / 12.0, 0.0), 0.0)
    terms = 8  # of the rounding error's series; the ninth adds 0.8 % of q^2 / 12 at most
    order = np.arange(1, terms + 1)[:, None]
    ratio = noise / np.where(step > 0.0, step, 1.0) ** 2
    series = np.exp(-4.0 * np.pi**2 * order**2 * ratio) / order**2
    total = series.sum(axis=0) * (np.pi**2 / 6.0) / (1.0 / np.arange(1, terms + 1) ** 2).sum()
    return np.asarray(step**2 / (2.0 * np.pi**2) * total)


def smooth_windows(rows: Attitude, settings: WindowFilterSettings | None = None) -> Attitude:
    """The robust filter forward over window attitudes, then the Rauch-Tung-Striebel pass back (AIAA J. 3(8), 1965).

    K = P F' (P-)^-1, x_s = x + K (x_s,next - x-), P_s = P + K (P_s,next - P-) K'; differences of directions are turn
    vectors. P- is the one after the adaptive factor: nothing leaks backward across a bend. The toolface of a measured
    row is its own, corrected through its correlation; that of a bridged row the filter's. Rows before the filter's
    start are predicted backward from it.
    """
    chosen = settings or WindowFilterSettings()
    stream = RobustStream(chosen)
    steps = stream.steps(rows) + stream.last_steps()
    smoothed = list(steps)
    later: Belief | None = None
    seen_at = np.inf
    for place in range(len(steps) - 1, -1, -1):
        step = steps[place]
        if step.belief is None:
            if later is not None and seen_at - step.row.time <= chosen.longest_bridge:
                # a row the filter had not started at, from the belief after it and its own attitude where it has one
                dt = later.time - step.row.time
                f = transition(-dt)
                added = process(dt, chosen.direction_walk, chosen.rate_walk)
                spread = f @ (later.covariance + added) @ f.T
                predicted = Belief(step.row.time, predicted_frame(later, -dt), later.rate, spread, later.common)
                row = step.row._replace(flags=step.row.flags & ~BITS["start"])
                if row.matrix is not None and row.covariance is not None:
                    smoothed[place] = measured(chosen, row, row.matrix, row.covariance, predicted, 1.0)[0]
                else:
                    tool = predicted.carried(0.0, UNKNOWN**2)
                    smoothed[place] = step._replace(
                        row=row, belief=predicted, matrix=tool[0], covariance=tool[1], common=tool[2], quality=0.0
                    )
                later = smoothed[place].belief
            else:
                later = None
        else:
            following = steps[place + 1].predicted if place + 1 < len(steps) else None
            later = step.belief if later is None or following is None else _back(step.belief, following, later)
            # the tool's attitude rebuilt on the smoothed direction
            matrix, own = step.row.matrix, step.row.covariance
            if matrix is not None and own is not None:
                found = later.tool(matrix, step.factor * own, step.row.common)
            else:
                found = later.carried(step.roll, step.roll_variance)
            common = None if step.common is None else found[2]
            smoothed[place] = step._replace(matrix=found[0], covariance=found[1], common=common, belief=later)
        seen_at = step.row.time if step.row.matrix is not None else seen_at
    return attitude_of(smoothed, rows.north, "smoother", rows.findings)


def _back(belief: Belief, predicted: Belief, later: Belief) -> Belief:
    """One step backward."""
    f = transition(predicted.time - belief.time)
    gain = np.linalg.solve(predicted.covariance, f @ belief.covariance).T
    change = gain @ np.concatenate([offset_of(predicted.frame, later.frame[2]), later.rate - predicted.rate])
    covariance = belief.covariance + gain @ (later.covariance - predicted.covariance) @ gain.T
    frame = turned(belief.frame, change[:2])
    return Belief(belief.time, frame, belief.rate + change[2:], 0.5 * (covariance + covariance.T), belief.common)
