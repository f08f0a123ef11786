"""Alarms, rigs, due dates: thresholds keep their rate, causes are named, dates keep their reliability."""

import datetime
from dataclasses import replace

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.calibration.drift import (
    MULTIPLIERS,
    DriftModel,
    DriftState,
    azimuth_sd,
    azimuth_weight,
    drift_states,
)
from inclinometry.calibration.drift_alarm import (
    CAUSES,
    discoveries,
    fit_without_jumps,
    gaussian_maxima,
    innovations,
    judged,
    p_values,
    rig_verdicts,
    threshold,
)
from inclinometry.calibration.drift_check import after_check, plan_information
from inclinometry.calibration.drift_status import fleet_status
from inclinometry.calibration.interval import LONGEST, Growth, Requirement, due_date
from inclinometry.constants import DIP
from inclinometry.simulate.fleet import FleetScene, drift_variance, simulate_fleet

V12 = np.linalg.inv(plan_information(plans.twelve()))
TYPE = DriftModel(
    "simulated", drift_variance(), np.zeros((24, 24)), np.zeros((24, 2)), 1.0, 1.0, 0.0, DIP, 200, 1200, "", "", ""
)


def last(scene, seed):
    """Innovations of the last calibrations of a fleet whose type is known."""
    found = innovations(simulate_fleet(scene, seed=seed).histories, TYPE)
    return found.take(found.number == found.number.max())


def test_there_are_35_causes_each_of_its_own():
    assert len(CAUSES) == 35
    directions = np.stack(list(CAUSES.values()))
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    assert np.abs(unit @ unit.T - np.eye(35)).max() < 0.95


def test_false_alarms_keep_their_rate_and_jumps_are_named():
    """9-fleet.md, 4: at most 1.5 of nominal at 1e-2; power at 1e-3 of 0.9 for 300 nT and 2 mg, named rightly 0.85."""
    found = last(FleetScene(600, V12), 5)
    information = np.linalg.inv(found.covariance)
    maxima = gaussian_maxima(information[0], 60_000)
    assert (found.test().largest > threshold(maxima, 1e-2)).mean() < 0.022  # nominal 0.01, sd 0.004
    q = threshold(maxima, 1e-3)
    names = list(CAUSES)
    for cause, size in (("magnetometer x offset", 300.0 / 5e4), ("accelerometer y offset", 2e-3)):
        test = replace(found, values=found.values + size * CAUSES[cause]).test()
        hit = test.largest > q
        assert hit.mean() > 0.9
        assert np.mean([names[k] == cause for k in test.statistic[hit].argmax(axis=1)]) > 0.85
    # what is not claimed
    small = replace(found, values=found.values + 100.0 / 5e4 * CAUSES["magnetometer x offset"]).test()
    assert (small.largest > q).mean() < 0.1


@pytest.mark.long
def test_conformal_threshold_holds_under_heavy_tails_where_the_normal_one_does_not():
    """9-fleet.md, 4: at most 1.5 of nominal 1e-2 under Student's t with five degrees of freedom."""
    past, new = last(FleetScene(1500, V12, freedom=5.0), 6), last(FleetScene(1500, V12, freedom=5.0), 7)
    largest = new.test().largest
    normal = threshold(gaussian_maxima(np.linalg.inv(new.covariance[0]), 60_000), 1e-2)
    assert (largest > normal).mean() > 0.025
    # 1.5e-2, and one standard deviation of what 1500 past and 1500 new ones leave to chance
    assert (largest > threshold(past.test().largest, 1e-2, tail=False)).mean() < 0.0187
    assert (largest > threshold(past.test().largest, 1e-3)).mean() < 0.004


def test_p_values_are_uniform_and_monotonic():
    random = np.random.default_rng(1)
    past, new = random.chisquare(3.0, 1000), random.chisquare(3.0, 20_000)
    p = p_values(new, past)
    for level in (0.5, 0.1, 0.01):
        assert (p < level).mean() == pytest.approx(level, rel=0.35)
    order = np.argsort(new)
    assert (np.diff(p[order]) <= 1e-12).all()
    with refused("drift-past-few"):
        p_values(new, past[:50])
    assert threshold(past[:50], 1e-3, tail=False) == np.inf


def test_the_tail_goes_on_beyond_the_largest_of_the_past():
    past = -2.0 * np.log(np.linspace(1.0, 0.001, 999))  # chi-square of two degrees of freedom
    assert p_values(np.array([2.0, 20.0]), past) == pytest.approx(np.exp([-1.0, -10.0]), rel=0.25)
    assert threshold(past, 0.01, tail=False) == pytest.approx(-2.0 * np.log(0.01), abs=0.01)
    assert threshold(past, 1e-4) == pytest.approx(-2.0 * np.log(1e-4), rel=0.03)


