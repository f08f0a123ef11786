"""Swapped axes and wrong signs are told by the dip; what cannot be told is said."""

import numpy as np
import pytest

from inclinometry.errors import InputError
from inclinometry.orientation import dip_angle, fields
from inclinometry.survey.quality_wiring import describe, wiring_check
from inclinometry.survey.stations import Stations

DIP = np.radians(68.0)


def run(change=lambda b: b, turn=lambda g: g, count=12, noise_nt=40.0):
    random = np.random.default_rng(2)
    turned = random.uniform(0, 6.28, count), np.radians(random.uniform(20, 80, count)), random.uniform(0, 6.28, count)
    g, b = fields(*turned, DIP)
    return Stations(np.arange(count) * 30.0, 9.81 * turn(g), change(5e4 * b + random.normal(0, noise_nt, b.shape)))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda b: b[:, [1, 0, 2]], "x and y swapped"),
        (lambda b: b[:, [0, 2, 1]], "y and z swapped"),
        (lambda b: b * [1.0, 1.0, -1.0], "z reversed"),
        (lambda b: b * [-1.0, 1.0, 1.0], "x reversed"),
        (lambda b: -b, "x, y and z reversed (or specific force taken for gravity)"),
        (lambda b: b[:, [1, 0, 2]] * [1.0, -1.0, 1.0], "x and y swapped and "),
    ],
)
def test_each_mistake_is_named(change, words):
    check = wiring_check(run(change), DIP)
    assert check.verdict == "fail"
    assert words in check.reason
    assert len(check.stations) == 12
    assert "convention" in check.action


def test_specific_force_is_named():
    check = wiring_check(run(turn=lambda g: -g), DIP)
    assert "specific force" in check.reason


def test_right_axes_pass():
    assert wiring_check(run(), DIP).verdict == "pass"


def test_the_trap_of_one_station():
    """Azimuth 45, dip 68: with x and y swapped the dip comes out far from 68, which every dip check sees."""
    g, b = fields(np.radians(45.0), np.radians(30.0), np.radians(100.0), DIP)
    assert abs(dip_angle(g, b[[1, 0, 2]]) - DIP) > np.radians(20.0)


def test_too_few_or_too_similar_stations_are_not_judged():
    few = wiring_check(run(count=3), DIP)
    assert few.verdict == "not judged"
    assert "declination" in few.action
    g, b = fields(np.full(5, 0.8), np.radians(90.0), np.full(5, np.pi / 4), 0.0)
    alike = wiring_check(Stations(np.arange(5.0), 9.81 * g, 5e4 * b), 0.0)
    assert alike.verdict == "not judged"
    assert "too much alike" in alike.reason


def test_a_wrong_dip_of_the_site_is_no_mistake_of_wiring():
    check = wiring_check(run(), DIP - np.radians(5.0))
    assert check.verdict == "fail"
    assert "no exchange of axes or signs explains it" in check.reason
    assert "site's dip" in check.action


def test_a_rotation_common_to_both_triads_is_not_seen():
    """Nor is a declination of any sign, which is not among the readings at all."""
    g_y, b_y = (lambda v: v[:, [1, 0, 2]] * [1.0, -1.0, 1.0]), (lambda b: b[:, [1, 0, 2]] * [1.0, -1.0, 1.0])
    assert wiring_check(run(b_y, g_y), DIP).verdict == "pass"


def test_words():
    assert describe(("+x", "+y", "+z")) == "as it is"
    assert describe(("+y", "+z", "+x")) == "channels y, z, x taken for x, y, z"
    assert describe(("-y", "+x", "+z")) == "x and y swapped and y reversed"


@pytest.mark.parametrize("degrees", [-91.0, 91.0])
def test_a_dip_is_no_more_than_vertical(degrees):
    with pytest.raises(InputError, match=r"allowed -1\.5708 to 1\.5708"):
        wiring_check(run(), np.radians(degrees))


def test_a_dip_of_the_wrong_sign_is_named_beside_reversed_axes():
    check = wiring_check(run(), -DIP)
    assert "x, y and z reversed" in check.reason
    assert "the sign of the site's dip_deg" in check.action
