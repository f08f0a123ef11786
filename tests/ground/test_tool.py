"""A tool: order of the parameters, their covariance, and back."""

import numpy as np
import pytest

from inclinometry.errors import InputError
from inclinometry.sensors import Tool, Triad, parameter_names, parameter_vector, triad_from_vector

MAG = Triad("magnetometer", np.arange(12.0).reshape(4, 3) ** 2, np.arange(4.0), "nT", 5e4)
ACC = Triad("accelerometer", np.stack([np.eye(3), 1e-3 * np.eye(3)]), np.ones((2, 3)), "V", 9.8, 25.0)


def test_kinds_come_in_one_order_whatever_was_given():
    tool = Tool("T1", {"magnetometer": MAG, "accelerometer": ACC})
    assert tuple(tool.triads) == ("accelerometer", "magnetometer")
    assert tool.slices == {"accelerometer": slice(0, 24), "magnetometer": slice(24, 40)}
    assert len(tool.parameter_names) == len(set(tool.parameter_names)) == 40
    assert tool.covariance.shape == (40, 40)


def test_names_and_values_go_together():
    for triad in (MAG, ACC):
        for name, value in zip(parameter_names(triad), parameter_vector(triad), strict=True):
            body, _, power = name.removeprefix(f"{triad.kind}.").partition(".T")
            index = tuple(int(i) for i in body[body.index("[") + 1 : -1].split(","))
            array = triad.tensor if body.startswith("tensor") else triad.offset
            assert array[(int(power or 0), *index)] == value


@pytest.mark.parametrize("triad", [MAG, ACC])
def test_vector_and_back(triad):
    back = triad_from_vector(triad, parameter_vector(triad))
    assert np.array_equal(back.tensor, triad.tensor)
    assert np.array_equal(back.offset, triad.offset)
    assert (back.unit, back.field_strength, back.reference_temperature) == (
        triad.unit,
        triad.field_strength,
        triad.reference_temperature,
    )


def test_noise_is_one_number_a_sensor():
    tool = Tool("T1", {"magnetometer": MAG, "accelerometer": ACC}, noise={"magnetometer": 20.0})
    assert np.array_equal(tool.noise["magnetometer"], np.full(4, 20.0))
    assert np.array_equal(tool.noise["accelerometer"], np.zeros(3))


def test_what_is_not_a_tool():
    with pytest.raises(InputError, match="allowed: one or more of accelerometer"):
        Tool("T1", {})
    with pytest.raises(InputError, match="this tool has 16 parameters"):
        Tool("T1", {"magnetometer": MAG}, np.eye(12))
    with pytest.raises(InputError, match="must be finite"):
        Tool("T1", {"magnetometer": MAG}, np.full((16, 16), np.inf))
