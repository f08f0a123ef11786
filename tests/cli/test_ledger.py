"""The ledger command: flows of a laboratory, exit states, users without a terminal, who did what."""

from __future__ import annotations

import getpass
import sqlite3
from datetime import datetime
from pathlib import Path

import pytest
from tests.refusals import coded

from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.ledger.users import check_password

PASSWORD = "adze jib fen quoit"


@pytest.fixture
def lab(run, tmp_path):
    """An empty ledger, lab.sqlite in the folder."""
    assert run("ledger init lab.sqlite").status == 0
    return tmp_path / "lab.sqlite"


@pytest.fixture
def keys(run, tmp_path, monkeypatch):
    """own.sqlite, signed by a key of its own; the folder of the keys."""
    monkeypatch.setenv("INCLINOMETRY_KEYS", str(tmp_path / "keys"))
    monkeypatch.setenv("INCLINOMETRY_PASSWORD", PASSWORD)
    run("ledger init own.sqlite").ok()
    return tmp_path / "keys"


def test_copies_keep_the_head(run, lab, monkeypatch):
    """init, users, verify, backup, export, import: the same head everywhere."""
    monkeypatch.setenv("INCLINOMETRY_PASSWORD", PASSWORD)
    assert run("ledger users anna --role administrator --ledger", lab).status == 0
    sound = run("ledger verify --ledger", lab, "--json").json
    assert sound["ok"]
    assert sound["records"] == 1
    run("ledger backup copy.sqlite --ledger", lab)
    run("ledger export all.zip --ledger", lab)
    assert sound["head"] in run("ledger import all.zip --ledger new.sqlite").out
    for name in ("copy.sqlite", "new.sqlite"):
        assert run("ledger verify --ledger", name, "--head", sound["head"]).status == 0
    assert run("ledger import all.zip --ledger new.sqlite").status == 2
    assert run("ledger backup copy.sqlite --ledger", lab).status == 2
    assert run("ledger", "backup", lab, "--ledger", lab).status == 2


def test_a_silent_witness_proves_nothing(run, lab, tmp_path):
    """A ledger that nobody touched: sound, and not proven as long as a witness that was named cannot be read."""
    share = tmp_path / "share"
    share.mkdir()
    assert run("ledger witness share --ledger", lab).status == 0
    assert run("ledger verify --ledger", lab).status == 0
    (file,) = share.iterdir()
    file.unlink()
    file.mkdir()
    found = run("ledger verify --ledger", lab)
    assert found.status == 1
    assert "[key-witness-silent]" in found.err
    assert "are sound by what the ledger itself says" in found.out
    assert "not proven: a witness did not answer" in found.out
    assert "changed behind its back" not in found.out
    content = run("ledger verify --ledger", lab, "--json")
    assert (content.status, content.json["ok"], content.json["proven"]) == (1, True, False)
    listed = run("ledger witness --ledger", lab)
    assert (listed.status, "[key-witness-silent]" in listed.err) == (1, True)
    run("ledger witness share --remove --ledger", lab)
    assert run("ledger verify --ledger", lab).status == 0


def test_a_calibration_of_a_day_to_come_is_not_entered(run, lab):
    told = ("--serial", "A", "--rig", "r", "--rig-sd-deg", "0.1", "--ledger", lab)
    run("ledger enter tool.json --performed 2999-01-01", *told).refused("[input-value]")
    assert run("ledger verify --ledger", lab, "--json").json["records"] == 0


def test_verify_tells_by_its_status(run, lab, monkeypatch):
    """0 sound, 1 changed, 2 cannot be read."""
    monkeypatch.setenv("INCLINOMETRY_PASSWORD", PASSWORD)
    run("ledger users anna --role administrator --ledger", lab)
    assert run("ledger verify --ledger", lab).status == 0
    with sqlite3.connect(lab) as raw:
        raw.execute("DROP TRIGGER user_update")
        raw.execute("UPDATE user SET body = replace(body, 'administrator', 'operator')")
    raw.close()
    changed = run("ledger verify --ledger", lab)
    assert changed.status == 1
    assert "user 1 " in changed.err
    assert "[ledger-changed]" in changed.err
    run("ledger users --ledger", lab).refused("[ledger-changed]")
    Path("garbage").write_text("garbage" * 500)
    assert run("ledger verify --ledger garbage").status == 2
    assert run("ledger verify --ledger none.sqlite").status == 2
    assert run("ledger verify --ledger", lab, "--head", "7").status == 2


