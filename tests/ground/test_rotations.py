"""Rotations and wrapped angles: group laws, derivatives by finite differences, quaternions, scipy as oracle."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from tests.refusals import refused

from inclinometry import rotations as rot
from inclinometry.rotations import TAU, wrap_positive, wrap_signed

ROUNDING = 1e-15 * 4  # a handful of roundings of numbers of size one


def test_elementary_rotations_are_as_printed() -> None:
    a = 0.3
    c, s = np.cos(a), np.sin(a)
    np.testing.assert_array_equal(rot.rotation_z(a), [[c, s, 0], [-s, c, 0], [0, 0, 1]])
    np.testing.assert_array_equal(rot.rotation_y(a), [[c, 0, -s], [0, 1, 0], [s, 0, c]])
    np.testing.assert_array_equal(rot.rotation_x(a), [[1, 0, 0], [0, c, s], [0, -s, c]])
    for matrix, axis in ((rot.rotation_x, 0), (rot.rotation_y, 1), (rot.rotation_z, 2)):
        np.testing.assert_allclose(matrix(a), rot.rotation_exp(-a * np.eye(3)[axis]), atol=ROUNDING)


def test_dcm_against_scipy() -> None:
    a, i, t = np.random.default_rng(1).uniform(-4.0, 4.0, (3, 200))
    # C_nt = (R_z(T) R_y(I) R_z(A))^T is intrinsic z-y-z
    oracle = Rotation.from_euler("ZYZ", np.stack([a, i, t], axis=-1)).as_matrix()
    np.testing.assert_allclose(np.swapaxes(rot.dcm(a, i, t), -1, -2), oracle, atol=ROUNDING)


def test_dcm_derivatives_by_finite_differences() -> None:
    x = np.random.default_rng(2).uniform(-4.0, 4.0, (3, 20))
    analytic = rot.dcm_derivatives(*x)
    assert analytic.shape == (20, 3, 3, 3)
    step = 1e-5
    for k in range(3):
        delta = np.zeros((3, 1))
        delta[k] = step
        numeric = (rot.dcm(*(x + delta)) - rot.dcm(*(x - delta))) / (2 * step)
        # truncation step^2 / 6 = 2e-11, rounding 1e-16 / step = 1e-11
        np.testing.assert_allclose(analytic[:, k], numeric, atol=6e-11)


def test_cross_matrix() -> None:
    u, v = np.random.default_rng(3).normal(size=(2, 50, 3))
    np.testing.assert_allclose((rot.cross_matrix(u) @ v[..., None])[..., 0], np.cross(u, v), atol=ROUNDING * 4)


def test_broadcasting() -> None:
    assert rot.dcm(np.zeros((2, 1)), np.zeros(3), 0.0).shape == (2, 3, 3, 3)
    assert rot.dcm_derivatives(np.zeros((2, 1)), np.zeros(3), 0.0).shape == (2, 3, 3, 3, 3)
    assert rot.dcm(np.zeros(0), 0.0, 0.0).shape == (0, 3, 3)
    assert rot.quaternion_from_dcm(np.zeros((0, 3, 3))).shape == (0, 4)


vectors = st.tuples(*[st.floats(-1.8, 1.8)] * 3)


@given(vectors)
@example((0.0, 0.0, 0.0))
@example((1e-200, 0.0, 0.0))
@example((1e-9, -1e-9, 1e-12))
@example((0.0, 0.0, np.pi))
@example((0.0, -np.pi, 0.0))
@example((np.pi / np.sqrt(2), np.pi / np.sqrt(2), 0.0))
def test_vector_quaternion_matrix_agree(vector: tuple[float, float, float]) -> None:
    v = np.array(vector)
    matrix, q = rot.rotation_exp(v), rot.quaternion_exp(v)
    np.testing.assert_allclose(matrix, Rotation.from_rotvec(v).as_matrix(), atol=ROUNDING)
    np.testing.assert_allclose(rot.dcm_from_quaternion(q), matrix, atol=ROUNDING)
    np.testing.assert_allclose(rot.rotation_exp(rot.rotation_log(matrix)), matrix, atol=ROUNDING)
    np.testing.assert_allclose(rot.dcm_from_quaternion(rot.quaternion_from_dcm(matrix)), matrix, atol=ROUNDING)
    if np.linalg.norm(v) < 3.1:
        np.testing.assert_allclose(rot.rotation_log(matrix), v, atol=ROUNDING)
        np.testing.assert_allclose(rot.quaternion_log(-q), v, atol=ROUNDING)


def test_quaternion_product_follows_the_matrices() -> None:
    a, b = Rotation.random(100, rng=4).as_matrix(), Rotation.random(100, rng=5).as_matrix()
    p, q = rot.quaternion_from_dcm(a), rot.quaternion_from_dcm(b)
    np.testing.assert_allclose(rot.dcm_from_quaternion(rot.quaternion_multiply(p, q)), a @ b, atol=ROUNDING)
    identity = rot.quaternion_multiply(p, p * [1.0, -1.0, -1.0, -1.0])
    np.testing.assert_allclose(identity, np.broadcast_to([1.0, 0, 0, 0], (100, 4)), atol=ROUNDING)


@pytest.mark.parametrize("matrix", [np.diag([1.0, 1.0, -1.0]), 1.1 * np.eye(3), np.ones((3, 3))])
def test_improper_matrices_are_refused(matrix: np.ndarray) -> None:
    with refused("sensor-matrix-improper"):
        rot.rotation_log(matrix)


def test_zero_quaternion_is_refused() -> None:
    with refused("sensor-vector-zero"):
        rot.dcm_from_quaternion([0.0, 0.0, 0.0, 0.0])


turns = st.floats(-1e6, 1e6)


@given(turns)
@example(-1e-300)  # rounds up to a full turn, which lies outside
@example(-0.0)
@example(TAU)
@example(-np.pi)
@example(np.nextafter(np.pi, 4.0))
def test_wrapped_angles_stay_in_range_and_point_the_same_way(angle):
    positive, signed = float(wrap_positive(angle)), float(wrap_signed(angle))
    assert 0.0 <= positive < TAU
    assert -np.pi <= signed < np.pi
    # a float of size 1e6 has digits down to 1e-10
    for wrapped in (positive, signed):
        assert np.exp(1j * wrapped) == pytest.approx(np.exp(1j * angle), abs=1e-9)


def test_the_ends_of_the_ranges():
    assert wrap_positive([0.0, TAU, -TAU, -np.pi]).tolist() == [0.0, 0.0, 0.0, np.pi]
    assert wrap_signed([np.pi, -np.pi, 0.0]).tolist() == [-np.pi, -np.pi, 0.0]
