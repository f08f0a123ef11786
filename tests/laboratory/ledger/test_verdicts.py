"""What a verification says, to the row and the number; and what is taken for a signed head, and for a key."""

from __future__ import annotations

import io
import json
import sqlite3
import threading
import urllib.error
import urllib.request
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from cryptography.hazmat.primitives.asymmetric import ec
from sqlalchemy import UniqueConstraint, inspect, select

from inclinometry.errors import FileError, InputError
from inclinometry.laboratory.ledger import chain
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.engine import HEAD, METADATA, default_path, engine
from inclinometry.laboratory.ledger.exchange import backup
from inclinometry.laboratory.ledger.heads import (
    SignedHead,
    grown,
    head_of,
    parse_signed,
    proof_since,
    read_head,
    signed_by,
)
from inclinometry.laboratory.ledger.keys import (
    FOLDER,
    PASSPHRASE,
    Keys,
    default_folder,
    descends,
    explained,
    fingerprint,
    private_pem,
    public_pem,
    read_public,
)
from inclinometry.laboratory.ledger.ledger import Draft, Ledger, LedgerError
from inclinometry.laboratory.ledger.verify import Verdict, verify
from inclinometry.laboratory.ledger.witness import name_others
from inclinometry.laboratory.ledger.witness_server import server

TOOL = {"name": "steering tool", "triads": {}}


@pytest.fixture
def keys(tmp_path: Path) -> Keys:
    """A folder of keys of this test's own."""
    return Keys(tmp_path / "keys")


@pytest.fixture
def path(tmp_path: Path, keys: Keys) -> Path:
    """A ledger of eight tools, each signed for by itself."""
    where = tmp_path / "lab.sqlite"
    with create(where, keys=keys) as ledger:
        for number in range(8):
            ledger.append("tool", {"serial": f"T{number}"}, TOOL, author="anna")
    return where


def edit(path: Path, *statements: str) -> None:
    """SQL by somebody who may do everything with the file."""
    with sqlite3.connect(path) as raw:
        triggers = raw.execute("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'").fetchall()
        for name, _ in triggers:
            raw.execute(f'DROP TRIGGER "{name}"')
        for statement in statements:
            raw.execute(statement)
        for _, text in triggers:
            raw.execute(text)
    raw.close()


def cut(path: Path, after: int) -> None:
    """The tail removed, with the heads that speak of it."""
    edit(path, *(f"DELETE FROM {table} WHERE seq > {after}" for table in ("tool", "event", "head", "chain")))


def seen(path: Path, keys: Keys, **how: Any) -> Verdict:
    """What a verification finds."""
    with Ledger(path, keys=keys) as ledger:
        return verify(ledger, **how)


def rows(found: Verdict, words: str) -> list[tuple[str, str]]:
    """Table and row of the faults that speak of something."""
    return [(fault.table, fault.row) for fault in found.faults if words in fault.problem]


@pytest.mark.parametrize(("gone", "row"), [((5,), "5"), ((5, 6), "5 to 6"), ((1,), "1"), ((1, 2, 3), "1 to 3")])
def test_links_that_are_gone_are_counted(path: Path, keys: Keys, gone: tuple[int, ...], row: str) -> None:
    """By their numbers, and each of their records stands for itself now."""
    edit(path, *(f"DELETE FROM chain WHERE seq = {seq}" for seq in gone))
    found = seen(path, keys)
    assert rows(found, "have a gap") == [("chain", row)]
    assert len(rows(found, "no such record")) == len(gone)
    assert found.records == 8 - len(gone)


@pytest.mark.parametrize(("after", "row"), [(5, "6 to 8"), (6, "7 to 8"), (7, "8")])
def test_a_tail_that_is_gone_is_counted(path: Path, keys: Keys, after: int, row: str) -> None:
    """By what witnesses keep, and by a head that was noted."""
    with Ledger(path, keys=keys) as ledger:
        head = ledger.head()
    cut(path, after)
    assert rows(seen(path, keys), "ends before the signed head kept by") == [("chain", row)]
    found = seen(path, keys, head=head)
    assert rows(found, "ends before the head noted earlier") == [("chain", f"{after + 1} to 8")]
    assert found.records == after


