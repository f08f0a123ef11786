"""What is answered when something is refused or goes wrong: a sentence, as JSON to programs, as a page to people."""

from __future__ import annotations

import asyncio
import logging
import math
import re
import time
from collections.abc import Awaitable, Callable, Mapping, MutableMapping
from functools import cache
from html import escape
from http.cookies import CookieError, SimpleCookie
from typing import Any, Final

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.exceptions import HTTPException

from inclinometry import findings
from inclinometry.digest import digest_bytes
from inclinometry.errors import InclinometryError, InputError
from inclinometry.findings import Finding
from inclinometry.laboratory.ledger.ledger import ConflictError
from inclinometry.laboratory.web.frame import language_of, without_path
from inclinometry.laboratory.web.logins import Login, TooManyError
from inclinometry.laboratory.web.words import problem, say

# What every answer tells the browser to refuse; the cookie of a login.


def policy(path: str, host: str) -> str:
    """The content security policy of an answer.

    The pages' framework compiles its templates in the browser and writes scripts and styles into the page, so these
    two must be allowed; all else comes from this server, the live connection goes to this server, and data is no page.
    """
    if path.startswith("/api/"):
        return "default-src 'none'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
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
    found = {
        b"x-content-type-options": b"nosniff",
        b"x-frame-options": b"DENY",
        # not "no-referrer", with which browsers call the sender of the login form "null"
        b"referrer-policy": b"same-origin",
        b"cross-origin-opener-policy": b"same-origin",
        b"cross-origin-resource-policy": b"same-origin",
        b"permissions-policy": b"camera=(), microphone=(), geolocation=(), payment=(), usb=(), serial=()",
    }
    found[b"content-security-policy"] = policy(path, headers.get("host", "").lower()).encode("latin-1")
    if not path.startswith(("/_nicegui/", "/static/", "/favicon.ico")):
        found[b"cache-control"] = b"no-store"
    if scope.get("scheme") == "https":
        found[b"strict-transport-security"] = b"max-age=31536000"
    return found


def cookie_name(host: str, *, secure: bool = False) -> str:
    """Name of the cookie at an address: cookies do not tell ports apart, and two benches may run on one computer.

    Over TLS its prefix lets no other name of the same domain set it.
    """
    cookie = "__Host-inclinometry" if secure else "inclinometry"
    port = host.rpartition("]")[2].rpartition(":")[2] if ":" in host.rpartition("]")[2] else ""
    return f"{cookie}-{port}" if port.isascii() and port.isdigit() else cookie


def cookie_token(headers: Mapping[str, str], *, secure: bool = False) -> str:
    """The token in the cookie of a request, "" when there is none."""
    return _cookie(headers, cookie_name(headers.get("host", ""), secure=secure))


def known_token(headers: Mapping[str, str], name: str, *, secure: bool = False) -> str:
    """What the browser of a request shows to be known as that user's, "" when nothing."""
    return _cookie(headers, _known_name(headers.get("host", ""), name, secure))


def login_cookies(login: Login, *, host: str, secure: bool) -> list[str]:
    """The Set-Cookie headers of a login: its token, and what makes this browser known at the next one."""
    flags = "Path=/; HttpOnly; SameSite=Strict" + ("; Secure" if secure else "")
    half_a_year = 180 * 86_400
    return [
        f"{cookie_name(host, secure=secure)}={login.token}; {flags}",
        f"{_known_name(host, login.name, secure)}={login.known}; Max-Age={half_a_year}; {flags}",
    ]


def _known_name(host: str, name: str, secure: bool) -> str:
    # a computer that several people use knows each of them
    return f"{cookie_name(host, secure=secure)}-{digest_bytes(name.encode()).partition(':')[2][:12]}"


def _cookie(headers: Mapping[str, str], name: str) -> str:
    try:
        morsel = SimpleCookie(headers.get("cookie", "")).get(name)
    except CookieError:
        return ""
    return "" if morsel is None else morsel.value


# Bodies of requests: how large they may be and how long they may take, whatever their headers say.

LARGEST: Final = (
    ("/login", 20_000),
    ("/api/", 2_000_000),
    ("/_nicegui_ws/", 2_000_000),
    ("/_nicegui/", 6_000_000),  # files of the import page, of 5 MB, with what surrounds them
    ("/", 64_000_000),
)
"""Start of a path -> bytes a body may have; the first that fits counts."""

Message = MutableMapping[str, Any]


class BodyError(InputError):
    """The body of a request was too large or too slow."""


def largest(path: str) -> int:
    """Bytes the body of a request to this path may have.

    Examples
    --------
    >>> largest("/login"), largest("/api/v1/tools/7"), largest("/tools")
    (20000, 2000000, 64000000)
    """
    return next(size for start, size in LARGEST if path.startswith(start))


