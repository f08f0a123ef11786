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
GRAVITY_SIGMA: Final = 4e-4
"""Standard deviation to assume for normal gravity when nothing is known of the place, m/s^2: gravity anomalies are
commonly some tens of mGal (1 mGal = 1e-5 m/s^2), here 40, and several times that in high mountains."""


def normal_gravity(latitude: ArrayLike, height: ArrayLike = 0.0) -> Array:
    """Gravity of the WGS84 ellipsoid on and above it.

    Parameters
    ----------
    latitude : (...) array_like
        Geodetic, rad.
    height : (...) array_like
        Above the ellipsoid, m, -12000 to 20000. A negative height is the free-air formula carried on downward, right
        in open air (a valley) or for small depths; inside rock use `gravity_at_depth`.

    Returns
    -------
    (...) ndarray
        m/s^2.

    Raises
    ------
    InputError
        Latitude or height out of range.

    Notes
    -----
    Somigliana's closed formula (NIMA TR8350.2, equation 4-1) and the second-order free-air reduction (4-3).

    Examples
    --------
    >>> normal_gravity(np.radians([0.0, 45.0, 90.0])).round(6)
    array([9.780325, 9.806198, 9.832185])
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
    """Gravity in units of that at a calibration, and its standard uncertainty in the same units.

    Two accelerometers are calibrated in units of the gravity of their stand and take their third component from |g|: a
    wrong value stated at both ends cancels at the same place, elsewhere it does not. Two places are assumed.

    Parameters
    ----------
    here : float or None
        Gravity where the tool is used, m/s^2, as stated or by the latitude.
    calibration : float or None
        Gravity stated at the calibration, m/s^2.
    here_sd : float, optional
        Standard uncertainty of `here`, m/s^2.

    Returns
    -------
    ratio : float
        1 where one of the two is not known.
    sd : float
        `GRAVITY_SPREAD` at most where one of them is not known or a textbook's value (9.8, 9.81, 9.80665).

    Examples
    --------
    >>> relative_gravity(None, 9.8121)
    (1.0, 0.003)
    >>> ratio, sd = relative_gravity(9.8192, 9.7950, 1e-4)
    >>> round(ratio, 6), round(sd, 6)
    (1.002471, 0.000101)
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