def test_a_head_that_was_noted_is_met(path: Path, keys: Keys) -> None:
    """The newest, an older one, that of an empty ledger; not one of the same number with another link."""
    with Ledger(path, keys=keys) as ledger:
        head = ledger.head()
        with ledger.snapshot() as connection:
            older = connection.exec_driver_sql("SELECT link FROM chain WHERE seq = 3").scalar_one()
    for noted in (head, chain.Head(3, older), chain.Head(0, chain.GENESIS)):
        assert seen(path, keys, head=noted).ok
    found = seen(path, keys, head=chain.Head(3, head.link))
    assert rows(found, "not the head noted earlier") == [("chain", f"3 ({_record(path, 3)})")]
    cut(path, 3)
    assert rows(seen(path, keys, head=chain.Head(3, older)), "noted earlier") == []


def _record(path: Path, seq: int) -> str:
    with sqlite3.connect(path) as raw:
        found = raw.execute("SELECT record FROM chain WHERE seq = ?", (seq,)).fetchone()[0]
    raw.close()
    return str(found)


@pytest.mark.parametrize(("count", "row"), [(1, "9"), (2, "9 to 10")])
def test_records_without_a_signature_are_counted(path: Path, keys: Keys, count: int, row: str) -> None:
    """Appended by SQL, right in every link."""
    with Ledger(path, keys=keys) as ledger:
        head = ledger.head()
    for number in range(count):
        name, created, body = f"{number}" * 32, "2026-05-01T00:00:00.000000+00:00", chain.compact(TOOL)
        digest = chain.record_digest("tool", name, created, "boris", 1, {"serial": f"F{number}"}, body)
        head = chain.Head(head.seq + 1, chain.next_link(head.link, head.seq + 1, "tool", name, created, digest))
        edit(
            path,
            f"INSERT INTO chain VALUES ({head.seq}, 'tool', '{name}', '{created}', '{digest}', '{head.link}')",
            "INSERT INTO tool (seq, id, created, author, version, serial, body) VALUES "
            f"({head.seq}, '{name}', '{created}', 'boris', 1, 'F{number}', '{body}')",
        )
    found = seen(path, keys)
    assert rows(found, "not signed") == [("chain", row)]
    assert len(found.faults) == 1


def test_a_long_ledger_is_read_in_parts_and_says_how_far(tmp_path: Path, keys: Keys) -> None:
    """No row twice, none left out, where the parts meet."""
    where, told = tmp_path / "long.sqlite", []
    with create(where, keys=keys) as ledger:
        ledger.append_all([Draft("tool", {"serial": f"{n}"}, TOOL) for n in range(1200)], author="anna")
        found = verify(ledger, progress=told.append)
    assert (found.ok, found.records, found.head.seq) == (True, 1200, 1200)
    assert told == sorted(told)
    assert 0.3 < told[0] < 0.6
    assert told[-1] == 1.0
    for seq in (500, 501, 1000, 1001, 1200):
        edit(where, f"UPDATE tool SET author = 'boris' WHERE seq = {seq}")
    found = seen(where, keys)
    assert [fault.row.partition(" ")[0] for fault in found.faults] == ["500", "501", "1000", "1001", "1200"]


def test_what_was_accepted_is_counted(path: Path, keys: Keys, tmp_path: Path) -> None:
    """As many heads as contradict the records; what comes later is no part of it."""
    backup_of = tmp_path / "old.sqlite"
    with Ledger(path, keys=keys) as ledger:
        backup(ledger, backup_of)
        for serial in "ABC":
            ledger.append("tool", {"serial": serial}, TOOL, author="anna")
    backup_of.replace(path)
    with Ledger(path, keys=keys) as ledger:
        ledger.accept("the disk failed", author="boris")
        found = verify(ledger)
        assert found.ok, found.faults
        assert "3 signed heads from before that contradict the records" in found.notes
        assert any(note.endswith("by boris: the disk failed") for note in found.notes)


