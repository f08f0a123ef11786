"""Reports and pictures of gyro runs."""

from dataclasses import replace

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.constants import EARTH_RATE, STANDARD_GRAVITY
from inclinometry.earth.site import Site
from inclinometry.errors import InputError
from inclinometry.findings import Finding, example
from inclinometry.gyro.closed_form import solve_fixed_arctan2, solve_patent
from inclinometry.gyro.joint import earth_in_tool
from inclinometry.gyro.north import estimate_north
from inclinometry.gyro.tracking import quadratic_belief, smooth_scale
from inclinometry.report.gyro import gyro_report, hot_run_figure, scale_course, scale_report
from inclinometry.survey.flags import Check, unjudged
from inclinometry.survey.gyro import gyro_survey

from .pages import check

LATITUDE = np.pi / 4
NOISE = 1e-3  # of the Earth rate
UNJUDGED = unjudged("too few common stations with this angle")
CHECKS = (
    Check("horizontal rate", "pass", 1e-7, 2e-6, (), UNJUDGED, "rad/s"),
    Check("in-run against out-run", "not judged", np.nan, 0.017, (), UNJUDGED),
)


class Run:
    """A run into a hot hole that passes K = 0, with each method's stations."""

    def __init__(self, size=40):
        draw = np.random.default_rng(5)
        self.heat = np.linspace(20.0, 140.0, size)
        self.scale = 1.0 + 0.005 * (self.heat - 20.0) / 100.0
        self.inclination, self.azimuth = np.radians(np.linspace(2.0, 75.0, size)), np.full(size, np.radians(120.0))
        self.md = 30.0 * np.arange(1.0, size + 1.0)
        high = earth_in_tool(self.azimuth, self.inclination, LATITUDE)[:, :2] / self.scale[:, None]
        high = high + NOISE * draw.standard_normal(high.shape)
        spread = np.tile(NOISE**2 * np.eye(2), (size, 1, 1))
        self.track = smooth_scale(high, spread, self.inclination, LATITUDE, self.heat, quadratic_belief())
        level = np.stack([-np.sin(self.inclination), np.zeros(size), np.cos(self.inclination)], axis=1)
        readings = STANDARD_GRAVITY * level, EARTH_RATE * high, LATITUDE
        known = {"gravity_covariance": 1e-6 * np.eye(3), "rate_covariance": (EARTH_RATE * NOISE) ** 2 * np.eye(2)}
        self.north = estimate_north(*readings, **known, scale=self.track.law)
        self.others = {"fixed": solve_fixed_arctan2(*readings, **known)}
        self.others["patent"] = solve_patent(*readings, **known, history=1.0)

    def report(self, site=None, checks=CHECKS, **more):
        found = gyro_survey(self.md, self.north, site=site, tool="G7", inputs={"raw": "sha256:2"})
        content = {"temperature": self.heat, "track": self.track, "others": self.others, "site": site} | more
        return gyro_report(found, self.north, md=self.md, checks=checks, **content)


@pytest.fixture(scope="module")
def run():
    return Run()


def test_exact_accelerometers_are_not_stated_instead_of_believed(run):
    """Uncertainties no accelerometer has are those nobody stated."""
    parts = {name: part * [1e-6, 1.0, 1.0, 1.0] for name, part in run.north.components.items()}
    exact = replace(run.north, components=parts)
    text = gyro_report(gyro_survey(run.md, exact, tool="G7"), exact, md=run.md)
    verdict = text[text.index('<p class="sentence">') :].partition("</p>")[0]
    assert "inclination within" not in verdict
    assert "azimuth within" in verdict
    assert "Inclination: the errors of the accelerometers are not stated." in verdict
    assert "errors of the accelerometers" in text.partition("Not included: ")[2].partition("</p>")[0]


