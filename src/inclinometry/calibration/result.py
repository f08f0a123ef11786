"""What a calibration returns: one frozen record, the same for every method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.errors import refused
from inclinometry.findings import Finding, without_notes
from inclinometry.orientation import dip_angle
from inclinometry.sensors import Tool
from inclinometry.tabular import Column, Tabular, aligned, channel_columns, draw

if TYPE_CHECKING:
    from inclinometry.calibration.readings import BenchReadings

# Results as text, for a notebook or a prompt.


def rounded(value: float, u: float) -> str:
    """A value and its uncertainty to two digits of the latter."""
    if not (np.isfinite(u) and u > 0.0):
        return f"{value:.6g}"
    digits = max(0, 1 - int(np.floor(np.log10(u))))
    return f"{value:.{digits}f} ± {u:.{digits}f}"


def tool_rows(tool: Tool) -> list[list[str]]:
    """Rows of sensor, x, y, z, offset with uncertainties."""
    u = np.sqrt(np.diagonal(tool.covariance))
    rows = []
    for kind, triad in tool.triads.items():
        block = u[tool.slices[kind]].reshape(triad.degree + 1, triad.count, 4)[0]
        for sensor in range(triad.count):
            values = [*triad.tensor[0, sensor], triad.offset[0, sensor]]
            cells = [rounded(v, s) for v, s in zip(values, block[sensor], strict=True)]
            rows.append([f"{kind} {sensor + 1} ({triad.unit})", *cells])
    return rows


def calibration_text(found: Calibration) -> str:
    """What `repr` of a calibration says."""
    name = f" of {found.tool.name}" if found.tool.name else ""
    lines = [f"Calibration{name}: method {found.method}, {len(found.residuals.station)} stations"]
    lines += aligned(["sensor", "along x", "along y", "along z", "offset"], tool_rows(found.tool))
    for kind, direction in found.field_directions.items():
        below = np.degrees(np.arcsin(np.clip(direction[2], -1.0, 1.0)))
        lines.append(
            f"{kind} field in rig axes: {np.round(direction, 5).tolist()}, {below:.3f} deg below the rig's horizon"
        )
    if np.any(found.rig.sd):
        lines.append(f"rig settings: standard deviation {np.degrees(found.rig.sd).max():.3f} deg")
    lines += [
        f"{title}: {np.degrees(v):+.4f} ± {np.degrees(s):.4f} deg" for title, (v, s) in found.rig.nuisance.items()
    ]
    return "\n".join([*lines, *(f"{one.severity}: {one}" for one in without_notes(found.findings))])


def readings_text(readings: BenchReadings) -> str:
    """What `repr` of bench readings says."""
    channels = ", ".join(f"{kind} ({v.shape[1]}, {readings.units[kind]})" for kind, v in readings.channels.items())
    dials = "with rig angles" if readings.azimuth is not None else "without rig angles"
    heat = readings.temperature
    span = "" if heat is None else f", {heat.min():.1f} to {heat.max():.1f} degC"
    return "\n".join(
        [f"BenchReadings: {len(readings)} stations {dials}{span}; {channels}", *map(str, readings.findings)]
    )


LEAST_REDUNDANCY: Final = 1e-3
"""Share of a residual's variance that the fit must leave for it to be judged.

