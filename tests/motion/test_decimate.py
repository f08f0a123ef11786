"""Decimation: nothing folds, stamps stay true, the same however the run is cut."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.motion.decimate import DecimationStream, decimate, low_pass
from inclinometry.motion.magnetic.phase import MagneticSettings
from inclinometry.motion.magnetic.window import magnetic_attitude
from inclinometry.motion.result import Samples
from inclinometry.simulate.drilling import simulate_drilling

from .magnetic_runs import FIVE, KNOWN, samples_of, score

COUNT = 700


def noisy(count: int = COUNT) -> Samples:
    rng = np.random.default_rng(3)
    a, b, c = rng.normal(size=(3, count, 3))
    return Samples(
        3.0 + 0.001 * np.arange(count), 0.001, a, b, c, rng.normal(size=count), rng.uniform(size=count) < 0.01
    )


def fed(samples: Samples, cuts: Sequence[int], factor: int) -> Samples:
    stream = DecimationStream(factor)
    edges = [0, *sorted(cuts), len(samples)]
    parts = [stream.push(samples.part(a, b)) for a, b in pairwise(edges)]
    names = ("accel", "mag", "gyro", "temperature", "clipped")
    columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    return Samples(np.concatenate([part.time for part in parts]), parts[0].interval, **columns)


def same(one: Samples, other: Samples) -> None:
    for name in ("time", "accel", "mag", "gyro", "temperature", "clipped"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    assert one.interval == other.interval


@pytest.mark.parametrize("factor", [1, 2, 7])
@settings(max_examples=15, deadline=None)
@given(cuts=st.lists(st.integers(0, COUNT), max_size=8))
@example(cuts=[0, 0, 1, 2, 2, 3])
@example(cuts=[COUNT, COUNT])
def test_same_for_any_cutting(factor: int, cuts: list[int]) -> None:
    same(fed(noisy(), cuts, factor), decimate(noisy(), factor))


def test_sample_by_sample() -> None:
    same(fed(noisy(), range(1, COUNT), 5), decimate(noisy(), 5))


def test_against_a_plain_convolution() -> None:
    """The definition itself; rounding of 200 products."""
    samples, taps = noisy(), low_pass(6)
    plain = np.stack([np.convolve(samples.accel[:, k], taps, "valid")[::6] for k in range(3)], axis=1)
    np.testing.assert_allclose(decimate(samples, 6).accel, plain, atol=1e-13)


@pytest.mark.parametrize("factor", [2, 10, 20])
def test_response(factor: int) -> None:
    """Flat to 1e-5 up to 0.3 of the new rate, 100 dB down from half of it (97 dB at its very edge)."""
    taps = low_pass(factor)
    response = np.abs(np.fft.rfft(taps, 2**16))
    frequency = np.fft.rfftfreq(2**16) * factor
    assert np.abs(response[frequency <= 0.3] - 1.0).max() < 2e-5
    assert response[frequency >= 0.5].max() < 1.4e-5


def test_no_delay() -> None:
    """A slow sine comes out as itself at its own stamps."""
    time = 100.0 + 0.0005 * np.arange(8000)
    wave = np.sin(2.0 * np.pi * 3.0 * time)
    slow = decimate(Samples(time, 0.0005, gyro=np.stack([wave, wave, wave], axis=1)), 10)
    np.testing.assert_allclose(slow.gyro[:, 0], np.sin(2.0 * np.pi * 3.0 * slow.time), atol=2e-5)
    assert slow.interval == pytest.approx(0.005)
    assert slow.time[0] == time[160]


def test_clipped_spreads_to_what_it_touches() -> None:
    """One sample under filters of 65 taps taken every second: 33 of them, or 32 where the ends fall between."""
    clipped = np.zeros(400, dtype=np.bool_)
    clipped[201] = True
    slow = decimate(Samples(np.arange(400.0), 1.0, accel=np.zeros((400, 3)), clipped=clipped), 2)
    touched = np.abs(slow.time - 201.0) <= 32.0
    np.testing.assert_array_equal(slow.clipped, touched)


def test_without_a_filter_vibration_folds() -> None:
    """Every tenth sample of 2 kHz as it is: what lies near 200 Hz folds to rest. Hundreds of times worse where a row
    is left at all: nearly all windows know that they are worthless."""
    fast = replace(FIVE, instrument=replace(FIVE.instrument, factor=1, taps=1))
    with_filter, without = [], []
    for seed in range(3):
        run = simulate_drilling(fast, seed, duration=30.0)
        samples = samples_of(run)
        every = Samples(run.time[::10], 0.005, run.accel[::10], run.mag[::10], run.gyro[::10])
        with_filter.append((magnetic_attitude(decimate(samples, 10), MagneticSettings(**KNOWN)), run))
        without.append((magnetic_attitude(every, MagneticSettings(**KNOWN)), run))
    good = score(with_filter)
    assert good.inclination < 0.01
    rows = sum(len(found) for found, _ in without)
    refused = sum(int(found.refused.sum()) for found, _ in without)
    assert refused > 0.8 * rows
    assert all("vibration" in found.names(k) for found, _ in without for k in np.flatnonzero(found.refused))
    if refused < rows:
        assert score(one for one in without if not one[0].refused.all()).inclination > 100.0 * good.inclination


def test_gap_begins_anew() -> None:
    samples = noisy()
    stream = DecimationStream(2)
    stream.push(samples.part(0, 300))
    after = stream.push(samples.part(310, COUNT))
    same(after, decimate(samples.part(310, COUNT), 2))


@pytest.mark.parametrize("factor", [0, 2.5, 1001])
def test_impossible_factor(factor: float) -> None:
    with refused("input-value", name="factor"):
        DecimationStream(factor)  # type: ignore[arg-type]
