"""Docstrings are written for a prompt; this makes them fit for a page without changing what they say."""

from __future__ import annotations

import re
from dataclasses import fields
from typing import Annotated, get_args, get_origin, get_type_hints

from inclinometry.settings import Range, Settings

_FIELD = re.compile(r"^(\w[\w, ]*) : (\S.*)$")
_COLON = "\N{RATIO}"
_RULE = re.compile(r"-{3,}")


def prepare(app: object, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    """Escape what reStructuredText would take for markup, and set lines `name : meaning` apart as a list."""
    result: list[str] = []
    example = False
    for line in lines:
        stripped = line.strip()
        if stripped == "Attributes":
            line = line.replace(stripped, "Fields")
        example = stripped.startswith(">>>") or (example and bool(stripped))
        result.append(line if example else _escaped(line))
    result = _listed(_aligned(result))
    if what == "class" and isinstance(thing, type) and issubclass(thing, Settings) and thing is not Settings:
        result += _settings(thing)
    if what in ("attribute", "data", "property") and result:
        # napoleon would read "type: meaning" into a first line with a colon; `restore` brings it back
        result[0] = result[0].replace(":", _COLON)
    lines[:] = result


def restore(app: object, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    """After napoleon: the colons `prepare` has hidden from it."""
    lines[:] = [line.replace(_COLON, ":") for line in lines]


def signature(
    app: object, what: str, name: str, thing: object, options: object, arguments: str | None, result: str | None
) -> tuple[str | None, str | None]:
    """Types as the source writes them, without the modules they come from."""
    if arguments and name.startswith("inclinometry.simulate."):
        # two rooms have a Rig: what is known of one, and one to simulate
        arguments = re.sub(r"(?<![\w.~])Rig\b", "~inclinometry.simulate.bench.Rig", arguments)
    arguments, result = _short(_bare(arguments)), _short(result)
    if not name.startswith("inclinometry.conventions."):
        # likewise a wiring, and what Python calls a mapping
        arguments, result = _abstract(arguments), _abstract(result)
    return arguments, result


def _settings(thing: type) -> list[str]:
    """The parameters of a class of settings, which stand in its annotations."""
    lines = ["", "Parameters", "----------"]
    hints = get_type_hints(thing, include_extras=True)
    for field in fields(thing):  # type: ignore[arg-type]
        notes = get_args(hints[field.name])[1:] if get_origin(hints[field.name]) is Annotated else ()
        words = " ".join(str(note) for note in notes if isinstance(note, str))
        allowed = [f"{note.low:g} to {note.high:g} {note.unit}".strip() for note in notes if isinstance(note, Range)]
        lines += [field.name, f"    {words} {''.join(f'Allowed: {text}.' for text in allowed)}".rstrip() or "    "]
    return lines


def _bare(text: str | None) -> str | None:
    """Types without what `Annotated` says beside them."""
    while text and (found := re.search(r"~?(?:typing\.)?Annotated\[", text)):
        start, begins = found.span()
        depth, quote, comma = 0, "", -1
        for place in range(begins, len(text)):
            mark = text[place]
            if quote:
                quote = "" if mark == quote else quote
            elif mark in "'\"":
                quote = mark
            elif mark in "[(":
                depth += 1
            elif mark in "])" and depth:
                depth -= 1
            elif mark == "," and not depth and comma < 0:
                comma = place
            elif mark == "]":
                text = text[:start] + text[begins:comma] + text[place + 1 :]
                break
        else:
            return text
    return text


def _abstract(text: str | None) -> str | None:
    return None if text is None else re.sub(r"(?<![\w.~])Mapping\b", "~collections.abc.Mapping", text)


def _short(text: str | None) -> str | None:
    if text is None:
        return None
    text = text.replace("<factory>", "...")  # no Python: the rest of the signature would not be understood
    return re.sub(
        r"~?\b(?:collections\.abc|pathlib|types|datetime|numpy\.random\.\w+|np\.random|numpy|np)\.(?=[A-Za-z])",
        "",
        text,
    )


def _escaped(line: str) -> str:
    """Bars, stars and trailing underscores outside of backticks are text."""
    parts = re.split(r"(``[^`]+``|`[^`]+`)", line)
    for index in range(0, len(parts), 2):
        text = re.sub(r"([|*])", r"\\\1", parts[index])
        parts[index] = re.sub(r"(\w)_(?=$|[\s.,;:)\]'/-])", r"\1\\_", text)
    return "".join(parts)


def _aligned(lines: list[str]) -> list[str]:
    """Lines of a formula that go on deeper than they began, at one margin: reStructuredText takes no step there."""
    result: list[str] = []
    margin = 0
    for line in lines:
        depth = len(line) - len(line.lstrip())
        if result and result[-1].strip() and 4 <= margin < depth:
            line = " " * margin + line.lstrip()
        else:
            margin = depth
        result.append(line)
    return result


def _listed(lines: list[str]) -> list[str]:
    """Lines `name : meaning` at the left margin, before any section of the docstring, become a list."""
    rules = [number for number, line in enumerate(lines) if _RULE.fullmatch(line.strip())]
    stop = rules[0] - 1 if rules else len(lines)
    result: list[str] = []
    inside = False
    for line in lines[:stop]:
        found = _FIELD.match(line)
        if found:
            if not inside and result and result[-1].strip():
                result.append("")
            result.append(f"* **{found[1]}** : {found[2]}")
        elif inside and line.startswith("    "):
            result.append("  " + line.strip())
        else:
            if inside and line.strip():
                result.append("")
            result.append(line)
        inside = bool(found) or (inside and line.startswith("    "))
    return result + lines[stop:]
