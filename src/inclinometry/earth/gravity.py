"""Normal gravity of the WGS84 ellipsoid: what an accelerometer should see before local geology."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, within
from inclinometry.constants import GRAVITY_SPREAD, STANDARD_GRAVITY, STATED_GRAVITY_SD

SEMI_MAJOR_AXIS: Final = 6378137.0
"""m (WGS84)."""
FLATTENING: Final = 1.0 / 298.257223563
"""WGS84."""


def normal_gravity(latitude: ArrayLike, height: ArrayLike = 0.0) -> Array:
    """Gravity of the WGS84 ellipsoid, m/s^2, at a geodetic latitude (rad) and height (m, -12000 to 20000).

    Somigliana's closed formula (NIMA TR8350.2, equation 4-1) and the second-order free-air reduction (4-3). A negative
    height is free air too: right in a valley or at small depths; inside rock use `gravity_at_depth`.
    """
    phi = within(latitude, "latitude", -np.pi / 2, np.pi / 2, "rad")
    h = within(height, "height", -12e3, 20e3, "m")
    sine2 = np.sin(phi) ** 2
    eccentricity2 = FLATTENING * (2.0 - FLATTENING)
    equatorial = 9.7803253359  # m/s^2 (NIMA TR8350.2, table 3.4)
    somigliana = 0.00193185265241  # constant k of Somigliana's formula (NIMA TR8350.2, table 3.4)
    surface = equatorial * (1.0 + somigliana * sine2) / np.sqrt(1.0 - eccentricity2 * sine2)
    centrifugal_ratio = 0.00344978650684  # m = omega^2 a^2 b / GM (NIMA TR8350.2, table 3.4)
    first = 1.0 + FLATTENING + centrifugal_ratio - 2.0 * FLATTENING * sine2
    ratio = h / SEMI_MAJOR_AXIS
    return np.asarray(surface * (1.0 - 2.0 * first * ratio + 3.0 * ratio**2))


def gravity_at_depth(latitude: ArrayLike, depth: ArrayLike, surface_height: ArrayLike = 0.0) -> Array:
    """Normal gravity inside rock, `depth` metres below a level surface at `surface_height`.

    Parameters
    ----------
    latitude : (...) array_like
        Geodetic, rad.
    depth : (...) array_like
        Below the surface, m, 0 to 12000.
    surface_height : (...) array_like
        Height of the surface, m.

    Returns
    -------
    (...) ndarray
        m/s^2.

    Raises
    ------
    InputError
        A value out of range.

    Notes
    -----
    Prey's reduction: the free-air increase less twice the attraction 2 pi G rho of the rock passed,
    0.3086 - 0.2239 = 0.085 mGal/m for 2670 kg/m^3. At 5000 m this is 4.2e-3 m/s^2, where the free-air formula alone
    would say 15.4e-3; each 100 kg/m^3 of density changes it by 0.42e-3.

    Examples
    --------
    >>> float((gravity_at_depth(0.8, 5000.0) - normal_gravity(0.8)).round(4))
    0.0042
    """
    z = within(depth, "depth", 0.0, 12e3, "m")
    top = within(surface_height, "surface_height", -500.0, 8000.0, "m")
    gravitation = 6.67430e-11  # Newton's constant, m^3 kg^-1 s^-2 (CODATA 2018)
    crust_density = 2670.0  # conventional density of the upper crust, kg/m^3
    return np.asarray(normal_gravity(latitude, top - z) - 4.0 * np.pi * gravitation * crust_density * z)


def relative_gravity(
    here: float | None, calibration: float | None, here_sd: float | None = None
) -> tuple[float, float]:
    """Gravity in units of that at a calibration, and its standard uncertainty in the same units; inputs in m/s^2.

    Two accelerometers take their third component from |g|, in units of the gravity of their stand. A wrong value stated
    at both ends cancels at one place, elsewhere not: two places are assumed. The ratio is 1 where one is unknown. The
    sd is at most `GRAVITY_SPREAD` where one is unknown or a textbook's value (9.8, 9.81, 9.80665).
    """
    if here is None or calibration is None:
        return 1.0, GRAVITY_SPREAD
    own = stated_gravity_sd(here) if here_sd is None else here_sd / here
    return here / calibration, min(float(np.hypot(own, stated_gravity_sd(calibration))), GRAVITY_SPREAD)


def stated_gravity_sd(gravity: float | None) -> float:
    """Relative standard uncertainty of a stated gravity, m/s^2; a textbook's value says nothing of the place.

    Examples
    --------
    >>> stated_gravity_sd(9.8121), stated_gravity_sd(9.81), stated_gravity_sd(None)
    (0.0001, 0.003, 0.003)
    """
    textbook = gravity is None or any(abs(gravity - round(STANDARD_GRAVITY, n)) < 1e-9 for n in range(1, 6))
    return GRAVITY_SPREAD if textbook else STATED_GRAVITY_SD
