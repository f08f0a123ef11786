"""One command for many files: every file of a pattern or folder in its place, one table, one exit status."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

from inclinometry.cli import output
from inclinometry.errors import InputError

ENDINGS = (".csv", ".txt", ".gz", ".xlsx", ".parquet", ".las", ".witsml", ".h5", ".hdf5", ".npz", ".mat", ".json")
"""Of the files that are taken from a folder."""

OF_ONE = (
    "allan",
    "calibrate",
    "check",
    "dynamic",
    "gyro north",
    "msa",
    "position",
    "quality",
    "readings",
    "survey",
    "verify",
)
"""Commands of one file, which take several, a folder or a pattern in its place."""


def many(arguments: list[str]) -> tuple[list[str], list[Path], list[str]] | None:
    """Words before the files, the files, and words behind; None where the arguments are those of one file.

    Several files are those of `--each PATTERN`, or what stands in the place of the one file: a folder, a pattern that
    the shell did not expand, or names that it made of one.

    Raises
    ------
    InputError
        No file; no pattern.

    Examples
    --------
    >>> many(["verify", "a.csv", "b.csv", "--calibration", "tool.json"])
    (['verify'], [PosixPath('a.csv'), PosixPath('b.csv')], ['--calibration', 'tool.json'])
    >>> many(["compare", "a.json", "b.json"])
    """
    words = [part for word in arguments for part in (word.split("=", 1) if word.startswith("--each=") else [word])]
    if "--each" in words:
        place = words.index("--each")
        if place + 1 == len(words):
            raise InputError("--each needs a pattern in quotes, or a folder")
        return words[:place], _files(words[place + 1]), words[place + 2 :]
    start = next((n for n in (1, 2) if " ".join(words[:n]) in OF_ONE), 0)
    end = next((k for k, word in enumerate(words) if word.startswith("-")), len(words))
    names = words[start:end] if start else []
    if len(names) > 1:
        # a folder among files is refused with its name, as a file that is none
        return words[:start], [Path(name) for name in names], words[end:]
    if names and _is_many(names[0]):
        return words[:start], _files(names[0]), words[end:]
    if start and not names and (at := _behind_options(words, start)) is not None:
        return words[:start], _files(words[at]), words[start:at] + words[at + 1 :]
    return None


def _is_many(word: str) -> bool:
    """Whether a word is a folder, or a pattern and no file."""
    # these say no where the system has an objection to the name; the command's reader says which
    return os.path.isdir(word) or bool(set(word) & set("*?[") and not os.path.exists(word))  # noqa: PTH110, PTH112


def _behind_options(words: list[str], start: int) -> int | None:
    """Where a folder or pattern stands for the file behind options; the command itself tells it from their values."""
    if not any(_is_many(word) for word in words[start:]):
        return None
    from cyclopts import CycloptsError

    from inclinometry.cli.app import app

    # options of every table, which no command knows
    general = ("--profile", "--units", "--null", "--language")
    own = [w for w, before in zip(words, ["", *words], strict=False) if w not in general and before not in general]
    try:
        bound = app.parse_known_args(own)[1]
    except CycloptsError:
        return None  # said when the command runs
    file = next(iter(bound.arguments.values()), None)
    places = (k for k in range(len(words) - 1, start - 1, -1) if Path(words[k]) == file)
    return next((k for k in places if _is_many(words[k])), None)


def run_each(found: tuple[list[str], list[Path], list[str]], run: Callable[[list[str]], int]) -> int:
    """Run a command for each of `many` files; the highest exit status of them.

    `{stem}` in the other arguments is the name of the file without its ending. A file that is refused does not stop the
    others.

    Raises
    ------
    InputError
        An output that would be written over by each file.
    """
    before, files, behind = found
    rest = before, behind
    stems = [Path(file.name.removesuffix(".gz")).stem for file in files]
    named = any("{stem}" in word for part in rest for word in part)
    twice = next((stem for stem in stems if stems.count(stem) > 1), None)
    if named and twice is not None:
        raise InputError(f"two files are called {twice!r}, and one would write over the other; rename one")
    writes = {"-o", "--output", "--report", "--sources", "--truth", "--path", "--dcc"}
    outputs = [f"{a} {b}" for a, b in zip(rest[1], rest[1][1:], strict=False) if a in writes]
    outputs += [word for word in rest[1] if word.partition("=")[0] in writes and "=" in word]
    outputs += rest[1][:1] if "convert" in rest[0] else []
    for option in outputs:
        if "{stem}" not in option and len(files) > 1:
            raise InputError(f"{option}: each file would write over it; put {{stem}} into the name")
    rows: list[list[str]] = []
    records: list[dict[str, object]] = []
    worst = 0
    room = max(output.console.width - max(len(file.name) for file in files) - 25, 30)
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
        if "--json" in behind:
            result = json.loads(said.getvalue()) if status < 2 else lines[-1].removeprefix("inclinometry: ")
            records.append({"file": str(file), "exit": status, "result": result})
        text = output.taken_headline() if status < 2 else ""
        text = text or lines[-1].removeprefix("inclinometry: ").removeprefix(f"{name}, ").removeprefix(f"{name}: ")
        rows.append([file.name, str(status), str(warned or ""), text if len(text) <= room else f"{text[: room - 1]}…"])
        worst = max(worst, status)
    if records:
        output.print_json(records)
        return worst
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
        raise InputError(f"{pattern}: there is no such file; give a folder, or a pattern such as 'runs/*.csv'")
    return sorted(found)
