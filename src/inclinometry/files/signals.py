"""The columns of a table that hold a tool's readings and a rig's settings: triads, temperature, angles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.readings import LARGEST
from inclinometry.constants import KINDS
from inclinometry.files.columns import (
    ANGLES,
    KIND_PREFIX,
    SERIALS,
    Channel,
    channel,
)
from inclinometry.files.frame import Frame
from inclinometry.findings import Finding, Value
from inclinometry.rotations import wrap_positive

COLDEST, HOTTEST = -100.0, 400.0


class Signals(NamedTuple):
    """Triads in a file.

    values, sd : kind -> (n, m); `sd` is that of one reading and only there where the file has it.
    units : kind -> label.
    names : kind -> the m column names.
    findings : of the table; channels that are missing.
    """

    values: dict[str, Array]
    sd: dict[str, Array]
    units: dict[str, str]
    names: dict[str, tuple[str, ...]]
    findings: tuple[Finding, ...]


def read_signals(table: Frame, kinds: Sequence[str] = KINDS) -> Signals:
    """The channels of a table by kind; FileError for an incomplete or contradictory set of columns."""
    found = [c for c in map(channel, table.names) if c is not None and c.kind in kinds]
    signals = Signals({}, {}, {}, {}, ())
    notes: list[Finding] = []
    for kind in kinds:
        ordered = _ordered(table, kind, [c for c in found if c.kind == kind and not c.sd])
        if not ordered:
            continue
        signals.units[kind] = ordered[0].unit
        signals.names[kind] = tuple(c.name for c in ordered)
        signals.values[kind] = np.stack([_readings(table, c.name) for c in ordered], axis=1)
        lacking = ["y", "z"][len(ordered) - 1 :] if ordered[0].axis == "x" else []
        if lacking:
            without = tuple(f"{KIND_PREFIX[kind]}_{axis}" for axis in lacking)
            values = {"lacking": without, "present": signals.names[kind]}
            notes.append(Finding("table-channels", values, severity="note"))
        if any(c.kind == kind for c in found if c.sd):
            signals.sd[kind] = _deviations(table, signals.names[kind])
    _orphans(table, found)
    if not signals.values:
        raise table.error(table.lacking("accel_x", "accel_y", "accel_z"))
    return signals._replace(findings=(*table.findings, *notes))


def _orphans(table: Frame, found: Sequence[Channel]) -> None:
    """FileError for a standard deviation without its channel."""
    lost = next((c for c in found if c.sd and c.name.removesuffix("_sd") not in table), None)
    if lost is not None:
        raise table.error(table.lacking(lost.name.removesuffix("_sd")))


def _ordered(table: Frame, kind: str, found: Sequence[Channel]) -> list[Channel]:
    """The channels of a kind in the order x, y, z or 1..m, after checking that the set is complete."""
    if not found:
        return []
    prefix, by_axis = KIND_PREFIX[kind], {c.axis: c for c in found}
    units = sorted({c.unit for c in found})
    if len(by_axis) < len(found) or len(units) > 1:
        raise table.error(_mixed(found))
    letters = [a for a in "xyz" if a in by_axis]
    if letters and len(letters) < len(by_axis):
        raise table.error(_mixed(found))
    wanted = ["x", "y", "z"][: "xyz".index(letters[-1]) + 1] if letters else []
    wanted = wanted or [str(i + 1) for i in range(max(map(int, by_axis)))][:200]
    tail = found[0].name.removeprefix(f"{prefix}_{found[0].axis}")
    table.require(f"{prefix}_{axis}{tail}" for axis in wanted)
    return [by_axis[axis] for axis in wanted]


def _mixed(found: Sequence[Channel]) -> Finding:
    return Finding("table-channels-mixed", {"columns": tuple(c.name for c in found)})


def _readings(table: Frame, name: str) -> Array:
    return table.within(name, -LARGEST, LARGEST)


def _deviations(table: Frame, names: Sequence[str]) -> Array:
    sd = np.stack([_readings(table, f"{name}_sd") for name in names], axis=1)
    if (sd < 0.0).any():
        row, column = np.argwhere(sd < 0.0)[0].tolist()
        name, value = f"{names[column]}_sd", float(sd[row, column])
        raise table.error(Finding("input-value", {"name": name, "value": value, "allowed": ">= 0"}), row)
    return sd


def read_serial(table: Frame) -> str:
    """Serial number of the tool, of the column that has one; FileError where rows are of several tools."""
    name = next((name for name in SERIALS if name in table), None)
    cells = table.text(name) if name else ()
    other = next((row for row, cell in enumerate(cells) if cell != cells[0]), None)
    if other is not None:
        facts: dict[str, Value] = {"name": str(name), "value": cells[other], "other": cells[0]}
        raise table.error(Finding("readings-constant-differs", facts | {"line": int(table.lines[0])}), other)
    return cells[0].strip() if cells else ""


def read_temperature(table: Frame) -> Array | None:
    """Column temperature_degC within what an instrument survives, or None."""
    if "temperature_degC" not in table:
        return None
    return table.within("temperature_degC", COLDEST, HOTTEST)


def read_settings(table: Frame) -> tuple[Array, Array, Array] | None:
    """Azimuth, inclination, toolface (n,), rad; None when the table has none of them. Errors as `need_settings`."""
    return need_settings(table) if any(name in table for name in ANGLES) else None


def need_settings(table: Frame) -> tuple[Array, Array, Array]:
    """Azimuth, inclination, toolface (n,), rad.

    Raises
    ------
    FileError
        One of the three is missing, values out of range, angles that look like radians.
    """
    dips = [name for name in table.names if name.lower() in ("dip", "dip_deg")]
    if dips and "inclination_deg" not in table:
        # in mines and caves dip is the angle of the tool below the horizon; here it is that of the magnetic field
        raise table.error(Finding("table-dip", {"column": dips[0]}))
    table.require(ANGLES)
    limits = (360.0, 180.0, 360.0)
    degrees = [table.within(name, -limit, limit) for name, limit in zip(ANGLES, limits, strict=True)]
    if look_like_radians(*degrees):
        most = max(float(np.abs(values).max()) for values in degrees)
        raise table.error(Finding("table-radians", {"columns": ANGLES, "most": most}))
    azimuth, inclination, toolface = map(np.radians, degrees)
    return azimuth, inclination, toolface


def look_like_radians(azimuth: Array, inclination: Array, toolface: Array) -> bool:
    """Whether columns said to be degrees hold radians.

    True when nothing exceeds what radians can be (inclination pi, the others 2 pi), and read as radians the toolface or
    the azimuth visits at least three quadrants, as a plan does. Settings in whole quarters of a degree are believed to
    be degrees: a fine scan 0, 1, .. 6 deg near vertical is a real plan, and radians of a plan are never such numbers.
    """
    if len(toolface) < 4 or np.abs(inclination).max() > 3.15:
        return False
    if max(np.abs(azimuth).max(), np.abs(toolface).max()) > 6.2833:
        return False
    quarters = 4.0 * np.concatenate([azimuth, inclination, toolface])
    if (np.abs(quarters - np.round(quarters)) < 1e-9).all():
        return False
    return any(len(np.unique(np.floor(wrap_positive(a + 0.3) / (np.pi / 2.0)))) >= 3 for a in (azimuth, toolface))
