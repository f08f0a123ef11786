"""The one path by which a table is read: usual dialects in, exact columns out, or an error that names the place."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from itertools import chain
from logging import getLogger
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inclinometry.arrays import Array, Mask
from inclinometry.errors import FileError, InputError
from inclinometry.files._quantities import azimuths, columns_called
from inclinometry.files.columns import TEXT, channel, is_number
from inclinometry.files.foreign import MOST_COLUMNS, MOST_VALUES, Read, foreign_pieces
from inclinometry.files.frame import Column, Frame, row_error
from inclinometry.files.profile import Reading, current, stated_unit
from inclinometry.files.table_formats import Piece, TextTable
from inclinometry.files.text import NULLS, Cells, LineReader, NumberReader, Progress, regular_columns, texts_of
from inclinometry.files.timestamps import Clock, part_of_time
from inclinometry.findings import Finding
from inclinometry.opening import too_large


def read_table(
    path: str | Path,
    progress: Progress | None = None,
    *,
    numeric: Callable[[str], bool] = is_number,
    gaps: Collection[str] = (),
    timed: bool = False,
    read: Read | None = None,
) -> Frame:
    """Read a table of any format, a CSV file with one line of column names above all.

    Comma, semicolon or tab; UTF-8, UTF-16 with its mark, or the encoding in which the letters make words; decimal
    point, or comma where it cannot be mistaken; blank lines, quoted cells and lines that begin with `#` are understood;
    what could be read in two ways is an error. `numeric` says which names hold numbers, `gaps` which of them may be
    empty (NaN); with `timed`, date and time become `time_s`, seconds since the first row. `read` reads a file whose
    beginning need not tell what it is.
    """
    return TableFile(path, progress, timed=timed, read=read).read(numeric, gaps)


class TableFile:
    """A table that is open: its names are known, its rows are read once, piece by piece.

    names : of the columns as the file has them, or as the profile names them. line : of the names, or None.
    With `timed`, columns of date and time become `time_s`, seconds since the first row. Of azimuths from several norths
    those from `north` are read.
    """

    def __init__(
        self,
        path: str | Path,
        progress: Progress | None = None,
        *,
        timed: bool = False,
        read: Read | None = None,
        north: object = None,
    ) -> None:
        profile = current()
        self.path, self._profile = Path(path), profile
        self._lines = LineReader(self.path, progress, profile.encoding)
        found: Any = foreign_pieces(self.path, self._lines.hash, read, progress)
        first = None if found is None else next(found)
        self._text: TextTable | None = None
        self.word, self.line = "line", None
        self._bare: Mapping[str, str] = {}
        self._north: str | None = None
        self._header: Mapping[str, str] = {}
        self.findings: tuple[Finding, ...] = ()
        empty = set[int]()
        if isinstance(first, Frame):
            written, self.word, self.line = list(first.columns), first.word, first.header_line
            self._bare, self._north, self._header = first.bare, first.north, first.header
            self.findings = first.findings
            pieces: Iterator[Piece] = ((f.lines, list(f.columns.values())) for f in chain([first], found))
        else:
            self._header = {} if first is None else first.header
            blocks = self._lines.blocks() if found is None else chain([first], found)
            self._text = TextTable(self.path, blocks, self._profile)
            written, self.line = self._text.names, self._text.line
            pieces, self._north = self._text.pieces(), self._text.north
            self.findings = self._lines.findings
            if "" in written and (one := next(pieces, None)) is not None:
                # a table that does not begin in the first column of its sheet, or begins with the numbers of its rows
                unnamed = (k for k, name in enumerate(written) if not name)
                empty = {k for k in unnamed if not any(map(str.strip, texts_of(one[1][k])))}
                empty |= {0} if not written[0] and _counts(texts_of(one[1][0])) else set()
                pieces = chain([one], pieces)
        if north := north or profile.constants.get("azimuth_reference"):
            of = azimuths(written, profile.units)
            wanted = [k for k in of if of[k] == north] or [k for k in of if of[k] is None]
            empty |= set(of) - set(wanted) if len(wanted) == 1 else set()
        for k in [k for k, name in enumerate(written) if name in written[:k] and self._unread(name)]:
            written[k] = f"{written[k]} ({k + 1})"
        self._numbers = NumberReader(self.path, self.word)
        self._width, self._count = len(written), 0
        # the north may be stated twice, as long as both are the same
        told = {name: value for name, value in self._profile.constants.items() if name != "azimuth_reference"}
        self._constants = told if "azimuth_reference" in written else self._profile.constants
        self._extra = [*self._constants, *["time_s"] * bool(self._profile.rate_hz)]
        keys = [profile.key_of(name) for name in written]
        self._blank = {k: self._profile.blank[key] for k, key in enumerate(keys) if key in self._profile.blank}
        self._deleted = {k: profile.deleted[key] for k, key in enumerate(keys) if key in profile.deleted}
        self._gone = 0
        self._kept = [k for k, key in enumerate(keys) if k not in empty and profile.columns.get(key) != ""]
        names = [*(written[k] for k in self._kept), *self._extra]
        self._clock: Clock | None = None
        if timed and any(part_of_time(name) for name in names):
            one = next(pieces, None)
            if one is not None and len(one[0]):
                pieces = chain([one], pieces)
                texts = [(*texts_of(one[1][k][:1]), "")[0] for k in self._kept]
                self._clock = Clock(self.path, names, [*texts, *[""] * len(self._extra)])
        self._pieces = pieces
        self._timed = self._clock.places if self._clock is not None else []
        self._left = [k for k in range(len(names)) if k not in self._timed]
        self.written = tuple(["time_s"] * bool(self._timed) + [names[k] for k in self._left])
        self._check_names(self.written)
        self.readings = self._readings(lambda name: False)
        self.names = tuple(reading.name for reading in self.readings)
        self._check_names(self.names)

    @property
    def digest(self) -> str:
        """Of the bytes read so far: of the file once its rows are read."""
        return self._lines.digest

    def _error(self, found: Finding, line: int | None) -> FileError:
        return row_error(self.path, found, line, self.word)

    def _unread(self, name: str) -> bool:
        """Whether no command needs a column of this name: it may be there twice."""
        known = is_number(name) or name in TEXT or part_of_time(name) or columns_called(name)
        return not known and name[:1].isalpha() and name not in self._profile.columns and not stated_unit(name)

    def _check_names(self, names: Sequence[str]) -> None:
        if len(names) > MOST_COLUMNS:
            raise self._error(too_large("columns", len(names), MOST_COLUMNS), self.line)
        for place, name in enumerate(names, 1):
            if not name:
                raise self._error(Finding("table-unnamed", {"place": place}), self.line)
            if names.index(name) < place - 1:
                raise self._error(Finding("input-repeated", {"name": "column", "value": name}), self.line)
        if names and all(name.lstrip("+-").replace(".", "", 1).isdigit() for name in names):
            raise self._error(Finding("table-names-numbers", {"names": tuple(names[:3])}), self.line)

    def _readings(self, numeric: Callable[[str], bool]) -> list[Reading]:
        """What each column is; a name is only translated into one the file does not have itself."""
        found, profile = [], self._profile
        for name in self.written:
            bare = self._bare.get(name, name)
            try:
                reading = (
                    Reading(bare)
                    if name.startswith(f"{bare} (") and numeric(bare)
                    else profile.reading(name, numeric, self.written)
                )
            except InputError as error:
                raise row_error(self.path, error.finding, self.line, self.word) from None
            stated = profile.key_of(name) in profile.columns or bool(profile.axes)
            found.append(reading if stated or reading.name not in self.written else Reading(name))
        return found

    def take(self, numeric: Callable[[str], bool]) -> tuple[str, ...]:
        """Read the columns as what they are to a reader that takes `numeric` names as numbers; their names."""
        self.readings = self._readings(numeric)
        self.names = tuple(reading.name for reading in self.readings)
        named = azimuths(list(filter(numeric, self.names))).values()
        norths = tuple(dict.fromkeys(one for one in (*(r.north for r in self.readings), *named) if one))
        own = [name for name, r in zip(self.written, self.readings, strict=True) if r.name == "azimuth_deg"]
        if len(norths) > 1 or (norths and len(own) > 1):
            raise self._error(Finding("table-norths", {"norths": norths if len(norths) > 1 else tuple(own)}), self.line)
        self._check_names(self.names)
        self.degrees = {
            reading.name
            for reading in self.readings
            if reading.factor == 1.0
            and channel(reading.name) is None
            and (reading.name.endswith("_deg") or stated_unit(reading.name) == "deg")
        }
        return self.names

    def log(self, what: str, numbers: Collection[str]) -> None:
        """Say in the log which columns were taken, and as what."""
        known = [
            reading.name if written == reading.name else f"{written!r} as {reading.name}"
            for written, reading in zip(self.written, self.readings, strict=True)
            if reading.name in numbers
        ]
        getLogger("inclinometry").info("%s: %s; %s", self.path, what, ", ".join(known) or "no numbers")

    def pieces(
        self, numbers: Collection[str], gaps: Collection[str] = (), *, texts: bool = True, nan: bool = False
    ) -> Iterator[tuple[NDArray[np.int64], dict[str, Array], dict[str, list[str]]]]:
        """Lines, columns of `numbers` in the units of the file, and texts if they are wanted, piece by piece.

        A cell may be empty in the columns of `gaps`, and say nan where `nan`.
        """
        self._prepare(numbers, gaps, texts, nan)
        for lines, cells in self._pieces:
            lines, columns = self._completed(lines, cells)
            if not len(lines):
                continue
            values: dict[str, Array] = {}
            rest: dict[str, list[str]] = {}
            for name, column in zip(self.names, columns, strict=True):
                if name in numbers:
                    if nan and not isinstance(column, np.ndarray):
                        column = ["" if cell.strip().lstrip("+-").lower() == "nan" else cell for cell in column]
                    values[name] = self._numbers.convert(
                        column, name, lines, gaps=name in gaps, degrees=name in self.degrees
                    )
                elif texts:
                    rest[name] = [cell.strip() for cell in texts_of(column)]
            yield lines, values, rest
        self._numbers.finish()

    def _prepare(self, numbers: Collection[str], gaps: Collection[str], texts: bool, nan: bool) -> None:
        """Regular blocks of a text are converted at once where something is a number."""
        if self._text is None or self._blank:
            return
        # the names of those columns of the file that are neither left out nor the time
        named = {
            self._kept[k]: name
            for k, name in zip(self._left, self.names[bool(self._timed) :], strict=True)
            if k < len(self._kept)
        }
        numeric: list[bool | None] = [None] * self._width
        for k, name in named.items():
            numeric[k] = True if name in numbers else False if texts else None
        for k in (*(self._kept[k] for k in self._timed), *self._deleted):
            numeric[k] = False
        if not any(numeric):
            return
        mark = self._text.mark

        def quick(text: str, lines: list[str]) -> list[Cells] | None:
            # the careful way notes where the first point stands, and refuses
            if "." in text and not self._numbers.pointed:
                return None
            found = regular_columns(lines, numeric, mark, nan)
            empty = None
            for k, number in enumerate(numeric):
                if found is None or not number:
                    continue
                values = np.asarray(found[k])
                missing = np.isnan(values)
                if np.isinf(values).any() or (missing.any() and not (nan and named[k] in gaps)):
                    return None
                empty = missing if empty is None else empty & missing
            return None if empty is not None and empty.any() else found

        self._text.quick = quick

    def _completed(self, lines: NDArray[np.int64], cells: list[Cells]) -> tuple[NDArray[np.int64], list[Cells]]:
        """Columns in the order of the names: what is left out and added by the profile, and the time."""
        for k, texts in self._deleted.items():
            kept = np.array([cell.strip() not in texts for cell in texts_of(cells[k])], dtype=bool)
            self._gone += len(kept) - int(kept.sum())
            lines, cells = _taken(lines, cells, kept)
        for k, none in self._blank.items():
            cells[k] = ["" if cell.strip() == none else cell for cell in texts_of(cells[k])]
        columns = [cells[k] for k in self._kept]
        if not self._extra:
            lines, columns = _filled(lines, columns)
        size = len(lines)
        for value in self._constants.values():
            columns.append((value,) * size if isinstance(value, str) else np.full(size, value))
        if self._profile.rate_hz:
            columns.append(np.arange(self._count, self._count + size) / self._profile.rate_hz)
            self._count += size
        if self._clock is None or not self._timed:
            return lines, columns
        time = self._clock.of([texts_of(columns[k]) for k in self._timed], lines)
        return lines, [time, *(columns[k] for k in self._left)]

    def scaled(self, columns: Mapping[str, Array]) -> dict[str, Array]:
        """In the units of the names, where a profile or the file's own name of a column has another."""
        turned = {r.name: r for r in self.readings if (r.factor, r.offset) != (1.0, 0.0)}
        return {
            name: values * turned[name].factor + turned[name].offset if name in turned else values
            for name, values in columns.items()
        }

    def read(self, numeric: Callable[[str], bool] = is_number, gaps: Collection[str] = ()) -> Frame:
        """All rows; `numeric` says which names are numbers, of which those in `gaps` may have empty cells."""
        numbers = [name for name in self.take(numeric) if numeric(name)]
        empty = [name for name in numbers if name in gaps]
        parts: dict[str, list[Array]] = {name: [] for name in numbers}
        texts: dict[str, list[str]] = {name: [] for name in self.names if name not in parts}
        places: list[NDArray[np.int64]] = []
        for rows, values, cells in self.pieces(numbers, empty):
            places.append(rows)
            for name, part in values.items():
                parts[name].append(part)
            for name, more in cells.items():
                texts[name] += more
        if not places:
            raise self._error(Finding("file-empty", {"what": "rows"}), self.line)
        lines = np.concatenate(places)
        if self._text is None and len(lines) * len(self.names) > MOST_VALUES:
            raise self._error(too_large("values", len(lines) * len(self.names), MOST_VALUES), None)
        # each column twice only while it is put together
        found = {name: np.concatenate(parts.pop(name)) for name in numbers}
        self._take_nulls(found, empty, lines)
        found = self.scaled(found)
        for column in found.values():
            column.flags.writeable = False
        columns: dict[str, Column] = {name: found[name] if name in found else tuple(texts[name]) for name in self.names}
        for north in filter(None, (self._north, *(reading.north for reading in self.readings))):
            stated = columns.setdefault("azimuth_reference", (north,) * len(lines))
            for row, cell in enumerate(stated):
                if cell != north:
                    raise self._error(Finding("input-north", {"norths": (north, str(cell))}), int(lines[row]))
        self.log(f"{len(lines):,} rows", numbers)
        counts = {"table-deleted": self._gone, "table-second-set": 0 if self._text is None else self._text.second}
        left = [Finding(code, {"count": count}, severity="note") for code, count in counts.items() if count]
        if self._text is not None and (below := self._text.below):
            left.append(Finding("table-below", {"count": len(below), "line": below[0][2]}, severity="note"))
        return Frame(
            self.path,
            MappingProxyType(columns),
            lines,
            self.line,
            self._bare,
            self.word,
            self._north,
            self._header,
            self.digest,
            (*self.findings, *left),
        )

    def _take_nulls(self, numbers: dict[str, Array], gaps: Collection[str], lines: NDArray[np.int64]) -> None:
        """What is declared to stand for nothing becomes NaN; what looks so and is not declared is refused.

        An angle is never -999.25. Of other columns two must say so in one row: a channel may pass through any value.
        """
        suspects = np.zeros(len(lines), np.int16)
        for name, values in numbers.items():
            if self._profile.null is not None:
                empty = values == self._profile.null
                if empty.any() and name not in gaps:
                    raise self._error(Finding("table-empty", {"column": name}), int(lines[np.argmax(empty)]))
                values[empty] = np.nan
            elif np.nanmin(values, initial=0.0) <= NULLS[0]:
                suspects += np.isin(values, NULLS) * np.int16(2 if name in self.degrees else 1)
        if (suspects > 1).any():
            row = int(np.argmax(suspects > 1))
            name = next(name for name, values in numbers.items() if values[row] in NULLS)
            marked = Finding("table-null", {"column": name, "value": float(numbers[name][row])})
            raise self._error(marked, int(lines[row]))


