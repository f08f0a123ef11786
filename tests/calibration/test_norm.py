"""The norm-only fit: real logs with published answers, invariances, honest covariance, clear refusals."""

from __future__ import annotations

import gzip
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from tests.refusals import fits, refused

from inclinometry.calibration.norm import (
    algebraic_ellipsoid,
    algebraic_sphere,
    calibrate_norm,
    calibrate_norms,
    distinct,
    norm_residuals,
    one_sided,
    require_coverage,
    unit,
)
from inclinometry.calibration.readings import BenchReadings
from inclinometry.errors import IdentifiabilityError, InputError
from inclinometry.sensors import parameter_vector

MPU = Path(__file__).parents[1] / "reference" / "mpu9150"


def sphere(rng, count):
    v = rng.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


@pytest.fixture(scope="module")
def xsens():
    data = files("inclinometry.workflow").joinpath("demo_data", "xsens_mti", "xsens_acc.txt.gz").read_bytes()
    return np.array(gzip.decompress(data).split(), dtype=float).reshape(-1, 4)


@pytest.fixture(scope="module")
def poses(xsens):
    """The detector of imu_tk: variances over 101 samples, divisor n - 1, norm below 6 x that of the first 50 s."""
    time, x = xsens[:, 0], xsens[:, 1:]
    window = np.lib.stride_tricks.sliding_window_view(x - x.mean(axis=0), 101, axis=0)
    moving = np.linalg.norm(window.var(axis=-1, ddof=1), axis=1)
    limit = 6.0 * np.linalg.norm(x[: np.searchsorted(time, time[0] + 50.0)].var(axis=0, ddof=1))
    still = np.concatenate([[False], moving < limit, [False]])
    edges = np.flatnonzero(still[1:] != still[:-1]).reshape(-1, 2) + 50
    return [(a, b) for a, b in edges if b - a >= 100]


@pytest.fixture(scope="module")
def xsens_fit(xsens, poses):
    return calibrate_norm(np.concatenate([xsens[a : a + 100, 1:] for a, _ in poses]), 9.81744)


def test_xsens_equals_imu_tk(poses, xsens_fit):
    """Bias, 1/scale, misalignment and cost of imu_tk to the digits it prints.

    Its optimiser stops at a relative change of cost of 1e-6, hence 4e-6 relative on the misalignment, which is 1/1000
    of its standard uncertainty.
    """
    assert len(poses) == 38
    np.testing.assert_allclose(xsens_fit.bias, [33124.2, 33275.2, 32364.4], atol=0.05)
    np.testing.assert_allclose(1.0 / xsens_fit.scale, [414.459, 412.010, 414.649], atol=6e-4)
    np.testing.assert_allclose(xsens_fit.misalignment, [0.0033593, -0.00890639, 0.0213341], atol=5e-8)
    assert xsens_fit.cost == pytest.approx(0.120131, abs=5e-7)


def test_xsens_pose_means(xsens, poses, xsens_fit):
    means = np.array([xsens[a:b, 1:].mean(axis=0) for a, b in poses])
    miss = np.linalg.norm(xsens_fit.field(means), axis=1) - 9.81744
    assert np.sqrt(np.mean(miss**2)) == pytest.approx(0.00112, abs=5e-6)


