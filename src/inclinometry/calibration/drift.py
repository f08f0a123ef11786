"""How the tools of a type drift: a state-space model of each tool, with what the type has in common from all of them.

    (1) theta_{k+1} = theta_k + B x_k + w_k,   w_k ~ N(0, lambda tau_k Q)
    (2) tau_k = alpha dt + (1 - alpha) h / h0,  calendar time and operating hours, years
    (3) y_k = theta_k + e_k,                    e_k ~ N(0, V_k + R)

theta are a tool's relative parameters (`inclinometry.history`), x doses of shock and heat, V_k the covariance of the
certificate, R the reproducibility between mountings. Q, R and B are the type's, found by the EM algorithm over all its
tools (Kalman filter and Rauch-Tung-Striebel smoother); lambda is the tool's own, from a bank of filters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array, Mask, frozen, within
from inclinometry.constants import DIP
from inclinometry.digest import digest_bytes
from inclinometry.errors import refused
from inclinometry.history import PARAMETERS, ToolHistory
from inclinometry.orientation import fields
from inclinometry.sensors import Tool, Triad, angle_sensitivity
from inclinometry.tabular import check_record

SHOWN: Final = tuple(np.radians([5.0, 30.0, 60.0, 90.0]).tolist())
"""Inclinations at which a fleet's azimuth is stated, rad."""
SIXTY: Final = 2
"""Which of them stands for a tool where one figure is given."""

MULTIPLIERS: Final = np.exp(np.linspace(-2.4, 2.4, 9))
"""Grid of a tool's own drift variance, in units of the type's."""


@dataclass(frozen=True, eq=False)
class DriftModel:
    """What the tools of a type have in common, and what it was found from."""

    type: str  #: name of the type
    drift: Array  #: (24, 24) Q, variance of the relative parameters a year
    reproducibility: Array  #: (24, 24) R, variance between mountings
    effects: Array  #: (24, 2) B, change of the parameters by a dose of shock and of heat
    calendar_share: float  #: alpha of a tool's clock
    hours_per_year: float  #: h0 of a tool's clock
    multiplier_sd: float  #: standard deviation of log lambda over the tools
    dip: float  #: of the field for which the azimuth was followed, rad
    tools: int
    calibrations: int
    first: str
    last: str
    digest: str
    left_out: Sequence[str] = ()  #: serial numbers of tools that were not used, because they had jumped
    iterations: int = 0  #: of the EM algorithm

    @property
    def basis(self) -> dict[str, object]:
        """What it was found from, for a record."""
        names = ("type", "tools", "calibrations", "first", "last")
        return {**{name: getattr(self, name) for name in names}, "left_out": list(self.left_out)}

    def clock(self, years: Array, hours: Array) -> Array:
        """Time that a tool's drift counts, years; equation (2)."""
        if self.calendar_share >= 1.0:
            return np.asarray(years)
        return np.asarray(self.calendar_share * years + (1.0 - self.calendar_share) * hours / self.hours_per_year)


def azimuth_gradients(inclination: Array, dip: float, steps: int = 12) -> Array:
    """Derivatives (n, steps^2, 24) of the azimuth by the relative parameters, over azimuth and toolface.

    Equation (7): u^2 = g' P g.
    """
    turn = 2.0 * np.pi * np.arange(steps) / steps
    grid = [x.reshape(len(inclination), -1) for x in np.meshgrid(inclination, turn, turn, indexing="ij")]
    g, b = fields(grid[1], grid[0], grid[2], dip)
    seen = {"accelerometer": g, "magnetometer": b}
    nominal = Tool("nominal", {kind: Triad(kind, np.eye(3), np.zeros(3)) for kind in seen})
    return np.asarray(angle_sensitivity(nominal, seen).by_parameter[:, :, 1])


def azimuth_weight(inclination: Array, dip: float, steps: int = 12) -> Array:
    """G (n, 24, 24) with e' G e the mean square azimuth error, rad^2, of an error e of the parameters."""
    g = azimuth_gradients(inclination, dip, steps)
    return np.asarray(np.einsum("nap,naq->npq", g, g, optimize=True) / g.shape[1])


