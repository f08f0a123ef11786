"""From the stations of a well to its positions, and how sure they are: by a tool code or by the tool's certificate."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.result import Calibration
from inclinometry.digest import digest_file
from inclinometry.earth.site import Site, convert_azimuth
from inclinometry.errors import FileError, InputError, SiteError, in_file, refused, settled
from inclinometry.files.errors_json import read_errors
from inclinometry.files.position_csv import Listed, WellStations, read_tie, read_well
from inclinometry.files.site_toml import read_site
from inclinometry.files.survey_csv import RawSurvey, read_raw_survey
from inclinometry.files.text import Progress
from inclinometry.files.tool_code_json import load_tool_code
from inclinometry.files.tool_json import read_calibration
from inclinometry.findings import Finding, Value
from inclinometry.position.certificate import with_terms
from inclinometry.position.propagation import AngleRun, MatrixSource, PositionUncertainty, gyro_sources, propagate_runs
from inclinometry.position.propagation import Run as ToolRun
from inclinometry.position.tool_code import ToolCode
from inclinometry.position.well import WellSurvey, well_survey
from inclinometry.survey.from_tool import stations_from_tool
from inclinometry.survey.path import Path as WellPath
from inclinometry.survey.path import minimum_curvature
from inclinometry.survey.plausibility import check_run
from inclinometry.survey.reduce import SensorCorrection
from inclinometry.survey.run import Run
from inclinometry.workflow.calibration_age import Age, at_the_run
from inclinometry.workflow.calibration_error_model import calibration_error_model
from inclinometry.workflow.corrections import matching_correction
from inclinometry.workflow.field import completed, declination_doubts
from inclinometry.workflow.well_runs import Piece, one_well, stations_between


class RunFiles(NamedTuple):
    """Files of a run, as the parameters of `read_position`."""

    survey: str | Path
    tool_code: str | Path | None = None
    tool: str | Path | None = None
    raw: str | Path | None = None
    corrections: str | Path | None = None
    errors: str | Path | None = None


class RunSpan(NamedTuple):
    """A stretch of a well: the file of its run, from and to, m, stations, tool code."""

    file: str
    from_m: float
    to_m: float
    stations: int
    tool_code: str


@dataclass(frozen=True, eq=False)
class WellPosition:
    """A well's path, azimuths and positions from `survey.north`, and its uncertainty, None without an error model.

    azimuth_reference : the north the file's azimuths count from.
    tool_code, calibration : the error model, or the name of the tool whose certificate it is.
    runs : the stretches of a well of several runs.
    """

    path: WellPath
    survey: WellSurvey
    uncertainty: PositionUncertainty | None
    azimuth_reference: str
    tool_code: ToolCode | None = None
    calibration: str | None = None
    inputs: Mapping[str, str] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    runs: tuple[RunSpan, ...] = ()

    @property
    def told(self) -> dict[str, Any]:
        """What a report takes beside path, survey and uncertainty."""
        names = ("azimuth_reference", "tool_code", "calibration", "findings", "inputs")
        return {name: getattr(self, name) for name in names}


def read_position(
    survey: str | Path,
    site_path: str | Path | None = None,
    tool_code: str | Path | None = None,
    tool: str | Path | None = None,
    raw: str | Path | None = None,
    corrections: str | Path | None = None,
    errors: str | Path | None = None,
    *,
    below: Sequence[RunFiles] = (),
    parameters: Mapping[str, float] = MappingProxyType({}),
    age: Age = Age(),  # noqa: B008
    tie_from: str | Path | None = None,
    tie_on: tuple[float, float, float] | None = None,
    tie_sigma: tuple[float, float, float] | None = None,
    north: str | None = None,
    ignored: Sequence[str] = (),
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
    below : sequence of RunFiles
        Further runs of the well: each replaces those before it between its first and its last station.
    parameters : mapping
        Parameters of the tool codes; see `load_tool_code`.
    tie_from : str or Path, optional
        position.csv of the well that this one continues or leaves: position and covariance of the first station.
    age : Age
        Of the calibration at the run; a year where nothing tells it.
    tie_on, tie_sigma : (3,) float, optional
        North, east, true vertical depth of the first station (0, 0, its md), and their standard deviations, m.
    north : str, optional
        What positions count from; the site's, where that is magnetic grid for grid azimuths, else true.
    ignored : sequence of str
        Codes or groups of findings that do not refuse the survey.
    progress : callable, optional

    Raises
    ------
    InputError, FileError
        As the readers; a survey that cannot be true; a site that lacks what the norths or the error model need.
    """
    runs = [RunFiles(survey, tool_code, tool, raw, corrections, errors), *below]
    wells = [read_well(one.survey, progress=progress) for one in runs]
    site, said = completed(Site() if site_path is None else read_site(site_path))
    codes = [None if one.tool_code is None else load_tool_code(one.tool_code, parameters) for one in runs]
    checked: list[Finding] = []
    for one in wells:
        checked += settled(check_run(Run(one.md, one.inclination, one.azimuth)), ignored, one.path)
    target = north or site.north_reference
    if target == "magnetic":
        target = "grid" if {one.azimuth_reference for one in wells} == {"grid"} else "true"
    try:
        stations, pieces, joined = one_well(wells, site, target)
        # the path from the north of the results, and the survey as the error model sees it
        start, tie, untied = _start(stations, target, tie_on, tie_sigma, tie_from)
        turned = convert_azimuth(stations.azimuth, stations.azimuth_reference, target, site)
        path = minimum_curvature(stations.md, stations.inclination, turned, start=start)
        angles = (stations.md, stations.inclination, stations.azimuth)
        well = well_survey(*angles, site, stations.azimuth_reference, tvd=path.tvd, north=target, tie=tie)
    except FileError:
        raise
    except InputError as error:
        raise _of_site(error, site_path) from None
    findings = (*checked, *settled(joined, ignored))
    try:
        uncertainty, used, name, of_model = _uncertainty(runs, codes, well, stations, pieces, age)
    except FileError:
        raise
    except SiteError as error:
        raise _of_site(error, site_path) from None
    except InputError as error:
        # a mistake in the whole run explains what a formula says of one station
        raise in_file(refused(checked[0].code, checked[0].values) if checked else error, stations.path) from None
    said = [*stations.findings, *said, *untied]
    for one in wells:
        said += _against_listed(one, site)
    said += declination_doubts(site)
    if site.date is not None and site.date.year < 1978:  # the first measurement while drilling
        mwd = [one for one in codes if one is not None and "mwd" in one.name.lower()]
        said += [Finding("work-code-date", {"code": one.name, "date": str(site.date)}) for one in mwd]
    said += of_model if uncertainty is not None else [Finding("work-no-model", severity="note")]
    inputs = dict[str, str]()
    for number, (files, one) in enumerate(zip(runs, wells, strict=True), 1):
        prefix = f"run {number}: " if below else ""
        shared = {"site": site_path, "tie": tie_from} if number == 1 else {}
        read = {prefix + name.replace("_", " "): file for name, file in files._asdict().items()} | shared
        inputs |= {name: digest_file(file) for name, file in read.items() if file is not None and Path(file).is_file()}
        inputs[f"{prefix}survey"] = one.digest
    spans = [
        RunSpan(
            Path(runs[k].survey).name, float(well.md[i]), float(well.md[j]), j - i + 1, str(runs[k].tool_code or "")
        )
        for i, j, k in pieces
    ]
    return WellPosition(
        path,
        well,
        uncertainty,
        ", ".join(dict.fromkeys(one.azimuth_reference for one in wells)),
        _all_codes(used),
        name,
        inputs,
        (*findings, *said),
        tuple(spans) if below else (),
    )


