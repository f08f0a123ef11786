"""What a run does all along and breaks once: a turn beside an even hole, a depth beside even courses, the last one."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.survey.misread_station import one_digit
from inclinometry.survey.smoothness import FINEST, angle_between, smoothness

_LEAST: Final = np.radians(4.0)
_RATE: Final = np.radians(7.0) / 30.0
"""What a wedge or the start of a turn does in one course, beyond the courses beside it: in all, and for each metre."""
_SHORT: Final = np.radians(65.0) / 30.0
"""What a build of short radius does, for each metre."""
_TIMES: Final = 12.0


class Turn(NamedTuple):
    """A turn between rows k and k + 1, rad, where the courses beside it would turn by `usual`."""

    k: int
    size: float
    usual: float


def sharp_turn(md: Array, t: Array) -> Turn | None:
    """The sharpest turn of a hole with directions t (n, 3) that the hole beside it does not lead up to.

    What the two courses before and the two behind it do, each for as long as the course is, is theirs; beyond it
    `_LEAST` and `_RATE` (`_SHORT` where the inclination makes it) are allowed, and `_TIMES` the usual residual of the
    run. A turn that one station makes is not meant: it stays when either of the two is left out.

    Examples
    --------
    >>> md, azimuth = np.arange(0.0, 600.0, 30.0), np.where(np.arange(20) < 10, 0.5, 0.8)
    >>> t = np.stack([np.cos(azimuth), np.sin(azimuth), 0.6 * np.ones(20)], axis=1)
    >>> sharp_turn(md, t).k, round(float(np.degrees(sharp_turn(md, t).size)), 1)
    (9, 14.7)
    >>> sharp_turn(md, np.stack([np.sin(md / 600.0), 0.0 * md, np.cos(md / 600.0)], axis=1)) is None
    True
    """
    course, dogleg = np.diff(md), np.asarray(angle_between(t[1:], t[:-1]))
    if len(course) < 5:
        return None
    rate = dogleg / course
    noise = max(float(np.nanmedian(smoothness(md, t).residual)), FINEST)
    best: Turn | None = None
    for k in np.argsort(-dogleg)[:5]:
        if not 1 <= k <= len(course) - 2:
            continue
        beside = float(np.delete(rate[max(k - 2, 0) : k + 3], min(k, 2)).max() * course[k])
        beyond = float(dogleg[k]) - beside
        inclination = np.arctan2(np.hypot(t[k : k + 2, 0], t[k : k + 2, 1]), t[k : k + 2, 2])
        builds = abs(inclination[1] - inclination[0]) > 0.5 * dogleg[k]
        if beyond < max(_LEAST, (_SHORT if builds else _RATE) * float(course[k]), _TIMES * noise):
            continue
        around = [angle_between(t[a], t[b]) for a, b in ((k - 1, k + 1), (k, k + 2))]
        if min(around) > 0.5 * dogleg[k] and (best is None or dogleg[k] > best.size):
            best = Turn(int(k), float(dogleg[k]), max(float(np.median(dogleg)), FINEST))
    return best


class Break(NamedTuple):
    """A depth in row k that breaks the habit of the courses, m, and what it would be by that habit; whether all
    behind it are shifted alike."""

    k: int
    usual: float
    expected: float
    onwards: bool


def broken_habit(md: Array) -> Break | None:
    """One depth, or all from one on, off an even row of depths, by what a wrong digit makes.

    Courses have a habit where nine of ten are within a twentieth of their median. One depth is off where a course is
    longer and the next shorter by the same, more than a tenth; all from one on where a course is longer by 100 or
    1000 m to the habit's own spread.

    Examples
    --------
    >>> md = np.arange(0.0, 900.0, 30.0)
    >>> md[20] += 20.0
    >>> broken_habit(md)
    Break(k=20, usual=30.0, expected=600.0, onwards=False)
    """
    course = np.diff(md)
    if len(course) < 12:
        return None
    usual = float(np.median(course))
    off = course - usual
    if np.mean(np.abs(off) <= 0.05 * usual) < 0.9:
        return None
    spread = max(1.4826 * float(np.median(np.abs(off))), 1e-3 * usual)
    near = 4.0 * spread
    pairs = np.flatnonzero(
        (np.abs(off[:-1] + off[1:]) < 1.5 * near) & (np.abs(off[:-1]) > max(0.1 * usual, 2.0 * near))
    )
    if len(pairs) == 1:
        k = int(pairs[0])
        return Break(k + 1, usual, float(md[k] + md[k + 2]) / 2.0, onwards=False)
    skipped = np.abs(course - usual * np.round(course / usual)) < near  # stations left out
    longer = np.flatnonzero(~skipped & (np.abs(off[:, None] - (100.0, 1000.0)).min(axis=1) < near)).tolist()
    if len(longer) == 1 and len(pairs) == 0 and usual < 60.0:
        return Break(longer[0] + 1, usual, float(md[longer[0]]) + usual, onwards=True)
    return None


_BEYOND: Final = 3.0
"""Length of last courses, m: half of those that are longer than the others are longer by no more, 1 in 100 by 300 m."""
_ANYTHING: Final = 0.2 / 1e4
"""Density of a last depth that is wrong by no digit alone, 1/m."""


class Last(NamedTuple):
    """A last depth that may be wrong: logarithm of the likelihood ratio; its tenth, m, where that is in line, or 0."""

    ratio: float
    tenth: float


def last_depth(md: Array) -> Last | None:
    """Whether a digit of the last depth is likelier wrong than the last course long, as to a total depth it may be.

    Depths that differ from it in one digit are held against the habit of the courses: of the right ones 7 of 10 keep
    it and 3 end before. A course that is longer by x has the density s / (s + x)^2, s = `_BEYOND`.

    Examples
    --------
    >>> md = np.arange(0.0, 900.0, 30.0)
    >>> last_depth(np.append(md, 1148.0)) is None  # on to 278 m below the last station
    True
    >>> last_depth(np.append(md, 9000.0)).tenth
    900.0
    >>> last_depth(np.append(md, 1900.0)).tenth
    0.0
    """
    course = np.diff(md)
    if len(course) < 4:
        return None
    usual, last, before = float(np.median(course)), float(course[-1]), course[:-1]
    if last < max(8.0 * usual, 3.0 * float(before.max()), 100.0):
        return None
    tenth = float(md[-1]) / 10.0
    if md[-2] < tenth <= md[-2] + 3.0 * usual:
        return Last(np.inf, tenth)
    spread = max(1.4826 * float(np.median(np.abs(before - usual))), 0.01 * usual)
    digits = one_digit(round(float(md[-1]), 2))
    ends = np.array(digits) - md[-2]
    kept = 0.7 / (np.sqrt(2.0 * np.pi) * spread) * np.exp(-0.5 * ((ends - usual) / spread) ** 2)
    shorter = np.where((ends > 0.0) & (ends <= 1.2 * usual), 0.3 / (1.2 * usual), 0.0)
    wrong = float(np.sum(kept + shorter)) / len(digits) + _ANYTHING
    ratio = float(np.log(wrong * (_BEYOND + last) ** 2 / _BEYOND))
    return Last(ratio, 0.0) if ratio > np.log(100.0) else None
