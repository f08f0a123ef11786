"""Equivalent weights of robust estimation: what a reading counts for, given how far it is from what was expected.

The departure t is normalised: residual or innovation over its standard deviation; for an innovation v of m components
with covariance S, t = sqrt(v' S^-1 v / m). A weight w multiplies the reading's weight, i.e. divides its covariance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite, within
from inclinometry.errors import InputError


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


# How far a filter believes its own prediction and its stated noise: adaptive factors, Sage-Husa, strong tracking.


def yang_factor_two(departure: ArrayLike, c: float = 1.5) -> Array:
    """Adaptive factor of two sections: 1 up to c, c/|d| beyond; the predicted covariance is divided by it.

    Parameters
    ----------
    departure : (...) array_like
        Of a robust estimate from readings alone from the prediction, over its standard deviation.
    c : float
        Published range 1 to 2.5.

    Returns
    -------
    (...) ndarray
        In (0, 1].

    Raises
    ------
    InputError
        c not positive, departures not finite.

    Notes
    -----
    Yang Y., He H., Xu G., "Adaptively robust filtering for kinematic geodetic positioning", J. Geodesy 75, 2001,
    pp. 109-116, and Yang Y., Xu T., "An adaptive Kalman filter based on Sage windowing weights and variance
    components", J. Navigation 56, 2003, pp. 231-240. The same shape as Huber's weight, turned on the prediction.

    Examples
    --------
    >>> yang_factor_two([1.0, 3.0], 1.5)
    array([1. , 0.5])
    """
    return huber_weight(departure, c)


def yang_factor_three(departure: ArrayLike, c0: float = 1.5, c1: float = 5.0) -> Array:
    """Adaptive factor of three sections: 1 up to c0, falling to 0 at c1, where the prediction is dropped.

    Parameters
    ----------
    departure : (...) array_like
        As for `yang_factor_two`.
    c0, c1 : float
        Published ranges 1 to 1.5 and 3 to 8.5.

    Returns
    -------
    (...) ndarray
        In [0, 1].

    Raises
    ------
    InputError
        Not 0 < c0 < c1, departures not finite.

    Notes
    -----
    c0/|d| ((c1 - |d|)/(c1 - c0))^2 between the limits: Yang, He, Xu (2001), eq. for the three-segment factor. At 0 the
    epoch is solved from its readings alone; a filter needs a positive floor.

    Examples
    --------
    >>> yang_factor_three([1.0, 2.0, 9.0], 1.0, 3.0)
    array([1.   , 0.125, 0.   ])
    """
    return igg3_weight(departure, c0, c1)


def sage_husa_share(forgetting: float, step: int) -> float:
    """Share of the newest sample in a fading mean after `step` samples: (1 - b)/(1 - b^(step + 1)).

    Parameters
    ----------
    forgetting : float
        b, below 1; published range 0.95 to 0.995. The memory is about 1/(1 - b) samples.
    step : int
        0 for the first sample, which then counts in full.

    Raises
    ------
    InputError
        b outside (0, 1), a negative step.

    Examples
    --------
    >>> sage_husa_share(0.9, 0), round(sage_husa_share(0.9, 1), 6), round(sage_husa_share(0.9, 1000), 6)
    (1.0, 0.526316, 0.1)
    """
    within(forgetting, "forgetting", 1e-6, 1.0 - 1e-9)
    if step < 0:
        raise InputError(f"step is {step}; it counts from 0")
    return float((1.0 - forgetting) / (1.0 - forgetting ** (step + 1)))


def sage_husa(noise: ArrayLike, innovation: ArrayLike, predicted: ArrayLike, share: float, floor: float) -> Array:
    """Noise covariance (m, m) after one innovation, never below a floor.

    Parameters
    ----------
    noise : (m, m) array_like
        R so far.
    innovation : (m,) array_like
    predicted : (m, m) array_like
        H P H', what the prediction's own uncertainty contributes to the innovation.
    share : float
        Of the new sample, `sage_husa_share`.
    floor : float
        Least eigenvalue of the result, > 0.

    Returns
    -------
    (m, m) ndarray

    Raises
    ------
    InputError
        Shapes, a share outside [0, 1], a floor that is not positive.

    Notes
    -----
        R <- (1 - d) R + d (v v' - H P H')

    Sage A.P., Husa G.W., "Adaptive filtering with unknown prior statistics", Joint Automatic Control Conference, 1969,
    pp. 760-769. The sample has the mean R but is not positive: an innovation smaller than its prediction takes R below
    zero and the filter diverges. Eigenvalues below the floor are lifted to it.

    Examples
    --------
    >>> sage_husa([[4.0]], [6.0], [[1.0]], 0.1, 0.5)
    array([[7.1]])
    >>> sage_husa([[1.0]], [0.0], [[90.0]], 0.1, 0.5)
    array([[0.5]])
    """
    r, v, p = finite(noise, "noise", (None, None)), finite(innovation, "innovation", (None,)), finite(predicted, "HPH'")
    if r.shape != (v.size, v.size) or p.shape != r.shape:
        raise InputError(f"noise has shape {r.shape} and HPH' {p.shape}; expected ({v.size}, {v.size})")
    within(share, "share", 0.0, 1.0)
    within(floor, "floor", 1e-300, 1e300)
    sample = (1.0 - share) * r + share * (np.outer(v, v) - p)
    values, vectors = np.linalg.eigh(0.5 * (sample + sample.T))
    if values[0] >= floor:
        return np.asarray(0.5 * (sample + sample.T))
    return np.asarray((vectors * np.maximum(values, floor)) @ vectors.T)


def fading_factor(
    spread: ArrayLike, process: ArrayLike, noise: ArrayLike, carried: ArrayLike, softening: float = 1.0
) -> float:
    """Strong-tracking fading factor, >= 1, that multiplies the carried covariance F P F'.

    Parameters
    ----------
    spread : (m, m) array_like
        V, fading mean of v v': V <- (rho V + v v') / (1 + rho), rho 0.95; the first is v v' itself.
    process, noise, carried : (m, m) array_like
        H Q H', R and H F P F' H'.
    softening : float
        beta >= 1, by which the noise is counted more, for a smoother estimate.

    Raises
    ------
    InputError
        A carried covariance whose trace is not positive, softening below 1.

    Notes
    -----
    lambda = max(1, tr(V - H Q H' - beta R) / tr(H F P F' H')): the least factor for which innovations are as large as
    predicted (Zhou D.H., Frank P.M., "Strong tracking filtering of nonlinear time-varying stochastic systems with
    coloured noise", Int. J. Control 65, 1996, pp. 295-307). It takes outliers for motion: use it where readings are
    clean and the motion is not known.

    Examples
    --------
    >>> fading_factor([[9.0]], [[1.0]], [[2.0]], [[3.0]]), fading_factor([[1.0]], [[1.0]], [[2.0]], [[3.0]])
    (2.0, 1.0)
    """
    within(softening, "softening", 1.0, 1e6)
    traces = [
        float(np.trace(finite(value, name, (None, None))))
        for value, name in ((spread, "spread"), (process, "process"), (noise, "noise"), (carried, "carried"))
    ]
    if traces[3] <= 0.0:
        raise InputError(f"the carried covariance has trace {traces[3]:g}; it must be positive")
    return max(1.0, (traces[0] - traces[1] - softening * traces[2]) / traces[3])
