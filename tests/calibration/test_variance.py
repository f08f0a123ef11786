"""Variance components: the maximum of the dense restricted likelihood, right on average, zero where nothing is."""

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.optimize import minimize
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.calibration.initial_values import starting_state
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.likelihood import Model
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.structured import with_repeating
from inclinometry.calibration.variance import (
    _Restricted,
    average_over_variances,
    estimate_components,
    expected_variances,
    fit,
    fit_with_caution,
    fit_with_variances,
    fitted_without,
    noise_guess,
    repeating_evidence,
    rig_guess,
    with_averaged_covariance,
)
from inclinometry.simulate.bench import Rig
from inclinometry.simulate.tool import random_tool

BOTH = ("accelerometer", "magnetometer")
DOWN = np.array([0.0, 0.0, 1.0])


def fitted_model(readings, noise, rig_sd):
    settings = np.stack(readings.dials, axis=1)
    sd = np.concatenate([np.full(v.shape, noise[k]) for k, v in readings.channels.items()], axis=1)
    model = Model(readings.channels, settings, np.ones((len(settings), 1)), sd, np.full(3, rig_sd), np.zeros(4), {})
    return fit(model, starting_state(model))


@pytest.mark.parametrize("plan", [plans.twelve(), plans.orthogonal()], ids=lambda p: p.name)
def test_factors_maximise_the_dense_restricted_likelihood(bench, plan):
    tool = random_tool(1)
    readings, _ = bench(plan, tool, Rig(setting_sd=np.radians(0.1)), bits=12, seed=3)
    here = fitted_model(readings, {"accelerometer": 0.8, "magnetometer": 0.5}, np.radians(0.2))
    found = estimate_components(here.model, here.at, here.state, {*BOTH}, True)

    width = here.at.jacobian.shape[2]
    jacobian = here.at.jacobian.reshape(-1, width)
    jacobian = jacobian / np.abs(jacobian).max(axis=0)
    spread = here.at.by_setting * here.model.rig_sd
    residual = (here.at.residual - (here.at.by_setting @ here.state.errors[..., None])[..., 0]).ravel()
    accelerometer = np.tile([1.0, 1.0, 1.0, 0.0, 0.0, 0.0], len(plan))
    noise = here.model.noise_sd.ravel() ** 2
    parts = [np.diag(noise * accelerometer), np.diag(noise * (1 - accelerometer))]
    for dial in range(3):
        own = spread[..., dial : dial + 1]
        parts.append(block_diag(*(own @ own.swapaxes(1, 2))))

    def twice_negative_log_likelihood(log_factors):
        v = sum(f * part for f, part in zip(np.exp(log_factors), parts, strict=True))
        inverse = np.linalg.inv(v)
        normal = jacobian.T @ inverse @ jacobian
        left = inverse @ residual
        left -= inverse @ jacobian @ np.linalg.solve(normal, jacobian.T @ left)
        apart = log_factors[2:] - np.mean(log_factors[2:])  # the dials, taken to be alike within a factor e^2
        prior = np.sum((apart / 2.0) ** 2)
        return np.linalg.slogdet(v)[1] + np.linalg.slogdet(normal)[1] + residual @ left + prior

    best = minimize(
        twice_negative_log_likelihood,
        np.zeros(5),
        method="Nelder-Mead",
        options={"xatol": 1e-6, "fatol": 1e-9, "maxiter": 4000, "maxfev": 4000, "adaptive": True},
    )
    # the scoring stops when the likelihood changes by less than 1e-6, i.e. within 0.1 % of a standard deviation
    np.testing.assert_allclose([*found.noise.values(), *found.rig], np.exp(best.x), rtol=5e-3)
    at_found = np.log([*found.noise.values(), *found.rig])
    assert twice_negative_log_likelihood(at_found) <= best.fun + 1e-4  # a hundredth of a standard deviation

    # the stated uncertainty against the curvature of the likelihood: expected against observed information
    h = 1e-3
    for place in range(5):
        step = h * np.eye(5)[place]
        ends = twice_negative_log_likelihood(best.x + step) + twice_negative_log_likelihood(best.x - step)
        observed = (ends - 2 * best.fun) / h**2 / 2
        assert found.relative_sd[place] == pytest.approx(1.0 / np.sqrt(observed), rel=0.4)


