"""Tool codes from JSON: those shipped with the package under their names, or a user's file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.constants import FOOT
from inclinometry.errors import FileError, InputError
from inclinometry.files import json_codec
from inclinometry.position.tool_code import Term, ToolCode, term

_SINGULAR: Final = ("north_singularity", "east_singularity", "vertical_singularity")
# parameter of the file -> variable of the formulas and what one of the file's unit is in SI
_PARAMETERS: Final = {
    "noise_reduction_factor": ("noisereductionfactor", 1.0),
    "gxy_running_speed": ("gxyrunningspeed", 1.0 / 3600.0),
    "gz_running_speed": ("gzrunningspeed", 1.0 / 3600.0),
    "XCLTortuosity": ("xcltortuosity", 1.0),
    "xcl_tortuosity_deg_per_100ft": ("xcltortuosity", np.pi / 180.0 / (100.0 * FOOT)),
}


_COURSE: Final = ("XCLA", "XCLH")
"""Terms of long courses (SPE 187249), which act over all of a course; files of the OWSG don't say so."""
_COURSE_SINGULAR: Final = (
    "-Sin(AzT) * XCLTortuosity * (MD - MDPrev)",
    "Cos(AzT) * XCLTortuosity * (MD - MDPrev)",
    "0",
)


def tool_code_names() -> tuple[str, ...]:
    """Names of the tool codes shipped with the package.

    Examples
    --------
    >>> tool_code_names()[:2]
    ('iscwsa-mwd-rev4', 'iscwsa-mwd-rev5.1')
    """
    folder = files("inclinometry.position").joinpath("tool_codes")
    return tuple(sorted(entry.name.removesuffix(".json") for entry in folder.iterdir() if entry.name.endswith(".json")))


def load_tool_code(name_or_path: str | Path) -> ToolCode:
    """A tool code by its name, or from a JSON file.

    The file has `metadata` (`short_name`, `source`, `revision`), `parameters` and `terms`; the keys of a term are those
    of the ISCWSA's error models in JSON: `name`, `value`, `units`, `propagation_mode` ("Random", "Systematic", "Well",
    "Global"), `depth_formula`, `inclination_formula`, `azimuth_formula`, `north_singularity` and so on. Files of the
    OWSG are read as they are: XCLA and XCLH act over the whole course before a station, XCLA at vertical stations as in
    the ISCWSA's workbooks, and a `framework` of Rev 5 or later makes the attitude at the wellhead uncertain.

    Parameters
    ----------
    name_or_path : str or Path

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
            return _read(shipped)
    path = Path(name_or_path)
    try:
        missing = not path.suffix and len(path.parts) <= 1 and not path.exists()
    except (OSError, ValueError):
        missing = True
    if missing:
        names = ", ".join(tool_code_names())
        raise InputError(f"tool code {str(name_or_path)!r} is neither a file nor one of those shipped: {names}")
    return _read(path)


def _read(path: Path) -> ToolCode:
    content = _without_extensions(json_codec.load(path))
    json_codec.validate(content, "tool-code-1", path)
    metadata, parameters = content["metadata"], content.get("parameters", {})
    terms = tuple(_term(cells, f"$.terms[{row}]", path) for row, cells in enumerate(content["terms"]))
    continuous = parameters.get("xy_static_gyro_end_inc")
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
        )
    except InputError as error:
        raise FileError(str(error), path=path) from None


def _without_extensions(content: dict[str, Any]) -> dict[str, Any]:
    """The file without the keys x_... of its terms, which anybody may add."""
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
    course = cells.get("course", cells["name"] in _COURSE)
    for key in ("depth_factor", "inclination_factor", "azimuth_factor"):
        if cells.get(key, 1) not in (0, 1):  # published files mark with 0 and 1 what the formulas say anyway
            raise FileError(f"{where}.{key} is {cells[key]}; write it into the formula, and leave it out", path=path)
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
        raise FileError(f"{where}: {error}", path=path) from None
