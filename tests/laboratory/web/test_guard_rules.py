"""Each rule of the guard by itself: what passes, what the nearest thing to it is that does not."""

from __future__ import annotations

import asyncio
import json
from functools import partial
from types import SimpleNamespace

import pytest

from inclinometry.laboratory.web import guard as module
from inclinometry.laboratory.web.guard import ENDED, Guard, bearer
from inclinometry.laboratory.web.logins import Login
from inclinometry.laboratory.web.refusals import BodyError, BodyLimit

ANNA = Login("anna's token", "anna's csrf", "anna", 0.0, 0.0)
LOCAL = Login("local token", "local csrf", "local", 0.0, 0.0)
COOKIE = {"cookie": f"inclinometry={ANNA.token.replace(' ', '%20')}"}


class Known:
    """Logins with anna in them, by a token or by the cookie's."""

    def __init__(self):
        self.alive, self.used = True, []

    def local(self):
        return LOCAL

    def find(self, token, *, use=True):
        self.used.append((token, use))
        return (ANNA, None) if self.alive and token in (ANNA.token, "cookie-token") else None


class World:
    """A guard around an application that says what reached it."""

    def __init__(self, single_user, hosts=("Bench.LAB", "localhost", "[::1]")):
        self.logins, self.reached, self.got = Known(), [], []
        self.guard = Guard(self._app, logins=self.logins, hosts=frozenset(hosts), single_user=single_user)
        self.body, self.late_s = [{"type": "http.request", "body": b"", "more_body": False}], 0.0

    async def _app(self, scope, receive, send):
        self.reached.append(scope)
        if scope["type"] == "http":
            theirs = [(b"Content-Security-Policy", b"theirs"), (b"access-control-allow-origin", b"*"), (b"x-own", b"1")]
            await send({"type": "http.response.start", "status": 200, "headers": theirs})
            await send({"type": "http.response.body", "body": b"ok"})
        elif scope["type"] == "websocket":
            while (message := await receive())["type"] == "websocket.receive":
                self.got.append(message)
            self.got.append(message)

    def ask(self, method="GET", path="/api/v1/me", headers=(), **more):
        """Status and what was said; a dict of headers, or a list of pairs where one comes twice."""
        given = dict(headers) if not isinstance(headers, list) else {}
        pairs = list(({"host": "localhost"} | given).items()) if given or not isinstance(headers, list) else headers
        scope = {"type": "http", "method": method, "path": path, "scheme": "http", "server": ("127.0.0.1", 80)} | more
        scope["headers"] = [(name.encode("latin-1"), value.encode("latin-1")) for name, value in pairs]
        sent, messages = [], list(self.body)

        async def receive():
            await asyncio.sleep(self.late_s)
            return messages.pop(0) if messages else {"type": "websocket.disconnect"}

        async def send(message):
            sent.append(message)

        asyncio.run(self.guard(scope, receive, send))
        self.sent = sent
        if scope["type"] == "websocket":
            return next((message["code"] for message in sent if message["type"] == "websocket.close"), None)
        start, body = sent[0], sent[1]["body"]
        self.headers = {name.decode().lower(): value.decode() for name, value in start["headers"]}
        self.said = json.loads(body) if body.startswith(b"{") else {}
        return start["status"]


@pytest.fixture
def network():
    return World(single_user=False)


@pytest.fixture
def loopback():
    return World(single_user=True)


def program(**more):
    return {"authorization": f"Bearer {ANNA.token}", **more}


# the name by which the server was called


@pytest.mark.parametrize(("host", "status"), [
    ("localhost", 200), ("LOCALHOST", 200), ("localhost:8080", 200), ("bench.lab", 200), ("BENCH.Lab:1", 200),
    ("[::1]:80", 200), ("[::1]", 200), ("[::1]evil", 421), ("[::1]evil:80", 421),
    ("bench.lab.evil.example", 421), ("evil.bench.lab", 421), ("ench.lab", 421), ("bench", 421), ("", 421),
    ("[::1", 421),
    ("localhost.", 421), ("127.0.0.2", 421), ("10.0.0.1", 421), ("localhost.evil.example:80", 421), ("[::2]", 421),
    ("::1", 421), ("localhost@evil.example", 421), ("0.0.0.0", 421),
    ("\u0131localhost".encode().decode("latin-1").lower(), 421),
])  # fmt: skip
def test_the_host_is_one_of_the_names_whole_and_in_any_case(network, host, status):
    assert network.ask(headers=program(host=host)) == status
    assert bool(network.reached) == (status == 200)
    if status == 421:
        assert network.said["values"] == {"host": repr(host)}


