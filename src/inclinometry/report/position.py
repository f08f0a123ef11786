"""The report of a well's position."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import shorten
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array, Index
from inclinometry.earth.site import convert_azimuth
from inclinometry.findings import Finding
from inclinometry.language import label, number, said
from inclinometry.position.propagation import PositionUncertainty
from inclinometry.position.tool_code import ToolCode
from inclinometry.position.well import WellSurvey, ellipsoid, hole_sigmas, horizontal_ellipse
from inclinometry.report.figure import DASHES, INK, SERIES, legend_above, new_figure, panel, styled
from inclinometry.report.page import CONVENTIONS, Picture, Table, TableRow, limit_rows, picture, render
from inclinometry.report.survey_figures import thinned
from inclinometry.report.words import plain, rounded, significant
from inclinometry.rotations import wrap_positive
from inclinometry.survey.path import Path, dogleg_severity_deg
from inclinometry.uncertainty import ellipsoid_factor

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PROBABILITY: Final = 0.95
"""That an ellipse or ellipsoid of the report holds the true position."""
_TURN: Final = np.linspace(0.0, 2.0 * np.pi, 73)


def section_azimuth(path: Path) -> float:
    """Azimuth of the section, rad: from the first station to the one farthest from it."""
    north, east = path.north - path.north[0], path.east - path.east[0]
    far = int(np.argmax(np.hypot(north, east)))
    return float(wrap_positive(np.arctan2(east[far], north[far])))


def first_view(path: Path) -> tuple[float, float]:
    """Azimuth that the view in space looks from, and how far from above, rad."""
    return float(wrap_positive(section_azimuth(path) + np.radians(110.0))), float(np.radians(25.0))


def section_axes(direction: float) -> Array:
    """Axes (2, 3) of a vertical section: along an azimuth to the right, down as it is."""
    return np.array([[np.cos(direction), np.sin(direction), 0.0], [0.0, 0.0, 1.0]])


def view_axes(azimuth: float, elevation: float) -> Array:
    """Axes (2, 3) of a view in space, right and up, looking from an azimuth and from above."""
    c, s = np.cos(azimuth), np.sin(azimuth)
    up = np.array([-np.sin(elevation) * c, -np.sin(elevation) * s, -np.cos(elevation)])
    return np.stack([np.array([s, -c, 0.0]), up])


def ellipse_points(covariance: Array, axes: Array, factor: float) -> Array:
    """Outline (m, 2) of the ellipsoid's shadow on a plane: the ellipse of P C P^T."""
    values, vectors = np.linalg.eigh(axes @ covariance @ axes.T)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(factor * np.stack([np.cos(_TURN), np.sin(_TURN)], axis=1) @ root.T)


def ellipse_rows(covariance: Array, most: int = 12) -> Index:
    """Stations whose ellipses are drawn: the last, and others spread over the well."""
    rows = np.unique(np.linspace(0, len(covariance) - 1, most + 1).astype(np.intp))
    return np.asarray(rows[np.trace(covariance[rows], axis1=1, axis2=2) > 0.0])


def magnification(path: Path, covariance: Array | None, plane: Array | None = None) -> float:
    """How much larger than life ellipses must be drawn to be seen: 1, 2, 5, 10 and so on.

    The largest is then some twelfth of the well, or of what a plane, two unit vectors (2, 3), shows of it.
    """
    if covariance is None or not (covariance != 0.0).any():
        return 1.0
    view = np.eye(3) if plane is None else plane
    span = float(np.ptp(_points(path) @ view.T, axis=0).max())
    longest = float(np.sqrt(np.linalg.eigvalsh(view @ covariance @ view.T).max()))
    largest = float(ellipsoid_factor(PROBABILITY, 2)) * longest
    return _round_step(span / 12.0 / largest) if largest > 0.0 else 1.0


def _round_step(wanted: float) -> float:
    """The largest of 1, 2, 5, 10 ... that is not above; at least 1."""
    if wanted <= 1.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= wanted * (1.0 + 1e-12)))


