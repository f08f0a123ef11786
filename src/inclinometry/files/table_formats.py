"""How the lines of a text, or the rows of a sheet, are cut into cells: found where it is plain to see, or stated."""

from __future__ import annotations

import contextlib
import csv
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from inclinometry.errors import FileError, InputError, in_file
from inclinometry.files._quantities import columns_called, dimension_of
from inclinometry.files.profile import PLAIN, SEPARATORS, Profile, describes, with_unit
from inclinometry.files.text import Block, Cells
from inclinometry.findings import Finding
from inclinometry.opening import damaged

NUMBER: Final = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?")
_FLOAT: Final = re.compile(rf"{NUMBER.pattern}|[+-]?(nan|inf|infinity)", re.I)
RULE: Final = re.compile(r"[\s+|]*([-=]{2,}[\s+|]*)+")
"""A line drawn below the names."""
LEGS: Final = re.compile(
    r"\W*(data normal )?from\W+to\W+(tape|length|distance)\W+(compass|azimuth|bearing)\W+(clino|inc|inclination)\b.*"
    r"|\*(begin|data|calibrate|units)\b.*|cent(re|er)line\b.*|survey name:.*|#units\b.*",
    re.I,
)
"""Above the legs of a cave: names, in a comment or not; a command of Survex, Therion, Compass or Walls."""
TOA5: Final = re.compile('"?TOA5"?,')
"""Begins a file of a Campbell logger: the station, names, units, what the logger computed, then the rows."""
LOOKED: Final = 400
"""Lines by which a layout is found."""


def named_place(lines: list[str]) -> int | None:
    """The place of a comment that is the names of the rows of numbers right below it, if there is one.

    Only a comment with as many cells, of which none is a number, above the first row of numbers is that.
    """
    place = next((k for k, line in enumerate(lines[:LOOKED]) if line.strip() and line.lstrip()[0] != "#"), 0)
    above = lines[place - 1].lstrip() if place else ""
    if above[:1] != "#":
        return None
    names = above.lstrip("# ")
    for mark in ("\t", ";", ",", " "):
        row, cells = _roughly(lines[place].strip(), mark), _roughly(names.strip(), mark)
        if len(row) != len(cells) or len(row) < 2 or not all(NUMBER.fullmatch(cell.strip()) for cell in row):
            continue
        if all(cell.strip() and not NUMBER.fullmatch(cell.strip()) for cell in cells):
            return place - 1
    return None


def refuse_legs(lines: list[str], path: Path, first: int = 1) -> None:
    """FileError for the shots of a cave from station to station, which are no stations along a hole."""
    rows = [row for row, line in enumerate(lines[:LOOKED]) if LEGS.fullmatch(line.strip())]
    if rows:
        raise FileError(Finding("table-legs"), path=path, line=first + rows[-1])


