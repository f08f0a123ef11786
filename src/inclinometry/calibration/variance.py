"""Variance components: how noisy the sensors are and how well the rig was set, told by the readings themselves.

Restricted maximum likelihood on the linearised model, V = sum_i f_i V_i, by Fisher scoring on the factors f_i. The
restriction matters: a bench run has few readings for its many parameters, and plain maximum likelihood would claim a
third less noise than there is.
"""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Mask, finite, within
from inclinometry.calibration.likelihood import Linear, Model, State
from inclinometry.calibration.readings import BenchReadings
from inclinometry.constants import KINDS
from inclinometry.errors import InputError
from inclinometry.least_squares import levenberg_marquardt


@dataclass(frozen=True, eq=False)
class Components:
    """Factors on the model's present variances, and the standard uncertainty of each."""

    noise: dict[str, float]  # kind -> factor on the noise variance
    rig: float  # factor on the rig variance
    relative_sd: Array  # (n,) standard uncertainty of each factor relative to the factor


class _Restricted:
    """Restricted likelihood of one linearised model; everything is done station by station."""

    def __init__(self, at: Linear, errors: Array, prior: Array, parts: list[Array], fixed: Array) -> None:
        self.jacobian, self.prior, self.parts, self.stacked = at.jacobian, prior, parts, np.stack(parts)
        self.fixed = fixed  # of the dials whose standard deviation was stated
        # the residual without the estimated rig errors, since V accounts for them
        self.residual = at.residual - (at.by_setting @ errors[..., None])[..., 0]

    def evaluate(self, factors: Array) -> tuple[float, Array, Array]:
        """Twice the negative log likelihood, its gradient by factor, and the expected information (n, n)."""
        value, inner, shift, inverse, weighted = self.solve(factors)
        projected = (inverse @ self.residual[..., None])[..., 0] - weighted @ shift
        whitened = [inverse @ part for part in self.parts]  # V^-1 V_i
        middles = [np.tensordot(weighted, part @ weighted, axes=([0, 1], [0, 1])) for part in self.parts]
        gradient = np.array(
            [
                np.trace(w, axis1=1, axis2=2).sum()
                - np.sum(inner * m)
                - np.sum(projected * (part @ projected[..., None])[..., 0])
                for w, m, part in zip(whitened, middles, self.parts, strict=True)
            ]
        )
        size = len(self.parts)
        information: Array = np.zeros((size, size))
        for i in range(size):
            for j in range(i + 1):
                pair = np.sum(whitened[i] * whitened[j].swapaxes(1, 2))
                product = self.parts[i] @ inverse @ self.parts[j]
                cross = np.tensordot(weighted, product @ weighted, axes=([0, 1], [0, 1]))
                both = np.sum((inner @ middles[i]) * (inner @ middles[j]).T)
                information[i, j] = information[j, i] = 0.5 * (pair - 2.0 * np.sum(inner * cross) + both)
        return value, gradient, information

    def solve(self, factors: Array) -> tuple[float, Array, Array, Array, Array]:
        """Generalised least squares for given factors.

        Twice the negative restricted log likelihood, covariance (p, p) of the parameters, parameters (p,) of the
        linearisation minus estimate, V^-1 (K, M, M), V^-1 J (K, M, p).
        """
        covariance = np.tensordot(factors, self.stacked, axes=1) + self.fixed
        inverse = np.asarray(np.linalg.inv(covariance))
        spread = np.linalg.slogdet(covariance)[1].sum()
        weighted = inverse @ self.jacobian  # V^-1 J
        normal = np.tensordot(self.jacobian, weighted, axes=([0, 1], [0, 1])) + self.prior
        scale = 1.0 / np.sqrt(np.diagonal(normal))
        unit = normal * np.outer(scale, scale)
        inner = np.asarray(np.linalg.pinv(unit, rcond=1e-13, hermitian=True) * np.outer(scale, scale))
        shift = inner @ np.tensordot(weighted, self.residual, axes=([0, 1], [0, 1]))
        eigen = np.linalg.eigvalsh(unit)
        log_normal = np.log(eigen[eigen > 1e-13 * eigen[-1]]).sum() - 2.0 * np.log(scale).sum()
        misfit = np.sum(self.residual * ((inverse @ self.residual[..., None])[..., 0] - weighted @ shift))
        return float(spread + log_normal + misfit), inner, shift, inverse, weighted


def estimate_components(model: Model, at: Linear, state: State, free_noise: Set[str], free_rig: bool) -> Components:
    """Factors by which the model's variances must be multiplied to agree with the readings.

    Parameters
    ----------
    model, at, state : the model, its linearisation and the state of the fit
    free_noise : kinds whose noise may change
    free_rig : whether the variance of the settings may, where it was not stated
    """
    likelihood, free = _restricted(model, at, state, free_noise, free_rig)
    factors, information = _maximise(likelihood, np.ones(len(free)), free, _floors(model))
    return _components(model, factors, _relative_sd(information, factors, free))


