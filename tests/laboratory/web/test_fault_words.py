"""What is wrong with a ledger, a database, a file, as a page says it: in Russian and Chinese no English is left."""

from __future__ import annotations

import re
import sqlite3
from pathlib import Path
from types import SimpleNamespace

import pytest
from sqlalchemy.exc import DBAPIError

from inclinometry.errors import InclinometryError
from inclinometry.laboratory.import_file import import_file
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.chain import LedgerError
from inclinometry.laboratory.ledger.engine import translated
from inclinometry.laboratory.ledger.keys import OtherKeyError
from inclinometry.laboratory.ledger.signatures import Fault
from inclinometry.laboratory.ledger.witness import lost_sentence
from inclinometry.laboratory.registry import RegisteredRig, RegisteredTool, put_rig, put_tool
from inclinometry.laboratory.web.pages.ledger import fields, said
from inclinometry.laboratory.web.words import say, sentence

KEY = "ab12:cd34"
FAULTS = [
    Fault("chain", "-", "the triggers that forbid changes are missing"),
    Fault("trigger", "7", "is none of the program's; it could change what is recorded"),
    Fault("chain", "3 to 8", "removed: the numbers of the chain have a gap"),
    Fault("chain", "3 (77)", "inserted: records begin with 1"),
    Fault("chain", "3 (77)", "this link does not follow from the one before: changed or moved"),
    Fault("chain", "3 (77)", "is not the head noted earlier: the ledger was rewritten"),
    Fault("reading", "3 (77)", "removed: the chain has it, the table has not"),
    Fault("certificate", "3 (77)", "another record (78) stands in its place"),
    Fault("user", "3 (77)", "its content was changed after it was recorded"),
    Fault("chain", "35 to 40", "removed: the ledger ends before the head noted earlier"),
    Fault("event", "3 (77)", "inserted: the chain has no such record"),
    Fault("document", "77", "its bytes were changed"),
    Fault("document", "77", "removed: certificate 7-1 refers to it"),
    Fault("document", "77", "removed: the laboratory's logo refers to it"),
    Fault("document", "77", "its media type was changed: it is '7', certificate 7-1 says 8"),
    Fault("document", "77", "its media type was changed: it is '7', the laboratory's logo says 8"),
    Fault("head", "in place 7", "was changed: it cannot be read as a signed head"),
    Fault("head", "7 (8)", "the peaks of the tree that are kept beside it were changed"),
    Fault("head", "7 (8)", f"its signature is not that of the key {KEY}: changed or forged"),
    Fault("head", "7 (8)", f"its signature, kept by /7, is not that of the key {KEY}: changed or forged"),
    Fault("head", "7 (8)", "is of another ledger (77)"),
    Fault("head", "7 (8)", "the records up to here are not those that were signed then: rewritten, or an older copy"),
    Fault(
        "head",
        "7 (8)",
        "the records up to here are not those that were signed by the head that /7 keeps: rewritten, or an older copy",
    ),
    Fault("head", "-", "a line that /7 keeps is not readable"),
    Fault("head", "7", "the head in it is forged: its key did not sign it"),
    Fault("head", "7", "the head kept by /7 is forged: its key did not sign it"),
    Fault("chain", "7", "removed: the ledger ends before the signed head in it"),
    Fault(
        "chain",
        "7",
        "removed: the ledger ends before the signed head kept by /7; a copy that is kept on purpose is verified with "
        "--copy",
    ),
    Fault("head", "-", "the ledger that was begun in this place is signed, and this one is not"),
    Fault("head", "-", f"not signed by the key {KEY}: its signatures were removed, or it never had any"),
    Fault(
        "head",
        "-",
        "record 7 of this ledger was signed, says the head that /7 keeps, and it holds no signed head: its signatures "
        "were removed",
    ),
    Fault("head", "-", "another ledger (77) was begun in this place than stands here now"),
    Fault("chain", "7", "not signed: recorded by something else than this program with the laboratory's key"),
    Fault("head", "7 (8)", f"signed by {KEY}, for which the key before did not sign"),
    Fault("head", "7", f"signed by the key {KEY}, not by the laboratory's, 77"),
    Fault("head", "7 (8)", f"kept by /7: signed by the key {KEY}, which signed no head of this ledger"),
    Fault("keys", "-", "/7/key.pem is not a private key; restore it from a copy"),
    Fault("keys", "-", "/7/key.pem is a key of another kind; the key of a laboratory is an Ed25519 key"),
    Fault("keys", "-", str(OtherKeyError(Path("/7/public.pem"), "00" * 32, "11" * 32))),
    Fault(
        "witness",
        "-",
        "/7 was named as a witness of this ledger and is not on the list any more; name it again with `inclinometry "
        "ledger witness /7`, or take it off with --remove",
    ),
]


