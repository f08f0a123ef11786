"""Sessions: opened, captured, judged while the tool is on the rig, closed."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import APIRouter, Path, Query
from pydantic import Field

from inclinometry.errors import refused
from inclinometry.findings import Finding, without_notes
from inclinometry.laboratory import drift
from inclinometry.laboratory.attitude import at_target
from inclinometry.laboratory.guided_plans import plan_for
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.progress import Goal, Progress, goal_of, judge_of, proposal, session_progress
from inclinometry.laboratory.registry import RegisteredRig, find_rig, given, not_registered, rig_of
from inclinometry.laboratory.results import earlier_judge, evaluate_again
from inclinometry.laboratory.session import (
    Capture,
    RecordedReading,
    Session,
    capture,
    close_session,
    dial_at,
    load_session,
    open_session,
    reject,
    sessions,
)
from inclinometry.laboratory.web.api.access import (
    REFUSALS,
    After,
    Body,
    Limit,
    Operator,
    Reader,
    RecordId,
    TheLedger,
    attributes,
)
from inclinometry.laboratory.web.api.registry import shown
from inclinometry.laboratory.web.frame import current
from inclinometry.laboratory.web.refusals import answer

router = APIRouter(tags=["sessions"], responses=REFUSALS)

Number = Annotated[int, Path(ge=1, le=5000)]
Text = Annotated[str, Field(max_length=2000)]
Signals = Annotated[list[float], Field(min_length=1, max_length=100)]
Kind = Literal["accelerometer", "magnetometer", "gyro"]


class SessionBody(Body):
    """A session to be opened."""

    serial: str = Field(min_length=1, max_length=200)
    rig: str = Field(min_length=1, max_length=200)
    plan: str = Field(min_length=1, max_length=50)
    number: int | None = Field(default=None, ge=1, le=500)
    purpose: Literal["calibrate", "verify", "temperature"] = "calibrate"
    site: Text = ""
    temperatures_degC: list[float] = Field(default_factory=list, max_length=20)  # noqa: N815
    wanted_u_azimuth_deg: float | None = Field(default=None, gt=0.0, lt=180.0)
    wanted_u_inclination_deg: float | None = Field(default=None, gt=0.0, lt=180.0)
    condition: Text = ""
    customer: Text = ""
    left_handed: bool = False


class ReadingBody(Body):
    """What the sensors said; `dial_deg` is what the rig's dials say, however they count. `attempt`, 1 for the first
    reading of a position, makes a repeated request fail. `reason` is needed where a calibration shows that the tool is
    far from these dials (409, code ledger-far-from-target or ledger-far-verifying); it is recorded in the note.
    """

    attempt: int = Field(ge=1, le=1000)
    dial_deg: tuple[float, float, float]
    channels: dict[Kind, Signals] = Field(min_length=1)
    sd: dict[Kind, Signals] = Field(default_factory=dict)
    units: dict[Kind, Text] = Field(default_factory=dict)
    count: int = Field(default=1, ge=1, le=10_000_000)
    duration_s: float = Field(default=0.0, ge=0.0)
    temperature_degC: float | None = None  # noqa: N815
    note: Text = ""
    reason: Text = ""


class LiveBody(Body):
    """A reading to be taken from the attached instrument; `reason` as of a reading that is given."""

    attempt: int = Field(ge=1, le=1000)
    dial_deg: tuple[float, float, float] | None = None
    seconds: float = Field(default=5.0, gt=0.0, le=600.0)
    reason: Text = ""


class EvaluationBody(Body):
    """The name of a registered site, and why the readings are evaluated again with its fields."""

    site: str = Field(min_length=1, max_length=200)
    reason: Text = ""


class Reason(Body):
    """Why."""

    reason: str = Field(min_length=1, max_length=2000)


@router.get("/sessions")
def list_sessions(
    ledger: TheLedger,
    _: Reader,
    serial: Annotated[str | None, Query(max_length=200)] = None,
    before: After = 0,
    limit: Limit = 50,
) -> list[dict[str, Any]]:
    """Sessions, newest first, recorded before the place `before` in the chain."""
    return [shown(record) for record in sessions(ledger, serial=serial, limit=limit, before=before)]


@router.post("/sessions", status_code=201)
def begin(ledger: TheLedger, user: Operator, body: SessionBody) -> dict[str, Any]:
    """Open a session with a plan by name."""
    rig = _rig(ledger, body.rig)
    plan, settings = plan_for(
        body.plan, ledger, body.serial, rig, number=body.number, temperatures=body.temperatures_degC
    )
    settings |= {name: value for name in ("site", "condition", "customer") if (value := getattr(body, name))}
    if body.left_handed:
        settings["settings"] = {**settings.get("settings", {}), "left_handed": True}
    goal = {"u_azimuth_deg": body.wanted_u_azimuth_deg, "u_inclination_deg": body.wanted_u_inclination_deg}
    settings["target_u_deg"] = settings.get("target_u_deg", {}) | {k: v for k, v in goal.items() if v is not None}
    session = open_session(
        ledger, body.serial, plan, rig=body.rig, author=user.name, purpose=body.purpose, settings=settings
    )
    return _session(session)


@router.get("/sessions/{session}")
def one_session(ledger: TheLedger, _: Reader, session: RecordId) -> dict[str, Any]:
    """A session with its positions and readings."""
    return _session(load_session(ledger, session))


@router.post("/sessions/{session}/readings/{number}", status_code=201)
def add_reading(
    ledger: TheLedger, user: Operator, session: RecordId, number: Number, body: ReadingBody
) -> dict[str, Any]:
    """Record the reading of a position; answered when it is on the disk."""
    reading = Capture(**given(Capture, {**body.model_dump(), "captured": "api"}, 0))
    reading = _at_target(ledger, session, reading, body.reason)
    return _reading(capture(ledger, session, number, reading, author=user.name, attempt=body.attempt))


@router.post("/sessions/{session}/capture/{number}", status_code=201)
def capture_live(
    ledger: TheLedger, user: Operator, session: RecordId, number: Number, body: LiveBody
) -> dict[str, Any]:
    """Take the reading of a position from the attached instrument."""
    feed = current().feed
    if feed is None:
        raise refused("web-no-instrument")
    dial = None if body.dial_deg is None else _dial(body.dial_deg)
    if dial is None:
        known = {p.number: p.dial for p in load_session(ledger, session).positions}
        if number not in known:
            raise refused("input-needs", {"name": f"position {number}", "needed": ("dial_deg",)})
        dial = known[number]
    reading = _at_target(ledger, session, feed.capture(dial, body.seconds, how="api"), body.reason)
    taken = capture(ledger, session, number, reading, author=user.name, attempt=body.attempt)
    feed.moved()  # the samples of one reading are never those of another
    return _reading(taken)


@router.post("/sessions/{session}/readings/{number}/reject", status_code=201)
def reject_reading(
    ledger: TheLedger, user: Operator, session: RecordId, number: Number, body: Reason
) -> dict[str, Any]:
    """Leave the newest reading of a position out."""
    seen = load_session(ledger, session)
    if not seen.has(number):
        raise refused("session-no-reading", {"position": number})
    reject(ledger, seen.taken[number], body.reason, author=user.name)
    return _session(load_session(ledger, session))


@router.get("/sessions/{session}/progress")
def how_it_stands(ledger: TheLedger, _: Reader, session: RecordId) -> dict[str, Any]:
    """What the readings would certify now, what is an outlier, where to go next."""
    seen = load_session(ledger, session)
    rig, goal = rig_of(ledger, session) or _rig(ledger, seen.rig), goal_of(ledger, seen)
    now = _fit(ledger, seen, rig, goal)
    place = None if seen.plan == drift.CHECK else proposal(seen, goal, rig, now)
    at = None if place is None else dial_at(seen.dials, place.azimuth, place.inclination, place.toolface)
    return {
        "captured": now.captured,
        "fitted": now.calibration is not None,
        "waiting_for": None if now.waiting is None else answer(now.waiting),
        "U_azimuth_deg": _finite(now.u_azimuth),
        "U_inclination_deg": _finite(now.u_inclination),
        "outliers": {str(number): answer(what) for number, what in now.outliers.items()},
        "reached": now.reached,
        "warnings": [] if now.calibration is None else [answer(one) for one in without_notes(now.calibration.findings)],
        "next_deg": None if at is None else _degrees(at),
    }


@router.post("/sessions/{session}/finish", status_code=201)
def finish(ledger: TheLedger, user: Operator, session: RecordId) -> dict[str, Any]:
    """Fit the readings, record the calibration, close the session."""
    goal = goal_of(ledger, load_session(ledger, session))
    return shown(drift.finish(ledger, session, author=user.name, goal=goal))


@router.post("/sessions/{session}/evaluate", status_code=201)
def evaluate(ledger: TheLedger, user: Operator, session: RecordId, body: EvaluationBody) -> dict[str, Any]:
    """Fit the readings of a finished session with the fields of a site; recorded as another calibration."""
    return shown(evaluate_again(ledger, session, body.site, author=user.name, reason=body.reason))


@router.post("/sessions/{session}/abandon", status_code=204)
def abandon(ledger: TheLedger, user: Operator, session: RecordId, body: Reason) -> None:
    """Close the session without a result; its readings stay."""
    ledger.get("session", session)
    close_session(ledger, session, "abandoned", author=user.name, reason=body.reason)


@router.get("/live")
def live(_: Reader) -> dict[str, Any]:
    """The newest sample of the attached instrument and whether the tool stands still."""
    feed = current().feed
    if feed is None:
        return {"connected": False, "word": "none", **answer(Finding("web-no-instrument"))}
    found = feed.stability()
    return {
        "connected": feed.connected,
        **attributes(found, "word", "still", "count"),
        **answer(found.finding),
        "mean": {kind: values.tolist() for kind, values in found.mean.items()},
        "sd": {kind: values.tolist() for kind, values in found.sd.items()},
        "temperature_degC": found.temperature,
    }


_LAST: list[tuple[tuple[object, ...], Progress]] = []
"""The newest fit and what it was made from: a program asks for it before and after each reading."""


def _fit(ledger: Ledger, seen: Session, rig: RegisteredRig, goal: Goal) -> Progress:
    """The running fit of a session."""
    if seen.plan == drift.CHECK:
        return drift.check_progress(ledger, seen, goal)
    earlier = earlier_judge(ledger, seen)
    made = "" if earlier is None else earlier.made
    about = (seen.id, tuple(row.record for row in seen.valid), seen.dials, rig, seen.site, goal, made)
    if not _LAST or _LAST[0][0] != about:
        _LAST[:] = [(about, session_progress(seen, goal, rig, earlier=earlier))]
    return _LAST[0][1]


def _at_target(ledger: Ledger, session: str, reading: Capture, reason: str) -> Capture:
    """The reading as it is to be recorded; refused far from its target without a reason."""
    seen = load_session(ledger, session)
    if seen.closed:
        return reading  # what records it says so
    rig = rig_of(ledger, session) or _rig(ledger, seen.rig)
    now = None if seen.purpose == "verify" else _fit(ledger, seen, rig, goal_of(ledger, seen))
    return at_target(reading, judge_of(earlier_judge(ledger, seen), now), seen, rig.sd, reason)


def _rig(ledger: Ledger, name: str) -> RegisteredRig:
    rig = find_rig(ledger, name)
    if rig is None:
        raise not_registered("rig", name)
    return rig


def _session(session: Session) -> dict[str, Any]:
    return {
        **attributes(session, "id", "serial", "purpose", "plan", "rig", "created", "author", "closed"),
        "dials": asdict(session.dials),
        "positions": [
            {"number": p.number, "dial_deg": _degrees(p.dial), "done": session.has(p.number)} for p in session.positions
        ],
        "readings": [_reading(taken) for _, taken in sorted(session.taken.items())],
        "settings": dict(session.settings),
    }


def _reading(taken: RecordedReading) -> dict[str, Any]:
    return {
        "id": taken.record,
        **attributes(taken, "number", "attempt", "created", "author", "rejected"),
        **attributes(taken.capture, "count", "note"),
        "dial_deg": _degrees(taken.capture.dial),
        "channels": {kind: values.tolist() for kind, values in taken.capture.channels.items()},
        "temperature_degC": taken.capture.temperature,
    }


def _finite(angle: float) -> float | None:
    return float(np.degrees(angle)) if np.isfinite(angle) else None


def _degrees(dial: tuple[float, float, float]) -> list[float]:
    return [float(x) for x in np.degrees(dial).round(9)]


def _dial(degrees: tuple[float, float, float]) -> tuple[float, float, float]:
    azimuth, inclination, toolface = (float(x) for x in np.radians(degrees))
    return azimuth, inclination, toolface
