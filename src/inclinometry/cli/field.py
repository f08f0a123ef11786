"""Command that gives the reference fields of a place."""

from __future__ import annotations

import datetime
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from cyclopts import Parameter

from inclinometry.cli import options, output
from inclinometry.cli.options import Json
from inclinometry.errors import wrong_kind

if TYPE_CHECKING:
    from inclinometry.earth.magnetic import MagneticField
    from inclinometry.earth.site import Site


def field(
    *,
    latitude: Annotated[options.Latitude, Parameter(group=options.INPUT)],
    longitude: Annotated[float, options.quantity("deg", -180.0, 360.0, group=options.INPUT)],
    height: Annotated[float, options.quantity("m", -12e3, 20e3, group=options.INPUT)],
    date: Annotated[str, Parameter(group=options.INPUT)],
    model: Literal["wmm2025", "igrf14"] | None = None,
    crs: Annotated[str | None, Parameter(group=options.INPUT)] = None,
    json: Json = False,
) -> None:
    """Magnetic field, gravity and Earth rate of a place, each with its standard uncertainty, and grid convergence.

    Parameters
    ----------
    latitude
        Geodetic, north positive.
    longitude
        East positive.
    height
        Above the ellipsoid.
    date
        2026-05-01, or a decimal year.
    model
        wmm2025 (2025 to 2030) or igrf14 (1900 to 2030). Default: wmm2025 from 2025, igrf14 before.
    crs
        Map grid, e.g. EPSG:32632, for the convergence. Default: none.
    """
    from inclinometry.earth.magnetic import MODELS
    from inclinometry.workflow.field import field_at

    chosen = None if model is None else MODELS[model]
    site, field, scale, found = field_at(latitude, longitude, height, _date(date), chosen, crs)
    output.findings(found)
    if json:
        shown = {n: {"value": v, "u": u, "unit": unit} for n, v, u, unit, _, _ in _quantities(site, field, scale)}
        output.print_json(
            {
                "model": field.model,
                "valid_years": list(field.years),
                "latitude_deg": round(float(np.degrees(site.latitude or 0.0)), 10),
                "longitude_deg": round(float(np.degrees(site.longitude or 0.0)), 10),
                "height_m": site.height_m,
                "date": date,
                "crs": site.crs,
                "field": shown,
                "findings": found,
            }
        )
        return
    rows = [
        [name.replace("_", " "), f"{value:.{digits}f}", "" if u is None else f"{u:.{u_digits}f}", unit]
        for name, value, u, unit, digits, u_digits in _quantities(site, field, scale)
    ]
    valid = "{:.1f} to {:.1f}".format(*field.years)
    place = f"latitude {np.degrees(site.latitude or 0.0):.6g}, longitude {np.degrees(site.longitude or 0.0):.6g} deg"
    title = f"{field.model} at {place}, height {site.height_m:g} m, {date}"
    output.table(title, ["quantity", "value", "u", "unit"], rows, f"u: one standard deviation; model valid {valid}")


def _quantities(
    site: Site, field: MagneticField, scale: float | None
) -> list[tuple[str, float, float | None, str, int, int]]:
    """(name, value, standard uncertainty, unit, digits of both) in the order they are shown."""
    from inclinometry.earth.rate import earth_rate, horizontal_rate

    latitude, per_hour = site.latitude or 0.0, float(np.degrees(3600.0))
    own = np.sqrt(np.diagonal(field.covariance))
    rows: list[tuple[str, float, float | None, str, int, int]] = [
        ("north", float(field.north), float(own[0]), "nT", 1, 0),
        ("east", float(field.east), float(own[1]), "nT", 1, 0),
        ("down", float(field.down), float(own[2]), "nT", 1, 0),
        ("total", float(field.b), float(field.b_sigma), "nT", 1, 0),
        ("horizontal", float(field.horizontal), float(field.horizontal_sigma), "nT", 1, 0),
    ]
    for name in ("dip", "declination"):
        value, u = getattr(field, name), getattr(field, f"{name}_sigma")
        rows.append((name, float(np.degrees(value)), float(np.degrees(u)), "deg", 3, 2))
    rows += [
        ("gravity", float(site.gravity or 0.0), float(site.gravity_sigma or 0.0), "m/s2", 5, 5),
        ("earth_rate", float(np.linalg.norm(earth_rate(latitude))) * per_hour, None, "deg/h", 4, 0),
        ("horizontal_earth_rate", float(horizontal_rate(latitude)) * per_hour, None, "deg/h", 4, 0),
    ]
    if site.convergence is not None and scale is not None:
        rows.append(("convergence", float(np.degrees(site.convergence)), None, "deg", 4, 0))
        rows.append(("scale_factor", scale, None, "1", 6, 0))
    return rows


def _date(text: str) -> datetime.date | float:
    """A date, or a decimal year."""
    try:
        return datetime.date.fromisoformat(text)
    except ValueError:
        pass
    try:
        year = float(text)
    except ValueError:
        year = np.nan
    if not np.isfinite(year):
        raise wrong_kind("--date", text, "date YYYY-MM-DD")
    return year
