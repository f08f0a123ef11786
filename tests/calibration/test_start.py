"""Starting values of a fit: exact on exact readings, least squares on any plan, whatever the temperature does."""

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.calibration.initial_values import _refined, linear_start, sphere, zero_from_north
from inclinometry.calibration.likelihood import tangent_basis
from inclinometry.rotations import dcm

A = np.array([0.5, -0.3, np.sqrt(0.66)])
TENSOR = np.array([[3.0, 1.0, 0.2], [0.0, 2.0, -0.4], [0.5, 0.0, 4.0], [1.0, 1.0, 1.0]])
OFFSET = np.array([5.0, -6.0, 7.0, 0.0])
# two azimuths and a roll of three: too few to span the nine products of direction and sensor
FEW = np.array([(a, i, t) for a in (0.0, 1.0) for i in (0.7, 1.9) for t in (0.0, 2.0, 4.0)]).T


def turns_of(plan):
    return dcm(plan.azimuth, plan.inclination, plan.toolface)


@pytest.mark.parametrize("turns", [turns_of(plans.twelve()), turns_of(plans.orthogonal()), dcm(*FEW)])
def test_exact_readings_give_the_triad_itself(turns):
    signals = turns @ A @ TENSOR.T + OFFSET
    direction, coefficients, left = linear_start("magnetometer", turns, np.ones((len(turns), 1)), signals)
    sign = np.sign(direction @ A)  # which no reading tells
    assert left < 1e-18
    np.testing.assert_allclose(sign * direction, A, atol=1e-9)
    np.testing.assert_allclose(coefficients[0, :, :3], sign * TENSOR, atol=1e-8)
    np.testing.assert_allclose(coefficients[0, :, 3], OFFSET, atol=1e-8)


def test_a_tool_that_follows_temperature():
    turns, heat = turns_of(plans.orthogonal()), np.linspace(-1.0, 1.0, 24) ** 3
    signals = turns @ A @ TENSOR.T + OFFSET + heat[:, None] * (0.01 * turns @ A @ TENSOR[::-1].T + 0.3)
    powers = np.stack([np.ones(24), heat], axis=1)
    direction, coefficients, left = linear_start("gyro", turns, powers, signals)
    sign = np.sign(direction @ A)
    # that the scale follows it too is left to the fit: a direction good to a share of 0.01
    np.testing.assert_allclose(sign * direction, A, atol=0.01)
    design = np.concatenate([turns @ direction, np.ones((24, 1))], axis=1)
    design = np.concatenate([design, heat[:, None] * design], axis=1)
    expected, cost, *_ = np.linalg.lstsq(design, signals, rcond=None)
    assert left == pytest.approx(cost.sum(), rel=1e-6)
    np.testing.assert_allclose(coefficients[0], expected[:4].T, atol=1e-9)
    np.testing.assert_allclose(coefficients[1], expected[4:].T, atol=1e-9)


def test_where_a_plan_does_not_span_the_search_ends_at_least_squares():
    turns, ones = dcm(*FEW), np.ones((12, 1))
    signals = turns @ A @ TENSOR.T + OFFSET + 0.02 * np.random.default_rng(1).normal(size=(12, 4))

    def cost(direction):
        design = np.concatenate([turns @ (direction / np.linalg.norm(direction)), ones], axis=1)
        return float(np.linalg.lstsq(design, signals, rcond=None)[1].sum())

    direction, _, left = linear_start("magnetometer", turns, ones, signals)
    assert left == pytest.approx(cost(direction), rel=1e-9)
    for way in tangent_basis(direction).T:
        assert min(cost(direction + 1e-3 * way), cost(direction - 1e-3 * way)) > left
    # gravity is taken to point down where the plan does not tell
    np.testing.assert_array_equal(linear_start("accelerometer", turns, ones, signals)[0], [0.0, 0.0, 1.0])


@pytest.mark.parametrize("degrees", [1.0, 10.0, 30.0])
def test_a_guess_is_refined_to_the_direction(degrees):
    turns, way = dcm(*FEW), tangent_basis(A) @ [0.6, 0.8]
    signals = turns @ A @ TENSOR.T + OFFSET
    guess = np.cos(np.radians(degrees)) * A + np.sin(np.radians(degrees)) * way
    np.testing.assert_allclose(_refined(turns, np.ones((12, 1)), signals, guess), A, atol=1e-6)


def test_guesses_lie_all_over_the_sphere():
    points = sphere(200)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1.0)
    anywhere = np.random.default_rng(2).normal(size=(500, 3))
    anywhere /= np.linalg.norm(anywhere, axis=1, keepdims=True)
    # 200 caps of 8.1 deg would cover it: none is further away than one and a half times that
    assert np.degrees(np.arccos((anywhere @ points.T).max(axis=1))).max() < 12.5


def test_the_zero_of_a_level_rig_is_counted_clockwise_from_north():
    to_east = np.radians(30.0)
    field = np.array([np.cos(to_east), -np.sin(to_east), 2.0]) / np.sqrt(5.0)
    assert np.degrees(zero_from_north(np.array([0.0, 0.0, 1.0]), field)) == pytest.approx(30.0)