@pytest.mark.parametrize("name", ["imu0", "imu1"])
def test_mpu9150_equals_the_published_run(name):
    """S, NO and B of their M = [[1 + Sx, NOy, NOz], [0, 1 + Sy, NOx], [0, 0, 1 + Sz]] as printed, 4 decimals."""
    log = np.array(gzip.decompress((MPU / f"{name}.log.gz").read_bytes()).split(), float).reshape(-1, 6)
    still = np.linalg.norm(log[:, 3:], axis=1) < 0.13
    quiet, count = np.zeros(len(log), bool), 60
    for i, rest in enumerate(still):
        if rest:
            count += 1
            quiet[i] = count > 60
        else:
            quiet[i - 60 : i + 1] = False
            count = 0
    printed = (MPU / f"their_run_{name}.txt").read_text().splitlines()[2].strip("[] ").split()
    fit = calibrate_norm(log[quiet, :3], 9.81, robust=False)
    m = np.linalg.inv(fit.inverse)
    ours = [m[0, 0] - 1, m[1, 1] - 1, m[2, 2] - 1, m[1, 2], m[0, 1], m[0, 2], *fit.bias]
    # half a unit of the last printed digit; their robust loss moves the answer by less than a tenth of that
    np.testing.assert_allclose(ours, np.array(printed, float), atol=5.5e-5)
    raw = np.linalg.norm(log[quiet, :3], axis=1) - 9.81
    before, after = {"imu0": (0.213, 0.055), "imu1": (0.233, 0.054)}[name]
    assert np.sqrt(np.mean(raw**2)) == pytest.approx(before, abs=5e-4)
    assert fit.rms == pytest.approx(after, abs=5e-4)


def test_exact_readings_come_back():
    rng = np.random.default_rng(0)
    inverse = np.array([[2e-3, 1e-4, -3e-4], [0.0, 1.5e-3, 2e-4], [0.0, 0.0, 2.2e-3]])
    bias = np.array([3e3, -2e3, 1e2])
    fit = calibrate_norm(9.8 * sphere(rng, 30) @ np.linalg.inv(inverse).T + bias, 9.8)
    np.testing.assert_allclose(fit.inverse, inverse, atol=1e-12)
    np.testing.assert_allclose(fit.bias, bias, atol=1e-6)
    assert fit.rms < 1e-9


def test_rotated_or_mirrored_sensors_leave_the_field_length():
    rng = np.random.default_rng(1)
    y = sphere(rng, 40) @ np.diag([3.0, 4.0, 5.0]) + rng.normal(0, 1e-3, (40, 3)) + 1.0
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    np.testing.assert_allclose(calibrate_norm(y).residual, calibrate_norm(y @ turn.T).residual, atol=1e-10)


def test_units_scale_through():
    rng = np.random.default_rng(2)
    y = sphere(rng, 40) * 400.0 + rng.normal(0, 0.1, (40, 3)) + 50.0
    one, other = calibrate_norm(y, 9.8), calibrate_norm(1e6 * y, 9.8)
    np.testing.assert_allclose(other.bias, 1e6 * one.bias, rtol=1e-9)
    np.testing.assert_allclose(other.residual, one.residual, atol=1e-9)
    np.testing.assert_allclose(other.uncertainty["conversion"], 1e6 * one.uncertainty["conversion"], rtol=1e-6)


def test_covariance_is_honest():
    """Normalised squared error of 200 draws, 9 parameters and 31 degrees of freedom, within the chi-square band."""
    rng = np.random.default_rng(3)
    true_inverse, true_bias = np.array([[1.0, 0.1, -0.05], [0, 1.1, 0.02], [0, 0, 0.9]]), np.array([0.2, -0.1, 0.3])
    truth = np.concatenate([true_inverse[np.triu_indices(3)], true_bias])
    directions = sphere(rng, 40)
    squares = []
    for _ in range(200):
        y = directions @ np.linalg.inv(true_inverse).T + true_bias + rng.normal(0, 1e-3, (40, 3))
        fit = calibrate_norm(y)
        miss = np.concatenate([fit.inverse[np.triu_indices(3)], fit.bias]) - truth
        squares.append(miss @ np.linalg.solve(fit.covariance, miss))
    # noise level estimated from 31 degrees of freedom: the mean is 9 * 31 / 29; four sigmas of 200 draws either way
    assert np.mean(squares) == pytest.approx(9 * 31 / 29, abs=4 * np.sqrt(18 / 200) * 1.2)


