"""Command that says where a well is and how sure that is."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from cyclopts import Parameter, Token

from inclinometry.cli import options, output
from inclinometry.errors import out_of_range, refused


def _metres(low: str) -> Parameter:
    """Three lengths, none below the lowest allowed."""

    def three(type_: Any, tokens: Sequence[Token]) -> tuple[float, ...]:
        values = tuple(float(token.value) for token in tokens)
        for value in values:
            if not float(low) <= value <= 1e8:
                raise out_of_range(tokens[0].keyword or "", value, f"{low} .. 1e8")
        return values

    return Parameter(negative="", converter=three, n_tokens=3)


Point: TypeAlias = tuple[float, float, float] | None

if TYPE_CHECKING:
    from inclinometry.workflow.position import WellPosition


def position(
    survey: Path,
    /,
    *,
    output_: options.OutputOrNone = None,
    site: options.InputOrNone = None,
    tool_code: Annotated[
        str | None,
        Parameter(
            group=options.INPUT,
            help=f"Error model: a JSON file, or a shipped one: {options.shipped('position/tool_codes')}. Without it "
            "and without --calibration no uncertainty is computed.",
        ),
    ] = None,
    calibration: options.InputOrNone = None,
    raw: options.InputOrNone = None,
    corrections: options.InputOrNone = None,
    errors: options.InputOrNone = None,
    age_days: Annotated[
        options.AgeDays,
        Parameter(
            help="With --calibration: days from calibration to run. Default: from the dates, else a year.",
        ),
    ] = None,
    stability: options.StabilityFile = None,
    tie_on: Annotated[Point, _metres("-1e8")] = None,
    tie_sigma: Annotated[Point, _metres("0")] = None,
    north: Literal["true", "grid"] | None = None,
    azimuth_reference: Annotated[Literal["magnetic", "true", "grid"] | None, Parameter(group=options.INPUT)] = None,
    ignore: options.Ignore = (),
    report: options.Report = None,
    sources: options.AlsoWritten = None,
    json: options.Json = False,
) -> None:
    """Positions of a well by minimum curvature, and their covariance by a tool code or by the tool's own certificate.

    Parameters
    ----------
    survey
        Table with md_m (or md_ft), inclination_deg, azimuth_deg, azimuth_reference.
    output_
        Write positions and covariance: m, m2; north, east, v down. Without -o nothing is written.
    site
        site.toml: declination, convergence and fields for the error model; missing fields come from models.
    calibration
        tool.json: its covariance describes the sensors. --tool-code adds the other terms.
    raw
        With --calibration: raw channels of the stations. Without it, fields of the site are used.
    corrections
        With --raw: corrections.json applied to this survey.
    errors
        errors.json of a gyro run: error model of the angles. --tool-code adds depth, misalignment and sag.
    tie_on
        North, east, true vertical depth of the first station, m. Default: 0, 0, its measured depth.
    tie_sigma
        Standard deviations of the tie-on, m.
    north
        Reference of north and east: true or grid. Default: the site's north_reference; else grid for grid azimuths,
        true for others.
    azimuth_reference
        North of the azimuths if the survey states none.
    sources
        Write each error source at each station as CSV.
    """
    from inclinometry.files.profile import reading_with, with_constants
    from inclinometry.workflow.calibration_age import Age
    from inclinometry.workflow.position import read_position

    code = {"--tool-code": None if tool_code is None else Path(tool_code)}
    read = {"the survey": survey, "--site": site, "--calibration": calibration, "--raw": raw}
    read |= {"--corrections": corrections, "--errors": errors, "--stability": stability, **code}
    output.check_outputs({"--output": output_, "--report": report, "--sources": sources}, read)
    if corrections is not None and raw is None:
        raise refused("input-needs", {"name": "--corrections", "needed": ("--raw", "--calibration")})
    if raw is not None and calibration is None:
        raise refused("input-needs", {"name": "--raw", "needed": ("--calibration",)})
    if calibration is None and (age_days is not None or stability is not None):
        raise refused("input-needs", {"name": "--age-days, --stability", "needed": ("--calibration",)})
    if errors is not None and calibration is not None:
        raise refused("input-not-with", {"name": "--calibration", "other": "--errors"})
    if sources is not None and tool_code is None and calibration is None and errors is None:
        raise refused("input-needs", {"name": "--sources", "needed": ("--tool-code | --calibration | --errors",)})
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
            ignored=ignore,
            tie_on=tie_on,
            tie_sigma=tie_sigma,
            north=north,
            progress=progress,
        )
    _write(found, output_, report, sources)
    output.findings(found.findings)
    if json:
        output.print_json(_content(found, output_))
        return
    show_position(found)
    output.print_outputs(output_, report, what=output.counted(len(found.path), "station"), sources=sources)


def _write(found: WellPosition, target: Path | None, report: Path | None, sources: Path | None) -> None:
    """All files, the report composed before the first is written."""
    from inclinometry.files.position_csv import write_position_csv, write_sources_csv

    with output.reported(report, "position:position_report", found.path, found.survey, found.uncertainty, **found.told):
        if target is not None:
            ignored = [f"ignored {one.code}: {one}" for one in found.findings if one.severity == "ignored"]
            write_position_csv(target, found.path, found.uncertainty, found.survey.north, ignored)
        if sources is not None and found.uncertainty is not None:
            write_sources_csv(sources, found.uncertainty)


def show_position(found: WellPosition, most: int = 10) -> None:
    """A few stations spread over the well, and the largest sources at the last, on the terminal."""
    from inclinometry.files.position_csv import position_columns

    columns = position_columns(found.path, found.uncertainty, found.survey.north)
    shown = ["md_m", "tvd_m", "north_m", "east_m", "dls_deg_30m"]
    if found.uncertainty is not None:
        shown += ["semi_major_m", "semi_minor_m", "major_azimuth_deg"]
    rows = [[f"{float(columns[name][row]):.2f}" for name in shown] for row in output.spread(len(found.path), most)]
    header = ["md m", "tvd m", "north m", "east m", "dls", "major m", "minor m", "at deg"][: len(shown)]
    caption = f"from {found.survey.north} north; dls in deg/30 m" + (
        "; horizontal ellipse of one standard deviation" if found.uncertainty is not None else ""
    )
    output.table(f"positions{output.excerpt(len(rows), len(found.path))}", header, rows, caption)
    if found.uncertainty is not None:
        from inclinometry.report.position import contributions

        parts = contributions(found.uncertainty)[:6]
        rows = [[p.name, p.propagation, f"{p.major:.2f}", f"{100.0 * p.share:.1f}"] for p in parts]
        output.table("largest sources at the last station", ["source", "shared", "major axis m", "share %"], rows)


def _content(found: WellPosition, target: Path | None) -> dict[str, Any]:
    """Everything a machine asks for first: the last station, its covariance, ellipse and sources."""
    from inclinometry.files.position_csv import position_columns

    columns = position_columns(found.path, found.uncertainty, found.survey.north)
    last = {n: values if isinstance(values, str) else values[-1] for n, values in columns.items()}
    code, model = found.tool_code, {} if found.calibration is None else {"calibration": found.calibration}
    if code is not None:
        model |= {"tool_code": code.name, "revision": code.revision, "source": code.source}
    return {
        "stations": len(found.path),
        "azimuth_reference": found.azimuth_reference,
        "north_reference": found.survey.north,
        "error_model": model or ({"run": "errors"} if found.uncertainty else None),
        "last_station": last,
        "sources": _sources(found),
        "findings": [one.plain() for one in found.findings],
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
