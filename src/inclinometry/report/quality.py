"""The quality of six-axis stations on a page: gravity, magnetic field and dip against their limits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from inclinometry.arrays import Array, Mask
from inclinometry.language import label, said
from inclinometry.report.figure import BAD, INK, SERIES, legend_above, panel
from inclinometry.report.page import Picture, Table, TableRow, picture
from inclinometry.report.survey_figures import thinned
from inclinometry.report.words import significant
from inclinometry.survey.flags import Check
from inclinometry.survey.quality import QUANTITIES, FieldQuality, Quantity

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def quality_pictures(
    quality: FieldQuality, before: FieldQuality | None = None, corrected: Array | None = None
) -> list[Picture]:
    """Gravity, field, dip and the three together over depth, against their limits; `before` correction beside them.

    `corrected` is the reference as an analysis corrects it: g (m/s^2), b (nT), dip (rad).
    """
    moved = [None] * 3 if corrected is None else [float(value) for value in corrected]
    found = []
    for column, name in enumerate(("gravity", "b", "dip")):
        what = QUANTITIES[column].name
        quantity = what[0].upper() + what[1:]
        caption = label("{quantity} against the reference; shaded: what is allowed", quantity=quantity)
        figure = fields_figure(quality, column, before, moved[column])
        found.append(picture(figure, f"quality{name}", caption))
    if np.isfinite(quality.distance).any():
        caption = "The three together: distance from the reference in standard deviations"
        found.append(picture(distance_figure(quality, before), "qualitydistance", caption))
    return found


@panel(3.0, "measured depth, m")
def fields_figure(
    axes: Axes, quality: FieldQuality, column: int, before: FieldQuality | None = None, corrected: float | None = None
) -> None:
    """One of the three quantities with its reference and the band of what is allowed at each station."""
    factor = QUANTITIES[column].factor
    rows = thinned(len(quality.md))
    md, reference = quality.md[rows], factor * float(quality.reference.values[column])
    allowed = factor * np.where(quality.judged[rows, column], quality.limit[rows, column], np.nan)
    if len(md) > 1:
        axes.fill_between(md, reference - allowed, reference + allowed, color=SERIES[2], alpha=0.17, linewidth=0.0)
    else:
        axes.errorbar(md, [reference], yerr=np.nan_to_num(allowed), color=SERIES[2], alpha=0.5, linewidth=6.0)
    axes.axhline(reference, color=SERIES[2], linestyle="--", label="reference")
    if corrected is not None:
        axes.axhline(factor * corrected, color=INK, linestyle=":", linewidth=1.2, label="reference, corrected")
    mark = len(md) <= 80
    if before is not None:
        look: dict[str, Any] = {"color": SERIES[1], "linestyle": "-." if mark else ":", "marker": "s" if mark else None}
        axes.plot(md, factor * before.found[rows, column], label="before", markersize=3.0, alpha=0.8, **look)
    label = "measured" if before is None else "corrected"
    axes.plot(md, factor * quality.found[rows, column], color=SERIES[0], marker="o" if mark else None, label=label)
    check = quality.checks[column]
    failed = np.zeros(len(quality.md), dtype=bool)
    failed[list(check.stations if check.verdict == "fail" else ())] = True
    _crosses(axes, quality, factor * quality.found[:, column], failed)
    axes.ticklabel_format(axis="y", useOffset=False)
    axes.set_ylabel(("total gravity, m/s²", "total field, nT", "dip, deg")[column])
    wide = 2 if before is not None and corrected is not None else 3
    legend_above(axes, wide)


@panel(3.0, "measured depth, m", "distance, σ")
def distance_figure(axes: Axes, quality: FieldQuality, before: FieldQuality | None = None) -> None:
    """Mahalanobis distance of the three quantities from their reference, with its limit."""
    rows = thinned(len(quality.md))
    md, mark = quality.md[rows], len(rows) <= 80
    if before is not None:
        look: dict[str, Any] = {"color": SERIES[1], "linestyle": "-." if mark else ":", "marker": "s" if mark else None}
        axes.plot(md, before.distance[rows], label="before", markersize=3.0, alpha=0.8, **look)
    label = "measured" if before is None else "corrected"
    axes.plot(md, quality.distance[rows], color=SERIES[0], marker="o" if mark else None, label=label)
    axes.plot(md, quality.distance_limit[rows], color=SERIES[2], linestyle="--", label="allowed")
    _crosses(axes, quality, quality.distance, quality.distance > quality.distance_limit)
    axes.set_ylim(bottom=0.0)
    legend_above(axes, 4)


def _crosses(axes: Any, quality: FieldQuality, values: Array, failed: Mask) -> None:
    if failed.any():
        look: dict[str, Any] = {"linestyle": "none", "marker": "X", "color": BAD, "markersize": 6.5, "label": "beyond"}
        axes.plot(quality.md[failed], values[failed], **look)


def check_table(checks: Sequence[Check]) -> Table:
    """Every check with its figures and its reason."""
    states = {"pass": "", "not judged": "warn", "fail": "bad"}
    body = []
    units = {"rad": ("deg", 180.0 / np.pi), "rad/s": ("deg/h", 180.0 / np.pi * 3600.0), "m/s^2": ("m/s²", 1.0)}
    for check in checks:
        unit, factor = units.get(check.unit, (check.unit, 1.0))
        sizes = (check.value * factor, check.limit * factor)
        value, limit = (significant(size, 3) if np.isfinite(size) else "-" for size in sizes)
        cells = [check.name, check.verdict, said([check.reason])[0], value, limit, unit]
        body.append(TableRow(cells, states[check.verdict]))
    head = ["check", "verdict", "what was found", "value", "limit", "unit"]
    return Table("Checks of the run", head, body, text_columns=3)


def _cells(quality: FieldQuality, row: int, column: int, quantity: Quantity) -> list[str]:
    difference = f"{quality.difference[row, column] * quantity.factor:+.{quantity.digits}f}"
    if not quality.judged[row, column]:
        return [difference, "-"]
    return [difference, f"{quality.limit[row, column] * quantity.factor:.{quantity.digits}f}"]