def test_a_list_has_few_false_discoveries():
    random = np.random.default_rng(2)
    p = np.concatenate([random.uniform(size=950), 1e-5 * random.uniform(size=50)])
    kept = discoveries(p)
    assert kept[950:].all()
    assert kept[:950].sum() < 10
    assert discoveries(np.zeros(0)).shape == (0,)


def test_jumped_tools_are_left_out_of_the_fit():
    jumps = {(t, 3): 8e-3 * CAUSES["magnetometer x offset"] for t in (4, 17)}
    made = simulate_fleet(FleetScene(40, V12, jumps=jumps), seed=9)
    model, past = fit_without_jumps(made.histories, reproducibility=False, own_drift=False)
    assert {"SIM-0005", "SIM-0018"} <= set(model.left_out)
    assert len(model.left_out) < 6
    assert len(past) == 6 * (40 - len(model.left_out))


def test_one_fit_leaves_out_nobody_whoever_jumped():
    jumps = {(t, 3): 2e-2 * CAUSES["magnetometer x offset"] for t in (1, 2)}
    made = simulate_fleet(FleetScene(12, V12, calibrations=5, jumps=jumps), seed=9)
    model, past = fit_without_jumps(made.histories, rounds=1, reproducibility=False, own_drift=False)
    assert model.left_out == ()
    assert len(past) == 4 * 12
    # by which a second one leaves some out
    assert fit_without_jumps(made.histories, rounds=2, reproducibility=False, own_drift=False)[0].left_out


def test_the_rig_that_is_off_is_found_and_one_jump_is_not_a_rig():
    """Rig 2 turns all tools by 0.1 deg about their axis from the last calibration on."""
    shift = np.radians(0.1) * CAUSES["magnetometers turned about z"]
    found = last(FleetScene(60, V12, rigs=3), 10)
    bad = np.array([rig == "rig 2" for rig in found.rig])
    moved = replace(found, values=found.values + bad[:, None] * shift)
    verdicts = rig_verdicts(moved)
    assert verdicts[0].rig == "rig 2"
    assert verdicts[0].cause == "magnetometers turned about z"
    assert verdicts[0].p_value < 1e-6
    assert verdicts[0].size == pytest.approx(np.radians(0.1), rel=0.3)
    assert all(one.p_value > 1e-3 for one in verdicts[1:])
    assert all(one.p_value > 1e-3 for one in rig_verdicts(found))
    values = found.values.copy()
    values[0] += 0.01 * CAUSES["magnetometer x offset"]
    assert all(one.p_value > 1e-3 for one in rig_verdicts(replace(found, values=values)))


def test_probability_of_the_due_date_is_the_quadratic_form_s():
    """Satterthwaite's approximation against drawn errors, and the date is where it reaches what is allowed."""
    requirement, random = Requirement(), np.random.default_rng(3)
    growth = Growth(V12[None, None], drift_variance(), np.ones((1, 1)), np.ones(1), requirement)
    years = growth.longest(0.05)
    spread = V12 + years[0] * drift_variance()
    drawn = random.standard_normal((100_000, 24)) @ np.linalg.cholesky(spread).T
    r = np.einsum("np,pq,nq->n", drawn, azimuth_weight(np.radians([60.0]), DIP)[0], drawn)
    assert (r > requirement.limit**2).mean() == pytest.approx(0.05, abs=0.004)


def test_what_shocks_move_a_tool_by_is_in_the_probability():
    """Drawn errors about a mean that shocks and heat have moved."""
    requirement, random = Requirement(), np.random.default_rng(4)
    moved = 0.6 * np.sqrt(np.diagonal(drift_variance())) * np.where(np.arange(24) % 2, 1.0, -1.0)
    growth = Growth(V12[None, None], drift_variance(), np.ones((1, 1)), np.ones(1), requirement, moved)
    years = growth.longest(0.05)
    spread = V12 + years[0] * drift_variance()
    drawn = years[0] * moved + random.standard_normal((100_000, 24)) @ np.linalg.cholesky(spread).T
    r = np.einsum("np,pq,nq->n", drawn, azimuth_weight(np.radians([60.0]), DIP)[0], drawn)
    assert (r > requirement.limit**2).mean() == pytest.approx(0.05, abs=0.006)
    unmoved = Growth(V12[None, None], drift_variance(), np.ones((1, 1)), np.ones(1), requirement)
    assert years[0] < 0.95 * unmoved.longest(0.05)[0]