EAST_NORTH: Final = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
"""Axes (2, 3) of the plan: east to the right, north up."""


def stretched(path: Path, covariance: Array | None, direction: float, magnify: float) -> float:
    """How many times as long a horizontal metre of the vertical section is drawn as a vertical one, to fill it."""
    along = _points(path) @ section_axes(direction).T
    wide, tall = (float(span) for span in np.ptp(along, axis=0))
    if covariance is not None:
        across = section_axes(direction)[0]
        largest = float(np.sqrt(np.einsum("i,nij,j->n", across, covariance, across).max()))
        wide = max(wide, 2.0 * magnify * float(ellipsoid_factor(PROBABILITY, 2)) * largest)
    return _round_step(min(0.7 * tall / wide, 1000.0)) if wide > 0.0 else 1.0


def _points(path: Path) -> Array:
    return np.stack([path.north, path.east, path.tvd], axis=1)


def _drawn(axes: Axes, path: Path, covariance: Array | None, plane: Array, factor: float) -> None:
    """The path and its ellipses on a plane."""
    rows = thinned(len(path))
    along = _points(path)[rows] @ plane.T
    axes.plot(along[:, 0], along[:, 1], color=SERIES[0], zorder=3)
    if covariance is not None:
        for row in ellipse_rows(covariance):
            outline = _points(path)[row] @ plane.T + ellipse_points(covariance[row], plane, factor)
            axes.fill(outline[:, 0], outline[:, 1], facecolor=SERIES[1], alpha=0.18, linewidth=0.0)
            axes.plot(outline[:, 0], outline[:, 1], color=SERIES[1], linewidth=0.9)
    for row, mark in ((0, "o"), (-1, "s")):
        axes.plot(along[row, 0], along[row, 1], marker=mark, color=INK, zorder=4, markersize=5.0)


def _scaled(axes: Axes) -> None:
    """One metre is as long either way, and the picture is filled."""
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.06)
    axes.ticklabel_format(useOffset=False, style="plain")
    axes.locator_params(nbins=6)


@panel(4.4, "east, m")
def plan_figure(axes: Axes, path: Path, covariance: Array | None, north: str, magnify: float) -> None:
    """The well from above, with horizontal ellipses."""
    _drawn(axes, path, covariance, EAST_NORTH, magnify * float(ellipsoid_factor(PROBABILITY, 2)))
    _scaled(axes)
    axes.set_ylabel(label("north ({north}), m", north=north))


@panel(4.4, y="true vertical depth, m")
def section_figure(axes: Axes, path: Path, covariance: Array | None, direction: float, magnify: float) -> None:
    """The well from the side, with ellipses of the section's plane."""
    _drawn(axes, path, covariance, section_axes(direction), magnify * float(ellipsoid_factor(PROBABILITY, 2)))
    _scaled(axes)
    axes.set_aspect(1.0 / stretched(path, covariance, direction, magnify), adjustable="datalim")
    axes.invert_yaxis()
    axes.set_xlabel(label("along azimuth {direction}°, m", direction=plain(float(np.degrees(direction)), 1)))


@panel(4.4, width=6.4)
def space_figure(axes: Axes, path: Path, covariance: Array | None, magnify: float) -> None:
    """The well in space, for pages that are printed or run no script."""
    plane = view_axes(*first_view(path))
    corners = _points(path)
    low, high = corners.min(axis=0), corners.max(axis=0)
    # the floor of the box, and the well's shadow on it
    ends = ((low, low), (high, low), (high, high), (low, high), (low, low))
    floor = np.array([[x[0], y[1], high[2]] for x, y in ends]) @ plane.T
    axes.plot(floor[:, 0], floor[:, 1], color=INK, alpha=0.35, linewidth=0.8)
    shadow = np.column_stack([corners[:, :2], np.full(len(corners), high[2])])[thinned(len(path))] @ plane.T
    axes.plot(shadow[:, 0], shadow[:, 1], color=INK, alpha=0.35, linewidth=1.0, linestyle=":")
    for row in ellipse_rows(np.broadcast_to(np.eye(3), (len(path), 3, 3)), 8):
        drop = np.stack([corners[row], [*corners[row, :2], high[2]]]) @ plane.T
        axes.plot(drop[:, 0], drop[:, 1], color=INK, alpha=0.25, linewidth=0.7)
    _drawn(axes, path, covariance, plane, magnify * float(ellipsoid_factor(PROBABILITY, 3)))
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_axis_off()


