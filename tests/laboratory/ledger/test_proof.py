"""Who can write to the database and has not the laboratory's key: whatever they do is found, and by `verify` alone."""

from __future__ import annotations

import json
import shutil
import sqlite3
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from tests.refusals import coded, fits, refused

from inclinometry.errors import FileError
from inclinometry.laboratory.certificate.status import make_status
from inclinometry.laboratory.ledger import chain
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.engine import Draft, engine
from inclinometry.laboratory.ledger.exchange import backup, export, restore
from inclinometry.laboratory.ledger.heads import KEY_EVENT, SignedHead, signed_by
from inclinometry.laboratory.ledger.keys import CHANGE, Keys, descends, fingerprint, genuine
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError
from inclinometry.laboratory.ledger.verify import verify
from inclinometry.laboratory.ledger.witness import name_others, others, witnessed

from .conftest import TOOL, add, append_by_sql, cut, edit, rewrite, said, seen

Opened = Callable[[], Ledger]


@pytest.fixture
def opened(place: Callable[[], str], keys: Keys) -> Opened:
    """Opens one ledger of eight tools, each recorded by itself, on each engine."""
    where = place()
    with create(where, keys=keys) as ledger:
        add(ledger, *(f"T{n}" for n in range(8)))
    return lambda: Ledger(where, keys=keys)


def head_row(head: SignedHead, place: int) -> str:
    return (
        "INSERT INTO head (place, seq, ledger, root, link, created, key, signature) VALUES "
        f"({place}, {head.size}, '{head.ledger}', '{head.root}', '{head.link}', '{head.time}', '{head.key}', "
        f"'{head.signature}')"
    )


def test_a_ledger_that_nobody_touched_is_sound_signed_and_witnessed(opened: Opened, keys: Keys) -> None:
    with opened() as ledger:
        found = verify(ledger)
        assert found.ok
        assert found.signed.size == 8
        signed, agrees = found.findings
        assert fits(signed, ["key-signed"], {"record": 8, "whose": "the laboratory's"})
        assert fits(agrees, ["key-witness-agrees"], {"place": str(keys.folder / "heads"), "record": 8})
    assert keys.path.stat().st_mode & 0o077 == 0


def test_a_cut_tail_is_found(opened: Opened, keys: Keys) -> None:
    """Nothing is recorded upon it while the witness here remembers; when it is away, it is found by it later."""
    with opened() as ledger:
        cut(ledger.where, 5)
        found = verify(ledger)
        assert [one.values["record"] for one in found.faults if one.code == "ledger-removed"] == ["6 .. 8"]
        with refused("ledger-behind", error=LedgerError, signed_record=8, record=5, place=ledger.shown):
            add(ledger, "NEW")
        assert ledger.head().seq == 5
        (keys.folder / "heads").rename(keys.folder / "away")
        add(ledger, "NEW")
        ledger.append_all([Draft("tool", {"serial": "NEWER"}, TOOL)] * 5, author="anna")
        shutil.rmtree(keys.folder / "heads")
        (keys.folder / "away").rename(keys.folder / "heads")
        assert "ledger-rewritten" in said(verify(ledger))


def test_another_ledger_in_the_place_is_found(tmp_path: Path, keys: Keys) -> None:
    path, other = tmp_path / "lab.sqlite", tmp_path / "other.sqlite"
    strange = Keys(tmp_path / "strange")
    for where, by in ((path, keys), (other, strange)):
        with create(where, keys=by) as ledger:
            add(ledger, "A")
    shutil.copy(other, path)
    with Ledger(path, keys=keys) as ledger:
        found = verify(ledger)
    assert {"ledger-another", "key-not-laboratory"} <= {*said(found)}
    # an auditor who has a key of an own looks at it in another place: no fault, and no proof before --key is given
    with Ledger(other, keys=keys) as ledger:
        found = verify(ledger)
        assert found.ok
        assert not found.proven
        by, here = fingerprint(str(strange.public())), fingerprint(str(keys.public()))
        assert fits(found.findings[0], ["key-not-here"], {"key": by, "own": here})
        assert not verify(ledger, public=[str(keys.public())]).ok
        assert verify(ledger, public=[str(strange.public())]).proven
    # who has no key at all compares it
    with Ledger(other, keys=Keys(tmp_path / "none")) as ledger:
        found = verify(ledger)
        assert found.proven
        assert found.findings[0].values["whose"] == "compare it with the laboratory's"


