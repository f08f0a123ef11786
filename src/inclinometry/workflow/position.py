"""From the stations of a well to its positions, and how sure they are: by a tool code or by the tool's certificate."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from inclinometry.calibration.result import Calibration
from inclinometry.digest import digest_file
from inclinometry.earth.site import Site, convert_azimuth
from inclinometry.errors import FileError, InputError
from inclinometry.files.errors_json import read_errors
from inclinometry.files.position_csv import WellStations, read_well
from inclinometry.files.site_toml import read_site
from inclinometry.files.survey_csv import RawSurvey, read_raw_survey
from inclinometry.files.table import Progress
from inclinometry.files.tool_code_json import load_tool_code
from inclinometry.files.tool_json import read_calibration
from inclinometry.position.certificate import with_terms
from inclinometry.position.propagation import AngleRun, MatrixSource, PositionUncertainty, gyro_sources, propagate
from inclinometry.position.tool_code import ToolCode
from inclinometry.position.well import WellSurvey, well_survey
from inclinometry.rotations import wrap_signed
from inclinometry.survey.from_tool import stations_from_tool
from inclinometry.survey.path import Path as WellPath
from inclinometry.survey.path import dogleg_severity_deg, minimum_curvature
from inclinometry.survey.plausibility import Run, doubts, settle
from inclinometry.survey.reduce import SensorCorrection
from inclinometry.workflow.age import Age, at_the_run
from inclinometry.workflow.calibration_error_model import calibration_error_model
from inclinometry.workflow.corrections import matching_correction
from inclinometry.workflow.field import completed, model_of


@dataclass(frozen=True, eq=False)
class WellPosition:
    """A well's path and its uncertainty.

    path : inclinometry.survey.path.Path, azimuths and positions from `survey.north`.
    survey : WellSurvey
    uncertainty : PositionUncertainty, or None without an error model.
    azimuth_reference : the north the file's azimuths count from.
    tool_code : ToolCode, where one is the error model; calibration : name of the tool, where its certificate is.
    notes : what was taken for granted; warnings : what may be wrong.
    inputs : name -> digest.
    """

    path: WellPath
    survey: WellSurvey
    uncertainty: PositionUncertainty | None
    azimuth_reference: str
    tool_code: ToolCode | None = None
    calibration: str | None = None
    notes: Sequence[str] = ()
    warnings: Sequence[str] = ()
    inputs: Mapping[str, str] = field(default_factory=dict)


def read_position(
    survey: str | Path,
    site_path: str | Path | None = None,
    tool_code: str | Path | None = None,
    tool: str | Path | None = None,
    raw: str | Path | None = None,
    corrections: str | Path | None = None,
    errors: str | Path | None = None,
    *,
    age: Age = Age(),  # noqa: B008
    tie_on: tuple[float, float, float] | None = None,
    tie_sigma: tuple[float, float, float] | None = None,
    north: str | None = None,
    trusted: Sequence[str] = (),
    progress: Progress | None = None,
) -> WellPosition:
    """Positions of a well from files.

    Parameters
    ----------
    survey : str or Path
        See `read_well`.
    site_path : str or Path, optional
        site.toml; what it lacks is filled from models where place and date are known.
    tool_code : str or Path, optional
        Name or file of an error model.
    tool : str or Path, optional
        tool.json, whose covariance is the error model, of the sensors where a tool code is named too.
    raw : str or Path, optional
        Raw channels of the same stations, for the fields that the tool saw.
    corrections : str or Path, optional
        corrections.json of the multi-station analysis that the survey was corrected with.
    errors : str or Path, optional
        errors.json of the gyro run that the survey is: the error model of its angles.
    age : Age
        Of the calibration at the run; a year where nothing tells it.
    tie_on, tie_sigma, north, trusted
        As `well_position`.
    progress : callable, optional

    Raises
    ------
    InputError, FileError
        As the readers and `well_position`.
    """
    stations = read_well(survey, progress=progress)
    site, said = completed(Site() if site_path is None else read_site(site_path))
    code = None if tool_code is None else load_tool_code(tool_code)
    calibration = None
    if tool is not None:
        calibration, old = at_the_run(read_calibration(tool), tool, site, age, otherwise=1.0)
        said = [*said, *old]
    channels = None if raw is None else read_raw_survey(raw)
    correction: SensorCorrection | None = None
    warned: list[str] = []
    if corrections is not None and calibration is not None and channels is not None and tool is not None:
        # a stored correction that may be used for these raw channels, and what speaks against it
        seen = stations_from_tool(
            channels.md, channels.channels, calibration.tool, temperature=channels.temperature, g=site.gravity, b=site.b
        )
        correction, warned = matching_correction(
            corrections, calibration.tool.name, {"tool": digest_file(tool), "raw": channels.digest}, seen
        )
    found = well_position(
        stations,
        site,
        code,
        calibration,
        channels,
        correction,
        None if errors is None else read_errors(errors),
        tie_on=tie_on,
        tie_sigma=tie_sigma,
        north=north,
        trusted=trusted,
        site_path=site_path,
    )
    files = {
        "site": site_path,
        "tool code": tool_code,
        "tool": tool,
        "raw": raw,
        "corrections": corrections,
        "errors": errors,
    }
    read = {name: path for name, path in files.items() if path is not None and Path(path).is_file()}
    digests = {name: digest_file(path) for name, path in read.items()}
    warnings = (*warned, *found.warnings)
    return replace(found, notes=(*said, *found.notes), warnings=warnings, inputs={**found.inputs, **digests})


def well_position(
    stations: WellStations,
    site: Site,
    tool_code: ToolCode | None = None,
    calibration: Calibration | None = None,
    raw: RawSurvey | None = None,
    correction: SensorCorrection | None = None,
    run: AngleRun | None = None,
    *,
    tie_on: tuple[float, float, float] | None = None,
    tie_sigma: tuple[float, float, float] | None = None,
    north: str | None = None,
    trusted: Sequence[str] = (),
    site_path: str | Path | None = None,
) -> WellPosition:
    """Positions of a well by minimum curvature, with their covariance where there is an error model.

    Parameters
    ----------
    stations : WellStations
        From `read_well`.
    site : Site
        Completed with what the error model needs.
    tool_code : ToolCode, optional
        The error model.
    calibration : Calibration, optional
        Its covariance is the error model, beside which the tool code tells of other things than the sensors.
    raw : RawSurvey, optional
        The raw channels of the same stations; without them the fields are those of the site.
    correction : SensorCorrection, optional
        Of the multi-station analysis that the survey was corrected with.
    run : AngleRun, optional
        The gyro run that the stations are, with what may be wrong with its angles; no calibration goes beside it. The
        tool code then tells of depth, misalignment, sag and the course between stations.
    tie_on : (3,) floats, optional
        North, east and true vertical depth of the first station, m; 0, 0 and its measured depth where not given.
    tie_sigma : (3,) floats, optional
        Their standard deviations, m.
    north : {"true", "grid"}, optional
        What positions count from; else the site's north_reference, and where that is magnetic grid for grid azimuths
        and true for others.
    trusted : sequence of str
        Names of `inclinometry.survey.plausibility.CHECKS` that are overruled.
    site_path : str or Path, optional
        The site's file, for messages.

    Raises
    ------
    InputError
        A run that cannot be true (`inclinometry.survey.plausibility.doubts`).
    FileError
        A declination or another value that is lacking, naming the site's file; stations the model is not made for.
    """
    found = doubts(Run(stations.md, stations.inclination, stations.azimuth))
    implausible = settle(found, trusted, stations.path)
    grid_or_true = "grid" if stations.azimuth_reference == "grid" else "true"
    target = north or (grid_or_true if site.north_reference == "magnetic" else site.north_reference)
    try:
        # the path from the north of the results, and the survey as the error model sees it
        start = (0.0, 0.0, float(stations.md[0])) if tie_on is None else tie_on
        turned = convert_azimuth(stations.azimuth, stations.azimuth_reference, target, site)
        path = minimum_curvature(stations.md, stations.inclination, turned, start=start)
        tie = None if tie_sigma is None else np.diag(np.square(np.asarray(tie_sigma, dtype=np.float64)))
        seen = (stations.md, stations.inclination, stations.azimuth)
        well = well_survey(*seen, site, stations.azimuth_reference, tvd=path.tvd, north=target, tie=tie)
    except InputError as error:
        raise _of_site(error, site_path) from None
    sources: Sequence[MatrixSource] = ()
    code = tool_code
    notes: list[str] = []
    warnings: list[str] = []
    uncertainty = None
    try:
        if calibration is not None:
            sources, code, notes, warnings = calibration_error_model(
                calibration, well, stations, raw, tool_code, correction
            )
        if run is not None:
            sources, code, notes, warnings = _of_run(run, well, tool_code)
        if code is not None or sources:
            uncertainty = propagate(well, code, sources)
    except InputError as error:
        if "the site" in str(error):
            raise _of_site(error, site_path) from None
        # what is doubted of the whole run explains what a formula says of one station
        raise FileError("; ".join([*implausible, str(error)]), path=stations.path) from None
    said = []
    if tie_on is None and stations.md[0] > 0.0:
        first = f"{stations.md[0]:g} m"
        said.append(
            f"the first station stands at {first} and no tie-on was given: its position was taken as north 0, east 0, "
            f"true vertical depth {first}"
        )
    if stations.left_out:
        number, line = len(stations.left_out), stations.left_out[0]
        said.append(f"rows without inclination and azimuth were left out: {number}, the first in line {line}")
    if stations.listed is not None:
        agreed, doubt = _against_listed(stations)
        said += agreed
        warnings = [*warnings, *doubt]
    if uncertainty is None:
        said.append("no tool code and no calibration was given: positions only, their uncertainty is left blank")
    name = None if calibration is None else calibration.tool.name
    return WellPosition(
        path,
        well,
        uncertainty,
        stations.azimuth_reference,
        code,
        "the tool" if name in ("", "unnamed") else name,
        [*said, *notes],
        (*(implausible or _sharp(stations, path)), *_declination_doubts(site), *warnings),
        {"survey": stations.digest},
    )


def _of_run(
    run: AngleRun, well: WellSurvey, code: ToolCode | None
) -> tuple[Sequence[MatrixSource], ToolCode | None, list[str], list[str]]:
    """The error model that a gyro run is, with what of a tool code is about other things than its angles' sensors."""
    sources = gyro_sources(run, well)
    if code is None:
        return sources, None, [], [
            "the run tells of its sensors alone: errors of measured depth, misalignment in the hole and sag are not in "
            "the ellipses; a tool code beside --errors adds them"
        ]  # fmt: skip
    # depth, misalignment of tool and hole, sag, course between stations
    kept = [term.name for term in code.terms if re.match(r"DR|DS|MIS|V?SAG|XYM|XCL", term.name, re.IGNORECASE)]
    if not kept:
        raise InputError(f"tool code {code.name} has no terms of depth, misalignment or sag: leave it out")
    return sources, with_terms(code, kept), [f"beside the run's own errors: {', '.join(kept)} of {code.name}"], []


