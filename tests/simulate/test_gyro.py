"""Simulated gyro runs: exact without noise, with exactly the noise that was asked for."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.constants import EARTH_RATE
from inclinometry.earth.rate import earth_rate
from inclinometry.rotations import dcm, rotation_z
from inclinometry.simulate.gyro import (
    FOUR_POSITIONS,
    GyroSensors,
    Spike,
    hot_run,
    simulate_gyro_run,
    simulate_north_seeking,
)
from inclinometry.simulate.tool import flicker_rate, white_rate

LATITUDE = np.radians(52.0)
PATH = ([10.0, 20.0], np.radians([15.0, 130.0]), np.radians([40.0, 310.0]), np.radians([200.0, 33.0]))


def test_without_errors_each_reading_is_the_turned_field():
    tensor = np.array([[1.0, 0.01, 0.0], [0.0, 0.99, 0.02], [0.1, 0.0, 1.0]])
    run = simulate_gyro_run(
        *PATH, latitude=LATITUDE, scale=[1.01, 0.99], temperature=[20.0, 90.0], positions=[0.3, 2.0, 5.0],
        sensors=GyroSensors(gyro_tensor=tensor, accelerometer_tensor=np.eye(3)), seed=1,
    )  # fmt: skip
    assert run.gyro.shape == (6, 3)
    for row in range(6):
        s, angle = row // 3, (0.3, 2.0, 5.0)[row % 3]
        turned = rotation_z(angle) @ dcm(PATH[2][s], PATH[1][s], PATH[3][s])
        np.testing.assert_allclose(run.gyro[row] * (1.01, 0.99)[s], tensor @ turned @ earth_rate(LATITUDE), rtol=1e-12)
        np.testing.assert_allclose(run.accelerometer[row], 9.80665 * turned[:, 2], atol=1e-14)
    np.testing.assert_array_equal(run.gyro, run.clean)
    np.testing.assert_array_equal(run.temperature, [20, 20, 20, 90, 90, 90])
    np.testing.assert_array_equal(run.station, [1, 1, 1, 2, 2, 2])
    # 5 s settling and the middle of 60 s; then 65 s each; 120 s to the next station
    np.testing.assert_allclose(run.time, [35.0, 100.0, 165.0, 350.0, 415.0, 480.0])


def test_bias_drift_and_spikes_are_what_was_asked_for():
    sensors = GyroSensors(gyro_bias=np.array([3e-5, -1e-5]), gyro_drift=1e-9, accelerometer_bias=0.02)
    run = simulate_gyro_run(*PATH, latitude=0.1, sensors=sensors, spikes=[Spike(1, 2, 0, 5e-5)], seed=1)
    expected = [3e-5, -1e-5] + 1e-9 * run.time[:, None]
    expected[6, 0] += 5e-5
    np.testing.assert_allclose(run.gyro - run.clean, expected, atol=1e-18)
    perfect = simulate_gyro_run(*PATH, latitude=0.1, seed=1)
    np.testing.assert_allclose(run.accelerometer - perfect.accelerometer, 0.02, atol=1e-14)


def test_noise_has_the_stated_spread_and_its_own_stream():
    n = 3000
    path = (np.arange(n), np.full(n, 0.5), np.zeros(n), np.zeros(n))
    sensors = GyroSensors(arw=2e-6, accelerometer_noise=1e-3)
    run = simulate_gyro_run(*path, latitude=0.1, dwell=100.0, sensors=sensors, seed=4)
    assert run.noise == {"gyro": pytest.approx(2e-7), "accelerometer": 1e-3}
    # 24000 values: 0.46 % on the sd; 4 sd
    assert (run.gyro - run.clean).std() == pytest.approx(2e-7, rel=0.02)
    perfect = simulate_gyro_run(*path, latitude=0.1, dwell=100.0, seed=4)
    assert (run.accelerometer - perfect.accelerometer).std() == pytest.approx(1e-3, rel=0.02)
    # what one sensor is given does not disturb the draws of the other
    more = GyroSensors(arw=2e-6, accelerometer_noise=1e-3, flicker=1e-7)
    again = simulate_gyro_run(*path, latitude=0.1, dwell=100.0, sensors=more, seed=4)
    np.testing.assert_array_equal(again.accelerometer, run.accelerometer)


def allan(rate, m):
    """Allan deviation at m samples, not overlapping, written out."""
    means = rate[..., : rate.shape[-1] // m * m].reshape(*rate.shape[:-1], -1, m).mean(axis=-1)
    return np.sqrt(0.5 * np.mean(np.diff(means, axis=-1) ** 2))


def test_flicker_has_a_flat_allan_deviation_at_its_floor():
    rate = flicker_rate(np.random.default_rng(2), (200, 4096), 3.0)
    for m in (8, 32, 128):  # beyond the sampling; 200 x 32 groups or more: 2 % of scatter at most
        assert allan(rate, m) == pytest.approx(3.0 * np.sqrt(2 * np.log(2) / np.pi), rel=0.06)


def test_flicker_is_the_plain_filter():
    white = np.random.default_rng(2).standard_normal((2, 2 * 7))
    response = [1.0]
    for k in range(1, 14):
        response.append(response[-1] * (k - 0.5) / k)
    plain = [[sum(response[j] * w[i - j] for j in range(i + 1)) for i in range(7, 14)] for w in white]
    np.testing.assert_allclose(flicker_rate(np.random.default_rng(2), (2, 7), 1.0), plain, atol=1e-14)


def test_white_rate_falls_with_the_root_of_time():
    rate = white_rate(np.random.default_rng(2), (100, 4096), 5.0, 4.0)
    for m in (1, 16):
        assert allan(rate, m) == pytest.approx(5.0 / np.sqrt(4.0 * m), rel=0.03)


def test_the_hot_run_is_the_agreed_scenario():
    runs = [hot_run(seed) for seed in range(300)]
    stacked = {name: np.array([getattr(r, name) for r in runs]) for name in ("temperature", "scale", "inclination")}
    assert stacked["temperature"].shape == (300, 60)
    t = stacked["temperature"]
    np.testing.assert_allclose(t.mean(axis=0), np.linspace(20, 140, 60), atol=4 * 0.6 * np.sqrt(60 / 300))
    assert np.diff(t, axis=1).std() == pytest.approx(0.6, rel=0.03)  # 17700 values: 0.5 %
    d = (t[:, -1] - 20) / 100
    expected = np.sqrt(np.mean((0.005 * d) ** 2 + (0.003 * d**2) ** 2) + 0.0005**2)
    assert (stacked["scale"][:, -1] - 1).std() == pytest.approx(expected, rel=0.17)  # 300 values: 4 sd
    np.testing.assert_allclose(stacked["inclination"][:, 0], np.radians(2.0))
    assert stacked["inclination"].max() <= np.radians(88.0)
    turns = np.angle(np.exp(1j * np.diff([r.azimuth for r in runs], axis=1)))
    assert np.degrees(turns.std()) == pytest.approx(1.5, rel=0.03)
    noise = np.array([[r.a - r.clean_a, r.b - r.clean_b] for r in runs])
    assert noise.std() == pytest.approx(0.015 / np.degrees(EARTH_RATE * 3600), rel=0.02)


def test_hot_run_rates_are_those_of_the_closed_form():
    run = hot_run(3, latitude=0.7)
    c, s = np.cos(0.7), np.sin(0.7)
    x = c * np.cos(run.azimuth) * np.cos(run.inclination) + s * np.sin(run.inclination)
    np.testing.assert_allclose(run.clean_a * run.scale, x, atol=1e-14)
    np.testing.assert_allclose(run.clean_b * run.scale, -c * np.sin(run.azimuth), atol=1e-14)


def test_north_seeking_sees_the_cosine_and_its_drift():
    still = simulate_north_seeking(FOUR_POSITIONS, latitude=LATITUDE, scale=1.02, bias=1e-4, runs=5, seed=1)
    moving = simulate_north_seeking(
        FOUR_POSITIONS, latitude=LATITUDE, scale=1.02, bias=1e-4, drift=1e-7, runs=5, seed=1
    )
    h = EARTH_RATE * np.cos(LATITUDE) / 1.02
    np.testing.assert_allclose(still.rate, h * np.cos(still.azimuth[:, None] + FOUR_POSITIONS) + 1e-4, atol=1e-18)
    np.testing.assert_allclose(moving.rate - still.rate, [1e-7 * np.array([-1.5, -0.5, 0.5, 1.5])] * 5, atol=1e-18)


def test_the_same_seed_gives_the_same_run():
    sensors = GyroSensors(arw=1e-6, flicker=1e-7, accelerometer_noise=1e-3)
    first, second = (simulate_gyro_run(*PATH, latitude=0.1, sensors=sensors, seed=9) for _ in range(2))
    np.testing.assert_array_equal(first.gyro, second.gyro)
    np.testing.assert_array_equal(hot_run(3).a, hot_run(3).a)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"md": [1.0]}, "input-shape"),
        ({"dwell": 0.0}, "input-value"),
        ({"settle": -1.0}, "input-value"),
        ({"scale": 0.0}, "input-value"),
        ({"latitude": 2.0}, "input-value"),
        ({"spikes": [Spike(2, 0, 0, 1.0)]}, "input-value"),
    ],
)
def test_what_cannot_be_simulated_is_refused(options, message):
    given = {"md": PATH[0], "inclination": PATH[1], "azimuth": PATH[2], "toolface": PATH[3], "latitude": 0.1, "seed": 1}
    with refused(message):
        simulate_gyro_run(**(given | options))


def test_negative_noise_is_refused():
    with refused("input-value", name="arw"):
        GyroSensors(arw=-1.0)
