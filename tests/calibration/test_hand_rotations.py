"""Gyro by hand rotations: a real log with published answers, truth inside U, honest covariance, clear refusals."""

from __future__ import annotations

import gzip
from dataclasses import FrozenInstanceError, replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares
from tests.refusals import coded, fits, refused

from inclinometry.calibration.hand_rotations import (
    _Fit,
    _Log,
    _turned,
    calibrate_hand_rotations,
    hand_rotations_calibration,
)
from inclinometry.calibration.norm import calibrate_norm
from inclinometry.constants import EARTH_RATE
from inclinometry.errors import IdentifiabilityError
from inclinometry.rotations import dcm_from_quaternion, rotation_exp
from inclinometry.sensors import Tool, Triad
from inclinometry.simulate.log import simulate_log
from inclinometry.simulate.tool import realistic_tool

XSENS = Path(__file__).parents[1] / "reference" / "xsens-mti"
# test_imu_gyro.calib
PUBLISHED = (
    np.array([[1.0, 0.00593634, 0.00111101], [0.00808812, 1.0, -0.0535569], [0.0253067, -0.0025513, 1.0]]),
    1.0 / np.array([0.000209295, 0.000209899, 0.000209483]),
)
UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def table(data):
    return np.array(gzip.decompress(data).split(), dtype=float).reshape(-1, 4)


@pytest.fixture(scope="module")
def xsens():
    accel = files("inclinometry.workflow").joinpath("demo_data", "xsens_mti", "xsens_acc.txt.gz").read_bytes()
    found, gyro = table(accel), table((XSENS / "xsens_gyro.txt.gz").read_bytes())
    return found[:, 0], found[:, 1:], gyro[:, 1:]


@pytest.fixture(scope="module")
def xsens_fit(xsens):
    return calibrate_hand_rotations(*xsens, gravity=9.81744)


def test_the_integration_and_cost_of_imu_tk_give_its_published_digits(xsens):
    """Its cost, unweighted, with its detector of rests and its bias of the first 50 s, over the same integration.

    It prints the scale with six digits; its optimiser stops at a relative change of cost of 1e-6, hence 3e-6.
    """
    time, accel, gyro = xsens
    window = np.lib.stride_tricks.sliding_window_view(accel - accel.mean(axis=0), 101, axis=0)
    first = np.searchsorted(time, time[0] + 50.0)
    limit = 6.0 * np.linalg.norm(accel[:first].var(axis=0, ddof=1))
    still = np.linalg.norm(window.var(axis=-1, ddof=1), axis=1) < limit
    edges = np.flatnonzero(np.diff(np.r_[False, still, False].astype(int))).reshape(-1, 2) + 50
    poses = [(a, b) for a, b in edges if b - a >= 100]
    fit = calibrate_norm(np.concatenate([accel[a : a + 100] for a, _ in poses]), 9.81744)
    u = np.array([fit.field(accel[a:b]).mean(axis=0) for a, b in poses])
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    ways = [(poses[k][1] - 1, poses[k + 1][0] - 1) for k in range(len(poses) - 1)]
    size = max(b - a for a, b in ways)
    at = np.array([np.minimum(a + np.arange(size + 1), b) for a, b in ways])
    duration, turning = np.diff(time[at], axis=1), gyro[at] - gyro[:first].mean(axis=0)

    def cost(theta):
        end = dcm_from_quaternion(_turned(duration, turning, theta.reshape(3, 3) / 6258.0)[:, -1])
        return (u[1:] - np.einsum("kba,kb->ka", end, u[:-1])).ravel()

    gain = least_squares(cost, np.eye(3).ravel(), xtol=1e-12, ftol=1e-12).x.reshape(3, 3) / 6258.0
    np.testing.assert_allclose(1.0 / np.diag(gain), PUBLISHED[1], rtol=5e-6)
    np.testing.assert_allclose(gain / np.diag(gain), PUBLISHED[0], atol=2e-6)