def test_an_older_copy_put_back_is_found(tmp_path: Path, keys: Keys) -> None:
    """And a backup that was put back by who may do so goes on, with the reason, when it is stated."""
    path = tmp_path / "lab.sqlite"
    with create(path, keys=keys) as ledger:
        add(ledger, "A")
        backup(ledger, tmp_path / "old.sqlite")
        add(ledger, "B")
    for file in tmp_path.glob("lab.sqlite*"):
        file.unlink()
    shutil.copy(tmp_path / "old.sqlite", path)
    with Ledger(path, keys=keys) as ledger:
        assert "ledger-removed" in said(verify(ledger))
        with refused("ledger-reason"):
            ledger.accept("n/a", author="anna")
        ledger.accept("the disk failed, the backup of Monday was put back", author="anna")
        found = verify(ledger)
        assert found.ok, found.faults
        (told,) = (one for one in found.findings if one.code == "ledger-accepted")
        assert fits(told, ["ledger-accepted"], {"author": "anna", "reason": "the disk failed"})
        add(ledger, "C")
        assert verify(ledger).ok
    # what was accepted is no leave for what comes later
    with Ledger(path, keys=keys) as ledger:
        cut(ledger.where, 2)
        assert not verify(ledger).ok
    # the backup itself is sound when it is said to be one, and says what it is
    with Ledger(tmp_path / "old.sqlite", keys=keys) as copy:
        assert "ledger-removed" in said(verify(copy))
        found = verify(copy, copy=True)
        assert found.ok
        assert "ledger-copy" in said(found)


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
        add(ledger, "A")
        backup(ledger, old)
        add(ledger, "B")
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
        assert "ledger-removed" in said(verify(ledger))
        for sign in (lambda: add(ledger, "C"), lambda: make_status(ledger)):
            with refused("ledger-behind", error=LedgerError):
                sign()
        assert ledger.head().seq == 1


def test_another_ledger_behind_a_link_is_found(tmp_path: Path, keys: Keys) -> None:
    """One of the same key, sound in its own place; or one that is not signed."""
    path = tmp_path / "lab.sqlite"
    create(path, keys=keys).close()
    for name, sign in (("b.sqlite", True), ("c.sqlite", False)):
        with create(tmp_path / name, keys=keys, sign=sign) as other:
            add(other, "A")
            assert verify(other).ok
        path.unlink()
        path.symlink_to(tmp_path / name)
        with Ledger(path, keys=keys) as ledger:
            assert "ledger-another" in said(verify(ledger))


def test_a_record_appended_by_sql_is_found_and_never_signed(opened: Opened) -> None:
    """The next record of the program would sign for it: it is refused until somebody answers for it."""
    with opened() as ledger:
        append_by_sql(ledger)
        found = verify(ledger)
        assert any(fits(one, ["ledger-inserted"], {"kind": "chain", "record": "9"}) for one in found.faults)
        with refused("ledger-modified", error=LedgerError):
            add(ledger, "NEXT")
    with opened() as ledger:
        ledger.accept("a colleague's script; the record is right", author="anna")
        add(ledger, "NEXT")
        assert verify(ledger).ok