def azimuth_sd(covariance: Array, inclination: Array | Sequence[float] = SHOWN, dip: float = DIP) -> Array:
    """Standard uncertainty of the azimuth, rms over azimuth and toolface, rad, shape (..., n)."""
    weight = azimuth_weight(np.asarray(inclination, dtype=np.float64), dip)
    return np.asarray(np.sqrt(np.maximum(np.einsum("npq,...pq->...n", weight, covariance), 0.0)))


class Batch(NamedTuple):
    """Histories as arrays: n tools, K calibrations, absent ones behind the last.

    values (n, K, p), covariance (n, K, p, p), clock (n, K-1) and doses (n, K-1, 2) since the one before, seen (n, K)
    """

    values: Array
    covariance: Array
    clock: Array
    doses: Array
    seen: Mask


def batch(histories: Sequence[ToolHistory], calendar_share: float, hours_per_year: float) -> Batch:
    """Histories of any length as arrays of one shape."""
    size, most, p = len(histories), max(len(h) for h in histories), len(PARAMETERS)
    values, covariance = np.zeros((size, most, p)), np.tile(np.eye(p), (size, most, 1, 1))
    clock, doses, seen = np.zeros((size, most - 1)), np.zeros((size, most - 1, 2)), np.zeros((size, most), dtype=bool)
    for i, h in enumerate(histories):
        k = len(h)
        values[i, :k], covariance[i, :k], seen[i, :k] = h.values, h.covariance, True
        hours = np.asarray(h.hours)[1:] / hours_per_year
        clock[i, : k - 1] = calendar_share * np.diff(h.years) + (1.0 - calendar_share) * hours
        doses[i, : k - 1] = h.doses[1:]
    # two calibrations of one day: a day's drift at most, and nothing to divide by
    clock = np.where(seen[:, 1:], np.maximum(clock, 1e-3), 0.0)
    return Batch(values, covariance, clock, doses, seen)


class Filtered(NamedTuple):
    """What a Kalman filter says of n tools at K calibrations.

    mean (n, K, p), covariance (n, K, p, p) after each; predicted_mean, predicted_covariance before each;
    innovation (n, K, p) and its covariance spread (n, K, p, p), nothing of the first; likelihood (n,) logarithm
    """

    mean: Array
    covariance: Array
    predicted_mean: Array
    predicted_covariance: Array
    innovation: Array
    spread: Array
    likelihood: Array


def kalman(data: Batch, drift: Array, reproducibility: Array, effects: Array, multiplier: Array) -> Filtered:
    """Filter of equations (3) to (5), all tools at once; before its first calibration nothing is known of a tool."""
    n, most, p = data.values.shape
    mean, covariance = np.zeros((n, most, p)), np.zeros((n, most, p, p))
    before, spread_before = np.zeros((n, most, p)), np.zeros((n, most, p, p))
    innovation, spread = np.zeros((n, most, p)), np.zeros((n, most, p, p))
    likelihood = np.zeros(n)
    noise = data.covariance + reproducibility
    mean[:, 0], covariance[:, 0] = data.values[:, 0], noise[:, 0]
    for k in range(1, most):
        grown = (multiplier * data.clock[:, k - 1])[:, None, None] * drift
        before[:, k] = mean[:, k - 1] + data.doses[:, k - 1] @ effects.T
        spread_before[:, k] = covariance[:, k - 1] + grown
        innovation[:, k] = data.values[:, k] - before[:, k]
        spread[:, k] = spread_before[:, k] + noise[:, k]
        right = np.concatenate([spread_before[:, k], innovation[:, k, :, None]], axis=2)
        solved = np.linalg.solve(spread[:, k], right)  # S^-1 [P-, nu]
        there = data.seen[:, k]
        mean[:, k] = before[:, k] + np.where(there[:, None], (spread_before[:, k] @ solved[..., -1:])[..., 0], 0.0)
        updated = spread_before[:, k] - spread_before[:, k] @ solved[..., :-1]
        covariance[:, k] = np.where(there[:, None, None], (updated + updated.swapaxes(1, 2)) / 2.0, spread_before[:, k])
        fits = np.einsum("np,np->n", innovation[:, k], solved[..., -1]) + np.linalg.slogdet(spread[:, k])[1]
        likelihood -= np.where(there, 0.5 * fits, 0.0)
    return Filtered(mean, covariance, before, spread_before, innovation, spread, likelihood)


