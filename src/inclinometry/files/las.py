"""Survey tables as LAS 2.0 (CWLS): curves with units; the data are read and written with every digit."""

from __future__ import annotations

import io
import json
import logging
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inclinometry.arrays import Array
from inclinometry.errors import FileError, InputError, in_file, wrong_kind
from inclinometry.files import writing
from inclinometry.files._quantities import meaning, quantities_by_column, same_unit
from inclinometry.files.frame import Column, Frame, unused
from inclinometry.files.profile import current, with_unit
from inclinometry.files.survey_file import SurveyFile, columns_of
from inclinometry.files.table_formats import row_width
from inclinometry.files.text import NULLS, whole_text
from inclinometry.files.writing import write_text
from inclinometry.findings import Finding, Value
from inclinometry.opening import damaged, too_large, whole

# The ~ASCII section of a LAS file: every row checked for its length and its numbers.

_BLOCK = 1 << 16
LARGEST: Final = 64_000_000
"""Bytes of a file; it is read as a whole."""
MOST_HEAD: Final = 4000
"""Lines of a header."""
MOST_AGAIN: Final = 100
"""Items of a header whose name stands before them in their section."""
Numbered = Iterator[tuple[int, str]]


class Sections(NamedTuple):
    """A LAS file, cut: its head as LAS 2.0 has it, the lines of its data, the number of their first, what parts cells.

    spans : whether STRT and STOP are the ends of these data; in LAS 3.0 they are those of the log.
    """

    head: str
    lines: Sequence[str]
    first: int
    mark: str | None = None
    spans: bool = True


_LOG: Final = "LOG"


def split_at_data(path: str | Path, text: str, sheet: str | None = None) -> Sections:
    """The head of a LAS file and its data; of LAS 3.0 those of `sheet`, the section ~Inclinometry, or else the log.

    Raises
    ------
    FileError
        No section at all, none of data, several and none of them the usual one.
    """
    lines = text.splitlines()
    titles = {i: line.strip().upper() for i, line in enumerate(lines) if line.lstrip().startswith("~")}
    if not titles:
        raise FileError(Finding("file-section", {"section": "~Version"}), path=path)
    # of LAS 3.0: ~INCLINOMETRY_DATA | INCLINOMETRY_DEFINITION
    kinds = {
        i: title[1:].partition("|")[0].strip().removesuffix("_DATA") for i, title in titles.items() if "|" in title
    }
    found = kinds | {i: _LOG for i, title in titles.items() if i not in kinds and title.startswith(("~A", "~LOG_DATA"))}
    found = {i: _LOG if kind in ("LOG", "ASCII") else kind for i, kind in found.items()}
    usual = next((kind for kind in ("INCLINOMETRY", _LOG) if kind in found.values()), None)
    wanted = usual if sheet is None else sheet.upper()
    places = [i for i, kind in found.items() if wanted in (None, kind)]
    if not found:
        raise FileError(Finding("file-section", {"section": "~ASCII"}), path=path, line=len(lines))
    if (wanted is None and len(places) > 1) or not places:
        choice: dict[str, Value] = {
            "name": "--sheet",
            "value": sheet or "-",
            "allowed": tuple(dict.fromkeys(found.values())),
        }
        raise FileError(Finding("input-choice", choice), path=path)
    if len(places) > 1:
        twice = Finding("input-repeated", {"name": "section", "value": titles[places[1]]})
        raise FileError(twice, path=path, line=places[1] + 1)
    start = places[0]
    ends = dict(zip(titles, [*list(titles)[1:], len(lines)], strict=True))
    if start not in kinds:
        return Sections("\n".join(lines[:start]) + "\n", lines[start + 1 : ends[start]], start + 2)
    definition = titles[start].partition("|")[2].strip()
    parts = {"~V": "~V", "~W": "~W", f"~{definition}": "~C", f"~{kinds[start]}_PARAMETER": "~P", "~PARAMETER": "~P"}
    head, mark = list[str](), "SPACE"
    for i, title in titles.items():
        part = next((part for begins, part in parts.items() if title.startswith(begins) and i not in kinds), None)
        if part is not None:
            body = lines[i + 1 : ends[i]]
            mark = next((line.partition(".")[2].partition(":")[0].strip().upper()
                         for line in body if line.lstrip().upper().startswith("DLM")), mark)  # fmt: skip
            head += [part, *body]
    marks = {"COMMA": ",", "TAB": "\t"}
    return Sections(
        "\n".join(head) + "\n", lines[start + 1 : ends[start]], start + 2, marks.get(mark), found[start] == _LOG
    )


