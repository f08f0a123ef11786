"""Rotations: elementary matrices, the tool's direction cosines and their derivatives, quaternions, rotation vectors."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite, not_degrees
from inclinometry.errors import refused

TAU = 2.0 * np.pi


def wrap_positive(angle: ArrayLike) -> Array:
    """Wrap to [0, 2 pi), as azimuth and toolface are printed.

    Examples
    --------
    >>> float(np.degrees(wrap_positive(np.radians(-90.0))))
    270.0
    """
    wrapped = np.mod(np.asarray(angle, dtype=np.float64), TAU)
    # a tiny negative angle rounds up to 2 pi itself, which is outside the half-open range
    return np.where(wrapped >= TAU, 0.0, wrapped)


def wrap_signed(angle: ArrayLike) -> Array:
    """Wrap to [-pi, pi), as differences of angles are.

    Examples
    --------
    >>> float(np.degrees(wrap_signed(np.radians(350.0))).round(9))
    -10.0
    """
    return np.asarray(wrap_positive(np.asarray(angle, dtype=np.float64) + np.pi) - np.pi)


def rotation_x(angle: ArrayLike) -> Array:
    """Passive rotation (..., 3, 3) by rad about x: components of a fixed vector in axes turned by `angle`."""
    a = finite(angle, "angle")
    c, s, o, i = np.cos(a), np.sin(a), np.zeros_like(a), np.ones_like(a)
    return _matrix([[i, o, o], [o, c, s], [o, -s, c]])


def rotation_y(angle: ArrayLike) -> Array:
    """Passive rotation by `angle` (rad) about y, shape (..., 3, 3).

    Examples
    --------
    >>> (rotation_y(np.pi / 2) @ [0, 0, 1]).round(12)
    array([-1.,  0.,  0.])
    """
    a = finite(angle, "angle")
    c, s, o, i = np.cos(a), np.sin(a), np.zeros_like(a), np.ones_like(a)
    return _matrix([[c, o, -s], [o, i, o], [s, o, c]])


def rotation_z(angle: ArrayLike) -> Array:
    """Passive rotation by `angle` (rad) about z, shape (..., 3, 3).

    Examples
    --------
    >>> (rotation_z(np.pi / 2) @ [1, 0, 0]).round(12)
    array([ 0., -1.,  0.])
    """
    a = finite(angle, "angle")
    c, s, o, i = np.cos(a), np.sin(a), np.zeros_like(a), np.ones_like(a)
    return _matrix([[c, s, o], [-s, c, o], [o, o, i]])


def dcm(azimuth: ArrayLike, inclination: ArrayLike, toolface: ArrayLike) -> Array:
    """Matrix from north-east-down (or rig) components to tool components.

    Parameters
    ----------
    azimuth, inclination, toolface : (...) array_like
        rad; broadcast together.

    Returns
    -------
    (..., 3, 3) ndarray
        C_tn = R_z(T) R_y(I) R_z(A); its columns are north, east and down seen from the tool.

    Examples
    --------
    Lying toward the north with the index up, the tool's x points up, z north:

    >>> dcm(0.0, np.pi / 2, 0.0).round(12) + 0.0
    array([[ 0.,  0., -1.],
           [ 0.,  1.,  0.],
           [ 1.,  0.,  0.]])
    """
    inclination = not_degrees(inclination, "inclination")
    return np.asarray(rotation_z(toolface) @ rotation_y(inclination) @ rotation_z(azimuth))


def dcm_derivatives(azimuth: ArrayLike, inclination: ArrayLike, toolface: ArrayLike) -> Array:
    """Derivatives (..., 3, 3, 3) of `dcm` by azimuth, inclination, toolface: [..., d, i, j] of C_tn[i, j], per rad.

    dR_k(a)/da = -[k x] R_k(a) for a passive rotation about the unit vector k.
    """
    rz_t, ry, rz_a = rotation_z(toolface), rotation_y(inclination), rotation_z(azimuth)
    minus_y, minus_z = -cross_matrix([0.0, 1.0, 0.0]), -cross_matrix([0.0, 0.0, 1.0])
    by_azimuth = rz_t @ ry @ (minus_z @ rz_a)
    by_inclination = rz_t @ (minus_y @ ry) @ rz_a
    by_toolface = (minus_z @ rz_t) @ ry @ rz_a
    return np.stack(np.broadcast_arrays(by_azimuth, by_inclination, by_toolface), axis=-3)


def cross_matrix(v: ArrayLike) -> Array:
    """Matrix [v x] of the cross product: [v x] u = v x u; (..., 3) gives (..., 3, 3).

    Examples
    --------
    >>> cross_matrix([0, 0, 1]) @ [1, 0, 0]
    array([0., 1., 0.])
    """
    x, y, z = np.moveaxis(finite(v, "v", (3,)), -1, 0)
    o = np.zeros_like(x)
    return _matrix([[o, -z, y], [z, o, -x], [-y, x, o]])


def rotation_exp(vector: ArrayLike) -> Array:
    """Active rotation by |v| about v: the matrix exponential of [v x]; (..., 3) in rad gives (..., 3, 3).

    Rodrigues' formula with sinc, exact at zero. A passive rotation is its transpose: R_z(a) = exp([-a z x]).
    """
    v = finite(vector, "vector", (3,))
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    k = cross_matrix(v)
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * k + 0.5 * np.sinc(0.5 * angle / np.pi) ** 2 * (k @ k))


def rotation_log(matrix: ArrayLike) -> Array:
    """Rotation vector (..., 3), |v| <= pi rad, of rotation matrices (..., 3, 3): the inverse of `rotation_exp`."""
    return quaternion_log(quaternion_from_dcm(matrix))


def quaternion_from_dcm(matrix: ArrayLike) -> Array:
    """Unit quaternion (..., 4), scalar first and not negative, of rotation matrices (..., 3, 3).

    The quaternion of A @ B is `quaternion_multiply` (a, b). The largest row of 4 q q', linear in the matrix (Shepperd,
    J. Guidance and Control 1, 1978): no division by a small number. Off a rotation by more than 1e-6 is refused.
    """
    m = _proper(finite(matrix, "matrix", (3, 3)))
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    wx, wy, wz = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    xy, xz, yz = m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1]
    rows = _matrix(
        [
            [1.0 + xx + yy + zz, wx, wy, wz],
            [wx, 1.0 + xx - yy - zz, xy, xz],
            [wy, xy, 1.0 - xx + yy - zz, yz],
            [wz, xz, yz, 1.0 - xx - yy + zz],
        ]
    )
    best = np.argmax(np.diagonal(rows, axis1=-2, axis2=-1), axis=-1)[..., None, None]
    q = np.take_along_axis(rows, best, axis=-2)[..., 0, :]
    return _canonical(q)


def dcm_from_quaternion(quaternion: ArrayLike) -> Array:
    """Rotation matrix (..., 3, 3) of quaternions (..., 4), scalar first; their length does not matter.

    Examples
    --------
    >>> dcm_from_quaternion([0, 0, 0, 2]).diagonal()
    array([-1., -1.,  1.])
    """
    w, x, y, z = np.moveaxis(_unit_quaternion(finite(quaternion, "quaternion", (4,))), -1, 0)
    return _matrix(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def quaternion_multiply(left: ArrayLike, right: ArrayLike) -> Array:
    """Hamilton product of quaternions (..., 4), scalar first.

    Examples
    --------
    >>> quaternion_multiply([0, 1, 0, 0], [0, 0, 1, 0])
    array([0., 0., 0., 1.])
    """
    p, q = finite(left, "left", (4,)), finite(right, "right", (4,))
    p0, p1, p2, p3 = p[..., 0], p[..., 1], p[..., 2], p[..., 3]
    q0, q1, q2, q3 = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    product = np.empty(np.broadcast_shapes(p.shape, q.shape))
    product[..., 0] = p0 * q0 - (p1 * q1 + p2 * q2 + p3 * q3)
    product[..., 1] = p0 * q1 + q0 * p1 + (p2 * q3 - p3 * q2)
    product[..., 2] = p0 * q2 + q0 * p2 + (p3 * q1 - p1 * q3)
    product[..., 3] = p0 * q3 + q0 * p3 + (p1 * q2 - p2 * q1)
    return product


def quaternion_exp(vector: ArrayLike) -> Array:
    """Unit quaternion (..., 4) of the active rotation by the vector (..., 3), rad; see `rotation_exp`.

    Examples
    --------
    >>> quaternion_exp([np.pi, 0, 0]).round(12)
    array([0., 1., 0., 0.])
    """
    v = finite(vector, "vector", (3,))
    half = 0.5 * np.linalg.norm(v, axis=-1)[..., None]
    return np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * v], axis=-1)


def quaternion_log(quaternion: ArrayLike) -> Array:
    """Rotation vector (..., 3), |v| <= pi rad, of quaternions (..., 4): the inverse of `quaternion_exp`.

    Examples
    --------
    >>> quaternion_log([1.0, 0.0, 0.0, 0.0])
    array([0., 0., 0.])
    """
    q = _canonical(finite(quaternion, "quaternion", (4,)))
    sine = np.linalg.norm(q[..., 1:], axis=-1)
    # the ratio angle / sine tends to 2 at zero, where it is 0/0
    ratio = np.where(sine > 0.0, 2.0 * np.arctan2(sine, q[..., 0]) / np.where(sine > 0.0, sine, 1.0), 2.0)
    return np.asarray(ratio[..., None] * q[..., 1:])


def _matrix(rows: list[list[Array]]) -> Array:
    """Stack scalars (...) into (..., rows, columns)."""
    matrix = np.empty((*np.shape(rows[0][0]), len(rows), len(rows[0])))
    for i, row in enumerate(rows):
        for j, value in enumerate(row):
            matrix[..., i, j] = value
    return matrix


def _unit_quaternion(q: Array) -> Array:
    length = np.linalg.norm(q, axis=-1, keepdims=True)
    if not (length > 0.0).all():
        raise refused("sensor-vector-zero", {"name": "quaternion"})
    return np.asarray(q / length)


def _canonical(q: Array) -> Array:
    """Unit length and scalar part not negative: one of the two quaternions of a rotation."""
    unit = _unit_quaternion(q)
    return np.where(unit[..., :1] < 0.0, -unit, unit)


def _proper(m: Array) -> Array:
    """Return `m` when it is orthogonal with determinant +1."""
    slack = np.abs(m @ np.swapaxes(m, -1, -2) - np.eye(3)).max(initial=0.0)
    if slack > 1e-6 or (m.size and np.linalg.det(m).min() < 0.0):
        raise refused("sensor-matrix-improper", {"departure": float(slack), "most": 1e-6})
    return m