def problem_of(scope: MutableMapping[str, Any], headers: dict[str, str]) -> Finding | None:
    """What the headers alone say against a body."""
    length, most = headers.get("content-length", "0"), largest(scope["path"])
    if not (length.isascii() and length.isdigit() and len(length) < 20):
        return Finding("web-header", {"name": "content-length", "fault": "not a number"})
    if "content-length" in headers and "transfer-encoding" in headers:
        # a proxy in front may believe the other one, and then a second request hides in the first
        return Finding("web-header", {"name": "content-length", "fault": "sent with Transfer-Encoding"})
    if int(length) > most:
        return Finding("web-body-large", {"bytes": int(length), "most": most})
    if headers.get("content-encoding", "identity").strip().lower() != "identity":
        return Finding("web-body-compressed")
    return None


class BodyLimit:
    """Hands on the body of a request until it is too large or takes too long.

    problem : once that has happened, for the answer.
    """

    # how long a body may take to arrive
    def __init__(
        self,
        scope: MutableMapping[str, Any],
        receive: Callable[[], Awaitable[Message]],
        headers: dict[str, str],
        longest_s: float = 60.0,
    ) -> None:
        self._receive, self._most, self._longest = receive, largest(scope["path"]), longest_s
        self._until = time.monotonic() + longest_s
        self._size, self._more = 0, True
        # bytes that are read after the answer was given, for the next request on the same connection
        self._long = "transfer-encoding" in headers or int(headers.get("content-length", "0")) > 65_536
        self.problem: Finding | None = None

    @property
    def unread(self) -> bool:
        """Whether so much of the body is still to come that closing the connection is better than reading it all."""
        return self._long and self._more

    async def receive(self) -> Message:
        """The next message; BodyError when the body ends here."""
        if self.problem is not None:
            raise BodyError(self.problem)
        if not self._more:
            return await self._receive()
        try:
            message = await asyncio.wait_for(self._receive(), self._until - time.monotonic())
        except TimeoutError:
            self.problem = Finding("web-body-slow", {"most_s": float(self._longest)})
            raise BodyError(self.problem) from None
        if message["type"] == "http.request":
            self._size += len(message.get("body", b""))
            self._more = bool(message.get("more_body"))
            if self._size > self._most:
                self.problem = Finding("web-body-large", {"bytes": self._size, "most": self._most})
                raise BodyError(self.problem)
        return message


METHODS: Final = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE"]
OURS: Final = Finding("web-broken", severity="refused")
"""An error of the program, not of its user."""
STATUS: Final = {
    "web-header": 400,
    "web-login-needed": 401,
    "web-login-wrong": 401,
    "web-code": 401,
    "web-foreign": 403,
    "web-token": 403,
    "web-login-ended": 403,
    "web-role": 403,
    "web-no-bench": 403,
    "ledger-not-there": 404,
    "session-no-reading": 404,
    "web-login-none": 404,
    "web-route": 404,
    "web-method": 405,
    "web-body-slow": 408,
    "ledger-far-from-target": 409,
    "ledger-far-verifying": 409,
    "web-no-instrument": 409,
    "web-body-large": 413,
    "web-body-compressed": 415,
    "web-host": 421,
    "web-wait": 429,
    "web-broken": 500,
    "ledger-disk-full": 507,
}
"""Code of a finding -> status of an answer; 422 for the others."""
_LOG: Final = logging.getLogger("inclinometry.laboratory.web")

_PAGE: Final = """<!doctype html><html lang="{language}"><head><meta charset="utf-8">
<title>{title} - inclinometry</title>
<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="stylesheet" href="/static/bench.css">
</head><body><main class="panel" style="max-width:34rem;margin:4rem auto"><h1 class="title">{title}</h1>
<p role="alert">{sentence}</p><p><a href="/">&#8592; {back}</a></p></main></body></html>"""


def status_of(error: Exception) -> int:
    """By the code of its finding; 409 where another user was first.

    >>> full = Finding("ledger-disk-full", {"ledger": "lab", "cause": "disk is full"})
    >>> status_of(InputError(full)), status_of(InputError(Finding("session-closed")))
    (507, 422)
    """
    if isinstance(error, ConflictError):
        return 409
    finding = error.finding if isinstance(error, InclinometryError) else None
    return 422 if finding is None else STATUS.get(finding.code, 422)


def explain(app: FastAPI) -> None:
    """Answer errors of the REST interface and the plain pages."""
    app.add_exception_handler(InclinometryError, _mendable)
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(Exception, _broken)


def explain_pages(app: FastAPI) -> None:
    """Answer errors of pages, in place of the framework's own page, which shows the text of any exception."""
    for kind in (404, HTTPException, RequestValidationError, InclinometryError, Exception):
        app.add_exception_handler(kind, _page)


def no_such_route(request: Request) -> JSONResponse:
    """404, or 405 with the methods that are there."""
    path = request.url.path
    allowed = {
        method.upper()
        for template, methods in request.app.openapi()["paths"].items()
        if _pattern(template).fullmatch(path)
        for method in methods
    }
    if allowed and request.method not in allowed:
        methods = tuple(sorted(allowed))
        about = {"method": request.method, "path": path[:200]}
        return refusal(Finding("web-method", {**about, "allowed": methods}), {"allow": ", ".join(methods)})
    return refusal(Finding("web-route", {"path": path[:200]}))


