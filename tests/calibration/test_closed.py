"""The record of a closed form, its prediction and its covariance."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration.closed import ClosedForm, covariance, reading_covariance, sensitivity
from inclinometry.sensors import parameter_vector

FORM = ClosedForm(np.arange(12.0).reshape(4, 3) + np.eye(4, 3), np.arange(4.0), np.array([0.6, 0.0, 0.8]))


def linear(values):
    """A made-up solver, linear in the readings: sensor i has tensor (y0, 2 y1, y2 - y0) and offset the mean."""
    y = np.moveaxis(np.asarray(values), -2, 0)
    tensor = np.stack([y[0], 2.0 * y[1], y[2] - y[0]], axis=-1)
    return ClosedForm(tensor, y.mean(axis=0), np.broadcast_to([0.0, 0.0, 1.0], (*y.shape[1:-1], 3)))


def test_parameters_are_in_the_order_of_the_tool():
    assert np.array_equal(FORM.parameters, parameter_vector(FORM.triad("gyro", "V")))
    assert FORM.triad("gyro", "V", 7e-5).field_strength == 7e-5


def test_a_batch_is_not_a_triad():
    with refused("input-shape", name="tensor"):
        ClosedForm(np.zeros((2, 3, 3)), np.zeros((2, 3)), np.zeros((2, 3))).triad("gyro")


def test_signals_of_one_setting_of_many_and_of_a_batch_agree():
    rng = np.random.default_rng(0)
    dials = rng.uniform(0, 6, (3, 5))
    many = FORM.signals(*dials)
    assert np.allclose(many[2], FORM.signals(*dials[:, 2]), atol=1e-13)
    batch = ClosedForm(np.stack([FORM.tensor] * 2), np.stack([FORM.offset] * 2), np.stack([FORM.direction] * 2))
    assert np.allclose(batch.signals(*dials)[1], many, atol=1e-13)
    assert np.allclose(batch.signals(*dials[:, 0])[1], many[0], atol=1e-13)


def test_sensitivity_of_a_linear_solver_is_exact():
    values = np.random.default_rng(1).normal(size=(3, 2))
    found = sensitivity(linear, values).reshape(2, 4, 3, 2)
    expected = np.array([[1, 0, 0], [0, 2, 0], [-1, 0, 1], [1 / 3, 1 / 3, 1 / 3]])
    for sensor in (0, 1):
        assert np.allclose(found[sensor, :, :, sensor], expected, atol=1e-10)  # 1e-16 over a step of 1e-4
        assert np.allclose(found[sensor, :, :, 1 - sensor], 0.0, atol=1e-10)


def test_covariance_keeps_triads_apart_when_readings_are_and_joins_them_when_not():
    values = np.random.default_rng(2).normal(size=(3, 2))
    apart = covariance([linear, linear], [values, values[:, :1]], np.broadcast_to(np.eye(3), (3, 3, 3)))
    assert np.allclose(apart[:8, 8:], 0.0)
    assert apart[3, 3] == pytest.approx(1.0 / 3.0)
    joined = covariance([linear, linear], [values, values[:, :1]], np.ones((3, 3, 3)))
    assert np.allclose(joined[:4, 8:], joined[:4, :4])


def test_reading_covariance_against_finite_differences():
    dials, rig, noise = np.random.default_rng(3).uniform(0, 3, (3, 4)), np.array([1e-3, 2e-3, 3e-3]), np.full(4, 0.1)
    found = reading_covariance([FORM], *dials, rig, noise)
    step = 1e-6
    slopes = []
    for d in range(3):
        move = step * np.eye(3)[d][:, None]
        slopes.append((FORM.signals(*(dials + move)) - FORM.signals(*(dials - move))) / (2 * step) * rig[d])
    slopes = np.stack(slopes, axis=-1)
    assert np.allclose(found, slopes @ slopes.transpose(0, 2, 1) + 0.01 * np.eye(4), atol=1e-9)


def test_shapes_that_do_not_go_together_are_refused():
    with refused("input-shape", name="signals"):
        sensitivity(linear, np.zeros((2, 3, 2)))
    with refused("input-shape", name="readings.covariance"):
        covariance([linear], [np.ones((3, 2))], np.zeros((3, 3, 3)))
    with refused("input-shape", name="solvers"):
        covariance([linear], [np.ones((3, 1)), np.ones((3, 1))], np.zeros((3, 2, 2)))
