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
from inclinometry.errors import InputError
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
    """The certificate's covariance as sources of error of a well whose raw channels are not at hand.

    Parameters
    ----------
    tool : Tool
        Calibrated: with the covariance of its parameters.
    survey : WellSurvey
        Its site states gravity (or latitude), b, dip and declination: what the tool saw is computed from them.
    toolface : (n,) array_like
        Of each station, rad. Errors of the sensors across the tool turn with it, so it can't be guessed.
    temperature : (n,) array_like, optional
        degC; needed when the tool's parameters depend on it.
    propagation : str
        As `calibration_sources`.

    Returns
    -------
    tuple of MatrixSource
        See `calibration_sources`, which takes what the tool has measured in place of what it should have.

    Raises
    ------
    InputError
        No magnetometer; a covariance and a noise of zero: the certificate states no uncertainty; a site that lacks a
        field.

    Examples
    --------
    >>> from inclinometry.position.propagation import propagate
    >>> from inclinometry.position.well import well_survey
    >>> from inclinometry.sensors import Triad
    >>> triads = {k: Triad(k, np.eye(3), np.zeros(3), field_strength=s) for k, s in zip(VECTORS, (9.81, 5e4))}
    >>> tool = Tool("1", triads, np.diag(np.tile([0.0, 0.0, 0.0, 1e-6], 6)))  # offsets: 0.001 of each field
    >>> site = Site(g=9.81, b=5e4, dip=np.radians(60.0), declination=0.0)
    >>> well = well_survey([0.0, 500.0, 1000.0], np.radians([90.0, 90.0, 90.0]), [0.0, 0.0, 0.0], site)
    >>> found = propagate(well, sources=error_model(tool, well, [0.0, 0.0, 0.0]))
    >>> np.sqrt(np.diagonal(found.covariance[-1])).round(3)  # levers 250 + 500 m; the first station is known
    array([0.   , 1.984, 0.75 ])
    """
    site = survey.site
    known = {"gravity (or the latitude)": site.gravity, "b": site.b, "dip": site.dip, "declination": site.declination}
    lacking = [name for name, value in known.items() if value is None]
    if lacking:
        raise InputError(
            f"the site has no {lacking[0]}; what the tool saw is computed from it: give it, or raw channels"
        )
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
    """What is uncertain of six-axis stations as sources of error of the well's positions.

    Parameters
    ----------
    stations : Stations
        From `inclinometry.survey.from_tool`, or what corrections made of them.
    survey : WellSurvey
        A station of each measured depth; it may have others above and below (the wellhead, other runs), of which the
        sources say nothing. Its site states the declination.
    propagation : {"systematic", "well", "global"}
        What shares the errors: the run, or, where one tool surveyed them all, the well or all wells.

    Returns
    -------
    tuple of MatrixSource
        One for each source of the stations, under its name and with all the correlations of its parameters, and
        "sensor noise", random.

    Raises
    ------
    InputError
        Stations that are not of this well: depths that do not match, angles apart by more than 5 deg; stations of which
        nothing is uncertain; a site without declination.

    Notes
    -----
    d(inclination, azimuth)/dp = J d(fields)/dp with J of `angles_jacobian`; near the vertical, where the azimuth has no
    derivative but the hole has a direction, d(direction)/dp with J of `axis_jacobian`, turned from magnetic to true
    north.

    Examples
    --------
    >>> from inclinometry.position.well import well_survey
    >>> noise = np.tile(np.diag([1e-6, 1e-6, 1e-6, 900.0, 900.0, 900.0]), (2, 1, 1))
    >>> down = Stations([0.0, 30.0], [[0.0, 0.0, 9.8]] * 2, [[2e4, 0.0, 4e4]] * 2, noise=noise)
    >>> well = well_survey([0.0, 30.0], [0.0, 0.0], [0.0, 0.0], Site(declination=0.1))
    >>> [(one.name, one.propagation) for one in calibration_sources(down, well)]
    [('sensor noise', 'random')]
    """
    if propagation not in ("systematic", "well", "global"):
        raise InputError(f"propagation is {propagation!r}; what stations share is systematic, well or global")
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
        raise InputError(
            "the certificate states no uncertainty: neither covariance nor noise is known of these stations; calibrate "
            "with a method that gives a covariance, or take a tool code"
        )
    return tuple(found)


