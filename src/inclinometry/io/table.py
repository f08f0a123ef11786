"""The one path by which a CSV file is read: usual dialects in, exact columns out, or an error that names the place."""

from __future__ import annotations

import codecs
import csv
import hashlib
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inclinometry.core.arrays import Array
from inclinometry.core.errors import FileError
from inclinometry.io.columns import KNOWN, advice, channel, channel_advice, closest, is_number

# Numbers as people write them: one strict rule for points, commas, blanks and text.

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_WITH_COMMA = re.compile(r"[+-]?(\d+,\d*|,\d+)([eE][+-]?\d+)?", re.ASCII)
# 12,345 may be twelve thousand or twelve and a bit; 0,345 or 1,5 can only be a decimal comma
_PERHAPS_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}", re.ASCII)


class NumberReader:
    """Converts columns of text, block by block, and remembers which decimal mark the file uses."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._comma: tuple[int, str, str] | None = None  # line, column, text of the first number with a comma
        self._point: tuple[int, str, str] | None = None
        self._proved = False

    def convert(self, cells: Sequence[str], name: str, lines: Sequence[int], *, gaps: bool, plain: bool) -> Array:
        """Float64 of one column's cells; an empty cell is NaN where `gaps` are allowed, else FileError."""
        values = self._fast(cells) if plain else None
        if values is None:
            values = self._careful(cells, name, lines, gaps)
        elif self._point is None and "." in "".join(cells):
            row = next(i for i, cell in enumerate(cells) if "." in cell)
            self._point = (int(lines[row]), name, cells[row].strip())
        good = np.isfinite(values)
        if not good.all():
            for row in np.flatnonzero(~good).tolist():
                if not (gaps and not cells[row].strip()):
                    raise self._refuse(cells[row].strip(), name, int(lines[row]))
        return values

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

    def _careful(self, cells: Sequence[str], name: str, lines: Sequence[int], gaps: bool) -> Array:
        values = np.full(len(cells), np.nan)
        for row, cell in enumerate(cells):
            text = cell.strip()
            if _NUMBER.fullmatch(text):
                values[row] = float(text)
                if self._point is None and "." in text:
                    self._point = (int(lines[row]), name, text)
            elif _WITH_COMMA.fullmatch(text):
                values[row] = float(text.replace(",", "."))
                self._comma = self._comma or (int(lines[row]), name, text)
                self._proved = self._proved or not _PERHAPS_THOUSANDS.fullmatch(text)
            elif text or not gaps:
                raise self._refuse(text, name, int(lines[row]))
        return values

    def _refuse(self, text: str, name: str, line: int) -> FileError:
        shown = text if len(text) <= 40 else text[:37] + "..."
        if not text:
            problem = f"column {name!r} is empty; fill it in or remove the row"
        elif text.lower().lstrip("+-") in ("nan", "inf", "infinity") or _NUMBER.fullmatch(text):
            problem = f"column {name!r} is {shown}; every value must be finite: correct it or remove the row"
        elif "," in text and not set(text) - set("+-0123456789.,"):
            problem = f"{shown!r} in column {name!r} has a thousands separator; write digits and one decimal point"
        else:
            problem = f"{shown!r} in column {name!r} is not a number; correct it or remove the row"
        return FileError(problem, path=self._path, line=line)


# From the bytes of a text file to blocks of lines: encoding, line ends, digest, progress; bounded memory.

CHUNK = 1 << 20
LONGEST_LINE = 1 << 20
Progress = Callable[[int], None]

_MAGIC = {
    b"PK\x03\x04": "a zip archive (an Excel workbook?); save it as CSV",
    b"\x1f\x8b": "compressed with gzip; unpack it first",
    b"%PDF": "a PDF document; a CSV text is needed",
    b"\x89HDF": "an HDF5 file; a CSV text is needed",
    b"PAR1": "a Parquet file; a CSV text is needed",
}


class Block(NamedTuple):
    """Consecutive lines without their ends; `plain` when ASCII without an underscore, so that float() is strict."""

    first: int
    lines: list[str]
    plain: bool


@dataclass
class LineReader:
    """Reads a file once; `digest` is complete when `blocks` is exhausted."""

    path: Path
    progress: Progress | None = None
    _hash: hashlib._Hash = field(default_factory=hashlib.sha256)

    @property
    def digest(self) -> str:
        """Digest of the bytes read so far, as `core.digest.digest_file` gives for the whole file."""
        return "sha256:" + self._hash.hexdigest()

    def blocks(self) -> Iterator[Block]:
        """Blocks of about one megabyte; FileError for what is not text."""
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
                while chunk := stream.read(CHUNK):
                    self._hash.update(chunk)
                    yield chunk
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
    return "utf-8-sig"


def _not_text(error: UnicodeDecodeError, chunk: bytes, line: int, path: Path) -> FileError:
    """The error's position refers to the decoder's buffer, which may begin with bytes kept from the chunk before."""
    piece = bytes(error.object)
    line += piece[: error.start].count(b"\n")
    value = f"byte 0x{piece[error.start]:02x}" if piece else "its end"
    return FileError(f"not {error.encoding} text ({value}, {error.reason}); save it as UTF-8", path=path, line=line)


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
