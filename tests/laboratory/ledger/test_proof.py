"""Who can write to the database and has not the laboratory's key: whatever they do is found, and by `verify` alone."""

from __future__ import annotations

import json
import shutil
import sqlite3
import threading
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from inclinometry.errors import FileError, InputError
from inclinometry.laboratory.certificate.status import make_status
from inclinometry.laboratory.ledger import chain
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.engine import Draft, engine
from inclinometry.laboratory.ledger.exchange import backup, export, restore
from inclinometry.laboratory.ledger.heads import KEY_EVENT, SignedHead, grown, parse_signed, proof_since, signed_by
from inclinometry.laboratory.ledger.keys import CHANGE, PASSPHRASE, Keys, descends, fingerprint, genuine, read_public
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError
from inclinometry.laboratory.ledger.verify import Verdict, verify
from inclinometry.laboratory.ledger.witness import name_others, others, witnessed
from inclinometry.laboratory.ledger.witness_server import server

TOOL = {"name": "steering tool", "triads": {}}


@pytest.fixture
def keys(tmp_path: Path) -> Keys:
    """A folder of keys of this test's own."""
    return Keys(tmp_path / "keys")


Opened = Callable[[], Ledger]


@pytest.fixture
def opened(place: Callable[[], str], keys: Keys) -> Opened:
    """Opens one ledger of eight tools, each recorded by itself, on each engine."""
    where = place()
    with create(where, keys=keys) as ledger:
        for number in range(8):
            ledger.append("tool", {"serial": f"T{number}"}, TOOL, author="anna")
    return lambda: Ledger(where, keys=keys)


def edit(ledger: Ledger, *statements: str) -> None:
    """SQL by somebody who may do everything in the database."""
    with engine(ledger.where).begin() as connection:
        tables = ("chain", "tool", "event", "head")
        if connection.dialect.name == "sqlite":
            triggers = connection.exec_driver_sql("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'").all()
            for name, _ in triggers:
                connection.exec_driver_sql(f"DROP TRIGGER {name}")
        else:
            for table in tables:
                connection.exec_driver_sql(f"ALTER TABLE {table} DISABLE TRIGGER append_only")
        for statement in statements:
            connection.exec_driver_sql(statement)
        if connection.dialect.name == "sqlite":
            for _, text in triggers:
                connection.exec_driver_sql(text)
        else:
            for table in tables:
                connection.exec_driver_sql(f"ALTER TABLE {table} ENABLE TRIGGER append_only")


def cut(ledger: Ledger, after: int) -> None:
    """The tail removed, with the heads that speak of it."""
    edit(
        ledger,
        f"DELETE FROM tool WHERE seq > {after}",
        f"DELETE FROM event WHERE seq > {after}",
        f"DELETE FROM head WHERE seq > {after}",
        f"DELETE FROM chain WHERE seq > {after}",
    )


def forged(ledger: Ledger, author: str = "boris") -> list[str]:
    """SQL that appends a record in another's name, right in every digest and link."""
    head = ledger.head()
    name, created, body = "f" * 32, "2026-05-01T00:00:00.000000+00:00", chain.compact(TOOL)
    digest = chain.record_digest("tool", name, created, author, 1, {"serial": "FORGED"}, body)
    link = chain.next_link(head.link, head.seq + 1, "tool", name, created, digest)
    seq = head.seq + 1
    return [
        f"INSERT INTO chain VALUES ({seq}, 'tool', '{name}', '{created}', '{digest}', '{link}')",
        "INSERT INTO tool (seq, id, created, author, version, serial, body) VALUES "
        f"({seq}, '{name}', '{created}', '{author}', 1, 'FORGED', '{body}')",
    ]


def head_row(head: SignedHead, place: int) -> str:
    return (
        "INSERT INTO head (place, seq, ledger, root, link, created, key, signature) VALUES "
        f"({place}, {head.size}, '{head.ledger}', '{head.root}', '{head.link}', '{head.time}', '{head.key}', "
        f"'{head.signature}')"
    )


def said(verdict: Verdict) -> str:
    return "\n".join([*map(str, verdict.faults), *verdict.notes])


def test_a_ledger_that_nobody_touched_is_sound_signed_and_witnessed(opened: Opened, keys: Keys) -> None:
    with opened() as ledger:
        found = verify(ledger)
        assert found.ok
        assert found.signed is not None
        assert found.signed.size == 8
        assert "signed up to record 8" in said(found)
        assert "(the laboratory's)" in said(found)
        assert f"witness {keys.folder / 'heads'}: agrees up to record 8" in said(found)
    assert keys.path.stat().st_mode & 0o077 == 0


def test_a_cut_tail_is_found(opened: Opened, keys: Keys) -> None:
    """Nothing is recorded upon it while the witness here remembers; when it is away, it is found by it later."""
    with opened() as ledger:
        cut(ledger, 5)
        found = verify(ledger)
        assert [fault.row for fault in found.faults if "ends before the signed head" in fault.problem] == ["6 to 8"]
        with pytest.raises(
            LedgerError, match=r"signed record 8 of this ledger .* in this place: .*ledger init .* --accept REASON"
        ):
            ledger.append("tool", {"serial": "NEW"}, TOOL, author="anna")
        assert ledger.head().seq == 5
        (keys.folder / "heads").rename(keys.folder / "away")
        ledger.append("tool", {"serial": "NEW"}, TOOL, author="anna")
        ledger.append_all([Draft("tool", {"serial": "NEWER"}, TOOL)] * 5, author="anna")
        shutil.rmtree(keys.folder / "heads")
        (keys.folder / "away").rename(keys.folder / "heads")
        assert "not those that were signed" in said(verify(ledger))


