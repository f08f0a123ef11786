"""A run that stands first and turns then: bias is known before the scale is, and the first turns must not bend it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from inclinometry.arrays import Array
from inclinometry.earth.rate import earth_rate
from inclinometry.earth.site import Site
from inclinometry.motion.inertial.filter import inertial_attitude
from inclinometry.motion.inertial.smoother import smoothed_attitude
from inclinometry.motion.inertial.state import InertialSettings
from inclinometry.motion.result import Attitude, Samples
from inclinometry.rotations import dcm, dcm_from_quaternion, rotation_log

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
