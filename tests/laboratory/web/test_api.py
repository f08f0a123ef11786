"""The REST interface: a run of positions, refusals that say what to do, and text that stays text."""

from __future__ import annotations

import json

import numpy as np
import pytest

from inclinometry.laboratory.ledger.keys import FOLDER, Keys
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import realistic_tool

UNKNOWN = "0" * 32
NASTY = (
    "<script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "=cmd|' /C calc'!A0", "{{7*7}} ${7*7} %s {0}",
    "'; DROP TABLE tool; --", "../../etc/passwd", "%2e%2e%2f", "a/b", "a?b#c", "Ünïcödé 工具 Прибор",
    "x" * 200, "\\", ".", "..",
)  # fmt: skip
JSON = {"Content-Type": "application/json"}


@pytest.fixture(scope="module")
def api(open_server):
    with open_server.local() as browser:
        assert browser.put("/api/v1/rigs/stand", json={"sd_deg": [0.1, 0.1, 0.1]}).status_code == 200
        assert browser.put("/api/v1/tools/T", json={"name": "tool"}).status_code == 200
        yield browser


@pytest.fixture
def session(api):
    return api.post("/api/v1/sessions", json={"serial": "T", "rig": "stand", "plan": "twelve"}).json()["id"]


def reading(attempt=1, **more):
    channels = {"accelerometer": [0.0, 0.0, 9.8], "magnetometer": [2e4, 0.0, 4e4]}
    return {"attempt": attempt, "dial_deg": [0, 0, 0], "channels": channels, **more}


def quoted(text):
    from urllib.parse import quote

    return quote(text, safe="")


def test_a_run_is_opened_captured_and_left(api, session):
    for number in range(1, 4):
        answer = api.post(f"/api/v1/sessions/{session}/readings/{number}", json=reading())
        assert (answer.status_code, answer.json()["number"]) == (201, number)
    assert [p["done"] for p in api.get(f"/api/v1/sessions/{session}").json()["positions"][:4]] == [True] * 3 + [False]
    refused = api.post(f"/api/v1/sessions/{session}/readings/2/reject", json={"reason": "bumped"})
    assert refused.json()["readings"][1]["rejected"] == "bumped"
    assert api.get(f"/api/v1/sessions/{session}/progress").json()["captured"] == 2
    assert api.post(f"/api/v1/sessions/{session}/abandon", json={"reason": "test"}).status_code == 204
    late = api.post(f"/api/v1/sessions/{session}/readings/2", json=reading(2))
    assert (late.status_code, late.json()["code"]) == (422, "session-closed")


def test_a_session_at_a_site_that_is_not_registered_is_refused(api):
    wish = {"serial": "T", "rig": "stand", "plan": "twelve"}
    refused = api.post("/api/v1/sessions", json=wish | {"site": "nowhere"})
    assert refused.status_code == 422
    assert refused.json()["code"] == "session-not-registered"
    assert api.put("/api/v1/sites/known", json={"dip_deg": 70}).status_code == 200
    assert api.post("/api/v1/sessions", json=wish | {"site": "known"}).status_code == 201


def seen_at(dial_deg, number, off_deg=0.0):
    """What a tool on the stand says at a setting, its toolface off by so much."""
    azimuth, inclination, toolface = ([x] for x in np.radians(dial_deg))
    sd = float(np.radians(0.1))
    run = simulate_bench(
        realistic_tool(7), Rig(dip=np.radians(70.0), setting_sd=(sd, sd, sd)), azimuth, inclination,
        [toolface[0] + np.radians(off_deg)], seed=np.random.SeedSequence([5, number]),
    )  # fmt: skip
    return {kind: values[0].tolist() for kind, values in run.signals.items()}


def opened(api, serial):
    """A session of twelve positions of a new tool, and where it is."""
    assert api.put(f"/api/v1/tools/{serial}", json={"name": "tool"}).status_code == 200
    made = api.post("/api/v1/sessions", json={"serial": serial, "rig": "stand", "plan": "twelve"}).json()
    return made, f"/api/v1/sessions/{made['id']}"


