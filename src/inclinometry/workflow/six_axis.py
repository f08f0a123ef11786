"""From a six-axis file to stations, their quality, their corrections and the survey."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.core.angles import wrap_signed
from inclinometry.core.digest import digest_file
from inclinometry.core.errors import InclinometryError, InputError
from inclinometry.earth.magnetic import complete_site
from inclinometry.earth.site import Site
from inclinometry.io._lines import Progress
from inclinometry.io.site_toml import read_site
from inclinometry.io.tool_code_json import load_tool_code
from inclinometry.io.tool_json import read_calibration
from inclinometry.sensors.tool import Tool
from inclinometry.survey.checks import Check, worst
from inclinometry.survey.from_stations import survey_from_stations
from inclinometry.survey.multistation import MultiStation, multistation
from inclinometry.survey.multistation_priors import (
    FieldReference,
    priors_from_tool,
    published_priors,
    reference_of_site,
)
from inclinometry.survey.quality import FieldLimits, FieldQuality, judge_fields
from inclinometry.survey.quality_sensors import with_sensors
from inclinometry.survey.quality_wiring import wiring_check
from inclinometry.survey.reduce import Survey
from inclinometry.survey.sensor_correction import SensorCorrection, apply_correction, correction_of
from inclinometry.survey.stations import Stations
from inclinometry.workflow.analysis_checks import (
    matching_correction,
    refuse_beyond,
    refuse_uncorrectable,
    unsettled,
)
from inclinometry.workflow.corrections import Means, apply_corrections, correction_names
from inclinometry.workflow.field import completed, model_of
from inclinometry.workflow.six_axis_file import REBUILT, plain_stations, tool_stations

SENSORS: Final = "iscwsa-mwd-rev5.1"
"""Tool code whose sensor errors stand for those of a tool without a calibration."""

_SIGN: Final = np.radians(1.0)  # declinations nearer to zero than this have no wrong sign worth a word


@dataclass(frozen=True, eq=False)
class SixAxis:
    """Stations of a run and what is known beside them.

    stations : Stations, with the calibration or a tool code's sensor errors as their sources.
    site : Site, completed; tool : Tool, or None without a calibration; dip : rad at the calibration stand, or None.
    notes : what was taken for granted; warnings : what may be wrong.
    inputs : name -> digest.
    """

    stations: Stations
    site: Site
    tool: Tool | None = None
    dip: float | None = None
    notes: Sequence[str] = ()
    warnings: Sequence[str] = ()
    inputs: Mapping[str, str] = field(default_factory=dict)

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
    *,
    form: str | None = None,
    convention: str | None = None,
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
    form : str, optional
        Format of `raw`; by its ending when not given.
    convention : str, optional
        Axes and signs of the sensors in `raw`, where there is no calibration.
    progress : callable, optional
        Called with the number of bytes of raw channels read so far.

    Raises
    ------
    InputError, FileError
        As the readers; without a calibration, no site or a site without gravity, b or dip; with one, the same where
        the tool lacks its field strengths.
    """
    if site is None and calibration is None:
        raise InputError(
            "without a calibration nothing but the site can tell whether the readings are right; give --site site.toml "
            "with g, b_nT, dip_deg, or latitude_deg, longitude_deg and date"
        )
    place, said = completed(Site() if site is None else read_site(site))
    inputs = {} if site is None else {"site": digest_file(site)}
    doubts = declination_doubts(place)
    if calibration is None:
        _refuse_unknown(place)
        stations, digest, notes = plain_stations(raw, place, form, convention)
        code = load_tool_code(SENSORS)
        stations = with_sensors(stations, {term.name: term.sigma for term in code.terms})
        said = [*said, f"no calibration: the sensors' errors are taken from the tool code {SENSORS}"]
        return SixAxis(stations, place, None, None, (*said, *notes), doubts, {"raw": digest, **inputs})
    if convention is not None:
        raise InputError("--convention is of no use with --calibration, which knows the axes; leave it out")
    record = read_calibration(calibration)
    stations, digest, notes = tool_stations(raw, record, place, form, progress)
    inputs |= {f"calibration {name}": value for name, value in record.inputs.items()}
    inputs |= {"raw": digest, "tool": digest_file(calibration)}
    inherited = [f"calibration: {sentence}" for sentence in record.warnings]
    return SixAxis(stations, place, record.tool, record.dip, (*said, *notes), (*inherited, *doubts), inputs)


