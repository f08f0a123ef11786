"""The report of a calibration."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.report import calibration_figures as draw
from inclinometry.report import calibration_tables as tables
from inclinometry.report import words
from inclinometry.report.content import CONVENTIONS, Picture, cut, picture
from inclinometry.report.expected import ASSUMED_DIP, Expected, expected, field_dip, second_kind
from inclinometry.report.page import render

VERDICT_AT = 30.0
"""Inclination the verdict speaks of, deg."""
_GRID = np.radians(np.arange(3.0, 178.0, 3.0))


def calibration_report(
    calibration: Calibration,
    *,
    closed_forms: Mapping[str, Calibration] | None = None,
    dip: float | None = None,
    readings: BenchReadings | None = None,
) -> str:
    """A calibration as one self-contained HTML page, verdict first.

    Parameters
    ----------
    calibration : Calibration
        Of any method and any set of triads; sections adapt.
    closed_forms : mapping of name to Calibration, optional
        Other methods applied to the same readings, for comparison.
    dip : float, optional
        Of the magnetic field where the tool will work, rad (minus the latitude for a gyro tool). That of the
        calibration stand when not given.
    readings : BenchReadings, optional
        What was calibrated from; adds the settings to the tables and what was stated at the stand.

    Returns
    -------
    str
        HTML without any reference outside itself. The same input gives the same text.

    Examples
    --------
    >>> from inclinometry.attitude.rotations import dcm
    >>> from inclinometry.calibration import plans
    >>> from inclinometry.calibration.joint import calibrate_joint
    >>> p = plans.twelve()
    >>> signals = 1000.0 * dcm(p.azimuth, p.inclination, p.toolface) @ [0.0, 0.0, 1.0] + 7.0
    >>> readings = BenchReadings({"accelerometer": signals}, p.azimuth, p.inclination, p.toolface)
    >>> page = calibration_report(calibrate_joint(readings, noise_sd={"accelerometer": 0.1}, rig_sd=0.0, name="A7"))
    >>> page.startswith("<!doctype html>"), "One reading of A7 gives inclination within" in page
    (True, True)
    """
    tool, name = calibration.tool, calibration.tool.name
    place, where = _dip(calibration, dip, readings)
    found = expected(tool, _GRID, place, azimuths=24, toolfaces=8)
    at_once = expected(tool, np.radians([VERDICT_AT]), place)
    troubles = len(calibration.warnings)
    promise, rig_table = tables.promise_table(tool, place), tables.rig_table(calibration, readings)
    return render(
        "calibration.html",
        title=f"Calibration of {name or 'a tool'}",
        kind="Calibration report",
        heading=name or "Tool without a name",
        conventions=CONVENTIONS,
        state="warn" if troubles else "good",
        badge=f"{troubles} warning{'s' * (troubles > 1)}" if troubles else "No warnings",
        verdict=words.verdict(calibration, at_once, VERDICT_AT),
        notes=[line for line in (where, words.covers(calibration)) if line],
        warnings=list(calibration.warnings),
        promise=promise,
        promise_figures=_promise_figures(found),
        facts=words.run_facts(calibration, readings),
        rig=words.rig_sentences(calibration),
        rig_figures=_rig_figures(calibration),
        rig_table=rig_table and cut(rig_table),
        residuals=words.residual_sentences(calibration),
        residual_figures=_residual_figures(calibration),
        residual_tables=[(k, cut(t)) for k, t in tables.residual_tables(calibration, readings).items()],
        triads=[tables.triad_block(tool, kind) for kind in tool.triads],
        identifiability=words.identifiability_sentences(calibration),
        correlations=tables.correlation_table(calibration),
        comparison=tables.comparison_table(calibration, closed_forms or {}, place, VERDICT_AT),
    )


def _dip(calibration: Calibration, dip: float | None, readings: BenchReadings | None) -> tuple[float, str]:
    """Dip the promise is made for, and the sentence that says where it is from."""
    kind = second_kind(calibration.tool)
    if kind is None:
        return 0.0, ""
    if dip is not None:
        return dip, _place(kind, dip, "given")
    stand = field_dip(calibration.field_directions, kind)
    if stand is not None:
        return stand, _place(kind, stand, "that of the calibration stand")
    if readings is not None and kind == "magnetometer" and "dip" in readings.reference:
        return readings.reference["dip"], _place(kind, readings.reference["dip"], "stated with the readings")
    # a latitude of the same size, north, for a gyro
    value = ASSUMED_DIP if kind == "magnetometer" else -ASSUMED_DIP
    return value, _place(kind, value, "assumed, since none is known: give the dip of the place of work")


def _place(kind: str, dip: float, source: str) -> str:
    name, value = ("dip", dip) if kind == "magnetometer" else ("latitude", -dip)
    warning = f" At a place with another {name} the azimuth is better or worse." if source.startswith("that") else ""
    return f"For a {name} of {np.degrees(value):.1f}° ({source}).{warning}"


def _promise_figures(found: Expected | None) -> list[Picture]:
    if found is None or not found.capability.variance.any():
        return []
    pictures = []
    for name in found.angles:
        caption = f"Expected standard uncertainty of {name} over inclination"
        pictures.append(picture(draw.promise_figure(found, name), f"line{name}", caption))
    if found.second is not None:
        for name in found.angles:
            caption = f"Expected standard uncertainty of {name} over attitude, worst toolface"
            pictures.append(picture(draw.promise_map(found, name), f"map{name}", caption))
    return pictures


def _rig_figures(calibration: Calibration) -> list[Picture]:
    if calibration.rig.errors is None:
        return []
    dashed = "bars: standard uncertainty; dashed: twice the standard deviation of a setting"
    return [
        picture(draw.rig_figure(calibration, dial), f"rig{name}", f"Error of the {name} setting; {dashed}")
        for dial, name in enumerate(words.DIALS)
    ]


def _residual_figures(calibration: Calibration) -> list[Picture]:
    captions = {kind: f"Standardised residuals of the {kind}" for kind in calibration.residuals.standardised}
    return [picture(draw.residual_figure(calibration, kind), f"res{kind}", text) for kind, text in captions.items()]
