"""From a finished session to a recorded calibration, and what the calibrations of a tool say over the years."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from typing import Any

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.expected import certified, expected_uncertainty
from inclinometry.calibration.result import Calibration
from inclinometry.constants import INCLINATIONS
from inclinometry.errors import refused
from inclinometry.files.json_codec import canonical
from inclinometry.files.tool_json import calibration_content, calibration_from, tool_of
from inclinometry.files.writing import program
from inclinometry.findings import Finding, without_notes
from inclinometry.laboratory.attitude import Judge, earlier_calibration
from inclinometry.laboratory.certificate.budget import expanded_columns
from inclinometry.laboratory.ledger.ledger import Draft, Ledger, LedgerError, Record
from inclinometry.laboratory.progress import Goal, session_progress
from inclinometry.laboratory.registry import cached_from_record, evaluations, not_registered, registered_site, rig_of
from inclinometry.laboratory.session import CLOSED, EVALUATED, Session, close_session_draft, load_session, require_open
from inclinometry.sensors import Tool, in_field_of, parameter_vector


def finish_calibration(ledger: Ledger, session: str, *, author: str, goal: Goal | None = None) -> Record:
    """Fit the session's readings, record the calibration and close the session, in one step.

    Raises LedgerError: the session is closed, or its readings cannot be fitted; says why.
    """
    seen = load_session(ledger, session)
    if seen.closed:
        raise LedgerError(CLOSED)
    found, outliers = _fit(ledger, seen, goal or Goal())
    return record_fit(ledger, seen, found, author=author, outliers=outliers)


def evaluate_again(ledger: Ledger, session: str, site: str, *, author: str, reason: str = "") -> Record:
    """Fit the readings of a finished session with the fields of a registered site; that is another calibration.

    From then on the session is of this site. The calibration before and its certificate stay as they are.
    """
    seen = load_session(ledger, session)
    before = ledger.latest("calibration", session=session)
    if before is None:
        raise LedgerError(Finding("session-unfinished"))
    if not can_be_evaluated_again(before):
        raise LedgerError(Finding("session-not-readings"))
    found, outliers = _fit(ledger, replace(seen, site=registered_site(ledger, site)), Goal())
    details = {"site": site, "before": before.id}
    keys = {"subject_kind": "session", "subject": session, "action": EVALUATED}
    event = Draft("event", keys, {"reason": reason.strip(), "details": details})
    return ledger.append_all([_draft(seen, found, outliers, details), event], author=author)[0]


def can_be_evaluated_again(calibration: Record) -> bool:
    """Whether a calibration is of readings in the ledger and of nothing else, as a tool.json or the tool's history."""
    return bool(calibration.body["readings"]) and "evidence" not in calibration.body.get("settings", {})


def _fit(ledger: Ledger, seen: Session, goal: Goal) -> tuple[Calibration, dict[str, Finding]]:
    """The calibration of the readings of a session and its outliers; LedgerError where they make none."""
    # of readings that are all alike, or whose fit has no usable uncertainty
    undetermined = Finding("ledger-not-turned", severity="refused")
    rig = rig_of(ledger, seen.id)
    if rig is None:
        raise not_registered("rig", seen.rig)
    distinct = {tuple((k, v.tobytes()) for k, v in sorted(row.capture.channels.items())) for row in seen.valid}
    if len(seen.valid) > 1 and len(distinct) == 1:
        raise LedgerError(undetermined)
    earlier = earlier_judge(ledger, seen)
    now = session_progress(seen, goal, rig, earlier=earlier)
    found = now.calibration
    if found is None or now.waiting is not None:
        raise LedgerError(now.waiting or undetermined)
    if not np.isfinite(found.covariance).all() or (np.diagonal(found.covariance) < 0.0).any():
        raise LedgerError(undetermined)
    return found, {str(number): what for number, what in now.outliers.items()}


def record_fit(
    ledger: Ledger,
    seen: Session,
    found: Calibration,
    *,
    author: str,
    outliers: Mapping[str, Finding] | None = None,
    settings: Mapping[str, Any] | None = None,
) -> Record:
    """Record what was fitted to the readings of a session and close it, in one step."""
    drafts = [_draft(seen, found, outliers or {}, settings or {}), close_session_draft(seen.id, "finished")]
    return ledger.append_all(drafts, author=author, unless=[require_open(seen.id)])[0]


def _draft(seen: Session, found: Calibration, outliers: Mapping[str, Finding], settings: Mapping[str, Any]) -> Draft:
    """The record of what was fitted; an error where it could not be read again."""
    content = plain_content(found)
    # nothing is recorded that could not be read again, for what is recorded stays
    calibration_from(json.loads(canonical(dict(content))), "the fit")
    readings = [row.record for row in seen.valid]
    apart = {number: what.stored() for number, what in outliers.items()}
    body = calibration_body(found, content, readings, seen.rig, seen.plan, len(readings), outliers=apart)
    body |= {"settings": dict(settings)} if settings else {}
    return Draft("calibration", {"serial": seen.serial, "session": seen.id}, body)


def calibration_body(
    found: Calibration,
    content: Mapping[str, Any],
    readings: list[str],
    rig: str,
    plan: str,
    positions: int,
    **more: Any,
) -> dict[str, Any]:
    """The body of the record of a calibration; `content` is that of its tool.json, `more` goes into the summary."""
    values = [[name, *pair] for name, pair in parameters(found.tool).items()]
    warned = [one.stored() for one in without_notes(found.findings)]
    about = {"rig": rig, "plan": plan, "positions": positions, "findings": warned, "parameters": values}
    return {
        "tool_json": content,
        "method": found.method,
        "readings": readings,
        "capability_deg": expected_table(found),
        "summary": about | more,
        "program": program(),
    }


