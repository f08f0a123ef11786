"""Angles that are degrees by name, and radians or grads by what they are: how finely they repeat, and where they end.

An instrument at rest reads a direction to some 0.02 to 1 deg, along the hole and across it, near the vertical as
elsewhere. Where readings scatter 57 times less about their neighbours, radians were read. What a plan, a smoothed log
or an azimuth that was put down and not measured does is allowed for by its share of right runs, so that no evidence is
larger than these shares let it be; of a scatter that the last digit hides only that is known.
"""

from __future__ import annotations

from math import erf
from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.rotations import wrap_positive
from inclinometry.survey.path import directions
from inclinometry.survey.smoothness import JUMP, power, scatter, smoothness

_RADIAN: Final = 180.0 / np.pi
_ALONG: Final = (float(np.log(0.12)), 1.0)
_ACROSS: Final = (float(np.log(0.25)), 1.1)
"""Scatter of readings along and across the hole, the logarithm of degrees: mean and standard deviation."""
_SPAN: Final = (float(np.log(1e-5)), float(np.log(0.3)))
"""Logarithms between which the scatter of a smoothed log, or of azimuths put down, is anything."""
_PLANNED: Final = 0.1
_SMOOTHED: Final = 0.02
"""Shares of right runs that are plans, whose scatter is rounding, and that are smoothed."""
_PUT_DOWN: Final = (0.3, 0.001)
"""Share of right runs whose azimuths were put down or smoothed and inclinations measured: near the vertical, where an
azimuth is worth little, and elsewhere."""
_VERTICAL: Final = 3.0
_VERTICAL_HOLES: Final = 0.15
"""Inclination, deg, that holes which are to be vertical stay below, and their share."""


_LEVEL: Final = ((0.97, 90.0, 2.0), (0.03, 95.0, 4.0))
"""Mean inclination of level parts, deg: shares, means and standard deviations; some climb to their toe."""


class Named(NamedTuple):
    """Of what unit the angles may be, in a sentence, and whether that is beyond doubt."""

    sentence: str
    refused: bool


def misnamed_angles(md: Array, inclination: Array, azimuth: Array) -> Named | None:
    """Whether angles (n,), rad as they are named, at depths (n,), m, are likelier of another unit.

    Examples
    --------
    >>> md, r = np.arange(0.0, 1500.0, 30.0), np.random.default_rng(1)
    >>> inclination = np.radians(np.interp(md, [0, 300, 1200], [1.0, 1.0, 60.0]) + 0.1 * r.normal(size=50))
    >>> azimuth = np.radians(200.0 + 0.5 * r.normal(size=50))
    >>> misnamed_angles(md, inclination, azimuth) is None
    True
    >>> misnamed_angles(md, np.radians(inclination), azimuth).sentence[:60]
    'inclinations reach 1.05 deg and scatter by 0.002 deg along t'
    """
    if len(md) < 5:
        return None
    i, a = np.degrees(inclination), np.degrees(wrap_positive(azimuth))
    return _in_radians(md, i, a) or _level_in_grads(i)


def _in_radians(md: Array, i: Array, a: Array) -> Named | None:
    """Both angles, inclination or azimuth: the likeliest of them."""
    steps, given = (_last_digit(i), _last_digit(a)), _scatters(md, i, a)
    as_named = _likelihood(given, steps, i)
    best: tuple[float, bool, bool] | None = None
    for of_inclination, of_azimuth in ((True, True), (True, False), (False, True)):
        ratio, factors = -as_named, (_RADIAN if of_inclination else 1.0, _RADIAN if of_azimuth else 1.0)
        # one station of few may be read as finely by chance
        if len(md) < 8 and not (of_inclination and of_azimuth):
            continue
        if of_inclination:
            if i.max() > np.pi + 1e-3 or np.ptp(i) < 1e-3:
                continue
            ratio -= float(np.log(_VERTICAL_HOLES))
        if of_azimuth:
            if a.max() > 2.0 * np.pi + 1e-3 or np.ptp(a) < 1e-3:
                continue
            # a steady azimuth lies within 6.3 deg of north, east of it, once in 57 times
            ratio += float(np.log(360.0 / (2.0 * np.pi)))
        changed_i, changed_a = factors[0] * i, factors[1] * a
        residual = smoothness(md, directions(np.radians(changed_i), np.radians(changed_a))).residual
        if np.nansum(residual > JUMP) > 0.1 * len(md):
            continue
        scaled = steps[0] * factors[0], steps[1] * factors[1]
        ratio += _likelihood(_scatters(md, changed_i, changed_a), scaled, changed_i)
        # both at once are refused, one is warned of
        enough = np.log(1e4 if of_inclination and of_azimuth else 1e3)
        if ratio > max(enough, best[0] if best is not None else enough):
            best = ratio, of_inclination, of_azimuth
    if best is None:
        return None
    ratio, of_inclination, of_azimuth = best
    if of_inclination and of_azimuth:
        sentence = (
            f"the largest inclination is {i.max():.3g} and the largest azimuth {a.max():.3g}, with "
            f"angles in radians this is a smooth hole (likelihood ratio {power(ratio)}): name the unit in the "
            "columns, as inclination_rad and azimuth_rad"
        )
        return Named(sentence, refused=True)
    if of_inclination:
        sentence = (
            f"inclinations reach {i.max():.3g} deg and scatter by {given.along:.1g} deg along the hole, azimuths by "
            f"{given.across:.1g} deg across it; with inclination in radians this is a usual hole (likelihood ratio "
            f"{power(ratio)}): name the unit in the column, as inclination_rad"
        )
        return Named(sentence, refused=False)
    sentence = (
        f"all azimuths lie between 0 and {a.max():.3g} deg and scatter by {given.across:.1g} deg across the hole, "
        f"inclinations by {given.along:.1g} deg; with azimuth in radians this is a usual hole (likelihood ratio "
        f"{power(ratio)}): name the unit in the column, as azimuth_rad"
    )
    return Named(sentence, refused=False)


