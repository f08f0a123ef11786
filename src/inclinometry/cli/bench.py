"""Commands of the bench: calibrate, compare, verify."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, TypeAlias

import numpy as np
from cyclopts import Parameter

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
from inclinometry.cli.options import (
    AzimuthFrom,
    Created,
    Flag,
    GravitySd,
    Input,
    InputOrNone,
    Json,
    OutputOrNone,
    Report,
    Serial,
)
from inclinometry.constants import ANGLES, UNIT_LABELS
from inclinometry.digest import digest_file
from inclinometry.errors import InputError
from inclinometry.files.tool_json import read_calibration, read_tool, write_calibration
from inclinometry.files.writing import write_text
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
    from inclinometry.calibration.acceptance import OtherStand, Verification
    from inclinometry.calibration.hand_rotations import HandRotations
    from inclinometry.earth.site import Site
    from inclinometry.sensors import Tool


def _site(path: Path | None) -> Site | None:
    """The place, where one is given; its reader is loaded then alone."""
    if path is None:
        return None
    from inclinometry.files.site_toml import read_site

    return read_site(path)


def _nameplate(path: Path | None) -> Tool | None:
    """The nameplate values, where they are given; their reader is loaded then alone."""
    if path is None:
        return None
    from inclinometry.files.datasheet_toml import read_nameplate

    return read_nameplate(path)


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
    from inclinometry.workflow.compare_two import compare_two, content

    with output.busy("calibrating both"):
        found = compare_two(
            paths,
            [name.strip() for name in methods.split(",")],
            options=options,
            dials=dials,
            site=_site(site),
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
        cells = [_figures(values[:, column]) for values in curves.values()]
        degrees = [f"{i:g}" for i in np.degrees(found.inclination).round(6)]
        rows = [list(row) for row in zip(degrees, *cells, strict=True)]
        output.table(f"{name}, deg: u {FROM_CALIBRATION}, worst attitude", ["inclination deg", *curves], rows)
    if report is not None:
        output.say(f"report written to {report}")


@Parameter(name="*", group=options.STAND)
@dataclass(frozen=True)
class StandOptions:
    """What is known of a stand, in degrees."""

    rig_sd_deg: float | None = None
    """Random error of a setting of the rig; estimated from the readings when not given."""
    azimuth_sd_deg: float | None = None
    """The same for the azimuth dial alone."""
    inclination_sd_deg: float | None = None
    """The same for the inclination dial alone."""
    toolface_sd_deg: float | None = None
    """The same for the toolface dial alone."""
    level_sd_deg: float | None = None
    """How level the stand is known to be; the joint fit alone uses it."""
    north_deg: float | None = None
    """Azimuth of the rig's zero from magnetic north; decides the sign of the magnetic field."""
    north_sd_deg: float | None = None
    """How well that is known; with it north enters the joint fit, which alone uses it."""
    dip_deg: float | None = None
    """Magnetic dip at the stand, instead of the one in the readings or in --site."""
    dip_sd_deg: float | None = None
    """How well the dip is known; with it the dip enters the joint fit, which alone uses it."""

    def known(self) -> dict[str, Any]:
        """The same in rad, each value within its own limits."""
        limits = {"north_deg": (-360.0, 360.0), "north_sd_deg": (0.0, 90.0), "dip_deg": (-90.0, 90.0)}
        return {
            name.removesuffix("_deg"): options.angle_or_none(
                value, f"--{name.replace('_', '-')}", *limits.get(name, (0.0, options.LARGEST_SD))
            )
            for name, value in vars(self).items()
        }


UNKNOWN: Final = StandOptions()

DialFrom: TypeAlias = Annotated[
    InclinationFrom,
    Parameter(
        group=options.DIALS,
        help="Where the inclination dial counts from: vertical (0 with the tool's end down), other-end (180 there), "
        "horizontal (90 there, positive below the horizon) or horizontal-up (-90 there).",
    ),
]
AzimuthCounts: TypeAlias = Annotated[
    Counts, Parameter(group=options.DIALS, help="Which way the azimuth dial counts, seen from above.")
]
ToolfaceCounts: TypeAlias = Annotated[
    Counts, Parameter(group=options.DIALS, help="Which way the toolface dial counts, looking down hole.")
]
LeftHanded: TypeAlias = Annotated[
    Flag,
    Parameter(
        group=options.DIALS,
        help="The tool's channels are left-handed (one is reversed, or two are exchanged), not the dials.",
    ),
]
Nameplate: TypeAlias = Annotated[
    Path | None,
    Parameter(
        group=options.INPUT,
        help="Data sheet (TOML) or tool.json whose conversion factors the classical method believes; it does not run "
        "without.",
    ),
]


