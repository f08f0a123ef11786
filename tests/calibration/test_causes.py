"""The error budget against what the causes do when one of them is switched on alone."""

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.calibration.causes import error_budget
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.orientation import angles, fields
from inclinometry.rotations import wrap_signed
from inclinometry.simulate.bench import Rig
from inclinometry.simulate.sensing import Characteristic
from inclinometry.simulate.tool import realistic_tool

DIP = np.radians(70.0)
AT = np.radians([20.0, 60.0])
KINDS = ("accelerometer", "magnetometer")


def angle_errors(tool, truth, characteristic=None):
    """Rms (n, 2) of inclination and azimuth when noise-free signals of the truth are read with the tool."""
    turn = 2.0 * np.pi * np.arange(12) / 12
    grid = np.meshgrid(AT, turn, turn, indexing="ij")
    seen = []
    for kind, field in zip(KINDS, fields(grid[1], grid[0], grid[2], DIP), strict=True):
        signals = truth.triads[kind].signals(field)
        if characteristic is not None:
            flat = signals.reshape(-1, 3)
            signals = characteristic.bent(flat, truth.triads[kind]).reshape(signals.shape)
        seen.append(tool.triads[kind].field(signals))
    found = angles(*seen)
    off = np.stack([found.inclination - grid[0], wrap_signed(found.azimuth - grid[1])], axis=-1)
    return np.sqrt(np.mean(off**2, axis=(1, 2)))


def test_the_causes_add_up_to_the_covariance(bench):
    tool = realistic_tool(1)
    rig = Rig(dip=DIP, setting_sd=np.radians([0.1, 0.2, 0.3]))
    readings, _ = bench(plans.twelve(), tool, rig, bits=12)
    known = dict.fromkeys(KINDS, 2.0)
    found = calibrate_joint(readings, noise_sd=known, rig_sd=np.radians([0.1, 0.2, 0.3]))
    whole = sum(found.causes.values())
    # the same inverse by two ways of adding: ill-conditioned by the stand's parameters, 1e-8 apart
    sd = np.sqrt(np.diagonal(found.tool.covariance))
    np.testing.assert_allclose(whole / np.outer(sd, sd), found.tool.covariance / np.outer(sd, sd), rtol=0.0, atol=1e-6)
    dials = {"azimuth dial", "inclination dial", "toolface dial"}
    assert set(found.causes) == {"converter", "sensor noise", *dials, "errors that the readings cannot exclude"}
    # a converter of whole counts brings 1/12 of a count^2 of the 4 that were stated, more where stations read the same
    converter, noise = (np.diagonal(found.causes[name]) for name in ("converter", "sensor noise"))
    ratio = converter / (converter + noise)
    assert (ratio > (1.0 - 1e-9) / 48.0).all()
    assert (ratio < 0.2).all()


@pytest.mark.long
@pytest.mark.parametrize("dial", [0, 1, 2])
def test_one_dial_alone_moves_the_angles_as_budgeted(bench, dial):
    """Random settings through the linear estimator; 20 draws give an rms to a fifth."""
    tool, plan = realistic_tool(1, bits=None), plans.twelve()
    sd = np.radians([0.1, 0.1, 0.1])
    alone = np.where(np.arange(3) == dial, sd, 0.0)
    noise = {kind: 1e-3 * tool.triads[kind].field_strength for kind in KINDS}
    squares, budget = [], None
    for seed in range(20):
        readings, _ = bench(plan, tool, Rig(dip=DIP, setting_sd=alone), noise={}, seed=seed)
        found = calibrate_joint(readings, noise_sd=noise, rig_sd=sd, diagnose=seed == 0)
        if budget is None:
            budget = error_budget(found, readings, AT, DIP)
        squares.append(angle_errors(found.tool, tool) ** 2)
    name = ("azimuth dial", "inclination dial", "toolface dial")[dial]
    stated = np.sqrt(np.diagonal(budget.components[f"calibration: {name}"], axis1=1, axis2=2))[:, :2]
    measured = np.sqrt(np.mean(squares, axis=0))
    np.testing.assert_allclose(measured, stated, rtol=0.6, atol=np.radians(1e-3))


def test_non_linearity_counts_through_calibration_and_reading(bench):
    """Nearly noise-free, so that calibration and reading err by the square law alone."""
    tool, law = realistic_tool(1, bits=None), Characteristic(square=0.005)
    noise = {kind: 1e-5 * tool.triads[kind].field_strength for kind in KINDS}
    readings, _ = bench(plans.twelve(8, 3), tool, Rig(dip=DIP), noise=noise, characteristic=dict.fromkeys(KINDS, law))
    found = calibrate_joint(readings, rig_sd=0.0)
    budget = error_budget(found, readings, AT, DIP)
    stated = np.sqrt(np.diagonal(budget.components["non-linearity"], axis1=1, axis2=2))[:, :2]
    measured = angle_errors(found.tool, tool, law)
    # the law of the sensors along the tool shows in no roll and is left out: one of three
    np.testing.assert_allclose(stated, measured, rtol=0.5)
    assert (measured > np.radians(0.01)).all()


def test_no_budget_where_the_causes_are_not_known(bench):
    readings, _ = bench(plans.twelve(), realistic_tool(1), Rig(), bits=12)
    assert error_budget(calibrate_joint(readings, diagnose=False), readings, AT, DIP) is None
    alone = BenchReadings({"accelerometer": readings.channels["accelerometer"]}, *readings.dials)
    assert error_budget(calibrate_joint(alone), alone, AT, DIP) is None
