"""The ledger on both engines: what was recorded is read back, nothing can be changed, every change is named."""

from __future__ import annotations

import sqlite3
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from inclinometry.errors import FileError, InputError
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.chain import GENESIS, compact, parse_head
from inclinometry.laboratory.ledger.exchange import backup, export, restore
from inclinometry.laboratory.ledger.ledger import ConflictError, Draft, Ledger, LedgerError
from inclinometry.laboratory.ledger.users import check_password, guard_last_administrator, put_user
from inclinometry.laboratory.ledger.verify import verify

TOOL = {"name": "steering tool", "triads": {}}


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
    ledger.append("tool", {"serial": "IN-7"}, TOOL, author="anna")
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
    with pytest.raises(ConflictError, match="somebody else"):
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
    with pytest.raises(LedgerError, match="no document"):
        ledger.document("sha256:0")


@pytest.mark.parametrize(
    ("keys", "body", "message"),
    [
        ({"serial": ""}, TOOL, "1 to 200 printable"),
        ({"serial": "a\nb"}, TOOL, "printable"),
        ({"number": "7"}, TOOL, "has the keys serial"),
        ({"serial": "x"}, {"name": 3, "triads": {}}, r"tool\.name"),
        ({"serial": "x"}, {"name": "n", "triads": {}, "colour": 1}, "colour"),
        ({"serial": "x"}, {"name": "n", "triads": {"gyro": {"x": float("nan")}}}, "cannot be recorded"),
    ],
)
def test_records_that_do_not_fit_are_refused(
    ledger: Ledger, keys: dict[str, Any], body: dict[str, Any], message: str
) -> None:
    """Nothing is recorded of them."""
    with pytest.raises(InputError, match=message):
        ledger.append("tool", keys, body, author="a")
    assert ledger.head().seq == 0


def test_a_clock_that_went_back_records_nothing(ledger: Ledger) -> None:
    """Two minutes are forgiven, a year is not."""
    fill(ledger, 1)
    early = Ledger(ledger.where, clock=lambda: datetime.now(UTC) - timedelta(days=365))
    with pytest.raises(LedgerError, match="set the clock"):
        early.append("tool", {"serial": "x"}, TOOL, author="a")
    early.close()


def test_reading_only(ledger: Ledger) -> None:
    """A ledger opened for reading refuses to record."""
    with Ledger(ledger.where, read_only=True) as look, pytest.raises(LedgerError, match="reading only"):
        look.append("tool", {"serial": "x"}, TOOL, author="a")


@pytest.mark.long
@pytest.mark.parametrize(
    ("damage", "table", "problem"),
    [
        (
            "UPDATE reading SET body = replace(body, '[1.0,2.5,3.0]', '[1.0,2.6,3.0]') WHERE seq = 10",
            "reading 10",
            "changed",
        ),
        ("UPDATE reading SET author = 'eve' WHERE seq = 11", "reading 11", "changed"),
        ("UPDATE chain SET digest = 'x' WHERE seq = 12", "chain 12", "changed or moved"),
        ("DELETE FROM reading WHERE seq = 13", "reading 13", "removed"),
        ("DELETE FROM reading WHERE seq = 31; DELETE FROM chain WHERE seq = 31", "chain 31", "before the head noted"),
        ("DELETE FROM reading WHERE seq = 14; DELETE FROM chain WHERE seq = 14", "chain 14", "gap"),
        (
            "INSERT INTO tool SELECT 99, 'new', created, author, version, serial, body FROM tool WHERE seq = 1",
            "tool 99",
            "inserted",
        ),
        (
            "UPDATE reading SET seq = -1 WHERE seq = 5; UPDATE reading SET seq = 5 WHERE seq = 6; "
            "UPDATE reading SET seq = 6 WHERE seq = -1",
            "reading 5",
            "another record",
        ),
    ],
)
def test_every_change_behind_its_back_is_named(tmp_path: Path, damage: str, table: str, problem: str) -> None:
    """An edited file: the row and what happened to it."""
    path = tmp_path / "ledger.sqlite"
    with create(path) as ledger:
        fill(ledger)
        head = ledger.head()
    with sqlite3.connect(path) as raw:
        for (name,) in raw.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            raw.execute(f'DROP TRIGGER "{name}"')
        raw.executescript(damage)
    with Ledger(path) as ledger:
        faults = [str(fault) for fault in verify(ledger, head=head).faults]
    assert any(fault.startswith(table) and problem in fault for fault in faults), faults
    assert any("triggers" in fault for fault in faults)


