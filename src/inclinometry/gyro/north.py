"""North by gyro: attitude and scale factor of stations, from averaged gravity and Earth rate in tool axes."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Mask
from inclinometry.constants import EARTH_RATE
from inclinometry.errors import not_among, out_of_range, refused
from inclinometry.gyro.closed_form import STEEPEST, Tilt, scale_condition, settle_vertical, tilt, upward
from inclinometry.gyro.joint import (
    LARGEST,
    RIVAL,
    SCALES,
    JointBatch,
    earth_in_tool,
    earth_slopes,
    posterior_sd,
    solve_joint,
)
from inclinometry.gyro.point_mass import Rates, ScaleLaw, solve_law
from inclinometry.gyro.result import North, covariances, one_value, per_station, vectors, weights
from inclinometry.rotations import wrap_positive, wrap_signed
from inclinometry.uncertainty import UNKNOWN


def estimate_north(
    gravity: ArrayLike,
    rate: ArrayLike,
    latitude: float,
    *,
    gravity_covariance: ArrayLike,
    rate_covariance: ArrayLike,
    scale: ArrayLike | ScaleLaw = 1.0,
    scale_sd: ArrayLike = 0.003,
    g: float | None = None,
    hole: str | None = None,
    latitude_sd: float = 0.0,
) -> North:
    """Azimuth and scale factor together, the most probable pair.

    Parameters
    ----------
    gravity : (n, 2) or (n, 3) array_like
        In tool axes, m/s^2; z NaN where it is not measured.
    rate : (n, 2) or (n, 3) array_like
        Readings of the gyros in tool axes freed from bias, rad/s (true rate = scale x reading); z NaN where not
        measured.
    latitude : float
        rad, north positive.
    gravity_covariance, rate_covariance : (n, k, k) array_like
        Of gravity and rate, in their units.
    scale, scale_sd : (n,) or scalar
        Prior of the scale factor from the calibration; infinite: nothing. A `ScaleLaw` as `scale`, from a
        `ScaleTrack`, gives it as a density, and `scale_sd` is not looked at.
    g : float, optional
        Gravity, m/s^2; needed where gravity has no z.
    hole : {"down", "up"}, optional
        Whether the tool points below or above the horizon, for tools that cannot tell (no z). Without it a gyro along
        the tool decides; failing that down is assumed and flagged.
    latitude_sd : float
        rad.

    Returns
    -------
    North

    Raises
    ------
    InputError
        Shapes, values or covariances that do not fit; cross-axis gravity beyond g; an unknown `hole`.

    Notes
    -----
    See `solve_joint`. Uncertainty by J C J' from the gyros, the accelerometers, the prior on scale and the latitude,
    kept apart; where the posterior is not Gaussian, or has two peaks, its own spread is added as "shape". By a
    `ScaleLaw` the azimuth is the mean about the highest peak of its density (`solve_law`).

    Examples
    --------
    >>> rate = 7.292115e-5 * 0.99 * np.array([[0.75**0.5 * 0.5**0.5, -0.5**0.5]])
    >>> down = 9.8 * np.array([[-np.sin(np.pi / 3), 0.0, 0.5]])
    >>> found = estimate_north(down, rate, np.pi / 4, gravity_covariance=[1e-8 * np.eye(3)],
    ...                        rate_covariance=[1e-15 * np.eye(2)], scale_sd=0.02)
    >>> float(np.degrees(found.azimuth[0]).round(2)), float(found.scale[0].round(3))
    (90.0, 1.01)
    """
    law = None
    if isinstance(scale, ScaleLaw):
        law = scale
        scale, scale_sd = law.moments()
    problem = _problem(gravity, rate, latitude, gravity_covariance, rate_covariance, scale, scale_sd, g, hole)
    return _north(problem, problem.scale_sd, latitude_sd, "joint", law)


def estimate_north_fixed(
    gravity: ArrayLike,
    rate: ArrayLike,
    latitude: float,
    *,
    gravity_covariance: ArrayLike,
    rate_covariance: ArrayLike,
    scale: ArrayLike = 1.0,
    scale_sd: ArrayLike = 0.0,
    g: float | None = None,
    hole: str | None = None,
    latitude_sd: float = 0.0,
) -> North:
    """Azimuth with the scale factor taken as given; parameters as `estimate_north`.

    The scale is not corrected by the rates; its uncertainty is carried into the azimuth's. Least squares uses both
    cross-axis rates, so it is never worse than the arctangent of the closed form.
    """
    problem = _problem(gravity, rate, latitude, gravity_covariance, rate_covariance, scale, scale_sd, g, hole)
    if np.isinf(problem.scale_sd).any():
        raise refused("input-finite", {"name": "scale_sd"})
    return _north(problem, np.zeros_like(problem.scale_sd), latitude_sd, "fixed")


class _Problem(NamedTuple):
    """Checked input: rates (n, 3) in units of the Earth rate, z NaN where not measured."""

    tilt: Tilt
    gravity_covariance: Array
    rate: Array
    rate_covariance: Array
    latitude: float
    scale: Array
    scale_sd: Array
    assumed: Mask
    open: Mask  #: the gyro along the tool is to decide between down and up


def _problem(
    gravity: ArrayLike,
    rate: ArrayLike,
    latitude: float,
    gravity_covariance: ArrayLike,
    rate_covariance: ArrayLike,
    scale: ArrayLike,
    scale_sd: ArrayLike,
    g: float | None,
    hole: str | None,
) -> _Problem:
    holes = ("down", "up")
    if hole is not None and hole not in holes:
        raise not_among("hole", str(hole), holes)
    found = tilt(gravity, g)
    size = len(found.inclination)
    rates = vectors(rate, "rate", LARGEST * EARTH_RATE, size)
    z = np.isfinite(rates[:, 2])
    pull = covariances(gravity_covariance, "gravity_covariance", ~found.unseen, positive=False)
    spin = covariances(rate_covariance, "rate_covariance", z, positive=True)
    if hole == "up":
        found = upward(found, found.unseen)
    undecided = found.unseen & (hole is None)
    lat = one_value(latitude, "latitude", -np.pi / 2, np.pi / 2, "rad")
    if abs(lat) > np.radians(89.9):
        raise out_of_range("latitude", float(np.degrees(lat)), "-89.9 .. 89.9 deg")
    return _Problem(
        found,
        pull,
        rates / EARTH_RATE,
        spin / EARTH_RATE**2,
        lat,
        per_station(scale, size, "scale", *SCALES),
        per_station(scale_sd, size, "scale_sd", 0.0, np.inf),
        undecided & ~z,
        undecided & z,
    )


def to_high_side(rate: Array, covariance: Array, toolface: Array) -> tuple[Array, Array]:
    """Rates (n, 3) and covariance turned by the toolface to the high side; an unseen z stays NaN."""
    c, s = np.cos(toolface), np.sin(toolface)
    turn = np.zeros((len(toolface), 2, 2))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1] = c, -s, s, c
    out, cov = rate.copy(), covariance.copy()
    out[:, :2] = np.einsum("nij,nj->ni", turn, rate[:, :2])
    cov[:, :2, :2] = turn @ covariance[:, :2, :2] @ np.swapaxes(turn, 1, 2)
    cov[:, 2, :2] = np.einsum("nij,nj->ni", turn, covariance[:, 2, :2])
    cov[:, :2, 2] = cov[:, 2, :2]
    return out, cov


def _north(problem: _Problem, prior_sd: Array, latitude_sd: float, method: str, law: ScaleLaw | None = None) -> North:
    one_value(latitude_sd, "latitude_sd", 0.0, np.pi / 2, "rad")
    found = problem.tilt
    high, covariance = to_high_side(problem.rate, problem.rate_covariance, found.toolface)
    latitude = np.full(len(high), problem.latitude)

    def solve(inclination: Array) -> tuple[JointBatch, Array, Array, Array]:
        """Solution, the standard deviation of its azimuth where known, that of k expected, and how far k is from it."""
        if law is not None:
            whole = solve_law(Rates(high, covariance, inclination, problem.latitude), law)
            return whole.found, whole.azimuth_sd, whole.prior_sd, whole.surprise
        one = solve_joint(high, covariance, inclination, latitude, scale=problem.scale, scale_sd=prior_sd)
        expected_sd = problem.scale_sd / problem.scale**2
        off = np.abs(one.k - 1.0 / problem.scale)
        surprise = np.divide(off, expected_sd, out=np.zeros_like(off), where=expected_sd > 0.0)
        return one, np.full(len(high), np.nan), expected_sd, surprise

    (best, spread, sd_k, surprise) = (first, *_) = solve(found.inclination)
    if problem.open.any():
        other, *more = solve(np.pi - found.inclination)
        rather = problem.open & (other.cost < best.cost)
        close = problem.open & (np.abs(other.cost - best.cost) < RIVAL)
        found = upward(found, rather)
        best = JointBatch(*(np.where(rather, b, a) for a, b in zip(best, other, strict=True)))
        spread, sd_k, surprise = (np.where(rather, b, a) for a, b in zip((spread, sd_k, surprise), more, strict=True))
        loser = np.where(rather, first.azimuth, other.azimuth), np.where(rather, first.cost, other.cost)
        nearer = close & ~(best.rival_cost < loser[1])
        best = best._replace(
            ambiguous=best.ambiguous | close,
            rival=np.where(nearer, loser[0], best.rival),
            rival_cost=np.where(nearer, loser[1], best.rival_cost),
        )
    response = _responses(best, found, high, covariance, latitude, problem.scale)
    components = _components(problem, prior_sd, sd_k, best, found, response, latitude_sd)
    lost = _lost(problem)
    odd = np.flatnonzero(best.weak | best.ambiguous)
    if law is None and odd.size:
        spread[odd] = posterior_sd(
            high[odd], covariance[odd], found.inclination[odd], latitude[odd],
            1.0 / problem.scale[odd], prior_sd[odd] / problem.scale[odd] ** 2, best.azimuth[odd],
        )  # fmt: skip
        # a rival too narrow for the integral counts by its likelihood
        odds = 1.0 / (1.0 + np.exp(0.5 * np.minimum(best.rival_cost[odd] - best.cost[odd], 1e3)))
        apart = np.where(np.isfinite(best.rival[odd]), wrap_signed(best.rival[odd] - best.azimuth[odd]), 0.0)
        spread[odd] = np.maximum(spread[odd], np.sqrt(odds) * np.abs(apart))
    if np.isfinite(spread).any():
        beyond = np.nan_to_num(spread) ** 2 - np.minimum(best.var_azimuth, UNKNOWN**2)
        components["shape"] = azimuth_only(np.maximum(beyond, 0.0))
    quadrant = lost & np.isnan(problem.rate[:, 2])
    if quadrant.any():  # azimuth and 180 deg - azimuth look alike
        components["quadrant"] = azimuth_only(np.where(quadrant, UNKNOWN**2, 0.0))
    result = _result(problem, best, found, components, response[1], method, lost, surprise)
    return replace(result, response=_by_angle(problem, prior_sd, sd_k, best, found, response))


def _lost(problem: _Problem) -> Mask:
    """Stations without z so near 90 deg that their inclination, by arcsine, is lost."""
    level = problem.tilt
    across = np.stack([-np.cos(level.toolface), np.sin(level.toolface)], axis=1)
    arc = np.sqrt(np.einsum("ni,nij,nj->n", across, problem.gravity_covariance[:, :2, :2], across))
    # 1 - sin(inclination) against the error of the sine
    gap = 2.0 * np.sin(0.5 * (np.pi / 2 - level.inclination)) ** 2 * level.strength
    # u(inclination) is that error over the cosine, and 90 deg less the inclination is 2 gap / spread of them. Five are
    # asked for: with 3, three stations in 20 000 at exactly 90 deg passed with an azimuth wrong by a hundred degrees,
    # since the inclination errs there by the root of the noise
    return np.asarray(level.unseen & (gap <= 0.5 * 5.0 * arc))


def _responses(
    best: JointBatch, found: Tilt, high: Array, covariance: Array, latitude: Array, scale: Array
) -> tuple[Array, Array, Array, Array]:
    """Gauss-Newton response of the solution: P [k E_psi, E]' W, P the inverse information.

    Derivatives of azimuth and k by rate (n, 2, 3), inclination and toolface (n, 2, 2), k0 (n, 2), latitude (n, 2).
    """
    weight = weights(covariance, np.isfinite(high[:, 2]))
    rate = np.where(np.isfinite(high), high, 0.0)
    model = earth_in_tool(best.azimuth, found.inclination, latitude)
    slopes = earth_slopes(best.azimuth, found.inclination, latitude)
    k = best.k[:, None]
    design = np.stack([k * slopes[..., 0], model], axis=1)  # (n, 2, 3)
    var = np.minimum(best.var_azimuth, 1e6)  # where azimuth is not seen at all its response is useless
    inverse = np.stack(
        [np.stack([var, best.cov_azimuth_k], axis=1), np.stack([best.cov_azimuth_k, best.var_k], axis=1)], axis=1
    )
    inverse = np.where(np.isfinite(inverse), inverse, 0.0)
    by_rate = inverse @ design @ weight
    spin = np.stack([-rate[:, 1], rate[:, 0], np.zeros(len(rate))], axis=1)
    by_tilt = np.stack(
        [
            np.einsum("nij,nj->ni", by_rate, -k * slopes[..., 1]),
            np.einsum("nij,nj->ni", by_rate, spin),
        ],
        axis=2,
    )
    by_latitude = np.einsum("nij,nj->ni", by_rate, -k * slopes[..., 2])
    fixed = best.var_k == 0.0
    by_prior = np.where(fixed[:, None], np.einsum("nij,nj->ni", by_rate, -model), np.nan)
    by_prior[fixed, 1] = 1.0
    return by_rate, by_tilt, by_prior, by_latitude


def _components(
    problem: _Problem,
    prior_sd: Array,
    sd_k: Array,
    best: JointBatch,
    found: Tilt,
    response: tuple[Array, ...],
    latitude_sd: float,
) -> dict[str, Array]:
    """Variances (n, 4) of inclination, azimuth, toolface and gyro toolface by cause; sd_k: of k expected."""
    size = len(best.azimuth)
    seen = np.isfinite(problem.rate[:, 2])
    _, cov_rate = to_high_side(problem.rate, problem.rate_covariance, found.toolface)
    cov_rate[~seen, 2, :] = cov_rate[~seen, :, 2] = 0.0
    by_rate, by_tilt, by_prior, by_latitude = (part[:, 0] for part in response)  # of azimuth
    gyro = np.einsum("ni,nij,nj->n", by_rate, cov_rate, by_rate)
    row = np.zeros((size, 4, 3))
    row[:, 0], row[:, 2] = found.by_gravity[:, 0], found.by_gravity[:, 1]
    row[:, 1] = by_tilt[:, :1] * found.by_gravity[:, 0] + by_tilt[:, 1:] * found.by_gravity[:, 1]
    row[:, 3] = by_tilt[:, :1] * found.by_gravity[:, 0] + (by_tilt[:, 1:] + 1.0) * found.by_gravity[:, 1]
    cov_gravity = np.where(np.isfinite(problem.gravity_covariance), problem.gravity_covariance, 0.0)
    fixed, flat = prior_sd == 0.0, np.isinf(sd_k)
    own = (by_prior * sd_k) ** 2
    safe = np.where(flat | fixed | (sd_k == 0.0), 1.0, sd_k)
    joint = np.where(flat, 0.0, (best.cov_azimuth_k / safe) ** 2)
    parts = {
        "gyro": azimuth_only(gyro),
        "accelerometer": np.einsum("nij,njk,nik->ni", row, cov_gravity, row),
        "scale": azimuth_only(np.where(fixed, np.where(np.isfinite(own), own, 0.0), joint)),
    }
    if latitude_sd > 0.0:
        parts["latitude"] = azimuth_only((by_latitude * latitude_sd) ** 2)
    return parts


def _by_angle(
    problem: _Problem, prior_sd: Array, sd_k: Array, best: JointBatch, found: Tilt, response: tuple[Array, ...]
) -> dict[str, Array]:
    """How inclination, azimuth and the direction of the hole follow what they are found from: `North.response`."""
    size = len(best.azimuth)
    by_rate, by_tilt, by_prior, by_latitude = (part[:, 0] for part in response)  # of azimuth
    # rates of the high side back to tool axes and to rad/s; what is not measured moves nothing
    c, s = np.cos(found.toolface), np.sin(found.toolface)
    turned = np.stack([c * by_rate[:, 0] + s * by_rate[:, 1], c * by_rate[:, 1] - s * by_rate[:, 0], by_rate[:, 2]], 1)
    turned[np.isnan(problem.rate[:, 2]), 2] = 0.0
    # of the estimate with an expected scale: P[azimuth, k] / variance of k expected
    free = (prior_sd > 0.0) & np.isfinite(sd_k)
    safe = np.where(free, sd_k, 1.0)
    joint = np.where(free, best.cov_azimuth_k / safe**2, np.where(np.isfinite(by_prior), by_prior, 0.0))
    by_gravity = np.einsum("ni,nij->nj", by_tilt, found.by_gravity)
    zero = np.zeros((size, 3))
    pairs = {
        "gravity": (found.by_gravity[:, 0], by_gravity),
        "rate": (zero, turned / EARTH_RATE),
        "prior": (zero[:, :1], joint[:, None]),
        "latitude": (zero[:, :1], by_latitude[:, None]),
    }
    ci, si = np.cos(found.inclination)[:, None], np.maximum(np.sin(found.inclination), STEEPEST)[:, None]
    ca, sa = np.cos(best.azimuth)[:, None], np.sin(best.azimuth)[:, None]
    return {
        name: np.stack([inc, azi, ci * ca * inc - si * sa * azi, ci * sa * inc + si * ca * azi], axis=1)
        for name, (inc, azi) in pairs.items()
    }


def azimuth_only(variance: Array) -> Array:
    """Variances (n, 4) of a cause that moves azimuth, and with it the gyro toolface."""
    out = np.zeros((len(variance), 4))
    out[:, 1] = out[:, 3] = variance
    return out


def _result(
    problem: _Problem,
    best: JointBatch,
    found: Tilt,
    components: dict[str, Array],
    by_tilt: Array,
    method: str,
    lost: Mask,
    surprise: Array,
) -> North:
    azimuth, toolface = settle_vertical(found.inclination, best.azimuth, found.toolface)
    inc = found.inclination
    condition = scale_condition(best.azimuth, inc, problem.latitude)
    scale = 1.0 / np.maximum(best.k, 1e-6)
    cov_gravity = np.where(np.isfinite(problem.gravity_covariance), problem.gravity_covariance, 0.0)
    by_gravity = np.einsum("ni,nij->nj", by_tilt[:, 1], found.by_gravity)
    # the accelerometers reach the scale too
    var_k = best.var_k + np.einsum("ni,nij,nj->n", by_gravity, cov_gravity, by_gravity)
    if method == "fixed":
        var_k = (problem.scale_sd / problem.scale**2) ** 2
    spread = np.sqrt(np.sum([part[:, 0] for part in components.values()], axis=0))
    dof = np.where(np.isfinite(problem.rate[:, 2]), 3.0, 2.0) - (1.0 if method == "fixed" else 2.0)
    dof = dof + (np.isfinite(problem.scale_sd) if method == "joint" else 0.0)
    masks = {
        # by the sine: the inclination of a tool without z is uncertain near horizontal too
        "vertical": np.sin(inc) <= 5.0 * spread * np.abs(np.cos(inc)),
        "down-assumed": problem.assumed,
        "horizontal": lost,
        "ambiguous": best.ambiguous,
        "weak": best.weak,
        "scale": (surprise > 4.0) & (method == "joint"),
        "misfit": best.cost > 16.0 * np.maximum(dof, 1.0),  # a degree of freedom
    }
    flags = tuple(tuple(name for name, mask in masks.items() if mask[n]) for n in range(len(inc)))
    return North(
        inc,
        azimuth,
        toolface,
        wrap_positive(azimuth + toolface),
        scale,
        np.sqrt(var_k) * scale**2,
        condition,
        tuple("+" if value > 0.0 else "-" for value in condition),
        components,
        best.cost,
        dof,
        flags,
        method,
    )
