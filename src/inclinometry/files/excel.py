"""Survey tables as Excel workbooks: one row of names with units, one cell a value; a second sheet for the header."""

from __future__ import annotations

import datetime
import re
import warnings
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.digest import digest_file
from inclinometry.errors import FileError, InputError
from inclinometry.files._quantities import is_number
from inclinometry.files.exchange import Column, Sheet, SurveyFile, row_error, survey_of
from inclinometry.files.profile import PLAIN, current
from inclinometry.files.survey_csv import columns_of
from inclinometry.files.writing import number, replacing
from inclinometry.opening import opened

# The cells of one sheet of a workbook on their way to columns: what may stand where, refused with its row.


class Cells:
    """The columns of one sheet while its rows come in."""

    def __init__(self, path: Path, title: str, formulas: bool) -> None:
        self.path, self.title, self.formulas = path, title, formulas
        self.names: list[str] = []
        self.kinds: list[tuple[str, bool]] = []
        self.columns: list[list[Any]] = []
        self.rows: list[int] = []
        self.header_row = 0
        self.gaps: set[tuple[int, int]] = set()

    def error(self, problem: str, row: int | None) -> FileError:
        return row_error(self.path, problem, row, "row", f"sheet {self.title!r}")

    def add(self, index: int, row: tuple[Any, ...]) -> None:
        """One row: the names first, then values."""
        if not self.names:
            self._name(index, row)
            return
        width = len(self.names)
        if any(cell not in (None, "") for cell in row[width:]):
            raise self.error(f"a cell beyond the last named column ({self.names[-1]!r}); name it or empty it", index)
        for place, (name, numeric) in enumerate(self.kinds):
            cell = row[place] if place < len(row) else None
            if cell is None and self.formulas:
                self.gaps.add((index, place))
            self.columns[place].append(self._number(cell, name, index) if numeric else self.text(cell))
        self.rows.append(index)

    def _name(self, index: int, row: tuple[Any, ...]) -> None:
        names = list(row)
        while names and names[-1] in (None, ""):
            names.pop()
        for place, name in enumerate(names, 1):
            if name in (None, ""):
                raise self.error(f"column {place} has no name; merged cells? give each column one cell, name and unit",
                                 index)  # fmt: skip
            if not isinstance(name, str):
                raise self.error(f"{name!r} stands where a column's name should be; add a row of names", index)
        self.names = [" ".join(name.split()) for name in names]
        twice = next((name for name in self.names if self.names.count(name) > 1), None)
        if twice is not None:
            raise self.error(f"column {twice!r} appears twice; remove one", index)
        self.kinds = [(name, is_number(name)) for name in self.names]
        self.columns = [[] for _ in self.names]
        self.header_row = index

    def _number(self, cell: Any, name: str, index: int) -> float:
        if cell is None or (isinstance(cell, str) and not cell.strip()):
            return float("nan")
        if isinstance(cell, bool) or not isinstance(cell, int | float):
            kinds = {bool: "a yes or no", str: "text", datetime.time: "a time"}
            kind = kinds.get(type(cell), "a date")
            more = "" if self.rows else "; is this a second row of names? Write the unit into the first"
            raise self.error(f"{str(cell)!r} in column {name!r} is {kind}, not a number; correct it{more}", index)
        return float(cell)

    def text(self, cell: Any) -> str:
        """A cell as a text."""
        if cell is None:
            return ""
        if isinstance(cell, bool):
            return "1" if cell else "0"
        if isinstance(cell, int | float):
            return number(float(cell))
        return cell.isoformat() if hasattr(cell, "isoformat") else str(cell)

    def sheet(self, header: dict[str, str]) -> Sheet:
        """Everything read."""
        if not self.names:
            raise self.error("the sheet is empty; a row of names and rows of values are needed", None)
        if not self.rows:
            raise self.error("there are names of columns but no rows of values", self.header_row)
        columns: dict[str, Column] = {
            name: np.array(cells) if numeric else tuple(cells)
            for (name, numeric), cells in zip(self.kinds, self.columns, strict=True)
        }
        rows = np.array(self.rows)
        place = f"sheet {self.title!r}"
        return Sheet(
            self.path,
            columns,
            rows,
            word="row",
            place=place,
            header_row=self.header_row,
            header=header,
            digest=digest_file(self.path),
        )


SHEET, HEADER = "survey", "header"
ROWS: Final = 1_048_576
"""Rows of a sheet, by the format."""
_UNPACKED: Final = 4_000_000_000  # bytes; a workbook of a million stations unpacks to less than a quarter
LONGEST_TEXT: Final = 32_767
"""Characters of a cell, by the format."""
_FORMULA: Final = re.compile(rb"<(\w+:)?f[ />]")


