"""One table of many drill holes, a table of their collars, and the positions along them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array, Index, Mask
from inclinometry.errors import FileError, InputError, in_file
from inclinometry.files._quantities import factor_of, hole_names
from inclinometry.files.frame import Frame
from inclinometry.files.profile import current
from inclinometry.files.table import TableFile
from inclinometry.files.text import Progress
from inclinometry.files.writing import joined, write_columns
from inclinometry.findings import Finding
from inclinometry.survey.path import Path as HolePath
from inclinometry.survey.path import dogleg_severity_deg
from inclinometry.tabular import in_degrees

_UNITS: Final = {"depth": "m", "dip": "rad", "inclination": "rad", "azimuth": "rad"}
"""What a shot has besides its hole: unit here."""


class Shots(NamedTuple):
    """The shots of many holes.

    rows : hole -> its rows in the order of the file.
    depth : (n,) m; dip : (n,) rad from the horizontal, or None; inclination : (n,) rad from the vertical, or None;
    azimuth : (n,) rad. NaN where a cell is empty. magnetic : (n,) where norths are stated and they differ, else None.
    """

    rows: Mapping[str, Index]
    depth: Array
    dip: Array | None
    inclination: Array | None
    azimuth: Array
    magnetic: Mask | None
    table: Frame


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
    table, rows, found = _by_hole(path, _UNITS, progress)
    if len(rows) == len(table) and any(name.casefold() == "name" for name in table.names):
        raise table.error(table.lacking("hole"))  # names of stations
    for name in ("depth", "azimuth"):
        if name not in found:
            raise table.error(table.lacking(name))
    if ("dip" in found) == ("inclination" in found):
        raise table.error(Finding("input-one-of", {"names": ("dip", "inclination")}))
    norths = np.array(table.text("azimuth_reference") if "azimuth_reference" in table else [], dtype=str)
    magnetic = norths == "magnetic" if len(set(norths)) > 1 else None
    if magnetic is not None and set(norths) != {"grid", "magnetic"}:
        raise table.error(Finding("input-north", {"norths": tuple(sorted(set(norths)))}))
    angles = (found.get("dip"), found.get("inclination"), found["azimuth"])
    return Shots(rows, found["depth"], *angles, magnetic, table)


def hole_column(name: str) -> str:
    """What a column of shots of many holes is: "hole", "depth", "dip", "inclination", "azimuth", or "" for another.

    >>> hole_column("BHID"), hole_column("Dip (deg)"), hole_column("lithology")
    ('hole', 'dip', '')
    """
    if "".join(filter(str.isalnum, name)).lower() in hole_names("hole"):
        return "hole"
    for what, own in _UNITS.items():
        with suppress(InputError):
            if factor_of(name, hole_names(what), own, ("m", "deg")) is not None:
                return what
    return ""


def read_collars(path: str | Path) -> tuple[dict[str, list[Collar]], Frame]:
    """Read hole, x, y, z (east, north, elevation) and, where there is one, the end depth; every row of a hole.

    Raises
    ------
    FileError
        As `table.read_table`; a column or its unit is missing, an empty position, a hole without name.
    """
    table, rows, found = _by_hole(path, dict.fromkeys(("x", "y", "z", "end"), "m"), None)
    for name in ("x", "y", "z"):
        if name not in found:
            raise table.error(table.lacking(name))
        if (bad := np.flatnonzero(np.isnan(found[name]))).size:
            raise table.error(Finding("input-empty", {"name": name}), int(bad[0]))
    end = found.get("end", np.full(len(table), np.nan))
    columns = (found["x"], found["y"], found["z"], end)
    places = list(map(Collar, *(values.tolist() for values in columns), table.lines.tolist()))
    return {hole: [places[row] for row in of] for hole, of in rows.items()}, table


def same(columns: tuple[str, ...]) -> Finding:
    """The refusal of columns that hold one quantity."""
    return Finding("table-same", {"columns": columns})


def _by_hole(
    path: str | Path, wanted: Mapping[str, str], progress: Progress | None
) -> tuple[Frame, dict[str, Index], dict[str, Array]]:
    """A table, the rows of each hole, and its columns by what they are, in m and rad."""
    opened = TableFile(path, progress)
    names, known = opened.names, hole_names("hole")
    ids = [name for name in names if "".join(filter(str.isalnum, name)).lower() in known]
    ids = ids or [name for name in names if name.casefold() == "name"]
    if len(ids) != 1:
        lacking = Finding("file-column", {"columns": ("hole",), "present": tuple(names[:20])})
        raise FileError(same(tuple(ids)) if ids else lacking, path=path)
    found: dict[str, tuple[str, float]] = {}
    try:
        for name in names:
            for what, own in wanted.items():
                factor = (
                    None
                    if name in (*ids, "azimuth_reference")
                    else factor_of(name, hole_names(what), own, current().units)
                )
                if factor is None:
                    continue
                if what in found:
                    raise FileError(same((found[what][0], name)), path=path)
                found[what] = (name, factor)
    except FileError:
        raise
    except InputError as error:
        raise in_file(error, path) from None
    numbers = {name for name, _ in found.values()}
    table = opened.read(lambda name: name in numbers, numbers)
    rows: dict[str, list[int]] = {}
    for row, hole in enumerate(table.text(ids[0])):
        if not hole:
            raise table.error(Finding("input-empty", {"name": ids[0]}), row)
        rows.setdefault(hole, []).append(row)
    places = {hole: np.array(of, dtype=np.intp) for hole, of in rows.items()}
    return table, places, {what: table.number(name) * factor for what, (name, factor) in found.items()}


def write_positions(path: str | Path, holes: Sequence[tuple[str, HolePath, tuple[float, float, float]]]) -> None:
    """Write one row a station; `holes` are name, path from the collar, and east, north, elevation of the collar, m."""
    tables: list[dict[str, Array | list[str]]] = []
    for name, hole, (east, north, elevation) in holes:
        lengths = {"east_m": east + hole.east, "north_m": north + hole.north, "elevation_m": elevation - hole.tvd}
        tables.append({
            "hole": [name] * len(hole),
            "md_m": hole.md,
            **in_degrees(hole, "inclination", "azimuth"),
            **{column: np.round(x, 6) + 0.0 for column, x in lengths.items()},
            "dls_deg_30m": np.round(dogleg_severity_deg(hole), 6),
        })  # fmt: skip
    write_columns(joined(tables), path)
