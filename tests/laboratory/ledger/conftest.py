"""A fresh ledger on each engine: SQLite always, PostgreSQL when its server is installed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from benchmarks.postgresql import Server, programs, server

from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.ledger import Ledger


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
