"""The closed form of scale factor and north: its algebra, its two roots, where it fails, and its uncertainty."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.constants import EARTH_RATE
from inclinometry.gyro.closed_form import (
    azimuth_arctan2,
    expected_rates,
    high_side,
    patent_azimuth,
    printed_toolface,
    scale_condition,
    scale_roots,
    solve_fixed_arctan2,
    solve_patent,
)
from inclinometry.gyro.result import FLAGS
from inclinometry.orientation import fields
from inclinometry.rotations import dcm, wrap_signed

G = 9.81
SIGMA = 1e-3 * EARTH_RATE  # 0.015 deg/h
rad = np.radians


def readings(azimuth: Any, inclination: Any, toolface: Any, latitude: Any, scale: Any = 1.0) -> tuple[Any, Any]:
    """Gravity and gyro readings in tool axes, by rotation matrices: not by the formulas under test."""
    g, w = fields(azimuth, inclination, toolface, -np.asarray(latitude))
    return G * g, EARTH_RATE * w / np.asarray(scale)[..., None]


def grid(latitude_deg: float, top: float = 90.0) -> tuple[Any, Any, float]:
    inclination, azimuth = np.meshgrid(rad(np.arange(0.5, top)), rad(np.arange(0.5, 360.0)), indexing="ij")
    return inclination, azimuth, float(rad(latitude_deg))


def error_degrees(found: Any, true: Any) -> Any:
    return np.degrees(np.abs(wrap_signed(found - true)))


def test_rates_are_those_of_the_rotation_matrices() -> None:
    rng = np.random.default_rng(1)
    azimuth, inclination, toolface = rng.uniform(0.0, np.pi, (3, 100)) * np.array([[2.0], [1.0], [2.0]])
    _, w = readings(azimuth, inclination, toolface, rad(-37.0))
    a, b = high_side(w / EARTH_RATE, toolface)
    x, y, z = expected_rates(azimuth, inclination, rad(-37.0))
    np.testing.assert_allclose([a, b, w[:, 2] / EARTH_RATE], [x, y, z], atol=1e-15)


def test_k_is_the_east_part_of_tool_axis_times_earth_axis() -> None:
    inclination, azimuth, latitude = grid(50.0, 180.0)
    axis = dcm(azimuth, inclination, 0.0)[..., 2, :]  # the tool axis in north, east, down
    earth = np.array([np.cos(latitude), 0.0, -np.sin(latitude)])
    np.testing.assert_allclose(
        scale_condition(azimuth, inclination, latitude), np.cross(axis, earth)[..., 1], atol=1e-15
    )


@pytest.mark.parametrize(("latitude_deg", "share"), [(30.0, 1 / 3), (45.0, 1 / 2), (60.0, 2 / 3), (-60.0, 2 / 3)])
def test_two_roots_over_the_grid(latitude_deg: float, share: float) -> None:
    inclination, azimuth, latitude = grid(latitude_deg)
    x, y, _ = expected_rates(azimuth, inclination, latitude)
    roots, discriminant = scale_roots(x, y, inclination, latitude)
    k = scale_condition(azimuth, inclination, latitude)
    np.testing.assert_allclose(discriminant, (np.cos(latitude) * k) ** 2, atol=4e-16)
    # the true one is 1; its rounding grows as 1/K
    true = np.where(k > 0.0, roots[..., 0], roots[..., 1])
    assert (np.abs(true - 1.0) * np.abs(k)).max() < 2e-15
    d = x**2 + (y * np.cos(inclination)) ** 2
    np.testing.assert_allclose(
        roots.prod(-1) * d, -np.cos(latitude + inclination) * np.cos(latitude - inclination), atol=2e-15
    )
    # both positive exactly in the steep part of the grid, whatever the azimuth
    both = (roots > 0.0).all(-1)
    np.testing.assert_array_equal(both, inclination > np.pi / 2 - abs(latitude))
    assert both.mean() == pytest.approx(share, abs=1e-9)
    assert (k[~both] > 0.0).all()
    assert ((roots > 0.0).sum(-1)[~both] == 1).all()


def test_each_root_makes_the_horizontal_rate_what_it_is() -> None:
    """Turned back by toolface and inclination, the scaled rates have the Earth's vertical and horizontal parts."""
    inclination, azimuth, toolface, latitude = rad(75.0), rad(110.0), rad(33.0), rad(45.0)
    _, w = readings(azimuth, inclination, toolface, latitude, 1.02)
    a, b = high_side(w / EARTH_RATE, toolface)
    roots, _ = scale_roots(a, b, inclination, latitude)
    for s in roots:
        along = (s * a * np.sin(inclination) - np.sin(latitude)) / np.cos(inclination)
        levelled = dcm(0.0, inclination, toolface).T @ [*(s * w[:2] / EARTH_RATE), along]
        assert levelled[2] == pytest.approx(-np.sin(latitude), abs=1e-15)
        assert np.hypot(levelled[0], levelled[1]) == pytest.approx(np.cos(latitude), abs=1e-14)
    assert np.abs(roots - 1.02).min() < 1e-14


