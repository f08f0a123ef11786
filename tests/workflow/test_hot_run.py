"""A hot gyro run through every method."""

import numpy as np
import pytest

from inclinometry.simulate.gyro import hot_run
from inclinometry.workflow.gyro_heating_example import FIXED, JOINT, PATENT, reduce_hot_run, rms_degrees


@pytest.fixture(scope="module")
def runs():
    return [reduce_hot_run(hot_run(seed)) for seed in range(12)]


def test_joint_is_better_than_both_closed_forms(runs):
    rms = rms_degrees(errors for _, errors, _ in runs)
    assert rms[JOINT] < 0.7 * rms[FIXED]
    assert rms[JOINT] < 0.7 * rms[PATENT]


def test_only_the_patent_fails_and_says_why(runs):
    for stations, errors, _ in runs:
        for name, error in errors.items():
            lost = np.flatnonzero(np.isnan(error))
            assert not len(lost) or name == PATENT
            assert all(stations[name].flags[n] for n in lost)


def test_stated_uncertainty_of_joint_is_honest(runs):
    squares = [(errors[JOINT] / stations[JOINT].u("azimuth")) ** 2 for stations, errors, _ in runs]
    # stations of a run share a scale, so the mean over 12 runs of 60 is known to some 15 %; twice that
    assert np.mean(squares) == pytest.approx(1.0, abs=0.3)


def test_order_of_runs_does_not_matter(runs):
    errors = [found for _, found, _ in runs]
    assert rms_degrees(errors[::-1]) == pytest.approx(rms_degrees(errors), rel=1e-12)


def test_a_scale_that_stays_one_needs_no_compensation():
    run = hot_run(0)
    _, errors, track = reduce_hot_run(
        run._replace(scale=0.0 * run.scale + 1.0, a=run.clean_a * run.scale, b=run.clean_b * run.scale)
    )
    # no noise and no drift: what is left is rounding and, for the joint estimate, what it does not need to correct
    assert np.nanmax(np.abs(errors[FIXED])) < 1e-9
    # the noise is stated all the same, and the mean of a density that is not symmetric is not its peak: up to 0.002
    # standard uncertainties of azimuth, 0.012 of scale
    assert np.max(np.abs(errors[JOINT])) < 5e-6
    assert track.scale == pytest.approx(1.0, abs=1e-5)
