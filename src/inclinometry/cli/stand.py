"""What is said of a stand, its dials and the fit of its readings: options that several commands share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Final, TypeAlias

from cyclopts import Parameter

from inclinometry.calibration.conventions import Base, Counts, Dials, InclinationFrom
from inclinometry.cli.options import DIALS, STAND, AzimuthOrNone, DipOrNone, Flag, SdOrNone, quantity

Step: TypeAlias = Annotated[float | None, quantity("", 0.0, 1e12)]


@Parameter(name="*", group=STAND)
@dataclass(frozen=True)
class StandOptions:
    """What is known of a stand, by the names of `workflow.calibrate.Options`."""

    rig_sd: SdOrNone = None
    """Standard deviation of a dial setting. Default: that of the registered rig, else estimated."""
    azimuth_sd: SdOrNone = None
    """Standard deviation of the azimuth dial."""
    inclination_sd: SdOrNone = None
    """Standard deviation of the inclination dial."""
    toolface_sd: SdOrNone = None
    """Standard deviation of the toolface dial."""
    level_sd: SdOrNone = None
    """Standard deviation of the level of the stand (joint only)."""
    north: AzimuthOrNone = None
    """Azimuth of the rig's zero from magnetic north. Sets the sign of the magnetic field."""
    north_sd: Annotated[float | None, quantity("deg", 0.0, 90.0)] = None
    """Standard deviation of --north-deg; with it, north enters the joint fit."""
    dip: DipOrNone = None
    """Magnetic dip at the stand, in place of that of the readings or the site."""
    dip_sd: SdOrNone = None
    """Standard deviation of the dip; with it, the dip enters the joint fit."""


@Parameter(name="*")
@dataclass(frozen=True)
class FitOptions:
    """What is known of the converters and of the constant errors of the rig, and the polynomial in temperature."""

    accel_step: Step = None
    """Converter step of the accelerometers, in channel units; 0 for none. Detected if not given."""
    mag_step: Step = None
    """Converter step of the magnetometers."""
    gyro_step: Step = None
    """Converter step of the gyros."""
    inclination_zero_sd: SdOrNone = None
    """Fit the zero error of the inclination dial with this prior. Default: not fitted."""
    nonorthogonality_sd: SdOrNone = None
    """Fit the non-orthogonality of the rig axes with this prior. Default: not fitted."""
    off_stand_scatter: Annotated[float | None, quantity("nT", 0.0, 1e5, above=True)] = None
    """Scatter of the magnetic field's components in readings off the stand (joint only). Default: estimated."""
    temperature_degree: int | None = None
    """Degree of the temperature polynomial. Default: chosen by information criterion."""


@Parameter(name="*", group=DIALS)
@dataclass(frozen=True)
class DialOptions:
    """How the dials of a stand count."""

    inclination_from: InclinationFrom | None = None
    """With the tool's end down the dial reads: vertical 0, other-end 180, horizontal 90 (positive below the
    horizon), horizontal-up -90. Default: vertical."""
    azimuth_counts: Counts | None = None
    """Direction of the azimuth dial, seen from above. Default: clockwise."""
    toolface_counts: Counts | None = None
    """Direction of the toolface dial, looking down hole. Default: clockwise."""
    base: Base | None = None
    """inverted: the rig is upside down; the tool points up where the inclination dial reads 0. upright if not given."""

    def given(self) -> dict[str, Any]:
        """Those that are given."""
        return {name: value for name, value in vars(self).items() if value is not None}

    def dials(self) -> Dials:
        """The dials, as usual where nothing is given."""
        return Dials(**self.given())


UNKNOWN: Final = StandOptions()
USUAL_FIT: Final = FitOptions()
USUAL_DIALS: Final = DialOptions()

LeftHanded: TypeAlias = Annotated[
    Flag,
    Parameter(
        name="--left-handed-channels",
        group=DIALS,
        help="The channels are left-handed: one reversed, or two exchanged. The dials are right.",
    ),
]
