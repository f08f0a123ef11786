"""Tool codes from JSON: those shipped with the package under their names, or a user's file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib.resources import as_file, files
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from inclinometry.constants import FOOT
from inclinometry.errors import InputError, in_file, not_among, out_of_range, refused
from inclinometry.files import json_codec
from inclinometry.files.ipm import read_ipm
from inclinometry.findings import Finding, Value
from inclinometry.position.tool_code import STATES, Term, ToolCode, term
from inclinometry.tabular import check_record

_SINGULAR: Final = ("north_singularity", "east_singularity", "vertical_singularity")
# parameter of the file -> variable of the formulas and what one of the file's unit is in SI
_PARAMETERS: Final = {
    "noise_reduction_factor": ("noisereductionfactor", 1.0),
    "gxy_running_speed": ("gxyrunningspeed", 1.0 / 3600.0),
    "gz_running_speed": ("gzrunningspeed", 1.0 / 3600.0),
    "XCLTortuosity": ("xcltortuosity", 1.0),
    "xcl_tortuosity_deg_per_100ft": ("xcltortuosity", np.pi / 180.0 / (100.0 * FOOT)),
}


_COURSE_SINGULAR: Final = (
    "-Sin(AzT) * XCLTortuosity * (MD - MDPrev)",
    "Cos(AzT) * XCLTortuosity * (MD - MDPrev)",
    "0",
)


def tool_code_names() -> tuple[str, ...]:
    """Names of the tool codes shipped with the package.

    >>> tool_code_names()[:2]
    ('iscwsa-mwd-rev4', 'iscwsa-mwd-rev5.1')
    """
    folder = files("inclinometry.position").joinpath("tool_codes")
    return tuple(sorted(entry.name.removesuffix(".json") for entry in folder.iterdir() if entry.name.endswith(".json")))


def load_tool_code(name_or_path: str | Path, parameters: Mapping[str, float] = MappingProxyType({})) -> ToolCode:
    """A tool code by its name, or from a JSON or IPM file.

    The file has `metadata` (`short_name`, `source`, `revision`), `parameters` and `terms`; the keys of a term are those
    of the ISCWSA's error models in JSON: `name`, `value`, `units`, `propagation_mode` ("Random", "Systematic", "Well",
    "Global"), `depth_formula`, `inclination_formula`, `azimuth_formula`, `north_singularity` and so on. Files of the
    OWSG are read as they are: XCLA and XCLH act over the whole course before a station, XCLA at vertical stations as in
    the ISCWSA's workbooks, and a `framework` of Rev 5 or later makes the attitude at the wellhead uncertain. In place
    of terms a file may have `based_on`, a shipped name, and `magnitudes` of the terms that differ.

    Parameters
    ----------
    name_or_path : str or Path
        IPM: see `inclinometry.files.ipm.read_ipm`.
    parameters : mapping, optional
        Parameters that replace those of the file, in its units.

    Returns
    -------
    ToolCode

    Raises
    ------
    InputError
        A name that is neither a shipped tool code nor a file; lists the names.
    FileError
        No JSON, a missing or unknown key with its JSON path, an unknown unit, variable or function with its term.

    Examples
    --------
    >>> code = load_tool_code("iscwsa-mwd-rev5.1")
    >>> code.revision, len(code.terms)
    ('5.1', 35)
    """
    if str(name_or_path) in tool_code_names():
        with as_file(files("inclinometry.position").joinpath("tool_codes", f"{name_or_path}.json")) as shipped:
            return _read(shipped, parameters)
    path = Path(name_or_path)
    try:
        missing = not path.suffix and len(path.parts) <= 1 and not path.exists()
    except (OSError, ValueError):
        missing = True
    if missing:
        raise not_among("--tool-code", str(name_or_path), tool_code_names())
    if path.suffix.lower() != ".ipm":
        return _read(path, parameters)
    if parameters:
        raise refused("input-not-with", {"name": "--tool-parameter", "other": path.name})
    return read_ipm(path)


def _read(path: Path, given: Mapping[str, float]) -> ToolCode:
    content = _without_extensions(json_codec.load(path))
    if isinstance(content.get("parameters", {}), dict):
        content["parameters"] = {**content.get("parameters", {}), **given}
    json_codec.validate(content, "tool-code-1", path)
    if "based_on" in content:
        content = _based(content, path)
    metadata, parameters = content["metadata"], content["parameters"]
    terms = tuple(_term(cells, f"$.terms[{row}]", path) for row, cells in enumerate(content["terms"]))
    continuous = parameters.get("xy_static_gyro_end_inc")
    used = {name for one in terms for formula in one.formulas for name in formula.names}
    findings: tuple[Finding, ...] = ()
    if "noisereductionfactor" in used and "noise_reduction_factor" not in parameters and not used & set(STATES):
        parameters = {**parameters, "noise_reduction_factor": 1.0}
        assumed: dict[str, Value] = {
            "name": "noise_reduction_factor",
            "value": 1.0,
            "unit": "",
            "why": "stationary gyro",
        }
        findings = (Finding("work-assumed", assumed | {"needed": ("--tool-parameter",)}, severity="note"),)
    for key, (name, _) in _PARAMETERS.items():
        if name in used and not any(_PARAMETERS.get(other, ("",))[0] == name for other in parameters):
            raise in_file(
                refused("input-needs", {"name": metadata["short_name"], "needed": (f"--tool-parameter {key}",)}), path
            )
    try:
        return ToolCode(
            name=metadata["short_name"],
            terms=terms,
            source=metadata["source"],
            revision=str(metadata.get("revision", "")),
            description=metadata.get("long_name", ""),
            parameters={
                _PARAMETERS[k][0]: float(v) * _PARAMETERS[k][1]
                for k, v in [(key, value) for key, value in parameters.items() if key in _PARAMETERS]
            },
            inclinations=_degrees(parameters.get("inc_min", 0.0), parameters.get("inc_max", 180.0)),
            vertical=float(np.radians(parameters.get("vertical_inclination_deg", 1e-4))),
            surface_attitude=parameters.get("surface_attitude_uncertain", _revised(metadata.get("framework", ""))),
            continuous_above=None if continuous is None else float(continuous),
            east_west_exclusion=float(np.radians(parameters.get("east_west_exclusion_deg", 0.0))),
            findings=findings,
        )
    except InputError as error:
        raise in_file(error, path) from None


def _based(content: dict[str, Any], path: Path) -> dict[str, Any]:
    """A file of changed magnitudes with the terms of the shipped code: null leaves a term out, a pair renames one."""
    if content["based_on"] not in tool_code_names():
        raise in_file(not_among("$.based_on", content["based_on"], tool_code_names()), path)
    base = json_codec.load(Path(str(files("inclinometry.position"))) / "tool_codes" / f"{content['based_on']}.json")
    terms = {cells["name"]: cells for cells in base["terms"]}
    for name, value in content["magnitudes"].items():
        like, size = value if isinstance(value, list) else (name, value)
        if like not in terms:
            raise in_file(not_among(f"$.magnitudes.{name}", like, terms), path)
        terms[name] = {**terms[like], "name": name, "value": size}
    kept = [cells for cells in terms.values() if cells["value"] is not None]
    return {**content, "terms": kept, "parameters": {**base["parameters"], **content["parameters"]}}


def _without_extensions(content: dict[str, Any]) -> dict[str, Any]:
    """The file without the keys x_... of its terms, which anyone may add."""
    terms = content.get("terms")
    if not isinstance(terms, list) or not all(isinstance(cells, dict) for cells in terms):
        return content  # the schema says what is wrong
    kept = [{key: value for key, value in cells.items() if not key.startswith("x_")} for cells in terms]
    return {**content, "terms": kept}


def _revised(framework: object) -> bool:
    """Whether a framework such as "ISCWSA Rev5" is of the fifth revision or later."""
    found = re.match(r"ISCWSA Rev\s*(\d+)", str(framework))
    return found is not None and int(found[1]) >= 5


def _degrees(low: float, high: float) -> tuple[float, float]:
    return float(np.radians(low)), float(np.radians(high))


def _term(cells: Mapping[str, Any], where: str, path: Path) -> Term:
    singular = [cells.get(key) or "0" for key in _SINGULAR] if any(cells.get(key) for key in _SINGULAR) else None
    # terms of long courses (SPE 187249) act over all of a course; files of the OWSG don't say so
    course = cells.get("course", cells["name"] in ("XCLA", "XCLH"))
    for key in ("depth_factor", "inclination_factor", "azimuth_factor"):
        if cells.get(key, 1) not in (0, 1):  # published files mark with 0 and 1 what the formulas say anyway
            raise in_file(out_of_range(f"{where}.{key}", json_codec.shown(cells[key]), "0, 1"), path)
    if cells["name"] == "XCLA" and "course" not in cells:
        singular = list(_COURSE_SINGULAR)
    weights = ("depth_formula", "inclination_formula", "azimuth_formula")
    try:
        return term(
            cells["name"],
            float(cells["value"]),
            cells["units"],
            cells["propagation_mode"].lower(),
            [cells.get(key, "0") for key in weights],
            singular,
            course=course,
            inclinations=_degrees(cells.get("inc_min_deg", -np.inf), cells.get("inc_max_deg", np.inf)),
            hold=cells.get("carry_above_max", False),
            start=cells.get("carry_only", False),
            description=cells.get("description", ""),
            source=cells.get("source", ""),
        )
    except InputError as error:
        raise in_file(error, path) from None


def write_tool_code(code: ToolCode, path: str | Path, evidence: Mapping[str, object] | None = None) -> None:
    """Write a tool code as `load_tool_code` reads it.

    Parameters
    ----------
    code : ToolCode
    path : str or Path
        JSON; whole or not at all.
    evidence : mapping, optional
        What it was made from, kept in the metadata: see `inclinometry.position.fleet_code.FleetCode`.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_tool_code(load_tool_code("iscwsa-mwd-rev5.1"), Path(folder, "copy.json"))
    ...     len(load_tool_code(Path(folder, "copy.json")).terms)
    35
    """
    check_record(code, ToolCode, "write_tool_code")
    names = {"noisereductionfactor": "noise_reduction_factor", "gxyrunningspeed": "gxy_running_speed"}
    names |= {"gzrunningspeed": "gz_running_speed", "xcltortuosity": "xcl_tortuosity_deg_per_100ft"}
    parameters: dict[str, object] = {names[k]: v / _PARAMETERS[names[k]][1] for k, v in code.parameters.items()}
    parameters |= {
        "inc_min": float(np.degrees(code.inclinations[0])),
        "inc_max": float(np.degrees(code.inclinations[1])),
    }
    parameters["vertical_inclination_deg"] = float(np.degrees(code.vertical))
    parameters["surface_attitude_uncertain"] = code.surface_attitude
    if code.east_west_exclusion:
        parameters["east_west_exclusion_deg"] = float(np.degrees(code.east_west_exclusion))
    if code.continuous_above is not None:
        parameters["xy_static_gyro_end_inc"] = code.continuous_above
    metadata: dict[str, object] = {"short_name": code.name, "long_name": code.description, "source": code.source}
    metadata |= {"revision": code.revision} | ({} if evidence is None else {"evidence": dict(evidence)})
    content = {
        "metadata": metadata,
        "parameters": parameters,
        "terms": [_cells(one) for one in code.terms],
    }
    json_codec.store(content, path, "tool-code")


def _cells(one: Term) -> dict[str, object]:
    """A term as the file has it."""
    cells: dict[str, object] = {
        "name": one.name,
        "description": one.description,
        "source": one.source,
        "value": one.magnitude,
        "units": one.unit,
        "propagation_mode": one.propagation.capitalize(),
        "depth_formula": one.depth.text,
        "inclination_formula": one.inclination.text,
        "azimuth_formula": one.azimuth.text,
        "course": one.course,
    }
    if one.singular is not None:
        cells |= dict(zip(_SINGULAR, [formula.text for formula in one.singular], strict=True))
    for key, limit in zip(("inc_min_deg", "inc_max_deg"), one.inclinations, strict=True):
        if np.isfinite(limit):
            cells[key] = float(np.degrees(limit))
    return cells | {key: True for key, kept in (("carry_above_max", one.hold), ("carry_only", one.start)) if kept}
