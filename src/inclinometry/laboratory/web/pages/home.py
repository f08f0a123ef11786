"""Signing in, and the first page: what is open, what is due, whether the instrument talks."""

from __future__ import annotations

from datetime import UTC, date, datetime
from html import escape
from typing import Final

from fastapi import APIRouter, Form, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from inclinometry.findings import Finding
from inclinometry.glossary import glossary
from inclinometry.laboratory.drift import kept_drift
from inclinometry.laboratory.registry import due_days, listed, tools
from inclinometry.laboratory.session import closing_status, load_session
from inclinometry.laboratory.web.frame import Visitor, current, frame, language_of
from inclinometry.laboratory.web.logins import CodeError, Login, TooManyError
from inclinometry.laboratory.web.pages.lists import day as when
from inclinometry.laboratory.web.pages.lists import plan_words, to
from inclinometry.laboratory.web.refusals import known_token, login_cookies
from inclinometry.laboratory.web.words import say

router = APIRouter(include_in_schema=False)

_PAGE = """<!doctype html><html lang="{language}"><head><meta charset="utf-8"><title>{title} - inclinometry</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="stylesheet" href="/static/bench.css"><style>label>input:not([type=checkbox]){{width:100%}}</style></head>
<body><form class="panel" method="post" action="/login" style="max-width:22rem;margin:4rem auto;display:grid;gap:.8rem">
<h1 class="title">{title}</h1><p class="bad" role="alert">{problem}</p>
<label>{name}<br><input name="name" autocomplete="username" autofocus required maxlength="200"></label>
<label>{password}<br>
<input name="password" type="password" autocomplete="current-password" required maxlength="200"></label>
<label><input type="checkbox" onchange="form.password.type = checked ? 'text' : 'password'"> {see}</label>
<label>{code}<br><input name="code" autocomplete="one-time-code" maxlength="60"></label>
<button type="submit">{go}</button></form></body></html>"""


def _form(language: str, problem: str = "", status: int = 200) -> HTMLResponse:
    words = {key: escape(say(language, f"login.{key}")) for key in ("title", "name", "password", "see", "code", "go")}
    return HTMLResponse(_PAGE.format(language=language, problem=escape(problem), **words), status)


@router.get("/login")
def show(request: Request) -> Response:
    """The form; nothing to do on a bench without passwords."""
    return RedirectResponse("/", 303) if current().single_user else _form(language_of(request))


@router.post("/login")
def log_in(
    request: Request,
    name: str = Form(max_length=200),
    password: str = Form(max_length=200),
    code: str = Form(default="", max_length=60),
) -> Response:
    """Check name, password and, where there is one, the code of the second factor."""
    language, secure = language_of(request), request.url.scheme == "https"
    known, address = known_token(request.headers, name, secure=secure), request.client.host if request.client else ""
    try:
        login = current().logins.log_in(name, password, address, code=code, known=known)
    except TooManyError as error:
        answer = _form(language, say(language, "login.wait", seconds=round(error.wait_s)), 429)
        answer.headers["retry-after"] = str(round(error.wait_s) + 1)
        return answer
    except CodeError:
        return _form(language, say(language, "login.wrong_code"), 401)
    if login is None:
        return _form(language, say(language, "login.wrong"), 401)
    _end(request)  # of whoever was logged in on this browser before
    found = RedirectResponse("/", 303)
    for cookie in login_cookies(login, host=request.headers.get("host", ""), secure=secure):
        found.headers.append("set-cookie", cookie)
    return found


@router.get("/logout")
def log_out(request: Request) -> Response:
    """End the login."""
    _end(request)
    return RedirectResponse("/login", 303)


def _end(request: Request) -> None:
    login: Login | None = getattr(request.state, "login", None)
    if login is not None:
        current().logins.log_out(login.token)


GUIDE_COOKIE: Final = "inclinometry_guide"


def _guide(visitor: Visitor, request: Request, begun: list[bool]) -> None:
    """What to do first with an empty ledger; put away for this browser by its button."""
    if request.cookies.get(GUIDE_COOKIE) == "off":
        return
    say = visitor.say
    steps = (("guide.tool", "/tools"), ("guide.rig", "/rigs"), ("guide.start", "/calibrate"))
    with ui.card().classes("panel guide").props('data-testid="guide"') as card:
        ui.label(say("guide.title")).classes("subtitle")
        for number, ((key, path), done) in enumerate(zip(steps, (*begun, False), strict=True), 1):
            with ui.row().classes("items-center"):
                ui.label("✓" if done else str(number)).classes("step good" if done else "step")
                ui.link(say(key), path)
        with ui.row().classes("items-center"):
            ui.link(say("guide.more"), "/manual/").classes("dim")
            away = ui.button(say("guide.away"), on_click=card.delete).props('flat dense no-caps data-testid="away"')
            cookie = f"{GUIDE_COOKIE}=off;path=/;max-age=31536000;samesite=strict"
            away.on("click", js_handler=f"() => {{ document.cookie = '{cookie}'; }}")


