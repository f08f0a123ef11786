"""Stations out of files: raw channels of a calibrated tool, fields in any format, or a survey's totals and angles."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from inclinometry.attitude.orientation import fields
from inclinometry.calibration.result import Calibration, same_units
from inclinometry.core.arrays import Array, Mask
from inclinometry.core.errors import FileError
from inclinometry.earth.site import Site, convert_azimuth
from inclinometry.io._lines import Progress
from inclinometry.io.columns import channel
from inclinometry.io.exchange import SurveyFile
from inclinometry.io.survey_csv import read_raw_survey
from inclinometry.io.table import read_table
from inclinometry.survey.from_tool import KINDS, stations_from_tool, stations_plain
from inclinometry.survey.stations import Stations
from inclinometry.workflow.convert import format_of, read_survey_file

_AXES = {"g": "gx, gy, gz", "b": "bx, by, bz"}

REBUILT: Final = "fields rebuilt from the survey's totals, dip and angles"
"""First line of the history of stations that come from a survey file without sensors."""


def plain_stations(
    path: str | Path, site: Site, form: str | None, convention: str | None
) -> tuple[Stations, str, tuple[str, ...]]:
    """Stations of a file of any format without a calibration, its digest and its reader's notes."""
    try:
        found = _survey_file(path, form, convention)
    except FileError:
        if format_of(path, form) == "csv" and _has_channels(path, "counts"):
            raise FileError(
                "raw channels whose names state no unit need --calibration tool.json; fields need their units in the "
                "names, as in gx_m_s2 and bx_nT",
                path=path,
            ) from None
        raise
    if found.g is None and found.b is None:
        g, b, temperature = fields_of_survey(found, site, path)
        line = REBUILT
    else:
        g, b, temperature = *(_vectors(found, name, path) for name in _AXES), _temperature(found)
        line = f"six axes as read from {Path(path).name}"
    stations = stations_plain(found.md, g, b, temperature=temperature)
    return replace(stations, history=(line,)), found.digest, found.notes


def tool_stations(
    path: str | Path, record: Calibration, site: Site, form: str | None, progress: Progress | None
) -> tuple[Stations, str, tuple[str, ...]]:
    """Stations of a calibrated tool from its raw channels, or from a survey made with it."""
    if format_of(path, form) != "csv" or not _has_channels(path):
        return _surveyed(path, record, site, form)
    raw = read_raw_survey(path, progress=progress)
    same_units(raw.units, record)
    stations = stations_from_tool(
        raw.md, raw.channels, record.tool, temperature=raw.temperature, g=site.gravity, b=site.b
    )
    return stations, raw.digest, raw.notes


def _surveyed(
    path: str | Path, record: Calibration, site: Site, form: str | None
) -> tuple[Stations, str, tuple[str, ...]]:
    """Stations of a survey by the signals the tool must have given there."""
    found = _survey_file(path, form, None)
    if found.g is not None or found.b is not None:
        problem = "holds fields in m/s^2 and nT; with --calibration raw channels (accel_x, ...) as CSV are needed"
        raise FileError(f"{problem}, or leave --calibration out", path=path)
    g, b, temperature = fields_of_survey(found, site, path)
    strengths = [record.tool.triads[kind].field_strength if kind in record.tool.triads else None for kind in KINDS]
    known = [own or stated or 1.0 for own, stated in zip(strengths, (site.gravity, site.b), strict=True)]
    channels = {
        kind: record.tool.triads[kind].signals(field / strength, temperature)
        for kind, field, strength in zip(KINDS, (g, b), known, strict=True)
        if kind in record.tool.triads
    }
    stations = stations_from_tool(found.md, channels, record.tool, temperature=temperature, g=site.gravity, b=site.b)
    line = REBUILT
    return replace(stations, history=(line, *stations.history[1:])), found.digest, found.notes