@pytest.mark.long
@pytest.mark.parametrize("plan", [plans.twelve(), plans.orthogonal()], ids=lambda p: p.name)
def test_right_on_average(bench, sensor_noise, plan):
    draws, rig_sd = 60, np.radians(0.1)
    ratios = []
    for seed in range(draws):
        tool = random_tool(seed)
        readings, _ = bench(plan, tool, Rig(setting_sd=rig_sd), bits=12, seed=seed)
        found = calibrate_joint(readings, diagnose=False)
        true = sensor_noise(tool, 12)
        ratios.append([*((found.tool.noise[k][0] / true[k][0]) ** 2 for k in BOTH), (found.rig.sd[0] / rig_sd) ** 2])
    ratios = np.array(ratios)
    error = ratios.std(axis=0, ddof=1) / np.sqrt(draws)
    # three and a half standard errors; plain maximum likelihood misses by a third
    assert (np.abs(ratios.mean(axis=0) - 1.0) < 3.5 * error).all(), (ratios.mean(axis=0), error)
    assert error.max() < 0.15


@pytest.mark.long
def test_a_perfect_rig_is_found_perfect(bench):
    small = 0
    for seed in range(12):
        readings, _ = bench(plans.orthogonal(), random_tool(seed), Rig(), bits=12, seed=seed)
        found = calibrate_joint(readings, diagnose=False)
        # noise alone moves an axis by 0.5 counts in 1600, 0.02 deg; an azimuth shows in one triad only
        assert np.degrees(found.rig.sd[0]) < 0.04
        small += np.degrees(found.rig.sd[0]) < 1e-3
    assert small >= 3  # an estimate of nothing is zero half of the time


def test_a_free_rig_keeps_the_ratio_of_the_dials_and_given_values_are_kept(bench):
    tool = random_tool(2)
    readings, _ = bench(plans.orthogonal(), tool, Rig(setting_sd=np.radians(0.1)), bits=12)
    given = np.radians([0.05, 0.1, 0.0])
    found = calibrate_joint(readings, rig_sd=given, noise_sd={"accelerometer": 0.7, "magnetometer": [0.6, 0.7, 0.8]})
    np.testing.assert_array_equal(found.rig.sd, given)
    np.testing.assert_allclose(found.tool.noise["accelerometer"], 0.7, rtol=1e-12)
    np.testing.assert_allclose(found.tool.noise["magnetometer"], [0.6, 0.7, 0.8], rtol=1e-12)
    assert (found.rig.errors[:, 2] == 0.0).all()
    assert np.abs(found.rig.errors[:, :2]).min() > 0.0


def test_noise_of_the_readings_themselves_is_kept(bench):
    tool = random_tool(2, bits=None)
    readings, _ = bench(plans.orthogonal(), tool, Rig(setting_sd=np.radians(0.1)), repeats=10)
    found = calibrate_joint(readings)
    for kind in BOTH:
        mean = np.sqrt(np.mean(readings.sd[kind] ** 2 * 10))
        np.testing.assert_allclose(np.sqrt(np.mean(found.tool.noise[kind] ** 2)), mean, rtol=1e-9)
    assert np.degrees(found.rig.sd[0]) == pytest.approx(0.1, rel=0.35)  # 24 stations: a tenth, three times


def test_one_known_and_one_unknown_noise(bench, sensor_noise):
    # what is given stays as given while the other is looked for
    tool = random_tool(5)
    readings, _ = bench(plans.orthogonal(), tool, Rig(setting_sd=np.radians(0.1)), bits=12)
    noise = sensor_noise(tool, 12)
    found = calibrate_joint(readings, noise_sd={"accelerometer": noise["accelerometer"]})
    np.testing.assert_allclose(found.tool.noise["accelerometer"], noise["accelerometer"], rtol=1e-9)
    np.testing.assert_allclose(found.tool.noise["magnetometer"], noise["magnetometer"], rtol=0.5)


