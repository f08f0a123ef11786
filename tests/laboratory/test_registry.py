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

from inclinometry.calibration.conventions import Dials
from inclinometry.errors import InputError
from inclinometry.laboratory.certificate.laboratory_toml import Laboratory
from inclinometry.laboratory.ledger.engine import KINDS, check
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.ledger.verify import verify
from inclinometry.laboratory.registry import (
    LARGEST_LOGO,
    RegisteredRig,
    RegisteredSite,
    RegisteredStandard,
    RegisteredTool,
    declared,
    due_days,
    find_laboratory,
    find_logo,
    find_standard,
    months_after,
    put_laboratory,
    put_standard,
    put_tool,
    registered,
    standards,
    stored,
)

FULL = (
    RegisteredTool("IN-7", "tool", {"acc": {"unit": "g"}}, "m", "c", "d", "native", (0.1, 0.2), 12, True),
    RegisteredRig("stand", (0.1, 0.2, 0.3), (0.1, 0.2), (0.3, 0.4), (0.5, 0.6), "d", "t", "p", {"port": "COM1"}),
    RegisteredRig("stand", (0.1, 0.2, 0.3), dials=Dials("horizontal", "counterclockwise")),
    RegisteredSite("hall", 9.81, 5e4, 1.0, 0.5, {"name": "Hall"}, "d"),
)
UNUSED = {"tool": {"limits"}, "rig": {"certificate"}, "site": {"longitude_deg", "height_m", "u"}}
"""What the stored schemas allow and nothing writes."""


@pytest.mark.parametrize("full", FULL)
def test_the_stored_schema_is_what_the_declaration_stores(full: Any) -> None:
    kind = type(full).__name__.removeprefix("Registered").lower()
    text = files("inclinometry.laboratory.ledger").joinpath("schemas", f"{kind}-1.json").read_text("utf-8")
    schema, body = json.loads(text), stored(full)
    properties = schema["properties"]
    assert set(properties) == set(body) | UNUSED[kind]
    key = next(iter(KINDS[kind].keys))
    check(kind, {key: getattr(full, key)}, body)
    for one, hint, (name, place, _) in declared(type(full)):
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
    again = registered(type(full), next(iter(vars(full).values())), stored(full))
    for one, _, (name, _place, _) in declared(type(full)):
        was, read = getattr(full, one.name), getattr(again, one.name)
        if name.endswith("_deg"):
            np.testing.assert_allclose(read, was, rtol=0.0, atol=1e-11)
        else:
            assert read == was
    assert registered(RegisteredSite, "hall", {}) == RegisteredSite("hall")
    assert registered(RegisteredTool, "IN-7", {"name": "tool"}) == RegisteredTool("IN-7", "tool")


def test_a_standard_is_an_event_and_the_newest_counts(laboratory: Ledger) -> None:
    put_standard(laboratory, RegisteredStandard("T2", "D-17", date(2026, 3, 1)), author="anna")
    put_standard(laboratory, RegisteredStandard("quartz rod"), author="anna")
    new = RegisteredStandard("T2", "D-99", date(2028, 3, 1), "theodolite")
    put_standard(laboratory, new, author="anna")
    assert standards(laboratory) == [new, RegisteredStandard("quartz rod")]
    assert find_standard(laboratory, "T2") == new
    assert find_standard(laboratory, "T3") is None
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
    assert (find_laboratory(laboratory), find_logo(laboratory)) == (None, None)
    put_laboratory(laboratory, about, author="anna", logo=SVG)
    put_laboratory(laboratory, replace(about, place="cellar"), author="anna")
    assert find_laboratory(laboratory) == replace(about, place="cellar")
    assert find_logo(laboratory) == ("image/svg+xml", SVG)
    put_laboratory(laboratory, about, author="anna", logo=b"")
    assert find_logo(laboratory) is None


@pytest.mark.parametrize(
    ("logo", "why"),
    [
        (b"GIF89a", "no PNG or SVG"),
        (bytes(LARGEST_LOGO + 1), "allowed 200000"),
        (SVG.replace(b"<circle", b"<script>1</script><circle"), "by itself"),
        (b'<!DOCTYPE svg [<!ENTITY a "b">]>' + SVG, "by itself"),
        (SVG.replace(b"<circle", b'<image href="http://x/y.png"/><circle'), "by itself"),
        (b"\x89PNG\r\n\x1a\n" + bytes(40), "cannot be drawn"),
        (b"<svg <<", "cannot be drawn"),
    ],
)
def test_a_logo_that_is_none_is_refused(laboratory: Ledger, logo: bytes, why: str) -> None:
    before = laboratory.head()
    with pytest.raises(InputError, match=why):
        put_laboratory(laboratory, Laboratory("Hall"), author="anna", logo=logo)
    assert laboratory.head() == before


def test_a_tool_is_due_from_its_calibration_where_it_has_no_certificate(laboratory: Ledger) -> None:
    tool = RegisteredTool("IN-7", "tool", interval_months=12)
    today = date.fromisoformat(put_tool(laboratory, tool, author="anna").created[:10])
    assert due_days(laboratory, [tool]) == {"IN-7": today}
    body = {"tool_json": {}, "method": "joint", "readings": []}
    laboratory.append("calibration", {"serial": "IN-7", "session": "0" * 32}, body, author="anna")
    assert due_days(laboratory, [tool]) == {"IN-7": months_after(today, 12)}
