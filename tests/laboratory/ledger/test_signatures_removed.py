"""A ledger that was rewritten whole, in every digest and link, and all signed heads with it removed from the file."""

from __future__ import annotations

import shutil
import sqlite3
from pathlib import Path

import pytest

from inclinometry.laboratory.ledger import chain
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.engine import KINDS
from inclinometry.laboratory.ledger.keys import Keys
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError
from inclinometry.laboratory.ledger.verify import Verdict, verify
from inclinometry.laboratory.ledger.witness import name_others

TOOL = {"name": "steering tool", "triads": {}}


@pytest.fixture
def keys(tmp_path: Path) -> Keys:
    """A folder of keys of this test's own."""
    return Keys(tmp_path / "keys")


@pytest.fixture
def path(tmp_path: Path, keys: Keys) -> Path:
    """A signed ledger of four tools."""
    with create(tmp_path / "lab.sqlite", keys=keys) as ledger:
        for number in range(4):
            ledger.append("tool", {"serial": f"T{number}"}, TOOL, author="anna")
    return tmp_path / "lab.sqlite"


def forge(path: Path, *, changed: int = 2) -> None:
    """Another author of one record, and no trace of it in the file."""
    with sqlite3.connect(path) as raw:
        raw.row_factory = sqlite3.Row
        triggers = raw.execute("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'").fetchall()
        for name, _ in triggers:
            raw.execute(f'DROP TRIGGER "{name}"')
        raw.execute("UPDATE tool SET author = 'boris' WHERE seq = ?", (changed,))
        link = chain.GENESIS
        for row in raw.execute("SELECT * FROM chain ORDER BY seq").fetchall():
            found = raw.execute(f"SELECT * FROM {row['kind']} WHERE seq = ?", (row["seq"],)).fetchone()
            keys = {name: found[name] for name in KINDS[row["kind"]].keys}
            stated = found["id"], found["created"], found["author"], found["version"]
            digest = chain.record_digest(row["kind"], *stated, keys, found["body"])
            link = chain.next_link(link, row["seq"], row["kind"], row["record"], row["created"], digest)
            raw.execute("UPDATE chain SET digest = ?, link = ? WHERE seq = ?", (digest, link, row["seq"]))
        raw.execute("DELETE FROM head")
        for _, text in triggers:
            raw.execute(text)
    raw.close()


def seen(path: Path, keys: Keys, **how: object) -> Verdict:
    """What a verification finds."""
    with Ledger(path, keys=keys, read_only=True) as ledger:
        return verify(ledger, **how)  # type: ignore[arg-type]


@pytest.mark.parametrize("changed", [1, 4])
def test_it_is_known_at_any_path_by_what_is_kept_beside_the_key(path: Path, keys: Keys, changed: int) -> None:
    """By the links before what was changed, and where there are none, by the times of the records."""
    other = path.with_name("other.sqlite")
    shutil.copy(path, other)
    forge(other, changed=changed)
    for copy in (False, True):
        found = seen(other, keys, copy=copy)
        assert "not those that were signed by the head that" in "".join(map(str, found.faults))
        assert not found.proven
    assert "holds no signed head: its signatures were removed" in "".join(map(str, seen(other, keys).faults))
    assert not any("ledger init" in note for note in seen(other, keys).notes)
    forge(path, changed=changed)
    assert "is signed, and this one is not" in "".join(map(str, seen(path, keys).faults))


def test_a_folder_that_is_a_witness_knows_it(path: Path, keys: Keys, tmp_path: Path) -> None:
    """On a computer that has neither the key nor the file beside it."""
    shutil.copytree(keys.folder / "heads", tmp_path / "share")
    auditor = Keys(tmp_path / "auditor")
    name_others(auditor.folder, [str(tmp_path / "share")])
    assert seen(path, auditor).ok
    forge(path)
    assert f"head that {tmp_path / 'share'} keeps, and it holds no signed" in "".join(
        map(str, seen(path, auditor).faults)
    )


def test_with_the_public_key_it_is_a_fault_and_without_it_is_not_proven(path: Path, keys: Keys, tmp_path: Path) -> None:
    """Where nothing is known of it: whoever gives the key expects it to be signed."""
    public, nothing = str(keys.public()), Keys(tmp_path / "none")
    forge(path)
    found = seen(path, nothing, public=[public])
    assert [fault.table for fault in found.faults] == ["head"]
    assert "not signed by the key" in found.faults[0].problem
    found = seen(path, nothing)
    assert (found.ok, found.proven) == (True, False)


