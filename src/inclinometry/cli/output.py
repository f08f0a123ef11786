"""What commands print: tables for people, JSON for machines, progress where it lasts."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

_WIDEST = 110  # columns the widest table needs; a narrower terminal wraps lines rather than cells

console = Console(highlight=False, soft_wrap=True, width=max(shutil.get_terminal_size().columns, _WIDEST))
"""Standard output for people."""


def print_json(content: Any) -> None:
    """One JSON document on standard output; NaN becomes null."""
    sys.stdout.write(json.dumps(plain(content), ensure_ascii=False, indent=1, allow_nan=False) + "\n")


def plain(value: Any) -> Any:
    """Lists, mappings, numbers and text only; what is not finite is null."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


def table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]], caption: str | None = None) -> None:
    """A table whose first column is text and whose others are numbers."""
    found = Table(title=title, caption=caption, title_justify="left", caption_justify="left", show_edge=False)
    for place, name in enumerate(header):
        found.add_column(name, justify="left" if place == 0 else "right", no_wrap=True)
    for row in rows:
        found.add_row(*row)
    console.print(found)


def warnings(sentences: Sequence[str]) -> None:
    """Warnings, one a line, on standard error so that they never mix with data."""
    errors = Console(stderr=True, highlight=False, soft_wrap=True)
    for sentence in sentences:
        errors.print("[yellow]warning:[/yellow] ", end="")
        errors.print(sentence, markup=False)


@contextmanager
def reading(path: str | Path) -> Iterator[Callable[[int], None] | None]:
    """Progress, by bytes read, of a file that takes a while; nothing for a small one or without a terminal."""
    try:
        size = Path(path).stat().st_size
    except OSError:
        size = 0
    if size < 5_000_000:
        yield None
        return
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(f"reading {Path(path).name}", total=size)
        yield lambda done: bar.update(task, completed=done)


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
    """A sign of life on a terminal while something is computed or written."""
    errors = Console(stderr=True)
    with errors.status(title) if errors.is_terminal else nullcontext():
        yield


@contextmanager
def step(title: str) -> Iterator[None]:
    """Say on standard error what is being done, and that it is done."""
    with busy(title):
        yield
    Console(stderr=True, highlight=False).print(f"  done: {title}", markup=False)
