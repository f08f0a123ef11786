"""Still stations in a continuous log: found without an initial rest, each one accounted for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inclinometry.arrays import Array, finite, frozen, increasing, within
from inclinometry.calibration.readings import BenchReadings
from inclinometry.constants import KINDS
from inclinometry.errors import not_among, refused, wrong_shape
from inclinometry.findings import Finding, Value
from inclinometry.tabular import Column, Tabular

# Moving windows over a log: variances in one pass, the noise floor, runs of quiet samples.

Run: TypeAlias = tuple[int, int]
"""First sample and one past the last."""


class Windows(NamedTuple):
    """Centred windows of 2 half + 1 samples that never reach across a gap."""

    half: int
    gaps: NDArray[np.int64]  #: indices of the first sample after each gap


def sampling_period(time: Array) -> tuple[float, NDArray[np.int64]]:
    """Median step of the time column, s, and where steps of more than five of these leave a gap."""
    steps = np.diff(time)
    if len(steps) == 0:
        raise refused("input-few", {"name": "samples", "count": len(time), "least": 2})
    increasing(time, "time_s")
    period = float(np.median(steps))
    return period, np.flatnonzero(steps > 5.0 * period).astype(np.int64) + 1


def quantisation_variance(x: Array) -> Array:
    """Rounding noise q^2 / 12 of each channel, q the smallest step between neighbours; 0 for a channel that rests."""
    steps = np.abs(np.diff(x, axis=0))
    smallest = np.where(steps > 0.0, steps, np.inf).min(axis=0)
    return np.asarray(np.where(np.isfinite(smallest), smallest, 0.0) ** 2 / 12.0)


def moving_variance(x: Array, windows: Windows) -> Array:
    """Variance (divisor n - 1) of each channel in the window around each sample, (N, c).

    Samples nearer than half a window to an end or a gap take the nearest whole window; pieces shorter than a window
    are infinitely noisy.
    """
    out = np.full(x.shape, np.inf)
    edges = [0, *windows.gaps.tolist(), len(x)]
    width = 2 * windows.half + 1
    for start, stop in pairwise(edges):
        if stop - start < width:
            continue
        for channel in range(x.shape[1]):
            piece = x[start:stop, channel]
            # variance of every whole window of a centred series, by cumulative sums
            centred = piece - piece.mean()
            first = np.concatenate([[0.0], np.cumsum(centred)])
            second = np.concatenate([[0.0], np.cumsum(centred * centred)])
            total = first[width:] - first[:-width]
            square = second[width:] - second[:-width]
            out[start + windows.half : stop - windows.half, channel] = np.asarray(
                np.maximum(square - total * total / width, second[-1] * 1e-15) / (width - 1)
            )
        out[start : start + windows.half] = out[start + windows.half]
        out[stop - windows.half : stop] = out[stop - windows.half - 1]
    return out


def noise_floor(variance: Array, ratio: float) -> Array:
    """Variance of each channel at rest, (c,): fixed point of the median over the samples it calls still.

    Entered from the quietest fiftieth of the windows, so that long motion does not hide a short rest.
    """
    usable = variance[np.isfinite(variance).all(axis=1)]
    if len(usable) == 0:
        raise refused("fit-log-gaps")
    # a tenth of a million windows tell the floor as well as all of them
    sample = usable[:: max(len(usable) // 50_000, 1)]
    floor = np.maximum(np.quantile(sample, 0.02, axis=0), np.finfo(float).tiny)
    for _ in range(50):
        still = np.mean(sample / floor, axis=1) < ratio
        # a channel whose noise moves on its own can leave nothing below the line: widen the floor instead of giving up
        updated = np.median(sample[still], axis=0) if still.any() else floor * ratio
        if np.allclose(updated, floor, rtol=1e-6, atol=0.0):  # of any unit: (rad/s)^2 may be 1e-11 of a count squared
            break
        floor = np.maximum(updated, np.finfo(float).tiny)
    return np.asarray(floor)


def otsu(positive: Array) -> float:
    """Threshold that best parts the logarithms of positive numbers into two heaps (Otsu 1979)."""
    finite = positive[np.isfinite(positive)]
    logs = np.sort(np.log(np.maximum(finite[:: max(len(finite) // 50_000, 1)], np.finfo(float).tiny)))
    n = len(logs)
    below = np.arange(1, n)
    sums = np.cumsum(logs)
    apart = below * (n - below) * (sums[:-1] / below - (sums[-1] - sums[:-1]) / (n - below)) ** 2
    cut = int(np.argmax(apart))
    return float(np.exp((logs[cut] + logs[cut + 1]) / 2.0))


def runs(flags: NDArray[np.bool_], gaps: NDArray[np.int64]) -> list[Run]:
    """(start, stop) of each run of True; a gap ends a run."""
    padded = np.concatenate([[False], flags, [False]])
    edges = np.flatnonzero(padded[1:] != padded[:-1])
    out: list[Run] = []
    for start, stop in edges.reshape(-1, 2).tolist():
        cuts = [int(g) for g in gaps[(gaps > start) & (gaps < stop)]]
        out += list(zip([start, *cuts], [*cuts, stop], strict=True))
    return out


@dataclass(frozen=True, eq=False, repr=False)
class StillIntervals(Tabular):
    """What was found in a log and what was dropped."""

    intervals: NDArray[np.int64]  #: (n, 2) first sample and one past the last of each still interval, in order
    dropped: Sequence[tuple[int, int, Finding]]  #: (start, stop, why) of every other stretch that was quiet for a while
    noise_sd: Array  #: (c,) standard deviation of each channel at rest, estimated from the log; in the channel's unit
    period: float  #: s, sampling interval
    samples: int  #: length of the log

    def __len__(self) -> int:
        return len(self.intervals)

    def pairs(self) -> list[tuple[int, int]]:
        """The intervals as (start, stop) of int, ready for slicing."""
        return [(int(a), int(b)) for a, b in self.intervals]

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What was found, and what was dropped and why, as notes."""
        still = int(sum(b - a for a, b in self.pairs()))
        values: dict[str, Value] = {"stations": len(self), "span_s": self.samples * self.period}
        values |= {"rate_Hz": 1.0 / self.period, "still_percent": 100.0 * still / self.samples}
        return Finding("fit-still", values, severity="note"), *(why for _, _, why in self.dropped)

    def to_dict(self) -> dict[str, Column]:
        """One row a still interval: its first sample, one past its last, its length."""
        first, end = self.intervals.T
        return {"first_sample": first, "end_sample": end, "length_s": (end - first) * self.period}


