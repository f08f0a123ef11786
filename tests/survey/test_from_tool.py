"""Six-axis stations of a calibrated tool: its fields, and what its certificate says of them."""

from dataclasses import replace

import numpy as np
import pytest
from tests.refusals import coded, refused

from inclinometry.constants import STANDARD_GRAVITY, VECTORS
from inclinometry.sensors import Tool, parameter_vector, triad_from_vector
from inclinometry.simulate.hole import simulate_survey
from inclinometry.simulate.tool import random_tool
from inclinometry.survey.from_tool import NOTHING_STATED, stations_from_tool, stations_plain

DIP = np.radians(65.0)


def uncertain(tool, size=0.3):
    """The tool with a full, correlated covariance of about `size` signal units in every parameter."""
    count = len(tool.parameter_names)
    root = np.random.default_rng(1).normal(size=(count, count)) * size / np.sqrt(count)
    return replace(tool, covariance=root @ root.T)


def surveyed(tool, count=50, **more):
    random = np.random.default_rng(7)
    inclination, azimuth, toolface = random.uniform(0.05, 3.0, count), *random.uniform(0.0, 2 * np.pi, (2, count))
    return simulate_survey(tool, np.arange(count) * 10.0, inclination, azimuth, toolface, dip=DIP, seed=3, **more)


def strengths_unknown(tool):
    return replace(tool, triads={k: replace(triad, field_strength=None) for k, triad in tool.triads.items()})


@pytest.mark.parametrize("sensors", [{"accelerometer": 3, "magnetometer": 3}, {"accelerometer": 5, "magnetometer": 4}])
def test_fields_of_a_perfect_tool(sensors):
    tool = random_tool(1, sensors=sensors)
    true = surveyed(tool, noise={}, g=9.79, b=46_000.0)
    found = stations_from_tool(true.md, true.signals, tool)
    # rounding of signals of up to 2^15 counts
    np.testing.assert_allclose(np.linalg.norm(found.g, axis=1), 9.79, rtol=1e-11)
    np.testing.assert_allclose(np.linalg.norm(found.b, axis=1), 46_000.0, rtol=1e-11)
    down, dip = found.g / 9.79, np.einsum("ni,ni->n", found.g, found.b) / (9.79 * 46_000.0)
    np.testing.assert_allclose(down[:, 2], np.cos(true.inclination), atol=1e-11)
    np.testing.assert_allclose(dip, np.sin(DIP), atol=1e-11)


