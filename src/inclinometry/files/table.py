"""The one path by which a CSV file is read: usual dialects in, exact columns out, or an error that names the place."""

from __future__ import annotations

import codecs
import csv
import hashlib
import re
import zlib
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, compress
from logging import getLogger
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inclinometry.arrays import Array, Mask, frozen
from inclinometry.errors import FileError, InputError
from inclinometry.files._quantities import columns_called
from inclinometry.files.columns import (
    KNOWN,
    advice,
    channel,
    channel_advice,
    closest,
    is_number,
)
from inclinometry.files.profile import PLAIN, Profile, Reading, current, stated_unit

# Numbers as people write them: one strict rule for points, commas, blanks and text.

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_WITH_COMMA = re.compile(r"[+-]?(\d+,\d*|,\d+)([eE][+-]?\d+)?", re.ASCII)
# 12,345 may be twelve thousand or twelve and a bit; 0,345 or 1,5 can only be a decimal comma
_PERHAPS_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}", re.ASCII)
_DEGREES_MINUTES = re.compile(
    r"([+-]?)(\d+)\s*[°º]\s*(?:([0-5]?\d(?:[.,]\d+)?)\s*['′’])?\s*(?:([0-5]?\d(?:[.,]\d+)?)\s*(?:\"|''|″|”))?", re.ASCII
)
_PERHAPS_MINUTES = re.compile(r"([+-]?\d+)[ :]+([0-5]?\d)(?:[ :]+([0-5]?\d(?:\.\d+)?))?", re.ASCII)
# 1,234.5 is one thousand and a bit: nothing else has a point behind
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+\.\d*", re.ASCII)


