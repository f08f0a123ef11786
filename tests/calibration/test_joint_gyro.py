"""Gyro triads in the joint calibration: the Earth rate as a field, temperature campaigns, uncertainties that hold."""

import dataclasses
from functools import partial

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.calibration.closed_form_results import calibrate_orthogonal
from inclinometry.calibration.joint import calibrate_joint, fit_once
from inclinometry.constants import EARTH_RATE
from inclinometry.earth.rate import earth_rate
from inclinometry.orientation import angles
from inclinometry.rotations import dcm, wrap_signed
from inclinometry.sensors import angle_sensitivity, parameter_vector
from inclinometry.simulate.bench import Rig
from inclinometry.simulate.tool import random_tool, realistic_tool

LATITUDE = np.radians(55.0)
# 0.005 deg/sqrt(h) over two minutes
FOG = np.radians(0.005) / 60.0 / np.sqrt(120.0)
NOISE = {"accelerometer": 1e-3, "gyro": FOG}
PLANS = {"twelve": plans.twelve, "orthogonal": plans.orthogonal}


def tool_of(degree=0, seed=3):
    return realistic_tool(seed, sensors=dict.fromkeys(NOISE, 3), bits=None, noise=NOISE, temperature_degree=degree)


def rig_of(setting_sd=0.0):
    return Rig(
        latitude=LATITUDE, setting_sd=setting_sd, base_tilt=np.radians(1.0), tilt_axis=0.3, north_offset=np.radians(8.0)
    )


def stations(count=200, seed=2):
    random = np.random.default_rng(seed)
    inclination = np.radians(random.uniform(10.0, 170.0, count))
    azimuth, toolface = random.uniform(0.0, 2.0 * np.pi, (2, count))
    return azimuth, inclination, toolface, dcm(azimuth, inclination, toolface)


@pytest.mark.long
@pytest.mark.parametrize("name", PLANS)
def test_the_uncertainties_are_honest(bench, name):
    tool, plan, squares, scores = tool_of(), PLANS[name](), [], []
    true = parameter_vector(tool.triads["gyro"])
    for seed in range(40):
        readings, run = bench(plan, tool, rig_of(), seed=seed)
        found = fit_once(readings, NOISE, 0.0)
        where = found.tool.slices["gyro"]
        error = parameter_vector(found.tool.triads["gyro"]) - true
        covariance = found.tool.covariance[where, where]
        squares.append(float(error @ np.linalg.solve(covariance, error)))
        axis, want = found.field_directions["gyro"], run.field_directions["gyro"]
        rows = [found.parameter_names.index(f"gyro.direction.{n}") for n in ("north", "east")]
        scores.append(np.sum((axis - want) ** 2) / np.trace(found.covariance[np.ix_(rows, rows)]))
    # sums of 40 chi-squares of 12: sd of the mean is sqrt(24 / 40) = 0.77
    assert np.mean(squares) == pytest.approx(12.0, abs=4.0 * 0.77)
    # squared angle over its expected value, two degrees of freedom at least half independent: sd below 1.4 / sqrt(40)
    assert np.mean(scores) == pytest.approx(1.0, abs=4.0 * 0.22)


@pytest.mark.parametrize("name", PLANS)
def test_angles_from_the_calibrated_tool(bench, name):
    tool = tool_of()
    readings, _ = bench(PLANS[name](), tool, rig_of(np.radians(0.02)), seed=4)
    found = calibrate_joint(readings, diagnose=False).tool
    azimuth, inclination, toolface, matrix = stations()
    fields = {"accelerometer": matrix[..., 2], "gyro": matrix @ earth_rate(LATITUDE) / EARTH_RATE}
    seen = {k: found.triads[k].field(tool.triads[k].signals(v)) for k, v in fields.items()}
    got = angles(seen["accelerometer"], seen["gyro"])
    parts = angle_sensitivity(found, seen, second="gyro").components(found)
    u = np.sqrt(np.diagonal(parts["calibration"], axis1=1, axis2=2))
    error = np.stack([got.inclination - inclination, got.azimuth - azimuth, got.toolface - toolface], axis=1)
    error = wrap_signed(error)
    # the stations share one calibration: their mean square is that of a few independent errors, not of 200
    share = np.mean((error / u[:, :3]) ** 2, axis=0)
    assert (share < 5.0).all()
    # 0.03 deg/h of noise against 8.6 deg/h of horizontal Earth rate, over sqrt(12) or more positions, at 10 deg
    assert np.degrees(np.abs(error[:, 1])).max() < 1.5


