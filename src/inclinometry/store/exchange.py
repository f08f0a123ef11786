"""A whole ledger as one file: export, import into an empty ledger, backup."""

from __future__ import annotations

import json
import sqlite3
import zipfile
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, Final

from sqlalchemy import func, select
from sqlalchemy.engine import Connection

from inclinometry.core.digest import digest_bytes
from inclinometry.core.errors import FileError
from inclinometry.io.atomic import replacing
from inclinometry.store import chain
from inclinometry.store.kinds import KINDS, check
from inclinometry.store.ledger import LARGEST_DOCUMENT, Ledger, LedgerError
from inclinometry.store.schema import CHAIN, DOCUMENT, TABLES
from inclinometry.store.verify import BLOCK

Progress = Callable[[float], None]
FORMAT: Final = "inclinometry/ledger-export"
VERSION: Final = 1
_LONGEST_LINE: Final = 25_000_000
_FIELDS: Final = {"seq", "kind", "id", "created", "author", "version", "keys", "body", "digest", "link"}


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
        for found in connection.execution_options(yield_per=20).execute(select(DOCUMENT)):
            name = found.digest.removeprefix("sha256:")
            archive.writestr(f"documents/{name}", found.data)
            documents[name] = found.media_type
        manifest = {"format": FORMAT, "version": VERSION, "head": str(head), "documents": documents}
        archive.writestr("manifest.json", chain.compact(manifest))
    return head


def _rows(connection: Connection, progress: Progress | None) -> Iterator[dict[str, Any]]:
    last = connection.execute(select(func.max(CHAIN.c.seq))).scalar() or 0
    for start in range(0, last, BLOCK):
        links = {}
        for row in connection.execute(select(CHAIN).where((CHAIN.c.seq > start) & (CHAIN.c.seq <= start + BLOCK))):
            links[row.seq] = row
        found = {}
        for kind, table in TABLES.items():
            for row in connection.execute(select(table).where((table.c.seq > start) & (table.c.seq <= start + BLOCK))):
                found[row.seq] = (kind, row)
        for seq in sorted(links):
            if seq not in found:
                raise LedgerError(f"record {seq} is missing; run `inclinometry ledger verify`, nothing was exported")
            kind, row = found[seq]
            yield {
                "seq": seq,
                "kind": kind,
                "id": row.id,
                "created": row.created,
                "author": row.author,
                "version": row.version,
                "keys": {name: getattr(row, name) for name in KINDS[kind].keys},
                "body": row.body,
                "digest": links[seq].digest,
                "link": links[seq].link,
            }
        if progress is not None:
            progress(min(1.0, (start + BLOCK) / last))


def restore(ledger: Ledger, path: str | Path, *, progress: Progress | None = None) -> chain.Head:
    """Read an export into an empty ledger; every digest and link is checked, all is recorded or nothing.

    Raises
    ------
    FileError
        Not an export, damaged, changed; with the line.
    LedgerError
        The ledger is not empty.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            manifest = _manifest(archive, path)
            with ledger.filling() as connection:
                head = chain.Head(0, chain.GENESIS)
                with archive.open("records.jsonl") as lines:
                    for number, line in enumerate(iter(lambda: lines.readline(_LONGEST_LINE), b""), start=1):
                        head = _restore_line(connection, head, line, number, path)
                        if progress is not None and number % BLOCK == 0:
                            progress(min(1.0, head.seq / max(manifest["seq"], 1)))
                if str(head) != manifest["head"]:
                    raise FileError(f"ends at record {head.seq}; its manifest says {manifest['head'][:40]}", path=path)
                _restore_documents(connection, archive, manifest["documents"], path)
    except (zipfile.BadZipFile, KeyError, EOFError, zipfile.LargeZipFile, NotImplementedError) as error:
        raise FileError(f"not an export of a ledger, or damaged ({error})", path=path) from None
    except FileNotFoundError:
        raise FileError("there is no such file; check the name", path=path) from None
    except OSError as error:
        raise FileError(f"cannot be read ({error.strerror or error})", path=path) from None
    return head


def _manifest(archive: zipfile.ZipFile, path: str | Path) -> dict[str, Any]:
    with archive.open("manifest.json") as stream:
        try:
            content = json.loads(stream.read(_LONGEST_LINE))
            head = chain.parse_head(content["head"])
            right = content["format"] == FORMAT and isinstance(content["documents"], dict)
        except (ValueError, TypeError, KeyError):
            right = False
    if not right:
        raise FileError("not an export of a ledger: its manifest.json does not say so", path=path)
    if content["version"] != VERSION:
        raise FileError(f"an export of version {content['version']!r:.20}; this program reads {VERSION}", path=path)
    return {"head": content["head"], "seq": head.seq, "documents": content["documents"]}


def _restore_line(connection: Connection, head: chain.Head, line: bytes, number: int, path: str | Path) -> chain.Head:
    try:
        row = json.loads(line)
        if set(row) != _FIELDS or not isinstance(row["body"], str):
            raise ValueError("its fields are not those of a record")
        check(row["kind"], row["keys"], json.loads(row["body"]), row["version"])
        digest = chain.record_digest(
            row["kind"], row["id"], row["created"], row["author"], row["version"], row["keys"], row["body"]
        )
        link = chain.next_link(head.link, head.seq + 1, row["kind"], row["id"], row["created"], digest)
    except (ValueError, TypeError, KeyError) as error:
        raise FileError(f"not a record of a ledger ({error})", path=path, line=number) from None
    if row["seq"] != head.seq + 1 or digest != row["digest"] or link != row["link"]:
        raise FileError(
            f"{row['kind']} {row['seq']} does not follow from the records before it: the export was changed",
            path=path,
            line=number,
        )
    connection.execute(
        CHAIN.insert().values(
            seq=row["seq"], kind=row["kind"], record=row["id"], created=row["created"], digest=digest, link=link
        )
    )
    common = {name: row[name] for name in ("seq", "id", "created", "author", "version", "body")}
    connection.execute(TABLES[row["kind"]].insert().values(**common, **row["keys"]))
    return chain.Head(row["seq"], link)


def _restore_documents(
    connection: Connection, archive: zipfile.ZipFile, documents: dict[str, Any], path: str | Path
) -> None:
    for name, media_type in documents.items():
        with archive.open(f"documents/{name}") as stream:
            data = stream.read(LARGEST_DOCUMENT + 1)
        digest = digest_bytes(data)
        if digest != f"sha256:{name}" or not isinstance(media_type, str):
            raise FileError(f"documents/{name:.80} was changed", path=path)
        connection.execute(DOCUMENT.insert().values(digest=digest, media_type=media_type, data=data))


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
        part = Path(stream.name + ".sqlite")
        try:
            with closing(sqlite3.connect(ledger.where)) as source, closing(sqlite3.connect(part)) as target:
                source.backup(target)
            with part.open("rb") as copied:
                while block := copied.read(1 << 20):
                    stream.write(block)
        except sqlite3.Error as error:
            raise FileError(f"the backup cannot be written ({error})", path=path) from None
        finally:
            part.unlink(missing_ok=True)
