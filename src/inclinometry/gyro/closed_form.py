"""North and scale factor in closed form from two gyros across the tool, as the patent has it, with its failures named.

Symbols: th inclination, psi azimuth, T toolface, a latitude (north +), s scale factor (true rate = s x reading);
A, B readings turned back to the high side, in units of the Earth rate, so that s A = X and s B = Y with

    X = cos a cos psi cos th + sin a sin th,   Y = -cos a sin psi,   Z = cos a cos psi sin th - sin a cos th
    K = cos a cos th + sin a sin th cos psi    (what the scale factor is seen through)

Source: "Temperature compensation method of a fibre-optic gyro inclinometer", patent application of Wuxi Huilian
Information Technology, 2015, steps C to F; formulas repaired, because the text in circulation lost its roots.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Mask, finite, within
from inclinometry.constants import EARTH_RATE
from inclinometry.errors import InputError, refused, wrong_shape
from inclinometry.gyro.result import North, vectors
from inclinometry.orientation import inclination_toolface
from inclinometry.rotations import wrap_positive

STEEPEST = 1e-9
"""Sine of the inclination, and cosine for a tool without z, below which derivatives are taken there instead."""


class Tilt(NamedTuple):
    """n stations.

    inclination, toolface : (n,) rad; without z the inclination is the one below 90 deg.
    by_gravity : (n, 2, 3) derivatives of the two by gravity in tool axes.
    unseen : (n,) no accelerometer sees along the tool: 180 deg - inclination is as likely.
    strength : (n,) gravity, in the unit given.
    """

    inclination: Array
    toolface: Array
    by_gravity: Array
    unseen: Mask
    strength: Array


def too_heavy(row: int, acceleration: float, gravity: float) -> InputError:
    """Accelerometers that read more than gravity, m/s^2."""
    values = {"row": row, "acceleration_m_s2": acceleration, "gravity_m_s2": gravity}
    return refused("gyro-accel-heavy", values)


def tilt(gravity: ArrayLike, g: float | None = None) -> Tilt:
    """Inclination and toolface from gravity (n, 2) or (n, 3) in tool axes; `g` in its unit, needed where z is NaN.

    theta = atan2(hypot(gx, gy), gz), or arcsin(hypot(gx, gy)/g); phi = atan2(gy, -gx).
    """
    # any unit of gravity gives less
    field = vectors(gravity, "gravity", 1e9)
    unseen = np.isnan(field[:, 2])
    if unseen.any() and g is None:
        raise refused("input-needs", {"name": "gravity", "needed": ("g",)})
    level = np.hypot(field[:, 0], field[:, 1])
    total = np.where(unseen, 0.0 if g is None else g, np.hypot(level, field[:, 2]))
    ratio = np.divide(level, total, out=np.full(len(level), np.inf), where=total > 0.0)
    # cross-axis gravity may exceed gravity by 5 %
    bad = ~(total > 0.0) | (unseen & (ratio > 1.0 + 0.05))
    if bad.any():
        row = int(np.argmax(bad))
        raise too_heavy(row + 1, float(level[row]), float(total[row]))
    whole = np.where(unseen, np.sqrt(np.maximum(total * total - level * level, 0.0)), field[:, 2])
    inclination, toolface = inclination_toolface(np.stack([field[:, 0], field[:, 1], whole], axis=1))
    sine, cosine = np.sin(inclination), np.cos(inclination)
    ct, st = np.cos(toolface), np.sin(toolface)
    out = np.zeros((len(inclination), 2, 3))
    # with z: turned by what is across; without: only through the length of the cross-axis part
    across = np.where(unseen, 1.0 / np.maximum(cosine, STEEPEST), cosine) / total
    out[:, 0, 0], out[:, 0, 1] = -ct * across, st * across
    out[:, 0, 2] = np.where(unseen, 0.0, -sine / total)
    lever = 1.0 / (np.maximum(sine, STEEPEST) * total)
    out[:, 1, 0], out[:, 1, 1] = st * lever, ct * lever
    return Tilt(inclination, toolface, out, unseen, total)


def upward(found: Tilt, rows: Mask) -> Tilt:
    """The same stations with the tool of some `rows` pointing up instead of down."""
    by_gravity = found.by_gravity.copy()
    by_gravity[rows, 0] *= -1.0
    return found._replace(
        inclination=np.where(rows, np.pi - found.inclination, found.inclination), by_gravity=by_gravity
    )


def settle_vertical(inclination: Array, azimuth: Array, toolface: Array) -> tuple[Array, Array]:
    """Azimuth and toolface by convention: exactly vertical azimuth is 0 and the whole turn is toolface."""
    vertical = np.sin(inclination) < 1e-15
    hand = np.where(inclination < np.pi / 2, 1.0, -1.0)
    turned = wrap_positive(toolface + hand * azimuth)
    return np.where(vertical, 0.0, azimuth), np.where(vertical, turned, toolface)


# The formulas of north and scale factor from two gyros across the tool, each for arrays of any shape.
#
# Symbols: th inclination, psi azimuth, T toolface, a latitude (north +), s scale factor (true rate = s x reading);
# A, B readings turned back to the high side, in units of the Earth rate, so that s A = X and s B = Y with
#
# X = cos a cos psi cos th + sin a sin th,   Y = -cos a sin psi,   Z = cos a cos psi sin th - sin a cos th
# K = cos a cos th + sin a sin th cos psi    (what the scale factor is seen through)
#
# Source: "Temperature compensation method of a fibre-optic gyro inclinometer", patent application of Wuxi Huilian
# Information Technology, 2015, steps C to F; formulas repaired, because the text in circulation lost its roots.


def high_side(rate: ArrayLike, toolface: ArrayLike) -> tuple[Array, Array]:
    """Cross-axis rates turned to high side and right: A = wx cos T - wy sin T, B = wx sin T + wy cos T."""
    rate, toolface = np.asarray(rate, dtype=np.float64), finite(toolface, "toolface")
    x, y = finite(rate[..., 0], "rate[:, 0]"), finite(rate[..., 1], "rate[:, 1]")
    c, s = np.cos(toolface), np.sin(toolface)
    return np.asarray(x * c - y * s), np.asarray(x * s + y * c)


def expected_rates(azimuth: ArrayLike, inclination: ArrayLike, latitude: ArrayLike) -> tuple[Array, Array, Array]:
    """High side, right and axial parts (X, Y, Z) of the Earth rate, in its unit; angles (...) in rad."""
    psi, th, lat = (np.asarray(v, dtype=np.float64) for v in (azimuth, inclination, latitude))
    level, down = np.cos(lat), np.sin(lat)
    north = level * np.cos(psi)
    x, z = north * np.cos(th) + down * np.sin(th), north * np.sin(th) - down * np.cos(th)
    return np.asarray(x), np.asarray(-level * np.sin(psi) + 0.0 * z), np.asarray(z)


def scale_condition(azimuth: ArrayLike, inclination: ArrayLike, latitude: ArrayLike) -> Array:
    """K = cos a cos th + sin a sin th cos psi, shape (...): the uncertainty of the scale factor goes as 1/|K|.

    It is the east part of (tool axis) x (direction of the Earth rate); the true root of the closed form has its sign.
    """
    psi, th, lat = (np.asarray(v, dtype=np.float64) for v in (azimuth, inclination, latitude))
    return np.asarray(np.cos(lat) * np.cos(th) + np.sin(lat) * np.sin(th) * np.cos(psi))


def scale_roots(a: ArrayLike, b: ArrayLike, inclination: ArrayLike, latitude: ArrayLike) -> tuple[Array, Array]:
    """Both scale factors (..., 2), + and - before the root, and the discriminant; a, b over the Earth rate.

    Step D of the patent: s = [A sin a sin th +- cos th sqrt((wx^2 + wy^2) cos^2 a - sin^2 th B^2)] / D, NaN where the
    discriminant is negative; D = A^2 + B^2 cos^2 th is the printed wx^2 + wy^2 - sin^2 th B^2. The smaller numerator
    comes from the product of the roots, -cos(a + th) cos(a - th)/D, so that it keeps its digits. Both roots are
    positive wherever th > 90 deg - |a|.
    """
    a, b = finite(a, "a"), finite(b, "b")
    th, lat = (
        within(inclination, "inclination", 0.0, np.pi / 2, "rad"),
        within(latitude, "latitude", -np.pi / 2, np.pi / 2),
    )
    discriminant = (a**2 + b**2) * np.cos(lat) ** 2 - (np.sin(th) * b) ** 2
    middle = a * np.sin(lat) * np.sin(th)
    product = -np.cos(lat + th) * np.cos(lat - th)
    with np.errstate(invalid="ignore", divide="ignore"):
        swing = np.cos(th) * np.sqrt(discriminant)
        large = middle + np.where(middle < 0.0, -swing, swing)
        d = a**2 + (b * np.cos(th)) ** 2
        first, second = large / d, np.where(large == 0.0, 0.0, product / large)
    plus, minus = np.where(middle < 0.0, second, first), np.where(middle < 0.0, first, second)
    bad = (discriminant < 0.0) | (d == 0.0)
    return np.where(bad[..., None], np.nan, np.stack([plus, minus], axis=-1)), np.asarray(discriminant)


def azimuth_arctan2(a: ArrayLike, b: ArrayLike, scale: ArrayLike, inclination: ArrayLike, latitude: ArrayLike) -> Array:
    """Azimuth psi = atan2(-s B cos th, s A - sin a sin th), rad in [0, 2 pi), with a known scale factor.

    `patent_azimuth` without its factor g^2 sin th, so it holds down to the vertical. Above 90 deg of inclination the
    result is the opposite azimuth: the factor cos th that both arguments carry has changed sign.
    """
    a, b, s, th, lat = (np.asarray(v, dtype=np.float64) for v in (a, b, scale, inclination, latitude))
    return wrap_positive(np.arctan2(-s * b * np.cos(th), s * a - np.sin(lat) * np.sin(th)))


def patent_azimuth(
    gx: ArrayLike, gy: ArrayLike, wx: ArrayLike, wy: ArrayLike, g: ArrayLike, latitude: ArrayLike
) -> Array:
    """Azimuth by step F as it was meant, rad in [0, 2 pi); prefer `azimuth_arctan2`.

    Parameters
    ----------
    gx, gy, g : (...) array_like
        Gravity across the tool (the field, not the specific force) and its strength, one unit.
    wx, wy : (...) array_like
        True rates, rad/s (reading x scale factor).
    latitude : (...) array_like
        rad.

    Returns
    -------
    (...) ndarray
        NaN exactly vertical and horizontal, where the formula is 0/0. Right for 0 < th < 90 deg only: in an up-hole
        and with the specific force it is wrong, and not by half a turn.

    Notes
    -----
    The circulating text `arctan(2(-(wx gy - wy gx) g2 - gx2 - gy2 - g(...) ...))` lost a square root and a comma:

        psi = atan2(-(wx gy - wy gx) sqrt(g^2 - gx^2 - gy^2), -g (wx gx + wy gy) - we sin a (gx^2 + gy^2)).

    Examples
    --------
    >>> w = 7.292115e-5 * np.array([0.5, -0.6])
    >>> float(np.degrees(patent_azimuth(-4.9, 0.1, *w, 9.8, np.radians(45.0))).round(3))
    72.755
    """
    names = ("gx", "gy", "wx", "wy", "g", "latitude")
    gx, gy, wx, wy, g, lat = (finite(v, n) for v, n in zip((gx, gy, wx, wy, g, latitude), names, strict=True))
    within(lat, "latitude", -np.pi / 2, np.pi / 2, "rad")
    level = gx**2 + gy**2
    sine = -(wx * gy - wy * gx) * np.sqrt(np.maximum(g**2 - level, 0.0))
    cosine = -g * (wx * gx + wy * gy) - EARTH_RATE * np.sin(lat) * level
    return np.where((level == 0.0) | (level >= g**2), np.nan, wrap_positive(np.arctan2(sine, cosine)))


def printed_toolface(gx: ArrayLike, gy: ArrayLike) -> Array:
    """Toolface by step C as printed, rad in [-pi/2, 3 pi/2); kept to show its defects, use atan2(gy, -gx).

    -arctan(gy/gx) where gx <= 0, pi - arctan(gy/gx) where gx > 0. At gx = +0 exactly it is half a turn off (+-90 deg
    change places; at -0 they do not), and it is NaN where gx = gy = 0. Elsewhere it is right.
    """
    gx, gy = finite(gx, "gx"), finite(gy, "gy")
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.arctan(gy / gx)
    return np.where(gx > 0.0, np.pi - slope, -slope)


# Inside the closed form: attitude with covariance, sensitivities, the names of its failures, the choice of a root.

WITHIN_NOISE: Final = 3.0
"""Standard uncertainties within which a quantity cannot be told from zero."""
ROUNDING: Final = 1e-9
"""Relative size of a discriminant below which rounding of the readings moves azimuth by more than 1e-9 deg."""
CHANGE: Final = 0.002
"""Standard deviation of the change of a scale factor from one station to the next, where none is stated."""


class Attitude(NamedTuple):
    """What the accelerometers say, n stations."""

    inclination: Array
    toolface: Array
    covariance: Array  #: (n, 2, 2) of inclination and toolface
    up: Mask
    assumed: Mask  #: no z reading: taken as pointing down
    vertical: Mask
    horizontal: Mask


def prepare(
    gravity: ArrayLike,
    rate: ArrayLike,
    latitude: float,
    gravity_covariance: ArrayLike | None,
    rate_covariance: ArrayLike | None,
    g: float | None,
) -> tuple[Attitude, Array, Array, dict[str, Array], float]:
    """Attitude, A and B, covariances (n, 4, 4) of (A, B, inclination, toolface) by cause, latitude."""
    lat = float(within(latitude, "latitude", -np.pi / 2, np.pi / 2, "rad"))
    rate = np.asarray(rate, dtype=np.float64)
    if rate.ndim != 2 or rate.shape[1] not in (2, 3):
        raise wrong_shape("rate", rate.shape, "(n, 2) | (n, 3)")
    n = len(finite(rate[:, :2], "rate"))
    attitude = _attitude(gravity, gravity_covariance, g)
    if len(attitude.inclination) != n:
        raise wrong_shape("gravity", (len(attitude.inclination),), f"({n}, 2) | ({n}, 3)")
    a, b = high_side(rate[:, :2] / EARTH_RATE, attitude.toolface)
    c, s = np.cos(attitude.toolface), np.sin(attitude.toolface)
    turn = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
    noise = {name: np.zeros((n, 4, 4)) for name in ("gyro", "accelerometer")}
    across = _covariance(rate_covariance, n, "rate_covariance")[:, :2, :2] / EARTH_RATE**2
    noise["gyro"][:, :2, :2] = turn @ across @ turn.swapaxes(-1, -2)
    noise["accelerometer"][:, 2:, 2:] = attitude.covariance
    return attitude, a, b, noise, lat


def _covariance(value: ArrayLike | None, n: int, name: str) -> Array:
    """(n, 3, 3); what is not known of the axis along the tool counts as zero."""
    if value is None:
        return np.zeros((n, 3, 3))
    given = np.asarray(value, dtype=np.float64)
    m = given.shape[-1] if given.ndim in (2, 3) else 0
    if m not in (2, 3) or given.shape[-2] != m or (given.ndim == 3 and len(given) != n):
        raise wrong_shape(name, given.shape, f"(2, 2) | (3, 3) | ({n}, 2, 2) | ({n}, 3, 3)")
    finite(given[..., :2, :2], name)
    full = np.zeros((n, 3, 3))
    full[:, :m, :m] = np.nan_to_num(given, nan=0.0)
    return full


def _attitude(gravity: ArrayLike, covariance: ArrayLike | None, g: float | None) -> Attitude:
    found = tilt(gravity, g)
    inclination, n = found.inclination, len(found.inclination)
    spread = found.by_gravity @ _covariance(covariance, n, "gravity_covariance") @ found.by_gravity.swapaxes(-1, -2)
    # sine or cosine taken as zero, rad: the arcsine of two axes does not resolve less near 90 deg
    near = np.maximum(WITHIN_NOISE * np.sqrt(spread[:, 0, 0]), 1e-7)
    horizontal = np.abs(np.cos(inclination)) <= near
    up = (inclination > np.pi / 2) & ~horizontal
    vertical = (np.sin(inclination) <= near) & ~up & ~horizontal
    return Attitude(inclination, found.toolface, spread, up, found.unseen, vertical, horizontal)


def sensitivity(s: Array, psi: Array, th: Array, lat: float) -> tuple[Array, Array]:
    """Derivatives (..., 4) of scale and of azimuth by A, B, inclination and toolface (A, B turn with it).

    From s A = X, s B = Y by implicit differentiation, at the point where they hold.
    """
    # in the vertical azimuth and toolface change without bound and their sum does not: very near to it both are numbers
    th = np.maximum(th, STEEPEST)
    x, y, z = expected_rates(psi, th, lat)
    x_psi, y_psi = y * np.cos(th), -np.cos(lat) * np.cos(psi)
    zero = np.zeros_like(s)
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = x / s, y / s
        first = np.stack([-s, zero, -z, s * b], -1)
        second = np.stack([zero, -s, zero, -s * a], -1)
        per = 1.0 / (b * x_psi - a * y_psi)[..., None]  # s / (cos a K)
        by_scale = (x_psi[..., None] * second - y_psi[..., None] * first) * per
        return by_scale, (a[..., None] * second - b[..., None] * first) * per


def variance(gradient: Array, covariance: Array) -> Array:
    """g' C g along the last axes."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray(np.einsum("...i,...ij,...j->...", gradient, covariance, gradient))


