"""Command that calibrates gyros on a rate table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from inclinometry.calibration.rate_table import RateCalibration
from inclinometry.calibration.result import rounded
from inclinometry.cli import output
from inclinometry.cli.options import Created, Flag, GyroSite, InputOrNone, Json, Output, Serial
from inclinometry.constants import EARTH_RATE
from inclinometry.files.gyro_csv import read_rate_steps
from inclinometry.files.site_toml import read_site
from inclinometry.files.tool_json import write_calibration
from inclinometry.workflow.rate_table import calibrate_on_table


def table(
    steps: Path,
    /,
    *,
    site: GyroSite,
    output_: Output,
    calibration: InputOrNone = None,
    temperature_degree: int = 0,
    g_sensitivity: Flag = False,
    tool: Annotated[Serial, Parameter(help="Serial number, if no calibration states one.")] = "unnamed",
    created: Created = None,
    json: Json = False,
) -> None:
    """Calibrate gyros on a rate table that turns about the vertical.

    Parameters
    ----------
    steps
        CSV with station, inclination_deg, toolface_deg (of the tool as mounted), rate_deg_s (clockwise from above), the
        gyros' means over whole turns, azimuth_deg where the table is at rest, temperature_degC.
    output_
        tool.json
    calibration
        tool.json whose gyros are replaced or added. Without it the tool has gyros only.
    temperature_degree
        Degree of the temperature polynomial of scale and offset.
    g_sensitivity
        Fit the g-sensitivity of the gyros.
    """
    output.check_outputs({"--output": output_}, {"the steps": steps, "--calibration": calibration, "--site": site})
    place = read_site(site)
    with output.reading(steps) as progress:
        data = read_rate_steps(steps, progress=progress)
    rates, calibrated, findings, used = calibrate_on_table(
        data,
        place,
        calibration=calibration,
        temperature_degree=temperature_degree,
        g_sensitive=g_sensitivity,
        name=tool,
    )
    write_calibration(calibrated, output_, created=created)
    output.findings(findings)
    if json:
        content = {
            "tool": calibrated.tool.name,
            "unit": rates.triad.unit,
            "steps_used": used,
            "tensor_per_earth_rate": rates.triad.tensor[0],
            "offset": rates.triad.offset[0],
            "noise": rates.sd,
            "chi_square": rates.chi_square,
            "degrees_of_freedom": rates.dof,
            "g_sensitivity": rates.g_sensitivity,
            "g_sensitivity_by_chance": rates.chance,
            "uncertainty": rates.uncertainty,
            "findings": calibrated.findings,
            "output": output_,
        }
        output.print_json(content)
    else:
        show_rates(rates)
        steps_used = f"{used} of {output.counted(len(data), 'step')} used"
        output.print_line(f"{steps_used}, tool {calibrated.tool.name} written to {output_}")


def show_rates(found: RateCalibration) -> None:
    """Scale, offset, noise and g-sensitivity of each gyro on the terminal."""
    sd, rows = found.uncertainty, []
    per_degree = np.radians(1.0) / EARTH_RATE
    for gyro in range(found.triad.count):
        tensor, names = found.triad.tensor[0, gyro], [f"gyro.tensor[{gyro},{a}]" for a in range(3)]
        main = int(np.argmax(np.abs(tensor)))
        # of the sign with which the gyro answers to a rate about the axis it lies nearest to
        scale = float(np.copysign(np.linalg.norm(tensor), tensor[main]))
        own = [found.parameter_names.index(n) for n in names]
        axis = tensor / scale
        u = float(np.sqrt(axis @ found.covariance[np.ix_(own, own)] @ axis))
        rows.append(
            [
                f"{gyro + 1}",
                "xyz"[main],
                rounded(scale * per_degree, u * per_degree),
                rounded(float(found.triad.offset[0, gyro]), sd[f"gyro.offset[{gyro}]"]),
                f"{found.sd[gyro]:.3g}",
            ]
        )
    unit = found.triad.unit
    header = ["gyro", "nearest axis", f"scale, {unit} per deg/s", f"offset, {unit}", f"noise, {unit}"]
    output.table("gyros, with standard uncertainty", header, rows)
    if found.g_sensitivity is not None:
        cells = []
        for gyro, row in enumerate(found.g_sensitivity.tolist()):
            spread = [sd[f"gyro.g_sensitivity[{gyro},{axis}]"] for axis in range(3)]
            cells.append([f"{gyro + 1}", *(rounded(v, u) for v, u in zip(row, spread, strict=True))])
        output.table(f"g-sensitivity, {unit} per g", ["gyro", "along x", "along y", "along z"], cells)
