"""Equivalent weights of robust estimation: what a reading counts for, given how far it is from what was expected.

The departure t is normalised: residual or innovation over its standard deviation; for an innovation v of m components
with covariance S, t = sqrt(v' S^-1 v / m). A weight w multiplies the reading's weight, i.e. divides its covariance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite, within
from inclinometry.errors import out_of_range, wrong_shape


def huber_weight(t: ArrayLike, k: float = 1.345) -> Array:
    """Huber's weight of normalised departures t: 1 up to k, k/|t| beyond; no reading is rejected.

    k 1 to 2; 1.345 keeps 95 % of the efficiency of least squares with Gaussian errors. psi(t) = w t is the score of a
    density Gaussian in the middle with exponential tails: a gross error still shifts the estimate by k standard
    deviations' worth (Huber P.J., Ann. Math. Statist. 35, 1964, pp. 73-101).
    """
    within(k, "k", 1e-6, 1e6)
    size = np.abs(finite(t, "t"))
    return np.asarray(k / np.maximum(size, k))


def igg3_weight(t: ArrayLike, k0: float = 1.5, k1: float = 4.0) -> Array:
    """IGG-III weight: 1 up to k0, k0/|t| ((k1 - |t|)/(k1 - k0))^2 to k1, 0 beyond (published: 1 to 1.5, 2.5 to 8).

    The first factor is Huber's weight; the second takes the influence psi = w t back to 0 with a slope that ends at 0.
    psi redescends, so the solution depends on its start: use it where a prediction gives one (Yang Y., Song L., Xu T.,
    J. Geodesy 76, 2002, pp. 353-358).
    """
    within(k0, "k0", 1e-6, 1e6)
    within(k1, "k1", 1e-6, 1e6)
    if not k0 < k1:
        raise out_of_range("k1", float(k1), f"> {k0:g} (k0)")
    size = np.abs(finite(t, "t"))
    fall = np.clip((k1 - size) / (k1 - k0), 0.0, 1.0) ** 2
    return np.asarray(k0 / np.maximum(size, k0) * fall)


# How far a filter believes its own prediction and its stated noise: adaptive factors, Sage-Husa, strong tracking.


def yang_factor_two(departure: ArrayLike, c: float = 1.5) -> Array:
    """Adaptive factor of two sections: 1 up to c, c/|d| beyond; the predicted covariance is divided by it.

    d: of a robust estimate from readings alone from the prediction, over its standard deviation; c 1 to 2.5 (Yang Y.,
    He H., Xu G., J. Geodesy 75, 2001, pp. 109-116; Yang Y., Xu T., J. Navigation 56, 2003, pp. 231-240). The same
    shape as Huber's weight, turned on the prediction.
    """
    return huber_weight(departure, c)


def yang_factor_three(departure: ArrayLike, c0: float = 1.5, c1: float = 5.0) -> Array:
    """Adaptive factor of three sections: 1 up to c0, falling to 0 at c1, where the prediction is dropped.

    c0/|d| ((c1 - |d|)/(c1 - c0))^2 between the limits (published: 1 to 1.5, 3 to 8.5; Yang, He, Xu 2001). At 0 the
    epoch is solved from its readings alone; a filter needs a positive floor.
    """
    return igg3_weight(departure, c0, c1)


def sage_husa_share(forgetting: float, step: int) -> float:
    """Share of the newest sample in a fading mean after `step` samples: (1 - b)/(1 - b^(step + 1)), b 0.95 to 0.995."""
    within(forgetting, "forgetting", 1e-6, 1.0 - 1e-9)
    if step < 0:
        raise out_of_range("step", float(step), ">= 0")
    return float((1.0 - forgetting) / (1.0 - forgetting ** (step + 1)))


def sage_husa(noise: ArrayLike, innovation: ArrayLike, predicted: ArrayLike, share: float, floor: float) -> Array:
    """Noise covariance (m, m) after one innovation v, R <- (1 - d) R + d (v v' - H P H'), never below a floor.

    `predicted` is H P H', `share` d (`sage_husa_share`). The sample has the mean R but is not positive: an innovation
    smaller than its prediction takes R below zero and the filter diverges; eigenvalues below the floor are lifted to
    it (Sage A.P., Husa G.W., Joint Automatic Control Conference, 1969, pp. 760-769).
    """
    r, v, p = finite(noise, "noise", (None, None)), finite(innovation, "innovation", (None,)), finite(predicted, "HPH'")
    if r.shape != (v.size, v.size) or p.shape != r.shape:
        raise wrong_shape("noise, HPH'", f"{r.shape}, {p.shape}", str((v.size, v.size)))
    within(share, "share", 0.0, 1.0)
    within(floor, "floor", 1e-300, 1e300)
    sample = (1.0 - share) * r + share * (np.outer(v, v) - p)
    values, vectors = np.linalg.eigh(0.5 * (sample + sample.T))
    if values[0] >= floor:
        return np.asarray(0.5 * (sample + sample.T))
    return np.asarray((vectors * np.maximum(values, floor)) @ vectors.T)


def fading_factor(
    spread: ArrayLike, process: ArrayLike, noise: ArrayLike, carried: ArrayLike, softening: float = 1.0
) -> float:
    """Strong-tracking fading factor, >= 1, that multiplies the carried covariance F P F'.

    lambda = max(1, tr(V - H Q H' - beta R) / tr(H F P F' H')), V the fading mean of v v': the least factor for which
    innovations are as large as predicted (Zhou D.H., Frank P.M., Int. J. Control 65, 1996, pp. 295-307). It takes
    outliers for motion: use it where readings are clean and the motion is not known. beta >= 1 (`softening`) smooths.
    """
    within(softening, "softening", 1.0, 1e6)
    traces = [
        float(np.trace(finite(value, name, (None, None))))
        for value, name in ((spread, "spread"), (process, "process"), (noise, "noise"), (carried, "carried"))
    ]
    if traces[3] <= 0.0:
        raise out_of_range("trace", traces[3], "> 0")
    return max(1.0, (traces[0] - traces[1] - softening * traces[2]) / traces[3])
