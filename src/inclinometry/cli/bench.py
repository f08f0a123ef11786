"""Commands of the bench: calibrate, compare."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.causes import error_budget
from inclinometry.calibration.conventions import Counts, Dials, InclinationFrom
from inclinometry.calibration.expected import (
    ALL_ANGLES,
    FROM_CALIBRATION,
    OF_ONE_READING,
    ExpectedUncertainty,
    expected_uncertainty,
)
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration, rounded
from inclinometry.calibration.rollset import SecondHarmonics, second_harmonics
from inclinometry.cli import options, output
from inclinometry.cli.options import Flag, Json, Output
from inclinometry.digest import digest_file
from inclinometry.errors import InputError
from inclinometry.files.datasheet_toml import read_nameplate
from inclinometry.files.site_toml import read_site
from inclinometry.files.tool_json import read_tool, write_calibration
from inclinometry.files.writing import write_text
from inclinometry.workflow.calibrate import Comparison, Options, named_degrees, readings_at
from inclinometry.workflow.calibrate import calibrate as calibrate_readings
from inclinometry.workflow.calibrate import compare as compare_methods
from inclinometry.workflow.compare_two import compare_two, content

# What compare prints of two files of one tool.


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
        from inclinometry.report.comparison import two_report

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
    for column, name in enumerate(ALL_ANGLES[:2]):
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


def calibrate(
    readings: Path,
    /,
    *,
    output_: Output,
    method: str = "joint",
    report: Path | None = None,
    site: Path | None = None,
    nameplate: Path | None = None,
    tool: str = "unnamed",
    rig_sd_deg: float | None = None,
    azimuth_sd_deg: float | None = None,
    inclination_sd_deg: float | None = None,
    toolface_sd_deg: float | None = None,
    level_sd_deg: float | None = None,
    north_deg: float | None = None,
    north_sd_deg: float | None = None,
    dip_deg: float | None = None,
    dip_sd_deg: float | None = None,
    accel_step: float | None = None,
    mag_step: float | None = None,
    gyro_step: float | None = None,
    inclination_zero_sd_deg: float | None = None,
    nonorthogonality_sd_deg: float | None = None,
    temperature_degree: int | None = None,
    robust: Flag = False,
    specific_force: Flag = False,
    inclination_from: InclinationFrom = "vertical",
    azimuth_counts: Counts = "clockwise",
    toolface_counts: Counts = "clockwise",
    left_handed: Flag = False,
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
        site.toml with what is known of the bench: g, b_nT, dip_deg, latitude_deg. Dip and latitude decide the signs.
    nameplate
        For classical: data sheet (TOML) or tool.json whose conversion factors are believed.
    tool
        Serial number for the record.
    rig_sd_deg
        Random error of a setting of the rig; estimated from the readings when not given.
    azimuth_sd_deg
        The same for the azimuth dial alone.
    inclination_sd_deg
        The same for the inclination dial alone.
    toolface_sd_deg
        The same for the toolface dial alone.
    level_sd_deg
        How level the stand is known to be.
    north_deg
        Azimuth of the rig's zero from magnetic north; decides the sign of the magnetic field.
    north_sd_deg
        How well that is known; with it north enters the fit of method joint.
    dip_deg
        Magnetic dip at the stand, instead of the one in the readings or in --site.
    dip_sd_deg
        How well the dip is known; with it the dip enters the fit of method joint.
    accel_step
        Step of the accelerometers' converter, in the unit of their channels; found where the readings clearly lie on a
        grid (whole counts, a fixed number of decimals). 0 for none.
    mag_step
        The same for the magnetometers.
    gyro_step
        The same for the gyros.
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
    inclination_from
        Where the inclination dial counts from: vertical (0 with the tool's end down), other-end (180 there),
        horizontal (90 there, positive below the horizon) or horizontal-up (-90 there).
    azimuth_counts
        Which way the azimuth dial counts, seen from above: clockwise or counterclockwise.
    toolface_counts
        Which way the toolface dial counts, looking down hole: clockwise or counterclockwise.
    left_handed
        The tool's channels are left-handed (one is reversed, or two are exchanged), not the dials.
    created
        Date for the record, YYYY-MM-DD or ISO 8601 with the time; nothing is taken from the clock.
    json
        Print a JSON summary.
    """
    output.claim(
        {"--output": output_, "--report": report}, {"the readings": readings, "--site": site, "--nameplate": nameplate}
    )
    _check_date(created)
    wishes = Options(
        inclination_zero_sd=options.sd(inclination_zero_sd_deg, "--inclination-zero-sd-deg"),
        nonorthogonality_sd=options.sd(nonorthogonality_sd_deg, "--nonorthogonality-sd-deg"),
        temperature_degree=temperature_degree,
        robust=robust,
        specific_force=specific_force,
        left_handed=left_handed,
        nameplate=None if nameplate is None else read_nameplate(nameplate),
        name=tool,
        accel_step=_step(accel_step, "--accel-step"),
        mag_step=_step(mag_step, "--mag-step"),
        gyro_step=_step(gyro_step, "--gyro-step"),
        **_stand(
            rig_sd=rig_sd_deg,
            azimuth_sd=azimuth_sd_deg,
            inclination_sd=inclination_sd_deg,
            toolface_sd=toolface_sd_deg,
            level_sd=level_sd_deg,
            north=north_deg,
            north_sd=north_sd_deg,
            dip=dip_deg,
            dip_sd=dip_sd_deg,
        ),
    )
    dials = Dials(inclination_from, azimuth_counts, toolface_counts)
    with output.reading(readings) as progress:
        data = readings_at(readings, None if site is None else read_site(site), progress, dials)
    page = None
    with output.busy(f"calibrating, method {method}"):
        found = calibrate_readings(data, method, wishes)
        if report is not None:
            from inclinometry.report.calibration import calibration_report

            page = calibration_report(found, readings=data)
    write_calibration(found, output_, created=created)
    if page is not None:
        write_text(page, report or "")
    output.notes(found.notes)
    output.warnings(found.warnings)
    expected = expected_uncertainty(found, stated_dip=data.reference.get("dip"))
    if json:
        output.print_json(_summary(found, expected, data) | {"output": output_, "digest": digest_file(output_)})
        return
    show_calibration(found, expected)
    output.say(f"written to {output_}" + (f", report to {report}" if report else ""))


