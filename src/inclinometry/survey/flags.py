"""What is remarkable at a station: strengths, dip and latitude against their references, the vertical, temperature."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array, Index, Mask
from inclinometry.constants import EARTH_RATE
from inclinometry.earth.site import Site
from inclinometry.findings import Finding, Severity, Value
from inclinometry.orientation import Angles, dip_angle, dip_jacobian
from inclinometry.sensors import Tool

ROUNDING: Final = 1e-11
"""What a value may exceed its limit by, rad: the rounding of a file's degrees, so that a limit itself is accepted."""


@dataclass(frozen=True)
class Check:
    """One check of a survey.

    verdict : "pass", "fail" or, where the stations cannot support the check, "not judged". value : the worst where
    stations are judged one by one; NaN where nothing could be judged. limit : in the same `unit` ("rad", "rad/s",
    "stations", "sigma"). stations : rows (from 0) beyond the limit, or those judged where the run is judged as a whole.
    reason : the figures in the units of the user and, where it did not pass, what to do next.
    """

    name: str
    verdict: str
    value: float
    limit: float
    stations: Sequence[int]
    reason: Finding
    unit: str = "rad"


def worst(checks: Iterable[Check]) -> str:
    """The verdict on all of them: a failure counts more than a pass, "not judged" only where nothing passed.

    >>> blank = unjudged("the stations have no azimuth")
    >>> worst([Check("a", "pass", 0.0, 1.0, (), blank), Check("b", "not judged", 0.0, 1.0, (), blank)]), worst([])
    ('pass', 'not judged')
    """
    found = {check.verdict for check in checks}
    return "fail" if "fail" in found else "pass" if "pass" in found else "not judged"


_FIELD = "Look for magnetic interference (casing, collars), correct it (axial, msa), and check b and dip of the site"
_UNITS = "Check units, axes and signs of the channels, and the tool's calibration"

OFF: Final = {
    "few": "Repeat these stations at rest, away from casing and offset wells",
    "g": "Repeat at rest; if it stays, check calibration and temperature of the accelerometers",
    "b": _FIELD,
    "bd": _FIELD,
    "d": "Check axes and signs of the magnetometers against the accelerometers, and dip_deg of the site",
    "gd": "Repeat at rest; check calibration, axes and signs of the accelerometers",
    "gb": _UNITS,
    "gbd": _UNITS,
    "": "Repeat the stations; look for slight interference",
    "toolface": "Calibrate the sensors across the tool, or run a multi-station analysis",
    "repeat": "Repeat once more at rest; then check depth, calibration and interference of both",
    "depth": "Check the pipe tally and the corrections of both, and measure the depth again",
    "gyro few": "Repeat these stations at rest; check depth and centralisation there",
    "gyro": "Check depth correlation, centralisation, drift and temperature of the gyro; survey again",
}
"""What to do about a failure: which of gravity, magnetic field and dip are off, or what was compared."""

UNJUDGED: Final = {
    "no uncertainty is known": "State the uncertainties, or use fixed limits (--limits)",
    "the field is vertical within its limit": "Use stations elsewhere, or a gyro",
    "the stations have no azimuth": "Use stations with an inclination of 5 deg or more",
    "the sensors across the tool hardly contribute here": "Take the shots at another attitude",
    "no station of the second survey is near one of the first": "Check the depths, or give a larger --apart-m",
    "too few common stations with this angle": "Survey the out-run over the depths of the in-run",
}
"""Why stations cannot support a check, and what to do about it."""


def unjudged(reason: str) -> Finding:
    """The finding on a check that the stations cannot support; a reason of `UNJUDGED`."""
    return Finding("survey-unjudged", {"reason": reason, "advice": UNJUDGED[reason]})


_SHOWN: Final = {"rad": ("deg", 180.0 / np.pi), "m/s^2": ("m/s2", 1.0)}