def test_xsens_agrees_with_the_published_values(xsens_fit):
    """Within 2.5 standard uncertainties of twelve numbers; theirs has the drift of the bias since the start in it."""
    u = xsens_fit.uncertainty
    off = np.abs(xsens_fit.misalignment - PUBLISHED[0]) / np.where(np.eye(3) == 1.0, 1.0, u["misalignment"])
    assert off.max() < 2.5
    assert (np.abs(1.0 / xsens_fit.scale - PUBLISHED[1]) / u["conversion"]).max() < 2.5
    assert len(xsens_fit.rests) == 38
    assert len(xsens_fit.rotations) == 37
    np.testing.assert_allclose(xsens_fit.accelerometer.bias, [33124.2, 33275.2, 32364.4], atol=0.4)


def test_xsens_rotations_are_explained_better_than_with_a_bias_of_the_start(xsens, xsens_fit):
    """0.37 against 0.54 deg: the bias drifts by 0.2 deg/s over the log."""
    time, accel, gyro = xsens
    start = gyro[: np.searchsorted(time, time[0] + 50.0)].mean(axis=0)
    other = calibrate_hand_rotations(time, accel, gyro, gravity=9.81744, bias=start)
    assert np.degrees(xsens_fit.rms) < 0.40
    assert np.degrees(other.rms) > 0.50


def chip(seed, gain=200.0, sd=0.2):
    """Accelerometer of a workshop's tool, and the gyro of a chip: counts per rad/s, its axes a degree or two off."""
    tool = realistic_tool(seed, sensors={"accelerometer": 3, "gyro": 3}, bits=None)
    own = tool.triads["gyro"].tensor[0]
    gyro = Triad(
        "gyro", own / np.linalg.norm(own, axis=1).mean() * gain * EARTH_RATE, [2.0, -1.0, 0.5], "counts", EARTH_RATE
    )
    noise = {"accelerometer": tool.noise["accelerometer"], "gyro": np.full(3, sd)}
    return Tool("chip", {"accelerometer": tool.triads["accelerometer"], "gyro": gyro}, np.zeros((24, 24)), noise)


def log_of(seed, count=36, tool=None, **motion):
    rng = np.random.default_rng(seed)
    poses = rng.uniform(0, 2 * np.pi, count), np.arccos(rng.uniform(-1, 1, count)), rng.uniform(0, 2 * np.pi, count)
    tool = tool or chip(seed)
    return tool, simulate_log(tool, *poses, **({"dwell": 4.0, "move": 2.5, "rate": 100.0} | motion), seed=seed)


SHORT = {"count": 20, "dwell": 2.0, "move": 1.5, "rate": 50.0}


def truth(tool):
    """The parameters of `HandRotations.covariance` in the accelerometer's own axes."""
    accel, gyro = tool.triads["accelerometer"], tool.triads["gyro"]
    turn, upper = np.linalg.qr(np.linalg.inv(accel.tensor[0] / 9.80665))
    signs = np.diag(np.sign(np.diag(upper)))
    upper, gain = signs @ upper, (turn @ signs).T @ (EARTH_RATE * np.linalg.inv(gyro.tensor[0]))
    return np.concatenate([[upper[i, j] for i, j in UPPER], accel.offset[0], gain.ravel(), gyro.offset[0]])


def estimate(found):
    fit = found.accelerometer
    return np.concatenate([[fit.inverse[i, j] for i, j in UPPER], fit.bias, found.gain.ravel(), found.bias])


def signals(log):
    return log.time, log.signals["accelerometer"], log.signals["gyro"]


def test_truth_inside_the_uncertainty():
    tool, log = log_of(3)
    found = calibrate_hand_rotations(*signals(log))
    off = np.abs(estimate(found) - truth(tool)) / np.sqrt(np.diag(found.covariance))
    # 21 numbers: beyond 3.5 once in 100 runs
    assert off.max() < 3.5
    # 5e-5 of scale and axes from 36 rests of 4 s
    assert np.sqrt(np.diag(found.covariance)[9:18]).max() * 200.0 < 1e-4
    np.testing.assert_allclose(
        found.rate(log.signals["gyro"][:10]), (log.signals["gyro"][:10] - found.bias) @ found.gain.T
    )


