"""Minimum curvature: circles, lines, symmetry, a second implementation, refusals."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.errors import InputError
from inclinometry.survey import path as path_module
from inclinometry.survey.path import dogleg_severity_deg, minimum_curvature, tortuosity

# the ISCWSA's example well no. 1, metres and degrees, where its shape changes; vertical depth to 0.01 m
WELL = np.array(
    [(0, 0, 0, 0), (1200, 0, 0, 1200), (2100, 60, 75, 1944.29), (5100, 60, 75, 3444.29), (5400, 90, 75, 3521.06)]
    + [(8000, 90, 75, 3521.06)]
)


def crooked(count=200, seed=1, spacing=10.0):
    """Stations of a well that wanders, a little vertical at the top."""
    random = np.random.default_rng(seed)
    md = np.cumsum(random.uniform(0.5, 1.5, count)) * spacing
    u = np.linspace(0.0, 1.0, count)
    inclination = np.maximum(0.0, np.radians(-5.0 + 110.0 * u + random.normal(0.0, 1.0, count)))
    return md, inclination, np.radians(50.0 + 350.0 * u)


def positions(path):
    return np.stack([path.north, path.east, path.tvd], axis=-1)


def dumb(md, inclination, azimuth):
    """The textbook's loop: arc cosine, division by the dogleg."""
    place, found = np.zeros(3), [np.zeros(3)]
    for k in range(len(md) - 1):
        (i1, i2), (a1, a2) = inclination[k : k + 2], azimuth[k : k + 2]
        dogleg = np.arccos(min(1.0, np.cos(i2 - i1) - np.sin(i1) * np.sin(i2) * (1.0 - np.cos(a2 - a1))))
        ratio = 1.0 if dogleg < 1e-6 else 2.0 / dogleg * np.tan(dogleg / 2.0)
        one = np.array([np.sin(i1) * np.cos(a1), np.sin(i1) * np.sin(a1), np.cos(i1)])
        two = np.array([np.sin(i2) * np.cos(a2), np.sin(i2) * np.sin(a2), np.cos(i2)])
        place = place + 0.5 * (md[k + 1] - md[k]) * ratio * (one + two)
        found.append(place)
    return np.array(found)


def test_a_straight_line_is_one():
    path = minimum_curvature([100.0, 130.0, 1e4], np.full(3, 0.7), np.full(3, 2.0), start=[1.0, 2.0, 90.0])
    along = np.array([np.sin(0.7) * np.cos(2.0), np.sin(0.7) * np.sin(2.0), np.cos(0.7)])
    # a few roundings of 1e4 m
    np.testing.assert_allclose(positions(path), [1.0, 2.0, 90.0] + np.outer(path.md - 100.0, along), atol=1e-11)
    assert (path.dogleg == 0.0).all()
    assert (path.severity == 0.0).all()


@pytest.mark.parametrize("turn", [1e-12, 1e-8, 1e-5, 1e-3, 0.1, 0.82, 0.83, 1.5, 2.3, 2.4, 3.0, np.pi - 1e-5])
@pytest.mark.parametrize("heading", [0.0, 1.0, 4.0])
def test_a_circle_in_a_vertical_plane(turn, heading):
    """Inclination from 0 to `turn` on one arc; r (1 - cos) sideways, r sin down."""
    length = 1000.0
    path = minimum_curvature([0.0, length], [0.0, turn], [heading, heading])
    aside, down = 2.0 * length / turn * np.sin(turn / 2.0) ** 2, length * np.sin(turn) / turn
    wanted = [aside * np.cos(heading), aside * np.sin(heading), down]
    # near half a turn the direction of the chord is known to rounding over the angle that is left, 1e-5
    close = 1e-12 * length if turn < 3.1 else 1e-8
    np.testing.assert_allclose(positions(path)[1], wanted, rtol=1e-12, atol=close)
    np.testing.assert_allclose(path.dogleg, turn, rtol=1e-12, atol=1e-16)
    np.testing.assert_allclose(path.severity, turn / length, rtol=1e-12, atol=1e-19)


