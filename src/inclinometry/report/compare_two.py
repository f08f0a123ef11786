"""The report of two calibrations of one tool: coefficients side by side, curves of the angles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from inclinometry.calibration.comparison import TwoCalibrations
from inclinometry.calibration.expected import FROM_CALIBRATION
from inclinometry.calibration.summary import rounded
from inclinometry.report.calibration_figures import log_scale
from inclinometry.report.content import CONVENTIONS, Table, TableRow, picture
from inclinometry.report.figure import DASHES, MARKERS, SERIES, new_figure, styled
from inclinometry.report.page import render

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FAR: Final = 4.0
"""Standard uncertainties of one of some twenty differences from which two calibrations contradict each other."""


def two_report(found: TwoCalibrations) -> str:
    """Two calibrations of one tool as one self-contained HTML page."""
    far = [row for row in found.coefficients if abs(row.sigmas) > FAR]
    agree = f"no coefficient differs by more than {FAR:g} of its standard uncertainties"
    differ = f"{len(far)} of {len(found.coefficients)} coefficients differ by more than {FAR:g} standard uncertainties"
    return render(
        "comparison.html",
        title="Two calibrations compared",
        kind="Comparison",
        heading=" and ".join(found.names),
        conventions=CONVENTIONS,
        state="warn" if far else "good",
        badge="Differ" if far else "Agree",
        verdict=f"{(differ if far else agree).capitalize()}.",
        notes=["The two are taken to be independent; each coefficient is at its calibration's reference temperature."],
        warnings=[f"{n}: {w}" for n, c in zip(found.names, found.calibrations, strict=True) for w in c.warnings],
        tables=[_table(found, kind) for kind in dict.fromkeys(row.kind for row in found.coefficients)],
        figures=[
            picture(
                _figure(found, column),
                f"two{name}",
                f"{name.capitalize()}: u {FROM_CALIBRATION} (k = 1) and difference, deg",
            )
            for column, name in enumerate(("inclination", "azimuth"))
            if np.isfinite(found.difference[:, column]).any()
        ],
        facts=[
            (f"{name}: {what}", digest)
            for name, c in zip(found.names, found.calibrations, strict=True)
            for what, digest in c.inputs.items()
        ],
    )


def _table(found: TwoCalibrations, kind: str) -> Table:
    rows = [row for row in found.coefficients if row.kind == kind]
    body = [
        TableRow(
            [
                f"{row.sensor} {row.name}",
                *(rounded(v, u) for v, u in zip(row.values, row.u, strict=True)),
                rounded(row.difference, row.u_difference),
                f"{row.sigmas:+.1f}" if np.isfinite(row.sigmas) else "",
            ],
            "warn" if abs(row.sigmas) > FAR else "",
        )
        for row in rows
    ]
    units = ", ".join(dict.fromkeys(f"{row.name} in {row.unit}" for row in rows if row.unit))
    return Table(f"{kind.capitalize()}: {units}", ["sensor", *found.names, "difference", "in its u"], body)


@styled
def _figure(found: TwoCalibrations, column: int) -> Figure:
    """Expected uncertainty of both, their difference, and true errors where known, over inclination."""
    figure = new_figure(3.4)
    axes = figure.add_subplot()
    x = np.degrees(found.inclination)
    curves = [(f"u, {name}", u[:, column]) for name, u in zip(found.names, found.uncertainty, strict=True)]
    curves.append(("difference, rms", found.difference[:, column]))
    curves += [
        (f"true error, {name}", error[:, column]) for name, error in zip(found.names, found.error or (), strict=False)
    ]
    seen = []
    for n, (name, values) in enumerate(curves):
        y = np.degrees(values)
        seen.append(y[np.isfinite(y) & (y > 0.0)])
        axes.plot(x, y, color=SERIES[n], linestyle=DASHES[n % len(DASHES)], marker=MARKERS[n], label=name)
    positive = np.concatenate(seen)
    if len(positive):
        log_scale(axes, float(positive.min()), float(positive.max()))
    axes.set_xlabel("inclination, deg")
    axes.set_ylabel("deg")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=1, borderaxespad=0.2)
    return figure
