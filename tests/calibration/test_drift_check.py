"""A check of few positions with the tool's history, from readings to a calibration."""

import datetime
from dataclasses import replace

import numpy as np
import pytest
from tests.refusals import fits, refused

from inclinometry.calibration import plans
from inclinometry.calibration.drift import SHOWN, DriftModel, azimuth_sd, azimuth_weight, drift_states
from inclinometry.calibration.drift_check import (
    after_check,
    check_with_prior,
    chosen_positions,
    plan_information,
)
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.constants import DIP, VECTORS
from inclinometry.history import UNSEEN, CalibrationRecord, relative_parameters, tool_from_relative, tool_history
from inclinometry.simulate.bench import Rig
from inclinometry.simulate.fleet import drift_variance, mounting_variance, simulate_calibrations
from inclinometry.simulate.tool import realistic_tool

RIG = Rig(setting_sd=np.radians(0.1), north_offset=0.3, base_tilt=np.radians(1.0), tilt_axis=0.7)
ZERO = np.zeros((24, 24))


def model_of(reproducibility=ZERO, tools=200):
    """A type whose drift is known."""
    return DriftModel(
        "X", drift_variance(), reproducibility, np.zeros((24, 2)), 1.0, 1.0, 0.0, DIP, tools, 1000, "", "", "sha256:0"
    )


def settings_of(plan):
    return np.stack([plan.azimuth, plan.inclination, plan.toolface], axis=1)


def readings_of(run):
    return BenchReadings(
        run.signals, run.azimuth, run.inclination, run.toolface, units=run.units, reference=run.reference
    )


def life(tool, seed, calibrations=3, jump=None):
    """Truth (K + 1, 24), the history of the first K, the readings of a six-position check."""
    random = np.random.default_rng(seed)
    root = np.linalg.cholesky(drift_variance() + 1e-14 * np.eye(24))
    truth = np.cumsum(random.standard_normal((calibrations + 1, 24)) @ root.T * np.sqrt(0.5), axis=0)
    if jump is not None:
        truth[-1] += jump
    plan = plans.twelve()
    runs = simulate_calibrations(tool, truth[:-1], RIG, settings_of(plan), seed=seed)
    noise = {kind: sd.max() for kind, sd in tool.noise.items()}
    found = [calibrate_joint(readings_of(run), noise_sd=noise, rig_sd=np.radians(0.1), diagnose=False) for run in runs]
    days = [datetime.date(2024, 1, 1) + datetime.timedelta(days=round(182.625 * k)) for k in range(calibrations)]
    records = [CalibrationRecord(day, one.tool) for day, one in zip(days, found, strict=True)]
    history = tool_history("7", "X", records, tool)
    six = simulate_calibrations(tool, truth[-1:], RIG, settings_of(plans.six()), seed=seed + 1000)[0]
    return truth, history, readings_of(six)


def test_relative_parameters_there_and_back():
    tool, random = realistic_tool(3), np.random.default_rng(1)
    values = 1e-3 * random.standard_normal(24)
    root = 1e-4 * random.standard_normal((24, 24))
    moved = tool_from_relative(tool, values, root @ root.T)
    back, covariance = relative_parameters(moved, tool)
    np.testing.assert_allclose(back, values, atol=1e-12)
    np.testing.assert_allclose(covariance, root @ root.T, rtol=1e-9, atol=1e-18)


def test_relative_parameters_are_those_of_the_field_read():
    """b = (I + E) a + o is what the reference reads of the moved tool's signals."""
    tool = realistic_tool(4)
    moved = tool_from_relative(tool, np.linspace(-1e-3, 1e-3, 24), ZERO)
    a = np.array([0.3, -0.5, 0.8])
    for place, kind in enumerate(VECTORS):
        block = np.linspace(-1e-3, 1e-3, 24)[12 * place : 12 * place + 12].reshape(3, 4)
        seen = tool.triads[kind].field(moved.triads[kind].signals(a))
        np.testing.assert_allclose(seen, a + block[:, :3] @ a + block[:, 3], atol=1e-12)


def test_bound_of_plans_is_the_specifications():
    """5-likelihood.md and 9-fleet.md, 3.2: azimuth at 5, 30, 60, 90 deg."""
    expected = {"twelve": (0.184, 0.068, 0.061, 0.067), "orthogonal": (0.130, 0.049, 0.046, 0.046)}
    for name, figures in expected.items():
        found = np.degrees(azimuth_sd(np.linalg.inv(plan_information(getattr(plans, name)()))))
        np.testing.assert_allclose(found, figures, atol=0.0006)