@pytest.mark.parametrize(("server", "host", "single", "status"), [
    (("10.0.0.5", 80), "10.0.0.5", False, 200),
    (("10.0.0.5", 80), "10.0.0.5:8080", False, 200),
    (("10.0.0.5", 80), "10.0.0.6", False, 421),
    (("10.0.0.5", 80), "10.0.0.5.evil.example", False, 421),
    (("fe80::5", 80), "[FE80::0005]:80", False, 200),
    (("fe80::5", 80), "[fe80::6]", False, 421),
    (("10.0.0.5", 80), "10.0.0.5", True, 421),  # the one user of a loopback bench is reached by its names only
    (None, "10.0.0.5", False, 421),
    (("/run/socket", None), "10.0.0.5", False, 421),
])  # fmt: skip
def test_the_address_the_connection_came_to_will_do_where_users_log_in(server, host, single, status):
    assert World(single).ask(headers=program(host=host), server=server) == status


# who sends it: a page of this server, or of another


@pytest.mark.parametrize(("origin", "status"), [
    ("http://localhost:8080", 200), ("HTTP://LOCALHOST:8080", 200), ("https://localhost:8080", 200),
    ("http://localhost", 403), ("http://localhost:80", 403), ("http://localhost:8080.evil.example", 403),
    ("http://evil.example/localhost:8080", 403), ("http://xlocalhost:8080", 403), ("localhost:8080", 403),
    ("https://localhost.evil.example", 403), ("http://localhost:808", 403), ("http://", 403), ("", 403),
    ("null", 403), ("http://localhost:8080:", 403),
])  # fmt: skip
def test_an_origin_is_this_server_or_none(loopback, origin, status):
    headers = {"host": "localhost:8080", "origin": origin, "x-csrf-token": LOCAL.csrf}
    for method in ("GET", "POST", "DELETE"):
        assert loopback.ask(method, headers=headers) == status, method
    assert len(loopback.reached) == (3 if status == 200 else 0)


@pytest.mark.parametrize(("site", "mode", "dest", "method", "status"), [
    ("same-origin", "cors", "empty", "GET", 200), ("none", "navigate", "document", "GET", 200),
    ("cross-site", "navigate", "document", "GET", 200), ("cross-site", "navigate", "document", "HEAD", 200),
    ("cross-site", "navigate", "document", "POST", 403), ("cross-site", "navigate", "iframe", "GET", 403),
    ("cross-site", "cors", "document", "GET", 403), ("same-site", "no-cors", "image", "GET", 403),
    ("same-site", "cors", "empty", "GET", 403), ("cross-site", "no-cors", "image", "GET", 403),
    ("", "", "", "GET", 403),
])  # fmt: skip
def test_other_sites_link_and_do_nothing_else(loopback, site, mode, dest, method, status):
    headers = {"sec-fetch-site": site, "sec-fetch-mode": mode, "sec-fetch-dest": dest, "x-csrf-token": LOCAL.csrf}
    assert loopback.ask(method, headers=headers) == status


def test_a_socket_of_another_site_is_closed(loopback):
    for marks in ({"origin": "http://evil.example"}, {"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate",
                                                      "sec-fetch-dest": "document"}):  # fmt: skip
        assert loopback.ask(path="/_nicegui_ws/", headers=marks, type="websocket") == 4403
    assert loopback.reached == []


# who it is


@pytest.mark.parametrize(("value", "token"), [
    ("Bearer x", "x"), ("bearer x", "x"), ("BEARER   x ", "x"), ("Basic x", ""), ("Bearerx", ""), ("x", ""), ("", ""),
    ("Token x", ""), ("xBearer x", ""), ("Bearer", ""),
])  # fmt: skip
def test_only_the_scheme_bearer_brings_a_token(value, token):
    assert bearer({"authorization": value}) == token


@pytest.mark.parametrize("scheme", ["Basic", "Digest", "Token", "Negotiate", ""])
def test_a_token_under_another_scheme_opens_nothing(network, scheme):
    assert network.ask(headers={"authorization": f"{scheme} {ANNA.token}"}) == 401
    assert (network.reached, network.headers["www-authenticate"]) == ([], "Bearer")


