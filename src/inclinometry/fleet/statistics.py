"""Commands: fleet fit, report and check: what the ledger's calibrations say of the drift of a type and of its tools."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, TypeAlias

import numpy as np
from cyclopts import Parameter

from inclinometry.cli import options, output
from inclinometry.cli.options import AlsoWritten, Flag, Input, InputOrNone, Json, OutputOrNone
from inclinometry.errors import FileError, InputError, in_file, not_among, refused
from inclinometry.findings import Finding
from inclinometry.laboratory.commands import LedgerAddress
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.opening import whole

if TYPE_CHECKING:
    from inclinometry.arrays import Array
    from inclinometry.calibration.drift import DriftModel
    from inclinometry.calibration.drift_status import FleetStatus
    from inclinometry.history import ToolHistory

Type: TypeAlias = Annotated[
    str | None,
    Parameter(name="--type", help="Registered type of the tools. Default: the only one."),
]
Share: TypeAlias = Annotated[
    float, Parameter(help="Share of the drift that follows the calendar; the rest follows operating hours.")
]
_FIELD: Final = 50000.0  # nT, for which offsets of magnetometers are stated


def fit(
    *,
    ledger: LedgerAddress = None,
    type_: Type = None,
    calendar_share: Share = 1.0,
    record: Flag = False,
    tool_code: AlsoWritten = None,
    interval_years: float = 1.0,
    beside: str | None = None,
    stability: AlsoWritten = None,
    tool: str | None = None,
    json: Json = False,
) -> None:
    """How the tools of a type drift, by their certified calibrations; a few minutes for hundreds of tools.

    Parameters
    ----------
    record
        Record the fit in the ledger, for `fleet check` and for due dates and alarms in the bench.
    tool_code
        Write the tool code of this type (JSON), for `position --tool-code`.
    interval_years
        Years between calibrations; the tool code is that of the middle of the interval.
    beside
        Tool code whose terms of depth, declination and sag are included: a name, or a JSON file.
    stability
        Write stability.toml, sensor drift per year, for `survey --stability` and `position --stability`.
    tool
        Serial number: write the drift of this tool.
    """
    from inclinometry.calibration.drift import azimuth_sd
    from inclinometry.files.stability_toml import write_stability
    from inclinometry.files.tool_code_json import load_tool_code, write_tool_code
    from inclinometry.laboratory import drift
    from inclinometry.laboratory.commands.ledger import _where, _who
    from inclinometry.position.fleet_code import fleet_tool_code
    from inclinometry.stability import from_drift

    output.check_outputs({"--tool-code": tool_code, "--stability": stability}, {})
    if tool is not None and stability is None:
        raise refused("input-needs", {"name": "--tool", "needed": ("--stability",)})
    known = None if beside is None else load_tool_code(beside)
    with Ledger(_where(ledger), read_only=not record) as opened:
        histories = _histories(opened, type_)
        status = _status(histories, calendar_share=calendar_share)
        if record:
            drift.put_fit(opened, status, author=_who())
    model = status.model
    if tool_code is not None:
        typical = np.mean([h.covariance[-1] for h in histories], axis=0)
        made = fleet_tool_code(model, typical, interval_years, name=model.type, beside=known)
        write_tool_code(made.code, tool_code, made.evidence)
    if stability is not None:
        own = {one.history.serial: one.states[-1].multiplier for one in status.tools}
        if tool is not None and tool not in own:
            raise not_among("--tool", tool, own)
        of = f"fleet of type {model.type}" if tool is None else f"tool {tool} in its fleet of type {model.type}"
        source = f"{of}, {model.tools} tools with {model.calibrations} calibrations to {model.last}"
        write_stability(from_drift(model.drift * own.get(tool or "", 1.0), source), stability)
    rows = {
        "drift of a year": azimuth_sd(model.drift, dip=model.dip),
        "between mountings": azimuth_sd(model.reproducibility, dip=model.dip),
        "a certificate, median": np.median([azimuth_sd(h.covariance[-1], dip=model.dip) for h in histories], axis=0),
    }
    _say_fit(status, rows, tool_code, record, json)
    if stability is not None and not json:
        output.print_line(f"stability written to {stability}")


def _say_fit(status: FleetStatus, rows: dict[str, Any], tool_code: Path | None, record: bool, json: bool) -> None:
    from inclinometry.calibration.drift import SHOWN
    from inclinometry.report.fleet import PANELS

    model = status.model
    panels = []
    for title, unit, factor, places in PANELS:
        nanotesla = unit.endswith("of the field")
        scale = 1e-3 * _FIELD * factor if nanotesla else factor
        spread = [scale * np.sqrt(np.mean(np.diagonal(c)[list(places)])) for c in (model.drift, model.reproducibility)]
        panels.append((title, "nT" if nanotesla else unit, *spread))
    factor_of_tools = float(np.exp(model.multiplier_sd))
    if json:
        content = {
            **model.basis,
            "digest": model.digest,
            "inclination_deg": np.degrees(SHOWN),
            "azimuth_deg": {name: np.degrees(u) for name, u in rows.items()},
            "parameters": [
                {"what": what, "unit": unit, "drift_root_year": drift, "between_mountings": mounting}
                for what, unit, drift, mounting in panels
            ],
            "own_drift_factor": factor_of_tools,
            "recorded": record,
            "tool_code": tool_code,
        }
        output.print_json(content)
        return
    output.print_line(
        f"type {model.type}: {output.counted(model.tools, 'tool')} with "
        f"{output.counted(model.calibrations, 'calibration')}, "
        f"{model.first} to {model.last}"
    )
    if model.left_out:
        output.print_line(f"left out, because they jumped: {', '.join(model.left_out)}")
    output.table(
        "azimuth, degrees (k = 1), rms over azimuth and toolface",
        ["inclination", *(f"{np.degrees(i):.0f}" for i in SHOWN)],
        [[name, *(f"{np.degrees(x):.3f}" for x in u)] for name, u in rows.items()],
    )
    output.table(
        "a sensor, rms over the three: drift in a root year, and between mountings",
        ["parameter", "unit", "drift", "mountings"],
        [[title, unit, f"{drift:.3g}", f"{mounting:.3g}"] for title, unit, drift, mounting in panels],
        f"nT in a field of {_FIELD:.0f} nT",
    )
    output.print_line(
        f"own drift variance of a tool: a factor of {factor_of_tools:.2g} about the type's (one standard deviation)"
    )
    if record:
        output.print_line("kept in the ledger")
    if tool_code is not None:
        output.print_line(f"tool code written to {tool_code}")


def report(
    *,
    ledger: LedgerAddress = None,
    type_: Type = None,
    output_: OutputOrNone = None,
    day: str | None = None,
    limit: Annotated[float, options.quantity("deg", 1e-3, 90.0)] = 0.5 * options.SI["deg"],
    inclination: Annotated[float, options.quantity("deg", 0.1, 179.9)] = 60.0 * options.SI["deg"],
    reliability: float = 0.95,
    calendar_share: Share = 1.0,
    json: Json = False,
) -> int:
    """Due dates, alarms and drift of a type. Exit status 1: a tool is overdue or has an alarm, or a rig is off.

    Parameters
    ----------
    output_
        Write the page, HTML.
    day
        Day of the page, YYYY-MM-DD. Default: day of the last calibration.
    limit
        Largest azimuth error allowed, rms over azimuth and toolface.
    inclination
        Inclination at which that limit applies.
    reliability
        Share of the tools within the limit on their due date.
    """
    from inclinometry.calibration.drift import SIXTY
    from inclinometry.calibration.drift_status import RIG_LEVEL
    from inclinometry.calibration.interval import Requirement
    from inclinometry.files.writing import write_text
    from inclinometry.laboratory.commands.ledger import _where
    from inclinometry.report.fleet import fleet_report

    output.check_outputs({"--output": output_}, {})
    asked = Requirement(limit, reliability, (inclination,))
    with Ledger(_where(ledger), read_only=True) as opened:
        histories = _histories(opened, type_)
    status = _status(
        histories,
        requirement=asked,
        day=None if day is None else options.day(day, "--day"),
        calendar_share=calendar_share,
    )
    if output_ is not None:
        with output.busy("drawing"):
            write_text(fleet_report(status), output_)
    overdue = [tool for tool in status.tools if tool.due.date <= status.day]
    alarmed = [tool for tool in status.tools if tool.alarm is not None and tool.alarm.raised]
    off = [rig for rig in status.rigs if rig.p_value < RIG_LEVEL]
    if json:
        table = {name: output.plain(column) for name, column in status.to_dict().items()}
        rows = [dict(zip(table, row, strict=True)) for row in zip(*table.values(), strict=True)]
        content = {"type": status.model.type, "day": status.day.isoformat(), "tools": rows}
        output.print_json(content | {"rigs_off": [rig.rig for rig in off], "output": output_})
        return 1 if overdue or alarmed or off else 0
    lines, count = [], len(status.tools)
    for tool in status.tools[:20]:
        now, six = (f"{np.degrees(u[SIXTY]):.3f}" for u in (tool.now, tool.checked))
        days = [tool.due.date.isoformat(), tool.last.isoformat()]
        lines.append([tool.history.serial, *days, now, "refused" if tool in alarmed else six])
    output.table(
        f"type {status.model.type} on {status.day}{output.excerpt(len(lines), count)}",
        ["tool", "due", "last", "u now", "u after six"],
        lines,
        "u: standard uncertainty of azimuth, deg, at inclination 60, now and after a check of six positions",
    )
    output.print_line(f"{len(overdue)} overdue, {len(alarmed)} with an alarm")
    for tool in alarmed:
        output.print_line(
            f"  {tool.history.serial}: {tool.alarm.finding if tool.alarm else ''}; make a full calibration"
        )
    for rig in off:
        output.print_line(f"  {rig.rig} is off: {rig.cause}, p {rig.p_value:.1g}")
    if output_ is not None:
        output.print_outputs(None, output_)
    return 1 if overdue or alarmed or off else 0


def check(
    readings: Input,
    /,
    *,
    tool: str,
    performed: str,
    rig: str,
    ledger: LedgerAddress = None,
    hours: float = 0.0,
    shock: float = 0.0,
    heat: float = 0.0,
    record: Flag = False,
    certify: Flag = False,
    laboratory: InputOrNone = None,
    accept_warnings: str = "",
    json: Json = False,
) -> int:
    """Calibrate a tool at few positions, for example of the plan six, completed by its history.

    The drift of its type is the one kept by `fleet fit --record`, else it is fitted now. Exit status 1: the readings
    contradict the history; nothing is recorded then, and a full calibration is due.

    Parameters
    ----------
    readings
        Bench readings as `calibrate` takes them.
    tool
        Serial number.
    performed
        Day of the readings, YYYY-MM-DD.
    rig
        Stand, as registered.
    hours
        Operating hours since the last calibration or recorded run.
    shock
        Shock since then.
    heat
        Heat since then.
    record
        Record readings and calibration in the ledger.
    certify
        Also issue a certificate; only certified calibrations are used for runs and history.
    laboratory
        lab.toml, for the certificate.
    accept_warnings
        Reason to certify with open warnings; recorded and printed on the certificate.
    """
    from inclinometry.calibration.drift import azimuth_sd
    from inclinometry.history import relative_parameters
    from inclinometry.laboratory import drift
    from inclinometry.laboratory.certificate.laboratory_toml import read_laboratory
    from inclinometry.laboratory.commands.enter import certified, doses_of, performed_on
    from inclinometry.laboratory.commands.ledger import _where, _who
    from inclinometry.laboratory.import_file import LARGEST, import_file
    from inclinometry.laboratory.registry import find_rig, not_registered
    from inclinometry.laboratory.session import load_session
    from inclinometry.laboratory.valid_certificates import Certificates
    from inclinometry.workflow.calibrate import readings_at

    day, doses = performed_on(performed), doses_of(hours, shock, heat)
    if certify and laboratory is None:
        raise refused("input-missing", {"names": ("--laboratory",)})
    who = read_laboratory(laboratory)[0] if laboratory is not None else None
    with Ledger(_where(ledger), read_only=not (record or certify)) as opened:
        stand = find_rig(opened, rig)
        if stand is None:
            raise not_registered("rig", rig)
        known = drift.ledger_history(opened, Certificates(opened), tool)
        given = readings_at(readings, dials=stand.dials)
        model, past = known_drift(opened, known.history.type)
        with output.busy("checking"):
            try:
                found = drift.check_tool(known, given, model, past, stand, day, list(doses.values()))
            except FileError:
                raise
            except InputError as error:
                raise in_file(error, readings) from None
        made, number = None, None
        if found.calibration is not None and (record or certify):
            taken = whole(readings, LARGEST)
            session = import_file(opened, taken, tool, rig, author=_who(), performed=day, doses=doses)
            made = drift.record_check(opened, load_session(opened, session.id), known, found, author=_who())
            number = certified(opened, made, who, None, "", accept_warnings) if certify else None
    u = None
    if found.calibration is not None and known.history.reference is not None:
        u = azimuth_sd(relative_parameters(found.calibration.tool, known.history.reference)[1])
    if json:
        refusal = found.refusal.plain() if found.alarm.raised else None
        content: dict[str, Any] = {"tool": tool, "refused": refusal, "verdict": found.alarm.finding.plain()}
        content |= {
            "cause": found.alarm.cause if found.alarm.raised else None,
            "u_azimuth_deg": None if u is None else np.degrees(u),
        }
        output.print_json(content | {"calibration": None if made is None else made.id, "certificate": number})
        return 1 if found.alarm.raised else 0
    if u is None:
        output.print_line(f"{tool}: refused: {found.refusal}")
        return 1
    output.print_line(f"{tool}: {found.alarm.finding}")
    shown = ", ".join(f"{x:.3f}" for x in np.degrees(u))
    output.print_line(f"standard uncertainty of azimuth at inclination 5, 30, 60, 90: {shown} deg")
    if made is not None:
        output.print_line(f"calibration {made.id} of {day} recorded{f', certificate {number}' if number else ''}")
    return 0


def known_drift(ledger: Ledger, kind: str) -> tuple[DriftModel, Array]:
    """Drift of a type and the largest statistics of its past calibrations: as kept, else fitted now."""
    from inclinometry.laboratory.drift import find_fit

    kept = find_fit(ledger, kind)
    if kept is not None:
        output.findings([Finding("fleet-drift-kept", {"type": kind, "day": str(kept.day)}, severity="note")])
        return kept.model, kept.past
    status = _status(_histories(ledger, kind))
    output.findings([Finding("fleet-drift-fitted", {"type": kind}, severity="note")])
    return status.model, status.past


def _histories(ledger: Ledger, type_: str | None) -> list[ToolHistory]:
    """Those of one type."""
    from inclinometry.laboratory.drift import ledger_histories

    with output.busy("reading the ledger"):
        found, passed_over = ledger_histories(ledger, type_)
    output.findings(passed_over)
    if not found:
        raise refused("session-no-history", {"name": ledger.shown})
    if len(found) > 1:
        several = {kind: len(histories) for kind, histories in found.items() if sum(len(h) > 1 for h in histories)}
        if len(several) != 1:
            raise refused("input-one-of", {"names": tuple(f"--type {kind}" for kind in sorted(found)[:10])})
        return found[next(iter(several))]
    return next(iter(found.values()))


def _status(histories: list[ToolHistory], **known: Any) -> FleetStatus:
    from inclinometry.calibration.drift_status import fleet_status

    with output.working(f"drift of {len(histories)} tools") as progress:
        return fleet_status(histories, progress=progress, **known)
