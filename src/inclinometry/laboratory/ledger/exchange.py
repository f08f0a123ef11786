"""A whole ledger as one file: export and backup; `restore` reads an export."""

from __future__ import annotations

import heapq
import itertools
import json
import sqlite3
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from sqlalchemy import Select, func, select
from sqlalchemy.engine import Connection

from inclinometry.digest import digest_bytes
from inclinometry.errors import FileError, InputError, in_file, system_reason, wrong_kind
from inclinometry.files.writing import replacing
from inclinometry.findings import Finding
from inclinometry.laboratory.ledger import chain, engine
from inclinometry.laboratory.ledger.chain import LedgerError
from inclinometry.laboratory.ledger.ledger import LARGEST_DOCUMENT, Batch, Ledger, add_document
from inclinometry.opening import opened

Progress = Callable[[float], None]
FORMAT: Final = "inclinometry/ledger-export"
BLOCK: Final = 500
"""Records read or written at a time."""


def export(ledger: Ledger, path: str | Path, *, progress: Progress | None = None) -> chain.Head:
    """Write everything into one ZIP file: records.jsonl in order, documents/ by digest, manifest.json.

    Returns the head of the chain written; note it elsewhere.
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
        for found in connection.execution_options(yield_per=1).execute(engine.STORED):
            if not engine.as_stored(found.data, found.digest):
                raise LedgerError(chain.changed("document", found.digest))
            name = found.digest.removeprefix("sha256:")
            archive.writestr(f"documents/{name}", found.data)
            documents[name] = found.media_type
        manifest = {"format": FORMAT, "version": 1, "head": str(head), "documents": documents}
        archive.writestr("manifest.json", chain.compact(manifest))
    return head


def _rows(connection: Connection, progress: Progress | None) -> Iterator[dict[str, Any]]:
    """Records in order; only a few of each kind are in memory at a time."""
    last = connection.execute(select(func.max(engine.CHAIN.c.seq))).scalar()
    tables = {kind: select(table).order_by(table.c.seq) for kind, table in engine.TABLES.items()}
    streams = [zip(itertools.repeat(kind), _streamed(connection, query)) for kind, query in tables.items()]
    found = heapq.merge(*streams, key=lambda pair: pair[1].seq)
    for link in _streamed(connection, select(engine.CHAIN).order_by(engine.CHAIN.c.seq)):
        kind, row = next(found, ("", None))
        if row is None or (kind, row.id) != (link.kind, link.record) or engine.row_digest(kind, row) != link.digest:
            raise LedgerError(chain.changed("chain", link.seq))
        about = {name: getattr(row, name) for name in ("id", "created", "author", "version", "body")}
        keys = {name: getattr(row, name) for name in engine.KINDS[kind].keys}
        yield {**about, "seq": link.seq, "kind": kind, "keys": keys, "digest": link.digest, "link": link.link}
        if progress is not None and link.seq % BLOCK == 0:
            progress(min(1.0, link.seq / last))


def _streamed(connection: Connection, query: Select[Any]) -> Iterator[Any]:
    yield from connection.execution_options(yield_per=BLOCK).execute(query)


def backup(ledger: Ledger, path: str | Path) -> None:
    """Copy a SQLite ledger, as it is now, into a new file that is a ledger itself; PostgreSQL has its own backup."""
    if "://" in ledger.where:
        raise LedgerError(Finding("ledger-backup-server"))
    if Path(path).exists():
        raise FileError(Finding("file-unwritable", {"reason": "it exists already"}), path=path)
    with replacing(path) as stream:
        try:  # SQLite writes into the file by its name
            with closing(sqlite3.connect(ledger.where)) as source, closing(sqlite3.connect(stream.name)) as target:
                source.backup(target)
        except sqlite3.Error as error:
            raise FileError(engine.refusal(str(path), error), path=path) from None


# Reading an export into an empty ledger: everything is checked, nothing in the file is trusted.

_CHANGED: Final = Finding("ledger-export-changed")
_LONGEST_LINE: Final = 60_000_000
"""Of a line of records.jsonl, bytes: a body of the greatest length with every character escaped or of many bytes."""


def restore(ledger: Ledger, path: str | Path, *, progress: Progress | None = None) -> chain.Head:
    """Read an export into an empty ledger; every digest and link is checked, all is recorded or nothing."""
    try:
        with opened(path) as export, zipfile.ZipFile(export) as archive:
            manifest = _manifest(archive, path)
            with ledger.filling() as connection:
                batch = Batch(connection, chain.Head(0, chain.GENESIS))
                with archive.open("records.jsonl") as lines:
                    for number, line in enumerate(iter(lambda: lines.readline(_LONGEST_LINE), b""), start=1):
                        _add(batch, line, number, path)
                        if number % BLOCK == 0:
                            batch.write()
                            if progress is not None:
                                progress(min(1.0, number / max(manifest["seq"], 1)))
                batch.write()
                if str(batch.head) != manifest["head"]:
                    raise FileError(_CHANGED, path=path)
                for name, media_type in manifest["documents"].items():
                    with archive.open(f"documents/{name}") as stream:
                        data = stream.read(LARGEST_DOCUMENT + 1)
                    if digest_bytes(data) != f"sha256:{name}" or not engine.plain(media_type):
                        raise FileError(_CHANGED, path=path)
                    add_document(connection, media_type, data)
    except (
        zipfile.BadZipFile, zipfile.LargeZipFile, zlib.error, KeyError, EOFError, NotImplementedError, RuntimeError,
    ) as error:  # fmt: skip
        raise FileError(Finding("file-format", {"format": "ZIP", "reason": str(error)}), path=path) from None
    except OSError as error:
        reason = system_reason(error)
        raise FileError(Finding("file-unreadable", {"reason": reason}), path=path) from None
    return batch.head


def _manifest(archive: zipfile.ZipFile, path: str | Path) -> dict[str, Any]:
    # times its size that an export may swell; digests, which do not shrink, keep true ones below 20
    most_swelling = 200
    packed = sum(entry.compress_size for entry in archive.infolist())
    if sum(entry.file_size for entry in archive.infolist()) > most_swelling * packed + 1_000_000:
        raise FileError(_CHANGED, path=path)
    with archive.open("manifest.json") as stream:
        try:
            content = json.loads(stream.read(_LONGEST_LINE))
            head = chain.parse_head(content["head"])
            right = content["format"] == FORMAT and isinstance(content["documents"], dict)
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
            right = False
    if not right:
        about = {"expected": "ledger export", "command": "inclinometry ledger export FILE"}
        raise FileError(Finding("ledger-other-file", about), path=path)
    if content["version"] != 1:
        version = f"{content['version']!r:.20}"
        raise FileError(Finding("file-version", {"format": FORMAT, "version": version, "known": ("1",)}), path=path)
    return {"head": str(head), "seq": head.seq, "documents": content["documents"]}


def _add(batch: Batch, line: bytes, number: int, path: str | Path) -> None:
    """Add the record of a line, when it is the one that comes next."""
    try:
        row = json.loads(line)
        _fit(row, line)
        made = batch.add(*(row[name] for name in ("kind", "id", "created", "author", "version", "keys", "body")))
    except InputError as error:
        raise in_file(error, path, number) from None
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        about = {"format": "JSON", "reason": " ".join(str(error).split())[:300]}
        raise FileError(Finding("file-format", about), path=path, line=number) from None
    if (made.seq, made.digest, batch.head.link) != (row["seq"], row["digest"], row["link"]):
        raise FileError(_CHANGED, path=path, line=number)


def _fit(row: Mapping[str, Any], line: bytes) -> None:
    """Refuse what `export` never writes, doubled keys and other spellings of the same content among it."""
    fields = {"seq", "kind", "id", "created", "author", "version", "keys", "body", "digest", "link"}
    if set(row) != fields:
        raise InputError(_CHANGED)
    for name in ("id", "author", "created"):
        if not engine.plain(row[name]):
            raise engine.no_text(name, row[name])
    created = datetime.fromisoformat(row["created"])
    if created.utcoffset() is None or created.astimezone(UTC).isoformat(timespec="microseconds") != row["created"]:
        raise wrong_kind("created", f"{row['created']!r:.60}", "date and time")
    if type(row["seq"]) is not int or not isinstance(row["body"], str):
        raise InputError(_CHANGED)
    body = json.loads(row["body"])
    if chain.compact(body) != row["body"] or chain.compact(row).encode() != line.removesuffix(b"\n"):
        raise InputError(_CHANGED)
    engine.check(row["kind"], row["keys"], body, row["version"])
