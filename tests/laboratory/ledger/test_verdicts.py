"""What a verification says, to the row and the number; and what is taken for a signed head, and for a key."""

from __future__ import annotations

import io
import json
import shutil
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from cryptography.hazmat.primitives.asymmetric import ec
from sqlalchemy import UniqueConstraint, inspect
from tests.refusals import coded, fits, refused

from inclinometry.errors import FileError
from inclinometry.laboratory.ledger import chain, heads
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.engine import METADATA, default_path, engine
from inclinometry.laboratory.ledger.exchange import backup
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

from .conftest import TOOL, add, append_by_sql, cut, edit, rewrite, said, seen


def rows(found: Verdict, code: str) -> list[tuple[str, str]]:
    """Kind and place of the faults of a code."""
    return [(str(one.values["kind"]), str(one.values["record"])) for one in found.faults if one.code == code]


def accepted_in(found: Verdict) -> dict[str, Any]:
    """Who accepted what was found, why, and how many heads it excuses."""
    codes = ("ledger-accepted", "ledger-excused")
    return {name: value for one in found.findings if one.code in codes for name, value in one.values.items()}


@pytest.mark.parametrize(
    ("gone", "forged", "code", "row"),
    [
        ((5,), 0, "ledger-removed", "5"), ((5, 6), 0, "ledger-removed", "5 .. 6"), ((1,), 0, "ledger-removed", "1"),
        ((1, 2, 3), 0, "ledger-removed", "1 .. 3"), ((), 1, "ledger-inserted", "9"),
        ((), 2, "ledger-inserted", "9 .. 10"),
    ],
)  # fmt: skip
def test_links_without_a_record_or_a_signature_are_counted(
    path: Path, keys: Keys, gone: tuple[int, ...], forged: int, code: str, row: str
) -> None:
    """Each record whose link is gone stands for itself; those appended by SQL are right in every link."""
    edit(path, *(f"DELETE FROM chain WHERE seq = {seq}" for seq in gone))
    with Ledger(path, keys=keys) as ledger:
        for _ in range(forged):
            append_by_sql(ledger)
    found = seen(path, keys)
    assert [one for one in rows(found, code) if one[0] == "chain"] == [("chain", row)]
    assert len([kind for kind, _ in rows(found, "ledger-inserted") if kind == "tool"]) == len(gone)
    assert found.records == 8 - len(gone) + forged
    assert not forged or len(found.faults) == 1


@pytest.mark.parametrize(("after", "row"), [(5, "6 .. 8"), (6, "7 .. 8"), (7, "8")])
def test_a_tail_that_is_gone_is_counted(path: Path, keys: Keys, after: int, row: str) -> None:
    """By what witnesses keep, and by a head that was noted."""
    with Ledger(path, keys=keys) as ledger:
        head = ledger.head()
    cut(path, after)
    assert rows(seen(path, keys), "ledger-removed") == [("chain", row)]
    found = seen(path, keys, head=head)
    assert rows(found, "ledger-removed") == [("chain", row)] * 2
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
    assert [one.values for one in found.faults] == [{"record": 3, "place": "--head"}]
    cut(path, 3)
    assert "ledger-rewritten" not in coded(seen(path, keys, head=chain.Head(3, older)).faults)


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
    changed = [row.partition(" ")[0] for _, row in rows(found, "ledger-changed")]
    assert changed == ["500", "501", "1000", "1001", "1200"]


def test_what_was_accepted_is_counted(path: Path, keys: Keys, tmp_path: Path) -> None:
    """As many heads as contradict the records; what comes later is no part of it."""
    backup_of = tmp_path / "old.sqlite"
    with Ledger(path, keys=keys) as ledger:
        backup(ledger, backup_of)
        add(ledger, *"ABC")
    backup_of.replace(path)
    with Ledger(path, keys=keys) as ledger:
        ledger.accept("the disk failed", author="boris")
        found = verify(ledger)
        assert found.ok, found.faults
        accepted = accepted_in(found)
        assert (accepted["author"], accepted["reason"], accepted["count"]) == ("boris", "the disk failed", 3)


