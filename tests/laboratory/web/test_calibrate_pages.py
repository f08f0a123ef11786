"""The pages of the bench as a server sends them: what tests and assistive programs find, what is refused."""

from __future__ import annotations

import re

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.laboratory.instruments.protocol import InstrumentEvent
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.registry import RegisteredRig, RegisteredTool, put_rig, put_tool
from inclinometry.laboratory.session import open_session
from inclinometry.laboratory.web.pages.calibrate.show_progress import folded

NAMES = (
    "capture", "automatic", "next", "finish", "abandon", "target", "progress", "position-1", "position-12", "events",
    "judged-by", "sound", "large",
)  # fmt: skip
SERIAL = "<b>\"7'</b>"


@pytest.fixture(scope="module")
def session(open_server):
    """A session of a tool with an awkward serial number."""
    sd = float(np.radians(0.1))
    with create(open_server.ledger) as ledger:
        put_tool(ledger, RegisteredTool(SERIAL, "tool"), author="anna")
        put_rig(ledger, RegisteredRig("stand", (sd, sd, sd)), author="anna")
        return open_session(ledger, SERIAL, plans.twelve(), rig="stand", author="anna").id


def test_the_bench_page_has_its_named_parts(open_server, session):
    with open_server.client() as client:
        answer = client.get(f"/calibrate/{session}")
        assert answer.status_code == 200
        for name in NAMES:
            assert re.search(rf"data-testid\W+{name}\b", answer.text), name
        assert SERIAL not in answer.text
        for asset in ("bench.js", "bench.css"):
            assert client.get(f"/static/{asset}").status_code == 200


def test_an_unknown_session_is_not_found(open_server):
    with open_server.client() as client:
        assert client.get(f"/calibrate/{'0' * 32}").status_code == 404


def test_the_form_offers_what_is_registered(open_server, session):
    with open_server.client() as client:
        text = client.get("/calibrate").text
    assert "stand" in text
    assert "Dip of the magnetic field" in text
    assert SERIAL not in text
    for name in ("inclination_from", "azimuth_counts", "toolface_counts", "plan-size", "form-problem"):
        assert re.search(rf"data-testid\W+{name}\b", text), name
    assert "24 positions, about 24 min" in text
    assert "Latitude of the stand" in text


def test_events_in_a_row_are_folded():
    events = [InstrumentEvent(float(i), kind, kind) for i, kind in enumerate(["connected", *["garbage"] * 40, "gap"])]
    assert [(e.kind, n) for e, n in folded(tuple(events))] == [("gap", 1), ("garbage", 40), ("connected", 1)]
    assert len(folded(tuple(InstrumentEvent(0.0, str(i), "") for i in range(9)))) == 5
