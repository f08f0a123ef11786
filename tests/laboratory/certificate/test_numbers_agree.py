"""Every number of the paper is that of the digital certificate, with one k and one probability."""

from __future__ import annotations

import copy
import re
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import pytest
import scipy.stats
from lxml import etree

from inclinometry.calibration import plans
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.constants import VECTORS
from inclinometry.laboratory.certificate.dcc import PREFIX, dcc_bytes
from inclinometry.laboratory.certificate.pdf import certificate_pdf
from inclinometry.laboratory.certificate.record import certificate_record, words

from .certificates import LABORATORY, ORDER, STANDARDS, calibration, dcc_schema, readings, verification
from .pdf_text import texts

ANGLES = ("inclination", "azimuth", "toolface")
CELL = re.compile(r"(?:([+-]?[\d.]+) ± ([\d.]+)|–)")


def previous(*, stated: bool) -> Any:
    """An earlier calibration of the tool; without the strengths of its fields where they are not `stated`."""
    found = calibration(2)
    if stated:
        return found
    triads = {kind: replace(triad, field_strength=None) for kind, triad in found.tool.triads.items()}
    return replace(found, tool=replace(found.tool, triads=triads))


def certificate(language: str, *, stated: bool = True) -> dict[str, Any]:
    before = copy.deepcopy(verification())
    for row in before["report"]["positions"]:
        for name in ANGLES:
            if row[name]["error_deg"] is not None:
                row[name]["error_deg"] += 0.1
    # noise and dials are told by twelve positions: few degrees of freedom
    now = calibrate_joint(readings(plans.twelve(), 3), name="IN-7")
    return certificate_record(
        now, LABORATORY, replace(ORDER, interval_months=12), number="2026-0001", program="inclinometry 0",
        language=language, standards=STANDARDS, verification=verification(), as_found=before,
        previous=previous(stated=stated), previous_from="2025-0001", accept_warnings="wide limits are the customer's",
    )  # fmt: skip


class Dcc:
    """Lists of numbers of a digital certificate."""

    def __init__(self, content: dict[str, Any]) -> None:
        self._root = etree.fromstring(dcc_bytes(content))
        assert dcc_schema().validate(self._root), dcc_schema().error_log

    def find(self, result: str, ref: str, what: str) -> list[str]:
        path = f"//dcc:result[@refType='{PREFIX}{result}']//dcc:quantity[@refType='{ref}']"
        path += f"/si:realListXMLList//si:{what}/text()"
        return " ".join(self._root.xpath(path, namespaces=self._root.nsmap)).split()

    def numbers(self, result: str, ref: str, what: str = "valueXMLList") -> list[float]:
        return [float(x) for x in self.find(result, ref, what)]

    def pairs(self, result: str, ref: str) -> list[tuple[float, float]]:
        """Each value with its expanded uncertainty."""
        values = self.numbers(result, ref), self.numbers(result, ref, "uncertaintyXMLList")
        return list(zip(*values, strict=True))

    def every(self, what: str) -> set[str]:
        return set(" ".join(self._root.xpath(f"//si:{what}/text()", namespaces=self._root.nsmap)).split())


def plain(text: str) -> str:
    return text.replace("−", "-")


def paper(content: dict[str, Any]) -> list[str]:
    """The texts of a certificate; those in Russian have a decimal comma, which is read as a point."""
    said = texts(certificate_pdf(content))
    if content["language"] != "ru":
        return said
    assert not [text for text in said if re.fullmatch(r"[-+−±\d.,° ]*\d\.\d[-+−±\d.,° ]*", text)]
    return [re.sub(r"(?<=\d),(?=\d)", ".", text) for text in said]


def between(said: Sequence[str], first: str, last: str = "\0") -> list[str]:
    """The texts behind `first`, up to `last`."""
    start = max(n for n, text in enumerate(said) if text.startswith(first))
    rest = list(said[start + 1 :])
    return rest[: next((n for n, text in enumerate(rest) if text.startswith(last)), len(rest))]