def sizes_check(
    name: str,
    quantity: str,
    unit: str,
    order: Array,
    sizes: tuple[Array, Array],
    failed: Mask,
    remedy: str,
    rows: Index | None = None,
) -> Check:
    """A check of differences against limits, `sizes` (n,) both, by the worst: the largest of `order`, -1 if not judged.

    remedy : key of `OFF`. rows : stations that are compared, where not all.
    """
    worst_of = int(np.argmax(order))
    places = np.arange(len(order)) if rows is None else rows
    bad = tuple(places[failed].tolist())
    value, limit = (float(one[worst_of]) for one in sizes)
    shown, factor = _SHOWN.get(unit, (unit, 1.0))
    size: dict[str, Value] = {"off": factor * value, "limit": factor * limit, "unit": shown}
    size["station"] = int(places[worst_of]) + 1
    reason = Finding("survey-check-fits", size | {"what": "worst"})
    if bad:
        of: dict[str, Value] = {"quantity": quantity, "count": len(bad), "total": int((order >= 0.0).sum())}
        reason = Finding("survey-off", size | of | {"advice": OFF[remedy]}, bad)
    return Check(name, "fail" if bad else "pass", abs(value), abs(limit), bad, reason, unit)


FLAGS = {
    "vertical": "azimuth and toolface are hardly defined; use the magnetic toolface",
    "temperature": "outside the temperatures of the calibration; the parameters are extrapolated",
    "g": "gravity differs from its reference by more than its tolerance",
    "b": "the magnetic field differs from its reference by more than its tolerance",
    "dip": "the dip differs from its reference by more than its tolerance",
    "rate": "the rotation measured is not the Earth's rate: the tool moved, or the gyro's bias or scale has changed",
    "latitude": "the latitude that gravity and the Earth rate give differs from the site's by more than its tolerance",
    "overruled": "a finding of the whole run was ignored (--ignore); the findings of the run say which",
    "channel": "a channel failed here: it kept one value, changed its size, or was ten times as noisy; no azimuth",
    "no-azimuth": "no second field to take the azimuth from",
    "g-in-plane": "gravity lies in the plane of the two accelerometers, which do not measure the component across "
    "it: the inclination may be wrong by more than is stated",
}
"""What a flag means and what to do about it."""


class Magnitudes(NamedTuple):
    """Relative strengths, dip and latitude with the standard uncertainties of one reading, all (n,)."""

    strength: dict[str, Array]
    strength_sd: dict[str, Array]
    dip: Array
    dip_sd: Array
    latitude: Array  #: minus the dip of the Earth rate
    latitude_sd: Array


def magnitudes(seen: Mapping[str, Array], tool: Tool, heat: Array | None, size: int) -> Magnitudes:
    """Strengths relative to the stand, dip and latitude, with uncertainty from calibration and noise."""
    strength, spread, blocks = {}, {}, {}
    for kind, field in seen.items():
        # covariance (n, 3, 3) of a field vector from its triad's parameters and one reading's noise
        triad = tool.triads[kind]
        powers, inverse = triad.basis(heat), triad.inverse_at(field, heat)
        regressor = np.concatenate([field, np.ones((len(field), 1))], axis=1)
        design = (np.broadcast_to(powers, (len(field), triad.degree + 1))[:, :, None] * regressor[:, None, :]).reshape(
            len(field), -1
        )
        terms, count = triad.degree + 1, triad.count
        own = tool.covariance[tool.slices[kind], tool.slices[kind]].reshape(terms, count, 4, terms, count, 4)
        ordered = own.transpose(1, 0, 2, 4, 3, 5).reshape(count, terms * 4, count, terms * 4)
        signal = np.einsum("np,apbq,nq->nab", design, ordered, design, optimize=True) + np.diag(tool.noise[kind] ** 2)
        covariance = np.asarray(inverse @ signal @ np.swapaxes(inverse, -1, -2))
        strength[kind] = np.linalg.norm(field, axis=1)
        unit = field / strength[kind][:, None]
        # a length that is known has no variance, but for rounding
        spread[kind] = np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", unit, covariance, unit), 0.0))
        blocks[kind] = covariance
    dip, dip_sd = _dip(seen, blocks, "magnetometer", size)
    below, latitude_sd = _dip(seen, blocks, "gyro", size)
    return Magnitudes(strength, spread, dip, dip_sd, -below, latitude_sd)


