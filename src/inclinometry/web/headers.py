"""What every answer tells the browser to refuse; the cookie of a login."""

from __future__ import annotations

from collections.abc import MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any, Final

from inclinometry.web.logins import Login

COOKIE: Final = "inclinometry"
ASSETS: Final = ("/_nicegui/", "/static/", "/favicon.ico")

_ALWAYS: Final = {
    b"x-content-type-options": b"nosniff",
    b"x-frame-options": b"DENY",
    b"referrer-policy": b"no-referrer",
    b"cross-origin-opener-policy": b"same-origin",
    b"cross-origin-resource-policy": b"same-origin",
    b"permissions-policy": b"camera=(), microphone=(), geolocation=(), payment=(), usb=(), serial=()",
}
_DATA: Final = "default-src 'none'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"


def policy(path: str, host: str) -> str:
    """The content security policy of an answer.

    The pages' framework compiles its templates in the browser and writes scripts and styles into the page, so these
    two must be allowed; all else comes from this server, the live connection goes to this server, and data is no page.
    """
    if path.startswith("/api/"):
        return _DATA
    live = f" ws://{host} wss://{host}" if host else ""
    return (
        "default-src 'none'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
        "img-src 'self' data: blob:; font-src 'self' data:; worker-src 'self' blob:; media-src 'none'; "
        f"connect-src 'self'{live}; manifest-src 'self'; frame-src 'none'; frame-ancestors 'none'; "
        "base-uri 'self'; form-action 'self'; object-src 'none'"
    )


def browser_headers(scope: MutableMapping[str, Any], headers: dict[str, str]) -> dict[bytes, bytes]:
    """Headers of the answer to a request, by lower-case name; `headers` are those of the request, once checked."""
    path = scope["path"]
    found = dict(_ALWAYS)
    found[b"content-security-policy"] = policy(path, headers.get("host", "").lower()).encode("latin-1")
    if not path.startswith(ASSETS):
        found[b"cache-control"] = b"no-store"
    if scope.get("scheme") == "https":
        found[b"strict-transport-security"] = b"max-age=31536000"
    return found


def cookie_name(host: str) -> str:
    """Name of the cookie at an address: cookies do not tell ports apart, and two benches may run on one computer.

    Examples
    --------
    >>> cookie_name("lab.example:8080"), cookie_name("lab.example")
    ('inclinometry-8080', 'inclinometry')
    """
    port = host.rpartition("]")[2].rpartition(":")[2] if ":" in host.rpartition("]")[2] else ""
    return f"{COOKIE}-{port}" if port.isascii() and port.isdigit() else COOKIE


def cookie_token(headers: dict[str, str]) -> str:
    """The token in the cookie of a request, "" when there is none."""
    try:
        morsel = SimpleCookie(headers.get("cookie", "")).get(cookie_name(headers.get("host", "")))
    except CookieError:
        return ""
    return "" if morsel is None else morsel.value


def login_cookie(login: Login, *, host: str, secure: bool) -> str:
    """The Set-Cookie header of a login."""
    return f"{cookie_name(host)}={login.token}; Path=/; HttpOnly; SameSite=Strict" + ("; Secure" if secure else "")