def raised_components(model: Model, at: Linear, state: State, free_noise: Set[str], free_rig: bool) -> Components:
    """Factors that raise estimated variances as far as they may well be: by twice their uncertainty.

    A variance hidden behind another one may be estimated many times too small; raised, it is better seen, and its
    uncertainty there tells how well it is bounded from above. Arguments as for `estimate_components`.
    """
    likelihood, free = _restricted(model, at, state, free_noise, free_rig)
    ones = np.ones(len(free))
    relative = _relative_sd(likelihood.evaluate(ones)[2], ones, free)
    factors = np.where(relative < 10.0, np.exp(np.minimum(2.0 * relative, 3.0)), 1.0)
    return _components(model, factors, _relative_sd(likelihood.evaluate(factors)[2], factors, free))


def average_over_variances(
    model: Model, at: Linear, state: State, free_noise: Set[str], free_rig: bool
) -> tuple[Array, Array] | None:
    """Covariance (p, p) of the parameters averaged over what the readings leave open about the variances.

    Beside it the mean factors (n,) on the present variances: noise of each kind, rig.

    An estimated variance put in as if it were known makes a short run look better than it is: in twelve positions one
    run in three would be off by more than its 95 % region. The covariance is averaged over the variances' posterior
    (restricted likelihood, flat in the logarithm, which gives Student's t where there is one variance), the estimates'
    own dependence on the variances included, by importance sampling with fixed random numbers. None where the variances
    are known. Arguments as for `estimate_components`; `model` holds the estimated variances.
    """
    likelihood, free = _restricted(model, at, state, free_noise, free_rig)
    if not free.any():
        return None
    ones = np.ones(len(free))
    index = np.flatnonzero(free)
    information = likelihood.evaluate(ones)[2][np.ix_(index, index)]
    open_sd = 2.0  # of the prior on the logarithm of a variance about its estimate
    # a variance the readings say nothing of may be anything within a factor of e^2 or so, not everything
    spread = np.linalg.inv(information + np.eye(len(index)) / open_sd**2)
    # relative uncertainty of the variances below which averaging over them changes nothing worth its time
    if np.sqrt(spread.diagonal().max()) < 0.03:
        return None
    generator = np.random.default_rng(0)
    dof = 4.0  # of the sampling density, heavier in the tails than the posterior
    draws = 128  # sets of variances over which a covariance is averaged
    normal = generator.standard_normal((draws, len(index)))
    tail = np.sqrt(dof / generator.chisquare(dof, draws))
    steps = (normal * tail[:, None]) @ np.linalg.cholesky(spread).T
    density = -0.5 * (dof + len(index)) * np.log1p(np.sum((normal * tail[:, None]) ** 2, axis=1) / dof)
    floors = _floors(model)
    total, means, weight, best = 0.0, np.zeros(len(free)), 0.0, likelihood.solve(ones)[0]
    for step, log_density in zip(steps, density, strict=True):
        factors = ones.copy()
        factors[index] = np.maximum(np.exp(step), floors[index])
        value, inner, shift, _, _ = likelihood.solve(factors)
        share = np.exp(np.clip(-0.5 * (value - best) - log_density - 0.5 * np.sum((step / open_sd) ** 2), -700, 50))
        total = total + share * (inner + np.outer(shift, shift))
        means, weight = means + share * factors, weight + share
    return np.asarray(total / weight), means / weight


def _restricted(
    model: Model, at: Linear, state: State, free_noise: Set[str], free_rig: bool
) -> tuple[_Restricted, Mask]:
    """The restricted likelihood by factors on the model's variances, and which of them may change."""
    counts = [signals.shape[1] for signals in model.signals.values()]
    diagonal = np.arange(sum(counts))
    parts, start = [], 0
    for count in counts:
        part = np.zeros((len(at.residual), len(diagonal), len(diagonal)))
        rows = diagonal[start : start + count]
        part[:, rows, rows] = model.noise_sd[:, rows] ** 2
        parts.append(part)
        start += count
    open_sd = np.where(model.rig_known, 0.0, model.rig_sd)
    spread, stated = at.by_setting * open_sd, at.by_setting * np.where(model.rig_known, model.rig_sd, 0.0)
    parts.append(spread @ spread.swapaxes(1, 2))
    free = np.array([*(kind in free_noise for kind in model.signals), free_rig and bool(open_sd.any())])
    fixed = stated @ stated.swapaxes(1, 2)
    return _Restricted(at, state.errors, model.prior_information(state), parts, fixed), free


def _components(model: Model, factors: Array, relative_sd: Array) -> Components:
    return Components(dict(zip(model.signals, factors[:-1].tolist(), strict=True)), float(factors[-1]), relative_sd)


