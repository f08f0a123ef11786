"""The inertial filter, its smoother and the closed gyro survey on simulated drilling, errors drawn from the priors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.arrays import Array
from inclinometry.earth.rate import earth_rate
from inclinometry.earth.site import Site
from inclinometry.motion.inertial.filter import GyroStream, InertialStream, gyro_attitude, inertial_attitude
from inclinometry.motion.inertial.smoother import continuous_survey, smoothed_attitude
from inclinometry.motion.inertial.state import InertialSettings
from inclinometry.motion.result import Attitude, Samples, joined
from inclinometry.motion.robust import igg3_weight
from inclinometry.rotations import (
    dcm,
    dcm_from_quaternion,
    quaternion_from_dcm,
    rotation_exp,
    rotation_log,
    wrap_signed,
)
from inclinometry.simulate.drilling import SCENARIOS, simulate_drilling
from inclinometry.simulate.drilling.run import DrillingSimulation
from inclinometry.simulate.drilling.scenario import Hole, MagLag, Scenario, TriadErrors

SITE = Site(latitude=Hole().latitude, g=9.80665, dip=Hole().dip, dip_sigma=1e-3, b=50_000.0)  # where the scenarios are


TOLD = InertialSettings(coupling_sigma=0.0, delay_sigma_s=0.0)  # the simulated tools' axes and clocks are perfect


def drawn(name: str, seed: int) -> Scenario:
    """The scenario with every error the filter estimates drawn from its prior, and the gyro's noise."""
    chosen, scenario = InertialSettings(), SCENARIOS[name]
    draw = np.random.default_rng(1000 + seed)
    tool = scenario.instrument

    def three(sigma: float) -> tuple[float, float, float]:
        a, b, c = draw.normal(0.0, sigma, 3)
        return float(a), float(b), float(c)

    gyro = TriadErrors(
        noise=chosen.gyro_noise / np.sqrt(tool.interval),
        bias=three(chosen.gyro_bias_sigma),
        scale=three(chosen.gyro_scale_sigma),
        walk=chosen.gyro_bias_walk,
    )
    lever = three(chosen.lever_sigma)
    return replace(
        scenario,
        instrument=replace(
            tool,
            gyro=gyro,
            accel=replace(tool.accel, bias=three(chosen.accel_bias_sigma)),
            hard_iron=three(150.0),
            lever=(lever[0], lever[1], 0.0),
        ),
    )


def samples(run: DrillingSimulation, *, field: bool = True) -> Samples:
    """Its readings."""
    return Samples(run.time, run.interval, run.accel, run.mag if field else None, run.gyro)


def simulated(name: str, seed: int, duration: float = 60.0) -> DrillingSimulation:
    """A scenario as it is named: no gyro noise, 0.1 deg/s, 0.1 %."""
    return simulate_drilling(name, seed, duration=duration)


class Score(NamedTuple):
    """Errors (k,) of the rows in rad, and the normalised squared error of the attitude over three."""

    inclination: Array
    azimuth: Array
    normalised: Array


def score(rows: Attitude, run: DrillingSimulation) -> Score:
    """Of the rows that were not refused, against the truth at their instants."""
    good = ~rows.refused
    places = np.rint((rows.time[good] - run.time[0]) / run.interval).astype(int)
    truth = run.truth
    matrix = dcm(truth.azimuth[places], truth.inclination[places], truth.toolface[places])
    e = rotation_log(dcm_from_quaternion(rows.quaternion[good]) @ np.swapaxes(matrix, 1, 2))
    squared = np.einsum("ki,kij,kj->k", e, np.linalg.inv(rows.covariance[good]), e) / 3.0
    angles = rows.angles
    return Score(
        angles.inclination[good] - truth.inclination[places],
        wrap_signed(angles.azimuth[good] - truth.azimuth[places]),
        squared,
    )


def rms_deg(error: Array) -> float:
    """Root mean square in degrees."""
    return float(np.degrees(np.sqrt(np.mean(np.square(error)))))


