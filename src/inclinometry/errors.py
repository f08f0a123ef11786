"""The few errors of the package; each is a child of the builtin a caller expects.

A message gives the value found, the range allowed and the remedy; a file's error also names file and line.
"""

from __future__ import annotations

import re
from pathlib import Path

_LONG = re.compile(r"((?<!\w)'[^'\n]{60})[^'\n]{60,}'(?!\w)")  # a value in quotes


class InclinometryError(Exception):
    """Everything this package raises on purpose."""


class InputError(InclinometryError, ValueError):
    """A value that cannot be used: wrong shape, not finite, out of range, contradictory."""


class FileError(InputError):
    """A file that cannot be used; the message names the file and, where there is one, the line, or row of an array.

    Examples
    --------
    >>> str(FileError("no column 'accel_y'; add it", path="bench.csv", line=1))
    "bench.csv, line 1: no column 'accel_y'; add it"

    A value longer than anybody wants to read is cut:

    >>> str(FileError(f"{9000 * '2.6'!r} is not a number", path="a.las"))
    "a.las: '2.62.62.62.62.62.62.62.62.62.62.62.62.62.62.62.62.62.62.62.6…' is not a number"
    """

    def __init__(self, problem: str, *, path: str | Path, line: int | None = None, row: int | None = None) -> None:
        where = f"{path}" + (f", line {line}" if line is not None else f", row {row}" if row is not None else "")
        problem = _LONG.sub(r"\1…'", problem)  # a damaged file has values of thousands of characters
        super().__init__(f"{where}: {problem}")
        self.path, self.line, self.problem = Path(path), line, problem

    def of_rows(self) -> FileError:
        """The same of a file that has rows and no lines: its names are no line."""
        return FileError(self.problem, path=self.path, row=self.line or None)


class IdentifiabilityError(InclinometryError, ValueError):
    """The readings cannot determine what was asked; the message says which direction and the cure."""


class ConvergenceError(InclinometryError, ArithmeticError):
    """An iteration did not settle; nothing half-fitted is returned."""
