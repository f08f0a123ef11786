"""A bias that wanders from one index position to the next, seen by what no field and no calibration can do."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite

PLAIN = 2.0
"""Standard deviations by which a walk must stand out of the noise to count: one run in 44 without a walk counts one."""


def bias_walk(station: ArrayLike, index: ArrayLike, signals: ArrayLike, noise: ArrayLike) -> float:
    """Variance of the step that the bias takes from reading to reading, in units of the noise variance of a reading.

    Parameters
    ----------
    station : (K,) array_like
        Station of each reading, those of a station together and in order of time.
    index : (K,) array_like
        Index angle, rad.
    signals : (K, m) array_like
    noise : (K, m) array_like
        Standard deviation of one reading without a walk.

    Returns
    -------
    float
        0 where it is less than `PLAIN` standard deviations from none, or no station has readings enough to tell.

    Notes
    -----
    Of each channel at each station M = 1 - D D^+, D = (cos index, sin index, 1 and, of six readings or more, time),
    leaves what neither the field nor an error of the calibration can make: both turn with the index or stand still.
    With r = M y / noise and W the covariance of a walk of unit steps, E r'Wr = tr MW + w tr MWMW: the score test of
    w = 0, locally the most powerful, and its estimate; four positions keep one such r a channel, in which a walk has
    half the variance of its step.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> index, station = np.tile(np.radians([0.0, 90.0, 180.0, 270.0]), 500), np.repeat(np.arange(500), 4)
    >>> white = rng.standard_normal((2000, 2))
    >>> walk = np.cumsum(rng.standard_normal((2000, 2)), axis=0)
    >>> one = np.ones((2000, 2))
    >>> bias_walk(station, index, white, one), round(bias_walk(station, index, white + walk, one))
    (0.0, 1)
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
    if excess <= PLAIN * np.sqrt(2.0 * curvature):
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
