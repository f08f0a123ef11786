"""What is answered when something is refused or goes wrong: a sentence, as JSON to programs, as a page to people."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping
from functools import cache
from html import escape
from typing import Any, Final

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.exceptions import HTTPException

from inclinometry.core.errors import InclinometryError
from inclinometry.store.ledger import ConflictError
from inclinometry.web.bench import RefusedError, current

METHODS: Final = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE"]
OURS: Final = "an error of this program, not yours; nothing half-done was recorded. Its log says more"
LONGEST_VALUE: Final = 80
_LOG: Final = logging.getLogger("inclinometry.web")

_PAGE: Final = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{status} - inclinometry</title>
<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="stylesheet" href="/static/bench.css">
</head><body><main class="panel" style="max-width:34rem;margin:4rem auto"><h1 class="title">{status}</h1>
<p role="alert">{sentence}</p><p><a href="/">&#8592; inclinometry</a></p></main></body></html>"""


def status_of(error: Exception) -> int:
    """409 somebody was first, 403 not allowed, 404 not there, 507 no space, 422 the rest of what a user can mend."""
    if isinstance(error, ConflictError):
        return 409
    if isinstance(error, RefusedError):
        return 403
    text = str(error)
    return 404 if text.startswith("there is no ") else 507 if "disk is full" in text else 422


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
        words = ", ".join(sorted(allowed))
        return JSONResponse(
            {"detail": f"{request.method} is not for {path[:200]}; allowed: {words}"}, 405, {"allow": words}
        )
    return JSONResponse({"detail": f"there is no {path[:200]}; GET /api describes what there is"}, 404)


@cache
def _pattern(template: str) -> re.Pattern[str]:
    return re.compile(re.sub(r"\\{\w+\\}", ".+", re.escape(template)))


def in_words(errors: list[Mapping[str, Any]]) -> str:
    """What is wrong with a request, in one sentence.

    Examples
    --------
    >>> in_words([{"loc": ("body", "count"), "msg": "Input should be greater than 0", "input": -1}])
    'body.count is -1: input should be greater than 0'
    """
    parts = []
    for error in errors[:3]:
        place = ".".join(str(part) for part in error.get("loc", ())) or "the request"
        message = str(error.get("msg", "cannot be used"))
        message = message[:1].lower() + message[1:300]
        reason = (error.get("ctx") or {}).get("error")
        if error.get("type") == "json_invalid":
            parts.append(f"the body is not JSON: {reason or message}")
        elif error.get("type") == "missing":
            parts.append(f"{place[:200]} is missing; add it")
        else:
            value = "not shown" if "password" in place else _short(error.get("input"))
            parts.append(f"{place[:200]} is {value}: {message}")
    more = f"; and {len(errors) - 3} more" if len(errors) > 3 else ""
    return "; ".join(parts).encode("utf-8", "replace").decode() + more


def _short(value: Any) -> str:
    if isinstance(value, list | tuple | dict):
        return f"{'an object' if isinstance(value, dict) else 'a list'} of {len(value)} entries"
    if isinstance(value, int) and abs(value) > 10**LONGEST_VALUE:
        return "a huge number"
    text = repr(value[: LONGEST_VALUE + 1] if isinstance(value, str | bytes) else value)
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}..."


def _mendable(_: Request, error: Exception) -> JSONResponse:
    return JSONResponse({"detail": current().told(str(error))}, status_of(error))


def _invalid(_: Request, error: Exception) -> JSONResponse:
    errors = error.errors() if isinstance(error, RequestValidationError) else []
    return JSONResponse({"detail": in_words(list(errors))}, 422)


def _broken(_: Request, error: Exception) -> JSONResponse:
    return JSONResponse({"detail": OURS}, 500)


def _page(request: Request, error: Exception) -> Response:
    """A page of its own with the sentence and a way back."""
    status, sentence = 500, OURS
    if isinstance(error, HTTPException):
        status, sentence = error.status_code, current().told(str(error.detail))
        place = (error.headers or {}).get("location")
        if place is not None:
            return RedirectResponse(place, status)
    elif isinstance(error, RequestValidationError):
        status, sentence = 422, in_words(list(error.errors()))
    elif isinstance(error, InclinometryError):
        status, sentence = status_of(error), current().told(str(error))
    else:
        _LOG.error("page %s failed", ascii(request.url.path), exc_info=error)
    return HTMLResponse(_PAGE.format(status=status, sentence=escape(sentence)), status)
