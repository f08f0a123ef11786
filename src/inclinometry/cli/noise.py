"""Commands about noise: the Allan deviation of a log, and how long a gyro has to stand still."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from inclinometry.allan import NoiseRecord
from inclinometry.cli import options, output
from inclinometry.cli.options import Json, Output, Report, quantity
from inclinometry.files.allan_json import allan_content, coefficients_of, units_of, write_allan
from inclinometry.gyro.planning import AZIMUTHS, GyroSetup, StandstillPlan, standstill_time


def allan(
    log: Path,
    /,
    *,
    output_: Output,
    start: Annotated[float | None, quantity("s")] = None,
    stop: Annotated[float | None, quantity("s")] = None,
    report: Report = None,
    json: Annotated[Json, Parameter(help="Print JSON instead of text.")] = False,
) -> None:
    """Allan deviation of every channel of a log at rest, and the noise coefficients fitted to it.

    Parameters
    ----------
    log
        CSV with time_s and the channels, the tool at rest, sampled evenly.
    output_
        allan.json: coefficients with uncertainties or upper limits, and the curves.
    start
        First time_s to use; the tool must be at rest. If not given, the first sample.
    stop
        Last time_s to use. Default: the last sample.
    """
    from inclinometry.workflow.allan import noise_of_log

    output.check_outputs({"--output": output_, "--report": report}, {"the log": log})
    with output.reading(log) as progress:
        found = noise_of_log(log, start=start, stop=stop, progress=progress)
    with output.reported(report, "allan:allan_report", found):
        write_allan(found, output_)
    output.findings(found.findings)
    if json:
        output.print_json(allan_content(found))
        return
    show_noise(found)
    output.print_outputs(output_, report, what=output.counted(len(found.channels), "channel"))


def show_noise(found: NoiseRecord) -> None:
    """A table for each triad on the terminal."""
    from inclinometry.report.allan import coefficient_text

    for kind in found.kinds:
        channels = found.of(kind)
        header = [kind, *(f"{s.title}, {s.unit}" for s in units_of(channels[0])[:3])]
        rows = [[c.name, *(coefficient_text(*pair) for pair in coefficients_of(c))] for c in channels]
        length = f"{found.samples} samples, {found.samples * found.dt:.6g} s"
        output.table(f"noise with standard uncertainty, < upper limit (95 %); {length}", header, rows)


def plan_gyro(
    *,
    latitude: options.Latitude,
    inclination: options.Inclination,
    arw: Annotated[float, quantity("deg_sqrt_h", 0.0, 10.0, above=True)],
    azimuth: Annotated[float, quantity("deg", 0.0, 30.0, above=True)],
    bias_instability: Annotated[float, quantity("deg_h", 0.0, 1000.0)] = 0.0,
    scale_sd: Annotated[float, quantity("percent", 0.0, 100.0)] = 0.003,
    at_azimuth: options.AzimuthOrNone = None,
    gyros: Literal[1, 2] = 2,
    axes: Literal[2, 3] = 2,
    axial_bias_sd: Annotated[float, quantity("deg_h", 0.0, 1000.0)] = 0.0,
    level_sd: Annotated[float, quantity("deg", 0.0, 10.0)] = 0.0,
    move: Annotated[float, quantity("s", 0.0, 3600.0)] = 0.0,
    json: Json = False,
) -> None:
    """How long a gyro inclinometer has to stand still for a wanted uncertainty of azimuth.

    Parameters
    ----------
    latitude
        Of the hole, north positive.
    inclination
        Of the hole, 0 pointing down.
    arw
        Angle random walk of one gyro, deg/sqrt(h).
    azimuth
        Wanted standard uncertainty of azimuth.
    bias_instability
        Of one gyro.
    scale_sd
        Prior standard uncertainty of the scale factor.
    at_azimuth
        Azimuth of the hole from true north. Default: all round.
    gyros
        Gyros across the tool, turned to four index positions.
    axes
        3: with a gyro along the tool.
    axial_bias_sd
        Standard uncertainty of the bias of the gyro along the tool; turning does not remove it.
    level_sd
        Standard uncertainty of the level by the accelerometers.
    move
        Time from one index position to the next.
    """
    setup = GyroSetup(
        arw=arw,
        bias_instability=bias_instability,
        scale_sd=scale_sd,
        gyros=gyros,
        axes=axes,
        axial_bias_sd=axial_bias_sd,
        tilt_sd=level_sd,
    )
    found = standstill_time(latitude, inclination, azimuth, setup, azimuth=at_azimuth, move_time=move)
    output.findings(found.findings)
    if json:
        output.print_json(_plan_content(found))
        return
    show_plan(found)


def show_plan(found: StandstillPlan) -> None:
    """Best, median and worst azimuth, or the one given, on the terminal."""
    title = f"standing still for azimuth to {np.degrees(found.wanted):.4g} deg (standard uncertainty)"
    header = ["azimuth of the hole", "deg", "stand still s", "with moves s", "floor deg"]
    rows = []
    for name, row in _cases(found).items():
        time = found.time[row]
        times = [f"{t:.0f}" if t >= 10.0 else f"{t:.2g}" for t in (time, time + found.moving)]
        times = times if np.isfinite(time) else ["over a day"] * 2
        rows.append([name, f"{np.degrees(found.azimuth[row]):.1f}", *times, f"{np.degrees(found.floor[row]):.4f}"])
    output.table(title, header, rows, "floor: what is left after any time")


def _cases(found: StandstillPlan) -> dict[str, int]:
    if len(found.azimuth) < AZIMUTHS:
        return {"as given": 0}
    return {"best": found.at(0.0), "median": found.at(0.5), "worst": found.at(1.0)}


def _plan_content(found: StandstillPlan) -> dict[str, object]:
    cases = {
        name: {
            "azimuth_deg": round(float(np.degrees(found.azimuth[row])), 10),
            "time_s": found.time[row],
            "time_with_moves_s": found.time[row] + found.moving,
            "floor_deg": np.degrees(found.floor[row]),
        }
        for name, row in _cases(found).items()
    }
    return {"wanted_deg": round(float(np.degrees(found.wanted)), 10), "cases": cases, "findings": found.findings}
