"""Moving windows over a log: variances in one pass, the noise floor, runs of quiet samples."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inclinometry.core.arrays import Array
from inclinometry.core.errors import InputError

Run: TypeAlias = tuple[int, int]
"""First sample and one past the last."""


class Windows(NamedTuple):
    """Centred windows of 2 half + 1 samples that never reach across a gap."""

    half: int
    gaps: NDArray[np.int64]  # indices of the first sample after each gap


def sampling_period(time: Array) -> tuple[float, NDArray[np.int64]]:
    """Median step of the time column, s, and where steps of more than five of these leave a gap."""
    steps = np.diff(time)
    if len(steps) == 0:
        raise InputError("the log has fewer than two samples")
    if np.any(steps <= 0.0):
        at = int(np.argmax(steps <= 0.0)) + 1
        raise InputError(f"time[{at}] is {time[at]:.10g} after {time[at - 1]:.10g}; times must increase: sort the log")
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
            out[start + windows.half : stop - windows.half, channel] = _running(piece - piece.mean(), width)
        out[start : start + windows.half] = out[start + windows.half]
        out[stop - windows.half : stop] = out[stop - windows.half - 1]
    return out


def _running(x: Array, width: int) -> Array:
    """Variance of every whole window of a centred series, by cumulative sums."""
    first = np.concatenate([[0.0], np.cumsum(x)])
    second = np.concatenate([[0.0], np.cumsum(x * x)])
    total = first[width:] - first[:-width]
    square = second[width:] - second[:-width]
    # cumulative sums of a long log lose digits: a variance below their rounding is not distinguishable from zero
    return np.asarray(np.maximum(square - total * total / width, second[-1] * 1e-15) / (width - 1))


def noise_floor(variance: Array, ratio: float) -> Array:
    """Variance of each channel at rest, (c,): fixed point of the median over the samples it calls still.

    Entered from the quietest fiftieth of the windows, so that long motion does not hide a short rest.
    """
    usable = variance[np.isfinite(variance).all(axis=1)]
    if len(usable) == 0:
        raise InputError("the log is all gaps: no stretch is as long as one window")
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
