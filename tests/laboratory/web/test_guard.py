"""What is refused before any page or route: foreign names, foreign sites, strangers."""

from __future__ import annotations

import re
import socket

import pytest

SITES = ("http://evil.example", "null", "http://127.0.0.1:1", "https://127.0.0.1.evil.example")


def test_the_names_that_are_answered(open_server, users_server):
    # of this computer; where users log in, those that were given and the address the connection came to
    for server, path, ours, others in (
        (open_server, "/api/v1/me", ("127.0.0.1:{port}", "LOCALHOST:{port}", "[::1]:{port}", "localhost"),
         ("evil.example", "192.168.1.1")),  # DNS rebinding: the name of another site made to point here
        (users_server, "/login", ("bench.lab", "BENCH.lab:9", "127.0.0.1"), ("10.0.0.1", "x.lab")),
    ):  # fmt: skip
        with server.client() as browser:
            for host in (*ours, *others):
                answer = browser.get(path, headers={"Host": host.format(port=server.port)})
                assert answer.status_code == (200 if host in ours else 421), host
                assert ("csrf" in answer.text) == (path == "/api/v1/me" and host in ours)


def test_a_request_without_or_with_two_hosts_is_refused(open_server):
    for head in ("", "Host: 127.0.0.1\r\nHost: evil.example\r\n"):
        with socket.create_connection(("127.0.0.1", open_server.port)) as line:
            line.sendall(f"GET /api/v1/me HTTP/1.1\r\n{head}Connection: close\r\n\r\n".encode())
            assert line.recv(100).split()[1] in (b"400", b"421")


@pytest.mark.parametrize("origin", SITES)
def test_pages_of_other_sites_change_nothing(open_server, origin):
    with open_server.local() as browser:
        for method, path in (("PUT", "/api/v1/sites/foreign"), ("POST", "/login"), ("POST", "/_nicegui_ws/socket.io/")):
            assert browser.request(method, path, headers={"Origin": origin}, json={}).status_code == 403
        assert "foreign" not in browser.get("/api/v1/sites").text


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