# keys that follow one another


def test_another_key_is_accepted_by_a_person_and_verification_says_so(path: Path, keys: Keys) -> None:
    """Nothing is recorded with it before; afterwards it is a break that is told, and no fault."""
    old = keys.public() or ""
    other = Keys(path.parent / "other").make()
    keys.keep("key.pem", (path.parent / "other" / "key.pem").read_bytes(), mode=0o600)
    keys.keep("public.pem", public_pem(other.public), mode=0o644)
    with Ledger(path, keys=keys) as ledger:
        with refused("key-other", error=LedgerError):
            add(ledger, "NEXT")
        ledger.accept("the laboratory moved", author="anna")
        add(ledger, "NEXT")
        found = verify(ledger)
        assert found.ok, found.faults
        (told,) = [one.values for one in found.findings if one.code == "key-break"]
        assert told == {"record": 9, "key": fingerprint(other.public), "reason": "the laboratory moved"}
        # who trusts the old one alone is told
        assert not verify(ledger, public=[old]).ok
    edit(path, "DELETE FROM head WHERE seq < 9")
    assert seen(path, keys).ok  # the first key's heads are gone: the witness keeps them


def test_a_rotation_is_no_break_even_where_something_was_accepted(path: Path, keys: Keys) -> None:
    """It is explained by the key before, and needs nobody's word."""
    old = keys.public() or ""
    new = keys.rotate("every year").public
    with Ledger(path, keys=keys) as ledger:
        add(ledger, "NEXT")
        ledger.accept("a colleague asked", author="anna")
        found = verify(ledger).findings
    (told,) = [one.values for one in found if one.code == "key-rotated"]
    assert told == {"record": 10, "key": fingerprint(new), "before": fingerprint(old)}
    assert "key-break" not in coded(found)


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
def head(tmp_path: Path) -> heads.SignedHead:
    """A genuine one."""
    key = Keys(tmp_path / "signer").make()
    return heads.signed_by(key, "a" * 32, chain.Head(7, "b" * 64), b"\1" * 32, "2026-05-01T00:00:00+00:00")


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
def test_what_is_no_head_is_refused(head: heads.SignedHead, change: dict[str, Any]) -> None:
    """Each field by itself, with the file that was wanted."""
    for whole in ({**head.statement(), **change}, {k: v for k, v in head.statement().items() if k not in change}):
        with refused("ledger-other-file", error=FileError):
            heads.parse_signed(whole, "head.json")


def test_what_is_a_head_is_read(head: heads.SignedHead, tmp_path: Path) -> None:
    """The same again, also of an empty ledger; genuine only while nothing was changed."""
    assert heads.parse_signed(head.statement(), "head.json") == head
    assert head.signature_is_valid()
    assert heads.parse_signed({**head.statement(), "size": 0, "root": "0123456789abcdef" * 4}, "head.json").size == 0
    for wrong in ([], None, "head", 7):
        with refused("ledger-other-file", error=FileError):
            heads.parse_signed(wrong, "head.json")
    file = tmp_path / "head.json"
    file.write_text(json.dumps(head.statement()))
    assert heads.read_head(file)[0] == head
    assert str(head).startswith(f"7 of {head.time}")
    for name, value in {"size": 8, "root": "0" * 64, "link": "0" * 64, "time": "later", "ledger": "0" * 32}.items():
        changed = {**head.statement(), name: value}
        assert not heads.parse_signed(changed, "head.json").signature_is_valid(), name
        file.write_text(json.dumps(changed))
        with refused("key-forged", error=FileError):
            heads.read_head(file)


