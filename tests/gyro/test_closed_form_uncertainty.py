"""Uncertainty of the closed form: printed sensitivities, derivatives through the solver, draws."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from inclinometry.constants import EARTH_RATE
from inclinometry.gyro.closed_form import (
    azimuth_arctan2,
    expected_rates,
    high_side,
    scale_condition,
    scale_roots,
    solve_fixed_arctan2,
    solve_patent,
)
from inclinometry.orientation import fields
from inclinometry.rotations import wrap_signed

G = 9.81
SIGMA = 1e-3 * EARTH_RATE  # 0.015 deg/h
rad = np.radians


def readings(azimuth: Any, inclination: Any, toolface: Any, latitude: Any, scale: Any = 1.0) -> tuple[Any, Any]:
    """Gravity and gyro readings in tool axes, by rotation matrices: not by the formulas under test."""
    g, w = fields(azimuth, inclination, toolface, -np.asarray(latitude))
    return G * g, EARTH_RATE * w / np.asarray(scale)[..., None]


def error_degrees(found: Any, true: Any) -> Any:
    return np.degrees(np.abs(wrap_signed(found - true)))


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
