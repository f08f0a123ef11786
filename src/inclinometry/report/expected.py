"""What a calibrated tool can promise, whatever sensors it has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from inclinometry.attitude.orientation import angles, fields, inclination_toolface
from inclinometry.calibration.capability import Capability, capability
from inclinometry.core.angles import wrap_signed
from inclinometry.core.arrays import Array, within
from inclinometry.report.tables import Row
from inclinometry.sensors.sensitivity import angle_sensitivity
from inclinometry.sensors.tool import Tool
from inclinometry.sensors.triad import Triad

TYPICAL = (5.0, 30.0, 60.0, 90.0)
"""Inclinations at which a report states uncertainties, deg."""

EXPANDED = 2.0
"""Coverage factor of expanded uncertainties: about 95 % for a normal distribution."""

ASSUMED_DIP = np.radians(60.0)
"""Dip taken when neither calibration nor caller knows one, rad."""

COLUMNS = {"inclination": 0, "azimuth": 1, "toolface": 2}


@dataclass(frozen=True, eq=False)
class Expected:
    """Uncertainty of one reading over attitudes.

    angles : those the tool can give, of "inclination", "azimuth", "toolface"
    second : kind of the triad the azimuth comes from; None without
    dip : of the field of that triad, rad
    capability : variances over inclination, azimuth, toolface
    """

    angles: tuple[str, ...]
    second: str | None
    dip: float
    capability: Capability

    def worst(self, name: str) -> Array:
        """(n,) standard uncertainty at the worst azimuth and toolface of each inclination, rad."""
        return np.asarray(self.capability.worst()[:, COLUMNS[name]])

    def rms(self, name: str, component: str | None = None) -> Array:
        """(n,) root mean square over azimuth and toolface, rad, of all components or one."""
        column = COLUMNS[name]
        parts = self.capability.variance if component is None else self.capability.components[component]
        return np.asarray(np.sqrt(parts[..., column].mean(axis=(1, 2))))

    def over_azimuth(self, name: str) -> Array:
        """(n, azimuths) standard uncertainty at the worst toolface, rad."""
        return np.asarray(np.sqrt(self.capability.variance[..., COLUMNS[name]].max(axis=2)))


def second_kind(tool: Tool) -> str | None:
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
    down = np.asarray(directions.get("accelerometer", np.array([0.0, 0.0, 1.0])))
    other = np.asarray(directions[kind])
    return float(np.arctan2(down @ other, np.linalg.norm(np.cross(down, other))))


def expected(tool: Tool, inclination: Array, dip: float, *, azimuths: int = 12, toolfaces: int = 12) -> Expected | None:
    """Uncertainty of one reading over attitudes; None for a tool whose accelerometers do not see three components.

    Parameters
    ----------
    tool : Tool
    inclination : (n,) array_like
        rad, between the verticals.
    dip : float
        Of the second field where the tool works, rad; minus the latitude for a gyro.
    """
    if "accelerometer" not in tool.triads or not tool.triads["accelerometer"].full:
        return None
    second, heat = second_kind(tool), tool_temperature(tool)
    if second == "gyro":
        return Expected(tuple(COLUMNS), "gyro", dip, _gyro(tool, inclination, dip, azimuths, toolfaces, heat))
    if second is None:
        # inclination and toolface do not depend on the second field: lend the tool a perfect one
        tool, dip = _with_perfect_magnetometer(tool), 0.0
    found = capability(tool, inclination, dip, azimuths=azimuths, toolfaces=toolfaces, temperature=heat)
    names = ("inclination", "toolface") if second is None else tuple(COLUMNS)
    return Expected(names, second, dip, found)


def promise_rows(tool: Tool, dip: float, inclination_deg: tuple[float, ...] = TYPICAL) -> list[Row]:
    """Standard uncertainty of each angle at typical inclinations, worst azimuth and toolface, deg."""
    found = expected(tool, np.radians(inclination_deg), dip)
    if found is None:
        return []
    table = {name: np.degrees(found.worst(name)) for name in found.angles}
    places = range(len(inclination_deg))
    return [Row(f"{n} at {inclination_deg[i]:g} deg", float(table[n][i]), np.nan, "deg") for i in places for n in table]


def differences(tool: Tool, other: Tool, dip: float) -> dict[str, float]:
    """Largest difference of the angles two calibrations of one tool give for the same signals, rad.

    Over inclinations 10 to 90 deg and all azimuths and toolfaces in steps of 45 deg; only angles both can give.
    """
    grid = np.meshgrid(np.radians(np.arange(10.0, 91.0, 10.0)), *[np.radians(np.arange(0.0, 360.0, 45.0))] * 2)
    g, b = fields(grid[1], grid[0], grid[2], dip)
    seen = []
    second = second_kind(tool)
    pair = [("accelerometer", g)] + ([(second, b)] if second and second in other.triads else [])
    for kind, field in pair:
        if kind not in other.triads or not tool.triads[kind].full:
            return {}
        heat = np.full(grid[0].shape, tool_temperature(tool))
        seen.append(other.triads[kind].field(tool.triads[kind].signals(field, heat), heat))
    if len(seen) == 2:
        found = angles(*seen)
        pairs = {"inclination": (found.inclination, grid[0]), "azimuth": (found.azimuth, grid[1])}
        pairs["toolface"] = (found.toolface, grid[2])
    else:
        inclination, toolface = inclination_toolface(seen[0])
        pairs = {"inclination": (inclination, grid[0]), "toolface": (toolface, grid[2])}
    return {name: float(np.abs(wrap_signed(a - b)).max()) for name, (a, b) in pairs.items()}


def tool_temperature(tool: Tool) -> float:
    """Middle of the calibrated range, the reference where none is stated, degC."""
    if tool.temperature_range is not None:
        return float(np.mean(tool.temperature_range))
    return next(iter(tool.triads.values())).reference_temperature


def _with_perfect_magnetometer(tool: Tool) -> Tool:
    keep = tool.slices["accelerometer"]
    size = keep.stop - keep.start
    covariance = np.zeros((size + 12, size + 12))
    covariance[:size, :size] = tool.covariance[keep, keep]
    triads = {
        "accelerometer": tool.triads["accelerometer"],
        "magnetometer": Triad("magnetometer", np.eye(3), np.zeros(3)),
    }
    return Tool(tool.name, triads, covariance, {"accelerometer": tool.noise["accelerometer"]})


def _gyro(tool: Tool, inclination: Array, dip: float, azimuths: int, toolfaces: int, heat: float) -> Capability:
    values = np.atleast_1d(within(inclination, "inclination", 1e-6, np.pi - 1e-6, "rad"))
    turns = [2.0 * np.pi * np.arange(n) / n for n in (azimuths, toolfaces)]
    grid = np.meshgrid(values, *turns, indexing="ij")
    g, w = fields(grid[1], grid[0], grid[2], dip)
    # a magnetometer that sees no three components would be taken for the second triad; leave it out
    two = _only(tool, ("accelerometer", "gyro"))
    found = angle_sensitivity(two, {"accelerometer": g, "gyro": w}, np.full(grid[0].shape, heat), "gyro")
    parts = {n: np.diagonal(c, axis1=-2, axis2=-1) for n, c in found.components(two).items()}
    return Capability(values, parts)


def _only(tool: Tool, kinds: tuple[str, ...]) -> Tool:
    rows = np.concatenate([np.arange(s.start, s.stop) for kind, s in tool.slices.items() if kind in kinds])
    triads = {kind: triad for kind, triad in tool.triads.items() if kind in kinds}
    noise = {kind: tool.noise[kind] for kind in triads}
    return Tool(tool.name, triads, tool.covariance[np.ix_(rows, rows)], noise, tool.temperature_range)