def find_layout(lines: list[str]) -> tuple[Profile, str]:
    """How the lines are cut into cells, and where the names and the rows begin."""
    if not lines or TOA5.match(lines[0]):
        return PLAIN, "a table of its own format"
    named = named_place(lines)
    if named is not None:
        lines = [*lines[:named], lines[named].lstrip().lstrip("# "), *lines[named + 1 :]]
    filled = [
        (k, line.rstrip("\r\n"))
        for k, line in enumerate(lines[:LOOKED])
        if line.strip() and line.lstrip()[0] != "#" and not RULE.fullmatch(line)
    ]
    if not filled:
        return PLAIN, "text without a table"
    best, width, mark = 0.0, 1, ","
    for candidate in ("\t", ";", ",", " "):
        counts = Counter(len(_roughly(line, candidate)) for _, line in filled)
        number, times = max(counts.items(), key=lambda item: (item[1] * (item[0] > 1), item[0]))
        share = times / len(filled) if number > 1 else 0.0
        # a later separator must explain clearly more lines: decimal commas look like one
        if share > best + 0.05:
            best, width, mark = share, number, candidate
    table = [(k, _roughly(line, mark)) for k, line in filled if len(_roughly(line, mark)) == width]
    # a title is a row whose other cells a spreadsheet has left empty
    while len(table) > 1 and sum(map(_filled, table[0][1])) < min(2, width):
        table.pop(0)
    if not table:
        return PLAIN, "text without a table"
    numbers = [sum(bool(NUMBER.fullmatch(cell.strip())) for cell in cells) for _, cells in table]
    header = numbers[0] == 0 or (len(table) > 1 and numbers[0] < numbers[1] and numbers[0] * 2 < width)
    # texts above the numbers of the first row of values: titles, names over one line or more, units
    values = next(k for k, count in enumerate(numbers) if 2 * count >= max(numbers))
    columns = [k for k, cell in enumerate(table[values][1]) if NUMBER.fullmatch(cell.strip())]
    above = [
        (place, cells)
        for (place, cells), count in zip(table[:values], numbers, strict=False)
        if not count and any(_filled(cells[k]) for k in columns)
    ]
    units = header and len(above) > 1 and _units_row(above[-1][1])
    first = above[-1 - units][0] if header and above else table[0][0]
    before = any(line.strip() and line.lstrip()[0] != "#" for line in lines[:first])
    plain = header and not units and mark in ",;\t" and not before and not (mark == ";" and ", " in lines[first])
    profile = PLAIN if plain else Profile(separator=mark, skip=first if before else 0, header=header, units_row=units)
    name = next(name for name, text in SEPARATORS.items() if text == mark)
    words = [f"text, separated by {name}", f"{first} lines before the names" if before else ""]
    words += ["no names of columns" if not header else "", "a line of units" if units else ""]
    return profile, ", ".join(word for word in words if word)


_NORTH: Final = re.compile(r"\b(?:north|azimuth)s? reference\W+(grid|true|magnetic)\b", re.I)


def _over(above: str, line: str) -> list[str]:
    """Of each word of a line the words above it, in columns of letters; nothing where one is above none of them."""
    spans = [match.span() for match in re.finditer(r"\S+", line)]
    heads = [""] * len(spans)
    for word in re.finditer(r"\S+", above):
        over = [k for k, (start, end) in enumerate(spans) if word.start() < end and start < word.end()]
        if len(over) != 1:
            return []
        heads[over[0]] = f"{heads[over[0]]} {word[0]}".strip()
    return heads


def _roughly(line: str, mark: str) -> list[str]:
    return line.split() if mark == " " else cut(line, mark)


def _bare(unit: str) -> str:
    """A unit without its brackets: m/(s^2) is m/s^2."""
    return re.sub(r"[\[\]()]", "", unit).strip()


def _units_row(cells: list[str]) -> bool:
    written = [_bare(cell) for cell in cells if cell.strip()]
    known = sum(dimension_of(cell) is not None for cell in written)
    return 0 < len(written) <= 2 * known


def with_layout(given: Profile, found: Profile) -> Profile:
    """What is stated of the columns, with the layout that was found."""
    return replace(given, separator=found.separator, skip=found.skip, header=found.header, units_row=found.units_row)


def cut(line: str, mark: str) -> list[str]:
    """Cells of a line."""
    if mark == " ":
        return line.split()
    if '"' in line:
        # a carriage return inside a line, or a quotation mark that opens a cell without end: as it stands
        with contextlib.suppress(csv.Error):
            return next(csv.reader([line], delimiter=mark, skipinitialspace=True))
    return line.split(mark)


def line_of(row: str | Sequence[Any]) -> str:
    """A line as it stands; of a row of cells what is looked at."""
    return row if isinstance(row, str) else joined([cell if isinstance(cell, str) else repr(cell) for cell in row])


def joined(cells: Sequence[str]) -> str:
    """A line of cells between commas, quoted where they hold one."""
    line = ",".join(cells)
    if line.count(",") == len(cells) - 1 and '"' not in line and "\n" not in line and "\r" not in line:
        return line
    plain = (cell.replace("\n", " ").replace("\r", " ").replace('"', '""') for cell in cells)
    return ",".join(f'"{cell}"' for cell in plain)


def _filled(cell: Any) -> bool:
    return bool(cell.strip()) if isinstance(cell, str) else True