def calibrate(
    readings: Path,
    /,
    *,
    output_: OutputOrNone = None,
    method: MethodName | Literal["hand-rotations"] | None = None,
    report: Report = None,
    site: InputOrNone = None,
    gyro_log: InputOrNone = None,
    gyro_profile: Annotated[str | None, Parameter(group=options.INPUT)] = None,
    nameplate: Nameplate = None,
    tool: Serial = "unnamed",
    stand: StandOptions = UNKNOWN,
    accel_step: float | None = None,
    mag_step: float | None = None,
    gyro_step: float | None = None,
    inclination_zero_sd_deg: float | None = None,
    nonorthogonality_sd_deg: float | None = None,
    temperature_degree: int | None = None,
    robust: Flag = False,
    specific_force: Flag = False,
    inclination_from: DialFrom = "vertical",
    azimuth_counts: AzimuthCounts = "clockwise",
    toolface_counts: ToolfaceCounts = "clockwise",
    left_handed: LeftHanded = False,
    created: Created = None,
    json: Json = False,
) -> None:
    """Calibrate a tool from bench readings.

    Parameters
    ----------
    readings
        CSV with station, azimuth_deg, inclination_deg, toolface_deg and the channels accel_x ... mag_z, gyro_z. For
        hand-rotations a log: time_s, accel_x ... gyro_z.
    output_
        The calibration, tool.json; only looked at when not given.
    method
        When not given joint, or field where there are roll sets without angles. field needs no angles, only roll_set;
        norm no roll set either: each triad in its own axes. hand-rotations takes a log of a tool turned by hand between
        rests: accelerometer and gyro, in the accelerometer's axes.
    site
        site.toml with what is known of the bench: g, b_nT, dip_deg, latitude_deg. Dip and latitude decide the signs.
    gyro_log
        For hand-rotations: the gyro's log, where it is a file of its own with the same times.
    gyro_profile
        The profile --gyro-log is read with; that of --profile when not given.
    accel_step
        Step of the accelerometers' converter, in the unit of their channels; 0 for none. When not given it is found
        where the readings clearly lie on a grid (whole counts, a fixed number of decimals).
    mag_step
        The same for the magnetometers.
    gyro_step
        The same for the gyros.
    inclination_zero_sd_deg
        Fit a constant error of the inclination dial with this prior; not fitted when not given.
    nonorthogonality_sd_deg
        Fit the non-orthogonality of the rig's axes with this prior; not fitted when not given.
    temperature_degree
        Degree of the polynomial in temperature; chosen by information criterion when not given.
    robust
        Leave out stations that disagree with the others.
    specific_force
        For field, norm and hand-rotations: the accelerometer's channels count upwards (at rest they read -g, along the
        axis that points up they are positive). The other methods learn this from the rig.
    """
    output.claim(
        {"--output": output_, "--report": report},
        {"the readings": readings, "--site": site, "--nameplate": nameplate, "--gyro-log": gyro_log},
    )
    if created is not None:
        try:
            datetime.fromisoformat(created)
        except ValueError:
            problem = f"--created is {created!r}; give a date as YYYY-MM-DD or as ISO 8601 with the time"
            raise InputError(problem) from None
    wishes = Options(
        inclination_zero_sd=options.sd(inclination_zero_sd_deg, "--inclination-zero-sd-deg"),
        nonorthogonality_sd=options.sd(nonorthogonality_sd_deg, "--nonorthogonality-sd-deg"),
        temperature_degree=temperature_degree,
        robust=robust,
        specific_force=specific_force,
        left_handed=left_handed,
        nameplate=_nameplate(nameplate),
        name=tool,
        accel_step=_step(accel_step, "--accel-step"),
        mag_step=_step(mag_step, "--mag-step"),
        gyro_step=_step(gyro_step, "--gyro-step"),
        **stand.known(),
    )
    dials = Dials(inclination_from, azimuth_counts, toolface_counts)
    if method != "hand-rotations" and (gyro_log or gyro_profile):
        raise InputError("--gyro-log and --gyro-profile are for --method hand-rotations; leave them out")
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
            data = readings_at(readings, _site(site), progress, dials)
            method = method or usual_method(data)
    page = None
    with output.busy(f"calibrating, method {method}"):
        if method != "hand-rotations":
            found = calibrate_readings(data, method, wishes)
        if report is not None:
            from inclinometry.report.calibration import calibration_report

            page = calibration_report(found, readings=data)
    if output_ is not None:
        write_calibration(found, output_, created=created)
    if page is not None:
        write_text(page, report or "")
    output.notes(found.notes)
    output.warnings(found.warnings)
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
    output.written(output_, report)


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
    output.say(
        f"{output.counted(len(found.rests), 'rest')}, {output.counted(len(found.rotations), 'rotation')}: predicted "
        f"and seen gravity differ by {np.degrees(found.rms):.2g} deg rms; over the log the gyro's bias scattered by "
        f"{', '.join(f'{value:.3g}' for value in found.bias_scatter)} {units['gyro']}"
    )


