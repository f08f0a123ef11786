"""The same place surveyed more than once: rotation shots, a station repeated, one depth from two measurements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.attitude.orientation import angles, angles_jacobian
from inclinometry.core.angles import wrap_signed
from inclinometry.core.arrays import Array, Index, Mask, finite, within
from inclinometry.core.errors import InputError
from inclinometry.survey.checks import ROUNDING, Check
from inclinometry.survey.multistation import STEEP, invariants, invariants_jacobian, toolface_gap
from inclinometry.survey.quality_words import QUANTITIES, Quantity, figure
from inclinometry.survey.stations import Stations

SPREAD: Final = float(np.pi)
"""Largest gap between toolfaces with which rotation shots still go round."""

FAINT: Final = 0.1
"""Share of a quantity's response to the whole triad that the transverse sensors must have to be judged by it."""

_SHOTS: Final = 3
_ANGLES: Final = (
    Quantity("inclination", "rad", "deg", 180.0 / np.pi, 3),
    Quantity("azimuth", "rad", "deg", 180.0 / np.pi, 3),
)
_ALL: Final = (*_ANGLES, *QUANTITIES)
_WRAPPED: Final = 1  # the column of azimuth


class _Rows(NamedTuple):
    """Inclination, azimuth, |g|, |b|, dip (n, 5) and their derivatives (n, 5, 6) by the channels."""

    values: Array
    jacobian: Array
    steep: Mask
    faint: Mask  # (n, 5)


def rotation_shots(shots: Stations, *, k: float = 3.0) -> list[Check]:
    """Whether stations at one place and different toolfaces agree.

    Parameters
    ----------
    shots : Stations
        Of one tool at rest at one depth, turned between the shots; md only numbers them.
    k : float
        Standard deviations allowed.

    Returns
    -------
    list of Check
        Inclination, azimuth, |g|, |b|, dip: the largest departure from the mean of the shots against k standard
        deviations of that departure, in which errors that do not turn with the tool cancel. "not judged": fewer than 3
        shots, toolfaces that leave a gap of more than 180 deg, azimuth below 5 deg of inclination, and quantities to
        which the transverse sensors hardly contribute here (|g| near the vertical, |b| along the field).

    Raises
    ------
    InputError
        k out of range; gravity and magnetic field parallel.

    Examples
    --------
    >>> from inclinometry.attitude.orientation import fields
    >>> g, b = fields(0.5, 0.8, np.radians([0.0, 90.0, 180.0, 270.0]), 1.2)
    >>> noise = np.diag([0.002] * 3 + [60.0] * 3) ** 2
    >>> shots = Stations(np.arange(4.0), 9.81 * g, 5e4 * b, noise=np.tile(noise, (4, 1, 1)))
    >>> [check.verdict for check in rotation_shots(shots)]
    ['pass', 'pass', 'pass', 'pass', 'pass']
    """
    k = float(within(k, "k", 1.0, 6.0))
    rows = _rows(shots)
    difference = rows.values - rows.values.mean(axis=0)
    turned = wrap_signed(rows.values[:, _WRAPPED] - rows.values[0, _WRAPPED])
    difference[:, _WRAPPED] = turned - turned.mean()
    size = len(shots)
    own = np.einsum("nqa,nab,nqb->nq", rows.jacobian, shots.noise, rows.jacobian)
    variance = own * (1.0 - 2.0 / size) + own.sum(axis=0) / size**2
    for source in shots.sources.values():
        moved = rows.jacobian @ source.by_field
        moved = moved - moved.mean(axis=0)
        variance += np.einsum("nqp,pr,nqr->nq", moved, source.covariance, moved)
    gap = toolface_gap(np.concatenate([shots.g, shots.b], axis=1))
    problem = ""
    if size < _SHOTS:
        problem = f"{size} shots, at least {_SHOTS} are needed"
    elif gap > SPREAD:
        problem = f"the toolfaces lie within {360.0 - np.degrees(gap):.0f} deg: turn the tool all round"
    why = [
        problem
        or ("the hole is too steep for an azimuth" if rows.steep.any() and column == _WRAPPED else "")
        or ("the transverse sensors hardly show in it here" if rows.faint[:, column].all() else "")
        for column in range(5)
    ]
    action = "errors turn with the tool: calibrate the transverse sensors, or run a multi-station analysis"
    where = np.arange(size)
    return [_check("rotation shots", c, difference, k * np.sqrt(variance), where, why[c], action) for c in range(5)]


