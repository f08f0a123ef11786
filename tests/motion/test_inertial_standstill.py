"""A run that stands first and turns then: no turn is taken for a standstill, and its first window bends nothing."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from inclinometry.arrays import Array
from inclinometry.earth.rate import earth_rate
from inclinometry.earth.site import Site
from inclinometry.motion.inertial.filter import Engine, gyro_attitude, inertial_attitude
from inclinometry.motion.inertial.smoother import continuous_survey, smoothed_attitude
from inclinometry.motion.inertial.state import InertialSettings, Model
from inclinometry.motion.result import METHODS, Attitude, Samples
from inclinometry.motion.window_filter import WindowBuffer
from inclinometry.rotations import dcm, dcm_from_quaternion, quaternion_from_dcm, rotation_log, wrap_signed

DIP = float(np.radians(65.0))
SITE = Site(latitude=float(np.radians(50.0)), g=9.80665, dip=DIP, dip_sigma=1e-6, b=50_000.0)
TOLD = InertialSettings(coupling_sigma=0.0, delay_sigma_s=0.0, gain_sigma=0.0, ripple_sigma=0.0, lever_sigma=1e-6)
INTERVAL = 0.005


def drawn(seed: int, shaking: float) -> tuple[Samples, Array]:
    """Readings of a tool that stands for 20 s, then turns for 20 s at 120 rpm swinging, and its matrices.

    Errors are drawn from the priors; shaking while it turns is white, m/s^2.
    """
    draw, told = np.random.default_rng(seed), TOLD
    time = INTERVAL * np.arange(round(40.0 / INTERVAL))
    past = np.maximum(time - 20.0, 0.0)
    # integral of 4 pi (1 - cos(2 pi t)) from where it starts: no jump, the trapezium of the strapdown is exact enough
    toolface = draw.uniform(0.0, 6.28) + 4.0 * np.pi * past - 2.0 * np.sin(2.0 * np.pi * past)
    rate = 4.0 * np.pi * (1.0 - np.cos(2.0 * np.pi * past))
    matrix = dcm(draw.uniform(0.0, 6.28), draw.uniform(0.1, 1.5), toolface)
    turning = matrix @ earth_rate(np.radians(50.0)) + rate[:, None] * [0.0, 0.0, 1.0]
    bias, scale = draw.normal(0.0, told.gyro_bias_sigma, 3), draw.normal(0.0, told.gyro_scale_sigma, 3)
    size = (len(time), 3)
    gyro = (turning + bias) / (1.0 - scale) + draw.normal(0.0, told.gyro_noise / np.sqrt(INTERVAL), size)
    noise = np.where(past > 0.0, shaking, told.accel_noise)[:, None]
    gravity = matrix @ [0.0, 0.0, 9.80665] + draw.normal(0.0, told.accel_bias_sigma, 3)
    field = 5e4 * matrix @ [np.cos(DIP), 0.0, np.sin(DIP)] + draw.normal(0.0, 150.0, 3)
    return Samples(
        time,
        INTERVAL,
        accel=gravity + noise * draw.normal(0.0, 1.0, size),
        mag=field + draw.normal(0.0, told.mag_noise, size),
        gyro=gyro,
    ), matrix


@pytest.mark.long
@pytest.mark.parametrize("shaking", [0.03, 2.0])
@pytest.mark.parametrize("method", [inertial_attitude, smoothed_attitude])
def test_covariance_is_honest_after_a_standstill(method: Callable[..., Attitude], shaking: float) -> None:
    """24 tools: mean of e' P^-1 e / 3 in every row; its own standard deviation is 0.17.

    Linearised only once, rows after the standstill are refused or at 2.7 here, and at 10 with coloured vibration.
    """
    found = []
    for seed in range(24):
        record, matrix = drawn(seed, shaking)
        rows = method(record, TOLD, SITE)
        assert not rows.refused.any()
        place = np.rint(rows.time / INTERVAL).astype(int)
        e = rotation_log(dcm_from_quaternion(rows.quaternion) @ np.swapaxes(matrix[place], 1, 2))
        found.append(np.einsum("ki,kij,kj->k", e, np.linalg.inv(rows.covariance), e) / 3.0)
    each = np.mean(found, axis=0)
    assert (each > 0.4).all()
    assert (each < 1.8).all()


def test_a_disturbed_first_turn_is_bridged() -> None:
    """The field is 20 uT off from just before the tool turns: its gyro and gravity go on, and say so."""
    record, matrix = drawn(1, 2.0)
    assert record.mag is not None
    mag = record.mag.copy()
    mag[3900:6000] += matrix[3900:6000] @ [0.0, 2e4, 0.0]
    rows = inertial_attitude(Samples(record.time, INTERVAL, record.accel, mag, record.gyro), TOLD, SITE)
    inside = (rows.time > 20.0) & (rows.time < 30.0)
    assert all("disturbed" in rows.names(k) for k in np.flatnonzero(inside))
    good = ~rows.refused
    place = np.rint(rows.time / INTERVAL).astype(int)[good]
    e = rotation_log(dcm_from_quaternion(rows.quaternion[good]) @ np.swapaxes(matrix[place], 1, 2))
    squared = np.einsum("ki,kij,kj->k", e, np.linalg.inv(rows.covariance[good]), e)
    assert squared.max() < 21.0  # a chance in ten thousand


def turning(rate: float, rest: float, moving: float, bias: float, *, field: bool = True) -> tuple[Samples, Array]:
    """A tool at 45 deg that rests and then turns about the vertical (deg/s), its gyro off by `bias` (deg/s) on x."""
    draw, time = np.random.default_rng(5), 0.02 * np.arange(round((rest + moving) / 0.02))
    speed = np.where(time >= rest, np.radians(rate), 0.0)
    azimuth = 0.5 + np.radians(rate) * np.maximum(time - rest, 0.0)
    matrix = dcm(azimuth, 0.25 * np.pi, 1.7)
    size = (len(time), 3)
    gyro = matrix @ earth_rate(np.radians(50.0)) + speed[:, None] * matrix[:, :, 2] + [np.radians(bias), 0.0, 0.0]
    return Samples(
        time,
        0.02,
        accel=matrix @ [0.0, 0.0, 9.80665] + draw.normal(0.0, 0.03, size),
        mag=5e4 * matrix @ [np.cos(DIP), 0.0, np.sin(DIP)] + draw.normal(0.0, 50.0, size) if field else None,
        gyro=gyro + draw.normal(0.0, 2e-4, size),
    ), azimuth


def station(azimuth: float, time: float) -> Attitude:
    """A north-seeking station of that tool, good to 0.1 deg."""
    return Attitude(
        time=np.array([time]),
        quaternion=quaternion_from_dcm(dcm(azimuth, 0.25 * np.pi, 1.7))[None],
        covariance=np.radians(0.1) ** 2 * np.eye(3)[None],
        rate=np.zeros(1),
        quality=np.ones(1),
        flags=np.zeros(1, dtype=np.uint32),
        method=np.full(1, METHODS.index("gyro"), dtype=np.uint8),
        north="true",
    )


def held(record: Samples, settings: InertialSettings | None = None, start: Attitude | None = None) -> list[bool]:
    """Whether each window was held as a standstill."""
    engine = Engine(Model(settings or InertialSettings(), SITE, record.mag is not None), start)
    seen = [engine.advance(window).seen for window in WindowBuffer(5.0).push(record)]
    return [bool(one is not None and one.still) for one in seen]


@pytest.mark.parametrize("rate", [0.002, 0.005, 0.1, 0.2, 0.5, 2.0])
def test_a_slow_turn_is_not_taken_for_a_standstill(rate: float) -> None:
    """With the field no tool is held; held against 0.002 deg/s, less than the bias hides, it was tilted by 40 u."""
    record, azimuth = turning(rate, 90.0, 60.0, 0.1)
    assert not any(held(record))
    for method in (inertial_attitude, smoothed_attitude):
        rows = method(record, None, SITE)
        off = wrap_signed(rows.angles.azimuth - azimuth[np.rint(rows.time / 0.02).astype(int)])
        assert (np.abs(off) < 3.0 * rows.u.azimuth).all()
        # 2 deg/s turn the tool's axis by 85 deg: an average of it over minutes once shifted azimuth by 2 deg
        assert np.degrees(np.abs(off[-1])) < 0.3
        assert not any("disturbed" in rows.names(k) for k in range(len(rows)))
        assert (np.abs(rows.angles.inclination - 0.25 * np.pi) < 3.0 * rows.u.inclination).all()


@pytest.mark.parametrize("rate", [0.1, 0.2, 0.5, 2.0])
def test_a_gyro_alone_follows_a_slow_turn_about_gravity(rate: float) -> None:
    """Nothing but the gyro sees it, whose bias of 0.1 deg/s the default settings do not exclude: u says so."""
    record, azimuth = turning(rate, 0.0, 60.0, 0.1, field=False)
    assert not any(held(record, None, station(0.5, 0.0)))
    rows = gyro_attitude(record, None, SITE, station(0.5, 0.0))
    off = wrap_signed(rows.angles.azimuth - azimuth[np.rint(rows.time / 0.02).astype(int)])
    assert (np.abs(off) < 3.0 * rows.u.azimuth).all()
    good = InertialSettings(gyro_bias_sigma=1e-6)  # a gyro good to 0.2 deg/h excludes it by itself
    without = Samples(record.time, record.interval, record.accel, gyro=record.gyro - [np.radians(0.1), 0.0, 0.0])
    rows = gyro_attitude(without, good, SITE, station(0.5, 0.0))
    assert np.degrees(np.abs(wrap_signed(rows.angles.azimuth[-1] - azimuth[-1]))) < 0.3


def test_a_gyro_far_off_at_turn_on_is_found_at_rest() -> None:
    """0.5 deg/s: the field shows the bias; alone azimuth stays uncertain."""
    told = InertialSettings(gyro_bias_sigma=float(np.radians(0.5)))
    record, azimuth = turning(0.0, 100.0, 0.0, 0.5)
    rows = inertial_attitude(record, told, SITE)
    assert np.abs(wrap_signed(rows.angles.azimuth[-1] - azimuth[-1])) < 3.0 * rows.u.azimuth[-1]
    alone = Samples(record.time, record.interval, record.accel, gyro=record.gyro)
    rows = gyro_attitude(alone, told, SITE, station(0.5, 0.0))
    assert rows.u.azimuth[-1] > np.radians(10.0)


def test_a_restart_does_not_take_the_given_start_again() -> None:
    """Accelerations of 20 m/s^2 at a third of a hertz for 15 s: no window's mean is gravity, and the run goes on."""
    record, azimuth = turning(0.2, 0.0, 100.0, 0.01, field=False)
    assert record.accel is not None
    accel = record.accel.copy()
    accel[1500:2250] += 20.0 * np.sin(2.0 * np.pi * 0.33 * record.time[1500:2250])[:, None] * [1.0, 0.5, 0.2]
    shaken = Samples(record.time, record.interval, accel, gyro=record.gyro)
    start, end = station(0.5, 0.0), station(float(azimuth[-1]), float(record.time[-1]))
    rows = continuous_survey(shaken, start, end, None, SITE)
    assert rows.refused.any()
    assert not rows.refused[:6].any()
    assert not rows.refused[-4:].any()
    last = wrap_signed(rows.angles.azimuth[-1] - azimuth[-1])
    assert np.abs(last) < 3.0 * rows.u.azimuth[-1] < np.radians(1.0)


