"""From a table of many drill holes to the position of each, with the faults of those that cannot be used."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from inclinometry.arrays import Array, Index
from inclinometry.errors import FileError, InputError, refused
from inclinometry.files.columns import closest
from inclinometry.files.holes_csv import Collar, Shots, read_collars, read_shots
from inclinometry.files.text import Progress, marks_nothing
from inclinometry.findings import Finding, Value
from inclinometry.survey.holes import Hole, check_holes, drill_hole, inclination_of_dip, some_names
from inclinometry.survey.path import Path as HolePath
from inclinometry.survey.path import interpolate, minimum_curvature
from inclinometry.survey.run import Run


@dataclass(frozen=True, eq=False)
class Holes:
    """Many holes by name, in the order of the file.

    collars : east, north, elevation, m; zeros without a table of collars. faults : what is wrong with those left out.
    """

    found: dict[str, Hole]
    collars: dict[str, tuple[float, float, float]]
    faults: dict[str, Finding]
    findings: tuple[Finding, ...]
    inputs: dict[str, str]


def read_holes(
    surveys: str | Path,
    collars: str | Path | None = None,
    *,
    dip_down: str | None = None,
    azimuth_add: float = 0.0,
    skip_faulty: bool = False,
    progress: Progress | None = None,
) -> Holes:
    """Positions of all holes of a table; `azimuth_add` (rad) brings azimuths to the north of the collars.

    Where rows of the table state grid and magnetic north, it is added to the magnetic rows.
    """
    shots = read_shots(surveys, progress)
    if shots.magnetic is not None and azimuth_add == 0.0:
        raise shots.table.error(Finding("holes-norths", {"count": int(shots.magnetic.sum())}))
    inclination = _inclinations(shots, dip_down)
    known, inputs = None, {Path(surveys).name: shots.table.digest}
    if collars is not None:
        known, table = read_collars(collars)
        inputs[Path(collars).name] = table.digest
    found: dict[str, Hole] = {}
    starts: dict[str, tuple[float, float, float]] = {}
    faults: dict[str, Finding] = {}
    runs: dict[str, Run] = {}
    for name, rows in shots.rows.items():
        try:
            collar = None if known is None else _collar(name, known, Path(collars or ""))
            run = _shots(shots, inclination, rows, azimuth_add)
            end = None if collar is None or np.isnan(collar.end) else collar.end
            found[name] = drill_hole(run.md, run.inclination, run.azimuth, end)
            starts[name] = (0.0, 0.0, 0.0) if collar is None else (collar.east, collar.north, collar.elevation)
            runs[name] = run
        except InputError as error:
            row = error.finding.rows[0] if error.finding.rows else 0
            values: dict[str, Value] = {"hole": name, "line": int(shots.table.lines[rows[row]])}
            faults[name] = Finding("holes-left-out", values | {"fault": error.finding})
    if faults and not (skip_faulty and found):
        first = dict(next(iter(faults.values())).values)
        first |= {"count": len(faults), "total": len(shots.rows), "names": some_names(faults)}
        raise FileError(Finding("holes-faulty", first, severity="refused"), path=surveys)
    said = [*faults.values(), *check_holes(runs)]
    if alone := [name for name in known or () if name not in shots.rows]:
        said.append(Finding("holes-collar-alone", {"count": len(alone), "names": some_names(alone)}))
    if known is None:
        said.append(Finding("holes-no-collars", severity="note"))
    said.append(Finding("holes-north", {"added_deg": float(np.degrees(azimuth_add))}, severity="note"))
    for where in ("single shot", "first shot", "last shot"):
        if names := [name for name, hole in found.items() if where in hole.straight]:
            straight: dict[str, Value] = {"where": where, "count": len(names), "names": some_names(names)}
            said.append(Finding("holes-straight", straight, severity="note"))
    return Holes(found, starts, faults, tuple(said), inputs)


def positions_every(path: HolePath, step: float) -> HolePath:
    """Points of a path at every `step` m, with its stations: the same curve."""
    grid = np.arange(1, int(path.md[-1] / step) + 1) * step
    # a grid point that is a station, but for rounding, is that station
    near = np.abs(grid[:, None] - path.md[np.searchsorted(path.md, grid)[:, None].clip(1, len(path) - 1) + [-1, 0]])
    grid = grid[(near.min(axis=1) > 1e-6) & (grid > path.md[0]) & (grid < path.md[-1])]
    md = np.sort(np.concatenate([path.md, grid]))
    points = interpolate(path, md)
    start = (path.north[0], path.east[0], path.tvd[0])
    return minimum_curvature(md, points.inclination, points.azimuth, start=start)


def _inclinations(shots: Shots, dip_down: str | None) -> Array:
    if shots.inclination is not None:
        if dip_down is not None:
            raise shots.table.error(Finding("input-not-with", {"name": "--dip-down", "other": "inclination_deg"}))
        return shots.inclination
    dip = np.zeros(0) if shots.dip is None else shots.dip
    there = np.degrees(dip[np.isfinite(dip)])
    if dip_down is None and there.any():
        low, high = float(there.min()), float(there.max())
        values: dict[str, Value] = {"low_deg": low, "high_deg": high}
        raise shots.table.error(Finding("holes-dip-sign", values, severity="refused"))
    sound = np.where(np.isfinite(dip), dip, 0.0)
    return np.where(np.isfinite(dip), inclination_of_dip(sound, down_positive=dip_down == "positive"), np.nan)


def _collar(name: str, known: Mapping[str, list[Collar]], path: Path) -> Collar:
    if name not in known:
        other = closest(name, list(known), 0.8)
        near = (other,) if other else ()
        raise InputError(Finding("holes-collar-missing", {"file": path.name, "near": near}, severity="refused"))
    if len(known[name]) > 1:
        lines = ",".join(str(one.line) for one in known[name])
        raise refused("input-repeated", {"name": f"{path.name}:{lines}", "value": name})
    return known[name][0]


def _shots(shots: Shots, inclination: Array, rows: Index, azimuth_add: float) -> Run:
    """The shots of one hole as a run; InputError at its first fault, whose row counts within the hole."""
    depth, slope, heading = shots.depth[rows], inclination[rows], shots.azimuth[rows]
    turn = azimuth_add * (np.ones(len(rows)) if shots.magnetic is None else shots.magnetic[rows])
    # straight up or down every azimuth is the same direction
    heading = np.where(np.isnan(heading) & (np.sin(slope) < 1e-9), -turn, heading)
    angle, stated = ("inclination", slope) if shots.dip is None else ("dip", shots.dip[rows])
    bounds = {angle: (0.0 if shots.dip is None else -90.0, 180.0 if shots.dip is None else 90.0)}
    below = shots.azimuth[shots.azimuth < 0.0]
    mark = below.size and np.allclose(below, np.radians(-99.0))  # of an empty cell, where no other azimuth is negative
    bounds["azimuth"] = (0.0 if mark else -360.0, 360.0)
    columns = {"depth": depth, angle: stated, "azimuth": heading}
    for k in range(len(rows)):
        for what, column in columns.items():
            low, high = np.radians(bounds.get(what, (-np.inf, np.inf)))
            if np.isnan(column[k]):
                raise InputError(Finding("table-empty", {"column": what}, (k,)))
            if not low - 1e-9 <= column[k] <= high + 1e-9:
                value = round(float(np.degrees(column[k])), 6)
                if marks_nothing(value):
                    raise InputError(Finding("table-null", {"column": what, "value": value}, (k,)))
                values: dict[str, Value] = {"name": what, "value": value}
                values["allowed"] = f"{bounds[what][0]:g} .. {bounds[what][1]:g} deg"
                raise InputError(Finding("input-value", values, (k,)))
        if k and depth[k] <= depth[k - 1]:
            values = {"md_m": float(depth[k]), "last_m": float(depth[k - 1])}
            raise InputError(Finding("holes-depth-order", values, (k,), "refused"))
    return Run(depth, slope.clip(0.0, np.pi), heading + turn)