def plain_content(calibration: Calibration) -> dict[str, Any]:
    """The content of its tool.json as plain lists and mappings."""
    content: dict[str, Any] = json.loads(canonical(calibration_content(calibration)))
    return content


def calibration_of(record: Record) -> Calibration:
    """The calibration of a record of that kind."""
    return calibration_from(dict(record.body["tool_json"]), f"calibration {record.id}")


def earlier_judge(ledger: Ledger, session: Session) -> Judge | None:
    """The newest calibration of the session's tool on its rig, by another session; None when there is none."""
    record = earlier_calibration(ledger, session)
    return None if record is None else Judge(calibration_of(record), record.created)


def expected_table(calibration: Calibration) -> dict[str, Any]:
    """Expanded uncertainties over inclination, worst azimuth and toolface, degrees: of one reading, and below
    "from_calibration" from the calibration alone; empty for a tool that can give no angle.
    """
    stated, k, _ = certified(calibration)
    found = expected_uncertainty(stated, INCLINATIONS)
    return {"coverage_factor": k, **expanded_columns(found, k)} if found.angles else {}


@dataclass(frozen=True, eq=False)
class History:
    """The calibrations of one tool, by the day of their readings.

    values, u : parameter -> (n,), NaN where a calibration does not have it.
    compared, u_compared : the same for the field of the first calibration; NaN where the unit is another.
    scale_unknown : kinds whose common scale is not compared: the field's strength is not stated there or in the first.
    """

    serial: str
    measured: Sequence[date]
    created: Sequence[str]
    records: Sequence[str]
    values: Mapping[str, Array]
    u: Mapping[str, Array]
    compared: Mapping[str, Array]
    u_compared: Mapping[str, Array]
    scale_unknown: Sequence[tuple[str, ...]]

    def __len__(self) -> int:
        return len(self.created)

    def change(self, parameter: str) -> tuple[Array, Array]:
        """Change of a parameter since the first calibration and its standard uncertainty; two runs are independent."""
        value, u = self.compared[parameter], self.u_compared[parameter]
        spread = np.sqrt(u**2 + u[0] ** 2)
        spread[0] = 0.0
        return value - value[0], spread


def history(ledger: Ledger, serial: str, *, limit: int = 200) -> History:
    """How the parameters of a tool went from calibration to calibration.

    Raises InputError: A tool that was never calibrated.
    """
    records = evaluations(ledger, serial, limit=limit)
    if not records:
        raise refused("session-no-calibration", {"serial": serial})

    def read(one: Record) -> tuple[date, date]:
        return measured(ledger, one, ledger.get("session", one.keys["session"]))

    days = {record.id: cached_from_record(ledger, record, "measured", read) for record in records}
    records.sort(key=lambda r: days[r.id][1])
    tools = [recorded_tool(ledger, record) for record in records]
    compared = [comparable(tool, tools[0]) for tool in tools]
    columns = (*_columns([parameters(tool) for tool in tools]), *_columns([one for one, _ in compared]))
    unknown = [kinds for _, kinds in compared]
    ids = [r.id for r in records]
    return History(serial, [days[name][1] for name in ids], [r.created for r in records], ids, *columns, unknown)


def comparable(tool: Tool, other: Tool) -> tuple[dict[str, tuple[float, float]], tuple[str, ...]]:
    """Parameters of a tool for the field of another calibration; the kinds whose common scale cannot be compared.

    NaN where the signals are in another unit.
    """
    there, unknown = in_field_of(tool, other)
    unlike = {
        kind for kind, triad in tool.triads.items() if kind in other.triads and triad.unit != other.triads[kind].unit
    }
    found = {
        name: (np.nan, np.nan) if name.partition(".")[0] in unlike else pair for name, pair in parameters(there).items()
    }
    return found, tuple(kind for kind in unknown if kind not in unlike)


def _columns(found: Sequence[Mapping[str, tuple[float, float]]]) -> tuple[dict[str, Array], dict[str, Array]]:
    """Estimates and standard uncertainties by parameter, NaN where a calibration does not have it."""
    names = dict.fromkeys(name for one in found for name in one)
    pairs = {name: np.array([one.get(name, (np.nan, np.nan)) for one in found]) for name in names}
    return {name: both[:, 0] for name, both in pairs.items()}, {name: both[:, 1] for name, both in pairs.items()}


def measured(ledger: Ledger, calibration: Record, session: Record) -> tuple[date, date]:
    """First and last day of the readings of a calibration; of a file that was brought in later, the day stated with it.

    Without either the day of the record.
    """
    elsewhere = session.body.get("settings", {}).get("performed")
    days = [elsewhere] if elsewhere else [ledger.get("reading", name).created for name in calibration.body["readings"]]
    found = sorted(date.fromisoformat(day[:10]) for day in days or [calibration.created])
    return found[0], found[-1]


def recorded_tool(ledger: Ledger, record: Record) -> Tool:
    """The tool of a recorded calibration."""
    return cached_from_record(
        ledger, record, "tool", lambda one: tool_of(dict(one.body["tool_json"]), f"calibration {one.id}")
    )


def parameters(tool: Tool) -> dict[str, tuple[float, float]]:
    """Parameter of the tool -> (estimate, standard uncertainty), in the parameter's unit."""
    estimate = np.concatenate([parameter_vector(triad) for triad in tool.triads.values()])
    sd = np.sqrt(np.diagonal(tool.covariance))
    return dict(zip(tool.parameter_names, zip(estimate.tolist(), sd.tolist(), strict=True), strict=True))
