"""A bias that wanders from one index position to the next, seen by what no field and no calibration can do."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite


def bias_walk(station: ArrayLike, index: ArrayLike, signals: ArrayLike, noise: ArrayLike) -> float:
    """Variance of the bias's step from reading to reading over a reading's noise variance; 0 where not significant.

    M = 1 - D D^+, D = (cos index, sin index, 1 and, of six readings or more, time), leaves neither field nor errors of
    the calibration: both turn with the index or are constant. With r = M y / noise and W the covariance of a walk of
    unit steps, E r'Wr = tr MW + w tr MWMW: the score test of w = 0, locally the most powerful, and its estimate. Four
    positions keep one such r a channel, in which a walk has half the variance of its step.
    """
    names, angle = np.asarray(station), finite(index, "index", (None,))
    whitened = finite(signals, "signals", (None, None)) / finite(noise, "noise", (None, None))
    starts = np.flatnonzero(np.append(True, names[1:] != names[:-1]))
    excess = curvature = 0.0
    for begin, end in zip(starts, np.append(starts[1:], len(names)), strict=True):
        size, beta = int(end - begin), angle[begin:end]
        step = np.arange(size) - 0.5 * (size - 1)
        columns = [np.cos(beta), np.sin(beta), np.ones(size), *([step] if size >= 6 else [])]
        if size <= len(columns):
            continue
        basis = np.linalg.qr(np.stack(columns, axis=1))[0]
        # a walk's covariance is L L', L ones on and below the diagonal: L'r are the sums of r from the end
        left = whitened[begin:end] - basis @ (basis.T @ whitened[begin:end])
        summed = np.cumsum(left[::-1], axis=0)
        steps = np.tril(np.ones((size, size)))
        steps -= basis @ (basis.T @ steps)
        own = steps.T @ steps  # L'ML has the traces of MW
        excess += float(np.sum(summed**2)) - left.shape[1] * float(np.trace(own))
        curvature += left.shape[1] * float(np.sum(own**2))
    # two standard deviations: one run in 44 without a walk counts one
    if excess <= 2.0 * np.sqrt(2.0 * curvature):
        return 0.0
    return excess / curvature


def walk_covariance(by_reading: Array, walk: float) -> Array:
    """Covariance (S, q, q) of estimates by a walk of that variance a step, noise variances.

    Parameters
    ----------
    by_reading : (S, q, P, m) derivatives of the estimates by the readings of P rows and m channels over their noise.
    walk : float
    """
    # a step moves all readings from its own on; where the bias began is fitted
    moved = np.cumsum(by_reading[:, :, ::-1], axis=2)[:, :, :-1].reshape(*by_reading.shape[:2], -1)
    return np.asarray(walk * moved @ moved.swapaxes(1, 2))
