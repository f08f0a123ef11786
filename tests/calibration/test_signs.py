"""Each triad against its mirror image: what decides, and what is said when nothing does."""

import numpy as np
import pytest

from inclinometry.calibration.likelihood import State
from inclinometry.calibration.signs import fix_signs

TENSOR = np.array([[[3.0, 1.0, 0.0, 5.0], [0.0, 2.0, 0.0, -6.0], [0.5, 0.0, 4.0, 7.0]]])


def unit(*vector):
    return np.array(vector) / np.linalg.norm(vector)


def signed(kind, direction, reference=None, prior=None):
    """+1 where the triad was kept, -1 where it was reversed, and the warnings."""
    state = State({kind: TENSOR}, {kind: direction}, np.zeros((1, 3)), np.zeros(4))
    priors = {} if prior is None else {kind: (prior, np.eye(3))}
    found, warnings = fix_signs(state, reference or {}, priors)
    sign = 1.0 if np.array_equal(found.directions[kind], direction) else -1.0
    np.testing.assert_array_equal(found.directions[kind], sign * direction)
    # tensor with the field, offset as it was: no signal changes
    np.testing.assert_array_equal(found.coefficients[kind][..., :3], sign * TENSOR[..., :3])
    np.testing.assert_array_equal(found.coefficients[kind][..., 3], TENSOR[..., 3])
    return sign, warnings


@pytest.mark.parametrize("direction", [unit(0.1, -0.2, 1.0), unit(5.0, 0.0, 0.01), unit(0.0, 0.0, 1.0)])
def test_gravity_points_down(direction):
    assert signed("accelerometer", direction) == (1.0, [])
    assert signed("accelerometer", -direction) == (-1.0, [])


@pytest.mark.parametrize("dip", [70.0, 25.0, -25.0, -60.0, 89.0])
@pytest.mark.parametrize("turn", [0.0, 90.0, 180.0, 250.0])
def test_a_known_steep_dip_decides_wherever_the_rig_points(dip, turn):
    down, along = np.sin(np.radians(dip)), np.cos(np.radians(dip))
    field = np.array([along * np.cos(np.radians(turn)), along * np.sin(np.radians(turn)), down])
    for direction in (field, -field):
        sign, warnings = signed("magnetometer", direction, {"dip": np.radians(dip)})
        np.testing.assert_array_equal(sign * direction, field)
        assert warnings == []


@pytest.mark.parametrize("dip", [0.0, 10.0, -15.0])
def test_a_flat_field_points_to_the_azimuth_zero_of_the_rig(dip):
    field = np.array([np.cos(np.radians(dip)), 0.0, np.sin(np.radians(dip))])
    assert signed("magnetometer", field, {"dip": np.radians(dip)}) == (1.0, [])
    assert signed("magnetometer", -field, {"dip": np.radians(dip)}) == (-1.0, [])


def test_without_a_dip_north_and_down_agree_in_the_north():
    assert signed("magnetometer", unit(0.4, 0.1, 0.9)) == (1.0, [])
    assert signed("magnetometer", -unit(0.4, 0.1, 0.9)) == (-1.0, [])


@pytest.mark.parametrize("direction", [unit(-0.4, 0.0, 0.9), unit(0.4, 0.0, -0.9), unit(0.9, 0.0, -0.4)])
def test_without_a_dip_a_contradiction_is_said(direction):
    for way in (direction, -direction):
        sign, warnings = signed("magnetometer", way)
        # the larger component points north or down
        assert sign * way[np.abs(way).argmax()] > 0.0
        (warning,) = warnings
        assert "ambiguous" in warning
        assert "reference_dip_deg" in warning


@pytest.mark.parametrize(
    ("direction", "decides"), [(unit(0.9, 0.1, -0.01), 0), (unit(-0.01, 0.1, 0.9), 2), (unit(0.01, 0.9, -0.5), 2)]
)
def test_a_component_within_the_rigs_own_tilt_has_no_say(direction, decides):
    for way in (direction, -direction):
        sign, warnings = signed("magnetometer", way)
        assert sign * way[decides] > 0.0
        assert warnings == []


def test_the_dip_that_was_taken_is_named():
    # north 0.94, down -0.34: pointing north it rises by 20 degrees
    _, (warning,) = signed("magnetometer", unit(np.cos(np.radians(20)), 0.0, -np.sin(np.radians(20))))
    assert "dip -20.0 deg was taken" in warning
    _, (warning,) = signed("magnetometer", unit(np.cos(np.radians(70)), 0.0, -np.sin(np.radians(70))))
    assert "dip 70.0 deg was taken" in warning


def test_the_earth_rate_points_north():
    sign, (warning,) = signed("gyro", unit(0.5, 0.1, -0.8))
    assert sign == 1.0
    assert "at latitude +57.5 deg" in warning
    sign, (reversed_warning,) = signed("gyro", -unit(0.5, 0.1, -0.8))
    assert sign == -1.0
    assert reversed_warning == warning


@pytest.mark.parametrize("kind", ["accelerometer", "magnetometer", "gyro"])
def test_a_prior_overrules_everything(kind):
    direction = unit(0.3, 0.2, 0.9)
    assert signed(kind, direction, {"dip": 1.2}, -direction) == (-1.0, [])
    assert signed(kind, -direction, {"dip": 1.2}, -direction) == (1.0, [])
