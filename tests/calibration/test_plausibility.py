"""Bench readings as a whole: one mistake of the file is named; right runs and second visits pass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.calibration.acceptance import verify
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.plausibility import check_readings, check_whole, refuse_own_readings, taken_before
from inclinometry.calibration.readings import BenchReadings
from inclinometry.errors import InputError
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import realistic_tool

PLAN = plans.orthogonal()


def run(seed=1, plan=PLAN, dials_deg=0.1, order=None):
    rig = Rig(dip=np.radians(70.0), setting_sd=np.radians(dials_deg), base_tilt=0.01, north_offset=0.02)
    noise = {"accelerometer": 0.5, "magnetometer": 0.5, "gyro": 0.5}
    tool = realistic_tool(3)
    found = simulate_bench(
        tool, rig, plan.azimuth, plan.inclination, plan.toolface, noise={k: noise[k] for k in tool.triads}, seed=seed
    )
    rows = np.arange(len(plan.azimuth)) if order is None else np.asarray(order)
    channels = {kind: np.array(found.signals[kind][rows]) for kind in ("accelerometer", "magnetometer")}
    dials = (dial[rows] for dial in (found.azimuth, found.inclination, found.toolface))
    return BenchReadings(channels, *dials, reference={"dip": np.radians(70.0)})


@pytest.mark.parametrize("plan", [plans.twelve(), PLAN, plans.two_face()])
@pytest.mark.parametrize("dials_deg", [0.1, 0.5])
def test_right_runs_pass(plan, dials_deg):
    for seed in range(4):
        assert check_whole(run(seed, plan, dials_deg)) == []


@pytest.mark.parametrize(
    ("dial", "words"),
    [("azimuth", "azimuths in grads"), ("inclination", "inclinations in grads"), ("toolface", "toolfaces in grads")],
)
def test_a_dial_in_grads(dial, words):
    right = run()
    with pytest.raises(InputError, match=words):
        check_whole(replace(right, **{dial: getattr(right, dial) / 0.9}))


def test_two_stations_exchanged():
    right = run()
    rows = np.arange(24)
    rows[[4, 9]] = 9, 4
    channels = {kind: values[rows] for kind, values in right.channels.items()}
    with pytest.raises(InputError, match=r"the readings of stations 5 and 10 exchanged"):
        check_whole(replace(right, channels=channels))
    azimuth = right.azimuth.copy()
    other = int(np.argmax(np.abs(np.sin((azimuth - azimuth[2]) / 2.0))))
    azimuth[[2, other]] = azimuth[[other, 2]]
    with pytest.raises(InputError, match=f"stations 3 and {other + 1} exchanged"):
        calibrate_joint(replace(right, azimuth=azimuth))


@pytest.mark.parametrize(
    ("channels", "words"), [(slice(None), "the magnetometer 0.5 times"), (1, "magnetometer y 0.5")]
)
def test_a_gain_that_halves_midway(channels, words):
    right = run()
    values = right.channels["magnetometer"].copy()
    values[13:, channels] *= 0.5
    with pytest.raises(InputError, match=rf"{words}.* from station 1[34] on"):
        check_whole(replace(right, channels={**right.channels, "magnetometer": values}))


def test_a_slow_drift_is_warned_of():
    right = run()
    values = right.channels["magnetometer"].copy()
    values += np.linspace(0.0, 0.05 * np.ptp(values), 24)[:, None]
    said = check_whole(replace(right, channels={**right.channels, "magnetometer": values}))
    assert len(said) == 1
    assert "the offsets of the magnetometer drift" in said[0]


def test_the_readings_of_the_calibration_are_known_by_value():
    first = run(1)
    found = calibrate_joint(first)
    order = np.random.default_rng(2).permutation(24)
    shaken = {k: v[order] + np.random.default_rng(3).uniform(-0.3, 0.3, v.shape) for k, v in first.channels.items()}
    copy = BenchReadings(shaken, *(dial[order] for dial in first.dials), reference=first.reference)
    with pytest.raises(InputError, match="in another order or hardly changed"):
        verify(copy, found)
    assert not any(taken_before(run(seed), found) for seed in range(2, 12))


@pytest.mark.parametrize("plan", [PLAN, plans.half(), plans.two_face()])
@pytest.mark.parametrize("channel", [0, 2])
def test_a_channel_clipped_at_both_ends_does_not_drift(plan, channel):
    right = run(plan=plan)
    values = right.channels["magnetometer"].copy()
    limit = 0.8 * np.abs(values[:, channel]).max()
    values[:, channel] = np.clip(values[:, channel], -limit, limit)
    said = check_whole(replace(right, channels={**right.channels, "magnetometer": values}))
    assert not [sentence for sentence in said if "drift" in sentence]


@pytest.mark.parametrize("plan", [plans.twelve(), PLAN, plans.half()])
@pytest.mark.parametrize("channels", [slice(None), 1])
def test_gains_that_drift_are_named(plan, channels):
    right = run(plan=plan)
    slope = np.linspace(1.0, 1.3, len(right))
    values = right.channels["magnetometer"].copy()
    values[:, channels] *= slope if channels == 1 else slope[:, None]
    with pytest.raises(InputError, match=r"the gains of the magnetometer drift by 2[0-9] % of themselves"):
        check_whole(replace(right, channels={**right.channels, "magnetometer": values}))


@pytest.mark.parametrize("plan", [plans.twelve(), PLAN])
@pytest.mark.parametrize(
    ("dials", "columns"),
    [
        (["azimuth"], "azimuth_rad"),
        (["inclination"], "inclination_rad"),
        (["toolface"], "toolface_rad"),
        (["azimuth", "inclination", "toolface"], "azimuth_rad and inclination_rad and toolface_rad"),
    ],
)
def test_dials_in_radians(plan, dials, columns):
    right = run(plan=plan)
    with pytest.raises(InputError, match=rf"in radians the readings fit .* as {columns}$"):
        check_readings(replace(right, **{dial: np.radians(getattr(right, dial)) for dial in dials}))


def test_two_readings_of_the_calibration_are_known_by_value():
    found = calibrate_joint(run(1))
    own, other = run(1), run(5, plans.half())
    verify(other, found)
    channels = {kind: values.copy() for kind, values in other.channels.items()}
    dials = {name: getattr(other, name).copy() for name in ("azimuth", "inclination", "toolface")}
    for here, there in ((2, 7), (9, 20)):
        for kind, values in channels.items():
            values[here] = own.channels[kind][there]
        for name, values in dials.items():
            values[here] = getattr(own, name)[there]
    with pytest.raises(InputError, match="stations 3, 10 are to the last digit those of stations 8, 21"):
        verify(replace(other, channels=channels, **dials), found)


def test_a_stand_whose_errors_repeat_is_no_copy():
    # the same dials' errors twice, noise of half a count alone between both visits
    found = calibrate_joint(run(1))
    other = run(1)
    shaken = {k: v + np.random.default_rng(4).normal(0.0, 0.5, v.shape) for k, v in other.channels.items()}
    again = BenchReadings({k: v[:5] for k, v in shaken.items()}, *(dial[:5] for dial in other.dials))
    refuse_own_readings(again, found)
