"""What a run does all along and breaks once: a turn between two courses, a depth off an even row."""

from __future__ import annotations

import numpy as np
import pytest

from inclinometry.survey.plausibility import check_run
from inclinometry.survey.run import Run
from inclinometry.survey.run_stations import broken_habit


def hole(inclination_deg=40.0, turn_deg_30m=0.3, count=60, seed=1):
    """Courses of 28.7 +- 0.3 m, angles with a tenth of a degree of scatter, radians."""
    r = np.random.default_rng(seed)
    md = np.round(np.cumsum(28.7 + r.normal(0.0, 0.3, count)), 2)
    inclination = inclination_deg + r.normal(0.0, 0.1, count)
    azimuth = 100.0 + turn_deg_30m * md / 30.0 + r.normal(0.0, 0.1, count)
    return md, np.radians(inclination), np.radians(azimuth)


@pytest.mark.parametrize(
    ("turn", "shift"), [(0.3, 20.0), (0.3, 45.0), (0.3, 90.0), (0.3, -30.0), (1.5, 20.0), (1.5, 45.0), (1.5, -30.0)]
)
def test_azimuths_of_another_reference_from_midway_are_warned_of(shift, turn):
    md, inclination, azimuth = hole(turn_deg_30m=turn)
    azimuth[30:] += np.radians(shift)
    (found,) = check_run(Run(md, inclination, azimuth))
    assert (found.code, found.severity, found.rows) == ("run-turn", "warning", (29, 30))
    assert (found.values["md_m"], found.values["next_m"]) == (md[29], md[30])


def test_a_hole_that_turns_and_is_shifted_so_that_its_mirror_goes_on_is_refused():
    """From 142 deg to 232 deg: 360 minus it is 128 deg, which lies as near as neighbours of a turning hole do."""
    md, inclination, azimuth = hole(turn_deg_30m=1.5)
    azimuth[30:] += np.radians(90.0)
    (found,) = check_run(Run(md, inclination, azimuth))
    assert (found.code, found.severity) == ("run-part", "refused")
    assert (found.values["md_m"], found.values["next_m"]) == (md[29], md[30])


def test_what_holes_do_is_not_doubted():
    """A wedge of 3 deg; a kick-off; a turn of 5 deg/30 m that begins and goes on; a build of short radius."""
    for make in (
        lambda md, i, a: (i, np.where(md > 800.0, a + np.radians(4.0), a)),
        lambda md, i, a: (i * 0.0 + np.radians(np.clip(md - 500.0, 0.0, 500.0) * 0.15), a),
        lambda md, i, a: (i, a + np.radians(np.clip(md - 800.0, 0.0, 300.0) * 5.0 / 30.0 / np.sin(np.radians(40.0)))),
        lambda md, i, a: (np.where(md > 800.0, np.radians(58.0), np.radians(0.5)), a),
    ):
        md, inclination, azimuth = hole()
        assert check_run(Run(md, *make(md, inclination, azimuth))) == []


@pytest.mark.parametrize("off", [10.0, 20.0, -10.0])
def test_one_depth_off_an_even_row(off):
    md, inclination, azimuth = hole()
    right = md[20]
    md[20] += off
    (found,) = check_run(Run(md, inclination, azimuth))
    assert (found.code, found.severity, found.rows) == ("run-depth-digit", "warning", (20,))
    assert abs(broken_habit(md).expected - right) < 1.0


def test_all_depths_off_by_a_hundred_from_one_on():
    md, inclination, azimuth = hole()
    md[21:] += 100.0
    (found,) = check_run(Run(md, inclination, azimuth))
    assert (found.code, found.rows) == ("run-depth-digit", tuple(range(21, 60)))


@pytest.mark.parametrize(
    "md",
    [
        np.delete(np.arange(0.0, 1500.0, 25.0), [20, 21, 22, 23]),  # four stations left out: 125 m
        np.insert(np.arange(0.0, 1500.0, 30.0), 20, 585.0),  # one between two
        np.append(np.arange(0.0, 1500.0, 30.0), 1497.3),  # the last depth of all
        np.cumsum(np.random.default_rng(2).uniform(10.0, 40.0, 50)),  # no habit
    ],
)
def test_courses_of_right_runs_are_no_broken_habit(md):
    assert broken_habit(md) is None
