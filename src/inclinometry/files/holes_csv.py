"""One table of many drill holes, a table of their collars, and the positions along them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array, Index
from inclinometry.errors import FileError, InputError
from inclinometry.files._quantities import factor_of
from inclinometry.files.columns import closest
from inclinometry.files.profile import current
from inclinometry.files.table import Progress, Table, read_table
from inclinometry.files.writing import column, degrees, write_columns
from inclinometry.survey.path import Path as HolePath
from inclinometry.survey.path import dogleg_severity_deg

IDS: Final = (
    "hole", "holeid", "holename", "holeno", "bhid", "dhid", "borehole", "boreholeid", "drillhole", "drillholeid",
)  # fmt: skip
DEPTH: Final = ("md", "measureddepth", "depth", "dept", "at", "distance", "surveydepth")
_DIP: Final = ("dip", "dipangle", "plunge")
INCLINATION: Final = ("inclination", "incl", "inc")
AZIMUTH: Final = ("azimuth", "azim", "azi", "az", "bearing", "brg")
EAST: Final = ("x", "east", "easting", "xcollar", "collarx")
NORTH: Final = ("y", "north", "northing", "ycollar", "collary")
ELEVATION: Final = ("z", "elevation", "elev", "rl", "zcollar", "collarz", "level")
END: Final = ("enddepth", "eoh", "maxdepth", "totaldepth", "length", "finaldepth", "depth")


_SHOT: Final = {
    "depth": (DEPTH, "m"), "dip": (_DIP, "rad"), "inclination": (INCLINATION, "rad"), "azimuth": (AZIMUTH, "rad"),
}  # fmt: skip
"""What a shot has: names of its column, unit here."""


class Shots(NamedTuple):
    """The shots of many holes.

    rows : hole -> its rows in the order of the file.
    depth : (n,) m; dip : (n,) rad from the horizontal, or None; inclination : (n,) rad from the vertical, or None;
    azimuth : (n,) rad. NaN where a cell is empty.
    """

    rows: Mapping[str, Index]
    depth: Array
    dip: Array | None
    inclination: Array | None
    azimuth: Array
    table: Table


class Collar(NamedTuple):
    """Where a hole begins and ends: m, `end` along the hole or NaN."""

    east: float
    north: float
    elevation: float
    end: float
    line: int


def read_shots(path: str | Path, progress: Progress | None = None) -> Shots:
    """Read hole, depth, dip (or inclination), azimuth, with units in the names or stated for the file.

    Raises
    ------
    FileError
        As `table.read_table`; a column or its unit is missing, both dip and inclination, a hole without name.
    """
    table, rows, found = _by_hole(path, _SHOT, progress)
    for name in ("depth", "azimuth"):
        if name not in found:
            raise table.error(f"column '{name}' is missing; columns found: {', '.join(table.header[:20])}")
    if ("dip" in found) == ("inclination" in found):
        what = "both dip and inclination are there" if "dip" in found else "column 'dip' is missing"
        raise table.error(f"{what}; give the dip from the horizontal, or the inclination from the vertical")
    return Shots(rows, found["depth"], found.get("dip"), found.get("inclination"), found["azimuth"], table)


def hole_column(name: str) -> str:
    """What a column of shots of many holes is: "hole", "depth", "dip", "inclination", "azimuth", or "" for another.

    Examples
    --------
    >>> hole_column("BHID"), hole_column("Dip (deg)"), hole_column("lithology")
    ('hole', 'dip', '')
    """
    if "".join(filter(str.isalnum, name)).lower() in IDS:
        return "hole"
    for what, (known, own) in _SHOT.items():
        with suppress(InputError):
            if factor_of(name, known, own, ("m", "deg")) is not None:
                return what
    return ""


def read_collars(path: str | Path) -> tuple[dict[str, list[Collar]], Table]:
    """Read hole, x, y, z (east, north, elevation) and, where there is one, the end depth; every row of a hole.

    Raises
    ------
    FileError
        As `table.read_table`; a column or its unit is missing, an empty position, a hole without name.
    """
    wanted = {"x": (EAST, "m"), "y": (NORTH, "m"), "z": (ELEVATION, "m"), "end": (END, "m")}
    table, rows, found = _by_hole(path, wanted, None)
    for name in ("x", "y", "z"):
        if name not in found:
            raise table.error(f"column '{name}' is missing; columns found: {', '.join(table.header[:20])}")
        if (bad := np.flatnonzero(np.isnan(found[name]))).size:
            raise table.error(f"{name} is empty; fill it in or remove the row", int(bad[0]))
    end = found.get("end", np.full(len(table), np.nan))
    columns = (found["x"], found["y"], found["z"], end)
    places = list(map(Collar, *(values.tolist() for values in columns), table.lines.tolist()))
    return {hole: [places[row] for row in of] for hole, of in rows.items()}, table


def _by_hole(
    path: str | Path, wanted: Mapping[str, tuple[Collection[str], str]], progress: Progress | None
) -> tuple[Table, dict[str, Index], dict[str, Array]]:
    """A table, the rows of each hole, and its columns by what they are, in m and rad."""
    names = read_table(path, numeric=lambda name: False).header
    ids = [name for name in names if "".join(filter(str.isalnum, name)).lower() in IDS]
    if len(ids) != 1:
        near = next((name for name in names if closest(name, IDS)), None)
        what = f"{len(ids)} columns name the hole ({', '.join(ids)})" if ids else "no column names the hole"
        hint = f"; is it {near!r}? then rename it to hole" if near and not ids else ""
        raise FileError(f"{what}{hint}; columns found: {', '.join(names[:20])}", path=path)
    found: dict[str, tuple[str, float]] = {}
    try:
        for name in names:
            for what, (known, own) in wanted.items():
                factor = None if name in ids else factor_of(name, known, own, current().units)
                if factor is None:
                    continue
                if what in found:
                    raise InputError(f"columns {found[what][0]!r} and {name!r} are both the {what}; remove one")
                found[what] = (name, factor)
    except InputError as error:
        raise FileError(str(error), path=path) from None
    numbers = {name for name, _ in found.values()}
    table = read_table(path, progress, numeric=lambda name: name in numbers, gaps=numbers)
    rows: dict[str, list[int]] = {}
    for row, hole in enumerate(table.text(ids[0])):
        if not hole:
            raise table.error(f"column {ids[0]!r} is empty; every row needs the name of its hole", row)
        rows.setdefault(hole, []).append(row)
    places = {hole: np.array(of, dtype=np.intp) for hole, of in rows.items()}
    return table, places, {what: table.number(name) * factor for what, (name, factor) in found.items()}


def write_positions(path: str | Path, holes: Sequence[tuple[str, HolePath, tuple[float, float, float]]]) -> None:
    """Write one row a station: `hole`, `md_m`, inclination and azimuth, `east_m`, `north_m`, `elevation_m`, dogleg.

    Parameters
    ----------
    path : str or Path
    holes : sequence
        Name, path from the collar, and east, north and elevation of the collar, m.
    """
    names = ("hole", "md_m", "inclination_deg", "azimuth_deg", "east_m", "north_m", "elevation_m", "dls_deg_30m")
    cells: list[list[str]] = [[] for _ in names]
    for name, hole, (east, north, elevation) in holes:
        lengths = (east + hole.east, north + hole.north, elevation - hole.tvd)
        parts = (hole.md, degrees(hole.inclination), degrees(hole.azimuth), *(np.round(x, 6) + 0.0 for x in lengths))
        cells[0] += [name] * len(hole)
        for place, values in enumerate((*parts, np.round(dogleg_severity_deg(hole), 6)), 1):
            cells[place] += column(values)
    write_columns(names, cells, path)
