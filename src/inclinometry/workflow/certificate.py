"""A tool's own calibration as the error model of a well: what its sensors saw at each station, measured or computed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from inclinometry.attitude.orientation import fields
from inclinometry.calibration.result import Calibration, same_units
from inclinometry.core.arrays import Array, Index
from inclinometry.core.errors import InputError
from inclinometry.earth.site import convert_azimuth
from inclinometry.io.position_csv import WellStations
from inclinometry.io.survey_csv import RawSurvey
from inclinometry.position.sources import MatrixSource
from inclinometry.position.well import WellSurvey
from inclinometry.sensors.tool import Tool

SAME_DEPTH = 0.005
"""Depths of two files that differ by less, m, are of one station: both are written to centimetres at least."""


def certificate_sources(
    calibration: Calibration, well: WellSurvey, stations: WellStations, raw: RawSurvey | None = None
) -> tuple[Sequence[MatrixSource], list[str]]:
    """Sources of error of a surveyed well from the covariance of its tool.

    Parameters
    ----------
    calibration : Calibration
    well : WellSurvey
    stations : WellStations
        The file the well came from: toolface and temperature where it has them.
    raw : RawSurvey, optional
        Raw channels at these stations; else they are computed from the site's field and the attitudes.

    Returns
    -------
    sources : sequence of MatrixSource
    sentences : list of str
        What was taken for granted.

    Raises
    ------
    InputError
        A station without raw channels; a site that does not say which way the fields point; no covariance.
    """
    tool = calibration.tool
    if not np.any(np.diagonal(tool.covariance)):
        raise InputError(
            f"the calibration of {tool.name or 'this tool'} states no covariance, so it says nothing of positions; "
            "calibrate by a method that does (joint), or give a tool code"
        )
    if raw is not None:
        same_units(raw.units, calibration)
        rows = _rows(stations, raw)
        channels = {kind: signals[rows] for kind, signals in raw.channels.items()}
        temperature = None if raw.temperature is None else raw.temperature[rows]
        said: list[str] = []
    else:
        temperature, said = _temperature(tool, stations)
        channels, more = synthetic_channels(tool, well, stations.toolface, temperature)
        said += more
    return _sources(calibration, well, channels, temperature), said


def _sources(
    calibration: Calibration, well: WellSurvey, channels: Mapping[str, Array], temperature: Array | None
) -> Sequence[MatrixSource]:
    from inclinometry.position.certificate import error_model  # type: ignore[import-not-found]

    return error_model(calibration, well, channels, temperature)  # type: ignore[no-any-return]


def _rows(stations: WellStations, raw: RawSurvey) -> Index:
    """Row of the raw file for each station."""
    rows = np.searchsorted(0.5 * (raw.md[1:] + raw.md[:-1]), stations.md)  # the nearest
    off = np.abs(raw.md[rows] - stations.md) > SAME_DEPTH
    if off.any():
        row = int(np.argmax(off))
        raise InputError(
            f"{stations.path}, line {stations.lines[row]}: the raw channels have no station at {stations.md[row]:.10g} "
            f"m (nearest {raw.md[rows[row]]:.10g} m); give those of this survey, or leave out --raw"
        )
    return rows


def _temperature(tool: Tool, stations: WellStations) -> tuple[Array | None, list[str]]:
    """Temperature of each station, and a sentence where the tool needs one and the file has none."""
    if stations.temperature is not None and np.isfinite(stations.temperature).all():
        return stations.temperature, []
    warm = [triad for triad in tool.triads.values() if triad.degree]
    if not warm:
        return None, []
    at = warm[0].reference_temperature
    said = f"the stations state no temperature: the calibration's reference, {at:g} degC, was taken throughout"
    return np.full(len(stations), at), [said]


def synthetic_channels(
    tool: Tool, well: WellSurvey, toolface: Array | None, temperature: Array | None
) -> tuple[dict[str, Array], list[str]]:
    """Channels that a tool would have shown at the stations in the site's fields, and what was taken for granted.

    Parameters
    ----------
    tool : Tool
    well : WellSurvey
    toolface : (n,) rad, optional
        0 where it is not given or NaN: errors across the tool then never cancel by its turning.
    temperature : (n,) degC, optional

    Raises
    ------
    InputError
        A site without dip and declination (magnetometers) or latitude (gyros).

    Examples
    --------
    >>> from inclinometry.earth.site import Site
    >>> from inclinometry.position.well import well_survey
    >>> from inclinometry.sensors.triad import Triad
    >>> kinds = ("accelerometer", "magnetometer")
    >>> tool = Tool("1", {k: Triad(k, np.eye(3), np.zeros(3)) for k in kinds})
    >>> well = well_survey([0, 30], [0.0, np.pi / 2], [0.0, 0.0], Site(dip=0.0, declination=0.0))
    >>> channels, said = synthetic_channels(tool, well, None, None)
    >>> channels["magnetometer"].round(9) + 0.0  # along x looking down, along z in a hole that runs north
    array([[1., 0., 0.],
           [0., 0., 1.]])
    """
    said = ["no raw channels were given: the fields at the stations are the site's, at the survey's attitudes"]
    turn = np.zeros(len(well)) if toolface is None else np.where(np.isnan(toolface), 0.0, toolface)
    if toolface is None or np.isnan(toolface).any():
        said.append("the survey does not state every toolface: 0 was taken, where errors across the tool never cancel")
    second = "magnetometer" if "magnetometer" in tool.triads else "gyro"
    azimuth, dip = _second_field(well, second)
    directions = dict(zip(("accelerometer", second), fields(azimuth, well.inclination, turn, dip), strict=True))
    strengths = {"accelerometer": well.site.gravity, "magnetometer": well.site.b}
    channels = {}
    for kind, direction in directions.items():
        if kind not in tool.triads:
            raise InputError(f"the calibration has no {kind}; a path needs inclination and azimuth from the tool")
        triad = tool.triads[kind]
        here, there = strengths.get(kind), triad.field_strength
        # in units of the field at the stand, as the calibration counts
        size = here / there if here is not None and there is not None else 1.0
        channels[kind] = triad.signals(size * direction, temperature)
    return channels, said


def _second_field(well: WellSurvey, kind: str) -> tuple[Array, float]:
    """Azimuth of the stations from the second field's north, and that field's dip."""
    site = well.site
    if kind == "magnetometer":
        if site.dip is None:
            raise InputError("the site has no dip; a magnetometer's errors depend on it: give the dip")
        return convert_azimuth(well.azimuth, "true", "magnetic", site), site.dip
    if site.latitude is None:
        raise InputError("the site has no latitude; a gyro's errors depend on it: give the latitude")
    return well.azimuth, -site.latitude
