"""Two calibrations of one tool side by side: coefficients with their differences, and curves over inclination."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.expected import azimuth_triad, expected_uncertainty, field_dip
from inclinometry.calibration.result import Calibration
from inclinometry.constants import DIP, FIELD_UNITS, INCLINATIONS, KIND_PREFIX, LATITUDE, STEPS
from inclinometry.errors import refused
from inclinometry.orientation import angles, fields, inclination_toolface
from inclinometry.rotations import wrap_signed
from inclinometry.sensors import Tool, in_field_of, relative_scales, strength_ratio
from inclinometry.tabular import Column, Tabular, axes


@dataclass(frozen=True)
class Coefficient:
    """One coefficient of one sensor in both calibrations: K, bias (in signal units) or a direction cosine.

    Where the strength of the field is not stated in one of the two, K is relative to the mean of its triad, in %.
    """

    kind: str
    sensor: int
    name: str
    unit: str
    values: tuple[float, float]
    u: tuple[float, float]

    @property
    def difference(self) -> float:
        """The second less the first."""
        return self.values[1] - self.values[0]

    @property
    def u_difference(self) -> float:
        """Of two independent calibrations."""
        return float(np.hypot(*self.u))

    @property
    def sigmas(self) -> float:
        """The difference in its standard uncertainty; NaN where neither calibration states one."""
        return self.difference / self.u_difference if self.u_difference > 0.0 else np.nan


@dataclass(frozen=True, eq=False, repr=False)
class TwoCalibrations(Tabular):
    """Two calibrations of one tool."""

    names: tuple[str, str]  #: what they are called in tables
    calibrations: tuple[Calibration, Calibration]
    coefficients: Sequence[Coefficient]
    inclination: Array  #: (n,) rad
    #: two arrays (n, 4), from the calibration alone at the worst attitude, rad, as `expected.ALL_ANGLES`
    uncertainty: tuple[Array, Array]
    #: (n, 3) rms over azimuth and toolface of inclination, azimuth, toolface that the second gives for signals of the
    #: first, less the true ones, rad; NaN where one of them has no such angle
    difference: Array
    error: tuple[Array, Array] | None  #: two arrays (n, 3), rms errors against a known truth, rad; None without

    def to_dict(self) -> dict[str, Column]:
        """One row a coefficient of a sensor: both values, their difference and its standard uncertainty."""
        rows, tool = self.coefficients, self.calibrations[0].tool
        names = {kind: axes(triad.count) for kind, triad in tool.triads.items()}
        return {
            "sensor": [f"{KIND_PREFIX[row.kind]}_{names[row.kind][row.sensor - 1]}" for row in rows],
            "coefficient": [row.name for row in rows],
            "unit": [row.unit for row in rows],
            "first": [row.values[0] for row in rows],
            "second": [row.values[1] for row in rows],
            "difference": [row.difference for row in rows],
            "u_difference": [row.u_difference for row in rows],
        }


def compare_calibrations(
    first: Calibration, second: Calibration, names: tuple[str, str] = ("first", "second"), truth: Tool | None = None
) -> TwoCalibrations:
    """Two calibrations of one tool, coefficient by coefficient and angle by angle.

    They are taken to be independent: the uncertainty of a difference is the root of the sum of squares. The tool behind
    simulated readings, `truth`, adds the actual errors.
    """
    _refuse_unlike(first.tool, second.tool)
    inclination = np.array(INCLINATIONS)
    # two methods on the same readings have seen one field, whatever its strength
    same = bool(first.inputs) and first.inputs == second.inputs
    return TwoCalibrations(
        names,
        (first, second),
        [row for kind in first.tool.triads for row in _coefficients(kind, first.tool, second.tool, same_field=same)],
        inclination,
        (
            expected_uncertainty(first, inclination).from_calibration,
            expected_uncertainty(second, inclination).from_calibration,
        ),
        angle_differences(second.tool, first, inclination),
        None
        if truth is None
        else (
            angle_differences(first.tool, replace(first, tool=truth), inclination),
            angle_differences(second.tool, replace(second, tool=truth), inclination),
        ),
    )


def _refuse_unlike(first: Tool, second: Tool) -> None:
    """Two calibrations that cannot be of one tool."""
    for kind in {**first.triads, **second.triads}:
        counts = [tool.triads[kind].count if kind in tool.triads else 0 for tool in (first, second)]
        if counts[0] != counts[1]:
            raise refused("input-channels", {"kind": kind, "channels": counts[1], "calibrated": counts[0]})
    for kind, triad in first.triads.items():
        other = second.triads[kind]
        if triad.unit != other.unit:
            raise refused("fit-units", {"kind": kind, "unit": triad.unit, "other": other.unit})


def _coefficients(kind: str, first: Tool, second: Tool, *, same_field: bool) -> list[Coefficient]:
    """K, bias and cosines of every sensor at each calibration's reference temperature."""
    unit = first.triads[kind].unit
    strength = second.triads[kind].field_strength
    unknown: tuple[str, ...] = ()
    if same_field:
        strength = strength or first.triads[kind].field_strength
    else:
        first, unknown = in_field_of(first, second)
    relative = kind in unknown
    found, spread = zip(
        *(_classical(tool, kind, strength or 1.0, relative=relative) for tool in (first, second)), strict=True
    )
    known = f"{unit} per field of the stand" if strength is None else f"{unit} per {FIELD_UNITS[kind]}"
    of_k = "% of the mean" if relative else known
    axes = ("x", "y", "z")
    columns = [("K", of_k), *((f"cos {axis}", "") for axis in axes), ("bias", unit)]
    return [
        Coefficient(
            kind,
            sensor + 1,
            name,
            of,
            (float(found[0][sensor, c]), float(found[1][sensor, c])),
            (float(spread[0][sensor, c]), float(spread[1][sensor, c])),
        )
        for sensor in range(first.triads[kind].count)
        for c, (name, of) in enumerate(columns)
    ]


