"""Drawings of a gyro run: scale factor over temperature, methods compared, a hot run against its truth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from inclinometry.core.angles import wrap_signed
from inclinometry.core.arrays import Array, Mask
from inclinometry.core.constants import COVERAGE_FACTOR
from inclinometry.core.errors import InputError
from inclinometry.gyro.result import North
from inclinometry.gyro.tracking import ScaleTrack
from inclinometry.report.calibration_figures import MANY
from inclinometry.report.digits import significant
from inclinometry.report.figure import BAD, DASHES, INK, MARKERS, SERIES, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SINGULAR = 0.1
"""|K| below which noise of the rates reaches the scale factor of the closed form more than tenfold."""

PER_CENT = 100.0
TEMPERATURE = "temperature, °C"
DEPTH = "measured depth, m"


def method_label(method: str) -> str:
    """A method of `North` in words a newcomer knows.

    Examples
    --------
    >>> method_label("fixed"), method_label("tracked")
    ('uncompensated', 'tracked')
    """
    return {"fixed": "uncompensated", "patent": "patent, closed form"}.get(method, method)


def scale_course(track: ScaleTrack) -> tuple[Array, Array, Array]:
    """Temperatures, scale and its standard uncertainty (m,) of the curve that was learnt.

    The belief after the run; where the scale wanders from temperature to temperature, what the run says at each station
    without its own rates, because the belief then holds at the end of the run only.
    """
    if track.belief.walk > 0.0 or not len(track):
        place = scale_place(track)
        order = np.argsort(place, kind="stable")
        return place[order], track.expected[order], track.expected_sd[order]
    heat = np.linspace(float(track.temperature.min()), float(track.temperature.max()), 121)
    return heat, *track.belief.predict(heat)


def scale_place(track: ScaleTrack) -> Array:
    """Abscissa (n,) of a track: temperatures, or without a thermometer the number of the station."""
    return track.temperature if track.thermometer else np.arange(1.0, len(track) + 1.0)


@styled
def scale_figure(track: ScaleTrack) -> Figure:
    """Each station's scale with bars of expanded uncertainty, and the curve that was learnt with its band."""
    figure = new_figure(3.6)
    axes = figure.add_subplot()
    _scale_panel(axes, track)
    used, size = track.learnt, 4.5 if len(track) <= 80 else 2.5
    for rows, colour, marker, label in (
        (used, SERIES[1], "o", "station"),
        (~used, BAD, "X", "nothing learnt"),
    ):
        if rows.any():
            look: dict[str, Any] = {
                "linestyle": "none",
                "elinewidth": 1.0,
                "markersize": size if marker == "o" else 6.5,
            }
            bars, value = COVERAGE_FACTOR * PER_CENT * track.scale_sd[rows], _per_cent(track.scale[rows])
            few = int(rows.sum()) <= MANY
            axes.errorbar(
                scale_place(track)[rows],
                value,
                bars,
                marker=marker,
                color=colour,
                label=label,
                rasterized=not few,
                **look,
            )
    axes.set_xlabel(TEMPERATURE if track.thermometer else "station")
    _above(axes, 2)
    return figure


def _per_cent(scale: Array) -> Array:
    """A scale factor as what it adds to the readings, %."""
    return np.asarray(PER_CENT * (scale - 1.0))


def _scale_panel(axes: Axes, track: ScaleTrack, label: str = "learnt", colour: str = SERIES[0]) -> None:
    heat, scale, sd = scale_course(track)
    middle, spread = _per_cent(scale), COVERAGE_FACTOR * PER_CENT * sd
    band: dict[str, Any] = {
        "color": colour,
        "alpha": 0.2,
        "linewidth": 0.0,
        "label": f"its ±U (k = {COVERAGE_FACTOR:g})",
    }
    axes.plot(heat, middle, color=colour, label=label)
    axes.fill_between(heat, middle - spread, middle + spread, **band)
    axes.set_ylabel("scale factor − 1, %")


def _above(axes: Axes, columns: int) -> None:
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, borderaxespad=0.2, columnspacing=1.2)


@styled
def difference_figure(north: North, others: Mapping[str, North], place: Array, label: str) -> Figure:
    """Azimuth by other methods less the one reported, with its band of U; failures stand on the lower edge.

    Parameters
    ----------
    north : North
        What is reported.
    others : mapping of name to North
        The same stations by other methods.
    place : (n,) array
        Abscissa, and `label` its name with the unit.
    """
    figure = new_figure(3.6)
    axes = figure.add_subplot()
    band = COVERAGE_FACTOR * np.degrees(north.u("azimuth"))
    differences = {
        method_label(name): np.degrees(wrap_signed(other.azimuth - north.azimuth)) for name, other in others.items()
    }
    _differences(axes, place, differences, band, f"U of the azimuth reported ({method_label(north.method)})")
    axes.set_ylabel("azimuth difference, deg")
    axes.set_xlabel(label)
    _above(axes, 1)
    return figure


def _differences(axes: Axes, place: Array, values: Mapping[str, Array], band: Array, band_label: str) -> None:
    """Differences in degrees about zero with a band; what is off the axis or missing is marked at its edge."""
    order = np.argsort(place, kind="stable")
    wide = np.minimum(band, 180.0)[order]
    axes.fill_between(place[order], -wide, wide, color=SERIES[2], alpha=0.25, linewidth=0.0, label=band_label)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    reach = _reach(values, band)
    for n, (name, value) in enumerate(values.items()):
        colour = SERIES[(1, 0, 2, 3, 4, 5)[n % 6]]
        inside = np.where(np.abs(value) <= reach, value, np.nan)
        few = len(value) <= 80
        axes.plot(
            place[order], inside[order], color=colour, linestyle=DASHES[n % len(DASHES)] if few else "none",
            linewidth=1.0, marker=MARKERS[n % len(MARKERS)], markersize=3.8 if few else 2.0, label=name,
            rasterized=len(value) > MANY,
        )  # fmt: skip
        _edge(axes, place, value, reach, colour)
    axes.set_ylim(-1.12 * reach, 1.12 * reach)


