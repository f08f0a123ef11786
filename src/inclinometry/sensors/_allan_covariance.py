"""How the points of an overlapping Allan curve vary together.

The record is the integrated rate theta sampled evenly; a point is the mean square of second differences
D_m(k) = (theta[k + 2 m] - 2 theta[k + m] + theta[k]) / (sqrt(2) m). For noise that is Gaussian

    cov(v_m, v_m') = mean over k, k' of 2 c(k' - k)^2,      c(l) = cov(D_m(k), D_m'(k + l)),

and c follows from the generalised covariance G of theta, of which second differences need nothing but (time in samples)

    white rate, N = 1: G = -|t| / 2;  flicker, B = 1: G = t^2 ln|t| / (2 pi);  random walk, K = 1: G = |t|^3 / 12;
    quantisation, Q = 1: G = 1 at t = 0 and 0 elsewhere;  a ramp of rate, R = 1, has c = 0 and mean D = m / sqrt(2).

G gives the mean as well: v_m = (6 G(0) - 8 G(m) + 2 G(2 m)) / (2 m^2), the usual terms of IEEE Std 952-1997, annex C.
"""

from __future__ import annotations

import numpy as np

from inclinometry.core.arrays import Array, Index

_WEIGHTS = np.array([1.0, -2.0, 1.0])
_FAR = 20.0
"""Distance, in longer differences, from which flicker follows its asymptote; nearer, digits are not yet lost."""
_STEPS = np.unique(np.concatenate([np.arange(9), np.round(9.0 * 1.15 ** np.arange(90))]).astype(np.int64))


def design(factor: Array) -> Array:
    """Allan variance (t, 5) of white, flicker, walk, quantisation and ramp with coefficient 1; time in samples."""
    m = factor
    return np.stack([1.0 / m, np.full(len(m), 2.0 * np.log(2.0) / np.pi), m / 3.0, 3.0 / m**2, m**2 / 2.0], axis=1)


def covariance_tensor(factor: Index, samples: int) -> Array:
    """(t, t, 5, 5): the covariance of the points is the quadratic form of this in the squared coefficients."""
    size = len(factor)
    tensor = np.zeros((size, size, 5, 5))
    for i in range(size):
        for j in range(i, size):
            m, other = int(factor[i]), int(factor[j])
            lag, weight = _lags(m, other, samples)
            c = _cross(lag, m, other)
            block = np.zeros((5, 5))
            block[:4, :4] = 2.0 * (c * weight) @ c.T
            # 4 mean(D_m) mean(D_m') c, shared between the two orders of (ramp, noise)
            block[4, :4] = block[:4, 4] = m * other * (c @ weight)
            tensor[i, j], tensor[j, i] = block, block
    return tensor


def _lags(m: int, other: int, samples: int) -> tuple[Index, Array]:
    """Lags at which c is evaluated, and what each stands for in the mean over all pairs.

    c has its kinks where ends of the two differences meet: dense there, geometric between.
    """
    count, count_other = samples + 1 - 2 * m, samples + 1 - 2 * other
    meets = np.unique([a * m - b * other for a in range(3) for b in range(3)])
    steps = _STEPS[: np.searchsorted(_STEPS, 2 * samples)]
    nodes = (meets[:, None] + np.concatenate([-steps[:0:-1], steps])).ravel()
    low, high = 1 - count, count_other - 1
    lag = np.unique(np.concatenate([nodes[(nodes > low) & (nodes < high)], [low, high]]))
    gap = np.diff(lag).astype(np.float64)
    weight = np.full(len(lag), 0.5)
    weight[0], weight[-1] = (0.5, 0.5) if len(lag) > 1 else (1.0, 1.0)
    weight[1:-1] = 0.0
    weight[:-1] += gap / 2.0
    weight[1:] += gap / 2.0
    pairs = np.minimum(count, count_other - lag) - np.maximum(0, -lag)
    return lag, weight * pairs / (float(count) * count_other)


def _cross(lag: Index, m: int, other: int) -> Array:
    """c at each lag for the four random terms, (4, n)."""
    place = np.arange(3)
    t = lag + np.asarray(other * place[:, None] - m * place)[..., None].astype(np.float64)
    weights = np.multiply.outer(_WEIGHTS, _WEIGHTS)
    size = np.abs(t)
    with np.errstate(divide="ignore", invalid="ignore"):
        flicker = np.where(size > 0.0, t * t * np.log(size), 0.0) / (2.0 * np.pi)
    parts = (-size / 2.0, flicker, size**3 / 12.0, (size == 0.0).astype(np.float64))
    c = np.stack([np.tensordot(weights, part, 2) for part in parts]) / (2.0 * m * other)
    middle = lag + float(other - m)
    far = np.abs(middle) > _FAR * max(m, other)
    # fourth derivative of t^2 ln|t|; the other terms end where the differences no longer overlap
    c[:, far] = 0.0
    c[1, far] = -m * other / (2.0 * np.pi * middle[far] ** 2)
    return c
