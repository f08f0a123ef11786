"""Drawings of a moving tool over time: angles with their bands, speed, vibration, spectrogram, methods beside truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from inclinometry.core.angles import wrap_signed
from inclinometry.core.arrays import Array, Mask
from inclinometry.core.constants import COVERAGE_FACTOR, STANDARD_GRAVITY
from inclinometry.motion.result import AttitudeRows, Envelope, Excerpt, Spectrogram, Vibration
from inclinometry.report.calibration_figures import log_scale
from inclinometry.report.digits import significant
from inclinometry.report.figure import BAD, DASHES, INK, SERIES, new_figure, styled
from inclinometry.report.survey_figures import compass_dots, course, thinned, unbroken

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
    """Inclination and azimuth found less the truth at the same times (n,), rad.

    Examples
    --------
    >>> truth = Found(np.array([0.0, 2.0]), np.array([0.5, 0.7]), np.array([6.2, 6.4]))
    >>> off = errors_of(Found(np.array([1.0]), np.array([0.61]), np.array([0.02])), truth)
    >>> [round(float(one[0]), 6) for one in off]
    [0.01, 0.003185]
    """
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


_LOOKS: Final[tuple[dict[str, Any], ...]] = (
    {"color": SERIES[7], "linestyle": "none", "marker": ",", "alpha": 0.55, "rasterized": True},
    {"color": SERIES[1], "linewidth": 1.1},
    {"color": SERIES[0], "marker": "o", "markersize": 5.0, "linewidth": 0.8},
)


@styled
def methods_figure(truth: Found, rpm: Array, found: Mapping[str, Found]) -> Figure:
    """Three ways of finding the attitude against the truth: speed, angles on clipped axes, errors on logarithmic ones.

    Parameters
    ----------
    truth : Found
    rpm : (n,) ndarray
        True speed at the truth's times, turns a minute.
    found : mapping of name to Found
        First what is drawn as dots, then curves; the last with bars of expanded uncertainty.

    Returns
    -------
    Figure
        Root mean square errors stand in the legend.
    """
    figure = new_figure(8.6, width=9.0)
    grid = figure.add_gridspec(4, 2, height_ratios=(0.12, 1.0, 2.6, 2.2))
    head, speed = figure.add_subplot(grid[0, :]), figure.add_subplot(grid[1, :])
    speed.plot(truth.time, rpm, color=INK, linewidth=0.9)
    speed.set_ylabel("true speed, rpm")
    speed.set_xlabel("time, s")
    errors = {name: errors_of(one, truth) for name, one in found.items()}
    for column, name in enumerate(("inclination", "azimuth")):
        upper = figure.add_subplot(grid[2, column])
        lower = figure.add_subplot(grid[3, column], sharex=upper)
        _angle_panel(upper, truth, found, errors, column)
        _error_panel(lower, found, errors, column)
        upper.set_ylabel(f"{name}, deg")
        lower.set_ylabel(f"|error| of {name}, deg")
        lower.set_xlabel("time, s")
    _legend(head, errors)
    return figure


def _angle_panel(
    axes: Axes, truth: Found, found: Mapping[str, Found], errors: Mapping[str, tuple[Array, Array]], column: int
) -> None:
    """One angle; the axis holds what the second method makes of it, raw values beyond are cut."""
    true = np.degrees(np.unwrap((truth.inclination, truth.azimuth)[column]))
    for place, (look, (name, one)) in enumerate(zip(_LOOKS, found.items(), strict=False)):
        off = np.degrees(errors[name][column])
        path = np.interp(one.time, truth.time, true) + off
        axes.plot(one.time, path, zorder=2.0 + place, **look)
        if one.u is not None:
            axes.errorbar(
                one.time,
                path,
                COVERAGE_FACTOR * np.degrees(one.u[column]),
                linestyle="none",
                color=look["color"],
                capsize=2.0,
            )
    axes.plot(truth.time, true, color=INK, linewidth=1.6, linestyle="--", zorder=6.0)
    size = [np.abs(np.degrees(errors[name][column])) for name in list(found)[1:]]
    reach = 1.3 * max(float(np.nanquantile(one, 0.98)) for one in size)
    axes.set_ylim(float(true.min()) - reach, float(true.max()) + reach)
    if column == 0:
        axes.set_title("dots beyond the axes are cut")


def _error_panel(
    axes: Axes, found: Mapping[str, Found], errors: Mapping[str, tuple[Array, Array]], column: int
) -> None:
    low = []
    for look, (name, one) in zip(_LOOKS, found.items(), strict=False):
        size = np.abs(np.degrees(errors[name][column]))
        axes.plot(one.time, size, **look)
        good = size[np.isfinite(size) & (size > 0.0)]
        low.append(float(np.quantile(good, 0.02)) if len(good) else 1.0)
    log_scale(axes, max(min(low), 1e-4), 180.0)


def _legend(axes: Axes, errors: Mapping[str, tuple[Array, Array]]) -> None:
    """Names with their root mean square errors, above everything."""
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=INK, linestyle="--")]
    labels = ["truth"]
    for look, (name, (inclination, azimuth)) in zip(_LOOKS, errors.items(), strict=False):
        handles.append(Line2D([], [], **(look | {"marker": "o", "markersize": 2.5} if "alpha" in look else look)))
        inc, azi = (significant(rms_of(one)) for one in (inclination, azimuth))
        labels.append(f"{name}: rms error inclination {inc}°, azimuth {azi}°")
    axes.axis("off")
    axes.legend(handles, labels, loc="center left", ncols=1, borderaxespad=0.0)


RPM = 30.0 / np.pi
"""Turns a minute of one rad/s."""

MOST_BARS = 400
"""Refused stretches drawn as vectors; more of them are drawn as an image."""


class Clock(NamedTuple):
    """The unit times are shown in: seconds of one unit, and its sign."""

    seconds: float
    unit: str

    def shown(self, time: Array) -> Array:
        """Times, s, in this unit."""
        return np.asarray(time / self.seconds)


def clock(time: Array) -> Clock:
    """Seconds up to ten minutes, minutes up to three hours, hours beyond.

    Examples
    --------
    >>> clock(np.array([0.0, 60.0])).unit, clock(np.array([0.0, 1e5])).unit
    ('s', 'h')
    """
    span = float(np.ptp(time)) if len(time) else 0.0
    return Clock(1.0, "s") if span <= 600.0 else Clock(60.0, "min") if span <= 10_800.0 else Clock(3600.0, "h")


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


def _shade(axes: Axes, time: Array, refused: Mask, at: Clock) -> None:
    """Refused stretches over the full height."""
    bars = [(begin / at.seconds, length / at.seconds) for begin, length in stretches(time, refused)]
    if bars:
        axes.broken_barh(
            bars, (0.0, 1.0), transform=axes.get_xaxis_transform(), color=BAD, alpha=0.16, linewidth=0.0, zorder=0.5,
            label="refused", rasterized=len(bars) > MOST_BARS,
        )  # fmt: skip


def _above(axes: Axes, columns: int) -> None:
    if axes.get_legend_handles_labels()[1]:
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, borderaxespad=0.2, columnspacing=1.2)


@styled
def attitude_figure(found: AttitudeRows, name: str) -> Figure:
    """One angle over time with its band of expanded uncertainty, refused stretches shaded; below, U."""
    figure = new_figure(4.2)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    rows, at = thinned(len(found)), clock(found.time)
    time = at.shown(found.time[rows])
    value, u = (np.degrees(getattr(found, column)[rows]) for column in (name, f"u_{name}"))
    path = value if name == "inclination" else unbroken(value)
    if _leaps(path):
        compass_dots(upper, time, path)
    else:
        course(upper, time, path, COVERAGE_FACTOR * u)
        _frame(upper, path, COVERAGE_FACTOR * u)
    for axes in (upper, lower):
        _shade(axes, found.time, found.refused, at)
    upper.set_ylabel(f"{name}, deg")
    _above(upper, 2)
    seen = u[np.isfinite(u) & (u > 0.0)]
    if len(seen):
        lower.plot(time, COVERAGE_FACTOR * u, color=INK, marker="o" if len(rows) <= 80 else None, markersize=2.5)
        # wide enough for two labels where U hardly changes
        log_scale(lower, 0.8 * COVERAGE_FACTOR * float(seen.min()), 1.25 * COVERAGE_FACTOR * float(seen.max()))
    lower.set_ylabel("U, deg")
    lower.set_xlabel(f"time, {at.unit}")
    return figure


def _leaps(path: Array) -> bool:
    """Whether an angle, deg, turns so far from row to row that a curve would say nothing."""
    steps = np.abs(np.diff(path[np.isfinite(path)]))
    return bool(len(steps)) and float(np.median(steps)) > 30.0


def _frame(axes: Axes, path: Array, spread: Array) -> None:
    """Limits that hold the curve and most of its band."""
    good = np.isfinite(path) & np.isfinite(spread)
    if good.any() and float(np.ptp(path[good])) <= 720.0:
        room = min(1.2 * float(np.quantile(spread[good], 0.9)) + 0.01, 180.0)
        axes.set_ylim(float(path[good].min()) - room, float(path[good].max()) + room)


@styled
def speed_figure(found: AttitudeRows, vibration: Vibration) -> Figure:
    """Turns a minute over time with its fastest and slowest tenth of a second, and the stick-slip index."""
    figure = new_figure(4.2)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    at = clock(found.time)
    rows = thinned(len(vibration))
    time = at.shown(vibration.time[rows])
    low, high = RPM * vibration.slowest[rows], RPM * vibration.fastest[rows]
    upper.fill_between(time, low, high, color=SERIES[0], alpha=0.25, linewidth=0.0, label="slowest to fastest")
    _line(upper, time, RPM * vibration.mean[rows], SERIES[0], "mean")
    _line(lower, time, vibration.stick_slip[rows], SERIES[1])
    lower.axhline(1.0, color=INK, linewidth=0.8, linestyle=":")
    lower.set_ylim(bottom=0.0)
    for axes in (upper, lower):
        _shade(axes, found.time, found.refused, at)
    upper.set_ylabel("speed, rpm")
    lower.set_ylabel("stick-slip index")
    lower.set_xlabel(f"time, {at.unit}")
    _above(upper, 3)
    return figure


@styled
def vibration_figure(found: AttitudeRows, vibration: Vibration) -> Figure:
    """Vibration over time by direction, g rms, and the peaks below."""
    figure = new_figure(4.2)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    rows, at = thinned(len(vibration)), clock(found.time)
    time = at.shown(vibration.time[rows])
    for place, name in enumerate(("lateral", "axial")):
        _line(upper, time, getattr(vibration, name)[rows] / STANDARD_GRAVITY, SERIES[place], name, place)
    _line(lower, time, vibration.peak[rows] / STANDARD_GRAVITY, SERIES[3])
    for axes in (upper, lower):
        _shade(axes, found.time, found.refused, at)
        axes.set_ylim(bottom=0.0)
    upper.set_ylabel("vibration, g rms")
    lower.set_ylabel("peak, g")
    lower.set_xlabel(f"time, {at.unit}")
    _above(upper, 3)
    return figure


def _line(axes: Axes, time: Array, value: Array, colour: str, label: str = "", dash: int = 0) -> None:
    look: dict[str, Any] = {"marker": "o", "markersize": 2.5} if len(time) <= 80 else {}
    axes.plot(time, value, color=colour, linestyle=DASHES[dash % len(DASHES)], label=label or None, **look)


@styled
def spectrogram_figure(found: Spectrogram) -> Figure:
    """Where in frequency and time the tool shakes, m/s^2 per root hertz on a logarithmic colour scale."""
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    figure = new_figure(3.4)
    axes = figure.add_subplot()
    at = clock(found.time)
    amplitude = np.ma.masked_invalid(np.sqrt(found.density))
    known = amplitude.compressed()
    top = float(known.max()) if len(known) and known.max() > 0.0 else 1.0
    low = max(1e-4 * top, float(np.quantile(known, 0.02)) if len(known) else 0.0)
    low = low if low < top else 0.1 * top
    edges = _edges(found.frequency)
    mesh = axes.pcolormesh(
        at.shown(found.time), edges, np.ma.maximum(amplitude, low).T, norm=LogNorm(low, top), cmap="viridis",
        rasterized=True,
    )  # fmt: skip
    axes.grid(visible=False)
    axes.set_xlabel(f"time, {at.unit}")
    axes.set_ylabel("frequency, Hz")
    places, plain = LogLocator(subs=(1.0, 2.0, 5.0)), FuncFormatter(lambda value, _: f"{value:g}")
    bar = figure.colorbar(mesh, ax=axes, pad=0.02, ticks=places, format=plain)
    bar.ax.yaxis.set_minor_formatter(NullFormatter())
    bar.set_label("m/s² / √Hz")
    return figure


def _edges(middle: Array) -> Array:
    """Edges (f + 1,) of cells about their middles; the first cell begins at nought."""
    if len(middle) < 2:
        return np.array([0.0, 2.0 * float(middle[0]) if len(middle) else 1.0])
    inner = 0.5 * (middle[1:] + middle[:-1])
    return np.concatenate([[0.0 if middle[0] >= 0.0 else middle[0]], inner, [2.0 * middle[-1] - inner[-1]]])


@styled
def envelope_figure(channels: Sequence[Envelope], label: str) -> Figure:
    """Channels of one triad over the whole run: mean, and lowest to highest value as a band."""
    figure = new_figure(3.0)
    axes = figure.add_subplot()
    at = clock(channels[0].time)
    for place, one in enumerate(channels):
        look: dict[str, Any] = {"color": SERIES[place], "alpha": 0.18, "linewidth": 0.0}
        axes.fill_between(at.shown(one.time), one.low, one.high, **look)
        _line(axes, at.shown(one.time), one.mean, SERIES[place], one.name, place)
    axes.set_ylabel(f"{label}, {_printed(channels[0].unit)}")
    axes.set_xlabel(f"time, {at.unit}")
    _above(axes, 3)
    return figure


@styled
def excerpt_figure(found: Excerpt, names: Sequence[str], label: str) -> Figure:
    """Samples of one triad as they came."""
    figure = new_figure(3.0)
    axes = figure.add_subplot()
    for place, name in enumerate(names):
        axes.plot(
            found.time, found.channels[name], color=SERIES[place], linestyle=DASHES[place], label=name, linewidth=1.0
        )
    axes.set_ylabel(f"{label}, {_printed(found.units[names[0]])}")
    axes.set_xlabel("time, s")
    _above(axes, 3)
    return figure


def _printed(unit: str) -> str:
    return unit.replace("m/s^2", "m/s²").replace("m/s2", "m/s²")
