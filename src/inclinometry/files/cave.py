"""Files of cave-survey programs: Survex (.svx), Therion (.th) and Compass (.dat).

They know straight legs between stations, so a leg here is the chord of minimum curvature between two stations: the
program finds the same positions. Azimuths from magnetic north go with the declination where the survey states one;
azimuths from true or grid north are written as they are, with no declination to be added.

Sources: the manual of Survex, commands BEGIN, DATA, UNITS, DECLINATION; the Therion Book, centreline; the page "Survey
data file format" of Compass, fountainware.com.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from inclinometry.constants import FOOT
from inclinometry.errors import InputError, refused
from inclinometry.files.survey_file import SurveyFile
from inclinometry.files.writing import write_bytes, write_text
from inclinometry.findings import Finding
from inclinometry.survey.path import minimum_curvature

HELD: Final = ("md_m", "inclination_deg", "azimuth_deg", "azimuth_reference", "declination_deg")
"""Columns of a survey that these files hold."""


Leg: TypeAlias = tuple[str, str, float, float, float, float]
"""A station and the next, length in m, degrees from north and from the horizontal, upwards, depth of the next."""


def legs(survey: SurveyFile) -> list[Leg]:
    """Legs between the stations that are used: chords of minimum curvature."""
    if survey.inclination is None or survey.azimuth is None:
        raise refused("input-missing", {"names": ("inclination_deg", "azimuth_deg")})
    rows = np.arange(len(survey)) if survey.used is None else np.flatnonzero(survey.used)
    angles = survey.inclination[rows], survey.azimuth[rows]
    for name, values in zip(("inclination", "azimuth"), angles, strict=True):
        if np.isnan(values).any():
            row = int(rows[int(np.argmax(np.isnan(values)))])
            raise InputError(Finding("table-empty", {"column": f"{name}_deg"}, (row,)))
    if len(rows) < 2:
        raise refused("input-few", {"name": "stations", "count": len(rows), "least": 2})
    path = minimum_curvature(survey.md[rows], *angles)
    north, east, down = (np.diff(part) for part in (path.north, path.east, path.tvd))
    flat = np.hypot(north, east)
    length = np.hypot(flat, down)
    compass = np.degrees(np.arctan2(east, north)) % 360.0
    clino = -np.degrees(np.arctan2(down, flat))
    return [
        (str(k), str(k + 1), float(length[k]), float(compass[k]), float(clino[k]), float(survey.md[rows[k + 1]]))
        for k in range(len(length))
    ]


def write_survex(file: SurveyFile, path: str | Path) -> None:
    """Write a survey as Survex data; a vertical leg has no bearing."""
    name = _name(path)
    rows = [
        # a plumbed leg has no bearing
        f"{start}\t{end}\t{length:.4f}\t"
        f"{'-' if abs(clino) > 90.0 - 5e-5 else f'{compass:.4f}'}\t{clino:.4f}\t; {md:.12g} m"
        for start, end, length, compass, clino, md in legs(file)
    ]
    declination = _declination(file)
    lines = [
        f"*begin {name}", f"; {_north(file)}", "*units tape metres", "*units compass clino degrees",
        *([] if declination is None else [f"*declination {declination:.4f} degrees"]),
        "*data normal from to tape compass clino", *rows, f"*end {name}",
    ]  # fmt: skip
    write_text("\n".join(lines) + "\n", path)


def write_therion(file: SurveyFile, path: str | Path) -> None:
    """Write a survey as Therion data; errors as `legs`."""
    declination = _declination(file)
    lines = [
        "encoding utf-8", f"survey {_name(path)}", f"  # {_north(file)}", "  centreline", "    units length metres",
        "    units compass clino degrees",
        *([] if declination is None else [f"    declination {declination:.4f} degrees"]),
        "    data normal from to length compass clino",
        *(f"      {start} {end} {length:.4f} {compass:.4f} {clino:.4f} # {md:.12g} m"
          for start, end, length, compass, clino, md in legs(file)),
        "  endcentreline", "endsurvey",
    ]  # fmt: skip
    write_text("\n".join(lines) + "\n", path)


def write_compass(file: SurveyFile, path: str | Path) -> None:
    """Write a survey as Compass data: feet and degrees whatever is shown, passages unknown; errors as `legs`."""
    declination = _declination(file)
    unknown = " ".join(["-9.90"] * 4)  # left, up, down, right
    lines = [
        _name(path).upper(),
        "SURVEY NAME: A",
        "SURVEY DATE: 1 1 1900  COMMENT:date not stated; " + _north(file),
        "SURVEY TEAM:",
        "",
        # shown in degrees and metres, passages in metres
        f"DECLINATION: {declination or 0.0:.2f}  FORMAT: DMMDLUDRLADN  CORRECTIONS: 0.00 0.00 0.00",
        "",
        "FROM TO LENGTH BEARING INC LEFT UP DOWN RIGHT FLAGS COMMENTS",
        "",
        *(
            f"{start} {end} {length / FOOT:.4f} {compass:.4f} {clino:.4f} {unknown}"
            for start, end, length, compass, clino, _ in legs(file)
        ),
        "\f",
    ]
    write_bytes("\r\n".join(lines).encode("ascii", "replace"), path)


def _name(path: str | Path) -> str:
    """What all three programs take as the name of a survey."""
    return re.sub(r"[^A-Za-z0-9_]+", "_", Path(path).stem).strip("_") or "survey"


def _north(file: SurveyFile) -> str:
    return f"azimuths from {file.azimuth_reference} north; legs are chords of minimum curvature between the stations"


def _declination(file: SurveyFile) -> float | None:
    """Degrees, east positive, to be added to the bearings; None where they are no magnetic ones, or it is not known."""
    known = file.reference.get("declination")
    if file.azimuth_reference != "magnetic" or known is None or np.isnan(known).all():
        return None
    values = np.degrees(known[~np.isnan(known)])
    if np.ptp(values) > 0.005:
        raise refused("table-declination", {"from_deg": float(values.min()), "to_deg": float(values.max())})
    return float(values[0])