@pytest.mark.long
def test_squared_errors_are_as_large_as_the_covariance_says():
    """Chi square over degrees of freedom of accelerometer, gain and bias: 1 within what 40 runs can tell."""
    squares = []
    for seed in range(40):
        tool, log = log_of(seed)
        found = calibrate_hand_rotations(*signals(log))
        e = estimate(found) - truth(tool)
        parts = (slice(0, 9), slice(9, 18), slice(18, 21))
        squares.append([e[p] @ np.linalg.solve(found.covariance[p, p], e[p]) / (p.stop - p.start) for p in parts])
    mean = np.mean(squares, axis=0)
    # of 360 and 120 squares the mean scatters by 0.075 and 0.13, twice that with estimated variances
    assert (np.abs(mean - 1.0) < [0.3, 0.3, 0.4]).all()


def test_a_bias_that_drifts_straight_is_taken_off_whole():
    """From the middle of a rest to the middle of the next, so that no share of it stays in a rotation."""
    _, log = log_of(5, **SHORT)
    time, accel, gyro = signals(log)
    drift = 3.0 * (time / time[-1])[:, None] * [1.0, -2.0, 0.5]
    still, moved = (calibrate_hand_rotations(time, accel, g) for g in (gyro, gyro + drift))
    # what the drift may hide weighs the rotations otherwise: a share of the standard uncertainty
    off = np.abs(moved.gain - still.gain).ravel() / np.sqrt(np.diag(moved.covariance)[9:18])
    assert off.max() < 0.8
    assert moved.rms < 1.1 * still.rms
    np.testing.assert_allclose(moved.bias - still.bias, drift.mean(axis=0), rtol=0.05)  # the rests lie evenly


@pytest.fixture(scope="module")
def fitted():
    """A log, the fit inside the calibration, and the calibration."""
    _, log = log_of(5, **SHORT)
    found = calibrate_hand_rotations(*signals(log))
    return _Log(*signals(log)), _Fit(_Log(*signals(log)), found.rests, found.accelerometer, None), found


def test_the_accelerometers_share_is_how_the_gain_follows_its_parameters(fitted):
    """Of linear order, against fits with the accelerometer moved by 30 standard uncertainties both ways."""
    log, _, found = fitted
    own = found.covariance[:9, :9]
    slope = found.covariance[9:18, :9] @ np.linalg.inv(own)
    np.testing.assert_array_equal(found.covariance[:9, 9:18], found.covariance[9:18, :9].T)
    fit, rng = found.accelerometer, np.random.default_rng(0)
    for _ in range(3):
        step = 30.0 * np.sqrt(np.diag(own)) * rng.normal(size=9)
        ends = []
        for way in (step, -step):
            inverse = fit.inverse.copy()
            inverse[tuple(zip(*UPPER, strict=True))] += way[:6]
            moved = replace(fit, inverse=inverse, bias=fit.bias + way[6:])
            ends.append(_Fit(log, found.rests, moved, None).solve(found.gain)[0].ravel())
        wanted = slope @ step
        np.testing.assert_allclose((ends[0] - ends[1]) / 2.0, wanted, atol=2e-3 * np.abs(wanted).max())


