"""Four sensors of one kind: the one that contradicts the others is named and left out, wherever a tool is used."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.calibration.conformity import verify
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.files.run_file import RunBlock
from inclinometry.orientation import fields
from inclinometry.parity import consistent
from inclinometry.simulate.bench import Rig
from inclinometry.simulate.tool import random_tool
from inclinometry.survey.from_stations import survey_from_stations
from inclinometry.survey.from_tool import stations_from_tool
from inclinometry.survey.reduce import reduce_survey
from inclinometry.workflow.dynamic_signals import Signals

STATIONS, DIP = 24, np.radians(70.0)
NOISE = {"accelerometer": 0.003, "magnetometer": 30.0}  # m/s2, nT


@pytest.fixture(scope="module")
def calibration(bench):
    tool = random_tool(5, sensors={"accelerometer": 4, "magnetometer": 3}, bits=None)
    return tool, calibrate_joint(bench(plans.orthogonal(), tool, Rig(dip=DIP), noise=NOISE)[0])


def hole(tool, off, rows=slice(None), seed=2):
    """Angles and signals of a hole, the third accelerometer off by `off` m/s2 at some stations."""
    rng = np.random.default_rng(seed)
    inclination, azimuth = np.radians(np.linspace(5.0, 85.0, STATIONS)), np.radians(np.linspace(20.0, 80.0, STATIONS))
    pair = fields(azimuth, inclination, rng.uniform(0.0, 6.0, STATIONS), DIP)
    signals = {k: tool.triads[k].signals(field) for k, field in zip(NOISE, pair, strict=True)}
    signals = {k: each + NOISE[k] * rng.normal(size=each.shape) for k, each in signals.items()}
    signals["accelerometer"][rows, 2] += off
    return 30.0 * np.arange(STATIONS), inclination, signals


def named(findings):
    return [(one.code, one.values.get("sensor")) for one in findings if one.code.startswith("sensor-parity")]


@pytest.mark.parametrize(("off", "rows"), [(0.0, slice(None)), (0.05, slice(None)), (0.2, [3, 9, 16])])
def test_a_survey_leaves_the_contradicting_sensor_out(calibration, off, rows):
    tool, record = calibration
    md, inclination, signals = hole(tool, off, rows)
    expected = [("sensor-parity", "3")] if off else []
    plain = reduce_survey(md, signals, record.tool)
    by_axes = survey_from_stations(stations_from_tool(md, signals, record.tool))
    for found in (plain, by_axes):
        assert named(found.findings) == expected
        assert np.mean(((found.inclination - inclination) / found.u_inclination) ** 2) < 2.0
    assert [one.rows for one in plain.findings if one.code == "sensor-parity"] in ([], [tuple(np.arange(24)[rows])])


def test_where_the_readings_do_not_show_which_sensor_it_is_none_is_left_out(calibration):
    tool, record = calibration
    _, _, signals = hole(tool, 0.2)
    found = consistent(record.tool, {kind: each[:1] for kind, each in signals.items()})
    assert named(found.findings) == [("sensor-parity-open", None)]
    assert found.tool is record.tool


def test_verify_leaves_the_contradicting_sensor_out(bench, calibration):
    tool, record = calibration
    readings = bench(plans.spread(), tool, Rig(dip=DIP), noise=NOISE, seed=3)[0]
    signals = {kind: each.copy() for kind, each in readings.channels.items()}
    signals["accelerometer"][:, 2] += 0.1
    found = verify(dataclasses.replace(readings, channels=signals), record)
    assert named(found.findings) == [("sensor-parity", "3")]
    right = verify(readings, record)
    assert named(right.findings) == []
    np.testing.assert_allclose(found.errors[:, 0], right.errors[:, 0], atol=np.radians(0.1))  # 0.6 deg with it


def test_a_turning_run_leaves_the_contradicting_sensor_out(calibration):
    tool, record = calibration
    _, _, signals = hole(tool, 0.0)
    names = {"accelerometer": tuple(f"accel_{k}" for k in "1234"), "magnetometer": tuple(f"mag_{a}" for a in "xyz")}
    units = {kind: record.tool.triads[kind].unit for kind in names}
    run = SimpleNamespace(names=names, units=units, wanted=(), path="run.csv")
    work = Signals(run, SimpleNamespace(gravity=None, b=None), record)
    good = work.fields(RunBlock(np.arange(STATIONS), signals, None))["accel"]
    assert not work.contradictions
    for off in (0.05, 0.0):  # and stays out
        _, _, signals = hole(tool, off)
        bad = work.fields(RunBlock(np.arange(STATIONS), signals, None))["accel"]
        np.testing.assert_allclose(bad, good, atol=0.02)
    assert named(work.contradictions.values()) == [("sensor-parity", "3")]
