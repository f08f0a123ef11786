"""The filter fed block by block is the filter of the whole run, to the last bit."""

from itertools import pairwise

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from inclinometry.motion.complementary.filter import ComplementarySettings, ComplementaryStream, complementary_attitude
from inclinometry.motion.result import Samples, joined

COUNT, INTERVAL = 700, 0.01
COLUMNS = ("time", "quaternion", "covariance", "rate", "quality", "flags", "method")


def noisy_run(magnetometer=True):
    """A tool shaken at random, with clipped samples; nothing need make sense."""
    random = np.random.default_rng(2)
    mag = random.normal([20_000.0, 3_000.0, 40_000.0], 4_000.0, (COUNT, 3)) if magnetometer else None
    return Samples(
        100.0 + INTERVAL * np.arange(COUNT),
        INTERVAL,
        accel=random.normal([1.0, 2.0, 9.0], 3.0, (COUNT, 3)),
        mag=mag,
        gyro=random.normal(0.0, 2.0, (COUNT, 3)),
        clipped=random.random(COUNT) < 0.05,
    )


def same(one, other):
    """Bit for bit, NaN equal to NaN."""
    return all(getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in COLUMNS)


@given(st.lists(st.integers(0, COUNT), max_size=12), st.integers(1, 9), st.booleans())
@example([0, 0, 1, 2, 3, COUNT], 1, True)
@example([99, 100, 101, 110], 4, False)
@settings(max_examples=60, deadline=None)
def test_any_cutting_gives_the_same_bits(cuts, every, magnetometer):
    samples = noisy_run(magnetometer)
    chosen = ComplementarySettings(every=every)
    stream = ComplementaryStream(INTERVAL, chosen, magnetometer=magnetometer)
    edges = [0, *sorted(cuts), COUNT]
    parts = [stream.push(samples.part(a, b)) for a, b in pairwise(edges)]
    whole = complementary_attitude(samples, chosen)
    assert same(joined([*parts, stream.finish()]), whole)
    assert stream.notes() == whole.notes


def test_sample_by_sample():
    samples = noisy_run()
    stream = ComplementaryStream(INTERVAL)
    parts = [stream.push(samples.part(i, i + 1)) for i in range(COUNT)]
    assert same(joined(parts), complementary_attitude(samples))
