"""What of transverse gravity stands still in the hole, and what turns with the tool."""

from __future__ import annotations

import numpy as np

from inclinometry.motion.magnetic.band import Complex
from inclinometry.motion.magnetic.constants import ToolConstants
from inclinometry.motion.magnetic.demodulate import Demodulated


def regressors(d: Demodulated) -> Complex:
    """Columns (m, 3): gravity, an accelerometer's offset, its lever arm.

    Notes
    -----
    An accelerometer at r from the axis reads the apparent gravity omega x (r x omega) - alpha x r, in the tool's
    transverse axes (omega^2 - i alpha) r.
    """
    lever = (d.rate**2 - 1j * d.acceleration) * d.back
    return np.stack([np.ones_like(d.back), d.back, lever], axis=1)


def prior(known: ToolConstants) -> Complex:
    """Precision (3, 3) of their coefficients; nothing is known of gravity."""
    precision = np.zeros((3, 3), dtype=np.complex128)
    precision[1:, 1:] = np.linalg.inv(known.motion_covariance)
    return precision
