"""What the page on gyros says in words about the numbers that are worked out for it."""

from importlib import import_module

import numpy as np
import pytest

figures = pytest.fixture(lambda: import_module("support.gyro_figures"))


def test_only_the_two_argument_arctangent_is_right(figures):
    errors = figures.arctangent_errors()
    meant, one_argument, *factor = errors.values()
    assert meant.max() < 1e-9  # rounding, amplified by 1 / (sin cos) of an inclination a degree from either end
    assert np.mean(one_argument > 179.0) == pytest.approx(0.5, abs=0.02)  # half the circle; 20 000 draws
    assert all(np.median(off) > 30.0 for off in factor)


def test_wrong_signs_of_force_and_latitude_are_half_a_turn_apart(figures):
    found = figures.sign_azimuths()
    apart = found["specific force for gravity"] - found["latitude south for north"]
    assert apart % 360.0 == pytest.approx(180.0, abs=1e-9)
    assert found["specific force for gravity"] == pytest.approx(found["gyros reversed"], abs=1e-9)
    assert found["none"] == pytest.approx(57.3, abs=1e-9)
    wrong = [found[name] for name in found if name != "none"]
    assert all(abs(value - 57.3) > 10.0 and abs(value - 237.3) > 10.0 for value in wrong)


def test_a_drift_fitted_over_one_turn_costs_a_third(figures):
    """The sine correlates with time by r^2 = 6/pi^2 over one turn; sixteen positions are nearly continuous."""
    schemes = figures.gyro_schemes
    costly = schemes.rms(schemes.error_deg("16 once round, drift fitted", {}))
    plain = schemes.theory_deg(figures.LATITUDE)
    factor = np.sqrt((1.0 + 1.0 / (1.0 - 6.0 / np.pi**2)) / 2.0)
    assert factor == pytest.approx(1.33, abs=0.005)
    assert costly / plain == pytest.approx(factor, rel=0.05)  # 1.1 % by chance, the rest by sixteen being finite


def test_the_closed_form_fails_on_the_share_of_the_map_that_its_picture_shows(figures):
    assert figures.lost_share() == pytest.approx(0.06, abs=0.01)


def test_the_flags_are_those_of_the_package(figures):
    from inclinometry.gyro.result import FLAGS

    text = figures.flags()["gyro_flags"]
    assert all(f"`{name}`" in text for name in FLAGS)
