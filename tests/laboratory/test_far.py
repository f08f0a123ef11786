"""Captures far from the target: told by a calibration, taken with a reason only; right runs are never blocked."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.calibration.plausibility import misfit
from inclinometry.laboratory.attitude import FarError, Judge, at_target, off_target
from inclinometry.laboratory.progress import Goal, judge_of, session_progress
from inclinometry.laboratory.registry import RegisteredRig
from inclinometry.laboratory.session import Capture, Position, RecordedReading, Session
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import realistic_tool
from inclinometry.workflow.plan import make_plan

WRONG = {1: -80.0, 2: 40.0, 3: 90.0}
"""Position -> deg by which its toolface is off, as a trial of the bench had it."""


def hand_session(plan):
    positions = tuple(Position(n, tuple(row)) for n, row in enumerate(settings_of(plan), 1))
    return Session("s", "IN-7", "calibrate", plan.name, positions, "by hand", "", "", {}, {}, "", {})


def settings_of(plan):
    return np.stack([plan.azimuth, plan.inclination, plan.toolface], axis=1).tolist()


def with_reading(session, number, reading):
    taken = RecordedReading(str(number), number, 1, "", "", reading)
    return replace(session, taken={**session.taken, number: taken})


def seen_at(tool, setting, sd, seed, off=(0.0, 0.0, 0.0)):
    """The mean of fifty samples at a setting whose dials have errors of a standard deviation."""
    true = [[angle + more] for angle, more in zip(setting, off, strict=True)]
    stand = Rig(dip=np.radians(70.0), setting_sd=(sd,) * 3)
    run = simulate_bench(tool, stand, *true, seed=np.random.SeedSequence(seed))
    spread = {kind: np.sqrt(50.0) * tool.noise[kind] for kind in run.signals}
    return Capture({kind: values[0] for kind, values in run.signals.items()}, tuple(setting), 50, sd=spread)


def judge_by(plan, tool, sd, seed):
    """A calibration of minutes before."""
    session = hand_session(plan)
    for position in session.positions:
        session = with_reading(session, position.number, seen_at(tool, position.dial, sd, [seed, 1, position.number]))
    return Judge(session_progress(session, Goal(), RegisteredRig("by hand", (sd,) * 3)).calibration, "2026-11-26")


def blocked_in_a_right_run(plan, sd, seed, *, known):
    """How many captures of a right run are called far, and how many there were to be judged."""
    tool = realistic_tool(seed)
    earlier = judge_by(plans.twelve(), tool, sd, seed) if known else None
    session, now, far, judged = hand_session(plan), None, 0, 0
    clamped = (0.0, 0.0, np.radians(0.2))  # not quite as it was before
    for position in session.positions:
        reading = seen_at(tool, position.dial, sd, [seed, 2, position.number], clamped)
        judge = judge_of(earlier, now)
        off = None if judge is None else off_target(judge, session, (sd,) * 3, reading)
        judged, far = judged + (off is not None), far + (off is not None and off.far)
        session = with_reading(session, position.number, reading)
        now = session_progress(session, Goal(), RegisteredRig("by hand", (sd,) * 3), earlier=earlier)
    return far, judged


@pytest.fixture(scope="module")
def by_hand():
    """A tool, a rig good to a degree, and a calibration made on it minutes before."""
    tool, sd = realistic_tool(5), float(np.radians(1.0))
    return SimpleNamespace(tool=tool, sd=sd, judge=judge_by(plans.twelve(), tool, sd, 5))


def test_wrong_positions_are_told_from_their_targets_and_recorded_with_the_reason_only(by_hand):
    session = hand_session(plans.twelve())
    for number, off_deg in WRONG.items():
        dial = session.positions[number - 1].dial
        seen = seen_at(by_hand.tool, dial, by_hand.sd, [5, 3, number], (0.0, 0.0, np.radians(off_deg)))
        off = off_target(by_hand.judge, session, (by_hand.sd,) * 3, seen)
        assert off.far
        assert np.degrees(off.rotation) == pytest.approx(abs(off_deg), abs=4.0)
        assert [one.values["dial"] for one in off.dials] == ["toolface"]
        with pytest.raises(FarError) as told:
            at_target(seen, by_hand.judge, session, (by_hand.sd,) * 3)
        assert (told.value.finding.code, told.value.finding.values["dials"]) == ("ledger-far-from-target", off.dials)
        # turned until it agrees, a tool that has changed would pass its verification
        with pytest.raises(FarError) as told:
            at_target(seen, by_hand.judge, replace(session, purpose="verify"), (by_hand.sd,) * 3)
        assert told.value.finding.code == "ledger-far-verifying"
        with pytest.raises(FarError):
            at_target(seen, by_hand.judge, session, (by_hand.sd,) * 3, "  ")
        note = at_target(seen, by_hand.judge, session, (by_hand.sd,) * 3, "the collet slipped").note
        assert note == f"{off.dials[0]}: the collet slipped"
        right = seen_at(by_hand.tool, dial, by_hand.sd, [5, 4, number])
        assert at_target(right, by_hand.judge, session, (by_hand.sd,) * 3) is right


def test_what_is_far_hangs_on_the_calibration_the_reading_and_the_dials(by_hand):
    """4 deg are four standard deviations of a rig good to 1 deg; of one good to 0.1 deg they are more."""
    session, dial = hand_session(plans.twelve()), tuple(np.radians([0.0, 90.0, 120.0]))
    noiseless = replace(by_hand.tool, noise={kind: 0.0 * sd for kind, sd in by_hand.tool.noise.items()})
    for name, size in (("azimuth", 4.0), ("inclination", 4.0), ("toolface", 4.0)):
        off = [np.radians(size) if one == name else 0.0 for one in ("azimuth", "inclination", "toolface")]
        seen = seen_at(noiseless, dial, 0.0, 1, off)
        coarse, fine = (off_target(by_hand.judge, session, (sd,) * 3, seen) for sd in np.radians([1.0, 0.1]))
        assert np.degrees(coarse.rotation) == pytest.approx(size, abs=1.5)  # what the calibration leaves
        assert not coarse.far
        assert fine.deviations > 1.5 * coarse.deviations
        assert name in [one.values["dial"] for one in fine.dials]


def test_a_calibration_that_says_nothing_blocks_nothing(by_hand):
    """Channels of another tool, and a running fit that does not determine the attitude."""
    session = hand_session(plans.twelve())
    seen = seen_at(by_hand.tool, session.positions[0].dial, by_hand.sd, 1, (0.0, 0.0, 1.5))
    alone = replace(seen, channels={"accelerometer": seen.channels["accelerometer"]})
    assert at_target(alone, by_hand.judge, session, (by_hand.sd,) * 3) is alone
    assert at_target(seen, None, session, (by_hand.sd,) * 3) is seen
    vague = replace(by_hand.judge.calibration, covariance=1e4 * by_hand.judge.calibration.covariance)
    assert at_target(seen, Judge(vague, ""), session, (by_hand.sd,) * 3) is seen


def test_an_earlier_calibration_names_the_positions_of_a_fit_that_refuses(by_hand):
    """Seven positions alone do not tell which of them are wrong."""
    session, about = hand_session(plans.twelve()), RegisteredRig("by hand", (by_hand.sd,) * 3)
    for position in session.positions[:7]:
        off = (0.0, 0.0, np.radians(WRONG.get(position.number, 0.0)))
        seen = seen_at(by_hand.tool, position.dial, by_hand.sd, [5, 3, position.number], off)
        session = with_reading(session, position.number, seen)
    alone = session_progress(session, Goal(), about)
    assert alone.calibration is None
    assert not alone.outliers
    named = session_progress(session, Goal(), about, earlier=by_hand.judge)
    assert list(named.outliers) == [1, 2, 3]
    assert (named.outliers[2].code, named.outliers[2].values["station"]) == ("ledger-station-far", 2)
    assert named.waiting == misfit(["1", "2", "3"])


def test_a_tool_that_is_another_than_its_calibration_says_is_no_row_of_outliers(by_hand):
    """Clamped a quarter of a turn from where it was: every position is far, none is named."""
    session, about = hand_session(plans.twelve()), RegisteredRig("by hand", (by_hand.sd,) * 3)
    for position in session.positions:
        seen = seen_at(by_hand.tool, position.dial, by_hand.sd, [5, 6, position.number], (0.0, 0.0, np.radians(90.0)))
        session = with_reading(session, position.number, seen)
    assert all(off_target(by_hand.judge, session, about.sd, row.capture).far for row in session.valid)
    assert not session_progress(session, Goal(), about, earlier=by_hand.judge).outliers


def test_a_right_run_is_never_blocked():
    """With a calibration before it and with its own fit alone, on a rig turned by hand and on a precise one."""
    counts = np.array([
        blocked_in_a_right_run(plans.twelve(), float(np.radians(sd)), 11, known=known)
        for sd, known in ((1.0, True), (0.01, False))
    ])  # fmt: skip
    assert counts[:, 0].tolist() == [0, 0]
    assert counts[0, 1] == 12
    assert counts[1, 1] >= 3


@pytest.mark.long
@pytest.mark.parametrize("name", ["twelve", "orthogonal", "half", "two-face", "rotations"])
@pytest.mark.parametrize("sd_deg", [0.01, 0.1, 0.5, 1.0, 2.0])
def test_right_runs_of_many_plans_and_rigs_are_never_blocked(name, sd_deg):
    for seed, known in ((21, True), (22, False)):
        assert blocked_in_a_right_run(make_plan(name), float(np.radians(sd_deg)), seed, known=known)[0] == 0