def _of_site(error: InputError, path: str | Path | None) -> InputError:
    """The error with the file in which the remedy belongs."""
    if path is None:
        return InputError(f"{error} (there is no site file: name one with --site)")
    return FileError(str(error), path=path)


def _against_listed(stations: WellStations) -> tuple[list[str], list[str]]:
    """A note or a warning on the positions that the file states beside the angles, by the north of its azimuths."""
    own = minimum_curvature(stations.md, stations.inclination, stations.azimuth)
    computed = np.stack([own.north, own.east, own.tvd], axis=1)
    away = np.zeros(len(stations))
    for listed, found in zip(np.asarray(stations.listed).T, computed.T, strict=True):
        there = np.flatnonzero(~np.isnan(listed))
        if there.size:
            moved = listed[there] - found[there]
            away[there] = np.maximum(away[there], np.abs(moved - moved[0]))
    # angles to a tenth of a degree, depths and positions to a tenth of a metre
    excess = away - 0.2 - 2e-3 * (stations.md - stations.md[0])
    row = int(np.argmax(excess))
    if excess[row] > 0.0:
        return [], [
            f"the positions in the file are {away[row]:.2f} m from the path by minimum curvature at md "
            f"{stations.md[row]:g} m (line {stations.lines[row]}), and the latter is given out: another method or "
            "north, or a typing error?"
        ]
    return [f"the positions in the file agree with the path by minimum curvature within {away.max():.2f} m"], []