def test_a_circle_lying_flat_closes():
    azimuth = np.linspace(0.0, 2.0 * np.pi, 37)
    path = minimum_curvature(100.0 * azimuth, np.full(37, np.pi / 2), azimuth)
    # 36 arcs of a circle of 100 m radius: what is left is rounding
    np.testing.assert_allclose(positions(path)[-1], 0.0, atol=1e-12)
    np.testing.assert_allclose(positions(path)[18], [0.0, 200.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(path.severity, 0.01, rtol=1e-13)


def test_the_published_well():
    md, inclination, azimuth, tvd = WELL.T
    path = minimum_curvature(md, np.radians(inclination), np.radians(azimuth))
    # one arc or many between 1200 and 2100 m: a circle either way; the list is printed to 0.01 m
    np.testing.assert_allclose(path.tvd, tvd, atol=0.005)
    assert dogleg_severity_deg(path)[2:].round(9).tolist() == [2.0, 0.0, 3.0, 0.0]


def test_arcs_cut_into_pieces_stay_where_they_are():
    coarse = minimum_curvature([0.0, 900.0], [0.0, np.radians(60.0)], [1.3, 1.3])
    fine = minimum_curvature(np.linspace(0.0, 900.0, 31), np.radians(np.linspace(0.0, 60.0, 31)), np.full(31, 1.3))
    np.testing.assert_allclose(positions(coarse)[-1], positions(fine)[-1], atol=1e-11)  # rounding of 900 m


def test_a_second_implementation():
    md, inclination, azimuth = crooked()
    path = minimum_curvature(md, inclination, azimuth)
    # the arc cosine of the textbook loses half the digits of a small dogleg; the ratio factor forgives that
    np.testing.assert_allclose(positions(path), dumb(md, inclination, azimuth), atol=1e-10)


def test_walked_backwards_it_is_the_same_hole():
    md, inclination, azimuth = crooked()
    down = minimum_curvature(md, inclination, azimuth)
    up = minimum_curvature(
        md[-1] - md[::-1], np.pi - inclination[::-1], (azimuth + np.pi)[::-1], start=positions(down)[-1]
    )
    np.testing.assert_allclose(positions(up)[::-1], positions(down), atol=1e-11)  # roundings of 2 km
    np.testing.assert_allclose(up.dogleg[::-1], down.dogleg, atol=1e-15)


@pytest.mark.parametrize("turn", [0.5, 3.0, -2.0])
def test_turning_the_north_turns_the_well(turn):
    md, inclination, azimuth = crooked()
    one, two = minimum_curvature(md, inclination, azimuth), minimum_curvature(md, inclination, azimuth + turn)
    c, s = np.cos(turn), np.sin(turn)
    wanted = np.stack([c * one.north - s * one.east, s * one.north + c * one.east, one.tvd], axis=-1)
    np.testing.assert_allclose(positions(two), wanted, atol=1e-11)
    np.testing.assert_allclose(two.dogleg, one.dogleg, atol=1e-15)
    assert ((two.azimuth >= 0.0) & (two.azimuth < 2.0 * np.pi)).all()


@pytest.mark.long
def test_a_million_stations_sum_as_exactly_as_extended_precision():
    count = 1_000_000
    u = np.linspace(0.0, 1.0, count)
    md, inclination, azimuth = 1e4 * u, 0.5 + 0.4 * np.sin(40.0 * u), 3.0 * np.cos(25.0 * u)
    path = minimum_curvature(md, inclination, azimuth)
    i, a = inclination.astype(np.longdouble), azimuth.astype(np.longdouble)
    t = np.stack([np.sin(i) * np.cos(a), np.sin(i) * np.sin(a), np.cos(i)])
    # doglegs are below 1e-3: two terms of tan(x)/x are enough
    square = np.sum((t[:, 1:] - t[:, :-1]) ** 2, axis=0)
    wanted = np.cumsum(0.5 * np.diff(md.astype(np.longdouble)) * (1.0 + square / 12.0) * (t[:, 1:] + t[:, :-1]), axis=1)
    # a rounding of 1e4 m is 9e-13, and the angles themselves carry 1e-16 of 1e4 m
    np.testing.assert_allclose(positions(path)[1:], wanted.T.astype(float), atol=2e-12)


@pytest.mark.parametrize("start", [(0.0, 0.0, 0.0), (5e5, -3e3, 120.0)])
def test_the_compiled_loop_and_numpy_are_one_formula(monkeypatch, start):
    md, inclination, azimuth = crooked(1030)
    inclination[500:520], azimuth[500:520] = 0.3, 1.0  # straight intervals
    plain = minimum_curvature(md, inclination, azimuth, start=start)
    monkeypatch.setattr(path_module, "WORTH_LOADING", 0)
    compiled = minimum_curvature(md, inclination, azimuth, start=start)
    # sums of a thousand steps with and without their rounding; an angle to a few last bits
    np.testing.assert_allclose(positions(plain), positions(compiled), rtol=2e-15, atol=1e-11)
    np.testing.assert_allclose(plain.dogleg, compiled.dogleg, atol=4e-16)
    np.testing.assert_allclose(plain.severity, compiled.severity, rtol=1e-11, atol=1e-16)


def test_sines_of_the_loop_are_right_to_the_last_digit_also_where_they_nearly_vanish():
    from inclinometry.survey._kernels import sine_cosine

    x = np.concatenate([np.arange(-8.0, 9.0) * np.pi / 2.0, np.linspace(-13.0, 13.0, 400)])
    found = np.array([sine_cosine(one) for one in x])
    np.testing.assert_allclose(found, np.stack([np.sin(x), np.cos(x)], axis=1), rtol=5e-16)


def test_blocks_of_the_kernel_meet(monkeypatch):
    """The first stations do not know how many follow."""
    monkeypatch.setattr(path_module, "WORTH_LOADING", 0)
    md, inclination, azimuth = crooked(1030)
    whole = minimum_curvature(md, inclination, azimuth)
    for count in (2, 255, 256, 257, 258, 512, 513, 514, 1029):
        part = minimum_curvature(md[:count], inclination[:count], azimuth[:count])
        assert np.array_equal(positions(part), positions(whole)[:count])
        assert np.array_equal(part.severity, whole.severity[: count - 1])


def test_columns_of_a_table_and_its_caller_stay_apart():
    table = np.stack(crooked(), axis=-1)
    path = minimum_curvature(*table.T)
    again = minimum_curvature(*(np.ascontiguousarray(column) for column in table.T))
    assert np.array_equal(positions(path), positions(again))
    backwards = minimum_curvature(*(column[::-1] for column in table[::-1].copy().T))
    assert np.array_equal(positions(path), positions(backwards))
    table[:] = 0.0
    assert path.md[-1] > 0.0
    with pytest.raises(ValueError, match="read-only"):
        path.north[0] = 1.0
    assert len(path) == 200


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"md": [0.0, np.nan, 60.0]}, "input-finite"),
        ({"inclination": [0.0, 0.1, np.inf]}, "input-finite"),
        ({"azimuth": [np.nan, 0.1, 0.2]}, "input-finite"),
        ({"md": [0.0, 30.0, 30.0]}, "input-order"),
        ({"md": [0.0, 60.0, 30.0]}, "input-order"),
        ({"inclination": [0.0, -0.1, 0.2]}, "input-value"),
        ({"inclination": [0.0, 0.1, 3.2]}, "input-value"),
        ({"azimuth": [0.0, 90.0, 90.0]}, "input-value"),
        ({"inclination": [0.3, 0.5, np.pi - 0.5], "azimuth": [1.0, 1.0, 1.0 + np.pi]}, "survey-half-turn"),
        ({"inclination": [0.0, np.pi, np.pi]}, "survey-half-turn"),
        ({"inclination": [0.0, 0.1]}, "input-shape"),
        ({"start": [0.0, 0.0]}, "input-shape"),
        ({"start": [0.0, np.nan, 0.0]}, "input-finite"),
    ],
)
def test_what_is_refused(change, message):
    given_ = {"md": [0.0, 30.0, 60.0], "inclination": [0.0, 0.1, 0.2], "azimuth": [0.0, 0.0, 0.0], **change}
    columns = [given_.pop(name) for name in ("md", "inclination", "azimuth")]
    with refused(message):
        minimum_curvature(*columns, **given_)


