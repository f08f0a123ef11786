"""What a run has taught of the tool so far: magnetic offset, accelerometer offset, lever arm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.motion.magnetic.band import Complex, remembered, untried
from inclinometry.motion.magnetic.circle import SECTORS
from inclinometry.motion.magnetic.settings import MagneticSettings

OFFSET_WALK: Final = 1.0
"""nT / sqrt(s): magnetic offset, with temperature and stress."""
ACCEL_WALK: Final = 1e-4
"""m/s^2 / sqrt(s)."""
DELAY_SIGMA: Final = 0.05
"""s: of the magnetometer's delay before anything is known."""
LEVER_WALK: Final = 1e-5
"""m / sqrt(s)."""


@dataclass(frozen=True, eq=False)
class ToolConstants:
    """Estimates with covariance, valid up to the end of the window they come from.

    Attributes
    ----------
    offset : complex
        Transverse magnetic offset, nT.
    offset_covariance : (2, 2) ndarray
        nT^2.
    seen : bool
        Whether an arc sufficed for the offset to be fitted.
    motion : (2,) ndarray
        Transverse accelerometer offset, m/s^2, and lever arm, m, complex.
    motion_covariance : (2, 2) ndarray
        Per real component.
    trust : (4, r) ndarray
        Log weights of the noise spectra of transverse gravity and field, axial gravity and field.
    delay : tuple of float
        Information about the magnetometer's delay against the accelerometer, 1/s^2, and information times delay.
    gyro_lag : tuple of float
        Likewise of the gyro against the magnetometer.
    met : (2, SECTORS) ndarray
        Sums and numbers of the transverse field by direction, as long as no arc sufficed.
    """

    offset: complex
    offset_covariance: Array
    seen: bool
    motion: Complex
    motion_covariance: Complex
    trust: Array
    delay: tuple[float, float]
    gyro_lag: tuple[float, float]
    met: Complex

    def aged(self, seconds: float) -> ToolConstants:
        """After some time in which they may have wandered."""
        walk = np.diag([ACCEL_WALK**2, LEVER_WALK**2]) * seconds
        return ToolConstants(
            self.offset,
            self.offset_covariance + OFFSET_WALK**2 * seconds * np.eye(2),
            self.seen,
            self.motion,
            self.motion_covariance + walk,
            remembered(self.trust),
            self.delay,
            self.gyro_lag,
            self.met,
        )


def beforehand(settings: MagneticSettings) -> ToolConstants:
    """What is known before the first window."""
    return ToolConstants(
        complex(settings.offset_x, settings.offset_y),
        settings.offset_sigma**2 * np.eye(2),
        False,
        np.zeros(2, dtype=np.complex128),
        np.diag([settings.accel_sigma**2, settings.lever_sigma**2]).astype(np.complex128),
        np.tile(untried(), (4, 1)),
        (DELAY_SIGMA**-2, settings.mag_delay_s * DELAY_SIGMA**-2),
        (DELAY_SIGMA**-2, 0.0),
        np.zeros((2, SECTORS), dtype=np.complex128),
    )
