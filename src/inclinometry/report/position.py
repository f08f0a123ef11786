"""The report of a well's position."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from inclinometry.core.angles import wrap_positive
from inclinometry.core.arrays import Array
from inclinometry.earth.site import Site, convert_azimuth
from inclinometry.position.ellipse import ellipsoid, hole_sigmas, horizontal_ellipse
from inclinometry.position.propagation import PositionUncertainty
from inclinometry.position.tool_code import ToolCode
from inclinometry.position.well import WellSurvey
from inclinometry.report import position_figures as draw
from inclinometry.report.content import CONVENTIONS, Picture, Table, TableRow, cut, picture
from inclinometry.report.digits import plain, rounded, significant
from inclinometry.report.page import render
from inclinometry.report.position_figures import PROBABILITY
from inclinometry.report.survey_figures import thinned
from inclinometry.survey.path import Path, dogleg_severity_deg
from inclinometry.uncertainty.coverage import coverage_factor, ellipsoid_factor

# Tables and sentences of a well's position.

_SHARED = {
    "random": "nothing: each station its own",
    "systematic": "the stations of the run",
    "well": "the runs of the well",
    "global": "all wells",
}

_CERTIFIED = {
    "calibration": "What the certificate of {} leaves unknown of its sensors, with all correlations",
    "sensor noise": "Noise of one reading of {}",
    "declination": "The site's declination",
}


class Contribution(NamedTuple):
    """A source at one station: sigma (3,) north, east, down, m; m along the ellipse's major axis; share of variance."""

    name: str
    propagation: str
    sigma: Array
    major: float
    share: float


def contributions(found: PositionUncertainty, row: int = -1) -> list[Contribution]:
    """What each source gives to the horizontal ellipse of a station, largest first.

    The share is that of its variance along the ellipse's major axis; shares add up to 1 but for an uncertain tie-on.
    """
    covariance = found.covariance[row]
    direction = float(horizontal_ellipse(covariance).direction)
    along = np.array([np.cos(direction), np.sin(direction), 0.0])
    total = float(along @ covariance @ along)
    parts = []
    for name, one in found.sources.items():
        own = one.covariance[row]
        variance = max(float(along @ own @ along), 0.0)
        sigma = np.sqrt(np.maximum(np.diagonal(own), 0.0))
        parts.append(Contribution(name, one.propagation, sigma, variance**0.5, variance / total if total else 0.0))
    return sorted(parts, key=lambda part: -part.major)


def bottom_table(path: Path, survey: WellSurvey, uncertainty: PositionUncertainty | None) -> Table:
    """The last station in numbers."""
    head = ["quantity", "value", "σ", "95 %", "unit"]
    north, east = float(path.north[-1] - path.north[0]), float(path.east[-1] - path.east[0])
    places = [("north", path.north[-1]), ("east", path.east[-1]), ("true vertical depth", path.tvd[-1])]
    reach = np.hypot(north, east)
    extra = [
        TableRow(["horizontal distance from the first station", f"{reach:.2f}", "", "", "m"]),
        TableRow(["its azimuth", f"{np.degrees(wrap_positive(np.arctan2(east, north))):.2f}", "", "", "deg"]),
    ]
    caption = f"Last station, {path.md[-1]:.2f} m; positions and azimuths from {survey.north} north"
    if uncertainty is None:
        rows = [TableRow([name, f"{value:.2f}", "", "", "m"]) for name, value in places]
        return Table(caption, head, rows + extra)
    covariance = uncertainty.covariance[-1]
    two, three, one = (ellipsoid_factor(PROBABILITY, 2), ellipsoid_factor(PROBABILITY, 3), 1.96)
    sigma = np.sqrt(np.diagonal(covariance))
    rows = [
        TableRow([name, f"{value:.2f}", significant(float(u), 3), significant(one * float(u), 3), "m"])
        for (name, value), u in zip(places, sigma, strict=True)
    ]
    flat, solid = horizontal_ellipse(covariance), ellipsoid(covariance)
    hole = hole_sigmas(covariance, path.inclination[-1], path.azimuth[-1])
    lengths = [("horizontal ellipse, semi-major", flat.major, two), ("horizontal ellipse, semi-minor", flat.minor, two)]
    lengths += [(f"ellipsoid, semi-axis {n + 1}", axis, three) for n, axis in enumerate(solid.semi_axes)]
    lengths += [(name, u, one) for name, u in zip(("high side", "lateral", "along hole"), hole, strict=True)]
    bars = [TableRow([n, "", significant(float(u), 3), significant(k * float(u), 3), "m"]) for n, u, k in lengths]
    turn = TableRow(["azimuth of the ellipse's major axis", f"{np.degrees(flat.direction):.1f}", "", "", "deg"])
    note = (
        f"95 %: {one} σ for one coordinate, {two:.3f} σ for an ellipse, {three:.3f} σ for an ellipsoid, of a normal "
        "distribution."
    )
    return Table(caption, head, [*rows, *extra, *bars, turn], note)


