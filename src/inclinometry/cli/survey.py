"""Command that reduces raw channels to survey stations."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from cyclopts import Parameter

from inclinometry.calibration.result import rounded
from inclinometry.cli import options, output
from inclinometry.cli.options import (
    AgeDays,
    AzimuthFrom,
    Convention,
    GravitySd,
    InputOrNone,
    Json,
    OutputOrNone,
    Report,
    SixAxisForm,
    StabilityFile,
    SwitchAngle,
    TrustFile,
    angle,
)
from inclinometry.constants import ANGLES
from inclinometry.errors import InputError
from inclinometry.files.writing import write_text
from inclinometry.orientation import SWITCH
from inclinometry.survey.reduce import Survey
from inclinometry.workflow.age import Age
from inclinometry.workflow.corrections import CORRECTIONS
from inclinometry.workflow.six_axis import SixAxisSurvey
from inclinometry.workflow.survey import survey_file, write_survey

SWITCH_DEG: Final = float(np.degrees(SWITCH))


def survey(
    raw: Path,
    /,
    *,
    output_: OutputOrNone = None,
    calibration: InputOrNone = None,
    site: InputOrNone = None,
    correct: Annotated[
        str | None,
        Parameter(
            help=f"Corrections in their order, with commas: {', '.join(CORRECTIONS)}; a corrections.json may stand for "
            "msa. None when not given."
        ),
    ] = None,
    bha: InputOrNone = None,
    azimuth_from: AzimuthFrom = None,
    hole: Literal["down", "up"] = "down",
    gravity_sd_percent: GravitySd = None,
    age_days: AgeDays = None,
    stability: StabilityFile = None,
    from_: SixAxisForm = None,
    convention: Convention = None,
    switch_deg: SwitchAngle = SWITCH_DEG,
    trust_file: TrustFile = (),
    report: Report = None,
    json: Json = False,
) -> None:
    """Reduce raw channels to survey stations with uncertainty.

    Parameters
    ----------
    raw
        With a calibration: CSV with md_m and the raw channels. Without: gravity and magnetic field in any format of
        convert, units in the column names (md_m, gx_m_s2 .. gz_m_s2, bx_nT .. bz_nT).
    output_
        Survey CSV; only looked at when not given.
    calibration
        tool.json; without it the readings are fields already and --site is needed.
    site
        site.toml: north_reference, declination_deg, convergence_deg, g, b_nT, dip_deg and their sigmas; latitude_deg.
    bha
        bha.toml: the assembly, for sag.
    hole
        Of a tool with two accelerometers: down takes inclinations of 0 to 90 deg, up those of 90 to 180.
    """
    switch = angle(switch_deg, "--switch-deg", 0.0, 90.0)
    inputs = {**_inputs(raw, calibration, site, bha, correct), "--stability": stability}
    output.claim({"--output": output_, "--report": report}, inputs)
    if calibration is None and (age_days is not None or stability is not None):
        raise InputError("--age-days and --stability are of a calibration; give --calibration, or leave them out")
    with output.reading(raw) as progress:
        done = survey_file(
            raw,
            site,
            calibration,
            correct=correct,
            bha=bha,
            second=azimuth_from,
            hole=hole,
            gravity_sd=options.gravity_sd(gravity_sd_percent),
            age=Age(age_days, stability),
            form=from_,
            convention=convention,
            charts=report is not None,
            trusted=trust_file,
            progress=progress,
        )
    found, page = done.survey, None
    with output.busy(f"writing {output.counted(len(found), 'station')}"):
        if report is not None:
            from inclinometry.report.survey import survey_report

            place = None if site is None else done.site
            quality = [None if judged is None else judged.quality for judged in (done.judged, done.before)]
            page = survey_report(found, site=place, quality=quality[0], before=quality[1], notes=done.notes)
        if output_ is not None:
            write_survey(found, output_, switch=switch)
    if page is not None:
        write_text(page, report or "")
    output.warnings(found.warnings)
    if json:
        output.print_json(_summary(done, output_))
    else:
        for sentence in (*done.notes, *found.history):
            output.say(sentence)
        show_survey(found)
        output.written(output_, report, what=output.counted(len(found), "station"))
        output.headline(_in_a_line(found))


def _in_a_line(found: Survey) -> str:
    degrees, flagged = np.degrees(found.inclination), sum(bool(row) for row in found.flags)
    return (
        f"{output.counted(len(found), 'station')}, {found.md[0]:.1f} to {found.md[-1]:.1f} m, inclination "
        f"{degrees.min():.2f} to {degrees.max():.2f} deg, azimuths from {found.azimuth_reference} north, "
        f"{flagged} flagged"
    )


def _inputs(
    raw: Path, calibration: Path | None, site: Path | None, bha: Path | None, correct: str | None
) -> dict[str, Path | None]:
    stored = {name.strip() for name in (correct or "").split(",") if name.strip().lower().endswith(".json")}
    named = {f"--correct {name}": Path(name) for name in sorted(stored)}
    return {"the raw channels": raw, "--calibration": calibration, "--site": site, "--bha": bha, **named}


def _summary(done: SixAxisSurvey, path: Path | None) -> dict[str, object]:
    found = done.survey
    return {
        "stations": len(found),
        "azimuth_reference": found.azimuth_reference,
        "md_m": [found.md[0], found.md[-1]],
        "worst_u_deg": {
            name: np.degrees(np.nanmax(u)) if np.isfinite(u).any() else None
            for name, u in zip(ANGLES, (found.u_inclination, found.u_azimuth, found.u_toolface), strict=True)
        },
        "median_u_deg": {
            name: np.degrees(np.nanmedian(u)) if np.isfinite(u).any() else None
            for name, u in zip(ANGLES, (found.u_inclination, found.u_azimuth, found.u_toolface), strict=True)
        },
        "coverage_factor": found.coverage_factor,
        "flagged": sum(bool(row) for row in found.flags),
        "quality": None if done.judged is None else done.judged.verdict,
        "history": found.history,
        "notes": done.notes,
        "warnings": found.warnings,
        "output": path,
    }


def show_survey(found: Survey, most: int = 12) -> None:
    """A few stations spread over the survey, on the terminal."""
    rows = []
    for row in np.unique(np.linspace(0, len(found) - 1, min(most, len(found))).astype(int)):
        angles = (found.inclination, found.azimuth, found.toolface)
        u = (found.u_inclination, found.u_azimuth, found.u_toolface)
        cells = [rounded(np.degrees(a[row]), np.degrees(w[row])) for a, w in zip(angles, u, strict=True)]
        rows.append([f"{found.md[row]:.1f}", *cells, f"{np.degrees(found.dip[row]):.2f}", ", ".join(found.flags[row])])
    header = ["md m", "inclination", f"azimuth ({found.azimuth_reference})", "toolface", "dip", "flags"]
    output.table(f"stations{output.excerpt(len(rows), len(found))}, deg with standard uncertainty", header, rows)
