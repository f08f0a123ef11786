"""Wrapping and circular means: values any table of angles gives, and the ends of the half-open ranges."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from inclinometry.errors import InputError
from inclinometry.rotations import TAU, circular_mean, wrap_positive, wrap_signed

turns = st.floats(-1e6, 1e6)


@given(turns)
@example(-1e-300)  # rounds up to a full turn, which lies outside
@example(-0.0)
@example(TAU)
@example(-np.pi)
@example(np.nextafter(np.pi, 4.0))
def test_wrapped_angles_stay_in_range_and_point_the_same_way(angle):
    positive, signed = float(wrap_positive(angle)), float(wrap_signed(angle))
    assert 0.0 <= positive < TAU
    assert -np.pi <= signed < np.pi
    # a float of size 1e6 has digits down to 1e-10
    for wrapped in (positive, signed):
        assert np.exp(1j * wrapped) == pytest.approx(np.exp(1j * angle), abs=1e-9)


def test_the_ends_of_the_ranges():
    assert wrap_positive([0.0, TAU, -TAU, -np.pi]).tolist() == [0.0, 0.0, 0.0, np.pi]
    assert wrap_signed([np.pi, -np.pi, 0.0]).tolist() == [-np.pi, -np.pi, 0.0]


@given(st.lists(st.floats(-0.7, 0.7), min_size=1, max_size=6), st.floats(-20.0, 20.0))
def test_mean_turns_with_its_angles(offsets, turn):
    turned, still = circular_mean(np.add(offsets, turn)), circular_mean(offsets)
    # offsets within +-0.7 rad never cancel, so the mean phasor is well conditioned
    assert float(wrap_signed(turned - still - turn)) == pytest.approx(0.0, abs=1e-12)


def test_mean_across_north_along_an_axis():
    degrees = np.array([[350.0, 20.0], [90.0, 100.0]])
    np.testing.assert_allclose(np.degrees(circular_mean(np.radians(degrees), axis=1)), [5.0, 95.0], atol=1e-12)


def test_a_mean_of_nan_is_refused():
    with pytest.raises(InputError, match=r"angle\[1\] is nan"):
        circular_mean([0.0, float("nan")])
