"""A tool's own certificate as the error model of a position: what it states, and what it cannot know beside it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, finite, within
from inclinometry.constants import VECTORS
from inclinometry.earth.site import Site, convert_azimuth
from inclinometry.errors import SiteError, not_among, refused
from inclinometry.findings import Finding
from inclinometry.orientation import angles, angles_jacobian, axis_jacobian, fields
from inclinometry.position.propagation import MatrixSource, check_directions, rows_of
from inclinometry.position.tool_code import ToolCode
from inclinometry.position.well import WellSurvey
from inclinometry.sensors import Tool
from inclinometry.survey.from_stations import NOISE
from inclinometry.survey.from_tool import stations_from_tool
from inclinometry.survey.stations import Stations

SENSOR_TERMS: Final = re.compile(r"[AM][BS](I?)(XY?|Y|Z)(?![A-Z])", re.IGNORECASE)
"""Names of terms that a certificate replaces: biases and scales of the six sensors, I where corrected axially."""


def error_model(
    tool: Tool,
    survey: WellSurvey,
    toolface: ArrayLike,
    *,
    temperature: ArrayLike | None = None,
    propagation: str = "systematic",
) -> tuple[MatrixSource, ...]:
    """The certificate's covariance as sources of error of a well without raw channels: what the tool saw is computed.

    The site states gravity (or latitude), b, dip and declination. Errors of the sensors across the tool turn with the
    toolface (n,), rad, so it is needed. Temperature (n,), degC, where the parameters depend on it.
    """
    site = survey.site
    known = {
        "latitude_deg": site.gravity, "b_nT": site.b, "dip_deg": site.dip, "declination_deg": site.declination,
    }  # fmt: skip
    lacking = tuple(name for name, value in known.items() if value is None)
    if lacking:
        raise SiteError(Finding("input-missing", {"names": lacking}))
    strengths = dict(zip(VECTORS, (float(site.gravity or 0.0), float(site.b or 0.0)), strict=True))
    azimuth = convert_azimuth(survey.true_azimuth, "true", "magnetic", survey.site)
    angle = finite(toolface, "toolface", (len(survey),))
    directions_seen = fields(azimuth, survey.inclination, angle, survey.site.dip or 0.0)
    heat = None if temperature is None else finite(temperature, "temperature", (len(survey),))
    channels = {}
    for kind, direction in zip(VECTORS, directions_seen, strict=True):
        if kind in tool.triads:
            own = tool.triads[kind].field_strength
            channels[kind] = tool.triads[kind].signals(direction * (strengths[kind] / (own or strengths[kind])), heat)
    stations = stations_from_tool(
        survey.md, channels, tool, temperature=heat, g=strengths["accelerometer"], b=strengths["magnetometer"]
    )
    return calibration_sources(stations, survey, propagation=propagation)


def calibration_sources(
    stations: Stations, survey: WellSurvey, *, propagation: str = "systematic"
) -> tuple[MatrixSource, ...]:
    """What is uncertain of six-axis stations as sources of error of the well's positions, and "sensor noise", random.

    `propagation`: what shares the errors: the run ("systematic"), the well, all wells ("global"). The survey may have
    stations of other runs. Depths must match, angles within 5 deg. d(inclination, azimuth)/dp = J d(fields)/dp with J
    of `angles_jacobian`; near the vertical d(direction)/dp with J of `axis_jacobian`, turned to true north.
    """
    if propagation not in ("systematic", "well", "global"):
        raise not_among("propagation", propagation, ("systematic", "well", "global"))
    rows = rows_of(survey, stations.md)
    seen = angles(stations.g, stations.b)
    check_directions(survey, rows, stations.md, seen.inclination, seen.azimuth + _declination(survey.site))
    # derivatives (n, 3, 6) by the fields
    level = np.hypot(stations.g[:, 0], stations.g[:, 1]) / np.linalg.norm(stations.g, axis=1)
    # near the vertical sources tell of the direction of the hole, not of inclination and azimuth
    steep = level < np.sin(np.radians(1.0))
    by_angles = np.zeros((len(stations), 3, 6))
    by_angles[:, 1:] = angles_jacobian(stations.g, stations.b)[:, :2]
    by_angles[steep] = 0.0
    axis = axis_jacobian(stations.g, stations.b)
    c, s = np.cos(_declination(survey.site)), np.sin(_declination(survey.site))
    north, east = c * axis[:, 0] - s * axis[:, 1], s * axis[:, 0] + c * axis[:, 1]
    by_direction = np.stack([north, east, axis[:, 2]], axis=1)
    by_direction[~steep] = np.nan
    found = []
    for name, source in stations.sources.items():
        if source.covariance.any():
            parts = (by_angles @ source.by_field, by_direction @ source.by_field)
            found.append(_placed(name, parts, source.covariance, propagation, rows, len(survey)))
    if stations.noise.any():
        root = _roots(stations.noise)
        parts = (by_angles @ root, by_direction @ root)
        found.append(_placed(NOISE, parts, np.eye(6), "random", rows, len(survey)))
    if not found:
        raise refused("position-certificate")
    return tuple(found)


def _declination(site: Site) -> float:
    if site.declination is None:
        raise SiteError(Finding("input-missing", {"names": ("declination_deg",)}))
    return site.declination


def _placed(
    name: str, parts: tuple[Array, Array], covariance: Array, propagation: str, rows: Index, size: int
) -> MatrixSource:
    """A source with rows for all stations of the well, nothing where the tool was not."""
    shape = (size, 3, len(covariance))
    by_angles, by_direction = np.zeros(shape), np.full(shape, np.nan)
    by_angles[rows], by_direction[rows] = parts
    return MatrixSource(name, by_angles, covariance, propagation, by_direction)


def _roots(covariances: Array) -> Array:
    """Factors R (n, 6, 6) with R R' = C, of covariances that may be singular."""
    sigma = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    scale = np.where(sigma > 0.0, sigma, 1.0)
    # m/s^2 and nT: rounding is judged as a correlation
    values, vectors = np.linalg.eigh(covariances / (scale[:, :, None] * scale[:, None, :]))
    return np.asarray(scale[:, :, None] * vectors * np.sqrt(np.clip(values, 0.0, None))[:, None, :])


