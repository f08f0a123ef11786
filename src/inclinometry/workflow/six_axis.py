"""From a six-axis file to stations, their quality, their corrections and the survey."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.arrays import Array, Mask
from inclinometry.calibration.result import Calibration, same_tool, same_units
from inclinometry.constants import STANDARD_GRAVITY, VECTORS
from inclinometry.digest import digest_file
from inclinometry.earth.site import Site, convert_azimuth
from inclinometry.errors import FileError, refused, settled
from inclinometry.files.columns import channel
from inclinometry.files.site_toml import read_site
from inclinometry.files.survey_csv import RawSurvey, read_raw_survey
from inclinometry.files.survey_file import SurveyFile
from inclinometry.files.table import TableFile
from inclinometry.files.text import Progress
from inclinometry.files.tool_code_json import load_tool_code
from inclinometry.files.tool_json import read_calibration
from inclinometry.findings import Finding, without_notes
from inclinometry.orientation import fields
from inclinometry.sensors import Tool
from inclinometry.survey.consistency import check_angles, check_place
from inclinometry.survey.flags import Check, worst
from inclinometry.survey.from_stations import ESTIMATED, survey_from_stations
from inclinometry.survey.from_tool import stations_from_tool, stations_plain
from inclinometry.survey.multistation import MultiStation, multistation
from inclinometry.survey.multistation_priors import (
    FieldReference,
    KnownAzimuth,
    priors_from_tool,
    published_priors,
    reference_of_site,
)
from inclinometry.survey.plausibility import check_run
from inclinometry.survey.quality import FieldLimits, FieldQuality, judge_fields, with_sensors
from inclinometry.survey.quality_wiring import wiring_check
from inclinometry.survey.reduce import SensorCorrection, Survey, apply_correction, correction_of
from inclinometry.survey.run import Run
from inclinometry.survey.stations import Stations
from inclinometry.tabular import check_record
from inclinometry.workflow.calibration_age import Age, at_the_run
from inclinometry.workflow.convert import format_of, read_survey_file
from inclinometry.workflow.corrections import (
    corrected,
    correction_steps,
    matching_correction,
    refuse_beyond,
    refuse_uncorrectable,
    unsettled,
)
from inclinometry.workflow.field import completed, declination_doubts, model_of

# Stations out of files: raw channels of a calibrated tool, fields in any format, or a survey's totals and angles.

_AXES = {"g": ("gx", "gy", "gz"), "b": ("bx", "by", "bz")}

REBUILT: Final = Finding(
    "survey-step", {"what": "rebuilt from the survey's totals, dip and angles", "name": "g, b"}, severity="note"
)
"""First step of the history of stations that come from a survey file without sensors."""


def plain_stations(
    path: str | Path, site: Site, form: str | None, convention: str | None
) -> tuple[Stations, SurveyFile]:
    """Stations of a file of any format without a calibration, and the file as it was read."""
    try:
        found = _survey_file(path, form, convention)
    except FileError:
        if format_of(path, form) == "csv" and _has_channels(TableFile(path), "counts"):
            raise FileError(Finding("work-raw-channels"), path=path) from None
        raise
    if found.g is None and found.b is None:
        g, b, temperature = fields_of_survey(found, site, path)
        step = REBUILT
    else:
        g, b, temperature = *(_vectors(found, name, path) for name in _AXES), _temperature(found)
        step = Finding("survey-step", {"what": "six axes as read from", "name": Path(path).name}, severity="note")
    stations = stations_plain(found.md, g, b, temperature=temperature)
    return replace(stations, history=(step,)), found


def tool_stations(
    path: str | Path, record: Calibration, site: Site, form: str | None, progress: Progress | None
) -> tuple[Stations, RawSurvey | SurveyFile]:
    """Stations of a calibrated tool from its raw channels, or from a survey made with it, and the file as read."""
    table = TableFile(path, progress) if format_of(path, form) == "csv" else None
    if table is None or not _has_channels(table):
        # stations of a survey by the signals the tool must have given there
        found = _survey_file(path, form, None)
        if found.g is not None or found.b is not None:
            raise FileError(Finding("work-fields"), path=path)
        g, b, temperature = fields_of_survey(found, site, path)
        strengths = [
            record.tool.triads[kind].field_strength if kind in record.tool.triads else None for kind in VECTORS
        ]
        known = [own or stated or 1.0 for own, stated in zip(strengths, (site.gravity, site.b), strict=True)]
        channels = {
            kind: record.tool.triads[kind].signals(field / strength, temperature)
            for kind, field, strength in zip(VECTORS, (g, b), known, strict=True)
            if kind in record.tool.triads
        }
        stations = stations_from_tool(
            found.md, channels, record.tool, temperature=temperature, g=site.gravity, b=site.b
        )
        return replace(stations, history=(REBUILT, *stations.history[1:])), found
    raw = read_raw_survey(table)
    same_units(raw.units, record.tool)
    same_tool(raw.serial, record.tool)
    stations = stations_from_tool(
        raw.md, raw.channels, record.tool, temperature=raw.temperature, g=site.gravity, b=site.b
    )
    return stations, raw


def calibrated_run(raw: RawSurvey, tool: Tool) -> Run:
    """The run of a tool with two full triads, with what its channels would be in another order."""
    triads = {kind: tool.triads[kind] for kind in VECTORS}

    def fields_of(channels: Mapping[str, Array]) -> tuple[Array, Array]:
        g, b = (
            (triad.field_strength or usual) * triad.field(channels[kind], raw.temperature)
            for (kind, triad), usual in zip(triads.items(), (STANDARD_GRAVITY, 50_000.0), strict=True)
        )
        return g, b

    channels = {kind: raw.channels[kind] for kind in VECTORS}
    known = triads["magnetometer"].field_strength is not None
    run = Run.of_fields(raw.md, *fields_of(channels))
    return replace(run, channels=channels, fields=fields_of, strength_known=known)


def check_raw(raw: RawSurvey, record: Calibration | None, site: Site) -> list[Finding]:
    """What is wrong with raw channels along a hole; without a whole calibration, by depths and values.

    Raises
    ------
    InputError
        Channels in another unit than those of the calibration.
    """
    if record is not None:
        same_units(raw.units, record.tool)
        same_tool(raw.serial, record.tool)
        if all(kind in raw.channels and kind in record.tool.triads for kind in VECTORS) and all(
            record.tool.triads[kind].full for kind in VECTORS
        ):
            run = calibrated_run(raw, record.tool)
            return add_site_check(check_run(run), run, site)
    g, b = (raw.channels.get(kind) for kind in VECTORS)
    whole = g is not None and b is not None and g.shape[1] == b.shape[1] == 3
    level = np.zeros(len(raw.md))  # directions that say nothing
    bare = Run(raw.md, level, level, g if whole else None, b if whole else None, channels=raw.channels)
    return [one for one in check_run(bare) if one.group in ("depths", "repeats", "totals")]


def _survey_file(path: str | Path, form: str | None, convention: str | None) -> SurveyFile:
    """The stations a file calls used, without those of no sensor at all, such as a tie-in."""
    name = format_of(path, form)
    if name == "wits":
        raise FileError(Finding("work-wits"), path=path)
    found = read_survey_file(path, name, {"convention": convention})
    used = np.ones(len(found), dtype=bool) if found.used is None else np.asarray(found.used)
    if not used.any():
        raise FileError(Finding("file-empty", {"what": "stations marked as used"}), path=path)
    axes = [values for values in (found.g, found.b) if values is not None]
    bare = np.isnan(np.hstack(axes)).all(axis=1) & used if axes else ~used & used
    rows = used if bare.sum() == used.sum() else used & ~bare
    if rows.all():
        return found
    kept = _rows(found, rows)
    counts = {"table-left": int((~used).sum()), "table-left-bare": int((used & ~rows).sum())}
    left = [Finding(code, {"count": n, "total": len(rows)}, severity="note") for code, n in counts.items() if n]
    return replace(kept, findings=(*kept.findings, *left))


def _rows(found: SurveyFile, rows: Mask) -> SurveyFile:
    """What stations need of the rows chosen."""

    def some(value: Array | None) -> Array | None:
        return None if value is None else value[rows]

    chosen: dict[str, Any] = {
        name: some(getattr(found, name)) for name in ("inclination", "azimuth", "toolface", "g", "b", "temperature")
    }
    measured = {name: values[rows] for name, values in found.measured.items()}
    same = {name: getattr(found, name) for name in ("azimuth_reference", "header", "findings", "digest")}
    return SurveyFile(md=found.md[rows], measured=measured, **chosen, **same)


def _has_channels(table: TableFile, unit: str | None = None) -> bool:
    """Whether a table has columns of raw channels (in a unit)."""
    found = [channel(name) for name in table.names]
    return any(one is not None and unit in (None, one.unit) for one in found)


def _vectors(found: SurveyFile, name: str, path: str | Path) -> Array:
    values: Array | None = getattr(found, name)
    if values is None:
        raise FileError(Finding("input-missing", {"names": _AXES[name]}), path=path)
    for axis, column in zip(_AXES[name], values.T, strict=True):
        _refuse_empty(axis, column, path)
    return values


def _refuse_empty(name: str, column: Array, path: str | Path) -> None:
    empty = np.isnan(column)
    if empty.any():
        raise FileError(Finding("table-empty", {"column": name}), path=path, row=int(np.argmax(empty)) + 1)


def _temperature(found: SurveyFile) -> Array | None:
    heat = found.temperature
    return None if heat is None or np.isnan(heat).any() else heat


def fields_of_survey(found: SurveyFile, site: Site, path: str | Path) -> tuple[Array, Array, Array | None]:
    """Gravity and magnetic field (n, 3) in tool axes from totals, dip and angles, and temperature.

    Six numbers, so they are the six axes in another form. Toolface may be missing: |g|, |b| and dip do not depend on
    it.
    """
    columns = {
        "inclination": found.inclination,
        "azimuth": found.azimuth,
        "g_total (m/s^2)": found.measured.get("g"),
        "b_total_nT": found.measured.get("b"),
        "dip": found.measured.get("dip"),
    }
    lacking = [name for name, values in columns.items() if values is None]
    if lacking:
        raise FileError(Finding("work-six-axes", {"names": tuple(lacking)}), path=path)
    values = {name: np.asarray(column) for name, column in columns.items()}
    for name, column in values.items():
        _refuse_empty(name, column, path)
    inclination, azimuth, g_total, b_total, dip = values.values()
    azimuth = convert_azimuth(azimuth, found.azimuth_reference or "", "magnetic", site)
    toolface = np.zeros(len(found)) if found.toolface is None else np.nan_to_num(found.toolface)
    g, b = fields(azimuth, inclination, toolface, dip)
    return g_total[:, None] * g, b_total[:, None] * b, _temperature(found)


@dataclass(frozen=True, eq=False)
class SixAxis:
    """Stations of a run, with errors of the calibration or of a tool code as their sources, and the completed site.

    dip : rad at the calibration stand, or None. inputs : name -> digest.
    freedom : component -> degrees of freedom of the calibration.
    """

    stations: Stations
    site: Site
    tool: Tool | None = None
    dip: float | None = None
    inputs: Mapping[str, str] = field(default_factory=dict)
    freedom: Mapping[str, float] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()

    @property
    def reference(self) -> FieldReference | None:
        """What the site says of gravity, field and dip; None where it lacks one of them."""
        return reference_of_site(self.site) if has_reference(self.site) else None


def has_reference(site: Site) -> bool:
    """Whether a site knows gravity, field strength and dip."""
    return all(value is not None for value in (site.gravity, site.b, site.dip))


def read_six_axis(
    raw: str | Path,
    site: str | Path | None,
    calibration: str | Path | None = None,
    age: Age = Age(),  # noqa: B008
    *,
    form: str | None = None,
    convention: str | None = None,
    ignored: Sequence[str] | None = (),
    progress: Progress | None = None,
) -> SixAxis:
    """Read the stations of a run.

    Parameters
    ----------
    raw : str or Path
        With a calibration, CSV of raw channels; without one, fields in any of the formats, their units in the names. A
        survey file without sensors, of which totals, dip and angles are known, serves too: these give the same fields.
    site : str or Path, optional
        site.toml; what it lacks is filled from models where place and date are known. Required without a calibration.
    calibration : str or Path, optional
        tool.json
    age : Age
        Of the calibration at the run.
    form : str, optional
        Format of `raw`. Default: by its ending.
    convention : str, optional
        Axes and signs of the sensors in `raw`, where there is no calibration.
    ignored : sequence of str, optional
        Codes or groups of findings that do not refuse the run; None for stations that are no run along a hole, as
        those of a tool turned at one place.
    progress : callable, optional
        Called with the number of bytes of raw channels read so far.

    Raises
    ------
    InputError, FileError
        As the readers; a run that is refused (`inclinometry.survey.plausibility.check_run`); without a calibration, no
        site or a site without gravity, b or dip; with one, the same where the tool lacks its field strengths.
    """
    if site is None and calibration is None:
        plain_stations(raw, Site(), form, convention)  # raw channels need a calibration, not a site
        raise refused("input-missing", {"names": ("--site",)})
    place, said = completed(Site() if site is None else read_site(site))
    said += declination_doubts(place)
    inputs = {} if site is None else {"site": digest_file(site)}
    if calibration is None:
        _refuse_unknown(place)
        stations, read = plain_stations(raw, place, form, convention)
        # tool code whose sensor errors stand for those of a tool without a calibration
        sensors = "iscwsa-mwd-rev5.1"
        code = load_tool_code(sensors)
        stations = with_sensors(stations, {term.name: term.sigma for term in code.terms})
        said = [*said, Finding("work-tool-code", {"code": sensors}, severity="note")]
        beside = None if REBUILT in stations.history else read
        findings = (*run_findings(stations, place, ignored, raw, beside), *said, *read.findings)
        return SixAxis(stations, place, None, None, {"raw": read.digest, **inputs}, findings=findings)
    if convention is not None:
        raise refused("input-not-with", {"name": "--convention", "other": "--calibration"})
    record, old = at_the_run(read_calibration(calibration), calibration, place, age)
    said += [*old, *of_calibration(record)]
    stations, source = tool_stations(raw, record, place, form, progress)
    channels = calibrated_run(source, record.tool) if isinstance(source, RawSurvey) else None
    findings = (*run_findings(stations, place, ignored, raw, run=channels), *said, *source.findings)
    inputs |= {f"calibration {name}": value for name, value in record.inputs.items()}
    inputs |= {"raw": source.digest, "tool": digest_file(calibration)}
    freedom = dict.fromkeys(ESTIMATED, record.degrees_of_freedom)
    return SixAxis(stations, place, record.tool, record.dip, inputs, freedom, findings)


def of_calibration(record: Calibration) -> list[Finding]:
    """What a calibration says of itself, for those who use it."""
    return [Finding("work-calibration", {"finding": one}) for one in without_notes(record.findings)]


def run_findings(
    stations: Stations,
    site: Site,
    ignored: Sequence[str] | None,
    path: str | Path,
    beside: SurveyFile | None = None,
    run: Run | None = None,
) -> tuple[Finding, ...]:
    """What is wrong with the run as a whole, and with its place; FileError where it is refused.

    `run` has the raw channels too. The angles of a file that holds six axes too (`beside`) are compared with theirs.
    """
    if ignored is None:
        return ()
    run = run or Run.of_fields(stations.md, stations.g, stations.b)
    found = check_run(run)
    if beside is not None and beside.inclination is not None:
        found += check_angles(run, beside.inclination, beside.azimuth, beside.azimuth_reference, site.declination)
    return settled(add_site_check(found, run, site), ignored, path)


def add_site_check(found: list[Finding], run: Run, site: Site) -> list[Finding]:
    """Findings of a run, and whether its fields are those of a place with a sign or both coordinates exchanged."""
    if any(one.group in ("axes", "columns", "units") for one in found):
        return found
    return [*found, *_of_place(run, site)]


def _of_place(run: Run, site: Site) -> list[Finding]:
    if site.latitude is None or site.longitude is None or site.date is None or len(run.md) < 4:
        return []
    if "given" in (site.origin("b"), site.origin("dip")):
        return []
    latitude, longitude = site.latitude, site.longitude
    places = {
        "": (latitude, longitude),
        "sign of longitude": (latitude, -longitude),
        "sign of latitude": (-latitude, longitude),
        "signs of both": (-latitude, -longitude),
    }
    if abs(longitude) <= np.pi / 2.0:
        places["latitude and longitude exchanged"] = (longitude, latitude)
    model, there = model_of(site.date), {}
    for words, (north, east) in places.items():
        field = model(north, east, site.height_m or 0.0, site.date)
        there[words] = {
            "b": float(field.b),
            "dip": float(field.dip),
        }
    return check_place({name: float(np.median(run.totals[name])) for name in ("b", "dip")}, there)


@dataclass(frozen=True, eq=False)
class JudgedStations:
    """Quality of a run: the fields against the reference, axes and signs, and the verdict on all."""

    quality: FieldQuality
    wiring: Check

    @property
    def checks(self) -> list[Check]:
        """Of the fields, then axes and signs."""
        return [*self.quality.checks, self.wiring]

    @property
    def verdict(self) -> str:
        """On the whole."""
        return worst(self.checks)


def quality(stations: Stations, site: Site, limits: FieldLimits | None = None) -> JudgedStations:
    """Judge stations against their site.

    Raises
    ------
    InputError
        The site knows no gravity, b or dip.
    """
    check_record(stations, Stations, "quality")
    _refuse_unknown(site)
    reference = reference_of_site(site)
    return JudgedStations(judge_fields(stations, reference, limits=limits), wiring_check(stations, reference.dip))


def _refuse_unknown(site: Site) -> None:
    """Refuse a site that lacks one of the three references."""
    if has_reference(site):
        return
    known = {"g": site.gravity, "b_nT": site.b, "dip_deg": site.dip}
    lacking = tuple(name for name, value in known.items() if value is None)
    raise refused("work-site-lacks", {"names": lacking, "needed": ("latitude_deg", "longitude_deg", "date")})


@dataclass(frozen=True, eq=False)
class SixAxisSurvey:
    """A survey, its completed site, the quality of its stations after and before corrections, results of these.

    judged, before : None without references; `before` also without corrections.
    """

    survey: Survey
    site: Site
    judged: JudgedStations | None = None
    before: JudgedStations | None = None
    results: Mapping[str, Any] = field(default_factory=dict)


def survey_six_axis(run: SixAxis, correct: str | None = None, bha: str | Path | None = None) -> SixAxisSurvey:
    """Correct the stations of a run (names with commas; corrections.json for "msa", bha.toml for sag); reduce them."""
    steps = correction_steps(correct)
    names = [name for name, _ in steps]
    stations, results, told = _corrected(run, steps, bha)
    digests = {f"correction {Path(file).name}": digest_file(file) for _, file in steps if file is not None}
    inputs = {**run.inputs, **digests, **({} if bha is None else {"bha": digest_file(bha)})}
    survey = survey_from_stations(stations, site=run.site, tool=run.tool, calibration_dip=run.dip, inputs=inputs)
    judged = before = None
    if run.reference is not None:
        judged = quality(stations, run.site)
        before = quality(run.stations, run.site) if names else None
        if before is not None and before.wiring.verdict == judged.wiring.verdict == "fail":
            # a correction has bent the dips: what they say of the axes they said before it
            judged = replace(judged, wiring=before.wiring)
        if before is not None and not {"axial", "msa"}.isdisjoint(names) and judged.wiring.verdict != "fail":
            told = [*unsettled(before.wiring), *told]
    if {"axial", "msa"} <= set(names):  # in this order: the other is refused
        told = [Finding("survey-axial-first"), *told]
    told = [*run.findings, *told]
    for result in results.values():
        if isinstance(result, MultiStation):
            told += result.findings
        check = getattr(result, "check", None)
        if isinstance(check, Check) and check.verdict != "pass":
            told.append(check.reason)
    told += _of_checks(judged, survey)
    survey = replace(survey, findings=(*told, *survey.findings), freedom=run.freedom)
    return SixAxisSurvey(survey, run.site, judged, before, results)


def _corrected(
    run: SixAxis, steps: Sequence[tuple[str, str | None]], bha: str | Path | None
) -> tuple[Stations, dict[str, Any], list[Finding]]:
    names = [name for name, _ in steps]
    if bha is not None and "sag" not in names:
        raise refused("input-needs", {"name": "--bha", "needed": ("--correct sag",)})
    assembly = None
    if bha is not None:
        from inclinometry.files.sag_toml import read_bha

        assembly = read_bha(bha)
    if names and REBUILT in run.stations.history:
        raise refused("work-rebuilt")
    if run.reference is not None and not {"axial", "msa"}.isdisjoint(names):
        refuse_uncorrectable(run.stations, run.reference)
    stations, told = run.stations, list[Finding]()
    results: dict[str, Any] = {}
    for name, file in steps:
        if file is not None:
            tool = "" if run.tool is None else run.tool.name
            correction, told = matching_correction(file, tool, run.inputs, run.stations)
            stations = apply_correction(stations, correction)
            continue
        stations, results[name] = corrected(stations, name, run.reference, run.tool, assembly)
        if name == "msa":
            refuse_beyond(results[name].parameters)
    return stations, results, told


def _of_checks(judged: JudgedStations | None, survey: Survey) -> list[Finding]:
    """Failures that the flags of the stations do not tell already."""
    if judged is None:
        return []
    said = [judged.wiring] if judged.wiring.verdict == "fail" else []
    if not any(survey.flags):
        said += [check for check in judged.quality.checks if check.verdict == "fail"]
    return [check.reason for check in said]


@dataclass(frozen=True, eq=False)
class Analysis:
    """A multi-station analysis, what it started from, and the correction to be kept."""

    found: MultiStation
    correction: SensorCorrection
    judged: JudgedStations

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Of the analysis, and what axes and signs were like before it."""
        return (*self.found.findings, *unsettled(self.judged.wiring))


