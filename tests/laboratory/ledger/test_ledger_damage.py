"""Files that were edited, cut, swapped or closed off: every fault is named, every refusal is a sentence."""

from __future__ import annotations

import json
import os
import re
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import uuid
import zipfile
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from benchmarks.postgresql import Server
from tests.refusals import fits, refused

from inclinometry.errors import FileError
from inclinometry.laboratory.ledger import chain
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.engine import engine, shown
from inclinometry.laboratory.ledger.exchange import export, restore
from inclinometry.laboratory.ledger.ledger import Draft, Ledger, LedgerError
from inclinometry.laboratory.ledger.verify import verify

from .conftest import TOOL, add, edit


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


def faults(path: Path, head: chain.Head | None = None) -> list[str]:
    """What a verification says: kind, place, code."""
    with Ledger(path) as ledger:
        found = verify(ledger, head=head).faults
    return [f"{one.values.get('kind', '-')} {one.values.get('record', '-')} {one.code}" for one in found]


@pytest.mark.parametrize(
    ("statement", "named"),
    [
        ("UPDATE tool SET body = x'ff00' WHERE seq = 5", "tool 5 "),
        ("UPDATE tool SET body = CAST(x'c328' AS TEXT) WHERE seq = 5", "tool 5 "),
        ("UPDATE tool SET body = '' WHERE seq = 5", "tool 5 "),
        ("UPDATE tool SET version = 'one' WHERE seq = 5", "tool 5 "),
        ("UPDATE tool SET created = '2020-01-01T00:00:00.000000+00:00' WHERE seq = 5", "tool 5 "),
        ("UPDATE tool SET id = 'x' WHERE seq = 5", "tool 5 "),
        ("UPDATE tool SET author = 'eve' WHERE seq = 5", "tool 5 .*changed"),
        ("UPDATE chain SET digest = 'x' WHERE seq = 5", "chain 5 .*changed"),
        ("DELETE FROM tool WHERE seq = 5", "tool 5 .*removed"),
        ("DELETE FROM certificate; DELETE FROM chain WHERE seq = 42", "chain 42 ledger-removed"),
        ("INSERT INTO tool SELECT 99, 'new', created, author, version, serial, body FROM tool WHERE seq = 5",
         "tool 99 .*inserted"),
        ("UPDATE tool SET seq = -1 WHERE seq = 5; UPDATE tool SET seq = 5 WHERE seq = 6; "
         "UPDATE tool SET seq = 6 WHERE seq = -1", "tool 5 .*changed"),
        ("UPDATE chain SET link = x'00' WHERE seq = 5", "chain 5 "),
        ("UPDATE chain SET kind = 'rig' WHERE seq = 5", "rig 5 "),
        ("UPDATE chain SET kind = 'nothing' WHERE seq = 5", "chain 5 "),
        ("UPDATE chain SET seq = 9000000000000000000 WHERE seq = 41", "chain 43 .. 8999999999999999999"),
        ("UPDATE chain SET seq = -7 WHERE seq = 41", "chain -7 "),
        ("UPDATE chain SET seq = 0 WHERE seq = 41", "chain 0 "),
        ("INSERT INTO rig SELECT seq, id, created, author, version, 'r', body FROM tool WHERE seq = 5", "rig 5 "),
        ("UPDATE document SET data = x'00'", "document sha256:"),
        ("DELETE FROM document", "document sha256:"),
        ("UPDATE document SET media_type = 'text/html'", "document sha256:"),
    ],
)  # fmt: skip
def test_an_edited_row_is_named(path: Path, statement: str, named: str) -> None:
    """With the triggers back in their place."""
    with Ledger(path) as ledger:
        head = ledger.head()
    edit(path, *statement.split("; "))
    found = faults(path, head)
    assert any(re.match(named, fault) for fault in found), found


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
    assert [one for one in found if one.startswith(f"document {named}") and one.endswith("ledger-changed")]
    assert [one for one in found if one.startswith("tool 3 ")]
    edit(path, "UPDATE tool SET author = 'a' WHERE seq = 3")
    with Ledger(path) as ledger:
        with refused("ledger-changed", error=LedgerError, kind="document"):
            export(ledger, tmp_path / "all.zip")
        if "UPDATE" in statement:
            with refused("ledger-changed", error=LedgerError, kind="document"):
                ledger.document("sha256:38523c087796e5d5dd1cf9bad1fb026781a838dd9dd2cf8af58b9f6502a46778")
    assert not (tmp_path / "all.zip").exists()