_Model: TypeAlias = tuple[Sequence[MatrixSource], ToolCode | None, list[Finding]]
"""Sources of error, the tool code beside them, findings."""


def _uncertainty(
    runs: Sequence[RunFiles],
    codes: Sequence[ToolCode | None],
    well: WellSurvey,
    stations: WellStations,
    pieces: Sequence[Piece],
    age: Age,
) -> tuple[PositionUncertainty | None, list[ToolCode], str | None, list[Finding]]:
    """Uncertainty by the error models of all runs, with tool codes, names of calibrated tools and findings."""
    if not any(map(_modelled, runs)):
        return None, [], None, []
    parts: list[ToolRun] = []
    said: list[Finding] = []
    names: list[str] = []
    for first, last, number in pieces:
        if not _modelled(runs[number]):
            needed = ("--tool-code | --calibration | --errors",)
            raise refused("input-needs", {"name": Path(runs[number].survey).name, "needed": needed})
        sources, code, name, more = _model(runs[number], codes[number], well, stations, (first, last, number), age)
        parts.append(ToolRun(first, last, code, sources, number=number + 1))
        said += [one for one in more if one not in said]
        names += [] if name is None or name in names else [name]
    used = [one.code for one in parts if one.code is not None]
    return propagate_runs(well, parts), used, ", ".join(names) or None, said


def _modelled(run: RunFiles) -> bool:
    return any(one is not None for one in (run.tool_code, run.tool, run.errors))