A residual with less is a thirtieth of what moves the reading: in a run of settings wrong by 0.1 deg the second order of
the setting's error, 1e-3 of the first, is then a share of 0.03 of the residual's own standard deviation, but all of it
for one with a share of 1e-6; and whatever is wrong with such a reading, the fit follows it.
"""


@dataclass(frozen=True, eq=False)
class Rig:
    """What was learnt of the rig."""

    sd: Array  #: (3,) standard deviation of a setting of azimuth, inclination, toolface, rad (0: dials trusted)
    errors: Array | None = None  #: (K, 3) estimated errors of the settings, rad; None where the method has none
    errors_sd: Array | None = None  #: (K, 3) their standard uncertainties, rad
    #: name -> (estimate, standard uncertainty), rad, of the constant rig errors that were fitted
    nuisance: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    #: (3,) degrees of freedom from which `sd` is known; infinite where it was stated
    freedom: Array = field(default_factory=lambda: np.full(3, np.inf))


@dataclass(frozen=True, eq=False, repr=False)
class Residuals(Tabular):
    """Readings minus model, per station."""

    station: Sequence[str]  #: names, K of them
    values: Mapping[str, Array]  #: kind -> (K, m), in the triad's unit
    #: kind -> (K, m), each divided by its own standard deviation under the model; NaN, not judged, where the fit leaves
    #: less than `LEAST_REDUNDANCY` of the variance
    standardised: Mapping[str, Array]
    leverage: Array  #: (K,) share of each station in its own prediction, 0..1

    def to_dict(self) -> dict[str, Column]:
        """One row a station: residuals in the unit of their triad, standardised ones, leverage."""
        return {
            "station": list(self.station),
            **channel_columns(self.values, {}, "_residual"),
            **channel_columns(self.standardised, {}, "_standardised"),
            "leverage": self.leverage,
        }

    def plot(self, ax: Any = None) -> Any:
        """Residuals, each over its own standard deviation, by station on matplotlib axes, which are returned."""
        number = np.arange(1, len(self.station) + 1)
        lines = {name: (number, column) for name, column in channel_columns(self.standardised, {}).items()}
        return draw(ax, lines, "station", "residual over its standard deviation", "o")


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(Tabular):
    """A calibrated tool and everything that speaks for or against it.

    tool : triads with joint covariance and noise.
    method : "joint", "twelve", "orthogonal", "rotations", "field", "classical".
    inputs : name -> digest of what it was made from.
    field_directions : kind -> unit vector of the field in rig axes (x of the rig = azimuth 0, z down).
    parameter_names, covariance : the joint covariance of tool parameters, field directions (two tangent angles each,
        rad) and nuisance parameters. It is the inverse Fisher information; it holds when the noise and rig model hold
        and is meaningless along directions named in `findings` as invisible to the plan.
    findings : what the readings and the fit give rise to say.
    outliers : station -> finding, of stations at odds with the others (also among `findings`); not kept in tool.json.
    causes : of a joint fit, cause -> covariance that it brings to the tool's parameters, for `causes.error_budget`; and
        response (p, K M), how the parameters follow each reading, station by station; `bent`: kind ->
        (m, 2), quadratic and cubic part of each sensor's response where the readings show them, of full scale. None of
        the three is kept in tool.json.
    shares : of a joint fit, cause -> (n, 3) share that it has in the variance from the calibration alone of
        inclination, azimuth, toolface, at `constants.SHORT_INCLINATIONS` and the azimuth and toolface where one reading
        is least certain; NaN for an angle that the tool does not give.
    off_scatter : kind -> scatter of a component of its field in the readings off the stand, in units of the field.
    freedom : effective degrees of freedom nu of the variances that the readings gave, where `covariance` is the mean
        over them: nu / (nu - 2) times the covariance at their estimates. Infinite where all were stated; None where it
        is not known (other methods, older files).
    """

    tool: Tool
    method: str
    inputs: Mapping[str, str]
    field_directions: Mapping[str, Array]
    parameter_names: Sequence[str]
    covariance: Array
    rig: Rig
    residuals: Residuals
    findings: tuple[Finding, ...] = ()
    outliers: Mapping[str, Finding] = field(default_factory=dict)
    causes: Mapping[str, Array] = field(default_factory=dict)
    response: Array = field(default_factory=lambda: np.zeros((0, 0)))
    bent: Mapping[str, Array] = field(default_factory=dict)
    shares: Mapping[str, Array] = field(default_factory=dict)
    freedom: float | None = None
    off_scatter: Mapping[str, float] = field(default_factory=dict)

    @property
    def dip(self) -> float | None:
        """Dip at the stand as the calibration found it, rad; None where it does not know both fields."""
        if not {"accelerometer", "magnetometer"} <= set(self.field_directions):
            return None
        return float(dip_angle(self.field_directions["accelerometer"], self.field_directions["magnetometer"]))

    @property
    def degrees_of_freedom(self) -> float:
        """From which the noise is known by this calibration's own readings, at least 1; infinite without residuals.

        Readings less the parameters and, where the dials err, less the settings: each station's own take three of its
        readings up. Where the noise was stated it is better known than that.
        """
        readings = sum(np.size(values) for values in self.residuals.values.values())
        if not readings:
            return np.inf
        settings = 3 * len(self.residuals.station) if np.any(self.rig.sd) else 0
        return float(max(readings - len(self.tool.parameter_names) - settings, 1))

    @property
    def uncertainty(self) -> dict[str, float]:
        """Standard uncertainty of each named parameter."""
        return dict(zip(self.parameter_names, np.sqrt(np.diagonal(self.covariance)).tolist(), strict=True))

    def __repr__(self) -> str:
        return calibration_text(self)

    def to_dict(self) -> dict[str, Column]:
        """One row a sensor, as the tool's; those of the stations are `residuals`."""
        return self.tool.to_dict()

    def plot(self, ax: Any = None) -> Any:
        """Residuals by station on matplotlib axes, which are returned."""
        return self.residuals.plot(ax)


def same_units(units: Mapping[str, str], tool: Tool) -> None:
    """Refuse signals stated in another unit than the tool's; nothing is converted unasked.

    A unit that is not stated ("counts") is taken for the tool's own.
    """
    for kind, triad in tool.triads.items():
        have = units.get(kind, UNSTATED)
        if UNSTATED not in (have, triad.unit) and have != triad.unit:
            raise refused("fit-units", {"kind": kind, "unit": have, "other": triad.unit})


def same_tool(serial: str, tool: Tool) -> None:
    """Refuse readings whose serial number is not the tool's, where both have one; signs and case do not count."""
    own, other = ("".join(filter(str.isalnum, one)).casefold() for one in (serial, tool.name))
    if own and other not in ("", "unnamed", own):
        raise refused("work-other-tool", {"name": "calibration", "its": tool.name, "own": serial})


UNSTATED = "counts"
"""The unit of signals whose column names state none."""