@pytest.mark.parametrize("outliers", [0, 1, 5])
def test_outliers_are_named_and_hardly_count(outliers):
    rng, squares = np.random.default_rng(17), []
    for _ in range(5):
        true = 5e4 * sphere(rng, 60)
        rows = sorted(rng.choice(60, outliers, replace=False).tolist())
        noisy = true + rng.normal(0.0, 50.0, (60, 3))
        noisy[rows] *= 1.08
        fit = calibrate_norm(noisy @ np.linalg.inv(INVERSE).T + BIAS, 5e4)
        assert [(one.code, list(one.rows)) for one in fit.findings] == [("fit-lengths-odd", rows)] * bool(rows)
        length = np.linalg.norm(fit.field(true @ np.linalg.inv(INVERSE).T + BIAS), axis=1)
        squares.append(np.mean((length / 5e4 - 1.0) ** 2))
        assert fit.rms < 70.0
    # least squares: 0.04 % of the field without outliers, over 1 % with five
    assert np.sqrt(np.mean(squares)) < 6e-4


def test_weights_count_readings():
    rng = np.random.default_rng(5)
    y = sphere(rng, 20) + rng.normal(0, 0.01, (20, 3))
    twice = calibrate_norm(np.concatenate([y, y[:7]]))
    weighted = calibrate_norm(y, weight=np.where(np.arange(20) < 7, 2.0, 1.0))
    np.testing.assert_allclose(twice.inverse, weighted.inverse, atol=1e-9)
    small = calibrate_norm(y, weight=np.where(np.arange(20) < 7, 0.02, 0.01))
    np.testing.assert_allclose(small.covariance, weighted.covariance, rtol=1e-9)
    # a reading of no weight is as if it were not there
    without = calibrate_norm(y, weight=np.arange(20) > 0)
    np.testing.assert_allclose(without.inverse, calibrate_norm(y[1:]).inverse, atol=1e-9)
    assert twice.cost == pytest.approx(weighted.cost)


def test_triad_view_reads_gravity():
    rng = np.random.default_rng(6)
    down = sphere(rng, 30)
    y = -9.8 * down * 400 + 10.0
    triad = calibrate_norm(y, 9.8).triad("accelerometer", specific_force=True)
    np.testing.assert_allclose(triad.field(y), down, atol=1e-9)
    assert triad.field_strength == 9.8


def test_one_side_only_is_refused():
    rng = np.random.default_rng(7)
    down = sphere(rng, 60)
    down[:, 2] = np.abs(down[:, 2]) + 0.3
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    with refused("fit-one-side", error=IdentifiabilityError):
        calibrate_norm(down)


def test_a_hyperboloid_is_said_never_nan():
    """Readings on a one-sheet hyperboloid: no ellipsoid, so the sphere start is tried and refused in words."""
    t = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    z = np.tile([-1.0, -0.3, 0.3, 1.0], 10)
    y = np.column_stack([np.sqrt(1 + z**2) * np.cos(t), np.sqrt(1 + z**2) * np.sin(t), z])
    assert not algebraic_ellipsoid(y).proper
    with refused("fit-undetermined", error=IdentifiabilityError):
        calibrate_norm(y)


def test_one_wild_reading_does_not_bend_the_start():
    rng = np.random.default_rng(8)
    y = sphere(rng, 40)
    clean = algebraic_ellipsoid(y).centre
    y[3] *= 1.5
    assert np.linalg.norm(algebraic_ellipsoid(y).centre - clean) < 0.02


def test_nine_readings_say_that_nothing_is_left_over():
    turns = np.radians(np.arange(9) * 140.0)
    z = np.linspace(-0.95, 0.95, 9)
    y = np.column_stack([np.sqrt(1 - z**2) * np.cos(turns), np.sqrt(1 - z**2) * np.sin(turns), z])
    fit = calibrate_norm(y)
    assert fit.findings[-1].code == "fit-few"


