"""scale.json: what a run has taught of the gyro's scale factor, kept beside the tool and offered to the next run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from inclinometry.arrays import Array, frozen
from inclinometry.errors import FileError, InputError, in_file, wrong_shape
from inclinometry.files import json_codec
from inclinometry.findings import Finding
from inclinometry.gyro.tracking import ScaleState


@dataclass(frozen=True, eq=False)
class ScaleRecord:
    """The scale factor of one run; arrays of n stations, in the order measured.

    state : what is known after the run. observable : False where a station's rates do not determine its scale.
    tool : name of the calibrated tool, "" without one. inputs : name -> digest.
    """

    tool: str
    state: ScaleState
    md: Array
    temperature: Array
    expected: Array
    expected_sd: Array
    scale: Array
    scale_sd: Array
    observable: tuple[bool, ...]
    inputs: Mapping[str, str]


_COLUMNS = {
    "md": "md_m", "temperature": "temperature_degC", "expected": "expected", "expected_sd": "u_expected",
    "scale": "scale", "scale_sd": "u_scale",
}  # fmt: skip


def write_scale(record: ScaleRecord, path: str | Path) -> None:
    """Write scale.json; the same record gives the same bytes."""
    state = record.state
    span = state.temperature_range
    content = {
        "tool": record.tool,
        "inputs": dict(record.inputs),
        "state": {
            "coefficients": state.coefficients,
            "covariance": state.covariance,
            "per_degC": 100.0,
            "reference_temperature_degC": state.reference_temperature,
            "temperature_range_degC": None if span is None else list(span),
        },
        "stations": {
            **{name: getattr(record, own) for own, name in _COLUMNS.items()},
            "observable": list(record.observable),
        },
    }
    json_codec.store(content, path, "scale", 3)


def read_scale(path: str | Path) -> ScaleRecord:
    """Read scale.json.

    Raises
    ------
    FileError
        Not such a file, a later version, a value out of place, with its JSON path.
    """
    content = json_codec.stored(path, "scale", 3)
    state, observable = ("state", "observable") if content["version"] > 2 else ("belief", "learnt")
    belief: dict[str, Any] = content[state]
    stations: dict[str, Any] = content["stations"]
    size = len(stations["md_m"])
    for name, values in stations.items():
        if len(values) != size:
            raise in_file(wrong_shape(f"$.stations.{name}", f"({len(values)},)", f"({size},)"), path)
    span = belief["temperature_range_degC"]
    try:
        mean, spread = np.array(belief["coefficients"]), np.array(belief["covariance"])
        if content["version"] == 1:  # what had wandered by the end of that run is part of the scale factor
            value, variance, _ = belief["wandered"]
            one = np.eye(len(mean))[0]
            mean, spread = mean + value * one, spread + variance * np.outer(one, one)
        known = ScaleState(
            mean, spread, belief["reference_temperature_degC"], None if span is None else (span[0], span[1])
        )
    except InputError as error:
        raise in_file(error, path) from None
    except ValueError as error:
        raise FileError(Finding("file-format", {"format": f"$.{state}", "reason": str(error)}), path=path) from None
    columns = {own: frozen(stations[name]) for own, name in _COLUMNS.items()}
    learnt, inputs = tuple(stations[observable]), content["inputs"]
    return ScaleRecord(tool=content["tool"], state=known, observable=learnt, inputs=inputs, **columns)
