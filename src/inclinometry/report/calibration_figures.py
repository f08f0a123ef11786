"""Drawings of a calibration: residuals, rig errors, expected uncertainty."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from inclinometry.calibration.expected import ANGLES, ExpectedUncertainty
from inclinometry.calibration.result import Calibration
from inclinometry.report.calibration_tables import sensor_names
from inclinometry.report.figure import BAD, DASHES, INK, MARKERS, SERIES, new_figure, station_axis, styled
from inclinometry.sensors.sensitivity import GRAVITY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MANY = 2000
"""Points above which markers are drawn as an image inside the SVG, to keep the page small."""
TICKS_DEG = (0, 30, 60, 90, 120, 150, 180)
FAR = 6.0
"""Standardised residual beyond which the scale turns logarithmic, so that one outlier does not flatten the rest."""


_CAUSES = {"calibration": "calibration alone", "sensor noise": "noise of a reading", GRAVITY: "strength of gravity"}


@styled
def residual_figure(calibration: Calibration, kind: str) -> Figure:
    """Standardised residuals of one triad per station and sensor, with limits at 2 and 3 standard deviations."""
    values = np.asarray(calibration.residuals.standardised[kind])
    stations, sensors = values.shape
    figure = new_figure(3.1)
    axes = figure.add_subplot()
    place = np.arange(stations)
    shift = 0.36 * (np.arange(sensors) - (sensors - 1) / 2.0) / max(sensors, 2)
    for sensor, name in enumerate(sensor_names(sensors)):
        axes.plot(
            place + shift[sensor],
            values[:, sensor],
            linestyle="none",
            marker=MARKERS[sensor % len(MARKERS)],
            color=SERIES[sensor % len(SERIES)],
            markersize=4.5 if stations <= 60 else 2.5,
            label=name,
            rasterized=values.size > MANY,
        )
    _sigma_lines(axes)
    reach = 1.12 * max(3.4, float(np.nanmax(np.abs(values), initial=0.0)))
    if reach > FAR:
        reach *= 1.4  # room for the marker where the scale is dense
        _outlier_scale(axes, reach)
    axes.set_ylim(-reach, reach)
    axes.set_ylabel("residual / its σ")
    station_axis(axes, list(calibration.residuals.station))
    _legend_above(axes, sensors)
    return figure


def _sigma_lines(axes: Axes) -> None:
    """Limits at two and three standard deviations, named at the right edge."""
    for level, colour, dash in ((2.0, INK, "--"), (3.0, BAD, "-")):
        for sign in (1.0, -1.0):
            axes.axhline(sign * level, color=colour, linestyle=dash, linewidth=1.0)
        # right of the points, where nothing else is
        axes.annotate(
            f"{level:g}σ",
            (1.0, level),
            xycoords=("axes fraction", "data"),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            color=colour,
            annotation_clip=False,
        )


@styled
def rig_figure(calibration: Calibration, dial: int) -> Figure:
    """Estimated error of one dial at each station, bars of one standard uncertainty, limits at 2 sigma of a setting."""
    figure = new_figure(2.5)
    axes = figure.add_subplot()
    if calibration.rig.errors is not None:
        value = np.degrees(calibration.rig.errors[:, dial])
        sd = calibration.rig.errors_sd
        bars = None if sd is None else np.degrees(sd[:, dial])
        place = np.arange(len(value))
        size = 4.5 if len(place) <= 60 else 2.5
        mark: dict[str, Any] = {"linestyle": "none", "marker": MARKERS[dial], "color": SERIES[dial]}
        axes.errorbar(place, value, bars, elinewidth=1.2, markersize=size, rasterized=len(place) > MANY, **mark)
    limit = 2.0 * float(np.degrees(np.broadcast_to(calibration.rig.sd, (3,))[dial]))
    for level in (-limit, 0.0, limit):
        axes.axhline(level, color=INK, linestyle="-" if level == 0.0 else "--", linewidth=0.9)
    axes.set_ylabel("error, deg")
    station_axis(axes, list(calibration.residuals.station))
    return figure


@styled
def expected_figure(found: ExpectedUncertainty, name: str) -> Figure:
    """Expected standard uncertainty of one angle over inclination, by component."""
    figure = new_figure(3.2)
    axes = figure.add_subplot()
    x, column = np.degrees(found.inclination), ANGLES.index(name)
    worst = np.degrees(found.of_one_reading[:, column])
    axes.plot(x, worst, color=INK, linewidth=2.0, label="worst attitude")
    axes.plot(x, np.degrees(found.rms()[:, column]), color=INK, linestyle="--", label="rms")
    lowest = []
    for n, component in enumerate(found.components):
        part = np.degrees(found.rms(component)[:, column])
        if (part > 0.0).any():
            lowest.append(float(part[part > 0.0].min()))
            axes.plot(
                x, part, color=SERIES[n], linestyle=DASHES[(n + 2) % len(DASHES)], label=f"{_CAUSES[component]}, rms"
            )
    if lowest:
        log_scale(axes, min(lowest), float(worst.max()))
    axes.set_xticks(TICKS_DEG)
    axes.set_xlim(0, 180)
    axes.set_xlabel("inclination, deg")
    axes.set_ylabel(f"u({name}), deg")
    _legend_above(axes, 2)
    return figure


@styled
def expected_map(found: ExpectedUncertainty, name: str) -> Figure:
    """Standard uncertainty of one angle over inclination and azimuth, worst over toolface."""
    from matplotlib.ticker import MaxNLocator

    values = np.degrees(np.sqrt(found.variance[..., ANGLES.index(name)].max(axis=2)))
    values = np.concatenate([values, values[:, :1]], axis=1)  # 360 deg is 0 deg again
    inclination = np.degrees(found.inclination)
    azimuth = np.linspace(0.0, 360.0, values.shape[1])
    # near the vertical azimuth and toolface grow without bound: the scale ends where the tool hangs at 15 deg
    inside = values[(inclination >= 15.0) & (inclination <= 165.0)]
    low, high = float(inside.min()), float(inside.max())
    if high - low < 1e-3 * high:
        low, high = 0.95 * low, 1.05 * high
    levels = MaxNLocator(8).tick_values(low, high)
    figure = new_figure(3.6)
    axes = figure.add_subplot()
    shade = axes.contourf(azimuth, inclination, values, levels=levels, extend="max", cmap="cividis")
    bar = figure.colorbar(shade, ax=axes, orientation="horizontal", aspect=32, pad=0.03)
    bar.set_label(f"u({name}), deg")
    step = -(-len(levels) // 5)
    places = next((p for p in range(9) if np.allclose(levels, np.round(levels, p), rtol=0.0, atol=1e-9)), 9)
    bar.set_ticks(levels[::step], labels=[f"{level:.{places}f}" for level in levels[::step]])
    axes.set_xticks(np.arange(0, 361, 60))
    axes.set_yticks(TICKS_DEG)
    axes.set_ylim(180, 0)
    axes.set_xlabel("azimuth, deg")
    axes.set_ylabel("inclination, deg")
    return figure


def _outlier_scale(axes: Axes, reach: float) -> None:
    """Linear to 4 standard deviations, logarithmic beyond, with plain numbers."""
    axes.set_yscale("symlog", linthresh=4.0)
    decades = np.arange(1, int(np.floor(np.log10(reach))) + 1)
    steps = np.concatenate([[2.0], [6.0] * (reach < 30.0), 10.0 ** decades[:: -(-len(decades) // 4) or 1]])
    ticks = [*(-steps[::-1]), 0.0, *steps]
    axes.set_yticks(ticks, labels=[f"{tick:g}".replace("-", "−") for tick in ticks])
    axes.set_yticks([], minor=True)


def log_scale(axes: Axes, low: float, high: float) -> None:
    """Logarithmic y axis with plain numbers, labelled often enough that two can be read."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set_yscale("log")
    axes.set_ylim(low / 1.3, high * 1.3)
    decades = np.log10(high / low)
    subs = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0) if decades < 0.9 else (1.0, 2.0, 5.0) if decades < 2.5 else (1.0,)
    axes.yaxis.set_major_locator(LogLocator(subs=subs, numticks=20))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _legend_above(axes: Axes, columns: int) -> None:
    axes.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=min(columns, 4), borderaxespad=0.2, handletextpad=0.5
    )
