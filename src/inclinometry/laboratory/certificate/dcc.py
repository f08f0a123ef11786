"""Digital calibration certificate: PTB's DCC 3.2.1 with D-SI 2.1.0, written from a certificate's record, read back."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from lxml import etree

from inclinometry.arrays import Array
from inclinometry.errors import FileError, refused
from inclinometry.files.json_codec import findings_in
from inclinometry.files.verification_json import as_now
from inclinometry.findings import Finding
from inclinometry.laboratory.certificate.record import adjusted, coverage, defined, record_digest, words
from inclinometry.laboratory.certificate.requirements import missing_said
from inclinometry.uncertainty import coverage_probability

# Units as the D-SI writes them.

DEGREE: Final = r"\degree"


def unit(text: str) -> str | None:
    r"""The D-SI form of a unit of the package; None for one the SI does not know, which a reader must be told.

    >>> unit("mV/K^2")
    '\\milli\\volt\\kelvin\\tothe{-2}'
    """
    main, power = text, 0
    found = re.fullmatch(r"(.+?)/K(?:\^(\d))?", text)
    if found is not None:
        main, power = found[1], int(found[2] or 1)
    units = {
        "counts": r"\one", "V": r"\volt", "mV": r"\milli\volt", "uV": r"\micro\volt", "µV": r"\micro\volt",
        "A": r"\ampere", "mA": r"\milli\ampere", "Hz": r"\hertz", "kHz": r"\kilo\hertz", "T": r"\tesla",
        "mT": r"\milli\tesla", "uT": r"\micro\tesla", "µT": r"\micro\tesla", "nT": r"\nano\tesla",
        "m/s2": r"\metre\second\tothe{-2}", "m/s^2": r"\metre\second\tothe{-2}",
        "rad/s": r"\radian\second\tothe{-1}", "deg/s": r"\degree\second\tothe{-1}",
        "deg/h": r"\degree\hour\tothe{-1}",
    }  # fmt: skip
    known = units.get(main)
    if known is None or not power:
        return known
    heat = rf"\kelvin\tothe{{-{power}}}"
    return heat if known == r"\one" else known + heat


def product(one: str, other: str) -> str:
    r"""The unit of a product.

    >>> product("\\volt", "\\one"), product("\\volt", "\\volt")
    ('\\volt', '\\volt\\volt')
    """
    parts = [part for part in (one, other) if part != r"\one"]
    return "".join(parts) or r"\one"


# The parts of a digital calibration certificate: elements in the order PTB's schema 3.2.1 asks for.

DCC: Final = "https://ptb.de/dcc"
NSMAP: Final = {"dcc": DCC, "si": "https://ptb.de/si"}
ROOT: Final = f"{{{DCC}}}digitalCalibrationCertificate"
PREFIX: Final = "inclinometry_"
"""Of the refTypes that are ours; the others are PTB's."""

Element = Any
Record = Mapping[str, Any]
Coverage: TypeAlias = tuple[float, float, float | None]
"""k, probability and degrees of freedom of expanded uncertainties; None of a normal distribution."""


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


def number(value: float, u: float | None = None) -> str:
    """The shortest decimal that reads back to the same number; with an uncertainty u four digits of that.

    >>> number(0.1 + 0.2), number(26756.123456, 3.81), number(3.8123456, 3.8123456)
    ('0.30000000000000004', '26756.123', '3.812')
    """
    if u is None or not u > 0.0:
        return repr(float(value))
    places = 3 - math.floor(math.log10(u))
    return repr(round(float(value), places))


def factor(k: float) -> str:
    """A coverage factor, without exponent."""
    return f"{k:.9f}".rstrip("0").rstrip(".")


def values(
    parent: Element,
    given: Sequence[float],
    units: Sequence[str],
    names: Sequence[str] = (),
    spread: Sequence[float | None] | None = None,
) -> Element:
    """A list of values with its unit, one for all or one each, to the digits that their `spread` leaves."""
    made = element(parent, "si:realListXMLList")
    if names:
        element(made, "si:labelXMLList", " ".join(names))
    digits = [None] * len(given) if spread is None else spread
    element(made, "si:valueXMLList", " ".join(map(number, given, digits)))
    element(made, "si:unitXMLList", " ".join(units))
    return made