def same(printed: str, number: float) -> None:
    """A printed number is this one, within a digit of its last place."""
    assert float(plain(printed)) == pytest.approx(number, abs=1.001 * 10.0 ** -len(printed.partition(".")[2])), printed


def cells(said: Sequence[str]) -> list[re.Match[str]]:
    """The cells "value ± U" and those without a value."""
    return [found for text in said if (found := CELL.fullmatch(plain(text)))]


def compared(shown: Sequence[re.Match[str]], given: Sequence[tuple[float, float] | None]) -> None:
    assert len(shown) == len(given)
    for cell, pair in zip(shown, given, strict=True):
        assert (cell[1] is None) == (pair is None)
        if pair is not None:
            same(cell[1], pair[0])
            same(cell[2], pair[1])


@cache
def documents(language: str) -> tuple[dict[str, Any], Dcc, list[str]]:
    """A record, its digital certificate and the texts of its paper."""
    content = certificate(language)
    return content, Dcc(content), paper(content)


LANGUAGES = pytest.mark.parametrize("language", ["en", "ru"])


@LANGUAGES
def test_parameters_of_both_documents(language: str) -> None:
    """Each value and U; before, after and change, which belong together."""
    _, dcc, said = documents(language)
    say = words(language)
    shown = cells(between(said, say("parameters"), say("adjustment")))
    compared(shown, dcc.pairs("parameters", f"{PREFIX}parameters"))
    tables = between(said, say("adjustment"), say("inputs"))
    captions = [say("classical", triad=say(kind)) for kind in VECTORS]
    for kind, caption, following in zip(VECTORS, captions, [captions[1], "\0"], strict=True):
        columns = [dcc.pairs(f"classical_{kind}", PREFIX + name) for name in ("before", "after", "change")]
        rows = list(zip(*columns, strict=True))
        compared(cells(between(tables, caption, following)), [pair for row in rows for pair in row])
        for before, after, change in rows:
            assert after[0] - before[0] == pytest.approx(change[0], abs=2e-3 * change[1])
            assert change[1] ** 2 == pytest.approx(before[1] ** 2 + after[1] ** 2, rel=5e-3)


@LANGUAGES
def test_uncertainty_over_inclination_of_both_documents(language: str) -> None:
    """Of one reading, from the calibration alone, at the end of the interval."""
    content, dcc, said = documents(language)
    say, k = words(language), content["results"]["coverage"]["factor"]
    lists = [dcc.numbers("uncertainty", f"{PREFIX}inclination")]
    for tail in ("", "_calibration", "_end"):
        lists += [dcc.numbers("uncertainty", f"{PREFIX}U_{name}{tail}") for name in ANGLES]
    table = between(said, f"U, k = {k:g}")
    table = [text for text in table if re.fullmatch(r"[\d.]+", text) or text == say("undefined")]
    numbers = [number for row in zip(*lists, strict=True) for number in row]
    for printed, number in zip(table[: len(numbers)], numbers, strict=True):
        if printed == say("undefined"):
            assert number > 60.0
        else:
            same(printed, number)


@LANGUAGES
def test_results_of_both_documents(language: str) -> None:
    """Reference, deviation as found, indication, deviation and U at every verified position."""
    content, dcc, said = documents(language)
    say, ref = words(language), "basic_measurementError"
    table = between(between(said, say("results_found")), say("result"))
    as_found = {name: dcc.pairs(f"as_found_{name}", ref) for name in ANGLES}
    as_left = {name: dcc.pairs(f"verification_{name}", ref) for name in ANGLES}
    for place, position in enumerate(content["verification"]["report"]["positions"]):
        row = table[20 * place : 20 * place + 20]
        assert row[0] == str(place + 1)
        for at, name in enumerate(ANGLES):
            reference, old, indication, deviation, u = row[1 + 6 * at : 6 + 6 * at]
            if deviation == "–":
                continue
            (error, spread), setting = as_left[name].pop(0), position[f"{name}_deg"]
            same(reference, setting)
            same(old, as_found[name].pop(0)[0])
            same(deviation, error)
            same(u, spread)
            same(indication, abs(setting + error) if name == "inclination" else (setting + error) % 360.0)
    assert not any(as_left.values())