def test_everything_cut_is_found(opened: Opened) -> None:
    """Even the heads, and even where a ledger of somebody else's is put in the place."""
    with opened() as ledger:
        cut(ledger, -1)
        assert "is signed, and this one is not" in said(verify(ledger))


def test_another_ledger_in_the_place_is_found(tmp_path: Path, keys: Keys) -> None:
    path, other = tmp_path / "lab.sqlite", tmp_path / "other.sqlite"
    strange = Keys(tmp_path / "strange")
    for where, by in ((path, keys), (other, strange)):
        with create(where, keys=by) as ledger:
            ledger.append("tool", {"serial": "A"}, TOOL, author="anna")
    shutil.copy(other, path)
    with Ledger(path, keys=keys) as ledger:
        found = verify(ledger)
    assert "another ledger" in said(found)
    assert "not by the laboratory's" in said(found)
    # an auditor who has a key of an own looks at it in another place: no fault, and no proof before --key is given
    with Ledger(other, keys=keys) as ledger:
        found = verify(ledger)
        assert found.ok
        assert not found.proven
        by, here = fingerprint(str(strange.public())), fingerprint(str(keys.public()))
        assert f"by the key {by}, and the key here is {here}; name the public key" in found.notes[0]
        assert "--key PUBLIC.pem" in found.notes[0]
        assert not verify(ledger, public=[str(keys.public())]).ok
        assert verify(ledger, public=[str(strange.public())]).proven
    # who has no key at all compares it
    with Ledger(other, keys=Keys(tmp_path / "none")) as ledger:
        found = verify(ledger)
        assert found.proven
        assert "compare it with the laboratory's" in said(found)


def test_an_older_copy_put_back_is_found(tmp_path: Path, keys: Keys) -> None:
    """And a backup that was put back by who may do so goes on, with the reason, when it is stated."""
    path = tmp_path / "lab.sqlite"
    with create(path, keys=keys) as ledger:
        ledger.append("tool", {"serial": "A"}, TOOL, author="anna")
        backup(ledger, tmp_path / "old.sqlite")
        ledger.append("tool", {"serial": "B"}, TOOL, author="anna")
    for file in tmp_path.glob("lab.sqlite*"):
        file.unlink()
    shutil.copy(tmp_path / "old.sqlite", path)
    with Ledger(path, keys=keys) as ledger:
        assert "ends before the signed head" in said(verify(ledger))
        with pytest.raises(InputError, match="without a reason"):
            ledger.accept(" ", author="anna")
        ledger.accept("the disk failed, the backup of Monday was put back", author="anna")
        found = verify(ledger)
        assert found.ok, found.faults
        assert "by anna: the disk failed" in said(found)
        ledger.append("tool", {"serial": "C"}, TOOL, author="anna")
        assert verify(ledger).ok
    # what was accepted is no leave for what comes later
    with Ledger(path, keys=keys) as ledger:
        cut(ledger, 2)
        assert not verify(ledger).ok
    # the backup itself is sound when it is said to be one, and says what it is
    with Ledger(tmp_path / "old.sqlite", keys=keys) as copy:
        assert "--copy" in said(verify(copy))
        found = verify(copy, copy=True)
        assert found.ok
        assert "this is a copy" in said(found)


@pytest.mark.parametrize("way", ["a link in its place", "another name", "the ledger as a link", "a folder's link"])
def test_an_older_copy_is_found_whatever_its_path(tmp_path: Path, keys: Keys, way: str) -> None:
    """Witnesses know a ledger by its name, not by its place: nothing is recorded or certified upon an older state."""
    (tmp_path / "now").mkdir()
    (tmp_path / "then").mkdir()
    (tmp_path / "lab").symlink_to(tmp_path / "now")
    path = tmp_path / "lab" / "lab.sqlite"
    old = tmp_path / "then" / "lab.sqlite"
    if way == "the ledger as a link":
        path.symlink_to(tmp_path / "data.sqlite")
    with create(path, keys=keys) as ledger:
        ledger.append("tool", {"serial": "A"}, TOOL, author="anna")
        backup(ledger, old)
        ledger.append("tool", {"serial": "B"}, TOOL, author="anna")
    with Ledger(path, keys=keys) as ledger:
        assert verify(ledger).ok
    if way == "a folder's link":
        (tmp_path / "lab").unlink()
        (tmp_path / "lab").symlink_to(tmp_path / "then")
    else:
        path.unlink()
        if way == "another name":
            path = old
        else:
            path.symlink_to(old)
    with Ledger(path, keys=keys) as ledger:
        assert "ends before the signed head kept by" in said(verify(ledger))
        for sign in (lambda: ledger.append("tool", {"serial": "C"}, TOOL, author="anna"), lambda: make_status(ledger)):
            with pytest.raises(LedgerError, match="nothing was recorded or signed"):
                sign()
        assert ledger.head().seq == 1


