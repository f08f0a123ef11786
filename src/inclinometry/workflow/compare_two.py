"""From two files of one tool to their comparison."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from inclinometry.calibration.comparison import TwoCalibrations, compare_calibrations
from inclinometry.calibration.conventions import USUAL, Dials
from inclinometry.calibration.expected import ALL_ANGLES
from inclinometry.earth.site import Site
from inclinometry.errors import out_of_range
from inclinometry.files.tool_json import read_calibration
from inclinometry.sensors import Tool
from inclinometry.workflow.calibrate import Options, calibrate, readings_at


def compare_two(
    paths: tuple[Path, Path],
    methods: Sequence[str] = ("joint",),
    *,
    options: Options | None = None,
    dials: Dials = USUAL,
    site: Site | None = None,
    truth: Tool | None = None,
) -> TwoCalibrations:
    """Calibrate two files of one tool, each by its method, and put the results side by side.

    `paths`: bench readings, or tool.json of earlier calibrations. One method for both, or two in their order. `truth`:
    the tool behind simulated readings, for the actual errors.
    """
    if len(methods) not in (1, 2):
        raise out_of_range("--methods", len(methods), "1 .. 2")
    first, second = (
        read_calibration(path)
        if path.suffix.lower() == ".json"
        else calibrate(readings_at(path, site, dials=dials), name, options or Options())
        for path, name in zip(paths, (methods[0], methods[-1]), strict=True)
    )
    names = [f"{path.name} ({c.method})" for path, c in zip(paths, (first, second), strict=True)]
    if names[0] == names[1]:
        names = [f"{place}: {name}" for place, name in enumerate(names, 1)]
    return compare_calibrations(first, second, (names[0], names[1]), truth)


def content(found: TwoCalibrations) -> dict[str, Any]:
    """What is written as JSON; angles in degrees."""
    curves = {"difference_rms_deg": found.difference}
    for place, u in enumerate(found.uncertainty):
        curves[f"expected_u_deg_{place + 1}"] = u[:, :3]
    for place, error in enumerate(found.error or ()):
        curves[f"true_error_rms_deg_{place + 1}"] = error
    return {
        "names": found.names,
        "methods": [c.method for c in found.calibrations],
        "inputs": [dict(c.inputs) for c in found.calibrations],
        "coefficients": [
            {
                "kind": row.kind,
                "sensor": row.sensor,
                "name": row.name,
                "unit": row.unit,
                "values": row.values,
                "u": row.u,
                "difference": row.difference,
                "u_difference": row.u_difference,
            }
            for row in found.coefficients
        ],
        "inclination_deg": np.degrees(found.inclination).round(9),
        **{
            name: {angle: np.degrees(values[:, column]) for column, angle in enumerate(ALL_ANGLES[:3])}
            for name, values in curves.items()
        },
        "findings": {
            name: [one.plain() for one in c.findings] for name, c in zip(found.names, found.calibrations, strict=True)
        },
    }