def calibrated(api, serial):
    """Where a session is whose positions have all been taken, and the calibration that it ended with."""
    made, where = opened(api, serial)
    for position in made["positions"]:
        channels = seen_at(position["dial_deg"], position["number"])
        said = {"attempt": 1, "dial_deg": position["dial_deg"], "channels": channels}
        assert api.post(f"{where}/readings/{position['number']}", json=said).status_code == 201
    finished = api.post(f"{where}/finish")
    assert finished.status_code == 201
    return where, finished.json()


def test_a_reading_far_from_its_dials_needs_a_reason(api):
    """By the tool's calibration of before."""
    calibrated(api, "FAR")
    made, where = opened(api, "FAR")
    dial = made["positions"][4]["dial_deg"]
    said = {"attempt": 1, "dial_deg": dial, "channels": seen_at(dial, 99, 40.0)}
    for reason in ({}, {"reason": "  "}, {"reason": "-"}, {"reason": "n/a"}):
        refused = api.post(f"{where}/readings/5", json=said | reason)
        assert (refused.status_code, refused.json()["code"]) == (409, "ledger-far-from-target")
        (off,) = refused.json()["values"]["dials"]
        assert (off["values"]["dial"], off["values"]["target_deg"]) == ("toolface", 120.0)
    assert api.get(where).json()["readings"] == []
    taken = api.post(f"{where}/readings/5", json=said | {"reason": "a new collet"})
    assert taken.status_code == 201
    assert taken.json()["note"].endswith("target 120.0 deg: a new collet")
    right = said | {"channels": seen_at(dial, 98), "attempt": 2}
    assert api.post(f"{where}/readings/5", json=right).json()["note"] == ""


def test_an_open_warning_is_resolved_by_the_site(api):
    """The page of the result and that of the certificate lead there; the calibration before leads to the new one."""
    where, before = calibrated(api, "AGAIN")
    assert before["body"]["summary"]["findings"][0]["code"] == "bench-sign-assumed"
    go = "Set the site and evaluate again"
    assert f"/results/{before['id']}#site" in api.get(f"/certificates/new?calibration={before['id']}").text
    assert go in api.get(f"/results/{before['id']}").text
    refused = api.post(f"{where}/evaluate", json={"site": "hall"})
    assert (refused.status_code, refused.json()["code"]) == (422, "session-not-registered")
    assert api.put("/api/v1/sites/hall", json={"dip_deg": 70.0}).status_code == 200
    answer = api.post(f"{where}/evaluate", json={"site": "hall", "reason": "measured"})
    assert answer.status_code == 201
    after = answer.json()
    assert after["body"]["summary"]["findings"] == []
    assert api.get("/api/v1/calibrations?serial=AGAIN").json()[0]["id"] == after["id"]
    assert api.get(where).json()["settings"]["site"] == "hall"
    assert f"/results/{after['id']}" in api.get(f"/results/{before['id']}").text
    assert f"/results/{before['id']}" in api.get(f"/results/{after['id']}").text
    assert go not in api.get(f"/certificates/new?calibration={after['id']}").text
    # a stand good to 0.1 deg cannot verify these limits: said before the first reading
    wish = {"calibration": after["id"], "protocol": "roll-4", "limits": "rogatykh-2018-fluxgate"}
    refused = api.post("/api/v1/verifications", json=wish)
    assert (refused.status_code, "limit" in refused.json()["detail"]) == (422, True), refused.text
    begun = api.post("/api/v1/verifications", json=wish | {"limits": None})
    assert (begun.status_code, begun.json()["purpose"]) == (201, "verify")


def test_a_repeated_request_is_noticed(api, session):
    where = f"/api/v1/sessions/{session}/readings/1"
    assert [api.post(where, json=reading()).status_code for _ in range(3)] == [201, 409, 409]
    assert api.post(where, json=reading(2)).status_code == 201
    assert api.post(where, json=reading(9)).status_code == 422
    assert len(api.get(f"/api/v1/sessions/{session}").json()["readings"]) == 1


