"""The pages of records: who may see them, that they answer, that what users write stays text."""

from __future__ import annotations

import base64
import csv
import io
import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from inclinometry import findings
from inclinometry.calibration.decision import Limits
from inclinometry.calibration.drift import SIXTY
from inclinometry.calibration.drift_alarm import Alarm
from inclinometry.calibration.drift_status import fleet_status
from inclinometry.cli import main
from inclinometry.findings import rule
from inclinometry.laboratory import drift
from inclinometry.laboratory.demonstration import half_way, reading
from inclinometry.laboratory.instruments.protocol_toml import read_protocol
from inclinometry.laboratory.instruments.simulated_instrument import SimulatedInstrument
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.ledger.verify import verify
from inclinometry.laboratory.registry import RegisteredSite, RegisteredTool, put_site, put_tool
from inclinometry.laboratory.session import capture
from inclinometry.laboratory.verification import begin_verification, finish_verification
from inclinometry.laboratory.web.words import LANGUAGES, say

SCRIPT = "<script>alert(1)</script>"
NAME = "=cmd|' /C calc'!A0"
CUSTOMER = "{{7*7}} \u202eecila"
LABORATORY = {"name": "Laboratory", "address": "a street", "country": "DE"}


def _filled(path: Path) -> SimpleNamespace:
    """A tool calibrated, verified, being verified; a tool whose texts are attacks."""
    instrument = SimulatedInstrument(read_protocol("csv-line"), seed=1)
    with Ledger(path) as ledger:
        half_way(ledger, instrument)
        put_site(ledger, RegisteredSite("demonstration", laboratory=LABORATORY), author="anna")
        tool = RegisteredTool(SCRIPT, NAME, customer=CUSTOMER, description="@SUM(1)", interval_months=12)
        put_tool(ledger, tool, author="<b>anna</b>")
        calibration = ledger.find("calibration", serial="DEMO-1", limit=1)[0].id
        done, under_way = (
            begin_verification(ledger, calibration, "roll-8", author="anna", limits=limits)
            for limits in (None, Limits("customer-7", "contract 7", 0.01, 0.05, 0.01))
        )
        for session, number in ((done, 8), (under_way, 5)):
            for position in session.positions[:number]:
                capture(ledger, session.id, position.number, reading(instrument, position.dial), author="anna")
        verification = finish_verification(ledger, done.id, calibration, author="anna").id
    return SimpleNamespace(
        calibration=calibration, verification=verification, done=done.id, under_way=under_way.id, serial="DEMO-1"
    )


@pytest.fixture(scope="module")
def open_bench(open_server) -> SimpleNamespace:
    """A bench on loopback with records."""
    ids = _filled(open_server.ledger)
    with open_server.local() as browser:
        yield SimpleNamespace(**vars(ids), browser=browser, server=open_server)


@pytest.fixture(scope="module")
def users_bench(users_server) -> SimpleNamespace:
    """A bench whose users log in, with records."""
    return SimpleNamespace(**vars(_filled(users_server.ledger)), server=users_server)


def _pages(bench: SimpleNamespace) -> tuple[str, ...]:
    return (
        "/", "/tools", "/tools?after=A", f"/tools/{bench.serial}", "/tools/%3Cscript%3Ealert(1)%3C%2Fscript%3E",
        f"/results/{bench.calibration}", "/verify", f"/verify?calibration={bench.calibration}",
        f"/verify/{bench.under_way}/finish", f"/verify/{bench.done}/finish", f"/verifications/{bench.verification}",
        "/certificates", "/certificates/new", f"/certificates/new?calibration={bench.calibration}", "/ledger",
        "/ledger?kind=tool", "/ledger?kind=calibration&before=3", f"/ledger?kind=calibration&key={bench.calibration}",
        "/import", "/rigs", "/rigs?name=simulated%20stand", "/sites", "/standards", "/laboratory", "/help",
        "/manual/", "/users",
    )  # fmt: skip


def test_every_page_answers_and_shows_texts_as_texts(open_bench: SimpleNamespace) -> None:
    """No page holds a user's text as markup; the pages of tools and of the ledger show it."""
    for page in _pages(open_bench):
        answer = open_bench.browser.get(page, follow_redirects=True)
        assert answer.status_code == 200, (page, answer.text[:300])
        assert SCRIPT not in answer.text, page
        assert "<b>anna" not in answer.text, page
    for page in ("/tools", "/ledger?kind=tool", "/"):
        assert "&lt;script&gt;alert(1)" in open_bench.browser.get(page).text, page
    assert "\u202e" not in open_bench.browser.get("/tools").text
    assert "{{7*7}}" in open_bench.browser.get("/tools").text


