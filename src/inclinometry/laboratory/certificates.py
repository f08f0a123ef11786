"""Certificates in the ledger: issued once, voided or superseded, never edited; checked years later."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

import numpy as np

from inclinometry.calibration.result import Calibration
from inclinometry.digest import digest_bytes
from inclinometry.errors import FileError, InclinometryError, InputError, refused
from inclinometry.files.json_codec import parse
from inclinometry.files.verification_json import as_now, stated_limits
from inclinometry.files.writing import program
from inclinometry.findings import Finding
from inclinometry.laboratory import registry
from inclinometry.laboratory.certificate.dcc import dcc_bytes, number, read_dcc
from inclinometry.laboratory.certificate.laboratory import Laboratory, Order, Standard, laboratory_from
from inclinometry.laboratory.certificate.pdf import certificate_pdf
from inclinometry.laboratory.certificate.record import (
    certificate_record,
    checked,
    coverage,
    printable,
    record_bytes,
    record_digest,
)
from inclinometry.laboratory.certificate.requirements import only_conforming, other_tool
from inclinometry.laboratory.certificate.signing import seal, sign_files, unsigned
from inclinometry.laboratory.ledger.chain import missing
from inclinometry.laboratory.ledger.engine import MEDIA
from inclinometry.laboratory.ledger.ledger import ConflictError, Draft, Ledger, LedgerError, Record
from inclinometry.laboratory.ledger.users import LOCAL
from inclinometry.laboratory.placeholders import stated
from inclinometry.laboratory.registry import standards as registered
from inclinometry.laboratory.results import calibration_of, measured, parameters
from inclinometry.laboratory.session import load_session, site_of
from inclinometry.laboratory.valid_certificates import ended, ending
from inclinometry.laboratory.verification import judged, limits_of, recorded, report

# What a certificate says of laboratory, order and rig, from the records of the ledger.


def laboratory_of(ledger: Ledger, session: Record) -> Laboratory:
    """The laboratory of a session's site, else that of the settings; InputError when neither names one."""
    site = registry.find_site(ledger, site_of(ledger, session))
    if site is not None and site.laboratory:
        return laboratory_from(dict(site.laboratory))
    if found := registry.find_laboratory(ledger):
        return found
    raise refused("input-missing", {"names": ("laboratory.name", "laboratory.address", "laboratory.country")})


def authorised(laboratory: Laboratory, wanted: tuple[str, str], author: str) -> Laboratory:
    """The laboratory with who authorises the certificate, who is required (ISO/IEC 17025, 7.8.2.1 o).

    The one user of a bench without logins is no one by name.
    """
    own = "" if author == LOCAL.name else author
    if any(wanted):
        return replace(laboratory, authoriser=wanted[0] or own, authoriser_role=wanted[1])
    return laboratory if laboratory.authoriser else replace(laboratory, authoriser=own)


def order(
    ledger: Ledger,
    session: Record,
    calibration: Record,
    verification: Record | None,
    today: date,
    said: Mapping[str, Any],
) -> Order:
    """What was ordered and done, from the records of session, tool, rig and readings; `said` goes before them."""
    body = {**session.body, **{name: value for name, value in said.items() if value}}
    tool = registry.find_tool(ledger, session.keys["serial"])
    first, last = measured(ledger, calibration, session)
    if verification is not None:
        last = max(last, date.fromisoformat(verification.created[:10]))
    about = body.get("environment", {})
    # traceability and place of a rig as it was when the tool was calibrated; as they are now where none was stated
    then = ledger.find("rig", name=body["rig"], newest=True, after=session.seq, limit=1)
    now = ledger.latest("rig", name=body["rig"])
    bodies = [record.body for record in (*then, now) if record is not None]
    traceability, place = (next((str(b[key]) for b in bodies if b.get(key)), "") for key in ("traceability", "place"))
    return Order(
        customer=body.get("customer") or (tool.customer if tool else ""),
        reference=body.get("order", ""),
        item=tool.name if tool else "",
        manufacturer=tool.manufacturer if tool else "",
        serial=session.keys["serial"],
        condition=body.get("condition", ""),
        plan=body["plan"]["name"],
        rig=body["rig"],
        rig_traceability=traceability,
        rig_place=place,
        environment=str(about.get("text", "")),
        received=_day(body.get("received", "")),
        performed_from=first,
        performed_to=last,
        issued=today,
        temperature_degC=_pair(about, "temperature_degC"),
        humidity_percent=_pair(about, "humidity_percent"),
        interval_months=tool.interval_months if tool else None,
    )


