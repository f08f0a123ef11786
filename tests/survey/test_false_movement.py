"""False movement told from real movement: counts of benchmarks.casings over simulated pairs."""

from __future__ import annotations

import pytest
from benchmarks.casings import named, right


@pytest.mark.long
def test_right_pairs_are_silent():
    codes, false = right(1000)
    # one in a hundred
    assert sum(false.values()) <= 10
    assert codes["holes-spikes"] <= 10


@pytest.mark.long
@pytest.mark.parametrize(("error", "share"), [("bias_shift", 0.5), ("angle", 0.7), ("shift", 0.85)])
def test_errors_of_eight_u_are_named(error, share):
    assert named(error, 8.0, 100) >= share
