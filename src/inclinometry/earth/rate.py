"""The Earth's rotation as a field vector, for gyros."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, within
from inclinometry.constants import EARTH_RATE


def earth_rate(latitude: ArrayLike) -> Array:
    """Earth rate vector in north, east, down.

    Parameters
    ----------
    latitude : (...) array_like
        Geodetic, rad, north positive.

    Returns
    -------
    (..., 3) ndarray
        rad/s: w (cos lat, 0, -sin lat). It points above the horizon in the north, so its dip is minus the latitude.

    Raises
    ------
    InputError
        Latitude beyond the poles.

    Examples
    --------
    >>> (earth_rate(np.radians(30.0)) / 7.292115e-5).round(6) + 0.0
    array([ 0.866025,  0.      , -0.5     ])
    """
    phi = within(latitude, "latitude", -np.pi / 2, np.pi / 2, "rad")
    return EARTH_RATE * np.stack([np.cos(phi), np.zeros_like(phi), -np.sin(phi)], axis=-1)


def horizontal_rate(latitude: ArrayLike) -> Array:
    """Horizontal part of the Earth rate, rad/s, shape (...): what a gyro finds north with.

    Examples
    --------
    In degrees per hour at 60 deg latitude:

    >>> float(np.degrees(3600.0 * horizontal_rate(np.radians(60.0))).round(3))
    7.521
    """
    phi = within(latitude, "latitude", -np.pi / 2, np.pi / 2, "rad")
    return np.asarray(EARTH_RATE * np.cos(phi))
