"""From the files of an in-run and an out-run to a verdict."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from inclinometry.arrays import Array
from inclinometry.digest import digest_file
from inclinometry.earth.site import Site, convert_azimuth
from inclinometry.errors import FileError, refused
from inclinometry.files.limits import GYRO_REPEAT, read_repeat_limits
from inclinometry.files.survey_csv import read_survey_csv
from inclinometry.findings import Finding
from inclinometry.gyro.result import FLAGS as GYRO_FLAGS
from inclinometry.survey.flags import FLAGS, Check, flagged
from inclinometry.survey.gyro import Comparison, compare_runs
from inclinometry.survey.run import Run

MEANING = {**FLAGS, **GYRO_FLAGS}

SUSPECT = ("misfit", "noisy", "scale", "g")
"""Flags of a run alone that fail it; other flags are only said."""


def read_run(path: str | Path) -> Run:
    """Stations of a survey file; azimuth, from the file's own north, is NaN where missing or flagged vertical."""
    found = read_survey_csv(path)
    columns = {name: values for name, values in found.items() if not isinstance(values, tuple)}
    texts = {name: values for name, values in found.items() if isinstance(values, tuple)}
    inclination, azimuth = columns["inclination"], columns["azimuth"]
    if np.isnan(inclination).any() or not ((inclination >= 0.0) & (inclination <= np.pi)).all():
        row = int(np.argmax(~((inclination >= 0.0) & (inclination <= np.pi))))
        raise FileError(
            Finding(
                "input-value",
                {"name": "inclination_deg", "value": float(np.degrees(inclination[row])), "allowed": "0 .. 180"},
            ),
            path=path,
            row=row + 1,
        )
    norths = sorted({text for text in texts["azimuth_reference"] if text})
    if len(norths) != 1:
        raise FileError(Finding("input-north", {"norths": tuple(norths) or ("-",)}), path=path)
    vertical = "vertical"  # flag of stations whose azimuth is hardly defined; it is not compared
    steep = np.array([vertical in row.split("|") for row in texts["flags"]], dtype=bool)
    return Run(columns["md"], inclination, np.where(steep, np.nan, azimuth), azimuth_reference=norths[0])


def compare_run_files(
    in_run: str | Path, out_run: str | Path, site: Site | None = None, limits: str | Path = GYRO_REPEAT
) -> Comparison:
    """Compare the survey files of an in-run and an out-run; a site is needed only where their norths differ."""
    if digest_file(in_run) == digest_file(out_run):
        raise FileError(
            Finding("input-same-file", {"name": Path(out_run).name, "other": Path(in_run).name}), path=out_run
        )
    one, two = read_run(in_run), read_run(out_run)
    if one.azimuth_reference != two.azimuth_reference:
        if site is None:
            raise refused("work-norths", {"norths": (one.azimuth_reference, two.azimuth_reference)})
        # the run from another north
        known = np.isfinite(two.azimuth)
        azimuth: Array = np.full(len(two.md), np.nan)
        azimuth[known] = convert_azimuth(two.azimuth[known], two.azimuth_reference, one.azimuth_reference, site)
        two = replace(two, azimuth=azimuth, azimuth_reference=one.azimuth_reference)
    return compare_runs(one, two, read_repeat_limits(limits))


def run_checks(path: str | Path) -> tuple[list[Check], list[Finding]]:
    """What the flags in one survey file say of it: checks, and findings on flags that fail nothing.

    The rates themselves are not in the file; `gyro north` checks them when it makes it.
    """
    rows = read_survey_csv(path)["flags"]
    flags = [set(str(row).split("|")) - {""} for row in rows]
    checks = []
    for name in SUSPECT:
        bad = tuple(row for row, names in enumerate(flags) if name in names)
        reason = flagged(name, bad, len(flags), MEANING)
        checks.append(Check(f"flag {name}", "fail" if bad else "pass", len(bad), 0.0, bad, reason, "stations"))
    others = sorted(set().union(*flags) - set(SUSPECT)) if flags else []
    where = {name: [row for row, names in enumerate(flags) if name in names] for name in others}
    return checks, [flagged(name, at, len(flags), MEANING) for name, at in where.items()]


def check_json(check: Check) -> dict[str, object]:
    """A check as plain data, angles in degrees and rates in degrees per hour, stations counted from 1."""
    factor, unit = {
        "rad": (np.degrees(1.0), "deg"),
        "rad/s": (np.degrees(3600.0), "deg/h"),
    }.get(check.unit, (1.0, check.unit))
    return {
        "name": check.name,
        "verdict": check.verdict,
        "value": check.value * factor,
        "limit": check.limit * factor,
        "unit": unit,
        "stations": [row + 1 for row in check.stations],
        "reason": str(check.reason),
        "code": check.reason.code,
        "values": check.reason.plain()["values"],
    }


def comparison_json(found: Comparison) -> dict[str, object]:
    """A comparison as plain data in degrees and metres."""
    statistics = {
        name: {
            "stations": s.stations,
            **{f"{key}_deg": float(np.degrees(getattr(s, key))) for key in ("mean", "sd", "rms", "largest")},
            "systematic": bool(s.systematic),
        }
        for name, s in found.statistics.items()
    }
    rows = zip(
        found.md.tolist(), np.degrees(found.inclination).tolist(), np.degrees(found.azimuth).tolist(),
        found.interpolated.tolist(), found.verdicts, strict=True,
    )  # fmt: skip
    return {
        "verdict": found.verdict,
        "limits": {"name": found.limits.name, "source": found.limits.source},
        "checks": [check_json(check) for check in found.checks],
        "statistics": statistics,
        "findings": [one.plain() for one in found.findings],
        "stations": [
            {"md_m": md, "inclination_deg": i, "azimuth_deg": a, "interpolated": b, "verdict": v}
            for md, i, a, b, v in rows
        ],
    }
