"""The report of a noise analysis."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inclinometry.allan import ChannelNoise, Coefficient, NoiseRecord
from inclinometry.constants import COVERAGE_FACTOR
from inclinometry.files.allan_json import COEFFICIENTS, PlottedCurve, coefficients_of, units_of
from inclinometry.language import label, number, said
from inclinometry.report.calibration import log_scale
from inclinometry.report.figure import DASHES, INK, SERIES, legend_above, new_figure, styled
from inclinometry.report.page import Section, Table, TableRow, picture, report
from inclinometry.report.words import listed, significant, with_uncertainty

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@styled
def allan_figure(channel: ChannelNoise) -> Figure:
    """Points with their band of expanded uncertainty, the fitted curve and its components."""
    units = units_of(channel)
    curve, factor = channel.curve, units[-1].factor
    points, u = factor * curve.deviation, factor * curve.u
    figure = new_figure(3.6)
    axes = figure.add_subplot()
    seen = points > 0.0
    # in the logarithm the band keeps its width and never reaches zero
    spread = np.exp(COVERAGE_FACTOR * u[seen] / points[seen])
    axes.fill_between(
        curve.tau[seen], points[seen] / spread, points[seen] * spread, color=SERIES[0], alpha=0.22, linewidth=0.0
    )
    axes.plot(curve.tau[seen], points[seen], linestyle="none", marker="o", color=SERIES[0], markersize=3.2,
              label="measured")  # fmt: skip
    low = float(points[seen].min())
    t = np.geomspace(curve.tau[0], curve.tau[-1], 200)
    total = factor * channel.model.deviation(t)
    if total.max() > 0.0:
        axes.plot(t, total, color=INK, label="fitted")
        low = min(low, float(total.min()))
    for place, (name, part) in enumerate(channel.model.parts(t).items()):
        title = units[COEFFICIENTS.index(name)].title if name in COEFFICIENTS else name
        axes.plot(t, factor * part, color=SERIES[place + 1], linestyle=DASHES[place % 3 + 1], label=title)
    high = float((points * np.exp(COVERAGE_FACTOR * u / np.maximum(points, 1e-300))).max())
    log_scale(axes, low, high)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(axes.yaxis.get_major_formatter())
    axes.xaxis.set_minor_formatter(axes.yaxis.get_minor_formatter())
    axes.set_xlabel("averaging time, s")
    axes.set_ylabel(label("Allan deviation, {unit}", unit=units[-1].unit))
    legend_above(axes, 2)
    return figure


def allan_report(record: NoiseRecord) -> str:
    """The noise of an instrument as one self-contained HTML page: coefficients, curves, what was analysed."""
    troubles = len(record.findings)
    tables = []
    for kind in record.kinds:
        units, body = units_of(record.of(kind)[0]), []
        for c in record.of(kind):
            found = (coefficient_text(*pair) for pair in coefficients_of(c))
            body.append(TableRow([c.name, *found, f"{c.model.chi_square:.1f}", str(c.model.dof)]))
        head = [
            "channel",
            *(label("{name}, {unit}", name=s.title, unit=s.unit) for s in units[:3]),
            "misfit",
            "degrees of freedom",
        ]
        caption = label("{kind}: coefficient ± standard uncertainty, or upper limit (95 %)", kind=kind.capitalize())
        tables.append(Table(caption, head, body))
    what = label(
        "Allan deviation with its band (k = {k:g}), the fitted curve and its components",
        k=COVERAGE_FACTOR,
    )
    pictures = [
        picture(allan_figure(c), f"allan{n}", f"{c.name}{label(': ')}{what}") for n, c in enumerate(record.channels)
    ]
    parts = []
    for triad in record.kinds:
        shown, _ = coefficients_of(record.of(triad)[0])[0]
        levels = [one.value * shown.factor for _, one in (coefficients_of(x)[0] for x in record.of(triad)) if one.seen]
        if levels:
            low, high = (significant(v) for v in (min(levels), max(levels)))
            span = low if low == high else label("{low} to {high}", low=low, high=high)
            value, (unit, noise) = number(span), (shown.unit, shown.title)
            parts.append(label("{triad} {value} {unit} ({noise})", triad=triad, value=value, unit=unit, noise=noise))
    length = label(
        "{samples} samples over {time_s} s",
        samples=record.samples,
        time_s=significant(record.samples * record.dt, 3),
    )
    return report(
        "Noise report",
        "Noise at rest",
        label("{length}: {names}.", length=length, names=listed(parts))
        if parts
        else label("{length}: no white noise is seen.", length=length),
        [Section("Noise of each channel", tables=tables), Section("Allan deviation", pictures=pictures)],
        [
            ("Samples", str(record.samples)),
            ("Sampling interval", label("{time_s:.6g} s", time_s=record.dt)),
            ("Length", label("{time_s:.6g} s", time_s=record.samples * record.dt)),
        ],
        about="What was analysed",
        states=[
            (troubles, "warn", label("Warnings: {count}", count=troubles)),
            (True, "good", "No warnings"),
        ],
        notes=[
            "Coefficients as in IEEE Std 952-1997: the Allan variance over a time t is N²/t + 0.441 B² + K² t/3. "
            "Where a record is too short to see one, its upper limit (95 %) stands instead."
        ],
        warnings=said(record.findings),
        inputs=record.inputs,
    )


def coefficient_text(shown: PlottedCurve, found: Coefficient) -> str:
    """A coefficient as people read it: value and standard uncertainty, or the limit it does not exceed."""
    if not found.seen:
        return f"< {significant(shown.factor * found.limit)}"
    return with_uncertainty(shown.factor * found.value, shown.factor * found.u)
