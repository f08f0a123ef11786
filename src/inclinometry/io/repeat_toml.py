"""Limits of a comparison of two runs, as data: shipped under a name with their source, or read from a file."""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path

import numpy as np

from inclinometry.core.errors import FileError
from inclinometry.io import _toml
from inclinometry.survey.gyro_runs import RepeatLimits

GYRO_REPEAT = "gyro-repeat"
"""Name of the shipped limits of in-run against out-run."""

# key -> lowest and highest value; all are needed, nothing is guessed
_NUMBERS = {
    "inclination_deg": (1e-6, 180.0),
    "azimuth_deg": (1e-6, 180.0),
    "azimuth_steep_deg": (1e-6, 180.0),
    "steep_below_deg": (0.0, 90.0),
    "stations": (1.0, 1e6),
    "interval_m": (0.0, 1e4),
}


def read_repeat_limits(name_or_path: str | Path = GYRO_REPEAT) -> RepeatLimits:
    """Limits by the name of the preset, or from a TOML file.

    Keys, all required: `source`, `inclination_deg`, `azimuth_deg`, `azimuth_steep_deg` (holds below the inclination
    `steep_below_deg`), `stations` (fewest compared), `interval_m` (longest distance interpolated over).

    Raises
    ------
    FileError
        No such file, wrong syntax, an unknown or missing key, a value out of range.

    Examples
    --------
    >>> limits = read_repeat_limits("gyro-repeat")
    >>> round(float(np.degrees(limits.inclination)), 9), limits.stations
    (0.23, 10)
    """
    if str(name_or_path) == GYRO_REPEAT:
        with as_file(files("inclinometry.io").joinpath("repeat_limits", f"{GYRO_REPEAT}.toml")) as path:
            return _read(path)
    return _read(Path(name_or_path))


def _read(path: Path) -> RepeatLimits:
    settings = _toml.load(path, ("source", *_NUMBERS))
    source = settings.text("source")
    values = {key: settings.number(key, *bounds) for key, bounds in _NUMBERS.items()}
    missing = [key for key, value in {"source": source, **values}.items() if value is None]
    if missing or source is None:
        raise FileError(f"key {missing[0]!r} is missing; all of {', '.join(_NUMBERS)} and source are needed", path=path)
    given = {key: value for key, value in values.items() if value is not None}
    inclination, azimuth, azimuth_steep, steep = (
        float(np.radians(given[key]))
        for key in ("inclination_deg", "azimuth_deg", "azimuth_steep_deg", "steep_below_deg")
    )
    if given["stations"] % 1.0:
        raise FileError(f"stations is {given['stations']:g}; a whole number is needed", path=path)
    count = int(given["stations"])
    return RepeatLimits(path.stem, source, inclination, azimuth, azimuth_steep, steep, count, given["interval_m"])
