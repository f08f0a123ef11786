"""A tool's own calibration as the error model of a well, with raw channels or without, beside a tool code or alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from inclinometry.calibration.result import Calibration, same_units
from inclinometry.errors import refused
from inclinometry.files.position_csv import WellStations
from inclinometry.files.survey_csv import RawSurvey
from inclinometry.findings import Finding, Value
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
from inclinometry.survey.from_stations import ESTIMATED
from inclinometry.survey.from_tool import stations_from_tool
from inclinometry.survey.reduce import SensorCorrection, apply_correction


def calibration_error_model(
    calibration: Calibration,
    well: WellSurvey,
    stations: WellStations,
    raw: RawSurvey | None = None,
    code: ToolCode | None = None,
    correction: SensorCorrection | None = None,
    rows: slice = slice(None),
) -> tuple[Sequence[MatrixSource], ToolCode | None, list[Finding]]:
    """Sources of error from a calibration, the tool code beside them, and findings.

    `rows` of the well are the tool's. `stations`: the file the well came from, with toolface and temperature. Without
    `raw` the channels are computed from the site's fields. With a multi-station `correction` (needs `raw`) its
    remaining uncertainty replaces the certificate and the tool code's axial interference.
    """
    beside = None
    told: list[Finding] = []
    if code is not None:
        # terms of a tool code that neither certificate, site nor an analysis knows better
        fits_certificate(code)
        names = [term.name for term in code.terms if not is_sensor_term(term.name)]
        left: list[str] = []
        declination = _declination_terms(code)
        if well.site.declination_sigma and declination:
            left += declination
            told.append(_left_out(code, declination, "uncertainty of the declination by the site"))
        axial = [name for name in names if correction is not None and name.upper().startswith("AMI")]
        if axial:
            left += axial
            told.append(_left_out(code, axial, "axial interference by the analysis"))
        beside = with_terms(code, [name for name in names if name not in left])
    if raw is None:
        if correction is not None:
            raise refused("input-needs", {"name": "--corrections", "needed": ("--raw",)})
        sources, said = _computed(calibration.tool, well, stations)
        told = [*said, *told]
    else:
        same_units(raw.units, calibration.tool)
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
        own = well.md[rows]
        outside = own[(own < raw.md[0] - 0.005) | (own > raw.md[-1] + 0.005)]  # depths are in centimetres
        if len(outside):
            span = {"first_m": float(outside[0]), "last_m": float(outside[-1])}
            told.append(Finding("work-outside-raw", {"count": len(outside), **span}))
    # of both the size hangs on variances that the calibration has estimated
    freedom = calibration.degrees_of_freedom
    sources = tuple(replace(one, degrees_of_freedom=freedom) if one.name in ESTIMATED else one for one in sources)
    known = beside is not None and bool(_declination_terms(beside))
    reference = () if known else reference_sources(well)
    if beside is None:
        lacking = ("measured depth", "misalignment", "sag", "magnetic interference")
        errors = lacking if reference else (*lacking, "declination")
        told.append(Finding("work-sensors-only", {"errors": errors}, severity="note"))
    elif not reference and not known:
        told.append(Finding("work-declination-sigma"))
    return (*sources, *reference), beside, told


def _left_out(code: ToolCode, names: list[str], known: str) -> Finding:
    """Terms of a tool code whose errors something else states."""
    return Finding("work-terms-left-out", {"code": code.name, "names": tuple(names), "known": known}, severity="note")


def _declination_terms(code: ToolCode) -> list[str]:
    # random parts are each station's own, which no statement about the place covers
    names = [term.name for term in code.terms if term.propagation != "random"]
    return [name for name in names if name.upper().startswith(("DEC", "DBH"))]


def _computed(tool: Tool, well: WellSurvey, stations: WellStations) -> tuple[tuple[MatrixSource, ...], list[Finding]]:
    """Sources from the fields that the tool must have seen."""
    said = [Finding("work-computed-fields", severity="note")]
    temperature = stations.temperature
    warm = [triad.reference_temperature for triad in tool.triads.values() if triad.degree]
    if temperature is None or not np.isfinite(temperature).all():
        temperature = np.full(len(stations), warm[0]) if warm else None
        if warm:
            assumed: dict[str, Value] = {"name": "temperature", "value": float(warm[0]), "unit": "degC"}
            assumed |= {"why": "the calibration's reference", "needed": ("temperature_degC",)}
            said.append(Finding("work-assumed", assumed, severity="note"))
    known = np.full(len(well), np.nan) if stations.toolface is None else stations.toolface
    if not np.isnan(known).any():
        return error_model(tool, well, known, temperature=temperature), said
    largest, chosen = -1.0, 0.0
    found: tuple[MatrixSource, ...] = ()
    for angle in np.radians(np.arange(0.0, 360.0, 15.0)):
        sources = error_model(tool, well, np.where(np.isnan(known), angle, known), temperature=temperature)
        major = float(horizontal_ellipse(propagate(well, sources=sources).covariance[-1]).major)
        # the same size to rounding is no reason to change
        if major > largest * (1.0 + 1e-9):
            largest, chosen, found = major, float(angle), sources
    assumed = {"name": "toolface", "value": float(np.degrees(chosen)), "unit": "deg"}
    assumed |= {"why": "gives the largest ellipse", "needed": ("toolface_deg", "--raw")}
    said.append(Finding("work-assumed", assumed, severity="note"))
    return found, said
