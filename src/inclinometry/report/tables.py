"""Rows of tables, plain data for every face: label, value, standard uncertainty, unit."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from inclinometry.attitude.orientation import angles, fields, inclination_toolface
from inclinometry.calibration.expected import azimuth_triad, tool_temperature
from inclinometry.core.angles import wrap_signed
from inclinometry.core.arrays import Array
from inclinometry.core.constants import DEG_PER_HOUR, STANDARD_GRAVITY
from inclinometry.report.digits import with_uncertainty
from inclinometry.sensors.classical import classical_view
from inclinometry.sensors.tool import Tool, parameter_names, parameter_vector, triad_from_vector
from inclinometry.sensors.triad import Triad


class Row(NamedTuple):
    """One line of a table; `uncertainty` is standard (k = 1), nan where none is known."""

    label: str
    value: float
    uncertainty: float
    unit: str

    @property
    def text(self) -> str:
        """Value ± uncertainty, without the unit."""
        return with_uncertainty(self.value, self.uncertainty)


class FieldUnit(NamedTuple):
    """How a triad's field is shown: `name` of the unit, `per` one unit of the triad's own field; scale likewise."""

    name: str
    per: float
    scale_name: str
    scale_per: float


def sensor_names(count: int) -> list[str]:
    """x, y, z for a triad of three, numbers otherwise.

    Examples
    --------
    >>> sensor_names(3), sensor_names(2)
    (['x', 'y', 'z'], ['1', '2'])
    """
    return ["x", "y", "z"] if count == 3 else [str(i + 1) for i in range(count)]


def field_unit(triad: Triad) -> FieldUnit:
    """Unit in which offsets and residuals of a triad are understood, and the unit of its scale.

    Where the field's strength was not known, an accelerometer's unit is the local gravity, the others' the whole field.
    """
    absolute = triad.field_strength is not None
    if triad.kind == "accelerometer":
        gravity = STANDARD_GRAVITY if absolute else 1.0
        return FieldUnit("mg", 1e3 / gravity, f"{triad.unit} per g", gravity)
    if triad.kind == "magnetometer":
        if absolute:
            return FieldUnit("nT", 1.0, f"{triad.unit} per µT", 1e3)
        return FieldUnit("% of the field", 100.0, f"{triad.unit} per field", 1.0)
    if absolute:
        return FieldUnit("deg/h", 1.0 / DEG_PER_HOUR, f"{triad.unit} per deg/h", DEG_PER_HOUR)
    return FieldUnit("% of Earth rate", 100.0, f"{triad.unit} per Earth rate", 1.0)


def signal_to_field(triad: Triad) -> Array:
    """(m,) factors from a sensor's signal to `field_unit(triad).name`."""
    return np.asarray(field_unit(triad).per / classical_view(triad).scale)


def parameter_rows(tool: Tool, kind: str) -> list[Row]:
    """Every parameter of a triad in the order of `parameter_names`, in the tool's unit.

    Examples
    --------
    >>> tool = Tool("1", {"gyro": Triad("gyro", np.eye(3), np.zeros(3), "V")}, 1e-4 * np.eye(12))
    >>> row = parameter_rows(tool, "gyro")[0]
    >>> row.label, row.text, row.unit
    ('gyro.tensor[0,0]', '1.000 ± 0.010', 'V')
    """
    triad = tool.triads[kind]
    spread = _own_sd(tool, kind)
    units = []
    for power in range(triad.degree + 1):
        tail = "" if power == 0 else "/K" if power == 1 else f"/K^{power}"
        units += [triad.unit + tail] * (4 * triad.count)
    entries = zip(parameter_names(triad), parameter_vector(triad), spread, units, strict=True)
    return [Row(name, float(value), float(sd), unit) for name, value, sd, unit in entries]


def classical_rows(tool: Tool, kind: str) -> list[Row]:
    """Scale, bias and the two misalignment angles of each sensor, four rows a sensor, at the reference temperature."""
    triad = tool.triads[kind]
    unit = field_unit(triad)

    def view(candidate: Triad) -> Array:
        seen = classical_view(candidate)
        scale, bias = seen.scale * unit.scale_per, seen.bias * unit.per
        return np.column_stack([scale, bias, np.degrees(seen.misalignment_angles)]).ravel()

    nominal = classical_view(triad).nominal
    labels, units = [], []
    for name, place in zip(sensor_names(triad.count), np.argmax(np.abs(nominal), axis=1), strict=True):
        first, second = (axis for i, axis in enumerate("xyz") if i != place)
        labels += [f"{name} scale", f"{name} bias", f"{name} toward {first}", f"{name} toward {second}"]
        units += [unit.scale_name, unit.name, "deg", "deg"]
    return _derived(tool, kind, view, labels, units)


def orthogonality_rows(tool: Tool, kind: str) -> list[Row]:
    """Angle between each two sensitive axes less 90 deg."""
    triad = tool.triads[kind]
    first, second = np.triu_indices(triad.count, 1)

    def view(candidate: Triad) -> Array:
        return np.asarray(np.degrees(classical_view(candidate).orthogonality[first, second]))

    names = sensor_names(triad.count)
    labels = [
        f"{names[i]}{names[j]}" if triad.count == 3 else f"{i + 1}-{j + 1}" for i, j in zip(first, second, strict=True)
    ]
    return _derived(tool, kind, view, labels, ["deg"] * len(labels))


def noise_rows(tool: Tool, kind: str) -> list[Row]:
    """Standard deviation of one reading of each sensor, as a field."""
    triad = tool.triads[kind]
    values = tool.noise[kind] * signal_to_field(triad)
    names = sensor_names(triad.count)
    return [Row(f"{n} noise", float(v), np.nan, field_unit(triad).name) for n, v in zip(names, values, strict=True)]


def _own_sd(tool: Tool, kind: str) -> Array:
    """Standard uncertainties of a triad's parameters; nan where the method gave none."""
    variance = np.diagonal(tool.covariance)[tool.slices[kind]]
    return np.asarray(np.where(variance > 0.0, np.sqrt(np.abs(variance)), np.nan))


def _derived(tool: Tool, kind: str, view: Callable[[Triad], Array], labels: list[str], units: list[str]) -> list[Row]:
    """Rows of functions of a triad's parameters, their covariance carried over by central differences."""
    triad, here = tool.triads[kind], tool.slices[kind]
    vector = parameter_vector(triad)
    own = tool.covariance[here, here]
    # a small step of each parameter, well above rounding and well below where the view bends
    steps = 1e-6 * np.linalg.norm(triad.tensor[0], axis=1).max() * np.eye(len(vector))
    sides = [
        (view(triad_from_vector(triad, vector + move)) - view(triad_from_vector(triad, vector - move)))
        / (2.0 * move.max())
        for move in steps
    ]
    slope = np.stack(sides, axis=1)
    sd = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", slope, own, slope), 0.0))
    entries = zip(labels, view(triad), np.where(sd > 0.0, sd, np.nan), units, strict=True)
    return [Row(label, float(value), float(u), unit) for label, value, u, unit in entries]


def differences(tool: Tool, other: Tool, dip: float) -> dict[str, float]:
    """Largest difference of the angles two calibrations of one tool give for the same signals, rad.

    Over inclinations 10 to 90 deg and all azimuths and toolfaces in steps of 45 deg; only angles both can give.
    """
    grid = np.meshgrid(np.radians(np.arange(10.0, 91.0, 10.0)), *[np.radians(np.arange(0.0, 360.0, 45.0))] * 2)
    g, b = fields(grid[1], grid[0], grid[2], dip)
    seen = []
    second = azimuth_triad(tool)
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
