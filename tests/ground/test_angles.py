"""Wrapping and circular means: values any table of angles gives, and the ends of the half-open ranges."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from inclinometry.rotations import TAU, wrap_positive, wrap_signed

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