@pytest.mark.parametrize("by", ["another key", "no key", "an old signature"])
def test_a_forged_head_is_found(opened: Opened, tmp_path: Path, by: str) -> None:
    """Signed by another key, by none, or an old signature under new content."""
    with opened() as ledger:
        newest = ledger.signed_head()
        append_by_sql(ledger)
        head = ledger.head()
        fake = signed_by(Keys(tmp_path / "forger").make(), newest.ledger, head, b"\0" * 32, newest.time)
        if by == "no key":
            fake = SignedHead(**{**vars(fake), "key": newest.key})
        elif by == "an old signature":
            fake = SignedHead(**{**vars(fake), "key": newest.key, "signature": newest.signature})
        edit(ledger.where, head_row(fake, 100))
        found = verify(ledger)
        assert not found.ok
        assert ("key-not-laboratory" if by == "another key" else "key-forged") in said(found)
    with opened() as ledger, refused("ledger-modified", "key-other", error=LedgerError):
        add(ledger, "NEXT")


@pytest.mark.parametrize("seq", [5, 8])
def test_a_head_that_is_none_is_named(path: Path, keys: Keys, seq: int) -> None:
    """Text in the place of a number (SQLite keeps it): a fault, and nothing is recorded upon the newest."""
    edit(path, f"UPDATE head SET seq = 'abc', signature = 'x' WHERE seq = {seq}")
    assert "ledger-changed" in said(seen(path, keys))
    with Ledger(path, keys=keys) as ledger:
        if seq == 8:
            with refused("ledger-changed", error=LedgerError, kind="signed head"):
                add(ledger, "NEXT")
        edit(ledger.where, "UPDATE head SET seq = 'abc'")
        assert "ledger-changed" in said(verify(ledger))


@pytest.mark.parametrize(
    ("statements", "named"),
    [
        (["UPDATE head SET key = 'no key' WHERE seq = 5"], "ledger-changed"),
        (["UPDATE head SET frontier = 'ab' WHERE seq = 5"], "ledger-changed"),
        ([f"DELETE FROM {one}" for one in ("tool", "event", "head", "chain")], "ledger-another"),
    ],
)
def test_what_was_changed_or_cut_is_named(opened: Opened, statements: list[str], named: str) -> None:
    """A key that is none any more; peaks that are not those of their tree; everything cut, even the heads."""
    with opened() as ledger:
        edit(ledger.where, *statements)
        assert named in said(verify(ledger))


def test_a_rewritten_record_is_found(opened: Opened) -> None:
    """Its author, and every digest and link after it, worked out anew: sound, but not what was signed or noted."""
    with opened() as ledger:
        head = ledger.head()
        rewrite(ledger.where, 4)
        found = verify(ledger)
        assert {fault.code for fault in found.faults} == {"ledger-rewritten"}
        assert found.faults[0].values["record"] == 4
        assert "--head" in [one.values["place"] for one in verify(ledger, head=head).faults]
    with opened() as ledger, refused("ledger-modified", error=LedgerError):
        add(ledger, "NEXT")


