"""A tool at rest: three solutions that agree, uncertainties that hold, and windows that are not believed."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.earth.rate import earth_rate
from inclinometry.earth.site import Site
from inclinometry.motion.result import Attitude, Samples, joined
from inclinometry.motion.static import (
    NorthSeekingStream,
    StaticSettings,
    StaticStream,
    north_seeking_attitude,
    static_attitude,
    static_davenport,
    static_svd,
)
from inclinometry.motion.window_smoother import rounding_variance
from inclinometry.orientation import fields
from inclinometry.rotations import dcm, dcm_from_quaternion, rotation_log

DIP = float(np.radians(65.0))
SITE = Site(b=50e3, dip=DIP, b_sigma=20.0, dip_sigma=float(np.radians(0.02)))


def coloured(random: np.random.Generator, size: int, share: float) -> np.ndarray:
    """First-order autoregressive noise (size, 3), driven by unit noise."""
    noise = random.standard_normal((size + 100, 3))
    for row in range(1, len(noise)):
        noise[row] += share * noise[row - 1]
    return noise[100:]


def still(
    seed: int, attitude: tuple[float, float, float], *, size: int = 400, share: float = 0.0, step: float = 0.0
) -> Samples:
    """A still tool at 50 Hz; accelerometer noise 0.03 m/s^2 and, when a step is given, rounded to it."""
    random = np.random.default_rng(seed)
    g, b = fields(*attitude, DIP)
    accel = 9.81 * g + 0.03 * coloured(random, size, share)
    accel = np.round(accel / step) * step if step else accel
    return Samples(np.arange(size) / 50.0, 0.02, accel=accel, mag=50e3 * b + 50.0 * coloured(random, size, share))


def drawn(random: np.random.Generator) -> tuple[float, float, float]:
    """Any azimuth and toolface, inclination 5 to 170 deg."""
    return float(random.uniform(0.0, 6.28)), float(random.uniform(0.09, 2.97)), float(random.uniform(0.0, 6.28))


def squared_error(row: Attitude, attitude: tuple[float, float, float]) -> float:
    """e' P^-1 e / 3."""
    e = rotation_log(dcm_from_quaternion(row.quaternion[0]) @ dcm(*attitude).T)
    return float(e @ np.linalg.solve(row.covariance[0], e)) / 3.0


def same(first: Attitude, second: Attitude) -> bool:
    """To the last bit."""
    names = ("time", "quaternion", "covariance", "rate", "quality", "flags", "method")
    return all(np.array_equal(getattr(first, n), getattr(second, n), equal_nan=True) for n in names)


@pytest.mark.long
@pytest.mark.parametrize("reduce", [static_attitude, static_davenport, static_svd])
@pytest.mark.parametrize(("share", "site"), [(0.0, None), (0.8, None), (0.0, SITE), (0.8, SITE)])
def test_covariance_is_honest_for_white_and_correlated_noise(reduce, share, site) -> None:
    """Mean normalised squared error of 150 windows: sd 0.07 of chi-square(3) and of S; 16 batches of 25 samples miss
    a tenth of a correlation of 5 samples."""
    random = np.random.default_rng(5)
    window = StaticSettings(window=8.0)
    found = []
    for seed in range(150):
        attitude = drawn(random)
        found.append(squared_error(reduce(still(seed, attitude, share=share), window, site), attitude))
    assert 0.8 < np.mean(found) < 1.3


@pytest.mark.long
@pytest.mark.parametrize("step", [0.01, 0.1, 0.3])
def test_rounded_readings_have_an_honest_uncertainty(step) -> None:
    """Steps of a third of the noise to ten times it, the step stated; rounding errors are uniform, not Gaussian."""
    random = np.random.default_rng(6)
    window = StaticSettings(window=8.0, accel_resolution=step)
    found = []
    for seed in range(200):
        attitude = drawn(random)
        found.append(squared_error(static_attitude(still(seed, attitude, step=step), window), attitude))
    assert 0.6 < np.mean(found) < 1.3


def test_readings_that_never_change_do_not_have_zero_uncertainty() -> None:
    """Ten samples a code: u is that of the resolution stated, and the row is flagged."""
    g, b = fields(1.0, 0.5, 2.0, DIP)
    frozen = Samples(np.arange(100) / 10.0, 0.1, accel=np.tile(9.81 * g, (100, 1)), mag=np.tile(5e4 * b, (100, 1)))
    row = static_attitude(frozen, StaticSettings(accel_resolution=0.1))
    assert row.u.inclination[0] == pytest.approx(0.1 / np.sqrt(12.0) / 9.81, rel=1e-6)
    assert "stuck" in row.names(0)