def _is_number(cell: Any) -> bool:
    return not isinstance(cell, str) or _FLOAT.fullmatch(cell.strip()) is not None


Piece = tuple[NDArray[np.int64], list[Cells]]
"""Consecutive rows: the line each stands in, and the cells of each column."""


class TextTable:
    """The rows of a text, or of a sheet, below one line of names.

    names : of all columns, in their order; `line` is where they stand.
    mark : what separates cells; quick : converts a block of regular lines at once, where it can. north : of the
    azimuths, where a line above the names states it; second : rows of a second set of sensors that were left out;
    below : rows of text below the table.
    """

    def __init__(self, path: Path, blocks: Iterator[Block], given: Profile) -> None:
        self.path, self.names, self.line, self.mark = path, list[str](), 0, ""
        self.north: str | None = None
        self.second = 0
        self.below: list[tuple[Sequence[Any], Any, int]] = []
        self._numeric: list[bool] = []  # of the first row of values
        self._other: Finding | None = None
        self.quick: Callable[[str, list[str]], list[Cells] | None] | None = None
        blocks = (_prefixed(block, given.prefix) for block in blocks) if given.prefix else blocks
        first = next(blocks, None)
        self._blocks = blocks if first is None else chain([first], blocks)
        self._laid: Profile | None = None
        if first is not None:
            self._laid = self._layout(first, given)
            self._find_names()
        if not self.line:
            raise FileError(Finding("file-empty", {"what": "rows"}), path=path)

    def _layout(self, first: Block, given: Profile) -> Profile | None:
        """How the lines are cut, as it is stated or as it is plain to see; None for a plain table.

        Plain to see are names above rows of numbers; numbers without names are refused.
        """
        rows = first.lines[:LOOKED]
        width = max(map(len, rows)) if isinstance(rows[0], list) else 0  # the last cells of a row may be missing
        lines = [line_of([*row, *[""] * (width - len(row))] if row and width else row) for row in rows]
        words = [re.split(r"[,;\s]+", line.strip()) for line in lines]
        numbers = [sum(NUMBER.fullmatch(cell) is not None for cell in row) for row in words]
        if max(numbers, default=0) < 2:
            self._other = Finding("file-empty", {"what": "rows of numbers"})
        if given.states_layout:
            return given
        refuse_legs(lines, self.path, first.first)
        if TOA5.match(lines[0]) and len(lines) > 4:
            lines[2] = re.sub(r'"?\b(TS|RN)\b"?', '""', lines[2])
            lines[0] = lines[3] = ""
            first.lines[:4] = lines[:4]
            return with_layout(given, Profile(separator=",", units_row=True))
        place = named_place(lines)
        if place is not None:
            row = first.lines[place]
            first.lines[place] = row.lstrip().lstrip("# ") if isinstance(row, str) else [row[0].lstrip("# "), *row[1:]]
        found, _ = find_layout(lines)
        if not found.header and next((count for row, count in zip(words, numbers, strict=True) if row[0]), 0):
            names = words[numbers.index(max(numbers))][:3]
            self._other = self._other or Finding("table-names-numbers", {"names": tuple(names)})
        if found.header and found.lays_out:
            self._find_head(first, lines, found)
            return with_layout(given, found)
        return given if given.lays_out else None

    def _find_head(self, first: Block, lines: list[str], found: Profile) -> None:
        """The north that lines above the names state; names over two lines as one, where one lacks some or has two."""
        mark = found.separator or ","
        for line in lines[: found.skip]:
            if stated := _NORTH.search(line):
                self.north = stated[1].lower()
        place = next((k for k, line in enumerate(lines) if k >= found.skip and line.strip()), 0)
        above = lines[place - 1] if place else ""
        cells = _roughly(lines[place], mark)
        heads = _over(above, lines[place]) if mark == " " else [cell.strip() for cell in _roughly(above, mark)]
        if len(heads) != len(cells) or set(above) & set(":=") or any(map(NUMBER.fullmatch, heads)):
            return
        empty = [k for k, cell in enumerate(cells) if not cell.strip()]
        if len(set(cells)) == len(cells) and not (empty and all(heads[k] for k in empty)):
            return
        left = ""
        for k, (head, cell) in enumerate(zip(heads, cells, strict=True)):
            left = head or left  # of cells that are merged
            name, bracket, unit = left.partition("(")
            if head or columns_called(f"{name}{cell}"):
                cells[k] = " ".join(f"{name} {cell} {bracket}{unit}".split())
        first.lines[place] = cells

    def _find_names(self) -> None:
        """The names, and the blocks from the first row of values on."""
        plain = self._laid is None
        profile = self._laid or PLAIN
        self.mark = profile.separator or ""
        awaited = ["names"] * profile.header + ["units"] * profile.units_row
        origin = None
        for block in self._blocks:
            origin = block.first if origin is None else origin
            for row, line in enumerate(block.lines):
                text, number = line_of(line).strip(), block.first + row
                if number < origin + profile.skip or not text or (text[0] == "#" and not self.names):
                    continue
                if text.lower() in ("sep=", "sep=,", "sep=;") if plain else _drawn(text):
                    continue
                if plain:
                    self._plain_names(line, number)
                elif not self.names:
                    if not self.mark or (profile.header and self.mark not in (" ", *text)):
                        self.mark = next((mark for mark in ("\t", ";", ",") if mark in text), self.mark or " ")
                    cells = [str(cell).strip() for cell in self._cut(line)]
                    while cells and not cells[-1]:
                        cells.pop()
                    self.names = cells if profile.header else [f"column {k}" for k in range(1, len(cells) + 1)]
                if awaited and awaited.pop(0) == "units":
                    self.names = _with_units(self.names, [str(c) for c in self._cut(line)], profile, self.path, number)
                if awaited:
                    continue
                self.line = number
                rest = row + (profile.header or profile.units_row)
                # the first rows by themselves: in them a decimal point is met
                ends = (rest, rest + LOOKED), (rest + LOOKED, None)
                parts = [Block(block.first + i, lines) for i, j in ends if (lines := block.lines[i:j]) or i == rest]
                self._blocks = chain(parts, self._blocks)
                return

    def _plain_names(self, line: Any, number: int) -> None:
        text = line_of(line)
        outside = "".join(text.split('"')[::2])
        marks = {",": "comma", ";": "semicolon", "\t": "tab"}
        found = [mark for mark in marks if mark in outside] if isinstance(line, str) else []
        if len(found) > 1:
            several = Finding("table-separators", {"separators": tuple(marks[mark] for mark in found)})
            raise FileError(several, path=self.path, line=number)
        self.mark = found[0] if found else ","
        self.names = [str(name).strip() for name in self._split([line], number)[0]]
        while self.names and not self.names[-1]:
            self.names.pop()  # a trailing separator

    def pieces(self) -> Iterator[Piece]:
        """Rows of cells, block by block; FileError for a row of another length."""
        for number, block in enumerate(self._blocks):
            quick = self._quickly(block) if number and not self.below else None
            piece = quick or self._carefully(block)
            if piece is not None:
                yield piece

    def _quickly(self, block: Block) -> Piece | None:
        lines = block.lines
        if self.quick is None or not isinstance(lines[0], str):
            return None
        text = "\n".join(lines)
        if '"' in text or "#" in text or (self.mark in ";\t" and "," in text) or not text.strip():
            return None
        columns = self.quick(text, lines)
        start = int(lines[0] == "")
        rows = len(lines) - (lines[-1] == "") - start
        if columns is None or any(len(cells) not in (0, rows) for cells in columns):
            return None
        return np.arange(rows) + block.first + start, columns

    def _carefully(self, block: Block) -> Piece | None:
        rows = self._split(block.lines, block.first)
        lines, width = np.arange(block.first, block.first + len(rows)), len(self.names)
        regular = self._laid is None and not self.below and not (self._numeric and self._is_text(rows[-1]))
        if not (regular and all(len(row) == width and row[0] and str(row[0])[:1] != "#" for row in rows)):
            found = list[tuple[Sequence[Any], Any, int]]()
            for one in zip(rows, block.lines, lines.tolist(), strict=True):
                if self._is_text(one[0]):
                    self.below.append(one)
                elif self._is_row(*one):
                    found += [*(text for text in self.below if self._is_row(*text)), one]
                    self.below.clear()
                    self._numeric = self._numeric or list(map(_is_number, one[0][:width]))
            rows, lines = [row[:width] for row, _, _ in found], np.array([line for _, _, line in found], dtype=np.int64)
        if not rows:
            return None
        self._numeric = self._numeric or list(map(_is_number, rows[0]))
        columns: list[Cells] = list(zip(*rows, strict=True))
        if not isinstance(block.lines[0], str):
            columns = [np.array(cells, dtype=np.object_) for cells in columns]
        return lines, columns

    def _split(self, lines: list[Any], first: int) -> list[Any]:
        """Cells of each line; a quoted cell must close on its line."""
        if self._laid is not None or (lines and not isinstance(lines[0], str)):
            return [self._cut(line) for line in lines]
        try:
            rows = list(csv.reader(lines, delimiter=self.mark, skipinitialspace=True))
        except csv.Error as error:
            raise FileError(damaged("CSV", error), path=self.path, line=first) from None
        if len(rows) != len(lines):
            raise FileError(Finding("table-quote"), path=self.path, line=first + _open_quote(lines, self.mark))
        return rows

    def _is_row(self, row: Sequence[Any], raw: Any, line: int) -> bool:
        """False for blank and comment lines; FileError for a row of another length."""
        width = len(self.names)
        text = line_of(raw).lstrip()
        if not any(map(_filled, row)) or (self._laid is not None and _drawn(text)):
            return False
        if text.startswith("#"):
            if len(row) == width > 1:
                raise FileError(Finding("table-comment"), path=self.path, line=line)
            return False
        if self._laid is not None and len(row) == self._laid.second_row:
            self.second += 1
            return False
        if len(row) < width or any(map(_filled, row[width:])):
            raise FileError(self._other or row_width(len(row), width), path=self.path, line=line)
        return True

    def _is_text(self, row: Sequence[Any]) -> bool:
        """Whether a row is of words where the table has numbers: it may stand below the table."""
        few = 2 * sum(map(_is_number, row)) < sum(self._numeric) > 1
        texts = [] if not few else [str(cell).strip() for cell in row]
        places = (*self._numeric, *[False] * len(row))
        return not "".join(texts).startswith("#") and any(
            re.search(r"[^\W\d]", text) and (number or " " in text or ":" in text)
            for text, number in zip(texts, places, strict=False)
        )

    def _cut(self, line: Any) -> Sequence[Any]:
        # the last cells of a row of a sheet may be missing
        return cut(line, self.mark) if isinstance(line, str) else [*line, *[""] * (len(self.names) - len(line))]


