"""Ellipses and ellipsoids of position uncertainty, and its components along and across the hole."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.attitude.rotations import dcm
from inclinometry.core.angles import wrap_positive
from inclinometry.core.arrays import Array, finite
from inclinometry.core.errors import InputError
from inclinometry.uncertainty.coverage import ellipsoid_factor


class HorizontalEllipse(NamedTuple):
    """Horizontal ellipses.

    major, minor : (...) semi-axes, m.
    direction : (...) of the major axis from the north of the covariance, rad, in [0, pi).
    """

    major: Array
    minor: Array
    direction: Array


class Ellipsoid(NamedTuple):
    """Ellipsoids in space.

    semi_axes : (..., 3) m, largest first.
    directions : (..., 3, 3) unit vectors north, east, down, one row a semi-axis.
    """

    semi_axes: Array
    directions: Array


def horizontal_ellipse(covariance: ArrayLike, probability: float | None = None) -> HorizontalEllipse:
    """Ellipse of north and east.

    Parameters
    ----------
    covariance : (..., 3, 3) or (..., 2, 2) array_like
        North, east (, down), m^2.
    probability : float, optional
        That the ellipse holds the true position of a normal distribution, e.g. 0.95; one standard deviation along each
        axis where not given, which holds 39.3 %.

    Returns
    -------
    HorizontalEllipse

    Raises
    ------
    InputError
        Values that are not finite, negative variances, a probability outside (0, 1).

    Examples
    --------
    >>> found = horizontal_ellipse([[4.0, 0.0, 0.0], [0.0, 9.0, 0.0], [0.0, 0.0, 1.0]])
    >>> float(found.major), float(found.minor), float(np.degrees(found.direction))
    (3.0, 2.0, 90.0)
    """
    matrix = _covariance(covariance, (2, 3))
    nn, ee, ne = matrix[..., 0, 0], matrix[..., 1, 1], matrix[..., 0, 1]
    middle, half = 0.5 * (nn + ee), np.hypot(0.5 * (nn - ee), ne)
    direction = np.mod(wrap_positive(0.5 * np.arctan2(2.0 * ne, nn - ee)), np.pi)
    major = middle + half
    # the product of the axes, for the difference of two large numbers would lose the small one
    with np.errstate(invalid="ignore", divide="ignore"):
        minor = np.where(major > 0.0, (nn * ee - ne**2) / np.where(major > 0.0, major, 1.0), 0.0)
    factor = 1.0 if probability is None else ellipsoid_factor(probability, 2)
    return HorizontalEllipse(factor * np.sqrt(major), factor * np.sqrt(np.maximum(minor, 0.0)), direction)


def ellipsoid(covariance: ArrayLike, probability: float | None = None) -> Ellipsoid:
    """Ellipsoid in space.

    Parameters
    ----------
    covariance : (..., 3, 3) array_like
        North, east, down, m^2.
    probability : float, optional
        That the ellipsoid holds the true position; one standard deviation along each axis where not given (19.9 %).

    Returns
    -------
    Ellipsoid

    Raises
    ------
    InputError
        As `horizontal_ellipse`.

    Examples
    --------
    >>> ellipsoid(np.diag([1.0, 4.0, 9.0])).semi_axes
    array([3., 2., 1.])
    """
    values, vectors = np.linalg.eigh(_covariance(covariance, (3,)))
    factor = 1.0 if probability is None else ellipsoid_factor(probability, 3)
    axes = factor * np.sqrt(np.maximum(values, 0.0))[..., ::-1]
    return Ellipsoid(axes, np.swapaxes(vectors, -1, -2)[..., ::-1, :])


def hole_covariance(covariance: ArrayLike, inclination: ArrayLike, azimuth: ArrayLike) -> Array:
    """Covariance along the axes of the hole: high side, lateral (right of it), along hole.

    Parameters
    ----------
    covariance : (..., 3, 3) array_like
        North, east, down, m^2.
    inclination, azimuth : (...) array_like
        rad, azimuth from the north of the covariance; at a vertical station it says where the high side is taken.

    Returns
    -------
    (..., 3, 3) ndarray
        m^2.

    Notes
    -----
    High side (cos I cos A, cos I sin A, -sin I), lateral (-sin A, cos A, 0), along hole (sin I cos A, sin I sin A,
    cos I): the rows of C_tn at toolface 0 of the house's conventions.

    Examples
    --------
    >>> flat = hole_covariance(np.diag([1.0, 4.0, 9.0]), np.pi / 2, 0.0)
    >>> np.sqrt(np.diagonal(flat)).round(9)
    array([3., 2., 1.])
    """
    matrix = _covariance(covariance, (3,))
    turn = dcm(azimuth, inclination, 0.0)
    return np.asarray(turn @ matrix @ np.swapaxes(turn, -1, -2))


def hole_sigmas(covariance: ArrayLike, inclination: ArrayLike, azimuth: ArrayLike) -> Array:
    """Standard deviations (..., 3), m, high side, lateral and along hole; see `hole_covariance`.

    Examples
    --------
    >>> hole_sigmas(np.diag([1.0, 4.0, 9.0]), 0.0, 0.0)
    array([1., 2., 3.])
    """
    variances = np.diagonal(hole_covariance(covariance, inclination, azimuth), axis1=-2, axis2=-1)
    return np.asarray(np.sqrt(np.maximum(variances, 0.0)))


def _covariance(value: ArrayLike, sizes: tuple[int, ...]) -> Array:
    matrix = finite(value, "covariance", (None, None))
    if matrix.shape[-1] != matrix.shape[-2] or matrix.shape[-1] not in sizes:
        wanted = " or ".join(f"(..., {size}, {size})" for size in sizes)
        raise InputError(f"covariance has shape {matrix.shape}; expected {wanted}")
    if (np.diagonal(matrix, axis1=-2, axis2=-1) < 0.0).any():
        raise InputError("covariance has a negative variance on its diagonal; give variances in m^2")
    return matrix
