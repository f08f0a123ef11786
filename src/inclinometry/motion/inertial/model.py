"""Settings and site together: gravity and Earth rate in the axes the filter works in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.core.constants import STANDARD_GRAVITY
from inclinometry.earth.rate import earth_rate
from inclinometry.earth.site import Site
from inclinometry.motion.inertial.settings import InertialSettings

TEN_TURNS: Final = 20.0 * np.pi
"""rad/s, the rotation rate that the settings' ripple is stated for."""


@dataclass(frozen=True, eq=False)
class Model:
    """What a window is reduced with; `magnetic` tells whether the field is used."""

    settings: InertialSettings
    site: Site
    magnetic: bool

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
        # east of true north, magnetic north sees the Earth's axis turned west
        turn = (self.site.declination or 0.0) if self.magnetic else 0.0
        return np.array([w[0] * np.cos(turn), -w[0] * np.sin(turn), w[2]])

    def gain(self, rate: Array) -> float:
        """Standard uncertainty of the accelerometers' gain across the tool, at rates (n, 3) of a window, rad/s."""
        fast = float(np.mean(rate[:, 2] ** 2)) / TEN_TURNS**2
        return float(np.hypot(self.settings.gain_sigma, self.settings.ripple_sigma * fast))
