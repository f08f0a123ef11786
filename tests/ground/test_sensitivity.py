"""Sensitivities against differences of the whole chain: parameters and signals to angles."""

import numpy as np
import pytest

from inclinometry.orientation import angles, inclination_toolface
from inclinometry.rotations import dcm, wrap_signed
from inclinometry.sensors import Tool, angle_sensitivity, parameter_vector, triad_from_vector
from inclinometry.simulate.tool import random_tool

ATTITUDES = [(0.3, 0.7, 2.0), (4.0, 1.5, 5.0), (2.0, 2.6, 0.1), (1.0, 0.02, 3.0)]
DIRECTIONS = {
    "accelerometer": np.array([0.0, 0.0, 1.0]),
    "magnetometer": np.array([0.34, 0.0, 0.94]),
    "gyro": np.array([0.5, 0.0, -0.87]),
}


def read(tool, signals, temperature, second):
    """Four angles from signals, as the survey forms them."""
    seen = {kind: tool.triads[kind].field(values, temperature) for kind, values in signals.items()}
    return np.array(angles(seen["accelerometer"], seen[second]))


def moved(tool, place, h):
    """The tool with one parameter of its joint vector changed."""
    triads = {}
    for kind, triad in tool.triads.items():
        vector = parameter_vector(triad)
        here = tool.slices[kind]
        if here.start <= place < here.stop:
            vector = vector.copy()
            vector[place - here.start] += h
        triads[kind] = triad_from_vector(triad, vector)
    return Tool(tool.name, triads)


@pytest.mark.long
@pytest.mark.parametrize("attitude", ATTITUDES)
@pytest.mark.parametrize(
    ("sensors", "degree", "second"),
    [
        ({"accelerometer": 3, "magnetometer": 3}, 0, "magnetometer"),
        ({"accelerometer": 5, "magnetometer": 4}, 0, "magnetometer"),
        ({"accelerometer": 3, "magnetometer": 3}, 2, "magnetometer"),
        ({"accelerometer": 4, "magnetometer": 3, "gyro": 3}, 1, "gyro"),
    ],
)
def test_by_parameter_and_by_signal(attitude, sensors, degree, second):
    tool = random_tool(2, sensors=sensors, temperature_degree=degree)
    temperature = 47.0
    kinds = ("accelerometer", second)
    field = {kind: dcm(*attitude) @ DIRECTIONS[kind] for kind in kinds}
    signals = {kind: tool.triads[kind].signals(field[kind], temperature) for kind in kinds}
    found = angle_sensitivity(tool, field, temperature, second)
    assert found.kinds == kinds

    def slope(high, low, h):
        return wrap_signed(high - low) / (2 * h)

    # functions of size 1 that change over 1600 counts, over 1600 / 27^P counts per power of temperature; near the
    # vertical angles change over inclination 0.02 of that: truncation stays below 1e-6 of the largest slope
    for place in range(len(tool.parameter_names)):
        power = tool.parameter_names[place].count(".T") and int(tool.parameter_names[place][-1])
        h = 1e-3 / 27.0**power
        expected = slope(
            read(moved(tool, place, h), signals, temperature, second),
            read(moved(tool, place, -h), signals, temperature, second),
            h,
        )
        largest = max(np.abs(expected).max(), 1e-4 * 27.0**power)
        np.testing.assert_allclose(found.by_parameter[:, place], expected, atol=1e-5 * largest)
    column = 0
    for kind in kinds:
        for sensor in range(tool.triads[kind].count):
            h = 1e-3 * np.eye(tool.triads[kind].count)[sensor]
            expected = slope(
                read(tool, {**signals, kind: signals[kind] + h}, temperature, second),
                read(tool, {**signals, kind: signals[kind] - h}, temperature, second),
                1e-3,
            )
            np.testing.assert_allclose(
                found.by_signal[:, column], expected, atol=1e-5 * max(np.abs(expected).max(), 1e-4)
            )
            column += 1
    assert found.by_signal.shape == (4, column)


