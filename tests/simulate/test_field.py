"""Hand-held calibrations: constant dip always, constant axial field in a roll set held perfectly."""

import numpy as np

from inclinometry.simulate.field import HandHeld, simulate_field
from inclinometry.simulate.tool import random_tool


def test_dip_is_that_of_the_site_in_every_shot():
    tool, hand = random_tool(1), HandHeld(dip=np.radians(50.0))
    run = simulate_field(tool, hand, noise={}, seed=2)
    fields = [tool.triads[kind].field(run.signals[kind]) for kind in ("accelerometer", "magnetometer")]
    np.testing.assert_allclose(np.sum(fields[0] * fields[1], axis=-1), np.sin(np.radians(50.0)), atol=1e-12)
    assert run.reference["dip"] == np.radians(50.0)
    assert len(run.roll_set) == len(run.orientation) == 32
    assert run.roll_set.count("") == 16


def test_a_roll_set_held_perfectly_turns_about_one_axis():
    hand = HandHeld(shots=0, roll_sets=1, rolls=8, pointing_sd=0.0, roll_sd=0.0)
    axis = hand.orientations(3, 100)[:, :, 2]
    np.testing.assert_allclose(axis, np.broadcast_to(axis[:, :1], axis.shape), atol=1e-14)
    first, second = hand.orientations(3, 1)[0, :2]
    relative = second @ first.T
    np.testing.assert_allclose(relative[:2, :2], np.array([[1, 1], [-1, 1]]) / np.sqrt(2), atol=1e-14)


def test_pointing_scatters_as_stated_in_both_cross_directions():
    hand = HandHeld(shots=0, roll_sets=2, rolls=4, pointing_sd=0.01, roll_sd=0.0)
    exact = HandHeld(shots=0, roll_sets=2, rolls=4, pointing_sd=0.0, roll_sd=0.0)
    pointed, held = hand.orientations(3, 4000), exact.orientations(3, 4000)
    off = np.einsum("dkij,dkj->dki", held, pointed[:, :, 2])
    # 32000 values: 0.4 %; sine against angle at 0.01 rad: 1e-4
    np.testing.assert_allclose(off[..., :2].std(axis=(0, 1)), 0.01, rtol=0.02)


def test_directions_cover_the_sphere():
    free = HandHeld(shots=20, roll_sets=0).orientations(4, 1000)
    axes = free[:, :, 2].reshape(-1, 3)
    np.testing.assert_allclose(axes.T @ axes / len(axes), np.eye(3) / 3, atol=5 * 0.3 / np.sqrt(len(axes)))
