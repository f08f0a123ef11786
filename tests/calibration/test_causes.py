"""The error budget against what the causes do when one of them is switched on alone."""

import dataclasses

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.calibration.expected import expected_uncertainty
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.uncertainty_budget import calibration_shares, error_budget
from inclinometry.constants import SHORT_INCLINATIONS
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
            signals = characteristic.apply_nonlinearity(flat, truth.triads[kind]).reshape(signals.shape)
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
    stated = np.sqrt(np.diagonal(budget[f"calibration: {name}"], axis1=1, axis2=2))[:, :2]
    measured = np.sqrt(np.mean(squares, axis=0))
    np.testing.assert_allclose(measured, stated, rtol=0.6, atol=np.radians(1e-3))


def test_non_linearity_counts_through_calibration_and_reading(bench):
    """Nearly noise-free, so that calibration and reading err by the square law alone."""
    tool, law = realistic_tool(1, bits=None), Characteristic(square=0.005)
    noise = {kind: 1e-5 * tool.triads[kind].field_strength for kind in KINDS}
    readings, _ = bench(plans.twelve(8, 3), tool, Rig(dip=DIP), noise=noise, characteristic=dict.fromkeys(KINDS, law))
    found = calibrate_joint(readings, rig_sd=0.0)
    budget = error_budget(found, readings, AT, DIP)
    stated = np.sqrt(np.diagonal(budget["non-linearity"], axis1=1, axis2=2))[:, :2]
    measured = angle_errors(found.tool, tool, law)
    # the law of the sensors along the tool shows in no roll and is left out: one of three
    np.testing.assert_allclose(stated, measured, rtol=0.5)
    assert (measured > np.radians(0.01)).all()
    # the roll sets alone show the accelerometers' laws as the fit does
    by_rolls = error_budget(dataclasses.replace(found, bent={}), readings, AT, DIP)["non-linearity"]
    np.testing.assert_allclose(by_rolls[:, 0, 0], budget["non-linearity"][:, 0, 0], rtol=0.05)


def test_the_causes_of_a_budget_add_up_to_what_is_expected_of_the_tool(bench):
    """Variances of the noise and the dials estimated, so that more is stated than the causes of the fit bring."""
    tool = realistic_tool(2)
    readings, _ = bench(plans.orthogonal(), tool, Rig(dip=DIP, setting_sd=np.radians(0.1)), bits=12)
    found = calibrate_joint(readings)
    budget = error_budget(found, readings, AT, DIP)
    turns = {"azimuths": 12, "toolfaces": 12, "temperature": found.tool.triads["accelerometer"].reference_temperature}
    expected = expected_uncertainty(found, AT, DIP, **turns)

    def brought(start):
        parts = [part for name, part in budget.items() if name.startswith(start)]
        return np.sqrt(np.diagonal(sum(parts), axis1=1, axis2=2))

    assert np.trace(found.tool.covariance) > 1.08 * np.trace(sum(found.causes.values()))
    np.testing.assert_allclose(brought("reading: "), expected.rms("sensor noise"), rtol=1e-9)
    # what is stated more is shared alike among causes and parameters, which the variances themselves are not quite
    np.testing.assert_allclose(brought("calibration: "), expected.rms("calibration"), rtol=0.04)
    steps = {kind: np.asarray(readings.step[kind]) / np.sqrt(12.0) for kind in KINDS}
    alone = expected_uncertainty(dataclasses.replace(found.tool, noise=steps), AT, DIP, **turns)
    np.testing.assert_allclose(brought("reading: converter"), alone.rms("sensor noise"), rtol=1e-9)


def test_the_share_of_the_converter_is_that_of_its_variance(bench):
    """Readings of a count each, no two alike, with noise of two: one in 48 of all that noise brings."""
    random = np.random.default_rng(3)
    low, high = np.array([[0.0, 6.2], [0.1, 3.0], [0.0, 6.2]]).T
    plan = plans.Plan("any", *random.uniform(low, high, (20, 3)).T)
    readings, _ = bench(plan, realistic_tool(1, bits=20), Rig(dip=DIP), bits=20)
    assert all(np.allclose(readings.rounding(kind), 1.0 / np.sqrt(12.0)) for kind in KINDS)
    found = calibrate_joint(readings, noise_sd=dict.fromkeys(KINDS, 2.0), rig_sd=1e-3)
    both = found.causes["converter"] + found.causes["sensor noise"]
    np.testing.assert_allclose(found.causes["converter"], both / 48.0, rtol=1e-6)
    # each share that of the cause where one reading is least certain; together all of it
    whole = expected_uncertainty(found, SHORT_INCLINATIONS)
    shares = calibration_shares(found, whole)
    assert set(shares) == set(found.causes) == set(found.shares)
    np.testing.assert_allclose(sum(shares.values()), 1.0)
    brought = {}
    for name, cause in found.causes.items():
        own = dataclasses.replace(found.tool, covariance=cause)
        brought[name] = expected_uncertainty(own, SHORT_INCLINATIONS, whole.dip).components["calibration"]
    for n in range(len(SHORT_INCLINATIONS)):
        for angle in range(3):
            at = (n, *np.unravel_index(whole.variance[n, :, :, angle].argmax(), whole.variance.shape[1:3]), angle)
            every = sum(part[at] for part in brought.values())
            assert {name: part[n, angle] for name, part in shares.items()} == pytest.approx(
                {name: part[at] / every for name, part in brought.items()}, rel=1e-6
            )


def test_a_tool_without_angles_has_no_shares(bench):
    tool = realistic_tool(1, sensors={"magnetometer": 3})
    found = calibrate_joint(bench(plans.orthogonal(), tool, Rig(dip=DIP), bits=12)[0])
    assert found.causes
    assert not found.shares


def test_no_budget_where_the_causes_are_not_known(bench):
    readings, _ = bench(plans.twelve(), realistic_tool(1), Rig(), bits=12)
    assert error_budget(calibrate_joint(readings, diagnose=False), readings, AT, DIP) is None
    alone = BenchReadings({"accelerometer": readings.channels["accelerometer"]}, *readings.dials)
    assert error_budget(calibrate_joint(alone), alone, AT, DIP) is None