def test_what_is_shown_follows_from_the_estimate_and_its_covariance(fitted):
    log, fit, found = fitted
    u, spread = found.uncertainty, found.covariance[9:18, 9:18]
    sd = np.sqrt(np.diag(spread))
    draws = np.random.default_rng(2).multivariate_normal(np.zeros(9), spread / np.outer(sd, sd), 4000) * sd
    others = [replace(found, gain=found.gain + d.reshape(3, 3)) for d in draws]
    # 4000 draws: 1.1 %; ones on the diagonal are certain
    np.testing.assert_allclose(np.std([o.scale for o in others], axis=0), u["scale"], rtol=0.06)
    np.testing.assert_allclose(np.std([1.0 / o.scale for o in others], axis=0), u["conversion"], rtol=0.06)
    off = ~np.eye(3, dtype=bool)
    skew = np.std([o.misalignment for o in others], axis=0)
    np.testing.assert_allclose(skew[off], u["misalignment"][off], rtol=0.06)
    assert np.abs(u["misalignment"][~off]).max() < 1e-12
    np.testing.assert_allclose(found.misalignment @ np.diag(found.scale), found.gain, atol=1e-15)
    # the bias of the rests, each an independent look at it
    means = np.array([log.gyro[a:b].mean(axis=0) for a, b in found.rests.pairs()])
    np.testing.assert_allclose(found.bias, means.mean(axis=0))
    np.testing.assert_allclose(found.bias_scatter, means.std(axis=0, ddof=1))
    np.testing.assert_allclose(u["bias"], means.std(axis=0, ddof=1) / np.sqrt(len(means)))
    # gravity as seen and as the gyro turned it
    seen, left = fit.u1, fit._model(found.gain)[0]
    turned = (seen - left) / np.linalg.norm(seen - left, axis=1, keepdims=True)
    np.testing.assert_allclose(found.residual, np.arccos(np.sum(seen * turned, axis=1)), rtol=1e-5)
    assert found.rms == pytest.approx(np.sqrt(np.mean(found.residual**2)))
    assert found.rotations.tolist() == list(range(19))
    assert any(fits(one, ["fit-rotations-used"], {"count": 19}) for one in found.findings)
    # 18 check the fit
    assert "fit-few" not in coded(found.findings)
    assert len({found, replace(found)}) == 2
    with pytest.raises(FrozenInstanceError):
        found.gain = None


def test_a_stated_bias_is_taken_as_it_is(fitted):
    log, _, found = fitted
    stated = found.bias + [0.05, -0.1, 0.02]
    other = calibrate_hand_rotations(*log, bias=stated)
    np.testing.assert_array_equal(other.bias, stated)
    off = found.rests.noise_sd[3:] / np.sqrt(100.0)  # of a mean over a rest of 2 s
    np.testing.assert_allclose(other.uncertainty["bias"], off, rtol=0.3)
    # what a wrong bias leaves is in the weights, as if each rotation had its own
    sd = np.sqrt(np.diag(other.covariance)[9:18])
    assert (np.abs(other.gain - found.gain).ravel() < 5.0 * sd).all()
    assert sd.mean() > np.sqrt(np.diag(found.covariance)[9:18]).mean()


@pytest.mark.parametrize("unit", ["rad/s", "deg/s", "deg/h"])
def test_a_gyro_in_a_unit_of_rate_needs_no_search(fitted, unit):
    log, _, found = fitted
    per_radian = {"rad/s": 1.0, "deg/s": np.degrees(1.0), "deg/h": np.degrees(3600.0)}[unit]
    signals = (log.gyro - found.bias) @ found.gain.T * per_radian
    other = calibrate_hand_rotations(log.time, log.force, signals, gyro_unit=unit)
    np.testing.assert_allclose(other.gain * per_radian, np.eye(3), atol=1e-4)


def test_residuals_follow_the_gain_and_scatter_as_they_are_weighed(fitted):
    """Derivatives against differences; whitened, errors of the rests, shared by two, and of the bias are 1."""
    _, fit, found = fitted
    _, by_gain, by_bias, end = fit._model(found.gain)
    size, signals = 1e-6 * found.gain[0, 0], fit.signals
    for k in range(9):
        step = size * np.eye(9)[k].reshape(3, 3)
        slope = (fit._model(found.gain + step)[0] - fit._model(found.gain - step)[0]) / (2.0 * size)
        # sums over samples for integrals: a thousandth
        np.testing.assert_allclose(slope, by_gain[..., k], atol=1e-3 * np.abs(by_gain).max())
    for k, step in enumerate(1e-4 * np.eye(3)):
        ends = []
        for way in (step, -step):
            fit.signals = signals - way
            ends.append(fit._model(found.gain)[0])
        fit.signals = signals
        np.testing.assert_allclose((ends[0] - ends[1]) / 2e-4, by_bias[..., k], atol=1e-3 * np.abs(by_bias).max())
    rng = np.random.default_rng(1)
    fit.rests = replace(found.rests, noise_sd=np.zeros(6))
    fit.down_variance = np.linspace(1e-3, 3e-3, len(found.rests)) ** 2
    fit.bias_sd = 0.3 * np.linspace(1.0, 2.0, 3) + 0.0 * fit.bias_sd
    whiten = fit._whitener(found.gain, by_bias, end)
    drawn = []
    for _ in range(4000):
        down = fit.down + np.sqrt(fit.down_variance)[:, None] * rng.normal(size=fit.down.shape)
        off = down[fit.rest + 1] - np.einsum("kab,kb->ka", end, down[fit.rest])
        off += np.einsum("kij,kj->ki", by_bias, fit.bias_sd * rng.normal(size=fit.bias_sd.shape))
        drawn.append(whiten @ fit._flat(off))
    # of 4000 draws a variance scatters by 0.022, a covariance by 0.016: five times the larger of 38 x 38
    np.testing.assert_allclose(np.cov(np.transpose(drawn)), np.eye(len(whiten)), atol=0.11)