def read_excel(
    path: str | Path, *, sheet: str | None = None, convention: str = "native", azimuth_reference: str | None = None
) -> SurveyFile:
    """Read a survey from one sheet of an .xlsx workbook; names of columns as `six_axis.read_csv` knows them.

    Parameters
    ----------
    path : str or Path
    sheet : str, optional
        Name of the sheet; the first one when not given.
    convention, azimuth_reference : str
        As in `six_axis.read_csv`.

    Raises
    ------
    FileError
        Not a workbook, an old or encrypted or damaged one; no such sheet, an empty one; more than one row of names or
        merged ones; text, a date or an error value where a number is needed, a formula that was never calculated;
        else as `six_axis.read_csv`. The message names the sheet and the row.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_excel(SurveyFile(md=[0, 30], tvd=[0, 29.5], header={"well": "A-1"}), Path(folder, "a.xlsx"))
    ...     survey = read_excel(Path(folder, "a.xlsx"))
    >>> survey.tvd, survey.header["well"]
    (array([ 0. , 29.5]), 'A-1')
    """
    if sheet is None and current() != PLAIN:
        from inclinometry.files.six_axis import read_csv

        return read_csv(path, convention=convention, azimuth_reference=azimuth_reference)
    where = Path(path)
    with _workbook(where, values=True) as book:
        titles = book.sheetnames
        if not titles:
            raise FileError("the workbook has no sheet", path=where)
        if sheet is None:
            title = titles[0]
        else:
            if sheet not in titles:
                raise FileError(f"there is no sheet {sheet!r}; there are: {', '.join(titles)}", path=where)
            title = sheet
        cells = Cells(where, title, _has_formulas(where))
        for index, row in _rows(book[title], cells):
            cells.add(index, row)
        # names and texts of the sheet `header`, if it is one of ours
        header: dict[str, str] = {}
        if HEADER in book.sheetnames and title != HEADER:
            rows = [tuple(row[:2]) for row in book[HEADER].iter_rows(values_only=True)]
            if rows and rows[0] == ("name", "text"):
                texts = [row for row in rows[1:] if len(row) == 2 and row[0]]
                header = {str(name): "" if text is None else str(text) for name, text in texts}
    if cells.gaps:
        # FileError for an empty cell that is a formula nobody has calculated
        with _workbook(cells.path, values=False) as book:
            for index, row in _rows(book[cells.title], cells):
                for place, cell in enumerate(row):
                    if isinstance(cell, str) and cell.startswith("=") and (index, place) in cells.gaps:
                        name = cells.names[place]
                        raise cells.error(
                            f"column {name!r} is a formula without a result; open it in Excel and save", index
                        )
    return survey_of(cells.sheet(header), convention=convention, azimuth_reference=azimuth_reference)


def sheet_cells(path: Path) -> tuple[list[str], Iterator[list[str]]]:
    """The first sheet of a workbook as texts: the names of its first row, and the rows below, empty ones too.

    Raises
    ------
    FileError
        No workbook, a damaged or a monstrous one; a formula that nobody has calculated.
    """
    rows = _sheet_rows(path)
    first = next(rows, None)
    if first is None:
        raise FileError("the first sheet is empty; a row of names and rows of values are needed", path=path)
    return first, rows


def _sheet_rows(path: Path) -> Iterator[list[str]]:
    _check(path)
    formulas = _has_formulas(path)
    with ExitStack() as stack:
        book = stack.enter_context(_workbook(path, values=True))
        cells = Cells(path, book.sheetnames[0], formulas)
        inside = _rows(stack.enter_context(_workbook(path, values=False))[cells.title], cells) if formulas else None
        last = 0
        for index, row in _rows(book[cells.title], cells):
            written = next(inside, (index, row))[1] if inside is not None else row
            for value, formula in zip(row, written, strict=False):
                if value is None and isinstance(formula, str) and formula.startswith("="):
                    raise cells.error("a formula without a result; open the workbook in Excel and save it", index)
            yield from ([] for _ in range(index - last - 1) if last)
            last = index
            # every digit: the reader of texts takes the number back as it was
            yield [repr(cell) if type(cell) in (int, float) else " ".join(cells.text(cell).split()) for cell in row]


@contextmanager
def _workbook(path: Path, *, values: bool) -> Iterator[Any]:
    """A workbook open for reading; whatever the library stumbles over in a damaged one is one error."""
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
        raise FileError(f"this workbook is damaged ({_first_line(error)}); save it again", path=path) from None
    finally:
        if book is not None:
            book.close()


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0][:200]


