"""Monte Carlo: known distributions, independence of the block size, and the verdict on linear propagation."""

from __future__ import annotations

import numpy as np
import pytest

from inclinometry.attitude.orientation import angles, angles_jacobian, fields
from inclinometry.core.angles import wrap_signed
from inclinometry.core.errors import InputError
from inclinometry.uncertainty.montecarlo import (
    LinearCheck,
    MonteCarlo,
    check_linear,
    monte_carlo,
    normal_sampler,
    numerical_tolerance,
    shortest_interval,
)
from inclinometry.uncertainty.propagation import propagate

COUNT = 200_000


def test_a_linear_function_of_correlated_inputs() -> None:
    rng = np.random.default_rng(1)
    root, jacobian = rng.normal(size=(3, 3)), rng.normal(size=(2, 3))
    covariance, mean = root @ root.T, np.array([1.0, -2.0, 3.0])
    found = monte_carlo(lambda x: x @ jacobian.T, normal_sampler(mean, covariance), count=COUNT, seed=7)
    expected = propagate(jacobian, covariance)
    size = np.sqrt(np.diagonal(expected))
    # standard errors: u / sqrt(N) for means, u^2 sqrt(2/N) for variances; four of them
    np.testing.assert_allclose((found.mean - jacobian @ mean) / size, 0.0, atol=4.0 / np.sqrt(COUNT))
    allowed = 4.0 * np.sqrt(2.0 / COUNT)
    np.testing.assert_allclose(found.covariance / np.outer(size, size), expected / np.outer(size, size), atol=allowed)
    check = check_linear(found, jacobian @ mean, expected)
    assert check.valid.all()
    np.testing.assert_allclose(check.ratio, 1.0, atol=0.01)


def test_same_seed_same_result_whatever_the_block() -> None:
    def run(seed: int, block: int) -> MonteCarlo:
        sampler = normal_sampler(np.zeros(2), np.eye(2))
        return monte_carlo(lambda x: np.hypot(x[:, 0], x[:, 1]), sampler, count=5000, seed=seed, block=block)

    one, other, third = run(3, 5000), run(3, 77), run(4, 77)
    # the draws are the same; only the matrix product may round differently with its shape
    np.testing.assert_allclose(one.mean, other.mean, rtol=1e-13)
    np.testing.assert_allclose(one.low, other.low, rtol=1e-13)
    assert one.mean != third.mean


def test_uniform_and_skewed_distributions() -> None:
    # GUM-S1 clause 9.2.4: sum of four rectangular distributions of unit variance, 95 % within +-3.88
    def four(generator: np.random.Generator, count: int) -> np.ndarray:
        return generator.uniform(-np.sqrt(3.0), np.sqrt(3.0), (count, 4))

    found = monte_carlo(lambda x: x.sum(axis=1), four, count=1_000_000, seed=1)
    assert found.standard_uncertainty[0] == pytest.approx(2.0, abs=0.01)
    assert [float(found.low[0]), float(found.high[0])] == pytest.approx([-3.88, 3.88], abs=0.03)
    # an exponential's shortest interval starts at zero and ends at -ln(0.05) = 3.00
    skewed = monte_carlo(lambda x: x, lambda g, k: g.exponential(size=(k, 1)), count=COUNT, seed=2)
    assert float(skewed.low[0]) == pytest.approx(0.0, abs=1e-2)
    assert float(skewed.high[0]) == pytest.approx(3.0, abs=0.05)


def test_shortest_interval_holds_its_part() -> None:
    samples = np.random.default_rng(4).gamma(2.0, size=(999, 3))
    low, high = shortest_interval(samples, 0.9)
    inside = ((samples >= low) & (samples <= high)).sum(axis=0)
    assert (inside == 900).all()  # 0.9 of 999 is 899.1
    # no other interval between samples that holds as many is shorter
    ordered = np.sort(samples, axis=0)
    assert ((ordered[899:] - ordered[: 999 - 899]).min(axis=0) == high - low).all()


def angle_check(inclination: float, sigma: float) -> LinearCheck:
    """Verdicts on linear propagation for inclination, azimuth, toolface, magnetic toolface."""
    g, b = fields(0.7, inclination, 1.9, 1.1)
    nominal = np.stack(angles(g, b), axis=-1)
    covariance = sigma**2 * np.eye(6)
    found = monte_carlo(
        lambda x: wrap_signed(np.stack(angles(x[:, :3], x[:, 3:]), axis=-1) - nominal),
        normal_sampler(np.concatenate([g, b]), covariance),
        count=COUNT,
        seed=5,
    )
    return check_linear(found, np.zeros(4), propagate(angles_jacobian(g, b), covariance))


def test_linear_propagation_of_the_angles_holds_away_from_vertical() -> None:
    check = angle_check(np.radians(30.0), 1e-3)
    assert check.valid.all()
    # standard error of a standard deviation, 1 / sqrt(2 N) = 0.0016, four of them
    np.testing.assert_allclose(check.ratio, 1.0, atol=0.0064)


def test_and_fails_near_vertical_where_only_the_magnetic_toolface_survives() -> None:
    # sigma is as large as the inclination: inclination is one-sided, azimuth and toolface are nearly uniform, but
    # what they share cancels in their sum
    check = angle_check(1e-3, 1e-3)
    assert not check.valid[:2].any()
    assert (np.abs(check.ratio[:3] - 1.0) > 0.1).all()
    assert check.valid[3]
    assert check.ratio[3] == pytest.approx(1.0, abs=0.0064)


def test_sampler_of_singular_covariance_and_mixed_units() -> None:
    scale = np.array([1e-7, 1e4, 0.0])
    root = np.array([[1.0, 0.0, 0.0], [0.9, 0.3, 0.0], [0.0, 0.0, 1.0]])
    covariance = (root @ root.T) * np.outer(scale, scale)
    draws = normal_sampler(np.zeros(3), covariance)(np.random.default_rng(1), COUNT)
    assert not draws[:, 2].any()
    sample = np.cov(draws[:, :2].T) / np.outer(scale[:2], scale[:2])
    np.testing.assert_allclose(sample, (root @ root.T)[:2, :2], atol=4.0 * np.sqrt(2.0 / COUNT))


def test_numerical_tolerance() -> None:
    # GUM-S1 clause 7.9.2, examples 1 and 2: 0.00035 g to two digits, 2 K to one
    assert float(numerical_tolerance(0.00035, 2)) == pytest.approx(0.000005)
    assert float(numerical_tolerance(2.0, 1)) == pytest.approx(0.5)
    with pytest.raises(InputError, match="must be positive"):
        numerical_tolerance(0.0)


def test_bad_use() -> None:
    sampler = normal_sampler([0.0], [[1.0]])
    with pytest.raises(InputError, match="at least 1000 draws"):
        monte_carlo(lambda x: x, sampler, count=10, seed=1)
    with pytest.raises(InputError, match="between 0 and 1"):
        monte_carlo(lambda x: x, sampler, count=1000, seed=1, probability=95.0)
    with pytest.raises(InputError, match="expected"):
        monte_carlo(lambda x: x[:5], sampler, count=1000, seed=1)
    with pytest.raises(InputError, match="finite"):
        monte_carlo(lambda x: x * np.nan, sampler, count=1000, seed=1)
    with pytest.raises(InputError, match="do not go together"):
        normal_sampler([0.0, 1.0], [[1.0]])