def station(run: DrillingSimulation, place: int, seed: int, *, level: float = 1e-3, azimuth: float = 5e-3) -> Attitude:
    """A north-seeking station's row at a sample, its error drawn from its covariance."""
    truth = run.truth
    matrix = dcm(truth.azimuth[place], truth.inclination[place], truth.toolface[place])
    down = matrix[:, 2]
    covariance = level**2 * np.eye(3) + azimuth**2 * np.outer(down, down)
    error = np.random.default_rng(seed).multivariate_normal(np.zeros(3), covariance)
    return Attitude(
        time=run.time[[place]],
        quaternion=quaternion_from_dcm(rotation_exp(error) @ matrix)[None],
        covariance=covariance[None],
        rate=np.zeros(1),
        quality=np.ones(1),
        flags=np.zeros(1, dtype=np.uint32),
        method=np.zeros(1, dtype=np.uint8),
        north="true",
    )


REFERENCE = {  # spec of the room: inclination, azimuth RMS in deg of demodulated 10 s windows, where it states them
    "smooth": (0.026, 0.053),
    "vibration-5g": (0.026, 0.053),
    "vibration-20g": (0.103, 0.213),
    "stick-slip": (0.190, 0.396),
    "fast": (0.190, 0.396),
    "whirl": (0.026, 0.053),
}


@pytest.mark.long
@pytest.mark.parametrize("name", sorted(REFERENCE))
@pytest.mark.parametrize("method", [inertial_attitude, smoothed_attitude])
def test_settled_rows_are_below_the_figures_of_magnetic_demodulation(
    name: str, method: Callable[..., Attitude]
) -> None:
    """60 s, three seeds, the scenarios as they are named; after 10 s. Margin of two or more in all but "fast"."""
    found = []
    for seed in range(3):
        run = simulated(name, seed)
        found.append(score(method(samples(run), None, SITE), run))
    inclination, azimuth = REFERENCE[name]
    assert rms_deg(np.array([s.inclination[2:] for s in found])) < inclination
    assert rms_deg(np.array([s.azimuth[2:] for s in found])) < azimuth


@pytest.mark.parametrize("name", ["sliding", "stationary"])
def test_what_does_not_turn_is_limited_by_what_turning_would_show(name: str) -> None:
    """Accelerometer bias 0.02 m/s^2 and hard iron 150 nT, both 0 in truth: 0.12 and 0.47 deg are stated."""
    run = simulated(name, 1)
    rows = inertial_attitude(samples(run), None, SITE)
    found = score(rows, run)
    assert rms_deg(found.inclination[2:]) < 0.1
    assert rms_deg(found.azimuth[2:]) < 0.3
    assert 0.05 < np.degrees(rows.u.inclination[-1]) < 0.15
    assert 0.2 < np.degrees(rows.u.azimuth[-1]) < 0.6


@pytest.mark.long
@pytest.mark.parametrize("name", sorted(SCENARIOS))
def test_covariance_is_honest(name: str) -> None:
    """Last rows of 16 runs, all errors drawn from the priors: e' P^-1 e / 3 averages 1, its own sd is 0.2.

    Noise of vibration is estimated on the safe side: 0.7 is usual where it matters.
    """
    found = []
    for seed in range(16):
        run = simulate_drilling(drawn(name, seed), seed, duration=30.0)
        found.append(score(inertial_attitude(samples(run), TOLD, SITE), run).normalised[-1])
    assert 0.4 < np.mean(found) < 1.7


@pytest.mark.long
def test_smoother_betters_the_first_rows_and_ends_with_the_filter() -> None:
    """Nothing comes after the last row, so that both agree there to rounding; the first gain most."""
    early: dict[str, list[float]] = {"filter": [], "smoother": []}
    for seed in range(8):
        run = simulate_drilling(drawn("vibration-20g", seed), seed, duration=60.0)
        forward, both = (f(samples(run), None, SITE) for f in (inertial_attitude, smoothed_attitude))
        assert np.abs(forward.quaternion[-1] - both.quaternion[-1]).max() < 1e-9
        assert np.abs(forward.covariance[-1] - both.covariance[-1]).max() < 1e-12
        assert (both.u.inclination < forward.u.inclination * (1.0 + 1e-6)).all()
        early["filter"].append(score(forward, run).inclination[0])
        early["smoother"].append(score(both, run).inclination[0])
    assert rms_deg(np.array(early["smoother"])) < 0.5 * rms_deg(np.array(early["filter"]))


