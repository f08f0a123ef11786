"""Commands on a place surveyed more than once: rotation, repeat, dual-depth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from inclinometry.cli import output
from inclinometry.cli.options import Convention, Flag, Json
from inclinometry.cli.quality import show_checks
from inclinometry.cli.six_axis import SixAxisForm
from inclinometry.survey.flags import Check, worst
from inclinometry.workflow.gyro_quality import check_json
from inclinometry.workflow.shots import APART_M, depth_check, read_shots, repeat_checks, rotation_checks
from inclinometry.workflow.six_axis import read_six_axis


def rotation(
    raw: Path,
    /,
    *,
    site: Path,
    calibration: Path | None = None,
    from_: SixAxisForm = None,
    convention: Convention = None,
    json: Json = False,
) -> int:
    """Judge shots at one depth and several toolfaces; exit status 0 pass, 1 fail, 2 bad input.

    Parameters
    ----------
    raw
        Four or more shots with toolfaces all round, as for `quality`; in CSV the depth may repeat.
    site
        site.toml, as for `quality`.
    calibration
        tool.json; without it the sensors' errors are those of the ISCWSA MWD model.
    from_
        Format of the file; by its ending when not given.
    convention
        Axes and signs of the sensors in the file, without a calibration; native when not given.
    json
        Print JSON.
    """
    run = read_shots(raw, site, calibration, form=from_, convention=convention)
    output.warnings(run.warnings)
    return _answer(raw.name, rotation_checks(run), run.notes, json)


def repeat(
    first: Path,
    second: Path,
    /,
    *,
    site: Path,
    calibration: Path | None = None,
    second_calibration: Path | None = None,
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
    site
        site.toml, as for `quality`.
    calibration
        tool.json of both surveys; without it the sensors' errors are those of the ISCWSA MWD model.
    second_calibration
        tool.json of the second survey, where it is another.
    other_tool
        The second survey was made with another tool, where no calibration says so.
    apart_m
        How far the depths of a pair may differ, m.
    from_
        Format of the files; by their endings when not given.
    convention
        Axes and signs of the sensors in the files, without a calibration; native when not given.
    json
        Print JSON.
    """
    one, two = (
        read_six_axis(path, site, tool, form=from_, convention=convention)
        for path, tool in ((first, calibration), (second, second_calibration or calibration))
    )
    checks = repeat_checks(one, two, other_tool=other_tool, apart_m=apart_m)
    output.warnings(list(dict.fromkeys((*one.warnings, *two.warnings))))
    return _answer(f"{first.name} and {second.name}", checks, list(dict.fromkeys((*one.notes, *two.notes))), json)


def dual_depth(first: Path, second: Path, /, *, sigma_first_m: float, sigma_second_m: float, json: Json = False) -> int:
    """Judge two measurements of depth against each other; exit status 0 pass, 1 fail, 2 bad input.

    Parameters
    ----------
    first
        CSV with a depth (md_m, MD (ft)), e.g. of the drill pipe.
    second
        CSV with the depths of the same points in the same order, e.g. of the wireline.
    sigma_first_m
        Standard deviation of the first depths, m, corrections made.
    sigma_second_m
        Standard deviation of the second depths, m, corrections made.
    json
        Print JSON.
    """
    check = depth_check(first, second, sigma_first_m, sigma_second_m)
    return _answer(f"{first.name} and {second.name}", [check], (), json)


def _answer(what: str, checks: Sequence[Check], notes: Sequence[str], json: bool) -> int:
    """Print the verdict and give the exit status."""
    verdict = worst(checks)
    if json:
        output.print_json({"verdict": verdict, "checks": list(map(check_json, checks)), "notes": notes})
    else:
        show_checks(f"{verdict.upper()}: {what}", checks)
        for sentence in notes:
            output.say(sentence)
    return 0 if verdict == "pass" else 1
