"""verify.json: the verdict of a verification with every position, as a certificate takes it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.conformity import Verification
from inclinometry.calibration.decision import AGREES, DISAGREES, Limits, rayleigh
from inclinometry.calibration.result import Calibration
from inclinometry.constants import ANGLES, COVERAGE_FACTOR
from inclinometry.digest import digest_bytes
from inclinometry.errors import FileError
from inclinometry.files import json_codec
from inclinometry.files.json_codec import findings_in
from inclinometry.files.tool_json import calibration_content, older_content
from inclinometry.files.writing import program
from inclinometry.findings import Finding, without_notes

VERSION: Final = 3
"""Of verify.json and of the plan of a verification."""


def calibration_digest(calibration: Calibration) -> str:
    """What binds a verification to its calibration: the digest of its content, however the file was spelled."""
    return _digest(calibration_content(calibration))


def _digest(content: Mapping[str, Any]) -> str:
    return digest_bytes(json_codec.canonical(content))


def _digests(calibration: Calibration) -> tuple[str, ...]:
    """The digest of its content now, with sentences in place of findings, and with "house", now "native"."""
    older = older_content(calibration)
    return calibration_digest(calibration), _digest(older), _digest(older | {"convention": "house"})


def write_verification(path: str | Path, found: Verification, limits: Limits | None, calibration: Calibration) -> None:
    """Write verify.json, what a verification found of a calibration; the same one gives the same bytes.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    content = {
        "tool": calibration.tool.name,
        "calibration": calibration_digest(calibration),
        "verdict": found.verdict,
        "limits": stated_limits(limits),
        "report": judged_positions(found),
        "inputs": found.inputs,
        "program": program(),
    }
    json_codec.store(content, path, "verification", VERSION)


def write_planned(path: str | Path, found: Verification, limits: Limits | None, calibration: Calibration) -> None:
    """What a verification at these positions will be worth, before any reading; for the agreement with a customer."""
    judged = [
        {key: value for key, value in row.items() if key not in ANGLES}
        | {name: {key: row[name][key] for key in ("U_deg", "limit_deg")} for name in ANGLES}
        for row in judged_positions(found)["positions"]
    ]
    content = {
        "tool": calibration.tool.name,
        "calibration": calibration_digest(calibration),
        "limits": stated_limits(limits),
        "coverage_factor": found.coverage_factor,
        "positions": judged,
        "power": power_summary(found),
        "findings": [one.stored() for one in found.findings],
        "program": program(),
    }
    json_codec.store(content, path, "planned-verification", VERSION)


def power_summary(found: Verification) -> dict[str, Any]:
    """How many times worse a tool must be to be found with 90 %, null where it never is; the risks of both sides."""
    power = found.power
    if power is None:
        return {}
    factors = {"times": power.factor, **power.by_angle}
    return {
        "detected_factor_90_percent": {name: float(x) if np.isfinite(x) else None for name, x in factors.items()},
        "producers_risk": power.producer,
        "consumers_risk": power.consumer,
        "pass_probability_at_twice": power.twice,
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
        "findings": [one.stored() for one in found.findings],
    }


def stated_limits(limits: Limits | None) -> dict[str, Any] | None:
    """The agreed limits, degrees, for records; None where none were agreed."""
    if limits is None:
        return None
    return {
        "name": limits.name,
        "source": limits.source,
        "guard": limits.guard,
        "min_inclination_deg_for_azimuth": _degree(limits.min_inclination_for_azimuth),
        **{f"{name}_deg": None if (x := getattr(limits, name)) is None else _degree(x) for name in ANGLES},
    }


def as_now(recorded: Mapping[str, Any]) -> dict[str, Any]:
    """A recorded "verdict", "limits" and "report" as they are recorded now.

    Records of version 1, where no one agreed on limits, state k times the standard uncertainty as a limit and a pass
    within it: they say that the tool agrees, without limits, and U is that of k = 2; the reasons of a pass go.
    """
    limits, report = recorded["limits"], dict(recorded["report"])
    agreed = limits is None or "guard" in limits
    if "findings" not in report:
        found = findings_in(report) if agreed else without_notes(findings_in(report))
        report["findings"] = [one.stored() for one in found]
        del report["reasons"], report["warnings"]
        if "protocol" in report:
            name, captured, positions = (report["protocol"][key] for key in ("name", "taken", "positions"))
            report["protocol"] = {"name": name, "positions_captured": captured, "positions": positions}
    if agreed:
        return {**recorded, "report": report}
    words = {"pass": AGREES, "fail": DISAGREES}
    k = report["coverage_factor"]

    def angle(one: Mapping[str, Any], steep: bool) -> dict[str, Any]:
        # near the vertical the error is the length of a tilt, of which U shrinks more slowly than k
        share = rayleigh(COVERAGE_FACTOR) / rayleigh(k) if steep else COVERAGE_FACTOR / k
        u = None if one["U_deg"] is None else one["U_deg"] * share
        return {**one, "U_deg": u, "limit_deg": None, "decision": words.get(one["decision"], one["decision"])}

    rows = [
        {**row, **{name: angle(row[name], row["azimuth"]["decision"] == "not judged") for name in ANGLES}}
        for row in report["positions"]
    ]
    report |= {"coverage_factor": COVERAGE_FACTOR, "positions": rows}
    return {**recorded, "verdict": words[recorded["verdict"]], "limits": None, "report": report}


def _degrees(values: Array) -> list[float]:
    return [float(x) for x in np.degrees(values).round(9)]


def _degree(value: float) -> float | None:
    """In degrees; null where there is none."""
    return float(np.degrees(value)) if np.isfinite(value) else None


def read_verification(path: str | Path, calibration: Calibration) -> dict[str, Any]:
    """Read verify.json; one of another tool or of another calibration is refused."""
    content = as_now(json_codec.stored(path, "verification", VERSION))
    if content["tool"] != calibration.tool.name:
        tools = {"tool": f"{content['tool']:.60}", "calibrated": f"{calibration.tool.name:.60}"}
        raise FileError(Finding("record-tool-other", tools), path=path)
    if content["calibration"] not in _digests(calibration):
        raise FileError(Finding("record-calibration-other"), path=path)
    for place, row in enumerate(content["report"]["positions"]):
        for name in ANGLES:
            one = row[name]
            judged = one["decision"] != "not judged" and (content["limits"] is None or one["limit_deg"] is not None)
            if judged and None in (one["error_deg"], one["U_deg"]):
                where = f"$.report.positions[{place}].{name}"
                lacking = tuple(f"{where}.{key}" for key in ("error_deg", "U_deg") if one[key] is None)
                raise FileError(Finding("input-missing", {"names": lacking}), path=path)
    return content
