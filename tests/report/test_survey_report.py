"""The survey report."""

from dataclasses import replace

import numpy as np
import pytest

from inclinometry.earth.site import Site
from inclinometry.findings import Finding
from inclinometry.orientation import fields
from inclinometry.report.survey import survey_report
from inclinometry.report.survey_figures import thinned
from inclinometry.sensors import Tool, Triad
from inclinometry.survey.reduce import reduce_survey

from .pages import check

KINDS = ("accelerometer", "magnetometer")
SITE = Site(
    north_reference="true", declination=0.05, declination_sigma=0.002, g=9.81, g_sigma=0.003, b=50_000.0, dip=1.2
)


def survey(size, site=None, kinds=KINDS, turns=1):
    md = np.linspace(0.0, 3000.0, size)
    g, b = fields(np.linspace(6.0, 7.0, size), np.linspace(0.0, 1.6, size), np.linspace(0.0, 7.0 * turns, size), 1.2)
    strength = {"accelerometer": 9.81, "magnetometer": 50_000.0}
    triads = {k: Triad(k, np.eye(3), np.zeros(3), field_strength=strength[k]) for k in kinds}
    tool = Tool("A7", triads, 1e-8 * np.eye(12 * len(kinds)), dict.fromkeys(kinds, 1e-4))
    signals = {"accelerometer": g, "magnetometer": b * np.where(np.arange(size) == size // 2, 1.05, 1.0)[:, None]}
    return reduce_survey(md, {k: signals[k] for k in kinds}, tool, site=site, inputs={"raw": "sha256:2"})


@pytest.mark.long
@pytest.mark.parametrize("size", [1, 60, 4000])
def test_page(size):
    found = survey(size, SITE, turns=size)
    page = check(survey_report(found, site=SITE))
    assert f"{size} station" in page.text
    assert "true north" in page.text
    assert "+2.865°" in page.text  # 0.05 rad of declination
    assert page.tags.count("svg") == 7  # three angles, three fields, the norths
    assert survey_report(found, site=SITE) == survey_report(found, site=SITE)


@pytest.mark.long
def test_flags_are_explained():
    words = check(survey_report(survey(60, SITE), site=SITE)).text
    assert "the magnetic field differs from its reference by more than its tolerance" in words
    assert "azimuth and toolface are hardly defined" in words


def test_without_a_second_field():
    found = survey(30, kinds=("accelerometer",))
    page = check(survey_report(found))
    assert "azimuth within" not in page.text
    assert "inclination within" in page.text
    assert page.tags.count("svg") == 3  # two angles, gravity


def test_unknown_uncertainty_and_no_flags():
    found = survey(20)
    nothing = {name: np.zeros((20, 4)) for name in found.components}
    clean = replace(found, components=nothing, flags=[[]] * 20, findings=())
    words = check(survey_report(clean)).text
    assert "states no uncertainty" in words
    assert "No flags" in words


def test_hostile_names():
    evil = "</style><script>alert(1)</script>"
    found = replace(
        survey(5),
        tool=evil,
        flags=[[evil]] * 5,
        findings=(Finding("record-text", {"text": evil}),),
        inputs={evil: evil},
    )
    assert check(survey_report(found)).text.count(evil) >= 8


def test_thinning_keeps_both_ends():
    rows = thinned(100_000)
    assert rows[0] == 0
    assert rows[-1] == 99_999
    assert list(thinned(0)) in ([], [0])
