"""Verification on the stand: named sets of independent positions, and the verdict recorded."""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import replace
from functools import cache
from importlib.resources import files
from typing import Any, Final

import numpy as np

from inclinometry.calibration.conformity import Verification, planned, verify
from inclinometry.calibration.decision import Limits
from inclinometry.calibration.plans import Plan, spread
from inclinometry.constants import ANGLES
from inclinometry.errors import not_among, refused
from inclinometry.files.json_codec import restored
from inclinometry.files.verification_json import as_now, judged_positions, stated_limits
from inclinometry.files.writing import program
from inclinometry.findings import Finding
from inclinometry.laboratory.certificate.requirements import other_tool
from inclinometry.laboratory.ledger.ledger import Draft, Ledger, LedgerError, Record
from inclinometry.laboratory.registry import RegisteredRig, find_rig, not_registered
from inclinometry.laboratory.results import calibration_of
from inclinometry.laboratory.session import (
    CLOSED,
    Session,
    bench_readings,
    close_session_draft,
    load_session,
    open_session,
    positions_open,
    require_open,
    site_of,
)

# The limits agreed when a verification is opened: kept with the session, held to when it is judged.

OWN: Final = "laboratory"
"""Name of limits the laboratory states itself."""


def limits_content(limits: Limits) -> dict[str, Any]:
    """Limits in degrees, as a session keeps them."""
    whole = stated_limits(limits) or {}
    return {name: round(value, 9) if isinstance(value, float) else value for name, value in whole.items()}


def limits_of(session: Session) -> Limits | None:
    """The limits agreed when a verification was opened; None where none were."""
    content = dict(session.settings.get("settings", {})).get("limits")
    return None if not content else limits_from(content)


def limits_from(content: dict[str, Any]) -> Limits:
    """Limits of `limits_content`; InputError for a source that is not named, no limit, values out of range.

    >>> limits_from({"name": "own", "source": "contract 7", "azimuth_deg": 1.0}).guard
    'none'
    """
    source = str(content.get("source") or "").strip()
    if not source:
        raise refused("input-empty", {"name": "limits.source"})
    angles = {name: content.get(f"{name}_deg") for name in ANGLES}
    if all(value is None for value in angles.values()):
        raise refused("file-limits", {"names": tuple(angles)})
    low = float(np.radians(content.get("min_inclination_deg_for_azimuth") or 0.0))
    limits = {name: None if value is None else float(np.radians(value)) for name, value in angles.items()}
    name, guard = str(content.get("name") or OWN), str(content.get("guard") or "none")
    return Limits(name, source, **limits, min_inclination_for_azimuth=low, guard=guard)


def applicable_limits(session: Session, calibration: str, limits: Limits | None) -> Limits | None:
    """The limits to judge a session by; what was agreed at its opening is not changed once there are results.

    Raises LedgerError: another calibration or other limits than agreed.
    """
    agreed_with = session.settings.get("calibration")
    if not agreed_with:
        return limits
    if agreed_with != calibration:
        about = {"what": "calibration", "agreed": str(agreed_with), "given": calibration}
        raise LedgerError(Finding("session-agreed", about))
    agreed = limits_of(session)
    if limits is not None and (agreed is None or limits_content(limits) != limits_content(agreed)):
        about = {"what": "limits", "agreed": "" if agreed is None else agreed.name, "given": limits.name}
        raise LedgerError(Finding("session-agreed", about))
    return agreed


@cache
def protocols() -> dict[str, Plan]:
    """The positions of the shipped protocols by name.

    Every inclination with every azimuth and toolface, in that order of turning.

    >>> {name: len(plan) for name, plan in protocols().items()}
    {'spread-12': 12, 'azimuth': 72, 'inclination': 14, 'long': 480, 'roll-4': 4, 'roll-8': 8}
    """
    found = {}
    for name, entry in about_protocols().items():
        if name == "spread-12":  # a plan of the command line too
            found[name] = replace(spread(), name=name)
            continue
        dials = (entry[f"{dial}_deg"] for dial in ("inclination", "azimuth", "toolface"))
        rows = np.radians(np.array(list(itertools.product(*dials)), dtype=float))
        found[name] = Plan(name, rows[:, 1], rows[:, 0], rows[:, 2])
    return found


