"""Digital calibration certificate: PTB's DCC 3.2.1 with D-SI 2.1.0, written from a certificate's record, read back."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from lxml import etree

from inclinometry.core.arrays import Array
from inclinometry.core.errors import FileError, InputError
from inclinometry.io import _dcc_write as part
from inclinometry.io._dcc_write import DCC, NSMAP, PREFIX, element, english, named
from inclinometry.io.certificate_json import record_digest

SCHEMA_VERSION: Final = "3.2.1"
LARGEST: Final = 50_000_000
_RULES: Final = {
    "simple": ("JCGM 106:2012", "8.2", "Simple acceptance."),
    "guarded": ("JCGM 106:2012", "8.3", "Guarded acceptance, guard band U."),
}
ONLY_ITEM: Final = "The results relate only to the item calibrated, at the time of calibration."

Record = Mapping[str, Any]


def dcc_bytes(record: Record) -> bytes:
    """A certificate's record as DCC XML; the same record gives the same bytes.

    Parameters
    ----------
    record : mapping
        As `inclinometry.report.certificate_record.certificate_record` makes it.

    Raises
    ------
    InputError
        No laboratory, no country or no date of the work, which every DCC states.
    """
    laboratory, dates = record["laboratory"], record["dates"]
    lost = [
        what
        for what, there in (
            ("the laboratory", laboratory),
            ("the laboratory's country", (laboratory or {}).get("country")),
            ("the date of the calibration (performed_from)", dates["performed_from"]),
        )
        if not there
    ]
    if lost:
        raise InputError(f"a digital certificate states {lost[0]}; give it in lab.toml (--laboratory)")
    root = etree.Element(f"{{{DCC}}}digitalCalibrationCertificate", schemaVersion=SCHEMA_VERSION, nsmap=NSMAP)
    _administration(element(root, "dcc:administrativeData"), record)
    _measurement(element(element(root, "dcc:measurementResults"), "dcc:measurementResult"), record)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)


def identifier(record: Record, number: str) -> str:
    """What identifies a certificate of a laboratory in the whole world: laboratory and number."""
    return f"{record['laboratory']['country']} {record['laboratory']['name']} {number}"


def _administration(parent: Any, record: Record) -> None:
    program, _, release = record["program"].partition(" ")
    software = element(element(parent, "dcc:dccSoftware"), "dcc:software")
    named(software, "dcc:name", program)
    element(software, "dcc:release", release or "unknown")
    element(software, "dcc:type", "application")
    _core(element(parent, "dcc:coreData"), record)
    item = record["item"]
    listed = element(element(parent, "dcc:items"), "dcc:item")
    named(listed, "dcc:name", item["name"] or "inclinometer")
    if item["manufacturer"]:
        named(element(listed, "dcc:manufacturer"), "dcc:name", item["manufacturer"])
    _identified(element(listed, "dcc:identifications"), "manufacturer", item["serial"] or "not stated", "serial number")
    _people(parent, record)
    _statements(element(parent, "dcc:statements"), record)


def _core(core: Any, record: Record) -> None:
    dates = record["dates"]
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


def _identified(parent: Any, issuer: str, value: str, name: str, ref: str = "") -> None:
    made = element(parent, "dcc:identification", **({"refType": PREFIX + ref} if ref else {}))
    element(made, "dcc:issuer", issuer)
    element(made, "dcc:value", value)
    english(made, "dcc:name", name)


def _people(parent: Any, record: Record) -> None:
    laboratory, customer = record["laboratory"], record["customer"]
    house = element(parent, "dcc:calibrationLaboratory")
    if laboratory["accreditation"]:
        element(house, "dcc:calibrationLaboratoryCode", laboratory["accreditation"])
    contact = element(house, "dcc:contact")
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
    english(element(parent, "dcc:statement"), "dcc:declaration", ONLY_ITEM)
    if record["item"]["condition"]:
        made = element(parent, "dcc:statement")
        english(made, "dcc:name", "condition of the item")
        named(made, "dcc:declaration", record["item"]["condition"])
    if record["laboratory"]["traceability"]:
        made = element(parent, "dcc:statement", refType="basic_traceability")
        named(made, "dcc:declaration", record["laboratory"]["traceability"])
    if record["method"].get("rig_traceability"):
        made = element(parent, "dcc:statement", refType="basic_traceability")
        named(made, "dcc:name", record["method"]["rig"] or "rig")
        named(made, "dcc:declaration", record["method"]["rig_traceability"])
    if record["interval_months"] is not None:
        made = element(parent, "dcc:statement", refType="basic_recalibration")
        english(made, "dcc:declaration", "Interval agreed with the customer.")
        element(made, "dcc:period", f"P{record['interval_months']}M")
    rule = _RULES.get(str(record["conformity"]["rule"]))
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
    judged, protocol = record["conformity"].get("judged", {}), record["verification"]["report"].get("protocol")
    said = (
        f". Protocol: {protocol['name']}, {protocol['taken']} of {protocol['positions']} positions" if protocol else ""
    )
    parts = [
        "{} at {} positions, inclination {:g} to {:g} deg".format(name, one["positions"], *one["inclination_deg"])
        for name, one in judged.items()
    ]
    return f"{said}. Applies to: {'; '.join(parts) or 'nothing'}."


def _measurement(parent: Any, record: Record) -> None:
    method = record["method"]
    english(parent, "dcc:name", "Calibration of an inclinometer")
    used = element(element(parent, "dcc:usedMethods"), "dcc:usedMethod")
    named(used, "dcc:name", method["name"])
    named(used, "dcc:description", f"Plan: {method['plan'] or 'not stated'}; positions: {method['positions']}")
    if method["rig"]:
        rig = element(element(parent, "dcc:measuringEquipments"), "dcc:measuringEquipment")
        named(rig, "dcc:name", method["rig"])
    _conditions(parent, record["environment"])
    results = element(parent, "dcc:results")
    if record["results"]["uncertainty"] is not None:
        part.uncertainty_result(results, record["results"]["uncertainty"])
    part.parameter_result(results, record["results"])
    if record["verification"] is not None:
        for name in ("inclination", "azimuth", "toolface"):
            part.verification_result(results, record["verification"], name)


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
            one = part.quantity(data, side.lower(), f"basic_{name}{side}")
            real = element(one, "si:real")
            element(real, "si:value", part.number(value))
            element(real, "si:unit", unit)


class Dcc(NamedTuple):
    """The numbers of a DCC that this package wrote.

    number, digest : of the certificate and its record.
    serial : of the item.
    uncertainty : "inclination", "U_inclination", "U_azimuth", "U_toolface" -> (n,) deg.
    parameters : name -> (value, expanded uncertainty, NaN where none is stated).
    covariance : (p, p) of the parameters; empty where none is stated.
    errors : angle -> (n, 2) error and expanded uncertainty at the judged positions, deg.
    """

    number: str
    digest: str
    serial: str
    uncertainty: dict[str, Array]
    parameters: dict[str, tuple[float, float]]
    covariance: Array
    errors: dict[str, Array]


def read_dcc(data: bytes, where: str | Path = "certificate.xml") -> Dcc:
    """Read the numbers back; entities and everything outside the file are refused.

    Raises
    ------
    FileError
        Not XML, not a DCC, not written by this package.
    """
    if len(data) > LARGEST:
        raise FileError(f"{len(data)} bytes; a digital certificate has at most {LARGEST}", path=where)
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
    try:
        root = etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        raise FileError(f"not XML: {error.msg}", path=where) from None
    if root.tag != f"{{{DCC}}}digitalCalibrationCertificate" or root.getroottree().docinfo.internalDTD is not None:
        raise FileError("not a digital calibration certificate", path=where)
    try:
        return _numbers(root)
    except (IndexError, ValueError):
        raise FileError(
            "a digital certificate of another program; its numbers are not known here", path=where
        ) from None


def _numbers(root: Any) -> Dcc:
    def find(path: str, below: Any = root) -> list[Any]:
        found: list[Any] = below.xpath(path, namespaces=NSMAP)
        return found

    def listed(path: str, below: Any = root) -> Array:
        return np.array(find(path, below)[0].text.split(), dtype=float)

    def identified(ref: str) -> str:
        return str(find(f"//dcc:identification[@refType='{PREFIX}{ref}']/dcc:value")[0].text)

    table = {}
    for name in ("inclination", "U_inclination", "U_azimuth", "U_toolface"):
        path = f"//dcc:result[@refType='{PREFIX}uncertainty']//dcc:quantity[@refType='{PREFIX}{name}']"
        if find(path):
            table[name] = listed(f"{path}//si:valueXMLList")
    block = find(f"//dcc:quantity[@refType='{PREFIX}parameters']/si:realListXMLList")[0]
    names, values = block[0].text.split(), listed("si:valueXMLList", block)
    spread = np.full(len(names), np.nan)
    if find("si:expandedUncXMLList", block):
        spread = listed("si:expandedUncXMLList/si:uncertaintyXMLList", block)
    cells = [float(cell.text) for cell in find(".//si:covariance/si:value", block)]
    size = len(names) if cells else 0
    errors = {}
    for name in ("inclination", "azimuth", "toolface"):
        where = f"//dcc:result[@refType='{PREFIX}verification_{name}']"
        path = f"{where}//dcc:quantity[@refType='basic_measurementError']/si:realListXMLList"
        if find(path):
            rows = find(path)[0]
            errors[name] = np.stack([listed("si:valueXMLList", rows), listed(".//si:uncertaintyXMLList", rows)], axis=1)
    return Dcc(
        identified("number"),
        identified("digest"),
        str(find("//dcc:item/dcc:identifications/dcc:identification/dcc:value")[0].text),
        table,
        {n: (float(v), float(s)) for n, v, s in zip(names, values, spread, strict=True)},
        np.array(cells).reshape(size, size).T,  # written column by column
        errors,
    )
