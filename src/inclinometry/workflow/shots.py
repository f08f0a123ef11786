"""From files to the checks of a place surveyed more than once: rotation shots, repeated stations, two depths."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.digest import digest_file
from inclinometry.errors import FileError, InputError, in_file, refused
from inclinometry.files._quantities import is_number, meaning
from inclinometry.files.columns import channel
from inclinometry.files.frame import Frame
from inclinometry.files.table import TableFile
from inclinometry.findings import Finding
from inclinometry.survey.flags import Check
from inclinometry.survey.quality import dual_depth, repeated_stations, rotation_shots
from inclinometry.workflow.convert import format_of
from inclinometry.workflow.six_axis import SixAxis, read_six_axis

APART_M: Final = 1.0
"""How far, m, shots of one place may lie apart along the hole."""


def read_shots(
    raw: str | Path,
    site: str | Path,
    calibration: str | Path | None = None,
    *,
    form: str | None = None,
    convention: str | None = None,
) -> SixAxis:
    """Read rotation shots: as `read_six_axis`, but in CSV the depth may repeat from row to row, or step back.

    Raises
    ------
    InputError, FileError
        As `read_six_axis`; depths more than `APART_M` apart.
    """

    def read(path: str | Path) -> SixAxis:
        return read_six_axis(path, site, calibration, form=form, convention=convention, ignored=None)

    table = _depth_table(raw) if format_of(raw, form) == "csv" else None
    if table is None or (np.diff(_metres(table)) > 0.0).all():
        run = read(raw)
        _one_place(run.stations.md, raw)
        return run
    _one_place(_metres(table), raw)
    step_m = 0.001
    # survey readers want depths that increase; shots have none to speak of, so they read a copy with steps of 1 mm
    with TemporaryDirectory() as folder:
        copy = Path(folder, Path(raw).name)
        # the table with depths that increase from the first, each row on the line it stood in
        name, factor = _depth_column(table)
        depths = table.number(name)[0] + step_m / factor * np.arange(len(table))
        columns = []
        for column, values in table.columns.items():
            numbers = depths if column == name else values
            if isinstance(numbers, tuple):
                columns.append(list(numbers))
            else:
                columns.append(["" if np.isnan(value) else repr(value) for value in numbers.tolist()])
        rows = {table.header_line or 0: list(table.names)}
        rows |= dict(zip(table.lines.tolist(), map(list, zip(*columns, strict=True)), strict=True))
        with copy.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream, quoting=csv.QUOTE_ALL, lineterminator="\n")
            for line in range(1, max(rows) + 1):
                if line in rows:
                    writer.writerow(rows[line])
                else:
                    stream.write("\n")
        try:
            run = read(copy)
        except FileError as error:
            if error.path != copy:
                raise
            raise in_file(error, raw) from None
    return replace(run, inputs={**run.inputs, "raw": digest_file(raw)})


def rotation_checks(run: SixAxis) -> list[Check]:
    """The checks of `rotation_shots` on shots read."""
    return rotation_shots(run.stations)


def repeat_checks(
    first: SixAxis, second: SixAxis, *, other_tool: bool = False, apart_m: float = APART_M
) -> list[Check]:
    """The checks of `repeated_stations` on two surveys; two calibrations count as two tools."""
    if first.inputs["raw"] == second.inputs["raw"]:
        raise refused("input-same-file", {"name": "SECOND", "other": "FIRST"})
    same = not other_tool and first.inputs.get("tool") == second.inputs.get("tool")
    return repeated_stations(first.stations, second.stations, same_tool=same, apart_m=apart_m)


def depth_check(first: str | Path, second: str | Path, first_sigma_m: float, second_sigma_m: float) -> Check:
    """Whether the depths of two files agree, row by row; where both have a column `station` it must be the same."""
    if digest_file(first) == digest_file(second):
        raise FileError(Finding("input-same-file", {"name": Path(second).name, "other": Path(first).name}), path=second)
    tables = [_depth_table(first), _depth_table(second)]
    one, two = (_given(table, path) for table, path in zip(tables, (first, second), strict=True))
    if len(one) != len(two):
        raise FileError(
            Finding("work-rows", {"name": "rows", "here": len(two), "there": len(one), "file": Path(first).name}),
            path=second,
        )
    if "station" in one and "station" in two:
        for row, names in enumerate(zip(one.text("station"), two.text("station"), strict=True)):
            if names[0] != names[1]:
                other = {"name": "station", "here": names[1], "there": names[0], "file": Path(first).name}
                raise two.error(Finding("work-rows", other), row)
    return dual_depth(_metres(one), _metres(two), first_sigma_m, second_sigma_m)


def _given(table: Frame | None, path: str | Path) -> Frame:
    if table is None:
        raise FileError(Finding("input-one-of", {"names": ("md_m", "md_ft")}), path=path)
    return table


def _depth_table(path: str | Path) -> Frame | None:
    """A CSV with its numbers, or None unless exactly one column is the depth."""
    table = TableFile(path)
    depths = [name for name in table.names if _is_depth(name)]
    if len(depths) != 1:
        return None
    return table.read(lambda name: is_number(name) or channel(name) is not None, set(table.names) - set(depths))


def _depth_column(table: Frame) -> tuple[str, float]:
    """The name of the depth, and how many metres its unit is."""
    name = next(name for name in table.names if _is_depth(name))
    found = meaning(name)
    if found is None or found.unit is None:
        raise table.error(Finding("input-one-of", {"names": ("md_m", "md_ft")}))
    return name, found.unit.factor


def _is_depth(name: str) -> bool:
    try:
        found = meaning(name)
    except InputError:
        return False
    return found is not None and found.key == "md"


def _metres(table: Frame) -> Array:
    name, factor = _depth_column(table)
    return table.number(name) * factor


def _one_place(md: Array, path: str | Path) -> None:
    apart = float(np.ptp(md))
    if apart > APART_M:
        raise FileError(Finding("work-apart", {"apart_m": apart, "most_m": APART_M}), path=path)
