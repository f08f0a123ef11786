"""Tools, rigs and sites are declared once: record, stored schema and body of the interface say the same."""

from __future__ import annotations

import json
from dataclasses import MISSING, is_dataclass
from importlib.resources import files
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest
from annotated_types import MaxLen

from inclinometry.calibration.conventions import Dials
from inclinometry.laboratory.ledger.engine import KINDS, check
from inclinometry.laboratory.registry import (
    RegisteredRig,
    RegisteredSite,
    RegisteredTool,
    declared,
    registered,
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
    for one, hint, (name, place) in declared(type(full)):
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
    for one, _, (name, _place) in declared(type(full)):
        was, read = getattr(full, one.name), getattr(again, one.name)
        if name.endswith("_deg"):
            np.testing.assert_allclose(read, was, rtol=0.0, atol=1e-11)
        else:
            assert read == was
    assert registered(RegisteredSite, "hall", {}) == RegisteredSite("hall")
    assert registered(RegisteredTool, "IN-7", {"name": "tool"}) == RegisteredTool("IN-7", "tool")
