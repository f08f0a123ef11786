"""Points of a path between and beyond its stations: interpolation on the arc, projection to the bit, tie-on."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.angles import wrap_positive
from inclinometry.core.arrays import Array, Index, Mask, finite
from inclinometry.core.errors import InputError
from inclinometry.survey._arc import weights
from inclinometry.survey.path import Path, checked_stations, directions, minimum_curvature

LEVEL: Final = 1e-15
"""Sine of an inclination that is rounding alone: the azimuth of an interpolated direction is then undefined."""


class Points(NamedTuple):
    """Points of a path, each (m,): depth, m; angles, rad; position, m."""

    md: Array
    inclination: Array
    azimuth: Array
    north: Array
    east: Array
    tvd: Array


def interpolate(path: Path, md: ArrayLike) -> Points:
    """Position and direction on the arcs of a path.

    Parameters
    ----------
    path : Path
    md : (m,) array_like
        Measured depths within the path, m, in any order.

    Returns
    -------
    Points
        At a station exactly what the path has there. Between stations of which one is vertical the azimuth is that of
        the arc, whatever is written at the vertical station; where the hole is vertical between stations it is the
        azimuth of the station above.

    Raises
    ------
    InputError
        Naming the element, when a depth is not finite or outside the path.

    Notes
    -----
    With phi = f - 1/2 at the fraction f of an interval of length s and dogleg beta, p = t1 + t2 and q = t2 - t1,

        t = cos(phi beta) / (2 cos(beta/2)) p + sin(phi beta) / (2 sin(beta/2)) q
        r = r1 + s sin(f beta/2) / (beta/2) [cos((1-f) beta/2) / (2 cos(beta/2)) p
                                             - sin((1-f) beta/2) / (2 sin(beta/2)) q].

    This is the great circle through t1 and t2 and its integral, written about the middle of the arc, where neither
    a small nor a large dogleg loses digits.

    Examples
    --------
    >>> path = minimum_curvature([0.0, 500.0 * np.pi], [0.0, np.pi / 2], [np.pi / 2, np.pi / 2])
    >>> half = interpolate(path, 250.0 * np.pi)
    >>> float(np.degrees(half.inclination[0]).round(9)), float(half.east[0].round(6)), float(half.tvd[0].round(6))
    (45.0, 292.893219, 707.106781)
    """
    depth = _depths(md)
    low, high = path.md[0], path.md[-1]
    _refuse((depth < low) | (depth > high), depth, f"{low:.10g} to {high:.10g} m; project the path to go beyond it")
    above, f = interval(path, depth)
    found = _on_arc(path, depth, above, f)
    station = np.where(depth == high, len(path) - 1, above)
    hit = path.md[station] == depth
    return Points(*(np.where(hit, getattr(path, name)[station], getattr(found, name)) for name in Points._fields))


def project_curve(path: Path, md: ArrayLike) -> Points:
    """Points below the last station on the circle of the last interval, e.g. at the bit.

    Parameters
    ----------
    path : Path
    md : (m,) array_like
        Measured depths from the last station on, m.

    Raises
    ------
    InputError
        Naming the element, when a depth is not finite or above the last station.

    Notes
    -----
    The curvature of the last interval is taken as it is, with the noise of its two stations; over the usual 10 to 20 m
    to the bit that is a fraction of their uncertainty, further on it grows with the square of the distance.

    Examples
    --------
    >>> path = minimum_curvature([0.0, 30.0], np.radians([40.0, 43.0]), [0.0, 0.0])
    >>> np.degrees(project_curve(path, [40.0, 60.0]).inclination).round(9)
    array([44., 46.])
    """
    depth = _beyond(path, md)
    return _on_arc(path, depth, *interval(path, depth))


def project_straight(path: Path, md: ArrayLike) -> Points:
    """Points below the last station straight on in its direction, e.g. at the bit.

    Parameters
    ----------
    path : Path
    md : (m,) array_like
        Measured depths from the last station on, m.

    Raises
    ------
    InputError
        Naming the element, when a depth is not finite or above the last station.

    Examples
    --------
    >>> path = minimum_curvature([0.0, 30.0], [0.0, 0.0], [0.0, 0.0])
    >>> project_straight(path, 45.0).tvd
    array([45.])
    """
    depth = _beyond(path, md)
    ahead = (depth - path.md[-1])[:, None] * directions(path.inclination[-1], path.azimuth[-1])
    north, east, tvd = (np.array([path.north[-1], path.east[-1], path.tvd[-1]]) + ahead).T
    same = np.ones_like(depth)
    return Points(depth, path.inclination[-1] * same, path.azimuth[-1] * same, north, east, tvd)


def tie_on(path: Path, at: float, md: ArrayLike, inclination: ArrayLike, azimuth: ArrayLike) -> Path:
    """Path of stations that carry on from another path at a depth, as a side-track does.

    Parameters
    ----------
    path : Path
    at : float
        Depth at which the stations tie on, m, within `path`.
    md, inclination, azimuth : (n,) array_like
        Stations below it, m and rad; azimuth from the same north as in `path`.

    Returns
    -------
    Path
        n + 1 stations; the first is the point of `path` at that depth.

    Raises
    ------
    InputError
        As for `interpolate` and `minimum_curvature`; when the first station is not below the tie-on.

    Examples
    --------
    >>> mother = minimum_curvature([0.0, 100.0], [0.0, 0.0], [0.0, 0.0])
    >>> tie_on(mother, 50.0, [60.0, 70.0], [0.0, 0.0], [0.0, 0.0]).tvd
    array([50., 60., 70.])
    """
    first = interpolate(path, [at])
    # checked by themselves, so that a message names the caller's row
    depth, slope, direction = checked_stations(md, inclination, azimuth, 1)
    if depth[0] <= at:
        raise InputError(f"md[0] is {depth[0]:.10g} m, not below the tie-on at {at:.10g} m; leave such stations out")
    return minimum_curvature(
        np.concatenate([first.md, depth]),
        np.concatenate([first.inclination, slope]),
        np.concatenate([first.azimuth, direction]),
        start=[first.north[0], first.east[0], first.tvd[0]],
    )


def interval(path: Path, depth: Array) -> tuple[Index, Array]:
    """Index of the station above each depth and the fraction of the interval below it; beyond the end above 1."""
    above = np.clip(np.searchsorted(path.md, depth, side="right") - 1, 0, len(path) - 2)
    return above, (depth - path.md[above]) / (path.md[above + 1] - path.md[above])


def _on_arc(path: Path, depth: Array, k: Index, f: Array) -> Points:
    """Points at the fractions f of the intervals k."""
    if len(path) < len(k):  # each station serves many points
        every = directions(path.inclination, path.azimuth)
        t1, t2 = every[k], every[k + 1]
    else:
        t1, t2 = (directions(path.inclination[i], path.azimuth[i]) for i in (k, k + 1))
    w = weights(f, path.dogleg[k], slopes=False)
    # by components: rows of three are slow to work on
    p, q = (t1 + t2).T, (t2 - t1).T
    n, e, v = w.t_p.value * p + w.t_q.value * q
    away = (path.md[k + 1] - path.md[k]) * (w.r_p.value * p + w.r_q.value * q)
    level = np.hypot(n, e)
    azimuth = np.where(level > LEVEL, wrap_positive(np.arctan2(e, n)), path.azimuth[k])
    north, east, tvd = (getattr(path, name)[k] + part for name, part in zip(Points._fields[3:], away, strict=True))
    return Points(depth, np.arctan2(level, v), azimuth, north, east, tvd)


def _depths(md: ArrayLike) -> Array:
    """Depths as a column of their own."""
    depth = np.atleast_1d(finite(md, "md"))
    if depth.ndim != 1:
        raise InputError(f"md has shape {depth.shape}; expected (m,)")
    return np.array(depth)


def _beyond(path: Path, md: ArrayLike) -> Array:
    """Depths at or below the last station."""
    depth, last = _depths(md), path.md[-1]
    _refuse(depth < last, depth, f"{last:.10g} m (the last station) and more; interpolate above it")
    return depth


def _refuse(bad: Mask, depth: Array, allowed: str) -> None:
    """Raise for the first bad depth."""
    if bad.any():
        at = int(np.argmax(bad))
        raise InputError(f"md[{at}] is {depth[at]:.10g} m; allowed {allowed}")
