"""The point-mass filter against Gaussian algebra and against scale factors that move in ways it was not told."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from inclinometry.constants import EARTH_RATE, STANDARD_GRAVITY
from inclinometry.gyro.closed_form import CHANGE, solve_patent
from inclinometry.gyro.joint import earth_in_tool, solve_joint
from inclinometry.gyro.north import estimate_north
from inclinometry.gyro.point_mass import Bank, Grid, Members, Rates, ScaleLaw, smoothed, solve_law, stated_law
from inclinometry.gyro.tracking import quadratic_belief, smooth_scale, track_scale
from inclinometry.rotations import wrap_signed

rad = np.radians
DEG_H = rad(1.0) / 3600.0 / EARTH_RATE
LAWS = {
    "constant": lambda n, rng: np.ones(n.size),
    "slow": lambda n, rng: np.linspace(0.97, 1.03, n.size),
    "random walk": lambda n, rng: 1.0 + np.cumsum(0.002 * rng.normal(size=n.size)),
    "sin(n/6)": lambda n, rng: 1.0 + 0.03 * np.sin(n / 6.0),
    "sin(n/3)": lambda n, rng: 1.0 + 0.03 * np.sin(n / 3.0),
    "steps": lambda n, rng: 1.0 + 0.03 * (-1.0) ** (n // 10),
}


class Moving:
    """Stations in any direction whose scale factor moves by a law."""

    def __init__(
        self, seed: int, law: str, latitude: float = 43.8, noise: float = 0.015, inclination: Any = (5.0, 60.0),
        size: int = 60, gyros: int = 2,
    ) -> None:  # fmt: skip
        rng = np.random.default_rng([seed, list(LAWS).index(law)])
        self.scale, self.sigma, self.latitude = LAWS[law](np.arange(size), rng), noise * DEG_H, rad(latitude)
        self.azimuth, self.inclination = rng.uniform(0.0, 2.0 * np.pi, size), rad(rng.uniform(*inclination, size))
        self.rates = np.full((size, 3), np.nan)
        clean = earth_in_tool(self.azimuth, self.inclination, self.latitude)[:, :gyros] / self.scale[:, None]
        self.rates[:, :gyros] = clean + self.sigma * rng.normal(size=clean.shape)
        self.covariance = np.full((size, 3, 3), np.nan)
        self.covariance[:, :gyros, :gyros] = self.sigma**2 * np.eye(gyros)

    @property
    def given(self) -> tuple[Any, ...]:
        return self.rates, self.covariance, self.inclination, self.latitude

    def off(self, law: ScaleLaw) -> tuple[Any, Any]:
        """Errors of azimuth and their standard uncertainties."""
        found = solve_law(Rates(*self.given), law)
        return wrap_signed(found.found.azimuth - self.azimuth), found.azimuth_sd

    def patent(self) -> Any:
        si, ci = np.sin(self.inclination), np.cos(self.inclination)
        gravity = STANDARD_GRAVITY * np.stack([-si, 0.0 * si, ci], axis=1)
        known = {"history": 1.0, "history_sd": 0.003, "change_sd": CHANGE}
        noise = (EARTH_RATE * self.sigma) ** 2 * np.eye(2)
        found = solve_patent(gravity, EARTH_RATE * self.rates[:, :2], self.latitude, rate_covariance=noise, **known)
        return wrap_signed(found.azimuth - self.azimuth)


def rms(values: Any) -> float:
    return float(np.sqrt(np.nanmean(np.square(values))))


@pytest.mark.parametrize("step", [3e-5, 2e-4, 3e-3])
def test_a_step_is_a_density_of_its_variance_at_any_distance_of_the_nodes(step: float) -> None:
    grid = Grid.over(0.95, 1.05, 2.5e-4)
    bank = Bank(Members(*np.array([[step], [0.0], [0.0]]), np.zeros((1, 0)), np.ones(1)), grid, np.array([[1.0, 0.0]]))
    point = np.zeros((1, len(grid.nodes)))
    point[0, len(grid.nodes) // 2] = 1.0
    moved, off = bank.walked(point)[0], grid.nodes - 1.0
    assert moved.min() > 0.0
    assert moved.sum() == pytest.approx(1.0, abs=1e-10)
    assert moved @ off == pytest.approx(0.0, abs=1e-10)
    assert moved @ off**2 == pytest.approx(step**2, rel=1e-3)


def test_a_walk_of_known_size_is_the_gaussian_conditioned_on_all_other_stations() -> None:
    """Vertical holes: the rates say the scale factor to sigma / cos(latitude), and nothing is bent."""
    size, sigma, step, sd = 12, 1e-3, 1.5e-3, 3e-3
    rng = np.random.default_rng(1)
    value = 1.0 + np.cumsum(step * rng.normal(size=size)) + sigma * rng.normal(size=size)
    grid = Grid.over(0.95, 1.05, 2e-4)
    likelihood = np.exp(-0.5 * ((grid.nodes - value[:, None]) / sigma) ** 2)
    members = Members(*np.array([[step], [0.0], [0.0]]), np.zeros((1, 0)), np.ones(1))
    found = smoothed(members, grid, np.array([[1.0, sd]]), likelihood, np.zeros((size, 0)))
    place = np.arange(size)
    prior = sd**2 + step**2 * np.minimum.outer(place, place)
    gain = np.linalg.solve(prior + sigma**2 * np.eye(size), prior).T
    left = prior - gain @ prior
    # the statement may not hold, with 5 per cent and 3 per cent wide: of that 0.1 sd is left after twelve stations
    np.testing.assert_allclose(found.mean, 1.0 + gain @ (value - 1.0), atol=1e-4)
    np.testing.assert_allclose(found.variance, np.diagonal(left) + 0.25 * grid.step**2, rtol=0.05)
    np.testing.assert_allclose(found.tie, np.diagonal(left, 1), rtol=0.08)
    factor = found.factor()
    np.testing.assert_allclose(factor @ factor.T, left, atol=0.08 * left.max())
    for n in range(size):
        rest = np.delete(place, n)
        by = np.linalg.solve(prior[np.ix_(rest, rest)] + sigma**2 * np.eye(size - 1), prior[rest, n])
        mean, spread = ScaleLaw(((grid, found.expected[n]),)).moments()
        assert mean[0] == pytest.approx(1.0 + by @ (value[rest] - 1.0), abs=2e-4)
        assert spread[0] ** 2 == pytest.approx(prior[n, n] - by @ prior[rest, n], rel=0.12)


@pytest.mark.parametrize("law", LAWS)
def test_a_scale_factor_that_moves_is_followed_and_u_holds(law: str) -> None:
    run = Moving(2, law)
    error, sd = run.off(smooth_scale(*run.given, None, quadratic_belief(sd=0.003)).law)
    # sixty deviates: one standard uncertainty of z is 0.09
    assert rms(error / sd) < 1.3
    assert rms(error) <= rms(run.patent())


@pytest.mark.long
@pytest.mark.parametrize("law", LAWS)
def test_several_runs_of_each_law(law: str) -> None:
    off: dict[str, list[Any]] = {}
    for seed in range(4):
        run = Moving(seed, law)
        for name, follow in (("whole", smooth_scale), ("online", track_scale)):
            off.setdefault(name, []).append(run.off(follow(*run.given, None, quadratic_belief(sd=0.003)).law))
        known = solve_joint(*run.given, scale=run.scale, scale_sd=0.0)
        off.setdefault("known", []).append((wrap_signed(known.azimuth - run.azimuth), np.sqrt(known.var_azimuth)))
        off.setdefault("patent", []).append((run.patent(), np.ones(60)))
    errors = {name: np.concatenate([e for e, _ in each]) for name, each in off.items()}
    for name in ("whole", "online"):
        assert 0.85 < rms(errors[name] / np.concatenate([u for _, u in off[name]])) < 1.15, name
        assert rms(errors[name]) <= rms(errors["patent"])
    assert rms(errors["whole"]) < 1.25 * rms(errors["known"])


@pytest.mark.long
def test_all_latitudes_and_noises_are_honest() -> None:
    z = []
    for law in LAWS:
        for latitude in (0.0, 43.8, 75.0):
            for noise in (0.0045, 0.015, 0.05):
                run = Moving(7, law, latitude, noise, (2.0, 178.0))
                error, sd = run.off(smooth_scale(*run.given, None, quadratic_belief(sd=0.003)).law)
                z.append(error / sd)
    every = np.concatenate(z)
    assert rms(every) == pytest.approx(1.0, abs=0.15)
    assert 0.93 < np.mean(np.abs(every) < 1.96) < 0.97
    assert np.abs(every).max() < 5.0


@pytest.mark.parametrize("follow", [track_scale, smooth_scale])
def test_a_thermometer_that_stands_still_is_none(follow: Any) -> None:
    run, belief = Moving(3, "sin(n/3)", size=12), quadratic_belief(sd=0.003, reference_temperature=37.0)
    none, still = (follow(*run.given, heat, belief) for heat in (None, np.full(12, 37.0)))
    for name in ("expected", "expected_sd", "scale", "scale_sd", "shared"):
        np.testing.assert_array_equal(getattr(still, name), getattr(none, name))
    np.testing.assert_array_equal(run.off(still.law), run.off(none.law))


@pytest.mark.parametrize("scale", [0.8, 1.0, 1.05])
def test_without_noise_azimuths_are_exact(scale: float) -> None:
    run = Moving(4, "constant", noise=1e-9, size=12)
    run.rates = run.rates / scale
    error, _ = run.off(smooth_scale(*run.given, None, quadratic_belief(sd=0.003)).law)
    assert np.degrees(np.abs(error)).max() < 1e-5


def test_where_k_is_zero_u_grows_by_itself() -> None:
    run = Moving(5, "sin(n/3)")
    # inclination 75, where K is zero
    run.inclination[30] = rad(75.0)
    run.azimuth[30] = np.arccos(-1.0 / (np.tan(run.latitude) * np.tan(run.inclination[30])))
    there = earth_in_tool(run.azimuth[30], run.inclination[30], run.latitude)[:2] / run.scale[30]
    run.rates[30, :2] = there + run.sigma * np.array([0.5, -0.5])
    error, sd = run.off(smooth_scale(*run.given, None, quadratic_belief(sd=0.003)).law)
    assert sd[30] > 3.0 * np.median(sd)
    assert abs(error[30]) < 3.0 * sd[30]


def test_three_gyros_see_the_scale_factor_themselves() -> None:
    run = Moving(6, "sin(n/3)", gyros=3)
    error, sd = run.off(smooth_scale(*run.given, None, quadratic_belief(sd=0.003)).law)
    alone, _ = run.off(stated_law(np.ones(60), np.full(60, 0.03)))
    assert rms(error / sd) < 1.3
    assert rms(error) < 1.02 * rms(alone)


def test_components_of_the_stations_add_up_to_the_spread_of_the_density() -> None:
    run = Moving(8, "sin(n/6)", size=20)
    law = smooth_scale(*run.given, None, quadratic_belief(sd=0.003)).law
    si, ci = np.sin(run.inclination), np.cos(run.inclination)
    north = estimate_north(
        STANDARD_GRAVITY * np.stack([-si, 0.0 * si, ci], axis=1), EARTH_RATE * run.rates, run.latitude,
        gravity_covariance=1e-12 * np.eye(3), rate_covariance=EARTH_RATE**2 * run.covariance, scale=law,
    )  # fmt: skip
    error, sd = run.off(law)
    np.testing.assert_allclose(wrap_signed(north.azimuth - run.azimuth), error, atol=1e-12)
    np.testing.assert_allclose(north.u("azimuth"), sd, rtol=0.02)
    assert {"gyro", "scale", "shape"} <= set(north.components)
    assert set(north.response) == {"gravity", "rate", "prior", "latitude"}