def numbered(lines: Iterable[str], first: int) -> Numbered:
    """Lines that are neither blank nor comments, with their numbers."""
    for line_number, line in enumerate(lines, first):
        if line.strip() and not line.lstrip().startswith("#"):
            yield line_number, line


def read_data(
    path: Path,
    lines: Numbered,
    names: Sequence[str],
    units: Mapping[str, str],
    null: float,
    wrap: bool,
    mark: str | None = None,
) -> tuple[dict[str, Column], NDArray[np.int64]]:
    """Columns by mnemonic, `null` as NaN or empty, and the line each row stands in.

    Raises
    ------
    FileError
        A row with more or fewer values than curves, text where a number is needed, no data.
    """
    numeric = [_is_number(name, units) for name in names]
    numbers: list[list[Array]] = [[] for _ in names]
    texts: list[list[str]] = [[] for _ in names]
    places: list[int] = []
    for block in _blocks(_unwrapped(path, lines, len(names)) if wrap else _rows(path, lines, len(names), mark)):
        rows = [row for row, _ in block]
        places += rows
        for index, cells in enumerate(zip(*(cells for _, cells in block), strict=True)):
            if numeric[index]:
                numbers[index].append(_floats(path, cells, names[index], rows, null))
            else:
                texts[index] += [("" if _float(cell) == null else cell) for cell in cells]
    if not places:
        raise FileError(Finding("file-empty", {"what": "rows"}), path=path)
    columns: dict[str, Column] = {
        name: np.concatenate(numbers[i]) if numeric[i] else tuple(texts[i]) for i, name in enumerate(names)
    }
    return columns, np.array(places, dtype=np.int64)


def _is_number(name: str, units: Mapping[str, str]) -> bool:
    try:
        what = meaning(name, units.get(name))
    except InputError:
        return False  # refused later, with the remedy
    return what is not None and what.unit is not None


def _rows(path: Path, lines: Numbered, width: int, mark: str | None) -> Iterator[tuple[int, list[str]]]:
    for place, line in lines:
        cells = [cell.strip() for cell in line.split(mark)]
        if len(cells) != width:
            raise FileError(row_width(len(cells), width), path=path, line=place)
        yield place, cells


def _unwrapped(path: Path, lines: Numbered, width: int) -> Iterator[tuple[int, list[str]]]:
    """Rows of a wrapped file: the depth on a line of its own, then the others on as many lines as they take."""
    row: list[str] = []
    start = place = 0
    for place, line in lines:
        start = start if row else place
        row += line.split()
        if len(row) > width:
            raise FileError(row_width(len(row), width), path=path, line=place)
        if len(row) == width:
            yield start, row
            row = []
    if row:
        raise FileError(row_width(len(row), width), path=path, line=place)


def _blocks(rows: Iterator[tuple[int, list[str]]]) -> Iterator[list[tuple[int, list[str]]]]:
    block: list[tuple[int, list[str]]] = []
    for row in rows:
        block.append(row)
        if len(block) == _BLOCK:
            yield block
            block = []
    if block:
        yield block


def _floats(path: Path, cells: Sequence[str], name: str, rows: Sequence[int], null: float) -> Array:
    try:
        values = np.fromiter(map(float, cells), np.float64, len(cells))
    except ValueError:
        values = np.array([_float(cell) for cell in cells])
    wrong = ~np.isfinite(values)
    if wrong.any() or "_" in "".join(cells):
        at = int(np.argmax(wrong)) if wrong.any() else next(i for i, cell in enumerate(cells) if "_" in cell)
        raise in_file(wrong_kind(name, cells[at], "number"), path, int(rows[at]))
    return np.where(values == null, np.nan, values)


