"""The report of a verification."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from inclinometry.calibration.conformity import Verification
from inclinometry.calibration.decision import AGREES, DISAGREES
from inclinometry.constants import COVERAGE_FACTOR
from inclinometry.findings import only_notes, without_notes
from inclinometry.language import label, said
from inclinometry.report.figure import BAD, INK, SERIES, panel, station_axis
from inclinometry.report.page import Section, Table, TableRow, limit_rows, picture, report
from inclinometry.report.words import plain, rounded, significant

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DIAL_COLUMN = (1, 0, 2)
"""Where the dials hold inclination, azimuth, toolface."""


@panel(3.3, y="error, deg")
def station_figure(axes: Axes, verification: Verification, column: int) -> None:
    """Error of one angle at each station with its expanded uncertainty, limits and guard bands."""
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
    station_axis(axes, list(verification.station))
    axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.2)


@panel(2.8, y="error, deg")
def curve_figure(axes: Axes, verification: Verification, column: int) -> None:
    """Error of one angle over its own setting, the error curve of the instrument."""
    x = np.degrees(verification.dials[:, DIAL_COLUMN[column]])
    _errors(axes, x, verification, column)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    axes.set_ylim(*_reach(verification, column))
    axes.set_xlabel(label("{value} set, deg", value=("inclination", "azimuth", "toolface")[column]))


def settings(verification: Verification, column: int) -> int:
    """At how many settings of its own an angle was judged."""
    judged = verification.judged[:, column]
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
        AGREES: ("o", SERIES[0]),
        "inconclusive": ("s", SERIES[1]),
        "fail": ("X", BAD),
        DISAGREES: ("X", BAD),
        "not judged": ("D", SERIES[7]),
    }
    for name, (marker, colour) in looks.items():
        rows = decisions == name
        if rows.any():
            # the bars of a vertical tool's azimuth would cross the whole drawing
            bars = None if name == "not judged" else spread[rows]
            axes.errorbar(x[rows], errors[rows], bars, linestyle="none", marker=marker, color=colour, elinewidth=1.1)
            handles.append(
                Line2D([], [], linestyle="none", marker=marker, color=colour, label=f"{label(name)} ({rows.sum()})")
            )
    return handles


def _reach(verification: Verification, column: int) -> tuple[float, float]:
    """Limits of the y axis: everything that was judged fits in; what was not judged must not hide it."""
    judged = verification.judged[:, column]
    if not judged.any():
        judged = np.isfinite(verification.errors[:, column])
    error, u = np.degrees(verification.errors[judged, column]), np.degrees(verification.u[judged, column])
    limit = np.degrees(
        np.where(np.isfinite(verification.limits[judged, column]), verification.limits[judged, column], 0)
    )
    top = 1.1 * float(max(limit.max(initial=0.0), (np.abs(error) + COVERAGE_FACTOR * u).max(initial=1e-6)))
    return -top, top


def verification_report(verification: Verification) -> str:
    """A verification as one self-contained HTML page: verdict, errors with limits or their uncertainty, table."""
    passed, agreed = verification.accepted, bool(verification.limits_name)
    band = "; shaded: guard band" if any("inconclusive" in row for row in verification.decision) else ""
    errors, curves = [], []
    for column, angle in enumerate(verification.names):
        if not np.isfinite(verification.errors[:, column]).any():
            continue
        slug = angle.replace(" ", "")
        caption = (
            label(
                "Error of {angle} at each station, bars U (k = {k:g})",
                angle=angle,
                k=COVERAGE_FACTOR,
            )
            + label("; red: limits{band}", band=band) * agreed
        )
        errors.append(picture(station_figure(verification, column), f"station{slug}", caption))
        # errors over fewer than four settings of an angle are no curve; the stations show them
        if settings(verification, column) >= 4:
            caption = label("Error curve: error of {angle} over its setting", angle=angle)
            curves.append(picture(curve_figure(verification, column), f"curve{slug}", caption))
    count, tool = len(verification.station), verification.tool or "The tool"
    where = label("{count} independent positions", count=count)
    if agreed:
        keeps = "{tool} keeps the limits “{limits}” at {where}."
        fails = "{tool} does not keep the limits “{limits}” at {where}."
        verdict = label(keeps if passed else fails, tool=tool, limits=verification.limits_name, where=where)
    else:
        verdict = label(
            "{tool} {verdict} with its calibration at {where}. No limits were agreed.",
            tool=tool,
            verdict=verification.verdict,
            where=where,
        )
    facts = [
        ("Tool", verification.tool or "not named"),
        ("Positions", str(len(verification.station))),
        ("Limits", verification.limits_name or "none agreed"),
        *([("Source of the limits", verification.limits_source or "not stated")] if agreed else []),
        ("Coverage factor", f"k = {verification.coverage_factor:.3g}"),
    ]
    word, warned = label(verification.verdict).upper(), without_notes(verification.findings)
    return report(
        "Verification report",
        label("Verification of {value}", value=verification.tool or "a tool"),
        verdict,
        [
            Section(
                "Errors against limits" if agreed else "Agreement with the certificate",
                [_rule(verification)],
                tables=[_summary(verification)],
                pictures=errors,
            ),
            Section("Error curves", pictures=curves),
            Section("Every position", tables=[limit_rows(_table(verification))]),
        ],
        facts,
        about="What was judged",
        heading=verification.tool or "Tool without a name",
        # green only when nothing below speaks against relying on it
        states=[
            (not passed, "bad", word),
            (warned or verification.reservations, "warn", label("{word}, with reservations", word=word)),
            (True, "good", word),
        ],
        notes=said(only_notes(verification.findings)),
        warnings=said(warned),
        inputs=verification.inputs,
    )


def _summary(verification: Verification) -> Table:
    """Per angle: largest error, counts of the decisions, and where limits were agreed these."""
    body, agreed = [], bool(verification.limits_name)
    words = ("pass", "inconclusive", "fail") if agreed else (AGREES, DISAGREES)
    for column, name in enumerate(verification.names):
        if name == "-":
            continue
        judged = verification.judged[:, column]
        if not judged.any():
            body.append(TableRow([name, "not judged", "", "", *[""] * agreed, *["0"] * len(words)]))
            continue
        decisions = [row[column] for row in verification.decision]
        error, u, limits = (
            np.degrees(x[judged, column]) for x in (verification.errors, verification.u, verification.limits)
        )
        worst = int(np.argmax(np.abs(error)))
        low, high = (significant(float(v), 3) for v in (limits.min(), limits.max()))
        cells = [
            _signed(float(error[worst]), float(u[worst])),
            significant(float(np.sqrt(np.mean(error**2)))),
            significant(verification.coverage_factor * float(np.median(u))),
            *([low if low == high else label("{low} to {high}", low=low, high=high)] if agreed else []),
            *(str(decisions.count(word)) for word in words),
        ]
        body.append(TableRow([name, *cells], _state(decisions)))
    head = ["angle", "largest error, deg", "rms, deg", "U (median), deg", *["limit ±, deg"] * agreed, *words]
    return Table(
        label(
            "Errors over all judged positions; U with k = {k:.3g}",
            k=verification.coverage_factor,
        ),
        head,
        body,
    )


def _state(decisions: Sequence[str]) -> str:
    if "fail" in decisions or DISAGREES in decisions:
        return "bad"
    return "warn" if "inconclusive" in decisions else ""


def _signed(value: float, u: float) -> str:
    text = rounded(value, u)
    return text if text.startswith("-") or not np.isfinite(value) else f"+{text}"


def _rule(verification: Verification) -> str:
    """How an error is compared with its limit, for the section that draws both."""
    bars = label(
        "Bars are U of the comparison, k = {k:g}: tool, noise and stand together.",
        k=COVERAGE_FACTOR,
    )
    if not verification.limits_name:
        return f"{label('No limits were agreed and no conformity is stated.')} {bars}"
    if any("inconclusive" in row for row in verification.decision):
        guarded = "An error passes within the limit less its own U, the guard band (JCGM 106:2012, 8.3)."
        return f"{label(guarded)} {bars}"
    simple = "An error passes within the limit, whatever its bar (JCGM 106:2012, 8.2)."
    return f"{label(simple)} {bars}"


def _table(verification: Verification) -> Table:
    """A line a station: settings, error and expanded uncertainty of each angle, decisions."""
    dials = np.degrees(verification.dials)
    errors, spread = np.degrees(verification.errors), np.degrees(verification.u)
    rows, agreed = [], bool(verification.limits_name)
    for k, station in enumerate(verification.station):
        cells = [plain(v) for v in dials[k]]
        for column in range(3):
            error, u = float(errors[k, column]), float(spread[k, column])
            limit = float(np.degrees(verification.limits[k, column]))
            defined = u < 30.0  # beyond, the tool hangs vertically
            cells += (
                [_signed(error, u), significant(verification.coverage_factor * u)] if defined else ["undefined", ""]
            )
            cells += [f"{limit:.3g}" if np.isfinite(limit) else ""] * agreed + [verification.decision[k][column]]
        rows.append(TableRow([station, *cells], _state(verification.decision[k])))
    head = ["station", "azimuth set", "inclination set", "toolface set"]
    for name in verification.names:
        head += [label("error of {name}", name=name), "U", *["limit ±"] * agreed, "decision" if agreed else "agreement"]
    return Table(
        label("All positions, deg; U with k = {k:.3g}", k=verification.coverage_factor),
        head,
        rows,
    )