def _day(text: str) -> date | None:
    try:
        return date.fromisoformat(text[:10])
    except ValueError:
        return None


def _pair(about: Mapping[str, Any], key: str) -> tuple[float, float] | None:
    """Lowest and highest of a list, or of one number."""
    value = about.get(key)
    numbers = value if isinstance(value, list) else [value]
    if not numbers or any(isinstance(x, bool) or not isinstance(x, int | float) for x in numbers):
        return None
    return float(min(numbers)), float(max(numbers))


@dataclass(frozen=True)
class CertificateStatus:
    """A certificate as it stands now.

    state : "issued", "void" or "superseded".
    by : number of the certificate that superseded it.
    reason : why it is void or superseded.
    """

    number: str
    state: str
    by: str
    reason: str
    record: Record


def issue(
    ledger: Ledger,
    calibration: str,
    verification: str | None,
    laboratory: Laboratory | None = None,
    *,
    author: str,
    number: str | None = None,
    supersedes: str | None = None,
    reason: str = "",
    nonconforming: bool = False,
    now: datetime | None = None,
    fonts: Sequence[str | Path] = (),
    pdf: bool = True,
    **said: Any,
) -> Record:
    """Issue a certificate: record, PDF, DCC and JSON file go into the ledger in one step.

    Without a verification it states no conformity. With `supersedes` it takes the place of another certificate, which
    stays in the ledger as superseded, with the reason. Without `pdf` most of the time is saved. `said` is what
    `_record` and `certificate_record` take: standards (by default those of the site, as the laboratory), authoriser
    (the laboratory's or else the author), about (values before the session's), language, accept_warnings.
    """
    replaced = None if supersedes is None else (supersedes, _said(reason))
    today = (now or datetime.now(UTC)).astimezone(UTC).date()
    # how often a number is taken again when others issue at the same moment
    for _ in range(20):
        # the number first: whoever certifies the same calibration meanwhile takes it, and all is looked at again
        wanted = number or next_number(ledger, today.year)
        if ledger.count("certificate", number=wanted):
            if number is not None:
                raise LedgerError(Finding("certificate-number-taken", {"number": f"{number:.60}"}))
            year, _, place = wanted.partition("-")
            free = (f"{year}-{one:04d}" for one in itertools.count(int(place) + 1))
            wanted = next(one for one in free if not ledger.count("certificate", number=one))
        made = ledger.get("calibration", calibration)
        judged_by = None if verification is None else _verification(ledger, verification, made, nonconforming)
        _not_certified(ledger, made, replaced)
        record = _record(ledger, made, judged_by, wanted, laboratory, today, replaced, author, **said)
        files = _documents(ledger, record, fonts, pdf)
        body = {
            "record": record,
            "calibration": calibration,
            "verification": verification,
            "documents": {name: digest_bytes(data) for name, data in files.items()},
            "supersedes": record["supersedes"],
            "head": record["head"],
        }
        keys = {"number": wanted, "serial": made.keys["serial"]}
        drafts = [Draft("certificate", keys, body, [(MEDIA[name], data) for name, data in files.items()])]
        if replaced is not None:
            event = {"subject_kind": "certificate", "subject": replaced[0], "action": "superseded"}
            drafts.append(Draft("event", event, {"reason": replaced[1], "details": {"by": wanted}}))
        try:
            return ledger.append_all(drafts, author=author)[0]
        except ConflictError:
            continue
    raise ConflictError(Finding("ledger-conflict", {"ledger": ledger.shown}))


def void(ledger: Ledger, number: str, reason: str, *, author: str) -> CertificateStatus:
    """Declare a certificate void; it stays in the ledger with the reason.

    Raises LedgerError: no such certificate, or it is void or superseded already; no reason.
    """
    _issued_only(status(ledger, number))
    event = {"subject_kind": "certificate", "subject": number, "action": "void"}
    ledger.append("event", event, {"reason": _said(reason)}, author=author)
    return status(ledger, number)


