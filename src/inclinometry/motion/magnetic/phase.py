"""Phase of the transverse field at the nodes, as smooth as the data themselves allow."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from inclinometry.core.arrays import Array

HALVES: Final = (2, 3, 4, 6, 9, 13, 19, 28, 42, 63, 95, 142, 213, 320, 480)
"""Half lengths of the smoother that are tried, in nodes; a parabola through three points (1) would meet them all, and
there is nothing left to predict."""


@dataclass(frozen=True, eq=False)
class Track:
    """Smoothed phase of a window, one value a node.

    Attributes
    ----------
    phase : (m,) ndarray
        rad, without jumps.
    slope, bend : (m,) ndarray
        First and second derivative per node.
    noise : float
        Standard deviation of the phase of one node, rad, from leaving each out in turn.
    half : int
        Half length of the smoother, nodes.
    sigma : float
        Standard deviation of the smoothed phase, rad: its noise, and what it gives away of the motion.
    given : (m,) ndarray
        The phase before smoothing.
    """

    phase: Array
    slope: Array
    bend: Array
    noise: float
    half: int
    sigma: float
    given: Array


@lru_cache(maxsize=64)
def _kernels(half: int) -> tuple[Array, Array, Array]:
    """Weights of value, slope and bend of a local cubic (value: the same as of a local parabola)."""
    if half == 0:
        return np.ones(1), np.zeros(1), np.zeros(1)
    x = np.arange(-half, half + 1.0)
    degree = min(3, 2 * half)
    inverse = np.linalg.pinv(np.vander(x / half, degree + 1, increasing=True))
    return inverse[0], inverse[1] / half, 2.0 * inverse[2] / half**2


def smooth(phase: Array) -> Track:
    """Smoothed by local cubics of the length that predicts best what it has not seen.

    Parameters
    ----------
    phase : (m,) ndarray
        rad, unwrapped, at equal steps.

    Notes
    -----
    Savitzky A., Golay M.J.E., Analytical Chemistry 36, 1964; the length by leave-one-out cross-validation: residual /
    (1 - h) with h the smoother's weight of the point itself. Beyond the ends the phase is mirrored in their points.

    Examples
    --------
    >>> track = smooth(0.1 * np.arange(50.0))
    >>> bool(np.allclose(track.phase, 0.1 * np.arange(50.0))), round(float(track.slope[25]), 9)
    (True, 0.1)
    """
    best: tuple[float, int, Array] | None = None
    values: dict[int, Array] = {0: phase}
    for half in HALVES:
        if half <= max(2, phase.size // 6):
            value = values[half] = filtered(phase, half)
            inner = slice(half, phase.size - half)
            error = (phase - value)[inner] / (1.0 - _kernels(half)[0][half])
            score = float(np.mean(error**2))
            # a straight line of an exact phase leaves rounding only: the longest is then as good
            if best is None or score < best[0]:
                best = score, half, value
    if best is None:
        zero = np.zeros_like(phase)
        return Track(phase, np.gradient(phase), zero, 0.0, 0, 0.0, phase)
    score, half, value = best
    weights = _kernels(half)[0]
    gain, noise = float(weights @ weights), _noise(score, weights)
    shorter = max(other for other in values if other < half)
    short = _kernels(shorter)[0]
    # two smoothers of which one sees more differ by the noise the other lets through, and by the motion it loses
    lost = float(np.mean((values[shorter] - value) ** 2)) - noise**2 * (float(short @ short) - gain)
    rate = max(half, 2)
    return Track(
        value,
        filtered(phase, rate, 1),
        filtered(phase, rate, 2),
        noise,
        half,
        float(np.sqrt(noise**2 * gain + max(lost, 0.0))),
        phase,
    )


def _noise(score: float, weights: Array) -> float:
    """Standard deviation of a node from the mean square of errors of prediction: node and prediction both err."""
    own = weights[weights.size // 2]
    rest = float(weights @ weights) - own**2
    return float(np.sqrt(score / (1.0 + rest / (1.0 - own) ** 2)))


def filtered(phase: Array, half: int, derivative: int = 0) -> Array:
    """Convolved with the weights, after continuing both ends."""
    left = 2.0 * phase[0] - phase[half:0:-1]
    right = 2.0 * phase[-1] - phase[-2 : -half - 2 : -1]
    weights = _kernels(half)[derivative]
    return np.convolve(np.concatenate([left, phase, right]), weights[::-1], mode="valid")
