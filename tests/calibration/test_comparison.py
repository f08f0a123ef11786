"""Two calibrations of one tool: coefficients, and what the angles of one differ by from those of the other."""

from dataclasses import replace

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration.comparison import compare_calibrations
from inclinometry.calibration.result import Calibration, Residuals, Rig
from inclinometry.constants import DIP, LATITUDE
from inclinometry.rotations import rotation_z
from inclinometry.sensors import Tool, Triad

ANGLE = np.radians(0.7)
SKEWED = np.eye(3) + 0.1 * np.random.default_rng(1).normal(size=(3, 3))
OFFSET = np.array([5.0, -3.0, 40.0])


def calibrated(triads, directions=None, covariance=None, noise=None):
    """A calibration of the joint method; triad -> (tensor, offset, field strength), in counts."""
    made = {k: Triad(k, tensor, offset, field_strength=strength) for k, (tensor, offset, strength) in triads.items()}
    size = sum(4 * t.count for t in made.values())
    tool = Tool("1", made, np.zeros((size, size)) if covariance is None else covariance, noise or {})
    none = Residuals((), {}, {}, np.zeros(0))
    return Calibration(tool, "joint", {}, directions or {}, (), np.zeros((0, 0)), Rig(np.zeros(3)), none)


def turned(turn, kinds=("accelerometer", "magnetometer"), sensors=3, **more):
    """Skewed triads of which each is turned about the tool axis."""
    rows = {k: (1e3 * SKEWED[:sensors] @ rotation_z(turn), OFFSET[:sensors], None) for k in kinds}
    return calibrated(rows, **more)


def column(found, coefficient):
    return [row for row in found.coefficients if row.name == coefficient]


def test_coefficients_are_those_of_the_classical_equation_with_their_uncertainties():
    """K u + bias: length, direction and offset of each sensor; uncertainties of functions by finite differences."""
    random = np.random.default_rng(2)
    root = random.normal(size=(12, 12))
    covariance = root @ root.T
    first = calibrated({"magnetometer": (5e3 * SKEWED, OFFSET, 50e3)}, covariance=covariance)
    second = calibrated({"magnetometer": (4e3 * SKEWED, 2.0 * OFFSET, 40e3)}, covariance=covariance)
    found = compare_calibrations(first, second)
    for sensor in range(3):
        axis = np.append(5e3 * SKEWED[sensor], OFFSET[sensor])

        def classical(x):
            return np.array([np.linalg.norm(x[:3]) / 50e3, *(x[:3] / np.linalg.norm(x[:3])), x[3]])

        slope = np.array([(classical(axis + e) - classical(axis - e)) / 2e-2 for e in 1e-2 * np.eye(4)]).T
        own = covariance[4 * sensor : 4 * sensor + 4, 4 * sensor : 4 * sensor + 4]
        spread = np.sqrt(np.diagonal(slope @ own @ slope.T))
        rows = [row for row in found.coefficients if row.sensor == sensor + 1]
        assert [row.name for row in rows] == ["K", "cos x", "cos y", "cos z", "bias"]
        np.testing.assert_allclose([row.values[0] for row in rows], classical(axis))
        # differences of a hundredth of a count in 5000: truncation 1e-11, rounding 1e-9
        np.testing.assert_allclose([row.u[0] for row in rows], spread, rtol=1e-6)
    # the stands differ in the strength of their fields, the sensors do not
    assert [row.difference for row in column(found, "K")] == pytest.approx([0.0] * 3, abs=1e-12)
    assert {row.unit for row in column(found, "K")} == {"counts per nT"}
    assert [row.difference for row in column(found, "bias")] == pytest.approx(list(OFFSET))
    for row in found.coefficients:
        assert row.sigmas == pytest.approx(row.difference / np.sqrt(row.u[0] ** 2 + row.u[1] ** 2))
    table = found.to_dict()
    assert table["sensor"][::5] == ["mag_x", "mag_y", "mag_z"]
    np.testing.assert_allclose(np.subtract(table["second"], table["first"]), table["difference"])


def test_where_one_field_is_not_known_scales_are_compared_with_each_other():
    """The second stand's field is 3 % stronger, which is stated or not: the sensors are the same."""
    random = np.random.default_rng(3)
    root = random.normal(size=(12, 12))
    length = np.linalg.norm(SKEWED, axis=1)
    for strengths in ((50e3, None), (None, 51.5e3), (None, None)):
        rows = zip((5e3, 5.15e3), strengths, strict=True)
        made = [
            calibrated({"magnetometer": (scale * SKEWED, OFFSET, b)}, covariance=root @ root.T) for scale, b in rows
        ]
        found = compare_calibrations(*made)
        for row, own in zip(column(found, "K"), 100.0 * length / length.mean(), strict=True):
            assert row.values == pytest.approx((own, own))
            assert row.unit == "% of the mean"
            assert row.sigmas == pytest.approx(0.0, abs=1e-9)
        for row in column(found, "bias"):
            assert (row.difference, row.unit) == (0.0, "counts")
        # the uncertainty of a ratio by finite differences
        values = np.column_stack([5e3 * SKEWED, OFFSET]).ravel()

        def ratio(x):
            scale = np.linalg.norm(x.reshape(3, 4)[:, :3], axis=1)
            return 100.0 * scale / scale.mean()

        slope = np.array([(ratio(values + e) - ratio(values - e)) / 2e-2 for e in 1e-2 * np.eye(12)]).T
        spread = np.sqrt(np.diagonal(slope @ root @ root.T @ slope.T))
        # of the scale of the second stand the first one's covariance takes 1.03
        assert [row.u[0] for row in column(found, "K")] == pytest.approx(list(spread), rel=0.05)


