"""Multi-station analysis on the forty shipped runs and on runs drawn from the priors."""

from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest

from inclinometry.survey.multistation import multistation
from inclinometry.survey.multistation_priors import published_priors
from inclinometry.uncertainty import chi_square_limit

from .multistation_runs import DIP, NOISE, REFERENCE, B, G, azimuth_error, azimuth_u, hole, rms, shipped, stations

SPECIFIED = {"build": 0.130, "horiz_EW": 0.806, "horiz_NS": 0.125, "turn3d": 0.124}
"""Median over ten runs of the root mean square azimuth error, deg: a first estimate of the same kind."""


@pytest.fixture(scope="module")
def forty():
    """Per run: geometry, rms azimuth error before and after, rms standard uncertainty (deg), errors over u."""
    rows = []
    for run in shipped():
        found = multistation(run.stations, run.reference)
        error, u = azimuth_error(found.corrected, run.azimuth), azimuth_u(found.corrected)
        rows.append((run.geometry, rms(azimuth_error(run.stations, run.azimuth)), rms(error), rms(u), error / u))
    return rows


def test_medians_of_the_shipped_runs(forty):
    medians = defaultdict(list)
    for geometry, _, after, _, _ in forty:
        medians[geometry].append(after)
    assert len(forty) == 40
    for geometry, specified in SPECIFIED.items():
        assert np.median(medians[geometry]) < 1.05 * specified


def test_hardly_a_run_gets_worse(forty):
    assert sum(after > before for _, before, after, _, _ in forty) <= 2


def test_no_run_beyond_twice_its_own_uncertainty(forty):
    assert all(after < 2.0 * u for _, _, after, u, _ in forty)


def test_uncertainty_has_the_size_of_the_error_though_the_published_noise_is_twice_that_of_the_runs(forty):
    ratio = np.concatenate([row[4] for row in forty])
    # errors of one run are common to it: the mean square of 40 runs is good to about 20 per cent
    assert 0.6 < np.mean(np.square(ratio)) < 1.2
    # one station in twenty is beyond
    assert 0.01 < (np.abs(ratio) > 2.0).mean() < 0.08


def test_with_the_noise_stated_the_fit_is_as_good_as_it_says():
    """Chi-square of the forty fits together; the interference is beyond its prior in none of them."""
    found = []
    for run in shipped():
        known = stations(run.stations.g, run.stations.b)
        found.append(multistation(known, run.reference, published_priors(axial_sigma=600.0)))
    total, freedom = sum(f.chi_square for f in found), sum(f.freedom for f in found)
    assert chi_square_limit(0.001, freedom) < total < chi_square_limit(0.999, freedom)


def drawn(rng, priors, **geometry):
    """A run whose errors are drawn from the priors, the reference's and the noise; parameters and truth beside it."""
    azimuth, g, b = hole(**geometry)
    x = rng.normal(size=15) * np.sqrt(priors.covariance.diagonal())
    shift = rng.normal(size=3) * REFERENCE.sigmas
    # the reference given is the truth less its correction
    given = replace(REFERENCE, g=G - shift[0], b=B - shift[1], dip=DIP - shift[2])
    true = np.hstack([G * g, B * b])
    matrix = np.eye(6) + np.tensordot(x, priors.gain, axes=1)
    readings = true @ matrix.T + x @ priors.offset + rng.normal(size=true.shape) * NOISE
    return azimuth, stations(readings[:, :3], readings[:, 3:]), given, np.concatenate([x, shift])


@pytest.mark.long
@pytest.mark.parametrize(
    "geometry",
    [
        {},
        {"azimuth_deg": (85.0, 95.0), "inclination_deg": (88.0, 92.0)},
        {"azimuth_deg": (5.0, 3.0), "inclination_deg": (88.0, 90.0), "count": 8},
        {"count": 4, "toolface_deg": (0.0, 300.0)},
    ],
    ids=["build", "east-west", "north-south", "four stations"],
)
def test_covariance_is_honest(geometry):
    """Normalised squared error of all 18 parameters and azimuth errors over u, for runs drawn from the priors."""
    rng, priors, runs = np.random.default_rng(12), published_priors(axial_sigma=400.0), 150
    squared, ratios = 0.0, []
    for _ in range(runs):
        azimuth, readings, reference, truth = drawn(rng, priors, **geometry)
        found = multistation(readings, reference, priors)
        error = np.array([p.value for p in found.parameters.values()]) - truth
        squared += error @ np.linalg.solve(found.covariance, error)
        ratios.append(azimuth_error(found.corrected, azimuth) / azimuth_u(found.corrected))
    # one chance in a thousand on either side
    assert chi_square_limit(0.001, 18 * runs) < squared < chi_square_limit(0.999, 18 * runs)
    # azimuths of one run share their error: the mean square of 150 runs is good to about 12 per cent
    assert np.mean(np.square(ratios)) == pytest.approx(1.0, abs=0.3)
