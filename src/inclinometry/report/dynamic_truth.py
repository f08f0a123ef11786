"""One picture of several ways of finding a moving tool's attitude, against the truth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from inclinometry.core.angles import wrap_signed
from inclinometry.core.arrays import Array
from inclinometry.core.constants import COVERAGE_FACTOR
from inclinometry.report.calibration_figures import log_scale
from inclinometry.report.digits import significant
from inclinometry.report.figure import INK, SERIES, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


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
