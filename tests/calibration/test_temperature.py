"""Temperature campaigns: the true dependence comes back, no more of it than the readings support."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.plans import Plan
from inclinometry.calibration.result import tool_rows
from inclinometry.calibration.temperature import soaks
from inclinometry.errors import IdentifiabilityError
from inclinometry.sensors import parameter_vector
from inclinometry.simulate.bench import Rig
from inclinometry.simulate.tool import random_tool

BOTH = ("accelerometer", "magnetometer")
RIG = Rig(setting_sd=np.radians(0.05))


def campaign(bench, tool, temperatures, *, plan=None, seed=1, scatter=0.3, rig=RIG, **more):
    """The plan once at each temperature, which wanders by `scatter` within a soak."""
    plan = plans.orthogonal() if plan is None else plan
    times = len(temperatures)
    whole = Plan("campaign", *(np.tile(v, times) for v in (plan.azimuth, plan.inclination, plan.toolface)))
    heat = np.repeat(np.asarray(temperatures, dtype=float), len(plan))
    heat += scatter * np.random.default_rng(seed).normal(size=len(heat))
    return bench(whole, tool, rig, temperature=heat, seed=seed, bits=12, **more)[0]


def at_reference(tool, triad):
    """True parameters (P, m, 4) as a polynomial about the found triad's reference temperature."""
    true = tool.triads[triad.kind]
    shift = triad.reference_temperature - true.reference_temperature
    block = np.concatenate([true.tensor, true.offset[..., None]], axis=-1)
    moved = np.zeros_like(block)
    for power in range(len(block)):
        for lower in range(power + 1):  # binomial theorem
            ways = np.prod(np.arange(power - lower + 1, power + 1)) / np.prod(np.arange(1, lower + 1))
            moved[lower] += ways * shift ** (power - lower) * block[power]
    return moved


@pytest.mark.long
@pytest.mark.parametrize(
    ("degree", "temperatures"),
    [(0, [20, 80]), (1, [20, 80]), (1, [0, 40, 80, 120]), (2, [20, 70, 120]), (2, [0, 40, 80, 120, 160])],
)
def test_degree_and_parameters_are_found(bench, degree, temperatures):
    total, size = 0.0, 0
    for seed in range(3):
        tool = random_tool(seed, temperature_degree=degree)
        found = calibrate_joint(campaign(bench, tool, temperatures, seed=seed), diagnose=False)
        assert [t.degree for t in found.tool.triads.values()] == [degree, degree]
        error = np.concatenate(
            [parameter_vector(t) - at_reference(tool, t).ravel() for t in found.tool.triads.values()]
        )
        scale = np.sqrt(np.diag(found.tool.covariance))
        unit = found.tool.covariance / np.outer(scale, scale)
        total += (error / scale) @ np.linalg.solve(unit, error / scale)
        size += len(error)
        shown = tool_rows(found.tool)[0][1:]  # at the reference temperature
        assert [float(cell.split(" ± ")[1]) for cell in shown] == pytest.approx(scale[:4], rel=0.1)
        assert found.tool.temperature_range[0] == pytest.approx(min(temperatures), abs=1.5)
        assert found.tool.temperature_range[1] == pytest.approx(max(temperatures), abs=1.5)
    # honest covariance; estimated variances add some per cent to the spread of chi-square
    low, high = chi2.ppf([1e-4, 1 - 1e-4], size)
    assert 0.9 * low < total < 1.15 * high


def test_prediction_over_the_range_beats_a_calibration_that_ignores_temperature(bench):
    tool = random_tool(1, temperature_degree=2)
    readings = campaign(bench, tool, [20, 70, 120])
    heat = np.linspace(20, 120, 40)
    field = np.random.default_rng(1).normal(size=(40, 3))
    field /= np.linalg.norm(field, axis=1, keepdims=True)
    worst = {}
    for degree in (0, 2):
        found = calibrate_joint(readings, temperature_degree=degree, diagnose=False)
        worst[degree] = max(
            np.abs(found.tool.triads[k].signals(field, heat) - tool.triads[k].signals(field, heat)).max() for k in BOTH
        )
    assert worst[2] < 2.0  # counts, of 1600: five times what 72 settings of 0.05 deg leave
    assert worst[0] > 5.0


