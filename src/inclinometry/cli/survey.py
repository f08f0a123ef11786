"""Commands that use a calibrated tool: verify, survey."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from inclinometry.calibration.acceptance import OtherStand, Verification
from inclinometry.calibration.conventions import Counts, Dials, InclinationFrom
from inclinometry.calibration.result import rounded
from inclinometry.cli import options, output
from inclinometry.cli.options import Convention, Json, Output, angle
from inclinometry.cli.six_axis import SixAxisForm
from inclinometry.constants import ANGLES
from inclinometry.errors import InputError
from inclinometry.files.bench_csv import read_bench
from inclinometry.files.limits import read_limits
from inclinometry.files.tool_json import read_calibration
from inclinometry.files.writing import write_text
from inclinometry.orientation import SWITCH
from inclinometry.survey.reduce import Survey
from inclinometry.workflow.six_axis import SixAxisSurvey
from inclinometry.workflow.survey import survey_file, write_survey


def verify(
    readings: Path,
    /,
    *,
    calibration: Path,
    limits: str | None = None,
    stand: Literal["same", "level", "fit"] = "same",
    north_deg: float | None = None,
    north_sd_deg: float = 0.0,
    level_sd_deg: float = 0.0,
    rig_sd_deg: float | None = None,
    azimuth_from: Literal["magnetometer", "gyro"] | None = None,
    gravity_sd_percent: float | None = None,
    output_: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    report: Path | None = None,
    inclination_from: InclinationFrom = "vertical",
    azimuth_counts: Counts = "clockwise",
    toolface_counts: Counts = "clockwise",
    json: Json = False,
) -> int:
    """Verify a calibrated tool at independent positions; exit status 0 pass, 1 fail, 2 bad input.

    Parameters
    ----------
    readings
        Bench readings CSV of positions that were not used to calibrate.
    calibration
        tool.json
    limits
        Name of a preset or a TOML file; without limits each error is held against its own uncertainty.
    stand
        same: the stand of the calibration, not moved since. level: another one, its azimuth axis vertical. fit: another
        one; its tilt and north are found from these readings, and what they cannot tell from the tool is not judged.
    north_deg
        Of a level stand: azimuth of the rig's zero from magnetic north (from true north for a gyro). Not given, it is
        found from the readings and a constant error of azimuth is not judged.
    north_sd_deg, level_sd_deg
        How well the north and the vertical of a level stand are known.
    rig_sd_deg
        Random error of a setting of another stand; that of the calibration's rig when not given.
    azimuth_from
        Triad that gives the azimuth: the magnetometer where there is one, else the gyro.
    gravity_sd_percent
        Of two accelerometers on another stand: standard uncertainty of |g| there against that at the calibration, 0 at
        the same place. When not given, that of what both state, 0.3 where one states nothing.
    output_
        Write verify.json, for a certificate.
    report
        Write an HTML report.
    inclination_from
        Where the inclination dial counts from: vertical, other-end, horizontal or horizontal-up, as for calibrate.
    azimuth_counts
        Which way the azimuth dial counts, seen from above: clockwise or counterclockwise.
    toolface_counts
        Which way the toolface dial counts, looking down hole: clockwise or counterclockwise.
    json
        Print JSON.
    """
    from inclinometry.calibration.acceptance import verify as verify_readings

    output.claim(
        {"--output": output_, "--report": report},
        {"the readings": readings, "--calibration": calibration, "--limits": None if limits is None else Path(limits)},
    )
    with output.reading(readings) as progress:
        data = Dials(inclination_from, azimuth_counts, toolface_counts).read(read_bench(readings, progress=progress))
    tool, bounds = read_calibration(calibration), None if limits is None else read_limits(limits)
    where = _stand(stand, north_deg, north_sd_deg, level_sd_deg, rig_sd_deg, gravity_sd_percent)
    found = verify_readings(data, tool, bounds, stand=where, second=azimuth_from)
    if output_ is not None:
        if tuple(found.names) != ANGLES:
            raise InputError(
                "--output writes what a certificate states, errors of inclination, azimuth and toolface; this tool has "
                "none of them: use --report or --json"
            )
        from inclinometry.files.verification_json import write_verification

        write_verification(output_, found, bounds, tool)
    if report is not None:
        from inclinometry.report.verification import verification_report

        write_text(verification_report(found), report)
    output.warnings(found.warnings)
    if json:
        output.print_json(
            {
                "verdict": found.verdict,
                "reasons": found.reasons,
                "notes": found.notes,
                "limits": {"name": found.limits_name, "source": found.limits_source},
                "coverage_factor": found.coverage_factor,
                "stations": [
                    {
                        "station": s,
                        **{
                            n: {"error_deg": e[i], "u_deg": w[i], "limit_deg": b[i], "decision": d[i]}
                            for i, n in enumerate(found.names)
                            if n != "-"
                        },
                    }
                    for s, e, w, b, d in zip(
                        found.station,
                        np.degrees(found.errors),
                        np.degrees(found.u),
                        np.degrees(found.limits),
                        found.decision,
                        strict=True,
                    )
                ],
            }
        )
    else:
        show_verification(found)
    return 0 if found.verdict == "pass" else 1


def _stand(
    stand: str,
    north_deg: float | None,
    north_sd_deg: float,
    level_sd_deg: float,
    rig_sd_deg: float | None,
    gravity_sd_percent: float | None,
) -> OtherStand | None:
    """What the options say of another stand; an option that says nothing there is refused."""
    given = {"--north-deg": north_deg is not None, "--north-sd-deg": north_sd_deg != 0.0}
    useless = given | {
        "--level-sd-deg": level_sd_deg != 0.0,
        "--rig-sd-deg": stand == "same" and rig_sd_deg is not None,
        "--gravity-sd-percent": stand == "same" and gravity_sd_percent is not None,
    }
    if stand != "level" and any(useless.values()):
        name = next(option for option, there in useless.items() if there)
        known = "is known from the calibration" if stand == "same" else "is found from the readings"
        raise InputError(f"{name} says nothing of --stand {stand}, which {known}: leave it out, or use --stand level")
    if stand == "same":
        return None
    if given["--north-sd-deg"] and north_deg is None:
        raise InputError("--north-sd-deg without --north-deg: give the north it is the uncertainty of")
    setting, gravity_sd = options.sd(rig_sd_deg, "--rig-sd-deg"), options.gravity_sd(gravity_sd_percent)
    if stand == "fit":
        return OtherStand(setting_sd=setting, gravity_sd=gravity_sd)
    return OtherStand(
        options.sd(level_sd_deg, "--level-sd-deg"),
        options.angle_or_none(north_deg, "--north-deg"),
        options.sd(north_sd_deg, "--north-sd-deg") or 0.0,
        setting,
        gravity_sd,
    )


def show_verification(found: Verification) -> None:
    """Verdict and the largest error of each angle on the terminal."""
    rows = []
    for column, name in enumerate(found.names):
        if name == "-":
            continue
        judged = [row for row in range(len(found.errors)) if found.decision[row][column] != "not judged"]
        if not judged:
            rows.append([name, "-", "-", "-", "not judged"])
            continue
        shares = np.abs(found.errors[judged, column]) / found.limits[judged, column]
        worst = judged[int(np.argmax(shares))]
        e, u, b = (np.degrees(x[worst, column]) for x in (found.errors, found.u, found.limits))
        bad = sum(found.decision[row][column] != "pass" for row in judged)
        verdict = "pass" if bad == 0 else f"{bad} of {len(judged)} not accepted"
        rows.append([name, f"{e:+.3f}", f"{u:.3f}", f"{b:.3f}", verdict])
    output.table(
        f"{found.verdict.upper()} against {found.limits_name}",
        ["angle", "worst error deg", "u deg", "limit deg", "verdict"],
        rows,
        found.limits_source,
    )
    for sentence in (*found.reasons, *found.notes):
        output.say(sentence)


def survey(
    raw: Path,
    /,
    *,
    output_: Output,
    calibration: Path | None = None,
    site: Path | None = None,
    correct: str | None = None,
    bha: Path | None = None,
    azimuth_from: Literal["magnetometer", "gyro"] | None = None,
    hole: Literal["down", "up"] = "down",
    gravity_sd_percent: float | None = None,
    from_: SixAxisForm = None,
    convention: Convention = None,
    switch_deg: float = float(np.degrees(SWITCH)),
    report: Path | None = None,
    json: Json = False,
) -> None:
    """Reduce raw channels to survey stations with uncertainty.

    Parameters
    ----------
    raw
        With a calibration: CSV with md_m and the raw channels. Without: gravity and magnetic field in any format of
        convert, units in the column names (md_m, gx_m_s2 .. gz_m_s2, bx_nT .. bz_nT).
    output_
        Survey CSV.
    calibration
        tool.json; without it the readings are fields already and --site is needed.
    site
        site.toml: north_reference, declination_deg, convergence_deg, g, b_nT, dip_deg and their sigmas; latitude_deg.
    correct
        Corrections in their order, with commas: axial, msa, sag; a corrections.json may stand for msa.
    bha
        bha.toml: the assembly, for sag.
    azimuth_from
        Triad that gives the azimuth: the magnetometer where there is one, else the gyro (true north).
    hole
        Of a tool with two accelerometers: down takes inclinations of 0 to 90 deg, up those of 90 to 180.
    gravity_sd_percent
        Of a tool with two accelerometers: standard uncertainty of |g| here against that at the calibration, 0 at the
        same place. When not given, that of what the site and the calibration state, 0.3 where one states nothing.
    from_
        Format of the readings; by the file's ending when not given.
    convention
        Axes and signs of the sensors in the file, without a calibration; native when not given.
    switch_deg
        Inclination below which toolface_type says magnetic: the toolface to steer by is then magnetic_toolface_deg.
    report
        Write an HTML report.
    json
        Print a JSON summary.
    """
    switch = angle(switch_deg, "--switch-deg", 0.0, 90.0)
    output.claim({"--output": output_, "--report": report}, _inputs(raw, calibration, site, bha, correct))
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
            form=from_,
            convention=convention,
            charts=report is not None,
            progress=progress,
        )
    found, page = done.survey, None
    with output.busy(f"writing {output.counted(len(found), 'station')}"):
        if report is not None:
            from inclinometry.report.survey import survey_report

            place = None if site is None else done.site
            quality = [None if judged is None else judged.quality for judged in (done.judged, done.before)]
            page = survey_report(found, site=place, quality=quality[0], before=quality[1], notes=done.notes)
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


def _inputs(
    raw: Path, calibration: Path | None, site: Path | None, bha: Path | None, correct: str | None
) -> dict[str, Path | None]:
    stored = {name.strip() for name in (correct or "").split(",") if name.strip().lower().endswith(".json")}
    named = {f"--correct {name}": Path(name) for name in sorted(stored)}
    return {"the raw channels": raw, "--calibration": calibration, "--site": site, "--bha": bha, **named}


def _summary(done: SixAxisSurvey, path: Path) -> dict[str, object]:
    found = done.survey
    return {
        "stations": len(found),
        "azimuth_reference": found.azimuth_reference,
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
    output.table("stations, deg with standard uncertainty", header, rows)
