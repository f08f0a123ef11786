"""The language in which pages, figures and papers are composed: labels and numbers in English, Russian or Chinese.

A label is an English text with named fields, the key of its translation in catalogue/labels.ru.po (gettext). It is
said where it is composed, so that nothing has to recognise finished text. Numbers of Russian have a decimal comma;
files keep the point.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from string import Formatter
from typing import Any

from inclinometry.errors import not_among
from inclinometry.findings import LANGUAGES, Finding, say, translations
from inclinometry.glossary import glossary

_SPOKEN: ContextVar[str] = ContextVar("language of pages", default="en")


def current_language() -> str:
    """Language of what is composed here and now."""
    return _SPOKEN.get()


@contextmanager
def using_language(language: str) -> Iterator[None]:
    """Whatever is composed while the block runs is in this language, "en", "ru" or "zh"."""
    if language not in LANGUAGES:
        raise not_among("language", language, LANGUAGES)
    token = _SPOKEN.set(language)
    try:
        yield
    finally:
        _SPOKEN.reset(token)


def label(text: str, /, **values: Any) -> str:
    """A text in the language that is spoken, with its values; as it is where it is no label.

    A value that is a label itself is said too, {name:gen} in the form of it that stands as "value|gen".
    """
    known = _labels(current_language())
    said = known.get(text, text)
    if text not in known and text[:1].isupper():
        small = text[:1].lower() + text[1:]
        said = known[small][:1].upper() + known[small][1:] if small in known else text
    if not values:
        return number(said) if said is text else said
    parts = []
    for literal, name, spec, _ in Formatter().parse(said):
        parts += [literal, "" if name is None else _shown(values[name], spec or "")]
    return "".join(parts)


def _shown(value: Any, spec: str) -> str:
    if not isinstance(value, str):
        return number(format(value, spec))
    form = _labels(current_language()).get(f"{value}|{spec}") if spec else None
    return label(value) if form is None else form


_NUMBERS = re.compile(r"[-+−±~<>≤≥=()\[\] ,;/×·…°%σ\d.]*\d\.\d[-+−±()\[\] ,;/×·…°%σ\d.]*(?:e[-+]?\d+)?%?")
"""A text of numbers, signs and units without letters."""


def number(text: str) -> str:
    """Ready numbers with the decimal sign of the language ("0,25 ± 0,01"); any other text ("rev5.1") as it is."""
    if current_language() != "ru" or "." not in text or not _NUMBERS.fullmatch(text) or re.search(r"\d\.\d+\.\d", text):
        return text
    return re.sub(r"(?<=\d)\.(?=\d)", ",", text)


def said(found: Iterable[Finding]) -> list[str]:
    """Findings in the language that is spoken, each with its code; notes too."""
    return [f"{say(one, current_language())} [{one.code}]" for one in found]


@cache
def _labels(language: str) -> dict[str, str]:
    """Labels, words of findings and terms of the field, in English itself none."""
    if language == "en":
        return {}
    terms = {one["en"]: one[language] for one in glossary().values()}
    return terms | translations(language, "word") | translations(language, "label")