def _survey_file(path: str | Path, form: str | None, convention: str | None) -> SurveyFile:
    """The stations a file calls used."""
    name = format_of(path, form)
    if name == "wits":
        problem = "WITS names neither quantities nor units; turn it into CSV first: inclinometry convert with --map"
        raise FileError(problem, path=path)
    found = read_survey_file(path, name, {"convention": convention})
    if found.used is None or found.used.all():
        return found
    rows = np.asarray(found.used)
    if not rows.any():
        raise FileError("no station is marked as used; mark those of the survey", path=path)
    kept = _rows(found, rows)
    left = int((~rows).sum())
    return replace(kept, notes=(*kept.notes, f"{left} of {len(rows)} stations are marked as not used and left out"))


def _rows(found: SurveyFile, rows: Mask) -> SurveyFile:
    """What stations need of the rows chosen."""

    def some(value: Array | None) -> Array | None:
        return None if value is None else value[rows]

    return SurveyFile(
        md=found.md[rows],
        inclination=some(found.inclination),
        azimuth=some(found.azimuth),
        azimuth_reference=found.azimuth_reference,
        toolface=some(found.toolface),
        g=some(found.g),
        b=some(found.b),
        measured={name: values[rows] for name, values in found.measured.items()},
        temperature=some(found.temperature),
        header=found.header,
        notes=found.notes,
        digest=found.digest,
    )


def _has_channels(path: str | Path, unit: str | None = None) -> bool:
    """Whether a CSV has columns of raw channels (in a unit)."""
    table = read_table(path, numeric=lambda name: False)
    found = [channel(name) for name in table.columns]
    return any(one is not None and unit in (None, one.unit) for one in found)


def _vectors(found: SurveyFile, name: str, path: str | Path) -> Array:
    values: Array | None = getattr(found, name)
    if values is None:
        raise FileError(f"no {_AXES[name]}; all six axes with their units are needed", path=path)
    empty = np.isnan(values).any(axis=1)
    if empty.any():
        depth = found.md[int(np.argmax(empty))]
        raise FileError(f"one of {_AXES[name]} is empty at {depth:.12g} m; fill it in or remove the row", path=path)
    return values


def _temperature(found: SurveyFile) -> Array | None:
    heat = found.temperature
    return None if heat is None or np.isnan(heat).any() else heat


def fields_of_survey(found: SurveyFile, site: Site, path: str | Path) -> tuple[Array, Array, Array | None]:
    """Gravity and magnetic field (n, 3) in tool axes from totals, dip and angles, and temperature.

    Inclination, azimuth, toolface, |g|, |b| and dip are six numbers: they are the six axes written in another way.

    Raises
    ------
    FileError
        One of them is missing or empty; toolface may be, for |g|, |b| and dip do not depend on it.
    InputError
        A true or grid azimuth without the site's declination or convergence.
    """
    columns = {
        "inclination": found.inclination,
        "azimuth": found.azimuth,
        "g_total (m/s^2)": found.measured.get("g"),
        "b_total_nT": found.measured.get("b"),
        "dip": found.measured.get("dip"),
    }
    lacking = [name for name, values in columns.items() if values is None]
    if lacking:
        problem = f"no six axes, and no {', '.join(lacking)} to take their place"
        raise FileError(f"{problem}; give gx .. bz with units, or a survey with totals, dip and angles", path=path)
    values = {name: np.asarray(column) for name, column in columns.items()}
    for name, column in values.items():
        if np.isnan(column).any():
            depth = found.md[int(np.argmax(np.isnan(column)))]
            raise FileError(f"{name} is empty at {depth:.12g} m; fill it in or remove the row", path=path)
    inclination, azimuth, g_total, b_total, dip = values.values()
    azimuth = convert_azimuth(azimuth, found.azimuth_reference or "", "magnetic", site)
    toolface = np.zeros(len(found)) if found.toolface is None else np.nan_to_num(found.toolface)
    g, b = fields(azimuth, inclination, toolface, dip)
    return g_total[:, None] * g, b_total[:, None] * b, _temperature(found)