@styled
def source_figure(names: Sequence[str], sizes: Sequence[float], kinds: Sequence[str]) -> Figure:
    """Bars, largest first: one standard deviation of each source, its name above it, coloured by what shares it."""
    figure = new_figure(1.1 + 0.31 * len(names))
    axes = figure.add_subplot()
    seen = list(dict.fromkeys(kinds))
    places = np.arange(len(names))
    for colour, kind in zip(SERIES, seen, strict=False):
        chosen = np.array([k == kind for k in kinds])
        axes.barh(places[chosen] + 0.25, np.asarray(sizes)[chosen], color=colour, height=0.42, label=kind)
    # inside, from the zero on: names beside the bars would leave them no room
    axes.set_yticks(places, list(names), ha="left", va="bottom")
    axes.tick_params(axis="y", length=0.0, pad=-3.0)
    for tick in axes.get_yticklabels():
        tick.set_in_layout(False)
    axes.set_ylim(len(names) - 0.3, -0.7)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel("one standard deviation along the major axis, m")
    legend_above(axes, 3)
    return figure


@panel(2.8, "measured depth, m", "severity, deg/30 m")
def severity_figure(axes: Axes, md: Array, severity: Array) -> None:
    """Dogleg severity of every interval over measured depth."""
    rows = thinned(len(md))
    axes.step(md[rows], severity[rows], where="pre", color=SERIES[0])
    axes.fill_between(md[rows], severity[rows], step="pre", color=SERIES[0], alpha=0.2, linewidth=0.0)
    axes.set_ylim(bottom=0.0)


@panel(2.8, "measured depth, m", "σ, m")
def sigma_figure(axes: Axes, md: Array, sigmas: Array, major: Array) -> None:
    """Standard deviations along the axes of the hole and the major axis of the ellipse, over measured depth."""
    rows = thinned(len(md))
    curves = zip(("high side", "lateral", "along hole", "major axis"), [*sigmas.T, major], strict=True)
    for n, (name, values) in enumerate(curves):
        axes.plot(md[rows], values[rows], color=SERIES[n], linestyle=DASHES[n % len(DASHES)], label=name)
    axes.set_ylim(bottom=0.0)
    legend_above(axes, 2)


def spread_of_norths(angles: Sequence[float]) -> float:
    """How many times the angles between norths are exaggerated to be seen: 1, 2, 5 ... 100.

    Examples
    --------
    >>> spread_of_norths([np.radians(3.0), 0.0]), spread_of_norths([np.radians(-40.0)]), spread_of_norths([0.0])
    (10.0, 1.0, 1.0)
    """
    widest = max((abs(float(np.degrees(angle))) for angle in angles), default=0.0)
    if widest == 0.0:
        return 1.0
    return max((step for step in (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0) if step * widest <= 40.0), default=1.0)


