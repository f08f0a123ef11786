"""A site: where it is, which north its azimuths are counted from, and what its fields should be."""

from __future__ import annotations

import datetime
from dataclasses import dataclass, fields
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite, within
from inclinometry.earth.gravity import GRAVITY_SIGMA, normal_gravity
from inclinometry.errors import InputError
from inclinometry.rotations import wrap_positive
from inclinometry.tabular import Column, Tabular

REFERENCES: Final = ("magnetic", "true", "grid")
"""The norths an azimuth may be counted from."""

_RANGES: Final = {
    "latitude": (-np.pi / 2, np.pi / 2, "rad"),
    "longitude": (-np.pi, 2.0 * np.pi, "rad"),
    "height_m": (-12e3, 20e3, "m"),
    "declination": (-np.pi, np.pi, "rad"),
    "convergence": (-np.pi, np.pi, "rad"),
    "g": (9.5, 10.1, "m/s^2"),
    "b": (5e3, 2e5, "nT"),
    "dip": (-np.pi / 2, np.pi / 2, "rad"),
    "declination_sigma": (0.0, np.pi, "rad"),
    "convergence_sigma": (0.0, np.pi, "rad"),
    "g_sigma": (0.0, 0.1, "m/s^2"),
    "b_sigma": (0.0, 1e4, "nT"),
    "dip_sigma": (0.0, np.pi / 2, "rad"),
    "latitude_sigma": (0.0, np.pi / 2, "rad"),
}


@dataclass(frozen=True, kw_only=True, repr=False)
class Site(Tabular):
    """What is known of a place; everything is optional, nothing is guessed.

    Parameters
    ----------
    latitude, longitude : float, optional
        Geodetic, rad, north and east positive.
    height_m : float, optional
        Above the ellipsoid, m.
    date : datetime.date, optional
        Of the readings; the magnetic field drifts.
    north_reference : {"magnetic", "true", "grid"}
        What azimuths are to be reported from.
    declination : float, optional
        rad, positive when magnetic north is east of true north.
    convergence : float, optional
        rad, positive when grid north is east of true north.
    g, b, dip : float, optional
        Gravity, m/s^2; magnetic flux density, nT; dip, rad, positive when the field points below the horizon.
    declination_sigma, convergence_sigma, g_sigma, b_sigma, dip_sigma, latitude_sigma : float, optional
        Their standard deviations, same units.
    crs : str, optional
        The grid, e.g. "EPSG:32632"; the convergence is computed from it at the edge, where none is given.
    origins : tuple of (name, origin), optional
        Where values that were not given come from, e.g. ("dip", "WMM2025"); see `origin`.

    Raises
    ------
    InputError
        A value that is not finite or out of range (degrees given as radians, microtesla as nanotesla, units of g), an
        unknown reference, a sigma without its value.

    Examples
    --------
    >>> site = Site(latitude=0.9, north_reference="true", declination=0.05)
    >>> round(site.gravity, 4)
    9.8121
    """

    latitude: float | None = None
    longitude: float | None = None
    height_m: float | None = None
    date: datetime.date | None = None
    north_reference: str = "magnetic"
    declination: float | None = None
    convergence: float | None = None
    g: float | None = None
    b: float | None = None
    dip: float | None = None
    declination_sigma: float | None = None
    convergence_sigma: float | None = None
    g_sigma: float | None = None
    b_sigma: float | None = None
    dip_sigma: float | None = None
    latitude_sigma: float | None = None
    crs: str | None = None
    origins: tuple[tuple[str, str], ...] = ()

    def __post_init__(self) -> None:
        _known(self.north_reference)
        for field in fields(self):
            value = getattr(self, field.name)
            if value is None or field.name not in _RANGES:
                continue
            object.__setattr__(self, field.name, float(within(value, field.name, *_RANGES[field.name])))
            quantity = field.name.removesuffix("_sigma")
            if getattr(self, quantity) is None:
                raise InputError(f"{field.name} is given without {quantity}; give both or neither")

    def origin(self, name: str) -> str | None:
        """Where the site has a value from: "given", or what computed it; None when it has none.

        Examples
        --------
        >>> Site(b=50_000.0).origin("b")
        'given'
        """
        if getattr(self, name) is None:
            return None
        return dict(self.origins).get(name, "given")

    @property
    def gravity(self) -> float | None:
        """Gravity, m/s^2: as given, else normal gravity at the latitude and height; None when neither is known."""
        if self.g is not None or self.latitude is None:
            return self.g
        return float(normal_gravity(self.latitude, self.height_m or 0.0))

    @property
    def gravity_sigma(self) -> float | None:
        """Its standard deviation, m/s^2: as given, else that of normal gravity; None when a given g came without."""
        if self.g is not None or self.latitude is None:
            return self.g_sigma
        return GRAVITY_SIGMA

    def to_dict(self) -> dict[str, Column]:
        """One row a quantity that is known: value, standard deviation, unit and where it comes from."""
        known = [name for name in _RANGES if not name.endswith("_sigma") and getattr(self, name) is not None]
        angle = {name: np.degrees(1.0) if _RANGES[name][2] == "rad" else 1.0 for name in known}
        spread = {name: getattr(self, f"{name}_sigma", None) for name in known}
        return {
            "quantity": [name.removesuffix("_m") for name in known],
            "value": [float(np.round(getattr(self, name) * angle[name], 10)) for name in known],
            "sigma": [np.nan if (s := spread[name]) is None else float(s * angle[name]) for name in known],
            "unit": ["deg" if _RANGES[name][2] == "rad" else _RANGES[name][2] for name in known],
            "origin": [self.origin(name) or "" for name in known],
        }

    def __repr__(self) -> str:
        columns = self.to_dict()
        rows = zip(columns["quantity"], columns["value"], columns["sigma"], columns["unit"], strict=True)
        known = [f"{name} {value:.10g}{'' if np.isnan(s) else f' ± {s:.3g}'} {unit}" for name, value, s, unit in rows]
        known += [str(self.date)] if self.date else []
        return f"Site: {', '.join([*known, f'azimuths from {self.north_reference} north'])}"