def _prefixed(block: Block, prefix: str) -> Block:
    """The rows without their prefix; lines without one are empty."""
    lines = [line_of(row) for row in block.lines]
    return block._replace(lines=[line[len(prefix) :] if line.startswith(prefix) else "" for line in lines])


def row_width(cells: int, columns: int) -> Finding:
    """Of a row with more or fewer cells than there are columns."""
    return Finding("table-row-width", {"cells": cells, "columns": columns})


def _drawn(text: str) -> bool:
    """A drawn line."""
    return text[0] in "-=+|" and RULE.fullmatch(text) is not None


def _with_units(names: list[str], cells: list[str], profile: Profile, path: Path, line: int) -> list[str]:
    """Names with the units below them; a column the profile names keeps its name, if the unit agrees."""
    found = []
    for name, cell in zip(names, cells + [""] * len(names), strict=False):
        unit = _bare(cell)
        try:
            if name in profile.columns:
                profile.check_unit(name, unit, name)
            found.append(name if name in profile.columns or describes(name) else with_unit(name, unit))
        except InputError as error:
            raise in_file(error, path, line) from None
    return found


def _open_quote(lines: list[str], delimiter: str) -> int:
    """Index of the first line whose quoted cell stays open."""
    for index, line in enumerate(lines):
        try:
            list(csv.reader([line], delimiter=delimiter, skipinitialspace=True, strict=True))
        except csv.Error:
            return index
    return 0
