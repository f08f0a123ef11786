"""What is remarkable at a station: strengths and dip against their references, the vertical, the temperature."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from inclinometry.attitude.orientation import Angles, dip_angle, dip_jacobian
from inclinometry.core.arrays import Array, Mask
from inclinometry.earth.site import Site
from inclinometry.sensors.tool import Tool

FLAGS = {
    "vertical": "azimuth and toolface are hardly defined; use the magnetic toolface",
    "temperature": "outside the temperatures of the calibration; the parameters are extrapolated",
    "g": "gravity differs from its reference by more than its tolerance",
    "b": "the magnetic field differs from its reference by more than its tolerance",
    "dip": "the dip differs from its reference by more than its tolerance",
    "no-azimuth": "no second field to take the azimuth from",
}
"""What a flag means and what to do about it."""


class Magnitudes(NamedTuple):
    """Relative strengths and dip with the standard uncertainties of one reading, all (n,)."""

    strength: dict[str, Array]
    strength_sd: dict[str, Array]
    dip: Array
    dip_sd: Array


def magnitudes(seen: Mapping[str, Array], tool: Tool, heat: Array | None, size: int) -> Magnitudes:
    """Strengths relative to the stand and dip, with uncertainty from calibration and noise."""
    strength, spread, blocks = {}, {}, {}
    for kind, field in seen.items():
        covariance = _field_covariance(tool, kind, field, heat)
        strength[kind] = np.linalg.norm(field, axis=1)
        unit = field / strength[kind][:, None]
        spread[kind] = np.sqrt(np.einsum("ni,nij,nj->n", unit, covariance, unit))
        blocks[kind] = covariance
    if "magnetometer" not in seen:
        return Magnitudes(strength, spread, np.full(size, np.nan), np.full(size, np.nan))
    g, b = seen["accelerometer"], seen["magnetometer"]
    jacobian = dip_jacobian(g, b)
    # the triads' parameters are correlated through the rig; for a tolerance their own parts suffice
    variance = sum(
        np.einsum("ni,nij,nj->n", jacobian[:, 3 * p : 3 * p + 3], blocks[k], jacobian[:, 3 * p : 3 * p + 3])
        for p, k in enumerate(("accelerometer", "magnetometer"))
    )
    return Magnitudes(strength, spread, dip_angle(g, b), np.sqrt(variance))


def _field_covariance(tool: Tool, kind: str, field: Array, heat: Array | None) -> Array:
    """Covariance (n, 3, 3) of a field vector from its triad's parameters and one reading's noise."""
    triad = tool.triads[kind]
    powers, inverse = triad.basis(heat), triad.inverse(heat)
    regressor = np.concatenate([field, np.ones((len(field), 1))], axis=1)
    design = (np.broadcast_to(powers, (len(field), triad.degree + 1))[:, :, None] * regressor[:, None, :]).reshape(
        len(field), -1
    )
    size, count = triad.degree + 1, triad.count
    own = tool.covariance[tool.slices[kind], tool.slices[kind]].reshape(size, count, 4, size, count, 4)
    ordered = own.transpose(1, 0, 2, 4, 3, 5).reshape(count, size * 4, count, size * 4)
    signal = np.einsum("np,apbq,nq->nab", design, ordered, design, optimize=True) + np.diag(tool.noise[kind] ** 2)
    return np.asarray(inverse @ signal @ np.swapaxes(inverse, -1, -2))


def reversed_field(dip: Array, site: Site | None) -> list[str]:
    """A warning when the dips (n,) measured have the opposite sign of the site's: azimuths are then half a turn off."""
    if site is None or site.dip is None or abs(site.dip) < np.radians(10.0) or not np.isfinite(dip).any():
        return []
    middle = float(np.nanmedian(dip))
    if middle * site.dip > 0.0 or abs(middle) < np.radians(10.0):
        return []
    return [
        f"the dip comes out at {np.degrees(middle):+.1f} deg, the site has {np.degrees(site.dip):+.1f}: the "
        "magnetometer's sign is reversed, azimuths are off by up to 180 deg; calibrate again, the stand's dip stated"
    ]


TOLERANCE = 3.0
"""Standard uncertainties by which a magnitude may differ from its reference before it is flagged."""


def station_flags(
    found: Angles, inclination_sd: Array, size: Magnitudes, tool: Tool, heat: Array | None, reference: Reference
) -> list[list[str]]:
    """Names of what is remarkable at each station."""
    rows: dict[str, Mask] = {}
    tilt = np.minimum(found.inclination, np.pi - found.inclination)
    rows["vertical"] = tilt < 5.0 * inclination_sd
    if heat is not None and tool.temperature_range is not None:
        low, high = tool.temperature_range
        rows["temperature"] = (heat < low - HEAT_MARGIN) | (heat > high + HEAT_MARGIN)
    for name, kind in (("g", "accelerometer"), ("b", "magnetometer")):
        if kind in size.strength and reference.strength.get(kind) is not None:
            wanted, sigma = reference.strength[kind]
            off = np.abs(size.strength[kind] - wanted)
            rows[name] = off > TOLERANCE * np.hypot(size.strength_sd[kind], sigma)
    if reference.dip is not None:
        wanted, sigma = reference.dip
        rows["dip"] = np.abs(size.dip - wanted) > TOLERANCE * np.hypot(size.dip_sd, sigma)
    rows["no-azimuth"] = np.isnan(found.azimuth)
    return [[name for name, hit in rows.items() if hit[k]] for k in range(len(tilt))]


HEAT_MARGIN = 5.0
"""How far outside the calibrated temperatures a reading may lie before it is flagged, degC."""


class Reference(NamedTuple):
    """Expected strengths (relative to the stand) and dip (rad), each with its standard uncertainty."""

    strength: dict[str, tuple[float, float]]
    dip: tuple[float, float] | None


# Standard uncertainties taken where a reference is stated without one: gravity from a map; a global magnetic model with
# crustal anomalies (ISCWSA MWD error model: 130 nT, 0.2 deg at one standard deviation)
_SIGMA_G, _SIGMA_B, _SIGMA_DIP = 0.002, 130.0, np.radians(0.2)


def reference_of(tool: Tool, site: Site | None, calibration_dip: float | None) -> Reference:
    """What the site says; without a site, the fields of the stand, within what two places usually differ by."""
    strength: dict[str, tuple[float, float]] = {}
    for kind, name, sigma in (("accelerometer", "g", _SIGMA_G), ("magnetometer", "b", _SIGMA_B)):
        own = tool.triads[kind].field_strength if kind in tool.triads else None
        value = None if site is None else getattr(site, name)
        if value is not None and own is not None:
            stated = getattr(site, f"{name}_sigma")
            strength[kind] = (value / own, (sigma if stated is None else stated) / own)
    if site is None:
        # gravity varies by half a per cent over the Earth; the magnetic field by more than any tolerance would bear
        strength["accelerometer"] = (1.0, 0.002)
    if site is not None and site.dip is not None:
        return Reference(strength, (site.dip, _SIGMA_DIP if site.dip_sigma is None else site.dip_sigma))
    # without a site a dip ten degrees off the stand's is no place's but a wiring fault's
    return Reference(strength, None if calibration_dip is None else (calibration_dip, np.radians(3.0)))


def summary(flags: Sequence[Sequence[str]]) -> list[str]:
    """One sentence for each kind of flag that occurs."""
    return [
        f"{sum(name in row for row in flags)} of {len(flags)} stations flagged {name}: {meaning}"
        for name, meaning in FLAGS.items()
        if any(name in row for row in flags)
    ]
