"""The report of a survey by the Earth's rotation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, Mask, finite
from inclinometry.constants import ANGLES, COVERAGE_FACTOR, DEG_PER_HOUR
from inclinometry.earth.site import Site
from inclinometry.errors import refused, wrong_shape
from inclinometry.findings import Finding, only_notes, without_notes
from inclinometry.gyro.result import FLAGS, North
from inclinometry.gyro.tracking import SPAN, ScaleTrack
from inclinometry.language import label, number, said
from inclinometry.report.calibration import MANY
from inclinometry.report.figure import BAD, DASHES, INK, MARKERS, SERIES, legend_above, new_figure, panel, styled
from inclinometry.report.page import CONVENTIONS, Picture, Section, Table, TableRow, limit_rows, picture, report
from inclinometry.report.survey import flag_table, summary_table
from inclinometry.report.survey_figures import angle_figure
from inclinometry.report.words import listed, plain, quoted, rounded, significant, with_uncertainty, worst_and_median
from inclinometry.rotations import wrap_signed
from inclinometry.survey.flags import Check, worst
from inclinometry.survey.reduce import Survey

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SINGULAR = 0.1
"""|K| below which noise of the rates reaches the scale factor of the closed form more than tenfold."""


def method_label(method: str) -> str:
    """A method of `North` in words a newcomer knows.

    Examples
    --------
    >>> method_label("fixed"), method_label("tracked")
    ('uncompensated', 'tracked')
    """
    return {"fixed": "uncompensated", "patent": "patent, closed form"}.get(method, method)


def scale_course(track: ScaleTrack) -> tuple[Array, Array, Array]:
    """Temperatures, or numbers of the stations, scale and its standard uncertainty (n,) without each station's own
    rates, in order."""
    place = scale_place(track)
    order = np.argsort(place, kind="stable")
    return place[order], track.expected[order], track.expected_sd[order]


def scale_place(track: ScaleTrack) -> Array:
    """Abscissa (n,) of a track: temperatures, or without a thermometer the number of the station."""
    return track.temperature if track.thermometer else np.arange(1.0, len(track) + 1.0)


@panel(3.6)
def scale_figure(axes: Axes, track: ScaleTrack) -> None:
    """Each station's scale with bars of expanded uncertainty, and the curve that was learnt with its band."""
    _scale_panel(axes, track)
    used, size = track.observable, 4.5 if len(track) <= 80 else 2.5
    for rows, colour, marker, width, name in (
        (used, SERIES[1], "o", size, "station"),
        (~used, BAD, "X", 6.5, "nothing learnt"),
    ):
        if rows.any():
            look: dict[str, Any] = {"linestyle": "none", "elinewidth": 1.0, "markersize": width, "marker": marker}
            look |= {"color": colour, "label": name, "rasterized": int(rows.sum()) > MANY}
            bars = COVERAGE_FACTOR * 100.0 * track.scale_sd[rows]
            axes.errorbar(scale_place(track)[rows], _per_cent(track.scale[rows]), bars, **look)
    axes.set_xlabel("temperature, °C" if track.thermometer else "station")
    legend_above(axes, 2)


def _per_cent(scale: Array) -> Array:
    """A scale factor as what it adds to the readings, %."""
    return np.asarray(100.0 * (scale - 1.0))


def _scale_panel(axes: Axes, track: ScaleTrack, name: str = "learnt", colour: str = SERIES[0]) -> None:
    heat, scale, sd = scale_course(track)
    middle, spread = _per_cent(scale), COVERAGE_FACTOR * 100.0 * sd
    band: dict[str, Any] = {
        "color": colour,
        "alpha": 0.2,
        "linewidth": 0.0,
        "label": label("its ±U (k = {k:g})", k=COVERAGE_FACTOR),
    }
    axes.plot(heat, middle, color=colour, label=name)
    axes.fill_between(heat, middle - spread, middle + spread, **band)
    axes.set_ylabel("scale factor − 1, %")


