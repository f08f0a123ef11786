"""One kinematics behind three triads, against finite differences and direction cosines."""

import math
from dataclasses import replace

import numpy as np
import pytest

from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.earth.rate import earth_rate
from inclinometry.rotations import dcm, rotation_exp
from inclinometry.simulate.drilling import SCENARIOS, Scenario, simulate_drilling
from inclinometry.simulate.drilling.scenario import (
    Band,
    Hole,
    Instrument,
    Rotation,
    Shocks,
    StickSlip,
    Swing,
    Vibration,
    Whirl,
)

RPM = math.tau / 60.0
EVERY = Instrument(factor=1, taps=1)
TURNING = {
    "steady": Rotation(120 * RPM),
    "swing": Rotation(120 * RPM, Swing(0.8, 0.2), ripple=0.05),
    "stick-slip": Rotation(200 * RPM, StickSlip(1 / 3, 0.4), ripple=0.05),
    "sliding": Rotation(wander=0.1, torsion=Band(3.0, 30.0, 0.01)),
    "all": Rotation(-60 * RPM, Swing(0.5, 0.3), ripple=0.1, toolface=1.0, wander=0.2, torsion=Band(5.0, 40.0, 0.01)),
}


def scenario(rotation=Rotation(), instrument=EVERY, hole=Hole(), vibration=Vibration()):  # noqa: B008
    return Scenario(hole=hole, rotation=rotation, vibration=vibration, instrument=instrument)


def cosines(run):
    return dcm(run.truth.azimuth, run.truth.inclination, run.truth.toolface)


@pytest.mark.parametrize("name", TURNING)
def test_fields_are_those_of_the_true_attitude(name):
    hole = Hole(inclination=0.4, azimuth=2.0, dip=1.0, field=48_000.0, gravity=9.8, latitude=0.7, declination=0.1)
    run = simulate_drilling(scenario(TURNING[name], hole=hole), 3, duration=2.0)
    c = cosines(run)
    # 20 turns: the toolface is known to 1e-14 rad, fields to 1e-13 of their strength
    np.testing.assert_allclose(run.accel, c @ [0.0, 0.0, 9.8], atol=1e-11)
    np.testing.assert_allclose(run.mag, 48_000.0 * c @ [np.cos(1.0), 0.0, np.sin(1.0)], atol=1e-7)
    # true north lies at azimuth -declination in the magnetic frame
    true = dcm(run.truth.azimuth + 0.1, run.truth.inclination, run.truth.toolface)
    np.testing.assert_allclose(run.gyro[:, :2], (true @ earth_rate(0.7))[:, :2], atol=1e-15)


@pytest.mark.parametrize("name", TURNING)
def test_the_gyro_integrates_to_the_true_toolface(name):
    run = simulate_drilling(scenario(TURNING[name]), 4, duration=3.0)
    rate = run.gyro[:, 2] - (cosines(run) @ earth_rate(Hole().latitude))[:, 2]
    # Simpson over pairs of intervals, h^4/180 w'''': 30 Hz torsion of 1 rad/s gives 1e-9 rad
    steps = run.interval / 3.0 * (rate[:-2:2] + 4.0 * rate[1:-1:2] + rate[2::2])
    truth = np.unwrap(run.truth.toolface)[::2]
    np.testing.assert_allclose(np.cumsum(steps)[: truth.size - 1], truth[1:] - truth[0], atol=2e-7)


def test_gyro_vectors_multiply_up_to_the_attitude_of_a_bending_hole():
    hole = Hole(inclination=0.3, azimuth=1.0, penetration=0.5, build=0.2, turn=0.3)
    run = simulate_drilling(scenario(TURNING["swing"], hole=hole), 5, duration=1.0)
    c = cosines(run)
    body = run.gyro - c @ earth_rate(hole.latitude)
    middle = 0.5 * (body[1:] + body[:-1]) * run.interval
    steps = c[1:] @ np.swapaxes(c[:-1], -1, -2)
    # C(t + h) = exp(-[w h x]) C(t); the trapezoid leaves h^3/12 w'' = 1e-11 x 2000 and coning of the same order
    np.testing.assert_allclose(steps, rotation_exp(-middle), atol=5e-8)
    assert run.truth.inclination[-1] == pytest.approx(0.3 + 0.1 * run.time[-1])
    assert run.truth.azimuth[-1] == pytest.approx(1.0 + 0.15 * run.time[-1])
    assert run.depth[-1] - run.depth[0] == pytest.approx(0.5 * run.time[-1])


