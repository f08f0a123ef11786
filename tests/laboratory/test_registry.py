"""Tools, rigs and sites are declared once: record, stored schema and body of the interface say the same."""

from __future__ import annotations

import json
from dataclasses import MISSING, is_dataclass, replace
from datetime import date
from importlib.resources import files
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest
from annotated_types import MaxLen
from tests.refusals import refused

from inclinometry.calibration.conventions import Dials
from inclinometry.laboratory import registry
from inclinometry.laboratory.certificate.laboratory import Laboratory
from inclinometry.laboratory.ledger.engine import KINDS, check
from inclinometry.laboratory.ledger.ledger import Ledger, Record
from inclinometry.laboratory.ledger.verify import verify
from inclinometry.laboratory.registry import cached_from_record, listed

FULL = (
    registry.RegisteredTool("IN-7", "tool", {"acc": {"unit": "g"}}, "m", "c", "d", "native", (0.1, 0.2), 12, True),
    registry.RegisteredRig(
        "stand", (0.1, 0.2, 0.3), (0.1, 0.2), (0.3, 0.4), (0.5, 0.6), "d", "t", "p", {"port": "COM1"}
    ),
    registry.RegisteredRig("stand", (0.1, 0.2, 0.3), dials=Dials("horizontal", "counterclockwise")),
    registry.RegisteredSite("hall", 9.81, 5e4, 1.0, 0.5, {"name": "Hall"}, "d"),
)
UNUSED = {"tool": {"limits"}, "rig": {"certificate"}, "site": {"longitude_deg", "height_m", "u"}}
"""What the stored schemas allow and nothing writes."""


@pytest.mark.parametrize("full", FULL)
def test_the_stored_schema_is_what_the_declaration_stores(full: Any) -> None:
    kind = type(full).__name__.removeprefix("Registered").lower()
    text = files("inclinometry.laboratory.ledger").joinpath("schemas", f"{kind}-1.json").read_text("utf-8")
    schema, body = json.loads(text), registry.to_record_body(full)
    properties = schema["properties"]
    assert set(properties) == set(body) | UNUSED[kind]
    key = next(iter(KINDS[kind].keys))
    check(kind, {key: getattr(full, key)}, body)
    for one, hint, (name, place, _) in registry.declared(type(full)):
        about = properties[place.partition(".")[0]]
        if about.get("type") == "string":
            longest = [mark.max_length for mark in getattr(hint, "__metadata__", ()) if isinstance(mark, MaxLen)]
            assert about["maxLength"] >= max(longest, default=0)
        if is_dataclass(hint):
            allowed = {part: get_args(choices) for part, choices in get_type_hints(hint).items()}
            assert allowed == {part: tuple(rule["enum"]) for part, rule in about["properties"].items()}
        if one.default is MISSING and one.default_factory is MISSING:
            assert name in schema["required"]


@pytest.mark.parametrize("full", FULL)
def test_a_stored_body_gives_back_what_was_registered(full: Any) -> None:
    """To the ninth decimal of a degree, in which angles are stored; what is not said is as declared."""
    again = registry.from_record_body(type(full), next(iter(vars(full).values())), registry.to_record_body(full))
    for one, _, (name, _place, _) in registry.declared(type(full)):
        was, read = getattr(full, one.name), getattr(again, one.name)
        if name.endswith("_deg"):
            np.testing.assert_allclose(read, was, rtol=0.0, atol=1e-11)
        else:
            assert read == was
    assert registry.from_record_body(registry.RegisteredSite, "hall", {}) == registry.RegisteredSite("hall")
    assert registry.from_record_body(registry.RegisteredTool, "IN-7", {"name": "tool"}) == registry.RegisteredTool(
        "IN-7", "tool"
    )


