"""Commands on six-axis stations: quality, msa."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from inclinometry.cli import options, output
from inclinometry.cli.quality import show_checks, tell
from inclinometry.errors import refused, wrong_kind
from inclinometry.files.corrections_json import write_corrections
from inclinometry.files.limits import read_quality_limits
from inclinometry.survey.multistation_priors import KnownAzimuth
from inclinometry.survey.quality import QUANTITIES, FieldQuality
from inclinometry.workflow import six_axis
from inclinometry.workflow.gyro_quality import check_json
from inclinometry.workflow.six_axis import Analysis, SixAxis, read_six_axis


def quality(
    raw: Path,
    /,
    *,
    site: options.FieldSite,
    limits: Annotated[
        str | None,
        Parameter(
            group=options.INPUT,
            help=f"A TOML file, or a preset: {options.shipped('files/quality_limits')}. Without it, 3 standard "
            "uncertainties of tool and site at each attitude.",
        ),
    ] = None,
    calibration: options.ModelOrTool = None,
    from_: options.SixAxisForm = None,
    convention: options.Convention = None,
    ignore: options.Ignore = (),
    json: options.Json = False,
) -> int:
    """Judge gravity, magnetic field and dip of each station against the site; exit status 0 pass, 1 fail, 2 bad input.

    Parameters
    ----------
    raw
        Raw channels of a calibrated tool, six axes in m/s2 and nT, or a survey with totals and dip; any format.
    """
    fixed = None if limits is None else read_quality_limits(limits)
    with output.reading(raw) as progress:
        run = read_six_axis(
            raw, site, calibration, form=from_, convention=convention, ignored=ignore, progress=progress
        )
    judged = six_axis.quality(run.stations, run.site, fixed)
    tell(judged.checks, (*run.findings, *judged.quality.findings))
    if json:
        output.print_json(
            {
                "verdict": judged.verdict,
                "limits": None if fixed is None else {"name": fixed.name, "source": fixed.source},
                "checks": list(map(check_json, judged.checks)),
                "stations": [station_json(judged.quality, row) for row in range(len(run.stations))],
                "findings": [one.plain() for one in (*run.findings, *judged.quality.findings)],
            }
        )
    else:
        show_checks(f"{judged.verdict.upper()}: {raw.name}", judged.checks)
        show_failures(judged.quality)
        failed = [check.name for check in judged.checks if check.verdict == "fail"]
        left = [check.name for check in judged.checks if check.verdict not in ("pass", "fail")]
        said = [f"{what}: {', '.join(names)}" for what, names in (("failed", failed), ("not judged", left)) if names]
        output.print_line("; ".join([judged.verdict, *(said or ["every check passed"])]))
    return 0 if judged.verdict == "pass" else 1


def station_json(found: FieldQuality, row: int) -> dict[str, object]:
    """One station as plain data: m/s2, nT, degrees."""
    content: dict[str, object] = {"station": row + 1, "md_m": found.md[row], "verdict": found.verdicts[row]}
    for column, (name, unit) in enumerate((("g", "m_s2"), ("b", "nT"), ("dip", "deg"))):
        factor = QUANTITIES[column].factor
        judged = bool(found.judged[row, column])
        content |= {
            f"{name}_{unit}": factor * found.found[row, column],
            f"{name}_difference_{unit}": factor * found.difference[row, column],
            f"{name}_limit_{unit}": factor * found.limit[row, column] if judged else None,
        }
    return content | {
        "distance_sigma": found.distance[row],
        "distance_limit_sigma": found.distance_limit[row],
        "undetected_azimuth_deg": np.degrees(found.undetected_azimuth[row]),
        "off": found.off(row),
    }


def show_failures(found: FieldQuality, most: int = 12) -> None:
    """The stations that do not pass, with their differences from the reference."""
    failed = [row for row, verdict in enumerate(found.verdicts) if verdict == "fail"]
    if not failed:
        return
    rows = []
    for row in failed[:most]:
        cells = [f"{found.md[row]:.2f}"]
        for column, quantity in enumerate(QUANTITIES):
            f, places = quantity.factor, quantity.digits
            limit = f"{f * found.limit[row, column]:.{places}f}" if found.judged[row, column] else "-"
            cells.append(f"{f * found.difference[row, column]:+.{places}f} ({limit})")
        rows.append([*cells, f"{found.distance[row]:.2f} ({found.distance_limit[row]:.2f})"])
    title = f"{output.counted(len(failed), 'station')} beyond a limit"
    title += f", the first {most}" if len(failed) > most else ""
    header = ["md m", *(f"{quantity.name} {quantity.shown}" for quantity in QUANTITIES), "together sigma"]
    output.table(f"{title}; difference (allowed)", header, rows)


def msa(
    raw: Path,
    /,
    *,
    site: options.FieldSite,
    output_: options.Output,
    calibration: options.InputOrNone = None,
    priors: Literal["iscwsa", "unknown"] | None = None,
    axial_sigma: Annotated[float | None, options.quantity("nt")] = None,
    known_azimuth: Annotated[tuple[str, ...], Parameter(negative="", show_default=False)] = (),
    from_: options.SixAxisForm = None,
    convention: options.Convention = None,
    ignore: options.Ignore = (),
    report: options.Report = None,
    json: options.Json = False,
) -> None:
    """Multi-station analysis: the errors that the sensors of one run have in common, with uncertainty.

    Parameters
    ----------
    raw
        Raw channels of a calibrated tool, or six axes in m/s2 and nT, any format: one run of 4 stations or more.
    output_
        corrections.json, for survey --correct corrections.json.
    calibration
        tool.json: its covariance is the prior.
    priors
        Prior without --calibration: iscwsa (the default: errors of the ISCWSA model) or unknown.
    axial_sigma
        Standard deviation of the axial magnetic interference, nT. Default: 2000.
    known_azimuth
        MD=DEG+-SIGMA: azimuth of a station from a gyro or an earlier survey, from the site's north. Repeatable.
    """

    output.check_outputs(
        {"--output": output_, "--report": report},
        {"the raw channels": raw, "--calibration": calibration, "--site": site},
    )
    if priors is not None and calibration is not None:
        raise refused("input-not-with", {"name": "--priors", "other": "--calibration"})
    known = [_known_azimuth(text) for text in known_azimuth]
    with output.reading(raw) as progress:
        run = read_six_axis(
            raw, site, calibration, form=from_, convention=convention, ignored=ignore, progress=progress
        )
    with output.reading(raw), output.busy(f"analysing {output.counted(len(run.stations), 'station')}"):
        done = six_axis.msa(run, priors or "iscwsa", axial_sigma, known)
    beside = {"tool": done.correction.tool, "findings": run.findings, "inputs": run.inputs}
    with output.reported(report, "msa:msa_report", done.found, run.stations, done.judged.quality, **beside):
        write_corrections(done.correction, output_)
    output.findings((*run.findings, *done.findings))
    if json:
        output.print_json(_summary(run, done, output_))
        return
    output.print_line(str(done.found.corrected.history[-1]))
    show_parameters(done)


def _known_azimuth(text: str) -> KnownAzimuth:
    """MD=DEG+-SIGMA."""
    parts = re.fullmatch(r"(.+)=(.+?)(?:\+-|±)(.+)", text)
    try:
        md, azimuth, sigma = map(float, parts.groups() if parts else ())
    except ValueError:
        raise wrong_kind("--known-azimuth", text, "MD=DEG+-SIGMA") from None
    return KnownAzimuth(md, np.radians(azimuth), np.radians(sigma))


def _summary(run: SixAxis, done: Analysis, path: Path) -> dict[str, object]:
    found = done.found
    return {
        "stations": len(run.stations),
        "parameters": {name: p._asdict() | {"significance": p.significance} for name, p in found.parameters.items()},
        "chi_square": found.chi_square,
        "degrees_of_freedom": found.freedom,
        "priors": found.priors,
        "influence_deg": np.degrees(found.influence),
        "findings": [one.plain() for one in (*run.findings, *done.findings)],
        "output": path,
    }


def show_parameters(done: Analysis) -> None:
    """Every estimate with its uncertainty before and after, on the terminal."""
    rows = [
        [name, f"{p.value:+.4g}", f"{p.u:.2g}", f"{p.prior:.2g}", p.unit, f"{p.significance:.1f}"]
        for name, p in done.found.parameters.items()
        if p.prior > 0.0
    ]
    header = ["parameter", "estimate", "u", "u before", "unit", "estimate / u"]
    output.table("errors of the sensors and the reference, SI and rad", header, rows, f"priors: {done.found.priors}")