def test_small_root_keeps_its_digits() -> None:
    latitude, inclination = rad(45.0), rad(45.0) - 1e-9
    x, y, _ = expected_rates(rad(150.0), inclination, latitude)
    roots, _ = scale_roots(x, y, inclination, latitude)
    d = x**2 + (y * np.cos(inclination)) ** 2
    small = -np.cos(latitude + inclination) * np.cos(latitude - inclination) / d / roots[0]
    assert abs(small) < 1e-7
    assert roots[1] == pytest.approx(small, rel=1e-12)


def test_double_root_where_k_is_zero() -> None:
    latitude = rad(60.0)
    inclination = rad(np.linspace(31.0, 89.0, 59))
    azimuth = np.arccos(-1.0 / (np.tan(latitude) * np.tan(inclination)))
    gravity, rate = readings(azimuth, inclination, 0.3, latitude)
    found = solve_patent(gravity, rate, latitude, history=1.0)
    assert all(flags == ["double-root"] for flags in found.flags)
    assert np.isnan(found.azimuth).all()
    assert np.isnan(found.scale).all()
    # half of noisy draws have no real root there; 2000 draws: standard deviation 0.011
    noise = np.random.default_rng(2).standard_normal((2000, 2)) * SIGMA
    noisy = solve_patent(np.repeat(gravity[30:31], 2000, 0), rate[30, :2] + noise, latitude, history=1.0)
    assert np.mean([flags == ["complex"] for flags in noisy.flags]) == pytest.approx(0.5, abs=0.045)


@pytest.mark.parametrize("latitude_deg", [45.0, -20.0, 88.0])
def test_parallel_to_the_earth_axis_sees_nothing(latitude_deg: float) -> None:
    latitude = rad(latitude_deg)
    azimuth = np.pi if latitude > 0.0 else 0.0
    gravity, rate = readings(azimuth, np.pi / 2 - abs(latitude), 1.0, latitude)
    assert np.hypot(*rate[:2]) < 1e-15 * EARTH_RATE
    found = solve_patent([gravity], [rate], latitude, history=1.0)
    assert found.flags == [["parallel"]]
    assert np.isnan(found.azimuth[0])
    # with a scale factor given, zero rates are a direction all the same
    fixed = solve_fixed_arctan2([gravity], [rate], latitude)
    assert error_degrees(fixed.azimuth[0], azimuth) < 1e-12


@pytest.mark.parametrize("latitude_deg", [-70.0, -20.0, 0.0, 45.0, 60.0])
def test_azimuth_in_all_four_quadrants(latitude_deg: float) -> None:
    inclination, azimuth, latitude = grid(latitude_deg)
    gravity, w = readings(azimuth, inclination, 4.0, latitude)
    gx, gy, wx, wy = gravity[..., 0], gravity[..., 1], w[..., 0], w[..., 1]
    # rounding 1e-16 rad over sin th cos th cos a, 3e-3 at least
    assert error_degrees(patent_azimuth(gx, gy, wx, wy, G, latitude), azimuth).max() < 1e-9
    a, b = high_side(w / EARTH_RATE, 4.0)
    assert error_degrees(azimuth_arctan2(a, b, 1.0, inclination, latitude), azimuth).max() < 1e-10