@panel(3.6)
def north_figure(axes: Axes, norths: Sequence[tuple[str, float]], hole: float, exaggerated: float) -> None:
    """Compass: true north up; other norths (rad east of it) are `exaggerated`, the hole is not."""
    axes.plot(np.sin(_TURN), np.cos(_TURN), color=INK, alpha=0.3, linewidth=0.8)
    together: dict[float, list[str]] = {}
    for name, angle in sorted(norths, key=lambda pair: pair[1]):
        together.setdefault(angle, []).append(name)
    sides = {1: ("center",), 2: ("right", "left"), 3: ("right", "center", "left")}[len(together)]
    colours = {"true": INK, "magnetic": SERIES[1], "grid": SERIES[2]}
    for side, (angle, names) in zip(sides, together.items(), strict=True):
        drawn = exaggerated * angle
        _arrow(axes, drawn, 1.0, colours[names[-1]], 1.8)
        text = " = ".join(names)
        axes.text(1.1 * np.sin(drawn), 1.1 * np.cos(drawn), text, color=colours[names[-1]], ha=side, va="bottom")
    _arrow(axes, hole, 0.8, SERIES[0], 2.6)
    lift = "top" if np.cos(hole) < 0.0 else "bottom"
    axes.text(0.88 * np.sin(hole), 0.88 * np.cos(hole), "hole", color=SERIES[0], ha="center", va=lift)
    axes.text(1.06, 0.0, "east", alpha=0.7, va="center")
    axes.text(-1.06, 0.0, "west", alpha=0.7, va="center", ha="right")
    axes.set_aspect("equal")
    axes.set_xlim(-1.75, 1.75)
    axes.set_ylim(-1.1, 1.4)
    axes.set_axis_off()


def compass_picture(survey: WellSurvey, row: int) -> list[Picture]:
    """The norths and the hole at a station, seen from above."""
    known = {"magnetic": survey.site.declination, "true": 0.0, "grid": survey.site.convergence}
    norths = [(name, angle) for name, angle in known.items() if angle is not None]
    times = spread_of_norths([angle for _, angle in norths])
    caption = label("Norths seen from above") + (
        "" if times == 1.0 else label("; angles between them drawn {times:g} times", times=times)
    )
    return [picture(north_figure(norths, float(survey.azimuth[row]), times), "norths", caption)]


def _arrow(axes: Axes, azimuth: float, length: float, colour: str, width: float) -> None:
    tip = (length * float(np.sin(azimuth)), length * float(np.cos(azimuth)))
    look = {"arrowstyle": "-|>", "color": colour, "linewidth": width, "shrinkA": 0.0, "shrinkB": 0.0}
    axes.annotate("", xy=tip, xytext=(0.0, 0.0), arrowprops=look)


# Tables and sentences of a well's position.


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
        own = one.at(row)
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
    caption = label(
        "Last station, {md:.2f} m; positions and azimuths from {north} north", md=path.md[-1], north=survey.north
    )
    if uncertainty is None:
        rows = [TableRow([name, f"{value:.2f}", "", "", "m"]) for name, value in places]
        return Table(caption, head, rows + extra)
    covariance = uncertainty.covariance[-1]
    freedom = float(uncertainty.degrees_of_freedom[-1])
    one, two, three = (float(ellipsoid_factor(PROBABILITY, size, freedom)) for size in (1, 2, 3))
    sigma = np.sqrt(np.diagonal(covariance))
    rows = [
        TableRow([name, f"{value:.2f}", significant(float(u), 3), significant(one * float(u), 3), "m"])
        for (name, value), u in zip(places, sigma, strict=True)
    ]
    flat, solid = horizontal_ellipse(covariance), ellipsoid(covariance)
    hole = hole_sigmas(covariance, path.inclination[-1], path.azimuth[-1])
    lengths = [("horizontal ellipse, semi-major", flat.major, two), ("horizontal ellipse, semi-minor", flat.minor, two)]
    lengths += [(label("ellipsoid, semi-axis {n}", n=n + 1), axis, three) for n, axis in enumerate(solid.semi_axes)]
    lengths += [(name, u, one) for name, u in zip(("high side", "lateral", "along hole"), hole, strict=True)]
    bars = [TableRow([n, "", significant(float(u), 3), significant(k * float(u), 3), "m"]) for n, u, k in lengths]
    turn = TableRow(["azimuth of the ellipse's major axis", f"{np.degrees(flat.direction):.1f}", "", "", "deg"])
    note = label(
        "95 %: {one:.2f} σ for one coordinate, {two:.3f} σ for an ellipse, {three:.3f} σ for an ellipsoid, of a "
        "normal distribution.",
        one=one,
        two=two,
        three=three,
    )
    if np.isfinite(freedom):
        note = label(
            "95 %: {one:.2f} σ for one coordinate, {two:.3f} σ for an ellipse, {three:.3f} σ for an ellipsoid, of "
            "Student's distribution of {freedom:.0f} effective degrees of freedom.",
            one=one,
            two=two,
            three=three,
            freedom=freedom,
        )
    return Table(caption, head, [*rows, *extra, *bars, turn], note)


