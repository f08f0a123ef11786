"""tool.json, the record of a calibration, and truth.json, a simulated tool as it is: canonical bytes, checked input."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.arrays import Array, frozen
from inclinometry.calibration.result import Calibration, Residuals, Rig
from inclinometry.constants import FIELD_UNITS, SHORT_INCLINATIONS
from inclinometry.errors import FileError, InputError, in_file, not_among, out_of_range, wrong_shape
from inclinometry.files import json_codec
from inclinometry.files.json_codec import Json, findings_in, shown
from inclinometry.findings import Finding, Value, only_notes, without_notes
from inclinometry.sensors import Tool, Triad
from inclinometry.tabular import check_record

# What a schema cannot say of a calibration record: shapes that belong together, covariances, unit vectors.

LARGEST = 1e100  # squares and products of larger numbers leave float64
SYMMETRIC = 1e-9


def check_arrays(content: Json, path: str | Path) -> None:
    """FileError for sensors and offsets that differ in number, rows of unequal length, numbers beyond 1e100."""
    _check_size(content, "$", path)
    for kind, entry in content["triads"].items():
        where, count = f"$.triads.{kind}", len(entry["tensor"])
        parts = [(f"{where}.{name}", entry[name]) for name in ("offset", "noise") if name in entry]
        for i, term in enumerate(entry.get("temperature_coefficients", [])):
            parts += [(f"{where}.temperature_coefficients[{i}].{name}", term[name]) for name in ("tensor", "offset")]
        for place, values in parts:
            _check_count(values, count, place, path)
    kept = content.get("residuals", {})
    for name in ("values", "standardised"):
        for kind, rows in kept.get(name, {}).items():
            where = f"$.residuals.{name}.{kind}"
            _check_rows(rows, where, path)
            _check_count(rows, len(kept["station"]), where, path)


def _check_size(value: Any, where: str, path: str | Path) -> None:
    if isinstance(value, Mapping):
        for key, item in value.items():
            _check_size(item, f"{where}.{key}", path)
    elif isinstance(value, list):
        for i, item in enumerate(value):
            _check_size(item, f"{where}[{i}]", path)
    elif isinstance(value, int | float) and abs(value) > LARGEST:
        raise in_file(out_of_range(where, shown(value), f"-{LARGEST:g} .. {LARGEST:g}"), path)


def _check_count(values: list[Any], count: int, place: str, path: str | Path) -> None:
    if len(values) != count:
        raise in_file(wrong_shape(place, f"({len(values)},)", f"({count},)"), path)


def _check_rows(rows: list[list[float]], where: str, path: str | Path, width: int | None = None) -> None:
    for i, row in enumerate(rows):
        _check_count(row, len(rows[0]) if width is None else width, f"{where}[{i}]", path)


def check_directions(entries: Mapping[str, list[float]], path: str | Path) -> dict[str, Array]:
    """Unit vectors by kind; FileError for a vector whose length is not 1 to 1e-6."""
    found = {kind: frozen(values) for kind, values in entries.items()}
    unit = 1e-6
    for kind, vector in found.items():
        length = float(np.linalg.norm(vector))
        if not abs(length - 1.0) <= unit:
            raise in_file(out_of_range(f"|$.field_directions.{kind}|", f"{length:.9g}", "1"), path)
    return found


def covariance(entry: Mapping[str, Any], path: str | Path, where: str) -> Array:
    """The matrix of a covariance entry, square, symmetric and positive semidefinite; FileError otherwise."""
    names, place = entry["parameters"], f"{where}.matrix"
    size = len(names)
    _check_count(entry["matrix"], size, place, path)
    _check_rows(entry["matrix"], place, path, size)
    matrix = np.array(entry["matrix"], dtype=np.float64).reshape(size, size)
    variance = np.diagonal(matrix)
    if (variance < 0.0).any():
        k = int(np.argmin(variance))
        facts: dict[str, Value] = {"place": f"{place}[{k}][{k}]", "fault": "negative variance"}
        raise FileError(Finding("record-covariance", facts), path=path)
    gap = np.abs(matrix - matrix.T)
    uneven = gap > SYMMETRIC * np.maximum(np.abs(matrix), np.abs(matrix.T))
    # entries that are rounding beside their variances need not agree
    sd = np.sqrt(variance)
    uneven &= gap > SYMMETRIC * np.outer(sd, sd)
    if uneven.any():
        i, j = np.argwhere(uneven)[0].tolist()
        facts = {"place": f"{place}[{i}][{j}]", "fault": "not symmetric"}
        raise FileError(Finding("record-covariance", facts), path=path)
    scale = np.where(sd > 0.0, sd, 1.0)
    least = float(np.linalg.eigvalsh(matrix / scale / scale[:, None]).min(initial=0.0))
    if least < -1e-6:
        facts = {"place": place, "fault": "negative eigenvalue"}
        raise FileError(Finding("record-covariance", facts), path=path)
    return frozen(matrix)


CONVENTION: Final = "native"
VERSION: Final = 3


def write_calibration(calibration: Calibration, path: str | Path, *, created: str | None = None) -> None:
    """Write tool.json: the same calibration gives the same bytes, and reading returns every number to the bit.

    Parameters
    ----------
    calibration : Calibration
    path : str or Path
    created : str, optional
        A date to record; nothing is taken from the clock.

    Raises
    ------
    InputError
        A number that is not finite, with its JSON path.
    FileError
        The file cannot be written.
    """
    check_record(calibration, Calibration, "write_calibration")
    json_codec.store(calibration_content(calibration, created), path, "tool", VERSION)


def calibration_content(calibration: Calibration, created: str | None = None) -> dict[str, Any]:
    """What `write_calibration` writes, as plain mappings, lists and arrays."""
    tool, rig, residuals = calibration.tool, calibration.rig, calibration.residuals
    names = list(calibration.parameter_names)
    content: dict[str, Any] = {
        "schema": "inclinometry/tool",
        "version": VERSION,
        "tool": tool.name,
        "created": created,
        "method": calibration.method,
        "inputs": dict(calibration.inputs),
        "convention": CONVENTION,
        "triads": _triads_content(tool),
        "covariance": {"parameters": names, "matrix": calibration.covariance},
        "field_directions": dict(calibration.field_directions),
        "rig": {
            "sd_rad": rig.sd,
            "errors_rad": rig.errors,
            "errors_sd_rad": rig.errors_sd,
            "nuisance": {
                name: {"estimate_rad": value, "uncertainty_rad": sd} for name, (value, sd) in rig.nuisance.items()
            },
        },
        "residuals": {
            "station": list(residuals.station),
            "values": dict(residuals.values),
            # null: a residual that is not judged
            "standardised": {
                kind: [[v if np.isfinite(v) else None for v in row] for row in rows.tolist()]
                for kind, rows in residuals.standardised.items()
            },
            "leverage": residuals.leverage,
        },
        "temperature_range_degC": tool.temperature_range,
        "findings": [one.stored() for one in calibration.findings],
    }
    if np.isfinite(rig.freedom).any():
        content["rig"]["degrees_of_freedom"] = [float(nu) if np.isfinite(nu) else None for nu in rig.freedom]
    if calibration.freedom is not None:
        content["covariance"]["degrees_of_freedom"] = calibration.freedom if np.isfinite(calibration.freedom) else None
    if calibration.shares:
        content["calibration_shares"] = {
            "inclination_deg": np.degrees(SHORT_INCLINATIONS).round(9),
            "causes": {
                name: [[v if np.isfinite(v) else None for v in row] for row in np.asarray(share).tolist()]
                for name, share in calibration.shares.items()
            },
        }
    inside = _block(names, np.asarray(calibration.covariance), tool.parameter_names)
    if inside is None or not np.array_equal(inside, tool.covariance):
        # a method whose joint covariance does not contain the tool's own
        content["tool_covariance"] = {"parameters": list(tool.parameter_names), "matrix": tool.covariance}
    return content


def older_content(calibration: Calibration) -> dict[str, Any]:
    """The content of versions 1 and 2; verifications of that time have its digest."""
    content = calibration_content(calibration)
    del content["findings"]
    kept = {"warnings": without_notes(calibration.findings), "notes": only_notes(calibration.findings)}
    texts = {name: list(map(str, found)) for name, found in kept.items()}
    return content | {"version": 2 if calibration.shares else 1, **texts}


def _block(names: list[str], matrix: Array, wanted: tuple[str, ...]) -> Array | None:
    """The rows and columns of `wanted` out of a covariance with named rows; None when one is not there."""
    place = {name: i for i, name in enumerate(names)}
    if any(name not in place for name in wanted):
        return None
    rows = [place[name] for name in wanted]
    return matrix[np.ix_(rows, rows)]


def _triads_content(tool: Tool) -> dict[str, Any]:
    triads: dict[str, Any] = {}
    for kind, triad in tool.triads.items():
        entry: dict[str, Any] = {
            "tensor": triad.tensor[0],
            "offset": triad.offset[0],
            "unit": triad.unit,
            "field_strength": triad.field_strength,
            "field_unit": FIELD_UNITS[kind],
            "noise": tool.noise[kind],
            "reference_temperature_degC": triad.reference_temperature,
        }
        if triad.degree:
            powers = range(1, triad.degree + 1)
            entry["temperature_coefficients"] = [
                {"power": p, "tensor": triad.tensor[p], "offset": triad.offset[p]} for p in powers
            ]
        if triad.g_sensitivity is not None:
            entry["g_sensitivity"] = triad.g_sensitivity
        triads[kind] = entry
    return triads


def write_truth(tool: Tool, extras: Mapping[str, Any], path: str | Path) -> None:
    """Write truth.json: the triads of a simulated tool and, under `extras`, whatever else the simulation knows.

    Names in `extras` carry their units; angles end in _deg or _rad. Numpy arrays are written as lists.
    """
    content = {
        "tool": tool.name,
        "convention": CONVENTION,
        "triads": _triads_content(tool),
        "temperature_range_degC": tool.temperature_range,
        "extras": dict(extras),
    }
    json_codec.store(content, path, "truth")


def read_calibration(path: str | Path) -> Calibration:
    """Read tool.json.

    Raises
    ------
    FileError
        Not JSON, another kind of file, a newer version, or content the schema refuses: with the JSON path, the value
        found and what is expected there.
    """
    return calibration_from(json_codec.load(path, "inclinometry/tool"), path)


def calibration_from(content: dict[str, Any], where: str | Path) -> Calibration:
    """The calibration in the content of a tool.json, wherever it was kept; errors as `read_calibration`."""
    _checked(content, ("inclinometry/tool",), where)
    rig, residuals = content["rig"], content["residuals"]
    try:
        return Calibration(
            _tool(content, where),
            content["method"],
            content["inputs"],
            check_directions(content["field_directions"], where),
            tuple(content["covariance"]["parameters"]),
            covariance(content["covariance"], where, "$.covariance"),
            Rig(
                _array(rig["sd_rad"]),
                None if rig["errors_rad"] is None else _array(rig["errors_rad"]),
                None if rig["errors_sd_rad"] is None else _array(rig["errors_sd_rad"]),
                {n: (float(v["estimate_rad"]), float(v["uncertainty_rad"])) for n, v in rig["nuisance"].items()},
                # tool older files had none
                np.array([np.inf if nu is None else nu for nu in rig.get("degrees_of_freedom", [None] * 3)]),
            ),
            Residuals(
                tuple(residuals["station"]),
                {kind: _array(v) for kind, v in residuals["values"].items()},
                {kind: _array(v) for kind, v in residuals["standardised"].items()},
                _array(residuals["leverage"]),
            ),
            findings_in(content),
            shares={
                name: _array([[np.nan if v is None else v for v in row] for row in rows])
                for name, rows in content.get("calibration_shares", {}).get("causes", {}).items()
                if len(rows) == len(SHORT_INCLINATIONS)
            },
            freedom=_freedom(content["covariance"]),
        )
    except (ValueError, OverflowError) as error:
        raise _refused(error, where) from None


def _freedom(block: Mapping[str, Any]) -> float | None:
    """Effective degrees of freedom of a covariance: null is infinite, older files say nothing."""
    found = block.get("degrees_of_freedom", np.nan)
    return np.inf if found is None else None if np.isnan(found) else float(found)


def read_tool(path: str | Path) -> Tool:
    """Read the instrument out of tool.json or truth.json (whose covariance is zero); errors as `read_calibration`."""
    return tool_of(_load(path, ("inclinometry/tool", "inclinometry/truth")), path)


def tool_of(content: dict[str, Any], where: str | Path) -> Tool:
    """The tool in the content of a tool.json that was checked when it was stored; errors as `read_calibration`."""
    try:
        return _tool(content, where)
    except (ValueError, OverflowError) as error:
        raise _refused(error, where) from None


def read_extras(path: str | Path) -> dict[str, Any]:
    """What a truth.json knows besides its triads, nothing of a tool.json; errors as `read_calibration`."""
    extras: dict[str, Any] = _load(path, ("inclinometry/tool", "inclinometry/truth")).get("extras", {})
    return extras


def _load(path: str | Path, kinds: tuple[str, ...]) -> dict[str, Any]:
    return _checked(json_codec.load(path, *kinds), kinds, path)


def _checked(content: dict[str, Any], kinds: tuple[str, ...], path: str | Path) -> dict[str, Any]:
    """The content, when it is of one of these kinds and fits its schema."""
    newest = VERSION if content.get("schema") == "inclinometry/tool" else 1
    found = json_codec.of_kind(content, path, *kinds, version=newest)
    check_arrays(found, path)
    return found


def _tool(content: dict[str, Any], path: str | Path) -> Tool:
    triads = {kind: _triad(kind, entry, path) for kind, entry in content["triads"].items()}
    noise = {kind: _array(entry["noise"]) for kind, entry in content["triads"].items() if "noise" in entry}
    span = content["temperature_range_degC"]
    limits = None if span is None else (float(span[0]), float(span[1]))
    tool = Tool(content["tool"], triads, noise=noise, temperature_range=limits)
    key = "tool_covariance" if "tool_covariance" in content else "covariance"
    if key not in content:
        return tool
    matrix = covariance(content[key], path, f"$.{key}")
    inside = _block(content[key]["parameters"], matrix, tool.parameter_names)
    if inside is None:
        raise FileError(Finding("record-names", {"place": f"$.{key}.parameters", "other": "$.triads"}), path=path)
    return Tool(tool.name, triads, inside, noise, limits)


def _triad(kind: str, entry: dict[str, Any], path: str | Path) -> Triad:
    higher = entry.get("temperature_coefficients", [])
    if [term["power"] for term in higher] != list(range(1, len(higher) + 1)):
        powers = ", ".join(str(term["power"]) for term in higher[:5])
        raise in_file(out_of_range(f"$.triads.{kind}.temperature_coefficients.power", powers, "1, 2, 3"), path)
    if entry.get("field_unit", FIELD_UNITS[kind]) != FIELD_UNITS[kind]:
        raise in_file(not_among(f"$.triads.{kind}.field_unit", shown(entry["field_unit"]), [FIELD_UNITS[kind]]), path)
    strength, sensitivity = entry.get("field_strength"), entry.get("g_sensitivity")
    return Triad(
        kind,
        _array([entry["tensor"], *(term["tensor"] for term in higher)]),
        _array([entry["offset"], *(term["offset"] for term in higher)]),
        entry["unit"],
        None if strength is None else float(strength),
        float(entry.get("reference_temperature_degC", 20.0)),
        None if sensitivity is None else _array(sensitivity),
    )


def _array(value: Any) -> Array:
    return frozen(value)


def _refused(error: Exception, path: str | Path) -> FileError:
    if isinstance(error, FileError):
        return error
    if isinstance(error, InputError):
        return in_file(error, path)
    return FileError(Finding("file-format", {"format": "tool.json", "reason": str(error)}), path=path)
