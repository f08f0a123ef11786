"""The report of a casing: displacement profiles with their band, check-sums, the budget of uncertainty."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from inclinometry.constants import COVERAGE_FACTOR
from inclinometry.findings import Finding
from inclinometry.language import label, number, said
from inclinometry.report.figure import BAD, DASHES, MARKERS, SERIES, legend_above, panel
from inclinometry.report.page import Section, Table, TableRow, limit_rows, picture, report
from inclinometry.report.words import listed, rounded, significant
from inclinometry.survey.displacement import AxisDisplacement, CheckSums, Displacement

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from inclinometry.arrays import Array

SIGN = (
    "Axes: a displacement is positive towards the groove that a positive A0, or B0, leans to. u: standard "
    "uncertainty (k = 1); U = k u: expanded."
)


def displacement_report(
    base: str,
    base_sums: Mapping[str, CheckSums | None],
    found: Mapping[str, Displacement],
    findings: Sequence[Finding] = (),
    inputs: Mapping[str, str] | None = None,
    base_depth: Array | None = None,
) -> str:
    """Displacements of a casing, by name of the later reading, as one self-contained HTML page.

    base_depth : (m,) of the base reading, m; without it those of the first later one.
    """
    last = list(found)[-1]
    axes = list(found[last].axes)
    at = next(iter(found.values())).depth[:-1] if base_depth is None else base_depth
    notes, warnings = (said(f for f in findings if (f.severity == "note") is note) for note in (True, False))
    state = "warn" if warnings else "good"
    spikes = sum(int(one.spikes.sum()) for each in found.values() for one in each.axes.values())
    single = any(one.sums is None for each in found.values() for one in each.axes.values())
    band = label("shaded: expanded uncertainty (k = {k:g}) of {last}", k=COVERAGE_FACTOR, last=last)
    return report(
        "Displacement report",
        "Displacement of a casing",
        _sentence(last, found[last]),
        [
            Section(
                "Displacement since the base reading",
                pictures=[
                    picture(
                        profile_figure(found, axis),
                        f"profile{axis}",
                        label("Axis {upper}; {band}", upper=axis.upper(), band=band),
                    )
                    for axis in axes
                ],
            ),
            Section(
                "Check-sums",
                pictures=[
                    picture(
                        sums_figure(base, base_sums, at, found, axis),
                        f"sums{axis}",
                        label("Axis {upper}: {upper}0 + {upper}180", upper=axis.upper()),
                    )
                    for axis in axes
                    if base_sums[axis] is not None
                ],
            ),
            Section("Where the uncertainty comes from", tables=[_budget(found)]),
            Section(label("Profile of {last}", last=last), tables=[limit_rows(_table(found[last]))]),
        ],
        [
            ("Base reading", base),
            ("Later readings", label(", ").join(found)),
            ("Step", label("{length:g} m", length=found[last].step)),
            ("Fixed end", found[last].fixed),
        ],
        about="What was read",
        conventions=SIGN,
        states=[
            (spikes, state, label("Spikes in the check-sums: {count}", count=spikes)),
            (bool(warnings), state, "Read the warnings"),
            (single, state, "Single runs without check-sums"),
            (True, state, "No spikes in the check-sums"),
        ],
        notes=notes,
        warnings=warnings,
        inputs=inputs,
    )


def _sentence(name: str, found: Displacement) -> str:
    def words(axis: str, one: AxisDisplacement) -> str:
        row = int(np.argmax(np.abs(one.displacement)))
        u = 1000.0 * float(one.u[row])
        band = f" ± {number(significant(COVERAGE_FACTOR * u))}" if np.isfinite(u) else label(", uncertainty not known")
        return label(
            "{axis} {displacement}{band} mm at {depth:g} m",
            axis=axis.upper(),
            displacement=rounded(1000.0 * float(one.displacement[row]), u),
            band=band,
            depth=found.depth[row],
        )

    parts = listed([words(axis, one) for axis, one in found.axes.items()])
    return label(
        "{name}: the largest displacements are {parts} (expanded, k = {k:g}, about 95 %).",
        name=name,
        parts=parts,
        k=COVERAGE_FACTOR,
    )


@panel(5.6, y="depth, m")
def profile_figure(axes: Axes, found: Mapping[str, Displacement], axis: str) -> None:
    """Displacement over depth, depth downwards, the last reading with its band of expanded uncertainty."""
    for n, (name, one) in enumerate(found.items()):
        moved = 1000.0 * one.axes[axis].displacement
        colour = SERIES[n % len(SERIES)]
        if n == len(found) - 1:
            band = COVERAGE_FACTOR * 1000.0 * one.axes[axis].u
            axes.fill_betweenx(one.depth, moved - band, moved + band, color=colour, alpha=0.25, linewidth=0.0)
        few = len(one.depth) <= 80
        look: dict[str, Any] = {
            "marker": MARKERS[n % len(MARKERS)] if few else "",
            "linestyle": DASHES[n // len(SERIES) % len(DASHES)],
        }
        axes.plot(moved, one.depth, color=colour, markersize=3.0, label=name, **look)
    axes.invert_yaxis()
    axes.set_xlabel(label("displacement {axis}, mm", axis=axis.upper()))
    legend_above(axes, 2)


@panel(4.6, y="depth, m")
def sums_figure(
    axes: Axes,
    base: str,
    base_sums: Mapping[str, CheckSums | None],
    base_depth: Array,
    found: Mapping[str, Displacement],
    axis: str,
) -> None:
    """Check-sums over depth in mm a step, spikes marked."""
    step = next(iter(found.values())).step
    later = ((name, one.depth[:-1], one.axes[axis].sums) for name, one in found.items())
    for n, (name, depth, sums) in enumerate([(base, base_depth, base_sums[axis]), *later]):
        if sums is not None:
            axes.plot(1000.0 * step * sums.values, depth, color=SERIES[n % len(SERIES)], label=name)
    for one in found.values():
        moved = one.axes[axis]
        if moved.sums is not None and moved.spikes.any():
            values = 1000.0 * one.step * moved.sums.values[moved.spikes]
            axes.plot(values, one.depth[:-1][moved.spikes], linestyle="none", marker="X", color=BAD, markersize=6.5)
    axes.invert_yaxis()
    axes.set_xlabel(label("check-sum {axis}, mm", axis=axis.upper()))
    legend_above(axes, 2)


def _budget(found: Mapping[str, Displacement]) -> Table:
    body = []
    for name, each in found.items():
        for axis, one in each.axes.items():
            for what, part in {**one.components, "together": one.u}.items():
                u = significant(1000.0 * float(part[0 if each.fixed == "bottom" else -1]))
                body.append(TableRow([label(", ").join((name, axis.upper(), label(what))), u]))
    return Table("Standard uncertainty at the end that is free to move", ["reading, axis, source", "u, mm"], body)


def _table(found: Displacement) -> Table:
    rows = []
    for row, depth in enumerate(found.depth.tolist()):
        cells = [f"{depth:g}"]
        spike = False
        for one in found.axes.values():
            u = 1000.0 * float(one.u[row])
            cells += [rounded(1000.0 * float(one.displacement[row]), u), significant(COVERAGE_FACTOR * u)]
            spike |= row < len(one.spikes) and bool(one.spikes[row])
        rows.append(TableRow([*cells, "spike" if spike else ""], "warn" if spike else ""))
    head = ["depth, m"]
    for axis in found.axes:
        head += [label("{upper}, mm", upper=axis.upper()), "U, mm"]
    return Table(label("Displacement; U: k = {k:g}", k=COVERAGE_FACTOR), [*head, "Check-sum"], rows)
