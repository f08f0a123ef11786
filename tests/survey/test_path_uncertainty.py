"""Derivatives of points against finite differences, their covariance against draws."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.survey.path import (
    POINT,
    bend,
    curve_jacobian,
    interpolate,
    interpolation_jacobian,
    minimum_curvature,
    point_covariance,
    project_curve,
    project_straight,
    straight_jacobian,
)

INTERVALS = {
    "ordinary": (0.6, 1.0, 0.8, 1.3),
    "straight": (0.6, 1.0, 0.6, 1.0),
    "hardly bent": (0.6, 1.0, 0.6 + 1e-7, 1.0),
    "at the seam of a series": (0.6, 1.0, 1.598, 1.0),
    "across north": (0.6, -0.1, 0.8, 0.2),
    "from vertical": (0.0, 1.0, 0.3, 2.0),
    "strong turn": (1.2, 0.3, 2.0, 2.9),
    "upwards": (1.5, 1.0, 2.5, 1.2),
}


def point_of(project, stations, md):
    """Point (5,) of two stations given as in STATIONS."""
    path = minimum_curvature(stations[[3, 6]], np.abs(stations[[4, 7]]), stations[[5, 8]], start=stations[:3])
    return np.array([getattr(project(path, md), name)[0] for name in POINT])


def differences(project, stations, md, step=1e-5):
    """Central differences of fourth order; an inclination below zero is the other azimuth."""

    def at(column, size):
        moved = stations.copy()
        moved[column] += size
        for slope, heading in ((4, 5), (7, 8)):
            if moved[slope] < 0.0:
                moved[heading] += np.pi
        return point_of(project, moved, md)

    columns = []
    for column in range(9):
        h = 0.03 if column < 4 or column == 6 else 100.0 * step
        change = 8.0 * wrapped(at(column, h) - at(column, -h)) - wrapped(at(column, 2 * h) - at(column, -2 * h))
        columns.append(change / (12.0 * h))
    return np.stack(columns, axis=-1)


def wrapped(change):
    change[4] = (change[4] + np.pi) % (2.0 * np.pi) - np.pi
    return change


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name == "ordinary" else pytest.mark.long) for name in INTERVALS]
)
@pytest.mark.parametrize(
    ("project", "jacobian", "md"),
    [
        (interpolate, interpolation_jacobian, 1012.0),
        (interpolate, interpolation_jacobian, 1027.0),
        (project_curve, curve_jacobian, 1042.0),
        (project_straight, straight_jacobian, 1042.0),
    ],
)
def test_derivatives_are_those_of_finite_differences(name, project, jacobian, md):
    i1, a1, i2, a2 = INTERVALS[name]
    stations = np.array([5.0, -3.0, 900.0, 1000.0, i1, a1, 1030.0, i2, a2])
    path = minimum_curvature([1000.0, 1030.0], [i1, i2], [a1, a2], start=stations[:3])
    found = jacobian(path, md)[0]
    # fourth order in steps of 1e-3 rad and 0.03 m, times lengths of 40 m
    np.testing.assert_allclose(found, differences(project, stations, md), atol=2e-9, rtol=1e-8)


@pytest.mark.parametrize("jacobian", [interpolation_jacobian, curve_jacobian, straight_jacobian])
def test_the_interval_of_a_point_counts_alone(jacobian):
    md, slope, heading = [0.0, 25.0, 60.0, 90.0], [0.2, 0.5, 0.7, 0.9], [1.0, 1.5, 2.0, 2.2]
    whole, last = minimum_curvature(md, slope, heading), minimum_curvature(md[2:], slope[2:], heading[2:])
    at = [72.0] if jacobian is interpolation_jacobian else [101.0]
    np.testing.assert_allclose(jacobian(whole, at), jacobian(last, at), rtol=1e-12, atol=1e-12)


def test_at_a_station_the_station_counts_alone():
    path = minimum_curvature([0.0, 30.0, 60.0], [0.5, 0.7, 0.7], [1.0, 1.5, 2.0])
    angles = interpolation_jacobian(path, path.md)[:, 3:, [4, 5, 7, 8]]
    own = np.eye(2)
    np.testing.assert_allclose(angles[0], np.hstack([own, 0 * own]), atol=1e-14)
    np.testing.assert_allclose(angles[1], np.hstack([own, 0 * own]), atol=1e-14)  # of the interval below
    np.testing.assert_allclose(angles[2], np.hstack([0 * own, own]), atol=1e-14)


def test_both_sides_of_a_station_agree_on_the_position():
    """A point just above a station and one at it have the same covariance when all errors are carried along."""
    md, slope, heading = [0.0, 30.0, 60.0], [0.5, 0.7, 0.7], [1.0, 1.5, 2.0]
    path = minimum_curvature(md, slope, heading)
    angles = np.diag([0.0, 0, 0, 0.01, 1e-6, 4e-6, 0.01, 1e-6, 4e-6])  # of depths and angles of stations 0 and 1
    above = interpolation_jacobian(path, 30.0 - 1e-9)[0]
    second = np.zeros((9, 9))  # the same errors as they stand in the interval below
    second[:3] = above[:3]
    second[:3, 6] += path_direction(path, 1)  # station 1 itself moves with its depth; a point at a held depth does not
    second[3:6, 6:9] = np.eye(3)
    below = interpolation_jacobian(path, 30.0)[0] @ second
    np.testing.assert_allclose(below[:3] @ angles @ below[:3].T, above[:3] @ angles @ above[:3].T, atol=1e-9)


def path_direction(path, k):
    i, a = path.inclination[k], path.azimuth[k]
    return np.array([np.sin(i) * np.cos(a), np.sin(i) * np.sin(a), np.cos(i)])


@pytest.mark.long
def test_the_covariance_is_that_of_draws():
    random, count = np.random.default_rng(3), 4000
    path = minimum_curvature([1000.0, 1030.0], [0.6, 0.8], [1.0, 1.3])
    root = random.normal(size=(9, 9)) * np.array([[1.0, 1, 1, 0.1, 2e-3, 4e-3, 0.1, 2e-3, 4e-3]]).T
    stations = np.array([0.0, 0, 0, 1000.0, 0.6, 1.0, 1030.0, 0.8, 1.3])
    drawn = stations + random.normal(size=(count, 9)) @ root.T
    seen = np.cov(np.array([point_of(interpolate, row, 1012.0) for row in drawn]).T)
    found = point_covariance(interpolation_jacobian(path, 1012.0), root @ root.T)[0]
    spread = np.sqrt(np.outer(np.diag(found), np.diag(found)))
    # a covariance of 4000 draws is known to sqrt(2/4000) = 2.2 %; four of those
    np.testing.assert_allclose(seen / spread, found / spread, atol=0.09)


def test_half_way_between_independent_stations_angles_are_surer_than_at_either():
    path = minimum_curvature([0.0, 30.0], [0.5, 0.5], [1.0, 1.0])
    own = np.zeros((9, 9))
    own[4, 4] = own[7, 7] = 1e-6
    shared = own.copy()
    shared[4, 7] = shared[7, 4] = 1e-6
    jacobian = interpolation_jacobian(path, [0.0, 15.0])
    np.testing.assert_allclose(point_covariance(jacobian, own)[:, 3, 3], [1e-6, 0.5e-6], rtol=1e-12)
    np.testing.assert_allclose(point_covariance(jacobian, [shared, shared])[:, 3, 3], 1e-6, rtol=1e-12)


def test_a_vertical_hole_has_positions_but_no_azimuth():
    path = minimum_curvature([0.0, 30.0], [0.0, 0.0], [1.0, 1.0])
    jacobian = interpolation_jacobian(path, [0.0, 15.0, 30.0])
    assert np.isnan(jacobian[:, 4]).all()
    assert np.isfinite(jacobian[:, :4]).all()
    assert np.isnan(straight_jacobian(path, 40.0)[0, 4, 8])
    # an inclination moves the bottom toward the azimuth written there
    np.testing.assert_allclose(jacobian[2, :3, 7], 15.0 * np.array([np.cos(1.0), np.sin(1.0), 0.0]), atol=1e-14)
    found = point_covariance(jacobian, np.eye(9))
    assert np.isfinite(found[:, :4, :4]).all()


@pytest.mark.parametrize(
    ("jacobian", "covariance", "code"),
    [
        (np.zeros((2, 5, 9)), np.zeros((3, 9, 9)), "input-shape"),
        (np.zeros((5, 9)), np.zeros((9, 9)), "input-shape"),
        (np.zeros((1, 5, 9)), np.zeros((8, 8)), "input-shape"),
        (np.zeros((1, 5, 9)), np.full((9, 9), np.nan), "input-finite"),
    ],
)
def test_shapes_that_do_not_fit(jacobian, covariance, code):
    with refused(code):
        point_covariance(jacobian, covariance)


def test_the_series_meets_the_formula():
    for x in (0.5 - 1e-12, 0.5 + 1e-12, -0.5):
        np.testing.assert_allclose(bend(np.array([x])), (np.cos(0.5) - np.sin(0.5) / 0.5) / 0.25, rtol=1e-11)
    assert bend(np.array([0.0]))[0] == -1.0 / 3.0
