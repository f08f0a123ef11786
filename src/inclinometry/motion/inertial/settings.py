"""What the error-state filter takes for granted: sensors' errors beforehand, the site, the window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from inclinometry.core.arrays import Array, frozen, within
from inclinometry.core.errors import InputError

DIP_SIGMA: Final = float(np.radians(1.0))
"""Standard uncertainty of a dip that no site states and that is taken from the first window, rad."""

_RANGES: Final = {
    "window": (0.2, 600.0, "s"),
    "gyro_noise": (1e-9, 1.0, "rad/sqrt(s)"),
    "gyro_bias_sigma": (0.0, 1.0, "rad/s"),
    "gyro_bias_walk": (0.0, 0.1, "rad/s/sqrt(s)"),
    "gyro_scale_sigma": (0.0, 0.1, ""),
    "gyro_scale_walk": (0.0, 0.01, "1/sqrt(s)"),
    "accel_noise": (1e-6, 100.0, "m/s^2"),
    "accel_bias_sigma": (0.0, 10.0, "m/s^2"),
    "accel_bias_walk": (0.0, 1.0, "m/s^2/sqrt(s)"),
    "mag_noise": (1e-3, 1e5, "nT"),
    "hard_iron_sigma": (0.0, 1e5, "nT"),
    "hard_iron_walk": (0.0, 1e3, "nT/sqrt(s)"),
    "gain_sigma": (0.0, 0.1, ""),
    "ripple_sigma": (0.0, 0.1, ""),
    "coupling_sigma": (0.0, 0.1, ""),
    "delay_sigma_s": (0.0, 0.1, "s"),
    "lever_sigma": (0.0, 1.0, "m"),
    "gate": (1.0, 1e6, "variances"),
    "still_rate": (0.0, 1.0, "rad/s"),
    "still_accel": (0.0, 100.0, "m/s^2"),
    "creep": (0.0, 0.1, "rad/sqrt(s)"),
    "u_limit": (1e-6, 3.0, "rad"),
}


@dataclass(frozen=True, kw_only=True)
class InertialSettings:
    """Settings of `inertial_attitude`, `gyro_attitude`, `smoothed_attitude` and `continuous_survey`.

    Parameters
    ----------
    window : float
        s, between two updates with gravity, which is also the spacing of the rows. Vibration averages out as
        window^-2 until white noise is left; much longer windows let the gyro drift inside them.
    gyro_noise : float
        Angle random walk, rad/sqrt(s).
    gyro_bias_sigma, gyro_bias_walk : float
        Standard uncertainty beforehand, rad/s, and random walk, rad/s/sqrt(s).
    gyro_scale_sigma, gyro_scale_walk : float
        The same of the relative scale error; times the rotation rate it is the largest error of all.
    accel_noise : float
        Of one sample at rest, m/s^2. What shaking adds is measured from the data.
    accel_bias_sigma, accel_bias_walk : float
        m/s^2, m/s^2/sqrt(s).
    mag_noise : float
        Of one sample, nT, at least; what successive samples show is used where it is more.
    hard_iron_sigma, hard_iron_walk : float or three floats, float
        nT (x, y, z), nT/sqrt(s). Along the tool axis hardly anything but this number bounds the azimuth's error.
    gain_sigma, ripple_sigma : float
        Standard uncertainty of the accelerometers' gain across the tool relative to along it: of their scales, and of
        the anti-alias filter at 10 turns a second (it grows with the square of the rate). Neither can be seen from
        within; they tilt by gain x sin I cos I and are added to the covariance of every row.
    coupling_sigma : float
        Standard uncertainty of the directions of the gyro's axes against the accelerometers', rad. A spinning gyro
        takes its own axis for the tool's; nothing within tells, and it is added to the tilt of every row of a turning
        tool.
    delay_sigma_s : float
        Standard uncertainty, s, of the time by which the magnetometer or the gyro is out of step with the
        accelerometers. At the rate w it turns azimuth and toolface by w times the delay in every row.
    lever_arm, lever_sigma : three floats, float
        Position of the accelerometers from the axis of rotation, tool axes, m, and its standard uncertainty.
    gate : float
        Squared normalised innovation beyond which a measurement is refused.
    weight : callable, optional
        Of normalised innovations (k,) to weights (k,) in [0, 1]; divides the information of a window's gravity. Never
        put on single samples that shake: that breaks their zero mean.
    still_rate, still_accel : float
        Below these (of the mean rate less the bias, rad/s; scatter of rate, same; scatter of the accelerometers) a
        window is a standstill: the tool is held, and the gyro reads bias and Earth rate.
    creep : float
        rad/sqrt(s) that a tool held may turn unseen.
    u_limit : float
        rad, standard uncertainty at which the quality of a row is 0.

    Raises
    ------
    InputError
        A value out of range.

    Examples
    --------
    >>> InertialSettings(window=0.01)
    Traceback (most recent call last):
    inclinometry.core.errors.InputError: window is 0.01 s; allowed 0.2 to 600 s
    """

    window: float = 5.0
    gyro_noise: float = 3e-5
    gyro_bias_sigma: float = 3e-3
    gyro_bias_walk: float = 1e-6
    gyro_scale_sigma: float = 2e-3
    gyro_scale_walk: float = 1e-7
    accel_noise: float = 0.03
    accel_bias_sigma: float = 0.02
    accel_bias_walk: float = 1e-5
    mag_noise: float = 50.0
    hard_iron_sigma: float | tuple[float, float, float] = 150.0
    hard_iron_walk: float = 0.05
    gain_sigma: float = 2e-4
    ripple_sigma: float = 1e-3
    coupling_sigma: float = 2e-3
    delay_sigma_s: float = 1e-4
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lever_sigma: float = 0.02
    gate: float = 36.0
    weight: Callable[[Array], Array] | None = None
    still_rate: float = 0.01
    still_accel: float = 0.2
    creep: float = 1e-6
    u_limit: float = float(np.radians(2.0))

    def __post_init__(self) -> None:
        for name, (low, high, unit) in _RANGES.items():
            within(getattr(self, name), name, low, high, unit)
        within(self.lever_arm, "lever_arm", -1.0, 1.0, "m")
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
