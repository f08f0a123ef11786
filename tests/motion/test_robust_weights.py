"""Weights and factors: published formula values, limits, continuity."""

from __future__ import annotations

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.motion.robust import (
    fading_factor,
    huber_weight,
    igg3_weight,
    sage_husa,
    sage_husa_share,
    yang_factor_three,
    yang_factor_two,
)

T = np.linspace(-12.0, 12.0, 2401)


@pytest.mark.parametrize("k", [1.0, 1.345, 2.0])
def test_huber_is_one_then_falls_as_one_over_t(k) -> None:
    """Written out by hand; the influence w t never exceeds k."""
    wanted = [1.0 if abs(t) <= k else k / abs(t) for t in T]
    np.testing.assert_allclose(huber_weight(T, k), wanted, rtol=1e-15)
    assert np.abs(huber_weight(T, k) * T).max() <= k * (1.0 + 1e-15)


@pytest.mark.parametrize(("k0", "k1"), [(1.0, 2.5), (1.5, 4.0), (1.5, 8.0)])
def test_igg3_has_its_three_sections(k0, k1) -> None:
    """Written out by hand."""

    def by_hand(t: float) -> float:
        if abs(t) <= k0:
            return 1.0
        if abs(t) > k1:
            return 0.0
        return k0 / abs(t) * ((k1 - abs(t)) / (k1 - k0)) ** 2

    np.testing.assert_allclose(igg3_weight(T, k0, k1), [by_hand(t) for t in T], rtol=1e-14)


def test_igg3_value_of_the_published_formula() -> None:
    """k0 1.5, k1 3, t 2: 0.75 (1/1.5)^2 = 1/3."""
    assert float(igg3_weight(2.0, 1.5, 3.0)) == pytest.approx(1.0 / 3.0, rel=1e-15)


@pytest.mark.parametrize("weight", [huber_weight, igg3_weight, yang_factor_two, yang_factor_three])
def test_weights_are_even_continuous_and_do_not_grow(weight) -> None:
    """Steps of 0.01 change a weight by less than 0.02: its slope is below 2 between the limits chosen."""
    values = weight(T)
    np.testing.assert_allclose(values, values[::-1], rtol=1e-12, atol=1e-15)
    right = values[T >= 0.0]
    assert (np.diff(right) <= 1e-15).all()
    assert np.abs(np.diff(values)).max() < 0.02
    assert float(weight(0.0)) == 1.0
    assert values.min() >= 0.0


def test_factors_have_the_shapes_of_the_weights() -> None:
    """Two sections are Huber's, three are IGG-III's."""
    np.testing.assert_array_equal(yang_factor_two(T, 1.2), huber_weight(T, 1.2))
    np.testing.assert_array_equal(yang_factor_three(T, 1.2, 6.0), igg3_weight(T, 1.2, 6.0))


def test_sage_husa_share_tends_to_what_is_forgotten() -> None:
    """First sample in full, a plain mean while young, 1 - b when old."""
    assert sage_husa_share(0.98, 0) == 1.0
    assert sage_husa_share(1.0 - 1e-6, 9) == pytest.approx(0.1, rel=1e-4)
    assert sage_husa_share(0.98, 5000) == pytest.approx(0.02)


def test_sage_husa_finds_the_noise() -> None:
    """Innovations of R + P = 9 + 1 and a memory of 1000: sd of the mean of v^2 10 sqrt(2 / 2000) = 0.32."""
    random = np.random.default_rng(0)
    noise = np.eye(1)
    for step in range(5000):
        noise = sage_husa(noise, random.normal(0.0, np.sqrt(10.0), 1), np.eye(1), sage_husa_share(0.999, step), 0.1)
    assert noise[0, 0] == pytest.approx(9.0, abs=1.0)


def test_sage_husa_never_falls_below_its_floor() -> None:
    """Innovations of zero with a large prediction, in two correlated components."""
    noise, predicted = np.eye(2), np.array([[50.0, 30.0], [30.0, 40.0]])
    for _ in range(200):
        noise = sage_husa(noise, np.zeros(2), predicted, 0.1, 0.3)
        assert np.linalg.eigvalsh(noise)[0] >= 0.3 * (1.0 - 1e-12)


def test_fading_makes_innovations_as_large_as_predicted() -> None:
    """tr(lambda H F P F' H' + H Q H' + R) = tr V, and never below one."""
    spread, process, noise, carried = np.diag([20.0, 8.0]), np.eye(2), 2.0 * np.eye(2), np.diag([3.0, 1.0])
    factor = fading_factor(spread, process, noise, carried)
    assert np.trace(factor * carried + process + noise) == pytest.approx(np.trace(spread))
    assert fading_factor(np.eye(2), process, noise, carried) == 1.0
    assert fading_factor(spread, process, noise, carried, 2.0) < factor


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: huber_weight([1.0], 0.0), "input-value"),
        (lambda: huber_weight([np.nan]), "input-finite"),
        (lambda: igg3_weight([1.0], 3.0, 2.0), "input-value"),
        (lambda: sage_husa_share(1.0, 0), "input-value"),
        (lambda: sage_husa_share(0.9, -1), "input-value"),
        (lambda: sage_husa(np.eye(2), np.zeros(1), np.eye(1), 0.1, 0.1), "input-shape"),
        (lambda: sage_husa(np.eye(1), np.zeros(1), np.eye(1), 0.1, 0.0), "input-value"),
        (lambda: fading_factor(np.eye(1), np.eye(1), np.eye(1), np.zeros((1, 1))), "input-value"),
        (lambda: fading_factor(np.eye(1), np.eye(1), np.eye(1), np.eye(1), 0.5), "input-value"),
    ],
)
def test_bad_input_is_refused(call, words) -> None:
    """Each message says what is wrong."""
    with refused(words):
        call()
