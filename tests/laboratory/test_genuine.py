"""What a user types: certificates checked on another computer, with a public key and what the laboratory hands out."""

from __future__ import annotations

import json
import shutil
import sqlite3
from pathlib import Path
from types import SimpleNamespace

import pytest

from inclinometry.calibration import plans
from inclinometry.cli import main
from inclinometry.errors import FileError
from inclinometry.laboratory import certificates
from inclinometry.laboratory.certificate.laboratory_toml import Laboratory
from inclinometry.laboratory.certificate.signing import seal, sign_json
from inclinometry.laboratory.certificate.status import make_status, read_status
from inclinometry.laboratory.ledger.chain import compact
from inclinometry.laboratory.ledger.keys import Keys, read_public
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError
from inclinometry.laboratory.results import finish_calibration

LAB = Laboratory("Stand & Son", "1 Street", "NO")


def run(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str]:
    """Exit status and what was said."""
    with pytest.raises(SystemExit) as stopped:
        main([str(word) for word in words])
    said = capsys.readouterr()
    return int(stopped.value.code or 0), said.out + said.err


@pytest.fixture
def issued(laboratory: Ledger, bench: SimpleNamespace, tmp_path: Path) -> SimpleNamespace:
    """Two certificates of one ledger, the second in the place of the first, on the disk of somebody else."""
    session = bench.calibrated(laboratory, plans.twelve())
    found = finish_calibration(laboratory, session.id, author="anna")
    made = certificates.issue(laboratory, found.id, None, LAB, author="anna")
    number = made.keys["number"]
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    files = []
    for name, _, data in certificates.documents(laboratory, made).values():
        files.append(folder / name)
        files[-1].write_bytes(data)
    key, status = folder / "laboratory.pem", folder / "status.json"
    return SimpleNamespace(
        ledger=laboratory, number=number, files=files, key=key, status=status, folder=folder, calibration=found.id
    )


def hand_out(issued: SimpleNamespace, capsys: pytest.CaptureFixture[str]) -> None:
    """Public key and statement, as the laboratory writes them."""
    assert run(capsys, "ledger", "key", "--public", issued.key)[0] == 0
    status, said = run(capsys, "ledger", "status", "-o", issued.status, "--ledger", issued.ledger.where)
    assert status == 0, said


