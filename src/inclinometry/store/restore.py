"""Reading an export into an empty ledger: everything is checked, nothing in the file is trusted."""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from sqlalchemy.engine import Connection

from inclinometry.core.digest import digest_bytes
from inclinometry.core.errors import FileError, InputError
from inclinometry.store import chain
from inclinometry.store.batch import LARGEST_DOCUMENT, Batch, add_document
from inclinometry.store.exchange import BLOCK, FORMAT, VERSION, Progress
from inclinometry.store.kinds import check, plain
from inclinometry.store.ledger import Ledger

_LONGEST_LINE: Final = 60_000_000
"""Of a line of records.jsonl, bytes: a body of the greatest length with every character escaped or of many bytes."""
_MOST_SWELLING: Final = 200
"""Times its size that an export may swell; digests, which do not shrink, keep true ones below 20."""
_FIELDS: Final = {"seq", "kind", "id", "created", "author", "version", "keys", "body", "digest", "link"}
_DAMAGED: Final = (
    zipfile.BadZipFile, zipfile.LargeZipFile, zlib.error, KeyError, EOFError, NotImplementedError, RuntimeError,
)  # fmt: skip


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
                batch = Batch(connection, chain.Head(0, chain.GENESIS))
                for number, line in _lines(archive):
                    _add(batch, line, number, path)
                    if number % BLOCK == 0:
                        batch.write()
                        if progress is not None:
                            progress(min(1.0, number / max(manifest["seq"], 1)))
                batch.write()
                if str(batch.head) != manifest["head"]:
                    said = manifest["head"][:40]
                    raise FileError(f"ends at record {batch.head.seq}; its manifest says {said}", path=path)
                _documents(connection, archive, manifest["documents"], path)
    except _DAMAGED as error:
        raise FileError(f"not an export of a ledger, or damaged ({error})", path=path) from None
    except FileNotFoundError:
        raise FileError("there is no such file; check the name", path=path) from None
    except OSError as error:
        raise FileError(f"cannot be read ({error.strerror or error})", path=path) from None
    return batch.head


def _manifest(archive: zipfile.ZipFile, path: str | Path) -> dict[str, Any]:
    packed = sum(entry.compress_size for entry in archive.infolist())
    if sum(entry.file_size for entry in archive.infolist()) > _MOST_SWELLING * packed + 1_000_000:
        raise FileError(f"would swell to more than {_MOST_SWELLING} times its size; no export does", path=path)
    with archive.open("manifest.json") as stream:
        try:
            content = json.loads(stream.read(_LONGEST_LINE))
            head = chain.parse_head(content["head"])
            right = content["format"] == FORMAT and isinstance(content["documents"], dict)
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
            right = False
    if not right:
        raise FileError("not an export of a ledger: its manifest.json does not say so", path=path)
    if content["version"] != VERSION:
        raise FileError(f"an export of version {content['version']!r:.20}; this program reads {VERSION}", path=path)
    return {"head": str(head), "seq": head.seq, "documents": content["documents"]}


def _lines(archive: zipfile.ZipFile) -> Iterator[tuple[int, bytes]]:
    with archive.open("records.jsonl") as lines:
        yield from enumerate(iter(lambda: lines.readline(_LONGEST_LINE), b""), start=1)


def _add(batch: Batch, line: bytes, number: int, path: str | Path) -> None:
    """Add the record of a line, when it is the one that comes next."""
    try:
        row = json.loads(line)
        _fit(row, line)
        made = batch.add(*(row[name] for name in ("kind", "id", "created", "author", "version", "keys", "body")))
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        cause = " ".join(str(error).split())[:300]
        raise FileError(f"not a record of a ledger ({cause})", path=path, line=number) from None
    if (made.seq, made.digest, batch.head.link) != (row["seq"], row["digest"], row["link"]):
        raise FileError(
            f"{row['kind']} {row['seq']!r:.20} does not follow from the records before it: the export was changed",
            path=path,
            line=number,
        )


def _fit(row: Mapping[str, Any], line: bytes) -> None:
    """Refuse what `export` never writes, doubled keys and other spellings of the same content among it."""
    if set(row) != _FIELDS:
        raise InputError("its fields are not those of a record")
    for name in ("id", "author", "created"):
        if not plain(row[name]):
            raise InputError(f"{name} is not a text of 1 to 200 printable characters")
    created = datetime.fromisoformat(row["created"])
    if created.utcoffset() is None or created.astimezone(UTC).isoformat(timespec="microseconds") != row["created"]:
        raise InputError("created is not a time in UTC with microseconds")
    if type(row["seq"]) is not int or not isinstance(row["body"], str):
        raise InputError("seq is not a number, or body not a text")
    body = json.loads(row["body"])
    if chain.compact(body) != row["body"] or chain.compact(row).encode() != line.removesuffix(b"\n"):
        raise InputError("spelled in another way than `ledger export` does: doubled keys, blanks or another order")
    check(row["kind"], row["keys"], body, row["version"])


def _documents(connection: Connection, archive: zipfile.ZipFile, documents: dict[str, Any], path: str | Path) -> None:
    for name, media_type in documents.items():
        with archive.open(f"documents/{name}") as stream:
            data = stream.read(LARGEST_DOCUMENT + 1)
        if digest_bytes(data) != f"sha256:{name}" or not plain(media_type):
            raise FileError(f"documents/{name:.80} was changed", path=path)
        add_document(connection, media_type, data)
