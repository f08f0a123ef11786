"""The reference field of a place, and what a site lacks filled from models: each value with where it comes from."""

from __future__ import annotations

import datetime
from dataclasses import replace

import numpy as np

from inclinometry.earth.magnetic import MagneticField, Model, complete_site, decimal_year, igrf14, wmm2025
from inclinometry.earth.site import Site
from inclinometry.errors import InputError
from inclinometry.files.site_toml import grid_convergence, out_of_area
from inclinometry.findings import Finding, Value
from inclinometry.rotations import wrap_signed


def field_at(
    latitude: float,
    longitude: float,
    height_m: float,
    date: datetime.date | float,
    model: Model | None = None,
    crs: str | None = None,
) -> tuple[Site, MagneticField, float | None, list[Finding]]:
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
        `wmm2025` or `igrf14`. Default: the one for the date (`model_of`).
    crs : str, optional
        Grid, e.g. "EPSG:32632".

    Returns
    -------
    Site, MagneticField, float or None, list of Finding
        The site with gravity and, where a grid was named, its convergence; the field; the grid's scale factor; what is
        remarkable.

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


def completed(site: Site) -> tuple[Site, list[Finding]]:
    """The site with b, dip, declination and convergence filled where it lacks them, and the sources.

    Stated values stay, with their own sigmas. The field needs latitude, longitude and date, the convergence latitude,
    longitude and crs. A stated convergence that is not that of the crs is found.
    """
    site, said = _with_field(site)
    site, more = _with_convergence(site)
    return site, said + more


def _with_field(site: Site) -> tuple[Site, list[Finding]]:
    lacking = [name for name in ("b", "dip", "declination") if getattr(site, name) is None]
    unknown = [name for name in ("latitude", "longitude", "date") if getattr(site, name) is None]
    if not lacking:
        return site, []
    if site.date is None or unknown:
        # a latitude alone serves gravity and gyros: that the field is unknown is then no surprise
        said = Finding("work-site-lacks", {"names": tuple(lacking), "needed": tuple(unknown)}, severity="note")
        return site, [said] if len(unknown) == 1 else []
    done = complete_site(site, model_of(site.date))
    filled: dict[str, Value] = {"names": tuple(lacking), "source": done.origin(lacking[0]) or ""}
    filled["date"] = str(site.date)
    found = [Finding("work-filled", filled, severity="note")]
    if site.height_m is None:
        height: dict[str, Value] = {"name": "height", "value": 0.0, "unit": "m", "why": "sea level"}
        found.append(Finding("work-assumed", {**height, "needed": ("height_m",)}, severity="note"))
    if "declination" in lacking and done.b is not None and done.dip is not None:
        found += _weak(done.b * float(np.cos(done.dip)), done.declination_sigma or 0.0)
    return done, found


def _with_convergence(site: Site) -> tuple[Site, list[Finding]]:
    if site.crs is None or site.origin("convergence") == site.crs:
        return site, []
    if site.convergence is not None:
        # found where the convergence stated is not the grid's, or is the grid's with the other sign
        if site.latitude is None or site.longitude is None:
            return site, []
        stated: dict[str, Value] = {"stated_deg": float(np.degrees(site.convergence)), "model": site.crs}
        try:
            grid = float(grid_convergence(site.crs, site.latitude, site.longitude).convergence)
        except InputError as error:
            stated["finding"] = error.finding
            return site, [Finding("work-convergence-unchecked", stated)]
        apart, mirrored = (abs(float(np.degrees(wrap_signed(c - grid)))) for c in (site.convergence, -site.convergence))
        # deg: rounding and the place of the origin change a convergence by less than 0.05, along a well by less than
        # 0.2
        flipped = apart > 0.05 and mirrored <= 0.05
        if not flipped and apart <= 0.2:
            return site, []
        stated |= {"name": "convergence", "model_deg": float(np.degrees(grid))}
        remedy = "positive is grid north east of true north" if flipped else "convergence, place or crs"
        return site, [Finding("work-site-angle", {**stated, "u_deg": 0.0, "remedy": remedy})]
    if site.latitude is None or site.longitude is None:
        lacking: dict[str, Value] = {"names": ("convergence",), "needed": ("latitude", "longitude")}
        return site, [Finding("work-site-lacks", lacking, severity="note")]
    convergence = float(grid_convergence(site.crs, site.latitude, site.longitude).convergence)
    # geometry: its uncertainty is that of the position, far below any azimuth's
    origins = (*site.origins, ("convergence", site.crs))
    done = replace(site, convergence=convergence, convergence_sigma=0.0, origins=origins)
    filled: dict[str, Value] = {"names": ("convergence",), "source": site.crs, "date": str(site.date or "-")}
    return done, [Finding("work-filled", filled, severity="note"), *_outside(done)]


def declination_doubts(site: Site) -> list[Finding]:
    """Whether the declination stated is not that of the model at the place: a wrong sign, above all."""
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
    values: dict[str, Value] = {"name": "declination", "model": found.model}
    values |= {"stated_deg": float(np.degrees(site.declination)), "model_deg": float(np.degrees(expected))}
    values |= {"u_deg": float(np.degrees(sigma)), "remedy": "east is positive" if turned else "declination or place"}
    return [Finding("work-site-angle", values)]


def _weak(horizontal: float, sigma: float) -> list[Finding]:
    """Whether the horizontal field is too weak for a compass: the caution zone of the WMM."""
    if horizontal >= 6000.0:
        return []
    return [Finding("work-weak-field", {"horizontal_nT": horizontal, "u_deg": float(np.degrees(sigma))})]


def _outside(site: Site) -> list[Finding]:
    if site.crs is None or site.latitude is None or site.longitude is None:
        return []
    said = out_of_area(site.crs, site.latitude, site.longitude)
    return [] if said is None else [said]
