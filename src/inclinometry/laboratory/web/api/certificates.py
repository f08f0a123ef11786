"""Certificates: issued, voided, superseded, downloaded; never edited."""

from __future__ import annotations

from typing import Annotated, Any, Literal
from urllib.parse import quote

from fastapi import APIRouter, Path, Query, Response
from pydantic import Field

from inclinometry.errors import not_among
from inclinometry.laboratory import certificates as workflow
from inclinometry.laboratory.certificate.laboratory import LONGEST, Laboratory
from inclinometry.laboratory.ledger.users import User
from inclinometry.laboratory.web.api.access import (
    REFUSALS,
    After,
    Body,
    Limit,
    Metrologist,
    Reader,
    TheLedger,
    attributes,
)

router = APIRouter(prefix="/certificates", tags=["certificates"], responses=REFUSALS)

Number = Annotated[str, Path(min_length=1, max_length=200)]
Text = Annotated[str, Field(max_length=LONGEST)]
Id = Annotated[str, Field(pattern="^[0-9a-f]{32}$")]


class LaboratoryBody(Body):
    """The laboratory; that of the session's site when it is left out. Country: two capital letters."""

    name: Text = Field(min_length=1)
    address: Text = ""
    country: Text = ""
    place: Text = ""
    accreditation: Text = ""
    traceability: Text = ""
    procedure: Text = ""


class AboutBody(Body):
    """Of the order, in place of what the session says."""

    customer: Text = ""
    order: Text = ""
    condition: Text = ""
    received: str = Field(default="", pattern=r"^(\d{4}-\d{2}-\d{2})?$")
    environment: Text = ""


class IssueBody(Body):
    """What to certify."""

    calibration: Id
    verification: Id | None = None
    language: Literal["en", "ru", "zh"] = "en"
    nonconforming: bool = False
    accept_warnings: str = Field(default="", max_length=2000)
    laboratory: LaboratoryBody | None = None
    about: AboutBody = Field(default_factory=AboutBody)


class SupersedeBody(IssueBody):
    """What to certify instead, and why."""

    reason: str = Field(min_length=1, max_length=2000)


class VoidBody(Body):
    """Why a certificate is void."""

    reason: str = Field(min_length=1, max_length=2000)


@router.get("")
def list_certificates(
    ledger: TheLedger,
    _: Reader,
    serial: Annotated[str | None, Query(max_length=200)] = None,
    before: After = 0,
    limit: Limit = 20,
) -> list[dict[str, Any]]:
    """Certificates as they stand, newest first."""
    return [_shown(one) for one in workflow.certificates(ledger, serial=serial, limit=limit, before=before)]


@router.post("", status_code=201)
def issue(ledger: TheLedger, user: Metrologist, body: IssueBody) -> dict[str, Any]:
    """Issue a certificate; the authoriser is who asks."""
    made = workflow.issue(ledger, body.calibration, body.verification, **_wish(body, user))
    return _shown(workflow.status(ledger, made.keys["number"]))


@router.get("/{number}")
def one_certificate(ledger: TheLedger, _: Reader, number: Number) -> dict[str, Any]:
    """A certificate and how it stands."""
    return _shown(workflow.status(ledger, number))


@router.get("/{number}/{document}", response_class=Response)
def download(ledger: TheLedger, _: Reader, number: Number, document: Literal["pdf", "dcc", "json"]) -> Response:
    """One document of a certificate, checked against its digest."""
    kept = workflow.documents(ledger, workflow.status(ledger, number).record)
    if document not in kept:
        raise not_among("document", document, kept)
    name, media, data = kept[document]
    disposition = f"attachment; filename*=UTF-8''{quote(name, safe='')}"
    return Response(data, media_type=media, headers={"content-disposition": disposition})


@router.post("/{number}/void", status_code=201)
def declare_void(ledger: TheLedger, user: Metrologist, number: Number, body: VoidBody) -> dict[str, Any]:
    """Declare a certificate void; it stays, with the reason."""
    return _shown(workflow.void(ledger, number, body.reason, author=user.name))


@router.post("/{number}/supersede", status_code=201)
def replace(ledger: TheLedger, user: Metrologist, number: Number, body: SupersedeBody) -> dict[str, Any]:
    """Issue another certificate in place of this one."""
    wish = {"supersedes": number, "reason": body.reason, **_wish(body, user)}
    made = workflow.issue(ledger, body.calibration, body.verification, **wish)
    return _shown(workflow.status(ledger, made.keys["number"]))


def _wish(body: IssueBody, user: User) -> dict[str, Any]:
    about: dict[str, Any] = body.about.model_dump()
    about["environment"] = {"text": body.about.environment} if body.about.environment else {}
    return {
        "laboratory": None if body.laboratory is None else Laboratory(**body.laboratory.model_dump()),
        "author": user.name,
        "authoriser": (user.full_name or user.name, user.role),
        "language": body.language,
        "nonconforming": body.nonconforming,
        "accept_warnings": body.accept_warnings,
        "about": about,
    }


def _shown(one: workflow.CertificateStatus) -> dict[str, Any]:
    record = one.record
    return {
        **attributes(one, "number", "state", "by", "reason"),
        **attributes(record, "created", "author"),
        "serial": record.keys["serial"],
        "calibration": record.body["calibration"],
        "verification": record.body.get("verification"),
        "digest": workflow.digest_of(record),
        "documents": dict(record.body["documents"]),
    }
