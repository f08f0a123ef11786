"""site.toml: where the survey is and what its fields should be, in degrees and nT."""

from __future__ import annotations

import datetime
import re
from pathlib import Path
from typing import Any

import numpy as np

from inclinometry.core.errors import FileError, InputError
from inclinometry.earth.site import REFERENCES, Site
from inclinometry.io import _toml
from inclinometry.io.grid import map_grid

# key of the file -> name in Site, lowest and highest value in the file's unit
_NUMBERS = {
    "latitude_deg": ("latitude", -90.0, 90.0),
    "longitude_deg": ("longitude", -180.0, 360.0),
    "height_m": ("height_m", -12e3, 20e3),
    "declination_deg": ("declination", -180.0, 180.0),
    "convergence_deg": ("convergence", -180.0, 180.0),
    "g": ("g", 9.5, 10.1),
    "b_nT": ("b", 5e3, 2e5),
    "dip_deg": ("dip", -90.0, 90.0),
    "sigma_g": ("g_sigma", 0.0, 0.1),
    "sigma_b_nT": ("b_sigma", 0.0, 1e4),
    "sigma_dip_deg": ("dip_sigma", 0.0, 90.0),
    "sigma_latitude_deg": ("latitude_sigma", 0.0, 90.0),
    "sigma_declination_deg": ("declination_sigma", 0.0, 180.0),
    "sigma_convergence_deg": ("convergence_sigma", 0.0, 180.0),
}
_KEYS = (*_NUMBERS, "date", "north_reference", "crs")


def read_site(path: str | Path) -> Site:
    """Read a site; every key is optional.

    Keys: `latitude_deg`, `longitude_deg`, `height_m`, `date` (2024-05-01), `north_reference` ("magnetic", "true",
    "grid"), `declination_deg` (east positive), `convergence_deg` (positive where grid north is east of true), `g`
    (m/s^2), `b_nT`, `dip_deg` (positive down), their `sigma_g`, `sigma_b_nT`, `sigma_dip_deg`, `sigma_declination_deg`,
    `sigma_convergence_deg`, and `crs`, the name of the grid ("EPSG:32632"), from which `grid_convergence` gives the
    convergence.

    Raises
    ------
    FileError
        Wrong syntax, with its line; an unknown key, with the closest; a value out of range; a sigma without its value;
        a crs that is not known or no map grid.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "site.toml").write_text("dip_deg = 70.0\\nb_nT = 50_000\\n")
    ...     site = read_site(Path(folder, "site.toml"))
    >>> round(site.dip, 6), site.b
    (1.22173, 50000.0)
    """
    settings = _toml.load(path, _KEYS)
    values: dict[str, Any] = {}
    for key, (name, low, high) in _NUMBERS.items():
        value = settings.number(key, low, high)
        values[name] = float(np.radians(value)) if value is not None and key.endswith("_deg") else value
    reference = settings.text("north_reference", REFERENCES)
    try:
        crs = _crs(settings)
        return Site(date=_date(settings), north_reference=reference or "magnetic", crs=crs, **values)
    except FileError:
        raise
    except InputError as error:
        names = {name: key for key, (name, _, _) in _NUMBERS.items()}
        problem = re.sub(r"\w+", lambda word: names.get(word[0], word[0]), str(error))
        raise FileError(problem, path=path) from None


def _crs(settings: _toml.Settings) -> str | None:
    crs = settings.text("crs")
    if crs is not None:
        map_grid(crs)
    return crs


def _date(settings: _toml.Settings) -> datetime.date | None:
    value = settings.content.get("date")
    if isinstance(value, datetime.datetime):
        return value.date()
    if value is None or isinstance(value, datetime.date):
        return value
    try:
        return datetime.date.fromisoformat(value)
    except (TypeError, ValueError):
        problem = f"date is {value!r}; year, month and day are needed, as in date = 2024-05-01"
        raise FileError(problem, path=settings.path) from None