def test_six_and_prior_replace_twelve_and_no_less():
    """9-fleet.md, 3.3, theory at steady state: six + prior is no worse than twelve alone, twelve + prior is a 24."""
    j12, j6 = plan_information(plans.twelve()), plan_information(plans.six())
    state = v12 = np.linalg.inv(j12)
    for _ in range(5):
        state = after_check(state + 0.65 * drift_variance(), j12)
    prior = state + 0.5 * drift_variance()
    six, twelve = (azimuth_sd(after_check(prior, j)) for j in (j6, j12))
    assert (six <= azimuth_sd(v12)).all()
    assert (twelve <= 1.1 * azimuth_sd(np.linalg.inv(plan_information(plans.orthogonal())))).all()
    np.testing.assert_allclose(np.degrees(six), (0.134, 0.057, 0.057, 0.062), atol=0.002)


def test_chosen_positions_come_in_the_order_of_inclination_and_number_one_to_sixty():
    prior = np.linalg.inv(plan_information(plans.twelve())) + 0.5 * drift_variance()
    plan = chosen_positions(prior, 5)
    rows = np.round(settings_of(plan)[:, [1, 0, 2]], 8).tolist()
    assert rows == sorted(rows)
    for count in (0, 61):
        with refused("input-value", name="count"):
            chosen_positions(prior, count)


def test_chosen_positions_do_no_worse_than_six():
    prior = np.linalg.inv(plan_information(plans.twelve())) + 0.5 * drift_variance()
    chosen = plan_information(chosen_positions(prior, 6))
    weight = azimuth_weight(np.radians([10.0, 30.0, 60.0, 90.0]), DIP)

    def mean(j):
        return np.einsum("npq,pq->", weight, after_check(prior, j))

    assert mean(chosen) < 1.25 * mean(plan_information(plans.six()))


def test_check_from_readings_is_a_calibration_with_its_covariance():
    tool = realistic_tool(5)
    truth, history, readings = life(tool, 5)
    prior = drift_states([history], model_of())[0][-1].predicted(model_of(), 0.5)
    check = check_with_prior(readings, tool, prior, model_of())
    assert not check.alarm.raised
    assert check.calibration.method == "joint with prior"
    assert check.calibration.tool.name == tool.name
    named = check_with_prior(readings, tool, prior, model_of(), name="A7")
    assert named.calibration.tool.name == "A7"
    np.testing.assert_array_equal(named.values, check.values)
    assert fits(check.calibration.findings[-1], ["drift-history"], {"type": "X"})
    found, covariance = relative_parameters(check.calibration.tool, tool)
    # what was said before any reading was taken, for the plan's ideal tool and rig
    expected = azimuth_sd(after_check(prior.covariance, plan_information(plans.six())))
    np.testing.assert_allclose(azimuth_sd(covariance), expected, rtol=0.1)
    off = found - truth[-1]
    assert off @ np.linalg.solve(covariance, off) < 60.0  # chi-square of 24: one in 10^4 is above 61
    # the readings alone, for the history: much looser, and consistent
    alone = check.values - truth[-1]
    assert alone @ np.linalg.solve(check.covariance, alone) < 60.0
    # the directions of both fields that it states: of unit length, as far off as the rig is tilted and turned
    fields = check.calibration.field_directions
    np.testing.assert_allclose([np.linalg.norm(fields[kind]) for kind in VECTORS], 1.0, atol=1e-12)
    assert fields["accelerometer"][2] == pytest.approx(np.cos(np.radians(1.0)), abs=2e-4)
    joint = np.array(check.calibration.covariance)
    np.testing.assert_allclose(joint[:24, :24], check.calibration.tool.covariance, rtol=1e-9)
    assert np.linalg.eigvalsh(joint / np.sqrt(np.outer(np.diagonal(joint), np.diagonal(joint))))[0] > -1e-9


def test_a_jump_refuses_the_check_and_is_named():
    tool = realistic_tool(6)
    jump = np.zeros(24)
    jump[15] = 600.0 / 5e4
    _, history, readings = life(tool, 6, jump=jump)
    prior = drift_states([history], model_of())[0][-1].predicted(model_of(), 0.5)
    check = check_with_prior(readings, tool, prior, model_of())
    assert check.alarm.raised
    assert check.alarm.cause == "magnetometer x offset"
    assert check.alarm.size == pytest.approx(jump[15], rel=0.3)
    assert check.calibration is None
    assert check.refusal.code == "drift-contradicts"


def test_a_fleet_of_a_hundred_past_calibrations_sets_the_threshold():
    """What raises an alarm in a tool that jumped is nothing beside calibrations that were always as far off."""
    tool = realistic_tool(6)
    jump = np.zeros(24)
    jump[15] = 600.0 / 5e4
    _, history, readings = life(tool, 6, jump=jump)
    prior = drift_states([history], model_of())[0][-1].predicted(model_of(), 0.5)
    rough = 1e4 * np.random.default_rng(1).chisquare(3.0, 100)
    raised = [
        check_with_prior(readings, tool, prior, model_of(), past=rough[:count], false_alarms=0.02).alarm.raised
        for count in (99, 100)
    ]
    assert raised == [True, False]


