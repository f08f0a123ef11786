"""The angles of the tool in the stand as it is now, by a calibration of it, and how far they are from the target."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.conformity import NEAR_VERTICAL, attitude_covariance
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.constants import DIALS
from inclinometry.errors import InclinometryError
from inclinometry.findings import Finding
from inclinometry.laboratory.ledger.ledger import Ledger, Record
from inclinometry.laboratory.placeholders import stated
from inclinometry.laboratory.registry import evaluations
from inclinometry.laboratory.session import Capture, Session, dial_at, setting_of
from inclinometry.orientation import angles
from inclinometry.rotations import dcm, rotation_log, wrap_positive, wrap_signed
from inclinometry.wahba import solve_triad

FAR: Final = float(np.radians(3.0))
"""Rotation from the target, rad, from which on a capture needs a reason, where it is more than chance, too."""


class FarError(InclinometryError):
    """The tool is far from the target; it is captured only with a reason."""


@dataclass(frozen=True, eq=False)
class Judge:
    """The calibration that says where the tool points; `made` when, "" for the running fit of the session."""

    calibration: Calibration
    made: str


@dataclass(frozen=True)
class OffTarget:
    """Where the tool is, and how far from its target.

    shown, dial : what the dials would say of the tool, and what they are to say, rad.
    rotation : between the two attitudes, rad.
    deviations : the same in standard deviations of calibration, reading and setting together.
    """

    shown: tuple[float, float, float]
    dial: tuple[float, float, float]
    rotation: float
    deviations: float

    @property
    def far(self) -> bool:
        """Whether it is captured only with a reason."""
        # fewer standard deviations are no proof of a wrong position (a dial of 1 deg may be 3 deg off); more are
        return self.deviations > 10.0 or (self.rotation > FAR and self.deviations > 5.0)

    @property
    def off(self) -> Array:
        """(3,) difference of each dial, rad."""
        return wrap_signed(np.subtract(self.shown, self.dial))

    @property
    def dials(self) -> tuple[Finding, ...]:
        """What the dials would say and are to say, of those that are off by a third of the largest difference.

        >>> off = OffTarget((0.0, *np.radians([40.0, 0.0])), (0.0, *np.radians([120.0, 0.0])), 1.4, 80.0)
        >>> [str(one) for one in off.dials]
        ['inclination 40.0 deg, target 120.0 deg']
        """
        off, rows = np.abs(self.off), np.degrees([self.shown, self.dial]).round(1).T + 0.0
        return tuple(
            Finding("ledger-dial-off", {"dial": name, "shown_deg": float(now), "target_deg": float(target)})
            for name, size, (now, target) in zip(DIALS, off, rows, strict=True)
            if size > 0.0 and 3.0 * size >= off.max()
        )


def seen_from_stand(
    calibration: Calibration, mean: Mapping[str, Array], temperature: float | None = None
) -> Array | None:
    """(3, 3) axes of the stand to those of the tool; None where the calibration does not give it; TRIAD.

    The rotation takes the fields' directions in the stand to those the tool sees, gravity first; its third and first
    columns are the stand's vertical and its azimuth zero in tool axes.
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
        # standard deviations of the two directions, rad: only that gravity is the better one counts
        return solve_triad(seen, there, (1e-3, 1e-2)).dcm
    except InclinometryError:
        return None


def stand_angles(turn: Array, target: tuple[float, float, float]) -> tuple[float, float, float]:
    """Azimuth, inclination, toolface (rad) in the stand.

    Within 1 degree of the vertical (20 where the target is vertical) azimuth and toolface are not separate: their sum
    is shared out as in the target.
    """
    found = angles(turn[:, 2], turn[:, 0])
    azimuth, inclination, toolface = float(found.azimuth), float(found.inclination), float(found.toolface)
    # a tool that leans a little, where it is to hang, leans in any direction
    upright = np.radians(20.0) if np.sin(target[1]) < np.sin(NEAR_VERTICAL) else NEAR_VERTICAL
    if inclination < upright:
        azimuth, toolface = target[0], float(wrap_positive(azimuth + toolface - target[0]))
    elif inclination > np.pi - upright:
        azimuth, toolface = target[0], float(wrap_positive(toolface - azimuth + target[0]))
    return azimuth, inclination, toolface


def off_target(judge: Judge, session: Session, sd: tuple[float, float, float], reading: Capture) -> OffTarget | None:
    """How far the tool is from what the dials of a reading say; `sd` is that of a setting of the three dials, rad.

    The attitudes are compared as a rotation e in tool axes, regular at the vertical: |e| is the difference, sqrt(e'
    S^-1 e) the number of standard deviations. S adds calibration, noise of the reading and dials, linearised at the
    target; a tool clamped again, aged, or at another temperature agrees with a calibration to 0.5 deg.
    """
    calibration, target = judge.calibration, setting_of(session.dials, reading.dial)
    turn = seen_from_stand(calibration, reading.channels, reading.temperature)
    if turn is None:
        return None
    heat, span = reading.temperature, calibration.tool.temperature_range
    outside = heat is not None and span is not None and not span[0] - 5.0 <= heat <= span[1] + 5.0  # degC
    remounted = np.radians(0.5) if judge.made or outside else 0.0
    try:
        readings = BenchReadings(
            {kind: np.asarray(x)[None] for kind, x in reading.channels.items() if kind in calibration.tool.triads},
            azimuth=np.array(target[:1]),
            inclination=np.array(target[1:2]),
            toolface=np.array(target[2:]),
            count=np.array([float(reading.count)]),
            temperature=None if heat is None else np.array([heat]),
            units=dict(reading.units),
        )
        own = replace(calibration, rig=replace(calibration.rig, sd=np.asarray(sd, dtype=float)))
        covariance = attitude_covariance(readings, own)[0] + remounted**2 * np.eye(3)
        e = rotation_log(turn @ dcm(*target).T)
        deviations = float(np.sqrt(np.maximum(e @ np.linalg.solve(covariance, e), 0.0)))
    except (InclinometryError, np.linalg.LinAlgError):
        return None
    shown = dial_at(session.dials, *stand_angles(turn, target))
    return OffTarget(shown, reading.dial, float(np.linalg.norm(e)), deviations)


def at_target(
    reading: Capture, judge: Judge | None, session: Session, sd: tuple[float, float, float], reason: str = ""
) -> Capture:
    """The reading, to be recorded: as it is at its target, with the reason for taking it far from it.

    Raises FarError: far from the target, and no reason.
    """
    off = None if judge is None else off_target(judge, session, sd, reading)
    if off is None or not off.far:
        return reading
    if not stated(reason):
        # turned until it agrees, a tool that has changed would pass its verification
        code = "ledger-far-verifying" if session.purpose == "verify" else "ledger-far-from-target"
        raise FarError(Finding(code, {"dials": off.dials}, severity="refused"))
    dials = " and ".join(map(str, off.dials))
    return replace(reading, note="; ".join(filter(None, [f"{dials}: {reason.strip()}", reading.note])))


def earlier_calibration(ledger: Ledger, session: Session) -> Record | None:
    """The newest calibration of the session's tool on its rig, by another session; None when there is none."""
    for one in reversed(evaluations(ledger, session.serial, limit=20)):
        if one.keys["session"] != session.id:
            record = ledger.get("calibration", one.id)
            if record.body.get("summary", {}).get("rig") == session.rig:
                return record
    return None