def status(ledger: Ledger, number: str) -> CertificateStatus:
    """How a certificate stands; LedgerError when there is none of that number."""
    record = ledger.latest("certificate", number=number)
    if record is None:
        raise LedgerError(missing("certificate", number, ledger.shown))
    return _status(ledger, record)


def certificates(
    ledger: Ledger, *, serial: str | None = None, limit: int = 50, before: int = 0
) -> list[CertificateStatus]:
    """Certificates as they stand, newest first, beyond the place `before`."""
    keys = {} if serial is None else {"serial": serial}
    found = ledger.find("certificate", newest=True, after=before, limit=limit, **keys)
    return [_status(ledger, record) for record in found]


def of_same_readings(ledger: Ledger, calibration: Record) -> list[CertificateStatus]:
    """Certificates of a calibration, and of other evaluations of its readings, as they stand, newest first."""
    same = {one.id for one in registry.listed(ledger, "calibration", session=calibration.keys["session"], limit=1000)}
    found = certificates(ledger, serial=calibration.keys["serial"], limit=1000)
    return [one for one in found if one.record.body["calibration"] in same]


def documents(ledger: Ledger, record: Record) -> dict[str, tuple[str, str, bytes]]:
    """ "pdf", "dcc", "json" -> (file name, media type, bytes) of a certificate."""
    stem = re.sub(r"[^\w.-]+", "_", f"{record.keys['number']}_{record.keys['serial']}")
    digests = record.body["documents"]
    endings = {"pdf": ".pdf", "dcc": ".xml", "json": ".json"}
    return {name: (f"{stem}{end}", *ledger.document(digests[name])) for name, end in endings.items() if name in digests}


def next_number(ledger: Ledger, year: int) -> str:
    """The number after the last of the year, as 2026-0001; numbers of another form are passed over."""
    page = 20
    before = 0
    while True:
        rows = ledger.find("certificate", newest=True, after=before, limit=page)
        for row in rows:
            found = re.fullmatch(r"(\d{4})-(\d{4,})", row.keys["number"])
            if found is not None and int(found[1]) == year:
                return f"{year}-{int(found[2]) + 1:04d}"
        if len(rows) < page or int(rows[-1].created[:4]) < year:
            return f"{year}-0001"
        before = rows[-1].seq


def _verification(ledger: Ledger, name: str, calibration: Record, nonconforming: bool) -> Record:
    """The verification of a calibration; one of another, or one that failed unless that is certified, is refused."""
    found, serial = ledger.get("verification", name), calibration.keys["serial"]
    if found.keys["serial"] != serial:
        raise LedgerError(other_tool("verification", found.keys["serial"], serial))
    if found.keys["calibration"] != calibration.id:
        about = {"what": "calibration", "agreed": str(found.keys["calibration"]), "given": calibration.id}
        raise LedgerError(Finding("session-agreed", about))
    if not nonconforming:
        only_conforming(recorded(found))
    return found


def _documents(ledger: Ledger, record: dict[str, Any], fonts: Sequence[str | Path], with_pdf: bool) -> dict[str, bytes]:
    """The files of a certificate; those of a ledger that is signed are signed, too."""
    settings, kept = registry.find_laboratory(ledger), registry.find_logo(ledger)
    # the logo is that laboratory's, and of no other that is named instead
    own = settings is not None and (record["laboratory"] or {}).get("name") == settings.name
    logo = kept[1] if kept and own else None
    made = seal(record, ledger.keys) if ledger.signed_head() is not None else None
    pdf = certificate_pdf(record, fonts=fonts, logo=logo, seal=str(made or "")) if with_pdf else None
    dcc: bytes | None = dcc_bytes(record)
    text = record_bytes(record)
    if made is not None:
        pdf, dcc, text = sign_files(record, pdf, dcc, made, ledger.keys)
    return {name: data for name, data in (("pdf", pdf), ("dcc", dcc), ("json", text)) if data is not None}