@pytest.mark.long
@settings(max_examples=12, deadline=None)
@given(st.lists(st.integers(0, 2600), max_size=12))
@example([0, 0, 1, 2, 999, 1000, 1001, 2600, 2600])
def test_streams_agree_with_batches_to_the_last_bit(cuts: list[int]) -> None:
    run = _short()
    record = samples(run)
    for stream, whole in ((InertialStream(None, SITE), inertial_attitude), (GyroStream(None, SITE), gyro_attitude)):
        edges = [0, *sorted(cuts), len(record)]
        parts = [stream.push(record.part(a, b)) for a, b in pairwise(edges)] + [stream.finish()]
        found, wanted = joined(parts), whole(record, None, SITE)
        for column in ("time", "quaternion", "covariance", "rate", "quality", "flags"):
            assert getattr(found, column).tobytes() == getattr(wanted, column).tobytes()


@cache
def _short() -> DrillingSimulation:
    return simulate_drilling("stick-slip", 5, duration=13.0)


def test_casing_is_left_out_and_bridged_by_the_gyro() -> None:
    """30 s in which the field is 500 nT to 30 uT off, fixed in the ground: flagged, azimuth stays within 0.1 deg."""
    run = simulated("vibration-5g", 1, 90.0)
    truth = run.truth
    matrix = dcm(truth.azimuth, truth.inclination, truth.toolface)
    for strength in (500.0, 30_000.0):
        mag = run.mag.copy()
        mag[8000:14000] += (matrix @ (strength * np.array([0.3, 0.5, 0.8])))[8000:14000]
        rows = inertial_attitude(Samples(run.time, run.interval, run.accel, mag, run.gyro), None, SITE)
        inside = (rows.time > 40.0) & (rows.time < 70.0)
        assert all({"disturbed", "drift"} <= set(rows.names(k)) for k in np.flatnonzero(inside))
        assert not any("disturbed" in rows.names(k) for k in np.flatnonzero(~inside))
        assert np.degrees(np.abs(score(rows, run).azimuth[2:]).max()) < 0.1


def test_field_noise_beyond_the_setting_is_seen() -> None:
    """300 nT where 50 are stated: the filter takes what it sees, and is right about its errors."""
    found = []
    for seed in range(6):
        run = simulated("smooth", seed, 30.0)
        mag = run.mag + np.random.default_rng(seed).normal(0.0, 300.0, run.mag.shape)
        rows = inertial_attitude(Samples(run.time, run.interval, run.accel, mag, run.gyro), None, SITE)
        assert not any("disturbed" in rows.names(k) for k in range(len(rows)))
        found.append(score(rows, run).normalised.mean())
    assert np.mean(found) < 1.5


def test_a_gap_starts_the_attitude_anew_and_keeps_what_was_learnt() -> None:
    run = simulated("vibration-5g", 2)
    record = samples(run)
    for cut, rest in ((5321, 6000), (5000, 5700)):
        stream = InertialStream(None, SITE)
        rows = joined([stream.push(record.part(0, cut)), stream.push(record.part(rest, len(record))), stream.finish()])
        begun = [k for k in range(len(rows)) if "start" in rows.names(k)]
        assert len(begun) == 4
        found = score(rows, run)
        # the scale is known by then: the first window after the gap is as good as a settled one
        assert np.degrees(np.abs(found.azimuth[begun[2]])) < 0.1


