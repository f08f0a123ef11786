"""Triads and tools: the linear model and its inverse, order of the parameters, the classical view."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.sensors import Tool, Triad, classical_view, parameter_names, parameter_vector, triad_from_vector

EXACT = 1e-12  # rounding times the condition of the random tensors below, which is under 1e3


def random_triad(rng, sensors=3, degree=0):
    tensor = rng.normal(size=(degree + 1, sensors, 3)) * 1e-3 ** np.arange(degree + 1)[:, None, None]
    tensor[0] += 3.0 * np.eye(sensors, 3)
    return Triad("magnetometer", tensor, rng.normal(size=(degree + 1, sensors)), "counts", 5e4)


@given(st.integers(3, 7), st.integers(0, 2), st.integers(0, 2**32 - 1))
def test_field_undoes_signals(sensors, degree, seed):
    rng = np.random.default_rng(seed)
    triad = random_triad(rng, sensors, degree)
    direction, temperature = rng.normal(size=(4, 5, 3)), rng.uniform(0, 100, (4, 5))
    signals = triad.signals(direction, temperature)
    assert signals.shape == (4, 5, sensors)
    assert np.abs(triad.field(signals, temperature) - direction).max() < 1e-9  # some seeds are near singular
    inverse = triad.inverse(temperature)
    tensor = np.tensordot(triad.basis(temperature), triad.tensor, axes=1)
    assert np.abs(inverse @ tensor - np.eye(3)).max() < 1e-9


def test_signals_written_out_by_hand():
    triad = Triad("gyro", [[[1, 2, 3], [4, 5, 6]], [[0.1, 0, 0], [0, 0, 0.2]]], [[10, 20], [1, 2]], "V")
    a, dt = np.array([0.5, -1.0, 2.0]), 5.0
    first = (1 + 0.1 * dt) * 0.5 - 2.0 + 6.0 + 10 + dt
    second = 2.0 - 5.0 + (6 + 0.2 * dt) * 2.0 + 20 + 2 * dt
    assert np.allclose(triad.signals(a, 25.0), [first, second], atol=EXACT)
    assert (triad.count, triad.degree, triad.full) == (2, 1, False)


def test_two_sensors_see_the_projection_on_their_plane():
    triad = Triad("magnetometer", [[2.0, 0, 0], [1.0, 1.0, 0]], [0.0, 1.0])
    assert np.allclose(triad.field(triad.signals([0.3, 0.4, 0.5])), [0.3, 0.4, 0.0], atol=EXACT)
    assert not triad.full


def test_more_sensors_than_three_average_their_noise():
    rng = np.random.default_rng(3)
    axes = rng.normal(size=(6, 3))
    triad = Triad("accelerometer", axes, np.zeros(6))
    expected = np.linalg.lstsq(axes, np.arange(6.0), rcond=None)[0]
    assert np.allclose(triad.field(np.arange(6.0)), expected, atol=EXACT)
    assert triad.full


def test_length_of_the_field_is_its_strength_relative_to_the_calibration():
    triad = random_triad(np.random.default_rng(1))
    assert np.linalg.norm(triad.field(triad.signals([0.0, 0.0, 1.02]))) == pytest.approx(1.02)


def test_reference_temperature_is_where_the_polynomial_is_its_constant():
    triad = random_triad(np.random.default_rng(2), degree=2)
    assert np.allclose(triad.signals([1, 0, 0], 20.0), triad.tensor[0, :, 0] + triad.offset[0])
    with refused("input-temperature"):
        triad.signals([1, 0, 0])


def test_arrays_are_read_only():
    triad = random_triad(np.random.default_rng(4))
    for array in (triad.tensor, triad.offset):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


@pytest.mark.parametrize(
    ("kind", "tensor", "offset", "strength", "words"),
    [
        ("compass", np.eye(3), np.zeros(3), None, "input-choice"),
        ("gyro", np.eye(3), np.zeros(2), None, "input-shape"),
        ("gyro", np.eye(2), np.zeros(2), None, "input-shape"),
        ("gyro", np.zeros((0, 3)), [], None, "input-shape"),
        ("gyro", [[0.0, 0, 0]], [0.0], None, "sensor-axes-blind"),
        ("gyro", [[1.0, 0, 0], [2.0, 0, 0]], [0.0, 0.0], None, "sensor-axes-blind"),
        ("gyro", np.full((3, 3), np.nan), np.zeros(3), None, "input-finite"),
        ("gyro", np.eye(3), np.zeros(3), 0.0, "input-value"),
        ("gyro", np.eye(3), np.zeros(3), float("nan"), "input-value"),
    ],
)
def test_what_is_not_a_triad(kind, tensor, offset, strength, words):
    with refused(words):
        Triad(kind, tensor, offset, "V", strength)


def test_signals_of_another_number_of_sensors():
    with refused("input-shape", name="gyro.signals"):
        Triad("gyro", np.eye(3), np.zeros(3)).field([1.0, 2.0])


class TestGravity:
    SENSITIVITY = np.arange(12.0).reshape(4, 3)
    GYRO = Triad("gyro", np.ones((4, 3)) + np.eye(4)[:, :3], np.zeros(4), g_sensitivity=SENSITIVITY)

    def test_it_is_taken_off_along_the_three_axes(self):
        down = np.eye(3)
        np.testing.assert_array_equal(self.GYRO.without_gravity(np.zeros((3, 4)), down), -self.SENSITIVITY.T)
        # twice the gravity, twice the effect; many stations at once
        many = self.GYRO.without_gravity(np.ones((5, 3, 4)), 2.0 * down)
        np.testing.assert_array_equal(many[4], 1.0 - 2.0 * self.SENSITIVITY.T)

    def test_signals_and_field_know_nothing_of_it(self):
        plain = Triad("gyro", self.GYRO.tensor, self.GYRO.offset)
        np.testing.assert_array_equal(plain.signals([1.0, 2.0, 3.0]), self.GYRO.signals([1.0, 2.0, 3.0]))
        np.testing.assert_array_equal(plain.without_gravity(np.ones(4), [0.0, 0.0, 1.0]), np.ones(4))

    def test_it_cannot_be_changed(self):
        with pytest.raises(ValueError, match="read-only"):
            self.GYRO.g_sensitivity[0, 0] = 1.0

    @pytest.mark.parametrize(
        ("kind", "value", "words"),
        [
            ("accelerometer", np.eye(3), "input-not-with"),
            ("magnetometer", np.eye(3), "input-not-with"),
            ("gyro", np.eye(2), "input-shape"),
            ("gyro", np.ones((2, 3)), "input-shape"),
            ("gyro", np.ones((2, 3, 3)), "input-shape"),
            ("gyro", np.full((3, 3), np.inf), "input-finite"),
        ],
    )
    def test_refusals(self, kind, value, words):
        with refused(words):
            Triad(kind, np.eye(3), np.zeros(3), g_sensitivity=value)


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
    with refused("input-empty", name="triads"):
        Tool("T1", {})
    with refused("input-shape", name="covariance"):
        Tool("T1", {"magnetometer": MAG}, np.eye(12))
    with refused("input-finite", name="covariance[0, 0]"):
        Tool("T1", {"magnetometer": MAG}, np.full((16, 16), np.inf))


def test_angles_put_in_come_out():
    d1, d2, k = 0.02, -0.3, 1234.5
    axis = np.array([1.0, np.tan(d1), np.tan(d2)])
    axis /= np.linalg.norm(axis)
    triad = Triad("magnetometer", [k * axis, [0, 0, -2 * k], [0, k, 0]], [k, 0, -k], "counts")
    view = classical_view(triad)
    assert np.allclose(view.scale, [k, 2 * k, k], rtol=1e-14)
    assert np.allclose(view.misalignment_angles[0], [d1, d2], atol=1e-13)
    assert view.misalignment[0] == pytest.approx(np.arctan(np.hypot(np.tan(d1), np.tan(d2))), abs=1e-13)
    assert np.array_equal(view.nominal, [[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    assert np.allclose(view.bias, [1.0, 0.0, -1.0], atol=1e-13)
    assert np.array_equal(view.misalignment[1:], [0.0, 0.0])


def test_orthogonality_is_the_angle_between_axes_less_90_degrees():
    lean = np.radians(2.0)  # x leans away from y; the sense of a sensor does not matter
    for sense in (1.0, -1.0):
        triad = Triad("gyro", [[np.cos(lean), -np.sin(lean), 0], [0, 3.0 * sense, 0], [0, 0, 1]], np.zeros(3))
        found = classical_view(triad).orthogonality
        assert found[0, 1] == pytest.approx(lean, abs=1e-13)
        assert np.array_equal(found, found.T)
        assert np.abs(found[2]).max() == 0.0


def test_view_rebuilds_the_tensor():
    rng = np.random.default_rng(1)
    triad = Triad("accelerometer", rng.normal(size=(5, 3)), rng.normal(size=5), "V", 9.8)
    view = classical_view(triad)
    assert np.allclose(9.8 * view.scale[:, None] * view.axes, triad.tensor[0], atol=1e-13)
    assert np.allclose(view.bias * view.scale, triad.offset[0], atol=1e-13)
    assert ((view.axes * view.nominal).sum(axis=1) >= 3**-0.5).all()  # no axis is nearer


def test_temperature_moves_the_view():
    triad = Triad("accelerometer", np.stack([np.eye(3), 1e-3 * np.eye(3)]), np.zeros((2, 3)))
    assert np.allclose(classical_view(triad).scale, 1.0)
    assert np.allclose(classical_view(triad, 120.0).scale, 1.1)
