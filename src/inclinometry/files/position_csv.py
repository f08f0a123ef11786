"""Stations of a well in, positions with their uncertainty out, and every source of it at every station."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inclinometry.arrays import Array, frozen
from inclinometry.constants import FOOT
from inclinometry.earth.site import REFERENCES
from inclinometry.errors import InputError
from inclinometry.files import writing
from inclinometry.files._quantities import listed_axis
from inclinometry.files.columns import PARTS, SURVEY, channel, numbers_among
from inclinometry.files.frame import Frame
from inclinometry.files.gyro_csv import STATION
from inclinometry.files.holes_csv import hole_column
from inclinometry.files.profile import current
from inclinometry.files.survey_csv import check_increasing, differs
from inclinometry.files.table import TableFile, read_table
from inclinometry.files.text import NULLS, NumberReader, Progress, marks_nothing
from inclinometry.findings import Finding, Value
from inclinometry.position.propagation import PositionUncertainty
from inclinometry.position.well import hole_sigmas, horizontal_ellipse
from inclinometry.survey.path import REVERSAL, directions, dogleg_severity_deg, through_positions
from inclinometry.survey.path import Path as WellPath

COVARIANCES: Final = ("cov_nn", "cov_ee", "cov_vv", "cov_ne", "cov_nv", "cov_ev")
"""Columns of a covariance, m^2; v is down."""
POSITION: Final = (
    "md_m", "tvd_m", "north_m", "east_m", "dls_deg_30m", *COVARIANCES, "semi_major_m", "semi_minor_m",
    "major_azimuth_deg", "sigma_high_side_m", "sigma_lateral_m", "sigma_along_hole_m", "north_reference",
)  # fmt: skip
"""The contract of the position file, in its order; axes of the horizontal ellipse and sigmas are one standard
deviation, the reference says which north they and the positions count from."""

_LISTED: Final = ("north_m", "east_m", "tvd_m")


class Listed(NamedTuple):
    """A column of positions beside the angles: "north", "east" or "tvd", its name, (n,) m with NaN where empty."""

    axis: str
    name: str
    values: Array


@dataclass(frozen=True, eq=False)
class WellStations:
    """n stations of a well, in the order of depth.

    md : (n,) m, increasing. inclination, azimuth : (n,) rad, from the north `azimuth_reference`. temperature : degC.
    toolface : (n,) rad, NaN where the file is silent; None without a column. lines, digest : as in `Frame`.
    start : north, east, tvd, m, of the first station, where the file is positions alone.
    listed : columns of positions in the file. unread : those that have no unit of length, or are no numbers.
    findings : as in `Frame`; rows without inclination and azimuth, which are no stations.
    """

    md: Array
    inclination: Array
    azimuth: Array
    azimuth_reference: str
    toolface: Array | None
    temperature: Array | None
    lines: NDArray[np.int64]
    path: Path
    digest: str
    listed: tuple[Listed, ...] = ()
    unread: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
    start: tuple[float, float, float] | None = None

    def __len__(self) -> int:
        return len(self.md)


def read_well(path: str | Path, *, progress: Progress | None = None) -> WellStations:
    """Read `md_m` (or `md_ft`), `inclination_deg`, `azimuth_deg`, `azimuth_reference`; a survey file has them all.

    Rows that have neither inclination nor azimuth are left out: logs say so of depths that were not surveyed. A file
    without these columns that has north, east and tvd, or x, y and z, is a path through positions.

    Raises
    ------
    FileError
        With the line: as `table.read_table`; an angle that is missing or out of range; an azimuth without reference or
        from another north than the first; depths that do not increase, or both in metres and feet, or beyond any well;
        a hole that turns by half a turn between two stations.

    Examples
    --------
    >>> import tempfile
    >>> text = "md_ft,inclination_deg,azimuth_deg,azimuth_reference\\n0,0,0,grid\\n100,3,45,grid\\n"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "survey.csv").write_text(text)
    ...     well = read_well(Path(folder, "survey.csv"))
    >>> float(well.md[1].round(9)), well.azimuth_reference
    (30.48, 'grid')
    """
    others = [name for name in SURVEY if name not in ("md_m", "flags", "azimuth_reference")]
    used = ("md_m", "md_ft", "inclination_deg", "azimuth_deg", "toolface_deg", "temperature_degC")
    names, gaps = (*SURVEY, *used, *_LISTED), [*others, "temperature_degC", *_LISTED]
    opened, numeric = TableFile(path, progress), numbers_among(names)
    # a channel is not needed here: a tie-in has none
    gaps += [name for name in opened.take(numeric) if channel(name)]
    table = opened.read(numeric, gaps)
    table.unknown((*names, *STATION, *PARTS, "toolface_type"))
    table = _one_well(table)
    if "inclination_deg" not in table and "azimuth_deg" not in table and _axes(table):
        vertical = next((n for n in ("md_m", "md_ft", "tvd_m") if n in table), None)
        # without a measured depth only a well that ends at the surface is listed from the bottom up
        known = vertical != "tvd_m" or abs(table.number("tvd_m")[-1]) < 0.01 * table.number("tvd_m")[0]
        table = table.downwards(vertical if known else None)
        return _through(table, *(_axes(table) or ()))
    table.require(("inclination_deg", "azimuth_deg"))
    empty = np.isnan(table.number("inclination_deg")) & np.isnan(table.number("azimuth_deg"))
    findings = list(table.findings)
    if empty.any() and not empty.all():
        left = {"count": int(empty.sum()), "line": int(table.lines[empty][0])}
        findings.append(Finding("work-rows-left-out", left, severity="note"))
        table = table.rows(~empty)
    table = table.downwards(table.depth()[0])
    name, metres = table.depth()
    values = table.number(name)
    check_increasing(table, name, values)
    deepest = 20e3  # measured depth, m, that no well reaches; the longest is 15 km, which is 50,000 ft
    wrong = (metres < 0.0) | (metres > deepest)
    if wrong.any():
        row = int(np.argmax(wrong))
        allowed = f"0 .. {deepest if name == 'md_m' else deepest / FOOT:.0f}"
        facts: dict[str, Value] = {"name": name, "value": float(values[row]), "allowed": allowed}
        feet = name == "md_m" and values[row] > 0.0
        raise table.error(_in_another_unit(facts, "md_ft") if feet else Finding("input-value", facts), row)
    if len(metres) < 2:
        raise table.error(Finding("input-few", {"name": "stations", "count": len(metres), "least": 2}))
    md = frozen(metres)
    inclination, azimuth = _angle(table, "inclination_deg", 0.0, 180.0), _angle(table, "azimuth_deg", -360.0, 360.0)
    reference = _reference(table)
    along = directions(inclination, azimuth)
    # half the dogleg, without the digits that an arccosine loses
    apart, together = (np.linalg.norm(x, axis=1) for x in (along[1:] - along[:-1], along[1:] + along[:-1]))
    dogleg = 2.0 * np.arctan2(apart, together)
    if dogleg.max() > np.pi - REVERSAL:
        row = int(np.argmax(dogleg > np.pi - REVERSAL)) + 1
        facts = {"turn_deg": float(np.degrees(dogleg[row - 1])), "from_m": float(md[row - 1]), "to_m": float(md[row])}
        raise table.error(Finding("readings-turn-half", facts), row)
    toolface = frozen(np.radians(table.number("toolface_deg"))) if "toolface_deg" in table else None
    temperature = frozen(table.number("temperature_degC")) if "temperature_degC" in table else None
    listed, unread = _listed(table)
    return WellStations(
        md,
        inclination,
        azimuth,
        reference,
        toolface,
        temperature,
        table.lines,
        table.path,
        table.digest,
        listed,
        unread,
        tuple(findings),
    )


def _one_well(table: Frame) -> Frame:
    """The rows of one well: where a table has several, the well that --sheet names."""
    named, sheet = next((name for name in table.names if hole_column(name) == "hole"), None), current().sheet
    wells = () if named is None else tuple(dict.fromkeys(table.text(named)))
    if named is None or len(wells) < 2:
        return table
    well = sheet if sheet in wells else (sheet or "").rpartition("/")[2]  # of SHEET/WELL
    if well not in wells:
        raise table.error(Finding("file-surveys", {"names": wells[:20]}))
    return table.rows(np.array([name == well for name in table.text(named)]))


def _reference(table: Frame) -> str:
    """The north of all azimuths."""
    if "azimuth_reference" not in table:
        raise table.error(Finding("table-north", {"allowed": REFERENCES}))
    cells = [cell.strip() for cell in table.text("azimuth_reference")]
    for row, cell in enumerate(cells):
        if cell not in REFERENCES:
            facts: dict[str, Value] = {"name": "azimuth_reference", "value": f"{cell!r:.60}", "allowed": REFERENCES}
            raise table.error(Finding("input-choice", facts), row)
        if cell != cells[0]:
            raise table.error(differs(table, "azimuth_reference", cell, cells[0], 0), row)
    stated = str(current().constants.get("azimuth_reference", cells[0]))
    if stated != cells[0]:
        raise table.error(Finding("table-north-differs", {"value": cells[0], "stated": stated}))
    return cells[0]


def _axes(table: Frame) -> list[Listed] | None:
    """North, east and vertical of a file that is positions alone; None where one is missing."""
    found = {one.axis: one for one in reversed(_listed(table, alone=True)[0])}
    vertical = found.get("tvd", found.get("z"))
    axes = (found.get("north"), found.get("east"), vertical)
    return [one for one in axes if one is not None] if all(one is not None for one in axes) else None


def _through(table: Frame, north: Listed, east: Listed, vertical: Listed) -> WellStations:
    """The stations of a file of positions, their angles those of the arcs through them."""
    up = vertical.axis == "z" and vertical.values[-1] < vertical.values[0]
    down = Listed("tvd", vertical.name, -vertical.values if up else vertical.values)
    points = np.stack([north.values, east.values, down.values], axis=1)
    if len(points) < 3:
        raise table.error(Finding("input-few", {"name": "stations", "count": len(points), "least": 3}))
    if np.isnan(points).any():
        row, axis = (int(x[0]) for x in np.nonzero(np.isnan(points)))
        raise table.error(Finding("input-empty", {"name": (north, east, vertical)[axis].name}), row)
    apart = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if not apart.all():
        row = int(np.argmin(apart)) + 1
        raise table.error(Finding("input-repeated", {"name": north.name, "value": float(points[row, 0])}), row)
    digits = ((unit * 10.0**-n) for n in range(5) for unit in (FOOT, 1.0))
    exact = (one for one in digits if (np.abs(points / one - np.round(points / one)) < 1e-4).all())
    resolution = next(exact, 1e-4)  # finer ones are as well met
    length, inclination, azimuth = through_positions(points, resolution)
    depths = "md_m" in table or "md_ft" in table
    if depths:
        name, md = table.depth()
        check_increasing(table, name, table.number(name))
    else:
        first = max(float(points[0, 2]), 0.0) if vertical.axis == "tvd" else 0.0
        md = first + np.concatenate([[0.0], np.cumsum(length)])
    said: dict[str, Value] = {"names": (north.name, east.name, vertical.name), "resolution_m": resolution}
    said["vertical"] = "elevation" if up else "depth"
    return WellStations(
        frozen(md),
        frozen(inclination),
        frozen(azimuth),
        _reference(table),
        None,
        None,
        table.lines,
        table.path,
        table.digest,
        (north, east, down),
        (),
        (*table.findings, Finding("readings-through-positions", said, severity="note")),
        tuple(points[0].tolist()),
    )


def _listed(table: Frame, alone: bool = False) -> tuple[tuple[Listed, ...], tuple[str, ...]]:
    """Columns of positions, and the names of those that cannot be read; nothing of the path depends on them."""
    found: list[Listed] = []
    unread: list[str] = []
    profile = current()
    for name in table.names:
        if name in _LISTED:
            found.append(Listed(name.removesuffix("_m"), name, table.number(name)))
            continue
        cells = table.columns[name]
        if not isinstance(cells, tuple) or not any(cells):
            continue
        try:
            what = listed_axis(name, profile.units, alone)
            if what is None:
                continue
            reader = NumberReader(table.path)
            values = reader.convert(cells, name, table.lines.tolist(), gaps=True)
            reader.finish()
        except InputError:
            # N may be a count and E an error
            unread += [name] if sum(map(str.isalpha, name)) > 1 else []
            continue
        empty = np.isin(values, NULLS if profile.null is None else (profile.null,))
        found.append(Listed(what[0], name, np.where(empty, np.nan, values * what[1])))
    return tuple(found), tuple(unread)


def _in_another_unit(facts: dict[str, Value], right: str) -> Finding:
    return Finding("readings-unit-other", {**facts, "right": right})


def _out_of_range(table: Frame, name: str, row: int, allowed: str) -> Finding:
    """What an angle out of range may be meant as."""
    values, azimuths = table.number(name), table.number("azimuth_deg")
    value, upright = float(values[row]), name == "inclination_deg" and len(values) > 2
    facts: dict[str, Value] = {"name": name, "value": value}
    if marks_nothing(value):
        return Finding("table-null", {"column": name, "value": value})
    if upright and -90.0 <= value < 0.0 and (np.abs(values) <= 90.0).all():
        return Finding("readings-dip", facts)
    turned = (values >= 0.0).all() and np.mean(values > 180.0) > 0.1 and ((azimuths >= 0.0) & (azimuths <= 180.0)).all()
    if upright and turned:
        return Finding("readings-exchanged", facts)
    facts["allowed"] = allowed
    return Finding("input-value", facts) if value < 0.0 else _in_another_unit(facts, name.replace("_deg", "_gon"))


def _angle(table: Frame, name: str, low: float, high: float) -> Array:
    values = table.number(name)
    wrong = ~((values >= low) & (values <= high))
    if wrong.any():
        row = int(np.argmax(wrong))
        if np.isnan(values[row]):
            raise table.error(Finding("input-empty", {"name": name}), row)
        raise table.error(_out_of_range(table, name, row, f"{low:g} .. {high:g}"), row)
    return frozen(np.radians(values))


def read_tie(path: str | Path, depth: float, north: str) -> tuple[tuple[float, float, float], Array]:
    """Position (north, east, tvd), m, and covariance (3, 3), m^2, of the station of a position.csv at a depth, m."""
    table = read_table(path, numeric=lambda name: name in POSITION[:-1], gaps=POSITION[:-1])
    table.require(POSITION[: 5 + len(COVARIANCES)] + POSITION[-1:])
    row = int(np.argmin(np.abs(table.number("md_m") - depth)))
    if abs(table.number("md_m")[row] - depth) > 0.005:
        raise table.error(Finding("readings-tie-depth", {"md_m": depth, "near_m": float(table.number("md_m")[row])}))
    if table.text("north_reference")[row] != north:
        raise table.error(Finding("input-north", {"norths": (table.text("north_reference")[row], north)}), row)
    values = [float(table.number(name)[row]) for name in ("north_m", "east_m", "tvd_m", *COVARIANCES)]
    covariance = np.empty((3, 3))
    for name, value in zip(COVARIANCES, values[3:], strict=True):
        i, j = ("nev".index(axis) for axis in name.removeprefix("cov_"))
        covariance[i, j] = covariance[j, i] = value
    return (values[0], values[1], values[2]), np.nan_to_num(covariance)


def position_columns(
    path: WellPath,
    uncertainty: PositionUncertainty | None,
    north: str,
    *,
    section: float | None = None,
    stations: Array | None = None,
    angles: bool = False,
    feet: bool = False,
) -> dict[str, Array | str | list[str]]:
    """Columns of the position file, degrees and metres, from true or grid `north`; NaN without uncertainty.

    section : azimuth of the vertical section, rad, a column more; from north 0, east 0.
    stations : measured depths of the stations of a path that has points between them, a column more.
    angles : inclination and azimuth as well. feet : lengths in ft, dogleg in deg/100 ft.
    """
    found: dict[str, Array | str | list[str]] = {
        "md_m": path.md,
        "tvd_m": path.tvd,
        "north_m": path.north,
        "east_m": path.east,
        "dls_deg_30m": dogleg_severity_deg(path),
    }
    unknown = np.full(len(path), np.nan)
    found |= dict.fromkeys(POSITION[5:-1], unknown)
    if uncertainty is not None:
        covariance = uncertainty.covariance if stations is None else uncertainty.between(path.md)
        ellipse = horizontal_ellipse(covariance)
        sigmas = hole_sigmas(covariance, path.inclination, path.azimuth)
        found |= _covariance_columns(covariance)
        found |= {"semi_major_m": ellipse.major, "semi_minor_m": ellipse.minor}
        found["major_azimuth_deg"] = writing.degrees(ellipse.direction)
        found |= dict(zip(POSITION[-4:-1], sigmas.T, strict=True))
    found["north_reference"] = north
    if section is not None:
        found["section_m"] = path.north * np.cos(section) + path.east * np.sin(section)
    if angles:
        found |= {"inclination_deg": writing.degrees(path.inclination), "azimuth_deg": writing.degrees(path.azimuth)}
    if stations is not None:
        found["point"] = np.where(np.isin(path.md, stations), "station", "between").tolist()
    return _in_feet(found) if feet else found


def _in_feet(columns: Mapping[str, Array | str | list[str]]) -> dict[str, Array | str | list[str]]:
    """The same columns in ft, ft2 and deg/100 ft."""
    found: dict[str, Array | str | list[str]] = {}
    for name, one in columns.items():
        own, factor = (f"{name[:-2]}_ft", 1.0 / FOOT) if name.endswith("_m") else (name, 1.0)
        own, factor = (f"{name}_ft2", FOOT**-2) if name in COVARIANCES else (own, factor)
        own, factor = ("dls_deg_100ft", 100.0 * FOOT / 30.0) if name == "dls_deg_30m" else (own, factor)
        found[own] = one * factor if isinstance(one, np.ndarray) else one
    return found


def _covariance_columns(covariance: Array) -> dict[str, Array]:
    places = {name: ["nev".index(axis) for axis in name.removeprefix("cov_")] for name in COVARIANCES}
    return {name: covariance[:, i, j] + 0.0 for name, (i, j) in places.items()}


def write_position_csv(
    target: str | Path,
    path: WellPath,
    uncertainty: PositionUncertainty | None,
    north: str,
    comments: Sequence[str] = (),
    **more: Any,
) -> None:
    """Write positions of the stations; parameters as in `position_columns`.

    Columns: `POSITION`. Without an uncertainty its cells are empty. Comments stand above the names, after `#`.
    """
    columns = position_columns(path, uncertainty, north, **more)
    cells = {name: [values] * len(path) if isinstance(values, str) else values for name, values in columns.items()}
    writing.write_columns(cells, target, comments)


def write_sources_csv(target: str | Path, uncertainty: PositionUncertainty, *, feet: bool = False) -> None:
    """Write the covariance of every source at every station, one row each; their sum is the total.

    Columns: md_m, source, propagation and `COVARIANCES`. A tie-on position that is itself uncertain is a source of
    that name.
    """
    size = len(uncertainty)
    parts = [(name, one.propagation, one.covariance) for name, one in uncertainty.sources.items()]
    tie = uncertainty.survey.tie
    if tie.any():
        parts.append(("tie-on", "systematic", np.broadcast_to(tie, (size, 3, 3))))
    # the sources of a station stand together
    stacked = np.stack([covariance for _, _, covariance in parts], axis=1).reshape(-1, 3, 3)
    columns: dict[str, Array | str | list[str]] = {
        "md_m": np.repeat(uncertainty.survey.md, len(parts)),
        "source": [name for name, _, _ in parts] * size,
        "propagation": [kind for _, kind, _ in parts] * size,
        **_covariance_columns(stacked),
    }
    writing.write_columns(_in_feet(columns) if feet else columns, target)
