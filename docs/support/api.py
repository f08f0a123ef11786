"""The API reference and the command line's, written from the package itself, so that neither can forget anything."""

from __future__ import annotations

import contextlib
import importlib
import inspect
import io
import pkgutil
import sys
from pathlib import Path
from types import ModuleType

import inclinometry
from support import finding_page

FLOORS = (
    ("fleet",),
    ("laboratory",),
    ("workflow",),
    ("report",),
    ("files",),
    ("position",),
    ("survey", "motion"),
    ("calibration", "gyro", "simulate"),
    ("earth",),
)
"""Folders from the top floor down; above them stands the command line, which has a page of its own."""
GROUND = (
    *("history", "stability", "sensors", "uncertainty", "allan", "channels", "wahba", "conventions", "orientation"),
    "rotations",
    *("least_squares", "tabular", "settings", "digest", "opening", "arrays", "errors", "findings", "constants"),
)
"""Modules of the package itself, on which all folders stand."""
LEFT_OUT = ("migrations", "web", "commands")
"""Scripts of a database, pages and routes, words of the command line: nothing to call."""


def write(folder: Path) -> None:
    """Write the pages; those that would not change are left alone, so that builds stay quick."""
    pages = {"api/index.md": _index(), "commands.md": _commands(), "findings.md": finding_page.page()}
    for room in (room for floor in FLOORS for room in floor):
        pages[f"api/{room}.md"] = _room(room)
    pages["api/ground.md"] = _page("ground", "What all folders stand on.", [f"inclinometry.{name}" for name in GROUND])
    for name, text in pages.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def _summary(thing: object) -> str:
    text = (inspect.getdoc(thing) or "").split("\n\n")[0].replace("\n", " ")
    for mark in "|*$":
        text = text.replace(mark, f"\\{mark}")
    return text


def _home(name: str) -> tuple[str, object]:
    """Where a public name is documented, and the thing itself."""
    return ".".join(inclinometry._public()[name]), getattr(inclinometry, name)


def _index() -> str:
    lines = [
        "# API reference",
        "",
        "`import inclinometry as im` gives the names below; each is loaded when it is first used. Everything else is",
        "reached through its folder, e.g. `from inclinometry.calibration.stillness import still_intervals`.",
        "",
        "| name | what it is |",
        "|---|---|",
    ]
    for name in inclinometry.__all__:
        home, thing = _home(name)
        role = "py:mod" if inspect.ismodule(thing) else "py:obj"
        lines.append(f"| {{{role}}}`im.{name} <{home}>` | {_summary(thing)} |")
    lines += ["", "## Folders", "", "From the top floor down; each imports only from floors below its own.", ""]
    lines += ["```{toctree}", ":maxdepth: 1", "", *(room for floor in FLOORS for room in floor), "ground", "```", ""]
    return "\n".join(lines)


def _room(room: str) -> str:
    importlib.import_module(f"inclinometry.{room}")
    package = sys.modules[f"inclinometry.{room}"]
    return _page(room, (package.__doc__ or "").splitlines()[0], _modules(package))


def _page(title: str, about: str, modules: list[str]) -> str:
    lines = [f"# {title}", "", about, ""]
    for name in modules:
        title = name.removeprefix("inclinometry.")
        lines += [f"## {title}", "", "```{eval-rst}", f".. automodule:: {name}", "   :members:", "```", ""]
    return "\n".join(lines)


def _modules(package: ModuleType) -> list[str]:
    """Public modules of a room, those of its families (packages inside it) too."""
    names: list[str] = []
    for found in pkgutil.iter_modules(package.__path__):
        if found.name.startswith("_") or found.name in LEFT_OUT:
            continue
        name = f"{package.__name__}.{found.name}"
        names += _modules(importlib.import_module(name)) if found.ispkg else [name]
    return names


def _commands() -> str:
    lines = ["# Command line", "", "What `--help` says of each command.", ""]
    for words in ([], *_names()):
        title = " ".join(["inclinometry", *words])
        lines += [f"## {title}", "", "```text", _help(words), "```", ""]
    return "\n".join(lines)


def _names() -> list[list[str]]:
    from inclinometry.cli.app import app

    names = [name for name in app if not name.startswith("-")]
    groups = {name: [sub for sub in app[name] if not sub.startswith("-")] for name in names}
    alone = [[name] for name in names if not groups[name]]
    return [*alone, *([name, sub] for name in names for sub in groups[name])]


def _help(words: list[str]) -> str:
    from cyclopts import CycloptsError
    from rich.console import Console

    from inclinometry.cli.app import app

    stream = io.StringIO()
    with contextlib.suppress(CycloptsError, ImportError):
        app.help_print(words, console=Console(file=stream, width=100, color_system=None))
    return "\n".join(line.rstrip() for line in stream.getvalue().splitlines()).strip()
