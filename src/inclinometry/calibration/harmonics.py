"""First and higher harmonics of signals taken at equal steps of one angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite
from inclinometry.calibration.dials import unequal_steps
from inclinometry.errors import out_of_range, refused


@dataclass(frozen=True, eq=False)
class Harmonic:
    """U(psi) = cosine cos(q psi) + sine sin(q psi) + mean, equation (17) for q = 1; each (..., m)."""

    cosine: Array
    sine: Array
    mean: Array

    @property
    def amplitude(self) -> Array:
        """Amplitude (..., m), in the unit of the signals."""
        return np.asarray(np.hypot(self.cosine, self.sine))

    @property
    def phase(self) -> Array:
        """Angle (..., m), rad, of the maximum: U = amplitude cos(q psi - phase) + mean."""
        return np.asarray(np.arctan2(self.sine, self.cosine))


def harmonic_weights(angle: ArrayLike, order: int = 1) -> Array:
    """Weights (3, p) of the signals in the cosine, the sine and the mean; equation (18)."""
    angles = finite(angle, "angle", (None,))
    count = len(angles)
    if order < 1 or 2 * order >= count:
        raise out_of_range("order", order, f"1 .. {(count - 1) // 2}")
    turn = order * angles
    return np.asarray(np.stack([2.0 * np.cos(turn), 2.0 * np.sin(turn), np.ones(count)]) / count)


def harmonics(signals: ArrayLike, angle: ArrayLike, order: int = 1) -> Harmonic:
    """Harmonic of the signals (..., p, m) over a full turn in p equal steps; equations (17), (18) of Rogatykh 2018.

    For any order and start of the steps. At equal steps the sums are the fit of least squares. Order 1 is the field
    itself; order 2 shows non-linearity and unequal turning.
    """
    if (why := unequal_steps(angle)) is not None:
        raise refused("plan-steps", {"why": why})
    weights = harmonic_weights(angle, order)
    values = finite(signals, "signals", (weights.shape[1], None))
    cosine, sine, mean = np.moveaxis(weights @ values, -2, 0)
    return Harmonic(cosine, sine, mean)
