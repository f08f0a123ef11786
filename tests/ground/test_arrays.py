"""The gate: what passes is finite float64 of the right shape; what does not is named with its place and value."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.arrays import finite, frozen, within


def test_integers_and_lists_become_float64():
    assert finite([1, 2, 3], "x", (3,)).dtype == np.float64
    assert finite(np.float32(1.5), "x").dtype == np.float64
    assert finite(2, "x").shape == ()


def test_leading_dimensions_are_free_trailing_ones_are_not():
    assert finite(np.zeros((5, 4, 3)), "x", (None, 3)).shape == (5, 4, 3)
    with refused("input-shape", name="x"):
        finite(np.zeros((3, 2)), "x", (None, 3))
    with refused("input-shape", name="x"):
        finite(1.0, "x", (3,))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_the_first_bad_value_is_named_with_its_place(bad):
    values = np.zeros((2, 3))
    values[1, 2] = values[1, 1] = bad
    with refused("input-finite", name="x[1, 1]"):
        finite(values, "x")
    with refused("input-finite", name="x"):
        finite(bad, "x")


@pytest.mark.parametrize("value", ["north", [[1.0], [1.0, 2.0]], {"a": 1}, object()])
def test_what_is_not_numbers_is_refused_in_words(value):
    with refused("input-kind", name="x"):
        finite(value, "x")


def test_range_is_closed_and_its_message_gives_value_range_and_unit():
    assert within([0.0, 1.0], "x", 0.0, 1.0).tolist() == [0.0, 1.0]
    with refused("input-value", name="x[1]"):
        within([0.0, 1.5], "x", 0.0, 1.0, "m")
    with refused("input-finite", name="x"):
        within(np.nan, "x", 0.0, 1.0)


def test_frozen_is_a_copy_that_cannot_be_written():
    source = np.ones(3)
    kept = frozen(source)
    source[0] = 7.0
    assert kept[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        kept[0] = 2.0