def _step(value: float | None, option: str) -> float | None:
    """The step of a converter, in the unit of its channels."""
    if value is not None and not 0.0 <= value < np.inf:
        raise InputError(f"{option} is {value:g}; the step of a converter is 0 or more, in the unit of the channels")
    return value


def _stand(**degrees: float | None) -> dict[str, Any]:
    """What was said of the stand, in rad; each name with its own limits."""
    limits = {"north": (-360.0, 360.0), "north_sd": (0.0, 90.0), "dip": (-90.0, 90.0)}
    return {
        name: options.angle_or_none(
            value, f"--{name.replace('_', '-')}-deg", *limits.get(name, (0.0, options.LARGEST_SD))
        )
        for name, value in degrees.items()
    }


def _check_date(created: str | None) -> None:
    """A date of the record is one a machine can read."""
    if created is None:
        return
    try:
        datetime.fromisoformat(created)
    except ValueError:
        raise InputError(f"--created is {created!r}; give a date as YYYY-MM-DD or as ISO 8601 with the time") from None


def _summary(found: Calibration, expected: ExpectedUncertainty, data: BenchReadings) -> dict[str, Any]:
    second = second_harmonics(data)
    return {
        "method": found.method,
        "tool": found.tool.name,
        "stations": len(found.residuals.station),
        "rig_sd_deg": np.degrees(found.rig.sd),
        "noise": dict(found.tool.noise),
        "expected_u_deg": named_degrees(expected),
        "notes": list(found.notes),
        "budget": _budget(found, expected, data),
        "second_harmonics": None if second is None else _harmonics(second),
        "warnings": list(found.warnings),
    }


def _budget(found: Calibration, expected: ExpectedUncertainty, data: BenchReadings) -> dict[str, Any] | None:
    """Standard uncertainty of one reading by cause at the inclinations of the table, rms over azimuth and toolface."""
    budget = error_budget(found, data, expected.inclination, expected.dip)
    if budget is None:
        return None
    parts = {name: np.sqrt(np.diagonal(part, axis1=1, axis2=2)) for name, part in budget.components.items()}
    return {
        "inclination_deg": np.degrees(expected.inclination).round(9),
        "rms_u_deg": {name: _angles_of(part) for name, part in parts.items()},
        "total_rms_u_deg": _angles_of(budget.standard_uncertainty),
        "share": {name: dict(zip(budget.quantities[:3], part.T, strict=False)) for name, part in budget.shares.items()},
    }