# keys that follow one another


def test_another_key_is_accepted_by_a_person_and_verification_says_so(path: Path, keys: Keys) -> None:
    """Nothing is recorded with it before; afterwards it is a break that is told, and no fault."""
    old = keys.public() or ""
    other = Keys(path.parent / "other").make()
    keys.keep("key.pem", (path.parent / "other" / "key.pem").read_bytes(), mode=0o600)
    keys.keep("public.pem", public_pem(other.public), mode=0o644)
    with Ledger(path, keys=keys) as ledger:
        with pytest.raises(LedgerError, match=rf"{fingerprint(old)}.*the one in .* is.*{fingerprint(other.public)}"):
            ledger.append("tool", {"serial": "NEXT"}, TOOL, author="anna")
        ledger.accept("the laboratory moved", author="anna")
        ledger.append("tool", {"serial": "NEXT"}, TOOL, author="anna")
        found = verify(ledger)
        assert found.ok, found.faults
        told = [note for note in found.notes if note.startswith("break")]
        assert told == [f"break: from record 9 on the key is {fingerprint(other.public)}, accepted by a person"]
        # who trusts the old one alone is told
        assert not verify(ledger, public=[old]).ok
    edit(path, "DELETE FROM head WHERE seq < 9")
    assert seen(path, keys).ok  # the first key's heads are gone: the witness keeps them


def test_a_rotation_is_no_break_even_where_something_was_accepted(path: Path, keys: Keys) -> None:
    """It is explained by the key before, and needs nobody's word."""
    old = keys.public() or ""
    new = keys.rotate("every year").public
    with Ledger(path, keys=keys) as ledger:
        ledger.append("tool", {"serial": "NEXT"}, TOOL, author="anna")
        ledger.accept("a colleague asked", author="anna")
        notes = verify(ledger).notes
    assert f"from record 10 on the key is {fingerprint(new)}; {fingerprint(old)} signed for it" in notes
    assert not any(note.startswith("break") for note in notes)


def test_who_descends_from_whom(tmp_path: Path) -> None:
    """By rotations in their order, each signed by the key before; a lost key leads nowhere."""
    keys = Keys(tmp_path / "keys")
    chain_of = [keys.make().public]
    chain_of += [keys.rotate(f"year {year}").public for year in range(3)]
    keys.path.unlink()
    anew = keys.begin_anew("the disk failed").public
    changes = keys.changes()
    for at, one in enumerate(chain_of):
        for later, other in enumerate(chain_of):
            assert descends(other, one, changes) == (later >= at)
            path = explained(one, other, changes)
            assert (path is not None) == (later >= at)
            if path is not None:
                assert [change["after"] for change in path] == chain_of[at + 1 : later + 1]
        assert not descends(anew, one, changes)
        # a person said that the last of them is lost
        assert [change["action"] for change in explained(one, anew, changes) or ()][-1:] == ["lost"]
    assert keys.former() == []
    keys.rotate("and again")
    assert keys.former() == [anew]


def test_a_key_that_was_rotated_twice_is_known_by_both(path: Path, keys: Keys) -> None:
    """The ledger is looked at on a computer that has the folder of the keys."""
    first = keys.public()
    second = keys.rotate("one").public
    keys.rotate("two")
    assert keys.former() == [second, first]
    assert seen(path, keys).ok


# the shape of a signed head


@pytest.fixture
def head(tmp_path: Path) -> SignedHead:
    """A genuine one."""
    key = Keys(tmp_path / "signer").make()
    return signed_by(key, "a" * 32, chain.Head(7, "b" * 64), b"\1" * 32, "2026-05-01T00:00:00+00:00")