def source_table(
    uncertainty: PositionUncertainty | None, code: ToolCode | None, calibration: str | None
) -> Table | None:
    if uncertainty is None:
        return None
    terms = () if code is None else code.terms
    certified = {
        "calibration": "What the certificate of {tool} leaves unknown of its sensors, with all correlations",
        "sensor noise": "Noise of one reading of {tool}",
        "stability": "What the sensors of {tool} may have moved by since its calibration",
        "declination": "The site's declination",
    }
    words = {} if calibration is None else {name: label(text, tool=calibration) for name, text in certified.items()}
    words |= {one.name: f"{label(one.description)} ({number(f'{one.magnitude:g}')} {label(one.unit)})" for one in terms}
    shared = {
        "random": "nothing: each station its own",
        "systematic": "the stations of the run",
        "well": "the runs of the well",
        "global": "all wells",
    }
    rows = []
    for part in contributions(uncertainty):
        sizes = [significant(part.major, 3), f"{100.0 * part.share:.1f}"]
        sizes += [significant(float(s), 3) for s in part.sigma]
        how = label(": ").join(map(label, (part.propagation, shared[part.propagation])))
        rows.append(TableRow([part.name, words.get(part.name, ""), how, *sizes]))
    sigmas = [label("{name}, {unit}", name=f"σ {label(axis)}", unit="m") for axis in ("north", "east", "vertical")]
    head = ["source", "what it is", "shared by", "σ major axis, m", "share, %", *sigmas]
    caption = "Every source at the last station; share: of the variance along the ellipse's major axis"
    return Table(caption, head, rows, text_columns=3)


def chain_table(survey: WellSurvey, reference: str) -> Table:
    """How the azimuth of one station came from the survey's north to the result's, step by step."""
    row = int(np.argmax(np.sin(survey.inclination) + 1e-9 * np.arange(len(survey))))
    site = survey.site
    steps = [("magnetic", site.declination), ("true", None), ("grid", site.convergence)]
    rows = []
    for name, correction in steps:
        # from grid north without a convergence no other is known
        if name != "grid" if survey.reference == "grid" else correction is None and name != "true":
            rows.append(TableRow([name, "not known", "", _role(name, reference, survey.north)]))
            continue
        value, step = float(np.degrees(convert_azimuth(survey.azimuth[row], survey.reference, name, site))), ""
        if correction is not None:
            quantity = {"magnetic": "declination", "grid": "convergence"}[name]
            sigma = getattr(site, f"{quantity}_sigma")
            spread = f" ± {np.degrees(sigma):.2f}" if sigma else ""
            step = label(
                "{quantity} {correction:+.3f}{spread}° added ({origin})",
                quantity=quantity,
                correction=np.degrees(correction),
                spread=spread,
                origin=site.origin(quantity),
            )
        rows.append(TableRow([name, f"{value:.3f}", step, _role(name, reference, survey.north)]))
    caption = label("Azimuth of the station at {md:.2f} m from each north", md=survey.md[row])
    note = (
        "true = magnetic + declination (positive where magnetic north is east of true north); grid = true − "
        "convergence (positive where grid north is east of true north). No check of the survey shows a wrong sign: "
        "compare the drawing with a map."
    )
    return Table(caption, ["north", "azimuth, deg", "from it to true north", "use"], rows, note)


