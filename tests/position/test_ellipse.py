"""Ellipses and components of a covariance."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.position.well import ellipsoid, hole_covariance, hole_sigmas, horizontal_ellipse

AXIS = st.floats(0.01, 100.0)


@given(AXIS, AXIS, st.floats(0.0, 3.14))
def test_an_ellipse_is_found_again(one, other, direction):
    major, minor = max(one, other), min(one, other)
    c, s = np.cos(direction), np.sin(direction)
    turn = np.array([[c, -s], [s, c]])
    found = horizontal_ellipse(turn @ np.diag([major**2, minor**2]) @ turn.T)
    assert found.major == pytest.approx(major, rel=1e-12)
    assert found.minor == pytest.approx(minor, rel=1e-6)  # a thin ellipse's minor axis is a small difference
    if major > 1.01 * minor:
        assert np.sin(found.direction - direction) == pytest.approx(0.0, abs=1e-9)
    assert 0.0 <= found.direction < np.pi


def test_probability_is_that_of_a_normal_distribution():
    covariance = np.array([[4.0, 1.0, 0.3], [1.0, 2.0, -0.2], [0.3, -0.2, 1.0]])
    points = np.random.default_rng(2).multivariate_normal(np.zeros(3), covariance, 40_000)
    ellipse, body = horizontal_ellipse(covariance, 0.9), ellipsoid(covariance, 0.9)
    c, s = np.cos(ellipse.direction), np.sin(ellipse.direction)
    inside = ((c * points[:, 0] + s * points[:, 1]) / ellipse.major) ** 2
    inside += ((c * points[:, 1] - s * points[:, 0]) / ellipse.minor) ** 2
    assert np.mean(inside < 1) == pytest.approx(0.9, abs=0.006)  # four standard deviations of 40,000 draws
    within = (((points @ body.directions.T) / body.semi_axes) ** 2).sum(axis=1) < 1
    assert np.mean(within) == pytest.approx(0.9, abs=0.006)


def test_an_ellipsoid_gives_its_covariance_back():
    root = np.random.default_rng(3).normal(size=(5, 3, 3))
    covariance = root @ np.swapaxes(root, 1, 2)
    found = ellipsoid(covariance)
    again = np.einsum("nki,nk,nkj->nij", found.directions, found.semi_axes**2, found.directions)
    np.testing.assert_allclose(again, covariance, atol=1e-12)
    assert (np.diff(found.semi_axes, axis=1) <= 0).all()


@given(st.floats(0.0, 3.1), st.floats(-6.0, 6.0))
def test_components_are_seen_along_and_across_the_hole(inclination, azimuth):
    covariance = np.array([[4.0, 1.0, 0.3], [1.0, 2.0, -0.2], [0.3, -0.2, 1.0]])
    c, s = np.cos(azimuth), np.sin(azimuth)
    along = np.array([np.sin(inclination) * c, np.sin(inclination) * s, np.cos(inclination)])
    right = np.array([-s, c, 0.0])
    axes = np.array([np.cross(right, along), right, along])
    found = hole_covariance(covariance, inclination, azimuth)
    np.testing.assert_allclose(found, axes @ covariance @ axes.T, atol=1e-12)
    np.testing.assert_allclose(hole_sigmas(covariance, inclination, azimuth), np.sqrt(np.diag(found)))


def test_points_and_lines_have_no_width():
    assert horizontal_ellipse(np.zeros((3, 3)))[:2] == (0.0, 0.0)
    line = horizontal_ellipse([[1.0, 1.0], [1.0, 1.0]])
    assert line.major == pytest.approx(np.sqrt(2))
    assert line.minor == 0.0
    np.testing.assert_array_equal(hole_sigmas(np.zeros((4, 3, 3)), np.ones(4), 0.0), np.zeros((4, 3)))


@pytest.mark.parametrize(
    ("covariance", "message"),
    [
        (np.eye(4), "input-shape"),
        (np.ones((2, 3)), "input-shape"),
        (-np.eye(3), "position-covariance"),
        (np.full((3, 3), np.nan), "input-finite"),
    ],
)
def test_what_is_no_covariance(covariance, message):
    with refused(message):
        horizontal_ellipse(covariance)


def test_a_probability_is_one():
    with refused("input-value", name="probability"):
        ellipsoid(np.eye(3), 95)
