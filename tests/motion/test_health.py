"""Bad readings are named, good ones are not: every check on the scenarios, clean and spoilt."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from inclinometry.earth.site import Site
from inclinometry.findings import Finding
from inclinometry.motion.reference import azimuth_uncertainty
from inclinometry.motion.result import Samples
from inclinometry.motion.window_checks import HealthCheck, HealthSettings, WindowHealth
from inclinometry.motion.window_filter import WindowBuffer
from inclinometry.simulate.drilling import SCENARIOS, DrillingSimulation, Scenario, simulate_drilling
from inclinometry.simulate.drilling.scenario import Casing, Hole, Stuck

from ..refusals import refused

G = 9.80665
SITE = Site(b=50_000.0, dip=Hole().dip)
SWAP = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@cache
def run(name: str, seed: int = 1, duration: float = 60.0) -> DrillingSimulation:
    return simulate_drilling(name, seed, duration=duration)


def with_instrument(name: str, **changes: object) -> Scenario:
    scenario = SCENARIOS[name]
    return replace(scenario, instrument=replace(scenario.instrument, **changes))


def with_triad(name: str, triad: str, **changes: object) -> Scenario:
    return with_instrument(name, **{triad: replace(getattr(SCENARIOS[name].instrument, triad), **changes)})


def checked(
    simulation: DrillingSimulation | Scenario,
    *,
    site: Site | None = None,
    settings: HealthSettings | None = None,
    window: float = 10.0,
    drop: str = "",
    mapped: tuple[str, np.ndarray] | None = None,
) -> list[WindowHealth]:
    if isinstance(simulation, Scenario):
        simulation = simulate_drilling(simulation, 1, duration=60.0)
    columns = {name: getattr(simulation, name) for name in ("accel", "mag", "gyro") if name != drop}
    if mapped is not None:
        columns[mapped[0]] = columns[mapped[0]] @ mapped[1].T
    check = HealthCheck(settings, site)
    samples = Samples(simulation.time, simulation.interval, **columns)
    return [check.check(part) for part in WindowBuffer(window).push(samples)]


def share(found: list[WindowHealth], flag: str) -> float:
    return sum(one.has(flag) for one in found) / len(found)


@pytest.mark.long
@pytest.mark.parametrize("name", list(SCENARIOS))
@pytest.mark.parametrize("drop", ["", "gyro"])
@pytest.mark.parametrize("window", [2.0, 10.0])
def test_clean_scenarios_raise_no_finding(name: str, drop: str, window: float) -> None:
    for site in (None, SITE):
        assert not any(one.faults for one in checked(run(name), site=site, window=window, drop=drop))


def test_an_element_that_clips_shows_as_a_pile_where_no_filter_follows() -> None:
    """8 g under 5 g rms without a low-pass: a tenth of the samples at the ends, every window."""
    scenario = replace(with_triad("vibration-5g", "accel", reach=8.0 * G))
    scenario = replace(scenario, instrument=replace(scenario.instrument, taps=1))
    found = checked(scenario)
    assert share(found, "clipped") == 1.0
    for one in found:
        at_the_end = (np.abs(one.samples.accel) >= 8.0 * G).any(axis=1)
        assert np.array_equal(one.samples.clipped, at_the_end)


@pytest.mark.parametrize(("reach", "expected"), [(8.0, 1.0), (16.0, 0.0)])
def test_clipping_before_a_filter_is_told_by_the_range(reach: float, expected: float) -> None:
    """8 g makes 2.8 deg and must be refused; 16 g loses 0.1 % of 5 g rms (0.03 deg). 12 g, 0.4 deg, is the limit."""
    found = checked(
        with_triad("vibration-5g", "accel", reach=reach * G), settings=HealthSettings(accel_range=reach * G)
    )
    assert share(found, "clipped") == expected
    assert all(one.unusable("accel") == bool(expected) for one in found)


def test_a_magnetometer_whose_range_is_too_small_is_found() -> None:
    assert share(checked(with_triad("vibration-5g", "mag", reach=20_000.0)), "clipped") == 1.0


@pytest.mark.long
@pytest.mark.parametrize("name", ["smooth", "vibration-5g", "stick-slip", "sliding", "stationary"])
@pytest.mark.parametrize("channel", ["accel_x", "accel_z", "mag_x", "mag_z"])
def test_a_channel_that_sticks_is_found_in_every_whole_window(name: str, channel: str) -> None:
    found = checked(replace(SCENARIOS[name], faults=(Stuck(channel, start=5.0),)))
    assert share(found[1:], "stuck") == 1.0
    assert all(one.unusable(channel.partition("_")[0]) for one in found[1:])


@pytest.mark.parametrize("step", [0.01, 0.1])
def test_coarse_steps_are_not_stuck_nor_clipped(step: float) -> None:
    """Noise of 0.03 m/s^2 under steps of three times that, a still tool: channels keep one value or two."""
    rng = np.random.default_rng(5)
    for trial in range(40):
        truth = rng.normal(size=3)
        accel = 9.81 * truth / np.linalg.norm(truth) + rng.normal(0.0, 0.03, (1000, 3))
        mag = rng.normal(size=3) * 25_000.0 + rng.normal(0.0, 20.0, (1000, 3))
        rows = Samples(
            np.arange(1000) / 100.0, 0.01, accel=np.rint(accel / step) * step, mag=np.rint(mag / 100.0) * 100.0
        )
        found = HealthCheck(HealthSettings(believe_axes=True)).check(rows)
        assert not {"stuck", "clipped"} & {one.flag for one in found.faults}, trial


def test_coarse_steps_of_a_turning_field_are_not_stuck_nor_clipped() -> None:
    """Turning points at one code, an axial channel at one code: 1 to 100 rpm with steps of 200 nT."""
    time = np.arange(2000) / 200.0
    for rpm in (1.0, 3.0, 10.0, 33.3, 100.0):
        angle = rpm * np.pi / 30.0 * time
        mag = np.stack([2e4 * np.cos(angle), -2e4 * np.sin(angle), np.full(2000, 4e4)], axis=1)
        mag += np.random.default_rng(1).normal(0.0, 20.0, mag.shape)
        found = HealthCheck().check(Samples(time, 0.005, mag=np.rint(mag / 200.0) * 200.0))
        assert found.faults == (), rpm


def test_rows_that_repeat_the_one_before_are_said() -> None:
    simulation = run("vibration-5g")
    double = np.arange(len(simulation)) // 2 * 2
    found = checked(replace(simulation, accel=simulation.accel[double], mag=simulation.mag[double],
                            gyro=simulation.gyro[double]))  # fmt: skip
    assert all(one.faults[0].code == "motion-rows-repeat" for one in found)
    assert found[0].faults[0].values["share_percent"] == pytest.approx(50.0, abs=0.1)


@pytest.mark.parametrize("drop", ["", "gyro"])
@pytest.mark.parametrize(("name", "factor"), [("fast", 80), ("fast", 120), ("stick-slip", 80), ("stick-slip", 200)])
def test_sampling_too_slow_is_said_with_the_rate_needed(name: str, factor: int, drop: str) -> None:
    """25 to 10 Hz for 600 rpm: 0.4 turns a sample and more."""
    found = checked(with_instrument(name, factor=factor, taps=1), drop=drop)
    assert share(found, "aliased") == 1.0
    slow = next(one for one in found[0].faults if one.code == "motion-sampled-slowly")
    assert slow.values["rate_Hz"] > 1.0 / slow.values["interval_s"]


def test_sampling_fast_enough_is_not_aliased() -> None:
    """33 Hz for 600 rpm: 0.3 turns a sample."""
    assert share(checked(with_instrument("fast", factor=60, taps=1)), "aliased") == 0.0


@pytest.mark.parametrize("name", ["vibration-5g", "stick-slip", "sliding", "stationary"])
@pytest.mark.parametrize("site", [None, SITE])
def test_casing_leaves_no_field(name: str, site: Site | None) -> None:
    found = checked(replace(SCENARIOS[name], faults=(Casing(),)), site=site)
    assert share(found, "no-field") == 1.0
    assert all(one.unusable("mag") for one in found)


def test_weak_field_and_lost_rotation_are_no_field() -> None:
    simulation = run("vibration-5g")
    weak = checked(replace(simulation, mag=0.05 * simulation.mag), settings=HealthSettings(believe_axes=True))
    assert share(weak, "no-field") == 1.0
    still = checked(replace(simulation, mag=np.tile(simulation.mag[:1], (len(simulation), 1))))
    assert share(still, "no-field") == 1.0


@pytest.mark.parametrize(
    ("triad", "matrix", "code"),
    [
        ("accel", np.eye(3) / G, "motion-unit"),
        ("accel", -np.eye(3), "motion-signs"),
        ("mag", np.eye(3) / 1000.0, "motion-unit"),
        ("mag", SWAP, "motion-field-mirrored"),
        ("mag", np.diag([1.0, -1.0, 1.0]), "motion-field-mirrored"),
        ("mag", np.diag([1.0, 1.0, -1.0]), "motion-mag-axes-dip"),
        ("accel", np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]]), "motion-mag-axes"),
        ("gyro", -np.eye(3), "motion-field-mirrored"),
        ("gyro", np.eye(3) * np.degrees(1.0), "motion-size"),
        ("gyro", np.array([[0, 0, 1.0], [0, 1.0, 0], [-1.0, 0, 0]]), "motion-axis"),
    ],
)
def test_wrong_units_signs_and_axes_are_refused_with_the_remedy(triad: str, matrix: np.ndarray, code: str) -> None:
    with refused(code):
        checked(run("vibration-5g"), site=SITE, mapped=(triad, matrix))
    believed = checked(run("vibration-5g"), settings=HealthSettings(believe_axes=True), mapped=(triad, matrix))
    assert len(believed) == 6


def test_slow_gyro_in_degrees_is_told_by_the_field() -> None:
    """20 rpm read as 1146 rpm: possible for a gyro, but not what the field does."""
    scenario = SCENARIOS["vibration-5g"]
    slow = replace(scenario, rotation=replace(scenario.rotation, speed=20.0 * np.pi / 30.0))
    with refused("motion-gyro-unit") as caught:
        checked(slow, mapped=("gyro", np.eye(3) * np.degrees(1.0)))
    assert caught.value.finding.values["unit"] == "deg/s"


def permuted(order: tuple[int, int, int], signs: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> np.ndarray:
    return np.eye(3)[list(order)] * np.array(signs)[:, None]


@pytest.mark.parametrize(
    ("inclination", "triad", "matrix", "codes"),
    [
        (3.0, "accel", permuted((2, 0, 1)), ("motion-axis-accel",)),
        (15.0, "accel", permuted((0, 2, 1)), ("motion-axis-accel", "motion-mag-axes")),
        (30.0, "mag", permuted((2, 0, 1)), ("motion-axis",)),
        (60.0, "mag", permuted((0, 2, 1), (1.0, -1.0, 1.0)), ("motion-axis",)),
        (88.0, "mag", permuted((1, 0, 2)), ("motion-field-mirrored", "motion-mag-axes")),
    ],
)
@pytest.mark.parametrize("drop", ["", "gyro"])
def test_exchanged_axes_at_other_inclinations(
    inclination: float, triad: str, matrix: np.ndarray, codes: tuple[str, ...], drop: str
) -> None:
    scenario = SCENARIOS["vibration-5g"]
    steep = replace(scenario, hole=replace(scenario.hole, inclination=np.radians(inclination)))
    simulation = simulate_drilling(steep, 2, duration=60.0)
    assert not any(one.faults for one in checked(simulation, site=SITE, drop=drop))
    with refused(*codes):
        checked(simulation, site=SITE, mapped=(triad, matrix), drop=drop)


@pytest.mark.long
def test_casing_is_not_taken_for_wrong_axes() -> None:
    """Field of any direction and nearly the right strength for a minute, before the axes were seen to be right."""
    for seed in range(8):
        scenario = replace(SCENARIOS["stick-slip"], faults=(Casing(left=0.3, disturbance=27_000.0, period=60.0),))
        for window in (2.0, 10.0):
            checked(simulate_drilling(scenario, seed, duration=60.0), site=SITE, window=window)


def test_a_gyro_that_sticks_is_told_by_the_field() -> None:
    """The field is then judged without it, and is good."""
    found = checked(replace(SCENARIOS["vibration-5g"], faults=(Stuck("gyro_z", start=5.0),)))
    assert all({each.flag for each in one.faults} == {"stuck"} and one.unusable("gyro") for one in found[1:])


def test_swapped_axes_are_named_without_a_gyro() -> None:
    with refused("motion-mag-axes") as caught:
        checked(run("vibration-5g"), site=SITE, mapped=("mag", SWAP), drop="gyro")
    assert "+y,+x,+z" in caught.value.finding.values["axes"]


def test_specific_force_of_a_still_tool_without_a_field() -> None:
    with refused("motion-signs"):
        checked(run("stationary"), mapped=("accel", -np.eye(3)), drop="mag")


def test_settings_are_checked() -> None:
    with refused("input-value", name="accel_range"):
        HealthSettings(accel_range=0.0)


def test_findings_count_windows() -> None:
    check = HealthCheck()
    simulation = run("vibration-5g")
    samples = Samples(simulation.time, simulation.interval, accel=simulation.accel, gyro=simulation.gyro)
    for part in WindowBuffer(10.0).push(samples):
        check.check(part)
    assert check.findings() == (Finding("motion-no-magnetometer", {"windows": 6, "total": 6}, severity="note"),)


def test_a_gyro_stuck_at_its_mean_speed_is_told_by_the_field() -> None:
    """The angle after 10 s is right; on the way there it is not."""
    simulation = run("stick-slip")
    gyro = simulation.gyro.copy()
    gyro[:, 2] = gyro[:, 2].mean()
    found = checked(replace(simulation, gyro=gyro), site=SITE)
    assert all(one.unusable("gyro") and not one.unusable("mag") for one in found)


def test_short_runs_with_wrong_signs_are_refused() -> None:
    """Three windows are enough for gravity reversed, and for a gyro that turns the other way; turning or sliding."""
    for name in ("vibration-5g", "sliding"):
        simulation = simulate_drilling(name, 4, duration=30.5)
        for triad, code in (("accel", "motion-signs"), ("gyro", "motion-field-mirrored")):
            with refused(code):
                checked(simulation, site=SITE, mapped=(triad, -np.eye(3)))


def test_a_hole_that_climbs_is_doubted() -> None:
    """Channels of which y and z are reversed: nothing contradicts, but the hole would climb."""
    simulation = run("vibration-5g")
    turned = np.array([1.0, -1.0, -1.0])
    check = HealthCheck(site=SITE)
    columns = {name: getattr(simulation, name) * turned for name in ("accel", "mag", "gyro")}
    for part in WindowBuffer(10.0).push(Samples(simulation.time, simulation.interval, **columns)):
        assert check.check(part).faults == ()
    assert check.findings() == (Finding("motion-climbs"),)


def test_a_field_off_the_site_widens_the_azimuth() -> None:
    """2 deg of dip at a dip of 65 deg: 2 / cos 65 = 4.7 deg of azimuth."""
    site = Site(b=50_000.0, dip=np.radians(67.0))
    for one in checked(run("stationary"), site=site):
        assert abs(np.degrees(azimuth_uncertainty(one.off, site)) - 2.0 / np.cos(np.radians(67.0))) < 0.5
    for one in checked(run("stationary"), site=SITE):
        assert azimuth_uncertainty(one.off, SITE) == 0.0
