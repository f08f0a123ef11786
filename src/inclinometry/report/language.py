"""The language of a report: its English texts in Russian or Chinese, from one table, translations.json.

Reports, and the estimators whose warnings they print, write English. What goes into a page or a figure passes through
`translated`, which finds the sentence, with {} for its numbers and names, in the table; a sentence that is not there is
looked up in parts. Terms of the field come from the glossary. The bench takes its sentences from the same table.

Numbers keep the decimal point in every language, as on the certificate: a report quotes files and commands, and a
value copied from it must be read back as the same value.
"""

from __future__ import annotations

import json
import re
from functools import cache
from html import escape, unescape
from importlib.resources import files
from itertools import pairwise
from typing import Final, NamedTuple

from inclinometry.findings import LANGUAGES, codes, translations
from inclinometry.glossary import glossary
from inclinometry.language import spoken


def parameter_name(name: str) -> str:
    """A parameter of a sensor as people call it; any other text as it is."""
    return _PARAMETER.sub(_named, name)


_PARAMETER = re.compile(
    r"\b(accelerometer|magnetometer|gyro)\.(?:(?:(tensor|offset)\[(\d+)(?:,([012]))?\](?:\.T(\d+))?)|direction\.(\w+))"
)


def _named(found: re.Match[str]) -> str:
    kind, what, sensor, axis, power, side = found.groups()
    if what is None:
        return f"direction of the {kind} field toward {side}"
    own = "XYZ"[int(sensor)] if int(sensor) < 3 else str(int(sensor) + 1)
    across = "" if axis is None else "XYZ"[int(axis)]
    quantity = "zero" if what == "offset" else "scale" if own == across else f"cross-axis {across}"
    heat = "" if power is None else ", per °C" if power == "1" else f", per °C^{power}"
    return f"{kind} {own} {quantity}{heat}"


class _Pattern(NamedTuple):
    """An English text with places for values, its fixed parts, and what it is in the language.

    A weak one has but a word or two of its own: its values are of three words at most, and it is tried last.
    """

    find: re.Pattern[str]
    parts: tuple[str, ...]
    said: str
    weak: bool


_ONE: Final = r"([^\s()]+(?:\s±\s[^\s()]+|(?:,\s[A-Z][A-Z0-9-]+)+)?)"
"""A number, a name, or the names of several sources of error."""
_MEASURED: Final = re.compile(
    r"±\||\|(°|%| %|/| (m|mm|s|of|deg|rpm|nT|°C|σ|windows?|stations?|times|parameters|readings)\b)"
    r"|(accelerometer|magnetometer|gyro|acc|mag|cross-axis) \|"
)
"""Where a place is that of one word: a number with its sign, unit or noun, the axis of a sensor."""
_BETWEEN: Final = re.compile(r"[,;:(]")


@cache
def _table(language: str) -> tuple[dict[str, str], list[_Pattern]]:
    """Whole texts, and those with values, the most particular first."""
    column = LANGUAGES.index(language) - 1
    found: dict[str, list[str]] = json.loads(
        files("inclinometry.report").joinpath("translations.json").read_text("utf-8")
    )
    whole = {one["en"]: one[language] for one in glossary().values()} | translations(language, "word")
    patterns = []
    few, whatever = r"([^\s,;:()]+(?: [^\s,;:()]+){0,5}?)", r"(.+?)"
    for text, said in found.items():
        if "{}" not in text:
            whole[text] = said[column]
            continue
        parts = text.split("{}")
        weak = len(re.findall(r"[a-z]", text)) < 9 and not _BETWEEN.search(text)
        gaps = [_ONE if _MEASURED.search(f"{x}|{y}") else few if weak else whatever for x, y in pairwise(parts)]
        find = "".join(re.escape(part) + gap for part, gap in zip(parts, [*gaps, ""], strict=True))
        patterns.append(_Pattern(re.compile(find, re.DOTALL), tuple(filter(None, parts)), said[column], weak))
    return whole, sorted(patterns, key=lambda one: -sum(len(part) for part in one.parts))