@panel(3.6, y="azimuth difference, deg")
def difference_figure(axes: Axes, north: North, others: Mapping[str, North], place: Array, along: str) -> None:
    """Azimuth by other methods less the one reported, with its band of U; failures stand on the lower edge."""
    band = COVERAGE_FACTOR * np.degrees(north.u("azimuth"))
    differences = {
        method_label(name): np.degrees(wrap_signed(other.azimuth - north.azimuth)) for name, other in others.items()
    }
    _differences(
        axes, place, differences, band, label("U of the azimuth reported ({method})", method=method_label(north.method))
    )
    axes.set_xlabel(along)
    legend_above(axes, 1)


def _differences(axes: Axes, place: Array, values: Mapping[str, Array], band: Array, band_label: str) -> None:
    """Differences in degrees about zero with a band; what is off the axis or missing is marked at its edge."""
    order = np.argsort(place, kind="stable")
    wide = np.minimum(band, 180.0)[order]
    axes.fill_between(place[order], -wide, wide, color=SERIES[2], alpha=0.25, linewidth=0.0, label=band_label)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    # half the height of the axis, deg: most of the points, not the few a failing closed form throws far away
    sizes = [np.abs(value[np.isfinite(value)]) for value in values.values()]
    tall = [float(np.quantile(size, 0.9)) for size in sizes if len(size)]
    reach = 2.0 * max([*tall, float(np.median(np.minimum(band, 90.0))) if len(band) else 0.0], default=0.0)
    reach = float(np.clip(reach, 1e-6, 180.0))
    for n, (name, value) in enumerate(values.items()):
        colour = SERIES[(1, 0, 2, 3, 4, 5)[n % 6]]
        inside = np.where(np.abs(value) <= reach, value, np.nan)
        few = len(value) <= 80
        axes.plot(
            place[order], inside[order], color=colour, linestyle=DASHES[n % len(DASHES)] if few else "none",
            linewidth=1.0, marker=MARKERS[n % len(MARKERS)], markersize=3.8 if few else 2.0, label=name,
            rasterized=len(value) > MANY,
        )  # fmt: skip
        for rows, at, marker in ((value > reach, reach, "^"), (value < -reach, -reach, "v")):
            if rows.any():
                axes.plot(
                    place[rows], np.full(int(rows.sum()), 1.05 * at), linestyle="none", marker=marker, color=colour
                )
        lost = ~np.isfinite(value)
        if lost.any():
            low = np.full(int(lost.sum()), -1.05 * reach)
            axes.plot(place[lost], low, linestyle="none", marker="x", color=BAD, markersize=6.5, markeredgewidth=1.8)
    axes.set_ylim(-1.12 * reach, 1.12 * reach)


@panel(3.0, y="K")
def condition_figure(axes: Axes, k: Array, place: Array, along: str, lost: Mask) -> None:
    """K over the stations with the band in which the scale factor cannot be seen; `lost` are closed-form failures."""
    order = np.argsort(place, kind="stable")
    axes.axhspan(-SINGULAR, SINGULAR, color=BAD, alpha=0.15, linewidth=0.0, label="scale not seen")
    axes.axhline(0.0, color=INK, linewidth=0.8)
    axes.plot(place[order], k[order], color=SERIES[0], marker="o" if len(k) <= 80 else None, markersize=3.0, label="K")
    if lost.any():
        look: dict[str, Any] = {"linestyle": "none", "marker": "x", "markersize": 6.5, "markeredgewidth": 1.8}
        axes.plot(place[lost], k[lost], color=BAD, label="closed form failed", **look)
    axes.set_ylim(min(-0.2, 1.08 * float(np.nanmin(k, initial=0.0))), max(0.3, 1.08 * float(np.nanmax(k, initial=0.0))))
    axes.set_xlabel(along)
    legend_above(axes, 2)


