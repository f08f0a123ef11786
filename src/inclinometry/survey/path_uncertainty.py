"""What a point of a path owes to the two stations it lies between: exact derivatives, and the covariance from them."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array, finite
from inclinometry.core.errors import InputError
from inclinometry.survey.path import (
    LEVEL,
    Path,
    cosine,
    directions,
    interpolate,
    interval,
    project_curve,
    project_straight,
    sinc,
    weights,
)

POINT: Final = ("north", "east", "tvd", "inclination", "azimuth")
"""Rows of the derivatives: what is known of a point, m and rad."""
STATIONS: Final = (
    *("north_above", "east_above", "tvd_above"),
    *("md_above", "inclination_above", "azimuth_above", "md_below", "inclination_below", "azimuth_below"),
)
"""Columns of the derivatives: position of the station above, then depth and angles of both stations, m and rad."""


def interpolation_jacobian(path: Path, md: ArrayLike) -> Array:
    """Derivatives of `interpolate` by the stations above and below.

    Parameters
    ----------
    path : Path
    md : (m,) array_like
        Measured depths within the path, m; they are held while the depths of the stations change.

    Returns
    -------
    (m, 5, 9) ndarray
        Rows as in `POINT`, columns as in `STATIONS`. A point at a station belongs to the interval below it, at the
        last station to the one above. Where the hole is vertical at the point the row of the azimuth is NaN (its
        error is unbounded) and inclination is differentiated toward the azimuth that `interpolate` reports.

    Raises
    ------
    InputError
        As for `interpolate`.

    Notes
    -----
    With u = dt/dI, h = dt/dA / sin I of the point, dI = u.dt and dA = h.dt / sin I. The weights of the arc depend on
    the dogleg by beta dbeta = beta (e2.dt2 - e1.dt1), e1 and e2 the directions in which the arc turns at its ends;
    beta e is smooth where the interval is straight.

    Examples
    --------
    Half-way down a straight hole an inclination counts by half, and a position in full:

    >>> from inclinometry.survey.path import minimum_curvature
    >>> path = minimum_curvature([0.0, 100.0], [1.0, 1.0], [0.0, 0.0])
    >>> interpolation_jacobian(path, 50.0)[0, 3, [4, 7]], interpolation_jacobian(path, 50.0)[0, 0, 0]
    (array([0.5, 0.5]), np.float64(1.0))
    """
    point = interpolate(path, md)
    return _arc_jacobian(path, point.md, point.inclination, point.azimuth)


def curve_jacobian(path: Path, md: ArrayLike) -> Array:
    """Derivatives (m, 5, 9) of `project_curve`, laid out as in `interpolation_jacobian`.

    Examples
    --------
    >>> from inclinometry.survey.path import minimum_curvature
    >>> path = minimum_curvature([0.0, 30.0], [1.0, 1.1], [0.0, 0.0])
    >>> curve_jacobian(path, 60.0)[0, 3, [4, 7]].round(9)
    array([-1.,  2.])
    """
    point = project_curve(path, md)
    return _arc_jacobian(path, point.md, point.inclination, point.azimuth)


def straight_jacobian(path: Path, md: ArrayLike) -> Array:
    """Derivatives (m, 5, 9) of `project_straight`, laid out as in `interpolation_jacobian`.

    Examples
    --------
    >>> from inclinometry.survey.path import minimum_curvature
    >>> path = minimum_curvature([0.0, 30.0], [1.0, 1.1], [0.0, 0.0])
    >>> straight_jacobian(path, 60.0)[0, 3, [4, 7]]
    array([0., 1.])
    """
    point = project_straight(path, md)
    last = np.full_like(point.md, path.md[-1])
    jacobian = _arc_jacobian(path, last, point.inclination, point.azimuth)
    t, u, ah = _frame(path.inclination[-1], path.azimuth[-1])
    ahead = (point.md - path.md[-1])[:, None]
    # at the end of the arc, moving the station below along the arc moves the point back: that is -t, already there
    jacobian[:, :3, 7] += ahead * u
    jacobian[:, :3, 8] += ahead * ah
    jacobian[:, 3:] = 0.0
    jacobian[:, 3, 7] = 1.0
    jacobian[:, 4, 8] = 1.0 if np.hypot(t[0], t[1]) > LEVEL else np.nan
    return jacobian


def point_covariance(jacobian: ArrayLike, covariance: ArrayLike) -> Array:
    """Covariance of points from that of the stations they lie between.

    Parameters
    ----------
    jacobian : (m, 5, 9) array_like
        From `interpolation_jacobian`, `curve_jacobian` or `straight_jacobian`.
    covariance : (9, 9) or (m, 9, 9) array_like
        Of `STATIONS`, m and rad, of each point's own interval. Errors that the two stations share (a reference, the
        calibration, depth) belong off the diagonal: left out, a point between stations comes out too sure.

    Returns
    -------
    (m, 5, 5) ndarray
        Of `POINT`: J C J^T, first order in the errors. NaN in the row and column of an azimuth that does not exist.

    Raises
    ------
    InputError
        When the shapes do not fit, or the covariance is not finite.

    Examples
    --------
    >>> from inclinometry.survey.path import minimum_curvature
    >>> path = minimum_curvature([0.0, 100.0], [1.0, 1.0], [0.0, 0.0])
    >>> found = point_covariance(interpolation_jacobian(path, 50.0), np.diag([4.0, 0, 0, 0, 1e-4, 0, 0, 1e-4, 0]))
    >>> float(found[0, 3, 3].round(9))
    5e-05
    """
    matrix, stated = np.asarray(jacobian, dtype=np.float64), finite(covariance, "covariance", (9, 9))
    if matrix.ndim != 3 or matrix.shape[1:] != (5, 9) or stated.shape not in ((9, 9), (len(matrix), 9, 9)):
        raise InputError(f"jacobian {matrix.shape} and covariance {stated.shape}; expected (m, 5, 9) and (m, 9, 9)")
    return np.asarray(matrix @ stated @ np.swapaxes(matrix, 1, 2))


def _arc_jacobian(path: Path, depth: Array, inclination: Array, azimuth: Array) -> Array:
    """Derivatives on the arcs, the last one continued."""
    k, f = interval(path, depth)
    beta, length = path.dogleg[k], path.md[k + 1] - path.md[k]
    above, below = (_frame(path.inclination[i], path.azimuth[i]) for i in (k, k + 1))
    p, q, w = above[0] + below[0], below[0] - above[0], weights(f, beta)
    turn_above, turn_below = _turns(p, q, beta)
    by_beta = [_combined(even_p.slope, p, even_q.slope, q) for even_p, even_q in ((w.r_p, w.r_q), (w.t_p, w.t_q))]
    t, away = _combined(w.t_p.value, p, w.t_q.value, q), _combined(w.r_p.value, p, w.r_q.value, q)
    by_place, by_direction = np.zeros((len(f), 3, 9)), np.zeros((len(f), 3, 9))
    by_place[:, :, :3] = np.eye(3)
    for column, change, sign, turn in (
        *((4 + i, above[1 + i], -1.0, -turn_above) for i in (0, 1)),
        *((7 + i, below[1 + i], 1.0, turn_below) for i in (0, 1)),
    ):
        beta_change = np.sum(turn * change, axis=1, keepdims=True)
        moved = (w.r_p.value + sign * w.r_q.value)[:, None] * change + by_beta[0] * beta_change
        by_place[:, :, column] = length[:, None] * moved
        by_direction[:, :, column] = (w.t_p.value + sign * w.t_q.value)[:, None] * change + by_beta[1] * beta_change
    along = _along(f, beta, p, q) / length[:, None]
    by_place[:, :, 3], by_place[:, :, 6] = -away - (1.0 - f)[:, None] * t, away - f[:, None] * t
    by_direction[:, :, 3], by_direction[:, :, 6] = -(1.0 - f)[:, None] * along, -f[:, None] * along
    return np.concatenate([by_place, _angles(by_direction, inclination, azimuth, t)], axis=1)


def _angles(by_direction: Array, inclination: Array, azimuth: Array, t: Array) -> Array:
    """Rows of inclination and azimuth (m, 2, 9) from those of the direction (m, 3, 9)."""
    _, u, ah = _frame(inclination, azimuth)
    square = t[:, 0] ** 2 + t[:, 1] ** 2
    vertical = square <= LEVEL**2
    by_azimuth = np.where(vertical[:, None], np.nan, ah / np.where(vertical, 1.0, square)[:, None])
    return np.stack([np.einsum("mi,mij->mj", rows, by_direction) for rows in (u, by_azimuth)], axis=1)


def _frame(inclination: Array, azimuth: Array) -> tuple[Array, Array, Array]:
    """Direction t (..., 3) along the hole, and its derivatives by inclination and azimuth."""
    t = directions(inclination, azimuth)
    ah = np.stack([-t[..., 1], t[..., 0], np.zeros_like(t[..., 0])], axis=-1)
    return t, directions(inclination + 0.5 * np.pi, azimuth), ah


def _turns(p: Array, q: Array, beta: Array) -> tuple[Array, Array]:
    """Dogleg times the unit vectors (m, 3) in which the arc turns at its upper and lower end."""
    half = np.full_like(beta, 0.5)
    to_p = 0.5 * beta * np.tan(0.5 * beta)
    to_q = cosine(half, beta).value / sinc(half, beta).value
    return _combined(to_p, p, to_q, q), _combined(-to_p, p, to_q, q)


def _along(f: Array, beta: Array, p: Array, q: Array) -> Array:
    """Derivative (m, 3) of the direction by the fraction f of the interval."""
    phi, half = f - 0.5, np.full_like(f, 0.5)
    to_p = -0.5 * beta**2 * phi * sinc(phi, beta).value / cosine(half, beta).value
    return _combined(to_p, p, cosine(phi, beta).value / sinc(half, beta).value, q)


def _combined(to_p: Array, p: Array, to_q: Array, q: Array) -> Array:
    return np.asarray(to_p[:, None] * p + to_q[:, None] * q)