def test_a_standard_is_an_event_and_the_newest_counts(laboratory: Ledger) -> None:
    registry.put_standard(laboratory, registry.Standard("T2", "D-17", date(2026, 3, 1)), author="anna")
    registry.put_standard(laboratory, registry.Standard("quartz rod"), author="anna")
    new = registry.Standard("T2", "D-99", date(2028, 3, 1), "theodolite")
    registry.put_standard(laboratory, new, author="anna")
    assert registry.standards(laboratory) == [new, registry.Standard("quartz rod")]
    assert registry.find_standard(laboratory, "T2") == new
    assert registry.find_standard(laboratory, "T3") is None
    assert not new.overdue(date(2028, 3, 1))
    assert new.overdue(date(2028, 3, 2))
    assert verify(laboratory).ok


PNG = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108060000001f15c4890000000d49444154789c6360f8cfc0f01f00050001ff5a"
    "1d1b860000000049454e44ae426082"
)
SVG = b'<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><circle cx="4" cy="4" r="4"/></svg>'


def test_a_logo_stays_until_it_is_replaced_or_removed(laboratory: Ledger) -> None:
    about = Laboratory("Hall", address="street", country="DE", accreditation="D-K-1")
    assert (registry.find_laboratory(laboratory), registry.find_logo(laboratory)) == (None, None)
    registry.put_laboratory(laboratory, about, author="anna", logo=SVG)
    registry.put_laboratory(laboratory, replace(about, place="cellar"), author="anna")
    assert registry.find_laboratory(laboratory) == replace(about, place="cellar")
    assert registry.find_logo(laboratory) == ("image/svg+xml", SVG)
    registry.put_laboratory(laboratory, about, author="anna", logo=b"")
    assert registry.find_logo(laboratory) is None


@pytest.mark.parametrize(
    ("logo", "why"),
    [
        (b"GIF89a", "session-logo"),
        (bytes(registry.LARGEST_LOGO + 1), "file-large"),
        (SVG.replace(b"<circle", b"<script>1</script><circle"), "session-logo"),
        (b'<!DOCTYPE svg [<!ENTITY a "b">]>' + SVG, "session-logo"),
        (SVG.replace(b"<circle", b'<image href="http://x/y.png"/><circle'), "session-logo"),
        (b"\x89PNG\r\n\x1a\n" + bytes(40), "file-format"),
        (b"<svg <<", "file-format"),
    ],
)
def test_a_logo_that_is_none_is_refused(laboratory: Ledger, logo: bytes, why: str) -> None:
    before = laboratory.head()
    with refused(why):
        registry.put_laboratory(laboratory, Laboratory("Hall"), author="anna", logo=logo)
    assert laboratory.head() == before


def test_a_tool_is_due_from_its_calibration_where_it_has_no_certificate(laboratory: Ledger) -> None:
    tool = registry.RegisteredTool("IN-7", "tool", interval_months=12)
    today = date.fromisoformat(registry.put_tool(laboratory, tool, author="anna").created[:10])
    assert registry.due_days(laboratory, [tool]) == {"IN-7": today}
    body = {"tool_json": {}, "method": "joint", "readings": []}
    laboratory.append("calibration", {"serial": "IN-7", "session": "0" * 32}, body, author="anna")
    assert registry.due_days(laboratory, [tool]) == {"IN-7": registry.months_after(today, 12)}


# Lists without bodies, extracts read once, due days of many tools.


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
    assert [cached_from_record(laboratory, one, "reason", reason) for _ in range(3)] == ["0"] * 3
    assert asked == [one.id]
    assert cached_from_record(laboratory, one, "length", lambda record: len(record.body)) == 1


def test_a_list_of_what_is_not_a_kind_is_refused(laboratory: Ledger) -> None:
    """Columns are those of the kind."""
    with pytest.raises(KeyError):
        listed(laboratory, "event", serial="x")


def test_a_rig_may_turn_either_way(laboratory: Ledger) -> None:
    """Its dials reach a full turn to both sides, that of the inclination too."""
    rig = registry.RegisteredRig("stand 2", (0.001,) * 3, inclination=(-float(np.pi) / 2, float(np.pi) / 2))
    registry.put_rig(laboratory, rig, author="a")
    found = registry.find_rig(laboratory, "stand 2")
    assert found is not None
    assert found.inclination == pytest.approx(rig.inclination)