@pytest.mark.parametrize(
    ("signals", "options", "error"),
    [
        (np.ones((8, 3)), {}, IdentifiabilityError),
        (np.ones((20, 2)), {}, InputError),
        (np.ones((2, 20, 3)), {}, InputError),
        (np.ones((20, 3)), {"strength": -1.0}, InputError),
        (np.ones((20, 3)), {"weight": -np.ones(20)}, InputError),
        (np.full((20, 3), np.nan), {}, InputError),
        (np.ones((20, 3)), {}, IdentifiabilityError),
    ],
)
def test_bad_input(signals, options, error):
    with pytest.raises(error):
        calibrate_norm(signals, **options)


def _vibrating(random):
    phase = np.linspace(0.0, 60.0, 2000)[:, None]
    return 0.05 * np.sin(phase * [3.1, 2.3, 1.7] + [0.0, 1.0, 0.0]) + 0.002 * random.normal(size=(2000, 3))


@pytest.mark.parametrize(
    "around",
    [
        lambda random: random.normal(size=(500, 3)),
        lambda random: random.uniform(-0.01, 0.01, (500, 3)),
        lambda random: np.round(0.7 * random.normal(size=(500, 3)) + 0.5),
        _vibrating,
    ],
    ids=["noise", "even noise", "steps of a converter", "vibration"],
)
def test_a_log_at_one_attitude_is_refused(around):
    """Noise about one attitude fits a small ellipsoid of its own with directions all round: accepted without a word."""
    for seed in range(4):
        with pytest.raises(IdentifiabilityError):
            calibrate_norm(np.array([0.1, 0.2, 9.7]) + around(np.random.default_rng(seed)), 9.8)


def test_few_directions_are_warned_of():
    directions = np.random.default_rng(3).normal(size=(12, 3))
    signals = 9.8 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    assert any(fits(one, ["fit-few"], {"least": 18}) for one in calibrate_norm(signals, 9.8).findings)


INVERSE = np.array([[2e-3, 1e-4, -3e-4], [0.0, 1.5e-3, 2e-4], [0.0, 0.0, 2.2e-3]])
BIAS = np.array([3e3, -2e3, 1e2])


def test_the_algebraic_start_is_exact_on_exact_readings():
    """Any ellipsoid, its axes turned, off the origin: |inverse (y - centre)| is 1 everywhere, the root symmetric."""
    rng = np.random.default_rng(11)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    for axes in ([3.0, 4.0, 5.0], [1.0, 0.2, 0.5], [1.0, 1.0, 1.0]):
        y = sphere(rng, 30) @ np.diag(axes) @ turn + [10.0, -20.0, 5.0]
        found = algebraic_ellipsoid(y)
        assert found.proper
        np.testing.assert_allclose(found.inverse, turn.T @ np.diag(1.0 / np.array(axes)) @ turn, atol=1e-9)
        np.testing.assert_allclose(found.centre, [10.0, -20.0, 5.0], atol=1e-9)
    centre, radius = algebraic_sphere(7.0 * sphere(rng, 12) + [1.0, 2.0, 3.0])
    np.testing.assert_allclose([*centre, radius], [1.0, 2.0, 3.0, 7.0], atol=1e-12)
    # thinner than 10 to 1 is taken for poor coverage: the sphere stands in
    assert not algebraic_ellipsoid(sphere(rng, 60) * [1.0, 1.0, 0.07]).proper
    assert algebraic_ellipsoid(sphere(rng, 60) * [1.0, 1.0, 0.14]).proper


def test_directions_are_counted_five_degrees_apart():
    turn = np.radians(np.arange(0.0, 360.0, 1.0))
    ring = np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
    # greedily every fifth degree is the first that is new; rounding of a cosine decides at 5 deg itself
    assert distinct(ring[::6]) == 60
    assert distinct(ring[::4]) == 45
    assert distinct(3.0 * ring[::6], limit=7) == 7
    assert distinct(np.tile(ring[:5:4], (9, 1))) == 1