@pytest.mark.parametrize(("method", "path", "body"), [
    ("get", "tools/none", None),
    ("get", f"sessions/{UNKNOWN}", None),
    ("get", f"sessions/{UNKNOWN}/progress", None),
    ("get", f"calibrations/{UNKNOWN}", None),
    ("get", "certificates/none", None),
    ("post", f"sessions/{UNKNOWN}/readings/1", reading()),
    ("post", f"sessions/{UNKNOWN}/finish", None),
    ("post", f"sessions/{UNKNOWN}/evaluate", {"site": "x"}),
    ("post", f"sessions/{UNKNOWN}/abandon", {"reason": "x"}),
    ("post", "certificates/none/void", {"reason": "x"}),
    ("get", "nothing", None),
    ("post", "tools/T/nothing", {}),
])  # fmt: skip
def test_what_is_not_there_is_404(api, method, path, body):
    answer = api.request(method, f"/api/v1/{path}", json=body)
    assert answer.status_code in (404, 405), answer.text
    assert isinstance(answer.json()["detail"], str)


@pytest.mark.parametrize(("method", "path", "allowed"), [
    ("delete", "/api/v1/tools", "GET"), ("post", "/api/v1/me", "GET"), ("put", "/api/v1/sessions", "GET, POST"),
    ("patch", "/api/v1/tools/T", "GET, PUT"), ("trace", "/api/v1/me", "GET"),
])  # fmt: skip
def test_wrong_methods_are_405_with_the_right_ones(api, method, path, allowed):
    answer = api.request(method, path)
    assert (answer.status_code, answer.headers["allow"]) == (405, allowed)
    assert answer.json()["values"]["allowed"] == allowed.split(", ")


@pytest.mark.parametrize(("body", "words"), [
    (b"", "Missing"),
    (b"{", "JSON"),
    (b"nonsense", "JSON"),
    (b"[]", "body"),
    (b"null", "body"),
    (b'{"sd_deg": [0.1, 0.1, NaN]}', "NaN"),
    (b'{"sd_deg": [0.1, 0.1, -Infinity]}', "Infinity"),
    (b'{"sd_deg": [0.1, 0.1, 1e999]}', "too large"),
    (b'{"sd_deg": [0.1, 0.1, 0.1], "sd_deg": [9, 9, 9]}', "twice"),
    (b'{"sd_deg": [0.1, 0.1, 0.1], "description": "\\ud800"}', "surrogate"),
    (b'{"sd_deg": [0.1, 0.1, 0.1], "surplus": 1}', "surplus"),
    (b'{"sd_deg": [0.1, 0.1]}', "sd_deg"),
    (b'{"sd_deg": ["a", 0.1, 0.1]}', "sd_deg"),
    (b'{"sd_deg": [0.1, 0.1, -1]}', "-"),
    (b'{"sd_deg": [0.1, 0.1, 1e300]}', "sd"),
    (b'{"sd_deg": [0.1, 0.1, ' + b"9" * 5000 + b"]}", ""),
    (b"[" * 100_000, ""),
    (b'{"a":' * 50_000, ""),
    (b"\xff\xfe\x00", ""),
    (b'{"sd_deg": [0.1, 0.1, 0.1], "description": "' + b"x" * 2001 + b'"}', "2000"),
])  # fmt: skip
def test_bodies_that_cannot_be_used(api, body, words):
    answer = api.put("/api/v1/rigs/bad", content=body, headers=JSON)
    assert answer.status_code in (400, 422), answer.text
    assert words.lower() in answer.json()["detail"].lower()
    assert len(answer.text) < 2000
    assert "bad" not in [rig["name"] for rig in api.get("/api/v1/rigs").json()]


def test_free_fields_are_read_as_strictly(api):
    for value in ("NaN", "1e999", '{"b":1,"b":2}', '"\\udfff"'):
        body = f'{{"name": "x", "triads": {{"accelerometer": {{"a": {value}}}}}}}'
        assert api.put("/api/v1/tools/strict", content=body, headers=JSON).status_code == 422
    assert api.get("/api/v1/tools/strict").status_code == 404


