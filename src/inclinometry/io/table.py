"""The one path by which a CSV file is read: usual dialects in, exact columns out, or an error that names the place."""

from __future__ import annotations

import csv
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inclinometry.core.arrays import Array
from inclinometry.core.errors import FileError
from inclinometry.io._cells import NumberReader
from inclinometry.io._lines import Block, LineReader, Progress
from inclinometry.io.columns import KNOWN, advice, channel, channel_advice, closest, is_number

Column: TypeAlias = Array | tuple[str, ...]
_DELIMITERS = {",": "comma", ";": "semicolon", "\t": "tab"}


@dataclass(frozen=True, eq=False)
class Table:
    """What a CSV file holds.

    path : where it was read.
    header : column names in the file's order.
    columns : name -> (n,) float64, or a tuple of text where the name is not one of the house's numbers.
    lines : (n,) line of the file each row stands in, from 1.
    header_line : line of the header.
    digest : SHA-256 of the file's bytes.
    """

    path: Path
    header: tuple[str, ...]
    columns: MappingProxyType[str, Column]
    lines: NDArray[np.int64]
    header_line: int
    digest: str

    def __len__(self) -> int:
        return len(self.lines)

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def number(self, name: str) -> Array:
        """A column of numbers; FileError when it is not there."""
        self.require([name])
        column = self.columns[name]
        if isinstance(column, tuple):
            raise self.error(f"column {name!r} is text; numbers are needed")
        return column

    def text(self, name: str) -> tuple[str, ...]:
        """A column of text; FileError when it is not there."""
        self.require([name])
        column = self.columns[name]
        return column if isinstance(column, tuple) else tuple(map(repr, column.tolist()))

    def require(self, names: Iterable[str]) -> None:
        """FileError for the first of `names` that is missing, with the likely remedy."""
        for name in names:
            if name not in self.columns:
                hints = [(found, advice(found, [name])) for found in self.header]
                hint = next((f" ({found!r}: {text})" for found, text in hints if text), "")
                if not hint and (near := closest(name, [n for n in self.header if n not in KNOWN and not channel(n)])):
                    hint = f" (is it {near!r}? then rename it)"
                shown = ", ".join(self.header[:20]) + (", ..." if len(self.header) > 20 else "")
                raise self.error(f"column {name!r} is missing{hint}; columns found: {shown}")

    def unknown(self, known: Collection[str]) -> tuple[str, ...]:
        """Columns neither known nor channels; FileError for one that is nearly a known name or lacks its unit."""
        found = tuple(n for n in self.header if n not in known and channel(n) is None)
        for name in found:
            hint = advice(name, known)
            if hint:
                raise self.error(f"column {name!r} is not known; {hint}")
            hint = channel_advice(name)
            if hint:
                raise self.error(f"column {name!r} is not known; {hint}")
        return found

    def error(self, problem: str, row: int | None = None) -> FileError:
        """An error about one row, or about the header."""
        line = self.header_line if row is None else int(self.lines[row])
        return FileError(problem, path=self.path, line=line)


def read_table(
    path: str | Path,
    progress: Progress | None = None,
    *,
    numeric: Callable[[str], bool] = is_number,
    gaps: Collection[str] = (),
) -> Table:
    """Read a CSV file with one line of column names.

    Comma, semicolon or tab (whichever the header uses); UTF-8 or UTF-16 with its mark; decimal point, or decimal comma
    where it cannot be mistaken; blank lines, trailing spaces and separators, quoted cells, and comment lines that begin
    with `#` are understood. What could be read in two ways is an error.

    Parameters
    ----------
    path : str or Path
    progress : callable, optional
        Called with the number of bytes read so far.
    numeric : callable, optional
        Which column names hold numbers; the house's vocabulary when not given.
    gaps : collection of str
        Numeric columns whose cells may be empty (NaN).

    Raises
    ------
    FileError
        Not found, not text, empty, header only, duplicate or empty column names, rows of other length than the header,
        text or nothing in a number's place, NaN and infinity, a comma that may be decimal or thousands.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "a.csv").write_text("station;azimuth_deg\\nA;12,5\\n")
    ...     table = read_table(Path(folder, "a.csv"))
    >>> table.text("station"), table.number("azimuth_deg")
    (('A',), array([12.5]))
    """
    reader = LineReader(Path(path), progress)
    body: _Body | None = None
    for block in reader.blocks():
        if body is None:
            start = _header_row(block)
            if start is None:
                continue
            body = _Body(reader.path, block.lines[start], block.first + start, numeric, gaps)
            block = Block(block.first + start + 1, block.lines[start + 1 :], block.plain)
        body.add(block)
    if body is None:
        raise FileError("the file is empty; a line of column names and rows of values are needed", path=path)
    return body.table(reader.digest)


def _header_row(block: Block) -> int | None:
    """Index of the first line that is neither blank, nor a comment, nor the `sep=;` a spreadsheet puts on top."""
    for index, line in enumerate(block.lines):
        text = line.strip().lower()
        if text and not text.startswith("#") and text not in ("sep=", "sep=,", "sep=;"):
            return index
    return None


