"""Methods of calibration side by side, as one picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array, finite
from inclinometry.core.errors import InputError
from inclinometry.report.calibration_figures import log_scale
from inclinometry.report.figure import DASHES, INK, MARKERS, SERIES, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class MethodCurve(NamedTuple):
    """Standard deviation of the angles of a tool calibrated by one method, over inclination; all (n,), rad."""

    name: str
    inclination: ArrayLike
    sd_inclination: ArrayLike
    sd_azimuth: ArrayLike


@styled
def comparison_figure(rows: Sequence[MethodCurve], *, title: str = "") -> Figure:
    """Expected error of inclination and azimuth of several methods, side by side over inclination, logarithmic.

    Parameters
    ----------
    rows : sequence of MethodCurve
        The first is drawn strongest.
    title : str

    Returns
    -------
    Figure
        For `figure.save_png`, `figure.save_svg` or, on a page, `figure.inline_svg`.

    Raises
    ------
    InputError
        No method, or lengths that do not go together.

    Examples
    --------
    >>> curve = MethodCurve("joint", [0.5, 1.0], [1e-4, 1e-4], [1e-3, 8e-4])
    >>> len(comparison_figure([curve]).axes)
    2
    """
    if not rows:
        raise InputError("no method to compare; give at least one")
    figure = new_figure(3.9, width=9.0)
    panels = figure.subplots(1, 2)
    handles: list[object] = []
    for axes, name, column in zip(panels, ("inclination", "azimuth"), (2, 3), strict=True):
        handles = _panel(axes, rows, column)
        axes.set_title(f"standard deviation of {name}, deg")
        axes.set_xlabel("inclination, deg")
    figure.legend(handles=handles, loc="outside lower center", ncols=len(rows) if len(rows) <= 4 else 3)
    if title:
        figure.suptitle(title, x=0.01, ha="left", fontsize=12, color=INK)
    return figure


def _panel(axes: Axes, rows: Sequence[MethodCurve], column: int) -> list[object]:
    handles: list[object] = []
    levels: list[Array] = []
    for n, row in enumerate(rows):
        x = np.degrees(finite(row.inclination, f"inclination of {row.name}", (None,)))
        y = np.degrees(finite(row[column], f"error of {row.name}", (None,)))
        if x.shape != y.shape:
            raise InputError(f"{row.name}: {x.shape[0]} inclinations and {y.shape[0]} errors; give one for each")
        levels.append(y[y > 0.0])
        (line,) = axes.plot(
            x,
            y,
            color=SERIES[n % len(SERIES)],
            linestyle=DASHES[n % len(DASHES)],
            marker=MARKERS[n % len(MARKERS)],
            markevery=(n % 3, 3) if len(x) > 12 else None,
            linewidth=2.4 if n == 0 else 1.6,
            label=row.name,
        )
        handles.append(line)
    positive = np.concatenate(levels)
    if len(positive):
        log_scale(axes, float(positive.min()), float(positive.max()))
    return handles
