"""What stands before every page and route: the right host, a login, no foreign sites, nothing too large."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any, Final

from inclinometry.web.logins import Login, Logins, same_secret

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

COOKIE: Final = "inclinometry"
LARGEST_BODY: Final = 64_000_000
OPEN: Final = ("/login", "/_nicegui/", "/static/", "/api/v1/login", "/favicon.ico", "/healthz")
"""What can be seen without a login: the login itself, scripts and styles, whether the server lives."""
SAFE: Final = ("GET", "HEAD", "OPTIONS")

HEADERS: Final = {
    # the pages' own framework builds its templates in the browser and sets styles inline; nothing comes from elsewhere
    "content-security-policy": "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
    "connect-src 'self' ws: wss:; frame-ancestors 'none'; base-uri 'self'; form-action 'self'; object-src 'none'",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), microphone=(), geolocation=(), payment=(), usb=()",
}


class Guard:
    """ASGI middleware around the whole application.

    Parameters
    ----------
    app : the application.
    logins : who is logged in.
    hosts : names (without port) by which this server may be addressed; a page of another site that makes its own name
        point here is refused.
    open_house : True on loopback, where whoever sits at the computer is the one user.
    """

    def __init__(self, app: App, *, logins: Logins, hosts: frozenset[str], open_house: bool) -> None:
        self._app, self._logins, self._hosts, self._open_house = app, logins, hosts, open_house

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let through what may pass."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        problem = self._foreign(scope, headers)
        if problem is not None:
            await _refuse(scope, send, *problem)
            return
        login, fresh = self._who(headers)
        scope.setdefault("state", {})["login"] = login
        problem = self._stranger(scope, headers, login) or _too_large(headers)
        if problem is not None:
            await _refuse(scope, send, *problem)
            return
        cookie = _cookie(login.token, scope.get("scheme") == "https") if fresh and login is not None else None
        await self._app(scope, _counted(receive), _dressed(send, cookie))

    def _foreign(self, scope: Scope, headers: dict[str, str]) -> tuple[int, str] | None:
        """Requests meant for another host, or sent by a page of another site."""
        host = headers.get("host", "")
        if _name(host) not in self._hosts:
            return 421, f"this server does not answer to the name {host[:80]!r}; use the address it printed"
        origin = headers.get("origin")
        unsafe = scope["type"] == "websocket" or scope["method"] not in SAFE
        if unsafe and origin is not None and origin.partition("://")[2] != host:
            return 403, "this request comes from a page of another site"
        return None

    def _who(self, headers: dict[str, str]) -> tuple[Login | None, bool]:
        """The login of a request and whether it has just begun."""
        token = bearer(headers) or _cookie_of(headers)
        found = self._logins.find(token) if token else None
        if found is not None:
            return found[0], False
        return (self._logins.local(), True) if self._open_house and not bearer(headers) else (None, False)

    def _stranger(self, scope: Scope, headers: dict[str, str], login: Login | None) -> tuple[int, str] | None:
        path = scope["path"]
        if login is None:
            if path == "/login" or any(path.startswith(p) for p in OPEN if p.endswith("/")) or path in OPEN:
                return None
            return (
                (401, "log in first") if path.startswith("/api/") or scope["type"] == "websocket" else (303, "/login")
            )
        api = scope["type"] == "http" and path.startswith("/api/") and scope["method"] not in SAFE
        if api and not bearer(headers) and not same_secret(headers.get("x-csrf-token", ""), login.csrf):
            return 403, "the header X-CSRF-Token is missing or wrong; GET /api/v1/me gives it"
        return None


def bearer(headers: dict[str, str]) -> str:
    """The token of an Authorization header, "" when there is none."""
    kind, _, token = headers.get("authorization", "").partition(" ")
    return token.strip() if kind.lower() == "bearer" else ""


def _name(host: str) -> str:
    """Host without port; brackets of an IPv6 address stay."""
    if host.startswith("["):
        return host.partition("]")[0] + "]"
    return host.rpartition(":")[0] if ":" in host else host


def _cookie_of(headers: dict[str, str]) -> str:
    try:
        morsel = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    except CookieError:
        return ""
    return "" if morsel is None else morsel.value


def _cookie(token: str, secure: bool) -> str:
    return f"{COOKIE}={token}; Path=/; HttpOnly; SameSite=Strict" + ("; Secure" if secure else "")


def login_cookie(login: Login, *, secure: bool) -> str:
    """The Set-Cookie header of a login."""
    return _cookie(login.token, secure)


def _too_large(headers: dict[str, str]) -> tuple[int, str] | None:
    length = headers.get("content-length", "0")
    if not length.isascii() or not length.isdigit():
        return 400, "the header Content-Length is not a number"
    if int(length) > LARGEST_BODY:
        return 413, f"{int(length)} bytes are too many; allowed {LARGEST_BODY}"
    return None


def _counted(receive: Receive) -> Receive:
    """Ends a body that grows beyond what is allowed, whatever its headers said."""
    total = 0

    async def counted() -> MutableMapping[str, Any]:
        nonlocal total
        message = await receive()
        if message["type"] == "http.request":
            total += len(message.get("body", b""))
            if total > LARGEST_BODY:
                return {"type": "http.disconnect"}
        return message

    return counted


def _dressed(send: Send, cookie: str | None) -> Send:
    """Adds the headers that every answer carries."""

    async def dressed(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            have = {name.lower() for name, _ in message.get("headers", [])}
            extra = [(k.encode(), v.encode()) for k, v in HEADERS.items() if k.encode() not in have]
            if cookie is not None:
                extra.append((b"set-cookie", cookie.encode()))
            message["headers"] = [*message.get("headers", []), *extra]
        await send(message)

    return dressed


async def _refuse(scope: Scope, send: Send, status: int, what: str) -> None:
    """An answer without the application: JSON to programs, a redirect to browsers, a closed websocket."""
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 4401 if status == 401 else 4403})
        return
    headers = [(b"content-type", b"application/json"), *((k.encode(), v.encode()) for k, v in HEADERS.items())]
    body = json.dumps({"detail": what}).encode()
    if status == 303:
        headers.append((b"location", what.encode()))
        body = b""
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": body})