@cache
def _pattern(template: str) -> re.Pattern[str]:
    return re.compile(re.sub(r"\\{\w+\\}", ".+", re.escape(template)))


def of_request(error: Mapping[str, Any]) -> Finding:
    """What is wrong with a field of a request.

    Examples
    --------
    >>> str(of_request({"loc": ("body", "count"), "type": "greater_than", "ctx": {"gt": 0}, "input": -1}))
    'body.count is -1; allowed: > 0. Correct it.'
    """
    place = _utf8(".".join(str(part) for part in error.get("loc", ()))[:200]) or "body"
    message = _utf8(str(error.get("msg", ""))[:300])
    if error.get("type") == "json_invalid":
        reason = _utf8(str((error.get("ctx") or {}).get("error") or message))
        return Finding("input-field", {"name": "body", "value": "JSON", "reason": reason})
    if error.get("type") == "missing":
        return Finding("input-missing", {"names": (place,)})
    hidden = "password" in place or place.rpartition(".")[2] in ("code", "known", "secret")
    value = "***" if hidden else _utf8(_short(error.get("input")))
    kind, _, fault = str(error.get("type", "")).partition("_")
    for key, sign in (("gt", ">"), ("ge", ">="), ("lt", "<"), ("le", "<=")):
        if key in (limits := error.get("ctx") or {}):
            return Finding("input-value", {"name": place, "value": value, "allowed": f"{sign} {limits[key]}"})
    if kind in KINDS and fault in ("type", "parsing"):
        return Finding("input-kind", {"name": place, "value": value, "expected": KINDS[kind]})
    return Finding("input-field", {"name": place, "value": value, "reason": message})


KINDS: Final = {"int": "whole number", "float": "number", "string": "text", "bool": "true or false"}
"""Beginning of a type of pydantic's errors -> what it expects, as a word of the catalogue."""


def _utf8(text: str) -> str:
    """Without halves of characters."""
    return text.encode("utf-8", "replace").decode()


def _short(value: Any) -> str:
    longest_value = 80
    if isinstance(value, list | tuple | dict):
        return "{...}" if isinstance(value, dict) else "[...]"
    if isinstance(value, int) and abs(value) > 10**longest_value:
        return "1e80"
    text = repr(value[: longest_value + 1] if isinstance(value, str | bytes) else value)
    return text if len(text) <= longest_value else f"{text[:longest_value]}..."


def answer(finding: Finding) -> dict[str, Any]:
    """What an answer of the interface says of a finding; on a network without the place of the ledger."""
    said = finding.plain()
    return {"detail": without_path(said["sentence"]), "code": said["code"], "values": _json(said["values"])}


def refusal(finding: Finding, headers: dict[str, str] | None = None) -> JSONResponse:
    """The answer of the interface to what is refused."""
    return JSONResponse(answer(finding), STATUS.get(finding.code, 422), headers)


def _json(value: Any) -> Any:
    """Values as JSON has them: what is not finite is null."""
    if isinstance(value, dict):
        return {name: _json(one) for name, one in value.items()}
    if isinstance(value, list):
        return [_json(one) for one in value]
    if isinstance(value, str):
        return without_path(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _mendable(_: Request, error: Exception) -> JSONResponse:
    finding = error.finding if isinstance(error, InclinometryError) else None
    content = {"detail": without_path(str(error))} | ({} if finding is None else answer(finding))
    headers = {"retry-after": str(round(error.wait_s) + 1)} if isinstance(error, TooManyError) else None
    return JSONResponse(content, status_of(error), headers)


def _invalid(_: Request, error: Exception) -> JSONResponse:
    """All that is wrong with a request as its sentence; code and values are those of the first."""
    errors = list(error.errors()) if isinstance(error, RequestValidationError) else []
    found = [of_request(one) for one in errors[:3]] or [of_request({})]
    return JSONResponse(answer(found[0]) | {"detail": " ".join(map(str, found))}, 422)


def _broken(_: Request, error: Exception) -> JSONResponse:
    return refusal(OURS)


def _page(request: Request, error: Exception) -> Response:
    """A page of its own with the sentence and a way back."""
    language, status = language_of(request), 500
    sentence = findings.say(OURS, language)
    if isinstance(error, HTTPException):  # of the server itself: an address that leads nowhere, or to another one
        status, sentence = error.status_code, say(language, "error.no_page")
        place = (error.headers or {}).get("location")
        if place is not None:
            return RedirectResponse(place, status)
    elif isinstance(error, RequestValidationError):
        status, sentence = 422, say(language, "error.address")
    elif isinstance(error, InclinometryError):
        status, sentence = status_of(error), without_path(problem(language, error))
    else:
        _LOG.error("page %s failed", ascii(request.url.path), exc_info=error)
    title = say(language, "error.not_there" if status == 404 else "error.not_done")
    said = escape(sentence)
    return HTMLResponse(
        _PAGE.format(language=language, title=title, sentence=said, back=say(language, "nav.home")), status
    )
