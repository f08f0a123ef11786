"""The report of a run in which the tool turned and shook."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array, Mask
from inclinometry.constants import ANGLES, COVERAGE_FACTOR, RPM, STANDARD_GRAVITY
from inclinometry.earth.site import REFERENCES
from inclinometry.errors import InputError
from inclinometry.findings import Finding
from inclinometry.language import label, said
from inclinometry.motion import result
from inclinometry.motion.average import average_windows
from inclinometry.report.calibration import log_scale
from inclinometry.report.figure import BAD, DASHES, INK, SERIES, legend_above, new_figure, panel, styled
from inclinometry.report.page import CONVENTIONS, MOST_ROWS, Picture, Section, Table, TableRow, picture, report
from inclinometry.report.survey_figures import compass_dots, course, thinned, unbroken
from inclinometry.report.words import listed, plain, rounded, significant, worst_and_median
from inclinometry.rotations import wrap_signed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# One picture of several ways of finding a moving tool's attitude, against the truth.


class Found(NamedTuple):
    """One way of finding the attitude: time (n,), s; angles (n,), rad; their standard uncertainty where stated."""

    time: Array
    inclination: Array
    azimuth: Array
    u: tuple[Array, Array] | None = None


def errors_of(found: Found, truth: Found) -> tuple[Array, Array]:
    """Inclination and azimuth found less the truth at the same times (n,), rad."""
    inclination = np.interp(found.time, truth.time, truth.inclination)
    azimuth = np.interp(found.time, truth.time, np.unwrap(truth.azimuth))
    return found.inclination - inclination, wrap_signed(found.azimuth - azimuth)


def rms_of(error: Array) -> float:
    """Root mean square, deg, of the errors that are finite, rad; NaN without any.

    Examples
    --------
    >>> round(rms_of(np.array([0.01, np.nan])), 3)
    0.573
    """
    good = error[np.isfinite(error)]
    return float(np.degrees(np.sqrt(np.mean(good**2)))) if len(good) else float("nan")


@styled
def methods_figure(truth: Found, rpm: Array, found: Mapping[str, Found]) -> Figure:
    """Methods against the truth: speed (rpm), angles on clipped axes, logarithmic errors; rms errors in the legend.

    The first of `found` is drawn as dots, then curves; the last has bars of expanded uncertainty.
    """
    from matplotlib.lines import Line2D

    figure = new_figure(8.6, width=9.0)
    grid = figure.add_gridspec(4, 2, height_ratios=(0.12, 1.0, 2.6, 2.2))
    head, speed = figure.add_subplot(grid[0, :]), figure.add_subplot(grid[1, :])
    speed.plot(truth.time, rpm, color=INK, linewidth=0.9)
    speed.set_ylabel("true speed, rpm")
    speed.set_xlabel("time, s")
    errors = {name: errors_of(one, truth) for name, one in found.items()}
    looks: tuple[dict[str, Any], ...] = (
        {"color": SERIES[7], "linestyle": "none", "marker": ",", "alpha": 0.55, "rasterized": True},
        {"color": SERIES[1], "linewidth": 1.1},
        {"color": SERIES[0], "marker": "o", "markersize": 5.0, "linewidth": 0.8},
    )
    for column, name in enumerate(("inclination", "azimuth")):
        upper = figure.add_subplot(grid[2, column])
        lower = figure.add_subplot(grid[3, column], sharex=upper)
        low = []
        true = np.degrees(np.unwrap((truth.inclination, truth.azimuth)[column]))
        for layer, (look, (key, method)) in enumerate(zip(looks, found.items(), strict=False)):
            error = np.degrees(errors[key][column])
            path = np.interp(method.time, truth.time, true) + error
            upper.plot(method.time, path, zorder=2.0 + layer, **look)
            if method.u is not None:
                bars = COVERAGE_FACTOR * np.degrees(method.u[column])
                upper.errorbar(method.time, path, bars, linestyle="none", color=look["color"], capsize=2.0)
            lower.plot(method.time, np.abs(error), **look)
            seen = np.abs(error)[np.isfinite(error) & (error != 0.0)]
            low.append(float(np.quantile(seen, 0.02)) if len(seen) else 1.0)
        upper.plot(truth.time, true, color=INK, linewidth=1.6, linestyle="--", zorder=6.0)
        # the axis holds what the second method makes of it, raw values beyond are cut
        sizes = [np.abs(np.degrees(errors[key][column])) for key in list(found)[1:]]
        reach = 1.3 * max(float(np.nanquantile(size, 0.98)) for size in sizes)
        upper.set_ylim(float(true.min()) - reach, float(true.max()) + reach)
        if column == 0:
            upper.set_title("dots beyond the axes are cut")
        log_scale(lower, max(min(low), 1e-4), 180.0)
        upper.set_ylabel(label("{name}, deg", name=name))
        lower.set_ylabel(label("|error| of {name}, deg", name=name))
        lower.set_xlabel("time, s")
    handles = [Line2D([], [], color=INK, linestyle="--")]
    labels = ["truth"]
    for look, (name, (inclination, azimuth)) in zip(looks, errors.items(), strict=False):
        handles.append(Line2D([], [], **(look | {"marker": "o", "markersize": 2.5} if "alpha" in look else look)))
        inc, azi = (significant(rms_of(one)) for one in (inclination, azimuth))
        labels.append(label("{name}: rms error inclination {inc}°, azimuth {azi}°", name=name, inc=inc, azi=azi))
    head.axis("off")
    head.legend(handles, labels, loc="center left", ncols=1, borderaxespad=0.0)
    return figure


def clock(time: Array) -> tuple[float, str]:
    """The unit times are shown in, its seconds and its sign: s to ten minutes, min to three hours, h beyond.

    Examples
    --------
    >>> clock(np.array([0.0, 60.0])), clock(np.array([0.0, 1e5]))
    ((1.0, 's'), (3600.0, 'h'))
    """
    span = float(np.ptp(time)) if len(time) else 0.0
    return (1.0, "s") if span <= 600.0 else (60.0, "min") if span <= 10_800.0 else (3600.0, "h")


def stretches(time: Array, chosen: Mask) -> list[tuple[float, float]]:
    """Begin and length, s, of the stretches in which every row is chosen; a row reaches half way to its neighbours.

    Examples
    --------
    >>> stretches(np.array([1.0, 3.0, 5.0, 7.0]), np.array([False, True, True, False]))
    [(2.0, 4.0)]
    """
    if not chosen.any():
        return []
    step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    # where rows are missing a row reaches no further than usual
    half = 0.5 * np.minimum(np.diff(time), 1.5 * step)
    low, high = time - np.append(step / 2.0, half), time + np.append(half, step / 2.0)
    turns = np.diff(np.concatenate([[0], chosen.astype(int), [0]]))
    pairs = zip(np.flatnonzero(turns > 0), np.flatnonzero(turns < 0) - 1, strict=True)
    return [(float(low[first]), float(high[last] - low[first])) for first, last in pairs]


def _shade(axes: Axes, time: Array, refused: Mask, unit: float) -> None:
    """Refused stretches over the full height."""
    bars = [(begin / unit, length / unit) for begin, length in stretches(time, refused)]
    if bars:
        axes.broken_barh(
            bars, (0.0, 1.0), transform=axes.get_xaxis_transform(), color=BAD, alpha=0.16, linewidth=0.0, zorder=0.5,
            label="refused", rasterized=len(bars) > 400,
        )  # fmt: skip


@styled
def attitude_figure(found: result.AttitudeRows, name: str) -> Figure:
    """One angle over time with its band of expanded uncertainty, refused stretches shaded; below, U."""
    figure = new_figure(4.2)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    rows, (unit, sign) = thinned(len(found)), clock(found.time)
    time = found.time[rows] / unit
    value, u = (np.degrees(getattr(found, column)[rows]) for column in (name, f"u_{name}"))
    path = value if name == "inclination" else unbroken(value)
    steps = np.abs(np.diff(path[np.isfinite(path)]))
    # an angle that turns so far from row to row that a curve would say nothing
    if len(steps) and float(np.median(steps)) > 30.0:
        compass_dots(upper, time, path)
    else:
        course(upper, time, path, COVERAGE_FACTOR * u)
        # limits that hold the curve and most of its band
        spread = COVERAGE_FACTOR * u
        good = np.isfinite(path) & np.isfinite(spread)
        if good.any() and float(np.ptp(path[good])) <= 720.0:
            room = min(1.2 * float(np.quantile(spread[good], 0.9)) + 0.01, 180.0)
            upper.set_ylim(float(path[good].min()) - room, float(path[good].max()) + room)
    for axes in (upper, lower):
        _shade(axes, found.time, found.refused, unit)
    upper.set_ylabel(label("{name}, deg", name=name))
    legend_above(upper, 2)
    seen = u[np.isfinite(u) & (u > 0.0)]
    if len(seen):
        lower.plot(time, COVERAGE_FACTOR * u, color=INK, marker="o" if len(rows) <= 80 else None, markersize=2.5)
        # wide enough for two labels where U hardly changes
        log_scale(lower, 0.8 * COVERAGE_FACTOR * float(seen.min()), 1.25 * COVERAGE_FACTOR * float(seen.max()))
    lower.set_ylabel("U, deg")
    lower.set_xlabel(label("time, {sign}", sign=sign))
    return figure


@styled
def speed_figure(found: result.AttitudeRows, vibration: result.Vibration) -> Figure:
    """Turns a minute over time with its fastest and slowest tenth of a second, and the stick-slip index."""
    figure = new_figure(4.2)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    unit, sign = clock(found.time)
    rows = thinned(len(vibration))
    time = vibration.time[rows] / unit
    low, high = RPM * vibration.slowest[rows], RPM * vibration.fastest[rows]
    upper.fill_between(time, low, high, color=SERIES[0], alpha=0.25, linewidth=0.0, label="slowest to fastest")
    _line(upper, time, RPM * vibration.mean[rows], SERIES[0], "mean")
    _line(lower, time, vibration.stick_slip[rows], SERIES[1])
    lower.axhline(1.0, color=INK, linewidth=0.8, linestyle=":")
    lower.set_ylim(bottom=0.0)
    for axes in (upper, lower):
        _shade(axes, found.time, found.refused, unit)
    upper.set_ylabel("speed, rpm")
    lower.set_ylabel("stick-slip index")
    lower.set_xlabel(label("time, {sign}", sign=sign))
    legend_above(upper, 3)
    return figure


@styled
def vibration_figure(found: result.AttitudeRows, vibration: result.Vibration) -> Figure:
    """Vibration over time by direction, g rms, and the peaks below."""
    figure = new_figure(4.2)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    rows, (unit, sign) = thinned(len(vibration)), clock(found.time)
    time = vibration.time[rows] / unit
    for place, name in enumerate(("lateral", "axial")):
        _line(upper, time, getattr(vibration, name)[rows] / STANDARD_GRAVITY, SERIES[place], name, place)
    _line(lower, time, vibration.peak[rows] / STANDARD_GRAVITY, SERIES[3])
    for axes in (upper, lower):
        _shade(axes, found.time, found.refused, unit)
        axes.set_ylim(bottom=0.0)
    upper.set_ylabel("vibration, g rms")
    lower.set_ylabel("peak, g")
    lower.set_xlabel(label("time, {sign}", sign=sign))
    legend_above(upper, 3)
    return figure


def _line(axes: Axes, time: Array, value: Array, colour: str, name: str = "", dash: int = 0) -> None:
    look: dict[str, Any] = {"marker": "o", "markersize": 2.5} if len(time) <= 80 else {}
    axes.plot(time, value, color=colour, linestyle=DASHES[dash % len(DASHES)], label=name or None, **look)


@styled
def spectrogram_figure(found: result.Spectrogram) -> Figure:
    """Where in frequency and time the tool shakes, m/s^2 per root hertz on a logarithmic colour scale."""
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    figure = new_figure(3.4)
    axes = figure.add_subplot()
    unit, sign = clock(found.time)
    amplitude = np.ma.masked_invalid(np.sqrt(found.density))
    known = amplitude.compressed()
    top = float(known.max()) if len(known) and known.max() > 0.0 else 1.0
    low = max(1e-4 * top, float(np.quantile(known, 0.02)) if len(known) else 0.0)
    low = low if low < top else 0.1 * top
    # edges (f + 1,) of cells about their middles; the first cell begins at zero
    middle = found.frequency
    if len(middle) < 2:
        edges = np.array([0.0, 2.0 * float(middle[0]) if len(middle) else 1.0])
    else:
        inner = 0.5 * (middle[1:] + middle[:-1])
        edges = np.concatenate([[0.0 if middle[0] >= 0.0 else middle[0]], inner, [2.0 * middle[-1] - inner[-1]]])
    mesh = axes.pcolormesh(
        found.time / unit, edges, np.ma.maximum(amplitude, low).T, norm=LogNorm(low, top), cmap="viridis",
        rasterized=True,
    )  # fmt: skip
    axes.grid(visible=False)
    axes.set_xlabel(label("time, {sign}", sign=sign))
    axes.set_ylabel("frequency, Hz")
    places, plain = LogLocator(subs=(1.0, 2.0, 5.0)), FuncFormatter(lambda value, _: f"{value:g}")
    bar = figure.colorbar(mesh, ax=axes, pad=0.02, ticks=places, format=plain)
    bar.ax.yaxis.set_minor_formatter(NullFormatter())
    bar.set_label("m/s² / √Hz")
    return figure


@panel(3.0)
def envelope_figure(axes: Axes, channels: Sequence[result.Envelope], what: str) -> None:
    """Channels of one triad over the whole run: mean, and lowest to highest value as a band."""
    unit, sign = clock(channels[0].time)
    for place, one in enumerate(channels):
        look: dict[str, Any] = {"color": SERIES[place], "alpha": 0.18, "linewidth": 0.0}
        axes.fill_between(one.time / unit, one.low, one.high, **look)
        _line(axes, one.time / unit, one.mean, SERIES[place], one.name, place)
    axes.set_ylabel(label("{name}, {unit}", name=what, unit=_printed(channels[0].unit)))
    axes.set_xlabel(label("time, {sign}", sign=sign))
    legend_above(axes, 3)


@panel(3.0, "time, s")
def excerpt_figure(axes: Axes, found: result.Excerpt, names: Sequence[str], what: str) -> None:
    """Samples of one triad as they came."""
    for place, name in enumerate(names):
        axes.plot(
            found.time, found.channels[name], color=SERIES[place], linestyle=DASHES[place], label=name, linewidth=1.0
        )
    axes.set_ylabel(label("{name}, {unit}", name=what, unit=_printed(found.units[names[0]])))
    legend_above(axes, 3)


def _printed(unit: str) -> str:
    return label(unit.replace("m/s^2", "m/s²").replace("m/s2", "m/s²"))


METHOD_WORDS: Final = {
    "static": "means of gravity and field of a tool at rest",
    "quaternion": "the same, gravity and field both weighted (Davenport's q)",
    "magnetic": "turned back by the magnetic phase, weighted least squares with the lever arm",
    "mean": "turned back by the magnetic phase, plain mean",
    "gyro": "carried on by the gyros, gravity and Earth rate",
    "filter": "15-state filter with gravity and field",
    "robust": "robust adaptive filter over windows",
    "smoother": "filter run forward and backward",
    "survey": "gyros alone between two stations, drift closed at both",
}
"""What each of `METHODS` does, in one line."""

REMEDIES: Final = {
    "clipped": "Nothing brings clipped peaks back: accelerometers of a wider range, a softer mount, or less shock.",
    "stuck": "Check wiring and converter of the channel.",
    "gap": "Look for the cause in recorder or telemetry; the rows beside the gap are good.",
    "aliased": "Sample faster, or survey at a lower speed: below half a turn from sample to sample.",
    "no-field": "Use a method that rests on gyros here, or survey outside the casing.",
    "little-arc": "State the magnetic offsets by a calibration, or take a window that holds a whole turn.",
    "offset": "State the magnetic offsets by a calibration, or take a window that holds a whole turn.",
    "disturbed": "Look for steel nearby; check strength and dip of the field in the site file.",
    "vibration": "Take a longer window, or survey while it shakes less.",
    "not-still": "Leave the tool at rest longer, or let the window be treated as moving.",
    "step": "Correct the delay reported where the channels are recorded.",
    "axes": "Correct the axis map before any angle is believed.",
    "misfit": "Look at the run here: the motion is not as the method has it, or the noise is stated too small.",
    "start": "Leave these rows out, or let the filter start earlier.",
    "drift": "Give the gyros an update: a stop of the string, or a stretch with a usable field.",
    "vertical": "Use azimuth + toolface; azimuth alone has no meaning here.",
    "whirl": "Survey at another speed, at which the tool does not whirl; inclination is stated with what it may cost.",
    "unobservable": "A magnetometer, gyros that see the Earth turn, or a known start are needed for an azimuth.",
}
"""What to do about each of `FLAGS`."""

CHANNEL_WORDS: Final = {"accel": "apparent gravity", "mag": "magnetic field", "gyro": "rotation rate"}
"""What each triad of `CHANNELS` reads."""


def dynamic_report(run: result.DynamicRun) -> str:
    """Attitude of a moving tool as one self-contained HTML page."""
    if not len(run.rows):
        raise InputError(Finding("input-empty", {"name": "run.rows"}))
    rows = run.rows
    refused, size = int(rows.refused.sum()), len(rows)
    flagged = int((rows.flags != 0).sum())
    calibrated = "the calibration's own, " if run.tool else ""
    missing = "" if run.tool else ", errors of sensors that were not calibrated"
    shaded = "; shaded: refused" if refused else ""
    pictures, body = [], []
    for name in ANGLES:
        expanded = COVERAGE_FACTOR * np.degrees(getattr(rows, f"u_{name}"))
        good = np.flatnonzero(np.isfinite(expanded))
        if not len(good):
            continue
        reference = label(" from {north}", north=norths(rows)) if name == "azimuth" else ""
        caption = label(
            "{name}{reference} over time with its band of U, and U alone{shaded}",
            name=name.capitalize(),
            reference=reference,
            shaded=shaded,
        )
        pictures.append(picture(attitude_figure(rows, name), name, caption))
        at = int(good[np.argmax(expanded[good])])
        cells = [significant(float(v)) for v in (expanded[good].min(), np.median(expanded[good]), expanded[at])]
        body.append(TableRow([name, *cells, plain(rows.time[at], 2)]))
    head = ["angle", "least U, deg", "median U, deg", "largest U, deg", "at time, s"]
    tables = [Table(label("Expanded uncertainty (k = {k:g})", k=COVERAGE_FACTOR), head, body)] if body else []
    sections = [
        Section(
            "Inclination, azimuth, toolface",
            [label("Azimuth counts from {north}.", north=norths(rows))],
            tables,
            pictures,
        ),
        _means(run.rows),
        _motion(run),
        _refused(run.rows),
        _methods(run),
        _recorded(run),
        _table(run),
    ]
    speed = (
        "Speed: about the tool axis, positive clockwise looking down hole. Stick-slip index: (fastest - slowest) / "
        "(2 mean) speed, averaged over 0.1 s; 1 where the string stops once a cycle. g: standard gravity."
    )
    conventions = f"{label(CONVENTIONS)} {label(speed)}"
    return report(
        "Dynamic attitude report",
        label("Attitude of {value}", value=run.tool or "a moving tool"),
        _sentence(run),
        sections,
        _facts(run),
        about="What was reduced",
        heading=label("Attitude of {tool} in motion", tool=run.tool) if run.tool else "Attitude in motion",
        conventions=conventions,
        states=[
            (refused == size, "bad", "No window could be trusted"),
            (refused, "warn", label("{refused} of {size} windows refused", refused=refused, size=size)),
            (flagged, "warn", label("{flagged} of {size} windows flagged", flagged=flagged, size=size)),
            (True, "good", "Nothing refused or flagged"),
        ],
        notes=[
            label("Azimuth counts from {north}.", north=norths(rows)),
            label(
                "Included in the uncertainty: {calibrated}noise, vibration and what the method leaves undetermined.",
                calibrated=calibrated,
            ),
            label("Not included: misalignment of the tool in the hole, sag{missing}.", missing=missing),
        ],
        inputs=run.inputs,
    )


def norths(rows: result.AttitudeRows) -> str:
    """What azimuth counts from, for a sentence; a run whose methods differ names both."""
    return f"{' and '.join(REFERENCES[place] for place in np.unique(rows.north[~rows.refused])) or 'no'} north"


def _windows(count: int) -> str:
    return label("{count} windows" if count != 1 else "{count} window", count=count)


def _sentence(run: result.DynamicRun) -> str:
    rows = run.rows
    seconds = run.counts.stop - run.counts.start
    unit, sign = clock(np.array([0.0, seconds]))
    span = label(
        "{count} in {seconds} {sign}", count=_windows(len(rows)), seconds=significant(seconds / unit, 3), sign=sign
    )
    refused = rows.refused
    if refused.all():
        return label("{span}: all refused; the reasons and what to do about them stand below.", span=span)
    parts = []
    for name in ANGLES[:2]:
        u = COVERAGE_FACTOR * np.degrees(getattr(rows, f"u_{name}")[~refused])
        parts.append(
            worst_and_median(name, u[np.isfinite(u)]) if np.isfinite(u).any() else label("{name} not known", name=name)
        )
    left = label(", {count} refused", count=int(refused.sum())) if refused.any() else ""
    most = "the worst of the others" if refused.any() else "the worst of them"
    return label(
        "{span}{left}: {parts} at {most} (expanded, k = {k:g}, about 95 %).",
        span=span,
        left=left,
        parts=listed(parts),
        most=most,
        k=COVERAGE_FACTOR,
    )


def _means(rows: result.AttitudeRows) -> Section | None:
    """The windows averaged while the hole keeps its direction."""
    found = average_windows(rows)
    longest = np.argsort(-found.windows, kind="stable")[:MOST_ROWS]
    body = []
    for k in np.sort(longest[found.windows[longest] > 1]):
        cells = [plain(found.start[k], 2), plain(found.stop[k], 2), str(found.windows[k])]
        for name in ANGLES[:2]:
            value, u, common = (
                float(np.degrees(getattr(found, prefix + name)[k])) for prefix in ("", "u_", "u_common_")
            )
            lost = not np.isfinite(value)
            cells += (
                ["", "", ""] if lost else [rounded(value, u), *(significant(COVERAGE_FACTOR * x) for x in (u, common))]
            )
        body.append(TableRow(cells))
    if not body:
        return None
    head = ["from, s", "to, s", "windows"]
    for name in ANGLES[:2]:
        head += [name, "U", "of it common"]
    line = (
        "Offsets, scale errors, the lag of the field and the site are the same in all windows of a run: their part of "
        "U is common and does not average out; the rest falls with the root of the number of windows."
    )
    caption = label(
        "Means while the hole keeps its direction; angles and U (k = {k:g}) in deg",
        k=COVERAGE_FACTOR,
    )
    return Section("Means of windows", [line], [Table(caption, head, body)])


def _motion(run: result.DynamicRun) -> Section:
    vibration, pictures = run.vibration, []
    if np.isfinite(vibration.mean).any():
        caption = "Speed of rotation over time, and how unevenly the string turned"
        pictures.append(picture(speed_figure(run.rows, vibration), "speed", caption))
    if np.isfinite(vibration.peak).any():
        caption = "Vibration over time by direction, and its peaks"
        pictures.append(picture(vibration_figure(run.rows, vibration), "vibration", caption))
    if run.spectrogram is not None and np.isfinite(run.spectrogram.density).any():
        caption = label("Spectrogram: {what}", what=run.spectrogram.what)
        pictures.append(picture(spectrogram_figure(run.spectrogram), "spectrogram", caption))
    lines = []
    # the speeds of the table of windows, where there are any: a gyro's own mean has its scale error besides
    mean = run.rows.rate if np.isfinite(run.rows.rate).any() and np.isfinite(vibration.mean).any() else vibration.mean
    speed = np.abs(RPM * mean[np.isfinite(mean)])
    if len(speed):
        low, middle, high = (plain(float(v), 1) for v in (speed.min(), np.median(speed), speed.max()))
        fastest = plain(float(RPM * np.nanmax(np.abs(vibration.fastest))), 1)
        windows = label(
            "Mean speed of a window: {low} to {high} rpm, median {middle} rpm", low=low, high=high, middle=middle
        )
        lines.append(label("{windows}; fastest moment {fastest} rpm.", windows=windows, fastest=fastest))
    else:
        lines.append("The speed of rotation is not known: no magnetometer or gyro shows it.")
    index = vibration.stick_slip[np.isfinite(vibration.stick_slip)]
    if len(index):
        worst, usual = significant(float(index.max())), significant(float(np.median(index)))
        # windows (v,) in which a turning string came to a stop or turned back
        ends = np.stack([vibration.slowest, vibration.fastest])
        least = np.where(ends[0] * ends[1] <= 0.0, 0.0, np.abs(ends).min(axis=0))
        stops = int(np.asarray(np.isfinite(vibration.stick_slip) & (RPM * least < 1.0)).sum())
        whole = label("the string stopped in {stops}", stops=_windows(stops)) if stops else "the string never stopped"
        lines.append(
            label(
                "Stick-slip index: {usual} at the median window, {worst} at the worst; {whole}.",
                usual=usual,
                worst=worst,
                whole=whole,
            )
        )
    for name in ("lateral", "axial", "peak"):
        level = getattr(vibration, name)
        good = level[np.isfinite(level)] / STANDARD_GRAVITY
        if len(good):
            most, usual = significant(float(good.max())), significant(float(np.median(good)))
            what = "Largest acceleration" if name == "peak" else label("Vibration, {name}", name=name)
            unit = "g" if name == "peak" else "g rms"
            lines.append(
                label(
                    "{what}: {usual} {unit} at the median window, {most} {unit} at the worst.",
                    what=what,
                    usual=usual,
                    unit=unit,
                    most=most,
                )
            )
    return Section("How it turned and shook", lines, [], pictures)


def _refused(rows: result.AttitudeRows) -> Section | None:
    """Every flag that occurs: what it means, how often, how often refused, what to do."""
    refused, body = rows.refused, []
    for name, bit in result.BITS.items():
        which = np.flatnonzero((rows.flags & np.uint32(bit)) != 0)
        if not len(which):
            continue
        lost = int(refused[which].sum())
        cells = [name, result.FLAGS[name], REMEDIES[name], str(len(which)), str(lost), plain(rows.time[which[0]], 2)]
        body.append(TableRow(cells, "bad" if lost else "warn"))
    if not body:
        return None
    head = ["reason", "meaning", "what to do", "windows flagged", "of them refused", "first at time, s"]
    body.sort(key=lambda row: -int(row.cells[4]))
    table = Table("Reasons, those that cost most windows first; a window may have several", head, body, text_columns=3)
    share, count = plain(100.0 * float(refused.mean()), 1), int(refused.sum())
    told = label(
        "{count} of {count_2} windows ({share} %) refused: no attitude, rather than a wrong one.",
        count=count,
        count_2=len(rows),
        share=share,
    )
    calm = "No window was refused; the flags below weaken some."
    return Section("What was refused, and why", [told if count else calm], [table])


def _methods(run: result.DynamicRun) -> Section:
    """Which methods were taken, how often, how good; and what was found."""
    rows, body = run.rows, []
    for place in np.unique(rows.method):
        which = rows.method == place
        name, good = result.METHODS[place], which & ~rows.refused
        cells = [name, METHOD_WORDS[name], str(int(which.sum())), str(int((which & rows.refused).sum()))]
        for angle in ANGLES[:2]:
            u = np.degrees(getattr(rows, f"u_{angle}")[good])
            known = u[np.isfinite(u)]
            cells.append(significant(COVERAGE_FACTOR * float(np.median(known))) if len(known) else "none")
        body.append(TableRow(cells))
    head = ["method", "how", "windows", "refused", "median U of inclination, deg", "median U of azimuth, deg"]
    asked = label("Asked for: {method}.", method=run.method)
    return Section(
        "Methods, and why",
        [asked, *said(run.findings)],
        [Table("Methods taken", head, body, text_columns=2)],
    )


def _recorded(run: result.DynamicRun) -> Section | None:
    """The channels over the whole run, and samples as they came."""
    pictures: list[Picture] = []
    for triad in result.CHANNELS:
        whole = [one for one in run.envelopes if one.name.startswith(f"{triad}_")]
        if whole:
            caption = label(
                "{name} over the run: mean, and lowest to highest value",
                name=CHANNEL_WORDS[triad].capitalize(),
            )
            figure = envelope_figure(whole, CHANNEL_WORDS[triad])
            pictures.append(picture(figure, f"whole{triad}", caption))
        for place, part in enumerate(run.excerpts):
            names = [name for name in part.channels if name.startswith(f"{triad}_")]
            if names:
                figure = excerpt_figure(part, names, CHANNEL_WORDS[triad])
                caption = label(
                    "{name}, samples as they came: {what}",
                    name=CHANNEL_WORDS[triad].capitalize(),
                    what=part.what,
                )
                pictures.append(picture(figure, f"part{place}{triad}", caption))
    return Section("What was recorded", pictures=pictures) if pictures else None


def _table(run: result.DynamicRun) -> Section:
    rows, body = run.rows, []
    values = [(np.degrees(getattr(rows, name)), np.degrees(getattr(rows, f"u_{name}"))) for name in ANGLES]
    for n in range(min(len(rows), MOST_ROWS)):
        cells = [plain(rows.time[n], 3)]
        for value, u in values:
            lost = not np.isfinite(value[n])
            cells += (
                ["", ""]
                if lost
                else [rounded(float(value[n]), float(u[n])), significant(COVERAGE_FACTOR * float(u[n]))]
            )
        speed = RPM * float(rows.rate[n])
        cells += [plain(speed, 1) if np.isfinite(speed) else "", result.METHODS[rows.method[n]]]
        cells += [f"{rows.quality[n]:.2f}", ", ".join(rows.names(n))]
        body.append(TableRow(cells, "bad" if rows.refused[n] else "warn" if rows.flags[n] else ""))
    head = ["time, s"]
    for name in ANGLES:
        head += [name, "U"]
    what = label("azimuth from {rows}; quality 1 best, 0 refused", rows=norths(rows))
    caption = label(
        "Windows; angles and U (k = {COVERAGE_FACTOR:g}) in deg, {what}", COVERAGE_FACTOR=COVERAGE_FACTOR, what=what
    )
    more = len(rows) > MOST_ROWS
    note = (
        label(
            "The first {MOST_ROWS} of {count} windows; the data files hold all.", MOST_ROWS=MOST_ROWS, count=len(rows)
        )
        if more
        else ""
    )
    return Section("Windows", tables=[Table(caption, [*head, "rpm", "method", "quality", "flags"], body, note)])


def _facts(run: result.DynamicRun) -> list[tuple[str, str]]:
    counts = run.counts
    return [
        ("Tool", run.tool or "not named"),
        (
            "Samples",
            label("{samples}, {missing} of them missing or clipped", samples=counts.samples, missing=counts.missing),
        ),
        ("Sampling interval", label("{time_s:.6g} s", time_s=counts.interval)),
        ("Time", label("{start} to {stop} s", start=plain(counts.start, 3), stop=plain(counts.stop, 3))),
        ("Stretches without a gap", str(counts.stretches)),
        ("Window", label("{time_s:.6g} s", time_s=run.window)),
        ("North reference", run.north),
    ]
