"""The chooser: right method for what the tool does, right answer, refusals with reasons, any blocks."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from inclinometry.earth.site import Site
from inclinometry.findings import Finding
from inclinometry.motion.automatic import AttitudeChooser, ChooserSettings, choose_attitude
from inclinometry.motion.magnetic.phase import MagneticSettings
from inclinometry.motion.magnetic.window import magnetic_attitude
from inclinometry.motion.reference import to_magnetic
from inclinometry.motion.result import METHODS, Attitude, Samples, joined
from inclinometry.motion.timing import StretchCutter, rejoined
from inclinometry.motion.window_checks import HealthSettings
from inclinometry.rotations import wrap_signed
from inclinometry.simulate.drilling import SCENARIOS, DrillingSimulation, simulate_drilling
from inclinometry.simulate.drilling.scenario import Casing, Dropped, Hole, Jitter, MagLag, Repeated, Stuck

from ..refusals import refused

SITE = Site(b=50_000.0, dip=Hole().dip, g=9.80665, latitude=Hole().latitude)


@cache
def run(name: str, duration: float = 60.0) -> DrillingSimulation:
    return simulate_drilling(name, 1, duration=duration)


def samples(simulation: DrillingSimulation, *drop: str) -> Samples:
    columns = {name: getattr(simulation, name) for name in ("accel", "mag", "gyro") if name not in drop}
    return Samples(simulation.time, simulation.interval, **columns)


def spoilt(name: str, *faults: object, duration: float = 120.0) -> Samples:
    return samples(simulate_drilling(replace(SCENARIOS[name], faults=faults), 1, duration=duration))


def methods(rows: Attitude) -> Counter[str]:
    return Counter("refused" if bad else METHODS[int(m)] for m, bad in zip(rows.method, rows.refused, strict=True))


def errors(rows: Attitude) -> tuple[float, float]:
    """Largest errors of inclination and azimuth, deg; the hole is straight."""
    good = ~rows.refused
    inclination = np.degrees(rows.angles.inclination[good]) - 30.0
    azimuth = np.degrees(wrap_signed(rows.angles.azimuth[good] - np.radians(60.0)))
    return float(np.abs(inclination).max()), float(np.abs(azimuth).max())


def same(one: Attitude, other: Attitude) -> None:
    for name in ("time", "quaternion", "covariance", "rate", "quality", "flags", "method"):
        assert np.array_equal(getattr(one, name), getattr(other, name), equal_nan=name != "method"), name
    assert one.findings == other.findings


@pytest.mark.long
@pytest.mark.parametrize("name", list(SCENARIOS))
def test_method_and_accuracy_of_every_scenario(name: str) -> None:
    """Limits: three times the spec's 10 s figures of 5 g, and of 20 g where it shakes so or turns fast."""
    rows = choose_attitude(samples(run(name)), site=SITE)
    wanted = {"static"} if name == "stationary" else {"magnetic", "mean"}
    assert set(methods(rows)) <= wanted
    strong = name in ("vibration-20g", "fast", "stick-slip")
    limits = (0.3, 0.6) if strong else (0.08, 0.16)
    assert np.less_equal(errors(rows), limits).all()
    assert len(rows) == 6
    assert rows.north == "magnetic"


def test_rows_are_those_of_the_method() -> None:
    """Where one method serves all windows, its own rows."""
    part = samples(run("vibration-5g"))
    rows = choose_attitude(part, site=SITE)
    alone = magnetic_attitude(part, MagneticSettings(overlap=0.0, site=SITE))
    for name in ("time", "quaternion", "covariance", "rate", "method"):
        assert np.array_equal(getattr(rows, name), getattr(alone, name)), name


def test_without_a_gyro_the_field_serves() -> None:
    rows = choose_attitude(samples(run("vibration-5g"), "gyro"), site=SITE)
    assert set(methods(rows)) <= {"magnetic", "mean"}
    assert errors(rows)[1] < 0.16


def test_without_a_field_the_gyro_serves_and_north_is_true() -> None:
    rows = choose_attitude(samples(run("stationary"), "mag"), site=SITE)
    assert methods(rows) == {"gyro": 6}
    assert rows.north == "true"
    assert [one.code for one in rows.findings] == ["motion-windows", "motion-no-magnetometer"]


def test_accelerometers_alone_serve_at_rest_only() -> None:
    rows = choose_attitude(samples(run("stationary"), "mag", "gyro"), site=SITE)
    assert methods(rows) == {"static": 6}
    assert errors(rows)[0] < 0.05
    assert all("unobservable" in rows.names(k) for k in range(6))
    rows = choose_attitude(samples(run("vibration-5g"), "mag", "gyro"), site=SITE)
    assert methods(rows) == {"refused": 6}
    assert all("no-field" in rows.names(k) for k in range(6))
    (moving,) = rows.findings[0].values["kinds"]
    assert (moving.values["kind"], moving.values["method"]) == ("moving", "refused")