def expanded(made: Element, spread: Sequence[float], covered: Coverage) -> None:
    """Expanded uncertainties of a list."""
    part = element(made, "si:expandedUncXMLList")
    element(part, "si:uncertaintyXMLList", " ".join(map(number, spread, spread)))
    _covered(part, "XMLList", covered[0], covered)


def _covered(part: Element, ending: str, k: float, covered: Coverage) -> None:
    """Coverage factor, probability and distribution, which is one word, since that of a list ends at a blank."""
    element(part, f"si:coverageFactor{ending}", factor(k))
    element(part, f"si:coverageProbability{ending}", f"{covered[1]:.4f}")
    element(part, f"si:distribution{ending}", "normal" if covered[2] is None else "Student-t")


def covariance(made: Element, matrix: Sequence[Sequence[float]], units: Sequence[str], covered: Coverage) -> None:
    """The covariance matrix of a list, as the region that holds all values together."""
    region = element(made, "si:ellipsoidalRegionXMLList")
    whole = element(region, "si:covarianceMatrix")
    for column, first in zip(zip(*matrix, strict=True), units, strict=True):
        place = element(whole, "si:column")
        for value, second in zip(column, units, strict=True):
            cell = element(place, "si:covariance")
            element(cell, "si:value", f"{value:.10g}")
            element(cell, "si:unit", product(first, second))
    _covered(region, "", round(_together(len(units), covered), 4), covered)


def _together(size: int, covered: Coverage) -> float:
    """Factor on the ellipsoid that holds `size` values together; Fisher's for a finite number of degrees of freedom."""
    from scipy.special import fdtri, gammaincinv

    _, probability, freedom = covered
    if freedom is None:
        return math.sqrt(2.0 * float(gammaincinv(size / 2.0, probability)))
    return math.sqrt(size * float(fdtri(size, freedom, probability)))


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


def uncertainty_result(parent: Element, table: Record, covered: Coverage) -> None:
    """U of each angle over inclination."""
    where = "at the worst azimuth and toolface of each inclination"
    about = f"Expanded uncertainty of one reading, {_said(covered)}, {where}."
    data = element(result(parent, "Uncertainty over inclination", "uncertainty", about), "dcc:list")
    made = quantity(data, "inclination", PREFIX + "inclination")
    values(made, table["inclination_deg"], [DEGREE])
    for name in ("inclination", "azimuth", "toolface"):
        if f"U_{name}_deg" in table:
            made = quantity(data, f"expanded uncertainty of {name}", f"{PREFIX}U_{name}")
            values(made, table[f"U_{name}_deg"], [DEGREE], spread=table[f"U_{name}_deg"])
    for block, where, tail in (
        ("from_calibration", "from the calibration alone", "calibration"),
        ("end_of_interval", "at the end of the interval", "end"),
    ):
        for name, u in (table.get(block) or {}).items():
            about = f"expanded uncertainty of {name[2:-4]} {where}"
            values(quantity(data, about, f"{PREFIX}{name[:-4]}_{tail}"), u, [DEGREE], spread=u)


def _said(covered: Coverage) -> str:
    k, probability, freedom = covered
    said = "" if freedom is None else f", {freedom:g} effective degrees of freedom"
    return f"k = {k:g}, coverage probability {round(100.0 * probability, 2):g} %{said}"


def parameter_result(parent: Element, results: Record, covered: Coverage) -> None:
    """Every parameter with its expanded uncertainty, and their covariance matrix."""
    rows = results["parameters"]
    about = "Signal of a sensor = N a + U0 for a field along the unit vector a in tool axes. "
    about += f"Expanded uncertainties: {_said(covered)}."
    data = result(parent, "Parameters of the sensors", "parameters", about)
    made = quantity(data, "tensors and offsets", PREFIX + "parameters")
    _listed(made, rows, covered, results["covariance"]["matrix"])


