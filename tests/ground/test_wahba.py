"""Attitude from directions: exact recovery, scipy as oracle, Monte-Carlo check of what the covariances claim."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.refusals import refused

from inclinometry.errors import IdentifiabilityError
from inclinometry.orientation import fields
from inclinometry.rotations import dcm, rotation_log
from inclinometry.wahba import VectorAttitude, solve_davenport, solve_svd, solve_triad

Solver = Callable[..., VectorAttitude]
SOLVERS = (solve_triad, solve_davenport, solve_svd)
DIP = np.radians(68.0)
FIELD = np.array([[0.0, 0.0, 1.0], [np.cos(DIP), 0.0, np.sin(DIP)]])


def noisy(truth: np.ndarray, reference: np.ndarray, sigma: np.ndarray, count: int, seed: int) -> np.ndarray:
    """Directions in tool axes with the stated error across each."""
    exact = reference @ truth.T
    error = np.random.default_rng(seed).normal(size=(count, *exact.shape)) * sigma[:, None]
    return np.asarray(exact + error)  # the part along the direction drops out when it is normalised


@pytest.mark.parametrize("solve", SOLVERS)
def test_exact_directions_give_the_attitude(solve: Solver) -> None:
    # batched over random attitudes, with half turns among them, where a quaternion's scalar is zero
    truth = np.concatenate([Rotation.random(200, rng=1).as_matrix(), [np.diag([1.0, -1, -1]), np.diag([-1.0, -1, 1])]])
    tool = np.swapaxes(truth @ FIELD.T, -1, -2) * [[9.8], [5e4]]
    found = solve(tool, FIELD, [1e-3, 2e-3])
    # 68 deg dip leaves the directions 22 deg apart: rounding is amplified by about 1 / sin(22 deg)^2
    np.testing.assert_allclose(found.dcm, truth, atol=2e-15 / np.cos(DIP) ** 2)
    assert found.loss.max() < 1e-18
    assert found.degrees_of_freedom == 1
    assert found.covariance.shape == (202, 3, 3)


def test_angles_of_the_result() -> None:
    g, b = fields(0.7, 0.9, 1.3, DIP)
    found = solve_svd([g, b], FIELD, [1e-3, 1e-3])
    np.testing.assert_allclose(found.dcm, dcm(0.7, 0.9, 1.3), atol=1e-14)
    assert [float(x) for x in found.angles[:3]] == pytest.approx([0.9, 0.7, 1.3], abs=1e-13)


@pytest.mark.parametrize("solve", [solve_davenport, solve_svd])
def test_against_scipy(solve: Solver) -> None:
    rng = np.random.default_rng(3)
    for count in (2, 3, 7):
        reference = rng.normal(size=(count, 3))
        reference /= np.linalg.norm(reference, axis=1, keepdims=True)
        sigma = rng.uniform(1e-3, 3e-2, count)
        truth = Rotation.random(rng=rng).as_matrix()
        tool = noisy(truth, reference, sigma, 1, 5)[0]
        tool /= np.linalg.norm(tool, axis=1, keepdims=True)
        found = solve(tool, reference, sigma)
        oracle, rssd = Rotation.align_vectors(tool, reference, weights=sigma**-2)
        np.testing.assert_allclose(found.dcm, oracle.as_matrix(), atol=1e-12)
        # relative rounding of a sum of squares of differences of numbers of size one
        assert float(found.loss) == pytest.approx(rssd**2, rel=1e-9)
        assert found.degrees_of_freedom == 2 * count - 3


def test_davenport_and_svd_agree() -> None:
    reference = np.random.default_rng(4).normal(size=(5, 3))
    tool = np.random.default_rng(5).normal(size=(100, 5, 3)) * 0.05 + reference
    one, other = (solve(tool, reference, np.full(5, 0.05)) for solve in (solve_davenport, solve_svd))
    np.testing.assert_allclose(one.dcm, other.dcm, atol=1e-13)
    np.testing.assert_allclose(one.covariance, other.covariance, atol=1e-14)
    np.testing.assert_allclose(one.loss, other.loss, rtol=1e-10)


@pytest.mark.parametrize("solve", SOLVERS)
@pytest.mark.parametrize("sigma", [(1e-4, 1e-3), (1e-3, 1e-3)])
def test_covariance_is_honest(solve: Solver, sigma: tuple[float, float]) -> None:
    truth = dcm(0.4, 1.1, 2.0)
    count = 20000
    found = solve(noisy(truth, FIELD, np.array(sigma), count, 6), FIELD, sigma)
    error = rotation_log(found.dcm @ truth.T)
    claimed = found.covariance.mean(axis=0)
    whitened = error @ np.linalg.inv(np.linalg.cholesky(claimed)).T
    # mean square of 20000 draws has a standard deviation of sqrt(2 / 20000) = 1 %; 4 sigma
    np.testing.assert_allclose(np.cov(whitened.T), np.eye(3), atol=0.04)
    assert np.abs(whitened.mean(axis=0)).max() < 4.0 / np.sqrt(count)
    if solve is not solve_triad:
        # chi-square with one degree of freedom
        assert found.loss.mean() == pytest.approx(1.0, abs=0.04)


def test_optimal_is_never_worse_than_triad() -> None:
    rng = np.random.default_rng(8)
    for _ in range(50):
        pair, sigma = rng.normal(size=(2, 3)), rng.uniform(1e-4, 1e-2, 2)
        simple, best = solve_triad(pair, pair, sigma).covariance, solve_svd(pair, pair, sigma).covariance
        # rounding of the larger covariance, amplified by the smallest angle between the pairs
        assert np.linalg.eigvalsh(simple - best).min() > -1e-12 * np.abs(simple).max()


@pytest.mark.parametrize("solve", SOLVERS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_parallel_and_opposite_directions_are_refused(solve: Solver, sign: float) -> None:
    for angle in (0.0, 1e-9, 1e-6):
        second = sign * np.array([np.sin(angle), 0.0, np.cos(angle)])
        pair = np.stack([[0.0, 0.0, 1.0], second])
        with refused("sensor-directions-parallel", error=IdentifiabilityError):
            solve(pair, pair, [1e-3, 1e-3])
    second = sign * np.array([np.sin(1e-3), 0.0, np.cos(1e-3)])
    pair = np.stack([[0.0, 0.0, 1.0], second])
    # rounding over the square of the angle between them
    np.testing.assert_allclose(solve(pair, pair, [1e-3, 1e-3]).dcm, np.eye(3), atol=1e-9)


def test_observability_of_two_directions() -> None:
    for angle in (0.1, 0.7, np.pi / 2):
        pair = [[0.0, 0.0, 1.0], [np.sin(angle), 0.0, np.cos(angle)]]
        found = solve_svd(pair, pair, [1e-3, 1e-3])
        # information of two unit directions: eigenvalues 1 - cos, 1 + cos and 2
        assert float(found.observability) == pytest.approx((1.0 - np.cos(angle)) / 2.0, abs=1e-14)


def test_contradicting_directions_are_refused() -> None:
    # a mirror image: two attitudes fit alike
    with refused("sensor-directions-parallel", error=IdentifiabilityError):
        solve_svd(-np.eye(3), np.eye(3), [1e-3] * 3)


@pytest.mark.parametrize(
    ("tool", "reference", "sigmas", "message"),
    [
        (np.eye(3), np.eye(3)[:2], [1, 1, 1], "input-shape"),
        (np.eye(3)[:1], np.eye(3)[:1], [1], "input-shape"),
        (np.eye(3)[:2], np.eye(3)[:2], [1, 0], "input-value"),
        ([[0, 0, 0], [1, 0, 0]], np.eye(3)[:2], [1, 1], "sensor-vector-zero"),
        (np.eye(3)[:2], [[0, 0, 0], [1, 0, 0]], [1, 1], "sensor-vector-zero"),
    ],
)
def test_bad_input(tool: np.ndarray, reference: np.ndarray, sigmas: list[float], message: str) -> None:
    with refused(message):
        solve_svd(tool, reference, sigmas)


def test_triad_takes_two() -> None:
    with refused("input-shape", name="tool"):
        solve_triad(np.eye(3), np.eye(3), [1, 1, 1])
