"""What a user types: certificates checked on another computer, with a public key and what the laboratory hands out."""

from __future__ import annotations

import json
import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.cli import main
from inclinometry.errors import FileError
from inclinometry.laboratory import certificates
from inclinometry.laboratory.certificate.laboratory import Laboratory
from inclinometry.laboratory.certificate.signing import seal, sign_json
from inclinometry.laboratory.certificate.status import make_status, read_status
from inclinometry.laboratory.ledger.chain import compact
from inclinometry.laboratory.ledger.exchange import backup
from inclinometry.laboratory.ledger.heads import ACCEPTED
from inclinometry.laboratory.ledger.keys import Keys, read_public
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError
from inclinometry.laboratory.results import finish_calibration

REFERENCE = Path(__file__).parents[1] / "reference" / "certificate"
LAB = Laboratory("Stand & Son", "1 Street", "NO")


Run = Callable[..., Any]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """run(*words, status=0) is what a command says that ends with this status; with --json its object."""

    def ran(*words: object, status: int = 0) -> Any:
        with pytest.raises(SystemExit) as stopped:
            main([str(word) for word in words])
        out, err = capsys.readouterr()
        assert int(stopped.value.code or 0) == status, out + err
        return json.loads(out) if "--json" in words else out + err

    return ran


@pytest.fixture
def issued(laboratory: Ledger, bench: SimpleNamespace, tmp_path: Path, run: Run) -> SimpleNamespace:
    """Two certificates of one ledger, the second in the place of the first, on the disk of somebody else."""
    session = bench.calibrated(laboratory, plans.twelve())
    found = finish_calibration(laboratory, session.id, author="anna")
    made = certificates.issue(laboratory, found.id, None, LAB, author="anna", accept_warnings="known field")
    number = made.keys["number"]
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    files = []
    for name, _, data in certificates.documents(laboratory, made).values():
        files.append(folder / name)
        files[-1].write_bytes(data)
    key, status = folder / "laboratory.pem", folder / "status.json"

    def check(*files: object, key: Path = key, status: int = 0, more: tuple[str, ...] = ()) -> Any:
        return run("certificate", "verify", *files, "--key", key, *more, status=status)

    def hand_out() -> None:
        """Public key and statement, as the laboratory writes them."""
        run("ledger", "key", "--public", key)
        run("ledger", "status", "-o", status, "--ledger", laboratory.where)

    return SimpleNamespace(
        ledger=laboratory, number=number, files=files, key=key, status=status, folder=folder, calibration=found.id,
        check=check, found=lambda *files, **how: check(*files, more=("--json",), **how), hand_out=hand_out,
    )  # fmt: skip


def put_back(where: Path, kept: Path) -> None:
    """A backup in the place of the ledger."""
    for file in where.parent.glob(f"{where.name}*"):
        file.unlink()
    shutil.copy(kept, where)


def signed(issued: SimpleNamespace, content: dict[str, Any]) -> dict[str, Any]:
    """A statement with the laboratory's signature under what it says now."""
    bare = {name: value for name, value in content.items() if name not in ("key", "signature")}
    return issued.ledger.keys.signing().statement(bare)


def sign_anew(issued: SimpleNamespace, content: dict[str, Any]) -> None:
    issued.status.write_text(json.dumps(signed(issued, content)))


