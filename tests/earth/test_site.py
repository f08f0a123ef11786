"""Sites: references of azimuth, ranges that catch wrong units."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from datetime import date

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.earth.gravity import normal_gravity
from inclinometry.earth.site import REFERENCES, Site, azimuth_sigma, convert_azimuth
from inclinometry.rotations import wrap_signed

SITE = Site(declination=np.radians(5.0), convergence=np.radians(2.0), declination_sigma=3e-3, convergence_sigma=4e-3)


def test_a_line_on_the_ground() -> None:
    # magnetic north 5 deg east of true, grid north 2 deg east of true; a line drawn at true azimuth 30
    assert np.degrees(convert_azimuth(np.radians(30.0), "true", "magnetic", SITE)) == pytest.approx(25.0, abs=1e-12)
    assert np.degrees(convert_azimuth(np.radians(30.0), "true", "grid", SITE)) == pytest.approx(28.0, abs=1e-12)


@given(st.floats(0.0, 6.28), st.sampled_from(REFERENCES), st.sampled_from(REFERENCES))
def test_there_and_back(azimuth: float, source: str, target: str) -> None:
    there = convert_azimuth(azimuth, source, target, SITE)
    assert abs(wrap_signed(convert_azimuth(there, target, source, SITE) - azimuth)) < 1e-14
    # by way of true north is the same as directly
    middle = convert_azimuth(convert_azimuth(azimuth, source, "true", SITE), "true", target, SITE)
    assert abs(wrap_signed(middle - there)) < 1e-14
    assert azimuth_sigma(source, target, SITE) == azimuth_sigma(target, source, SITE)


def test_sigma() -> None:
    assert azimuth_sigma("magnetic", "grid", SITE) == pytest.approx(5e-3)
    assert azimuth_sigma("grid", "grid", Site()) == 0.0
    with refused("earth-site-lacks"):
        azimuth_sigma("magnetic", "true", Site(declination=0.1))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"latitude": 45.0}, "input-value"),
        ({"declination": 5.0}, "input-value"),
        ({"dip": 68.0}, "input-value"),
        ({"g": 1.0}, "input-value"),
        ({"b": 48.0}, "input-value"),
        ({"b": float("nan")}, "input-finite"),
        ({"b": 5e4, "b_sigma": -1.0}, "input-value"),
        ({"dip_sigma": 0.1}, "input-needs"),
        ({"north_reference": "True"}, "input-choice"),
        ({"longitude": "west"}, "input-kind"),
    ],
)
def test_wrong_units_and_contradictions(values: dict[str, object], message: str) -> None:
    with refused(message):
        Site(**values)  # type: ignore[arg-type]


def test_gravity_of_a_site() -> None:
    assert Site().gravity is None
    assert Site().gravity_sigma is None
    assert Site(g=9.81).gravity == 9.81
    assert Site(g=9.81, g_sigma=1e-4, latitude=0.1).gravity_sigma == 1e-4
    site = Site(latitude=0.8, height_m=1000.0, date=date(2018, 6, 1))
    assert site.gravity == float(normal_gravity(0.8, 1000.0))
    assert site.gravity_sigma == 4e-4


def test_frozen() -> None:
    with pytest.raises(FrozenInstanceError):
        SITE.declination = 0.0  # type: ignore[misc]