def _role(name: str, reference: str, north: str) -> str:
    roles = ["survey" * (name == reference), "results" * (name == north)]
    return ", ".join(role for role in roles if role)


def missing(
    uncertainty: PositionUncertainty | None, code: ToolCode | None, calibration: str | None, run: bool = False
) -> list[str]:
    """What the numbers do not contain; `run`: the error model is a gyro run itself."""
    if uncertainty is None:
        return ["Uncertainty of any kind: no tool code and no calibration was given."]
    lines = ["Gross errors: a wrong depth, a swapped sensor, a station of another well. They have no ellipse."]
    if calibration is not None and code is None:
        lines.append(
            label(
                "Everything outside the certificate of {calibration}: measured depth, misalignment in the hole, "
                "sag, magnetic interference of the string, references where they are not in the table of sources.",
                calibration=calibration,
            )
        )
    elif run:
        lines.append(
            "Everything that a gyro run cannot see of itself: the tool askew in the hole, sag, measured depth, where "
            "they are not in the table of sources."
        )
    elif code is not None:
        both = "the certificate of {calibration} or of {name}"
        terms = code.name if calibration is None else label(both, calibration=calibration, name=code.name)
        lines.append(
            label(
                "Anything that is not a term of {terms}: a tool, a hole or a correction that model was not made for.",
                terms=terms,
            )
        )
    if not uncertainty.survey.tie.any():
        lines.append("Uncertainty of the first station's position: it was taken as exact.")
    lines.append("Errors so large that the well's shape itself changes: the propagation is linear.")
    return lines


def station_table(path: Path, uncertainty: PositionUncertainty | None) -> Table:
    severity = dogleg_severity_deg(path)
    head = ["md, m", "inclination", "azimuth", "tvd, m", "north, m", "east, m", "dls, deg/30 m"]
    columns = [np.degrees(path.inclination), np.degrees(path.azimuth), path.tvd, path.north, path.east, severity]
    texts = [[f"{x:.2f}" for x in (values + 0.0).tolist()] for values in (path.md, *columns)]
    if uncertainty is not None:
        ellipse = horizontal_ellipse(uncertainty.widened(PROBABILITY), PROBABILITY)
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
    start = label(
        "north {north} m, east {east} m, true vertical depth {tvd} m",
        north=plain(path.north[0]),
        east=plain(path.east[0]),
        tvd=plain(path.tvd[0]),
    )
    facts = [
        (
            "Stations",
            label("{count}, from {md} to {end_m} m", count=len(path), md=plain(path.md[0]), end_m=plain(path.md[-1])),
        ),
        ("First station at", start),
        ("Azimuths of the survey from", label("{reference} north", reference=reference)),
        ("Positions from", label("{north} north", north=survey.north)),
    ]
    if code is not None:
        facts += [("Tool code", code.name), ("Revision", code.revision or "not stated"), ("Source", code.source)]
        facts.append(("What it is", code.description or "not stated"))
    if calibration is not None:
        facts.append(("Error model of the sensors", label("the calibration of {calibration}", calibration=calibration)))
    elif "errors" in inputs:
        facts.append(("Error model of the sensors", "the gyro run itself"))
    # values of the site that the error model used, with where they come from
    site = survey.site
    shown = {
        "gravity": ("g", "{:.5f}", "m/s²", 1.0),
        "b": ("b", "{:.0f}", "nT", 1.0),
        "dip": ("dip", "{:.3f}", "°", np.degrees(1.0)),
        "latitude": ("latitude", "{:.4f}", "°", np.degrees(1.0)),
    }
    places = []
    for quantity, (name, form, sign, unit) in shown.items():
        value = getattr(site, quantity)
        if value is not None:
            origin = (
                ("given" if site.g is not None else "normal gravity")
                if quantity == "gravity"
                else site.origin(quantity) or ""
            )
            places.append(
                (
                    label("Site: {name}", name=name),
                    f"{number(form.format(value * unit))} {label(sign)} ({label(origin)})",
                )
            )
    return facts + places + [(label("Digest of {name}", name=name), digest) for name, digest in inputs.items()]


