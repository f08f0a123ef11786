"""Inside the closed form: attitude with covariance, sensitivities, the names of its failures, the choice of a root."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.angles import wrap_positive
from inclinometry.core.arrays import Array, Mask, finite, within
from inclinometry.core.constants import EARTH_RATE
from inclinometry.core.errors import InputError
from inclinometry.gyro.formulas import HALF_PI, expected_rates, high_side, scale_condition
from inclinometry.gyro.result import North
from inclinometry.gyro.tilt import STEEPEST, tilt

WITHIN_NOISE: Final = 3.0
"""Standard uncertainties within which a quantity cannot be told from zero."""
ANGLE_FLOOR: Final = 1e-7
"""Sine or cosine of the inclination taken as zero, rad: the arcsine of two axes does not resolve less near 90 deg."""
ROUNDING: Final = 1e-9
"""Relative size of a discriminant below which rounding of the readings moves azimuth by more than 1e-9 deg."""
PARALLEL_FLOOR: Final = 1e-12
"""Reading, in units of the Earth rate, below which rounding alone decides its direction."""
FAR: Final = 4.0
"""Standard uncertainties from the history beyond which a scale factor does not continue it."""
CHANGE: Final = 0.002
"""Standard deviation of the change of a scale factor from one station to the next, where none is stated."""
STEADY: Final = 0.1
"""Share of the change from station to station by which the rate of that change may itself change."""
FORTH: Final = np.array([[1.0, 1.0], [0.0, 1.0]])
"""Scale factor and its rate of change from one station to the next."""
FAILURES: Final = frozenset({"up-hole", "horizontal", "parallel", "complex", "double-root"})
"""Flags before the choice of a root that leave nothing to choose."""


class Attitude(NamedTuple):
    """What the accelerometers say, n stations."""

    inclination: Array
    toolface: Array
    covariance: Array  # (n, 2, 2) of inclination and toolface
    up: Mask
    assumed: Mask  # no z reading: taken as pointing down
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
    lat = float(within(latitude, "latitude", -HALF_PI, HALF_PI, "rad"))
    rate = np.asarray(rate, dtype=np.float64)
    if rate.ndim != 2 or rate.shape[1] not in (2, 3):
        raise InputError(f"rate has shape {rate.shape}; expected (n, 2) or (n, 3)")
    n = len(finite(rate[:, :2], "rate"))
    attitude = _attitude(gravity, gravity_covariance, g)
    if len(attitude.inclination) != n:
        raise InputError(f"{len(attitude.inclination)} rows of gravity but {n} of rate; give one of each a station")
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
        raise InputError(f"{name} has shape {given.shape}; expected (2, 2), (3, 3), ({n}, 2, 2) or ({n}, 3, 3)")
    finite(given[..., :2, :2], name)
    full = np.zeros((n, 3, 3))
    full[:, :m, :m] = np.nan_to_num(given, nan=0.0)
    return full


def _attitude(gravity: ArrayLike, covariance: ArrayLike | None, g: float | None) -> Attitude:
    found = tilt(gravity, g)
    inclination, n = found.inclination, len(found.inclination)
    spread = found.by_gravity @ _covariance(covariance, n, "gravity_covariance") @ found.by_gravity.swapaxes(-1, -2)
    near = np.maximum(WITHIN_NOISE * np.sqrt(spread[:, 0, 0]), ANGLE_FLOOR)
    horizontal = np.abs(np.cos(inclination)) <= near
    up = (inclination > HALF_PI) & ~horizontal
    vertical = (np.sin(inclination) <= near) & ~up & ~horizontal
    return Attitude(inclination, found.toolface, spread, up, found.unseen, vertical, horizontal)


def sensitivity(s: Array, psi: Array, th: Array, lat: float) -> tuple[Array, Array]:
    """Derivatives (..., 4) of scale and of azimuth by A, B, inclination and toolface (A, B turn with it).

    From s A = X, s B = Y by implicit differentiation, at the point where they hold.
    """
    # in the vertical azimuth and toolface change without bound and their sum does not: a hair from it both are numbers
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
    th = np.minimum(attitude.inclination, HALF_PI)
    total = sum(noise.values(), np.zeros((len(a), 4, 4)))
    seen = a**2 + (b * np.cos(th)) ** 2
    spread = total[:, 0, 0] + np.cos(th) ** 2 * total[:, 1, 1]
    parallel = seen <= np.maximum(WITHIN_NOISE**2 * spread, PARALLEL_FLOOR**2)
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
    moves = np.diag([change**2, (STEADY * change) ** 2])
    spread, doubted = np.diag([known**2, change**2]), (np.nan, 0.0)
    chosen = np.full(len(roots), -1)
    for i, names in enumerate(flags):
        if state is not None:
            state, spread = FORTH @ state, FORTH @ spread @ FORTH.T + moves
        if any(name in FAILURES for name in names):
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
        agrees = len(positive) == 1 and abs(value - doubted[0]) <= FAR * np.hypot(np.hypot(u, doubted[1]), change)
        if state is None or agrees:
            # the first of the tool's own history, or the second in a row that contradicts what was taken for it
            state, spread = np.array([value, 0.0]), np.diag([u**2, change**2])
        elif change_sd is not None and abs(off[pick]) > FAR * np.sqrt(u**2 + spread[0, 0]):
            if len(positive) == 2:  # neither root is near the history: which of them is true it does not say
                names.append("history")
                continue
            doubted = value, u
            names.append("scale")
        elif spread[0, 0] > 0.0:
            gain = spread[:, 0] / (spread[0, 0] + max(u, ROUNDING) ** 2)
            state, spread = state + gain * off[pick], spread - np.outer(gain, spread[0])
            doubted = np.nan, 0.0
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
