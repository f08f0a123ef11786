"""Settings and site together: gravity and Earth rate in the axes the filter works in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.core.constants import EARTH_RATE, STANDARD_GRAVITY
from inclinometry.earth.rate import earth_rate, horizontal_rate
from inclinometry.earth.site import Site
from inclinometry.motion.inertial.settings import InertialSettings

TEN_TURNS: Final = 20.0 * np.pi
"""rad/s, the rotation rate that the settings' ripple is stated for."""


UNSTATED: Final = 0.2
"""rad, a declination that no site states."""


@dataclass(frozen=True, eq=False)
class Model:
    """What a window is reduced with.

    magnetic : whether the field is used.
    blind : azimuth is not known, so that the horizontal Earth rate points anywhere: a filter that is linear in the
        azimuth's error would draw wrong conclusions from it. It is then left out and counted as noise.
    """

    settings: InertialSettings
    site: Site
    magnetic: bool
    blind: bool = False

    @property
    def gravity(self) -> float:
        """m/s^2."""
        return STANDARD_GRAVITY if self.site.gravity is None else self.site.gravity

    @property
    def spin(self) -> Array:
        """Earth rate (3,) in north, east, down of the north that is used; nought without a latitude."""
        if self.site.latitude is None:
            return np.zeros(3)
        w = earth_rate(self.site.latitude)
        if self.blind:
            return np.array([0.0, 0.0, w[2]])
        # east of true north, magnetic north sees the Earth's axis turned west
        turn = (self.site.declination or 0.0) if self.magnetic else 0.0
        return np.array([w[0] * np.cos(turn), -w[0] * np.sin(turn), w[2]])

    @property
    def gyro_noise(self) -> float:
        """Angle random walk, rad/sqrt(s): the gyro's, and that which turns as far in a window as a rate not known."""
        if self.site.latitude is None:
            unknown = EARTH_RATE
        else:
            level = float(horizontal_rate(self.site.latitude))
            askew = UNSTATED if self.magnetic and self.site.declination is None else 0.0
            unknown = level * (1.0 if self.blind else askew)
        return float(np.hypot(self.settings.gyro_noise, unknown * np.sqrt(self.settings.window)))

    def gain(self, rate: Array) -> float:
        """Standard uncertainty of the accelerometers' gain across the tool, at rates (n, 3) of a window, rad/s."""
        fast = float(np.mean(rate[:, 2] ** 2)) / TEN_TURNS**2
        return float(np.hypot(self.settings.gain_sigma, self.settings.ripple_sigma * fast))