def _angles_of(values: Array) -> dict[str, Any]:
    return {name: np.degrees(values[:, i]) for i, name in enumerate(("inclination", "azimuth", "toolface"))}


def _harmonics(found: SecondHarmonics) -> dict[str, Any]:
    """Second harmonics of the roll sets as names and numbers."""
    return {
        "sets": [
            {
                "set": name,
                "sensors": {
                    f"{kind} {sensor + 1}": {
                        "first": abs(found.first[kind][place, sensor]),
                        "second": abs(found.second[kind][place, sensor]),
                        "phase_deg": float(np.degrees(np.angle(found.second[kind][place, sensor]))),
                        "u": found.u[kind][place, sensor],
                    }
                    for kind in found.first
                    for sensor in range(found.first[kind].shape[1])
                },
            }
            for place, name in enumerate(found.sets)
        ],
        "uneven_roll_deg": float(np.degrees(abs(found.unevenness))),
        "u_uneven_roll_deg": float(np.degrees(found.u_unevenness)),
        "square_law_percent": {kind: 100.0 * v for kind, v in found.square.items()},
        "u_square_law_percent": {kind: 100.0 * v for kind, v in found.u_square.items()},
        "degrees_of_freedom": found.freedom,
        "significant": list(found.sentences),
    }


def show_parameters(found: Calibration) -> None:
    """Tensor and offset of each triad on the terminal."""
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


def show_calibration(found: Calibration, expected: ExpectedUncertainty) -> None:
    """Tables of a calibration on the terminal."""
    show_parameters(found)
    terms = {FROM_CALIBRATION: expected.from_calibration, OF_ONE_READING: expected.of_one_reading}
    rows = [
        [f"u({name}) {term}", *_figures(u[:, ALL_ANGLES.index(name)])]
        for name in expected.angles
        for term, u in terms.items()
    ]
    if rows:
        output.table(
            "expected standard uncertainty, worst attitude, deg, at inclination", ["", *_at(expected.inclination)], rows
        )
    sd = np.degrees(found.rig.sd)
    stations = output.counted(len(found.residuals.station), "station")
    rig = f"rig settings good to {sd.max():.3f} deg" if found.field_directions else "without a rig"
    output.say(f"method {found.method}, {stations}, {rig}")


