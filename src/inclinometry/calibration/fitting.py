"""Fit a joint model and, where they are not known, the variances that weight it."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.calibration.likelihood import Linear, Model, State
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.variance import (
    Components,
    average_over_variances,
    estimate_components,
    least_noise,
    raised_components,
)
from inclinometry.core.arrays import Array, Mask, finite, within
from inclinometry.core.constants import KINDS
from inclinometry.core.errors import InputError
from inclinometry.core.lsq import levenberg_marquardt

FIRST_RIG_SD = np.radians(0.1)
"""Where the search for the rig's standard deviation starts, rad."""


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
    return fitted if average is None else replace(fitted, covariance=average.covariance)


def expected_variances(fitted: Fitted, free_noise: Set[str], free_rig: bool) -> Model:
    """The fitted model with the means of its variances, which are larger than their likeliest values."""
    average = average_over_variances(fitted.model, fitted.at, fitted.state, free_noise, free_rig)
    if average is None:
        return fitted.model
    kinds = dict(zip(fitted.model.signals, average.factors[:-1].tolist(), strict=True))
    return fitted.model.with_weights(*_scaled(fitted.model, Components(kinds, average.factors[-1], average.factors)))


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
    found = within(np.where(known, sd, FIRST_RIG_SD), "rig_sd", 0.0, np.radians(30.0), "rad")
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