def test_rounding_variance_follows_the_noise() -> None:
    """Never less than the scatter of means of rounded noise over all places between two codes (1000 draws: 10 %), and
    gone when the noise is as wide as the step; between, a window cannot tell its noise and the larger value stands."""
    random = np.random.default_rng(2)
    for noise in (0.0, 0.2, 0.35):
        place = random.uniform(-0.5, 0.5, 1000)
        readings = np.round(place[:, None] + noise * random.standard_normal((1000, 2000)))
        scatter = np.mean((readings.mean(axis=1) - place) ** 2) - noise**2 / 2000
        stated = np.mean([rounding_variance(row[:, None], 1.0)[0] for row in readings[:300]])
        assert 0.9 * scatter < stated < 0.084
    assert rounding_variance(np.round(random.standard_normal((2000, 1))), 1.0)[0] < 1e-6


def test_the_three_solutions_agree() -> None:
    """Without a stated dip they are the same; with one they differ by less than the uncertainty of the field."""
    samples = still(1, (1.0, 0.7, 2.0))
    rows = [reduce(samples) for reduce in (static_attitude, static_davenport, static_svd)]
    for row in rows[1:]:
        np.testing.assert_allclose(row.quaternion, rows[0].quaternion, atol=1e-12)
        np.testing.assert_allclose(row.covariance, rows[0].covariance, rtol=1e-6)
    weighted = [reduce(samples, None, SITE) for reduce in (static_davenport, static_svd)]
    np.testing.assert_allclose(weighted[0].quaternion, weighted[1].quaternion, atol=1e-10)
    assert np.trace(weighted[0].covariance[0]) < np.trace(rows[0].covariance[0])


def test_gyro_north_is_true_and_its_bias_is_counted() -> None:
    """Bias of the stated sigma on each axis; azimuth u = bias / horizontal rate at least."""
    random = np.random.default_rng(3)
    sigma, latitude = float(np.radians(0.05 / 3600.0)), 0.9
    found = []
    for _ in range(150):
        attitude = drawn(random)
        c = dcm(*attitude)
        rate = c @ earth_rate(latitude) + sigma * random.standard_normal(3) + 1e-5 * random.standard_normal((400, 3))
        accel = 9.81 * c[:, 2] + 0.03 * random.standard_normal((400, 3))
        window = StaticSettings(window=8.0, gyro_sigma=sigma)
        row = north_seeking_attitude(Samples(np.arange(400) / 50.0, 0.02, accel=accel, gyro=rate), window)
        assert row.north == "true"
        found.append(squared_error(row, attitude))
    assert 0.8 < np.mean(found) < 1.3


def test_a_wrong_latitude_is_noticed() -> None:
    """Ten degrees off; nothing at the right one."""
    c = dcm(1.0, 0.5, 2.0)
    samples = Samples(
        np.arange(64.0), 1.0, accel=np.tile(9.81 * c[:, 2], (64, 1)), gyro=np.tile(c @ earth_rate(0.9), (64, 1))
    )
    window = StaticSettings(window=64.0, gyro_resolution=1e-9)
    assert "misfit" not in north_seeking_attitude(samples, window, Site(latitude=0.9)).names(0)
    assert "misfit" in north_seeking_attitude(samples, window, Site(latitude=0.7)).names(0)


def test_without_a_field_the_azimuth_is_unknown_and_the_rest_is_not() -> None:
    """Gravity alone: inclination and toolface stand, azimuth has the uncertainty of an unknown angle."""
    whole = still(4, (1.0, 0.7, 2.0))
    row = static_attitude(Samples(whole.time, whole.interval, accel=whole.accel), StaticSettings(window=8.0))
    assert row.angles.inclination[0] == pytest.approx(0.7, abs=1e-3)
    assert row.angles.toolface[0] == pytest.approx(2.0, abs=2e-3)
    assert row.u.inclination[0] < 1e-3
    assert row.u.toolface[0] < 1e-3
    assert row.u.azimuth[0] == pytest.approx(np.pi / np.sqrt(3.0))
    assert set(row.names(0)) == {"no-field", "unobservable"}


def test_a_disturbed_field_is_flagged() -> None:
    """Two per cent of the strength is 16 standard deviations of the reference."""
    clean = still(7, (1.0, 0.7, 2.0))
    worse = Samples(clean.time, clean.interval, accel=clean.accel, mag=1.02 * clean.mag)
    window = StaticSettings(window=8.0)
    assert "disturbed" not in static_attitude(clean, window, SITE).names(0)
    assert "disturbed" in static_attitude(worse, window, SITE).names(0)
    assert "disturbed" not in static_attitude(worse, window).names(0)


def moving(turn: float, spin: float, shake: float) -> Samples:
    """Tilting by `turn` over the window, spinning, shaking."""
    time = np.arange(1000) / 100.0
    g, b = fields(1.0, 0.7 + turn * time / 10.0, 2.0 + spin * time, DIP)
    random = np.random.default_rng(8)
    return Samples(
        time,
        0.01,
        accel=9.81 * g + shake * random.standard_normal((1000, 3)),
        mag=50e3 * b + random.standard_normal((1000, 3)),
    )


