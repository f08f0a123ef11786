"""What commands print: tables for people, JSON for machines, progress where it lasts."""

from __future__ import annotations

import json
import logging
import os
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from importlib import import_module
from pathlib import Path
from textwrap import fill
from time import perf_counter
from typing import Any, Final, TextIO

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from inclinometry.cli.extras import need_for
from inclinometry.errors import FileError, InputError, in_file, system_reason
from inclinometry.findings import Finding

# no markup: names of files, tools and stations are printed as they are, brackets and colons included
console = Console(
    highlight=False,
    markup=False,
    emoji=False,
    soft_wrap=True,
    width=max(shutil.get_terminal_size().columns, 110),  # what the widest table needs: lines wrap rather than cells
)
"""Standard output for people."""


_aliases: dict[str, str] = {}
"""Path of a temporary copy -> what a person knows it by."""


@contextmanager
def path_alias(path: Path, name: str) -> Iterator[None]:
    """Whatever is said of a file within, it is called so."""
    _aliases[str(path)] = name
    try:
        yield
    except FileError as error:
        if error.path != path:
            raise
        raise in_file(error, name) from error
    finally:
        del _aliases[str(path)]


def named(text: str) -> str:
    """A text with every file under the name a person knows it by."""
    for path, name in _aliases.items():
        text = text.replace(path, name)
    return text


def print_line(text: str = "") -> None:
    """A line on standard output; on a terminal broken between words."""
    console.print(wrapped(named(text), sys.stdout))


def wrapped(text: str, stream: TextIO) -> str:
    """Prose as wide as a terminal is; for files and pipes a line stays whole."""
    if not stream.isatty():
        return text
    wide = shutil.get_terminal_size().columns
    lines = (fill(line, wide, break_long_words=False, break_on_hyphens=False) for line in text.split("\n"))
    return "\n".join(lines)


def counted(number: int, what: str) -> str:
    """A number with its noun.

    Examples
    --------
    >>> counted(1, "station"), counted(12, "station")
    ('1 station', '12 stations')
    """
    return f"{number} {what}" + ("" if number == 1 else "s")


def excerpt(shown: int, total: int) -> str:
    """What a title says of a table that shows a part.

    Examples
    --------
    >>> excerpt(12, 61), excerpt(5, 5)
    (', 12 of 61', '')
    """
    return "" if shown == total else f", {shown} of {total}"


def check_outputs(outputs: Mapping[str, Path | None], inputs: Mapping[str, Path | None]) -> None:
    """Refuse, before anything is computed, outputs that cannot be written or would overwrite an input or each other."""
    taken = [(name, path) for name, path in inputs.items() if path is not None and _exists(path)]
    for name, path in outputs.items():
        if path is None:
            continue
        need_for(name, path)
        # true for a device or pipe, which may be named twice; FileError where no file can be written
        try:
            target = path.resolve()
            if target.is_dir():
                raise FileError(Finding("file-not-file", {"what": "folder"}), path=path)
            if not target.parent.is_dir():
                raise FileError(Finding("file-folder-absent", {"folder": str(target.parent)}), path=path)
            stream = target.exists() and not target.is_file()
        except (OSError, ValueError, RuntimeError) as error:
            if isinstance(error, FileError):
                raise
            raise FileError(Finding("file-unwritable", {"reason": system_reason(error)}), path=path) from None
        if not stream and not os.access(target.parent, os.W_OK):
            raise FileError(Finding("file-unwritable", {"reason": "read-only folder"}), path=path)
        if stream:
            continue
        for other, there in taken:
            if _same(path, there):
                raise FileError(Finding("input-same-file", {"name": name, "other": other}), path=path)
        taken.append((name, path))
        if name == "--report" and path.suffix.lower() not in (".html", ".htm"):
            raise FileError(Finding("file-ending", {"ending": path.suffix, "allowed": (".html",)}), path=path)


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


def _same(one: Path, other: Path) -> bool:
    """Whether two names lead to one file, links and capitals considered as the system does."""
    if one.exists() and other.exists():
        return one.samefile(other)
    return os.path.normcase(one.resolve()) == os.path.normcase(other.resolve())


def print_outputs(
    target: Path | None, report: Path | None = None, *, what: str = "", sources: Path | None = None
) -> None:
    """What went where, or how it would."""
    done = [f"{what} written to {target}".strip()] if target is not None else []
    done += [f"report {'to' if done else 'written to'} {report}"] if report is not None else []
    done += [f"sources {'to' if done else 'written to'} {sources}"] if sources is not None else []
    print_line(", ".join(done) or "nothing was written; -o names a file")


def print_json(content: Any) -> None:
    """One JSON document on standard output; NaN becomes null."""
    sys.stdout.write(named(json.dumps(plain(content), ensure_ascii=False, indent=1, allow_nan=False)) + "\n")


def plain(value: Any) -> Any:
    """Lists, mappings, text, and numbers of 12 digits; what is not finite is null."""
    if isinstance(value, Finding):
        return plain(value.plain())
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        # more digits than anything measured has, fewer than show that 30 was 29.999999999999996
        return float(f"{value:.12g}") if np.isfinite(value) else None
    return str(value) if isinstance(value, Path) else value


COLUMNS: Final = 80
"""Width of a terminal as it opens."""


