"""Drawings of a verification: errors against limits with guard bands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inclinometry.calibration.acceptance import Verification
from inclinometry.core.constants import COVERAGE_FACTOR
from inclinometry.report.figure import BAD, INK, SERIES, new_figure, station_axis, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LOOKS = {
    "pass": ("o", SERIES[0]),
    "inconclusive": ("s", SERIES[1]),
    "fail": ("X", BAD),
    "not judged": ("D", SERIES[7]),
}
"""Marker and colour of each decision."""
DIAL_COLUMN = (1, 0, 2)
"""Where the dials hold inclination, azimuth, toolface."""


@styled
def station_figure(verification: Verification, column: int) -> Figure:
    """Error of one angle at each station with its expanded uncertainty, limits and guard bands."""
    figure = new_figure(3.3)
    axes = figure.add_subplot()
    place = np.arange(len(verification.station))
    limit = np.degrees(np.where(np.isfinite(verification.limits[:, column]), verification.limits[:, column], np.nan))
    spread = verification.coverage_factor * np.degrees(verification.u[:, column])
    _limits(axes, place, limit, np.maximum(limit - spread, 0.0), guarded=_guarded(verification))
    handles = _errors(axes, place, verification, column)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    axes.set_ylim(*_reach(verification, column))
    axes.set_ylabel("error, deg")
    station_axis(axes, list(verification.station))
    axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.2)
    return figure


@styled
def curve_figure(verification: Verification, column: int) -> Figure:
    """Error of one angle over its own setting, the error curve of the instrument."""
    figure = new_figure(2.8)
    axes = figure.add_subplot()
    x = np.degrees(verification.dials[:, DIAL_COLUMN[column]])
    _errors(axes, x, verification, column)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    axes.set_ylim(*_reach(verification, column))
    axes.set_xlabel(f"{('inclination', 'azimuth', 'toolface')[column]} set, deg")
    axes.set_ylabel("error, deg")
    return figure


def settings(verification: Verification, column: int) -> int:
    """At how many settings of its own an angle was judged."""
    judged = np.isfinite(verification.limits[:, column])
    return len(np.unique(np.degrees(verification.dials[judged, DIAL_COLUMN[column]]).round(3)))


def _guarded(verification: Verification) -> bool:
    return any("inconclusive" in row for row in verification.decision)


def _limits(axes: Axes, place: np.ndarray, limit: np.ndarray, inner: np.ndarray, *, guarded: bool) -> None:
    """Limits as steps over the stations; the guard band between them and the acceptance limit."""
    edges = np.append(place - 0.5, place[-1] + 0.5) if len(place) else place
    for sign in (1.0, -1.0):
        axes.stairs(sign * limit, edges, baseline=None, color=BAD, linewidth=1.3)
        if guarded:
            axes.stairs(sign * limit, edges, baseline=sign * inner, fill=True, color=BAD, alpha=0.16, linewidth=0.0)


def _errors(axes: Axes, x: np.ndarray, verification: Verification, column: int) -> list[object]:
    """Points with expanded uncertainties, one look a decision; returns the handles of the legend."""
    from matplotlib.lines import Line2D

    decisions = np.array([row[column] for row in verification.decision], dtype=object)
    errors = np.degrees(verification.errors[:, column])
    spread = COVERAGE_FACTOR * np.degrees(verification.u[:, column])
    handles: list[object] = []
    for name, (marker, colour) in LOOKS.items():
        rows = decisions == name
        if rows.any():
            # the bars of a vertical tool's azimuth would cross the whole drawing
            bars = None if name == "not judged" else spread[rows]
            axes.errorbar(x[rows], errors[rows], bars, linestyle="none", marker=marker, color=colour, elinewidth=1.1)
            handles.append(
                Line2D([], [], linestyle="none", marker=marker, color=colour, label=f"{name} ({rows.sum()})")
            )
    return handles


def _reach(verification: Verification, column: int) -> tuple[float, float]:
    """Limits of the y axis: everything that was judged fits in; what was not judged must not hide it."""
    judged = np.isfinite(verification.limits[:, column])
    if not judged.any():
        judged = np.isfinite(verification.errors[:, column])
    error, u = np.degrees(verification.errors[judged, column]), np.degrees(verification.u[judged, column])
    limit = np.degrees(
        np.where(np.isfinite(verification.limits[judged, column]), verification.limits[judged, column], 0)
    )
    top = 1.1 * float(max(limit.max(initial=0.0), (np.abs(error) + COVERAGE_FACTOR * u).max(initial=1e-6)))
    return -top, top
