"""Every label and every word that is translated is one that some source, page or file of data has."""

from __future__ import annotations

import ast
import json
import re
from functools import cache
from pathlib import Path

import pytest

import inclinometry
from inclinometry.findings import rooms, translations, words

SOURCES = Path(inclinometry.__file__).parent
SMALL = {"the", "and", "for"}
"""Words of which alone no text is put together."""


def composed(parts: list[str | None]) -> str | None:
    """The pattern of a text with values, where it has a word of its own; a value is short."""
    letters = re.findall(r"[A-Za-z]{3,}|√", "".join(part or "" for part in parts))
    if not set(letters) - SMALL:
        return None
    return "".join(".{1,25}" if part is None else re.escape(part) for part in parts)


@cache
def texts() -> tuple[frozenset[str], str, re.Pattern[str]]:
    """Texts of the source, the files of data, and what is put together in the source, as one pattern."""
    plain: set[str] = set()
    patterns: set[str | None] = set()
    for path in SOURCES.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.JoinedStr):
                parts = [part.value if isinstance(part, ast.Constant) else None for part in node.values]
                patterns.add(composed([part if isinstance(part, str) else None for part in parts]))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                plain.add(node.value)
                if "{}" in node.value:  # its kind is put in
                    parted = node.value.split("{}")
                    patterns.add(composed([part for one in parted for part in (one, None)][:-1]))
    files = [path for end in ("json", "toml", "html", "js") for path in SOURCES.rglob(f"*.{end}")]
    kept = [path.read_text("utf-8") for path in files if "manual" not in path.parts and path.parent.name != "catalogue"]
    return frozenset(plain), "\0".join([*plain, *kept]), re.compile("|".join(filter(None, patterns)))


def is_used(text: str) -> bool:
    plain, whole, patterns = texts()
    text = text.partition("|")[0]  # another form of a label
    if " and " in text and all(is_used(part) for part in text.split(" and ")):  # of several runs
        return True
    forms = {text, text[:1].upper() + text[1:], text[:1].lower() + text[1:], text.replace(" ", "_")}
    return bool(forms & plain) or any(one in whole or json.dumps(one)[1:-1] in whole for one in forms) or bool(
        patterns.fullmatch(text)
    )  # fmt: skip


@pytest.mark.parametrize("language", ["ru", "zh"])
def test_every_label_is_used(language: str) -> None:
    assert [text for text in translations(language, "label") if not is_used(text)] == []


@pytest.mark.parametrize("name", ["words", *rooms()])
def test_every_word_is_used(name: str) -> None:
    assert [text for text in words(name) if not is_used(text)] == []


def test_a_text_that_no_source_has_is_found() -> None:
    assert not is_used("a sentence " + "of yesterday")
    assert is_used("counts per " + "local gravity")
