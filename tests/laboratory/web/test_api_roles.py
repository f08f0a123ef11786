"""Every route and page for every role: who may, who is refused, who must log in."""

from __future__ import annotations

import pytest

ROLES = ("auditor", "operator", "metrologist", "administrator")
ID = "0" * 32
READ, CAPTURE, ISSUE, ADMINISTER = (frozenset(ROLES[i:]) for i in range(4))

BY_ROLE = (
    (
        READ, "get",
        "/me /me/logins /tools /tools/{serial} /tools/{serial}/history /rigs /sites /standards /laboratory "
        "/sessions /sessions/{session} /sessions/{session}/progress /live /calibrations "
        "/calibrations/{calibration} /verifications /limits /protocols /certificates /certificates/{number} "
        "/certificates/{number}/{document} /ledger/head /ledger/verify /ledger/records/{kind} /tables/tools.csv "
        "/tables/history.csv /tables/verification/{verification}.csv",
    ),
    (READ, "post", "/logout /me/second-factor/remove"),
    (READ, "put", "/me/password /me/second-factor"),
    (READ, "delete", "/me/logins/{login}"),
    (ADMINISTER, "get", "/logins /users /ledger/export /ledger/backup"),
    (ADMINISTER, "delete", "/logins/{login} /users/{name}/second-factor"),
    (ADMINISTER, "put", "/users/{name} /laboratory"),
    (CAPTURE, "put", "/tools/{serial} /rigs/{name} /sites/{name}"),
    (ISSUE, "put", "/standards/{name}"),
    (
        CAPTURE, "post",
        "/sessions /sessions/{session}/readings/{number} /sessions/{session}/readings/{number}/reject "
        "/sessions/{session}/capture/{number} /sessions/{session}/finish /sessions/{session}/evaluate "
        "/sessions/{session}/abandon /sessions/{session}/verdict /verifications",
    ),
    (ISSUE, "post", "/certificates /certificates/{number}/void /certificates/{number}/supersede"),
)  # fmt: skip
"""Who may, method, paths below /api/v1."""
ROUTES = {(method, f"/api/v1{path}"): may for may, method, paths in BY_ROLE for path in paths.split()}
OPEN = f"/ /tools /tools/none /results/{ID} /verify /certificates /ledger /rigs /sites /standards /help /account /api"
PAGES = dict.fromkeys(OPEN.split(), READ) | {"/certificates/new": ISSUE}
PAGES |= dict.fromkeys(("/laboratory", "/users"), ADMINISTER)
PAGES |= dict.fromkeys(("/calibrate", f"/calibrate/{ID}", "/import"), CAPTURE)


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
    values = dict.fromkeys(("session", "calibration", "verification"), ID) | {"login": ID[:16]}
    values |= {"name": "x y", "serial": "none", "number": "1", "kind": "event"}
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
