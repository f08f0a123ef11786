"""The report of a calibration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from inclinometry.calibration.expected import ALL_ANGLES, ExpectedUncertainty, expected_uncertainty
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.calibration.rollset import SecondHarmonics, second_harmonics
from inclinometry.constants import DIALS
from inclinometry.findings import only_notes, without_notes
from inclinometry.language import label, said
from inclinometry.report import calibration_tables as tables
from inclinometry.report import words
from inclinometry.report.calibration_tables import sensor_names
from inclinometry.report.figure import (
    BAD,
    DASHES,
    INK,
    MARKERS,
    SERIES,
    legend_above,
    look,
    new_figure,
    panel,
    station_axis,
    styled,
)
from inclinometry.report.page import CONVENTIONS, Picture, limit_rows, picture, render
from inclinometry.sensors import GRAVITY
from inclinometry.tabular import check_record

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MANY = 2000
"""Points above which markers are drawn as an image inside the SVG, to keep the page small."""


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
        points = look(sensor) | {"linestyle": "none", "markersize": 4.5 if stations <= 60 else 2.5}
        axes.plot(place + shift[sensor], values[:, sensor], label=name, rasterized=values.size > MANY, **points)
    # limits at two and three standard deviations, named at the right edge
    for level, colour, dash in ((2.0, INK, "--"), (3.0, BAD, "-")):
        for sign in (1.0, -1.0):
            axes.axhline(sign * level, color=colour, linestyle=dash, linewidth=1.0)
        # right of the points, where nothing else is
        beside: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points", "va": "center"}
        axes.annotate(f"{level:g}σ", (1.0, level), (4, 0), color=colour, annotation_clip=False, **beside)
    reach = 1.12 * max(3.4, float(np.nanmax(np.abs(values), initial=0.0)))
    if reach > 6.0:  # logarithmic, so that one outlier does not flatten the rest
        reach *= 1.4  # room for the marker where the scale is dense
        # linear to 4 standard deviations, logarithmic beyond, with plain numbers
        axes.set_yscale("symlog", linthresh=4.0)
        decades = np.arange(1, int(np.floor(np.log10(reach))) + 1)
        steps = np.concatenate([[2.0], [6.0] * (reach < 30.0), 10.0 ** decades[:: -(-len(decades) // 4) or 1]])
        ticks = [*(-steps[::-1]), 0.0, *steps]
        axes.set_yticks(ticks, labels=[f"{tick:g}".replace("-", "−") for tick in ticks])
        axes.set_yticks([], minor=True)
    axes.set_ylim(-reach, reach)
    axes.set_ylabel("residual / its σ")
    station_axis(axes, list(calibration.residuals.station))
    legend_above(axes, min(sensors, 4))
    return figure


@panel(2.5, y="error, deg")
def rig_figure(axes: Axes, calibration: Calibration, dial: int) -> None:
    """Estimated error of one dial at each station, bars of one standard uncertainty, limits at 2 sigma of a setting."""
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
    station_axis(axes, list(calibration.residuals.station))


@panel(3.2, "inclination, deg")
def expected_figure(axes: Axes, found: ExpectedUncertainty, name: str) -> None:
    """Expected standard uncertainty of one angle over inclination, by component."""
    x, column = np.degrees(found.inclination), ALL_ANGLES.index(name)
    worst = np.degrees(found.of_one_reading[:, column])
    axes.plot(x, worst, color=INK, linewidth=2.0, label="worst attitude")
    axes.plot(x, np.degrees(found.rms()[:, column]), color=INK, linestyle="--", label="rms")
    lowest = []
    causes = {"calibration": "calibration alone", "sensor noise": "noise of a reading", GRAVITY: "strength of gravity"}
    for n, component in enumerate(found.components):
        part = np.degrees(found.rms(component)[:, column])
        if (part > 0.0).any():
            lowest.append(float(part[part > 0.0].min()))
            axes.plot(
                x,
                part,
                color=SERIES[n],
                linestyle=DASHES[(n + 2) % len(DASHES)],
                label=label("{causes}, rms", causes=causes[component]),
            )
    if lowest:
        log_scale(axes, min(lowest), float(worst.max()))
    axes.set_xticks(range(0, 181, 30))
    axes.set_xlim(0, 180)
    axes.set_ylabel(label("u({name}), deg", name=name))
    legend_above(axes, 2)


@styled
def expected_map(found: ExpectedUncertainty, name: str) -> Figure:
    """Standard uncertainty of one angle over inclination and azimuth, worst over toolface."""
    from matplotlib.ticker import MaxNLocator

    values = np.degrees(np.sqrt(found.variance[..., ALL_ANGLES.index(name)].max(axis=2)))
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
    # the values for who points at them or takes the data
    across, down = np.meshgrid(azimuth, inclination)
    axes.scatter(across.ravel(), down.ravel(), c=values.ravel(), visible=False)
    bar = figure.colorbar(shade, ax=axes, orientation="horizontal", aspect=32, pad=0.03)
    bar.set_label(label("u({name}), deg", name=name))
    step = -(-len(levels) // 5)
    places = next((p for p in range(9) if np.allclose(levels, np.round(levels, p), rtol=0.0, atol=1e-9)), 9)
    bar.set_ticks(levels[::step], labels=[f"{level:.{places}f}" for level in levels[::step]])
    axes.set_xticks(np.arange(0, 361, 60))
    axes.set_yticks(range(0, 181, 30))
    axes.set_ylim(180, 0)
    axes.set_xlabel("azimuth, deg")
    axes.set_ylabel("inclination, deg")
    return figure


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


def calibration_report(
    calibration: Calibration,
    *,
    closed_forms: Mapping[str, Calibration] | None = None,
    dip: float | None = None,
    readings: BenchReadings | None = None,
) -> str:
    """A calibration as one self-contained HTML page, verdict first.

    Parameters
    ----------
    calibration : Calibration
        Of any method and any set of triads; sections adapt.
    closed_forms : mapping of name to Calibration, optional
        Other methods applied to the same readings, for comparison.
    dip : float, optional
        Of the magnetic field where the tool will work, rad (minus the latitude for a gyro tool). Default:
        that of the calibration stand.
    readings : BenchReadings, optional
        What was calibrated from; adds the settings to the tables and what was stated at the stand.

    Returns
    -------
    str
        HTML without any reference outside itself. The same input gives the same text.

    Examples
    --------
    >>> from inclinometry.rotations import dcm
    >>> from inclinometry.calibration import plans
    >>> from inclinometry.calibration.joint import calibrate_joint
    >>> p = plans.twelve()
    >>> signals = 1000.0 * dcm(p.azimuth, p.inclination, p.toolface) @ [0.0, 0.0, 1.0] + 7.0
    >>> readings = BenchReadings({"accelerometer": signals}, p.azimuth, p.inclination, p.toolface)
    >>> page = calibration_report(calibrate_joint(readings, noise_sd={"accelerometer": 0.1}, rig_sd=0.0, name="A7"))
    >>> page.startswith("<!doctype html>"), "One reading of A7 gives inclination within" in page
    (True, True)
    """
    check_record(calibration, Calibration, "calibration_report")
    tool, name = calibration.tool, words.tool_name(calibration)
    stated = None if readings is None else readings.reference.get("dip")
    grid = np.radians(np.arange(3.0, 178.0, 3.0))
    found = expected_uncertainty(calibration, grid, dip, stated_dip=stated)
    short = expected_uncertainty(calibration, dip=dip, stated_dip=stated)
    # the verdict speaks of 30 deg
    at_once = expected_uncertainty(calibration, np.radians(30.0), dip, stated_dip=stated)
    place, where = found.dip, _place(found)
    tests = words.calibration_tests(calibration)
    failed, open_ = (sum(test.passed is found for test in tests) for found in (False, None))
    told = without_notes(calibration.findings)
    troubles = len(told)
    rig_table = tables.rig_table(calibration, readings)
    second = None if readings is None else second_harmonics(readings)
    captions = {
        kind: label("Standardised residuals of the {kind}", kind=kind) for kind in calibration.residuals.standardised
    }
    return render(
        "calibration.html",
        title=label("Calibration of {value}", value=name or "a tool"),
        kind="Calibration report",
        heading=name or "Tool without a name",
        conventions=CONVENTIONS,
        state="warn" if failed else "good",
        badge=label("Warnings: {count}", count=troubles)
        if troubles
        else label("{failed} of {count} tests failed", failed=failed, count=len(tests))
        if failed
        else label("No warnings, {open_} of {count} tests not judged", open_=open_, count=len(tests))
        if open_
        else "No warnings, every test passed",
        verdict=words.verdict(calibration, at_once),
        notes=[line for line in (where, words.covers(calibration), *said(only_notes(calibration.findings))) if line],
        warnings=said(told),
        expected=tables.expected_tables(short),
        expected_figures=_expected_figures(found),
        budget=None if readings is None else tables.budget_table(calibration, readings, short),
        facts=words.run_facts(calibration, readings),
        rig=words.rig_sentences(calibration),
        rig_figures=_rig_figures(calibration),
        rig_table=rig_table and limit_rows(rig_table),
        tests=tables.test_table(tests),
        residuals=words.residual_sentences(calibration),
        residual_figures=[
            picture(residual_figure(calibration, kind), f"res{kind}", text) for kind, text in captions.items()
        ],
        residual_tables=[(k, limit_rows(t)) for k, t in tables.residual_tables(calibration, readings).items()],
        rolls=second and limit_rows(tables.roll_table(second, readings.units if readings else {})),
        roll_sentences=_rolls(second) if second else [],
        triads=[tables.triad_block(tool, kind) for kind in tool.triads],
        identifiability=words.identifiability_sentences(calibration),
        correlations=tables.correlation_table(calibration),
        comparison=tables.comparison_table(calibration, closed_forms or {}, place, at_once),
    )


def _rolls(second: SecondHarmonics) -> list[str]:
    """What the second harmonics of the roll sets mean."""
    if second.findings:
        return said(second.findings)
    uneven, u = np.degrees(abs(second.unevenness)), np.degrees(second.u_unevenness)
    return [
        label(
            "No second harmonic is larger than chance may make it: neither is a sensor seen to be non-linear nor "
            "the roll dial to turn unevenly ({uneven:.3f} ± {u:.3f} deg once a turn).",
            uneven=uneven,
            u=u,
        )
    ]


def _place(found: ExpectedUncertainty) -> str:
    """The place the expected uncertainty is for, and where its dip or latitude is from."""
    if found.azimuth_from is None or not found.angles:
        return ""
    name, value = ("dip", found.dip) if found.azimuth_from == "magnetometer" else ("latitude", -found.dip)
    source = {
        "given": "given",
        "calibration": "that of the calibration stand",
        "stated": "stated with the readings",
        "assumed": label("assumed, since none is known: give the {name} of the place of work", name=name),
    }[found.dip_from]
    warning = label(" At a place with another {name} the azimuth is better or worse.", name=name) * (
        found.dip_from == "calibration"
    )
    return label(
        "For a {name} of {value_deg:.1f}° ({source}).{warning}",
        name=name,
        value_deg=np.degrees(value),
        source=source,
        warning=warning,
    )


def _expected_figures(found: ExpectedUncertainty) -> list[Picture]:
    pictures = []
    for name in found.angles:
        caption = label(
            "Expected standard uncertainty of {name} of one reading over inclination, and its parts", name=name
        )
        pictures.append(picture(expected_figure(found, name), f"line{name}", caption))
    if found.azimuth_from is not None:
        for name in found.angles:
            caption = label(
                "Expected standard uncertainty of {name} of one reading over attitude, worst toolface", name=name
            )
            pictures.append(picture(expected_map(found, name), f"map{name}", caption))
    return pictures


def _rig_figures(calibration: Calibration) -> list[Picture]:
    if calibration.rig.errors is None:
        return []
    dashed = "bars: standard uncertainty; dashed: twice the standard deviation of a setting"
    return [
        picture(
            rig_figure(calibration, dial),
            f"rig{name}",
            label("Error of the {name} setting; {marks}", name=name, marks=dashed),
        )
        for dial, name in enumerate(DIALS)
    ]