def _dip(seen: Mapping[str, Array], blocks: Mapping[str, Array], second: str, size: int) -> tuple[Array, Array]:
    """Dip (n,) of the second field and its standard uncertainty; NaN where it is not seen."""
    if second not in seen:
        return np.full(size, np.nan), np.full(size, np.nan)
    g, b = seen["accelerometer"], seen[second]
    jacobian = dip_jacobian(g, b)
    # the triads' parameters are correlated through the rig; for a tolerance their own parts suffice
    variance = sum(
        np.einsum("ni,nij,nj->n", jacobian[:, 3 * p : 3 * p + 3], blocks[k], jacobian[:, 3 * p : 3 * p + 3])
        for p, k in enumerate(("accelerometer", second))
    )
    return dip_angle(g, b), np.sqrt(variance)


def _opposite(seen: Array, stated: float | None) -> float | None:
    """Median of angles seen (n,), rad, whose sign is not that of the stated one; None within 10 deg of 0."""
    if stated is None or abs(stated) < np.radians(10.0) or not np.isfinite(seen).any():
        return None
    middle = float(np.nanmedian(seen))
    return None if middle * stated > 0.0 or abs(middle) < np.radians(10.0) else middle


def reversed_field(dip: Array, site: Site | None) -> list[Finding]:
    """Whether the dips (n,) measured have the opposite sign of the site's: azimuths are then half a turn off."""
    middle = None if site is None else _opposite(dip, site.dip)
    if site is None or site.dip is None or middle is None:
        return []
    known = site.latitude is not None and abs(site.latitude) >= np.radians(20.0)
    signs = "unknown" if not known else "site" if middle * (site.latitude or 0.0) > 0.0 else "triad"
    return [_sign("dip", middle, site.dip, signs)]


def reversed_rate(latitude: Array, site: Site | None) -> list[Finding]:
    """Whether the latitudes (n,) measured have the opposite sign of the site's: one of three signs is wrong."""
    middle = None if site is None else _opposite(latitude, site.latitude)
    if site is None or site.latitude is None or middle is None:
        return []
    return [_sign("latitude", middle, site.latitude, "latitude")]


SIGNS: Final = {
    "unknown": (
        "its sign is wrong, or one triad is reversed and azimuths are off by 180 deg",
        "Check dip_deg (positive: field points down) and the axes (--convention)",
    ),
    "site": (
        "the readings fit the latitude of the site",
        "Correct the sign of dip_deg (positive: field points down, as in the north)",
    ),
    "triad": (
        "one triad is reversed, azimuths are off by 180 deg",
        "State the axes by --convention, or calibrate again with the stand's dip",
    ),
    "latitude": (
        "one of three signs is wrong",
        "Check latitude_deg, the gyro (azimuth off by 180 deg) and the accelerometer (inclination from the other end)",
    ),
}
"""Cause of an opposite sign and what to do, by what the latitude of the site shows of a dip, and of a latitude."""


def _sign(quantity: str, measured: float, stated: float, signs: str) -> Finding:
    values: dict[str, Value] = {"quantity": quantity, "measured_deg": float(np.degrees(measured))}
    cause, advice = SIGNS[signs]
    values |= {"stated_deg": float(np.degrees(stated)), "cause": cause, "advice": advice}
    return Finding("survey-sign", values)


TOLERANCE = 3.0
"""Standard uncertainties by which a magnitude may differ from its reference before it is flagged."""


def station_flags(
    found: Angles, inclination_sd: Array, size: Magnitudes, tool: Tool | None, heat: Array | None, reference: Reference
) -> list[list[str]]:
    """Names of what is remarkable at each station; without a tool its range of temperature is not judged."""
    rows: dict[str, Mask] = {}
    tilt = np.minimum(found.inclination, np.pi - found.inclination)
    rows["vertical"] = tilt < 5.0 * inclination_sd
    if heat is not None and tool is not None and tool.temperature_range is not None:
        low, high = tool.temperature_range
        rows["temperature"] = (heat < low - HEAT_MARGIN) | (heat > high + HEAT_MARGIN)
    for name, kind in (("g", "accelerometer"), ("b", "magnetometer"), ("rate", "gyro")):
        if kind in size.strength and reference.strength.get(kind) is not None:
            wanted, sigma = reference.strength[kind]
            off = np.abs(size.strength[kind] - wanted)
            rows[name] = off > TOLERANCE * np.hypot(size.strength_sd[kind], sigma)
    if reference.dip is not None:
        wanted, sigma = reference.dip
        rows["dip"] = np.abs(size.dip - wanted) > TOLERANCE * np.hypot(size.dip_sd, sigma)
    if reference.latitude is not None:
        wanted, sigma = reference.latitude
        rows["latitude"] = np.abs(size.latitude - wanted) > TOLERANCE * np.hypot(size.latitude_sd, sigma)
    rows["no-azimuth"] = np.isnan(found.azimuth)
    return [[name for name, hit in rows.items() if hit[k]] for k in range(len(tilt))]


