"""Harmonics of equal steps: exact on a harmonic, equal to least squares on anything, whatever start and order."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from tests.refusals import fits, refused

from inclinometry.calibration.dials import at_azimuth, groups, positive_inclination, unequal_steps
from inclinometry.calibration.harmonics import harmonics
from inclinometry.rotations import dcm

EXACT = 1e-14  # a few roundings of numbers of order one


@given(st.integers(3, 40), st.floats(-10.0, 10.0), st.integers(0, 2**32 - 1))
@example(3, 0.0, 0)
@example(8, -np.pi, 1)
def test_a_harmonic_is_recovered_from_any_start_in_any_order(steps, start, seed):
    rng = np.random.default_rng(seed)
    angle = rng.permutation(start + 2.0 * np.pi * np.arange(steps) / steps)
    a, b, c = rng.normal(size=(3, 4))
    found = harmonics(a * np.cos(angle)[:, None] + b * np.sin(angle)[:, None] + c, angle)
    # angles of up to 16 rad carry a rounding of 2e-15 themselves
    assert np.allclose(found.cosine, a, atol=1e-13)
    assert np.allclose(found.sine, b, atol=1e-13)
    assert np.allclose(found.mean, c, atol=1e-13)


def test_equal_to_least_squares_on_arbitrary_signals():
    rng = np.random.default_rng(1)
    angle = 0.3 + 2.0 * np.pi * np.arange(7) / 7
    signals = rng.normal(size=(5, 7, 2))
    design = np.column_stack([np.cos(2 * angle), np.sin(2 * angle), np.ones(7)])
    found = harmonics(signals, angle, order=2)
    for one, cosine, sine, mean in zip(signals, found.cosine, found.sine, found.mean, strict=True):
        expected = np.linalg.lstsq(design, one, rcond=None)[0]
        assert np.allclose([cosine, sine, mean], expected, atol=EXACT)


def test_the_short_formulas_of_the_paper_for_three_steps():
    u = np.array([[2.0], [-1.0], [5.0]])
    found = harmonics(u, np.radians([0.0, 120.0, 240.0]))
    mean = u.mean()
    assert np.allclose(
        [found.cosine[0], found.sine[0], found.mean[0]], [u[0, 0] - mean, (u[1, 0] - u[2, 0]) / 3**0.5, mean]
    )


def test_second_harmonic_is_kept_out_of_the_first():
    roll = np.radians(10.0 * np.arange(36))
    signal = (100.0 * np.cos(roll - 0.5) + 6.0 * np.cos(2 * roll - 1.0))[:, None]
    assert np.allclose(harmonics(signal, roll).amplitude, 100.0)
    second = harmonics(signal, roll, order=2)
    assert np.allclose([second.amplitude, second.phase], [[6.0], [1.0]])


@pytest.mark.parametrize(("order", "steps"), [(0, 8), (4, 8), (2, 4)])
def test_an_order_the_steps_do_not_determine_is_refused(order, steps):
    with refused("input-value", name="order"):
        harmonics(np.zeros((steps, 1)), 2 * np.pi * np.arange(steps) / steps, order)


@pytest.mark.parametrize(
    ("degrees", "code", "name", "value"),
    [
        ([0, 180], "plan-steps-few", "count", 2),
        ([0, 120, 241], "plan-steps-unequal", "step_deg", 121.0),
        ([0, 120, 120], "plan-steps-unequal", "step_deg", 240.0),
        ([0, 0, 120, 240], "plan-steps-unequal", "wanted_deg", 90.0),
    ],
)
def test_unequal_steps_are_named(degrees, code, name, value):
    assert fits(unequal_steps(np.radians(degrees)), [code], {name: value})
    with refused("plan-steps"):
        harmonics(np.zeros((len(degrees), 1)), np.radians(degrees))


def test_rounding_of_degrees_and_whole_turns_are_no_inequality():
    assert (
        unequal_steps(
            np.radians(
                [
                    359.9999999,
                    120.0,
                    -120.0 + 720.0,
                ]
            )
        )
        is None
    )
    assert [g.tolist() for g in groups(np.radians([0.0, 359.9999999, 90.0]))] == [[0, 1], [2]]


def test_settings_rewritten_are_the_same_orientations():
    rng = np.random.default_rng(2)
    dials = rng.uniform(-2 * np.pi, 2 * np.pi, (3, 50))
    dials[1, :10], dials[1, 10:20], dials[1, 20:30] = 0.0, np.pi, -np.pi
    dials[0, 30:40] = 1.0 + np.pi
    assert np.allclose(dcm(*positive_inclination(*dials)), dcm(*dials), atol=EXACT)
    a, i, t = at_azimuth(*dials, 1.0)
    assert np.allclose(dcm(a, i, t), dcm(*dials), atol=EXACT)
    assert np.all(a[:40] == 1.0)
    assert np.all(a[40:] == dials[0, 40:])
