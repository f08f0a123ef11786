"""The ~ASCII section of a LAS file: every row checked for its length and its numbers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from inclinometry.core.arrays import Array
from inclinometry.core.errors import FileError, InputError
from inclinometry.io._quantities import meaning
from inclinometry.io._sheet import Column
from inclinometry.io._write import number

_BLOCK = 1 << 16
Numbered = Iterator[tuple[int, str]]


def split_at_data(path: str | Path, text: str) -> tuple[str, Sequence[str], int]:
    """The head of a LAS file, the lines of its data, and the number of the first of these.

    Raises
    ------
    FileError
        No section at all, no ~A section.
    """
    lines = text.splitlines()
    start = next((i for i, line in enumerate(lines) if line.lstrip()[:2].upper() == "~A"), None)
    if not any(line.lstrip().startswith("~") for line in lines):
        raise FileError("not a LAS file: no section begins with ~", path=path)
    if start is None:
        raise FileError("no ~ASCII section with data; is the file truncated?", path=path, line=len(lines))
    return "\n".join(lines[:start]) + "\n", lines[start + 1 :], start + 2


def numbered(lines: Iterable[str], first: int) -> Numbered:
    """Lines that are neither blank nor comments, with their numbers."""
    for line_number, line in enumerate(lines, first):
        if line.strip() and not line.lstrip().startswith("#"):
            yield line_number, line


def read_data(
    path: Path, lines: Numbered, names: Sequence[str], units: Mapping[str, str], null: float, wrap: bool
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
    for block in _blocks(_unwrapped(path, lines, len(names)) if wrap else _rows(path, lines, len(names))):
        rows = [row for row, _ in block]
        places += rows
        for index, cells in enumerate(zip(*(cells for _, cells in block), strict=True)):
            if numeric[index]:
                numbers[index].append(_floats(path, cells, names[index], rows, null))
            else:
                texts[index] += [_text(cell, null) for cell in cells]
    if not places:
        raise FileError("there are no data after ~ASCII; is the file truncated?", path=path)
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


def _rows(path: Path, lines: Numbered, width: int) -> Iterator[tuple[int, list[str]]]:
    for place, line in lines:
        cells = line.split()
        if len(cells) != width:
            problem = f"this row has {len(cells)} values, there are {width} curves; is the file truncated?"
            raise FileError(problem, path=path, line=place)
        yield place, cells


def _unwrapped(path: Path, lines: Numbered, width: int) -> Iterator[tuple[int, list[str]]]:
    """Rows of a wrapped file: the depth on a line of its own, then the others on as many lines as they take."""
    row: list[str] = []
    start = place = 0
    for place, line in lines:
        start = start if row else place
        row += line.split()
        if len(row) > width:
            problem = f"the row that begins in line {start} has {len(row)} values, there are {width} curves"
            raise FileError(problem, path=path, line=place)
        if len(row) == width:
            yield start, row
            row = []
    if row:
        problem = f"the last row has {len(row)} values, there are {width} curves; is the file truncated?"
        raise FileError(problem, path=path, line=place)


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
        problem = f"{cells[at]!r} of curve {name!r} is not a finite number; correct it, or write {number(null)}"
        raise FileError(problem, path=path, line=int(rows[at]))
    return np.where(values == null, np.nan, values)


def _float(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float("nan")


def _text(cell: str, null: float) -> str:
    return "" if _float(cell) == null else cell
