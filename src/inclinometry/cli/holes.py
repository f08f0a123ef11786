"""Command that gives positions along many drill holes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from inclinometry.cli import output
from inclinometry.cli.options import Flag, InputOrNone, Json, OutputOrNone, quantity
from inclinometry.files.holes_csv import write_positions
from inclinometry.survey.path import dogleg_severity_deg
from inclinometry.workflow.holes import Holes, positions_every, read_holes


def holes(
    surveys: Path,
    /,
    *,
    collars: InputOrNone = None,
    dip_down: Literal["positive", "negative"] | None = None,
    azimuth_add: Annotated[float, quantity("deg", -180.0, 180.0)] = 0.0,
    every: Annotated[float | None, quantity("m", 0.01, 10_000.0)] = None,
    skip_faulty: Flag = False,
    output_: OutputOrNone = None,
    json: Json = False,
) -> int:
    """Positions along many drill holes by minimum curvature; exit status 0 done, 1 faulty holes left out, 2 bad input.

    Parameters
    ----------
    surveys
        One table of all holes: hole, depth_m, dip_deg from the horizontal (or inclination_deg from the vertical),
        azimuth_deg.
    collars
        Table of hole, x_m (east), y_m (north), z_m (elevation) and perhaps end_depth_m.
    dip_down
        Sign of a downward dip; in most mines negative.
    azimuth_add
        Added to every azimuth, or to the magnetic rows where azimuth_reference has both: declination less convergence.
    every
        Also write points at this interval, m.
    skip_faulty
        Skip faulty holes; the exit status is then 1.
    output_
        CSV of all holes.
    """
    output.check_outputs({"--output": output_}, {"the surveys": surveys, "--collars": collars})
    with output.reading(surveys) as progress:
        found = read_holes(
            surveys, collars, dip_down=dip_down, azimuth_add=azimuth_add, skip_faulty=skip_faulty, progress=progress
        )
    if output_ is not None:
        paths = {
            name: one.path if every is None else positions_every(one.path, every) for name, one in found.found.items()
        }
        write_positions(output_, [(name, path, found.collars[name]) for name, path in paths.items()])
    output.findings(found.findings)
    rows = _summary(found)
    if json:
        faults = {name: one.plain() for name, one in found.faults.items()}
        content = {"holes": rows, "faulty": faults, "findings": found.findings}
        output.print_json({**content, "inputs": found.inputs, "output": output_})
        return 1 if found.faults else 0
    header = ["hole", "shots", "end m", "east m", "north m", "elevation m", "largest dogleg deg/30 m", "at m"]
    cells = [[str(v) if not isinstance(v, float) else f"{v:.2f}" for v in row.values()] for row in rows[:40]]
    title = f"ends of the holes{output.excerpt(len(cells), len(rows))}"
    output.table(title, header, cells)
    if output_ is not None:
        output.print_outputs(output_, what=output.counted(len(rows), "hole"))
    return 1 if found.faults else 0


def _summary(found: Holes) -> list[dict[str, Any]]:
    rows = []
    for name, one in found.found.items():
        path, (east, north, elevation) = one.path, found.collars[name]
        severity = dogleg_severity_deg(path)
        worst = int(np.argmax(severity))
        rows.append(
            {
                "hole": name,
                "shots": one.shots,
                "end_depth_m": float(path.md[-1]),
                "east_m": float(east + path.east[-1]),
                "north_m": float(north + path.north[-1]),
                "elevation_m": float(elevation - path.tvd[-1]),
                "largest_dls_deg_30m": float(severity[worst]),
                "at_m": float(path.md[worst]),
            }
        )
    return rows
