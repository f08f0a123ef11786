"""The one least-squares loop: exact on linear problems, the same minimum as scipy on others, honest when it fails."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from tests.refusals import refused

from inclinometry.errors import ConvergenceError
from inclinometry.least_squares import Normal, inverse_spd, levenberg_marquardt


def problem(residual, jacobian):
    def normal(x):
        r, j = residual(x), jacobian(x)
        return Normal(float(r @ r), j.T @ r, j.T @ j)

    return normal


def add(x, step):
    return x + step


def test_a_linear_problem_is_solved_by_its_normal_equations():
    random = np.random.default_rng(1)
    design, data = random.normal(size=(20, 5)), random.normal(size=20)
    fit = levenberg_marquardt(problem(lambda x: design @ x - data, lambda x: design), np.zeros(5), add)
    np.testing.assert_allclose(fit.estimate, np.linalg.lstsq(design, data)[0], atol=1e-12)  # condition about 3
    np.testing.assert_allclose(fit.covariance, np.linalg.inv(design.T @ design), rtol=1e-10)
    assert fit.iterations <= 3


@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e9])
def test_a_curved_valley_is_followed_whatever_the_units(scale):
    # Rosenbrock's valley, its second parameter in units of `scale`
    def residual(x):
        return np.array([10.0 * (x[1] / scale - x[0] ** 2), 1.0 - x[0]])

    def jacobian(x):
        return np.array([[-20.0 * x[0], 10.0 / scale], [-1.0, 0.0]])

    fit = levenberg_marquardt(problem(residual, jacobian), np.array([-1.2, scale]), add)
    np.testing.assert_allclose(fit.estimate / [1.0, scale], [1.0, 1.0], rtol=1e-9)


def test_the_minimum_with_residuals_left_agrees_with_scipy():
    t = np.linspace(0.0, 4.0, 30)
    data = 2.0 * np.exp(-0.7 * t) + 0.3 * np.sin(20.0 * t)

    def residual(x):
        return x[0] * np.exp(-x[1] * t) - data

    def jacobian(x):
        return np.stack([np.exp(-x[1] * t), -x[0] * t * np.exp(-x[1] * t)], axis=1)

    fit = levenberg_marquardt(problem(residual, jacobian), np.array([1.0, 1.0]), add)
    other = least_squares(residual, [1.0, 1.0], jac=jacobian, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    # both stop within a 1e-8 of a standard deviation
    np.testing.assert_allclose(fit.estimate, other.x, atol=1e-8)
    assert fit.cost == pytest.approx(2.0 * other.cost, rel=1e-12)


def test_numbers_that_are_not_finite_are_refused():
    with refused("input-overflow", error=ConvergenceError, name="fit"):
        levenberg_marquardt(lambda x: Normal(np.nan, x, np.eye(2)), np.zeros(2), add)


def test_too_few_iterations_are_an_error_not_a_result():
    def residual(x):
        return np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])

    def jacobian(x):
        return np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]])

    with refused("sensor-fit-unsettled", error=ConvergenceError):
        levenberg_marquardt(problem(residual, jacobian), np.array([-1.2, 1.0]), add, iterations=3)


def test_an_unseen_direction_does_not_move_and_does_not_spoil_the_others():
    design = np.array([[1.0, 1.0], [2.0, 2.0], [3.0, 3.0]])
    data = np.array([2.0, 4.0, 6.0])
    fit = levenberg_marquardt(problem(lambda x: design @ x - data, lambda x: design), np.zeros(2), add)
    np.testing.assert_allclose(fit.estimate, [1.0, 1.0], atol=1e-9)
    assert np.isfinite(fit.covariance).all()


@pytest.mark.parametrize("size", [1, 4, 30])
def test_inverse_over_thirty_orders_of_magnitude(size):
    random = np.random.default_rng(size)
    root = random.normal(size=(size, size)) + 3.0 * np.sqrt(size) * np.eye(size)
    scale = 10.0 ** random.uniform(-15, 15, size)
    matrix = (root @ root.T) * np.outer(scale, scale)
    inverse = inverse_spd(matrix)
    np.testing.assert_allclose(inverse, inverse.T, rtol=1e-12)
    # unit-free condition below 1e3, so 1e-10 leaves room
    np.testing.assert_allclose(
        inverse * np.outer(scale, scale) @ (matrix / np.outer(scale, scale)), np.eye(size), atol=1e-10
    )