def test_large_noise_and_large_rig_errors_converge(bench):
    tool = random_tool(6)
    readings, _ = bench(
        plans.orthogonal(), tool, Rig(setting_sd=np.radians(2.0)), noise=dict.fromkeys(BOTH, 20.0), seed=2
    )
    found = calibrate_joint(readings, diagnose=False)
    assert np.degrees(found.rig.sd[0]) == pytest.approx(2.0, rel=0.5)
    for kind in BOTH:
        assert found.tool.noise[kind][0] == pytest.approx(20.0, rel=0.6)


def dense(fitted):
    """V without and columns Z of the structured errors, jacobian of the parameters, residual: all stations in one."""
    at, model = fitted.at, fitted.model
    count, size = at.residual.size, len(model.structure_sd)
    jacobian = at.jacobian[..., : at.jacobian.shape[2] - size].reshape(count, -1)
    spread = at.by_setting * model.rig_sd
    covariance = np.diag(model.noise_sd.ravel() ** 2) + block_diag(*(spread @ spread.swapaxes(1, 2)))
    columns = np.broadcast_to(model.structure, (*at.residual.shape, size)).reshape(count, size)
    moved = (at.by_setting @ fitted.state.errors[..., None])[..., 0]
    residual = (at.residual - moved - model.structure @ fitted.state.structured).ravel()
    return covariance, columns, jacobian, residual


def twice_negative(covariance, jacobian, residual):
    """Restricted log likelihood, estimate (as a correction) and covariance of the parameters, by dense matrices."""
    inverse, scale = np.linalg.inv(covariance), np.abs(jacobian).max(axis=0)
    unit = jacobian / scale
    normal = np.linalg.inv(unit.T @ inverse @ unit)
    estimate = normal @ unit.T @ inverse @ residual
    left = residual - unit @ estimate
    value = np.linalg.slogdet(covariance)[1] - np.linalg.slogdet(normal)[1] + left @ inverse @ left
    return value, estimate / scale, normal / np.outer(scale, scale)


@pytest.fixture(scope="module")
def twelve(bench):
    readings, _ = bench(plans.twelve(), random_tool(1), Rig(setting_sd=np.radians(0.1)), bits=12, seed=3)
    return readings


@pytest.mark.parametrize("rig_deg", [0.1, 0.02])
def test_evidence_of_repeating_errors_is_the_ratio_of_two_dense_likelihoods(twelve, rig_deg):
    """With them as fitted against none of them, where the random ones of the dial may be up to 30 times larger."""
    here = fitted_model(twelve, {"accelerometer": 0.8, "magnetometer": 0.5}, np.radians(rig_deg))
    fitted = fit(*with_repeating(here))
    covariance, columns, jacobian, residual = dense(fitted)
    model, found = fitted.model, repeating_evidence(fitted)
    both = covariance + columns * model.structure_sd**2 @ columns.T
    grew = []
    for dial in range(3):
        mine = model.structure_dial == dial
        assert mine.any()
        turned = fitted.at.by_setting[..., dial : dial + 1] * model.rig_sd[dial]
        random = block_diag(*(turned @ turned.swapaxes(1, 2)))
        # a thousandth of their standard deviation is left, of arithmetic
        without = both - (1.0 - 1e-6) * columns[:, mine] * model.structure_sd[mine] ** 2 @ columns[:, mine].T
        grown = [twice_negative(without + more * random, jacobian, residual)[0] for more in (0.0, 2.0, 9.0, 29.0)]
        ratio = (min(grown) - twice_negative(both, jacobian, residual)[0]) / 2.0
        assert found[dial] == pytest.approx(ratio, abs=1e-6)
        grew.append(grown[0] > min(grown))
    assert any(grew) == (rig_deg < 0.1)
    assert not repeating_evidence(here).any()


