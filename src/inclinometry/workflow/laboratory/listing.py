"""Lists of many records without their bodies, and what was worked out of a body once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from threading import Lock
from typing import Any, Final, TypeVar
from weakref import WeakKeyDictionary

from sqlalchemy import func, select

from inclinometry.store.ledger import Ledger, Record
from inclinometry.store.records import KINDS, TABLES
from inclinometry.workflow.laboratory.registry import RegisteredTool, months_after

MOST: Final = 20_000
"""Extracts kept for one ledger; a record never changes, so an extract never grows old."""
T = TypeVar("T")


@dataclass(frozen=True)
class Listed:
    """A record without its body."""

    kind: str
    id: str
    seq: int
    created: str
    author: str
    keys: Mapping[str, Any]


def listed(ledger: Ledger, kind: str, *, limit: int = 50, before: int = 0, **keys: Any) -> list[Listed]:
    """Records of a kind with these keys, newest first, before the place `before` (0: from the end).

    Parameters
    ----------
    ledger : Ledger
    kind : str
        See `inclinometry.store.records.KINDS`.
    limit, before : int
    **keys
        Columns of the kind.
    """
    table, names = TABLES[kind], KINDS[kind].keys
    columns = [table.c[name] for name in ("id", "seq", "created", "author", *names)]
    query = select(*columns).order_by(table.c.seq.desc()).limit(limit)
    for name, value in keys.items():
        query = query.where(table.c[name] == value)
    if before:
        query = query.where(table.c.seq < before)
    with ledger.snapshot() as connection:
        rows = connection.execute(query).all()
    return [
        Listed(kind, row.id, row.seq, row.created, row.author, {name: getattr(row, name) for name in names})
        for row in rows
    ]


_KEPT: WeakKeyDictionary[Ledger, dict[tuple[str, str], Any]] = WeakKeyDictionary()
_LOCK = Lock()


def extract(ledger: Ledger, one: Listed, what: str, make: Callable[[Record], T]) -> T:
    """What `make` finds in the body of a listed record, read and worked out only once in a process.

    Parameters
    ----------
    what : str
        Name of the extract, the same for the same `make`.
    """
    with _LOCK:
        kept = _KEPT.setdefault(ledger, {})
        if (what, one.id) in kept:
            found: T = kept[what, one.id]
            return found
    found = make(ledger.get(one.kind, one.id))
    with _LOCK:
        kept[what, one.id] = found
        while len(kept) > MOST:
            del kept[next(iter(kept))]
    return found


def due_days(ledger: Ledger, tools: Sequence[RegisteredTool]) -> dict[str, date]:
    """Serial number -> day on which the next calibration is due, as `registry.next_due`, for many tools at once.

    Tools that are retired or without an agreed interval are left out.
    """
    asked = {tool.serial: tool.interval_months for tool in tools if tool.interval_months and not tool.retired}
    if not asked:
        return {}
    certified, registered = TABLES["certificate"], TABLES["tool"]
    with ledger.snapshot() as connection:
        last = _days(connection, certified, func.max(certified.c.created), asked)
        first = _days(connection, registered, func.min(registered.c.created), [s for s in asked if s not in last])
    found = {serial: months_after(day, asked[serial] or 0) for serial, day in last.items()}
    return {**first, **found}


def _days(connection: Any, table: Any, created: Any, serials: Any) -> dict[str, date]:
    names = list(serials)
    found = {}
    for start in range(0, len(names), 500):
        query = (
            select(table.c.serial, created.label("created"))
            .where(table.c.serial.in_(names[start : start + 500]))
            .group_by(table.c.serial)
        )
        found.update({row.serial: date.fromisoformat(row.created[:10]) for row in connection.execute(query)})
    return found
