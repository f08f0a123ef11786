"""What compare prints of two files of one tool."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from inclinometry.calibration.conventions import Dials
from inclinometry.calibration.expected import ANGLES, FROM_CALIBRATION
from inclinometry.calibration.summary import rounded
from inclinometry.cli import output
from inclinometry.core.arrays import Array
from inclinometry.io.atomic import write_text
from inclinometry.io.site_toml import read_site
from inclinometry.io.tool_json import read_tool
from inclinometry.workflow.calibrate import Options
from inclinometry.workflow.compare_two import compare_two, content


def show_two(
    paths: tuple[Path, Path],
    methods: str,
    options: Options,
    dials: Dials,
    site: Path | None,
    truth: Path | None,
    report: Path | None,
    json: bool,
) -> None:
    """Calibrate two files of one tool, print both with their differences, write the report."""
    output.claim(
        {"--report": report}, {"the first file": paths[0], "the second": paths[1], "--site": site, "--truth": truth}
    )
    with output.busy("calibrating both"):
        found = compare_two(
            paths,
            [name.strip() for name in methods.split(",")],
            options=options,
            dials=dials,
            site=None if site is None else read_site(site),
            truth=None if truth is None else read_tool(truth),
        )
    if report is not None:
        from inclinometry.report.compare_two import two_report

        write_text(two_report(found), report)
    said = content(found)
    output.warnings(said["warnings"])
    if json:
        output.print_json(said)
        return
    for kind in dict.fromkeys(row.kind for row in found.coefficients):
        rows = [
            [
                f"{row.sensor} {row.name}",
                *(rounded(v, u) for v, u in zip(row.values, row.u, strict=True)),
                rounded(row.difference, row.u_difference),
                f"{row.sigmas:+.1f}" if np.isfinite(row.sigmas) else "-",
            ]
            for row in found.coefficients
            if row.kind == kind
        ]
        shown = [row for row in found.coefficients if row.kind == kind and row.unit]
        units = ", ".join(dict.fromkeys(f"{row.name} in {row.unit}" for row in shown))
        output.table(f"{kind}: {units}", ["sensor", *found.names, "difference", "in its u"], rows)
    for column, name in enumerate(ANGLES[:2]):
        if not np.isfinite(found.difference[:, column]).any():
            output.say(f"{name}: not in both calibrations")
            continue
        curves = {f"u, {n}": u for n, u in zip(found.names, found.uncertainty, strict=True)}
        curves["difference, rms"] = found.difference
        curves |= {f"true error, {n}": e for n, e in zip(found.names, found.error or (), strict=False)}
        cells = [_cells(values[:, column]) for values in curves.values()]
        degrees = [f"{i:g}" for i in np.degrees(found.inclination).round(6)]
        rows = [list(row) for row in zip(degrees, *cells, strict=True)]
        output.table(f"{name}, deg: u {FROM_CALIBRATION}, worst attitude", ["inclination deg", *curves], rows)
    if report is not None:
        output.say(f"report written to {report}")


def _cells(values: Array) -> list[str]:
    return [f"{v:.3f}" if np.isfinite(v) else "-" for v in np.degrees(values)]