@pytest.mark.parametrize(
    "change",
    [
        {"schema": "another"}, {"version": 2}, {"version": "1"}, {"size": -1}, {"size": True}, {"size": "7"},
        {"size": 7.0}, {"size": None}, {"ledger": "a" * 31}, {"ledger": "a" * 33}, {"ledger": "A" * 32},
        {"ledger": 7}, {"root": "b" * 63}, {"root": "b" * 65}, {"root": "g" * 64}, {"link": "b" * 63},
        {"link": "b" * 65}, {"key": "b" * 63}, {"key": "b" * 65}, {"key": None}, {"time": None}, {"time": "2" * 201},
        {"signature": None}, {"signature": "s" * 201},
    ],
)  # fmt: skip
def test_what_is_no_head_is_refused(head: SignedHead, change: dict[str, Any]) -> None:
    """Each field by itself, with the file that was wanted."""
    for whole in ({**head.statement(), **change}, {k: v for k, v in head.statement().items() if k not in change}):
        with pytest.raises(FileError, match="not the signed head of a ledger"):
            parse_signed(whole, "head.json")


def test_what_is_a_head_is_read(head: SignedHead, tmp_path: Path) -> None:
    """The same again, also of an empty ledger; genuine only while nothing was changed."""
    assert parse_signed(head.statement(), "head.json") == head
    assert head.genuine()
    assert parse_signed({**head.statement(), "size": 0, "root": "0123456789abcdef" * 4}, "head.json").size == 0
    for wrong in ([], None, "head", 7):
        with pytest.raises(FileError, match="not the signed head"):
            parse_signed(wrong, "head.json")
    file = tmp_path / "head.json"
    file.write_text(json.dumps(head.statement()))
    assert read_head(file)[0] == head
    assert str(head).startswith(f"7 of {head.time}")
    for name, value in {"size": 8, "root": "0" * 64, "link": "0" * 64, "time": "later", "ledger": "0" * 32}.items():
        changed = {**head.statement(), name: value}
        assert not parse_signed(changed, "head.json").genuine(), name
        file.write_text(json.dumps(changed))
        with pytest.raises(FileError, match="changed or forged"):
            read_head(file)


def test_heads_of_one_size_need_no_proof_and_of_two_one_that_fits(path: Path, keys: Keys) -> None:
    """By the key of now, or one that it signed for."""
    with Ledger(path, keys=keys) as ledger:
        old = ledger.signed_head()
        old_public = keys.public()
        keys.rotate("every year")
        ledger.append("tool", {"serial": "NEXT"}, TOOL, author="anna")
        new = ledger.signed_head()
    assert old is not None
    assert new is not None
    assert grown(old, old, {}, None) == ""
    proof = proof_since(str(path), 8, new.size)
    content = {"consistency": {"from": 8, "proof": proof}, "changes": [7, *keys.changes()]}
    assert grown(old, new, content, None) == grown(old, new, content, old_public) == ""
    assert "did not sign" in grown(old, new, {**content, "changes": []}, None)
    assert "from record 7, not from 8" in grown(old, new, {**content, "consistency": {"from": 7, "proof": proof}}, None)
    assert "does not begin with" in grown(old, new, {**content, "consistency": {"from": 8, "proof": []}}, None)
    twin = SignedHead(**{**vars(old), "root": "0" * 64})
    assert "does not begin with" in grown(twin, old, {}, None)


# keys in files


def test_public_keys_in_a_file(tmp_path: Path, keys: Keys) -> None:
    """One, several, none, a private one."""
    made = [Keys(tmp_path / f"{n}").make().public for n in range(2)]
    file = tmp_path / "public.pem"
    file.write_bytes(b"".join(public_pem(one) for one in made))
    assert read_public(file).keys == tuple(made)
    assert read_public(file).certificates == ()
    file.write_text("-----BEGIN PUBLIC KEY-----\nAAAA\n-----END PUBLIC KEY-----\n")
    with pytest.raises(FileError, match="not the public key of a laboratory"):
        read_public(file)
    with pytest.raises(FileError, match="give nobody this file"):
        read_public(tmp_path / "0" / "key.pem")
    with pytest.raises(FileError, match="no such file"):
        read_public(tmp_path / "nowhere.pem")


