"""The formulas of north and scale factor from two gyros across the tool, each for arrays of any shape.

Symbols: th inclination, psi azimuth, T toolface, a latitude (north +), s scale factor (true rate = s x reading);
A, B readings turned back to the high side, in units of the Earth rate, so that s A = X and s B = Y with

    X = cos a cos psi cos th + sin a sin th,   Y = -cos a sin psi,   Z = cos a cos psi sin th - sin a cos th
    K = cos a cos th + sin a sin th cos psi    (what the scale factor is seen through)

Source: "Temperature compensation method of a fibre-optic gyro inclinometer", patent application of Wuxi Huilian
Information Technology, 2015, steps C to F; formulas repaired, because the text in circulation lost its roots.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.angles import wrap_positive
from inclinometry.core.arrays import Array, finite, within
from inclinometry.core.constants import EARTH_RATE

HALF_PI: Final = np.pi / 2
_ARGUMENTS: Final = ("gx", "gy", "wx", "wy", "g", "latitude")


def high_side(rate: ArrayLike, toolface: ArrayLike) -> tuple[Array, Array]:
    """Cross-axis rates turned back by the toolface, to high side and 90 deg clockwise of it.

    Parameters
    ----------
    rate : (..., 2) or (..., 3) array_like
        x and y in tool axes, any unit; z is not used.
    toolface : (...) array_like
        rad.

    Returns
    -------
    a, b : (...) ndarray
        A = wx cos T - wy sin T, B = wx sin T + wy cos T, in the unit of `rate`.

    Examples
    --------
    >>> a, b = high_side([0.0, -2.0], np.pi / 2)
    >>> float(a), bool(abs(b) < 1e-15)
    (2.0, True)
    """
    rate, toolface = np.asarray(rate, dtype=np.float64), finite(toolface, "toolface")
    x, y = finite(rate[..., 0], "rate x"), finite(rate[..., 1], "rate y")
    c, s = np.cos(toolface), np.sin(toolface)
    return np.asarray(x * c - y * s), np.asarray(x * s + y * c)


def expected_rates(azimuth: ArrayLike, inclination: ArrayLike, latitude: ArrayLike) -> tuple[Array, Array, Array]:
    """High side, right and axial parts (X, Y, Z) of the Earth rate, in its unit; angles (...) in rad.

    Examples
    --------
    Down the vertical at 30 deg, azimuth east:

    >>> [round(float(v), 3) + 0.0 for v in expected_rates(np.pi / 2, 0.0, np.pi / 6)]
    [0.0, -0.866, -0.5]
    """
    psi, th, lat = (np.asarray(v, dtype=np.float64) for v in (azimuth, inclination, latitude))
    level, down = np.cos(lat), np.sin(lat)
    north = level * np.cos(psi)
    x, z = north * np.cos(th) + down * np.sin(th), north * np.sin(th) - down * np.cos(th)
    return np.asarray(x), np.asarray(-level * np.sin(psi) + 0.0 * z), np.asarray(z)


def scale_condition(azimuth: ArrayLike, inclination: ArrayLike, latitude: ArrayLike) -> Array:
    """K = cos a cos th + sin a sin th cos psi, shape (...): the uncertainty of the scale factor goes as 1/|K|.

    It is the east part of (tool axis) x (direction of the Earth rate); the root of the closed form that is true has
    its sign.

    Examples
    --------
    >>> round(float(scale_condition(np.pi, np.pi / 3, np.pi / 6)), 9)
    0.0
    """
    psi, th, lat = (np.asarray(v, dtype=np.float64) for v in (azimuth, inclination, latitude))
    return np.asarray(np.cos(lat) * np.cos(th) + np.sin(lat) * np.sin(th) * np.cos(psi))


def scale_roots(a: ArrayLike, b: ArrayLike, inclination: ArrayLike, latitude: ArrayLike) -> tuple[Array, Array]:
    """Both scale factors that make the horizontal Earth rate what it is at this latitude.

    Parameters
    ----------
    a, b : (...) array_like
        `high_side` readings in units of the Earth rate.
    inclination, latitude : (...) array_like
        rad; inclination 0 to 90 deg.

    Returns
    -------
    roots : (..., 2) ndarray
        With + and with - before the square root. NaN where the discriminant is negative or nothing is measured.
    discriminant : (...) ndarray
        What stands under the root; (cos a K / s)^2 for readings without error.

    Raises
    ------
    InputError
        Not finite, or an angle out of range.

    Notes
    -----
    Step D of the patent, with D = A^2 + B^2 cos^2 th (equal to the printed wx^2 + wy^2 - sin^2 th B^2):

        s = [A sin a sin th +- cos th sqrt((wx^2 + wy^2) cos^2 a - sin^2 th B^2)] / D.

    The smaller numerator is formed from the product of the roots, -cos(a + th) cos(a - th)/D, so that it keeps its
    digits. Both roots are positive wherever th > 90 deg - |a|.

    Examples
    --------
    >>> x, y, _ = expected_rates(np.radians(135.0), np.radians(75.0), np.radians(45.0))
    >>> scale_roots(x / 1.01, y / 1.01, np.radians(75.0), np.radians(45.0))[0].round(4)
    array([1.3531, 1.01  ])
    """
    a, b = finite(a, "a"), finite(b, "b")
    th, lat = within(inclination, "inclination", 0.0, HALF_PI, "rad"), within(latitude, "latitude", -HALF_PI, HALF_PI)
    discriminant = (a**2 + b**2) * np.cos(lat) ** 2 - (np.sin(th) * b) ** 2
    middle = a * np.sin(lat) * np.sin(th)
    product = -np.cos(lat + th) * np.cos(lat - th)
    with np.errstate(invalid="ignore", divide="ignore"):
        swing = np.cos(th) * np.sqrt(discriminant)
        large = middle + np.where(middle < 0.0, -swing, swing)
        d = a**2 + (b * np.cos(th)) ** 2
        first, second = large / d, np.where(large == 0.0, 0.0, product / large)
    plus, minus = np.where(middle < 0.0, second, first), np.where(middle < 0.0, first, second)
    bad = (discriminant < 0.0) | (d == 0.0)
    return np.where(bad[..., None], np.nan, np.stack([plus, minus], axis=-1)), np.asarray(discriminant)


def azimuth_arctan2(a: ArrayLike, b: ArrayLike, scale: ArrayLike, inclination: ArrayLike, latitude: ArrayLike) -> Array:
    """Azimuth psi = atan2(-s B cos th, s A - sin a sin th), rad in [0, 2 pi), with a scale factor that is known.

    Parameters
    ----------
    a, b, scale, inclination, latitude : (...) array_like
        As for `scale_roots`; they broadcast. Above 90 deg of inclination the result is the opposite azimuth, because
        the factor cos th that both arguments carry has changed sign. A NaN scale gives NaN.

    Notes
    -----
    The same as `patent_azimuth` without its factor g^2 sin th, so it holds down to the vertical.

    Examples
    --------
    >>> x, y, _ = expected_rates(np.radians(300.0), np.radians(60.0), np.radians(45.0))
    >>> float(np.degrees(azimuth_arctan2(x, y, 1.0, np.radians(60.0), np.radians(45.0))).round(9))
    300.0
    """
    a, b, s, th, lat = (np.asarray(v, dtype=np.float64) for v in (a, b, scale, inclination, latitude))
    return wrap_positive(np.arctan2(-s * b * np.cos(th), s * a - np.sin(lat) * np.sin(th)))


def patent_azimuth(
    gx: ArrayLike, gy: ArrayLike, wx: ArrayLike, wy: ArrayLike, g: ArrayLike, latitude: ArrayLike
) -> Array:
    """Azimuth by step F as it was meant, rad in [0, 2 pi); prefer `azimuth_arctan2`.

    Parameters
    ----------
    gx, gy, g : (...) array_like
        Gravity across the tool (the field, not the specific force) and its strength, one unit.
    wx, wy : (...) array_like
        True rates, rad/s (reading x scale factor).
    latitude : (...) array_like
        rad.

    Returns
    -------
    (...) ndarray
        NaN exactly vertical and horizontal, where the formula is 0/0. Right for 0 < th < 90 deg only: in an up-hole
        and with the specific force it is wrong, and not by half a turn.

    Notes
    -----
    The circulating text `arctan(2(-(wx gy - wy gx) g2 - gx2 - gy2 - g(...) ...))` lost a square root and a comma:

        psi = atan2(-(wx gy - wy gx) sqrt(g^2 - gx^2 - gy^2), -g (wx gx + wy gy) - we sin a (gx^2 + gy^2)).

    Examples
    --------
    >>> w = 7.292115e-5 * np.array([0.5, -0.6])
    >>> float(np.degrees(patent_azimuth(-4.9, 0.1, *w, 9.8, np.radians(45.0))).round(3))
    72.755
    """
    gx, gy, wx, wy, g, lat = (finite(v, n) for v, n in zip((gx, gy, wx, wy, g, latitude), _ARGUMENTS, strict=True))
    level = gx**2 + gy**2
    sine = -(wx * gy - wy * gx) * np.sqrt(np.maximum(g**2 - level, 0.0))
    cosine = -g * (wx * gx + wy * gy) - EARTH_RATE * np.sin(lat) * level
    return np.where((level == 0.0) | (level >= g**2), np.nan, wrap_positive(np.arctan2(sine, cosine)))


def printed_toolface(gx: ArrayLike, gy: ArrayLike) -> Array:
    """Toolface by step C as printed, rad in [-pi/2, 3 pi/2); kept to show its defects, use atan2(gy, -gx).

    -arctan(gy/gx) where gx <= 0, pi - arctan(gy/gx) where gx > 0. At gx = +0 exactly it is half a turn off
    (+-90 deg change places; at -0 they do not), and it is NaN where gx = gy = 0. Elsewhere it is right.

    Examples
    --------
    >>> np.degrees(printed_toolface([-1.0, 1.0, 0.0, -0.0], [1.0, 1.0, 1.0, 1.0]))
    array([ 45., 135., -90.,  90.])
    """
    gx, gy = finite(gx, "gx"), finite(gy, "gy")
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.arctan(gy / gx)
    return np.where(gx > 0.0, np.pi - slope, -slope)
