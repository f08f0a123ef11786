"""Command: fleet evidence, what a run in the hole says of a tool taken into its history."""

from __future__ import annotations

from datetime import date
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import numpy as np
from cyclopts import Parameter

from inclinometry.cli import options, output
from inclinometry.cli.options import FieldSite, Flag, Json
from inclinometry.errors import FileError, refused
from inclinometry.findings import Finding
from inclinometry.laboratory.commands import LedgerAddress
from inclinometry.laboratory.ledger.ledger import Ledger

if TYPE_CHECKING:
    from inclinometry.laboratory.valid_certificates import Certificates
    from inclinometry.survey.reduce import SensorCorrection


def evidence(
    raw: Path | None = None,
    /,
    *,
    tool: str,
    run: str,
    date_: Annotated[str | None, Parameter(name="--date")] = None,
    site: FieldSite | None = None,
    axial_sigma_nt: float | None = None,
    ledger: LedgerAddress = None,
    hours: float = 0.0,
    shock: float = 0.0,
    heat: float = 0.0,
    record: Flag = False,
    withdraw: str | None = None,
    json: Json = False,
) -> int:
    """Multi-station analysis of a run as evidence for its tool's history; axial terms and turns stay unseen.

    The stations are reduced with the certificate that holds on the day. Exit status 1: the run contradicts the history;
    nothing is recorded then, and a full calibration is due.

    Parameters
    ----------
    raw
        Raw channels of one run, 4 stations or more, or its corrections.json (`msa --calibration`, certified
        calibration).
    tool
        Serial number.
    run
        Name of the run; entered again, it replaces the earlier one.
    date_
        Day of the run, YYYY-MM-DD.
    axial_sigma_nt
        Standard deviation of the axial magnetic interference, nT. Default: 2000.
    hours
        Operating hours since the calibration or run before.
    shock
        Shock since then.
    heat
        Heat since then.
    record
        Record the run in the ledger; due dates, checks and reports then use it.
    withdraw
        Withdraw a run from the history, with the reason; its record stays.
    """
    from inclinometry.laboratory import drift
    from inclinometry.laboratory.commands.enter import doses_of
    from inclinometry.laboratory.commands.ledger import _where, _who
    from inclinometry.laboratory.valid_certificates import Certificates

    doses_of(hours, shock, heat)
    if withdraw is not None:
        if raw is not None:
            raise refused("input-not-with", {"name": str(raw), "other": "--withdraw"})
        with Ledger(_where(ledger)) as opened:
            drift.withdraw_run(opened, tool, run, withdraw, author=_who())
        output.print_line(f"{tool}: run {run} is no evidence any more")
        return 0
    if raw is None or date_ is None:
        raise refused("input-missing", {"names": ("RAW", "--date")})
    day = options.day(date_, "--date")
    from inclinometry.files.tool_json import tool_of
    from inclinometry.fleet.statistics import known_drift
    from inclinometry.history import UNSEEN
    from inclinometry.survey.history_from_run import run_evidence

    with Ledger(_where(ledger), read_only=not record) as opened:
        certificates = Certificates(opened)
        known = drift.ledger_history(opened, certificates, tool)
        if raw.suffix.lower() == ".json":
            calibration, correction = _kept(certificates, tool, raw)
        else:
            calibration, correction = _analysed(certificates, tool, day, raw, site, axial_sigma_nt)
        reduced = tool_of(certificates.content(calibration)[1], f"calibration {calibration}")
        values, covariance = run_evidence(correction, reduced)
        found = drift.RunEvidence(
            run, day, hours, shock, heat, calibration, values, covariance, correction.stations, correction.chi_square,
            correction.freedom, correction.priors, correction.inputs,
        )  # fmt: skip
        model, past = known_drift(opened, known.history.type)
        alarm = drift.judge_run(known.history, reduced, found, model, past)
        if record and not alarm.raised:
            drift.record_run(opened, tool, found, author=_who())
    # directions of the parameters that the run shows at all: ten times better than nothing
    seen = int(np.sum(np.linalg.eigvalsh(covariance) < (0.1 * UNSEEN) ** 2))
    if json:
        content = {"tool": tool, "run": run, "date": day.isoformat(), "stations": found.stations}
        content |= {"verdict": alarm.finding.plain(), "cause": alarm.cause if alarm.raised else None}
        output.print_json(content | {"parameters_seen": seen, "recorded": record and not alarm.raised})
        return 1 if alarm.raised else 0
    shown = f"{found.stations} stations show {seen} of {len(values)} directions"
    output.print_line(f"{tool}, run {run} of {day}: {alarm.finding}; {shown}")
    if alarm.raised:
        output.print_line("it contradicts the history and is not taken in: make a full calibration")
    elif record:
        output.print_line("recorded as evidence")
    return 1 if alarm.raised else 0


def _analysed(
    certificates: Certificates, serial: str, day: date, raw: Path, site: Path | None, axial_sigma: float | None
) -> tuple[str, SensorCorrection]:
    """The record of the calibration that holds on the day, and the analysis of the stations reduced with it."""
    from inclinometry.files.json_codec import canonical
    from inclinometry.survey.multistation import multistation
    from inclinometry.survey.multistation_priors import priors_from_tool, reference_of_site
    from inclinometry.survey.reduce import correction_of
    from inclinometry.workflow.corrections import refuse_uncorrectable
    from inclinometry.workflow.six_axis import REBUILT, read_six_axis

    if site is None:
        raise refused("input-missing", {"names": ("--site",)})
    calibration = certificates.at(serial, day).calibration
    with TemporaryDirectory() as folder:
        held = Path(folder, "tool.json")
        held.write_bytes(canonical(certificates.content(calibration)[1]))
        with output.reading(raw) as progress:
            run = read_six_axis(raw, site, held, progress=progress)
    if run.tool is None or REBUILT in run.stations.history:
        raise FileError(Finding("fleet-evidence-raw", {"tool": serial}), path=raw)
    reference = reference_of_site(run.site)
    refuse_uncorrectable(run.stations, reference)
    # however far the tool has gone from its certificate: its history judges that
    priors = priors_from_tool(run.tool, axial_sigma=axial_sigma)
    with output.busy(f"analysing {output.counted(len(run.stations), 'station')}"):
        done = multistation(run.stations, reference, priors)
    output.findings((*run.findings, *done.findings))
    return calibration, correction_of(done, reference, priors, run.tool.name, run.inputs)


def _kept(certificates: Certificates, serial: str, path: Path) -> tuple[str, SensorCorrection]:
    """The record of the certified calibration that an analysis was made with, and the analysis."""
    from inclinometry.files.corrections_json import read_corrections

    correction = read_corrections(path)
    for one in certificates.of(serial):
        if certificates.content(one.calibration)[0] == correction.inputs.get("tool"):
            output.findings(correction.findings)
            return one.calibration, correction
    raise FileError(Finding("fleet-evidence-raw", {"tool": serial}), path=path)
