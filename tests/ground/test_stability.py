"""What sensors move by after their calibration: as large as it is said, and where."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files.stability_toml import read_stability, write_stability
from inclinometry.files.tool_code_json import load_tool_code
from inclinometry.sensors import Tool, Triad, angle_sensitivity
from inclinometry.simulate.fleet import drift_variance
from inclinometry.stability import ASSUMED, Stability, add_stability, from_drift

TURNED = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
"""Sensors in another order and sense than the axes."""


def tool(full=2e4):
    triads = {
        "accelerometer": Triad("accelerometer", full * TURNED, np.zeros(3), field_strength=9.81),
        "magnetometer": Triad("magnetometer", full * np.eye(3), np.zeros(3), field_strength=5e4),
    }
    return Tool("1", triads, 1e-8 * np.eye(24))


def test_what_is_assumed_is_half_of_the_published_terms():
    sigma = {one.name: one.magnitude for one in load_tool_code("iscwsa-mwd-rev5.1").terms}
    half = [0.5 * sigma[name] for name in ("ABZ", "ASZ", "MBZ", "MSZ")]
    found = [ASSUMED.accelerometer_offset, ASSUMED.accelerometer_scale]
    np.testing.assert_allclose([*found, ASSUMED.magnetometer_offset, ASSUMED.magnetometer_scale], half)


def test_it_grows_with_the_root_of_time_and_not_the_calibration():
    one, four = add_stability(tool(), 1.0), add_stability(tool(), 4.0)
    np.testing.assert_allclose(four.stability, 4.0 * one.stability)
    np.testing.assert_array_equal(one.covariance, tool().covariance)
    assert not add_stability(tool(), 0.0).stability.any()


def test_an_offset_along_a_sensor_is_that_of_the_field_whatever_its_order_and_unit():
    found = add_stability(tool(), 1.0)
    offsets = np.sqrt(np.diagonal(found.stability)[3::4]) / 2e4
    np.testing.assert_allclose(offsets, [*[0.002 / 9.81] * 3, *[35.0 / 5e4] * 3])
    factors = np.sqrt([found.stability[row, row] for row in (1, 6, 8, 12, 17, 22)]) / 2e4
    np.testing.assert_allclose(factors, [*[0.00025] * 3, *[0.0008] * 3])


def test_an_angle_errs_by_what_its_cause_is_called():
    here = {"accelerometer": np.array([-1.0, 0.0, 0.0]), "magnetometer": np.array([0.6, 0.0, 0.8])}
    parts = angle_sensitivity(add_stability(tool(), 1.0), here).components(add_stability(tool(), 1.0))
    # horizontal: an offset along the tool over gravity
    assert np.sqrt(parts["stability"][0, 0]) == pytest.approx(0.002 / 9.81, rel=1e-6)
    assert "stability" not in angle_sensitivity(tool(), here).components(tool())


def test_a_file_says_what_the_tool_does(tmp_path):
    own = Stability(1e-3, 1e-4, 20.0, 4e-4, np.radians(0.01), 0.0, 'own "fleet"')
    write_stability(own, tmp_path / "s.toml")
    back = read_stability(tmp_path / "s.toml")
    assert back.source == own.source
    assert back.accelerometer_axis == pytest.approx(own.accelerometer_axis)
    (tmp_path / "s.toml").write_text("accelerometer_offset_m_s2 = 0.001\n")
    with refused("input-missing", error=FileError, names=("accelerometer_scale",)):
        read_stability(tmp_path / "s.toml")
    (tmp_path / "s.toml").write_text("accelerometer_offset_m_s2 = 9\n")
    with refused("input-value", error=FileError, name="accelerometer_offset_m_s2"):
        read_stability(tmp_path / "s.toml")


def test_an_age_out_of_range_is_refused():
    with refused("input-value", name="years"):
        add_stability(tool(), -1.0)


def test_the_drift_of_a_fleet_pools_the_axes_of_a_kind():
    found = from_drift(drift_variance(), "simulated fleet")
    np.testing.assert_allclose([found.magnetometer_offset, found.accelerometer_offset], [60.0, 0.00294], rtol=1e-3)
