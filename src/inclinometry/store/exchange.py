"""A whole ledger as one file: export and backup; `restore` reads an export."""

from __future__ import annotations

import heapq
import sqlite3
import zipfile
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, Final

from sqlalchemy import Select, func, select
from sqlalchemy.engine import Connection

from inclinometry.core.errors import FileError
from inclinometry.io.atomic import replacing
from inclinometry.store import chain
from inclinometry.store.engine import LedgerError
from inclinometry.store.kinds import KINDS
from inclinometry.store.ledger import Ledger
from inclinometry.store.records import row_digest
from inclinometry.store.schema import CHAIN, DOCUMENT, TABLES

Progress = Callable[[float], None]
FORMAT: Final = "inclinometry/ledger-export"
VERSION: Final = 1
BLOCK: Final = 500
"""Records read or written at a time."""


def export(ledger: Ledger, path: str | Path, *, progress: Progress | None = None) -> chain.Head:
    """Write everything into one ZIP file: records.jsonl in order, documents/ by digest, manifest.json.

    Returns
    -------
    Head
        Of the chain written; note it elsewhere.
    """
    head, documents = chain.Head(0, chain.GENESIS), {}
    with (
        ledger.snapshot() as connection,
        replacing(path) as stream,
        zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=3) as archive,
    ):
        with archive.open("records.jsonl", "w", force_zip64=True) as lines:
            for row in _rows(connection, progress):
                lines.write(chain.compact(row).encode("utf-8") + b"\n")
                head = chain.Head(row["seq"], row["link"])
        for found in connection.execution_options(yield_per=1).execute(select(DOCUMENT)):
            name = found.digest.removeprefix("sha256:")
            archive.writestr(f"documents/{name}", found.data)
            documents[name] = found.media_type
        manifest = {"format": FORMAT, "version": VERSION, "head": str(head), "documents": documents}
        archive.writestr("manifest.json", chain.compact(manifest))
    return head


def _rows(connection: Connection, progress: Progress | None) -> Iterator[dict[str, Any]]:
    """Records in order; only a few of each kind are in memory at a time."""
    last = connection.execute(select(func.max(CHAIN.c.seq))).scalar() or 0
    found = heapq.merge(*(_stream(connection, kind) for kind in TABLES), key=lambda pair: pair[1].seq)
    for link in _streamed(connection, select(CHAIN).order_by(CHAIN.c.seq)):
        kind, row = next(found, ("", None))
        if row is None or (kind, row.id) != (link.kind, link.record) or row_digest(kind, row) != link.digest:
            raise LedgerError(
                f"{link.kind} {link.seq} is missing or was changed; run `inclinometry ledger verify`, "
                "nothing was exported"
            )
        yield {
            "seq": link.seq,
            "kind": kind,
            "id": row.id,
            "created": row.created,
            "author": row.author,
            "version": row.version,
            "keys": {name: getattr(row, name) for name in KINDS[kind].keys},
            "body": row.body,
            "digest": link.digest,
            "link": link.link,
        }
        if progress is not None and link.seq % BLOCK == 0:
            progress(min(1.0, link.seq / last))


def _stream(connection: Connection, kind: str) -> Iterator[tuple[str, Any]]:
    for row in _streamed(connection, select(TABLES[kind]).order_by(TABLES[kind].c.seq)):
        yield kind, row


def _streamed(connection: Connection, query: Select[Any]) -> Iterator[Any]:
    yield from connection.execution_options(yield_per=BLOCK).execute(query)


def backup(ledger: Ledger, path: str | Path) -> None:
    """Copy a SQLite ledger, as it is at this moment, into a new file that is a ledger itself.

    Raises
    ------
    LedgerError
        A ledger on PostgreSQL: use the server's own backup, or `export`.
    FileError
        The file is there already, or cannot be written.
    """
    if "://" in ledger.where:
        raise LedgerError(
            "this ledger is kept by a PostgreSQL server; use its own backup, or `inclinometry ledger export`"
        )
    if Path(path).exists():
        raise FileError("is there already; a backup never replaces one", path=path)
    with replacing(path) as stream:
        try:  # SQLite writes into the file by its name
            with closing(sqlite3.connect(ledger.where)) as source, closing(sqlite3.connect(stream.name)) as target:
                source.backup(target)
        except sqlite3.Error as error:
            raise FileError(f"the backup cannot be written ({error})", path=path) from None
