"""From six-axis stations, corrected or not, to a survey with the uncertainty of each cause apart."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from inclinometry.arrays import within
from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.earth.site import Site
from inclinometry.errors import refused
from inclinometry.findings import without_notes
from inclinometry.orientation import angles, angles_jacobian, dip_angle, dip_jacobian
from inclinometry.sensors import Tool
from inclinometry.survey.flags import Magnitudes, reference_in, reversed_field, station_flags, summary
from inclinometry.survey.reduce import BLOCK, Survey, turned_to_north
from inclinometry.survey.stations import Stations

NOISE = "sensor noise"
"""Name of the component that is each station's own."""

ESTIMATED = ("calibration", NOISE)
"""Components whose size a calibration knows from its own readings."""


def survey_from_stations(
    stations: Stations,
    *,
    site: Site | None = None,
    tool: Tool | None = None,
    calibration_dip: float | None = None,
    inputs: Mapping[str, str] | None = None,
) -> Survey:
    """Inclination, azimuth, toolface and their uncertainties from six-axis stations: J S C S' J', by source.

    J of `orientation.angles_jacobian`, S a source's derivatives of the fields by its parameters, C their covariance. A
    dip far from `calibration_dip`, rad, that of the stand, is flagged when the site states none of its own. `tool`
    gives its name and the temperatures of its calibration.
    """
    if calibration_dip is not None:
        within(calibration_dip, "calibration_dip", -np.pi / 2, np.pi / 2, "rad")
    found = angles(stations.g, stations.b)
    taken = {NOISE, "declination", "convergence"} & set(stations.sources)
    if taken:
        raise refused("input-repeated", {"name": "sources", "value": min(taken)})
    parts = {name: np.empty((len(stations), 4)) for name in (*stations.sources, NOISE)}
    common, random = np.zeros((len(stations), 2, 2)), np.zeros((len(stations), 2, 2))
    for start in range(0, len(stations), BLOCK):
        here = slice(start, start + BLOCK)
        jacobian = angles_jacobian(stations.g[here], stations.b[here])
        for name, source in stations.sources.items():
            moved = jacobian @ source.by_field[here]
            parts[name][here] = np.sum((moved @ source.covariance) * moved, axis=2)
            common[here] += moved[:, :2] @ source.covariance @ np.swapaxes(moved[:, :2], 1, 2)
        parts[NOISE][here] = np.sum((jacobian @ stations.noise[here]) * jacobian, axis=2)
        random[here] = jacobian[:, :2] @ stations.noise[here] @ np.swapaxes(jacobian[:, :2], 1, 2)
    own = set(parts)
    azimuth, parts, north, told = turned_to_north(found.azimuth, parts, site, "magnetic")
    common[:, 1, 1] += sum(parts[name][:, 1] for name in set(parts) - own)
    size = _magnitudes(stations)
    inclination_sd = np.sqrt(np.asarray(sum(part[:, 0] for part in parts.values())))
    reference = reference_in({"accelerometer": 1.0, "magnetometer": 1.0}, site, calibration_dip)
    if site is None:
        # as for a tool: gravity varies by half a per cent over the Earth
        reference.strength["accelerometer"] = (STANDARD_GRAVITY, 0.002 * STANDARD_GRAVITY)
    flags = station_flags(found, inclination_sd, size, tool, stations.temperature, reference)
    unsaid = without_notes(stations.history)
    unknown = np.full(len(stations), np.nan)
    return Survey(
        stations.md,
        found.inclination,
        azimuth,
        found.toolface,
        found.magnetic_toolface,
        size.strength["accelerometer"],
        size.strength["magnetometer"],
        size.dip,
        parts,
        north,
        flags,
        "" if tool is None else tool.name,
        dict(inputs or {}),
        unknown,
        unknown,
        stations.history,
        common=common,
        random=random,
        findings=(*unsaid, *told, *reversed_field(size.dip, site), *summary(flags)),
    )


def _magnitudes(stations: Stations) -> Magnitudes:
    """Strengths in m/s^2 and nT, and dip, with the uncertainties of one reading from all causes."""
    covariance = stations.field_covariance()
    strength, spread = {}, {}
    for row, (kind, field) in enumerate((("accelerometer", stations.g), ("magnetometer", stations.b))):
        here = slice(3 * row, 3 * row + 3)
        strength[kind] = np.linalg.norm(field, axis=1)
        unit = field / strength[kind][:, None]
        spread[kind] = np.sqrt(np.einsum("ni,nij,nj->n", unit, covariance[:, here, here], unit))
    jacobian = dip_jacobian(stations.g, stations.b)
    dip_sd = np.sqrt(np.einsum("ni,nij,nj->n", jacobian, covariance, jacobian))
    unknown = np.full(len(stations), np.nan)
    return Magnitudes(strength, spread, dip_angle(stations.g, stations.b), dip_sd, unknown, unknown)
