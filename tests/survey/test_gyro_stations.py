"""Stations of a gyro run as a survey: order, north, uncertainty."""

from __future__ import annotations

import numpy as np
import pytest
from tests.refusals import coded, refused

from inclinometry.constants import EARTH_RATE
from inclinometry.earth.site import Site
from inclinometry.gyro.joint import earth_in_tool
from inclinometry.gyro.north import estimate_north
from inclinometry.gyro.result import FLAGS
from inclinometry.rotations import wrap_signed
from inclinometry.survey.flags import summary
from inclinometry.survey.gyro import gyro_survey

LATITUDE = np.radians(50.0)
INCLINATION, AZIMUTH = np.radians([10.0, 30.0, 60.0]), np.radians([1.0, 120.0, 300.0])


def north(rows=slice(None)):
    inclination, azimuth = INCLINATION[rows], AZIMUTH[rows]
    zero = np.zeros_like(inclination)
    down = 9.8 * np.stack([-np.sin(inclination), zero, np.cos(inclination)], axis=1)
    rate = EARTH_RATE * earth_in_tool(azimuth, inclination, LATITUDE)
    return estimate_north(
        down, rate, LATITUDE, gravity_covariance=1e-7 * np.eye(3), rate_covariance=1e-15 * np.eye(3), scale_sd=0.001
    )


def test_downward_and_upward_are_the_same_survey():
    depth = np.array([100.0, 200.0, 300.0])
    flags = [("spike",), (), ("noisy",)]
    one = gyro_survey(depth, north(), flags=flags, g_total=[9.79, 9.8, 9.81])
    other = gyro_survey(depth[::-1], north(slice(None, None, -1)), flags=flags[::-1], g_total=[9.81, 9.8, 9.79])
    for name in ("md", "inclination", "azimuth", "toolface", "magnetic_toolface", "g_total", "u_azimuth"):
        # the batch of stations is solved together; its order may move a last digit
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-12, atol=1e-15)
    assert list(one.flags) == list(other.flags)
    assert one.flags[0][-1] == "spike"
    assert "survey-bottom-up" in coded(other.findings)
    assert "survey-bottom-up" not in coded(one.findings)


def test_two_stations_from_the_bottom_up_are_turned_round():
    both = gyro_survey([200.0, 100.0], north(slice(0, 2)))
    assert both.md.tolist() == [100.0, 200.0]
    np.testing.assert_allclose(both.inclination, INCLINATION[:2][::-1], atol=1e-9)


def test_azimuths_count_from_true_north_unless_the_site_says_grid():
    depth, found = [1.0, 2.0, 3.0], north()
    for site in (None, Site(latitude=LATITUDE), Site(latitude=LATITUDE, north_reference="true", convergence=0.1)):
        survey = gyro_survey(depth, found, site=site)
        assert survey.azimuth_reference == "true"
        np.testing.assert_allclose(wrap_signed(survey.azimuth - AZIMUTH), 0.0, atol=1e-9)


def test_grid_north_is_true_less_convergence_and_its_doubt_is_added():
    bend, doubt = np.radians(2.5), np.radians(0.3)
    true = gyro_survey([1.0, 2.0, 3.0], north())
    site = Site(latitude=LATITUDE, north_reference="grid", convergence=bend)
    grid = gyro_survey([1.0, 2.0, 3.0], north(), site=site)
    assert grid.azimuth_reference == "grid"
    np.testing.assert_allclose(wrap_signed(true.azimuth - grid.azimuth), bend, atol=1e-12)
    assert ((grid.azimuth >= 0.0) & (grid.azimuth < 2 * np.pi)).all()
    np.testing.assert_array_equal(grid.toolface, true.toolface)
    np.testing.assert_array_equal(grid.u_azimuth, true.u_azimuth)
    site = Site(latitude=LATITUDE, north_reference="grid", convergence=bend, convergence_sigma=doubt)
    wider = gyro_survey([1.0, 2.0, 3.0], north(), site=site)
    np.testing.assert_allclose(wider.u_azimuth, np.hypot(true.u_azimuth, doubt), rtol=1e-12)
    np.testing.assert_array_equal(wider.u_inclination, true.u_inclination)


def test_grid_north_without_convergence_is_refused():
    with refused("earth-site-lacks"):
        gyro_survey([1.0, 2.0, 3.0], north(), site=Site(latitude=LATITUDE, north_reference="grid"))


@pytest.mark.parametrize(
    ("md", "wanted"),
    [
        ([1.0, 2.0, 2.0], "input-order"),
        ([1.0, 3.0, 2.0], "input-order"),
        ([2.0, 2.0, 3.0], "input-order"),
    ],
)
def test_depths_that_turn_back_are_refused(md, wanted):
    with refused(wanted):
        gyro_survey(md, north())


def test_one_station_is_a_survey():
    survey = gyro_survey([5.0], north(slice(0, 1)), tool="A7", inputs={"raw": "x"})
    assert (len(survey), survey.tool, dict(survey.inputs)) == (1, "A7", {"raw": "x"})


def test_each_kind_of_flag_is_one_finding():
    assert set(FLAGS) >= {"temperature", "spike"}
    found = summary([("spike", "temperature"), ("spike",), ()], FLAGS)
    assert [(one.values["flag"], one.rows) for one in found] == [("spike", (0, 1)), ("temperature", (0,))]