_FIELD: Final = re.compile(r"\{(\w+)[^}]*\}")


@cache
def _kept(language: str) -> list[_Pattern]:
    """Findings as files keep them, English sentences without a code, which this translates; the longest first."""
    found = [_of_finding(one, said) for code in codes() for one, said in translations(language, code).items()]
    return sorted(found, key=lambda one: -sum(map(len, one.parts)))


def _of_finding(text: str, said: str) -> _Pattern:
    order = _FIELD.findall(text)
    parts = _FIELD.split(text)[::2]
    return _Pattern(
        re.compile("(.+?)".join(map(re.escape, parts)), re.DOTALL),
        tuple(filter(None, parts)),
        _FIELD.sub(lambda field: f"{{{order.index(field[1]) + 1}}}", said),
        weak=len(re.findall(r"[a-z]", _FIELD.sub("", text))) < 9,
    )


def translated(text: str) -> str:
    """A text of a report, ready with its numbers, in the language that is spoken; parameters get their names."""
    named = parameter_name(text) if "." in text else text
    # numbers may be tied to their sign by spaces that do not break
    return named if spoken() == "en" else _said(named.replace("\u00a0", " "), spoken())


_LATIN = re.compile(r"[A-Za-z]")
_CODE = re.compile(r" \[[a-z]+(-[a-z]+)+\]$")  # a finding, said in its language
_SENTENCE = re.compile(r"(?<=[.!?])\s+(?=[A-Z“Δ]|[a-z]: )")
_CLAUSES: Final = ("; ", ": ", ", ", " → ", " · ", " and ", " or ", " = ", " / ", " + ")
_JOINTS: Final = {" and ": (" и ", "和"), " or ": (" или ", "或"), "; ": ("; ", "；"), ": ": (": ", "：")}
_BRACKETS: Final = re.compile(r"([^()“”]*)([(“])((?:[^()“”]|\([^()]*\))*)([)”])([^()“”]*)", re.DOTALL)
_PREFIX: Final = re.compile(r"([^:;,]{1,40}: )(.+)", re.DOTALL)
_NUMBER: Final = re.compile(r"(.*[A-Za-z)] )([-+−±]?\d[^A-Za-z]*(?: ?[A-Za-zµ°/²√·]{1,9})?)", re.DOTALL)


@cache
def _said(text: str, language: str) -> str:
    body = text.strip()
    if not _LATIN.search(body) or _CODE.search(body):
        return text
    head, tail = text[: len(text) - len(text.lstrip())], text[len(text.rstrip()) :]
    return head + _body(body, language) + tail


def _body(text: str, language: str) -> str:
    known = _known(text, language)
    if known is not None:
        return known
    prefixed = _PREFIX.fullmatch(text)
    for head, own in (("", text), *((prefixed.groups(),) if prefixed else ())):
        kept = _matched(own, language, _kept(language), weak=False)
        if kept is not None:
            return _said(head, language) + kept[:1].upper() + kept[1:]
    sentences = _SENTENCE.split(text)
    if len(sentences) > 1:
        return ("" if language == "zh" else " ").join(_said(one, language) for one in sentences)
    if text.endswith((".", ":")):
        stop = text[-1] if language == "ru" else {".": "。", ":": "："}[text[-1]]
        return _said(text[:-1], language) + stop
    matched = _matched(text, language, _table(language)[1], weak=False)
    if matched is not None:
        return matched
    # words with what stands behind them in brackets, or with the number they are of
    for form, place in ((_BRACKETS, 1), (_NUMBER, 1), (_PREFIX, 2)):
        held = form.fullmatch(text)
        own = "" if held is None else held[place].strip()
        if held is not None and (_known(own, language) or _matched(own, language, _table(language)[1], weak=False)):
            return "".join(_said(one, language) for one in held.groups())
    for between in _CLAUSES:
        first, rest = _split(text, between)
        if rest:
            join = _JOINTS.get(between, (between, between))[LANGUAGES.index(language) - 1]
            return join.join((_said(first, language), _said(rest, language)))
    matched = _matched(text, language, _table(language)[1], weak=True)
    held = _BRACKETS.fullmatch(text)
    if matched is None and held is not None:
        return "".join(_said(one, language) for one in held.groups())
    return text if matched is None else matched


