"""A certificate becomes an ellipse: the covariance of positions is that of tools drawn from the certificate."""

from dataclasses import replace

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.earth.site import Site
from inclinometry.files.tool_code_json import load_tool_code
from inclinometry.orientation import fields
from inclinometry.position.certificate import (
    calibration_sources,
    error_model,
    is_sensor_term,
    reference_sources,
    with_terms,
)
from inclinometry.position.propagation import Run, propagate, propagate_runs
from inclinometry.position.well import well_survey
from inclinometry.sensors import Tool, Triad, parameter_vector, triad_from_vector
from inclinometry.survey.from_tool import stations_from_tool
from inclinometry.survey.path import minimum_curvature
from inclinometry.survey.reduce import reduce_survey

KINDS = ("accelerometer", "magnetometer")
STRENGTH = {"accelerometer": 9.8, "magnetometer": 52_000.0}
SITE = Site(
    g=9.81,
    b=50_000.0,
    dip=np.radians(70.0),
    declination=np.radians(8.0),
    declination_sigma=np.radians(0.3),
    convergence=np.radians(-2.0),
)


def calibrated(degree=0, spread=1.0, noise=0.0):
    """A tool of skewed sensors with a full covariance: some 0.3 mg and 15 nT, 3e-4 of scale and axes."""
    rng = np.random.default_rng(20)
    triads, sizes = {}, []
    for kind, counts in zip(KINDS, (1000.0, 2000.0), strict=True):
        tensor = np.stack([counts * (np.eye(3) + 0.02 * rng.normal(size=(3, 3))) * 1e-4**p for p in range(degree + 1)])
        offset = np.stack([rng.normal(size=3) * 10.0 * 1e-3**p for p in range(degree + 1)])
        triads[kind] = Triad(kind, tensor, offset, "counts", STRENGTH[kind])
        sizes += [counts * 3e-4 * 2e-2**p for p in range(degree + 1) for _ in range(12)]
    mixing = np.linalg.qr(rng.normal(size=(len(sizes), len(sizes))))[0]
    correlated = mixing @ np.diag(np.linspace(0.2, 1.0, len(sizes))) @ mixing.T
    sd = {"accelerometer": np.full(3, 1000.0 * noise), "magnetometer": np.full(3, 2000.0 * noise)}
    return Tool("17", triads, spread**2 * correlated * np.outer(sizes, sizes), sd, (0.0, 100.0))


def well(kind):
    """Depth, inclination, magnetic azimuth, toolface, degC: 0 to 60 deg with a turn, or held there from a tie-on."""
    md = np.arange(0.0, 1801.0, 30.0)
    build = np.clip((md - 450.0) / 900.0, 0.0, 1.0)
    inclination = np.radians(60.0) * build
    azimuth = np.radians(40.0 + 70.0 * build)
    if kind == "held":
        inclination, azimuth = np.full(len(md), np.radians(60.0)), np.radians(100.0 + md / 100.0)
    # the assembly turns as it drills
    toolface = np.random.default_rng(5).uniform(0.0, 2.0 * np.pi, len(md))
    return md, inclination, azimuth, toolface, 20.0 + md * 0.03


def readings(tool, change, path, rng=None):
    """Signals of the tool whose parameters are off the certificate's by `change`, by the dumb way: the formula."""
    _, inclination, azimuth, toolface, heat = path
    seen = fields(azimuth, inclination, toolface, SITE.dip)
    signals = {}
    for kind, direction, local in zip(KINDS, seen, (SITE.g, SITE.b), strict=True):
        vector = parameter_vector(tool.triads[kind]) + change[tool.slices[kind]]
        true = triad_from_vector(tool.triads[kind], vector)
        signals[kind] = true.signals(direction * local / STRENGTH[kind], heat)
        if rng is not None:
            signals[kind] = signals[kind] + rng.normal(size=signals[kind].shape) * tool.noise[kind]
    return signals


def positions(tool, change, path, rng=None):
    """North, east, down from true north of what the certificate makes of those signals; the first attitude is known."""
    found = reduce_survey(path[0], readings(tool, change, path, rng), tool, temperature=path[4])
    inclination, azimuth = np.array(found.inclination), np.array(found.azimuth)
    inclination[0], azimuth[0] = path[1][0], path[2][0]
    way = minimum_curvature(path[0], inclination, azimuth + SITE.declination)
    return np.stack([way.north, way.east, way.tvd], axis=1)


def certificate(tool, path, **more):
    """Sources and survey of the well, from raw channels without error."""
    stations = stations_from_tool(
        path[0], readings(tool, np.zeros(len(tool.covariance)), path), tool, temperature=path[4]
    )
    survey = well_survey(path[0], path[1], path[2], SITE, "magnetic")
    return survey, calibration_sources(stations, survey, **more)


