"""Fields of the P7/17 records M7 and G7, and what the header says of their units and north."""

from __future__ import annotations

import re
from typing import Final

from inclinometry.core.errors import FileError

_START: Final = ("version", "survey", "record", "time")
_PLACE: Final = ("md", "inclination", "azimuth", "north", "east", "tvd", "g.0", "g.1", "g.2")
FIELDS: Final = {
    "M7": (
        *_START, "transmitted", "used", *_PLACE, "b.0", "b.1", "b.2", "toolface", "magnetic_toolface",
        "measured.g", "measured.b", "measured.dip", "reference.g", "reference.b", "reference.dip",
        "reference.declination", "reference.convergence", "extension",
    ),
    "G7": (
        *_START, "used", *_PLACE, "w.0", "w.1", "w.2", "toolface", "gyro_toolface",
        "measured.g", "measured.latitude", "measured.earth_rate", "reference.g", "reference.latitude",
        "reference.earth_rate", "reference.convergence", "extension",
    ),
}  # fmt: skip
"""What follows the identifier: a quantity of `_quantities`, else text."""

LENGTHS: Final = ("md", "north", "east", "tvd")
UNITS: Final = {"1": "m", "5": "ft", "6": "ftUS"}
"""Reference numbers of units of length a depth may be in (IOGP 483-7, table of format-defined units)."""
NORTHS: Final = {"6": "magnetic", "7": "true", "8": "grid"}
"""Types of azimuth (wellbore observables)."""
AZIMUTH_NAMES: Final = {"magnetic": "AZIM_MAGN", "true": "AZIM_TRUE", "grid": "AZIM_GRID"}
SURVEY_DETAILS: Final = ("H7", "1", "5", "1")

_STAMP: Final = re.compile(r"(\d{4}):(\d\d):(\d\d):(\d\d:\d\d:\d\d(?:\.\d+)?)", re.ASCII)
_ISO: Final = re.compile(r"(\d{4})-(\d\d)-(\d\d)[T ](\d\d:\d\d:\d\d(?:\.\d+)?)(?:Z|\+00:00)?", re.ASCII)


def iso_time(text: str) -> str | None:
    """ISO 8601 from a P7/17 date and time, which are in UTC; None where it is neither that nor empty.

    Examples
    --------
    >>> iso_time("2014:09:17:13:15:22.0"), iso_time(""), iso_time("17 Sep 2014")
    ('2014-09-17T13:15:22.0Z', '', None)
    """
    found = _STAMP.fullmatch(text)
    return "" if not text else f"{found[1]}-{found[2]}-{found[3]}T{found[4]}Z" if found else None


def p7_time(text: str) -> str | None:
    """A P7/17 date and time from ISO 8601, UTC or without a zone; None where it is neither that nor empty.

    Examples
    --------
    >>> p7_time("2014-09-17T13:15:22.0Z")
    '2014:09:17:13:15:22.0'
    """
    found = _ISO.fullmatch(text)
    return "" if not text else f"{found[1]}:{found[2]}:{found[3]}:{found[4]}" if found else None


def survey_details(cells: list[str], line: int, path: str) -> tuple[int, str | None, str | None] | None:
    """Survey number, unit of depth and north from a Survey Details record; None for any other record.

    Raises
    ------
    FileError
        Too few fields, or depths in no unit of length.
    """
    if tuple(cells[:4]) != SURVEY_DETAILS:
        return None
    if len(cells) < 14 or not cells[5].isdigit():
        problem = f"Survey Details has {len(cells)} fields, survey number {cells[5:6]}; 23 and a number are needed"
        raise FileError(problem, path=path, line=line)
    unit = UNITS.get(cells[6])
    if unit is None:
        allowed = ", ".join(f"{k} ({v})" for k, v in UNITS.items())
        raise FileError(f"the unit of depth is {cells[6]!r}; allowed: {allowed}", path=path, line=line)
    return int(cells[5]), unit, NORTHS.get(cells[12])
