"""Rotation shots, repeated stations, dual depth."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.orientation import angles, fields
from inclinometry.survey.flags import OFF, unjudged
from inclinometry.survey.quality import dual_depth, repeated_stations, rotation_shots, with_sensors
from inclinometry.survey.stations import Source, Stations

NOISE = np.diag([0.001] * 3 + [30.0] * 3) ** 2
ROUND = np.radians(np.arange(0.0, 360.0, 45.0))
BIASES = {"ABXY-TI1S": 0.004, "ABZ": 0.004, "MBXY-TI1S": 70.0, "MBZ": 70.0}
SENSORS = {"ABXY-TI1S": 0.004, "ABZ": 0.004, "MBXY-TI1S": 70.0, "MBZ": 70.0, "MSZ": 0.0016}


def shots(toolface=ROUND, inclination_deg=50.0, bias=(0.0,) * 6, seed=None, dip=1.2, **more):
    g, b = fields(0.7, np.radians(inclination_deg), np.asarray(toolface), dip)
    size = len(g)
    error = np.tile(bias, (size, 1))
    if seed is not None:
        error = error + np.random.default_rng(seed).multivariate_normal(np.zeros(6), NOISE, size)
    noise = np.tile(NOISE, (size, 1, 1))
    return Stations(np.arange(size), 9.81 * g + error[:, :3], 5e4 * b + error[:, 3:], noise=noise, **more)


def by_name(checks):
    return {check.name.split(": ")[1]: check for check in checks}


def test_shots_of_a_good_tool_agree():
    assert {check.verdict for check in rotation_shots(shots(seed=1))} == {"pass"}


def test_transverse_bias_turns_with_the_tool_and_fails():
    found = by_name(rotation_shots(shots(bias=(0.0, 0.0, 0.0, 500.0, 0.0, 0.0))))
    assert {name for name, check in found.items() if check.verdict == "fail"} == {"azimuth", "magnetic field", "dip"}
    assert found["azimuth"].reason.values["advice"] == OFF["toolface"]
    found = by_name(rotation_shots(shots(bias=(0.02, 0.0, 0.0, 0.0, 0.0, 0.0))))
    assert {"gravity", "inclination"} <= {name for name, check in found.items() if check.verdict == "fail"}


def test_what_does_not_turn_cancels():
    """An axial bias moves all shots alike: it neither fails nor widens the limits."""
    found = rotation_shots(shots(bias=(0.0, 0.0, 0.0, 0.0, 0.0, 900.0)))
    assert by_name(found)["magnetic field"].verdict == "pass"
    plain = by_name(rotation_shots(shots()))["magnetic field"].limit
    axial = Source(np.tile(np.eye(6)[:, 5:], (8, 1, 1)), np.array([[900.0**2]]))
    known = by_name(rotation_shots(shots(sources={"axial": axial})))["magnetic field"].limit
    assert known == pytest.approx(plain, rel=1e-9)


def test_known_transverse_errors_widen_the_limits_to_what_they_do():
    tool = with_sensors(shots(), {"MBX": 500.0, "MBY": 500.0})
    limit = by_name(rotation_shots(tool))["magnetic field"].limit
    biased = shots(bias=(0.0, 0.0, 0.0, 500.0, 0.0, 0.0))
    assert by_name(rotation_shots(biased))["magnetic field"].verdict == "fail"
    assert (
        by_name(rotation_shots(with_sensors(biased, {"MBX": 500.0, "MBY": 500.0})))["magnetic field"].verdict == "pass"
    )
    assert limit > 500.0


@pytest.mark.long
def test_spread_of_draws_has_the_stated_size():
    random, count = np.random.default_rng(3), 2000
    sd = np.array([0.004] * 3 + [70.0] * 3)
    rows = []
    for _ in range(count):
        run = shots(bias=random.normal(0.0, 1.0, 6) * sd, seed=int(random.integers(1 << 31)))
        found = angles(run.g, run.b)
        sizes = np.linalg.norm(run.g, axis=1), np.linalg.norm(run.b, axis=1)
        rows.append([v[0] - v.mean() for v in (found.inclination, found.azimuth, *sizes)])
    # shots without errors all lie on their mean: the figures are those of the first, which is what was drawn
    stated = [check.limit / 3.0 for check in rotation_shots(with_sensors(shots(), BIASES))][:4]
    # 2000 draws: 1.6 %; four of them
    np.testing.assert_allclose(np.std(rows, axis=0), stated, rtol=0.065)


@pytest.mark.parametrize(
    ("toolface_deg", "code"),
    [([0.0, 120.0], "input-few"), ([0.0, 30.0, 60.0, 90.0], "survey-toolfaces")],
)
def test_shots_that_do_not_go_round_are_not_judged(toolface_deg, code):
    found = rotation_shots(shots(np.radians(toolface_deg), bias=(0.0, 0.0, 0.0, 5000.0, 0.0, 0.0)))
    assert {check.verdict for check in found} == {"not judged"}
    assert {check.reason.code for check in found} == {code}


def test_steep_shots_judge_neither_azimuth_nor_gravity():
    found = by_name(rotation_shots(shots(inclination_deg=2.0)))
    assert found["azimuth"].verdict == "not judged"
    assert found["azimuth"].reason == unjudged("the stations have no azimuth")
    assert found["gravity"].verdict == "not judged"
    assert found["gravity"].reason == unjudged("the sensors across the tool hardly contribute here")
    assert found["inclination"].verdict == "pass"


def test_magnetic_field_along_the_tool_is_not_judged_by_its_size():
    found = by_name(rotation_shots(shots(inclination_deg=30.0, dip=np.radians(59.0))))
    assert found["magnetic field"].verdict == "pass"
    g, b = fields(0.0, np.radians(30.0), ROUND, np.radians(60.5))
    along = Stations(np.arange(8.0), 9.81 * g, 5e4 * b, noise=np.tile(NOISE, (8, 1, 1)))
    assert by_name(rotation_shots(along))["magnetic field"].verdict == "not judged"


def test_nothing_known_is_not_judged():
    run = shots()
    found = rotation_shots(Stations(run.md, run.g, run.b))
    assert {check.verdict for check in found} == {"not judged"}


def at(toolface_deg, md=100.0, bias=(0.0,) * 6, sensors=None, azimuth=0.7):
    g, b = fields(np.array([azimuth]), np.radians(50.0), np.radians(toolface_deg), 1.2)
    run = Stations([md], 9.81 * g + np.array(bias[:3]), 5e4 * b + np.array(bias[3:]), noise=NOISE[None])
    return run if sensors is None else with_sensors(run, sensors)


def test_repeat_of_the_same_tool_sees_only_what_the_toolface_changes():
    bias = (0.0, 0.0, 0.0, 0.0, 0.0, 2000.0)
    same = repeated_stations(at(20.0, bias=bias), at(20.0, bias=bias), same_tool=True)
    assert {check.verdict for check in same} == {"pass"}
    tight = by_name(repeated_stations(at(20.0, sensors=SENSORS), at(20.0, sensors=SENSORS), same_tool=True))
    loose = by_name(repeated_stations(at(20.0, sensors=SENSORS), at(20.0, sensors=SENSORS), same_tool=False))
    bare = by_name(repeated_stations(at(20.0), at(20.0), same_tool=True))
    for name in bare:
        assert tight[name].limit == pytest.approx(bare[name].limit, rel=1e-9)
        assert loose[name].limit > 1.2 * bare[name].limit


def test_repeat_that_differs_fails_with_its_figures():
    found = by_name(repeated_stations(at(20.0), at(200.0, azimuth=0.72), same_tool=True))
    assert found["azimuth"].verdict == "fail"
    assert found["azimuth"].stations == (0,)
    assert found["azimuth"].reason.values["off"] == pytest.approx(1.146, abs=1e-3)
    assert found["inclination"].verdict == "pass"


def test_repeat_across_north_is_small():
    one, two = at(20.0, azimuth=-0.001), at(20.0, azimuth=0.001)
    assert by_name(repeated_stations(one, two, same_tool=True))["azimuth"].value == pytest.approx(0.002, rel=1e-9)


def test_pairs_by_depth():
    one = Stations(
        [0.0, 30.0, 60.0], *(np.tile(v, (3, 1)) for v in (at(0.0).g, at(0.0).b)), noise=np.tile(NOISE, (3, 1, 1))
    )
    apart = repeated_stations(one, at(20.0, md=45.0), same_tool=True)
    assert {check.verdict for check in apart} == {"not judged"}
    assert apart[0].reason == unjudged("no station of the second survey is near one of the first")
    near = repeated_stations(one, at(0.0, md=30.4, azimuth=0.9), same_tool=True)
    assert by_name(near)["azimuth"].stations == (1,)
    # the nearest of the second run, above or below
    other = at(0.0, azimuth=0.9)
    both = Stations([0.2, 59.6], *(np.tile(v, (2, 1)) for v in (other.g, other.b)), noise=np.tile(NOISE, (2, 1, 1)))
    assert by_name(repeated_stations(one, both, same_tool=True))["azimuth"].stations == (0, 2)


# SPE 133417: differences of drill pipe and wireline, both at three standard deviations, published tolerance and verdict
DEPTHS = (
    (1000.0, 0.6, 1.4, 3.4, 3.7, True),
    (4000.0, 2.2, 11.0, 16.5, 19.8, True),
    (1000.0, 11.0, 1.4, 3.4, 3.7, False),
    (4000.0, 44.0, 11.0, 16.5, 19.8, False),
    (1000.0, 3.4, 1.4, 3.4, 3.7, True),
    (4000.0, 13.8, 11.0, 16.5, 19.8, True),
)


@pytest.mark.parametrize(("md", "difference", "pipe", "wireline", "tolerance", "passes"), DEPTHS)
def test_dual_depth_of_the_paper(md, difference, pipe, wireline, tolerance, passes):
    check = dual_depth([md], [md + difference], [pipe / 3.0], [wireline / 3.0])
    assert check.limit == pytest.approx(tolerance, abs=0.05)  # one decimal in print
    assert (check.verdict == "pass") is passes
    assert check.unit == "m"


def test_dual_depth_names_the_depths_that_fail():
    check = dual_depth([1000.0, 2000.0], [1000.5, 2010.0], 0.5, 1.0)
    assert check.stations == (1,)
    assert (check.reason.values["advice"], check.reason.values["station"]) == (OFF["depth"], 2)


def test_dual_depth_without_uncertainty_or_sense():
    assert dual_depth([1000.0], [1001.0], 0.0, 0.0).verdict == "not judged"
    with refused("input-shape", name="second_m"):
        dual_depth([1000.0], [1001.0, 2.0], 1.0, 1.0)
    with refused("input-value", name="first sigma"):
        dual_depth([1000.0], [1001.0], -1.0, 1.0)
