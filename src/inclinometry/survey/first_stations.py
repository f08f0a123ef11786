"""How a hole begins, which tells a well from a hole of a mine, and a column from another.

A well goes down from the surface, vertical to its kick-off but for few; a hole up from a mine begins as it goes on,
and is short. Where a column may be counted from the other end, or two may be exchanged, the run is as smooth either
way, and these are weighed instead.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.rotations import wrap_positive
from inclinometry.survey.angle_units import scatter_likelihood
from inclinometry.survey.smoothness import scatter

_AT_THE_TOP: Final = 100.0
"""Measured depth, m, up to which a first station tells how a hole begins."""
_A_WELL: Final = 400.0
"""Length, m, below which a hole is not judged by its beginning."""
_WELLS: Final = (float(np.log(2000.0)), 0.7)
_UP_HOLES: Final = (float(np.log(150.0)), 0.8)
"""Lengths of wells and of holes up from a mine, the logarithm of m: mean and standard deviation."""


class Beginning(NamedTuple):
    """What is strange: of "columns" or "axes", a sentence, and whether no hole is like this."""

    name: str
    sentence: str
    refused: bool


def strange_beginning(md: Array, inclination: Array, azimuth: Array, *, axes: bool) -> Beginning | None:
    """Of a hole (n,), m and rad, that begins as hardly any does: upwards, level and then down, or columns exchanged.

    `axes` says that the angles come of six axes.

    Examples
    --------
    >>> md = np.arange(0.0, 900.0, 30.0)
    >>> strange_beginning(md, np.radians(md / 20.0), np.full(30, 1.0), axes=False) is None
    True
    >>> strange_beginning(md, np.pi - np.radians(md / 20.0), np.full(30, 1.0), axes=False).sentence[:23]
    'the hole climbs 789 m, '
    """
    if float(md[-1] - md[0]) < _A_WELL or len(md) < 5:
        return None
    i, a = np.degrees(inclination), np.degrees(wrap_positive(azimuth))
    at_top = bool(md[0] <= _AT_THE_TOP)
    first, last = float(np.median(i[:3])), float(np.median(i[-3:]))
    climbs = _climbs(md, i, axes=axes, at_top=at_top)
    if climbs is not None:
        return climbs
    if at_top and abs(first - 90.0) < 4.0 and last < 55.0 and np.mean(np.diff(i) <= 0.5) > 0.8:
        sentence = (
            f"the hole begins level ({first:.1f} deg at {md[0]:.12g} m) and ends at {last:.1f} deg, perhaps "
            "inclination is counted from the horizontal: convert it to 90 minus the reading"
        )
        return Beginning("columns", sentence, refused=False)
    near, beyond = float(np.median(a[:3])), float(np.median(a[-3:]))
    # an azimuth that turns hardly, or further than any inclination goes
    steady = float(np.ptp(i)) < 60.0 or i.max() > 115.0
    rising = np.mean(np.diff(a) >= -1.5) > 0.8 and a.max() < 125.0
    if at_top and near < 4.0 and beyond > 20.0 and rising and first > 12.0 and steady and _exchanged(md, i, a) > 0.0:
        sentence = (
            f"inclination is {first:.0f} deg at the top while azimuth grows from "
            f"{near:.1f} to {beyond:.0f} deg, perhaps their columns are exchanged: put their names right"
        )
        return Beginning("columns", sentence, refused=False)
    return None


def _climbs(md: Array, i: Array, *, axes: bool, at_top: bool) -> Beginning | None:
    """A well whose inclination counts from the other end, against a hole up from a mine, by length and beginning."""
    course, length = np.diff(md), float(md[-1] - md[0])
    mean = float(np.sum(0.5 * (i[1:] + i[:-1]) * course) / length)
    down = np.cos(np.radians(i))
    climbed = -float(np.sum(0.5 * (down[1:] + down[:-1]) * course))
    if climbed < 300.0 or mean < 100.0:
        return None

    def of_length(mean: float, sd: float) -> float:
        return -0.5 * float((np.log(length) - mean) / sd) ** 2 - float(np.log(sd))

    upright = i[0] > 150.0
    # a well begins vertical, 19 of 20, where its first station lies at the top, and 2 of 5 files begin deeper
    if at_top:
        begins = np.log((0.6 * 0.95) / (0.95 * 0.05)) if upright else np.log((0.6 * 0.05) / (0.95 * 0.95))
    else:
        begins = np.log(0.4 / 0.05)
    ratio = of_length(*_WELLS) - of_length(*_UP_HOLES) + float(begins)
    if ratio < np.log(3.0):
        return None
    ways = (
        "z or all axes of both triads reversed, or inclination counted from the other end"
        if axes
        else "inclination counted from the other end (180 minus it)"
    )
    sentence = (
        f"the hole climbs {climbed:.0f} m, inclination {mean:.0f} deg in the mean, perhaps {ways}: put the column "
        "right, or state the axes with --convention or a profile (--profile)"
        if axes
        else f"the hole climbs {climbed:.0f} m, inclination {mean:.0f} deg in the mean, perhaps {ways}: put the column "
        "right"
    )
    return Beginning("axes" if axes else "columns", sentence, bool(upright and at_top and ratio > np.log(5.0)))


def _exchanged(md: Array, i: Array, a: Array) -> float:
    """Logarithm of how much likelier i are azimuths of a well and a its inclinations, deg, than a slant hole's.

    A well goes down vertically before it builds, a hole that turns from north does not stay there. Of what was read,
    azimuths scatter as much across the hole as inclinations along it or more, and wildly in the vertical part.
    """
    turning = np.flatnonzero(a > 1.5)
    upright = float(md[turning[0]] - md[0])  # m; an even turn has come by 1.5 deg there
    builds = upright >= 60.0 and upright * (a.max() - a[0]) / (md[-1] - md[0]) > 3.0
    ratio = float(np.log(10.0 if builds else 0.05))
    of_i, of_a = scatter(i, md), scatter(a, md)
    if min(of_i, of_a) < 1e-3:
        return ratio  # a plan
    read, otherwise = (of_i, scatter(a, md, np.sin(np.radians(i)))), (of_a, scatter(i, md, np.sin(np.radians(a))))
    ratio += scatter_likelihood(*otherwise) - scatter_likelihood(*read)
    before, after = np.diff(md)[:-1], np.diff(md)[1:]
    off = i[1:-1] - (after * i[:-2] + before * i[2:]) / (before + after)
    near = a[1:-1] < 10.0
    # 0.03 deg of tilt; about its neighbours a station lies where its own error and half of theirs put it
    wild = np.hypot(of_i, 1.2 * 0.03 / np.maximum(np.sin(np.radians(a[1:-1])), 1e-3))[near]
    steady = 2.0 * np.log1p((off[near] / of_i) ** 2 / 3.0) + np.log(of_i)
    measured = float(np.sum(steady - 2.0 * np.log1p((off[near] / wild) ** 2 / 3.0) - np.log(wild)))
    # one table in ten has azimuths there that were put down
    return ratio + float(np.logaddexp(np.log(0.9) + measured, np.log(0.1)))
