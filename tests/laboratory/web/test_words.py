"""The catalogue: every text in all languages, with the same values; every text used, every use there."""

from __future__ import annotations

import json
import re
from importlib.resources import files
from pathlib import Path
from string import Formatter
from types import SimpleNamespace

import pytest

from inclinometry import findings
from inclinometry.errors import FileError, in_file
from inclinometry.files.json_codec import restored
from inclinometry.findings import Finding, example
from inclinometry.laboratory import web
from inclinometry.laboratory.web.frame import Visitor
from inclinometry.laboratory.web.words import LANGUAGES, catalogue, problem, say, sentence

SOURCES = sorted(Path(web.__file__).parent.rglob("*.py"))


def _literals() -> tuple[set[str], list[re.Pattern[str]]]:
    """Texts in quotes in the code of the pages, and the patterns of those put together there."""
    plain: set[str] = set()
    patterns = []
    for path in SOURCES:
        text = path.read_text("utf-8")
        plain |= set(re.findall(r'"([a-z]+\.[\w. -]+)"', text))
        for found in re.findall(r"""f["']([a-z]+\.(?:[\w.-]|\{[^{}]*\})+)["']""", text):
            parts = re.split(r"\{[^{}]*\}", found)
            if len(parts) > 1:
                patterns.append(re.compile(r"[\w .-]+".join(re.escape(part) for part in parts)))
    return plain, patterns


def _values(text: str) -> set[str]:
    return {name for _, name, _, _ in Formatter().parse(text) if name is not None}


@pytest.mark.parametrize("language", LANGUAGES)
def test_each_language_has_every_text_with_the_same_values(language: str) -> None:
    """Nothing is missing, nothing is empty, nothing is left over."""
    english, other = catalogue("en"), catalogue(language)
    assert set(other) == set(english)
    for key, text in english.items():
        assert other[key].strip() == other[key] != "", key
        assert _values(other[key]) == _values(text), key
        assert '"' not in other[key], key  # texts stand in attributes


@pytest.mark.parametrize("language", LANGUAGES)
def test_no_text_is_in_the_words_of_a_programmer(language: str) -> None:
    """Who stands at a bench knows files by what is in them."""
    words = r"\b(JSON|null|None|NaN|id|ids|UUID|payload|string|boolean|integer|HTTP|traceback|exception|API|token)\b"
    # None, the answer to which limits, is a word of everybody
    assert [key for key, text in catalogue(language).items() if re.search(words, re.sub("^None:", "", text))] == []


def test_every_text_is_used() -> None:
    """A key of the catalogue stands in the code, whole or put together."""
    plain, patterns = _literals()
    unused = [key for key in catalogue("en") if key not in plain and not any(p.fullmatch(key) for p in patterns)]
    assert unused == []


def test_every_text_that_is_used_is_there() -> None:
    """What the code says, the catalogue has."""
    missing = set()
    for path in SOURCES:
        text = path.read_text("utf-8")
        uses = re.findall(r'\bsay\(\s*"([a-z]+\.[^"]+)"', text) + re.findall(r'frame\(\s*request,\s*"([^"]+)"', text)
        missing |= {use for use in uses if use not in catalogue("en")}
    assert missing == set()


def test_files_are_in_order() -> None:
    """Keys are sorted and none stands twice, so that two people's changes meet rarely."""
    for language in LANGUAGES:
        text = files("inclinometry.laboratory.web.words").joinpath(f"{language}.json").read_text("utf-8")
        pairs = json.loads(text, object_pairs_hook=lambda pairs: [key for key, _ in pairs])
        assert pairs == sorted(set(pairs))


def test_values_are_put_in() -> None:
    """A value with braces is not read as a place for another one."""
    assert say("en", "home.progress", done="{all}", all=3) == "{all} of 3 positions"


def test_an_unknown_sentence_stays_as_it_is() -> None:
    assert sentence("ru", "something else happened") == "something else happened"
    # nor half of one
    assert (
        sentence("ru", "COM3 is open; something else happened there") == "COM3 is open; something else happened there"
    )


@pytest.mark.parametrize("language", ["ru", "zh"])
def test_a_long_sentence_of_an_older_file_is_whole_and_as_it_was_written(language: str) -> None:
    """Values of data are cut where they are said, a sentence that a file keeps is not."""
    visitor = Visitor(SimpleNamespace(without_path=str), None, language, None)
    for text in (str(example("bench-base-tilted")), "x" * 500):
        assert visitor.sentence(restored(text)) == text
    found = example("bench-base-tilted")
    assert visitor.sentence(restored(found.stored())) == findings.say(found, language) != str(found)


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_page_says_the_file_and_its_line_or_row(language: str) -> None:
    """Rows where the file has no lines; a file that is called otherwise keeps them."""
    finding = Finding("input-empty", {"name": "md_m"})
    at = {key: problem(language, FileError(finding, path="run.xlsx", **{key: 7})) for key in ("line", "row")}
    assert all("run.xlsx" in said and "7" in said for said in at.values())
    assert at["row"] == problem(language, in_file(FileError(finding, path="copy", row=7), "run.xlsx")) != at["line"]