def test_another_ledger_behind_a_link_is_found(tmp_path: Path, keys: Keys) -> None:
    """One of the same key, sound in its own place; or one that is not signed."""
    path = tmp_path / "lab.sqlite"
    create(path, keys=keys).close()
    for name, sign, wanted in (("b.sqlite", True, "another ledger"), ("c.sqlite", False, "this one is not")):
        with create(tmp_path / name, keys=keys, sign=sign) as other:
            other.append("tool", {"serial": "A"}, TOOL, author="anna")
            assert verify(other).ok
        path.unlink()
        path.symlink_to(tmp_path / name)
        with Ledger(path, keys=keys) as ledger:
            assert wanted in said(verify(ledger))


def test_a_record_appended_by_sql_is_found_and_never_signed(opened: Opened) -> None:
    """The next record of the program would sign for it: it is refused until somebody answers for it."""
    with opened() as ledger:
        edit(ledger, *forged(ledger))
        found = verify(ledger)
        assert ("chain", "9") in [(f.table, f.row) for f in found.faults if "not signed" in f.problem]
        with pytest.raises(LedgerError, match=r"changed behind its back .*ledger init --accept REASON"):
            ledger.append("tool", {"serial": "NEXT"}, TOOL, author="anna")
    with opened() as ledger:
        ledger.accept("a colleague's script; the record is right", author="anna")
        ledger.append("tool", {"serial": "NEXT"}, TOOL, author="anna")
        assert verify(ledger).ok


@pytest.mark.parametrize("by", ["another key", "no key", "an old signature"])
def test_a_forged_head_is_found(opened: Opened, tmp_path: Path, by: str) -> None:
    """Signed by another key, by none, or an old signature under new content."""
    with opened() as ledger:
        newest = ledger.signed_head()
        assert newest is not None
        edit(ledger, *forged(ledger))
        head = ledger.head()
        fake = signed_by(Keys(tmp_path / "forger").make(), newest.ledger, head, b"\0" * 32, newest.time)
        if by == "no key":
            fake = SignedHead(**{**vars(fake), "key": newest.key})
        elif by == "an old signature":
            fake = SignedHead(**{**vars(fake), "key": newest.key, "signature": newest.signature})
        edit(ledger, head_row(fake, 100))
        found = verify(ledger)
        assert not found.ok
        wanted = "for which the key before did not sign" if by == "another key" else "changed or forged"
        assert wanted in said(found)
    with opened() as ledger, pytest.raises(LedgerError, match="nothing was recorded"):
        ledger.append("tool", {"serial": "NEXT"}, TOOL, author="anna")


@pytest.mark.parametrize("seq", [5, 8])
def test_a_head_that_is_none_is_named(tmp_path: Path, keys: Keys, seq: int) -> None:
    """Text in the place of a number (SQLite keeps it): a fault, and nothing is recorded upon the newest."""
    path = tmp_path / "lab.sqlite"
    with create(path, keys=keys) as ledger:
        for number in range(8):
            ledger.append("tool", {"serial": f"T{number}"}, TOOL, author="anna")
        edit(ledger, f"UPDATE head SET seq = 'abc', signature = 'x' WHERE seq = {seq}")
        assert "cannot be read as a signed head" in said(verify(ledger))
    with Ledger(path, keys=keys) as ledger:
        if seq == 8:
            with pytest.raises(LedgerError, match="run `inclinometry ledger verify`"):
                ledger.append("tool", {"serial": "NEXT"}, TOOL, author="anna")
        edit(ledger, "UPDATE head SET seq = 'abc'")
        assert "cannot be read as a signed head" in said(verify(ledger))


@pytest.mark.parametrize(
    ("change", "named"),
    [("key = 'no key'", "cannot be read as a signed head"), ("frontier = 'ab'", "the peaks of the tree")],
)
def test_a_field_of_a_head_that_was_changed(opened: Opened, change: str, named: str) -> None:
    """Its key is none any more; or peaks stand beside it that are not those of its tree."""
    with opened() as ledger:
        edit(ledger, f"UPDATE head SET {change} WHERE seq = 5")
        assert named in said(verify(ledger))


def test_a_rewritten_record_is_found(opened: Opened) -> None:
    """Its body, its author, and every digest and link after it, worked out anew."""
    with opened() as ledger:
        with ledger.snapshot() as connection:
            links = connection.exec_driver_sql(
                "SELECT seq, kind, record, created, digest FROM chain ORDER BY seq"
            ).all()
        previous, rows = chain.GENESIS, []
        for seq, kind, name, created, digest in links:
            if seq == 4:
                digest = chain.record_digest(kind, name, created, "boris", 1, {"serial": "T3"}, chain.compact(TOOL))
                rows.append("UPDATE tool SET author = 'boris' WHERE seq = 4")
            previous = chain.next_link(previous, seq, kind, name, created, digest)
            rows.append(f"UPDATE chain SET digest = '{digest}', link = '{previous}' WHERE seq = {seq}")
        edit(ledger, *rows)
        found = verify(ledger)
        assert {fault.table for fault in found.faults} == {"head"}
        assert found.faults[0].row.startswith("4 ")
    with opened() as ledger, pytest.raises(LedgerError, match="changed behind its back"):
        ledger.append("tool", {"serial": "NEXT"}, TOOL, author="anna")


