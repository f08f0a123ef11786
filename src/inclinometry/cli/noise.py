"""Commands about noise: the Allan deviation of a log, and how long a gyro has to stand still."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from inclinometry.allan import NoiseRecord
from inclinometry.cli import options, output
from inclinometry.cli.options import Json, Output, Report
from inclinometry.errors import InputError
from inclinometry.files.allan_json import allan_content, coefficients_of, units_of, write_allan
from inclinometry.files.writing import write_text
from inclinometry.gyro.planning import AZIMUTHS, GyroSetup, StandstillPlan, standstill_time


def allan(
    log: Path,
    /,
    *,
    output_: Output,
    start_s: float | None = None,
    stop_s: float | None = None,
    report: Report = None,
    json: Annotated[Json, Parameter(help="Print what is written, as JSON, instead of text.")] = False,
) -> None:
    """Allan deviation of every channel of a log at rest, and the noise coefficients fitted to it.

    Parameters
    ----------
    log
        CSV with time_s and the channels, the tool at rest, sampled evenly.
    output_
        allan.json: coefficients with uncertainties or upper limits, and the curves.
    start_s
        By time_s, where the stretch of the log begins that is used: the tool was at rest in it; its first sample when
        not given.
    stop_s
        Where it ends; the last sample when not given.
    """
    from inclinometry.workflow.allan import noise_of_log

    output.claim({"--output": output_, "--report": report}, {"the log": log})
    with output.reading(log) as progress:
        found = noise_of_log(log, start=start_s, stop=stop_s, progress=progress)
    page = None
    if report is not None:
        from inclinometry.report.allan import allan_report

        with output.busy("drawing"):
            page = allan_report(found)
    write_allan(found, output_)
    if page is not None:
        write_text(page, report or "")
    output.warnings(found.warnings)
    if json:
        output.print_json(allan_content(found))
        return
    show_noise(found)
    written = f"{output.counted(len(found.channels), 'channel')} written to {output_}"
    output.say(written + (f", report to {report}" if report else ""))


def show_noise(found: NoiseRecord) -> None:
    """A table for each triad on the terminal."""
    from inclinometry.report.allan import coefficient_text

    for kind in found.kinds:
        channels = found.of(kind)
        header = [kind, *(f"{s.title}, {s.unit}" for s in units_of(channels[0]).coefficients)]
        rows = [[c.name, *(coefficient_text(*pair) for pair in coefficients_of(c))] for c in channels]
        length = f"{found.samples} samples, {found.samples * found.dt:.6g} s"
        output.table(f"noise with standard uncertainty, < upper limit (95 %); {length}", header, rows)


def plan_gyro(
    *,
    latitude_deg: float,
    inclination_deg: float,
    arw_deg_sqrt_h: float,
    azimuth_deg: float,
    bias_instability_deg_h: float = 0.0,
    scale_sd_percent: float = 0.3,
    at_azimuth_deg: float | None = None,
    gyros: Literal[1, 2] = 2,
    axes: Literal[2, 3] = 2,
    axial_bias_sd_deg_h: float = 0.0,
    level_sd_deg: float = 0.0,
    move_s: float = 0.0,
    json: Json = False,
) -> None:
    """How long a gyro inclinometer has to stand still for a wanted uncertainty of azimuth.

    Parameters
    ----------
    latitude_deg
        Of the hole, north positive.
    inclination_deg
        Of the hole, 0 pointing down.
    arw_deg_sqrt_h
        Angle random walk of one gyro, deg/sqrt(h).
    azimuth_deg
        Wanted standard uncertainty of azimuth.
    bias_instability_deg_h
        Of one gyro.
    scale_sd_percent
        Prior standard uncertainty of the scale factor.
    at_azimuth_deg
        Azimuth of the hole from true north; all round when not given.
    gyros
        Gyros across the tool, turned to four index positions.
    axes
        3: with a gyro along the tool.
    axial_bias_sd_deg_h
        Standard uncertainty of the bias of the gyro along the tool, which turning does not remove.
    level_sd_deg
        Standard uncertainty of the level by the accelerometers.
    move_s
        Time from one index position to the next.
    """
    per_hour = np.radians(1.0) / 3600.0
    setup = GyroSetup(
        arw=np.radians(_positive(arw_deg_sqrt_h, "--arw-deg-sqrt-h", 10.0)) / 60.0,
        bias_instability=per_hour * _up_to(bias_instability_deg_h, "--bias-instability-deg-h", 1000.0),
        scale_sd=_up_to(scale_sd_percent, "--scale-sd-percent", 100.0) / 100.0,
        gyros=gyros,
        axes=axes,
        axial_bias_sd=per_hour * _up_to(axial_bias_sd_deg_h, "--axial-bias-sd-deg-h", 1000.0),
        tilt_sd=np.radians(_up_to(level_sd_deg, "--level-sd-deg", 10.0)),
    )
    found = standstill_time(
        options.angle(latitude_deg, "--latitude-deg", -90.0, 90.0),
        options.angle(inclination_deg, "--inclination-deg", 0.0, 180.0),
        np.radians(_positive(azimuth_deg, "--azimuth-deg", options.LARGEST_SD)),
        setup,
        azimuth=options.angle_or_none(at_azimuth_deg, "--at-azimuth-deg"),
        move_time=_up_to(move_s, "--move-s", 3600.0),
    )
    output.warnings(found.notes)
    if json:
        output.print_json(_plan_content(found))
        return
    show_plan(found)


def show_plan(found: StandstillPlan) -> None:
    """Best, median and worst azimuth, or the one given, on the terminal."""
    title = f"standing still for azimuth to {np.degrees(found.wanted):.4g} deg (standard uncertainty)"
    header = ["azimuth of the hole", "deg", "stand still s", "with moves s", "floor deg"]
    rows = [_plan_row(found, name, row) for name, row in _cases(found).items()]
    output.table(title, header, rows, "floor: what is left after any time")


def _cases(found: StandstillPlan) -> dict[str, int]:
    if len(found.azimuth) < AZIMUTHS:
        return {"as given": 0}
    return {"best": found.at(0.0), "median": found.at(0.5), "worst": found.at(1.0)}


def _plan_row(found: StandstillPlan, name: str, row: int) -> list[str]:
    time = found.time[row]
    known = [_seconds(time), _seconds(time + found.moving)] if np.isfinite(time) else ["over a day", "over a day"]
    return [name, f"{np.degrees(found.azimuth[row]):.1f}", *known, f"{np.degrees(found.floor[row]):.4f}"]


def _seconds(time: float) -> str:
    return f"{time:.0f}" if time >= 10.0 else f"{time:.2g}"


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
    return {"wanted_deg": round(float(np.degrees(found.wanted)), 10), "cases": cases, "notes": list(found.notes)}


def _up_to(value: float, option: str, high: float) -> float:
    """An option from 0 to `high`."""
    if not 0.0 <= value <= high:
        raise InputError(f"{option} is {value:g}; allowed 0 to {high:g}")
    return value


def _positive(value: float, option: str, high: float) -> float:
    if value == 0.0:
        raise InputError(f"{option} is 0; give more than 0, up to {high:g}")
    return _up_to(value, option, high)
