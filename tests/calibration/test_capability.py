"""Capability: the stated uncertainty over attitude is the spread of tools drawn from the covariance."""

import numpy as np
import pytest

from inclinometry.attitude.orientation import angles, fields
from inclinometry.calibration import plans
from inclinometry.calibration.capability import ANGLES, capability
from inclinometry.calibration.joint import fit_once
from inclinometry.core.angles import wrap_signed
from inclinometry.core.errors import InputError
from inclinometry.sensors.tool import Tool, parameter_vector, triad_from_vector
from inclinometry.sensors.triad import Triad
from inclinometry.simulate.rig import Rig
from inclinometry.simulate.tool import random_tool

BOTH = ("accelerometer", "magnetometer")
DIP = np.radians(70.0)


def perfect(covariance=None, noise=None):
    triads = {kind: Triad(kind, np.eye(3), np.zeros(3)) for kind in BOTH}
    return Tool("1", triads, np.zeros((24, 24)) if covariance is None else covariance, noise or {})


@pytest.fixture(scope="module")
def calibrated(bench, sensor_noise):
    tool = random_tool(3)
    readings, _ = bench(plans.orthogonal(), tool, Rig(setting_sd=np.radians(0.1)), bits=12)
    return fit_once(readings, sensor_noise(tool, 12), np.radians(0.1)).tool


def test_spread_of_tools_drawn_from_the_covariance(calibrated):
    inclination = np.radians([5.0, 45.0, 90.0])
    stated = capability(calibrated, inclination, DIP, azimuths=2, toolfaces=3)
    random = np.random.default_rng(1)
    draws = random.multivariate_normal(np.zeros(24), calibrated.covariance, 1500, method="cholesky")
    grid = np.meshgrid(inclination, np.pi * np.arange(2), 2 * np.pi * np.arange(3) / 3, indexing="ij")
    g, b = fields(grid[1], grid[0], grid[2], DIP)
    signals = {k: calibrated.triads[k].signals(f) for k, f in zip(BOTH, (g, b), strict=True)}
    truth = np.stack([grid[0], grid[1], grid[2], grid[1] + grid[2]], axis=-1)
    squares = np.zeros(truth.shape)
    for draw in draws:
        seen = []
        for kind in BOTH:
            triad = calibrated.triads[kind]
            vector = parameter_vector(triad) + draw[calibrated.slices[kind]]
            seen.append(triad_from_vector(triad, vector).field(signals[kind]))
        squares += wrap_signed(np.stack(angles(*seen), axis=-1) - truth) ** 2
    # relative standard deviation of a root of a variance from 1500 draws: 1.8 %; 72 cells, so four of them
    np.testing.assert_allclose(np.sqrt(squares / len(draws)), np.sqrt(stated.components["calibration"]), rtol=0.075)


def test_noise_of_perfect_axes_is_known_in_closed_form():
    s = 1e-3
    found = capability(perfect(noise={"accelerometer": s, "magnetometer": 0.0}), np.radians([10.0, 60.0, 90.0]), DIP)
    variance = found.components["sensor noise"]
    inclination = np.radians([10.0, 60.0, 90.0])[:, None, None]
    # |g| = 1 seen with isotropic noise s: inclination s, toolface s / sin I about the tool axis
    np.testing.assert_allclose(variance[..., 0], s**2 * np.ones((3, 12, 12)), rtol=1e-9)
    np.testing.assert_allclose(variance[..., 2], s**2 / np.sin(inclination) ** 2 * np.ones((3, 12, 12)), rtol=1e-9)
    assert (found.components["calibration"] == 0.0).all()


def test_azimuth_of_a_level_magnetometer_error():
    s = 1e-3
    found = capability(perfect(noise={"accelerometer": 0.0, "magnetometer": s}), np.radians([30.0, 90.0]), DIP)
    # only the horizontal component of b counts: s / cos(dip), at every attitude
    np.testing.assert_allclose(found.components["sensor noise"][..., 1], (s / np.cos(DIP)) ** 2, rtol=1e-9)
    np.testing.assert_allclose(found.components["sensor noise"][..., 0], 0.0, atol=1e-30)