def declination_doubts(site: Site) -> list[str]:
    """A warning where the declination stated has the sign opposite to the model's of the same place and date.

    Examples
    --------
    >>> import datetime
    >>> place = {"latitude": 0.9, "longitude": -1.4, "height_m": 0.0, "date": datetime.date(2026, 5, 1)}
    >>> said = declination_doubts(Site(declination=np.radians(13.0), **place))
    >>> "wrong sign" in said[0], declination_doubts(Site(declination=np.radians(-13.0), **place))
    (True, [])
    """
    place = (site.latitude, site.longitude, site.date)
    if site.declination is None or site.date is None or None in place or site.origin("declination") != "given":
        return []
    bare = replace(site, declination=None, declination_sigma=None)
    try:
        model = complete_site(bare, model_of(site.date))
    except InclinometryError:
        return []  # a date no model covers
    expected, given = float(model.declination or 0.0), site.declination
    as_it_is, turned = abs(wrap_signed(given - expected)), abs(wrap_signed(-given - expected))
    if min(abs(expected), abs(given)) < _SIGN or turned >= as_it_is / 3.0:
        return []
    return [
        f"the declination is {np.degrees(given):+.2f} deg, {model.origin('declination')} has "
        f"{np.degrees(expected):+.2f} at this place: a wrong sign? East is positive; azimuths would be off by "
        f"{np.degrees(as_it_is):.1f} deg and no check of gravity, field or dip shows it"
    ]


@dataclass(frozen=True, eq=False)
class Judged:
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


def judge(stations: Stations, site: Site, limits: FieldLimits | None = None) -> Judged:
    """Judge stations against their site.

    Raises
    ------
    InputError
        The site knows no gravity, b or dip.
    """
    _refuse_unknown(site)
    reference = reference_of_site(site)
    return Judged(judge_fields(stations, reference, limits=limits), wiring_check(stations, reference.dip))


def _refuse_unknown(site: Site) -> None:
    """Refuse a site that lacks one of the three references."""
    if has_reference(site):
        return
    known = {"g": site.gravity, "b_nT": site.b, "dip_deg": site.dip}
    lacking = ", ".join(name for name, value in known.items() if value is None)
    raise InputError(
        f"the site has no {lacking}; stations are judged against them: give them, or latitude_deg, longitude_deg "
        "and date, from which models fill them"
    )


@dataclass(frozen=True, eq=False)
class SixAxisSurvey:
    """A survey, its completed site, the quality of its stations after and before corrections, results of these.

    judged, before : None without references; `before` also without corrections.
    """

    survey: Survey
    site: Site
    judged: Judged | None = None
    before: Judged | None = None
    results: Mapping[str, Any] = field(default_factory=dict)
    notes: Sequence[str] = ()


def survey_six_axis(run: SixAxis, correct: str | None = None, bha: str | Path | None = None) -> SixAxisSurvey:
    """Correct the stations of a run and reduce them.

    Parameters
    ----------
    run : SixAxis
    correct : str, optional
        Names of corrections with commas, in their order; a corrections.json may stand for "msa".
    bha : str or Path, optional
        bha.toml, for sag.

    Raises
    ------
    InputError, FileError, IdentifiabilityError
        As the corrections; an assembly without the correction that needs it; a correction of a survey without
        sensors; units, axes or signs that are wrong before axial or msa; an estimate beyond ten times its prior.
    """
    stations, results, doubts = _corrected(run, correct, bha)
    digests = {f"correction {Path(name).name}": digest_file(name) for name in _files(correct)}
    inputs = {**run.inputs, **digests, **({} if bha is None else {"bha": digest_file(bha)})}
    survey = survey_from_stations(stations, site=run.site, tool=run.tool, calibration_dip=run.dip, inputs=inputs)
    judged = before = None
    if run.reference is not None:
        judged = judge(stations, run.site)
        before = judge(run.stations, run.site) if correct else None
        if before is not None and before.wiring.verdict == judged.wiring.verdict == "fail":
            # a correction has bent the dips: what they say of the axes they said before it
            judged = replace(judged, wiring=before.wiring)
        if before is not None and not {"axial", "msa"}.isdisjoint(_names(correct)) and judged.wiring.verdict != "fail":
            doubts = [*unsettled(before.wiring), *doubts]
    told = [*run.warnings, *_of_order(correct), *doubts, *_of_results(results), *_of_checks(judged, survey)]
    survey = replace(survey, warnings=(*told, *survey.warnings))
    return SixAxisSurvey(survey, run.site, judged, before, results, run.notes)


