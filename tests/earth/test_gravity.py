"""Normal gravity against the gradient of the ellipsoid's own potential, and the Earth rate."""

from __future__ import annotations

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.constants import EARTH_RATE
from inclinometry.earth.gravity import FLATTENING, SEMI_MAJOR_AXIS, gravity_at_depth, normal_gravity, relative_gravity
from inclinometry.earth.rate import earth_rate, horizontal_rate
from inclinometry.orientation import angles, dip_angle
from inclinometry.rotations import dcm

GM = 3.986004418e14  # m^3/s^2, WGS84


def potential(r: float, z: float) -> float:
    """Gravity potential of the WGS84 level ellipsoid (Heiskanen and Moritz, Physical Geodesy, 2-62)."""
    a, b = SEMI_MAJOR_AXIS, SEMI_MAJOR_AXIS * (1.0 - FLATTENING)
    e2 = a * a - b * b
    e = np.sqrt(e2)
    s = r * r + z * z - e2
    u = np.sqrt(0.5 * s + np.sqrt(0.25 * s * s + e2 * z * z))
    beta = np.arctan2(z * np.sqrt(u * u + e2), u * r)

    def q(v: float) -> float:
        return float(0.5 * ((1.0 + 3.0 * v * v / e2) * np.arctan(e / v) - 3.0 * v / e))

    w2 = EARTH_RATE**2
    attraction = GM / e * np.arctan(e / u) + 0.5 * w2 * a * a * q(u) / q(b) * (np.sin(beta) ** 2 - 1.0 / 3.0)
    return float(attraction + 0.5 * w2 * (u * u + e2) * np.cos(beta) ** 2)


def gravity_of_the_potential(latitude: float, height: float) -> float:
    eccentricity2 = FLATTENING * (2.0 - FLATTENING)
    n = SEMI_MAJOR_AXIS / np.sqrt(1.0 - eccentricity2 * np.sin(latitude) ** 2)
    r, z = (n + height) * np.cos(latitude), (n * (1.0 - eccentricity2) + height) * np.sin(latitude)
    h = 2000.0
    dr = (potential(r + h, z) - potential(r - h, z)) / (2.0 * h)
    dz = (potential(r, z + h) - potential(r, z - h)) / (2.0 * h)
    return float(np.hypot(dr, dz))


@pytest.mark.parametrize("latitude", [0.0, 0.3, -0.8, 1.2, 1.5])
@pytest.mark.parametrize("height", [0.0, 1000.0, 8000.0, -3000.0])
def test_against_the_gradient_of_the_potential(latitude: float, height: float) -> None:
    # difference quotient: 3 g (h/R)^2 ~ 1e-6 truncated, rounding of U (6e7 * 1e-16 * amplification in q) ~ 1e-6;
    # the free-air series drops (h/R)^2 f terms: 2e-7 at 8 km
    expected = gravity_of_the_potential(latitude, height)
    assert float(normal_gravity(latitude, height)) == pytest.approx(expected, abs=3e-6)


def test_published_values() -> None:
    # NIMA TR8350.2, table 3.4: gravity at the equator and at the pole, printed to 1e-10
    assert float(normal_gravity(0.0)) == pytest.approx(9.7803253359, abs=1e-10)
    assert float(normal_gravity(np.pi / 2)) == pytest.approx(9.8321849378, abs=1e-9)
    assert float(normal_gravity(-np.pi / 2)) == float(normal_gravity(np.pi / 2))
    # free-air gradient 0.3086 mGal/m
    gradient = float(normal_gravity(np.pi / 4, 1.0) - normal_gravity(np.pi / 4))
    assert gradient == pytest.approx(-3.086e-6, abs=1e-9)


def test_depth() -> None:
    assert float(gravity_at_depth(0.7, 0.0, 300.0)) == float(normal_gravity(0.7, 300.0))
    per_metre = float(gravity_at_depth(0.7, 1000.0) - normal_gravity(0.7)) / 1000.0
    # Prey's gradient is quoted as 0.0848 mGal/m
    assert per_metre == pytest.approx(0.0848e-5, abs=0.0005e-5)
    with refused("input-value", name="depth"):
        gravity_at_depth(0.7, -1.0)


def test_degrees_for_radians_are_refused() -> None:
    with refused("input-value", name="latitude"):
        normal_gravity(45.0)
    with refused("input-value", name="height"):
        normal_gravity(0.5, 1e6)
    with refused("input-value", name="latitude"):
        earth_rate(60.0)


def test_earth_rate_is_a_field_like_any_other() -> None:
    latitude = np.array([-1.2, 0.0, 0.9])
    rate = earth_rate(latitude)
    np.testing.assert_allclose(np.linalg.norm(rate, axis=-1), EARTH_RATE, rtol=1e-15)
    np.testing.assert_allclose(dip_angle([0.0, 0.0, 1.0], rate), -latitude, atol=1e-15)
    np.testing.assert_allclose(horizontal_rate(latitude), rate[:, 0], rtol=1e-15)
    found = angles(dcm(0.5, 0.4, 0.3)[:, 2], rate @ dcm(0.5, 0.4, 0.3).T)
    np.testing.assert_allclose(found.azimuth, 0.5, atol=1e-14)


def test_gravity_relative_to_that_of_a_calibration() -> None:
    assert relative_gravity(None, 9.8121) == (1.0, 0.003)
    np.testing.assert_allclose(relative_gravity(9.8192, 9.7950, 1e-4), (1.002471, 0.000101), atol=1e-6)
