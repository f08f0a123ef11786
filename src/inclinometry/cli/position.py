"""Command that says where a well is and how sure that is."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter

from inclinometry.cli import options, output
from inclinometry.cli.options import AlsoWritten, InputOrNone, Json, OutputOrNone, Report
from inclinometry.errors import InputError

Metres = Annotated[tuple[float, float, float] | None, Parameter(negative="")]

if TYPE_CHECKING:
    from inclinometry.position.tool_code import ToolCode
    from inclinometry.workflow.position import WellPosition


def position(
    survey: Path,
    /,
    *,
    output_: OutputOrNone = None,
    site: InputOrNone = None,
    tool_code: Annotated[
        str | None,
        Parameter(
            group=options.INPUT,
            help=f"Error model: a JSON file, or a shipped one: {options.shipped('position/tool_codes')}. Without "
            "it and without a calibration there are positions only.",
        ),
    ] = None,
    calibration: InputOrNone = None,
    raw: InputOrNone = None,
    corrections: InputOrNone = None,
    errors: InputOrNone = None,
    age_days: Annotated[
        float | None,
        Parameter(
            group=options.INPUT,
            help="With --calibration: days from the calibration to the run; by the dates of tool.json (calibrate "
            "--created) and of the site when not given, a year where they do not tell.",
        ),
    ] = None,
    stability: options.StabilityFile = None,
    tie_on: Metres = None,
    tie_sigma: Metres = None,
    north: Literal["true", "grid"] | None = None,
    azimuth_reference: Annotated[Literal["magnetic", "true", "grid"] | None, Parameter(group=options.INPUT)] = None,
    trust_file: options.TrustFile = (),
    report: Report = None,
    sources: AlsoWritten = None,
    json: Json = False,
) -> None:
    """Positions of a well by minimum curvature, and their covariance by a tool code or by the tool's own certificate.

    Parameters
    ----------
    survey
        CSV with md_m (or md_ft), inclination_deg, azimuth_deg, azimuth_reference.
    output_
        Position CSV: m and m2; north, east, v down. Only looked at when not given.
    site
        site.toml: declination, convergence and the fields that the error model needs; given or from its models.
    calibration
        tool.json: its covariance is the error model of the sensors; --tool-code then adds its terms for the rest.
    raw
        With --calibration: the raw channels of the stations; else the fields are those of the site.
    corrections
        With --raw: corrections.json of the multi-station analysis the survey was corrected with.
    errors
        errors.json of the gyro run that the survey is: the error model of its angles; --tool-code then adds its terms
        of depth, misalignment and sag.
    tie_on
        North, east, true vertical depth of the first station in m; 0, 0 and its depth along the hole when not given.
    tie_sigma
        Their standard deviations in m.
    north
        What positions count from; when not given the site's north_reference where it is true or grid, else grid for
        grid azimuths and true for others.
    azimuth_reference
        North of the azimuths, where the survey does not say it.
    sources
        Write every source of error at every station as CSV.
    """
    from inclinometry.files.profile import reading_with, with_constants
    from inclinometry.workflow.age import Age
    from inclinometry.workflow.position import read_position

    output.claim(
        {"--output": output_, "--report": report, "--sources": sources},
        {
            "the survey": survey,
            "--site": site,
            "--calibration": calibration,
            "--raw": raw,
            "--corrections": corrections,
            "--errors": errors,
            "--stability": stability,
            "--tool-code": None if tool_code is None else Path(tool_code),
        },
    )
    if corrections is not None and raw is None:
        raise InputError("--corrections needs --raw, the raw channels of the run it was made from, and --calibration")
    if raw is not None and calibration is None:
        raise InputError("--raw serves --calibration alone; give the tool's calibration too")
    if calibration is None and (age_days is not None or stability is not None):
        raise InputError("--age-days and --stability are of a calibration; give --calibration, or leave them out")
    if errors is not None and calibration is not None:
        raise InputError("--errors holds all that a gyro run says of its tool; leave --calibration out")
    if sources is not None and tool_code is None and calibration is None and errors is None:
        raise InputError("--sources needs an error model: give --tool-code, --calibration or --errors")
    with (
        reading_with(None if azimuth_reference is None else with_constants(azimuth_reference=azimuth_reference)),
        output.reading(survey) as progress,
        output.busy("positions and their uncertainty"),
    ):
        found = read_position(
            survey,
            site,
            tool_code,
            calibration,
            raw,
            corrections,
            errors,
            age=Age(age_days, stability),
            trusted=trust_file,
            tie_on=_metres(tie_on, "--tie-on"),
            tie_sigma=_metres(tie_sigma, "--tie-sigma", 0.0),
            north=north,
            progress=progress,
        )
    _write(found, output_, report, sources)
    output.warnings(found.warnings)
    if json:
        output.print_json(_content(found, output_))
        return
    for sentence in found.notes:
        output.say(sentence)
    show_position(found)
    output.written(output_, report, what=output.counted(len(found.path), "station"), sources=sources)


def _metres(values: Metres, option: str, low: float = -1e8) -> Metres:
    if values is not None:
        for value in values:
            if not low <= value <= 1e8:
                raise InputError(f"{option} has {value:g}; allowed {low:g} to 1e+08 m")
    return values


def _write(found: WellPosition, target: Path | None, report: Path | None, sources: Path | None) -> None:
    """All files, the report composed before the first is written."""
    from inclinometry.files.position_csv import write_position_csv, write_sources_csv
    from inclinometry.files.writing import write_text
    from inclinometry.survey.plausibility import OVERRULED

    page = None
    if report is not None:
        from inclinometry.report.position import position_report

        page = position_report(
            found.path,
            found.survey,
            found.uncertainty,
            azimuth_reference=found.azimuth_reference,
            tool_code=found.tool_code,
            calibration=found.calibration,
            notes=found.notes,
            warnings=found.warnings,
            inputs=found.inputs,
        )
    if target is not None:
        overruled = [sentence for sentence in found.warnings if sentence.startswith(OVERRULED)]
        write_position_csv(target, found.path, found.uncertainty, found.survey.north, overruled)
    if sources is not None and found.uncertainty is not None:
        write_sources_csv(sources, found.uncertainty)
    if page is not None:
        write_text(page, report or "")


def show_position(found: WellPosition, most: int = 10) -> None:
    """A few stations spread over the well, and the largest sources at the last, on the terminal."""
    from inclinometry.files.position_csv import position_columns

    columns = position_columns(found.path, found.uncertainty, found.survey.north)
    shown = ["md_m", "tvd_m", "north_m", "east_m", "dls_deg_30m"]
    if found.uncertainty is not None:
        shown += ["semi_major_m", "semi_minor_m", "major_azimuth_deg"]
    rows = [
        [f"{float(columns[name][row]):.2f}" for name in shown]
        for row in np.unique(np.linspace(0, len(found.path) - 1, min(most, len(found.path))).astype(int))
    ]
    header = ["md m", "tvd m", "north m", "east m", "dls", "major m", "minor m", "at deg"][: len(shown)]
    caption = f"from {found.survey.north} north; dls in deg/30 m" + (
        "; horizontal ellipse of one standard deviation" if found.uncertainty is not None else ""
    )
    output.table(f"positions{output.excerpt(len(rows), len(found.path))}", header, rows, caption)
    if found.uncertainty is not None:
        _show_sources(found)


def _show_sources(found: WellPosition, most: int = 6) -> None:
    from inclinometry.report.position import contributions

    parts = contributions(found.uncertainty) if found.uncertainty is not None else []
    rows = [[p.name, p.propagation, f"{p.major:.2f}", f"{100.0 * p.share:.1f}"] for p in parts[:most]]
    output.table("largest sources at the last station", ["source", "shared", "major axis m", "share %"], rows)


def _content(found: WellPosition, target: Path | None) -> dict[str, Any]:
    """Everything a machine asks for first: the last station, its covariance, ellipse and sources."""
    from inclinometry.files.position_csv import position_columns

    columns = position_columns(found.path, found.uncertainty, found.survey.north)
    last = {n: values if isinstance(values, str) else values[-1] for n, values in columns.items()}
    return {
        "stations": len(found.path),
        "azimuth_reference": found.azimuth_reference,
        "north_reference": found.survey.north,
        "error_model": _model(found.tool_code, found.calibration) or ({"run": "errors"} if found.uncertainty else None),
        "last_station": last,
        "sources": _sources(found),
        "notes": found.notes,
        "warnings": found.warnings,
        "inputs": dict(found.inputs),
        "output": target,
    }


def _sources(found: WellPosition) -> list[dict[str, Any]]:
    if found.uncertainty is None:
        return []
    from inclinometry.report.position import contributions

    return [
        {
            "source": part.name,
            "propagation": part.propagation,
            "sigma_north_m": part.sigma[0],
            "sigma_east_m": part.sigma[1],
            "sigma_vertical_m": part.sigma[2],
            "sigma_major_axis_m": part.major,
            "share": part.share,
        }
        for part in contributions(found.uncertainty)
    ]


def _model(code: ToolCode | None, calibration: str | None) -> dict[str, Any] | None:
    if code is None:
        return None if calibration is None else {"calibration": calibration}
    named = {"tool_code": code.name, "revision": code.revision, "source": code.source}
    return named if calibration is None else {"calibration": calibration, **named}
