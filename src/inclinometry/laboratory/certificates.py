"""Certificates in the ledger: issued once, voided or superseded, never edited; checked years later."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

import numpy as np

from inclinometry.calibration.result import Calibration
from inclinometry.digest import digest_bytes
from inclinometry.errors import FileError, InclinometryError, InputError
from inclinometry.files.json_codec import parse
from inclinometry.files.verification_json import stated_limits
from inclinometry.files.writing import program
from inclinometry.laboratory.certificate.dcc import dcc_bytes, read_dcc
from inclinometry.laboratory.certificate.laboratory_toml import Laboratory, Order, Standard, laboratory_from
from inclinometry.laboratory.certificate.pdf import certificate_pdf
from inclinometry.laboratory.certificate.record import (
    certificate_record,
    checked,
    printable,
    record_bytes,
    record_digest,
)
from inclinometry.laboratory.certificate.signing import seal, sign_files, unsigned
from inclinometry.laboratory.certified import every
from inclinometry.laboratory.ledger.engine import MEDIA
from inclinometry.laboratory.ledger.ledger import ConflictError, Draft, Ledger, LedgerError, Record
from inclinometry.laboratory.ledger.users import LOCAL
from inclinometry.laboratory.registry import find_laboratory, find_logo, find_site, find_tool, standards
from inclinometry.laboratory.results import calibration_of, measured, parameters
from inclinometry.laboratory.session import load_session
from inclinometry.laboratory.verification import judged, limits_of, report

# What a certificate says of laboratory, order and rig, from the records of the ledger.


def laboratory_of(ledger: Ledger, session: Record) -> Laboratory:
    """The laboratory of a session's site, else that of the settings; InputError when neither names one."""
    site = find_site(ledger, str(session.body.get("site", "")))
    if site is not None and site.laboratory:
        return laboratory_from(dict(site.laboratory))
    found = find_laboratory(ledger)
    if found is None:
        raise InputError(
            "the laboratory is not known: state name, address and country in the laboratory settings, or give them"
        )
    return found


def authorised(laboratory: Laboratory, wanted: tuple[str, str], author: str) -> Laboratory:
    """The laboratory with who authorises the certificate, who is required (ISO/IEC 17025, 7.8.2.1 o).

    The one user of a bench without logins is nobody by name.
    """
    own = "" if author == LOCAL.name else author
    if any(wanted):
        return replace(laboratory, authoriser=wanted[0] or own, authoriser_role=wanted[1])
    return laboratory if laboratory.authoriser else replace(laboratory, authoriser=own)


def standards_of(ledger: Ledger) -> tuple[Standard, ...]:
    """The reference standards the laboratory uses, as a certificate cites them."""
    return tuple(Standard(one.name, one.certificate, one.due) for one in standards(ledger) if not one.retired)


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
    tool = find_tool(ledger, session.keys["serial"])
    first, last = measured(ledger, calibration, session)
    if verification is not None:
        last = max(last, date.fromisoformat(verification.created[:10]))
    about = body.get("environment", {})
    # traceability and place of a rig as it was when the tool was calibrated; as they are now where none was stated
    name = body["rig"]
    then = ledger.find("rig", name=name, newest=True, after=session.seq, limit=1)
    now = ledger.latest("rig", name=name)
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
    record: Record
    by: str = ""
    reason: str = ""


def issue(
    ledger: Ledger,
    calibration: str,
    verification: str | None,
    laboratory: Laboratory | None = None,
    *,
    author: str,
    language: str = "en",
    nonconforming: bool = False,
    number: str | None = None,
    about: Mapping[str, Any] | None = None,
    authoriser: tuple[str, str] = ("", ""),
    standards: Sequence[Standard] | None = None,
    now: datetime | None = None,
    fonts: Sequence[str | Path] = (),
    pdf: bool = True,
) -> Record:
    """Issue a certificate: record, PDF, DCC and JSON file go into the ledger in one step.

    Parameters
    ----------
    calibration, verification : str
        Ids of their records; None for a certificate without a statement of conformity.
    laboratory : Laboratory, optional
        That of the session's site when not given.
    nonconforming : bool
        Agree that a failed verification is certified as such.
    number : str, optional
        The next of the year when not given, as 2026-0001.
    about : mapping, optional
        Of the order: customer, order, condition, received (2026-01-31), environment; each in place of what the session
        says, where it is not empty.
    authoriser : (str, str)
        Name and role of who answers for it; what the laboratory names, or else the author, when empty.
    standards : sequence of Standard, optional
        The reference standards that were used; all the laboratory has when not given.
    now : datetime, optional
        Time of issue; the clock's when not given.
    pdf : bool
        False: digital only, without the PDF, which takes most of the time.

    Raises
    ------
    LedgerError
        The verification is of another calibration or tool, or failed; the calibration is certified already.
    InputError
        No laboratory, or one without name or country; a letter that no font shows.
    """
    return _issued(
        ledger,
        _Request(
            calibration,
            verification,
            laboratory,
            language,
            nonconforming,
            number,
            tuple(fonts),
            about or {},
            authoriser,
            pdf,
            standards,
        ),
        author,
        (now or datetime.now(UTC)).astimezone(UTC).date(),
    )