def repeated_stations(
    first: Stations, second: Stations, *, same_tool: bool, k: float = 3.0, apart_m: float = 1.0
) -> list[Check]:
    """Whether stations taken again agree with the first.

    Parameters
    ----------
    first, second : Stations
        Compared at the stations of `first` that `second` has within `apart_m`.
    same_tool : bool
        Whether sources of error of one name are the same error in both: then only what the toolface changes is left.
    k : float
        Standard deviations allowed.
    apart_m : float
        How far, m, depths of a pair may differ.

    Returns
    -------
    list of Check
        Inclination, azimuth, |g|, |b|, dip; rows of `first`. "not judged" where there is no pair, for azimuth where no
        pair is inclined by 5 deg, and where nothing is known of the uncertainty.

    Raises
    ------
    InputError
        k or apart_m out of range.

    Examples
    --------
    >>> from inclinometry.attitude.orientation import fields
    >>> g, b = fields(0.5, 0.8, np.radians([0.0, 90.0]), 1.2)
    >>> noise = np.diag([0.002] * 3 + [60.0] * 3)[None] ** 2
    >>> one, two = (Stations([100.0], 9.81 * g[[i]], 5e4 * b[[i]], noise=noise) for i in range(2))
    >>> [check.verdict for check in repeated_stations(one, two, same_tool=True)]
    ['pass', 'pass', 'pass', 'pass', 'pass']
    """
    k = float(within(k, "k", 1.0, 6.0))
    here, there = _pairs(first.md, second.md, float(within(apart_m, "apart_m", 0.0, 100.0, "m")))
    if not len(here):
        reason = f"no station of the second run lies within {apart_m:g} m of one of the first"
        return [Check(f"repeat: {q.name}", "not judged", np.nan, np.nan, (), reason, unit=q.unit) for q in _ALL]
    one, two = _rows(first), _rows(second)
    difference = two.values[there] - one.values[here]
    difference[:, _WRAPPED] = wrap_signed(difference[:, _WRAPPED])
    variance = sum(
        np.einsum("nqa,nab,nqb->nq", part.jacobian[rows], run.noise[rows], part.jacobian[rows])
        for part, run, rows in ((one, first, here), (two, second, there))
    ) + _shared(one.jacobian[here], two.jacobian[there], first, second, (here, there), same_tool)
    steep = one.steep[here]
    difference[steep, _WRAPPED] = np.nan
    action = "repeat once more at rest; if the runs still differ, check depth, calibration and interference of both"
    why = ["" if c != _WRAPPED or not steep.all() else "the hole is too steep for an azimuth" for c in range(5)]
    return [_check("repeat", c, difference, k * np.sqrt(variance), here, why[c], action) for c in range(5)]


def dual_depth(
    first_m: ArrayLike, second_m: ArrayLike, first_sigma_m: ArrayLike, second_sigma_m: ArrayLike, *, k: float = 3.0
) -> Check:
    """Whether two measurements of depth, e.g. drill pipe and wireline, agree.

    Parameters
    ----------
    first_m, second_m : (n,) array_like
        Depths of the same points, m.
    first_sigma_m, second_sigma_m : (n,) array_like
        Their standard deviations, m, corrections made.
    k : float
        Standard deviations allowed.

    Returns
    -------
    Check
        Difference against k sqrt(s1^2 + s2^2); "not judged" without any uncertainty.

    Raises
    ------
    InputError
        Shapes that differ, negative standard deviations.

    References
    ----------
    Brooks et al., Quantification of depth accuracy, SPE 133417 (2010): tolerance by root sum of squares.

    Examples
    --------
    Drill pipe 1.4 m and wireline 3.4 m at three standard deviations:

    >>> check = dual_depth([1000.0], [1011.0], [1.4 / 3], [3.4 / 3])
    >>> check.verdict, round(check.limit, 1)
    ('fail', 3.7)
    """
    k = float(within(k, "k", 1.0, 6.0))
    one, two = finite(first_m, "first_m", (None,)), finite(second_m, "second_m", (None,))
    sigmas = [
        within(s, name, 0.0, 1e3, "m") for s, name in ((first_sigma_m, "first sigma"), (second_sigma_m, "second sigma"))
    ]
    if one.shape != two.shape or not one.size or any(s.shape not in ((), one.shape) for s in sigmas):
        raise InputError(f"depths are {one.shape} and {two.shape}, sigmas {[s.shape for s in sigmas]}; give n of each")
    limit = np.broadcast_to(k * np.hypot(*sigmas), one.shape)
    name, difference = "dual depth", two - one
    if not limit.all():
        return Check(name, "not judged", np.nan, np.nan, (), "no uncertainty is known of the depths", unit="m")
    row, failed = int(np.argmax(np.abs(difference) / limit)), np.flatnonzero(np.abs(difference) > limit + 1e-9)
    reason = (
        f"{len(failed)} of {len(one)} depths off; worst {difference[row]:+.2f} m at {one[row]:.1f} m, "
        f"allowed +-{limit[row]:.2f}"
    )
    value, allowed = float(abs(difference[row])), float(limit[row])
    if not len(failed):
        return Check(name, "pass", value, allowed, (), reason, unit="m")
    action = "check the pipe tally and both stretch and temperature corrections; measure the depth again"
    return Check(name, "fail", value, allowed, tuple(map(int, failed)), reason, action, "m")


