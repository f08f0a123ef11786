"""Path of a well through its stations by minimum curvature: position, dogleg, tortuosity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.angles import TAU, wrap_positive
from inclinometry.core.arrays import Array, finite, frozen, within
from inclinometry.core.errors import InputError

REVERSAL: Final = 2e-6
"""How near half a turn a dogleg may come, rad: the plane of its arc is then known to a ten-billionth."""


@dataclass(frozen=True, eq=False)
class Path:
    """A well through n stations; between two of them it is an arc of a circle.

    md : (n,) measured depth, m, increasing.
    inclination, azimuth : (n,) rad, azimuth in [0, 2 pi) from the north it was given from.
    north, east, tvd : (n,) position, m, from the same north; tvd is positive down.
    dogleg : (n - 1,) angle between the directions at the two ends of each interval, rad, 0 to pi.
    severity : (n - 1,) dogleg severity, the curvature of each interval, rad/m.
    """

    md: Array
    inclination: Array
    azimuth: Array
    north: Array
    east: Array
    tvd: Array
    dogleg: Array
    severity: Array

    def __len__(self) -> int:
        return len(self.md)


class Tortuosity(NamedTuple):
    """How crooked a path is between its first station and each of its n stations.

    cumulative : (n,) sum of the doglegs, rad; noise of the angles adds to it at every station.
    net : (n,) angle between the direction at the first station and here, rad, 0 to pi.
    excess : (n,) cumulative less net, rad: the bending that was undone again.
    rate : (n,) cumulative per length, rad/m; 0 at the first station.
    """

    cumulative: Array
    net: Array
    excess: Array
    rate: Array


def minimum_curvature(
    md: ArrayLike, inclination: ArrayLike, azimuth: ArrayLike, *, start: ArrayLike = (0.0, 0.0, 0.0)
) -> Path:
    """Positions of stations by minimum curvature.

    Parameters
    ----------
    md : (n,) array_like
        Measured depth, m, increasing; at least two stations.
    inclination, azimuth : (n,) array_like
        rad; inclination 0 (down) to pi, azimuth -4 pi to 4 pi from any one north.
    start : (3,) array_like
        North, east and true vertical depth of the first station, m: the tie-on position.

    Returns
    -------
    Path
        Frozen; positions are from the azimuth's north.

    Raises
    ------
    InputError
        Naming the row: a value that is not finite or out of range, depth that does not increase, a dogleg of half a
        turn (the plane of the arc is then anybody's guess); fewer than two stations.

    Notes
    -----
    With the unit vectors t along the hole at both ends of an interval of length s and dogleg beta,

        tan(beta/2) = |t2 - t1| / |t2 + t1|        dr = s/2 (t1 + t2) tan(beta/2) / (beta/2).

    The ratio factor is formed from the chord and an arctangent of it and loses no digit however small the dogleg. The
    sum carries its rounding along: 1e6 stations of a 10 km well stay within 1e-12 m of extended precision.

    References
    ----------
    S. J. Sawaryn and J. L. Thorogood, A compendium of directional calculations based on the minimum curvature method,
    SPE Drilling & Completion 20 (2005) 24-36 (SPE 84246).

    Examples
    --------
    A quarter of a circle of 1000 m radius toward the east:

    >>> path = minimum_curvature([0.0, 500.0 * np.pi], [0.0, np.pi / 2], [np.pi / 2, np.pi / 2])
    >>> [float(x[-1].round(9)) + 0.0 for x in (path.north, path.east, path.tvd)]
    [0.0, 1000.0, 1000.0]
    """
    depth, slope, direction = checked_stations(md, inclination, azimuth)
    origin = finite(start, "start")
    if origin.shape != (3,):
        raise InputError(f"start has shape {origin.shape}; expected (3,): north, east and true vertical depth, m")
    from inclinometry.survey import _kernels  # numba is loaded by those who need it

    size = len(depth)
    north, east, tvd = np.empty(size), np.empty(size), np.empty(size)
    dogleg, severity = np.empty(size - 1), np.empty(size - 1)
    _kernels.minimum_curvature(
        depth, slope, direction, np.ascontiguousarray(origin), north, east, tvd, dogleg, severity
    )
    if dogleg.max() > np.pi - REVERSAL:
        row = int(np.argmax(dogleg > np.pi - REVERSAL))
        raise InputError(
            f"the hole turns by {np.degrees(dogleg[row]):.6f} deg between rows {row} and {row + 1} "
            f"(md {depth[row]:.10g} and {depth[row + 1]:.10g} m); no arc can be chosen for half a turn. "
            "Correct or remove one of the two stations"
        )
    for values in (depth, slope, direction, north, east, tvd, dogleg, severity):
        values.flags.writeable = False
    return Path(depth, slope, direction, north, east, tvd, dogleg, severity)


def checked_stations(
    md: ArrayLike, inclination: ArrayLike, azimuth: ArrayLike, least: int = 2
) -> tuple[Array, Array, Array]:
    """Own copies of the three columns, checked as for `minimum_curvature`; rows in messages count from 0."""
    depth, slope = finite(md, "md"), within(inclination, "inclination", 0.0, np.pi, "rad")
    # anything that turns more than that was given in degrees
    direction = within(azimuth, "azimuth", -2.0 * TAU, 2.0 * TAU, "rad")
    if depth.ndim != 1 or slope.shape != depth.shape or direction.shape != depth.shape:
        raise InputError(
            f"md {depth.shape}, inclination {slope.shape} and azimuth {direction.shape} must be columns of one length"
        )
    if len(depth) < least:
        raise InputError(f"{len(depth)} station(s) given; needed are at least {least}")
    step = np.diff(depth)
    if step.min(initial=1.0) <= 0.0:
        row = int(np.argmax(step <= 0.0)) + 1
        what = "is the same as" if step[row - 1] == 0.0 else "lies above"
        raise InputError(
            f"md[{row}] = {depth[row]:.10g} m {what} md[{row - 1}] = {depth[row - 1]:.10g} m; measured depth must "
            "increase from row to row. Remove the repeated station or put the rows in order"
        )
    if direction.min() < 0.0 or direction.max() >= TAU:
        direction = wrap_positive(direction)
    return frozen(depth), frozen(slope), frozen(direction)


def dogleg_severity_deg(path: Path, length_m: float = 30.0) -> Array:
    """Dogleg severity (n,) in degrees per `length_m`, of the interval above each station; 0 at the first.

    Parameters
    ----------
    path : Path
    length_m : float
        30 m, or 30.48 m for degrees per 100 ft.

    Raises
    ------
    InputError
        When `length_m` is not positive.

    Examples
    --------
    >>> path = minimum_curvature([0.0, 30.0, 60.0], np.radians([0.0, 3.0, 3.0]), [0.0, 0.0, 0.0])
    >>> dogleg_severity_deg(path).round(9)
    array([0., 3., 0.])
    """
    if not (np.isfinite(length_m) and length_m > 0.0):
        raise InputError(f"length_m is {length_m}; it must be positive, e.g. 30")
    return np.concatenate([[0.0], np.degrees(path.severity) * length_m])


def tortuosity(path: Path) -> Tortuosity:
    """Bending along a path, and how much of it led nowhere.

    Notes
    -----
    The sum of doglegs grows with the number of stations even in a straight hole, by about 1.25 times the standard
    uncertainty of a direction per axis and root 2 at every station: compare surveys of like spacing.

    Examples
    --------
    >>> path = minimum_curvature([0.0, 30.0, 60.0], np.radians([10.0, 12.0, 10.0]), [1.0, 1.0, 1.0])
    >>> [float(np.degrees(x[-1]).round(9)) + 0.0 for x in tortuosity(path)[:3]]
    [4.0, 0.0, 4.0]
    """
    cumulative = np.concatenate([[0.0], np.cumsum(path.dogleg)])
    t = directions(path.inclination, path.azimuth)
    net = 2.0 * np.arctan2(np.linalg.norm(t - t[0], axis=1), np.linalg.norm(t + t[0], axis=1))
    length = path.md - path.md[0]
    rate = cumulative / np.where(length > 0.0, length, 1.0)
    # rounding must not make the shortest way longer than the way taken
    return Tortuosity(cumulative, net, np.maximum(cumulative - net, 0.0), rate)


def directions(inclination: ArrayLike, azimuth: ArrayLike) -> Array:
    """Unit vectors (..., 3) along the hole, in north, east, down.

    Examples
    --------
    >>> directions(np.pi / 2, np.pi / 2).round(12)
    array([0., 1., 0.])
    """
    sine = np.sin(inclination)
    parts = np.broadcast_arrays(sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(inclination))
    return np.stack(parts, axis=-1)
