"""Each channel of a turning tool as a mean and a first harmonic of the angle turned: free of vibration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.motion._long_run import batch_means
from inclinometry.motion.samples import Samples
from inclinometry.motion.turning import SMOOTHED_S, Turning

LEAST_TURNS: Final = 2.0
"""Turns that tell a mean from a harmonic."""
STEADY: Final = 0.3
"""Relative variation of the squared speed below which its effect is not told from a constant."""
BATCHES: Final = 16
LEAST_PART: Final = 0.1
"""Harmonic over mean below which its plane, and with it the axis of rotation, does not show: near vertical."""
DIRECTIONS: Final = 8
"""Angles at which the fit is read: mirrored axes show in the second harmonic of the dip."""


@dataclass(frozen=True, eq=False)
class Harmonics:
    """Gravity and field at `DIRECTIONS` angles, or one where the tool did not turn.

    Attributes
    ----------
    accel, mag : (k, 3) ndarray
        m/s^2, nT; mag NaN where there is no magnetometer.
    u_accel : float
        m/s^2, standard uncertainty of a component.
    turned : bool
    """

    accel: Array
    mag: Array
    u_accel: float
    turned: bool


def find_harmonics(window: Samples, turning: Turning) -> Harmonics | None:
    """Mean and harmonic of the six channels; None without an accelerometer, or when the tool turned too little to tell
    a harmonic and too much for a mean.

    Notes
    -----
    Least squares of each channel on 1, cos and sin of the angle, square and change of speed: for rotation about any
    axis and for any order and sign of channels, as long as the angle is right but for its sign. Of the mean only the
    part along the axis of rotation is kept, the normal to the harmonic's plane: across it lie the centripetal
    acceleration and magnetic offsets.
    """
    if window.accel is None:
        return None
    mag = np.full_like(window.accel, np.nan) if window.mag is None else window.mag
    values = np.concatenate([window.accel, mag], axis=1)
    if window.clipped is not None:
        values = values[~window.clipped]
    if len(values) < 2 * BATCHES:
        return None
    angle = np.zeros(0)
    if turning.span > 2.0 * np.pi * LEAST_TURNS:
        angle = turning.angle if window.clipped is None else turning.angle[~window.clipped]
    elif turning.span > 0.2:
        return None
    columns = [np.ones(len(values))]
    if angle.size:
        columns += [np.sqrt(2.0) * np.cos(angle), np.sqrt(2.0) * np.sin(angle), *_driven(turning, window)]
    basis = np.stack(columns, axis=1)
    fitted = np.linalg.pinv(basis.T @ basis, rcond=1e-9, hermitian=True) @ (basis.T @ values)
    rest = values[:, :3] - basis @ fitted[:, :3]
    u = _uncertainty(rest, basis[:, :3])
    if angle.size:
        across = float(np.linalg.norm(fitted[0, :3]))
        for triad in (slice(0, 3), slice(3, 6)):
            fitted[0, triad] = _along(fitted[:3, triad])
        if not np.isfinite(fitted[0, :3]).all():
            return None
        # an axis that is not quite right takes up some of what lies across it
        across = float(np.sqrt(max(across**2 - float(np.sum(fitted[0, :3] ** 2)), 0.0)))
        u *= 1.0 + across / float(np.linalg.norm(fitted[1:3, :3]))
    at = np.arange(DIRECTIONS) * (2.0 * np.pi / DIRECTIONS) if angle.size else np.zeros(1)
    root = np.sqrt(2.0)
    read = np.stack([np.ones(at.size), root * np.cos(at), root * np.sin(at)], axis=1)[:, : len(columns)] @ fitted[:3]
    return Harmonics(read[:, :3], read[:, 3:], u, bool(angle.size))


def _uncertainty(rest: Array, basis: Array) -> float:
    """Standard uncertainty of a component, from batch means of the residuals against each column."""
    products = (rest[:, :, None] * basis[:, None, :]).reshape(len(rest), -1)
    batches = min(BATCHES, len(rest))
    spread = batch_means(products, batches).var(axis=0, ddof=1) / batches
    return float(np.sqrt(spread.sum() / 3.0))


def _along(fitted: Array) -> Array:
    """The mean's part along the axis of rotation, from mean, cosine and sine (3, 3); NaN where no axis shows."""
    mean, cosine, sine = fitted
    axis = np.cross(cosine, sine)
    size = float(np.linalg.norm(axis))
    along = float(axis @ mean) / max(size, 1e-300)
    # axis is the product of two harmonics over sqrt(2) each
    if not np.sqrt(2.0 * size) > LEAST_PART * abs(along):
        return np.full(3, np.nan)
    return np.asarray(axis * (along / size))


def _driven(turning: Turning, window: Samples) -> list[Array]:
    """Square of the speed and its derivative at the samples used: what drives a lever arm's acceleration."""
    group = max(round(SMOOTHED_S / window.interval / 2.0), 1)
    speed = np.convolve(np.diff(turning.angle, append=turning.angle[-1]), np.ones(group) / group, "same")
    used = slice(None) if window.clipped is None else ~window.clipped
    square, change = (speed**2)[used], np.gradient(speed)[used]
    if float(square.std()) < STEADY * float(square.mean()):
        # a steady speed is not told from the constant, which keeps what it drives
        square, change = square - square.mean(), change - change.mean()
    return [
        one / max(float(np.abs(one).max()), float(np.abs(speed).max()) ** 2 * 1e-9, 1e-300) for one in (square, change)
    ]