def test_a_rotated_key_is_followed(opened: Opened, keys: Keys, tmp_path: Path) -> None:
    """The old key signs for the new one, in the ledger; who knows the old one trusts the new one."""
    old = str(keys.public())
    keys.rotate("every year")
    new = str(keys.public())
    assert new != old
    with opened() as ledger:
        assert verify(ledger).ok  # not written to since
        ledger.append("tool", {"serial": "NEXT"}, TOOL, author="anna")
        keys.rotate("and again")
        ledger.append("tool", {"serial": "NEXT"}, TOOL, author="anna")
        found = verify(ledger)
        assert found.ok, found.faults
        assert f"the key is {fingerprint(new)}; {fingerprint(old)} signed for it" in said(found)
        assert verify(ledger, public=[old]).ok
        assert ledger.count("event", subject="key", action="rotated") == 2
        assert not verify(ledger, public=["ab" * 32]).ok
    (change, _) = keys.changes()
    assert genuine(change)
    assert descends(new, old, [change])
    assert not descends(old[::-1], old, [{**change, "after": old[::-1]}])
    assert not descends(old, new, [change])


def test_a_lost_key_is_no_lost_ledger(opened: Opened, keys: Keys) -> None:
    """Recording stops until a new key is begun; verification says the break; who trusts the old key alone is told."""
    old = str(keys.public())
    keys.path.unlink()
    with opened() as ledger:
        assert verify(ledger).ok
        with pytest.raises(LedgerError, match=r"ledger key --lost REASON"):
            ledger.append("tool", {"serial": "NEXT"}, TOOL, author="anna")
        assert ledger.head().seq == 8
    keys.begin_anew("the laptop was stolen")
    with opened() as ledger:
        ledger.append("tool", {"serial": "NEXT"}, TOOL, author="anna")
        found = verify(ledger)
        assert found.ok, found.faults
        assert "break: from record" in said(found)
        assert "the laptop was stolen" in said(found)
        assert not verify(ledger, public=[old]).ok
    with pytest.raises(InputError, match="without a reason"):
        keys.begin_anew("")


def test_a_ledger_is_sound_as_soon_as_a_lost_key_is_stated(opened: Opened, keys: Keys, tmp_path: Path) -> None:
    """Before anything is recorded with the new one: a break that is told; a real change is found all the same."""
    old = Keys(tmp_path / "thief")
    shutil.copytree(keys.folder, old.folder)
    keys.path.unlink()
    keys.begin_anew("the laptop was stolen")
    new = fingerprint(str(keys.public()))
    with opened() as ledger:
        found = verify(ledger)
        assert found.proven, found.faults
        (told,) = [note for note in found.notes if note.startswith("break")]
        assert told.startswith(f"break: from record 9 on the key is {new}, for which the one before did not sign")
        assert told.endswith("said to be lost: the laptop was stolen")
        assert "(the laboratory's until it was lost)" in said(found)
        assert not verify(ledger, public=[str(keys.public())]).ok
        # the witness here is missed as before
        (file,) = (keys.folder / "heads").iterdir()
        file.rename(tmp_path / "away")
        assert "is missing" in said(verify(ledger))
        (tmp_path / "away").rename(file)
        edit(ledger, "UPDATE tool SET author = 'boris' WHERE seq = 4")
        assert [fault.row.partition(" ")[0] for fault in verify(ledger).faults] == ["4"]
        edit(ledger, "UPDATE tool SET author = 'anna' WHERE seq = 4")
    # whoever has the stolen key goes on with it: that is no head from before the loss
    late = datetime.now(UTC) + timedelta(minutes=1)
    with Ledger(ledger.where, keys=old, clock=lambda: late) as stolen:
        stolen.append("tool", {"serial": "S"}, TOOL, author="anna")
    with opened() as ledger:
        assert "not by the laboratory's" in said(verify(ledger))


def test_a_loss_that_another_key_states_explains_nothing(opened: Opened, keys: Keys, tmp_path: Path) -> None:
    """The new key says itself that the old one is lost: whoever has but the folder cannot."""
    before, forger = str(keys.public()), Keys(tmp_path / "forger").make()
    own = Keys(tmp_path / "own").make().public
    content = {"schema": CHANGE, "version": 1, "action": "lost", "before": before, "after": own, "reason": "so",
               "time": "2099-01-01T00:00:00+00:00"}  # fmt: skip
    (tmp_path / "own" / "changes.jsonl").write_text(chain.compact(forger.statement(content)) + "\n")
    with opened() as ledger, Ledger(ledger.where, keys=Keys(tmp_path / "own")) as looked:
        found = verify(looked)
        assert not found.proven
        assert not any(note.startswith("break") for note in found.notes)
        with pytest.raises(LedgerError, match="nothing was recorded"):
            looked.append("tool", {"serial": "S"}, TOOL, author="anna")