@pytest.mark.long
@pytest.mark.parametrize("name", ["vibration-5g", "stick-slip", "sliding"])
def test_the_filter_carries_on_through_casing(name: str) -> None:
    """Twenty to thirty seconds in casing, its ends within windows."""
    rows = choose_attitude(spoilt(name, Casing(56.0, 85.0)), site=SITE)
    found = methods(rows)
    assert found["filter"] == 4
    assert found["refused"] == 0
    carried = np.flatnonzero(rows.method == METHODS.index("filter"))
    assert all({"disturbed", "drift"} <= set(rows.names(int(k))) for k in carried)
    assert sum("no-field" in rows.names(int(k)) for k in carried) >= 3
    assert errors(rows)[1] < 0.6


def test_a_disturbed_field_is_left_for_the_filter_where_that_knows_better() -> None:
    """A tenth of the field gone and 3 uT beside it: 6 deg of azimuth by the field."""
    rows = choose_attitude(spoilt("vibration-5g", Casing(56.0, 85.0, left=0.9, disturbance=3000.0)), site=SITE)
    assert methods(rows)["filter"] >= 3
    assert errors(rows)[1] < 0.6


def test_casing_without_a_gyro_is_refused() -> None:
    part = spoilt("vibration-5g", Casing(56.0, 85.0))
    rows = choose_attitude(replace(part, gyro=None), site=SITE)
    assert methods(rows)["refused"] == 4
    assert all("no-field" in rows.names(int(k)) for k in np.flatnonzero(rows.refused))


def test_casing_from_the_start_waits_for_a_field() -> None:
    """The filter must not start from the field of the casing; the gyro's north needs a declination."""
    part = spoilt("vibration-5g", Casing(0.0, 30.0))
    rows = choose_attitude(part, site=SITE)
    assert rows.refused[:3].all()
    assert not rows.refused[3:].any()
    assert errors(rows)[1] < 0.16
    rows = choose_attitude(part, site=replace(SITE, declination=0.0, declination_sigma=0.01))
    assert (rows.method[:3] == METHODS.index("gyro")).all()
    assert rows.north == "magnetic"


def test_a_stuck_gyro_is_not_used() -> None:
    rows = choose_attitude(spoilt("vibration-5g", Stuck("gyro_z", start=30.0)), site=SITE)
    assert set(methods(rows)) <= {"magnetic", "mean"}
    assert errors(rows)[1] < 0.16


def test_a_stuck_accelerometer_is_refused() -> None:
    rows = choose_attitude(spoilt("vibration-5g", Stuck("accel_x", start=60.0)), site=SITE)
    assert rows.refused[6:].all()
    assert not rows.refused[:6].any()
    assert all("stuck" in rows.names(k) for k in range(6, 12))


def test_clipping_is_refused() -> None:
    tool = SCENARIOS["vibration-5g"].instrument
    reach = 8.0 * 9.80665
    scenario = replace(SCENARIOS["vibration-5g"], instrument=replace(tool, accel=replace(tool.accel, reach=reach)))
    part = samples(simulate_drilling(scenario, 1, duration=60.0))
    rows = choose_attitude(part, ChooserSettings(health=HealthSettings(accel_range=reach)), SITE)
    assert rows.refused.all()
    assert all("clipped" in rows.names(k) for k in range(6))


def test_sampling_too_slow_is_refused_without_a_gyro() -> None:
    scenario = SCENARIOS["stick-slip"]
    scenario = replace(scenario, instrument=replace(scenario.instrument, factor=80, taps=1))
    rows = choose_attitude(samples(simulate_drilling(scenario, 1, duration=60.0), "gyro"), site=SITE)
    assert all("aliased" in rows.names(k) for k in range(len(rows)))
    assert rows.refused.all()


@pytest.mark.parametrize("triad", ["accel", "mag", "gyro"])
def test_a_dead_triad_is_not_used(triad: str) -> None:
    part = samples(run("vibration-5g"))
    rows = choose_attitude(replace(part, **{triad: np.zeros_like(part.accel)}), site=SITE)
    flag = {"accel": "misfit", "mag": "no-field", "gyro": "stuck"}[triad]
    assert all(flag in rows.names(k) for k in range(len(rows)))
    if triad == "accel":
        assert rows.refused.all()
    if triad == "gyro":
        assert errors(rows)[1] < 0.16


def test_a_late_magnetometer_is_said() -> None:
    rows = choose_attitude(spoilt("vibration-5g", MagLag(0.005), duration=60.0), site=SITE)
    (late,) = [one for one in rows.findings if one.code == "motion-mag-lag"]
    assert late.values["late_ms"] == pytest.approx(5.0, abs=0.05)
    assert errors(rows)[1] < 0.16


def test_wrong_axes_are_refused_with_the_remedy() -> None:
    part = samples(run("vibration-5g"))
    with refused("motion-field-mirrored", "motion-mag-axes"):
        choose_attitude(replace(part, mag=part.mag[:, [1, 0, 2]]), site=SITE)


