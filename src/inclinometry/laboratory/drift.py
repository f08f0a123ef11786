"""The drift of the tools in a ledger: their histories, what was fitted to them, and checks that rest on both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, date, datetime
from typing import Any, Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.drift import SIXTY, DriftModel, DriftState, drift_states
from inclinometry.calibration.drift_alarm import Alarm, judged_run
from inclinometry.calibration.drift_check import DriftCheck, check_with_prior
from inclinometry.calibration.drift_status import FleetStatus
from inclinometry.calibration.readings import BenchReadings
from inclinometry.errors import InclinometryError, InputError, out_of_range, refused
from inclinometry.files.json_codec import restored
from inclinometry.files.tool_json import tool_of
from inclinometry.findings import Finding
from inclinometry.history import (
    DAYS_PER_YEAR,
    CalibrationRecord,
    ToolHistory,
    relative_parameters,
    tool_from_relative,
    tool_history,
)
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError, Record
from inclinometry.laboratory.placeholders import stated
from inclinometry.laboratory.progress import Goal, Progress, progress_of, unfitted, waiting_for
from inclinometry.laboratory.registry import (
    RegisteredRig,
    RegisteredTool,
    external_value,
    find_tool,
    listed,
    not_registered,
    rig_of,
)
from inclinometry.laboratory.results import finish_calibration, record_fit
from inclinometry.laboratory.session import Session, bench_readings, load_session, positions_open
from inclinometry.laboratory.valid_certificates import Certificates, every
from inclinometry.sensors import Tool

DOSES: Final = ("hours", "shock", "heat")
"""What a session's settings may say of a tool since its calibration before: `history.CalibrationRecord`."""
CHECK: Final = "six"
"""Name of the plan that is completed by the tool's history."""


class LedgerHistory(NamedTuple):
    """The history of a tool, the record of the calibration it is relative to, and why others are not in it."""

    history: ToolHistory
    reference: str
    passed_over: Sequence[Finding]


class RunEvidence(NamedTuple):
    """What a run in the hole says of a tool, as it is recorded.

    run : its name. date : its day. hours, shock, heat : since the calibration or run before.
    reference : id of the calibration's record that the stations were reduced with, to which values (24,) and covariance
        (24, 24) are relative (`survey.history_from_run.run_evidence`).
    stations, chi_square, freedom, priors : of the analysis. inputs : name -> digest.
    """

    run: str
    date: date
    hours: float
    shock: float
    heat: float
    reference: str
    values: Array
    covariance: Array
    stations: int
    chi_square: float
    freedom: int
    priors: str
    inputs: Mapping[str, str]


def judge_run(history: ToolHistory, reference: Tool, run: RunEvidence, model: DriftModel, past: Array) -> Alarm:
    """Evidence of a run compared with what was known of the tool before its day.

    Raises InputError: a run before the first calibration.
    """
    before = [k for k, (day, name) in enumerate(zip(history.date, history.run, strict=True))
              if day <= run.date and name != run.run]  # fmt: skip
    if not before or history.reference is None:
        raise InputError(_before(history.serial, run.run, run.date))
    doses = (run.hours, run.shock, run.heat)
    state = _predicted(history.until(before[-1] + 1), model, run.date, doses)
    seen = tool_from_relative(reference, run.values, run.covariance)
    return judged_run(state, model, *relative_parameters(seen, history.reference), past)


def _before(serial: str, run: str, day: date) -> Finding:
    return Finding("session-run-before", {"serial": serial, "run": run, "day": str(day)})


def _predicted(history: ToolHistory, model: DriftModel, day: date, doses: Sequence[float]) -> DriftState:
    """What is known of a tool on a day after all of its history; doses: hours, shock, heat since."""
    years = max((day - history.date[-1]).days / DAYS_PER_YEAR, 1e-3)
    return drift_states([history], model)[0][-1].predicted(model, years, doses[0], doses[1:])