def test_each_language_has_its_pages(open_bench: SimpleNamespace) -> None:
    """The cookie chooses."""
    for language in LANGUAGES:
        headers = {"cookie": f"inclinometry_language={language}"}
        answer = open_bench.browser.get(f"/verifications/{open_bench.verification}", headers=headers)
        assert say(language, "verify.positions") in answer.text


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("/tools/..%2F..%2Fnobody", 404), ("/tools/nobody", 404), ("/rigs?name=nobody", 404),
        ("/manual/../../../etc/passwd", 404), ("/results/none", 404), ("/verifications/..%2F..%2Fx", 404),
        ("/verify/none/finish", 404), ("/certificates/..%2Fx", 404), ("/certificates/none", 404),
        ("/api/v1/certificates/none/pdf", 404), ("/api/v1/certificates/..%2F..%2Fetc/pdf", 404),
        ("/api/v1/certificates/none/exe", 422), ("/api/v1/tables/verification/none.csv", 422),
        ("/ledger?before=x", 422),
    ],
)  # fmt: skip
def test_what_is_not_there_is_said(open_bench: SimpleNamespace, path: str, status: int) -> None:
    """No path leads out of the ledger."""
    assert open_bench.browser.get(path).status_code == status


def test_a_line_of_the_ledger_is_short_enough_to_be_read(open_bench: SimpleNamespace) -> None:
    """A session by its first characters."""
    text = open_bench.browser.get("/ledger", headers={"accept-language": "en"}).text
    assert re.search(rf"session, {open_bench.done[:8]}(…|\\u2026), finished", text)
    assert f"session, {open_bench.done}" not in text


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(
    "path", ["/nowhere", "/tools/7", "/rigs?name=7", "/results/7", "/certificates/7", "/ledger?before=x"]
)
def test_a_page_that_is_not_there_says_so_in_the_language_of_the_visitor(open_bench, path, language):
    """A sentence and a way back, without numbers of the network's protocol and words of its programs."""
    text = open_bench.browser.get(path, headers={"accept-language": language}).text
    assert f'<html lang="{language}">' in text
    said = re.sub(r"<[^>]*>|/\S+|lab\.sqlite", " ", text.partition("<main")[2].partition(">")[2])
    assert not re.search(r"\b4\d\d\b|integer|string|query", said), said
    if language != "en":
        assert not re.search("[A-Za-z]{3,}", said), said


def test_tables_hold_no_formulas(open_bench: SimpleNamespace) -> None:
    """A text a spreadsheet would calculate begins with an apostrophe; numbers stay numbers."""
    answer = open_bench.browser.get("/api/v1/tables/tools.csv")
    rows = list(csv.reader(io.StringIO(answer.content.decode("utf-8-sig"))))
    attack = next(row for row in rows if row[0] == SCRIPT)
    assert attack[1] == f"'{NAME}"
    assert not any(cell.startswith(("=", "@", "+")) for row in rows for cell in row)
    answer = open_bench.browser.get(f"/api/v1/tables/verification/{open_bench.verification}.csv")
    head, *positions = csv.reader(io.StringIO(answer.content.decode("utf-8-sig")))
    errors = [float(row[head.index("inclination_error_deg")]) for row in positions]
    assert len(errors) == 8
    assert min(errors) < 0.0 < max(errors)
    answer = open_bench.browser.get("/api/v1/tables/history.csv", params={"serial": "DEMO-1"})
    assert "accelerometer.offset[0]" in answer.text


def test_verdict_before_and_after_it_is_recorded(open_bench: SimpleNamespace) -> None:
    """A session under way is judged so far; a closed one leads to what was recorded."""
    browser = open_bench.browser
    text = browser.get(f"/verify/{open_bench.under_way}/finish").text
    # five of eight positions: no verdict, none to record
    assert say("en", "verdict.incomplete") in text
    assert say("en", "verify.record") not in text
    assert "No valid reading at positions 6, 7, 8." in text
    assert "customer-7" in text
    assert say("en", "verify.closed") in browser.get(f"/verify/{open_bench.done}/finish").text
    text = browser.get(f"/verifications/{open_bench.verification}").text
    assert say("en", "verdict.agrees") in text
    assert say("en", "verdict.pass") not in text