def test_two_methods_on_the_same_readings_have_seen_one_field():
    made = [replace(calibrated({"magnetometer": (5e3 * SKEWED, OFFSET, b)}), inputs={"readings": "sha256:1"})
            for b in (None, None)]  # fmt: skip
    for row, n in zip(column(compare_calibrations(*made), "K"), SKEWED, strict=True):
        assert row.values == pytest.approx((5e3 * np.linalg.norm(n),) * 2)
        assert row.unit == "counts per field of the stand"


def test_two_accelerometers_have_the_third_component_from_gravity_at_their_stand():
    """Calibrated where gravity is 0.3 % stronger the same tool gives the same angles."""
    made = [calibrated({"accelerometer": (1e3 * g * SKEWED[:2], OFFSET[:2], g)}) for g in (9.80, 9.83)]
    found = compare_calibrations(*made)
    np.testing.assert_allclose(found.difference[:, [0, 2]], 0.0, atol=1e-9)
    np.testing.assert_allclose([row.difference for row in column(found, "K")], 0.0, atol=1e-9)


@pytest.mark.parametrize("kinds", [("accelerometer", "magnetometer"), ("accelerometer", "gyro"), ("accelerometer",)])
def test_a_tool_turned_about_its_axis_reads_another_toolface_and_nothing_else(kinds):
    found = compare_calibrations(turned(0.0, kinds), turned(ANGLE, kinds))
    azimuth = 0.0 if len(kinds) == 2 else np.nan
    np.testing.assert_allclose(found.difference, np.tile([0.0, azimuth, ANGLE], (len(found.inclination), 1)), atol=1e-9)
    assert found.error is None
    with_truth = compare_calibrations(turned(0.0, kinds), turned(ANGLE, kinds), truth=turned(-ANGLE, kinds).tool)
    np.testing.assert_allclose(np.array(with_truth.error)[:, :, 2].T, [[ANGLE, 2 * ANGLE]] * len(found.inclination))


def test_the_azimuth_of_a_turned_second_triad_hangs_on_the_dip_where_the_tool_was_calibrated():
    """A field turned by a small angle about the tool axis moves the azimuth by (cos I - tan dip sin I cos A) of it."""
    small = 1e-4
    down = np.array([0.0, 0.0, 1.0])
    for kind, dip, known in (
        ("magnetometer", 0.4, True),
        ("magnetometer", 1.2, True),
        ("magnetometer", DIP, False),
        ("gyro", -0.6, True),
        ("gyro", -LATITUDE, False),
    ):
        gravity = {"accelerometer": (np.eye(3), np.zeros(3), None)}
        plain = gravity | {kind: (np.eye(3), np.zeros(3), None)}
        moved = gravity | {kind: (rotation_z(small), np.zeros(3), None)}
        directions = {"accelerometer": down, kind: np.array([np.cos(dip), 0.0, np.sin(dip)])} if known else {}
        found = compare_calibrations(calibrated(plain, directions), calibrated(moved))
        np.testing.assert_allclose(found.difference[:, [0, 2]], 0.0, atol=1e-12)
        inclination = found.inclination
        expected = small * np.sqrt(np.cos(inclination) ** 2 + (np.tan(dip) * np.sin(inclination)) ** 2 / 2.0)
        np.testing.assert_allclose(found.difference[:, 1], expected, rtol=1e-3)  # second order of 1e-4 and tan dip
        # a scale and an offset along the tool: which way they add up tells the sign of the dip
        moved = gravity | {kind: (np.diag([1.0, 1.0, 1.0 + small]), np.array([0.0, 0.0, small]), None)}
        found = compare_calibrations(calibrated(plain, directions), calibrated(moved))
        along = np.sin(dip) * np.cos(inclination)
        mean = (np.cos(dip) * np.sin(inclination)) ** 2 / 8.0 + (along + 1.0) ** 2 / 2.0
        expected = small * np.sin(inclination) / np.cos(dip) * np.sqrt(mean)
        np.testing.assert_allclose(found.difference[:, 1], expected, rtol=1e-3)


def test_two_accelerometers_are_compared_where_one_has_three():
    """Across the axis; the third component from the strength and the side the hole goes."""
    first, second = (turned(turn, ("accelerometer",), sensors=2) for turn in (0.0, ANGLE))
    found = compare_calibrations(first, second)
    inclined = found.inclination < np.radians(60.0)
    assert np.isfinite(found.difference[inclined][:, [0, 2]]).all()
    np.testing.assert_allclose(found.difference[inclined, 2], ANGLE, rtol=0.05)
    one = [turned(0.0, ("accelerometer",), sensors=1) for _ in range(2)]
    assert np.isnan(compare_calibrations(*one).difference).all()
    # a gyro against a magnetometer would be no azimuth in common: such tools are refused before
    with refused("input-channels"):
        compare_calibrations(turned(0.0, ("accelerometer", "gyro")), turned(0.0))
    with refused("input-channels"):
        compare_calibrations(turned(0.0, ("accelerometer",)), second)
    volts = calibrated({"accelerometer": (SKEWED, np.zeros(3), None)})
    triad = Triad("accelerometer", SKEWED, np.zeros(3), "V")
    other = Calibration(Tool("1", {"accelerometer": triad}), "joint", {}, {}, (), np.zeros((0, 0)), volts.rig,
                        volts.residuals)  # fmt: skip
    with refused("fit-units"):
        compare_calibrations(volts, other)
