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

from inclinometry.arrays import Array, Mask, bottom_up, frozen
from inclinometry.constants import FOOT
from inclinometry.errors import FileError, wrong_kind
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
    header : texts of that head. digest : SHA-256. findings : of what was left out or put right.
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
    findings: tuple[Finding, ...] = ()

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
            raise self.error(wrong_kind(name, column[0] if column else "", "number").finding)
        return column

    def within(self, name: str, low: float, high: float) -> Array:
        """A column of numbers from `low` to `high`; FileError for the first that is not, NaN let through."""
        values = self.number(name)
        bad = (values < low) | (values > high)
        if bad.any():
            row = int(np.argmax(bad))
            allowed = f"{low:g} .. {high:g}"
            value = float(values[row])
            raise self.error(Finding("input-value", {"name": name, "value": value, "allowed": allowed}), row)
        return values

    def depth(self) -> tuple[str, Array]:
        """Name and metres of the column md_m or md_ft; FileError for both or neither."""
        if "md_m" in self and "md_ft" in self:
            raise self.error(Finding("table-same", {"columns": ("md_m", "md_ft")}))
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

    def downwards(self, depth: str | None) -> Frame:
        """The same table from the top down, where its depths fall from each row to the next."""
        md = self.columns.get(depth or "", ())
        if isinstance(md, tuple) or not bottom_up(md):
            return self
        turned = {n: c[::-1] if isinstance(c, tuple) else frozen(c[::-1].copy()) for n, c in self.columns.items()}
        found = (*self.findings, Finding("survey-bottom-up", severity="note"))
        return replace(self, columns=MappingProxyType(turned), lines=self.lines[::-1], findings=found)

    def require(self, names: Iterable[str]) -> None:
        """FileError for the first of `names` that is missing, with the likely remedy."""
        for name in names:
            if name not in self.columns:
                hint = next(filter(None, (advice(found, [name]) for found in self.columns)), None)
                bare = next((found for found in self.columns if name in columns_called(found)), None)
                if hint is None and bare is not None:
                    hint = Finding("table-unit-missing", {"name": bare, "right": (name,)})
                others = [n for n in self.columns if n not in KNOWN and not channel(n)]
                if hint is None and (near := closest(name, others)):
                    hint = Finding("table-near", {"name": near, "right": name})
                raise self.error(hint or self.lacking(name))

    def lacking(self, *names: str) -> Finding:
        """Columns that are missing, and those that are there."""
        return Finding("file-column", {"columns": names, "present": self.names[:20]})

    def unknown(self, known: Collection[str]) -> tuple[Finding, ...]:
        """Columns neither known nor channels, as a note; FileError for one that is nearly one or lacks its unit."""
        found = [n for n in self.columns if n not in known and channel(n) is None]
        lacking = [name for name in known if name not in self.columns]
        for name in found:
            if hint := advice(name, lacking) or channel_advice(name):
                raise self.error(hint)
        return unused(found)

    def error(self, finding: Finding, row: int | None = None) -> FileError:
        """An error about one row, or about the names."""
        number = self.header_line if row is None else int(self.lines[row])
        return row_error(self.path, finding, number, self.word)


def unused(names: Iterable[str]) -> tuple[Finding, ...]:
    """A note on columns that are not read, where there are any."""
    names = tuple(names)
    return (Finding("table-unused", {"names": names}, severity="note"),) if names else ()


def row_error(path: str | Path, finding: Finding, row: int | None, word: str = "row") -> FileError:
    """A FileError that counts rows where the file has no lines."""
    return FileError(finding, path=path, line=row) if word == "line" else FileError(finding, path=path, row=row)