def _listed(made: Element, rows: Sequence[Record], covered: Coverage, matrix: Sequence[Sequence[float]] = ()) -> None:
    """Values with their expanded uncertainties and covariances where all are known; units that are of no SI."""
    plain = {"deg": DEGREE, "%": r"\percent"}  # units that are of no signals
    found = {row["unit"]: unit(row["unit"]) if matrix else plain.get(row["unit"]) or unit(row["unit"]) for row in rows}
    units, names = [found[row["unit"]] or r"\one" for row in rows], [row["name"].replace(" ", "_") for row in rows]
    spread = [None if row["u"] is None else covered[0] * row["u"] for row in rows]
    listed = values(made, [row["value"] for row in rows], units, names, spread)
    known = [u for u in spread if u is not None]
    if len(known) == len(rows):
        expanded(listed, known, covered)
        if matrix:
            covariance(listed, matrix, units, covered)
    if strange := sorted(name for name, known_as in found.items() if known_as is None):
        meta = element(element(made, "dcc:measurementMetaData"), "dcc:metaData")
        said = f"The unit one stands for units the SI does not know: {', '.join(strange)}"
        english(meta, "dcc:declaration", said)
        element(meta, "dcc:nonSIUnit", ", ".join(strange))


def classical_result(parent: Element, record: Record, covered: Coverage) -> None:
    """Scale, bias and misalignment of each sensor; with a previous calibration before, after and their change."""
    adjustment = record["adjustment"]
    for kind in record["results"]["classical"]:
        rows = adjusted(record, kind)
        about = "" if adjustment is None else f"Before: {adjustment['previous'] or 'not stated'}. "
        about += f"Expanded uncertainties: {_said(covered)}."
        data = result(parent, f"Scale, bias and misalignment, {kind}", f"classical_{kind}", about)
        listed = element(data, "dcc:list")
        for name, place in (("after", 0),) if adjustment is None else (("before", 1), ("after", 0), ("change", 2)):
            known = [one for row in rows if (one := row[place]) is not None and one["value"] is not None]
            if not known:
                continue
            _listed(quantity(listed, "value" if adjustment is None else name, f"{PREFIX}{name}"), known, covered)


def found_result(parent: Element, record: Record, name: str) -> None:
    """Errors of one angle as found: the readings of the verification with the parameters before."""
    report = (record.get("as_found") or {}).get("report")
    if report is None:
        return
    # where an angle is not defined the paper has none either
    rows = [row for row in report["positions"] if defined(row[name])]
    if not rows:
        return
    about = f"The same readings with the parameters before: {record['as_found']['previous'] or 'not stated'}."
    data = element(result(parent, f"{name} as found".capitalize(), f"as_found_{name}", about), "dcc:list")
    made = quantity(data, f"{name} set", "basic_referenceValue")
    values(made, [row[f"{name}_deg"] for row in rows], [DEGREE])
    _errors(data, report, rows, name, f"error of {name} as found")


def _errors(data: Element, report: Record, rows: Sequence[Record], name: str, what: str) -> Element:
    """Errors of one angle against a stand, with their expanded uncertainties."""
    made, k = quantity(data, what, "basic_measurementError"), report["coverage_factor"]
    spread = [row[name]["U_deg"] for row in rows]
    listed = values(made, [row[name]["error_deg"] for row in rows], [DEGREE], spread=spread)
    expanded(listed, spread, (k, coverage_probability(k), None))
    return made