def _without_quotations(text: str) -> str:
    """Without commands, options and addresses, and what system and database say in their own words, in quotes."""
    ours = r"\b(Ed25519|INCLINOMETRY_\w+|(key|public)\.pem)\b"
    return re.sub(rf"--\w+|{KEY}|\b[0-9a-f]{{32}}\b|\w+://\S+|/\S+|{ours}", "", re.sub(r'`[^`]*`|"[^"]*"', "", text))


def _visitor(language: str) -> SimpleNamespace:
    return SimpleNamespace(sentence=lambda text: sentence(language, text))


def _lost(tmp_path) -> list[Fault]:
    places = (str(tmp_path / "heads"), str(tmp_path / "other"), "postgresql://127.0.0.1/heads")
    silent = 'the witness /7 cannot be asked ("no route to host")'
    return [Fault("witness", "-", text) for text in (*(lost_sentence(tmp_path, p, "77") for p in places), silent)]


NOTES = [
    "its laboratory named /7 as a witness, which is not asked here",
    "not signed: whoever can write to it can rewrite it",
    "all its records are those of a head that /7 keeps, none is in it",
    "its first 7 records were there before it was signed: what they said until then is not proven",
    "named",
    "removed",
    f"signed up to record 7 by the key {KEY} (the laboratory's until it was lost)",
    f"not proven: it is signed up to record 7 by the key {KEY}, and the key here is 77; name the public key of the "
    "laboratory whose ledger it is with `inclinometry ledger verify --key PUBLIC.pem`",
    f"signed up to record 7 by the key {KEY} (the one in public.pem)",
    *(
        f"the public key was not compared with the private key: /7/key.pem {reason}"
        for reason in (
            "is encrypted; put its passphrase into the environment as INCLINOMETRY_KEY_PASSPHRASE",
            "is not a private key; or its passphrase is wrong",
            "cannot be read (77); check its permissions",
        )
    ),
    f"/7 is signed by the key {KEY}, the one in /8 is 77; nothing was recorded or signed: bring the right key there, "
    "or state with `inclinometry ledger init --accept REASON` that the ledger goes on with this one",
    "/7/public.pem: not a public key any more; `inclinometry ledger key --make` writes it anew from key.pem, or "
    "restore it from a copy",
    "/7/changes.jsonl, line 7: not what a laboratory's key signed when it was rotated or lost; restore the file from a "
    "copy, or take the line out: every ledger has recorded the changes that it knows of",
]


@pytest.mark.parametrize("language", ["ru", "zh"])
def test_faults_are_said_in_the_language_of_the_page(tmp_path, language):
    left = []
    for fault in [*FAULTS, *_lost(tmp_path)]:
        text = said(_visitor(language), fault)
        plain = _without_quotations(text)
        if re.search("[A-Za-z]{3,}", plain):
            left.append(text)
    assert left == []


def test_the_english_of_a_fault_names_table_and_place():
    visitor = _visitor("en")
    assert said(visitor, FAULTS[2]) == "chain 3–8: removed: the numbers of the chain have a gap"
    assert said(visitor, FAULTS[0]) == "chain: the triggers that forbid changes are missing"