class NumberReader:
    """Converts columns of text, block by block, and remembers which decimal mark the file uses."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._comma: tuple[int, str, str] | None = None  # line, column, text of the first number with a comma
        self._point: tuple[int, str, str] | None = None
        self._proved = False

    def convert(
        self, cells: Sequence[str], name: str, lines: Sequence[int], *, gaps: bool, plain: bool, degrees: bool = False
    ) -> Array:
        """Float64 of one column's cells; an empty cell is NaN where `gaps` are allowed, else FileError.

        A column of `degrees` may be written in degrees, minutes and seconds, 10°30'15".
        """
        values = self._fast(cells) if plain else None
        if values is None:
            values = self._careful(cells, name, lines, gaps, degrees)
        elif self._point is None and "." in "".join(cells):
            row = next(i for i, cell in enumerate(cells) if "." in cell)
            self._point = (int(lines[row]), name, cells[row].strip())
        good = np.isfinite(values)
        if not good.all():
            for row in np.flatnonzero(~good).tolist():
                if not (gaps and not cells[row].strip()):
                    raise self._refuse(cells[row].strip(), name, int(lines[row]))
        return values

    @property
    def pointed(self) -> bool:
        """Whether a number with a decimal point has been met."""
        return self._point is not None

    def finish(self) -> None:
        """The verdict on the decimal mark, once the whole file is known; never a guess."""
        if self._comma is None:
            return
        line, name, text = self._comma
        if self._point is not None:
            where = f"{self._point[2]!r} in line {self._point[0]} has a decimal point"
            problem = f"{text!r} in column {name!r} has a decimal comma, but {where}; use one of them throughout"
            raise FileError(problem, path=self._path, line=line)
        if not self._proved:
            problem = f"{text!r} in column {name!r} may mean {text.replace(',', '')} or {text.replace(',', '.')}"
            raise FileError(f"{problem}; write numbers with a decimal point", path=self._path, line=line)

    def _fast(self, cells: Sequence[str]) -> Array | None:
        try:
            return np.fromiter(map(float, cells), np.float64, len(cells))
        except ValueError:
            pass
        if self._comma is None or not self._proved:
            return None
        joined = "\n".join(cells)
        if "." in joined:
            return None
        try:
            return np.fromiter(map(float, joined.replace(",", ".").split("\n")), np.float64, len(cells))
        except ValueError:
            return None

    def _careful(self, cells: Sequence[str], name: str, lines: Sequence[int], gaps: bool, degrees: bool) -> Array:
        values = np.full(len(cells), np.nan)
        for row, cell in enumerate(cells):
            text = cell.strip()
            if _NUMBER.fullmatch(text):
                values[row] = float(text)
                if self._point is None and "." in text:
                    self._point = (int(lines[row]), name, text)
            elif _THOUSANDS.fullmatch(text):
                # a comma before a point marks thousands, and nothing else
                values[row] = float(text.replace(",", ""))
                self._point = self._point or (int(lines[row]), name, text)
            elif _WITH_COMMA.fullmatch(text):
                values[row] = float(text.replace(",", "."))
                self._comma = self._comma or (int(lines[row]), name, text)
                self._proved = self._proved or not _PERHAPS_THOUSANDS.fullmatch(text)
            elif degrees and (parts := _DEGREES_MINUTES.fullmatch(text)):
                values[row] = _in_degrees(*parts.groups())
            elif text or not gaps:
                raise self._refuse(text, name, int(lines[row]), degrees)
        return values

    def _refuse(self, text: str, name: str, line: int, degrees: bool = False) -> FileError:
        shown = text if len(text) <= 40 else text[:37] + "..."
        if not text:
            problem = f"column {name!r} is empty; fill it in or remove the row"
        elif text.lower().lstrip("+-") in ("nan", "inf", "infinity") or _NUMBER.fullmatch(text):
            problem = f"column {name!r} is {shown}; every value must be finite: correct it or remove the row"
        elif degrees and (parts := _PERHAPS_MINUTES.fullmatch(text)):
            whole, minutes, seconds = parts.groups()
            value = _in_degrees(whole[: whole[0] in "+-"], whole.lstrip("+-"), minutes, seconds)
            marked = f"{whole}°{minutes}'" + (f'{seconds}"' if seconds else "")
            problem = f"{shown!r} in column {name!r} may be degrees and minutes; write {value:.8g} or {marked}"
        elif "," in text and not set(text) - set("+-0123456789.,"):
            problem = f"{shown!r} in column {name!r} has a thousands separator; write digits and one decimal point"
        else:
            problem = f"{shown!r} in column {name!r} is not a number; correct it or remove the row"
        return FileError(problem, path=self._path, line=line)


def _in_degrees(sign: str, degrees: str, minutes: str | None, seconds: str | None) -> float:
    """Degrees from whole degrees, minutes and seconds, the latter perhaps with a decimal comma."""
    parts = (float((part or "0").replace(",", ".")) for part in (degrees, minutes, seconds))
    value = sum(part / per for part, per in zip(parts, (1.0, 60.0, 3600.0), strict=True))
    return -value if sign == "-" else value


NULLS: Final = (-999.25, -9999.25, -99999.25, -999999.25)
"""What many programs write where there is nothing."""


# From the bytes of a text file to blocks of lines: encoding, line ends, digest, progress; bounded memory.

CHUNK = 1 << 20
LONGEST_LINE = 1 << 20
MOST_COLUMNS = 1000
Progress = Callable[[int], None]

_MAGIC = {
    b"%PDF": "a PDF document, which is no table; export its table as CSV or Excel where it was made",
    b"\xd0\xcf\x11\xe0": "a workbook of Excel before 2007 (.xls); save it as .xlsx or CSV",
}


class Block(NamedTuple):
    """Consecutive lines without their ends; `plain` when ASCII without an underscore, so that float() is strict."""

    first: int
    lines: list[str]
    plain: bool


@dataclass
class LineReader:
    """Reads a file once; `digest` is complete behind its `blocks`; where `timed`, date and time become `time_s`."""

    path: Path
    progress: Progress | None = None
    profile: Profile | None = None
    timed: bool = False
    rows: bool = False
    _hash: hashlib._Hash = field(default_factory=hashlib.sha256)

    @property
    def digest(self) -> str:
        """Digest of the bytes read so far, as `digest.digest_file` gives for the whole file."""
        return "sha256:" + self._hash.hexdigest()

    def blocks(self) -> Iterator[Block]:
        """Blocks of about one megabyte, in the layout of a plain table; FileError for what is no table."""
        if not self.timed:
            return self._laid_out()
        from inclinometry.files.timestamps import timed

        return timed(self._laid_out(), self.path)

    def _laid_out(self) -> Iterator[Block]:
        if self.profile is None:
            yield from self._plain()
            return
        from inclinometry.files.layout import laid_out, opened, with_found_layout

        foreign = opened(self.path, self._hash)
        if foreign is not None:
            one = next(foreign)
            # arrays have names, and rows that are counted without them
            self.rows = one.first == 0
            foreign = chain([one], foreign)
        if not self.profile.states_layout:
            yield from with_found_layout(self._plain() if foreign is None else foreign, self.profile, self.path)
        elif foreign is None:
            yield from laid_out(self._plain(), self.profile, self.path)
        else:
            # its cells stand apart already
            yield from laid_out(foreign, replace(self.profile, separator=","), self.path)

    def _plain(self) -> Iterator[Block]:
        carry, line = "", 1
        for text in self._texts():
            *lines, carry = (carry + text).replace("\r\n", "\n").replace("\r", "\n").split("\n")
            if len(carry) > LONGEST_LINE:
                raise FileError(
                    f"this line is longer than {LONGEST_LINE} characters; no table", path=self.path, line=line
                )
            if lines:
                yield _block(line, lines)
                line += len(lines)
        if carry:
            yield _block(line, [carry])

    def _texts(self) -> Iterator[str]:
        """Decoded pieces that never end between a carriage return and its line feed."""
        decoder: codecs.IncrementalDecoder | None = None
        held, done, lines = "", 0, 1
        for chunk in self._chunks():
            decoder = decoder or codecs.getincrementaldecoder(_encoding(chunk, self.path))("strict")
            done += len(chunk)
            try:
                text = held + decoder.decode(chunk, final=not chunk)
            except UnicodeDecodeError as error:
                raise _not_text(error, chunk, lines, self.path) from None
            if "\0" in text:
                raise FileError("not a text file (it holds zero bytes); save it as CSV, UTF-8", path=self.path)
            held = "\r" if chunk and text.endswith("\r") else ""
            lines += text.count("\n")
            yield text[: len(text) - len(held)]
            if self.progress is not None and chunk:
                self.progress(done)

    def _chunks(self) -> Iterator[bytes]:
        """Raw pieces, an empty one last so that the decoder can finish."""
        try:
            with self.path.open("rb") as stream:
                start = stream.read(CHUNK)
                packed = zlib.decompressobj(31) if start.startswith(b"\x1f\x8b") else None
                for chunk in chain([start], iter(lambda: stream.read(CHUNK), b"")):
                    self._hash.update(chunk)
                    if packed is None:
                        yield chunk
                        continue
                    rest = chunk
                    while rest.strip(b"\0") if packed.eof else rest:
                        # what follows the end of one part is another part
                        packed = zlib.decompressobj(31) if packed.eof else packed
                        # a megabyte at a time, however far it unpacks
                        if piece := packed.decompress(rest, CHUNK):
                            yield piece
                        rest = packed.unconsumed_tail or packed.unused_data
                if packed is not None and not packed.eof:
                    raise FileError("the compressed file ends early; copy it again", path=self.path)
        except zlib.error as error:
            raise FileError(f"damaged where it is compressed ({error}); copy it again", path=self.path) from None
        except FileNotFoundError:
            raise FileError("there is no such file; check the name", path=self.path) from None
        except IsADirectoryError:
            raise FileError("this is a folder; give the name of a file", path=self.path) from None
        except (OSError, ValueError) as error:
            raise FileError(f"cannot be read ({getattr(error, 'strerror', None) or error})", path=self.path) from None
        yield b""


def _block(first: int, lines: list[str]) -> Block:
    text = "".join(lines)
    return Block(first, lines, text.isascii() and "_" not in text)


def _encoding(start: bytes, path: Path) -> str:
    """UTF-8 unless a byte-order mark says otherwise."""
    if start.startswith((codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE)):
        raise FileError("UTF-32 text is not read; save it as UTF-8", path=path)
    if start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    for magic, what in _MAGIC.items():
        if start.startswith(magic):
            raise FileError(f"this is {what}", path=path)
    if set(start) - _ASCII and set(start) - _ASCII <= _SIGNS:
        return "latin-1"  # signs of units alone, by a program that knows no UTF-8
    return "cp1252" if _western(start) else "utf-8-sig"


def _western(start: bytes) -> bool:
    """Whether it is no UTF-8, and its letters stand between ASCII as those of western languages do.

    Other alphabets make runs of such bytes, in one of several encodings: they are refused, not guessed.
    """
    try:
        codecs.getincrementaldecoder("utf-8")("strict").decode(start)
    except UnicodeDecodeError:
        return b"\0" not in start and not re.search(rb"[\x80-\xff]{3}|[\xc2-\xf4][\x80-\xbf]|[\x80-\x9f]", start)
    return False


_ASCII: Final = frozenset(range(128))
_SIGNS: Final = frozenset("°²µ".encode("latin-1"))


def _not_text(error: UnicodeDecodeError, chunk: bytes, line: int, path: Path) -> FileError:
    """The error's position refers to the decoder's buffer, which may begin with bytes kept from the chunk before."""
    piece = bytes(error.object)
    line += piece[: error.start].count(b"\n")
    value = f"byte 0x{piece[error.start]:02x}" if piece else "its end"
    return FileError(f"not {error.encoding} text ({value}, {error.reason}); save it as UTF-8", path=path, line=line)


Column: TypeAlias = Array | tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Table:
    """What a CSV file holds.

    path : where it was read.
    header : column names in the file's order.
    columns : name -> (n,) float64, or a tuple of text where the name is not one of the package's numbers.
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

    def rows(self, kept: Mask) -> Table:
        """The same table with these rows alone."""
        columns: dict[str, Column] = {}
        for name, cells in self.columns.items():
            text = isinstance(cells, tuple)
            columns[name] = tuple(compress(cells, kept)) if text else frozen(np.asarray(cells)[kept])
        return replace(self, columns=MappingProxyType(columns), lines=self.lines[kept])

    def require(self, names: Iterable[str]) -> None:
        """FileError for the first of `names` that is missing, with the likely remedy."""
        for name in names:
            if name not in self.columns:
                hints = [(found, advice(found, [name])) for found in self.header]
                hint = next((f" ({found!r}: {text})" for found, text in hints if text), "")
                bare = next((found for found in self.header if name in columns_called(found)), None)
                if not hint and bare is not None:
                    hint = f" ({bare!r} has no unit: state --units, or write {name})"
                if not hint and (near := closest(name, [n for n in self.header if n not in KNOWN and not channel(n)])):
                    hint = f" (is it {near!r}? then rename it)"
                shown = ", ".join(self.header[:20]) + (", ..." if len(self.header) > 20 else "")
                raise self.error(f"column {name!r} is missing{hint}; columns found: {shown}")

    def unknown(self, known: Collection[str]) -> tuple[str, ...]:
        """Columns neither known nor channels; FileError for one that is nearly a known name or lacks its unit."""
        found = tuple(n for n in self.header if n not in known and channel(n) is None)
        lacking = [name for name in known if name not in self.columns]
        for name in found:
            hint = advice(name, lacking)
            if hint:
                raise self.error(f"column {name!r} is not known; {hint}")
            hint = channel_advice(name)
            if hint:
                raise self.error(f"column {name!r} is not known; {hint}")
        return found

    def error(self, problem: str, row: int | None = None) -> FileError:
        """An error about one row, or about the header."""
        line = self.header_line if row is None else int(self.lines[row])
        error = FileError(problem, path=self.path, line=line)
        return error if self.header_line else error.of_rows()


