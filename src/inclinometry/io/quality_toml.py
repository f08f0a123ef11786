"""Fixed limits of |g|, |b| and dip, as data: shipped under a name with their source, or read from a file."""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path

import numpy as np

from inclinometry.core.errors import FileError, InputError
from inclinometry.io import _toml
from inclinometry.survey.quality import FieldLimits

_FOLDER = "quality_limits"

# key -> highest value; the lowest is a limit too small for any sensor, given by mistake of unit
_NUMBERS = {"g_m_s2": (1e-5, 1.0), "b_nT": (1.0, 1e4), "dip_deg": (1e-3, 45.0)}


def quality_limit_names() -> tuple[str, ...]:
    """Names of the limits shipped with the package.

    Examples
    --------
    >>> "iscwsa-ebook" in quality_limit_names()
    True
    """
    folder = files("inclinometry.io").joinpath(_FOLDER)
    return tuple(sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml")))


def read_quality_limits(name_or_path: str | Path) -> FieldLimits:
    """Fixed limits by the name of a preset, or from a TOML file.

    Keys: `source` (required), `g_m_s2`, `b_nT`, `dip_deg` (at least one).

    Raises
    ------
    InputError
        A name that is neither a preset nor a file; lists the presets.
    FileError
        Wrong syntax, an unknown key, a value out of range, no source, no limit.

    Examples
    --------
    >>> limits = read_quality_limits("iscwsa-ebook")
    >>> limits.g, limits.b, round(float(np.degrees(limits.dip)), 9)
    (None, 300.0, 0.25)
    """
    if str(name_or_path) in quality_limit_names():
        with as_file(files("inclinometry.io").joinpath(_FOLDER, f"{name_or_path}.toml")) as path:
            return _read(path)
    path = Path(name_or_path)
    if path.suffix != ".toml" and not path.is_file():
        names = ", ".join(quality_limit_names())
        raise InputError(f"limits {str(name_or_path)!r} are neither a file nor one of the presets: {names}")
    return _read(path)


def _read(path: Path) -> FieldLimits:
    settings = _toml.load(path, ("source", *_NUMBERS))
    source = settings.text("source")
    if source is None:
        raise FileError("key 'source' is missing; name the document the figures come from", path=path)
    values = {key: settings.number(key, *bounds) for key, bounds in _NUMBERS.items()}
    if all(value is None for value in values.values()):
        raise FileError(f"there is no limit; give at least one of {', '.join(_NUMBERS)}", path=path)
    dip = values["dip_deg"]
    return FieldLimits(
        path.stem, source, values["g_m_s2"], values["b_nT"], None if dip is None else float(np.radians(dip))
    )