@pytest.mark.long
@pytest.mark.parametrize("text", NASTY)
def test_text_stays_text(api, text):
    put = api.put(f"/api/v1/tools/{quoted(text)}", json={"name": text, "customer": text, "description": text})
    if text in (".", ".."):
        return  # a client takes these out of the path before it asks
    assert put.status_code == 200, put.text
    back = api.get(f"/api/v1/tools/{quoted(text)}").json()
    assert (back["serial"], back["body"]["name"], back["body"]["customer"]) == (text, text, text)
    for page in ("/tools", "/calibrate", "/ledger?kind=tool", f"/ledger?kind=tool&key={quoted(text)}"):
        shown = api.get(page).text
        assert "<script>alert" not in shown
        assert "<img src=x" not in shown
        assert "7*7}} $" not in shown or "49" not in shown
    table = api.get("/api/v1/tables/tools.csv").text
    assert "\n=" not in table
    assert ",=" not in table


@pytest.mark.parametrize("serial", ["", " x", "x ", "a\nb", "a\x00b", "a\x1b[31m", "x" * 201, "\u202etxt", "\ufeffx"])
def test_names_that_nobody_could_read_are_refused(api, open_server, serial):
    answer = api.put(f"/api/v1/tools/{quoted(serial)}", json={"name": "x"})
    assert answer.status_code in (404, 405, 422), answer.text
    log = open_server.log.read_text()
    assert "\x1b[31m" not in log
    assert "\na\nb" not in log


def test_lists_are_given_in_parts(api):
    for number in range(5):
        api.put(f"/api/v1/tools/part{number}", json={"name": "x"})
    first = [t["serial"] for t in api.get("/api/v1/tools?after=part&limit=2").json()]
    then = [t["serial"] for t in api.get(f"/api/v1/tools?after={first[-1]}&limit=3").json()]
    assert first + then == [f"part{n}" for n in range(5)]
    for query in ("limit=0", "limit=1001", "limit=x", "limit=1e3", "after=" + "x" * 201):
        answer = api.get(f"/api/v1/tools?{query}")
        assert answer.status_code == 422
        assert query.partition("=")[0] in answer.json()["detail"]
    for query in ("after=-1", "after=99999999999999999999", "after=NaN"):
        assert api.get(f"/api/v1/ledger/records/event?{query}").status_code == 422


def test_no_file_of_the_server_is_named_by_a_request(api, session):
    body = {"calibration": UNKNOWN, "limits": "/etc/passwd"}
    answer = api.post(f"/api/v1/sessions/{session}/verdict", json=body)
    assert answer.status_code == 422
    assert "root:" not in answer.text


def test_private_answers_are_not_kept_and_say_nothing_of_the_inside(api, open_server):
    for path in ("me", "tools", "ledger/head", "nothing"):
        answer = api.get(f"/api/v1/{path}")
        assert answer.headers["cache-control"] == "no-store"
        assert answer.headers["content-type"].startswith("application/json")
    for path in (
        "/tools/none", "/results/x", "/calibrate/x", "/nothing", "/ledger?before=x", "/_nicegui/x", "/static/x",
    ):  # fmt: skip
        answer = api.get(path)
        assert answer.status_code in (404, 422), path
        assert "Traceback" not in answer.text
        assert "site-packages" not in answer.text
        assert "Error" not in answer.text.replace("NiceGUI", "")


def test_a_network_is_not_told_where_the_ledger_lies(users_server):
    with users_server.program("administrator") as program:
        for path in (f"/api/v1/sessions/{UNKNOWN}", f"/api/v1/calibrations/{UNKNOWN}", f"/results/{UNKNOWN}"):
            answer = program.get(path)
            assert answer.status_code == 404
            assert str(users_server.ledger.parent) not in answer.text


def test_the_description_needs_no_network(api):
    page = api.get("/api")
    assert "http://" not in page.text.replace("http://127.0.0.1", "")
    assert "https://" not in page.text
    for path in ("/docs", "/redoc", "/openapi.json"):
        assert api.get(path).status_code == 404
    assert len(json.dumps(api.get("/api/openapi.json").json()["paths"])) > 1000