def smooth(done: Filtered) -> tuple[Array, Array, Array]:
    """Smoothed means (n, K, p), covariances (n, K, p, p), and covariances (n, K-1, p, p) of each with the one before.

    Notes
    -----
    Rauch H.E., Tung F., Striebel C.T., AIAA Journal 3, 1965, 1445-1450.
    """
    mean, covariance = done.mean.copy(), done.covariance.copy()
    cross = np.zeros_like(covariance[:, 1:])
    for k in range(mean.shape[1] - 2, -1, -1):
        gain = np.linalg.solve(done.predicted_covariance[:, k + 1], done.covariance[:, k]).swapaxes(1, 2)
        mean[:, k] += (gain @ (mean[:, k + 1] - done.predicted_mean[:, k + 1])[..., None])[..., 0]
        cross[:, k] = covariance[:, k + 1] @ gain.swapaxes(1, 2)
        covariance[:, k] += gain @ (covariance[:, k + 1] - done.predicted_covariance[:, k + 1]) @ gain.swapaxes(1, 2)
    return mean, covariance, cross


class _Shared(NamedTuple):
    """Q, R and B of the type."""

    drift: Array
    reproducibility: Array
    effects: Array


def _em_step(data: Batch, shared: _Shared, multiplier: Array, with_effects: bool, calm: float) -> tuple[_Shared, float]:
    """One step of the EM algorithm, equation (8), and the likelihood before it; `calm` is nu0, of few tools."""
    done = kalman(data, *shared, multiplier)
    mean, covariance, cross = smooth(done)
    step = data.seen[:, 1:]
    tau = np.where(step, multiplier[:, None] * data.clock, 1.0)
    weight = np.where(step, 1.0 / tau, 0.0)
    d = mean[:, 1:] - mean[:, :-1]
    effects = shared.effects
    if with_effects:
        right = np.einsum("nk,nkp,nkx->px", weight, d, data.doses)
        square = np.einsum("nk,nkx,nky->xy", weight, data.doses, data.doses)
        effects = right @ np.linalg.pinv(square, rcond=1e-12)
    d = d - data.doses @ effects.T
    second = covariance[:, 1:] + covariance[:, :-1] - cross - cross.swapaxes(2, 3)
    count = int(step.sum())
    drift = np.einsum("nk,nkp,nkq->pq", weight, d, d) + np.einsum("nk,nkpq->pq", weight, second)
    drift /= count
    drift = (count * drift + calm * np.diag(np.diagonal(drift))) / (count + calm)
    reproducibility = shared.reproducibility
    if reproducibility.any():
        noise = data.covariance + reproducibility
        gain = np.linalg.solve(noise, np.broadcast_to(reproducibility, noise.shape)).swapaxes(2, 3)  # R (V + R)^-1
        off = (data.values - mean)[..., None]
        moved = (gain @ off)[..., 0]
        part = gain @ (covariance - noise) @ gain.swapaxes(2, 3)
        seen = data.seen.astype(float)
        total = np.einsum("nk,nkp,nkq->pq", seen, moved, moved) + np.einsum("nk,nkpq->pq", seen, part)
        reproducibility = reproducibility + total / seen.sum()
        reproducibility = (reproducibility + reproducibility.T) / 2.0
    return _Shared((drift + drift.T) / 2.0, reproducibility, effects), float(done.likelihood.sum())


