"""A user's own account over the network: password, second factor, logins; what administrators do to others'."""

from __future__ import annotations

import re
import shutil
import socket
import ssl
import subprocess
import time
import warnings

import pytest

from inclinometry.laboratory.ledger.second_factor import code, new_secret, secret_bytes

PASSWORD, OTHER = "adze jib fen quoit", "quiet granite harbour lamp"


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    """One of these tests alone: they change passwords."""
    from .conftest import serving

    with serving(tmp_path_factory.mktemp("accounts"), "users") as made:
        yield made


@pytest.fixture
def user(server):
    """A new operator with a name of its own, and a program that has logged in with it."""
    name = f"user {time.monotonic_ns()}"
    with server.program("administrator") as administrator:
        wish = {"role": "operator", "password": PASSWORD}
        assert administrator.put(f"/api/v1/users/{name}", json=wish).status_code == 200
    with server.client(Authorization=f"Bearer {logged_in(server, name)}") as program:
        program.name = name
        yield program


def logged_in(server, name, password=PASSWORD, **more):
    with server.client() as plain:
        return plain.post("/api/v1/login", json={"name": name, "password": password, **more}).json().get("token")


def set_up(user):
    secret = new_secret()
    wish = {"password": PASSWORD, "secret": secret, "code": now_of(secret)}
    answer = user.put("/api/v1/me/second-factor", json=wish)
    assert answer.status_code == 200, answer.text
    return secret, answer.json()["recovery_codes"], wish["code"]


