"""A run as CSV: plain blocks of numbers are converted by Arrow, everything else line by line, as any other table."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.core.errors import FileError
from inclinometry.io._lines import Block, LineReader, Progress
from inclinometry.io._run_columns import RunCheck, RunHeader, run_header
from inclinometry.io.table import _Body, _header_row

_EMPTY = ("", "nan", "NaN", "NAN", "Nan")


class CsvRun:
    """A CSV file from its header on; see `run_file.Source`."""

    def __init__(self, path: Path, progress: Progress | None) -> None:
        self._reader = LineReader(path, progress)
        self._blocks = self._reader.blocks()
        self._body, self._first = self._opened(path)
        names = self._body.names
        self.header: RunHeader = run_header(path, names, self._body.line)
        wanted = set(self.header.wanted)
        # columns that are not used may hold anything
        self._body.kinds = [(name, name in wanted, name in wanted) for name in names]
        self._body.parts = {name: [] for name in names if name in wanted}
        self._body.texts = {name: [] for name in names if name not in wanted}
        mark = re.escape(self._body.delimiter)
        self._nan = re.compile(rf"(^|{mark})[ \t]*[+-]?nan[ \t]*(?={mark}|$)", re.IGNORECASE)
        self._pointed = False
        self._check = RunCheck()
        self._arrow = _ArrowNumbers(names, self.header.wanted, self._body.delimiter)

    def _opened(self, path: Path) -> tuple[_Body, Block | None]:
        """The header, and what stands behind it in the same block."""
        for block in self._blocks:
            start = _header_row(block)
            if start is not None:
                body = _Body(path, block.lines[start], block.first + start, lambda _: True, ())
                return body, Block(block.first + start + 1, block.lines[start + 1 :], block.plain)
        raise FileError("the file is empty; a line of column names and rows of values are needed", path=path)

    def digest(self) -> str:
        """SHA-256 of what has been read: of the whole file once `columns` is exhausted."""
        return self._reader.digest

    def columns(self) -> Iterator[dict[str, Array]]:
        """Blocks of about a megabyte."""
        first, self._first = self._first, None
        if first is not None and first.lines:
            # the first block goes the careful way, which learns the decimal mark
            yield from self._careful(first)
        for block in self._blocks:
            quick = self._quick(block)
            if quick is None or self._check.problem(quick) is not None:
                yield from self._careful(block)
            elif len(quick["time_s"]):
                self._check.accept(quick)
                yield quick
        self._body.numbers.finish()

    def _quick(self, block: Block) -> dict[str, Array] | None:
        """Columns by Arrow; None where a block holds more than numbers with points, or the first points of the file."""
        text = "\n".join(block.lines)
        if not block.plain or "#" in text or (self._body.delimiter != "," and "," in text):
            return None
        if not self._pointed and "." in text:
            return None  # the careful way notes where the first point stands
        return self._arrow.convert(text)

    def _careful(self, block: Block) -> Iterator[dict[str, Array]]:
        lines = block.lines
        if any("nan" in line.lower() for line in lines):
            # twice: neighbours share the mark between them
            lines = [self._nan.sub(r"\1", self._nan.sub(r"\1", line)) for line in lines]
        self._pointed = self._pointed or any("." in line for line in lines)
        body = self._body
        body.add(Block(block.first, lines, block.plain))
        if not body.lines:
            return
        places = body.lines.pop()
        for cells in body.texts.values():
            cells.clear()
        columns = {name: body.parts[name].pop() for name in self.header.wanted}
        problem = self._check.problem(columns)
        if problem is not None:
            raise FileError(problem.text, path=body.path, line=int(places[problem.row]))
        self._check.accept(columns)
        yield columns


class _ArrowNumbers:
    """Converts blocks of regular rows."""

    def __init__(self, names: tuple[str, ...], wanted: tuple[str, ...], delimiter: str) -> None:
        import pyarrow as pa
        import pyarrow.csv as pc

        self._names, self._wanted = list(names), wanted
        self._parse = pc.ParseOptions(delimiter=delimiter)
        self._convert = pc.ConvertOptions(
            column_types=dict.fromkeys(wanted, pa.float64()), include_columns=list(wanted), null_values=list(_EMPTY)
        )

    def convert(self, text: str) -> dict[str, Array] | None:
        """Column -> values, NaN where empty; None where a row is not as the header says or a cell no number."""
        import pyarrow as pa
        import pyarrow.csv as pc

        data = text.encode()
        reading = pc.ReadOptions(column_names=self._names, use_threads=False, block_size=len(data) + 1)
        try:
            table: Any = pc.read_csv(pa.BufferReader(data), reading, self._parse, self._convert)
        except pa.ArrowInvalid:
            return None
        return {name: np.asarray(table.column(name).to_numpy(), dtype=np.float64) for name in self._wanted}
