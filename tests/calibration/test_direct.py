"""Closed forms as calibrations: exact without errors, honest about their own, refusing what is not theirs."""

import dataclasses

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.calibration.direct import (
    calibrate_classical,
    calibrate_orthogonal,
    calibrate_rotations,
    calibrate_twelve,
)
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.core.errors import IdentifiabilityError, InputError
from inclinometry.sensors.tool import parameter_vector
from inclinometry.simulate.rig import Rig
from inclinometry.simulate.tool import random_tool, realistic_tool

BOTH = ("accelerometer", "magnetometer")
OWN = [
    (calibrate_twelve, plans.twelve()),
    (calibrate_twelve, plans.twelve(rolls=5, azimuths=4)),
    (calibrate_orthogonal, plans.orthogonal()),
    (calibrate_orthogonal, plans.half()),
    (calibrate_orthogonal, plans.two_face()),
    (calibrate_rotations, plans.rotations()),
    (calibrate_rotations, plans.rotations(np.radians(30.0))),
]
IDS = [f"{method.__name__.removeprefix('calibrate_')}-{len(plan)}-{plan.name}" for method, plan in OWN]
IDS[-1] += "-30"


def truth(tool):
    return np.concatenate([parameter_vector(t) for t in tool.triads.values()])


@pytest.mark.parametrize(("method", "plan"), OWN, ids=IDS)
class TestOwnPlan:
    def test_perfect_readings_give_the_tool(self, bench, method, plan):
        tool = random_tool(1, bits=None)
        found = method(bench(plan, tool, Rig(), noise={})[0])
        for kind in BOTH:
            size = np.abs(tool.triads[kind].tensor).max()
            # algebra on numbers of this size
            np.testing.assert_allclose(found.tool.triads[kind].tensor, tool.triads[kind].tensor, atol=1e-9 * size)
            np.testing.assert_allclose(found.tool.triads[kind].offset, tool.triads[kind].offset, atol=1e-9 * size)
        assert np.isfinite(found.tool.covariance).all()

    @pytest.mark.parametrize("rig_deg", [0.0, 0.1])
    def test_the_stated_uncertainty_is_honest(self, bench, sensor_noise, method, plan, rig_deg):
        scores = []
        for seed in range(20):
            tool = random_tool(seed)
            readings, _ = bench(plan, tool, Rig(setting_sd=np.radians(rig_deg)), seed=seed, bits=12)
            found = method(readings, noise_sd=sensor_noise(tool, 12), rig_sd=np.radians(rig_deg))
            scores.append((truth(found.tool) - truth(tool)) ** 2 / np.diag(found.tool.covariance))
        # 20 draws of some ten independent errors each: the root is good to 1/sqrt(2 * 200) = 5 %
        assert np.sqrt(np.mean(scores)) == pytest.approx(1.0, abs=0.16)

    def test_the_joint_fit_of_the_same_readings_agrees_and_is_not_less_certain(self, bench, sensor_noise, method, plan):
        tool = random_tool(2)
        readings, _ = bench(plan, tool, Rig(setting_sd=np.radians(0.05)), bits=12)
        known = {"noise_sd": sensor_noise(tool, 12), "rig_sd": np.radians(0.05)}
        closed = method(readings, **known)
        level = None if plan.name != "rotations" else {"accelerometer": ([0.0, 0.0, 1.0], 1e-4)}
        joint = calibrate_joint(readings, field_prior=level, diagnose=False, **known)
        u = np.sqrt(np.diag(closed.tool.covariance))
        assert np.abs((truth(joint.tool) - truth(closed.tool)) / u).max() < 4.5
        if level is None:  # the rotations take the dip as known besides, which the joint fit does not
            assert (np.diag(joint.tool.covariance) <= np.diag(closed.tool.covariance) * 1.02).all()

    def test_the_record(self, bench, method, plan):
        readings, _ = bench(plan, random_tool(2), Rig(setting_sd=np.radians(0.05)), bits=12)
        found = method(readings, name="SN 7")
        assert found.method == method.__name__.removeprefix("calibrate_")
        assert found.tool.name == "SN 7"
        assert found.inputs == {"readings": readings.digest}
        assert tuple(found.parameter_names) == found.tool.parameter_names
        assert found.rig.errors is None
        assert set(found.field_directions) == set(BOTH)
        assert found.method in repr(found)
        assert {v.shape for v in found.residuals.values.values()} == {(len(plan), 3)}


def test_rig_orientation_is_immaterial_to_the_twelve(bench):
    tool = random_tool(3, bits=None)
    rig = Rig(base_tilt=np.radians(15.0), tilt_axis=2.0, north_offset=np.radians(120.0))
    readings, true = bench(plans.twelve(), tool, rig, noise={})
    found = calibrate_twelve(readings)
    for kind in BOTH:
        np.testing.assert_allclose(found.field_directions[kind], true.field_directions[kind], atol=1e-9)
        np.testing.assert_allclose(
            found.tool.triads[kind].tensor, tool.triads[kind].tensor, atol=1e-9 * np.abs(tool.triads[kind].tensor).max()
        )


