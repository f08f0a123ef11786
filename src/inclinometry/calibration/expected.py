"""Expected uncertainty of the angles of a calibrated tool: the one function every table, page and certificate calls.

Two terms are used everywhere. "From the calibration alone" is what the uncertain parameters of the tool do to its
angles; "of one reading" adds the noise of one reading of each sensor.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, within
from inclinometry.calibration.result import Calibration
from inclinometry.constants import COVERAGE_FACTOR, DIP, GRAVITY_SPREAD, LATITUDE, SHORT_INCLINATIONS, STEPS
from inclinometry.earth.gravity import stated_gravity_sd
from inclinometry.errors import InputError
from inclinometry.orientation import dip_angle, fields
from inclinometry.sensors import Tool, angle_sensitivity
from inclinometry.tabular import Column, Tabular, check_record, degrees, draw, in_degrees
from inclinometry.uncertainty import UNKNOWN, expanded_factor

ALL_ANGLES: Final = ("inclination", "azimuth", "toolface", "magnetic_toolface")
FROM_CALIBRATION: Final = "from the calibration alone"
OF_ONE_READING: Final = "of one reading"


@dataclass(frozen=True, eq=False, repr=False)
class ExpectedUncertainty(Tabular):
    """Uncertainty of a tool's angles over inclination, azimuth and toolface.

    inclination : (n,) rad.
    components : cause -> (n, azimuths, toolfaces, 4) variances, rad^2, last axis as `ALL_ANGLES`; NaN for an angle the
        tool cannot give. The causes are "calibration", "sensor noise" and, of two accelerometers, "strength of
        gravity".
    azimuth_from : kind of the triad the azimuth comes from; None without.
    dip : of that triad's field below the horizontal, rad; minus the latitude for a gyro.
    dip_from : "given", "calibration" (as found at the stand), "stated" (with the readings) or "assumed".
    temperature : degC.
    gravity_sd : of two accelerometers, standard uncertainty of |g| where the tool works in units of that at the
        calibration; else 0.
    """

    inclination: Array
    components: Mapping[str, Array]
    azimuth_from: str | None
    dip: float
    dip_from: str
    temperature: float
    gravity_sd: float = 0.0

    @property
    def angles(self) -> tuple[str, ...]:
        """Which of inclination, azimuth, toolface the tool can give."""
        known = np.asarray(np.isfinite(self.variance).all(axis=(0, 1, 2))).tolist()
        return tuple(name for name, seen in zip(ALL_ANGLES[:3], known[:3], strict=True) if seen)

    @property
    def variance(self) -> Array:
        """(n, azimuths, toolfaces, 4) of one reading."""
        return np.asarray(sum(self.components.values()))

    @property
    def from_calibration(self) -> Array:
        """(n, 4) standard uncertainty from the calibration alone at the worst azimuth and toolface."""
        return np.asarray(np.sqrt(self.components["calibration"].max(axis=(1, 2))))

    @property
    def of_one_reading(self) -> Array:
        """(n, 4) standard uncertainty of one reading at the worst azimuth and toolface."""
        return np.asarray(np.sqrt(self.variance.max(axis=(1, 2))))

    def rms(self, cause: str | None = None) -> Array:
        """(n, 4) root mean square over azimuth and toolface, of all causes or one."""
        variance = self.variance if cause is None else self.components[cause]
        return np.asarray(np.sqrt(variance.mean(axis=(1, 2))))

    def to_dict(self) -> dict[str, Column]:
        """One row an inclination: standard uncertainty at the worst azimuth and toolface of the angles there are."""
        found: dict[str, Column] = in_degrees(self, "inclination")
        for tail, u in (("", self.of_one_reading), ("_from_calibration", self.from_calibration)):
            found |= {f"u_{name}{tail}_deg": degrees(u[:, ALL_ANGLES.index(name)]) for name in self.angles}
        return found

    def plot(self, ax: Any = None) -> Any:
        """Standard uncertainty of one reading by inclination on matplotlib axes, which are returned."""
        u, inclination = np.degrees(self.of_one_reading), np.degrees(self.inclination)
        lines = {name: (inclination, u[:, ALL_ANGLES.index(name)]) for name in self.angles}
        return draw(ax, lines, "inclination, deg", "standard uncertainty, deg")


def expanded(u: Array, k: float = COVERAGE_FACTOR) -> Array:
    """Expanded uncertainty of angles, rad, same shape; beyond half a turn an angle is simply not known.

    Examples
    --------
    >>> expanded(np.array([0.1, 3.0])).round(4)
    array([0.2   , 3.1416])
    """
    return np.asarray(np.minimum(k * u, np.pi))


def absurd_uncertainty(calibration: Calibration, stated_dip: float | None = None) -> list[str]:
    """A warning where the calibration alone leaves an angle less certain than no inclinometer is.

    Parameters
    ----------
    calibration : Calibration
    stated_dip : float, optional
        As for `expected_uncertainty`.
    """
    gravity = calibration.tool.triads.get("accelerometer")
    # of fewer sensors, and of a gyro at the Earth's rate, an angle may well be no better
    if gravity is None or not gravity.full or azimuth_triad(calibration.tool) == "gyro":
        return []
    found = expected_uncertainty(calibration, ABSURD_FROM, stated_dip=stated_dip)
    worst: tuple[float, str] | None = None
    for name, most in ABSURD.items():
        # of all azimuths and toolfaces together: along the field azimuth is uncertain by any tool
        u = found.rms("calibration")[:, ALL_ANGLES.index(name)]
        place = int(np.argmax(u)) if name in found.angles else 0
        if name in found.angles and u[place] > most and (worst is None or u[place] / most > worst[0]):
            size, inclination = np.degrees(u[place]), np.degrees(ABSURD_FROM[place])
            said = (
                f"the calibration alone leaves the {name} uncertain by {size:.2g} deg at an inclination of "
                f"{inclination:.0f} deg, as no inclinometer is: look for exchanged rows, a misread dial, a gain "
                "that changed, iron near by, or positions that tell too little, and do not use this calibration"
            )
            worst = float(u[place] / most), said
    return [worst[1]] if worst else []


ABSURD: Final = {"inclination": np.radians(1.0), "azimuth": np.radians(5.0), "toolface": np.radians(5.0)}
"""Standard uncertainty from the calibration alone that is warned of, rad: a level and a hand compass do better."""
ABSURD_FROM: Final = np.radians([30.0, 60.0, 90.0])
"""Inclinations at which it is looked for: nearer to the vertical azimuth and toolface are uncertain by any tool."""


def certified_factor(calibration: Calibration) -> float:
    """k of a certificate: for the probability of k = 2 of a normal distribution, 95.45 %, rounded up to two decimals.

    Notes
    -----
    Student's quantile for the calibration's own degrees of freedom. Noise of a reading and calibration hang on the same
    estimated variances, so that of both together are theirs (JCGM 100:2008, G.4, wants them independent). u is already
    the mean over those variances, see `inclinometry.uncertainty.expanded_factor`.
    """
    return float(expanded_factor(calibration.degrees_of_freedom))


def expected_uncertainty(
    tool: Tool | Calibration,
    inclination: ArrayLike = SHORT_INCLINATIONS,
    dip: float | None = None,
    *,
    stated_dip: float | None = None,
    azimuths: int = STEPS,
    toolfaces: int = STEPS,
    temperature: float | None = None,
    gravity_sd: float | None = None,
) -> ExpectedUncertainty:
    """Uncertainty of the angles of a tool over attitudes, from its own calibration and noise.

    Parameters
    ----------
    tool : Tool or Calibration
        With any triads; angles it cannot give are NaN, all of them where a calibration states no covariance. Two
        accelerometers count with |g| known and the way the hole goes.
    inclination : (n,) array_like
        rad; 0 and pi are refused, where azimuth and toolface do not exist apart.
    dip : float, optional
        Of the field of the second triad where the tool will work, rad; minus the latitude for a gyro. That of the
        stand when not given, then `stated_dip`, then `constants.DIP` (`LATITUDE`).
    stated_dip : float, optional
        Of the magnetic field as stated with the readings, rad, for calibrations that find none.
    azimuths, toolfaces : int
        Equal steps of each over which the worst and the mean are taken.
    temperature : float, optional
        degC; the middle of the calibrated range when not given.
    gravity_sd : float, optional
        Of two accelerometers: standard uncertainty of |g| where the tool works in units of that at the calibration, 0
        at the same place. When not given, what two stated values leave where the calibration's is stated, else
        `constants.GRAVITY_SPREAD`.

    Raises
    ------
    InputError
        Arguments out of range.

    Examples
    --------
    >>> from inclinometry.sensors import Triad
    >>> kinds = ("accelerometer", "magnetometer")
    >>> tool = Tool("1", {k: Triad(k, np.eye(3), np.zeros(3)) for k in kinds}, 1e-8 * np.eye(24), {kinds[1]: 1e-3})
    >>> found = expected_uncertainty(tool, np.radians([30.0, 90.0]), np.radians(70.0))
    >>> np.degrees(found.from_calibration[:, 1]).round(3), np.degrees(found.of_one_reading[:, 1]).round(3)
    (array([0.043, 0.033]), array([0.173, 0.171]))
    """
    check_record(tool, (Calibration, Tool), "expected_uncertainty")
    directions: Mapping[str, Array] = {}
    silent = False
    if isinstance(tool, Calibration):
        # a triad in axes of its own gives no angles of a tool
        silent = tool.method in ("norm", "hand-rotations")
        directions, tool = tool.field_directions, tool.tool
        # a tool without covariance is a truth that is known; a calibration without one says nothing of itself
        silent |= not np.any(np.diagonal(tool.covariance))
    if azimuths < 1 or toolfaces < 1:
        raise InputError(f"azimuths is {azimuths}, toolfaces {toolfaces}; at least 1 of each is needed")
    values = np.atleast_1d(within(inclination, "inclination", 1e-6, np.pi - 1e-6, "rad"))
    second = azimuth_triad(tool)
    found, source = _dip(second, directions, dip, stated_dip)
    heat = tool_temperature(tool) if temperature is None else temperature
    turns = [2.0 * np.pi * np.arange(n) / n for n in (azimuths, toolfaces)]
    grid = np.meshgrid(values, *turns, indexing="ij")
    if silent or "accelerometer" not in tool.triads or tool.triads["accelerometer"].rank < 2:
        nothing = np.full((*grid[0].shape, len(ALL_ANGLES)), np.nan)
        return ExpectedUncertainty(
            values, {"calibration": nothing, "sensor noise": nothing}, second, found, source, heat
        )
    g, other = fields(grid[1], grid[0], grid[2], within(found, "dip", -np.pi / 2, np.pi / 2, "rad"))
    seen = {"accelerometer": g} | ({} if second is None else {second: other})
    sensitivity = angle_sensitivity(tool, seen, np.full(grid[0].shape, heat), second or "magnetometer")
    strength = 0.0
    if tool.triads["accelerometer"].rank == 2:
        strength = float(within(expected_gravity_sd(tool) if gravity_sd is None else gravity_sd, "gravity_sd", 0, 0.1))
    parts = {n: np.diagonal(c, axis1=-2, axis2=-1) for n, c in sensitivity.components(tool, strength).items()}
    if tool.triads["accelerometer"].rank == 2:
        # where gravity lies in the plane that two accelerometers see the angles are as good as unknown
        given = np.array([True, second is not None, True, second is not None])
        parts = {n: np.where(given, np.fmin(part, UNKNOWN**2), part) for n, part in parts.items()}
    return ExpectedUncertainty(values, parts, second, found, source, heat, strength)


def expected_gravity_sd(tool: Tool) -> float:
    """Uncertainty of |g| elsewhere in units of the calibration's: both stated where that one is, else neither known."""
    stated = stated_gravity_sd(tool.triads["accelerometer"].field_strength)
    return min(float(np.sqrt(2.0)) * stated, GRAVITY_SPREAD)


