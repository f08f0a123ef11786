"""Readings of an inclinometer casing: depth, A0, A180, B0, B180 in digi units, sines, degrees or mm a step."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array, Index, frozen
from inclinometry.errors import FileError, InputError
from inclinometry.files._quantities import factor_of
from inclinometry.files.profile import current
from inclinometry.files.table import Table, read_table
from inclinometry.files.writing import column, write_columns
from inclinometry.survey.displacement import LEAST_STEPS, CasingReading, Displacement, checked_faces

UNITS: Final = ("digi-25000", "digi-20000", "sin", "deg", "mm")
"""What a probe reads: 25000 or 20000 times the sine of the tilt, the sine, degrees, mm over one step."""
DEPTHS: Final = ("md", "measureddepth", "depth", "dept", "level", "flevel")
_FACE = re.compile(r"(?:face[ _]?)?([ab])[ _]?(0|180|\+|-)(?:(?:[ _]+|\s*[(\[])([\w -]+?)[)\]]?)?", re.IGNORECASE)
EVEN: Final = 0.02
"""By what part of a step depths may miss an even grid."""


class CasingFile(NamedTuple):
    """A reading, the line of each of its depths, what is doubtful about it, and the table it came from."""

    reading: CasingReading
    lines: tuple[int, ...]
    warnings: tuple[str, ...]
    table: Table


class Face(NamedTuple):
    """A column: its axis, its run (0 or 1) and the unit in its name ("" where there is none)."""

    axis: str
    run: int
    unit: str


def face(name: str) -> Face | None:
    """Read a column's name as that of a run.

    Examples
    --------
    >>> face("A180"), face("B- (mm)"), face("a0_digi_25000")
    (Face(axis='a', run=1, unit=''), Face(axis='b', run=1, unit='mm'), Face(axis='a', run=0, unit='digi-25000'))
    >>> face("azimuth") is None
    True
    """
    found = _FACE.fullmatch(name.strip())
    if found is None:
        return None
    unit = (found[3] or "").strip().lower()
    unit = next((known for known in UNITS if re.sub(r"\W|_", "", unit) == known.replace("-", "")), unit)
    return Face(found[1].lower(), int(found[2] in ("180", "-")), unit)


def read_casing(path: str | Path, unit: str | None = None) -> CasingFile:
    """Read one reading of a casing.

    Parameters
    ----------
    path : str or Path
        Depth with its unit (depth_m), a0, a180 and, where it was read, b0, b180 (A+, A-, B+, B-), each with a unit of
        `UNITS` in its name; a180 and b180 may both be missing. Rows from top to bottom, or from bottom to top.
    unit : str, optional
        Of the columns that name none.

    Raises
    ------
    FileError
        With the line: as `table.read_table`; a run or the unit is missing, units that contradict, sines beyond 1,
        depths that repeat or are not evenly spaced, fewer than five steps, a run 180 that repeats run 0.
    """
    stated = current().units
    names = read_table(path, numeric=lambda name: False).header
    columns: dict[str, Face] = {}
    depths: dict[str, float] = {}
    try:
        for name in names:
            found = face(name)
            if found is not None:
                columns[name] = found
            elif (factor := factor_of(name, DEPTHS, "m", stated)) is not None:
                depths[name] = factor
    except InputError as error:
        raise FileError(str(error), path=path) from None
    table = read_table(path, numeric=lambda name: name in depths or name in columns)
    if len(depths) != 1:
        what = f"{len(depths)} columns are depths ({', '.join(depths)})" if depths else "no column is the depth"
        raise table.error(f"{what}; one is needed, such as depth_m; columns found: {', '.join(names)}")
    _runs(table, list(columns.values()))
    (name, factor), = depths.items()  # fmt: skip
    depth = table.number(name) * factor
    order = _order(table, depth)
    step = float(np.ptp(depth)) / (len(depth) - 1)
    faces = {}
    warned = []
    for axis in sorted({one.axis for one in columns.values()}):
        runs = sorted((one.run, name) for name, one in columns.items() if one.axis == axis)
        faces[axis] = frozen(
            np.stack([_sines(table, name, columns[name].unit, unit, step) for _, name in runs], axis=1)[order]
        )
        if len(runs) == 2:
            try:
                warned += [text] if (text := checked_faces(axis, faces[axis])) else []
            except InputError as error:
                raise table.error(str(error)) from None
        else:
            warned.append(
                f"axis {axis.upper()}: a single run; its check-sums cannot be judged and a bias is not removed"
            )
    said = tuple(f"{Path(path).name}: {text}" for text in warned)
    lines = tuple(table.lines[order].tolist())
    return CasingFile(CasingReading(frozen(depth[order]), step, faces), lines, said, table)


def _runs(table: Table, found: Sequence[Face]) -> None:
    """FileError unless the runs are those of one way to read: A, or A and B, each once or each in both runs."""
    runs = {axis: sorted(one.run for one in found if one.axis == axis) for axis in "ab"}
    if not runs["a"]:
        raise table.error(f"column 'a0' is missing; columns found: {', '.join(table.header[:20])}")
    for axis in "ab":
        if len(runs[axis]) > len(set(runs[axis])):
            raise table.error(f"a run of axis {axis.upper()} stands in two columns; remove one")
        if runs[axis] == [1]:
            raise table.error(f"column '{axis}180' has no '{axis}0' beside it; add the run")
    if runs["b"] and runs["a"] != runs["b"]:
        raise table.error("one axis has run 180 and the other has not; add the run, or remove the other's")
    units = {one.unit for one in found}
    if len(units) > 1:
        several = " and ".join(f"{unit!r:.40}" for unit in sorted(units)[:5])
        raise table.error(f"the runs are in {several}; give them in one unit")


def _order(table: Table, depth: Array) -> Index:
    """Rows from top to bottom; FileError where depths repeat, turn back or leave the even grid."""
    if len(depth) < LEAST_STEPS:
        raise table.error(f"{len(depth)} depths; needed are at least {LEAST_STEPS}")
    steps = np.diff(depth)
    way = np.sign(np.median(steps)) or 1.0
    if (bad := np.flatnonzero(way * steps <= 0.0)).size:
        row = int(bad[0]) + 1
        what = "repeats" if steps[row - 1] == 0.0 else "turns back from"
        raise table.error(f"depth {depth[row]:g} m {what} {depth[row - 1]:g} m; remove the row or put it in order", row)
    usual = float(np.median(np.abs(steps)))
    if (bad := np.flatnonzero(np.abs(np.abs(steps) - usual) > EVEN * usual)).size:
        row = int(bad[0]) + 1
        problem = f"a step of {abs(steps[row - 1]):g} m from {depth[row - 1]:g} to {depth[row]:g} m, the others are"
        raise table.error(f"{problem} {usual:g} m; read every depth of the casing, one step apart", row)
    return np.argsort(depth)


def _sines(table: Table, name: str, written: str, stated: str | None, step: float) -> Array:
    if written and stated and written != stated:
        raise table.error(f"column {name!r} is in {written!r}, and --unit says {stated!r}; leave the option out")
    unit = written or stated
    if unit not in UNITS:
        what = f"the unit {unit!r}, which is not known" if unit else "no unit"
        raise table.error(
            f"column {name!r} has {what}; state --unit {', '.join(UNITS)}, or name it {name}_mm or the like"
        )
    values = table.number(name)
    if unit == "deg":
        sines = np.where(np.abs(values) <= 90.0, np.sin(np.radians(values)), 2.0)
    else:
        sines = values / {"digi-25000": 25000.0, "digi-20000": 20000.0, "sin": 1.0, "mm": 1000.0 * step}[unit]
    if (bad := np.flatnonzero(np.abs(sines) > 1.0)).size:
        row = int(bad[0])
        raise table.error(f"{name} is {values[row]:g}, no tilt in {unit}; is it in another unit?", row)
    return np.asarray(sines)


def write_displacements(path: str | Path, found: Sequence[tuple[str, Displacement]]) -> None:
    """Write displacements, one row a reading and point: `survey`, `depth_m`, and of each axis what moved, in mm.

    Of each axis, here a: step_a_mm is the change over the step below the point, a_mm the displacement since the base
    reading, u_a_mm its standard uncertainty, check_sum_a_mm A0 + A180 over the step; flags say spike_a where the change
    of the check-sum is a spike, repeated_a where the base reading has the same one.
    """
    axes = list(found[0][1].axes)
    names = ["survey", "depth_m"]
    for axis in axes:
        names += [f"step_{axis}_mm", f"{axis}_mm", f"u_{axis}_mm", f"check_sum_{axis}_mm"]
    cells: list[list[str]] = [[] for _ in (*names, "flags")]
    for name, one in found:
        size = len(one.depth)
        flags = [""] * size
        rows: list[list[str]] = [[name] * size, column(np.round(one.depth, 6))]
        for axis in axes:
            moved = one.axes[axis]
            sums = np.full(size - 1, np.nan) if moved.sums is None else moved.sums.values * one.step
            parts = (np.append(moved.steps, np.nan), moved.displacement, moved.u, np.append(sums, np.nan))
            rows += [column(np.round(1000.0 * values, 6) + 0.0) for values in parts]
            for what, where in (("spike", moved.spikes), ("repeated", moved.repeated)):
                for row in np.flatnonzero(where).tolist():
                    flags[row] = f"{flags[row]} {what}_{axis}".strip()
        for place, values in enumerate([*rows, flags]):
            cells[place] += values
    write_columns([*names, "flags"], cells, path)