@LANGUAGES
def test_one_coverage_factor_in_texts_tables_and_digital_certificate(language: str) -> None:
    """k of the calibration and k of the comparison with the stand, each with 95.45 %; Student's where nu is finite."""
    content, dcc, said = documents(language)
    text, own = " ".join(" ".join(said).split()), content["results"]["coverage"]
    stand = content["verification"]["report"]["coverage_factor"]
    # 72 readings less 24 parameters and 36 settings are 12; errors that no reading shows are not estimated
    assert 10.0 <= own["degrees_of_freedom"] <= 60.0
    assert own["factor"] == round(scipy.stats.t(own["degrees_of_freedom"]).ppf(0.5 + 0.5 * 0.9545), 2)
    assert {float(k) for k in re.findall(r"k = ([\d.]+\d|\d)", text)} == {own["factor"], stand}
    assert dcc.every("coverageFactorXMLList") == {f"{own['factor']:g}", f"{stand:g}"}
    assert dcc.every("coverageProbabilityXMLList") == dcc.every("coverageProbability") == {"0.9545"}
    assert set(re.findall(r"95[.\d]*(?= %)", text)) == {"95.45"}
    for ref in ("before", "after", "change"):
        assert dcc.find("classical_magnetometer", PREFIX + ref, "coverageFactorXMLList") == [f"{own['factor']:g}"]
        assert dcc.find("classical_magnetometer", PREFIX + ref, "distributionXMLList") == ["Student-t"]
    assert dcc.find("parameters", f"{PREFIX}parameters", "distributionXMLList") == ["Student-t"]
    # U = k u in the record, and in the budget as it is printed
    for row, u in zip(
        content["results"]["parameters"],
        dcc.numbers("parameters", f"{PREFIX}parameters", "uncertaintyXMLList"),
        strict=True,
    ):
        assert own["factor"] * row["u"] == pytest.approx(u, rel=5e-4)
    say = words(language)
    steps = len(ANGLES) * len(content["results"]["budget"]["inclination_deg"])
    budget = [text for text in between(said, say("budget"), say("uncertainty")) if re.fullmatch(r"[\d.]+", text)]
    combined, expanded = budget[-2 * steps : -steps], budget[-steps:]
    for u, whole in zip(combined, expanded, strict=True):
        assert float(whole) == pytest.approx(own["factor"] * float(u), rel=0.1)


@LANGUAGES
def test_without_a_stated_field_nothing_is_said_of_the_scale_before(language: str) -> None:
    """Paper and digital certificate have what compares: ratios of the scales, offsets as signals, directions."""
    content = certificate(language, stated=False)
    dcc, said, say = Dcc(content), paper(content), words(language)
    tables = between(said, say("adjustment"), say("inputs"))
    caption = say("classical", triad=say("magnetometer"))
    shown = cells(between(tables, caption))
    names = {
        ref: dcc.find("classical_magnetometer", PREFIX + ref, "labelXMLList") for ref in ("before", "after", "change")
    }
    assert names["before"] == names["change"]
    assert {"x_scale", "y_bias"} & set(names["before"]) == set()
    assert {"x_scale_to_the_mean", "y_offset", "z_toward_x"} <= set(names["before"])
    by_name = {
        ref: dict(zip(names[ref], dcc.pairs("classical_magnetometer", PREFIX + ref), strict=True)) for ref in names
    }
    columns = [by_name[ref].get(name) for name in names["after"] for ref in ("before", "after", "change")]
    compared(shown, columns)
