"""What is refused before any page or route: foreign names, foreign sites, strangers."""

from __future__ import annotations

import re
import socket

import pytest

SITES = ("http://evil.example", "null", "http://127.0.0.1:1", "https://127.0.0.1.evil.example")


@pytest.mark.parametrize(
    "host",
    ["evil.example", "evil.example:{port}", "127.0.0.1.evil.example", "localhost.evil.example:{port}", "", "[::2]",
     "::1", "127.0.0.1@evil.example", "192.168.1.1", "0.0.0.0", "\u0131localhost".encode().decode("latin-1")],
)  # fmt: skip
def test_a_name_that_is_not_ours_is_refused(open_server, host):
    # DNS rebinding: the name of another site made to point here
    with open_server.client() as browser:
        answer = browser.get("/api/v1/me", headers=[(b"Host", host.format(port=open_server.port).encode("latin-1"))])
    assert answer.status_code == 421
    assert "csrf" not in answer.text


@pytest.mark.parametrize("host", ["127.0.0.1:{port}", "LOCALHOST:{port}", "[::1]:{port}", "localhost"])
def test_names_of_this_computer_are_answered(open_server, host):
    with open_server.client() as browser:
        answer = browser.get("/api/v1/me", headers={"Host": host.format(port=open_server.port)})
    assert answer.status_code == 200


def test_where_users_log_in_given_names_and_the_own_address_are_answered(users_server):
    with users_server.client() as browser:
        for host, status in (
            ("bench.lab", 200),
            ("BENCH.lab:9", 200),
            ("127.0.0.1", 200),
            ("10.0.0.1", 421),
            ("x.lab", 421),
        ):
            assert browser.get("/login", headers={"Host": host}).status_code == status, host


def test_a_request_without_or_with_two_hosts_is_refused(open_server):
    for head in ("", "Host: 127.0.0.1\r\nHost: evil.example\r\n"):
        with socket.create_connection(("127.0.0.1", open_server.port)) as line:
            line.sendall(f"GET /api/v1/me HTTP/1.1\r\n{head}Connection: close\r\n\r\n".encode())
            assert line.recv(100).split()[1] in (b"400", b"421")


@pytest.mark.parametrize("header", ["Origin", "Authorization", "X-CSRF-Token", "Content-Type"])
def test_a_header_that_decides_something_comes_once(open_server, header):
    with open_server.local() as browser:
        answer = browser.put("/api/v1/sites/x", json={}, headers=[(header, "one"), (header, "two")])
    assert (answer.status_code, answer.json()["detail"]) == (400, f"the header {header.lower()} was sent twice")


@pytest.mark.parametrize("origin", SITES)
def test_pages_of_other_sites_change_nothing(open_server, origin):
    with open_server.local() as browser:
        for method, path in (("PUT", "/api/v1/sites/foreign"), ("POST", "/login"), ("POST", "/_nicegui_ws/socket.io/")):
            assert browser.request(method, path, headers={"Origin": origin}, json={}).status_code == 403
        assert "foreign" not in browser.get("/api/v1/sites").text


