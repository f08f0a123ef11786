"""How long to stand still: the level law, the joint estimate's own Fisher information, and what no time lowers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.refusals import coded, refused

from inclinometry.allan import FLAT
from inclinometry.constants import EARTH_RATE
from inclinometry.gyro.joint import solve_joint
from inclinometry.gyro.planning import GyroSetup, azimuth_sigma, standstill_time

ARW = np.radians(0.005) / 60.0
ONE = GyroSetup(ARW, gyros=1)
AROUND = np.radians(np.arange(0.0, 360.0, 7.5))


@pytest.mark.parametrize("latitude", [0.0, 0.5, -1.1])
@pytest.mark.parametrize("azimuth", [0.0, 1.0, 4.0])
def test_the_level_law(latitude, azimuth):
    """One gyro, sensing plane level: sqrt(2) N / (sqrt(T) we cos a) at every azimuth, the scale being seen as well."""
    sigma = azimuth_sigma(latitude, 0.0, np.array([azimuth]), 240.0, ONE)
    # planned 1e-6 rad off the vertical
    assert sigma == pytest.approx(np.sqrt(2.0 / 240.0) * ARW / (EARTH_RATE * np.cos(latitude)), rel=1e-5)


@pytest.mark.parametrize("axes", [2, 3])
@pytest.mark.parametrize("scale_sd", [0.003, 0.1])
def test_agrees_with_the_joint_estimate(axes, scale_sd):
    """The estimator's own covariance at noiseless rates."""
    latitude, inclination, time = 0.8, 1.2, 600.0
    setup = GyroSetup(ARW, scale_sd=scale_sd, axes=axes)
    level, down = np.cos(latitude), np.sin(latitude)
    north = level * np.cos(AROUND)
    rates = np.stack(
        [
            north * np.cos(inclination) + down * np.sin(inclination),
            -level * np.sin(AROUND),
            north * np.sin(inclination) - down * np.cos(inclination),
        ],
        axis=1,
    )[:, :axes]
    covariance = np.tile(np.eye(axes) * (ARW / EARTH_RATE) ** 2 / time, (len(AROUND), 1, 1))
    found = solve_joint(rates, covariance, inclination, latitude, scale_sd=scale_sd)
    expected = np.minimum(np.sqrt(found.var_azimuth), np.pi / np.sqrt(3.0))
    sigma = azimuth_sigma(latitude, inclination, AROUND, time, setup)
    # the same formula; the estimator's azimuth settles to 1e-9 or so
    np.testing.assert_allclose(sigma, expected, rtol=1e-5)


def test_the_plan_gives_what_was_asked():
    plan = standstill_time(1.0, 0.5, np.radians(0.2), GyroSetup(ARW, bias_instability=1e-8, tilt_sd=2e-4))
    sigma = azimuth_sigma(1.0, 0.5, plan.azimuth, plan.time, GyroSetup(ARW, bias_instability=1e-8, tilt_sd=2e-4))
    np.testing.assert_allclose(sigma, np.radians(0.2), rtol=1e-9)
    best, median, worst = (plan.time[plan.at(share)] for share in (0.0, 0.5, 1.0))
    assert best == plan.time.min()
    assert best <= median <= worst
    assert worst == plan.time.max()
    assert not plan.findings


def test_time_goes_with_noise_squared_and_falls_with_wanted():
    """With a scale factor seen by the rates alone everything scales with the noise."""
    setup = replace(ONE, scale_sd=1.0)
    one = standstill_time(0.7, 0.3, 1e-3, setup, azimuth=1.0).time
    assert standstill_time(0.7, 0.3, 1e-3, replace(setup, arw=3.0 * ARW), azimuth=1.0).time == pytest.approx(9.0 * one)
    # the prior of 1 is far from silent only at sigma near 1
    assert standstill_time(0.7, 0.3, 5e-4, setup, azimuth=1.0).time == pytest.approx(4.0 * one, rel=1e-4)
    assert standstill_time(0.7, 0.3, 1e-3, replace(setup, gyros=2), azimuth=1.0).time == pytest.approx(one / 2.0)


