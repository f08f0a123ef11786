"""What a stand can be set to: limits, grids, orientations met once."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration.initial_values import Stand, stand_within
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


def test_a_stand_is_free_to_turn_where_nothing_limits_it():
    free, every = stand_within(candidates=300), (0.0, 2.0 * np.pi)
    limited = stand_within(every, (0.0, np.pi), every, 300)
    for name in ("azimuth", "inclination", "toolface"):
        np.testing.assert_array_equal(getattr(free, name), getattr(limited, name))
    # all round, each setting once; up and down at the ends
    for dial in (free.azimuth, free.toolface):
        steps = np.diff([*dial, 2.0 * np.pi])
        assert dial[0] == 0.0
        np.testing.assert_allclose(steps, steps[0])
    np.testing.assert_allclose(free.inclination[[0, -1]], [0.0, np.pi])


def test_limits_are_reached_and_a_fixed_dial_stays():
    stand = stand_within((0.5, 0.5), (0.2, 1.4), (-1.0, 1.0), 200)
    assert stand.azimuth.tolist() == [0.5]
    np.testing.assert_allclose(stand.inclination[[0, -1]], [0.2, 1.4])
    np.testing.assert_allclose(stand.toolface[[0, -1]], [-1.0, 1.0])
    for dial in (stand.inclination, stand.toolface):
        np.testing.assert_allclose(np.diff(dial), np.ptp(dial) / (len(dial) - 1))
    # no further apart than a step of the finest of 90, 60, 45 ... deg that the number allows, inclination first
    assert len(stand.positions()) <= 220
    assert len(stand_within((0.5, 0.5), (0.2, 0.2), (-1.0, 1.0), 10_000).positions()) == 1 + np.ceil(
        360.0 / np.pi / 0.5
    )


def test_upright_the_same_orientation_is_kept_once():
    turns = np.radians([0.0, 120.0, 240.0])
    upright = Stand(turns, np.array([0.0]), turns).positions()
    assert upright.tolist() == [[0.0, 0.0, t] for t in turns]
    down = Stand(turns, np.array([np.pi]), turns).positions()
    assert down.tolist() == [[0.0, np.pi, t] for t in turns]
    assert len(Stand(turns, np.radians([1.0]), turns).positions()) == 9
    # a turn more is the same setting
    assert len(Stand(np.array([0.0, 2.0 * np.pi]), np.radians([30.0]), turns).positions()) == 3


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"azimuth": (1.0, 0.0)}, "azimuth.limits"),
        ({"toolface": (0.0, 360.0)}, "toolface.limits"),
        ({"candidates": 0}, "candidates"),
    ],
)
def test_limits_that_make_no_stand(options, words):
    with pytest.raises(InputError) as raised:
        stand_within(**options)
    assert words in str(raised.value.finding.values)


def test_settings_that_make_no_stand():
    with refused("input-shape", name="azimuth"):
        Stand(np.zeros(0), np.zeros(1), np.zeros(1))
    with refused("input-value", name="inclination"):
        Stand(np.zeros(1), np.array([90.0]), np.zeros(1))