@pytest.mark.long
def test_a_temperature_campaign(bench):
    tool, plan = tool_of(2), plans.orthogonal()
    soaks = np.array([20.0, 60.0, 100.0, 140.0])
    repeated = plans.Plan("soaks", *(np.tile(a, 4) for a in (plan.azimuth, plan.inclination, plan.toolface)))
    heat = np.repeat(soaks, len(plan))
    squares = []
    for seed in range(10):
        readings, _ = bench(repeated, tool, rig_of(), seed=seed, temperature=heat)
        found = calibrate_joint(readings, noise_sd=NOISE, rig_sd=0.0, temperature_degree=2, diagnose=False).tool
        triad = found.triads["gyro"]
        assert triad.reference_temperature == 80.0
        # the truth counts from 20 degC: compared as signals at the soaks, which is what both say of one world
        random = np.random.default_rng(seed)
        field = random.normal(size=3)
        field /= np.linalg.norm(field)
        where = found.slices["gyro"]
        own = found.covariance[where, where]
        for warmth in (30.0, 80.0, 135.0):
            error = triad.signals(field, warmth) - tool.triads["gyro"].signals(field, warmth)
            powers = triad.basis(warmth)
            move = np.concatenate([field, [1.0]])
            rows = np.zeros((3, len(own)))
            for power, factor in enumerate(powers):
                for sensor in range(3):
                    rows[sensor, 12 * power + 4 * sensor : 12 * power + 4 * sensor + 4] = factor * move
            squares.append(float(error @ np.linalg.solve(rows @ own @ rows.T, error)))
    # 30 chi-squares of 3, three at a time from one run: sd of the mean at most sqrt(6 / 10)
    assert np.mean(squares) == pytest.approx(3.0, abs=4.0 * np.sqrt(6.0 / 10.0))
    chosen = calibrate_joint(readings, noise_sd=NOISE, rig_sd=0.0, diagnose=False)
    assert chosen.tool.triads["gyro"].degree >= 1


def test_the_latitude_is_found_and_not_asked_for(bench):
    readings, _ = bench(plans.orthogonal(), tool_of(), rig_of(), seed=1)
    found = calibrate_joint(readings, diagnose=False)
    axis, down = found.field_directions["gyro"], found.field_directions["accelerometer"]
    # noise of 0.03 deg/h in 15 on 72 readings: about 0.03 deg
    assert -np.degrees(np.arcsin(axis @ down)) == pytest.approx(55.0, abs=0.15)
    assert found.tool.triads["gyro"].field_strength is None


@pytest.mark.long
def test_a_rig_that_faces_south(bench, refused):
    rig = Rig(latitude=LATITUDE, north_offset=np.radians(170.0))
    tool = random_tool(3, sensors=dict.fromkeys(NOISE, 3), bits=None, noise=NOISE)
    readings, run = bench(plans.orthogonal(), tool, rig, seed=1, reference={"latitude": LATITUDE})
    true = run.field_directions["gyro"]
    # the latitude decides, in every method
    for method in (partial(calibrate_joint, diagnose=False), calibrate_orthogonal):
        found = method(readings)
        np.testing.assert_allclose(found.field_directions["gyro"], true, atol=0.01)
        assert not {one.code for one in found.findings} & {"bench-sign-assumed", "bench-zero-assumed"}
    # with nothing stated the mirror image is taken, every azimuth half a turn off, and that is named
    silent = dataclasses.replace(readings, reference={})
    found = calibrate_joint(silent, diagnose=False)
    np.testing.assert_allclose(found.field_directions["gyro"], -true, atol=0.01)
    (said,) = (one for one in found.findings if one.code == "bench-sign-assumed")
    assert said.values["angle"] == "latitude"
    assert said.values["found_deg"] == pytest.approx(-55.0, abs=0.05)
    # the side of the zero is used near the equator; here the latitude that is found contradicts nothing
    sided = dataclasses.replace(readings, reference={"north": np.radians(160.0)})
    np.testing.assert_allclose(calibrate_joint(sided, diagnose=False).field_directions["gyro"], true, atol=0.01)
    with refused("bench-dip-contradicted", angle="latitude") as told:
        calibrate_joint(dataclasses.replace(readings, reference={"latitude": np.radians(40.0)}), diagnose=False)
    assert told[0].values["found_deg"] == pytest.approx(55.0, abs=0.1)
    # a prior on the direction, which takes the latitude of the stand, decides otherwise
    prior = {"gyro": (true, np.radians(20.0))}
    right = calibrate_joint(silent, diagnose=False, field_prior=prior)
    np.testing.assert_allclose(right.field_directions["gyro"], true, atol=0.01)
