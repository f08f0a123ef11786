"""Linear propagation of covariance, J C J', for stacks of models at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array, finite
from inclinometry.core.errors import InputError

UNKNOWN = np.pi / np.sqrt(3.0)
"""Standard uncertainty of an angle about which nothing is known (uniform over the circle), rad."""


def covariance_matrix(value: ArrayLike, name: str = "covariance") -> Array:
    """Return `value` as (..., n, n), checked to be symmetric and positive semidefinite.

    Parameters
    ----------
    value : (..., n, n) array_like
    name : str
        For the message.

    Raises
    ------
    InputError
        Not square, not symmetric, or with an eigenvalue below zero by more than rounding, judged in units where the
        diagonal is one.

    Examples
    --------
    >>> covariance_matrix([[1.0, 2.0], [2.0, 1.0]])
    Traceback (most recent call last):
    inclinometry.core.errors.InputError: covariance has correlation eigenvalue -1; ...
    """
    matrix = finite(value, name, (None, None))
    if matrix.shape[-1] != matrix.shape[-2]:
        raise InputError(f"{name} has shape {matrix.shape}; expected (..., n, n)")
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    if (diagonal < 0.0).any():
        raise InputError(f"{name} has variance {diagonal.min():g}; variances must not be negative")
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    unit = matrix / (scale[..., :, None] * scale[..., None, :])
    if np.abs(unit - np.swapaxes(unit, -1, -2)).max(initial=0.0) > 1e-9:
        raise InputError(f"{name} is not symmetric; give (C + C') / 2 if that is meant")
    smallest = float(np.linalg.eigvalsh(unit).min(initial=0.0))
    if smallest < -1e-9 * max(1, matrix.shape[-1]):
        raise InputError(f"{name} has correlation eigenvalue {smallest:.3g}; it must be positive semidefinite")
    return matrix


def propagate(jacobian: ArrayLike, covariance: ArrayLike) -> Array:
    """Covariance of y = f(x) to first order: J C J'.

    Parameters
    ----------
    jacobian : (..., m, n) array_like
        Derivatives of the m outputs by the n inputs. NaN marks a derivative that does not exist (the azimuth of a
        vertical tool) and makes the variance of that output NaN, never that of another.
    covariance : (..., n, n) array_like
        Of the inputs.

    Returns
    -------
    (..., m, m) ndarray
        Exactly symmetric. Valid when f is close to linear over a few standard deviations of the inputs; `montecarlo`
        tells whether it is.

    Raises
    ------
    InputError
        Shapes that do not go together, infinite values.

    Notes
    -----
    JCGM 102:2011, equation (3); for one output JCGM 100:2008 (GUM), equation (13).

    Examples
    --------
    >>> propagate([[1.0, 1.0]], [[4.0, 1.0], [1.0, 9.0]])
    array([[15.]])
    """
    j = np.asarray(jacobian, dtype=np.float64)
    c = finite(covariance, "covariance", (None, None))
    if np.isinf(j).any():
        raise InputError("the jacobian holds an infinite value; mark a derivative that does not exist with nan")
    if j.ndim < 2 or j.shape[-1] != c.shape[-1] or c.shape[-1] != c.shape[-2]:
        raise InputError(f"jacobian {j.shape} and covariance {c.shape} do not go together; expected (m, n) and (n, n)")
    result = j @ c @ np.swapaxes(j, -1, -2)
    return np.asarray(0.5 * (result + np.swapaxes(result, -1, -2)))


def standard_deviations(covariance: ArrayLike) -> Array:
    """Square roots of the diagonal of (..., n, n), shape (..., n); NaN stays NaN.

    Raises
    ------
    InputError
        A negative variance.

    Examples
    --------
    >>> standard_deviations(np.diag([4.0, 9.0]))
    array([2., 3.])
    """
    variance = np.diagonal(np.asarray(covariance, dtype=np.float64), axis1=-2, axis2=-1)
    if (variance < 0.0).any():
        raise InputError(f"a variance is {np.nanmin(variance):g}; variances must not be negative")
    return np.sqrt(variance)


def correlation(covariance: ArrayLike) -> Array:
    """Correlation matrices (..., n, n); zero beside a variable of no variance, one on the diagonal.

    Examples
    --------
    >>> correlation([[4.0, 3.0], [3.0, 9.0]])
    array([[1. , 0.5],
           [0.5, 1. ]])
    """
    c = covariance_matrix(covariance)
    sigma = standard_deviations(c)
    scale = np.where(sigma > 0.0, sigma, 1.0)
    unit = np.array(c / (scale[..., :, None] * scale[..., None, :]))
    places = np.arange(c.shape[-1])
    unit[..., places, places] = 1.0
    return unit


def numerical_jacobian(function: Callable[[Array], Array], x: ArrayLike, steps: ArrayLike) -> Array:
    """Derivatives of a function of one vector by central differences with one extrapolation.

    Parameters
    ----------
    function : callable
        (n,) -> (m,). Angles must not jump: return their difference from a nominal value.
    x : (n,) array_like
    steps : (n,) array_like
        Step of each input, positive; about a standard deviation is a good choice, or 1e-3 of the scale on which the
        function bends.

    Returns
    -------
    (m, n) ndarray
        Error of fourth order in the steps (Richardson: (4 D(h/2) - D(h)) / 3).

    Raises
    ------
    InputError
        A step that is not positive.

    Examples
    --------
    >>> numerical_jacobian(lambda v: np.array([v[0] ** 2 * v[1]]), [1.0, 2.0], [0.1, 0.1]).round(9)
    array([[4., 1.]])
    """
    at = finite(x, "x", (None,))
    h = np.broadcast_to(finite(steps, "steps"), at.shape)
    if not (h > 0.0).all():
        raise InputError(f"the smallest step is {h.min():g}; steps must be positive")

    def slope(column: int, step: float) -> Array:
        forward, backward = at.copy(), at.copy()
        forward[column] += step
        backward[column] -= step
        # the difference of the stored abscissae, not twice the step, so that rounding of x drops out
        width = forward[column] - backward[column]
        return np.asarray((np.atleast_1d(function(forward)) - np.atleast_1d(function(backward))) / width)

    columns = [(4.0 * slope(k, h[k] / 2.0) - slope(k, h[k])) / 3.0 for k in range(at.size)]
    return np.stack(columns, axis=-1)


def angle_sd(components: Mapping[str, Array], column: int) -> Array:
    """Standard uncertainty (n,) of an angle, rad, from the variances (n, m) that each cause gives to m angles.

    Never more than that of an angle about which nothing is known; causes that are not finite count as that.

    Examples
    --------
    >>> angle_sd({"noise": np.array([[9.0e-6]]), "calibration": np.array([[1.6e-5]])}, 0)
    array([0.005])
    """
    total = np.asarray(sum(part[:, column] for part in components.values()))
    return np.asarray(np.minimum(np.sqrt(np.where(np.isfinite(total), total, np.inf)), UNKNOWN))