def placed(attitude: Attitude) -> list[list[str]]:
    """Flags that gravity alone decides."""
    named = {
        "up-hole": attitude.up,
        "horizontal": attitude.horizontal,
        "vertical": attitude.vertical,
        "down-assumed": attitude.assumed,
    }
    return [[name for name, where in named.items() if where[i]] for i in range(len(attitude.inclination))]


def failures(
    attitude: Attitude, a: Array, b: Array, discriminant: Array, noise: dict[str, Array], lat: float
) -> list[list[str]]:
    """Flags of every station before a root is chosen."""
    th = np.minimum(attitude.inclination, np.pi / 2)
    total = sum(noise.values(), np.zeros((len(a), 4, 4)))
    seen = a**2 + (b * np.cos(th)) ** 2
    spread = total[:, 0, 0] + np.cos(th) ** 2 * total[:, 1, 1]
    # 1e-12 Earth rates: below that rounding alone decides the direction of the readings
    parallel = seen <= np.maximum(WITHIN_NOISE**2 * spread, 1e-12**2)
    flat, slant = np.cos(lat) ** 2, np.sin(th)
    gradient = 2.0 * np.stack([a * flat, b * (flat - slant**2), -slant * np.cos(th) * b**2, -a * b * slant**2], -1)
    rounding = ROUNDING * ((a**2 + b**2) * flat + (slant * b) ** 2)
    # the square root is within 3 of its standard uncertainty, u(disc) / (2 sqrt(disc))
    unsure = np.maximum(0.5 * WITHIN_NOISE * np.sqrt(variance(gradient, total)), rounding)
    flags = placed(attitude)
    for i, names in enumerate(flags):
        if attitude.up[i] or attitude.horizontal[i]:
            continue
        if parallel[i]:
            names.append("parallel")
        elif discriminant[i] < -rounding[i]:
            names.append("complex")
        elif discriminant[i] <= unsure[i]:
            names.append("double-root")
    return flags