def test_a_token_on_a_loopback_bench_is_who_it_says(loopback):
    assert loopback.ask(headers=program()) == 200
    assert loopback.reached[-1]["state"]["login"] is ANNA
    assert loopback.ask(headers=program(authorization="Bearer wrong")) == 401
    assert loopback.ask() == 200
    assert loopback.reached[-1]["state"]["login"] is LOCAL


@pytest.mark.parametrize(("scheme", "name", "status"), [
    ("http", "inclinometry", 200), ("https", "__Host-inclinometry", 200), ("https", "inclinometry", 401),
    ("http", "__Host-inclinometry", 401), ("http", "inclinometry-8080", 401),
])  # fmt: skip
def test_the_cookie_of_this_server(network, scheme, name, status):
    assert network.ask(headers={"cookie": f"a=b; {name}=cookie-token; c=d"}, scheme=scheme) == status


@pytest.mark.parametrize("name", ["Host", "Origin", "Authorization", "Content-Length", "Content-Type", "X-CSRF-Token"])
def test_what_decides_something_comes_once(network, name):
    pairs = [("host", "localhost"), *program().items()]
    pairs += [(name, "0"), (name.upper(), "0")]
    assert network.ask(headers=pairs) == 400
    assert (network.said["code"], network.said["values"]) == (
        "web-header",
        {"name": name.lower(), "fault": "sent twice"},
    )
    assert network.headers["connection"] == "close"


# what a stranger sees, and what changes something


@pytest.mark.parametrize(("method", "path", "status"), [
    ("GET", "/login", 200), ("POST", "/login", 200), ("POST", "/api/v1/login", 200), ("GET", "/healthz", 200),
    ("GET", "/favicon.ico", 200), ("GET", "/static/bench.css", 200), ("HEAD", "/_nicegui/x.js", 200),
    ("OPTIONS", "/static/x", 200), ("POST", "/static/x", 303), ("PUT", "/_nicegui/x", 303),
    ("DELETE", "/_nicegui/x", 303),
    ("GET", "/", 303), ("GET", "/login/", 303), ("GET", "/Login", 303), ("GET", "/statics/x", 303),
    ("GET", "/x/static/y", 303),
    ("GET", "/_nicegui_x", 303), ("GET", "/static", 303), ("GET", "/loginx", 303), ("GET", "/login/x", 303),
    ("GET", "//login", 303), ("GET", "/api/v1/login/..", 401), ("POST", "/_nicegui/client/1/upload", 303),
    ("GET", "/_nicegui_ws/socket.io/", 303), ("GET", "/_nicegui", 303), ("GET", "/api/v1/me", 401),
    ("GET", "/api/", 401), ("GET", "/api", 303),
    ("POST", "/api/v1/login/", 401), ("GET", "/x/api/", 303),
])  # fmt: skip
def test_a_stranger_sees_the_login_and_what_it_is_drawn_with(network, method, path, status):
    assert network.ask(method, path) == status
    assert bool(network.reached) == (status == 200)
    assert (network.headers.get("location") == "/login") == (status == 303)


def test_a_strangers_socket_is_closed_whatever_its_path(network):
    for path in ("/login", "/static/x", "/_nicegui_ws/socket.io/", "/healthz"):
        assert network.ask(path=path, type="websocket") == ENDED == 4401
    assert network.reached == []


@pytest.mark.parametrize("method", ["POST", "PUT", "PATCH", "DELETE", "TRACE", "BREW"])
def test_whatever_changes_something_needs_the_header_beside_the_cookie(network, loopback, method):
    for world, who, login in ((network, {"cookie": "inclinometry=cookie-token"}, ANNA), (loopback, {}, LOCAL)):
        for given in ({}, {"x-csrf-token": ""}, {"x-csrf-token": "wrong"}, {"x-csrf-token": login.csrf[:-1]},
                      {"x-csrf-token": login.token}, {"x-csrf-token": "Ã©"}):  # fmt: skip
            assert world.ask(method, "/api/v1/tools/1", who | given) == 403
            assert world.said["code"] == "web-token"
        assert world.ask(method, "/api/v1/tools/1", who | {"x-csrf-token": login.csrf}) == 200
        assert len(world.reached) == 1


