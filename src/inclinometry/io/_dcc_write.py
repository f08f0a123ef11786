"""The parts of a digital calibration certificate: elements in the order PTB's schema 3.2.1 asks for."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

from lxml import etree

from inclinometry.io._dcc_units import DEGREE, product, unit

DCC: Final = "https://ptb.de/dcc"
SI: Final = "https://ptb.de/si"
NSMAP: Final = {"dcc": DCC, "si": SI}
PREFIX: Final = "inclinometry_"
"""Of the refTypes that are ours; the others are PTB's."""

Element = Any
Record = Mapping[str, Any]


def element(parent: Element, name: str, text: str | None = None, **attributes: str) -> Element:
    """A new child; `name` as "dcc:item", text with single blanks."""
    prefix, _, local = name.partition(":")
    made = etree.SubElement(parent, f"{{{NSMAP[prefix]}}}{local}", attributes)
    if text is not None:
        made.text = " ".join(text.split())
    return made


def named(parent: Element, name: str, text: str, *, lang: str | None = None, **attributes: str) -> Element:
    """A child with content in it, for texts that a person reads."""
    made = element(parent, name, **attributes)
    element(made, "dcc:content", text, **({} if lang is None else {"lang": lang}))
    return made


def english(parent: Element, name: str, text: str) -> Element:
    """One of our own fixed texts."""
    return named(parent, name, text, lang="en")


def number(value: float) -> str:
    """The shortest decimal that reads back to the same number."""
    return repr(float(value))


def factor(k: float) -> str:
    """A coverage factor, without exponent."""
    return f"{k:.9f}".rstrip("0").rstrip(".")


def values(parent: Element, given: Sequence[float], units: Sequence[str], names: Sequence[str] = ()) -> Element:
    """A list of values with its unit, one for all or one each."""
    made = element(parent, "si:realListXMLList")
    if names:
        element(made, "si:labelXMLList", " ".join(names))
    element(made, "si:valueXMLList", " ".join(map(number, given)))
    element(made, "si:unitXMLList", " ".join(units))
    return made


def expanded(made: Element, spread: Sequence[float], k: float) -> None:
    """Expanded uncertainties of a list."""
    part = element(made, "si:expandedUncXMLList")
    element(part, "si:uncertaintyXMLList", " ".join(map(number, spread)))
    element(part, "si:coverageFactorXMLList", factor(k))
    element(part, "si:coverageProbabilityXMLList", f"{math.erf(k / math.sqrt(2.0)):.4f}")
    element(part, "si:distributionXMLList", "normal")


def covariance(made: Element, matrix: Sequence[Sequence[float]], units: Sequence[str]) -> None:
    """The covariance matrix of a list, as the region that holds all values together with 95 %."""
    from scipy.special import gammaincinv

    region = element(made, "si:ellipsoidalRegionXMLList")
    whole = element(region, "si:covarianceMatrix")
    for column, first in zip(zip(*matrix, strict=True), units, strict=True):
        place = element(whole, "si:column")
        for value, second in zip(column, units, strict=True):
            cell = element(place, "si:covariance")
            element(cell, "si:value", number(value))
            element(cell, "si:unit", product(first, second))
    k = math.sqrt(2.0 * float(gammaincinv(len(units) / 2.0, 0.95)))
    element(region, "si:coverageFactor", factor(k))
    element(region, "si:coverageProbability", "0.95")
    element(region, "si:distribution", "normal")


def quantity(parent: Element, name: str, ref: str) -> Element:
    """A quantity with its name."""
    made = element(parent, "dcc:quantity", refType=ref)
    english(made, "dcc:name", name)
    return made


def result(parent: Element, name: str, ref: str, description: str = "") -> Element:
    """A result; returns where its data go."""
    made = element(parent, "dcc:result", refType=PREFIX + ref)
    english(made, "dcc:name", name)
    if description:
        english(made, "dcc:description", description)
    return element(made, "dcc:data")


def uncertainty_result(parent: Element, table: Record) -> None:
    """U of each angle over inclination."""
    k = table["coverage_factor"]
    about = f"Expanded uncertainty of one reading, k = {k:g}, at the worst azimuth and toolface of each inclination."
    data = element(result(parent, "Uncertainty over inclination", "uncertainty", about), "dcc:list")
    made = quantity(data, "inclination", PREFIX + "inclination")
    values(made, table["inclination_deg"], [DEGREE])
    for name in ("inclination", "azimuth", "toolface"):
        if f"U_{name}_deg" in table:
            made = quantity(data, f"expanded uncertainty of {name}", f"{PREFIX}U_{name}")
            values(made, table[f"U_{name}_deg"], [DEGREE])


def parameter_result(parent: Element, results: Record) -> None:
    """Every parameter with its expanded uncertainty, and their covariance matrix."""
    rows = results["parameters"]
    known = [unit(row["unit"]) for row in rows]
    strange = sorted({row["unit"] for row, found in zip(rows, known, strict=True) if found is None})
    units = [r"\one" if found is None else found for found in known]
    about = "Signal of a sensor = N a + U0 for a field along the unit vector a in tool axes."
    data = result(parent, "Parameters of the sensors", "parameters", about)
    made = quantity(data, "tensors and offsets", PREFIX + "parameters")
    listed = values(made, [row["value"] for row in rows], units, [row["name"] for row in rows])
    if all(row["u"] is not None for row in rows):
        expanded(listed, [2.0 * row["u"] for row in rows], 2.0)
        covariance(listed, results["covariance"]["matrix"], units)
    if strange:
        meta = element(element(made, "dcc:measurementMetaData"), "dcc:metaData")
        said = f"The unit one stands for units the SI does not know: {', '.join(strange)}"
        english(meta, "dcc:declaration", said)
        element(meta, "dcc:nonSIUnit", ", ".join(strange))


CONFORMITY: Final = {"pass": "pass", "fail": "fail", "inconclusive": "noPass"}
"""Decision of a position -> DCC; inconclusive means that a guarded acceptance cannot say pass."""


def verification_result(parent: Element, found: Record, name: str) -> None:
    """Errors of one angle at the positions where it was judged, with limits and decisions."""
    report = found["report"]
    rows = [row for row in report["positions"] if row[name]["decision"] != "not judged"]
    if not rows:
        return
    about = "Angle measured by the tool minus angle set."
    data = element(result(parent, f"Verification of {name}", f"verification_{name}", about), "dcc:list")
    for dial in ("azimuth", "inclination", "toolface"):
        made = quantity(data, f"{dial} set", "basic_referenceValue" if dial == name else f"{PREFIX}{dial}_set")
        values(made, [row[f"{dial}_deg"] for row in rows], [DEGREE])
    made = quantity(data, f"error of {name}", "basic_measurementError")
    listed = values(made, [row[name]["error_deg"] for row in rows], [DEGREE])
    expanded(listed, [row[name]["U_deg"] for row in rows], report["coverage_factor"])
    meta = element(element(made, "dcc:measurementMetaData"), "dcc:metaData", refType="basic_conformity")
    element(meta, "dcc:conformityXMLList", " ".join(CONFORMITY[row[name]["decision"]] for row in rows))
    limits = element(meta, "dcc:data")
    for side, sign in (("Lower", -1.0), ("Upper", 1.0)):
        bound = quantity(limits, f"{side.lower()} limit", f"basic_toleranceLimit{side}")
        values(bound, [sign * row[name]["limit_deg"] for row in rows], [DEGREE])