def test_an_export_counts_by_the_chain(path: Path, tmp_path: Path) -> None:
    """A row whose number alone was changed is exported at its place, and the export is read again."""
    edit(path, "UPDATE certificate SET seq = 99")
    with Ledger(path) as ledger, create(tmp_path / "copy.sqlite", sign=False) as copy:
        assert export(ledger, tmp_path / "all.zip") == ledger.head() == restore(copy, tmp_path / "all.zip")


def test_a_changed_record_is_not_used(path: Path) -> None:
    """Reading it is refused, so that nothing is computed or certified from it; the others are read."""
    edit(path, "UPDATE tool SET body = replace(body, 'steering', 'other') WHERE serial = 'T3'")
    with Ledger(path) as ledger:
        with refused("ledger-changed", error=LedgerError):
            ledger.latest("tool", serial="T3")
        assert ledger.latest("tool", serial="T4") is not None


@pytest.mark.parametrize(
    ("statements", "named"),
    [
        (["DROP TRIGGER chain_delete"], "chain"),
        (["DROP TRIGGER chain_delete", "CREATE TRIGGER chain_delete BEFORE DELETE ON chain BEGIN SELECT 1; END"],
         "chain"),
        (["CREATE TRIGGER evil AFTER INSERT ON tool BEGIN DELETE FROM tool; END"],
         "evil"),
    ],
)  # fmt: skip
def test_a_trigger_that_is_not_the_programs_is_named(path: Path, statements: list[str], named: str) -> None:
    """Gone; of the right name, and does nothing; another one."""
    with closing(sqlite3.connect(path)) as raw, raw:
        for statement in statements:
            raw.execute(statement)
    with Ledger(path) as ledger:
        (found,) = verify(ledger).faults
    assert fits(found, ["ledger-unprotected"], {"names": (named,)})


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
        assert any(code in said for code in ("damaged", "absent", "changed", "removed", "unprotected")), said


def told(path: Path) -> str:
    """Codes of the faults, or of the refusal."""
    try:
        return "; ".join(faults(path))
    except LedgerError as error:
        return error.finding.code if error.finding else ""


def test_what_is_not_a_file_is_said_so(tmp_path: Path) -> None:
    """Folder, pipe, device, impossible names; a link is followed."""
    os.mkfifo(tmp_path / "pipe")
    for make in (Ledger, create):
        with refused("ledger-access", error=LedgerError):
            make(tmp_path)
        with refused("ledger-access", error=LedgerError):
            make(tmp_path / "pipe")
        with refused("ledger-access", error=LedgerError):
            make("/dev/null")
        with refused("ledger-access", error=LedgerError):
            make("a\0b")
        with pytest.raises(LedgerError):
            make(tmp_path / ("x" * 300))
    strange = tmp_path / "what? 100% #1 é.sqlite"
    create(strange).close()
    assert strange.is_file()
    (tmp_path / "link.sqlite").symlink_to(strange)
    with Ledger(tmp_path / "link.sqlite") as ledger:
        add(ledger, "A")
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
        scratch = Path(shutil.copy(path, Path(name) / "scratch.sqlite"))
        sound, said = as_nobody(open_to_all, scratch)
        with Ledger(open_to_all) as ledger:
            assert ledger.count("tool") == 41
    assert sound
    assert said == "ledger-access"


AS_NOBODY = """
import json, os, sys
from inclinometry.findings import codes
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError
from inclinometry.laboratory.ledger.verify import verify

def tried(path):
    with Ledger(path, read_only=True) as ledger:
        sound = verify(ledger).ok
    try:
        with Ledger(path) as ledger:
            ledger.append("tool", {"serial": "A"}, {"name": "a", "triads": {}}, author="a")
    except LedgerError as error:
        return sound, error.finding.code
    return sound, ""

codes()
tried(sys.argv[2])  # what is read and imported on the way may lie in a folder that is closed to others
os.setgid(65534)
os.setuid(65534)
print(json.dumps(tried(sys.argv[1])))
"""


