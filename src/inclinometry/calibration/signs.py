"""The one fact no reading tells: a tensor and its field may both be reversed without any signal changing."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from inclinometry.calibration.likelihood import State
from inclinometry.core.arrays import Array

_CLEAR = np.sin(np.radians(3.0))
"""A component smaller than this says nothing about a sign when the rig may be off by a few degrees."""


def fix_signs(
    state: State, reference: Mapping[str, float], priors: Mapping[str, tuple[Array, Array]]
) -> tuple[State, list[str]]:
    """Choose between each triad and its mirror image.

    Gravity points down. A prior on a field decides for its triad; the sign of a known dip decides for the magnetometer
    when the dip is steeper than 20 degrees. Otherwise the field is taken to point to the rig's azimuth 0 and down, and
    when those two disagree the larger component decides and a warning says so.

    Returns
    -------
    State, list of warnings
    """
    directions, coefficients = dict(state.directions), dict(state.coefficients)
    warnings: list[str] = []
    for kind, direction in state.directions.items():
        if kind in priors:
            sign = float(direction @ priors[kind][0])
        elif kind == "accelerometer":
            sign = float(direction[2])
        elif kind == "gyro":
            sign = float(direction[0])
            warnings.append(_faced(direction * np.sign(sign or 1.0)))
        else:
            sign, warning = _magnetic_sign(direction, reference.get("dip"))
            warnings += warning
        if sign < 0.0:
            directions[kind] = -direction
            coefficients[kind] = state.coefficients[kind] * np.array([-1.0, -1.0, -1.0, 1.0])
    return State(coefficients, directions, state.errors, state.nuisance), warnings


def _faced(direction: Array) -> str:
    """What taking the Earth rate towards the rig's azimuth 0 implies."""
    latitude = -np.degrees(np.arcsin(np.clip(direction[2], -1.0, 1.0)))
    return (
        "gyro: azimuth 0 of the rig is taken to be on the north side, which puts the stand at latitude "
        f"{latitude:+.1f} deg; if its sign is wrong the rig faces south and azimuths by gyro are 180 deg off"
    )


def _magnetic_sign(direction: Array, dip: float | None) -> tuple[float, list[str]]:
    north, _, down = direction.tolist()
    if dip is not None:
        return (np.sign(dip) * down if abs(dip) > np.radians(20.0) else north), []
    if north * down > 0.0 or abs(down) < _CLEAR:
        return north, []
    if abs(north) < _CLEAR:
        return down, []
    sign = down if abs(down) > abs(north) else north
    dipping = np.degrees(np.arcsin(np.clip(abs(down) * np.sign(down * sign), -1.0, 1.0)))
    return sign, [
        "the sign of the magnetic field is ambiguous: azimuth 0 of the rig points away from north or the field points "
        f"up; dip {dipping:.1f} deg was taken: give the dip of the site (reference_dip_deg) to be sure"
    ]
