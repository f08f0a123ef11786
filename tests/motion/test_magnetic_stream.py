"""The stream: the same to the last bit for any cutting, gaps, refusals of input."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.errors import InputError
from inclinometry.findings import Finding
from inclinometry.motion.magnetic.phase import MagneticSettings
from inclinometry.motion.magnetic.window import MagneticStream, magnetic_attitude
from inclinometry.motion.result import Attitude, Samples, joined

from .magnetic_runs import run_of, samples_of

CHOSEN = MagneticSettings(window_s=1.0)
COUNT = 900


def fed(samples: Samples, cuts: Sequence[int], chosen: MagneticSettings = CHOSEN) -> Attitude:
    """Block by block."""
    stream = MagneticStream(chosen)
    edges = [0, *sorted(cuts), len(samples)]
    parts = [stream.push(samples.part(a, b)) for a, b in pairwise(edges)]
    return joined([*parts, stream.finish()])


def same(one: Attitude, other: Attitude) -> None:
    """To the last bit."""
    for name in ("time", "quaternion", "covariance", "rate", "quality", "flags", "method"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    assert one.findings == other.findings


@pytest.mark.long
@pytest.mark.parametrize("gyro", [True, False])
@settings(max_examples=15, deadline=None)
@given(cuts=st.lists(st.integers(0, COUNT), max_size=8))
@example(cuts=[0, 0, 1, 2, 2, 3])  # empty blocks and blocks of one sample
@example(cuts=[200, 400])  # exactly at a window's end
@example(cuts=[COUNT, COUNT])
def test_same_for_any_cutting(gyro: bool, cuts: list[int]) -> None:
    """Windows are computed from whole buffers."""
    samples = samples_of(run_of("stick-slip", 1), gyro, 0, COUNT)
    same(fed(samples, cuts), magnetic_attitude(samples, CHOSEN))


def test_sample_by_sample() -> None:
    samples = samples_of(run_of("stick-slip", 1), True, 0, 500)
    same(fed(samples, range(1, 500)), magnetic_attitude(samples, CHOSEN))


def test_rows_lie_at_the_middle_of_their_windows() -> None:
    """Windows of 1 s half overlapping, samples every 5 ms: the first middle is 99.5 intervals after the first stamp."""
    samples = samples_of(run_of("smooth", 1), True, 0, COUNT)
    found = magnetic_attitude(samples, CHOSEN)
    np.testing.assert_allclose(found.time, samples.time[0] + 0.4975 + 0.5 * np.arange(8), atol=1e-9)
    assert found.north == "magnetic"


def test_gap_begins_anew() -> None:
    """No window spans a gap; what was learnt is kept and the gap is told."""
    samples = samples_of(run_of("smooth", 1), True, 0, COUNT)
    stream = MagneticStream(CHOSEN)
    parts = [stream.push(samples.part(0, 300)), stream.push(samples.part(350, COUNT)), stream.finish()]
    found = joined(parts)
    assert not ((found.time > samples.time[300] - 0.49) & (found.time < samples.time[350] + 0.49)).any()
    assert Finding("motion-block-gaps", {"count": 1}, severity="note") in found.findings


def test_input_that_cannot_be_used() -> None:
    samples = samples_of(run_of("smooth", 1), True, 0, 400)
    stream = MagneticStream(CHOSEN)
    stream.push(samples.part(0, 300))
    with refused("input-order"):
        stream.push(samples.part(290, 400))
    with refused("input-block"):
        stream.push(samples_of(run_of("smooth", 1), False, 300, 400))
    with refused("input-triads"):
        stream.push(Samples(samples.time, samples.interval, gyro=samples.gyro))
    with refused("input-few", name="samples"):
        magnetic_attitude(Samples(np.arange(100) * 0.1, 0.1, np.ones((100, 3)), np.ones((100, 3))), CHOSEN)


def test_run_shorter_than_a_window() -> None:
    found = magnetic_attitude(samples_of(run_of("smooth", 1), True, 0, 100), CHOSEN)
    assert len(found) == 0
    assert [one.code for one in found.findings] == ["motion-no-window"]


@pytest.mark.parametrize("wrong", [{"window_s": 0.1}, {"overlap": 0.95}, {"offset_x": np.inf}, {"least_arc": 0.0}])
def test_settings_out_of_range(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError):
        MagneticSettings(**wrong)


def test_stamps_that_jitter() -> None:
    """By up to 0.45 intervals about the even grid: the windows' middles average them, to a hundredth of an interval."""
    samples = samples_of(run_of("smooth", 1), True, 0, COUNT)
    jitter = np.random.default_rng(0).uniform(-0.45, 0.45, COUNT) * samples.interval
    jitter[0] = 0.0
    uneven = Samples(
        samples.time + jitter, samples.interval, samples.accel, samples.mag, samples.gyro, clipped=samples.clipped
    )
    found, even = magnetic_attitude(uneven, CHOSEN), magnetic_attitude(samples, CHOSEN)
    np.testing.assert_array_equal(found.quaternion, even.quaternion)
    np.testing.assert_allclose(found.time, even.time, atol=0.1 * samples.interval)
