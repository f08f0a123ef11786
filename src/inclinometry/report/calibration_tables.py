"""Tables of a calibration report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.expected import (
    ALL_ANGLES,
    FROM_CALIBRATION,
    OF_ONE_READING,
    ExpectedUncertainty,
    azimuth_triad,
    expected_uncertainty,
    tool_temperature,
)
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.calibration.rollset import SecondHarmonics
from inclinometry.calibration.uncertainty_budget import error_budget
from inclinometry.constants import ANGLES, COVERAGE_FACTOR, DEG_PER_HOUR, DIALS, STANDARD_GRAVITY
from inclinometry.language import label, number
from inclinometry.orientation import angles, fields, inclination_toolface
from inclinometry.report.page import Table, TableRow
from inclinometry.report.words import Test, plain, significant, strongest_correlations, with_uncertainty
from inclinometry.rotations import wrap_signed
from inclinometry.sensors import (
    Tool,
    Triad,
    classical_view,
    parameter_names,
    parameter_vector,
    relative_scales,
    triad_from_vector,
)
from inclinometry.uncertainty import shares

# Rows of tables, plain data for every face: label, value, standard uncertainty, unit.


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
        if absolute:
            return FieldUnit("mg", 1e3 / STANDARD_GRAVITY, f"{triad.unit} per g", STANDARD_GRAVITY)
        return FieldUnit("% of gravity", 100.0, f"{triad.unit} per local gravity", 1.0)
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
    """Every parameter of a triad in the order of `parameter_names`, in the tool's unit."""
    triad = tool.triads[kind]
    variance = np.diagonal(tool.covariance)[tool.slices[kind]]
    spread = np.asarray(np.where(variance > 0.0, np.sqrt(np.abs(variance)), np.nan))
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
        labels += [
            f"{name} scale",
            f"{name} bias",
            f"{name} toward {first}",
            f"{name} toward {second}",
        ]
        units += [unit.scale_name, unit.name, "deg", "deg"]
    return _derived(tool, kind, view, labels, units)


def shape_rows(tool: Tool, kind: str) -> list[Row]:
    """What two calibrations have to compare where the strength of a field is not known.

    Each scale relative to the mean of the triad, and offsets in the unit of the signals.
    """
    triad = tool.triads[kind]
    offsets = [row for row in parameter_rows(tool, kind)[: 4 * triad.count] if ".offset" in row.label]
    rows = []
    for name, scale, u, offset in zip(sensor_names(triad.count), *relative_scales(tool, kind), offsets, strict=True):
        rows.append(Row(f"{name} scale to the mean", float(scale), float(u) if u > 0.0 else np.nan, "%"))
        rows.append(offset._replace(label=f"{name} offset"))
    return rows


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


def expected_tables(found: ExpectedUncertainty) -> list[Table]:
    """Standard and expanded uncertainty, a table under each term; none where the tool can give no angle."""
    terms = {FROM_CALIBRATION: np.degrees(found.from_calibration), OF_ONE_READING: np.degrees(found.of_one_reading)}
    where = "worst azimuth and toolface at each inclination" if found.azimuth_from else "worst toolface"
    tables = []
    for term, u in terms.items() if found.angles else ():
        columns = [u[:, ALL_ANGLES.index(name)] for name in found.angles]
        rows = [
            TableRow(
                [
                    f"{x:g}°",
                    *(f"{significant(float(v[i]))} / {significant(COVERAGE_FACTOR * float(v[i]))}" for v in columns),
                ]
            )
            for i, x in enumerate(np.degrees(found.inclination).round(9))
        ]
        caption = label(
            "Uncertainty {part}: standard / expanded (k = {k:g}), deg; {where}",
            part=term,
            k=COVERAGE_FACTOR,
            where=where,
        )
        tables.append(Table(caption, ["at", *found.angles], rows))
    return tables


def test_table(tests: Sequence[Test]) -> Table:
    """What was judged, from which the verdict of the page follows."""
    said = {True: "passed", False: "failed", None: "not judged"}
    rows = [TableRow([t.what, t.found, t.limit, said[t.passed]], "warn" if t.passed is False else "") for t in tests]
    return Table("Tests of this calibration", ["test", "found", "limit", "result"], rows)


def rig_table(calibration: Calibration, readings: BenchReadings | None) -> Table | None:
    """Errors of the settings at every station."""
    errors, sd = calibration.rig.errors, calibration.rig.errors_sd
    if errors is None:
        return None
    spread = np.full(errors.shape, np.nan) if sd is None else sd
    settings = _settings(calibration, readings)
    rows = []
    for k, name in enumerate(calibration.residuals.station):
        pairs = zip(np.degrees(errors[k]), np.degrees(spread[k]), strict=True)
        rows.append(
            TableRow([name, *settings.get(name, []), *(with_uncertainty(float(e), float(s)) for e, s in pairs)])
        )
    head = [
        "station",
        *(label("{dial} set, deg", dial=dial) for dial in DIALS if settings),
        *(label("error of {d}, deg", d=d) for d in DIALS),
    ]
    note = "Each estimate is drawn toward zero by the standard deviation of a setting; their scatter understates it."
    return Table("Estimated error of each setting", head, rows, note)