def _rows(stations: Stations) -> _Rows:
    readings = np.concatenate([stations.g, stations.b], axis=1)
    found = angles(stations.g, stations.b)
    values = np.column_stack([found.inclination, found.azimuth, invariants(readings)])
    turned = angles_jacobian(stations.g, stations.b)[:, :2]
    jacobian = np.concatenate([turned, invariants_jacobian(readings)], axis=1)
    steep = np.sin(found.inclination) < np.sin(STEEP)
    jacobian[steep, _WRAPPED] = 0.0
    faint = np.zeros((len(readings), 5), dtype=bool)
    for column, first in ((2, 0), (3, 3)):
        faint[:, column] = np.hypot(jacobian[:, column, first], jacobian[:, column, first + 1]) < FAINT
    return _Rows(values, jacobian, steep, faint)


def _pairs(first: Array, second: Array, apart: float) -> tuple[Index, Index]:
    """Rows of both runs that belong together."""
    after = np.clip(np.searchsorted(second, first), 0, len(second) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(second[before] - first) <= np.abs(second[after] - first), before, after)
    here = np.flatnonzero(np.abs(second[nearest] - first) <= apart + 1e-9)
    return here, nearest[here]


def _shared(
    one: Array, two: Array, first: Stations, second: Stations, rows: tuple[Index, Index], same_tool: bool
) -> Array:
    """Variance (n, 5) of the differences from what the stations of a run share."""
    total = np.zeros(one.shape[:2])
    parts: dict[str, Sequence[tuple[Array, Array]]] = {}
    for jacobian, run, where, sign in ((one, first, rows[0], -1.0), (two, second, rows[1], 1.0)):
        for name, source in run.sources.items():
            parts[name] = (*parts.get(name, ()), (sign * (jacobian @ source.by_field[where]), source.covariance))
    for moved in parts.values():
        if same_tool and len(moved) == 2 and moved[0][1].shape == moved[1][1].shape:
            moved = [(moved[0][0] + moved[1][0], moved[0][1])]
        for effect, covariance in moved:
            total += np.einsum("nqp,pr,nqr->nq", effect, covariance, effect)
    return total


def _check(what: str, column: int, difference: Array, limit: Array, rows: Index, why: str, action: str) -> Check:
    """One quantity over all stations compared."""
    quantity = _ALL[column]
    name = f"{what}: {quantity.name}"
    able = np.isfinite(difference[:, column]) & (limit[:, column] > 0.0)
    if why or not able.any():
        reason = why or "nothing is known of the stations' uncertainty"
        return Check(name, "not judged", np.nan, np.nan, (), reason, unit=quantity.unit)
    share = np.where(able, np.abs(difference[:, column]) / np.where(able, limit[:, column], 1.0), -1.0)
    row = int(np.argmax(share))
    failed = rows[able & (np.abs(difference[:, column]) > limit[:, column] * (1.0 + 1e-9) + ROUNDING)]
    value, allowed = float(abs(difference[row, column])), float(limit[row, column])
    reason = (
        f"{len(failed)} of {int(able.sum())} off; worst {figure(float(difference[row, column]), quantity)} at station "
        f"{int(rows[row]) + 1}, allowed +-{allowed * quantity.factor:.{quantity.digits}f}"
    )
    if not len(failed):
        return Check(name, "pass", value, allowed, (), reason, unit=quantity.unit)
    return Check(name, "fail", value, allowed, tuple(int(r) for r in failed), reason, action, quantity.unit)