def test_the_triggers_refuse_changes(ledger: Ledger) -> None:
    """UPDATE and DELETE through the ledger's own connection."""
    fill(ledger, 1)
    for statement in ("UPDATE reading SET attempt = 3", "DELETE FROM chain", "DELETE FROM document WHERE 1 = 1"):
        if "document" in statement:
            ledger.append_all([Draft("tool", {"serial": "B"}, TOOL, [("text/plain", b"x")])], author="a")
        with pytest.raises(LedgerError, match="append-only"), ledger.snapshot() as connection:
            connection.exec_driver_sql(statement)


def test_export_and_import_give_the_same_chain(ledger: Ledger, tmp_path: Path) -> None:
    """Every record, document and link; into an empty ledger only."""
    fill(ledger)
    ledger.append_all([Draft("tool", {"serial": "B"}, TOOL, [("text/plain", b"x" * 1000)])], author="a")
    head = export(ledger, tmp_path / "all.zip")
    with create(tmp_path / "copy.sqlite") as copy:
        assert restore(copy, tmp_path / "all.zip") == head == copy.head()
        assert verify(copy, head=head).ok
        with pytest.raises(LedgerError, match="holds records already"):
            restore(copy, tmp_path / "all.zip")


def test_a_changed_export_is_refused_as_a_whole(tmp_path: Path) -> None:
    """One figure edited: the line is named, the new ledger stays empty."""
    import zipfile

    with create(tmp_path / "a.sqlite") as ledger:
        fill(ledger)
        export(ledger, tmp_path / "all.zip")
    with zipfile.ZipFile(tmp_path / "all.zip") as old, zipfile.ZipFile(tmp_path / "bad.zip", "w") as new:
        for name in old.namelist():
            data = old.read(name)
            # the whole list: a bare 2.5 may stand in the second of a time
            new.writestr(name, data.replace(b"[1.0,2.5,3.0]", b"[1.0,2.6,3.0]", 1) if name.endswith("jsonl") else data)
    with create(tmp_path / "b.sqlite") as ledger:
        with pytest.raises(FileError, match=r"line 2: .*the export was changed"):
            restore(ledger, tmp_path / "bad.zip")
        assert ledger.head().seq == 0
        (tmp_path / "garbage").write_text("garbage")
        with pytest.raises(FileError, match="not an export"):
            restore(ledger, tmp_path / "garbage")


def test_a_backup_is_a_ledger(tmp_path: Path) -> None:
    """Same head, never over a file that is there."""
    with create(tmp_path / "a.sqlite") as ledger:
        fill(ledger)
        backup(ledger, tmp_path / "b.sqlite")
        with Ledger(tmp_path / "b.sqlite") as copy:
            assert copy.head() == ledger.head()
            assert verify(copy).ok
        with pytest.raises(FileError, match="there already"):
            backup(ledger, tmp_path / "b.sqlite")


def test_a_file_that_is_no_ledger_is_said_so(tmp_path: Path) -> None:
    """Missing, garbage, another database."""
    with pytest.raises(LedgerError, match="no such ledger"):
        Ledger(tmp_path / "none.sqlite")
    (tmp_path / "garbage").write_text("garbage" * 1000)
    with pytest.raises(LedgerError, match="not a"):
        Ledger(tmp_path / "garbage")
    sqlite3.connect(tmp_path / "other.sqlite").execute("CREATE TABLE t (x)").connection.close()
    with pytest.raises(LedgerError, match="not a ledger"):
        Ledger(tmp_path / "other.sqlite")
    with pytest.raises(LedgerError, match="file path"):
        Ledger("mysql://host/x")


@pytest.mark.long
def test_users_passwords_and_the_last_administrator(ledger: Ledger) -> None:
    """Hashes, not passwords; roles; nobody is locked out."""
    put_user(ledger, "anna", role="administrator", password="quiet granite harbour lamp", author="setup")
    assert check_password(ledger, "anna", "quiet granite harbour lamp") is not None
    assert check_password(ledger, "anna", "wrong horse battery") is None
    assert check_password(ledger, "nobody", "wrong horse battery") is None
    assert "horse" not in str(ledger.latest("user", name="anna"))
    with pytest.raises(LedgerError, match="last active administrator"):
        guard_last_administrator(ledger, "anna", "operator", True)
    put_user(ledger, "boris", role="operator", password="marble otter violin cactus", author="anna")
    user = put_user(ledger, "boris", role="operator", active=False, author="anna")
    assert not user.may("capture")
    assert check_password(ledger, "boris", "marble otter violin cactus") is None
    with pytest.raises(InputError, match="allowed 15 to 128"):
        put_user(ledger, "c", role="operator", password="short", author="anna")


def test_heads_and_canonical_text() -> None:
    """What cannot be read is refused."""
    assert parse_head(f"3:{GENESIS}").seq == 3
    with pytest.raises(InputError, match="head of a ledger"):
        parse_head("3:abc")
    assert compact({"б": [0.1, 1e22]}) == '{"б":[0.1,1e+22]}'
