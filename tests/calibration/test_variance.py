"""Variance components: the maximum of the dense restricted likelihood, right on average, zero where nothing is."""

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.optimize import minimize

from inclinometry.calibration import plans
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.likelihood import Model
from inclinometry.calibration.start import starting_state
from inclinometry.calibration.variance import estimate_components, fit
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
