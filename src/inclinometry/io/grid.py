"""Map grids through pyproj, offline: where grid north points and how long a grid metre is."""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array, within
from inclinometry.core.errors import InputError

if TYPE_CHECKING:
    from pyproj import CRS


LARGEST_SCALE: Final = 100.0
"""A point drawn larger than this is where the projection runs to infinity."""


class Grid(NamedTuple):
    """At points of shape (...): convergence, rad, positive where grid north is east of true; scale along grid north."""

    convergence: Array
    scale: Array


def grid_convergence(crs: str, latitude: ArrayLike, longitude: ArrayLike) -> Grid:
    """Convergence and scale factor of a map grid.

    Parameters
    ----------
    crs : str
        The grid as PROJ knows it: "EPSG:32632", WKT, a PROJ string.
    latitude, longitude : (...) array_like
        Geodetic, rad, in the grid's own datum. That of another datum, some hundred metres off, changes the convergence
        by some thousandths of a degree.

    Returns
    -------
    Grid
        Convergence, rad, to be subtracted from true azimuths; scale, grid length over true length along the meridian.

    Raises
    ------
    InputError
        An unknown crs, one that is no map grid, a point the grid cannot show.

    Notes
    -----
    PROJ's factors of the projection. For a transverse Mercator on a sphere tan(convergence) = tan(d) sin(latitude), d
    being the longitude from the central meridian; on the ellipsoid it differs by some 1e-4 deg within a UTM zone.

    Examples
    --------
    One degree east of the central meridian of UTM zone 32:

    >>> found = grid_convergence("EPSG:32632", np.radians(60.0), np.radians(10.0))
    >>> np.degrees(found.convergence).round(4), found.scale.round(6)
    (np.float64(0.866), np.float64(0.999638))
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
    good = np.isfinite(convergence) & (scale < LARGEST_SCALE)
    if not good.all():
        where = tuple(np.argwhere(~good)[0])
        place = f"latitude {np.degrees(phi[where]):.6g}, longitude {np.degrees(lam[where]):.6g} deg"
        raise InputError(f"{crs} cannot show {place}; check the zone of the grid and the sign of the longitude")
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
            raise InputError(f'crs {crs!r} is not known; write it as in crs = "EPSG:32632"') from None
    if not found.is_projected:
        raise InputError(f"crs {crs!r} ({found.name}) is no map grid and has no grid north; name a projected one")
    return found


def out_of_area(crs: str, latitude: float, longitude: float) -> str | None:
    """A sentence when a point, rad, lies outside the area a grid is made for; None when it lies inside.

    Examples
    --------
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
    reach = f"latitude {area.south:g} to {area.north:g}, longitude {west:g} to {east:g} deg"
    return f"the site is outside the area of {crs} ({reach}): check the zone of the grid and the signs of the position"
