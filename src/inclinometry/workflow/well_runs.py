"""Several runs of a well as one: which of them counts where, and what is wrong where they meet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from itertools import pairwise
from typing import Any, TypeAlias, TypeVar

import numpy as np

from inclinometry.earth.site import Site, convert_azimuth
from inclinometry.errors import refused
from inclinometry.files.errors_json import RunErrors
from inclinometry.files.position_csv import WellStations
from inclinometry.files.survey_csv import RawSurvey
from inclinometry.findings import Finding, Value
from inclinometry.survey.path import directions, interpolate, minimum_curvature
from inclinometry.uncertainty import AngleErrors

Run = TypeVar("Run", RawSurvey, RunErrors)
Piece: TypeAlias = tuple[int, int, int]
"""First and last station of a stretch of a well, and its run, from 0."""


def stations_between(run: Run, low: float, high: float) -> Run:
    """What a file has of the stations from `low` to `high`, m."""
    rows = (run.md >= low) & (run.md <= high)
    if not rows.any():
        raise refused("input-few", {"name": "stations", "count": 0, "least": 1})

    def part(value: Any) -> Any:
        if isinstance(value, Mapping):
            return {name: part(one) for name, one in value.items()}
        if isinstance(value, AngleErrors):
            return value._replace(by_parameter=value.by_parameter[rows])
        return value[rows] if isinstance(value, np.ndarray) else value

    return replace(run, **{one.name: part(getattr(run, one.name)) for one in fields(run)})


def one_well(wells: Sequence[WellStations], site: Site, north: str) -> tuple[WellStations, list[Piece], list[Finding]]:
    """The stations of several runs as one well, the stretches of each run, and findings.

    Between its first and its last station a run replaces those before it.
    """
    first = wells[0]
    if len(wells) == 1:
        return first, [(0, len(first) - 1, 0)], []
    same = len({one.azimuth_reference for one in wells}) == 1
    reference = first.azimuth_reference if same else north
    turned = [
        one.azimuth if same else convert_azimuth(one.azimuth, one.azimuth_reference, north, site) for one in wells
    ]
    of = np.concatenate([np.full(len(one), k) for k, one in enumerate(wells)])
    md, slope, azimuth = (np.concatenate(x) for x in ([w.md for w in wells], [w.inclination for w in wells], turned))
    along, kept, found = directions(slope, azimuth), np.ones(len(of), dtype=bool), list[Finding]()
    for k, one in enumerate(wells[1:], 1):
        own = int(np.argmax(of == k))
        above, low = kept & (of < k), one.md[0] - 0.005
        at = np.flatnonzero(above & (np.abs(md - one.md[0]) < 0.005))
        if at.size and np.linalg.norm(along[at[0]] - along[own]) < 1e-4:  # a tie-in row that repeats the run above
            kept[own], low = False, one.md[0] + 0.005
        hidden = np.flatnonzero(above & (md >= low) & (md <= one.md[-1] + 0.005))
        if hidden.size:
            there = interpolate(
                minimum_curvature(one.md, one.inclination, turned[k]), md[hidden].clip(one.md[0], one.md[-1])
            )
            apart = np.linalg.norm(along[hidden] - directions(there.inclination, there.azimuth), axis=1)
            off = float(np.degrees(apart.max()))
            where: dict[str, Value] = {"file": one.path.name, "count": int(hidden.size), "off_deg": off}
            where |= {"others": tuple(dict.fromkeys(wells[n].path.name for n in of[hidden]))}
            where |= {"from_m": float(md[hidden].min()), "to_m": float(md[hidden].max())}
            # more than two tools differ by, less than a wrong north or well makes
            found.append(Finding("work-runs-overlap", where, severity="warning" if off > 3.0 else "note"))
        kept[hidden] = False
    order = np.flatnonzero(kept)[np.argsort(md[kept], kind="stable")]
    md, of = md[order], of[order]
    ends = [0, *(np.flatnonzero(np.diff(of)) + 1).tolist(), len(of)]
    pieces = [(i, j - 1, int(of[i])) for i, j in pairwise(ends)]
    usual = float(np.median(np.diff(md)))
    for (_, i, upper), (j, _, under) in pairwise(pieces):
        if md[j] - md[i] > max(100.0, 3.0 * usual):
            where = {"from_m": float(md[i]), "to_m": float(md[j]), "gap_m": float(md[j] - md[i])}
            found.append(
                Finding("work-runs-gap", where | {"file": wells[under].path.name, "above": wells[upper].path.name})
            )
    blank = [np.full(len(one), np.nan) for one in wells]
    faces, heats = ([getattr(one, name) for one in wells] for name in ("toolface", "temperature"))
    toolface, temperature = (
        None if all(x is None for x in columns)
        else np.concatenate([y if x is None else x for x, y in zip(columns, blank, strict=True)])[order]
        for columns in (faces, heats)
    )  # fmt: skip
    lines = np.concatenate([one.lines for one in wells])[order]
    said = tuple(one for well in wells for one in well.findings)
    whole = replace(first, md=md, inclination=slope[order], azimuth=azimuth[order], azimuth_reference=reference)
    whole = replace(whole, toolface=toolface, temperature=temperature, lines=lines, findings=said)
    return replace(whole, start=wells[pieces[0][2]].start), pieces, found