def test_users_without_a_terminal(run, lab, monkeypatch):
    """The password from the environment; changes keep it; the author is the account on this computer."""
    monkeypatch.delenv("INCLINOMETRY_PASSWORD", raising=False)
    run("ledger users anna --role administrator --ledger", lab).refused("INCLINOMETRY_PASSWORD")
    monkeypatch.setenv("INCLINOMETRY_PASSWORD", PASSWORD)
    for arguments in (("anna", "--role", "administrator", "--full-name", "Anna Berg"), ("boris", "--role", "operator")):
        assert run("ledger", "users", *arguments, "--ledger", lab).status == 0
    monkeypatch.setenv("INCLINOMETRY_PASSWORD", "short")
    assert run("ledger users boris --password --ledger", lab).status == 2
    assert run("ledger users boris --disable --ledger", lab).status == 0
    last = run("ledger users anna --disable --ledger", lab)
    assert "[key-last-administrator]" in last.err
    listed = run("ledger users --ledger", lab, "--json").json
    assert [(user["name"], user["role"], user["active"]) for user in listed] == [
        ("anna", "administrator", True),
        ("boris", "operator", False),
    ]
    with Ledger(lab) as ledger:
        assert check_password(ledger, "anna", PASSWORD) is not None
        assert check_password(ledger, "boris", PASSWORD) is None
        assert {record.author for record in ledger.find("user")} == {getpass.getuser()}
        assert [record.body["active"] for record in ledger.find("user", name="boris")] == [True, False]
        assert PASSWORD not in str(ledger.find("user"))


def test_a_password_is_changed_by_its_user(run, lab, monkeypatch):
    """With the current one; the new one by the rules; the event names the user."""
    monkeypatch.setenv("INCLINOMETRY_PASSWORD", PASSWORD)
    run("ledger users anna --role operator --ledger", lab)
    for current, new, problem in (
        ("a wrong pass phrase", "quiet granite harbour lamp", "[key-password-wrong]"),
        (PASSWORD, "anna anna anna anna", "[key-password-weak]"),
        (PASSWORD, "short", "[input-value]"),
    ):
        monkeypatch.setenv("INCLINOMETRY_PASSWORD", current)
        monkeypatch.setenv("INCLINOMETRY_NEW_PASSWORD", new)
        refused = run("ledger password anna --ledger", lab)
        assert (refused.status, problem in refused.err, new in refused.err) == (2, True, False)
    monkeypatch.setenv("INCLINOMETRY_NEW_PASSWORD", "quiet granite harbour lamp")
    assert run("ledger password anna --ledger", lab).status == 0
    run("ledger users anna --remove-second-factor --ledger", lab).refused("[ledger-not-there]")
    with Ledger(lab) as ledger:
        assert check_password(ledger, "anna", PASSWORD) is None
        assert check_password(ledger, "anna", "quiet granite harbour lamp") is not None
        (event,) = ledger.find("event", subject="anna")
        assert (event.keys["action"], event.author) == ("password changed", "anna")


def test_a_corrected_clock_is_recorded_with_its_reason(run, lab):
    """By whom, too."""
    assert run("ledger", "init", lab, "--clock", "the battery was empty").status == 0
    with Ledger(lab) as ledger:
        (event,) = ledger.find("event", subject="clock")
    assert event.body["reason"] == "the battery was empty"
    assert event.author == getpass.getuser()


def test_a_password_in_an_address_is_not_printed(run):
    """Nobody answers there."""
    refused = run("ledger verify --ledger postgresql://anna:secret@127.0.0.1:1/lab")
    assert refused.status == 2
    assert "secret" not in refused.out + refused.err
    assert "[ledger-server]" in refused.err


