"""The report of a multi-station analysis."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.constants import COVERAGE_FACTOR
from inclinometry.findings import Finding
from inclinometry.language import label, number, said
from inclinometry.orientation import angles, angles_jacobian
from inclinometry.report.figure import BAD, INK, SERIES, legend_above, matrix_axes, new_figure, panel, styled
from inclinometry.report.page import Section, Table, TableRow, limit_rows, picture, report
from inclinometry.report.quality import quality_pictures
from inclinometry.report.survey_figures import thinned
from inclinometry.report.words import listed, parameter_name, plain, significant, with_uncertainty, worst_and_median
from inclinometry.rotations import wrap_signed
from inclinometry.survey.multistation import SOURCE, MultiStation
from inclinometry.survey.quality import BLIND, QUANTITIES, FieldQuality, judge_fields
from inclinometry.survey.stations import Stations
from inclinometry.uncertainty import UNKNOWN

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def drawn(found: MultiStation) -> list[str]:
    """Parameters worth drawing: those with a prior variance."""
    return [name for name, p in found.parameters.items() if p.prior > 0.0]


@styled
def estimate_figure(found: MultiStation, labels: dict[str, str]) -> Figure:
    """Each estimate with U, in standard deviations of its prior; the shaded band is what was known before."""
    far = 4.0  # prior standard deviations drawn; an estimate farther out is drawn at the edge with its number
    names = drawn(found)
    figure = new_figure(0.9 + 0.24 * len(names))
    axes = figure.add_subplot()
    before = label("known before (k = {k:g})", k=COVERAGE_FACTOR)
    axes.axvspan(-COVERAGE_FACTOR, COVERAGE_FACTOR, color=SERIES[7], alpha=0.15, linewidth=0.0, label=before)
    ends = [2.6]
    axes.axvline(0.0, color=INK, alpha=0.5, linewidth=0.8)
    for row, name in enumerate(names):
        p = found.parameters[name]
        at, spread = p.value / p.prior, COVERAGE_FACTOR * p.u / p.prior
        ends.append(abs(at) + spread)
        sure = p.significance > COVERAGE_FACTOR
        look: dict[str, Any] = {"color": SERIES[1] if sure else SERIES[0], "marker": "s" if sure else "o"}
        axes.errorbar([np.clip(at, -far, far)], [row], xerr=[spread], linestyle="none", capsize=2.5, **look)
        if abs(at) > far:
            axes.annotate(f"{at:+.1f}", (np.sign(at) * far, row), (0.0, 4.0), textcoords="offset points", ha="center")
    axes.set_yticks(range(len(names)), [labels[name] for name in names])
    axes.set_ylim(len(names) - 0.4, -0.6)
    reach = min(far + 0.6, max(ends))
    axes.set_xlim(-reach, reach)
    axes.set_xlabel("estimate ± U, in standard deviations of its prior")
    legend_above(axes, 1)
    return figure


@styled
def correlation_figure(found: MultiStation, labels: dict[str, str]) -> Figure:
    """Correlation of the parameters after the analysis; blue together, orange against each other."""
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.patches import Rectangle

    names = drawn(found)
    places = [list(found.parameters).index(name) for name in names]
    matrix = found.correlation[np.ix_(places, places)]
    figure = new_figure(4.6)
    axes = figure.add_subplot()
    # one rectangle a cell keeps the colours those of the page; blank near zero
    tints = LinearSegmentedColormap.from_list("sign", [SERIES[1], "#ffffff", SERIES[0]])
    for i, row in enumerate(matrix):
        for j, value in enumerate(row):
            if abs(value) < 0.05:
                continue
            size = 0.96 * float(np.sqrt(abs(value)))
            colour = tints(1.0 if value > 0.0 else 0.0)
            axes.add_patch(Rectangle((j - size / 2.0, i - size / 2.0), size, size, facecolor=colour, linewidth=0.0))
    matrix_axes(axes, [labels[name] for name in names])
    return figure


@panel(3.0, "measured depth of the station left out, m", "largest change, deg")
def influence_figure(axes: Axes, found: MultiStation) -> None:
    """How far the azimuths would move without each station."""
    md, moved = found.corrected.md, np.degrees(found.influence)
    rows = thinned(len(md))
    axes.vlines(md[rows], 0.0, moved[rows], color=SERIES[0], linewidth=1.4)
    axes.plot(md[rows], moved[rows], linestyle="none", marker="o", color=SERIES[0], markersize=3.5)
    worst = int(np.argmax(moved))
    axes.plot(md[worst], moved[worst], linestyle="none", marker="o", color=BAD, markersize=5.0)
    axes.set_ylim(bottom=0.0)


@panel(3.0, "measured depth, m", "azimuth, deg")
def azimuth_figure(axes: Axes, found: MultiStation, before: Stations, u_before: Array, u_after: Array) -> None:
    """Change of azimuth by the correction, with the uncertainty that remains (NaN: not drawn), and that before."""
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
    legend_above(axes, 3)


# The parameters of a multi-station analysis in words, and what a run could not tell of them.

VAGUE: Final = float(np.radians(30.0))
"""Standard uncertainty from which an azimuth is none: the station is vertical."""


def described(name: str) -> str:
    """A parameter in words: a term of a tool code (MBZ), one of `parameter_names`, or of the reference."""
    if name == "MBZ":
        return label("axial magnetometer zero (interference included)")
    patterns = (r"([AM])([BS])([XYZ])", r"M([XYZ])([XYZ])", r"reference (g|b|dip)")
    term, cross, reference = (re.fullmatch(pattern, name) for pattern in patterns)
    if term:
        kind = {"A": "accelerometer", "M": "magnetometer"}[term[1]]
        return label("{kind} {axis} zero" if term[2] == "B" else "{kind} {axis} scale", kind=kind, axis=term[3])
    if cross:
        return label("{kind} {axis} cross-axis {other}", kind="magnetometer", axis=cross[1], other=cross[2])
    if reference:
        return label("{reference} of the reference", reference=reference[1])
    interference = re.fullmatch(r"(?:axial|transverse) interference ?([xy]?)", name)
    if interference:
        across = {"x": "magnetic interference along x", "y": "magnetic interference along y"}
        return label(across.get(interference[1], "axial magnetic interference of the assembly"))
    return parameter_name(name)


def unit_of(unit: str) -> tuple[str, float]:
    """Unit for the reader and what one of the inner unit is there.

    Examples
    --------
    >>> unit_of("m/s^2"), unit_of("1"), unit_of("nT")[0]
    (('m/s²', 1.0), ('', 1.0), 'nT')
    """
    if unit == "rad":
        return "deg", float(180.0 / np.pi)
    return {"m/s^2": "m/s²", "1": ""}.get(unit, unit), 1.0


def labels(found: MultiStation) -> dict[str, str]:
    """Short names of the parameters that have a prior variance, for drawings."""
    drawn = [name for name, p in found.parameters.items() if p.prior > 0.0]
    return {name: parameter_name(name, short=True) for name in drawn}


def blind_spots(found: MultiStation, after: FieldQuality, u_azimuth: Array) -> list[str]:
    """What the stations do not determine, a sentence each."""
    learned = 0.2  # share of its prior variance below which a parameter counts as not told by the run
    known = {name: p for name, p in found.parameters.items() if p.prior > 0.0}
    lines = []
    untold = [name for name, p in known.items() if p.learned < learned]
    if untold:
        few = (
            listed([described(name) for name in untold])
            if len(untold) <= 6
            else label("{count} of {total} parameters (see the table)", count=len(untold), total=len(known))
        )
        names = "all parameters" if len(untold) == len(known) else few
        lines.append(
            label(
                "The run removed less than {learned:.0f} % of the prior variance of {names}: their values and "
                "uncertainties are those of the priors, not of the run.",
                learned=100.0 * learned,
                names=names,
            )
        )
    keys, matrix = list(found.parameters), found.correlation
    # beyond a correlation of 0.95 two parameters are one to the run
    pairs = [
        label("{one} and {other}", one=described(keys[j]), other=described(keys[i]))
        for i in range(len(keys))
        for j in range(i)
        if abs(matrix[i, j]) > 0.95 and keys[i] in known and keys[j] in known
    ]
    if pairs:
        lines.append(label("The run sees but one combination of {pairs}.", pairs=listed(pairs[:6])))
    hidden = after.undetected_azimuth
    if (np.nan_to_num(hidden) > BLIND).any():
        row = int(np.nanargmax(hidden))
        size = f"{significant(float(np.degrees(hidden[row])))}°" if np.isfinite(hidden[row]) else "any size"
        lines.append(
            label(
                "At {md:g} m, one station by itself, an axial interference that turns azimuth by {size} would "
                "pass the checks of field and dip; the run as a whole sees more, as the uncertainty of azimuth "
                "says.",
                md=after.md[row],
                size=size,
            )
        )
    able = u_azimuth < VAGUE
    if able.any():
        row = int(np.argmax(np.where(able, u_azimuth, -1.0)))
        u = significant(float(np.degrees(u_azimuth[row])))
        lines.append(
            label(
                "Azimuth remains least known at {md:g} m: u = {u}° (sensors and their correction; declination, "
                "misalignment in the hole and sag are not in it).",
                md=after.md[row],
                u=u,
            )
        )
    lines.append("The declination does not show in gravity, field strength or dip: no analysis of these can check it.")
    return lines


def msa_report(
    found: MultiStation,
    before: Stations,
    quality: FieldQuality,
    *,
    tool: str = "",
    findings: Sequence[Finding] = (),
    inputs: Mapping[str, str] | None = None,
) -> str:
    """A multi-station analysis as one self-contained HTML page; `before`, `quality`: of its input stations."""
    after = judge_fields(found.corrected, quality.reference, k=quality.k, limits=quality.limits)
    u_before, u_after = (azimuth_u(stations) for stations in (before, found.corrected))
    names = labels(found)
    noted, told = (
        said(f for f in (*findings, *found.findings) if (f.severity == "note") is note) for note in (True, False)
    )
    shift = np.array([found.parameters[f"reference {name}"].value for name in ("g", "b", "dip")])
    signs = "Correlation after the analysis: blue positive, orange negative; area by size, blank below 0.05"
    reference, md = quality.reference, found.corrected.md
    dip = with_uncertainty(float(np.degrees(reference.dip)), float(np.degrees(reference.dip_sigma)))
    turned = []
    if (u_after < VAGUE).any():
        figure = azimuth_figure(found, before, u_before, np.where(u_after < VAGUE, u_after, np.nan))
        turned.append(picture(figure, "azimuth", "Change of azimuth by the correction"))
    what = "Largest change of azimuth at any station if this one were left out of the analysis"
    turned.append(picture(influence_figure(found), "influence", what))
    left, count = sum(check.verdict == "not judged" for check in after.checks), len(md)
    return report(
        "Multi-station analysis",
        "Multi-station analysis",
        _verdict(found, before, u_after),
        [
            Section(
                "Fields against the reference, before and after",
                tables=[_fields(quality, after, found)],
                pictures=quality_pictures(after, quality, quality.reference.values + shift),
            ),
            Section("What it does to the azimuth", pictures=turned),
            Section(
                "What was found",
                tables=[_parameters(found), _pairs(found, names)],
                pictures=[
                    picture(estimate_figure(found, names), "estimates", "Estimates; squares: more than 2 u from zero"),
                    picture(correlation_figure(found, names), "correlation", signs),
                ],
            ),
            Section("What the geometry cannot tell", blind_spots(found, after, u_after)),
            Section("Stations", tables=[limit_rows(_stations(found, before, quality, after))]),
        ],
        [
            ("Tool", tool or "not named"),
            ("Stations", label("{count}, {md:g} to {end_m:g} m", count=count, md=md[0], end_m=md[-1])),
            ("Priors", found.priors),
            (
                "Chi-square",
                label("{chi_square:.1f}, expected about {freedom}", chi_square=found.chi_square, freedom=found.freedom),
            ),
            ("Reference g", label("{g} m/s²", g=with_uncertainty(reference.g, reference.g_sigma))),
            ("Reference b", label("{b} nT", b=with_uncertainty(reference.b, reference.b_sigma))),
            ("Reference dip", f"{dip}°"),
        ],
        about="What was analysed",
        heading=label("Sensor errors of {tool} in one run", tool=tool) if tool else "Sensor errors of one run",
        states=[
            (after.verdict == "fail", "bad", "The corrected stations fail the tests of the field"),
            (told, "warn", "Read the warnings"),
            (after.verdict != "pass", "warn", "The tests of the field are not decided"),
            (
                left,
                "good",
                label(
                    "{count} stations, {left} of {total} tests not judged",
                    count=count,
                    left=left,
                    total=len(after.checks),
                ),
            ),
            (True, "good", label("{count} stations, every test passed", count=count)),
        ],
        notes=noted,
        warnings=told,
        inputs=inputs,
    )


def azimuth_u(stations: Stations) -> Array:
    """Standard uncertainty (n,) of azimuth from all that is uncertain about the stations, rad; at most `UNKNOWN`."""
    rows = angles_jacobian(stations.g, stations.b)[:, 1]
    variance = np.einsum("na,nab,nb->n", rows, stations.field_covariance(), rows)
    return np.asarray(np.sqrt(np.where(np.isfinite(variance), np.minimum(variance, UNKNOWN**2), UNKNOWN**2)))


def _verdict(found: MultiStation, before: Stations, u_after: Array) -> str:
    """One sentence: what was wrong, what that did to azimuth, how sure it is now."""
    # median change of azimuth, rad, that each sensor's estimate makes
    stations = found.corrected
    by_field = stations.sources[SOURCE].by_field
    shifts = np.einsum("na,nap->np", angles_jacobian(stations.g, stations.b)[:, 1], by_field)
    sizes = np.median(np.abs(np.where(np.isfinite(shifts), shifts, 0.0)), axis=0)
    names = list(found.parameters)[: len(sizes)]
    moves = {name: float(size) * abs(found.parameters[name].value) for name, size in zip(names, sizes, strict=True)}
    stand_out = (name for name in moves if found.parameters[name].significance > COVERAGE_FACTOR)
    sure = sorted(stand_out, key=lambda name: -moves[name])[:3]
    parts = []
    for name in sure:
        p = found.parameters[name]
        unit, factor = unit_of(p.unit)
        parts.append(
            f"{described(name)} {number(with_uncertainty(factor * p.value, factor * p.u))} {label(unit)}".rstrip()
        )
    what = label("; ").join(parts) if parts else label("no sensor error stands out")
    able = u_after < VAGUE
    if not able.any():
        return label("{what}. No station is inclined enough for an azimuth.", what=what[0].upper() + what[1:])
    old, new = (angles(s.g, s.b).azimuth[able] for s in (before, found.corrected))
    moved = np.abs(np.degrees(wrap_signed(new - old)))
    known = worst_and_median("azimuth", COVERAGE_FACTOR * np.degrees(u_after[able]))
    which = (
        label("the {count} stations", count=len(before))
        if able.all()
        else label("the {sum} stations that are not vertical", sum=int(able.sum()))
    )
    half, most = significant(float(np.median(moved))), significant(float(moved.max()))
    return label(
        "{what}. Azimuth changes by at most {most}° (median {half}°) over {which}. Then {known} at the "
        "worst of them (expanded, k = {k:g}, about 95 %).",
        what=what[0].upper() + what[1:],
        most=most,
        half=half,
        which=which,
        known=known,
        k=COVERAGE_FACTOR,
    )


def _fields(before: FieldQuality, after: FieldQuality, found: MultiStation) -> Table:
    """Root mean squares against the reference, and verdicts, before and after."""
    rows = []
    own = found.after
    for column, quantity in enumerate(QUANTITIES):
        f = quantity.factor
        sizes = [
            f"{f * float(np.sqrt(np.mean(values[:, column] ** 2))):.{quantity.digits}f}"
            for values in (before.difference, after.difference, own)
        ]
        verdicts = [quality.checks[column].verdict for quality in (before, after)]
        state = "warn" if verdicts[1] != "pass" else ""
        unit = quantity.shown.replace("m/s^2", "m/s²")
        rows.append(
            TableRow(
                [label("{name}, {unit}", name=quantity.name, unit=unit), *sizes, " → ".join(map(label, verdicts))],
                state,
            )
        )
    head = ["quantity", "before", "after", "after, from the corrected reference", "verdict"]
    note = "Passing after the analysis is no independent proof: it was fitted to this reference."
    return Table("Root mean square of the differences from the reference", head, rows, note)


def _parameters(found: MultiStation) -> Table:
    rows = []
    # the one that turned the azimuths stands first, whatever its place in the model
    for name, p in sorted(found.parameters.items(), key=lambda pair: -pair[1].significance):
        if p.prior <= 0.0:
            continue
        unit, f = unit_of(p.unit)
        value = [significant(f * p.value, 3) if p.value >= 0.0 else f"−{significant(-f * p.value, 3)}"]
        cells = [*value, significant(f * p.u), significant(f * p.prior), unit or "-"]
        learned = f"{100.0 * p.learned:.0f} %"
        word = "yes" if p.significance > COVERAGE_FACTOR else ""
        code = name if re.fullmatch(r"[AM]\w\w", name) else ""
        rows.append(TableRow([described(name), code, *cells, f"{p.significance:.1f}", word, learned]))
    head = ["parameter", "term", "estimate", "u", "u before", "unit", "estimate / u", "stands out", "learned"]
    note = (
        "Estimate: what the sensors measure too much, and what has to be added to the reference. Learned: share of the "
        "prior variance that the run has removed; near 0 % the value is the prior's, not the run's."
    )
    return Table("Estimates with their standard uncertainty", head, rows, note, text_columns=2)


def _pairs(found: MultiStation, names: Mapping[str, str]) -> Table | None:
    """The pairs of which the run sees little more than a sum or difference."""
    keys, matrix = list(found.parameters), found.correlation
    strong = [
        (abs(matrix[i, j]), i, j)
        for i in range(len(keys))
        for j in range(i)
        if abs(matrix[i, j]) >= 0.7 and keys[i] in names and keys[j] in names
    ]
    rows = []
    for size, i, j in sorted(strong, key=lambda pair: (-pair[0], pair[1:]))[:12]:
        only = "their sum" if matrix[i, j] < 0.0 else "their difference"
        rows.append(
            TableRow(
                [
                    label("{one} and {other}", one=described(keys[j]), other=described(keys[i])),
                    only,
                    f"{matrix[i, j]:+.2f}",
                ],
                "warn" if size > 0.95 else "",
            )
        )
    head = ["pair", "well known is rather", "correlation"]
    return Table("Parameters that go together", head, rows, text_columns=2) if rows else None


def _stations(found: MultiStation, before: Stations, was: FieldQuality, now: FieldQuality) -> Table:
    old, new = (np.degrees(angles(s.g, s.b).azimuth) for s in (before, found.corrected))
    rows = []
    for k in range(len(before)):
        cells = [plain(float(before.md[k]), 2), f"{old[k]:.3f}", f"{new[k]:.3f}"]
        for column, quantity in enumerate(QUANTITIES):
            for quality in (was, now):
                cells.append(f"{quality.difference[k, column] * quantity.factor:+.{quantity.digits}f}")
        cells += [significant(float(np.degrees(found.influence[k]))), f"{found.surprise[k]:.1f}"]
        rows.append(TableRow(cells, "warn" if now.verdicts[k] == "fail" else ""))
    head = ["md, m", "azimuth before", "after"]
    for quantity in QUANTITIES:
        head += [
            label("{name} − reference, {replace}", name=quantity.name, replace=quantity.shown.replace("m/s^2", "m/s²")),
            "after",
        ]
    caption = "Stations; magnetic azimuth and influence in deg; surprise: squared error against the others, expected 3"
    return Table(caption, [*head, "influence", "surprise"], rows)
