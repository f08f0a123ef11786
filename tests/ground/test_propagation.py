"""J C J' against loops, finite differences against analytic derivatives, GTC as an independent implementation."""

from __future__ import annotations

import numpy as np
import pytest

from inclinometry.errors import InputError
from inclinometry.orientation import angles, angles_jacobian, fields
from inclinometry.rotations import wrap_signed
from inclinometry.uncertainty import (
    Budget,
    correlation,
    covariance_matrix,
    numerical_jacobian,
    propagate,
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
        (np.eye(3), np.eye(2), "do not go together"),
        (np.ones(3), np.eye(3), "do not go together"),
        (np.ones((1, 3)), np.ones((2, 3)), "do not go together"),
        (np.array([[np.inf]]), np.eye(1), "infinite"),
        (np.eye(1), np.array([[np.nan]]), "finite"),
    ],
)
def test_bad_propagation(jacobian: np.ndarray, covariance: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=message):
        propagate(jacobian, covariance)


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        ([[1.0, 0.5], [0.4, 1.0]], "not symmetric"),
        ([[1.0, 2.0], [2.0, 1.0]], "positive semidefinite"),
        ([[-1.0]], "must not be negative"),
        (np.ones((2, 3)), "expected"),
    ],
)
def test_not_a_covariance(matrix: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=message):
        covariance_matrix(matrix)


def test_covariances_of_mixed_units_pass() -> None:
    # rad^2 beside nT^2: fourteen orders of magnitude, and a parameter that is exactly known
    c = random_covariance(np.random.default_rng(3), 3) * np.outer([1e-7, 1e4, 0.0], [1e-7, 1e4, 0.0])
    assert covariance_matrix(c) is not None
    unit = correlation(c)
    assert np.array_equal(np.diagonal(unit), np.ones(3))
    assert unit[0, 2] == 0.0
    with pytest.raises(InputError, match="must not be negative"):
        standard_deviations(-np.eye(2))


def test_numerical_jacobian_of_the_angles() -> None:
    g, b = fields(0.4, 0.9, 2.0, 1.1)
    nominal = np.stack(angles(g, b))

    def function(x: np.ndarray) -> np.ndarray:
        return wrap_signed(np.stack(angles(x[:3], x[3:])) - nominal)

    numeric = numerical_jacobian(function, np.concatenate([g, b]), np.full(6, 1e-3))
    # fourth order: (1e-3 / sin I cos dip)^4 = 5e-11, rounding 2e-16 / 1e-3
    np.testing.assert_allclose(numeric, angles_jacobian(g, b), atol=1e-9)
    with pytest.raises(InputError, match="steps must be positive"):
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
    budget = Budget(("inclination", "azimuth", "toolface"), parts, dict(zip(names, freedoms, strict=True)))
    np.testing.assert_allclose(budget.standard_uncertainty, [uncertainty(y) for y in oracle], rtol=1e-12)
    np.testing.assert_allclose(budget.effective_degrees_of_freedom, [dof(y) for y in oracle], rtol=1e-10)
    for k, y in enumerate(oracle):
        for name, x in zip(names, inputs, strict=True):
            share = (component(y, x) / uncertainty(y)) ** 2
            assert budget.shares[name][k] == pytest.approx(share, abs=1e-13)