def test_clipped_windows_lose_gravity_but_not_the_attitude() -> None:
    """A start is never made of them."""
    run = simulated("vibration-5g", 3)
    clipped = np.zeros(len(run), bool)
    clipped[[50, 3000, 3001, 7000]] = True
    rows = inertial_attitude(replace(samples(run), clipped=clipped), None, SITE)
    assert [k for k in range(len(rows)) if "clipped" in rows.names(k)] == [0, 3, 7]
    assert list(np.flatnonzero(rows.refused)) == [0]
    assert np.degrees(np.abs(score(rows, run).inclination).max()) < 0.3


def test_weights_divide_the_information_of_a_window() -> None:
    """Equal weights of 1 change nothing, IGG-III nearly nothing in clean data, and 0 leaves gravity out."""
    run = simulated("vibration-5g", 4, 30.0)
    plain = inertial_attitude(samples(run), None, SITE)
    same = inertial_attitude(samples(run), InertialSettings(weight=np.ones_like), SITE)
    robust = inertial_attitude(samples(run), InertialSettings(weight=igg3_weight), SITE)
    assert np.abs(plain.quaternion - same.quaternion).max() < 1e-12
    assert rms_deg(score(robust, run).inclination[2:]) < 0.03
    none = inertial_attitude(samples(run), InertialSettings(weight=np.zeros_like), SITE)
    assert none.u.inclination[-1] > 3.0 * plain.u.inclination[-1]


def test_north_is_found_in_a_standstill() -> None:
    """Gyro good to 0.03 deg/h, level to 0.1 mg: 0.15 deg; errors drawn accordingly, 24 runs."""
    chosen = InertialSettings(
        gyro_bias_sigma=1.5e-7, gyro_bias_walk=0.0, gyro_noise=2e-7, accel_bias_sigma=1e-3, accel_noise=0.01
    )
    matrix, earth = dcm(1.0, 0.6, 2.0), earth_rate(np.radians(50.0))
    found = []
    for seed in range(24):
        draw = np.random.default_rng(seed)
        gyro = matrix @ earth + draw.normal(0.0, 1.5e-7, 3) + draw.normal(0.0, 2e-7 / np.sqrt(0.02), (3000, 3))
        accel = matrix @ [0.0, 0.0, 9.80665] + draw.normal(0.0, 1e-3, 3) + draw.normal(0.0, 0.01, (3000, 3))
        record = Samples(np.arange(3000) * 0.02, 0.02, accel=accel, gyro=gyro)
        rows = gyro_attitude(record, chosen, SITE)
        assert rows.north == "true"
        assert "drift" not in rows.names(len(rows) - 1)
        found.append(float(wrap_signed(rows.angles.azimuth[-1] - 1.0) / rows.u.azimuth[-1]))
    assert np.degrees(rows.u.azimuth[-1]) == pytest.approx(0.22, abs=0.08)
    assert 0.6 < np.sqrt(np.mean(np.square(found))) < 1.45


def test_unknown_azimuth_is_found_at_a_connection_and_kept() -> None:
    """30 s turning from an unknown azimuth, 30 s still, twice; a good gyro's errors drawn, 12 runs.

    While it turns the Earth rate may not fake an azimuth; at the standstill 0.5 deg are found, at the next 0.3.
    """
    chosen = InertialSettings(
        gyro_bias_sigma=3e-7, gyro_bias_walk=1e-9, gyro_noise=1e-6, gyro_scale_sigma=3e-4, accel_bias_sigma=2e-3
    )
    time = np.arange(12_000) * 0.01
    rate = np.where(time % 60.0 < 30.0, 6.0 * np.sin(np.pi * (time % 60.0) / 30.0) ** 2, 0.0)
    toolface = np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1])) * 0.01)
    matrix = dcm(1.0, 0.6, toolface)
    turning = matrix @ earth_rate(np.radians(50.0)) + rate[:, None] * [0.0, 0.0, 1.0]
    found = []
    for seed in range(12):
        draw = np.random.default_rng(seed)
        gyro = (
            turning / (1.0 - draw.normal(0.0, 3e-4, 3)) + draw.normal(0.0, 3e-7, 3) + draw.normal(0, 1e-5, (12_000, 3))
        )
        shaking = np.where(rate > 0.0, 1.0, 0.03)[:, None]
        accel = matrix @ [0.0, 0.0, 9.80665] + draw.normal(0.0, 2e-3, 3) + shaking * draw.normal(0, 1.0, (12_000, 3))
        rows = gyro_attitude(Samples(time, 0.01, accel=accel, gyro=gyro), chosen, SITE)
        assert all("unobservable" in rows.names(k) for k in range(6))
        assert not any("unobservable" in rows.names(k) for k in range(6, len(rows)))
        assert (rows.u.azimuth[:6] > 1.7).all()
        found.append(wrap_signed(rows.angles.azimuth[[11, 17, 23]] - 1.0) / rows.u.azimuth[[11, 17, 23]])
    assert np.degrees(rows.u.azimuth[11]) == pytest.approx(0.5, abs=0.2)
    assert rows.u.azimuth[23] < 0.8 * rows.u.azimuth[11]
    assert 0.5 < np.sqrt(np.mean(np.square(found))) < 1.6


