"""A table in memory: the columns of a file by name, and where each row stands in it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import compress
from pathlib import Path
from types import MappingProxyType
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inclinometry.arrays import Array, Mask, frozen
from inclinometry.constants import FOOT
from inclinometry.errors import FileError
from inclinometry.files._quantities import columns_called
from inclinometry.files.columns import KNOWN, advice, channel, channel_advice, closest
from inclinometry.findings import Finding

Column: TypeAlias = Array | tuple[str, ...]
"""Numbers, NaN where empty, or texts."""


@dataclass(frozen=True, eq=False)
class Frame:
    """What the table of a file holds.

    columns : name -> (n,) numbers or texts, in the file's order. bare : names without the unit that the file states
    apart from them. lines : (n,) number of each row in the file, from 1; `word` is what the file counts: line or row.
    header_line : line of the names, where there is one. north : of the azimuths, where the head of the file says it.
    header : texts of that head. digest : SHA-256.
    """

    path: Path
    columns: Mapping[str, Column]
    lines: NDArray[np.int64]
    header_line: int | None = None
    bare: Mapping[str, str] = field(default_factory=dict)
    word: str = "line"
    north: str | None = None
    header: Mapping[str, str] = field(default_factory=dict)
    digest: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Of the columns, in the file's order."""
        return tuple(self.columns)

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

    def within(self, name: str, low: float, high: float, unit: str = "", remedy: str = "") -> Array:
        """A column of numbers from `low` to `high`; FileError for the first that is not, NaN let through."""
        values = self.number(name)
        bad = (values < low) | (values > high)
        if bad.any():
            row = int(np.argmax(bad))
            raise self.error(f"{name} is {values[row]:g}; allowed {low:g} to {high:g}{unit}{remedy}", row)
        return values

    def depth(self) -> tuple[str, Array]:
        """Name and metres of the column md_m or md_ft; FileError for both or neither."""
        if "md_m" in self and "md_ft" in self:
            raise self.error("both 'md_m' and 'md_ft' give the depth; remove one")
        name = "md_ft" if "md_ft" in self else "md_m"
        return name, frozen(self.number(name) * FOOT) if name == "md_ft" else self.number(name)

    def text(self, name: str) -> tuple[str, ...]:
        """A column of text; FileError when it is not there."""
        self.require([name])
        column = self.columns[name]
        return column if isinstance(column, tuple) else tuple(map(repr, column.tolist()))

    def rows(self, kept: Mask) -> Frame:
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
                hints = [(found, advice(found, [name])) for found in self.columns]
                hint = next((f" ({found!r}: {text})" for found, text in hints if text), "")
                bare = next((found for found in self.columns if name in columns_called(found)), None)
                if not hint and bare is not None:
                    hint = f" ({bare!r} has no unit: state --units, or write {name})"
                if not hint and (near := closest(name, [n for n in self.columns if n not in KNOWN and not channel(n)])):
                    hint = f" (is it {near!r}? then rename it)"
                raise self.error(f"column {name!r} is missing{hint}; columns found: {self.shown}")

    @property
    def shown(self) -> str:
        """The names of the columns for a message."""
        return ", ".join(self.names[:20]) + (", ..." if len(self.names) > 20 else "")

    def unknown(self, known: Collection[str]) -> list[str]:
        """A note on each column neither known nor a channel; FileError for one that is nearly one or lacks its unit."""
        found = [n for n in self.columns if n not in known and channel(n) is None]
        lacking = [name for name in known if name not in self.columns]
        for name in found:
            if hint := advice(name, lacking) or channel_advice(name):
                raise self.error(f"column {name!r} is not known; {hint}")
        return [f"column {name!r} is not known and was not used" for name in found]

    def error(self, problem: Finding | str, row: int | None = None) -> FileError:
        """An error about one row, or about the names."""
        number = self.header_line if row is None else int(self.lines[row])
        return row_error(self.path, problem, number, self.word)


def row_error(path: str | Path, problem: Finding | str, row: int | None, word: str = "row") -> FileError:
    """A FileError that counts rows where the file has no lines."""
    return FileError(problem, path=path, line=row) if word == "line" else FileError(problem, path=path, row=row)