def supersede(
    ledger: Ledger,
    number: str,
    calibration: str,
    verification: str | None,
    laboratory: Laboratory | None = None,
    *,
    reason: str,
    author: str,
    language: str = "en",
    nonconforming: bool = False,
    about: Mapping[str, Any] | None = None,
    authoriser: tuple[str, str] = ("", ""),
    standards: Sequence[Standard] | None = None,
    now: datetime | None = None,
    fonts: Sequence[str | Path] = (),
) -> Record:
    """Issue a certificate in place of another, which stays in the ledger as superseded; arguments as `issue`."""
    return _issued(
        ledger,
        _Request(
            calibration,
            verification,
            laboratory,
            language,
            nonconforming,
            None,
            tuple(fonts),
            about or {},
            authoriser,
            standards=standards,
        ),
        author,
        (now or datetime.now(UTC)).astimezone(UTC).date(),
        (number, _said(reason)),
    )


def void(ledger: Ledger, number: str, reason: str, *, author: str) -> CertificateStatus:
    """Declare a certificate void; it stays in the ledger with the reason.

    Raises
    ------
    LedgerError
        No such certificate, or it is void or superseded already; no reason.
    """
    _issued_only(status(ledger, number))
    event = {"subject_kind": "certificate", "subject": number, "action": "void"}
    ledger.append("event", event, {"reason": _said(reason)}, author=author)
    return status(ledger, number)


def status(ledger: Ledger, number: str) -> CertificateStatus:
    """How a certificate stands; LedgerError when there is none of that number."""
    record = ledger.latest("certificate", number=number)
    if record is None:
        raise LedgerError(f"there is no certificate {number!r:.60} in {ledger.shown}")
    return _status(ledger, record)


class Issued:
    """The records of all certificates by number, and the events that ended them."""

    def __init__(self, ledger: Ledger) -> None:
        self.records = {str(record.keys["number"]): record for record in every(ledger, "certificate")}
        self.ended: dict[str, Record] = {}
        for event in every(ledger, "event", subject_kind="certificate"):
            if event.keys["action"] in ("void", "superseded"):
                self.ended.setdefault(str(event.keys["subject"]), event)


def certificates(
    ledger: Ledger, *, serial: str | None = None, limit: int = 50, before: int = 0
) -> list[CertificateStatus]:
    """Certificates as they stand, newest first, beyond the place `before`."""
    keys = {} if serial is None else {"serial": serial}
    found = ledger.find("certificate", newest=True, after=before, limit=limit, **keys)
    return [_status(ledger, record) for record in found]


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


@dataclass(frozen=True)
class _Request:
    """What is to be certified."""

    calibration: str
    verification: str | None
    laboratory: Laboratory | None
    language: str
    nonconforming: bool
    number: str | None
    fonts: tuple[str | Path, ...]
    about: Mapping[str, Any]
    authoriser: tuple[str, str]
    pdf: bool = True
    standards: Sequence[Standard] | None = None


