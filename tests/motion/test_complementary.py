"""The filter in the almost-inertial frame on motion whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from inclinometry.errors import InputError
from inclinometry.motion.complementary.filter import ComplementarySettings, ComplementaryStream, complementary_attitude
from inclinometry.motion.complementary.offline.smoothed import complementary_smoothed
from inclinometry.motion.result import Samples
from inclinometry.rotations import (
    dcm,
    dcm_from_quaternion,
    quaternion_conjugate,
    quaternion_from_dcm,
    quaternion_log,
    quaternion_multiply,
    rotation_exp,
)
from inclinometry.uncertainty import UNKNOWN

GRAVITY = np.array([0.0, 0.0, 9.81])
FIELD = 50_000.0 * np.array([np.cos(np.radians(65.0)), 0.0, np.sin(np.radians(65.0))])
BOTH = pytest.mark.parametrize("method", [complementary_attitude, complementary_smoothed])


def turned(rate, start, interval):
    """Direction cosines of a tool that turns at (n, 3) rad/s in its own axes, each held over the interval before."""
    matrices, here = np.empty((len(rate), 3, 3)), start
    for i, step in enumerate(rotation_exp(-interval * rate)):
        here = step @ here
        matrices[i] = here
    return matrices


def readings(matrices, rate, interval, *, acceleration=0.0, iron=0.0, bias=0.0, field=FIELD):
    """Samples of an ideal tool; acceleration in north, east, down."""
    accel = np.einsum("nij,nj->ni", matrices, np.broadcast_to(GRAVITY - acceleration, (len(rate), 3)))
    mag = np.einsum("nij,nj->ni", matrices, np.broadcast_to(field, (len(rate), 3))) + iron
    return Samples(interval * np.arange(len(rate)), interval, accel=accel, mag=mag, gyro=rate + bias)


def wandering(seed, count, interval, rms=1.5):
    """Smooth random rotation rates (count, 3), rad/s: a tool turned by hand every way."""
    time = interval * np.arange(count)
    random = np.random.default_rng(seed)
    phase, speed = random.uniform(0.0, 2 * np.pi, (3, 6)), random.uniform(0.1, 0.8, (3, 6))
    return rms * np.sin(2 * np.pi * speed[:, :, None] * time + phase[:, :, None]).mean(axis=1).T * np.sqrt(12.0)


def off(found, matrices):
    """Rotation vectors e (n, 3) with found = (1 + [e x]) true."""
    true = quaternion_from_dcm(matrices)
    return quaternion_log(quaternion_multiply(found.quaternion, quaternion_conjugate(true)))


@BOTH
def test_a_tool_at_rest_is_exact(method):
    random = np.random.default_rng(1)
    for azimuth, inclination, toolface in random.uniform([0, 0.1, 0], [6.28, 3.0, 6.28], (6, 3)):
        matrix = np.broadcast_to(dcm(azimuth, inclination, toolface), (300, 3, 3))
        found = method(readings(matrix, np.zeros((300, 3)), 0.01))
        # exact but for rounding: nothing has to settle
        assert np.abs(off(found, matrix)).max() < 1e-7
        assert found.angles.azimuth == pytest.approx(azimuth, abs=1e-6)
        assert found.angles.inclination == pytest.approx(inclination, abs=1e-6)
        assert found.angles.toolface == pytest.approx(toolface, abs=1e-6)
    assert found.north == "magnetic"


@BOTH
def test_a_tool_that_turns_is_followed_and_positive_rate_is_clockwise(method):
    rate = np.tile([0.0, 0.0, 2.0], (2000, 1))
    matrices = turned(rate, dcm(1.0, 0.5, 0.2), 0.01)
    found = method(readings(matrices, rate, 0.01))
    assert np.abs(off(found, matrices)).max() < 1e-6
    assert np.diff(np.unwrap(found.angles.toolface)) == pytest.approx(0.02, abs=1e-6)
    assert found.rate == pytest.approx(2.0, abs=1e-6)


def test_large_turns_between_samples_are_exact():
    rate = np.tile([0.0, 0.0, 70.0], (400, 1))  # 1.4 rad a sample: beyond the series
    matrices = turned(rate, dcm(1.0, 0.5, 0.2), 0.02)
    assert np.abs(off(complementary_attitude(readings(matrices, rate, 0.02)), matrices)).max() < 1e-6


def test_sway_does_not_reach_inclination():
    time = 0.005 * np.arange(12_000)
    sway = -0.1 * (2 * np.pi) ** 2 * np.sin(2 * np.pi * time)  # 0.1 m at 1 Hz: 3.9 m/s^2, gravity seen 22 deg off
    matrices = np.broadcast_to(dcm(1.0, 0.5, 0.2), (time.size, 3, 3))
    samples = readings(
        matrices, np.zeros((time.size, 3)), 0.005, acceleration=np.stack([sway, 0.5 * sway, 0 * sway], axis=1)
    )
    tilt = np.degrees(np.abs(off(complementary_attitude(samples), matrices)[6000:, :2])).max()
    # the place swings by a tenth of a metre; third-order filtering of its second derivative over seconds leaves
    # x / (g t^2) = 0.1 / (9.81 * 4) = 0.15 deg for t = 2 s
    assert tilt < 0.15


def test_the_gyro_bias_is_found_at_rest_and_in_motion():
    bias = np.radians([0.4, -0.3, 0.25])
    rest, motion = np.zeros((3000, 3)), wandering(3, 6000, 0.01)
    for rate in (rest, motion):
        matrices = turned(rate, dcm(1.0, 0.5, 0.2), 0.01)
        samples = readings(matrices, rate, 0.01, bias=bias)
        stream = ComplementaryStream(0.01)
        stream.push(samples)
        # 0.02 deg/s a second at rest, over 20 s; in motion the smaller of gravity's and the field's information
        assert np.degrees(stream.bias - bias) == pytest.approx(0.0, abs=0.03)


def test_without_a_magnetometer_azimuth_is_unobservable_and_the_rest_is_good():
    rate = wandering(5, 4000, 0.01)
    matrices = turned(rate, dcm(1.0, 0.5, 0.2), 0.01)
    full = readings(matrices, rate, 0.01)
    found = complementary_attitude(Samples(full.time, 0.01, accel=full.accel, gyro=full.gyro))
    assert all("unobservable" in found.names(row) for row in (0, 2000, 3999))
    assert found.u.azimuth[-1] == pytest.approx(UNKNOWN)
    assert np.degrees(found.angles.inclination - np.arccos(matrices[:, 2, 2])) == pytest.approx(0.0, abs=0.05)
    drift = np.unwrap(found.angles.azimuth) - np.unwrap(np.arctan2(-matrices[:, 2, 1], matrices[:, 2, 0]))
    assert np.isfinite(drift).all()
    assert "drifted by" in found.notes[0]


@BOTH
@pytest.mark.parametrize("degrees", [0.2, 0.5, 1.0, 1.8])
@pytest.mark.parametrize(("rest", "bias"), [(0, (0.2, -0.1, 0.15)), (2000, (0.2, -0.1, 0.15)), (2000, None)])
def test_a_slow_turn_does_not_drag_the_heading(method, degrees, rest, bias):
    """A steady turn is as calm as rest; once 11 to 104 deg of 20 to 180 were lost to the bias.

    None: a bias that hides most of the turn, so that the gyro reads what it read at rest.
    """
    count, random = rest + 10_000, np.random.default_rng(23)
    turn = np.radians(degrees) * (np.arange(count) >= rest)
    matrices = dcm(0.5 + 0.01 * np.cumsum(turn), np.pi / 4, 1.7)
    rate = turn[:, None] * matrices[:, :, 2]
    hidden = -0.9 * np.radians(degrees) * matrices[0, :, 2] if bias is None else np.radians(bias)
    ideal = readings(matrices, rate, 0.01, bias=hidden)
    samples = Samples(
        ideal.time,
        0.01,
        accel=ideal.accel + random.normal(0.0, 0.03, (count, 3)),
        mag=ideal.mag + random.normal(0.0, 100.0, (count, 3)),
        gyro=ideal.gyro + random.normal(0.0, 2e-4, (count, 3)),
    )
    found = method(samples, ComplementarySettings(every=50))
    heading = np.einsum("nji,nj->ni", matrices[::50], off(found, matrices[::50]))[:, 2]
    assert np.degrees(np.abs(heading[-1])) < 2.0
    assert (np.abs(heading) < 2.0 * found.u.azimuth).all()


@BOTH
def test_a_passing_disturbance_does_not_turn_azimuth(method):
    rate = wandering(7, 6000, 0.01)
    matrices = turned(rate, dcm(1.0, 0.8, 0.2), 0.01)
    field = np.tile(FIELD, (6000, 1))
    field[3000:4000] += [10_000.0, 12_000.0, -8_000.0]
    found = method(readings(matrices, rate, 0.01, field=field))
    heading = np.einsum("nji,nj->ni", matrices, off(found, matrices))[:, 2]
    # the disturbed field points 18 deg east; 1 s of it passes before the gate knows for certain
    assert np.degrees(np.abs(heading)).max() < 0.5
    assert "disturbed" in found.names(3500)
    assert "disturbed" not in found.names(2900)


@BOTH
def test_a_field_that_stays_is_accepted(method):
    rate = wandering(7, 9000, 0.01)
    matrices = turned(rate, dcm(1.0, 0.8, 0.2), 0.01)
    field = np.tile(FIELD, (9000, 1))
    field[2000:] *= 1.3
    found = method(readings(matrices, rate, 0.01, field=field))
    assert "disturbed" not in found.names(8999)
    heading = np.einsum("nji,nj->ni", matrices, off(found, matrices))[:, 2]
    assert np.degrees(np.abs(heading)).max() < 0.1  # strength changed, direction did not


def test_hard_iron_is_found_and_removed():
    rate = wandering(11, 9000, 0.01)
    matrices = turned(rate, dcm(1.0, 0.8, 0.2), 0.01)
    samples = readings(matrices, rate, 0.01, iron=np.array([5000.0, -6000.0, 4000.0]))
    left = complementary_attitude(samples, ComplementarySettings(iron_ratio=np.inf))
    found = complementary_attitude(samples)
    smooth = complementary_smoothed(samples)
    errors = [np.degrees(np.abs(off(one, matrices)[-1000:])).max() for one in (left, found, smooth)]
    assert errors[0] > 3.0
    assert errors[1] < 1.0
    assert np.degrees(np.abs(off(smooth, matrices))).max() < 0.5
    assert "hard iron" in found.notes[0]


@BOTH
def test_clipped_samples_are_bridged(method):
    rate = wandering(13, 3000, 0.01)
    matrices = turned(rate, dcm(1.0, 0.8, 0.2), 0.01)
    good = readings(matrices, rate, 0.01)
    clipped = np.zeros(3000, dtype=bool)
    clipped[:3], clipped[1500:1505] = True, True
    accel, gyro = good.accel.copy(), good.gyro.copy()
    accel[clipped], gyro[clipped] = 300.0, -30.0
    found = method(Samples(good.time, 0.01, accel=accel, mag=good.mag, gyro=gyro, clipped=clipped))
    seen = ~found.refused
    error = np.zeros((3000, 3))
    error[seen] = np.degrees(
        np.abs(
            quaternion_log(
                quaternion_multiply(found.quaternion[seen], quaternion_conjugate(quaternion_from_dcm(matrices[seen])))
            )
        )
    )
    assert "clipped" in found.names(1502)
    assert "clipped" not in found.names(1510)
    # the turn missed by holding the last rate, and a tenth of a degree for what gravity and field make of it
    missed = 0.01 * np.linalg.norm(rate[1500:1505] - rate[1499], axis=1).sum()
    assert error[10:].max() < np.degrees(missed) + 0.1
    if method is complementary_attitude:
        assert found.refused[:3].all()
        assert not found.refused[3:].any()


def test_rows_of_every_kth_sample_are_those_of_all():
    rate = wandering(17, 1000, 0.01)
    samples = readings(turned(rate, dcm(1.0, 0.8, 0.2), 0.01), rate, 0.01)
    for method in (complementary_attitude, complementary_smoothed):
        every, seventh = method(samples), method(samples, ComplementarySettings(every=7))
        assert (seventh.quaternion == every.quaternion[::7]).all()
        assert (seventh.covariance == every.covariance[::7]).all()
        assert (seventh.time == every.time[::7]).all()


def test_it_stays_finite_at_600_rpm():
    # ten turns a second, exactly one in each block: what noise leaves of the mean direction of x and y is no regressor
    count, interval = 100_000, 0.005
    rate = np.tile([0.0, 0.0, 2 * np.pi * 10.0], (count, 1))
    matrices = dcm(1.0, 0.5, np.cumsum(interval * rate[:, 2]))
    ideal = readings(matrices, rate, interval, bias=np.array([0.0, 0.0, 1e-3]))
    noise = np.random.default_rng(19).normal(0.0, 5.0, (count, 3))
    for accel, allowed in ((ideal.accel, 0.01), (ideal.accel + noise, 5.0)):
        samples = Samples(ideal.time, interval, accel=accel, mag=ideal.mag, gyro=ideal.gyro)
        stream = ComplementaryStream(interval, ComplementarySettings(every=100))
        found = stream.push(samples)
        assert np.isfinite(found.quaternion).all()
        assert np.linalg.norm(found.quaternion, axis=1) == pytest.approx(1.0, abs=1e-12)
        assert np.linalg.eigvalsh(found.covariance).min() > 0.0
        assert np.degrees(np.abs(off(found, matrices[::100])[-100:])).max() < allowed
        assert np.degrees(stream.bias[:2]) == pytest.approx(0.0, abs=0.05)


def test_bad_input_is_refused():
    with pytest.raises(InputError, match="no gyro"):
        complementary_attitude(Samples([0.0, 0.1], 0.1, accel=[[0.0, 0.0, 9.8]] * 2))
    with pytest.raises(InputError, match="another stream"):
        ComplementaryStream(0.01).push(Samples([0.0, 0.1], 0.1, accel=[[0.0, 0.0, 9.8]] * 2, gyro=[[0.0] * 3] * 2))
    with pytest.raises(InputError, match="magnetometer=False"):
        ComplementaryStream(0.1).push(Samples([0.0, 0.1], 0.1, accel=[[0.0, 0.0, 9.8]] * 2, gyro=[[0.0] * 3] * 2))
    with pytest.raises(InputError, match="sway_m"):
        ComplementarySettings(sway_m=0.0)
    with pytest.raises(InputError, match="every"):
        ComplementarySettings(every=0)


def test_no_samples_give_no_rows():
    none = np.empty((0, 3))
    empty = Samples([], 0.01, accel=none, mag=none, gyro=none)
    assert len(complementary_attitude(empty)) == len(complementary_smoothed(empty)) == 0


def test_directions_of_the_covariance():
    rate = np.zeros((3000, 3))
    matrix = np.broadcast_to(dcm(0.7, 1.2, 0.4), (3000, 3, 3))
    found = complementary_attitude(readings(matrix, rate, 0.01))
    level = dcm_from_quaternion(found.quaternion[-1])
    # at rest heading is known as well as the field's evenness, slopes as well as the accelerometer
    spread = np.sqrt(np.diag(level.T @ found.covariance[-1] @ level))
    assert spread[2] == pytest.approx(1200.0 / FIELD[0], rel=0.05)
    assert spread[:2] == pytest.approx(0.03 / 9.81, rel=0.1)


def heaving(amplitude, period, seconds=90.0, interval=0.01):
    """A tool at 45 deg that turns slowly and heaves along itself, m/s^2 and s."""
    time = interval * np.arange(round(seconds / interval))
    rate = np.tile([0.0, 0.0, np.radians(0.1)], (time.size, 1))
    matrices = turned(rate, dcm(1.0, np.pi / 4, 0.2), interval)
    samples = readings(matrices, rate, interval)
    along = amplitude * np.sin(2.0 * np.pi * time / period)[:, None] * [0.0, 0.0, 1.0]
    return matrices, replace(samples, accel=samples.accel - along)


@BOTH
@pytest.mark.parametrize(("amplitude", "period"), [(0.1, 8.0), (0.1, 15.0), (0.1, 30.0), (1.0, 15.0)])
def test_heave_slower_than_sway_widens_the_slope(method, amplitude, period):
    matrices, samples = heaving(amplitude, period)
    found = method(samples)
    late = slice(3000, None)
    off_ = found.angles.inclination[late] - np.arccos(matrices[late, 2, 2])
    # of one phase of heave; over many the benchmark has 0.9 and more
    assert np.mean(np.abs(off_) < 1.96 * found.u.inclination[late]) > 0.8
    if amplitude == 1.0:
        assert "vibration" in found.names(8000)
        assert np.degrees(np.sqrt(np.mean(off_**2))) < 1.5  # 5.9 deg is what such an acceleration leans gravity by


@BOTH
def test_a_field_that_lies_for_long_widens_the_azimuth(method):
    rate = wandering(7, 12000, 0.01)
    matrices = turned(rate, dcm(1.0, 0.8, 0.2), 0.01)
    field = np.tile(FIELD, (12000, 1))
    field[4000:8000] += [2000.0, 6000.0, -3000.0]
    found = method(readings(matrices, rate, 0.01, field=field))
    heading = np.einsum("nji,nj->ni", matrices, off(found, matrices))[:, 2]
    assert (np.abs(heading[500:]) < 1.96 * found.u.azimuth[500:]).mean() > 0.9
    assert "changed for longer than unevenness lasts" in found.notes[-1]
    clean = method(readings(matrices, rate, 0.01))
    assert not any("changed for longer" in text for text in clean.notes)
