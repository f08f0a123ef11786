"""What a ledger gives back and what it is given."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from inclinometry.core.errors import InputError
from inclinometry.store import chain
from inclinometry.store.engine import LedgerError
from inclinometry.store.kinds import KINDS


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