@ui.page("/help")
def help_page(request: Request) -> None:
    """A short guide and the words of the field, where no manual is shipped."""
    with frame(request, "nav.help") as visitor:
        with ui.card().classes("panel guide"):
            ui.label(visitor.say("guide.title")).classes("subtitle")
            for number in range(1, 8):
                with ui.row().classes("items-center"):
                    ui.label(str(number)).classes("step")
                    ui.label(visitor.say(f"help.{number}"))
        with visitor.panel("help.words"):
            own = visitor.language
            with ui.element("dl").classes("glossary"):
                for key in sorted(glossary(), key=lambda key: glossary()[key][own].lower()):
                    TextElement(tag="dt", text=glossary()[key][own])
                    # definitions are in English; other readers have the English word to look it up by
                    about = glossary()[key]["definition" if own == "en" else "en"]
                    TextElement(tag="dd", text=about).props("lang=en").classes("dim")


@ui.page("/")
def home(request: Request) -> None:
    """What to do next."""
    shown = 10
    with frame(request, "home.title") as visitor:
        ledger = visitor.bench.ledger
        begun = [bool(ledger.current(kind, limit=1)) for kind in ("tool", "rig")]
        if visitor.user.may("capture") and not listed(ledger, "session", limit=1):
            _guide(visitor, request, begun)
        with visitor.panel("home.open_sessions"):
            still_open = [
                one for one in listed(ledger, "session", limit=5 * shown) if not closing_status(ledger, one.id)
            ][:shown]
            for record in still_open:
                session = load_session(ledger, record.id)
                with ui.row().classes("items-center"):
                    ui.label(f"{session.serial}, {plan_words(visitor, session.plan)}").classes("number")
                    ui.label(f"{when(record.created)} UTC · {record.author}").classes("dim number")
                    done = visitor.say("home.progress", done=len(session.valid), all=len(session.positions))
                    ui.label(done).classes("dim number")
                    ui.link(visitor.say("home.resume"), f"/calibrate/{session.id}")
            if not still_open:
                ui.label(visitor.say("home.none_open")).classes("dim")
            if visitor.user.may("capture"):
                ui.link(visitor.say("home.start"), "/calibrate")
        with visitor.panel("home.instrument"):
            feed = visitor.bench.feed
            if feed is None:
                ui.label(visitor.say("home.no_instrument")).classes("dim")
            else:
                ui.label(visitor.bench.instrument).classes("number")
                connected = feed.connected
                word = visitor.say("home.connected" if connected else "home.not_connected")
                ui.label(word).classes("good" if connected else "bad")
        today = datetime.now(UTC).date()
        with visitor.panel("home.due"):
            # tools asked for their next calibration
            registered = tools(visitor.bench.ledger, limit=500)
            days = due_days(visitor.bench.ledger, registered)
            # and by their own drift, where that is earlier
            drift = kept_drift(visitor.bench.ledger, registered)
            days |= {s: min(date.fromisoformat(one["due"]), days.get(s, date.max)) for s, one in drift.items()}
            due = sorted((day, serial) for serial, day in days.items() if day <= today)
            for day, serial in due[:shown]:
                ui.link(f"{serial} ({day:%Y-%m-%d})", to("/tools", serial)).classes("number")
            if len(due) > shown:
                ui.link(visitor.say("home.more_due", number=len(due) - shown), "/tools")
            if not due:
                ui.label(visitor.say("home.none_due")).classes("dim")
            _alarms(visitor, {serial: one["alarm"] for serial, one in sorted(drift.items()) if one["alarm"]}, shown)


def _alarms(visitor: Visitor, alarms: dict[str, Finding], shown: int) -> None:
    """Tools whose last calibration does not fit their history, as `fleet fit` found."""
    if not alarms:
        return
    ui.label(visitor.say("home.alarms")).classes("subtitle")
    for serial, alarm in list(alarms.items())[:shown]:
        ui.link(f"{serial}: {visitor.sentence(alarm)}", to("/tools", serial)).classes("bad")
    if len(alarms) > shown:
        ui.link(visitor.say("home.more_due", number=len(alarms) - shown), "/tools")
