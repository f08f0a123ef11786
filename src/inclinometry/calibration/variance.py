"""Variance components: how noisy the sensors are and how well the rig was set, told by the readings themselves.

Restricted maximum likelihood on the linearised model, V = sum_i f_i V_i, by Fisher scoring on the factors f_i. The
restriction matters: a bench run has few readings for its many parameters, and plain maximum likelihood would claim a
third less noise than there is.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass

import numpy as np

from inclinometry.calibration.likelihood import Linear, Model, State
from inclinometry.core.arrays import Array, Mask


@dataclass(frozen=True, eq=False)
class Components:
    """Factors on the model's present variances, and the standard uncertainty of each."""

    noise: dict[str, float]  # kind -> factor on the noise variance
    rig: float  # factor on the rig variance
    relative_sd: Array  # (n,) standard uncertainty of each factor relative to the factor


class _Restricted:
    """Restricted likelihood of one linearised model; everything is done station by station."""

    def __init__(self, at: Linear, errors: Array, prior: Array, parts: list[Array]) -> None:
        self.jacobian, self.prior, self.parts = at.jacobian, prior, parts
        # the residual without the estimated rig errors, since V accounts for them
        self.residual = at.residual - (at.by_setting @ errors[..., None])[..., 0]

    def evaluate(self, factors: Array) -> tuple[float, Array, Array]:
        """Twice the negative log likelihood, its gradient by factor, and the expected information (n, n)."""
        covariance = np.tensordot(factors, np.stack(self.parts), axes=1)
        inverse: Array = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
        sign_free = np.linalg.slogdet(covariance)[1].sum()
        weighted = inverse @ self.jacobian  # V^-1 J
        normal = np.tensordot(self.jacobian, weighted, axes=([0, 1], [0, 1])) + self.prior
        scale = 1.0 / np.sqrt(np.diagonal(normal))
        unit = normal * np.outer(scale, scale)
        inner = np.asarray(np.linalg.pinv(unit, rcond=1e-13, hermitian=True) * np.outer(scale, scale))
        white = (inverse @ self.residual[..., None])[..., 0]
        pull = inner @ np.tensordot(weighted, self.residual, axes=([0, 1], [0, 1]))
        projected = white - weighted @ pull  # P r
        eigen = np.linalg.eigvalsh(unit)
        log_normal = np.log(eigen[eigen > 1e-13 * eigen[-1]]).sum() - 2.0 * np.log(scale).sum()
        value = float(sign_free + log_normal + np.sum(self.residual * projected))
        gradient, information = self._derivatives(inverse, weighted, inner, projected)
        return value, gradient, information

    def _derivatives(self, inverse: Array, weighted: Array, inner: Array, projected: Array) -> tuple[Array, Array]:
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
        return gradient, information


def estimate_components(model: Model, at: Linear, state: State, free_noise: Set[str], free_rig: bool) -> Components:
    """Factors by which the model's variances must be multiplied to agree with the readings.

    Parameters
    ----------
    model, at, state : the model, its linearisation and the state of the fit
    free_noise : kinds whose noise may change
    free_rig : whether the variance of the settings may
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
    spread = at.by_setting * model.rig_sd
    parts.append(spread @ spread.swapaxes(1, 2))
    free = np.array([*(kind in free_noise for kind in model.signals), free_rig and bool(model.rig_sd.any())])
    return _Restricted(at, state.errors, model.prior_information(state), parts), free


def _components(model: Model, factors: Array, relative_sd: Array) -> Components:
    return Components(dict(zip(model.signals, factors[:-1].tolist(), strict=True)), float(factors[-1]), relative_sd)


def _relative_sd(information: Array, factors: Array, free: Mask) -> Array:
    """Standard uncertainty of each free factor relative to it; NaN for the others."""
    spread = np.full(len(factors), np.nan)
    diagonal = np.diagonal(information) * factors**2
    spread[free] = 1.0 / np.sqrt(np.maximum(diagonal[free], 1e-12))
    return spread


_FLOOR = 1e-8
"""A rig variance this far below its starting value is called perfect."""

LEAST_NOISE = 1e-8
"""Share of a channel's range below which its noise is rounding; less would leave no digits for the rig's part."""


def least_noise(signals: Array) -> Array:
    """Least standard deviation (m,) that channels (K, m) are taken to have."""
    return np.asarray(np.maximum(LEAST_NOISE * np.ptp(signals, axis=0), np.finfo(float).tiny))


def _floors(model: Model) -> Array:
    """Least factor of each variance: rounding for the noise, what is called perfect for the rig."""
    floors, start = [], 0
    for signals in model.signals.values():
        sd = model.noise_sd[:, start : start + signals.shape[1]]
        start += signals.shape[1]
        floors.append(max(_FLOOR, min(1.0, float(np.max(least_noise(signals) / sd) ** 2))))
    return np.array([*floors, _FLOOR])


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