def source_table(
    uncertainty: PositionUncertainty | None, code: ToolCode | None, calibration: str | None
) -> Table | None:
    if uncertainty is None:
        return None
    terms = () if code is None else code.terms
    words = {} if calibration is None else {name: text.format(calibration) for name, text in _CERTIFIED.items()}
    words |= {one.name: f"{one.description} ({one.magnitude:g} {one.unit})" for one in terms}
    rows = [
        TableRow(
            [
                part.name,
                words.get(part.name, ""),
                f"{part.propagation}: {_SHARED[part.propagation]}",
                significant(part.major, 3),
                f"{100.0 * part.share:.1f}",
                *(significant(float(s), 3) for s in part.sigma),
            ]
        )
        for part in contributions(uncertainty)
    ]
    sigmas = [f"σ {axis}, m" for axis in ("north", "east", "vertical")]
    head = ["source", "what it is", "shared by", "σ major axis, m", "share, %", *sigmas]
    caption = "Every source at the last station; share: of the variance along the ellipse's major axis"
    return Table(caption, head, rows, text_columns=3)


def chain_table(survey: WellSurvey, reference: str) -> Table:
    """How the azimuth of one station came from the survey's north to the result's, step by step."""
    row = int(np.argmax(np.sin(survey.inclination) + 1e-9 * np.arange(len(survey))))
    site, true = survey.site, survey.azimuth[row]
    steps = [("magnetic", site.declination), ("true", None), ("grid", site.convergence)]
    rows = []
    for name, correction in steps:
        if correction is None and name != "true":
            rows.append(TableRow([name, "not known", "", _role(name, reference, survey.north)]))
            continue
        value = float(np.degrees(convert_azimuth(true, "true", name, site)))
        rows.append(TableRow([name, f"{value:.3f}", _step(name, site), _role(name, reference, survey.north)]))
    caption = f"Azimuth of the station at {survey.md[row]:.2f} m from each north"
    note = (
        "true = magnetic + declination (positive where magnetic north is east of true north); grid = true − "
        "convergence (positive where grid north is east of true north). No check of the survey shows a wrong sign: "
        "compare the drawing with a map."
    )
    return Table(caption, ["north", "azimuth, deg", "from it to true north", "use"], rows, note)


def _step(name: str, site: Site) -> str:
    quantity = {"magnetic": "declination", "grid": "convergence"}.get(name)
    if quantity is None:
        return ""
    value, sigma = getattr(site, quantity), getattr(site, f"{quantity}_sigma")
    spread = f" ± {np.degrees(sigma):.2f}" if sigma else ""
    return f"{quantity} {np.degrees(value):+.3f}{spread}° added ({site.origin(quantity)})"


def _role(name: str, reference: str, north: str) -> str:
    roles = ["survey" * (name == reference), "results" * (name == north)]
    return ", ".join(role for role in roles if role)