@pytest.mark.long
def test_page_says_what_it_rests_on(run):
    text = run.report(Site(latitude=LATITUDE))
    page = check(text)
    assert "40 stations from 30 to 1200 m" in page.text
    assert "Azimuth counts from true north" in page.text
    assert "+45.0000°" in page.text
    assert "“gyro”" in page.text
    assert "sag" in page.text
    assert page.tags.count("svg") == 6  # two angles, scale, K, differences over depth and temperature
    assert text == run.report(Site(latitude=LATITUDE))


@pytest.mark.long
def test_grid_north_and_its_convergence_are_said(run):
    site = Site(latitude=LATITUDE, north_reference="grid", convergence=np.radians(1.25))
    words = check(run.report(site)).text
    assert "Azimuth counts from grid north" in words
    assert "error of the convergence" in words
    assert "+1.250°" in words


@pytest.mark.long
def test_checks_decide_the_badge(run):
    calm = replace(run.north, flags=[()] * len(run.north))
    found = gyro_survey(run.md, calm)
    assert "No flags, all checks passed" in check(gyro_report(found, calm, md=run.md, checks=CHECKS[:1])).text
    assert "No flags, 1 of 2 checks not judged" in check(gyro_report(found, calm, md=run.md, checks=CHECKS)).text
    failed = Check("latitude", "fail", np.radians(1.5), np.radians(0.5), (3,), example("gyro-latitude-off"))
    words = check(gyro_report(found, calm, md=run.md, checks=(*CHECKS, failed))).text
    assert "1 of 3 checks failed" in words
    assert "Settle the failed check of “latitude”" in words
    assert "Check the latitude of the site" in words
    assert "1.5° 0.50°" in words.replace("1.5°0.50°", "1.5° 0.50°")  # value and limit in degrees
    assert "0.021 deg/h" in words  # 1e-7 rad/s


@pytest.mark.long
def test_failures_of_the_closed_form_are_counted_and_named(run):
    lost = replace(run.others["patent"])
    lost.azimuth[5:8] = lost.scale[5:8] = np.nan
    flags = [("complex",) if 5 <= n < 8 else () for n in range(len(lost))]
    words = check(run.report(others={"patent": replace(lost, flags=flags)})).text
    assert "complex (3)" in words


@pytest.mark.long
def test_a_run_from_the_bottom_up_gives_the_same_table(run):
    def rows(text):
        return text[text.index(">Stations <a") : text.rindex("<h2", 0, text.rindex(">What was reduced"))]

    back = Run()
    turn = slice(None, None, -1)
    arrays = ("inclination", "azimuth", "toolface", "gyro_toolface", "scale", "u_scale", "k", "chi_square", "dof")
    upward = replace(
        back.north,
        **{name: getattr(back.north, name)[turn] for name in arrays},
        components={name: part[turn] for name, part in back.north.components.items()},
        flags=back.north.flags[turn],
        root=back.north.root[turn],
    )
    found = gyro_survey(back.md[turn], upward, tool="G7")
    text = gyro_report(found, upward, md=back.md[turn], temperature=back.heat[turn])
    assert rows(text) == rows(run.report())


def test_flags_in_words_and_one_vertical_station():
    one = Run(1)
    north = replace(one.north, flags=[("vertical", "weak")])
    found = gyro_survey(one.md, north)
    words = check(gyro_report(found, north, md=one.md)).text
    assert "use the gyro toolface" in words
    assert "the rates hardly depend on azimuth here" in words
    assert "1 of 1 stations flagged" in words


@pytest.mark.parametrize("name", ["temperature", "md", "others"])
def test_stations_that_do_not_go_together_are_refused(run, name):
    found = gyro_survey(run.md, run.north)
    wrong = {"md": run.md, "temperature": run.heat} | {
        "temperature": {"temperature": run.heat[1:]},
        "md": {"md": run.md + 1.0},
        "others": {"others": Run(3).others},
    }[name]
    code, values = {
        "temperature": ("input-shape", {"name": "temperature", "shape": "(39,)", "expected": "(40,)"}),
        "md": ("work-rows", {"name": "md_m", "here": run.md[0] + 1.0, "there": run.md[0], "file": "survey.csv"}),
        "others": ("input-shape", {"name": "fixed", "shape": "(3,)", "expected": "(40,)"}),
    }[name]
    with refused(code, error=InputError, **values):
        gyro_report(found, run.north, **wrong)