def _relative_sd(information: Array, factors: Array, free: Mask) -> Array:
    """Standard uncertainty of each free factor relative to it; NaN for the others."""
    spread = np.full(len(factors), np.nan)
    diagonal = np.diagonal(information) * factors**2
    spread[free] = 1.0 / np.sqrt(np.maximum(diagonal[free], 1e-12))
    return spread


def least_noise(signals: Array) -> Array:
    """Least standard deviation (m,) that channels (K, m) are taken to have."""
    # share of a channel's range below which its noise is rounding; less would leave no digits for the rig's part
    return np.asarray(np.maximum(1e-8 * np.ptp(signals, axis=0), np.finfo(float).tiny))


def _floors(model: Model) -> Array:
    """Least factor of each variance: rounding for the noise, what is called perfect for the rig."""
    floors, start = [], 0
    rounding = np.broadcast_to(model.rounding, model.noise_sd.shape)
    floor = 1e-8  # a rig variance this far below its starting value is called perfect
    for signals in model.signals.values():
        here = slice(start, start + signals.shape[1])
        start += signals.shape[1]
        sd = model.noise_sd[:, here]
        least = max(np.max(least_noise(signals) / sd), np.min(rounding[:, here] / sd))
        floors.append(max(floor, min(1.0, float(least**2))))
    return np.array([*floors, floor])


def _maximise(likelihood: _Restricted, factors: Array, free: Mask, floors: Array) -> tuple[Array, Array]:
    """Fisher scoring with halved steps inside factors >= floors; the factors and their information (n, n)."""
    value, gradient, information = likelihood.evaluate(factors)
    for _ in range(60):
        # a factor at its floor with the likelihood falling upwards stays there
        active = free & ~((factors <= floors) & (gradient > 0.0))
        if not active.any():
            break
        index = np.flatnonzero(active)
        scaled = information[np.ix_(index, index)] * np.outer(factors[index], factors[index])
        slope = -0.5 * gradient[index] * factors[index]
        relative = np.linalg.lstsq(scaled, slope, rcond=1e-10)[0]
        step = np.clip(relative, -0.9, 9.0) * factors[index]
        if np.abs(relative).max() < 1e-4:
            break
        length = 1.0
        while length > 1e-4:
            trial = factors.copy()
            trial[index] = np.maximum(factors[index] + length * step, floors[index])
            result = likelihood.evaluate(trial)
            if result[0] < value:
                break
            length /= 2.0
        else:
            break
        done = value - result[0] < 1e-6
        factors, (value, gradient, information) = trial, result
        if done:
            break
    return factors, information


# Fit a joint model and, where they are not known, the variances that weight it.


@dataclass(frozen=True, eq=False)
class Fitted:
    """A joint model at its maximum."""

    model: Model
    state: State
    covariance: Array
    cost: float
    at: Linear
    variance_freedom: Array | None = None  # degrees of freedom of each variance: noise of each kind, rig

    @property
    def degrees_of_freedom(self) -> int:
        """Readings minus parameters; the rig errors are random, not parameters."""
        return int(self.at.residual.size - self.at.jacobian.shape[2])

    @property
    def tangents(self) -> Array:
        """Covariance of the field directions, two tangent angles a triad in the order of the state, rad^2."""
        blocks = list(self.model.columns()[1].values())
        return self.covariance[blocks[0].start : blocks[-1].stop, blocks[0].start : blocks[-1].stop]

    def marginal_residual(self) -> Array:
        """Model minus reading (K, M) at the settings as dialled, to first order."""
        return np.asarray(self.at.residual - (self.at.by_setting @ self.state.errors[..., None])[..., 0])


def fit(model: Model, start: State) -> Fitted:
    """Maximum likelihood for given variances."""
    found = levenberg_marquardt(model.normal, start, model.retract)
    return Fitted(model, found.estimate, found.covariance, found.cost, model.linearise(found.estimate))


def fit_with_variances(model: Model, start: State, free_noise: Set[str], free_rig: bool) -> Fitted:
    """Fit, let the residuals correct the variances that may change, fit again until they agree."""
    here = fit(model, start)
    if not (free_noise or free_rig):
        return here
    digits = np.concatenate([least_noise(v) for v in model.signals.values()])
    # of a noise that was stated the rounding is a part
    estimated = np.concatenate([np.full(v.shape[1], kind in free_noise) for kind, v in model.signals.items()])
    smallest = np.maximum(digits, np.where(estimated, model.rounding, 0.0))
    for _ in range(8):
        parts = estimate_components(here.model, here.at, here.state, free_noise, free_rig)
        noise_sd, rig_sd = _scaled(here.model, parts)
        rig_sd = np.where((rig_sd < 1e-9) & ~here.model.rig_known, 0.0, rig_sd)
        here = fit(here.model.with_weights(np.maximum(noise_sd, smallest), rig_sd), here.state)
        changes = [*parts.noise.values(), parts.rig if rig_sd[~here.model.rig_known].any() else 1.0]
        if np.abs(np.log(changes)).max() < 0.02:
            break
    return here