def _model(
    run: RunFiles, code: ToolCode | None, well: WellSurvey, stations: WellStations, piece: Piece, age: Age
) -> tuple[Sequence[MatrixSource], ToolCode | None, str | None, list[Finding]]:
    """Error model of a stretch of a well: sources, tool code, name of the calibrated tool, findings."""
    first, last, _ = piece
    model: _Model = ((), code, [])
    said: list[Finding] = []
    name = None
    # depths are written to the centimetre; a run that is not the whole well may have stations that others replace
    low, high = float(well.md[first]) - 0.005, float(well.md[last]) + 0.005
    part, rows = last - first + 1 < len(well), slice(first, last + 1)
    if run.tool is not None:
        calibration, said = at_the_run(read_calibration(run.tool), run.tool, well.site, age, otherwise=1.0)
        raw = None if run.raw is None else read_raw_survey(run.raw)
        correction, warned = _stored(run.corrections, run.tool, calibration, raw, well.site)
        raw = stations_between(raw, low, high) if raw is not None and part else raw
        model = calibration_error_model(calibration, well, stations, raw, code, correction, rows)
        said = [*said, *warned]
        name = "the tool" if calibration.tool.name in ("", "unnamed") else calibration.tool.name
    if run.errors is not None:
        errors = read_errors(run.errors)
        model = _of_run(stations_between(errors, low, high) if part else errors, well, code)
    sources, code, more = model
    said += more if code is None else [*more, *code.findings]
    if code is not None and code.east_west_exclusion:
        magnetic = convert_azimuth(well.true_azimuth[rows], "true", "magnetic", well.site)
        across = np.abs(np.sin(well.inclination[rows]) * np.sin(magnetic))
        near = np.flatnonzero(across > np.cos(code.east_west_exclusion))
        if near.size:
            where: dict[str, Value] = {"code": code.name, "limit_deg": float(np.degrees(code.east_west_exclusion))}
            where |= {"count": int(near.size), "md_m": float(well.md[first + near[0]])}
            said.append(Finding("work-east-west", where))
    return sources, code, name, said


def _all_codes(codes: Sequence[ToolCode]) -> ToolCode | None:
    """The tool codes of several runs as a report describes them: names and sources of all, terms of the first."""
    names = ("name", "source", "revision", "description")
    texts = ("; ".join(dict.fromkeys(getattr(one, name) for one in codes)) for name in names)
    return replace(codes[0], **dict[str, Any](zip(names, texts, strict=True))) if codes else None


def _stored(
    path: str | Path | None,
    tool: str | Path | None,
    calibration: Calibration | None,
    raw: RawSurvey | None,
    site: Site,
) -> tuple[SensorCorrection | None, list[Finding]]:
    """A stored correction, where one is given, that may be used for these raw channels, and what speaks against it."""
    if path is None or tool is None or calibration is None or raw is None:
        return None, []
    seen = stations_from_tool(
        raw.md, raw.channels, calibration.tool, temperature=raw.temperature, g=site.gravity, b=site.b
    )
    inputs = {"tool": digest_file(tool), "raw": raw.digest}
    return matching_correction(path, calibration.tool.name, inputs, seen)


def _start(
    stations: WellStations,
    north: str,
    tie_on: tuple[float, float, float] | None,
    tie_sigma: tuple[float, float, float] | None,
    tie_from: str | Path | None,
) -> tuple[tuple[float, float, float], Array | None, list[Finding]]:
    """Position of the first station, its covariance, and that neither was given."""
    first = float(stations.md[0])
    if tie_from is not None:
        return *read_tie(tie_from, first, north), []
    tie = None if tie_sigma is None else np.diag(np.square(np.asarray(tie_sigma, dtype=np.float64)))
    if tie_on is not None or stations.start is not None:
        return tie_on or stations.start or (0.0, 0.0, first), tie, []
    said = [Finding("work-no-tie", {"md_m": first}, severity="note")] if first > 0.0 else []
    return (0.0, 0.0, first), tie, said


def _of_run(run: AngleRun, well: WellSurvey, code: ToolCode | None) -> _Model:
    """The error model that a gyro run is, with what of a tool code is about other things than its angles' sensors."""
    sources = gyro_sources(run, well)
    if code is None:
        lacking = ("measured depth", "misalignment", "sag")
        return sources, None, [Finding("work-sensors-only", {"errors": lacking}, severity="note")]
    # depth, misalignment of tool and hole, sag, course between stations
    kept = [term.name for term in code.terms if re.match(r"DR|DS|MIS|V?SAG|XYM|XCL", term.name, re.IGNORECASE)]
    if not kept:
        raise refused("input-not-with", {"name": f"--tool-code {code.name}", "other": "--errors"})
    added = Finding("work-terms-added", {"code": code.name, "names": tuple(kept)}, severity="note")
    return sources, with_terms(code, kept), [added]


def _of_site(error: InputError, path: str | Path | None) -> InputError:
    """The error with the file in which the remedy belongs."""
    if path is None:
        return refused("work-no-site", {"finding": error.finding})
    return in_file(error, path)


_AXES: Final = {"north": "north", "east": "east", "tvd": "true vertical depth"}


