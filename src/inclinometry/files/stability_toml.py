"""stability.toml: what the sensors of a tool move by in a year after their calibration."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

import numpy as np

from inclinometry.files import toml_keys
from inclinometry.files.writing import write_text
from inclinometry.stability import Stability

# key -> name in Stability, largest, unit of the file in SI
_KEYS: Final = {
    "accelerometer_offset_m_s2": ("accelerometer_offset", 1.0, 1.0),
    "accelerometer_scale": ("accelerometer_scale", 0.1, 1.0),
    "accelerometer_axis_deg": ("accelerometer_axis", 5.0, float(np.radians(1.0))),
    "magnetometer_offset_nT": ("magnetometer_offset", 1e4, 1.0),
    "magnetometer_scale": ("magnetometer_scale", 0.1, 1.0),
    "magnetometer_axis_deg": ("magnetometer_axis", 5.0, float(np.radians(1.0))),
}


def read_stability(path: str | Path) -> Stability:
    """Read a tool's stability: standard deviations after one year, and their `source`; the axes' may be missing (0)."""
    settings = toml_keys.load(path, (*_KEYS, "source"))
    values: dict[str, float] = {}
    for key, (name, most, unit) in _KEYS.items():
        value = settings.number(key, 0.0, most)
        if value is None and not key.endswith("_axis_deg"):
            raise settings.missing(key)
        values[name] = (value or 0.0) * unit
    source = settings.text("source")
    if source is None:
        raise settings.missing("source")
    return Stability(**values, source=source)


def write_stability(stability: Stability, path: str | Path) -> None:
    """Write what `read_stability` reads."""
    lines = [f"{key} = {getattr(stability, name) / unit:.6g}" for key, (name, _, unit) in _KEYS.items()]
    source = json.dumps(stability.source, ensure_ascii=False)  # TOML escapes as JSON does
    write_text("\n".join(["# standard deviations after one year", *lines, f"source = {source}"]) + "\n", path)