def verification_result(parent: Element, found: Record, name: str) -> None:
    """Errors of one angle at the positions where it was judged; limits and decisions where limits were agreed."""
    report = found["report"]
    rows = [row for row in report["positions"] if row[name]["decision"] != "not judged"]
    if not rows:
        return
    about = "Angle measured by the tool minus angle set."
    data = element(result(parent, f"Verification of {name}", f"verification_{name}", about), "dcc:list")
    for dial in ("azimuth", "inclination", "toolface"):
        made = quantity(data, f"{dial} set", "basic_referenceValue" if dial == name else f"{PREFIX}{dial}_set")
        values(made, [row[f"{dial}_deg"] for row in rows], [DEGREE])
    made = _errors(data, report, rows, name, f"error of {name}")
    if found["limits"] is None:
        return
    meta = element(element(made, "dcc:measurementMetaData"), "dcc:metaData", refType="basic_conformity")
    # decision of a position -> DCC; inconclusive means that a guarded acceptance cannot say pass
    conformity = {"pass": "pass", "fail": "fail", "inconclusive": "noPass"}
    element(meta, "dcc:conformityXMLList", " ".join(conformity[row[name]["decision"]] for row in rows))
    limits = element(meta, "dcc:data")
    for side, sign in (("Lower", -1.0), ("Upper", 1.0)):
        bound = quantity(limits, f"{side.lower()} limit", f"basic_toleranceLimit{side}")
        values(bound, [sign * row[name]["limit_deg"] for row in rows], [DEGREE])


def dcc_bytes(record: Record) -> bytes:
    """A certificate's record as DCC XML; the same record gives the same bytes."""
    laboratory, dates = record["laboratory"], record["dates"]
    needed = {
        "name": laboratory,
        "country": (laboratory or {}).get("country"),
        "performed_from": dates["performed_from"],
    }
    if lost := tuple(what for what, there in needed.items() if not there):
        raise refused("input-missing", {"names": lost})
    root = etree.Element(ROOT, schemaVersion="3.2.1", nsmap=NSMAP)
    parent = element(root, "dcc:administrativeData")
    program, _, release = record["program"].partition(" ")
    software = element(element(parent, "dcc:dccSoftware"), "dcc:software")
    named(software, "dcc:name", program)
    element(software, "dcc:release", release or "unknown")
    element(software, "dcc:type", "application")
    core = element(parent, "dcc:coreData")
    element(core, "dcc:countryCodeISO3166_1", record["laboratory"]["country"])
    element(core, "dcc:usedLangCodeISO639_1", "en")
    element(core, "dcc:mandatoryLangCodeISO639_1", "en")
    element(core, "dcc:uniqueIdentifier", identifier(record, record["number"]))
    names = element(core, "dcc:identifications")
    _identified(names, "calibrationLaboratory", record["number"], "certificate number", "number")
    _identified(names, "calibrationLaboratory", record_digest(record), "SHA-256 of the record", "digest")
    if record["head"]:
        _identified(names, "calibrationLaboratory", record["head"], "head of the ledger at issue", "head")
    if record["customer"]["reference"]:
        _identified(names, "customer", record["customer"]["reference"], "order")
    if dates["received"]:
        element(core, "dcc:receiptDate", dates["received"])
    element(core, "dcc:beginPerformanceDate", dates["performed_from"])
    element(core, "dcc:endPerformanceDate", dates["performed_to"])
    element(core, "dcc:performanceLocation", "laboratory")
    element(core, "dcc:issueDate", dates["issued"])
    if record["supersedes"]:
        change = element(core, "dcc:reportAmendedSubstituted")
        element(change, "dcc:typeOfChange", "substituted")
        element(change, "dcc:replacedUniqueIdentifier", identifier(record, record["supersedes"]))
    item = record["item"]
    listed = element(element(parent, "dcc:items"), "dcc:item")
    named(listed, "dcc:name", item["name"] or "inclinometer")
    if item["manufacturer"]:
        named(element(listed, "dcc:manufacturer"), "dcc:name", item["manufacturer"])
    _identified(element(listed, "dcc:identifications"), "manufacturer", item["serial"] or "not stated", "serial number")
    _people(parent, record)
    _statements(element(parent, "dcc:statements"), record)
    _measurement(element(element(root, "dcc:measurementResults"), "dcc:measurementResult"), record)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)


def identifier(record: Record, number: str) -> str:
    """What identifies a certificate of a laboratory in the whole world: laboratory and number."""
    return f"{record['laboratory']['country']} {record['laboratory']['name']} {number}"


