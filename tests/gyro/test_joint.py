"""Azimuth and scale factor together, against a plain optimiser, the closed form's roots, symmetry and the bound."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares
from tests.refusals import refused

from inclinometry.constants import EARTH_RATE
from inclinometry.earth.rate import earth_rate
from inclinometry.gyro.closed_form import azimuth_arctan2, scale_roots
from inclinometry.gyro.joint import earth_in_tool, earth_slopes, posterior_sd, solve_joint
from inclinometry.rotations import dcm, wrap_signed

rad = np.radians
SIGMA = 1e-3  # 0.015 deg/h in units of the Earth rate


def isotropic(size: int, axes: int, sd: float = SIGMA) -> Any:
    return np.tile(sd**2 * np.eye(axes), (size, 1, 1))


def stations(seed: int, size: int, axes: int) -> Any:
    """Random readings with random covariances: rates, covariance, inclination, latitude, azimuth, scale."""
    rng = np.random.default_rng(seed)
    azimuth, inclination = rng.uniform(0.0, 2.0 * np.pi, size), rng.uniform(0.0, np.pi, size)
    latitude, scale = rng.uniform(-1.4, 1.4, size), rng.normal(1.0, 0.01, size)
    root = SIGMA * rng.normal(size=(size, axes, axes)) + 0.3 * SIGMA * np.eye(axes)
    noise = np.einsum("nij,nj->ni", root, rng.normal(size=(size, axes)))
    rates = earth_in_tool(azimuth, inclination, latitude)[:, :axes] / scale[:, None] + noise
    return rates, root @ np.swapaxes(root, 1, 2), inclination, latitude, azimuth, scale


def plain(h: Any, cov: Any, inclination: float, latitude: float, k0: float, sd: float) -> Any:
    """The same problem given to a general least-squares solver from eight starts: azimuth, k, cost, Jacobian."""
    white = np.linalg.inv(np.linalg.cholesky(cov))

    def residual(x: Any) -> Any:
        model = earth_in_tool(x[0], inclination, latitude)[: len(h)]
        return np.append(white @ (h - x[1] * model), (x[1] - k0) / sd)

    tries = [least_squares(residual, [start, k0], x_scale=[1.0, sd], xtol=1e-15) for start in np.arange(8) * np.pi / 4]
    return min((t for t in tries if t.x[1] > 0.0), key=lambda t: t.cost)


@pytest.mark.long
@pytest.mark.parametrize("axes", [2, 3])
def test_agrees_with_a_general_solver_from_many_starts(axes: int) -> None:
    rates, cov, inclination, latitude, *_ = stations(3, 25, axes)
    found = solve_joint(rates, cov, inclination, latitude, scale=1.002, scale_sd=0.01)
    sd_k = 0.01 / 1.002**2
    for n in range(len(rates)):
        best = plain(rates[n], cov[n], inclination[n], latitude[n], 1.0 / 1.002, sd_k)
        assert found.cost[n] <= 2.0 * best.cost + 1e-6  # never above what the general solver found
        if found.ambiguous[n] or found.weak[n]:
            continue
        bound = np.linalg.inv(best.jac.T @ best.jac)
        own = np.array([[found.var_azimuth[n], found.cov_azimuth_k[n]], [found.cov_azimuth_k[n], found.var_k[n]]])
        sd = np.sqrt(np.diagonal(bound))
        # the solver's numerical derivatives stop it at 1e-4 of a standard uncertainty and give J to 1e-6
        assert abs(wrap_signed(found.azimuth[n] - best.x[0])) < 1e-3 * sd[0]
        assert abs(found.k[n] - best.x[1]) < 1e-3 * sd[1]
        np.testing.assert_allclose(own / np.outer(sd, sd), bound / np.outer(sd, sd), atol=2e-3)


@pytest.mark.parametrize("axes", [2, 3])
@pytest.mark.parametrize("scale_sd", [0.0, 0.003, 0.3, np.inf])
def test_no_azimuth_of_a_dense_grid_fits_better_and_the_rival_is_its_second_valley(axes: int, scale_sd: float) -> None:
    rates, cov, inclination, latitude, *_ = stations(4, 200, axes)
    found = solve_joint(rates, cov, inclination, latitude, scale_sd=scale_sd)
    psi = np.arange(3600) * np.pi / 1800
    model = earth_in_tool(psi[:, None], inclination, latitude)[..., :axes]  # (3600, n, axes)
    weight = np.linalg.inv(cov)
    p = np.einsum("gni,nij,nj->gn", model, weight, rates)
    q = np.einsum("gni,nij,gnj->gn", model, weight, model)
    w = 0.0 if np.isinf(scale_sd) else np.inf if scale_sd == 0.0 else scale_sd**-2
    k = np.ones_like(p) if np.isinf(w) else np.maximum((p + w) / (q + w), 0.0)
    off = rates - k[..., None] * model
    cost = np.einsum("gni,nij,gnj->gn", off, weight, off) + (0.0 if np.isinf(w) else w * (k - 1.0) ** 2)
    # rounding of the grid's own sum: costs up to 1e8 with covariances of condition up to 1e6
    assert (found.cost <= cost.min(axis=0) + 1e-5 * (1.0 + found.cost)).all()
    valley = (cost < np.roll(cost, 1, axis=0)) & (cost <= np.roll(cost, -1, axis=0))
    far = np.abs(wrap_signed(psi[:, None] - found.azimuth)) > rad(1.0)
    second = np.where(valley & far, cost, np.inf).min(axis=0)
    two = np.isfinite(second)
    assert two.any()
    # the grid misses the bottom of a valley by up to 0.05 deg: it may lie above, never below
    assert (found.rival_cost[two] <= second[two] * (1.0 + 1e-6) + 1e-5).all()


def test_earth_rate_is_that_of_the_rotation_matrices_and_its_slopes_those_of_differences() -> None:
    rng = np.random.default_rng(5)
    at = rng.uniform(-1.5, 1.5, (3, 50)) + np.array([[2.0], [1.6], [0.0]])
    turned = np.einsum("nij,nj->ni", dcm(at[0], at[1], np.zeros(50)), earth_rate(at[2]))
    np.testing.assert_allclose(earth_in_tool(*at), turned / EARTH_RATE, atol=1e-15)
    for column in range(3):
        step = np.zeros((3, 1))
        step[column] = 1e-5
        slope = (earth_in_tool(*(at + step)) - earth_in_tool(*(at - step))) / 2e-5
        # central difference: 1e-10 / 6 from its third derivative, 1e-11 from rounding
        np.testing.assert_allclose(earth_slopes(*at)[..., column], slope, atol=1e-10)


def test_readings_and_their_scale_may_be_multiplied_together() -> None:
    rates, cov, inclination, latitude, *_ = stations(6, 300, 3)
    one = solve_joint(rates, cov, inclination, latitude, scale=1.01, scale_sd=0.003)
    two = solve_joint(2.0 * rates, 4.0 * cov, inclination, latitude, scale=0.505, scale_sd=0.0015)
    np.testing.assert_array_equal(two.azimuth, one.azimuth)  # powers of two: exact
    np.testing.assert_array_equal(two.k, 2.0 * one.k)
    np.testing.assert_array_equal(two.cost, one.cost)


@pytest.mark.parametrize("axes", [2, 3])
def test_mirrored_in_the_meridian_the_equator_and_the_horizon(axes: int) -> None:
    rates, cov, inclination, latitude, *_ = stations(7, 400, axes)
    one = solve_joint(rates, cov, inclination, latitude, scale_sd=0.01)
    sure = ~one.ambiguous & ~one.weak
    mirrors = {
        "east for west": ([1.0, -1.0, 1.0], inclination, latitude, -one.azimuth),
        "south for north": ([-1.0, 1.0, -1.0], inclination, -latitude, np.pi - one.azimuth),
        "up for down": ([1.0, 1.0, -1.0], np.pi - inclination, latitude, np.pi - one.azimuth),
    }
    for name, (signs, inc, lat, azimuth) in mirrors.items():
        sign = np.array(signs)[:axes]
        two = solve_joint(sign * rates, sign[:, None] * cov * sign, inc, lat, scale_sd=0.01)
        off = np.abs(wrap_signed(two.azimuth - azimuth))[sure]
        assert (off < 1e-7 * np.sqrt(one.var_azimuth[sure]) + 1e-12).all(), name
        np.testing.assert_allclose(two.k[sure], one.k[sure], rtol=1e-9, err_msg=name)
        np.testing.assert_allclose(two.var_azimuth[sure], one.var_azimuth[sure], rtol=1e-6, err_msg=name)


def test_a_scale_nearly_known_is_one_that_is_known() -> None:
    rates, cov, inclination, latitude, *_ = stations(8, 300, 2)
    exact = solve_joint(rates, cov, inclination, latitude, scale=1.003, scale_sd=0.0)
    nearly = solve_joint(rates, cov, inclination, latitude, scale=1.003, scale_sd=1e-9)
    sure = ~exact.ambiguous & ~exact.weak
    off = wrap_signed(exact.azimuth - nearly.azimuth)[sure]
    assert (np.abs(off) < 1e-3 * np.sqrt(exact.var_azimuth[sure])).all()
    np.testing.assert_allclose(nearly.var_azimuth[sure], exact.var_azimuth[sure], rtol=1e-3)
    assert (exact.var_k == 0.0).all()
    np.testing.assert_array_equal(exact.k, 1.0 / 1.003)


def test_a_scale_not_known_gives_the_roots_of_the_closed_form() -> None:
    rng = np.random.default_rng(9)
    size = 2000
    azimuth, inclination = rng.uniform(0.0, 2.0 * np.pi, size), rng.uniform(0.02, 1.5, size)
    latitude = rng.uniform(-1.2, 1.2, size)
    rates = earth_in_tool(azimuth, inclination, latitude)[:, :2] + 0.1 * SIGMA * rng.normal(size=(size, 2))
    roots, square = scale_roots(rates[:, 0], rates[:, 1], inclination, latitude)
    found = solve_joint(rates, isotropic(size, 2, 0.1 * SIGMA), inclination, latitude)
    away = square > 1e-3  # K = 0 is where the roots meet: their digits are halved there
    assert away.sum() > 1500
    directions = azimuth_arctan2(rates[:, :1], rates[:, 1:], roots, inclination[:, None], latitude[:, None])
    for n in np.flatnonzero(away):
        right = [r for r in range(2) if roots[n, r] > 0.0]
        best = min(right, key=lambda r, n=n: abs(wrap_signed(directions[n, r] - found.azimuth[n])))
        # both are exact; rounding is lifted by 1/K^2 at most
        assert abs(wrap_signed(directions[n, best] - found.azimuth[n])) < 1e-9
        assert abs(roots[n, best] * found.k[n] - 1.0) < 1e-9
        if len(right) == 2:
            assert found.ambiguous[n]
            assert abs(wrap_signed(directions[n, 1 - best] - found.rival[n])) < 1e-6


@pytest.mark.parametrize(
    ("inclination", "azimuth"), [(30, 90), (45, 135), (60, 45), (75, 110), (85, 45), (89, 135), (120, 20), (0, 0)]
)
@pytest.mark.parametrize("axes", [2, 3])
def test_at_the_cramer_rao_bound_and_honest(inclination: float, azimuth: float, axes: int) -> None:
    draws, rng = 8000, np.random.default_rng(11)
    inc, psi, lat = rad(inclination), rad(azimuth), rad(45.0)
    model, slope = earth_in_tool(psi, inc, lat)[:axes], earth_slopes(psi, inc, lat)[:axes, 0]
    k = rng.normal(1.0, 0.003, draws)
    rates = k[:, None] * model + SIGMA * rng.normal(size=(draws, axes))
    found = solve_joint(rates, isotropic(draws, axes), inc, lat, scale_sd=0.003)
    design = np.append(np.stack([slope, model], axis=1) / SIGMA, [[0.0, 1.0 / 0.003]], axis=0)
    bound = np.linalg.inv(design.T @ design)
    off = np.stack([wrap_signed(found.azimuth - psi), found.k - k], axis=1)
    # 8000 draws: the rms is known to 0.8 %; the second-order terms of the model add up to 3 % at K near 0
    np.testing.assert_allclose(np.sqrt(np.mean(off**2, axis=0) / np.diagonal(bound)), 1.0, atol=0.05)
    own = np.moveaxis(np.array([[found.var_azimuth, found.cov_azimuth_k], [found.cov_azimuth_k, found.var_k]]), 2, 0)
    squared = np.einsum("ni,nij,nj->n", off, np.linalg.inv(own), off) / 2.0
    assert abs(np.mean(squared) - 1.0) < 0.06  # 2.6 sigma of 8000 x 2 is 0.03; curvature as above


@pytest.mark.long
@pytest.mark.parametrize("sigma", [SIGMA, 0.2])
def test_uncertainty_of_a_posterior_with_any_shape_is_its_integral_over_azimuth_and_scale(sigma: float) -> None:
    inc, lat = rad([90.0, 89.5, 70.0, 60.0]), np.full(4, rad(45.0))
    sd = np.array([0.003, 0.003, 0.01, 0.02]) if sigma == SIGMA else np.full(4, 0.15)
    truth = rad([90.0, 95.0, 110.0, 125.264])
    rates = earth_in_tool(truth, inc, lat)[:, :2] + [3e-4, -2e-4]
    own = posterior_sd(rates, isotropic(4, 2, sigma), inc, lat, np.ones(4), sd, truth)
    psi = np.arange(2400) * 2.0 * np.pi / 2400
    for n in range(4):
        k = 1.0 + sd[n] * np.linspace(-6.0, 6.0, 1201)
        model = earth_in_tool(psi, inc[n], lat[n])[:, None, :2]
        cost = np.sum((rates[n] - k[:, None] * model) ** 2, axis=-1) / sigma**2 + ((k - 1.0) / sd[n]) ** 2
        density = np.exp(-0.5 * (cost - cost.min())).sum(axis=1)
        spread = np.sqrt(density @ wrap_signed(psi - truth[n]) ** 2 / density.sum())
        # smooth peaks wider than either grid; half a turn away the grids differ by one point
        np.testing.assert_allclose(own[n], spread, rtol=2e-3)


def test_the_horizontal_east_west_tool_is_weak_and_its_neighbour_a_degree_off_is_not() -> None:
    psi = rad([90.0, 270.0, 45.0, 90.0])
    inc = rad([90.0, 90.0, 60.0, 30.0])
    found = solve_joint(earth_in_tool(psi, inc, rad(45.0))[:, :2], isotropic(4, 2), inc, rad(45.0), scale_sd=0.003)
    assert found.weak.tolist() == [True, True, False, False]


def test_one_station_is_the_same_alone_and_in_a_batch_and_z_that_is_nan_is_no_z() -> None:
    rates, cov, inclination, latitude, *_ = stations(12, 20, 3)
    rates[:, 2] = np.nan
    wide = solve_joint(rates, cov, inclination, latitude, scale_sd=0.01)
    narrow = solve_joint(rates[:, :2], cov[:, :2, :2], inclination, latitude, scale_sd=0.01)
    for one, two in zip(wide, narrow, strict=True):
        np.testing.assert_array_equal(one, two)
    one_matrix = solve_joint(rates[:, :2], 1e-6 * np.eye(2), inclination, latitude)
    np.testing.assert_array_equal(
        one_matrix.azimuth, solve_joint(rates[:, :2], isotropic(20, 2), inclination, latitude).azimuth
    )
    alone = solve_joint(rates[3:4], cov[3:4], inclination[3], latitude[3], scale_sd=0.01)
    assert alone.azimuth[0] == wide.azimuth[3]


angle = st.floats(0.0, 2.0 * np.pi)


@settings(max_examples=150, deadline=None)
@given(
    angle,
    st.floats(0.0, np.pi),
    st.floats(-np.pi / 2, np.pi / 2),
    st.floats(1e-7, 1.0),
    st.sampled_from([0.0, 1e-6, 0.003, 1.0, np.inf]),
    st.sampled_from([2, 3]),
)
@example(0.0, 0.0, np.pi / 2, 1e-3, 0.003, 2)  # pole: nothing depends on azimuth
@example(np.pi, np.pi / 4, np.pi / 4, 1e-3, 0.003, 2)  # parallel to the Earth's axis: nothing is measured
@example(0.0, np.pi / 2, 0.0, 1e-3, np.inf, 2)  # the same at the equator
@example(np.pi / 2, np.pi / 2, np.pi / 4, 1e-3, np.inf, 2)
def test_never_nan_and_the_truth_never_fits_better(
    psi: float, inc: float, lat: float, sigma: float, scale_sd: float, axes: int
) -> None:
    rates = earth_in_tool(psi, inc, lat)[None, :axes]
    found = solve_joint(rates, isotropic(1, axes, sigma), inc, lat, scale_sd=scale_sd)
    for name in ("azimuth", "k", "var_azimuth", "cov_azimuth_k", "var_k", "cost"):
        assert np.isfinite(getattr(found, name)).all(), name
    assert 0.0 <= found.azimuth[0] < 2.0 * np.pi
    assert found.k[0] >= 0.0
    assert found.var_azimuth[0] > 0.0
    assert found.cost[0] < 1e-9 / sigma  # the truth has cost 0


GOOD: dict[str, Any] = {
    "rates": [[0.6, -0.7]], "covariance": [1e-6 * np.eye(2)], "inclination": 1.0, "latitude": 0.8,
    "scale": 1.0, "scale_sd": 0.003,
}  # fmt: skip


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"rates": [[np.nan, 1.0]]}, "input-value"),
        ({"rates": [[np.inf, 1.0]]}, "input-value"),
        ({"rates": [0.6, -0.7]}, "input-shape"),
        ({"rates": [[0.6]]}, "input-shape"),
        ({"rates": "fast"}, "input-kind"),
        ({"rates": [[0.6, -0.7, np.inf]], "covariance": [np.eye(3)]}, "input-value"),
        ({"covariance": [np.eye(4)]}, "input-shape"),
        ({"covariance": [np.eye(2)] * 2}, "input-shape"),
        ({"covariance": [[[1.0, 0.9], [0.0, 1.0]]]}, "input-covariance"),
        ({"rates": [[0.6, -0.7, 0.1]], "covariance": [np.eye(2)]}, "input-shape"),
        ({"covariance": [np.zeros((2, 2))]}, "input-covariance"),
        ({"covariance": [np.diag([1.0, -1.0])]}, "input-covariance"),
        ({"covariance": [np.full((2, 2), np.nan)]}, "input-covariance"),
        ({"covariance": [np.diag([np.inf, 1.0])]}, "input-covariance"),
        ({"rates": [[0.6, -0.7, 0.1]], "covariance": [np.diag([1.0, 1.0, 0.0])]}, "input-covariance"),
        ({"rates": [[0.6, -0.7, 0.1]], "covariance": [np.full((3, 3), np.nan)]}, "input-covariance"),
        ({"inclination": 4.0}, "input-value"),
        ({"inclination": -0.1}, "input-value"),
        ({"inclination": np.nan}, "input-value"),
        ({"inclination": [1.0, 2.0]}, "input-shape"),
        ({"latitude": rad(95.0)}, "input-value"),
        ({"latitude": [[0.8, 0.8]]}, "input-shape"),
        ({"scale": 0.0}, "input-value"),
        ({"scale": -1.0}, "input-value"),
        ({"scale": np.nan}, "input-value"),
        ({"scale": [1.0, 1.0]}, "input-shape"),
        ({"scale_sd": -0.1}, "input-value"),
        ({"scale_sd": np.nan}, "input-value"),
        ({"scale_sd": [0.1, 0.1]}, "input-shape"),
        ({"scale_sd": "little"}, "input-kind"),
    ],
    ids=lambda v: "-".join(f"{k}" for k in v) if isinstance(v, dict) else v,
)
def test_wrong_input_is_refused_with_its_value(wrong: dict[str, Any], says: str) -> None:
    use = {**GOOD, **wrong}
    with refused(says):
        solve_joint(use.pop("rates"), use.pop("covariance"), use.pop("inclination"), use.pop("latitude"), **use)


@pytest.mark.parametrize("scale_sd", [0.0, 0.003, 1e200, np.inf])
@pytest.mark.parametrize("rates", [[[0.0, 0.0]], [[1e6, -1e6]], [[1e-300, 0.0]]])
def test_readings_of_nothing_or_of_anything_are_answered_without_a_warning(rates: Any, scale_sd: float) -> None:
    found = solve_joint(rates, GOOD["covariance"], 1.0, 0.8, scale_sd=scale_sd)
    assert np.isfinite(found.azimuth).all()
    assert np.isfinite(found.k).all()
    assert not np.isnan(found.cost).any()


@pytest.mark.parametrize("axes", [2, 3])
def test_without_a_compiler_the_loop_is_the_same(axes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    from inclinometry.gyro import _kernels

    given = stations(8, 6, axes)[:4]
    quick = solve_joint(*given, scale_sd=0.01)
    monkeypatch.setattr(_kernels, "north", getattr(_kernels.north, "py_func", _kernels.north))
    for one, two in zip(quick, solve_joint(*given, scale_sd=0.01), strict=True):
        np.testing.assert_allclose(one, two, rtol=1e-6, atol=1e-9)


def test_no_stations_are_no_error() -> None:
    assert solve_joint(np.zeros((0, 2)), np.zeros((0, 2, 2)), 1.0, 0.8).azimuth.size == 0
