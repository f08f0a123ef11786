"""The Earth's main field from WMM2025 and IGRF-14, each with its own uncertainty; values of the site win over both."""

from __future__ import annotations

import datetime
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite, frozen, within
from inclinometry.earth.gravity import FLATTENING, SEMI_MAJOR_AXIS
from inclinometry.earth.site import Site
from inclinometry.errors import not_among, refused, wrong_shape
from inclinometry.uncertainty import UNKNOWN

# Synthesis of a main field from Schmidt semi-normalised Gauss coefficients; finite at the poles.


class Coefficients(NamedTuple):
    """Gauss coefficients g, h (T, N + 1, N + 1) in nT at the decimal years (T,), linear between."""

    years: Array
    g: Array
    h: Array

    @property
    def degree(self) -> int:
        """Highest degree N."""
        return int(self.g.shape[1]) - 1

    def at(self, year: Array) -> tuple[Array, Array]:
        """g and h (N + 1, N + 1, P) at the years (P,), which lie within those of the model."""
        row = np.clip(np.searchsorted(self.years, year, side="right") - 1, 0, len(self.years) - 2)
        share = (year - self.years[row]) / (self.years[row + 1] - self.years[row])
        # in this form a year of the table gives the table's own coefficients
        g, h = ((1.0 - share) * np.moveaxis(t[row], 0, -1) + share * np.moveaxis(t[row + 1], 0, -1) for t in self[1:])
        return np.asarray(g), np.asarray(h)


def field_ned(model: Coefficients, latitude: Array, longitude: Array, height: Array, year: Array) -> Array:
    """Field (P, 3) north, east, down, nT, at geodetic points (P,), rad and m, and decimal years (P,) or (1,)."""
    radius, sine, cosine = geocentric(latitude, height)
    g, h = model.at(year)
    # the coefficients refer to a radius of 6371.2 km (geomagnetic convention)
    theta, outward, east = _spherical(model.degree, g, h, 6371.2e3 / radius, sine, cosine, longitude)
    # from the geocentric vertical to that of the ellipsoid: both lie in the meridian plane
    s = cosine * np.cos(latitude) - sine * np.sin(latitude)
    c = sine * np.cos(latitude) + cosine * np.sin(latitude)
    north, down = -theta * c + outward * s, -theta * s - outward * c
    return np.stack([north, east, down], axis=-1)


def geocentric(latitude: Array, height: Array) -> tuple[Array, Array, Array]:
    """Radius, m, and sine and cosine of the geocentric colatitude of a geodetic point."""
    eccentricity2 = FLATTENING * (2.0 - FLATTENING)
    normal = SEMI_MAJOR_AXIS / np.sqrt(1.0 - eccentricity2 * np.sin(latitude) ** 2)
    across = (normal + height) * np.cos(latitude)
    along = (normal * (1.0 - eccentricity2) + height) * np.sin(latitude)
    radius = np.hypot(across, along)
    return radius, across / radius, along / radius


def _spherical(
    degree: int, g: Array, h: Array, ratio: Array, sine: Array, cosine: Array, longitude: Array
) -> tuple[Array, Array, Array]:
    """Components along colatitude, radius and longitude, each (P,)."""
    theta, outward, east = (np.zeros_like(ratio) for _ in range(3))
    for m in range(degree + 1):
        c, s = np.cos(m * longitude), np.sin(m * longitude)
        for n, (p, slope, p_over_sine) in enumerate(legendre(degree, m, sine, cosine), start=max(m, 1)):
            scale = ratio ** (n + 2)
            wave, turned = g[n, m] * c + h[n, m] * s, g[n, m] * s - h[n, m] * c
            outward += scale * (n + 1) * wave * p
            theta -= scale * wave * slope
            east += scale * m * turned * p_over_sine
    return theta, outward, east


