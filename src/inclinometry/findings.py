"""What the package says about data: a code with values. The sentence is made where a user reads it.

A finding is an edge record: names of values carry their unit (`off_deg`, `md_m`), as columns and options do. One
catalogue, a file per room (catalogue/run.toml), turns a code into a sentence with named fields; translations are
gettext catalogues (catalogue/run.ru.po), whose context is the code. Nothing tests, splits or translates a sentence.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from pathlib import Path
from string import Formatter
from typing import Any, Final, Literal, NamedTuple, TypeAlias

Severity = Literal["refused", "warning", "note", "ignored"]
Value: TypeAlias = "float | int | str | Finding | tuple[Value, ...]"
LANGUAGES: Final = ("en", "ru", "zh")
CATALOGUE: Final = Path(__file__).with_name("catalogue")
UNITS: Final = {"_m_s2": " m/s2", "_percent": " %", "_deg": " deg", "_deg_h": " deg/h", "_nT": " nT", "_m": " m",
                "_mm": " mm", "_ms": " ms", "_s": " s", "_rpm": " rpm", "_Hz": " Hz", "_degC": " degC"}  # fmt: skip
"""Ending of a value's name -> unit, as English writes it; the first that fits counts."""


class Finding(NamedTuple):
    """One thing to say about data: a code of the catalogue, by room, thing and fault, and the values of its sentence.

    values : by field of the sentence, and more for programs; a value may be a finding, or several, as part of it.
    rows : of the data, from 0.
    severity : refused (going on gives a wrong number), warning (the user should act), note, ignored (by --ignore).
    """

    code: str
    values: Mapping[str, Value] = {}
    rows: tuple[int, ...] = ()
    severity: Severity = "warning"

    def __str__(self) -> str:
        return say(self)

    @property
    def group(self) -> str:
        """Name under which --ignore takes several codes; empty where a finding cannot be ignored."""
        return rule(self.code).group

    def stored(self) -> dict[str, Any]:
        """As files keep it: rows from 1, values as they are."""
        values = {name: _plain(value, Finding.stored) for name, value in self.values.items()}
        return {
            "code": self.code,
            "severity": self.severity,
            "rows": [int(row) + 1 for row in self.rows],
            "values": values,
        }

    def plain(self) -> dict[str, Any]:
        """As --json has it: what files keep, and the sentence."""
        values = {name: _plain(value, Finding.plain) for name, value in self.values.items()}
        return self.stored() | {"values": values, "sentence": str(self)}


def refused_if(when: object) -> Severity:
    """Severity of what is refused where it is large and else a warning."""
    return "refused" if when else "warning"