def _split(text: str, between: str) -> tuple[str, str]:
    """A text at its first separator that does not stand in brackets or quotation marks; "" where there is none."""
    place = text.find(between)
    while place > 0:
        before = text[:place]
        if sum(before.count(c) for c in "(“") == sum(before.count(c) for c in ")”"):
            return before, text[place + len(between) :]
        place = text.find(between, place + 1)
    return text, ""


def _known(text: str, language: str) -> str | None:
    """A whole text of the table, its first letter large or small, or a list of such."""
    whole, _ = _table(language)
    if text in whole:
        return whole[text]
    small = text[:1].lower() + text[1:]
    if text != small and small in whole:
        said = whole[small]
        return said[:1].upper() + said[1:]
    listed = re.split("(, | and | or )", text)  # words of a finding
    if listed[1:] and all(one in whole for one in listed):
        return "".join(whole[one] for one in listed)
    return None


def _matched(text: str, language: str, among: list[_Pattern], *, weak: bool) -> str | None:
    """A text of the table with values in it."""
    small = text[:1].lower() + text[1:]
    for one in among:
        if one.weak is not weak:
            continue
        for form in (text, small) if small != text else (text,):
            if not all(part in form for part in one.parts):
                continue
            found = one.find.fullmatch(form)
            if found is not None and _fits(one, found.groups(), language):
                said = _filled(one.said, found.groups(), language)
                return said if form == text else said[:1].upper() + said[1:]
    return None


def _fits(pattern: _Pattern, values: tuple[str, ...], language: str) -> bool:
    """Whether these are values and not clauses; those of a weak pattern are numbers, single words or words known."""
    if pattern.weak:
        return all(
            " " not in value or not re.search(r"[A-Za-z]{2}", value) or _said(value, language) != value
            for value in values
        )
    inner = values[:-1] if pattern.parts[-1].endswith((": ", ". ")) else values
    return not any(re.search(r"; |\. [A-Z]", value) for value in inner)


_PLACE = re.compile(r"\{(\d*)(?::(\w+))?\}")


def _filled(pattern: str, values: tuple[str, ...], language: str) -> str:
    """A translation with its values: {} the next, {2} the second, {2:gen} the form that stands as word|gen."""
    whole, turn = _table(language)[0], iter(range(len(values)))

    def one(place: re.Match[str]) -> str:
        value = values[int(place[1]) - 1 if place[1] else next(turn)]
        form = whole.get(f"{value}|{place[2]}") if place[2] else None
        return _said(value, language) if form is None else form

    return _PLACE.sub(one, pattern)


_PIECE = re.compile(r"(<script\b.*?</script>|<style\b.*?</style>|<[^>]*>)", re.DOTALL)
_SPOKEN_ATTRIBUTE = re.compile(r'\b(aria-label|title|alt)="([^"]*)"')


def translated_page(page: str) -> str:
    """Every text of an HTML page, and the descriptions in its tags, in the language that is spoken."""

    def attribute(found: re.Match[str]) -> str:
        return f'{found[1]}="{escape(translated(unescape(found[2])))}"'

    pieces = _PIECE.split(page)
    for place, piece in enumerate(pieces):
        if piece.startswith("<"):
            if not piece.startswith(("<script", "<style")) and '="' in piece:
                pieces[place] = _SPOKEN_ATTRIBUTE.sub(attribute, piece)
        elif _LATIN.search(piece):
            pieces[place] = escape(translated(unescape(piece)), quote=False)
    return "".join(pieces)
