"""Bodies and connections that are too large, too slow or not what they say: refused, and the server stays small."""

from __future__ import annotations

import asyncio
import gzip
import socket
import time
from contextlib import contextmanager

import httpx
import pytest
from tests.refusals import refused

from inclinometry.laboratory.web.refusals import BodyError, BodyLimit

MB = 1_000_000


def head(server, path, *lines, method="PUT"):
    csrf = server.local().headers["X-CSRF-Token"]
    wanted = ("Host: 127.0.0.1", f"X-CSRF-Token: {csrf}", "Content-Type: application/json", *lines)
    return (f"{method} {path} HTTP/1.1\r\n" + "\r\n".join(wanted) + "\r\n\r\n").encode()


@contextmanager
def connected(server, data):
    """A connection over which so much has been sent."""
    with socket.create_connection(("127.0.0.1", server.port)) as line:
        line.sendall(data)
        yield line


def answer_of(line):
    line.settimeout(60)
    try:
        return line.recv(65536)
    except ConnectionResetError:
        return b""


def hung_up(line, beginning):
    """Whether the server hangs up on a request that dribbles in."""
    try:
        for letter in beginning + b"x" * 1200:  # a minute: much longer than the server waits, however busy it is
            line.sendall(bytes([letter]))
            time.sleep(0.05)
    except OSError:
        return True
    return False


def test_a_gigabyte_that_is_announced_is_refused_unread(open_server):
    with connected(open_server, head(open_server, "/api/v1/sites/x", f"Content-Length: {1000 * MB}")) as line:
        assert answer_of(line).split()[1] == b"413"


@pytest.mark.parametrize("path", ["/api/v1/sites/x", "/login", "/_nicegui/client/x/upload", "/tools"])
def test_a_gigabyte_that_is_not_announced_is_cut_off_and_memory_stays_flat(open_server, path):
    before, sent = open_server.memory(), 0
    chunk = f"{MB:x}\r\n".encode() + b"[" * MB + b"\r\n"
    with connected(open_server, head(open_server, path, "Transfer-Encoding: chunked", method="POST")) as line:
        line.settimeout(60)
        try:
            while sent < 1000:
                line.sendall(chunk)
                sent += 1
        except (BrokenPipeError, ConnectionResetError, TimeoutError):
            pass
    assert sent < 200
    assert open_server.memory() - before < 100 * MB
    with open_server.client() as browser:
        assert browser.get("/healthz").text == "ok"


def test_a_body_just_too_large_is_told_so(open_server):
    with open_server.local() as browser:
        for content in (b"x" * 2_000_001, iter([b"x" * MB] * 3)):
            try:
                answer = browser.put("/api/v1/sites/x", content=content, headers={"Content-Type": "application/json"})
            except (httpx.WriteError, httpx.RemoteProtocolError, httpx.ReadError):
                continue  # hung up on while sending
            assert answer.status_code == 413
            assert "2000000" in answer.json()["detail"]


@pytest.mark.parametrize(("length", "status"), [("-1", 400), ("abc", 400), ("1e9", 400), ("9" * 30, 400), ("", 400)])
def test_a_length_that_is_none(open_server, length, status):
    with connected(open_server, head(open_server, "/api/v1/sites/x", f"Content-Length: {length}")) as line:
        assert int(answer_of(line).split()[1]) == status


def test_length_and_chunks_together_do_not_smuggle_a_second_request(open_server):
    second = head(open_server, "/api/v1/sites/smuggled", "Content-Length: 2") + b"{}"
    with connected(
        open_server,
        head(open_server, "/api/v1/sites/x", f"Content-Length: {5 + len(second)}", "Transfer-Encoding: chunked")
        + b"0\r\n\r\n"
        + second,
    ) as line:
        answer_of(line)
    with open_server.client() as browser:
        assert "smuggled" not in browser.get("/api/v1/sites").text


@pytest.mark.long
@pytest.mark.parametrize("coding", ["gzip", "deflate", "br", "identity, gzip"])
def test_compressed_requests_are_not_read(open_server, coding):
    bomb = gzip.compress(b"0" * 50 * MB)
    with open_server.local() as browser:
        answer = browser.put("/api/v1/sites/x", content=bomb, headers={"Content-Encoding": coding})
    assert answer.status_code == 415


@pytest.mark.long
def test_a_connection_that_says_nothing_or_dribbles_is_hung_up_on(open_server):
    # the servers of the tests wait for one second, the bench for fifteen
    with socket.create_connection(("127.0.0.1", open_server.port)) as silent:
        assert answer_of(silent) == b""
    with socket.create_connection(("127.0.0.1", open_server.port)) as slow:
        assert hung_up(slow, b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Long: ")
    with connected(open_server, b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n") as kept:
        assert b"200" in answer_of(kept)
        assert hung_up(kept, b"GET / HTTP/1.1\r\nX-Long: ")


def test_a_slow_body_is_given_up():
    async def never():
        await asyncio.sleep(3600)

    async def waiting():
        body = BodyLimit({"path": "/api/v1/x"}, never, {}, longest_s=0.05)
        with refused("web-body-slow", error=BodyError):
            await body.receive()
        assert body.problem.code == "web-body-slow"

    asyncio.run(waiting())


def test_very_long_lines_of_a_request_are_refused(open_server):
    for request in (b"GET /" + b"x" * 100_000, b"GET / HTTP/1.1\r\nX: " + b"y" * 100_000):
        with connected(open_server, request + b"\r\n\r\n") as line:
            assert answer_of(line)[:12] in (b"HTTP/1.1 400", b"HTTP/1.1 431", b"")


def test_many_idle_connections_leave_room_for_a_browser(open_server):
    lines = [socket.create_connection(("127.0.0.1", open_server.port)) for _ in range(200)]
    with open_server.client() as browser:
        assert browser.get("/healthz").text == "ok"
    for line in lines:
        line.close()