def _identified(parent: Any, issuer: str, value: str, name: str, ref: str = "") -> None:
    made = element(parent, "dcc:identification", **({"refType": PREFIX + ref} if ref else {}))
    element(made, "dcc:issuer", issuer)
    element(made, "dcc:value", value)
    english(made, "dcc:name", name)


def _people(parent: Any, record: Record) -> None:
    laboratory, customer = record["laboratory"], record["customer"]
    issuer = element(parent, "dcc:calibrationLaboratory")
    if laboratory["accreditation"]:
        element(issuer, "dcc:calibrationLaboratoryCode", laboratory["accreditation"])
    contact = element(issuer, "dcc:contact")
    named(contact, "dcc:name", laboratory["name"])
    for tag, key in (("eMail", "email"), ("phone", "phone")):
        if laboratory[key]:
            element(contact, f"dcc:{tag}", laboratory[key])
    where = element(contact, "dcc:location")
    element(where, "dcc:countryCode", laboratory["country"])
    _lines(where, laboratory["address"])
    person = element(element(parent, "dcc:respPersons"), "dcc:respPerson")
    named(element(person, "dcc:person"), "dcc:name", laboratory["authoriser"] or "not stated")
    if laboratory["authoriser_role"]:
        element(person, "dcc:role", laboratory["authoriser_role"])
    element(person, "dcc:mainSigner", "true")
    who = element(parent, "dcc:customer")
    named(who, "dcc:name", customer["name"] or "not stated")
    _lines(element(who, "dcc:location"), customer["address"] or "not stated")


def _lines(parent: Any, text: str) -> None:
    lines = [line for line in text.split("\n") if line.strip()]
    if lines:
        further = element(parent, "dcc:further")
        for line in lines:
            element(further, "dcc:content", line)


def _statements(parent: Any, record: Record) -> None:
    only_item = "The results relate only to the item calibrated, at the time of calibration."
    english(element(parent, "dcc:statement"), "dcc:declaration", only_item)
    if record.get("missing"):
        lacking = "; ".join(missing_said(key, record, words("en")) for key in record["missing"])
        said = f"{words('en')('is_report')} {lacking}."
        english(element(parent, "dcc:statement"), "dcc:declaration", said)
    if record["item"]["condition"]:
        made = element(parent, "dcc:statement")
        english(made, "dcc:name", "condition of the item")
        named(made, "dcc:declaration", record["item"]["condition"])
    method = record["method"]
    traced = (("", record["laboratory"]["traceability"]), (method["rig"] or "rig", method.get("rig_traceability")))
    for name, text in traced:
        if text:
            made = element(parent, "dcc:statement", refType="basic_traceability")
            if name:
                named(made, "dcc:name", name)
            named(made, "dcc:declaration", text)
    if record.get("accepted"):
        made = element(parent, "dcc:statement")
        english(made, "dcc:name", "warnings and who accepted them")
        about = record["accepted"]
        signed = words("en")("accepted_by", **{**about, "by": about["by"] or "not stated"})
        english(made, "dcc:declaration", "; ".join([*map(str, findings_in(about)), signed]))
    if record["interval_months"] is not None:
        made = element(parent, "dcc:statement", refType="basic_recalibration")
        english(made, "dcc:declaration", "Interval agreed with the customer.")
        element(made, "dcc:period", f"P{record['interval_months']}M")
    rules = {
        "simple": ("JCGM 106:2012", "8.2", "Simple acceptance."),
        "guarded": ("JCGM 106:2012", "8.3", "Guarded acceptance, guard band U."),
    }
    rule = rules.get(str(record["conformity"]["rule"]))
    if rule is not None:
        limits = record["verification"]["limits"]
        made = element(parent, "dcc:statement", refType="basic_conformity")
        element(made, "dcc:norm", rule[0])
        element(made, "dcc:reference", rule[1])
        named(
            made, "dcc:declaration", f"{rule[2]} Limits: {limits['name']}. Source: {limits['source']}{_scope(record)}"
        )
        element(made, "dcc:conformity", record["conformity"]["statement"])