def _issued(
    ledger: Ledger, request: _Request, author: str, today: date, replaced: tuple[str, str] | None = None
) -> Record:
    # how often a number is taken anew when others issue at the same moment
    for _ in range(20):
        # the number first: whoever certifies the same calibration meanwhile takes it, and all is looked at anew
        number = request.number or next_number(ledger, today.year)
        if ledger.count("certificate", number=number):
            if request.number is not None:
                raise LedgerError(f"certificate number {number!r:.60} is taken; leave it out for the next one")
            number = _free(ledger, number)
        calibration = ledger.get("calibration", request.calibration)
        verification = None if request.verification is None else ledger.get("verification", request.verification)
        if verification is not None:
            serial = calibration.keys["serial"]
            if verification.keys["serial"] != serial:
                raise LedgerError(
                    f"the verification is of tool {verification.keys['serial']}, the calibration of {serial}"
                )
            if verification.keys["calibration"] != calibration.id:
                raise LedgerError(
                    "the verification was made with another calibration of this tool; verify with this one"
                )
            if verification.body["verdict"] == "fail" and not request.nonconforming:
                raise LedgerError(
                    "the verification failed: a certificate would state that the tool does not conform; agree to that, "
                    "or calibrate and verify again"
                )
        _not_certified(ledger, calibration, replaced)
        record = _record(ledger, request, author, calibration, verification, number, today, replaced)
        settings, logo = find_laboratory(ledger), find_logo(ledger)
        # the logo is that laboratory's, and of no other that is named instead
        own = settings is not None and (record["laboratory"] or {}).get("name") == settings.name
        files = _documents(ledger, record, request, logo[1] if logo and own else None)
        body = {
            "record": record,
            "calibration": calibration.id,
            "verification": None if verification is None else verification.id,
            "documents": {name: digest_bytes(data) for name, data in files.items()},
            "supersedes": record["supersedes"],
            "head": record["head"],
        }
        keys = {"number": number, "serial": calibration.keys["serial"]}
        drafts = [Draft("certificate", keys, body, [(MEDIA[name], data) for name, data in files.items()])]
        if replaced is not None:
            event = {"subject_kind": "certificate", "subject": replaced[0], "action": "superseded"}
            drafts.append(Draft("event", event, {"reason": replaced[1], "details": {"by": number}}))
        try:
            return ledger.append_all(drafts, author=author)[0]
        except ConflictError:
            continue
    raise ConflictError(f"certificates are issued faster than numbers can be taken in {ledger.shown}; try again")


def _documents(ledger: Ledger, record: dict[str, Any], request: _Request, logo: bytes | None) -> dict[str, bytes]:
    """The files of a certificate; those of a ledger that is signed are signed, too."""
    made = seal(record, ledger.keys) if ledger.signed_head() is not None else None
    pdf = certificate_pdf(record, fonts=request.fonts, logo=logo, seal=str(made or "")) if request.pdf else None
    dcc: bytes | None = dcc_bytes(record)
    text = record_bytes(record)
    if made is not None:
        pdf, dcc, text = sign_files(record, pdf, dcc, made, ledger.keys)
    return {name: data for name, data in (("pdf", pdf), ("dcc", dcc), ("json", text)) if data is not None}


def _free(ledger: Ledger, number: str) -> str:
    year, _, place = number.partition("-")
    while ledger.count("certificate", number=number):
        place = f"{int(place) + 1:04d}"
        number = f"{year}-{place}"
    return number


def _not_certified(ledger: Ledger, calibration: Record, replaced: tuple[str, str] | None) -> None:
    serial = calibration.keys["serial"]
    if replaced is not None:
        old = status(ledger, replaced[0])
        _issued_only(old)
        if old.record.keys["serial"] != serial:
            raise LedgerError(f"certificate {old.number} is of tool {old.record.keys['serial']}, not of {serial}")
    for found in certificates(ledger, serial=serial, limit=1000):
        spared = replaced is not None and found.number == replaced[0]
        if found.state == "void" or found.record.body["calibration"] != calibration.id or spared:
            continue
        if found.state == "superseded" and replaced is None and status(ledger, found.by).state == "issued":
            raise LedgerError(
                f"certificate {found.number} of this calibration was superseded by {found.by}: supersede that one, "
                "with a reason"
            )
        if found.state == "issued":
            raise LedgerError(f"this calibration is certified already by {found.number}; void or supersede that one")


