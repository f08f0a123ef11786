"""Reports in Russian and Chinese: no English sentence is left on any of them."""

from __future__ import annotations

import ast
import itertools
import re
from dataclasses import replace
from html import unescape
from pathlib import Path
from string import Formatter

import numpy as np
import pytest
from tests.refusals import refused

import inclinometry
from inclinometry.calibration.comparison import compare_calibrations
from inclinometry.calibration.drift_alarm import CAUSES
from inclinometry.calibration.drift_status import fleet_status
from inclinometry.findings import Finding, say, translations
from inclinometry.language import label, number, using_language
from inclinometry.report.allan import allan_report
from inclinometry.report.calibration import calibration_report
from inclinometry.report.comparison import two_report
from inclinometry.report.displacement import displacement_report
from inclinometry.report.dynamic import dynamic_report
from inclinometry.report.fleet import fleet_report
from inclinometry.report.gyro import scale_report
from inclinometry.report.msa import msa_report
from inclinometry.report.page import Entry, index_page, linked_back
from inclinometry.report.position import position_report
from inclinometry.report.survey import survey_report
from inclinometry.report.verification import verification_report
from inclinometry.report.words import parameter_name, run_facts
from inclinometry.simulate.fleet import FleetScene, shock_and_heat, simulate_fleet
from inclinometry.stability import ASSUMED
from inclinometry.survey.displacement import CasingErrors, check_sums, displacement
from inclinometry.survey.multistation import multistation
from inclinometry.survey.multistation_priors import published_priors
from inclinometry.survey.quality import judge_fields

from . import test_displacement as casing
from . import test_msa_report as analysis
from .conftest import calibrated
from .pages import check
from .test_allan_report import record
from .test_dynamic import make
from .test_gyro import CHECKS, Run
from .test_position import well
from .test_survey_report import SITE, survey
from .test_verification_report import found as verification

# names, codes, file names, symbols of the formulas and of the standards
ALLOWED = re.compile(
    r"sha256:\w+|\biscwsa[\w.-]*|ISCWSA|\b[A-Z]{2,5}(-[A-Z]\w*)?\d?E?\b|--[\w-]+|\w+_\w+|\bdeg.nT\b|\b(SPE|JCGM|IEEE|Std|CSV|MWD|Rev|HTML|Shift|Davenport|"
    r"Madgwick|Allan|inclinometry|simulated|March|April|later|base|shop|sheet|raw|readings|log|run)\b|\b(accel|mag|gyro)_\w+|\b(cos|sin|rms|md|dls)\b"
    r"|\brig \d|as tabulated in|\[[a-z]+(-[a-z]+)+\]|\bA7\b|\b[xyzABKNTUVWdghkmnsu]\w?\b|Hz|SinI\.SinA|rpm",
    re.ASCII,
)


def _msa():
    stations = analysis.run()
    quality = judge_fields(stations, analysis.REFERENCE)
    return msa_report(multistation(stations, analysis.REFERENCE, published_priors()), stations, quality, tool="A7")


def _casing():
    base, later = casing.reading(0), casing.reading(1, 0.01)
    later.faces["a"][10, 0] += 0.01
    found = displacement(base, later, CasingErrors(sensitivity=1e-3))
    return displacement_report("March", {"a": check_sums(base.faces["a"])}, {"April": found})


def _position():
    path, surveyed, uncertainty, code = well.__wrapped__() if hasattr(well, "__wrapped__") else well()
    return position_report(path, surveyed, uncertainty, azimuth_reference="magnetic", tool_code=code)


def _fleet():
    """Of everything that the page may say, at once: overdue, alarms, a rig off, a tool left out, effects."""
    scene = FleetScene(
        9, 1e-8 * np.eye(24), calibrations=5, rigs=2, jumps={(2, 4): 0.02 * CAUSES["magnetometer y offset"]}
    )
    found = fleet_status(simulate_fleet(scene, seed=1).histories, reproducibility=False, own_drift=False, iterations=5)
    assert found.rigs
    off = [found.rigs[0]._replace(p_value=1e-6), *found.rigs[1:]]
    model = replace(found.model, effects=shock_and_heat(), left_out=("SIM-0003",))
    day = sorted(tool.due.date for tool in found.tools)[3]
    return fleet_report(replace(found, rigs=off, model=model, day=day))


def _calibration():
    readings, found = calibrated({"accelerometer": 3, "magnetometer": 3})
    return calibration_report(found, readings=readings, closed_forms={"twelve": found})


def _two():
    return two_report(compare_calibrations(*[calibrated({"accelerometer": 3, "magnetometer": 3})[1]] * 2, ("A7", "A7")))


