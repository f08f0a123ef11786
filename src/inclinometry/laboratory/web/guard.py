"""What stands before every page and route: the right host, a login, no foreign sites, nothing too large or too slow."""

from __future__ import annotations

import inspect
import ipaddress
import json
import logging
import urllib.parse
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any, Final

from nicegui import Client, core

from inclinometry.findings import Finding
from inclinometry.laboratory.web.logins import Login, Logins, same_secret
from inclinometry.laboratory.web.refusals import (
    STATUS,
    BodyLimit,
    answer,
    browser_headers,
    cookie_token,
    problem_of,
)

_LOG: Final = logging.getLogger("inclinometry.laboratory.access")

# The live connection of a page belongs to whoever opened the page.


def guard_sockets() -> None:
    """Refuse messages for a page that another user opened."""
    events = ("handshake", "event", "javascript_response", "ack", "log")
    for name in ("connect", *events):
        known = core.sio.handlers["/"][name]
        if not getattr(known, "owned", False):
            core.sio.on(name, _owned(name, known))


def _owned(name: str, handler: Callable[..., Any]) -> Callable[..., Any]:
    async def checked(sid: str, *arguments: Any) -> Any:
        if not _may(sid, _page(name, arguments)):
            return False
        found = handler(sid, *arguments)
        return await found if inspect.isawaitable(found) else found

    checked.owned = True  # type: ignore[attr-defined]
    return checked


def _page(name: str, arguments: tuple[Any, ...]) -> str:
    """Name of the page a message is for."""
    content = arguments[0] if arguments and isinstance(arguments[0], dict) else {}
    if name == "connect":
        query = urllib.parse.parse_qs(str(content.get("QUERY_STRING", "")))
        return query.get("client_id", [""])[0]
    return str(content.get("client_id", ""))


def _may(sid: str, page: str) -> bool:
    client = Client.instances.get(page)
    if client is None or client.request is None:
        return True  # there is nothing to speak for
    environ = core.sio.get_environ(sid) or {}
    mine = environ.get("asgi.scope", {}).get("state", {}).get("login")
    theirs = getattr(client.request.state, "login", None)
    return mine is not None and theirs is not None and bool(mine.name == theirs.name)


Message = MutableMapping[str, Any]
Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]
SAFE: Final = ("GET", "HEAD", "OPTIONS")
ENDED: Final = 4401
"""Code with which a websocket is closed when its login has ended."""


class Guard:
    """ASGI middleware around the whole application.

    hosts : names (without port) of this server; a page of another site that makes its own name point here is refused.
        With logins the server's numeric address will do, too: no foreign site can have it for a name.
    single_user : on loopback, where whoever sits at the computer is the one user.
    """

    def __init__(self, app: App, *, logins: Logins, hosts: frozenset[str], single_user: bool) -> None:
        self._app, self._logins, self._single_user = app, logins, single_user
        self._hosts = frozenset(host.lower() for host in hosts)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let through what may pass."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers: dict[str, str] = {}
        problem = _read(scope, headers) or self._foreign(scope, headers)
        if problem is not None:
            await _refuse(scope, send, problem)
            return
        login: Login | None  # None for a stranger
        given = bearer(headers)
        if self._single_user and not given:
            login = self._logins.local()
        else:
            token = given or cookie_token(headers, secure=scope.get("scheme") in ("https", "wss"))
            found = self._logins.find(token) if token else None
            login = None if found is None else found[0]
        scope.setdefault("state", {})["login"] = login
        problem = self._stranger(scope, headers, login) or problem_of(scope, headers)
        if problem is not None:
            await _refuse(scope, send, problem)
            return
        if scope["type"] == "websocket":
            await self._app(scope, self._messages_until_logout(receive, send, login), send)
            return
        body = BodyLimit(scope, receive, headers)
        await self._app(scope, body.receive, _answered(scope, headers, body, send))

    def _foreign(self, scope: Scope, headers: dict[str, str]) -> Finding | None:
        """Requests meant for another host, or sent by a page of another site."""
        host = headers.get("host", "").lower()
        if _name(host) not in self._hosts and not (not self._single_user and _own_address(scope, host)):
            return Finding("web-host", {"host": f"{host[:80]!r}"})
        origin = headers.get("origin")
        # whoever only follows a link here sends no origin
        if origin is not None and origin.lower().partition("://")[2] != host:
            return Finding("web-foreign")
        # a browser's own word on where a request comes from: another site may link here, but embed or call nothing
        linked = scope["type"] == "http" and scope["method"] in SAFE and headers.get("sec-fetch-mode") == "navigate"
        linked = linked and headers.get("sec-fetch-dest") == "document"
        if headers.get("sec-fetch-site", "same-origin") not in ("same-origin", "none") and not linked:
            return Finding("web-foreign")
        return None

    def _stranger(self, scope: Scope, headers: dict[str, str], login: Login | None) -> Finding | None:
        path, http = scope["path"], scope["type"] == "http"
        safe = http and scope["method"] in SAFE
        # what can be seen without a login: the login itself, scripts and styles, whether the server lives
        at_all_times = ("/login", "/api/v1/login", "/favicon.ico", "/healthz")
        if (http and path in at_all_times) or (safe and path.startswith(("/_nicegui/", "/static/"))):
            return None
        if login is None:
            return Finding("web-login-needed")
        api = http and path.startswith("/api/") and not safe
        if api and not bearer(headers) and not same_secret(headers.get("x-csrf-token", ""), login.csrf):
            return Finding("web-token")
        return None

    def _messages_until_logout(self, receive: Receive, send: Send, login: Login | None) -> Receive:
        """The messages of a websocket until its login ends: whoever has logged out does nothing more on any page."""

        async def watched() -> Message:
            message = await receive()
            if message["type"] != "websocket.receive":
                return message
            # the connection's own heartbeat must not keep a login alive that no one uses
            used = str(message.get("text") or "").startswith('42["event"')
            if login is None or self._logins.find(login.token, use=used) is None:
                await send({"type": "websocket.close", "code": ENDED})
                return {"type": "websocket.disconnect", "code": ENDED}
            return message

        return watched