def _start(data: Batch, with_reproducibility: bool) -> _Shared:
    """Moments of differences: E dd' = V + V' + 2 R + tau Q; of neighbours, or of any two where R is asked."""
    size, most, p = data.values.shape
    passed = np.concatenate([np.zeros((size, 1)), np.cumsum(data.clock, axis=1)], axis=1)
    middle = float(np.median(data.clock[data.seen[:, 1:]]))
    # least squares of the moments on (tau, 2), weights falling as their scatter grows
    normal, right = np.zeros((2, 2)), np.zeros((2, p, p))
    for lag in range(1, most if with_reproducibility else 2):
        there = data.seen[:, lag:]
        tau = passed[:, lag:] - passed[:, :-lag]
        weight = np.where(there, (middle + tau) ** -2.0, 0.0)
        d = data.values[:, lag:] - data.values[:, :-lag]
        moment = np.einsum("nk,nkp,nkq->pq", weight, d, d)
        excess = data.covariance[:, lag:] + data.covariance[:, :-lag]
        moment_by_tau = np.einsum("nk,nkp,nkq->pq", weight * tau, d, d)
        right[0] += moment_by_tau - np.einsum("nk,nkpq->pq", weight * tau, excess)
        right[1] += 2.0 * (moment - np.einsum("nk,nkpq->pq", weight, excess))
        sums = [(weight * tau**power).sum() for power in range(3)]
        normal += np.array([[sums[2], 2.0 * sums[1]], [2.0 * sums[1], 4.0 * sums[0]]])
    small = 0.02 * np.mean(data.covariance[data.seen], axis=0)
    if with_reproducibility and np.linalg.cond(normal) < 1e6:
        drift, mounting = np.tensordot(np.linalg.inv(normal), right, axes=1)
    else:  # all pairs the same time apart: drift and reproducibility cannot be told from each other
        drift, mounting = right[0] / normal[0, 0], np.zeros((p, p))
    reproducibility = _above(mounting, small) if with_reproducibility else np.zeros((p, p))
    return _Shared(_above(drift, small / middle), reproducibility, np.zeros((p, 2)))


def _above(matrix: Array, least: Array) -> Array:
    """The matrix with no direction below `least`."""
    root = np.linalg.cholesky(least)
    whitened = np.linalg.solve(root, np.linalg.solve(root, matrix).T)
    values, vectors = np.linalg.eigh((whitened + whitened.T) / 2.0)
    turned = root @ vectors
    return np.asarray((turned * np.maximum(values, 1.0)) @ turned.T)


def _usable(histories: Sequence[ToolHistory]) -> tuple[str, list[ToolHistory]]:
    """Type of the tools, and the calibrations of those that have two or more."""
    for one in histories:
        check_record(one, ToolHistory, "fit_drift")
    kinds = sorted({h.type for h in histories})
    if len(kinds) > 1:
        raise refused("drift-types", {"types": tuple(kinds)})
    # runs say where a tool stands, not how its type drifts: moments of what they do not determine would drown it
    used = [h.calibrations for h in histories if len(h.calibrations) > 1]
    least_tools = 3
    if len(used) < least_tools:
        tools = "tools with two calibrations or more"
        raise refused("input-few", {"name": tools, "count": len(used), "least": least_tools})
    return kinds[0], used


