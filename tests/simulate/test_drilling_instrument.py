"""What an instrument makes of its fields: filter without delay, clipping, steps, biases, noise."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import signal
from tests.refusals import refused

from inclinometry.simulate.drilling import SCENARIOS, Scenario, simulate_drilling
from inclinometry.simulate.drilling.scenario import Band, Hole, Instrument, Rotation, TriadErrors, Vibration

RPM = math.tau / 60.0
EVERY = Instrument(factor=1, taps=1)
SHAKEN = Scenario(
    hole=Hole(heating=0.5),
    rotation=Rotation(300 * RPM),
    vibration=Vibration(Band(15.0, 200.0, 40.0, 2), Band(5.0, 80.0, 20.0)),
    instrument=EVERY,
)


def run(instrument, seed=1, duration=2.0, scenario=SHAKEN):
    return simulate_drilling(replace(scenario, instrument=instrument), seed, duration=duration)


@pytest.mark.parametrize(("factor", "taps", "cutoff"), [(10, 81, 80.0), (7, 41, 100.0), (4, 5, 200.0), (5, 1, 80.0)])
def test_rows_are_the_internal_samples_through_a_filter_without_delay(factor, taps, cutoff):
    every, rows = run(EVERY), run(Instrument(factor=factor, taps=taps, cutoff=cutoff))
    response = signal.firwin(taps, cutoff, fs=2000.0) if taps > 1 else np.ones(1)
    half = taps // 2
    for name in ("accel", "mag", "gyro"):
        filtered = signal.convolve(getattr(every, name), response[:, None], mode="valid", method="direct")
        inner = [k for k in range(len(rows)) if half <= k * factor < len(every) - half]
        expected = filtered[[k * factor - half for k in inner]]
        np.testing.assert_allclose(getattr(rows, name)[inner], expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(rows.time, every.time[::factor][: len(rows)], rtol=1e-15)
    np.testing.assert_array_equal(rows.truth.toolface, every.truth.toolface[::factor][: len(rows)])
    assert rows.interval == pytest.approx(factor / 2000.0)


def test_all_channels_and_the_truth_have_one_time():
    steady = Scenario(rotation=Rotation(600 * RPM), instrument=Instrument())
    rows = simulate_drilling(steady, 2, duration=2.0)
    accelerometer = np.arctan2(rows.accel[:, 1], -rows.accel[:, 0])
    np.testing.assert_allclose(np.exp(1j * accelerometer), np.exp(1j * rows.truth.toolface), atol=1e-12)
    phase = np.unwrap(np.angle(rows.mag[:, 0] + 1j * rows.mag[:, 1])) + np.unwrap(rows.truth.toolface)
    np.testing.assert_allclose(phase, phase[0], atol=1e-11)


def test_elements_clip_before_the_filter_and_rows_after_it():
    reach = 60.0
    clipping = Instrument(accel=TriadErrors(reach=reach))
    every = run(replace(clipping, factor=1, taps=1))
    free = run(EVERY)
    np.testing.assert_array_equal(every.accel, np.clip(free.accel, -reach, reach))
    hit = (np.abs(free.accel) >= reach).any(axis=1)
    np.testing.assert_array_equal(every.truth.clipped, hit)
    assert 0.01 < hit.mean() < 0.5
    rows = run(clipping)
    under = [hit[max(10 * k - 40, 0) : 10 * k + 41].any() for k in range(10, len(rows) - 10)]
    np.testing.assert_array_equal(rows.truth.clipped[10:-10], under)
    assert np.abs(rows.accel).max() <= reach
    assert not run(Instrument()).truth.clipped.any()


def test_steps_scale_bias_and_hard_iron():
    errors = TriadErrors(bias=(1.0, -2.0, 3.0), bias_per_kelvin=(0.1, 0.2, 0.3), scale=(0.01, 0.02, -0.03))
    spoilt, free = run(replace(EVERY, accel=errors, hard_iron=(100.0, 200.0, 300.0))), run(EVERY)
    warmer = 0.5 * free.time[:, None]
    expected = free.accel * [1.01, 1.02, 0.97] + [1.0, -2.0, 3.0] + warmer * [0.1, 0.2, 0.3]
    np.testing.assert_allclose(spoilt.accel, expected, atol=1e-12)
    np.testing.assert_allclose(spoilt.mag - free.mag, np.broadcast_to([100.0, 200.0, 300.0], free.mag.shape), atol=1e-9)
    np.testing.assert_allclose(free.temperature, 80.0 + warmer[:, 0])
    stepped = run(replace(EVERY, mag=TriadErrors(step=25.0))).mag
    np.testing.assert_allclose(stepped / 25.0, np.round(stepped / 25.0), atol=1e-9)
    assert np.abs(stepped - free.mag).max() <= 12.5 + 1e-9


def test_noise_has_its_deviation_in_the_rows_written():
    still = SCENARIOS["stationary"]
    rows = simulate_drilling(still, 4, duration=200.0)
    # 40 000 rows: 0.35 %
    np.testing.assert_allclose(rows.accel.std(axis=0), 0.003 * still.hole.gravity, rtol=0.02)
    np.testing.assert_allclose(rows.mag.std(axis=0), 50.0, rtol=0.02)
    np.testing.assert_allclose(rows.gyro.std(axis=0), 0.0, atol=1e-14)
    lag = np.sum(rows.mag[1:, 0] * rows.mag[:-1, 0] - rows.mag[1:, 0].mean() ** 2) / len(rows) / 2500.0
    assert abs(lag) < 0.05  # white


def test_random_walk_grows_with_the_root_of_time_across_chunks():
    drifting = Scenario(instrument=Instrument(rate=100.0, factor=1, taps=1, gyro=TriadErrors(walk=1e-3)))
    ends = []
    for seed in range(12):
        rows = simulate_drilling(drifting, seed, duration=900.0)
        ends.append(rows.gyro[-1] - rows.gyro[0])
        steps = np.diff(rows.gyro, axis=0)
        assert steps.std() == pytest.approx(1e-3 * math.sqrt(0.01), rel=0.02)
        assert np.abs(steps).max() < 7e-4  # no jump where chunks meet
    assert np.std(ends) == pytest.approx(0.03, rel=0.4)  # 36 values: 12 %


STEADY = Scenario(rotation=Rotation(240 * RPM), instrument=Instrument())


def test_a_collar_lets_the_transverse_field_through_late_and_weak():
    """A low-pass of the first order: atan(omega tau) late, 1 / sqrt(1 + (omega tau)^2) left; axially nothing."""
    plain, collar = (run(Instrument(eddy=eddy), scenario=STEADY) for eddy in (0.0, 2.5e-3))
    ratio = (collar.mag[:, 0] + 1j * collar.mag[:, 1]) / (plain.mag[:, 0] + 1j * plain.mag[:, 1])
    turned = 240 * RPM * 2.5e-3
    # the toolface grows clockwise, the field turns the other way round in the tool: late is ahead
    np.testing.assert_allclose(np.angle(ratio), math.atan(turned), atol=1e-6)
    np.testing.assert_allclose(np.abs(ratio), 1.0 / math.hypot(1.0, turned), rtol=2e-5)
    np.testing.assert_array_equal(collar.mag[:, 2], plain.mag[:, 2])
    np.testing.assert_array_equal(collar.accel, plain.accel)


def test_the_collar_remembers_over_the_blocks_of_a_run():
    swinging = replace(SCENARIOS["vibration-5g"], instrument=Instrument(eddy=2.5e-3))
    long, short = simulate_drilling(swinging, 1, duration=40.0), simulate_drilling(swinging, 1, duration=17.0)
    np.testing.assert_array_equal(long.mag[: len(short)], short.mag)
    steps = np.abs(np.diff(long.mag[:, 2], 2))
    assert steps.max() < 1e-6  # nothing jumps where one chunk ends


def test_coupling_is_a_matrix_by_its_rows():
    matrix = np.arange(9.0) * 1e-4
    plain, wrong = run(EVERY), run(replace(EVERY, accel=TriadErrors(coupling=tuple(matrix))))
    np.testing.assert_allclose(wrong.accel - plain.accel, plain.accel @ matrix.reshape(3, 3).T, atol=1e-9)
    with refused("input-shape", name="coupling"):
        TriadErrors(coupling=(1.0, 2.0))
