"""The certificate on paper: everything it must say is on it, literally, on numbered pages, in three languages."""

from __future__ import annotations

import ast
import copy
import json
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.stats
from lxml import etree
from tests.refusals import refused

import inclinometry
from inclinometry.calibration.expected import expected_uncertainty, tool_temperature
from inclinometry.calibration.result import Calibration
from inclinometry.calibration.undetermined import few
from inclinometry.constants import STEPS
from inclinometry.errors import FileError
from inclinometry.files.json_codec import restored
from inclinometry.findings import Finding, say
from inclinometry.laboratory.certificate.dcc import dcc_bytes
from inclinometry.laboratory.certificate.laboratory import Laboratory, Standard
from inclinometry.laboratory.certificate.pdf import certificate_pdf
from inclinometry.laboratory.certificate.record import (
    adjusted,
    checked,
    chinese_font,
    classical_section,
    coverage_probability,
    record_bytes,
    record_digest,
    verification_section,
    words,
)
from inclinometry.laboratory.certificate.requirements import missing, two_accelerometers
from inclinometry.orientation import fields
from inclinometry.sensors import angle_sensitivity, with_scale
from inclinometry.stability import add_stability

from ...report.conftest import calibrated
from .certificates import LABORATORY, NASTY, ORDER, STANDARDS, calibration, dcc_schema, record, verification

poppler = pytest.mark.skipif(shutil.which("pdftotext") is None, reason="pdftotext is not installed")


def pages(pdf: bytes, tmp_path: Path) -> list[str]:
    """Text of each page, blanks and breaking places evened out."""
    file = tmp_path / "certificate.pdf"
    file.write_bytes(pdf)
    text = subprocess.run(["pdftotext", "-layout", file, "-"], capture_output=True, check=True).stdout.decode()
    return [" ".join(page.replace("\u200b", "").split()) for page in text.split("\f")[:-1]]


@pytest.mark.long
def test_the_same_record_gives_the_same_archive_pdf() -> None:
    """PDF/A-2b by its own metadata; the digest stands in it; the bytes repeat."""
    content = record()
    pdf = certificate_pdf(content)
    assert pdf == certificate_pdf(json.loads(json.dumps(content)))
    assert record_digest(content).encode() in pdf
    assert re.search(rb"<pdfaid:part>2</pdfaid:part>\s*<pdfaid:conformance>B", pdf)
    assert certificate_pdf(record(number="2026-0002")) != pdf


@poppler
def test_the_page_says_what_the_standard_asks_for(tmp_path: Path) -> None:
    """ISO/IEC 17025, 7.8: who, what, for whom, when, how, result, unit, uncertainty, page n of m, end."""
    content = record(head="7:" + "a" * 64, supersedes="2025-0003", order=replace(ORDER, interval_months=12))
    found = pages(certificate_pdf(content), tmp_path)
    first, whole = found[0], " ".join(found)
    for text in (
        "Calibration certificate", "No. 2026-0001", "Stand & Son", "2 Town", "Hall 3", "NA 12", "Driller",
        "steering tool", "IN-7", "good", "2026-05-01", "2026-05-04 – 2026-05-05", "2026-05-06",
        "orthogonal; 24 positions measured", "stand 1",
        "temperature 21.5 to 23 °C", "level No. 7", "Anna, head", "12 months", "2025-0003", "QP-12",
        "Autocollimator 7, certificate PTB 2025-123, due 2027-03-01", "T2, certificate D-17, due 2026-12-31",
        "The item conforms", "JCGM 106:2012, 8.2", "our own limits", "Results at the verified positions",
    ):  # fmt: skip
        assert text in first, text
    for text in (record_digest(content), "7:" + "a" * 64, "JCGM 100:2008", "Uncertainty budget of one reading"):
        assert text in whole, text
    for number, page in enumerate(found, 1):
        assert f"2026-0001 Page {number} of {len(found)}" in page
        assert "relate only to the item calibrated" in page
    assert whole.endswith("End of certificate 2026-0001 — " + found[-1].rpartition("— ")[2])
    # after a year the sensors may have moved; the variances of 24 positions were estimated
    for text in ("effective degrees of freedom", "Ue(I), °", "at the end of the agreed interval of 12 months"):
        assert text in whole, text
    for text in ("k = 2.02", "95.45 %", "U(I), °", "U0", "Residuals", "Verification at independent positions"):
        assert text in whole, text


@poppler
def test_special_characters_are_printed_as_they_are(tmp_path: Path) -> None:
    """Markup of the typesetter, of web pages and of spreadsheets in every free text."""
    laboratory = replace(LABORATORY, name=NASTY, traceability=NASTY, address=NASTY)
    order = replace(ORDER, customer=NASTY, item=NASTY, condition=NASTY, rig=NASTY, environment=NASTY, serial=NASTY)
    content = record(laboratory=laboratory, order=order, previous=calibration(2), previous_from=NASTY, number=NASTY)
    content["findings"] = [restored(NASTY).stored()]
    whole = " ".join(pages(certificate_pdf(content), tmp_path)).replace(" ", "")
    # name, traceability, address (twice: place), customer, item, condition, rig, environment, serial, number, ...
    assert whole.count(NASTY.replace(" ", "")) >= 12