def test_the_side_is_that_of_the_nearest_point_of_the_hull():
    """Directions in a cap lean towards its axis; turned a little over the rim they surround the origin."""
    rng = np.random.default_rng(12)
    axis = unit(np.array([1.0, -2.0, 0.5]))
    for count in (40, 3000):  # many are thinned to their extremes
        all_round = sphere(rng, count)
        cap = all_round[all_round @ axis > 0.3]
        assert np.degrees(np.arccos(one_sided(cap) @ axis)) < 15.0
        assert one_sided(all_round) is None
    assert one_sided(np.concatenate([np.eye(3), -np.eye(3)])) is None
    # a hull that passes the origin at 0.05 of the radius is beside it
    ring = np.stack([np.cos(np.arange(12.0)), np.sin(np.arange(12.0))], axis=1)
    for height, beside in ((0.06, True), (0.04, False)):
        found = one_sided(np.column_stack([np.sqrt(1.0 - height**2) * ring, np.full(12, height)]))
        assert (found is not None) == beside
    np.testing.assert_array_equal(unit(np.zeros((2, 3))), np.zeros((2, 3)))
    down = sphere(rng, 60) * [1.0, 1.0, 0.2] - [0.0, 0.0, 1.0]
    with refused("fit-one-side", error=IdentifiabilityError):
        require_coverage("signals", down, 5)
    assert require_coverage("signals", all_round, 9) == distinct(all_round)


def test_derivatives_of_the_field_and_of_the_tensor():
    fit = calibrate_norm(9.8 * sphere(np.random.default_rng(13), 30) @ np.linalg.inv(INVERSE).T + BIAS, 9.8)
    y = np.random.default_rng(14).normal(0, 3e3, (5, 3))
    rows, columns = np.triu_indices(3)

    def moved(column, h):
        inverse, bias = fit.inverse.copy(), fit.bias.copy()
        if column < 6:
            inverse[rows[column], columns[column]] += h * 1e-3
        else:
            bias[column - 6] += h * 1e3
        return replace(fit, inverse=inverse, bias=bias)

    slopes, size = fit.field_jacobian(y), np.repeat([1e-3, 1e3], [6, 3])
    for sign in (False, True):
        tensors = fit.tensor_jacobian(specific_force=sign)
        for column in range(9):
            ends = [moved(column, h) for h in (1e-6, -1e-6)]
            slope = (ends[0].field(y) - ends[1].field(y)) / 2e-6
            np.testing.assert_allclose(size[column] * slopes[..., column], slope, atol=1e-6)
            one, other = (parameter_vector(e.triad("accelerometer", specific_force=sign)) for e in ends)
            np.testing.assert_allclose(size[column] * tensors[:, column], (one - other) / 2e-6, atol=1e-4)


def test_uncertainties_are_the_covariance_carried_to_what_is_shown():
    rng = np.random.default_rng(15)
    y = 9.8 * sphere(rng, 40) @ np.linalg.inv(INVERSE).T + BIAS + rng.normal(0.0, 3.0, (40, 3))
    fit = calibrate_norm(y, 9.8)
    rows, columns = np.triu_indices(3)
    u, sd = fit.uncertainty, np.sqrt(np.diag(fit.covariance))
    np.testing.assert_allclose(u["bias"], sd[6:])
    np.testing.assert_allclose(u["scale"], sd[[0, 3, 5]])
    draws = rng.multivariate_normal(np.zeros(9), fit.covariance / np.outer(sd, sd), 20000) * 1e-3 * sd
    seen = {"conversion": [], "misalignment": []}
    for d in draws[:4000]:
        inverse = fit.inverse.copy()
        inverse[rows, columns] += d[:6]
        other = replace(fit, inverse=inverse)
        seen["conversion"].append(1e3 / other.scale)
        seen["misalignment"].append(1e3 * other.misalignment)
    for name, values in seen.items():
        # 4000 draws: 1.1 %
        np.testing.assert_allclose(np.std(values, axis=0), u[name], rtol=0.06)


