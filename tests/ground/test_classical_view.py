"""The classical view: built from known angles, it gives them back."""

import numpy as np
import pytest

from inclinometry.sensors import Triad, classical_view

EXACT = 1e-13  # a few roundings of angles of order one


def test_angles_put_in_come_out():
    d1, d2, k = 0.02, -0.3, 1234.5
    axis = np.array([1.0, np.tan(d1), np.tan(d2)])
    axis /= np.linalg.norm(axis)
    triad = Triad("magnetometer", [k * axis, [0, 0, -2 * k], [0, k, 0]], [k, 0, -k], "counts")
    view = classical_view(triad)
    assert np.allclose(view.scale, [k, 2 * k, k], rtol=1e-14)
    assert np.allclose(view.misalignment_angles[0], [d1, d2], atol=EXACT)
    assert view.misalignment[0] == pytest.approx(np.arctan(np.hypot(np.tan(d1), np.tan(d2))), abs=EXACT)
    assert np.array_equal(view.nominal, [[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    assert np.allclose(view.bias, [1.0, 0.0, -1.0], atol=EXACT)
    assert np.array_equal(view.misalignment[1:], [0.0, 0.0])


def test_orthogonality_is_the_angle_between_axes_less_90_degrees():
    lean = np.radians(2.0)  # x leans away from y; the sense of a sensor does not matter
    for sense in (1.0, -1.0):
        triad = Triad("gyro", [[np.cos(lean), -np.sin(lean), 0], [0, 3.0 * sense, 0], [0, 0, 1]], np.zeros(3))
        found = classical_view(triad).orthogonality
        assert found[0, 1] == pytest.approx(lean, abs=EXACT)
        assert np.array_equal(found, found.T)
        assert np.abs(found[2]).max() == 0.0


def test_view_rebuilds_the_tensor():
    rng = np.random.default_rng(1)
    triad = Triad("accelerometer", rng.normal(size=(5, 3)), rng.normal(size=5), "V", 9.8)
    view = classical_view(triad)
    assert np.allclose(9.8 * view.scale[:, None] * view.axes, triad.tensor[0], atol=EXACT)
    assert np.allclose(view.bias * view.scale, triad.offset[0], atol=EXACT)
    assert ((view.axes * view.nominal).sum(axis=1) >= 3**-0.5).all()  # no axis is nearer


def test_temperature_moves_the_view():
    triad = Triad("accelerometer", np.stack([np.eye(3), 1e-3 * np.eye(3)]), np.zeros((2, 3)))
    assert np.allclose(classical_view(triad).scale, 1.0)
    assert np.allclose(classical_view(triad, 120.0).scale, 1.1)
