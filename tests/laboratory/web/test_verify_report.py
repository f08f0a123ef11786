"""The page of a verification: one uncertainty in its curves, its sentences and its table."""

from __future__ import annotations

from types import SimpleNamespace
from unittest.mock import MagicMock

import pytest

from inclinometry.laboratory.web.pages import verify as verify_report


def test_the_table_states_the_u_of_the_bars(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without agreed limits the record holds k u with another k; sentences and bars of the page say U with k = 2."""
    tables: list[list[dict[str, str]]] = []
    for name in ("ui", "chart"):
        monkeypatch.setattr(verify_report, name, MagicMock())
    monkeypatch.setattr(verify_report, "paged", lambda _columns, rows, *_: tables.append(rows))
    angle = {"error_deg": 0.1, "U_deg": 0.4, "limit_deg": 0.4, "decision": "pass"}
    angles = ("inclination", "azimuth", "toolface")
    row = {"position": 1, **{f"{name}_deg": 15.0 for name in angles}, **dict.fromkeys(angles, angle)}
    visitor = SimpleNamespace(say=lambda key, **_: key, sentence=str)
    verify_report.show_report(visitor, "pass", {"name": "certificate"}, {"coverage_factor": 4.0, "positions": [row]})
    assert tables[0][0]["e_azimuth"] == "+0.100 ± 0.200"