def fit_with_caution(fitted: Fitted, free_noise: Set[str], free_rig: bool) -> Fitted:
    """The same fit with its estimated variances as large as they may well be, and how well each of them is known."""
    parts = raised_components(fitted.model, fitted.at, fitted.state, free_noise, free_rig)
    raised = fit(fitted.model.with_weights(*_scaled(fitted.model, parts)), fitted.state)
    # a variance with relative uncertainty s is as well known as one from 2/s^2 degrees of freedom
    known = np.where(parts.relative_sd < 10.0, parts.relative_sd, 0.0)
    return replace(raised, variance_freedom=2.0 / np.maximum(known, 1e-3) ** 2)


def with_averaged_covariance(fitted: Fitted, free_noise: Set[str], free_rig: bool) -> Fitted:
    """The same fit, its covariance averaged over what is not known of the estimated variances."""
    average = average_over_variances(fitted.model, fitted.at, fitted.state, free_noise, free_rig)
    return fitted if average is None else replace(fitted, covariance=average[0])


def expected_variances(fitted: Fitted, free_noise: Set[str], free_rig: bool) -> Model:
    """The fitted model with the means of its variances, which are larger than their likeliest values."""
    average = average_over_variances(fitted.model, fitted.at, fitted.state, free_noise, free_rig)
    if average is None:
        return fitted.model
    factors = average[1]
    kinds = dict(zip(fitted.model.signals, factors[:-1].tolist(), strict=True))
    return fitted.model.with_weights(*_scaled(fitted.model, Components(kinds, factors[-1], factors)))


def _scaled(model: Model, parts: Components) -> tuple[Array, Array]:
    """Standard deviations of noise and rig after their variances are multiplied."""
    factors = np.concatenate([np.full(v.shape[1], parts.noise[k]) for k, v in model.signals.items()])
    return model.noise_sd * np.sqrt(factors), model.rig_sd * np.where(model.rig_known, 1.0, np.sqrt(parts.rig))


def rig_guess(given: ArrayLike | None) -> tuple[Array, Mask]:
    """Standard deviations (3,) of a setting to start with, rad, and which of them were stated; NaN is not."""
    sd = np.asarray(np.nan if given is None else given, dtype=np.float64)
    if sd.shape not in ((), (3,)):
        raise InputError(f"rig_sd has shape {sd.shape}; give one value, or three for azimuth, inclination, toolface")
    known = np.broadcast_to(~np.isnan(sd) | (given is not None and sd.ndim == 0), (3,))
    # where the search for the rig's standard deviation starts, rad
    found = within(np.where(known, sd, np.radians(0.1)), "rig_sd", 0.0, np.radians(30.0), "rad")
    return found, known


def noise_guess(
    readings: BenchReadings, given: Mapping[str, object] | None, residual: Array
) -> tuple[Array, frozenset[str]]:
    """Standard deviations (K, M) to start with and the kinds whose noise the fit may change.

    A value given by the caller wins, then the standard deviations of the readings; otherwise a third of the starting
    residual, to be corrected by the variance components.
    """
    unknown = set(given or {}) - set(KINDS)
    if unknown:
        raise InputError(f"noise_sd names {sorted(unknown)[0]!r}; allowed: {', '.join(KINDS)}")
    columns, free, start = [], [], 0
    size = len(readings)
    for kind, values in readings.channels.items():
        count = values.shape[1]
        rms = np.sqrt(np.mean(residual[:, start : start + count] ** 2)) / 3.0
        start += count
        least = least_noise(values)
        if given is not None and kind in given:
            sd = finite(given[kind], f"{kind} noise sd")  # type: ignore[arg-type]
            if sd.shape not in ((), (count,), (size, count)) or (sd <= 0.0).any():
                raise InputError(
                    f"{kind} noise sd is {sd}; it must be positive, one value or one for each of {count} sensors"
                )
            columns.append(np.broadcast_to(sd, (size, count)))
        elif kind in readings.sd and (readings.sd[kind] > 0.0).any():
            # a mean of identical readings is still only known to the converter's step
            sd = np.hypot(readings.sd[kind], readings.rounding(kind))
            # nor is a mean without scatter exact where that step is unknown: it is taken as good as the others
            columns.append(np.where(sd > 0.0, sd, np.sqrt(np.mean(sd[sd > 0.0] ** 2))))
        else:
            columns.append(np.maximum(np.maximum(rms, least), readings.rounding(kind)))
            free.append(kind)
    return np.concatenate(columns, axis=1), frozenset(free)
