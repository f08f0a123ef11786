"""The page of a verification: one uncertainty in its curves, its sentences and its table."""

from __future__ import annotations

from types import SimpleNamespace
from unittest.mock import MagicMock

import pytest

from inclinometry.files.verification_json import as_now
from inclinometry.laboratory.web.pages import lists
from inclinometry.laboratory.web.pages import verify as verify_report


def test_the_table_states_the_u_of_the_bars(monkeypatch: pytest.MonkeyPatch) -> None:
    """An older record without agreed limits holds k u with another k; the page says U with k = 2."""
    tables: list[list[dict[str, str]]] = []
    monkeypatch.setattr(verify_report, "ui", MagicMock())
    monkeypatch.setattr(lists, "chart", MagicMock())
    monkeypatch.setattr(lists, "paged", lambda _columns, rows, *_: tables.append(rows))
    angle = {"error_deg": 0.1, "U_deg": 0.4, "limit_deg": 0.4, "decision": "pass"}
    angles = ("inclination", "azimuth", "toolface")
    row = {"position": 1, **{f"{name}_deg": 15.0 for name in angles}, **dict.fromkeys(angles, angle)}
    visitor = SimpleNamespace(say=lambda key, **_: key, sentence=str, number=str, panel=MagicMock())
    report = {"coverage_factor": 4.0, "positions": [row], "reasons": [], "warnings": []}
    held = as_now({"verdict": "pass", "limits": {"name": "certificate"}, "report": report})
    assert (held["verdict"], held["limits"], held["report"]["positions"][0]["azimuth"]["limit_deg"]) == (
        "agrees",
        None,
        None,
    )
    verify_report.show_report(visitor, held["verdict"], held["limits"], held["report"])
    assert tables[0][0]["d_azimuth"] == "decision.agrees"
    assert tables[0][0]["e_azimuth"] == "+0.100 ± 0.200"
