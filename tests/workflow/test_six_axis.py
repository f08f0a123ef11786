"""Stations out of files: a survey holds the same six numbers as six axes; doubts about the site; order of work."""

import datetime

import numpy as np
import pytest
from tests.refusals import coded, refused

from inclinometry.earth.site import Site
from inclinometry.errors import FileError
from inclinometry.files.survey_file import SurveyFile
from inclinometry.orientation import angles, dip_angle, fields
from inclinometry.workflow.field import declination_doubts
from inclinometry.workflow.six_axis import fields_of_survey, quality, read_six_axis, survey_six_axis

HEADER = "md_m,gx_m_s2,gy_m_s2,gz_m_s2,bx_nT,by_nT,bz_nT"
SITE = "g = 9.81\nsigma_g = 0.01\nb_nT = 50000\nsigma_b_nT = 130\ndip_deg = 70\nsigma_dip_deg = 0.2\n"


def axes(size=12, seed=1):
    random = np.random.default_rng(seed)
    turned = (random.uniform(0.0, 6.0, size), random.uniform(0.05, 3.0, size), random.uniform(0.0, 6.0, size))
    g, b = fields(*turned, np.radians(70.0))
    return 9.81 * g, 5e4 * b


def survey_of(g, b, site, reference):
    found = angles(g, b)
    shift = {"magnetic": 0.0, "true": site.declination, "grid": (site.declination or 0.0) - (site.convergence or 0.0)}
    return SurveyFile(
        md=30.0 * np.arange(len(g)),
        inclination=found.inclination,
        azimuth=(found.azimuth + shift[reference]) % (2.0 * np.pi),
        azimuth_reference=reference,
        toolface=found.toolface,
        measured={"g": np.linalg.norm(g, axis=1), "b": np.linalg.norm(b, axis=1), "dip": dip_angle(g, b)},
    )


@pytest.mark.parametrize("reference", ["magnetic", "true", "grid"])
def test_a_survey_gives_its_axes_back(reference):
    site = Site(declination=0.2, convergence=-0.1)
    g, b = axes()
    found = fields_of_survey(survey_of(g, b, site, reference), site, "a.csv")
    # rounding of angles of a few rad
    np.testing.assert_allclose(found[0], g, atol=1e-12)
    np.testing.assert_allclose(found[1], b, atol=1e-8)
    assert found[2] is None


def test_a_survey_that_cannot():
    g, b = axes()
    whole = survey_of(g, b, Site(declination=0.2), "true")
    with refused("earth-site-lacks"):
        fields_of_survey(whole, Site(), "a.csv")
    bare = SurveyFile(md=whole.md, inclination=whole.inclination, azimuth=whole.azimuth, azimuth_reference="true")
    with refused("work-six-axes", error=FileError, names=("g_total (m/s^2)", "b_total_nT", "dip")):
        fields_of_survey(bare, Site(), "a.csv")
    holes = {**whole.measured, "dip": np.where(np.arange(12) == 3, np.nan, 1.2)}
    gap = SurveyFile(
        md=whole.md,
        inclination=whole.inclination,
        azimuth=whole.azimuth,
        azimuth_reference="magnetic",
        measured=holes,
    )
    with refused("table-empty", error=FileError, column="dip"):
        fields_of_survey(gap, Site(), "a.csv")


def test_without_toolface_totals_and_dip_are_the_same():
    g, b = axes()
    whole = survey_of(g, b, Site(), "magnetic")
    bare = SurveyFile(
        md=whole.md,
        inclination=whole.inclination,
        azimuth=whole.azimuth,
        azimuth_reference="magnetic",
        measured=whole.measured,
    )
    found = fields_of_survey(bare, Site(), "a.csv")
    np.testing.assert_allclose(dip_angle(found[0], found[1]), dip_angle(g, b), atol=1e-12)


def written(tmp_path, g, b, more=""):
    (tmp_path / "site.toml").write_text(more + SITE)
    rows = np.column_stack([30.0 * np.arange(len(g)), g, b])
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header=HEADER, comments="", fmt="%.12g")
    return read_six_axis(tmp_path / "a.csv", tmp_path / "site.toml")


def test_perfect_stations_pass_and_are_left_alone(tmp_path):
    g, b = axes()
    run = written(tmp_path, g, b)
    assert quality(run.stations, run.site).verdict == "pass"
    for correct in (None, "msa"):
        found = survey_six_axis(run, correct).survey
        np.testing.assert_allclose(found.inclination, angles(g, b).inclination, atol=1e-9)
        np.testing.assert_allclose(found.azimuth, angles(g, b).azimuth, atol=1e-8)
    assert coded(found.history) == ["survey-step", "survey-step-analysis"]


def test_axial_before_the_analysis_is_warned_of(tmp_path):
    g, b = axes()
    run = written(tmp_path, g, b + [0.0, 0.0, 400.0])
    both = survey_six_axis(run, "axial,msa").survey
    assert "survey-axial-first" in coded(both.findings)
    for single in ("axial", "msa"):
        assert "survey-axial-first" not in coded(survey_six_axis(run, single).survey.findings)


def test_unused_stations_are_left_out(tmp_path):
    from inclinometry.files.parquet import write_parquet

    g, b = axes()
    g[4], used = 2.0 * g[4], np.arange(12) != 4
    (tmp_path / "site.toml").write_text(SITE)
    write_parquet(SurveyFile(md=30.0 * np.arange(12), g=g, b=b, used=used), tmp_path / "a.parquet")
    run = read_six_axis(tmp_path / "a.parquet", tmp_path / "site.toml")
    assert len(run.stations) == 11
    [left] = [one for one in run.findings if one.code == "table-left"]
    assert (left.values, left.severity) == ({"count": 1, "total": 12}, "note")
    assert quality(run.stations, run.site).verdict == "pass"


PLACE = {"latitude": 0.7, "longitude": -1.4, "height_m": 0.0}


@pytest.mark.parametrize(
    ("declination", "date", "said"),
    [
        (9.5, datetime.date(2026, 5, 1), True),
        (-9.0, datetime.date(2026, 5, 1), False),
        (0.5, datetime.date(2026, 5, 1), True),
        (25.0, datetime.date(2026, 5, 1), True),  # not by its sign
        (9.5, datetime.date(2090, 5, 1), False),  # no model
        (9.5, None, False),
    ],
)
def test_doubts_about_the_declination(declination, date, said):
    # WMM2025: 9 deg west
    site = Site(declination=np.radians(declination), date=date, **PLACE)
    assert bool(declination_doubts(site)) is said
