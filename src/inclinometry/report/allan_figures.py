"""Drawings of Allan deviation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inclinometry.core.constants import COVERAGE_FACTOR
from inclinometry.io.allan_json import COEFFICIENTS, units_of
from inclinometry.report.figure import DASHES, INK, SERIES, new_figure, styled
from inclinometry.sensors.noise import ChannelNoise

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@styled
def allan_figure(channel: ChannelNoise) -> Figure:
    """Points with their band of expanded uncertainty, the fitted curve and its components."""
    units = units_of(channel)
    curve, factor = channel.curve, units.deviation.factor
    points, u = factor * curve.deviation, factor * curve.u
    figure = new_figure(3.6)
    axes = figure.add_subplot()
    seen = points > 0.0
    # in the logarithm the band keeps its width and never reaches nought
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
        title = units.coefficients[COEFFICIENTS.index(name)].title if name in COEFFICIENTS else name
        axes.plot(t, factor * part, color=SERIES[place + 1], linestyle=DASHES[place % 3 + 1], label=title)
    _scales(axes, low, float((points * np.exp(COVERAGE_FACTOR * u / np.maximum(points, 1e-300))).max()))
    axes.set_xlabel("averaging time, s")
    axes.set_ylabel(f"Allan deviation, {units.deviation.unit}")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.2, columnspacing=1.2)
    return figure


def _scales(axes: Axes, low: float, high: float) -> None:
    """Logarithmic axes with plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylim(low / 2.0, high * 1.3)
    narrow = np.log10(high / low) < 1.5
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if narrow else (1.0,), numticks=12))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
