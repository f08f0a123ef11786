"""The ledger on both engines: what was recorded is read back, nothing can be changed, every change is named."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from alembic.operations import Operations
from alembic.runtime.migration import MigrationContext
from benchmarks.postgresql import Server
from sqlalchemy import Integer
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.laboratory.ledger.admin import _migrate, create
from inclinometry.laboratory.ledger.chain import GENESIS, compact, parse_head
from inclinometry.laboratory.ledger.engine import KINDS, REVISIONS, engine, protect, unprotected
from inclinometry.laboratory.ledger.exchange import backup, export, restore
from inclinometry.laboratory.ledger.ledger import ConflictError, Draft, Ledger, LedgerError
from inclinometry.laboratory.ledger.verify import verify

from .conftest import TOOL, add


def reading(value: float = 2.5) -> dict[str, Any]:
    """The body of a reading."""
    return {
        "dial_deg": [0.0, 90.0, 0.0],
        "channels": {"accelerometer": [1.0, value, 3.0]},
        "count": 5,
        "captured": "key",
    }


def fill(ledger: Ledger, readings: int = 30) -> None:
    """A tool and some readings."""
    add(ledger, "IN-7")
    for position in range(readings):
        ledger.append("reading", {"session": "s", "position": position, "attempt": 1}, reading(), author="anna")


def test_what_was_recorded_is_read_back(ledger: Ledger) -> None:
    """Keys, body, order, newest, pages."""
    fill(ledger)
    newer = ledger.append("tool", {"serial": "IN-7"}, {**TOOL, "name": "renamed"}, author="boris")
    assert ledger.latest("tool", serial="IN-7") == newer
    assert ledger.get("tool", newer.id) == newer
    assert [r.keys["position"] for r in ledger.find("reading", session="s", limit=3)] == [0, 1, 2]
    assert [r.keys["position"] for r in ledger.find("reading", session="s", limit=2, newest=True)] == [29, 28]
    assert ledger.count("reading", session="s") == 30
    for wanted in ([], [3], [3, 5], [3, 5, 7]):
        assert [r.keys["position"] for r in ledger.find("reading", position=wanted)] == wanted
    assert ledger.count("reading", position=[3, "3", 2**70], session=["s", 7]) == 1
    assert [r.body["name"] for r in ledger.current("tool")] == ["renamed"]
    assert ledger.head().seq == 32
    assert verify(ledger).ok


def test_the_second_of_two_captures_of_one_position_is_told(ledger: Ledger) -> None:
    """No lost update: the first stays, the second hears of it."""
    fill(ledger, 1)
    with refused("ledger-conflict", error=ConflictError):
        ledger.append("reading", {"session": "s", "position": 0, "attempt": 1}, reading(9.0), author="boris")
    assert ledger.latest("reading", session="s").body["channels"]["accelerometer"][1] == 2.5  # type: ignore[union-attr]
    assert verify(ledger).ok


def test_several_records_are_recorded_together_or_not_at_all(ledger: Ledger) -> None:
    """One transaction."""
    fill(ledger, 1)
    same = Draft("reading", {"session": "s", "position": 0, "attempt": 1}, reading())
    with pytest.raises(ConflictError):
        ledger.append_all([Draft("tool", {"serial": "B"}, TOOL), same], author="a")
    assert ledger.latest("tool", serial="B") is None


def test_documents_are_found_by_their_digest(ledger: Ledger) -> None:
    """Bytes in, the same bytes out."""
    ledger.append_all([Draft("tool", {"serial": "B"}, TOOL, [("text/plain", b"certificate")])], author="a")
    digest = "sha256:" + __import__("hashlib").sha256(b"certificate").hexdigest()
    assert ledger.document(digest) == ("text/plain", b"certificate")
    with pytest.raises(LedgerError, check=lambda error: error.finding.code == "ledger-not-there"):
        ledger.document("sha256:0")


@pytest.mark.parametrize(
    ("keys", "body", "message"),
    [
        ({"serial": ""}, TOOL, "ledger-text"),
        ({"serial": "a\nb"}, TOOL, "ledger-text"),
        ({"number": "7"}, TOOL, "input-missing"),
        ({"serial": "x"}, {"name": 3, "triads": {}}, "input-field"),
        ({"serial": "x"}, {"name": "n", "triads": {}, "ledger-content": 1}, "input-field"),
        ({"serial": "x"}, {"name": "n", "triads": {"gyro": {"x": float("nan")}}}, "input-field"),
    ],
)
def test_records_that_do_not_fit_are_refused(
    ledger: Ledger, keys: dict[str, Any], body: dict[str, Any], message: str
) -> None:
    """Nothing is recorded of them."""
    with refused(message):
        ledger.append("tool", keys, body, author="a")
    assert ledger.head().seq == 0


def test_reading_only(ledger: Ledger) -> None:
    """A ledger opened for reading refuses to record."""
    with Ledger(ledger.where, read_only=True) as look, refused("input-not-with", error=LedgerError, name="read_only"):
        add(look, "x")


def test_the_triggers_refuse_changes(ledger: Ledger) -> None:
    """UPDATE and DELETE through the ledger's own connection."""
    fill(ledger, 1)
    for statement in ("UPDATE reading SET attempt = 3", "DELETE FROM chain", "DELETE FROM document WHERE 1 = 1"):
        if "document" in statement:
            ledger.append_all([Draft("tool", {"serial": "B"}, TOOL, [("text/plain", b"x")])], author="a")
        with refused("ledger-refused", error=LedgerError), ledger.snapshot() as connection:
            connection.exec_driver_sql(statement)


