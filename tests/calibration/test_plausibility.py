"""Bench readings as a whole: one mistake of the file is named; right runs and second visits pass."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from inclinometry.calibration import plans
from inclinometry.calibration.acceptance import Limits, verify
from inclinometry.calibration.expected import absurd_uncertainty
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.plausibility import (
    check_readings,
    check_whole,
    refuse_own_readings,
    repeated_noise,
    taken_before,
)
from inclinometry.calibration.readings import BenchReadings
from inclinometry.errors import InputError
from inclinometry.rotations import dcm
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import realistic_tool

PLAN = plans.orthogonal()


def run(seed=1, plan=PLAN, dials_deg=0.1, order=None):
    rig = Rig(dip=np.radians(70.0), setting_sd=np.radians(dials_deg), base_tilt=0.01, tilt_axis=0.5, north_offset=0.02)
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
    rows = np.arange(24)
    rows[[4, 9]] = 9, 4
    # on a poor stand they fit only some ten times better, which is as certain
    for right in (run(dials_deg=1.5), run()):
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


@pytest.mark.parametrize(("start", "gain"), [(3, 0.5), (21, 0.1), (16, 2.0), (16, 10.0)])
def test_a_gain_that_changes_is_named_with_its_station_and_size(start, gain):
    """From the fourth station to the third last: fewer are as well explained by themselves."""
    right = run()
    values = right.channels["magnetometer"].copy()
    values[start:, 1] *= gain
    with pytest.raises(
        InputError, match=rf"the magnetometer y {gain:g} times as sensitive from station {start + 1} on"
    ):
        check_whole(replace(right, channels={**right.channels, "magnetometer": values}))


def left(readings, kind):
    """Share of the field that a linear triad in one field leaves, the direction searched for."""
    values = readings.channels[kind] / (np.sqrt(3.0) * readings.channels[kind].std(axis=0))
    turns = dcm(*readings.dials)

    def rms(angles):
        up, east = angles
        field = [np.cos(up) * np.cos(east), np.cos(up) * np.sin(east), np.sin(up)]
        design = np.column_stack([turns @ field, np.ones(len(turns))])
        return np.sqrt(np.mean((values - design @ np.linalg.lstsq(design, values, rcond=None)[0]) ** 2))

    starts = [(up, east) for up in (-1.0, 0.3, 1.2) for east in (0.0, 2.0, 4.0)]
    return min(minimize(rms, start, method="Nelder-Mead", options={"xatol": 1e-6}).fun for start in starts)


def test_how_much_better_and_how_much_is_unexplained_is_said():
    right = run()
    wrong = replace(right, azimuth=right.azimuth / 0.9)
    with pytest.raises(InputError) as caught:
        check_whole(wrong)
    times, power, share = (
        float(re.search(pattern, str(caught.value)).group(1))
        for pattern in (r"fit (\d+) times better", r"likelihood ratio 1e(\d+)", r"leave ([\d.]+) % of the field")
    )
    given = {kind: left(wrong, kind) for kind in wrong.channels}
    best = {kind: left(right, kind) for kind in wrong.channels}
    assert "unexplained in the magnetometer" in str(caught.value)
    assert share == pytest.approx(100.0 * given["magnetometer"], rel=0.03)  # said to two digits
    assert times == pytest.approx(max(given[kind] / best[kind] for kind in given), rel=0.05)
    # of normal noise of unknown size: 72 readings of each triad less its 14 parameters
    ratio = sum(58 * np.log(given[kind] / best[kind]) for kind in given) / np.log(10.0)
    assert power == pytest.approx(min(ratio, 99.0), abs=2.0)


@pytest.mark.parametrize("what", ["offsets", "gains"])
def test_how_much_it_drifts_is_said_from_what_matters_to_what_leaves_no_calibration(what):
    right = run()
    slope = np.linspace(-0.5, 0.5, 24)[:, None]

    def drifted(size):
        values = right.channels["magnetometer"].copy()
        field = np.sqrt(3.0) * values.std(axis=0)
        values = values + size * slope * field if what == "offsets" else values * (1.0 + size * slope)
        return replace(right, channels={**right.channels, "magnetometer": values})

    least = {"offsets": 0.004, "gains": 0.01}[what]
    assert check_whole(drifted(0.8 * least)) == []
    for size in (1.3 * least, 0.03, 0.08):
        (said,) = check_whole(drifted(size))
        assert f"the {what} of the magnetometer drift by" in said
        # to two digits, beside noise of 1 in 4000 and dials of 0.1 deg
        found = float(re.search(r"drift by ([\d.]+) %", said).group(1))
        assert found == pytest.approx(100.0 * size, rel=0.05, abs=0.06)
    with pytest.raises(InputError, match=rf"the {what} of the magnetometer drift by 1[2-4] %"):
        check_whole(drifted(0.13))


def test_one_station_that_is_wrong_is_no_exchange_of_two():
    right = run()
    channels = {kind: values.copy() for kind, values in right.channels.items()}
    for values in channels.values():
        values[4] = values[9]
    assert not [said for said in check_whole(replace(right, channels=channels)) if "exchanged" in said]
    # too few stations to tell anything: no word
    assert check_whole(replace(right, azimuth=right.azimuth / 0.9).take(range(7))) == []
    check_readings(replace(right, azimuth=np.radians(right.azimuth)).take(range(7)))


def test_most_readings_of_the_calibration_among_others_are_known():
    """From 70 in 100 of them on, where another visit agrees once by chance; of a few nothing can be said."""
    first, other = run(1), run(5)
    found = calibrate_joint(first)
    for copied, known in ((17, True), (13, False)):
        own = np.arange(24) < copied
        channels = {k: np.where(own[:, None], v, other.channels[k]) for k, v in first.channels.items()}
        dials = [np.where(own, one, two) for one, two in zip(first.dials, other.dials, strict=True)]
        assert taken_before(BenchReadings(channels, *dials), found) is known
    assert taken_before(first.take(range(6)), found)
    assert not taken_before(first.take(range(5)), found)
    with pytest.raises(InputError, match="stations 1, 2 are to the last digit those of stations 1, 2 that"):
        refuse_own_readings(replace(first.take(range(2)), digest=""), found)
    refuse_own_readings(replace(first.take(range(1)), digest=""), found)


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


TWELVE = plans.twelve()


def test_two_azimuths_exchanged_in_twelve_positions_are_named():
    """Of a vertical and a level station, where dials and directions of the field are sought by a closed form."""
    right = run(plan=TWELVE)
    assert check_whole(right) == []
    for first, second in ((2, 7), (4, 10), (0, 8)):
        azimuth = right.azimuth.copy()
        azimuth[[first, second]] = azimuth[[second, first]]
        with pytest.raises(
            InputError, match=rf"stations {first + 1} and {second + 1} exchanged.*put the rows in order"
        ):
            calibrate_joint(replace(right, azimuth=azimuth))


def test_two_rows_exchanged_in_twelve_positions_are_named():
    right, rows = run(plan=TWELVE), np.arange(12)
    rows[[3, 8]] = 8, 3
    with pytest.raises(InputError, match="the readings of stations 4 and 9 exchanged"):
        check_whole(replace(right, channels={kind: values[rows] for kind, values in right.channels.items()}))


@pytest.mark.parametrize("plan", [TWELVE, PLAN])
@pytest.mark.parametrize(
    ("channels", "words"), [(slice(0, 3), "the magnetometer 0.9 times"), (slice(1, 2), "the magnetometer y 0.9 times")]
)
def test_a_gain_that_falls_by_a_tenth_is_named_with_its_size(plan, channels, words):
    right = run(plan=plan)
    values, half = right.channels["magnetometer"].copy(), len(right) // 2
    values[half:, channels] *= 0.9
    with pytest.raises(InputError, match=rf"{words} as sensitive from station {half + 1} on"):
        check_whole(replace(right, channels={**right.channels, "magnetometer": values}))


@pytest.mark.parametrize("plan", [TWELVE, PLAN, plans.two_face()])
@pytest.mark.parametrize("dials", [("inclination", "toolface"), ("azimuth", "toolface")])
def test_exchanged_columns_are_named_before_a_fit_that_would_not_converge(plan, dials):
    right = run(plan=plan)
    one, other = dials
    with pytest.raises(InputError, match=rf"columns of the dials exchanged \({one} and {other}\).*put the columns"):
        calibrate_joint(replace(right, **{one: getattr(right, other), other: getattr(right, one)}))


def test_inclinations_from_the_horizontal_are_named_and_so_is_what_fits_as_well():
    right = run()
    with pytest.raises(InputError, match="--inclination-from horizontal"):
        calibrate_joint(replace(right, inclination=np.pi / 2.0 - right.inclination))
    # in the cube exchanged columns of azimuth and inclination look like that as well
    with pytest.raises(InputError, match=r"count in another way.* With the columns of the dials exchanged \(azimuth"):
        calibrate_joint(replace(right, azimuth=right.inclination, inclination=right.azimuth))


def test_what_no_hypothesis_explains_is_warned_of_by_its_size():
    right, r = run(plan=TWELVE), np.random.default_rng(4)
    values = right.channels["magnetometer"]
    for share, word in ((0.005, ""), (0.04, "the fit leaves"), (0.07, "the fit leaves")):
        noise = share * 0.5 * np.ptp(values) * r.standard_normal(values.shape)
        found = calibrate_joint(replace(right, channels={**right.channels, "magnetometer": values + noise}))
        said = [one for one in found.warnings if one.startswith("the fit leaves")]
        assert len(said) == bool(word)
        if said:
            assert float(re.search(r"([\d.]+) %", said[0]).group(1)) == pytest.approx(100.0 * share, rel=0.4)


def test_an_uncertainty_that_no_inclinometer_has_is_warned_of():
    found = calibrate_joint(run(plan=TWELVE))
    assert absurd_uncertainty(found) == []
    far = replace(found.tool, covariance=found.tool.covariance * 2500.0)
    (said,) = absurd_uncertainty(replace(found, tool=far))
    assert "uncertain by" in said
    # azimuth beyond 5 deg or inclination beyond 1: the worst of them is named with its size
    size = float(re.search(r"uncertain by ([\d.]+) deg", said).group(1))
    assert size > (1.0 if "the inclination" in said else 5.0)


@pytest.mark.parametrize("plan", [TWELVE, PLAN])
def test_own_readings_are_known_by_their_noise(plan):
    """Multiplied, moved, rounded, a count more or less: what was not modelled stays; another visit has its own."""
    first, r = run(1, plan), np.random.default_rng(5)
    first = replace(first, channels={kind: np.round(v) for kind, v in first.channels.items()})
    found = calibrate_joint(first)
    order = r.permutation(len(first))
    changes = {
        "factor": lambda v: v * 1.002,
        "offset": lambda v: 0.99 * v + 5.0,
        "factor, rounded": lambda v: np.round(v * 1.002),
        "a count": lambda v: v + r.integers(-1, 2, v.shape),
        "three digits": lambda v: np.array([[float(f"{x:.3g}") for x in row] for row in v]),
    }
    for name, change in changes.items():
        copy = replace(first, channels={kind: change(v) for kind, v in first.channels.items()}, digest="")
        if name != "a count" or plan is PLAN:  # of twelve positions too few are free
            assert taken_before(copy, found), name
        if name in ("factor", "offset", "factor, rounded"):
            assert taken_before(copy.take(order), found), name
    with pytest.raises(InputError, match="a factor, an offset, fewer digits"):
        verify(replace(first, channels={k: 1.002 * v for k, v in first.channels.items()}, digest=""), found)
    for seed in range(2, 12):
        other = run(seed, plan)
        other = replace(other, channels={kind: np.round(v) for kind, v in other.channels.items()})
        assert not taken_before(other, found)
        assert repeated_noise(other, found) == []


def test_residuals_that_recur_reserve_a_pass():
    """Noise that covers most of a copy leaves its correlation: the pass is reserved, not refused."""
    first, r = run(1), np.random.default_rng(6)
    found = calibrate_joint(first)
    size = {kind: 0.8 * found.residuals.values[kind].std(axis=0) for kind in first.channels}
    copy = {kind: v + size[kind] * r.standard_normal(v.shape) for kind, v in first.channels.items()}
    again = replace(first, channels=copy, digest="")
    assert not taken_before(again, found)
    seen = verify(again, found)
    assert "recur in these readings" in seen.reservations[-1]
    assert set(seen.reservations) <= set(seen.warnings)
    assert seen.judgement == "pass, with reservations"


def test_a_pass_within_limits_of_tens_of_degrees_is_reserved():
    plan = plans.spread()
    found, here = calibrate_joint(run(plan=TWELVE)), run(9, plan)
    loose = Limits("loose", "a test", np.radians(1.0), np.radians(30.0), np.radians(2.0))
    (first, *_) = verify(here, found, loose).reservations
    assert first.startswith("azimuth is held against a limit of 30 deg, more than the 10 deg")
    # and one that is of use, and that finds a tool a few times as bad, is not
    fair = Limits("fair", "a test", np.radians(0.4), np.radians(1.2), np.radians(0.8))
    seen = verify(here, found, fair)
    assert (seen.verdict, seen.judgement, list(seen.reservations)) == ("pass", "pass", [])
    # a derived limit as wide as that, of a calibration that knows little
    poor = replace(
        found, covariance=found.covariance * 1e6, tool=replace(found.tool, covariance=found.tool.covariance * 1e6)
    )
    assert "azimuth is held against" in verify(here, poor).reservations[0]


def test_agreed_limits_that_find_only_a_much_worse_tool_reserve_the_pass():
    found, here = calibrate_joint(run(plan=PLAN), rig_sd=np.radians(0.1)), run(9, plans.spread())
    for degrees, reserved in ((0.5, False), (4.0, True)):
        bounds = Limits("agreed", "a test", np.radians(1.9), np.radians(degrees), np.radians(degrees))
        seen = verify(here, found, bounds)
        assert seen.verdict == "pass"
        assert (seen.power.factor > 10.0) is reserved
        assert any("the agreed limits are so wide" in one for one in seen.reservations) is reserved
        assert seen.judgement == ("pass, with reservations" if reserved else "pass")
