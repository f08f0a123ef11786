"""Path of a well through its stations by minimum curvature: position, dogleg, tortuosity."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial
from typing import Any, Final, NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, Mask, finite, frozen, increasing, within
from inclinometry.errors import out_of_range, refused, wrong_shape
from inclinometry.rotations import TAU, dcm, wrap_positive, wrap_signed
from inclinometry.tabular import Column, Tabular, check_record, draw, in_degrees

# Weights of the interpolation on an arc and their derivatives by the dogleg, without cancellation at either end.
#
# All four weights are even functions of the dogleg beta. Instead of their derivative, which needs a direction of change
# that a straight interval does not have, they carry the derivative divided by beta: it has a limit at beta = 0, and
# what
# it is multiplied with, beta dbeta, is linear in the changes of the two directions.

# (cos x - sin(x)/x) / x^2 by powers of x^2; the first term left out is 3e-18
TERMS: Final = tuple((-1.0) ** k * 2 * k / factorial(2 * k + 1) for k in range(1, 8))


# an even function of the dogleg: value, and derivative divided by the dogleg
Even: TypeAlias = tuple[Array, Array]


def weights(f: Array, dogleg: Array, *, slopes: bool = True) -> tuple[Even, Even, Even, Even]:
    """Weights at the fractions f (m,) of intervals with doglegs (m,), rad; f beyond 1 continues the circle.

    t_p, t_q, r_p, r_q of the direction t = t_p p + t_q q and the displacement r = s (r_p p + r_q q), with p = t1 + t2
    and q = t2 - t1. Without `slopes` the slopes are zeros: two thirds of the work saved where only points are wanted.
    """
    phi, half, rest = f - 0.5, np.full_like(f, 0.5), 0.5 * (1.0 - f)
    cos_half, sinc_half = cosine(half, dogleg, slopes), sinc(half, dogleg, slopes)
    walked = sinc(0.5 * f, dogleg, slopes)
    return (
        _scaled(0.5, _quotient(cosine(phi, dogleg, slopes), cos_half)),
        _scaled(phi, _quotient(sinc(phi, dogleg, slopes), sinc_half)),
        _scaled(0.5 * f, _quotient(_product(walked, cosine(rest, dogleg, slopes)), cos_half)),
        _scaled(-f * rest, _quotient(_product(walked, sinc(rest, dogleg, slopes)), sinc_half)),
    )


def cosine(c: Array, dogleg: Array, slopes: bool = True) -> Even:
    """cos(c beta)."""
    x = c * dogleg
    return np.cos(x), -c * c * _sinc(x) if slopes else np.zeros_like(x)


def sinc(c: Array, dogleg: Array, slopes: bool = True) -> Even:
    """sin(c beta) / (c beta)."""
    x = c * dogleg
    return _sinc(x), c * c * bend(x) if slopes else np.zeros_like(x)


def bend(x: Array) -> Array:
    """Derivative of sin(x)/x divided by x: (cos x - sin(x)/x) / x^2, -1/3 at 0."""
    small = np.abs(x) < 0.5  # there the difference is taken from its series
    safe = np.where(small, 1.0, x)
    return np.where(small, np.polynomial.polynomial.polyval(x * x, TERMS), (np.cos(safe) - _sinc(safe)) / safe**2)


def _sinc(x: Array) -> Array:
    return np.asarray(np.sinc(x / np.pi))


def _scaled(factor: float | Array, u: Even) -> Even:
    return factor * u[0], factor * u[1]


def _product(u: Even, v: Even) -> Even:
    return u[0] * v[0], u[0] * v[1] + u[1] * v[0]


def _quotient(u: Even, v: Even) -> Even:
    ratio = u[0] / v[0]
    return ratio, (u[1] - ratio * v[1]) / v[0]


REVERSAL: Final = 2e-6
"""How near half a turn a dogleg may come, rad: the plane of its arc is then known to a ten-billionth."""


class SurveyRun(Protocol):
    """Stations of one run by depth (n,), m, and angles (n,), rad: a `survey.reduce.Survey` is one."""

    @property
    def md(self) -> Array: ...
    @property
    def inclination(self) -> Array: ...
    @property
    def azimuth(self) -> Array: ...
    @property
    def azimuth_reference(self) -> str: ...


@dataclass(frozen=True, eq=False, repr=False)
class Path(Tabular):
    """A well through n stations; between two of them it is an arc of a circle.

    md : (n,) measured depth, m. inclination, azimuth : (n,) rad, azimuth in [0, 2 pi) from the north it was given from.
    north, east, tvd : (n,) position, m, from the same north; tvd is positive down. severity : (n - 1,) curvature,
    rad/m. dogleg : (n - 1,) angle between the directions at the two ends of each interval, rad, 0 to pi.
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

    def to_dict(self) -> dict[str, Column]:
        """One row a station: depth, direction, position and the severity of the dogleg above it."""
        found: dict[str, Column] = {"md_m": self.md, **in_degrees(self, "inclination", "azimuth")}
        found |= {"tvd_m": self.tvd, "north_m": self.north, "east_m": self.east}
        return found | {"dls_deg_30m": dogleg_severity_deg(self)}

    def plot(self, ax: Any = None) -> Any:
        """Plan view on matplotlib axes, or the path in space on three-dimensional ones; the axes are returned."""
        if getattr(ax, "name", "") == "3d":
            ax.plot(self.east, self.north, self.tvd)
            ax.set(xlabel="east, m", ylabel="north, m", zlabel="true vertical depth, m")
            ax.invert_zaxis()
            return ax
        ax = draw(ax, {"": (self.east, self.north)}, "east, m", "north, m")
        ax.set_aspect("equal", adjustable="datalim")
        return ax


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