def test_what_the_damaged_text_would_give() -> None:
    inclination, azimuth, latitude = grid(45.0)
    gravity, w = readings(azimuth, inclination, 2.0, latitude)
    gx, gy, wx, wy = gravity[..., 0], gravity[..., 1], w[..., 0], w[..., 1]
    level = gx**2 + gy**2
    sine = -(wx * gy - wy * gx) * np.sqrt(G**2 - level)
    cosine = -G * (wx * gx + wy * gy) - EARTH_RATE * np.sin(latitude) * level
    one_argument = error_degrees(np.arctan(sine / cosine), azimuth)
    # right or half a turn off, half of all azimuths each
    assert (np.minimum(one_argument, 180.0 - one_argument) < 1e-9).all()
    assert (one_argument > 179.0).mean() == pytest.approx(0.5, abs=1e-9)
    factor = np.arctan(
        2.0 * (-(wx * gy - wy * gx) * G**2 - level - G * (wx * gx + wy * gy) - EARTH_RATE * np.sin(latitude) * level)
    )
    assert np.median(error_degrees(factor, azimuth)) > 45.0


def test_wrong_signs_do_not_turn_the_azimuth_round() -> None:
    """Azimuth 1 rad, tan a tan th = 1/sqrt 3: the numbers of the specification."""
    azimuth, latitude = 1.0, rad(45.0)
    (gx, gy, _), (wx, wy, _) = readings(azimuth, rad(30.0), 0.7, latitude)
    degrees = lambda *args: float(np.degrees(wrap_signed(patent_azimuth(*args))))  # noqa: E731
    assert degrees(gx, gy, wx, wy, G, latitude) == pytest.approx(57.29578, abs=1e-5)
    specific_force = degrees(-gx, -gy, wx, wy, G, latitude)
    southern = degrees(gx, gy, wx, wy, G, -latitude)
    assert specific_force == pytest.approx(-153.6, abs=0.05)
    assert southern == pytest.approx(26.4, abs=0.05)
    assert southern - specific_force == pytest.approx(180.0, abs=1e-9)
    (gx, gy, _), (wx, wy, _) = readings(azimuth, rad(150.0), 0.7, latitude)
    assert degrees(gx, gy, wx, wy, G, latitude) == pytest.approx(180.0 - 57.29578, abs=1e-5)


def test_patent_azimuth_has_no_number_where_it_is_zero_over_zero() -> None:
    assert np.isnan(patent_azimuth(0.0, 0.0, 1e-5, 1e-5, G, 0.5))
    assert np.isnan(patent_azimuth(-G, 0.0, 1e-5, 1e-5, G, 0.5))


def test_printed_toolface_and_its_defects() -> None:
    toolface = rad(np.arange(-89.5, 270.0))
    gx, gy = -np.cos(toolface), np.sin(toolface)
    assert error_degrees(printed_toolface(gx, gy), toolface).max() < 1e-12
    assert np.degrees(printed_toolface([0.0, 0.0], [1.0, -1.0])).tolist() == [-90.0, 90.0]
    assert np.degrees(printed_toolface([-0.0, -0.0], [1.0, -1.0])).tolist() == [90.0, -90.0]
    assert np.isnan(printed_toolface(0.0, 0.0))


@given(
    st.floats(0.0, 2.0 * np.pi),
    st.floats(rad(0.01), rad(89.9)),
    st.floats(0.0, 2.0 * np.pi),
    st.floats(rad(-85.0), rad(85.0)),
    st.floats(0.9, 1.1),
)
@example(np.pi, rad(60.0), 0.0, rad(60.0), 1.0)
@example(np.pi, rad(20.0), 0.0, rad(-60.0), 1.05)
@example(1.0, rad(45.0), np.pi / 2, 0.0, 1.0)
def test_stations_come_back(azimuth: float, inclination: float, toolface: float, latitude: float, scale: float) -> None:
    k = float(scale_condition(azimuth, inclination, latitude))
    assume(abs(k) > 1e-3)
    gravity, rate = readings(azimuth, inclination, toolface, latitude, scale)
    for columns, g in ((3, None), (2, G)):
        found = solve_patent([gravity[:columns]], [rate[:columns]], latitude, g=g, history=scale)
        assert found.flags == [["down-assumed"] if columns == 2 else []]
        # rounding 1e-16 over cos a = 0.09, K = 1e-3 and, for the arcsine, cos th = 2e-3
        assert error_degrees(found.azimuth[0], azimuth) < 1e-7
        assert found.scale[0] == pytest.approx(scale, abs=1e-10)
        assert found.inclination[0] == pytest.approx(inclination, abs=1e-12)
        assert error_degrees(found.toolface[0], toolface) < 1e-9
        assert error_degrees(found.gyro_toolface[0], azimuth + toolface) < 1e-7
        assert found.k[0] == pytest.approx(k, abs=1e-9)
        assert found.root[0] == ("+" if k > 0.0 else "-")