def test_symmetry_east_west_and_north_south():
    setup = GyroSetup(ARW, bias_instability=1e-8, tilt_sd=1e-4)
    sigma = azimuth_sigma(0.9, 1.0, AROUND, 300.0, setup)
    np.testing.assert_allclose(azimuth_sigma(0.9, 1.0, -AROUND, 300.0, setup), sigma, rtol=1e-9)
    # south of the equator the Earth rate points the other way down, and north becomes south
    np.testing.assert_allclose(azimuth_sigma(-0.9, 1.0, np.pi - AROUND, 300.0, setup), sigma, rtol=1e-9)


def test_level_error_of_a_vertical_tool():
    """tan(latitude) x tilt, whatever the azimuth: section 8 of the north-seeking theory."""
    quiet = GyroSetup(1e-12, tilt_sd=np.radians(0.1))
    for latitude in (0.3, np.pi / 4, -1.0):
        sigma = azimuth_sigma(latitude, 0.0, AROUND, 1e9, quiet)
        np.testing.assert_allclose(sigma, abs(np.tan(latitude)) * np.radians(0.1), rtol=1e-3, atol=1e-7)


def test_level_error_against_the_estimator_moved():
    """Tilting the model by a finite step moves the estimate as planned."""
    latitude, inclination, azimuth, step = 0.8, 0.9, 2.0, 1e-5
    setup = GyroSetup(ARW, scale_sd=0.01, tilt_sd=step)
    level, down = np.cos(latitude), np.sin(latitude)

    def rates(lean):
        north = level * np.cos(azimuth)
        return np.array(
            [[north * np.cos(lean) + down * np.sin(lean), -level * np.sin(azimuth)]],
        )

    covariance = np.eye(2)[None] * (ARW / EARTH_RATE) ** 2 / 500.0

    def estimate(h, lean):
        return float(solve_joint(h, covariance, lean, latitude, scale_sd=0.01).azimuth[0])

    h, turn = rates(inclination), step / np.sin(inclination)
    turned = h @ np.array([[1.0, turn], [-turn, 1.0]])
    moved = np.hypot(estimate(h, inclination + step) - azimuth, estimate(turned, inclination) - azimuth)
    added = np.sqrt(
        azimuth_sigma(latitude, inclination, np.array([azimuth]), 500.0, setup) ** 2
        - azimuth_sigma(latitude, inclination, np.array([azimuth]), 500.0, replace(setup, tilt_sd=0.0)) ** 2
    )
    # the step is 1e-5 of a radian, and the estimate settles to 1e-10
    assert added == pytest.approx(moved, rel=2e-3)


@pytest.mark.long
def test_flicker_left_by_four_positions():
    """Simulated: means of flicker noise over four contiguous quarters, as x+ - x- and y+ - y-."""
    from scipy.signal import fftconvolve

    rng, size, runs = np.random.default_rng(1), 4096, 400
    k = np.arange(1, 8 * size)
    impulse = np.concatenate([[1.0], np.cumprod((k - 0.5) / k)])
    noise = fftconvolve(impulse[None], rng.standard_normal((runs, 8 * size)), axes=1)[:, 4 * size : 8 * size]
    quarter = noise.reshape(runs, 4, size).mean(axis=2)
    x, y = (quarter[:, 0] - quarter[:, 2]) / 2.0, (quarter[:, 1] - quarter[:, 3]) / 2.0
    simulated = np.sqrt((x.var() + y.var()) / 2.0)
    planned = azimuth_sigma(0.0, 0.0, np.zeros(1), 1e12, GyroSetup(1e-12, bias_instability=1e-9, gyros=1))
    # 800 draws: 2.5 % a standard deviation
    assert planned * EARTH_RATE / 1e-9 == pytest.approx(simulated, rel=0.1)
    # adjacent blocks would give exactly the flat part over sqrt(2); these are a block apart
    assert simulated > FLAT / np.sqrt(2.0)