def test_a_rotated_key_is_followed(opened: Opened, keys: Keys, tmp_path: Path) -> None:
    """The old key signs for the new one, in the ledger; who knows the old one trusts the new one."""
    old = str(keys.public())
    keys.rotate("every year")
    new = str(keys.public())
    assert new != old
    with opened() as ledger:
        assert verify(ledger).ok  # not written to since
        add(ledger, "NEXT")
        keys.rotate("and again")
        add(ledger, "NEXT")
        found = verify(ledger)
        assert found.ok, found.faults
        rotations = [(one.values["key"], one.values["before"]) for one in found.findings if one.code == "key-rotated"]
        assert rotations[0] == (fingerprint(new), fingerprint(old))
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
        with refused("key-other", error=LedgerError):
            add(ledger, "NEXT")
        assert ledger.head().seq == 8
    keys.begin_anew("the laptop was stolen")
    with opened() as ledger:
        add(ledger, "NEXT")
        found = verify(ledger)
        assert found.ok, found.faults
        (told,) = (one for one in found.findings if one.code == "key-break")
        assert told.values["reason"] == "the laptop was stolen"
        assert not verify(ledger, public=[old]).ok
    with refused("ledger-reason"):
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
        (told,) = [one for one in found.findings if one.code == "key-break"]
        assert told.values == {"record": 9, "key": new, "reason": "the laptop was stolen"}
        (signed,) = [one for one in found.findings if one.code == "key-signed"]
        assert signed.values["whose"] == "the laboratory's until it was lost"
        assert not verify(ledger, public=[str(keys.public())]).ok
        # the witness here is missed as before
        (file,) = (keys.folder / "heads").iterdir()
        file.rename(tmp_path / "away")
        assert "key-witness-lost" in said(verify(ledger))
        (tmp_path / "away").rename(file)
        edit(ledger.where, "UPDATE tool SET author = 'boris' WHERE seq = 4")
        assert [str(one.values["record"]).partition(" ")[0] for one in verify(ledger).faults] == ["4"]
        edit(ledger.where, "UPDATE tool SET author = 'anna' WHERE seq = 4")
    # whoever has the stolen key goes on with it: that is no head from before the loss
    late = datetime.now(UTC) + timedelta(minutes=1)
    with Ledger(ledger.where, keys=old, clock=lambda: late) as stolen:
        add(stolen, "S")
    with opened() as ledger:
        assert "key-not-laboratory" in said(verify(ledger))


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
        assert "key-break" not in said(found)
        with refused("key-other", error=LedgerError):
            add(looked, "S")


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
        append_by_sql(ledger)
        edit(ledger.where, head_row(signed_by(forger, newest.ledger, ledger.head(), b"\0" * 32, newest.time), 100))
        assert "key-not-laboratory" in said(verify(ledger))


@pytest.mark.parametrize(
    "junk", [b"", b"junk", b"\xff\0" * 99, b"-----BEGIN PUBLIC KEY-----\nAAAA\n-----END PUBLIC KEY-----"]
)
def test_junk_in_the_place_of_the_public_key_is_named(opened: Opened, keys: Keys, junk: bytes) -> None:
    """Nothing is called sound by what it holds; recording goes on, and writes it anew from the private key."""
    public, file = keys.public(), keys.folder / "public.pem"
    file.write_bytes(junk)
    with opened() as ledger:
        with refused("key-damaged", error=FileError):
            verify(ledger)
        add(ledger, "NEXT")
        assert keys.public() == public
        assert verify(ledger).proven
    # and where the private key is lost, too, a new one is begun
    file.write_bytes(junk)
    keys.path.unlink()
    keys.begin_anew("the disk failed")
    with opened() as ledger:
        assert "key-break" in said(verify(ledger))
        add(ledger, "LAST")
        assert verify(ledger).proven


@pytest.mark.parametrize(
    ("junk", "line"),
    [
        (b"junk\n", 2),
        (b"{}\n", 2),
        (b"\xff\n", 2),
        (b"[" * 100_000 + b"\n", 2),
        (b"\n7", 3),
        (b'"a"', 2),
        (b"null\n", 2),
    ],
)
def test_junk_among_the_changes_of_keys_is_named(opened: Opened, keys: Keys, junk: bytes, line: int) -> None:
    """With its line, of what was signed and changed since, too; recording with the same key needs none of it."""
    keys.rotate("every year")
    with opened() as ledger:
        add(ledger, "NEXT")
    file = keys.folder / "changes.jsonl"
    right = file.read_bytes()
    for data, at in ((right + junk, line), (right.replace(b"every year", b"every hour"), 1)):
        file.write_bytes(data)
        with opened() as ledger:
            with refused("key-damaged", error=FileError):
                verify(ledger)
            add(ledger, f"NEXT {at}")
    file.write_bytes(right)
    with opened() as ledger:
        assert verify(ledger).proven
    file.unlink()  # the ledger has recorded it
    with opened() as ledger:
        assert verify(ledger).proven


