"""From a file of raw channels to survey stations."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from inclinometry.calibration.result import Calibration, same_units
from inclinometry.core.digest import digest_file
from inclinometry.earth.site import Site
from inclinometry.io.survey_csv import RawSurvey, write_survey_csv
from inclinometry.io.tool_json import read_calibration
from inclinometry.survey.reduce import Survey, reduce_survey


def survey_raw(
    raw: RawSurvey, calibration: Calibration, site: Site | None = None, *, second: str | None = None
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
    """
    same_units(raw.units, calibration)
    found = reduce_survey(
        raw.md,
        raw.channels,
        calibration.tool,
        temperature=raw.temperature,
        site=site,
        calibration_dip=calibration.dip,
        inputs={"raw": raw.digest, **{f"calibration {name}": digest for name, digest in calibration.inputs.items()}},
        second=second,
    )
    inherited = [f"calibration: {sentence}" for sentence in calibration.warnings]
    return replace(found, warnings=(*raw.notes, *inherited, *found.warnings))


def survey_with(raw: RawSurvey, tool: str | Path, site: Site | None = None, *, second: str | None = None) -> Survey:
    """`survey_raw` with a tool.json, whose own digest is recorded too."""
    found = survey_raw(raw, read_calibration(tool), site, second=second)
    return replace(found, inputs={**found.inputs, "tool": digest_file(tool)})


def write_survey(survey: Survey, path: str | Path) -> None:
    """Write the survey CSV."""
    names = ("md", "inclination", "azimuth", "toolface", "magnetic_toolface", "g_total", "b_total", "dip")
    columns = {name: getattr(survey, name) for name in names}
    columns |= {name: getattr(survey, name) for name in ("u_inclination", "u_azimuth", "u_toolface")}
    flags = ["|".join(row) for row in survey.flags]
    write_survey_csv(path, {**columns, "azimuth_reference": survey.azimuth_reference, "flags": flags})
