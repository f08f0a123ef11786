"""The Earth's rotation as a field vector, for gyros."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, within
from inclinometry.constants import EARTH_RATE


def earth_rate(latitude: ArrayLike) -> Array:
    """Earth rate (..., 3) in north, east, down, rad/s: w (cos lat, 0, -sin lat). In the north it points upwards."""
    phi = within(latitude, "latitude", -np.pi / 2, np.pi / 2, "rad")
    return EARTH_RATE * np.stack([np.cos(phi), np.zeros_like(phi), -np.sin(phi)], axis=-1)


def horizontal_rate(latitude: ArrayLike) -> Array:
    """Horizontal part of the Earth rate, rad/s, shape (...): what a gyro finds north with."""
    phi = within(latitude, "latitude", -np.pi / 2, np.pi / 2, "rad")
    return np.asarray(EARTH_RATE * np.cos(phi))
