"""Drawings of a certificate, black on white, without words, so that they serve every language."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.report.calibration_figures import log_scale
from inclinometry.report.figure import BAD, INK, MARKERS, SERIES, new_figure, style, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LETTERS = {"inclination": "I", "azimuth": "A", "toolface": "T"}
DASHES = ("-", "--", "-.")
WIDTH = 6.8
"""Width of a drawing, in, about that of the text on the page."""
MANY = 60


@styled
def uncertainty_figure(table: Mapping[str, Any]) -> Figure:
    """Expanded uncertainty of each angle over inclination."""
    figure = new_figure(2.5, width=WIDTH)
    axes = figure.add_subplot()
    x, lowest, highest = table["inclination_deg"], np.inf, 0.0
    for place, (name, letter) in enumerate(LETTERS.items()):
        values = table.get(f"U_{name}_deg")
        if values is not None:
            axes.plot(x, values, DASHES[place], marker=MARKERS[place], color=SERIES[place], label=f"U({letter})")
            lowest, highest = min(lowest, *values), max(highest, *values)
    log_scale(axes, max(lowest, 1e-6), max(highest, 1e-5))
    axes.set_xlim(0.0, max(x))
    axes.set_xlabel("I, °")
    axes.set_ylabel("U, °")
    axes.legend(loc="upper right", ncols=3)
    return figure


@styled
def residual_figure(standardised: Sequence[Sequence[float | None]]) -> Figure:
    """Standardised residuals of one triad over the number of the station."""
    values = np.array(standardised, dtype=float)
    figure = new_figure(1.9, width=WIDTH)
    axes = figure.add_subplot()
    place = np.arange(1, len(values) + 1)
    for sensor in range(values.shape[1]):
        axes.plot(
            place + 0.2 * (sensor - 1),
            values[:, sensor],
            linestyle="none",
            marker=MARKERS[(0, 1, 2)[sensor % 3]],
            color=SERIES[sensor % len(SERIES)],
            markersize=4.0 if len(values) <= MANY else 2.0,
        )
    for level, colour in ((2.0, INK), (3.0, BAD)):
        for sign in (1.0, -1.0):
            axes.axhline(sign * level, color=colour, linewidth=0.8, linestyle="--" if level < 3.0 else "-")
    reach = 1.1 * max(3.4, float(np.nanmax(np.abs(values), initial=0.0)))
    axes.set_ylim(-reach, reach)
    axes.set_xlim(0.3, len(values) + 0.7)
    axes.set_ylabel("r / σ")
    axes.set_xlabel("n")
    return figure


@styled
def error_figure(
    setting: Array, error: Array, u: Array, limit: Array, letter: str, *, by_place: bool = False
) -> Figure:
    """Errors of one angle over its setting, or position by position, with U and limits; degrees, judged ones only."""
    figure = new_figure(1.9, width=WIDTH)
    axes = figure.add_subplot()
    axes.errorbar(setting, error, u, linestyle="none", marker="o", markersize=3.5, color=SERIES[0], elinewidth=0.9)
    if limit.size and np.ptp(limit) < 1e-12:
        for sign in (1.0, -1.0):
            axes.axhline(sign * limit[0], color=BAD, linewidth=1.2)
    else:
        order = np.argsort(setting, kind="stable")
        for sign in (1.0, -1.0):
            axes.plot(setting[order], sign * limit[order], "_", color=BAD, markersize=7.0)
    reach = 1.1 * float(max(np.max(np.abs(error) + u, initial=1e-6), np.max(limit, initial=0.0)))
    axes.set_ylim(-reach, reach)
    axes.axhline(0.0, color=INK, linewidth=0.7)
    axes.set_xlabel("n" if by_place else f"{letter}, °")
    axes.set_ylabel(f"Δ{letter}, °")
    return figure


def paper_svg(figure: Figure) -> str:
    """SVG with letters as outlines, so that no font is asked for when it is printed; the same bytes every time."""
    import matplotlib

    width, height = (float(side) for side in figure.get_size_inches())
    # margins that fit every drawing above: finding them anew takes as long as drawing
    figure.set_layout_engine("none")
    for axes in figure.axes:
        axes.set_position((0.75 / width, 0.5 / height, 1.0 - 0.97 / width, 1.0 - 0.6 / height))
    with style():
        matplotlib.rcParams["svg.fonttype"] = "path"
        stream = io.StringIO()
        figure.savefig(stream, format="svg", facecolor="white", metadata={"Date": None, "Creator": None})
    return stream.getvalue()
