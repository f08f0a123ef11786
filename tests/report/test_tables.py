"""Rows and digits, against Monte Carlo and by hand."""

import numpy as np
import pytest

from inclinometry.calibration.expected import expected_uncertainty
from inclinometry.report.calibration_tables import (
    classical_rows,
    differences,
    field_unit,
    noise_rows,
    orthogonality_rows,
    parameter_rows,
)
from inclinometry.report.words import rounded, significant, with_uncertainty
from inclinometry.sensors import Tool, Triad, parameter_vector, triad_from_vector

from .conftest import DIP


@pytest.mark.parametrize(
    ("value", "u", "text"),
    [
        (0.123456, 0.00997, "0.123 ± 0.010"),
        (-0.00001, 0.01, "0.000 ± 0.010"),
        (123456.0, 780.0, "123460 ± 780"),
        (5.0, 0.0, "5"),
        (1.5e-13, 2.0e-14, "1.50e-13 ± 2.0e-14"),
        (float("nan"), 1.0, "not known"),
    ],
)
def test_digits(value, u, text):
    assert with_uncertainty(value, u) == text


def test_digits_never_lose_the_value():
    random = np.random.default_rng(0)
    for value, u in zip(random.normal(0, 1e3, 300), 10.0 ** random.uniform(-6, 4, 300), strict=True):
        # half a unit of the second digit of u is at most u / 20
        assert abs(float(rounded(value, u)) - value) <= u / 19.9
        assert abs(float(significant(u)) - u) <= u / 19.9


@pytest.fixture(scope="module")
def tool():
    random = np.random.default_rng(2)
    triads = {
        "accelerometer": Triad("accelerometer", np.eye(3) + random.normal(0, 0.02, (3, 3)), [0.01, 0, 0], "V", 9.81),
        "magnetometer": Triad("magnetometer", np.eye(3) + random.normal(0, 0.02, (3, 3)), [0, 0.1, 0], "V", 50_000.0),
    }
    root = 1e-4 * random.standard_normal((24, 24))
    return Tool("A7", triads, root @ root.T, {"accelerometer": 1e-3, "magnetometer": 2e-3})


@pytest.mark.long
@pytest.mark.parametrize("make", [classical_rows, orthogonality_rows])
def test_derived_uncertainties_agree_with_monte_carlo(tool, make):
    kind = "magnetometer"
    random = np.random.default_rng(7)
    here = tool.slices[kind]
    draws = random.multivariate_normal(parameter_vector(tool.triads[kind]), tool.covariance[here, here], 500)
    values = []
    for draw in draws:
        shifted = dict(tool.triads) | {kind: triad_from_vector(tool.triads[kind], draw)}
        values.append([row.value for row in make(Tool("A7", shifted), kind)])
    stated = np.array([row.uncertainty for row in make(tool, kind)])
    # the spread of 500 draws is known to 3.2 %; four times that
    np.testing.assert_allclose(np.std(values, axis=0), stated, rtol=0.13)


def test_units_a_person_understands(tool):
    scale, bias = classical_rows(tool, "accelerometer")[:2]
    # 1 V per 9.81 m/s2 is 0.99966 V per standard g; 0.01 V over 1 V per 9.81 m/s2 is 10.0 mg
    assert scale.value == pytest.approx(np.linalg.norm(tool.triads["accelerometer"].tensor[0, 0]) * 9.80665 / 9.81)
    assert bias.value == pytest.approx(10.0 * 9.81 / 9.80665 / (scale.value * 9.81 / 9.80665))
    assert [row.unit for row in (scale, bias)] == ["V per g", "mg"]
    assert classical_rows(tool, "magnetometer")[5].value == pytest.approx(5000.0, rel=0.05)  # 0.1 of 50 000 nT
    assert noise_rows(tool, "magnetometer")[0].value == pytest.approx(100.0, rel=0.05)
    assert len(parameter_rows(tool, "accelerometer")) == 12
    rate = Triad("gyro", np.eye(3), np.zeros(3), "V", 7.292115e-5)
    assert field_unit(rate).per * 7.292115e-5 == pytest.approx(15.041, rel=1e-4)  # deg/h of the Earth
    assert field_unit(Triad("gyro", np.eye(3), np.zeros(3))).name == "% of Earth rate"
    assert field_unit(Triad("magnetometer", np.eye(3), np.zeros(3))).name == "% of the field"
    # g and mg are of standard gravity: none where the local one was not stated
    alone = field_unit(Triad("accelerometer", np.eye(3), np.zeros(3), "counts"))
    assert alone == ("% of gravity", 100.0, "counts per local gravity", 1.0)


def test_uncertainty_without_magnetometer_is_that_with_a_perfect_one(tool):
    accelerometer = {"accelerometer": tool.triads["accelerometer"]}
    alone = Tool("A7", accelerometer, tool.covariance[:12, :12], tool.noise)
    inclination = np.radians([20.0, 80.0])
    both, one = expected_uncertainty(tool, inclination, DIP), expected_uncertainty(alone, inclination)
    # gravity alone gives inclination and toolface: the second field plays no part in them
    for column in (0, 2):
        np.testing.assert_allclose(one.of_one_reading[:, column], both.of_one_reading[:, column], rtol=1e-9)
        np.testing.assert_allclose(one.from_calibration[:, column], both.from_calibration[:, column], rtol=1e-9)
    assert one.angles == ("inclination", "toolface")
    assert one.azimuth_from is None
    assert np.isnan(one.of_one_reading[:, 1]).all()
    two = Tool("A7", {"accelerometer": Triad("accelerometer", np.eye(3)[:2], np.zeros(2))})
    # the third component follows from |g|
    assert expected_uncertainty(two).angles == ("inclination", "toolface")


def test_differences_are_those_put_in(tool):
    turn = np.array([[np.cos(0.01), np.sin(0.01), 0.0], [-np.sin(0.01), np.cos(0.01), 0.0], [0.0, 0.0, 1.0]])
    triads = {k: Triad(k, t.tensor[0] @ turn, t.offset[0], t.unit, t.field_strength) for k, t in tool.triads.items()}
    found = differences(tool, Tool("A7", triads), DIP)
    # a tool frame turned about z changes the toolface, and nothing else
    assert found["toolface"] == pytest.approx(0.01, abs=1e-12)
    assert found["inclination"] < 1e-12
    assert found["azimuth"] < 1e-12
    assert max(differences(tool, tool, DIP).values()) < 1e-12
