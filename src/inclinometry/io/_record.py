"""What a schema cannot say of a calibration record: shapes that belong together, covariances, unit vectors."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from inclinometry.core.arrays import Array, frozen
from inclinometry.core.errors import FileError
from inclinometry.io._json import Json, shown

LARGEST = 1e100  # squares and products of larger numbers leave float64
SYMMETRIC = 1e-9
POSITIVE = 1e-6
UNIT = 1e-6


def check_arrays(content: Json, path: str | Path) -> None:
    """FileError for sensors and offsets that differ in number, rows of unequal length, numbers beyond 1e100."""
    _check_size(content, "$", path)
    for kind, entry in content["triads"].items():
        where, count = f"$.triads.{kind}", len(entry["tensor"])
        parts = [(f"{where}.{name}", entry[name]) for name in ("offset", "noise") if name in entry]
        for i, term in enumerate(entry.get("temperature_coefficients", [])):
            parts += [(f"{where}.temperature_coefficients[{i}].{name}", term[name]) for name in ("tensor", "offset")]
        for place, values in parts:
            if len(values) != count:
                problem = f"{place} has {len(values)} entries; it must have {count}, one a row of {where}.tensor"
                raise FileError(problem, path=path)
    for name in ("values", "standardised"):
        for kind, rows in content.get("residuals", {}).get(name, {}).items():
            _check_rows(rows, f"$.residuals.{name}.{kind}", path)


def _check_size(value: Any, where: str, path: str | Path) -> None:
    if isinstance(value, Mapping):
        for key, item in value.items():
            _check_size(item, f"{where}.{key}", path)
    elif isinstance(value, list):
        for i, item in enumerate(value):
            _check_size(item, f"{where}[{i}]", path)
    elif isinstance(value, int | float) and abs(value) > LARGEST:
        raise FileError(f"{where} is {shown(value)}; it must be within -{LARGEST:g} to {LARGEST:g}", path=path)


def _check_rows(rows: list[list[float]], where: str, path: str | Path, width: int | None = None) -> None:
    width = len(rows[0]) if width is None and rows else width
    for i, row in enumerate(rows):
        if len(row) != width:
            raise FileError(f"{where}[{i}] has {len(row)} entries; it must have {width}", path=path)


def check_directions(entries: Mapping[str, list[float]], path: str | Path) -> dict[str, Array]:
    """Unit vectors by kind; FileError for a vector whose length is not 1 to 1e-6."""
    found = {kind: frozen(values) for kind, values in entries.items()}
    for kind, vector in found.items():
        length = float(np.linalg.norm(vector))
        if not abs(length - 1.0) <= UNIT:
            raise FileError(f"$.field_directions.{kind} has length {length:.9g}; it must be a unit vector", path=path)
    return found


def covariance(entry: Mapping[str, Any], path: str | Path, where: str) -> Array:
    """The matrix of a covariance entry, square, symmetric and positive semidefinite; FileError otherwise."""
    names, place = entry["parameters"], f"{where}.matrix"
    size = len(names)
    if len(entry["matrix"]) != size:
        problem = f"{place} has {len(entry['matrix'])} rows; it must have {size}, one a name in {where}.parameters"
        raise FileError(problem, path=path)
    _check_rows(entry["matrix"], place, path, size)
    matrix = np.array(entry["matrix"], dtype=np.float64).reshape(size, size)
    variance = np.diagonal(matrix)
    if (variance < 0.0).any():
        k = int(np.argmin(variance))
        problem = f"{place}[{k}][{k}] is {variance[k]:g}; a variance must be 0 or more"
        raise FileError(f"{problem}: repeat the calibration", path=path)
    gap = np.abs(matrix - matrix.T)
    uneven = gap > SYMMETRIC * np.maximum(np.abs(matrix), np.abs(matrix.T))
    # entries that are rounding beside their variances need not agree
    sd = np.sqrt(variance)
    uneven &= gap > SYMMETRIC * np.outer(sd, sd)
    if uneven.any():
        i, j = np.argwhere(uneven)[0].tolist()
        problem = f"{place}[{i}][{j}] is {matrix[i, j]:g} and [{j}][{i}] is {matrix[j, i]:g}"
        raise FileError(f"{problem}; a covariance must be symmetric: repeat the calibration", path=path)
    scale = np.where(sd > 0.0, sd, 1.0)
    least = float(np.linalg.eigvalsh(matrix / scale / scale[:, None]).min(initial=0.0))
    if least < -POSITIVE:
        problem = f"{place} has an eigenvalue of {least:.3g} as a matrix of correlations; it must be 0 or more"
        raise FileError(f"{problem}: repeat the calibration", path=path)
    return frozen(matrix)