def test_an_import_that_fails_leaves_no_ledger(run, tmp_path):
    """Nor does it remove one that was there."""
    Path("garbage.zip").write_bytes(b"garbage")
    assert run("ledger import garbage.zip --ledger new.sqlite").status == 2
    assert not list(tmp_path.glob("new.sqlite*"))
    assert run("ledger init old.sqlite").status == 0
    assert run("ledger import garbage.zip --ledger old.sqlite").status == 2
    assert Path("old.sqlite").exists()


def test_a_certificate_that_is_not_there(run, lab):
    """One sentence; and a head has no meaning for one certificate."""
    run("ledger verify --certificate 2026-0001 --ledger", lab).refused("[ledger-not-there]")
    assert run("ledger verify --certificate 1 --head x --ledger", lab).status == 2


def test_a_witness_that_is_gone_is_named(run, keys, tmp_path):
    """By `ledger witness` and `ledger verify`, with exit status 1; to give it the head of now mends it."""
    (tmp_path / "share").mkdir()
    assert run("ledger witness share --ledger own.sqlite").status == 0
    (kept,) = (tmp_path / "share").iterdir()
    kept.unlink()
    for command in (("witness",), ("verify",)):
        done = run("ledger", *command, "--ledger", "own.sqlite")
        assert done.status == 1
        assert "[key-witness-lost]" in done.out + done.err
    assert run("ledger witness share --ledger own.sqlite").status == 0
    assert run("ledger verify --ledger own.sqlite").status == 0
    (keys / "heads" / kept.name).unlink()
    assert run("ledger verify --ledger own.sqlite").status == 1
    assert run("ledger init own.sqlite --accept", "the keys came without it").status == 0
    assert run("ledger verify --ledger own.sqlite").status == 0


def test_a_lost_key_is_no_change_behind_the_back(run, keys):
    """Before and after the next record: a note of the break, exit status 0."""
    (keys / "key.pem").unlink()
    assert run("ledger key --lost", "laptop stolen").status == 0
    for _ in range(2):
        found = run("ledger verify --ledger own.sqlite").ok()
        assert "[key-break]" in found.err
        assert "laptop stolen" in found.err
        assert "behind its back" not in found.out
        assert run("ledger users anna --role administrator --ledger own.sqlite").status == 0


def test_the_ledger_of_another_laboratory_is_verified_by_its_key(run, tmp_path, monkeypatch):
    """By the key of this computer it is not proven, and the sentence says by which; without any it is compared."""
    for name in ("theirs", "ours"):
        monkeypatch.setenv("INCLINOMETRY_KEYS", str(tmp_path / name))
        assert run("ledger", "init", f"{name}.sqlite").status == 0
        assert run("ledger key --public", f"{name}.pem").status == 0
    found = run("ledger verify --ledger theirs.sqlite")
    assert found.status == 1
    assert "[key-not-here]" in found.err
    assert "behind its back" not in found.out
    assert run("ledger verify --ledger theirs.sqlite --key theirs.pem").status == 0
    assert run("ledger verify --ledger theirs.sqlite --key ours.pem").status == 1
    monkeypatch.setenv("INCLINOMETRY_KEYS", str(tmp_path / "none"))
    found = run("ledger verify --ledger theirs.sqlite")
    assert (found.status, "compare it with the laboratory's" in found.err) == (0, True)


def test_a_ledger_without_signatures_is_not_proven(run, tmp_path, monkeypatch):
    """Nothing is said of it where nobody knows it; whoever gives the laboratory's key is told that it is not signed."""
    monkeypatch.setenv("INCLINOMETRY_PASSWORD", PASSWORD)
    assert run("ledger init own.sqlite").status == 0
    run("ledger users anna --role administrator --ledger own.sqlite")
    assert run("ledger key --public own.pem").status == 0
    strip("own.sqlite", "other.sqlite")
    monkeypatch.setenv("INCLINOMETRY_KEYS", str(tmp_path / "none"))
    plain = run("ledger verify --ledger other.sqlite --json")
    assert (plain.status, plain.json["ok"], plain.json["proven"]) == (0, True, False)
    assert "sound by what the ledger itself says" in run("ledger verify --ledger other.sqlite").out
    found = run("ledger verify --ledger other.sqlite --key own.pem")
    assert found.status == 1
    assert "[ledger-signatures-removed]" in found.err


