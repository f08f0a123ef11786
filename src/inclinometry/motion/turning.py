"""How the tool turned during a window, told by its gyro, by the phase of the transverse field, or by both."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.motion.result import Samples
from inclinometry.motion.window_smoother import batch_means
from inclinometry.rotations import TAU, wrap_signed

SMOOTHED_S: Final = 0.1
"""Speeds are means over this time: torsional vibration and noise of single samples do not count as speed."""


@dataclass(frozen=True, eq=False)
class Turning:
    """Rotation about the tool axis during a window; NaN where nothing tells it."""

    #: (n,) rad, turned since the first sample, clockwise looking down hole; by the gyro where there is one
    angle: Array
    speed: Array  #: (k,) rad/s, means over `SMOOTHED_S`
    step: float  #: rad, 99th percentile of the rotation from one sample to the next
    # rotation by the field's phase over rotation by the gyro: 1 when both are right, -1 when one is mirrored
    slope: float
    lost: float  #: whole turns by which the two differ: the phase was followed the wrong way round
    restless: float  #: rad, root mean square departure of the phase from the gyro's angle but for an offset and a drift
    by: str  #: "gyro", "mag" or ""
    # the same with the gyro reversed, over `restless`: small when the tool swings and one of the two is mirrored
    mirror: float = np.nan
    swing: float = 0.0  #: rad, root mean square of the gyro's angle but for an offset and a drift

    @property
    def span(self) -> float:
        """Range of the angle, rad; 0 where unknown."""
        return float(np.ptp(self.angle)) if self.by else 0.0

    @property
    def mean(self) -> float:
        """Mean speed, rad/s."""
        return float(self.speed.mean()) if self.by else np.nan

    @property
    def fastest(self) -> float:
        """Largest magnitude of speed, rad/s."""
        return float(np.abs(self.speed).max()) if self.by else np.nan


def find_turning(window: Samples) -> Turning:
    """Rotation during a window; marked samples hold the value before them, which is near enough here."""
    by_gyro = None if window.gyro is None else 0.5 * window.interval * (window.gyro[1:, 2] + window.gyro[:-1, 2])
    by_mag = None
    if window.mag is not None:
        # within half a turn: the field's phase runs against the rotation
        by_mag = np.asarray(-wrap_signed(np.diff(np.arctan2(window.mag[:, 1], window.mag[:, 0]))))
    steps = by_mag if by_gyro is None else by_gyro
    if steps is None:
        return Turning(np.empty(0), np.empty(0), np.nan, np.nan, np.nan, np.nan, "")
    slope, lost, restless, mirror, swing = np.nan, np.nan, np.nan, np.nan, 0.0
    if by_gyro is not None and by_mag is not None:
        off, power = wrap_signed(by_mag - by_gyro), float(by_gyro @ by_gyro)
        slope = float(by_mag @ by_gyro / power) if power > 0.0 else np.nan
        lost = float(np.sum(by_mag - by_gyro - off)) / TAU
        restless = _wander(off)
        swing = _wander(by_gyro)
        mirror = _wander(wrap_signed(by_mag + by_gyro)) / max(restless, 1e-12)
    angle = np.concatenate([[0.0], np.cumsum(steps)])
    group = max(round(SMOOTHED_S / window.interval), 1)
    whole = steps[: steps.size // group * group].reshape(-1, group) if steps.size >= group else steps[None]
    return Turning(
        angle=angle,
        speed=whole.mean(axis=1) / window.interval,
        step=float(np.quantile(np.abs(steps), 0.99)),
        slope=slope,
        lost=lost,
        restless=restless,
        by="mag" if by_gyro is None else "gyro",
        mirror=mirror,
        swing=swing,
    )


def _wander(steps: Array) -> float:
    """Root mean square of the sum of the steps but for an offset and a drift, rad."""
    path = np.cumsum(steps)
    x = np.arange(path.size) - 0.5 * (path.size - 1)
    path = path - path.mean()
    path = path - x * float(x @ path / max(float(x @ x), 1.0))
    return float(np.sqrt(np.mean(path**2)))


# Each channel of a turning tool as a mean and a first harmonic of the angle turned: free of vibration.

LEAST_TURNS: Final = 2.0
"""Turns that tell a mean from a harmonic."""
BATCHES: Final = 16


@dataclass(frozen=True, eq=False)
class Harmonics:
    """Gravity and field at eight angles, or one where the tool did not turn."""

    # accel, mag: (k, 3) m/s^2, nT; mag NaN where there is no magnetometer
    accel: Array
    mag: Array
    u_accel: float  #: m/s^2, standard uncertainty of a component
    turned: bool


def find_harmonics(window: Samples, turning: Turning) -> Harmonics | None:
    """Mean and harmonic of the six channels; None without an accelerometer, or between a harmonic's turn and a mean's.

    Least squares of each channel on 1, cos and sin of the angle, square and change of speed: for rotation about any
    axis and for any order and sign of channels, as long as the angle is right but for its sign. Of the mean only the
    part along the axis of rotation is kept: across it lie the centripetal acceleration and magnetic offsets.
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
    # standard uncertainty of a component, from batch means of the residuals against each column
    products = (rest[:, :, None] * basis[:, :3][:, None, :]).reshape(len(rest), -1)
    batches = min(BATCHES, len(rest))
    spread = batch_means(products, batches).var(axis=0, ddof=1) / batches
    u = float(np.sqrt(spread.sum() / 3.0))
    if angle.size:
        across = float(np.linalg.norm(fitted[0, :3]))
        for triad in (slice(0, 3), slice(3, 6)):
            fitted[0, triad] = _along(fitted[:3, triad])
        if not np.isfinite(fitted[0, :3]).all():
            return None
        # an axis that is not quite right takes up some of what lies across it
        across = float(np.sqrt(max(across**2 - float(np.sum(fitted[0, :3] ** 2)), 0.0)))
        u *= 1.0 + across / float(np.linalg.norm(fitted[1:3, :3]))
    directions = 8  # angles at which the fit is read: mirrored axes show in the second harmonic of the dip
    at = np.arange(directions) * (2.0 * np.pi / directions) if angle.size else np.zeros(1)
    root = np.sqrt(2.0)
    read = np.stack([np.ones(at.size), root * np.cos(at), root * np.sin(at)], axis=1)[:, : len(columns)] @ fitted[:3]
    return Harmonics(read[:, :3], read[:, 3:], u, bool(angle.size))


