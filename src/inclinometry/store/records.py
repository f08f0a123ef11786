"""What a ledger gives back and what it is given."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from sqlalchemy import (
    BigInteger,
    Column,
    ForeignKey,
    Integer,
    LargeBinary,
    MetaData,
    Table,
    Text,
    UniqueConstraint,
)

from inclinometry.core.errors import InputError
from inclinometry.store import chain
from inclinometry.store.engine import LedgerError

if TYPE_CHECKING:
    from jsonschema import Draft202012Validator

# The kinds of record a ledger holds: what they are found by, and what their body must contain.

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


# SQLite gives a rowid alias, which a range scan needs, to INTEGER only
_SEQ: Final = BigInteger().with_variant(Integer(), "sqlite")
METADATA: Final = MetaData()

CHAIN: Final = Table(
    "chain",
    METADATA,
    Column("seq", _SEQ, primary_key=True, autoincrement=False),
    Column("kind", Text, nullable=False),
    Column("record", Text, nullable=False, unique=True),
    Column("created", Text, nullable=False),
    Column("digest", Text, nullable=False),
    Column("link", Text, nullable=False),
)

DOCUMENT: Final = Table(
    "document",
    METADATA,
    Column("digest", Text, primary_key=True),
    Column("media_type", Text, nullable=False),
    Column("data", LargeBinary, nullable=False),
)
"""Files that records refer to by their SHA-256: certificates, uploaded logs."""


def _table(kind: Kind) -> Table:
    types = {str: Text, int: Integer}
    columns: list[Column[Any]] = [Column(name, types[wanted], nullable=False) for name, wanted in kind.keys.items()]
    extra = [UniqueConstraint(*kind.unique, name=f"uq_{kind.name}")] if kind.unique else []
    return Table(
        kind.name,
        METADATA,
        Column("seq", _SEQ, ForeignKey("chain.seq"), primary_key=True, autoincrement=False),
        Column("id", Text, nullable=False, unique=True),
        Column("created", Text, nullable=False),
        Column("author", Text, nullable=False),
        Column("version", Integer, nullable=False),
        *columns,
        Column("body", Text, nullable=False),
        *extra,
    )


TABLES: Final = {name: _table(kind) for name, kind in KINDS.items()}
"""Table of each kind of record."""


@dataclass(frozen=True)
class Record:
    """One record, as stored.

    kind, id, seq : what it is, its name, its place in the chain (from 1).
    created : UTC, ISO 8601 with microseconds.
    author : name of the user.
    version : of its schema.
    keys, body : what it is found by, and the rest.
    digest : SHA-256 of all of this.
    """

    kind: str
    id: str
    seq: int
    created: str
    author: str
    version: int
    keys: Mapping[str, Any]
    body: Mapping[str, Any]
    digest: str = field(default="", compare=False)


class Unless(NamedTuple):
    """What must not be in the ledger yet when something is recorded: a kind, keys as for `Ledger.find`, what to say."""

    kind: str
    keys: Mapping[str, Any]
    message: str


@dataclass(frozen=True)
class Draft:
    """A record to be appended: kind, keys and body, with the files it refers to (media type, bytes)."""

    kind: str
    keys: Mapping[str, Any]
    body: Mapping[str, Any]
    documents: Sequence[tuple[str, bytes]] = ()


def row_digest(kind: str, row: Any) -> str:
    """Digest of a row as it stands; "" when it holds what no record can (bytes in a text's place, broken UTF-8)."""
    keys = {name: getattr(row, name) for name in KINDS[kind].keys}
    try:
        return chain.record_digest(kind, row.id, row.created, row.author, row.version, keys, row.body)
    except InputError:
        return ""


def record_of(kind: str, row: Any) -> Record:
    """The record of a row that was read together with its digest in the chain.

    Raises
    ------
    LedgerError
        The row was changed after it was recorded: what is computed from records is computed from sound ones.
    """
    if row_digest(kind, row) != row.digest:
        raise LedgerError(
            f"{kind} {row.seq} ({row.id}) was changed behind the back of the ledger and is not used; "
            "run `inclinometry ledger verify`"
        )
    keys = {name: getattr(row, name) for name in KINDS[kind].keys}
    return Record(kind, row.id, row.seq, row.created, row.author, row.version, keys, json.loads(row.body), row.digest)