def bearer(headers: dict[str, str]) -> str:
    """The token of an Authorization header, "" when there is none."""
    kind, _, token = headers.get("authorization", "").partition(" ")
    return token.strip() if kind.lower() == "bearer" else ""


def _read(scope: Scope, headers: dict[str, str]) -> Finding | None:
    """Fill in the headers by name; refused when one that decides something comes twice."""
    # headers of which two could be read in two ways
    once = ("host", "origin", "authorization", "content-length", "content-type", "x-csrf-token")
    for raw_name, raw_value in scope["headers"]:
        name, value = raw_name.decode("latin-1").lower(), raw_value.decode("latin-1")
        if name in headers and name in once:
            return Finding("web-header", {"name": name, "fault": "sent twice"})
        headers[name] = f"{headers[name]}; {value}" if name in headers and name == "cookie" else value
    return None


def _name(host: str) -> str:
    """Host without port; brackets of an IPv6 address stay."""
    if host.startswith("["):
        address, _, rest = host.partition("]")
        return f"{address}]" if rest[:1] in ("", ":") and "]" in host else host
    return host.rpartition(":")[0] if ":" in host else host


def _own_address(scope: Scope, host: str) -> bool:
    """Whether the host is the numeric address at which the connection arrived."""
    server = scope.get("server") or ("",)
    try:
        return ipaddress.ip_address(_name(host).strip("[]")) == ipaddress.ip_address(str(server[0]))
    except ValueError:
        return False


def _answered(scope: Scope, headers: dict[str, str], body: BodyLimit, send: Send) -> Send:
    """Adds the headers that every answer carries; a body that was cut short is answered with the reason instead."""
    over = False

    async def answered(message: Message) -> None:
        nonlocal over
        if over:
            return
        if message["type"] == "http.response.start":
            if body.problem is not None:
                over = True
                await _refuse(scope, send, body.problem)
                return
            _note(scope, int(message["status"]))
            ours = browser_headers(scope, headers)
            # the framework's live connection would let any site read it
            kept = [
                (name, value)
                for name, value in message.get("headers", [])
                if name.lower() not in ours and not name.lower().startswith(b"access-control-")
            ]
            if body.unread:
                ours[b"connection"] = b"close"
            message["headers"] = [*kept, *ours.items()]
        await send(message)

    return answered


def _note(scope: Scope, status: int) -> None:
    """Log who was refused what."""
    if status in (401, 403, 421):
        login, client = scope.get("state", {}).get("login"), scope.get("client") or ("",)
        who = ascii(login.name) if login is not None else "a stranger"
        path, method = ascii(str(scope["path"])[:200]), scope.get("method", "websocket")
        _LOG.warning("%d %s %s for %s from %s", status, method, path, who, client[0])


async def _refuse(scope: Scope, send: Send, problem: Finding) -> None:
    """An answer without the application: JSON to programs, a redirect to browsers, a closed websocket."""
    status = STATUS[problem.code]
    if status == 401 and scope["type"] == "http" and not scope["path"].startswith("/api/"):
        status = 303
    _note(scope, status)
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": ENDED if status == 401 else 4403})
        return
    headers = {b"content-type": b"application/json", **browser_headers(scope, {})}
    body = json.dumps(answer(problem)).encode()
    if status == 303:
        headers[b"location"], body = b"/login", b""
    elif status == 401:
        headers[b"www-authenticate"] = b"Bearer"
    headers[b"content-length"] = str(len(body)).encode()
    if status in (400, 408, 413):
        headers[b"connection"] = b"close"
    await send({"type": "http.response.start", "status": status, "headers": list(headers.items())})
    await send({"type": "http.response.body", "body": body})
