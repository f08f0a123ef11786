"""What is wrong with a ledger, a database, a file, as a page says it: in Russian and Chinese no English is left."""

from __future__ import annotations

import re
import sqlite3
from types import SimpleNamespace

import pytest
from sqlalchemy.exc import DBAPIError
from tests.refusals import refused

from inclinometry.errors import InclinometryError
from inclinometry.laboratory.import_file import import_file
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.chain import LedgerError
from inclinometry.laboratory.ledger.engine import Record, translated
from inclinometry.laboratory.registry import RegisteredRig, RegisteredTool, put_rig, put_tool
from inclinometry.laboratory.web.pages.ledger import _keys, fields
from inclinometry.laboratory.web.words import problem, say, sentence


def _without_quotations(text: str) -> str:
    """Without commands, options and addresses, and what system and database say in their own words, in quotes."""
    return re.sub(r"--\w+|\w+://\S+|/\S+", "", re.sub(r'`[^`]*`|"[^"]*"', "", text))


OF_DATABASES = [
    (sqlite3.OperationalError("disk I/O error"), "ledger-access"),
    (sqlite3.OperationalError("database or disk is full"), "ledger-disk-full"),
    (sqlite3.OperationalError("attempt to write a readonly database"), "ledger-access"),
    (sqlite3.OperationalError("unable to open database file"), "ledger-access"),
    (sqlite3.DatabaseError("file is not a database"), "ledger-damaged"),
    (sqlite3.DatabaseError("database disk image is malformed"), "ledger-damaged"),
    (sqlite3.OperationalError("Could not decode to UTF-8 column 'body' with text 'x'"), "ledger-damaged"),
    (sqlite3.OperationalError("database is locked"), "ledger-locked"),
    (sqlite3.OperationalError("no such table: chain"), "ledger-damaged"),
    (sqlite3.OperationalError("something that nobody has thought of; yet"), "ledger-refused"),
    (Exception("cannot execute INSERT in a read-only transaction"), "ledger-access"),
    (Exception('connection failed: FATAL:  password authentication failed for user "anna"'), "ledger-server"),
    (Exception('FATAL:  database "lab" does not exist'), "ledger-server"),
    (Exception("failed to resolve host 'nowhere'"), "ledger-server"),
    (Exception("connection failed: Connection refused"), "ledger-server"),
]


@pytest.mark.parametrize("lost", [False, True], ids=["refused", "lost"])
@pytest.mark.parametrize(("error", "code"), OF_DATABASES)
def test_what_a_database_refuses(error, code, lost):
    """Which remedy it has; the database's own words are its cause."""
    wanted = "ledger-server" if lost else code
    with refused(wanted, error=LedgerError, ledger="/lab/7.sqlite"), translated("/lab/7.sqlite"):
        raise DBAPIError("INSERT", {}, error, connection_invalidated=lost)


HEAD = "station,azimuth_deg,inclination_deg,toolface_deg,accel_x,accel_y,accel_z"
FILES = [
    "a,b\n1,2\n",
    f"{HEAD}\nA,0,0,0,1,2,nan\n",
    f"{HEAD}\nA,0,0,0,1,2,7:7\n",
    f"{HEAD}\nA,0,0,0,1,2,\n",
    f"{HEAD}\nA,0,0,0,1,2\n",
    f"{HEAD}\nA,0,400,0,1,2,3\n",
    f"{HEAD}\n",
    f"{HEAD.replace('azimuth_deg', 'azimuth')}\nA,0,0,0,1,2,3\n",
    "station,accel_x,accel_y,accel_z\nA,1,2,3\n",
    "",
    "{}",
    '{"schema": "other"}',
    '{"schema": "inclinometry/truth"}',
    '{"schema": "inclinometry/verification"}',
    '{"schema": "inclinometry/corrections"}',
    '{"schema": "inclinometry/tool", "version": 99}',
]


@pytest.mark.parametrize("language", ["ru", "zh"])
def test_a_file_that_cannot_be_imported_is_said_in_the_language_of_the_page(tmp_path, language):
    """What the file is, what was expected, the remedy; names of columns and commands stay."""
    left = []
    with create(tmp_path / "lab.sqlite", sign=False) as ledger:
        put_tool(ledger, RegisteredTool("IN-7", "tool"), author="anna")
        put_rig(ledger, RegisteredRig("stand", (0.001, 0.001, 0.001)), author="anna")
        for content in FILES:
            with pytest.raises(InclinometryError) as caught:
                import_file(ledger, content.encode(), "IN-7", "stand", author="anna")
            text = problem(language, caught.value)
            plain = re.sub(r"\w+_[a-z0-9]+|azimuth\b|JSON|tool\.json|calibrate -o", "", _without_quotations(text))
            left += [text] if re.search("[A-Za-z]{2,}", plain) else []
    assert left == []


def test_a_record_is_a_table_in_the_language_of_the_page():
    """Field, value and unit; names stay as people gave them, matrices and whole files are counted."""
    body = {
        "rig": "stand 1",
        "dial_deg": [10.0, 20.0, 30.0],
        "still": True,
        "duration_s": 4.4001,
        "channels": {"accelerometer": [1.5, 2.5]},
        "plan": {"name": "twelve", "positions_deg": [[1, 2, 3], [4, 5, 6]]},
        "note": "",
        "tool_json": {"schema": "inclinometry/tool"},
    }

    def rows(language):
        visitor = SimpleNamespace(
            sentence=lambda text: sentence(language, text), say=lambda key, **values: say(language, key, **values)
        )
        return fields(visitor, body)

    assert rows("en") == [
        ("rig", "stand 1", ""),
        ("dial", "10; 20; 30", "°"),
        ("still", "yes", ""),
        ("duration", "4.4001", "s"),
        ("channels · accelerometer", "1.5; 2.5", ""),
        ("plan · name", "twelve", ""),
        ("plan · positions", "2 entries, in the record as it is stored", "°"),
        ("tool json", "1 entries, in the record as it is stored", ""),
    ]
    for language in ("ru", "zh"):
        for field, value, _ in rows(language):
            assert not re.search("[A-Za-z]{2,}", field), field
            assert value in ("stand 1", "twelve") or not re.search("[A-Za-z]{2,}", value), value


@pytest.mark.parametrize("language", ["ru", "zh"])
@pytest.mark.parametrize(
    ("action", "number"),
    [
        ("password changed", ""), ("second factor set up", ""), ("second factor removed", ""),
        ("code 59423", "59423"), ("code 59423 of 5a3f", "59423"), ("recovery code 5a3f", "5a3f"),
    ],
)  # fmt: skip
def test_what_users_did_is_said_in_the_language_of_the_page(language, action, number):
    """No English is left; numbers stay."""
    event = Record("event", "1", 1, "", "anna", 1, {"action": action}, {}, "")
    said = _keys(SimpleNamespace(language=language, sentence=lambda text: sentence(language, text)), event)
    assert said.endswith(number)
    assert not re.search("[A-Za-z]{2,}", said.removesuffix(number)), said
