"""Settings of the filter in the almost-inertial frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from inclinometry.core.errors import InputError
from inclinometry.core.settings import Range, Settings


@dataclass(frozen=True, kw_only=True)
class ComplementarySettings(Settings):
    """What the filter takes the tool, its surroundings and its sensors to be.

    Acceleration is the second derivative of a place that stays within bounds (`sway_m`): that, not the strength of
    vibration, limits what gravity's average can be spoiled by.
    """

    every: Annotated[int, "A row for every so many samples."] = 1
    update_s: Annotated[float, Range(1e-3, 1.0, "s"), "Between two observations; samples between are summed."] = 0.1
    start_s: Annotated[float, Range(0.0, 60.0, "s"), "Gravity and field are averaged for the first attitude."] = 1.0
    gravity: Annotated[float, Range(9.0, 10.5, "m/s^2"), "Of the site."] = 9.81
    accel_error: Annotated[float, Range(0.0, 1.0, "m/s^2"), "Sd of the accelerometer's bias; added to every row."] = (
        0.03
    )
    sway_m: Annotated[float, Range(1e-4, 10.0, "m"), "Sd of the tool's horizontal place about its own middle."] = 0.2
    sway_s: Annotated[float, Range(1e-3, 60.0, "s"), "How long one excursion of it lasts."] = 1.0
    unevenness: Annotated[float, Range(1.0, 1e5, "nT"), "Sd of the field between places, and of its errors."] = 1200.0
    unevenness_s: Annotated[float, Range(1e-3, 600.0, "s"), "From one such place to an independent one."] = 4.0
    field_walk: Annotated[float, Range(0.0, 1e4, "nT/sqrt(s)"), "Change of the mean field."] = 20.0
    rate_noise: Annotated[float, Range(1e-9, 1.0, "rad/sqrt(s)"), "Angle random walk."] = float(np.radians(0.02))
    rate_error: Annotated[float, Range(0.0, 0.1), "Relative error of the gyro's scale and axes."] = 1e-3
    bias_sigma: Annotated[float, Range(1e-9, 1.0, "rad/s"), "Of the gyro's bias at the start."] = float(np.radians(0.5))
    bias_walk: Annotated[float, Range(0.0, 0.1, "rad/s/sqrt(s)"), "Its change."] = float(np.radians(0.003))
    rest_rate: Annotated[float, Range(1e-9, 1.0, "rad/s"), "Scatter of rate of a tool at rest."] = float(
        np.radians(2.0)
    )
    rest_gravity: Annotated[float, Range(1e-9, 10.0, "m/s^2"), "Scatter of gravity of a tool at rest."] = 0.5
    rest_s: Annotated[float, Range(0.0, 60.0, "s"), "For so long both must hold."] = 1.5
    gate: Annotated[float, Range(1.0, 1e6), "Misfit of the field, in unevennesses, that counts as disturbed."] = 2.0
    accept_s: Annotated[float, Range(0.1, 1e6, "s"), "A field that stays different is then the new one."] = 20.0
    iron_ratio: Annotated[float, "Share of the field's variance hard iron must explain; inf: never."] = 1.0
    iron_s: Annotated[float, Range(1.0, 1e6, "s"), "Memory of the sums that find it."] = 100.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (isinstance(self.every, int) and self.every >= 1):
            raise InputError(f"every is {self.every}; it must be a whole number of samples, 1 or more")
        if not self.iron_ratio >= 0.0:
            raise InputError(f"iron_ratio is {self.iron_ratio:g}; it must be 0 or more")