def as_nobody(path: Path, scratch: Path) -> list[Any]:
    """Whether the ledger is sound to somebody without rights, and what recording says to them; `scratch` is a copy."""
    command = [sys.executable, "-c", AS_NOBODY, str(path), str(scratch)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found: list[Any] = json.loads(done.stdout)
    return found


def test_a_clock_that_was_in_the_future_can_be_corrected(path: Path) -> None:
    """By an event that says why; afterwards records follow with the time of now."""
    from datetime import UTC, datetime, timedelta

    future = Ledger(path, clock=lambda: datetime.now(UTC) + timedelta(days=3650))
    add(future, "F")
    future.close()
    with Ledger(path) as ledger:
        with refused("ledger-clock", error=LedgerError):
            add(ledger, "A")
        ledger.correct_clock("the battery was empty", author="anna")
        add(ledger, "A")
        assert ledger.latest("event", subject="clock").body == {"reason": "the battery was empty"}  # type: ignore[union-attr]
        assert verify(ledger).ok
    edit(path, "UPDATE chain SET created = 'yesterday' WHERE seq = (SELECT max(seq) FROM chain)")
    with Ledger(path) as ledger, refused("ledger-changed", error=LedgerError):
        ledger.append("tool", {"serial": uuid.uuid4().hex}, TOOL, author="a")


# Strange values, addresses and exports: the same clear answer on both engines, nothing recorded by halves.


INJECTIONS = (
    "'; DROP TABLE tool; --", '" OR 1=1 --', "%s %(x)s :y {z}", "<script>", "=cmd|' /C calc'!A0", "\\x00", "null",
)  # fmt: skip


def test_texts_are_kept_as_they_are(ledger: Ledger) -> None:
    """Statements, formulas, marks of placeholders, all scripts, control characters in bodies."""
    for text in (*INJECTIONS, "Ω 中文 ру́сский 🧭"):
        body = {**TOOL, "description": f"{text}\x00\x01\n\u2028"}
        made = ledger.append("tool", {"serial": text}, body, author=text)
        assert ledger.latest("tool", serial=text) == made == ledger.get("tool", made.id)
        assert ledger.count("tool", serial=text) == 1
    long = "é" * 9_000
    assert ledger.append("tool", {"serial": "L" * 200}, {**TOOL, "description": long}, author="a").body["name"]
    assert ledger.count("tool") == len(INJECTIONS) + 2 == len(ledger.current("tool"))
    assert verify(ledger).ok


def test_numbers_come_back_as_they_were(ledger: Ledger, tmp_path: Path) -> None:
    """Whole numbers of any size, minus zero, the smallest and greatest; keys in one order; through an export, too."""
    numbers = {"a": 2**53 + 1, "b": -(10**40), "c": -0.0, "d": 5e-324, "e": 1.7976931348623157e308, "f": 0.1, "0": 1e22}
    ledger.append("site", {"name": "s"}, {"u": numbers}, author="a")
    export(ledger, tmp_path / "all.zip")
    with create(tmp_path / "copy.sqlite") as copy:
        restore(copy, tmp_path / "all.zip")
        for one in (ledger, copy):
            found = one.latest("site", name="s").body["u"]  # type: ignore[union-attr]
            assert found == numbers
            assert str(found["c"]) == "-0.0"
            assert list(found) == sorted(numbers)
    assert chain.compact(numbers) == chain.compact(dict(reversed(numbers.items())))


@pytest.mark.parametrize("bad", ["a\0b", "a\ud800", "", " a", "a\n", "x" * 201, None, 7, b"a"])
def test_names_that_cannot_be_kept_are_refused_and_found_nowhere(ledger: Ledger, bad: Any) -> None:
    """As keys, authors and media types; asking for them finds nothing."""
    for attempt in (
        lambda: ledger.append("tool", {"serial": bad}, TOOL, author="a"),
        lambda: ledger.append("tool", {"serial": "A"}, TOOL, author=bad),
        lambda: ledger.append_all([Draft("tool", {"serial": "A"}, TOOL, [(bad, b"x")])], author="a"),
    ):
        with refused("ledger-text"):
            attempt()
    assert ledger.latest("tool", serial=bad) is None
    assert ledger.count("tool", serial=bad) == 0
    for read in (lambda: ledger.get("tool", bad), lambda: ledger.document(bad)):
        with pytest.raises(LedgerError, check=lambda error: error.finding.code == "ledger-not-there"):
            read()
    assert ledger.head().seq == 0


@pytest.mark.parametrize(
    "value",
    [float("nan"), float("inf"), "\ud800", b"bytes", object(), 10**5000, {1: 2, "a": 3}],
    ids=lambda v: type(v).__name__,
)
def test_content_that_json_cannot_hold_is_refused(ledger: Ledger, value: object) -> None:
    """One sentence, nothing recorded."""
    deep: Any = {}
    for _ in range(sys.getrecursionlimit() * 2):
        deep = {"d": deep}
    for content in (value, deep):
        with refused("input-field"):
            ledger.append("site", {"name": "s"}, {"u": {"x": content}}, author="a")
    assert ledger.head().seq == 0


@pytest.mark.parametrize("number", [2**31, 2**63, 10**400, -1, 1.0, True, "1"])
def test_whole_numbers_that_do_not_fit_are_refused_alike(ledger: Ledger, number: Any) -> None:
    """As a key; asked for, they find nothing; as places they are the first or the last."""
    body = {"dial_deg": [0.0, 0.0, 0.0], "channels": {"gyro": [1.0]}, "count": 1, "captured": "key"}
    with refused("input-value", name="reading.position"):
        ledger.append("reading", {"session": "s", "position": number, "attempt": 1}, body, author="a")
    assert ledger.find("reading", position=number) == []
    if type(number) is int:
        assert ledger.find("reading", after=number) == ledger.find("reading", limit=min(number, 0)) == []


def test_several_values_of_a_key_are_asked_for_at_once(ledger: Ledger) -> None:
    """One query instead of many."""
    ledger.append_all([Draft("tool", {"serial": f"T{n}"}, TOOL) for n in range(9)], author="a")
    found = ledger.find("tool", serial=["T7", "T1", "a\0b", "none"])
    assert [record.keys["serial"] for record in found] == ["T1", "T7"]
    assert ledger.find("tool", serial=[]) == []


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("postgresql://anna:secret@host", "ledger-address"),
        ("postgresql://anna:secret@host:port/lab", "ledger-address"),
        ("postgresql://anna:sec/ret@host/lab", "ledger-server"),
        ("mysql://anna:secret@host/lab", "ledger-address"),
        ("nonsense://", "ledger-address"),
        ("://secret@", "ledger-address"),
        ("postgresql://anna:secret@nohost.invalid/lab", "ledger-server"),
        ("postgresql://anna@127.0.0.1:1/lab?password=secret", "ledger-server"),
    ],
)
def test_addresses_are_explained_without_their_password(address: str, said: str) -> None:
    """In every message."""
    pytest.importorskip("psycopg")
    for make in (Ledger, create):
        with refused(said, error=LedgerError) as stopped:
            make(address)
        assert "secret" not in str(stopped.value)
    assert "secret" not in shown(address)