WORTH_LOADING: Final = 20_000
"""Stations below which numpy is done sooner than the compiled loop is loaded; a test holds the two together."""


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
        turn (the plane of the arc is then undefined); fewer than two stations.

    Notes
    -----
    With the unit vectors t along the hole at both ends of an interval of length s and dogleg beta,

        tan(beta/2) = |t2 - t1| / |t2 + t1|        dr = s/2 (t1 + t2) tan(beta/2) / (beta/2).

    The ratio factor is formed from the chord and an arctangent of it and loses no digit however small the dogleg. The
    sum of many stations carries its rounding along: 1e6 stations of a 10 km well stay within 1e-12 m of extended
    precision.

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
        raise wrong_shape("start", origin.shape, "(3,)")
    size = len(depth)
    north, east, tvd = np.empty(size), np.empty(size), np.empty(size)
    dogleg, severity = np.empty(size - 1), np.empty(size - 1)
    if size < WORTH_LOADING or not _compiled():
        t = directions(slope, direction)
        p, q = t[:-1] + t[1:], t[1:] - t[:-1]
        sine, chord = np.linalg.norm(q, axis=1), np.linalg.norm(p, axis=1)
        half = np.arctan2(sine, chord)
        length = np.diff(depth)
        # tan(half) / half; an interval that is straight has the limit 1, which the division cannot find
        straight = sine == 0.0
        scale = 0.5 * length * np.where(straight, 1.0, sine) / np.where(straight, 1.0, chord * half)
        dogleg[:], severity[:] = 2.0 * half, 2.0 * half / length
        for k, (column, step) in enumerate(zip((north, east, tvd), (scale[:, None] * p).T, strict=True)):
            column[0], column[1:] = origin[k], origin[k] + np.cumsum(step)
    else:
        from inclinometry.survey import _kernels

        _kernels.minimum_curvature(
            depth, slope, direction, np.ascontiguousarray(origin), north, east, tvd, dogleg, severity
        )
    if dogleg.max() > np.pi - REVERSAL:
        row = int(np.argmax(dogleg > np.pi - REVERSAL))
        ends = {"md_m": float(depth[row]), "next_m": float(depth[row + 1])}
        raise refused("survey-half-turn", {"turn_deg": float(np.degrees(dogleg[row])), **ends})
    for values in (depth, slope, direction, north, east, tvd, dogleg, severity):
        values.flags.writeable = False
    return Path(depth, slope, direction, north, east, tvd, dogleg, severity)


