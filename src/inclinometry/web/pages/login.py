"""The login page: a plain form, so that it works before anything else does."""

from __future__ import annotations

from html import escape

from fastapi import APIRouter, Form, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response

from inclinometry.web.bench import current
from inclinometry.web.frame import LANGUAGE_COOKIE
from inclinometry.web.logins import Login, TooManyError
from inclinometry.web.refusals import login_cookie
from inclinometry.web.words import LANGUAGES, preferred, say

router = APIRouter(include_in_schema=False)

_PAGE = """<!doctype html><html lang="{language}"><head><meta charset="utf-8"><title>{title} - inclinometry</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="stylesheet" href="/static/bench.css"></head>
<body><form class="panel" method="post" action="/login" style="max-width:22rem;margin:4rem auto;display:grid;gap:.8rem">
<h1 class="title">{title}</h1><p class="bad" role="alert">{problem}</p>
<label>{name}<br><input name="name" autocomplete="username" autofocus required maxlength="200"></label>
<label>{password}<br>
<input name="password" type="password" autocomplete="current-password" required maxlength="200"></label>
<button type="submit">{go}</button></form></body></html>"""


def _language(request: Request) -> str:
    chosen = request.cookies.get(LANGUAGE_COOKIE, "")
    return chosen if chosen in LANGUAGES else preferred(request.headers.get("accept-language", ""))


def _form(language: str, problem: str = "", status: int = 200) -> HTMLResponse:
    words = {key: escape(say(language, f"login.{key}")) for key in ("title", "name", "password", "go")}
    return HTMLResponse(_PAGE.format(language=language, problem=escape(problem), **words), status)


@router.get("/login")
def show(request: Request) -> Response:
    """The form; nothing to do on a bench without passwords."""
    return RedirectResponse("/", 303) if current().open_house else _form(_language(request))


@router.post("/login")
def log_in(request: Request, name: str = Form(max_length=200), password: str = Form(max_length=200)) -> Response:
    """Check name and password."""
    language = _language(request)
    try:
        login = current().logins.log_in(name, password, request.client.host if request.client else "")
    except TooManyError as error:
        answer = _form(language, say(language, "login.wait", seconds=round(error.wait_s)), 429)
        answer.headers["retry-after"] = str(round(error.wait_s) + 1)
        return answer
    if login is None:
        return _form(language, say(language, "login.wrong"), 401)
    _end(request)  # of whoever was logged in on this browser before
    cookie = login_cookie(login, host=request.headers.get("host", ""), secure=request.url.scheme == "https")
    return RedirectResponse("/", 303, headers={"set-cookie": cookie})


@router.get("/logout")
def log_out(request: Request) -> Response:
    """End the login."""
    _end(request)
    return RedirectResponse("/login", 303)


def _end(request: Request) -> None:
    login: Login | None = getattr(request.state, "login", None)
    if login is not None:
        current().logins.log_out(login.token)