def test_every_station_is_right_or_named() -> None:
    inclination, azimuth = (
        v.ravel() for v in np.meshgrid(rad(np.arange(0.0, 181.0, 5.0)), rad(np.arange(0.0, 360.0, 7.0)))
    )
    for latitude in rad(np.arange(-85.0, 86.0, 17.0)):
        gravity, rate = readings(azimuth, inclination, 0.5, latitude, 1.003)
        found = solve_patent(gravity, rate, latitude, history=1.003)
        named = np.array([len(flags) > 0 for flags in found.flags])
        assert set().union(*found.flags) <= set(FLAGS)
        np.testing.assert_array_equal(np.isnan(found.azimuth), named)
        assert error_degrees(found.azimuth, azimuth)[~named].max() < 1e-9
        up = np.array(["up-hole" in flags for flags in found.flags])
        np.testing.assert_array_equal(up, inclination > np.pi / 2 + 1e-9)


def test_vertical_keeps_scale_and_gyro_toolface() -> None:
    latitude = rad(52.0)
    gravity, rate = readings(0.0, 0.0, np.array([0.4, 3.0]), latitude, 0.99)
    for columns, g in ((3, None), (2, G)):
        cov = {"gravity_covariance": 1e-6 * np.eye(columns), "rate_covariance": SIGMA**2 * np.eye(2)}
        found = solve_patent(gravity[:, :columns], rate, latitude, g=g, **cov)
        assert all("vertical" in flags for flags in found.flags)
        assert np.isnan(found.azimuth).all()
        np.testing.assert_allclose(found.scale, 0.99, rtol=1e-14)
        np.testing.assert_allclose(found.gyro_toolface, [0.4, 3.0], rtol=1e-14)
        # level error of tan(latitude) and gyro noise over the horizontal rate; the readings are 1/0.99 of the truth
        gyro = 0.99e-3 / np.cos(latitude)
        expected = np.hypot(gyro, np.tan(latitude) * 1e-3 / G)
        np.testing.assert_allclose(found.u("gyro_toolface"), expected, rtol=1e-6)
        fixed = solve_fixed_arctan2(gravity[:, :columns], rate, latitude, scale=0.99, g=g, **cov)
        np.testing.assert_allclose(fixed.gyro_toolface, [0.4, 3.0], rtol=1e-14)
        np.testing.assert_allclose(fixed.u("gyro_toolface"), expected, rtol=1e-6)


def test_horizontal_and_up_hole_are_named() -> None:
    latitude = rad(30.0)
    gravity, rate = readings(1.0, rad([90.0, 100.0, 89.99]), 2.0, latitude)
    found = solve_patent(gravity, rate, latitude, history=1.0)
    assert list(found.flags) == [["horizontal"], ["up-hole"], []]
    np.testing.assert_allclose(found.inclination, rad([90.0, 100.0, 89.99]), rtol=1e-13)
    # 1 mrad of noise and down cannot be told from up
    noisy = solve_patent(gravity, rate, latitude, history=1.0, gravity_covariance=(1e-3 * G) ** 2 * np.eye(3))
    assert noisy.flags[2] == ["horizontal"]
    # two axes pressed beyond g by noise
    over = solve_patent([[-1.001 * G, 0.0]], rate[:1], latitude, g=G, history=1.0)
    assert over.flags == [["horizontal", "down-assumed"]]


def test_history_is_needed_and_passed_on() -> None:
    latitude, scale = rad(60.0), 1.0 + 0.002 * np.arange(6)
    azimuth = rad(np.array([150.0, 160.0, 170.0, 20.0, 190.0, 200.0]))
    inclination = rad(np.array([20.0, 60.0, 60.0, 60.0, 60.0, 60.0]))
    gravity, rate = readings(azimuth, inclination, 0.0, latitude, scale)
    found = solve_patent(gravity, rate, latitude)  # the first station has one positive root
    np.testing.assert_allclose(found.scale, scale, rtol=1e-12)
    assert "".join(found.root) == "+--+--"
    late = solve_patent(gravity[1:], rate[1:], latitude)
    assert all(flags == ["history"] for flags in late.flags)
    assert all(root == "" for root in late.root)
    given_one = solve_patent(gravity[1:], rate[1:], latitude, history=1.0)
    np.testing.assert_allclose(given_one.azimuth, azimuth[1:], rtol=1e-12)
    wrong = solve_patent(gravity[1:2], rate[1:2], latitude, history=3.0)
    assert wrong.root == ["+"]
    assert error_degrees(wrong.azimuth[0], azimuth[1]) > 1.0