def still_intervals(
    time: ArrayLike,
    channels: ArrayLike,
    *,
    window: float = 0.5,
    shortest: float = 1.0,
    ratio: float = 4.0,
) -> StillIntervals:
    """Where a logged tool was at rest: variance in a window below `ratio` times the noise at rest, mean over channels.

    At 4 a window of 20 samples of pure noise counts as moving less than once in 1e8. The noise is the fixed point of
    "median window variance over the still samples", from the quietest fiftieth of the windows: no initial rest is
    needed. Rests in the hand shake more: a stretch without calm rest, below the valley in the histogram of log variance
    (Otsu 1979) and not turning slowly, is a station too. `time`, `window` and `shortest` are in s.
    """
    t = finite(time, "time", (None,))
    x = finite(channels, "channels", (None, None))
    if t.ndim != 1 or x.ndim != 2 or len(x) != len(t):
        raise wrong_shape("channels", x.shape, f"({len(t)}, c)")
    within(window, "window", 0.0, 3600.0, "s")
    within(shortest, "shortest", 0.0, 86400.0, "s")
    within(ratio, "ratio", 1.5, 1e6)
    period, gaps = sampling_period(t)
    half = max(round(window / period) // 2, 2)
    if len(t) < 4 * half + 2:
        raise refused("input-few", {"name": "samples", "count": len(t), "least": 4 * half + 2})
    windows = Windows(half, gaps)
    rounding = quantisation_variance(x)
    alive = np.ptp(x, axis=0) > 0.0
    if not alive.any():
        raise refused("fit-signals-constant", {"channels": ("all",)})
    variance = np.maximum(moving_variance(x[:, alive], windows), rounding[alive])
    floor = noise_floor(variance, ratio)
    activity = np.mean(variance / floor, axis=1)
    noise = np.zeros(x.shape[1])
    noise[alive] = np.sqrt(floor)
    found, dropped = _judge(t, x, noise, gaps, activity, ratio, shortest)
    return StillIntervals(np.array(found, dtype=np.int64).reshape(-1, 2), tuple(dropped), frozen(noise), period, len(t))


def _judge(
    time: Array,
    signals: Array,
    noise: Array,
    gaps: NDArray[np.int64],
    activity: Array,
    ratio: float,
    shortest: float,
) -> tuple[list[Run], list[tuple[int, int, Finding]]]:
    """Rests at the noise of rest; then rests that only shake (a hand); what remains is dropped with a reason."""
    calm = [run for run in runs(activity < ratio, gaps) if time[run[1] - 1] - time[run[0]] >= shortest]
    largest = np.ptp(signals, axis=0)
    # join neighbouring rests parted by less than a second whose means agree: a knock, not a move.
    # a change of 0.003 makes the joint mean shorter than its parts by less than its square / 2 only
    found: list[Run] = []
    for rest in calm:
        if found and time[rest[0]] - time[found[-1][1] - 1] < 1.0 and not np.isin(rest[0], gaps):
            before, after = (signals[a:b].mean(axis=0) for a, b in (found[-1], rest))
            # change of a channel's mean across a short disturbance, as a share of its range, up to which it is one
            # station
            if np.all(np.abs(after - before) <= np.maximum(0.5 * noise, 0.003 * largest)):
                found[-1] = (found[-1][0], rest[1])
                continue
        found.append(rest)
    dropped: list[tuple[int, int, Finding]] = []
    limit = max(ratio, otsu(activity))
    for run in runs(activity < limit, gaps):
        if any(start < run[1] and stop > run[0] for start, stop in calm):
            continue
        begin, end = run
        lasts, third = float(time[end - 1] - time[begin]), max((end - begin) // 3, 1)
        # from the first to the last third
        change = signals[end - third : end].mean(axis=0) - signals[begin : begin + third].mean(axis=0)
        moved = float(np.max(np.abs(change) / np.maximum(largest, np.finfo(float).tiny)))
        if lasts < 0.25 * shortest:
            continue  # a flicker: the turning point of a motion, not a rest
        if lasts < shortest:
            values: dict[str, Value] = {"first": begin, "last": end, "lasts_s": lasts, "least_s": shortest}
            dropped.append((*run, Finding("fit-rest-short", values, severity="note")))
        elif moved > 0.01:  # of a channel's range over the log: more is a motion, no shaky rest
            values = {"first": begin, "last": end, "moved_percent": 100.0 * moved}
            dropped.append((*run, Finding("fit-rest-turning", values, severity="note")))
        else:
            found.append(run)
    return sorted(found), dropped


def stations_from_log(
    time: ArrayLike,
    channels: Mapping[str, ArrayLike],
    *,
    temperature: ArrayLike | None = None,
    units: Mapping[str, str] | None = None,
    window: float = 0.5,
    shortest: float = 1.0,
    ratio: float = 4.0,
) -> tuple[BenchReadings, StillIntervals]:
    """Turn a continuous log into bench readings: one row for each rest, means with their scatter, none lost.

    Parameters
    ----------
    time : (N,) array_like
        s.
    channels : mapping of kind to (N, m) array_like
        Signals of each triad; all of them together decide whether the tool is still.
    temperature : (N,) array_like, optional
        degC, averaged over each rest.
    units : mapping of kind to str, optional
    window, shortest, ratio
        As in `still_intervals`.

    Returns
    -------
    BenchReadings
        Without rig angles. `sd` is the standard deviation of each mean, from the scatter of the means of up to ten
        blocks where that is more than white noise gives; `count` the samples averaged; `findings` of the intervals.
    StillIntervals
        Where the rows come from and what was dropped.

    Raises
    ------
    InputError
        Bad shapes, or no rest in the whole log.

    Examples
    --------
    >>> noise = np.random.default_rng(0)
    >>> time = np.arange(2000) / 100.0
    >>> level = np.where(time < 8, 1.0, np.where(time < 12, time, 3.0))[:, None] * [1, 2, 3]
    >>> readings, found = stations_from_log(time, {"accelerometer": level + noise.normal(0, 0.01, (2000, 3))})
    >>> len(readings), readings.channels["accelerometer"].round(1).tolist()
    (2, [[1.0, 2.0, 3.0], [3.0, 6.0, 9.0]])
    """
    arrays = {kind: finite(channels[kind], kind, (None, None)) for kind in KINDS if kind in channels}
    if not arrays or set(channels) - set(KINDS):
        raise not_among("channels", ", ".join(sorted(channels)), KINDS)
    length = len(finite(time, "time", (None,)))
    for kind, values in arrays.items():
        if values.shape[:-1] != (length,):
            raise wrong_shape(kind, values.shape, f"({length}, m)")
    found = still_intervals(time, np.hstack(list(arrays.values())), window=window, shortest=shortest, ratio=ratio)
    pairs = found.pairs()
    if not pairs:
        raise refused("fit-never-still", {"least_s": shortest})
    degrees = None if temperature is None else finite(temperature, "temperature", (length,))
    readings = BenchReadings(
        {kind: np.array([values[a:b].mean(axis=0) for a, b in pairs]) for kind, values in arrays.items()},
        sd={kind: np.array([sd_of_mean(values[a:b]) for a, b in pairs]) for kind, values in arrays.items()},
        count=np.array([float(b - a) for a, b in pairs]),
        temperature=None if degrees is None else np.array([degrees[a:b].mean() for a, b in pairs]),
        units=units or {},
        findings=found.findings,
    )
    return readings, found


def sd_of_mean(samples: Array, blocks: int = 10) -> Array:
    """Standard deviation of the mean of (n, m) samples: the larger of white noise and scatter of block means."""
    n = len(samples)
    white = samples.std(axis=0, ddof=1) / np.sqrt(n)
    # blocks of fewer than 8 samples would only repeat the white noise with less certainty
    count = min(blocks, n // 8)
    if count < 3:
        return np.asarray(white)
    size = n // count
    means = samples[: count * size].reshape(count, size, -1).mean(axis=1)
    return np.asarray(np.maximum(white, means.std(axis=0, ddof=1) / np.sqrt(count)))