def _compiled() -> bool:
    """Whether there is a compiled loop; without numba numpy is far quicker, and right to 1e-9 m for 1e6 stations."""
    from inclinometry.compiled import COMPILED  # numba is loaded by those who need it

    return COMPILED


def checked_stations(
    md: ArrayLike, inclination: ArrayLike, azimuth: ArrayLike, least: int = 2
) -> tuple[Array, Array, Array]:
    """Own copies of the three columns, checked as for `minimum_curvature`."""
    depth, slope = finite(md, "md"), within(inclination, "inclination", 0.0, np.pi, "rad")
    # anything that turns more than that was given in degrees
    direction = within(azimuth, "azimuth", -2.0 * TAU, 2.0 * TAU, "rad")
    if depth.ndim != 1:
        raise wrong_shape("md", depth.shape, "(n,)")
    for name, column in (("inclination", slope), ("azimuth", direction)):
        if column.shape != depth.shape:
            raise wrong_shape(name, column.shape, str(depth.shape))
    if len(depth) < least:
        raise refused("input-few", {"name": "stations", "count": len(depth), "least": least})
    increasing(depth, "md")
    if direction.min() < 0.0 or direction.max() >= TAU:
        direction = wrap_positive(direction)
    return frozen(depth), frozen(slope), frozen(direction)


def dogleg_severity_deg(path: Path, length_m: float = 30.0) -> Array:
    """Dogleg severity (n,), deg per `length_m` (30.48: 100 ft), of the interval above each station; 0 at the first."""
    if not (np.isfinite(length_m) and length_m > 0.0):
        raise out_of_range("length_m", float(length_m), "> 0")
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
    check_record(path, Path, "tortuosity")
    cumulative = np.concatenate([[0.0], np.cumsum(path.dogleg)])
    t = directions(path.inclination, path.azimuth)
    net = 2.0 * np.arctan2(np.linalg.norm(t - t[0], axis=1), np.linalg.norm(t + t[0], axis=1))
    length = path.md - path.md[0]
    rate = cumulative / np.where(length > 0.0, length, 1.0)
    # rounding must not make the shortest way longer than the way taken
    return Tortuosity(cumulative, net, np.maximum(cumulative - net, 0.0), rate)


def through_positions(positions: Array, resolution: float) -> tuple[Array, Array, Array]:
    """Lengths (n - 1,) of the arcs through positions (n, 3) north, east, down, m; inclination, azimuth (n,), rad.

    t1 + t2 = 2 cos(beta/2) c with the chord's direction c gives every direction from the first, but rounded positions
    make them swing to and fro. Least squares: that within the positions' `resolution`, m, and changes of curvature
    within 1 deg/30 m from course to course.
    """
    from scipy.linalg import solveh_banded  # loaded by those who need it

    step = np.diff(positions, axis=0)
    length = np.linalg.norm(step, axis=1)
    weight, smooth = 6.0 * (length / resolution) ** 2, (30.0 / np.radians(1.0)) ** 2
    lower = np.zeros((3, len(positions)))
    lower[0, :-1] += weight / 4.0
    lower[0, 1:] += weight / 4.0
    lower[1, :-1] += weight / 4.0
    change = np.stack([1.0 / length[:-1], -1.0 / length[:-1] - 1.0 / length[1:], 1.0 / length[1:]])
    for i in range(3):
        for j in range(i + 1):
            lower[i - j, j : len(change[0]) + j] += smooth * change[i] * change[j]
    half = np.zeros_like(length)
    for _ in range(4):  # the doglegs are small, and follow at once
        wanted = (0.5 * weight * np.cos(half) / length)[:, None] * step
        right = np.zeros_like(positions)
        right[:-1] += wanted
        right[1:] += wanted
        t = solveh_banded(lower, right, lower=True)
        t /= np.linalg.norm(t, axis=1)[:, None]
        half = np.arctan2(np.linalg.norm(t[1:] - t[:-1], axis=1), np.linalg.norm(t[1:] + t[:-1], axis=1))
    level = np.hypot(t[:, 0], t[:, 1])
    return length / np.sinc(half / np.pi), np.arctan2(level, t[:, 2]), wrap_positive(np.arctan2(t[:, 1], t[:, 0]))


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


