"""What the error-state filter takes for granted: sensors' errors beforehand, the site, the window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from inclinometry.core.arrays import Array, frozen
from inclinometry.core.errors import InputError
from inclinometry.core.settings import Range, Settings

DIP_SIGMA: Final = float(np.radians(1.0))
"""Standard uncertainty of a dip that no site states and that is taken from the first window, rad."""


@dataclass(frozen=True, kw_only=True)
class InertialSettings(Settings):
    """Settings of `inertial_attitude`, `gyro_attitude`, `smoothed_attitude` and `continuous_survey`."""

    window: Annotated[float, Range(0.2, 600.0, "s"), "Between two updates with gravity; spacing of the rows."] = 5.0
    gyro_noise: Annotated[float, Range(1e-9, 1.0, "rad/sqrt(s)"), "Angle random walk."] = 3e-5
    gyro_bias_sigma: Annotated[float, Range(0.0, 1.0, "rad/s"), "Standard uncertainty beforehand."] = 3e-3
    gyro_bias_walk: Annotated[float, Range(0.0, 0.1, "rad/s/sqrt(s)"), "Its random walk."] = 1e-6
    gyro_scale_sigma: Annotated[float, Range(0.0, 0.1), "Relative; times the rate the largest error of all."] = 2e-3
    gyro_scale_walk: Annotated[float, Range(0.0, 0.01, "1/sqrt(s)"), "Its random walk."] = 1e-7
    accel_noise: Annotated[float, Range(1e-6, 100.0, "m/s^2"), "Of a sample at rest; shaking is measured."] = 0.03
    accel_bias_sigma: Annotated[float, Range(0.0, 10.0, "m/s^2"), "Standard uncertainty beforehand."] = 0.02
    accel_bias_walk: Annotated[float, Range(0.0, 1.0, "m/s^2/sqrt(s)"), "Its random walk."] = 1e-5
    mag_noise: Annotated[float, Range(1e-3, 1e5, "nT"), "Of one sample, at least; more where samples show it."] = 50.0
    hard_iron_sigma: Annotated[
        float | tuple[float, float, float],
        Range(0.0, 1e5, "nT"),
        "One number or x, y, z; along the tool hardly anything else bounds the azimuth.",
    ] = 150.0
    hard_iron_walk: Annotated[float, Range(0.0, 1e3, "nT/sqrt(s)"), "Its random walk."] = 0.05
    gain_sigma: Annotated[float, Range(0.0, 0.1), "Gain of the accelerometers across, relative to along."] = 2e-4
    ripple_sigma: Annotated[float, Range(0.0, 0.1), "The same of the anti-alias filter at 10 turns a second."] = 1e-3
    coupling_sigma: Annotated[float, Range(0.0, 0.1, "rad"), "Axes of the gyro against the accelerometers'."] = 2e-3
    delay_sigma_s: Annotated[float, Range(0.0, 0.1, "s"), "By which a triad is out of step with the others."] = 1e-4
    lever_arm: Annotated[tuple[float, float, float], Range(-1.0, 1.0, "m"), "From the axis of rotation."] = (
        0.0,
        0.0,
        0.0,
    )
    lever_sigma: Annotated[float, Range(0.0, 1.0, "m"), "Its standard uncertainty."] = 0.02
    gate: Annotated[float, Range(1.0, 1e6, "variances"), "Innovation beyond which a measurement is refused."] = 36.0
    weight: Annotated[Callable[[Array], Array] | None, "Of normalised innovations of gravity, to [0, 1]."] = None
    still_rate: Annotated[float, Range(0.0, 1.0, "rad/s"), "Rate and its scatter below which a tool is held."] = 0.01
    still_accel: Annotated[float, Range(0.0, 100.0, "m/s^2"), "The same of the accelerometers' scatter."] = 0.2
    creep: Annotated[float, Range(0.0, 0.1, "rad/sqrt(s)"), "What a tool that is held may turn unseen."] = 1e-6
    u_limit: Annotated[float, Range(1e-6, 3.0, "rad"), "Uncertainty at which quality is 0."] = float(np.radians(2.0))

    def __post_init__(self) -> None:
        super().__post_init__()
        if np.shape(self.lever_arm) != (3,):
            raise InputError(f"lever_arm is {self.lever_arm}; give three numbers, m in tool axes")
        if np.shape(self.hard_iron_sigma) not in ((), (3,)):
            raise InputError(f"hard_iron_sigma is {self.hard_iron_sigma}; give one number or three, nT")

    def prior(self, attitude: Array, dip_sigma: float) -> Array:
        """Covariance (16, 16) before the first sample, `attitude` (3, 3) that of the attitude."""
        three = np.ones(3)
        spread = [
            self.gyro_bias_sigma * three,
            self.gyro_scale_sigma * three,
            self.accel_bias_sigma * three,
            self.hard_iron_sigma * three,
            [dip_sigma],
        ]
        covariance = np.diag(np.concatenate([np.zeros(3), *(np.asarray(s, dtype=np.float64) for s in spread)]) ** 2)
        covariance[:3, :3] = attitude
        return covariance

    def step_variances(self, interval: float, attitude: float) -> Array:
        """Variances (16,) that one step adds to the errors; the attitude's walk (rad/sqrt(s)) is given."""
        walks = (
            attitude,
            self.gyro_bias_walk,
            self.gyro_scale_walk,
            self.accel_bias_walk,
            self.hard_iron_walk,
        )
        return frozen(np.append(np.repeat(walks, 3) ** 2, 0.0) * interval)