@pytest.mark.parametrize("degree", [0, 1])
@pytest.mark.parametrize("kind", ["built", "held"])
def test_each_tool_ends_where_the_certificate_says(kind, degree):
    tool, path = calibrated(degree), well(kind)
    straight = positions(tool, np.zeros(len(tool.covariance)), path)
    root = np.linalg.cholesky(tool.covariance)
    for seed in range(5):
        change = 0.1 * root @ np.random.default_rng(seed).normal(size=len(root))
        # a certificate that knows of this one change alone
        survey, sources = certificate(replace(tool, covariance=np.outer(change, change)), path)
        vector = propagate(survey, sources=sources).sources["calibration"].vectors[0, -1]
        away = (positions(tool, change, path) - straight)[-1]
        vector = vector * np.sign(vector @ away)
        # balanced tangents for arcs, and the second order, are some 1e-4 of each course; the turning assembly cancels
        # most of what the courses add up to
        np.testing.assert_allclose(vector, away, atol=3e-3 * np.linalg.norm(away))


@pytest.mark.long
@pytest.mark.parametrize("kind", ["built", "held"])
def test_covariance_of_drawn_tools(kind):
    count = 400
    tool, path = calibrated(), well(kind)
    # draws whose own covariance is exactly the certificate's, so that only the propagation is judged
    z = np.random.default_rng(11).normal(size=(count, 24))
    z -= z.mean(axis=0)
    z = z @ np.linalg.inv(np.linalg.cholesky(z.T @ z / (count - 1))).T
    changes = z @ np.linalg.cholesky(tool.covariance).T
    ends = np.array([positions(tool, change, path)[-1] for change in changes])
    survey, sources = certificate(tool, path)
    values, axes = np.linalg.eigh(propagate(survey, sources=sources).covariance[-1])
    found = np.einsum("ik,ij,jk->k", axes, np.cov(ends.T), axes)
    # second order: azimuths off by half a degree
    np.testing.assert_allclose(np.sqrt(found), np.sqrt(values), rtol=0.01)


@pytest.mark.long
def test_noise_of_readings_is_random():
    tool, path = replace(calibrated(noise=2e-4), covariance=np.zeros((24, 24))), well("built")
    rng, nothing = np.random.default_rng(12), np.zeros(24)
    ends = np.array([positions(tool, nothing, path, rng)[-1] for _ in range(1500)])
    survey, sources = certificate(tool, path)
    assert [(one.name, one.propagation) for one in sources] == [("sensor noise", "random")]
    values, axes = np.linalg.eigh(propagate(survey, sources=sources).covariance[-1])
    found = np.einsum("ik,ij,jk->k", axes, np.cov(ends.T), axes)
    # a standard deviation of 1500 draws is known to 1.8 %
    np.testing.assert_allclose(np.sqrt(found), np.sqrt(values), rtol=0.07)


@pytest.mark.parametrize("inclination_deg", [0.0, 1e-7, 0.5, 0.9999, 1.0001, 179.5, 180.0])
def test_a_vertical_tool_has_a_direction(inclination_deg):
    """An error across the tool tilts the hole by as much, whichever way the tool is turned, and never by infinity."""
    md, slope = np.arange(0.0, 301.0, 30.0), np.full(11, np.radians(inclination_deg))
    path = (md, slope, np.full(11, 1.0), np.full(11, 2.0), np.full(11, 20.0))
    tool, change = calibrated(), np.zeros(24)
    change[[3, 7]] = 0.3, -0.2  # offsets of two accelerometers, counts of 1000 to the g
    survey, sources = certificate(replace(tool, covariance=np.outer(change, change)), path)
    vector = propagate(survey, sources=sources).sources["calibration"].vectors[0, -1]
    away = (positions(tool, change, path) - positions(tool, np.zeros(24), path))[-1]
    assert np.linalg.norm(away) > 0.05
    # second order in the tilt of 0.02 deg: 1e-4 of the lever in the vertical
    np.testing.assert_allclose(vector * np.sign(vector @ away), away, atol=1e-3 * np.linalg.norm(away))


def test_angles_and_direction_say_the_same():
    """At the border between the two forms nothing jumps."""
    md = np.arange(0.0, 301.0, 30.0)
    found = []
    for inclination in np.radians([0.9999, 1.0001]):
        path = (md, np.full(11, inclination), np.full(11, 1.0), np.linspace(0.0, 6.0, 11), np.full(11, 20.0))
        survey, sources = certificate(calibrated(), path)
        found.append(propagate(survey, sources=sources).covariance[-1])
    np.testing.assert_allclose(found[0], found[1], rtol=1e-4, atol=1e-4 * np.abs(found[0]).max())


def test_a_certificate_without_raw_channels():
    tool, path = calibrated(1, noise=1e-4), well("built")
    survey, sources = certificate(tool, path)
    computed = error_model(tool, survey, path[3], temperature=path[4])
    one, other = (propagate(survey, sources=s).covariance for s in (sources, computed))
    np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(one).max())
    # strengths that the calibration doesn't know are the site's
    blind = {kind: replace(triad, field_strength=None) for kind, triad in tool.triads.items()}
    ratio = propagate(survey, sources=error_model(replace(tool, triads=blind), survey, path[3], temperature=path[4]))
    np.testing.assert_allclose(np.sqrt(np.diagonal(ratio.covariance[-1]) / np.diagonal(one[-1])), 1.0, atol=0.05)
    with refused("input-missing", names=("dip_deg",)):
        error_model(tool, replace(survey, site=replace(SITE, dip=None)), path[3])
    with refused("input-shape", name="toolface"):
        error_model(tool, survey, [0.0, 1.0, 2.0], temperature=path[4])
    with refused("input-temperature"):
        error_model(tool, survey, path[3])


