"""Axial correction: against the published sensitivities, a brute search, differences and draws."""

from dataclasses import replace

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.findings import example
from inclinometry.orientation import angles, angles_jacobian, fields
from inclinometry.survey.axial import SINGULAR, SOURCE, axial_correction
from inclinometry.survey.multistation_priors import FieldReference
from inclinometry.survey.stations import Source, Stations

G, B, DIP = 9.81, 50_000.0, np.radians(70.0)


def reference(b=B, dip=DIP, **more):
    given = {"g_sigma": 0.001, "b_sigma": 130.0, "dip_sigma": np.radians(0.2), **more}
    return FieldReference(g=G, b=b, dip=dip, **given)


def stations(azimuth_deg, inclination_deg, toolface_deg=40.0, axial=0.0, dip=DIP, **more):
    azimuth, inclination, toolface = (
        np.atleast_1d(np.radians(a)) for a in (azimuth_deg, inclination_deg, toolface_deg)
    )
    g, b = fields(azimuth, inclination, toolface, dip)
    return Stations(np.arange(len(g)) * 30.0, G * g, B * b + np.array([0.0, 0.0, axial]), **more)


def everywhere(count=200, seed=3, noise_nt=100.0):
    """Stations in all directions, every inclination."""
    random = np.random.default_rng(seed)
    tilt = np.degrees(np.arccos(random.uniform(-1.0, 1.0, count)))
    run = stations(random.uniform(0, 360, count), tilt, random.uniform(0, 360, count))
    return Stations(run.md, run.g, run.b + random.normal(0.0, noise_nt, run.b.shape))


# ISCWSA terms MFI and MDI, evaluated at B 50,000 nT, dip 70 deg: inclination, magnetic azimuth (deg), deg per 100 nT,
# deg per deg of dip
PUBLISHED = (
    (30, 60, -0.16057728674298288, -0.09547919360433599),
    (60, 45, -0.22299328900525642, 1.1585885031161367),
    (60, 120, -0.18479873117877113, -2.89661592134727),
    (75, 30, -0.11170627641632659, 1.2846461113789465),
    (85, 200, -0.030772300091928117, 1.0250019162937973),
    (45, 300, 0.2578216519548184, -0.2589337736011756),
)


@pytest.mark.parametrize(("inclination", "azimuth", "by_b", "by_dip"), PUBLISHED)
def test_sensitivities_are_the_iscwsa_terms(inclination, azimuth, by_b, by_dip):
    found = axial_correction(stations(azimuth, inclination, axial=321.0), reference())
    # closed forms of the same quantity: rounding only
    assert np.degrees(found.azimuth_by_b[0]) * 100.0 == pytest.approx(by_b, rel=1e-12)
    assert found.azimuth_by_dip[0] == pytest.approx(by_dip, rel=1e-12)


def test_sensitivities_are_what_a_wrong_reference_does():
    run = stations([60.0, 200.0, 300.0], [30.0, 85.0, 45.0], axial=-400.0)
    found = axial_correction(run, reference())
    for change, stated, step in (
        ({"b": B + 1.0}, found.azimuth_by_b, 1.0),
        ({"dip": DIP + 1e-5}, found.azimuth_by_dip, 1e-5),
    ):
        moved = axial_correction(run, reference(**change)).stations
        done = angles(moved.g, moved.b).azimuth - angles(found.stations.g, found.stations.b).azimuth
        # one-sided difference: second order over first, 1 nT of 50,000
        np.testing.assert_allclose(done / step, stated, rtol=2e-3)


@pytest.mark.parametrize("axial", [-2000.0, 0.0, 600.0])
def test_interference_of_perfect_sensors_is_found_exactly(axial):
    run = stations([10.0, 45.0, 200.0, 330.0, 90.0], [5.0, 60.0, 85.0, 95.0, 20.0], axial=axial)
    found = axial_correction(run, reference())
    assert not found.singular.any()
    np.testing.assert_allclose(found.interference, axial, atol=1e-6)  # nT of 50,000: rounding
    np.testing.assert_allclose(found.misfit, 0.0, atol=1e-6)
    np.testing.assert_allclose(np.degrees(angles(run.g, found.stations.b).azimuth), [10, 45, 200, 330, 90], atol=1e-9)
    assert found.check.verdict == "pass"


