"""The page of a well's position."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from inclinometry.earth.site import Site
from inclinometry.files.tool_code_json import load_tool_code
from inclinometry.findings import Finding
from inclinometry.position.propagation import propagate
from inclinometry.position.well import horizontal_ellipse, well_survey
from inclinometry.report import position as draw
from inclinometry.report.position import contributions, position_report
from inclinometry.survey.path import minimum_curvature

from .pages import check

SITE = Site(
    g=9.81, b=50_000.0, dip=np.radians(70.0), declination=np.radians(3.25), convergence=np.radians(-1.5), latitude=1.0
)
MD = np.arange(0.0, 1201.0, 30.0)
STATIONS = MD, np.interp(MD, [0, 300, 900, 1200], np.radians([0, 0, 60, 60])), np.full(len(MD), np.radians(40.0))


@pytest.fixture(scope="module")
def well():
    code = load_tool_code("iscwsa-mwd-rev5.1")
    survey = well_survey(*STATIONS, SITE, "magnetic", north="grid")
    path = minimum_curvature(MD, STATIONS[1], survey.result_azimuth)
    return path, survey, propagate(survey, code), code


@pytest.fixture(scope="module")
def text(well):
    path, survey, uncertainty, code = well
    return position_report(path, survey, uncertainty, azimuth_reference="magnetic", tool_code=code)


def without_scripts(text):
    """The page less its script, which loads nothing."""
    scripts = re.findall(r"(?s)<script([^>]*)>(.*?)</script>", text)
    assert [attributes for attributes, _ in scripts] == [' type="application/json" id="space-data"', ""]
    assert not re.search(r"\b(fetch|XMLHttpRequest|import|eval|innerHTML|document\.write)\b", scripts[1][1])
    return re.sub(r"(?s)<script.*?</script>", "", text)


def test_the_page_is_whole_and_needs_nothing_else(text):
    page = check(without_scripts(text))
    for words in ("95 % probability", "What the bottom-hole ellipse is made of", "What is not included"):
        assert words in page.text
    for words in ("From which north", "iscwsa-mwd-rev5.1", "Revision", "5.1", "SPE 67616"):
        assert words in page.text


@pytest.mark.long
def test_the_same_input_gives_the_same_bytes(well, text):
    path, survey, uncertainty, code = well
    assert position_report(path, survey, uncertainty, azimuth_reference="magnetic", tool_code=code) == text


def test_the_verdict_is_the_ellipse(well, text):
    path, _, uncertainty, _ = well
    ellipse = horizontal_ellipse(uncertainty.covariance[-1], 0.95)
    sentence = re.search(r'class="sentence">(.*?)</p>', text)[1]
    major, minor = (float(x) for x in re.search(r"ellipse of ([\d.]+) m by ([\d.]+) m", sentence).groups())
    # two significant digits are shown
    assert major == pytest.approx(float(ellipse.major), rel=0.05)
    assert minor == pytest.approx(float(ellipse.minor), rel=0.05)
    assert "(grid north)" in sentence
    assert f"at {path.md[-1]:.2f} m".capitalize() in sentence


def test_the_chain_of_norths(text):
    rows = dict(re.findall(r'class="text">(magnetic|true|grid)</th><td>([\d.]+)</td>', text))
    # 40 magnetic + 3.25 = 43.25 true; - (-1.5) = 44.75 grid
    assert rows == {"magnetic": "40.000", "true": "43.250", "grid": "44.750"}
    page = check(without_scripts(text)).text
    for words in ("declination +3.250° added (given)", "convergence -1.500° added (given)"):
        assert words in page


def test_the_picture_in_space_has_the_path_and_its_covariances(well, text):
    path, _, uncertainty, _ = well
    data = json.loads(re.search(r'(?s)id="space-data">(.*?)</script>', text)[1])
    np.testing.assert_allclose(data["stations"][-1][1:], [path.north[-1], path.east[-1], path.tvd[-1]], atol=0.0051)
    body = data["bodies"][-1]
    c = uncertainty.covariance[-1]
    wanted = [c[0, 0], c[1, 1], c[2, 2], c[0, 1], c[0, 2], c[1, 2]]
    np.testing.assert_allclose(body[4:], wanted, rtol=1e-5)
    # chi-square of three degrees of freedom at 95 %: 7.8147
    assert data["factor"] ** 2 == pytest.approx(7.8147, abs=1e-4)


def test_contributions_are_sorted_and_complete(well):
    uncertainty = well[2]
    parts = contributions(uncertainty)
    assert [part.major for part in parts] == sorted((part.major for part in parts), reverse=True)
    assert sum(part.share for part in parts) == pytest.approx(1.0, abs=1e-9)
    total = np.sqrt(sum(part.sigma**2 for part in parts))
    np.testing.assert_allclose(total, np.sqrt(np.diagonal(uncertainty.covariance[-1])), rtol=1e-9)


def test_without_an_error_model(well):
    path, survey, *_ = well
    text = position_report(path, survey, None, azimuth_reference="magnetic", notes=["positions only"])
    page = check(without_scripts(text))
    assert "how sure that is is not known" in page.text
    assert "bottom-hole ellipse" not in page.text
    assert json.loads(re.search(r'(?s)id="space-data">(.*?)</script>', text)[1])["bodies"] == []


def test_text_from_outside_is_text(well):
    path, survey, *_ = well
    text = position_report(
        path,
        survey,
        None,
        azimuth_reference="magnetic",
        findings=[Finding("position-code-certificate", {"code": "<b>bold</b>", "term": "A"})],
        inputs={"survey": "</script>"},
    )
    page = check(without_scripts(text))
    assert "<b>bold</b>" in page.text


@pytest.mark.long
@pytest.mark.parametrize(
    "stations",
    [
        ([0.0, 30.0], [0.0, 0.0], [0.0, 0.0]),  # straight down: no section, no plan
        ([0.0, 1e4], [1.5, 1.5], [6.28, 0.0]),
    ],
)
def test_odd_wells_are_drawn_too(stations):
    survey = well_survey(*stations, SITE)
    uncertainty = propagate(survey, load_tool_code("iscwsa-mwd-rev4"))
    text = position_report(minimum_curvature(*stations), survey, uncertainty, azimuth_reference="true")
    assert "nan" not in check(without_scripts(text)).text.split()


def test_views_and_shadows():
    # from the south: east to the right, up is up; from the east: south is on the left, north on the right
    np.testing.assert_allclose(draw.view_axes(np.pi, 0.0), [[0, 1, 0], [0, 0, -1]], atol=1e-15)
    np.testing.assert_allclose(draw.view_axes(np.pi / 2, 0.0), [[1, 0, 0], [0, 0, -1]], atol=1e-15)
    outline = draw.ellipse_points(np.diag([4.0, 9.0, 1.0]), np.eye(3)[[1, 0]], 2.0)
    np.testing.assert_allclose(outline.max(axis=0), [6.0, 4.0], rtol=1e-3)
    # every point lies on the ellipse
    np.testing.assert_allclose((outline[:, 0] / 6.0) ** 2 + (outline[:, 1] / 4.0) ** 2, 1.0, rtol=1e-12)


def test_ellipses_are_made_large_enough_to_be_seen():
    path = minimum_curvature([0.0, 1000.0], [0.0, 0.0], [0.0, 0.0])
    sigma = 1000.0 / 12.0 / 2.4477
    for share, wanted in ((1.1, 1.0), (1.0 / 2.1, 2.0), (1.0 / 4.9, 2.0), (1.0 / 60.0, 50.0)):
        covariance = np.broadcast_to((share * sigma) ** 2 * np.eye(3), (2, 3, 3))
        assert draw.magnification(path, covariance) == wanted
    assert draw.magnification(path, np.zeros((2, 3, 3))) == 1.0
