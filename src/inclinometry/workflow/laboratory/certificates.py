"""Certificates in the ledger: issued once, voided or superseded, never edited; checked years later."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any, Final

from inclinometry.calibration.result import Calibration
from inclinometry.core.digest import digest_bytes
from inclinometry.core.errors import InclinometryError
from inclinometry.io.certificate_json import record_bytes, record_digest
from inclinometry.io.dcc import dcc_bytes
from inclinometry.io.laboratory_toml import Laboratory
from inclinometry.report.certificate import certificate_pdf
from inclinometry.report.certificate_record import certificate_record
from inclinometry.store.ledger import ConflictError, Draft, Ledger, LedgerError, Record
from inclinometry.workflow.laboratory.certificate_order import authorised, laboratory_of, order
from inclinometry.workflow.laboratory.results import calibration_of, program

MEDIA: Final = {"pdf": "application/pdf", "dcc": "application/xml", "json": "application/json"}
ENDINGS: Final = {"pdf": ".pdf", "dcc": ".xml", "json": ".json"}
ATTEMPTS: Final = 20
"""How often a number is taken anew when others issue at the same moment."""
PAGE: Final = 20


@dataclass(frozen=True)
class Standing:
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
    now: datetime | None = None,
    fonts: Sequence[str | Path] = (),
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
    now : datetime, optional
        Time of issue; the clock's when not given.

    Raises
    ------
    LedgerError
        The verification is of another calibration or tool, or failed; the calibration is certified already.
    InputError
        No laboratory, or one without name or country; a letter that no font shows.
    """
    return _issued(
        ledger,
        _Wish(
            calibration,
            verification,
            laboratory,
            language,
            nonconforming,
            number,
            tuple(fonts),
            about or {},
            authoriser,
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
    now: datetime | None = None,
    fonts: Sequence[str | Path] = (),
) -> Record:
    """Issue a certificate in place of another, which stays in the ledger as superseded; arguments as `issue`."""
    return _issued(
        ledger,
        _Wish(
            calibration, verification, laboratory, language, nonconforming, None, tuple(fonts), about or {}, authoriser
        ),
        author,
        (now or datetime.now(UTC)).astimezone(UTC).date(),
        (number, _said(reason)),
    )


def void(ledger: Ledger, number: str, reason: str, *, author: str) -> Standing:
    """Declare a certificate void; it stays in the ledger with the reason.

    Raises
    ------
    LedgerError
        No such certificate, or it is void or superseded already; no reason.
    """
    _standing_only(status(ledger, number))
    event = {"subject_kind": "certificate", "subject": number, "action": "void"}
    ledger.append("event", event, {"reason": _said(reason)}, author=author)
    return status(ledger, number)


def status(ledger: Ledger, number: str) -> Standing:
    """How a certificate stands; LedgerError when there is none of that number."""
    record = ledger.latest("certificate", number=number)
    if record is None:
        raise LedgerError(f"there is no certificate {number!r:.60} in {ledger.shown}")
    return _standing(ledger, record)


def certificates(ledger: Ledger, *, serial: str | None = None, limit: int = 50, before: int = 0) -> list[Standing]:
    """Certificates as they stand, newest first, beyond the place `before`."""
    keys = {} if serial is None else {"serial": serial}
    found = ledger.find("certificate", newest=True, after=before, limit=limit, **keys)
    return [_standing(ledger, record) for record in found]


def documents(ledger: Ledger, record: Record) -> dict[str, tuple[str, str, bytes]]:
    """ "pdf", "dcc", "json" -> (file name, media type, bytes) of a certificate."""
    stem = re.sub(r"[^\w.-]+", "_", f"{record.keys['number']}_{record.keys['serial']}")
    digests = record.body["documents"]
    return {name: (f"{stem}{end}", *ledger.document(digests[name])) for name, end in ENDINGS.items() if name in digests}


def next_number(ledger: Ledger, year: int) -> str:
    """The number after the last of the year, as 2026-0001; numbers of another form are passed over."""
    before = 0
    while True:
        rows = ledger.find("certificate", newest=True, after=before, limit=PAGE)
        for row in rows:
            found = re.fullmatch(r"(\d{4})-(\d{4,})", row.keys["number"])
            if found is not None and int(found[1]) == year:
                return f"{year}-{int(found[2]) + 1:04d}"
        if len(rows) < PAGE or int(rows[-1].created[:4]) < year:
            return f"{year}-0001"
        before = rows[-1].seq


@dataclass(frozen=True)
class _Wish:
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


def _issued(ledger: Ledger, wish: _Wish, author: str, today: date, replaced: tuple[str, str] | None = None) -> Record:
    for _ in range(ATTEMPTS):
        # the number first: whoever certifies the same calibration meanwhile takes it, and all is looked at anew
        number = wish.number or next_number(ledger, today.year)
        if ledger.count("certificate", number=number):
            if wish.number is not None:
                raise LedgerError(f"certificate number {number!r:.60} is taken; leave it out for the next one")
            number = _free(ledger, number)
        drafts = _drafts(ledger, wish, author, number, today, replaced)
        try:
            return ledger.append_all(drafts, author=author)[0]
        except ConflictError:
            continue
    raise ConflictError(f"certificates are issued faster than numbers can be taken in {ledger.shown}; try again")


def _free(ledger: Ledger, number: str) -> str:
    year, _, place = number.partition("-")
    while ledger.count("certificate", number=number):
        place = f"{int(place) + 1:04d}"
        number = f"{year}-{place}"
    return number


def _drafts(
    ledger: Ledger, wish: _Wish, author: str, number: str, today: date, replaced: tuple[str, str] | None
) -> list[Draft]:
    calibration = ledger.get("calibration", wish.calibration)
    verification = None if wish.verification is None else ledger.get("verification", wish.verification)
    _belonging(calibration, verification, wish)
    _not_certified(ledger, calibration, replaced)
    record = _record(ledger, wish, author, calibration, verification, number, today, replaced)
    files = {"pdf": certificate_pdf(record, fonts=wish.fonts), "dcc": dcc_bytes(record), "json": record_bytes(record)}
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
    return drafts


def _belonging(calibration: Record, verification: Record | None, wish: _Wish) -> None:
    if verification is None:
        return
    serial = calibration.keys["serial"]
    if verification.keys["serial"] != serial:
        raise LedgerError(f"the verification is of tool {verification.keys['serial']}, the calibration of {serial}")
    if verification.keys["calibration"] != calibration.id:
        raise LedgerError("the verification was made with another calibration of this tool; verify with this one")
    if verification.body["verdict"] == "fail" and not wish.nonconforming:
        raise LedgerError(
            "the verification failed: a certificate would state that the tool does not conform; agree to that, "
            "or calibrate and verify again"
        )


def _not_certified(ledger: Ledger, calibration: Record, replaced: tuple[str, str] | None) -> None:
    serial = calibration.keys["serial"]
    if replaced is not None:
        old = status(ledger, replaced[0])
        _standing_only(old)
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
    wish: _Wish,
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
        authorised(wish.laboratory or laboratory_of(ledger, session), wish.authoriser, author),
        order(ledger, session, calibration, verification, today, wish.about),
        number=number,
        program=program(),
        language=wish.language,
        verification=None if verification is None else verification.body,
        previous=before,
        previous_from="" if before is None else _named(ledger, older[0]),
        inputs=inputs,
        head=str(ledger.head()),
        supersedes=None if replaced is None else replaced[0],
    )


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


def _standing(ledger: Ledger, record: Record) -> Standing:
    number = record.keys["number"]
    for event in ledger.find("event", subject_kind="certificate", subject=number):
        action, reason = event.keys["action"], str(event.body.get("reason", ""))
        if action in ("void", "superseded"):
            by = str(event.body.get("details", {}).get("by", ""))
            return Standing(number, action, record, by, reason)
    return Standing(number, "issued", record)


def _standing_only(found: Standing) -> None:
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