@pytest.mark.parametrize("dip_deg", [-75.0, 0.0, 35.0, 70.0])
def test_the_minimum_is_the_one_a_fine_search_finds(dip_deg):
    run, site = everywhere(60), reference(dip=np.radians(dip_deg))
    found = axial_correction(run, site)
    z = np.linspace(-70e3, 70e3, 28_001)  # 5 nT apart
    down = run.g / np.linalg.norm(run.g, axis=1, keepdims=True)
    horizontal, vertical = B * np.cos(site.dip), B * np.sin(site.dip)
    for row, (d, b) in enumerate(zip(down, run.b, strict=True)):
        v = b[0] * d[0] + b[1] * d[1] + z * d[2]
        h = np.sqrt(np.maximum(b[0] ** 2 + b[1] ** 2 + z**2 - v**2, 0.0))
        cost = (h - horizontal) ** 2 + (v - vertical) ** 2
        minima = z[1:-1][(cost[1:-1] < cost[:-2]) & (cost[1:-1] <= cost[2:])]
        nearest = minima[np.argmin(np.abs(minima - b[2]))]
        assert b[2] - found.interference[row] == pytest.approx(nearest, abs=5.0)  # the grid


@pytest.mark.parametrize("dip_deg", [0.0, 70.0])
def test_the_minimum_nearest_to_any_axial_field_is_taken(dip_deg):
    """A wrong one is thousands of nT away; the search goes in steps of 100 nT, and a shallow minimum lies between."""
    run, site = everywhere(800, seed=5), reference(dip=np.radians(dip_deg))
    run = replace(run, b=np.column_stack([run.b[:, :2], np.random.default_rng(5).uniform(-6e4, 6e4, len(run.b))]))
    found = run.b[:, 2] - axial_correction(run, site).interference
    z = np.arange(-75e3, 75e3, 100.0)
    d = run.g / np.linalg.norm(run.g, axis=1, keepdims=True)
    v = np.sum(run.b[:, :2] * d[:, :2], axis=1)[:, None] + z * d[:, 2:]
    h = np.sqrt(np.maximum(np.sum(run.b[:, :2] ** 2, axis=1)[:, None] + z**2 - v**2, 0.0))
    cost = (h - B * np.cos(site.dip)) ** 2 + (v - B * np.sin(site.dip)) ** 2
    low = (cost[:, 1:-1] < cost[:, :-2]) & (cost[:, 1:-1] <= cost[:, 2:])
    away = np.where(low, np.abs(z[1:-1] - run.b[:, 2:]), np.inf)
    nearest = z[1:-1][np.argmin(away, axis=1)]
    beside = np.sort(away, axis=1)
    clear = beside[:, 1] - beside[:, 0] > 400.0
    assert np.mean(clear) > 0.95
    np.testing.assert_allclose(found[clear], nearest[clear], atol=100.0)


def test_derivatives_by_the_channels_are_those_of_differences():
    run, site = everywhere(), reference()
    given = axial_correction(run, site)
    good = given.observability > 0.12  # nearer to singular the differences themselves are poor
    eye = np.tile(np.eye(6), (len(run), 1, 1))
    noisy = Stations(run.md, run.g, run.b, noise=eye, sources={"all": Source(eye, np.eye(6))})
    by_field = axial_correction(noisy, site).stations.sources["all"].by_field[:, 5]
    for channel in range(6):
        step = np.zeros(6)
        step[channel] = 1e-5 if channel < 3 else 1.0
        ends = [
            run.b[:, 2]
            - axial_correction(Stations(run.md, run.g + s * step[:3], run.b + s * step[3:]), site).interference
            for s in (1.0, -1.0)
        ]
        # axial_correction measures interference from the moved reading: only channels other than bz can be differenced
        if channel < 5:
            slope = (ends[0] - ends[1]) / (2.0 * step[channel])
            np.testing.assert_allclose(by_field[good, channel], slope[good], rtol=1e-5, atol=1e-4)
    assert (by_field[~given.singular, 5] == 0.0).all()  # the measured axial field no longer matters