def test_a_key_is_made_once_and_kept_from_others(tmp_path: Path, keys: Keys) -> None:
    """Of two that begin at once, one key; modes of the files; a file that another replaced is read again."""
    assert not keys.there
    assert keys.public() is None
    with pytest.raises(LedgerError, match="ledger key --make"):
        keys.signing()
    first = keys.make().public
    assert Keys(keys.folder).make().public == keys.make().public == keys.public() == first
    keys._write_new(Keys(tmp_path / "other").make().private, replace=False)
    assert keys.signing().public == first
    modes = {name: (keys.folder / name).stat().st_mode & 0o777 for name in ("key.pem", "public.pem")}
    assert modes == {"key.pem": 0o600, "public.pem": 0o644}
    assert keys.folder.stat().st_mode & 0o777 == 0o700
    assert sorted(one.name for one in keys.folder.iterdir()) == ["key.pem", "public.pem"]
    elsewhere = Keys(keys.folder).rotate("by another program").public
    assert keys.signing().public == elsewhere
    for words in ("", "  "):
        with pytest.raises(InputError, match="without a reason"):
            keys.rotate(words)


def test_statements_of_changes_that_were_changed_are_named(keys: Keys) -> None:
    """A line that is no statement, or that its key did not sign, with its number."""
    keys.make()
    keys.rotate("every year")
    (whole,) = keys.changes()
    file = keys.folder / "changes.jsonl"
    # one spelling of a signature only
    spelt = {**whole, "signature": whole["signature"][:-3] + chr(ord(whole["signature"][-3]) + 1) + "=="}
    for wrong in ({**whole, "reason": "another"}, {**whole, "signature": "x"}, {**whole, "key": 7}, spelt, [], 7):
        for lines, at in (((wrong, whole), 1), ((whole, wrong), 2)):
            file.write_text("".join(json.dumps(one) + "\n" for one in lines))
            with pytest.raises(FileError, match=rf"changes\.jsonl, line {at}: not what a laboratory's key signed"):
                keys.changes()
    file.write_text(json.dumps(whole) + "\n\n")
    assert keys.changes() == [whole]


# time


def test_the_clock_may_go_back_two_minutes(tmp_path: Path, keys: Keys) -> None:
    """To the second, and the refusal says both times."""
    now = datetime(2026, 5, 1, 12, tzinfo=UTC)
    clock = [now]
    create(tmp_path / "t.sqlite", keys=keys).close()
    with Ledger(tmp_path / "t.sqlite", clock=lambda: clock[0], keys=keys) as ledger:
        ledger.append("tool", {"serial": "A"}, TOOL, author="anna")
        clock[0] = now - timedelta(minutes=2, seconds=1)
        with pytest.raises(LedgerError, match="2026-05-01 11:57:59 UTC, but the last record is of 2026-05-01T12:00:00"):
            ledger.append("tool", {"serial": "B"}, TOOL, author="anna")
        clock[0] = now - timedelta(minutes=2)
        ledger.append("tool", {"serial": "B"}, TOOL, author="anna")


# what is stored, and what is asked of a witness over HTTP


def test_the_tables_of_the_program_are_those_of_the_migrations(path: Path) -> None:
    """Columns, what may be empty, what is unique, what is indexed."""
    from alembic.autogenerate import compare_metadata
    from alembic.migration import MigrationContext

    with engine(path).connect() as connection:
        found = compare_metadata(MigrationContext.configure(connection), METADATA)
        # indexes for speed stand in the migrations alone
        assert [one for one in found if one[0] != "remove_index"] == []
        inspected = inspect(connection)
        for name, table in METADATA.tables.items():
            assert inspected.get_pk_constraint(name)["constrained_columns"] == [key.name for key in table.primary_key]
            # a constraint without a name is none that alembic compares
            unique = [list(one.columns.keys()) for one in table.constraints if isinstance(one, UniqueConstraint)]
            assert sorted(one["column_names"] for one in inspected.get_unique_constraints(name)) == sorted(unique)


