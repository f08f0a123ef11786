"""Swapped axes and wrong signs are told by the dip; what cannot be told is said."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.orientation import dip_angle, fields
from inclinometry.survey.quality_wiring import ADVICE_DIP, mistakes, wiring_check
from inclinometry.survey.stations import Stations

DIP = np.radians(68.0)


def run(change=lambda b: b, turn=lambda g: g, count=12, noise_nt=40.0):
    random = np.random.default_rng(2)
    turned = random.uniform(0, 6.28, count), np.radians(random.uniform(20, 80, count)), random.uniform(0, 6.28, count)
    g, b = fields(*turned, DIP)
    return Stations(np.arange(count) * 30.0, 9.81 * turn(g), change(5e4 * b + random.normal(0, noise_nt, b.shape)))


def fits_with(check):
    """Corrections that fit, as lists of channels."""
    return [[found.values["channels"] for found in way] for way in check.reason.values["mistake"]]


@pytest.mark.parametrize(
    ("change", "channels"),
    [
        (lambda b: b[:, [1, 0, 2]], [("x", "y")]),
        (lambda b: b[:, [0, 2, 1]], [("y", "z")]),
        (lambda b: b * [1.0, 1.0, -1.0], [("z",)]),
        (lambda b: b * [-1.0, 1.0, 1.0], [("x",)]),
        (lambda b: b[:, [1, 0, 2]] * [1.0, -1.0, 1.0], [("x", "y"), ("y",)]),
    ],
)
def test_each_mistake_is_named(change, channels):
    check = wiring_check(run(change), DIP)
    assert (check.verdict, check.reason.code, len(check.stations)) == ("fail", "survey-wiring-axes", 12)
    assert channels in fits_with(check)


@pytest.mark.parametrize("stations", [run(lambda b: -b), run(turn=lambda g: -g)])
def test_all_channels_reversed(stations):
    """Specific force looks the same, and a dip of the wrong sign."""
    check = wiring_check(stations, DIP)
    assert (check.verdict, check.reason.values["advice"]) == ("fail", ADVICE_DIP)
    assert [("x", "y", "z")] in fits_with(check)


def test_right_axes_pass():
    assert wiring_check(run(), DIP).verdict == "pass"


def test_the_trap_of_one_station():
    """Azimuth 45, dip 68: with x and y swapped the dip comes out far from 68, which every dip check sees."""
    g, b = fields(np.radians(45.0), np.radians(30.0), np.radians(100.0), DIP)
    assert abs(dip_angle(g, b[[1, 0, 2]]) - DIP) > np.radians(20.0)


def test_too_few_or_too_similar_stations_are_not_judged():
    few = wiring_check(run(count=3), DIP)
    assert (few.verdict, few.reason.code) == ("not judged", "input-few")
    g, b = fields(np.full(5, 0.8), np.radians(90.0), np.full(5, np.pi / 4), 0.0)
    alike = wiring_check(Stations(np.arange(5.0), 9.81 * g, 5e4 * b), 0.0)
    assert (alike.verdict, alike.reason.code) == ("not judged", "survey-wiring-alike")


def test_a_wrong_dip_of_the_site_is_no_mistake_of_wiring():
    check = wiring_check(run(), DIP - np.radians(5.0))
    assert (check.verdict, check.reason.code) == ("fail", "survey-wiring-unexplained")


def test_a_rotation_common_to_both_triads_is_not_seen():
    """Nor is a declination of any sign, which is not among the readings at all."""
    g_y, b_y = (lambda v: v[:, [1, 0, 2]] * [1.0, -1.0, 1.0]), (lambda b: b[:, [1, 0, 2]] * [1.0, -1.0, 1.0])
    assert wiring_check(run(b_y, g_y), DIP).verdict == "pass"


def test_mistakes_of_a_mapping():
    assert mistakes(("+x", "+y", "+z")) == ()
    assert [one.values["mistake"] for one in mistakes(("+y", "+z", "+x"))] == ["cycled"]
    assert [one.values["mistake"] for one in mistakes(("-y", "+x", "+z"))] == ["exchanged", "reversed"]


@pytest.mark.parametrize("degrees", [-91.0, 91.0])
def test_a_dip_is_no_more_than_vertical(degrees):
    with refused("input-value", name="dip"):
        wiring_check(run(), np.radians(degrees))


def test_a_dip_of_the_wrong_sign_is_named_beside_reversed_axes():
    assert wiring_check(run(), -DIP).reason.values["advice"] == ADVICE_DIP
