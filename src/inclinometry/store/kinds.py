"""The kinds of record a ledger holds: what they are found by, and what their body must contain."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Final

from inclinometry.core.errors import InputError

if TYPE_CHECKING:
    from jsonschema import Draft202012Validator

VERSION: Final = 1
"""Version of the records written; records of older versions stay readable for ever."""
INTEGERS: Final = range(2**31)
"""Whole numbers a key may be: what both engines can keep."""


@dataclass(frozen=True)
class Kind:
    """One kind of record.

    name : of the kind and of its table.
    keys : columns it is found by, name -> type; they are not repeated in the body.
    unique : the keys that no two records may share; empty when a later record with the same keys is a new version.
    """

    name: str
    keys: Mapping[str, type]
    unique: tuple[str, ...] = ()


KINDS: Final[Mapping[str, Kind]] = {
    kind.name: kind
    for kind in (
        Kind("tool", {"serial": str}),
        Kind("rig", {"name": str}),
        Kind("site", {"name": str}),
        Kind("session", {"serial": str, "purpose": str}),
        Kind("reading", {"session": str, "position": int, "attempt": int}, ("session", "position", "attempt")),
        Kind("calibration", {"serial": str, "session": str}),
        Kind("verification", {"serial": str, "calibration": str}),
        Kind("certificate", {"number": str, "serial": str}, ("number",)),
        Kind("user", {"name": str}),
        Kind("event", {"subject_kind": str, "subject": str, "action": str}),
    )
}
"""A tool, rig, site or user is changed by a newer record of the same key; the others are never changed."""


def _items(validator: Any, items: Any, instance: Any, schema: Any) -> Iterator[Any]:
    """The keyword "items", without a validator for each number of a list of numbers: half the time of a reading."""
    from jsonschema import Draft202012Validator

    if items == {"type": "number"} and type(instance) is list and {*map(type, instance)} <= {float, int}:
        return
    yield from Draft202012Validator.VALIDATORS["items"](validator, items, instance, schema) or ()


@cache
def _validator(kind: str, version: int) -> Draft202012Validator:
    from jsonschema import Draft202012Validator
    from jsonschema.validators import extend

    name = f"{kind}-{version}.json"
    try:
        text = files("inclinometry.store").joinpath("schemas", name).read_text("utf-8")
    except FileNotFoundError:
        raise InputError(f"{kind} records of version {version} are not known; update inclinometry") from None
    made: Draft202012Validator = extend(Draft202012Validator, {"items": _items})(json.loads(text))  # type: ignore[no-untyped-call]
    return made


def check(kind: str, keys: Mapping[str, Any], body: Mapping[str, Any], version: int = VERSION) -> Kind:
    """The kind, when keys and body fit it.

    Raises
    ------
    InputError
        An unknown kind, keys that are missing, surplus or of the wrong type, a body that does not fit the schema of the
        kind; with the path of the value.

    Examples
    --------
    >>> check("tool", {"serial": "IN-7"}, {"name": "steering tool", "triads": {}}).unique
    ()
    """
    if kind not in KINDS:
        raise InputError(f"record kind is {kind!r}; allowed: {', '.join(KINDS)}")
    known = KINDS[kind]
    if set(keys) != set(known.keys):
        raise InputError(f"a {kind} record has the keys {', '.join(known.keys)}; given: {', '.join(keys) or 'none'}")
    for name, wanted in known.keys.items():
        value = keys[name]
        fits = plain(value) if wanted is str else (type(value) is int and value in INTEGERS)
        if not fits:
            must = "a text of 1 to 200 printable characters"
            must = must if wanted is str else f"a whole number, 0 to {INTEGERS[-1]}"
            raise InputError(f"{kind}.{name} is {_shown(value)}; it must be {must}")
    if type(version) is not int:
        raise InputError(f"the version of a {kind} record is {version!r:.60}; it must be a whole number")
    error = next(iter(_validator(kind, version).iter_errors(body)), None)
    if error is not None:
        where = "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in error.absolute_path)
        raise InputError(f"the body of a {kind} record does not fit: {kind}{where}: {error.message[:200]}")
    return known


def plain(text: object) -> bool:
    """Whether this is a text that both engines keep as it is: 1 to 200 printable characters, no blanks at its ends."""
    return isinstance(text, str) and 1 <= len(text) <= 200 and text.isprintable() and text == text.strip()


def _shown(value: object) -> str:
    if isinstance(value, int) and value.bit_length() > 64:
        return f"a number of {value.bit_length()} bits"
    return f"{value!r:.60}"