def table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]], caption: str | None = None) -> None:
    """A table whose first column is text and whose others are numbers.

    One wider than a terminal loses its spaces, then its empty columns, and breaks names of columns, then cells.
    """
    found = _table(title, header, rows, caption)
    if console.measure(found).maximum > COLUMNS:
        found.padding = 0, 0
    if console.measure(found).maximum > COLUMNS:
        rows = [[cell.replace(" ± ", "±") for cell in row] for row in rows]
        used = [place for place in range(len(header)) if not rows or any(row[place].strip() for row in rows)]
        wide = [max((len(row[place]) for row in rows), default=0) for place in used]
        wide = [max(width, 1, *map(len, header[place].split())) for width, place in zip(wide, used, strict=True)]
        names = [fill(header[place], width) for width, place in zip(wide, used, strict=True)]
        found = _table(title, names, [[row[place] for place in used] for row in rows], caption)
        found.padding = 0, 0
    if console.measure(found).maximum > COLUMNS:
        found.width = COLUMNS
        for column in found.columns:
            column.no_wrap, column.overflow = " " not in max(map(str, column.cells), key=len, default=""), "fold"
    console.print(found)


def _table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]], caption: str | None) -> Table:
    title, caption = fill(title, COLUMNS), caption and fill(caption, COLUMNS)
    found = Table(title=title, caption=caption, title_justify="left", caption_justify="left", show_edge=False)
    for place, name in enumerate(header):
        found.add_column(name, justify="left" if place == 0 else "right", no_wrap=True)
    for row in rows:
        found.add_row(*row)
    return found


MOST: Final = 3
"""Findings that one command prints; -v and --json have all, notes too."""


def findings(found: Sequence[Finding], files: Sequence[str] = (), *, notes: bool = False) -> None:
    """Findings, one a line, with their codes, the ignored ones last; with -v all, notes too.

    Nothing else says a finding: on standard output are results alone.

    files : that they are about, or checks, one each; those after them are about none. notes : even without -v.
    """
    # standard error, which never mixes with data; of now, as tests and callers redirect it
    errors = Console(stderr=True, highlight=False, markup=False, emoji=False, soft_wrap=True)
    verbose = logging.getLogger("inclinometry").isEnabledFor(logging.INFO)
    of = [f"{file}: " for file in files] + [""] * (len(found) - len(files))
    named_by = zip(found, of, strict=True)
    shown = [pair for pair in named_by if notes or verbose or pair[0].severity != "note"]
    shown.sort(key=lambda pair: ("ignored", "note").count(pair[0].severity))
    most = len(shown) if verbose else MOST
    for one, file in shown[:most]:
        text = Text(wrapped(named(f"{one.severity}: {file}{one} [{one.code}]"), sys.stderr))
        text.stylize("yellow", 0, len(one.severity) + 1)
        errors.print(text)
    if shown[most:]:
        errors.print(f"{len(shown) - most} more: -v shows all")


OF_DATA: Final = ("allan-", "bench-", "fit-", "gyro-", "motion-", "readings-", "run-", "work-estimate")
"""Codes of what data refuse."""


@contextmanager
def reading(path: str | Path) -> Iterator[Callable[[int], None] | None]:
    """Progress, by bytes read, of a file that takes a while; what its data refuse within names it."""
    try:
        size = Path(path).stat().st_size
    except OSError:
        size = 0
    try:
        if size < 5_000_000:
            yield None
            return
        from rich.progress import Progress

        with Progress(console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task(escape(f"reading {Path(path).name}"), total=size)
            yield lambda done: bar.update(task, completed=done)
    except InputError as error:
        if isinstance(error, FileError) or not error.finding.code.startswith(OF_DATA):
            raise
        raise in_file(error, path) from None


@contextmanager
def working(what: str) -> Iterator[Callable[[float], None] | None]:
    """Progress (share done, 0..1) of a computation, on a terminal only."""
    errors = Console(stderr=True)
    if not errors.is_terminal:
        yield None
        return
    from rich.progress import Progress

    with Progress(console=errors, transient=True) as bar:
        task = bar.add_task(what, total=1.0)
        yield lambda share: bar.update(task, completed=share)


@contextmanager
def busy(title: str) -> Iterator[None]:
    """A sign of life on a terminal while something is computed or written; with -v how long it took."""
    errors, start = Console(stderr=True), perf_counter()
    with errors.status(Text(title)) if errors.is_terminal else nullcontext():
        yield
    logging.getLogger("inclinometry").info("%s: %.2f s", title, perf_counter() - start)


@contextmanager
def reported(path: Path | None, function: str, *args: Any, **more: Any) -> Iterator[None]:
    """A report, where one is asked for: composed before anything within is written, and written after it.

    `function`: "module:function" of `report`, imported only then.
    """
    if path is None:
        yield
        return
    from inclinometry.files.writing import write_text

    module, _, name = function.partition(":")
    with busy("drawing"):
        page: str = getattr(import_module(f"inclinometry.report.{module}"), name)(*args, **more)
    yield
    write_text(page, path)


def spread(total: int, most: int) -> list[int]:
    """Rows of a table that shows so many of all.

    Examples
    --------
    >>> spread(100, 4), spread(2, 4)
    ([0, 33, 66, 99], [0, 1])
    """
    return sorted({int(row) for row in np.linspace(0, total - 1, min(most, total))})


def degrees(value: float, u: float) -> str:
    """An angle in rad with its standard uncertainty, deg; a dash where there is none."""
    from inclinometry.calibration.result import rounded

    return rounded(float(np.degrees(value)), float(np.degrees(u))) if np.isfinite(value) else "-"


@contextmanager
def step(title: str) -> Iterator[None]:
    """Say on standard error what is being done, and that it is done."""
    with busy(title):
        yield
    Console(stderr=True, highlight=False).print(f"  done: {title}", markup=False, emoji=False)
