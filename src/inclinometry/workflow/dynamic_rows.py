"""From the motion room's attitudes to the rows of a file: the north asked for, and what the calibration adds."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Final

import numpy as np

from inclinometry.attitude.orientation import Angles, angles_jacobian, fields
from inclinometry.attitude.rotations import dcm_from_quaternion, quaternion_from_dcm, rotation_z
from inclinometry.calibration.result import Calibration
from inclinometry.core.angles import TAU
from inclinometry.core.arrays import Array, Mask
from inclinometry.core.constants import DIP
from inclinometry.earth.site import REFERENCES, Site
from inclinometry.motion.result import Attitude
from inclinometry.motion.run_result import AttitudeRows
from inclinometry.sensors.sensitivity import angle_sensitivity
from inclinometry.survey.reduce import turned_to_north
from inclinometry.uncertainty.propagation import UNKNOWN

TURNS: Final = 8
"""Toolfaces over which the calibration's share is averaged while the tool turns."""
NOTHING: Final = 0.999
"""Share of the uncertainty of an angle nothing is known of from which it is left blank."""
ACCEL_SHARE: Final = 1.0 / 3.0
"""Scale errors of uncalibrated accelerometers, of those of the magnetometer."""


class Rows:
    """Collects rows; each part of a run comes with the length of its windows.

    Parameters
    ----------
    site : Site
        Its `north_reference` is what azimuths are counted from; a gyro's is never turned to magnetic north.
    calibration : Calibration, optional
    window : float
        s; a tool that turns more than once in it is seen from all sides.
    scale : float
        Without a calibration, standard deviation of each scale error and coupling of the magnetometer; a third of it
        is the accelerometers'.
    """

    def __init__(self, site: Site, calibration: Calibration | None, window: float, scale: float = 0.0) -> None:
        self._scale = scale
        self._site, self._calibration, self._window = site, calibration, window
        self._parts: list[AttitudeRows] = []
        self.notes: list[str] = []
        self.heat: float | None = None
        """degC of the rows to come, for a calibration that depends on it."""

    def __len__(self) -> int:
        return sum(map(len, self._parts))

    def add(self, found: Attitude) -> None:
        """Rows that follow those before.

        Raises
        ------
        InputError
            The site lacks the declination or convergence its north reference needs.
        """
        self.notes += [note for note in found.notes if note not in self.notes]
        if not len(found):
            return
        at, u = found.angles, found.u
        good = ~found.refused
        own = np.stack(u, axis=1) ** 2
        if good.any():
            turning = np.abs(np.nan_to_num(found.rate[good])) * self._window > TAU
            seen = Angles(*(column[good] for column in at))
            if self._calibration is not None:
                own[good] += self._by_calibration(self._calibration, seen, turning, found.north)
            elif self._scale:
                own[good] += self._by_scale(seen, turning, found.north)
        azimuth, north, quaternion = np.full(len(found), np.nan), found.north, found.quaternion.copy()
        if good.any():
            turned, variances, north, said = turned_to_north(
                at.azimuth[good], {"own": own[good]}, self._site, found.north
            )
            azimuth[good] = turned
            own[good] = np.sum(list(variances.values()), axis=0)
            # C(A + d, I, T) = C(A, I, T) R_z(d)
            by = rotation_z(turned - at.azimuth[good])
            quaternion[good] = quaternion_from_dcm(dcm_from_quaternion(quaternion[good]) @ by)
            self.notes += [note for note in said if note not in self.notes]
        spread = np.minimum(np.sqrt(own), UNKNOWN)
        # an angle of which nothing is known is no angle, though the row has others
        unknown = spread >= NOTHING * UNKNOWN
        self._parts.append(
            AttitudeRows(
                time=found.time,
                inclination=at.inclination,
                azimuth=np.where(unknown[:, 1], np.nan, azimuth),
                toolface=np.where(unknown[:, 2], np.nan, at.toolface),
                u_inclination=spread[:, 0],
                u_azimuth=spread[:, 1],
                u_toolface=spread[:, 2],
                rate=found.rate,
                quality=found.quality,
                flags=found.flags,
                method=found.method,
                north=np.full(len(found), REFERENCES.index(north), dtype=np.uint8),
                quaternion=np.where(unknown[:, 3:], np.nan, quaternion),
                magnetic_toolface=np.where(unknown[:, 3], np.nan, at.magnetic_toolface),
                u_magnetic_toolface=spread[:, 3],
            )
        )

    def done(self) -> AttitudeRows:
        """All rows."""
        # a run without a whole window has been refused: there is a part
        return AttitudeRows(
            **{
                each.name: np.concatenate([getattr(part, each.name) for part in self._parts])
                for each in dataclasses.fields(AttitudeRows)
            }
        )

    def _by_calibration(self, calibration: Calibration, at: Angles, turning: Mask, source: str) -> Array:
        """Variances (k, 4) of inclination, azimuth and toolfaces by scale factors and couplings of the calibration.

        Offsets are left to the methods, which know whether the tool turned them away; so is the gyro, whose bias and
        scale are states of the filters.
        """
        tool = calibration.tool
        if "accelerometer" not in tool.triads:
            return np.zeros((len(turning), 4))
        heat = None if self.heat is None else np.full(len(turning), self.heat)
        moved = np.zeros((len(turning), 4, len(tool.parameter_names)))
        for g, b in self._seen(at, turning):
            seen = {"accelerometer": g}
            if source == "magnetic" and "magnetometer" in tool.triads:
                seen["magnetometer"] = b
            moved += angle_sensitivity(tool, seen, heat).by_parameter / TURNS
        # exactly vertical azimuth and toolface have no derivative: their uncertainty is unbounded anyway
        moved = np.where(np.isfinite(moved), moved, 0.0)
        moved[..., [".offset[" in name for name in tool.parameter_names]] = 0.0
        return np.asarray(np.einsum("kap,pq,kaq->ka", moved, tool.covariance, moved, optimize=True))

    def _by_scale(self, at: Angles, turning: Mask, source: str) -> Array:
        """Variances (k, 4) by scale errors and couplings, each independent, of sensors that no calibration vouches for.

        A change E of a triad's matrix moves its field v by E v; what turns with the tool averages out.
        """
        moved = np.zeros((2, len(turning), 4, 3, 3))
        for g, b in self._seen(at, turning):
            slopes = angles_jacobian(g, b) / TURNS
            slopes = np.where(np.isfinite(slopes), slopes, 0.0)
            moved[0] += slopes[:, :, :3, None] * g[:, None, None, :]
            moved[1] += slopes[:, :, 3:, None] * b[:, None, None, :]
        by_accel, by_mag = np.sum(moved**2, axis=(3, 4))
        return np.asarray(self._scale**2 * (ACCEL_SHARE**2 * by_accel + (by_mag if source == "magnetic" else 0.0)))

    def _seen(self, at: Angles, turning: Mask) -> Iterator[tuple[Array, Array]]:
        """Directions of gravity and field from `TURNS` sides where the tool turns, else as often from the one."""
        dip = DIP if self._site.dip is None else self._site.dip
        for step in range(TURNS):
            toolface = at.toolface + np.where(turning, TAU * step / TURNS, 0.0)
            yield fields(at.azimuth, at.inclination, toolface, dip)