@styled
def hot_run_figure(
    temperature: Array,
    inclination: Array,
    errors: Mapping[str, Array],
    u: Mapping[str, Array],
    scale_true: Array,
    track: ScaleTrack,
) -> Figure:
    """A run into a hot hole against its truth: azimuth error (rad) of several methods, scale factor, inclination.

    NaN where a method fails; rms errors in the legend are of the other stations. The band is that of the last of `u`.
    """
    size = len(temperature)
    if not errors or not u:
        raise refused("input-empty", {"name": "errors, u"})
    own = {"inclination": inclination, "scale_true": scale_true, "track": track.scale}
    for name, value in (*own.items(), *errors.items(), *u.items()):
        if len(value) != size:
            raise wrong_shape(name, (len(value),), f"({size},)")
    figure = new_figure(8.2, width=9.0)
    top, middle, low = figure.subplots(3, 1, sharex=True, height_ratios=(5, 4, 1.6))
    named = {}
    for name, value in errors.items():
        good = value[np.isfinite(value)]
        rms = significant(float(np.degrees(np.sqrt(np.mean(good**2))))) if len(good) else "not known"
        lost = (
            label(", no azimuth at {count} of {total}", count=size - len(good), total=size) if len(good) < size else ""
        )
        named[label("{name}: rms {rms}°{lost}", name=name, rms=rms, lost=lost)] = np.degrees(value)
    who, spread = list(u.items())[-1]
    _differences(
        top, temperature, named, COVERAGE_FACTOR * np.degrees(spread), label("95 % band that “{who}” states", who=who)
    )
    top.set_ylabel("azimuth error, deg")
    top.legend(loc="upper left", ncols=1)
    top.set_title("Error of azimuth as the hole gets hot (triangle: off the axis; red cross: no azimuth)")
    order = np.argsort(temperature, kind="stable")
    middle.plot(temperature[order], _per_cent(scale_true)[order], color=INK, linestyle="none", marker="o", label="true")
    _scale_panel(middle, track, "learnt from the Earth’s rotation", SERIES[2])
    middle.axhline(0.0, color=SERIES[1], linestyle="-", linewidth=1.0, label="assumed without compensation")
    middle.legend(loc="best")
    middle.set_title("Why: the scale factor of the gyro drifts with temperature")
    low.plot(temperature[order], np.degrees(inclination)[order], color=INK)
    low.set_ylabel("incl., deg")
    low.set_ylim(0.0, 95.0)
    low.set_yticks([0, 45, 90])
    low.set_xlabel("temperature in the tool, °C")
    return figure


# The report of a scale factor followed over temperature.

SCALE_CONVENTIONS = (
    "Scale factor: true rate = scale factor × reading. K = cos(latitude) cos(inclination) + sin(latitude) "
    "sin(inclination) cos(azimuth from true north): what the scale factor is seen through."
)


def scale_report(
    track: ScaleTrack, *, md: ArrayLike | None = None, tool: str = "", findings: Sequence[Finding] = ()
) -> str:
    """A scale factor followed over temperature as one self-contained HTML page; without `md` stations are numbered."""
    depth = None if md is None else finite(md, "md", (None,))
    if depth is not None and len(depth) != len(track):
        raise wrong_shape("md", depth.shape, f"({len(track)},)")
    left = int((~track.observable).sum())
    findings = (*track.findings, *findings)
    warned = without_notes(findings)
    belief = track.state
    sd = np.sqrt(np.maximum(np.diagonal(belief.covariance), 0.0))
    at = label("scale factor at {at_degC:g} °C", at_degC=belief.reference_temperature)
    names = [at, label("slope, per {SPAN:g} °C", SPAN=SPAN), label("bend, per ({SPAN:g} °C)²", SPAN=SPAN)]
    body = [
        TableRow([name, with_uncertainty(float(value), float(u))])
        for name, value, u in zip(names, belief.coefficients, sd, strict=False)
    ]
    span = belief.temperature_range or (float(track.temperature.min()), float(track.temperature.max()))
    sentences = [
        label(
            "The next run can start from these coefficients with their covariance. They were learnt from "
            "{span:.0f} to {span_2:.0f} °C; beyond that they are extrapolated.",
            span=span[0],
            span_2=span[1],
        )
    ]
    coefficients = Table("Coefficients ± standard uncertainty", ["coefficient", "value"], body)
    return report(
        "Scale factor report",
        label("Scale factor of {value}", value=tool or "a gyro"),
        learnt_sentences(track)[0],
        [
            Section("Scale factor over temperature", pictures=[scale_picture(track)]),
            Section("What was learnt", tables=[coefficients]),
            Section("What this run offers to the next one", sentences, [_forecast(track)]),
            Section("Stations", tables=[limit_rows(_scale_stations(track, depth))]),
        ],
        [("Tool", tool or "not named"), ("Stations", str(len(track)))],
        about="What was reduced",
        heading=label("Scale factor of {tool} over temperature", tool=tool)
        if tool
        else "Scale factor over temperature",
        conventions=f"{label(CONVENTIONS)} {label(SCALE_CONVENTIONS)}",
        states=[
            (left, "warn", label("Nothing learnt from {left} of {count} stations", left=left, count=len(track))),
            (warned, "warn", "Read the warnings"),
            (True, "good", "Learnt"),
        ],
        notes=[
            "The uncertainty supposes that the scale factor follows the polynomial and walks from station to station.",
            *said(only_notes(findings)),
        ],
        warnings=said(warned),
    )


