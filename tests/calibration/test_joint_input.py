"""Joint fit: readings and options that cannot be used are one clear error or a named warning."""

import contextlib
import dataclasses

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.calibration.initial_values import enough
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.errors import IdentifiabilityError, InputError
from inclinometry.findings import Finding
from inclinometry.simulate.bench import Rig
from inclinometry.simulate.tool import random_tool


@pytest.fixture(scope="module")
def readings(bench):
    """A run of 24 positions with ordinary errors."""
    return bench(plans.orthogonal(), random_tool(3), Rig(setting_sd=np.radians(0.1)), bits=12, seed=5)[0]


def test_too_few_stations_with_numbers(readings):
    with refused("fit-few", error=IdentifiabilityError):
        calibrate_joint(readings.take(range(4)))


@pytest.mark.parametrize("count", [0, 1, 2, 3, 4, 5, 6, 7])
def test_any_small_number_of_stations_is_an_error_or_a_finite_result(readings, count):
    found = None
    with contextlib.suppress(IdentifiabilityError):
        found = calibrate_joint(readings.take(range(count)))
    assert found is None or np.isfinite(found.covariance).all()


def test_more_stations_than_a_laptop_can_fit_are_refused_in_words():
    signals = np.tile(np.eye(3), (6667, 1))
    enough(BenchReadings({"accelerometer": signals[:20_000]}))
    with refused("fit-stations-many"):
        enough(BenchReadings({"accelerometer": signals}))


def test_a_reading_that_no_attitude_gives_is_named(readings, refused):
    wild = {kind: values.copy() for kind, values in readings.channels.items()}
    usual = np.abs(wild["magnetometer"][:, 1]).max()
    wild["magnetometer"][4, 1] = 500.0 * usual
    enough(dataclasses.replace(readings, channels=wild))
    wild["magnetometer"][4, 1] = 5000.0 * usual
    with refused("bench-reading-far") as said:
        enough(dataclasses.replace(readings, channels=wild))
    assert [said[0].values[name] for name in ("station", "kind", "sensor")] == ["5", "magnetometer", 2]


@pytest.mark.parametrize("sensors", [2, 3, 4, 5])
def test_as_many_readings_as_parameters_are_enough_to_begin_with(sensors):
    signals = np.random.default_rng(1).normal(size=(20, sensors))
    least = -(-(4 * sensors + 2) // sensors)
    enough(BenchReadings({"accelerometer": signals[:least]}))
    with refused("fit-few", error=IdentifiabilityError):
        enough(BenchReadings({"accelerometer": signals[: least - 1]}))


def test_no_angles(readings):
    bare = BenchReadings(readings.channels)
    with refused("bench-no-angles"):
        calibrate_joint(bare)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"noise_sd": {"accelerometer": -1.0}}, "noise_sd.accelerometer"),
        ({"noise_sd": {"accelerometer": 0.0}}, "noise_sd.accelerometer"),
        ({"noise_sd": {"accelerometer": np.nan}}, "noise_sd.accelerometer"),
        ({"noise_sd": {"accelerometer": [1.0, 2.0]}}, "noise_sd.accelerometer"),
        ({"noise_sd": {"accelerator": 1.0}}, "accelerator"),
        ({"rig_sd": -0.1}, "rig_sd"),
        ({"rig_sd": 45.0}, "rig_sd"),
        ({"rig_sd": [0.1, 0.1]}, "rig_sd"),
        ({"rig_sd": np.nan}, "rig_sd"),
        ({"nuisance_sd": {"inclination_zro": 0.1}}, "inclination_zro"),
        ({"nuisance_sd": {"inclination_zero": -0.1}}, "nuisance_sd"),
        ({"nuisance_sd": {"inclination_zero": 10.0}}, "nuisance_sd"),
        ({"field_prior": {"magnetometer": ([0, 0, 0], 0.1)}}, "|field_prior.magnetometer|"),
        ({"field_prior": {"magnetometer": ([0, 1], 0.1)}}, "shape"),
        ({"field_prior": {"magnetometer": ([0, 0, 1], -0.1)}}, "field_prior"),
        ({"field_prior": {"magnetometer": ([0, 0, 1], np.nan)}}, "field_prior"),
        ({"field_prior": {"compass": ([0, 0, 1], 0.1)}}, "compass"),
        ({"temperature_degree": 1}, "temperature"),
        ({"temperature_degree": -1}, "temperature"),
    ],
)
def test_options_that_cannot_be_used_are_one_clear_error(readings, options, words):
    with pytest.raises((InputError, IdentifiabilityError)) as raised:
        calibrate_joint(readings, **options)
    assert words in str(raised.value.finding.values)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"channels": {}}, "channels"),
        ({"channels": {"compass": np.zeros((24, 3))}}, "compass"),
        ({"channels": {"gyro": np.zeros(24)}}, "shape"),
        (
            {"channels": {"gyro": np.zeros((24, 3)), "accelerometer": np.zeros((23, 3))}},
            "(24, 3)",
        ),
        ({"channels": {"gyro": np.zeros((24, 2, 3))}}, "(24, 2, 3)"),
        ({"channels": {"gyro": np.full((24, 3), np.nan)}}, "gyro[0, 0]"),
        ({"azimuth": None}, "azimuth"),
        ({"azimuth": np.zeros(5)}, "azimuth"),
        ({"toolface": np.full(24, np.inf)}, "toolface"),
        ({"inclination": np.full(24, 90.0)}, "inclination"),
        ({"station": ["a"]}, "station"),
        ({"temperature": np.full(24, np.nan)}, "temperature"),
        ({"count": np.zeros(3)}, "count"),
        ({"count": np.zeros(24)}, "count"),
        ({"sd": {"accelerometer": np.zeros((3, 7))}}, "accelerometer.sd"),
        ({"sd": {"accelerometer": np.full((24, 3), -1.0)}}, "accelerometer.sd"),
    ],
)
def test_readings_that_do_not_go_together(readings, change, words):
    with pytest.raises(InputError) as raised:
        dataclasses.replace(readings, **change)
    assert words in str(raised.value.finding.values)


def test_a_dead_channel_is_named(readings):
    dead = {**readings.channels, "magnetometer": readings.channels["magnetometer"] * [1.0, 0.0, 1.0]}
    found = calibrate_joint(dataclasses.replace(readings, channels=dead))
    assert Finding("bench-channel-dead", {"kind": "magnetometer", "sensor": 2, "value": 0.0}) in found.findings
    assert not found.tool.triads["magnetometer"].full


def test_a_copied_channel_is_named(readings):
    copied = {**readings.channels, "accelerometer": readings.channels["accelerometer"][:, [0, 0, 2]]}
    found = calibrate_joint(dataclasses.replace(readings, channels=copied))
    assert Finding("bench-channels-same", {"kind": "accelerometer", "first": 1, "second": 2}) in found.findings
