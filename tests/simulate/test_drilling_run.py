"""Runs, blocks and seeds: the same numbers however a run is cut; faults; refusals."""

import itertools
import math
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.simulate.drilling import SCENARIOS, Scenario, drilling_blocks, simulate_drilling
from inclinometry.simulate.drilling.run import DrillingTruth
from inclinometry.simulate.drilling.scenario import (
    Band,
    Casing,
    Dropped,
    Hole,
    Instrument,
    Jitter,
    MagLag,
    Repeated,
    Rotation,
    Shocks,
    StickSlip,
    Stuck,
    Swing,
    TriadErrors,
    Vibration,
    Whirl,
)

COLUMNS = ("time", "accel", "mag", "gyro", "temperature", "depth")
EVERYTHING = replace(
    SCENARIOS["whirl"],
    rotation=Rotation(20.0, StickSlip(0.2, 0.5), ripple=0.1, wander=0.1, torsion=Band(5.0, 30.0, 0.01)),
    hole=Hole(penetration=0.01, build=0.01, heating=0.01),
    instrument=replace(SCENARIOS["whirl"].instrument, gyro=TriadErrors(walk=1e-4, noise=1e-3, step=1e-6, reach=30.0)),
    faults=(MagLag(0.003), Stuck("accel_y", 3.0, 5.0), Jitter(1e-4), Dropped(0.01), Repeated(0.01), Casing(6.0, 8.0)),
)


def same(a, b):
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    for field in fields(DrillingTruth):
        np.testing.assert_array_equal(getattr(a.truth, field.name), getattr(b.truth, field.name), err_msg=field.name)


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_seed_gives_one_run_and_a_longer_run_begins_with_it(name):
    short, again = simulate_drilling(name, 5, duration=3.0), simulate_drilling(name, 5, duration=3.0)
    longer = simulate_drilling(name, 5, duration=20.0)  # into the second chunk
    same(short, again)
    same(short, longer.rows(slice(0, len(short))))
    assert len(short) == 600
    assert not np.array_equal(short.accel, simulate_drilling(name, 6, duration=3.0).accel)
    assert SCENARIOS[name].summary.endswith(".")


@pytest.mark.long
@settings(max_examples=6, deadline=None)
@given(block=st.integers(1, 9000))
def test_cutting_into_blocks_changes_no_bit(block):
    whole = simulate_drilling(EVERYTHING, 7, duration=36.0)
    blocks = drilling_blocks(EVERYTHING, 7, duration=36.0, block=max(block, 100))
    start = 0
    for part in blocks:
        same(part, whole.rows(slice(start, start + len(part))))
        start += len(part)
    assert start == len(whole)


def test_blocks_run_for_ever():
    blocks = drilling_blocks("stick-slip", 1, duration=math.inf, block=5000)
    sizes = {len(part) for part in itertools.islice(blocks, 20)}
    assert sizes == {5000}


def test_true_rows_lie_within_chunks_and_where_they_meet():
    # chunks meet every 3276 rows: the filter and the vibration must not notice
    run = simulate_drilling(replace(SCENARIOS["smooth"], instrument=Instrument()), 3)
    jumps = np.abs(np.diff(run.accel, n=4, axis=0)).max(axis=1)
    meeting = np.arange(3276, len(run) - 4, 3276)
    near = (meeting[:, None] + np.arange(-6, 4)).ravel()
    # 30 values of the same distribution as the 12 000 others
    assert jumps[near].max() <= np.delete(jumps, near).max()
    np.testing.assert_allclose(np.linalg.norm(run.mag, axis=1), 50_000.0, rtol=1e-4)


def test_seed_sequences_and_generators_are_seeds():
    whole = np.random.SeedSequence(4)
    same(simulate_drilling("smooth", whole, duration=0.1), simulate_drilling("smooth", whole, duration=0.1))
    generators = [np.random.default_rng(4), np.random.default_rng(4)]
    first, second = (simulate_drilling("smooth", generator, duration=0.1) for generator in generators)
    same(first, second)


def quiet(*faults, rotation=Rotation(12.0), **changes):  # noqa: B008
    scenario = Scenario(rotation=rotation, instrument=Instrument(factor=1, taps=1), faults=faults, **changes)
    return simulate_drilling(scenario, 2, duration=2.0)