def test_one_temperature_is_degree_zero(bench):
    readings = campaign(bench, random_tool(1, temperature_degree=2), [35.0])
    found = calibrate_joint(readings)
    assert found.tool.triads["accelerometer"].degree == 0
    assert found.tool.triads["accelerometer"].reference_temperature == pytest.approx(35.0, abs=0.3)
    low, high = found.tool.temperature_range
    assert 33.0 < low < high < 37.0


def test_without_temperature_none_is_claimed(bench):
    readings, _ = bench(plans.orthogonal(), random_tool(1), RIG, bits=12)
    found = calibrate_joint(readings)
    assert found.tool.temperature_range is None
    assert found.tool.triads["accelerometer"].degree == 0


def test_the_degree_may_be_given_and_is_limited_by_the_soaks(bench):
    readings = campaign(bench, random_tool(1, temperature_degree=1), [20, 80])
    assert calibrate_joint(readings, temperature_degree=1, diagnose=False).tool.triads["magnetometer"].degree == 1
    with refused("fit-few", error=IdentifiabilityError):
        calibrate_joint(readings, temperature_degree=2)
    with refused("input-value", name="temperature_degree"):
        calibrate_joint(readings, temperature_degree=-1)
    with refused("input-needs", name="temperature_degree"):
        calibrate_joint(dataclasses.replace(readings, temperature=None), temperature_degree=1)


def test_too_few_stations_a_temperature_fall_back(bench):
    # the twelve positions once, half of them warm: 72 readings cannot carry 52 parameters well
    tool = random_tool(1, temperature_degree=1)
    heat = np.where(np.arange(12) % 2 == 0, 20.0, 80.0)
    readings, _ = bench(plans.twelve(), tool, RIG, temperature=heat, bits=12)
    found = calibrate_joint(readings, diagnose=False)
    assert np.isfinite(found.covariance).all()


def test_the_zero_of_temperature_does_not_matter(bench):
    tool = random_tool(2, temperature_degree=1)
    readings = campaign(bench, tool, [20, 80])
    kelvin = dataclasses.replace(readings, temperature=readings.temperature + 273.15)
    one, other = calibrate_joint(readings, diagnose=False), calibrate_joint(kelvin, diagnose=False)
    for kind in BOTH:
        # the reference is rounded to 0.001 degC in both: nothing but rounding is left
        np.testing.assert_allclose(
            parameter_vector(one.tool.triads[kind]), parameter_vector(other.tool.triads[kind]), atol=1e-4
        )


def test_order_of_the_campaign_does_not_matter(bench):
    tool = random_tool(2, temperature_degree=1)
    readings = campaign(bench, tool, [20, 80])
    mixed = readings.take(np.random.default_rng(1).permutation(48))
    one, other = calibrate_joint(readings, diagnose=False), calibrate_joint(mixed, diagnose=False)
    np.testing.assert_allclose(np.diag(one.covariance), np.diag(other.covariance), rtol=1e-4)


def test_several_triads_of_any_size(bench):
    tool = random_tool(4, sensors={"accelerometer": 4, "gyro": 2}, temperature_degree=1)
    found = calibrate_joint(campaign(bench, tool, [10, 90]), diagnose=False)
    for kind in ("accelerometer", "gyro"):
        triad = found.tool.triads[kind]
        u = np.sqrt(np.diag(found.tool.covariance))[found.tool.slices[kind]]
        assert (np.abs(parameter_vector(triad) - at_reference(tool, triad).ravel()) < 5 * u).all()


@pytest.mark.parametrize(
    ("temperatures", "count"),
    [([20.0], 1), ([20.0, 22.4], 1), ([20.0, 22.6], 2), ([20, 22, 24, 26], 1), ([100, 20, 60, 21, 99], 3)],
)
def test_soaks(temperatures, count):
    # chains of small steps are one drifting soak; gaps of more than 2.5 degC separate
    assert soaks(np.array(temperatures, dtype=float)) == count