def test_connection_between_two_stands_of_drilling() -> None:
    """Rotating, at rest, rotating: the rest is found by what the window shows."""
    parts = [run("vibration-5g"), run("stationary"), run("vibration-5g")]
    columns = {name: np.concatenate([getattr(one, name) for one in parts]) for name in ("accel", "mag", "gyro")}
    rows = choose_attitude(Samples(np.arange(36_000) / 200.0, 0.005, **columns), site=SITE)
    kinds = Counter[str]()
    for one in rows.findings[0].values["kinds"]:
        kinds[one.values["kind"]] += one.values["count"]
    assert kinds == {"still": 6, "rotating": 12}
    assert (rows.method[6:12] == METHODS.index("static")).all()


def test_through_raw_stamps_with_every_defect() -> None:
    """Lost and repeated rows, jitter: one row in 500 lost costs a factor of 13 (0.013 to 0.17 deg), and u says so."""
    scenario = replace(SCENARIOS["vibration-5g"], faults=(Dropped(0.002), Repeated(0.002), Jitter(0.0003)))
    raw = simulate_drilling(scenario, 1, duration=120.0)
    order = np.diff(raw.time, prepend=-1.0) > 0.0
    raw = raw.rows(np.flatnonzero(order))  # a repeated row with another jitter is not a repetition
    cutter = StretchCutter()
    pieces = [*cutter.push(raw.time, raw.accel, raw.mag, raw.gyro), *cutter.finish()]
    rows = choose_attitude(rejoined([piece.samples for piece in pieces]), site=SITE)
    off = np.abs(wrap_signed(rows.angles.azimuth - np.radians(60.0)))
    assert (off < 3.5 * rows.u.azimuth).all()
    assert errors(rows)[1] < 3.0
    assert all("gap" in rows.names(k) for k in range(len(rows)))
    assert cutter.report.filled > 0


@cache
def eventful() -> tuple[Samples, Attitude]:
    """A run with everything that has a memory: casing, a stuck gyro, a gap, standstill."""
    part = spoilt("vibration-5g", Casing(12.0, 17.0), Stuck("gyro_z", 22.0, 24.0), duration=30.0)
    rest = run("stationary", 10.0)
    columns = {name: np.concatenate([getattr(part, name), getattr(rest, name)]) for name in ("accel", "mag", "gyro")}
    time = np.arange(8000) / 200.0
    whole = Samples(time, 0.005, **columns)
    return whole, chosen_in_blocks(whole, [0, 4100, 4300, 8000])


def chosen_in_blocks(whole: Samples, edges: list[int]) -> Attitude:
    chooser = AttitudeChooser(ChooserSettings(window=2.0), SITE)
    parts = []
    for start, stop in pairwise(edges):
        for first, last in ((start, min(stop, 4150)), (max(start, 4200), stop)):  # 50 samples are missing
            if first <= last:
                parts.append(chooser.push(whole.part(first, last)))
    parts.append(chooser.finish())
    return joined(parts)


@pytest.mark.long
@settings(max_examples=12, deadline=None)
@given(cuts=st.lists(st.integers(0, 8000), max_size=8))
@example(cuts=[0, 0, 1, 400, 401, 4149, 4150, 4151, 4200, 4201, 8000])
def test_same_rows_for_any_blocks(cuts: list[int]) -> None:
    whole, expected = eventful()
    assert {"static", "filter"} <= set(methods(expected))
    same(chosen_in_blocks(whole, [0, *sorted(cuts), 8000]), expected)


def test_runs_that_cannot_be_used() -> None:
    with refused("input-triads", lacking=("accel",)):
        choose_attitude(samples(run("stationary"), "accel"))
    short = choose_attitude(samples(run("stationary")).part(0, 1500))
    assert len(short) == 0
    assert short.findings[0] == Finding("motion-no-window", {"window_s": 10.0})
    with refused("input-value", name="window"):
        ChooserSettings(window=0.1)


def test_north_of_a_row_is_turned_by_the_declination() -> None:
    rows = choose_attitude(samples(run("stationary"), "mag"), site=SITE)
    turned = to_magnetic(rows, replace(SITE, declination=0.1, declination_sigma=0.02))
    assert turned is not None
    off = wrap_signed(rows.angles.azimuth - turned.angles.azimuth)
    assert np.allclose(off, 0.1, atol=1e-12)
    assert np.allclose(rows.angles.toolface, turned.angles.toolface, atol=1e-9)
    assert np.allclose(turned.covariance[0] - rows.covariance[0], 4e-4 * np.outer(*2 * [down(rows)]), atol=1e-12)
    assert to_magnetic(rows, SITE) is None


def down(rows: Attitude) -> np.ndarray:
    inclination, toolface = rows.angles.inclination[0], rows.angles.toolface[0]
    return np.array(
        [-np.sin(inclination) * np.cos(toolface), np.sin(inclination) * np.sin(toolface), np.cos(inclination)]
    )
