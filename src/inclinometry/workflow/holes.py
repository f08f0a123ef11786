"""From a table of many drill holes to the position of each, with the faults of those that cannot be used."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from inclinometry.arrays import Array, Index
from inclinometry.errors import FileError, InputError
from inclinometry.files.columns import closest
from inclinometry.files.holes_csv import Collar, Shots, read_collars, read_shots
from inclinometry.files.table import Progress
from inclinometry.survey.holes import Hole, drill_hole, inclination_of_dip
from inclinometry.survey.path import Path as HolePath
from inclinometry.survey.path import interpolate, minimum_curvature

DIP_DOWN = ("positive", "negative")
"""Signs that a dip downwards may have."""


@dataclass(frozen=True, eq=False)
class Holes:
    """Many holes.

    found : name -> Hole, in the order of the file.
    collars : name -> east, north, elevation of the collar, m; zeros without a table of collars.
    faults : name -> what is wrong, with its line.
    notes, warnings : what was taken for granted, and what may be wrong.
    inputs : name -> digest.
    """

    found: dict[str, Hole]
    collars: dict[str, tuple[float, float, float]]
    faults: dict[str, str]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
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
    """Positions of all holes of a table.

    Parameters
    ----------
    surveys, collars : str or Path
        As `read_shots` and `read_collars`.
    dip_down : str, optional
        Sign of a dip downwards, "positive" or "negative"; needed where a dip is not zero.
    azimuth_add : float
        rad, added to every azimuth, to count it from the north of the collars.
    skip_faulty : bool
        Leave faulty holes out; otherwise they are an error.
    progress : callable, optional

    Raises
    ------
    FileError
        As the readers; the sign of the dip is not stated; a faulty hole, or with `skip_faulty` none that is sound.
    """
    shots = read_shots(surveys, progress)
    inclination = _inclinations(shots, dip_down)
    known, inputs = None, {Path(surveys).name: shots.table.digest}
    if collars is not None:
        known, table = read_collars(collars)
        inputs[Path(collars).name] = table.digest
    found: dict[str, Hole] = {}
    starts: dict[str, tuple[float, float, float]] = {}
    faults: dict[str, str] = {}
    for name, rows in shots.rows.items():
        try:
            collar = None if known is None else _collar(name, known, Path(collars or ""))
            found[name] = _hole(shots, inclination, rows, azimuth_add, None if collar is None else collar.end)
            starts[name] = (0.0, 0.0, 0.0) if collar is None else (collar.east, collar.north, collar.elevation)
        except InputError as error:
            faults[name] = str(error)
    if faults and not (skip_faulty and found):
        raise FileError(_all_faults(faults, len(shots.rows), skip_faulty), path=surveys)
    alone = [] if known is None else [name for name in known if name not in shots.rows]
    warned = [f"hole {name} left out: {fault}" for name, fault in faults.items()]
    if alone:
        shown = ", ".join(alone[:8]) + (", ..." if len(alone) > 8 else "")
        warned.append(f"{len(alone)} of the collars have no shots in {Path(surveys).name}: {shown}")
    return Holes(found, starts, faults, _notes(found, known is not None, azimuth_add), tuple(warned), inputs)


def positions_every(path: HolePath, step: float) -> HolePath:
    """Points of a path at every `step` m, with its stations: the same curve.

    Examples
    --------
    >>> path = minimum_curvature([0.0, 30.0], [0.0, 0.0], [0.0, 0.0])
    >>> positions_every(path, 10.0).tvd.tolist()
    [0.0, 10.0, 20.0, 30.0]
    """
    grid = np.arange(1, int(path.md[-1] / step) + 1) * step
    # a grid point that is a station, but for rounding, is that station
    near = np.abs(grid[:, None] - path.md[np.searchsorted(path.md, grid)[:, None].clip(1, len(path) - 1) + [-1, 0]])
    grid = grid[(near.min(axis=1) > 1e-6) & (grid < path.md[-1])]
    md = np.sort(np.concatenate([path.md, grid]))
    points = interpolate(path, md)
    return minimum_curvature(md, points.inclination, points.azimuth)


def _inclinations(shots: Shots, dip_down: str | None) -> Array:
    if shots.inclination is not None:
        if dip_down is not None:
            raise shots.table.error(
                "--dip-down is of a dip; this file has the inclination from the vertical: leave it out"
            )
        return shots.inclination
    dip = np.zeros(0) if shots.dip is None else shots.dip
    there = np.degrees(dip[np.isfinite(dip)])
    if dip_down is None and there.any():
        low, high = float(there.min()), float(there.max())
        raise shots.table.error(
            f"dips are {low:g} to {high:g} deg, and nothing says which sign is downwards; state "
            "--dip-down negative (as in most mines: -90 straight down) or --dip-down positive"
        )
    sound = np.where(np.isfinite(dip), dip, 0.0)
    return np.where(np.isfinite(dip), inclination_of_dip(sound, down_positive=dip_down == "positive"), np.nan)


def _collar(name: str, known: Mapping[str, list[Collar]], path: Path) -> Collar:
    if name not in known:
        near = closest(name, list(known), 0.8)
        raise InputError(f"no collar in {path.name}" + (f" (is it {near!r} there?)" if near else ""))
    if len(known[name]) > 1:
        raise InputError(
            f"{len(known[name])} collars in {path.name}, lines {', '.join(str(c.line) for c in known[name])}"
        )
    return known[name][0]


def _hole(shots: Shots, inclination: Array, rows: Index, azimuth_add: float, end: float | None) -> Hole:
    """One hole; InputError with the line of its first fault."""
    lines = shots.table.lines[rows].tolist()
    depth, slope, heading = shots.depth[rows], inclination[rows], shots.azimuth[rows]
    angle = "dip" if shots.inclination is None else "inclination"
    low = slope if shots.inclination is not None else slope - 0.5 * np.pi
    limit = np.pi if shots.inclination is not None else 0.5 * np.pi
    # straight up or down every azimuth is the same direction
    heading = np.where(np.isnan(heading) & (np.sin(slope) < 1e-9), -azimuth_add, heading)
    for k, line in enumerate(lines):
        for name, value in (("depth", depth[k]), (angle, slope[k]), ("azimuth", heading[k])):
            if np.isnan(value):
                raise InputError(f"line {line}: {name} is empty")
        if abs(low[k]) > limit + 1e-9 or slope[k] < -1e-9:
            raise InputError(f"line {line}: {angle} is beyond {np.degrees(limit):g} deg")
        if abs(heading[k]) > 2.0 * np.pi + 1e-9:
            raise InputError(f"line {line}: azimuth is {np.degrees(heading[k]):g} deg, allowed -360 to 360")
        if k and depth[k] <= depth[k - 1]:
            what = "again" if depth[k] == depth[k - 1] else f"after {depth[k - 1]:g} m"
            raise InputError(f"line {line}: depth {depth[k]:g} m {what}; depths must increase from row to row")
    try:
        return drill_hole(
            depth, slope.clip(0.0, np.pi), heading + azimuth_add, None if end is None or np.isnan(end) else end
        )
    except InputError as error:
        raise InputError(f"line {lines[0]}: {error}") from None


def _all_faults(faults: Mapping[str, str], total: int, skipped: bool) -> str:
    shown = [f"{name} ({fault})" for name, fault in list(faults.items())[:5]]
    more = f" and {len(faults) - 5} more" if len(faults) > 5 else ""
    remedy = "none is left" if skipped else "correct them, or leave them out by --skip-faulty"
    return f"{len(faults)} of {total} hole(s) faulty: {'; '.join(shown)}{more}; {remedy}"


def _notes(found: Mapping[str, Hole], collars: bool, azimuth_add: float) -> tuple[str, ...]:
    notes = [] if collars else ["no collars: every hole begins at 0, 0, 0"]
    turned = f", {np.degrees(azimuth_add):+g} deg added" if azimuth_add else ""
    notes.append(f"east and north are counted from the north of the azimuths as given{turned}")
    straight: dict[str, list[str]] = {}
    for name, hole in found.items():
        for text in hole.notes:
            straight.setdefault(text.partition(" at ")[0], []).append(name)
    for text, names in straight.items():
        shown = ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")
        notes.append(f"{text}: {len(names)} hole(s), {shown}")
    return tuple(notes)
