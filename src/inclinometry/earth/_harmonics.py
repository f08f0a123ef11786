"""Synthesis of a main field from Schmidt semi-normalised Gauss coefficients; finite at the poles."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.earth.gravity import FLATTENING, SEMI_MAJOR_AXIS

REFERENCE_RADIUS: Final = 6371.2e3
"""Radius the coefficients refer to, m (geomagnetic convention)."""


class Coefficients(NamedTuple):
    """Gauss coefficients g, h (T, N + 1, N + 1) in nT at the decimal years (T,), linear between."""

    years: Array
    g: Array
    h: Array

    @property
    def degree(self) -> int:
        """Highest degree N."""
        return int(self.g.shape[1]) - 1

    def at(self, year: Array) -> tuple[Array, Array]:
        """g and h (N + 1, N + 1, P) at the years (P,), which lie within those of the model."""
        row = np.clip(np.searchsorted(self.years, year, side="right") - 1, 0, len(self.years) - 2)
        share = (year - self.years[row]) / (self.years[row + 1] - self.years[row])
        # in this form a year of the table gives the table's own coefficients
        g, h = ((1.0 - share) * np.moveaxis(t[row], 0, -1) + share * np.moveaxis(t[row + 1], 0, -1) for t in self[1:])
        return np.asarray(g), np.asarray(h)


def field_ned(model: Coefficients, latitude: Array, longitude: Array, height: Array, year: Array) -> Array:
    """Field (P, 3) north, east, down, nT, at geodetic points (P,), rad and m, and decimal years (P,) or (1,)."""
    radius, sine, cosine = geocentric(latitude, height)
    g, h = model.at(year)
    theta, outward, east = _spherical(model.degree, g, h, REFERENCE_RADIUS / radius, sine, cosine, longitude)
    # from the geocentric vertical to that of the ellipsoid: both lie in the meridian plane
    s = cosine * np.cos(latitude) - sine * np.sin(latitude)
    c = sine * np.cos(latitude) + cosine * np.sin(latitude)
    north, down = -theta * c + outward * s, -theta * s - outward * c
    return np.stack([north, east, down], axis=-1)


def geocentric(latitude: Array, height: Array) -> tuple[Array, Array, Array]:
    """Radius, m, and sine and cosine of the geocentric colatitude of a geodetic point."""
    eccentricity2 = FLATTENING * (2.0 - FLATTENING)
    normal = SEMI_MAJOR_AXIS / np.sqrt(1.0 - eccentricity2 * np.sin(latitude) ** 2)
    across = (normal + height) * np.cos(latitude)
    along = (normal * (1.0 - eccentricity2) + height) * np.sin(latitude)
    radius = np.hypot(across, along)
    return radius, across / radius, along / radius


def _spherical(
    degree: int, g: Array, h: Array, ratio: Array, sine: Array, cosine: Array, longitude: Array
) -> tuple[Array, Array, Array]:
    """Components along colatitude, radius and longitude, each (P,)."""
    theta, outward, east = (np.zeros_like(ratio) for _ in range(3))
    for m in range(degree + 1):
        c, s = np.cos(m * longitude), np.sin(m * longitude)
        for n, (p, slope, p_over_sine) in enumerate(legendre(degree, m, sine, cosine), start=max(m, 1)):
            scale = ratio ** (n + 2)
            wave, turned = g[n, m] * c + h[n, m] * s, g[n, m] * s - h[n, m] * c
            outward += scale * (n + 1) * wave * p
            theta -= scale * wave * slope
            east += scale * m * turned * p_over_sine
    return theta, outward, east


def legendre(degree: int, m: int, sine: Array, cosine: Array) -> list[tuple[Array, Array, Array]]:
    """(P, dP / d colatitude, P / sine) of order m and degrees max(m, 1) to `degree`, Schmidt semi-normalised.

    For m > 0 the recursion runs on Q = P / sine, a polynomial, so that nothing is divided at a pole.
    """
    if m == 0:
        return _zonal(degree, sine, cosine)
    before, q = np.zeros_like(sine), _sectoral(m, sine)
    found = []
    for n in range(m, degree + 1):
        if n > m:
            step = (2 * n - 1) * cosine * q - np.sqrt((n - 1) ** 2 - m**2) * before
            before, q = q, step / np.sqrt(n**2 - m**2)
        found.append((sine * q, n * cosine * q - np.sqrt(n**2 - m**2) * before, q))
    return found


def _sectoral(m: int, sine: Array) -> Array:
    """Q of degree and order m."""
    q = np.ones_like(sine)
    for k in range(2, m + 1):
        q = q * sine * np.sqrt((2 * k - 1) / (2 * k))
    return q


def _zonal(degree: int, sine: Array, cosine: Array) -> list[tuple[Array, Array, Array]]:
    """Order 0; its slope comes from order 1, and P / sine is never used."""
    before, p = np.ones_like(cosine), cosine
    first = legendre(degree, 1, sine, cosine)
    found = []
    for n in range(1, degree + 1):
        if n > 1:
            before, p = p, ((2 * n - 1) * cosine * p - (n - 1) * before) / n
        found.append((p, -np.sqrt(n * (n + 1) / 2.0) * first[n - 1][0], np.zeros_like(p)))
    return found