def scale_picture(track: ScaleTrack) -> Picture:
    """The scale factor over temperature."""
    over = "temperature" if track.thermometer else "the stations"
    caption = label(
        "Scale factor over {over}; bars and band: U (k = {k:g})",
        over=over,
        k=COVERAGE_FACTOR,
    )
    return picture(scale_figure(track), "scale", caption)


def learnt_sentences(track: ScaleTrack) -> list[str]:
    """How far the scale factor moved and how well it is known, and what the track itself notes."""
    low, high = float(track.temperature.min()), float(track.temperature.max())
    worst, median = (COVERAGE_FACTOR * 100.0 * float(of(track.scale_sd)) for of in (np.max, np.median))
    change = 100.0 * float(np.ptp(track.scale))
    over = label("From {low:.0f} to {high:.0f} °C", low=low, high=high) if track.thermometer else "Over the run"
    return [
        label(
            "{over} the scale factor changed by {change} %; it is known within ±{worst} % at the worst station "
            "(median ±{median} %, k = {k:g}).",
            over=over,
            change=significant(change),
            worst=significant(worst),
            median=significant(median),
            k=COVERAGE_FACTOR,
        ),
        *said(track.findings),
    ]


def _forecast(track: ScaleTrack) -> Table:
    """The belief at a few temperatures, as the next run would start from it."""
    low, high = float(track.temperature.min()), float(track.temperature.max())
    heat = np.linspace(low, high, 5) if high > low else np.array([low])
    scale, sd = track.state.predict(heat)
    body = [
        TableRow([f"{t:.1f}", rounded(float(value), float(u)), significant(COVERAGE_FACTOR * float(u))])
        for t, value, u in zip(heat, scale, sd, strict=True)
    ]
    return Table(
        label("Expected scale factor, U (k = {k:g})", k=COVERAGE_FACTOR),
        ["temperature, °C", "scale", "U"],
        body,
    )


def _scale_stations(track: ScaleTrack, depth: Array | None) -> Table:
    first = [str(n + 1) for n in range(len(track))] if depth is None else [f"{value:.2f}" for value in depth]
    body = []
    for n, name in enumerate(first):
        cells = [name, f"{track.temperature[n]:.1f}"]
        for value, u in ((track.expected[n], track.expected_sd[n]), (track.scale[n], track.scale_sd[n])):
            cells += [rounded(float(value), float(u)), significant(COVERAGE_FACTOR * float(u))]
        used = bool(track.observable[n])
        body.append(TableRow([*cells, "yes" if used else "no"], "" if used else "warn"))
    place = "station" if depth is None else "md, m"
    head = [place, "T, °C", "without its own rates", "U", "with them", "U", "learnt from"]
    return Table(label("Scale factor of each station, U (k = {k:g})", k=COVERAGE_FACTOR), head, body)


