"""A bias that walks from one index position to the next: found where it is, nowhere else, and counted."""

import numpy as np
import pytest

from inclinometry.gyro.bias_walk import bias_walk, walk_covariance
from inclinometry.gyro.indexing import average_index

FOUR = np.radians([0.0, 90.0, 180.0, 270.0])
MIRRORED = np.concatenate([FOUR, FOUR[::-1]])


def readings(stations, positions, walk, seed=1):
    """Two gyros of noise 1 across a field of 1000, each station with a bias of its own."""
    rng, index = np.random.default_rng(seed), np.tile(positions, stations)
    station = np.repeat(np.arange(stations), len(positions))
    field = 1000.0 * np.stack([np.cos(index + 0.3), -np.sin(index + 0.3)], axis=1)
    steps = np.cumsum(np.sqrt(walk) * rng.standard_normal(field.shape), axis=0)
    return station, index, field + steps + rng.standard_normal(field.shape)


@pytest.mark.parametrize("positions", [FOUR, MIRRORED])
def test_the_size_of_a_walk_is_found(positions):
    station, index, signals = readings(400, positions, 2.0)
    # 800 residuals in four positions: 2 w + 1 scatters by 5 %, which is 14 % of w
    assert bias_walk(station, index, signals, np.ones_like(signals)) == pytest.approx(2.0, rel=0.3)


def test_a_walk_there_is_not_is_seldom_counted():
    runs = [readings(30, FOUR, 0.0, seed) for seed in range(200)]
    counted = [bias_walk(*run, np.ones_like(run[2])) > 0.0 for run in runs]
    # chi-square of 60 degrees of freedom beyond two standard deviations: 2.8 %, of 200 runs 5.6 +- 2.3
    assert 0 < sum(counted) < 14


def test_what_turns_with_the_index_is_no_walk():
    # sensors skewed, scaled and biased as no calibration said: the same residuals to rounding
    station, index, signals = readings(30, FOUR, 0.0)
    wrong = signals @ [[1.01, 0.002], [-0.003, 0.98]] - signals
    turned = signals + 1000.0 * np.stack([np.cos(index - 1.0), 0.1 * np.sin(index)], axis=1) + 500.0
    one = np.ones_like(signals)
    assert np.abs(wrong).max() > 1.0
    assert bias_walk(station, index, turned, one) == pytest.approx(bias_walk(station, index, signals, one))


def test_too_few_positions_tell_nothing():
    station, index, signals = readings(50, FOUR[[0, 2]], 5.0)
    assert bias_walk(station, index, signals, np.ones_like(signals)) == 0.0


def test_the_covariance_of_a_walk_by_hand():
    # (x0 - x180) / 2: steps after the first and the second position move x180, that after the third nothing
    by = np.array([0.5, 0.0, -0.5, 0.0])[None, None, :, None]
    assert walk_covariance(by, 3.0) == pytest.approx(np.array([[[3.0 * (0.25 + 0.25)]]]))


def test_the_field_errs_as_its_covariance_says():
    station, index, signals = readings(600, FOUR, 2.0)
    found = average_index(station, index, signals, scheme="four", noise=[1.0, 1.0])
    error = found.field[:, :2] - 1000.0 * np.array([np.cos(0.3), -np.sin(0.3)])
    plain = average_index(station, index, signals, scheme="four", noise=[1.0, 1.0], walk=0.0)
    honest, before = (np.mean(error**2 / np.diagonal(one.covariance[:, :2, :2], axis1=1, axis2=2))
                      for one in (found, plain))  # fmt: skip
    assert before > 2.2  # a walk of twice the noise triples the variance, less what "noisy" stations say
    assert honest == pytest.approx(1.0, abs=0.25)
