"""A fresh ledger on each engine: SQLite always, PostgreSQL when its server is installed."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from benchmarks.postgresql import Server, programs, server
from tests.refusals import coded

from inclinometry.laboratory.ledger import chain
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.engine import engine
from inclinometry.laboratory.ledger.keys import Keys
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.ledger.verify import Verdict, verify


@pytest.fixture(scope="session")
def postgresql() -> Iterator[Server]:
    """A server of our own, reached through a socket in a temporary folder."""
    if programs() is None:
        pytest.skip("PostgreSQL's server is not installed")
    with server(safe=False) as running:
        yield running


@pytest.fixture(params=["sqlite", "postgresql"])
def place(request: pytest.FixtureRequest, tmp_path: Path) -> Callable[[], str]:
    """Gives new places for ledgers on one engine."""
    if request.param == "sqlite":
        turn = iter("abcdefgh")
        return lambda: str(tmp_path / f"{next(turn)}.sqlite")
    running: Server = request.getfixturevalue("postgresql")
    return running.database


@pytest.fixture
def ledger(place: Callable[[], str]) -> Iterator[Ledger]:
    """An empty ledger."""
    with create(place()) as made:
        yield made


# what several files of tests do with a ledger

TOOL = {"name": "steering tool", "triads": {}}


@pytest.fixture
def keys(tmp_path: Path) -> Keys:
    """A folder of keys of this test's own."""
    return Keys(tmp_path / "keys")


@pytest.fixture
def path(tmp_path: Path, keys: Keys) -> Path:
    """A ledger of eight tools, each signed for by itself, in a file."""
    with create(tmp_path / "lab.sqlite", keys=keys) as ledger:
        add(ledger, *(f"T{number}" for number in range(8)))
    return tmp_path / "lab.sqlite"


def add(ledger: Ledger, *serials: str) -> None:
    """Tools, each recorded by itself."""
    for serial in serials:
        ledger.append("tool", {"serial": serial}, TOOL, author="anna")


def seen(path: Path, keys: Keys, **how: Any) -> Verdict:
    """What a verification finds."""
    with Ledger(path, keys=keys) as ledger:
        return verify(ledger, **how)


def said(verdict: Verdict) -> list[str]:
    """Codes of its faults and of what else it found."""
    return coded([*verdict.faults, *verdict.findings])


def edit(where: Path | str, *statements: str) -> None:
    """SQL by somebody who may do everything in the database, the triggers put back after it."""
    if "://" in str(where):
        tables = ("chain", "tool", "event", "head")
        off, on = (
            [f"ALTER TABLE {one} {what} TRIGGER append_only" for one in tables] for what in ("DISABLE", "ENABLE")
        )
        with engine(str(where)).begin() as connection:
            for statement in (*off, *statements, *on):
                connection.exec_driver_sql(statement)
        return
    with closing(sqlite3.connect(where)) as raw, raw:
        triggers = raw.execute("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'").fetchall()
        for name, _ in triggers:
            raw.execute(f'DROP TRIGGER "{name}"')
        for statement in (*statements, *(text for _, text in triggers)):
            raw.execute(statement)


def cut(where: Path | str, after: int) -> None:
    """The tail removed, with the heads that speak of it."""
    edit(where, *(f"DELETE FROM {table} WHERE seq > {after}" for table in ("tool", "event", "head", "chain")))


def append_by_sql(ledger: Ledger) -> None:
    """A record in another's name, right in every digest and link."""
    head = ledger.head()
    seq, created, body = head.seq + 1, "2026-05-01T00:00:00.000000+00:00", chain.compact(TOOL)
    name, serial = f"{seq:032}", f"FORGED {seq}"
    digest = chain.record_digest("tool", name, created, "boris", 1, {"serial": serial}, body)
    link = chain.next_link(head.link, seq, "tool", name, created, digest)
    edit(
        ledger.where,
        f"INSERT INTO chain VALUES ({seq}, 'tool', '{name}', '{created}', '{digest}', '{link}')",
        "INSERT INTO tool (seq, id, created, author, version, serial, body) VALUES "
        f"({seq}, '{name}', '{created}', 'boris', 1, '{serial}', '{body}')",
    )


def relinked(ledger: Ledger, changed: int) -> list[tuple[Any, ...]]:
    """Rows of the chain as they would be if boris had recorded one of the eight tools; of none with 0."""
    with ledger.snapshot() as connection:
        links = connection.exec_driver_sql("SELECT seq, kind, record, created, digest FROM chain ORDER BY seq").all()
    rows, link = [], chain.GENESIS
    for seq, kind, name, created, digest in links:
        if seq == changed:
            keys = {"serial": f"T{seq - 1}"}
            digest = chain.record_digest(kind, name, created, "boris", 1, keys, chain.compact(TOOL))
        link = chain.next_link(link, seq, kind, name, created, digest)
        rows.append((seq, kind, name, created, digest, link))
    return rows


def rewrite(where: Path | str, changed: int, *more: str) -> None:
    """Another author of one of the eight tools, every digest and link worked out anew."""
    with Ledger(where) as ledger:
        rows = relinked(ledger, changed)
    links = (f"UPDATE chain SET digest = '{d}', link = '{link}' WHERE seq = {seq}" for seq, *_, d, link in rows)
    edit(where, f"UPDATE tool SET author = 'boris' WHERE seq = {changed}", *links, *more)
