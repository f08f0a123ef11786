"""Expected uncertainty of the angles of a calibrated tool: the one function every table, page and certificate calls.

Two terms are used everywhere. "From the calibration alone" is what the uncertain parameters of the tool do to its
angles; "of one reading" adds the noise of one reading of each sensor.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, within
from inclinometry.calibration.result import Calibration
from inclinometry.constants import COVERAGE_FACTOR, DIP, GRAVITY_SPREAD, LATITUDE, SHORT_INCLINATIONS, STEPS
from inclinometry.earth.gravity import stated_gravity_sd
from inclinometry.errors import out_of_range
from inclinometry.findings import Finding, Value
from inclinometry.orientation import dip_angle, fields
from inclinometry.sensors import Tool, angle_sensitivity
from inclinometry.tabular import Column, Tabular, check_record, degrees, draw, in_degrees
from inclinometry.uncertainty import UNKNOWN, coverage_factor, coverage_probability

ALL_ANGLES: Final = ("inclination", "azimuth", "toolface", "magnetic_toolface")
FROM_CALIBRATION: Final = "from the calibration alone"
OF_ONE_READING: Final = "of one reading"


@dataclass(frozen=True, eq=False, repr=False)
class ExpectedUncertainty(Tabular):
    """Uncertainty of a tool's angles over inclination, azimuth and toolface."""

    inclination: Array  #: (n,) rad
    #: cause -> (n, azimuths, toolfaces, 4) variances, rad^2, last axis as `ALL_ANGLES`; NaN for an angle the tool
    #: cannot give. The causes are "calibration", "sensor noise" and, of two accelerometers, "strength of gravity"
    components: Mapping[str, Array]
    azimuth_from: str | None  #: kind of the triad the azimuth comes from; None without
    dip: float  #: of that triad's field below the horizontal, rad; minus the latitude for a gyro
    dip_from: str  #: "given", "calibration" (as found at the stand), "stated" (with the readings) or "assumed"
    temperature: float  #: degC
    #: of two accelerometers, standard uncertainty of |g| where the tool works in units of that at the calibration;
    #: else 0
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


def absurd_uncertainty(tool: Tool, expected: ExpectedUncertainty) -> list[Finding]:
    """A warning where the calibration alone leaves an angle less certain than no inclinometer is.

    Looked for from 30 degrees on: nearer to the vertical azimuth and toolface are uncertain by any tool.
    """
    gravity = tool.triads.get("accelerometer")
    # of fewer sensors, and of a gyro at the Earth's rate, an angle may well be no better
    if gravity is None or not gravity.full or expected.azimuth_from == "gyro":
        return []
    inclined = np.flatnonzero(expected.inclination > np.radians(29.0))
    worst: tuple[float, Finding] | None = None
    # a level and a hand compass do better
    for name, most in zip(ALL_ANGLES, np.radians([1.0, 5.0, 5.0]), strict=False):
        # of all azimuths and toolfaces together: along the field azimuth is uncertain by any tool
        u = expected.rms("calibration")[inclined, ALL_ANGLES.index(name)]
        place = int(np.argmax(u)) if name in expected.angles else 0
        if name in expected.angles and u[place] > most and (worst is None or u[place] / most > worst[0]):
            size, inclination = np.degrees([u[place], expected.inclination[inclined[place]]]).tolist()
            values: dict[str, Value] = {"angle": name, "u_deg": size, "inclination_deg": inclination}
            said = Finding("bench-uncertainty-absurd", values)
            worst = float(u[place] / most), said
    return [worst[1]] if worst else []


class Certified(NamedTuple):
    """A calibration as a certificate states it: U = k u with k by the GUM's table G.2.

    calibration : its covariance is that at the estimated variances, without the mean over what is not known of them.
    k : for 95.45 %, two decimals. freedom : effective degrees of freedom, whole; infinite where variances were stated.
    """

    calibration: Calibration
    k: float
    freedom: float


def certified(calibration: Calibration) -> Certified:
    """Standard uncertainties, k and degrees of freedom as a certificate states them.

    A covariance that is the mean over estimated variances is nu / (nu - 2) times the one at their estimates, that of
    Student's distribution with nu degrees of freedom. The GUM's u is the latter, its k Student's quantile, nu cut to a
    whole number (JCGM 100:2008, G.4.1 and table G.2). Older calibrations do not state nu: it is then that of the
    residuals, at least 3. U is never less than twice the mean.
    """
    nu = calibration.freedom
    if nu is None:
        nu = max(calibration.degrees_of_freedom, 3.0)
    whole = float(np.floor(nu))
    k = round(float(coverage_factor(coverage_probability(COVERAGE_FACTOR), whole)), 2)
    # the covariance of these methods is that at the estimated variances already
    if calibration.method in ("field", "norm", "rate-table") or not np.isfinite(nu):
        return Certified(calibration, k, whole)
    share = max(float(np.sqrt(max(1.0 - 2.0 / nu, 0.0))), COVERAGE_FACTOR / k)
    stated = replace(calibration.tool, covariance=share**2 * calibration.tool.covariance)
    return Certified(replace(calibration, tool=stated), k, whole)


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
        Of the field of the second triad where the tool will work, rad; minus the latitude for a gyro. Default: that of
        the stand, then `stated_dip`, then `constants.DIP` (`LATITUDE`).
    stated_dip : float, optional
        Of the magnetic field as stated with the readings, rad, for calibrations that find none.
    azimuths, toolfaces : int
        Equal steps of each over which the worst and the mean are taken.
    temperature : float, optional
        degC. Default: the middle of the calibrated range.
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
    for name, count in (("azimuths", azimuths), ("toolfaces", toolfaces)):
        if count < 1:
            raise out_of_range(name, count, ">= 1")
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
        # where gravity lies in the plane that two accelerometers see the angles are unknown
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
    """Angle of a field below the horizontal that gravity defines, rad; None where the rig's directions are unknown."""
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