def _record(
    ledger: Ledger,
    request: _Request,
    author: str,
    calibration: Record,
    verification: Record | None,
    number: str,
    today: date,
    replaced: tuple[str, str] | None,
) -> dict[str, Any]:
    session = ledger.get("session", calibration.keys["session"])
    found = calibration_of(calibration)
    older = ledger.find("calibration", serial=calibration.keys["serial"], newest=True, after=calibration.seq, limit=1)
    try:
        before = calibration_of(older[0]) if older else None
    except InclinometryError:  # nothing can mend a recorded one; this certificate is complete without it
        before = None
    if before is not None and not _comparable(before, found):
        before = None
    inputs = {"calibration record": f"sha256:{calibration.digest}"}
    if verification is not None:
        inputs["verification record"] = f"sha256:{verification.digest}"
    return certificate_record(
        found,
        authorised(request.laboratory or laboratory_of(ledger, session), request.authoriser, author),
        order(ledger, session, calibration, verification, today, request.about),
        number=number,
        program=program(),
        language=request.language,
        standards=standards_of(ledger) if request.standards is None else request.standards,
        verification=None if verification is None else verification.body,
        as_found=None if before is None else _as_found(ledger, verification, older[0], session),
        previous=before,
        previous_from="" if before is None else _named(ledger, older[0]),
        inputs=inputs,
        head=str(ledger.head()),
        supersedes=None if replaced is None else replaced[0],
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
    return {"verdict": found.verdict, "limits": stated_limits(found, limits), "report": report(found, seen)}


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
    for event in ledger.find("event", subject_kind="certificate", subject=number):
        action, reason = event.keys["action"], str(event.body.get("reason", ""))
        if action in ("void", "superseded"):
            by = str(event.body.get("details", {}).get("by", ""))
            return CertificateStatus(number, action, record, by, reason)
    return CertificateStatus(number, "issued", record)


def _issued_only(found: CertificateStatus) -> None:
    if found.state != "issued":
        by = f" by {found.by}" if found.by else ""
        raise LedgerError(f"certificate {found.number} is {found.state}{by} already")


def _said(reason: str) -> str:
    if not reason.strip():
        raise LedgerError("say why: a certificate is not voided or superseded without a reason")
    return reason.strip()


def digest_of(record: Record) -> str:
    """The digest that is printed on a certificate and in its square code."""
    return record_digest(record.body["record"])


# A certificate checked against the ledger, years later: do its documents, its record and its calibration agree?


@dataclass(frozen=True)
class Check:
    """What was found.

    status : of the certificate.
    digest : of its record, to be compared with the one on paper.
    problems : sentences; none when everything agrees.
    """

    status: CertificateStatus
    digest: str
    problems: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether nothing contradicts the certificate."""
        return not self.problems


def verify_certificate(ledger: Ledger, number: str) -> Check:
    """Compare a certificate's PDF, DCC and JSON file with its record, and the record with its calibration.

    It says nothing of the rest of the ledger: `ledger verify` does.

    Raises
    ------
    LedgerError
        There is no certificate of that number.
    """
    found = status(ledger, number)
    record = found.record
    problems = [*_own(record), *_files(ledger, record), *_source(ledger, record)]
    return Check(found, record_digest(record.body["record"]), tuple(problems))


def _own(record: Record) -> Iterator[str]:
    content = record.body["record"]
    try:
        checked(content, f"certificate {record.keys['number']}")
    except FileError as error:
        yield f"its record does not fit: {error}"
        return
    if content["number"] != record.keys["number"]:
        yield f"its record is that of number {content['number']}"


def _files(ledger: Ledger, record: Record) -> Iterator[str]:
    content = record.body["record"]
    digest = record_digest(content)
    for name, key in record.body["documents"].items():
        try:
            data = ledger.document(key)[1]
        except LedgerError as error:
            yield f"its {name} file: {error}"
            continue
        if name == "json" and record_bytes(_record_of(data)) != record_bytes(content):
            yield "its JSON file is not its record"
        if name == "pdf" and digest.encode() not in data:
            yield "its PDF does not bear the digest of its record"
        if name == "dcc":
            yield from _dcc(data, content, digest)


def _record_of(data: bytes) -> dict[str, Any]:
    """The record in a JSON file, signed or not; nothing in one that cannot be read."""
    try:
        return unsigned(parse(data))
    except (InputError, AttributeError):
        return {}


def _dcc(data: bytes, content: dict[str, Any], digest: str) -> Iterator[str]:
    try:
        said = read_dcc(data)
    except FileError as error:
        yield f"its DCC cannot be read: {error}"
        return
    if (said.number, said.digest) != (content["number"], digest):
        yield "its DCC is of another record"
    values = {row["name"]: row["value"] for row in content["results"]["parameters"]}
    if {name: value for name, (value, _) in said.parameters.items()} != values:
        yield "its DCC states other parameters than its record"


def _source(ledger: Ledger, record: Record) -> Iterator[str]:
    content = record.body["record"]
    try:
        calibration = ledger.get("calibration", record.body["calibration"])
        known = parameters(calibration_of(calibration))
    except InputError as error:
        yield f"its calibration: {error}"
        return
    if calibration.keys["serial"] != record.keys["serial"]:
        yield f"its calibration is of tool {calibration.keys['serial']}"
    stated = {row["name"]: row["value"] for row in content["results"]["parameters"]}
    if stated.keys() != known.keys() or not np.array_equal(list(stated.values()), [v for v, _ in known.values()]):
        yield "it states other parameters than its calibration"
    if content["inputs"].get("calibration record") != f"sha256:{calibration.digest}":
        yield "it was made from another state of its calibration"
    name = record.body["verification"]
    if name is not None:
        try:
            verification = ledger.get("verification", name)
        except LedgerError as error:
            yield f"its verification: {error}"
            return
        if content["verification"] != printable(
            {key: verification.body[key] for key in ("verdict", "limits", "report")}
        ):
            yield "it states another verification than the ledger holds"