def _reach(values: Mapping[str, Array], band: Array) -> float:
    """Half the height of the axis, deg: most of the points, not the few a failing closed form throws far away."""
    sizes = [np.abs(value[np.isfinite(value)]) for value in values.values()]
    tall = [float(np.quantile(size, 0.9)) for size in sizes if len(size)]
    reach = 2.0 * max([*tall, float(np.median(np.minimum(band, 90.0))) if len(band) else 0.0], default=0.0)
    return float(np.clip(reach, 1e-6, 180.0))


def _edge(axes: Axes, place: Array, value: Array, reach: float, colour: str) -> None:
    """Triangles point to what lies beyond the axis; a cross on the lower edge says that there is no value."""
    for rows, at, marker in ((value > reach, reach, "^"), (value < -reach, -reach, "v")):
        if rows.any():
            axes.plot(place[rows], np.full(int(rows.sum()), 1.05 * at), linestyle="none", marker=marker, color=colour)
    lost = ~np.isfinite(value)
    if lost.any():
        low = np.full(int(lost.sum()), -1.05 * reach)
        axes.plot(place[lost], low, linestyle="none", marker="x", color=BAD, markersize=6.5, markeredgewidth=1.8)


@styled
def condition_figure(k: Array, place: Array, label: str, lost: Mask) -> Figure:
    """K over the stations with the band in which the scale factor cannot be seen; `lost` are closed-form failures."""
    figure = new_figure(3.0)
    axes = figure.add_subplot()
    order = np.argsort(place, kind="stable")
    axes.axhspan(-SINGULAR, SINGULAR, color=BAD, alpha=0.15, linewidth=0.0, label="scale not seen")
    axes.axhline(0.0, color=INK, linewidth=0.8)
    axes.plot(place[order], k[order], color=SERIES[0], marker="o" if len(k) <= 80 else None, markersize=3.0, label="K")
    if lost.any():
        look: dict[str, Any] = {"linestyle": "none", "marker": "x", "markersize": 6.5, "markeredgewidth": 1.8}
        axes.plot(place[lost], k[lost], color=BAD, label="closed form failed", **look)
    axes.set_ylim(min(-0.2, 1.08 * float(np.nanmin(k, initial=0.0))), max(0.3, 1.08 * float(np.nanmax(k, initial=0.0))))
    axes.set_ylabel("K")
    axes.set_xlabel(label)
    _above(axes, 2)
    return figure


@styled
def hot_run_figure(
    temperature: Array,
    inclination: Array,
    errors: Mapping[str, Array],
    u: Mapping[str, Array],
    scale_true: Array,
    track: ScaleTrack,
) -> Figure:
    """A run into a hot hole against its truth: azimuth error of several methods, scale factor, inclination.

    Parameters
    ----------
    temperature, inclination : (n,) array
        degC, rad.
    errors : mapping of name to (n,) array
        Azimuth found less true azimuth, rad; NaN where the method fails.
    u : mapping of name to (n,) array
        Standard uncertainty of azimuth, rad, of methods in `errors`; the band is the last one's.
    scale_true : (n,) array
        True rate over reading.
    track : ScaleTrack

    Returns
    -------
    Figure
        Root mean square errors, over the stations where the method gives an azimuth, stand in the legend.

    Raises
    ------
    InputError
        No method, no uncertainty, or lengths that do not go together.

    Examples
    --------
    >>> from inclinometry.gyro.tracking import quadratic_belief, track_scale
    >>> heat = np.array([20.0, 80.0, 140.0])
    >>> track = track_scale([[0.7, 0.0]] * 3, [1e-8 * np.eye(2)] * 3, 0.1, 0.8, heat, quadratic_belief())
    >>> error = np.array([0.001, np.nan, 0.002])
    >>> u = np.full(3, 0.001)
    >>> len(hot_run_figure(heat, 0.1 + 0.0 * heat, {"joint": error}, {"joint": u}, track.scale, track).axes)
    3
    """
    size = len(temperature)
    if not errors or not u:
        raise InputError("no azimuth errors or no uncertainty to draw; give at least one of each")
    own = {"inclination": inclination, "scale_true": scale_true, "track": track.scale}
    for name, value in (*own.items(), *errors.items(), *u.items()):
        if len(value) != size:
            raise InputError(f"{name} has {len(value)} stations, temperature {size}; give one value for each station")
    figure = new_figure(8.2, width=9.0)
    top, middle, low = figure.subplots(3, 1, sharex=True, height_ratios=(5, 4, 1.6))
    named = {_with_rms(name, value): np.degrees(value) for name, value in errors.items()}
    who, spread = list(u.items())[-1]
    _differences(top, temperature, named, COVERAGE_FACTOR * np.degrees(spread), f"95 % band that “{who}” states")
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


def _with_rms(name: str, error: Array) -> str:
    good = error[np.isfinite(error)]
    rms = significant(float(np.degrees(np.sqrt(np.mean(good**2))))) if len(good) else "not known"
    lost = len(error) - len(good)
    return f"{name}: rms {rms}°{f', no azimuth at {lost} of {len(error)}' if lost else ''}"