def _check(path: Path) -> None:
    """FileError for what is no workbook, before the library sees it."""
    old = b"\xd0\xcf\x11\xe0"
    try:
        with opened(path) as stream:
            start = stream.read(8)
            if start.startswith(old):
                raise FileError("an old .xls or an encrypted workbook; save it as .xlsx without a password", path=path)
            if not zipfile.is_zipfile(stream):
                raise FileError("not an .xlsx workbook, or a damaged one; save it again", path=path)
            with zipfile.ZipFile(stream) as archive:
                size = sum(entry.file_size for entry in archive.infolist())
                packed = sum(entry.compress_size for entry in archive.infolist())
    except FileError:
        raise
    except (OSError, ValueError, RuntimeError, zipfile.BadZipFile) as error:  # RuntimeError: a version of zip unknown
        raise FileError(f"cannot be read ({getattr(error, 'strerror', None) or error})", path=path) from None
    # blanks pack a thousand times; numbers hardly ten
    if size > _UNPACKED or (size > 200e6 and size > 60 * packed):
        raise FileError(f"this workbook unpacks to {size / 1e9:.1f} GB; split it, or use Parquet", path=path)


def _rows(sheet: Any, cells: Cells) -> Iterator[tuple[int, tuple[Any, ...]]]:
    """Rows that hold something, numbered from 1 as Excel does."""
    if not hasattr(sheet, "iter_rows") or not hasattr(sheet, "reset_dimensions"):
        raise cells.error("this is a chart, not a table; name another sheet", None)
    sheet.reset_dimensions()  # the size a writer stated may be wrong
    for index, row in enumerate(sheet.iter_rows(values_only=True), 1):
        if index > ROWS:
            raise cells.error(f"a row beyond the {ROWS:,} of a sheet; save the workbook again", None)
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
                            if _FORMULA.search(tail + piece):
                                return True
                            tail = piece[-16:]
    except (OSError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error) as error:
        raise FileError(f"damaged inside ({str(error)[:100]}); save the workbook again", path=path) from None
    return False


def write_excel(file: SurveyFile, path: str | Path) -> None:
    """Write a survey as .xlsx: sheet `survey` with the columns, sheet `header` with the texts of the file's head.

    Numbers are written as numbers. Texts are written as texts, also those that begin with = + - @ and would be a
    formula to a spreadsheet.

    Raises
    ------
    InputError
        More stations than a sheet has rows, control characters in a text, a text longer than a cell holds.

    Examples
    --------
    See `read_excel`.
    """
    from openpyxl import Workbook

    if len(file) >= ROWS:
        raise InputError(f"{len(file)} stations do not fit into a sheet of {ROWS} rows; use Parquet or CSV")
    columns = columns_of(file)
    book = Workbook(write_only=True)
    sheet = book.create_sheet(SHEET)
    sheet.freeze_panes = "B2"
    sheet.append([_safe(sheet, column.name) for column in columns])
    lists = [column.values if isinstance(column.values, tuple) else column.values.tolist() for column in columns]
    for row in zip(*lists, strict=True):
        sheet.append([_cell(sheet, value) for value in row])
    if file.header:
        notes = book.create_sheet(HEADER)
        notes.append(["name", "text"])
        for name, text in file.header.items():
            notes.append([_safe(notes, name), _safe(notes, text)])
    with replacing(path) as stream:
        book.save(stream)


def _cell(sheet: Any, value: float | str) -> Any:
    if isinstance(value, str):
        return _safe(sheet, value) if value else None
    return value if value == value else None


def _safe(sheet: Any, text: str) -> Any:
    """A cell of text that no spreadsheet takes for a formula or an error value, not even after it was edited."""
    from openpyxl.cell import WriteOnlyCell
    from openpyxl.cell.cell import ILLEGAL_CHARACTERS_RE

    if len(text) > LONGEST_TEXT:
        raise InputError(f"a text of {len(text)} characters does not fit into a cell; allowed {LONGEST_TEXT}")
    if ILLEGAL_CHARACTERS_RE.search(text):
        raise InputError(f"{text[:40]!r} has a control character, which a workbook cannot hold; remove it")
    dangerous = ("=", "+", "-", "@", "#", "\t", "\r")
    if not text.startswith(dangerous):
        return text
    cell = WriteOnlyCell(sheet, text)
    cell.data_type = "s"
    cell.quotePrefix = True
    return cell
