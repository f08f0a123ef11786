"""Vibration, speed, envelopes and spectra of a run, against what was put in."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from inclinometry.motion.monitor import MOST_BINS, MOST_COLUMNS, SEGMENT, Envelopes, Monitor
from inclinometry.motion.result import Samples
from inclinometry.orientation import fields

RATE = 200.0


def turning(seconds, speed, lateral=0.0, axial=0.0, seed=1, kinds=("accel", "mag", "gyro")):
    """A tool that turns at speed(t) rad/s and shakes with white noise of these rms values."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * RATE)) / RATE
    rate = np.broadcast_to(speed(time), time.shape)
    toolface = np.concatenate([[0.0], np.cumsum(rate)[:-1]]) / RATE
    g, b = fields(np.full(time.size, 1.0), 0.5, toolface, 1.1)
    accel = 9.81 * g + rng.normal(size=g.shape) * [lateral, lateral, axial]
    gyro = np.stack([0.0 * rate, 0.0 * rate, rate], axis=1)
    columns = {"accel": accel, "mag": 50_000.0 * b, "gyro": gyro}
    return Samples(time, 1.0 / RATE, **{kind: columns[kind] for kind in kinds})


def watched(samples, window=5.0, cuts=()):
    monitor = Monitor(window)
    edges = [0, *cuts, len(samples)]
    for start, stop in pairwise(edges):
        monitor.push(0, samples.part(start, stop))
    return monitor.finish()


@pytest.mark.parametrize("kinds", [("accel", "mag"), ("accel", "gyro"), ("accel", "mag", "gyro")])
def test_vibration_is_what_is_left_without_turning_gravity(kinds):
    run = turning(20.0, lambda t: 12.0, lateral=3.0, axial=1.0, kinds=kinds)
    vibration = watched(run)[0]
    assert len(vibration) == 4
    # rms of 1000 samples scatters by 1/sqrt(2000), 4 of them and two axes
    np.testing.assert_allclose(vibration.lateral, 3.0, rtol=0.1)
    np.testing.assert_allclose(vibration.axial, 1.0, rtol=0.15)
    np.testing.assert_allclose(vibration.mean, 12.0, rtol=1e-3)
    np.testing.assert_allclose(vibration.stick_slip, 0.0, atol=0.01)


def test_a_tool_that_hardly_turns_shakes_no_less():
    vibration = watched(turning(10.0, lambda t: 0.01, lateral=2.0))[0]
    np.testing.assert_allclose(vibration.lateral, 2.0, rtol=0.1)
    assert np.isnan(vibration.stick_slip).all()


def test_stick_slip_index_of_a_string_that_stops():
    """1 + sin: between nothing and twice the mean, an index of 1."""
    vibration = watched(turning(20.0, lambda t: 20.0 * (1.0 + np.sin(2 * np.pi * 0.4 * t))))[0]
    np.testing.assert_allclose(vibration.stick_slip, 1.0, atol=0.01)  # 0.1 s cut a little off the crests


def test_blocks_do_not_matter():
    run = turning(30.0, lambda t: 7.0 + np.sin(t), lateral=5.0)
    whole, cut = watched(run), watched(run, cuts=(1, 2, 700, 2500, 2500, 5999))
    for name in ("time", "lateral", "peak", "slowest"):
        assert np.array_equal(getattr(whole[0], name), getattr(cut[0], name))
    assert np.array_equal(whole[3].density, cut[3].density)
    assert [e.what for e in whole[2]] == [e.what for e in cut[2]]
    for a, b in zip(whole[1], cut[1], strict=True):
        assert np.array_equal(a.low, b.low)
        np.testing.assert_allclose(a.mean, b.mean, rtol=1e-12, atol=1e-9)  # sums in another order


def test_the_spectrum_of_white_noise_and_of_a_line():
    """White noise of rms s on two axes has 2 s^2 / (fs / 2) everywhere; a line of amplitude a holds a^2 / 2."""
    spectra = watched(turning(60.0, lambda t: 0.0, lateral=3.0))[3]
    inner = spectra.density[:, 3:-3].mean()
    assert inner == pytest.approx(2 * 9.0 / (RATE / 2), rel=0.03)  # mean of 12 x 123 x 3 values with chi-square scatter
    run = turning(60.0, lambda t: 0.0)
    run.accel[:, 0] += 2.0 * np.sin(2 * np.pi * 31.25 * run.time)
    spectra = watched(run)[3]
    step = spectra.frequency[1]
    assert spectra.frequency[spectra.density.mean(axis=0).argmax()] == pytest.approx(31.25, abs=step)
    assert spectra.density.mean(axis=0).sum() * step == pytest.approx(2.0, rel=0.01)


@pytest.mark.long
def test_memory_does_not_grow_with_the_run():
    monitor, block = Monitor(2.0), turning(10.0, lambda t: 5.0, lateral=1.0)
    for k in range(400):
        monitor.push(0, Samples(block.time + 10.0 * k, 1.0 / RATE, accel=block.accel, mag=block.mag, gyro=block.gyro))
    vibration, envelopes, excerpts, spectrogram = monitor.finish()
    assert len(vibration) == 2000
    assert MOST_BINS / 2 < len(envelopes[0].time) <= 2 * MOST_BINS
    assert MOST_COLUMNS / 2 < len(spectrogram.density) <= 2 * MOST_COLUMNS
    assert not np.isnan(spectrogram.density).any()
    assert max(len(e.time) for e in excerpts) <= 2000
    assert spectrogram.time[-1] == pytest.approx(4000.0, rel=0.01)


def test_an_envelope_covers_every_sample():
    rng = np.random.default_rng(2)
    values = rng.normal(size=(50_000, 2))
    thin = Envelopes(["a", "b"], ["", ""], 0.0, 1.0)
    for start in range(0, 50_000, 3_333):
        part = slice(start, start + 3_333)
        thin.push(np.arange(50_000.0)[part], values[part])
    for column, found in zip(values.T, thin.done(), strict=True):
        width = found.time[1] - found.time[0]
        place = (np.arange(50_000) / width).astype(int)
        for k in (0, 7, len(found.time) - 1):
            assert found.low[k] == column[place == k].min()
            assert found.high[k] == column[place == k].max()
            assert found.mean[k] == pytest.approx(column[place == k].mean(), abs=1e-12)


def test_a_run_without_accelerometers_has_speeds_alone():
    vibration, _, excerpts, spectrogram = watched(turning(6.0, lambda t: 8.0, kinds=("mag",)))
    np.testing.assert_allclose(vibration.mean, 8.0, rtol=1e-6)
    assert np.isnan(vibration.lateral).all()
    assert spectrogram is None
    assert len(excerpts) == 1
    assert watched(turning(2.0, lambda t: 8.0).part(0, SEGMENT // 2), window=0.5)[0].time.size == 1
