"""A mistake at one station is found, named and left out; clean runs are not accused."""

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.sensors import parameter_vector
from inclinometry.simulate.bench import Bump, Misread, Rig
from inclinometry.simulate.tool import random_tool

BOTH = ("accelerometer", "magnetometer")
PLANS = [plans.twelve(), plans.half(), plans.orthogonal(), plans.rotations(np.radians(30.0))]
DRAWS = range(3)
RIG_SD = np.radians(0.1)


def found_in(calibration):
    return [sentence for sentence in calibration.warnings if "disagrees" in sentence]


def worst(calibration, tool):
    """Largest error of a parameter in stated standard uncertainties."""
    true = np.concatenate([parameter_vector(t) for t in tool.triads.values()])
    found = np.concatenate([parameter_vector(t) for t in calibration.tool.triads.values()])
    return np.abs((found - true) / np.sqrt(np.diag(calibration.tool.covariance))).max()


def mistaken(bench, plan, seed, *faults):
    tool = random_tool(seed)
    return tool, bench(plan, tool, Rig(setting_sd=RIG_SD, faults=faults), seed=seed, bits=12)[0]


@pytest.mark.long
@pytest.mark.parametrize("plan", PLANS, ids=lambda p: p.name)
@pytest.mark.parametrize("dial", ["azimuth", "inclination", "toolface"])
def test_a_dial_off_by_thirty_degrees(bench, plan, dial):
    for seed in DRAWS:
        row = int(np.random.default_rng(seed).integers(len(plan)))
        size = np.radians(30.0) * (-1.0) ** seed
        tool, readings = mistaken(bench, plan, seed, Misread(row, dial, size))
        calibration = calibrate_joint(readings, robust=True)
        (sentence,) = found_in(calibration)
        assert sentence.startswith(f"station {row + 1} disagrees")
        assert "left out of the fit" in sentence
        upright = abs(np.sin(plan.inclination[row])) < 1e-9
        # azimuth and toolface turn an upright tool about one axis
        named = "azimuth or toolface" if upright and dial != "inclination" else dial
        assert f"its {named} dial seems misread" in sentence
        off = abs(float(sentence.split("stood ")[1].split(" deg")[0]))
        assert off == pytest.approx(30.0, abs=1.5)  # a setting of 0.1 deg against a fit of twelve or more of them
        assert str(row + 1) not in calibration.residuals.station
        # the other parameters are those of the clean run; up to 32 of them with estimated variances
        assert worst(calibration, tool) < 8.0


@pytest.mark.long
def test_the_sign_says_where_the_tool_stood(bench):
    _, readings = mistaken(bench, plans.orthogonal(), 1, Misread(2, "toolface", np.radians(30.0)))
    (sentence,) = found_in(calibrate_joint(readings))
    # the record says 30 degrees more than what was set
    assert "the tool stood -" in sentence


@pytest.mark.long
@pytest.mark.parametrize("degrees", [1.0, 5.0, 90.0, 180.0])
def test_a_dial_off_by_little_or_much(bench, degrees):
    _, readings = mistaken(bench, plans.orthogonal(), 3, Misread(5, "toolface", np.radians(degrees)))
    (sentence,) = found_in(calibrate_joint(readings, robust=True))
    assert sentence.startswith("station 6 disagrees")
    assert "toolface" in sentence


@pytest.mark.long
@pytest.mark.parametrize("plan", PLANS, ids=lambda p: p.name)
def test_a_bumped_station(bench, plan):
    for seed in DRAWS:
        row = int(np.random.default_rng(seed + 50).integers(len(plan)))
        tool, readings = mistaken(bench, plan, seed, Bump(row, np.radians(5.0)))
        calibration = calibrate_joint(readings, robust=True)
        (sentence,) = found_in(calibration)
        assert sentence.startswith(f"station {row + 1} disagrees")
        assert worst(calibration, tool) < 8.0


@pytest.mark.long
@pytest.mark.parametrize("plan", PLANS[:3], ids=lambda p: p.name)
@pytest.mark.parametrize(("kind", "column"), [("accelerometer", 2), ("magnetometer", 1)])
def test_one_channel_that_jumped(bench, plan, kind, column):
    for seed in DRAWS[:2]:
        row = int(np.random.default_rng(seed + 80).integers(len(plan)))
        tool, readings = mistaken(bench, plan, seed)
        channels = {k: v.copy() for k, v in readings.channels.items()}
        channels[kind][row, column] += 150.0
        spoilt = BenchReadings(channels, *readings.dials, reference=readings.reference)
        calibration = calibrate_joint(spoilt, robust=True)
        (sentence,) = found_in(calibration)
        assert sentence.startswith(f"station {row + 1} disagrees")
        assert f"channel {kind} {column + 1} jumped" in sentence
        assert worst(calibration, tool) < 8.0


@pytest.mark.long
def test_two_mistakes(bench):
    tool, readings = mistaken(
        bench,
        plans.orthogonal(),
        2,
        Misread(3, "inclination", np.radians(-30.0)),
        Misread(17, "azimuth", np.radians(10.0)),
    )
    calibration = calibrate_joint(readings, robust=True)
    assert sorted(int(s.split()[1]) for s in found_in(calibration)) == [4, 18]
    assert worst(calibration, tool) < 8.0


def test_without_robust_the_station_is_named_and_kept(bench):
    _, readings = mistaken(bench, plans.orthogonal(), 2, Misread(3, "inclination", np.radians(30.0)))
    calibration = calibrate_joint(readings)
    (sentence,) = found_in(calibration)
    assert "it is still in the fit" in sentence
    assert len(calibration.residuals.station) == 24


@pytest.mark.long
def test_names_of_stations_are_used(bench):
    _, readings = mistaken(bench, plans.orthogonal(), 2, Misread(3, "toolface", np.radians(30.0)))
    named = BenchReadings(readings.channels, *readings.dials, station=[f"S{i:02d}" for i in range(24)])
    assert found_in(calibrate_joint(named))[0].startswith("station S03 disagrees")


@pytest.mark.long
@pytest.mark.parametrize("plan", PLANS[:3], ids=lambda p: p.name)
@pytest.mark.parametrize("rig_deg", [0.0, 0.1, 0.5])
def test_clean_runs_are_not_accused(bench, plan, rig_deg):
    accused = 0
    for seed in range(100, 107):
        readings, _ = bench(plan, random_tool(seed), Rig(setting_sd=np.radians(rig_deg)), seed=seed, bits=12)
        accused += bool(found_in(calibrate_joint(readings)))
    # the stated chance is one in a thousand a run: 7 runs hold one with less than 1 %
    assert accused == 0


def test_a_clean_run_is_fitted_the_same_with_robust(bench):
    readings, _ = bench(plans.orthogonal(), random_tool(1), Rig(setting_sd=RIG_SD), bits=12)
    one, other = calibrate_joint(readings), calibrate_joint(readings, robust=True)
    np.testing.assert_array_equal(one.covariance, other.covariance)
    assert one.residuals.station == other.residuals.station