def _scope(record: Record) -> str:
    """The protocol, and to which angles and inclinations a statement of conformity applies."""
    judged, protocol = record["conformity"].get("judged", {}), as_now(record["verification"])["report"].get("protocol")
    said = ". Protocol: {name}, {positions_captured} of {positions} positions".format(**protocol) if protocol else ""
    parts = [
        "{} at {} positions, inclination {:g} to {:g} deg".format(name, one["positions"], *one["inclination_deg"])
        for name, one in judged.items()
    ]
    return f"{said}. Applies to: {'; '.join(parts) or 'nothing'}."


def _measurement(parent: Any, record: Record) -> None:
    method = record["method"]
    english(parent, "dcc:name", "Calibration of an inclinometer")
    used = element(element(parent, "dcc:usedMethods"), "dcc:usedMethod")
    english(used, "dcc:name", words("en").method(method["name"]))
    about = f"Plan: {method['plan'] or 'not stated'}; positions: {method['positions']}"
    procedure = (record["laboratory"] or {}).get("procedure")
    named(used, "dcc:description", f"Procedure: {procedure}. {about}" if procedure else about)
    standards = record.get("standards", [])
    if method["rig"] or standards:
        equipment = element(parent, "dcc:measuringEquipments")
        if method["rig"]:
            named(element(equipment, "dcc:measuringEquipment"), "dcc:name", method["rig"])
        for one in standards:
            made = element(equipment, "dcc:measuringEquipment")
            named(made, "dcc:name", one["name"])
            known = ((one["certificate"], "certificate number"), (one["due"], "due date of its calibration"))
            stated = [(value, name) for value, name in known if value]
            if stated:
                names = element(made, "dcc:identifications")
                for value, name in stated:
                    _identified(names, "other", value, name)
    _conditions(parent, record["environment"])
    results, covered = element(parent, "dcc:results"), coverage(record)
    if record["results"]["uncertainty"] is not None:
        uncertainty_result(results, record["results"]["uncertainty"], covered)
    parameter_result(results, record["results"], covered)
    classical_result(results, record, covered)
    if record["verification"] is not None:
        for name in ("inclination", "azimuth", "toolface"):
            verification_result(results, record["verification"], name)
            found_result(results, record, name)


def _conditions(parent: Any, about: Record) -> None:
    kinds = (
        ("temperature", "temperature_degC", r"\degreecelsius"),
        ("humidityRelative", "humidity_percent", r"\percent"),
    )
    known = [kind for kind in kinds if about[kind[1]] is not None]
    if not known:
        return
    listed = element(parent, "dcc:influenceConditions")
    for name, key, unit in known:
        made = element(listed, "dcc:influenceCondition", refType=f"basic_{name}")
        english(made, "dcc:name", "temperature" if name == "temperature" else "relative humidity")
        data = element(made, "dcc:data")
        for side, value in zip(("Min", "Max"), about[key], strict=True):
            one = quantity(data, side.lower(), f"basic_{name}{side}")
            real = element(one, "si:real")
            element(real, "si:value", number(value))
            element(real, "si:unit", unit)


class Dcc(NamedTuple):
    """The numbers of a DCC that this package wrote.

    number, digest : of the certificate and its record.
    uncertainty : "inclination", "U_inclination", "U_azimuth", "U_toolface" -> (n,) deg.
    parameters : name -> (value, expanded uncertainty or NaN). covariance : (p, p) of them, or empty.
    errors : angle -> (n, 2) error and expanded uncertainty at the judged positions, deg.
    """

    number: str
    digest: str
    serial: str
    uncertainty: dict[str, Array]
    parameters: dict[str, tuple[float, float]]
    covariance: Array
    errors: dict[str, Array]


