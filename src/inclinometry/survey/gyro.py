"""A survey from stations whose north a gyro has found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, Mask, bottom_up, finite, increasing, within
from inclinometry.earth.site import Site, azimuth_sigma, convert_azimuth
from inclinometry.errors import refused, wrong_shape
from inclinometry.findings import Finding, Severity, Value
from inclinometry.gyro.result import FLAGS, North
from inclinometry.rotations import wrap_positive, wrap_signed
from inclinometry.survey.flags import ROUNDING, Check, sizes_check, summary, unjudged, worst
from inclinometry.survey.path import SurveyRun
from inclinometry.survey.reduce import Survey
from inclinometry.tabular import Column, Tabular, in_degrees
from inclinometry.uncertainty import AngleErrors


@dataclass(frozen=True)
class RepeatLimits:
    """What two runs may differ by, rad.

    inclination : at every station.
    azimuth, azimuth_steep : at stations from `steep` inclination up, and nearer to the vertical than that.
    stations : fewest stations compared.
    interval : longest distance between out-run stations that is interpolated over, m.
    """

    name: str
    source: str
    inclination: float
    azimuth: float
    azimuth_steep: float
    steep: float
    stations: int
    interval: float


class Statistics(NamedTuple):
    """Of out-run minus in-run, rad: mean, standard deviation, rms and largest size, over so many `stations`.

    systematic : the mean is more than three of its standard deviations from zero.
    """

    stations: int
    mean: float
    sd: float
    rms: float
    largest: float
    systematic: bool


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Tabular):
    """Two runs compared at the m depths of the in-run that the out-run covers.

    rows : (m,) of the in-run, from 0. inclination, azimuth : (m,) out-run minus in-run, rad; azimuth NaN where it
    cannot be compared. interpolated : (m,) the out-run has no station at this depth. verdicts : per station "pass",
    "fail" or, with too few of them, "not judged". statistics : "inclination" and "azimuth".
    """

    md: Array
    rows: Index
    inclination: Array
    azimuth: Array
    interpolated: Mask
    verdicts: Sequence[str]
    statistics: dict[str, Statistics]
    checks: Sequence[Check]
    limits: RepeatLimits
    findings: tuple[Finding, ...] = ()

    @property
    def verdict(self) -> str:
        """On the whole: "pass", "fail", or "not judged" where no azimuth could be compared."""
        found = worst(self.checks)
        return "not judged" if found == "pass" and worst(self.checks[2:]) == "not judged" else found

    def to_dict(self) -> dict[str, Column]:
        """One row a depth: the out-run less the in-run, and the verdict."""
        return {"md_m": self.md, **in_degrees(self, "inclination", "azimuth"), "verdict": list(self.verdicts)}


def compare_runs(in_run: SurveyRun, out_run: SurveyRun, limits: RepeatLimits) -> Comparison:
    """Compare two runs of one hole by depth; azimuths from the same north.

    The out-run is interpolated linearly to the in-run's depths, azimuth along the shorter arc, only inside its range
    and not over more than `limits.interval`. The inclination of the in-run decides which limit of azimuth holds; a
    value on its limit passes. With fewer stations than the limits ask for the verdict is "fail" and no station is
    judged.
    """
    if in_run.azimuth_reference != out_run.azimuth_reference:
        raise refused("input-north", {"norths": (in_run.azimuth_reference, out_run.azimuth_reference)})
    _checked(in_run, "in-run")
    _checked(out_run, "out-run")
    inclination, azimuth, covered, between = _interpolated(in_run.md, out_run, limits.interval)
    rows = np.flatnonzero(covered)
    inclination = inclination[rows] - in_run.inclination[rows]
    azimuth = np.asarray(wrap_signed(azimuth[rows] - in_run.azimuth[rows]))
    # no two runs repeat every station to the last figure
    known = np.isfinite(azimuth)
    difference, what = (azimuth[known], "azimuth") if known.any() else (inclination, "inclination")
    # fewer than three may be alike by the rounding of their figures; conversion and writing change 1e-9 rad
    if len(difference) >= 3 and (np.abs(difference) <= 1e-9).all():
        raise refused("survey-runs-same", {"quantity": what, "total": len(difference)})
    tilt = np.minimum(in_run.inclination[rows], np.pi - in_run.inclination[rows])
    steep = tilt < limits.steep - ROUNDING
    bad_inclination = np.abs(inclination) > limits.inclination + ROUNDING
    bad_azimuth = np.abs(azimuth) > np.where(steep, limits.azimuth_steep, limits.azimuth) + ROUNDING
    edge, enough = f"{np.degrees(limits.steep):g} deg", len(rows) >= limits.stations
    every, above, below = np.ones(len(rows), dtype=bool), known & ~steep, known & steep
    parts: tuple[tuple[str, str, Array, Mask, Mask, float], ...] = (
        ("inclination", "inclination", inclination, bad_inclination, every, limits.inclination),
        (f"azimuth, inclination from {edge} up", "azimuth", azimuth, bad_azimuth, above, limits.azimuth),
        (f"azimuth, inclination below {edge}", "azimuth", azimuth, bad_azimuth, below, limits.azimuth_steep),
    )
    common: dict[str, Value] = {"name": "common stations", "count": len(rows), "least": limits.stations}
    count = Check(
        "common stations",
        "pass" if enough else "fail",
        len(rows),
        limits.stations,
        (),
        Finding("survey-common" if enough else "input-few", common),
        "stations",
    )
    checks = [count, *(_check(*part, rows, enough) for part in parts)]
    bad = bad_inclination | bad_azimuth
    verdicts = tuple(("fail" if b else "pass") if enough else "not judged" for b in bad)
    statistics = {"inclination": _statistics(inclination), "azimuth": _statistics(azimuth)}
    between = between[rows]
    compared: tuple[tuple[str, int, int, Severity], ...] = (
        ("Out-run interpolated", int(between.sum()), len(rows), "note"),
        ("No out-run", len(in_run.md) - len(rows), len(in_run.md), "warning"),
        ("Azimuth not compared", int((~known).sum()), len(rows), "note"),
    )
    told = [
        Finding("survey-compared", {"what": what, "count": size, "total": total}, severity=severity)
        for what, size, total, severity in compared
        if size
    ]
    for name, found in statistics.items():
        if found.systematic:
            mean, sd = float(np.degrees(found.mean)), float(np.degrees(found.sd))
            told.append(Finding("survey-runs-differ", {"quantity": name, "mean_deg": mean, "sd_deg": sd}))
    md = np.asarray(in_run.md)[rows]
    return Comparison(md, rows, inclination, azimuth, between, verdicts, statistics, checks, limits, tuple(told))


def _checked(run: SurveyRun, name: str) -> None:
    """InputError where a run cannot be compared."""
    md = finite(run.md, f"{name}.md", (None,))
    increasing(md, f"{name}.md")
    within(run.inclination, f"{name}.inclination", 0.0, np.pi, "rad")
    for values, what in ((run.inclination, "inclination"), (run.azimuth, "azimuth")):
        if np.shape(values) != md.shape:
            raise wrong_shape(f"{name}.{what}", np.shape(values), str(md.shape))
        if np.isinf(values).any():
            raise refused("input-finite", {"name": f"{name}.{what}"})


def _interpolated(md: Array, run: SurveyRun, interval: float) -> tuple[Array, Array, Mask, Mask]:
    """Inclination and azimuth of the out-run at other depths, whether they are covered, and whether interpolated.

    Not covered outside its range and over gaps longer than `interval`.
    """
    same_depth = 1e-3  # depths closer than this, m, are one depth: nothing is interpolated
    if not len(run.md):
        nothing, none = np.full(len(md), np.nan), np.zeros(len(md), dtype=bool)
        return nothing, nothing, none, none
    last = len(run.md) - 1
    after = np.clip(np.searchsorted(run.md, md), min(1, last), last)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(run.md[before] - md) <= np.abs(run.md[after] - md), before, after)
    same = np.abs(run.md[nearest] - md) <= same_depth
    inside = (md > run.md[0]) & (md < run.md[-1])
    covered = same | (inside & (run.md[after] - run.md[before] <= interval + same_depth))
    span = np.where(after > before, run.md[after] - run.md[before], 1.0)
    share = (md - run.md[before]) / span
    turn = wrap_signed(run.azimuth[after] - run.azimuth[before])
    # between two stations whose azimuths differ by more the shorter arc is a guess
    turn = np.where(np.abs(turn) > np.pi / 2, np.nan, turn)
    inclination = run.inclination[before] + share * (run.inclination[after] - run.inclination[before])
    azimuth = wrap_positive(run.azimuth[before] + share * turn)
    return (
        np.where(same, run.inclination[nearest], inclination),
        np.where(same, run.azimuth[nearest], azimuth),
        covered,
        covered & ~same,
    )


def _statistics(difference: Array) -> Statistics:
    """Of the differences that are known."""
    known = difference[np.isfinite(difference)]
    count = len(known)
    if not count:
        return Statistics(0, np.nan, np.nan, np.nan, np.nan, False)
    mean, rms = float(known.mean()), float(np.sqrt(np.mean(known**2)))
    sd = float(known.std(ddof=1)) if count > 1 else float("nan")
    systematic = bool(count > 1 and abs(mean) > 3.0 * sd / np.sqrt(count) + ROUNDING)
    return Statistics(count, mean, sd, rms, float(np.abs(known).max()), systematic)


def _check(
    name: str, quantity: str, difference: Array, bad: Mask, able: Mask, limit: float, rows: Index, enough: bool
) -> Check:
    """One angle at the stations it is judged at."""
    if not able.any() or not enough:
        value = float(np.abs(difference[able]).max()) if able.any() else float("nan")
        return Check(name, "not judged", value, limit, (), unjudged("too few common stations with this angle"))
    order = np.where(able, np.abs(difference), -1.0)
    # one bad station is an event, many are the tool: the remedies differ
    remedy = "gyro few" if (able & bad).sum() <= 0.2 * able.sum() else "gyro"
    sizes = difference, np.full(len(difference), limit)
    return sizes_check(name, quantity, "rad", order, sizes, able & bad, remedy, rows)


def gyro_survey(
    md: ArrayLike,
    north: North,
    *,
    site: Site | None = None,
    g_total: ArrayLike | None = None,
    flags: Sequence[Sequence[str]] | None = None,
    tool: str = "",
    inputs: Mapping[str, str] | None = None,
    errors: Mapping[str, AngleErrors] | None = None,
) -> Survey:
    """Stations of a gyro run as a survey; azimuths from true north, which a gyro finds, or the site's grid.

    Depths are all different; a run taken from the bottom up is turned round. `errors` : cause -> what it does to the
    stations, in the order given.
    """
    depth = finite(md, "md", (None,))
    up = bottom_up(depth)
    order = np.arange(len(depth))[:: -1 if up else 1]
    increasing(depth[order], "md")
    azimuth, reference, components = north.azimuth, "true", dict(north.components)
    if site is not None and site.north_reference == "grid":
        reference = "grid"
        azimuth = np.where(np.isfinite(azimuth), convert_azimuth(np.nan_to_num(azimuth), "true", "grid", site), np.nan)
        if site.convergence_sigma is not None:
            added = np.zeros((len(depth), 4))
            added[:, 1] = azimuth_sigma("true", "grid", site) ** 2
            components["convergence"] = added
    joined = [(*own, *more) for own, more in zip(north.flags, flags or [()] * len(depth), strict=True)]
    # a channel that failed is named with its stations
    counted = {name: meaning for name, meaning in FLAGS.items() if name != "channel"}
    blank = np.full(len(depth), np.nan)
    total = blank if g_total is None else np.broadcast_to(np.asarray(g_total, dtype=np.float64), depth.shape)
    sorted_errors = {name: one._replace(by_parameter=one.by_parameter[order]) for name, one in (errors or {}).items()}
    turned = [Finding("survey-bottom-up", severity="note")] * up
    return Survey(
        depth[order],
        north.inclination[order],
        azimuth[order],
        north.toolface[order],
        north.gyro_toolface[order],
        total[order],
        blank,
        blank,
        {name: part[order] for name, part in components.items()},
        reference,
        [joined[n] for n in order],
        tool,
        dict(inputs or {}),
        findings=(*turned, *summary([joined[n] for n in order], counted)),
        errors=sorted_errors,
        common=_part(sorted_errors, True, len(depth)),
        random=_part(sorted_errors, False, len(depth)),
    )


def _part(errors: Mapping[str, AngleErrors], shared: bool, size: int) -> Array:
    """Covariance (n, 2, 2) of inclination and azimuth by the causes that the stations share, or by the others."""
    total = np.zeros((size if errors else 0, 2, 2))
    for one in errors.values():
        if one.shared == shared:
            total += one.by_parameter[:, :2] @ one.covariance @ np.swapaxes(one.by_parameter[:, :2], 1, 2)
    return total
