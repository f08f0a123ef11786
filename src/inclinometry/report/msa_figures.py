"""Drawings of a multi-station analysis: estimates over their priors, correlation, influence, change of azimuth."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from inclinometry.attitude.orientation import angles
from inclinometry.core.angles import wrap_signed
from inclinometry.core.arrays import Array
from inclinometry.core.constants import COVERAGE_FACTOR
from inclinometry.report.figure import BAD, INK, SERIES, new_figure, styled
from inclinometry.report.survey_figures import thinned
from inclinometry.survey.multistation import MultiStation
from inclinometry.survey.stations import Stations

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FAR = 4.0  # prior standard deviations drawn; an estimate farther out is drawn at the edge with its number


def drawn(found: MultiStation) -> list[str]:
    """Parameters worth drawing: those with a prior variance."""
    return [name for name, p in found.parameters.items() if p.prior > 0.0]


@styled
def estimate_figure(found: MultiStation, labels: dict[str, str]) -> Figure:
    """Each estimate with U, in standard deviations of its prior; the shaded band is what was known before."""
    names = drawn(found)
    figure = new_figure(0.9 + 0.24 * len(names))
    axes = figure.add_subplot()
    axes.axvspan(
        -COVERAGE_FACTOR,
        COVERAGE_FACTOR,
        color=SERIES[7],
        alpha=0.15,
        linewidth=0.0,
        label=f"known before (k = {COVERAGE_FACTOR:g})",
    )
    axes.axvline(0.0, color=INK, alpha=0.5, linewidth=0.8)
    for row, name in enumerate(names):
        p = found.parameters[name]
        at, spread = p.value / p.prior, COVERAGE_FACTOR * p.u / p.prior
        sure = p.significance > COVERAGE_FACTOR
        look: dict[str, Any] = {"color": SERIES[1] if sure else SERIES[0], "marker": "s" if sure else "o"}
        axes.errorbar([np.clip(at, -_FAR, _FAR)], [row], xerr=[spread], linestyle="none", capsize=2.5, **look)
        if abs(at) > _FAR:
            axes.annotate(f"{at:+.1f}", (np.sign(at) * _FAR, row), (0.0, 4.0), textcoords="offset points", ha="center")
    axes.set_yticks(range(len(names)), [labels[name] for name in names])
    axes.set_ylim(len(names) - 0.4, -0.6)
    reach = min(
        _FAR + 0.6, max(2.6, *(abs(p.value) / p.prior + COVERAGE_FACTOR * p.u / p.prior for p in _of(found, names)))
    )
    axes.set_xlim(-reach, reach)
    axes.set_xlabel("estimate ± U, in standard deviations of its prior")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)
    return figure


def _of(found: MultiStation, names: list[str]) -> list[Any]:
    return [found.parameters[name] for name in names]


@styled
def correlation_figure(found: MultiStation, labels: dict[str, str]) -> Figure:
    """Correlation of the parameters after the analysis; blue together, orange against each other."""
    from matplotlib.colors import LinearSegmentedColormap

    names = drawn(found)
    places = [list(found.parameters).index(name) for name in names]
    matrix = found.correlation[np.ix_(places, places)]
    figure = new_figure(4.6)
    axes = figure.add_subplot()
    edge = len(names) - 0.5
    # one rectangle a cell keeps the colours those of the page; blank near zero
    tints = LinearSegmentedColormap.from_list("sign", [SERIES[1], "#ffffff", SERIES[0]])
    for i, row in enumerate(matrix):
        for j, value in enumerate(row):
            if abs(value) < 0.05:
                continue
            size = 0.96 * float(np.sqrt(abs(value)))
            colour = tints(1.0 if value > 0.0 else 0.0)
            axes.add_patch(_square(j, i, size, colour))
    axes.set_xlim(-0.5, edge)
    axes.set_ylim(edge, -0.5)
    axes.set_aspect("equal")
    axes.set_xticks(range(len(names)), [labels[name] for name in names], rotation=90, fontsize=8.5)
    axes.set_yticks(range(len(names)), [labels[name] for name in names], fontsize=8.5)
    return figure


def _square(x: float, y: float, size: float, colour: Any) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((x - size / 2.0, y - size / 2.0), size, size, facecolor=colour, linewidth=0.0)


@styled
def influence_figure(found: MultiStation) -> Figure:
    """How far the azimuths would move without each station."""
    figure = new_figure(3.0)
    axes = figure.add_subplot()
    md, moved = found.corrected.md, np.degrees(found.influence)
    rows = thinned(len(md))
    axes.vlines(md[rows], 0.0, moved[rows], color=SERIES[0], linewidth=1.4)
    axes.plot(md[rows], moved[rows], linestyle="none", marker="o", color=SERIES[0], markersize=3.5)
    worst = int(np.argmax(moved))
    axes.plot(md[worst], moved[worst], linestyle="none", marker="o", color=BAD, markersize=5.0)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("largest change, deg")
    axes.set_xlabel("measured depth of the station left out, m")
    return figure


@styled
def azimuth_figure(found: MultiStation, before: Stations, u_before: Array, u_after: Array) -> Figure:
    """Change of azimuth by the correction, with the uncertainty that remains (NaN: not drawn), and that before."""
    figure = new_figure(3.0)
    axes = figure.add_subplot()
    rows = thinned(len(before))
    md = before.md[rows]
    old, new = (angles(s.g, s.b).azimuth for s in (before, found.corrected))
    moved = np.degrees(wrap_signed(new - old))[rows]
    was, left = (COVERAGE_FACTOR * np.minimum(np.degrees(u[rows]), 90.0) for u in (u_before, u_after))
    moved[np.isnan(left)] = np.nan
    axes.fill_between(md, -was, was, color=SERIES[7], alpha=0.15, linewidth=0.0, label="U before")
    axes.fill_between(md, moved - left, moved + left, color=SERIES[0], alpha=0.3, linewidth=0.0, label="U after")
    axes.plot(md, moved, color=SERIES[0], marker="o" if len(md) <= 80 else None, label="change")
    axes.axhline(0.0, color=INK, alpha=0.5, linewidth=0.8)
    shown = np.concatenate([moved - left, moved + left, [0.0]])
    shown = shown[np.isfinite(shown)]
    room = 0.15 * max(float(np.ptp(shown)), 0.1)
    axes.set_ylim(float(shown.min()) - room, float(shown.max()) + room)
    axes.set_ylabel("azimuth, deg")
    axes.set_xlabel("measured depth, m")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.2, columnspacing=1.0)
    return figure
