"""Equivalent weights of robust estimation: what a reading counts for, given how far it is from what was expected.

The departure t is normalised: residual or innovation over its standard deviation; for an innovation v of m components
with covariance S, t = sqrt(v' S^-1 v / m). A weight w multiplies the reading's weight, i.e. divides its covariance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array, finite, within
from inclinometry.core.errors import InputError


def huber_weight(t: ArrayLike, k: float = 1.345) -> Array:
    """Huber's weight: 1 up to k, k/|t| beyond; no reading is rejected.

    Parameters
    ----------
    t : (...) array_like
        Normalised departures.
    k : float
        1 to 2; 1.345 keeps 95 % of the efficiency of least squares with Gaussian errors in one dimension.

    Returns
    -------
    (...) ndarray
        In (0, 1].

    Raises
    ------
    InputError
        k not positive, t not finite.

    Notes
    -----
    The weighted sum of w t^2 has the derivative psi(t) = w t = t up to k and k sign(t) beyond: the maximum-likelihood
    score of a density Gaussian in the middle with exponential tails. A reading's influence is bounded but never ends:
    a gross error still shifts the estimate by k standard deviations' worth. Huber P.J., "Robust estimation of a
    location parameter", Ann. Math. Statist. 35, 1964, pp. 73-101.

    Examples
    --------
    >>> huber_weight([0.5, -2.0, 4.0], 1.0)
    array([1.  , 0.5 , 0.25])
    """
    within(k, "k", 1e-6, 1e6)
    size = np.abs(finite(t, "t"))
    return np.asarray(k / np.maximum(size, k))


def igg3_weight(t: ArrayLike, k0: float = 1.5, k1: float = 4.0) -> Array:
    """IGG-III weight: 1 up to k0, falling smoothly to 0 at k1, and rejection beyond.

    Parameters
    ----------
    t : (...) array_like
        Normalised departures.
    k0, k1 : float
        Published ranges 1 to 1.5 and 2.5 to 8.

    Returns
    -------
    (...) ndarray
        In [0, 1].

    Raises
    ------
    InputError
        Not 0 < k0 < k1, t not finite.

    Notes
    -----
        w = 1                                        |t| <= k0
        w = k0/|t| ((k1 - |t|)/(k1 - k0))^2    k0 < |t| <= k1
        w = 0                                        |t| > k1

    The first factor is Huber's weight; the second takes the influence psi = w t back to 0 with a slope that also ends
    at 0, so that the weight is continuous at both limits. psi redescends, so the solution depends on its start: use it
    where a prediction gives one. Yang Y., Song L., Xu T., "Robust estimator for correlated observations based on
    bifactor equivalent weights", J. Geodesy 76, 2002, pp. 353-358.

    Examples
    --------
    >>> igg3_weight([1.0, 2.0, 3.0], 1.0, 3.0)
    array([1.   , 0.125, 0.   ])
    """
    within(k0, "k0", 1e-6, 1e6)
    within(k1, "k1", 1e-6, 1e6)
    if not k0 < k1:
        raise InputError(f"k0 is {k0:g} and k1 {k1:g}; k1 must be the larger (k0 1 to 1.5, k1 2.5 to 8)")
    size = np.abs(finite(t, "t"))
    fall = np.clip((k1 - size) / (k1 - k0), 0.0, 1.0) ** 2
    return np.asarray(k0 / np.maximum(size, k0) * fall)
