"""Numbers as people write them: one strict rule for points, commas, blanks and text."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.core.errors import FileError

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