def test_smoother_bridges_casing_from_both_sides() -> None:
    """The field of 30 s is left out in both passes; a clipped first window has no row."""
    run = simulated("vibration-5g", 1)
    mag = run.mag.copy()
    mag[4000:9000] += 10_000.0
    clipped = np.zeros(len(run), bool)
    clipped[3] = True
    record = Samples(run.time, run.interval, run.accel, mag, run.gyro, clipped=clipped)
    forward, both = inertial_attitude(record, None, SITE), smoothed_attitude(record, None, SITE)
    assert list(np.flatnonzero(both.refused)) == [0]
    assert np.degrees(np.abs(score(both, run).azimuth).max()) < 0.1
    inside = (both.time > 25.0) & (both.time < 45.0)
    assert (both.u.azimuth[inside] <= forward.u.azimuth[inside] * (1.0 + 1e-9)).all()


def test_without_a_latitude_no_north_is_claimed() -> None:
    run = simulated("stationary", 0, 20.0)
    rows = gyro_attitude(samples(run, field=False), None, Site(g=9.80665))
    assert all("unobservable" in rows.names(k) for k in range(len(rows)))
    assert (rows.u.azimuth > 1.0).all()
    assert rms_deg(score(rows, run).inclination) < 0.2


@pytest.mark.long
def test_gyro_drift_grows_and_two_stations_close_it() -> None:
    """5 g, 120 s, 8 runs: open, honest and growing; closed, better in the middle and at the end, and honest."""
    opened, closed, grown = [], [], []
    for seed in range(8):
        run = simulate_drilling(drawn("vibration-5g", seed), seed, duration=120.0)
        record = samples(run, field=False)
        first, last = station(run, 0, seed), station(run, len(run) - 1, seed + 100)
        alone = gyro_attitude(record, TOLD, SITE, first)
        both = continuous_survey(record, first, last, TOLD, SITE)
        assert all("drift" in alone.names(k) for k in range(len(alone)))
        assert both.findings[0].code == "motion-misclosure"
        grown.append(alone.u.azimuth[[0, 11, 23]])
        opened.append(score(alone, run))
        closed.append(score(both, run))
    assert (np.diff(np.array(grown), axis=1) > 0.0).all()
    for row in (11, 23):
        before, after = (np.array([s.azimuth[row] for s in runs]) for runs in (opened, closed))
        assert rms_deg(after) < 0.6 * rms_deg(before)
    for runs in (opened, closed):
        assert 0.4 < np.mean([s.normalised.mean() for s in runs]) < 1.8


def test_a_station_that_contradicts_the_run_is_said() -> None:
    run = simulate_drilling(drawn("sliding", 0), 0, duration=30.0)
    record = samples(run, field=False)
    first, last = station(run, 0, 0), station(run, len(run) - 1, 1)
    turned = quaternion_from_dcm(dcm_from_quaternion(last.quaternion) @ rotation_exp([0.0, 0.0, 1.0]))
    rows = continuous_survey(record, first, replace(last, quaternion=turned), None, SITE)
    assert all("misfit" in rows.names(k) for k in range(len(rows)))