@pytest.mark.parametrize(("method", "headers"), [
    ("GET", {"cookie": "inclinometry=cookie-token"}), ("HEAD", {"cookie": "inclinometry=cookie-token"}),
    ("OPTIONS", {"cookie": "inclinometry=cookie-token"}),
    ("DELETE", program()),  # no page of another site can send a program's token
    # two headers of cookies are one, in either order; others may come twice
    ("GET", [("host", "localhost"), ("cookie", "a=b"), ("cookie", "inclinometry=cookie-token")]),
    ("GET", [("host", "localhost"), ("cookie", "inclinometry=cookie-token"), ("cookie", "a=b")]),
    ("GET", [("host", "localhost"), *program().items(), ("accept", "a"), ("accept", "b")]),
])  # fmt: skip
def test_what_needs_no_header_of_ours(network, method, headers):
    assert network.ask(method, headers=headers) == 200


def test_pages_themselves_are_no_interface(loopback):
    assert loopback.ask("POST", "/_nicegui/client/1/upload") == 200  # the connection of the page guards it


# answers


def test_what_the_framework_says_of_safety_is_replaced(network):
    network.ask(headers=program())
    assert "access-control-allow-origin" not in network.headers
    assert network.headers["content-security-policy"] != "theirs"
    assert network.headers["x-own"] == "1"
    assert network.headers["x-content-type-options"] == "nosniff"
    # with "no-referrer" browsers say "Origin: null" of the login form, and it is refused
    assert network.headers["referrer-policy"] == "same-origin"


async def reading(scope, receive, send):
    """An application that reads its body to the end, and says it in its own words when that fails."""
    try:
        while (await receive()).get("more_body"):
            pass
    except BodyError:
        pass
    await send({"type": "http.response.start", "status": 500, "headers": []})
    await send({"type": "http.response.body", "body": b"the framework's own words"})


def test_a_body_that_breaks_the_rules_is_answered_once(network):
    network.guard._app = reading
    network.body = [{"type": "http.request", "body": b"x" * 1_500_000, "more_body": True} for _ in range(3)]
    assert network.ask("PUT", headers=program(**{"transfer-encoding": "chunked"})) == 413
    assert (network.said["code"], network.said["values"]["most"]) == ("web-body-large", 2_000_000)
    assert len(network.sent) == 2
    assert network.headers["connection"] == "close"


def test_a_body_that_does_not_come_ends_the_connection(network, monkeypatch):
    monkeypatch.setattr(module, "BodyLimit", partial(BodyLimit, longest_s=0.02))
    network.guard._app, network.late_s = reading, 60.0
    assert network.ask("PUT", headers=program(**{"content-length": "2"})) == 408
    assert network.headers["connection"] == "close"


def test_an_answer_before_the_body_was_read_ends_the_connection(network):
    network.body = [{"type": "http.request", "body": b"x", "more_body": True}]
    assert network.ask("PUT", headers=program(**{"content-length": "100000"})) == 200
    assert network.headers["connection"] == "close"
    assert network.ask("PUT", headers=program(**{"content-length": "10"})) == 200
    assert "connection" not in network.headers


def test_who_was_refused_what_is_logged(network, loopback, caplog):
    network.ask("PUT", "/api/v1/x\n", headers={"x": "y"}, client=("10.0.0.7", 5))
    network.ask(headers={"host": "evil.example"}, client=("10.0.0.8", 5))
    loopback.ask("DELETE", "/api/v1/x")
    network.ask(type="websocket", path="/_nicegui_ws/")
    told = [record.getMessage() for record in caplog.records]
    assert told == [
        r"401 PUT '/api/v1/x\n' for a stranger from 10.0.0.7",
        "421 GET '/api/v1/me' for a stranger from 10.0.0.8",
        "403 DELETE '/api/v1/x' for 'local' from ",
        "401 GET '/_nicegui_ws/' for a stranger from ",
    ]
    for world, path in ((network, "/"), (network, "/login"), (loopback, "/api/v1/me")):
        world.ask(path=path)
    assert len(caplog.records) == 4


def test_over_tls_browsers_are_told_to_stay_there(network):
    for scheme, told in (("https", True), ("http", False)):
        for headers, status in ((program(), 200), ({}, 401), ({"host": "evil.example"}, 421)):
            assert network.ask(headers=headers, scheme=scheme) == status
            assert ("strict-transport-security" in network.headers) == told