def test_a_jump_of_scale_is_flagged_and_not_carried_on() -> None:
    latitude = rad(45.0)
    gravity, rate = readings(rad([30.0, 30.0, 30.0]), rad(20.0), 0.0, latitude, np.array([1.0, 1.1, 1.001]))
    found = solve_patent(gravity, rate, latitude, history=1.0, change_sd=0.002, rate_covariance=SIGMA**2 * np.eye(2))
    assert list(found.flags) == [[], ["scale"], []]
    assert np.isfinite(found.azimuth).all()


def test_no_positive_root_is_a_misfit() -> None:
    # rates of the northern hemisphere with the other sign: both roots negative
    gravity, rate = readings(1.0, rad(60.0), 0.0, rad(60.0))
    assert solve_patent([gravity], [-rate], rad(60.0), history=1.0).flags == [["misfit"]]


def test_azimuth_depends_only_on_the_direction_of_the_rate() -> None:
    gravity, rate = readings(2.0, rad(25.0), 1.0, rad(40.0))
    one, other = (solve_patent([gravity], [c * rate], rad(40.0)) for c in (1.0, 0.7))
    assert other.azimuth[0] == pytest.approx(one.azimuth[0], abs=1e-14)
    assert other.scale[0] == pytest.approx(one.scale[0] / 0.7, rel=1e-14)


def test_bad_input_is_refused() -> None:
    gravity, rate = readings(1.0, rad(30.0), 0.0, rad(45.0))
    with refused("input-value", name="latitude"):
        solve_patent([gravity], [rate], 45.0)
    with refused("input-needs"):
        solve_patent([gravity[:2]], [rate], rad(45.0))
    with refused("input-shape", name="gravity"):
        solve_patent([gravity], [rate, rate], rad(45.0))
    with refused("input-shape", name="rate"):
        solve_patent([gravity], rate, rad(45.0))
    with refused("input-finite", name="rate[0, 0]"):
        solve_patent([gravity], [[np.nan, 0.0]], rad(45.0))
    with refused("input-shape", name="rate_covariance"):
        solve_patent([gravity], [rate], rad(45.0), rate_covariance=np.eye(4))
    with refused("input-shape", name="rate_covariance"):
        solve_patent([gravity] * 2, [rate] * 2, rad(45.0), rate_covariance=np.zeros((1, 2, 2)))
    with refused("input-value", name="inclination"):
        scale_roots(0.1, 0.1, 2.0, 0.5)


# Uncertainty: printed sensitivities, derivatives through the solver, draws.

PLACES = [(30.0, 40.0, 45.0), (60.0, 135.0, 45.0), (75.0, 110.0, -30.0), (80.0, 300.0, 60.0), (85.0, 20.0, 45.0)]


@pytest.mark.parametrize(("inclination_deg", "azimuth_deg", "latitude_deg"), PLACES)
def test_sensitivities_of_the_specification(inclination_deg: float, azimuth_deg: float, latitude_deg: float) -> None:
    psi, th, lat, t = rad(azimuth_deg), rad(inclination_deg), rad(latitude_deg), rad(50.0)
    _, rate = readings(psi, th, t, lat)
    x, y, z = expected_rates(psi, th, lat)
    k = scale_condition(psi, th, lat)
    c, s, step = np.cos, np.sin, 1e-6

    def scale(a: Any, b: Any, th: Any = th) -> Any:
        return scale_roots(a, b, th, lat)[0][0 if k > 0.0 else 1]

    def azimuth(a: Any, b: Any) -> Any:
        return azimuth_arctan2(a, b, scale(a, b), th, lat)

    def slope(f: Any) -> float:
        return float(wrap_signed(f(step) - f(-step)) / (2.0 * step))

    # second order of a step of 1e-6: 1e-12/K^5; rounding 1e-16/1e-6/K
    near = {"rel": 1e-6, "abs": 1e-6}
    assert slope(lambda h: scale(x + h, y)) == pytest.approx(-c(psi) / k, **near)
    assert slope(lambda h: scale(x, y + h)) == pytest.approx(s(psi) * c(th) / k, **near)
    assert slope(lambda h: scale(x, y, th + h)) == pytest.approx(-c(psi) * z / k, **near)
    turned = slope(lambda h: scale(*high_side(rate / EARTH_RATE, t + h)))
    assert turned == pytest.approx(-s(psi) * s(th) * z / k, **near)
    assert slope(lambda h: azimuth(x + h, y)) == pytest.approx(y / (c(lat) * k), **near)
    assert slope(lambda h: azimuth(x, y + h)) == pytest.approx(-x / (c(lat) * k), **near)
    fixed = lambda a, b, scale: azimuth_arctan2(a, b, scale, th, lat)  # noqa: E731
    assert slope(lambda h: fixed(x + h, y, 1.0)) == pytest.approx(-s(psi) / (c(lat) * c(th)), **near)
    assert slope(lambda h: fixed(x, y + h, 1.0)) == pytest.approx(-c(psi) / c(lat), **near)
    assert slope(lambda h: fixed(x, y, 1.0 + h)) == pytest.approx(-np.tan(lat) * np.tan(th) * s(psi), **near)


