"""Ledgers of older programs: read as they are, brought up to date, protected again; and those of newer ones."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest
from alembic.operations import Operations
from alembic.runtime.migration import MigrationContext
from benchmarks.postgresql import Server
from sqlalchemy import Integer

from inclinometry.laboratory.ledger.admin import _migrate, create
from inclinometry.laboratory.ledger.chain import parse_head
from inclinometry.laboratory.ledger.engine import KINDS, REVISIONS, engine, protect, unprotected
from inclinometry.laboratory.ledger.exchange import restore
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError
from inclinometry.laboratory.ledger.verify import verify

REFERENCE = Path(__file__).parents[2] / "reference" / "ledger"
HEAD = parse_head("12:b493b8fe6396b5694d262e9d9ecb0d53ba91b0f61021ff92a4f9c9b3cf427f55")
TOOL = {"name": "steering tool", "triads": {}}


@pytest.fixture
def old(tmp_path: Path) -> Path:
    """A ledger that the first revision made, with a record of each kind."""
    shutil.copy(REFERENCE / "ledger-0001.sqlite", tmp_path / "old.sqlite")
    return tmp_path / "old.sqlite"


def look(ledger: Ledger) -> None:
    """A version-1 record of each kind says what it said then."""
    for kind in KINDS:
        found = ledger.find(kind)
        assert found, kind
        assert all(record.version == 1 for record in found)
    reading = ledger.find("reading")[-1]
    assert reading.body["count"] == 9007199254740993
    assert reading.body["channels"]["accelerometer"] == [1.0, -2.5, 1e22]
    assert str(ledger.find("session")[0].body["plan"]["positions_deg"][0][2]) == "-0.0"
    assert ledger.find("user")[0].body["full_name"] == "Анна 安娜"
    assert ledger.find("event")[0].created == "2026-11-21T08:00:04.000000+00:00"
    (digest,) = ledger.find("certificate")[0].body["documents"].values()
    assert ledger.document(digest) == ("text/plain", b"ok")
    assert verify(ledger, head=HEAD).ok


def test_an_old_ledger_is_read_as_it_is_and_brought_up_to_date(old: Path) -> None:
    """Nothing recorded changes; recording goes on; the triggers are there."""
    with Ledger(old) as ledger:
        look(ledger)
        ledger.append("tool", {"serial": "new"}, TOOL, author="a")
    with create(old) as ledger:
        look(ledger)
        with ledger.snapshot() as connection:
            assert not unprotected(connection)
            assert connection.exec_driver_sql("SELECT version_num FROM alembic_version").scalar() == REVISIONS[-1]
            plan = connection.exec_driver_sql(
                "EXPLAIN QUERY PLAN SELECT * FROM event WHERE subject_kind = 'x' AND subject = 'y' AND action = 'z' "
                "ORDER BY seq DESC LIMIT 1"
            ).all()
        assert "ix_event_all" in str(plan)
        assert "TEMP B-TREE" not in str(plan)
    create(old).close()


def test_an_old_export_is_read_on_both_engines(place: Callable[[], str]) -> None:
    """Format 1."""
    with create(place()) as ledger:
        assert restore(ledger, REFERENCE / "export-1.zip") == HEAD
        look(ledger)


def test_an_old_database_is_brought_up_to_date(postgresql: Server) -> None:
    """PostgreSQL."""
    where = postgresql.database()
    made = engine(where)
    _migrate(made, "0001")
    made.dispose()
    with Ledger(where) as ledger:
        restore(ledger, REFERENCE / "export-1.zip")
    with create(where) as ledger:
        look(ledger)
        with ledger.snapshot() as connection:
            assert not unprotected(connection)


def test_a_rebuilt_table_loses_its_triggers_and_gets_them_back(old: Path) -> None:
    """What a migration that changes a column does on SQLite, and why each one ends with `protect`."""
    made = engine(old)
    with made.connect().execution_options(writing=True) as connection:
        operations = Operations(MigrationContext.configure(connection))
        with operations.batch_alter_table("reading", recreate="always") as table:
            table.alter_column("attempt", type_=Integer())
        assert unprotected(connection) == ["reading"]
        protect(connection)
        assert not unprotected(connection)
        connection.commit()
    made.dispose()
    with Ledger(old) as ledger:
        look(ledger)


def test_a_ledger_of_a_newer_program_is_left_alone(ledger: Ledger) -> None:
    """Neither opened nor changed."""
    where = ledger.where
    made = engine(where)
    with made.begin() as connection:
        connection.exec_driver_sql("UPDATE alembic_version SET version_num = '0099'")
    made.dispose()
    with pytest.raises(LedgerError, match="newer program"):
        Ledger(where)
    with pytest.raises(LedgerError, match="newer program"):
        create(where)


def test_removed_triggers_are_not_quietly_put_back(old: Path) -> None:
    """They are evidence; a sound ledger is moved by export and import."""
    create(old).close()
    with sqlite3.connect(old) as raw:
        raw.execute("DROP TRIGGER tool_update")
    raw.close()
    with pytest.raises(LedgerError, match=r"removed the protection .* of tool; run"):
        create(old)
    with Ledger(old) as ledger:
        assert [fault.table for fault in verify(ledger).faults] == ["tool"]