def read_table(
    path: str | Path,
    progress: Progress | None = None,
    *,
    numeric: Callable[[str], bool] = is_number,
    gaps: Collection[str] = (),
    timed: bool = False,
) -> Table:
    """Read a CSV file with one line of column names.

    Comma, semicolon or tab (whichever the header uses); UTF-8, UTF-16 with its mark or Windows-1252; decimal point, or
    decimal comma where it cannot be mistaken; blank lines, trailing spaces and separators, quoted cells, and comment
    lines that begin with `#` are understood. What could be read in two ways is an error.

    Parameters
    ----------
    path : str or Path
    progress : callable, optional
        Called with the number of bytes read so far.
    numeric : callable, optional
        Which column names hold numbers; the package's vocabulary when not given.
    gaps : collection of str
        Numeric columns whose cells may be empty (NaN).
    timed : bool
        Columns of date and time become `time_s`, seconds since the first row.

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
    profile = current()
    reader = LineReader(Path(path), progress, profile, timed)
    body: _Body | None = None
    try:
        for block in reader.blocks():
            if body is None:
                start = _header_row(block)
                if start is None:
                    continue
                body = _Body(reader.path, block.lines[start], block.first + start, numeric, gaps, profile)
                block = Block(block.first + start + 1, block.lines[start + 1 :], block.plain)
            body.add(block)
        if body is None:
            raise FileError("the file is empty; a line of column names and rows of values are needed", path=path)
        table = body.table(reader.digest)
    except FileError as error:
        raise error.of_rows() if reader.rows else error from None
    log_columns(body, f"{len(table):,} rows")
    return table


def column_names(path: str | Path) -> tuple[str, ...]:
    """The names of the columns of a CSV file, as `read_table` has them; its rows are not read.

    Raises
    ------
    FileError
        Not found, not text, empty, duplicate or empty column names.
    """
    reader = LineReader(Path(path), profile=current())
    for block in reader.blocks():
        start = _header_row(block)
        if start is not None:
            line = block.first + start
            return _Body(reader.path, block.lines[start], line, lambda name: False, (), current()).names
    raise FileError("the file is empty; a line of column names and rows of values are needed", path=path)


def log_columns(body: _Body, what: str) -> None:
    """Say in the log which columns were taken, and as what."""
    known = [
        reading.name if written == reading.name else f"{written!r} as {reading.name}"
        for written, reading, (_, number, _) in zip(body.written, body.readings, body.kinds, strict=True)
        if number
    ]
    getLogger("inclinometry").info("%s: %s; %s", body.path, what, ", ".join(known) or "no numbers")


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
        self,
        path: Path,
        header: str,
        line: int,
        numeric: Callable[[str], bool],
        gaps: Collection[str],
        profile: Profile = PLAIN,
    ) -> None:
        self.path, self.line = path, line
        outside = "".join(header.split('"')[::2])
        delimiters = {",": "comma", ";": "semicolon", "\t": "tab"}
        found = [mark for mark in delimiters if mark in outside]
        if len(found) > 1:
            kinds = " and ".join(delimiters[mark] for mark in found)
            raise FileError(f"the column names are separated by {kinds}; use one", path=self.path, line=self.line)
        self.delimiter = found[0] if found else ","
        names = [name.strip() for name in self._split([header], line)[0]]
        while names and not names[-1]:
            names.pop()  # a trailing separator
        if len(names) > MOST_COLUMNS:
            raise FileError(f"{len(names):,} columns; allowed {MOST_COLUMNS:,}", path=path, line=line)
        self._check_names(names)
        self.written = tuple(names)
        self.readings = _readings_of(names, numeric, profile, path, line)
        self._check_names([reading.name for reading in self.readings])
        self.names = tuple(reading.name for reading in self.readings)
        self.kinds = [(name, numeric(name), name in gaps) for name in self.names]
        self.null = profile.null
        self.degrees = {
            reading.name
            for reading in self.readings
            if reading.factor == 1.0
            and channel(reading.name) is None
            and (reading.name.endswith("_deg") or stated_unit(reading.name) == "deg")
        }
        self.numbers = NumberReader(path)
        self.parts: dict[str, list[Array]] = {name: [] for name, number, _ in self.kinds if number}
        self.texts: dict[str, list[str]] = {name: [] for name, number, _ in self.kinds if not number}
        self.lines: list[NDArray[np.int64]] = []
        self._arrow: ArrowNumbers | None = None

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

    def _quick(self, block: Block) -> bool:
        """Whether Arrow has taken a block: not the first, regular, of finite numbers with points, or of whole ones."""
        if not self.lines or not block.plain or not self.parts:
            return False
        text = "\n".join(block.lines)
        if '"' in text or "#" in text or "\n\n" in text or (self.delimiter != "," and "," in text):
            return False
        # the careful way notes where the first point stands
        if not text.strip() or ("." in text and not self.numbers.pointed):
            return False
        if self._arrow is None:
            try:
                self._arrow = ArrowNumbers(self.names, list(self.parts), self.delimiter, list(self.texts))
            except ModuleNotFoundError:  # an extra
                return False
        found = self._arrow.convert(text)
        rows = len(block.lines) - (block.lines[-1] == "") - (block.lines[0] == "")
        if found is None or any(len(v) != rows or not np.isfinite(v).all() for v in found[0].values()):
            return False
        self.lines.append(np.arange(rows) + block.first + (block.lines[0] == ""))
        for name, values in found[0].items():
            self.parts[name].append(values)
        for name, cells in found[1].items():
            self.texts[name] += [cell.strip() for cell in cells]
        return True

    def add(self, block: Block) -> None:
        """Convert the rows of a block and keep them."""
        if self._quick(block):
            return
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
                values = self.numbers.convert(
                    cells, name, lines.tolist(), gaps=gaps, plain=block.plain, degrees=name in self.degrees
                )
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
        lines = np.concatenate(self.lines)
        self.lines.clear()  # each column twice only while it is put together
        numbers = {name: np.concatenate(self.parts.pop(name)) for name in list(self.parts)}
        self._take_nulls(numbers, lines)
        for (name, number, _), (_, factor, offset, _) in zip(self.kinds, self.readings, strict=True):
            if not number:
                columns[name] = tuple(self.texts[name])
                continue
            values = numbers[name]
            columns[name] = values if (factor, offset) == (1.0, 0.0) else values * factor + offset
        for column in columns.values():
            if not isinstance(column, tuple):
                column.flags.writeable = False
        north = next((reading.north for reading in self.readings if reading.north), None)
        if north is not None:
            stated = columns.setdefault("azimuth_reference", (north,) * len(lines))
            for row, cell in enumerate(stated):
                if cell != north:
                    problem = f"the azimuths count from {north} north by the name of their column, from {cell!r} here"
                    raise FileError(f"{problem}; correct one of them", path=self.path, line=int(lines[row]))
        return Table(self.path, tuple(columns), MappingProxyType(columns), lines, self.line, digest)

    def _take_nulls(self, numbers: dict[str, Array], lines: NDArray[np.int64]) -> None:
        """What is declared to stand for nothing becomes NaN; what looks so and is not declared is refused.

        An angle is never -999.25. Of other columns two must say so in one row: a channel may pass through any value.
        """
        gaps = {name for name, _, gap in self.kinds if gap}
        suspects = np.zeros(len(lines), np.int16)
        for name, values in numbers.items():
            if self.null is not None:
                empty = values == self.null
                if empty.any() and name not in gaps:
                    problem = f"column {name!r} is {self.null:g}, which is declared to be empty"
                    line = int(lines[np.argmax(empty)])
                    raise FileError(f"{problem}; fill it in or remove the row", path=self.path, line=line)
                values[empty] = np.nan
            elif np.nanmin(values, initial=0.0) <= NULLS[0]:
                suspects += np.isin(values, NULLS) * np.int16(2 if name in self.degrees else 1)
        if (suspects > 1).any():
            row = int(np.argmax(suspects > 1))
            name = next(name for name, values in numbers.items() if values[row] in NULLS)
            shown = f"{numbers[name][row]:.10g}"
            problem = f"column {name!r} is {shown}, by which many files say that there is nothing"
            raise FileError(f"{problem}; state --null {shown}, or correct it", path=self.path, line=int(lines[row]))


def _readings_of(
    names: Sequence[str], numeric: Callable[[str], bool], profile: Profile, path: Path, line: int
) -> list[Reading]:
    """What each column is; a name is only translated into one the file does not have itself."""
    found = []
    for name in names:
        try:
            reading = profile.reading(name, numeric)
        except InputError as error:
            raise FileError(str(error), path=path, line=line) from None
        stated = name in profile.columns or name.startswith("column ") or bool(profile.axes)
        found.append(reading if stated or reading.name not in names else Reading(name))
    return found


class ArrowNumbers:
    """Converts blocks of regular rows by Arrow, the same to the bit and many times faster."""

    def __init__(self, names: Sequence[str], wanted: Sequence[str], delimiter: str, texts: Sequence[str] = ()) -> None:
        import pyarrow as pa
        import pyarrow.csv as pc

        self._names, self._wanted, self._texts = list(names), wanted, texts
        self._parse = pc.ParseOptions(delimiter=delimiter)
        types = {**dict.fromkeys(wanted, pa.float64()), **dict.fromkeys(texts, pa.string())}
        empty = ("", "nan", "NaN", "NAN", "Nan")
        self._convert = pc.ConvertOptions(
            column_types=types, include_columns=[*wanted, *texts], null_values=list(empty)
        )

    def convert(self, text: str) -> tuple[dict[str, Array], dict[str, list[str]]] | None:
        """Numbers, NaN where empty, and texts; None where a row is not as the header says or a cell no number."""
        import pyarrow as pa
        import pyarrow.csv as pc

        data = text.encode()
        reading = pc.ReadOptions(column_names=self._names, use_threads=False, block_size=len(data) + 1)
        try:
            table: Any = pc.read_csv(pa.BufferReader(data), reading, self._parse, self._convert)
        except pa.ArrowInvalid:
            return None
        # copies: Arrow keeps the memory of what is read for itself
        numbers = {name: np.array(table.column(name).to_numpy(), dtype=np.float64) for name in self._wanted}
        return numbers, {name: table.column(name).to_pylist() for name in self._texts}


def _open_quote(lines: list[str], delimiter: str) -> int:
    """Index of the first line whose quoted cell stays open."""
    for index, line in enumerate(lines):
        try:
            list(csv.reader([line], delimiter=delimiter, skipinitialspace=True, strict=True))
        except csv.Error:
            return index
    return 0