def ledger_history(ledger: Ledger, certificates: Certificates, serial: str) -> LedgerHistory:
    """The certified calibrations of a registered tool on the days of their readings, runs in the hole between them.

    Void and superseded ones are left out; what the tool did before a void one counts for the next. Of a check that
    rested on the history, only what its readings alone say is taken: nothing counts twice.
    """
    tool = find_tool(ledger, serial)
    if tool is None:
        raise not_registered("tool", serial)
    found: list[CalibrationRecord] = []
    passed_over: list[Finding] = []
    runs: list[CalibrationRecord] = []
    reference = ""
    carried = np.zeros(len(DOSES))
    for one in sorted(certificates.of(serial), key=lambda certified: certified.performed):
        if one.state == "superseded":
            continue
        record = ledger.get("calibration", one.calibration)
        session = ledger.get("session", record.keys["session"]).body
        carried += [float(session.get("settings", {}).get(name, 0.0)) for name in DOSES]
        if one.state != "issued":
            continue
        seen = _seen(ledger, record)
        if not np.diagonal(seen.covariance).all():
            about = {"day": str(one.performed), "number": one.number, "method": str(record.body["method"])}
            passed_over.append(Finding("session-no-covariance", {"serial": serial, **about}))
            continue
        reference = reference or record.id
        hours, shock, heat = (float(x) for x in carried)
        found.append(CalibrationRecord(one.performed, seen, str(session["rig"]), hours, shock, heat))
        carried[:] = 0.0
    if not found:
        raise refused("session-no-history", {"name": serial})
    for run in _runs(ledger, serial):
        if run.date < found[0].date:
            passed_over.append(_before(serial, run.run, run.date))
            continue
        after = next((k for k, one in enumerate(found) if one.date > run.date), None)
        if after is not None:  # what the tool did until the run is no part of what it did after
            left = {name: max(getattr(found[after], name) - getattr(run, name), 0.0) for name in DOSES}
            found[after] = replace(found[after], **left)
        runs.append(run)
    return LedgerHistory(tool_history(serial, tool.name, [*found, *runs]), reference, passed_over)


def _runs(ledger: Ledger, serial: str) -> list[CalibrationRecord]:
    """Runs in the hole whose evidence was recorded, by name the last, and not withdrawn."""
    found: dict[str, CalibrationRecord] = {}
    for event in every(ledger, "event", subject_kind="run", subject=serial):
        said = event.body["details"]
        found.pop(said["run"], None)
        if event.keys["action"] != "recorded":
            continue
        seen = _from_evidence(ledger, said)
        doses = {name: said[name] for name in DOSES}
        found[said["run"]] = CalibrationRecord(date.fromisoformat(said["date"]), seen, run=said["run"], **doses)
    return list(found.values())


def record_run(ledger: Ledger, serial: str, run: RunEvidence, *, author: str) -> Record:
    """Record the evidence of a run for a tool's history; it takes the place of what a run of this name said before."""
    details = {name: external_value("", value) for name, value in run._asdict().items()}
    keys = {"subject_kind": "run", "subject": serial, "action": "recorded"}
    return ledger.append("event", keys, {"details": details}, author=author)


def withdraw_run(ledger: Ledger, serial: str, run: str, reason: str, *, author: str) -> None:
    """Take a run out of a tool's history; the record of it stays.

    Raises InputError: no such run is in the history; no reason.
    """
    there = sorted(one.run for one in _runs(ledger, serial))
    if run not in there:
        raise refused("input-unknown", {"names": (run,), "known": tuple(there)})
    if not stated(reason):
        raise refused("input-missing", {"names": ("reason",)})
    keys = {"subject_kind": "run", "subject": serial, "action": "withdrawn"}
    ledger.append("event", keys, {"details": {"run": run}, "reason": reason}, author=author)


def _seen(ledger: Ledger, record: Record) -> Tool:
    """The tool as the readings of a calibration alone show it."""
    own = tool_of(dict(record.body["tool_json"]), f"calibration {record.id}")
    evidence = record.body.get("settings", {}).get("evidence")
    return own if evidence is None else _from_evidence(ledger, evidence, own.name)