# Points of a path between and beyond its stations: interpolation on the arc, projection to the bit, tie-on.

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
    check_record(path, Path, "interpolate")
    depth = _depths(md)
    low, high = path.md[0], path.md[-1]
    _refuse((depth < low) | (depth > high), depth, f"{low:.10g} .. {high:.10g}")
    above, f = interval(path, depth)
    found = _on_arc(path, depth, above, f)
    station = np.where(depth == high, len(path) - 1, above)
    hit = path.md[station] == depth
    return Points(*(np.where(hit, getattr(path, name)[station], getattr(found, name)) for name in Points._fields))


def project_curve(path: Path, md: ArrayLike) -> Points:
    """Points below the last station on the circle of the last interval, e.g. at the bit.

    The curvature of the last interval is taken as it is, with the noise of its two stations; over the usual 10 to 20 m
    to the bit that is a fraction of their uncertainty, further on it grows with the square of the distance.
    """
    depth = _beyond(path, md)
    return _on_arc(path, depth, *interval(path, depth))


def project_straight(path: Path, md: ArrayLike) -> Points:
    """Points below the last station straight on in its direction, e.g. at the bit."""
    depth = _beyond(path, md)
    ahead = (depth - path.md[-1])[:, None] * directions(path.inclination[-1], path.azimuth[-1])
    north, east, tvd = (np.array([path.north[-1], path.east[-1], path.tvd[-1]]) + ahead).T
    same = np.ones_like(depth)
    return Points(depth, path.inclination[-1] * same, path.azimuth[-1] * same, north, east, tvd)


def tie_on(path: Path, at: float, md: ArrayLike, inclination: ArrayLike, azimuth: ArrayLike) -> Path:
    """Path of n + 1 stations that continues another path from its point at the depth `at`, as a side-track does."""
    first = interpolate(path, [at])
    # checked by themselves, so that a message names the caller's row
    depth, slope, direction = checked_stations(md, inclination, azimuth, 1)
    if depth[0] <= at:
        raise out_of_range("md", float(depth[0]), f"> {at:.10g}")
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
    (t_p, _), (t_q, _), (r_p, _), (r_q, _) = weights(f, path.dogleg[k], slopes=False)
    # by components: rows of three are slow to work on
    p, q = (t1 + t2).T, (t2 - t1).T
    n, e, v = t_p * p + t_q * q
    away = (path.md[k + 1] - path.md[k]) * (r_p * p + r_q * q)
    level = np.hypot(n, e)
    azimuth = np.where(level > LEVEL, wrap_positive(np.arctan2(e, n)), path.azimuth[k])
    north, east, tvd = (getattr(path, name)[k] + part for name, part in zip(Points._fields[3:], away, strict=True))
    return Points(depth, np.arctan2(level, v), azimuth, north, east, tvd)


def _depths(md: ArrayLike) -> Array:
    """Depths as a column of their own."""
    depth = np.atleast_1d(finite(md, "md"))
    if depth.ndim != 1:
        raise wrong_shape("md", depth.shape, "(m,)")
    return np.array(depth)


def _beyond(path: Path, md: ArrayLike) -> Array:
    """Depths at or below the last station."""
    depth, last = _depths(md), path.md[-1]
    _refuse(depth < last, depth, f">= {last:.10g}")
    return depth