def _not_certified(ledger: Ledger, calibration: Record, replaced: tuple[str, str] | None) -> None:
    serial = calibration.keys["serial"]
    if replaced is not None:
        old = status(ledger, replaced[0])
        _issued_only(old)
        if old.record.keys["serial"] != serial:
            raise LedgerError(other_tool("superseded certificate", old.record.keys["serial"], serial))
    for found in of_same_readings(ledger, calibration):
        if found.state == "void" or (replaced is not None and found.number == replaced[0]):
            continue
        if found.state == "superseded" and replaced is None and status(ledger, found.by).state == "issued":
            raise LedgerError(Finding("certificate-already", {"number": found.by}))
        if found.state == "issued":
            raise LedgerError(Finding("certificate-already", {"number": found.number}))


def _record(
    ledger: Ledger,
    calibration: Record,
    verification: Record | None,
    number: str,
    laboratory: Laboratory | None,
    today: date,
    replaced: tuple[str, str] | None,
    author: str,
    *,
    about: Mapping[str, Any] | None = None,
    authoriser: tuple[str, str] = ("", ""),
    standards: Sequence[Standard] | None = None,
    **said: Any,
) -> dict[str, Any]:
    """The record of a certificate, from those of the ledger."""
    session = ledger.get("session", calibration.keys["session"])
    found = calibration_of(calibration)
    older = registry.calibration_before(ledger, calibration)
    try:
        before = None if older is None else calibration_of(older)
    except InclinometryError:  # nothing can repair a recorded one; this certificate is complete without it
        before = None
    if before is None or not _comparable(before, found):
        before = older = None
    inputs = {"calibration record": f"sha256:{calibration.digest}"}
    if verification is not None:
        inputs["verification record"] = f"sha256:{verification.digest}"
    return certificate_record(
        found,
        authorised(laboratory or laboratory_of(ledger, session), authoriser, author),
        order(ledger, session, calibration, verification, today, about or {}),
        number=number,
        program=program(),
        standards=[one for one in registered(ledger) if not one.retired] if standards is None else standards,
        verification=None if verification is None else recorded(verification),
        as_found=None if older is None else _as_found(ledger, verification, older, session),
        previous=before,
        previous_from="" if older is None else _named(ledger, older),
        inputs=inputs,
        head=str(ledger.head()),
        supersedes=None if replaced is None else replaced[0],
        **said,
    )


def _as_found(ledger: Ledger, verification: Record | None, older: Record, session: Record) -> dict[str, Any] | None:
    """The readings of the verification judged with the parameters before; None on another rig than theirs."""
    if verification is None or ledger.get("session", older.keys["session"]).body["rig"] != session.body["rig"]:
        return None
    seen = load_session(ledger, verification.body["session"])
    limits = limits_of(seen)
    try:
        found = judged(ledger, seen.id, older.id, limits)
    except InclinometryError:  # a calibration that knows no stand; the certificate is complete without it
        return None
    return {"verdict": found.verdict, "limits": stated_limits(limits), "report": report(found, seen)}


def _comparable(one: Calibration, other: Calibration) -> bool:
    units = [{kind: triad.unit for kind, triad in seen.tool.triads.items()} for seen in (one, other)]
    return one.tool.parameter_names == other.tool.parameter_names and units[0] == units[1]


def _named(ledger: Ledger, calibration: Record) -> str:
    """A calibration by its day, and by its certificate where it has one that stands."""
    day = calibration.created[:10]
    for found in certificates(ledger, serial=calibration.keys["serial"]):
        if found.state == "issued" and found.record.body["calibration"] == calibration.id:
            return f"{found.number} ({day})"
    return day


def _status(ledger: Ledger, record: Record) -> CertificateStatus:
    number = record.keys["number"]
    return CertificateStatus(number, *ending(ended(ledger, subject=number).get(number)), record)


def _issued_only(found: CertificateStatus) -> None:
    if found.state != "issued":
        raise LedgerError(Finding("certificate-ended", {"number": found.number, "state": found.state}))


def _said(reason: str) -> str:
    if not stated(reason):
        raise LedgerError(Finding("ledger-reason"))
    return reason.strip()


