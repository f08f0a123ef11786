"""Drawings of a survey over measured depth."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from inclinometry.arrays import Array
from inclinometry.constants import COVERAGE_FACTOR
from inclinometry.language import label
from inclinometry.report.calibration import MANY, log_scale
from inclinometry.report.figure import BAD, DASHES, INK, SERIES, legend_above, new_figure, panel, styled
from inclinometry.survey.reduce import Survey

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def thinned(size: int) -> Array:
    """Rows of a survey that are drawn, the first and the last among them.

    Examples
    --------
    >>> thinned(3), len(thinned(100_000))
    (array([0, 1, 2]), 1500)
    """
    # the extremes of a longer survey are in the table and the file
    return np.unique(np.linspace(0, max(size - 1, 0), min(size, 1500)).astype(int))


@styled
def angle_figure(survey: Survey, name: str) -> Figure:
    """One angle over measured depth with its band of expanded uncertainty, and below the uncertainty by component."""
    figure = new_figure(4.4)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    rows = thinned(len(survey))
    md, value = survey.md[rows], np.degrees(getattr(survey, name)[rows])
    u, k = np.degrees(survey.u(name)[rows]), survey.coverage_factor
    course(upper, md, value if name == "inclination" else unbroken(value), k * u)
    upper.set_ylabel(label("{name}, deg", name=name))
    md = survey.md[rows]
    if not (u > 0.0).any():
        lower.text(0.5, 0.5, "no uncertainty known", transform=lower.transAxes, ha="center", va="center")
    else:
        lower.plot(md, k * u, color=INK, label="U, all")
        low, least = float(u[u > 0.0].min()), 1e-3 * float(u.max())  # a smaller component is not drawn
        column = {"inclination": 0, "azimuth": 1, "toolface": 2}
        for n, (component, parts) in enumerate(survey.components.items()):
            variance = parts[rows, column[name]]
            part = np.degrees(np.sqrt(np.where(np.isfinite(variance) & (variance > 0.0), variance, np.nan)))
            part[part < least] = np.nan
            if np.isfinite(part).any():
                low = min(low, float(np.nanmin(part)))
                lower.plot(
                    md,
                    k * part,
                    color=SERIES[(n + 1) % len(SERIES)],
                    linestyle=DASHES[(n + 1) % len(DASHES)],
                    label=component,
                )
        log_scale(lower, k * low, k * float(u.max()))
        lower.set_ylabel("U, deg")
        # two long names side by side are as much as the width bears
        wide = 3 if len(survey.components) < 4 else 2
        legend_above(lower, wide)
    lower.set_xlabel("measured depth, m")
    return figure


def course(axes: Axes, md: Array, path: Array, spread: Array) -> None:
    """The angle itself: a curve with its band, or dots between 0 and 360 where it went round more than twice."""
    good = path[np.isfinite(path)]
    span = float(np.ptp(good)) if len(good) else 0.0
    if span > 720.0:
        compass_dots(axes, md, path)
        return
    # a band no wider than a turn: where nothing is known the axis must not be lost
    wide = np.minimum(spread, 180.0)
    axes.fill_between(md, path - wide, path + wide, color=SERIES[0], alpha=0.25, linewidth=0.0)
    axes.plot(md, path, color=SERIES[0], marker="o" if len(md) <= 80 else None, markersize=3.0)
    if len(good):
        room = max(1.0, 0.06 * span)
        axes.set_ylim(float(good.min()) - room, float(good.max()) + room)
    # ticks labelled 0 to 360 although the curve runs on over north
    from matplotlib.ticker import FuncFormatter, MaxNLocator

    axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 3, 4.5, 6, 9, 10]))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{round(value, 6) % 360.0:g}"))


def compass_dots(axes: Axes, place: Array, angle: Array) -> None:
    """Angles in degrees as dots between 0 and 360, for what no curve can follow."""
    axes.plot(place, angle % 360.0, linestyle="none", marker="o", color=SERIES[0], markersize=3.0)
    axes.set_ylim(0.0, 360.0)
    axes.set_yticks(range(0, 361, 90))


def unbroken(value: Array) -> Array:
    """Angles in degrees continued over north; nan where there is none."""
    path = np.full(len(value), np.nan)
    good = np.isfinite(value)
    path[good] = np.unwrap(value[good], period=360.0)
    return path


@panel(2.8, "measured depth, m")
def magnitude_figure(
    axes: Axes,
    md: Array,
    value: Array,
    what: str,
    unit: str,
    reference: tuple[float, float | None] | None,
    flagged: Array,
) -> None:
    """A magnitude that should not change, over measured depth, with its reference and flagged stations marked."""
    rows = thinned(len(md))
    axes.plot(md[rows], value[rows], color=SERIES[0], marker="o" if len(rows) <= 80 else None, markersize=3.0)
    if flagged.any():
        look: dict[str, Any] = {"linestyle": "none", "marker": "X", "color": BAD, "markersize": 6.5, "label": "flagged"}
        axes.plot(md[flagged], value[flagged], rasterized=int(flagged.sum()) > MANY, **look)
    if reference is not None:
        at, sigma = reference
        axes.axhline(at, color=SERIES[2], linestyle="--", label="reference")
        if sigma:
            axes.axhspan(
                at - COVERAGE_FACTOR * sigma, at + COVERAGE_FACTOR * sigma, color=SERIES[2], alpha=0.15, linewidth=0.0
            )
    axes.ticklabel_format(axis="y", useOffset=False)
    axes.set_ylabel(label("{name}, {unit}", name=what, unit=unit) if unit else what)
    if reference is not None or flagged.any():
        legend_above(axes, 2)