def test_hostile_names(run):
    evil = "</style><script>alert(1)</script>"
    said = Finding("record-text", {"text": evil})
    found = replace(gyro_survey(run.md, run.north, tool=evil, inputs={evil: evil}), findings=(said,))
    checks = [Check(evil, "fail", 1.0, 1.0, (), said, evil)]
    others = {evil: run.others["patent"]}
    assert check(gyro_report(found, run.north, md=run.md, checks=checks, others=others)).text.count(evil) >= 8
    assert check(scale_report(replace(run.track, findings=(said,)), tool=evil)).text.count(evil) >= 3


def test_scale_report_offers_what_was_learnt(run):
    page = check(scale_report(run.track, md=run.md, tool="G7"))
    assert "slope, per 100 °C" in page.text
    assert "The next run can start" in page.text
    assert "30.00" in page.text
    assert page.tags.count("svg") == 1
    with refused("input-shape", name="md", shape="(39,)", expected="(40,)"):
        scale_report(run.track, md=run.md[1:])


def test_scale_report_marks_stations_nothing_was_learnt_from(run):
    unseen = Finding("gyro-scale-unseen", {"count": 4, "total": 40}, severity="note")
    deaf = replace(
        run.track,
        observable=np.arange(len(run.track)) > 3,
        findings=(unseen,),
    )
    words = check(scale_report(deaf)).text
    assert "Nothing learnt from 4 of 40 stations" in words
    assert "nothing learnt" in words


def test_the_curve_is_the_runs_own_and_holds_the_truth(run):
    heat, scale, sd = scale_course(run.track)
    assert np.array_equal(heat, run.track.temperature)
    assert np.array_equal(scale, run.track.expected)
    # six standard uncertainties: the draw is fixed, the bound is for a sign or a unit gone wrong
    assert np.all(np.abs(scale - (1.0 + 0.005 * (heat - 20.0) / 100.0)) < 6.0 * sd)


def hot(run, errors, u=None):
    u = {"joint": run.north.u("azimuth")} if u is None else u
    return hot_run_figure(run.heat, run.inclination, errors, u, run.scale, run.track)


def test_hot_run_says_rms_and_failures(run):
    error = np.full(40, np.radians(0.25))
    failing = np.where(np.arange(40) < 3, np.nan, np.radians(50.0))
    figure = hot(run, {"joint": error, "patent": failing})
    words = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert "joint: rms 0.25°" in words
    assert "patent: rms 50°, no azimuth at 3 of 40" in words


def test_hot_run_marks_what_is_off_its_axis(run):
    error = np.full(40, np.radians(0.1))
    error[10], error[20], error[30] = np.radians(170.0), -np.radians(170.0), np.nan
    axes = hot(run, {"patent": error}).axes[0]
    marks = {line.get_marker(): line.get_xdata()[0] for line in axes.lines if line.get_linestyle() == "None"}
    assert [marks["^"], marks["v"], marks["x"]] == run.heat[[10, 20, 30]].tolist()
    assert axes.get_ylim()[1] < 5.0  # deg: one wild station does not flatten the others


def test_hot_run_with_a_method_that_always_fails(run):
    words = hot(run, {"patent": np.full(40, np.nan)}).axes[0].get_legend().get_texts()
    assert any("not known" in text.get_text() for text in words)


def test_hot_run_refuses_what_does_not_go_together(run):
    with refused("input-shape", error=InputError, name="joint", shape="(3,)", expected="(40,)"):
        hot(run, {"joint": np.zeros(3)})
    with refused("input-empty", error=InputError, name="errors, u"):
        hot(run, {})