def endless(file: Path) -> Iterator[str]:
    """A device, then a file of more bytes than such a one can have, in the place of a file; what is said of it."""
    file.unlink(missing_ok=True)
    file.symlink_to("/dev/zero")
    yield "file-not-file"
    file.unlink()
    with file.open("wb") as stream:
        stream.truncate(3_000_000_000)
    yield "file-large"


@pytest.mark.parametrize("name", ["key.pem", "public.pem", "changes.jsonl", "witnesses.txt"])
def test_what_has_no_end_is_not_read(keys: Keys, name: str) -> None:
    """In the place of one of the keys' files."""
    keys.make()
    asked = {"key.pem": keys.signing, "public.pem": keys.public, "changes.jsonl": keys.changes}
    for said_of_it in endless(keys.folder / name):
        with refused(said_of_it, error=FileError):
            asked.get(name, lambda: others(keys.folder))()


@pytest.mark.parametrize("whose", ["a folder", "this computer"])
def test_what_has_no_end_is_no_witness(tmp_path: Path, keys: Keys, whose: str) -> None:
    """Where a witness kept heads: it says nothing, and nothing is proven."""
    path, share = tmp_path / "lab.sqlite", tmp_path / "share"
    share.mkdir()
    name_others(keys.folder, [str(share)])
    with create(path, keys=keys) as ledger:
        add(ledger, "A")
    (file,) = (share if whose == "a folder" else keys.folder / "heads").iterdir()
    for _ in endless(file):
        found = seen(path, keys)
        assert (found.ok, found.proven) == (True, False)
        assert coded(found.silent) == ["key-witness-silent"]


def test_a_whole_folder_lost(opened: Opened, tmp_path: Path, keys: Keys) -> None:
    """Key, public key and witness are gone: a new key can be begun, which names none before it."""
    shutil.rmtree(keys.folder)
    keys.begin_anew("the disk failed")
    with opened() as ledger:
        add(ledger, "NEXT")
        found = verify(ledger)
        assert found.ok, found.faults
        assert "key-break" in said(found)


def test_a_ledger_without_a_key_is_used_as_before(place: Callable[[], str], keys: Keys, tmp_path: Path) -> None:
    """Its verification says so in one sentence; later it can be signed, what it holds included."""
    where = place()
    with create(where, keys=keys, sign=False) as ledger:
        add(ledger, "A")
        found = verify(ledger)
        assert found.ok
        assert coded(found.findings) == ["ledger-unsigned"]
        with refused("ledger-unsigned", error=LedgerError):
            ledger.accept("why not", author="anna")
    assert not keys.there
    with create(where, keys=keys) as ledger:  # the bench opens it so: as it was
        assert ledger.signed_head() is None
    with create(where, keys=keys, sign=True) as ledger:
        assert verify(ledger).signed is not None
        add(ledger, "B")
        assert verify(ledger).ok
        export(ledger, tmp_path / "all.zip")
    with create(place(), keys=keys) as copy:
        restore(copy, tmp_path / "all.zip")
        add(copy, "C")
        assert verify(copy).ok
        assert copy.signed_head() is not None


def test_many_records_and_a_program_that_starts_anew(opened: Opened) -> None:
    """The tree is taken up from the peaks that are kept now and then."""
    for turn in range(3):
        with opened() as ledger:
            ledger.append_all([Draft("tool", {"serial": f"{turn}-{n}"}, TOOL) for n in range(300)], author="anna")
            add(ledger, "one more")
    with opened() as ledger:
        add(ledger, "last")
        assert verify(ledger).ok


