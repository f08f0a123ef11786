"""Commands of the bench: calibrate, compare, verify."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

import numpy as np
from cyclopts import Parameter

from inclinometry.arrays import Array
from inclinometry.calibration.conventions import Dials
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
from inclinometry.calibration.uncertainty_budget import error_budget
from inclinometry.cli import options, output
from inclinometry.cli.stand import UNKNOWN, USUAL_DIALS, USUAL_FIT, DialOptions, FitOptions, LeftHanded, StandOptions
from inclinometry.constants import ANGLES, UNIT_LABELS
from inclinometry.digest import digest_file
from inclinometry.errors import FileError, refused
from inclinometry.files.tool_json import read_calibration, read_tool, write_calibration
from inclinometry.findings import Finding, only_notes, without_notes
from inclinometry.uncertainty import shares
from inclinometry.workflow.calibrate import (
    METHODS,
    Comparison,
    MethodName,
    Options,
    named_degrees,
    readings_at,
    refuse_unused,
    usual_method,
)
from inclinometry.workflow.calibrate import calibrate as calibrate_readings
from inclinometry.workflow.calibrate import compare as compare_methods

if TYPE_CHECKING:
    from inclinometry.calibration.conformity import OtherStand, Verification
    from inclinometry.calibration.hand_rotations import HandRotations
    from inclinometry.earth.site import Site
    from inclinometry.sensors import Tool


def _site(path: Path | None) -> Site | None:
    """The place, where one is given; its reader is loaded then alone."""
    if path is None:
        return None
    from inclinometry.files.site_toml import read_site

    return read_site(path)


def _data_sheet(path: Path | None) -> Tool | None:
    """The data sheet values, where they are given; their reader is loaded then alone."""
    if path is None:
        return None
    from inclinometry.files.datasheet_toml import read_data_sheet

    return read_data_sheet(path)


def show_two(
    paths: tuple[Path, Path],
    methods: str,
    wishes: Options,
    dials: Dials,
    site: Path | None,
    truth: Path | None,
    report: Path | None,
    json: bool,
) -> None:
    """Calibrate two files of one tool, print both with their differences, write the report."""
    output.check_outputs(
        {"--report": report}, {"the first file": paths[0], "the second": paths[1], "--site": site, "--truth": truth}
    )
    from inclinometry.workflow.compare_two import compare_two, content

    with output.busy("calibrating both"):
        found = compare_two(
            paths,
            [name.strip() for name in methods.split(",")],
            options=wishes,
            dials=dials,
            site=_site(site),
            truth=None if truth is None else read_tool(truth),
        )
    with output.reported(report, "comparison:two_report", found):
        said = content(found)
    output.findings([one for c in found.calibrations for one in c.findings])
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
            output.print_line(f"{name}: not in both calibrations")
            continue
        curves = {f"u, {n}": u for n, u in zip(found.names, found.uncertainty, strict=True)}
        curves["difference, rms"] = found.difference
        curves |= {f"true error, {n}": e for n, e in zip(found.names, found.error or (), strict=False)}
        cells = [_figures(values[:, column]) for values in curves.values()]
        degrees = [f"{i:g}" for i in np.degrees(found.inclination).round(6)]
        rows = [list(row) for row in zip(degrees, *cells, strict=True)]
        output.table(f"{name}, deg: u {FROM_CALIBRATION}, worst attitude", ["inclination deg", *curves], rows)
    if report is not None:
        output.print_line(f"report written to {report}")


DataSheet: TypeAlias = Annotated[
    Path | None,
    Parameter(
        group=options.INPUT,
        help="classical: data sheet (TOML) or tool.json with the conversion factors. Required by that method.",
    ),
]


def calibrate(
    readings: Path,
    /,
    *,
    output_: options.OutputOrNone = None,
    method: MethodName | Literal["hand-rotations"] | None = None,
    report: options.Report = None,
    site: options.InputOrNone = None,
    gyro_log: options.InputOrNone = None,
    gyro_profile: Annotated[str | None, Parameter(group=options.INPUT)] = None,
    data_sheet: DataSheet = None,
    tool: options.Serial = "unnamed",
    stand: StandOptions = UNKNOWN,
    fit: FitOptions = USUAL_FIT,
    robust: options.Flag = False,
    specific_force: options.Flag = False,
    dials: DialOptions = USUAL_DIALS,
    left_handed: LeftHanded = False,
    created: options.Created = None,
    json: options.Json = False,
) -> None:
    """Calibrate a tool from bench readings.

    Parameters
    ----------
    readings
        Table with station, azimuth_deg, inclination_deg, toolface_deg and the channels accel_x ... mag_z, gyro_z. With
        hand-rotations: a log with time_s, accel_x ... gyro_z.
    output_
        Write the calibration, tool.json. Without -o nothing is written.
    method
        joint if not given. field: roll sets without angles (used if roll_set is given without angles). norm: no rig,
        each triad in its own axes. hand-rotations: log of a tool turned by hand.
    site
        site.toml with g, b_nT, dip_deg, latitude_deg of the stand. Dip and latitude set the signs of the fields.
    gyro_log
        hand-rotations: gyro log in a separate file with the same times.
    gyro_profile
        Profile of --gyro-log. Default: --profile.
    robust
        Exclude outlier stations.
    specific_force
        field, norm, hand-rotations: the accelerometer reads specific force (-g at rest, positive up). Other methods
        detect it.
    """
    output.check_outputs(
        {"--output": output_, "--report": report},
        {"the readings": readings, "--site": site, "--data-sheet": data_sheet, "--gyro-log": gyro_log},
    )
    wishes = Options(
        robust=robust,
        specific_force=specific_force,
        left_handed=left_handed,
        data_sheet=_data_sheet(data_sheet),
        name=tool,
        **vars(fit),
        **vars(stand),
    )
    if method != "hand-rotations" and (gyro_log or gyro_profile):
        raise refused(
            "input-needs",
            {"name": "--gyro-log" if gyro_log else "--gyro-profile", "needed": ("--method hand-rotations",)},
        )
    by_hand = None
    with output.reading(readings) as progress:
        if method == "hand-rotations":
            from inclinometry.workflow.hand_rotations import calibrate_log

            refuse_unused(method, wishes)
            by_hand, found, data = calibrate_log(
                readings,
                _site(site),
                gyro_log=gyro_log,
                gyro_profile=gyro_profile,
                specific_force=specific_force,
                name=tool,
                progress=progress,
            )
        else:
            data = readings_at(readings, _site(site), progress, dials.dials())
            if tool == "unnamed" and data.serial:
                wishes = replace(wishes, name=data.serial)
            method = method or usual_method(data)
            with output.busy(f"calibrating, method {method}"):
                found = calibrate_readings(data, method, wishes)
    with output.reported(report, "calibration:calibration_report", found, readings=data):
        if output_ is not None:
            write_calibration(found, output_, created=created)
    output.findings(found.findings)
    expected = expected_uncertainty(found, stated_dip=data.reference.get("dip"))
    if json:
        written = {} if output_ is None else {"output": output_, "digest": digest_file(output_)}
        # axes that are no tool's have no angles to expect an uncertainty of
        own = {"expected_u_deg": None, "budget": None}
        rotations = {} if by_hand is None else own | {"rotations": hand_rotations_json(by_hand)}
        output.print_json(_summary(found, expected, data) | rotations | written)
        return
    if by_hand is not None:
        show_hand_rotations(by_hand, data.units)
    else:
        show_calibration(found, expected)
    output.print_outputs(output_, report)


def hand_rotations_json(found: HandRotations) -> dict[str, Any]:
    """The triads as imu_tk and data sheets state them; bias and conversion in signal units."""
    fit = found.accelerometer
    return {
        "rests": len(found.rests),
        "used": len(found.rotations),
        "rms_deg": float(np.degrees(found.rms)),
        "accelerometer": {"bias": fit.bias, "conversion": 1.0 / fit.scale, "misalignment_rad": fit.misalignment}
        | {f"u_{name}": value for name, value in fit.uncertainty.items() if name != "scale"},
        "gyro": {"bias": found.bias, "conversion": 1.0 / found.scale, "misalignment_rad": found.misalignment}
        | {f"u_{name}": value for name, value in found.uncertainty.items() if name != "scale"}
        | {"bias_scatter": found.bias_scatter},
    }


def show_hand_rotations(found: HandRotations, units: Mapping[str, str]) -> None:
    """Bias, conversion factor and misalignment of both triads on the terminal."""
    fit, rows = found.accelerometer, []
    skew, u_skew = np.eye(3), np.zeros((3, 3))
    skew[0, 1], skew[0, 2], skew[1, 2] = fit.misalignment * [-1.0, 1.0, -1.0]
    u_skew[0, 1], u_skew[0, 2], u_skew[1, 2] = fit.uncertainty["misalignment"]
    parts = (
        ("accel", fit.bias, fit.scale, skew, fit.uncertainty | {"misalignment": u_skew}),
        ("gyro", found.bias, found.scale, found.misalignment, found.uncertainty),
    )
    for kind, bias, scale, matrix, u in parts:
        for k, axis in enumerate("xyz"):
            values = [(bias[k], u["bias"][k]), (1.0 / scale[k], u["conversion"][k])]
            values += [(1e3 * matrix[row, k], 1e3 * u["misalignment"][row, k]) for row in range(3)]
            rows.append([f"{kind}_{axis}", *(rounded(value, sd) for value, sd in values)])
    unit = "accel in {accelerometer} and per m/s2, gyro in {gyro} and per rad/s".format(**units)
    header = ["sensor", "bias", "conversion", *(f"{axis} mrad" for axis in "xyz")]
    output.table(f"in the accelerometer's axes: {unit}", header, rows)
    output.print_line(
        f"{output.counted(len(found.rests), 'rest')}, {output.counted(len(found.rotations), 'rotation')}: predicted "
        f"and seen gravity differ by {np.degrees(found.rms):.2g} deg rms; over the log the gyro's bias scattered by "
        f"{', '.join(f'{value:.3g}' for value in found.bias_scatter)} {units['gyro']}"
    )


def _summary(found: Calibration, expected: ExpectedUncertainty, data: BenchReadings) -> dict[str, Any]:
    second = second_harmonics(data)
    return {
        "method": found.method,
        "tool": found.tool.name,
        "stations": len(found.residuals.station),
        "rig_sd_deg": np.degrees(found.rig.sd),
        "off_stand": _off_stand(found, data),
        "noise": {in_unit(kind, found.tool.triads[kind].unit): v for kind, v in found.tool.noise.items()},
        "residual_rms": {
            in_unit(kind, found.tool.triads[kind].unit): np.sqrt(np.mean(v**2, axis=0))
            for kind, v in found.residuals.values.items()
        },
        "parameters": asdict_parameters(found),
        "expected_u_deg": named_degrees(expected),
        "budget": _budget(found, expected, data),
        "second_harmonics": None if second is None else _harmonics(second),
        "findings": found.findings,
    }


def _off_stand(found: Calibration, data: BenchReadings) -> dict[str, Any] | None:
    """How many readings off the stand there are and their scatter: share of the field, nT where that is known."""
    if data.off_stand is None or not found.off_scatter:
        return None
    share, field = found.off_scatter, data.reference.get("b")
    told: dict[str, Any] = {
        "readings": len(data.off_stand),
        "scatter_percent": {k: 100.0 * v for k, v in share.items()},
    }
    return told | ({"scatter_nT": share["magnetometer"] * field} if field and "magnetometer" in share else {})


def _budget(found: Calibration, expected: ExpectedUncertainty, data: BenchReadings) -> dict[str, Any] | None:
    """Standard uncertainty of one reading by cause at the inclinations of the table, rms over azimuth and toolface."""
    budget = error_budget(found, data, expected.inclination, expected.dip)
    if budget is None:
        return None
    parts = {name: np.sqrt(np.diagonal(part, axis1=1, axis2=2)) for name, part in budget.items()}
    return {
        "inclination_deg": np.degrees(expected.inclination).round(9),
        "rms_u_deg": {name: _angles_of(part) for name, part in parts.items()},
        "total_rms_u_deg": _angles_of(np.sqrt(np.diagonal(sum(budget.values()), axis1=1, axis2=2))),
        "share": {name: dict(zip(ANGLES, part.T, strict=False)) for name, part in shares(budget).items()},
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
        "significant": [one.plain() for one in found.findings],
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
    rig = f"rig settings: standard deviation {sd.max():.3f} deg" if found.field_directions else "without a rig"
    shown = [f"{100.0 * sd:.2g} % ({kind})" for kind, sd in found.off_scatter.items()]
    away = [f"readings off the stand: scatter {', '.join(shown)} of the field"] if shown else []
    output.print_line(", ".join([f"method {found.method}", stations, rig, *away]))


def compare(
    readings: Path,
    second: Path | None = None,
    /,
    *,
    methods: Annotated[
        str | None,
        Parameter(
            help=f"Two files: one method for both, or two with a comma, as orthogonal,rotations. Choices: "
            f"{', '.join(METHODS)}. Default: joint."
        ),
    ] = None,
    report: Annotated[
        options.Report,
        Parameter(help="Write an HTML report on two files."),
    ] = None,
    truth: options.InputOrNone = None,
    site: options.InputOrNone = None,
    data_sheet: DataSheet = None,
    stand: StandOptions = UNKNOWN,
    dials: DialOptions = USUAL_DIALS,
    left_handed: LeftHanded = False,
    json: options.Json = False,
) -> None:
    """Run every applicable method on the same readings, side by side; or two files of one tool.

    Parameters
    ----------
    readings
        Bench readings; with a second file, tool.json too.
    second
        Second file of the same tool, readings or tool.json: both are compared, coefficients and angles.
    truth
        truth.json of a simulation: adds the actual errors.
    site
        site.toml with the fields at the stand.
    """
    wishes = Options(left_handed=left_handed, **vars(stand))
    if second is not None:
        show_two((readings, second), methods or "joint", wishes, dials.dials(), site, truth, report, json)
        return
    with output.reading(readings) as progress:
        data = readings_at(readings, _site(site), progress, dials.dials())
    if methods is not None or report is not None:
        option = "--methods" if methods is not None else "--report"
        raise refused("input-needs", {"name": option, "needed": ("SECOND",)})
    known = None if truth is None else read_tool(truth)
    sheet = _data_sheet(data_sheet)
    with output.reading(readings), output.busy("running every method"):
        found = compare_methods(data, truth=known, options=replace(wishes, data_sheet=sheet))
    why = {a.method: a.reason._replace(severity="note") for a in found.attempts if a.reason}
    joint = found.attempts[0].calibration
    output.findings([*why.values(), *(joint.findings if joint else ())], list(why))
    if json:
        content = [
            {
                "method": a.method,
                "applicable": a.calibration is not None,
                "reason": a.reason,
                "expected_u_deg": None
                if a.method not in found.uncertainty
                else named_degrees(found.uncertainty[a.method]),
                "true_error_deg": _angles_of(found.error[a.method]) if a.method in found.error else None,
                "parameters": None if a.calibration is None else asdict_parameters(a.calibration),
                "findings": [] if a.calibration is None else [one.plain() for one in a.calibration.findings],
            }
            for a in found.attempts
        ]
        output.print_json({"inclination_deg": np.degrees(found.inclination).round(9), "methods": content})
    else:
        show_comparison(found)


def asdict_parameters(found: Calibration) -> dict[str, Any]:
    """Tensor and offset of each triad with their standard uncertainties."""
    u = np.sqrt(np.diagonal(found.tool.covariance))
    content = {}
    for kind, triad in found.tool.triads.items():
        block = u[found.tool.slices[kind]].reshape(triad.degree + 1, triad.count, 4)[0]
        per_field = f"{in_unit('tensor', triad.unit)}_per_field"
        content[kind] = {
            per_field: triad.tensor[0],
            in_unit("offset", triad.unit): triad.offset[0],
            f"u_{per_field}": block[:, :3],
            f"u_{in_unit('offset', triad.unit)}": block[:, 3],
        }
    return content


def in_unit(name: str, unit: str) -> str:
    """A key with the unit of a triad, as columns have it.

    Examples
    --------
    >>> in_unit("offset", "m/s^2"), in_unit("noise", "counts")
    ('offset_m_s2', 'noise_counts')
    """
    return f"{name}_{next((suffix for suffix, label in UNIT_LABELS.items() if label == unit), unit)}"


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
        output.print_line(title)
    methods = [a.method for a in found.attempts if a.calibration is not None]
    for column, name in enumerate(ALL_ANGLES[:2]):
        stated = {m: u.from_calibration[:, column] for m, u in found.uncertainty.items()}
        _by_method(
            f"u({name}) {FROM_CALIBRATION}, worst attitude, deg, at inclination", methods, found.inclination, stated
        )
    if found.error:
        wrong = {method: error[:, 1] for method, error in found.error.items()}
        _by_method("true error of azimuth, rms, deg, at inclination", methods, found.inclination, wrong)
    if out := [a.method for a in found.attempts if a.calibration is None]:
        output.print_line(f"not applicable: {', '.join(out)}; -v says why")


def verify(
    readings: Path,
    /,
    *,
    calibration: options.Input,
    limits: Annotated[
        str | None,
        Parameter(
            group=options.INPUT,
            help=f"A TOML file, or a preset: {options.shipped('files/limits')}. Without it, errors are "
            "compared with their uncertainty.",
        ),
    ] = None,
    stand: Annotated[Literal["same", "level", "fit"], Parameter(group=options.STAND)] = "same",
    north: Annotated[options.AzimuthOrNone, Parameter(group=options.STAND)] = None,
    north_sd: Annotated[options.Sd, Parameter(group=options.STAND)] = 0.0,
    level_sd: Annotated[options.Sd, Parameter(group=options.STAND)] = 0.0,
    rig_sd: Annotated[options.SdOrNone, Parameter(group=options.STAND)] = None,
    azimuth_from: options.AzimuthFrom = None,
    gravity_sd: Annotated[
        options.GravitySd,
        Parameter(
            help="Two accelerometers, another stand: standard uncertainty of |g| relative to the calibration; 0 at "
            "the same place. If not given, from site and calibration, else 0.3."
        ),
    ] = None,
    output_: options.OutputOrNone = None,
    report: options.Report = None,
    dials: DialOptions = USUAL_DIALS,
    planned: options.Flag = False,
    count: int | None = None,
    json: options.Json = False,
) -> int:
    """Verify a calibrated tool at independent positions; exit status 0 pass, 1 fail, 2 bad input.

    Without --limits: 0 when the errors agree with the calibration, 1 when they do not.

    Parameters
    ----------
    readings
        Bench readings at positions that were not used to calibrate.
    calibration
        tool.json
    stand
        same: the stand of the calibration, not moved since. level: another one, its azimuth axis vertical. fit: another
        one; its tilt and north are found from these readings.
    north
        Level stand: azimuth of the rig's zero from magnetic north (gyro: true north). If not given, it is fitted and a
        constant azimuth error is not judged.
    north_sd
        Standard deviation of the north of a level stand.
    level_sd
        Standard deviation of the vertical of a level stand.
    rig_sd
        Standard deviation of a dial setting of another stand. Default: that of the calibration's rig.
    output_
        Write verify.json, for a certificate; with --planned the planned verification, JSON.
    planned
        The file is a plan (`inclinometry plan spread`). Prints which errors these positions detect, and the risks of
        both sides.
    count
        With --planned: readings averaged at each position. Default: 1.
    """
    from inclinometry.calibration.conformity import verify as verify_readings
    from inclinometry.files.limits import read_limits

    output.check_outputs(
        {"--output": output_, "--report": report},
        {"the readings": readings, "--calibration": calibration, "--limits": None if limits is None else Path(limits)},
    )
    if planned:
        if stand != "same" or report is not None:
            raise refused(
                "input-not-with", {"name": "--report" if report is not None else "--stand", "other": "--planned"}
            )
        return _verify_planned(readings, calibration, limits, output_, 1 if count is None else count, json)
    if count is not None:
        raise refused("input-needs", {"name": "--count", "needed": ("--planned",)})
    with output.reading(readings) as progress:
        data = readings_at(readings, progress=progress, dials=dials.dials())
        tool, bounds = read_calibration(calibration), None if limits is None else read_limits(limits)
        where = _other_stand(stand, north, north_sd, level_sd, rig_sd, gravity_sd)
        found = verify_readings(data, tool, bounds, stand=where, second=azimuth_from)
    with output.reported(report, "verification:verification_report", found):
        if output_ is not None:
            if tuple(found.names) != ANGLES:
                raise refused("option-angles", {"name": "--output"})
            from inclinometry.files.verification_json import write_verification

            write_verification(output_, found, bounds, tool)
    # why a pass is reserved is said, be it a note
    why = found.reservations if found.accepted else ()
    output.findings([*why, *(one for one in found.findings if one not in why)], notes=bool(why))
    if json:
        output.print_json(_verification(found))
    else:
        show_verification(found)
    return 0 if found.accepted else 1


def _verification(found: Verification) -> dict[str, Any]:
    columns = {"error_deg": np.degrees(found.errors), "u_deg": np.degrees(found.u)}
    if found.limits_name:
        columns["limit_deg"] = np.degrees(found.limits)
    columns["decision"] = np.array(found.decision)
    angles = {name: place for place, name in enumerate(found.names) if name != "-"}
    return {
        "verdict": found.verdict,
        "reservations": [one.plain() for one in found.reservations],
        "findings": found.findings,
        "limits": _agreed(found),
        "coverage_factor": found.coverage_factor,
        "stations": [
            {"station": name, **{n: {key: v[row, i] for key, v in columns.items()} for n, i in angles.items()}}
            for row, name in enumerate(found.station)
        ],
    }


def _agreed(found: Verification) -> dict[str, str] | None:
    """Name and source of the limits; None where none were agreed."""
    return {"name": found.limits_name, "source": found.limits_source} if found.limits_name else None


def _other_stand(
    stand: str, north: float | None, north_sd: float, level_sd: float, rig_sd: float | None, gravity_sd: float | None
) -> OtherStand | None:
    """What the options say of another stand; an option that says nothing there is refused."""
    from inclinometry.calibration.conformity import OtherStand

    useless = {"--north-deg": north is not None, "--north-sd-deg": north_sd != 0.0, "--level-sd-deg": level_sd != 0.0}
    if stand == "same":
        useless |= {"--rig-sd-deg": rig_sd is not None, "--gravity-sd-percent": gravity_sd is not None}
    name = next((option for option, there in useless.items() if there and stand != "level"), None)
    if name is not None:
        raise refused("input-not-with", {"name": name, "other": f"--stand {stand}"})
    if north_sd and north is None:
        raise refused("input-needs", {"name": "--north-sd-deg", "needed": ("--north-deg",)})
    if stand == "same":
        return None
    return OtherStand(level_sd if stand == "level" else None, north, north_sd, rig_sd, gravity_sd)


def _verify_planned(
    plan: Path, calibration: Path, limits: str | None, target: Path | None, count: int, json: bool
) -> int:
    """What a verification at these positions will be worth."""
    from inclinometry.calibration.conformity import planned
    from inclinometry.files.bench_csv import read_plan
    from inclinometry.files.limits import read_limits
    from inclinometry.files.verification_json import power_summary, write_planned

    bounds = None if limits is None else read_limits(limits)
    tool = read_calibration(calibration)
    found = planned(read_plan(plan), tool, bounds, count=count)
    output.findings(without_notes(found.findings))
    if found.power is None:
        raise FileError(Finding("work-no-uncertainty"), path=calibration)
    if target is not None:
        if tuple(found.names) != ANGLES:
            raise refused("option-angles", {"name": "--output"})
        write_planned(target, found, bounds, tool)
    if json:
        output.print_json(
            {
                "positions": len(found.station),
                "limits": _agreed(found),
                "coverage_factor": found.coverage_factor,
                **power_summary(found),
                "findings": found.findings,
            }
        )
        return 0
    rows = []
    for column, name in enumerate(found.names):
        judged = found.judged[:, column]
        if judged.any():
            medians = [np.degrees(np.median(x[judged, column])) for x in (found.u, found.limits)]
            rows.append([name, str(int(judged.sum())), *(f"{x:.3f}" for x in medians[: 2 if bounds else 1])])
    against = f" against {found.limits_name}" if bounds else ", no limits agreed"
    output.table(
        output.counted(len(found.station), "position") + against,
        ["angle", "judged at", "u deg, median", "limit deg, median"][: 4 if bounds else 3],
        rows,
        found.limits_source,
    )
    for one in only_notes(found.findings):
        output.print_line(str(one))
    if target is not None:
        output.print_outputs(target)
    return 0


def show_verification(found: Verification) -> None:
    """Verdict and the largest error of each angle on the terminal."""
    from inclinometry.calibration.decision import AGREES

    rows, said, agreed = [], [], bool(found.limits_name)
    for column, name in enumerate(found.names):
        if name == "-":
            continue
        judged = np.flatnonzero(found.judged[:, column]).tolist()
        if not judged:
            rows.append([name, *["-"] * (3 if agreed else 2), "not judged"])
            continue
        scale = (found.limits if agreed else found.u)[judged, column]
        worst = judged[int(np.argmax(np.abs(found.errors[judged, column]) / scale))]
        e, u, b = (np.degrees(x[worst, column]) for x in (found.errors, found.u, found.limits))
        expanded = found.coverage_factor * u
        bad = sum(found.decision[row][column] not in ("pass", AGREES) for row in judged)
        if agreed:
            verdict = "pass" if bad == 0 else f"{bad} of {len(judged)} not accepted"
            rows.append([name, f"{e:+.3f}", f"{u:.3f}", f"{b:.3f}", verdict])
            said.append(f"{name} {verdict}, worst {e:+.3f} deg of {b:.3f} allowed")
        else:
            verdict = AGREES if bad == 0 else f"{bad} of {len(judged)} do not agree"
            rows.append([name, f"{e:+.3f}", f"{expanded:.3f}", verdict])
            said.append(f"{name} {verdict}, worst {e:+.3f} deg with U {expanded:.3f}")
    judgement = found.judgement.upper()
    output.table(
        f"{judgement} against {found.limits_name}" if agreed else f"Agreement with the certificate: {judgement}",
        ["angle", "worst error deg", "u deg", "limit deg", "verdict"]
        if agreed
        else ["angle", "worst error deg", f"U deg, k = {found.coverage_factor:g}", "agreement"],
        rows,
        found.limits_source,
    )
    output.print_line(f"{found.judgement}: {'; '.join(said)}")
