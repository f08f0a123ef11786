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
    Channel,
    channel,
)
from inclinometry.files.frame import Frame
from inclinometry.rotations import wrap_positive

COLDEST, HOTTEST = -100.0, 400.0


class Signals(NamedTuple):
    """Triads in a file.

    values, sd : kind -> (n, m); `sd` is that of one reading and only there where the file has it.
    units : kind -> label.
    names : kind -> the m column names.
    notes : what a person should know.
    """

    values: dict[str, Array]
    sd: dict[str, Array]
    units: dict[str, str]
    names: dict[str, tuple[str, ...]]
    notes: tuple[str, ...]


def read_signals(table: Frame, kinds: Sequence[str] = KINDS) -> Signals:
    """The channels of a table by kind; FileError for an incomplete or contradictory set of columns."""
    found = [c for c in map(channel, table.names) if c is not None and c.kind in kinds]
    signals = Signals({}, {}, {}, {}, ())
    notes: list[str] = []
    for kind in kinds:
        ordered = _ordered(table, kind, [c for c in found if c.kind == kind and not c.sd])
        if not ordered:
            continue
        signals.units[kind] = ordered[0].unit
        signals.names[kind] = tuple(c.name for c in ordered)
        signals.values[kind] = np.stack([_readings(table, c.name) for c in ordered], axis=1)
        lacking = ["y", "z"][len(ordered) - 1 :] if ordered[0].axis == "x" else []
        if lacking:
            number = "one channel" if len(ordered) == 1 else "two channels"
            without = " and ".join(f"{KIND_PREFIX[kind]}_{axis}" for axis in lacking)
            notes.append(f"{kind}: {number} ({', '.join(signals.names[kind])}), no {without} in the file")
        if any(c.kind == kind for c in found if c.sd):
            signals.sd[kind] = _deviations(table, signals.names[kind])
    _orphans(table, found)
    if not signals.values:
        shown = ", ".join(table.names[:20])
        raise table.error(
            f"no channels; add columns such as accel_x, accel_y, accel_z or mag_1; columns found: {shown}"
        )
    return signals._replace(notes=tuple(notes))


def _orphans(table: Frame, found: Sequence[Channel]) -> None:
    """FileError for a standard deviation without its channel."""
    lost = next((c for c in found if c.sd and c.name.removesuffix("_sd") not in table), None)
    if lost is not None:
        raise table.error(f"column {lost.name!r} has no {lost.name.removesuffix('_sd')!r} beside it; add or remove it")


def _ordered(table: Frame, kind: str, found: Sequence[Channel]) -> list[Channel]:
    """The channels of a kind in the order x, y, z or 1..m, after checking that the set is complete."""
    if not found:
        return []
    prefix, by_axis = KIND_PREFIX[kind], {c.axis: c for c in found}
    units = sorted({c.unit for c in found})
    if len(by_axis) < len(found) or len(units) > 1:
        names = ", ".join(c.name for c in found)
        raise table.error(f"{kind} columns {names} contradict each other; give each channel once, all in one unit")
    letters = [a for a in "xyz" if a in by_axis]
    if letters and len(letters) < len(by_axis):
        raise table.error(f"{kind} columns mix letters and numbers; name them {prefix}_x.. or {prefix}_1.., not both")
    wanted = ["x", "y", "z"][: "xyz".index(letters[-1]) + 1] if letters else []
    wanted = wanted or [str(i + 1) for i in range(max(map(int, by_axis)))][:200]
    tail = found[0].name.removeprefix(f"{prefix}_{found[0].axis}")
    table.require(f"{prefix}_{axis}{tail}" for axis in wanted)
    return [by_axis[axis] for axis in wanted]


def _readings(table: Frame, name: str) -> Array:
    return table.within(name, -LARGEST, LARGEST, remedy=": correct it or remove the row")


def _deviations(table: Frame, names: Sequence[str]) -> Array:
    sd = np.stack([_readings(table, f"{name}_sd") for name in names], axis=1)
    if (sd < 0.0).any():
        row, column = np.argwhere(sd < 0.0)[0].tolist()
        raise table.error(f"{names[column]}_sd is {sd[row, column]:g}; a standard deviation is not negative", row)
    return sd


def read_temperature(table: Frame) -> Array | None:
    """Column temperature_degC within what an instrument survives, or None."""
    if "temperature_degC" not in table:
        return None
    return table.within("temperature_degC", COLDEST, HOTTEST, remedy=": is it in another unit?")


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
        raise table.error(
            f"column 'inclination_deg' is missing; if {dips[0]!r} is the angle of the tool from the horizontal, name "
            "it inclination_deg and state that the dial counts from the horizontal, downwards or upwards; the dip of "
            "the magnetic field at the stand is reference_dip_deg"
        )
    table.require(ANGLES)
    limits = (360.0, 180.0, 360.0)
    degrees = [table.within(name, -limit, limit, " deg") for name, limit in zip(ANGLES, limits, strict=True)]
    if look_like_radians(*degrees):
        reach = ", ".join(f"{n} {np.abs(v).max():.5g}" for n, v in zip(ANGLES, degrees, strict=True))
        raise table.error(f"the angles look like radians (largest: {reach}); convert them to degrees")
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