REPORTS = {
    "allan": lambda: allan_report(record()),
    "calibration": _calibration,
    "comparison": _two,
    "displacement": _casing,
    "dynamic": lambda: dynamic_report(make()),
    "fleet": _fleet,
    "gyro": lambda: Run().report(checks=[replace(one, name="latitude") for one in CHECKS]),
    "scale": lambda: scale_report(Run().track, tool="A7"),
    "msa": _msa,
    "position": _position,
    "survey": lambda: survey_report(survey(60, SITE), site=SITE),
    "verification": lambda: verification_report(verification.__wrapped__()),
    "index": lambda: index_page("Demonstration", [Entry("verification at independent positions", "#top")]),
}


def words_left(page):
    """Every text of a page that still holds an English word, with what its figures and its descriptions say."""
    body = re.sub(r"(?s)<(script|style)\b.*?</\1>", "", page)
    texts = [unescape(text) for text in re.findall(r">([^<>]+)<", body)]
    texts += [unescape(text) for text in re.findall(r'aria-label="([^"]*)"', body)]
    return sorted({text.strip() for text in texts if re.search(r"[A-Za-z]{2}", ALLOWED.sub("", text))})


@pytest.mark.long
@pytest.mark.parametrize(("name", "language"), list(zip(REPORTS, itertools.cycle(["ru", "zh"]), strict=False)))
def test_no_english_is_left(name, language):
    """In one of the languages: that the other has the same texts is a test of the catalogues."""
    with using_language(language):
        page = REPORTS[name]()
    check(re.sub(r"(?s)<script.*?</script>", "", page))
    assert words_left(page) == []


@pytest.mark.parametrize("language", ["ru", "zh"])
def test_every_cause_of_an_alarm_is_said(language):
    with using_language(language):
        said = [label(cause) for cause in CAUSES]
    assert not [one for one in said if re.search(r"[A-Za-z]{2}", one)]
    assert len(set(said)) == len(CAUSES)


def labels():
    """Every label that the source composes, with the names of the values it is given."""
    for path in Path(inclinometry.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "label" and node.args:
                for text in ast.walk(node.args[0]):
                    if isinstance(text, ast.Constant) and isinstance(text.value, str) and "{" in text.value:
                        yield text.value, {one.arg for one in node.keywords}


def fields(text):
    return {name for _, name, _, _ in Formatter().parse(text) if name is not None}


def test_labels_have_their_values_and_are_translated():
    said = [translations(language, "label") for language in ("ru", "zh")]
    for text, given in labels():
        assert fields(text) <= given, text
        assert all(fields(one[text]) == fields(text) for one in said), text


def test_numbers_have_the_sign_of_the_language():
    with using_language("ru"):
        assert label("{name}: rms {rms}°{lost}", name="joint", rms="0.25", lost="") == "совместный: СКЗ 0,25°"
        assert (number("-0.12 ± 0.05"), label("Bench & sons")) == ("-0,12 ± 0,05", "Bench & sons")
        assert label("Written by inclinometry {version}.", version="0.1.0") == "Written by inclinometry 0.1.0."


def test_units_are_of_the_language():
    noise = {"kind": "accelerometer", "sd": (5e-4, 6e-4), "unit": "m/s^2", "stations": 20, "freedom": 80.0}
    assert "0,0005 и 0,0006 м/с²," in say(Finding("gyro-noise-estimated", noise), "ru")
    turns = Finding("survey-index-turns", {"turns": "counterclockwise"})
    assert [say(turns, one).count("clockwise") for one in ("en", "ru", "zh")] == [1, 0, 0]
    age = say(Finding("work-age", {"days": 365.0, "source": (ASSUMED.source,)}), "ru")
    assert "половина членов AB" in age
    readings, found = calibrated({"accelerometer": 3, "magnetometer": 3})
    with using_language("ru"):
        facts = dict(run_facts(found, replace(readings, reference={"g": 9.81})))
        assert "9,81000 м/с²" in facts.values()
        assert label("counts per m/s^2") == "ед. АЦП на м/с²"


def test_parameters_have_names():
    assert parameter_name("accelerometer.tensor[2,1]") == "accelerometer Z cross-axis Y"
    with using_language("ru"):
        assert parameter_name("accelerometer.tensor[2,2]") == "акселерометр Z: масштаб"


def test_other_languages_are_refused():
    with refused("input-choice", name="language"), using_language("de"):
        pass


def test_a_page_lists_its_parts_and_leads_back():
    page = linked_back(verification_report(verification.__wrapped__()), "../index.html", "All reports")
    headings = re.findall(r'<h2 id="(part-\d+)">(.*?) <a class="top" href="#top"', page)
    assert len(headings) >= 4
    for place, text in headings:
        assert f'<a href="#{place}">{text}</a>' in page
    assert '<a href="../index.html">← All reports</a>' in page