def test_a_rotation_that_the_key_before_did_not_sign_explains_nothing(
    opened: Opened, keys: Keys, tmp_path: Path
) -> None:
    """Whoever writes to the ledger names a key of his own as the one that followed."""
    before, forger = str(keys.public()), Keys(tmp_path / "forger").make()
    content = {"schema": CHANGE, "version": 1, "action": "rotated", "before": before, "after": forger.public,
               "reason": "so", "time": "2026-05-01T00:00:00+00:00"}  # fmt: skip
    change = {**forger.statement(content), "key": before}
    with opened() as ledger:
        ledger.append("event", {**KEY_EVENT, "action": "rotated"}, {"details": change}, author="boris")
        newest = ledger.signed_head()
        assert newest is not None
        edit(ledger, *forged(ledger))
        edit(ledger, head_row(signed_by(forger, newest.ledger, ledger.head(), b"\0" * 32, newest.time), 100))
        assert "for which the key before did not sign" in said(verify(ledger))


@pytest.mark.parametrize(
    "junk", [b"", b"junk", b"\xff\0" * 99, b"-----BEGIN PUBLIC KEY-----\nAAAA\n-----END PUBLIC KEY-----"]
)
def test_junk_in_the_place_of_the_public_key_is_named(opened: Opened, keys: Keys, junk: bytes) -> None:
    """Nothing is called sound by what it holds; recording goes on, and writes it anew from the private key."""
    public, file = keys.public(), keys.folder / "public.pem"
    file.write_bytes(junk)
    with opened() as ledger:
        with pytest.raises(FileError, match=r"public\.pem: not a public key any more; .*ledger key --make"):
            verify(ledger)
        ledger.append("tool", {"serial": "NEXT"}, TOOL, author="anna")
        assert keys.public() == public
        assert verify(ledger).proven
    # and where the private key is lost, too, a new one is begun
    file.write_bytes(junk)
    keys.path.unlink()
    keys.begin_anew("the disk failed")
    with opened() as ledger:
        assert any(note.startswith("break") for note in verify(ledger).notes)
        ledger.append("tool", {"serial": "LAST"}, TOOL, author="anna")
        assert verify(ledger).proven


@pytest.mark.parametrize(
    ("junk", "line"),
    [(b"junk\n", 2), (b"{}\n", 2), (b"\xff\n", 2), (b"[" * 100_000 + b"\n", 2), (b"\n7", 3), (b'"a"', 2)],
)
def test_junk_among_the_changes_of_keys_is_named(opened: Opened, keys: Keys, junk: bytes, line: int) -> None:
    """With its line, of what was signed and changed since, too; recording with the same key needs none of it."""
    keys.rotate("every year")
    with opened() as ledger:
        ledger.append("tool", {"serial": "NEXT"}, TOOL, author="anna")
    file = keys.folder / "changes.jsonl"
    right = file.read_bytes()
    for data, at in ((right + junk, line), (right.replace(b"every year", b"every hour"), 1)):
        file.write_bytes(data)
        with opened() as ledger:
            with pytest.raises(FileError, match=rf"changes\.jsonl, line {at}: .*restore the file from a copy"):
                verify(ledger)
            ledger.append("tool", {"serial": f"NEXT {at}"}, TOOL, author="anna")
    file.write_bytes(right)
    with opened() as ledger:
        assert verify(ledger).proven
    file.unlink()  # the ledger has recorded it
    with opened() as ledger:
        assert verify(ledger).proven


@pytest.mark.parametrize("name", ["key.pem", "public.pem", "changes.jsonl", "witnesses.txt"])
def test_what_has_no_end_is_not_read(tmp_path: Path, keys: Keys, name: str) -> None:
    """A device, or a file of more bytes than such a one can have, in the place of one of the keys' files."""
    keys.make()
    asked = {"key.pem": keys.signing, "public.pem": keys.public, "changes.jsonl": keys.changes}
    ask = asked.get(name, lambda: others(keys.folder))
    file = keys.folder / name
    file.unlink(missing_ok=True)
    file.symlink_to("/dev/zero")
    with pytest.raises(FileError, match="a device, which has no end"):
        ask()
    file.unlink()
    with file.open("wb") as stream:
        stream.truncate(3_000_000_000)
    with pytest.raises(FileError, match=r"it has 3,000,000,000 bytes; allowed"):
        ask()


@pytest.mark.parametrize("whose", ["a folder", "this computer"])
def test_what_has_no_end_is_no_witness(tmp_path: Path, keys: Keys, whose: str) -> None:
    """A device, or more bytes than heads can be, where a witness kept them: it says nothing, and nothing is proven."""
    path, share = tmp_path / "lab.sqlite", tmp_path / "share"
    share.mkdir()
    name_others(keys.folder, [str(share)])
    with create(path, keys=keys) as ledger:
        ledger.append("tool", {"serial": "A"}, TOOL, author="anna")
    (file,) = (share if whose == "a folder" else keys.folder / "heads").iterdir()
    file.unlink()
    for turn, wanted in enumerate(("a device, which has no end", "it has 3,000,000,000 bytes; allowed")):
        if turn:
            file.unlink()
            with file.open("wb") as stream:
                stream.truncate(3_000_000_000)
        else:
            file.symlink_to("/dev/zero")
        with Ledger(path, keys=keys) as ledger:
            found = verify(ledger)
            assert found.ok
            assert not found.proven
            assert any(wanted in sentence for sentence in found.silent), found.silent