def _from_evidence(ledger: Ledger, said: Mapping[str, Any], name: str | None = None) -> Tool:
    """The tool that is stated relative to a recorded calibration, by its name unless another is given."""
    reference = ledger.get("calibration", said["reference"])
    tool = tool_of(dict(reference.body["tool_json"]), f"calibration {reference.id}")
    values, covariance = np.array(said["values"]), np.array(said["covariance"])
    return tool_from_relative(tool, values, covariance, tool.name if name is None else name)


def ledger_histories(ledger: Ledger, type: str | None = None) -> tuple[dict[str, list[ToolHistory]], list[Finding]]:
    """Histories of the tools in service by type, of one type where it is given, and what was passed over and why.

    Tools of one type are registered under one name.
    """
    certificates = Certificates(ledger)
    found: dict[str, list[ToolHistory]] = {}
    passed_over: list[Finding] = []
    for serial in certificates.serials:
        tool = find_tool(ledger, serial)
        if tool is None or tool.retired or (type is not None and tool.name != type):
            continue
        try:
            history, _, lost = ledger_history(ledger, certificates, serial)
        except InclinometryError as error:
            passed_over.append(unfitted(error)._replace(severity="warning"))
            continue
        found.setdefault(tool.name, []).append(history)
        passed_over += lost
    return found, passed_over


@dataclass(frozen=True, eq=False)
class StoredFit:
    """What was fitted to a type and kept in the ledger.

    model, past : of the type, and the largest statistics of its past calibrations.
    day : for which the fleet was looked at. record : the ledger's.
    tools : serial number -> "due" (ISO date), "last" (day of the last calibration), "alarm" (finding, or None),
        "now_deg", "six_deg" (u(azimuth) at inclination 60 on that day, and after a check of six positions).
    """

    model: DriftModel
    past: Array
    day: date
    record: Record
    tools: Mapping[str, Mapping[str, Any]]


def put_fit(ledger: Ledger, status: FleetStatus, *, author: str) -> Record:
    """Keep what was fitted to a type, for checks of its tools and the pages of the bench."""
    model = {name: external_value("", value) for name, value in asdict(status.model).items()}
    tools = {
        tool.history.serial: {
            "due": tool.due.date.isoformat(),
            "last": tool.last.isoformat(),
            "alarm": tool.alarm.finding.stored() if tool.alarm is not None and tool.alarm.raised else None,
            "now_deg": float(np.degrees(tool.now[SIXTY])),
            "six_deg": float(np.degrees(tool.checked[SIXTY])),
        }
        for tool in status.tools
    }
    details = {"model": model, "past": status.past.tolist(), "day": status.day.isoformat(), "tools": tools}
    keys = {"subject_kind": "drift", "subject": status.model.type, "action": "fitted"}
    return ledger.append("event", keys, {"details": details}, author=author)


def find_fit(ledger: Ledger, type: str) -> StoredFit | None:
    """What was last fitted to a type and kept; None where nothing was."""
    record = ledger.latest("event", subject_kind="drift", subject=type, action="fitted")
    if record is None:
        return None
    said = record.body["details"]
    arrays = {name: np.array(said["model"][name]) for name in ("drift", "reproducibility", "effects")}
    model = DriftModel(**{**said["model"], **arrays, "left_out": tuple(said["model"]["left_out"])})
    tools = {
        serial: {**about, "alarm": restored(about["alarm"]) if about["alarm"] else None}
        for serial, about in said["tools"].items()
    }
    return StoredFit(model, np.array(said["past"]), date.fromisoformat(said["day"]), record, tools)


def kept_drift(ledger: Ledger, tools: Sequence[RegisteredTool]) -> dict[str, Mapping[str, Any]]:
    """Serial number -> what the fit of its type that was kept says of a tool in service, and "day" of the fit.

    A tool that is overdue or has an alarm by it, and was certified since, is left out.
    """
    fits = {kind: find_fit(ledger, kind) for kind in {tool.name for tool in tools if not tool.retired}}
    today = datetime.now(UTC).date().isoformat()
    found: dict[str, Mapping[str, Any]] = {}
    for tool in tools:
        fit = fits.get(tool.name)
        if tool.retired or fit is None or tool.serial not in fit.tools:
            continue
        about = fit.tools[tool.serial]
        if about["due"] <= today or about["alarm"]:
            newest = listed(ledger, "certificate", limit=1, serial=tool.serial)
            if newest and newest[0].seq > fit.record.seq:
                continue
        found[tool.serial] = {**about, "day": fit.day.isoformat()}
    return found


