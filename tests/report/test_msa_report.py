"""The page of a multi-station analysis: complete, self-contained, and it says what the run could not tell."""

from __future__ import annotations

import numpy as np
import pytest

from inclinometry.findings import example
from inclinometry.orientation import fields
from inclinometry.report.msa import azimuth_u, msa_report
from inclinometry.survey.multistation import multistation
from inclinometry.survey.multistation_priors import FieldReference, published_priors
from inclinometry.survey.quality import judge_fields, with_sensors
from inclinometry.survey.stations import Stations

from .pages import check

REFERENCE = FieldReference(g=9.81, b=5e4, dip=1.2, g_sigma=0.001, b_sigma=130.0, dip_sigma=0.0035)
SENSORS = {"ABX": 0.004, "ABY": 0.004, "ABZ": 0.004, "MBX": 70.0, "MBY": 70.0, "MBZ": 70.0}


def run(size=20, azimuth=(0.5, 2.5), shift=(0.0, 0.0, 500.0), toolface=40.0):
    """Stations of a build with a bias of the magnetometers."""
    ends = [np.linspace(*pair, size) for pair in (azimuth, (0.2, 1.4), (0.0, toolface))]
    g, b = fields(*ends, 1.2)
    noise = np.random.default_rng(1).normal(size=(size, 6)) * np.repeat([0.001, 20.0], 3)
    plain = Stations(30.0 * np.arange(size), 9.81 * g + noise[:, :3], 5e4 * b + noise[:, 3:] + shift)
    return with_sensors(plain, SENSORS)


def page_of(stations, **more):
    found = multistation(stations, REFERENCE, published_priors())
    quality = judge_fields(stations, REFERENCE)
    text = msa_report(found, stations, quality, **more)
    assert text == msa_report(found, stations, quality, **more)
    return check(text)


@pytest.mark.long
def test_page():
    page = page_of(run(), tool="A7 <b>", findings=[example("survey-declination-sd")], inputs={"raw": "sha256:7"})
    for words in (
        "Axial magnetometer zero (interference included) ",
        "A7 <b>",
        "[survey-declination-sd]",
        "sha256:7",
        "What the geometry cannot tell",
        "The declination does not show",
        "MXY",
        "no independent proof",
    ):
        assert words in page.text
    # three fields, the distance, azimuth, influence, estimates, correlation
    assert page.tags.count("svg") == 8


@pytest.mark.long
def test_nothing_found_and_little_told():
    page = page_of(run(size=5, azimuth=(0.5, 0.52), shift=(0.0, 0.0, 0.0)))
    assert "No sensor error stands out" in page.text
    assert "less than 20 % of the prior variance" in page.text


@pytest.mark.long
def test_warnings_are_shown():
    page = page_of(run(shift=(900.0, 0.0, 0.0)), findings=[example("survey-sign")])
    assert "[survey-sign]" in page.text
    assert "[survey-prior]" in page.text
    assert "Read the warnings" in page.text


@pytest.mark.long
def test_a_vertical_run_promises_no_azimuth():
    toolface = np.radians([0.0, 70.0, 140.0, 210.0, 280.0])
    g, b = fields(0.0, 0.0, toolface, 1.2)
    steep = with_sensors(Stations(30.0 * np.arange(5), 9.81 * g, 5e4 * b), SENSORS)
    page = page_of(steep)
    assert "No station is inclined enough for an azimuth" in page.text
    assert "Change of azimuth" not in page.text
    assert azimuth_u(steep).max() < 1.9  # uniform over the circle: pi / sqrt 3


def test_uncertainty_of_azimuth_is_that_of_one_bias():
    g, b = fields([0.0], [np.pi / 2], [0.0], 0.0)
    level = with_sensors(Stations([0.0], 9.81 * g, 5e4 * b), {"MBY": 50.0})
    # pointing north, y is east: 50 nT across 50,000 nT
    np.testing.assert_allclose(azimuth_u(level), [1e-3], rtol=1e-9)