def test_what_no_time_lowers_is_said():
    plan = standstill_time(np.radians(60.0), np.radians(80.0), np.radians(0.2), GyroSetup(ARW, scale_sd=0.01))
    assert np.isinf(plan.time[plan.at(1.0)])
    assert np.isfinite(plan.time[plan.at(0.0)])
    assert np.isinf(plan.time[plan.floor > plan.wanted]).all()
    assert "third gyro, along the tool" in plan.findings[0].values["enough"]
    # a third gyro sees the scale from everywhere
    third = standstill_time(
        np.radians(60.0), np.radians(80.0), np.radians(0.2), GyroSetup(ARW, scale_sd=0.01, axes=3, axial_bias_sd=1e-12)
    )
    assert np.isfinite(third.time).all()
    tilted = GyroSetup(ARW, tilt_sd=np.radians(0.1))
    # between the worst floor and half of it
    wanted = 0.7 * float(standstill_time(1.0, 0.5, 0.1, tilted).floor.max())
    level = standstill_time(1.0, 0.5, wanted, tilted)
    assert "half the error of the level" in level.findings[0].values["enough"]


def test_floor_at_the_blind_azimuth_is_the_prior():
    """K = 0: the rates say nothing of the scale, and dpsi = tan a tan th sin psi ds remains of it."""
    latitude, inclination = np.pi / 4, np.radians(80.0)
    blind = np.arccos(-1.0 / (np.tan(latitude) * np.tan(inclination)))
    floor = standstill_time(latitude, inclination, 0.01, ONE, azimuth=blind).floor[0]
    x = np.cos(blind) * np.cos(inclination) * np.cos(latitude) + np.sin(latitude) * np.sin(inclination)
    y = -np.cos(latitude) * np.sin(blind)
    slope = np.cos(latitude) * np.hypot(np.sin(blind) * np.cos(inclination), np.cos(blind))
    # both rates are one equation here: k E + k E_psi dpsi with E parallel to E_psi
    assert floor == pytest.approx(0.003 * np.hypot(x, y) / slope, rel=1e-4)


def test_moves_and_the_vertical_are_told():
    plan = standstill_time(1.0, 0.0, 0.01, replace(ONE, axes=3), azimuth=0.0, move_time=5.0)
    assert plan.moving == 15.0
    assert coded(plan.findings) == ["gyro-plan-vertical", "gyro-plan-axial"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"latitude": np.radians(95.0)}, "input-value"),
        ({"latitude": np.pi / 2}, "input-value"),
        ({"inclination": -0.1}, "input-value"),
        ({"azimuth_sd": 0.0}, "input-value"),
        ({"azimuth_sd": -0.1}, "input-value"),
        ({"azimuth": np.nan}, "input-finite"),
        ({"azimuth": np.radians(361.0)}, "input-value"),
        ({"azimuth": np.radians(-361.0)}, "input-value"),
        ({"move_time": -1.0}, "input-value"),
    ],
)
def test_bad_places_are_refused(change, words):
    given = {"latitude": 1.0, "inclination": 0.5, "azimuth_sd": 0.01, "setup": ONE} | change
    with refused(words):
        standstill_time(**given)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"arw": 0.0}, "input-value"),
        ({"arw": -1e-6}, "input-value"),
        ({"scale_sd": np.nan}, "input-finite"),
        ({"gyros": 3}, "input-choice"),
        ({"axes": 1}, "input-choice"),
        ({"positions": (0.0, np.pi)}, "gyro-positions-alike"),
    ],
)
def test_bad_setups_are_refused(change, words):
    with refused(words):
        replace(ONE, **change)
