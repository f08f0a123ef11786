"""Survey tables as Excel workbooks: one row of names with units, one cell a value; a second sheet for the header."""

from __future__ import annotations

import io
import re
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import zip_longest
from pathlib import Path
from typing import Any, Final

from inclinometry.errors import FileError, InputError, in_file, not_among, refused, system_reason
from inclinometry.files.not_read import archive_not_read
from inclinometry.files.survey_file import SurveyFile, columns_of
from inclinometry.files.text import OLD_EXCEL, Block
from inclinometry.files.writing import replacing
from inclinometry.findings import Finding
from inclinometry.opening import damaged, opened, too_large, whole

SHEET, HEADER = "survey", "header"
ROWS: Final = 1_048_576
"""Rows of a sheet, by the format."""
BLOCK: Final = 1 << 15
"""Rows that are passed on at once."""
_UNPACKED: Final = 4_000_000_000  # bytes; a workbook of a million stations unpacks to less than a quarter
_LARGEST_OLD: Final = 100_000_000
LONGEST_TEXT: Final = 32_767
"""Characters of a cell, by the format."""


def sheet_blocks(path: Path, sheet: str | None = None) -> Iterator[Block]:
    """A sheet (the first by default) of a workbook, in blocks whose lines are the rows: cells as texts, numbers, flags.

    Rows that hold nothing are empty, so that the others keep their numbers. FileError for no workbook, a damaged or a
    monstrous one; no such sheet, an empty one; a formula that no one has calculated.
    """
    with ExitStack() as stack:
        book = stack.enter_context(_workbook(path, values=True))
        titles = book.sheetnames
        sheet = sheet if sheet is None or sheet in titles else sheet.rpartition("/")[0] or sheet  # of SHEET/WELL
        if not titles or sheet not in (None, *titles):
            choice = Finding("input-choice", {"name": "--sheet", "value": sheet or "-", "allowed": tuple(titles)})
            raise FileError(choice, path=path)
        title = sheet or titles[0]
        header = _header(book[HEADER]) if HEADER in titles and title != HEADER else {}
        rows, written = _rows(book[title], path), None
        if not _is_old(path) and _has_formulas(path):
            written = _rows(stack.enter_context(_workbook(path, values=False))[title], path)
        first, held = 1, list[list[Any]]()
        pairs = zip_longest(rows, written, fillvalue=(0, ())) if written else ((row, row) for row in rows)
        for (index, row), (at, cells) in pairs:
            # a row of formulas alone is none of values
            if index != at or any(v is None and str(cell)[:1] == "=" for v, cell in zip(row, cells, strict=False)):
                raise FileError(Finding("table-formula"), path=path, row=at)
            if len(held) >= BLOCK:
                yield Block(first, held, header)
                first, held = first + len(held), []
            held += [[]] * (index - first - len(held))
            held.append([cell if type(cell) in (int, float, bool) else _text(cell) for cell in row])
        if not held:
            raise FileError(Finding("file-empty", {"what": "rows"}), path=path)
        numbers = first > 1 or any(type(cell) in (int, float) for row in held for cell in row)
        if sheet is None and not numbers and len(set(titles) - {HEADER}) > 1:
            # a cover; which of the others is meant is not known
            choice = Finding("input-choice", {"name": "--sheet", "value": titles[0], "allowed": tuple(titles[1:])})
            raise FileError(choice, path=path)
        yield Block(first, held, header)


def _header(sheet: Any) -> dict[str, str]:
    """Names and texts of the sheet `header`, if it is one of ours."""
    rows = [tuple(row[:2]) for row in sheet.iter_rows(values_only=True)]
    if not rows or rows[0] != ("name", "text"):
        return {}
    return {str(row[0]): "" if row[1] is None else str(row[1]) for row in rows[1:] if len(row) == 2 and row[0]}


def _text(cell: Any) -> str:
    """What is no number, on one line."""
    if cell is None:
        return ""
    return " ".join((cell.isoformat() if hasattr(cell, "isoformat") else str(cell)).split())


@contextmanager
def _workbook(path: Path, *, values: bool) -> Iterator[Any]:
    """A workbook open for reading; whatever the library stumbles over in a damaged one is one error."""
    if _is_old(path):
        yield _old_workbook(path)
        return
    _check(path)
    import openpyxl

    book = None
    try:
        # by its content: of a path the library looks at the ending
        with path.open("rb") as stream, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and extensions, which are not read
            book = openpyxl.load_workbook(stream, read_only=True, data_only=values, keep_links=False)
            yield book
    except (InputError, MemoryError):
        raise
    except Exception as error:  # zip, XML, key, value errors: any of them means the same to a user
        raise FileError(damaged(".xlsx", error), path=path) from None
    finally:
        if book is not None:
            book.close()


def _is_old(path: Path) -> bool:
    with opened(path) as stream:
        return stream.read(4) == OLD_EXCEL


class _OldSheet:
    """A sheet of an .xls as openpyxl has one."""

    def __init__(self, sheet: Any, datemode: int) -> None:
        self._sheet, self._datemode = sheet, datemode

    def reset_dimensions(self) -> None:
        """Its size is right."""

    def iter_rows(self, *, values_only: bool) -> Iterator[tuple[Any, ...]]:
        """Values of each row."""
        return (tuple(map(self._value, self._sheet.row(k))) for k in range(self._sheet.nrows) if values_only)

    def _value(self, cell: Any) -> Any:
        import xlrd

        kinds: dict[int, Callable[[Any], Any]] = {
            xlrd.XL_CELL_DATE: lambda value: xlrd.xldate_as_datetime(value, self._datemode),
            xlrd.XL_CELL_BOOLEAN: bool,
            xlrd.XL_CELL_ERROR: lambda value: xlrd.error_text_from_code.get(value, "#ERROR"),
        }
        return kinds[cell.ctype](cell.value) if cell.ctype in kinds else cell.value