def test_noise_of_the_gyro_alone_explains_the_residuals():
    """Chi square of 5 logs of 35 rotations, 61 degrees of freedom each: 1 within four standard deviations."""
    ratios = []
    for seed in range(5):
        tool = chip(seed, sd=6.0)
        _, log = log_of(seed, tool=tool, **(SHORT | {"count": 36}))
        found = calibrate_hand_rotations(*signals(log))
        ratios.append(found.chi_square_ratio)
    assert np.mean(ratios) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / (5 * 61)))


def test_exchanged_and_reversed_channels_are_found_and_said():
    tool, log = log_of(6)
    time, accel, gyro = signals(log)
    found = calibrate_hand_rotations(time, accel, gyro[:, [1, 0, 2]] * [1.0, 1.0, -1.0])
    expected = truth(tool)[9:18].reshape(3, 3)[:, [1, 0, 2]] * [1.0, 1.0, -1.0]
    np.testing.assert_allclose(found.gain, expected, atol=2e-4 * np.abs(expected).max())
    axes = {"kind": "gyro", "axes": ("+y", "+x", "-z")}
    assert any(fits(one, ["bench-axes-exchanged"], axes) for one in found.findings)


def test_any_scale_factor_is_found_without_a_data_sheet():
    _, log = log_of(7, count=20)
    time, accel, gyro = signals(log)
    plain = calibrate_hand_rotations(time, accel, gyro)
    other = calibrate_hand_rotations(time, accel, 1e5 * gyro)
    np.testing.assert_allclose(1e5 * other.gain, plain.gain, rtol=1e-6, atol=1e-9)


def test_the_record_has_the_same_gyro_and_correlations():
    _, log = log_of(3)
    found = calibrate_hand_rotations(*signals(log))
    record = hand_rotations_calibration(found, "sha256:0", name="chip")
    seen = log.signals["gyro"][5000:5010]
    np.testing.assert_allclose(EARTH_RATE * record.tool.triads["gyro"].field(seen), found.rate(seen), rtol=1e-9)
    sd = np.sqrt(np.diag(record.covariance))
    scale = np.where(sd > 0.0, sd, 1.0)  # the accelerometer's axes are zero below the diagonal by definition
    assert np.linalg.eigvalsh(record.covariance / np.outer(scale, scale)).min() > -1e-9
    # nine of the equations go into the accelerometer
    assert record.residuals.leverage.sum() == pytest.approx(9.0)
    lengths = np.linalg.norm(found.accelerometer.tensor, axis=1)
    np.testing.assert_allclose(record.tool.noise["accelerometer"] / lengths, found.accelerometer.rms / 9.80665)
    np.testing.assert_allclose(record.tool.noise["gyro"], 0.2, rtol=0.1)
    # gyro axes are counted from the accelerometer's
    assert np.abs(record.covariance[:12, 12:]).max() > 0.0