def position_report(
    path: Path,
    survey: WellSurvey,
    uncertainty: PositionUncertainty | None,
    *,
    azimuth_reference: str,
    tool_code: ToolCode | None = None,
    calibration: str | None = None,
    findings: Sequence[Finding] = (),
    notes: Sequence[str] = (),
    inputs: Mapping[str, str] | None = None,
    section: float | None = None,
) -> str:
    """A well's path and its uncertainty as one self-contained HTML page; its picture in space turns without a network.

    `path` counts from `survey.north`; `azimuth_reference` is the north the survey's azimuths came from; `section` is
    the azimuth of the vertical section, rad.
    """
    covariance = None if uncertainty is None else uncertainty.widened(PROBABILITY)
    magnify = magnification(path, covariance)
    direction = section_azimuth(path) if section is None else section
    flat = magnification(path, covariance, EAST_NORTH)
    upright = magnification(path, covariance, section_axes(direction))
    shown = {
        size: "" if covariance is None else label("; 95 % ellipses{size}", size=_drawn_at(size))
        for size in (flat, upright)
    }
    times = stretched(path, covariance, direction, upright)
    ellipses = shown[upright] + (
        "" if times == 1.0 else label("; horizontal scale {times:g} times the vertical", times=times)
    )
    shadows = "" if covariance is None else label(" with the shadows of 95 % ellipsoids{size}", size=_drawn_at(magnify))
    turn, lift = np.degrees(first_view(path))
    view = label("seen from azimuth {turn:.0f}°, {lift:.0f}° from above", turn=turn, lift=lift)
    severity = dogleg_severity_deg(path)
    found = []
    if uncertainty is not None:
        sigmas = hole_sigmas(uncertainty.covariance, path.inclination, path.azimuth)
        major = horizontal_ellipse(uncertainty.covariance).major
        found.append(picture(sigma_figure(path.md, sigmas, major), "sigma", "One standard deviation of position"))
    row = int(np.argmax(np.sin(survey.inclination) + 1e-9 * np.arange(len(survey))))
    noted, warnings = (said(f for f in findings if (f.severity == "note") is note) for note in (True, False))
    return render(
        "position.html",
        title="Position of the well",
        kind="Position report",
        heading="Position of the well",
        conventions=CONVENTIONS,
        state="" if uncertainty is None else "warn" if warnings else "good",
        badge=(
            "Read the warnings"
            if warnings
            else label("{count} stations", count=len(path))
            + ("" if uncertainty is not None else label(", uncertainty not known"))
        ),
        verdict=_verdict(path, survey, uncertainty),
        notes=[*notes, *noted],
        warnings=warnings,
        bottom=bottom_table(path, survey, uncertainty),
        plans=[
            picture(
                plan_figure(path, covariance, survey.north, flat), "plan", label("Plan{ellipses}", ellipses=shown[flat])
            ),
            picture(
                section_figure(path, covariance, direction, upright),
                "section",
                label("Vertical section{ellipses}", ellipses=ellipses),
            ),
        ],
        still=picture(
            space_figure(path, covariance, magnify),
            "space",
            label("The well{shadows}, {view}", shadows=shadows, view=view),
        ),
        data=_data(path, uncertainty, magnify, survey.north),
        magnify=f"{magnify:g}",
        sources=_sources_picture(uncertainty, tool_code),
        source_table=source_table(uncertainty, tool_code, calibration),
        courses=[*found, picture(severity_figure(path.md, severity), "severity", "Dogleg severity of each interval")],
        chain=chain_table(survey, azimuth_reference),
        # counted from grid north where the site has no convergence: nothing to draw
        compass=compass_picture(survey, row) if survey.reference == "true" else [],
        missing=missing(uncertainty, tool_code, calibration, "errors" in (inputs or {})),
        stations=limit_rows(station_table(path, uncertainty)),
        facts=fact_pairs(path, survey, azimuth_reference, tool_code, calibration, inputs or {}),
    )


