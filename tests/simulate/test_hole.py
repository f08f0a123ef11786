"""Simulated wells: the path is what the profile says, and the readings are those of the path."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.orientation import angles
from inclinometry.rotations import wrap_signed
from inclinometry.sensors import Tool, Triad
from inclinometry.simulate.hole import WellProfile, simulate_survey, well_path
from inclinometry.simulate.tool import realistic_tool

DIP = np.radians(65.0)


def test_build_hold_drop():
    profile = WellProfile(hold=np.radians(60.0), final=np.radians(20.0), turn_rate=np.radians(0.01))
    path = well_path(profile, 1)
    assert path.md[0] == 0.0
    assert np.diff(path.md).max() <= 30.0 + 1e-9
    rate = np.abs(np.diff(path.inclination) / np.diff(path.md))
    assert rate.max() <= np.radians(3.0) / 30.0 * (1 + 1e-9)
    assert path.inclination.max() == pytest.approx(np.radians(60.0))
    assert path.inclination[-1] == pytest.approx(np.radians(20.0))
    # 300 + 59.5 / 0.1 + 900 + 40 / (2/30) + 300
    assert path.md[-1] == pytest.approx(300 + 595 + 900 + 600 + 300)
    turned = wrap_signed(path.azimuth[-1] - profile.azimuth)
    assert turned == pytest.approx(np.radians(0.01) * (path.md[-1] - 300))
    assert np.array_equal(well_path(profile, 1).toolface, path.toolface)


def test_a_quiet_survey_read_with_the_truth_returns_the_angles():
    tool = realistic_tool(1, sensors={"accelerometer": 4, "magnetometer": 3, "gyro": 3}, bits=16)
    path = well_path(WellProfile(), 2)
    declination = np.radians(7.0)
    run = simulate_survey(tool, *path, dip=DIP, declination=declination, noise={}, seed=1)
    fields = {kind: triad.field(run.signals[kind]) for kind, triad in tool.triads.items()}
    read = angles(fields["accelerometer"], fields["magnetometer"])
    # 1e-13 of rounding over sin(0.5 degrees) near the surface
    for name in ("inclination", "azimuth", "toolface", "magnetic_toolface"):
        np.testing.assert_allclose(wrap_signed(getattr(read, name) - getattr(run, name)), 0.0, atol=1e-10)
    true = angles(fields["accelerometer"], fields["gyro"]).azimuth
    np.testing.assert_allclose(wrap_signed(true - run.azimuth - declination), 0.0, atol=1e-10)
    assert (run.g, run.b, run.dip) == (9.80665, 50000.0, DIP)


def test_fields_stronger_than_at_the_calibration_read_stronger():
    tool = realistic_tool(1)
    run = simulate_survey(tool, *well_path(WellProfile(), 2), g=9.79, b=52000.0, dip=DIP, noise={}, seed=1)
    accel = tool.triads["accelerometer"].field(run.signals["accelerometer"])
    np.testing.assert_allclose(np.linalg.norm(accel, axis=-1), 9.79 / 9.80665, rtol=1e-12)
    mag = tool.triads["magnetometer"].field(run.signals["magnetometer"])
    np.testing.assert_allclose(np.linalg.norm(mag, axis=-1), 1.04, rtol=1e-12)
    assert run.b == 52000.0


def test_impossible_wells_are_refused():
    path = well_path(WellProfile(), 1)
    tool = realistic_tool(1)
    with refused("input-value", name="spacing"):
        WellProfile(spacing=0.0)
    with refused("input-shape", name="md, inclination, azimuth, toolface"):
        simulate_survey(tool, path.md, path.inclination, path.azimuth, [0.0], dip=DIP, seed=1)
    with refused("input-value", name="accelerometer.field"):
        simulate_survey(tool, *path, g=-1.0, dip=DIP, seed=1)
    unknown = Tool("unknown", {"accelerometer": Triad("accelerometer", np.eye(3), np.zeros(3))})
    with refused("simulate-strength"):
        simulate_survey(unknown, *path, g=9.8, dip=DIP, seed=1)
    run = simulate_survey(unknown, *path, dip=DIP, seed=1)
    assert run.g is None
    assert run.b is None