def test_stations_may_be_part_of_the_well():
    tool, path = calibrated(), well("built")
    survey, whole = certificate(tool, path)
    parts = []
    for rows in (slice(1, 30), slice(30, None)):
        piece = tuple(column[rows] for column in path)
        stations = stations_from_tool(piece[0], readings(tool, np.zeros(24), piece), tool)
        parts.append(calibration_sources(stations, survey, propagation="well"))
    last = len(survey) - 1
    found = propagate_runs(survey, [Run(0, 29, None, parts[0]), Run(30, last, None, parts[1])])
    # the same tool in both runs: one error, as if it had surveyed all of the well
    np.testing.assert_allclose(found.covariance, propagate(survey, sources=whole).covariance, rtol=1e-9, atol=1e-12)


class TestWrongInput:
    def test_depths_of_another_well(self):
        tool, path = calibrated(), well("built")
        stations = stations_from_tool(path[0], readings(tool, np.zeros(24), path), tool)
        moved = np.array(path[0])
        moved[20] += 1.0
        with refused("position-depths"):
            calibration_sources(stations, well_survey(moved, path[1], path[2], SITE, "magnetic"))
        with refused("position-depths"):
            calibration_sources(stations, well_survey(path[0][:40], path[1][:40], path[2][:40], SITE, "magnetic"))

    def test_an_azimuth_of_another_north(self):
        tool, path = calibrated(), well("built")
        stations = stations_from_tool(path[0], readings(tool, np.zeros(24), path), tool)
        with refused("position-direction"):
            calibration_sources(stations, well_survey(*path[:3], SITE, "true"))
        with refused("input-missing", names=("declination_deg",)):
            calibration_sources(stations, well_survey(*path[:3], Site(), "true"))

    def test_nothing_stated(self):
        tool, path = replace(calibrated(), covariance=np.zeros((24, 24))), well("built")
        with refused("position-certificate"):
            certificate(tool, path)

    def test_no_magnetometer(self):
        tool, path = calibrated(), well("built")
        survey = well_survey(*path[:3], SITE, "magnetic")
        alone = Tool("a", {"accelerometer": tool.triads["accelerometer"]})
        with refused("input-uncalibrated"):
            error_model(alone, survey, path[3])

    def test_what_shares_the_errors(self):
        with refused("input-choice", name="propagation"):
            certificate(calibrated(), well("built"), propagation="random")


class TestBesideTheCertificate:
    def test_terms_of_a_tool_code(self):
        code = load_tool_code("iscwsa-mwd-rev5.1")
        beside = with_terms(code, ["DRFR", "DSFS", "DSTG", "SAGE", "XYM1", "XYM2", "XYM3E"], {"DRFR": 0.2})
        survey, sources = certificate(calibrated(), well("built"))
        both = propagate(survey, beside, (*sources, *reference_sources(survey)))
        alone = propagate(survey, sources=sources, surface_attitude=True)
        named = ["DRFR", "DSFS", "DSTG", "SAGE", "XYM1", "XYM2", "XYM3E", "calibration", "declination"]
        assert sorted(both.sources) == sorted(named)
        np.testing.assert_allclose(both.sources["calibration"].covariance, alone.covariance)
        np.testing.assert_allclose(both.sources["DRFR"].covariance[0, 2, 2], 0.2**2, rtol=1e-12)
        assert both.sources["declination"].propagation == "global"

    def test_declination_moves_the_end_across(self):
        survey, _ = certificate(calibrated(), well("held"))
        found = propagate(survey, sources=reference_sources(survey)).covariance[-1]
        path = minimum_curvature(survey.md, survey.inclination, survey.azimuth)
        # all but the half course of the wellhead turns
        expected = SITE.declination_sigma * np.hypot(path.north[-1], path.east[-1])
        np.testing.assert_allclose(np.sqrt(np.trace(found)), expected, rtol=0.01)
        silent = replace(survey, site=replace(SITE, declination_sigma=None))
        assert reference_sources(silent) == ()

    def test_terms_of_the_sensors_are_the_certificates(self):
        code = load_tool_code("iscwsa-mwd-rev5.1")
        assert sum(is_sensor_term(one.name) for one in code.terms) == 14
        with refused("input-not-with", name="ABZ"):
            with_terms(code, ["DRFR", "ABZ"])
        with refused("input-choice", name="iscwsa-mwd-rev5.1.term"):
            with_terms(code, ["SAG"])
        with refused("input-needs", name="magnitudes"):
            with_terms(code, ["DRFR"], {"DSFS": 1e-4})
        with refused("input-value", name="DRFR"):
            with_terms(code, ["DRFR"], {"DRFR": -1.0})