def legendre(degree: int, m: int, sine: Array, cosine: Array) -> list[tuple[Array, Array, Array]]:
    """(P, dP / d colatitude, P / sine) of order m and degrees max(m, 1) to `degree`, Schmidt semi-normalised.

    For m > 0 the recursion runs on Q = P / sine, a polynomial, so that nothing is divided at a pole.
    """
    if m == 0:
        return _zonal(degree, sine, cosine)
    before, q = np.zeros_like(sine), _sectoral(m, sine)
    found = []
    for n in range(m, degree + 1):
        if n > m:
            step = (2 * n - 1) * cosine * q - np.sqrt((n - 1) ** 2 - m**2) * before
            before, q = q, step / np.sqrt(n**2 - m**2)
        found.append((sine * q, n * cosine * q - np.sqrt(n**2 - m**2) * before, q))
    return found


def _sectoral(m: int, sine: Array) -> Array:
    """Q of degree and order m."""
    q = np.ones_like(sine)
    for k in range(2, m + 1):
        q = q * sine * np.sqrt((2 * k - 1) / (2 * k))
    return q


def _zonal(degree: int, sine: Array, cosine: Array) -> list[tuple[Array, Array, Array]]:
    """Order 0; its slope comes from order 1, and P / sine is never used."""
    before, p = np.ones_like(cosine), cosine
    first = legendre(degree, 1, sine, cosine)
    found = []
    for n in range(1, degree + 1):
        if n > 1:
            before, p = p, ((2 * n - 1) * cosine * p - (n - 1) * before) / n
        found.append((p, -np.sqrt(n * (n + 1) / 2.0) * first[n - 1][0], np.zeros_like(p)))
    return found


# Gauss coefficients of the models, from the files beside this module (ORIGIN.md); read once, never fetched.


@cache
def wmm2025_coefficients() -> Coefficients:
    """WMM2025: values at 2025 and what their yearly change makes of them in 2030."""
    head, *lines = _published("WMM2025.COF")
    # two lines of nines end the table
    rows = np.array([line.split() for line in lines if not line.startswith("9999")], dtype=np.float64)
    n, m = rows[:, :2].T.astype(int)
    values = np.zeros((4, n.max() + 1, n.max() + 1))
    values[:, n, m] = rows[:, 2:].T
    g, h, g_rate, h_rate = values
    epoch = float(head.split()[0])
    g, h = np.stack([g, g + 5.0 * g_rate]), np.stack([h, h + 5.0 * h_rate])
    return Coefficients(frozen([epoch, epoch + 5.0]), frozen(g), frozen(h))


@cache
def igrf14_coefficients() -> Coefficients:
    """IGRF-14: every five years from 1900 to 2030."""
    head, dates, *lines = (line for line in _published("IGRF14.shc") if not line.startswith("#"))
    years, degree = np.array(dates.split(), dtype=np.float64), int(head.split()[1])
    g, h = np.zeros((2, len(years), degree + 1, degree + 1))
    for line in lines:
        n, m, *values = line.split()
        # a negative order is that of a sine
        (h if int(m) < 0 else g)[:, int(n), abs(int(m))] = np.array(values, dtype=np.float64)
    return Coefficients(frozen(years), frozen(g), frozen(h))


def _published(name: str) -> list[str]:
    return files("inclinometry.earth").joinpath(name).read_text(encoding="ascii").splitlines()


class ReferenceErrors(NamedTuple):
    """Standard deviations of a kind of geomagnetic reference, in nT and rad.

    declination_by_h (rad nT) divided by the horizontal field adds to declination by root sum of squares. The random
    parts are the disturbance field, which differs from station to station and is no error of the model.
    """

    b: float
    dip: float
    declination: float
    declination_by_h: float
    b_random: float
    dip_random: float