def choose(
    roots: Array,
    u_roots: Array,
    flags: list[list[str]],
    history: float | None,
    history_sd: float,
    change_sd: float | None,
) -> tuple[Array, list[list[str]]]:
    """Column of the root taken, -1 where none, along the run; flags are added to.

    Scale factor and its rate of change from station to station are followed by a Kalman filter on the roots taken, each
    with its own uncertainty; what it foretells is the history to which a root is near or far.
    """
    state = None if history is None else np.array([float(within(history, "history", 1e-3, 1e3)), 0.0])
    known = float(within(history_sd, "history_sd", 0.0, 1e3))
    change = CHANGE if change_sd is None else float(within(change_sd, "change_sd", 0.0, 1e3))
    # by a tenth of that the rate of that change may itself change
    moves = np.diag([change**2, (0.1 * change) ** 2])
    spread, suspected = np.diag([known**2, change**2]), (np.nan, 0.0)
    chosen = np.full(len(roots), -1)
    far = 4.0  # standard uncertainties from the history beyond which a scale factor does not continue it
    forth = np.array([[1.0, 1.0], [0.0, 1.0]])  # scale factor and its rate of change from one station to the next
    # flags before the choice of a root that leave nothing to choose
    hopeless = frozenset({"up-hole", "horizontal", "parallel", "complex", "double-root"})
    for i, names in enumerate(flags):
        if state is not None:
            state, spread = forth @ state, forth @ spread @ forth.T + moves
        if any(name in hopeless for name in names):
            continue
        positive = np.flatnonzero(roots[i] > 0.0)
        if len(positive) == 0:
            names.append("misfit")
            continue
        if len(positive) == 2 and state is None:
            names.append("history")
            continue
        off = roots[i] - (roots[i] if state is None else state[0])
        pick = int(positive[np.argmin(np.abs(off[positive]))])
        value, u = float(roots[i, pick]), float(u_roots[i, pick])
        agrees = len(positive) == 1 and abs(value - suspected[0]) <= far * np.hypot(np.hypot(u, suspected[1]), change)
        if state is None or agrees:
            # the first of the tool's own history, or the second in a row that contradicts what was taken for it
            state, spread = np.array([value, 0.0]), np.diag([u**2, change**2])
        elif change_sd is not None and abs(off[pick]) > far * np.sqrt(u**2 + spread[0, 0]):
            if len(positive) == 2:  # neither root is near the history: which of them is true it does not say
                names.append("history")
                continue
            suspected = value, u
            names.append("scale")
        elif spread[0, 0] > 0.0:
            gain = spread[:, 0] / (spread[0, 0] + max(u, ROUNDING) ** 2)
            state, spread = state + gain * off[pick], spread - np.outer(gain, spread[0])
            suspected = np.nan, 0.0
        chosen[i] = pick
    return chosen, flags


