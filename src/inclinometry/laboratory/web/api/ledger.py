"""The ledger itself: its head, its verification, its records as they were made, everything in one file."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Annotated, Any

from fastapi import APIRouter, Query
from fastapi.responses import StreamingResponse

from inclinometry.errors import InputError
from inclinometry.laboratory.ledger.chain import parse_head
from inclinometry.laboratory.ledger.engine import KINDS
from inclinometry.laboratory.ledger.exchange import backup, export
from inclinometry.laboratory.ledger.verify import verify
from inclinometry.laboratory.web.api.access import REFUSALS, Administrator, After, Limit, Reader, TheLedger, attributes
from inclinometry.laboratory.web.api.registry import shown

router = APIRouter(prefix="/ledger", tags=["ledger"], responses=REFUSALS)

SQLITE = "application/vnd.sqlite3"
HIDDEN = ("user",)
"""Kinds whose bodies hold what no one is to read."""


@router.get("/head")
def head(ledger: TheLedger, _: Reader) -> dict[str, Any]:
    """How many records there are, the last link of the chain, and the laboratory's signature: keep it elsewhere."""
    found, signed = ledger.head(), ledger.own_head()
    return {"records": found.seq, "head": str(found), "signed": None if signed is None else signed.statement()}


@router.get("/verify")
def check(ledger: TheLedger, _: Reader, head: Annotated[str | None, Query(max_length=100)] = None) -> dict[str, Any]:
    """Every record against its digest and the chain, signed heads against the records, witnesses against both."""
    found = verify(ledger, head=None if head is None else parse_head(head))
    own = attributes(found, "ok", "proven", "compared", "records")
    said = {name: [one.plain() for one in getattr(found, name)] for name in ("faults", "silent", "findings")}
    return own | said | {"head": str(found.head)}


@router.get("/records/{kind}")
def records(ledger: TheLedger, _: Reader, kind: str, after: After = 0, limit: Limit = 100) -> list[dict[str, Any]]:
    """Records of one kind in the order in which they were made, beyond the place `after`."""
    if kind not in KINDS or kind in HIDDEN:
        allowed = ", ".join(name for name in KINDS if name not in HIDDEN)
        raise InputError(f"records of kind {kind!r:.80} cannot be read here; allowed: {allowed}")
    return [shown(record) for record in ledger.find(kind, after=after, limit=limit)]


@router.get("/export", response_class=StreamingResponse, responses={200: {"content": {"application/zip": {}}}})
def everything(ledger: TheLedger, _: Administrator) -> StreamingResponse:
    """Everything in one file, password hashes included, which `inclinometry ledger import` reads."""
    return _file("ledger.zip", "application/zip", lambda path: export(ledger, path))


@router.get("/backup", response_class=StreamingResponse, responses={200: {"content": {SQLITE: {}}}})
def copy(ledger: TheLedger, _: Administrator) -> StreamingResponse:
    """The SQLite ledger as it is at this moment, a ledger itself."""
    return _file("ledger.sqlite", SQLITE, lambda path: backup(ledger, path))


def _file(name: str, media: str, write: Callable[[Path], object]) -> StreamingResponse:
    """A file that is made for one answer."""
    whole = tempfile.TemporaryFile()  # noqa: SIM115
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / name
            write(path)
            with path.open("rb") as made:
                shutil.copyfileobj(made, whole)
    except BaseException:
        whole.close()
        raise
    headers = {"content-disposition": f'attachment; filename="{name}"', "content-length": str(whole.tell())}
    return StreamingResponse(_pieces(whole), media_type=media, headers=headers)


def _pieces(whole: IO[bytes]) -> Iterator[bytes]:
    with whole:
        whole.seek(0)
        while piece := whole.read(2**18):
            yield piece