@pytest.mark.parametrize(("site", "mode", "kind", "status"), [
    ("cross-site", "no-cors", "image", 403),
    ("same-site", "cors", "empty", 403),
    ("cross-site", "navigate", "iframe", 403),
    ("cross-site", "navigate", "document", 200),
    ("same-origin", "cors", "empty", 200),
    ("none", "navigate", "document", 200),
])  # fmt: skip
def test_other_sites_may_link_here_but_embed_nothing(open_server, site, mode, kind, status):
    marks = {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": mode, "Sec-Fetch-Dest": kind}
    with open_server.client() as browser:
        assert browser.get("/api/v1/ledger/head", headers=marks).status_code == status


def test_no_other_site_is_allowed_to_read(open_server):
    with open_server.client() as browser:
        for path in ("/", "/api/v1/me", "/_nicegui_ws/socket.io/?EIO=4&transport=polling"):
            assert browser.get(path, headers={"Origin": "http://evil.example"}).status_code == 403
            answer = browser.get(path, headers={"Origin": open_server.url})
            assert answer.status_code == 200
            assert "access-control-allow-origin" not in answer.headers
            assert answer.headers["cross-origin-resource-policy"] == "same-origin"
        asked = browser.options(
            "/api/v1/me", headers={"Origin": "http://evil.example", "Access-Control-Request-Method": "PUT"}
        )
        assert "access-control-allow-origin" not in asked.headers


@pytest.mark.parametrize("given", [None, "", "wrong", "é".encode().decode("latin-1")])
def test_changes_need_the_header_foreign_pages_cannot_send(open_server, given):
    headers = {} if given is None else {"X-CSRF-Token": given.encode("latin-1")}
    with open_server.client() as browser:
        answer = browser.put("/api/v1/sites/x", json={}, headers=headers)
    assert answer.status_code == 403
    assert "X-CSRF-Token" in answer.json()["detail"]


def test_a_bench_with_users_shows_a_stranger_the_login_and_nothing_else(users_server):
    with users_server.client() as stranger:
        for path in ("/", "/tools", "/users", "/api", "/_nicegui_x", "/static", "/loginx", "/login/x", "//login"):
            answer = stranger.get(path)
            assert (answer.status_code, answer.headers["location"]) == (303, "/login"), path
        for path in ("/api/v1/me", "/api/openapi.json", "/api/v1/login/..", "/api/nope", "/api/v1/ledger/export"):
            assert stranger.get(path).status_code == 401, path
        assert stranger.post("/_nicegui/client/1/upload").status_code == 303
        assert stranger.get("/_nicegui_ws/socket.io/?EIO=4&transport=polling").status_code == 303
        assert stranger.get("/login").status_code == 200
        assert stranger.get("/healthz").text == "ok"


@pytest.mark.parametrize("path", [
    "/static/../serve.py", "/static/%2e%2e/guard.py", "/static/..%2fguard.py", "/static//etc/passwd",
    "/_nicegui/3.18.0/static/../../client.py", "/_nicegui/3.18.0/static/%2e%2e/client.py", "/static/bench.css%00.py",
])  # fmt: skip
def test_no_file_outside_the_folder_of_styles_is_served(users_server, path):
    with socket.create_connection(("127.0.0.1", users_server.port)) as line:
        line.sendall(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n".encode())
        answer = b"".join(iter(lambda: line.recv(65536), b""))
    assert answer.split()[1] in (b"404", b"303", b"400"), answer[:200]
    assert b"import " not in answer


def test_every_answer_carries_what_browsers_must_refuse(users_server, open_server):
    wanted = {
        "x-content-type-options": "nosniff",
        "x-frame-options": "DENY",
        "referrer-policy": "same-origin",
        "cross-origin-opener-policy": "same-origin",
    }
    for server, paths in ((users_server, ("/login", "/", "/api/v1/me", "/static/bench.css")),
                          (open_server, ("/", "/api", "/api/v1/me", "/api/nope", "/tools/none", "/x"))):  # fmt: skip
        with server.client() as browser:
            for path in paths:
                answer = browser.get(path)
                assert {name: answer.headers.get(name) for name in wanted} == wanted, path
                assert "server" not in answer.headers
                rules = dict(
                    r.strip().partition(" ")[::2] for r in answer.headers["content-security-policy"].split(";")
                )
                assert rules["frame-ancestors"] == rules["default-src"] == "'none'"
                assert not re.search(r"\*|https?:", answer.headers["content-security-policy"])
                private = not path.startswith("/static/")
                assert (answer.headers.get("cache-control") == "no-store") is private


def test_nothing_a_page_loads_comes_from_elsewhere(open_server):
    elsewhere = re.compile(
        r"""(?:src|href|from|import|url)\s*[=(]?\s*["'(]\s*(?:https?:)?//(?!127\.0\.0\.1)[^"')]+""", re.I
    )
    with open_server.client() as browser:
        for path in ("/", "/tools", "/calibrate", "/ledger", "/users", "/api"):
            text = browser.get(path).text
            assert not elsewhere.findall(text), path
            for asset in set(re.findall(r'(?:src|href)="(/[^"]+)"|"(/_nicegui/[^"]+\.(?:js|css))"', text)):
                name = asset[0] or asset[1]
                if name.startswith(("/static/", "/_nicegui/")) and name.endswith(".css"):
                    assert not elsewhere.findall(browser.get(name).text), name