@cache
def about_protocols() -> dict[str, dict[str, Any]]:
    """Title, source and dials of the shipped protocols by name."""
    text = files("inclinometry.laboratory").joinpath("protocols.json").read_text("utf-8")
    return dict(json.loads(text))


def finish_verification(
    ledger: Ledger, session: str, calibration: str, *, author: str, limits: Limits | None = None
) -> Record:
    """Judge a session's positions with a recorded calibration of the same tool, record the verdict, close the session.

    Limits agreed when the session was opened go before `limits`. Refused: the session the calibration was made from, a
    position without a valid reading, a limit of an angle that no position judges.
    """
    seen, record = load_session(ledger, session), ledger.get("calibration", calibration)
    if seen.closed:
        raise LedgerError(CLOSED)
    if record.keys["serial"] != seen.serial:
        raise LedgerError(other_tool("session", seen.serial, record.keys["serial"]))
    if record.keys["session"] == session:
        raise LedgerError(Finding("session-own-readings"))
    limits = applicable_limits(seen, calibration, limits)
    found = judged(ledger, session, calibration, limits)
    lost = missing_positions(seen, found, limits)
    if lost is not None:
        raise LedgerError(lost)
    body = {
        "verdict": found.verdict,
        "limits": stated_limits(limits),
        "report": report(found, seen),
        "readings": [row.record for row in seen.valid],
        "session": session,
        "program": program(),
    }
    drafts = [
        Draft("verification", {"serial": seen.serial, "calibration": calibration}, body),
        close_session_draft(session, "finished"),
    ]
    return ledger.append_all(drafts, author=author, unless=[require_open(session)])[0]


def missing_positions(seen: Session, found: Verification, limits: Limits | None) -> Finding | None:
    """What a verdict lacks; None when it may be recorded: every position read, every limit judged."""
    if any(not seen.has(place.number) for place in seen.positions):
        return positions_open(seen)
    for column, name in enumerate(ANGLES):
        wanted = limits is not None and getattr(limits, name) is not None
        if wanted and all(row[column] == "not judged" for row in found.decision):
            return Finding("session-not-inclined", {"angle": name})
    return None


def recorded(record: Record) -> dict[str, Any]:
    """Verdict, limits and report of a recorded verification, one of an older version as it is said now."""
    return as_now({name: record.body[name] for name in ("verdict", "limits", "report")})


def judged(ledger: Ledger, session: str, calibration: str, limits: Limits | None = None) -> Verification:
    """The verdict on the positions captured so far; nothing is recorded."""
    seen, made = load_session(ledger, session), calibration_of(ledger.get("calibration", calibration))
    # limits agreed at the opening were found verifiable then, or warned of
    return verify(bench_readings(seen), made, limits, agreed=limits_of(seen) is not None)


def report(found: Verification, seen: Session) -> dict[str, Any]:
    """Position by position, and how much of the protocol was taken."""
    taken = sum(seen.has(place.number) for place in seen.positions)
    plan = {"name": seen.plan, "positions_captured": taken, "positions": len(seen.positions)}
    foreseen = [restored(one, "note") for one in seen.stated.get("foreseen", ())]
    # what came out as foreseen is said once
    found_since = [one for one in found.findings if not any(_alike(one, other) for other in foreseen)]
    before = [Finding("verify-planned", {"finding": one}, severity="note") for one in foreseen]
    findings = [one.stored() for one in (*found_since, *before)]
    return {"protocol": plan, **judged_positions(found), "findings": findings}


