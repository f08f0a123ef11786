"""Inclination and toolface of two or three accelerometers: rotation matrices, differences, limits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.gyro.closed_form import settle_vertical, tilt, upward
from inclinometry.rotations import dcm, wrap_positive, wrap_signed

G = 9.81
rad = np.radians


def gravity(inclination: Any, toolface: Any, azimuth: float = 0.4) -> Any:
    return G * dcm(np.full_like(inclination, azimuth), inclination, toolface)[..., 2]


@pytest.fixture
def attitudes() -> Any:
    rng = np.random.default_rng(1)
    return rng.uniform(0.01, np.pi - 0.01, 300), rng.uniform(0.0, 2.0 * np.pi, 300)


def test_angles_are_those_of_the_rotation_matrices(attitudes: Any) -> None:
    inclination, toolface = attitudes
    found = tilt(gravity(inclination, toolface))
    np.testing.assert_allclose(found.inclination, inclination, atol=1e-14)
    assert np.abs(wrap_signed(found.toolface - toolface)).max() < 1e-12  # 1e-16 over the sine of 0.01
    np.testing.assert_allclose(found.strength, G, rtol=1e-15)
    assert not found.unseen.any()


def test_without_z_gravity_is_given_and_the_tool_points_down(attitudes: Any) -> None:
    inclination, toolface = attitudes
    field = gravity(inclination, toolface)
    found = tilt(field[:, :2], G)
    folded = np.minimum(inclination, np.pi - inclination)
    # an arcsine loses half the digits near the horizontal
    np.testing.assert_allclose(found.inclination, folded, atol=3e-8)
    assert found.unseen.all()
    mixed = np.where((np.arange(300) % 2 == 0)[:, None], field, [[1.0, 1.0, np.nan]] * field)
    both = tilt(mixed, G)
    np.testing.assert_array_equal(both.unseen, np.arange(300) % 2 == 1)
    # last bits of a long and of a short run through wide registers may differ
    np.testing.assert_allclose(both.inclination[::2], tilt(field).inclination[::2], rtol=1e-14)
    up = upward(found, inclination > np.pi / 2)
    np.testing.assert_allclose(up.inclination, inclination, atol=3e-8)
    np.testing.assert_array_equal(up.toolface, found.toolface)


@pytest.mark.parametrize("seen", [True, False])
def test_derivatives_are_those_of_differences(attitudes: Any, seen: bool) -> None:
    inclination, toolface = attitudes
    away = np.abs(inclination - np.pi / 2) > 0.05  # without z the derivative is infinite at the horizontal
    up = inclination > np.pi / 2
    field = gravity(inclination, toolface)

    def angles(offset: Any) -> Any:
        found = tilt((field + offset)[:, : 3 if seen else 2], None if seen else G)
        return found if seen else upward(found, up)

    given = angles(0.0).by_gravity[away]
    for axis in range(3 if seen else 2):
        step = 1e-5 * np.eye(3)[axis]
        plus, minus = angles(step), angles(-step)
        incline = (plus.inclination - minus.inclination)[away] / 2e-5
        turn = wrap_signed(plus.toolface - minus.toolface)[away] / 2e-5
        # third derivatives grow as the cube of 1 / (0.01 g): 1e-4 of the derivative at the steepest
        np.testing.assert_allclose(given[:, 0, axis], incline, rtol=2e-4, atol=1e-8)
        np.testing.assert_allclose(given[:, 1, axis], turn, rtol=2e-3, atol=1e-8)


def test_gravity_may_be_in_any_unit_and_turning_the_tool_turns_only_the_toolface(attitudes: Any) -> None:
    inclination, toolface = attitudes
    found = tilt(gravity(inclination, toolface))
    small = tilt(gravity(inclination, toolface) / 1024.0)
    np.testing.assert_array_equal(small.inclination, found.inclination)
    np.testing.assert_array_equal(small.by_gravity, 1024.0 * found.by_gravity)
    down = inclination < 1.5
    across, small = (gravity(inclination[down], toolface[down])[:, :2] / size for size in (1.0, 1024.0))
    np.testing.assert_array_equal(tilt(small, G / 1024.0).inclination, tilt(across, G).inclination)
    turned = tilt(gravity(inclination, toolface + 1.0))
    np.testing.assert_allclose(turned.inclination, found.inclination, atol=1e-14)
    assert np.abs(wrap_signed(turned.toolface - found.toolface - 1.0)).max() < 1e-12


def test_noise_may_carry_cross_axis_gravity_a_little_beyond_g() -> None:
    found = tilt([[0.0, 1.03 * G]], G)
    assert found.inclination[0] == pytest.approx(np.pi / 2, abs=1e-15)
    assert np.isfinite(found.by_gravity).all()


def test_vertical_tools_carry_the_whole_turn_in_the_toolface() -> None:
    inclination = np.array([0.0, np.pi, 0.1])
    azimuth, toolface = settle_vertical(inclination, np.array([1.0, 1.0, 1.0]), np.array([0.5, 0.5, 0.5]))
    np.testing.assert_allclose(azimuth, [0.0, 0.0, 1.0])
    np.testing.assert_allclose(toolface, [1.5, wrap_positive(-0.5), 0.5])
    # the attitude itself is the same
    np.testing.assert_allclose(
        dcm(azimuth, inclination, toolface), dcm(np.ones(3), inclination, np.full(3, 0.5)), atol=3e-16
    )


@pytest.mark.parametrize(
    ("given", "g", "says"),
    [
        ([[1.0, np.nan, 9.0]], None, "input-value"),
        ([[1.0, 2.0, np.inf]], None, "input-value"),
        ([1.0, 2.0, 3.0], None, "input-shape"),
        ([[1.0]], None, "input-shape"),
        ("level", None, "input-kind"),
        ([[1.0, 2.0]], None, "input-needs"),
        ([[1.0, 2.0, np.nan]], None, "input-needs"),
        ([[0.0, 0.0, 0.0]], None, "gyro-accel-heavy"),
        ([[1.0, 2.0], [9.0, 9.0]], 9.81, "gyro-accel-heavy"),
        ([[1.0, 2.0]], np.nan, "gyro-accel-heavy"),
        ([[1.0, 2.0]], -9.81, "gyro-accel-heavy"),
        ([[1.0, 2.0]], 0.0, "gyro-accel-heavy"),
    ],
)
def test_wrong_input_is_refused(given: Any, g: float | None, says: str) -> None:
    with refused(says):
        tilt(given, g)