def convert_azimuth(azimuth: ArrayLike, source: str, target: str, site: Site) -> Array:
    """Azimuth counted from one north, rad, expressed from another, in [0, 2 pi).

    Parameters
    ----------
    azimuth : (...) array_like
        rad, clockwise from the `source` north.
    source, target : {"magnetic", "true", "grid"}
        A gyro gives "true". Only the corrections between the two are asked of the site.
    site : Site

    Raises
    ------
    InputError
        Unknown reference, or a site without the declination or convergence that is needed.

    Examples
    --------
    >>> float(convert_azimuth(1.0, "true", "grid", Site(convergence=0.25)))
    0.75
    """
    shift = sum(sign * value for sign, value, _ in _corrections(source, target, site))
    return wrap_positive(finite(azimuth, "azimuth") + shift)


def azimuth_sigma(source: str, target: str, site: Site) -> float:
    """Standard deviation, rad, that `convert_azimuth` adds to an azimuth, common to all azimuths of the site.

    Raises
    ------
    InputError
        As `convert_azimuth`, or when a correction that is used has no sigma.

    Examples
    --------
    >>> azimuth_sigma("magnetic", "true", Site(declination=0.05, declination_sigma=0.006))
    0.006
    """
    total = 0.0
    for _, _, name in _corrections(source, target, site):
        sigma = getattr(site, f"{name}_sigma")
        if sigma is None:
            raise InputError(f"the site has no {name}_sigma; give it to state the uncertainty of {target} azimuths")
        total = float(np.hypot(total, sigma))
    return total


def _corrections(source: str, target: str, site: Site) -> list[tuple[float, float, str]]:
    """Signed corrections between two norths: (sign, value, name)."""
    steps = (("declination", 1.0), ("convergence", -1.0))
    start, stop = REFERENCES.index(_known(source)), REFERENCES.index(_known(target))
    direction = 1.0 if stop >= start else -1.0
    found = []
    for name, sign in steps[min(start, stop) : max(start, stop)]:
        value = getattr(site, name)
        if value is None:
            raise InputError(f"the site has no {name}; {target} azimuths from {source} ones need it: give the {name}")
        found.append((direction * sign, value, name))
    return found


def _known(reference: str) -> str:
    if reference not in REFERENCES:
        raise InputError(f"north reference is {reference!r}; allowed: {', '.join(REFERENCES)}")
    return reference
