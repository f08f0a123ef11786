"""A tool's own calibration as the error model of a well, with raw channels or without, beside a tool code or alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from inclinometry.calibration.acceptance import Limits, Verification
from inclinometry.calibration.result import Calibration, same_units
from inclinometry.core.arrays import Array
from inclinometry.core.digest import digest_bytes, digest_file
from inclinometry.core.errors import InputError
from inclinometry.io.laboratory_toml import Order, read_laboratory
from inclinometry.io.position_csv import WellStations
from inclinometry.io.survey_csv import RawSurvey
from inclinometry.io.tool_json import read_calibration
from inclinometry.io.verification_json import read_verification, write_verification
from inclinometry.position.certificate import (
    calibration_sources,
    error_model,
    fits_certificate,
    is_sensor_term,
    reference_sources,
    with_terms,
)
from inclinometry.position.ellipse import horizontal_ellipse
from inclinometry.position.propagation import propagate
from inclinometry.position.sources import MatrixSource
from inclinometry.position.tool_code import ToolCode
from inclinometry.position.well import WellSurvey
from inclinometry.report.certificate_record import certificate_record
from inclinometry.sensors.tool import Tool
from inclinometry.survey.from_tool import stations_from_tool
from inclinometry.survey.sensor_correction import SensorCorrection, apply_correction
from inclinometry.workflow.laboratory.results import program
from inclinometry.workflow.laboratory.verification import report, stated_limits

# A certificate from the files that calibrate and verify write, without a ledger.

UNNAMED = ("", "unnamed")


def save_verification(found: Verification, limits: Limits | None, calibration: Calibration, path: str | Path) -> None:
    """Write what a verification found, for a certificate."""
    write_verification(
        path,
        calibration,
        verdict=found.verdict,
        limits=stated_limits(found, limits),
        report=report(found),
        inputs=found.inputs,
        program=program(),
    )


def record_from_files(
    tool: Path,
    *,
    verification: Path | None = None,
    laboratory: Path | None = None,
    previous: Path | None = None,
    number: str | None = None,
    language: str = "en",
    today: date | None = None,
) -> dict[str, Any]:
    """The record of a certificate; the digest of every file is in it.

    Parameters
    ----------
    tool : Path
        tool.json
    verification : Path, optional
        verify.json of that calibration.
    laboratory : Path, optional
        lab.toml
    previous : Path, optional
        tool.json of the calibration before.
    number : str, optional
        Unique to this certificate; year and eight digits of the inputs' digest when not given.
    today : date, optional
        Date of issue where lab.toml has none; the clock's when not given.

    Raises
    ------
    InputError
        Files that do not belong together, in one sentence.
    """
    calibration = read_calibration(tool)
    if calibration.method == "datasheet":
        raise InputError(
            f"{tool} was entered from a data sheet, nothing was measured: calibrate the tool to certify it"
        )
    who, order = (None, Order()) if laboratory is None else read_laboratory(laboratory)
    order = _completed(order, calibration, today)
    judged = None if verification is None else read_verification(verification, calibration)
    before = None if previous is None else read_calibration(previous)
    if before is not None and before.tool.name != calibration.tool.name:
        raise InputError(f"the previous calibration is of {before.tool.name!r:.60}, this one of {order.serial!r:.60}")
    given = {"tool.json": tool, "verify.json": verification, "lab.toml": laboratory, "previous tool.json": previous}
    inputs = {name: digest_file(path) for name, path in given.items() if path is not None}
    if judged is not None:
        inputs |= {f"verification {n}": d for n, d in judged["inputs"].items() if not n.startswith("calibration ")}
    return certificate_record(
        calibration,
        who,
        order,
        number=_number(number, order, inputs),
        program=program(),
        language=language,
        verification=judged,
        previous=before,
        previous_from=_named(before, previous),
        inputs=inputs,
    )


def _completed(order: Order, calibration: Calibration, today: date | None) -> Order:
    name = calibration.tool.name
    if order.serial and name not in UNNAMED and order.serial != name:
        raise InputError(f"the order is for {order.serial!r:.60}, the calibration of {name!r:.60}")
    issued = order.issued or today or datetime.now(UTC).date()
    return replace(order, serial=order.serial or ("" if name in UNNAMED else name), issued=issued)


def _named(before: Calibration | None, path: Path | None) -> str:
    return "" if before is None or path is None else f"{path.name} ({before.method})"


def _number(given: str | None, order: Order, inputs: dict[str, str]) -> str:
    if given is None:
        year = "" if order.issued is None else f"{order.issued.year}-"
        return year + digest_bytes(repr(sorted(inputs.items())).encode()).removeprefix("sha256:")[:8]
    if not (1 <= len(given) <= 60 and given.isprintable() and given == given.strip()):
        raise InputError(f"--number is {given!r:.80}; 1 to 60 printable characters are needed")
    return given


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
