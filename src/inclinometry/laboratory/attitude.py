"""The angles of the tool in the stand as it is now, by a calibration of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.acceptance import NEAR_VERTICAL
from inclinometry.calibration.result import Calibration
from inclinometry.errors import InclinometryError
from inclinometry.laboratory.ledger.ledger import Ledger, Record
from inclinometry.laboratory.session import Session
from inclinometry.orientation import angles
from inclinometry.rotations import wrap_positive
from inclinometry.wahba import solve_triad

_DIRECTIONS: Final = (1e-3, 1e-2)
"""Standard deviations of the two directions, rad: only that gravity is the better one counts."""


def attitude_in_stand(
    calibration: Calibration,
    mean: Mapping[str, Array],
    temperature: float | None = None,
    target: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> tuple[float, float, float] | None:
    """Azimuth, inclination and toolface of a tool in the stand it was calibrated on.

    Parameters
    ----------
    calibration : Calibration
        With the directions of the fields in the axes of this stand.
    mean : kind -> (m,) array
        Signals, in the units of the calibration.
    temperature : float, optional
        degC.
    target : (azimuth, inclination, toolface)
        rad; within 1 degree of the vertical azimuth and toolface are not separate, and what is found of them together
        is shared out as in the target.

    Returns
    -------
    (azimuth, inclination, toolface), rad, in the conventions; None where the calibration does not give them: other
    channels, not both fields, fields that are parallel.

    Notes
    -----
    The rotation C that takes the fields' directions in the stand to those the tool sees (TRIAD, gravity first); its
    third and first columns are the stand's vertical and the zero of its azimuth in tool axes.
    """
    second = "magnetometer" if "magnetometer" in calibration.tool.triads else "gyro"
    kinds, triads = ("accelerometer", second), calibration.tool.triads
    if any(
        kind not in triads or kind not in mean or kind not in calibration.field_directions or not triads[kind].full
        for kind in kinds
    ) or any(len(mean[kind]) != triads[kind].count for kind in kinds):
        return None
    try:
        seen = np.stack([triads[kind].field(mean[kind], temperature) for kind in kinds])
        there = np.stack([calibration.field_directions[kind] for kind in kinds])
        turn = solve_triad(seen, there, _DIRECTIONS).dcm
        found = angles(turn[:, 2], turn[:, 0])
    except InclinometryError:
        return None
    azimuth, inclination, toolface = float(found.azimuth), float(found.inclination), float(found.toolface)
    if inclination < NEAR_VERTICAL:
        azimuth, toolface = target[0], float(wrap_positive(azimuth + toolface - target[0]))
    elif inclination > np.pi - NEAR_VERTICAL:
        azimuth, toolface = target[0], float(wrap_positive(toolface - azimuth + target[0]))
    return azimuth, inclination, toolface


def earlier_calibration(ledger: Ledger, session: Session) -> Record | None:
    """The newest calibration of the session's tool on its rig, by another session; None when there is none."""
    for record in ledger.find("calibration", serial=session.serial, newest=True, limit=20):
        if record.keys["session"] != session.id and record.body.get("summary", {}).get("rig") == session.rig:
            return record
    return None
