"""What the pages say, in English, Russian and Chinese: one catalogue, one file a language.

Texts that are a term are not there but in terms.json, which names the term of the glossary.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, Final

from inclinometry import findings
from inclinometry.errors import FileError, InclinometryError
from inclinometry.glossary import terms
from inclinometry.language import label, number, using_language

LANGUAGES: Final = {"en": "English", "ru": "Русский", "zh": "中文"}
NAMES: Final = ("number", "name", "tool", "file", "reason")
"""Places of names that others have given, also where one looks like a number."""


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
    shown = {
        name: decimal(language, v) if isinstance(v, str) and name not in NAMES else v for name, v in values.items()
    }
    return catalogue(language if language in LANGUAGES else "en")[key].format(**shown)


def problem(language: str, error: InclinometryError) -> str:
    """What went wrong, in a language."""
    said = findings.say(error.finding, language)
    if not isinstance(error, FileError):
        return said
    file = sentence(language, error.path.name)  # "the file" of an upload
    if error.line is not None:
        return say(language, "problem.line", file=file, line=error.line, problem=said)
    if error.row is not None:
        return say(language, "problem.row", file=file, row=error.row, problem=said)
    return say(language, "problem.file", file=file, problem=said)


def decimal(language: str, text: str) -> str:
    """Ready numbers with the decimal sign of a language.

    >>> decimal("ru", "0.25 ± 0.01"), decimal("en", "0.25")
    ('0,25 ± 0,01', '0.25')
    """
    with using_language(language if language in LANGUAGES else "en"):
        return number(text)


def sentence(language: str, text: str) -> str:
    """A word of the program in a language; any other text as it is."""
    with using_language(language if language in LANGUAGES else "en"):
        return label(text)


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
