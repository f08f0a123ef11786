"""Users and their logins; and a user's own account: password, second factor, logins."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import segno
from fastapi import HTTPException, Request
from nicegui import ui

from inclinometry.errors import InputError
from inclinometry.laboratory.ledger.passwords import LONGEST, SHORTEST, strength
from inclinometry.laboratory.ledger.second_factor import address, new_secret
from inclinometry.laboratory.ledger.users import (
    ROLES,
    User,
    change_password,
    find_user,
    guard_last_administrator,
    known_words,
    put_second_factor,
    put_user,
    recovery_left,
    remove_second_factor,
    users,
)
from inclinometry.laboratory.web.frame import Visitor, frame
from inclinometry.laboratory.web.logins import Login
from inclinometry.laboratory.web.pages.lists import visible
from inclinometry.laboratory.web.words import LANGUAGES

_MAX: Final = f"maxlength={LONGEST}"


@ui.page("/users")
def users_page(request: Request) -> None:
    """All users, a form, and who is logged in."""
    with frame(request, "people.title", needs="administer") as visitor:
        with ui.card().classes("panel"):
            known = users(visitor.bench.ledger)
            if not known:
                ui.label(visitor.say("people.none")).classes("dim")
            for user in known:
                _user(visitor, user)
        with ui.card().classes("panel"):
            ui.label(visitor.say("people.put")).classes("subtitle")
            UserForm(visitor)
        if not visitor.bench.single_user:
            _logins(visitor, None)


def _user(visitor: Visitor, user: User) -> None:
    def remove(author: User) -> None:
        remove_second_factor(visitor.bench.ledger, user.name, author=author.name)
        ui.navigate.to("/users")

    with ui.row().classes("items-center"):
        ui.label(user.name).classes("number")
        ui.label(visitor.say(f"role.{user.role}"))
        ui.label(visible(user.full_name)).classes("dim")
        if not user.active:
            ui.label(visitor.say("people.inactive")).classes("warn")
        if user.second_factor:
            ui.label(visitor.say("account.factor")).classes("good")
            button = ui.button(visitor.say("account.factor_remove"), on_click=visitor.action("administer", remove))
            button.props("flat dense no-caps")


class UserForm:
    """Name, role, password; saved as a new record."""

    def __init__(self, visitor: Visitor) -> None:
        self._visitor, say = visitor, visitor.say
        with ui.row().classes("form"):
            self.name = ui.input(say("login.name")).props("maxlength=200 autocomplete=off")
            self.full_name = ui.input(say("people.full_name")).props("maxlength=200")
            self.role = ui.select(
                {role: say(f"role.{role}") for role in ROLES}, value="operator", label=say("people.role")
            )
            self.language = ui.select(LANGUAGES, value=visitor.language, label=say("frame.language"))
            self.password = _new_password(visitor, lambda: [str(self.name.value), str(self.full_name.value)])
            self.active = ui.switch(say("people.active"), value=True)
        ui.button(say("tools.save"), on_click=visitor.action("administer", self._save)).props("unelevated no-caps")

    def _save(self, user: User) -> None:
        ledger, name, role = self._visitor.bench.ledger, str(self.name.value).strip(), str(self.role.value)
        old = find_user(ledger, name)
        if old is not None and old.may("administer"):
            guard_last_administrator(ledger, name, role, bool(self.active.value))
        put_user(
            ledger,
            name,
            role=role,
            author=user.name,
            password=str(self.password.value) or None,
            full_name=str(self.full_name.value).strip(),
            active=bool(self.active.value),
            language=str(self.language.value),
        )
        ui.navigate.to("/users")


def _new_password(visitor: Visitor, words: Callable[[], list[str]]) -> ui.input:
    """A field for a new password, which can be looked at, and how good it is while it is typed."""
    with ui.column().classes("gap-0").style("min-width: 21rem"):
        field = ui.input(visitor.say("people.password", number=SHORTEST), password=True, password_toggle_button=True)
        field.props(f"{_MAX} autocomplete=new-password")
        bar = ui.linear_progress(0.0, show_value=False).props(
            f'instant-feedback aria-label="{visitor.say("account.strength")}"'
        )

    def look() -> None:
        value = strength(str(field.value), words())
        bar.set_value(value)
        bar.props(f"color={'positive' if value >= 1.0 else 'warning'}")

    field.on_value_change(look)
    return field


def _current_password(visitor: Visitor) -> ui.input:
    field = ui.input(visitor.say("account.current"), password=True, password_toggle_button=True)
    return field.props("maxlength=200 autocomplete=current-password")


@ui.page("/account")
def account_page(request: Request) -> None:
    """What a user changes about itself."""
    with frame(request, "account.title") as visitor:
        if visitor.bench.single_user or visitor.login is None:
            raise HTTPException(303, headers={"location": "/"})
        with ui.card().classes("panel"):
            ui.label(visitor.say("login.password")).classes("subtitle")
            _Password(visitor, visitor.login)
        with ui.card().classes("panel"):
            ui.label(visitor.say("account.factor")).classes("subtitle")
            _SecondFactor(visitor, visitor.login)
        _logins(visitor, visitor.user.name)


class _Password:
    """The current password and the new one, twice."""

    def __init__(self, visitor: Visitor, login: Login) -> None:
        self._visitor, self._login, say = visitor, login, visitor.say
        words = known_words(visitor.bench.ledger, visitor.user.name, visitor.user.full_name)
        ui.label(say("account.password_about", shortest=SHORTEST, longest=LONGEST)).classes("dim")
        with ui.row().classes("form"):
            self.current = _current_password(visitor)
            self.new = _new_password(visitor, lambda: words)
            self.again = ui.input(say("account.again"), password=True).props(f"{_MAX} autocomplete=new-password")
        button = ui.button(say("account.change"), on_click=visitor.action("read", self._change))
        button.props('unelevated no-caps data-testid="change"')

    def _change(self, user: User) -> None:
        if self.new.value != self.again.value:
            raise InputError("the two passwords differ; nothing was changed")
        logins, current = self._visitor.bench.logins, str(self.current.value)
        logins.confirm(self._login, current)
        logins.keep(self._login, change_password(self._visitor.bench.ledger, user.name, current, str(self.new.value)))
        for field in (self.current, self.new, self.again):
            field.set_value("")
        ui.notify(self._visitor.say("account.changed"), type="positive")


class _SecondFactor:
    """Set up with the square code and a first code; removed with the password and a code."""

    def __init__(self, visitor: Visitor, login: Login) -> None:
        self._visitor, self._login, self._secret, say = visitor, login, new_secret(), visitor.say
        ui.label(say("account.factor_about")).classes("dim")
        with ui.column() as self._box:
            # as the ledger has it now: the visitor's own record may be two seconds old, as old as the removal
            now = find_user(visitor.bench.ledger, visitor.user.name)
            if now is not None and now.second_factor:
                left = recovery_left(visitor.bench.ledger, visitor.user.name)
                ui.label(say("account.factor_on", number=left)).classes("good")
                with ui.row().classes("form"):
                    self.code = ui.input(say("account.factor_now")).props("maxlength=60 autocomplete=one-time-code")
                    self.password = _current_password(visitor)
                button = ui.button(say("account.factor_remove"), on_click=visitor.action("read", self._remove))
                button.props('outline no-caps data-testid="remove-factor"')
                return
            uri = segno.make(address(self._secret, visitor.user.name), error="m").svg_data_uri(scale=4, light="white")
            ui.html(f'<img alt="{say("account.factor_code")}" src="{uri}">', sanitize=False)
            ui.label(" ".join(self._secret[i : i + 4] for i in range(0, 32, 4))).classes("number").props(
                'data-testid="secret"'
            )
            with ui.row().classes("form"):
                self.code = ui.input(say("account.factor_first")).props(
                    "maxlength=10 autocomplete=one-time-code inputmode=numeric"
                )
                self.password = _current_password(visitor)
            button = ui.button(say("account.factor_set_up"), on_click=visitor.action("read", self._set_up))
            button.props('unelevated no-caps data-testid="set-up-factor"')

    def _set_up(self, user: User) -> None:
        password, ledger, say = str(self.password.value), self._visitor.bench.ledger, self._visitor.say
        self._visitor.bench.logins.confirm(self._login, password)
        codes = put_second_factor(ledger, user.name, password, self._secret, str(self.code.value))
        self._box.clear()
        with self._box:
            ui.label(say("account.recovery")).classes("warn")
            for code in codes:
                ui.label(code).classes("number").props('data-testid="recovery"')

    def _remove(self, user: User) -> None:
        self._visitor.bench.logins.confirm(self._login, str(self.password.value), str(self.code.value))
        remove_second_factor(self._visitor.bench.ledger, user.name, author=user.name)
        ui.navigate.to("/account")


def _logins(visitor: Visitor, name: str | None) -> None:
    """Where this user, or without a name anybody, is logged in."""
    say, logins = visitor.say, visitor.bench.logins
    with ui.card().classes("panel"):
        ui.label(say("account.logins")).classes("subtitle")
        for login in logins.open(name):
            with ui.row().classes("items-center"):
                if name is None:
                    ui.label(login.name).classes("number")
                ui.label(f"{login.began_at} UTC · {login.address}").classes("number")
                ui.label(say("account.idle", minutes=round(logins.idle_s(login) / 60.0))).classes("dim")
                if visitor.login is not None and login.id == visitor.login.id:
                    ui.label(say("account.this")).classes("good")
                else:
                    _end_button(visitor, login.id, name)


def _end_button(visitor: Visitor, login: str, name: str | None) -> None:
    def end(_: User) -> None:
        visitor.bench.logins.end(login, name)
        ui.navigate.reload()

    button = ui.button(
        visitor.say("account.end"), on_click=visitor.action("administer" if name is None else "read", end)
    )
    button.props('flat dense no-caps data-testid="end"')
