"""Inclination, azimuth, toolface and dip from field vectors in tool axes, back again, and the analytic derivatives.

Everything is built on the triad north, east, down seen from the tool: d = g/|g|, e = unit(d x b), n = e x d, the
columns of C_tn. Only atan2 and hypot are used: arccos loses half the digits near vertical.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite, not_degrees
from inclinometry.errors import refused
from inclinometry.rotations import cross_matrix, dcm, wrap_positive

PLUMB = 1e-290
"""Sine of the inclination below which products of components run out of digits: taken as exactly vertical."""

SWITCH: Final = float(np.radians(5.0))
"""rad, inclination below which a tool is steered by its magnetic (or gyro) toolface A + T and from which on by its
gravity toolface: the high side of a steeper hole is poorly defined. 5 degrees is the usual setting of MWD tools."""


class Angles(NamedTuple):
    """Attitude of a tool, rad; azimuth and toolfaces in [0, 2 pi), inclination in [0, pi]."""

    inclination: Array
    azimuth: Array
    toolface: Array
    magnetic_toolface: Array


class _Triad(NamedTuple):
    """North, east, down in tool axes, with what is needed to differentiate them; leading axes free."""

    north: Array
    east: Array
    down: Array
    strength: Array  #: |g|
    b_north: Array  #: horizontal and downward parts of b
    b_down: Array


def angles(g: ArrayLike, b: ArrayLike) -> Angles:
    """Inclination, azimuth and toolfaces from two field vectors in tool axes.

    Parameters
    ----------
    g : (..., 3) array_like
        Gravity field (points down; not the specific force), any unit.
    b : (..., 3) array_like
        Second field, any unit: magnetic flux density gives magnetic azimuth, the Earth rate true azimuth.

    Returns
    -------
    Angles
        Each of shape (...). Where the tool is exactly vertical azimuth and toolface are not separate: azimuth is given
        as 0 and both toolfaces as the angle that reproduces the readings.

    Raises
    ------
    InputError
        When g or b is zero, or b is parallel to g: no azimuth exists.

    Notes
    -----
    I = atan2(hypot(gx, gy), gz), T = atan2(gy, -gx),
    A = atan2((gx by - gy bx) |g|, bz (gx^2 + gy^2) - gz (gx bx + gy by)), evaluated as atan2(e_z, n_z).
    Magnetic toolface A + T = atan2(e_x - n_y, n_x + e_y) keeps all its digits when the tool hangs vertically.

    Examples
    --------
    >>> g, b = fields(np.radians(45.0), np.radians(30.0), np.radians(100.0), np.radians(68.0))
    >>> [float(np.degrees(x).round(9)) for x in angles(9.8 * g, 50000.0 * b)]
    [30.0, 45.0, 100.0, 145.0]
    """
    t = _triad(g, b)
    d, e, n = t.down, t.east, t.north
    level = np.hypot(d[..., 0], d[..., 1])
    vertical = level < PLUMB
    hanging = wrap_positive(np.arctan2(e[..., 0] - n[..., 1], n[..., 0] + e[..., 1]))
    azimuth = np.where(vertical, 0.0, wrap_positive(np.arctan2(e[..., 2], n[..., 2])))
    toolface = np.where(vertical, _plumb_toolface(t), wrap_positive(np.arctan2(d[..., 1], -d[..., 0])))
    # pointing up it is toolface - azimuth that stays defined; the sum is then best formed from its parts
    magnetic = np.where(d[..., 2] > 0.0, hanging, wrap_positive(azimuth + toolface))
    return Angles(np.arctan2(level, d[..., 2]), azimuth, toolface, magnetic)


def angles_jacobian(g: ArrayLike, b: ArrayLike) -> Array:
    """Derivatives (..., 4, 6) of inclination, azimuth, toolface, magnetic toolface by gx..gz and bx..bz, rad per unit.

    North, east, down turn by theta = d x dg/|g| + d [e.db - (b_down/|g|) e.dg] / b_north. With h = (-cos T, sin T, 0),
    u = (sin T, cos T, 0): dI = -u.theta, dA = -h.theta / sin I, dT = -theta_z + cot I h.theta, d(A + T) = -theta_z -
    tan(I/2) h.theta. Vertical: azimuth and toolface are NaN (up: magnetic toolface too), inclination follows the
    toolface of `angles`.
    """
    t = _triad(g, b)
    theta = _triad_rotation(t)
    level = np.hypot(t.down[..., 0], t.down[..., 1])[..., None]
    vertical = level < PLUMB
    toolface = _plumb_toolface(t)[..., None]
    safe = np.where(vertical, 1.0, level)
    hx = np.where(vertical, -np.cos(toolface), t.down[..., 0:1] / safe)
    hy = np.where(vertical, np.sin(toolface), t.down[..., 1:2] / safe)
    along = hx * theta[..., 0, :] + hy * theta[..., 1, :]
    across = hy * theta[..., 0, :] - hx * theta[..., 1, :]
    cos_i = t.down[..., 2:3]
    sin_i = np.where(vertical, np.nan, level)
    # tan(I/2) by whichever form does not cancel
    half = np.where(cos_i > 0.0, level / np.where(cos_i > 0.0, 1.0 + cos_i, 1.0), (1.0 - cos_i) / sin_i)
    spin = theta[..., 2, :]
    rows = (-across, -along / sin_i, -spin + cos_i / sin_i * along, -spin - half * along)
    return np.stack(rows, axis=-2)


def attitude_jacobian(g: ArrayLike, b: ArrayLike) -> Array:
    """Derivatives (..., 3, 6) of the attitude by the six field components, regular at every inclination.

    Of the small rotation theta, rad, in tool axes, of north, east and down as seen from the tool: dn = theta x n.
    """
    return _triad_rotation(_triad(g, b))


def axis_jacobian(g: ArrayLike, b: ArrayLike) -> Array:
    """Derivatives (..., 3, 6) of the north, east, down components of the tool axis; columns as in `angles_jacobian`.

    Defined at every inclination. North, east and down turn by theta of `angles_jacobian`; their components along z
    change by those of theta x n, theta x e, theta x d.
    """
    t = _triad(g, b)
    theta = _triad_rotation(t)
    rows = [theta[..., 0, :] * v[..., 1:2] - theta[..., 1, :] * v[..., 0:1] for v in (t.north, t.east, t.down)]
    return np.stack(rows, axis=-2)


def inclination_toolface(g: ArrayLike) -> tuple[Array, Array]:
    """Inclination and toolface, rad, from gravity (..., 3) alone; toolface is given as 0 where exactly vertical."""
    d, _ = _unit(g, "g")
    level = np.hypot(d[..., 0], d[..., 1])
    toolface = np.where(level < PLUMB, 0.0, wrap_positive(np.arctan2(d[..., 1], -d[..., 0])))
    return np.arctan2(level, d[..., 2]), toolface


def dip_angle(g: ArrayLike, b: ArrayLike) -> Array:
    """Angle of b below the horizon, rad, positive down, shape (...)."""
    d, _ = _unit(g, "g")
    m, _ = _unit(b, "b")
    return np.asarray(np.arctan2(np.sum(d * m, axis=-1), np.linalg.norm(np.cross(d, m), axis=-1)))


def dip_jacobian(g: ArrayLike, b: ArrayLike) -> Array:
    """Derivatives (..., 6) of `dip_angle` by gx, gy, gz (rad per unit of g), bx, by, bz (rad per unit of b).

    d(dip) = n.dg/|g| + (b_north d - b_down n).db/|b|^2; g and b parallel are refused (the dip has a corner there).
    """
    t = _triad(g, b)
    strength = np.hypot(t.b_north, t.b_down)[..., None]
    by_b = (t.b_north[..., None] * t.down - t.b_down[..., None] * t.north) / strength**2
    return np.concatenate([t.north / t.strength[..., None], by_b], axis=-1)


def fields(azimuth: ArrayLike, inclination: ArrayLike, toolface: ArrayLike, dip: ArrayLike) -> tuple[Array, Array]:
    """Unit vectors of gravity and of the second field in tool axes; the inverse of `angles`.

    Parameters
    ----------
    azimuth, inclination, toolface, dip : (...) array_like
        rad; broadcast together. The azimuth is counted from the horizontal part of the second field. For the Earth
        rate the dip is minus the latitude.

    Returns
    -------
    g, b : (..., 3) ndarray

    Examples
    --------
    >>> g, b = fields(0.0, 0.0, 0.0, np.radians(90.0))
    >>> b.round(12)
    array([0., 0., 1.])
    """
    matrix, dip = np.broadcast_arrays(dcm(azimuth, inclination, toolface), not_degrees(dip, "dip")[..., None, None])
    dip = dip[..., 0, :1]
    north, down = matrix[..., 0], matrix[..., 2]
    return down.copy(), np.asarray(np.cos(dip) * north + np.sin(dip) * down)


def _unit(v: ArrayLike, name: str) -> tuple[Array, Array]:
    """Direction and length, guarded against zero."""
    vector = finite(v, name, (3,))
    # scaled first, so that neither 1e-200 nor 1e200 loses its direction
    scale = np.abs(vector).max(axis=-1, initial=0.0)
    if (scale == 0.0).any():
        at = [int(i) for i in np.argwhere(scale == 0.0)[0]]
        raise refused("sensor-vector-zero", {"name": f"{name}{at or ''}"})
    scaled = vector / scale[..., None]
    length = np.linalg.norm(scaled, axis=-1)
    return np.asarray(scaled / length[..., None]), np.asarray(scale * length)


def _triad(g: ArrayLike, b: ArrayLike) -> _Triad:
    """North, east, down; the one place where parallel fields are refused."""
    (d, strength), (m, length) = _unit(g, "g"), _unit(b, "b")
    cross = np.cross(d, m)
    sine = np.linalg.norm(cross, axis=-1)
    parallel = 1e-14  # sine of the angle between g and b below which rounding alone decides the azimuth
    if (sine < parallel).any():
        at = [int(i) for i in np.argwhere(sine < parallel)[0]]
        raise refused("sensor-fields-parallel", {"name": f"g{at or ''}, b{at or ''}"})
    e = cross / sine[..., None]
    shape = np.broadcast_shapes(d.shape, e.shape)
    d, strength = np.broadcast_to(d, shape), np.broadcast_to(strength, shape[:-1])
    return _Triad(
        np.cross(e, d), e, d, strength, np.asarray(length * sine), np.asarray(length * np.sum(d * m, axis=-1))
    )


def _triad_rotation(t: _Triad) -> Array:
    """Matrix (..., 3, 6): small rotation of the triad, in tool axes, per change of g and b."""
    per_g = 1.0 / t.strength[..., None]
    ratio = (t.b_down / t.b_north)[..., None]
    twist_g = t.down[..., :, None] * (-ratio * per_g * t.east)[..., None, :]
    twist_b = t.down[..., :, None] * (t.east / t.b_north[..., None])[..., None, :]
    return np.concatenate([cross_matrix(t.down) * per_g[..., None] + twist_g, twist_b], axis=-1)


def _plumb_toolface(t: _Triad) -> Array:
    """Toolface at azimuth 0 in a vertical tool: from A + T when it points down, from T - A when it points up."""
    sign = np.where(t.down[..., 2] > 0.0, 1.0, -1.0)
    sine, cosine = t.east[..., 0] - sign * t.north[..., 1], t.east[..., 1] + sign * t.north[..., 0]
    return wrap_positive(np.arctan2(sine, cosine))