def _variances(solve: Any, gravity: Any, rate: Any, cov_g: Any, cov_w: Any, columns: int) -> tuple[Any, Any]:
    """Variances of the four angles and of scale by central differences through the whole solver."""

    def angles(dg: Any, dw: Any) -> Any:
        found = solve(gravity + dg, rate + dw)
        return np.array([found.inclination, found.azimuth, found.toolface, found.gyro_toolface, found.scale])[:, 0]

    def derivative(unit: float, axes: int, place: int) -> Any:
        rows = []
        for axis in range(axes):
            step = np.zeros((2, axes))
            step[0, axis] = 1e-6 * unit
            args = [step[0], np.zeros(2)] if place == 0 else [np.zeros(columns), step[0]]
            rows.append(wrap_signed(angles(*args) - angles(*[-v for v in args])) / (2e-6 * unit))
        return np.array(rows).T

    by_g, by_w = derivative(G, columns, 0), derivative(EARTH_RATE, 2, 1)
    return np.diag(by_g @ cov_g @ by_g.T), np.diag(by_w @ cov_w @ by_w.T)


@pytest.mark.parametrize("columns", [2, 3])
@pytest.mark.parametrize("solver", [solve_patent, solve_fixed_arctan2])
@pytest.mark.parametrize(("inclination_deg", "azimuth_deg", "latitude_deg"), PLACES)
def test_variances_are_the_derivatives_of_the_solver(
    inclination_deg: float, azimuth_deg: float, latitude_deg: float, solver: Any, columns: int
) -> None:
    latitude, scale = rad(latitude_deg), 1.02
    gravity, rate = readings(rad(azimuth_deg), rad(inclination_deg), rad(50.0), latitude, scale)
    gravity, rate = gravity[:columns], rate[:2]
    mix = np.array([[1.0, 0.3, -0.2], [0.0, 0.8, 0.4], [0.0, 0.0, 1.2]])[:columns, :columns]
    cov_g, cov_w = 1e-8 * mix @ mix.T, SIGMA**2 * 1e-4 * np.array([[1.0, -0.4], [-0.4, 0.7]])
    known: dict[str, Any] = {"g": G, ("history" if solver is solve_patent else "scale"): scale}

    def solve(g: Any, w: Any, **more: Any) -> Any:
        return solver([g], [w], latitude, **known, **more)

    found = solve(gravity, rate, gravity_covariance=cov_g, rate_covariance=cov_w)
    by_g, by_w = _variances(solve, gravity, rate, cov_g, cov_w, columns)
    # third derivatives times 1e-12, next to cos th = 0.09 and K = 0.08: 1e-5 of the value
    np.testing.assert_allclose(found.components["accelerometer"][0], by_g[:4], rtol=1e-4)
    np.testing.assert_allclose(found.components["gyro"][0], by_w[:4], rtol=1e-4, atol=1e-24)
    if solver is solve_patent:
        assert found.u_scale[0] == pytest.approx(np.sqrt(by_g[4] + by_w[4]), rel=1e-4)


def test_a_given_scale_carries_its_uncertainty_into_the_azimuth() -> None:
    """One per cent of scale, east at 80 deg and latitude 45: tan a tan th sin psi ds."""
    gravity, rate = readings(rad(90.0), rad(80.0), rad(50.0), rad(45.0))
    found = solve_fixed_arctan2([gravity], [rate], rad(45.0), u_scale=0.01)
    expected = (0.01 * np.tan(rad(80.0))) ** 2
    np.testing.assert_allclose(found.components["scale"][0], [0.0, expected, 0.0, expected], rtol=1e-9)