@dataclass(frozen=True, eq=False)
class MagneticField:
    """Main field at points and dates of any common shape (...), by a model valid for `years`.

    north, east, down, b : nT. dip : rad, positive down. declination : rad, positive east.
    b_sigma and so on : what a main field leaves out (crust, disturbances of a mean day) and its ageing; global means,
        several times larger over magnetic rocks.
    covariance : of north, east, down, nT^2, with errors of b, dip and declination taken as independent.
    """

    model: str
    years: tuple[float, float]
    north: Array
    east: Array
    down: Array
    b: Array
    dip: Array
    declination: Array
    b_sigma: Array
    dip_sigma: Array
    declination_sigma: Array
    covariance: Array

    @property
    def horizontal(self) -> Array:
        """Horizontal field, nT."""
        return np.hypot(self.north, self.east)

    @property
    def horizontal_sigma(self) -> Array:
        """Its standard deviation, nT, from those of b and dip."""
        return np.hypot(np.cos(self.dip) * self.b_sigma, self.down * self.dip_sigma)


Model = Callable[[ArrayLike, ArrayLike, ArrayLike, "datetime.date | ArrayLike"], MagneticField]
"""wmm2025, igrf14, or a model of one's own with the same arguments."""


def wmm2025(
    latitude: ArrayLike, longitude: ArrayLike, height_m: ArrayLike, date: datetime.date | ArrayLike
) -> MagneticField:
    """World Magnetic Model 2025, degree 12, for dates or decimal years 2025 to 2030; rad, m above the ellipsoid.

    NOAA/NCEI and BGS, The US/UK World Magnetic Model for 2025-2030, 2025: equations 7 to 12, 17 and 19, with recursions
    regular at the poles. Standard deviations: ISCWSA look-up for the WMM; that of declination is sqrt(0.23^2 + (5430 nT
    / H)^2) deg.
    """
    return _field("WMM2025", wmm2025_coefficients(), reference_errors("WMM"), latitude, longitude, height_m, date)


def igrf14(
    latitude: ArrayLike, longitude: ArrayLike, height_m: ArrayLike, date: datetime.date | ArrayLike
) -> MagneticField:
    """International Geomagnetic Reference Field, 14th generation, degree 13 (10 before 2000), 1900 to 2030.

    Alken et al., Earth Planets Space 73:49 (2021), equations 1 to 3, for the form; IAGA 2024 for the coefficients:
    linear between epochs, definitive until 2020, a forecast after 2025. Standard deviations are those of the WMM, which
    leaves out the same crustal field: ISCWSA has none for the IGRF, which is worse before the 1960s.
    """
    return _field("IGRF-14", igrf14_coefficients(), reference_errors("WMM"), latitude, longitude, height_m, date)


MODELS: Final[Mapping[str, Model]] = MappingProxyType({"wmm2025": wmm2025, "igrf14": igrf14})
"""The models by the names used at the edges."""


def reference_errors(kind: str) -> ReferenceErrors:
    """ISCWSA standard deviations of a geomagnetic reference: main field (WMM), with crust (BGGM), HDGM, IFR1, IFR2."""
    rows = _errors_content()["models"]
    if kind not in rows:
        raise not_among("reference", kind, rows)
    row = rows[kind]
    angles = {k: float(np.radians(row[k])) for k in row if "_deg" in k}
    return ReferenceErrors(
        float(row["b_nT"]),
        angles["dip_deg"],
        angles["declination_deg"],
        angles["declination_deg_nT"],
        float(row["b_random_nT"]),
        angles["dip_random_deg"],
    )


def decimal_year(date: datetime.date) -> float:
    """Year with the fraction gone at the start of the day.

    Examples
    --------
    >>> decimal_year(datetime.date(2025, 7, 2)).__round__(6)
    2025.49863
    """
    first, following = datetime.date(date.year, 1, 1).toordinal(), datetime.date(date.year, 12, 31).timetuple().tm_yday
    return date.year + (date.toordinal() - first) / following


