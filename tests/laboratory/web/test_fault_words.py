"""What is wrong with a ledger, as its page says it: in Russian and Chinese no English sentence is left."""

from __future__ import annotations

import re
from types import SimpleNamespace

import pytest

from inclinometry.laboratory.ledger.signatures import Fault
from inclinometry.laboratory.ledger.witness import lost_sentence, unencrypted
from inclinometry.laboratory.web.pages.ledger import said
from inclinometry.laboratory.web.words import sentence

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
    Fault("head", "-", "another ledger (77) was begun in this place than stands here now"),
    Fault("chain", "7", "not signed: recorded by something else than this program with the laboratory's key"),
    Fault("head", "7 (8)", f"signed by {KEY}, for which the key before did not sign"),
    Fault("head", "7", f"signed by the key {KEY}, not by the laboratory's, 77"),
]


def _visitor(language: str) -> SimpleNamespace:
    return SimpleNamespace(sentence=lambda text: sentence(language, text))


def _lost(tmp_path) -> list[Fault]:
    places = (str(tmp_path / "heads"), str(tmp_path / "other"), "http://127.0.0.1:1")
    doubts = [*unencrypted("http://198.51.100.7:1"), "the witness http://198.51.100.7:1 cannot be asked (timed out)"]
    return [Fault("witness", "-", text) for text in (*(lost_sentence(tmp_path, p, "77") for p in places), *doubts)]


@pytest.mark.parametrize("language", ["ru", "zh"])
def test_faults_are_said_in_the_language_of_the_page(tmp_path, language):
    left = []
    for fault in [*FAULTS, *_lost(tmp_path)]:
        text = said(_visitor(language), fault)
        plain = re.sub(rf"`[^`]*`|--\w+|{KEY}|\bhttp\S+|/\S+", "", text)
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
