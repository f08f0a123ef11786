"""The hash chain: each record's digest covers its content, each link covers the record and all before it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from inclinometry.errors import InputError
from inclinometry.findings import Finding

GENESIS: Final = "0" * 64
"""The link before the first record."""


class LedgerError(InputError):
    """The ledger refuses, or cannot be used: what happened and what to do."""


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
        raise InputError(f"{text!r:.80} is not the head of a ledger; expected NUMBER:64 hexadecimal digits")
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
        raise InputError(f"the content cannot be recorded: {error}") from None
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