@pytest.mark.long
def test_long_words_and_many_positions_stay_on_the_page() -> None:
    """Nothing but the time grows."""
    order = replace(ORDER, serial="X" * 180, customer="Y" * 400, condition="z " * 240)
    seen = dict(verification())
    seen["report"] = seen["report"] | {"positions": seen["report"]["positions"] * 40}
    assert certificate_pdf(record(order=order, verification=seen)).startswith(b"%PDF")


@poppler
def test_russian_letters_are_shown(tmp_path: Path) -> None:
    """Cyrillic with the fonts that come with the packages."""
    first = pages(certificate_pdf(record(language="ru", order=replace(ORDER, customer="Буровая № 1"))), tmp_path)[0]
    for text in ("Сертификат калибровки", "Буровая № 1", "Изделие соответствует", "Страница 1 из"):
        assert text in first, text


@poppler
def test_chinese_is_shown_or_refused(tmp_path: Path) -> None:
    """No boxes: without a font the certificate is refused in one sentence."""
    content = record(language="zh")
    if chinese_font() is None:
        with refused("ledger-letters-not-shown"):
            certificate_pdf(content)
        with refused("ledger-letters-not-shown"):
            certificate_pdf(record(order=replace(ORDER, customer="石油")))
    else:
        assert "校准证书" in pages(certificate_pdf(content), tmp_path)[0]


def test_letters_without_a_font_are_refused() -> None:
    """Never a box where a name should be."""
    with refused("ledger-letters-not-shown"):
        certificate_pdf(record(order=replace(ORDER, customer="\U00013080")))


def test_every_language_has_every_text() -> None:
    """The same keys with the same places to fill in."""
    texts = {language: words(language)._texts for language in ("en", "ru", "zh")}
    for key, text in texts["en"].items():
        for language in ("ru", "zh"):
            assert sorted(re.findall(r"{\w+}", texts[language][key])) == sorted(re.findall(r"{\w+}", text)), key


def test_uncertainties_are_those_of_the_calibration() -> None:
    """k times the worst standard uncertainty of each inclination, growing as 1 / sin I toward the vertical."""
    table, found = record()["results"]["uncertainty"], calibration()
    # the noise is estimated, the dials are stated: a covariance that is nu / (nu - 2) times that at the estimates
    nu = found.freedom
    assert table["degrees_of_freedom"] == np.floor(nu)
    assert table["coverage_factor"] == round(scipy.stats.t(np.floor(nu)).ppf(0.5 + 0.5 * coverage_probability(2.0)), 2)
    found = replace(found, tool=replace(found.tool, covariance=(nu - 2.0) / nu * found.tool.covariance))
    worst = expected_uncertainty(found, np.radians(table["inclination_deg"])).of_one_reading
    for place, name in enumerate(("inclination", "azimuth", "toolface")):
        np.testing.assert_allclose(
            table[f"U_{name}_deg"], np.degrees(table["coverage_factor"] * worst[:, place]), rtol=1e-12
        )
    product = np.array(table["U_toolface_deg"]) * np.sin(np.radians(table["inclination_deg"]))
    assert product[0] == pytest.approx(product[1], rel=1e-2)
    assert table["coverage_probability"] == round(coverage_probability(2.0), 4) == 0.9545
    # at the end of the agreed interval the sensors may have moved
    later = record(order=replace(ORDER, interval_months=24))["results"]["uncertainty"]
    assert later["U_azimuth_deg"] == table["U_azimuth_deg"]
    own = expected_uncertainty(
        replace(found, tool=add_stability(found.tool, 2.0)), np.radians(table["inclination_deg"])
    )
    np.testing.assert_allclose(
        later["end_of_interval"]["U_azimuth_deg"], np.degrees(table["coverage_factor"] * own.of_one_reading[:, 1])
    )
    assert "end_of_interval" not in table