def test_a_whole_folder_lost(opened: Opened, tmp_path: Path, keys: Keys) -> None:
    """Key, public key and witness are gone: a new key can be begun, which names none before it."""
    shutil.rmtree(keys.folder)
    keys.begin_anew("the disk failed")
    with opened() as ledger:
        ledger.append("tool", {"serial": "NEXT"}, TOOL, author="anna")
        found = verify(ledger)
        assert found.ok, found.faults
        assert "break" in said(found)


def test_a_key_with_a_passphrase(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keys = Keys(tmp_path / "keys")
    public = keys.make().public
    monkeypatch.setenv(PASSPHRASE, "")
    keys.set_passphrase("correct horse")
    assert b"ENCRYPTED" in keys.path.read_bytes()
    assert Keys(keys.folder).signing().public == public
    monkeypatch.setenv(PASSPHRASE, "wrong")
    with pytest.raises(LedgerError, match="passphrase is wrong"):
        Keys(keys.folder).signing()
    monkeypatch.delenv(PASSPHRASE)
    monkeypatch.setattr("sys.stdin", None)
    with pytest.raises(LedgerError, match=PASSPHRASE):
        Keys(keys.folder).signing()
    keys.path.write_text("nonsense")
    with pytest.raises(LedgerError, match="not a private key"):
        Keys(keys.folder).signing()
    keys.path.write_bytes(b"-----BEGIN PRIVATE KEY-----\n")
    with pytest.raises(FileError, match="give nobody this file"):
        read_public(keys.path)


def test_a_ledger_without_a_key_is_used_as_before(place: Callable[[], str], keys: Keys, tmp_path: Path) -> None:
    """Its verification says so in one sentence; later it can be signed, what it holds included."""
    where = place()
    with create(where, keys=keys, sign=False) as ledger:
        ledger.append("tool", {"serial": "A"}, TOOL, author="anna")
        found = verify(ledger)
        assert found.ok
        assert [note for note in found.notes if note.startswith("not signed")] == list(found.notes)
        with pytest.raises(LedgerError, match="is not signed"):
            ledger.accept("why not", author="anna")
    assert not keys.there
    with create(where, keys=keys) as ledger:  # the bench opens it so: as it was
        assert ledger.signed_head() is None
    with create(where, keys=keys, sign=True) as ledger:
        assert verify(ledger).signed is not None
        ledger.append("tool", {"serial": "B"}, TOOL, author="anna")
        assert verify(ledger).ok
        export(ledger, tmp_path / "all.zip")
    with create(place(), keys=keys) as copy:
        restore(copy, tmp_path / "all.zip")
        copy.append("tool", {"serial": "C"}, TOOL, author="anna")
        assert verify(copy).ok
        assert copy.signed_head() is not None


def test_many_records_and_a_program_that_starts_anew(opened: Opened) -> None:
    """The tree is taken up from the peaks that are kept now and then."""
    for turn in range(3):
        with opened() as ledger:
            ledger.append_all([Draft("tool", {"serial": f"{turn}-{n}"}, TOOL) for n in range(300)], author="anna")
            ledger.append("tool", {"serial": "one more"}, TOOL, author="anna")
    with opened() as ledger:
        ledger.append("tool", {"serial": "last"}, TOOL, author="anna")
        assert verify(ledger).ok


def test_heads_on_paper_prove_that_a_ledger_only_grew(opened: Opened, keys: Keys, tmp_path: Path) -> None:
    """Checked without the ledger; another ledger, a cut one, a head by another key are refused."""
    with opened() as ledger:
        old = ledger.signed_head()
        assert old is not None
        for number in range(5):
            ledger.append("tool", {"serial": f"N{number}"}, TOOL, author="anna")
        new = ledger.signed_head()
        assert new is not None
        proof = {"consistency": {"from": 8, "proof": proof_since(ledger.where, 8, 13)}}
        public = str(keys.public())
        assert grown(old, new, proof, public) == ""
        assert "no proof" in grown(old, new, {}, public)
        assert "did not sign" in grown(old, new, proof, "ab" * 32)
        other = SignedHead(**{**vars(old), "root": "0" * 64})
        assert "does not begin with" in grown(other, new, proof, public)
        assert "two ledgers" in grown(SignedHead(**{**vars(old), "ledger": "0" * 32}), new, proof, public)
        parse_signed(json.loads(json.dumps(new.statement())), "head.json")
        with pytest.raises(FileError, match="not the signed head"):
            parse_signed({**new.statement(), "size": "13"}, "head.json")


@pytest.fixture
def http(tmp_path: Path) -> Iterator[tuple[str, Path, list[str]]]:
    """A witness over HTTP: its address, its folder, what it refused."""
    refused: list[str] = []
    running = server(tmp_path / "far", "127.0.0.1", 0, None, refused.append)
    thread = threading.Thread(target=running.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{running.server_address[1]}", tmp_path / "far", refused
    running.shutdown()
    running.server_close()
    thread.join()


def test_witnesses_in_other_places(
    opened: Opened, keys: Keys, tmp_path: Path, http: tuple[str, Path, list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    """A folder, a ledger, HTTP, a printed line: told by themselves, asked by `verify` when the one here is gone."""
    address, _, refused = http
    other = tmp_path / "other.sqlite"
    create(other, keys=Keys(tmp_path / "others keys")).close()
    (tmp_path / "share").mkdir()
    name_others(keys.folder, [str(tmp_path / "share"), str(other), address, "print"])
    # the other ledger is of somebody else, whose key is not here: it is not told, and nothing is held up
    with opened() as ledger:
        ledger.append("tool", {"serial": "W"}, TOOL, author="anna")
    with opened() as ledger:
        ledger.append("tool", {"serial": "W2"}, TOOL, author="anna")
    out = capsys.readouterr()
    assert out.out.count('"schema":"inclinometry/ledger-head"') == 2
    assert "other.sqlite was not told of head" in out.err
    with opened() as ledger:
        newest = ledger.signed_head()
        assert newest is not None
        places = {one.witness for one in witnessed(keys.folder, newest.ledger, ledger.where).kept}
        assert places == {str(keys.folder / "heads"), str(tmp_path / "share"), address}
        assert f"witness {address}: agrees up to record 10" in said(verify(ledger))
        shutil.rmtree(keys.folder / "heads")
        cut(ledger, 9)
        found = verify(ledger)
        assert f"kept by {address}" in said(found)
        assert f"kept by {tmp_path / 'share'}" in said(found)
        # nothing is recorded while another place remembers more; the one over HTTP refuses the heads of a cut ledger
        with pytest.raises(LedgerError, match="signed record 10 of this ledger"):
            ledger.append("tool", {"serial": "X"}, TOOL, author="anna")
        ledger.accept("the disk failed", author="anna")
    assert refused
    with opened() as ledger:
        ledger.append("tool", {"serial": "X"}, TOOL, author="anna")
    assert "does not begin with" in refused[-1] or "was cut" in refused[-1]
    name_others(keys.folder, ["http://127.0.0.1:9"])
    with opened() as ledger:
        found = verify(ledger)
        assert found.ok
        assert not found.proven
        assert "the witness http://127.0.0.1:9 cannot be asked" in found.silent[0]


def test_a_witness_that_is_gone_is_a_fault(opened: Opened, keys: Keys, tmp_path: Path) -> None:
    """The file of this computer, a folder: named with the remedy; who has no key here is expected to have none."""
    (tmp_path / "share").mkdir()
    with opened() as ledger:
        name_others(keys.folder, [str(tmp_path / "share")])
        (file,) = (keys.folder / "heads").iterdir()
        found = [str(fault) for fault in verify(ledger).faults]
        assert len(found) == 1
        assert f"{tmp_path / 'share' / file.name} is missing; restore it, give it the head of now with" in found[0]
        name_others(keys.folder, [])
        file.unlink()
        found = [str(fault) for fault in verify(ledger).faults]
        assert len(found) == 1
        assert f"{file} is missing; restore it from a copy, or state why it is gone" in found[0]
        reader = Keys(tmp_path / "reader")
        reader.folder.mkdir()
        shutil.copy(keys.folder / "public.pem", reader.folder)
        with Ledger(ledger.where, keys=reader, read_only=True) as read:
            assert verify(read).ok
        ledger.accept("the folder of the keys was put back without it", author="anna")
        assert verify(ledger).ok
        # the one head that it has now is remembered as any other
        assert len(file.read_text().splitlines()) == 1
        cut(ledger, 8)
    with opened() as ledger, pytest.raises(LedgerError, match="signed record 9 of this ledger"):
        ledger.append("tool", {"serial": "NEXT"}, TOOL, author="anna")


def test_a_copy_that_was_recorded_in_stops_the_original(tmp_path: Path, keys: Keys) -> None:
    """In one sentence: which record, when, where, and both ways on."""
    path, trial = tmp_path / "lab.sqlite", tmp_path / "trial.sqlite"
    with create(path, keys=keys) as ledger:
        ledger.append("tool", {"serial": "A"}, TOOL, author="anna")
        backup(ledger, trial)
    with Ledger(trial, keys=keys) as copy:
        copy.append("tool", {"serial": "B"}, TOOL, author="anna")
    with Ledger(path, keys=keys) as ledger:
        ways = (
            rf"signed record 2 of this ledger on .* UTC in {trial}: one is a copy of the other.*Record in {trial}; or.*"
        )
        with pytest.raises(LedgerError, match=rf"{ways}`inclinometry ledger init {path} --accept REASON`"):
            ledger.append("tool", {"serial": "C"}, TOOL, author="anna")
        ledger.accept("records were tried out in a copy", author="anna")
        ledger.append("tool", {"serial": "C"}, TOOL, author="anna")
        assert verify(ledger).ok


@pytest.mark.parametrize("kept", ["folder", "http"])
def test_recording_asks_the_other_witnesses(
    tmp_path: Path, keys: Keys, http: tuple[str, Path, list[str]], kept: str
) -> None:
    """Whoever cuts the ledger and the witness of this computer to the same record is stopped by another place."""
    (tmp_path / "share").mkdir()
    path, other = tmp_path / "lab.sqlite", str(tmp_path / "share") if kept == "folder" else http[0]
    name_others(keys.folder, [other, "http://127.0.0.1:9", "print"])
    with create(path, keys=keys) as ledger:
        for serial in "ABC":
            ledger.append("tool", {"serial": serial}, TOOL, author="anna")
    with Ledger(path, keys=keys) as ledger:
        cut(ledger, 2)
        (file,) = (keys.folder / "heads").iterdir()
        file.write_bytes(b"".join(file.read_bytes().splitlines(keepends=True)[:-1]))
    with Ledger(path, keys=keys) as ledger:
        with pytest.raises(LedgerError, match="ends with record 2, but the laboratory's key signed record 3"):
            ledger.append("tool", {"serial": "D"}, TOOL, author="anna")
        assert ledger.head().seq == 2


def test_a_ledger_moves_to_another_computer(tmp_path: Path, keys: Keys) -> None:
    """A backup, or an export that is imported, and the folder of the keys: recording goes on, all is sound."""
    path = tmp_path / "lab.sqlite"
    with create(path, keys=keys) as ledger:
        for serial in "ABC":
            ledger.append("tool", {"serial": serial}, TOOL, author="anna")
        backup(ledger, tmp_path / "lab-copy.sqlite")
    (tmp_path / "new").mkdir()
    shutil.copytree(keys.folder, tmp_path / "new" / "keys")
    shutil.copy(tmp_path / "lab-copy.sqlite", tmp_path / "new" / "lab.sqlite")
    with Ledger(tmp_path / "new" / "lab.sqlite", keys=Keys(tmp_path / "new" / "keys")) as moved:
        assert verify(moved).ok
        moved.append("tool", {"serial": "D"}, TOOL, author="anna")
        assert verify(moved).ok


def test_another_ledger_as_a_witness(tmp_path: Path, keys: Keys) -> None:
    """Its events keep the heads; it signs them in its turn."""
    paths = [tmp_path / "a.sqlite", tmp_path / "b.sqlite"]
    for path in paths:
        create(path, keys=keys).close()
    name_others(keys.folder, [str(paths[1])])
    with Ledger(paths[0], keys=keys) as ledger:
        ledger.append("tool", {"serial": "A"}, TOOL, author="anna")
    with Ledger(paths[1], keys=keys) as other:
        assert other.count("event", action="head") == 1
        assert verify(other).ok
    with Ledger(paths[0], keys=keys) as ledger:
        assert f"witness {paths[1]}: agrees up to record 1" in said(verify(ledger))


def test_a_ledger_that_is_used_again_tells_its_witnesses(opened: Opened, keys: Keys, tmp_path: Path) -> None:
    """Closing sends what is on its way; it does not end the witnesses for ever."""
    share = tmp_path / "share"
    share.mkdir()
    name_others(keys.folder, [str(share)])
    ledger = opened()
    for turn in range(3):
        for number in range(2):
            ledger.append("tool", {"serial": f"{turn}-{number}"}, TOOL, author="anna")
        ledger.close()
        (file,) = share.iterdir()
        assert json.loads(file.read_text().splitlines()[-1])["size"] == 8 + 2 * (turn + 1)


def test_a_witness_refuses_what_is_not_signed(http: tuple[str, Path, list[str]], keys: Keys) -> None:
    """Rubbish, a wrong signature, another path: refused, and nothing is kept."""
    import urllib.error
    import urllib.request

    address, far, _ = http
    head = signed_by(keys.make(), "a" * 32, chain.Head(1, "b" * 64), b"\1" * 32, "2026-05-01T00:00:00+00:00")
    wrong = {**head.statement(), "size": 2}
    for path, body in (("/heads", b"rubbish"), ("/heads", json.dumps({"head": wrong}).encode()), ("/x", b"{}")):
        with pytest.raises(urllib.error.HTTPError):
            urllib.request.urlopen(urllib.request.Request(address + path, body), timeout=10)
    for path in ("/heads/" + "a" * 32, "/heads/../x", "/"):
        with pytest.raises(urllib.error.HTTPError):
            urllib.request.urlopen(address + path, timeout=10)
    assert list(far.iterdir()) == []


def test_a_line_of_a_witness_that_was_changed(tmp_path: Path, keys: Keys) -> None:
    """It is named, not believed."""
    with create(tmp_path / "a.sqlite", keys=keys) as ledger:
        ledger.append("tool", {"serial": "A"}, TOOL, author="anna")
        (path,) = (keys.folder / "heads").glob("*.jsonl")
        lines = path.read_text().splitlines()
        content = json.loads(lines[-1])
        path.write_text("\n".join([*lines, json.dumps({**content, "size": 7}), "rubbish"]) + "\n")
        found = verify(ledger)
        assert "is forged" in said(found)
        assert "not readable" in said(found)


def test_the_first_and_second_tables_stay_readable(tmp_path: Path, keys: Keys) -> None:
    """A ledger of before there were signed heads is read and written as it was, until it is brought up to date."""
    from inclinometry.laboratory.ledger.admin import _migrate

    path = tmp_path / "old.sqlite"
    made = engine(path, create=True)
    _migrate(made, "0002")
    made.dispose()
    with Ledger(path, keys=keys) as ledger:
        ledger.append("tool", {"serial": "A"}, TOOL, author="anna")
        found = verify(ledger)
        assert found.ok
        assert found.notes[0].startswith("not signed")
    with sqlite3.connect(path) as raw:
        assert not raw.execute("SELECT 1 FROM sqlite_master WHERE name = 'head'").fetchall()
    raw.close()
    with create(path, keys=keys, sign=True) as ledger:
        ledger.append("tool", {"serial": "B"}, TOOL, author="anna")
        assert verify(ledger).ok
