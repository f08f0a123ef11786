"""Limits as data: presets shipped under a name with their source, or a TOML file of one's own."""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path
from typing import Final

import numpy as np

from inclinometry.calibration.decision import GUARDS, Limits
from inclinometry.errors import FileError, not_among
from inclinometry.files import toml_keys
from inclinometry.findings import Finding
from inclinometry.survey.gyro import RepeatLimits
from inclinometry.survey.quality import FieldLimits

GYRO_REPEAT: Final = "gyro-repeat"
"""Name of the shipped limits of in-run against out-run."""
_ANGLES: Final = {f"{name}_deg": (0.0, 180.0) for name in ("inclination", "azimuth", "toolface")}
# from a value too small for any sensor, given by mistake of unit, to the highest
_FIELDS: Final = {"g_m_s2": (1e-5, 1.0), "b_nT": (1.0, 1e4), "dip_deg": (1e-3, 45.0)}
_REPEATS: Final = {
    "inclination_deg": (1e-6, 180.0),
    "azimuth_deg": (1e-6, 180.0),
    "azimuth_steep_deg": (1e-6, 180.0),
    "steep_below_deg": (0.0, 90.0),
    "stations": (1.0, 1e6),
    "interval_m": (0.0, 1e4),
}


def limit_names(folder: str = "limits") -> tuple[str, ...]:
    """Names of the presets of a kind: "limits" of verifications, "quality_limits" of fields, "repeat_limits" of runs.

    >>> limit_names(), limit_names("repeat_limits")
    (('rogatykh-2018-fluxgate', 'rogatykh-2018-magnetoresistive'), ('gyro-repeat',))
    """
    found = (entry.name for entry in files("inclinometry.files").joinpath(folder).iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in found if name.endswith(".toml")))


def read_limits(name_or_path: str | Path) -> Limits:
    """Limits of a verification, by the name of a preset or from a TOML file.

    Keys: `source` (required), `inclination_deg`, `azimuth_deg`, `toolface_deg` (at least one),
    `min_inclination_deg_for_azimuth` (0), `guard` ("none" or "expanded-uncertainty").
    """
    keys = {**_ANGLES, "min_inclination_deg_for_azimuth": (0.0, 90.0)}
    settings, source, values = _read("limits", name_or_path, keys, ("guard",))
    lowest = values.pop("min_inclination_deg_for_azimuth", 0.0)
    if zero := [key for key, value in values.items() if value == 0.0]:
        wrong = Finding("input-value", {"name": zero[0], "value": 0.0, "allowed": "> 0"})
        raise FileError(wrong, path=settings.path)
    if not values:
        raise FileError(Finding("file-limits", {"names": tuple(_ANGLES)}), path=settings.path)
    inclination, azimuth, toolface = (values.get(key) for key in _ANGLES)
    guard = settings.text("guard", GUARDS) or "none"
    return Limits(Path(settings.path).stem, source, inclination, azimuth, toolface, lowest, guard)


def read_quality_limits(name_or_path: str | Path) -> FieldLimits:
    """Fixed limits of |g|, |b| and dip, as `read_limits`. Keys: `source`, `g_m_s2`, `b_nT`, `dip_deg`."""
    settings, source, values = _read("quality_limits", name_or_path, _FIELDS)
    if not values:
        raise FileError(Finding("file-limits", {"names": tuple(_FIELDS)}), path=settings.path)
    return FieldLimits(Path(settings.path).stem, source, *map(values.get, _FIELDS))


def read_repeat_limits(name_or_path: str | Path = GYRO_REPEAT) -> RepeatLimits:
    """Limits of a comparison of two runs, as `read_limits`.

    Keys, all required: `source`, `inclination_deg`, `azimuth_deg`, `azimuth_steep_deg` (holds below the inclination
    `steep_below_deg`), `stations` (fewest compared), `interval_m` (longest distance interpolated over).
    """
    settings, source, values = _read("repeat_limits", name_or_path, _REPEATS)
    if missing := [key for key in _REPEATS if key not in values]:
        raise FileError(Finding("input-missing", {"names": tuple(missing)}), path=settings.path)
    inclination, azimuth, steep, below, stations, interval = (values[key] for key in _REPEATS)
    if stations % 1.0:
        kind = Finding("input-kind", {"name": "stations", "value": stations, "expected": "whole number"})
        raise FileError(kind, path=settings.path)
    name = Path(settings.path).stem
    return RepeatLimits(name, source, inclination, azimuth, steep, below, int(stations), interval)


def _read(
    folder: str, name_or_path: str | Path, numbers: dict[str, tuple[float, float]], texts: tuple[str, ...] = ()
) -> tuple[toml_keys.Settings, str, dict[str, float]]:
    """The file, its source and the numbers that it has; angles in rad."""
    name, path = str(name_or_path), Path(name_or_path)
    if name in limit_names(folder):
        with as_file(files("inclinometry.files").joinpath(folder, f"{name}.toml")) as shipped:
            settings = toml_keys.load(shipped, ("source", *numbers, *texts))
    elif path.suffix == "" and len(path.parts) <= 1 and not _exists(path):
        raise not_among("limits", name, (*limit_names(folder), "*.toml"))
    else:
        settings = toml_keys.load(path, ("source", *numbers, *texts))
    source = settings.text("source")
    if source is None:
        raise FileError(Finding("input-missing", {"names": ("source",)}), path=path)
    given = {key: settings.number(key, *bounds) for key, bounds in numbers.items()}
    stated = {key: value for key, value in given.items() if value is not None}
    return settings, source, {k: float(np.radians(v)) if "_deg" in k else v for k, v in stated.items()}


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):
        return False
