"""Does the ledger still say what was recorded? Every row against its digest, every link against the one before."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final, cast

from sqlalchemy import func, select
from sqlalchemy.engine import Connection

from inclinometry.findings import Finding
from inclinometry.laboratory.ledger import chain
from inclinometry.laboratory.ledger.engine import (
    CHAIN,
    DOCUMENT,
    MEDIA,
    STORED,
    TABLES,
    as_stored,
    foreign_triggers,
    row_digest,
    unprotected,
)
from inclinometry.laboratory.ledger.heads import SignedHead
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.ledger.signatures import Signatures, collect_heads, lost

Progress = Callable[[float], None]
MOST_FAULTS: Final = 100
"""So many faults are listed; what lies beyond is not read."""


@dataclass(frozen=True)
class Verdict:
    """What a verification found; records and documents are how many were read.

    signed : the last signed head; None where the ledger is not signed.
    findings : of signatures, witnesses, acceptances.
    silent : of named witnesses that did not answer: what only they know is not found out.
    strange : another key than the one here signed it, another laboratory's or anyone's.
    compared : the public key here with the private one; None where there is none, or a key was given.
    """

    records: int
    documents: int
    head: chain.Head
    faults: tuple[Finding, ...]
    signed: SignedHead | None = None
    findings: tuple[Finding, ...] = ()
    silent: tuple[Finding, ...] = ()
    strange: bool = False
    compared: bool | None = None

    @property
    def ok(self) -> bool:
        """Whether nothing was found."""
        return not self.faults

    @property
    def proven(self) -> bool:
        """Whether nothing was found, every witness that was named answered, and a known key signed it.

        A public key that was not compared with the private one beside it is not known.
        """
        return self.signed is not None and self.unsuspected and self.compared is not False

    @property
    def unsuspected(self) -> bool:
        """The same, and also with a key that was not compared, and of a ledger that is not signed and that nothing here
        knows as a signed one.
        """
        return not self.faults and not self.silent and not self.strange


def verify(
    ledger: Ledger,
    *,
    head: chain.Head | None = None,
    public: Sequence[str] = (),
    copy: bool = False,
    progress: Progress | None = None,
) -> Verdict:
    """Read the whole ledger and name every row that was changed, removed, inserted or moved.

    head : noted earlier (every certificate carries one). public : keys of the laboratory, 64 hexadecimal digits, that
        of now first; those of this computer when empty. copy : one kept on purpose; that the ledger went on since is a
        note, no fault. progress : called with the share done, 0 to 1.

    The chain proves that no one changed the ledger who did not also recompute every later link; the signed heads, that
    no one did who has not the laboratory's key; the heads that witnesses keep, that nothing was cut off its end and no
    older copy put in its place, by anyone who cannot write to all of them.
    """
    witnesses = collect_heads(ledger)
    with ledger.snapshot() as connection, _any_text(connection):
        triggers = [*unprotected(connection), *foreign_triggers(connection)]
        faults = [Finding("ledger-unprotected", {"names": tuple(triggers)})] if triggers else []
        faults += _structure(connection, ledger.shown)
        signatures = Signatures(connection, ledger, public, *witnesses, copy=copy)
        walk = _Walk(head, signatures)
        last = connection.execute(select(func.count()).select_from(CHAIN)).scalar_one()
        while len(faults) < MOST_FAULTS and (found := walk.block(connection)) is not None:
            faults += found
            if progress is not None:
                progress(min(1.0, walk.records / max(last, 1)))
        faults += walk.end()
        found, notes = signatures.end(walk.seq)
        faults += found
        faults += _strays(connection)
        documents = connection.execute(select(func.count()).select_from(DOCUMENT)).scalar_one()
        faults += _documents(connection)
    # to sign it is no remedy where something is wrong with it
    if signatures.newest is None and not faults and witnesses[2] is None:
        notes.insert(0, Finding("ledger-unsigned", {"ledger": ledger.shown}, severity="note"))
    head = chain.Head(walk.seq, walk.link)
    shown, silent = tuple(faults[:MOST_FAULTS]), tuple(witnesses[1][1])
    return Verdict(
        walk.records,
        documents,
        head,
        shown,
        signatures.newest,
        tuple(notes),
        silent,
        signatures.strange,
        signatures.compared,
    )


@contextmanager
def _any_text(connection: Connection) -> Iterator[None]:
    """Let SQLite hand over texts that are no longer UTF-8, so that their row can be named."""
    if connection.dialect.name != "sqlite":
        yield
        return
    raw = cast(sqlite3.Connection, connection.connection.driver_connection)
    raw.text_factory = lambda data: data.decode("utf-8", "surrogateescape")
    try:
        yield
    finally:
        raw.text_factory = str


def _structure(connection: Connection, where: str) -> list[Finding]:
    """What SQLite finds wrong with its file: pages, and indexes that hide rows or show others."""
    if connection.dialect.name != "sqlite":
        return []
    said = connection.exec_driver_sql(f"PRAGMA integrity_check({MOST_FAULTS})").scalars().all()
    causes = (f"{text:.200}" for text in said if text != "ok")
    return [Finding("ledger-damaged", {"ledger": where, "cause": cause}) for cause in causes]


class _Walk:
    """Along the chain, from the first link to the last."""

    def __init__(self, head: chain.Head | None, signatures: Signatures) -> None:
        self._signatures = signatures
        self.seq, self.link, self.records = 0, chain.GENESIS, 0
        # no place in the chain is before minus this
        self._at = -(2**63 - 1)
        self._noted, self._met = head, head is None or head.seq == 0

    def block(self, connection: Connection) -> list[Finding] | None:
        """Faults of the next links; None when there are no more."""
        block = 500
        query = select(CHAIN).where(CHAIN.c.seq > self._at).order_by(CHAIN.c.seq).limit(block)
        links = connection.execute(query).all()
        if not links:
            return None
        start, self._at = self._at, links[-1].seq
        rows: dict[tuple[str, int], Any] = {}
        for kind, table in TABLES.items():
            chosen = select(table).where((table.c.seq > start) & (table.c.seq <= self._at))
            rows.update({(kind, row.seq): row for row in connection.execute(chosen)})
        return [fault for link in links for fault in self._step(link, rows.get((link.kind, link.seq)))]

    def _step(self, link: Any, row: Any) -> Iterator[Finding]:
        where, kind = f"{link.seq} ({link.record})", link.kind if link.kind in TABLES else "chain"
        if link.seq != self.seq + 1:
            if link.seq > self.seq:
                yield lost("ledger-removed", "chain", self.seq + 1, link.seq - 1)
            else:  # records begin with 1
                yield Finding("ledger-inserted", {"kind": "chain", "record": where})
        elif link.link != _next(self.link, link):
            yield chain.changed("chain", where)
        self.seq, self.link, self.records = link.seq, link.link, self.records + 1
        if self._noted is not None and link.seq == self._noted.seq:
            self._met = True
            if link.link != self._noted.link:
                yield Finding("ledger-rewritten", {"record": link.seq, "place": "--head"})
        self._signatures.step(link, row)
        if row is None:
            yield Finding("ledger-removed", {"kind": kind, "record": where})
        elif row.id != link.record or row_digest(link.kind, row) != link.digest or row.created != link.created:
            yield chain.changed(kind, where)

    def end(self) -> Iterator[Finding]:
        """The fault of a chain that ends before the head noted earlier."""
        if not self._met and self._noted is not None and self.seq < self._noted.seq:
            yield lost("ledger-removed", "chain", self.seq + 1, self._noted.seq)


def _next(previous: str, link: Any) -> str:
    try:
        return chain.next_link(previous, link.seq, link.kind, link.record, link.created, link.digest)
    except (TypeError, UnicodeEncodeError):  # bytes in a text's place, broken UTF-8
        return ""


def _strays(connection: Connection) -> Iterator[Finding]:
    """Rows that no link of the chain speaks of."""
    for kind, table in TABLES.items():
        known = select(CHAIN.c.seq).where((CHAIN.c.seq == table.c.seq) & (CHAIN.c.kind == kind)).exists()
        for row in connection.execute(select(table.c.seq, table.c.id).where(~known).limit(MOST_FAULTS)):
            yield Finding("ledger-inserted", {"kind": kind, "record": f"{row.seq} ({row.id})"})


def _documents(connection: Connection) -> Iterator[Finding]:
    """Files whose bytes or media type changed, and files that records refer to and that are gone."""
    # how documents of a certificate begin; older ledgers may hold others, of which nothing was said
    begins = {"application/pdf": b"%PDF-", "application/xml": b"<", "application/json": b"{"}
    have: dict[str, tuple[str, bytes]] = {}
    for row in connection.execution_options(yield_per=1).execute(STORED):
        have[row.digest] = row.media_type, row.data[:5] if isinstance(row.data, bytes) else b""
        if not as_stored(row.data, row.digest):
            yield chain.changed("document", row.digest)
    for digest, media_type in _referred(connection):
        if digest not in have:
            yield Finding("ledger-removed", {"kind": "document", "record": f"{digest:.100}"})
            continue
        found, data = have[digest]
        # the bytes are bound by their digest, what they are by the record that refers to them
        if media_type not in (None, found) and data.startswith(begins.get(str(media_type), b"")):
            yield chain.changed("document", digest)


def _referred(connection: Connection) -> Iterator[tuple[str, str | None]]:
    """Digest and media type of each document that a record refers to; none where it cannot be read."""
    table, event = TABLES["certificate"], TABLES["event"]
    for row in connection.execution_options(yield_per=500).execute(select(table.c.body)):
        documents = _body(row.body).get("documents")
        for name, digest in documents.items() if isinstance(documents, dict) else ():
            yield str(digest), MEDIA.get(name)
    logos = select(event.c.body).where(event.c.subject_kind == "laboratory")
    for row in connection.execution_options(yield_per=500).execute(logos):
        details = _body(row.body).get("details")
        logo = details.get("logo") if isinstance(details, dict) else None
        if isinstance(logo, dict):
            yield str(logo.get("digest")), str(logo.get("media_type"))


def _body(text: str) -> dict[str, Any]:
    """The stored body of a record; empty where it was changed into something else, which is a fault of its own."""
    try:
        content = json.loads(text)
    except (ValueError, TypeError, RecursionError):
        return {}
    return content if isinstance(content, dict) else {}