def reference_sources(survey: WellSurvey, *, propagation: str = "global") -> tuple[MatrixSource, ...]:
    """The site's declination as a source of error, shared by neighbouring wells; none where its sigma is not stated."""
    sigma = survey.site.declination_sigma
    if not sigma:
        return ()
    by_angles = np.zeros((len(survey), 3, 1))
    by_angles[:, 2] = 1.0
    return (MatrixSource("declination", by_angles, np.array([[sigma**2]]), propagation),)


def with_terms(code: ToolCode, names: Sequence[str], magnitudes: Mapping[str, float] | None = None) -> ToolCode:
    """The terms of a tool code that go beside a certificate: depth, declination, sag, misalignment, interference.

    Terms of the six sensors are refused: the certificate takes their place. Declination comes either from here (DEC,
    DBH) or from `reference_sources`. `magnitudes` replaces one standard deviation of a term, in its own unit.
    """
    own = {one.name: one for one in code.terms}
    sigmas = dict(magnitudes or {})
    for name in (*names, *sigmas):
        if name not in own:
            raise not_among(f"{code.name}.term", name, own)
        if is_sensor_term(name):
            raise refused("input-not-with", {"name": name, "other": "calibration"})
    lost = tuple(name for name in sigmas if name not in names)
    if lost:
        raise refused("input-needs", {"name": "magnitudes", "needed": lost})
    terms = [
        replace(own[name], magnitude=float(within(sigmas.get(name, own[name].magnitude), name, 0.0, 1e9)))
        for name in dict.fromkeys(names)
    ]
    return replace(
        code,
        name=f"{code.name}: {', '.join(names)}",
        terms=tuple(terms),
        description="",
    )


def is_sensor_term(name: str) -> bool:
    """Whether a term is about bias or scale of accelerometers or magnetometers.

    Examples
    --------
    >>> [is_sensor_term(name) for name in ("ABXY-TI1S", "MSZ", "AMIL", "DEC-U")]
    [True, True, False, False]
    """
    return SENSOR_TERMS.match(name) is not None


def fits_certificate(code: ToolCode) -> None:
    """Refuse a gyro's code, or one for axially corrected surveys, beside the certificate of a magnetic tool."""
    gyro = [one.name for one in code.terms if one.unit in ("deg/hr", "deg/sqr(hr)")]
    axial = [one.name for one in code.terms if (found := SENSOR_TERMS.match(one.name)) and found[1]]
    if gyro or axial:
        raise refused("position-code-certificate", {"code": code.name, "term": (*gyro, *axial)[0]})
