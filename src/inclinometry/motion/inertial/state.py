"""What the filter knows at the end of a window, and the taking out of estimated errors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from inclinometry.attitude.rotations import quaternion_exp, quaternion_multiply, rotation_exp
from inclinometry.core.arrays import Array

NOMINAL = 20
"""Quaternion 0-3, gyro bias 4-6, gyro scale 7-9, accelerometer bias 10-12, hard iron 13-15, dip 16."""
STATES = 16


class Shaking(NamedTuple):
    """What is known of vibration and lever arm.

    scatter : (3,) m^2/s^4, variance of a window's mean by the tapers beside zero frequency, north, east, down; over
        windows in which it was of one level.
    bands : (2, 2) the same of the tapers of 2 and of 3 turns alone; horizontal, vertical.
    lever : (3,) m, position of the accelerometers; information : (3, 3) its inverse covariance.
    windows : seen in all; level : of these, since the level of shaking last rose.
    """

    scatter: Array
    bands: Array
    lever: Array
    information: Array
    windows: int
    level: int


@dataclass(frozen=True, eq=False)
class State:
    """Estimates at an instant.

    nominal : (20,) quaternion (north-east-down to tool), gyro bias, gyro scale, accelerometer bias, hard iron, dip.
    covariance : (16, 16) of estimate minus truth.
    offset : (16,) expected estimate minus truth; zero but where a start is linearised again.
    last : (3,) gyro sample before the window.
    strength : nT, of the reference field.
    field_variance : nT^2, of the noise that successive samples of the field show, averaged over windows.
    shaking : of the tool, as far as known.
    axis : (3,) of the tool, north, east, down, averaged over some minutes; nought before the first window.
    """

    nominal: Array
    covariance: Array
    offset: Array
    last: Array
    strength: float
    field_variance: float
    shaking: Shaking
    axis: Array

    @property
    def quaternion(self) -> Array:
        """(4,) of north-east-down to tool."""
        return self.nominal[:4]


def corrected(state: State, error: Array) -> State:
    """The state with an error (16,) taken out.

    The attitude's part of the covariance is turned with the tool, so that it stays what it was in north, east, down:
    an azimuth of which nothing is known must not leak into the level when the level is corrected.
    """
    nominal = state.nominal.copy()
    turned = quaternion_multiply(quaternion_exp(-error[:3]), nominal[:4])
    nominal[:4] = turned / np.linalg.norm(turned)
    nominal[4:17] -= error[3:]
    turn = carried(error)
    covariance = turn @ state.covariance @ turn.T
    return replace(
        state, nominal=nominal, covariance=0.5 * (covariance + covariance.T), offset=turn @ (state.offset - error)
    )


def carried(error: Array) -> Array:
    """Matrix (16, 16) that takes errors from before to after an error was taken out."""
    turn = np.eye(STATES)
    turn[:3, :3] = rotation_exp(-error[:3])
    return turn
