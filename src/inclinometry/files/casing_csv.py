"""Readings of an inclinometer casing: depth, A0, A180, B0, B180 in digi units, sines, degrees or lengths a step."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from inclinometry.arrays import Array, Index, frozen
from inclinometry.errors import InputError, in_file
from inclinometry.files._quantities import dimension_of, factor_of, hole_names, same_unit, unit_factor
from inclinometry.files.frame import Column, Frame
from inclinometry.files.holes_csv import same
from inclinometry.files.profile import current
from inclinometry.files.table import TableFile
from inclinometry.files.timestamps import part_of_time
from inclinometry.files.writing import joined, write_columns
from inclinometry.findings import Finding, Value
from inclinometry.survey.displacement import CasingReading, Displacement, check_reading
from inclinometry.survey.run_stations import broken_habit

UNITS: Final = ("digi-25000", "digi-N", "sin", "deg", "m", "mm", "ft", "in")
"""What a probe reads: 25000 or N times the sine of the tilt, the sine, degrees, a length over one step."""
_CONSTANT: Final = re.compile(r"digi\W?([1-9]\d{2,6})", re.ASCII)
_LEAST_DEG: Final = 0.03
"""Tilt that some step of every casing exceeds: drilling and grouting leave tenths of a degree."""
_DEPTHS: Final = 5
"""Steps below which a scatter of check-sums says nothing."""
_SENSOR: Final = re.compile(
    r"(?:(?:.*[a-z\W_\d])?([AB])(?:[\W_]*axis)?[\W_]*(\d+)\)?|\D*(\d+)[\W_]*([AB]))(?:\s*[(\[]([\w -]+)[)\]])?"
)
_FACE = re.compile(r"(?:face[ _]?)?([ab])[ _]?(0|180|\+|-)(?:(?:[ _]+|\s*[(\[])([\w -]+?)[)\]]?)?", re.IGNORECASE)


class CasingFile(NamedTuple):
    """A reading, the line of each of its depths, what is suspect about it, and the table it came from."""

    reading: CasingReading
    lines: tuple[int, ...]
    findings: tuple[Finding, ...]
    table: Frame


Face: TypeAlias = tuple[str, int, str]
"""Of a column: its axis, its run (0 or 1) and the unit in its name ("" where there is none)."""


def face(name: str) -> Face | None:
    """The run that a column's name states; None for another column.

    >>> face("A180"), face("B- (mm)"), face("a0_digi_25000")
    (('a', 1, ''), ('b', 1, 'mm'), ('a', 0, 'digi-25000'))
    """
    found = _FACE.fullmatch(name.strip())
    if found is None:
        return None
    return found[1].lower(), int(found[2] in ("180", "-")), _unit(found[3] or "")


def _unit(written: str) -> str:
    """A unit as it is written here; another as it is."""
    unit = re.sub("^inch(es)?$", "in", written.strip().lower().replace("_", "-"))
    constant = _CONSTANT.fullmatch(unit)
    return f"digi-{constant[1]}" if constant else next((one for one in UNITS if same_unit(unit, one)), unit)


def _level(unit: str, step: float) -> float:
    """What a probe reads of a casing that lies, sine 1; NaN of a unit that is not known."""
    if constant := _CONSTANT.fullmatch(unit):
        return float(constant[1])
    known = {"sin": 1.0, "deg": 90.0, "in": step / 0.0254}  # elsewhere `in` is a word
    if unit in known or dimension_of(unit) != "length":
        return known.get(unit, np.nan)
    return step / unit_factor(unit, "m")[0]


def sensor(name: str) -> tuple[Face, int] | None:
    """The face and the number of a sensor of an in-place string by the name of its column; None for another column.

    >>> sensor("Tilt_A(12) (Deg)"), sensor("IPI3_B"), sensor("PTemp (C)")
    ((('a', 0, 'deg'), 12), (('b', 0, ''), 3), None)
    """
    found = _SENSOR.fullmatch(name.strip())
    if found is None:
        return None
    return ((found[1] or found[4]).lower(), 0, _unit(found[5] or "")), int(found[2] or found[3])


def read_casing(path: str | Path, unit: str | None = None, sensors: Sequence[float] = ()) -> list[CasingFile]:
    """Read the readings of a casing, one of each date that the table has; `unit` is that of columns that name none.

    Columns: depth with its unit (depth_m), a0, a180 and, where it was read, b0, b180 (A+, A-, B+, B-), each with a unit
    of `UNITS`; a180 and b180 may both be missing. Rows from top to bottom, or from bottom to top, evenly spaced. Of an
    in-place string `sensors` are the depths of the upper ends of sensors 1, 2 .., m; each row is a reading.
    """
    stated = current().units
    opened = TableFile(path)
    names = opened.names
    columns: dict[str, Face] = {}
    depths: dict[str, float] = {}
    places: dict[str, int] = {}
    try:
        for name in names:
            found = face(name)
            if sensors:
                if (at := sensor(name)) is not None:
                    columns[name], places[name] = at
            elif found is not None:
                columns[name] = found
            elif (factor := factor_of(name, hole_names("casing"), "m", stated)) is not None:
                depths[name] = factor
    except InputError as error:
        raise in_file(error, path) from None
    table = opened.read(lambda name: name in depths or name in columns)
    dates = [table.text(name) for name in names if part_of_time(name)]
    rows = [" ".join(cells) for cells in zip(*dates, strict=True)] or [Path(path).name] * len(table)
    if sensors:
        table, columns = _stacked(table, columns, places, sensors)
        rows, depths = np.repeat(rows, len(sensors)).tolist(), {"depth_m": 1.0}
    if len(depths) != 1:
        raise table.error(same(tuple(depths)) if depths else table.lacking("depth_m"))
    several = dict.fromkeys(rows) if len(table) >= _DEPTHS * len(set(rows)) else {}
    parts = [(table.rows(np.array(rows) == date), date) for date in several if len(several) > 1]
    read = [_reading(part, columns, depths, unit, called) for part, called in parts or [(table, Path(path).name)]]
    if not sensors:
        return read
    # a sensor that stays keeps its bias
    return [one._replace(findings=tuple(f for f in one.findings if f.code != "holes-unknown")) for one in read]


def _stacked(
    table: Frame, columns: Mapping[str, Face], places: Mapping[str, int], depths: Sequence[float]
) -> tuple[Frame, dict[str, Face]]:
    """The rows of an in-place string as those of a casing, one a sensor."""
    size, faces = len(table), dict[str, Face]()
    cells: dict[str, Column] = {"depth_m": np.tile(depths, size)}
    for axis in sorted({"a", *(axis for axis, _, _ in columns.values())}):
        own = {places[name]: name for name, (of, _, _) in columns.items() if of == axis}
        lost = [f"{axis.upper()}({k})" for k in range(1, len(depths) + 1) if k not in own]
        if lost or len(own) > len(depths):
            raise table.error(table.lacking(*lost, "--sensor-depths-m"))
        faces[axis] = columns[own[1]]
        cells[axis] = np.stack([table.number(own[k]) for k in sorted(own)], axis=1).ravel()
    return replace(table, columns=cells, lines=np.repeat(table.lines, len(depths))), faces


def _reading(
    table: Frame, columns: Mapping[str, Face], depths: Mapping[str, float], unit: str | None, called: str
) -> CasingFile:
    """One reading."""
    _runs(table, columns)
    (name, factor), = depths.items()  # fmt: skip
    depth = table.number(name) * factor
    order = _order(table, depth)
    step = float(np.ptp(depth)) / (len(depth) - 1)
    faces = {}
    for axis in sorted({axis for axis, _, _ in columns.values()}):
        runs = sorted((run, name) for name, (of, run, _) in columns.items() if of == axis)
        sines = [_sines(table, name, columns[name][2], unit, step) for _, name in runs]
        faces[axis] = frozen(np.stack(sines, axis=1)[order])
    reading = CasingReading(frozen(depth[order]), step, faces, called)
    try:
        said = tuple(check_reading(reading))
    except InputError as error:
        raise in_file(error, table.path, table.header_line) from None
    most = max(float(np.degrees(np.arcsin(np.abs(reading.deviation(axis)).max() / step))) for axis in faces)
    if 0.0 < most < _LEAST_DEG:
        of = next(unit for _, _, unit in columns.values()) or _unit(unit or "")
        tilts: dict[str, Value] = {"most_deg": most, "least_deg": _LEAST_DEG}
        said += (Finding("readings-unit-small", {"reading": reading.name, "unit": of, **tilts}),)
    return CasingFile(reading, tuple(table.lines[order].tolist()), said, table)


def _runs(table: Frame, found: Mapping[str, Face]) -> None:
    """FileError unless the runs are those of one way to read: A, or A and B, each once or each in both runs."""
    named: dict[tuple[str, int], str] = {}
    for name, (axis, run, _) in found.items():
        if (axis, run) in named:
            raise table.error(same((named[axis, run], name)))
        named[axis, run] = name
    wanted = {"a", *(axis for axis, _ in named)}, {0, *(run for _, run in named)}
    lost = [f"{axis}{180 * run}" for axis in sorted(wanted[0]) for run in sorted(wanted[1]) if (axis, run) not in named]
    if lost:
        raise table.error(table.lacking(*lost))
    units = tuple(sorted({f"{unit!r:.40}" for _, _, unit in found.values()}))
    if len(units) > 1:
        raise table.error(Finding("table-units", {"column": ", ".join(found), "units": units}))


def _order(table: Frame, depth: Array) -> Index:
    """Rows from top to bottom; FileError where depths repeat, turn back or leave the even grid."""
    if len(depth) < _DEPTHS:
        raise table.error(Finding("input-few", {"name": "depths", "count": len(depth), "least": _DEPTHS}))
    steps = np.diff(depth)
    way = np.sign(np.median(steps)) or 1.0
    if (bad := np.flatnonzero(way * steps <= 0.0)).size:
        row = int(bad[0]) + 1
        values: dict[str, Value] = {"md_m": float(depth[row]), "last_m": float(depth[row - 1])}
        raise table.error(Finding("holes-depth-order", values, (row,), "refused"), row)
    usual = float(np.median(np.abs(steps)))
    if (bad := np.flatnonzero(np.abs(np.abs(steps) - usual) > 0.02 * usual)).size:
        row = int(bad[0]) + 1
        step, expected = usual, float(depth[row - 1] + way * usual)
        # as a run's depths: a wrong digit, or all shifted from one on
        if (off := broken_habit(depth if way > 0.0 else depth[::-1])) is not None:
            row = off.k if way > 0.0 else len(depth) - 1 - off.k
            step, expected = off.usual, off.expected
        values = {"md_m": float(depth[row]), "step_m": step, "expected_m": expected}
        raise table.error(Finding("holes-depth-step", values, (row,)), row)
    return np.argsort(depth)


def _sines(table: Frame, name: str, written: str, stated: str | None, step: float) -> Array:
    stated = _unit(stated or "")
    if written and stated and written != stated:
        raise table.error(Finding("table-units", {"column": name, "units": (written, stated)}))
    unit = written or stated
    level = _level(unit, step)
    if np.isnan(level):
        raise table.error(Finding("readings-unit-unstated", {"column": name, "unit": unit, "allowed": UNITS}))
    values = table.number(name)
    if (bad := np.flatnonzero(np.abs(values) > level)).size:
        row = int(bad[0])
        facts: dict[str, Value] = {"value": float(values[row]), "allowed": f"-{level:g} .. {level:g} ({unit})"}
        raise table.error(Finding("input-value", facts | {"name": name}, (row,)), row)
    return np.sin(np.radians(values)) if unit == "deg" else values / level


def write_displacements(
    path: str | Path, found: Sequence[tuple[str, Displacement]], a0_azimuth: float | None = None
) -> None:
    """Write displacements, one row a reading and point: `survey`, `depth_m`, and of each axis what moved, in mm.

    Of each axis, here a: step_a_mm is the change over the step below the point, a_mm the displacement since the base
    reading, u_a_mm its standard uncertainty, check_sum_a_mm A0 + A180 over the step; flags say spike_a where the change
    of the check-sum is a spike, repeated_a where the base reading has the same one. Of two axes resultant_mm and
    u_resultant_mm, and with the azimuth of A0, rad, azimuth_deg of the resultant.
    """
    tables: list[dict[str, Array | list[str]]] = []
    for name, one in found:
        size = len(one.depth)
        flags = [""] * size
        table: dict[str, Array | list[str]] = {"survey": [name] * size, "depth_m": np.round(one.depth, 6)}
        for axis, moved in one.axes.items():
            sums = np.full(size - 1, np.nan) if moved.sums is None else moved.sums.values * one.step
            parts = {f"step_{axis}_mm": np.append(moved.steps, np.nan), f"{axis}_mm": moved.displacement}
            parts |= {f"u_{axis}_mm": moved.u, f"check_sum_{axis}_mm": np.append(sums, np.nan)}
            table |= {column: np.round(1000.0 * values, 6) + 0.0 for column, values in parts.items()}
            for what, where in (("spike", moved.spikes), ("repeated", moved.repeated)):
                for row in np.flatnonzero(where).tolist():
                    flags[row] = f"{flags[row]} {what}_{axis}".strip()
        if "b" in one.axes:
            resultant, u, direction = one.resultant()
            table |= {"resultant_mm": np.round(1e3 * resultant, 6), "u_resultant_mm": np.round(1e3 * u, 6)}
            if a0_azimuth is not None:
                table["azimuth_deg"] = np.round(np.degrees(a0_azimuth + direction) % 360.0, 3)
        tables.append({**table, "flags": flags})
    write_columns(joined(tables), path)
