"""Uncertainty by the GUM: linear propagation J C J' for stacks of models, coverage factors, budgets by cause."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite, within
from inclinometry.constants import COVERAGE_FACTOR
from inclinometry.errors import out_of_range, refused, wrong_shape


def coverage_factor(probability: float, degrees_of_freedom: ArrayLike = np.inf) -> Array:
    """Factor k such that y +- k u covers the value with the given probability, one quantity.

    Student's t, two-sided; JCGM 100:2008 (GUM), annex G.3, without truncating the degrees of freedom to integers.
    """
    from scipy.special import ndtri, stdtrit

    tail = 0.5 * (1.0 + _probability(probability))
    nu = _freedom(degrees_of_freedom)
    bounded = np.where(np.isinf(nu), 1.0, nu)
    return np.asarray(np.where(np.isinf(nu), ndtri(tail), stdtrit(bounded, tail)))


def ellipsoid_factor(probability: float, dimension: int, degrees_of_freedom: ArrayLike = np.inf) -> Array:
    """Factor on the one-sigma ellipsoid of `dimension` quantities that covers them jointly.

    Root of the chi-square quantile, or of Student's distribution in d dimensions: k^2 = d (nu - 2) / nu F, F Fisher's
    quantile of (d, nu) (Hotelling), never less than the first. The covariance is a mean over its own uncertainty, as
    from a joint fit: it contains nu / (nu - 2) already; fewer degrees of freedom than 3 count as 3.
    """
    from scipy.special import fdtri

    normal = np.sqrt(chi_square_limit(probability, dimension))
    nu = np.maximum(_freedom(degrees_of_freedom), 3.0)
    bounded = np.where(np.isinf(nu), 10.0, nu)
    student = np.sqrt(dimension * (bounded - 2.0) / bounded * fdtri(dimension, bounded, _probability(probability)))
    return np.asarray(np.where(np.isinf(nu), normal, np.maximum(student, normal)))[()]


def coverage_probability(k: float) -> float:
    """Of an expanded uncertainty with factor k, normal distribution.

    Examples
    --------
    >>> round(coverage_probability(2.0), 4)
    0.9545
    """
    return math.erf(k / math.sqrt(2.0))


def expanded_factor(degrees_of_freedom: ArrayLike = np.inf) -> Array:
    """k of an expanded uncertainty: for the probability of k = 2 of a normal distribution, 95.45 %, two decimals up.

    u is already the mean over its own uncertainty, see `ellipsoid_factor`.
    """
    k = ellipsoid_factor(coverage_probability(COVERAGE_FACTOR), 1, degrees_of_freedom)
    return np.asarray(np.ceil(100.0 * k - 1e-6) / 100.0)[()]


def chi_square_limit(probability: float, degrees_of_freedom: ArrayLike) -> Array:
    """Value that a chi-square variable stays below with the given probability."""
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


def pooled_freedom(parts: Iterable[tuple[Array, float]]) -> Array:
    """Effective degrees of freedom (...) of a sum of variances, each with its own degrees of freedom.

    Those of one finite number come from the same estimate (a calibration and the noise of its tool) and count as one:
    Welch and Satterthwaite need independent ones (JCGM 100:2008, G.4).
    """
    total: Array = np.zeros(())
    estimated: dict[float, Array] = {}
    for variance, nu in parts:
        total = total + variance
        if np.isfinite(nu):
            estimated[nu] = estimated.get(nu, 0.0) + variance
    whole = np.where(total > 0.0, total, 1.0)
    # shares first: squares of small variances would underflow
    spent = np.sum([np.square(own / whole) / nu for nu, own in estimated.items()], axis=0) + 0.0 * whole
    return np.asarray(np.divide(1.0, spent, out=np.full(whole.shape, np.inf), where=spent > 0.0))


def _probability(value: float) -> float:
    if not 0.0 < value < 1.0:
        raise out_of_range("probability", float(value), "0 < p < 1")
    return float(value)


def _freedom(value: ArrayLike) -> Array:
    nu = np.asarray(value, dtype=np.float64)
    if not (nu > 0.0).all():
        raise out_of_range("nu", float(nu[~(nu > 0.0)].flat[0]), "> 0")
    return nu


UNKNOWN = np.pi / np.sqrt(3.0)
"""Standard uncertainty of an angle about which nothing is known (uniform over the circle), rad."""


def covariance_matrix(value: ArrayLike, name: str = "covariance") -> Array:
    """`value` as (..., n, n), symmetric and positive semidefinite to rounding, in units where the diagonal is one."""
    matrix = finite(value, name, (None, None))
    if matrix.shape[-1] != matrix.shape[-2]:
        raise wrong_shape(name, matrix.shape, "(..., n, n)")
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    if (diagonal < 0.0).any():
        raise out_of_range(f"diag({name})", float(diagonal.min()), ">= 0")
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    unit = matrix / (scale[..., :, None] * scale[..., None, :])
    if np.abs(unit - np.swapaxes(unit, -1, -2)).max(initial=0.0) > 1e-9:
        raise refused("input-covariance", {"name": name, "allowed": ">= 0"})
    smallest = float(np.linalg.eigvalsh(unit).min(initial=0.0))
    if smallest < -1e-9 * max(1, matrix.shape[-1]):
        raise out_of_range(f"eig({name})", smallest, ">= 0")
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
        Exactly symmetric. Valid when f is close to linear over a few standard deviations of the inputs; a Monte Carlo
        (JCGM 101) tells whether it is.

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
        raise refused("input-finite", {"name": "jacobian"})
    if j.ndim < 2 or j.shape[-1] != c.shape[-1] or c.shape[-1] != c.shape[-2]:
        raise wrong_shape("jacobian, covariance", f"{j.shape}, {c.shape}", "(m, n), (n, n)")
    result = j @ c @ np.swapaxes(j, -1, -2)
    return np.asarray(0.5 * (result + np.swapaxes(result, -1, -2)))


def standard_deviations(covariance: ArrayLike) -> Array:
    """Square roots of the diagonal of (..., n, n), shape (..., n); NaN stays NaN."""
    variance = np.diagonal(np.asarray(covariance, dtype=np.float64), axis1=-2, axis2=-1)
    if (variance < 0.0).any():
        raise out_of_range("diag(covariance)", float(np.nanmin(variance)), ">= 0")
    return np.sqrt(variance)


def correlation(covariance: ArrayLike) -> Array:
    """Correlation matrices (..., n, n); zero beside a variable of no variance, one on the diagonal."""
    c = covariance_matrix(covariance)
    sigma = standard_deviations(c)
    scale = np.where(sigma > 0.0, sigma, 1.0)
    unit = np.array(c / (scale[..., :, None] * scale[..., None, :]))
    places = np.arange(c.shape[-1])
    unit[..., places, places] = 1.0
    return unit


def symmetric_root(covariance: ArrayLike, smallest: float = 0.0) -> Array:
    """Symmetric root of a covariance (n, n) that may be singular: draws made by it are the same on every processor.

    Eigenvalues up to `smallest` times the largest count as zero.
    """
    values, vectors = np.linalg.eigh(np.asarray(covariance, dtype=np.float64))
    kept = np.where(values > smallest * values.max(initial=0.0), np.maximum(values, 0.0), 0.0)
    return np.asarray(vectors * np.sqrt(kept) @ vectors.T)


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
        raise out_of_range("steps", float(h.min()), "> 0")

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

    At most that of an angle about which nothing is known; causes that are not finite count as that.
    """
    total = np.asarray(sum(part[:, column] for part in components.values()))
    return np.asarray(np.minimum(np.sqrt(np.where(np.isfinite(total), total, np.inf)), UNKNOWN))


class AngleErrors(NamedTuple):
    """What one cause does to the angles of n stations of a run, first order.

    by_parameter : (n, 4, p) derivatives of inclination, azimuth (rad) and of the hole's direction to true north and to
        the east, by the cause's p parameters. The direction serves where the hole is vertical and has no azimuth.
    covariance : (p, p) of the parameters.
    shared : whether the stations of the run share one draw of the parameters; else each station has its own.
    """

    by_parameter: Array
    covariance: Array
    shared: bool


def shares(parts: Mapping[str, Array]) -> dict[str, Array]:
    """Part (..., n) of the variances that each of several covariances (..., n, n) brings to their sum; 0 of nothing."""
    each = {name: np.diagonal(part, axis1=-2, axis2=-1) for name, part in parts.items()}
    total = np.asarray(sum(each.values()))
    return {name: own / np.where(total == 0.0, 1.0, total) for name, own in each.items()}