def test_a_refusal_carries_them_too(network):
    assert network.ask() == 401
    assert (network.headers["content-type"], network.headers["x-frame-options"]) == ("application/json", "DENY")
    assert int(network.headers["content-length"]) == len(network.sent[1]["body"])
    assert "connection" not in network.headers
    assert network.ask(headers=program(**{"content-length": "99999999999"})) == 413
    assert network.headers["connection"] == "close"


def test_other_kinds_of_message_pass(network):
    async def nothing():
        return {}

    asyncio.run(network.guard({"type": "lifespan"}, nothing, nothing))
    assert [scope["type"] for scope in network.reached] == ["lifespan"]


# a socket lasts as long as its login


def frames(*texts: str) -> list[dict[str, str]]:
    return [{"type": "websocket.connect"}, *({"type": "websocket.receive", "text": text} for text in texts)]


def test_a_socket_hears_until_the_login_ends(network):
    network.body = frames("2", '42["event",1]', "3")[1:]
    assert network.ask(path="/_nicegui_ws/", headers=program(), type="websocket") is None
    assert [message.get("text") for message in network.got] == ["2", '42["event",1]', "3", None]
    # only what a person does keeps the login alive
    assert network.logins.used[1:] == [(ANNA.token, False), (ANNA.token, True), (ANNA.token, False)]
    network.logins.alive, network.got = True, []
    find = network.logins.find
    network.logins.find = lambda token, use=True: find(token, use=use) if len(network.logins.used) < 6 else None
    assert network.ask(path="/_nicegui_ws/", headers=program(), type="websocket") == ENDED
    assert network.got[-1] == {"type": "websocket.disconnect", "code": ENDED}
    assert len(network.got) == 2


# a page belongs to whoever opened it


@pytest.fixture
def page(monkeypatch):
    """Page "p" opened by anna; sockets of anna, boris and nobody."""
    theirs = SimpleNamespace(request=SimpleNamespace(state=SimpleNamespace(login=ANNA)))
    unborn = SimpleNamespace(request=None)
    unknown = SimpleNamespace(request=SimpleNamespace(state=SimpleNamespace()))
    monkeypatch.setattr(module.Client, "instances", {"p": theirs, "unborn": unborn, "unknown": unknown})
    boris = Login("b", "b", "boris", 0.0, 0.0)
    state = {"anna": {"login": ANNA}, "boris": {"login": boris}, "nobody": {"login": None}, "bare": {}}
    environ = {name: {"asgi.scope": {"state": found}} for name, found in state.items()}
    monkeypatch.setattr(module.core, "sio", SimpleNamespace(get_environ=environ.get))


@pytest.mark.parametrize(("sid", "page_", "may"), [
    ("anna", "p", True), ("boris", "p", False), ("nobody", "p", False), ("bare", "p", False), ("gone", "p", False),
    ("boris", "none", True), ("boris", "unborn", True), ("anna", "unknown", False), ("nobody", "unknown", False),
])  # fmt: skip
def test_only_its_own_user_speaks_for_a_page(page, sid, page_, may):
    calls = []

    async def later(sid, *arguments):
        calls.append(arguments)
        return "done"

    for name, argument in (("event", {"client_id": page_}), ("connect", {"QUERY_STRING": f"a=1&client_id={page_}"})):
        for handler in (later, lambda sid, *arguments: calls.append(arguments) or "done"):
            answer = asyncio.run(module._owned(name, handler)(sid, argument))
            assert answer == ("done" if may else False)
    assert len(calls) == (4 if may else 0)


def test_every_message_of_a_page_is_asked_for_its_owner_once(page, monkeypatch):
    heard = []
    kinds = ("connect", "handshake", "event", "javascript_response", "ack", "log")
    known = {name: lambda sid, *arguments, name=name: heard.append(name) or True for name in kinds}
    monkeypatch.setattr(module.core.sio, "handlers", {"/": known}, raising=False)
    monkeypatch.setattr(module.core.sio, "on", known.__setitem__, raising=False)
    module.guard_sockets()
    guarded = dict(known)
    for name, handler in guarded.items():
        given = {"client_id": "p", "QUERY_STRING": "client_id=p"}
        assert asyncio.run(handler("boris", given)) is False
        assert heard == []
        assert asyncio.run(handler("anna", given)) is True
        assert heard.pop() == name
    module.guard_sockets()  # a second bench of one process
    assert known == guarded


def test_messages_that_name_no_page(page):
    for arguments in ((), ("text",), ({},), (7,)):
        assert asyncio.run(module._owned("event", lambda *_: "done")("boris", *arguments)) == "done"
