"""Files that were edited, cut, swapped or closed off: every fault is named, every refusal is a sentence."""

from __future__ import annotations

import json
import os
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import uuid
from pathlib import Path
from typing import Any

import pytest

from inclinometry.laboratory.ledger import chain
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.exchange import export
from inclinometry.laboratory.ledger.ledger import Draft, Ledger, LedgerError
from inclinometry.laboratory.ledger.verify import verify

TOOL = {"name": "steering tool", "triads": {}}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A ledger of forty tools, a document and a certificate that refers to it."""
    where = tmp_path / "a.sqlite"
    with create(where) as ledger:
        drafts = [Draft("tool", {"serial": f"T{n}"}, TOOL) for n in range(40)]
        ledger.append_all([*drafts, Draft("tool", {"serial": "D"}, TOOL, [("application/pdf", b"%PDF-")])], author="a")
        digest = "sha256:38523c087796e5d5dd1cf9bad1fb026781a838dd9dd2cf8af58b9f6502a46778"
        body = {"record": {}, "calibration": "c", "documents": {"pdf": digest}, "head": "0"}
        ledger.append("certificate", {"number": "1", "serial": "D"}, body, author="a")
    return where


def edit(path: Path, *statements: str) -> None:
    """Change the file as somebody with a database program would, the triggers put back after it."""
    with sqlite3.connect(path) as raw:
        raw.execute("PRAGMA writable_schema = ON")
        triggers = raw.execute("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'").fetchall()
        for name, _ in triggers:
            raw.execute(f'DROP TRIGGER "{name}"')
        for statement in statements:
            raw.execute(statement)
        for _, text in triggers:
            raw.execute(text)
    raw.close()


def faults(path: Path, head: chain.Head | None = None) -> list[str]:
    """What a verification says."""
    with Ledger(path) as ledger:
        return [str(fault) for fault in verify(ledger, head=head).faults]


@pytest.mark.parametrize(
    ("statement", "named"),
    [
        ("UPDATE tool SET body = x'ff00' WHERE seq = 5", "tool 5 "),
        ("UPDATE tool SET body = CAST(x'c328' AS TEXT) WHERE seq = 5", "tool 5 "),
        ("UPDATE tool SET body = '' WHERE seq = 5", "tool 5 "),
        ("UPDATE tool SET version = 'one' WHERE seq = 5", "tool 5 "),
        ("UPDATE tool SET created = '2020-01-01T00:00:00.000000+00:00' WHERE seq = 5", "tool 5 "),
        ("UPDATE tool SET id = 'x' WHERE seq = 5", "tool 5 "),
        ("UPDATE chain SET link = x'00' WHERE seq = 5", "chain 5 "),
        ("UPDATE chain SET kind = 'rig' WHERE seq = 5", "rig 5 "),
        ("UPDATE chain SET kind = 'nothing' WHERE seq = 5", "nothing 5 "),
        ("UPDATE chain SET seq = 9000000000000000000 WHERE seq = 41", "chain 43 to 8999999999999999999"),
        ("UPDATE chain SET seq = -7 WHERE seq = 41", "chain -7 "),
        ("UPDATE chain SET seq = 0 WHERE seq = 41", "chain 0 "),
        ("INSERT INTO rig SELECT seq, id, created, author, version, 'r', body FROM tool WHERE seq = 5", "rig 5 "),
        ("UPDATE document SET data = x'00'", "document sha256:"),
        ("DELETE FROM document", "document sha256:"),
        ("UPDATE document SET media_type = 'text/html'", "document sha256:"),
        ("CREATE TRIGGER evil AFTER INSERT ON tool BEGIN DELETE FROM tool; END", "trigger evil"),
    ],
)
def test_an_edited_row_is_named(path: Path, statement: str, named: str) -> None:
    """With the triggers back in their place."""
    edit(path, statement)
    found = faults(path)
    assert any(fault.startswith(named) for fault in found), found


@pytest.mark.parametrize(
    ("statement", "named"),
    [
        ("UPDATE document SET data = 'text'", "sha256:38523c"),
        ("UPDATE document SET data = 5", "sha256:38523c"),
        ("UPDATE document SET data = 9223372036854775807", "sha256:38523c"),
        ("INSERT INTO document VALUES ('aaaa', 'text/plain', 'junk')", "aaaa"),
        ("INSERT INTO document VALUES (x'ff', 'text/plain', 2.5)", "b'\\xff'"),
    ],
)
def test_what_is_no_bytes_is_no_document(path: Path, tmp_path: Path, statement: str, named: str) -> None:
    """SQLite keeps a text or a number in their place: named beside all other faults, and never handed out."""
    edit(path, statement, "UPDATE tool SET author = 'eve' WHERE seq = 3")
    found = faults(path)
    assert [one for one in found if one.startswith(f"document {named}") and one.endswith("its bytes were changed")]
    assert [one for one in found if one.startswith("tool 3 ")]
    edit(path, "UPDATE tool SET author = 'a' WHERE seq = 3")
    with Ledger(path) as ledger:
        with pytest.raises(LedgerError, match="was changed; run `inclinometry ledger verify`"):
            export(ledger, tmp_path / "all.zip")
        if "UPDATE" in statement:
            with pytest.raises(LedgerError, match="was changed; run `inclinometry ledger verify`"):
                ledger.document("sha256:38523c087796e5d5dd1cf9bad1fb026781a838dd9dd2cf8af58b9f6502a46778")
    assert not (tmp_path / "all.zip").exists()


def test_a_changed_record_is_not_used(path: Path) -> None:
    """Reading it is refused, so that nothing is computed or certified from it; the others are read."""
    edit(path, "UPDATE tool SET body = replace(body, 'steering', 'other') WHERE serial = 'T3'")
    with Ledger(path) as ledger:
        with pytest.raises(LedgerError, match=r"tool 4 .* was changed behind the back .* ledger verify"):
            ledger.latest("tool", serial="T3")
        assert ledger.latest("tool", serial="T4") is not None


def test_a_rewritten_ledger_is_noticed(path: Path) -> None:
    """Somebody changed a record and recomputed every later link: sound in itself, but not what was signed or noted."""
    with Ledger(path) as ledger:
        head = ledger.head()
    rows, previous = [], chain.GENESIS
    with sqlite3.connect(path) as raw:
        for seq, kind, name, created, digest in raw.execute("SELECT seq, kind, record, created, digest FROM chain"):
            if seq == 5:
                author, serial, body = raw.execute("SELECT author, serial, body FROM tool WHERE seq = 5").fetchone()
                body = body.replace("steering", "other")
                digest = chain.record_digest(kind, name, created, author, 1, {"serial": serial}, body)
                rows.append(f"UPDATE tool SET body = '{body}' WHERE seq = 5")
            previous = chain.next_link(previous, seq, kind, name, created, digest)
            rows.append(f"UPDATE chain SET digest = '{digest}', link = '{previous}' WHERE seq = {seq}")
    raw.close()
    edit(path, *rows)
    assert any("not those that were signed" in fault for fault in faults(path))
    assert any("is not the head noted earlier" in fault for fault in faults(path, head))


def test_a_trigger_that_does_nothing_is_no_protection(path: Path) -> None:
    """The name is right, what it does is not."""
    with sqlite3.connect(path) as raw:
        raw.execute("DROP TRIGGER chain_delete")
        raw.execute("CREATE TRIGGER chain_delete BEFORE DELETE ON chain BEGIN SELECT 1; END")
    raw.close()
    assert faults(path) == ["chain -: the triggers that forbid changes are missing"]


def test_a_file_cut_or_overwritten_is_refused_or_named(path: Path, tmp_path: Path) -> None:
    """Never an exception of another kind, never sound."""
    whole = path.read_bytes()
    damaged = [whole[:size] for size in (0, 50, 1000, 4096, 20_000, len(whole) // 2, len(whole) - 100)]
    starts = range(4096, len(whole) - 4096, len(whole) // 12)
    damaged += [whole[:start] + b"\xa5" * 4096 + whole[start + 4096 :] for start in starts]
    for turn, data in enumerate(damaged):
        broken = tmp_path / f"broken{turn}.sqlite"
        broken.write_bytes(data)
        said = told(broken)
        assert said, turn
        assert any(word in said for word in ("damaged", "not a ledger", "changed", "missing", "file -:")), said


def told(path: Path) -> str:
    """Faults, or the sentence of the refusal."""
    try:
        return "; ".join(faults(path))
    except LedgerError as error:
        return str(error)


def test_what_is_not_a_file_is_said_so(tmp_path: Path) -> None:
    """Folder, pipe, device, impossible names; a link is followed."""
    os.mkfifo(tmp_path / "pipe")
    for make in (Ledger, create):
        with pytest.raises(LedgerError, match="folder"):
            make(tmp_path)
        with pytest.raises(LedgerError, match="device or pipe"):
            make(tmp_path / "pipe")
        with pytest.raises(LedgerError, match="device or pipe"):
            make("/dev/null")
        with pytest.raises(LedgerError, match=r"path of a ledger|cannot be made"):
            make("a\0b")
        with pytest.raises(LedgerError):
            make(tmp_path / ("x" * 300))
    strange = tmp_path / "what? 100% #1 é.sqlite"
    create(strange).close()
    assert strange.is_file()
    (tmp_path / "link.sqlite").symlink_to(strange)
    with Ledger(tmp_path / "link.sqlite") as ledger:
        ledger.append("tool", {"serial": "A"}, TOOL, author="a")
    with Ledger(strange) as ledger:
        assert ledger.count("tool") == 1


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can be somebody else")
def test_a_folder_and_a_file_that_cannot_be_written(path: Path) -> None:
    """Somebody who may only read reads and verifies; recording is refused with a sentence."""
    with tempfile.TemporaryDirectory() as name:  # pytest's folder is closed to others
        Path(name).chmod(0o755)
        open_to_all = Path(name) / "a.sqlite"
        shutil.copy(path, open_to_all)
        open_to_all.chmod(0o644)
        sound, said = as_nobody(open_to_all)
        with Ledger(open_to_all) as ledger:
            assert ledger.count("tool") == 41
    assert sound
    assert "permissions" in said


def as_nobody(path: Path) -> list[Any]:
    """Whether the ledger is sound to somebody without rights, and what recording says to them."""
    code = (
        "import json, os, sys\n"
        "from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError\n"
        "from inclinometry.laboratory.ledger.verify import verify\n"
        "os.setgid(65534); os.setuid(65534)\n"
        "said = []\n"
        "with Ledger(sys.argv[1], read_only=True) as ledger:\n"
        "    said.append(verify(ledger).ok)\n"
        "try:\n"
        "    with Ledger(sys.argv[1]) as ledger:\n"
        "        ledger.append('tool', {'serial': 'A'}, {'name': 'a', 'triads': {}}, author='a')\n"
        "except LedgerError as error:\n"
        "    said.append(str(error))\n"
        "print(json.dumps(said))\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(path)], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found: list[Any] = json.loads(done.stdout)
    return found


def test_a_clock_that_was_in_the_future_can_be_corrected(path: Path) -> None:
    """By an event that says why; afterwards records follow with the time of now."""
    from datetime import UTC, datetime, timedelta

    future = Ledger(path, clock=lambda: datetime.now(UTC) + timedelta(days=3650))
    future.append("tool", {"serial": "F"}, TOOL, author="a")
    future.close()
    with Ledger(path) as ledger:
        with pytest.raises(LedgerError, match=r"ledger init --clock REASON"):
            ledger.append("tool", {"serial": "A"}, TOOL, author="a")
        ledger.correct_clock("the battery was empty", author="anna")
        ledger.append("tool", {"serial": "A"}, TOOL, author="a")
        assert ledger.latest("event", subject="clock").body == {"reason": "the battery was empty"}  # type: ignore[union-attr]
        assert verify(ledger).ok
    edit(path, "UPDATE chain SET created = 'yesterday' WHERE seq = (SELECT max(seq) FROM chain)")
    with Ledger(path) as ledger, pytest.raises(LedgerError, match="time of the last record was changed"):
        ledger.append("tool", {"serial": uuid.uuid4().hex}, TOOL, author="a")