def _settings(calibration: Calibration, readings: BenchReadings | None) -> dict[str, list[str]]:
    """Station name to its dials as text; empty unless every station of the residuals is found once."""
    if readings is None or readings.azimuth is None:
        return {}
    dials = np.degrees(np.stack(readings.dials, axis=1))
    found = {n: [plain(v) for v in row] for n, row in zip(readings.station, dials, strict=True)}
    whole = len(found) == len(readings) and all(name in found for name in calibration.residuals.station)
    return found if whole else {}


def residual_tables(calibration: Calibration, readings: BenchReadings | None) -> dict[str, Table]:
    """Per triad: residual of each sensor, as a field where that says more than the signal, and standardised."""
    residuals, settings, found = calibration.residuals, _settings(calibration, readings), {}
    for kind, values in residuals.values.items():
        triad = calibration.tool.triads[kind]
        unit = field_unit(triad).name
        fields = np.asarray(values) * signal_to_field(triad)
        noise = calibration.tool.noise[kind] * signal_to_field(triad)
        standardised = np.asarray(residuals.standardised[kind])
        names = sensor_names(triad.count)
        rows = []
        for k, name in enumerate(residuals.station):
            cells = [_fixed(float(v), float(s)) for v, s in zip(fields[k], noise, strict=True)]
            scaled = [f"{v:+.2f}" if np.isfinite(v) else "not judged" for v in standardised[k]]
            worst = float(np.nanmax(np.abs(standardised[k]), initial=0.0))
            state = "bad" if worst > 3.0 else "warn" if worst > 2.0 else ""
            rows.append(
                TableRow([name, *settings.get(name, []), *cells, *scaled, f"{residuals.leverage[k]:.2f}"], state)
            )
        head = [
            "station",
            *(label("{dial} set, deg", dial=dial) for dial in DIALS if settings),
            *(label("{name}, {unit}", name=n, unit=unit) for n in names),
        ]
        head += [*(f"{n} / σ" for n in names), "leverage"]
        note = "Reading minus model at the settings as dialled; coloured beyond two, bold beyond three deviations."
        found[kind] = Table(label("Residuals of the {kind}", kind=kind), head, rows, note)
    return found


def _fixed(value: float, noise: float) -> str:
    """A residual with one digit more than its noise deserves, so that columns line up."""
    if not np.isfinite(value):
        return "not known"
    places = 3 if not noise > 0.0 else int(np.clip(1 - np.floor(np.log10(noise)), 0, 9))
    return f"{value:+.{places}f}"


def budget_table(calibration: Calibration, readings: BenchReadings, expected: ExpectedUncertainty) -> Table | None:
    """Standard uncertainty of one reading by cause, with its share of the variance; None where it is not known."""
    found = error_budget(calibration, readings, expected.inclination, expected.dip)
    at_deg = np.degrees(expected.inclination)
    if found is None:
        return None
    share, rows = shares(found), []
    for name, part in found.items():
        u = np.degrees(np.sqrt(np.diagonal(part, axis1=1, axis2=2)))
        cells = [f"{significant(float(u[i, a]))} ({share[name][i, a]:.0%})" for a in (0, 1) for i in range(len(at_deg))]
        # part and cause, a key of --json
        rows.append(TableRow([label(": ").join(map(label, name.split(": "))), *cells]))
    total = np.degrees(np.sqrt(np.diagonal(sum(found.values()), axis1=1, axis2=2)))
    rows.append(TableRow(["all", *(significant(float(total[i, a])) for a in (0, 1) for i in range(len(at_deg)))]))
    head = ["cause", *(label("{angle} at {at:g}°", angle=angle, at=at) for angle in ANGLES[:2] for at in at_deg)]
    note = (
        "Root mean square over azimuth and toolface, so that the squares add up; the figures above are of the worst. "
        "A non-linearity that the rolls show stands here but not in the uncertainties the calibration states."
    )
    return Table("Standard uncertainty of one reading by cause, deg, and its share", head, rows, note)


def roll_table(found: SecondHarmonics, units: Mapping[str, str]) -> Table:
    """Second harmonic of each sensor in each roll set, beside its first."""
    rows = []
    for place, name in enumerate(found.sets):
        for kind in found.second:
            for sensor, c in enumerate(found.second[kind][place]):
                first, u = abs(found.first[kind][place, sensor]), float(found.u[kind][place, sensor])
                unit = units.get(kind, "")
                cells = [name, f"{kind} {sensor + 1}", f"{first:.5g} {unit}", f"{with_uncertainty(abs(c), u)} {unit}"]
                rows.append(TableRow(cells, "warn" if abs(c) > 4.0 * u else ""))
    head = ["roll set", "sensor", "first harmonic", "second harmonic"]
    note = "Amplitudes; the uncertainty of the second is what the third and higher harmonics leave."
    return Table("Harmonics of the roll sets", head, rows, note, text_columns=2)