def test_export_and_import_give_the_same_chain(ledger: Ledger, tmp_path: Path) -> None:
    """Every record, document and link; into an empty ledger only."""
    fill(ledger)
    ledger.append_all([Draft("tool", {"serial": "B"}, TOOL, [("text/plain", b"x" * 1000)])], author="a")
    head = export(ledger, tmp_path / "all.zip")
    with create(tmp_path / "copy.sqlite") as copy:
        assert restore(copy, tmp_path / "all.zip") == head == copy.head()
        assert verify(copy, head=head).ok
        with refused("ledger-not-empty", error=LedgerError):
            restore(copy, tmp_path / "all.zip")


def test_a_backup_is_a_ledger(tmp_path: Path) -> None:
    """Same head, never over a file that is there."""
    with create(tmp_path / "a.sqlite") as ledger:
        fill(ledger)
        backup(ledger, tmp_path / "b.sqlite")
        with Ledger(tmp_path / "b.sqlite") as copy:
            assert copy.head() == ledger.head()
            assert verify(copy).ok
        with refused("file-unwritable", error=FileError):
            backup(ledger, tmp_path / "b.sqlite")


def test_a_file_that_is_no_ledger_is_said_so(tmp_path: Path) -> None:
    """Missing, garbage of any length, another database: neither opened nor made one, and left as it is."""
    sqlite3.connect(tmp_path / "other.sqlite").execute("CREATE TABLE t (x)").connection.close()
    for size in (30, 5000):
        (tmp_path / f"{size}.txt").write_bytes(np.random.default_rng(1).bytes(size))
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    for name, make, wanted in (
        ("none.sqlite", Ledger, "ledger-absent"),
        ("other.sqlite", Ledger, "ledger-absent"),
        *((f"{size}.txt", make, "ledger-damaged") for size in (30, 5000) for make in (Ledger, create)),
    ):
        with refused(wanted, error=LedgerError):
            make(tmp_path / name)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before
    with refused("ledger-address", error=LedgerError):
        Ledger("mysql://host/x")


def test_heads_and_canonical_text() -> None:
    """What cannot be read is refused."""
    assert parse_head(f"3:{GENESIS}").seq == 3
    with refused("input-value", name="head"):
        parse_head("3:abc")
    assert compact({"б": [0.1, 1e22]}) == '{"б":[0.1,1e+22]}'


# Ledgers of older programs: read as they are, brought up to date, protected again; and those of newer ones.


REFERENCE = Path(__file__).parents[2] / "reference" / "ledger"
HEAD = parse_head("12:b493b8fe6396b5694d262e9d9ecb0d53ba91b0f61021ff92a4f9c9b3cf427f55")


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
        add(ledger, "new")
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
    with refused("file-version", error=LedgerError):
        Ledger(where)
    with refused("file-version", error=LedgerError):
        create(where)


def test_removed_triggers_are_not_quietly_put_back(old: Path) -> None:
    """They are evidence; a sound ledger is moved by export and import."""
    create(old).close()
    with sqlite3.connect(old) as raw:
        raw.execute("DROP TRIGGER tool_update")
    raw.close()
    with refused("ledger-unprotected", error=LedgerError):
        create(old)
    with Ledger(old) as ledger:
        assert [one.values for one in verify(ledger).faults] == [{"names": ("tool",)}]