def _sharp(stations: WellStations, path: WellPath) -> list[str]:
    """A bend sharper than a hole's, where nothing else was found."""
    severity = dogleg_severity_deg(path)
    # deg/30 m above which a typing error is likelier than a hole; short-radius wells stay below, and so does what an
    # error of 3 deg makes of stations close together
    row = 1 + int(np.argmax(severity[1:] - 90.0 / np.diff(stations.md)))
    if severity[row] - 90.0 / (stations.md[row] - stations.md[row - 1]) <= 60.0:
        return []
    return [
        f"dogleg severity {severity[row]:.0f} deg/30 m at md {stations.md[row]:g} m (line {stations.lines[row]}): "
        "a typing error, or depths in another unit?"
    ]


def _declination_doubts(site: Site) -> list[str]:
    """The declination against the model of the place."""
    # a given declination held against the model of the place, where that is known: a wrong sign shows
    place = (site.latitude, site.longitude, site.date)
    if site.declination is None or site.origin("declination") != "given" or None in place:
        return []
    latitude, longitude, date = site.latitude or 0.0, site.longitude or 0.0, site.date
    try:
        if date is None:
            return []
        found = model_of(date)(latitude, longitude, site.height_m or 0.0, date)
    except InputError:
        return []  # a date that no model covers: nothing to hold it against
    expected, sigma = float(found.declination), float(found.declination_sigma)
    away = abs(float(wrap_signed(site.declination - expected)))
    if away <= max(3.0 * sigma, np.radians(1.0)):
        return []
    turned = abs(float(wrap_signed(-site.declination - expected))) < 0.5 * away
    doubt = "; its sign looks wrong (east is positive)" if turned else "; check it"
    return [
        f"the site's declination is {np.degrees(site.declination):+.2f} deg, {found.model} gives "
        f"{np.degrees(expected):+.2f} ± {np.degrees(sigma):.2f} deg there{doubt}",
    ]
