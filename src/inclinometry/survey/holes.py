"""Drill holes: from depth, dip and azimuth to positions from the collar, straight where nothing was measured."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite, frozen
from inclinometry.errors import InputError, out_of_range
from inclinometry.findings import Finding, Value
from inclinometry.survey.path import Path, checked_stations, directions, minimum_curvature
from inclinometry.survey.plausibility import check_run
from inclinometry.survey.run import Run, angle_between
from inclinometry.survey.run_stations import SHARPEST


@dataclass(frozen=True, eq=False)
class Hole:
    """A hole from its collar to its end.

    path : stations, with one at the collar (depth 0) and one at the end; tvd counts from the collar.
    shots : how many of them were measured.
    straight : where it was taken to be straight: "first shot" above it, "last shot" below it, "single shot" all along.
    """

    path: Path
    shots: int
    straight: tuple[str, ...]


def inclination_of_dip(dip: ArrayLike, *, down_positive: bool) -> Array:
    """Inclination from the vertical, rad, of a dip from the horizontal.

    Examples
    --------
    >>> np.degrees(inclination_of_dip(np.radians([-90.0, -60.0, 10.0]), down_positive=False)).round(9)
    array([  0.,  30., 100.])
    """
    sign = -1.0 if down_positive else 1.0
    return np.asarray(0.5 * np.pi + sign * finite(dip, "dip"))


def check_holes(runs: Mapping[str, Run]) -> list[Finding]:
    """Each hole as a run whose sharpest bend is 20 times the usual one of the table, and the holes that go up."""
    bends = [
        angle_between(t[1:], t[:-1]) / np.diff(run.md)
        for run in runs.values()
        for t in (directions(run.inclination, run.azimuth),)
    ]
    every = np.concatenate([np.zeros(0), *bends])
    usual = float(np.median(every)) if len(every) >= 8 else np.inf
    sharpest = min(max(20.0 * usual, np.radians(10.0) / 30.0), SHARPEST)
    least = 4.0  # deg: shots err by degrees, and are read in whole ones
    found = []
    for name, run in runs.items():
        for one in check_run(run, sharpest):
            off, chance = (float(str(one.values.get(key, x))) for key, x in (("off_deg", least), ("chance", 0.0)))
            rare = off >= least and chance * len(runs) <= 1e-2  # in one of so many holes
            if rare and (one.severity == "refused" or one.code != "run-repeated"):
                found.append(Finding("holes-run", {"hole": name, "finding": one}))
    slopes = {name: float(np.degrees(np.median(run.inclination))) for name, run in runs.items()}
    if up := [name for name, slope in slopes.items() if slope > 91.0]:
        values: dict[str, Value] = {"count": len(up), "total": len(runs), "names": some_names(up)}
        rest = np.array([slope for name, slope in slopes.items() if name != up[0]])
        alone = len(up) == 1 and len(rest) >= 5 and slopes[up[0]] - rest.max() > 40.0  # a fan has holes between
        lost = alone and float(np.abs(rest - (180.0 - slopes[up[0]])).min()) < 15.0
        found.append(Finding("holes-up", values, severity="warning" if lost else "note"))
    return found


def some_names(names: Iterable[str]) -> str:
    """Up to eight of many names."""
    shown = list(names)
    return ", ".join(shown[:8]) + (", ..." if len(shown) > 8 else "")


def drill_hole(depth: ArrayLike, inclination: ArrayLike, azimuth: ArrayLike, end: float | None = None) -> Hole:
    """A hole by minimum curvature, from one shot or more; straight above the first and below the last, to `end`."""
    md, slope, heading = checked_stations(depth, inclination, azimuth, least=1)
    shots, last = len(md), float(md[-1])
    if md[0] < 0.0:
        raise out_of_range("depth", float(md[0]), ">= 0")
    if end is not None and end < last - 0.05:  # either may be rounded to tenths of a metre or foot
        raise InputError(Finding("holes-end-above", {"end_m": end, "md_m": last}, severity="refused"))
    if last == 0.0 and not end:
        raise InputError(Finding("holes-length-unknown", severity="refused"))
    straight = []
    if md[0] > 0.0:
        straight.append("first shot")
        md, slope, heading = (
            np.concatenate([[first], x]) for first, x in ((0.0, md), (slope[0], slope), (heading[0], heading))
        )
    if end is not None and end > last + 1e-6:
        straight.append("last shot")
        md, slope, heading = (np.append(x, one) for x, one in ((md, end), (slope, slope[-1]), (heading, heading[-1])))
    path = minimum_curvature(frozen(md), slope, heading)
    return Hole(path, shots, tuple(straight) if shots > 1 else ("single shot",))
