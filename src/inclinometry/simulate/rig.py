"""A calibration rig with errors of its own: base, axes, zeros, settings, and gross faults for tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.attitude.rotations import dcm, rotation_x, rotation_y, rotation_z
from inclinometry.core.arrays import Array, finite, frozen
from inclinometry.core.constants import DIP, LATITUDE
from inclinometry.core.errors import InputError

DIALS: Final = ("azimuth", "inclination", "toolface")
"""The rig's dials, in the order of every vector of settings."""


@dataclass(frozen=True)
class Misread:
    """A dial written down wrongly: the record says `size` rad more than what was set.

    station counts from 0; dial is "azimuth", "inclination" or "toolface".
    """

    station: int
    dial: str
    size: float

    def __post_init__(self) -> None:
        if self.dial not in DIALS:
            raise InputError(f"dial is {self.dial!r}; allowed: {', '.join(DIALS)}")


@dataclass(frozen=True)
class Bump:
    """A station (from 0) at which the tool was knocked by `size` rad about a random axis after the dials were read."""

    station: int
    size: float


@dataclass(frozen=True, eq=False)
class Rig:
    """Three frames on a base that is neither level nor pointed at north, in known fields.

    Parameters
    ----------
    dip : float
        Of the magnetic field, rad, positive down.
    latitude, declination : float
        rad; where the gyro triad sees the Earth rate (declination: of magnetic north, east of true).
    base_tilt : float
        rad, about the horizontal axis at azimuth `tilt_axis`.
    tilt_axis : float, optional
        rad from the rig's zero; drawn anew for each simulated calibration when not given.
    north_offset : float
        Azimuth, from magnetic north, of the rig's zero, rad.
    setting_sd : float or (3,) array_like
        Standard deviation of each setting of azimuth, inclination, toolface, rad; common to all triads.
    inclination_zero, toolface_zero : float
        What is added to every dialled angle, rad.
    outer, inner : float
        Non-orthogonality between the azimuth and inclination axes and between the inclination and toolface axes, rad.
    faults : sequence of Misread or Bump

    Raises
    ------
    InputError
        Values not finite, negative setting_sd.

    Notes
    -----
    The rig turns the tool by C = R_z(T) R_x(inner) R_y(I) R_x(outer) R_z(A).

    Examples
    --------
    >>> rig = Rig(dip=np.radians(70), base_tilt=np.radians(5), tilt_axis=0.0)
    >>> rig.direction("accelerometer").round(4)
    array([0.    , 0.0872, 0.9962])
    """

    dip: float = DIP
    latitude: float = LATITUDE
    declination: float = 0.0
    base_tilt: float = 0.0
    tilt_axis: float | None = None
    north_offset: float = 0.0
    setting_sd: Array | float = 0.0
    inclination_zero: float = 0.0
    toolface_zero: float = 0.0
    outer: float = 0.0
    inner: float = 0.0
    faults: Sequence[Misread | Bump] = ()

    def __post_init__(self) -> None:
        numbers = ("dip", "latitude", "declination", "base_tilt", "north_offset", "inclination_zero", "toolface_zero")
        for name in (*numbers, "outer", "inner"):
            finite(getattr(self, name), name)
        if self.tilt_axis is not None:
            finite(self.tilt_axis, "tilt_axis")
        spread = finite(self.setting_sd, "setting_sd")
        if spread.shape not in ((), (3,)) or (spread < 0.0).any():
            raise InputError(f"setting_sd is {self.setting_sd!r}; expected one value of 0 or more rad, or three")
        object.__setattr__(self, "setting_sd", frozen(np.broadcast_to(spread, (3,))))
        object.__setattr__(self, "faults", tuple(self.faults))

    def attitude(self, tilt_axis: ArrayLike | None = None) -> Array:
        """Rotation (..., 3, 3) from magnetic north, east, down to rig axes; tilt_axis (...) replaces the rig's own."""
        axis = self.tilt_axis if tilt_axis is None else tilt_axis
        if axis is None:
            if self.base_tilt != 0.0:
                raise InputError("the base is tilted about a random axis; give tilt_axis")
            axis = 0.0
        psi = np.asarray(axis, dtype=np.float64)
        tilt = rotation_z(-psi) @ rotation_x(self.base_tilt) @ rotation_z(psi)
        return np.asarray(tilt @ rotation_z(self.north_offset))

    def direction(self, kind: str, tilt_axis: ArrayLike | None = None) -> Array:
        """True unit field direction (..., 3) in rig axes for a kind of triad."""
        return np.asarray(self.attitude(tilt_axis) @ field_direction(kind, self.dip, self.latitude, self.declination))

    def orientation(self, settings: ArrayLike) -> Array:
        """Rotation (..., 3, 3) from rig to tool axes at true settings (..., 3) of azimuth, inclination, toolface."""
        a, i, t = np.moveaxis(finite(settings, "settings", (3,)), -1, 0)
        if self.inner == 0.0 and self.outer == 0.0:
            return dcm(a, i, t)
        upper = rotation_z(t) @ rotation_x(self.inner) @ rotation_y(i)
        return np.asarray(upper @ rotation_x(self.outer) @ rotation_z(a))

    def zeros(self) -> Array:
        """Constant errors (3,) of azimuth, inclination, toolface; the azimuth's is `north_offset`, not here."""
        return np.array([0.0, self.inclination_zero, self.toolface_zero])


def field_direction(kind: str, dip: float, latitude: float, declination: float) -> Array:
    """Unit vector (3,) along the field in magnetic north, east, down.

    The Earth rate is (cos lat, 0, -sin lat) from true north, which lies `declination` west of magnetic north.

    Examples
    --------
    >>> field_direction("magnetometer", np.radians(30), 0, 0).round(3)
    array([0.866, 0.   , 0.5  ])
    """
    if kind == "accelerometer":
        return np.array([0.0, 0.0, 1.0])
    if kind == "magnetometer":
        return np.array([np.cos(dip), 0.0, np.sin(dip)])
    level = np.cos(latitude)
    return np.array([level * np.cos(declination), -level * np.sin(declination), -np.sin(latitude)])
