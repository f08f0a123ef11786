"""The cells of one sheet of a workbook on their way to columns: what may stand where, refused with its row."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Any

import numpy as np

from inclinometry.core.digest import digest_file
from inclinometry.core.errors import FileError
from inclinometry.io._quantities import is_number
from inclinometry.io._sheet import Column, Sheet, row_error
from inclinometry.io._write import number


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
            self.columns[place].append(self._number(cell, name, index) if numeric else self._text(cell))
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

    def _text(self, cell: Any) -> str:
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
