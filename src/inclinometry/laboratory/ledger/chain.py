"""The hash chain: each record's digest covers its content, each link covers the record and all before it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from inclinometry.errors import InputError, out_of_range, refused
from inclinometry.findings import Finding, Value

GENESIS: Final = "0" * 64
"""The link before the first record."""


class LedgerError(InputError):
    """The ledger refuses, or cannot be used: what happened and what to do."""


def changed(kind: str, record: object) -> Finding:
    """That a record of a ledger, or part of one, is no longer what was recorded."""
    return Finding("ledger-changed", {"kind": kind, "record": f"{record!s:.100}"})


def invisible(name: str, text: str, character: str) -> InputError:
    """The error of a text with a character that no page shows."""
    about: dict[str, Value] = {"name": name, "character": f"U+{ord(character):04X}", "place": text.index(character) + 1}
    return refused("ledger-invisible", about)


def missing(kind: str, name: object, ledger: str) -> Finding:
    """That a ledger holds no such record."""
    return Finding("ledger-not-there", {"kind": kind, "name": f"{name!r:.60}", "ledger": ledger}, severity="refused")


class Head(NamedTuple):
    """The last link: how many records there are and what they all were. Print it, and a lost tail is noticed."""

    seq: int
    link: str

    def __str__(self) -> str:
        return f"{self.seq}:{self.link}"


def parse_head(text: str) -> Head:
    """A head as `str(head)` prints it.

    >>> parse_head("0:" + GENESIS).seq
    0
    """
    seq, _, link = text.strip().partition(":")
    if not seq.isascii() or not seq.isdigit() or len(link) != 64 or set(link) - set("0123456789abcdef"):
        raise out_of_range("head", f"{text!r:.80}", "N:[0-9a-f]{64}")
    return Head(int(seq), link)


def compact(content: Any) -> str:
    """JSON text that depends on the content alone: keys sorted, no blanks, shortest decimals; NaN refused.

    >>> compact({"b": 1.0, "a": [True, None]})
    '{"a":[true,null],"b":1.0}'
    """
    try:
        text = json.dumps(content, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
        text.encode("utf-8")
    except (TypeError, ValueError, RecursionError) as error:
        raise refused("input-field", {"name": "JSON", "value": type(content).__name__, "reason": str(error)}) from None
    return text


def record_digest(
    kind: str, record: str, created: str, author: str, version: int, keys: Mapping[str, Any], body: str
) -> str:
    """SHA-256 of a record's content, 64 hexadecimal digits; `body` is the stored text itself."""
    content = [kind, record, created, author, version, dict(keys), body]
    return hashlib.sha256(compact(content).encode("utf-8")).hexdigest()


def leaf(seq: int, kind: str, record: str, created: str, digest: str) -> bytes:
    """What a record is in the tree of RFC 6962: its entry in the chain, without the link, which the tree replaces."""
    return "\n".join([str(seq), kind, record, created, digest]).encode("utf-8")


def next_link(previous: str, seq: int, kind: str, record: str, created: str, digest: str) -> str:
    """The link that binds a record to everything before it."""
    return hashlib.sha256("\n".join([previous, str(seq), kind, record, created, digest]).encode("utf-8")).hexdigest()
