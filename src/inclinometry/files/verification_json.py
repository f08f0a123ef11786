"""verify.json: the verdict of a verification with every position, as a certificate takes it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.acceptance import Limits, Verification
from inclinometry.calibration.result import Calibration
from inclinometry.constants import ANGLES
from inclinometry.conventions import OLD_NATIVE
from inclinometry.digest import digest_bytes
from inclinometry.errors import FileError
from inclinometry.files import json_codec
from inclinometry.files.tool_json import calibration_content
from inclinometry.files.writing import program, write_bytes

SCHEMA: Final = "inclinometry/verification"
VERSION: Final = 1


def calibration_digest(calibration: Calibration) -> str:
    """What binds a verification to its calibration: the digest of its content, however the file was spelled."""
    return _digest(calibration_content(calibration))


def _digest(content: Mapping[str, Any]) -> str:
    return digest_bytes(json_codec.canonical(content))


def _digests(calibration: Calibration) -> tuple[str, str]:
    """The digest of its content, and that of the content as it was written when "native" was called "house"."""
    content = calibration_content(calibration)
    return _digest(content), _digest(content | {"convention": OLD_NATIVE})


def write_verification(path: str | Path, found: Verification, limits: Limits | None, calibration: Calibration) -> None:
    """Write verify.json, what a verification found of a calibration; the same one gives the same bytes.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    content = {
        "schema": SCHEMA,
        "version": VERSION,
        "tool": calibration.tool.name,
        "calibration": calibration_digest(calibration),
        "verdict": found.verdict,
        "limits": stated_limits(found, limits),
        "report": judged_positions(found),
        "inputs": found.inputs,
        "program": program(),
    }
    write_bytes(json_codec.canonical(content), path)


def write_planned(path: str | Path, found: Verification, limits: Limits | None, calibration: Calibration) -> None:
    """Write what a verification at these positions will be worth, before any reading is taken; for the agreement with
    a customer, and to be held against the verification itself.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    judged = [
        {key: value for key, value in row.items() if key not in ANGLES}
        | {name: {key: row[name][key] for key in ("U_deg", "limit_deg")} for name in ANGLES}
        for row in judged_positions(found)["positions"]
    ]
    content = {
        "schema": "inclinometry/planned-verification",
        "version": 1,
        "tool": calibration.tool.name,
        "calibration": calibration_digest(calibration),
        "limits": stated_limits(found, limits),
        "coverage_factor": found.coverage_factor,
        "positions": judged,
        "worth": worth_of(found),
        "said": found.notes,
        "warnings": list(found.warnings),
        "program": program(),
    }
    write_bytes(json_codec.canonical(content), path)


def worth_of(found: Verification) -> dict[str, Any]:
    """How many times worse a tool must be to be found with 90 %, null where it never is; the risks of both sides."""
    power = found.power
    if power is None:
        return {}
    factors = {"times": power.factor, **power.by_angle}
    return {
        "found_with_90_percent": {name: float(x) if np.isfinite(x) else None for name, x in factors.items()},
        "producers_risk": power.producer,
        "consumers_risk": power.consumer,
        "twice_as_bad_passes": power.twice,
    }


def judged_positions(found: Verification) -> dict[str, Any]:
    """Position by position: dials, errors, expanded uncertainties, limits and decisions, degrees."""
    rows = []
    for place, station in enumerate(found.station):
        row: dict[str, Any] = {"position": station}
        row |= dict(zip(("azimuth_deg", "inclination_deg", "toolface_deg"), _degrees(found.dials[place]), strict=True))
        for column, name in enumerate(ANGLES):
            limit = found.limits[place, column]
            row[name] = {
                "error_deg": _degree(found.errors[place, column]),
                "U_deg": _degree(found.coverage_factor * found.u[place, column]),
                "limit_deg": _degree(limit),
                "decision": found.decision[place][column],
            }
        rows.append(row)
    return {
        "coverage_factor": found.coverage_factor,
        "positions": rows,
        "reasons": [*found.reasons, *found.notes],
        "warnings": list(found.warnings),
    }


def stated_limits(found: Verification, limits: Limits | None) -> dict[str, Any]:
    """What the errors were held against, degrees, for records."""
    stated: dict[str, Any] = {"name": found.limits_name, "source": found.limits_source}
    if limits is not None:
        stated["guard"] = limits.guard
        stated["min_inclination_deg_for_azimuth"] = _degree(limits.min_inclination_for_azimuth)
        for name in ANGLES:
            value = getattr(limits, name)
            stated[f"{name}_deg"] = None if value is None else _degree(value)
    return stated


def _degrees(values: Array) -> list[float]:
    return [float(x) for x in np.degrees(values).round(9)]


def _degree(value: float) -> float | None:
    """In degrees; null where there is none."""
    return float(np.degrees(value)) if np.isfinite(value) else None


def read_verification(path: str | Path, calibration: Calibration) -> dict[str, Any]:
    """Read verify.json of this calibration.

    Raises
    ------
    FileError
        Another kind of file, a newer version, content the schema refuses, a verification of another tool or of another
        calibration, an angle that is judged without a number.
    """
    content = json_codec.of_kind(json_codec.load(path), path, SCHEMA, version=VERSION)
    if content["tool"] != calibration.tool.name:
        raise FileError(
            f"this verification is of tool {content['tool']!r:.60}, the calibration of {calibration.tool.name!r:.60}",
            path=path,
        )
    if content["calibration"] not in _digests(calibration):
        raise FileError("this verification was made with another calibration of the tool; verify again", path=path)
    for row in content["report"]["positions"]:
        for name in ANGLES:
            one = row[name]
            judged = one["decision"] != "not judged" and one["limit_deg"] is not None
            if judged and None in (one["error_deg"], one["U_deg"]):
                problem = f"{name} of position {row['position']!r:.40} is judged ({one['decision']}) without error or U"
                raise FileError(f"{problem}; verify again", path=path)
    return content
