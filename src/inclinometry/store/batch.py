"""Writing records: checked, given their place in the chain, put into the tables many at a time."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Final

from sqlalchemy import select
from sqlalchemy.engine import Connection

from inclinometry.core.digest import digest_bytes
from inclinometry.core.errors import InputError
from inclinometry.store import chain
from inclinometry.store.records import CHAIN, DOCUMENT, TABLES, Draft, Record, check, plain

LONGEST_BODY: Final = 20_000_000
LARGEST_DOCUMENT: Final = 100_000_000


class Batch:
    """Records on their way into the tables, linked to what is there; written many at a time."""

    def __init__(self, connection: Connection, head: chain.Head) -> None:
        self.head = head
        self._connection = connection
        self._links: list[dict[str, Any]] = []
        self._rows: dict[str, list[dict[str, Any]]] = {}

    def add(
        self, kind: str, name: str, created: str, author: str, version: int, keys: Mapping[str, Any], body: str
    ) -> Record:
        """The record that comes next."""
        seq = self.head.seq + 1
        digest = chain.record_digest(kind, name, created, author, version, keys, body)
        link = chain.next_link(self.head.link, seq, kind, name, created, digest)
        self._links.append(
            {"seq": seq, "kind": kind, "record": name, "created": created, "digest": digest, "link": link}
        )
        row = {"seq": seq, "id": name, "created": created, "author": author, "version": version, **keys, "body": body}
        self._rows.setdefault(kind, []).append(row)
        self.head = chain.Head(seq, link)
        return Record(kind, name, seq, created, author, version, dict(keys), json.loads(body), digest)

    def write(self) -> None:
        """Write what was added: links first, the other tables refer to them."""
        if self._links:
            self._connection.execute(CHAIN.insert(), self._links)
        for kind, rows in self._rows.items():
            self._connection.execute(TABLES[kind].insert(), rows)
        self._links, self._rows = [], {}


def add_document(connection: Connection, media_type: str, data: bytes) -> str:
    """Keep a file, unless it is there already; its digest."""
    key = digest_bytes(data)
    if connection.execute(select(DOCUMENT.c.digest).where(DOCUMENT.c.digest == key)).first() is None:
        connection.execute(DOCUMENT.insert().values(digest=key, media_type=media_type, data=data))
    return key


def body_text(draft: Draft) -> str:
    """The text to be stored of a draft that fits its kind."""
    check(draft.kind, draft.keys, draft.body)
    body = chain.compact(dict(draft.body))
    if len(body) > LONGEST_BODY:
        raise InputError(f"a {draft.kind} record of {len(body)} characters; allowed {LONGEST_BODY}")
    for media_type, data in draft.documents:
        if not plain(media_type):
            raise InputError(f"the media type of a document is {media_type!r:.60}; e.g. application/pdf")
        if len(data) > LARGEST_DOCUMENT:
            raise InputError(f"a document ({media_type}) of {len(data)} bytes; allowed {LARGEST_DOCUMENT}")
    return body