def _verdict(path: Path, survey: WellSurvey, uncertainty: PositionUncertainty | None) -> str:
    """One sentence: where the last station is, and how sure that is."""
    if uncertainty is None:
        where = label(
            "north {north:.2f} m, east {east:.2f} m, true vertical depth {tvd:.2f} m",
            north=path.north[-1],
            east=path.east[-1],
            tvd=path.tvd[-1],
        )
        return label(
            "At {md:.2f} m the well is at {where} ({north} north); how sure that is is not known: no error model "
            "was given.",
            md=path.md[-1],
            where=where,
            north=survey.north,
        )
    ellipse = horizontal_ellipse(uncertainty.widened(PROBABILITY)[-1], PROBABILITY)
    sigma = np.sqrt(np.diagonal(uncertainty.covariance[-1]))
    north, east, down = (
        rounded(float(x[-1]), float(u)) for x, u in zip((path.north, path.east, path.tvd), sigma, strict=True)
    )
    vertical = float(ellipsoid_factor(PROBABILITY, 1, uncertainty.degrees_of_freedom[-1])) * float(sigma[2])
    return label(
        "At {md:.2f} m the well is at north {north} m, east {east} m, true vertical depth {down} m ({north_2} "
        "north); with 95 % probability within a horizontal ellipse of {major} m by {minor} m (semi-axes, the "
        "major one at azimuth {direction:.0f}°), and within ±{vertical} m vertically.",
        md=path.md[-1],
        north=north,
        east=east,
        down=down,
        north_2=survey.north,
        major=significant(float(ellipse.major)),
        minor=significant(float(ellipse.minor)),
        direction=np.degrees(float(ellipse.direction)),
        vertical=significant(vertical),
    )


def _drawn_at(magnify: float) -> str:
    return "" if magnify == 1.0 else label(", drawn {times:g} times as large", times=magnify)


def _data(path: Path, uncertainty: PositionUncertainty | None, magnify: float, north: str) -> dict[str, Any]:
    """What the picture that turns is drawn from, rounded to centimetres."""
    columns = np.column_stack([path.md, path.north, path.east, path.tvd])
    rows = thinned(len(path))
    bodies: list[list[float]] = []
    if uncertainty is not None:
        covariance = uncertainty.widened(PROBABILITY)
        for row in ellipse_rows(covariance, 20):
            c = covariance[row]
            upper = [float(f"{c[i, j]:.6g}") for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
            bodies.append([*columns[row].round(2).tolist(), *upper])
    return {
        "stations": columns[rows].round(2).tolist(),
        "bodies": bodies,
        "factor": round(float(ellipsoid_factor(PROBABILITY, 3)), 6),
        "magnify": magnify,
        "view": [round(angle, 6) for angle in first_view(path)],
        "words": {
            "grid": label("grid lines every"),
            "north": label("{north} north", north=north),
            "north_m": label("north, m"),
            "east_m": label("east, m"),
            "tvd_m": label("true vertical depth, m"),
            "m": label("m"),
            **{side[0].upper(): label(side)[0].upper() for side in ("north", "east", "south", "west")},
        },
    }


def _sources_picture(uncertainty: PositionUncertainty | None, code: ToolCode | None) -> list[Picture]:
    if uncertainty is None:
        return []
    parts = contributions(uncertainty)[:14]
    described = {one.name: one.description for one in (() if code is None else code.terms) if one.description}
    # its name with the code behind, as long as the figure is wide
    names = [
        f"{shorten(label(described[name]), 46 - len(name), placeholder=' …')} ({name})" if name in described else name
        for name in (part.name for part in parts)
    ]
    figure = source_figure(names, [p.major for p in parts], [p.propagation for p in parts])
    more = len(uncertainty.sources) - len(parts)
    return [
        picture(figure, "sources", label("The {count} largest sources", count=len(parts)) if more else "All sources")
    ]
