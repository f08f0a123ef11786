"""Certificates without paper: what the typesetter is given."""

from __future__ import annotations

import json

import pytest


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, str]]:
    """What the typesetter is given, certificate by certificate; nothing is set."""
    seen: list[dict[str, str]] = []

    def compiled(*_: object, sys_inputs: dict[str, str], **__: object) -> bytes:
        seen.append(json.loads(sys_inputs["data"]))
        return b"%PDF"

    monkeypatch.setattr("typst.compile", compiled)
    monkeypatch.setattr("inclinometry.laboratory.certificate.record.paper_svg", lambda _: "<svg/>")
    # nothing is set, so no font is needed, which for Chinese is not on every computer
    monkeypatch.setattr("inclinometry.laboratory.certificate.pdf.families", lambda *_: ("serif", "sans"))
    return seen
