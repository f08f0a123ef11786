"""Settings of the filter in the almost-inertial frame."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from inclinometry.core.arrays import within
from inclinometry.core.errors import InputError

_RANGES: Final = {
    "update_s": (1e-3, 1.0, "s"),
    "start_s": (0.0, 60.0, "s"),
    "gravity": (9.0, 10.5, "m/s^2"),
    "accel_error": (0.0, 1.0, "m/s^2"),
    "sway_m": (1e-4, 10.0, "m"),
    "sway_s": (1e-3, 60.0, "s"),
    "unevenness": (1.0, 1e5, "nT"),
    "unevenness_s": (1e-3, 600.0, "s"),
    "field_walk": (0.0, 1e4, "nT/sqrt(s)"),
    "rate_noise": (1e-9, 1.0, "rad/sqrt(s)"),
    "rate_error": (0.0, 0.1, ""),
    "bias_sigma": (1e-9, 1.0, "rad/s"),
    "bias_walk": (0.0, 0.1, "rad/s/sqrt(s)"),
    "rest_rate": (1e-9, 1.0, "rad/s"),
    "rest_gravity": (1e-9, 10.0, "m/s^2"),
    "rest_s": (0.0, 60.0, "s"),
    "gate": (1.0, 1e6, ""),
    "accept_s": (0.1, 1e6, "s"),
    "iron_ratio": (0.0, np.inf, ""),
    "iron_s": (1.0, 1e6, "s"),
}


@dataclass(frozen=True, kw_only=True)
class ComplementarySettings:
    """What the filter takes the tool, its surroundings and its sensors to be.

    Parameters
    ----------
    every : int
        A row for every so many samples.
    update_s : float
        s, between two observations; samples between them are summed in the almost-inertial frame.
    start_s : float
        s, over which gravity and field are averaged for the first attitude.
    gravity : float
        m/s^2.
    accel_error : float
        m/s^2, standard deviation of the accelerometer's bias: it tilts the level frame and cannot be seen from inside,
        so it is added to the covariance of every row.
    sway_m, sway_s : float
        m and s: standard deviation of the tool's horizontal place about its own middle, and how long one excursion
        lasts. Acceleration is the second derivative of a place that stays within bounds: that, not the strength of
        vibration, limits what gravity's average can be spoiled by.
    unevenness, unevenness_s : float
        nT and s: standard deviation of the field between places (and of the magnetometer's errors), and how long the
        tool takes from one such place to an independent one.
    field_walk : float
        nT/sqrt(s), by which the mean field changes.
    rate_noise : float
        rad/sqrt(s), angle random walk of the gyro.
    rate_error : float
        Relative error of the gyro's scale and axes.
    bias_sigma, bias_walk : float
        rad/s and rad/s/sqrt(s), of the gyro's bias: at the start, and its change.
    rest_rate, rest_gravity, rest_s : float
        rad/s, m/s^2 and s: scatter below which, for so long, the tool is at rest.
    gate : float
        Misfit of the field, in unevennesses, beyond which it counts as disturbed.
    accept_s : float
        s, after which a field that stays different is taken for the new one.
    iron_ratio, iron_s : float
        Share of the field's variance, relative to what is left, that hard iron must explain before it is removed
        (infinite: never), and the memory, s, of the sums that find it.

    Raises
    ------
    InputError
        A value out of range.

    Examples
    --------
    >>> ComplementarySettings(sway_m=0.01).sway_m
    0.01
    """

    every: int = 1
    update_s: float = 0.1
    start_s: float = 1.0
    gravity: float = 9.81
    accel_error: float = 0.03
    sway_m: float = 0.2
    sway_s: float = 1.0
    unevenness: float = 1200.0
    unevenness_s: float = 4.0
    field_walk: float = 20.0
    rate_noise: float = float(np.radians(0.02))
    rate_error: float = 1e-3
    bias_sigma: float = float(np.radians(0.5))
    bias_walk: float = float(np.radians(0.003))
    rest_rate: float = float(np.radians(2.0))
    rest_gravity: float = 0.5
    rest_s: float = 1.5
    gate: float = 2.0
    accept_s: float = 20.0
    iron_ratio: float = 1.0
    iron_s: float = 100.0

    def __post_init__(self) -> None:
        if not (isinstance(self.every, int) and self.every >= 1):
            raise InputError(f"every is {self.every}; it must be a whole number of samples, 1 or more")
        for field in fields(self):
            if field.name == "every":
                continue
            low, high, unit = _RANGES[field.name]
            if field.name == "iron_ratio" and np.isinf(self.iron_ratio) and self.iron_ratio > 0.0:
                continue
            within(getattr(self, field.name), field.name, low, high, unit)