def _step(value: float | None, option: str) -> float | None:
    """The step of a converter, in the unit of its channels."""
    if value is not None and not 0.0 <= value < np.inf:
        raise InputError(f"{option} is {value:g}; the step of a converter is 0 or more, in the unit of the channels")
    return value


def _summary(found: Calibration, expected: ExpectedUncertainty, data: BenchReadings) -> dict[str, Any]:
    second = second_harmonics(data)
    return {
        "method": found.method,
        "tool": found.tool.name,
        "stations": len(found.residuals.station),
        "rig_sd_deg": np.degrees(found.rig.sd),
        "noise": {in_unit(kind, found.tool.triads[kind].unit): v for kind, v in found.tool.noise.items()},
        "residual_rms": {
            in_unit(kind, found.tool.triads[kind].unit): np.sqrt(np.mean(v**2, axis=0))
            for kind, v in found.residuals.values.items()
        },
        "parameters": asdict_parameters(found),
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
    output.headline(f"method {found.method}, {stations}, {rig}")


def compare(
    readings: Path,
    second: Path | None = None,
    /,
    *,
    methods: Annotated[
        str | None,
        Parameter(
            help=f"Of two files: one method for both, or two with a comma, as orthogonal,rotations. Out of "
            f"{', '.join(METHODS)}; joint when not given."
        ),
    ] = None,
    report: Annotated[
        Report, Parameter(help="Write an HTML report, of two files; --language ru or zh: in Russian or Chinese.")
    ] = None,
    truth: InputOrNone = None,
    site: InputOrNone = None,
    nameplate: Nameplate = None,
    stand: StandOptions = UNKNOWN,
    inclination_from: DialFrom = "vertical",
    azimuth_counts: AzimuthCounts = "clockwise",
    toolface_counts: ToolfaceCounts = "clockwise",
    left_handed: LeftHanded = False,
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
    truth
        truth.json of a simulation: adds the actual errors.
    site
        site.toml with the fields at the bench.
    """
    wishes = Options(left_handed=left_handed, **stand.known())
    dials = Dials(inclination_from, azimuth_counts, toolface_counts)
    if second is not None:
        show_two((readings, second), methods or "joint", wishes, dials, site, truth, report, json)
        return
    with output.reading(readings) as progress:
        data = readings_at(readings, _site(site), progress, dials)
    if methods is not None or report is not None:
        option = "--methods" if methods is not None else "--report"
        raise InputError(f"{option} is for two files of one tool; give a second file, or leave it out")
    known = None if truth is None else read_tool(truth)
    sheet = _nameplate(nameplate)
    with output.busy("running every method"):
        found = compare_methods(data, truth=known, options=replace(wishes, nameplate=sheet))
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
                "warnings": [] if a.calibration is None else list(a.calibration.warnings),
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
            output.say(f"{attempt.method} is not applicable: {attempt.reason}")
    for attempt in found.attempts:
        if attempt.calibration is not None and attempt.method == "joint":
            output.warnings(attempt.calibration.warnings)


def verify(
    readings: Path,
    /,
    *,
    calibration: Input,
    limits: Annotated[
        str | None,
        Parameter(
            group=options.INPUT,
            help=f"A TOML file, or a preset: {options.shipped('files/limits')}. When not given, each error is held "
            "against its own uncertainty.",
        ),
    ] = None,
    stand: Annotated[Literal["same", "level", "fit"], Parameter(group=options.STAND)] = "same",
    north_deg: Annotated[float | None, Parameter(group=options.STAND)] = None,
    north_sd_deg: Annotated[float, Parameter(group=options.STAND)] = 0.0,
    level_sd_deg: Annotated[float, Parameter(group=options.STAND)] = 0.0,
    rig_sd_deg: Annotated[float | None, Parameter(group=options.STAND)] = None,
    azimuth_from: AzimuthFrom = None,
    gravity_sd_percent: Annotated[
        GravitySd,
        Parameter(
            help="Of two accelerometers on another stand: standard uncertainty of |g| there against that at the "
            "calibration, 0 at the same place. When not given, that of what both state, 0.3 where one states nothing."
        ),
    ] = None,
    output_: OutputOrNone = None,
    report: Report = None,
    inclination_from: DialFrom = "vertical",
    azimuth_counts: AzimuthCounts = "clockwise",
    toolface_counts: ToolfaceCounts = "clockwise",
    planned: Flag = False,
    count: int | None = None,
    json: Json = False,
) -> int:
    """Verify a calibrated tool at independent positions; exit status 0 pass, 1 fail, 2 bad input.

    Parameters
    ----------
    readings
        Bench readings CSV of positions that were not used to calibrate.
    calibration
        tool.json
    stand
        same: the stand of the calibration, not moved since. level: another one, its azimuth axis vertical. fit: another
        one; its tilt and north are found from these readings, and what they cannot tell from the tool is not judged.
    north_deg
        Of a level stand: azimuth of the rig's zero from magnetic north (from true north for a gyro). When not given, it
        is found from the readings and a constant error of azimuth is not judged.
    north_sd_deg
        How well the north of a level stand is known.
    level_sd_deg
        How well the vertical of a level stand is known.
    rig_sd_deg
        Random error of a setting of another stand; that of the calibration's rig when not given.
    output_
        Write verify.json, for a certificate; with --planned the protocol that is planned, JSON.
    planned
        Before any reading is taken: the file is a plan (`inclinometry plan spread`), and what its positions will find
        is said, with the risks of both sides.
    count
        Of --planned: readings that will be averaged at each position; 1 when not given.
    """
    from inclinometry.calibration.acceptance import verify as verify_readings
    from inclinometry.files.bench_csv import read_bench
    from inclinometry.files.limits import read_limits

    output.claim(
        {"--output": output_, "--report": report},
        {"the readings": readings, "--calibration": calibration, "--limits": None if limits is None else Path(limits)},
    )
    if planned:
        if stand != "same" or report is not None:
            raise InputError(
                "--planned is before any reading, on the stand of the calibration: leave out --report and --stand; "
                "-o writes what is planned"
            )
        return _verify_planned(readings, calibration, limits, output_, 1 if count is None else count, json)
    if count is not None:
        raise InputError("--count is of --planned: readings say themselves of how many they are the mean")
    with output.reading(readings) as progress:
        data = Dials(inclination_from, azimuth_counts, toolface_counts).read(read_bench(readings, progress=progress))
    tool, bounds = read_calibration(calibration), None if limits is None else read_limits(limits)
    where = _other_stand(stand, north_deg, north_sd_deg, level_sd_deg, rig_sd_deg, gravity_sd_percent)
    found = verify_readings(data, tool, bounds, stand=where, second=azimuth_from)
    if output_ is not None:
        if tuple(found.names) != ANGLES:
            raise InputError(
                "--output writes what a certificate states, errors of inclination, azimuth and toolface; this tool has "
                "none of them: use --report or --json"
            )
        from inclinometry.files.verification_json import write_verification

        write_verification(output_, found, bounds, tool)
    if report is not None:
        from inclinometry.report.verification import verification_report

        write_text(verification_report(found), report)
    output.warnings(found.warnings)
    if json:
        output.print_json(
            {
                "verdict": found.verdict,
                "reservations": found.reservations,
                "reasons": found.reasons,
                "notes": found.notes,
                "limits": {"name": found.limits_name, "source": found.limits_source},
                "coverage_factor": found.coverage_factor,
                "stations": [
                    {
                        "station": s,
                        **{
                            n: {"error_deg": e[i], "u_deg": w[i], "limit_deg": b[i], "decision": d[i]}
                            for i, n in enumerate(found.names)
                            if n != "-"
                        },
                    }
                    for s, e, w, b, d in zip(
                        found.station,
                        np.degrees(found.errors),
                        np.degrees(found.u),
                        np.degrees(found.limits),
                        found.decision,
                        strict=True,
                    )
                ],
            }
        )
    else:
        show_verification(found)
    return 0 if found.verdict == "pass" else 1


def _other_stand(
    stand: str,
    north_deg: float | None,
    north_sd_deg: float,
    level_sd_deg: float,
    rig_sd_deg: float | None,
    gravity_sd_percent: float | None,
) -> OtherStand | None:
    """What the options say of another stand; an option that says nothing there is refused."""
    from inclinometry.calibration.acceptance import OtherStand

    given = {"--north-deg": north_deg is not None, "--north-sd-deg": north_sd_deg != 0.0}
    useless = given | {
        "--level-sd-deg": level_sd_deg != 0.0,
        "--rig-sd-deg": stand == "same" and rig_sd_deg is not None,
        "--gravity-sd-percent": stand == "same" and gravity_sd_percent is not None,
    }
    if stand != "level" and any(useless.values()):
        name = next(option for option, there in useless.items() if there)
        known = "is known from the calibration" if stand == "same" else "is found from the readings"
        raise InputError(f"{name} says nothing of --stand {stand}, which {known}: leave it out, or use --stand level")
    if stand == "same":
        return None
    if given["--north-sd-deg"] and north_deg is None:
        raise InputError("--north-sd-deg without --north-deg: give the north it is the uncertainty of")
    setting, gravity_sd = options.sd(rig_sd_deg, "--rig-sd-deg"), options.gravity_sd(gravity_sd_percent)
    if stand == "fit":
        return OtherStand(setting_sd=setting, gravity_sd=gravity_sd)
    return OtherStand(
        options.sd(level_sd_deg, "--level-sd-deg"),
        options.angle_or_none(north_deg, "--north-deg"),
        options.sd(north_sd_deg, "--north-sd-deg") or 0.0,
        setting,
        gravity_sd,
    )


def _verify_planned(
    plan: Path, calibration: Path, limits: str | None, target: Path | None, count: int, json: bool
) -> int:
    """What a verification at these positions will be worth."""
    from inclinometry.calibration.acceptance import planned
    from inclinometry.files.bench_csv import read_plan
    from inclinometry.files.limits import read_limits
    from inclinometry.files.verification_json import worth_of, write_planned

    bounds = None if limits is None else read_limits(limits)
    tool = read_calibration(calibration)
    found = planned(read_plan(plan), tool, bounds, count=count)
    output.warnings(found.warnings)
    if found.power is None:
        raise InputError(f"{calibration} states no uncertainty of the tool: what a verification finds cannot be said")
    if target is not None:
        if tuple(found.names) != ANGLES:
            raise InputError(
                "-o writes limits of inclination, azimuth and toolface; this tool has none of them: use --json"
            )
        write_planned(target, found, bounds, tool)
    if json:
        output.print_json(
            {
                "positions": len(found.station),
                "limits": {"name": found.limits_name, "source": found.limits_source},
                "coverage_factor": found.coverage_factor,
                **worth_of(found),
                "warnings": found.warnings,
            }
        )
        return 0
    rows = []
    for column, name in enumerate(found.names):
        judged = np.isfinite(found.limits[:, column])
        if judged.any():
            u, bound = (np.degrees(np.median(x[judged, column])) for x in (found.u, found.limits))
            rows.append([name, str(int(judged.sum())), f"{u:.3f}", f"{bound:.3f}"])
    output.table(
        f"{output.counted(len(found.station), 'position')} against {found.limits_name}",
        ["angle", "judged at", "u deg, median", "limit deg, median"],
        rows,
        found.limits_source,
    )
    for sentence in found.notes:
        output.say(sentence)
    if target is not None:
        output.say(f"written to {target}")
    return 0


def show_verification(found: Verification) -> None:
    """Verdict and the largest error of each angle on the terminal."""
    rows = []
    for column, name in enumerate(found.names):
        if name == "-":
            continue
        judged = [row for row in range(len(found.errors)) if found.decision[row][column] != "not judged"]
        if not judged:
            rows.append([name, "-", "-", "-", "not judged"])
            continue
        shares = np.abs(found.errors[judged, column]) / found.limits[judged, column]
        worst = judged[int(np.argmax(shares))]
        e, u, b = (np.degrees(x[worst, column]) for x in (found.errors, found.u, found.limits))
        bad = sum(found.decision[row][column] != "pass" for row in judged)
        verdict = "pass" if bad == 0 else f"{bad} of {len(judged)} not accepted"
        rows.append([name, f"{e:+.3f}", f"{u:.3f}", f"{b:.3f}", verdict])
    output.table(
        f"{found.judgement.upper()} against {found.limits_name}",
        ["angle", "worst error deg", "u deg", "limit deg", "verdict"],
        rows,
        found.limits_source,
    )
    for sentence in (*found.reasons, *found.notes):
        output.say(sentence)
    said = "; ".join(f"{row[0]} {row[4]}, worst {row[1]} deg of {row[3]} allowed" for row in rows if row[1] != "-")
    output.headline(f"{found.judgement}: {said}")
