"""allan.json, the noise of every channel; and the units in which noise is shown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.allan import ChannelNoise, Coefficient, NoiseRecord
from inclinometry.files import json_codec

COEFFICIENTS = ("angle_random_walk", "bias_instability", "rate_random_walk")
"""What every record states, by the names of `NoiseModel`."""
VERSION: Final = 2
_DEG = 180.0 / np.pi


@dataclass(frozen=True)
class PlottedCurve:
    """A quantity as people read it: its name in files, title, unit, and the factor from the unit inside."""

    key: str
    title: str
    unit: str
    factor: float


_GYRO = (
    PlottedCurve("arw_deg_sqrt_h", "angle random walk", "deg/√h", _DEG * 60.0),
    PlottedCurve("bias_instability_deg_h", "bias instability", "deg/h", _DEG * 3600.0),
    PlottedCurve("rate_random_walk_deg_h_sqrt_h", "rate random walk", "deg/h/√h", _DEG * 3600.0 * 60.0),
    PlottedCurve("deviation_deg_h", "Allan deviation", "deg/h", _DEG * 3600.0),
)
_ACCELEROMETER = (
    PlottedCurve("velocity_random_walk_m_s_sqrt_h", "velocity random walk", "m/s/√h", 60.0),
    PlottedCurve("bias_instability_m_s2", "bias instability", "m/s²", 1.0),
    PlottedCurve("acceleration_random_walk_m_s2_sqrt_h", "acceleration random walk", "m/s²/√h", 60.0),
    PlottedCurve("deviation_m_s2", "Allan deviation", "m/s²", 1.0),
)


def units_of(channel: ChannelNoise) -> tuple[PlottedCurve, ...]:
    """How the coefficients of a channel, in the order of `COEFFICIENTS`, and its Allan deviation are shown.

    Deg and hours for rates, metres and hours for accelerations, else the units of the signal.
    """
    if channel.unit == "rad/s":
        return _GYRO
    if channel.unit == "m/s^2":
        return _ACCELEROMETER
    unit = channel.unit
    label = unit.replace("/", "_").replace("^", "")
    return (
        PlottedCurve(f"white_noise_{label}_sqrt_s", "white noise", f"{unit}·√s", 1.0),
        PlottedCurve(f"bias_instability_{label}", "bias instability", unit, 1.0),
        PlottedCurve(f"random_walk_{label}_per_sqrt_s", "random walk", f"{unit}/√s", 1.0),
        PlottedCurve(f"deviation_{label}", "Allan deviation", unit, 1.0),
    )


def coefficients_of(channel: ChannelNoise) -> list[tuple[PlottedCurve, Coefficient]]:
    """The three coefficients with how each is shown."""
    found = [getattr(channel.model, name) for name in COEFFICIENTS]
    return list(zip(units_of(channel)[:3], found, strict=True))


def allan_content(record: NoiseRecord) -> dict[str, Any]:
    """What `write_allan` writes, as plain mappings, lists and arrays; null where the record is too short to tell."""
    return {
        "schema": "inclinometry/allan",
        "version": VERSION,
        "inputs": dict(record.inputs),
        "sampling_interval_s": record.dt,
        "samples": record.samples,
        "channels": [_channel_content(channel) for channel in record.channels],
        "findings": [one.stored() for one in record.findings],
    }


def _channel_content(channel: ChannelNoise) -> dict[str, Any]:
    shown = units_of(channel)[-1]
    content: dict[str, Any] = {
        "channel": channel.name,
        "kind": channel.kind,
        "tau_s": channel.curve.tau,
        shown.key: shown.factor * channel.curve.deviation,
        f"u_{shown.key}": shown.factor * channel.curve.u,
        "chi_square": channel.model.chi_square,
        "degrees_of_freedom": channel.model.dof,
    }
    for unit, found in coefficients_of(channel):
        content[unit.key] = unit.factor * found.value if found.seen else None
        content[f"u_{unit.key}"] = unit.factor * found.u if found.seen else None
        content[f"limit_{unit.key}"] = unit.factor * found.limit
    return content


def write_allan(record: NoiseRecord, path: str | Path) -> None:
    """Write allan.json: the same record gives the same bytes. FileError where it cannot be written."""
    json_codec.store(allan_content(record), path, "allan", VERSION)


def read_allan(path: str | Path) -> Mapping[str, Any]:
    """The content of an allan.json, checked.

    Raises
    ------
    FileError
        Not JSON, another kind of file, a newer version, or content the schema refuses.
    """
    return json_codec.stored(path, "allan", VERSION)