def fit_drift(
    histories: Sequence[ToolHistory],
    *,
    calendar_share: float = 1.0,
    reproducibility: bool | None = None,
    effects: bool | None = None,
    own_drift: bool = True,
    dip: float = DIP,
    tolerance: float = 1e-3,
    iterations: int = 60,
    progress: Callable[[float], None] | None = None,
) -> DriftModel:
    """Drift, reproducibility and effects of a type from the histories of its tools (empirical Bayes).

    Parameters
    ----------
    histories : sequence of ToolHistory
        Of one type; those of a single calibration say nothing and are passed over, as is the evidence of runs.
    calendar_share : float
        alpha of equation (2), 0 to 1.
    reproducibility : bool, optional
        Whether mountings differ; R is estimated then, else zero. It is told from drift by calibrations close in time.
        When not given, R is taken where it makes the histories more likely by more than its 300 elements do by chance
        (Akaike's criterion): to leave it out where it is makes a check dishonest.
    effects : bool, optional
        Whether shock and heat act. Default: where doses are recorded.
    own_drift : bool
        Whether each tool has a drift variance of its own; the spread over the tools is estimated then, else zero.
    dip : float
        Of the field at which the azimuth is judged, rad.
    tolerance : float
        Stop when three steps on end change u(azimuth) of drift and reproducibility by less than this share.
    iterations : int
        At most.
    progress : callable, optional
        Called with the share done; raise from it to stop.

    Raises
    ------
    InputError
        Tools of two types; fewer than three tools with two calibrations.

    Examples
    --------
    >>> from datetime import date
    >>> random = np.random.default_rng(1)
    >>> days = [date(year, 1, 1) for year in range(2020, 2026)]
    >>> walks = 1e-3 * np.cumsum(random.standard_normal((20, 6, 24)), axis=1)
    >>> v = np.tile(1e-10 * np.eye(24), (6, 1, 1))
    >>> found = fit_drift([ToolHistory(str(i), "X", days, y, v) for i, y in enumerate(walks)], reproducibility=False)
    >>> round(1e3 * float(np.sqrt(np.trace(found.drift) / 24)), 2)
    0.99
    """
    kind, used = _usable(histories)
    share = float(within(calendar_share, "calendar_share", 0.0, 1.0))
    hours, years = sum(float(np.sum(np.asarray(h.hours)[1:])) for h in used), sum(float(h.years[-1]) for h in used)
    if share < 1.0 and not hours > 0.0:
        raise refused("input-needs", {"name": "calendar_share", "needed": ("hours",)})
    per_year = hours / years if hours > 0.0 and years > 0.0 else 1.0
    data = batch(used, share, per_year)
    acts = bool(data.doses.any()) if effects is None else effects
    weight = azimuth_weight(np.array(SHOWN), dip)
    choices = (False, True) if reproducibility is None else (reproducibility,)
    rounds = len(choices) + (2 if own_drift else 0)
    parts = [None if progress is None else part_of(progress, k / rounds, 1.0 / rounds) for k in range(rounds)]
    multiplier, sd = np.ones(len(used)), 0.0
    tried = []
    for choice, part in zip(choices, parts, strict=False):
        found, steps = _em(data, _start(data, choice), multiplier, acts, weight, tolerance, iterations, part)
        size = len(PARAMETERS) * (len(PARAMETERS) + 1) // 2 if choice else 0
        criterion = 2.0 * size - 2.0 * float(kalman(data, *found, multiplier).likelihood.sum())
        tried.append((criterion, found, steps))
    _, shared, done = min(tried, key=lambda one: one[0])
    for part in parts[len(choices) :]:
        logs = _bank_likelihood(data, shared)
        middle, sd = _multiplier_prior(logs)
        shared, logs = shared._replace(drift=middle * shared.drift), _bank_likelihood(data, shared, middle)
        # a variance is divided by it: the mean of its inverse counts
        multiplier = 1.0 / (_weights(logs, sd) / MULTIPLIERS).sum(axis=1)
        shared, steps = _em(data, shared, multiplier, acts, weight, tolerance, iterations, part)
        done += steps
    if own_drift:
        middle, sd = _multiplier_prior(_bank_likelihood(data, shared))
        shared = shared._replace(drift=middle * shared.drift)
    if progress is not None:
        progress(1.0)
    dates = [day for h in used for day in h.date]
    content = b"".join(h.serial.encode() + h.values.tobytes() + h.covariance.tobytes() for h in used)
    return DriftModel(
        kind,
        frozen(shared.drift),
        frozen(shared.reproducibility),
        frozen(shared.effects),
        share,
        per_year,
        sd,
        dip,
        len(used),
        len(dates),
        min(dates).isoformat(),
        max(dates).isoformat(),
        digest_bytes(content),
        (),
        done,
    )


