"""The report of a verification."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inclinometry.calibration.acceptance import DERIVED, Verification
from inclinometry.constants import COVERAGE_FACTOR
from inclinometry.report.figure import BAD, INK, SERIES, new_figure, station_axis, styled
from inclinometry.report.page import CONVENTIONS, Section, Table, TableRow, cut, picture, render
from inclinometry.report.words import plain, rounded, significant

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

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
    inner = np.maximum(limit - spread, 0.0)
    guarded = any("inconclusive" in row for row in verification.decision)
    edges = np.append(place - 0.5, place[-1] + 0.5) if len(place) else place
    for sign in (1.0, -1.0):
        axes.stairs(sign * limit, edges, baseline=None, color=BAD, linewidth=1.3)
        if guarded:
            axes.stairs(sign * limit, edges, baseline=sign * inner, fill=True, color=BAD, alpha=0.16, linewidth=0.0)
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


def _errors(axes: Axes, x: np.ndarray, verification: Verification, column: int) -> list[object]:
    """Points with expanded uncertainties, one look a decision; returns the handles of the legend."""
    from matplotlib.lines import Line2D

    decisions = np.array([row[column] for row in verification.decision], dtype=object)
    errors = np.degrees(verification.errors[:, column])
    spread = COVERAGE_FACTOR * np.degrees(verification.u[:, column])
    handles: list[object] = []
    looks = {
        "pass": ("o", SERIES[0]),
        "inconclusive": ("s", SERIES[1]),
        "fail": ("X", BAD),
        "not judged": ("D", SERIES[7]),
    }
    for name, (marker, colour) in looks.items():
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


def verification_report(verification: Verification) -> str:
    """A verification as one self-contained HTML page: verdict, errors against limits, table.

    Parameters
    ----------
    verification : Verification
        As `inclinometry.calibration.acceptance.verify` returns it.

    Returns
    -------
    str
        HTML without any reference outside itself. The same input gives the same text.

    Examples
    --------
    >>> one = np.radians([[0.02, 0.1, 0.05]])
    >>> found = Verification(["1"], np.zeros((1, 3)), np.zeros(1), one, one / 4, 2 * one, [["pass"] * 3], 2.0, "pass",
    ...                      ["every judged angle is within its limit"], "shop", "our own limits", "A7")
    >>> page = verification_report(found)
    >>> "PASS" in page, "FAIL" in page
    (True, False)
    """
    passed = verification.verdict == "pass"
    band = "; shaded: guard band" if any("inconclusive" in row for row in verification.decision) else ""
    errors, curves = [], []
    for column, angle in enumerate(verification.names):
        if not np.isfinite(verification.errors[:, column]).any():
            continue
        slug = angle.replace(" ", "")
        caption = f"Error of {angle} at each station, bars U (k = {COVERAGE_FACTOR:g}); red: limits{band}"
        errors.append(picture(station_figure(verification, column), f"station{slug}", caption))
        # errors over fewer than four settings of an angle are no curve; the stations show them
        if settings(verification, column) >= 4:
            caption = f"Error curve: error of {angle} over its setting"
            curves.append(picture(curve_figure(verification, column), f"curve{slug}", caption))
    name = verification.tool or "Tool without a name"
    count, tool = len(verification.station), verification.tool or "the tool"
    kept = "keeps" if verification.verdict == "pass" else "does not keep"
    where = f"{count} independent position{'s' * (count != 1)}"
    facts = [
        ("Tool", verification.tool or "not named"),
        ("Positions", str(len(verification.station))),
        ("Limits", verification.limits_name),
        ("Source of the limits", verification.limits_source or "not stated"),
        ("Coverage factor", f"k = {verification.coverage_factor:.3g}"),
    ]
    return render(
        "report.html",
        about="What was judged",
        title=f"Verification of {verification.tool or 'a tool'}",
        kind="Verification report",
        heading=name,
        conventions=CONVENTIONS,
        # green only when nothing below speaks against relying on it
        state="bad" if not passed else "warn" if verification.warnings else "good",
        badge=verification.verdict.upper() + (", with reservations" if passed and verification.warnings else ""),
        verdict=f"{tool[:1].upper()}{tool[1:]} {kept} the limits “{verification.limits_name}” at {where}.",
        notes=[f"{said[:1].upper()}{said[1:]}." for said in (*verification.reasons, *verification.notes)],
        warnings=list(verification.warnings),
        sections=[
            Section(
                "Errors against limits",
                [_rule(verification)],
                tables=[_summary(verification)],
                pictures=errors,
            ),
            Section(
                "Error curves",
                pictures=curves,
            ),
            Section("Every position", tables=[cut(_table(verification))]),
        ],
        facts=facts + [(f"Digest of {name}", digest) for name, digest in verification.inputs.items()],
    )


def _summary(verification: Verification) -> Table:
    """Per angle: largest error, its limit, counts of the decisions."""
    body = []
    for column, name in enumerate(verification.names):
        if name == "-":
            continue
        decisions = [row[column] for row in verification.decision]
        judged = np.array([d != "not judged" for d in decisions], dtype=bool)
        error = np.degrees(verification.errors[judged, column])
        u = np.degrees(verification.u[judged, column])
        if not len(error):
            body.append(TableRow([name, "not judged", "", "", "", "0", "0", "0"]))
            continue
        worst = int(np.argmax(np.abs(error)))
        limits = np.degrees(verification.limits[judged, column])
        low, high = (significant(float(v), 3) for v in (limits.min(), limits.max()))
        counts = [str(decisions.count(d)) for d in ("pass", "inconclusive", "fail")]
        state = "bad" if "fail" in decisions else "warn" if "inconclusive" in decisions else ""
        cells = [
            _signed(float(error[worst]), float(u[worst])),
            significant(float(np.sqrt(np.mean(error**2)))),
            significant(verification.coverage_factor * float(np.median(u))),
            low if low == high else f"{low} to {high}",
        ]
        body.append(TableRow([name, *cells, *counts], state))
    head = [
        "angle",
        "largest error, deg",
        "rms, deg",
        "U (median), deg",
        "limit ±, deg",
        "pass",
        "inconclusive",
        "fail",
    ]
    return Table(f"Errors over all judged positions; U with k = {verification.coverage_factor:.3g}", head, body)


def _signed(value: float, u: float) -> str:
    text = rounded(value, u)
    return text if text.startswith("-") or not np.isfinite(value) else f"+{text}"


def _rule(verification: Verification) -> str:
    """How an error is held against its limit, for the section that draws both."""
    bars = f"Bars are U of the comparison, k = {COVERAGE_FACTOR:g}: tool, noise and stand together."
    if np.isfinite(verification.limits).any() and verification.limits_source == DERIVED:
        return (
            f"Each error passes within its own limit of k u, k = {verification.coverage_factor:.3g} for the number of "
            f"errors judged; no guard band. {bars}"
        )
    if any("inconclusive" in row for row in verification.decision):
        return f"An error passes within the limit less its own U, the guard band (JCGM 106:2012, 8.3). {bars}"
    return (
        "An error passes within the limit, whatever its bar (JCGM 106:2012, 8.2), or, where a guard band was asked "
        f"for, within the limit less its own U. {bars}"
    )


def _table(verification: Verification) -> Table:
    """A line a station: settings, error and expanded uncertainty of each angle, decisions."""
    dials = np.degrees(verification.dials)
    errors, spread = np.degrees(verification.errors), np.degrees(verification.u)
    rows = []
    for k, station in enumerate(verification.station):
        cells = [plain(v) for v in dials[k]]
        for column in range(3):
            error, u = float(errors[k, column]), float(spread[k, column])
            limit = float(np.degrees(verification.limits[k, column]))
            defined = u < 30.0  # beyond, the tool hangs vertically
            cells += (
                [_signed(error, u), significant(verification.coverage_factor * u)] if defined else ["undefined", ""]
            )
            cells += [f"{limit:.3g}" if np.isfinite(limit) else "", verification.decision[k][column]]
        worst = [{"fail": "bad", "inconclusive": "warn"}.get(d, "") for d in verification.decision[k]]
        state = "bad" if "bad" in worst else "warn" if "warn" in worst else ""
        rows.append(TableRow([station, *cells], state))
    head = ["station", "azimuth set", "inclination set", "toolface set"]
    for name in verification.names:
        head += [f"error of {name}", "U", "limit ±", "decision"]
    return Table(f"All positions, deg; U with k = {verification.coverage_factor:.3g}", head, rows)