def test_the_gradient_of_the_restricted_likelihood_is_its_slope(twelve):
    """By the logarithm of every factor: noises, dials, what repeats of them."""
    here = fitted_model(twelve, {"accelerometer": 0.8, "magnetometer": 0.5}, np.radians(0.1))
    fitted = fit(*with_repeating(here))
    likelihood = _Restricted(fitted.model, fitted.at, fitted.state, frozenset(BOTH), True)
    logs = np.random.default_rng(1).normal(0.0, 0.3, likelihood.size)
    gradient = likelihood.evaluate(np.exp(logs))[1]
    assert len(gradient) == 8
    for place, step in enumerate(1e-5 * np.eye(8)):
        ends = [float(likelihood.solve(np.exp(logs + way))[0]) for way in (step, -step)]
        assert gradient[place] == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-4, abs=1e-4)


def test_one_variance_has_the_degrees_of_freedom_of_its_readings(twelve):
    """Noise alone to be told: those of Student's t, and twice the relative uncertainty above where caution asks."""
    alone = BenchReadings({"accelerometer": twelve.channels["accelerometer"]}, *twelve.dials)
    here = fitted_model(alone, {"accelerometer": 0.8}, 0.0)
    free = frozenset({"accelerometer"})
    here = fit_with_variances(here.model, here.state, free, False)
    freedom = 36 - 14
    assert here.degrees_of_freedom == freedom
    # least squares: the restricted likelihood is largest at the residuals over their degrees of freedom
    assert here.model.noise_sd[0, 0] ** 2 == pytest.approx(np.sum(here.at.residual**2) / freedom, rel=1e-3)
    averaged, raised = with_averaged_covariance(here, free, False), fit_with_caution(here, free, False)
    for one in (averaged, raised):
        assert one.variance_freedom[0] == pytest.approx(freedom, rel=1e-6)
        assert (one.variance_freedom[1:] >= 2e6 - 1.0).all()  # known
    grown = (raised.model.noise_sd / here.model.noise_sd)[0, 0] ** 2
    assert grown == pytest.approx(np.exp(2.0 * np.sqrt(2.0 / freedom)), rel=1e-3)
    # its mean, by quadrature over its logarithm; the prior allows a factor of e^2; 128 random draws: 3 %
    log = np.linspace(-3.0, 3.0, 2001)
    weight = np.exp(-0.5 * freedom * (log + np.exp(-log) - 1.0) - 0.5 * (log / 2.0) ** 2)
    mean = weight @ np.exp(log) / weight.sum()
    assert (expected_variances(here, free, False)[0].noise_sd / here.model.noise_sd)[0, 0] ** 2 == pytest.approx(
        mean, rel=0.06
    )
    np.testing.assert_allclose(np.diag(averaged.covariance) / np.diag(here.covariance), mean, rtol=0.06)


def test_the_averaged_covariance_is_an_integral_over_the_variances(twelve):
    """Two noises to be told and the dials known: a grid of 31 x 31 over their logarithms, dense matrices."""
    here = fitted_model(twelve, {"accelerometer": 0.8, "magnetometer": 0.5}, np.radians(0.1))
    here = fit_with_variances(here.model, here.state, {*BOTH}, False)
    found, means, relative, _ = average_over_variances(here.model, here.at, here.state, {*BOTH}, False)
    rest, _, jacobian, residual = dense(here)
    noise = np.diag(here.model.noise_sd.ravel() ** 2)
    first = np.tile([1.0, 1.0, 1.0, 0.0, 0.0, 0.0], 12)
    grid, total, weight = np.linspace(-4.0, 4.0, 31), [], []
    best, start, _ = twice_negative(rest, jacobian, residual)
    for one in grid:
        for other in grid:
            factor = np.exp(one) * first + np.exp(other) * (1.0 - first)
            value, estimate, spread = twice_negative(rest + noise * (factor - 1.0), jacobian, residual)
            weight.append(np.exp(-0.5 * (value - best) - (one**2 + other**2) / 8.0))
            moved = estimate - start
            total.append([*np.diag(spread) + moved**2, np.exp(one), np.exp(other)])
    wanted = np.array(weight) @ np.array(total) / np.sum(weight)
    # 128 draws of heavy tails: a tenth
    np.testing.assert_allclose(np.diag(found) / wanted[:-2], 1.0, atol=0.12)
    np.testing.assert_allclose(means[:2] / wanted[-2:], 1.0, atol=0.15)
    np.testing.assert_allclose(means[2:], 1.0, rtol=1e-12)
    assert np.isnan(relative[2:]).all()


