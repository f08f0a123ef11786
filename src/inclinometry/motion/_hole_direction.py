"""The direction of the hole beside the roll of the tool in it: frames that follow the hole without turning about it.

A hole frame H (3, 3), north-east-down to hole, has z down hole and no turn about z of its own; the tool is
C = R_z(roll) H. A small rotation vector p (its x and y) leads from H to exp(-[p x]) H. With C = (1 + [e x]) true C a
measured direction errs by p = -M e, M the turn by minus the roll.
"""

from __future__ import annotations

import math

import numpy as np

from inclinometry.arrays import Array
from inclinometry.uncertainty import UNKNOWN


def turned(frame: Array, offset: Array) -> Array:
    """Frame moved by the rotation vector (2,): exp(-[p x]) H."""
    x, y = float(offset[0]), float(offset[1])
    angle = math.hypot(x, y)
    a = math.sin(angle) / angle if angle > 0.0 else 1.0
    b = 2.0 * (math.sin(0.5 * angle) / angle) ** 2 if angle > 0.0 else 0.5
    rotation = np.array(
        [[1.0 - b * y * y, b * x * y, -a * y], [b * x * y, 1.0 - b * x * x, a * x], [a * y, -a * x, math.cos(angle)]]
    )
    return np.asarray(rotation @ frame)


def clean(frame: Array) -> Array:
    """Rows made orthonormal again, the z row kept."""
    z = frame[2] / math.sqrt(float(frame[2] @ frame[2]))
    x = frame[0] - (frame[0] @ z) * z
    x = x / math.sqrt(float(x @ x))
    return np.stack([x, np.cross(z, x), z])


def offset_of(frame: Array, direction: Array) -> Array:
    """Rotation vector (2,) from the frame's z to a direction given in north-east-down."""
    h = frame @ direction
    sine = math.hypot(h[0], h[1])
    if sine == 0.0 and h[2] < 0.0:  # straight back: any axis will do
        return np.array([math.pi, 0.0])
    ratio = math.atan2(sine, h[2]) / sine if sine > 0.0 else 1.0
    return np.array([-h[1] * ratio, h[0] * ratio])


def observe(frame: Array, matrix: Array, covariance: Array) -> tuple[Array, Array, float]:
    """A row's attitude compared with a hole frame.

    Rotation vector (2,) from the frame to the measured direction, its covariance (2, 2), and the tool's roll in the
    measured direction's own frame.
    """
    offset = offset_of(frame, matrix[2])
    spin = matrix @ turned(frame, offset).T
    roll = math.atan2(spin[0, 1], spin[0, 0])
    back = _turn(roll)
    return offset, back @ covariance[:2, :2] @ back.T, roll


def with_azimuth(matrix: Array, covariance: Array, direction: Array) -> Array:
    """The row's attitude, turned to the azimuth of a direction where it knows none of its own."""
    down = matrix[:, 2]
    if not azimuth_unknown(matrix, covariance) or math.hypot(down[0], down[1]) < 1e-3:
        return matrix
    own = matrix[2]
    turn = math.atan2(direction[1], direction[0]) - math.atan2(own[1], own[0])
    c, s = math.cos(turn), math.sin(turn)
    return np.asarray(matrix @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))


def azimuth_unknown(matrix: Array, covariance: Array) -> bool:
    """Whether the turn about the vertical is unknown."""
    # rad, standard deviation beyond which a row's azimuth is no measurement
    return float(matrix[:, 2] @ covariance @ matrix[:, 2]) > 0.3**2


def rolled(frame: Array, spread: Array, matrix: Array, covariance: Array) -> tuple[Array, Array]:
    """Attitude (3, 3) and covariance of a tool whose direction is the frame's and whose roll this row measured.

    `spread` (2, 2): covariance of the direction's rotation vector; the row is already counted in it. With
    G = P_z,xy P_xy^-1 the roll is corrected by G e_xy, and P_zz <- P_zz - G P_xy,z + G P_xy(estimate) G': the Kalman
    update of a roll about which nothing else is known.
    """
    offset, _, seen = observe(frame, matrix, covariance)
    back = _turn(seen)
    gain: Array = np.asarray(np.linalg.solve(covariance[:2, :2], covariance[:2, 2]), dtype=np.float64)
    roll = seen - float(gain @ (back.T @ offset))
    across = back.T @ spread @ back
    own = float(covariance[2, 2] - gain @ covariance[:2, 2])
    return _upright(roll) @ frame, _joint(across, gain, own)


def carried(frame: Array, spread: Array, roll: float, variance: float) -> tuple[Array, Array]:
    """Attitude and covariance of a tool with a roll of its own variance, independent of the direction."""
    back = _turn(roll)
    return _upright(roll) @ frame, _joint(back.T @ spread @ back, np.zeros(2), min(variance, UNKNOWN**2))


def _joint(across: Array, gain: Array, own: float) -> Array:
    joint = np.empty((3, 3))
    joint[:2, :2] = 0.5 * (across + across.T)
    joint[:2, 2] = joint[2, :2] = joint[:2, :2] @ gain
    joint[2, 2] = own + gain @ joint[:2, :2] @ gain
    return joint


def _turn(roll: float) -> Array:
    """Tool x, y to hole x, y."""
    c, s = math.cos(roll), math.sin(roll)
    return np.array([[c, -s], [s, c]])


def _upright(roll: float) -> Array:
    c, s = math.cos(roll), math.sin(roll)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
