"""The end of the demo: a simulated well with a magnetised string, surveyed by the demo's own calibrated tool."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from inclinometry.core.angles import wrap_signed
from inclinometry.core.arrays import Array
from inclinometry.io.atomic import write_text
from inclinometry.io.position_csv import write_position_csv
from inclinometry.io.raw_csv import write_raw_survey
from inclinometry.position.ellipse import horizontal_ellipse
from inclinometry.simulate.hole import SurveySimulation
from inclinometry.survey.path import minimum_curvature
from inclinometry.survey.reduce import Survey
from inclinometry.survey.stations import Stations
from inclinometry.workflow.position import WellPosition, read_position
from inclinometry.workflow.six_axis import Analysis, Judged, analyse, judge, read_six_axis, survey_six_axis
from inclinometry.workflow.survey import write_survey

AXIAL_NT: Final = 800.0
"""What the drill string adds to the field along the tool, nT."""

STEEL_NT: Final = 500.0
"""Standard deviation of that, as the analysis expects it, nT."""

PROBABILITY: Final = 0.95

DECLINATION_DEG: Final = 2.5


@dataclass(frozen=True, eq=False)
class DemoWell:
    """A well surveyed twice, as it is and with the multi-station analysis, and where it ends.

    stations : as they were read; survey, corrected : before and after.
    error_deg : name -> rms azimuth error beyond 5 deg of inclination, deg.
    judged : quality before and after; analysis : Analysis.
    position : WellPosition by the certificate and the ISCWSA model; off_m : (3,) N, E, V of its end from the truth.
    """

    stations: Stations
    survey: Survey
    corrected: Survey
    error_deg: Mapping[str, float]
    judged: tuple[Judged, Judged]
    analysis: Analysis
    position: WellPosition
    off_m: Array

    @property
    def ellipse_m(self) -> tuple[float, float]:
        """Semi-axes of the ellipse that holds the end of the well with probability 0.95, m."""
        found = self.position.uncertainty
        if found is None:
            return float("nan"), float("nan")
        ellipse = horizontal_ellipse(found.covariance[-1:], PROBABILITY)
        return float(ellipse.major[0]), float(ellipse.minor[0])


def survey_demo_well(run: SurveySimulation, tensor: Array, tool: Path, folder: Path) -> DemoWell:
    """Write the files of the well into `folder`, and go the whole way from raw channels to its ellipse.

    Parameters
    ----------
    run : SurveySimulation
        Clean of interference.
    tensor : (m, 3) ndarray
        True parametric tensor of the magnetometers, signal per stand's field.
    tool : Path
        tool.json of the tool.
    folder : Path
    """
    folder.mkdir(parents=True, exist_ok=True)
    share = AXIAL_NT / (run.b or 50_000.0)
    signals = {**run.signals, "magnetometer": run.signals["magnetometer"] + share * tensor[:, 2]}
    write_raw_survey(folder / "raw.csv", run.md, signals, run.temperature)
    _site(run, folder / "site.toml")
    six = read_six_axis(folder / "raw.csv", folder / "site.toml", tool)
    before, analysis = survey_six_axis(six), analyse(six, axial_sigma=STEEL_NT)
    after = survey_six_axis(six, _stored(analysis, folder / "corrections.json"))
    write_survey(after.survey, folder / "survey.csv")
    position = read_position(
        folder / "survey.csv",
        folder / "site.toml",
        "iscwsa-mwd-rev5.1",
        tool,
        folder / "raw.csv",
        folder / "corrections.json",
    )
    write_position_csv(folder / "position.csv", position.path, position.uncertainty, position.survey.north)
    errors = {"as it is": _rms(before.survey, run), "multi-station analysis": _rms(after.survey, run)}
    truth = minimum_curvature(run.md, run.inclination, run.azimuth + _declination(), start=(0.0, 0.0, float(run.md[0])))
    path = position.path
    off = np.array([path.north[-1] - truth.north[-1], path.east[-1] - truth.east[-1], path.tvd[-1] - truth.tvd[-1]])
    judged = judge(six.stations, six.site), judge(analysis.found.corrected, six.site)
    return DemoWell(six.stations, before.survey, after.survey, errors, judged, analysis, position, off)


def well_sentences(found: DemoWell) -> list[str]:
    """What happened to the well, for the head of its page and for the terminal."""
    before, after = (judged.verdict for judged in found.judged)
    raw, better = found.error_deg.values()
    bias = found.analysis.found.parameters["axial interference"]
    major, minor = found.ellipse_m
    north, east, down = found.off_m
    return [
        f"the string adds {AXIAL_NT:.0f} nT along the tool; quality as it is: {before}, after the analysis: {after}",
        "multi-station analysis with the calibration as prior: axial interference "
        f"{bias.value:.0f} +- {bias.u:.0f} nT; rms azimuth error {raw:.2f} deg as it is, {better:.2f} deg after",
        f"the end of the well is off the truth by {north:+.1f} m north, {east:+.1f} m east, {down:+.1f} m down; its "
        f"95 % ellipse by the tool's own certificate and the ISCWSA model is {major:.1f} m by {minor:.1f} m",
    ]


def _stored(analysis: Analysis, path: Path) -> str:
    from inclinometry.io.corrections_json import write_corrections

    write_corrections(analysis.correction, path)
    return str(path)


def _declination() -> float:
    return float(np.radians(DECLINATION_DEG))


def _site(run: SurveySimulation, path: Path) -> None:
    lines = [
        "latitude_deg = 60.0",
        'north_reference = "true"',
        f"declination_deg = {DECLINATION_DEG}",
        "sigma_declination_deg = 0.36",
        f"dip_deg = {np.degrees(run.dip):.6f}",
        "sigma_dip_deg = 0.2",
    ]
    if run.g is not None:
        lines.append(f"g = {run.g:.6f}")
    if run.b is not None:
        lines += [f"b_nT = {run.b:.3f}", "sigma_b_nT = 130.0"]
    write_text("\n".join(lines) + "\n", path)


def _rms(survey: Survey, run: SurveySimulation) -> float:
    inclined = run.inclination > np.radians(5.0)
    off = wrap_signed(survey.azimuth - run.azimuth - _declination())[inclined]
    return float(np.degrees(np.sqrt(np.mean(off**2))))
