"""Expected uncertainty: the stated uncertainty over attitude is the spread of tools drawn from the covariance."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.refusals import refused

import inclinometry
from inclinometry.calibration import plans
from inclinometry.calibration.expected import ALL_ANGLES, expected_uncertainty, field_dip
from inclinometry.calibration.joint import calibrate_joint, fit_once
from inclinometry.constants import DIP, STEPS
from inclinometry.errors import InputError
from inclinometry.orientation import angles, fields
from inclinometry.rotations import wrap_signed
from inclinometry.sensors import Tool, Triad, parameter_vector, triad_from_vector
from inclinometry.simulate.bench import Rig
from inclinometry.simulate.tool import random_tool

BOTH = ("accelerometer", "magnetometer")


def perfect(covariance=None, noise=None):
    triads = {kind: Triad(kind, np.eye(3), np.zeros(3)) for kind in BOTH}
    return Tool("1", triads, np.zeros((24, 24)) if covariance is None else covariance, noise or {})


@pytest.fixture(scope="module")
def calibrated(bench, sensor_noise):
    tool = random_tool(3)
    readings, _ = bench(plans.orthogonal(), tool, Rig(setting_sd=np.radians(0.1)), bits=12)
    return fit_once(readings, sensor_noise(tool, 12), np.radians(0.1)).tool


@pytest.mark.long
def test_spread_of_tools_drawn_from_the_covariance(calibrated):
    inclination = np.radians([5.0, 45.0, 90.0])
    stated = expected_uncertainty(calibrated, inclination, DIP, azimuths=2, toolfaces=3)
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
    found = expected_uncertainty(
        perfect(noise={"accelerometer": s, "magnetometer": 0.0}), np.radians([10.0, 60.0, 90.0]), DIP
    )
    variance = found.components["sensor noise"]
    inclination = np.radians([10.0, 60.0, 90.0])[:, None, None]
    # |g| = 1 seen with isotropic noise s: inclination s, toolface s / sin I about the tool axis
    np.testing.assert_allclose(variance[..., 0], s**2 * np.ones((3, STEPS, STEPS)), rtol=1e-9)
    np.testing.assert_allclose(
        variance[..., 2], s**2 / np.sin(inclination) ** 2 * np.ones((3, STEPS, STEPS)), rtol=1e-9
    )
    assert (found.components["calibration"] == 0.0).all()


def test_azimuth_of_a_level_magnetometer_error():
    s = 1e-3
    found = expected_uncertainty(
        perfect(noise={"accelerometer": 0.0, "magnetometer": s}), np.radians([30.0, 90.0]), DIP
    )
    # only the horizontal component of b counts: s / cos(dip), at every attitude
    np.testing.assert_allclose(found.components["sensor noise"][..., 1], (s / np.cos(DIP)) ** 2, rtol=1e-9)
    np.testing.assert_allclose(found.components["sensor noise"][..., 0], 0.0, atol=1e-30)


def test_worst_and_rms(calibrated):
    found = expected_uncertainty(calibrated, np.radians([5.0, 30.0, 85.0]), DIP)
    assert found.of_one_reading.shape == found.rms().shape == (3, len(ALL_ANGLES))
    assert (found.of_one_reading >= found.rms()).all()
    assert found.variance.shape == (3, STEPS, STEPS, 4)
    np.testing.assert_allclose(found.variance, sum(found.components.values()))
    # azimuth and toolface get worse towards the vertical, inclination and magnetic toolface do not explode
    assert (np.diff(found.of_one_reading[:, 1]) < 0).all()
    assert (np.diff(found.of_one_reading[:, 2]) < 0).all()
    assert found.of_one_reading[0, 0] < 3 * found.of_one_reading[1, 0]
    assert found.of_one_reading[0, 3] < found.of_one_reading[0, 2] / 2


def test_a_finer_grid_finds_nothing_much_worse(calibrated):
    coarse = expected_uncertainty(calibrated, np.radians([30.0]), DIP).of_one_reading
    fine = expected_uncertainty(calibrated, np.radians([30.0]), DIP, azimuths=72, toolfaces=72).of_one_reading
    # the variance is a trigonometric polynomial of low degree in both angles
    assert (fine >= coarse * (1 - 1e-12)).all()
    np.testing.assert_allclose(fine, coarse, rtol=0.05)


@pytest.mark.parametrize("dip", [-60.0, 0.0, 20.0])
def test_any_dip(calibrated, dip):
    assert np.isfinite(
        expected_uncertainty(calibrated, np.radians([1.0, 90.0, 179.0]), np.radians(dip)).of_one_reading
    ).all()


def test_temperature_is_that_of_the_survey():
    tool = random_tool(2, temperature_degree=1)
    size = len(tool.parameter_names)
    uncertain = Tool("x", tool.triads, 1e-4 * np.eye(size))
    near = expected_uncertainty(uncertain, np.radians([30.0]), DIP, temperature=20.0).of_one_reading
    far = expected_uncertainty(uncertain, np.radians([30.0]), DIP, temperature=120.0).of_one_reading
    # constants known to 0.01 counts, slopes to 0.01 counts per degC, 100 degC away where the tensor is a little other
    np.testing.assert_allclose(far / near, np.hypot(1.0, 100.0), rtol=0.05)


class TestRefusals:
    @pytest.mark.parametrize("inclination", [0.0, np.pi, -0.1, 45.0, np.nan])
    def test_inclinations(self, inclination):
        with refused("input-value", "input-finite", name="inclination"):
            expected_uncertainty(perfect(), [inclination], DIP)

    @pytest.mark.parametrize("dip", [70.0, np.nan, -2.0])
    def test_dips(self, dip):
        with refused("input-value", "input-finite", name="dip"):
            expected_uncertainty(perfect(), [1.0], dip)

    @pytest.mark.parametrize("dip", [np.pi / 2, -np.pi / 2])
    def test_a_vertical_field_has_no_azimuth(self, dip):
        with pytest.raises(InputError):
            expected_uncertainty(perfect(), [1.0], dip)

    @pytest.mark.parametrize("option", ["azimuths", "toolfaces"])
    def test_an_empty_grid(self, option):
        with refused("input-value", name=option):
            expected_uncertainty(perfect(), [1.0], DIP, **{option: 0})


@pytest.mark.parametrize(
    ("sensors", "given", "second"),
    [
        ({"accelerometer": 3}, ("inclination", "toolface"), None),
        ({"magnetometer": 3}, (), "magnetometer"),
        ({"accelerometer": 2, "magnetometer": 3}, ("inclination", "azimuth", "toolface"), "magnetometer"),
        ({"accelerometer": 3, "magnetometer": 2}, ("inclination", "toolface"), None),
        ({"accelerometer": 3, "gyro": 3}, ("inclination", "azimuth", "toolface"), "gyro"),
    ],
)
def test_every_tool_has_the_angles_it_can_give_and_no_others(sensors, given, second):
    tool = random_tool(1, sensors=sensors)
    size = len(tool.parameter_names)
    found = expected_uncertainty(Tool("1", tool.triads, 1e-6 * np.eye(size), tool.noise))
    assert found.angles == given
    assert found.azimuth_from == second
    for u in (found.from_calibration, found.of_one_reading):
        for column, name in enumerate(ALL_ANGLES[:3]):
            assert np.isfinite(u[:, column]).all() == np.isfinite(u[:, column]).any() == (name in given)


def test_noise_adds_to_the_calibration_in_squares(calibrated):
    found = expected_uncertainty(calibrated)
    assert (found.of_one_reading > found.from_calibration).all()
    silent = expected_uncertainty(Tool("1", calibrated.triads, calibrated.covariance))
    np.testing.assert_array_equal(silent.of_one_reading, found.from_calibration)


def test_where_the_dip_is_from(calibrated, bench):
    readings, _ = bench(plans.orthogonal(), random_tool(3), Rig(dip=np.radians(40.0)), bits=12)
    joint = calibrate_joint(readings, diagnose=False)
    assert expected_uncertainty(joint).dip == pytest.approx(joint.dip, rel=1e-14)  # last bits of another route
    assert expected_uncertainty(joint).dip_from == "calibration"
    assert expected_uncertainty(joint, dip=0.3, stated_dip=0.2).dip_from == "given"
    assert expected_uncertainty(joint.tool, stated_dip=0.2).dip == 0.2
    assert (expected_uncertainty(joint.tool).dip, expected_uncertainty(joint.tool).dip_from) == (DIP, "assumed")


def test_a_calibration_without_covariance_states_no_uncertainty(bench):
    readings, _ = bench(plans.orthogonal(), random_tool(3), Rig(), bits=12)
    joint = calibrate_joint(readings, diagnose=False)
    assert expected_uncertainty(replace(joint, tool=Tool("1", joint.tool.triads, noise=joint.tool.noise))).angles == ()


def test_the_defaults_are_defined_once():
    """No module but core.constants sets a default dip, latitude, coverage factor or grid under such a name."""
    root = Path(inclinometry.__file__).parent
    once = re.compile(
        r"^ *(DIP|ASSUMED_DIP|USUAL_DIP|LATITUDE|COVERAGE_FACTOR|EXPANDED|INCLINATIONS(_DEG)?|DEG_PER_HOUR"
        r"|SHORT_INCLINATIONS|INCLINATION_RANGE)\b[^=\n(]* = "
        r"|\b(dip|dip_deg): float = [^\n]*\d",
        re.MULTILINE,
    )
    modules = {path: path.read_text("utf-8") for path in sorted(root.rglob("*.py"))}
    found = [f"{path.name}: {m.group()}" for path, text in modules.items() for m in once.finditer(text)]
    # the simulated hole of the drilling scenarios is data: where it lies is no default of anything else
    found = [line for line in found if not line.startswith("scenario.py: dip: ")]
    assert {line.split(":")[0] for line in found} == {"constants.py"}, found
    assert len(found) == 7  # those of core.constants, each once


def test_dip_of_a_field_is_from_the_horizontal_of_gravity():
    directions = {"accelerometer": np.array([0.0, 0.0, 1.0]), "magnetometer": np.array([0.6, 0.0, 0.8])}
    assert np.sin(field_dip(directions, "magnetometer")) == pytest.approx(0.8)