@pytest.mark.parametrize("rotation", [Rotation(12.0), Rotation(12.0, Swing(0.5, 0.5), torsion=Band(5.0, 30.0, 0.02))])
def test_a_late_magnetometer_shows_what_was(rotation):
    on_time, late = quiet(rotation=rotation), quiet(MagLag(0.005), rotation=rotation)
    np.testing.assert_allclose(late.mag[10:], on_time.mag[:-10], atol=1e-6)
    same(replace(late, mag=on_time.mag), on_time)
    early = quiet(MagLag(-0.00025), rotation=rotation).mag[:-1]  # between two samples
    middle = 0.5 * (on_time.mag[1:] + on_time.mag[:-1])
    np.testing.assert_allclose(early, middle, atol=5.0)  # chord and arc: 50 000 (w h)^2 / 8


def test_lost_and_repeated_rows():
    whole, lost, twice = quiet(), quiet(Dropped(0.1)), quiet(Repeated(0.1))
    kept = np.isin(whole.time, lost.time)
    assert 0.85 < kept.mean() < 0.95
    same(lost, whole.rows(np.flatnonzero(kept)))
    assert np.isin(twice.time, whole.time).all()
    assert len(twice) == pytest.approx(1.1 * len(whole), rel=0.03)
    again = np.flatnonzero(np.diff(twice.time) == 0.0)
    np.testing.assert_array_equal(twice.accel[again], twice.accel[again + 1])


def test_jitter_moves_stamps_only():
    whole, shaky = quiet(), quiet(Jitter(2e-5))
    assert (shaky.time - whole.time).std() == pytest.approx(2e-5, rel=0.1)
    same(replace(shaky, time=whole.time), whole)


def test_a_stuck_channel_keeps_its_value():
    whole, stuck = quiet(), quiet(Stuck("mag_y", 0.5, 1.0))
    rows = (whole.time >= 0.5) & (whole.time < 1.0)
    np.testing.assert_array_equal(stuck.mag[rows, 1], whole.mag[np.argmax(rows), 1])
    np.testing.assert_array_equal(stuck.mag[~rows], whole.mag[~rows])
    np.testing.assert_array_equal(stuck.mag[:, [0, 2]], whole.mag[:, [0, 2]])


def test_casing_spoils_the_field_where_it_is():
    whole, cased = quiet(), quiet(Casing(0.5, 1.0, left=0.2, disturbance=10_000.0, period=0.2))
    rows = (whole.time >= 0.5) & (whole.time < 1.0)
    np.testing.assert_array_equal(cased.mag[~rows], whole.mag[~rows])
    added = cased.mag[rows] - 0.2 * whole.mag[rows]
    assert np.sqrt(np.mean(added**2)) == pytest.approx(10_000.0, rel=0.4)
    np.testing.assert_array_equal(cased.accel, whole.accel)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Hole(inclination=4.0), "input-value"),
        (lambda: Hole(field=float("nan")), "input-finite"),
        (lambda: Swing(1.2, 0.2), "input-value"),
        (lambda: StickSlip(0.95), "input-value"),
        (lambda: Rotation(10.0, Swing(0.98, 0.2), ripple=0.05), "input-value"),
        (lambda: Rotation(1e4), "input-value"),
        (lambda: Rotation(toolface=10.0), "input-value"),
        (lambda: Rotation(torsion=Band(5.0, 30.0, 0.1, 2)), "input-value"),
        (lambda: Band(20.0, 22.0, 1.0), "input-value"),
        (lambda: Band(20.0, 50.0, -1.0), "input-value"),
        (lambda: Shocks(1.0, 50.0, 20.0), "input-value"),
        (lambda: Whirl(200.0, 0.01), "input-value"),
        (lambda: TriadErrors(bias=(1.0, 2.0)), "input-shape"),
        (lambda: TriadErrors(reach=0.0), "input-value"),
        (lambda: Instrument(taps=80), "input-value"),
        (lambda: Instrument(factor=2.5), "input-kind"),
        (lambda: Instrument(cutoff=1000.0), "input-value"),
        (lambda: Scenario(vibration=Vibration(Band(15.0, 950.0, 1.0))), "input-value"),
        (lambda: MagLag(1.0), "input-value"),
        (lambda: Dropped(1.0), "input-value"),
        (lambda: Stuck("temperature"), "input-choice"),
        (lambda: Casing(5.0, 5.0), "input-value"),
        (lambda: simulate_drilling("spinning", 1), "input-choice"),
        (lambda: simulate_drilling("smooth", 1, duration=0.0), "input-value"),
        (lambda: simulate_drilling("smooth", 1, duration=math.inf), "input-value"),
        (lambda: drilling_blocks("smooth", 1, block=0), "input-value"),
        (lambda: simulate_drilling(Scenario(hole=Hole(0.1, penetration=1.0, build=-0.1)), 1), "input-value"),
        (lambda: simulate_drilling("smooth", -1), "input-value"),
    ],
)
def test_impossible_settings_are_refused_when_given(build, message):
    with refused(message):
        build()