def without_notes(found: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings that ask for something."""
    return tuple(one for one in found if one.severity != "note")


def only_notes(found: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings that ask for nothing."""
    return tuple(one for one in found if one.severity == "note")


def ignored_lines(found: Iterable[Finding]) -> list[str]:
    """What --ignore accepted, as lines at the head of an output."""
    return [f"ignored {one.code}: {one}" for one in found if one.severity == "ignored"]


class Rule(NamedTuple):
    """What the catalogue has of a code.

    says : the sentence; with a second one for more than one, by the value `count`. do : remedy, part of the sentence.
    means, found : for the page of codes: why it matters, from what size on it is found and refused.
    example : values of a whole example, which the page shows and tests render.
    """

    says: tuple[str, ...]
    do: str = ""
    group: str = ""
    means: str = ""
    found: str = ""
    example: Mapping[str, Any] = {}

    @property
    def sentences(self) -> tuple[str, ...]:
        """What is translated."""
        return tuple(f"{one} {self.do}".rstrip() for one in self.says)


# What only a finding needs is imported where one is said: right data pay nothing.


def _read(name: str) -> str:
    return (CATALOGUE / name).read_text("utf-8")


def _toml(name: str) -> dict[str, Any]:
    import tomllib

    return tomllib.loads(_read(name))


@cache
def room(name: str) -> dict[str, Rule]:
    """The rules of a room, by code."""
    found = {}
    for code, entry in _toml(f"{name}.toml").items():
        if code == "words":
            continue
        says = entry.pop("says")
        found[code] = Rule((says,) if isinstance(says, str) else tuple(says), **entry)
    return found


def rule(code: str) -> Rule:
    """What the catalogue has of a code; KeyError of one that is not there."""
    return room(code.partition("-")[0])[code]


@cache
def rooms() -> tuple[str, ...]:
    """Names of all rooms, for the page of codes and for --ignore."""
    return tuple(sorted(path.stem for path in CATALOGUE.glob("*.toml") if path.stem != "words"))


def codes() -> dict[str, Rule]:
    """All rules, by code."""
    return {code: one for name in rooms() for code, one in room(name).items()}


def example(code: str, values: Mapping[str, Any] | None = None) -> Finding:
    """The finding that the catalogue gives as an example of a code, or one with values as TOML has them."""
    given = rule(code).example if values is None else values
    return Finding(code, {name: _given(one) for name, one in given.items()})


def _given(one: Any) -> Value:
    if isinstance(one, dict):
        return example(one["code"], one["values"])
    return tuple(map(_given, one)) if isinstance(one, list) else one


@cache
def words(name: str = "words") -> frozenset[str]:
    """Values of a room that are words, with those of every room and what joins values: translated besides sentences."""
    own = _toml(f"{name}.toml").get("words", ())
    return frozenset((*own, *UNITS.values())) if name == "words" else words() | frozenset(own)


def say(found: Finding, language: str = "en") -> str:
    """The sentence of a finding.

    A field is {name}, or {name:spec}: a format of numbers (.3g where there is none; lengths as given), `word` for
    one that is translated, `unit` for a unit after its number, `name` for one that is said as pages label it, `whole`
    for a sentence of a file, which is not cut, `or` and `and` for several values.
    """
    of, count, own = rule(found.code), found.values.get("count", 1), found.code.partition("-")[0]
    text = _translated(language, own, found.code, of.sentences, count if isinstance(count, int) else 1)
    parts = []
    for literal, name, spec, _ in Formatter().parse(text):
        parts += [literal, "" if name is None else _shown(name, found.values[name], spec or "", language, own)]
    said = "".join(parts)
    # a value of its own is at the start as it was given: a column, a file
    start = text.partition("}")[0]
    as_given = start.startswith("{") and not start.endswith(":word")
    return said[:1].upper() + said[1:] if of.means and not as_given else said


def _shown(name: str, value: Value, spec: str, language: str, own: str) -> str:
    """A value in a sentence of a room."""
    if isinstance(value, Finding):
        return say(value, language)
    if isinstance(value, tuple):
        if not value:
            return _word("none", language, own)
        last = spec.removesuffix("word").strip()
        last, each = (last, spec[len(last) :].strip()) if last in ("and", "or") else ("and", spec)
        shown = [_shown(name, one, each, language, own) for one in value]
        if all(isinstance(one, Finding) and (rule(one.code).means or one.code == "record-text") for one in value):
            return ("" if language == "zh" else " ").join(shown)  # whole sentences
        join = _word(f" {last} ", language, own)
        if language == "zh" and shown[-1][:1] > "\u2e80":  # a Chinese word needs no space beside it
            join = join.strip()
        return join.join([_word(", ", language, own).join(shown[:-1]), shown[-1]] if shown[1:] else shown)
    if isinstance(value, str):
        if spec == "name":
            known = translations(language, "word") | translations(language, "label")
            return known.get(value) or known.get(value.replace("^", ""), _short(value))
        if spec == "unit":
            return _word(f" {value}", language, own)
        return _word(value, language, own) if spec == "word" else value if spec == "whole" else _short(value)
    unit = next((end for end in UNITS if name.endswith(end)), "")
    text = format(value, spec or ("d" if isinstance(value, int) else ".12g" if unit == "_m" else ".3g"))
    text = f"{float(text):.12g}" if "e" in text else text
    if language == "ru":
        text = text.replace(".", ",")
    return text + (_word(UNITS[unit], language, own) if unit else "")


def _short(text: str) -> str:
    """A text of data for a sentence: a damaged file has values of thousands of characters; of a path the end counts."""
    return text if len(text) <= 300 else f"{text[:60]}…{text[-30:]}"


def _word(text: str, language: str, own: str) -> str:
    if text not in words(own):
        raise KeyError(f"{text!r} is neither in words.toml nor among the words of {own}.toml")
    return _translated(language, "words" if text in words() else own, "word", (text,))


def _plain(value: Value, how: Callable[[Finding], Any]) -> Any:
    if isinstance(value, Finding):
        return how(value)
    if isinstance(value, tuple):
        return [_plain(one, how) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


# Translations: .po files as translators write them, read without a build step.


@cache
def translations(language: str, context: str) -> dict[str, str]:
    """The messages of a context, a code, "word" or "label", in a language; of plural forms the first."""
    places = {"word": ("words", *rooms()), "label": ("labels",)}.get(context, (context.partition("-")[0],))
    start = f"{context}\x04"
    return {
        key.removeprefix(start).split("\0")[0]: said[0]
        for place in places
        for key, said in _messages(language, place).items()
        if key.startswith(start)
    }


@cache
def _messages(language: str, own: str) -> dict[str, tuple[str, ...]]:
    return {} if language == "en" else entries(_read(f"{own}.{language}.po"))


@cache
def _plural(language: str) -> Callable[[int], int]:
    """Number -> place of its plural form, as the head of a .po says it."""
    from gettext import c2py

    head = "plural=n != 1;" if language == "en" else _messages(language, "words")[""][0]
    return c2py(head.partition("plural=")[2].partition(";")[0])


def _translated(language: str, own: str, context: str, sentences: tuple[str, ...], count: int = 1) -> str:
    """One of a sentence and its plural form in a language; as they are where no one has translated them."""
    forms = _messages(language, own).get(f"{context}\x04{chr(0).join(sentences)}", ())
    found, rules = (forms, language) if forms and all(forms) else (sentences, "en")
    return found[_plural(rules)(count)] if len(sentences) > 1 else found[0]


def entries(text: str) -> dict[str, tuple[str, ...]]:
    """The messages of a .po: context and message as gettext joins them -> translations, one a plural form."""
    import json

    found: dict[str, tuple[str, ...]] = {}
    for block in text.split("\n\n"):
        parts: dict[str, str] = {}
        key = ""
        for line in block.splitlines():
            if line.startswith("#"):
                continue
            keyword, _, quoted = line.partition('"')
            key = keyword.strip() or key
            parts[key] = parts.get(key, "") + json.loads(f'"{quoted}')
        if not parts:
            continue
        message = "\0".join(parts[key] for key in ("msgid", "msgid_plural") if key in parts)
        context = f"{parts['msgctxt']}\x04" if "msgctxt" in parts else ""
        found[context + message] = tuple(value for key, value in parts.items() if key.startswith("msgstr"))
    return found
