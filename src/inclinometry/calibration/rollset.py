"""What one roll set says about itself: first harmonic, second harmonic, and what is left over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array, finite, frozen
from inclinometry.core.errors import IdentifiabilityError, InputError


@dataclass(frozen=True, eq=False)
class RollHarmonics:
    """Harmonics of one signal over one roll set: D = offset + amplitude sin(roll + phase) + residual.

    offset, amplitude : in the signal's unit.
    phase : rad, in [-pi, pi).
    second_amplitude, second_phase : the same of the second harmonic, sin(2 roll + second_phase); a roll-angle error
        or a non-linear sensor shows here. None when there are too few rolls (fewer than 6 distinct) to tell.
    residual : (K,) signal minus offset and FIRST harmonic.
    residual_rms : root of the residual's sum of squares over K - 3 degrees of freedom, an unbiased noise level; 0 for
        three rolls, which leave nothing over.
    residual_max : largest absolute residual.
    offset_sd, amplitude_sd, phase_sd : standard uncertainties from the residual scatter; 0 for three rolls.
    """

    offset: float
    amplitude: float
    phase: float
    second_amplitude: float | None
    second_phase: float | None
    residual: Array
    residual_rms: float
    residual_max: float
    offset_sd: float
    amplitude_sd: float
    phase_sd: float


def roll_harmonics(roll: ArrayLike, signal: ArrayLike) -> RollHarmonics:
    """Fit offset and harmonics of a signal over a roll set; the rolls need not be equally spaced.

    Parameters
    ----------
    roll : (K,) array_like
        Roll (toolface) angles, rad; at least three distinct ones.
    signal : (K,) array_like
        One channel, any unit.

    Returns
    -------
    RollHarmonics

    Raises
    ------
    InputError
        Shapes that do not go together.
    IdentifiabilityError
        Fewer than three distinct rolls, or rolls so close together that offset and amplitude cannot be told apart.

    Notes
    -----
    For equally spaced rolls the least squares equals the discrete Fourier sums, equations (21)-(22) of Rogatykh N.P.,
    "Identification of parameters of inclinometer sensors", 2018.

    Examples
    --------
    >>> roll = np.radians([0, 90, 180, 270])
    >>> fit = roll_harmonics(roll, 5 + 2 * np.sin(roll + 0.5))
    >>> round(fit.offset, 9), round(fit.amplitude, 9), round(fit.phase, 9)
    (5.0, 2.0, 0.5)
    """
    angle, values = finite(roll, "roll", (None,)), finite(signal, "signal", (None,))
    if angle.ndim != 1 or angle.shape != values.shape:
        raise InputError(f"roll has shape {angle.shape} and signal {values.shape}; expected (K,) each")
    distinct = len(np.unique(np.round(np.mod(angle, 2.0 * np.pi), 6)))
    if distinct < 3:
        raise IdentifiabilityError(f"{distinct} distinct rolls; offset, amplitude and phase need at least 3")
    design = _design(angle, 1)
    solution, _, _, singular = np.linalg.lstsq(design, values)
    if singular[-1] < 1e-3 * singular[0]:
        span = np.degrees(np.ptp(angle))
        raise IdentifiabilityError(
            f"the rolls span only {span:.3g} deg; offset and amplitude cannot be told apart: turn the tool through more"
        )
    residual = values - design @ solution
    freedom = len(values) - 3
    variance = float(residual @ residual) / freedom if freedom else 0.0
    offset, cosine, sine = (float(v) for v in solution)
    amplitude = float(np.hypot(cosine, sine))
    covariance = variance * np.linalg.inv(design.T @ design)
    size = max(amplitude, np.finfo(float).tiny ** 0.25)  # a constant signal has no phase; its uncertainty is huge
    slope = np.array([[1.0, 0.0, 0.0], [0.0, cosine / size, sine / size], [0.0, sine / size**2, -cosine / size**2]])
    sds = np.sqrt(np.diagonal(slope @ covariance @ slope.T))
    second = _second(angle, values) if distinct >= 6 else (None, None)
    return RollHarmonics(
        offset,
        amplitude,
        float(np.arctan2(cosine, sine)),
        *second,
        frozen(residual),
        float(np.sqrt(variance)),
        float(np.abs(residual).max()),
        *(float(s) for s in sds),
    )


def _design(angle: Array, order: int) -> Array:
    """Columns 1, cos, sin, cos 2, sin 2, ... of the angle."""
    columns = [np.ones_like(angle)]
    for n in range(1, order + 1):
        columns += [np.cos(n * angle), np.sin(n * angle)]
    return np.stack(columns, axis=-1)


def _second(angle: Array, values: Array) -> tuple[float | None, float | None]:
    """Amplitude and phase of the second harmonic, fitted together with the first; None where the rolls cannot tell."""
    solution, _, _, singular = np.linalg.lstsq(_design(angle, 2), values)
    if singular[-1] < 1e-3 * singular[0]:
        return None, None
    return float(np.hypot(solution[3], solution[4])), float(np.arctan2(solution[3], solution[4]))