def test_witnesses_in_other_places(
    opened: Opened, keys: Keys, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A folder, a ledger, a printed line: told by themselves, asked by `verify` when the one here is gone."""
    other = tmp_path / "other.sqlite"
    create(other, keys=Keys(tmp_path / "others keys")).close()
    share = tmp_path / "share"
    share.mkdir()
    name_others(keys.folder, [str(share), str(other), "print"])
    # the other ledger is of somebody else, whose key is not here: it is not told, and nothing is held up
    for serial in ("W", "W2"):
        with opened() as ledger:
            add(ledger, serial)
    out = capsys.readouterr()
    assert out.out.count('"schema":"inclinometry/ledger-head"') == 2
    assert "[key-other]" in out.err
    with opened() as ledger:
        newest = ledger.signed_head()
        places = {one.witness for one in witnessed(keys.folder, newest.ledger, ledger.where)[0]}
        assert places == {str(keys.folder / "heads"), str(share)}
        agrees = [one.values for one in verify(ledger).findings if one.code == "key-witness-agrees"]
        assert {"place": str(share), "record": 10} in agrees
        shutil.rmtree(keys.folder / "heads")
        cut(ledger.where, 9)
        assert "ledger-removed" in said(verify(ledger))
        # nothing is recorded while another place remembers more
        with refused("ledger-behind", error=LedgerError, signed_record=10):
            add(ledger, "X")
        ledger.accept("the disk failed", author="anna")
    with opened() as ledger:
        add(ledger, "X")
    (file,) = share.iterdir()
    file.unlink()
    file.mkdir()
    name_others(keys.folder, [str(share)])
    with opened() as ledger:
        found = verify(ledger)
        assert found.ok
        assert not found.proven
        assert [(one.code, one.values["place"]) for one in found.silent] == [("key-witness-silent", str(share))]


def test_a_witness_that_is_gone_is_a_fault(opened: Opened, keys: Keys, tmp_path: Path) -> None:
    """The file of this computer, a folder: named with the remedy; who has no key here is expected to have none."""
    (tmp_path / "share").mkdir()
    with opened() as ledger:
        name_others(keys.folder, [str(tmp_path / "share")])
        (file,) = (keys.folder / "heads").iterdir()
        (lost,) = verify(ledger).faults
        assert fits(lost, ["key-witness-lost"], {"place": str(tmp_path / "share")})
        name_others(keys.folder, [])
        file.unlink()
        (lost,) = verify(ledger).faults
        assert fits(lost, ["key-witness-lost"], {"place": str(keys.folder / "heads")})
        reader = Keys(tmp_path / "reader")
        reader.folder.mkdir()
        shutil.copy(keys.folder / "public.pem", reader.folder)
        with Ledger(ledger.where, keys=reader, read_only=True) as read:
            assert verify(read).ok
        ledger.accept("the folder of the keys was put back without it", author="anna")
        assert verify(ledger).ok
        # the one head that it has now is remembered as any other
        assert len(file.read_text().splitlines()) == 1
        cut(ledger.where, 8)
    with opened() as ledger, refused("ledger-behind", error=LedgerError, signed_record=9):
        add(ledger, "NEXT")


def test_a_copy_that_was_recorded_in_stops_the_original(tmp_path: Path, keys: Keys) -> None:
    """In one sentence: which record, when, where, and both ways on."""
    path, trial = tmp_path / "lab.sqlite", tmp_path / "trial.sqlite"
    with create(path, keys=keys) as ledger:
        add(ledger, "A")
        backup(ledger, trial)
    with Ledger(trial, keys=keys) as copy:
        add(copy, "B")
    with Ledger(path, keys=keys) as ledger:
        with refused("ledger-behind", error=LedgerError, signed_record=2, place=str(trial)):
            add(ledger, "C")
        ledger.accept("records were tried out in a copy", author="anna")
        add(ledger, "C")
        assert verify(ledger).ok


def test_recording_asks_the_other_witnesses(tmp_path: Path, keys: Keys) -> None:
    """Whoever cuts the ledger and the witness of this computer to the same record is stopped by another place."""
    (tmp_path / "share").mkdir()
    path = tmp_path / "lab.sqlite"
    name_others(keys.folder, [str(tmp_path / "gone"), str(tmp_path / "share"), "print"])
    with create(path, keys=keys) as ledger:
        add(ledger, *"ABC")
    with Ledger(path, keys=keys) as ledger:
        cut(ledger.where, 2)
        (file,) = (keys.folder / "heads").iterdir()
        file.write_bytes(b"".join(file.read_bytes().splitlines(keepends=True)[:-1]))
    with Ledger(path, keys=keys) as ledger:
        with refused("ledger-behind", error=LedgerError):
            add(ledger, "D")
        assert ledger.head().seq == 2


def test_a_ledger_moves_to_another_computer(tmp_path: Path, keys: Keys) -> None:
    """A backup, or an export that is imported, and the folder of the keys: recording goes on, all is sound."""
    path = tmp_path / "lab.sqlite"
    with create(path, keys=keys) as ledger:
        add(ledger, *"ABC")
        backup(ledger, tmp_path / "lab-copy.sqlite")
    (tmp_path / "new").mkdir()
    shutil.copytree(keys.folder, tmp_path / "new" / "keys")
    shutil.copy(tmp_path / "lab-copy.sqlite", tmp_path / "new" / "lab.sqlite")
    with Ledger(tmp_path / "new" / "lab.sqlite", keys=Keys(tmp_path / "new" / "keys")) as moved:
        assert verify(moved).ok
        add(moved, "D")
        assert verify(moved).ok


def test_another_ledger_as_a_witness(tmp_path: Path, keys: Keys) -> None:
    """Its events keep the heads; it signs them in its turn."""
    paths = [tmp_path / "a.sqlite", tmp_path / "b.sqlite"]
    for path in paths:
        create(path, keys=keys).close()
    name_others(keys.folder, [str(paths[1])])
    with Ledger(paths[0], keys=keys) as ledger:
        add(ledger, "A")
    with Ledger(paths[1], keys=keys) as other:
        assert other.count("event", action="head") == 1
        assert verify(other).ok
    with Ledger(paths[0], keys=keys) as ledger:
        agrees = [one.values for one in verify(ledger).findings if one.code == "key-witness-agrees"]
        assert {"place": str(paths[1]), "record": 1} in agrees


def test_a_ledger_that_is_used_again_tells_its_witnesses(opened: Opened, keys: Keys, tmp_path: Path) -> None:
    """Closing sends what is on its way; it does not end the witnesses for ever."""
    share = tmp_path / "share"
    share.mkdir()
    name_others(keys.folder, [str(share)])
    ledger = opened()
    for turn in range(3):
        for number in range(2):
            add(ledger, f"{turn}-{number}")
        ledger.close()
        (file,) = share.iterdir()
        assert json.loads(file.read_text().splitlines()[-1])["size"] == 8 + 2 * (turn + 1)


def test_a_line_of_a_witness_that_was_changed(tmp_path: Path, keys: Keys) -> None:
    """It is named, not believed."""
    with create(tmp_path / "a.sqlite", keys=keys) as ledger:
        add(ledger, "A")
        (path,) = (keys.folder / "heads").glob("*.jsonl")
        lines = path.read_text().splitlines()
        content = json.loads(lines[-1])
        path.write_text("\n".join([*lines, json.dumps({**content, "size": 7}), "rubbish"]) + "\n")
        found = verify(ledger)
        assert {"key-forged", "ledger-changed"} <= {*said(found)}


def test_the_first_and_second_tables_stay_readable(tmp_path: Path, keys: Keys) -> None:
    """A ledger of before there were signed heads is read and written as it was, until it is brought up to date."""
    from inclinometry.laboratory.ledger.admin import _migrate

    path = tmp_path / "old.sqlite"
    made = engine(path, create=True)
    _migrate(made, "0002")
    made.dispose()
    with Ledger(path, keys=keys) as ledger:
        add(ledger, "A")
        found = verify(ledger)
        assert found.ok
        assert coded(found.findings) == ["ledger-unsigned"]
    with sqlite3.connect(path) as raw:
        assert not raw.execute("SELECT 1 FROM sqlite_master WHERE name = 'head'").fetchall()
    raw.close()
    with create(path, keys=keys, sign=True) as ledger:
        add(ledger, "B")
        assert verify(ledger).ok
