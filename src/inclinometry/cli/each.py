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
    words = [part for word in arguments for part in (word.split("=", 1) if word.startswith("--each=") else [word])]
    place = words.index("--each")
    if place + 1 == len(words):
        raise InputError("--each needs a pattern in quotes, or a folder")
    files, rest = _files(words[place + 1]), (words[:place], words[place + 2 :])
    stems = [Path(file.name.removesuffix(".gz")).stem for file in files]
    named = any("{stem}" in word for part in rest for word in part)
    twice = next((stem for stem in stems if stems.count(stem) > 1), None)
    if named and twice is not None:
        raise InputError(f"--each: two files are called {twice!r}, and one would write over the other; rename one")
    writes = {"-o", "--output", "--report", "--sources", "--truth", "--path", "--dcc"}
    outputs = [f"{a} {b}" for a, b in zip(rest[1], rest[1][1:], strict=False) if a in writes]
    outputs += [word for word in rest[1] if word.partition("=")[0] in writes and "=" in word]
    outputs += rest[1][:1] if "convert" in rest[0] else []
    for option in outputs:
        if "{stem}" not in option and len(files) > 1:
            raise InputError(f"{option}: each file would write over it; put {{stem}} into the name")
    rows: list[list[str]] = []
    worst = 0
    for file, stem in zip(files, stems, strict=True):
        before, behind = ([word.replace("{stem}", stem) for word in part] for part in rest)
        # a name that begins with a hyphen is no option
        name = f"./{file}" if str(file).startswith("-") else str(file)
        said, complained = io.StringIO(), io.StringIO()
        label = f"{len(rows) + 1} of {len(files)}: {file.name}"
        with output.busy(label), redirect_stdout(said), redirect_stderr(complained):
            status = run([*before, name, *behind])
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
