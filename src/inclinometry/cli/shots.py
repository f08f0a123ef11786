"""Commands on a place surveyed more than once: rotation, repeat, dual-depth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from inclinometry.cli import output
from inclinometry.cli.options import Convention, FieldSite, Flag, InputOrNone, Json, ModelOrTool, SixAxisForm
from inclinometry.cli.quality import show_checks, tell
from inclinometry.findings import Finding
from inclinometry.survey.flags import Check, worst
from inclinometry.workflow.gyro_quality import check_json
from inclinometry.workflow.shots import APART_M, depth_check, read_shots, repeat_checks, rotation_checks
from inclinometry.workflow.six_axis import read_six_axis


def rotation(
    raw: Path,
    /,
    *,
    site: FieldSite,
    calibration: ModelOrTool = None,
    from_: SixAxisForm = None,
    convention: Convention = None,
    json: Json = False,
) -> int:
    """Judge shots at one depth and several toolfaces; exit status 0 pass, 1 fail, 2 bad input.

    Parameters
    ----------
    raw
        Four or more shots at toolfaces around the turn, as for `quality`; depths may repeat.
    """
    run = read_shots(raw, site, calibration, form=from_, convention=convention)
    return _answer(raw.name, rotation_checks(run), run.findings, json)


def repeat(
    first: Path,
    second: Path,
    /,
    *,
    site: FieldSite,
    calibration: InputOrNone = None,
    second_calibration: InputOrNone = None,
    other_tool: Flag = False,
    apart_m: float = APART_M,
    from_: SixAxisForm = None,
    convention: Convention = None,
    json: Json = False,
) -> int:
    """Judge stations surveyed twice; exit status 0 pass, 1 fail, 2 bad input.

    Parameters
    ----------
    first
        A survey, as for `quality`.
    second
        The same stations again.
    calibration
        tool.json of both surveys. Without it, sensor errors of the ISCWSA MWD model are used.
    second_calibration
        tool.json of the second survey, if different.
    other_tool
        The second survey was made with another tool (if no calibration states it).
    apart_m
        Largest difference of depth in a pair, m.
    """
    one, two = (
        read_six_axis(path, site, tool, form=from_, convention=convention, ignored=None)
        for path, tool in ((first, calibration), (second, second_calibration or calibration))
    )
    checks = repeat_checks(one, two, other_tool=other_tool, apart_m=apart_m)
    told = [*one.findings, *(found for found in two.findings if found not in one.findings)]
    return _answer(f"{first.name} and {second.name}", checks, told, json)


def dual_depth(first: Path, second: Path, /, *, sigma_first_m: float, sigma_second_m: float, json: Json = False) -> int:
    """Judge two measurements of depth against each other; exit status 0 pass, 1 fail, 2 bad input.

    Parameters
    ----------
    first
        Table with depths (md_m, MD (ft)), e.g. of the drill pipe.
    second
        Table with depths of the same points in the same order, e.g. of the wireline.
    sigma_first_m
        Standard deviation of the first depths after corrections, m.
    sigma_second_m
        Standard deviation of the second depths after corrections, m.
    """
    check = depth_check(first, second, sigma_first_m, sigma_second_m)
    return _answer(f"{first.name} and {second.name}", [check], (), json)


def _answer(what: str, checks: Sequence[Check], findings: Sequence[Finding], json: bool) -> int:
    """Print the verdict and give the exit status."""
    verdict = worst(checks)
    tell(checks, findings)
    if json:
        output.print_json({"verdict": verdict, "checks": list(map(check_json, checks)), "findings": findings})
    else:
        show_checks(f"{verdict.upper()}: {what}", checks)
    return 0 if verdict == "pass" else 1