def _counts(cells: Sequence[str]) -> bool:
    """Whether these are 0, 1, 2 .. or 1, 2, 3 .."""
    return any([cell.strip() for cell in cells] == [str(start + k) for k in range(len(cells))] for start in (0, 1))


def _filled(lines: NDArray[np.int64], columns: list[Cells]) -> tuple[NDArray[np.int64], list[Cells]]:
    """Without the rows that hold nothing."""
    empty = np.ones(len(lines), dtype=bool)
    for cells in columns:
        if not empty.any():
            return lines, columns
        if isinstance(cells, np.ndarray) and cells.dtype != np.object_:
            empty &= np.isnan(cells)
        elif len(cells) == len(lines):  # else it is not wanted
            rows = np.flatnonzero(empty).tolist()
            empty[rows] = [isinstance(cells[k], str) and not cells[k].strip() for k in rows]
    if not empty.any():
        return lines, columns
    return _taken(lines, columns, ~empty)


def _taken(lines: NDArray[np.int64], columns: list[Cells], kept: Mask) -> tuple[NDArray[np.int64], list[Cells]]:
    """These rows; a column that is not wanted has none."""
    if kept.all():
        return lines, columns
    rows = np.flatnonzero(kept).tolist()
    return lines[rows], [
        c[rows] if isinstance(c, np.ndarray) else [c[k] for k in rows] if len(c) else c for c in columns
    ]