def _classical(tool: Tool, kind: str, strength: float, *, relative: bool) -> tuple[Array, Array]:
    """(m, 5) K = |n| / strength, the cosines n / |n|, the offset; and their standard uncertainties.

    K in % of the mean of the triad where it is `relative`.
    """
    triad = tool.triads[kind]
    n, offset = triad.tensor[0], triad.offset[0]
    k = np.linalg.norm(n, axis=1)
    cosines = n / k[:, None]
    values = np.column_stack([k / strength, cosines, offset])
    block, m = tool.covariance[tool.slices[kind], tool.slices[kind]], triad.count
    spread = np.zeros_like(values)
    for s in range(m):
        jacobian = np.zeros((5, 4))
        jacobian[0, :3] = cosines[s] / strength
        jacobian[1:4, :3] = (np.eye(3) - np.outer(cosines[s], cosines[s])) / k[s]
        jacobian[4, 3] = 1.0
        own = block[4 * s : 4 * s + 4, 4 * s : 4 * s + 4]
        spread[s] = np.sqrt(np.diagonal(jacobian @ own @ jacobian.T))
    if relative:
        values[:, 0], spread[:, 0] = relative_scales(tool, kind)
    return values, spread


def angle_differences(tool: Tool, other: Calibration, inclination: Array) -> Array:
    """Rms (n, 3) over azimuth and toolface of what `tool` reads from the signals of `other` less what they stand for.

    NaN for angles that they do not both give.
    """
    second = azimuth_triad(tool) if azimuth_triad(tool) == azimuth_triad(other.tool) else None
    dip = field_dip(other.field_directions, second) if second else None
    if dip is None:
        dip = -LATITUDE if second == "gyro" else DIP
    turn = 2.0 * np.pi * np.arange(STEPS) / STEPS
    grid = np.meshgrid(inclination, turn, turn, indexing="ij")
    g, b = fields(grid[1], grid[0], grid[2], dip)
    found = np.full((len(inclination), 3), np.nan)
    kinds = ["accelerometer"] + ([second] if second else [])
    if any(kind not in t.triads or t.triads[kind].rank < 2 for kind in kinds for t in (tool, other.tool)):
        return found
    seen = []
    for kind, field in zip(kinds, (g, b), strict=False):
        own, theirs = tool.triads[kind], other.tool.triads[kind]
        signals = theirs.signals(field, np.full(grid[0].shape, theirs.reference_temperature))
        at = np.full(grid[0].shape, own.reference_temperature)
        length = strength_ratio(own, theirs) or 1.0
        seen.append(own.field(signals, at) if own.full else own.field_of_length(signals, field, at, length)[0])
    if len(seen) == 2:
        both = angles(*seen)
        read = {0: both.inclination, 1: both.azimuth, 2: both.toolface}
    else:
        read = dict(zip((0, 2), inclination_toolface(seen[0]), strict=True))
    for column, values in read.items():
        found[:, column] = np.sqrt(np.mean(wrap_signed(values - grid[column]) ** 2, axis=(1, 2)))
    return found