def test_every_fault_of_the_code_is_among_them():
    """A new sentence in the code is missed here, and so is its translation."""
    import ast
    import inspect

    from inclinometry.laboratory.ledger import signatures, verify

    known = " ".join(fault.problem for fault in FAULTS)
    missing = []
    for room in (signatures, verify):
        for node in ast.walk(ast.parse(inspect.getsource(room))):
            if not (isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Fault"):
                continue
            for part in ast.walk(node.args[2]):
                if isinstance(part, ast.Constant) and isinstance(part.value, str):
                    words = part.value.strip(" ().:;,'")
                    if words and words not in known and not re.fullmatch(r"[\d.]*", words):
                        missing.append(part.value)
    assert missing == []


OF_DATABASES = [
    sqlite3.OperationalError("disk I/O error"),
    sqlite3.OperationalError("attempt to write a readonly database"),
    sqlite3.OperationalError("unable to open database file"),
    sqlite3.DatabaseError("file is not a database"),
    sqlite3.DatabaseError("database disk image is malformed"),
    sqlite3.OperationalError("Could not decode to UTF-8 column 'body' with text 'x'"),
    sqlite3.OperationalError("database is locked"),
    sqlite3.OperationalError("no such table: chain"),
    sqlite3.OperationalError("something that nobody has thought of; yet"),
    Exception("cannot execute INSERT in a read-only transaction"),
    Exception('connection failed: FATAL:  password authentication failed for user "anna"'),
    Exception('FATAL:  database "lab" does not exist'),
    Exception("failed to resolve host 'nowhere'"),
    Exception("connection failed: Connection refused"),
]


@pytest.mark.parametrize("lost", [False, True], ids=["refused", "lost"])
@pytest.mark.parametrize("language", ["ru", "zh"])
def test_what_a_database_refuses_is_said_in_the_language_of_the_page(language, lost):
    """A sentence with the remedy, and behind it the database's own words as they are."""
    left = []
    for error in OF_DATABASES:
        with pytest.raises(LedgerError) as caught, translated("/lab/7.sqlite"):
            raise DBAPIError("INSERT", {}, error, connection_invalidated=lost)
        text = sentence(language, str(caught.value))
        assert text.startswith("/lab/7.sqlite: ")
        assert re.search(r'[(（]"[^"]+"[)）]$', text), text
        left += [text] if re.search("[A-Za-z]{3,}", _without_quotations(text)) else []
    assert left == []


def test_the_words_of_a_locked_ledger():
    with pytest.raises(LedgerError) as caught, translated("lab.sqlite"):
        raise DBAPIError("INSERT", {}, sqlite3.OperationalError("database is locked"))
    assert str(caught.value) == (
        'lab.sqlite: another program holds the ledger: close it, then try again ("database is locked")'
    )


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
            text = sentence(language, str(caught.value))
            plain = re.sub(r"\w+_[a-z0-9]+|'\w+'|\bnan\b|JSON|schema|station", "", _without_quotations(text))
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


OF_FILES = [
    "the file is empty; a line of column names and rows of values are needed",
    "readings.csv, line 3: this row has 7 cells and the header 8; complete or remove it",
    "the file, line 2: this row has 9 cells and the header 8; with a decimal comma separate columns by semicolons",
    "the file, line 2: '1,5' in column 'accel_x' may mean 15 or 1.5; write numbers with a decimal point",
    "the file: column 'azimuth_deg' is missing; columns found: 'a', 'b'",
    "the file: column 'accel_x' is text; numbers are needed",
    "the file: column 4 has no name; give it one or remove it",
    "the file, line 1: there are column names but no rows of values",
    "the file, line 9: station is empty; give it a name or remove the row",
    "the file, line 9: count is 0.5; it must be a whole number from 1",
    "the file: these readings have no rig angles; give azimuth, inclination and toolface (columns azimuth_deg, "
    "inclination_deg, toolface_deg); the field method does without them, by roll sets",
    "the file: nothing is in it (0 bytes); choose another file",
    "the file: not UTF-8 text (byte 0); a JSON file is needed",
    "the file: $.tool is 7; it must be a text",
    "the file: $ has no 'triads'; add it",
    "the file: $.rig has 'x', which is not known; allowed: sd, errors",
    "the file: holds a list; an object of JSON is needed",
]


OF_ACCOUNTS = [
    "the password has 7 characters; allowed 15 to 128: four or five words are easy to keep",
    "the password is one of the first to be guessed: a common one, a row of keys, a repetition, a date, a name, or two "
    "or three common words; take four or five words that do not belong together",
    "this code was used before; wait for the next one",
    "'1' has a second factor; remove it first, then set up another",
    "the name '1' has a control character; take characters that are seen",
    "the code of the second factor is missing, wrong or was used before",
    "the current password is wrong; nothing was changed",
    "the two passwords differ; nothing was changed",
    "this is not the code of now; check the clocks of the telephone and of the bench",
    "'1' has no second factor",
    "a user needs a name: write the one to log in with",
    "'1' is a new user; give a password of at least 15 characters",
    "password changed", "second factor set up", "second factor removed", "code 59423 of 5a3f", "code 59423",
    "recovery code 5a3f",
]  # fmt: skip
NAMES = r"'[^']*'|\$[.\w]*|\w+_\w+|\b(readings\.csv|JSON|UTF-8|count|sd|errors)\b"


@pytest.mark.parametrize("language", ["ru", "zh"])
@pytest.mark.parametrize(
    ("texts", "shortest", "names"), [(NOTES, 3, "$^"), (OF_FILES, 3, NAMES), (OF_ACCOUNTS, 2, "$^")],
    ids=["notes", "files", "accounts"],
)  # fmt: skip
def test_sentences_are_said_in_the_language_of_the_page(language, texts, shortest, names):
    """No English is left but commands, addresses and names; numbers stay."""
    for text in texts:
        said = sentence(language, text)
        assert not re.search(f"[A-Za-z]{{{shortest},}}", re.sub(names, "", _without_quotations(said))), said
        if texts is OF_ACCOUNTS:
            assert re.findall(r"\d+", said) == re.findall(r"\d+", text)