HEAT_MARGIN = 5.0
"""How far outside the calibrated temperatures a reading may lie before it is flagged, degC."""


class Reference(NamedTuple):
    """Expected strengths (relative to the stand), dip and latitude (rad), each with its standard uncertainty."""

    strength: dict[str, tuple[float, float]]
    dip: tuple[float, float] | None
    latitude: tuple[float, float] | None = None


# Standard uncertainties taken where a reference is stated without one: gravity from a map; a global magnetic model with
# crustal anomalies (ISCWSA MWD error model: 130 nT, 0.2 deg at one standard deviation)
_SIGMA_G, _SIGMA_B, _SIGMA_DIP = 0.002, 130.0, np.radians(0.2)


def reference_of(tool: Tool, site: Site | None, calibration_dip: float | None) -> Reference:
    """What the site says; without a site, the fields of the stand, within what two places usually differ by."""
    known = {kind: triad.field_strength for kind, triad in tool.triads.items() if triad.field_strength is not None}
    found = reference_in(known, site, calibration_dip)
    if "gyro" in tool.triads:
        # a calibration at rest knows the Earth rate as 1, whether it says so or not
        found.strength["gyro"] = (EARTH_RATE / known.get("gyro", EARTH_RATE), 0.0)
    if site is None:
        # gravity varies by half a per cent over the Earth; the magnetic field by more than any tolerance would bear
        found.strength["accelerometer"] = (1.0, 0.002)
    return found


def reference_in(units: Mapping[str, float], site: Site | None, calibration_dip: float | None) -> Reference:
    """What the site says, strengths in multiples of `units` (kind -> m/s^2, nT); kinds not in `units` are left out."""
    strength: dict[str, tuple[float, float]] = {}
    for kind, name, sigma in (("accelerometer", "g", _SIGMA_G), ("magnetometer", "b", _SIGMA_B)):
        value = None if site is None else getattr(site, name)
        if value is not None and kind in units:
            stated = getattr(site, f"{name}_sigma")
            strength[kind] = (value / units[kind], (sigma if stated is None else stated) / units[kind])
    # a plumb line leaves the normal of the ellipsoid by some ten, in mountains by up to sixty seconds of arc
    latitude = None if site is None or site.latitude is None else (site.latitude, np.radians(20.0 / 3600.0))
    if site is not None and site.dip is not None:
        dip = (site.dip, _SIGMA_DIP if site.dip_sigma is None else site.dip_sigma)
        return Reference(strength, dip, latitude)
    # without a site a dip ten degrees off the stand's is no place's but a wiring fault's
    return Reference(strength, None if calibration_dip is None else (calibration_dip, np.radians(3.0)), latitude)


ORDINARY: Final = ("vertical", "no-azimuth", "down-assumed")
"""Flags that are no news of a vertical hole, of readings without a second field, or of a hole that goes down."""


def flagged(name: str, rows: Sequence[int], total: int, meanings: Mapping[str, str] = FLAGS) -> Finding:
    """The finding on a flag at some of the stations; one that the `meanings` lack is of another version."""
    severity: Severity = "note" if name in ORDINARY else "warning"
    meaning = meanings.get(name, "not a flag of this version")
    values: dict[str, Value] = {"count": len(rows), "total": total, "flag": name, "meaning": meaning}
    return Finding("survey-flagged", values, tuple(rows), severity)


def summary(flags: Sequence[Sequence[str]], meanings: Mapping[str, str] = FLAGS) -> list[Finding]:
    """One finding for each kind of flag that occurs, in the order of the `meanings`."""
    where = {name: [row for row, names in enumerate(flags) if name in names] for name in meanings}
    return [flagged(name, rows, len(flags), meanings) for name, rows in where.items() if rows]