def _refuse(bad: Mask, depth: Array, allowed: str) -> None:
    """Raise for the first bad depth."""
    if bad.any():
        raise out_of_range("md", float(depth[int(np.argmax(bad))]), allowed)


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Tabular):
    """Differences of two paths at m common depths, second less first, m and rad.

    high_side, lateral, along_hole : (m,) the difference in the axes of the first path: up across the hole, to its right
    looking down hole, down along it, m. separation : (m,) distance of the two points.
    inclination, azimuth : (m,) azimuth in [-pi, pi), worth little where the hole is near vertical.
    """

    md: Array
    north: Array
    east: Array
    tvd: Array
    separation: Array
    high_side: Array
    lateral: Array
    along_hole: Array
    inclination: Array
    azimuth: Array

    def to_dict(self) -> dict[str, Column]:
        """One row a depth: the second path less the first."""
        lengths = ("md", "north", "east", "tvd", "separation", "high_side", "lateral", "along_hole")
        return {**{f"{name}_m": getattr(self, name) for name in lengths}, **in_degrees(self, "inclination", "azimuth")}

    def plot(self, ax: Any = None) -> Any:
        """Distance of the two paths by depth on matplotlib axes, which are returned."""
        return draw(ax, {"": (self.separation, self.md)}, "separation, m", "measured depth, m", down=True)


def compare_paths(first: Path, second: Path, md: ArrayLike | None = None) -> Comparison:
    """Differences of two paths at common depths.

    Parameters
    ----------
    first, second : Path
        From the same start and with azimuth from the same north; what they differ by in either comes out as a
        difference of the surveys.
    md : (m,) array_like, optional
        Depths that both paths cover, m; by default the stations of either between the ends of both.

    Raises
    ------
    InputError
        When the paths have no depth in common, or `md` goes beyond one of them.

    Examples
    --------
    >>> from inclinometry.survey.path import minimum_curvature
    >>> vertical = minimum_curvature([0.0, 100.0], [0.0, 0.0], [0.0, 0.0])
    >>> leaning = minimum_curvature([0.0, 100.0], np.radians([1.0, 1.0]), [0.0, 0.0])
    >>> found = compare_paths(vertical, leaning, [100.0])
    >>> float(found.north[0].round(4)), float(found.separation[0].round(4)), float(found.along_hole[0].round(4))
    (1.7452, 1.7453, -0.0152)
    """
    check_record(first, Path, "compare_paths")
    check_record(second, Path, "compare_paths")
    if md is None:
        low, high = max(first.md[0], second.md[0]), min(first.md[-1], second.md[-1])
        if low > high:
            ends = {"from_m": float(first.md[0]), "to_m": float(first.md[-1])}
            ends |= {"other_from_m": float(second.md[0]), "other_to_m": float(second.md[-1])}
            raise refused("survey-paths-apart", ends)
        both = np.union1d(first.md, second.md)
        md = both[(both >= low) & (both <= high)]
    one, two = interpolate(first, md), interpolate(second, md)
    apart = np.stack([two.north - one.north, two.east - one.east, two.tvd - one.tvd], axis=-1)
    high_side, lateral, along = np.einsum("mij,mj->im", dcm(one.azimuth, one.inclination, 0.0), apart)
    columns = (
        *(one.md, *apart.T, np.linalg.norm(apart, axis=1), high_side, lateral, along),
        *(two.inclination - one.inclination, wrap_signed(two.azimuth - one.azimuth)),
    )
    for values in columns:
        values.flags.writeable = False
    return Comparison(*columns)


POINT: Final = ("north", "east", "tvd", "inclination", "azimuth")
"""Rows of the derivatives: what is known of a point, m and rad."""
STATIONS: Final = (
    *("north_above", "east_above", "tvd_above"),
    *("md_above", "inclination_above", "azimuth_above", "md_below", "inclination_below", "azimuth_below"),
)
"""Columns of the derivatives: position of the station above, then depth and angles of both stations, m and rad."""