def _declination(site: Site) -> float:
    if site.declination is None:
        raise InputError("the site has no declination; a magnetic tool's azimuths need it: give the declination")
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
    """The site's declination as a source of error, of which no certificate knows; none where its sigma is not stated.

    Parameters
    ----------
    survey : WellSurvey
    propagation : {"systematic", "well", "global"}
        Neighbouring wells share an error of the magnetic model.

    Examples
    --------
    >>> from inclinometry.position.well import well_survey
    >>> site = Site(declination=0.1, declination_sigma=0.005)
    >>> one = reference_sources(well_survey([0.0, 30.0], [1.0, 1.0], [0.0, 0.0], site))[0]
    >>> one.name, one.propagation, float(one.covariance[0, 0] ** 0.5)
    ('declination', 'global', 0.005)
    """
    sigma = survey.site.declination_sigma
    if not sigma:
        return ()
    by_angles = np.zeros((len(survey), 3, 1))
    by_angles[:, 2] = 1.0
    return (MatrixSource("declination", by_angles, np.array([[sigma**2]]), propagation),)


def with_terms(code: ToolCode, names: Sequence[str], magnitudes: Mapping[str, float] | None = None) -> ToolCode:
    """Terms of a tool code to stand beside a certificate: depth, declination, sag, misalignment, interference.

    Parameters
    ----------
    code : ToolCode
        E.g. "iscwsa-mwd-rev5.1".
    names : sequence of str
        Of the terms to take. Terms of the six sensors are refused: the certificate takes their place. Declination comes
        either from here (DEC, DBH) or from `reference_sources`.
    magnitudes : mapping of name to float, optional
        One standard deviation in the term's own unit, where another than the code's is known.

    Returns
    -------
    ToolCode

    Raises
    ------
    InputError
        A name that the code does not have, a term of the sensors, a magnitude of a term that was not taken or a
        negative one.

    Examples
    --------
    >>> from inclinometry.position.tool_code import term
    >>> sag = term("SAG", 0.2, "deg", "systematic", ("0", "Sin(Inc)", "0"))
    >>> bias = term("ABZ", 0.004, "m/s2", "systematic", ("0", "-Sin(Inc) / Gfield", "0"))
    >>> code = ToolCode(name="two", terms=(sag, bias), source="example")
    >>> [(one.name, one.magnitude) for one in with_terms(code, ["SAG"], {"SAG": 0.05}).terms]
    [('SAG', 0.05)]
    """
    own = {one.name: one for one in code.terms}
    sigmas = dict(magnitudes or {})
    for name in (*names, *sigmas):
        if name not in own:
            raise InputError(f"tool code {code.name} has no term {name!r}; it has {', '.join(own)}")
        if is_sensor_term(name):
            raise InputError(f"term {name} is about the sensors, of which the certificate tells; leave it out")
    lost = [name for name in sigmas if name not in names]
    if lost:
        raise InputError(f"a magnitude is given for {lost[0]}, which is not among the terms; add it or leave it out")
    terms = [
        replace(own[name], magnitude=float(within(sigmas.get(name, own[name].magnitude), name, 0.0, 1e9)))
        for name in dict.fromkeys(names)
    ]
    return replace(
        code,
        name=f"{code.name}, in part",
        terms=tuple(terms),
        description=f"{', '.join(names)} of {code.name}; errors of the sensors come from the tool itself",
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
    """Refuse a tool code that cannot stand beside the certificate of a magnetic tool.

    Raises
    ------
    InputError
        A gyro's code; a code for surveys corrected axially.

    Examples
    --------
    >>> from inclinometry.position.tool_code import term
    >>> drift = term("GB1", 0.1, "deg/hr", "systematic", ("0", "0", "1 / EarthRate"))
    >>> fits_certificate(ToolCode(name="gyro", terms=(drift,), source="example"))
    Traceback (most recent call last):
    inclinometry.errors.InputError: tool code gyro is of a gyro; ...
    """
    if any(one.unit in ("deg/hr", "deg/sqr(hr)") for one in code.terms):
        raise InputError(
            f"tool code {code.name} is of a gyro; the certificate of a magnetic tool says nothing of it: give one of "
            "the two"
        )
    axial = [one.name for one in code.terms if (found := SENSOR_TERMS.match(one.name)) and found[1]]
    if axial:
        raise InputError(
            f"tool code {code.name} is for surveys corrected for axial interference ({axial[0]} ...); the certificate "
            "is of the tool as it is: give the code without that correction"
        )
