"""One command for many files: every file of a pattern or folder in its place, one table, one exit status."""

from __future__ import annotations

import io
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

from inclinometry.cli import output
from inclinometry.errors import InputError

ENDINGS = (".csv", ".txt", ".gz", ".xlsx", ".parquet", ".las", ".witsml", ".h5", ".hdf5", ".npz", ".mat", ".json")
"""Of the files that are taken from a folder."""


def run_each(arguments: list[str], run: Callable[[list[str]], int]) -> int:
    """Run a command for each file of `--each PATTERN`; the highest exit status of them.

    `{stem}` in the other arguments is the name of the file without its ending. A file that is refused does not stop the
    others.

    Raises
    ------
    InputError
        No file; no pattern; an output that would be written over by each file.
    """
    place = arguments.index("--each")
    if place + 1 == len(arguments):
        raise InputError("--each needs a pattern in quotes, or a folder")
    pattern, rest = arguments[place + 1], (arguments[:place], arguments[place + 2 :])
    files = _files(pattern)
    for option, value in zip(rest[1], rest[1][1:], strict=False):
        if option in ("-o", "--output", "--report") and "{stem}" not in value:
            raise InputError(f"{option} {value}: each file would write over it; put {{stem}} into the name")
    rows: list[list[str]] = []
    worst = 0
    for file in files:
        before, behind = ([word.replace("{stem}", file.name.partition(".")[0]) for word in part] for part in rest)
        said, complained = io.StringIO(), io.StringIO()
        label = f"{len(rows) + 1} of {len(files)}: {file.name}"
        with output.busy(label), redirect_stdout(said), redirect_stderr(complained):
            status = run([*before, str(file), *behind])
        lines = (complained if status > 1 else said).getvalue().strip().splitlines() or [""]
        warned = sum("warning" in line for line in complained.getvalue().splitlines())
        rows.append([file.name, str(status), str(warned or ""), lines[-1].removeprefix("inclinometry: ")[:200]])
        worst = max(worst, status)
    output.table(f"{output.counted(len(files), 'file')}", ["file", "exit", "warnings", "result"], rows)
    return worst


def _files(pattern: str) -> list[Path]:
    where = Path(pattern)
    if where.is_dir():
        found = [path for path in where.iterdir() if path.is_file() and path.suffix.lower() in ENDINGS]
    else:
        root = Path(where.anchor) if where.is_absolute() else Path()
        found = [
            path for path in root.glob(str(where.relative_to(root) if where.is_absolute() else where)) if path.is_file()
        ]
    if not found:
        raise InputError(f"--each {pattern}: there is no such file; give a pattern in quotes such as 'runs/*.csv'")
    return sorted(found)