def interpolation_jacobian(path: Path, md: ArrayLike) -> Array:
    """Derivatives of `interpolate` by the stations above and below.

    Parameters
    ----------
    path : Path
    md : (m,) array_like
        Measured depths within the path, m; they are held while the depths of the stations change.

    Returns
    -------
    (m, 5, 9) ndarray
        Rows as in `POINT`, columns as in `STATIONS`. A point at a station belongs to the interval below it, at the
        last station to the one above. Where the hole is vertical at the point the row of the azimuth is NaN (its
        error is unbounded) and inclination is differentiated toward the azimuth that `interpolate` reports.

    Raises
    ------
    InputError
        As for `interpolate`.

    Notes
    -----
    With u = dt/dI, h = dt/dA / sin I of the point, dI = u.dt and dA = h.dt / sin I. The weights of the arc depend on
    the dogleg by beta dbeta = beta (e2.dt2 - e1.dt1), e1 and e2 the directions in which the arc turns at its ends;
    beta e is smooth where the interval is straight.

    Examples
    --------
    Half-way down a straight hole an inclination counts by half, and a position in full:

    >>> from inclinometry.survey.path import minimum_curvature
    >>> path = minimum_curvature([0.0, 100.0], [1.0, 1.0], [0.0, 0.0])
    >>> interpolation_jacobian(path, 50.0)[0, 3, [4, 7]], interpolation_jacobian(path, 50.0)[0, 0, 0]
    (array([0.5, 0.5]), np.float64(1.0))
    """
    check_record(path, Path, "interpolation_jacobian")
    point = interpolate(path, md)
    return _arc_jacobian(path, point.md, point.inclination, point.azimuth)


def curve_jacobian(path: Path, md: ArrayLike) -> Array:
    """Derivatives (m, 5, 9) of `project_curve`, laid out as in `interpolation_jacobian`.

    Examples
    --------
    >>> from inclinometry.survey.path import minimum_curvature
    >>> path = minimum_curvature([0.0, 30.0], [1.0, 1.1], [0.0, 0.0])
    >>> curve_jacobian(path, 60.0)[0, 3, [4, 7]].round(9)
    array([-1.,  2.])
    """
    check_record(path, Path, "curve_jacobian")
    point = project_curve(path, md)
    return _arc_jacobian(path, point.md, point.inclination, point.azimuth)


def straight_jacobian(path: Path, md: ArrayLike) -> Array:
    """Derivatives (m, 5, 9) of `project_straight`, laid out as in `interpolation_jacobian`.

    Examples
    --------
    >>> from inclinometry.survey.path import minimum_curvature
    >>> path = minimum_curvature([0.0, 30.0], [1.0, 1.1], [0.0, 0.0])
    >>> straight_jacobian(path, 60.0)[0, 3, [4, 7]]
    array([0., 1.])
    """
    check_record(path, Path, "straight_jacobian")
    point = project_straight(path, md)
    last = np.full_like(point.md, path.md[-1])
    jacobian = _arc_jacobian(path, last, point.inclination, point.azimuth)
    t, u, ah = _frame(path.inclination[-1], path.azimuth[-1])
    ahead = (point.md - path.md[-1])[:, None]
    # at the end of the arc, moving the station below along the arc moves the point back: that is -t, already there
    jacobian[:, :3, 7] += ahead * u
    jacobian[:, :3, 8] += ahead * ah
    jacobian[:, 3:] = 0.0
    jacobian[:, 3, 7] = 1.0
    jacobian[:, 4, 8] = 1.0 if np.hypot(t[0], t[1]) > LEVEL else np.nan
    return jacobian


def point_covariance(jacobian: ArrayLike, covariance: ArrayLike) -> Array:
    """Covariance of points from that of the stations they lie between.

    Parameters
    ----------
    jacobian : (m, 5, 9) array_like
        From `interpolation_jacobian`, `curve_jacobian` or `straight_jacobian`.
    covariance : (9, 9) or (m, 9, 9) array_like
        Of `STATIONS`, m and rad, of each point's own interval. Errors that the two stations share (a reference, the
        calibration, depth) belong off the diagonal: left out, a point between stations comes out too sure.

    Returns
    -------
    (m, 5, 5) ndarray
        Of `POINT`: J C J^T, first order in the errors. NaN in the row and column of an azimuth that does not exist.

    Raises
    ------
    InputError
        When the shapes do not fit, or the covariance is not finite.

    Examples
    --------
    >>> from inclinometry.survey.path import minimum_curvature
    >>> path = minimum_curvature([0.0, 100.0], [1.0, 1.0], [0.0, 0.0])
    >>> found = point_covariance(interpolation_jacobian(path, 50.0), np.diag([4.0, 0, 0, 0, 1e-4, 0, 0, 1e-4, 0]))
    >>> float(found[0, 3, 3].round(9))
    5e-05
    """
    matrix, stated = np.asarray(jacobian, dtype=np.float64), finite(covariance, "covariance", (9, 9))
    if matrix.ndim != 3 or matrix.shape[1:] != (5, 9):
        raise wrong_shape("jacobian", matrix.shape, "(m, 5, 9)")
    if stated.shape not in ((9, 9), (len(matrix), 9, 9)):
        raise wrong_shape("covariance", stated.shape, f"({len(matrix)}, 9, 9)")
    return np.asarray(matrix @ stated @ np.swapaxes(matrix, 1, 2))


