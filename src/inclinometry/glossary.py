"""The words of the field in English, Russian and Chinese, each translated once: glossary.json.

Pages, certificate and manual take a term from here.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files


@cache
def glossary() -> Mapping[str, Mapping[str, str]]:
    """Key -> "en", "ru", "zh" and a "definition" in English of every term."""
    found: dict[str, dict[str, str]] = json.loads(
        files("inclinometry").joinpath("catalogue/glossary.json").read_text("utf-8")
    )
    return found


def term(name: str, language: str) -> str:
    """A term in a language; where its key begins with a capital letter, the term does.

    Examples
    --------
    >>> term("azimuth", "ru"), term("Azimuth", "ru"), term("azimuth", "zh")
    ('азимут', 'Азимут', '方位角')
    """
    found = glossary()[name[:1].lower() + name[1:]][language]
    return found[:1].upper() + found[1:] if name[:1].isupper() else found


def terms(names: Mapping[str, str], language: str) -> dict[str, str]:
    """Texts of a catalogue that are terms: key of the text -> key of the term, as `term` takes it."""
    return {key: term(name, language) for key, name in names.items()}