def strip(source: str, target: str) -> None:
    """A copy of a ledger without its signed heads."""
    with sqlite3.connect(source) as raw, sqlite3.connect(target) as copy:
        raw.backup(copy)
        (made,) = copy.execute("SELECT sql FROM sqlite_master WHERE name = 'head_delete'").fetchone()
        for statement in ("DROP TRIGGER head_delete", "DELETE FROM head", made):
            copy.execute(statement)
    raw.close()
    copy.close()


def test_junk_in_the_folder_of_the_keys_is_named(run, keys):
    """File, line and remedy, exit status 2, no traceback; the remedy mends it."""
    public, changes = keys / "public.pem", keys / "changes.jsonl"
    public.write_bytes(b"\0junk")
    for command in (("verify", "--ledger", "own.sqlite"), ("key",), ("witness", "--ledger", "own.sqlite")):
        found = run("ledger", *command)
        assert found.status == 2, command
        assert str(public) in "".join(found.err.split())
        assert "[key-damaged]" in found.err
    assert run("ledger key --make").status == 0
    changes.write_text("junk\n")
    for command in (("verify", "--ledger", "own.sqlite"), ("key",), ("head", "--ledger", "own.sqlite")):
        found = run("ledger", *command)
        assert found.status == 2, command
        assert f"{changes}, line 1: " in " ".join(found.err.split())
        assert "[key-damaged]" in found.err
    changes.unlink()
    assert run("ledger verify --ledger own.sqlite").status == 0


def test_a_witness_that_is_dropped_from_the_list_is_missed(run, keys, tmp_path, monkeypatch):
    """The list lies beside the key, unsigned; that a witness was named, and removed, stands in the ledger."""
    own = ("--ledger", "own.sqlite")
    for name in ("share", "other"):
        (tmp_path / name).mkdir()
        assert run("ledger", "witness", name, *own).status == 0
        assert run("ledger", "witness", name, *own).status == 0
    with Ledger("own.sqlite", read_only=True) as ledger:
        named = ledger.find("event", subject_kind="ledger", subject="witness", action="named")
        signed = ledger.signed_head()
    assert signed is not None
    assert [one.body["details"] for one in named] == [
        {"place": str(tmp_path / name), "ledger": signed.ledger} for name in ("share", "other")
    ]
    for name in ("share", "other"):  # both know of all of it
        (kept,) = (tmp_path / name).iterdir()
        assert '"size":2' in kept.read_text().splitlines()[-1]
    listed = keys / "witnesses.txt"
    listed.write_text(f"{tmp_path / 'other'}\n")
    found = run("ledger", "verify", *own)
    assert found.status == 1
    assert "[key-witness-unlisted]" in found.err
    # by somebody who has no key: a note
    (tmp_path / "reader").mkdir()
    (tmp_path / "reader" / "public.pem").write_bytes((keys / "public.pem").read_bytes())
    monkeypatch.setenv("INCLINOMETRY_KEYS", str(tmp_path / "reader"))
    found = run("ledger", "verify", *own)
    assert (found.status, "[key-witness-unlisted]" in found.err) == (0, True)
    monkeypatch.setenv("INCLINOMETRY_KEYS", str(keys))
    # named again, or taken off: both mend it
    assert run("ledger witness share", *own).status == 0
    assert run("ledger", "verify", *own).status == 0
    listed.unlink()
    for name in ("share", "other"):
        assert run("ledger", "witness", name, "--remove", *own).status == 0
    assert run("ledger", "verify", *own).status == 0
    assert run("ledger witness share --remove", *own).status == 2
    # what was listed before there were such records is recorded by `init`
    listed.write_text(f"{tmp_path / 'share'}\n")
    run("ledger init own.sqlite").ok()
    listed.unlink()
    assert run("ledger", "verify", *own).status == 1


def test_a_password_of_a_witness_is_not_recorded(run, keys):
    """A ledger in a database as a witness: its place without the password."""
    from inclinometry.laboratory.ledger.verify import verify
    from inclinometry.laboratory.ledger.witness import name_others

    place = "postgresql://anna:secret@127.0.0.1:9/lab"
    with Ledger("own.sqlite") as ledger:
        ledger.record_witness(place, "named", author="anna")
        (event,) = ledger.find("event", subject="witness")
        assert "secret" not in str(event.body)
        assert "key-witness-unlisted" in coded(verify(ledger).faults)
        name_others(keys, [place])
        assert verify(ledger).ok