def _stretched(old: Array, new: Array, by: float) -> Array:
    """Beyond `new` on the way from `old`, among the covariances: old^1/2 (old^-1/2 new old^-1/2)^by old^1/2."""
    if by == 1.0 or not old.any():
        return new
    root = np.linalg.cholesky(old)
    ratio = np.linalg.solve(root, np.linalg.solve(root, new).T)
    values, vectors = np.linalg.eigh((ratio + ratio.T) / 2.0)
    turned = root @ vectors
    return np.asarray((turned * np.clip(values, 1e-6, None) ** by) @ turned.T)


def _em(
    data: Batch,
    shared: _Shared,
    multiplier: Array,
    effects: bool,
    weight: Array,
    tolerance: float,
    iterations: int,
    progress: Callable[[float], None] | None,
) -> tuple[_Shared, int]:
    """EM steps until u(azimuth) of drift and of reproducibility stand still, and how many it took.

    Steps are stretched as long as the likelihood grows (adaptive overrelaxation: Salakhutdinov R., Roweis S., Proc.
    20th Int. Conf. Machine Learning, 2003, 664-671), because EM is slow where the certificates hide the drift.
    """
    calm = 50.0  # nu0: the diagonal counts as so many differences

    def seen(at: _Shared) -> Array:
        both = np.stack([at.drift, at.reproducibility])
        return np.asarray(np.sqrt(np.einsum("npq,mpq->mn", weight, both)))

    before, safe, highest, stretch = seen(shared), shared, -np.inf, 1.0
    still = 0
    for count in range(1, iterations + 1):
        stepped, likelihood = _em_step(data, shared, multiplier, effects, calm)
        if likelihood < highest:  # the last stretch went too far: back to the step it began with
            shared, stretch, highest = safe, 1.0, -np.inf
            continue
        highest, safe = likelihood, stepped
        shared = _Shared(
            _stretched(shared.drift, stepped.drift, stretch),
            _stretched(shared.reproducibility, stepped.reproducibility, stretch),
            shared.effects + stretch * (stepped.effects - shared.effects),
        )
        stretch = min(1.25 * stretch, 8.0)
        if progress is not None:
            progress(count / iterations)
        here = seen(shared)
        still = still + 1 if np.abs(here - before).max() < tolerance * here[0].min() else 0
        before = here
        if still == 3:
            break
    return safe, count


def part_of(progress: Callable[[float], None], start: float, share: float) -> Callable[[float], None]:
    """Progress of a part of the work that begins at `start` and is `share` of it."""
    return lambda done: progress(start + share * done)


def _bank_likelihood(data: Batch, shared: _Shared, middle: float = 1.0) -> Array:
    """Logarithm of the likelihood (n, 9) of each multiplier, times `middle`, for each tool."""
    found = [kalman(data, *shared, np.full(len(data.values), middle * m)).likelihood for m in MULTIPLIERS]
    return np.stack(found, axis=1)


def _prior(sd: float, middle: float = 1.0) -> Array:
    """Log-normal prior on the grid; all on one multiplier where the tools are taken to drift alike."""
    if sd < 1e-6:
        return np.where(np.arange(len(MULTIPLIERS)) == np.argmin(np.abs(np.log(MULTIPLIERS / middle))), 1.0, 0.0)
    found = np.exp(-0.5 * (np.log(MULTIPLIERS / middle) / sd) ** 2)
    return np.asarray(found / found.sum())


def _weights(logs: Array, sd: float) -> Array:
    """Posterior weights (n, 9) of the multipliers; equation (9)."""
    found = _prior(sd) * np.exp(logs - logs.max(axis=1, keepdims=True))
    return np.asarray(found / found.sum(axis=1, keepdims=True))


