"""Between the stations, beyond the last one, and off another path; two surveys side by side."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.errors import InputError
from inclinometry.survey.path import (
    Points,
    compare_paths,
    directions,
    interpolate,
    minimum_curvature,
    project_curve,
    project_straight,
    tie_on,
)


def well():
    """Vertical, build, turn, straight."""
    inclination, azimuth = np.radians([0.0, 0.0, 30.0, 60.0, 60.0]), np.radians([0.0, 0.0, 40.0, 80.0, 80.0])
    return minimum_curvature([0.0, 100.0, 400.0, 800.0, 1000.0], inclination, azimuth, start=[10.0, -20.0, 5.0])


def places(points):
    return np.stack([points.north, points.east, points.tvd], axis=-1)


@pytest.mark.parametrize("turn", [1e-9, 1e-4, 0.3, 1.0, 2.0, 3.1])
def test_points_of_a_circle(turn):
    path = minimum_curvature([0.0, 100.0], [0.0, turn], [0.5, 0.5])
    f = np.linspace(0.0, 1.0, 11)
    found = interpolate(path, 100.0 * f)
    radius = 100.0 / turn
    aside, down = 2.0 * radius * np.sin(turn * f / 2.0) ** 2, radius * np.sin(turn * f)
    # near half a turn by rounding over what is left of it, 0.04
    np.testing.assert_allclose(found.inclination, turn * f, rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(found.tvd, down, atol=1e-11)
    np.testing.assert_allclose(found.north, aside * np.cos(0.5), atol=1e-11)
    np.testing.assert_allclose(found.east, aside * np.sin(0.5), atol=1e-11)
    np.testing.assert_allclose(found.azimuth[1:], 0.5, rtol=1e-9)


def test_at_a_station_exactly_the_station():
    path = well()
    found = interpolate(path, path.md[::-1])
    for name in Points._fields:
        assert np.array_equal(getattr(found, name)[::-1], getattr(path, name))


def test_a_point_cuts_an_arc_in_two_of_the_same_circle():
    """Stations put in between change nothing."""
    path = well()
    found = interpolate(path, np.linspace(0.0, 1000.0, 101))
    again = minimum_curvature(found.md, found.inclination, found.azimuth, start=[10.0, -20.0, 5.0])
    np.testing.assert_allclose(places(again), places(found), atol=1e-11)  # roundings of 1 km
    np.testing.assert_allclose(places(again)[-1], places(path)[-1], atol=1e-11)


def test_the_direction_is_the_derivative_of_the_position():
    path, step = well(), 1e-3
    md = np.array([50.0, 130.0, 399.0, 555.0, 799.0, 900.0])
    slope = (places(interpolate(path, md + step)) - places(interpolate(path, md - step))) / (2.0 * step)
    point = interpolate(path, md)
    # rounding of 1 km by the step: 1e-13 / 1e-3
    np.testing.assert_allclose(slope, directions(point.inclination, point.azimuth), atol=5e-10)


def test_vertical_places():
    hanging = minimum_curvature([0.0, 10.0, 20.0], [0.0, 0.0, 0.2], [3.0, 1.0, 2.0])
    found = interpolate(hanging, [0.0, 5.0, 10.0, 10.0 + 1e-6, 15.0])
    np.testing.assert_allclose(found.azimuth, [3.0, 3.0, 1.0, 2.0, 2.0], rtol=1e-9)
    np.testing.assert_allclose(found.inclination, [0.0, 0.0, 0.0, 2e-8, 0.1], rtol=1e-9)
    # through the vertical: the azimuth jumps to the other side, the middle is anybody's
    through = minimum_curvature([0.0, 10.0], [0.1, 0.1], [1.0, 1.0 + np.pi])
    found = interpolate(through, [2.5, 5.0, 7.5])
    np.testing.assert_allclose(found.inclination, [0.05, 0.0, 0.05], atol=1e-16)
    np.testing.assert_allclose(found.azimuth, [1.0, 1.0, 1.0 + np.pi], rtol=1e-12)
    # a hole that stands on its head
    up = interpolate(minimum_curvature([0.0, 10.0], [np.pi, np.pi], [1.0, 2.0]), 4.0)
    np.testing.assert_allclose([up.inclination[0], up.azimuth[0], up.tvd[0]], [np.pi, 1.0, -4.0], rtol=1e-14)


def test_azimuth_goes_the_short_way_round_north():
    path = minimum_curvature([0.0, 10.0], [1.5, 1.5], np.radians([350.0, 10.0]))
    azimuth = np.degrees(interpolate(path, [2.5, 5.0, 7.5]).azimuth)
    assert azimuth[0] > 350.0
    assert azimuth[2] < 10.0
    assert min(azimuth[1], 360.0 - azimuth[1]) < 1e-12


ANGLES = st.tuples(st.floats(0.0, np.pi), st.floats(0.0, 6.2))


@settings(max_examples=300, deadline=None)
@given(ANGLES, ANGLES, st.floats(0.0, 1.0))
@example((0.0, 0.0), (1e-9, 0.0), 0.5)
@example((1e-200, 1.0), (0.0, 0.0), 0.5)
@example((1.0, 1.0), (1.0, 1.0), 1.0)
def test_points_lie_on_the_arc(above, below, f):
    try:
        path = minimum_curvature([0.0, 1.0], [above[0], below[0]], [above[1], below[1]])
    except InputError:  # half a turn
        return
    point = interpolate(path, f)
    t = directions(point.inclination, point.azimuth)[0]
    ends = directions(path.inclination, path.azimuth)
    beta = path.dogleg[0]
    # what is left of half a turn divides the rounding
    close = 1e-14 / max(np.cos(beta / 2.0), 1e-6)
    angles = [2.0 * np.arctan2(np.linalg.norm(t - e), np.linalg.norm(t + e)) for e in ends]
    np.testing.assert_allclose(angles, [f * beta, (1.0 - f) * beta], atol=max(close, 2e-15))
    wanted = minimum_curvature([0.0, max(f, 1e-9)], [above[0], point.inclination[0]], [above[1], point.azimuth[0]])
    np.testing.assert_allclose(places(point)[0], places(wanted)[1], atol=max(close, 2e-9 if f < 1e-9 else 0.0))


def test_the_bit():
    path = well()
    straight, curve = project_straight(path, [1000.0, 1015.0]), project_curve(path, [1000.0, 1015.0])
    # the last interval is straight: both ways to the bit are one
    for one, two in zip(straight, curve, strict=True):
        np.testing.assert_allclose(one, two, rtol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(places(straight)[1] - places(path)[-1]), 15.0, rtol=1e-12)
    bent = minimum_curvature([0.0, 400.0], [0.0, 1.0], [2.0, 2.0])
    ahead = project_curve(bent, [400.0, 500.0, 1000.0])
    np.testing.assert_allclose(ahead.inclination, [1.0, 1.25, 2.5], rtol=1e-13)
    whole = minimum_curvature([0.0, 1000.0], [0.0, 2.5], [2.0, 2.0])
    np.testing.assert_allclose(places(ahead)[2], places(whole)[1], atol=1e-11)


def test_a_side_track():
    path = well()
    found = tie_on(path, 600.0, [630.0, 660.0], [1.0, 1.1], [1.2, 1.2])
    at = interpolate(path, 600.0)
    np.testing.assert_array_equal(places(found)[0], places(at)[0])
    assert found.inclination[0] == at.inclination[0]
    # the mother's own stations bring back the mother
    same = tie_on(path, 600.0, path.md[3:], path.inclination[3:], path.azimuth[3:])
    np.testing.assert_allclose(places(same)[1:], places(path)[3:], atol=1e-11)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda p: interpolate(p, [50.0, 1000.1]), "input-value"),
        (lambda p: interpolate(p, -1.0), "input-value"),
        (lambda p: interpolate(p, [np.nan]), "input-finite"),
        (lambda p: interpolate(p, [[1.0]]), "input-shape"),
        (lambda p: project_curve(p, 999.0), "input-value"),
        (lambda p: project_straight(p, [1001.0, 2.0]), "input-value"),
        (lambda p: tie_on(p, 600.0, [600.0], [1.0], [1.0]), "input-value"),
        (lambda p: tie_on(p, 600.0, [], [], []), "input-few"),
        (lambda p: tie_on(p, 600.0, [610.0, 610.0], [1.0, 1.0], [1.0, 1.0]), "input-order"),
        (lambda p: tie_on(p, 2000.0, [2010.0], [1.0], [1.0]), "input-value"),
        (lambda p: compare_paths(p, minimum_curvature([2e3, 3e3], [0, 0], [0, 0])), "survey-paths-apart"),
        (lambda p: compare_paths(p, p, [1001.0]), "input-value"),
    ],
)
def test_what_is_refused(call, message):
    with refused(message):
        call(well())


def test_a_survey_with_itself():
    path = well()
    found = compare_paths(path, path)
    assert np.array_equal(found.md, path.md)
    for name in ("north", "east", "tvd", "separation", "high_side", "lateral", "along_hole", "inclination", "azimuth"):
        assert (getattr(found, name) == 0.0).all()
        with pytest.raises(ValueError, match="read-only"):
            getattr(found, name)[0] = 1.0


def test_differences_in_the_axes_of_the_hole():
    """A hole straight north-east at 60 deg, moved along each of its axes."""
    slope, heading = np.full(2, np.radians(60.0)), np.full(2, np.radians(45.0))
    one = minimum_curvature([0.0, 100.0], slope, heading)
    s, c, r = np.sin(slope[0]), np.cos(slope[0]), np.sqrt(0.5)
    for axis, moved in (
        ("high_side", [c * r, c * r, -s]),
        ("lateral", [-r, r, 0.0]),
        ("along_hole", [s * r, s * r, c]),
    ):
        found = compare_paths(one, minimum_curvature([0.0, 100.0], slope, heading, start=2.0 * np.array(moved)))
        for name in ("high_side", "lateral", "along_hole"):
            np.testing.assert_allclose(getattr(found, name), 2.0 if name == axis else 0.0, atol=1e-13)
        np.testing.assert_allclose(found.separation, 2.0, rtol=1e-13)


def test_an_azimuth_off_by_a_degree_moves_the_hole_to_its_right():
    md, slope, heading = np.linspace(0.0, 1000.0, 11), np.full(11, np.pi / 2), np.full(11, 0.001)
    found = compare_paths(minimum_curvature(md, slope, heading), minimum_curvature(md, slope, heading - 0.01))
    np.testing.assert_allclose(found.lateral, -md * np.sin(0.01), atol=1e-10)
    np.testing.assert_allclose(found.along_hole, md * (np.cos(0.01) - 1.0), atol=1e-10)
    np.testing.assert_allclose(found.azimuth, -0.01, rtol=1e-10)  # across north, not almost a turn
    np.testing.assert_allclose(found.high_side, 0.0, atol=1e-10)


def test_depths_in_common_are_the_stations_of_both():
    one = minimum_curvature([0.0, 100.0, 200.0], np.zeros(3), np.zeros(3))
    two = minimum_curvature([50.0, 150.0, 250.0], np.zeros(3), np.zeros(3), start=[0.0, 0.0, 50.0])
    assert compare_paths(one, two).md.tolist() == [50.0, 100.0, 150.0, 200.0]
    assert (compare_paths(one, two).separation == 0.0).all()