def test_a_slip_a_gap_and_a_rate_out_of_range_are_left_out_and_said():
    _, log = log_of(8)
    time, accel, gyro = (part.copy() for part in signals(log))
    middle = [int(100 * (6.5 * k + 5.2)) for k in (3, 9, 15)]
    gyro[middle[0] - 50 : middle[0] + 50, 1] = gyro[:, 1].max()  # clipped
    gyro[middle[1] - 10 : middle[1] + 10] += 60.0  # a knock
    keep = np.ones(len(time), dtype=bool)
    keep[middle[2] - 10 : middle[2] + 10] = False
    found = calibrate_hand_rotations(time[keep], accel[keep], gyro[keep])
    why = [one.values["why"] for one in found.findings if one.code == "fit-rotation-dropped"]
    assert {"gyro out of range", "gap in the log", "does not fit the others"} <= set(why)
    assert len(found.rotations) == 32


@pytest.mark.parametrize("axis", "xyz")
def test_rotations_about_one_axis_name_what_they_do_not_show(axis):
    """The accelerometer sees all of the sphere; the gyros across the axis are dead at every rotation."""
    _, log = log_of(9)
    time, accel, gyro = signals(log)
    gyro = gyro.copy()
    others = ["xyz".index(name) for name in "xyz" if name != axis]
    rng = np.random.default_rng(1)
    gyro[:, others] = rng.normal(0, 0.2, (len(time), 2))
    with refused("fit-gyro-other", "fit-undetermined", error=IdentifiabilityError):
        calibrate_hand_rotations(time, accel, gyro)


def test_rolls_at_a_few_inclinations_name_the_gyros_that_did_not_turn():
    """Fifteen rolls about z at each of three inclinations; between the sets the log is cut."""
    tool, parts, at = chip(2), [], 0.0
    for k, inclination in enumerate((0.6, 1.6, 2.5)):
        roll = np.linspace(0, 6.0, 12)
        log = simulate_log(tool, np.zeros(12), np.full(12, inclination), roll, dwell=2.0, move=1.5, rate=50.0, seed=k)
        parts.append((log.time + at, log.signals["accelerometer"], log.signals["gyro"]))
        at += log.time[-1] + 5.0
    with refused("fit-undetermined", error=IdentifiabilityError, parameters=("gyro_x", "gyro_y")):
        calibrate_hand_rotations(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def test_refusals():
    _, log = log_of(4)
    time, accel, gyro = signals(log)
    with refused("fit-signals-constant", channels=("gyro_y",)):
        calibrate_hand_rotations(time, accel, gyro * [1.0, 0.0, 1.0])
    with refused("input-shape", name="gyro"):
        calibrate_hand_rotations(time, accel[:-1], gyro)
    with refused("fit-rests-few", error=IdentifiabilityError, least=10, rest_s=1.0):
        calibrate_hand_rotations(time[:4000], accel[:4000], gyro[:4000])
    with refused("fit-gyro-other", error=IdentifiabilityError):
        calibrate_hand_rotations(time, accel, gyro, gyro_unit="deg/h")
    # a gyro's log of another time
    with refused("fit-gyro-other", error=IdentifiabilityError):
        calibrate_hand_rotations(time, accel, np.roll(gyro, 700, axis=0))


def test_turning_is_exact_to_fourth_order():
    """Coning: both half the step and the closed form; an error of the fourth power of the step."""

    def miss(count):
        t = np.linspace(0.0, 2.0, count + 1)
        # attitude C(t) = Exp(a t) Exp(b t): its rate in the tool's axes
        a, b = np.array([0.0, 0.0, 2.0]), np.array([1.0, 0.0, 0.0])
        rate = np.einsum("tji,j->ti", rotation_exp(t[:, None] * b), a) + b
        end = _turned(np.full((1, count), 2.0 / count), rate[None], np.eye(3))[0, -1]
        return np.abs(dcm_from_quaternion(end) - rotation_exp(2.0 * a) @ rotation_exp(2.0 * b)).max()

    # the rate between samples is taken as straight: second order in that, fourth in the rotation
    assert miss(400) < 2e-5
    assert 3.5 < miss(200) / miss(400) < 4.5
