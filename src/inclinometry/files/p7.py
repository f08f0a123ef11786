"""IOGP P7/17 (report 483-7): raw survey records M7 (magnetic) and G7 (gyro); every other record is kept as text.

The order of the fields is that of version 1.0. The axes of the format's own examples are those of SPE 67616, y along
the index mark and x 90 deg before it, gravity positive down: convention "iscwsa" unless the caller says otherwise.
Units: m/s^2, nT, deg/h, deg; depths and offsets in the unit that Survey Details names.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np

from inclinometry.errors import FileError, in_file, refused, wrong_kind
from inclinometry.files import writing
from inclinometry.files._quantities import quantities, unit_factor
from inclinometry.files.frame import Column, Frame, unused
from inclinometry.files.survey_file import SurveyFile, survey_of, to_vendor, values_of
from inclinometry.files.table_formats import row_width
from inclinometry.files.text import LineReader, NumberReader
from inclinometry.files.writing import write_text
from inclinometry.findings import Finding

# Fields of the P7/17 records M7 and G7, and what the header says of their units and north.

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


def iso_time(text: str) -> str | None:
    """ISO 8601 from a P7/17 date and time, which are in UTC; None where it is neither that nor empty.

    >>> iso_time("2014:09:17:13:15:22.0"), iso_time(""), iso_time("17 Sep 2014")
    ('2014-09-17T13:15:22.0Z', '', None)
    """
    found = re.fullmatch(r"(\d{4}):(\d\d):(\d\d):(\d\d:\d\d:\d\d(?:\.\d+)?)", text, re.ASCII)
    return "" if not text else f"{found[1]}-{found[2]}-{found[3]}T{found[4]}Z" if found else None


def p7_time(text: str) -> str | None:
    """A P7/17 date and time from ISO 8601, UTC or without a zone; None where it is neither that nor empty.

    >>> p7_time("2014-09-17T13:15:22.0Z")
    '2014:09:17:13:15:22.0'
    """
    iso = r"(\d{4})-(\d\d)-(\d\d)[T ](\d\d:\d\d:\d\d(?:\.\d+)?)(?:Z|\+00:00)?"
    found = re.fullmatch(iso, text, re.ASCII)
    return "" if not text else f"{found[1]}:{found[2]}:{found[3]}:{found[4]}" if found else None


def survey_details(cells: list[str], line: int, path: str) -> tuple[int, str | None, str | None] | None:
    """Survey number, unit of depth and north from a Survey Details record; None for any other record.

    Raises
    ------
    FileError
        Too few fields, or depths in no unit of length.
    """
    if tuple(cells[:4]) != ("H7", "1", "5", "1"):
        return None
    if len(cells) < 14 or not cells[5].isdigit():
        raise FileError(row_width(len(cells), 23), path=path, line=line)
    unit = UNITS.get(cells[6])
    if unit is None:
        allowed = tuple(f"{k} ({v})" for k, v in UNITS.items())
        wrong = Finding("table-unit", {"column": "md", "unit": cells[6], "allowed": allowed})
        raise FileError(wrong, path=path, line=line)
    return int(cells[5]), unit, NORTHS.get(cells[12])


_ASIDE: Final = "p7_"  # begins the names in SurveyFile.extra of fields that are no quantity


@dataclass(frozen=True, eq=False)
class P7File:
    """A P7/17 file.

    surveys : number of a survey -> its M7 or G7 records.
    records : all other lines, in their order, as text; the first is the file's identification.
    counts : identifier of a record (IOGP, HC, H7, CC, O7, P7, M7, G7, ...) -> how many there are.
    """

    surveys: Mapping[int, SurveyFile]
    records: tuple[str, ...]
    counts: Mapping[str, int]


def read_p7(
    path: str | Path,
    *,
    convention: str = "iscwsa",
    depth_unit: str | None = None,
    azimuth_reference: str | None = None,
) -> P7File:
    """Read the raw surveys of a P7/17 file; sensors in the axes and signs of `convention` (iscwsa is the format's).

    `depth_unit` (m, ft, ftUS) and `azimuth_reference` are for a file without Survey Details (H7,1,5,1) and may not
    contradict them. Fields that are no quantity (record version and number, transmission flag, extension) are in
    `extra` of each survey as `p7_version`, `p7_record`, `p7_transmitted`, `p7_extension`.
    """
    others, rows, details, digest = _sorted_lines(Path(path))
    if not rows:
        raise FileError(Finding("file-section", {"section": "M7, G7"}), path=path)
    surveys = {}
    for number, (kind, mine) in rows.items():
        unit, north = details.get(number, (None, None))
        unit = _agreed(path, mine[0][0], unit, depth_unit)
        frame = _frame(Path(path), kind, mine, unit, digest)
        frame = replace(frame, north=north, header={"survey": str(number), "record": kind, "depth_unit": unit})
        survey = survey_of(frame, convention=convention, azimuth_reference=azimuth_reference)
        surveys[number] = replace(survey, extra={name: cells for name, cells in survey.extra.items() if any(cells)})
    counts = Counter(line.split(",", 1)[0].strip() for line in others if line.strip())
    for kind, mine in rows.values():
        counts[kind] += len(mine)
    return P7File(MappingProxyType(surveys), tuple(others), MappingProxyType(dict(counts)))


def read_p7_survey(
    path: str | Path,
    *,
    convention: str = "iscwsa",
    depth_unit: str | None = None,
    azimuth_reference: str | None = None,
    sheet: str | None = None,
) -> SurveyFile:
    """One survey of a P7/17 file, by its number (`sheet`) where there are several; else as `read_p7`.

    Raises
    ------
    FileError
        Several surveys and no number, no survey of that number; else as `read_p7`.
    """
    found = read_p7(path, convention=convention, depth_unit=depth_unit, azimuth_reference=azimuth_reference)
    numbers = tuple(map(str, found.surveys))
    if sheet is None and len(found.surveys) > 1:
        raise FileError(Finding("file-surveys", {"names": numbers}), path=path)
    wanted = numbers[0] if sheet is None else sheet.strip()
    if wanted not in numbers:
        raise FileError(Finding("input-choice", {"name": "--sheet", "value": wanted, "allowed": numbers}), path=path)
    survey = found.surveys[int(wanted)]
    others = [f"{kind} ({count})" for kind, count in found.counts.items() if kind not in FIELDS]
    return replace(survey, findings=(*survey.findings, *unused(others)))


def _sorted_lines(
    path: Path,
) -> tuple[
    list[str], dict[int, tuple[str, list[tuple[int, list[str]]]]], dict[int, tuple[str | None, str | None]], str
]:
    """Other lines, raw records by survey, unit and north by survey, digest."""
    others: list[str] = []
    rows: dict[int, tuple[str, list[tuple[int, list[str]]]]] = {}
    details: dict[int, tuple[str | None, str | None]] = {}
    reader = LineReader(path)
    for block in reader.blocks():
        for line, text in enumerate(block.lines, block.first):
            cells = [cell.strip() for cell in text.split(",")]
            if line == 1 and (cells[0] != "IOGP" or cells[2:3] != ["7"]):
                raise FileError(Finding("file-section", {"section": "IOGP, ..., 7"}), path=path, line=1)
            if cells[0] not in FIELDS:
                others.append(text)
                found = survey_details(cells, line, str(path))
                if found is not None:
                    details[found[0]] = found[1:]
                continue
            wanted = len(FIELDS[cells[0]]) + 1
            if len(cells) != wanted:
                raise FileError(row_width(len(cells), wanted), path=path, line=line)
            used = cells[1 + FIELDS[cells[0]].index("used")]
            if used not in ("0", "1"):
                flag = Finding("input-value", {"name": "used", "value": used, "allowed": "0, 1"})
                raise FileError(flag, path=path, line=line)
            if not (cells[2].isascii() and cells[2].isdigit()):
                raise in_file(wrong_kind("survey", cells[2], "number"), path, line)
            number = int(cells[2])
            kind, mine = rows.setdefault(number, (cells[0], []))
            if kind != cells[0]:
                raise FileError(Finding("input-one-of", {"names": ("M7", "G7")}), path=path, line=line)
            mine.append((line, cells[1:]))
    if not others:
        raise FileError(Finding("file-section", {"section": "IOGP, ..., 7"}), path=path)
    return others, rows, details, reader.digest


def _agreed(path: str | Path, line: int, stated: str | None, given: str | None) -> str:
    """The unit of depth, from Survey Details (H7,1,5,1) or the caller."""
    if stated and given and stated != given:
        raise FileError(Finding("table-units", {"column": "md", "units": (stated, given)}), path=path, line=line)
    if not (stated or given):
        raise FileError(Finding("input-missing", {"names": ("--depth-unit",)}), path=path, line=line)
    return stated or given or ""


def _frame(path: Path, kind: str, rows: Sequence[tuple[int, list[str]]], unit: str, digest: str) -> Frame:
    """The records as columns by the package's names."""
    lines = [line for line, _ in rows]
    numbers, known = NumberReader(path), quantities()
    columns: dict[str, Column] = {}
    for place, key in enumerate(FIELDS[kind]):
        cells = [row[place] for _, row in rows]
        if key not in known:
            columns[f"{_ASIDE}{key}" if key in ("version", "record", "transmitted", "extension") else key] = tuple(
                cells
            )
            continue
        name = f"{key} ({unit})" if key in LENGTHS else known[key].column
        columns[name] = numbers.convert(cells, name, lines, gaps=key != "md")
    found = []
    for line, text in zip(lines, columns.pop("time"), strict=True):
        time = iso_time(str(text))
        if time is None:
            allowed = "YYYY:MM:DD:hh:mm:ss"
            wrong = Finding("input-value", {"name": "time", "value": str(text), "allowed": allowed})
            raise FileError(wrong, path=path, line=line)
        found.append(time)
    columns["time"] = tuple(found)
    del columns["survey"]
    return Frame(path, columns, np.array(lines), digest=digest)


def p7_file(survey: SurveyFile, *, number: int = 1) -> P7File:
    """A P7/17 file around one survey, with the least header its raw records need to be read; see `write_p7`.

    A P7/17 file for exchange also describes structure, well, rig and coordinate system, which a survey does not know:
    replace `records` by those.
    """
    north = survey.azimuth_reference
    type_id = next((k for k, v in NORTHS.items() if v == north), "10")
    type_name = f"AZIM_{(north or 'none')[:4].upper()}"
    details = f"H7,1,5,1,{'Survey Details':<50},{number},1,4,MD-Other,1,Indicated Depth,1,{type_id},{type_name},1,"
    records = ("IOGP,raw survey data,7,1.0,1,,,,", details + "Surveyed,,,,,,,")
    counts = {"IOGP": 1, "H7": 1, _kind(survey): len(survey)}
    return P7File(MappingProxyType({number: survey}), records, MappingProxyType(counts))


def _kind(survey: SurveyFile) -> str:
    if (survey.b is None) == (survey.w is None):
        raise refused("input-one-of", {"names": ("b", "w")})
    return "G7" if survey.b is None else "M7"


def write_p7(file: P7File, path: str | Path, *, convention: str = "iscwsa") -> None:
    """Write a P7/17 file: `records` as they are, then the raw records of each survey.

    Numbers are the shortest text that reads back the same, angles and depths to 1e-10; what is unknown is empty. Field
    covariances, temperatures, corrections, `valid` and other columns have no place in the format and are not written.
    """
    details = [survey_details([c.strip() for c in text.split(",")], 0, str(path)) for text in file.records]
    units = {found[0]: found[1] for found in details if found is not None}
    lines = list(file.records)
    for number, survey in file.surveys.items():
        unit = units.get(number)
        if unit is None:
            raise refused("file-section", {"section": f"H7,1,5,1 ({number})"})
        kind, size = _kind(survey), len(survey)
        columns = values_of(to_vendor(survey, convention))
        factor, _ = unit_factor(unit, "m")
        empty = np.full(size, np.nan)
        cells: list[Sequence[str]] = []
        for key in FIELDS[kind]:
            if key in quantities():
                values = columns.get(key, empty)
                if key in LENGTHS and unit != "m":
                    values = np.round(values / factor, 10) + 0.0
                cells.append(writing.column(values))
            else:
                cells.append(_texts(survey, key, number))
        lines += [",".join((kind, *row)) for row in zip(*cells, strict=True)]
    bad = next((text for text in lines if "\n" in text or "\r" in text), None)
    if bad is not None:
        raise refused("file-characters", {"format": "P7/17", "text": bad[:60]})
    write_text("".join(f"{text}\n" for text in lines), path)


def _texts(survey: SurveyFile, key: str, number: int) -> Sequence[str]:
    """One column of flags, numbers or texts."""
    size = len(survey)
    if key == "survey":
        return [str(number)] * size
    if key == "used":
        return ["1"] * size if survey.used is None else ["1" if yes else "0" for yes in survey.used]
    if key == "time":
        stamps = [p7_time(text) for text in survey.times or ("",) * size]
        if None in stamps:
            wrong = (survey.times or ())[stamps.index(None)]
            raise wrong_kind("time", wrong, "date and time")
        return [stamp or "" for stamp in stamps]
    default = {"version": ["0"] * size, "record": [str(i + 1) for i in range(size)], "transmitted": ["0"] * size}
    found = survey.extra.get(f"{_ASIDE}{key}", default.get(key, [""] * size))
    comma = next((text for text in found if "," in text), None)
    if comma is not None:
        raise refused("file-characters", {"format": "P7/17", "text": comma[:60]})
    return found
