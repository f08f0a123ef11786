"""What stations share is told from what is their own, and both keep the correlation of inclination with azimuth."""

from dataclasses import replace

import numpy as np

from inclinometry.constants import VECTORS
from inclinometry.earth.site import Site
from inclinometry.orientation import fields
from inclinometry.sensors import Tool, Triad
from inclinometry.stability import add_stability
from inclinometry.survey.from_stations import survey_from_stations
from inclinometry.survey.from_tool import stations_from_tool
from inclinometry.survey.reduce import parts_of, reduce_survey

MD = 30.0 * np.arange(200.0)
SITE = Site(declination=0.1, declination_sigma=0.005, north_reference="true", b=5e4, g=9.81, dip=1.2)


def tool():
    triads = {k: Triad(k, np.eye(3), np.zeros(3), field_strength=s) for k, s in zip(VECTORS, (9.81, 5e4), strict=True)}
    noise = {"accelerometer": np.full(3, 3e-4), "magnetometer": np.full(3, 5e-4)}
    return Tool("1", triads, 1e-7 * np.eye(24), noise)


def seen(seed=1):
    rng = np.random.default_rng(seed)
    g, b = fields(0.7, 0.9, 0.3, 1.2)
    own = tool()
    return {
        kind: np.tile(field, (len(MD), 1)) + own.noise[kind] * rng.standard_normal((len(MD), 3))
        for kind, field in zip(VECTORS, (g, b), strict=True)
    }


def test_noise_scatters_as_the_random_part_says_and_correlated():
    found = reduce_survey(MD, seen(), tool(), site=SITE)
    scatter = np.cov(found.inclination, found.azimuth)
    stated = found.random.mean(axis=0)
    # a variance of 200 stations is known to 10 %
    np.testing.assert_allclose(np.diagonal(scatter), np.diagonal(stated), rtol=0.3)
    said = stated[0, 1] / np.sqrt(stated[0, 0] * stated[1, 1])
    assert abs(said) > 0.2
    np.testing.assert_allclose(scatter[0, 1], stated[0, 1], atol=0.25 * np.sqrt(stated[0, 0] * stated[1, 1]))


def test_the_parts_make_up_u_and_both_ways_agree():
    own = add_stability(tool(), 1.0)
    one = reduce_survey(MD, seen(), own, site=SITE)
    other = survey_from_stations(stations_from_tool(MD, seen(), own), site=SITE)
    for survey in (one, other):
        total = survey.common + survey.random
        np.testing.assert_allclose(np.sqrt(total[:, 0, 0]), survey.u_inclination)
        np.testing.assert_allclose(np.sqrt(total[:, 1, 1]), survey.u_azimuth)
    np.testing.assert_allclose(one.common, other.common, rtol=1e-9)
    np.testing.assert_allclose(one.random, other.random, rtol=1e-9)
    # the declination is shared
    assert (np.sqrt(one.common[:, 1, 1]) > 0.005).all()
    columns = parts_of(one.common, one.random)
    np.testing.assert_allclose(
        np.hypot(columns["u_azimuth_common_deg"], columns["u_azimuth_random_deg"]), np.degrees(one.u_azimuth)
    )
    assert list(columns) == [name for name in one.to_dict() if name in columns]


def test_angles_known_exactly_are_not_correlated():
    part = np.zeros((3, 2, 2))
    part[1, 0, 0], part[2] = 1e-6, 1e-6
    found = parts_of(part, 0.0 * part)
    np.testing.assert_allclose(found["correlation_common"], [0.0, 0.0, 1.0])
    assert not found["correlation_random"].any()


def test_a_mean_of_stations_averages_the_random_part_alone():
    rng, place = np.random.default_rng(3), Site(declination=0.1, north_reference="true")
    found, errors = reduce_survey(MD, seen(), tool(), site=place), []
    for _ in range(60):
        off = {
            kind: replace(
                one,
                tensor=one.tensor + 1e-7**0.5 * rng.standard_normal((1, 3, 3)),
                offset=one.offset + 1e-7**0.5 * rng.standard_normal((1, 3)),
            )
            for kind, one in tool().triads.items()
        }
        read = reduce_survey(MD[:1], {kind: one[:1] for kind, one in seen().items()}, replace(tool(), triads=off))
        errors.append(read.azimuth[0] + 0.1 - found.azimuth[0])
    spread, kept = np.std(errors), np.sqrt(found.common[0, 1, 1])
    # sixty draws know a standard deviation to 9 %
    assert 0.7 < spread / kept < 1.3
    independent = np.sqrt(np.mean(found.u_azimuth**2) / len(MD))
    assert spread > 5.0 * independent


def test_k_follows_the_freedom_of_what_was_estimated_and_its_share():
    found = reduce_survey(MD, seen(), tool())
    assert found.coverage_factor == 2.0
    few = replace(found, freedom={"calibration": 6.0, "sensor noise": 6.0})
    assert few.coverage_factor == 2.06  # Student's 95.45 % with matched variance: 2.517 sqrt(4 / 6), rounded up
    np.testing.assert_allclose(few.expanded("azimuth"), 2.06 * found.u("azimuth"), rtol=1e-12)
    # beside a declination ten times as uncertain the azimuth's is known, the inclination's as little as before
    beside = np.zeros((len(MD), 4))
    beside[:, 1] = 100.0 * sum(found.components.values())[:, 1]
    wide = replace(few, components={**found.components, "declination": beside})
    assert wide.coverage_factor == 2.06
    only = replace(wide, components={name: part[:, 1:2].repeat(4, axis=1) for name, part in wide.components.items()})
    assert only.coverage_factor == 2.0 or only.coverage_factor == 2.01  # rounded up