def check_tool(
    known: LedgerHistory,
    readings: BenchReadings,
    model: DriftModel,
    past: Array,
    rig: RegisteredRig,
    day: date,
    doses: Sequence[float] = (0.0, 0.0, 0.0),
) -> DriftCheck:
    """Readings at few positions, compared with a tool's history and completed by it.

    `model` and `past` are those of the tool's type; the rig's standard deviations are taken as known. `doses` (hours,
    shock, heat) since the last calibration or run.
    """
    history = known.history
    last = history.date[-1]
    if day < last:
        raise out_of_range("date", str(day), f">= {last}")
    if history.reference is None:
        raise refused("session-no-history", {"name": history.serial})
    state = _predicted(history, model, day, doses)
    return check_with_prior(
        readings, history.reference, state, model, rig_sd=np.array(rig.sd), past=past, name=history.serial
    )


def record_check(ledger: Ledger, seen: Session, known: LedgerHistory, found: DriftCheck, *, author: str) -> Record:
    """Record a check that was not refused as the calibration of its session, with what its readings alone say.

    Raises LedgerError: it was refused.
    """
    if found.calibration is None:
        raise LedgerError(found.refusal)
    evidence = {"reference": known.reference, "values": found.values.tolist(), "covariance": found.covariance.tolist()}
    return record_fit(ledger, seen, found.calibration, author=author, settings={"evidence": evidence})


# A check at the bench: a session of the plan `six`.


def refuse_check(ledger: Ledger, serial: str) -> StoredFit:
    """The fit that a check of a tool rests on, where its history allows one.

    Raises InputError: no fit of its type was kept, or the tool is not in it; its last calibration raised an alarm.
    """
    tool = find_tool(ledger, serial)
    fit = None if tool is None else find_fit(ledger, tool.name)
    about = None if fit is None else fit.tools.get(serial)
    if tool is None or fit is None or about is None:
        raise refused("session-no-fit", {"serial": serial})
    if about["alarm"]:
        raise refused("session-off-history", {"serial": serial, "alarm": about["alarm"]})
    return fit


def _session_check(ledger: Ledger, seen: Session) -> tuple[LedgerHistory, DriftCheck]:
    fit, rig = refuse_check(ledger, seen.serial), rig_of(ledger, seen.id)
    if rig is None:
        raise not_registered("rig", seen.rig)
    known = ledger_history(ledger, Certificates(ledger), seen.serial)
    day = date.fromisoformat(seen.settings.get("settings", {}).get("performed", seen.created[:10]))
    return known, check_tool(known, bench_readings(seen), fit.model, fit.past, rig, day)


def check_progress(ledger: Ledger, seen: Session, goal: Goal) -> Progress:
    """How a session of the plan `six` stands: judged when all its positions are taken."""
    captured = len(seen.valid)
    if seen.next is not None:
        return waiting_for(captured, positions_open(seen))
    try:
        found = _session_check(ledger, seen)[1]
    except InclinometryError as error:
        return waiting_for(captured, unfitted(error))
    if found.calibration is None:
        return waiting_for(captured, found.refusal)
    return progress_of(seen, found.calibration, goal)


def finish(ledger: Ledger, session: str, *, author: str, goal: Goal | None = None) -> Record:
    """Record the calibration of a session and close it: a check by its history, any other by its readings.

    Raises LedgerError: as `results.finish_calibration`; a check that is not complete or was refused.
    """
    seen = load_session(ledger, session)
    if seen.plan != CHECK or seen.closed:
        return finish_calibration(ledger, session, author=author, goal=goal)
    if seen.next is not None:
        raise LedgerError(positions_open(seen))
    known, found = _session_check(ledger, seen)
    if found.calibration is None:
        raise LedgerError(found.refusal)
    return record_check(ledger, seen, known, found, author=author)