@pytest.mark.long
def test_the_stated_covariance_is_what_draws_give():
    count, random = 1000, np.random.default_rng(5)
    noise = np.diag([0.002] * 3 + [50.0] * 3) ** 2
    azimuth, inclination = 35.0, 55.0
    true = stations(azimuth, inclination)
    errors = random.multivariate_normal(np.zeros(6), noise, count)
    b, dip = random.normal(B, 130.0, count), random.normal(DIP, np.radians(0.2), count)
    drawn = []
    for error, b_ref, dip_ref in zip(errors, b, dip, strict=True):
        run = Stations([0.0], true.g + error[:3], true.b + error[3:] + [0.0, 0.0, 700.0])
        done = axial_correction(run, reference(b=b_ref, dip=dip_ref)).stations
        drawn.append(angles(done.g, done.b).azimuth[0])
    run = Stations([0.0], true.g, true.b + [0.0, 0.0, 700.0], noise=noise[None])
    done = axial_correction(run, reference()).stations
    row = angles_jacobian(done.g, done.b)[:, 1]
    stated = float(np.sqrt(row @ done.field_covariance()[0] @ row.T)[0, 0])
    # standard deviation of 1000 draws: 2.2 % (one sigma); three of them
    assert np.std(drawn) == pytest.approx(stated, rel=0.07)


def test_disturbances_of_the_field_become_noise_of_each_station():
    quiet = axial_correction(stations([35.0], 55.0), reference()).stations
    stormy = axial_correction(stations([35.0], 55.0), reference(b_random=60.0, dip_random=0.0014)).stations
    shared = quiet.sources[SOURCE]
    by_reference = shared.by_field[0]
    expected = by_reference @ np.diag([60.0**2, 0.0014**2]) @ by_reference.T
    np.testing.assert_allclose(stormy.noise[0] - quiet.noise[0], expected, rtol=1e-12)


def test_vertical_station_takes_the_vertical_reference():
    g, b = fields([0.3, 1.1], [0.0, 1e-7], [0.2, 0.9], DIP)
    run = Stations([0.0, 10.0], G * g, B * b + [0.0, 0.0, 500.0], noise=np.tile(np.eye(6), (2, 1, 1)))
    found = axial_correction(run, reference())
    np.testing.assert_allclose(found.interference, 500.0, atol=1e-6)
    np.testing.assert_allclose(found.stations.b[:, 2], B * np.sin(DIP), rtol=1e-6)
    # exactly vertical and nearly so, the tilt of gravity along the field moves it alike
    spread = found.stations.noise[:, 5, 5]
    assert spread[0] == pytest.approx(spread[1], rel=1e-4)


def test_near_horizontal_east_west_is_reported_and_left_alone():
    run = stations([90.0, 88.0, 62.0, 30.0], [90.0, 85.0, 88.0, 80.0], axial=300.0)
    found = axial_correction(run, reference())
    assert found.singular.tolist() == [True, True, False, False]
    assert found.weak.tolist() == [False, False, True, False]
    np.testing.assert_array_equal(found.stations.b[:2], run.b[:2])
    assert (found.check.verdict, found.check.stations) == ("not judged", (0, 1))
    assert found.check.value < SINGULAR
    assert found.check.reason.code == "survey-axial-singular"
    assert found.stations.history[-1].rows == (0, 1)
    left = found.stations.sources["axial interference"]
    assert left.by_field[:, 5, 0].tolist() == [1.0, 1.0, 0.0, 0.0]
    assert left.covariance[0, 0] == 220.0**2


STEP = example("survey-step")


def test_one_line_of_history_and_the_rest_untouched():
    run = stations([35.0, 40.0], 55.0, axial=100.0, temperature=np.array([20.0, 30.0]), history=(STEP,))
    done = axial_correction(run, reference()).stations
    assert done.history[0] == STEP
    assert [one.values["low_nT"] for one in done.history[1:]] == [pytest.approx(100.0)]
    np.testing.assert_array_equal(done.g, run.g)
    np.testing.assert_array_equal(done.b[:, :2], run.b[:, :2])
    assert (done.temperature == run.temperature).all()


def test_not_twice():
    done = axial_correction(stations([35.0], 55.0), reference()).stations
    with refused("survey-corrected"):
        axial_correction(done, reference())