def north_result(
    attitude: Attitude,
    psi: Array,
    scale: Array,
    u_scale: Array,
    by_azimuth: Array,
    noise: dict[str, Array],
    flags: list[list[str]],
    lat: float,
    method: str,
) -> North:
    """The result; by_azimuth (n, 4) are derivatives of azimuth by A, B, inclination, toolface."""
    unit = np.broadcast_to(np.eye(4)[2:], (len(psi), 2, 4))
    rows = np.stack([unit[:, 0], by_azimuth, unit[:, 1], by_azimuth + unit[:, 1]], axis=1)
    k = scale_condition(psi, attitude.inclination, lat)
    return North(
        inclination=attitude.inclination,
        azimuth=np.where(attitude.vertical, np.nan, psi),
        toolface=attitude.toolface,
        gyro_toolface=wrap_positive(psi + attitude.toolface),
        scale=scale,
        u_scale=u_scale,
        k=k,
        root=["" if np.isnan(v) else "+" if v > 0.0 else "-" for v in k],
        components={name: variance(rows, part[:, None]) for name, part in noise.items()},
        chi_square=np.zeros(len(psi)),
        dof=np.zeros(len(psi)),
        flags=flags,
        method=method,
    )


def solve_patent(
    gravity: ArrayLike,
    rate: ArrayLike,
    latitude: float,
    *,
    gravity_covariance: ArrayLike | None = None,
    rate_covariance: ArrayLike | None = None,
    g: float | None = None,
    history: float | None = None,
    history_sd: float = 0.0,
    change_sd: float | None = None,
) -> North:
    """Steps C to F of the patent for a run of stations: scale factor from the Earth's rate itself, then azimuth.

    Parameters
    ----------
    gravity : (n, 2) or (n, 3) array_like
        Field of gravity in tool axes, m/s^2; z NaN where it is not measured. Inclination is the
        patent's arcsine without z, and comes from z, `g` not used, with it.
    rate : (n, 2) or (n, 3) array_like
        Readings x, y, rad/s, freed of bias; z is not used.
    latitude : float
        rad, north positive.
    gravity_covariance, rate_covariance : (n, m, m) array_like, optional
        Of one station's readings, (m/s^2)^2 and (rad/s)^2, m 2 or 3; one (m, m) serves all. Taken as exact if absent.
    g : float, optional
        Strength of gravity, m/s^2; needed where z is not measured.
    history, history_sd : float, optional
        Scale factor before the first station, and its standard uncertainty. Absent: the first station with a single
        positive root begins the history; stations before it are flagged "history".
    change_sd : float, optional
        Standard deviation of the scale factor's change from one station to the next. With it a scale factor further
        than 4 standard uncertainties from the history is flagged "scale" and is not carried on, unless the next station
        agrees with it; and of two roots that far neither is taken ("history").

    Returns
    -------
    North
        method "patent". Where it fails azimuth and scale are NaN and a flag says why; "vertical" keeps the scale
        factor and the gyro toolface, both of which stay defined. `root` is "" and `k` NaN where nothing was chosen.
        Variances are first order, capped by `North.u`; where it is not given a covariance adds nothing.

    Raises
    ------
    InputError
        Shapes, values not finite, latitude beyond the poles, `g` missing or exceeded by the cross-axis gravity.

    Notes
    -----
    Which root: the claim discards "the one that differs much from the history of the scale factor", the description
    "by the sign of s and the rate of change of the history". So: of two positive roots the one nearer to what the
    scale factors so far and their rate of change foretell. That is safe only where the roots are further apart than
    the scale factor moves: near K = 0 it is not, and an error there is carried on. Implicit differentiation of
    s A = X, s B = Y gives the sensitivities.

    Examples
    --------
    >>> down = [[-4.9, 0.0, 8.48704895708750]]
    >>> x, y, _ = expected_rates(np.radians(40.0), np.radians(30.0), np.radians(45.0))
    >>> north = solve_patent(down, [[7.292115e-5 * x / 1.01, 7.292115e-5 * y / 1.01]], np.radians(45.0))
    >>> float(np.degrees(north.azimuth[0]).round(6)), float(north.scale[0].round(6)), north.root[0]
    (40.0, 1.01, '+')
    """
    attitude, a, b, noise, lat = prepare(gravity, rate, latitude, gravity_covariance, rate_covariance, g)
    th = np.minimum(attitude.inclination, np.pi / 2)
    roots, discriminant = scale_roots(a, b, th, lat)
    a2, b2, th2 = a[:, None], b[:, None], th[:, None]
    psi = azimuth_arctan2(a2, b2, roots, th2, lat)
    by_scale, by_azimuth = sensitivity(roots, psi, th2, lat)
    u_roots = np.sqrt(sum(variance(by_scale, part[:, None]) for part in noise.values()))
    named = failures(attitude, a, b, discriminant, noise, lat)
    chosen, flags = choose(roots, u_roots, named, history, history_sd, change_sd)
    lost, pick = chosen < 0, (np.arange(len(a)), np.maximum(chosen, 0))
    return north_result(
        attitude,
        np.where(lost, np.nan, psi[pick]),
        np.where(lost, np.nan, roots[pick]),
        np.where(lost, np.nan, u_roots[pick]),
        np.where(lost[:, None], np.nan, by_azimuth[pick]),
        noise,
        flags,
        lat,
        "patent",
    )


