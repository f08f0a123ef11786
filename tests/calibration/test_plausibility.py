"""Bench readings as a whole: one mistake of the file is named; right runs and second visits pass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize
from tests.refusals import coded, fits, refused

from inclinometry.calibration import plans
from inclinometry.calibration.conformity import verify
from inclinometry.calibration.decision import Limits
from inclinometry.calibration.expected import absurd_uncertainty, expected_uncertainty
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.plausibility import (
    check_readings,
    check_whole,
    odd_stations,
    own_readings,
    repeated_noise,
    taken_before,
)
from inclinometry.calibration.readings import BenchReadings
from inclinometry.findings import without_notes
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


def mistake(said):
    """Code and values of the first mistake that a finding names."""
    one = said.values["mistake"][0]
    return one.code, one.values


@pytest.mark.parametrize("plan", [plans.twelve(), PLAN, plans.two_face()])
@pytest.mark.parametrize("dials_deg", [0.1, 0.5])
def test_right_runs_pass(plan, dials_deg):
    for seed in range(4):
        assert check_whole(run(seed, plan, dials_deg)) == []


@pytest.mark.parametrize("dial", ["azimuth", "inclination", "toolface"])
def test_a_dial_in_grads(dial):
    right = run()
    (said,) = check_whole(replace(right, **{dial: getattr(right, dial) / 0.9}))
    assert (said.code, said.severity) == ("bench-mistake", "refused")
    assert mistake(said) == ("bench-in-grads", {"dials": (dial,)})


def test_two_stations_exchanged(refused):
    rows = np.arange(24)
    rows[[4, 9]] = 9, 4
    # on a poor stand they fit only some ten times better, which is as certain
    for right in (run(dials_deg=1.5), run()):
        channels = {kind: values[rows] for kind, values in right.channels.items()}
        (said,) = check_whole(replace(right, channels=channels))
        assert (said.code, said.severity) == ("bench-mistake", "refused")
        assert mistake(said) == ("bench-rows", {"first": "5", "second": "10"})
    azimuth = right.azimuth.copy()
    other = int(np.argmax(np.abs(np.sin((azimuth - azimuth[2]) / 2.0))))
    azimuth[[2, other]] = azimuth[[other, 2]]
    with refused("bench-mistake") as said:
        calibrate_joint(replace(right, azimuth=azimuth))
    assert mistake(said[0])[1]["second"] == str(other + 1)


@pytest.mark.parametrize(("start", "gain"), [(3, 0.5), (21, 0.1), (16, 2.0), (16, 10.0)])
def test_a_gain_that_changes_is_named_with_its_station_and_size(start, gain):
    """From the fourth station to the third last: fewer are as well explained by themselves."""
    right = run()
    values = right.channels["magnetometer"].copy()
    values[start:, 1] *= gain
    (said,) = check_whole(replace(right, channels={**right.channels, "magnetometer": values}))
    (code, facts), near = mistake(said), pytest.approx(gain, rel=0.02)
    assert (said.code, code) == ("bench-mistake", "bench-gain-channel")
    assert facts == {"kind": "magnetometer", "axis": "y", "factor": near, "station": str(start + 1)}


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


def turned(readings, off_deg):
    """Stations (from 1) whose toolface dial is off."""
    toolface = readings.toolface.copy()
    for number, off in off_deg.items():
        toolface[number - 1] += np.radians(off)
    return replace(readings, toolface=toolface, digest="")


def test_a_fit_that_refuses_names_the_stations_that_do_not_fit(refused):
    """Six of 24, more than are looked for as outliers one by one."""
    wrong = {1: -80.0, 2: 40.0, 3: 90.0, 5: 33.0, 8: 70.0, 10: -40.0}
    readings = turned(run(3, PLAN, 1.0), wrong)
    with refused("bench-stations-odd") as said:
        calibrate_joint(readings, rig_sd=float(np.radians(1.0)))
    assert said[0].values["stations"] == ("1", "2", "3", "5", "8", "10")
    assert said[0].rows == (0, 1, 2, 4, 7, 9)


def test_a_fit_that_warns_of_what_it_leaves_names_the_stations_too():
    """Four of twelve, which the fit partly follows."""
    wrong = {5: 20.0, 7: 20.0, 9: 20.0, 11: -20.0}
    readings = turned(run(3, plan=plans.twelve()), wrong)
    assert odd_stations(readings) == [4, 6, 8, 10]
    found = calibrate_joint(readings, rig_sd=float(np.radians(0.1)))
    assert set(found.outliers) == {"5", "7", "9", "11"}
    assert "bench-stations-odd" in {one.code for one in found.findings}


@pytest.mark.parametrize("plan", [plans.twelve(), PLAN, plans.two_face()])
def test_of_a_right_run_on_a_coarse_rig_no_station_is_named(plan):
    for seed in range(2):
        readings = run(seed, plan, 2.0)
        assert odd_stations(readings) == []


def test_how_much_better_and_how_much_is_unexplained_is_said():
    right = run()
    wrong = replace(right, azimuth=right.azimuth / 0.9)
    (said,) = check_whole(wrong)
    given = {kind: left(wrong, kind) for kind in wrong.channels}
    best = {kind: left(right, kind) for kind in wrong.channels}
    assert said.values["kind"] == "magnetometer"
    assert said.values["left_percent"] == pytest.approx(100.0 * given["magnetometer"], rel=0.03)
    assert said.values["times"] == pytest.approx(max(given[kind] / best[kind] for kind in given), rel=0.05)
    # of normal noise of unknown size: 72 readings of each triad less its 14 parameters
    ratio = sum(58 * np.log(given[kind] / best[kind]) for kind in given)
    assert said.values["log_ratio"] == pytest.approx(ratio, abs=5.0)


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
        assert (said.code, said.values["what"].lower(), said.severity) == ("bench-drift", what, "warning")
        # beside noise of 1 in 4000 and dials of 0.1 deg
        assert said.values["size_percent"] == pytest.approx(100.0 * size, rel=0.05, abs=0.06)
    (said,) = check_whole(drifted(0.13))
    assert (said.code, said.values["what"].lower(), said.severity) == ("bench-drift", what, "refused")
    assert said.values["size_percent"] == pytest.approx(13.0, abs=1.5)


def test_one_station_that_is_wrong_is_no_exchange_of_two():
    right = run()
    channels = {kind: values.copy() for kind, values in right.channels.items()}
    for values in channels.values():
        values[4] = values[9]
    assert "bench-mistake" not in {one.code for one in check_whole(replace(right, channels=channels))}
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
    (said,) = own_readings(replace(first.take(range(2)), digest=""), found)
    assert (said.code, said.values) == ("bench-readings-copied", {"here": ("1", "2"), "there": ("1", "2")})
    assert own_readings(replace(first.take(range(1)), digest=""), found) == []


def test_the_readings_of_the_calibration_are_known_by_value(refused):
    first = run(1)
    found = calibrate_joint(first)
    order = np.random.default_rng(2).permutation(24)
    shaken = {k: v[order] + np.random.default_rng(3).uniform(-0.3, 0.3, v.shape) for k, v in first.channels.items()}
    copy = BenchReadings(shaken, *(dial[order] for dial in first.dials), reference=first.reference)
    with refused("bench-readings-own", how="in another order"):
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
    assert not {one.code for one in said} & {"bench-drift"}


@pytest.mark.parametrize("plan", [plans.twelve(), PLAN, plans.half()])
@pytest.mark.parametrize("channels", [slice(None), 1])
def test_gains_that_drift_are_named(plan, channels):
    right = run(plan=plan)
    slope = np.linspace(1.0, 1.3, len(right))
    values = right.channels["magnetometer"].copy()
    values[:, channels] *= slope if channels == 1 else slope[:, None]
    (said,) = check_whole(replace(right, channels={**right.channels, "magnetometer": values}))
    assert (said.code, said.values["what"], said.severity) == ("bench-drift", "Gains", "refused")
    assert 20.0 <= said.values["size_percent"] < 30.0


@pytest.mark.parametrize("plan", [plans.twelve(), PLAN])
@pytest.mark.parametrize(
    "dials", [("azimuth",), ("inclination",), ("toolface",), ("azimuth", "inclination", "toolface")]
)
def test_dials_in_radians(plan, dials):
    right = run(plan=plan)
    (said,) = check_readings(replace(right, **{dial: np.radians(getattr(right, dial)) for dial in dials}))
    assert (said.code, said.severity, said.values["dials"]) == ("bench-dials-radians", "refused", dials)
    assert said.values["columns"] == tuple(f"{dial}_rad" for dial in dials)


def test_two_readings_of_the_calibration_are_known_by_value(refused):
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
    with refused("bench-readings-copied") as said:
        verify(replace(other, channels=channels, **dials), found)
    assert said[0].values == {"here": ("3", "10"), "there": ("8", "21")}


def test_a_stand_whose_errors_repeat_is_no_copy():
    # the same dials' errors twice, noise of half a count alone between both visits
    found = calibrate_joint(run(1))
    other = run(1)
    shaken = {k: v + np.random.default_rng(4).normal(0.0, 0.5, v.shape) for k, v in other.channels.items()}
    again = BenchReadings({k: v[:5] for k, v in shaken.items()}, *(dial[:5] for dial in other.dials))
    assert own_readings(again, found) == []


TWELVE = plans.twelve()


def test_two_azimuths_exchanged_in_twelve_positions_are_named(refused):
    """Of a vertical and a level station, where dials and directions of the field are sought by a closed form."""
    right = run(plan=TWELVE)
    assert check_whole(right) == []
    for first, second in ((2, 7), (4, 10), (0, 8)):
        azimuth = right.azimuth.copy()
        azimuth[[first, second]] = azimuth[[second, first]]
        with refused("bench-mistake") as said:
            calibrate_joint(replace(right, azimuth=azimuth))
        named = [one.values for one in said[0].values["mistake"]]
        assert any((one["first"], one["second"]) == (str(first + 1), str(second + 1)) for one in named)


def test_two_rows_exchanged_in_twelve_positions_are_named():
    right, rows = run(plan=TWELVE), np.arange(12)
    rows[[3, 8]] = 8, 3
    (said,) = check_whole(replace(right, channels={kind: values[rows] for kind, values in right.channels.items()}))
    assert mistake(said) == ("bench-rows", {"first": "4", "second": "9"})


@pytest.mark.parametrize("plan", [TWELVE, PLAN])
@pytest.mark.parametrize(("channels", "code"), [(slice(0, 3), "bench-gain-triad"), (slice(1, 2), "bench-gain-channel")])
def test_a_gain_that_falls_by_a_tenth_is_named_with_its_size(plan, channels, code):
    right = run(plan=plan)
    values, half = right.channels["magnetometer"].copy(), len(right) // 2
    values[half:, channels] *= 0.9
    (said,) = check_whole(replace(right, channels={**right.channels, "magnetometer": values}))
    # the station before or after may explain it as well
    (facts,) = (one.values for one in said.values["mistake"] if one.values["station"] == str(half + 1))
    assert (mistake(said)[0], said.severity) == (code, "refused")
    assert facts["factor"] == pytest.approx(0.9, abs=0.01)


@pytest.mark.parametrize("plan", [TWELVE, PLAN, plans.two_face()])
@pytest.mark.parametrize("dials", [("inclination", "toolface"), ("azimuth", "toolface")])
def test_exchanged_columns_are_named_before_a_fit_that_would_not_converge(plan, dials, refused):
    right = run(plan=plan)
    one, other = dials
    with refused("bench-dials-exchanged") as said:
        calibrate_joint(replace(right, **{one: getattr(right, other), other: getattr(right, one)}))
    assert [way.values["dial"] for way in said[0].values["columns"]] == [one, other]


def test_inclinations_from_the_horizontal_are_named_and_so_is_what_fits_as_well(refused):
    right = run()
    with refused("bench-dials-otherwise"):
        calibrate_joint(replace(right, inclination=np.pi / 2.0 - right.inclination))
    # in the cube exchanged columns of azimuth and inclination look like that as well
    wrong = replace(right, azimuth=right.inclination, inclination=right.azimuth)
    assert [one.code for one in check_readings(wrong)] == ["bench-dials-exchanged", "bench-dials-otherwise"]


def test_what_no_hypothesis_explains_is_warned_of_by_its_size():
    right, r = run(plan=TWELVE), np.random.default_rng(4)
    values = right.channels["magnetometer"]
    for share, word in ((0.005, ""), (0.04, "the fit leaves"), (0.07, "the fit leaves")):
        noise = share * 0.5 * np.ptp(values) * r.standard_normal(values.shape)
        found = calibrate_joint(replace(right, channels={**right.channels, "magnetometer": values + noise}))
        said = [one for one in found.findings if one.code == "bench-fit-poor"]
        assert len(said) == bool(word)
        if said:
            assert said[0].values["left_percent"] == pytest.approx(100.0 * share, rel=0.4)


def test_an_uncertainty_that_no_inclinometer_has_is_warned_of():
    found = calibrate_joint(run(plan=TWELVE))
    assert absurd_uncertainty(found.tool, expected_uncertainty(found)) == []
    far = replace(found.tool, covariance=found.tool.covariance * 2500.0)
    (said,) = absurd_uncertainty(far, expected_uncertainty(far))
    # azimuth beyond 5 deg or inclination beyond 1: the worst of them is named with its size
    assert said.code == "bench-uncertainty-absurd"
    assert said.values["u_deg"] > (1.0 if said.values["angle"] == "inclination" else 5.0)


@pytest.mark.parametrize("plan", [TWELVE, PLAN])
def test_own_readings_are_known_by_their_noise(plan, refused):
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
    with refused("bench-readings-own", how="in another order"):
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
    assert seen.reservations[-1] == repeated_noise(again, found)[0]
    assert all(one in without_notes(seen.findings) for one in seen.reservations)
    assert seen.judgement == "agrees, with reservations"


def test_a_pass_within_limits_of_tens_of_degrees_is_reserved():
    plan = plans.spread()
    found, here = calibrate_joint(run(plan=TWELVE)), run(9, plan)
    loose = Limits("loose", "a test", np.radians(1.0), np.radians(30.0), np.radians(2.0))
    (first, *_) = verify(here, found, loose).reservations
    assert fits(
        first,
        ["verify-wide"],
        {"remedy": "Give a narrower limit", "angle": "azimuth", "limit_deg": 30.0, "usual_deg": 10.0},
    )
    # and one that is of use, and that finds a tool a few times as bad, is not
    fair = Limits("fair", "a test", np.radians(0.45), np.radians(1.2), np.radians(0.8))
    seen = verify(here, found, fair)
    assert (seen.verdict, seen.judgement, list(seen.reservations)) == ("pass", "pass", [])
    # a derived limit as wide as that, of a calibration that knows little
    poor = replace(
        found, covariance=found.covariance * 1e6, tool=replace(found.tool, covariance=found.tool.covariance * 1e6)
    )
    assert fits(
        verify(here, poor).reservations[0], ["verify-wide"], {"remedy": "Check the calibration", "angle": "azimuth"}
    )


def test_agreed_limits_that_find_only_a_much_worse_tool_reserve_the_pass():
    found, here = calibrate_joint(run(plan=PLAN), rig_sd=np.radians(0.1)), run(9, plans.spread())
    for degrees, reserved in ((0.9, False), (4.0, True)):
        bounds = Limits("agreed", "a test", np.radians(1.9), np.radians(degrees), np.radians(degrees))
        seen = verify(here, found, bounds)
        assert seen.verdict == "pass"
        assert (seen.power.factor > 10.0) is reserved
        assert ("verify-detects-little" in coded(seen.reservations)) is reserved
        assert seen.judgement == ("pass, with reservations" if reserved else "pass")


def changed(change):
    """A run whose channels were changed: kind -> (K, 3), in place."""
    one = run()
    channels = {kind: values.copy() for kind, values in one.channels.items()}
    change(channels)
    return replace(one, channels=channels)


@pytest.mark.parametrize(
    ("change", "codes"),
    [
        (lambda c: c["magnetometer"].__setitem__((slice(12, None), 1), c["magnetometer"][12, 1]), {"sensor-frozen"}),
        (lambda c: c.update({k: np.round(v / 50.0) * 50.0 for k, v in c.items()}), {"sensor-steps"}),
        (lambda c: c.update({k: np.round(v / 2.0) * 2.0 for k, v in c.items()}), set()),
        (lambda c: c["magnetometer"][12:].__imul__([1.08, 0.95, 1.03]), {"bench-set-up-changed"}),
        (lambda c: c["magnetometer"][1::2].__iadd__([150.0, -90.0, 60.0]), {"bench-set-up-changed"}),
    ],
)
def test_channels_that_fail_and_mixed_runs_are_named(change, codes):
    assert {one.code for one in check_readings(changed(change))} == codes


def test_one_position_is_no_verification():
    found = calibrate_joint(run())
    again = run(2).take([3] * 5)
    noise = np.random.default_rng(1)
    noisy = {kind: values + noise.normal(0.0, 0.5, values.shape) for kind, values in again.channels.items()}
    with refused("verify-one-position"):
        verify(replace(again, channels=noisy, digest=""), found)


def test_serial_numbers_are_compared():
    found = calibrate_joint(run(), name="IN-7")
    verify(replace(run(2), serial="in 7"), found)
    with refused("work-other-tool"):
        verify(replace(run(2), serial="IN-8"), found)