def _uncompared(
    *names: str, needed: tuple[str, ...] = ("columns with known names, units and at least two numbers",)
) -> Finding:
    return Finding("work-not-compared", {"names": names, "needed": needed}, severity="note")


def _listed_paths(stations: WellStations, site: Site) -> tuple[list[tuple[Listed, WellPath]], list[Finding]]:
    """The positions that the file states, each with the path it is compared with, and what is not compared."""
    listed = [one for one in stations.listed if not np.isnan(one.values).all()]
    lacking = tuple(name for axis, name in _AXES.items() if axis not in [one.axis for one in listed])
    notes = []
    if lacking and (listed or stations.unread):
        notes.append(_uncompared(*lacking))
    own = minimum_curvature(stations.md, stations.inclination, stations.azimuth)
    # farther from their origin than the well is long: counted from grid north
    on_map = [one.axis != "tvd" and np.nanmin(np.abs(one.values)) > stations.md[-1] for one in listed]
    if not any(on_map) or stations.azimuth_reference == "grid":
        return [(one, own) for one in listed], notes
    try:
        azimuth = convert_azimuth(stations.azimuth, stations.azimuth_reference, "grid", site)
    except InputError:
        needed = ("azimuths from grid north", "declination and convergence in the site file")
        notes.append(_uncompared("map coordinates", needed=needed))
        return [(one, own) for one, far in zip(listed, on_map, strict=True) if not far], notes
    grid = minimum_curvature(stations.md, stations.inclination, azimuth)
    return [(one, grid if far else own) for one, far in zip(listed, on_map, strict=True)], notes


def _against_listed(stations: WellStations, site: Site) -> list[Finding]:
    """On the positions that the file states beside the angles, counted from their first row."""
    md = stations.md
    listed, found = _listed_paths(stations, site)
    left: set[str] = set()
    of_axis = [[pair for pair in listed if pair[0].axis == axis] for axis in ("north", "east")]
    for (north, path), (east, _) in zip(*of_axis, strict=False):
        rows = _exchanged(north.values, east.values, path)
        if rows:
            left |= {north.name, east.name}
            where: dict[str, Value] = {"md_m": float(md[rows[0]]), "line": int(stations.lines[rows[0]])}
            where |= {"north": north.name, "east": east.name, "count": len(rows), "total": len(md)}
            found.append(Finding("work-exchanged", where, tuple(rows)))
    worst, off, agreed, most = 0.0, list[Finding](), list[str](), 0.0
    for one, path in listed:
        if one.name in left:
            continue
        there = np.flatnonzero(~np.isnan(one.values))
        if there.size < 2:  # positions count from the first: one alone is compared with nothing
            found.append(_uncompared(_AXES[one.axis]))
            continue
        moved = (one.values - getattr(path, one.axis))[there]
        away = np.abs(moved - moved[0])
        # angles to a tenth of a degree, depths and positions to a tenth of a metre
        excess = away - 0.2 - 2e-3 * (md[there] - md[0])
        row = int(np.argmax(excess))
        if excess[row] > worst:
            at, worst = int(there[row]), float(excess[row])
            where = {"name": _AXES[one.axis], "away_m": float(away[row])}
            where |= {"md_m": float(md[at]), "line": int(stations.lines[at])}
            off = [Finding("work-positions-off", where, (at,))]
        agreed.append(_AXES[one.axis])
        most = max(most, float(away.max()))
    if agreed and not off:
        off = [Finding("work-positions-agree", {"names": tuple(agreed), "away_m": most}, severity="note")]
    return [*off, *found]


def _exchanged(north: Array, east: Array, path: WellPath) -> list[int]:
    """Stations at which north and east stand in each other's column, by how they go on from the station above."""
    there = np.flatnonzero(~np.isnan(north + east))
    listed, own = np.stack([north, east], axis=1)[there], np.stack([path.north, path.east], axis=1)[there]
    straight, across = listed - own, listed[:, ::-1] - own
    far = 0.2 + 2e-3 * np.diff(path.md[there])
    found, last = [], straight[0] if there.size else None
    for k in range(1, there.size):
        ahead, turned = (float(np.hypot(*(one[k] - last))) for one in (straight, across))
        exchanged = ahead > far[k - 1] and turned < min(far[k - 1], 0.25 * ahead)
        found += [int(there[k])] if exchanged else []
        last = across[k] if exchanged else straight[k]
    if not found and there.size > 1:  # all of them, in steps too short to tell
        allowed = 0.2 + 2e-3 * (path.md[there] - path.md[there[0]])
        off, back = (np.hypot(*(one - one[0]).T) for one in (straight, across))
        if (off > allowed).any() and (back <= allowed).all() and back.max() < 0.25 * off.max():
            return there.tolist()
    return found