@pytest.mark.parametrize("name", TURNING)
def test_the_lever_arm_agrees_with_finite_differences_of_the_position(name):
    lever = np.array([0.02, 0.01, -0.3])
    hole = Hole(penetration=0.5, build=0.2, turn=0.3)
    still = simulate_drilling(scenario(TURNING[name], hole=hole), 6, duration=1.0)
    run = simulate_drilling(scenario(TURNING[name], replace(EVERY, lever=tuple(lever)), hole), 6, duration=1.0)
    c = cosines(run)
    place = np.swapaxes(c, -1, -2) @ lever
    acceleration = (place[2:] - 2.0 * place[1:-1] + place[:-2]) / run.interval**2
    sensed = (c[1:-1] @ acceleration[..., None])[..., 0]
    # second differences: h^2/12 of the fourth derivative, 1.3e-3 of the acceleration at 40 Hz; rounding 1e-9
    size = np.abs(sensed).max()
    np.testing.assert_allclose((still.accel - run.accel)[1:-1], sensed, atol=2e-3 * size + 1e-7)
    assert size > 1e-3


def test_steady_rotation_throws_outwards():
    lever = (0.02, 0.0, 0.0)
    run = simulate_drilling(scenario(Rotation(600 * RPM), replace(EVERY, lever=lever), Hole(0.0)), 1, duration=0.1)
    # apparent gravity points outwards, as for a passenger: + w^2 r
    np.testing.assert_allclose(run.accel[:, 0], (600 * RPM) ** 2 * 0.02, rtol=1e-12)


def test_stick_slip_really_sticks_and_reaches_three_times_the_mean():
    run = simulate_drilling(scenario(Rotation(200 * RPM, StickSlip(1 / 3, 0.2))), 2, duration=20.0)
    rate = run.truth.rate / RPM
    assert (rate == 0.0).mean() == pytest.approx(1 / 3, abs=1e-3)
    assert rate.max() == pytest.approx(600.0, rel=1e-6)
    assert rate.mean() == pytest.approx(200.0, rel=1e-6)  # four whole periods
    assert rate.min() == 0.0
    rippled = simulate_drilling(SCENARIOS["stick-slip"], 2).truth.rate / RPM
    # the ripple may reverse the rotation by no more than a hair while it dies
    assert rippled.min() > -1e-3
    assert rippled.max() < 620.0


def test_a_swing_has_the_speeds_of_its_formula():
    run = simulate_drilling("vibration-5g", 3)
    rate = run.truth.rate / RPM
    assert rate.min() == pytest.approx(24.0, abs=6.5)
    assert rate.max() == pytest.approx(216.0, abs=6.5)
    assert rate.mean() == pytest.approx(120.0, rel=1e-3)
    # without the ripple the residual of mean and 0.2 Hz is nothing
    tones = np.exp(-2j * np.pi * np.outer([0.2, 7.0], run.time))
    amplitude = np.abs(tones @ rate) * 2.0 / len(rate)
    np.testing.assert_allclose(amplitude, [96.0, 6.0], rtol=1e-6)


def test_wandering_has_its_rms_over_many_runs():
    quiet = scenario(Rotation(wander=0.2), Instrument(rate=10.0, factor=1, taps=1))
    spread = [np.unwrap(simulate_drilling(quiet, seed, duration=2000.0).truth.toolface).std() for seed in range(10)]
    assert np.mean(spread) == pytest.approx(0.2, rel=0.1)  # ten periods of the slowest of eight tones


