"""A site: where it is, which north its azimuths are counted from, and what its fields should be."""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from typing import Annotated, Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite
from inclinometry.earth.gravity import normal_gravity
from inclinometry.errors import SiteError, not_among, refused
from inclinometry.findings import Finding
from inclinometry.rotations import wrap_positive
from inclinometry.settings import Range, Settings
from inclinometry.tabular import Column, Tabular

REFERENCES: Final = ("magnetic", "true", "grid")
"""The norths an azimuth may be counted from."""

Azimuth: TypeAlias = Annotated[float | None, Range(-np.pi, np.pi, "rad")]
Tilt: TypeAlias = Annotated[float | None, Range(-np.pi / 2, np.pi / 2, "rad")]
Sigma: TypeAlias = Annotated[float | None, Range(0.0, np.pi, "rad")]


@dataclass(frozen=True, kw_only=True, repr=False)
class Site(Tabular, Settings):
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

    latitude: Tilt = None
    longitude: Annotated[float | None, Range(-np.pi, 2.0 * np.pi, "rad")] = None
    height_m: Annotated[float | None, Range(-12e3, 20e3, "m")] = None
    date: datetime.date | None = None
    north_reference: str = "magnetic"
    declination: Azimuth = None
    convergence: Azimuth = None
    g: Annotated[float | None, Range(9.5, 10.1, "m/s^2")] = None
    b: Annotated[float | None, Range(5e3, 2e5, "nT")] = None
    dip: Tilt = None
    declination_sigma: Sigma = None
    convergence_sigma: Sigma = None
    g_sigma: Annotated[float | None, Range(0.0, 0.1, "m/s^2")] = None
    b_sigma: Annotated[float | None, Range(0.0, 1e4, "nT")] = None
    dip_sigma: Annotated[float | None, Range(0.0, np.pi / 2, "rad")] = None
    latitude_sigma: Annotated[float | None, Range(0.0, np.pi / 2, "rad")] = None
    crs: str | None = None
    origins: tuple[tuple[str, str], ...] = ()

    def __post_init__(self) -> None:
        _known(self.north_reference)
        super().__post_init__()
        for name in self._ranges:
            value, quantity = getattr(self, name), name.removesuffix("_sigma")
            if value is not None:
                object.__setattr__(self, name, float(value))
                if getattr(self, quantity) is None:
                    raise refused("input-needs", {"name": name, "needed": (quantity,)})

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
        # gravity anomalies are commonly some tens of mGal, here 40, and several times that in high mountains
        return 4e-4

    def to_dict(self) -> dict[str, Column]:
        """One row a quantity that is known: value, standard deviation, unit and where it comes from."""
        known = [name for name in self._ranges if not name.endswith("_sigma") and getattr(self, name) is not None]
        unit = {name: self._ranges[name].unit for name in known}
        angle = {name: np.degrees(1.0) if unit[name] == "rad" else 1.0 for name in known}
        spread = {name: getattr(self, f"{name}_sigma", None) for name in known}
        return {
            "quantity": [name.removesuffix("_m") for name in known],
            "value": [float(np.round(getattr(self, name) * angle[name], 10)) for name in known],
            "sigma": [np.nan if (s := spread[name]) is None else float(s * angle[name]) for name in known],
            "unit": ["deg" if unit[name] == "rad" else unit[name] for name in known],
            "origin": [self.origin(name) or "" for name in known],
        }

    def __repr__(self) -> str:
        columns = self.to_dict()
        rows = zip(columns["quantity"], columns["value"], columns["sigma"], columns["unit"], strict=True)
        known = [f"{name} {value:.10g}{'' if np.isnan(s) else f' ± {s:.3g}'} {unit}" for name, value, s, unit in rows]
        known += [str(self.date)] if self.date else []
        return f"Site: {', '.join([*known, f'azimuths from {self.north_reference} north'])}"


def convert_azimuth(azimuth: ArrayLike, source: str, target: str, site: Site) -> Array:
    """Azimuth from one north ("magnetic", "true" or "grid") expressed from another, rad in [0, 2 pi)."""
    shift = sum(sign * value for sign, value, _ in _corrections(source, target, site))
    return wrap_positive(finite(azimuth, "azimuth") + shift)


def azimuth_sigma(source: str, target: str, site: Site) -> float:
    """Standard deviation, rad, that `convert_azimuth` adds to an azimuth, common to all azimuths of the site."""
    total = 0.0
    for _, _, name in _corrections(source, target, site):
        sigma = getattr(site, f"{name}_sigma")
        if sigma is None:
            raise SiteError(Finding("earth-site-lacks", {"name": f"{name}_sigma", "source": source, "target": target}))
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
            raise SiteError(Finding("earth-site-lacks", {"name": name, "source": source, "target": target}))
        found.append((direction * sign, value, name))
    return found


def _known(reference: str) -> str:
    if reference not in REFERENCES:
        raise not_among("north_reference", str(reference), REFERENCES)
    return reference