def test_due_date_follows_drift_use_and_doses():
    weights = np.where(MULTIPLIERS == 1.0, 1.0, 0.0)
    state = DriftState(weights, np.zeros((9, 24)), np.tile(V12, (9, 1, 1)))
    day = datetime.date(2026, 1, 1)
    usual = due_date(state, TYPE, day)
    fast = due_date(replace(state, weights=np.roll(weights, 2)), TYPE, day)
    assert fast.years < usual.years / 2.0
    assert usual.date == day + datetime.timedelta(days=int(usual.years * 365.25))
    hours = replace(TYPE, calendar_share=0.5, hours_per_year=1000.0)
    assert due_date(state, hours, day, hours_per_year=3000.0).years == pytest.approx(usual.years / 2.0, rel=1e-6)
    effects = np.zeros((24, 2))
    effects[15, 0] = 2e-3
    shaken = due_date(state, replace(TYPE, effects=effects), day, doses_per_year=(2.0, 0.0))
    assert shaken.years < usual.years
    still = due_date(state, replace(TYPE, drift=1e-12 * np.eye(24)), day)
    assert still.longest
    assert still.years == pytest.approx(LONGEST, rel=1e-3)
    # calibrated longer ago than any interval, whatever has been checked since: due on the day
    assert due_date(state, TYPE, day, calibrated=datetime.date(2019, 1, 1)).date == day
    with refused("input-value", name="reliability"):
        Requirement(reliability=2.0)


def test_status_of_a_fleet_says_it_all():
    jump = {(3, 4): 0.01 * CAUSES["magnetometer x offset"]}
    made = simulate_fleet(FleetScene(12, V12, calibrations=5, jumps=jump), seed=12)
    status = fleet_status(made.histories, reproducibility=False, own_drift=False)
    assert [t.due.date for t in status.tools] == sorted(t.due.date for t in status.tools)
    jumped = next(t for t in status.tools if t.history.serial == "SIM-0004")
    assert jumped.alarm.raised
    assert jumped.alarm.cause == "magnetometer x offset"
    assert jumped.follow
    assert "SIM-0004" in status.model.left_out
    assert all((t.checked <= t.now + 1e-12).all() for t in status.tools)
    newest = next(t for t in status.tools if t.last == max(h.date[-1] for h in made.histories))
    assert status.day == newest.last
    np.testing.assert_allclose(newest.now, azimuth_sd(newest.states[-1].covariance))
    table = status.to_dict()
    assert len({len(column) for column in table.values()}) == 1
    with refused("input-repeated", name="serial"):
        fleet_status([*made.histories, made.histories[0]])


def test_a_tool_is_as_uncertain_on_a_day_as_its_days_hours_and_doses_since_the_last_calibration_make_it():
    made = simulate_fleet(FleetScene(10, V12, calibrations=4, rigs=2, doses=(2.0, 50.0)), seed=14)
    idle = replace(made.histories[0], hours=np.zeros(4))
    lasts = sorted(h.date[-1] for h in made.histories)
    day = lasts[5] + datetime.timedelta(days=200)
    histories = [idle, *made.histories[1:], replace(made.histories[1].until(1), serial="new")]
    status = fleet_status(
        histories, day=day, calendar_share=0.5, effects=True, reproducibility=False, own_drift=False, iterations=2
    )
    model, six = status.model, plan_information(plans.six())
    states = {h.serial: found[-1] for h, found in zip(histories, drift_states(histories, model), strict=True)}
    assert sorted(t.history.serial for t in status.tools) == sorted(states)
    for tool in status.tools:
        history = tool.history
        lived = max((history.date[-1] - history.date[0]).days, 1) / 365.25
        worked = history.serial not in (idle.serial, "new")  # else taken to work as the others do
        hours = np.sum(history.hours[1:]) / lived if worked else model.hours_per_year
        doses = np.sum([np.array(x)[1:] for x in (history.shock, history.heat)], axis=1) / lived
        since = max((day - history.date[-1]).days, 0) / 365.25  # calibrated after that day: as it was then
        grown = states[history.serial].predicted(model, since, hours * since, doses * since)
        np.testing.assert_allclose(tool.now, azimuth_sd(grown.covariance), rtol=1e-9)
        np.testing.assert_allclose(tool.checked, azimuth_sd(after_check(grown.covariance, six, model.reproducibility)))
        due = due_date(states[history.serial], model, history.date[-1], hours_per_year=hours, doses_per_year=doses)
        assert tool.due.date == due.date
        assert tool.last == history.date[-1]
        assert len(tool.alarms) == len(history.date) - 1
    seen = [(rig, when) for h in histories for rig, when in zip(h.rig[1:], h.date[1:], strict=True)]
    recent = [rig for rig, when in seen if (day - when).days <= 365]
    assert min(recent.count(rig) for rig in set(recent)) >= 3
    assert len(recent) < len(seen)
    assert {one.rig: one.calibrations for one in status.rigs} == {rig: recent.count(rig) for rig in set(recent)}
    # a tool of one calibration has no alarm, and is nothing to follow up
    new = next(t for t in status.tools if t.history.serial == "new")
    assert new.alarm is None
    assert not new.follow


def test_verdicts_speak_in_units():
    test = last(FleetScene(3, V12), 13).test()
    alarms = judged(test, gaussian_maxima(np.linalg.inv(V12), 20_000))
    assert {one.finding.code for one in alarms} <= {"drift-fits", "drift-cause"}
