"""Angles from fields and back: round trips, limits, and derivatives against finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.orientation import (
    angles,
    angles_jacobian,
    attitude_jacobian,
    axis_jacobian,
    dip_angle,
    dip_jacobian,
    fields,
    inclination_toolface,
)
from inclinometry.rotations import dcm, wrap_signed

circle = st.floats(0.0, 2.0 * np.pi, exclude_max=True)


def random_attitudes(count: int, seed: int = 1) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    azimuth, toolface = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    inclination = np.arccos(rng.uniform(-1.0, 1.0, count))
    return azimuth, inclination, toolface, rng.uniform(-1.5, 1.5, count)


@given(circle, st.floats(0.0, np.pi), circle, st.floats(-1.5, 1.5))
@example(0.0, 0.0, 0.0, 1.2)
@example(1.0, 0.0, 2.0, 1.2)
@example(1.0, np.pi, 2.0, 1.2)
@example(1.0, 1e-9, 2.0, 1.2)
@example(1.0, 1e-300, 2.0, 1.2)
@example(0.0, 5e-324, 1.0, 0.0)
@example(1.0, np.pi / 2, 2.0, -1.5)
def test_fields_to_angles_and_back(azimuth: float, inclination: float, toolface: float, dip: float) -> None:
    g, b = fields(azimuth, inclination, toolface, dip)
    found = angles(9.81 * g, 5e4 * b)
    # what the angles say must reproduce the fields; cos(1.5) = 0.07 amplifies rounding of b by 14
    g2, b2 = fields(found.azimuth, found.inclination, found.toolface, dip)
    np.testing.assert_allclose(g2, g, atol=2e-15)
    np.testing.assert_allclose(b2, b, atol=2e-14)
    assert abs(float(dip_angle(g, b)) - dip) < 1e-14
    assert abs(float(found.inclination) - inclination) < 1e-15 * 4
    assert 0.0 <= found.azimuth < 2.0 * np.pi
    assert 0.0 <= found.toolface < 2.0 * np.pi
    assert 0.0 <= found.magnetic_toolface < 2.0 * np.pi
    assert abs(wrap_signed(found.azimuth + found.toolface - found.magnetic_toolface)) < 1e-13 or inclination < 1e-3


def test_angles_come_back() -> None:
    azimuth, inclination, toolface, dip = random_attitudes(5000)
    found = angles(*fields(azimuth, inclination, toolface, dip))
    # rounding 2e-16 divided by the smallest sin I (1e-2) and cos dip (0.07)
    assert np.abs(wrap_signed(found.azimuth - azimuth)).max() < 1e-12
    assert np.abs(wrap_signed(found.toolface - toolface)).max() < 1e-13
    assert np.abs(found.inclination - inclination).max() < 1e-14
    inclination2, toolface2 = inclination_toolface(fields(azimuth, inclination, toolface, dip)[0])
    assert np.array_equal(inclination2, found.inclination)
    assert np.array_equal(toolface2, found.toolface)


def test_formulas_of_the_conventions_page() -> None:
    azimuth, inclination, toolface, dip = random_attitudes(500)
    g, b = fields(azimuth, inclination, toolface, dip)
    (gx, gy, gz), (bx, by, bz) = 9.8 * g.T, 48000.0 * b.T
    north = bz * (gx**2 + gy**2) - gz * (gx * bx + gy * by)
    plain = np.arctan2((gx * by - gy * bx) * np.hypot(np.hypot(gx, gy), gz), north)
    found = angles(9.8 * g, 48000.0 * b)
    assert np.abs(wrap_signed(plain - found.azimuth)).max() < 1e-12
    np.testing.assert_allclose(gx, -9.8 * np.sin(inclination) * np.cos(toolface), atol=1e-14)
    np.testing.assert_allclose(gy, 9.8 * np.sin(inclination) * np.sin(toolface), atol=1e-14)
    # the columns of C_tn are north, east and down
    np.testing.assert_allclose(dcm(azimuth, inclination, toolface)[..., 2], g, atol=1e-15)


def test_missing_length_of_g_is_the_trap() -> None:
    # without |g| in the numerator 45 deg comes out as 5.8 deg in m/s^2; a unit of g must not matter
    g, b = fields(np.radians(45.0), np.radians(30.0), 0.3, np.radians(68.0))
    gx, gy, gz = 9.80665 * g
    bx, by, bz = b
    wrong = np.arctan2(gx * by - gy * bx, bz * (gx**2 + gy**2) - gz * (gx * bx + gy * by))
    assert np.degrees(wrong) == pytest.approx(5.8, abs=0.05)
    for unit in (1.0, 9.80665, 1000.0, 1e-200, 1e200):
        assert np.degrees(angles(unit * g, b).azimuth) == pytest.approx(45.0, abs=1e-12)


@pytest.mark.parametrize("dip", [68.0, -68.0])
def test_dip_sign(dip: float) -> None:
    g, b = fields(0.4, 0.5, 0.6, np.radians(dip))
    assert np.degrees(dip_angle(g, b)) == pytest.approx(dip, abs=1e-12)
    assert np.degrees(dip_angle([0, 0, 1], [0.3, 0.2, np.sign(dip)])) * dip > 0.0


def test_exactly_vertical() -> None:
    azimuth, toolface = np.radians(30.0), np.radians(50.0)
    g, b = fields(azimuth, 0.0, toolface, 1.1)
    down = angles(g, b)
    assert down.inclination == 0.0
    assert down.azimuth == 0.0
    assert np.degrees(down.toolface) == pytest.approx(80.0, abs=1e-12)
    assert down.magnetic_toolface == down.toolface
    # straight up, exactly: what is defined is toolface - azimuth
    up = angles(
        [0.0, 0.0, -1.0], dcm(0.0, 0.0, toolface) @ dcm(0.0, np.pi, 0.0).round(15) @ dcm(azimuth, 0, 0) @ [1, 0, 2]
    )
    assert up.inclination == np.pi
    assert up.azimuth == 0.0
    assert np.degrees(up.toolface) == pytest.approx(20.0, abs=1e-12)
    assert up.magnetic_toolface == up.toolface


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_magnetic_toolface_keeps_its_digits_near_vertical(sign: float) -> None:
    for tilt in 10.0 ** np.arange(-15.0, -1.0):
        inclination = tilt if sign > 0 else np.pi - tilt
        found = angles(*fields(0.7, inclination, 1.9, 1.1))
        if sign > 0:
            assert float(found.magnetic_toolface) == pytest.approx(2.6, abs=2e-15)
        assert abs(wrap_signed(found.toolface - sign * 0.0 - 1.9)) < 4e-15 + (0.0 if sign > 0 else 1e-15 / tilt)


def finite_difference(function, x: np.ndarray, step: np.ndarray) -> np.ndarray:  # type: ignore[no-untyped-def]
    columns = []
    for k in range(x.size):
        delta = np.zeros(x.size)
        delta[k] = step[k]
        columns.append(wrap_signed(function(x + delta) - function(x - delta)) / (2.0 * step[k]))
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize("inclination", [1e-3, 0.3, np.pi / 2, 2.0, 3.0, np.pi - 1e-3])
@pytest.mark.parametrize("dip", [1.2, -0.5])
def test_jacobians_by_finite_differences(inclination: float, dip: float) -> None:
    rng = np.random.default_rng(5)
    for azimuth, toolface in rng.uniform(0.0, 2.0 * np.pi, (5, 2)):
        g, b = fields(azimuth, inclination, toolface, dip)
        x = np.concatenate([9.8 * g, 5e4 * b])
        step = 1e-6 * np.repeat([9.8, 5e4], 3)
        scale = np.repeat([9.8, 5e4], 3)
        numeric = finite_difference(lambda v: np.stack(angles(v[:3], v[3:])), x, step) * scale
        analytic = angles_jacobian(x[:3], x[3:]) * scale
        # central differences: step^2 / sin(I)^3 truncation (1e-3 at sin I = 1e-3) and 1e-10 rounding
        allowed = 1e-8 + 2e-12 / np.sin(inclination) ** 3
        np.testing.assert_allclose(analytic, numeric, atol=allowed)
        numeric_dip = finite_difference(lambda v: dip_angle(v[:3], v[3:]), x, step) * scale
        np.testing.assert_allclose(dip_jacobian(x[:3], x[3:]) * scale, numeric_dip, atol=1e-8)


def test_jacobian_exactly_vertical() -> None:
    g, b = fields(0.0, 0.0, 0.8, 1.1)
    jacobian = angles_jacobian(g, b)
    near = angles_jacobian(*fields(0.0, 1e-9, 0.8, 1.1))
    # the limit along the reported toolface, first order in the 1e-9 rad of tilt
    np.testing.assert_allclose(jacobian[[0, 3]], near[[0, 3]], atol=1e-8)
    assert np.isnan(jacobian[1:3]).all()
    upward = angles_jacobian([0, 0, -1.0], [1.0, 0, 1.0])
    assert np.isfinite(upward[0]).all()
    assert np.isnan(upward[1:]).all()
    vertical = [0.0, 0.0, 10.0], [20000.0, 0.0, 40000.0]
    np.testing.assert_allclose(attitude_jacobian(*vertical)[:2, :2], [[0.0, -0.1], [0.1, 0.0]], atol=1e-12)
    np.testing.assert_allclose(axis_jacobian(*vertical)[:, :2], [[-0.1, 0.0], [0.0, -0.1], [0.0, 0.0]], atol=1e-12)


def test_jacobian_is_blind_to_lengths() -> None:
    # angles do not change when a field is stretched: Euler's theorem for homogeneous functions of degree 0
    g, b = fields(*random_attitudes(300))
    jacobian = angles_jacobian(g, b)
    assert np.abs(jacobian[..., :3] @ g[..., None]).max() < 1e-11
    assert np.abs(jacobian[..., 3:] @ b[..., None]).max() < 1e-11


def test_batch_shapes_and_broadcasting() -> None:
    g, b = fields(np.zeros((2, 1)), np.full(3, 0.4), 0.0, 1.0)
    assert g.shape == b.shape == (2, 3, 3)
    assert angles_jacobian(g, b).shape == (2, 3, 4, 6)
    assert angles([0.1, 0, 1], b).azimuth.shape == (2, 3)
    assert angles_jacobian([0.1, 0, 1], b).shape == (2, 3, 4, 6)
    assert dip_jacobian(g, [1.0, 0.2, 0.3]).shape == (2, 3, 6)
    assert angles(np.zeros((0, 3)), np.zeros((0, 3))).azimuth.shape == (0,)


@pytest.mark.parametrize(
    ("g", "b", "message"),
    [
        ([0, 0, 0], [1, 0, 0], "sensor-vector-zero"),
        ([[0, 0, 1], [0, 0, 1]], [[1, 0, 0], [0, 0, 0]], "sensor-vector-zero"),
        ([0.1, 0.2, 0.9], [0.1, 0.2, 0.9], "sensor-fields-parallel"),
        ([0, 0, np.nan], [1, 0, 0], "input-finite"),
        ([0, 1], [1, 0, 0], "input-shape"),
    ],
)
def test_bad_fields(g: list[float], b: list[float], message: str) -> None:
    with refused(message):
        angles(g, b)