def asked(address: str, body: object = None, length: str = "") -> tuple[int, str]:
    """Status and text of an answer; POST where there is a body."""
    data = None if body is None else body if isinstance(body, bytes) else json.dumps(body).encode()
    request = urllib.request.Request(address, data, {"content-length": length} if length else {})
    try:
        with urllib.request.urlopen(request, timeout=20) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


def test_a_witness_over_http_keeps_what_only_grew(path: Path, keys: Keys, tmp_path: Path) -> None:
    """Each answer, and what it keeps and says of whom it refused."""
    with Ledger(path, keys=keys) as ledger:
        newest = ledger.signed_head()
        with ledger.snapshot() as connection:
            heads = {row.seq: head_of(row) for row in connection.execute(select(HEAD))}
    assert newest is not None
    far, told = tmp_path / "of" / "others", []
    running = server(far, "127.0.0.1", 0, keys.public(), told.append)
    thread = threading.Thread(target=running.serve_forever, daemon=True)
    thread.start()
    address = f"http://127.0.0.1:{running.server_address[1]}/heads"
    try:
        own = f"{address}/{newest.ledger}"
        assert asked(own) == (404, "no head of such a ledger")
        stranger = signed_by(Keys(tmp_path / "s").make(), "a" * 32, chain.Head(1, "b" * 64), b"\1" * 32, newest.time)
        status, text = asked(address, {"head": stranger.statement()})
        assert (status, f"this witness keeps heads of {fingerprint(newest.key)}" in text) == (409, True)
        assert asked(address, {"head": heads[5].statement(), "where": "w" * 600}) == (201, "kept")
        assert asked(address, {"head": heads[5].statement()})[0] == 201  # told twice
        assert asked(address, {"head": heads[4].statement()})[0] == 409
        assert "had 5 records before: it was cut" in told[-1]
        assert asked(address, {"head": newest.statement()})[0] == 409
        assert "carries no proof from record 5" in told[-1]
        proof = {"from": 5, "proof": proof_since(str(path), 5, 8)}
        changed = {**newest.statement(), "time": "2026-05-01T00:00:00+00:00"}
        assert asked(address, {"head": changed, **proof}) == (409, "its signature is not that of its key")
        assert asked(address, {"head": newest.statement(), **proof}) == (201, "kept")
        for wrong in (b"rubbish", {}, [], {"head": 7}):
            assert asked(address, wrong) == (400, "not a signed head")
        for place in (f"{address}/x", address.removesuffix("heads")):
            assert asked(place, b"")[0] == 400
        assert asked(address, b"", "1000001")[0] == 400  # announced, and not waited for
        status, text = asked(own)
        kept = [json.loads(line) for line in text.splitlines()]
        assert (status, [one["size"] for one in kept]) == (200, [5, 5, 8])
        assert [len(one["where"]) for one in kept] == [500, 0, 0]
        assert [one.name for one in far.iterdir()] == [f"{newest.ledger}.jsonl"]
        assert len(told) == 4
    finally:
        running.shutdown()
        running.server_close()
        thread.join()


