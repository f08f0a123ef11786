"""Texts that fill a field and say nothing: in what a certificate states, and in place of a reason."""

from __future__ import annotations

import json
import re
import unicodedata
from functools import cache
from importlib.resources import files


@cache
def _placeholders() -> frozenset[str]:
    text = files("inclinometry.laboratory").joinpath("placeholders.json").read_text("utf-8")
    return frozenset(_letters(one) for of_language in json.loads(text).values() for one in of_language)


def _letters(text: str) -> str:
    """Letters and digits alone, small, in one form."""
    return "".join(c for c in unicodedata.normalize("NFKC", text).casefold() if c.isalnum())


def stated(text: str) -> bool:
    """Whether a text says anything: a dash, "n/a", "not stated", "tbd" are no more than an empty field.

    >>> [stated(text) for text in ("QP-12", "-", "N. N.", "not stated", "нет", "不详")]
    [True, False, False, False, False, False]
    """
    parts = [_letters(part) for part in re.split(r"[\n,;，；、]", text)]
    whole = _letters(text)
    return whole not in _placeholders() and any(part and part not in _placeholders() for part in parts)
