"""Command that says where a well is and how sure that is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from cyclopts import Parameter, Token

from inclinometry.cli import options, output
from inclinometry.errors import not_among, out_of_range, refused, wrong_kind
from inclinometry.findings import ignored_lines


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
ByRun: TypeAlias = Annotated[tuple[str, ...], Parameter(group=options.INPUT, negative="", show_default=False)]
"""A file for all runs, RUN=FILE for one of them."""

if TYPE_CHECKING:
    from inclinometry.workflow.position import WellPosition


def position(
    survey: Path,
    /,
    *more: Path,
    output_: options.OutputOrNone = None,
    site: options.InputOrNone = None,
    tool_code: Annotated[
        ByRun,
        Parameter(
            help="Error model: a JSON or IPM file, or a shipped one: "
            f"{options.shipped('position/tool_codes')}. RUN=CODE for one of several runs; RUN is its file or number.",
        ),
    ] = (),
    tool_parameter: ByRun = (),
    calibration: ByRun = (),
    raw: ByRun = (),
    corrections: ByRun = (),
    errors: ByRun = (),
    age_days: Annotated[
        options.AgeDays,
        Parameter(
            help="With --calibration: days from calibration to run. Default: from the dates, else a year.",
        ),
    ] = None,
    stability: options.StabilityFile = None,
    tie_on: Annotated[Point, _metres("-1e8")] = None,
    tie_sigma: Annotated[Point, _metres("0")] = None,
    tie_from: options.InputOrNone = None,
    north: Literal["true", "grid"] | None = None,
    azimuth_reference: Annotated[Literal["magnetic", "true", "grid"] | None, Parameter(group=options.INPUT)] = None,
    ignore: options.Ignore = (),
    report: options.Report = None,
    sources: options.AlsoWritten = None,
    every: Annotated[float | None, options.quantity("m", 0.01, 10_000.0, group=options.OUTPUT)] = None,
    section_azimuth: Annotated[float | None, options.quantity("deg", -360.0, 360.0, group=options.OUTPUT)] = None,
    feet: Annotated[bool, Parameter(negative="", show_default=False, group=options.OUTPUT)] = False,
    json: options.Json = False,
) -> None:
    """Positions of a well by minimum curvature, and their covariance by a tool code or by the tool's own certificate.

    Parameters
    ----------
    survey
        Table with md_m (or md_ft), inclination_deg, azimuth_deg, azimuth_reference. Without angles: north, east and
        tvd, or x (east), y (north) and z (elevation or depth); angles are then computed and written.
    more
        Further runs of the well. Between its first and last station a run replaces those named before it.
    output_
        Write positions and covariance: m, m2; north, east, v down. Without -o nothing is written.
    site
        site.toml: declination, convergence and fields for the error model; missing fields come from models.
    calibration
        tool.json: its covariance describes the sensors. --tool-code adds the other terms. RUN=FILE for one run; so
        are --raw, --corrections and --errors given.
    tool_parameter
        NAME=VALUE: a parameter of the tool codes, for instance noise_reduction_factor=0.5.
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
    tie_from
        position.csv of the well above: position and covariance at the depth of the first station.
    north
        Reference of north and east: true or grid. Default: the site's north_reference; else grid for grid azimuths,
        true for others.
    azimuth_reference
        North of the azimuths if the survey states none.
    sources
        Write each error source at each station as CSV.
    every
        Also write points at this interval, m, with their angles and covariance.
    section_azimuth
        Also write the vertical section along this azimuth, from north 0, east 0.
    feet
        Lengths in ft, dogleg per 100 ft, in the table, --output, --sources and --json.
    """
    from inclinometry.files.position_csv import position_columns
    from inclinometry.files.profile import reading_with, with_constants
    from inclinometry.workflow.calibration_age import Age
    from inclinometry.workflow.position import RunFiles, read_position

    surveys = (survey, *more)
    given = {"--tool-code": tool_code, "--calibration": calibration, "--raw": raw, "--corrections": corrections}
    given |= {"--errors": errors}
    by_run = {option: _of_runs(option, texts, surveys) for option, texts in given.items()}
    read = {f"run {k}": one for k, one in enumerate(more, 2)} | {"the survey": survey, "--site": site}
    read |= {"--stability": stability, "--tie-from": tie_from}
    read |= {option if k == 1 else f"{option} of run {k}": Path(one) if one else None for option, own in by_run.items()
             for k, one in enumerate(own, 1)}  # fmt: skip
    output.check_outputs({"--output": output_, "--report": report, "--sources": sources}, read)
    runs = [RunFiles(*files) for files in zip(surveys, *by_run.values(), strict=True)]
    for one in runs:
        if one.corrections is not None and one.raw is None:
            raise refused("input-needs", {"name": "--corrections", "needed": ("--raw", "--calibration")})
        if one.raw is not None and one.tool is None:
            raise refused("input-needs", {"name": "--raw", "needed": ("--calibration",)})
        if one.errors is not None and one.tool is not None:
            raise refused("input-not-with", {"name": "--calibration", "other": "--errors"})
    if not calibration and (age_days is not None or stability is not None):
        raise refused("input-needs", {"name": "--age-days, --stability", "needed": ("--calibration",)})
    if sources is not None and not (tool_code or calibration or errors):
        raise refused("input-needs", {"name": "--sources", "needed": ("--tool-code | --calibration | --errors",)})
    if tie_from is not None and (tie_on is not None or tie_sigma is not None):
        raise refused("input-not-with", {"name": "--tie-on, --tie-sigma", "other": "--tie-from"})
    with (
        reading_with(None if azimuth_reference is None else with_constants(azimuth_reference=azimuth_reference)),
        output.reading(survey) as progress,
        output.busy("positions and their uncertainty"),
    ):
        first = runs[0]
        found = read_position(
            first.survey,
            site,
            *first[1:],
            below=runs[1:],
            parameters=dict(_parameter(text) for text in tool_parameter),
            age=Age(age_days, stability),
            ignored=ignore,
            tie_from=tie_from,
            tie_on=tie_on,
            tie_sigma=tie_sigma,
            north=north,
            progress=progress,
        )
    shown: dict[str, Any] = {"section": section_azimuth, "feet": feet}
    _write(found, output_, report, sources, every, shown)
    output.findings(found.findings)
    columns = position_columns(found.path, found.uncertainty, found.survey.north, **shown)
    if json:
        output.print_json(_content(found, output_, columns))
        return
    show_position(found, columns)
    output.print_outputs(output_, report, what=output.counted(len(found.path), "station"), sources=sources)


def _of_runs(option: str, texts: Sequence[str], surveys: Sequence[Path]) -> list[str | None]:
    """The value of each run, of those for all runs or RUN=VALUE."""
    runs = {name: k for k, path in enumerate(surveys) for name in (str(k + 1), path.stem, path.name, str(path))}
    found: dict[int | None, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        run = runs.get(name) if equals else None
        if equals and run is None and not Path(text).exists():
            raise not_among(option, name, (path.name for path in surveys))
        if run in found:
            raise refused("input-repeated", {"name": option, "value": text})
        found[run] = text if run is None else value
    return [found.get(k, found.get(None)) for k in range(len(surveys))]


def _parameter(text: str) -> tuple[str, float]:
    """NAME=VALUE."""
    name, _, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        raise wrong_kind(f"--tool-parameter {name}", value, "number") from None


def _write(
    found: WellPosition,
    target: Path | None,
    report: Path | None,
    sources: Path | None,
    every: float | None,
    shown: Mapping[str, Any],
) -> None:
    """All files, the report composed before the first is written."""
    from inclinometry.files.position_csv import write_position_csv, write_sources_csv
    from inclinometry.workflow.holes import positions_every

    more = {**found.told, "section": shown["section"]}
    with output.reported(report, "position:position_report", found.path, found.survey, found.uncertainty, **more):
        path = found.path if every is None else positions_every(found.path, every)
        computed = any(one.code == "readings-through-positions" for one in found.findings)
        points = {
            **shown,
            "stations": None if every is None else found.path.md,
            "angles": computed or every is not None,
        }
        if target is not None:
            ignored = ignored_lines(found.findings)
            write_position_csv(target, path, found.uncertainty, found.survey.north, ignored, **points)
        if sources is not None and found.uncertainty is not None:
            write_sources_csv(sources, found.uncertainty, feet=shown["feet"])


def show_position(found: WellPosition, columns: Mapping[str, Any], most: int = 10) -> None:
    """A few stations spread over the well, and the largest sources at the last, on the terminal."""
    if found.runs:
        cells = [[x if isinstance(x, str) else f"{x:.12g}" for x in one] for one in found.runs]
        output.table("runs, from top to bottom", ["run", "from m", "to m", "stations", "tool code"], cells)
    unit, per = ("m", "30m") if "md_m" in columns else ("ft", "100ft")
    places = [(f"{name}_{unit}", f"{name} {unit}") for name in ("md", "tvd", "north", "east", "section")]
    places.append((f"dls_deg_{per}", "dls"))
    if found.uncertainty is not None:
        places += [(f"semi_{name}_{unit}", f"{name} {unit}") for name in ("major", "minor")]
        places.append(("major_azimuth_deg", "at deg"))
    shown = [place for place in places if place[0] in columns]
    rows = [[f"{float(columns[name][row]):.2f}" for name, _ in shown] for row in output.spread(len(found.path), most)]
    caption = f"from {found.survey.north} north; dls in deg/{per.replace(unit, f' {unit}')}" + (
        "; horizontal ellipse of one standard deviation" if found.uncertainty is not None else ""
    )
    output.table(f"positions{output.excerpt(len(rows), len(found.path))}", [head for _, head in shown], rows, caption)
    if found.uncertainty is not None:
        from inclinometry.report.position import contributions

        parts = contributions(found.uncertainty)[:6]
        rows = [[p.name, p.propagation, f"{p.major:.2f}", f"{100.0 * p.share:.1f}"] for p in parts]
        output.table("largest sources at the last station", ["source", "shared", "major axis m", "share %"], rows)


def _content(found: WellPosition, target: Path | None, columns: Mapping[str, Any]) -> dict[str, Any]:
    """Everything a machine asks for first: the last station, its covariance, ellipse and sources."""
    last = {n: values if isinstance(values, str) else values[-1] for n, values in columns.items()}
    code, model = found.tool_code, {} if found.calibration is None else {"calibration": found.calibration}
    if code is not None:
        model |= {"tool_code": code.name, "revision": code.revision, "source": code.source}
    return {
        "stations": len(found.path),
        "azimuth_reference": found.azimuth_reference,
        "north_reference": found.survey.north,
        "error_model": model or ({"run": "errors"} if found.uncertainty else None),
        "runs": [one._asdict() for one in found.runs],
        "last_station": last,
        "sources": _sources(found),
        "findings": found.findings,
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
