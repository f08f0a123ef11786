"""The reference field of a place, and what a site lacks filled from models: each value with where it comes from."""

from __future__ import annotations

import datetime
from dataclasses import replace

import numpy as np

from inclinometry.earth.magnetic import MagneticField, Model, complete_site, decimal_year, igrf14, wmm2025
from inclinometry.earth.site import Site
from inclinometry.errors import InputError
from inclinometry.files.site_toml import grid_convergence, out_of_area
from inclinometry.rotations import wrap_signed


def field_at(
    latitude: float,
    longitude: float,
    height_m: float,
    date: datetime.date | float,
    model: Model | None = None,
    crs: str | None = None,
) -> tuple[Site, MagneticField, float | None, list[str]]:
    """Reference fields of a place.

    Parameters
    ----------
    latitude, longitude : float
        Geodetic, rad.
    height_m : float
        Above the ellipsoid, m, -12000 to 20000.
    date : datetime.date or float
        Date, or decimal year.
    model : callable, optional
        `wmm2025` or `igrf14`; the one for the date (`model_of`) when not given.
    crs : str, optional
        Grid, e.g. "EPSG:32632".

    Returns
    -------
    Site, MagneticField, float or None, list of str
        The site with gravity and, where a grid was named, its convergence; the field; the grid's scale factor;
        sentences on what is remarkable.

    Raises
    ------
    InputError
        A value out of range, a date the model does not cover, a crs that is not known.

    Examples
    --------
    >>> site, *_ = field_at(np.radians(60.0), np.radians(10.0), 0.0, 2026.0, crs="EPSG:32632")
    >>> np.degrees(site.convergence).round(3), round(site.gravity, 5)
    (np.float64(0.866), 9.81918)
    """
    site = Site(latitude=latitude, longitude=longitude, height_m=height_m, crs=crs)
    found = (model or model_of(date))(latitude, longitude, height_m, date)
    notes = _weak(float(found.horizontal), float(found.declination_sigma))
    if crs is None:
        return site, found, None, notes
    grid = grid_convergence(crs, latitude, longitude)
    notes += _outside(site)
    return replace(site, convergence=float(grid.convergence)), found, float(grid.scale), notes


def model_of(date: datetime.date | float) -> Model:
    """The model for a date or decimal year: WMM2025 from 2025 on, IGRF-14, definitive in its past, before.

    Examples
    --------
    >>> model_of(datetime.date(2018, 5, 1)) is igrf14
    True
    """
    year = decimal_year(date) if isinstance(date, datetime.date) else date
    wmm_from = 2025.0
    return wmm2025 if year >= wmm_from else igrf14


def completed(site: Site) -> tuple[Site, list[str]]:
    """The site with b, dip, declination and convergence filled where it lacks them, and sentences with the sources.

    Stated values stay, with their own sigmas. The field needs latitude, longitude and date, the convergence latitude,
    longitude and crs. A stated convergence that is not that of the crs gets a sentence.
    """
    site, said = _with_field(site)
    site, more = _with_convergence(site)
    return site, said + more


def _with_field(site: Site) -> tuple[Site, list[str]]:
    lacking = [name for name in ("b", "dip", "declination") if getattr(site, name) is None]
    unknown = [name for name in ("latitude", "longitude", "date") if getattr(site, name) is None]
    if not lacking:
        return site, []
    if site.date is None or unknown:
        # a latitude alone serves gravity and gyros: that the field is unknown is then no surprise
        said = f"{', '.join(lacking)} unknown: a model needs the site's {' and '.join(unknown)} too"
        return site, [said] if len(unknown) == 1 else []
    done = complete_site(site, model_of(site.date))
    said = f"{', '.join(_shown(done, name) for name in lacking)} from {done.origin(lacking[0])} at {site.date}"
    said += "" if site.height_m is not None else ", height taken as 0 m"
    notes = []
    if "declination" in lacking and done.b is not None and done.dip is not None:
        notes = _weak(done.b * float(np.cos(done.dip)), done.declination_sigma or 0.0)
    return done, [said, *notes]


