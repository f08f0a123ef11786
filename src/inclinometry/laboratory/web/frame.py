"""The frame of every page: navigation, theme, language, units; and what a page knows of its visitor."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, TypeVar, cast

from fastapi import HTTPException, Request
from nicegui import context, core, run, ui

from inclinometry import findings
from inclinometry.errors import InclinometryError
from inclinometry.findings import Finding
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.ledger.users import User
from inclinometry.laboratory.web.logins import Login, Logins
from inclinometry.laboratory.web.words import LANGUAGES, decimal, preferred, problem, say, sentence

if TYPE_CHECKING:
    from inclinometry.laboratory.instruments.rig import RigDriver
    from inclinometry.laboratory.live import LiveFeed


class RefusedError(InclinometryError):
    """The user may not do this, or is no longer logged in."""


@dataclass
class Bench:
    """What the pages and routes of one server share.

    ledger, logins : as named.
    feed, rig : live channels of the instrument and what turns the rig, None without one.
    single_user : True on loopback: one user, no password.
    """

    ledger: Ledger
    logins: Logins
    feed: LiveFeed | None = None
    rig: RigDriver | None = None
    single_user: bool = True
    instrument: str = ""

    def without_path(self, text: str) -> str:
        """What an error or a warning says; on a network no one is told where on this computer the ledger lies."""
        return text if self.single_user else text.replace(self.ledger.shown, "the ledger")

    def user(self, login: Login | None) -> User:
        """The user of a login as the ledger has it now; RefusedError when the login has ended."""
        found = None if login is None else self.logins.find(login.token)
        if found is None:
            raise RefusedError(Finding("web-login-ended"))
        return found[1]

    def require(self, login: Login | None, what: str) -> User:
        """The user, when allowed to "read", "capture", "issue" or "administer"; else RefusedError."""
        user = self.user(login)
        if not user.may(what):
            needed = {"capture": "operator", "issue": "metrologist", "administer": "administrator"}
            about = {"user": user.name, "role": user.role, "needed": needed.get(what, "auditor")}
            raise RefusedError(Finding("web-role", about))
        return user


_CURRENT: list[Bench] = []


def serve(bench: Bench) -> None:
    """Make this the bench of the process."""
    _CURRENT[:] = [bench]


def current() -> Bench:
    """The bench of the process."""
    if not _CURRENT:
        raise RefusedError(Finding("web-no-bench"))
    return _CURRENT[0]


def without_path(text: str) -> str:
    """`Bench.without_path` of the bench of the process, if there is one."""
    return _CURRENT[0].without_path(text) if _CURRENT else text


T = TypeVar("T")

LANGUAGE_COOKIE: Final = "inclinometry_language"
THEME_COOKIE: Final = "inclinometry_theme"


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

    def number(self, text: str) -> str:
        """Ready numbers with the decimal sign of the visitor's language."""
        return decimal(self.language, text)

    def sentence(self, text: Finding | str) -> str:
        """What the program found or did, or one of its words, in the visitor's language."""
        said = findings.say(text, self.language) if isinstance(text, Finding) else sentence(self.language, text)
        return self.bench.without_path(said)

    def problem(self, error: InclinometryError) -> str:
        """What went wrong, in the visitor's language."""
        return self.bench.without_path(problem(self.language, error))

    def require(self, what: str) -> User:
        """The user as of now, when allowed to do this; RefusedError otherwise. Call it in every action."""
        return self.bench.require(self.login, what)

    @contextmanager
    def panel(self, key: str, **values: Any) -> Iterator[str]:
        """A card with a heading of the catalogue, which is given; what it holds goes inside."""
        with ui.card().classes("panel"):
            title = self.say(key, **values)
            ui.label(title).classes("subtitle")
            yield title

    def action(self, what: str, do: Callable[[User], None]) -> Callable[[], None]:
        """A handler that does something only for a user who still may, and says what went wrong."""

        def handler() -> None:
            try:
                do(self.require(what))
            except InclinometryError as error:
                self.complain(self.problem(error))

        return handler

    async def attempt(
        self, what: str, do: Callable[[User], T], tell: Callable[[str], object], button: ui.button
    ) -> T | None:
        """What a user who may does in a thread, its button off meanwhile; None where it fails, and why is told."""
        button.disable()
        try:
            user = self.require(what)
            return await aside(lambda: do(user))
        except InclinometryError as error:
            tell(self.problem(error))
        button.enable()
        return None

    def complain(self, sentence: str) -> None:
        """A sentence that stays until it is put away."""
        ui.notify(sentence, type="negative", multi_line=True, timeout=0, close_button="OK")

    def button(self, key: str, props: str, what: str, do: Callable[[User], None]) -> None:
        """A button with a text of the catalogue for an action."""
        ui.button(self.say(key), on_click=self.action(what, do)).props(props)


