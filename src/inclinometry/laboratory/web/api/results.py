"""Calibrations, verifications, and the history of a tool."""

from __future__ import annotations

import math
from typing import Annotated, Any

from fastapi import APIRouter, Query
from pydantic import Field

from inclinometry.calibration.decision import Limits
from inclinometry.errors import not_among
from inclinometry.files.limits import limit_names, read_limits
from inclinometry.laboratory.results import history
from inclinometry.laboratory.verification import about_protocols, begin_verification, finish_verification, protocols
from inclinometry.laboratory.web.api.access import (
    REFUSALS,
    After,
    Body,
    Key,
    Limit,
    Operator,
    Reader,
    RecordId,
    TheLedger,
)
from inclinometry.laboratory.web.api.registry import shown

router = APIRouter(tags=["results"], responses=REFUSALS)

Serial = Annotated[str | None, Query(max_length=200)]


class VerdictBody(Body):
    """What to judge with: the id of a calibration, and the name of limits (see GET /limits) or none."""

    calibration: str = Field(pattern="^[0-9a-f]{32}$")
    limits: str | None = Field(default=None, max_length=100)


class VerificationBody(VerdictBody):
    """A verification to be opened: its calibration, a protocol (see GET /protocols), the limits that were agreed."""

    protocol: str = Field(min_length=1, max_length=100)


@router.get("/calibrations")
def calibrations(
    ledger: TheLedger, _: Reader, serial: Serial = None, before: After = 0, limit: Limit = 20
) -> list[dict[str, Any]]:
    """Calibrations, newest first."""
    keys = {} if serial is None else {"serial": serial}
    return [shown(r) for r in ledger.find("calibration", newest=True, after=before, limit=limit, **keys)]


@router.get("/calibrations/{calibration}")
def one_calibration(ledger: TheLedger, _: Reader, calibration: RecordId) -> dict[str, Any]:
    """One calibration; `body.tool_json` is what the command line calls tool.json."""
    return shown(ledger.get("calibration", calibration))


@router.get("/verifications")
def verifications(
    ledger: TheLedger, _: Reader, serial: Serial = None, before: After = 0, limit: Limit = 20
) -> list[dict[str, Any]]:
    """Verifications, newest first."""
    keys = {} if serial is None else {"serial": serial}
    return [shown(r) for r in ledger.find("verification", newest=True, after=before, limit=limit, **keys)]


@router.post("/verifications", status_code=201)
def begin(ledger: TheLedger, user: Operator, body: VerificationBody) -> dict[str, Any]:
    """Open a session at the positions of a protocol; limits that the stand cannot verify are refused here."""
    limits = _limits(body)
    session = begin_verification(ledger, body.calibration, body.protocol, author=user.name, limits=limits)
    return shown(ledger.get("session", session.id))


@router.post("/sessions/{session}/verdict", status_code=201)
def verdict(ledger: TheLedger, user: Operator, session: RecordId, body: VerdictBody) -> dict[str, Any]:
    """Judge a session's positions, record the verdict, close the session."""
    return shown(finish_verification(ledger, session, body.calibration, author=user.name, limits=_limits(body)))


@router.get("/limits")
def limits(_: Reader) -> list[str]:
    """Names of the limits that are shipped."""
    return list(limit_names())


@router.get("/protocols")
def list_protocols(_: Reader) -> dict[str, dict[str, Any]]:
    """Verification protocols by name."""
    about = about_protocols()
    return {
        name: {"title": about[name]["title"], "source": about[name]["source"], "positions": len(plan)}
        for name, plan in protocols().items()
    }


@router.get("/tools/{serial:path}/history")
def tool_history(ledger: TheLedger, _: Reader, serial: Key) -> dict[str, Any]:
    """How the parameters of a tool went from calibration to calibration."""
    found = history(ledger, serial)
    numbers = {
        name: {"value": _plain(found.values[name].tolist()), "u": _plain(found.u[name].tolist())}
        for name in found.values
    }
    return {
        "serial": serial,
        "measured": [day.isoformat() for day in found.measured],
        "created": list(found.created),
        "calibrations": list(found.records),
        "parameters": numbers,
    }


def _plain(values: list[float]) -> list[float | None]:
    """Numbers, null where a calibration does not have the parameter."""
    return [value if math.isfinite(value) else None for value in values]


def _limits(body: VerdictBody) -> Limits | None:
    """Shipped limits by name: a request must not name files of the server."""
    if body.limits is None:
        return None
    if body.limits not in limit_names():
        raise not_among("limits", body.limits[:80], limit_names())
    return read_limits(body.limits)