def _corrected(run: SixAxis, correct: str | None, bha: str | Path | None) -> tuple[Stations, dict[str, Any], list[str]]:
    parts = _parts(correct)
    names = _names(correct)
    if bha is not None and "sag" not in names:
        raise InputError("--bha is given without the correction that needs it; add sag to --correct")
    assembly = None
    if bha is not None:
        from inclinometry.io.bha_toml import read_bha

        assembly = read_bha(bha)
    if names and REBUILT in run.stations.history:
        raise InputError(
            "--correct needs the sensors' readings: these fields are rebuilt from a survey, which does not say what "
            "has been corrected already; give the raw channels or six axes it was made from"
        )
    if run.reference is not None and not {"axial", "msa"}.isdisjoint(names):
        refuse_uncorrectable(run.stations, run.reference)
    means = Means(reference=run.reference, calibration=run.tool, bha=assembly)
    stations, doubts = run.stations, list[str]()
    results: dict[str, Any] = {}
    for part, name in zip(parts, names, strict=True):
        if _is_file(part):
            tool = "" if run.tool is None else run.tool.name
            correction, doubts = matching_correction(part, tool, run.inputs, run.stations)
            stations = apply_correction(stations, correction)
            continue
        done = apply_corrections(stations, (name,), means)
        stations, results = done.stations, {**results, **done.results}
        if name == "msa":
            refuse_beyond(done.results[name].parameters)
    return stations, results, doubts


def _names(correct: str | None) -> tuple[str, ...]:
    """The corrections; a file does what "msa" does, so the rules on the order hold for it."""
    return correction_names(",".join("msa" if _is_file(one) else one for one in _parts(correct))) if correct else ()


def _parts(correct: str | None) -> list[str]:
    return [part.strip() for part in (correct or "").split(",") if part.strip()]


def _is_file(part: str) -> bool:
    return part.lower().endswith(".json")


def _files(correct: str | None) -> list[str]:
    return [part for part in _parts(correct) if _is_file(part)]


def _of_order(correct: str | None) -> list[str]:
    """A warning where the axial field that an analysis could estimate was made from the reference before it."""
    parts = _parts((correct or "").lower())
    if "axial" not in parts or not any(part == "msa" or _is_file(part) for part in parts):
        return []
    return [
        "axial before msa: the axial field is then made from the reference, so that the analysis cannot find its error "
        "and leans on the reference twice; on simulated runs azimuths come out up to four times worse than by msa alone"
    ]


def _of_results(results: Mapping[str, Any]) -> list[str]:
    """What corrections have to say against themselves."""
    said = []
    for name, result in results.items():
        if isinstance(result, MultiStation):
            said += [f"multi-station analysis: {sentence}" for sentence in result.warnings]
        check = getattr(result, "check", None)
        if isinstance(check, Check) and check.verdict != "pass":
            said.append(f"{name}: {check.reason}; {check.action}")
    return said


def _of_checks(judged: Judged | None, survey: Survey) -> list[str]:
    """Failures that the flags of the stations do not tell already."""
    if judged is None:
        return []
    said = [judged.wiring] if judged.wiring.verdict == "fail" else []
    if not any(survey.flags):
        said += [check for check in judged.quality.checks if check.verdict == "fail"]
    return [f"{check.name}: {check.reason}; {check.action}" for check in said]


@dataclass(frozen=True, eq=False)
class Analysis:
    """A multi-station analysis, what it started from, and the correction to be kept."""

    found: MultiStation
    correction: SensorCorrection
    judged: Judged

    @property
    def warnings(self) -> list[str]:
        """Of the analysis, and what axes and signs were like before it."""
        return [*self.found.warnings, *unsettled(self.judged.wiring)]


def analyse(run: SixAxis, priors: str = "iscwsa", axial_sigma: float | None = None) -> Analysis:
    """Multi-station analysis of a run.

    Parameters
    ----------
    run : SixAxis
    priors : {"iscwsa", "unknown"}
        What is known of a tool without a calibration; with one its covariance is the prior.
    axial_sigma : float, optional
        Standard deviation of the axial interference, nT.

    Raises
    ------
    InputError, IdentifiabilityError, ConvergenceError
        As `multistation`; a site without g, b or dip; units, axes or signs that are wrong; an estimate beyond ten
        times its prior.
    """
    before, reference = judge(run.stations, run.site), reference_of_site(run.site)
    refuse_uncorrectable(run.stations, reference)
    if run.tool is None:
        chosen = published_priors(priors, axial_sigma=axial_sigma)
    else:
        chosen = priors_from_tool(run.tool, axial_sigma=axial_sigma)
    found = multistation(run.stations, reference, chosen)
    refuse_beyond(found.parameters)
    tool = "" if run.tool is None else run.tool.name
    correction = correction_of(found, reference, chosen, tool, run.inputs)
    return Analysis(found, correction, before)