def test_a_certificate_is_proven_without_its_ledger(
    issued: SimpleNamespace, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Together, each alone, by the text of the square code; on a computer without keys or ledger."""
    issued.hand_out()
    code = str(seal(certificates.status(issued.ledger, issued.number).record.body["record"], issued.ledger.keys))
    monkeypatch.setenv("INCLINOMETRY_KEYS", str(tmp_path / "nothing"))
    everything = [*issued.files, code, issued.status]
    said = issued.check(*everything)
    assert said.count("genuine, signed by") == 4
    assert "NOT GENUINE" not in said
    assert f"certificate {issued.number}: issued, as of record {issued.ledger.head().seq} of" in said
    for one in (*issued.files, code):
        assert "no statement of the ledger was given" in issued.check(one)
    found = issued.found(*everything)
    assert found["ok"]
    assert [one["state"] for one in found["files"]] == ["issued"] * 4
    assert not (tmp_path / "nothing").exists()


def test_what_was_ended_is_said(issued: SimpleNamespace, tmp_path: Path) -> None:
    """Void, superseded, and an old statement beside the new one; the proofs in a statement hold for what it says."""
    issued.hand_out()
    old = tmp_path / "old.json"
    shutil.copy(issued.status, old)
    how = {"author": "anna", "accept_warnings": "known field", "supersedes": issued.number, "reason": "wrong customer"}
    made = certificates.issue(issued.ledger, issued.calibration, None, LAB, **how)
    second = made.keys["number"]
    certificates.void(issued.ledger, second, "wrong stand", author="anna")
    issued.hand_out()
    pdf = issued.files[0]
    assert f"superseded by {second} (wrong customer), as of" in issued.check(pdf, issued.status, old, status=1)
    (issued.folder / "new.pdf").write_bytes(certificates.documents(issued.ledger, made)["pdf"][2])
    assert f"{second}: void (wrong stand)" in issued.check(issued.folder / "new.pdf", issued.status, status=1)
    # two certificates are no set, though each is genuine
    said = issued.check(pdf, issued.folder / "new.pdf", status=1)
    assert said.count("genuine, signed by") == 2
    assert "[certificate-files-apart]" in said
    (apart,) = issued.found(pdf, issued.folder / "new.pdf", status=1)["problems"]
    assert apart["values"]["numbers"] == sorted((issued.number, second))
    # the one of before is as it was then, and a statement that does not list it says so
    issued.check(pdf, old)
    assert "not among those" in issued.check(issued.folder / "new.pdf", old, status=1)


def test_two_histories_under_one_key_are_said(issued: SimpleNamespace, tmp_path: Path) -> None:
    """A ledger whose void was cut off, begun anew and grown beyond: the larger number does not win."""
    original = Path(issued.ledger.where)
    copies = [tmp_path / "cut.sqlite", tmp_path / "other.sqlite"]
    for copy in copies:
        with sqlite3.connect(original) as source, sqlite3.connect(copy) as target:
            source.backup(target)
    certificates.void(issued.ledger, issued.number, "wrong stand", author="anna")
    issued.hand_out()
    with sqlite3.connect(copies[1]) as database:
        for (trigger,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            database.execute(f'DROP TRIGGER "{trigger}"')
        database.execute("DELETE FROM head")
    for copy in copies:
        forged = tmp_path / f"{copy.stem}.json"
        folder = tmp_path / f"keys of {copy.stem}"
        shutil.copytree(issued.ledger.keys.folder, folder, ignore=shutil.ignore_patterns("heads"))
        with Ledger(str(copy), keys=Keys(folder)) as ledger:
            if ledger.signed_head() is None:
                ledger.begin_signing()
            for serial in "ABC":
                ledger.append("tool", {"serial": serial}, {"name": "tool", "triads": {}}, author="anna")
            forged.write_text(json.dumps(make_status(ledger)))
        for statements in ((issued.status, forged), (forged, issued.status)):
            said = issued.check(issued.files[0], *statements, status=1)
            (line,) = [line for line in said.splitlines() if "[certificate-two-histories]" in line]
            assert str(forged) in line
            assert str(issued.status) in line
            assert f"certificate {issued.number}: void (wrong stand), as of" in said
            (told,) = issued.found(issued.files[0], *statements, status=1)["problems"]
            assert told["code"] == "certificate-two-histories"
        issued.check(issued.files[0], forged)


def test_a_void_that_a_backup_took_back_stays(issued: SimpleNamespace, run: Run, tmp_path: Path) -> None:
    """Voided, the backup put back and accepted: the new statement says so, and the older one is not overruled."""
    where, kept = Path(issued.ledger.where), tmp_path / "backup.sqlite"
    backup(issued.ledger, kept)
    certificates.void(issued.ledger, issued.number, "wrong stand", author="anna")
    issued.hand_out()
    records = issued.ledger.head().seq
    issued.ledger.close()
    put_back(where, kept)
    run("ledger", "init", where, "--accept", "disk failed")
    run("ledger", "verify", "--ledger", where)
    later = tmp_path / "later.json"
    said = run("ledger", "status", "-o", later, "--ledger", where)
    line = f"Break of the ledger between records {records} and {records - 1}, accepted on 20"
    assert line in said
    (carried,) = read_status(later, read_public(issued.key)).accepted
    assert (carried["reason"], carried["before"], carried["after"]) == ("disk failed", records, records - 1)
    assert carried["author"]
    # issued by the new statement alone, and with it that records were lost
    said = issued.check(issued.files[0], later)
    assert f"certificate {issued.number}: issued, as of" in said
    assert line in said
    assert said.rstrip().endswith(": disk failed")
    found = issued.found(issued.files[0], later)
    assert found["accepted"] == [{name: carried[name] for name in carried if name != "entry"}]
    # void as soon as any statement says so; the break is said once, though two statements carry it
    again = tmp_path / "again.json"
    run("ledger", "status", "-o", again, "--ledger", where)
    for statements in ((issued.status, later, again), (again, later, issued.status)):
        said = issued.check(issued.files[0], *statements, status=1)
        assert f"certificate {issued.number}: void (wrong stand), as of" in said
        assert said.count(line) == 1
        found = issued.found(issued.files[0], *statements, status=1)
        assert (found["ok"], found["files"][0]["state"]) == (False, "void")


def test_a_second_restore_loses_no_acceptance(issued: SimpleNamespace, run: Run, tmp_path: Path) -> None:
    """One copy is put back twice, and accepted each time; it holds neither event."""
    where, kept, later = Path(issued.ledger.where), tmp_path / "monday.sqlite", tmp_path / "later.json"
    issued.hand_out()
    backup(issued.ledger, kept)
    issued.ledger.append("tool", {"serial": "IN-9"}, {"name": "tool", "triads": {}}, author="anna")
    issued.ledger.close()
    said = ["disk failed", "again", "once more"]
    for reason in said:
        put_back(where, kept)
        run("ledger", "init", where, "--accept", reason)
    run("ledger", "status", "-o", later, "--ledger", where)
    found = read_status(later, read_public(issued.key)).accepted
    assert [one["reason"] for one in found] == said
    assert len({one["created"] for one in found}) == 3
    shown = run("ledger", "verify", "--ledger", where)
    assert all(f": {reason} [ledger-accepted]\n" in shown for reason in said)
    assert issued.check(issued.files[0], later).count("Break of the ledger ") == 3


def test_void_is_said_before_superseded(issued: SimpleNamespace, tmp_path: Path) -> None:
    """A ledger that lost a void and superseded the certificate later: what one statement calls void is void."""
    where, kept = Path(issued.ledger.where), tmp_path / "backup.sqlite"
    backup(issued.ledger, kept)
    certificates.void(issued.ledger, issued.number, "wrong stand", author="anna")
    issued.hand_out()
    issued.ledger.close()
    put_back(where, kept)
    later = tmp_path / "later.json"
    with Ledger(where, keys=issued.ledger.keys) as ledger:
        ledger.accept("disk failed", author="anna")
        how = {"author": "anna", "accept_warnings": "known field", "supersedes": issued.number, "reason": "typo"}
        certificates.issue(ledger, issued.calibration, None, LAB, **how)
        later.write_text(json.dumps(make_status(ledger)))
    assert f"certificate {issued.number}: void (wrong stand), as of" in issued.check(
        issued.files[0], issued.status, later, status=1
    )


def test_a_break_in_a_statement_is_proven(issued: SimpleNamespace, run: Run) -> None:
    """Its entry is in the chain; events of older programs did not keep how many records there were before."""
    issued.hand_out()
    before = issued.ledger.head().seq
    ledger = issued.ledger
    ledger.append("event", ACCEPTED, {"reason": "as before", "details": {"head": str(ledger.head())}}, author="anna")
    ledger.accept("nothing is lost", author="boris")
    said = run("ledger", "status", "-o", issued.status, "--ledger", ledger.where)
    assert f"Break of the ledger between records ? and {before}, accepted on" in said
    assert f"Break of the ledger between records {before + 1} and {before + 1}, accepted on" in said
    content = json.loads(issued.status.read_text())
    assert [one["author"] for one in content["accepted"]] == ["anna", "boris"]
    content["accepted"][0]["entry"]["digest"] = "0" * 64
    sign_anew(issued, content)
    with refused("certificate-proof", error=FileError, name="20"):
        read_status(issued.status, read_public(issued.key))
    del content["accepted"]
    sign_anew(issued, content)
    with refused("ledger-other-file", error=FileError):
        read_status(issued.status, read_public(issued.key))


def test_a_statement_of_version_1_is_read(run: Run) -> None:
    """As the program before wrote it, with the file of a certificate that it calls void."""
    status = REFERENCE / "status-1.json"
    assert read_status(status, read_public(REFERENCE / "laboratory.pem")).accepted == ()
    paper, key = REFERENCE / "status-1-paper.json", REFERENCE / "laboratory.pem"
    said = run("certificate", "verify", paper, status, "--key", key, status=1)
    assert "genuine, signed by 1205471ce8b2fa737ca4c5f8f46173c4" in said
    assert "certificate 2026-0001: void (wrong stand), as of record 59 of 2026-11-26" in said
    assert "Break" not in said


def test_what_was_changed_is_named(issued: SimpleNamespace, tmp_path: Path) -> None:
    issued.hand_out()
    pdf, xml, text = issued.files
    xml.write_bytes(xml.read_bytes().replace(b"1 Street", b"2 Street"))
    said = issued.check(pdf, xml, text, issued.status, status=1)
    assert f"{xml}: DCC of certificate {issued.number}: NOT GENUINE\n" in said
    (line,) = [line for line in said.splitlines() if line.endswith(" [certificate-changed]")]
    assert f" {xml}: " in line
    assert said.count("genuine, signed by") == 2
    # how it stands is asked of a certificate of the laboratory, not of what it did not make
    assert "not known" not in issued.check(xml, status=1)
    # a key that is another's, rubbish, nothing
    Keys(tmp_path / "other").make()
    other = tmp_path / "other" / "public.pem"
    said = issued.check(pdf, key=other, status=1)
    assert "NOT PROVEN\n" in said
    assert "[certificate-key]" in said
    assert "NOT GENUINE" not in said
    assert issued.check(xml, key=other, status=1).count("NOT GENUINE") == 1
    for files, key, problem in (
        ([pdf], pdf, "[ledger-other-file]"),
        ([issued.key], issued.key, "[certificate-not-one]"),
        ([tmp_path / "none.pdf"], issued.key, "[file-absent]"),
        ([], issued.key, "[input-missing]"),
        ([issued.status], issued.key, "[web-statement-alone]"),
        ([pdf, issued.status], other, "[key-not-laboratory]"),
    ):
        said = issued.check(*files, key=key, status=2)
        assert problem in said
        assert said.count("\n") == 1


def test_a_forged_statement_is_refused(issued: SimpleNamespace) -> None:
    """Any change of it; a certificate that is not in the ledger, though the key signed for it."""
    issued.hand_out()
    public = read_public(issued.key)
    content = json.loads(issued.status.read_text())
    assert read_status(issued.status, public).rows[issued.number]["state"] == "issued"
    for change in ({"certificates": []}, {"time": "2030-01-01T00:00:00+00:00"}, {"head": {}}, {"version": 1},
                   {"version": 3}, {"accepted": [{}]}):  # fmt: skip
        issued.status.write_text(json.dumps({**content, **change}))
        with pytest.raises(FileError):
            read_status(issued.status, public)
    row = content["certificates"][0]
    row["entry"]["digest"] = "0" * 64
    sign_anew(issued, content)
    with refused("certificate-proof", error=FileError):
        read_status(issued.status, public)
    with pytest.raises(LedgerError, check=lambda error: error.finding.code == "ledger-not-there"):
        make_status(issued.ledger, ["2020-0007"])


def test_the_record_in_the_statement_is_the_one_in_the_file(issued: SimpleNamespace) -> None:
    """A file that the key signed, of a record that the ledger does not hold under this number."""
    issued.hand_out()
    record = dict(certificates.status(issued.ledger, issued.number).record.body["record"])
    record["customer"] = {**record["customer"], "name": "Somebody else"}
    made = seal(record, issued.ledger.keys)
    issued.files[2].write_bytes(sign_json(record, made, issued.ledger.keys.signing().public))
    said = issued.check(issued.files[2], issued.status, status=1)
    assert "[certificate-not-in-ledger]" in said
    assert "[certificate-files-apart]" in issued.check(*issued.files, status=1)


def test_certificates_of_a_lost_key_are_proven_by_the_statement_of_the_new_one(
    issued: SimpleNamespace, run: Run, tmp_path: Path
) -> None:
    """Rotated, lost, published: without a statement not proven, with it those that the ledger lists and no others."""
    old = Keys(tmp_path / "stolen")
    shutil.copytree(issued.ledger.keys.folder, old.folder)
    record = {**certificates.status(issued.ledger, issued.number).record.body["record"], "number": "2026-0099"}
    run("ledger", "key", "--rotate", "every year")
    run("ledger", "key", "--lost", "laptop stolen", "--public", issued.key)
    assert issued.check(*issued.files, status=1).count("[certificate-key]") == 3
    issued.hand_out()  # before anything is recorded again
    assert f"certificate {issued.number}: issued, as of" in issued.check(*issued.files, issued.status)
    forged = tmp_path / "forged.json"
    forged.write_bytes(sign_json(record, seal(record, old), old.signing().public))
    assert "[certificate-key]" in issued.check(forged, issued.status, status=1)
    # what the lost key signed after its loss, and a key that nothing explains
    changes = issued.ledger.keys.folder / "changes.jsonl"
    kept = changes.read_text()
    moved = {**issued.ledger.keys.changes()[-1], "before": old.signing().public, "time": "2020-01-01T00:00:00+00:00"}
    for text, wanted in (
        (compact(signed(issued, moved)), "[key-after-loss]"),
        ("", "[key-other]"),
    ):
        changes.write_text(text)
        assert wanted in run("ledger", "status", "-o", issued.status, "--ledger", issued.ledger.where, status=2)
    changes.write_text(kept)


def test_keys_and_heads_as_a_user_types_them(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Made with the ledger, published, rotated; a head exported and checked against an older one; a witness named."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("INCLINOMETRY_KEYS", str(tmp_path / "keys"))
    run("ledger", "key", status=2)
    assert "signed by the key" in run("ledger", "init", "lab.sqlite")
    run("ledger", "head", "--ledger", "lab.sqlite", "-o", "old.json")
    (tmp_path / "share").mkdir()
    assert str(tmp_path / "share") in run("ledger", "witness", "share", "--ledger", "lab.sqlite")
    run("ledger", "key", "--rotate", "every year", "--public", "laboratory.pem")
    with Ledger("lab.sqlite") as ledger:
        ledger.append("tool", {"serial": "A"}, {"name": "tool", "triads": {}}, author="anna")
    run("ledger", "head", "--ledger", "lab.sqlite", "--since", "old.json", "-o", "new.json")
    said = run("ledger", "head", "new.json", "--since", "old.json", "--key", "laboratory.pem")
    assert "begins with the 0 of" in said
    said = run("ledger", "verify", "--ledger", "lab.sqlite", "--key", "laboratory.pem")
    assert "[key-witness-agrees]" in said
    assert "[key-witness-unwritten]" in run("ledger", "witness", "nowhere/at/all", "--ledger", "lab.sqlite", status=2)
    assert not (tmp_path / "nowhere").exists()
    assert "[ledger-address]" in run("ledger", "witness", "http://127.0.0.1:9", "--ledger", "lab.sqlite", status=2)
    run("ledger", "witness", tmp_path / "share", "--remove")
    assert "[input-choice]" in run("ledger", "witness", "share", "--remove", status=2)
    run("ledger", "key", "--rotate", "a", "--lost", "b", status=2)
    assert "[ledger-reason]" in run("ledger", "key", "--rotate", " ", status=2)
    assert "was begun, lost was" in run("ledger", "key", "--lost", "stolen")
    content = json.loads((tmp_path / "new.json").read_text())
    (tmp_path / "new.json").write_text(json.dumps({**content, "size": 7}))
    assert "[key-forged]" in run("ledger", "head", "new.json", status=2)
