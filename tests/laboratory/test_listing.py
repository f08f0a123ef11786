"""Lists without bodies, extracts read once, due days of many tools."""

from __future__ import annotations

import pytest

from inclinometry.laboratory.ledger.ledger import Ledger, Record
from inclinometry.laboratory.registry import extract, listed


def _events(ledger: Ledger, number: int) -> None:
    for place in range(number):
        keys = {"subject_kind": "tool", "subject": f"T{place % 2}", "action": "seen"}
        ledger.append("event", keys, {"reason": str(place)}, author="anna")


def test_a_list_has_what_the_records_have(laboratory: Ledger) -> None:
    """Newest first, page by page, by key."""
    _events(laboratory, 7)
    whole = listed(laboratory, "event")
    records = laboratory.find("event", newest=True)
    assert [(one.id, one.seq, one.created, one.author, one.keys) for one in whole] == [
        (r.id, r.seq, r.created, r.author, r.keys) for r in records
    ]
    first = listed(laboratory, "event", limit=4)
    assert whole == first + listed(laboratory, "event", before=first[-1].seq)
    assert [one.keys["subject"] for one in listed(laboratory, "event", subject="T1")] == ["T1"] * 3


def test_an_extract_is_worked_out_once(laboratory: Ledger) -> None:
    """Records do not change; another extract of the same record is another one."""
    _events(laboratory, 1)
    asked = []

    def reason(record: Record) -> str:
        asked.append(record.id)
        return str(record.body["reason"])

    one = listed(laboratory, "event")[0]
    assert [extract(laboratory, one, "reason", reason) for _ in range(3)] == ["0"] * 3
    assert asked == [one.id]
    assert extract(laboratory, one, "length", lambda record: len(record.body)) == 1


def test_a_list_of_what_is_not_a_kind_is_refused(laboratory: Ledger) -> None:
    """Columns are those of the kind."""
    with pytest.raises(KeyError):
        listed(laboratory, "event", serial="x")