def test_the_guide_is_shown_until_a_session_is_there(tmp_path: Path, start: Any) -> None:
    """What there is already is ticked; who has put it away does not see it again."""
    with start("open") as server, server.local() as browser:
        assert say("en", "guide.title") in browser.get("/").text
        assert "✓" not in browser.get("/").text
        assert browser.put("/api/v1/tools/IN-7", json={"name": "tool"}).status_code == 200
        assert "✓" in browser.get("/").text
        away = browser.get("/", headers={"cookie": "inclinometry_guide=off"}).text
        assert say("en", "guide.title") not in away
        assert browser.put("/api/v1/rigs/stand", json={"sd_deg": [0.1, 0.1, 0.1]}).status_code == 200
        order = {"serial": "IN-7", "rig": "stand", "plan": "twelve"}
        assert browser.post("/api/v1/sessions", json=order).status_code == 201
        text = browser.get("/").text
        assert say("en", "guide.title") not in text
        # two sessions of one tool are told apart
        assert re.search(r"\d{4}-\d\d-\d\d \d\d:\d\d UTC · local", text)


@pytest.mark.long
def test_what_the_drift_says_of_tools_in_each_language(tmp_path: Path, start: Any) -> None:
    """Due date, alarm and check of six positions on the first page and the tool's; its plot by the days of measurement.

    The calibrations of a simulated fleet are recorded today and were made years ago.
    """
    with pytest.raises(SystemExit, match="0"):
        main(
            ["simulate", "fleet", "--tools=3", "--calibrations=3", "--runs=1", "--samples=200", "-o", f"{tmp_path}/sim"]
        )
    (tmp_path / "sim/lab.sqlite").rename(tmp_path / "ledger.sqlite")
    with Ledger(tmp_path / "ledger.sqlite") as ledger:
        found = fleet_status(
            drift.ledger_histories(ledger)[0]["simulated"], reproducibility=False, own_drift=False, iterations=2
        )
        first, *others = found.tools
        alarm = Alarm(True, "package turned about z", 2e-3, 1e-4, 30.0, 16.0, 1e-5)
        status = replace(found, tools=[replace(first, alarms=[alarm]), *(replace(one, alarms=[]) for one in others)])
        drift.put_fit(ledger, status, author="anna")
    alarmed, sound = first.history, others[0]
    with start("open") as server, server.local() as browser:
        for language in LANGUAGES:
            headers = {"cookie": f"inclinometry_language={language}"}
            home = browser.get("/", headers=headers).text
            assert say(language, "home.alarms") in home
            assert f"{alarmed.serial}: {findings.say(alarm.finding, language)}" in home
            page = browser.get(f"/tools/{alarmed.serial}", headers=headers).text
            assert say(language, "tools.alarm", sentence=findings.say(alarm.finding, language)) in page
            plotted = re.search(r'"type":\s*"category".*?"data":\s*(\[.*?\])', page.replace("&quot;", '"'))
            assert json.loads(plotted[1]) == [day.isoformat() for day in alarmed.date]
            page = browser.get(f"/tools/{sound.history.serial}", headers=headers).text
            assert say(language, "tools.due_by_drift", day=sound.due.date.isoformat()) in page
            six, now = (f"{np.degrees(u[SIXTY]):.3f}" for u in (sound.checked, sound.now))
            assert say(language, "tools.six", six=six, now=now) in page


def test_the_laboratory_over_rest(open_bench: SimpleNamespace) -> None:
    """Recorded, read again; a logo stays until an empty one removes it; what is none is refused in a sentence."""
    browser = open_bench.browser
    svg = base64.b64encode(b'<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"/>').decode()
    about = {"name": "Hall", "country": "DE", "accreditation": "D-K-1"}
    assert browser.put("/api/v1/laboratory", json={**about, "logo_base64": svg}).status_code == 200
    assert browser.put("/api/v1/laboratory", json=about).status_code == 200
    assert browser.get("/api/v1/laboratory").json() == {
        "laboratory": about,
        "logo": {"media_type": "image/svg+xml", "bytes": 62},
    }
    assert "data:image/svg+xml;base64" in browser.get("/laboratory").text
    assert browser.put("/api/v1/laboratory", json={**about, "logo_base64": ""}).status_code == 200
    assert browser.get("/api/v1/laboratory").json()["logo"] is None
    for wrong in ({**about, "logo_base64": "%"}, {**about, "logo_base64": "R0lG"}, {**about, "country": "de"}, {}):
        assert browser.put("/api/v1/laboratory", json=wrong).status_code == 422, wrong
    assert browser.put("/api/v1/standards/T2", json={"certificate": "D-17", "due": "2020-01-31"}).status_code == 200
    assert browser.get("/api/v1/standards").json()[0]["due"] == "2020-01-31"
    assert say("en", "standards.overdue") in browser.get("/standards").text
    assert browser.put("/api/v1/standards/T2", json={"due": "tomorrow"}).status_code == 422