def _alike(found: Finding, other: Finding) -> bool:
    """Whether two findings are of one code and their numbers agree as far as sentences show them."""
    close = 0.05
    if found.code != other.code or found.values.keys() != other.values.keys():
        return False
    return all(
        math.isclose(one, with_, rel_tol=close) if isinstance(one, float) and isinstance(with_, float) else one == with_
        for one, with_ in zip(found.values.values(), map(other.values.__getitem__, found.values), strict=True)
    )


# Opening a verification on the stand, with the limits it will be judged by.


def begin_verification(
    ledger: Ledger, calibration: str, protocol_name: str, *, author: str, limits: Limits | None = None
) -> Session:
    """Open a session at the positions of a protocol, on the rig of the calibration.

    Positions that the rig cannot be set to are left out; the plan's name says so. Without limits no conformity is
    stated. A limit below twice the expanded uncertainty of the comparison is refused.
    """
    record, made, rig, plan = _planned(ledger, calibration, protocol_name)
    settings: dict[str, Any] = {"calibration": calibration, "limits": "" if limits is None else limits.name}
    kept: dict[str, Any] = {} if limits is None else {"limits": limits_content(limits)}
    # what is said before the first reading is kept, and stands on the protocol beside what was found
    worth = foreseen(ledger, calibration, protocol_name, limits).power
    if worth is not None:
        kept["foreseen"] = [one.stored() for one in worth.findings]
    if kept:
        settings["settings"] = kept
    if site := site_of(ledger, made):
        settings["site"] = site
    if "reference" in made.body.get("settings", {}):
        settings["settings"] = kept | {"reference": made.body["settings"]["reference"]}
    return open_session(
        ledger, record.keys["serial"], plan, rig=rig.name, author=author, purpose="verify", settings=settings
    )


def foreseen(ledger: Ledger, calibration: str, protocol_name: str, limits: Limits | None = None) -> Verification:
    """What a verification will be worth, before it is opened; arguments and errors as `begin_verification`.

    Readings are taken to be averaged as they were at the calibration.
    """
    record, made, _, plan = _planned(ledger, calibration, protocol_name)
    counts = [row.capture.count for row in load_session(ledger, made.id).valid]
    return planned(plan, calibration_of(record), limits, count=int(np.median(counts)) if counts else 1)


def _planned(ledger: Ledger, calibration: str, protocol_name: str) -> tuple[Record, Record, RegisteredRig, Plan]:
    """Calibration, its session, its rig, and the positions of a protocol that this rig can be set to."""
    record = ledger.get("calibration", calibration)
    made = ledger.get("session", record.keys["session"])
    rig, plan = find_rig(ledger, made.body["rig"]), protocols().get(protocol_name)
    if rig is None:
        raise not_registered("rig", made.body["rig"])
    if plan is None:
        raise not_among("protocol", protocol_name, protocols())
    return record, made, rig, reachable(plan, rig)


def reachable(plan: Plan, rig: RegisteredRig) -> Plan:
    """The positions of a plan that lie within the limits of a rig's dials; InputError when none does."""
    slack = 1e-9
    inside = np.ones(len(plan), dtype=bool)
    for name in ("azimuth", "inclination", "toolface"):
        low, high = getattr(rig, name)
        turned = getattr(plan, name)[:, None] + (0.0 if name == "inclination" else 2.0 * np.pi * np.arange(-1, 2))
        turned = np.atleast_2d(turned)
        inside &= np.any((turned >= low - slack) & (turned <= high + slack), axis=1)
    if not inside.any():
        raise refused("session-unreachable", {"rig": rig.name, "plan": plan.name})
    if inside.all():
        return plan
    sets = tuple(itertools.compress(plan.roll_set, inside)) if plan.roll_set else ()
    name = f"{plan.name}, {int(inside.sum())} of {len(plan)} positions within reach of the rig"
    return Plan(name, plan.azimuth[inside], plan.inclination[inside], plan.toolface[inside], sets)
