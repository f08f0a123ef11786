"""The live connection of a page: nobody else's, and over when its user has logged out."""

from __future__ import annotations

import json
import re
import uuid
from contextlib import contextmanager

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from inclinometry.laboratory.web.refusals import cookie_name

SITE = "http://127.0.0.1:{port}"


@contextmanager
def live(server, page="", *, cookie="", origin=SITE, host=None):
    """A socket as a browser's page opens it."""
    headers = {} if not cookie else {"Cookie": cookie}
    if host is not None:
        headers["Host"] = host
    where = f"ws://127.0.0.1:{server.port}/_nicegui_ws/socket.io/?EIO=4&transport=websocket"
    where += f"&client_id={page}" if page else ""
    given = origin and origin.format(port=server.port)
    with connect(where, additional_headers=headers, origin=given, proxy=None, open_timeout=10) as socket:
        assert socket.recv(timeout=10).startswith("0")
        socket.send("40")
        assert socket.recv(timeout=10).startswith(("40", "44"))
        yield socket


def shaken(socket, page):
    """Whether the server lets the socket speak for the page."""
    content = {"client_id": page, "tab_id": str(uuid.uuid4()), "document_id": "d", "next_message_id": 0}
    socket.send("420" + json.dumps(["handshake", content]))
    while True:
        answer = socket.recv(timeout=10)
        if answer.startswith("430"):
            return json.loads(answer[3:]) == [True]


def listen(socket):
    """Take what comes until the server hangs up."""
    while True:
        socket.recv(timeout=10)


def opened(browser, path="/"):
    """Name of a page the browser opens."""
    text = browser.get(path).text
    found = re.search(r"""client_id['"]: *['"]([0-9a-f-]{36})""", text)
    assert found, text[:500]
    return found.group(1)


def as_browser(server, role):
    """A browser in which a user has logged in, and its cookie."""
    browser = server.client()
    token = server.token(role)
    cookie = f"{cookie_name(f':{server.port}')}={token}"
    browser.headers["Cookie"] = cookie
    return browser, cookie


def test_a_page_lives(open_server):
    with open_server.client() as browser, live(open_server) as socket:
        assert shaken(socket, opened(browser))


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "http://127.0.0.1:1", "https://localhost.evil.example"]
)
def test_no_page_of_another_site_opens_a_socket(open_server, users_server, origin):
    for server in (open_server, users_server):
        with pytest.raises(InvalidStatus) as refused, live(server, origin=origin):
            pass
        assert refused.value.response.status_code == 403


def test_no_socket_for_a_foreign_name(open_server):
    with pytest.raises(InvalidStatus), live(open_server, host="evil.example"):
        pass


def test_a_stolen_page_is_nothing_without_the_login(users_server):
    browser, cookie = as_browser(users_server, "metrologist")
    page = opened(browser)
    for given in ("", cookie[:-3] + "xyz", cookie.replace(str(users_server.port), "1")):
        with pytest.raises(InvalidStatus), live(users_server, page, cookie=given):
            pass
    with live(users_server, cookie=cookie) as socket:
        assert shaken(socket, page)
    browser.close()


def test_nobody_speaks_for_a_page_of_another_user(users_server):
    hers, cookie = as_browser(users_server, "administrator")
    page = opened(hers)
    _, other = as_browser(users_server, "operator")
    with live(users_server, cookie=other) as socket:
        assert not shaken(socket, page)
    with live(users_server, cookie=cookie) as socket:
        assert shaken(socket, page)
    hers.close()


def test_after_logging_out_a_page_does_nothing_more(users_server):
    with users_server.client() as plain:
        login = plain.post("/login", data={"name": "operator", "password": "adze jib fen quoit"})
        cookie = login.headers["set-cookie"].partition(";")[0]
        plain.headers["Cookie"] = cookie
        page = opened(plain)
        with live(users_server, cookie=cookie) as socket:
            assert shaken(socket, page)
            assert plain.get("/logout").status_code == 303
            socket.send("42" + json.dumps(["event", {"client_id": page, "id": 1, "listener_id": "x", "args": []}]))
            with pytest.raises(ConnectionClosed) as ended:
                listen(socket)
        assert ended.value.rcvd.code == 4401


@pytest.mark.long
@pytest.mark.parametrize("message", [
    '42["event",{}]', '42["event",null]', '42["event"]', "42[]", "42{", "4", "",
    "9", '42["handshake",{"client_id":[]}]',
    '42["ack",{"client_id":"x"}]', '451-["event",{"_placeholder":true,"num":0}]', "42" + "[" * 5000, '42["log",7]',
    '42["event",{"client_id":"' + "x" * 100_000 + '"}]', b"\x00\xff", "2", '42["connect",{}]', '42["disconnect"]',
])  # fmt: skip
def test_nonsense_on_a_socket_harms_nobody(open_server, message):
    with open_server.client() as browser, live(open_server, opened(browser)) as socket:
        socket.send(message)
        assert browser.get("/healthz").text == "ok"
    with open_server.client() as browser, live(open_server) as socket:
        assert shaken(socket, opened(browser))


def test_a_message_may_not_be_large(open_server):
    with open_server.client() as browser, live(open_server, opened(browser)) as socket:
        socket.send("42" + "x" * 3_000_000)
        with pytest.raises(ConnectionClosed):
            listen(socket)