def azimuth_triad(tool: Tool) -> str | None:
    """The triad that gives the azimuth: magnetometer, else gyro, if it sees three components."""
    for kind in ("magnetometer", "gyro"):
        if kind in tool.triads and tool.triads[kind].full:
            return kind
    return None


def field_dip(directions: Mapping[str, Array], kind: str) -> float | None:
    """Angle of a field below the horizontal that gravity defines, rad; None where the rig's directions are not known.

    Examples
    --------
    >>> directions = {"accelerometer": np.array([0, 0, 1.0]), "magnetometer": np.array([0.6, 0, 0.8])}
    >>> round(float(np.degrees(field_dip(directions, "magnetometer"))), 3)
    53.13
    """
    if kind not in directions:
        return None
    return float(dip_angle(directions.get("accelerometer", np.array([0.0, 0.0, 1.0])), directions[kind]))


def tool_temperature(tool: Tool) -> float:
    """Middle of the calibrated range, the reference where none is stated, degC."""
    if tool.temperature_range is not None:
        return float(np.mean(tool.temperature_range))
    return next(iter(tool.triads.values())).reference_temperature


def _dip(
    second: str | None, directions: Mapping[str, Array], dip: float | None, stated: float | None
) -> tuple[float, str]:
    """Dip of the second field and where it is from."""
    if dip is not None:
        return dip, "given"
    if second is None:
        return DIP, "assumed"
    found = field_dip(directions, second)
    if found is not None:
        return found, "calibration"
    if second == "magnetometer":
        return (DIP, "assumed") if stated is None else (stated, "stated")
    return -LATITUDE, "assumed"