def visitor_of(request: Request) -> Visitor:
    """The visitor of a page; a redirect to the login when there is none."""
    bench = current()
    login: Login | None = getattr(request.state, "login", None)
    try:
        user = bench.user(login)
    except RefusedError:
        raise HTTPException(303, headers={"location": "/login"}) from None
    return Visitor(bench, login, language_of(request), user)


def language_of(request: Request) -> str:
    """The language chosen in this browser, else the one it asks for."""
    chosen = request.cookies.get(LANGUAGE_COOKIE, "")
    return chosen if chosen in LANGUAGES else preferred(request.headers.get("accept-language", ""))


NAVIGATION: Final = (
    ("/", "nav.home", "read"),
    ("/tools", "nav.tools", "read"),
    ("/calibrate", "nav.calibrate", "capture"),
    ("/verify", "nav.verify", "capture"),
    ("/certificates", "nav.certificates", "read"),
)
MORE: Final = (
    ("/rigs", "rigs.title", "read"),
    ("/sites", "sites.title", "read"),
    ("/standards", "standards.title", "read"),
    ("/laboratory", "settings.title", "administer"),
    ("/ledger", "nav.ledger", "read"),
    ("/import", "import.title", "capture"),
    ("/users", "nav.users", "administer"),
)
"""Pages of the header and of its menu: address, text, what a visitor must be allowed to do."""


def _nav(visitor: Visitor, request: Request, path: str, key: str) -> None:
    here = request.url.path
    link = ui.link(visitor.say(key), path).classes("nav")
    if here == path or (path != "/" and here.startswith(path)):
        link.props('aria-current="page"')


@contextmanager
def frame(request: Request, title: str, *, needs: str = "read") -> Iterator[Visitor]:
    """A page with its frame; the content goes inside. `title` is a key of the catalogue.

    Who may not `needs` ("read", "capture", "issue", "administer") gets 303 to the login or 403.
    """
    visitor = visitor_of(request)
    visitor.require(needs)
    set_theme(visitor.language, request)
    ui.page_title(f"{visitor.say(title)} - inclinometry")
    with ui.row().classes("bar").props('role="navigation"'):
        ui.link(visitor.say("nav.skip"), "#content").classes("skip")
        for path, key, needs in NAVIGATION:
            if visitor.user.may(needs):
                _nav(visitor, request, path, key)
        with ui.element("details").classes("more"):
            with ui.element("summary").classes("nav"):
                ui.label(visitor.say("nav.more") + " ▾")
            with ui.element("div").classes("sheet"):
                for path, key, needs in MORE:
                    if visitor.user.may(needs):
                        _nav(visitor, request, path, key)
        ui.space()
        # help, theme, language, the user
        help_ = ui.link("?", "/manual/").classes("nav help")
        help_.props(f'aria-label="{visitor.say("nav.help")}" title="{visitor.say("nav.help")}"')
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
        if not visitor.bench.single_user:
            ui.link(visitor.user.name, "/account").classes("nav user")
            ui.link(visitor.say("frame.log_out"), "/logout").classes("nav")
    with ui.column().classes("page").props('id="content" role="main"'):
        ui.label(visitor.say(title)).classes("title").props('role="heading" aria-level="1"')
        yield visitor
    with ui.row().classes("foot"):
        ui.label(visitor.say("frame.units"))
        if visitor.bench.single_user:
            ui.label(visitor.say("frame.local"))


def set_theme(language: str, request: Request) -> None:
    """Styles, theme and language of a page."""
    ui.add_head_html('<link rel="stylesheet" href="/static/bench.css">')
    theme = request.cookies.get(THEME_COOKIE, "")
    ui.colors(primary="#2474c4")  # white on it, and it on either paper, can be read
    ui.dark_mode({"dark": True, "light": False}.get(theme))
    ui.query("html").props(f'lang="{language}"')
    # the words of the framework's own parts: pages of a table, file fields
    page = context.client.page = copy(context.client.page)
    parts: dict[str, Any] = {"ru": "ru", "zh": "zh-CN"}
    page.language = parts.get(language, "en-US")
