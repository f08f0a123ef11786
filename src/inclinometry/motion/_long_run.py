"""Uncertainty of a mean from the samples themselves: correlation by batch means, rounding by its own law."""

from __future__ import annotations

from typing import Final

import numpy as np

from inclinometry.core.arrays import Array

HARMONICS: Final = 8
"""Terms of the rounding error's series; the ninth adds 0.8 % of q^2 / 12 at most."""


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

    Notes
    -----
    S / b with S the covariance of the b batch means, times nu / (nu - p - 1), nu = b - 1: with S estimated,
    e' S^-1 e follows Hotelling's law, whose mean is that factor times p; so the normalised squared error has mean p.
    Correlation shorter than a batch is counted in full (batch means: Schmeiser 1982, Operations Research 30, 556-568).

    Examples
    --------
    >>> draws = np.random.default_rng(0).standard_normal((4000, 16, 3))
    >>> draws -= draws.mean(axis=1, keepdims=True)
    >>> float(np.mean([covariance_of_mean(d)[0, 0] for d in draws]).round(2))  # 1/16 times 15/11
    0.09
    """
    count, size = deviations.shape
    freedom = count - 1
    centred = deviations - deviations.mean(axis=0)
    return np.asarray(centred.T @ centred / (freedom * count) * (freedom / (freedom - size - 1.0)))


def rounding_variance(values: Array, resolution: float) -> Array:
    """Variance (c,) of the mean of samples (n, c) that were rounded to a step, by the rounding alone.

    Parameters
    ----------
    values : (n, c) ndarray
    resolution : float
        Step assumed where no channel changes, in the unit of the values.

    Notes
    -----
    The mean of rounded samples with Gaussian noise s is off by sum_k (-1)^k q/(pi k) sin(2 pi k x/q)
    exp(-2 pi^2 k^2 s^2/q^2) (Widrow and Kollar, Quantization Noise, 2008, sec. 4); over all x its variance is

        sum_k q^2 / (2 pi^2 k^2) exp(-4 pi^2 k^2 s^2 / q^2),

    q^2/12 without noise and nothing from s = q/2. The step q is the range over the number of distinct values less one,
    s^2 the variance less q^2/12. A channel with one or two values tells no noise and has q^2/12; one that never changes
    takes the largest step of the others, or `resolution`.

    Examples
    --------
    >>> rounding_variance(np.full((100, 1), 0.3), 0.12)
    array([0.0012])
    """
    distinct = np.array([np.unique(column).size for column in values.T])
    step = np.where(distinct > 1, np.ptp(values, axis=0) / np.maximum(distinct - 1, 1), 0.0)
    step = np.where(distinct > 1, step, step.max() if step.any() else resolution)
    noise = np.where(distinct > 2, np.maximum(values.var(axis=0) - step**2 / 12.0, 0.0), 0.0)
    order = np.arange(1, HARMONICS + 1)[:, None]
    ratio = noise / np.where(step > 0.0, step, 1.0) ** 2
    series = np.exp(-4.0 * np.pi**2 * order**2 * ratio) / order**2
    total = series.sum(axis=0) * (np.pi**2 / 6.0) / (1.0 / np.arange(1, HARMONICS + 1) ** 2).sum()
    return np.asarray(step**2 / (2.0 * np.pi**2) * total)
