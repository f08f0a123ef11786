"""Where doubts about a run begin, whom they name, and how likely they are said to be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from inclinometry.survey.plausibility import check_run
from inclinometry.survey.run import Run

from .test_plausibility import hole, table


def straight(size=30, **changed):
    """At inclination 60, azimuth 121 and 30 m apart; other readings where a row is named."""
    r = np.random.default_rng(1)
    inclination, azimuth = 60.0 + 0.03 * r.normal(size=size), 121.0 + 0.03 * r.normal(size=size)
    for row, (i, a) in changed.items():
        inclination[int(row[1:])], azimuth[int(row[1:])] = i, a
    return table(np.arange(size) * 30.0, inclination, azimuth)


def power(run: Run) -> int:
    """Power of ten of the likelihood ratio that is said of the only doubt."""
    (doubt,) = check_run(run)
    return int(doubt.values["log_ratio"] / np.log(10.0))


def test_radians_are_as_likely_as_the_chance_that_degrees_lie_so():
    md, inclination, azimuth = hole()
    # azimuths below 6.3 deg, 57.3; a hole below 3.2 deg, 1 / 0.15; scatters of 0.1 and 0.1 deg, not 57 times less as of
    # one smoothed run in 50, over a range of 10.3 each: 0.1 * 10.3^2 / 0.02 = 500: 2e5
    assert power(table(md, np.radians(inclination), np.radians(azimuth))) == 5


def test_a_reading_that_one_digit_explains_is_likelier_wrong_than_one_that_nothing_does():
    digit, nothing = straight(r15=(80.0, 121.0)), straight(r15=(70.0, 141.0))
    assert check_run(digit)[0].code == "run-station-misread"
    assert check_run(nothing)[0].code == "run-station-off"
    # of 68 readings that were tried (29 and 33 of one digit) one lies within 0.1 of 20 deg: (20 / 0.1)^2 / 68 = 590
    assert 2 <= power(digit) - power(nothing) <= 3


@pytest.mark.parametrize("apart", [1, 2, 3, 7, 20])
@pytest.mark.parametrize("first", [18, 31])
def test_two_stations_exchanged_near_and_far(first, apart):
    md, inclination, azimuth = hole(spacing=30.0, noise_deg=0.02)
    inclination, azimuth = inclination + 0.004 * (md - 400.0), azimuth + 0.02 * md  # no two courses alike
    rows = np.arange(len(md))
    rows[[first, first + apart]] = first + apart, first
    found = check_run(table(md, inclination[rows], azimuth[rows]))
    assert [(one.code, one.rows) for one in found] == [("run-rows-exchanged", (first, first + apart))]


@pytest.mark.parametrize("beside", [-3, 3])
@pytest.mark.parametrize("of", [0, 1])
def test_two_stations_exchanged_beside_a_wrong_one(of, beside):
    md, inclination, azimuth = hole(spacing=30.0, noise_deg=0.02)
    inclination, azimuth = inclination + 0.004 * (md - 400.0), azimuth + 0.02 * md
    rows = np.arange(len(md))
    rows[[30, 45]] = 45, 30
    inclination, azimuth = inclination[rows], azimuth[rows]
    inclination[(30, 45)[of] + beside] += 20.0
    assert ("order", (30, 45)) in [(one.group, one.rows) for one in check_run(table(md, inclination, azimuth))]


def test_of_many_wrong_stations_the_three_furthest_off_are_named():
    run = straight(
        36, **{f"r{row}": (60.0 + off, 121.0) for row, off in ((5, 7.3), (11, 5.7), (17, 8.9), (23, 6.1), (29, 8.3))}
    )
    assert [one.rows for one in check_run(run)] == [(17,), (29,), (5,)]


@pytest.mark.parametrize("end", [0, -1])
def test_a_short_course_at_the_other_end_hides_no_wrong_station(end):
    run = straight(30, **{f"r{range(30)[end]}": (60.0, 151.0)})
    md = run.md.copy()
    md[-1 - end] += -20.0 if end == 0 else 20.0
    assert [one.rows for one in check_run(replace(run, md=md))] == [(range(30)[end],)]


@pytest.mark.parametrize("size", [30, 31])
@pytest.mark.parametrize("end", [0, -1])
def test_the_station_at_an_end_is_named_and_no_other(size, end):
    row = range(size)[end]
    (found,) = check_run(straight(size, **{f"r{row}": (60.0, 151.0)}))
    assert found.rows == (row,)
    assert (found.code, found.values["md_m"]) == ("run-station-end", 30.0 * row)
    assert check_run(straight(size, **{f"r{row}": (60.0, 125.0)})) == []


@pytest.mark.parametrize(("above", "below", "refused"), [(30.0, 30.0, False), (9.0, 30.0, True), (30.0, 9.0, True)])
@pytest.mark.parametrize("row", [1, 15, 28])
def test_a_kink_is_refused_where_its_shorter_course_is_too_short_for_it(row, above, below, refused):
    courses = np.full(29, 30.0)
    courses[row - 1 : row + 1] = above, below
    md = np.concatenate([[0.0], np.cumsum(courses)])
    inclination, azimuth = 60.0 + 0.03 * np.random.default_rng(1).normal(size=30), np.full(30, 121.0)
    inclination[row] += 14.3
    checked = check_run(table(md, inclination, azimuth))
    found = {one.rows: one.severity == "refused" for one in checked if one.group == "station"}
    assert found[(row,)] == refused