class _OldBook(dict[str, _OldSheet]):
    """The sheets of an .xls by their names."""

    @property
    def sheetnames(self) -> list[str]:
        """In the order of the workbook."""
        return list(self)


def _old_workbook(path: Path) -> _OldBook:
    import xlrd

    try:
        book = xlrd.open_workbook(file_contents=whole(path, _LARGEST_OLD), logfile=io.StringIO())
        return _OldBook({sheet.name: _OldSheet(sheet, book.datemode) for sheet in book.sheets()})
    except (InputError, MemoryError):
        raise
    except Exception:  # with a password, damaged, or a document of another program
        kind = Finding("file-kind", {"format": ".xls / encrypted .xlsx", "wanted": (".xlsx", ".csv")})
        raise FileError(kind, path=path) from None


def _check(path: Path) -> None:
    """FileError for what is no workbook, before the library sees it."""
    try:
        with opened(path) as stream:
            if not zipfile.is_zipfile(stream):
                raise FileError(damaged(".xlsx", "no zip archive"), path=path)
            with zipfile.ZipFile(stream) as archive:
                members = archive.namelist()
                if not any(name.startswith("xl/") for name in members):
                    raise FileError(archive_not_read(members), path=path)
                size = sum(entry.file_size for entry in archive.infolist())
                packed = sum(entry.compress_size for entry in archive.infolist())
    except FileError:
        raise
    except (OSError, ValueError, RuntimeError, zipfile.BadZipFile) as error:  # RuntimeError: a version of zip unknown
        reason = system_reason(error)
        raise FileError(Finding("file-unreadable", {"reason": reason}), path=path) from None
    # blanks pack a thousand times; numbers hardly ten
    if size > _UNPACKED or (size > 200e6 and size > 60 * packed):
        raise FileError(too_large("bytes", size, _UNPACKED), path=path)


def _rows(sheet: Any, path: Path) -> Iterator[tuple[int, tuple[Any, ...]]]:
    """Rows that hold something, numbered from 1 as Excel does."""
    if not hasattr(sheet, "iter_rows") or not hasattr(sheet, "reset_dimensions"):
        raise in_file(not_among("--sheet", sheet.title, [one.title for one in sheet.parent.worksheets]), path)
    sheet.reset_dimensions()  # the size a writer stated may be wrong
    for index, row in enumerate(sheet.iter_rows(values_only=True), 1):
        if index > ROWS:
            raise FileError(too_large("rows", index, ROWS), path=path)
        if any(cell is not None and cell != "" for cell in row):
            yield index, row


def _has_formulas(path: Path) -> bool:
    """Whether any sheet holds a formula; most workbooks of measurements do not, and need not be read twice."""
    try:
        with zipfile.ZipFile(path) as archive:
            for entry in archive.namelist():
                if entry.startswith("xl/worksheets/") and entry.endswith(".xml"):
                    with archive.open(entry) as stream:
                        tail = b""
                        while piece := stream.read(1 << 20):
                            if re.search(rb"<(\w+:)?f[ />]", tail + piece):
                                return True
                            tail = piece[-16:]
    except (OSError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error) as error:
        raise FileError(damaged(".xlsx", error), path=path) from None
    return False


def write_excel(file: SurveyFile, path: str | Path) -> None:
    """Write a survey as .xlsx: sheet `survey` with the columns, sheet `header` with the texts of the file's head.

    Texts that begin with = + - @ and would be a formula to a spreadsheet are written as texts.
    """
    from openpyxl import Workbook

    if len(file) >= ROWS:
        raise InputError(too_large("rows", len(file) + 1, ROWS))
    columns = columns_of(file)
    book = Workbook(write_only=True)
    sheet = book.create_sheet(SHEET)
    sheet.freeze_panes = "B2"
    sheet.append([_safe(sheet, name) for name in columns])
    lists = [values if isinstance(values, tuple) else values.tolist() for values in columns.values()]
    for row in zip(*lists, strict=True):
        sheet.append([_safe(sheet, v) if v and isinstance(v, str) else v if v == v and v != "" else None for v in row])
    if file.header:
        notes = book.create_sheet(HEADER)
        notes.append(["name", "text"])
        for name, text in file.header.items():
            notes.append([_safe(notes, name), _safe(notes, text)])
    with replacing(path) as stream:
        book.save(stream)


def _safe(sheet: Any, text: str) -> Any:
    """A cell of text that no spreadsheet takes for a formula or an error value, not even after it was edited."""
    from openpyxl.cell import WriteOnlyCell
    from openpyxl.cell.cell import ILLEGAL_CHARACTERS_RE

    if len(text) > LONGEST_TEXT:
        raise InputError(too_large("characters of a cell", len(text), LONGEST_TEXT))
    if ILLEGAL_CHARACTERS_RE.search(text):
        raise refused("file-characters", {"format": ".xlsx", "text": text[:40]})
    dangerous = ("=", "+", "-", "@", "#", "\t", "\r")
    if not text.startswith(dangerous):
        return text
    cell = WriteOnlyCell(sheet, text)
    cell.data_type = "s"
    cell.quotePrefix = True
    return cell