def digest_of(record: Record) -> str:
    """The digest that is printed on a certificate and in its square code."""
    return record_digest(record.body["record"])


# A certificate checked against the ledger, years later: do its documents, its record and its calibration agree?


def verify_certificate(ledger: Ledger, number: str) -> list[Finding]:
    """What contradicts a certificate: its PDF, DCC and JSON file against its record, that against its calibration.

    It says nothing of the rest of the ledger: `ledger verify` does.
    """
    record = status(ledger, number).record
    return [*_own(record), *_files(ledger, record), *_source(ledger, record)]


def _apart(part: str, other: str) -> Finding:
    return Finding("certificate-disagrees", {"part": part, "other": other})


def _why(error: InputError) -> Iterator[Finding]:
    """What is wrong with a part of a certificate that cannot be read."""
    yield error.finding


def _own(record: Record) -> Iterator[Finding]:
    content = record.body["record"]
    try:
        checked(content, f"certificate {record.keys['number']}")
    except FileError as error:
        yield from _why(error)
        return
    if content["number"] != record.keys["number"]:
        yield _apart("record", "certificate")


def _files(ledger: Ledger, record: Record) -> Iterator[Finding]:
    content = record.body["record"]
    digest = record_digest(content)
    for name, key in record.body["documents"].items():
        try:
            data = ledger.document(key)[1]
        except LedgerError as error:
            yield from _why(error)
            continue
        if name == "json" and record_bytes(_record_of(data)) != record_bytes(content):
            yield _apart("JSON file", "record")
        if name == "pdf" and digest.encode() not in data:
            yield _apart("PDF", "record")
        if name == "dcc":
            yield from _dcc(data, content, digest)


def _record_of(data: bytes) -> dict[str, Any]:
    """The record in a JSON file, signed or not; nothing in one that cannot be read."""
    try:
        return unsigned(parse(data))
    except (InputError, AttributeError):
        return {}


def _dcc(data: bytes, content: dict[str, Any], digest: str) -> Iterator[Finding]:
    try:
        said = read_dcc(data)
    except FileError as error:
        yield from _why(error)
        return
    if (said.number, said.digest) != (content["number"], digest):
        yield _apart("DCC", "record")
    rows = {row["name"]: row for row in content["results"]["parameters"]}
    # to the digits that a DCC has of a value
    places = {name: None if row["u"] is None else coverage(content)[0] * row["u"] for name, row in rows.items()}
    values = {name: number(row["value"], places[name]) for name, row in rows.items()}
    if {name: number(value, places.get(name)) for name, (value, _) in said.parameters.items()} != values:
        yield _apart("DCC", "parameters")


def _source(ledger: Ledger, record: Record) -> Iterator[Finding]:
    content = record.body["record"]
    try:
        calibration = ledger.get("calibration", record.body["calibration"])
        known = parameters(calibration_of(calibration).tool)
    except InputError as error:
        yield from _why(error)
        return
    if calibration.keys["serial"] != record.keys["serial"]:
        yield _apart("tool", "calibration")
    stated = {row["name"]: row["value"] for row in content["results"]["parameters"]}
    if stated.keys() != known.keys() or not np.array_equal(list(stated.values()), [v for v, _ in known.values()]):
        yield _apart("parameters", "calibration")
    if content["inputs"].get("calibration record") != f"sha256:{calibration.digest}":
        yield _apart("record", "calibration")
    name = record.body["verification"]
    if name is not None:
        try:
            verification = ledger.get("verification", name)
        except LedgerError as error:
            yield from _why(error)
            return
        if not _same_verdict(content["verification"], verification):
            yield _apart("record", "verification")


def _same_verdict(certified: dict[str, Any] | None, verification: Record) -> bool:
    """Whether a certificate, of any version, states what the record of its verification does."""
    if certified is None:
        return False
    held, stated = recorded(verification), as_now(certified)
    if held["limits"] != verification.body["limits"]:  # no one agreed on them: older certificates kept some reasons
        warned = [one for one in stated["report"]["findings"] if one["severity"] != "note"]
        stated["report"] = stated["report"] | {"findings": warned}
    return bool(printable(stated) == printable(held))