def test_the_covariance_scales_with_the_residuals_over_their_degrees_of_freedom():
    """Against least squares written out: J'J of differences of the lengths, variance of 21 degrees of freedom."""
    rng = np.random.default_rng(16)
    y = 9.8 * sphere(rng, 30) @ np.linalg.inv(INVERSE).T + BIAS + rng.normal(0.0, 3.0, (30, 3))
    weight = rng.uniform(0.5, 2.0, 30)
    fit = calibrate_norm(y, 9.8, weight)
    direction = fit.field(y) / np.linalg.norm(fit.field(y), axis=1, keepdims=True)
    slope = np.einsum("ki,kip->kp", direction, fit.field_jacobian(y))
    share = weight / weight.mean()
    variance = share @ fit.residual**2 / 21
    np.testing.assert_allclose(fit.covariance, variance * np.linalg.inv((slope.T * share) @ slope), rtol=1e-6)
    # the likeliest: the gradient vanishes
    np.testing.assert_allclose((slope.T * share) @ fit.residual / np.abs(slope).max(axis=0), 0.0, atol=1e-6)
    assert fit.cost == pytest.approx(0.5 * weight @ fit.residual**2)
    assert fit.rms == pytest.approx(np.sqrt(np.mean(fit.residual**2)))


def test_residuals_in_signals_lie_along_the_field():
    """Taken off the signals they leave lengths that are right; over their standard deviation they scatter by one."""
    rng = np.random.default_rng(17)
    y = 9.8 * sphere(rng, 60) @ np.linalg.inv(INVERSE).T + BIAS + rng.normal(0.0, 3.0, (60, 3))
    fit = calibrate_norm(y, 9.8)
    values, scaled = norm_residuals(fit, y)
    np.testing.assert_allclose(np.linalg.norm(fit.field(y - values), axis=1), 9.8, atol=1e-9)
    assert np.sum(scaled[:, 0] ** 2) == pytest.approx(60 - 9)
    np.testing.assert_allclose(scaled[:, 0], scaled[:, 2])


def test_triads_of_bench_readings_in_the_unit_of_their_reference():
    rng = np.random.default_rng(18)
    down, field = sphere(rng, 40), sphere(rng, 40)
    tensor = np.linalg.inv(INVERSE)
    channels = {
        "accelerometer": -9.81 * down @ tensor.T + BIAS + rng.normal(0.0, 3.0, (40, 3)),
        "magnetometer": 50.0 * field @ tensor.T + rng.normal(0.0, 3.0, (40, 3)),
    }
    heat = np.linspace(5.0, 25.0, 40)
    found = calibrate_norms(
        BenchReadings(channels, reference={"g": 9.81, "b": 50.0}, temperature=heat), specific_force=True
    )
    strengths = {"accelerometer": 9.81, "magnetometer": 50.0}
    for place, (kind, seen) in enumerate((("accelerometer", down), ("magnetometer", field))):
        triad = found.tool.triads[kind]
        assert triad.field_strength == strengths[kind]
        # noise of 3 in 5000 and 25000
        np.testing.assert_allclose(triad.field(channels[kind]), seen, atol=5e-3)
        # a direction across the field is lost: of three errors of 3 the length shows one
        np.testing.assert_allclose(found.tool.noise[kind], 3.0, rtol=0.3)
        here = slice(12 * place, 12 * place + 12)
        fit = calibrate_norm(channels[kind], strengths[kind])
        carried = fit.tensor_jacobian(specific_force=kind == "accelerometer")
        np.testing.assert_allclose(found.covariance[here, here], carried @ fit.covariance @ carried.T)
    assert not found.covariance[:12, 12:].any()
    assert found.tool.temperature_range == (5.0, 25.0)
    assert found.residuals.leverage.sum() == pytest.approx(9.0)
    assert any(fits(one, ["fit-coverage"], {"readings": 40}) for one in found.findings)
    upright = calibrate_norms(BenchReadings({"accelerometer": channels["accelerometer"]}), gravity=9.81)
    np.testing.assert_allclose(upright.tool.triads["accelerometer"].field(channels["accelerometer"]), -down, atol=5e-3)
    with refused("input-not-with", name="gyro"):
        calibrate_norms(BenchReadings({"gyro": channels["accelerometer"]}))
