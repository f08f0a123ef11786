"""Numbers and tables as text: the shortest decimal that reads back the same, and files written whole."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array
from inclinometry.core.errors import InputError
from inclinometry.io.atomic import replacing


def number(value: float) -> str:
    """Shortest text that reads back to the same float64; empty for NaN.

    Examples
    --------
    >>> number(90.0), number(0.1), number(float("nan"))
    ('90', '0.1', '')
    """
    if value != value:
        return ""
    text = repr(float(value))
    return text.removesuffix(".0")


def degrees(angle: ArrayLike) -> Array:
    """Radians to degrees rounded to 1e-10, so that 120 does not print as 119.99999999999999."""
    # adding zero turns -0.0 into 0.0
    return np.asarray(np.round(np.degrees(np.asarray(angle, dtype=np.float64)), 10) + 0.0)


def column(values: Array) -> list[str]:
    """One column of numbers as text."""
    return list(map(number, values.tolist()))


def write_columns(names: Sequence[str], columns: Sequence[Iterable[str]], path: str | Path) -> None:
    """Write a table of text columns of one length as comma-separated UTF-8, whole or not at all.

    Everything is quoted when a first cell begins with `#`, which would be a comment unquoted. A line break inside a
    cell is an InputError, as the reader takes one line for one row.
    """
    cells = [list(column) for column in columns]
    if any("\n" in cell or "\r" in cell for column in cells for cell in column):
        raise InputError("a text for a table has a line break; write it on one line")
    ambiguous = any(cell.startswith("#") for cell in cells[0])
    with replacing(path) as stream:
        text = io.TextIOWrapper(stream, encoding="utf-8", newline="", write_through=False)
        try:
            writer = csv.writer(text, lineterminator="\n", quoting=csv.QUOTE_ALL if ambiguous else csv.QUOTE_MINIMAL)
            writer.writerow(names)
            writer.writerows(zip(*cells, strict=True))
        finally:
            text.detach()
