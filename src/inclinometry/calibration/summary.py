"""Results as text, for a notebook or a prompt."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from inclinometry.sensors.tool import Tool

if TYPE_CHECKING:
    from inclinometry.calibration.readings import BenchReadings
    from inclinometry.calibration.result import Calibration


def columns(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of right-aligned columns, the first left-aligned.

    Examples
    --------
    >>> print(*columns(["a", "value"], [["x", "1.0"], ["long", "-12"]]), sep="\\n")
    a     value
    x       1.0
    long    -12
    """
    table = [list(header), *map(list, rows)]
    widths = [max(len(row[i]) for row in table) for i in range(len(header))]
    return [
        "  ".join(c.ljust(w) if i == 0 else c.rjust(w) for i, (c, w) in enumerate(zip(r, widths, strict=True)))
        for r in table
    ]


def rounded(value: float, u: float) -> str:
    """A value and its uncertainty to two digits of the latter."""
    if not (np.isfinite(u) and u > 0.0):
        return f"{value:.6g}"
    digits = max(0, 1 - int(np.floor(np.log10(u))))
    return f"{value:.{digits}f} ± {u:.{digits}f}"


def tool_rows(tool: Tool) -> list[list[str]]:
    """Rows of sensor, x, y, z, offset with uncertainties."""
    u = np.sqrt(np.diagonal(tool.covariance))
    rows = []
    for kind, triad in tool.triads.items():
        block = u[tool.slices[kind]].reshape(triad.degree + 1, triad.count, 4)[0]
        for sensor in range(triad.count):
            values = [*triad.tensor[0, sensor], triad.offset[0, sensor]]
            cells = [rounded(v, s) for v, s in zip(values, block[sensor], strict=True)]
            rows.append([f"{kind} {sensor + 1} ({triad.unit})", *cells])
    return rows


def calibration_text(found: Calibration) -> str:
    """What `repr` of a calibration says."""
    name = f" of {found.tool.name}" if found.tool.name else ""
    lines = [f"Calibration{name}: method {found.method}, {len(found.residuals.station)} stations"]
    lines += columns(["sensor", "along x", "along y", "along z", "offset"], tool_rows(found.tool))
    for kind, direction in found.field_directions.items():
        below = np.degrees(np.arcsin(np.clip(direction[2], -1.0, 1.0)))
        lines.append(
            f"{kind} field in rig axes: {np.round(direction, 5).tolist()}, {below:.3f} deg below the rig's horizon"
        )
    if np.any(found.rig.sd):
        lines.append(f"rig settings good to {np.degrees(found.rig.sd).max():.3f} deg (standard deviation)")
    lines += [
        f"{title}: {np.degrees(v):+.4f} ± {np.degrees(s):.4f} deg" for title, (v, s) in found.rig.nuisance.items()
    ]
    return "\n".join([*lines, *(f"warning: {sentence}" for sentence in found.warnings)])


def readings_text(readings: BenchReadings) -> str:
    """What `repr` of bench readings says."""
    channels = ", ".join(f"{kind} ({v.shape[1]}, {readings.units[kind]})" for kind, v in readings.channels.items())
    dials = "with rig angles" if readings.azimuth is not None else "without rig angles"
    heat = readings.temperature
    span = "" if heat is None else f", {heat.min():.1f} to {heat.max():.1f} degC"
    return "\n".join(
        [f"BenchReadings: {len(readings)} stations {dials}{span}; {channels}", *readings.notes, *readings.warnings]
    )