def _arc_jacobian(path: Path, depth: Array, inclination: Array, azimuth: Array) -> Array:
    """Derivatives on the arcs, the last one continued."""
    k, f = interval(path, depth)
    beta, length = path.dogleg[k], path.md[k + 1] - path.md[k]
    above, below = (_frame(path.inclination[i], path.azimuth[i]) for i in (k, k + 1))
    p, q = above[0] + below[0], below[0] - above[0]
    (t_p, dt_p), (t_q, dt_q), (r_p, dr_p), (r_q, dr_q) = weights(f, beta)
    # dogleg times the unit vectors (m, 3) in which the arc turns at its upper and lower end
    half = np.full_like(beta, 0.5)
    to_p = 0.5 * beta * np.tan(0.5 * beta)
    to_q = cosine(half, beta)[0] / sinc(half, beta)[0]
    turn_above, turn_below = _combined(to_p, p, to_q, q), _combined(-to_p, p, to_q, q)
    place_by_beta, t_by_beta = _combined(dr_p, p, dr_q, q), _combined(dt_p, p, dt_q, q)
    t, away = _combined(t_p, p, t_q, q), _combined(r_p, p, r_q, q)
    by_place, by_direction = np.zeros((len(f), 3, 9)), np.zeros((len(f), 3, 9))
    by_place[:, :, :3] = np.eye(3)
    for column, change, sign, turn in (
        *((4 + i, above[1 + i], -1.0, -turn_above) for i in (0, 1)),
        *((7 + i, below[1 + i], 1.0, turn_below) for i in (0, 1)),
    ):
        beta_change = np.sum(turn * change, axis=1, keepdims=True)
        moved = (r_p + sign * r_q)[:, None] * change + place_by_beta * beta_change
        by_place[:, :, column] = length[:, None] * moved
        by_direction[:, :, column] = (t_p + sign * t_q)[:, None] * change + t_by_beta * beta_change
    # derivative (m, 3) of the direction by the fraction f of the interval
    phi, half = f - 0.5, np.full_like(f, 0.5)
    to_p = -0.5 * beta**2 * phi * sinc(phi, beta)[0] / cosine(half, beta)[0]
    along = _combined(to_p, p, cosine(phi, beta)[0] / sinc(half, beta)[0], q) / length[:, None]
    by_place[:, :, 3], by_place[:, :, 6] = -away - (1.0 - f)[:, None] * t, away - f[:, None] * t
    by_direction[:, :, 3], by_direction[:, :, 6] = -(1.0 - f)[:, None] * along, -f[:, None] * along
    _, u, ah = _frame(inclination, azimuth)
    square = t[:, 0] ** 2 + t[:, 1] ** 2
    by_azimuth = ah / np.where(square > LEVEL**2, square, np.nan)[:, None]
    angles = [np.einsum("mi,mij->mj", rows, by_direction) for rows in (u, by_azimuth)]
    return np.concatenate([by_place, np.stack(angles, axis=1)], axis=1)


def _frame(inclination: Array, azimuth: Array) -> tuple[Array, Array, Array]:
    """Direction t (..., 3) along the hole, and its derivatives by inclination and azimuth."""
    t = directions(inclination, azimuth)
    ah = np.stack([-t[..., 1], t[..., 0], np.zeros_like(t[..., 0])], axis=-1)
    return t, directions(inclination + 0.5 * np.pi, azimuth), ah


def _combined(to_p: Array, p: Array, to_q: Array, q: Array) -> Array:
    return np.asarray(to_p[:, None] * p + to_q[:, None] * q)