def gyro_report(
    survey: Survey,
    north: North,
    *,
    md: ArrayLike,
    temperature: ArrayLike | None = None,
    track: ScaleTrack | None = None,
    others: Mapping[str, North] | None = None,
    checks: Sequence[Check] = (),
    site: Site | None = None,
) -> str:
    """A gyro survey as one self-contained HTML page; all but `survey` in the order in which stations were measured."""
    north, heat, others = _in_order(survey, north, md, temperature, track, others or {})
    flagged = sum(bool(row) for row in survey.flags)
    told = [one for one in survey.findings if one.severity != "note"]
    sections = [
        _angles(survey),
        _scale(survey, north, others, track),
        _methods(survey, north, others, heat) if others else None,
        Section("Checks", tables=[_check_table(checks)]) if checks else None,
        Section("Flags", tables=[flag_table(survey, FLAGS)]) if flagged else None,
        Section("Stations", tables=[limit_rows(_stations(survey, north, heat))]),
    ]
    size, k = len(survey), survey.coverage_factor
    span = label("{count} stations from {first:g} to {last:g} m", count=size, first=survey.md[0], last=survey.md[-1])
    expanded = {name: np.degrees(survey.expanded(name)) for name in ANGLES[:2]}
    # no accelerometer of a tool reaches 5e-4 deg: below it no one stated their errors
    stated = bool(np.nanmax(expanded["inclination"], initial=0.0) > 5e-4)
    parts = listed([worst_and_median(name, u) for name, u in expanded.items() if stated or name != "inclination"])
    failed = listed([quoted(check.name) for check in checks if check.verdict == "fail"])
    condition = label(" Settle the failed check of {failed} before relying on it.", failed=failed) if failed else ""
    included = [name for name, part in survey.components.items() if np.nansum(part) > 0.0]
    left = [] if "latitude" in included else ["error of the latitude"]
    left += ["error of the convergence"] if survey.azimuth_reference == "grid" and "convergence" not in included else []
    named = listed(list(map(quoted, included))) or "nothing"
    left += [] if stated else ["errors of the accelerometers"]
    if "gyro axes" not in included:
        left += ["misalignment of gyros against accelerometers", "the gyros’ response to acceleration"]
    missing = listed(
        [
            "misalignment of the tool in the hole",
            "sag",
            "movement of the tool while it measured",
            "bias that drifts unevenly over the index positions",
            *left,
        ]
    )
    condition = ("" if stated else " Inclination: the errors of the accelerometers are not stated.") + condition
    subject = label("Gyro survey with {value}", value=survey.tool or "a tool")
    return report(
        "Gyro survey report",
        subject,
        label(
            "{span}: {parts} at the worst of them (expanded, k = {k:g}, about 95 %).{condition}",
            span=span,
            parts=parts,
            k=k,
            condition=condition,
        ),
        sections,
        _facts(survey, north, heat, track, site),
        about="What was reduced",
        heading=subject if survey.tool else "Gyro survey",
        conventions=f"{label(CONVENTIONS)} {label(SCALE_CONVENTIONS)}",
        states=_states(flagged, size, checks, bool(told)),
        notes=[
            label(
                "Azimuth counts from {azimuth_reference} north. Included in the uncertainty: {named}. Not "
                "included: {missing}.",
                azimuth_reference=survey.azimuth_reference,
                named=named,
                missing=missing,
            )
        ],
        warnings=said(told),
        inputs=survey.inputs,
    )


def _in_order(
    survey: Survey,
    north: North,
    md: ArrayLike,
    temperature: ArrayLike | None,
    track: ScaleTrack | None,
    others: Mapping[str, North],
) -> tuple[North, Array | None, dict[str, North]]:
    """Stations from the top down, as in the survey; temperature (n,), degC."""
    depth = finite(md, "md", (None,))
    heat = None if temperature is None else finite(temperature, "temperature", (None,))
    if heat is None and track is not None and track.thermometer:
        heat = track.temperature
    sizes = {"survey": len(survey), "north": len(north), **{name: len(other) for name, other in others.items()}}
    sizes |= {} if heat is None else {"temperature": len(heat)}
    sizes |= {} if track is None else {"track": len(track)}
    for name, size in sizes.items():
        if size != len(depth):
            raise wrong_shape(name, (size,), f"({len(depth)},)")
    order = np.argsort(depth, kind="stable")
    if (odd := np.flatnonzero(depth[order] != survey.md)).size:
        depths = {"here": float(depth[order][odd[0]]), "there": float(survey.md[odd[0]])}
        raise refused("work-rows", {"name": "md_m", **depths, "file": "survey.csv"})
    turned = {name: _taken(other, order) for name, other in others.items()}
    return _taken(north, order), None if heat is None else heat[order], turned