def missing(uncertainty: PositionUncertainty | None, code: ToolCode | None, calibration: str | None) -> list[str]:
    """What the numbers do not contain."""
    if uncertainty is None:
        return ["Uncertainty of any kind: no tool code and no calibration was given."]
    lines = ["Gross errors: a wrong depth, a swapped sensor, a station of another well. They have no ellipse."]
    if calibration is not None and code is None:
        lines.append(
            f"Everything outside the certificate of {calibration}: measured depth, misalignment in the hole, sag, "
            "magnetic interference of the string, references where they are not in the table of sources."
        )
    elif code is not None:
        beside = "" if calibration is None else f"in the certificate of {calibration} or "
        lines.append(
            f"Anything that is not {beside}a term of {code.name}: a tool, a hole or a correction that model was not "
            "made for."
        )
    if not _tied(uncertainty):
        lines.append("Uncertainty of the first station's position: it was taken as exact.")
    lines.append("Errors so large that the well's shape itself changes: the propagation is linear.")
    return lines


def _tied(uncertainty: PositionUncertainty) -> bool:
    """Whether the position of the first station has an uncertainty of its own."""
    return bool(uncertainty.survey.tie.any())


def station_table(path: Path, uncertainty: PositionUncertainty | None) -> Table:
    severity = dogleg_severity_deg(path)
    head = ["md, m", "inclination", "azimuth", "tvd, m", "north, m", "east, m", "dls, deg/30 m"]
    columns = [np.degrees(path.inclination), np.degrees(path.azimuth), path.tvd, path.north, path.east, severity]
    texts = [[f"{x:.2f}" for x in (values + 0.0).tolist()] for values in (path.md, *columns)]
    if uncertainty is not None:
        ellipse = horizontal_ellipse(uncertainty.covariance, PROBABILITY)
        vertical = np.sqrt(np.maximum(uncertainty.covariance[:, 2, 2], 0.0))
        head += ["semi-major 95 %, m", "semi-minor 95 %, m", "its azimuth", "σ vertical, m"]
        texts += [[f"{x:.2f}" for x in values.tolist()] for values in (ellipse.major, ellipse.minor)]
        texts += [[f"{x:.0f}" for x in np.degrees(ellipse.direction).tolist()], [f"{x:.2f}" for x in vertical.tolist()]]
    body = [TableRow(list(cells)) for cells in zip(*texts, strict=True)]
    return Table("Stations; angles in deg", head, body)


def fact_pairs(
    path: Path,
    survey: WellSurvey,
    reference: str,
    code: ToolCode | None,
    calibration: str | None,
    inputs: Mapping[str, str],
) -> list[tuple[str, str]]:
    start = f"north {plain(path.north[0])} m, east {plain(path.east[0])} m, true vertical depth {plain(path.tvd[0])} m"
    facts = [
        ("Stations", f"{len(path)}, from {plain(path.md[0])} to {plain(path.md[-1])} m"),
        ("First station at", start),
        ("Azimuths of the survey from", f"{reference} north"),
        ("Positions from", f"{survey.north} north"),
    ]
    if code is not None:
        facts += [("Tool code", code.name), ("Revision", code.revision or "not stated"), ("Source", code.source)]
        facts.append(("What it is", code.description or "not stated"))
    if calibration is not None:
        facts.append(("Error model of the sensors", f"the calibration of {calibration}"))
    return facts + _place(survey.site) + [(f"Digest of {name}", digest) for name, digest in inputs.items()]


def _place(site: Site) -> list[tuple[str, str]]:
    """Values of the site that the error model used, with where they come from."""
    shown = {
        "gravity": ("g", "{:.5f} m/s²", 1.0),
        "b": ("b", "{:.0f} nT", 1.0),
        "dip": ("dip", "{:.3f}°", np.degrees(1.0)),
        "latitude": ("latitude", "{:.4f}°", np.degrees(1.0)),
    }
    found = []
    for name, (label, form, unit) in shown.items():
        value = getattr(site, name)
        if value is not None:
            origin = ("given" if site.g is not None else "normal gravity") if name == "gravity" else site.origin(name)
            found.append((f"Site: {label}", f"{form.format(value * unit)} ({origin})"))
    return found


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