@pytest.mark.long
@pytest.mark.parametrize("sensors", [{"accelerometer": 3}, {"accelerometer": 3, "gyro": 3}, {"accelerometer": 2}])
def test_every_kind_of_tool_can_be_certified(sensors: dict[str, int]) -> None:
    """Angles it cannot give are left out, not invented; the digital certificate fits too."""
    calibration = calibrated(sensors)[1]
    content = record(calibration, verification=None)
    table = content["results"]["uncertainty"]
    assert ("U_azimuth_deg" in table) == ("gyro" in sensors)
    if sensors["accelerometer"] == 2:
        # given, with the condition it holds under; lost toward the horizontal, where it was "no uncertainty" before
        at = dict(zip(table["inclination_deg"], table["U_inclination_deg"], strict=True))
        # a textbook's g at the calibration: 0.3 % of it is 2 * 0.17 deg times the tangent
        assert at[30.0] == pytest.approx(2.0 * np.degrees(3e-3 * np.tan(np.radians(30.0))), rel=0.15)
        assert at[90.0] > 30.0
        (told,) = two_accelerometers(calibration.tool)
        assert told.values["percent"] == pytest.approx(0.3, abs=0.05)
        assert told.stored() in content["findings"]
    assert certificate_pdf(content).startswith(b"%PDF")
    schema = dcc_schema()
    assert schema.validate(etree.fromstring(dcc_bytes(content))), schema.error_log


def test_before_and_after() -> None:
    """The earlier values, their difference; another kind of tool is refused."""
    seen = record(previous=calibration(2), previous_from="2025-0001")["adjustment"]
    assert seen["previous"] == "2025-0001"
    assert 0.0 < seen["largest_difference_deg"]["azimuth"] < 1.0
    assert [row["name"] for row in seen["parameters"]] == list(calibration().tool.parameter_names)
    texts = classical_section(record(previous=calibration(), previous_from="2025-0001"), words("en"))["texts"]
    assert any("the same signals give the same angles within 0.0001°" in text for text in texts)


def at_strengths(strengths: dict[str, float | None]) -> Calibration:
    """The calibration once more at a stand with other fields: the same sensors, stated or not."""
    found = calibration()
    own = {kind: triad.field_strength or 1.0 for kind, triad in found.tool.triads.items()}
    tool = with_scale(found.tool, {kind: (f or 1.01 * own[kind]) / own[kind] for kind, f in strengths.items()})
    triads = {kind: replace(triad, field_strength=strengths[kind]) for kind, triad in tool.triads.items()}
    return replace(found, tool=replace(tool, triads=triads))