def test_bad_input_is_refused() -> None:
    run = _short()
    record, first = samples(run), station(run, 0, 0)
    bare = samples(run, field=False)
    with refused("input-triads"):
        inertial_attitude(bare, None, SITE)
    with refused("input-north"):
        inertial_attitude(record, None, SITE, first)
    with refused("input-station-far"):
        gyro_attitude(bare, None, SITE, replace(first, time=np.array([-60.0])))
    with refused("input-station-far"):
        continuous_survey(bare, first, replace(first, time=np.array([60.0])), None, SITE)
    with refused("input-north"):
        continuous_survey(bare, first, replace(first, north="magnetic"), None, SITE)
    with refused("input-shape", name="lever_arm"):
        InertialSettings(lever_arm=(0.0, 0.0))  # type: ignore[arg-type]
    assert len(inertial_attitude(record.part(0, 0), None, SITE)) == 0


def test_axes_askew_and_clocks_out_of_step_are_in_the_uncertainty_of_a_turning_tool() -> None:
    """2e-3 rad and 0.1 ms at the rate of rotation; a tool that stands still does not feel them."""
    turning, still = simulated("smooth", 1, 30.0), simulated("stationary", 1, 30.0)
    for run, more in ((turning, True), (still, False)):
        plain = inertial_attitude(samples(run), TOLD, SITE)
        rows = inertial_attitude(samples(run), None, SITE)
        tilt = np.sqrt(np.maximum(rows.u.inclination[-1] ** 2 - plain.u.inclination[-1] ** 2, 0.0))
        roll = np.sqrt(np.maximum(rows.covariance[-1, 2, 2] - plain.covariance[-1, 2, 2], 0.0))
        late = 1e-4 * np.sqrt(np.mean(run.gyro[:, 2] ** 2))
        assert tilt == pytest.approx(2e-3 if more else 0.0, abs=1e-4)
        assert (roll >= 0.99 * late) if more else (roll < 1e-4)


def test_a_field_out_of_step_turns_azimuth_by_less_than_three_uncertainties() -> None:
    """The magnetometer 0.2 ms late, twice the stated, at 120 rpm swinging: or it is refused."""
    run = simulate_drilling(replace(SCENARIOS["vibration-5g"], faults=(MagLag(0.2e-3),)), 1, duration=60.0)
    rows = inertial_attitude(samples(run), None, SITE)
    good = ~rows.refused
    assert np.abs(score(rows, run).azimuth[good] / rows.u.azimuth[good]).max(initial=0.0) < 3.0


def test_shaking_too_strong_for_a_linear_filter_is_refused() -> None:
    """Lateral acceleration of 5 g rms at a third of a hertz: no window's mean is gravity."""
    run = simulated("vibration-5g", 2, 60.0)
    phase = np.random.default_rng(3).uniform(0.0, 6.28, (3, 40))
    rates = np.linspace(0.2, 0.6, 40)[:, None]
    sway = np.stack([np.sin(2.0 * np.pi * rates * run.time + p[:, None]).sum(axis=0) for p in phase], axis=1)
    matrix = dcm(run.truth.azimuth, run.truth.inclination, run.truth.toolface)
    shaken = run.accel + 11.0 * np.einsum("nij,nj->ni", matrix, sway)
    rows = inertial_attitude(Samples(run.time, run.interval, shaken, run.mag, run.gyro), None, SITE)
    assert rows.refused.all()
    assert any("vibration" in rows.names(k) for k in range(len(rows)))


def test_a_gyro_started_while_rotating_is_right_or_refused() -> None:
    """Scale error 0.1 %, 120 rpm, azimuth unknown: inclination within four uncertainties where one is given."""
    for seed in range(3):
        run = simulated("smooth", seed, 60.0)
        rows = gyro_attitude(samples(run, field=False), None, SITE)
        good = ~rows.refused
        assert np.abs(score(rows, run).inclination[good] / rows.u.inclination[good]).max(initial=0.0) < 4.0