def test_a_fit_without_some_stations_is_told_to_first_order(twelve):
    here = fitted_model(twelve, {"accelerometer": 0.8, "magnetometer": 0.5}, np.radians(0.1))
    rest = np.delete(np.arange(12), 4)
    model, covariance, shift = fitted_without(here, rest, frozenset(), False)
    anew = fit(
        here.model.take(rest),
        here.state.__class__(
            here.state.coefficients, here.state.directions, here.state.errors[rest], here.state.nuisance
        ),
    )
    moved = np.concatenate([(here.state.coefficients[k] - anew.state.coefficients[k]).ravel() for k in BOTH])
    u = np.sqrt(np.diag(anew.covariance))
    # what is not linear in a step of a standard deviation
    np.testing.assert_allclose(shift[: len(moved)] / u[: len(moved)], moved / u[: len(moved)], atol=0.02)
    np.testing.assert_allclose(np.diag(covariance), u**2, rtol=0.02)
    assert len(model.settings) == 12
    np.testing.assert_allclose(model.noise_sd, here.model.noise_sd)


def test_where_the_search_for_the_variances_starts(twelve):
    """What is stated is kept; what is not begins near the size that the residuals show, never below the rounding."""
    sd, known = rig_guess(None)
    assert not known.any()
    assert ((np.radians(0.01) < sd) & (sd < np.radians(1.0))).all()
    sd, known = rig_guess(0.002)
    assert sd.tolist() == [0.002] * 3
    assert known.all()
    sd, known = rig_guess([0.001, np.nan, 0.0])
    assert known.tolist() == [True, False, True]
    assert sd[[0, 2]].tolist() == [0.001, 0.0]
    assert sd[1] == rig_guess(None)[0][1]
    assert rig_guess(np.radians(30.0))[1].all()
    with refused("input-value", name="rig_sd"):
        rig_guess(np.radians(30.1))
    with refused("input-shape", name="rig_sd"):
        rig_guess([0.1, 0.1])
    residual = np.concatenate([np.full((12, 3), 6.0), np.full((12, 3), 30.0)], axis=1)
    sd, free = noise_guess(twelve, None, residual)
    assert free == {*BOTH}
    np.testing.assert_allclose(sd[:, :3], 2.0)
    np.testing.assert_allclose(sd[:, 3:], 10.0)
    small, _ = noise_guess(twelve, None, 1e-9 * residual)
    assert (small >= 1.0 / np.sqrt(12.0) - 1e-12).all()
    sd, free = noise_guess(twelve, {"accelerometer": [1.0, 2.0, 3.0]}, residual)
    assert free == {"magnetometer"}
    np.testing.assert_allclose(sd[4], [1.0, 2.0, 3.0, 10.0, 10.0, 10.0])
    with refused("input-choice", name="noise_sd"):
        noise_guess(twelve, {"compass": 1.0}, residual)
    # means with a scatter of their own, one of them without: as good as the others, and never better than their step
    own = {"accelerometer": np.where(np.arange(12)[:, None] == 5, 0.0, 3.0) * np.ones(3)}
    stated = BenchReadings(twelve.channels, *twelve.dials, sd=own, step={"accelerometer": 0.0, "magnetometer": 1.0})
    sd, free = noise_guess(stated, None, residual)
    assert free == {"magnetometer"}
    np.testing.assert_allclose(sd[:, :3], 3.0)