def _taken(north: North, order: Index) -> North:
    """The stations `order` of a run."""
    rows = order.tolist()
    values = {f.name: getattr(north, f.name) for f in fields(north)}
    arrays: dict[str, Any] = {name: value[order] for name, value in values.items() if isinstance(value, np.ndarray)}
    components = {name: part[order] for name, part in north.components.items()}
    flags, root = [north.flags[n] for n in rows], [north.root[n] for n in rows]
    return replace(north, **arrays, components=components, flags=flags, root=root)


def _states(flagged: int, size: int, checks: Sequence[Check], warned: bool) -> list[tuple[object, str, str]]:
    failed, left = (sum(check.verdict == verdict for check in checks) for verdict in ("fail", "not judged"))
    return [
        (failed, "bad", label("{failed} of {count} checks failed", failed=failed, count=len(checks))),
        (flagged, "warn", label("{flagged} of {size} stations flagged", flagged=flagged, size=size)),
        (warned, "warn", "Read the warnings"),
        (checks and worst(checks) == "not judged", "warn", "No check could be judged"),
        (left, "good", label("No flags, {left} of {count} checks not judged", left=left, count=len(checks))),
        (True, "good", "No flags, all checks passed" if checks else "No flags"),
    ]


def _angles(survey: Survey) -> Section:
    pictures = [
        picture(
            angle_figure(survey, name),
            name,
            label("{name} with its band of U, and U by cause", name=name.capitalize()),
        )
        for name in ANGLES[:2]
        if np.isfinite(getattr(survey, name)).any()
    ]
    reference = label("Azimuth counts from {north} north.", north=survey.azimuth_reference)
    return Section("Inclination and azimuth", [reference], [summary_table(survey, ANGLES[:2])], pictures)


def _scale(survey: Survey, north: North, others: Mapping[str, North], track: ScaleTrack | None) -> Section:
    """What is known of the scale factor, and where the run could see it."""
    k = north.k
    sentences = [] if track is None else learnt_sentences(track)
    pictures = [] if track is None else [scale_picture(track)]
    blind = int((np.abs(k) < SINGULAR).sum())
    sentences.append(
        label(
            "K is within ±{SINGULAR:g} at {blind} of {count} stations: there the Earth’s rotation says next to "
            "nothing of the scale factor, and its prior decides.",
            SINGULAR=SINGULAR,
            blind=blind,
            count=len(k),
        )
    )
    lost = np.zeros(len(k), dtype=bool)
    for other in others.values():
        lost |= ~np.isfinite(other.scale)
    caption = "K over depth; the scale factor cannot be seen where it is zero"
    pictures.append(picture(condition_figure(k, survey.md, "measured depth, m", lost), "condition", caption))
    return Section("Scale factor", sentences, [], pictures)


