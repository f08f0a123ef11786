"""The norm-only fit as a calibration record: triads in their own axes, where there is neither rig nor roll set."""

from __future__ import annotations

import numpy as np

from inclinometry.calibration.norm import NormFit, calibrate_norm
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration, Residuals, Rig
from inclinometry.core.arrays import Array
from inclinometry.core.constants import STANDARD_GRAVITY
from inclinometry.core.errors import InputError
from inclinometry.sensors.tool import Tool, parameter_names

_UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def calibrate_norms(
    readings: BenchReadings, *, specific_force: bool = False, gravity: float = STANDARD_GRAVITY, name: str = "unnamed"
) -> Calibration:
    """Calibrate each triad by the constant strength of its field, in its own axes.

    Parameters
    ----------
    readings : BenchReadings
        At rest in nine or more distinct attitudes; angles are not used. The strengths are the readings' reference `g`
        and `b` where known.
    specific_force : bool
        The accelerometer reads +1 g upwards at rest.
    gravity : float
        Strength for the accelerometer when the readings do not state it, m/s^2.

    Returns
    -------
    Calibration
        Method "norm". The rotation from sensor to tool axes and between triads is not in such data: each tensor is
        upper triangular, and angles computed with it mean nothing in a tool. Strengths, scale and offsets do.

    Raises
    ------
    InputError
        A triad that has not three sensors, or a gyro.
    IdentifiabilityError
        Attitudes that do not determine an ellipsoid.
    """
    if set(readings.channels) - {"accelerometer", "magnetometer"}:
        raise InputError("a gyro at rest sees no constant field of use; drop its columns for a norm-only fit")
    fits, triads, noise, size = {}, {}, {}, 0
    for kind, signals in readings.channels.items():
        strength = readings.reference.get("g", gravity) if kind == "accelerometer" else readings.reference.get("b", 1.0)
        # unweighted: what errs at one pose is common to all its samples, so a longer rest is not a better one
        fit = calibrate_norm(signals, strength)
        fits[kind] = fit
        triads[kind] = fit.triad(kind, readings.units[kind], specific_force=specific_force and kind == "accelerometer")
        noise[kind] = fit.rms / strength * np.linalg.norm(fit.tensor, axis=1)
        size += 12
    covariance = np.zeros((size, size))
    for place, (kind, fit) in enumerate(fits.items()):
        sign = -1.0 if specific_force and kind == "accelerometer" else 1.0
        jacobian = _to_tensor(fit, sign)
        here = slice(12 * place, 12 * place + 12)
        covariance[here, here] = jacobian @ fit.covariance @ jacobian.T
    heat = readings.temperature
    span = None if heat is None else (float(heat.min()), float(heat.max()))
    tool = Tool(name, triads, covariance, noise, span)
    warnings = ["norm-only fit: the rotation from sensor to tool axes is unknown; use a rig or roll sets for angles"]
    warnings += [f"{kind}: {sentence}" for kind, fit in fits.items() for sentence in fit.warnings]
    coverage = [
        f"{kind}: {fit.distinct} distinct directions (5 deg apart) in {len(readings)} readings, the lengths of "
        f"the field scatter by {100.0 * fit.rms / fit.strength:.2g} %"
        for kind, fit in fits.items()
    ]
    return Calibration(
        tool,
        "norm",
        {"readings": readings.digest},
        {},
        tuple(n for triad in triads.values() for n in parameter_names(triad)),
        covariance,
        Rig(np.zeros(3)),
        _residuals(readings, fits),
        (*readings.warnings, *warnings),
        notes=(*readings.notes, *coverage),
    )


def _to_tensor(fit: NormFit, sign: float) -> Array:
    """Derivatives (12, 9) of tensor and offset by the fit's parameters: N = s B^-1, dN = -s B^-1 dB B^-1."""
    inverse = np.linalg.inv(fit.inverse)
    jacobian = np.zeros((3, 4, 9))
    for column, (i, j) in enumerate(_UPPER):
        jacobian[:, :3, column] = -sign * fit.strength * np.outer(inverse[:, i], inverse[j])
    jacobian[:, 3, 6:] = np.eye(3)
    return jacobian.reshape(12, 9)


def _residuals(readings: BenchReadings, fits: dict[str, NormFit]) -> Residuals:
    """What is left along the field: attitude is free, so nothing is left across it."""
    values, scaled = {}, {}
    leverage = np.zeros(len(readings))
    for kind, fit in fits.items():
        direction = fit.field(readings.channels[kind])
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        values[kind] = fit.residual[:, None] / fit.strength * (direction @ fit.tensor.T)
        sd = max(fit.rms * np.sqrt(len(readings) / max(len(readings) - 9, 1)), np.finfo(float).tiny)
        scaled[kind] = np.repeat(fit.residual[:, None] / sd, 3, axis=1)
        leverage += 9.0 / len(readings) / len(fits)
    return Residuals(tuple(readings.station), values, scaled, leverage)