@pytest.mark.parametrize("count", [0, 1])
def test_too_few_stations(count):
    with refused("input-few", name="stations"):
        minimum_curvature(*np.zeros((3, count)))


def test_severity_per_thirty_metres_and_per_hundred_feet():
    path = minimum_curvature([0.0, 10.0, 30.0], np.radians([1.0, 2.0, 2.0]), [0.0, 0.0, 0.0])
    np.testing.assert_allclose(dogleg_severity_deg(path), [0.0, 3.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(dogleg_severity_deg(path, 30.48), [0.0, 3.048, 0.0], atol=1e-12)
    with refused("input-value", name="length_m"):
        dogleg_severity_deg(path, 0.0)


def test_tortuosity_of_a_build_and_of_a_wave():
    md = np.linspace(0.0, 300.0, 11)
    build = tortuosity(minimum_curvature(md, np.linspace(0.1, 0.5, 11), np.full(11, 2.0)))
    np.testing.assert_allclose(build.cumulative, np.linspace(0.0, 0.4, 11), atol=1e-14)
    np.testing.assert_allclose(build.net, build.cumulative, atol=1e-14)
    np.testing.assert_allclose(build.rate[1:], 0.4 / 300.0, rtol=1e-12)
    assert (build.excess < 1e-14).all()
    wave = tortuosity(minimum_curvature(md, 0.3 + 0.01 * (np.arange(11) % 2), np.full(11, 2.0)))
    np.testing.assert_allclose([wave.net[-1], wave.excess[-1]], [0.0, 0.1], atol=1e-14)


def test_noise_of_the_angles_bends_a_straight_hole_as_much_as_the_docstring_says():
    """Two stations of sigma each: the dogleg is a Rayleigh variable of sigma sqrt(2), mean 1.2533 sqrt(2) sigma."""
    sigma, count = 1e-3, 20_000
    random = np.random.default_rng(7)
    slope = 1.0 + sigma * random.standard_normal(count)
    heading = 1.0 + sigma / np.sin(1.0) * random.standard_normal(count)
    found = tortuosity(minimum_curvature(30.0 * np.arange(count), slope, heading)).cumulative[-1]
    # a mean of 2e4 draws with a spread of half the mean
    assert found / count == pytest.approx(1.2533 * np.sqrt(2.0) * sigma, rel=0.015)


ANGLE = st.one_of(st.floats(0.0, np.pi), st.sampled_from([0.0, 1e-300, 1e-16, 1e-8, np.pi / 2, np.pi]))
TURN = st.floats(-4.0 * np.pi, 4.0 * np.pi)


@settings(max_examples=300, deadline=None)
@given(st.tuples(ANGLE, ANGLE), st.tuples(TURN, TURN), st.floats(1e-3, 1e4))
@example((0.0, 0.0), (0.0, 3.0), 1.0)
@example((np.pi, np.pi), (0.0, 3.0), 1.0)
@example((1.0, 1.0), (2.0, 2.0 - 2.0 * np.pi), 30.0)
@example((1e-300, 0.0), (0.0, 0.0), 30.0)
def test_two_stations_at_any_angle(inclination, azimuth, length):
    try:
        path = minimum_curvature([0.0, length], inclination, azimuth)
    except InputError as error:
        assert error.finding.code == "survey-half-turn"  # noqa: PT017
        return
    chord = np.linalg.norm(positions(path)[1])
    # a chord is the arc times sin(b/2)/(b/2); near half a turn the direction loses up to six digits, the length none
    assert chord == pytest.approx(length * np.sinc(path.dogleg[0] / (2.0 * np.pi)), rel=1e-9)
    assert 0.0 <= path.dogleg[0] <= np.pi


def test_memory_stays_within_its_columns():
    """Eight columns of the result and three or four of checks: nothing grows with a matrix of the stations."""
    md, inclination, azimuth = 0.01 * np.arange(200_000.0), np.full(200_000, 1.0), np.full(200_000, 2.0)
    minimum_curvature(md, inclination, azimuth)  # the kernel is loaded outside the measurement
    tracemalloc.start()
    minimum_curvature(md, inclination, azimuth)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 12 * md.nbytes
