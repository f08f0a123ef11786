"""From a file of raw channels to survey stations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.arrays import Mask
from inclinometry.calibration.result import Calibration, same_tool, same_units
from inclinometry.constants import VECTORS
from inclinometry.digest import digest_file
from inclinometry.earth.site import Site
from inclinometry.errors import refused, settled
from inclinometry.files.site_toml import read_site
from inclinometry.files.survey_csv import RawSurvey, read_raw_survey, survey_cells
from inclinometry.files.text import Progress
from inclinometry.files.tool_json import read_calibration
from inclinometry.files.writing import write_columns
from inclinometry.findings import Finding, Value, ignored_lines
from inclinometry.orientation import SWITCH
from inclinometry.survey.from_stations import ESTIMATED
from inclinometry.survey.from_tool import stations_from_tool
from inclinometry.survey.plausibility import check_run
from inclinometry.survey.reduce import Survey, parts_of, reduce_survey
from inclinometry.survey.run import Run
from inclinometry.tabular import check_record
from inclinometry.workflow.calibration_age import Age, at_the_run
from inclinometry.workflow.field import completed, declination_doubts
from inclinometry.workflow.six_axis import (
    JudgedStations,
    SixAxisSurvey,
    calibrated_run,
    has_reference,
    of_calibration,
    quality,
    read_six_axis,
    survey_six_axis,
)


def survey_raw(
    raw: RawSurvey,
    calibration: Calibration,
    site: Site | None = None,
    *,
    second: str | None = None,
    hole: str = "down",
    gravity_sd: float | None = None,
) -> Survey:
    """Reduce raw stations with a calibrated tool.

    Parameters
    ----------
    raw : RawSurvey
        From `read_raw_survey`.
    calibration : Calibration
    site : Site, optional
        North reference and reference fields.
    second : {"magnetometer", "gyro"}, optional
        The triad that gives the azimuth; the magnetometer where there is one, else the gyro.
    hole : {"down", "up"}
        For two accelerometers, as `reduce_survey`.
    gravity_sd : float, optional
        As `reduce_survey`.
    """
    check_record(raw, RawSurvey, "survey_raw")
    check_record(calibration, Calibration, "survey_raw")
    same_units(raw.units, calibration.tool)
    same_tool(raw.serial, calibration.tool)
    found = reduce_survey(
        raw.md,
        raw.channels,
        calibration.tool,
        temperature=raw.temperature,
        site=site,
        calibration_dip=calibration.dip,
        inputs={"raw": raw.digest, **{f"calibration {name}": digest for name, digest in calibration.inputs.items()}},
        second=second,
        hole=hole,
        gravity_sd=gravity_sd,
    )
    freedom = dict.fromkeys(ESTIMATED, calibration.degrees_of_freedom)
    told = (*raw.findings, *of_calibration(calibration))
    return replace(found, findings=(*told, *found.findings), freedom=freedom)


def survey_file(
    raw: str | Path,
    site: str | Path | None = None,
    calibration: str | Path | None = None,
    *,
    correct: str | None = None,
    bha: str | Path | None = None,
    second: str | None = None,
    hole: str = "down",
    gravity_sd: float | None = None,
    age: Age = Age(),  # noqa: B008
    form: str | None = None,
    convention: str | None = None,
    charts: bool = False,
    ignored: Sequence[str] = (),
    progress: Progress | None = None,
) -> SixAxisSurvey:
    """A survey from files, with what a report needs; arguments as `read_six_axis`, `survey_six_axis`, `survey_raw`.

    With a calibration the site is optional. Corrections are of the magnetometer's survey only. `charts`: judge the
    fields even where the survey does not need it.
    """
    if calibration is None or correct is not None or bha is not None:
        given = {
            "--azimuth-from": second is not None,
            "--hole": hole != "down",
            "--gravity-sd-percent": gravity_sd is not None,
        }
        for name in (one for one, known in given.items() if known):
            if calibration is None:
                raise refused("input-needs", {"name": name, "needed": ("--calibration",)})
            raise refused("input-not-with", {"name": name, "other": "--correct, --bha"})
        run = read_six_axis(
            raw, site, calibration, age, form=form, convention=convention, ignored=ignored, progress=progress
        )
        done = survey_six_axis(run, correct, bha)
        return replace(done, survey=_judged_whole(done.survey, calibrated=False))
    if convention is not None or form not in (None, "csv"):
        raise refused("input-not-with", {"name": "--from, --convention", "other": "--calibration"})
    place, said = (None, list[Finding]()) if site is None else completed(read_site(site))
    data = read_raw_survey(raw, progress=progress)
    record, old = at_the_run(read_calibration(calibration), calibration, place or Site(), age)
    said += old
    found = survey_raw(data, record, place, second=second, hole=hole, gravity_sd=gravity_sd)
    said += [] if place is None or found.azimuth_reference == "magnetic" else declination_doubts(place)
    inputs = {**found.inputs, "tool": digest_file(calibration)}
    findings = settled(check_run(_run(data, found, record, second)), ignored, raw)
    found = _judged_whole(replace(found, inputs=inputs, findings=(*findings, *said, *found.findings)))
    judged = _judged(data, record, place) if charts and second != "gyro" and place is not None else None
    return SixAxisSurvey(found, place or Site(), judged)


def _run(raw: RawSurvey, found: Survey, record: Calibration, second: str | None) -> Run:
    """The run with its six axes where the azimuths are of these."""
    triads = {kind: record.tool.triads[kind] for kind in VECTORS if kind in record.tool.triads and kind in raw.channels}
    if second == "gyro" or len(triads) < 2 or not all(triad.full for triad in triads.values()):
        return Run(found.md, found.inclination, found.azimuth)
    return calibrated_run(raw, record.tool)


def _judged_whole(found: Survey, *, calibrated: bool = True) -> Survey:
    """The survey without the angles of channels that failed; what is wrong with the run as a whole comes first.

    An uncorrected magnetic field is ordinary where fields are read without a calibration.
    """
    found = _without_frozen(found)
    if any(one.severity == "ignored" for one in found.findings):
        return replace(found, flags=[[*row, "overruled"] for row in found.flags])
    return _most_off(found, tuple(_OFF) if calibrated else ("g",))


def _without_frozen(found: Survey) -> Survey:
    """The survey without the angles that rest on a channel of one value, and their uncertainties."""
    failed = [one for one in found.findings if one.code == "sensor-frozen" and one.severity != "ignored"]
    names = ("inclination", "azimuth", "toolface", "magnetic_toolface")
    gone: Mask = np.zeros((len(found), len(names)), dtype=np.bool_)
    for one in failed:
        gone[np.ix_(one.rows, range(4) if one.values["sensor"] == VECTORS[0] else (1, 3))] = True
    if not failed:
        return found
    kept: dict[str, Any] = {name: np.where(gone[:, k], np.nan, getattr(found, name)) for k, name in enumerate(names)}
    parts = {name: np.where(gone, np.nan, part) for name, part in found.components.items()}
    rows = set(np.flatnonzero(gone.any(axis=1)).tolist())
    flags = [[*flags, "channel"] if row in rows else flags for row, flags in enumerate(found.flags)]
    said = tuple(one for one in found.findings if one.code != "survey-flagged" or not rows.issuperset(one.rows))
    return replace(found, **kept, components=parts, flags=flags, findings=said)


def _most_off(found: Survey, judged: Sequence[str]) -> Survey:
    """The survey with one finding, the first, where most stations are out of tolerance."""
    off = [one for one in found.findings if one.code == "survey-flagged" and one.values["flag"] in judged]
    off = [one for one in off if 2 * len(one.rows) > len(found) >= 4]
    if not off or any(one.code == "sensor-steps" for one in found.findings):
        return found
    causes = tuple(dict.fromkeys(_OFF[str(one.values["flag"])][1] for one in off))
    rows = tuple(sorted({row for one in off for row in one.rows}))
    values: dict[str, Value] = {"count": len(rows), "total": len(found), "causes": causes}
    values["quantities"] = tuple(_OFF[str(one.values["flag"])][0] for one in off)
    rest = [one for one in found.findings if one not in off]
    return replace(found, findings=(Finding("survey-most-off", values, rows), *rest))


_OTHER_SITE: Final = "the site is another one, or the field is disturbed"
_OFF: Final = {
    "g": ("gravity", "the calibration is of another tool, or no longer right"),
    "b": ("magnetic field", _OTHER_SITE),
    "dip": ("dip", _OTHER_SITE),
}
"""Flag -> quantity out of tolerance, and why it is so at most stations."""


def _judged(raw: RawSurvey, record: Calibration, site: Site) -> JudgedStations | None:
    """Quality of the stations where site and calibration know the strengths of both fields."""
    triads = [record.tool.triads.get(kind) for kind in VECTORS]
    strong = all(triad is not None and triad.full and triad.field_strength for triad in triads)
    if not (strong and has_reference(site) and all(kind in raw.channels for kind in VECTORS)):
        return None
    return quality(stations_from_tool(raw.md, raw.channels, record.tool, temperature=raw.temperature), site)


def write_survey(survey: Survey, path: str | Path, *, switch: float = SWITCH) -> None:
    """Write the survey CSV with `toolface_type` (which toolface steers) and the findings that --ignore accepted.

    Parameters
    ----------
    survey : Survey
    path : str or Path
    switch : float
        rad, inclination below which `toolface_type` says magnetic, from there on gravity.
    """
    check_record(survey, Survey, "write_survey")
    names = ("md", "inclination", "azimuth", "toolface", "magnetic_toolface", "g_total", "b_total", "dip")
    columns = {name: getattr(survey, name) for name in names}
    columns |= {name: getattr(survey, name) for name in ("u_inclination", "u_azimuth", "u_toolface")}
    flags = ["|".join(row) for row in survey.flags]
    cells = survey_cells({**columns, "azimuth_reference": survey.azimuth_reference, "flags": flags})
    steer = np.where(survey.inclination < switch, "magnetic", "gravity").tolist()
    parts = parts_of(survey.common, survey.random) if survey.common.size else {}
    write_columns({**cells, "toolface_type": steer, **parts}, path, ignored_lines(survey.findings))
