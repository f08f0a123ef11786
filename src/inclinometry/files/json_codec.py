"""JSON with one spelling for one content, read strictly and checked against a shipped schema."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from inclinometry.errors import FileError, in_file, refused, wrong_kind
from inclinometry.files.writing import write_bytes
from inclinometry.findings import Finding, Severity, Value, room, rooms, say
from inclinometry.opening import whole

if TYPE_CHECKING:
    from jsonschema import Draft202012Validator

Json = dict[str, Any]


def canonical(content: Mapping[str, Any]) -> bytes:
    r"""UTF-8 bytes that depend on the content alone; NaN and infinity are refused.

    Keys sorted, one space of indent, a list of plain values on one line, numbers as the shortest decimal that reads
    back to the same float64, "\n" at the end. Numpy arrays and numbers are taken as lists and numbers.
    """
    text = _dump(content, "$", 0) + "\n"
    try:
        return text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise refused("file-format", {"format": "UTF-8", "reason": error.reason}) from None


def _dump(value: Any, path: str, depth: int) -> str:
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        keys = sorted(str(key) for key in value)
        if len(set(keys)) < len(value) or any(not isinstance(key, str) for key in value):
            raise wrong_kind(path, f"{list(value)!r:.60}", "text")
        cells = [
            f"{json.dumps(key, ensure_ascii=False)}: {_dump(value[key], f'{path}.{key}', depth + 1)}" for key in keys
        ]
        return _wrap("{", cells, "}", depth)
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        cells = [_dump(item, f"{path}[{i}]", depth + 1) for i, item in enumerate(value)]
        plain = all(not isinstance(item, Mapping | Sequence | np.ndarray) or isinstance(item, str) for item in value)
        return f"[{', '.join(cells)}]" if plain else _wrap("[", cells, "]", depth)
    if isinstance(value, float) and not math.isfinite(value):
        raise refused("input-finite", {"name": path})
    if value is None or isinstance(value, str | float | int):
        return json.dumps(value, ensure_ascii=False)
    raise wrong_kind(path, type(value).__name__, "number")


def _wrap(start: str, cells: list[str], end: str, depth: int) -> str:
    if not cells:
        return start + end
    pad = "\n" + " " * (depth + 1)
    return start + pad + f",{pad}".join(cells) + "\n" + " " * depth + end


_USUAL: Final = {
    "Expecting value": "a value is missing", "Expecting ',' delimiter": "a comma or a closing bracket is missing",
    "Expecting ':' delimiter": "a colon is missing", "Extra data": "text after the end",
    "Expecting property name enclosed in double quotes": "a name in double quotes is missing",
    "Unterminated string starting at": "a closing quote is missing",
    "Invalid control character at": "a character that must be escaped", "Invalid \\escape": "not a valid escape",
}  # fmt: skip
"""Usual errors of JSON, as words of the catalogue."""


def load(path: str | Path, *kinds: str) -> Json:
    """The object in a JSON file; FileError for anything else, doubled keys and NaN included.

    kinds : schemas of the records one of which is wanted; a file that is no JSON at all is refused as of another kind.
    """
    try:
        # in memory a record takes up to twenty times as much
        text = whole(path, 20_000_000).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        reason = f"{error.reason} (byte {error.start})"
        raise FileError(Finding("file-format", {"format": "UTF-8", "reason": reason}), path=path) from None
    try:
        content = parse(text)
    except json.JSONDecodeError as error:
        if kinds and text.strip() and text.lstrip()[0] not in "{[":
            raise FileError(_other_kind("text", "", kinds), path=path) from None
        at = Finding("file-at-column", {"reason": _USUAL.get(error.msg, error.msg), "column": error.colno})
        found = Finding("file-format", {"format": "JSON", "reason": at})
        raise FileError(found, path=path, line=error.lineno) from None
    except (ValueError, RecursionError) as error:
        raise FileError(Finding("file-format", {"format": "JSON", "reason": str(error)}), path=path) from None
    if not isinstance(content, dict):
        raise in_file(wrong_kind("$", shown(content), "table"), path)
    return content


def parse(text: str | bytes) -> Any:
    """The value of a JSON text; ValueError for doubled keys, NaN and numbers too large, too."""
    return json.loads(text, object_pairs_hook=_distinct, parse_constant=_no_constant, parse_float=_finite_number)


def _distinct(pairs: list[tuple[str, Any]]) -> Json:
    found: Json = {}
    for key, value in pairs:
        if key in found:
            raise ValueError(f"key {key!r:.80} appears twice in one object; remove one")
        found[key] = value
    return found


def _no_constant(text: str) -> Any:
    raise ValueError(f"{text} is not a number JSON allows; every value must be finite")


def _finite_number(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is too large; every value must be finite")
    return value


def schema(name: str) -> Json:
    """A schema shipped with the package, e.g. "tool-1" (JSON Schema, draft 2020-12).

    >>> schema("tool-1")["$id"]
    'urn:inclinometry:tool-1'
    """
    content: Json = json.loads(files("inclinometry.files").joinpath("schemas", f"{name}.json").read_text("utf-8"))
    return content


@cache
def _validator(name: str) -> Draft202012Validator:
    from jsonschema import Draft202012Validator

    return Draft202012Validator(schema(name))


def validate(content: Json, name: str, path: str | Path) -> None:
    """Check against a shipped schema; FileError with the JSON path, the value found and what it must be."""
    from jsonschema.exceptions import best_match

    try:
        error = best_match(_validator(name).iter_errors(content))
    except RecursionError as deep:  # findings may be values of findings
        raise FileError(Finding("file-format", {"format": "JSON", "reason": str(deep)}), path=path) from None
    if error is None:
        return
    where = "$" + "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in error.absolute_path)
    if error.validator == "required":
        lost = next(key for key in error.validator_value if key not in error.instance)
        found = Finding("input-missing", {"names": (f"{where}.{lost:.60}",)})
    elif error.validator == "additionalProperties":
        allowed = tuple(error.schema["properties"])
        surplus = next(key for key in error.instance if key not in allowed)
        found = Finding("input-unknown", {"names": (f"{where}.{surplus:.60}",), "known": allowed})
    elif error.validator == "uniqueItems":
        twice = next(v for i, v in enumerate(error.instance) if v in error.instance[:i])
        found = Finding("input-repeated", {"name": where, "value": shown(twice)})
    else:
        wanted = str(error.schema.get("description", error.message)).removeprefix("must be ")
        found = Finding("input-value", {"name": where, "value": shown(error.instance), "allowed": wanted})
    raise FileError(found, path=path)


_KINDS: Final = {
    "inclinometry/allan": ("noise by Allan deviation", "allan -o"),
    "inclinometry/attitude": ("attitude while drilling", "dynamic -o"),
    "inclinometry/certificate": ("record of a certificate", "certificate --record"),
    "inclinometry/certificate-status": ("status of certificates", "ledger status -o"),
    "inclinometry/coefficients": ("coefficients for a firmware", "coefficients -o"),
    "inclinometry/corrections": ("corrections of a survey", "msa -o"),
    "inclinometry/errors": ("errors of a gyro run", "gyro north --errors"),
    "inclinometry/gyro-truth": ("truth of a simulated gyro run", "simulate gyro --truth"),
    "inclinometry/ledger-head": ("signed head of a ledger", "ledger head -o"),
    "inclinometry/planned-verification": ("plan of a verification", "verify --planned -o"),
    "inclinometry/scale": ("scale factors of a gyro", "gyro scale -o"),
    "inclinometry/tool": ("calibration", "calibrate -o"),
    "inclinometry/tool-code": ("tool code", "position --tool-code"),
    "inclinometry/truth": ("truth of a simulation", "simulate bench --truth"),
    "inclinometry/verification": ("verification", "verify -o"),
}
"""Schema -> what a file is that states it, a word of the catalogue, and the command that writes or takes it."""


def of_kind(content: Json, where: str | Path, *kinds: str, version: int = 1) -> Json:
    """The content of a stored record, when it is one of these kinds and fits the schema of its version.

    version : the newest that is read; older ones keep their own schemas for ever.
    """
    kind, found = content.get("schema"), content.get("version")
    values: dict[str, Value]
    if kind not in kinds:
        what = _KINDS.get(str(kind), ("JSON of an unknown schema", ""))[0]
        raise FileError(_other_kind(what, shown(kind), kinds), path=where)
    if isinstance(found, int) and found > version:
        known = tuple(str(one) for one in range(1, version + 1))
        values = {"format": f"{kind.rpartition('/')[2]}.json", "version": str(found), "known": known}
        raise FileError(Finding("file-version", values), path=where)
    own = found if type(found) is int and 1 <= found < version else version
    validate(content, f"{kind.rpartition('/')[2]}-{own}", where)
    return content


def _other_kind(what: str, schema: str, kinds: tuple[str, ...]) -> Finding:
    wanted, commands = zip(*(_KINDS[one] for one in kinds), strict=True)
    return Finding("record-kind", {"what": what, "schema": schema, "wanted": wanted, "commands": commands})


def stored(path: str | Path, kind: str, version: int = 1) -> Json:
    """The content of a stored record of a kind, e.g. "allan"; errors as `load` and `of_kind`."""
    return of_kind(load(path, f"inclinometry/{kind}"), path, f"inclinometry/{kind}", version=version)


def store(content: Mapping[str, Any], path: str | Path, kind: str, version: int = 1) -> None:
    """Write a record of a kind, whole or not at all; the same content gives the same bytes."""
    write_bytes(canonical({"schema": f"inclinometry/{kind}", "version": version, **content}), path)


def shown(value: Any) -> str:
    """A JSON value on one short line; long lists and objects by their size.

    >>> shown([1, 2]), shown(list(range(100))), shown("x" * 90)[-5:]
    ('[1, 2]', 'a list of 100 entries', 'x..."')
    """
    text = json.dumps(value)
    if len(text) <= 60:
        return text
    if isinstance(value, str):
        return f'{text[:56]}..."'
    if isinstance(value, dict | list):
        return f"{'a list' if isinstance(value, list) else 'an object'} of {len(value)} entries"
    return f"{text[:57]}..."


# Findings of records: code and values, whose sentence is made where a user reads it.


def restored(kept: Mapping[str, Any] | str, severity: Severity = "warning") -> Finding:
    """A finding as a file keeps it; `record-text` for the sentence of an older file, or a code of another version."""
    if isinstance(kept, str):
        return Finding("record-text", {"text": kept}, severity=severity)
    code, rows = kept["code"], tuple(row - 1 for row in kept["rows"])
    name = code.partition("-")[0]
    own = room(name).get(code) if name in rooms() else None
    if own is not None and own.example.keys() <= kept["values"].keys():
        try:
            found = Finding(
                code, {name: _restored(value) for name, value in kept["values"].items()}, rows, kept["severity"]
            )
            say(found)
            return found
        except (KeyError, TypeError, ValueError):  # a value of another kind
            pass
    values = ", ".join(f"{name} {value}" for name, value in kept["values"].items())
    return Finding("record-text", {"text": f"{code}: {values}" if values else code}, rows, kept["severity"])


def findings_in(record: Mapping[str, Any]) -> tuple[Finding, ...]:
    """The findings of a stored record; older ones keep sentences: warnings, and notes or reasons."""
    warned, noted = record.get("warnings", ()), record.get("notes", record.get("reasons", ()))
    return (*map(restored, record.get("findings", warned)), *(restored(text, "note") for text in noted))


def _restored(value: Any) -> Value:
    if isinstance(value, dict):
        return restored(value)
    if isinstance(value, list):
        return tuple(map(_restored, value))
    return math.nan if value is None else value
