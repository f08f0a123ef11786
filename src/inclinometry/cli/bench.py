"""Commands of the bench: calibrate, compare."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from inclinometry.calibration.result import Calibration
from inclinometry.calibration.summary import rounded
from inclinometry.cli import options, output
from inclinometry.cli.options import Flag, Json, Output
from inclinometry.core.arrays import Array
from inclinometry.core.digest import digest_file
from inclinometry.core.errors import InputError
from inclinometry.io.atomic import write_text
from inclinometry.io.site_toml import read_site
from inclinometry.io.tool_json import read_tool, write_calibration
from inclinometry.workflow.calibrate import INCLINATIONS, Comparison, Options, expected_uncertainty, readings_at
from inclinometry.workflow.calibrate import calibrate as calibrate_readings
from inclinometry.workflow.calibrate import compare as compare_methods


def calibrate(
    readings: Path,
    /,
    *,
    output_: Output,
    method: str = "joint",
    report: Path | None = None,
    site: Path | None = None,
    tool: str = "unnamed",
    rig_sd_deg: float | None = None,
    level_sd_deg: float | None = None,
    inclination_zero_sd_deg: float | None = None,
    nonorthogonality_sd_deg: float | None = None,
    temperature_degree: int | None = None,
    robust: Flag = False,
    specific_force: Flag = False,
    created: str | None = None,
    json: Json = False,
) -> None:
    """Calibrate a tool from bench readings.

    Parameters
    ----------
    readings
        CSV with station, azimuth_deg, inclination_deg, toolface_deg and the channels accel_x ... mag_z, gyro_z.
    output_
        The calibration, tool.json.
    method
        joint, twelve, orthogonal, rotations, classical, field (no angles, only roll_set) or norm (no roll set
        either: each triad in its own axes).
    report
        Write an HTML report.
    site
        site.toml with the fields at the bench (g, b_nT, dip_deg).
    tool
        Serial number for the record.
    rig_sd_deg
        Random error of a setting of the rig; estimated from the readings when not given.
    level_sd_deg
        How level the stand is known to be, for plans that cannot tell.
    inclination_zero_sd_deg
        Fit a constant error of the inclination dial with this prior.
    nonorthogonality_sd_deg
        Fit the non-orthogonality of the rig's axes with this prior.
    temperature_degree
        Degree of the polynomial in temperature; chosen by information criterion when not given.
    robust
        Leave out stations that disagree with the others.
    specific_force
        For field and norm: the accelerometer's channels count upwards (at rest they read -g, along the axis that
        points up they are positive). The other methods learn this from the rig.
    created
        Date for the record, YYYY-MM-DD or ISO 8601 with the time; nothing is taken from the clock.
    json
        Print a JSON summary.
    """
    output.claim({"--output": output_, "--report": report}, {"the readings": readings, "--site": site})
    _check_date(created)
    wishes = Options(
        options.sd(rig_sd_deg, "--rig-sd-deg"),
        options.sd(level_sd_deg, "--level-sd-deg"),
        options.sd(inclination_zero_sd_deg, "--inclination-zero-sd-deg"),
        options.sd(nonorthogonality_sd_deg, "--nonorthogonality-sd-deg"),
        temperature_degree,
        robust,
        specific_force,
        tool,
    )
    with output.reading(readings) as progress:
        data = readings_at(readings, None if site is None else read_site(site), progress)
    page = None
    with output.busy(f"calibrating, method {method}"):
        found = calibrate_readings(data, method, wishes)
        if report is not None:
            from inclinometry.report.calibration import calibration_report

            page = calibration_report(found, readings=data)
    write_calibration(found, output_, created=created)
    if page is not None:
        write_text(page, report or "")
    output.warnings(found.warnings)
    if json:
        output.print_json(_summary(found) | {"output": output_, "digest": digest_file(output_)})
        return
    show_calibration(found)
    output.say(f"written to {output_}" + (f", report to {report}" if report else ""))


def _check_date(created: str | None) -> None:
    """A date of the record is one a machine can read."""
    if created is None:
        return
    try:
        datetime.fromisoformat(created)
    except ValueError:
        raise InputError(f"--created is {created!r}; give a date as YYYY-MM-DD or as ISO 8601 with the time") from None


def _summary(found: Calibration) -> dict[str, Any]:
    expected = expected_uncertainty(found)
    rows = np.zeros((0, 4)) if expected is None else np.degrees(expected)
    return {
        "method": found.method,
        "tool": found.tool.name,
        "stations": len(found.residuals.station),
        "rig_sd_deg": np.degrees(found.rig.sd),
        "noise": dict(found.tool.noise),
        "expected_u_deg": [
            {"inclination_deg": float(np.degrees(i)), "inclination": r[0], "azimuth": r[1], "toolface": r[2]}
            for i, r in zip(INCLINATIONS, rows, strict=False)
        ],
        "warnings": list(found.warnings),
    }


def show_calibration(found: Calibration) -> None:
    """Tables of a calibration on the terminal."""
    u = found.uncertainty
    for kind, triad in found.tool.triads.items():
        rows = []
        for sensor in range(triad.count):
            names = [f"{kind}.tensor[{sensor},{axis}]" for axis in range(3)] + [f"{kind}.offset[{sensor}]"]
            values = [*triad.tensor[0, sensor], triad.offset[0, sensor]]
            rows.append([str(sensor + 1), *(rounded(v, u[n]) for v, n in zip(values, names, strict=True))])
        output.table(
            f"{kind}, {triad.unit} per unit field", ["sensor", "along x", "along y", "along z", "offset"], rows
        )
    expected = expected_uncertainty(found)
    if expected is not None:
        rows = [
            [f"{np.degrees(i):g}", *(f"{value:.3f}" for value in np.degrees(r[:3]))]
            for i, r in zip(INCLINATIONS, expected, strict=True)
        ]
        header = ["inclination deg", "u(inclination)", "u(azimuth)", "u(toolface)"]
        output.table("expected standard uncertainty from this calibration, worst case, deg", header, rows)
    sd = np.degrees(found.rig.sd)
    stations = output.counted(len(found.residuals.station), "station")
    output.say(f"method {found.method}, {stations}, rig settings good to {sd.max():.3f} deg")


def compare(
    readings: Path,
    /,
    *,
    truth: Path | None = None,
    site: Path | None = None,
    rig_sd_deg: float | None = None,
    level_sd_deg: float | None = None,
    json: Json = False,
) -> None:
    """Run every applicable method on the same readings, side by side.

    Parameters
    ----------
    readings
        Bench readings CSV.
    truth
        truth.json of a simulation: adds the actual errors.
    site
        site.toml with the fields at the bench.
    rig_sd_deg
        Random error of a setting of the rig; estimated when not given.
    level_sd_deg
        How level the stand is known to be.
    json
        Print JSON.
    """
    rig_sd, level_sd = options.sd(rig_sd_deg, "--rig-sd-deg"), options.sd(level_sd_deg, "--level-sd-deg")
    with output.reading(readings) as progress:
        data = readings_at(readings, None if site is None else read_site(site), progress)
    known = None if truth is None else read_tool(truth)
    with output.busy("running every method"):
        found = compare_methods(data, truth=known, rig_sd=rig_sd, level_sd=level_sd)
    if json:
        output.print_json(_comparison(found))
    else:
        show_comparison(found)


def _comparison(found: Comparison) -> dict[str, Any]:
    return {
        "inclination_deg": np.degrees(found.inclination),
        "methods": [
            {
                "method": a.method,
                "applicable": a.calibration is not None,
                "reason": a.reason,
                "expected_u_deg": _named(found.uncertainty.get(a.method)),
                "true_error_deg": _named(found.error.get(a.method)),
                "parameters": None if a.calibration is None else asdict_parameters(a.calibration),
                "warnings": [] if a.calibration is None else list(a.calibration.warnings),
            }
            for a in found.attempts
        ],
    }


def _named(values: Any) -> dict[str, Any] | None:
    if values is None:
        return None
    return {name: np.degrees(values[:, i]) for i, name in enumerate(("inclination", "azimuth", "toolface"))}


def asdict_parameters(found: Calibration) -> dict[str, Any]:
    """Tensor and offset of each triad with their standard uncertainties."""
    u = np.sqrt(np.diagonal(found.tool.covariance))
    content = {}
    for kind, triad in found.tool.triads.items():
        block = u[found.tool.slices[kind]].reshape(triad.degree + 1, triad.count, 4)[0]
        content[kind] = {
            "tensor": triad.tensor[0],
            "offset": triad.offset[0],
            "u_tensor": block[:, :3],
            "u_offset": block[:, 3],
        }
    return content


def _figures(values: Array | None) -> str:
    return "-" if values is None else " ".join(f"{v:.3f}" for v in np.degrees(values))


def show_comparison(found: Comparison, title: str = "") -> None:
    """Table of the methods on the terminal."""
    header = ["method", "u(inclination)", "u(azimuth)"] + (["azimuth error"] if found.error else [])
    rows, reasons = [], []
    for attempt in found.attempts:
        if attempt.calibration is None:
            reasons.append(f"{attempt.method}: not applicable: {attempt.reason}")
            continue
        expected, error = found.uncertainty.get(attempt.method), found.error.get(attempt.method)
        row = [attempt.method, *(_figures(None if expected is None else expected[:, c]) for c in (0, 1))]
        rows.append(row + ([_figures(None if error is None else error[:, 1])] if found.error else []))
    at = ", ".join(f"{np.degrees(i):g}" for i in found.inclination)
    title = title or f"standard uncertainty from the calibration alone, worst case, deg, at inclinations {at}"
    output.table(title, header, rows)
    for sentence in reasons:
        output.say(sentence)
    for attempt in found.attempts:
        if attempt.calibration is not None and attempt.method == "joint":
            output.warnings(attempt.calibration.warnings)