@pytest.mark.long
def test_a_certificate_over_rest_names_who_answers(open_bench: SimpleNamespace) -> None:
    """Without a laboratory in the body that of the site is taken, and the caller answers for it."""
    browser = open_bench.browser
    wish = {"calibration": open_bench.calibration, "verification": open_bench.verification}
    wish["accept_warnings"] = "the field points down"
    answer = browser.post("/api/v1/certificates", json=wish)
    assert answer.status_code == 201, answer.text
    content = browser.get(f"/api/v1/certificates/{answer.json()['number']}/json").json()
    assert content["laboratory"]["name"] == LABORATORY["name"]
    assert content["laboratory"]["authoriser"]
    assert content["verification"]["report"]["protocol"] == {"name": "roll-8", "positions_captured": 8, "positions": 8}


def test_forms_are_only_shown_to_those_who_may(users_bench: SimpleNamespace) -> None:
    """An auditor reads."""
    with users_bench.server.program("auditor") as browser:
        assert say("en", "verify.go") not in browser.get("/verify").text
        assert say("en", "verify.record") not in browser.get(f"/verify/{users_bench.under_way}/finish").text
        assert say("en", "tools.register") not in browser.get("/tools").text
    with users_bench.server.program("operator") as browser:
        assert say("en", "verify.go") in browser.get("/verify").text


def test_a_certificate_from_issue_to_void(users_bench: SimpleNamespace) -> None:
    """Issued by a metrologist only, downloaded by anybody, superseded, declared void with a reason; never twice."""
    wish = {"calibration": users_bench.calibration, "about": {"customer": SCRIPT, "environment": NAME}}
    server = users_bench.server
    for role in ("auditor", "operator"):
        with server.program(role) as browser:
            assert browser.post("/api/v1/certificates", json=wish).status_code == 403
    with server.program("metrologist") as browser:
        refused = browser.post("/api/v1/certificates", json=wish)
        doubt = rule("bench-sign-assumed").says[0].partition("{")[0]
        assert (refused.status_code, doubt in refused.text) == (422, True)
        form = browser.get(f"/certificates/new?calibration={users_bench.calibration}").text
        assert say("en", "results.open") in form
        assert doubt in form
        wish["accept_warnings"] = "the field points down"
        first = browser.post("/api/v1/certificates", json=wish)
        assert first.status_code == 201, first.text
        number = first.json()["number"]
        assert browser.post("/api/v1/certificates", json=wish).status_code == 422
        again = browser.post(f"/api/v1/certificates/{number}/supersede", json={**wish, "reason": "wrong name"})
        assert again.status_code == 201, again.text
        second = again.json()["number"]
        assert browser.get(f"/api/v1/certificates/{number}").json()["by"] == second
        for name, start in (("pdf", b"%PDF"), ("dcc", b"<?xml"), ("json", b"{")):
            answer = browser.get(f"/api/v1/certificates/{second}/{name}")
            assert answer.content.startswith(start)
            assert re.fullmatch(r"attachment; filename\*=UTF-8''[\w.-]+", answer.headers["content-disposition"])
        page = browser.get(f"/certificates/{second}")
        assert SCRIPT not in page.text
        assert say("en", "certificates.void") in page.text
    with server.program("operator") as browser:
        assert browser.post(f"/api/v1/certificates/{second}/void", json={"reason": "x"}).status_code == 403
        assert say("en", "certificates.void") not in browser.get(f"/certificates/{second}").text
    with server.program("metrologist") as browser:
        assert browser.post(f"/api/v1/certificates/{second}/void", json={"reason": " "}).status_code == 422
        assert browser.post(f"/api/v1/certificates/{second}/void", json={"reason": SCRIPT}).json()["state"] == "void"
        assert browser.post(f"/api/v1/certificates/{second}/void", json={"reason": "tool dropped"}).status_code == 422
        assert SCRIPT not in browser.get(f"/certificates/{second}").text
        assert [one["state"] for one in browser.get("/api/v1/certificates").json()][:2] == ["void", "superseded"]


def test_a_backup_is_a_ledger(users_bench: SimpleNamespace, tmp_path: Path) -> None:
    """What is downloaded is opened and verified."""
    with users_bench.server.program("administrator") as browser:
        (tmp_path / "copy.sqlite").write_bytes(browser.get("/api/v1/ledger/backup").content)
    with Ledger(tmp_path / "copy.sqlite", read_only=True) as ledger:
        assert verify(ledger).ok
        assert ledger.count("verification") == 1
