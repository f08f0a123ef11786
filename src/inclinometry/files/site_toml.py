"""site.toml: where the survey is and what its fields should be, in degrees and nT; grid convergence by its crs."""

from __future__ import annotations

import datetime
import math
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, within
from inclinometry.earth.site import REFERENCES, Site
from inclinometry.errors import FileError, InputError, in_file, refused, wrong_kind
from inclinometry.files import toml_keys
from inclinometry.findings import Finding

if TYPE_CHECKING:
    from pyproj import CRS


class Grid(NamedTuple):
    """At points of shape (...): convergence, rad, positive where grid north is east of true; scale along grid north."""

    convergence: Array
    scale: Array


def grid_convergence(crs: str, latitude: ArrayLike, longitude: ArrayLike) -> Grid:
    """Convergence, rad, and scale of the map grid `crs` (as PROJ knows it) at geodetic points, rad, in its own datum.

    The convergence is subtracted from true azimuths; another datum, some hundred metres off, changes it by
    thousandths of a degree. The scale is grid over true length along the meridian. Transverse Mercator on a sphere:
    tan(convergence) = tan(d) sin(latitude), d the longitude from the central meridian; on the ellipsoid it differs by
    some 1e-4 deg within a UTM zone.
    """
    from pyproj import Proj

    phi = within(latitude, "latitude", -np.pi / 2, np.pi / 2, "rad")
    lam = within(longitude, "longitude", -np.pi, 2.0 * np.pi, "rad")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        phi, lam = np.broadcast_arrays(phi, lam)
        factors = Proj(map_grid(crs)).get_factors(lam, phi, radians=True, errcheck=False)
    convergence, scale = np.radians(factors.meridian_convergence), np.asarray(factors.meridional_scale)
    # where a projection runs to infinity PROJ may still give a number
    good = np.isfinite(convergence) & (scale < 100.0)
    if not good.all():
        where = tuple(np.argwhere(~good)[0])
        place = {"latitude_deg": math.degrees(phi[where]), "longitude_deg": math.degrees(lam[where])}
        raise refused("record-grid-point", {"grid": crs, **place})
    return Grid(np.asarray(convergence), scale)


def map_grid(crs: str) -> CRS:
    """The coordinate reference system of a name.

    Raises
    ------
    InputError
        PROJ does not know it, or it has no map grid (latitude and longitude, earth-centred).
    """
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    with warnings.catch_warnings():
        # hints on deprecated spellings, which still work
        warnings.simplefilter("ignore")
        try:
            found = CRS.from_user_input(crs)
        except CRSError:
            raise refused("record-grid-unknown", {"grid": crs}) from None
    if not found.is_projected:
        raise refused("record-grid-unknown", {"grid": f"{crs} ({found.name})"})
    return found


def out_of_area(crs: str, latitude: float, longitude: float) -> Finding | None:
    """What to say when a point, rad, lies outside the area a grid is made for; None when it lies inside.

    >>> out_of_area("EPSG:32632", np.radians(60.0), np.radians(10.0)) is None
    True
    """
    area: Any = map_grid(crs).area_of_use
    if area is None:
        return None
    lat, lon = math.degrees(latitude), math.degrees(longitude)
    west, east = area.west, area.east
    # an area may reach over the 180th meridian
    inside = (lon - west) % 360.0 <= ((east - west) % 360.0 or 360.0) and area.south <= lat <= area.north
    if inside:
        return None
    reach = {"south_deg": area.south, "north_deg": area.north, "west_deg": west, "east_deg": east}
    return Finding("record-grid-outside", {"grid": crs, **reach})


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
    settings = toml_keys.load(path, (*_NUMBERS, "date", "north_reference", "crs"))
    values: dict[str, Any] = {}
    for key, (name, low, high) in _NUMBERS.items():
        value = settings.number(key, low, high)
        values[name] = float(np.radians(value)) if value is not None and key.endswith("_deg") else value
    reference = settings.text("north_reference", REFERENCES)
    for key, (name, _, _) in _NUMBERS.items():
        if name.endswith("_sigma") and values[name] is not None and values[name.removesuffix("_sigma")] is None:
            lacking = (key.removeprefix("sigma_"),)
            raise FileError(Finding("input-needs", {"name": key, "needed": lacking}), path=path)
    crs = settings.text("crs")
    try:
        if crs is not None:
            map_grid(crs)
        return Site(date=_date(settings), north_reference=reference or "magnetic", crs=crs, **values)
    except FileError:
        raise
    except InputError as error:
        raise in_file(error, path) from None


def _date(settings: toml_keys.Settings) -> datetime.date | None:
    value = settings.content.get("date")
    if isinstance(value, datetime.datetime):
        return value.date()
    if value is None or isinstance(value, datetime.date):
        return value
    try:
        return datetime.date.fromisoformat(value)
    except (TypeError, ValueError):
        raise in_file(wrong_kind("date", f"{value!r:.60}", "date YYYY-MM-DD"), settings.path) from None