def test_an_unused_triad_has_no_say():
    tool = random_tool(2, sensors={"accelerometer": 3, "magnetometer": 3, "gyro": 3})
    field = {k: dcm(*ATTITUDES[0]) @ DIRECTIONS[k] for k in ("accelerometer", "magnetometer")}
    found = angle_sensitivity(tool, field)
    assert (found.by_parameter[:, tool.slices["gyro"]] == 0.0).all()
    assert (found.by_parameter[:, tool.slices["magnetometer"]] != 0.0).any()


def test_inclination_and_toolface_need_no_second_field():
    tool = random_tool(2, sensors={"accelerometer": 3})
    field = dcm(*ATTITUDES[0]) @ DIRECTIONS["accelerometer"]
    found = angle_sensitivity(tool, {"accelerometer": field})
    assert np.isnan(found.by_parameter[[1, 3]]).any(axis=1).all()
    signals, h = tool.triads["accelerometer"].signals(field), 1e-3
    for sensor in range(3):
        ends = [
            np.array(inclination_toolface(tool.triads["accelerometer"].field(signals + way * h * np.eye(3)[sensor])))
            for way in (1, -1)
        ]
        np.testing.assert_allclose(found.by_signal[[0, 2], sensor], (ends[0] - ends[1]) / (2 * h), rtol=1e-5, atol=1e-9)


def test_many_attitudes_at_once_are_each_alone():
    tool = random_tool(3, temperature_degree=1)
    heat = np.array([[20.0, 30.0], [40.0, 50.0]])
    matrices = np.array([dcm(*a) for a in ATTITUDES]).reshape(2, 2, 3, 3)
    field = {k: matrices @ DIRECTIONS[k] for k in ("accelerometer", "magnetometer")}
    whole = angle_sensitivity(tool, field, heat)
    assert whole.by_parameter.shape == (2, 2, 4, 48)
    for i in range(2):
        for j in range(2):
            one = angle_sensitivity(tool, {k: v[i, j] for k, v in field.items()}, heat[i, j])
            np.testing.assert_allclose(whole.by_parameter[i, j], one.by_parameter, rtol=1e-12, atol=1e-15)
            np.testing.assert_allclose(whole.by_signal[i, j], one.by_signal, rtol=1e-12, atol=1e-15)


def test_components_are_the_propagated_covariances():
    plain = random_tool(4)
    root = np.random.default_rng(1).normal(size=(24, 24))
    tool = Tool("x", plain.triads, root @ root.T, {"accelerometer": 2.0, "magnetometer": [1.0, 2.0, 3.0]})
    field = {k: dcm(*ATTITUDES[1]) @ DIRECTIONS[k] for k in ("accelerometer", "magnetometer")}
    found = angle_sensitivity(tool, field)
    parts = found.components(tool)
    assert set(parts) == {"calibration", "sensor noise"}
    np.testing.assert_allclose(
        parts["calibration"], found.by_parameter @ tool.covariance @ found.by_parameter.T, rtol=1e-12
    )
    noise = np.diag([4.0, 4.0, 4.0, 1.0, 4.0, 9.0])
    np.testing.assert_allclose(parts["sensor noise"], found.by_signal @ noise @ found.by_signal.T, rtol=1e-12)


def test_scale_of_a_signal_is_immaterial():
    # the same tool with its magnetometer in other units
    tool = random_tool(5)
    field = {k: dcm(*ATTITUDES[0]) @ DIRECTIONS[k] for k in ("accelerometer", "magnetometer")}
    vector = parameter_vector(tool.triads["magnetometer"])
    other = Tool("x", {**tool.triads, "magnetometer": triad_from_vector(tool.triads["magnetometer"], 1e3 * vector)})
    one, two = angle_sensitivity(tool, field), angle_sensitivity(other, field)
    here = tool.slices["magnetometer"]
    np.testing.assert_allclose(two.by_parameter[:, here] * 1e3, one.by_parameter[:, here], rtol=1e-9, atol=1e-15)