def test_a_public_key_of_somebody_else_is_never_handed_out(run, keys, tmp_path, monkeypatch):
    """`verify` names it and ends with 1, `key` and `key --public` refuse; an encrypted key is not compared."""
    from inclinometry.laboratory.ledger.keys import PASSPHRASE, Keys

    sound = run("ledger verify --ledger own.sqlite --json").json
    assert (sound["proven"], sound["compared"]) == (True, True)
    assert run("ledger key --json").json["compared"] is True
    right = (keys / "public.pem").read_bytes()
    Keys(tmp_path / "forger").make()
    forged = (tmp_path / "forger" / "public.pem").read_bytes()
    (keys / "public.pem").write_bytes(forged)
    found = run("ledger verify --ledger own.sqlite --json")
    assert (found.status, found.json["ok"], found.json["proven"]) == (1, False, False)
    assert [fault["code"] for fault in found.json["faults"]] == ["key-public-other"]
    for words in (
        ("key",),
        ("key", "--json"),
        ("key", "--make"),
        ("key", "--public", "out.pem"),
        ("key", "--rotate", "every year"),
        ("head", "--ledger", "own.sqlite", "-o", "head.json"),
        ("status", "--ledger", "own.sqlite", "-o", "status.json"),
        ("witness", "--ledger", "own.sqlite"),
        ("init", "own.sqlite", "--accept", "the computer was exchanged"),
    ):
        found = run("ledger", *words)
        assert found.status == 2, words
        assert "[key-public-other]" in found.err
    assert not any((tmp_path / name).exists() for name in ("out.pem", "head.json", "status.json"))
    # encrypted, by the laboratory with the right public key; the same with the forger's, which cannot be known
    (keys / "public.pem").write_bytes(right)
    monkeypatch.setenv("INCLINOMETRY_NEW_PASSPHRASE", "correct horse")
    assert run("ledger key --passphrase").status == 0
    for public in (right, forged):
        monkeypatch.delenv(PASSPHRASE, raising=False)
        (keys / "public.pem").write_bytes(public)
        assert "[key-uncompared]" in run("ledger", "key").err
        assert run("ledger key --json").json["compared"] is False
        assert run("ledger verify --ledger own.sqlite --json").json["compared"] is False
        assert run("ledger key --public out.pem").status == 2
        assert not (tmp_path / "out.pem").exists()
        monkeypatch.setenv(PASSPHRASE, "correct horse")
        assert run("ledger key --public out.pem").status == (0 if public == right else 2)
        (tmp_path / "out.pem").unlink(missing_ok=True)
    # where there is no private key the public one is handed on as it is
    (keys / "key.pem").unlink()
    found = run("ledger key --public out.pem --json")
    assert (found.status, found.json["compared"]) == (0, None)


def test_a_certificate_that_the_key_did_not_make_is_named_when_it_is_published(run, tmp_path, monkeypatch):
    """An authority's, or a forger's who can write to the folder: whoever publishes it is told whose it is."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    folder = tmp_path / "keys"
    monkeypatch.setenv("INCLINOMETRY_KEYS", str(folder))
    run("ledger key --make")
    assert run("ledger key --public own.pem").err == ""
    private, name = ec.generate_private_key(ec.SECP256R1()), x509.Name.from_rfc4514_string("CN=Stand and Son")
    day = datetime(2026, 1, 1)
    made = x509.CertificateBuilder().subject_name(name).issuer_name(name).public_key(private.public_key())
    made = made.serial_number(7).not_valid_before(day).not_valid_after(day.replace(year=2090))
    signed = made.sign(private, hashes.SHA256())
    pem = private.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    (folder / "document.pem").write_bytes(pem + signed.public_bytes(serialization.Encoding.PEM))
    said = run("ledger key --public out.pem").err.replace("\n", " ")
    assert "did not make the certificate in document.pem: CN=Stand and Son" in said
    assert signed.fingerprint(hashes.SHA256()).hex()[:16] in said
