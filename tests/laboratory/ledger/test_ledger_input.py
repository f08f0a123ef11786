"""Strange values, addresses and exports: the same clear answer on both engines, nothing recorded by halves."""

from __future__ import annotations

import json
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from benchmarks.postgresql import Server

from inclinometry.errors import FileError, InputError
from inclinometry.laboratory.ledger import chain
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.engine import engine, shown
from inclinometry.laboratory.ledger.exchange import export, restore
from inclinometry.laboratory.ledger.ledger import Draft, Ledger, LedgerError
from inclinometry.laboratory.ledger.verify import verify

TOOL = {"name": "steering tool", "triads": {}}
INJECTIONS = (
    "'; DROP TABLE tool; --",
    '" OR 1=1 --',
    "%s %(x)s :y {z}",
    "<script>",
    "=cmd|' /C calc'!A0",
    "\\x00",
    "null",
)


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
        with pytest.raises(InputError, match=r"1 to 200 printable|media type"):
            attempt()
    assert ledger.latest("tool", serial=bad) is None
    assert ledger.count("tool", serial=bad) == 0
    for read in (lambda: ledger.get("tool", bad), lambda: ledger.document(bad)):
        with pytest.raises(LedgerError, match="there is no"):
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
        with pytest.raises(InputError, match="cannot be recorded"):
            ledger.append("site", {"name": "s"}, {"u": {"x": content}}, author="a")
    assert ledger.head().seq == 0


@pytest.mark.parametrize("number", [2**31, 2**63, 10**400, -1, 1.0, True, "1"])
def test_whole_numbers_that_do_not_fit_are_refused_alike(ledger: Ledger, number: Any) -> None:
    """As a key; asked for, they find nothing; as places they are the first or the last."""
    body = {"dial_deg": [0.0, 0.0, 0.0], "channels": {"gyro": [1.0]}, "count": 1, "captured": "key"}
    with pytest.raises(InputError, match="whole number, 0 to 2147483647"):
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
        ("postgresql://anna:secret@host", "names no database"),
        ("postgresql://anna:secret@host:port/lab", "cannot be used"),
        ("postgresql://anna:sec/ret@host/lab", "check|cannot be used"),
        ("mysql://anna:secret@host/lab", "file path"),
        ("nonsense://", "file path|cannot be used"),
        ("://secret@", "cannot be used"),
        ("postgresql://anna:secret@nohost.invalid/lab", "check"),
        ("postgresql://anna@127.0.0.1:1/lab?password=secret", "check"),
    ],
)
def test_addresses_are_explained_without_their_password(address: str, said: str) -> None:
    """In every message."""
    pytest.importorskip("psycopg")
    for make in (Ledger, create):
        with pytest.raises(LedgerError, match=said) as stopped:
            make(address)
        assert "secret" not in str(stopped.value)
    assert "secret" not in shown(address)


def test_a_missing_driver_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """With what to install."""
    monkeypatch.setitem(sys.modules, "psycopg", None)
    with pytest.raises(LedgerError, match=r"pip install inclinometry\[postgresql\]"):
        engine("postgresql://anna:secret@host/lab")


def test_a_wrong_user_is_told(postgresql: Server) -> None:
    """What the server says, and what to check."""
    with pytest.raises(LedgerError, match="check user and database"):
        Ledger(postgresql.database().replace("ledger@", "nobody:secret@"))
    with pytest.raises(LedgerError, match="not a ledger"):
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
        (_line(lambda line: line.replace(b'{"author"', b'{"author":"eve","author"')), "doubled keys"),
        (_line(lambda line: line.replace(b'","', b'", "')), "spelled"),
        (_line(lambda line: b"[" * 100_000), "not a record"),
        (_line(lambda line: b"\xff\xfe"), "not a record"),
        (_line(lambda line: b"[]"), "not a record"),
        (_line(lambda line: b"9" * 5000), "not a record"),
        (_field("body", '{"name":"a","name":"b","triads":{}}'), "doubled keys"),
        (_field("body", '{"name":"b","triads":{}}'), "the export was changed"),
        (_field("version", "../../../files/schemas/tool-1"), "whole number"),
        (_field("version", 2), "not known"),
        (_field("kind", "chain"), "record kind"),
        (_field("seq", True), "seq is not"),
        (_field("seq", 2), "does not follow"),
        (_field("created", "2026-01-01"), "created is not"),
        (_field("id", "a\x00"), "printable"),
        (_field("keys", {"serial": "a", "body": "x"}), "has the keys"),
        (_field("keys", []), "not a record"),
        (_manifest(head="1:x"), "manifest"),
        (_manifest(version=9), "version 9"),
        (_manifest(documents={"../../etc/passwd": "text/plain"}), "damaged"),
        (_manifest(documents=[1]), "manifest"),
        (lambda content: content.update({"records.jsonl": b""}), "ends at record 0"),
        (lambda content: content.update({"records.jsonl": b" " * 400_000_00}), "swell"),
        (lambda content: content.pop("records.jsonl") and None, "damaged"),
        (lambda content: content.update({"manifest.json": b"[" * 100_000}), "manifest"),
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
        with pytest.raises(FileError, match=said):
            restore(ledger, tmp_path / "bad.zip")
        assert ledger.head().seq == 0
    assert [p for p in sorted(tmp_path.iterdir()) if p.name != "b.sqlite"] == before


def test_a_damaged_export_is_refused(tmp_path: Path) -> None:
    """Bytes overwritten or cut off anywhere."""
    with create(tmp_path / "a.sqlite") as ledger:
        ledger.append_all([Draft("tool", {"serial": f"T{n}"}, TOOL) for n in range(30)], author="a")
        export(ledger, tmp_path / "all.zip")
    whole = (tmp_path / "all.zip").read_bytes()
    with create(tmp_path / "b.sqlite") as ledger:
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
