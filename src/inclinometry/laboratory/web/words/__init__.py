"""What the pages say, in English, Russian and Chinese: one catalogue, one file a language.

Texts that are a term are not there but in terms.json, which names the term of the glossary.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, Final

from inclinometry import findings
from inclinometry.errors import FileError, InclinometryError
from inclinometry.glossary import terms
from inclinometry.language import speaking
from inclinometry.report.language import translated

LANGUAGES: Final = {"en": "English", "ru": "Русский", "zh": "中文"}


@cache
def catalogue(language: str) -> Mapping[str, str]:
    """Key -> text of one language."""
    return _texts(language) | terms(_texts("terms"), language)


def _texts(name: str) -> dict[str, str]:
    text = files("inclinometry.laboratory.web.words").joinpath(f"{name}.json").read_text("utf-8")
    found: dict[str, str] = json.loads(text)
    return found


def say(language: str, key: str, **values: Any) -> str:
    """The text of a key with its values put in.

    Examples
    --------
    >>> say("en", "home.title"), say("ru", "home.title")
    ('Bench', 'Рабочее место')
    """
    return catalogue(language if language in LANGUAGES else "en")[key].format(**values)


_LEFT: Final = re.compile(r"\b[a-z]{3,} [a-z]{2,} [a-z]{2,}\b")
"""English that remains: three words of it in a row."""
_PLACE: Final = re.compile(r"(?P<file>the file|[^\s:;,]+), line (?P<line>\d+): (?P<problem>.+)", re.DOTALL)
"""A file and a line in it before what is wrong there."""
_QUOTED: Final = re.compile(r'`[^`]*`|"[^"]*"')
"""Commands, and what the system or the database said, in its own words."""


def problem(language: str, error: InclinometryError) -> str:
    """What went wrong: by its code, or a sentence of a room that is not yet converted."""
    if error.finding is None:
        return sentence(language, str(error))
    where = f"{error.path.name}: " if isinstance(error, FileError) else ""
    return where + findings.say(error.finding, language)


def sentence(language: str, text: str) -> str:
    """A sentence of the program in a language, by the table of the reports; as it is where the table lacks a part.

    Warnings and records keep their English sentences, so that old ones are understood as well: a sentence is recognised
    by its words, and what stands in its places (numbers, names, a sentence of its own) is put into the translation.
    """
    if language not in LANGUAGES or language == "en":
        return text
    with speaking(language):
        said = translated(text)
    place = _PLACE.match(text)
    if place is not None and (f", line {place['line']}" in said or _LEFT.search(_QUOTED.sub("", said))):
        # no text for file, line and problem together: the place first, then what is wrong there
        problem = sentence(language, place["problem"])
        return say(
            language, "problem.line", file=sentence(language, place["file"]), line=place["line"], problem=problem
        )
    # half a sentence in each of two languages is worse than an English one
    return text if _LEFT.search(_QUOTED.sub("", said)) else said


def preferred(header: str) -> str:
    """The language a browser asks for, English when it is none of ours.

    Examples
    --------
    >>> preferred("zh-CN,zh;q=0.9,en;q=0.8"), preferred("de")
    ('zh', 'en')
    """
    for part in header.split(","):
        tag = part.partition(";")[0].strip().lower()[:2]
        if tag in LANGUAGES:
            return tag
    return "en"