def now_of(secret, steps=0):
    return code(secret_bytes(secret), int(time.time()) // 30 + steps)


def test_users_change_their_own_password(server, user):
    elsewhere = logged_in(server, user.name)
    for wrong, status in (
        ({"password": "wrong", "new_password": OTHER}, 422),
        ({"password": PASSWORD, "new_password": "short"}, 422),
        ({"password": PASSWORD, "new_password": "passwordpassword"}, 422),
        ({"new_password": OTHER}, 422),
    ):
        answer = user.put("/api/v1/me/password", json=wrong)
        assert answer.status_code == status, wrong
        assert OTHER not in answer.text
    assert user.put("/api/v1/me/password", json={"password": PASSWORD, "new_password": OTHER}).status_code == 204
    assert user.get("/api/v1/me").status_code == 200
    with server.client(Authorization=f"Bearer {elsewhere}") as other:
        until = time.monotonic() + 60.0
        while other.get("/api/v1/me").status_code == 200 and time.monotonic() < until:
            time.sleep(0.2)
        assert other.get("/api/v1/me").status_code == 401
    assert logged_in(server, user.name) is None
    assert logged_in(server, user.name, OTHER)


def test_control_characters_in_names_and_passwords_are_refused(server, user):
    with server.client() as plain, server.program("administrator") as administrator:
        for path, send in (("/api/v1/login", {"json": {}}), ("/login", {"data": {}})):
            body = {"name": "anna\0", "password": PASSWORD}
            answer = plain.post(path, **dict.fromkeys(send, body))
            assert (answer.status_code, "U+00" in answer.text) == (422, True), path
        wish = {"role": "operator", "password": PASSWORD}
        for name, change in (
            ("anna%00", {}),
            ("anna%7F", {}),
            ("anna", {"full_name": "Anna\x1b[2J"}),
            ("anna", {"password": "a\0bcdefghij klmnop"}),
        ):
            answer = administrator.put(f"/api/v1/users/{name}", json=wish | change)
            assert (answer.status_code, "U+00" in answer.text) == (422, True), (name, change)
        assert not [one for one in administrator.get("/api/v1/users").json() if one["name"].startswith("anna")]


def test_a_browser_found_open_does_not_tell_the_password(server, user):
    for _ in range(5):
        answer = user.put("/api/v1/me/password", json={"password": "guess", "new_password": OTHER})
    assert answer.status_code == 422
    assert user.get("/api/v1/me").status_code == 401
    assert logged_in(server, user.name)  # the user is not kept out


def test_a_second_factor_is_set_up_asked_for_and_removed(server, user):
    secret, recovery, used = set_up(user)
    with server.client() as plain:
        answer = plain.post("/api/v1/login", json={"name": user.name, "password": PASSWORD})
        assert (answer.status_code, answer.json()["code"]) == (401, "web-code")
    later = now_of(secret, 1)
    assert logged_in(server, user.name, code=used) is None  # it has set the factor up
    assert logged_in(server, user.name, code=later)
    assert logged_in(server, user.name, code=later) is None  # replayed
    assert logged_in(server, user.name, code=recovery[0])
    assert logged_in(server, user.name, code=recovery[0]) is None
    path = "/api/v1/me/second-factor/remove"
    for wrong in (
        {"password": PASSWORD},
        {"password": PASSWORD, "code": later},
        {"password": PASSWORD, "code": recovery[0]},
        {"password": "wrong", "code": recovery[1]},
    ):
        assert user.post(path, json=wrong).status_code == 422, wrong
    assert user.post(path, json={"password": PASSWORD, "code": recovery[1]}).status_code == 204
    assert logged_in(server, user.name)


def test_codes_are_not_guessed_in_a_browser_found_open(server, user):
    set_up(user)
    for number in range(5):
        wish = {"password": PASSWORD, "code": f"{number}"}
        assert user.post("/api/v1/me/second-factor/remove", json=wish).status_code == 422
    assert user.get("/api/v1/me").status_code == 401


def test_a_code_that_nobody_asks_for_is_wrong(server, user):
    # whatever is given to prove who one is must be right, ASVS 2.2.4
    assert logged_in(server, user.name, code="123456") is None


def test_an_administrator_removes_a_lost_second_factor_and_it_is_recorded(server, user):
    set_up(user)
    path = f"/api/v1/users/{user.name}/second-factor"
    assert user.delete(path).status_code == 403
    with server.program("administrator") as administrator:
        shown = {one["name"]: one for one in administrator.get("/api/v1/users").json()}
        assert shown[user.name]["second_factor"] is True
        assert administrator.delete(path).status_code == 204
        assert administrator.delete(path).status_code == 404
        events = administrator.get("/api/v1/ledger/records/event", params={"limit": 1000}).json()
    told = [(event["author"], event["action"]) for event in events if event["subject"] == user.name]
    assert told[-1] == ("administrator", "second factor removed")
    assert logged_in(server, user.name)


def test_logins_are_listed_and_ended(server, user):
    other = logged_in(server, user.name)
    found = user.get("/api/v1/me/logins").json()
    assert [one["this"] for one in found] == [False, True] or [one["this"] for one in found] == [True, False]
    assert {one["name"] for one in found} == {user.name}
    assert other not in str(found)
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d", found[0]["began"])
    (second,) = (one["id"] for one in found if not one["this"])
    with server.program("operator") as stranger:
        assert stranger.delete(f"/api/v1/me/logins/{second}").status_code == 404
        assert stranger.delete(f"/api/v1/logins/{second}").status_code == 403
        assert stranger.get("/api/v1/logins").status_code == 403
    assert user.delete(f"/api/v1/me/logins/{second}").status_code == 204
    with server.client(Authorization=f"Bearer {other}") as ended:
        assert ended.get("/api/v1/me").status_code == 401
    with server.program("administrator") as administrator:
        (own,) = (one["id"] for one in administrator.get("/api/v1/logins").json() if one["name"] == user.name)
        assert administrator.delete(f"/api/v1/logins/{own}").status_code == 204
    assert user.get("/api/v1/me").status_code == 401


def test_a_browser_is_known_at_its_next_login(start):
    with start("users") as server, server.client() as anna, server.client() as mallory:
        answer = anna.post("/login", data={"name": "operator", "password": PASSWORD})
        (known,) = (text for text in answer.headers.get_list("set-cookie") if "Max-Age" in text)
        assert {"HttpOnly", "SameSite=Strict"} <= {part.strip() for part in known.split(";")}
        anna.get("/logout")
        for _ in range(12):
            last = mallory.post("/login", data={"name": "operator", "password": "guess"})
        assert last.status_code == 429
        assert mallory.post("/login", data={"name": "operator", "password": PASSWORD}).status_code == 429
        # mallory sits at the same address, so only the cookie tells them apart
        assert anna.post("/login", data={"name": "operator", "password": PASSWORD}).status_code == 303


def test_the_login_page_asks_for_the_code(server, user):
    secret, *_ = set_up(user)
    with server.client() as browser:
        form = browser.get("/login").text
        for name in ("username", "current-password", "one-time-code"):  # password managers find their way
            assert f'autocomplete="{name}"' in form
        answer = browser.post("/login", data={"name": user.name, "password": PASSWORD})
        assert (answer.status_code, "second factor" in answer.text) == (401, True)
        right = {"name": user.name, "password": PASSWORD, "code": now_of(secret, 1)}
        assert browser.post("/login", data=right).status_code == 303
        assert "/account" in browser.get("/").text
        page = browser.get("/account").text
    assert secret not in page
    assert "recovery codes left: 10" in page


@pytest.mark.parametrize("role", ["auditor", "administrator"])
def test_the_account_page_is_everybodys(server, role):
    with server.program(role) as browser:
        assert "data-testid" in browser.get("/account").text or browser.get("/account").status_code == 200


def test_on_a_bench_without_passwords_there_is_no_account(open_server):
    with open_server.local() as browser:
        answer = browser.get("/account")
        assert (answer.status_code, answer.headers["location"]) == (303, "/")
        for method, path, body in (
            ("PUT", "/api/v1/me/password", {"password": "x", "new_password": OTHER}),
            ("POST", "/api/v1/me/second-factor/remove", {"password": "x", "code": "x"}),
        ):
            refused = browser.request(method, path, json=body)
            assert (refused.status_code, refused.json()["code"]) == (422, "web-no-password")
        assert browser.get("/api/v1/me/logins").json() == []


def test_who_was_refused_is_in_the_log_and_no_secret(server, user):
    with server.program("operator") as operator:
        operator.get("/api/v1/users")
    logged_in(server, "nobody at all", "a secret guess")
    log = server.log.read_text()
    assert re.search(r"403 GET '/api/v1/users' for 'operator' from 127\.0\.0\.1", log)
    assert "login of 'nobody at all' from 127.0.0.1 refused" in log
    assert "a secret guess" not in log
    assert PASSWORD not in log


@pytest.mark.long
@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl to make a certificate with")
def test_a_bench_speaks_no_old_tls(tmp_path, start, monkeypatch):
    make = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=bench.lab", "-days", "2"]
    made = subprocess.run(
        [*make, "-keyout", "key.pem", "-out", "bench.pem"], cwd=tmp_path, capture_output=True, check=False
    )
    assert made.returncode == 0
    monkeypatch.setenv("BENCH_PEM", str(tmp_path / "bench.pem"))
    with start("users") as server:
        for newest, spoken in (
            (ssl.TLSVersion.TLSv1_3, "TLSv1.3"),
            (ssl.TLSVersion.TLSv1_2, "TLSv1.2"),
            (ssl.TLSVersion.TLSv1_1, None),
        ):
            context = ssl.create_default_context(cafile=str(tmp_path / "bench.pem"))
            context.check_hostname = False
            context.set_ciphers("ALL:@SECLEVEL=0")
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", DeprecationWarning)
                context.minimum_version = ssl.TLSVersion.TLSv1
                context.maximum_version = newest
            with socket.create_connection(("127.0.0.1", server.port)) as line:
                if spoken is None:
                    with pytest.raises((ssl.SSLError, ConnectionError)):
                        context.wrap_socket(line)
                    continue
                with context.wrap_socket(line) as secured:
                    assert secured.version() == spoken
                    secured.sendall(b"POST /login HTTP/1.1\r\nHost: bench.lab\r\nContent-Length: 51\r\n"
                                    b"Content-Type: application/x-www-form-urlencoded\r\nConnection: close\r\n\r\n"
                                    b"name=operator&password=adze+jib+fen+quoit&code=    ")  # fmt: skip
                    answer = b"".join(iter(lambda: secured.recv(65536), b"")).decode()
                    assert answer.startswith("HTTP/1.1 303")
                    assert answer.count("set-cookie: __Host-inclinometry=") == 1
                    assert answer.count("; Secure") == 2
                    assert "strict-transport-security" in answer
