"""Right runs that look like a mistake, and the mistake beside them: which of the two is told by what a run shows."""

from __future__ import annotations

import numpy as np
import pytest

from inclinometry.survey.plausibility import check_run

from .test_plausibility import axes, hole, table

SEEDS = range(6)


def noisy(seed, md, inclination, azimuth, along=0.1, across=0.3):
    """Angles with noise, deg, of two decimals."""
    r = np.random.default_rng(seed)
    size = len(md)
    inclination = np.abs(inclination + along * r.normal(size=size))
    return table(md, inclination.round(2), (azimuth + across * r.normal(size=size)).round(2) % 360.0)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("length", "inclination"), [(600.0, 126.0), (450.0, 140.0), (700.0, 115.0)])
def test_a_hole_up_from_a_mine(seed, length, inclination):
    md = np.arange(0.0, length + 1.0, 10.0)
    assert check_run(noisy(seed, md, inclination, 200.0 + md / 100.0)) == []


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("end", [84.0, 75.0, 60.0])
def test_a_level_hole_of_a_mine_that_dips(seed, end):
    md = np.arange(0.0, 601.0, 10.0)
    assert check_run(noisy(seed, md, np.interp(md, [0.0, 100.0, 600.0], [90.0, 90.0, end]), 200.0 + md / 100.0)) == []


def test_a_well_that_is_counted_from_the_other_end_climbs_too():
    md, inclination, azimuth = hole()
    for rows in (md < 600.0, md < 1500.0, md > 900.0):
        found = check_run(table(md[rows], 180.0 - inclination[rows], azimuth[rows]))
        named = [one.group for one in found]
        assert named == (["columns"] if np.ptp(md[rows]) > 550.0 else []), named


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("start", [0.5, 1.0, 2.0])
def test_a_slant_hole_that_turns_from_north(seed, start):
    md = np.arange(0.0, 1501.0, 30.0)
    assert check_run(noisy(seed, md, 20.0, start + 60.0 * md / 1500.0)) == []
    assert check_run(noisy(seed, md, 20.0, start + 60.0 * md / 1500.0, 0.0, 0.0)) == []
    # it holds its direction first, and is read as well as any
    assert check_run(noisy(seed, md, 20.0, start + np.interp(md, [0, 300, 1500], [0, 0, 60]))) == []


@pytest.mark.parametrize("seed", SEEDS)
def test_a_well_that_builds_with_its_columns_exchanged(seed):
    md = np.arange(0.0, 1501.0, 30.0)
    build = np.interp(md, [0, 300, 1500], [0.3, 0.3, 60])
    (found,) = check_run(noisy(seed, md, 20.0, build, 0.3, 0.1))
    assert found.code == "run-top-exchanged"


@pytest.mark.parametrize("step", [10.0, 28.7, 30.0])
@pytest.mark.parametrize("last", [137.0, 278.0, 278.4])
def test_a_last_course_to_total_depth(step, last):
    md = np.arange(0.0, 1500.0, step)
    md = np.append(md, md[-1] + last)
    assert check_run(noisy(1, md, np.clip(md / 30.0, 0.0, 50.0), 100.0)) == []


@pytest.mark.parametrize(("wrong", "refused"), [(1530.0 + 1000.0, False), (1530.0 + 400.0, False), (15300.0, True)])
def test_a_last_depth_with_a_wrong_digit(wrong, refused):
    md = np.append(np.arange(0.0, 1501.0, 30.0), wrong)
    (found,) = check_run(noisy(1, md, np.clip(md / 30.0, 0.0, 50.0), 100.0))
    code = "run-depth-last-tenfold" if refused else "run-depth-last"
    assert (found.code, found.severity == "refused", found.rows) == (code, refused, (len(md) - 1,))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("azimuth", [3.0, 5.0, 40.0, 200.0])
@pytest.mark.parametrize(
    ("along", "across"), [(0.02, 0.1), (0.02, 0.2), (0.05, 0.05), (0.05, 0.2), (0.1, 0.05), (0.1, 0.5)]
)
def test_a_vertical_hole_at_a_steady_inclination_and_azimuth(seed, azimuth, along, across):
    md = np.arange(0.0, 901.0, 30.0)
    assert check_run(noisy(seed, md, 0.6, azimuth, along, across)) == []
    assert check_run(noisy(seed, md, np.interp(md, [0, 200], [0.1, 0.6]), azimuth, along, across)) == []


@pytest.mark.parametrize("digits", [3, 4, 6])
@pytest.mark.parametrize("seed", SEEDS)
def test_inclination_alone_in_radians(seed, digits):
    md, inclination, azimuth = hole(seed=seed)
    (found,) = check_run(table(md, np.radians(inclination).round(digits), azimuth))
    assert (found.values["angle"], found.severity) == ("Inclinations", "warning")
    assert np.log(1e3) <= found.values["log_ratio"] < np.log(1e4)


@pytest.mark.parametrize("seed", SEEDS)
def test_azimuth_alone_in_radians(seed):
    md, inclination, azimuth = hole(seed=seed)
    deep = md > 600.0
    (found,) = check_run(table(md[deep], inclination[deep], np.radians(azimuth[deep]).round(4)))
    assert (found.values["angle"], found.severity) == ("Azimuths", "warning")


@pytest.mark.parametrize(("inclination", "azimuth"), [(0.8, 200.0), (20.0, 355.0), (45.0, 10.0), (130.0, 80.0)])
@pytest.mark.parametrize("seed", SEEDS)
def test_both_angles_of_a_straight_hole_in_radians(seed, inclination, azimuth):
    md = np.arange(0.0, 301.0, 10.0)
    run = noisy(seed, md, inclination, azimuth + (40.0 if inclination < 1.0 else 0.3) * np.sin(md))
    assert check_run(run) == []
    (found,) = check_run(table(md, run.inclination.round(4), run.azimuth.round(4)))
    assert (found.values["angle"], found.severity) == ("Inclinations and azimuths", "refused")


def test_a_plan_of_a_vertical_hole_is_no_file_in_radians():
    md = np.arange(0.0, 1500.0, 30.0)
    for azimuth in (0.0, 4.0, 120.0):
        for digits in (1, 2, 6):
            plan = np.interp(md, [0, 300, 1400], [0, 0, 1.4]).round(digits)
            assert check_run(table(md, plan, np.full(len(md), azimuth))) == []


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("level", "grads"), [(88.5, True), (90.0, True), (91.5, True), (90.0, False), (95.0, False)])
def test_a_level_hole_in_grads_with_azimuths_below_360(seed, level, grads):
    md = np.arange(0.0, 2400.0, 28.5)
    r = np.random.default_rng(seed)
    inclination = np.interp(md, [0, 400, 1300, 2400], [0.3, 0.3, level, level]) + 0.2 * r.normal(size=len(md))
    azimuth = 120.0 + 0.5 * r.normal(size=len(md))
    per = 0.9 if grads else 1.0
    found = check_run(table(md, np.abs(inclination) / per, azimuth / per))
    assert [one.code for one in found] == (["run-level-grads"] if grads else [])


def test_grads_of_a_hole_that_is_nowhere_level_show_in_no_reading():
    md, inclination, azimuth = hole()
    assert check_run(table(md, inclination / 0.9, np.minimum(azimuth, 300.0) / 0.9)) == []
    assert check_run(axes()) == []
