"""Commands on a rig: orient."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from inclinometry.calibration.stand_orientation import RigOrientation, orient_rig
from inclinometry.calibration.undetermined import undetermined
from inclinometry.cli import output
from inclinometry.cli.options import AzimuthFrom, GravitySd, Input, InputOrNone, Json, SdOrNone
from inclinometry.constants import COVERAGE_FACTOR
from inclinometry.earth.site import Site
from inclinometry.files.bench_csv import read_bench
from inclinometry.files.site_toml import read_site
from inclinometry.files.tool_json import read_calibration
from inclinometry.findings import Finding
from inclinometry.rotations import wrap_positive
from inclinometry.workflow.field import completed


def orient(
    readings: Path,
    /,
    *,
    calibration: Input,
    site: InputOrNone = None,
    rig_sd: SdOrNone = None,
    azimuth_from: AzimuthFrom = None,
    gravity_sd: GravitySd = None,
    json: Json = False,
) -> None:
    """Find how a rig stands from the readings of a calibrated tool on it: tilt, north, zeros of its dials.

    Parameters
    ----------
    readings
        Bench readings of the tool on this rig at several azimuths and inclinations.
    calibration
        tool.json of that tool, made on any other rig.
    site
        site.toml with declination_deg (or place and date), for the azimuth from true north.
    rig_sd
        Standard deviation of a dial setting of this rig. Default: from the scatter.
    """
    with output.reading(readings) as progress:
        data = read_bench(readings, progress=progress)
    found = orient_rig(
        data,
        read_calibration(calibration),
        setting_sd=rig_sd,
        second=azimuth_from,
        gravity_sd=gravity_sd,
    )
    place, said = (Site(), list[Finding]()) if site is None else completed(read_site(site))
    rows = _rows(found, place)
    said += found.findings
    if site is not None and found.north_of == "magnetic" and place.declination_sigma is None:
        said.append(Finding("work-declination-sigma"))
    if found.tilt < COVERAGE_FACTOR * found.u["tilt"]:
        direction = "direction of the tilt, which is within its uncertainty"
        small = undetermined("settings", (direction,), "Add settings, if the direction is needed")
        said.append(small._replace(severity="note"))
    output.findings(said)
    if json:
        output.print_json(
            {
                "tool": found.tool,
                "north_of": found.north_of,
                "found": {key: {"deg": value, "u_deg": u} for key, _, value, u in rows},
                "setting_sd_deg": np.degrees(found.setting_sd),
                "residual_deg": np.degrees(found.residual),
                "matrix": found.matrix,
                "inputs": dict(found.inputs),
                "findings": said,
            }
        )
        return
    cells = [[words, f"{v:.3f}", f"{u:.3f}", f"{min(COVERAGE_FACTOR * u, 180.0):.3f}"] for _, words, v, u in rows]
    output.table(f"how the rig stands, by tool {found.tool}", ["", "deg", "u deg", "U (k = 2) deg"], cells)
    output.print_line("the true angle of a dial is what it shows plus its zero")
    output.print_line(
        f"{output.counted(len(data), 'setting')}, standard deviation {np.degrees(found.setting_sd):.3f} deg, "
        f"largest turn left {np.degrees(found.residual.max()):.3f} deg"
    )


def _rows(found: RigOrientation, site: Site) -> list[tuple[str, str, Any, Any]]:
    """Key, words, value and standard uncertainty in deg of everything that was found."""
    rows = [("tilt", "tilt of the azimuth axis from the vertical", found.tilt, found.u["tilt"])]
    rows.append(("tilt_dial", "its upper end leans toward dial azimuth", found.tilt_dial, found.u["tilt_dial"]))
    if found.north_of is not None:
        north, u = found.north, found.u["north"]
        toward = found.tilt_azimuth
        rows.append(("tilt_azimuth", f"toward azimuth, {found.north_of} north", toward, found.u["tilt_azimuth"]))
        rows.append((f"zero_from_{found.north_of}_north", f"levelled zero from {found.north_of} north", north, u))
        if found.north_of == "magnetic" and site.declination is not None:
            true = float(wrap_positive(north + site.declination))
            rows.append(
                (
                    "zero_from_true_north",
                    f"levelled zero from true north (declination {np.degrees(site.declination):+.3f} deg)",
                    true,
                    float(np.hypot(u, site.declination_sigma or 0.0)),
                )
            )
    rows += [(name, f"{name.replace('_', ' ')} of the dial", zero, found.u[name]) for name, zero in found.zeros.items()]
    return [(key, words, float(np.degrees(value)), float(np.degrees(u))) for key, words, value, u in rows]
