"""Sentences that records keep in English, in the language of who reads them.

Certificates and tool files keep the English sentence of each finding. It is recognised by the words of its code; its
values are put into the translation. A sentence whose code is gone since stays English.
"""

from __future__ import annotations

import re
from functools import cache
from typing import Final, NamedTuple

from inclinometry.findings import UNITS, codes, translations
from inclinometry.language import current_language, label, number

_FIELD: Final = re.compile(r"\{(\w+)[^}]*\}")
_PREFIX: Final = re.compile(r"([^:;,]{1,40}: )(.+)", re.DOTALL)
"""Whose sentence it is: a tool, a file, "planned"."""


class _Sentence(NamedTuple):
    """What finds a sentence, its fixed parts, its translation with values by number, its letters without them."""

    find: re.Pattern[str]
    parts: tuple[str, ...]
    said: str
    size: int


def translated(text: str) -> str:
    """A sentence, or a label, of a record in the language that is spoken; as it is where it is not known."""
    if current_language() == "en":
        return text
    whole = label(text)
    if whole != text:
        return whole
    prefixed = _PREFIX.fullmatch(text)
    for head, own in (("", text), *((prefixed.groups(),) if prefixed else ())):
        for one in _sentences(current_language()):
            found = one.find.fullmatch(own) if all(part in own for part in one.parts) else None
            if found is not None:
                values = [_value(value) for value in found.groups()]
                said = one.said.format(*values)
                whose = translated(head[:-2]) + (": " if current_language() == "ru" else "：") if head else ""
                return whose + said[:1].upper() + said[1:]
    return text


def _value(text: str) -> str:
    """A value of a sentence: a number with its unit, words, a sentence of its own."""
    number_of, space, unit = text.rpartition(" ")
    said = translations(current_language(), "word").get(space + unit)
    if said is not None and unit in {one.strip() for one in UNITS.values()}:
        return number(number_of) + said
    for join in (", ", " and ", " or "):
        if join in text:
            return translations(current_language(), "word")[join].join(map(_value, text.split(join)))
    return translated(text)


@cache
def _sentences(language: str) -> list[_Sentence]:
    """The longest first."""
    found = [_sentence(text, said) for code in codes() for text, said in translations(language, code).items()]
    return sorted((one for one in found if one.size > 8), key=lambda one: -one.size)


def _sentence(text: str, said: str) -> _Sentence:
    order, parts = _FIELD.findall(text), _FIELD.split(text)[::2]
    find = re.compile("(.+?)".join(map(re.escape, parts)), re.DOTALL | re.IGNORECASE)
    parts = [part.strip() for part in parts[1:]]  # the first may have been given a capital letter
    return _Sentence(
        find,
        tuple(filter(None, parts)),
        _FIELD.sub(lambda field: f"{{{order.index(field[1])}}}", said),
        len(_FIELD.sub("", text)),
    )
