"""How the tool turned during a window, told by its gyro, by the phase of the transverse field, or by both."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from inclinometry.core.angles import TAU, wrap_signed
from inclinometry.core.arrays import Array
from inclinometry.motion.samples import Samples

SMOOTHED_S: Final = 0.1
"""Speeds are means over this time: torsional vibration and noise of single samples do not count as speed."""


@dataclass(frozen=True, eq=False)
class Turning:
    """Rotation about the tool axis during a window; NaN where nothing tells it.

    Attributes
    ----------
    angle : (n,) ndarray
        rad, turned since the first sample, clockwise looking down hole; by the gyro where there is one.
    speed : (k,) ndarray
        rad/s, means over `SMOOTHED_S`.
    step : float
        rad, 99th percentile of the rotation from one sample to the next.
    slope : float
        Rotation by the field's phase over rotation by the gyro: 1 when both are right, -1 when one is mirrored.
    lost : float
        Whole turns by which the two differ: the phase was followed the wrong way round.
    restless : float
        rad, root mean square departure of the phase from the gyro's angle but for an offset and a drift.
    mirror : float
        The same with the gyro reversed, over `restless`: small when the tool swings and one of the two is mirrored.
    swing : float
        rad, root mean square of the gyro's angle but for an offset and a drift.
    by : str
        "gyro", "mag" or "".
    """

    angle: Array
    speed: Array
    step: float
    slope: float
    lost: float
    restless: float
    by: str
    mirror: float = np.nan
    swing: float = 0.0

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
    """Rotation during a window.

    Parameters
    ----------
    window : Samples
        Two samples or more; marked samples hold the value before them, which is near enough here.

    Examples
    --------
    >>> t = np.arange(500) / 100.0
    >>> mag = np.stack([2e4 * np.cos(9 * t), -2e4 * np.sin(9 * t), np.full(500, 4e4)], axis=1)
    >>> found = find_turning(Samples(t, 0.01, mag=mag, gyro=np.tile([0.0, 0.0, 9.0], (500, 1))))
    >>> round(found.mean, 6), round(found.slope, 6), round(found.span, 2)
    (9.0, 1.0, 44.91)
    """
    by_gyro = None if window.gyro is None else 0.5 * window.interval * (window.gyro[1:, 2] + window.gyro[:-1, 2])
    by_mag = None if window.mag is None else _phase_steps(window.mag)
    steps = by_mag if by_gyro is None else by_gyro
    if steps is None:
        return Turning(np.empty(0), np.empty(0), np.nan, np.nan, np.nan, np.nan, "")
    slope, lost, restless, mirror, swing = np.nan, np.nan, np.nan, np.nan, 0.0
    if by_gyro is not None and by_mag is not None:
        slope, lost, restless = _compared(by_gyro, by_mag)
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


def _phase_steps(mag: Array) -> Array:
    """Rotation (n - 1,) from sample to sample, rad, within half a turn: the field's phase runs against it."""
    phase = np.arctan2(mag[:, 1], mag[:, 0])
    return np.asarray(-wrap_signed(np.diff(phase)))


def _compared(by_gyro: Array, by_mag: Array) -> tuple[float, float, float]:
    """Slope, whole turns lost, restlessness."""
    off = wrap_signed(by_mag - by_gyro)
    power = float(by_gyro @ by_gyro)
    slope = float(by_mag @ by_gyro / power) if power > 0.0 else np.nan
    turns = float(np.sum(by_mag - by_gyro - off)) / TAU
    return slope, turns, _wander(off)


def _wander(steps: Array) -> float:
    """Root mean square of the sum of the steps but for an offset and a drift, rad."""
    path = np.cumsum(steps)
    x = np.arange(path.size) - 0.5 * (path.size - 1)
    path = path - path.mean()
    path = path - x * float(x @ path / max(float(x @ x), 1.0))
    return float(np.sqrt(np.mean(path**2)))
