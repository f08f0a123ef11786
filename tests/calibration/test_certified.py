"""What a certificate states of a calibration: u at the estimated variances, k of Student, 95.45 % within U."""

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.calibration.expected import certified
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration, Residuals, Rig
from inclinometry.files.tool_json import read_calibration, write_calibration
from inclinometry.rotations import dcm
from inclinometry.sensors import Tool, Triad, parameter_vector

TABLE_G2 = {
    2: 4.53, 3: 3.31, 4: 2.87, 5: 2.65, 6: 2.52, 7: 2.43, 8: 2.37, 9: 2.32, 10: 2.28, 11: 2.25, 12: 2.23, 13: 2.21,
    14: 2.20, 15: 2.18, 16: 2.17, 17: 2.16, 18: 2.15, 19: 2.14, 20: 2.13, 25: 2.11, 30: 2.09, 35: 2.07, 40: 2.06,
    45: 2.06, 50: 2.05, np.inf: 2.00,
}  # fmt: skip
"""JCGM 100:2008, table G.2, the column of 95.45 %."""


def made(method="joint", freedom=None, stations=0):
    """A calibration of an accelerometer; residuals of as many stations."""
    tool = Tool("1", {"accelerometer": Triad("accelerometer", np.eye(3), np.zeros(3))}, 1e-4 * np.eye(12))
    values = {"accelerometer": np.zeros((stations, 3))} if stations else {}
    residuals = Residuals(tuple(map(str, range(stations))), values, values, np.zeros(stations))
    return Calibration(
        tool, method, {}, {}, tool.parameter_names, tool.covariance, Rig(np.zeros(3)), residuals, freedom=freedom
    )


def test_k_is_that_of_the_guides_table():
    for nu, k in TABLE_G2.items():
        found = certified(made(freedom=nu))
        assert (found.k, found.freedom) == (k, nu)
        # between two rows it is that of the smaller number
        assert certified(made(freedom=nu + 0.9)).k == k


def test_the_covariance_is_without_the_mean_over_the_variances():
    """12 degrees of freedom: the mean over the variance is 12 / 10 of the one at its estimate."""
    found = certified(made(freedom=12.0))
    np.testing.assert_allclose(found.calibration.tool.covariance, 1e-4 * 10.0 / 12.0 * np.eye(12))
    stated = certified(made(freedom=np.inf))
    np.testing.assert_array_equal(stated.calibration.tool.covariance, 1e-4 * np.eye(12))
    # a method whose covariance is the one at the estimates
    plain = certified(made("norm", stations=8))
    assert (plain.freedom, plain.k) == (12.0, 2.23)
    np.testing.assert_array_equal(plain.calibration.tool.covariance, 1e-4 * np.eye(12))


def test_of_files_of_before_u_and_k_belong_together_and_few_readings_make_no_small_u():
    """U is twice the mean or more, whatever the degrees of freedom."""
    for stations, nu in ((8, 12.0), (4, 3.0)):
        found = certified(made(stations=stations))
        assert found.freedom == nu
        share = np.sqrt(found.calibration.tool.covariance[0, 0] / 1e-4)
        assert 2.0 - 1e-12 <= found.k * share < 2.06


@pytest.mark.parametrize("freedom", [None, 17.25, np.inf])
def test_degrees_of_freedom_are_kept_in_the_file(tmp_path, freedom):
    write_calibration(made(freedom=freedom), tmp_path / "tool.json")
    assert read_calibration(tmp_path / "tool.json").freedom == freedom


def one_variance(seed, **more):
    """Accelerometers on perfect dials in 12 positions: 36 readings less 12 parameters and two of the direction."""
    plan, random = plans.twelve(), np.random.default_rng(seed)
    signals = 1000.0 * dcm(plan.azimuth, plan.inclination, plan.toolface) @ [0.0, 0.0, 1.0] + 7.0
    noisy = {"accelerometer": signals + 0.5 * random.standard_normal(signals.shape)}
    readings = BenchReadings(noisy, plan.azimuth, plan.inclination, plan.toolface)
    return calibrate_joint(readings, rig_sd=0.0, diagnose=False, **more)


def test_degrees_of_freedom_of_one_variance_are_readings_less_parameters():
    """36 readings less 12 parameters and two angles of the field; drawn variances make it good to a tenth."""
    assert one_variance(1).freedom == pytest.approx(22.0, rel=0.1)
    assert one_variance(1, noise_sd={"accelerometer": 0.5}).freedom == np.inf


@pytest.mark.long
def test_true_values_lie_within_u_as_often_as_stated():
    """One variance and twelve positions, 400 runs: 95.45 % of the parameters within k u, and fewer within 2 u."""
    truth = np.column_stack([1000.0 * np.eye(3), np.full(3, 7.0)]).ravel()
    off, two = [], []
    for seed in range(400):
        found = certified(one_variance(seed))
        tool = found.calibration.tool
        u = np.sqrt(np.diagonal(tool.covariance))
        error = np.abs(parameter_vector(tool.triads["accelerometer"]) - truth)
        off.append(error <= found.k * u)
        two.append(error <= 2.0 * u)
    # 4800 values, twelve of a run share a variance: standard deviation 0.5 %
    assert np.mean(off) == pytest.approx(0.9545, abs=0.015)
    assert np.mean(two) < np.mean(off) - 0.005
