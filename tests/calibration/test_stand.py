"""What a stand can be set to: limits, grids, orientations met once."""

import numpy as np
import pytest

from inclinometry.calibration.start import Stand, stand_within
from inclinometry.errors import InputError
from inclinometry.rotations import dcm


def test_positions_of_a_stand_are_different_orientations():
    stand = stand_within(candidates=500)
    turns = dcm(*stand.positions().T).round(9).reshape(-1, 9)
    assert len(np.unique(turns + 0.0, axis=0)) == len(turns)


def test_candidates_come_in_about_the_number_asked_for():
    for wanted in (100, 300, 1000, 5000):
        found = len(stand_within(candidates=wanted).positions())
        assert 0.4 * wanted <= found <= 1.1 * wanted


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"azimuth": (1.0, 0.0)}, "must not exceed"),
        ({"toolface": (0.0, 360.0)}, "toolface limits"),
        ({"candidates": 0}, "candidates"),
    ],
)
def test_limits_that_make_no_stand(options, words):
    with pytest.raises(InputError, match=words):
        stand_within(**options)


def test_settings_that_make_no_stand():
    with pytest.raises(InputError, match="at least one setting"):
        Stand(np.zeros(0), np.zeros(1), np.zeros(1))
    with pytest.raises(InputError, match="inclination"):
        Stand(np.zeros(1), np.array([90.0]), np.zeros(1))
