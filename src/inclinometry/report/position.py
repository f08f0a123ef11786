"""The report of a well's position."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from inclinometry.position.ellipse import hole_sigmas, horizontal_ellipse
from inclinometry.position.propagation import PositionUncertainty
from inclinometry.position.tool_code import ToolCode
from inclinometry.position.well import WellSurvey
from inclinometry.report import position_figures as draw
from inclinometry.report.content import CONVENTIONS, Picture, cut, picture
from inclinometry.report.digits import rounded, significant
from inclinometry.report.page import render
from inclinometry.report.position_tables import (
    bottom_table,
    chain_table,
    contributions,
    fact_pairs,
    missing,
    source_table,
    station_table,
)
from inclinometry.report.survey_figures import thinned
from inclinometry.survey.path import Path, dogleg_severity_deg
from inclinometry.uncertainty.coverage import coverage_factor, ellipsoid_factor

MOST_SOURCES = 14
"""Bars in the drawing of sources; the table holds all."""
MOST_ELLIPSOIDS = 20
"""Stations with an ellipsoid in the picture that turns."""


def position_report(
    path: Path,
    survey: WellSurvey,
    uncertainty: PositionUncertainty | None,
    *,
    azimuth_reference: str,
    tool_code: ToolCode | None = None,
    calibration: str | None = None,
    notes: Sequence[str] = (),
    warnings: Sequence[str] = (),
    inputs: Mapping[str, str] | None = None,
) -> str:
    """A well's path and its uncertainty as one self-contained HTML page; its picture in space turns without a network.

    Parameters
    ----------
    path : inclinometry.survey.path.Path
        Counted from `survey.north`.
    survey : WellSurvey
    uncertainty : PositionUncertainty, optional
    azimuth_reference : {"magnetic", "true", "grid"}
        The north that the survey's azimuths came from.
    tool_code : ToolCode, optional
        The error model, for its name and the words of its terms.
    calibration : str, optional
        Name of the calibrated tool whose certificate is the error model, of the sensors where there is a tool code too.
    notes, warnings : sequences of sentences
    inputs : mapping of name to digest, optional

    Returns
    -------
    str
        HTML without any reference outside itself. The same input gives the same text.

    Examples
    --------
    >>> from inclinometry.earth.site import Site
    >>> from inclinometry.position.well import well_survey
    >>> from inclinometry.survey.path import minimum_curvature
    >>> stations = ([0.0, 30.0], [0.0, 0.1], [0.0, 0.0])
    >>> well = well_survey(*stations, Site())
    >>> "30.00 m" in position_report(minimum_curvature(*stations), well, None, azimuth_reference="true")
    True
    """
    magnify = draw.magnification(path, None if uncertainty is None else uncertainty.covariance)
    return render(
        "position.html",
        title="Position of the well",
        kind="Position report",
        heading="Position of the well",
        conventions=CONVENTIONS,
        state="" if uncertainty is None else "warn" if warnings else "good",
        badge=_badge(path, uncertainty, warnings),
        verdict=_verdict(path, survey, uncertainty),
        notes=list(notes),
        warnings=list(warnings),
        bottom=bottom_table(path, survey, uncertainty),
        plans=_plans(path, survey, uncertainty, magnify),
        still=_still(path, uncertainty, magnify),
        data=_data(path, uncertainty, magnify, survey.north),
        magnify=f"{magnify:g}",
        sources=_sources_picture(uncertainty),
        source_table=source_table(uncertainty, tool_code, calibration),
        courses=_courses(path, uncertainty),
        chain=chain_table(survey, azimuth_reference),
        compass=_compass(survey),
        missing=missing(uncertainty, tool_code, calibration),
        stations=cut(station_table(path, uncertainty)),
        facts=fact_pairs(path, survey, azimuth_reference, tool_code, calibration, inputs or {}),
    )


def _badge(path: Path, uncertainty: PositionUncertainty | None, warnings: Sequence[str]) -> str:
    if warnings:
        return "Read the warnings"
    return f"{len(path)} stations" + ("" if uncertainty is not None else ", uncertainty not known")


def _verdict(path: Path, survey: WellSurvey, uncertainty: PositionUncertainty | None) -> str:
    """One sentence: where the last station is, and how sure that is."""
    if uncertainty is None:
        where = f"north {path.north[-1]:.2f} m, east {path.east[-1]:.2f} m, true vertical depth {path.tvd[-1]:.2f} m"
        return (
            f"At {path.md[-1]:.2f} m the well is at {where} ({survey.north} north); how sure that is is not known: no "
            "error model was given."
        )
    covariance = uncertainty.covariance[-1]
    ellipse = horizontal_ellipse(covariance, draw.PROBABILITY)
    sigma = np.sqrt(np.diagonal(covariance))
    north, east, down = (
        rounded(float(x[-1]), float(u)) for x, u in zip((path.north, path.east, path.tvd), sigma, strict=True)
    )
    vertical = float(coverage_factor(draw.PROBABILITY)) * float(sigma[2])
    return (
        f"At {path.md[-1]:.2f} m the well is at north {north} m, east {east} m, true vertical depth {down} m "
        f"({survey.north} north); with 95 % probability within a horizontal ellipse of "
        f"{significant(float(ellipse.major))} m by {significant(float(ellipse.minor))} m (semi-axes, the major one at "
        f"azimuth {np.degrees(float(ellipse.direction)):.0f}°), and within ±{significant(vertical)} m vertically."
    )


def _plans(path: Path, survey: WellSurvey, uncertainty: PositionUncertainty | None, magnify: float) -> list[Picture]:
    covariance = None if uncertainty is None else uncertainty.covariance
    direction = draw.section_azimuth(path)
    what = "" if covariance is None else f"; 95 % ellipses{_drawn_at(magnify)}"
    return [
        picture(draw.plan_figure(path, covariance, survey.north, magnify), "plan", f"Plan{what}"),
        picture(draw.section_figure(path, covariance, direction, magnify), "section", f"Vertical section{what}"),
    ]


def _drawn_at(magnify: float) -> str:
    return "" if magnify == 1.0 else f", drawn {magnify:g} times as large"


def _still(path: Path, uncertainty: PositionUncertainty | None, magnify: float) -> Picture:
    covariance = None if uncertainty is None else uncertainty.covariance
    what = "" if covariance is None else f" with the shadows of 95 % ellipsoids{_drawn_at(magnify)}"
    turn, lift = np.degrees(draw.first_view(path))
    view = f"seen from azimuth {turn:.0f}°, {lift:.0f}° from above"
    return picture(draw.space_figure(path, covariance, magnify), "space", f"The well{what}, {view}")


def _data(path: Path, uncertainty: PositionUncertainty | None, magnify: float, north: str) -> dict[str, Any]:
    """What the picture that turns is drawn from, rounded to centimetres."""
    columns = np.column_stack([path.md, path.north, path.east, path.tvd])
    rows = thinned(len(path))
    bodies: list[list[float]] = []
    if uncertainty is not None:
        for row in draw.ellipse_rows(uncertainty.covariance, MOST_ELLIPSOIDS):
            c = uncertainty.covariance[row]
            upper = [float(f"{c[i, j]:.6g}") for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
            bodies.append([*columns[row].round(2).tolist(), *upper])
    return {
        "stations": columns[rows].round(2).tolist(),
        "bodies": bodies,
        "factor": round(ellipsoid_factor(draw.PROBABILITY, 3), 6),
        "magnify": magnify,
        "view": [round(angle, 6) for angle in draw.first_view(path)],
        "north": north,
    }


def _sources_picture(uncertainty: PositionUncertainty | None) -> list[Picture]:
    if uncertainty is None:
        return []
    parts = contributions(uncertainty)[:MOST_SOURCES]
    figure = draw.source_figure([p.name for p in parts], [p.major for p in parts], [p.propagation for p in parts])
    more = len(uncertainty.sources) - len(parts)
    return [picture(figure, "sources", f"The {len(parts)} largest sources" if more else "All sources")]


def _courses(path: Path, uncertainty: PositionUncertainty | None) -> list[Picture]:
    severity = dogleg_severity_deg(path)
    found = []
    if uncertainty is not None:
        sigmas = hole_sigmas(uncertainty.covariance, path.inclination, path.azimuth)
        major = horizontal_ellipse(uncertainty.covariance).major
        found.append(picture(draw.sigma_figure(path.md, sigmas, major), "sigma", "One standard deviation of position"))
    return [*found, picture(draw.severity_figure(path.md, severity), "severity", "Dogleg severity of each interval")]


def _compass(survey: WellSurvey) -> list[Picture]:
    known = {"magnetic": survey.site.declination, "true": 0.0, "grid": survey.site.convergence}
    norths = [(name, angle) for name, angle in known.items() if angle is not None]
    row = int(np.argmax(np.sin(survey.inclination) + 1e-9 * np.arange(len(survey))))
    times = draw.spread_of_norths([angle for _, angle in norths])
    caption = "Norths seen from above" + ("" if times == 1.0 else f"; angles between them drawn {times:g} times")
    return [picture(draw.north_figure(norths, float(survey.azimuth[row]), times), "norths", caption)]
