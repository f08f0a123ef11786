"""Command that reduces raw channels to survey stations."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from inclinometry.cli import options, output
from inclinometry.constants import ANGLES
from inclinometry.errors import refused
from inclinometry.orientation import SWITCH
from inclinometry.survey.reduce import Survey
from inclinometry.workflow.calibration_age import Age
from inclinometry.workflow.corrections import CORRECTIONS, correction_steps
from inclinometry.workflow.six_axis import SixAxisSurvey
from inclinometry.workflow.survey import survey_file, write_survey


def survey(
    raw: Path,
    /,
    *,
    output_: options.OutputOrNone = None,
    calibration: options.InputOrNone = None,
    site: options.InputOrNone = None,
    correct: Annotated[
        str | None,
        Parameter(
            help=f"Corrections in order, with commas: {', '.join(CORRECTIONS)}. A corrections.json replaces msa. "
            "Default: "
            "none.",
        ),
    ] = None,
    bha: options.InputOrNone = None,
    azimuth_from: options.AzimuthFrom = None,
    hole: Literal["down", "up"] = "down",
    gravity_sd: options.GravitySd = None,
    age_days: options.AgeDays = None,
    stability: options.StabilityFile = None,
    from_: options.SixAxisForm = None,
    convention: options.Convention = None,
    switch: options.SwitchAngle = SWITCH,
    ignore: options.Ignore = (),
    report: options.Report = None,
    json: options.Json = False,
) -> int:
    """Reduce raw channels to survey stations with uncertainty; exit status 1 if most stations are out of tolerance.

    Parameters
    ----------
    raw
        With --calibration: table with md_m and the raw channels. Without: gravity and field with units in the names
        (md_m, gx_m_s2 .. gz_m_s2, bx_nT .. bz_nT), any format of convert.
    output_
        Write the survey. Without -o nothing is written.
    calibration
        tool.json. Without it the readings are fields, and --site is required.
    site
        site.toml: north_reference, declination_deg, convergence_deg, g, b_nT, dip_deg, their sigmas, latitude_deg.
    bha
        bha.toml: the assembly, for the sag correction.
    hole
        Two accelerometers: down (0 to 90 deg) or up (90 to 180 deg).
    """
    inputs = {**_inputs(raw, calibration, site, bha, correct), "--stability": stability}
    output.check_outputs({"--output": output_, "--report": report}, inputs)
    if calibration is None and (age_days is not None or stability is not None):
        raise refused("input-needs", {"name": "--age-days, --stability", "needed": ("--calibration",)})
    with output.reading(raw) as progress:
        done = survey_file(
            raw,
            site,
            calibration,
            correct=correct,
            bha=bha,
            second=azimuth_from,
            hole=hole,
            gravity_sd=gravity_sd,
            age=Age(age_days, stability),
            form=from_,
            convention=convention,
            charts=report is not None,
            ignored=ignore,
            progress=progress,
        )
    found, place = done.survey, None if site is None else done.site
    quality, before = (None if judged is None else judged.quality for judged in (done.judged, done.before))
    beside = {"site": place, "quality": quality, "before": before}
    with output.reported(report, "survey:survey_report", found, **beside):
        if output_ is not None:
            with output.busy(f"writing {output.counted(len(found), 'station')}"):
                write_survey(found, output_, switch=switch)
    output.findings(found.findings)
    if json:
        output.print_json(_summary(done, output_))
    else:
        for step in found.history:
            output.print_line(str(step))
        show_survey(found)
        output.print_outputs(output_, report, what=output.counted(len(found), "station"))
        output.print_line(_in_a_line(found))
    return int(any(one.code == "survey-most-off" for one in found.findings))


def _in_a_line(found: Survey) -> str:
    degrees, flagged = np.degrees(found.inclination), sum(bool(row) for row in found.flags)
    return (
        f"{output.counted(len(found), 'station')}, {found.md[0]:.1f} to {found.md[-1]:.1f} m, inclination "
        f"{np.nanmin(degrees):.2f} to {np.nanmax(degrees):.2f} deg, azimuths from {found.azimuth_reference} north, "
        f"{flagged} flagged"
    )


def _inputs(
    raw: Path, calibration: Path | None, site: Path | None, bha: Path | None, correct: str | None
) -> dict[str, Path | None]:
    named = {f"--correct {file}": Path(file) for _, file in correction_steps(correct) if file is not None}
    return {"the raw channels": raw, "--calibration": calibration, "--site": site, "--bha": bha, **named}


def _summary(done: SixAxisSurvey, path: Path | None) -> dict[str, object]:
    found = done.survey
    known = {name: u[np.isfinite(u)] for name in ANGLES for u in [np.asarray(found.u(name))]}
    return {
        "stations": len(found),
        "azimuth_reference": found.azimuth_reference,
        "md_m": [found.md[0], found.md[-1]],
        "worst_u_deg": {name: np.degrees(u.max()) if u.size else None for name, u in known.items()},
        "median_u_deg": {name: np.degrees(np.median(u)) if u.size else None for name, u in known.items()},
        "coverage_factor": found.coverage_factor,
        "flagged": sum(bool(row) for row in found.flags),
        "quality": None if done.judged is None else done.judged.verdict,
        "history": [one.plain() for one in found.history],
        "findings": found.findings,
        "output": path,
    }


def show_survey(found: Survey, most: int = 12) -> None:
    """A few stations spread over the survey, on the terminal."""
    rows = []
    for row in output.spread(len(found), most):
        cells = [output.degrees(getattr(found, name)[row], found.u(name)[row]) for name in ANGLES]
        rows.append([f"{found.md[row]:.1f}", *cells, f"{np.degrees(found.dip[row]):.2f}", ", ".join(found.flags[row])])
    header = ["md m", "inclination", f"azimuth ({found.azimuth_reference})", "toolface", "dip", "flags"]
    output.table(f"stations{output.excerpt(len(rows), len(found))}, deg with standard uncertainty", header, rows)
