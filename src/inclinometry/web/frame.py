"""The frame of every page: navigation, theme, language, units; and what a page knows of its visitor."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final, TypeVar, cast

from fastapi import HTTPException, Request
from nicegui import context, core, run, ui

from inclinometry.core.errors import InclinometryError
from inclinometry.store.users import User
from inclinometry.web.bench import Bench, RefusedError, current
from inclinometry.web.logins import Login
from inclinometry.web.words import LANGUAGES, preferred, say

T = TypeVar("T")

LANGUAGE_COOKIE: Final = "inclinometry_language"
THEME_COOKIE: Final = "inclinometry_theme"
NAVIGATION: Final = (
    ("/", "nav.home", "read"),
    ("/tools", "nav.tools", "read"),
    ("/calibrate", "nav.calibrate", "capture"),
    ("/verify", "nav.verify", "capture"),
    ("/certificates", "nav.certificates", "read"),
    ("/ledger", "nav.ledger", "read"),
    ("/users", "nav.users", "administer"),
)


async def aside(do: Callable[[], T]) -> T:
    """Do in a thread what takes its time. When page or server has gone meanwhile, what was to be shown ends here."""
    client = context.client
    found = await run.io_bound(do)
    if client.is_deleted or core.app.is_stopping:
        raise asyncio.CancelledError
    return cast("T", found)


@dataclass(frozen=True)
class Visitor:
    """Who looks at a page, and in which language."""

    bench: Bench
    login: Login | None
    language: str
    user: User

    def say(self, key: str, **values: Any) -> str:
        """A text of the catalogue in the visitor's language."""
        return say(self.language, key, **values)

    def require(self, what: str) -> User:
        """The user as of now, when allowed to do this; RefusedError otherwise. Call it in every action."""
        return self.bench.require(self.login, what)

    def action(self, what: str, do: Callable[[User], None]) -> Callable[[], None]:
        """A handler that does something only for a user who still may, and says what went wrong."""

        def handler() -> None:
            try:
                do(self.require(what))
            except InclinometryError as error:
                ui.notify(self.bench.told(str(error)), type="negative", multi_line=True, timeout=0, close_button="OK")

        return handler


def visitor_of(request: Request) -> Visitor:
    """The visitor of a page; a redirect to the login when there is none."""
    bench = current()
    login: Login | None = getattr(request.state, "login", None)
    try:
        user = bench.user(login)
    except RefusedError:
        raise HTTPException(303, headers={"location": "/login"}) from None
    chosen = request.cookies.get(LANGUAGE_COOKIE, "")
    language = chosen if chosen in LANGUAGES else preferred(request.headers.get("accept-language", ""))
    return Visitor(bench, login, language, user)


@contextmanager
def frame(request: Request, title: str, *, needs: str = "read") -> Iterator[Visitor]:
    """A page with its frame; the content goes inside.

    Parameters
    ----------
    request : Request
    title : str
        Key of the catalogue.
    needs : {"read", "capture", "issue", "administer"}
        What the visitor must be allowed to do to see the page.

    Raises
    ------
    HTTPException
        303 to the login, 403 for a user who may not see it.
    """
    visitor = visitor_of(request)
    if not visitor.user.may(needs):
        raise HTTPException(403, visitor.say("error.not_allowed"))
    dress(visitor.language, request)
    ui.page_title(f"{visitor.say(title)} - inclinometry")
    _header(visitor, request)
    with ui.column().classes("page").props('id="content" role="main"'):
        ui.label(visitor.say(title)).classes("title").props('role="heading" aria-level="1"')
        yield visitor
    with ui.row().classes("foot"):
        ui.label(visitor.say("frame.units"))
        if visitor.bench.open_house:
            ui.label(visitor.say("frame.local"))


def dress(language: str, request: Request) -> None:
    """Styles, theme and language of a page."""
    ui.add_head_html('<link rel="stylesheet" href="/static/bench.css">')
    theme = request.cookies.get(THEME_COOKIE, "")
    ui.colors(primary="#2474c4")  # white on it, and it on either paper, can be read
    ui.dark_mode({"dark": True, "light": False}.get(theme))
    ui.query("html").props(f'lang="{language}"')


def _header(visitor: Visitor, request: Request) -> None:
    with ui.row().classes("bar").props('role="navigation"'):
        ui.link(visitor.say("nav.skip"), "#content").classes("skip")
        here = request.url.path
        for path, key, needs in NAVIGATION:
            if visitor.user.may(needs):
                link = ui.link(visitor.say(key), path).classes("nav")
                if here == path or (path != "/" and here.startswith(path)):
                    link.props('aria-current="page"')
        ui.space()
        _choices(visitor)


def _choices(visitor: Visitor) -> None:
    """Theme, language, the user."""
    store = "document.cookie = '{name}={value};path=/;max-age=31536000;samesite=strict'; location.reload()"
    dark = store.format(
        name=THEME_COOKIE, value="' + (document.body.classList.contains('body--dark') ? 'light' : 'dark') + '"
    )
    theme = ui.button(icon="contrast").props(f'flat dense aria-label="{visitor.say("frame.theme")}"')
    theme.on("click", js_handler=f"() => {{ {dark} }}")
    with ui.row().classes("languages").props(f'aria-label="{visitor.say("frame.language")}"'):
        for code, name in LANGUAGES.items():
            pick = store.format(name=LANGUAGE_COOKIE, value=code)
            label = ui.button(code.upper()).props(f'flat dense aria-label="{name}"')
            label.on("click", js_handler=f"() => {{ {pick} }}")
            if code == visitor.language:
                label.classes("chosen")
    if not visitor.bench.open_house:
        ui.label(visitor.user.name).classes("user")
        ui.link(visitor.say("frame.log_out"), "/logout").classes("nav")