def test_evidence_of_a_check_is_the_update_of_equation_6():
    """The values that go into the history bring the filter to where the check came to."""
    tool = realistic_tool(7)
    _, history, readings = life(tool, 7)
    model = model_of(0.25 * mounting_variance())
    prior = drift_states([history], model)[0][-1].predicted(model, 0.5)
    check = check_with_prior(readings, tool, prior, model, false_alarms=1e-6)
    seen = prior.covariance + check.covariance + model.reproducibility
    gain = np.linalg.solve(seen, prior.covariance).T
    found, covariance = relative_parameters(check.calibration.tool, tool)
    np.testing.assert_allclose(found, prior.mean + gain @ (check.values - prior.mean), atol=2e-6)
    np.testing.assert_allclose(covariance, prior.covariance - gain @ prior.covariance, rtol=0.02, atol=1e-10)


def test_check_refuses_other_units_and_unknown_noise():
    tool = realistic_tool(8)
    _, history, readings = life(tool, 8, calibrations=2)
    prior = drift_states([history], model_of())[0][-1]
    other = BenchReadings(readings.channels, *readings.dials, units={"accelerometer": "V", "magnetometer": "counts"})
    volts = realistic_tool(8, bits=None)
    with refused("fit-units"):
        check_with_prior(other, volts, prior, model_of())
    from dataclasses import replace

    with refused("input-missing", names=("noise_sd.accelerometer",)):
        check_with_prior(readings, replace(tool, noise={}), prior, model_of())


@pytest.mark.long
def test_checks_are_honest_over_many_tools():
    """Normalised squared error and azimuth error of 20 checks from readings, prior and all."""
    tool, weight = realistic_tool(9), azimuth_weight(np.array(SHOWN), DIP)
    nees, made, said = [], [], []
    for seed in range(100, 120):
        truth, history, readings = life(tool, seed)
        prior = drift_states([history], model_of())[0][-1].predicted(model_of(), 0.5)
        check = check_with_prior(readings, tool, prior, model_of(), false_alarms=1e-6)
        found, covariance = relative_parameters(check.calibration.tool, tool)
        off = found - truth[-1]
        nees.append(off @ np.linalg.solve(covariance, off) / 24.0)
        made.append(np.einsum("npq,p,q->n", weight, off, off))
        said.append(np.einsum("npq,pq->n", weight, covariance))
    assert 0.8 < np.mean(nees) < 1.2  # sd of the mean 0.065
    np.testing.assert_allclose(np.mean(made, axis=0), np.mean(said, axis=0), rtol=0.6)


@pytest.mark.parametrize("stated", [True, False])
def test_a_stronger_field_at_the_stand_is_no_drift(stated):
    """The six readings where the magnetic field is 2 % stronger, twenty times what a scale drifts by."""
    tool = realistic_tool(5)
    truth, history, readings = life(tool, 5)
    prior = drift_states([history], model_of())[0][-1].predicted(model_of(), 0.5)
    offset = tool_from_relative(tool, truth[-1], ZERO).triads["magnetometer"].offset[0]
    signals = dict(readings.channels)
    signals["magnetometer"] = offset + 1.02 * (signals["magnetometer"] - offset)
    checks = []
    for factor, channels in ((1.0, readings.channels), (1.02, signals)):
        b = {"b": factor * readings.reference["b"]} if stated else {}
        reference = {name: value for name, value in readings.reference.items() if name != "b"} | b
        there = BenchReadings(channels, *readings.dials, units=readings.units, reference=reference)
        checks.append(check_with_prior(there, tool, prior, model_of()))
    here, check = checks
    assert not check.alarm.raised
    found = [relative_parameters(one.calibration.tool, tool)[0] for one in (here, check)]
    if not stated:  # how strong the field is drops out of every angle, and out of what is compared
        for values in found:
            values[[12, 17, 22]] -= values[[12, 17, 22]].mean()
    spread = np.sqrt(np.diagonal(relative_parameters(check.calibration.tool, tool)[1]))
    # noise that grew by 2 % as well weighs a little less
    assert np.max(np.abs(found[1] - found[0]) / spread) < 0.1


def test_a_stronger_field_is_no_change_of_the_tool():
    """Two certificates of one tool, at stands 2 % apart in their fields: stated, or of unknown common scale."""
    tool = realistic_tool(5)
    triad = tool.triads["magnetometer"]
    for strength in (1.02 * triad.field_strength, None):
        there = replace(triad, tensor=1.02 * triad.tensor, field_strength=strength)
        moved = replace(tool, triads={**tool.triads, "magnetometer": there}, covariance=1e-9 * np.eye(24))
        values, covariance = relative_parameters(moved, tool)
        np.testing.assert_allclose(values, 0.0, atol=1e-12)
        common = np.zeros(24)
        common[[12, 17, 22]] = 1.0 / np.sqrt(3.0)
        # along the common scale as good as unknown, otherwise as certified
        assert common @ covariance @ common == pytest.approx(0.0 if strength else 3.0 * UNSEEN**2, abs=1e-6)
        across = np.eye(24) - np.outer(common, common)
        assert np.abs(across @ covariance @ across).max() < 1e-6
