"""True tools: the distributions they are drawn from, and that a seed is a seed."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.simulate.tool import (
    Streams,
    converter_step,
    digitise,
    nominal_axes,
    random_rotations,
    random_tool,
    random_tools,
    realistic_tool,
    realistic_tools,
    signal_step,
    with_temperature,
)

DRAWS = 20000


def test_scenario_factors_and_offsets_are_uniform():
    tools = random_tools(1, DRAWS, bits=None)
    factors = np.linalg.norm(tools.tensor["accelerometer"], axis=-1) / STANDARD_GRAVITY
    assert factors.min() >= 0.95 - 1e-12
    assert factors.max() <= 1.05 + 1e-12
    # sd of U(-h, h) is h / sqrt 3; of 60000 draws it scatters by about 0.3 %
    assert factors.std() == pytest.approx(0.05 / np.sqrt(3), rel=0.015)
    offsets = tools.offset["magnetometer"] / 50000.0
    assert np.abs(offsets).max() <= 0.05
    assert offsets.std() == pytest.approx(0.05 / np.sqrt(3), rel=0.015)


def test_scenario_axes_are_about_eight_degrees_from_orthogonal():
    axes = random_tools(1, DRAWS).tensor["accelerometer"]
    axes = axes / np.linalg.norm(axes, axis=-1, keepdims=True)
    between = np.degrees(np.arcsin(np.sum(axes[:, 0] * axes[:, 1], axis=-1)))
    # two axes move by 0.1 rad each: sqrt 2 * 5.73 degrees, 0.5 % less after scaling to unit length
    assert between.std() == pytest.approx(np.sqrt(2) * 5.73, rel=0.05)
    # a random rotation has no preferred direction; the mean of 20000 unit vectors is within 5 / sqrt(3 * 20000)
    assert np.abs(axes.mean(axis=0)).max() < 0.021


def test_random_rotations_are_proper_and_uniform():
    rotations = random_rotations(np.random.default_rng(2), DRAWS)
    np.testing.assert_allclose(
        rotations @ rotations.swapaxes(-1, -2), np.broadcast_to(np.eye(3), rotations.shape), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(rotations), 1.0, atol=1e-12)
    # over all rotations every element has mean 0 and variance 1/3
    assert np.abs(rotations.mean(axis=0)).max() < 5 * np.sqrt(1 / 3 / DRAWS)
    np.testing.assert_allclose(rotations.var(axis=0), 1 / 3, rtol=0.05)


def test_realistic_axes_are_one_to_two_degrees_off():
    tools = realistic_tools(3, DRAWS)
    tensor = tools.tensor["magnetometer"]
    axes = tensor / np.linalg.norm(tensor, axis=-1, keepdims=True)
    off = np.degrees(np.arccos(np.einsum("dii->di", axes)))
    assert off.min() >= 1.0 - 1e-6
    assert off.max() <= 2.0 + 1e-6
    offset = tools.offset["accelerometer"] * converter_step("accelerometer", 12) / STANDARD_GRAVITY
    assert offset.std() == pytest.approx(0.02, rel=0.02)
    offset = tools.offset["magnetometer"] * converter_step("magnetometer", 12)
    assert offset.std() == pytest.approx(400.0, rel=0.02)


def test_counts_are_physical_signals_over_the_step():
    counts, physical = random_tool(5, bits=12), random_tool(5, bits=None)
    for kind, triad in counts.triads.items():
        assert triad.unit == "counts"
        assert physical.triads[kind].unit in ("m/s^2", "nT")
        step = converter_step(kind, 12)
        np.testing.assert_allclose(triad.tensor * step, physical.triads[kind].tensor, rtol=1e-14)
        np.testing.assert_allclose(counts.noise[kind] * step, physical.noise[kind], rtol=1e-14)
    assert converter_step("accelerometer", 12) == pytest.approx(2.5 / 4096 * STANDARD_GRAVITY)


def test_noise_converter_and_company_do_not_change_a_triad():
    base = random_tool(7, bits=None)
    for other in (
        random_tool(7, bits=None, noise={}),
        random_tool(7, bits=None, noise={"accelerometer": 1.0}),
        random_tool(7, bits=None, sensors={"gyro": 3, "accelerometer": 3}),
        random_tool(7, bits=None, temperature_degree=2),
    ):
        assert np.array_equal(other.triads["accelerometer"].tensor[0], base.triads["accelerometer"].tensor[0])
        assert np.array_equal(other.triads["accelerometer"].offset[0], base.triads["accelerometer"].offset[0])
    assert not np.array_equal(
        random_tool(8, bits=None).triads["accelerometer"].tensor, base.triads["accelerometer"].tensor
    )


def test_first_draws_do_not_depend_on_a_generator_used_elsewhere():
    first = realistic_tool(np.random.default_rng(4)).triads["magnetometer"].tensor
    again = realistic_tool(np.random.default_rng(4)).triads["magnetometer"].tensor
    assert np.array_equal(first, again)
    sequence = np.random.SeedSequence(4)
    assert np.array_equal(
        random_tool(sequence).triads["magnetometer"].tensor, random_tool(sequence).triads["magnetometer"].tensor
    )


def test_streams_of_different_names_and_purposes_are_independent():
    values = [Streams(1, p)[n].standard_normal(10000) for p in ("bench", "survey") for n in ("a", "b")]
    correlation = np.corrcoef(values) - np.eye(4)
    assert np.abs(correlation).max() < 5 / np.sqrt(10000)


@pytest.mark.parametrize("count", [2, 3, 4, 5, 6, 8])
def test_layouts_of_any_size(count):
    axes = nominal_axes(count)
    np.testing.assert_allclose(np.linalg.norm(axes, axis=-1), 1.0, atol=1e-15)
    if count >= 3:
        np.testing.assert_allclose(axes.T @ axes, count / 3 * np.eye(3), atol=1e-14)
    tool = realistic_tool(1, sensors={"accelerometer": count, "gyro": 3})
    assert tool.triads["accelerometer"].count == count
    assert tool.triads["accelerometer"].full == (count > 2)
    assert tool.triads["gyro"].field_strength == pytest.approx(7.292115e-5)


def test_temperature_is_small_and_vanishes_at_the_reference():
    plain, warm = realistic_tool(2), realistic_tool(2, temperature_degree=3)
    direction = np.array([[0.6, 0.0, 0.8]])
    for kind, triad in warm.triads.items():
        reference = triad.signals(direction, [triad.reference_temperature])
        np.testing.assert_allclose(reference, plain.triads[kind].signals(direction), rtol=1e-14)
        change = triad.signals(direction, [triad.reference_temperature + 100.0]) - reference
        # 100 degC times 1e-4: a percent of full field, give or take a few sd
        assert 0.0 < np.abs(change).max() < 0.06 * np.abs(triad.tensor[0]).max()
    assert with_temperature(plain, 2, 0) is plain


def test_digitise_rounds_to_the_nearest_and_clips():
    codes, saturated = digitise(np.array([-9.0, -8.4, -0.6, 0.49, 7.4, 7.6]), 1.0, 4)
    assert codes.tolist() == [-8.0, -8.0, -1.0, 0.0, 7.0, 7.0]
    assert saturated.tolist() == [True, False, False, False, False, True]


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: random_tool(1, sensors={"barometer": 3}), "input-choice"),
        (lambda: random_tool(1, sensors={"gyro": 0}), "input-value"),
        (lambda: random_tool(1, g=-1.0), "input-value"),
        (lambda: random_tool(1, temperature_degree=5), "input-value"),
        (lambda: random_tool(1, bits=1), "input-value"),
        (lambda: random_tool(-1), "input-value"),
        (lambda: signal_step("accelerometer", "V", 12), "simulate-unit"),
    ],
)
def test_bad_requests_are_refused(build, message):
    with refused(message):
        build()