def complete_site(site: Site, model: Model) -> Site:
    """The site with b, dip and declination filled from a model where it lacks them; `site.origin("b")` is the source.

    A value of its own without a sigma gets none. A height that is not given is 0: 1000 m change b by about 0.05 %.
    """
    lacking = [name for name in ("b", "dip", "declination") if getattr(site, name) is None]
    if not lacking:
        return site
    needed = [name for name in ("latitude", "longitude", "date") if getattr(site, name) is None]
    if site.latitude is None or site.longitude is None or site.date is None:
        raise refused("input-missing", {"names": tuple(needed)})
    found = model(site.latitude, site.longitude, site.height_m or 0.0, site.date)
    values: dict[str, Any] = {}
    for name in lacking:
        values[name] = float(getattr(found, name))
        values[f"{name}_sigma"] = float(getattr(found, f"{name}_sigma"))
    origins = (*site.origins, *((name, found.model) for name in lacking))
    return replace(site, origins=origins, **values)


def _field(
    name: str,
    model: Coefficients,
    errors: ReferenceErrors,
    latitude: ArrayLike,
    longitude: ArrayLike,
    height_m: ArrayLike,
    date: datetime.date | ArrayLike,
) -> MagneticField:
    phi = within(latitude, "latitude", -np.pi / 2, np.pi / 2, "rad")
    lam = within(longitude, "longitude", -np.pi, 2.0 * np.pi, "rad")
    height = within(height_m, "height_m", -12e3, 2000e3, "m")
    year = np.asarray(decimal_year(date)) if isinstance(date, datetime.date) else finite(date, "date")
    first, last = model.years[[0, -1]]
    bad = (year < first) | (year > last)
    if bad.any():
        shown = str(date) if isinstance(date, datetime.date) else f"{year[bad].flat[0]:.10g}"
        raise refused("earth-date", {"date": shown, "model": name, "first": float(first), "last": float(last)})
    try:
        shape = np.broadcast_shapes(phi.shape, lam.shape, height.shape, year.shape)
    except ValueError:
        shapes = ", ".join(str(a.shape) for a in (phi, lam, height, year))
        raise wrong_shape("latitude, longitude, height_m, date", shapes, "(n,) | ()") from None
    phi, lam, height = (np.broadcast_to(a, shape).ravel() for a in (phi, lam, height))
    # one date for all keeps the coefficients small
    same = year.size > 0 and bool((year == year.flat[0]).all())
    when = year.ravel()[:1] if same else np.broadcast_to(year, shape).ravel()
    ned = field_ned(model, phi, lam, height, when).reshape(*shape, 3)
    north, east, down = (ned[..., k] for k in range(3))
    h = np.hypot(north, east)
    b, dip, declination = np.hypot(h, down), np.arctan2(down, h), np.arctan2(east, north)
    # an error of declination moves the field across by this much, which stays finite where h vanishes
    across = np.hypot(errors.declination * h, errors.declination_by_h)
    with np.errstate(divide="ignore", invalid="ignore"):
        declination_sigma = np.minimum(np.where(h > 0.0, across / h, np.inf), UNKNOWN)
    c, s, nothing = np.cos(declination), np.sin(declination), np.zeros_like(h)
    moved = (
        errors.b * np.stack([np.cos(dip) * c, np.cos(dip) * s, np.sin(dip)], axis=-1),
        errors.dip * b[..., None] * np.stack([-np.sin(dip) * c, -np.sin(dip) * s, np.cos(dip)], axis=-1),
        across[..., None] * np.stack([-s, c, nothing], axis=-1),
    )
    covariance = sum(step[..., :, None] * step[..., None, :] for step in moved)
    sigmas = nothing + errors.b, nothing + errors.dip, declination_sigma
    return MagneticField(
        name,
        (float(model.years[0]), float(model.years[-1])),
        *map(frozen, (north, east, down, b, dip, declination, *sigmas, covariance)),
    )


@cache
def _errors_content() -> dict[str, Any]:
    content: dict[str, Any] = json.loads(files("inclinometry.earth").joinpath("reference_errors.json").read_text())
    return content