@pytest.mark.parametrize("degree", [0, 2])
def test_derivatives_by_the_parameters(degree):
    tool = uncertain(random_tool(2, temperature_degree=degree))
    heat = np.linspace(-10.0, 110.0, 20) if degree else None
    true = surveyed(tool, 20, noise={}, temperature=heat)
    source = stations_from_tool(true.md, true.signals, tool, temperature=heat).sources["calibration"]
    assert source.by_field.shape == (20, 6, 24 * (degree + 1))
    np.testing.assert_array_equal(source.covariance, tool.covariance)
    column = 0
    for kind in VECTORS:
        vector = parameter_vector(tool.triads[kind])
        for k in range(len(vector)):
            # a bias of hundredth counts per degC^power: far below the signals, far above their rounding
            step = 1e-2 * 100.0 ** -(k // 12) * np.eye(len(vector))[k]
            pair = []
            for sign in (1.0, -1.0):
                moved = {**tool.triads, kind: triad_from_vector(tool.triads[kind], vector + sign * step)}
                one = stations_from_tool(true.md, true.signals, replace(tool, triads=moved), temperature=heat)
                pair.append(np.concatenate([one.g, one.b], axis=1))
            slope = (pair[0] - pair[1]) / (2.0 * step.max())
            size = np.abs(slope).max()
            np.testing.assert_allclose(source.by_field[:, :, column], slope, rtol=0, atol=1e-6 * size)
            column += 1


def test_noise_is_that_of_a_reading():
    tool = random_tool(3)
    true = [surveyed(tool, 1, noise={}).signals[kind] for kind in VECTORS]
    deviation = {"accelerometer": np.array([0.2, 0.4, 0.6]), "magnetometer": np.array([1.0, 0.5, 2.0])}
    tool = replace(tool, noise=deviation)
    random, count = np.random.default_rng(8), 20_000
    signals = {
        kind: one + deviation[kind] * random.normal(size=(count, 3)) for kind, one in zip(VECTORS, true, strict=True)
    }
    found = stations_from_tool(np.arange(count), signals, tool)
    sample = np.cov(np.concatenate([found.g, found.b], axis=1).T)
    # a variance of 20,000 draws is known to 1 %; the draws move the derivatives by 1e-4
    scale = np.sqrt(np.diagonal(sample))
    np.testing.assert_allclose(found.noise[0] / np.outer(scale, scale), sample / np.outer(scale, scale), atol=0.04)
    assert NOTHING_STATED in found.history  # a covariance of zero is no certificate
    assert not found.sources


def test_strengths_are_taken_from_the_caller_where_the_tool_has_none():
    tool = uncertain(random_tool(4))
    true = surveyed(tool)
    known = stations_from_tool(true.md, true.signals, tool)
    blind = strengths_unknown(tool)
    for missing, given in (("accelerometer", {}), ("magnetometer", {"g": 9.8})):
        with refused("input-strength", kind=missing):
            stations_from_tool(true.md, true.signals, blind, **given)
    for wrong in (980.0, 0.0):
        with refused("input-value", name="g"):
            stations_from_tool(true.md, true.signals, blind, g=wrong, b=5e4)
    found = stations_from_tool(true.md, true.signals, blind, g=STANDARD_GRAVITY, b=50_000.0)
    np.testing.assert_allclose(found.g, known.g, rtol=1e-12)
    np.testing.assert_allclose(found.field_covariance(), known.field_covariance(), rtol=1e-9)
    assert coded(found.history).count("survey-step-strength") == 2
    assert len(known.history) == 1


def test_wrong_input_is_named():
    tool = uncertain(random_tool(5))
    true = surveyed(tool)
    alone = Tool("a", {"accelerometer": tool.triads["accelerometer"]})
    with refused("input-uncalibrated"):
        stations_from_tool(true.md, true.signals, alone)
    with refused("input-triads"):
        stations_from_tool(true.md, {"magnetometer": true.signals["magnetometer"]}, tool)
    with refused("input-shape", name="accelerometer.channels"):
        stations_from_tool(true.md[:-1], true.signals, tool)
    with refused("input-order", name="md"):
        stations_from_tool(true.md[::-1], true.signals, tool)
    hot = random_tool(5, temperature_degree=1)
    with refused("input-temperature"):
        stations_from_tool(true.md, true.signals, hot)


def test_a_gyro_is_left_out():
    tool = uncertain(random_tool(6, sensors={"accelerometer": 3, "magnetometer": 3, "gyro": 3}))
    true = surveyed(tool)
    found = stations_from_tool(true.md, true.signals, tool)
    assert found.sources["calibration"].covariance.shape == (24, 24)
    assert "not used for the six-axis stations" in [one.values.get("what") for one in found.history]


def test_plain_fields():
    md, g, b = [0.0, 10.0], np.array([[0, 0, 9.8], [1, 0, 9.7]]), np.array([[2e4, 0, 4e4]] * 2)
    found = stations_plain(md, g, b, sigma_g=[0.01, 0.01, 0.02], sigma_b=30.0, temperature=[20.0, 21.0])
    np.testing.assert_allclose(np.diagonal(found.noise[1]), [1e-4, 1e-4, 4e-4, 900.0, 900.0, 900.0])
    assert not stations_plain(md, g, b).field_covariance().any()
    with refused("input-shape", name="sigma_g"):
        stations_plain(md, g, b, sigma_g=[1.0, 2.0])
    with refused("input-value", name="sigma_b"):
        stations_plain(md, g, b, sigma_b=-1.0)