def _level_in_grads(i: Array) -> Named | None:
    """A hole that comes from above and stays about 100, not 90, deg."""
    level = i[i > 94.0]
    if len(level) < max(8, 0.2 * len(i)) or i[0] > 60.0 or i.max() > 107.0 or np.std(level) > 2.5:
        return None
    if (np.abs(i - 90.0) < 3.0)[np.argmax(i > 94.0) :].any():
        return None
    middle = float(np.median(level))

    def density(factor: float) -> float:
        return sum(
            share * float(np.exp(-0.5 * ((middle * factor - mean) / sd) ** 2)) / sd for share, mean, sd in _LEVEL
        )

    ratio = float(np.log(0.9 * density(0.9) / density(1.0)))
    if ratio < np.log(30.0):
        return None
    sentence = (
        f"{len(level)} stations lie at an inclination of {middle:.1f} deg: perhaps a level hole in grads (likelihood "
        f"ratio {power(ratio)}); name the unit in the columns, as inclination_gon and azimuth_gon"
    )
    return Named(sentence, refused=False)


def scatter_likelihood(along: float, across: float) -> float:
    """Logarithm of the density of scatters along and across the hole, deg, of readings that were measured."""
    return sum(-0.5 * ((float(np.log(size)) - at) / sd) ** 2 for size, (at, sd) in ((along, _ALONG), (across, _ACROSS)))


class _Scatters(NamedTuple):
    """Of readings about the line of their neighbours, deg: along the hole, across it, and of azimuths themselves."""

    along: float
    across: float
    azimuth: float


def _scatters(md: Array, inclination: Array, azimuth: Array) -> _Scatters:
    """At courses of 20 m or more where they are many: what smooths a log smooths metres."""
    turned = np.degrees(np.unwrap(np.radians(azimuth)))
    rows = [0]
    for k in range(1, len(md)):
        if md[k] - md[rows[-1]] >= 20.0:
            rows.append(k)
    if len(rows) >= 12:
        md, inclination, turned = md[rows], inclination[rows], turned[rows]
    sine = np.sin(np.radians(inclination))
    return _Scatters(scatter(inclination, md), scatter(turned, md, sine), scatter(turned, md))


def _last_digit(values: Array) -> float:
    """Step of the last digit, deg; 1e-5 where there are more."""
    for step in 10.0 ** -np.arange(5):
        if (np.abs(values / step - np.round(values / step)) < 1e-5).all():
            return float(step)
    return 1e-5


def _likelihood(seen: _Scatters, steps: tuple[float, float], inclination: Array) -> float:
    """Logarithm of the likelihood of scatters, of readings in degrees with steps of the last digit."""
    put_down = _PUT_DOWN[0 if np.median(inclination) < _VERTICAL else 1]
    # half a step about the neighbours is rounding
    hidden = seen.along < 0.5 * steps[0], seen.azimuth < 0.5 * steps[1]
    sine = max(float(np.sin(np.radians(np.median(inclination)))), 1e-4)
    along = _density(max(seen.along, 0.5 * steps[0]), _ALONG, hidden=hidden[0])
    across = _density(0.5 * steps[1] * sine if hidden[1] else seen.across, _ACROSS, hidden=hidden[1])
    planned = float(all(hidden))
    measured = 1.0 - _PLANNED - _SMOOTHED - put_down
    total = (
        measured * along[0] * across[0]
        + put_down * along[0] * across[1]
        + _SMOOTHED * along[1] * across[1]
        + _PLANNED * planned
    )
    return float(np.log(max(total, 1e-300)))


def _density(size: float, measured: tuple[float, float], *, hidden: bool) -> tuple[float, float]:
    """Of a scatter, deg, for a factor of e, as measured and as smoothed; the share below it where it is hidden."""
    at, (mean, sd) = float(np.log(max(size, 1e-6))), measured
    low, high = _SPAN
    z = (at - mean) / sd
    if hidden:
        return 0.5 * (1.0 + erf(z / np.sqrt(2.0))), float(np.clip((at - low) / (high - low), 1e-3, 1.0))
    smoothed = 1.0 / (high - low) if low <= at <= high else 0.0
    # a tool that is worse than others, or a rough hole, is nothing rare
    tail = 1e-3 if z > 0.0 else 1e-5
    return float(np.exp(-0.5 * z * z) / (sd * np.sqrt(2.0 * np.pi))) + tail, smoothed