def test_motion_is_flagged_or_refused() -> None:
    """A slow tilt of 0.6 deg is flagged, one of 6 deg or a rotation refused, a shaking tool called vibrating."""
    slow, fast = (static_attitude(moving(np.radians(angle), 0.0, 0.01)) for angle in (0.6, 6.0))
    assert slow.names(0) == ("not-still",)
    assert slow.quality[0] == 0.0
    assert fast.refused[0]
    assert static_attitude(moving(0.0, 1.0, 0.01)).refused[0]
    assert "vibration" in static_attitude(moving(0.0, 0.0, 0.4)).names(0)
    assert static_attitude(moving(0.0, 0.0, 0.01)).names(0) == ()


def test_rate_follows_the_rotation() -> None:
    """Without a gyro the slope of the batches: positive when the toolface grows."""
    row = static_attitude(moving(0.0, 1e-3, 0.01))
    assert row.rate[0] == pytest.approx(1e-3, rel=0.05)


def test_clipped_samples_are_left_out_and_too_many_refused() -> None:
    """One spoiled sample of 400 changes nothing but a flag; a tenth of them is refused."""
    clean = still(9, (1.0, 0.7, 2.0))
    for count, lost in ((1, False), (40, True)):
        accel, clipped = clean.accel.copy(), np.zeros(400, np.bool_)
        accel[:count], clipped[:count] = 400.0, True
        marked = Samples(clean.time, clean.interval, accel=accel, mag=clean.mag, clipped=clipped)
        row = static_attitude(marked, StaticSettings(window=8.0))
        assert row.refused[0] == lost
        assert row.names(0) == ("clipped",)


def test_a_stuck_channel_is_refused() -> None:
    """One constant channel beside two that are noisy."""
    samples = still(10, (1.0, 0.7, 2.0))
    accel = samples.accel.copy()
    accel[:, 1] = accel[0, 1]
    row = static_attitude(Samples(samples.time, samples.interval, accel=accel, mag=samples.mag))
    assert row.refused[0]
    assert row.names(0) == ("stuck",)


def test_a_vertical_tool_is_called_vertical() -> None:
    """Azimuth uncertain, azimuth + toolface not."""
    row = static_attitude(still(11, (1.0, 1e-4, 2.0)), StaticSettings(window=8.0))
    assert "vertical" in row.names(0)
    assert row.u.magnetic_toolface[0] < 1e-3


_EVEN = still(12, (4.0, 1.2, 5.0), size=530)
RUN = Samples(
    1e6 + _EVEN.time + np.random.default_rng(0).uniform(-0.2, 0.2, 530) * 0.02,
    0.02,
    accel=_EVEN.accel,
    mag=_EVEN.mag,
    clipped=np.arange(530) % 200 == 7,
)


@settings(max_examples=25, deadline=None)
@given(cuts=st.lists(st.integers(0, 530), max_size=8))
@example(cuts=[100, 101, 200, 200, 401])
def test_a_stream_cut_anyhow_gives_the_same_rows(cuts: list[int]) -> None:
    """Bit by bit, empty and one-sample blocks included, stamps that jitter by a fifth of an interval."""
    window = StaticSettings(window=2.0)
    stream, edges = StaticStream(window, SITE), [0, *sorted(cuts), 530]
    parts = [stream.push(RUN.part(a, b)) for a, b in pairwise(edges)]
    rows = joined([part for part in [*parts, stream.finish()] if len(part)])
    assert same(rows, static_attitude(RUN, window, SITE))
    assert len(rows) == 5


def test_a_gap_closes_the_window() -> None:
    """3 s, a gap, 5 s, in windows of 4 s: one row before it and one after, each at the middle of its samples."""
    stream = NorthSeekingStream(StaticSettings(window=4.0))
    gyro = np.random.default_rng(0).normal(0.0, 1e-5, (500, 3))
    run = Samples(_EVEN.time[:500], 0.02, accel=RUN.accel[:500], gyro=gyro)
    first = run.part(0, 150)
    second = Samples(first.time[0] + 0.02 * np.arange(250, 500), 0.02, accel=RUN.accel[250:500], gyro=gyro[250:])
    rows = [stream.push(first), stream.push(second), stream.finish()]
    assert [len(row) for row in rows] == [0, 2, 0]
    np.testing.assert_allclose(rows[1].time, [1.49, 6.99])


def test_what_cannot_be_used_is_refused_with_a_remedy() -> None:
    """No accelerometer, no gyro, too few samples, settings out of range, other triads half way."""
    magnetic = Samples(RUN.time, RUN.interval, mag=RUN.mag)
    for call, words in (
        (lambda: static_attitude(magnetic), "input-triads"),
        (lambda: north_seeking_attitude(RUN), "input-triads"),
        (lambda: static_attitude(RUN, StaticSettings(window=0.2)), "input-few"),
        (lambda: StaticSettings(window=-1.0), "input-value"),
        (lambda: StaticSettings(turn=0.1, most_turn=0.01), "input-value"),
    ):
        with refused(words):
            call()
    stream = StaticStream()
    stream.push(RUN.part(0, 10))
    with refused("input-block"):
        stream.push(magnetic)


def test_an_empty_record_gives_no_rows() -> None:
    """Nothing in, nothing out."""
    assert len(static_attitude(RUN.part(0, 0))) == 0
