"""Commands for gyro runs: north, scale."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import numpy as np
from cyclopts import Parameter

from inclinometry.calibration.result import rounded
from inclinometry.cli import output
from inclinometry.cli.options import (
    AlsoWritten,
    Flag,
    GravitySd,
    GyroSite,
    Input,
    InputOrNone,
    Json,
    Output,
    Report,
    Scheme,
    angle,
    gravity_sd,
)
from inclinometry.constants import DEG_PER_HOUR
from inclinometry.digest import digest_file
from inclinometry.earth.site import Site
from inclinometry.errors import InputError
from inclinometry.files.errors_json import RunErrors, write_errors
from inclinometry.files.gyro_csv import read_gyro_run
from inclinometry.files.scale_json import read_scale, write_scale
from inclinometry.files.site_toml import read_site
from inclinometry.files.tool_json import read_calibration
from inclinometry.files.writing import write_text
from inclinometry.workflow.gyro import GyroOptions, GyroRun, north_run, write_run

Method = Literal["joint", "patent", "fixed"]
Prior = Literal["calibration", "previous", "both", "run"]
GyroSd: TypeAlias = Annotated[
    float | None,
    Parameter(help="Noise of one gyro reading, deg/h; estimated from the scatter when not given."),
]
Hole: TypeAlias = Annotated[
    Literal["down", "up"] | None,
    Parameter(
        help="Whether the tool points down or up, for tools that cannot tell. When not given, a gyro along the tool "
        "decides; failing that down is taken and flagged."
    ),
]
History: TypeAlias = Annotated[InputOrNone, Parameter(help="scale.json of an earlier run of this tool.")]


def north(
    raw: Path,
    /,
    *,
    site: Input,
    output_: Output,
    calibration: InputOrNone = None,
    scheme: Scheme = "four",
    scale: Method = "joint",
    prior: Prior | None = None,
    history: History = None,
    scale_sd_percent: float = 0.3,
    gyro_sd_deg_h: GyroSd = None,
    accel_sd_m_s2: float | None = None,
    z_bias_sd_deg_h: float | None = None,
    sweep_deg: float = 0.0,
    hole: Hole = None,
    gravity_sd_percent: Annotated[
        GravitySd,
        Parameter(
            help="Of tools without an accelerometer along the hole: standard uncertainty of |g| here against that in "
            "whose units the others read; that of what site and calibration state when not given."
        ),
    ] = None,
    report: Report = None,
    errors: AlsoWritten = None,
    json: Json = False,
) -> None:
    """Find north at the stations of a gyro run.

    Parameters
    ----------
    raw
        CSV: station, md_m, index_deg, accel_x, accel_y, gyro_x_deg_h, gyro_y_deg_h; temperature_degC, time_s, z axes.
    site
        site.toml with latitude_deg; azimuths are true, or grid where north_reference says so.
    output_
        Stations CSV: the survey columns and scale, u_scale, root, K, temperature_degC, and the rates corrected by the
        scale factor.
    calibration
        tool.json; without it accelerometers are in m/s2 (or as named) and axes are perfect.
    scale
        joint (azimuth and scale factor together), patent (the closed form of the Chinese patent application of 2015 for
        a fibre-optic gyro in four positions), fixed (scale taken as 1).
    prior
        What the joint estimate expects of the scale: calibration, previous station, both, or run (all other stations).
        When not given run, or both where a run is too long for that. Without temperatures the scale wanders from
        station to station.
    scale_sd_percent
        Standard uncertainty of the scale factor at the reference temperature; of its history before the first station
        with patent.
    accel_sd_m_s2
        Noise of one accelerometer reading; that of the calibration when not given.
    z_bias_sd_deg_h
        Standard uncertainty of the bias of a gyro along the tool.
    sweep_deg
        Angle turned while one reading is averaged (carousel).
    errors
        Write errors.json, what may be wrong with the stations and what they share: give it to position --errors.
    """
    output.claim(
        {"--output": output_, "--report": report, "--errors": errors},
        {"the readings": raw, "--site": site, "--calibration": calibration, "--history": history},
    )
    options = GyroOptions(
        scheme=scheme,
        method=scale,
        prior=prior,
        scale_sd=_percent(scale_sd_percent, "--scale-sd-percent"),
        history=None if history is None else read_scale(history),
        gyro_sd=_rate(gyro_sd_deg_h, "--gyro-sd-deg-h"),
        accelerometer_sd=_positive(accel_sd_m_s2, "--accel-sd-m-s2", 1.0, "m/s2"),
        z_bias_sd=_rate(z_bias_sd_deg_h, "--z-bias-sd-deg-h"),
        sweep=angle(sweep_deg, "--sweep-deg", 0.0, 180.0),
        hole=hole,
        gravity_sd=gravity_sd(gravity_sd_percent),
    )
    place = read_site(site)
    found = _run(raw, site, place, calibration, options)
    page = None if report is None else _page(found, place)
    if errors is not None:
        survey = found.survey
        own = survey.md, survey.inclination, survey.azimuth, survey.azimuth_reference
        write_errors(RunErrors(*own, survey.errors, found.tool, found.inputs), errors)
    write_run(found, output_)
    if page is not None:
        write_text(page, report or "")
    output.notes(found.survey.notes)
    output.warnings(found.survey.warnings)
    if json:
        output.print_json(_summary(found, output_))
        return
    show_run(found)
    written = f"{output.counted(len(found), 'station')} written to {output_}"
    output.say(written + (f", report to {report}" if report else ""))


def _page(found: GyroRun, site: Site) -> str:
    """The report of a run."""
    from inclinometry.report.gyro import gyro_report

    return gyro_report(
        found.survey,
        found.north,
        md=found.md,
        temperature=found.temperature,
        track=found.track,
        others=found.others,
        checks=found.checks,
        site=site,
    )


def scale(
    run: Path,
    /,
    *,
    site: GyroSite,
    output_: Output,
    calibration: InputOrNone = None,
    scheme: Scheme = "four",
    online: Flag = False,
    history: History = None,
    scale_sd_percent: float = 0.3,
    gyro_sd_deg_h: GyroSd = None,
    hole: Hole = None,
    report: Report = None,
    json: Json = False,
) -> None:
    """Follow the scale factor over the temperatures of a run, for the record and for the next run.

    Parameters
    ----------
    run
        CSV as for gyro north, with temperature_degC.
    output_
        scale.json: give it to gyro north as --history.
    calibration
        tool.json
    online
        Learn from earlier stations only, as during the run; otherwise from the whole run.
    scale_sd_percent
        Standard uncertainty of the scale factor at the reference temperature.
    """
    output.claim(
        {"--output": output_, "--report": report},
        {"the readings": run, "--site": site, "--calibration": calibration, "--history": history},
    )
    options = GyroOptions(
        scheme=scheme,
        prior="both" if online else "run",
        scale_sd=_percent(scale_sd_percent, "--scale-sd-percent"),
        history=None if history is None else read_scale(history),
        gyro_sd=_rate(gyro_sd_deg_h, "--gyro-sd-deg-h"),
        hole=hole,
    )
    found = _run(run, site, read_site(site), calibration, options)
    record = found.record()
    page = None
    if report is not None and found.track is not None:
        from inclinometry.report.gyro import scale_report

        page = scale_report(found.track, md=found.md, tool=found.tool, notes=found.survey.warnings)
    write_scale(record, output_)
    if page is not None:
        write_text(page, report or "")
    output.notes(found.survey.notes)
    output.warnings(found.survey.warnings)
    if json:
        known = record.belief
        output.print_json(
            {
                "stations": len(found),
                "coefficients": known.coefficients,
                "u_coefficients": np.sqrt(np.diag(known.covariance)),
                "reference_temperature_degC": known.reference_temperature,
                "temperature_range_degC": known.temperature_range,
                "learnt": sum(record.learnt),
                "output": output_,
            }
        )
        return
    show_scale(found)
    output.say(f"scale factor of {output.counted(len(found), 'station')} written to {output_}")


def _run(raw: Path, site: Path, place: Site, calibration: Path | None, options: GyroOptions) -> GyroRun:
    with output.reading(raw) as progress:
        data = read_gyro_run(raw, progress=progress)
    tool = None if calibration is None else read_calibration(calibration)
    digests = {"site": digest_file(site)}
    if calibration is not None:
        digests["tool"] = digest_file(calibration)
    with output.busy(f"finding north at {output.counted(len(data), 'station')}"):
        return north_run(data, place, tool, options, inputs=digests)


def _percent(value: float, option: str) -> float:
    return 0.01 * float(_positive(value, option, 50.0, "percent") or 0.0)


def _rate(value: float | None, option: str) -> float | None:
    found = _positive(value, option, 1000.0, "deg/h")
    return None if found is None else found * DEG_PER_HOUR


def _positive(value: float | None, option: str, high: float, unit: str) -> float | None:
    if value is not None and not 0.0 < value <= high:
        raise InputError(f"{option} is {value:g} {unit}; allowed: more than 0, up to {high:g} {unit}")
    return value


def _summary(found: GyroRun, path: Path) -> dict[str, object]:
    return {
        "stations": len(found),
        "method": found.north.method,
        "azimuth_reference": found.survey.azimuth_reference,
        "flagged": sum(bool(row) for row in found.survey.flags),
        "checks": [
            {"name": c.name, "verdict": c.verdict, "reason": c.reason, "action": c.action} for c in found.checks
        ],
        "notes": found.survey.notes,
        "warnings": found.survey.warnings,
        "output": path,
    }


def show_run(found: GyroRun, most: int = 12) -> None:
    """A few stations spread over the run, on the terminal."""
    survey, order = found.survey, np.argsort(found.md)
    rows = []
    for row in np.unique(np.linspace(0, len(survey) - 1, min(most, len(survey))).astype(int)):
        at = int(order[row])
        angles = (survey.inclination, survey.azimuth, survey.toolface)
        u = (survey.u_inclination, survey.u_azimuth, survey.u_toolface)
        cells = [
            rounded(np.degrees(a[row]), np.degrees(w[row])) if np.isfinite(a[row]) else "-"
            for a, w in zip(angles, u, strict=True)
        ]
        scale = found.north.scale[at]
        cells.append(rounded(scale, found.north.u_scale[at]) if np.isfinite(scale) else "-")
        rows.append([f"{survey.md[row]:.1f}", *cells, ", ".join(survey.flags[row])])
    header = ["md m", "inclination", f"azimuth ({survey.azimuth_reference})", "toolface", "scale", "flags"]
    shown = output.excerpt(len(rows), len(survey))
    output.table(f"stations{shown} ({found.north.method}), deg with standard uncertainty", header, rows)
    for check in found.checks:
        output.say(f"{check.name}: {check.verdict}. {check.reason}")


def show_scale(found: GyroRun) -> None:
    """The curve learnt, on the terminal."""
    if found.track is None:
        return
    known = found.track.belief
    names = ("scale at {:g} degC", "slope per 100 degC", "bend per (100 degC)2")
    rows = [
        [name.format(known.reference_temperature), rounded(value, sd)]
        for name, value, sd in zip(names, known.coefficients, np.sqrt(np.diag(known.covariance)), strict=False)
    ]
    output.table("scale factor learnt, with standard uncertainty", ["coefficient", "value"], rows)