def test_the_same_sensors_at_a_stand_with_other_fields_have_not_changed() -> None:
    """One unit before and after: gravity by 0.4 %, the magnetic field by 10 %, with the uncertainties of the tool."""
    content = record(previous=at_strengths({"accelerometer": 9.78, "magnetometer": 45000.0}))
    assert content["adjustment"]["relative"] == {}
    for kind in ("accelerometer", "magnetometer"):
        for row, before, change in adjusted(content, kind):
            assert before["value"] == pytest.approx(row["value"], rel=1e-9, abs=1e-12)
            assert before["u"] == pytest.approx(row["u"], rel=1e-4)
            assert change["value"] == pytest.approx(0.0, abs=1e-6 * change["u"])
            assert change["u"] == pytest.approx(np.sqrt(2.0) * row["u"], rel=1e-4)
    pairs = zip(content["adjustment"]["parameters"], content["results"]["parameters"], strict=True)
    for before, after in pairs:
        assert before["value"] == pytest.approx(after["value"], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("lacks", ["accelerometer", "magnetometer"])
@pytest.mark.parametrize("later", [False, True])
def test_a_field_that_one_calibration_does_not_state_gives_no_scale(lacks: str, later: bool) -> None:
    """Ratios of the scales, offsets as signals and directions are compared, which needs no strength; nothing else."""
    stated = {kind: triad.field_strength for kind, triad in calibration().tool.triads.items()}
    other = at_strengths(stated | {lacks: None})
    now, before = (other, calibration()) if later else (calibration(), other)
    content = record(now, previous=before)
    assert list(content["adjustment"]["relative"]) == [lacks]
    for kind in stated:
        rows = adjusted(content, kind)
        compares = {row["name"] for row, _, change in rows if change is not None}
        absolute = {f"{axis} {what}" for axis in "xyz" for what in ("scale", "bias")}
        relative = {f"{axis} {what}" for axis in "xyz" for what in ("scale to the mean", "offset")}
        directions = {f"{one} toward {other}" for one in "xyz" for other in "xyz" if one != other}
        assert compares == directions | (relative if kind == lacks else absolute)
        for _, _, change in rows:
            assert change is None or change["value"] == pytest.approx(0.0, abs=1e-6 * change["u"])
    scales = {row["name"]: row["value"] for row in content["adjustment"]["relative"][lacks] if row["unit"] == "%"}
    assert np.mean(list(scales.values())) == pytest.approx(100.0)
    tensors = [row for row in content["adjustment"]["parameters"] if row["name"].startswith(f"{lacks}.tensor")]
    assert {row["value"] for row in tensors} == {None}


@pytest.mark.long
@pytest.mark.parametrize(
    ("seen", "statement", "rule"),
    [
        (lambda: verification(1.0), "pass", "simple"),
        (lambda: verification(0.01), "fail", "simple"),
        (lambda: verification(1.0, "expanded-uncertainty"), "pass", "guarded"),
        (lambda: verification(None), "not assessed", None),
        (lambda: None, "not assessed", None),
    ],
)
def test_conformity_and_its_rule(seen, statement, rule) -> None:  # type: ignore[no-untyped-def]
    """Stated as verified; every kind can be printed."""
    content = record(verification=seen())
    assert {key: content["conformity"][key] for key in ("statement", "rule")} == {"statement": statement, "rule": rule}
    assert certificate_pdf(content).startswith(b"%PDF")


@poppler
def test_the_first_page_says_to_what_the_statement_applies(tmp_path: Path) -> None:
    """Protocol with n of m, angles and inclinations judged, what was not; the reference of the rig."""
    seen = copy.deepcopy(verification(1.0))
    seen["report"]["protocol"] = {"name": "twelve", "positions_captured": 12, "positions": 12}
    for row in seen["report"]["positions"]:
        row["toolface"]["decision"] = "not judged"
    order = replace(ORDER, rig_traceability="NMI cert 12", rig_place="hall 9")
    for language, said in (
        ("en", "the statement does not apply to: toolface"),
        ("ru", "не относится к: визирный угол"),
    ):
        content = record(verification=seen, order=order, language=language, laboratory=replace(LABORATORY, place=""))
        text = " ".join(pages(certificate_pdf(content), tmp_path)[0].split())
        assert said in text
        assert "NMI cert 12" in text
        assert "hall 9" in text
    text = " ".join(pages(certificate_pdf(record(verification=seen)), tmp_path)[0].split())
    assert "twelve, 12 of 12 positions" in text
    assert "inclination at 12 positions, inclination 0° to 90°" in text
    assert "azimuth at 9 positions, inclination 90° to 90°" in text


def test_without_a_laboratory_it_says_that_it_is_none(tmp_path: Path) -> None:
    """Printed all the same, with a box."""
    pdf = certificate_pdf(record(laboratory=None))
    if shutil.which("pdftotext"):
        assert "no calibration certificate in the sense of ISO/IEC 17025" in pages(pdf, tmp_path)[0]


def test_what_cannot_be_shown_is_left_out_of_the_record() -> None:
    """Control characters and marks that turn the direction of writing."""
    content = record(order=replace(ORDER, customer="A\x00B\u202eC\nD"))
    assert content["customer"]["name"] == "ABC\nD"
    with refused("input-choice", name="language"):
        record(language="fr")
    with refused("input-missing", names=("issued",)):
        record(order=replace(ORDER, issued=None))


def test_warnings_and_units_are_in_the_language_of_the_certificate(seen: list[dict[str, str]]) -> None:
    """Nobody reads English on the Russian certificate of a doubtful verification, but names and codes."""
    doubted = copy.deepcopy(verification(1.0))
    said = few("positions to verify a tool", 4, 6, "Take more over the range of use")
    doubted["report"]["findings"] = [said.stored()]
    certificate_pdf(record(verification=doubted) | {"language": "ru"})
    text = json.dumps(seen[0], ensure_ascii=False)
    assert str(said) not in text
    assert say(said, "ru").rstrip(".") in "".join(seen[0]["conformity"])
    assert "counts" not in text
    assert "ед. АЦП на g" in text


@pytest.mark.long
def test_the_box_is_green_only_where_nothing_speaks_against_it(seen: list[dict[str, str]]) -> None:
    """Warnings of the verification and remarks stand in the box itself, and take its green away."""
    doubted = copy.deepcopy(verification(1.0))
    doubted["report"]["findings"] = [restored("the stand is poor").stored()]
    plain = copy.deepcopy(verification(1.0)) | {"report": verification(1.0)["report"] | {"findings": []}}
    clean = record(verification=plain) | {"findings": [], "accepted": None}
    for content in (
        clean,
        clean | {"verification": doubted},
        clean | {"findings": [restored("the sign is assumed").stored()]},
        record(verification=verification(0.01)),
        record(verification=None),
    ):
        certificate_pdf(content)
    colours = [content["conformity_colour"] for content in seen]
    assert colours[0] == "#1a7f37"
    assert colours[1] == colours[2] != colours[0]
    assert len(set(colours)) == 4
    assert "the stand is poor" in seen[1]["conformity"]
    assert "the sign is assumed" in seen[2]["conformity"]


FIELDS: dict[str, Callable[[str], dict[str, Any]]] = {
    "laboratory": lambda text: {"laboratory": replace(LABORATORY, address=text)},
    "customer": lambda text: {"order": replace(ORDER, customer=text)},
    "item": lambda text: {"order": replace(ORDER, serial=text)},
    "traceability": lambda text: {
        "laboratory": replace(LABORATORY, traceability=text),
        "order": replace(ORDER, rig_traceability=text),
    },
    "environment": lambda text: {
        "order": replace(ORDER, environment=text, temperature_degC=None, humidity_percent=None)
    },
    "condition": lambda text: {"order": replace(ORDER, condition=text)},
    "procedure": lambda text: {"laboratory": replace(LABORATORY, procedure=text)},
    "standards": lambda text: {"standards": (*STANDARDS, Standard("T3", text, date(2027, 3, 1)))},
    "signatory": lambda text: {"laboratory": replace(LABORATORY, authoriser=text)},
}
LACKS = {key: given("") for key, given in FIELDS.items()} | {
    "performed": {"order": replace(ORDER, performed_from=None, performed_to=None)},
    "standards_due": {"standards": (Standard("T2", "D-17", date(2026, 5, 3)),)},
}


@pytest.mark.parametrize(("key", "changes"), LACKS.items(), ids=LACKS)
@pytest.mark.parametrize("language", ["en", "ru", "zh"])
def test_it_is_titled_certificate_only_when_nothing_is_missing(seen, key, changes, language) -> None:  # type: ignore[no-untyped-def]
    """ISO/IEC 17025, 7.8: of the same layout, titled report otherwise, and it says which item is stated where."""
    whole, lacking = record(language=language), record(language=language, **changes)
    assert (whole["title"], whole["missing"]) == ("certificate", [])
    assert (lacking["title"], lacking["missing"]) == ("report", [key])
    for content in (whole, lacking):
        certificate_pdf(content)
    say = words(language)
    assert [view["title"] for view in seen] == [say("title"), say("title_report")]
    assert seen[0]["missing"] == []
    (said,) = seen[1]["missing"]
    assert said.startswith(say(f"missing_{key}", names="{}").partition("{")[0][:20])
    if key == "standards_due":
        assert "T2 (2026-05-03)" in said
        assert say("overdue") in dict(seen[1]["facts"]["long"])[say("standards")]
    assert [part["title"] for part in seen[0]["sections"]] == [part["title"] for part in seen[1]["sections"]]


# as people fill a form that asks for more than they know
PLACEHOLDERS = (
    "-", "--", "–", "—", ".", "...", "?", "???", "/", "*", "_", " ", "n/a", "N/A", "n.a.", "NA", "not stated",
    "Not Stated.", "unknown", "UNKNOWN", "(unknown)", "N. N.", "N.N.", "NN", "none", "None", "no", "x", "X", "xxx",
    "tbd", "TBD", "t.b.d.", "to be defined", "null", "-\n-", "n/a\nn/a", "unknown, unknown", "？", "Ｘ",
    "нет", "Нет", "не указано", "НЕ УКАЗАНО", "не указан", "неизвестно", "н/д", "б/н", "отсутствует", "х",
    "无", "未知", "不详", "暂无", "未填写", "待定", "不适用", "无。", "（无）",
    "0", "000", "name", "Name:", "signature", "Signature", "John Doe", "JOHN DOE", "Max Mustermann",
    "подпись", "Ф.И.О.", "签名", "姓名",
)  # fmt: skip
STATED = (
    "Na Li", "A", "7", "0017", "T2", "X-7", "No. 7", "X1", "Norway", "Nonet", "Unknown & Sons", "none the worse",
    "good", "n/a, but sealed", "Нетребко", "х. Северный", "不详路 7 号", "无锡", "TBD-7", "Xavier",
    "00-17", "0-1", "John Dow", "Maximilian Muster", "Signe Names", "Подписнов", "张三丰",
)  # fmt: skip


@pytest.mark.parametrize("key", FIELDS)
def test_a_placeholder_is_as_good_as_nothing(key: str) -> None:
    """A dash, n/a, unknown, in three languages: each earns the title of a report that names what is missing."""

    def lacks(text: str) -> list[str]:
        text = text if key not in ("procedure", "signatory") else ", ".join(text.splitlines())  # fields of one line
        given: dict[str, Any] = {"laboratory": LABORATORY, "order": ORDER, "standards": STANDARDS} | FIELDS[key](text)
        return missing(given["laboratory"], given["order"], given["standards"])

    assert [text for text in PLACEHOLDERS if lacks(text) != [key]] == []
    assert [text for text in STATED if lacks(text)] == []


@pytest.mark.parametrize(("language", "word"), [("en", "limits"), ("ru", "пределы"), ("zh", "限值")])
def test_a_figure_without_limits_is_not_said_to_draw_them(language: str, word: str) -> None:
    for limit, drawn in ((None, False), (1.0, True)):
        section = verification_section(record(verification=verification(limit)), words(language))
        assert {word in figure["caption"] for figure in section["figures"]} == {drawn}


def test_a_document_of_placeholders_is_a_report() -> None:
    """What earned the title of a certificate once: every field filled, nothing said."""
    laboratory = Laboratory("-", "n/a", "XX", authoriser="N. N.", traceability="not stated", procedure=".")
    order = replace(ORDER, customer="?", condition="unknown", environment="tbd", temperature_degC=None)
    made = record(laboratory=laboratory, order=order, standards=(Standard("x", "none", date(9999, 12, 31)),))
    assert made["title"] == "report"
    wanted = "laboratory customer traceability environment condition procedure standards signatory"
    assert made["missing"] == wanted.split()


@pytest.mark.parametrize("code", ["XX", "AA", "ZZ", "QZ", "XA"])
def test_a_country_that_is_none(code: str) -> None:
    """Codes that ISO 3166-1 gives to nobody."""
    assert missing(replace(LABORATORY, country=code), ORDER, STANDARDS) == ["laboratory"]
    for known in ("NO", "QA", "RU", "CN", "XK", "ZA"):
        assert missing(replace(LABORATORY, country=known), ORDER, STANDARDS) == []


@pytest.mark.parametrize(("year", "lacks"), [(9999, ["standards"]), (2047, ["standards"]), (2046, []), (2027, [])])
def test_a_due_date_that_nobody_set(year: int, lacks: list[str]) -> None:
    assert missing(LABORATORY, ORDER, (Standard("T2", "D-17", date(year, 1, 1)),)) == lacks


def test_results_are_what_was_verified(seen: list[dict[str, str]]) -> None:
    """Indication = reference + deviation, as found beside as left, limit and verdict at each position."""
    found = verification(1.0)
    before = copy.deepcopy(found)
    before["verdict"] = "fail"
    for row in before["report"]["positions"]:
        row["inclination"]["error_deg"] += 0.5
    certificate_pdf(record(previous=calibration(2), previous_from="2025-0001", as_found=before))
    table = seen[0]["sections"][0]["tables"][0]  # type: ignore[index]
    assert [span for _, span in table["groups"]] == [6, 6, 6]
    assert len(table["rows"]) == len(found["report"]["positions"]) == 12
    for cells, row in zip(table["rows"], found["report"]["positions"], strict=True):
        reference, old, indication, deviation, u, limit = (float(x.replace("−", "-")) for x in cells[1:7])
        one = row["inclination"]
        step = 0.5 * 10.0 ** -len(cells[4].partition(".")[2])  # half of the last digit
        assert reference == pytest.approx(row["inclination_deg"], abs=0.005)
        assert deviation == pytest.approx(one["error_deg"], abs=step)
        assert old - deviation == pytest.approx(0.5, abs=2.0 * step)
        assert indication == pytest.approx(abs(row["inclination_deg"] + one["error_deg"]), abs=step)
        assert u == pytest.approx(one["U_deg"], rel=0.1)
        assert limit == one["limit_deg"]
        assert cells[-1] == "pass"
    assert "did not keep the limits" in seen[0]["sections"][0]["texts"][1]  # type: ignore[index]


@pytest.mark.parametrize("known", [True, False])
def test_the_budget_adds_up_to_the_table_of_uncertainties(known: bool) -> None:
    """The squares of its causes are the square of U / k, at each inclination, for each angle; by triad in old files."""
    made = calibration() if known else replace(calibration(), shares={})
    content = record(made)["results"]
    table, budget = content["uncertainty"], content["budget"]
    kinds = {(one["cause"], one["kind"]) for one in budget["components"]}
    dials = {("calibration", f"{dial} dial") for dial in ("azimuth", "inclination", "toolface")}
    assert (dials if known else {("calibration", "accelerometer")}) | {("noise", "magnetometer")} <= kinds
    for step, inclination in enumerate(budget["inclination_deg"]):
        place = table["inclination_deg"].index(inclination)
        for name in ("inclination", "azimuth", "toolface"):
            u = np.array([one["u_deg"][name][step] for one in budget["components"]])
            whole = table["coverage_factor"] * np.sqrt(np.sum(np.sign(u) * u**2))
            assert whole == pytest.approx(table[f"U_{name}_deg"][place], rel=1e-9)


def test_the_dials_parts_of_the_budget_are_what_their_errors_do() -> None:
    """Each dial's part once more, attitude by attitude, from the covariance that it brings to the parameters."""
    found = calibration()
    nu = found.freedom
    tool = replace(found.tool, covariance=(nu - 2.0) / nu * found.tool.covariance)
    dip = expected_uncertainty(found).dip
    budget = record()["results"]["budget"]
    parts = {one["kind"]: one["u_deg"] for one in budget["components"] if one["cause"] == "calibration"}
    assert set(parts) == set(found.causes)
    turns = np.radians(np.arange(0.0, 360.0, 360.0 / STEPS))
    noise = np.concatenate([tool.noise[kind] for kind in tool.triads]) ** 2
    for step, inclination in enumerate(np.radians(budget["inclination_deg"])):
        azimuth, toolface = np.meshgrid(turns, turns, indexing="ij")
        g, b = fields(azimuth, np.full(azimuth.shape, inclination), toolface, dip)
        heat = np.full(azimuth.shape, tool_temperature(tool))
        slope = angle_sensitivity(tool, {"accelerometer": g, "magnetometer": b}, heat)
        for place, name in enumerate(("inclination", "azimuth", "toolface")):
            rows = slope.by_parameter[..., place, :].reshape(-1, len(tool.covariance))
            own = np.sum(rows @ tool.covariance * rows, axis=1)
            read = np.sum(slope.by_signal[..., place, :].reshape(len(rows), -1) ** 2 * noise, axis=1)
            worst = int(np.argmax(own + read))
            every = {cause: rows[worst] @ covariance @ rows[worst] for cause, covariance in found.causes.items()}
            for cause, variance in every.items():
                u = np.degrees(np.sqrt(own[worst] * variance / sum(every.values())))
                assert parts[cause][name][step] == pytest.approx(u, rel=1e-6)


@poppler
@pytest.mark.long
@pytest.mark.parametrize("language", ["ru"])
def test_no_page_is_all_but_empty(language: str, tmp_path: Path) -> None:
    """Text or drawings over a quarter of every page of certificates of any length; results on the first."""
    many = copy.deepcopy(verification(1.0))
    many["report"]["positions"] *= 6
    for content in (
        record(language=language),
        record(language=language, verification=None, laboratory=None),
        record(language=language, previous=calibration(2), as_found=verification(1.0)),
        record(language=language, verification=many),
    ):
        file = tmp_path / "c.pdf"
        file.write_bytes(certificate_pdf(content))
        assert words(language)("results") in pages(file.read_bytes(), tmp_path)[0]
        drawn = subprocess.run(["pdftoppm", "-r", "20", "-gray", file], capture_output=True, check=True).stdout
        size = re.match(rb"P5\s(\d+) (\d+)\s255\s", drawn)
        height, wide = int(size[2]), int(size[1])
        sheets = np.frombuffer(b"".join(drawn.split(size[0])[1:]), np.uint8).reshape(-1, height, wide)
        for number, sheet in enumerate(sheets, 1):
            inked = np.flatnonzero(np.any(sheet[: int(0.88 * height)] < 160, axis=1))  # above the foot
            assert inked.max() > 0.35 * height, f"page {number} of {len(sheets)} ends at {inked.max() / height:.2f}"


def test_records_of_every_version_are_read_and_printed_for_ever(seen: list[dict[str, str]]) -> None:
    """One of each version as a program of its time wrote it, to the byte."""
    folder = Path(__file__).parents[2] / "reference" / "certificate"
    for version in (1, 2):
        data = (folder / f"certificate-{version}.json").read_bytes()
        content = checked(json.loads(data), "reference")
        assert content["version"] == version
        assert record_bytes(content) == data
        certificate_pdf(content)
        assert seen[-1]["title"] == "Calibration certificate"
        assert seen[-1]["missing"] == []
        schema = dcc_schema()
        assert schema.validate(etree.fromstring(dcc_bytes(content))), schema.error_log
    for key in ("title", "missing", "standards", "as_found"):
        with refused("input-unknown", error=FileError, names=(f"$.{key}",)):  # keys of a version are frozen
            checked({**json.loads((folder / "certificate-1.json").read_bytes()), key: None}, "reference")


def test_the_sentence_on_the_coverage_factor_names_one_distribution(seen: list[dict[str, str]]) -> None:
    """Where k is Student's, nothing says that it is the normal one's; a certificate of before, with k = 2, does."""
    content = record()
    certificate_pdf(content)
    assert "k is Student's" in json.dumps(seen[0])
    assert "normal distribution" not in json.dumps(seen[0])
    before = copy.deepcopy(content)
    del before["results"]["uncertainty"]["degrees_of_freedom"]
    certificate_pdf(before)
    assert "for a normal distribution" in json.dumps(seen[1])
    assert "Student" not in json.dumps(seen[1])


@pytest.mark.parametrize(
    ("plan", "text"),
    [
        ("24 positions", "; 24 positions"),
        ("cube", "; cube; 24 positions measured"),
        ("orthogonal, 36 positions", "; orthogonal, 36 positions; 24 positions measured"),
    ],
)
def test_a_plan_named_by_its_number_of_positions_says_it_once(seen: list[dict[str, str]], plan: str, text: str) -> None:
    certificate_pdf(record(order=replace(ORDER, plan=plan)))
    (method,) = (said for name, said in seen[0]["facts"]["long"] if "positions" in said)  # type: ignore[index, call-overload]
    assert method.replace("\u200b", "").endswith(text)


def test_the_reservation_of_a_pass_stands_in_the_box(seen: list[dict[str, str]]) -> None:
    """Limits of tens of degrees, which find only a much worse tool."""
    certificate_pdf(record(verification=verification(40.0)))
    box = " ".join(seen[0]["conformity"]).replace("\u200b", "")
    assert (
        str(
            Finding(
                "verify-wide",
                {"angle": "inclination", "limit_deg": 40.0, "usual_deg": 2.0, "remedy": "Give a narrower limit"},
            )
        )
        in box
    )
    assert (
        str(
            Finding(
                "verify-detects-little",
                {
                    "positions": 12,
                    "times": ">100",
                    "remedy": "Agree on narrower limits, or take a pass as a test of these limits only",
                },
            )
        )
        in box
    )
    assert seen[0]["conformity_colour"] == "#8a5a00"


# A verification without agreed limits: no conformity, no limit and no pass, in no document and no language.


WORDS = {
    "en": ("conformity:", "limit ±", "pass", "conforms"),
    "ru": ("Соответствие", "предел ±", "принято", "соответствует"),
    "zh": ("符合性", "限值 ±", "合格"),
}


@pytest.mark.parametrize("language", list(WORDS))
def test_the_paper_compares_and_does_not_judge(seen: list[dict[str, Any]], language: str) -> None:
    """Deviations with U at 95 % and agreement in words; with limits, all of it is there."""
    certificate_pdf(record(verification=verification(None), language=language))
    certificate_pdf(record(verification=verification(1.0), language=language))
    without, judged = ({k: v for k, v in one.items() if k != "qr"} for one in seen)
    texts = json.dumps(without["sections"][0], ensure_ascii=False) + without["conformity_head"]
    for word in WORDS[language][1:]:
        assert word not in texts, word
    assert WORDS[language][1] in json.dumps(judged["sections"], ensure_ascii=False)
    assert WORDS[language][1] not in json.dumps(without["sections"], ensure_ascii=False)
    assert without["conformity_head"] != judged["conformity_head"]
    assert "k = 2" in without["sections"][0]["texts"][0]
    if language == "en":
        assert without["conformity_head"] == "Agreement with the certificate"
        assert without["conformity"][0] == "No limits were agreed: no statement of conformity is made."
        assert "deviations at independent positions are smaller than their expanded" in without["conformity"][1]
        assert without["conformity"][2].startswith("The deviations agree with the certificate: ")


def test_the_digital_certificate_holds_no_conformity() -> None:
    root = etree.fromstring(dcc_bytes(record(verification=verification(None))))
    kinds = {kind for one in root.iter() for kind in str(one.get("refType", "")).split()}
    assert "basic_measurementError" in kinds
    assert not {kind for kind in kinds if "conformity" in kind or "toleranceLimit" in kind}
    assert not root.xpath("//dcc:conformityXMLList | //dcc:conformity", namespaces=root.nsmap)
    factors = root.xpath("//*[local-name()='coverageFactorXMLList']/text()")
    assert max(map(float, " ".join(factors).split())) < 2.3


def test_the_record_states_no_limit_and_no_pass() -> None:
    content = record(verification=verification(None))
    assert content["conformity"]["statement"] == "not assessed"
    assert content["conformity"]["rule"] is None
    held = content["verification"]
    assert (held["limits"], held["verdict"], held["report"]["coverage_factor"]) == (None, "agrees", 2.0)
    cells = [row[name] for row in held["report"]["positions"] for name in ("inclination", "azimuth", "toolface")]
    assert {cell["decision"] for cell in cells} <= {"agrees", "not judged"}
    assert {cell["limit_deg"] for cell in cells} == {None}


# No certificate tells its reader to type an option or a command: the sentences that reach paper name neither.


ROOT = Path(inclinometry.__file__).parent
OPTION = re.compile(r"--[a-z][a-z-]+|`[a-z ]+`")


def sentences(path: Path) -> Iterator[str]:
    """Texts that may become a warning, a note or a reason: no docstrings, nothing that is raised."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    spared = {id(one) for node in ast.walk(tree) if isinstance(node, ast.Raise) for one in ast.walk(node)}
    spared |= {
        id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in spared:
            yield node.value


@pytest.mark.parametrize("path", sorted((ROOT / "calibration").glob("*.py")), ids=lambda path: path.stem)
def test_warnings_of_calibration_and_verification_name_no_option(path: Path) -> None:
    """They stand on paper: remarks, the box, what was found at the verified positions."""
    assert [text for text in sentences(path) if OPTION.search(text)] == []


@pytest.mark.parametrize("language", ["en", "ru", "zh"])
@pytest.mark.parametrize("limit", [None, 1.0, 0.01, 40.0])
def test_no_text_of_a_certificate_names_an_option(
    seen: list[dict[str, Any]], language: str, limit: float | None
) -> None:
    """Of every kind of verification, with all that can be missing."""
    for changes in ({}, {"order": type(ORDER)(issued=ORDER.issued), "laboratory": None}):
        certificate_pdf(record(verification=verification(limit), language=language, **changes))
    for view in seen:
        said = {key: value for key, value in view.items() if key not in ("qr", "missing", "is_report")}
        text = json.dumps(said, ensure_ascii=False).replace("\u200b", "")
        assert not re.findall(r"(?<![\w-])--[a-z][a-z-]+", text)