def _along(fitted: Array) -> Array:
    """The mean's part along the axis of rotation, from mean, cosine and sine (3, 3); NaN where no axis shows."""
    mean, cosine, sine = fitted
    axis = np.cross(cosine, sine)
    size = float(np.linalg.norm(axis))
    along = float(axis @ mean) / max(size, 1e-300)
    # axis is the product of two harmonics over sqrt(2) each
    # below 0.1 the harmonic's plane, and with it the axis of rotation, does not show: near vertical
    if not np.sqrt(2.0 * size) > 0.1 * abs(along):
        return np.full(3, np.nan)
    return np.asarray(axis * (along / size))


def _driven(turning: Turning, window: Samples) -> list[Array]:
    """Square of the speed and its derivative at the samples used: what drives a lever arm's acceleration."""
    group = max(round(SMOOTHED_S / window.interval / 2.0), 1)
    speed = np.convolve(np.diff(turning.angle, append=turning.angle[-1]), np.ones(group) / group, "same")
    used = slice(None) if window.clipped is None else ~window.clipped
    square, change = (speed**2)[used], np.gradient(speed)[used]
    if float(square.std()) < 0.3 * float(square.mean()):
        # a speed so steady is not told from the constant, which keeps what it drives
        square, change = square - square.mean(), change - change.mean()
    return [
        one / max(float(np.abs(one).max()), float(np.abs(speed).max()) ** 2 * 1e-9, 1e-300) for one in (square, change)
    ]