def _float(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float("nan")


_NORTH: Final = "AZIREF"
_MARK: Final = "Head of the survey, one name and text a line:"


def las_frame(where: Path) -> Frame:
    """The curves of LAS 1.2, 2.0 or 3.0 as a table: the file's own NULL is unknown, AZIREF the north of the azimuths.

    A log from the bottom up is turned round. A curve of no survey that is there twice is left out.

    Raises
    ------
    FileError
        A header that is damaged, data that do not reach STRT and STOP (truncated), values that are no numbers.
    """
    data = whole(where, LARGEST)
    # what matters is ASCII: letters of an encoding that no one knows do not hinder
    text, guess = whole_text(data, where, current().encoding, "latin-1")
    parts = split_at_data(where, text, current().sheet)
    las = _header(where, parts.head)
    names = [str(curve.original_mnemonic).strip() for curve in las.curves]
    findings, doubled = list(guess), dict[str, str]()
    for place, name in enumerate(names, 1):
        if not name:
            raise FileError(Finding("table-unnamed", {"place": place}), path=where)
        if names.index(name) < place - 1:
            if _is_number(name, {name: str(las.curves[place - 1].unit)}):
                raise FileError(Finding("input-repeated", {"name": "column", "value": name}), path=where)
            names[place - 1] = f"{name}:{place}"
            doubled[names[place - 1]] = name
    if doubled:
        findings += unused(dict.fromkeys(doubled.values()))
    wrap = str(_value(las.version, "WRAP") or "NO").strip().upper() == "YES"
    units = {name: str(curve.unit) for name, curve in zip(names, las.curves, strict=True) if curve.unit}
    lines = numbered(parts.lines, parts.first)
    columns, rows = read_data(where, lines, names, units, _number(where, las, "NULL"), wrap, parts.mark)
    columns = {name: column for name, column in columns.items() if name not in doubled}
    depth = columns[names[0]]
    if parts.spans and not isinstance(depth, tuple):
        findings += _span(where, las, units.get(names[0]), depth, rows)
    header, north = _head_texts(where, las)
    try:
        bare = {with_unit(name, units.get(name)): name for name in columns}
    except InputError as error:
        raise in_file(error, where) from None
    named = {name: columns[own] for name, own in bare.items()}
    table = Frame(where, named, rows, bare=bare, north=north, header=header, findings=tuple(findings))
    return table.downwards(next(iter(named)) if parts.spans else None)


def _span(path: Path, las: Any, index_unit: str | None, depth: Array, rows: NDArray[np.int64]) -> list[Finding]:
    """Data beyond STRT or STOP, whose order may be wrong; FileError where they end before."""
    ends = dict[str, float]()
    for name in ("STRT", "STOP"):
        item = _item(las.well, name)
        unit = "" if item is None else str(item.unit).strip()
        if unit and index_unit and not same_unit(unit, index_unit):
            raise FileError(Finding("table-units", {"column": name, "units": (unit, index_unit)}), path=path)
        ends[name] = _number(path, las, name)
        if np.isnan(ends[name]):
            raise in_file(wrong_kind(name, "-", "number"), path)
    findings = []
    last = len(depth) - 1
    top = last if depth[0] > depth[last] else 0  # of the rows
    low = "STOP" if ends["STRT"] > ends["STOP"] else "STRT"
    for name, stated in ends.items():
        at = top if name == low else last - top
        there = float(depth[at])
        # headers are often printed with fewer digits than the data
        if abs(stated - there) <= 0.006 + 1e-6 * abs(there):
            continue
        values: dict[str, Value] = {"name": name, "stated": stated, "there": there}
        if (there > stated) is (name == low):
            raise FileError(Finding("file-differs", values), path=path, line=int(rows[at]))
        findings.append(Finding("file-beyond", values))
    return findings


def _header(path: Path, head: str) -> Any:
    """The header as lasio reads it; LAS 1.2, 2.0 and 3.0 only."""
    import lasio

    stated = re.search(r"(?im)^\s*VERS\s*\.\s*([^\s:]+)", head)
    if stated is None:
        raise FileError(Finding("file-section", {"section": "~Version, VERS"}), path=path)
    version = stated[1]
    if version not in ("1.2", "1.20", "2.0", "2", "2.00", "3.0", "3", "3.00"):
        known = Finding("file-version", {"format": "LAS", "version": version, "known": ("1.2", "2.0", "3.0")})
        raise FileError(known, path=path)
    # the library compares each curve with all before it, and those of one name again with all of theirs
    lines = list(numbered(head.splitlines(), 1))
    if len(lines) > MOST_HEAD:
        raise FileError(too_large("lines of the header", len(lines), MOST_HEAD), path=path)
    section, seen, again = "", set[str](), 0
    for place, line in lines:
        if line.lstrip().startswith("~"):
            section, seen = line.lstrip()[1:2].upper(), set()
        name = line.partition(".")[0].strip().upper()
        again += name in seen and section != "O"
        seen.add(name)
        if again > MOST_AGAIN:
            raise FileError(too_large("items of one name", again, MOST_AGAIN), path=path, line=place)
    try:
        with _quiet("lasio"):
            las = lasio.read(io.StringIO(head), ignore_data=True, mnemonic_case="preserve")
    except MemoryError:
        raise
    except Exception as error:  # LASHeaderError, but also key and index errors of what it did not foresee
        raise FileError(damaged("LAS", error), path=path) from None
    if not len(las.curves):
        raise FileError(Finding("file-section", {"section": "~Curve"}), path=path)
    return las


@contextmanager
def _quiet(name: str) -> Iterator[None]:
    """A library's log silent; what it finds is said here, in one place and with the file's name."""
    logger = logging.getLogger(name)
    before = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        logger.setLevel(before)


def _item(section: Any, name: str) -> Any:
    """An item of a section, or None."""
    return next((item for item in section if str(item.original_mnemonic).upper() == name), None)


def _value(section: Any, name: str) -> Any:
    """Its value, or None."""
    return getattr(_item(section, name), "value", None)


def _number(path: Path, las: Any, name: str) -> float:
    """Of the section ~Well; NaN where nothing is stated."""
    value = _value(las.well, name)
    if value in (None, ""):
        return np.nan
    try:
        return float(value)
    except (TypeError, ValueError):
        raise in_file(wrong_kind(name, str(value), "number"), path) from None


def _head_texts(path: Path, las: Any) -> tuple[dict[str, str], str | None]:
    """Texts of the head, and the north of the azimuths."""
    north = _value(las.params, _NORTH)
    north = str(north).strip().lower() if north not in (None, "") else None
    lines = str(las.other).splitlines()
    if _MARK in lines:
        found: dict[str, str] = {}
        for line in lines[lines.index(_MARK) + 1 :]:
            try:
                found |= {str(k): str(v) for k, v in json.loads(line).items()}
            except (ValueError, AttributeError):
                raise FileError(damaged("JSON", line), path=path) from None
        return found, north
    items = [*las.well, *las.params]
    grid = ("STRT", "STOP", "STEP", "NULL")
    kept = [item for item in items if str(item.original_mnemonic).upper() not in (*grid, _NORTH)]
    texts = {str(i.original_mnemonic): f"{i.value} {i.unit}".strip() for i in kept if str(i.value).strip()}
    return texts, north


def write_las(file: SurveyFile, path: str | Path) -> None:
    """Write a survey as LAS 2.0, not wrapped; the head of `file` goes into the section ~Other.

    LAS holds numbers only: `times` and those columns of `extra` that are not all numbers are not written.
    """
    curves: dict[str, Array] = {}
    for name, column in columns_of(file).items():
        values = _numbers(name, column)
        if values is not None:
            curves[name] = values
    everything = np.concatenate(list(curves.values()))
    # the first that is no value of the survey's
    null = next(value for value in NULLS if not (everything == value).any())
    gap = writing.number(null)
    cells = [[text or gap for text in writing.column(values)] for values in curves.values()]
    rows = "\n".join(" ".join(row) for row in zip(*cells, strict=True))
    write_text(f"{_header_text(file, curves, null)}{rows}\n", path)


def _numbers(name: str, column: Column) -> Array | None:
    """Numbers, or texts that numbers read back to, NaN where empty; else None."""
    if not isinstance(column, tuple):
        return column
    if name == "azimuth_reference" or set(name) & set(" .:~#\t"):
        return None
    try:
        numbers = np.array([float(text) if text else np.nan for text in column])
    except ValueError:
        return None
    return numbers if writing.column(numbers) == list(column) else None


def _header_text(file: SurveyFile, curves: Mapping[str, Array], null: float) -> str:
    """Everything up to the data, by lasio."""
    import lasio

    las = lasio.LASFile()
    known = quantities_by_column()
    for name, values in curves.items():
        quantity = known.get(name)
        mnemonic, unit = (name, "") if quantity is None else (quantity.las, quantity.unit.label)
        las.append_curve(mnemonic, values[:2], unit=unit, descr=name)
    las.well["NULL"].value = null
    well = next((text for name, text in file.header.items() if name.lower() in ("well", "namewell")), "")
    las.well["WELL"].value = " ".join(well.replace(":", " ").split())
    if file.azimuth_reference is not None:
        las.params[_NORTH] = lasio.HeaderItem(_NORTH, value=file.azimuth_reference, descr="NORTH AZIMUTHS ARE FROM")
    if file.header:
        las.other = "\n".join(
            [_MARK, *(json.dumps({name: text}, ensure_ascii=False) for name, text in file.header.items())]
        )
    steps = np.diff(file.md)
    even = len(steps) > 0 and np.allclose(steps, steps[0], rtol=0.0, atol=1e-9)
    stream = io.StringIO()
    las.write(
        stream, version=2.0, wrap=False, STRT=file.md[0], STOP=file.md[-1], STEP=steps[0] if even else 0.0, fmt="%.17g"
    )
    return split_at_data("", stream.getvalue()).head + "~ASCII\n"