def test_heads_of_one_size_need_no_proof_and_of_two_one_that_fits(place: Callable[[], str], keys: Keys) -> None:
    """Checked without the ledger: by the key of now, or one that it signed for; another ledger or a cut one is told."""
    where = place()
    with create(where, keys=keys) as ledger:
        public = keys.public()
        add(ledger, *"ABCDEFGH")
        old = ledger.signed_head()
        add(ledger, "N")
        same = ledger.signed_head()
        keys.rotate("every year")
        add(ledger, "NEXT")
        new = ledger.signed_head()
        with ledger.snapshot() as connection:
            proof, earlier = (heads.proof_since(connection, 8, size) for size in (new.size, 9))
    assert heads.check_extension(old, old, {}, None) is None
    content = {"consistency": {"from": 8, "proof": proof}, "changes": [7, *keys.changes()]}
    assert heads.check_extension(old, new, content, None) is heads.check_extension(old, new, content, public) is None
    of_one_key = {"consistency": {"from": 8, "proof": earlier}}
    assert heads.check_extension(old, same, of_one_key, public) is None
    twin, strange = (
        heads.SignedHead(**{**vars(old), **change}) for change in ({"root": "0" * 64}, {"ledger": "0" * 32})
    )
    for one, other, content_, key, code in (
        (old, same, {}, public, "ledger-no-proof"),
        (old, same, of_one_key, "ab" * 32, "key-not-laboratory"),
        (twin, same, of_one_key, public, "ledger-rewritten"),
        (strange, same, of_one_key, public, "ledger-another"),
        (old, new, {**content, "changes": []}, None, "key-not-laboratory"),
        (old, new, {**content, "consistency": {"from": 7, "proof": proof}}, None, "ledger-no-proof"),
        (old, new, {**content, "consistency": {"from": 8, "proof": []}}, None, "ledger-rewritten"),
        (twin, old, {}, None, "ledger-rewritten"),
    ):
        assert heads.check_extension(one, other, content_, key).code == code


# keys in files


def test_public_keys_in_a_file(tmp_path: Path, keys: Keys) -> None:
    """One, several, none, a private one."""
    made = [Keys(tmp_path / f"{n}").make().public for n in range(2)]
    file = tmp_path / "public.pem"
    file.write_bytes(b"".join(public_pem(one) for one in made))
    assert read_public(file).keys == tuple(made)
    assert read_public(file).certificates == ()
    file.write_text("-----BEGIN PUBLIC KEY-----\nAAAA\n-----END PUBLIC KEY-----\n")
    (tmp_path / "begun.pem").write_bytes(b"-----BEGIN PRIVATE KEY-----\n")
    for name, wanted in (
        ("public.pem", "ledger-other-file"),
        ("0/key.pem", "key-secret"),
        ("begun.pem", "key-secret"),
    ):
        with refused(wanted, error=FileError):
            read_public(tmp_path / name)
    with pytest.raises(FileError):
        read_public(tmp_path / "nowhere.pem")


def test_a_key_is_made_once_and_kept_from_others(tmp_path: Path, keys: Keys) -> None:
    """Of two that begin at once, one key; modes of the files; a file that another replaced is read again."""
    assert not keys.there
    assert keys.public() is None
    with refused("key-none", error=LedgerError):
        keys.signing()
    first = keys.make().public
    assert Keys(keys.folder).make().public == keys.make().public == keys.public() == first
    other = private_pem(Keys(tmp_path / "other").make().private)
    keys.keep("key.pem", other, mode=0o600, replace=False)
    assert keys.signing().public == first
    modes = {name: (keys.folder / name).stat().st_mode & 0o777 for name in ("key.pem", "public.pem")}
    assert modes == {"key.pem": 0o600, "public.pem": 0o644}
    assert keys.folder.stat().st_mode & 0o777 == 0o700
    assert sorted(one.name for one in keys.folder.iterdir()) == ["key.pem", "public.pem"]
    elsewhere = Keys(keys.folder).rotate("by another program").public
    assert keys.signing().public == elsewhere
    for words in ("", "  "):
        with refused("ledger-reason"):
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
            with refused("key-damaged", error=FileError) as stopped:
                keys.changes()
            assert stopped.value.line == at  # type: ignore[attr-defined]
    file.write_text(json.dumps(whole) + "\n\n")
    assert keys.changes() == [whole]


# time


