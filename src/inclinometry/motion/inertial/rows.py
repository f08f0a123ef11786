"""A state of the filter as a row of the common result: flags and quality."""

from __future__ import annotations

from typing import Final

import numpy as np

from inclinometry.attitude.rotations import dcm_from_quaternion
from inclinometry.core.arrays import Array
from inclinometry.motion.inertial.model import Model
from inclinometry.motion.inertial.settings import InertialSettings
from inclinometry.motion.inertial.state import State
from inclinometry.motion.inertial.window import MISFIT, MOST_REFUSED, Seen
from inclinometry.motion.result import BITS, METHODS, Attitude
from inclinometry.motion.samples import Samples

SETTLED: Final = 2
"""Windows after a start of which the rows are flagged."""
UPRIGHT: Final = float(np.radians(1.0))
"""Inclination, rad, below which azimuth and toolface are said to be hardly defined."""
LOST: Final = 0.26
"""Standard uncertainty of azimuth, rad, from which nothing is said to determine it: no longer small."""
TURNING: Final = 0.1
"""rad/s, rate about the tool axis above which a tool counts as turning."""
FASTEST: Final = 1.5
"""Turn between two samples, rad, from which the integration is no longer trusted."""


def row(
    time: float, state: State, covariance: Array, seen: Seen, age: int, window: Samples, model: Model, method: str
) -> Attitude:
    """One row; `age` counts windows since the start."""
    quaternion, dip = state.quaternion, float(state.nominal[16])
    covariance = with_gain(quaternion, covariance, dip, model.gain(np.asarray(window.gyro)), model.magnetic)
    covariance = covariance + common(
        quaternion, dip, float(np.sqrt(np.mean(np.asarray(window.gyro)[:, 2] ** 2))), model
    )
    names = _names(quaternion, covariance, seen, age, window, model)
    return Attitude(
        time=np.array([time]),
        quaternion=quaternion[None] * (1.0 if quaternion[0] >= 0.0 else -1.0),
        covariance=covariance[None],
        rate=np.array([seen.rate]),
        quality=np.array([_quality(covariance, seen, model.settings)]),
        flags=np.array([sum(BITS[name] for name in names)], dtype=np.uint32),
        method=np.array([METHODS.index(method)], dtype=np.uint8),
        north="magnetic" if model.magnetic else "true",
    )


def with_gain(quaternion: Array, covariance: Array, dip: float, gain: float, magnetic: bool) -> Array:
    """The covariance (3, 3) of an attitude, what an uncertain gain across the tool does to it added.

    A tilt in the vertical plane of the axis; azimuth from the field follows its tilt about north by tan(dip).
    """
    matrix = dcm_from_quaternion(quaternion)
    axis = matrix[2]
    level = np.hypot(axis[0], axis[1])
    if level == 0.0:
        return covariance
    turn = np.array([-axis[1], axis[0], 0.0]) / level
    if magnetic:
        turn[2] = turn[0] * np.tan(dip)
    tilt = matrix @ turn * (gain * level * axis[2])
    return np.asarray(covariance + np.outer(tilt, tilt))


def common(quaternion: Array, dip: float, speed: float, model: Model) -> Array:
    """Covariance (3, 3) of what is the same in every window of a turning tool: axes askew, clocks out of step.

    A field late by t is turned about the tool axis by `speed` t against gravity: azimuth follows, by what of that turn
    goes east over the horizontal field; a gyro late by t carries the toolface on as far.
    """
    settings, matrix = model.settings, dcm_from_quaternion(quaternion)
    turning = speed / np.hypot(speed, TURNING)
    found = np.diag([1.0, 1.0, 0.0]) * (settings.coupling_sigma * turning) ** 2
    late = speed * settings.delay_sigma_s
    found[2, 2] += late**2
    if model.magnetic:
        north, east, down = matrix.T
        field = np.cos(dip) * north + np.sin(dip) * down
        across = np.cross([0.0, 0.0, 1.0], field) @ east / max(np.cos(dip), 1e-6)
        found += np.outer(down, down) * (late * across) ** 2
    return np.asarray(found)


def _names(quaternion: Array, covariance: Array, seen: Seen, age: int, window: Samples, model: Model) -> list[str]:
    down = dcm_from_quaternion(quaternion)[:, 2]
    fastest = np.abs(np.asarray(window.gyro)).max() * window.interval
    conditions = {
        "clipped": seen.clipped,
        "start": age < SETTLED,
        "disturbed": seen.disturbed,
        "misfit": not seen.clipped and seen.gravity < 0.0,
        "drift": (seen.disturbed or not model.magnetic) and not seen.still,
        "vertical": float(np.hypot(down[0], down[1])) < np.sin(UPRIGHT),
        "unobservable": float(down @ covariance @ down) > LOST**2,
        "aliased": fastest > FASTEST,
    }
    return [name for name, holds in conditions.items() if holds]


def _quality(covariance: Array, seen: Seen, settings: InertialSettings) -> float:
    """Least of what uncertainty, field and gravity leave of their limits."""
    spread = float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    shares = [spread / settings.u_limit, 1.0 if seen.gravity < 0.0 else seen.gravity / settings.gate]
    if np.isfinite(seen.misfit):
        shares.append(max(seen.misfit / MISFIT - 1.0, seen.refused / MOST_REFUSED))
    return float(np.clip(1.0 - max(shares), 0.0, 1.0))