def test_a_missing_driver_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """With what to install."""
    monkeypatch.setitem(sys.modules, "psycopg", None)
    with refused("ledger-postgresql", error=LedgerError):
        engine("postgresql://anna:secret@host/lab")


def test_a_wrong_user_is_told(postgresql: Server) -> None:
    """What the server says, and what to check."""
    with refused("ledger-server", error=LedgerError):
        Ledger(postgresql.database().replace("ledger@", "nobody:secret@"))
    with refused("ledger-absent", error=LedgerError):
        Ledger(postgresql.database())


Change = Callable[[dict[str, bytes]], None]


def _line(edit: Callable[[bytes], bytes]) -> Change:
    def change(content: dict[str, bytes]) -> None:
        first, _, rest = content["records.jsonl"].partition(b"\n")
        content["records.jsonl"] = edit(first) + b"\n" + rest

    return change


def _field(name: str, value: Any) -> Change:
    return _line(lambda line: chain.compact({**json.loads(line), name: value}).encode())


def _manifest(**fields: Any) -> Change:
    def change(content: dict[str, bytes]) -> None:
        content["manifest.json"] = json.dumps({**json.loads(content["manifest.json"]), **fields}).encode()

    return change


@pytest.mark.long
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (_line(lambda line: line.replace(b'{"author"', b'{"author":"eve","author"')), "ledger-export-changed"),
        (_line(lambda line: line.replace(b'","', b'", "')), "ledger-export-changed"),
        (_line(lambda line: b"[" * 100_000), "file-format"),
        (_line(lambda line: b"\xff\xfe"), "file-format"),
        (_line(lambda line: b"[]"), "ledger-export-changed"),
        (_line(lambda line: b"9" * 5000), "file-format"),
        (_field("body", '{"name":"a","name":"b","triads":{}}'), "ledger-export-changed"),
        (_field("body", '{"name":"b","triads":{}}'), "ledger-export-changed"),
        (_field("version", "../../../files/schemas/tool-1"), "input-kind"),
        (_field("version", 2), "file-version"),
        (_field("kind", "chain"), "input-choice"),
        (_field("seq", True), "ledger-export-changed"),
        (_field("seq", 2), "ledger-export-changed"),
        (_field("created", "2026-01-01"), "input-kind"),
        (_field("id", "a\x00"), "ledger-text"),
        (_field("keys", {"serial": "a", "body": "x"}), "input-unknown"),
        (_field("keys", []), "input-missing"),
        (_manifest(head="1:x"), "ledger-other-file"),
        (_manifest(version=9), "file-version"),
        (_manifest(documents={"../../etc/passwd": "text/plain"}), "file-format"),
        (_manifest(documents=[1]), "ledger-other-file"),
        (lambda content: content.update({"records.jsonl": b""}), "ledger-export-changed"),
        (lambda content: content.update({"records.jsonl": b" " * 400_000_00}), "ledger-export-changed"),
        (lambda content: content.pop("records.jsonl") and None, "file-format"),
        (lambda content: content.update({"manifest.json": b"[" * 100_000}), "ledger-other-file"),
    ],
)
def test_a_crafted_export_is_refused_as_a_whole(tmp_path: Path, change: Change, said: str) -> None:
    """The ledger stays empty, no file is made anywhere."""
    with create(tmp_path / "a.sqlite") as ledger:
        ledger.append_all([Draft("tool", {"serial": "A"}, TOOL, [("text/plain", b"x")])], author="a")
        export(ledger, tmp_path / "all.zip")
    with zipfile.ZipFile(tmp_path / "all.zip") as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    change(content)
    with zipfile.ZipFile(tmp_path / "bad.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in content.items():
            archive.writestr(name, data)
    before = sorted(tmp_path.iterdir())
    with create(tmp_path / "b.sqlite") as ledger:
        with refused(said, error=FileError):
            restore(ledger, tmp_path / "bad.zip")
        assert ledger.head().seq == 0
    assert [p for p in sorted(tmp_path.iterdir()) if p.name != "b.sqlite"] == before


def test_a_damaged_export_is_refused(tmp_path: Path) -> None:
    """Bytes overwritten or cut off anywhere."""
    with create(tmp_path / "a.sqlite") as ledger:
        ledger.append_all([Draft("tool", {"serial": f"T{n}"}, TOOL) for n in range(30)], author="a")
        export(ledger, tmp_path / "all.zip")
    whole = (tmp_path / "all.zip").read_bytes()
    (tmp_path / "bad.zip").write_text("garbage")
    with create(tmp_path / "b.sqlite") as ledger:
        with refused("file-format", error=FileError):
            restore(ledger, tmp_path / "bad.zip")
        for start in range(0, len(whole), max(len(whole) // 25, 1)):
            for data in (whole[:start], whole[:start] + b"\x00\xff\x55" + whole[start + 3 :]):
                (tmp_path / "bad.zip").write_bytes(data)
                try:
                    restore(ledger, tmp_path / "bad.zip")
                except FileError:
                    assert ledger.head().seq == 0
                else:  # bytes of the archive that mean nothing, a date for instance
                    assert verify(ledger).ok
                    return