def test_the_clock_may_go_back_two_minutes(place: Callable[[], str], keys: Keys) -> None:
    """To the second, and the refusal says both times and what to do."""
    now = datetime(2026, 5, 1, 12, tzinfo=UTC)
    clock, where = [now], place()
    create(where, keys=keys).close()
    with Ledger(where, clock=lambda: clock[0], keys=keys) as ledger:
        add(ledger, "A")
        clock[0] = now - timedelta(minutes=2, seconds=1)
        with refused("ledger-clock", error=LedgerError, now="2026-05-01 11:57:59", last="2026-05-01T12:00:00"):
            add(ledger, "B")
        clock[0] = now - timedelta(minutes=2)
        add(ledger, "B")


# what is stored


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
            with pytest.raises(LedgerError, check=lambda error: error.finding.code == "ledger-not-there"):
                ledger.get("tool", name)
        body = {"dial_deg": [0.0, 90.0, 0.0], "channels": {"accelerometer": [1.0]}, "count": 5, "captured": "key"}
        for position in (0, 2**31 - 1):
            ledger.append("reading", {"session": "s", "position": position, "attempt": 1}, body, author="anna")
            assert ledger.count("reading", position=position) == 1
        with refused("input-value", name="reading.position"):
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
    """Once; a program without a terminal is told how to give it; a wrong one and a key of another kind are none."""
    public = keys.make().public
    monkeypatch.setenv(PASSPHRASE, "")
    keys.set_passphrase("correct horse")
    assert b"ENCRYPTED" in keys.path.read_bytes()
    assert Keys(keys.folder).signing().public == public
    asked_for: list[str] = []
    monkeypatch.setattr("getpass.getpass", lambda text: asked_for.append(text) or "correct horse")
    monkeypatch.delenv(PASSPHRASE)
    for there in (None, Terminal(False)):
        monkeypatch.setattr("sys.stdin", there)
        with refused("key-passphrase", error=LedgerError):
            Keys(keys.folder).signing()
    monkeypatch.setattr("sys.stdin", Terminal(True))
    assert Keys(keys.folder).signing().public == Keys(keys.folder).signing().public == public
    assert len(asked_for) == 1
    monkeypatch.setenv(PASSPHRASE, "wrong")
    with refused("key-passphrase", error=LedgerError):
        Keys(keys.folder).signing()
    monkeypatch.setenv(PASSPHRASE, "")
    keys.set_passphrase("")
    assert b"ENCRYPTED" not in keys.path.read_bytes()
    for data, wanted in (
        (private_pem(ec.generate_private_key(ec.SECP256R1())), "key-damaged"),
        (b"nonsense", "key-damaged"),
    ):
        keys.path.write_bytes(data)
        with refused(wanted, error=LedgerError):
            Keys(keys.folder).signing()


# A ledger that was rewritten whole, in every digest and link, and all signed heads with it removed from the file.


def forge(path: Path, changed: int = 2) -> None:
    """Another author of one record, and no trace of it in the file."""
    rewrite(path, changed, "DELETE FROM head")


@pytest.mark.parametrize("changed", [1, 8])
def test_it_is_known_at_any_path_by_what_is_kept_beside_the_key(path: Path, keys: Keys, changed: int) -> None:
    """By the links before what was changed, and where there are none, by the times of the records."""
    other = path.with_name("other.sqlite")
    shutil.copy(path, other)
    forge(other, changed)
    for copy in (False, True):
        found = seen(other, keys, copy=copy)
        assert "ledger-rewritten" in said(found)
        assert not found.proven
    assert "ledger-signatures-removed" in said(seen(other, keys))
    assert "ledger-unsigned" not in said(seen(other, keys))
    forge(path, changed)
    assert "ledger-another" in said(seen(path, keys))


def test_a_folder_that_is_a_witness_knows_it(path: Path, keys: Keys, tmp_path: Path) -> None:
    """On a computer that has neither the key nor the file beside it."""
    shutil.copytree(keys.folder / "heads", tmp_path / "share")
    auditor = Keys(tmp_path / "auditor")
    name_others(auditor.folder, [str(tmp_path / "share")])
    assert seen(path, auditor).ok
    forge(path)
    found = seen(path, auditor).faults
    assert any(fits(one, ["ledger-signatures-removed"], {"place": str(tmp_path / "share")}) for one in found)


