"""Drill holes in closed form: straight, an arc, up-holes; and against wellpathpy where it is installed."""

from __future__ import annotations

import numpy as np
import pytest

from inclinometry.errors import InputError
from inclinometry.survey.holes import drill_hole, inclination_of_dip


def end(hole):
    return np.array([hole.path.north[-1], hole.path.east[-1], hole.path.tvd[-1]])


@pytest.mark.parametrize(("sign", "down_positive"), [(1.0, True), (-1.0, False)])
def test_a_dip_downwards_of_either_sign(sign, down_positive):
    slope = inclination_of_dip(np.radians([sign * 60.0]), down_positive=down_positive)
    # 100 m at 60 deg below the horizon towards the east: cos 60 and sin 60
    assert np.allclose(end(drill_hole([100.0], slope, [np.pi / 2])), [0.0, 50.0, 100.0 * np.sin(np.pi / 3)], atol=1e-12)


def test_a_quarter_of_a_circle():
    radius = 200.0
    angles = np.linspace(0.0, np.pi / 2.0, 7)
    hole = drill_hole(radius * angles, angles, np.full(7, 0.5 * np.pi))
    assert np.allclose(end(hole), [0.0, radius, radius], atol=1e-10)
    assert hole.straight == ()
    assert np.allclose(hole.path.severity, 1.0 / radius)


def test_a_hole_upwards():
    slope = inclination_of_dip(np.radians([45.0]), down_positive=False)
    assert np.allclose(end(drill_hole([10.0], slope, [0.0])), [np.sqrt(50.0), 0.0, -np.sqrt(50.0)])


def test_it_goes_straight_on_above_the_first_shot_and_below_the_last():
    slope = np.radians([30.0, 30.0])
    hole = drill_hole([20.0, 50.0], slope, [0.0, 0.0], end=80.0)
    assert hole.path.md.tolist() == [0.0, 20.0, 50.0, 80.0]
    assert hole.shots == 2
    assert hole.straight == ("first shot", "last shot")
    assert np.allclose(end(hole), [40.0, 0.0, 80.0 * np.cos(np.pi / 6)])
    # an end where the last shot is, is that shot
    assert len(drill_hole([20.0, 50.0], slope, [0.0, 0.0], end=50.0).path) == 3


@pytest.mark.parametrize(
    ("depth", "last", "code"),
    [
        ([-1.0, 5.0], None, "input-value"),
        ([0.0, 50.0], 40.0, "holes-end-above"),
        ([0.0], None, "holes-length-unknown"),
    ],
)
def test_what_is_no_hole(depth, last, code):
    with pytest.raises(InputError) as caught:
        drill_hole(depth, np.zeros(len(depth)), np.zeros(len(depth)), last)
    assert caught.value.finding.code == code


def test_a_textbooks_ratio_factor_ends_at_the_same_place():
    rng = np.random.default_rng(3)
    md = np.concatenate([[0.0], np.cumsum(rng.uniform(5.0, 40.0, 20))])
    slope, heading = rng.uniform(0.1, 1.5, 21), rng.uniform(0.0, 1.0, 21)
    place = np.zeros(3)
    for k in range(20):
        one, two = (
            np.array([np.sin(i) * np.cos(a), np.sin(i) * np.sin(a), np.cos(i)])
            for i, a in ((slope[k], heading[k]), (slope[k + 1], heading[k + 1]))
        )
        bend = np.arccos(one @ two)
        place += 0.5 * (md[k + 1] - md[k]) * (one + two) * 2.0 / bend * np.tan(bend / 2.0)
    # arccos loses half the digits of a small bend; these are tenths of a radian
    assert np.allclose(end(drill_hole(md, slope, heading)), place, atol=1e-9)


def test_wellpathpy_ends_at_the_same_place():
    wellpathpy = pytest.importorskip("wellpathpy")
    rng = np.random.default_rng(2)
    md = np.concatenate([[0.0], np.cumsum(rng.uniform(5.0, 40.0, 20))])
    slope, heading = rng.uniform(0.1, 1.5, 21), rng.uniform(0.0, 1.0, 21)
    tvd, north, east, _ = wellpathpy.mincurve.minimum_curvature(md, np.degrees(slope), np.degrees(heading))
    # its ratio factor is a series below some dogleg
    assert np.allclose(end(drill_hole(md, slope, heading)), [north[-1], east[-1], tvd[-1]], atol=1e-6)
