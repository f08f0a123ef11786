"""Continuous logs: still means still, the turning rate is the derivative of the orientation."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.constants import EARTH_RATE
from inclinometry.rotations import cross_matrix, dcm
from inclinometry.simulate.log import simulate_log
from inclinometry.simulate.tool import realistic_tool

POSES = np.radians([(0, 10, 0), (120, 90, 30), (120, 90, 30), (250, 150, 200)]).T
TOOL = realistic_tool(1, sensors={"accelerometer": 3, "magnetometer": 3, "gyro": 3}, bits=None)


def test_still_periods_are_where_they_should_be_and_hold_the_pose():
    log = simulate_log(TOOL, *POSES, dwell=[3, 4, 5, 6], move=[1, 2, 3], rate=50, noise={}, seed=1)
    np.testing.assert_allclose(log.still, [[0, 3], [4, 8], [10, 15], [18, 24]])
    assert log.time[-1] == 24.0
    np.testing.assert_allclose(np.diff(log.time), 0.02, rtol=1e-9)
    for pose in range(4):
        rows = log.pose == pose
        start, end = log.still[pose]
        np.testing.assert_array_equal(rows, (log.time >= start) & (log.time <= end))
        np.testing.assert_allclose(
            log.orientation[rows], np.broadcast_to(dcm(*POSES[:, pose]), (rows.sum(), 3, 3)), atol=1e-15
        )
        assert np.ptp(log.signals["accelerometer"][rows], axis=0).max() < 1e-12
        assert np.abs(log.rate[rows]).max() == 0.0
    moving = log.pose == -1
    assert moving.sum() + sum((log.pose == p).sum() for p in range(4)) == log.time.size


def test_turning_rate_is_the_derivative_of_the_orientation():
    log = simulate_log(TOOL, *POSES, rate=2000.0, dwell=0.2, move=0.5, shake=0.0, noise={}, seed=1)
    # dC/dt = -[w x] C; central differences at 2 kHz are good to (dt^2 / 6) times the third derivative, about 1e-4 rad/s
    slope = (log.orientation[2:] - log.orientation[:-2]) * 1000.0
    expected = -cross_matrix(log.rate) @ log.orientation
    np.testing.assert_allclose(slope, expected[1:-1], atol=2e-3)
    gyro = TOOL.triads["gyro"].field(log.signals["gyro"]) * EARTH_RATE
    earth = log.orientation @ [np.cos(np.radians(60)), 0, -np.sin(np.radians(60))] * EARTH_RATE
    np.testing.assert_allclose(gyro, log.rate + earth, atol=1e-12)


def test_shaking_only_while_moving():
    quiet = simulate_log(TOOL, *POSES, shake=0.0, noise={}, seed=1)
    shaken = simulate_log(TOOL, *POSES, shake=2.0, noise={}, seed=1)
    change = np.linalg.norm(shaken.signals["accelerometer"] - quiet.signals["accelerometer"], axis=-1)
    assert change[quiet.pose >= 0].max() == 0.0
    # three axes of 2 m/s^2 near the middle of each move, also of the one that turns nothing
    for start, end in zip(quiet.still[:-1, 1], quiet.still[1:, 0], strict=True):
        middle = np.abs(quiet.time - (start + end) / 2) < 0.25
        assert 2.5 < np.sqrt(np.mean(change[middle] ** 2)) < 4.5
    assert np.array_equal(shaken.signals["magnetometer"], quiet.signals["magnetometer"])


def test_noise_and_drift():
    log = simulate_log(TOOL, *POSES, noise={"accelerometer": 0.02}, drift={"accelerometer": [0.01, 0.0, -0.02]}, seed=1)
    residual = log.signals["accelerometer"] - log.clean["accelerometer"]
    assert residual.std() == pytest.approx(0.02, rel=0.05)
    steady = simulate_log(TOOL, *POSES, noise={}, seed=1)
    drift = log.clean["accelerometer"] - steady.clean["accelerometer"]
    np.testing.assert_allclose(drift, log.time[:, None] * [0.01, 0.0, -0.02], atol=1e-12)


def test_one_pose_and_a_coarse_converter():
    log = simulate_log(TOOL, [0.0], [1.0], [2.0], dwell=1.0, rate=10.0, bits=12, seed=1)
    assert (log.pose == 0).all()
    assert log.still.shape == (1, 2)
    turned = simulate_log(TOOL, *POSES, bits=12, seed=1)
    assert turned.saturated["gyro"].any()  # turned by hand, far beyond the Earth rate
    assert not turned.saturated["gyro"][turned.pose == 0].any()


def test_impossible_logs_are_refused():
    with refused("input-shape", name="azimuth, inclination, toolface"):
        simulate_log(TOOL, [0.0], [1.0], [2.0, 3.0], seed=1)
    with refused("input-value", name="dwell"):
        simulate_log(TOOL, *POSES, dwell=0.0, seed=1)
    with refused("input-value", name="rate"):
        simulate_log(TOOL, *POSES, rate=-1.0, seed=1)