def compare(
    readings: Path,
    second: Path | None = None,
    /,
    *,
    methods: str | None = None,
    report: Path | None = None,
    truth: Path | None = None,
    site: Path | None = None,
    nameplate: Path | None = None,
    rig_sd_deg: float | None = None,
    azimuth_sd_deg: float | None = None,
    inclination_sd_deg: float | None = None,
    toolface_sd_deg: float | None = None,
    level_sd_deg: float | None = None,
    north_deg: float | None = None,
    north_sd_deg: float | None = None,
    dip_deg: float | None = None,
    dip_sd_deg: float | None = None,
    inclination_from: InclinationFrom = "vertical",
    azimuth_counts: Counts = "clockwise",
    toolface_counts: Counts = "clockwise",
    left_handed: Flag = False,
    json: Json = False,
) -> None:
    """Run every applicable method on the same readings, side by side; or two files of one tool.

    Parameters
    ----------
    readings
        Bench readings CSV; with a second file, tool.json will do.
    second
        Another file of the same tool, readings or tool.json: the coefficients of both with their differences, and the
        expected uncertainties and differences of the angles.
    methods
        Of the two files, with a comma, e.g. orthogonal,rotations; one for both. joint when not given.
    report
        Write an HTML report, of two files.
    truth
        truth.json of a simulation: adds the actual errors.
    site
        site.toml with the fields at the bench.
    nameplate
        Data sheet (TOML) or tool.json with the conversion factors of the classical method; not run without.
    rig_sd_deg
        Random error of a setting of the rig; estimated when not given.
    azimuth_sd_deg
        The same for the azimuth dial alone.
    inclination_sd_deg
        The same for the inclination dial alone.
    toolface_sd_deg
        The same for the toolface dial alone.
    level_sd_deg
        How level the stand is known to be; the joint fit alone uses it.
    north_deg
        Azimuth of the rig's zero from magnetic north.
    north_sd_deg
        How well that is known; the joint fit alone uses it.
    dip_deg
        Magnetic dip at the stand.
    dip_sd_deg
        How well the dip is known; the joint fit alone uses it.
    inclination_from
        Where the inclination dial counts from: vertical (0 with the tool's end down), other-end (180 there),
        horizontal (90 there, positive below the horizon) or horizontal-up (-90 there).
    azimuth_counts
        Which way the azimuth dial counts, seen from above: clockwise or counterclockwise.
    toolface_counts
        Which way the toolface dial counts, looking down hole: clockwise or counterclockwise.
    left_handed
        The tool's channels are left-handed (one is reversed, or two are exchanged), not the dials.
    json
        Print JSON.
    """
    known_stand: dict[str, Any] = _stand(
        rig_sd=rig_sd_deg,
        azimuth_sd=azimuth_sd_deg,
        inclination_sd=inclination_sd_deg,
        toolface_sd=toolface_sd_deg,
        level_sd=level_sd_deg,
        north=north_deg,
        north_sd=north_sd_deg,
        dip=dip_deg,
        dip_sd=dip_sd_deg,
    )
    wishes = Options(left_handed=left_handed, **known_stand)
    dials = Dials(inclination_from, azimuth_counts, toolface_counts)
    if second is not None:
        show_two((readings, second), methods or "joint", wishes, dials, site, truth, report, json)
        return
    with output.reading(readings) as progress:
        data = readings_at(readings, None if site is None else read_site(site), progress, dials)
    if methods is not None or report is not None:
        option = "--methods" if methods is not None else "--report"
        raise InputError(f"{option} is for two files of one tool; give a second file, or leave it out")
    known = None if truth is None else read_tool(truth)
    sheet = None if nameplate is None else read_nameplate(nameplate)
    with output.busy("running every method"):
        found = compare_methods(data, truth=known, options=replace(wishes, nameplate=sheet))
    if json:
        output.print_json(_comparison(found))
    else:
        show_comparison(found)


def _comparison(found: Comparison) -> dict[str, Any]:
    return {
        "inclination_deg": np.degrees(found.inclination).round(9),
        "methods": [
            {
                "method": a.method,
                "applicable": a.calibration is not None,
                "reason": a.reason,
                "expected_u_deg": None
                if a.method not in found.uncertainty
                else named_degrees(found.uncertainty[a.method]),
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


def _at(inclination: Array) -> list[str]:
    """Heads of columns, one an inclination."""
    return [f"{i:g}°" for i in np.degrees(inclination).round(9)]


def _figures(values: Array) -> list[str]:
    return [f"{v:.3f}" if np.isfinite(v) else "-" for v in np.degrees(values)]


def _by_method(title: str, methods: list[str], inclination: Array, values: Mapping[str, Array]) -> None:
    nothing = np.full(len(inclination), np.nan)
    output.table(title, ["method", *_at(inclination)], [[m, *_figures(values.get(m, nothing))] for m in methods])


def show_comparison(found: Comparison, title: str = "") -> None:
    """Table of the methods on the terminal."""
    if title:
        output.say(title)
    methods = [a.method for a in found.attempts if a.calibration is not None]
    for column, name in enumerate(ALL_ANGLES[:2]):
        stated = {m: u.from_calibration[:, column] for m, u in found.uncertainty.items()}
        _by_method(
            f"u({name}) {FROM_CALIBRATION}, worst attitude, deg, at inclination", methods, found.inclination, stated
        )
    if found.error:
        wrong = {method: error[:, 1] for method, error in found.error.items()}
        _by_method("true error of azimuth, rms, deg, at inclination", methods, found.inclination, wrong)
    for attempt in found.attempts:
        if attempt.calibration is None:
            output.say(f"{attempt.method}: not applicable: {attempt.reason}")
    for attempt in found.attempts:
        if attempt.calibration is not None and attempt.method == "joint":
            output.warnings(attempt.calibration.warnings)