def test_with_the_public_key_it_is_a_fault_and_without_it_is_not_proven(path: Path, keys: Keys, tmp_path: Path) -> None:
    """Where nothing is known of it: whoever gives the key expects it to be signed."""
    public, nothing = str(keys.public()), Keys(tmp_path / "none")
    forge(path)
    found = seen(path, nothing, public=[public])
    assert coded(found.faults) == ["ledger-signatures-removed"]
    found = seen(path, nothing)
    assert (found.ok, found.proven) == (True, False)


def test_nobody_answers_for_it_by_a_record_in_it(path: Path, keys: Keys) -> None:
    """An event of acceptance is signed, or it is nothing."""
    with Ledger(path, keys=keys) as ledger:
        ledger.accept("as it should be", author="anna")
    other = path.with_name("other.sqlite")
    shutil.copy(path, other)
    forge(other)
    assert "ledger-rewritten" in said(seen(other, keys))


def test_a_ledger_of_before_the_key_is_read_with_a_note(path: Path, keys: Keys, tmp_path: Path) -> None:
    """It was never signed, and nothing here says that it was; it is sound, and not proven."""
    old = tmp_path / "old.sqlite"
    with create(old, keys=keys, sign=False) as ledger:
        add(ledger, "A")
    found = seen(old, keys)
    assert (found.ok, found.proven, len(found.findings)) == (True, False, 1)
    shutil.copy(old, tmp_path / "kept.sqlite")
    with create(old, keys=keys, sign=True) as ledger:
        add(ledger, "B")
    # a copy from before it was signed: what the witness has agrees with it
    found = seen(tmp_path / "kept.sqlite", keys, copy=True)
    assert (found.ok, found.proven) == (True, False)
    assert "ledger-unsigned" not in said(found)


@pytest.mark.parametrize("where", ["in its place", "at another path"])
def test_nothing_is_recorded_upon_it_and_it_is_not_signed(path: Path, keys: Keys, where: str) -> None:
    """Before somebody answers for it; then it goes on under its name, and verification says so ever after."""
    if where == "at another path":
        path = shutil.copy(path, path.with_name("other.sqlite"))
    forge(path)
    with Ledger(path, keys=keys) as ledger:
        with refused("ledger-signatures-removed", error=LedgerError):
            add(ledger, "NEXT")
        assert ledger.head().seq == 8
    with refused("ledger-signatures-removed", error=LedgerError):
        create(path, keys=keys, sign=True)
    with Ledger(path, keys=keys) as ledger:
        assert ledger.signed_head() is None
    with create(path, keys=keys, sign=True, accepted=True) as ledger:
        assert not verify(ledger).ok  # not yet said by anybody
        ledger.accept("the disk was repaired", author="anna")
        add(ledger, "NEXT")
        found = verify(ledger)
        assert [one.body["reason"] for one in ledger.find("event", action="accepted")] == ["the disk was repaired"]
    assert found.proven, found.faults
    accepted = accepted_in(found)
    assert (accepted["author"], accepted["reason"], accepted["count"]) == ("anna", "the disk was repaired", 7)


def test_a_ledger_that_is_unsigned_on_purpose_is_recorded_in(keys: Keys, tmp_path: Path) -> None:
    """And signed later, from when on verification says."""
    where = tmp_path / "plain.sqlite"
    keys.make()
    with create(where, keys=keys, sign=False) as ledger:
        add(ledger, *"ABC")
    with create(where, keys=keys, sign=True) as ledger:
        add(ledger, "D")
        found = verify(ledger)
    assert found.proven
    assert [one.values for one in found.findings if one.code == "ledger-unsigned-begin"] == [{"count": 3}]
    with create(tmp_path / "new.sqlite", keys=keys) as ledger:
        add(ledger, "D")
        assert "ledger-unsigned-begin" not in said(verify(ledger))