def test_worst_and_rms(calibrated):
    found = capability(calibrated, np.radians([5.0, 30.0, 85.0]), DIP)
    assert found.worst().shape == found.rms().shape == (3, len(ANGLES))
    assert (found.worst() >= found.rms()).all()
    assert found.variance.shape == (3, 12, 12, 4)
    np.testing.assert_allclose(found.variance, sum(found.components.values()))
    # azimuth and toolface get worse towards the vertical, inclination and magnetic toolface do not explode
    assert (np.diff(found.worst()[:, 1]) < 0).all()
    assert (np.diff(found.worst()[:, 2]) < 0).all()
    assert found.worst()[0, 0] < 3 * found.worst()[1, 0]
    assert found.worst()[0, 3] < found.worst()[0, 2] / 2


def test_a_finer_grid_finds_nothing_much_worse(calibrated):
    coarse = capability(calibrated, np.radians([30.0]), DIP).worst()
    fine = capability(calibrated, np.radians([30.0]), DIP, azimuths=72, toolfaces=72).worst()
    # the variance is a trigonometric polynomial of low degree in both angles
    assert (fine >= coarse * (1 - 1e-12)).all()
    np.testing.assert_allclose(fine, coarse, rtol=0.05)


def test_variances_scale_with_the_covariance():
    root = np.random.default_rng(1).normal(size=(24, 24)) * 1e-4
    one = capability(perfect(root @ root.T), np.radians([40.0]), DIP)
    four = capability(perfect(4.0 * root @ root.T), np.radians([40.0]), DIP)
    np.testing.assert_allclose(four.worst(), 2.0 * one.worst(), rtol=1e-12)


@pytest.mark.parametrize("dip", [-60.0, 0.0, 20.0])
def test_any_dip(calibrated, dip):
    assert np.isfinite(capability(calibrated, np.radians([1.0, 90.0, 179.0]), np.radians(dip)).worst()).all()


def test_temperature_is_that_of_the_survey():
    tool = random_tool(2, temperature_degree=1)
    size = len(tool.parameter_names)
    uncertain = Tool("x", tool.triads, 1e-4 * np.eye(size))
    near = capability(uncertain, np.radians([30.0]), DIP, temperature=20.0).worst()
    far = capability(uncertain, np.radians([30.0]), DIP, temperature=120.0).worst()
    # constants known to 0.01 counts, slopes to 0.01 counts per degC, 100 degC away where the tensor is a little other
    np.testing.assert_allclose(far / near, np.hypot(1.0, 100.0), rtol=0.05)


class TestRefusals:
    @pytest.mark.parametrize("inclination", [0.0, np.pi, -0.1, 45.0, np.nan])
    def test_inclinations(self, inclination):
        with pytest.raises(InputError, match="inclination"):
            capability(perfect(), [inclination], DIP)

    @pytest.mark.parametrize("dip", [70.0, np.nan, -2.0])
    def test_dips(self, dip):
        with pytest.raises(InputError, match="dip"):
            capability(perfect(), [1.0], dip)

    @pytest.mark.parametrize("dip", [np.pi / 2, -np.pi / 2])
    def test_a_vertical_field_has_no_azimuth(self, dip):
        with pytest.raises(InputError):
            capability(perfect(), [1.0], dip)

    @pytest.mark.parametrize(
        "sensors", [{"accelerometer": 3}, {"magnetometer": 3}, {"accelerometer": 3, "magnetometer": 2}]
    )
    def test_triads_that_see_too_little(self, sensors):
        with pytest.raises(InputError, match="three seen components"):
            capability(random_tool(1, sensors=sensors), [1.0], DIP)

    @pytest.mark.parametrize("option", ["azimuths", "toolfaces"])
    def test_an_empty_grid(self, option):
        with pytest.raises(InputError, match=option):
            capability(perfect(), [1.0], DIP, **{option: 0})
