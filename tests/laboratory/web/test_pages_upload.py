"""Files uploaded on a page: what becomes of them, what is refused, and that the role is asked for again."""

from __future__ import annotations

import html
import re
import time
from collections.abc import Callable

import httpx
import pytest

from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.ledger.users import put_user
from inclinometry.laboratory.registry import RegisteredRig, RegisteredTool, put_rig, put_tool

PASSWORD = "adze jib fen quoit"
SERIAL = "UP-1"
BENCH = (
    b"station,azimuth_deg,inclination_deg,toolface_deg,accel_x,accel_y,accel_z,mag_x,mag_y,mag_z\n"
    b"=cmd(),0,0,0,1,2,3,4,5,6\n<b>B</b>,10,90,0,3,1,2,6,5,4\n"
)
FRESH_S = 2.5
"""After this long a changed role is known to the server."""


@pytest.fixture(scope="module")
def ledger(users_server) -> Ledger:
    """The ledger of the bench whose users log in, with a tool and a rig."""
    with Ledger(users_server.ledger) as opened:
        put_tool(opened, RegisteredTool(SERIAL, "tool"), author="test")
        put_rig(opened, RegisteredRig("stand", (0.001, 0.001, 0.001)), author="test")
        yield opened


def _place(browser: httpx.Client) -> str:
    """Where the page of this browser takes its file."""
    found = re.search(
        r"/_nicegui/client/[\w-]+/upload/\d+", html.unescape(browser.get(f"/import?serial={SERIAL}&rig=stand").text)
    )
    return found.group()


def _comes_true(what: Callable[[], bool], seconds: float = 60.0) -> bool:
    end = time.monotonic() + seconds
    while not what():
        if time.monotonic() > end:
            return False
        time.sleep(0.05)
    return True


def test_readings_are_recorded_whatever_the_file_is_called(users_server, ledger: Ledger) -> None:
    """The name leads nowhere and is kept nowhere."""
    with users_server.program("operator") as browser:
        answer = browser.post(_place(browser), files={"file": ("../../etc/cron.d/<script>.csv", BENCH)})
        assert answer.status_code == 200
    assert _comes_true(lambda: ledger.count("session", serial=SERIAL) == 1)
    session = ledger.find("session", serial=SERIAL)[0]
    assert session.author == "operator"
    assert _comes_true(lambda: ledger.count("reading", session=session.id) == 2)
    readings = ledger.find("reading", session=session.id)
    assert [one.body["captured"] for one in readings] == ["import"] * 2
    assert "cron" not in str(session.body) + str([one.body for one in readings])


def test_a_serial_that_is_not_registered_is_refused(users_server, ledger: Ledger) -> None:
    """Nothing is recorded under the first tool of the list."""
    before = ledger.head()
    with users_server.program("operator") as browser:
        page = html.unescape(browser.get("/import?serial=ZX-99").text)
        assert "ZX-99" in page
        place = re.search(r"/_nicegui/client/[\w-]+/upload/\d+", page)
        assert browser.post(place.group(), files={"file": ("x.csv", BENCH)}).status_code == 200
    time.sleep(0.5)
    assert ledger.head() == before


def test_what_is_too_large_or_no_run_is_refused(users_server, ledger: Ledger) -> None:
    """Refused before it is read; nothing is recorded of what cannot be."""
    before = ledger.head()
    with users_server.program("operator") as browser:
        place = _place(browser)
        assert browser.post(place, files={"file": ("big.csv", bytes(6_500_000))}).status_code == 413
        for content in (b"a,b\n1,2\n", b"{" * 100_000, b"PK\x03\x04"):
            assert browser.post(place, files={"file": ("x.csv", content)}).status_code == 200
        assert browser.post(place.replace("client/", "client/0"), files={"file": ("x", BENCH)}).status_code == 404
    with users_server.client() as stranger:
        assert stranger.post(place, files={"file": ("x.csv", BENCH)}).status_code in (303, 401)
    time.sleep(0.5)
    assert ledger.head() == before


@pytest.mark.long
def test_a_role_that_was_taken_away_counts_at_once(users_server, ledger: Ledger) -> None:
    """The page was opened by an operator; when the file comes he only reads."""
    put_user(ledger, "former", role="operator", author="test", password=PASSWORD)
    with users_server.client() as plain:
        token = plain.post("/api/v1/login", json={"name": "former", "password": PASSWORD}).json()["token"]
    with users_server.client(Authorization=f"Bearer {token}") as browser:
        place = _place(browser)
        put_user(ledger, "former", role="auditor", author="test")
        time.sleep(FRESH_S)
        before = ledger.head()
        assert browser.post(place, files={"file": ("x.csv", BENCH)}).status_code == 200
        assert browser.get("/import").status_code == 403
    time.sleep(0.5)
    assert ledger.head() == before
