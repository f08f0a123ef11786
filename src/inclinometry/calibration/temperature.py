"""Temperature campaigns: the degree of the polynomial by which tensor and offset follow temperature."""

from __future__ import annotations

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.likelihood import Model, State
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.undetermined import few_temperatures
from inclinometry.calibration.variance import fit_with_variances
from inclinometry.errors import IdentifiabilityError, out_of_range, refused

HIGHEST_DEGREE = 3


def soaks(temperature: Array) -> int:
    """Number of distinct temperatures, those closer than 2.5 degC to their neighbour being one.

    Examples
    --------
    >>> soaks(np.array([20.1, 20.3, 79.8, 80.2, 40.0]))
    3
    """
    ordered = np.sort(temperature)
    # readings whose temperatures differ by less belong to one soak, degC
    return 1 + int(np.sum(np.diff(ordered) > 2.5))


def choose_powers(readings: BenchReadings, model: Model, start: State, degree: int | None) -> tuple[Array, float]:
    """Powers of temperature (K, degree + 1) for the fit, and the reference temperature in degC.

    The degree is the caller's, or the one with the least Bayesian information criterion among those the soaks allow.
    """
    temperature = readings.temperature
    if degree is not None and not 0 <= degree <= HIGHEST_DEGREE:
        raise out_of_range("temperature_degree", degree, f"0 .. {HIGHEST_DEGREE}")
    if temperature is None:
        if degree:
            raise refused("input-needs", {"name": "temperature_degree", "needed": ("temperature_degC",)})
        return np.ones((len(readings), 1)), 20.0
    reference = float(np.round(temperature.mean(), 3))
    most = min(HIGHEST_DEGREE, soaks(temperature) - 1)
    if degree is not None:
        if degree > most:
            raise IdentifiabilityError(few_temperatures(most + 1, degree))
        return powers_of(temperature, reference, degree), reference
    # each further power has to be seen by more readings than it has parameters
    sensors = sum(v.shape[1] for v in model.signals.values())
    most = min(most, (model.signals[next(iter(model.signals))].shape[0] * sensors - 8) // (4 * sensors) - 1)
    if most < 1:
        return np.ones((len(readings), 1)), reference
    # degree with the least chi-square plus p log n, the variances being those of the highest degree
    highest = model.with_powers(start, powers_of(temperature, reference, most))
    full = fit_with_variances(*highest, frozenset(model.signals), bool(model.rig_sd.any()))
    criteria = []
    for degree in range(most + 1):
        trial, state = model.with_powers(start, powers_of(temperature, reference, degree))
        fitted = fit_with_variances(
            trial.with_weights(full.model.noise_sd, full.model.rig_sd), state, frozenset(), False
        )
        criteria.append(fitted.cost + fitted.at.jacobian.shape[2] * np.log(fitted.at.residual.size))
    return powers_of(temperature, reference, int(np.argmin(criteria))), reference


def powers_of(temperature: Array, reference: float, degree: int) -> Array:
    """Powers 0..degree of (T - reference), shape (K, degree + 1)."""
    return np.asarray((temperature - reference)[:, None] ** np.arange(degree + 1))