def _with_convergence(site: Site) -> tuple[Site, list[str]]:
    if site.crs is None or site.origin("convergence") == site.crs:
        return site, []
    if site.convergence is not None:
        # a sentence where the convergence stated is not the grid's, or is the grid's with the other sign
        if site.latitude is None or site.longitude is None:
            return site, []
        said = f"convergence {np.degrees(site.convergence):.3f} deg is stated"
        try:
            grid = float(grid_convergence(site.crs, site.latitude, site.longitude).convergence)
        except InputError as error:
            return site, [f"{said} and used, unchecked: {error}"]
        apart, mirrored = (abs(float(np.degrees(wrap_signed(c - grid)))) for c in (site.convergence, -site.convergence))
        # deg: rounding and the place of the origin change a convergence by less than 0.05, along a well by less than
        # 0.2
        flipped = apart > 0.05 and mirrored <= 0.05
        if not flipped and apart <= 0.2:
            return site, []
        said += f", {site.crs} gives {np.degrees(grid):.3f} deg at the site"
        if flipped:
            return site, [
                f"{said}: the sign is opposite; positive is grid north east of true north. The one stated is used"
            ]
        return site, [f"{said}: correct the convergence, the place or the crs. The one stated is used"]
    if site.latitude is None or site.longitude is None:
        return site, [f"convergence unknown: {site.crs} gives it only with the site's latitude and longitude"]
    convergence = float(grid_convergence(site.crs, site.latitude, site.longitude).convergence)
    # geometry: its uncertainty is that of the position, far below any azimuth's
    origins = (*site.origins, ("convergence", site.crs))
    done = replace(site, convergence=convergence, convergence_sigma=0.0, origins=origins)
    return done, [f"{_shown(done, 'convergence')} from {site.crs}", *_outside(done)]


def declination_doubts(site: Site) -> list[str]:
    """A sentence where the declination stated is not that of the model at the place: a wrong sign, above all."""
    if site.declination is None or site.origin("declination") != "given" or site.date is None:
        return []
    if site.latitude is None or site.longitude is None:
        return []
    try:
        found = model_of(site.date)(site.latitude, site.longitude, site.height_m or 0.0, site.date)
    except InputError:
        return []  # a date that no model covers: nothing to compare it with
    expected, sigma = float(found.declination), float(found.declination_sigma)
    away = abs(float(wrap_signed(site.declination - expected)))
    if away <= max(3.0 * sigma, np.radians(1.0)):
        return []
    turned = abs(float(wrap_signed(-site.declination - expected))) < 0.5 * away
    doubt = "; its sign looks wrong (east is positive)" if turned else "; check it"
    return [
        f"the site's declination is {np.degrees(site.declination):+.2f} deg, {found.model} gives "
        f"{np.degrees(expected):+.2f} ± {np.degrees(sigma):.2f} deg there{doubt}"
    ]


def _shown(site: Site, name: str) -> str:
    value, sigma = getattr(site, name), getattr(site, f"{name}_sigma")
    if name == "b":
        return f"b {value:.1f} ± {sigma:.0f} nT"
    return f"{name} {np.degrees(value):.3f}" + (f" ± {np.degrees(sigma):.2f} deg" if sigma else " deg")


def _weak(horizontal: float, sigma: float) -> list[str]:
    """A sentence where the horizontal field is too weak for a compass."""
    weak, weakest = 6000.0, 2000.0  # nT, the WMM's own limits: caution zone and blackout zone
    if horizontal >= weak:
        return []
    zone = "blackout" if horizontal < weakest else "caution"
    return [
        f"the horizontal field is {horizontal:.0f} nT ({zone} zone of the WMM, below {weak:.0f} nT): the declination "
        f"is known to {np.degrees(sigma):.1f} deg only; prefer a gyro or in-field referencing"
    ]


def _outside(site: Site) -> list[str]:
    if site.crs is None or site.latitude is None or site.longitude is None:
        return []
    said = out_of_area(site.crs, site.latitude, site.longitude)
    return [] if said is None else [str(said)]