def test_nobody_answers_for_it_by_a_record_in_it(path: Path, keys: Keys) -> None:
    """An event of acceptance is signed, or it is nothing."""
    with Ledger(path, keys=keys) as ledger:
        ledger.accept("as it should be", author="anna")
    other = path.with_name("other.sqlite")
    shutil.copy(path, other)
    forge(other)
    assert "rewritten" in "".join(map(str, seen(other, keys).faults))


def test_a_ledger_of_before_the_key_is_read_with_a_note(path: Path, keys: Keys, tmp_path: Path) -> None:
    """It was never signed, and nothing here says that it was; it is sound, and not proven."""
    old = tmp_path / "old.sqlite"
    with create(old, keys=keys, sign=False) as ledger:
        ledger.append("tool", {"serial": "A"}, TOOL, author="anna")
    found = seen(old, keys)
    assert (found.ok, found.proven, len(found.notes)) == (True, False, 1)
    shutil.copy(old, tmp_path / "kept.sqlite")
    with create(old, keys=keys, sign=True) as ledger:
        ledger.append("tool", {"serial": "B"}, TOOL, author="anna")
    # a copy from before it was signed: what the witness has agrees with it
    found = seen(tmp_path / "kept.sqlite", keys, copy=True)
    assert (found.ok, found.proven) == (True, False)
    assert not any("ledger init" in note for note in found.notes)


def events(path: Path, keys: Keys) -> list[str]:
    """Reasons for which somebody accepted the ledger."""
    with Ledger(path, keys=keys, read_only=True) as ledger:
        return [str(one.body["reason"]) for one in ledger.find("event", action="accepted")]


@pytest.mark.parametrize("where", ["in its place", "at another path"])
def test_nothing_is_recorded_upon_it_and_it_is_not_signed(path: Path, keys: Keys, where: str) -> None:
    """Before somebody answers for it; then it goes on under its name, and verification says so ever after."""
    if where == "at another path":
        path = shutil.copy(path, path.with_name("other.sqlite"))
    forge(path)
    with Ledger(path, keys=keys) as ledger:
        with pytest.raises(LedgerError, match=r"signatures were removed; nothing was recorded .* --accept REASON"):
            ledger.append("tool", {"serial": "NEXT"}, TOOL, author="anna")
        assert ledger.head().seq == 4
    with pytest.raises(LedgerError, match=r"signatures were removed; nothing was recorded .* --accept REASON"):
        create(path, keys=keys, sign=True)
    with Ledger(path, keys=keys) as ledger:
        assert ledger.signed_head() is None
    with create(path, keys=keys, sign=True, accepted=True) as ledger:
        assert not verify(ledger).ok  # not yet said by anybody
        ledger.accept("the disk was repaired", author="anna")
        ledger.append("tool", {"serial": "NEXT"}, TOOL, author="anna")
        found = verify(ledger)
    assert found.proven, found.faults
    assert any(note.endswith("by anna: the disk was repaired") for note in found.notes)
    assert "3 signed heads from before that contradict the records" in found.notes
    assert events(path, keys) == ["the disk was repaired"]


def test_a_ledger_that_is_unsigned_on_purpose_is_recorded_in(keys: Keys, tmp_path: Path) -> None:
    """And signed later, from when on verification says."""
    where = tmp_path / "plain.sqlite"
    keys.make()
    with create(where, keys=keys, sign=False) as ledger:
        for serial in "ABC":
            ledger.append("tool", {"serial": serial}, TOOL, author="anna")
    with create(where, keys=keys, sign=True) as ledger:
        ledger.append("tool", {"serial": "D"}, TOOL, author="anna")
        found = verify(ledger)
    assert found.proven
    said = "its first 3 records were there before it was signed: what they said until then is not proven"
    assert said in found.notes
    with create(tmp_path / "new.sqlite", keys=keys) as ledger:
        ledger.append("tool", {"serial": "D"}, TOOL, author="anna")
        assert not any("its first" in note for note in verify(ledger).notes)
