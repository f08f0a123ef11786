"""Drawings of a well: plan, section, a view in space, ellipses, sources, norths."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from inclinometry.core.angles import wrap_positive
from inclinometry.core.arrays import Array, Index
from inclinometry.report.digits import plain
from inclinometry.report.figure import DASHES, INK, SERIES, new_figure, styled
from inclinometry.report.survey_figures import thinned
from inclinometry.survey.path import Path
from inclinometry.uncertainty.coverage import ellipsoid_factor

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PROBABILITY: Final = 0.95
"""That an ellipse or ellipsoid of the report holds the true position."""
VIEW: Final = (np.radians(110.0), np.radians(25.0))
"""From where the view in space looks at first: azimuth clockwise of the well's, and how far from above."""
PLAN: Final = np.eye(3)[:2][::-1]
"""East to the right, north up."""
_TURN: Final = np.linspace(0.0, 2.0 * np.pi, 73)


def section_azimuth(path: Path) -> float:
    """Azimuth of the section, rad: from the first station to the one farthest from it."""
    north, east = path.north - path.north[0], path.east - path.east[0]
    far = int(np.argmax(np.hypot(north, east)))
    return float(wrap_positive(np.arctan2(east[far], north[far])))


def first_view(path: Path) -> tuple[float, float]:
    """Azimuth that the view in space looks from, and how far from above, rad."""
    return float(wrap_positive(section_azimuth(path) + VIEW[0])), float(VIEW[1])


def section_axes(direction: float) -> Array:
    """Axes (2, 3) of a vertical section: along an azimuth to the right, down as it is."""
    return np.array([[np.cos(direction), np.sin(direction), 0.0], [0.0, 0.0, 1.0]])


def view_axes(azimuth: float, elevation: float) -> Array:
    """Axes (2, 3) of a view in space, right and up, looking from an azimuth and from above.

    Examples
    --------
    >>> view_axes(np.pi, np.pi / 2).round(9) + 0.0  # from straight above, standing south: the plan
    array([[0., 1., 0.],
           [1., 0., 0.]])
    """
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


def magnification(path: Path, covariance: Array | None) -> float:
    """How much larger than life ellipses must be drawn to be seen: 1, 2, 5, 10 and so on.

    The largest is then some twelfth of the well.
    """
    if covariance is None or not (covariance != 0.0).any():
        return 1.0
    span = max(float(np.ptp(x)) for x in (path.north, path.east, path.tvd))
    largest = ellipsoid_factor(PROBABILITY, 2) * float(np.sqrt(np.linalg.eigvalsh(covariance).max()))
    wanted = span / 12.0 / largest
    if wanted <= 1.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= wanted * (1.0 + 1e-12)))


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


@styled
def plan_figure(path: Path, covariance: Array | None, north: str, magnify: float) -> Figure:
    """The well from above, with horizontal ellipses."""
    figure = new_figure(4.4)
    axes = figure.add_subplot()
    _drawn(axes, path, covariance, PLAN, magnify * ellipsoid_factor(PROBABILITY, 2))
    _scaled(axes)
    axes.set_xlabel("east, m")
    axes.set_ylabel(f"north ({north}), m")
    return figure


@styled
def section_figure(path: Path, covariance: Array | None, direction: float, magnify: float) -> Figure:
    """The well from the side, with ellipses of the section's plane."""
    figure = new_figure(4.4)
    axes = figure.add_subplot()
    _drawn(axes, path, covariance, section_axes(direction), magnify * ellipsoid_factor(PROBABILITY, 2))
    _scaled(axes)
    axes.invert_yaxis()
    axes.set_xlabel(f"along azimuth {plain(float(np.degrees(direction)), 1)}°, m")
    axes.set_ylabel("true vertical depth, m")
    return figure


