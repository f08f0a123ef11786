"""A tool's own calibration as the error model of a well, with raw channels or without, beside a tool code or alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.result import Calibration, same_units
from inclinometry.errors import InputError
from inclinometry.files.position_csv import WellStations
from inclinometry.files.survey_csv import RawSurvey
from inclinometry.position.certificate import (
    calibration_sources,
    error_model,
    fits_certificate,
    is_sensor_term,
    reference_sources,
    with_terms,
)
from inclinometry.position.propagation import MatrixSource, propagate
from inclinometry.position.tool_code import ToolCode
from inclinometry.position.well import WellSurvey, horizontal_ellipse
from inclinometry.sensors import Tool
from inclinometry.survey.from_tool import stations_from_tool
from inclinometry.survey.reduce import SensorCorrection, apply_correction

TRIED = np.radians(np.arange(0.0, 360.0, 15.0))
"""Toolfaces of which the worst is taken where the survey states none."""


class CertificateModel(NamedTuple):
    """Sources of error from a calibration, the tool code beside them, and in words what was taken for granted."""

    sources: Sequence[MatrixSource]
    code: ToolCode | None
    notes: list[str]
    warnings: list[str]


def certificate_model(
    calibration: Calibration,
    well: WellSurvey,
    stations: WellStations,
    raw: RawSurvey | None = None,
    code: ToolCode | None = None,
    correction: SensorCorrection | None = None,
) -> CertificateModel:
    """The error model that a calibration is.

    Parameters
    ----------
    calibration : Calibration
    well : WellSurvey
    stations : WellStations
        The file the well came from: toolface and temperature where it has them.
    raw : RawSurvey, optional
        Raw channels of these stations; else they are computed from the site's fields and the attitudes.
    code : ToolCode, optional
        What its terms say of other things than the sensors stands beside the certificate.
    correction : SensorCorrection, optional
        The multi-station analysis the survey was corrected with: what it leaves open takes the place of the certificate
        and of the tool code's axial interference. The raw channels are needed.

    Raises
    ------
    InputError
        As `inclinometry.position.certificate`.
    """
    beside, told = (None, []) if code is None else _beside(code, well, correction is not None)
    notes: list[str] = []
    warnings = []
    if raw is None:
        if correction is not None:
            raise InputError("--corrections needs --raw, the raw channels of the run it was made from")
        sources, notes = _computed(calibration.tool, well, stations)
    else:
        same_units(raw.units, calibration)
        seen = stations_from_tool(
            raw.md,
            raw.channels,
            calibration.tool,
            temperature=raw.temperature,
            g=well.site.gravity,
            b=well.site.b,
        )
        seen = seen if correction is None else apply_correction(seen, correction)
        sources = calibration_sources(seen, well)
        warnings += _uncovered(well, raw)
    notes = [*notes, *told]
    reference = () if _knows_declination(beside) else reference_sources(well)
    warnings += [] if beside is not None else [_alone(bool(reference))]
    if beside is not None and not reference and not _knows_declination(beside):
        warnings.append("no uncertainty of the declination is in the ellipses: give the site's sigma_declination_deg")
    return CertificateModel((*sources, *reference), beside, notes, warnings)


def _beside(code: ToolCode, well: WellSurvey, analysed: bool) -> tuple[ToolCode, list[str]]:
    """Terms of a tool code that neither certificate, site nor an analysis knows better; and what is left out."""
    fits_certificate(code)
    names = [term.name for term in code.terms if not is_sensor_term(term.name)]
    left: list[str] = []
    told = []
    # random parts are each station's own, which no statement about the place covers
    declination = [
        term.name for term in code.terms if term.name.upper().startswith(_DECLINATION) and term.propagation != "random"
    ]
    if well.site.declination_sigma and declination:
        left += declination
        told.append(f"the site states the declination's uncertainty: {', '.join(declination)} of {code.name} left out")
    axial = [name for name in names if analysed and name.upper().startswith(_AXIAL)]
    if axial:
        left += axial
        told.append(f"the axial interference was estimated by the analysis: {', '.join(axial)} of {code.name} left out")
    return with_terms(code, [name for name in names if name not in left]), told


_DECLINATION = ("DEC", "DBH")
_AXIAL = ("AMI",)


def _knows_declination(code: ToolCode | None) -> bool:
    return code is not None and any(
        term.name.upper().startswith(_DECLINATION) and term.propagation != "random" for term in code.terms
    )


def _uncovered(well: WellSurvey, raw: RawSurvey) -> list[str]:
    """A sentence for stations above and below those of which there are raw channels."""
    outside = well.md[(well.md < raw.md[0] - 0.005) | (well.md > raw.md[-1] + 0.005)]  # depths are in centimetres
    if not len(outside):
        return []
    span = f"{outside[0]:g} m" if len(outside) == 1 else f"{outside[0]:g} to {outside[-1]:g} m"
    count = "1 station at" if len(outside) == 1 else f"{len(outside)} stations from"
    return [f"{count} {span} without raw channels: the errors of their sensors are not in the ellipses"]


def _alone(declination: bool) -> str:
    lacking = "measured depth, misalignment, sag and magnetic interference"
    lacking += "" if declination else ", declination (the site states no sigma)"
    return (
        f"the certificate tells of the sensors alone: errors of {lacking} are not in the ellipses; a tool code beside "
        "the calibration adds them"
    )


def _computed(tool: Tool, well: WellSurvey, stations: WellStations) -> tuple[tuple[MatrixSource, ...], list[str]]:
    """Sources from the fields that the tool must have seen."""
    said = ["no raw channels were given: what the tool saw is computed from the site's fields and the attitudes"]
    temperature = _temperature(tool, stations, said)
    known = np.full(len(well), np.nan) if stations.toolface is None else stations.toolface
    if not np.isnan(known).any():
        return error_model(tool, well, known, temperature=temperature), said
    largest, chosen = -1.0, 0.0
    found: tuple[MatrixSource, ...] = ()
    for angle in TRIED:
        sources = error_model(tool, well, np.where(np.isnan(known), angle, known), temperature=temperature)
        major = float(horizontal_ellipse(propagate(well, sources=sources).covariance[-1]).major)
        # the same size to rounding is no reason to change
        if major > largest * (1.0 + 1e-9):
            largest, chosen, found = major, float(angle), sources
    said.append(
        "the survey does not state every toolface: of those that stay the same throughout, the one with the largest "
        f"ellipse was taken ({np.degrees(chosen):.0f} deg); give toolface_deg or the raw channels for the real one"
    )
    return found, said


def _temperature(tool: Tool, stations: WellStations, said: list[str]) -> Array | None:
    """Temperature of each station; what is assumed where the tool needs one and the file has none is said."""
    if stations.temperature is not None and np.isfinite(stations.temperature).all():
        return stations.temperature
    warm = [triad for triad in tool.triads.values() if triad.degree]
    if not warm:
        return None
    at = warm[0].reference_temperature
    said.append(f"the survey states no temperature: the calibration's reference, {at:g} degC, was taken throughout")
    return np.full(len(stations), at)