def msa(
    run: SixAxis, priors: str = "iscwsa", axial_sigma: float | None = None, known: Sequence[KnownAzimuth] = ()
) -> Analysis:
    """Multi-station analysis of a run.

    Parameters
    ----------
    run : SixAxis
    priors : {"iscwsa", "unknown"}
        What is known of a tool without a calibration; with one its covariance is the prior.
    axial_sigma : float, optional
        Standard deviation of the axial interference, nT.
    known : sequence of KnownAzimuth
        Azimuths of stations, from the north of the site.

    Raises
    ------
    InputError, IdentifiabilityError, ConvergenceError
        As `multistation`; a site without g, b or dip; units, axes or signs that are wrong; an estimate beyond ten
        times its prior.
    """
    check_record(run, SixAxis, "msa")
    before, reference = quality(run.stations, run.site), reference_of_site(run.site)
    refuse_uncorrectable(run.stations, reference)
    if run.tool is None:
        chosen = published_priors(priors, axial_sigma=axial_sigma)
    else:
        chosen = priors_from_tool(run.tool, axial_sigma=axial_sigma)
    site = run.site
    north = float(convert_azimuth(0.0, "magnetic", site.north_reference, site)) if known else 0.0
    found = multistation(run.stations, reference, chosen, known=[one._replace(north=north) for one in known])
    refuse_beyond(found.parameters)
    tool = "" if run.tool is None else run.tool.name
    correction = correction_of(found, reference, chosen, tool, run.inputs)
    ignored = [one for one in run.findings if one.severity == "ignored"]
    correction = replace(correction, findings=(*ignored, *correction.findings))
    return Analysis(found, correction, before)