def triad_block(tool: Tool, kind: str) -> dict[str, Any]:
    """Classical view, orthogonality and the parameters of one triad."""
    triad, names = tool.triads[kind], sensor_names(tool.triads[kind].count)
    classic, noise = classical_rows(tool, kind), noise_rows(tool, kind)
    largest = np.argmax(np.abs(classical_view(triad).nominal), axis=1)
    across = [[axis for i, axis in enumerate("xyz") if i != place] for place in largest]
    body = []
    for i, name in enumerate(names):
        scale, bias, first, second = classic[4 * i : 4 * i + 4]
        toward = [f"{axis}: {number(row.text)}" for axis, row in zip(across[i], (first, second), strict=True)]
        body.append(TableRow([name, scale.text, bias.text, *toward, significant(noise[i].value)]))
    unit = field_unit(triad)
    head = [
        "sensor",
        label("scale, {unit}", unit=unit.scale_name),
        label("bias, {name}", name=unit.name),
        "toward, deg",
        "toward, deg",
    ]
    head.append(label("noise, {name}", name=unit.name))
    at = label(" at {at_degC:g} °C", at_degC=triad.reference_temperature) if triad.degree else ""
    square = orthogonality_rows(tool, kind)
    # tensor and offset, a line a sensor and power of temperature
    rows = parameter_rows(tool, kind)
    triad = tool.triads[kind]
    sensors, lines = sensor_names(triad.count), []
    for start in range(0, len(rows), 4):
        power, sensor = divmod(start // 4, triad.count)
        name = sensors[sensor] + (f" · T{power}" if triad.degree else "")
        units = [rows[start].unit] if triad.degree else []
        lines.append(TableRow([name, *units, *(row.text for row in rows[start : start + 4])]))
    columns = ["sensor", *(["unit"] if triad.degree else []), "N x", "N y", "N z", "U0"]
    given = "" if triad.degree else label(", ") + label(triad.unit)
    powers = (
        label("; Tn: factor of (T - {at_degC:g} °C)^n", at_degC=triad.reference_temperature) if triad.degree else ""
    )
    caption = label("Tensor N and offset U0{unit}, ± standard uncertainty{powers}", unit=given, powers=powers)
    return {
        "kind": kind,
        "classical": Table(label("Scale, bias and misalignment{at}, ± standard uncertainty", at=at), head, body),
        "orthogonality": Table(
            "Angle between axes less 90°", ["axes", "deg"], [TableRow([row.label, row.text]) for row in square]
        ),
        "parameters": Table(caption, columns, lines, text_columns=2 if triad.degree else 1),
    }


def correlation_table(calibration: Calibration) -> Table | None:
    """The strongest correlations; None where the method states no covariance."""
    rows = [TableRow(pair) for pair in strongest_correlations(calibration)]
    return Table("Strongest correlations", ["one", "other", "correlation"], rows, text_columns=2) if rows else None


def comparison_table(
    calibration: Calibration, others: Mapping[str, Calibration], dip: float, at_once: ExpectedUncertainty
) -> Table | None:
    """What each method says of itself, and how far its angles are from this calibration's."""
    if not others:
        return None
    body = [_method(label("{method} (this report)", method=calibration.method), at_once, {})]
    for name, other in others.items():
        found = expected_uncertainty(other, at_once.inclination, dip)
        body.append(_method(name, found, differences(calibration.tool, other.tool, dip)))
    angles = ALL_ANGLES[:3]
    head = [
        "method",
        *(label("u({name}), deg", name=name) for name in angles),
        *(label("Δ {name}, deg", name=name) for name in angles),
    ]
    note = (
        "Δ: largest difference from this report's calibration between 10 and 90 deg inclination. u: what the method "
        "says of itself; one that knows nothing of the rig's errors states too little."
    )
    at_deg = float(np.degrees(at_once.inclination[0]))
    caption = label(
        "Standard uncertainty {part} at {at_deg:g}° inclination, worst attitude", part=FROM_CALIBRATION, at_deg=at_deg
    )
    return Table(caption, head, body, note)


def _method(name: str, found: ExpectedUncertainty, away: Mapping[str, float]) -> TableRow:
    u = np.degrees(found.from_calibration[0])
    stated = {n: significant(float(u[ALL_ANGLES.index(n)])) for n in found.angles}
    shown = [significant(float(np.degrees(away[n]))) if n in away else "" for n in ALL_ANGLES[:3]]
    return TableRow([name, *(stated.get(n, "not stated") for n in ALL_ANGLES[:3]), *shown])