class _Body:
    """Collects rows block by block under one header."""

    def __init__(
        self, path: Path, header: str, line: int, numeric: Callable[[str], bool], gaps: Collection[str]
    ) -> None:
        self.path, self.line = path, line
        self.delimiter = self._find_delimiter(header)
        names = [name.strip() for name in self._split([header], line)[0]]
        while names and not names[-1]:
            names.pop()  # a trailing separator
        self._check_names(names)
        self.names = tuple(names)
        self.kinds = [(name, numeric(name), name in gaps) for name in self.names]
        self.numbers = NumberReader(path)
        self.parts: dict[str, list[Array]] = {name: [] for name, number, _ in self.kinds if number}
        self.texts: dict[str, list[str]] = {name: [] for name, number, _ in self.kinds if not number}
        self.lines: list[NDArray[np.int64]] = []

    def _find_delimiter(self, header: str) -> str:
        outside = "".join(header.split('"')[::2])
        found = [mark for mark in _DELIMITERS if mark in outside]
        if len(found) > 1:
            kinds = " and ".join(_DELIMITERS[mark] for mark in found)
            raise FileError(f"the column names are separated by {kinds}; use one", path=self.path, line=self.line)
        return found[0] if found else ","

    def _check_names(self, names: list[str]) -> None:
        def error(problem: str) -> FileError:
            return FileError(problem, path=self.path, line=self.line)

        for place, name in enumerate(names, 1):
            if not name:
                raise error(f"column {place} has no name; give it one or remove it")
            if names.index(name) < place - 1:
                raise error(f"column {name!r} appears twice (columns {names.index(name) + 1} and {place}); remove one")
        if all(name.lstrip("+-").replace(".", "", 1).isdigit() for name in names):
            raise error(f"numbers ({', '.join(names[:3])}) stand where the column names should be; add a line of names")

    def _split(self, lines: list[str], first: int) -> list[list[str]]:
        """Cells of each line; a quoted cell must close on its line."""
        try:
            rows = list(csv.reader(lines, delimiter=self.delimiter, skipinitialspace=True))
        except csv.Error as error:
            raise FileError(f"cannot be split into cells ({error})", path=self.path, line=first) from None
        if len(rows) != len(lines):
            raise FileError("a quoted cell does not end on its line; close the quote", path=self.path,
                            line=first + _open_quote(lines, self.delimiter))  # fmt: skip
        return rows

    def add(self, block: Block) -> None:
        """Convert the rows of a block and keep them."""
        rows: Sequence[Sequence[str]] = self._split(block.lines, block.first)
        lines = np.arange(block.first, block.first + len(rows))
        width = len(self.names)
        regular = all(len(row) == width and row[0][:1] != "#" and row[0] for row in rows)
        if not regular:
            keep = [i for i in range(len(rows)) if self._is_row(rows[i], block.lines[i], block.first + i)]
            rows, lines = [rows[i][:width] for i in keep], lines[keep]
        if not rows:
            return
        self.lines.append(lines)
        for (name, number, gaps), cells in zip(self.kinds, zip(*rows, strict=True), strict=True):
            if number:
                values = self.numbers.convert(cells, name, lines.tolist(), gaps=gaps, plain=block.plain)
                self.parts[name].append(values)
            else:
                self.texts[name] += [cell.strip() for cell in cells]

    def _is_row(self, row: Sequence[str], raw: str, line: int) -> bool:
        """False for blank and comment lines; FileError for a row of another length."""
        width = len(self.names)
        if not any(cell.strip() for cell in row):
            return False
        if raw.lstrip().startswith("#"):
            if len(row) == width > 1:
                problem = "this comment has as many cells as a row; delete it, or quote the cell that begins with #"
                raise FileError(problem, path=self.path, line=line)
            return False
        if len(row) < width or any(cell.strip() for cell in row[width:]):
            problem = f"this row has {len(row)} cells and the header {width}; "
            comma = self.delimiter == "," and len(row) > width
            remedy = "with a decimal comma separate columns by semicolons" if comma else "complete or remove it"
            raise FileError(problem + remedy, path=self.path, line=line)
        return True

    def table(self, digest: str) -> Table:
        """Everything read, once the file has ended."""
        if not self.lines:
            raise FileError("there are column names but no rows of values", path=self.path, line=self.line)
        self.numbers.finish()
        columns: dict[str, Column] = {}
        for name, number, _ in self.kinds:
            columns[name] = np.concatenate(self.parts[name]) if number else tuple(self.texts[name])
        for column in columns.values():
            if not isinstance(column, tuple):
                column.flags.writeable = False
        lines = np.concatenate(self.lines)
        return Table(self.path, self.names, MappingProxyType(columns), lines, self.line, digest)


def _open_quote(lines: list[str], delimiter: str) -> int:
    """Index of the first line whose quoted cell stays open."""
    for index, line in enumerate(lines):
        try:
            list(csv.reader([line], delimiter=delimiter, skipinitialspace=True, strict=True))
        except csv.Error:
            return index
    return 0