def dcc_root(data: bytes, where: str | Path = "certificate.xml") -> Element:
    """The root of a digital certificate; entities and everything outside the file are refused.

    Raises FileError: not XML, not a DCC.
    """
    largest = 50_000_000
    if len(data) > largest:
        raise FileError(Finding("file-large", {"what": "bytes", "size": len(data), "most": largest}), path=where)
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
    try:
        root = etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        about = {"format": "XML", "reason": str(error.msg)}
        raise FileError(Finding("file-format", about), path=where) from None
    if root.tag != ROOT or root.getroottree().docinfo.internalDTD is not None:
        raise FileError(Finding("certificate-not-one"), path=where)
    return root


def read_dcc(data: bytes, where: str | Path = "certificate.xml") -> Dcc:
    """Read the numbers back, each from its one place below the root.

    Raises FileError: not XML, not a DCC, not written by this package, one certificate inside of another.
    """
    root = dcc_root(data, where)
    if len([*root.iter(ROOT)]) != 1:
        raise FileError(Finding("certificate-not-one"), path=where)
    try:
        return _numbers(root)
    except (IndexError, ValueError) as error:
        about = {"format": "inclinometry DCC", "reason": str(error)}
        raise FileError(Finding("file-format", about), path=where) from None


def _numbers(root: Element) -> Dcc:
    # nothing is looked for at any depth: what a user hides elsewhere in the file is not read
    core, results = "dcc:administrativeData/dcc:coreData", "dcc:measurementResults/dcc:measurementResult/dcc:results"

    def find(path: str, below: Element = root) -> list[Element]:
        found: list[Element] = below.xpath(path, namespaces=NSMAP)
        if len(found) > 1:
            raise ValueError(f"{len(found)} of {path}")
        return found

    def text(path: str, below: Element = root) -> str:
        # the whole of it: a comment cuts a text in two
        return str(find(path, below)[0].xpath("string()"))

    def listed(path: str, below: Element = root) -> Array:
        return np.array(text(path, below).split(), dtype=float)

    def identified(ref: str) -> str:
        return text(f"{core}/dcc:identifications/dcc:identification[@refType='{PREFIX}{ref}']/dcc:value")

    table = {}
    for name in ("inclination", "U_inclination", "U_azimuth", "U_toolface"):
        path = f"{results}/dcc:result[@refType='{PREFIX}uncertainty']/dcc:data/dcc:list"
        path += f"/dcc:quantity[@refType='{PREFIX}{name}']/si:realListXMLList/si:valueXMLList"
        if find(path):
            table[name] = listed(path)
    path = f"{results}/dcc:result[@refType='{PREFIX}parameters']/dcc:data"
    block = find(f"{path}/dcc:quantity[@refType='{PREFIX}parameters']/si:realListXMLList")[0]
    names, values = text("si:labelXMLList", block).split(), listed("si:valueXMLList", block)
    spread = np.full(len(names), np.nan)
    if find("si:expandedUncXMLList", block):
        spread = listed("si:expandedUncXMLList/si:uncertaintyXMLList", block)
    cells = block.xpath("si:ellipsoidalRegionXMLList/si:covarianceMatrix/si:column/si:covariance", namespaces=NSMAP)
    size = len(names) if cells else 0
    errors = {}
    for name in ("inclination", "azimuth", "toolface"):
        path = f"{results}/dcc:result[@refType='{PREFIX}verification_{name}']/dcc:data/dcc:list"
        rows = find(f"{path}/dcc:quantity[@refType='basic_measurementError']/si:realListXMLList")
        if rows:
            spreads = listed("si:expandedUncXMLList/si:uncertaintyXMLList", rows[0])
            errors[name] = np.stack([listed("si:valueXMLList", rows[0]), spreads], axis=1)
    return Dcc(
        identified("number"),
        identified("digest"),
        text("dcc:administrativeData/dcc:items/dcc:item/dcc:identifications/dcc:identification/dcc:value"),
        table,
        {n: (float(v), float(s)) for n, v, s in zip(names, values, spread, strict=True)},
        np.array([float(text("si:value", cell)) for cell in cells]).reshape(size, size).T,  # written column by column
        errors,
    )
