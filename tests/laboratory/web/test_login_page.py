"""Logging in over the network: cookies, guesses, logging out."""

from __future__ import annotations

import re

import pytest

PASSWORD = "adze jib fen quoit"


@pytest.fixture
def own(start):
    """A server of this test alone: guessing slows down every login from this computer."""
    with start("users") as server:
        yield server


def test_the_cookie_cannot_be_read_by_scripts_or_sent_by_other_sites(users_server):
    with users_server.client() as browser:
        answer = browser.post("/login", data={"name": "operator", "password": PASSWORD})
        assert (answer.status_code, answer.headers["location"]) == (303, "/")
        value, *flags = (part.strip() for part in answer.headers["set-cookie"].split(";"))
        assert value.startswith(f"inclinometry-{users_server.port}=")
        assert {"HttpOnly", "SameSite=Strict", "Path=/"} <= set(flags)
        assert "Domain" not in answer.headers["set-cookie"]
        assert browser.get("/").status_code == 200


def test_a_token_set_before_is_not_taken_over(users_server):
    with users_server.client() as browser:
        name = f"inclinometry-{users_server.port}"
        browser.cookies.set(name, "chosen-by-somebody-else", domain="127.0.0.1")
        answer = browser.post("/login", data={"name": "operator", "password": PASSWORD})
        first = re.match(f"{name}=([^;]+)", answer.headers["set-cookie"]).group(1)
        assert first != "chosen-by-somebody-else"
        again = browser.post("/login", data={"name": "auditor", "password": PASSWORD})
        assert first not in again.headers["set-cookie"]
    with users_server.client(Authorization=f"Bearer {first}") as old:
        assert old.get("/api/v1/me").status_code == 401  # the login before it has ended


def test_a_browser_changes_nothing_without_the_header(users_server):
    with users_server.client() as browser:
        browser.post("/login", data={"name": "operator", "password": PASSWORD})
        me = browser.get("/api/v1/me").json()
        assert browser.put("/api/v1/sites/x", json={}).status_code == 403
        assert browser.put("/api/v1/sites/x", json={}, headers={"X-CSRF-Token": me["csrf"]}).status_code == 200
        with users_server.program("metrologist") as other:
            stolen = other.get("/api/v1/me").json()["csrf"]
        assert browser.put("/api/v1/sites/x", json={}, headers={"X-CSRF-Token": stolen}).status_code == 403


def test_logging_out_ends_the_token(users_server):
    with users_server.client() as browser:
        token = browser.post("/api/v1/login", json={"name": "operator", "password": PASSWORD}).json()["token"]
        browser.headers["Authorization"] = f"Bearer {token}"
        assert browser.post("/api/v1/logout").status_code == 204
        answer = browser.get("/api/v1/me")
        assert (answer.status_code, answer.json()["code"]) == (401, "web-login-needed")


@pytest.mark.long
def test_a_password_changed_by_the_administrator_ends_the_login(own):
    import time

    with own.program("operator") as operator, own.program("administrator") as administrator:
        assert operator.get("/api/v1/me").status_code == 200
        wish = {"role": "operator", "password": "quiet granite harbour lamp"}
        assert administrator.put("/api/v1/users/operator", json=wish).status_code == 200
        until = time.monotonic() + 60.0
        while operator.get("/api/v1/me").status_code == 200 and time.monotonic() < until:
            time.sleep(0.2)
        assert operator.get("/api/v1/me").status_code == 401
        answer = administrator.put("/api/v1/users/administrator", json={"role": "auditor"})
        assert (answer.status_code, "last active" in answer.json()["detail"]) == (422, True)


def test_guessing_is_slowed_down_whatever_address_a_header_claims(own):
    statuses = []
    with own.client() as browser:
        for number in range(8):
            claims = {
                "X-Forwarded-For": f"10.0.0.{number}",
                "Forwarded": f"for=10.0.0.{number}",
                "X-Real-IP": "1.2.3.4",
            }
            answer = browser.post("/login", data={"name": f"n{number}", "password": "guess"}, headers=claims)
            statuses.append(answer.status_code)
        assert statuses == [401] * 5 + [429] * 3
        assert int(answer.headers["retry-after"]) >= 1
        told = browser.post("/api/v1/login", json={"name": "operator", "password": PASSWORD})
        assert (told.status_code, told.json()["code"]) == (429, "web-wait")


def test_wrong_names_and_wrong_passwords_look_alike(own):
    with own.client() as browser:
        pages = [
            browser.post("/login", data={"name": name, "password": "wrong"}).text for name in ("operator", "nobody")
        ]
        assert pages[0] == pages[1]
        assert "nobody" not in pages[1]


@pytest.mark.parametrize("data", [
    {}, {"name": "operator"}, {"name": "x" * 300, "password": "y"}, {"name": "a", "password": "p" * 300},
])  # fmt: skip
def test_a_form_that_is_not_filled_in(users_server, data):
    with users_server.client() as browser:
        answer = browser.post("/login", data=data)
    assert answer.status_code == 422
    assert "Traceback" not in answer.text
    assert "pppp" not in answer.text