def test_everything_in_one_file(api, open_server):
    answer = api.get("/api/v1/ledger/export")
    assert answer.headers["content-type"] == "application/zip"
    assert answer.content[:2] == b"PK"
    assert len(answer.content) == int(answer.headers["content-length"])


def test_a_body_with_a_name_that_is_not_known_is_refused(api):
    said = api.get("/api/openapi.json").json()
    bodies = {
        form["schema"]["$ref"].rpartition("/")[2]
        for path in said["paths"].values()
        for call in path.values()
        for form in call.get("requestBody", {}).get("content", {}).values()
        if "$ref" in form["schema"]
    }
    assert len(bodies) >= 20
    shapes = said["components"]["schemas"]
    assert [name for name in bodies if shapes[name].get("additionalProperties") is not False] == []


def test_a_rig_and_a_session_say_how_the_dials_count(api):
    body = {"sd_deg": [0.1, 0.1, 0.1], "inclination_from": "horizontal", "azimuth_counts": "counterclockwise"}
    stated = {"inclination_from": "horizontal", "azimuth_counts": "counterclockwise", "toolface_counts": "clockwise"}
    stated["base"] = "upright"
    assert api.put("/api/v1/rigs/odd", json=body).json()["body"]["dials"] == stated
    refused = api.put("/api/v1/rigs/odd", json={**body, "toolface_counts": "left"})
    assert refused.status_code == 422
    assert "toolface_counts" in refused.json()["detail"]
    asked = {"serial": "T", "rig": "odd", "plan": "twelve"}
    made = api.post("/api/v1/sessions", json=asked).json()
    usual = api.post("/api/v1/sessions", json={**asked, "rig": "stand"}).json()
    assert made["dials"] == stated
    for one, other in zip(made["positions"], usual["positions"], strict=True):
        azimuth, inclination, toolface = other["dial_deg"]
        assert one["dial_deg"] == pytest.approx([-azimuth % 360.0, 90.0 - inclination, toolface], abs=1e-6)
    schema = api.get("/api/openapi.json").json()["components"]["schemas"]
    assert schema["RigBody"]["properties"]["inclination_from"]["enum"][0] == "vertical"
    assert "latitude_deg" in schema["SiteBody"]["properties"]


def test_a_site_has_a_latitude(api):
    made = api.put("/api/v1/sites/equator", json={"latitude_deg": 0.0, "dip_deg": -20.0}).json()
    assert made["body"]["latitude_deg"] == 0.0
    assert api.put("/api/v1/sites/nowhere", json={"latitude_deg": 91.0}).status_code == 422


def test_a_head_of_another_key_is_not_handed_out(start, tmp_path, monkeypatch):
    """public.pem exchanged, or the ledger signed by another key: a fault by name, a refusal, nothing recorded."""
    keys = Keys(tmp_path / "keys")
    monkeypatch.setenv(FOLDER, str(keys.folder))
    with start("open") as server, server.local() as browser:
        assert browser.get("/api/v1/ledger/verify").json()["compared"] is True
        assert browser.get("/api/v1/ledger/head").json()["signed"]["key"] == keys.public()
        mine = (keys.path.read_bytes(), (keys.folder / "public.pem").read_bytes())
        Keys(tmp_path / "other").make()
        theirs = [(tmp_path / "other" / name).read_bytes() for name in ("key.pem", "public.pem")]
        for (private, public), fault, refusal in (
            ((mine[0], theirs[1]), "key-public-other", "key-public-other"),
            (theirs, "key-not-laboratory", "key-other"),
        ):
            keys.keep("key.pem", private, mode=0o600)
            keys.keep("public.pem", public, mode=0o644)
            found = browser.get("/api/v1/ledger/verify").json()
            assert (found["ok"], found["proven"]) == (False, False)
            assert fault in [one["code"] for one in found["faults"]]
            for answer in (
                browser.get("/api/v1/ledger/head"),
                browser.put("/api/v1/tools/T", json={"name": "tool"}),
            ):
                assert (answer.status_code, answer.json()["code"]) == (422, refusal)
