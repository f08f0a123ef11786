"""Command that judges the quality of a gyro survey."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from inclinometry.cli import options, output
from inclinometry.cli.options import InputOrNone, Json
from inclinometry.files.limits import GYRO_REPEAT
from inclinometry.files.site_toml import read_site
from inclinometry.findings import Finding
from inclinometry.survey.flags import Check, worst
from inclinometry.survey.gyro import Comparison
from inclinometry.workflow.gyro_quality import check_json, compare_run_files, comparison_json, run_checks


def quality(
    in_run: Path,
    out_run: Path | None = None,
    /,
    *,
    site: InputOrNone = None,
    limits: Annotated[
        str,
        Parameter(
            group=options.INPUT,
            help=f"A TOML file of limits, or the name of shipped ones: {options.shipped('files/repeat_limits')}.",
        ),
    ] = GYRO_REPEAT,
    json: Json = False,
) -> int:
    """Judge a gyro survey: in-run against out-run, and the flags of a run; exit status 0 pass, 1 fail, 2 bad input.

    Parameters
    ----------
    in_run
        Survey CSV of the in-run.
    out_run
        Survey CSV of the out-run. Without it only the flags of the in-run are checked.
    site
        site.toml with declination and convergence; required if the runs have different norths.
    """
    place = None if site is None else read_site(site)
    checks, told = _runs(in_run, out_run)
    found = None if out_run is None else compare_run_files(in_run, out_run, place, limits)
    if found is not None:
        checks, told = [*found.checks, *checks], [*found.findings, *told]
    verdict = worst(checks)
    if found is not None and verdict == "pass":
        verdict = found.verdict
    tell(checks, told)
    if json:
        compared = None if found is None else comparison_json(found)
        output.print_json({"verdict": verdict, "checks": list(map(check_json, checks)), "comparison": compared})
    else:
        show_checks(f"{verdict.upper()}: {in_run.name}" + (f" and {out_run.name}" if out_run else ""), checks)
        if found is not None:
            show_comparison(found)
    return 0 if verdict == "pass" else 1


def _runs(in_run: Path, out_run: Path | None) -> tuple[list[Check], list[Finding]]:
    """Checks of and findings on each run by itself; a check names its run where there are two."""
    from dataclasses import replace

    if out_run is None:
        return run_checks(in_run)
    checks, told = [], []
    for name, path in (("in-run", in_run), ("out-run", out_run)):
        own, found = run_checks(path)
        checks += [replace(check, name=f"{name}: {check.name}") for check in own]
        told += found
    return checks, told


def tell(checks: Sequence[Check], found: Sequence[Finding]) -> None:
    """Why checks did not pass, and findings; what another check makes up for is a note."""
    asks, left = worst(checks), [check for check in checks if check.verdict != "pass"]
    told = [c.reason if c.verdict == asks else c.reason._replace(severity="note") for c in left]
    output.findings([*told, *found], [c.name for c in left])


def show_checks(title: str, checks: Sequence[Check]) -> None:
    """Every check with its verdict."""
    rows = []
    for shown in map(check_json, checks):
        # what was not judged has no figures
        figures = [f"{shown[key]:.4g}".replace("nan", "-") for key in ("value", "limit")]
        rows.append([str(shown["name"]), *figures, str(shown["unit"]), str(shown["verdict"])])
    output.table(title, ["check", "value", "limit", "unit", "verdict"], rows)


def show_comparison(found: Comparison) -> None:
    """Mean difference, standard deviation and rms of the two runs on the terminal."""
    rows = []
    for name, part in found.statistics.items():
        figures = np.degrees([part.mean, part.sd, part.rms, part.largest])
        rows.append([name, str(part.stations), *(f"{figure:.4f}" for figure in figures)])
    header = ["out-run minus in-run, deg", "stations", "mean", "sd", "rms", "largest"]
    output.table("differences", header, rows, found.limits.source)