def test_a_certificate_is_proven_without_its_ledger(
    issued: SimpleNamespace, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Together, each alone, by the text of the square code; on a computer without keys or ledger."""
    hand_out(issued, capsys)
    code = str(seal(certificates.status(issued.ledger, issued.number).record.body["record"], issued.ledger.keys))
    monkeypatch.setenv("INCLINOMETRY_KEYS", str(tmp_path / "nothing"))
    everything = [*issued.files, code, issued.status]
    status, said = run(capsys, "certificate", "verify", *everything, "--key", issued.key)
    assert status == 0, said
    assert said.count("genuine, signed by") == 4
    assert "NOT GENUINE" not in said
    assert f"certificate {issued.number}: issued, as of record {issued.ledger.head().seq} of" in said
    for one in (*issued.files, code):
        status, said = run(capsys, "certificate", "verify", one, "--key", issued.key)
        assert status == 0, said
        assert "no statement of the ledger was given" in said
    status, said = run(capsys, "certificate", "verify", *everything, "--key", issued.key, "--json")
    found = json.loads(said)
    assert found["ok"]
    assert [one["state"] for one in found["files"]] == ["issued"] * 4
    assert not (tmp_path / "nothing").exists()


def test_what_was_ended_is_said(issued: SimpleNamespace, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Void, superseded, and an old statement beside the new one; the proofs in a statement hold for what it says."""
    hand_out(issued, capsys)
    old = tmp_path / "old.json"
    shutil.copy(issued.status, old)
    made = certificates.supersede(
        issued.ledger, issued.number, issued.calibration, None, LAB, reason="wrong customer", author="anna"
    )
    second = made.keys["number"]
    certificates.void(issued.ledger, second, "wrong stand", author="anna")
    hand_out(issued, capsys)
    pdf = issued.files[0]
    status, said = run(capsys, "certificate", "verify", pdf, issued.status, old, "--key", issued.key)
    assert status == 1
    assert f"superseded by {second} (wrong customer), as of" in said
    (issued.folder / "new.pdf").write_bytes(certificates.documents(issued.ledger, made)["pdf"][2])
    status, said = run(capsys, "certificate", "verify", issued.folder / "new.pdf", issued.status, "--key", issued.key)
    assert status == 1
    assert f"{second}: void (wrong stand)" in said
    # two certificates are no set, though each is genuine
    words = ["certificate", "verify", pdf, issued.folder / "new.pdf", "--key", issued.key]
    status, said = run(capsys, *words)
    assert status == 1
    assert said.count("genuine, signed by") == 2
    assert f"different certificates: {', '.join(sorted((issued.number, second)))}; verify each by itself" in said
    assert "different certificates" in json.loads(run(capsys, *words, "--json")[1])["problem"]
    # the one of before is as it was then, and a statement that does not list it says so
    assert run(capsys, "certificate", "verify", pdf, old, "--key", issued.key)[0] == 0
    status, said = run(capsys, "certificate", "verify", issued.folder / "new.pdf", old, "--key", issued.key)
    assert status == 1
    assert "not among those" in said


def test_two_histories_under_one_key_are_said(
    issued: SimpleNamespace, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A ledger whose void was cut off, begun anew and grown beyond: the larger number does not win."""
    original = Path(issued.ledger.where)
    copies = [tmp_path / "cut.sqlite", tmp_path / "other.sqlite"]
    for copy in copies:
        with sqlite3.connect(original) as source, sqlite3.connect(copy) as target:
            source.backup(target)
    certificates.void(issued.ledger, issued.number, "wrong stand", author="anna")
    hand_out(issued, capsys)
    with sqlite3.connect(copies[1]) as database:
        for (trigger,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            database.execute(f'DROP TRIGGER "{trigger}"')
        database.execute("DELETE FROM head")
    for copy, said_of in zip(copies, ("contradict each other about certificate", "is of the ledger"), strict=True):
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
            words = ["certificate", "verify", issued.files[0], *statements, "--key", issued.key]
            status, said = run(capsys, *words)
            assert status == 1, said
            (line,) = [line for line in said.splitlines() if "two histories under one key" in line]
            assert said_of in line
            assert str(forged) in line
            assert str(issued.status) in line
            assert f"certificate {issued.number}: void (wrong stand), as of" in said
            assert "two histories" in json.loads(run(capsys, *words, "--json")[1])["problem"]
        assert run(capsys, "certificate", "verify", issued.files[0], forged, "--key", issued.key)[0] == 0


def test_what_was_changed_is_named(issued: SimpleNamespace, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    hand_out(issued, capsys)
    pdf, xml, text = issued.files
    xml.write_bytes(xml.read_bytes().replace(b"1 Street", b"2 Street"))
    status, said = run(capsys, "certificate", "verify", pdf, xml, text, issued.status, "--key", issued.key)
    assert status == 1
    assert f"{xml}: DCC of certificate {issued.number}: NOT GENUINE: it was changed after it was signed" in said
    assert said.count("genuine, signed by") == 2
    # how it stands is asked of a certificate of the laboratory, not of what it did not make
    assert "not known" not in run(capsys, "certificate", "verify", xml, "--key", issued.key)[1]
    # a key that is another's, rubbish, nothing
    other = Keys(tmp_path / "other")
    other.make()
    (tmp_path / "other.pem").write_bytes((other.folder / "public.pem").read_bytes())
    status, said = run(capsys, "certificate", "verify", pdf, "--key", tmp_path / "other.pem")
    assert status == 1
    assert "NOT PROVEN: it is signed by the key" in said
    assert "NOT GENUINE" not in said
    assert run(capsys, "certificate", "verify", xml, "--key", tmp_path / "other.pem")[1].count("NOT GENUINE") == 1
    for words, problem in (
        (["certificate", "verify", pdf, "--key", pdf], "not the public key of a laboratory"),
        (["certificate", "verify", issued.key, "--key", issued.key], "neither PDF, XML nor JSON"),
        (["certificate", "verify", tmp_path / "none.pdf", "--key", issued.key], "check the name"),
        (["certificate", "verify", "--key", issued.key], "name the files of a certificate"),
        (["certificate", "verify", issued.status, "--key", issued.key], "statement about 1 certificate as of record"),
        (["certificate", "verify", pdf, issued.status, "--key", tmp_path / "other.pem"], "not by the laboratory's"),
    ):
        status, said = run(capsys, *words)
        assert status == 2, said
        assert problem in said
        assert said.count("\n") == 1


def test_a_forged_statement_is_refused(issued: SimpleNamespace, capsys: pytest.CaptureFixture[str]) -> None:
    """Any change of it; a certificate that is not in the ledger, though the key signed for it."""
    hand_out(issued, capsys)
    public = read_public(issued.key)
    content = json.loads(issued.status.read_text())
    assert read_status(issued.status, public).rows[issued.number]["state"] == "issued"
    for change in ({"certificates": []}, {"time": "2030-01-01T00:00:00+00:00"}, {"head": {}}, {"version": 2}):
        issued.status.write_text(json.dumps({**content, **change}))
        with pytest.raises(FileError):
            read_status(issued.status, public)
    row = content["certificates"][0]
    row["entry"]["digest"] = "0" * 64
    bare = {name: value for name, value in content.items() if name not in ("key", "signature")}
    issued.status.write_text(json.dumps(issued.ledger.keys.signing().statement(bare)))
    with pytest.raises(FileError, match="does not hold"):
        read_status(issued.status, public)
    with pytest.raises(LedgerError, match="there is no certificate"):
        make_status(issued.ledger, ["2020-0007"])


def test_the_record_in_the_statement_is_the_one_in_the_file(
    issued: SimpleNamespace, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file that the key signed, of a record that the ledger does not hold under this number."""
    hand_out(issued, capsys)
    record = dict(certificates.status(issued.ledger, issued.number).record.body["record"])
    record["customer"] = {**record["customer"], "name": "Somebody else"}
    made = seal(record, issued.ledger.keys)
    issued.files[2].write_bytes(sign_json(record, made, issued.ledger.keys.signing().public))
    status, said = run(capsys, "certificate", "verify", issued.files[2], issued.status, "--key", issued.key)
    assert status == 1
    assert "the ledger holds another record under this number" in said
    status, said = run(capsys, "certificate", "verify", *issued.files, "--key", issued.key)
    assert status == 1
    assert "different records" in said


def test_certificates_of_a_lost_key_are_proven_by_the_statement_of_the_new_one(
    issued: SimpleNamespace, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Rotated, lost, published: without a statement not proven, with it those that the ledger lists and no others."""
    old = Keys(tmp_path / "stolen")
    shutil.copytree(issued.ledger.keys.folder, old.folder)
    record = {**certificates.status(issued.ledger, issued.number).record.body["record"], "number": "2026-0099"}
    assert run(capsys, "ledger", "key", "--rotate", "every year")[0] == 0
    assert run(capsys, "ledger", "key", "--lost", "laptop stolen", "--public", issued.key)[0] == 0
    status, said = run(capsys, "certificate", "verify", *issued.files, "--key", issued.key)
    assert status == 1
    assert said.count("NOT PROVEN: it is signed by the key") == 3
    hand_out(issued, capsys)  # before anything is recorded again
    status, said = run(capsys, "certificate", "verify", *issued.files, issued.status, "--key", issued.key)
    assert status == 0, said
    assert f"certificate {issued.number}: issued, as of" in said
    forged = tmp_path / "forged.json"
    forged.write_bytes(sign_json(record, seal(record, old), old.signing().public))
    status, said = run(capsys, "certificate", "verify", forged, issued.status, "--key", issued.key)
    assert status == 1
    assert "which was lost, and no statement lists it" in said
    # what the lost key signed after its loss, and a key that nothing explains
    changes = issued.ledger.keys.folder / "changes.jsonl"
    kept = changes.read_text()
    moved = {**issued.ledger.keys.changes()[-1], "before": old.signing().public, "time": "2020-01-01T00:00:00+00:00"}
    bare = {name: value for name, value in moved.items() if name not in ("key", "signature")}
    for text, wanted in (
        (compact(issued.ledger.keys.signing().statement(bare)), "which was lost on 2020-01-01T00:00:00 UTC"),
        ("", "bring the right key there"),
    ):
        changes.write_text(text)
        status, said = run(capsys, "ledger", "status", "-o", issued.status, "--ledger", issued.ledger.where)
        assert status == 2
        assert wanted in said
    changes.write_text(kept)


def test_keys_and_heads_as_a_user_types_them(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Made with the ledger, published, rotated; a head exported and checked against an older one; a witness named."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("INCLINOMETRY_KEYS", str(tmp_path / "keys"))
    assert run(capsys, "ledger", "key")[0] == 2
    status, said = run(capsys, "ledger", "init", "lab.sqlite")
    assert status == 0
    assert "signed by the key" in said
    assert run(capsys, "ledger", "head", "--ledger", "lab.sqlite", "-o", "old.json")[0] == 0
    (tmp_path / "share").mkdir()
    status, said = run(capsys, "ledger", "witness", "share", "--ledger", "lab.sqlite")
    assert status == 0
    assert str(tmp_path / "share") in said
    assert run(capsys, "ledger", "key", "--rotate", "every year", "--public", "laboratory.pem")[0] == 0
    with Ledger("lab.sqlite") as ledger:
        ledger.append("tool", {"serial": "A"}, {"name": "tool", "triads": {}}, author="anna")
    assert run(capsys, "ledger", "head", "--ledger", "lab.sqlite", "--since", "old.json", "-o", "new.json")[0] == 0
    status, said = run(capsys, "ledger", "head", "new.json", "--since", "old.json", "--key", "laboratory.pem")
    assert status == 0, said
    assert "begins with the 0 of" in said
    status, said = run(capsys, "ledger", "verify", "--ledger", "lab.sqlite", "--key", "laboratory.pem")
    assert status == 0, said
    assert f"witness {tmp_path / 'share'}: agrees up to record 3" in said
    status, said = run(capsys, "ledger", "witness", "nowhere/at/all", "--ledger", "lab.sqlite")
    assert status == 2
    assert "could not be written" in said
    assert not (tmp_path / "nowhere").exists()
    status, said = run(capsys, "ledger", "witness", "http://127.0.0.1:9", "--ledger", "lab.sqlite")
    assert status == 2
    assert "does not answer" in said
    assert run(capsys, "ledger", "witness", tmp_path / "share", "--remove")[0] == 0
    status, said = run(capsys, "ledger", "witness", "share", "--remove")
    assert status == 2
    assert "is not on the list" in said
    assert run(capsys, "ledger", "key", "--rotate", "a", "--lost", "b")[0] == 2
    status, said = run(capsys, "ledger", "key", "--rotate", "")
    assert status == 2
    assert "without a reason" in said
    status, said = run(capsys, "ledger", "witness", "share", "--ledger", "lab.sqlite", "--key", "nothere.pem")
    assert status == 2
    assert "--serve FOLDER" in said
    status, said = run(capsys, "ledger", "key", "--lost", "stolen")
    assert "was begun, lost was" in said
    content = json.loads((tmp_path / "new.json").read_text())
    (tmp_path / "new.json").write_text(json.dumps({**content, "size": 7}))
    status, said = run(capsys, "ledger", "head", "new.json")
    assert status == 2
    assert "changed or forged" in said