def test_long_texts_numbers_and_pages(path: Path, keys: Keys) -> None:
    """The ends of what is allowed, and where pages of a list meet."""
    with Ledger(path, keys=keys) as ledger:
        for text in ("x", "x" * 200):
            ledger.append("tool", {"serial": text}, TOOL, author=text)
            assert ledger.latest("tool", serial=text) is not None
        serials = [record.keys["serial"] for record in ledger.current("tool", limit=4)]
        more = ledger.current("tool", after=serials[-1])
        whole = [*serials, *(record.keys["serial"] for record in more)]
        assert whole == sorted({f"T{n}" for n in range(8)} | {"x", text})
        assert [record.seq for record in ledger.find("tool", after=3, limit=2)] == [4, 5]
        assert [record.seq for record in ledger.find("tool", newest=True, after=4, limit=2)] == [3, 2]
        assert ledger.find("tool", limit=0) == []
        for name in ("", " x", "x" * 201):
            with pytest.raises(LedgerError, match="there is no tool record"):
                ledger.get("tool", name)
        body = {"dial_deg": [0.0, 90.0, 0.0], "channels": {"accelerometer": [1.0]}, "count": 5, "captured": "key"}
        for position in (0, 2**31 - 1):
            ledger.append("reading", {"session": "s", "position": position, "attempt": 1}, body, author="anna")
            assert ledger.count("reading", position=position) == 1
        with pytest.raises(InputError, match=r"reading\.position is a number of 66 bits; .* 0 to 2147483647"):
            ledger.append("reading", {"session": "s", "position": 2**65, "attempt": 1}, body, author="anna")
        assert verify(ledger).ok


# where things are kept, and who may read them


def test_folders_of_keys_and_witnesses_are_their_owners_alone(path: Path, keys: Keys, tmp_path: Path) -> None:
    """Whoever can list them knows which ledgers there are."""
    name_others(tmp_path / "deep" / "other", ["print"])
    for folder in (keys.folder, keys.folder / "heads", tmp_path / "deep" / "other"):
        assert folder.stat().st_mode & 0o777 == 0o700, folder


def test_where_keys_and_ledgers_are_when_nobody_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As the desktop's rules have it, else below the home; a folder that is named goes before."""
    for name in (FOLDER, "XDG_CONFIG_HOME", "XDG_DATA_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    assert default_folder() == Keys().folder == tmp_path / ".config" / "inclinometry" / "keys"
    assert default_path() == tmp_path / ".local" / "share" / "inclinometry" / "ledger.sqlite"
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "c"))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "d"))
    assert default_folder() == tmp_path / "c" / "inclinometry" / "keys"
    assert default_path() == tmp_path / "d" / "inclinometry" / "ledger.sqlite"
    monkeypatch.setenv(FOLDER, str(tmp_path / "named"))
    assert Keys().folder == tmp_path / "named"


class Terminal(io.StringIO):
    """A standard input at which somebody sits, or not."""

    def __init__(self, there: bool) -> None:
        super().__init__()
        self._there = there

    def isatty(self) -> bool:
        return self._there


def test_a_passphrase_is_asked_for_where_somebody_sits(keys: Keys, monkeypatch: pytest.MonkeyPatch) -> None:
    """Once; a program without a terminal is told how to give it, and a key of another kind is none."""
    public = keys.make().public
    monkeypatch.setenv(PASSPHRASE, "")
    keys.set_passphrase("correct horse")
    asked_for: list[str] = []
    monkeypatch.setattr("getpass.getpass", lambda text: asked_for.append(text) or "correct horse")
    monkeypatch.delenv(PASSPHRASE)
    monkeypatch.setattr("sys.stdin", Terminal(False))
    with pytest.raises(LedgerError, match=f"into the environment as {PASSPHRASE}"):
        Keys(keys.folder).signing()
    monkeypatch.setattr("sys.stdin", Terminal(True))
    assert Keys(keys.folder).signing().public == Keys(keys.folder).signing().public == public
    assert len(asked_for) == 1
    monkeypatch.setenv(PASSPHRASE, "")
    keys.set_passphrase("")
    assert b"ENCRYPTED" not in keys.path.read_bytes()
    other = ec.generate_private_key(ec.SECP256R1())
    keys.path.write_bytes(private_pem(other))
    with pytest.raises(LedgerError, match="a key of another kind"):
        Keys(keys.folder).signing()
    keys.path.write_text("nonsense")
    with pytest.raises(LedgerError, match="restore it from a copy"):
        Keys(keys.folder).signing()
