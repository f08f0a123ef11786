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
    """Random error of a setting of the rig. Default: that of the registered rig, or else estimated from the
    readings."""
    azimuth_sd: SdOrNone = None
    """The same for the azimuth dial alone."""
    inclination_sd: SdOrNone = None
    """The same for the inclination dial alone."""
    toolface_sd: SdOrNone = None
    """The same for the toolface dial alone."""
    level_sd: SdOrNone = None
    """How level the stand is known to be; the joint fit alone uses it."""
    north: AzimuthOrNone = None
    """Azimuth of the rig's zero from magnetic north; decides the sign of the magnetic field."""
    north_sd: Annotated[float | None, quantity("deg", 0.0, 90.0)] = None
    """How well that is known; with it north enters the joint fit, which alone uses it."""
    dip: DipOrNone = None
    """Magnetic dip at the stand, instead of the one in the readings or in --site."""
    dip_sd: SdOrNone = None
    """How well the dip is known; with it the dip enters the joint fit, which alone uses it."""


@Parameter(name="*")
@dataclass(frozen=True)
class FitOptions:
    """What is known of the converters and of the constant errors of the rig, and the polynomial in temperature."""

    accel_step: Step = None
    """Step of the accelerometers' converter, in the unit of their channels; 0 for none. When not given it is found
    where the readings clearly lie on a grid (whole counts, a fixed number of decimals)."""
    mag_step: Step = None
    """The same for the magnetometers."""
    gyro_step: Step = None
    """The same for the gyros."""
    inclination_zero_sd: SdOrNone = None
    """Fit a constant error of the inclination dial with this prior. Default: not fitted."""
    nonorthogonality_sd: SdOrNone = None
    """Fit the non-orthogonality of the rig's axes with this prior. Default: not fitted."""
    temperature_degree: int | None = None
    """Degree of the polynomial in temperature. Default: chosen by information criterion."""


@Parameter(name="*", group=DIALS)
@dataclass(frozen=True)
class DialOptions:
    """How the dials of a stand count."""

    inclination_from: InclinationFrom | None = None
    """Where the inclination dial counts from: vertical (0 with the tool's end down), other-end (180 there), horizontal
    (90 there, positive below the horizon) or horizontal-up (-90 there). Default: vertical."""
    azimuth_counts: Counts | None = None
    """Which way the azimuth dial counts, seen from above. Default: clockwise."""
    toolface_counts: Counts | None = None
    """Which way the toolface dial counts, looking down hole. Default: clockwise."""
    base: Base | None = None
    """inverted: the rig is upside down, so that the tool points up where the inclination dial says 0; upright when not
    given."""

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