def _multiplier_prior(logs: Array) -> tuple[float, float]:
    """Median of lambda and standard deviation of its logarithm that make the histories most likely."""
    scaled = np.exp(logs - logs.max(axis=1, keepdims=True))
    # between the points of the grid a single multiplier has no likelihood: the narrowest prior spans two of them
    grid = [(1.0, 0.0)] + [(m, sd) for m in np.exp(np.linspace(-1.2, 1.2, 25)) for sd in np.linspace(0.3, 1.6, 27)]
    found = [float(np.log(scaled @ _prior(sd, m)).sum()) for m, sd in grid]
    middle, sd = grid[int(np.argmax(found))]
    return float(middle), float(sd)


@dataclass(frozen=True, eq=False)
class DriftState:
    """What is known of one tool at a time: a mixture over its multiplier.

    weights : (9,) of `MULTIPLIERS`.
    means, covariances : (9, 24), (9, 24, 24) of the parameters under each.
    """

    weights: Array
    means: Array
    covariances: Array

    @property
    def mean(self) -> Array:
        """(24,) of the mixture."""
        return np.asarray(self.weights @ self.means)

    @property
    def covariance(self) -> Array:
        """(24, 24) of the mixture."""
        off = self.means - self.mean
        return np.asarray(
            np.einsum("j,jpq->pq", self.weights, self.covariances) + (self.weights[:, None] * off).T @ off
        )

    @property
    def multiplier(self) -> float:
        """Expected drift variance of this tool in units of the type's."""
        return float(self.weights @ MULTIPLIERS)

    def predicted(
        self, model: DriftModel, years: float, hours: float = 0.0, doses: Sequence[float] = (0.0, 0.0)
    ) -> DriftState:
        """The state so many years, hours and doses later, without a calibration between; equation (5)."""
        tau = float(model.clock(np.array(years), np.array(hours)))
        grown = (MULTIPLIERS * tau)[:, None, None] * model.drift
        return replace(self, means=self.means + model.effects @ np.asarray(doses), covariances=self.covariances + grown)


def drift_states(histories: Sequence[ToolHistory], model: DriftModel) -> list[list[DriftState]]:
    """State of each tool after each of its calibrations, by the bank of filters; equations (5) and (9).

    Examples
    --------
    >>> from datetime import date
    >>> one = ToolHistory("1", "X", [date(2025, 1, 1)], np.zeros((1, 24)), 1e-8 * np.eye(24)[None])
    >>> zero = np.zeros((24, 24))
    >>> model = DriftModel("X", 1e-6 * np.eye(24), zero, np.zeros((24, 2)), 1.0, 1.0, 0.5, 1.2, 1, 1, "", "", "")
    >>> float(drift_states([one], model)[0][0].covariance[0, 0])
    1e-08
    """
    for one in histories:
        check_record(one, ToolHistory, "drift_states")
    data = batch(histories, model.calendar_share, model.hours_per_year)
    prior = _prior(model.multiplier_sd)
    n, most, p = data.values.shape
    means, covariances = np.zeros((n, most, len(MULTIPLIERS), p)), np.zeros((n, most, len(MULTIPLIERS), p, p))
    logs = np.zeros((n, most, len(MULTIPLIERS)))
    for j in np.flatnonzero(prior > 1e-12):
        done = kalman(data, model.drift, model.reproducibility, model.effects, np.full(n, MULTIPLIERS[j]))
        means[:, :, j], covariances[:, :, j] = done.mean, done.covariance
        for k in range(1, most):
            nu, spread = done.innovation[:, k], done.spread[:, k]
            fits = np.einsum("np,np->n", nu, np.linalg.solve(spread, nu[..., None])[..., 0])
            logs[:, k, j] = -0.5 * (fits + np.linalg.slogdet(spread)[1])
    total = np.cumsum(logs, axis=1)
    total = np.where(prior > 1e-12, total, -np.inf)
    weights = prior * np.exp(total - total.max(axis=2, keepdims=True))
    weights /= weights.sum(axis=2, keepdims=True)
    return [
        [DriftState(weights[i, k], means[i, k], covariances[i, k]) for k in range(len(h))]
        for i, h in enumerate(histories)
    ]
