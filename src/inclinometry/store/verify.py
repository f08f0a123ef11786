"""Does the ledger still say what was recorded? Every row against its digest, every link against the one before."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import func, select
from sqlalchemy.engine import Connection

from inclinometry.core.digest import digest_bytes
from inclinometry.store import chain
from inclinometry.store.kinds import KINDS
from inclinometry.store.ledger import Ledger
from inclinometry.store.schema import CHAIN, DOCUMENT, TABLES, unprotected

Progress = Callable[[float], None]
BLOCK: Final = 5000
MOST_FAULTS: Final = 100
"""So many faults are listed; what lies beyond is not read."""


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong: table, row (its place and id), and in words what happened to it."""

    table: str
    row: str
    problem: str

    def __str__(self) -> str:
        return f"{self.table} {self.row}: {self.problem}"


@dataclass(frozen=True)
class Verdict:
    """What a verification found: how many records and documents were read, the head, the faults."""

    records: int
    documents: int
    head: chain.Head
    faults: tuple[Fault, ...]

    @property
    def ok(self) -> bool:
        """Whether nothing was found."""
        return not self.faults


def verify(ledger: Ledger, *, head: chain.Head | None = None, progress: Progress | None = None) -> Verdict:
    """Read the whole ledger and name every row that was changed, removed, inserted or moved.

    Parameters
    ----------
    ledger : Ledger
    head : Head, optional
        A head noted earlier (every certificate carries one). Without it records removed from the end leave no trace.
    progress : callable, optional
        Called with the share done, 0 to 1.

    Notes
    -----
    It proves that nobody changed the ledger who did not also recompute every later link; the heads on certificates in
    other hands prove it for those, too.
    """
    with ledger.snapshot() as connection:
        faults = [Fault(name, "-", "the triggers that forbid changes are missing") for name in unprotected(connection)]
        walk = _Walk(head)
        last = connection.execute(select(func.max(CHAIN.c.seq))).scalar() or 0
        for start in range(0, last, BLOCK):
            faults.extend(walk.block(connection, start))
            if len(faults) >= MOST_FAULTS:
                break
            if progress is not None:
                progress(min(1.0, (start + BLOCK) / last))
        faults.extend(walk.end())
        faults.extend(_strays(connection))
        documents = connection.execute(select(func.count()).select_from(DOCUMENT)).scalar_one()
        faults.extend(_documents(connection))
    return Verdict(walk.records, documents, chain.Head(walk.seq, walk.link), tuple(faults[:MOST_FAULTS]))


class _Walk:
    """Along the chain, from the first link to the last."""

    def __init__(self, head: chain.Head | None) -> None:
        self.seq, self.link, self.records = 0, chain.GENESIS, 0
        self._noted, self._met = head, head is None or head.seq == 0

    def block(self, connection: Connection, start: int) -> Iterator[Fault]:
        """Faults of the links beyond `start`."""
        inside = (CHAIN.c.seq > start) & (CHAIN.c.seq <= start + BLOCK)
        links = connection.execute(select(CHAIN).where(inside).order_by(CHAIN.c.seq)).all()
        rows: dict[tuple[str, int], Any] = {}
        for kind, table in TABLES.items():
            chosen = select(table).where((table.c.seq > start) & (table.c.seq <= start + BLOCK))
            rows.update({(kind, row.seq): row for row in connection.execute(chosen)})
        for link in links:
            yield from self._step(link, rows.get((link.kind, link.seq)))

    def _step(self, link: Any, row: Any) -> Iterator[Fault]:
        where = f"{link.seq} ({link.record})"
        if link.seq != self.seq + 1:
            lost = f"{self.seq + 1}" if link.seq == self.seq + 2 else f"{self.seq + 1} to {link.seq - 1}"
            yield Fault("chain", lost, "removed: the numbers of the chain have a gap")
        elif link.link != chain.next_link(self.link, link.seq, link.kind, link.record, link.created, link.digest):
            yield Fault("chain", where, "this link does not follow from the one before: changed or moved")
        self.seq, self.link, self.records = link.seq, link.link, self.records + 1
        if self._noted is not None and link.seq == self._noted.seq:
            self._met = True
            if link.link != self._noted.link:
                yield Fault("chain", where, "is not the head noted earlier: the ledger was rewritten")
        if row is None:
            yield Fault(link.kind, where, "removed: the chain has it, the table has not")
        elif row.id != link.record:
            yield Fault(link.kind, where, f"another record ({row.id}) stands in its place")
        elif _digest(link.kind, row) != link.digest or row.created != link.created:
            yield Fault(link.kind, where, "its content was changed after it was recorded")

    def end(self) -> Iterator[Fault]:
        """The fault of a chain that ends before the head noted earlier."""
        if not self._met and self._noted is not None and self.seq < self._noted.seq:
            lost = f"{self.seq + 1} to {self._noted.seq}"
            yield Fault("chain", lost, "removed: the ledger ends before the head noted earlier")


def _digest(kind: str, row: Any) -> str:
    keys = {name: getattr(row, name) for name in KINDS[kind].keys}
    return chain.record_digest(kind, row.id, row.created, row.author, row.version, keys, row.body)


def _strays(connection: Connection) -> Iterator[Fault]:
    """Rows that no link of the chain speaks of."""
    for kind, table in TABLES.items():
        known = select(CHAIN.c.seq).where((CHAIN.c.seq == table.c.seq) & (CHAIN.c.kind == kind)).exists()
        for row in connection.execute(select(table.c.seq, table.c.id).where(~known).limit(MOST_FAULTS)):
            yield Fault(kind, f"{row.seq} ({row.id})", "inserted: the chain has no such record")


def _documents(connection: Connection) -> Iterator[Fault]:
    """Files whose bytes changed, and files that certificates refer to and that are gone."""
    have = set()
    for row in connection.execution_options(yield_per=20).execute(select(DOCUMENT.c.digest, DOCUMENT.c.data)):
        have.add(row.digest)
        if digest_bytes(row.data) != row.digest:
            yield Fault("document", row.digest, "its bytes were changed")
    table = TABLES["certificate"]
    for row in connection.execution_options(yield_per=500).execute(select(table.c.number, table.c.body)):
        for digest in referred(row.body):
            if digest not in have:
                yield Fault("document", digest, f"removed: certificate {row.number} refers to it")


def referred(body: str) -> list[str]:
    """Digests of the documents that the stored body of a certificate refers to; none where it cannot be read."""
    try:
        documents = json.loads(body).get("documents", {})
    except (ValueError, AttributeError):
        return []
    return [str(digest) for digest in documents.values()] if isinstance(documents, dict) else []
