"""J C J' against loops and GTC; coverage factors and limits against printed tables and scipy's distributions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from tests.refusals import refused

from inclinometry.orientation import angles, angles_jacobian, fields
from inclinometry.rotations import wrap_signed
from inclinometry.uncertainty import (
    chi_square_limit,
    chi_square_tail,
    correlation,
    covariance_matrix,
    coverage_factor,
    ellipsoid_factor,
    expanded_factor,
    numerical_jacobian,
    pooled_freedom,
    propagate,
    shares,
    standard_deviations,
)


def random_covariance(rng: np.random.Generator, *shape: int) -> np.ndarray:
    root = rng.normal(size=(*shape, shape[-1]))
    return root @ np.swapaxes(root, -1, -2)


def test_batched_against_loops() -> None:
    rng = np.random.default_rng(1)
    j, c = rng.normal(size=(4, 2, 3, 5)), random_covariance(rng, 2, 5)
    found = propagate(j, c)
    assert found.shape == (4, 2, 3, 3)
    assert np.array_equal(found, np.swapaxes(found, -1, -2))
    for a in range(4):
        for b in range(2):
            plain = np.einsum("ik,kl,jl->ij", j[a, b], c[b], j[a, b])
            # 25 products of numbers of size up to ten
            np.testing.assert_allclose(found[a, b], plain, atol=1e-13)


def test_chain_rule() -> None:
    rng = np.random.default_rng(2)
    first, second, c = rng.normal(size=(3, 5)), rng.normal(size=(2, 3)), random_covariance(rng, 5)
    np.testing.assert_allclose(propagate(second, propagate(first, c)), propagate(second @ first, c), rtol=1e-12)


def test_undefined_derivatives_stay_in_their_row() -> None:
    # a tool that hangs exactly vertical has an inclination and a magnetic toolface, but no azimuth
    jacobian = angles_jacobian(*fields(0.0, 0.0, 0.5, 1.1))
    variance = propagate(jacobian, 1e-6 * np.eye(6)).diagonal()
    assert np.isnan(variance[1:3]).all()
    assert np.isfinite(variance[[0, 3]]).all()
    assert variance[0] == pytest.approx(1e-6)
    assert np.isnan(standard_deviations(np.diag(variance))[1])


@pytest.mark.parametrize(
    ("jacobian", "covariance", "message"),
    [
        (np.eye(3), np.eye(2), "input-shape"),
        (np.ones(3), np.eye(3), "input-shape"),
        (np.ones((1, 3)), np.ones((2, 3)), "input-shape"),
        (np.array([[np.inf]]), np.eye(1), "input-finite"),
        (np.eye(1), np.array([[np.nan]]), "input-finite"),
    ],
)
def test_bad_propagation(jacobian: np.ndarray, covariance: np.ndarray, message: str) -> None:
    with refused(message):
        propagate(jacobian, covariance)


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        ([[1.0, 0.5], [0.4, 1.0]], "input-covariance"),
        ([[1.0, 2.0], [2.0, 1.0]], "input-value"),
        ([[-1.0]], "input-value"),
        (np.ones((2, 3)), "input-shape"),
    ],
)
def test_not_a_covariance(matrix: np.ndarray, message: str) -> None:
    with refused(message):
        covariance_matrix(matrix)


def test_covariances_of_mixed_units_pass() -> None:
    # rad^2 beside nT^2: fourteen orders of magnitude, and a parameter that is exactly known
    c = random_covariance(np.random.default_rng(3), 3) * np.outer([1e-7, 1e4, 0.0], [1e-7, 1e4, 0.0])
    assert covariance_matrix(c) is not None
    unit = correlation(c)
    assert np.array_equal(np.diagonal(unit), np.ones(3))
    assert unit[0, 2] == 0.0
    with refused("input-value", name="diag(covariance)"):
        standard_deviations(-np.eye(2))


def test_numerical_jacobian_of_the_angles() -> None:
    g, b = fields(0.4, 0.9, 2.0, 1.1)
    nominal = np.stack(angles(g, b))

    def function(x: np.ndarray) -> np.ndarray:
        return wrap_signed(np.stack(angles(x[:3], x[3:])) - nominal)

    numeric = numerical_jacobian(function, np.concatenate([g, b]), np.full(6, 1e-3))
    # fourth order: (1e-3 / sin I cos dip)^4 = 5e-11, rounding 2e-16 / 1e-3
    np.testing.assert_allclose(numeric, angles_jacobian(g, b), atol=1e-9)
    with refused("input-value", name="steps"):
        numerical_jacobian(function, np.ones(6), 0.0)


def test_numerical_jacobian_is_of_fourth_order() -> None:
    error = [abs(numerical_jacobian(np.exp, [0.0], [h])[0, 0] - 1.0) for h in (0.2, 0.1)]
    assert error[0] / error[1] == pytest.approx(16.0, rel=0.05)


def test_angles_against_gtc() -> None:
    from GTC import atan2, component, dof, sqrt, uncertainty, ureal

    readings = [1.3, -4.0, 8.7, 21000.0, -13000.0, 41000.0]
    sigmas, freedoms = [2e-3, 3e-3, 2.5e-3, 30.0, 40.0, 50.0], [5, 8, 11, 20, 30, np.inf]
    inputs = [ureal(x, u, df) for x, u, df in zip(readings, sigmas, freedoms, strict=True)]
    gx, gy, gz, bx, by, bz = inputs
    level, total = sqrt(gx**2 + gy**2), sqrt(gx**2 + gy**2 + gz**2)
    oracle = (
        atan2(level, gz),
        atan2((gx * by - gy * bx) * total, bz * level**2 - gz * (gx * bx + gy * by)),
        atan2(gy, -gx),
    )
    jacobian = angles_jacobian(readings[:3], readings[3:])[:3]
    names = ("gx", "gy", "gz", "bx", "by", "bz")
    parts = {n: propagate(jacobian[:, [k]], [[sigmas[k] ** 2]]) for k, n in enumerate(names)}
    freedom = pooled_freedom((part.diagonal(), nu) for part, nu in zip(parts.values(), freedoms, strict=True))
    total = standard_deviations(sum(parts.values()))
    np.testing.assert_allclose(total, [uncertainty(y) for y in oracle], rtol=1e-12)
    np.testing.assert_allclose(freedom, [dof(y) for y in oracle], rtol=1e-10)
    for k, y in enumerate(oracle):
        for name, x in zip(names, inputs, strict=True):
            share = (component(y, x) / uncertainty(y)) ** 2
            assert shares(parts)[name][k] == pytest.approx(share, abs=1e-13)


def test_shares_of_nothing_uncertain_and_of_nothing_known() -> None:
    assert shares({"a": np.zeros((1, 1)), "b": np.zeros((1, 1))})["a"] == 0.0
    unknown = shares({"a": np.diag([np.nan, 1.0]), "b": np.eye(2)})
    assert np.isnan(unknown["b"][0])
    assert unknown["b"][1] == 0.5


def test_table_g2_of_the_gum() -> None:
    # JCGM 100:2008, table G.2, printed to two decimals; the probabilities there are rounded names of 1, 2, 3 sigma
    freedom = [1, 2, 5, 10, 20, 50, 100, np.inf]
    assert coverage_factor(0.95, freedom) == pytest.approx(
        [12.71, 4.30, 2.57, 2.23, 2.09, 2.01, 1.984, 1.960], abs=5e-3
    )
    assert coverage_factor(0.99, freedom) == pytest.approx(
        [63.66, 9.92, 4.03, 3.17, 2.85, 2.68, 2.626, 2.576], abs=5e-3
    )
    two_sigma = stats.norm.cdf(2.0) - stats.norm.cdf(-2.0)
    assert coverage_factor(two_sigma) == pytest.approx(2.0, abs=1e-12)


def test_against_scipy_distributions() -> None:
    freedom = np.array([1.0, 3.3, 24.0, 1000.0])
    np.testing.assert_allclose(coverage_factor(0.9, freedom), stats.t.ppf(0.95, freedom), rtol=1e-10)
    np.testing.assert_allclose(chi_square_limit(0.99, freedom), stats.chi2.ppf(0.99, freedom), rtol=1e-10)
    np.testing.assert_allclose(chi_square_tail(chi_square_limit(0.99, freedom), freedom), 0.01, rtol=1e-9)


def test_ellipsoid() -> None:
    assert ellipsoid_factor(0.95, 1) == pytest.approx(float(coverage_factor(0.95)), rel=1e-12)
    # a plane has a closed form
    assert ellipsoid_factor(0.95, 2) == pytest.approx(np.sqrt(-2.0 * np.log(0.05)), rel=1e-12)


def test_effective_freedom_of_the_gums_end_gauge() -> None:
    # GUM H.1.6: 16.7 from components printed to three digits
    parts = np.array([25.0, 9.7, 2.9, 16.6]) ** 2
    assert float(pooled_freedom(zip(parts, (18, 25.6, 50, 2), strict=True))) == pytest.approx(16.7, abs=0.1)


def test_one_estimate_counts_once() -> None:
    parts = [np.array([4.0, 1.0]), np.array([5.0, 0.0]), np.array([0.0, 9.0])]
    apart = pooled_freedom(zip(parts, (6.0, 8.0, np.inf), strict=True))
    np.testing.assert_allclose(apart, [9.0**2 / (4.0**2 / 6.0 + 5.0**2 / 8.0), 600.0])
    together = pooled_freedom(zip(parts, (6.0, 6.0, np.inf), strict=True))
    np.testing.assert_allclose(together, [6.0, 600.0])
    assert pooled_freedom([(np.zeros(2), 3.0)]).tolist() == [np.inf, np.inf]
    assert pooled_freedom([(np.array(1e-200), 3.0)]) == pytest.approx(3.0)


def test_expanded_factor_covers_what_two_sigmas_do() -> None:
    # u^2 is the mean over the posterior of the variance: nu / (nu - 2) times the estimate
    rng, nu = np.random.default_rng(3), 6.0
    u = np.sqrt(rng.chisquare(nu, 200_000) / nu * nu / (nu - 2.0))
    off = np.abs(rng.standard_normal(200_000))
    # 1.3e-4 is its standard deviation; k is rounded up by at most 0.01, which is 0.1 %
    assert 0.9545 - 0.0013 < np.mean(off < expanded_factor(nu) * u) < 0.9545 + 0.003
    assert np.mean(off < 2.0 * u) < 0.9545 - 0.003


def test_bounds_of_the_effective_freedom() -> None:
    # never less than the smallest, never more than the sum (GUM G.4.1)
    rng = np.random.default_rng(1)
    freedom = rng.uniform(1.0, 40.0, 5)
    found = pooled_freedom(zip(rng.uniform(0.0, 1.0, (5, 300)) ** 2, freedom, strict=True))
    assert found.min() >= freedom.min()
    assert found.max() <= freedom.sum()


def test_bad_values() -> None:
    for probability in (0.0, 1.0, 95.0, float("nan")):
        with refused("input-value", name="probability"):
            coverage_factor(probability)
    with refused("input-value", name="nu"):
        coverage_factor(0.95, 0.0)
    with refused("input-finite", name="degrees_of_freedom"):
        chi_square_limit(0.95, np.inf)