@styled
def space_figure(path: Path, covariance: Array | None, magnify: float) -> Figure:
    """The well in space, for pages that are printed or run no script."""
    figure = new_figure(4.4, width=6.4)
    axes = figure.add_subplot()
    plane = view_axes(*first_view(path))
    corners = _points(path)
    low, high = corners.min(axis=0), corners.max(axis=0)
    # the floor of the box, and the well's shadow on it
    floor = np.array([[x, y, high[2]] for x, y in _corners(low, high)]) @ plane.T
    axes.plot(floor[:, 0], floor[:, 1], color=INK, alpha=0.35, linewidth=0.8)
    shadow = np.column_stack([corners[:, :2], np.full(len(corners), high[2])])[thinned(len(path))] @ plane.T
    axes.plot(shadow[:, 0], shadow[:, 1], color=INK, alpha=0.35, linewidth=1.0, linestyle=":")
    for row in ellipse_rows(np.broadcast_to(np.eye(3), (len(path), 3, 3)), 8):
        drop = np.stack([corners[row], [*corners[row, :2], high[2]]]) @ plane.T
        axes.plot(drop[:, 0], drop[:, 1], color=INK, alpha=0.25, linewidth=0.7)
    _drawn(axes, path, covariance, plane, magnify * ellipsoid_factor(PROBABILITY, 3))
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_axis_off()
    return figure


def _corners(low: Array, high: Array) -> list[tuple[float, float]]:
    return [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]), (low[0], low[1])]


@styled
def source_figure(names: Sequence[str], sizes: Sequence[float], kinds: Sequence[str]) -> Figure:
    """Bars, largest first: one standard deviation of each source, coloured by what shares it."""
    figure = new_figure(0.9 + 0.235 * len(names))
    axes = figure.add_subplot()
    seen = list(dict.fromkeys(kinds))
    places = np.arange(len(names))
    for colour, kind in zip(SERIES, seen, strict=False):
        chosen = np.array([k == kind for k in kinds])
        axes.barh(places[chosen], np.asarray(sizes)[chosen], color=colour, height=0.72, label=kind)
    axes.set_yticks(places, list(names))
    axes.invert_yaxis()
    axes.grid(axis="y", visible=False)
    axes.set_xlabel("one standard deviation along the major axis, m")
    axes.legend(loc="lower right")
    return figure


@styled
def severity_figure(md: Array, severity: Array) -> Figure:
    """Dogleg severity of every interval over measured depth."""
    figure = new_figure(2.8)
    axes = figure.add_subplot()
    rows = thinned(len(md))
    axes.step(md[rows], severity[rows], where="pre", color=SERIES[0])
    axes.fill_between(md[rows], severity[rows], step="pre", color=SERIES[0], alpha=0.2, linewidth=0.0)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("measured depth, m")
    axes.set_ylabel("severity, deg/30 m")
    return figure


@styled
def sigma_figure(md: Array, sigmas: Array, major: Array) -> Figure:
    """Standard deviations along the axes of the hole and the major axis of the ellipse, over measured depth."""
    figure = new_figure(2.8)
    axes = figure.add_subplot()
    rows = thinned(len(md))
    curves = zip(("high side", "lateral", "along hole", "major axis"), [*sigmas.T, major], strict=True)
    for n, (label, values) in enumerate(curves):
        axes.plot(md[rows], values[rows], color=SERIES[n], linestyle=DASHES[n % len(DASHES)], label=label)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("measured depth, m")
    axes.set_ylabel("σ, m")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.2, columnspacing=1.0)
    return figure


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


@styled
def north_figure(norths: Sequence[tuple[str, float]], hole: float, exaggerated: float) -> Figure:
    """Compass: true north up, the other norths east or west of it, the hole.

    Parameters
    ----------
    norths : sequence of (name, angle east of true north in rad)
    hole : float
        Azimuth from true north, rad.
    exaggerated : float
        Angles between norths are drawn so many times as large; the hole's is not.
    """
    figure = new_figure(3.6)
    axes = figure.add_subplot()
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
    return figure


def _arrow(axes: Axes, azimuth: float, length: float, colour: str, width: float) -> None:
    tip = (length * float(np.sin(azimuth)), length * float(np.cos(azimuth)))
    look = {"arrowstyle": "-|>", "color": colour, "linewidth": width, "shrinkA": 0.0, "shrinkB": 0.0}
    axes.annotate("", xy=tip, xytext=(0.0, 0.0), arrowprops=look)