def _methods(survey: Survey, north: North, others: Mapping[str, North], heat: Array | None) -> Section:
    """Azimuth by other methods less the one reported."""
    body = []
    for name, other in others.items():
        size = np.abs(np.degrees(wrap_signed(other.azimuth - north.azimuth)))
        good = size[np.isfinite(size)]
        rms, most = (float(np.sqrt(np.mean(good**2))), float(good.max())) if len(good) else (np.nan, np.nan)
        lost = len(size) - len(good)
        missed = [set(row) for row, azimuth in zip(other.flags, other.azimuth, strict=True) if not np.isfinite(azimuth)]
        counts = {flag: sum(flag in row for row in missed) for flag in FLAGS}
        why = listed([f"{label(flag)} ({count})" for flag, count in counts.items() if count])
        cells = [method_label(name), why, significant(rms), significant(most), str(lost)]
        body.append(TableRow(cells, "warn" if lost else ""))
    head = ["method", "why it fails", "rms difference, deg", "largest, deg", "no azimuth at"]
    table = Table(
        label("Azimuth less that of the method reported ({method})", method=north.method), head, body, text_columns=2
    )
    places = [("bydepth", "depth", survey.md, "measured depth, m")]
    if heat is not None and np.ptp(heat) > 0.0:
        places.append(("byheat", "temperature", heat, "temperature, °C"))
    caption = "Azimuth by other methods over {what}; triangles: off the axis, red crosses: no azimuth"
    pictures = [
        picture(difference_figure(north, others, place, along), name, label(caption, what=over))
        for name, over, place, along in places
    ]
    return Section("Methods compared", [], [table], pictures)


def _check_table(checks: Sequence[Check]) -> Table:
    head = ["check", "verdict", "reason", "value", "limit"]
    body = [
        TableRow(
            [c.name, c.verdict, said([c.reason])[0], _measure(c.value, c.unit), _measure(c.limit, c.unit)],
            {"pass": "", "not judged": "warn", "fail": "bad"}.get(c.verdict, ""),
        )
        for c in checks
    ]
    return Table("Checks of the run", head, body, text_columns=3)


def _measure(value: float, unit: str) -> str:
    if not np.isfinite(value):
        return "none"
    if unit == "stations":
        return label("{plain} stations", plain=plain(value, 0))
    units = {"rad": ("°", float(np.degrees(1.0))), "rad/s": (" deg/h", 1.0 / DEG_PER_HOUR), "sigma": (" σ", 1.0)}
    name, per = units.get(unit, ("", 1.0))
    return f"{number(significant(value * per))}{label(name)}"


def _stations(survey: Survey, north: North, heat: Array | None) -> Table:
    angles = [(np.degrees(getattr(survey, n)), np.degrees(survey.u(n))) for n in ANGLES]
    rows, k = [], survey.coverage_factor
    for n in range(len(survey)):
        cells = [f"{survey.md[n]:.2f}"]
        for value, u in angles:
            cells += [rounded(float(value[n]), float(u[n])), significant(k * float(u[n]))]
        u_scale = float(north.u_scale[n])
        cells += [rounded(float(north.scale[n]), u_scale), significant(u_scale)]
        cells += [north.root[n], rounded(float(north.k[n]), 0.02)]
        cells += [] if heat is None else [f"{heat[n]:.1f}"]
        rows.append(TableRow([*cells, ", ".join(survey.flags[n])], "warn" if survey.flags[n] else ""))
    head = ["md, m"]
    for name in ANGLES:
        head += [name, "U"]
    head += ["scale", "u", "root", "K", *([] if heat is None else ["T, °C"]), "flags"]
    caption = label(
        "Stations; angles and U (k = {k:g}) in deg, azimuth from {north} north, scale with its standard uncertainty u",
        k=k,
        north=survey.azimuth_reference,
    )
    return Table(caption, head, rows)


def _facts(
    survey: Survey, north: North, heat: Array | None, track: ScaleTrack | None, site: Site | None
) -> list[tuple[str, str]]:
    facts = [
        ("Tool", survey.tool or "not named"),
        ("Stations", str(len(survey))),
        ("Method", north.method),
        ("North reference", survey.azimuth_reference),
    ]
    if site is not None and site.latitude is not None:
        facts.append(("Latitude", f"{np.degrees(site.latitude):+.4f}°"))
    if site is not None and site.convergence is not None and survey.azimuth_reference == "grid":
        facts.append(("Convergence", f"{np.degrees(site.convergence):+.3f}°"))
    if heat is not None:
        facts.append(("Temperature", label("{min:.1f} to {max:.1f} °C", min=heat.min(), max=heat.max())))
    if track is not None:
        facts.append(
            ("Scale learnt from", label("{sum} of {count} stations", sum=int(track.observable.sum()), count=len(track)))
        )
    return facts
