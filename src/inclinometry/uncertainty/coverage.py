"""From standard uncertainties to statements of probability: coverage factors, degrees of freedom, limits."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array, finite, within
from inclinometry.core.errors import InputError


def coverage_factor(probability: float, degrees_of_freedom: ArrayLike = np.inf) -> Array:
    """Factor k such that y +- k u covers the value with the given probability, one quantity.

    Parameters
    ----------
    probability : float
        Between 0 and 1, e.g. 0.95.
    degrees_of_freedom : (...) array_like
        Of u; infinite when u is exactly known (then k is the normal distribution's).

    Returns
    -------
    (...) ndarray

    Raises
    ------
    InputError
        A probability outside (0, 1), degrees of freedom that are not positive.

    Notes
    -----
    Student's t, two-sided; JCGM 100:2008 (GUM), annex G.3, without truncating the degrees of freedom to integers.

    Examples
    --------
    >>> coverage_factor(0.95, [4, np.inf]).round(3)
    array([2.776, 1.96 ])
    """
    from scipy.special import ndtri, stdtrit

    tail = 0.5 * (1.0 + _probability(probability))
    nu = _freedom(degrees_of_freedom)
    bounded = np.where(np.isinf(nu), 1.0, nu)
    return np.asarray(np.where(np.isinf(nu), ndtri(tail), stdtrit(bounded, tail)))


def ellipsoid_factor(probability: float, dimension: int) -> float:
    """Factor on the one-sigma ellipsoid of `dimension` normal quantities that covers them jointly.

    Examples
    --------
    >>> round(ellipsoid_factor(0.95, 2), 4), round(ellipsoid_factor(0.95, 3), 4)
    (2.4477, 2.7955)
    """
    return float(np.sqrt(chi_square_limit(probability, dimension)))


def chi_square_limit(probability: float, degrees_of_freedom: ArrayLike) -> Array:
    """Value that a chi-square variable stays below with the given probability.

    Parameters
    ----------
    probability : float
    degrees_of_freedom : (...) array_like
        Positive and finite.

    Examples
    --------
    >>> chi_square_limit(0.95, [1, 10]).round(3)
    array([ 3.841, 18.307])
    """
    from scipy.special import gammaincinv

    nu = finite(_freedom(degrees_of_freedom), "degrees_of_freedom")
    return np.asarray(2.0 * gammaincinv(0.5 * nu, _probability(probability)))


def chi_square_tail(value: ArrayLike, degrees_of_freedom: ArrayLike) -> Array:
    """Probability that a chi-square variable exceeds `value`; small means the assumed uncertainties were too small.

    Examples
    --------
    >>> float(chi_square_tail(18.307, 10).round(4))
    0.05
    """
    from scipy.special import gammaincc

    nu = finite(_freedom(degrees_of_freedom), "degrees_of_freedom")
    return np.asarray(gammaincc(0.5 * nu, 0.5 * within(value, "value", 0.0, np.inf)))


def welch_satterthwaite(uncertainties: ArrayLike, degrees_of_freedom: ArrayLike) -> Array:
    """Effective degrees of freedom of a sum of independent contributions.

    Parameters
    ----------
    uncertainties : (..., n) array_like
        Standard uncertainty of each contribution, in the unit of the sum; NaN gives NaN.
    degrees_of_freedom : (n,) or (..., n) array_like
        Of each; infinite allowed.

    Returns
    -------
    (...) ndarray
        Infinite when no contribution of finite degrees of freedom matters.

    Raises
    ------
    InputError
        A negative or infinite uncertainty, degrees of freedom that are not positive.

    Notes
    -----
    JCGM 100:2008 (GUM), equation (G.2b): u^4 / sum(u_i^4 / nu_i). It does not hold for correlated contributions.

    Examples
    --------
    >>> float(welch_satterthwaite([1.0, 1.0], [10, 10]))
    20.0
    """
    u = np.asarray(uncertainties, dtype=np.float64)
    if (u < 0.0).any() or np.isinf(u).any():
        raise InputError("an uncertainty is negative or infinite; give standard uncertainties >= 0")
    nu = _freedom(degrees_of_freedom)
    # shares of the variance first: fourth powers of 1e-90 would underflow
    variance = (u / np.maximum(u.max(axis=-1, keepdims=True), np.finfo(float).tiny)) ** 2
    denominator = np.sum(variance**2 / nu, axis=-1)
    total = np.sum(variance, axis=-1) ** 2
    return np.where(denominator == 0.0, np.inf, total / np.where(denominator == 0.0, 1.0, denominator))


def _probability(value: float) -> float:
    if not 0.0 < value < 1.0:
        raise InputError(f"probability is {value}; it must lie between 0 and 1, e.g. 0.95")
    return float(value)


def _freedom(value: ArrayLike) -> Array:
    nu = np.asarray(value, dtype=np.float64)
    if not (nu > 0.0).all():
        raise InputError(f"degrees of freedom are {value!r}; they must be positive (infinite where u is exact)")
    return nu
