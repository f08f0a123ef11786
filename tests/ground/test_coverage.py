"""Coverage factors and limits against printed tables and scipy's distributions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from inclinometry.errors import InputError
from inclinometry.uncertainty import (
    chi_square_limit,
    chi_square_tail,
    coverage_factor,
    ellipsoid_factor,
    expanded_factor,
    pooled_freedom,
    welch_satterthwaite,
)


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


def test_welch_satterthwaite() -> None:
    # GUM H.1.6, end gauge: 16.7 from components printed to three digits
    found = welch_satterthwaite([25.0, 9.7, 2.9, 16.6], [18, 25.6, 50, 2])
    assert float(found) == pytest.approx(16.7, abs=0.1)
    assert welch_satterthwaite([[1.0, 0.0], [0.0, 1.0]], [4, np.inf]).tolist() == [4.0, np.inf]
    assert float(welch_satterthwaite([3e-90, 4e-90], [5, 5])) == pytest.approx(625.0 / (81 + 256) * 5)
    assert np.isnan(welch_satterthwaite([np.nan, 1.0], [5, 5]))
    assert welch_satterthwaite([0.0, 0.0], [5, 5]) == np.inf


def test_one_estimate_counts_once() -> None:
    parts = [np.array([4.0, 1.0]), np.array([5.0, 0.0]), np.array([0.0, 9.0])]
    apart = pooled_freedom(zip(parts, (6.0, 8.0, np.inf), strict=True))
    np.testing.assert_allclose(apart, welch_satterthwaite(np.sqrt(np.stack(parts, axis=-1)), [6.0, 8.0, np.inf]))
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
    found = welch_satterthwaite(rng.uniform(0.0, 1.0, (300, 5)), freedom)
    assert found.min() >= freedom.min()
    assert found.max() <= freedom.sum()


def test_bad_values() -> None:
    for probability in (0.0, 1.0, 95.0, float("nan")):
        with pytest.raises(InputError, match="between 0 and 1"):
            coverage_factor(probability)
    with pytest.raises(InputError, match="must be positive"):
        coverage_factor(0.95, 0.0)
    with pytest.raises(InputError, match="every value must be finite"):
        chi_square_limit(0.95, np.inf)
    with pytest.raises(InputError, match="negative or infinite"):
        welch_satterthwaite([-1.0], [3])
