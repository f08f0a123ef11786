"""Commands for gyro runs: north, scale."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import numpy as np
from cyclopts import Parameter

from inclinometry.calibration.result import rounded
from inclinometry.cli import options, output
from inclinometry.constants import ANGLES
from inclinometry.digest import digest_file
from inclinometry.earth.site import Site
from inclinometry.files.errors_json import RunErrors, write_errors
from inclinometry.files.gyro_csv import read_gyro_run
from inclinometry.files.scale_json import read_scale, write_scale
from inclinometry.files.site_toml import read_site
from inclinometry.files.tool_json import read_calibration
from inclinometry.gyro.indexing import IndexTurns
from inclinometry.workflow.gyro import GyroOptions, GyroRun, north_run, write_run

Method = Literal["joint", "patent", "fixed"]
Prior = Literal["calibration", "previous", "both", "run"]
GyroSd: TypeAlias = Annotated[
    float | None,
    options.quantity(
        "deg_h",
        0.0,
        1000.0,
        above=True,
        help="Noise of one gyro reading, deg/h. Default: estimated from the scatter.",
    ),
]
ScaleSd: TypeAlias = Annotated[float, options.quantity("percent", 0.0, 50.0, above=True)]
Hole: TypeAlias = Annotated[
    Literal["down", "up"] | None,
    Parameter(
        help="Direction of the tool, for tools that cannot detect it. If not given: by the gyro along the tool; "
        "without one, down, with a flag."
    ),
]
Turns: TypeAlias = Annotated[
    IndexTurns,
    Parameter(
        help="Direction of index_deg, looking down hole. One gyro and one accelerometer cannot detect it: if it is "
        "wrong, azimuths are mirrored."
    ),
]
Misalignment: TypeAlias = Annotated[float | None, options.quantity("deg", 0.0, 5.0)]
Sensitivity: TypeAlias = Annotated[float | None, options.quantity("deg_h_g", 0.0, 100.0)]
History: TypeAlias = Annotated[options.InputOrNone, Parameter(help="scale.json of an earlier run of this tool.")]


def north(
    raw: Path,
    /,
    *,
    site: options.Input,
    output_: options.Output,
    calibration: options.InputOrNone = None,
    scheme: options.Scheme = "four",
    scale: Method = "joint",
    prior: Prior | None = None,
    history: History = None,
    scale_sd: ScaleSd = 0.003,
    gyro_sd: GyroSd = None,
    accel_sd: Annotated[float | None, options.quantity("m_s2", 0.0, 1.0, above=True)] = None,
    z_bias_sd: Annotated[float | None, options.quantity("deg_h", 0.0, 1000.0, above=True)] = None,
    gyro_misalignment: Misalignment = None,
    g_sensitivity: Sensitivity = None,
    sweep: Annotated[float, options.quantity("deg", 0.0, 180.0)] = 0.0,
    index_turns: Turns = "clockwise",
    hole: Hole = None,
    gravity_sd: Annotated[
        options.GravitySd,
        Parameter(
            help="No accelerometer along the hole: standard uncertainty of |g| relative to the calibration. Default: "
            "from site and calibration."
        ),
    ] = None,
    report: options.Report = None,
    errors: options.AlsoWritten = None,
    json: options.Json = False,
) -> None:
    """Find north at the stations of a gyro run.

    Parameters
    ----------
    raw
        CSV: station, md_m, index_deg, accel_x, accel_y, gyro_x_deg_h, gyro_y_deg_h; temperature_degC, time_s, z axes.
    site
        site.toml with latitude_deg; azimuths are true, or grid if north_reference is grid.
    output_
        Stations CSV: the survey columns and scale, u_scale, root, K, temperature_degC, and the rates corrected by the
        scale factor.
    calibration
        tool.json. Without it accelerometers are in m/s2 (or as named), along the axes of their names.
    scale
        joint: azimuth and scale factor together. patent: closed form of the Chinese patent application of 2015, four
        positions. fixed: scale 1.
    prior
        Prior of the scale in the joint estimate: calibration, previous (earlier stations), both (earlier stations and
        temperature), run (all other stations and temperature). If not given: run, or both for a long run.
    scale_sd
        Standard uncertainty of the scale factor at the first station.
    accel_sd
        Noise of one accelerometer reading. Default: that of the calibration.
    z_bias_sd
        Standard uncertainty of the bias of a gyro along the tool.
    gyro_misalignment
        Standard deviation of each gyro axis toward each other axis. Default: 0.2; calibrated gyros: 0.
    g_sensitivity
        Standard deviation: output of a gyro for 1 g along each axis. Default: 0.1; calibrated g-sensitivity: 0.02.
    sweep
        Angle turned while one reading is averaged (carousel).
    errors
        Write errors.json, the error model of the run, for position --errors.
    """
    output.check_outputs(
        {"--output": output_, "--report": report, "--errors": errors},
        {"the readings": raw, "--site": site, "--calibration": calibration, "--history": history},
    )
    wishes = GyroOptions(
        scheme=scheme,
        method=scale,
        prior=prior,
        scale_sd=scale_sd,
        history=None if history is None else read_scale(history),
        gyro_sd=gyro_sd,
        accelerometer_sd=accel_sd,
        z_bias_sd=z_bias_sd,
        misalignment=gyro_misalignment,
        g_sensitivity=g_sensitivity,
        sweep=sweep,
        hole=hole,
        gravity_sd=gravity_sd,
    )
    place = read_site(site)
    found = _run(raw, site, place, calibration, wishes, index_turns)
    survey = found.survey
    beside = {name: getattr(found, name) for name in ("md", "temperature", "track", "others", "checks")}
    with output.reported(report, "gyro:gyro_report", survey, found.north, **beside, site=place):
        if errors is not None:
            own = survey.md, survey.inclination, survey.azimuth, survey.azimuth_reference
            write_errors(RunErrors(*own, survey.errors, found.tool, found.inputs), errors)
        write_run(found, output_)
    output.findings(survey.findings)
    if json:
        output.print_json(_summary(found, output_))
        return
    show_run(found)
    output.print_outputs(output_, report, what=output.counted(len(found), "station"))


def scale(
    run: Path,
    /,
    *,
    site: options.GyroSite,
    output_: options.Output,
    calibration: options.InputOrNone = None,
    scheme: options.Scheme = "four",
    online: options.Flag = False,
    history: History = None,
    scale_sd: ScaleSd = 0.003,
    gyro_sd: GyroSd = None,
    gyro_misalignment: Misalignment = None,
    g_sensitivity: Sensitivity = None,
    index_turns: Turns = "clockwise",
    hole: Hole = None,
    report: options.Report = None,
    json: options.Json = False,
) -> None:
    """Follow the scale factor over the temperatures of a run, for the record and for the next run.

    Parameters
    ----------
    run
        CSV as for gyro north, with temperature_degC.
    output_
        Write scale.json, for gyro north --history.
    calibration
        tool.json
    online
        Use earlier stations only, as during the run. Without it the whole run is used.
    scale_sd
        Standard uncertainty of the scale factor at the first station.
    gyro_misalignment
        Standard deviation of each gyro axis toward each other axis. Default: 0.2; calibrated gyros: 0.
    g_sensitivity
        Standard deviation: output of a gyro for 1 g along each axis. Default: 0.1; calibrated g-sensitivity: 0.02.
    """
    output.check_outputs(
        {"--output": output_, "--report": report},
        {"the readings": run, "--site": site, "--calibration": calibration, "--history": history},
    )
    wishes = GyroOptions(
        scheme=scheme,
        prior="both" if online else "run",
        scale_sd=scale_sd,
        history=None if history is None else read_scale(history),
        gyro_sd=gyro_sd,
        misalignment=gyro_misalignment,
        g_sensitivity=g_sensitivity,
        hole=hole,
    )
    found = _run(run, site, read_site(site), calibration, wishes, index_turns)
    record = found.record()
    beside = {"md": found.md, "tool": found.tool, "findings": found.survey.findings}
    with output.reported(report, "gyro:scale_report", found.track, **beside):
        write_scale(record, output_)
    output.findings(found.survey.findings)
    if json:
        known = record.state
        output.print_json(
            {
                "stations": len(found),
                "index_turns": found.index_turns,
                "coefficients": known.coefficients,
                "u_coefficients": np.sqrt(np.diag(known.covariance)),
                "reference_temperature_degC": known.reference_temperature,
                "temperature_range_degC": known.temperature_range,
                "observable": sum(record.observable),
                "output": output_,
            }
        )
        return
    show_scale(found)
    output.print_line(f"scale factor of {output.counted(len(found), 'station')} written to {output_}")


def _run(
    raw: Path, site: Path, place: Site, calibration: Path | None, wishes: GyroOptions, turns: IndexTurns
) -> GyroRun:
    with output.reading(raw) as progress:
        data = read_gyro_run(raw, index_turns=turns, progress=progress)
    tool = None if calibration is None else read_calibration(calibration)
    digests = {"site": digest_file(site)}
    if calibration is not None:
        digests["tool"] = digest_file(calibration)
    with output.busy(f"finding north at {output.counted(len(data), 'station')}"):
        return north_run(data, place, tool, wishes, inputs=digests)


def _summary(found: GyroRun, path: Path) -> dict[str, object]:
    return {
        "stations": len(found),
        "method": found.north.method,
        "azimuth_reference": found.survey.azimuth_reference,
        "index_turns": found.index_turns,
        "flagged": sum(bool(row) for row in found.survey.flags),
        "checks": [{"name": c.name, "verdict": c.verdict, "reason": c.reason.plain()} for c in found.checks],
        "findings": found.survey.findings,
        "output": path,
    }


def show_run(found: GyroRun, most: int = 12) -> None:
    """A few stations spread over the run, on the terminal."""
    survey, order = found.survey, np.argsort(found.md)
    rows = []
    for row in output.spread(len(survey), most):
        at = int(order[row])
        cells = [output.degrees(getattr(survey, name)[row], survey.u(name)[row]) for name in ANGLES]
        scale = found.north.scale[at]
        cells.append(rounded(scale, found.north.u_scale[at]) if np.isfinite(scale) else "-")
        rows.append([f"{survey.md[row]:.1f}", *cells, ", ".join(survey.flags[row])])
    header = ["md m", "inclination", f"azimuth ({survey.azimuth_reference})", "toolface", "scale", "flags"]
    shown = output.excerpt(len(rows), len(survey))
    output.table(f"stations{shown} ({found.north.method}), deg with standard uncertainty", header, rows)
    for check in found.checks:
        output.print_line(f"{check.name}: {check.verdict}. {check.reason}")


def show_scale(found: GyroRun) -> None:
    """The curve learnt, on the terminal."""
    if found.track is None:
        return
    known = found.track.state
    names = ("scale at {:.4g} degC", "slope per 100 degC", "bend per (100 degC)2")
    rows = [
        [name.format(known.reference_temperature), rounded(value, sd)]
        for name, value, sd in zip(names, known.coefficients, np.sqrt(np.diag(known.covariance)), strict=False)
    ]
    output.table("scale factor learnt, with standard uncertainty", ["coefficient", "value"], rows)