def solve_fixed_arctan2(
    gravity: ArrayLike,
    rate: ArrayLike,
    latitude: float,
    *,
    scale: ArrayLike = 1.0,
    u_scale: ArrayLike = 0.0,
    gravity_covariance: ArrayLike | None = None,
    rate_covariance: ArrayLike | None = None,
    g: float | None = None,
) -> North:
    """The classical closed form: azimuth by `azimuth_arctan2` with a given scale factor; parameters as `solve_patent`.

    An error ds of the scale factor gives dpsi = -tan a tan th sin psi ds (component "scale"). Two readings for one
    unknown: not the estimate of least variance. NaN and flagged when vertical (gyro toolface kept), horizontal or up.
    """
    attitude, a, b, noise, lat = prepare(gravity, rate, latitude, gravity_covariance, rate_covariance, g)
    s = np.broadcast_to(within(scale, "scale", 1e-3, 1e3), a.shape)
    u = np.broadcast_to(within(u_scale, "u_scale", 0.0, np.inf), a.shape)
    th = np.minimum(attitude.inclination, np.pi / 2)
    lost = attitude.up | attitude.horizontal
    psi = np.where(lost, np.nan, azimuth_arctan2(a, b, s, th, lat))
    # derivatives in the vertical: very near to it, where azimuth and toolface are numbers
    hair = np.maximum(th, STEEPEST)
    a, th = a + np.sin(lat) * (np.sin(hair) - np.sin(th)) / s, hair
    sine, cosine = -s * b * np.cos(th), s * a - np.sin(lat) * np.sin(th)
    d_sine = [0.0 * a, -s * np.cos(th), s * b * np.sin(th), -s * a * np.cos(th), -b * np.cos(th)]
    d_cosine = [s, 0.0 * a, -np.sin(lat) * np.cos(th), -s * b, a]
    with np.errstate(divide="ignore", invalid="ignore"):
        by = np.stack(
            [(cosine * p - sine * q) / (sine**2 + cosine**2) for p, q in zip(d_sine, d_cosine, strict=True)], -1
        )
    north = north_result(
        attitude, psi, s, u, np.where(lost[:, None], np.nan, by[:, :4]), noise, placed(attitude), lat, "fixed"
    )
    extra = np.where(lost, np.nan, (by[:, 4] * u) ** 2)
    none = np.zeros_like(extra)
    components = {**north.components, "scale": np.stack([none, extra, none, extra], axis=-1)}
    return replace(north, components=components)
