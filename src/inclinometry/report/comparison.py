"""Methods of calibration side by side, as one picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite
from inclinometry.calibration.comparison import TwoCalibrations
from inclinometry.calibration.expected import FROM_CALIBRATION
from inclinometry.calibration.result import rounded
from inclinometry.errors import refused, wrong_shape
from inclinometry.findings import without_notes
from inclinometry.language import label, said
from inclinometry.report.calibration import log_scale
from inclinometry.report.figure import INK, legend_above, look, new_figure, panel, styled
from inclinometry.report.page import CONVENTIONS, Table, TableRow, picture, render
from inclinometry.report.words import listed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# The report of two calibrations of one tool: coefficients side by side, curves of the angles.


def two_report(found: TwoCalibrations) -> str:
    """Two calibrations of one tool as one self-contained HTML page."""
    much = 4.0  # standard uncertainties: from there one of some twenty differences contradicts
    far = [row for row in found.coefficients if abs(row.sigmas) > much]
    agree = label("no coefficient differs by more than {much:g} of its standard uncertainties", much=much)
    differ = label(
        "{count} of {total} coefficients differ by more than {much:g} standard uncertainties",
        count=len(far),
        total=len(found.coefficients),
        much=much,
    )
    tables = []
    for kind in dict.fromkeys(row.kind for row in found.coefficients):
        rows, body = [row for row in found.coefficients if row.kind == kind], []
        for row in rows:
            cells = [
                f"{row.sensor} {label(row.name)}",
                *(rounded(v, u) for v, u in zip(row.values, row.u, strict=True)),
            ]
            cells += [rounded(row.difference, row.u_difference)]
            cells += [f"{row.sigmas:+.1f}" if np.isfinite(row.sigmas) else ""]
            body.append(TableRow(cells, "warn" if abs(row.sigmas) > much else ""))
        units = label(", ").join(
            dict.fromkeys(label("{name} in {unit}", name=row.name, unit=row.unit) for row in rows if row.unit)
        )
        head = ["sensor", *found.names, "difference", "in its u"]
        tables.append(Table(f"{label(kind.capitalize())}{label(': ')}{units}", head, body))
    return render(
        "comparison.html",
        title="Two calibrations compared",
        kind="Comparison",
        heading=listed(list(found.names)),
        conventions=CONVENTIONS,
        state="warn" if far else "good",
        badge="Differ" if far else "Agree",
        verdict=label("{sentence}.", sentence=(differ if far else agree).capitalize()),
        notes=["The two are taken to be independent; each coefficient is at its calibration's reference temperature."],
        warnings=[
            f"{n}{label(': ')}{one}"
            for n, c in zip(found.names, found.calibrations, strict=True)
            for one in said(without_notes(c.findings))
        ],
        tables=tables,
        figures=[
            picture(
                _figure(found, column),
                f"two{name}",
                label(
                    "{angle}: u {part} (k = 1) and difference, deg",
                    angle=name.capitalize(),
                    part=FROM_CALIBRATION,
                ),
            )
            for column, name in enumerate(("inclination", "azimuth"))
            if np.isfinite(found.difference[:, column]).any()
        ],
        facts=[
            (f"{name}{label(': ')}{label(what)}", digest)
            for name, c in zip(found.names, found.calibrations, strict=True)
            for what, digest in c.inputs.items()
        ],
    )


@panel(3.4, "inclination, deg", "deg")
def _figure(axes: Axes, found: TwoCalibrations, column: int) -> None:
    """Expected uncertainty of both, their difference, and true errors where known, over inclination."""
    x = np.degrees(found.inclination)
    curves = [(f"u, {name}", u[:, column]) for name, u in zip(found.names, found.uncertainty, strict=True)]
    curves.append(("difference, rms", found.difference[:, column]))
    curves += [
        (label("true error, {name}", name=name), error[:, column])
        for name, error in zip(found.names, found.error or (), strict=False)
    ]
    seen = []
    for n, (name, values) in enumerate(curves):
        y = np.degrees(values)
        seen.append(y[np.isfinite(y) & (y > 0.0)])
        axes.plot(x, y, label=name, **look(n))
    positive = np.concatenate(seen)
    if len(positive):
        log_scale(axes, float(positive.min()), float(positive.max()))
    legend_above(axes, 1)


class MethodCurve(NamedTuple):
    """Standard deviation of the angles of a tool calibrated by one method, over inclination; all (n,), rad."""

    name: str
    inclination: ArrayLike
    sd_inclination: ArrayLike
    sd_azimuth: ArrayLike


@styled
def comparison_figure(rows: Sequence[MethodCurve], *, title: str = "") -> Figure:
    """Expected error of inclination and azimuth over inclination, logarithmic; the first method is drawn strongest."""
    if not rows:
        raise refused("input-empty", {"name": "rows"})
    figure = new_figure(3.9, width=9.0)
    panels = figure.subplots(1, 2)
    for axes, name, column in zip(panels, ("inclination", "azimuth"), (2, 3), strict=True):
        handles: list[object] = []
        levels: list[Array] = []
        for n, row in enumerate(rows):
            x = np.degrees(finite(row.inclination, f"{row.name}.inclination", (None,)))
            y = np.degrees(finite(row[column], f"{row.name}.error", (None,)))
            if x.shape != y.shape:
                raise wrong_shape(f"{row.name}.error", y.shape, str(x.shape))
            levels.append(y[y > 0.0])
            every, width = (n % 3, 3) if len(x) > 12 else None, 2.4 if n == 0 else 1.6
            handles += axes.plot(x, y, markevery=every, linewidth=width, label=row.name, **look(n))
        positive = np.concatenate(levels)
        if len(positive):
            log_scale(axes, float(positive.min()), float(positive.max()))
        axes.set_title(label("standard deviation of {name}, deg", name=name))
        axes.set_xlabel("inclination, deg")
    figure.legend(handles=handles, loc="outside lower center", ncols=len(rows) if len(rows) <= 4 else 3)
    if title:
        figure.suptitle(title, x=0.01, ha="left", fontsize=12, color=INK)
    return figure
