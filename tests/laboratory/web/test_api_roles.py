"""Every route and page for every role: who may, who is refused, who must log in."""

from __future__ import annotations

import pytest

ROLES = ("auditor", "operator", "metrologist", "administrator")
ID = "0" * 32
READ, CAPTURE, ISSUE, ADMINISTER = (frozenset(ROLES[i:]) for i in range(4))

ROUTES = {
    ("get", "/api/v1/me"): READ,
    ("post", "/api/v1/logout"): READ,
    ("put", "/api/v1/me/password"): READ,
    ("put", "/api/v1/me/second-factor"): READ,
    ("post", "/api/v1/me/second-factor/remove"): READ,
    ("get", "/api/v1/me/logins"): READ,
    ("delete", "/api/v1/me/logins/{login}"): READ,
    ("get", "/api/v1/logins"): ADMINISTER,
    ("delete", "/api/v1/logins/{login}"): ADMINISTER,
    ("delete", "/api/v1/users/{name}/second-factor"): ADMINISTER,
    ("get", "/api/v1/users"): ADMINISTER,
    ("put", "/api/v1/users/{name}"): ADMINISTER,
    ("get", "/api/v1/tools"): READ,
    ("get", "/api/v1/tools/{serial}"): READ,
    ("put", "/api/v1/tools/{serial}"): CAPTURE,
    ("get", "/api/v1/tools/{serial}/history"): READ,
    ("get", "/api/v1/rigs"): READ,
    ("put", "/api/v1/rigs/{name}"): CAPTURE,
    ("get", "/api/v1/sites"): READ,
    ("put", "/api/v1/sites/{name}"): CAPTURE,
    ("get", "/api/v1/standards"): READ,
    ("put", "/api/v1/standards/{name}"): ISSUE,
    ("get", "/api/v1/laboratory"): READ,
    ("put", "/api/v1/laboratory"): ADMINISTER,
    ("get", "/api/v1/sessions"): READ,
    ("post", "/api/v1/sessions"): CAPTURE,
    ("get", "/api/v1/sessions/{session}"): READ,
    ("get", "/api/v1/sessions/{session}/progress"): READ,
    ("post", "/api/v1/sessions/{session}/readings/{number}"): CAPTURE,
    ("post", "/api/v1/sessions/{session}/readings/{number}/reject"): CAPTURE,
    ("post", "/api/v1/sessions/{session}/capture/{number}"): CAPTURE,
    ("post", "/api/v1/sessions/{session}/finish"): CAPTURE,
    ("post", "/api/v1/sessions/{session}/abandon"): CAPTURE,
    ("post", "/api/v1/sessions/{session}/verdict"): CAPTURE,
    ("get", "/api/v1/live"): READ,
    ("get", "/api/v1/calibrations"): READ,
    ("get", "/api/v1/calibrations/{calibration}"): READ,
    ("get", "/api/v1/verifications"): READ,
    ("get", "/api/v1/limits"): READ,
    ("get", "/api/v1/protocols"): READ,
    ("get", "/api/v1/certificates"): READ,
    ("post", "/api/v1/certificates"): ISSUE,
    ("get", "/api/v1/certificates/{number}"): READ,
    ("get", "/api/v1/certificates/{number}/{document}"): READ,
    ("post", "/api/v1/certificates/{number}/void"): ISSUE,
    ("post", "/api/v1/certificates/{number}/supersede"): ISSUE,
    ("get", "/api/v1/ledger/head"): READ,
    ("get", "/api/v1/ledger/verify"): READ,
    ("get", "/api/v1/ledger/records/{kind}"): READ,
    ("get", "/api/v1/ledger/export"): ADMINISTER,
    ("get", "/api/v1/ledger/backup"): ADMINISTER,
    ("get", "/api/v1/tables/tools.csv"): READ,
    ("get", "/api/v1/tables/history.csv"): READ,
    ("get", "/api/v1/tables/verification/{verification}.csv"): READ,
}
PAGES = {
    "/": READ,
    "/tools": READ,
    "/tools/none": READ,
    "/calibrate": CAPTURE,
    f"/calibrate/{ID}": CAPTURE,
    f"/results/{ID}": READ,
    "/verify": READ,
    "/certificates": READ,
    "/ledger": READ,
    "/rigs": READ,
    "/sites": READ,
    "/standards": READ,
    "/laboratory": ADMINISTER,
    "/help": READ,
    "/users": ADMINISTER,
    "/account": READ,
    "/api": READ,
}


@pytest.fixture(scope="module")
def described(users_server):
    with users_server.program("auditor") as program:
        return program.get("/api/openapi.json").json()


def test_the_table_has_every_route(described):
    found = {(method, path) for path, methods in described["paths"].items() for method in methods}
    assert found - {("post", "/api/v1/login")} == set(ROUTES)


def test_every_route_says_what_it_does(described):
    for path, methods in described["paths"].items():
        for method, about in methods.items():
            assert len(about["description"]) > 5, (method, path)
            assert {"401", "403", "422"} <= set(about["responses"]), (method, path)


@pytest.mark.parametrize(("method", "path"), ROUTES, ids=str)
def test_each_route_for_each_role(users_server, method, path):
    if path.endswith("/logout"):
        return  # it would end the logins of the others; see test_logins
    values = {
        "name": "x y",
        "serial": "none",
        "session": ID,
        "number": "1",
        "calibration": ID,
        "verification": ID,
        "kind": "event",
        "login": "0" * 16,
    }
    where = path.format(**values, document="pdf")
    # a body that fits nothing: whoever may call the route is told so, whoever may not is refused before it is looked at
    body = None if method == "get" else {"surplus": 1}
    with users_server.client() as stranger:
        assert stranger.request(method, where, json=body).status_code == 401
    for role in ROLES:
        with users_server.program(role) as program:
            answer = program.request(method, where, json=body)
        if role in ROUTES[method, path]:
            assert answer.status_code in (200, 404, 409, 422), (role, answer.text)
        else:
            assert answer.status_code == 403, (role, answer.text)
            assert role in answer.json()["detail"]


@pytest.mark.long
@pytest.mark.parametrize("path", PAGES)
def test_each_page_for_each_role(users_server, path):
    with users_server.client() as stranger:
        answer = stranger.get(path)
        assert (answer.status_code, answer.headers["location"]) == (303, "/login")
    for role in ROLES:
        with users_server.program(role) as browser:
            answer = browser.get(path)
        assert answer.status_code in ((200, 404) if role in PAGES[path] else (403,)), (role, answer.text[:300])


def test_an_operator_cannot_make_himself_anything_else(users_server):
    with users_server.program("operator") as program:
        wish = {"role": "administrator", "password": "marble otter violin cactus"}
        assert program.put("/api/v1/users/operator", json=wish).status_code == 403
        assert program.put("/api/v1/users/operator", json={**wish, "role": "x"}).status_code == 403
        assert program.get("/api/v1/me").json()["role"] == "operator"
        assert program.get("/api/v1/ledger/records/user").status_code == 422
        assert "argon2" not in program.get("/ledger?kind=user").text