@pytest.mark.parametrize("period", [8.0, 15.0])
@pytest.mark.parametrize("method", [inertial_attitude, smoothed_attitude, gyro_attitude])
def test_heave_along_the_tool_is_in_the_uncertainty(method: Callable[..., Attitude], period: float) -> None:
    """0.1 m/s^2 along a tool at 45 deg, which put azimuth 6 u off in silence: it is named, and inside 3 u."""
    record, azimuth = turning(0.1, 0.0, 240.0, 0.05)
    assert record.accel is not None
    heave = 0.1 * np.sin(2.0 * np.pi * record.time / period)[:, None] * [0.0, 0.0, 1.0]
    heaving = Samples(record.time, record.interval, record.accel - heave, record.mag, record.gyro)
    rows = method(heaving, None, SITE, station(0.5, 0.0) if method is gyro_attitude else None)
    good = ~rows.refused
    off = wrap_signed(rows.angles.azimuth - azimuth[np.rint(rows.time / 0.02).astype(int)])[good]
    tilt = (rows.angles.inclination - 0.25 * np.pi)[good]
    assert np.abs([off / rows.u.azimuth[good], tilt / rows.u.inclination[good]]).max() < 3.0
    assert np.mean(["vibration" in rows.names(k) for k in range(len(rows))]) > 0.5


def test_heave_slower_than_a_window_is_in_the_uncertainty() -> None:
    """0.1 m/s^2 every 8 s, invisible to the tapers of 5 s: no window is refused, and the survey is right within 3 u."""
    record, azimuth = turning(0.2, 0.0, 150.0, 0.05, field=False)
    assert record.accel is not None
    moved = 0.1 * np.sin(2.0 * np.pi * record.time / 8.0)[:, None] * [0.5, 0.3, 1.0]
    heaving = Samples(record.time, record.interval, record.accel + moved, gyro=record.gyro)
    end = station(float(azimuth[-1]), float(record.time[-1]))
    rows = continuous_survey(heaving, station(0.5, 0.0), end, None, SITE)
    assert not rows.refused.any()
    place = np.rint(rows.time / 0.02).astype(int)
    assert (np.abs(wrap_signed(rows.angles.azimuth - azimuth[place])) < 3.0 * rows.u.azimuth).all()
    assert (np.abs(rows.angles.inclination - 0.25 * np.pi) < 3.0 * rows.u.inclination).all()