@pytest.mark.long
@pytest.mark.parametrize(
    ("inclination_deg", "azimuth_deg", "u_azimuth_deg", "u_scale"),
    [(0.0, 0.0, 0.081, 0.00141), (60.0, 90.0, 0.21, 0.00141), (60.0, 135.0, 0.63, 0.0100)],
)
def test_example_numbers(inclination_deg: float, azimuth_deg: float, u_azimuth_deg: float, u_scale: float) -> None:
    """Latitude 45, 0.015 deg/h: printed figures, stated uncertainty, and 20000 draws agree."""
    count = 20_000
    azimuth = rad(azimuth_deg)
    gravity, rate = readings(azimuth, rad(np.full(count, inclination_deg)), 0.3, rad(45.0))
    noisy = rate[:, :2] + SIGMA * np.random.default_rng(3).standard_normal((count, 2))
    found = solve_patent(gravity, noisy, rad(45.0), rate_covariance=SIGMA**2 * np.eye(2), history=1.0)
    stated = np.degrees(np.median(found.u("gyro_toolface")))
    drawn = np.degrees(np.sqrt(np.mean(wrap_signed(found.gyro_toolface - azimuth - 0.3) ** 2)))
    assert stated == pytest.approx(u_azimuth_deg, abs=0.005)
    assert np.median(found.u_scale) == pytest.approx(u_scale, rel=0.01)
    # 20000 draws: 0.5 %; second order of 1 % noise in K: 1 %
    assert drawn == pytest.approx(stated, rel=0.02)
    assert np.std(found.scale) == pytest.approx(float(np.median(found.u_scale)), rel=0.02)


def test_printed_example_at_the_double_root() -> None:
    """Without a covariance nothing is refused but what has no root: half; the rest errs by 3.2 deg rms."""
    count, azimuth = 20_000, np.arccos(-1.0 / np.tan(rad(60.0)))
    gravity, rate = readings(azimuth, rad(np.full(count, 60.0)), 0.3, rad(45.0))
    noisy = rate[:, :2] + SIGMA * np.random.default_rng(4).standard_normal((count, 2))
    bare = solve_patent(gravity, noisy, rad(45.0), history=1.0)
    good = np.isfinite(bare.azimuth)
    assert good.mean() == pytest.approx(0.5, abs=0.015)
    assert np.sqrt(np.mean(error_degrees(bare.azimuth[good], azimuth) ** 2)) == pytest.approx(3.25, abs=0.1)
    # with one, nearly all are named
    told = solve_patent(gravity, noisy, rad(45.0), history=1.0, rate_covariance=SIGMA**2 * np.eye(2))
    assert np.isfinite(told.azimuth).mean() < 0.1


def test_stated_uncertainty_is_honest_away_from_the_singular_places() -> None:
    rng, latitude, count = np.random.default_rng(5), rad(50.0), 4000
    azimuth, toolface = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    inclination = rng.uniform(rad(10.0), rad(75.0), count)
    keep = np.abs(scale_condition(azimuth, inclination, latitude)) > 0.15
    azimuth, toolface, inclination = azimuth[keep], toolface[keep], inclination[keep]
    gravity, rate = readings(azimuth, inclination, toolface, latitude, 1.01)
    sd_g = 5e-4
    found = solve_patent(
        gravity + sd_g * rng.standard_normal(gravity.shape),
        rate + SIGMA * rng.standard_normal(rate.shape),
        latitude,
        gravity_covariance=sd_g**2 * np.eye(3),
        rate_covariance=SIGMA**2 * np.eye(3),
        history=1.01,
    )
    assert not any(found.flags)
    truth = {"inclination": inclination, "azimuth": azimuth, "toolface": toolface, "gyro_toolface": azimuth + toolface}
    for name, true in truth.items():
        ratio = wrap_signed(getattr(found, name) - true) / found.u(name)
        # about 3500 stations: 1.2 % standard deviation of the rms; four of them
        assert np.sqrt(np.mean(ratio**2)) == pytest.approx(1.0, abs=0.05), name
    assert np.sqrt(np.mean(((found.scale - 1.01) / found.u_scale) ** 2)) == pytest.approx(1.0, abs=0.05)