def test_the_toolface_starts_where_told_and_otherwise_anywhere():
    told = [simulate_drilling(scenario(TURNING["all"]), s, duration=0.01) for s in range(3)]
    swung = scenario(Rotation(10.0, Swing(0.5, 0.1), toolface=1.0))
    quiet = [simulate_drilling(swung, s, duration=0.01) for s in (1, 2)]
    assert [run.truth.toolface[0] for run in quiet] == pytest.approx([1.0, 1.0])
    assert len({run.truth.toolface[0] for run in told}) == 3
    drawn = [simulate_drilling(scenario(), s, duration=0.01).truth.toolface[0] for s in range(40)]
    assert min(drawn) < 1.0
    assert max(drawn) > 5.0


def test_whirl_is_the_acceleration_of_a_circling_axis():
    rotation, whirl = Rotation(120 * RPM, Swing(0.5, 0.5)), Whirl(-8.0, 0.004)
    run = simulate_drilling(scenario(rotation, hole=Hole(0.0), vibration=Vibration(whirl=whirl)), 7, duration=1.0)
    # in the axes of the hole, as a complex number; apparent gravity has the opposite sign
    turned = np.unwrap(run.truth.toolface)
    sensed = -(run.accel[:, 0] + 1j * run.accel[:, 1]) * np.exp(1j * turned)
    start = np.angle(-sensed[0] * np.exp(8j * turned[0]))  # the centripetal part dominates
    circle = 0.004 * np.exp(1j * (start - 8.0 * turned))
    acceleration = (circle[2:] - 2.0 * circle[1:-1] + circle[:-2]) / run.interval**2
    # second differences h^2/12 w^2 = 5e-4 at 24 Hz; the start is found to the ratio f''/f'^2 = 0.02
    np.testing.assert_allclose(np.abs(sensed[1:-1]), np.abs(acceleration), rtol=2e-3, atol=0.01)
    np.testing.assert_allclose(sensed[1:-1], acceleration, atol=0.06 * np.abs(acceleration).max())


def test_synchronous_forward_whirl_hides_in_a_constant():
    whirl = Vibration(whirl=Whirl(1.0, 0.01))
    run = simulate_drilling(scenario(Rotation(120 * RPM), hole=Hole(0.0), vibration=whirl), 7, duration=1.0)
    np.testing.assert_allclose(run.accel[:, :2], np.broadcast_to(run.accel[0, :2], (2000, 2)), atol=1e-11)
    assert np.hypot(*run.accel[0, :2]) == pytest.approx(0.01 * (120 * RPM) ** 2)


def test_contacts_push_to_the_middle_of_the_hole():
    blows = Shocks(20.0, 100.0, 100.0)
    base = scenario(Rotation(60 * RPM), hole=Hole(0.0), vibration=Vibration(whirl=Whirl(-4.0, 0.01, blows)))
    without = replace(base, vibration=Vibration(whirl=Whirl(-4.0, 0.01)))
    run, bare = (simulate_drilling(s, 8, duration=2.0) for s in (base, without))
    outwards = bare.accel[:, :2] / np.hypot(*bare.accel[:, :2].T)[:, None]  # as thrown by the circle
    push = np.sum((run.accel - bare.accel)[:, :2] * outwards, axis=1)
    # apparent gravity: a push inwards is sensed outwards, first; a pulse of 3 ms at 4 Hz of whirl turns by 4 deg
    starts = np.flatnonzero((np.abs(push) > 1.0) & (np.abs(np.roll(push, 1)) <= 1.0))
    assert starts.size > 20
    assert (push[starts] > 0.0).mean() > 0.9  # a blow may run into another, or into the run
    assert np.abs(push).max() == pytest.approx(100.0, rel=0.01)


def test_gravity_is_the_standard_one_unless_given():
    run = simulate_drilling(scenario(), 1, duration=0.01)
    np.testing.assert_allclose(np.linalg.norm(run.accel, axis=1), STANDARD_GRAVITY, rtol=1e-14)
