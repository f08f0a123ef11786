"""Expected uncertainty of tools that are not two full triads."""

import numpy as np
import pytest
from tests.refusals import coded

from inclinometry.calibration.expected import expected_uncertainty
from inclinometry.calibration.norm import calibrate_norms
from inclinometry.calibration.readings import BenchReadings
from inclinometry.sensors import Tool, Triad


def tool(accelerometers, *, second=None, noise=1e-3):
    triads = {"accelerometer": Triad("accelerometer", np.eye(3)[:accelerometers], np.zeros(accelerometers))}
    if second:
        triads[second] = Triad(second, np.eye(3), np.zeros(3))
    size = sum(4 * t.count for t in triads.values())
    return Tool("1", triads, 1e-8 * np.eye(size), dict.fromkeys(triads, noise))


def test_two_accelerometers_lose_the_inclination_towards_the_horizontal():
    """sin I = |p|: dI = dp / cos I, so twice the uncertainty at 60 deg, none worth the name at 90."""
    found = expected_uncertainty(tool(2), np.radians([10.0, 60.0, 90.0]), gravity_sd=0.0)
    u = found.of_one_reading[:, 0]
    assert u[1] / u[0] == pytest.approx(np.cos(np.radians(10.0)) / np.cos(np.radians(60.0)), rel=0.02)
    assert np.degrees(u[2]) > 30.0
    assert found.angles == ("inclination", "toolface")


@pytest.mark.parametrize(
    ("accelerometers", "second", "angles"),
    [
        (3, "gyro", ("inclination", "azimuth", "toolface")),
        (3, None, ("inclination", "toolface")),
        (2, "magnetometer", ("inclination", "azimuth", "toolface")),
        (1, "magnetometer", ()),
    ],
)
def test_what_each_tool_gives(accelerometers, second, angles):
    assert expected_uncertainty(tool(accelerometers, second=second), np.radians([30.0, 60.0])).angles == angles


def test_a_fit_of_norms_alone_gives_no_angles_of_the_tool():
    directions = np.random.default_rng(1).normal(size=(40, 3))
    signals = 1000.0 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    found = calibrate_norms(BenchReadings({"accelerometer": signals + np.random.default_rng(2).normal(size=(40, 3))}))
    assert expected_uncertainty(found).angles == ()
    # how well the attitudes cover the sphere is said
    assert "fit-coverage" in coded(found.findings)
