"""errors.json: what may be wrong with the angles of a run, cause by cause, with the correlation of all its stations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from inclinometry.arrays import Array, frozen
from inclinometry.errors import FileError, InputError, in_file, refused, wrong_shape
from inclinometry.files import json_codec
from inclinometry.files.writing import degrees
from inclinometry.findings import Finding
from inclinometry.uncertainty import AngleErrors, covariance_matrix


@dataclass(frozen=True, eq=False)
class RunErrors:
    """Stations of a run and what may be wrong with their angles.

    md : (n,) m. inclination, azimuth : (n,) rad, from the north `azimuth_reference`. errors : cause -> AngleErrors.
    tool : its name, "" where it has none. inputs : name -> digest.
    """

    md: Array
    inclination: Array
    azimuth: Array
    azimuth_reference: str
    errors: Mapping[str, AngleErrors]
    tool: str = ""
    inputs: Mapping[str, str] = field(default_factory=dict)


_ROWS = ("inclination", "azimuth", "north", "east")


def write_errors(run: RunErrors, path: str | Path) -> None:
    """Write errors.json; the same run gives the same bytes. Stations without angles, of a failed channel, are left out.

    Raises
    ------
    InputError
        A run of which no causes are known.
    """
    if not run.errors:
        raise refused("record-errors-unknown")
    kept = np.isfinite(run.inclination) & np.isfinite(run.azimuth)
    content = {
        "tool": run.tool,
        "inputs": dict(run.inputs),
        "azimuth_reference": run.azimuth_reference,
        "stations": {
            "md_m": run.md[kept],
            "inclination_deg": degrees(run.inclination[kept]),
            "azimuth_deg": degrees(run.azimuth[kept]),
        },
        "errors": [
            {
                "cause": name,
                "shared": one.shared,
                "covariance": one.covariance,
                "by_parameter": {row: one.by_parameter[kept, k] for k, row in enumerate(_ROWS)},
            }
            for name, one in run.errors.items()
        ],
    }
    json_codec.store(content, path, "errors")


def read_errors(path: str | Path) -> RunErrors:
    """Read errors.json.

    Raises
    ------
    FileError
        Not such a file, a later version, a value out of place, with its JSON path.
    """
    content = json_codec.stored(path, "errors")
    stations, errors = content["stations"], {}
    size = len(stations["md_m"])
    for name, values in stations.items():
        if len(values) != size:
            raise in_file(wrong_shape(f"$.stations.{name}", f"({len(values)},)", f"({size},)"), path)
    for k, one in enumerate(content["errors"]):
        where = f"$.errors[{k}]"
        try:
            covariance = covariance_matrix(one["covariance"], f"{where}.covariance")
            by = np.stack([np.array(one["by_parameter"][row], dtype=np.float64) for row in _ROWS], axis=1)
        except InputError as error:
            raise in_file(error, path) from None
        except ValueError as error:
            raise FileError(Finding("file-format", {"format": where, "reason": str(error)}), path=path) from None
        if by.shape != (size, 4, len(covariance)):
            shape = str((size, 4, len(covariance)))
            raise in_file(wrong_shape(f"{where}.by_parameter", by.shape, shape), path)
        if one["cause"] in errors:
            raise FileError(Finding("input-repeated", {"name": f"{where}.cause", "value": one["cause"]}), path=path)
        errors[one["cause"]] = AngleErrors(frozen(by), frozen(covariance), one["shared"])
    return RunErrors(
        frozen(stations["md_m"]),
        frozen(np.radians(stations["inclination_deg"])),
        frozen(np.radians(stations["azimuth_deg"])),
        content["azimuth_reference"],
        errors,
        content["tool"],
        content["inputs"],
    )