def test_a_tilted_base_is_found_by_the_cube(bench):
    tool = random_tool(3, bits=None)
    readings, true = bench(plans.orthogonal(), tool, Rig(base_tilt=np.radians(5.0), tilt_axis=0.0), noise={})
    found = calibrate_orthogonal(readings)
    # the plain formulas, which take gravity as level, would lose 1 - cos 5 degrees of scale
    for kind in BOTH:
        ratio = found.tool.triads[kind].tensor[0] / tool.triads[kind].tensor[0]
        np.testing.assert_allclose(ratio, 1.0, rtol=1e-9)
        np.testing.assert_allclose(found.field_directions[kind], true.field_directions[kind], atol=1e-9)


def test_southern_field_keeps_its_sign_with_a_known_dip(bench):
    tool = random_tool(3)
    for method, plan in ((calibrate_twelve, plans.twelve()), (calibrate_orthogonal, plans.orthogonal())):
        readings, _ = bench(plan, tool, Rig(dip=np.radians(-60.0)), bits=12)
        np.testing.assert_allclose(
            method(readings).tool.triads["magnetometer"].tensor, tool.triads["magnetometer"].tensor, atol=5.0
        )


def test_the_classical_method_is_no_better_than_its_assumptions(bench):
    tool = realistic_tool(1, bits=None)
    readings, _ = bench(plans.orthogonal(), tool, Rig(), noise={})
    found = calibrate_classical(readings).tool.triads["accelerometer"].tensor[0]
    true = tool.triads["accelerometer"].tensor[0]
    # one conversion factor for the three, although they differ by some per cent
    np.testing.assert_allclose(np.diag(found), np.linalg.norm(true, axis=1).mean(), rtol=1e-9)
    assert np.ptp(np.linalg.norm(true, axis=1)) > 0.01
    # and the components across it as they are: axes 1 to 2 degrees off
    np.testing.assert_allclose(found - np.diag(np.diag(found)), true - np.diag(np.diag(true)), atol=2e-3)


class TestRefusals:
    @pytest.mark.parametrize(
        ("method", "plan"),
        [
            (calibrate_twelve, plans.orthogonal()),
            (calibrate_twelve, plans.rotations()),
            (calibrate_orthogonal, plans.twelve()),
            (calibrate_orthogonal, plans.rotations()),
            (calibrate_rotations, plans.orthogonal()),
            (calibrate_rotations, plans.twelve()),
        ],
    )
    def test_another_plan(self, bench, method, plan):
        readings, _ = bench(plan, random_tool(1), Rig(), bits=12)
        with pytest.raises(InputError) as caught:
            method(readings)
        assert "\n" not in str(caught.value)
        assert len(str(caught.value)) > 20

    @pytest.mark.parametrize(("method", "plan"), OWN, ids=IDS)
    def test_a_station_missing(self, bench, method, plan):
        readings, _ = bench(plan, random_tool(1), Rig(), bits=12)
        with pytest.raises(InputError):
            method(readings.take(range(len(plan) - 1)))

    @pytest.mark.parametrize(
        "method", [calibrate_twelve, calibrate_orthogonal, calibrate_rotations, calibrate_classical]
    )
    def test_no_angles(self, method):
        bare = BenchReadings({"accelerometer": np.random.default_rng(1).normal(size=(24, 3))})
        with pytest.raises(InputError, match="no rig angles"):
            method(bare)

    @pytest.mark.parametrize(
        ("options", "words"),
        [
            ({"rig_sd": -1.0}, "rig_sd"),
            ({"rig_sd": [0.1, 0.1]}, "rig_sd"),
            ({"noise_sd": {"accelerometer": 0.0}}, "noise sd"),
            ({"noise_sd": {"magneto": 1.0}}, "magneto"),
        ],
    )
    def test_options(self, bench, options, words):
        readings, _ = bench(plans.orthogonal(), random_tool(1), Rig(), bits=12)
        with pytest.raises(InputError, match=words):
            calibrate_orthogonal(readings, **options)

    def test_few_stations(self, bench):
        readings, _ = bench(plans.orthogonal(), random_tool(1), Rig(), bits=12)
        for count in (0, 1, 3):
            with pytest.raises(IdentifiabilityError, match=f"{count} stations give"):
                calibrate_classical(readings.take(range(count)))


def test_one_triad_alone_and_any_number_of_sensors(bench):
    tool = random_tool(5, sensors={"accelerometer": 4, "gyro": 2}, bits=None)
    readings, _ = bench(plans.twelve(), tool, Rig(), noise={})
    found = calibrate_twelve(readings)
    for kind in tool.triads:
        size = np.abs(tool.triads[kind].tensor).max()
        np.testing.assert_allclose(found.tool.triads[kind].tensor, tool.triads[kind].tensor, atol=1e-8 * size)
    alone = dataclasses.replace(readings, channels={"gyro": readings.channels["gyro"]}, digest="")
    assert list(calibrate_twelve(alone).tool.triads) == ["gyro"]
