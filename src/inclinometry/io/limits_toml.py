"""Limits of a verification, as data: shipped under a name with their source, or read from a file."""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path

import numpy as np

from inclinometry.calibration.acceptance import Limits
from inclinometry.core.errors import FileError, InputError
from inclinometry.io import _toml

GUARDS = ("none", "expanded-uncertainty")
_KEYS = ("source", "inclination_deg", "azimuth_deg", "toolface_deg", "min_inclination_deg_for_azimuth", "guard")


def limit_names() -> tuple[str, ...]:
    """Names of the limits shipped with the package.

    Examples
    --------
    >>> limit_names()
    ('rogatykh-2018-fluxgate', 'rogatykh-2018-magnetoresistive')
    """
    folder = files("inclinometry.io").joinpath("limits")
    return tuple(sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml")))


def read_limits(name_or_path: str | Path) -> Limits:
    """Limits by the name of a preset, or from a TOML file.

    Keys: `source` (required), `inclination_deg`, `azimuth_deg`, `toolface_deg` (at least one),
    `min_inclination_deg_for_azimuth` (0), `guard` ("none" or "expanded-uncertainty").

    Raises
    ------
    InputError
        A name that is neither a preset nor a file; lists the presets.
    FileError
        Wrong syntax, an unknown key, a value out of range, no source, no limit.

    Examples
    --------
    >>> round(float(np.degrees(read_limits("rogatykh-2018-fluxgate").azimuth)), 9)
    2.0
    """
    if str(name_or_path) in limit_names():
        with as_file(files("inclinometry.io").joinpath("limits", f"{name_or_path}.toml")) as path:
            return _read(path)
    path = Path(name_or_path)
    if path.suffix == "" and len(path.parts) <= 1:
        try:
            known = path.exists()
        except (OSError, ValueError):
            known = False
        if not known:
            names = ", ".join(limit_names())
            raise InputError(f"limits {str(name_or_path)!r} are neither a file nor one of the presets: {names}")
    return _read(path)


def _read(path: Path) -> Limits:
    settings = _toml.load(path, _KEYS)
    source = settings.text("source")
    if source is None:
        raise FileError("key 'source' is missing; name the document the figures come from", path=path)
    found = {key: settings.number(f"{key}_deg", 0.0, 180.0) for key in ("inclination", "azimuth", "toolface")}
    zero = next((key for key, value in found.items() if value == 0.0), None)
    if zero is not None or all(value is None for value in found.values()):
        problem = (
            f"{zero}_deg is 0; a limit is positive" if zero else "there is no limit; give at least inclination_deg"
        )
        raise FileError(problem, path=path)
    limits = {key: None if value is None else float(np.radians(value)) for key, value in found.items()}
    lowest = settings.number("min_inclination_deg_for_azimuth", 0.0, 90.0) or 0.0
    guard = settings.text("guard", GUARDS) or "none"
    return Limits(
        path.stem,
        source,
        limits["inclination"],
        limits["azimuth"],
        limits["toolface"],
        float(np.radians(lowest)),
        guard,
    )
