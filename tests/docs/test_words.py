"""The package speaks the words of its field: private ones are in no name and no text; the glossary is current."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from tools import turns

ROOT = Path(__file__).parents[2]
SOURCES = sorted((ROOT / "src" / "inclinometry").rglob("*.py"))
MADE = ("generated", "_build", "gallery", "manual")  # by make docs, from what is tested here
DATA = sorted(
    path
    for end in ("json", "toml", "html", "js", "css")
    for path in (ROOT / "src" / "inclinometry").rglob(f"*.{end}")
    if not set(path.relative_to(ROOT).parts) & set(MADE)
)
WRITTEN = [path for path in (ROOT / "docs").rglob("*.md") if not set(path.relative_to(ROOT / "docs").parts) & set(MADE)]
PAGES = sorted([*WRITTEN, *ROOT.glob("README*.md"), ROOT / "CONTRIBUTING.md"])

# private word -> the word of the field
INSTEAD = {
    "house": "package, project, native",
    "nought": "zero",
    "promise": "expected uncertainty, required",
    "felt": "sensed",
    "standing": "progress, status",
    "rubbish": "unreadable",
    "beforehand": "prior",
    "capability": "expected uncertainty",
}
IN_NAMES = {"standing", "capability"}
"""Banned in names only: "standing still" is plain English; records have a field `capability_deg`."""
OLD_NAME = re.compile(r"""["'`\\]+house["'`\\]+""")
"""The name under which files of before have the native convention."""


def named(path: Path) -> set[str]:
    """Every name that a module defines, binds or takes."""
    found: set[str] = {path.stem}
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Name):
            found.add(node.id)
        elif isinstance(node, ast.Attribute):
            found.add(node.attr)
        elif isinstance(node, ast.arg | ast.keyword):
            found.add(node.arg or "")
    return found


def parts(name: str) -> set[str]:
    """The words of a name, in lower case and without the endings of verbs and plurals.

    Also of a class: `SensedField` -> sensed, field.
    """
    words = re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)
    return {word.lower() for word in words} | {word.lower().removesuffix("s") for word in words}


def private(text: str) -> list[str]:
    """Private words in a text."""
    words = "|".join(word for word in INSTEAD if word not in IN_NAMES)
    return re.findall(rf"\b(?:{words})(?:s|d)?\b", OLD_NAME.sub("", text), re.IGNORECASE)


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT / "src")))
def test_no_name_and_no_text_of_the_source_has_a_private_word(path: Path) -> None:
    """Names, messages, docstrings, comments."""
    wrong = {name: INSTEAD[word] for name in named(path) for word in parts(name) & INSTEAD.keys()}
    assert wrong == {}
    assert private(path.read_text("utf-8")) == [], INSTEAD


@pytest.mark.parametrize("path", [*DATA, *PAGES], ids=lambda path: str(path.relative_to(ROOT)))
def test_no_file_of_data_and_no_page_has_a_private_word(path: Path) -> None:
    """What people read."""
    assert private(path.read_text("utf-8")) == [], INSTEAD


def test_the_page_of_the_glossary_is_up_to_date() -> None:
    """`python docs/computed.py glossary_table` renews it."""
    import computed
    from support import glossary_table

    page = (ROOT / "docs" / "glossary.md").read_text("utf-8")
    assert computed.written(page, glossary_table.everything()) == page


def test_words_are_found_wherever_they_stand() -> None:
    """In names of variables, constants and classes, and in texts."""
    assert parts("is_house") & INSTEAD.keys()
    assert parts("LEAST_FELT") & INSTEAD.keys()
    assert parts("StandingsTable") & INSTEAD.keys()
    assert private("The house's axes, as promised") == ["house", "promised"]
    assert private('convention "house", `house`; houses are') == ["houses"]


def test_turns_of_phrase_only_fall():
    """`python tools/turns.py` shows the counts, with the name of a turn its lines."""
    most = {turn.name: turn.most for turn in turns.turns()}
    assert {name: count for name, count in turns.counts().items() if count > most[name]} == {}
