"""The report of a calibration."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from inclinometry.calibration.expected import ExpectedUncertainty, expected_uncertainty
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.calibration.rollset import SecondHarmonics, second_harmonics
from inclinometry.report import calibration_figures as draw
from inclinometry.report import calibration_tables as tables
from inclinometry.report import words
from inclinometry.report.content import CONVENTIONS, Picture, cut, picture
from inclinometry.report.page import render

VERDICT_AT = np.radians(30.0)
"""Inclination the verdict speaks of, rad."""
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
    stated = None if readings is None else readings.reference.get("dip")
    found = expected_uncertainty(calibration, _GRID, dip, stated_dip=stated)
    short = expected_uncertainty(calibration, dip=dip, stated_dip=stated)
    at_once = expected_uncertainty(calibration, VERDICT_AT, dip, stated_dip=stated)
    place, where = found.dip, _place(found)
    tests = words.calibration_tests(calibration)
    failed = sum(test.passed is False for test in tests)
    troubles = len(calibration.warnings)
    rig_table = tables.rig_table(calibration, readings)
    second = None if readings is None else second_harmonics(readings)
    return render(
        "calibration.html",
        title=f"Calibration of {name or 'a tool'}",
        kind="Calibration report",
        heading=name or "Tool without a name",
        conventions=CONVENTIONS,
        state="warn" if failed else "good",
        badge=f"{troubles} warning{'s' * (troubles > 1)}"
        if troubles
        else f"{failed} of {len(tests)} tests failed"
        if failed
        else "No warnings, every test passed",
        verdict=words.verdict(calibration, at_once),
        notes=[line for line in (where, words.covers(calibration)) if line],
        warnings=list(calibration.warnings),
        expected=tables.expected_tables(short),
        expected_figures=_expected_figures(found),
        budget=None if readings is None else tables.budget_table(calibration, readings, short),
        facts=words.run_facts(calibration, readings),
        rig=words.rig_sentences(calibration),
        rig_figures=_rig_figures(calibration),
        rig_table=rig_table and cut(rig_table),
        tests=tables.test_table(tests),
        residuals=words.residual_sentences(calibration),
        residual_figures=_residual_figures(calibration),
        residual_tables=[(k, cut(t)) for k, t in tables.residual_tables(calibration, readings).items()],
        rolls=second and cut(tables.roll_table(second, readings.units if readings else {})),
        roll_sentences=_rolls(second) if second else [],
        triads=[tables.triad_block(tool, kind) for kind in tool.triads],
        identifiability=words.identifiability_sentences(calibration),
        correlations=tables.correlation_table(calibration),
        comparison=tables.comparison_table(calibration, closed_forms or {}, place, at_once),
    )


def _rolls(second: SecondHarmonics) -> list[str]:
    """What the second harmonics of the roll sets mean."""
    if second.sentences:
        return [sentence[0].upper() + sentence[1:] + "." for sentence in second.sentences]
    uneven, u = np.degrees(abs(second.unevenness)), np.degrees(second.u_unevenness)
    return [
        "No second harmonic is larger than chance may make it: neither is a sensor seen to be non-linear nor the roll "
        f"dial to turn unevenly ({uneven:.3f} ± {u:.3f} deg once a turn)."
    ]


def _place(found: ExpectedUncertainty) -> str:
    """The place the expected uncertainty is for, and where its dip or latitude is from."""
    if found.azimuth_from is None:
        return ""
    name, value = ("dip", found.dip) if found.azimuth_from == "magnetometer" else ("latitude", -found.dip)
    source = {
        "given": "given",
        "calibration": "that of the calibration stand",
        "stated": "stated with the readings",
        "assumed": f"assumed, since none is known: give the {name} of the place of work",
    }[found.dip_from]
    warning = f" At a place with another {name} the azimuth is better or worse." * (found.dip_from == "calibration")
    return f"For a {name} of {np.degrees(value):.1f}° ({source}).{warning}"


def _expected_figures(found: ExpectedUncertainty) -> list[Picture]:
    pictures = []
    for name in found.angles:
        caption = f"Expected standard uncertainty of {name} of one reading over inclination, and its parts"
        pictures.append(picture(draw.expected_figure(found, name), f"line{name}", caption))
    if found.azimuth_from is not None:
        for name in found.angles:
            caption = f"Expected standard uncertainty of {name} of one reading over attitude, worst toolface"
            pictures.append(picture(draw.expected_map(found, name), f"map{name}", caption))
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
