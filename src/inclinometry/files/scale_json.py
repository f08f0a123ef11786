"""scale.json: what a run has taught of the gyro's scale factor, kept beside the tool and offered to the next run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from inclinometry.arrays import Array, frozen
from inclinometry.errors import FileError, InputError
from inclinometry.files import json_codec
from inclinometry.files.writing import write_bytes
from inclinometry.gyro.tracking import ScaleBelief


@dataclass(frozen=True, eq=False)
class ScaleRecord:
    """The scale factor of one run.

    tool : name of the calibrated tool, "" without one.
    belief : what is known after the run.
    md, temperature, expected, expected_sd, scale, scale_sd : (n,) stations, in the order measured.
    learnt : (n,) of bool
    inputs : name -> digest.
    """

    tool: str
    belief: ScaleBelief
    md: Array
    temperature: Array
    expected: Array
    expected_sd: Array
    scale: Array
    scale_sd: Array
    learnt: tuple[bool, ...]
    inputs: Mapping[str, str]


_COLUMNS = ("md", "temperature", "expected", "expected_sd", "scale", "scale_sd")
_NAMES = ("md_m", "temperature_degC", "expected", "u_expected", "scale", "u_scale")


def write_scale(record: ScaleRecord, path: str | Path) -> None:
    """Write scale.json; the same record gives the same bytes."""
    belief = record.belief
    span = belief.temperature_range
    content = {
        "schema": "inclinometry/scale",
        "version": 1,
        "tool": record.tool,
        "inputs": dict(record.inputs),
        "belief": {
            "coefficients": belief.coefficients,
            "covariance": belief.covariance,
            "per_degC": 100.0,
            "reference_temperature_degC": belief.reference_temperature,
            "temperature_range_degC": None if span is None else list(span),
            "walk_per_root_degC": belief.walk,
            "jitter": belief.jitter,
            "wandered": list(belief.stands),
        },
        "stations": {
            **{name: getattr(record, own) for name, own in zip(_NAMES, _COLUMNS, strict=True)},
            "learnt": list(record.learnt),
        },
    }
    write_bytes(json_codec.canonical(content), path)


def read_scale(path: str | Path) -> ScaleRecord:
    """Read scale.json.

    Raises
    ------
    FileError
        Not such a file, a later version, a value out of place, with its JSON path.
    """
    content = json_codec.of_kind(json_codec.load(path), path, "inclinometry/scale")
    belief: dict[str, Any] = content["belief"]
    stations: dict[str, Any] = content["stations"]
    sizes = {name: len(values) for name, values in stations.items()}
    if len(set(sizes.values())) > 1:
        raise FileError(f"$.stations has columns of different lengths: {sizes}", path=path)
    span = belief["temperature_range_degC"]
    try:
        known = ScaleBelief(
            np.array(belief["coefficients"]),
            np.array(belief["covariance"]),
            belief["walk_per_root_degC"],
            belief["jitter"],
            belief["reference_temperature_degC"],
            tuple(belief["wandered"]),
            None if span is None else (span[0], span[1]),
        )
    except (InputError, ValueError) as error:
        raise FileError(f"$.belief: {error}", path=path) from None
    columns = {own: frozen(stations[name]) for name, own in zip(_NAMES, _COLUMNS, strict=True)}
    learnt, inputs = tuple(stations["learnt"]), content["inputs"]
    return ScaleRecord(tool=content["tool"], belief=known, learnt=learnt, inputs=inputs, **columns)
