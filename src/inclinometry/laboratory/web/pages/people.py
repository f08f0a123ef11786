"""Users and their logins; and a user's own account: password, second factor, logins."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import segno
from fastapi import HTTPException, Request
from nicegui import ui

from inclinometry.errors import InputError
from inclinometry.laboratory.ledger import users
from inclinometry.laboratory.ledger.passwords import LONGEST, SHORTEST, strength
from inclinometry.laboratory.ledger.second_factor import address, new_secret
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
            known = users.users(visitor.bench.ledger)
            if not known:
                ui.label(visitor.say("people.none")).classes("dim")
            for user in known:
                _user(visitor, user)
        with visitor.panel("people.put"):
            _user_form(visitor)
        if not visitor.bench.single_user:
            _logins(visitor, None)


def _user(visitor: Visitor, user: users.User) -> None:
    def remove(author: users.User) -> None:
        users.remove_second_factor(visitor.bench.ledger, user.name, author=author.name)
        ui.navigate.to("/users")

    with ui.row().classes("items-center"):
        ui.label(user.name).classes("number")
        ui.label(visitor.say(f"role.{user.role}"))
        ui.label(visible(user.full_name)).classes("dim")
        if not user.active:
            ui.label(visitor.say("people.inactive")).classes("warn")
        if user.second_factor:
            ui.label(visitor.say("account.factor")).classes("good")
            visitor.button("account.factor_remove", "flat dense no-caps", "administer", remove)


def _user_form(visitor: Visitor) -> None:
    """Name, role, password; saved as a new record."""
    say, ledger = visitor.say, visitor.bench.ledger
    roles = {role: say(f"role.{role}") for role in users.ROLES}
    with ui.row().classes("form"):
        name = ui.input(say("login.name")).props("maxlength=200 autocomplete=off")
        full_name = ui.input(say("people.full_name")).props("maxlength=200")
        role = ui.select(roles, value="operator", label=say("people.role"))
        language = ui.select(LANGUAGES, value=visitor.language, label=say("frame.language"))
        password = _new_password(visitor, lambda: [str(name.value), str(full_name.value)])
        active = ui.switch(say("people.active"), value=True)

    def save(author: users.User) -> None:
        known, wanted = str(name.value).strip(), str(role.value)
        old = users.find_user(ledger, known)
        if old is not None and old.may("administer"):
            users.guard_last_administrator(ledger, known, wanted, bool(active.value))
        said: dict[str, Any] = {"full_name": str(full_name.value).strip(), "language": str(language.value)}
        said |= {"role": wanted, "active": bool(active.value), "password": str(password.value) or None}
        users.put_user(ledger, known, author=author.name, **said)
        ui.navigate.to("/users")

    visitor.button("tools.save", "unelevated no-caps", "administer", save)


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
        with visitor.panel("login.password"):
            _password(visitor, visitor.login)
        with visitor.panel("account.factor"):
            _second_factor(visitor, visitor.login)
        _logins(visitor, visitor.user.name)


def _password(visitor: Visitor, login: Login) -> None:
    """The current password and the new one, twice."""
    say, bench = visitor.say, visitor.bench
    words = users.known_words(bench.ledger, visitor.user.name, visitor.user.full_name)
    ui.label(say("account.password_about", shortest=SHORTEST, longest=LONGEST)).classes("dim")
    with ui.row().classes("form"):
        current = _current_password(visitor)
        new = _new_password(visitor, lambda: words)
        again = ui.input(say("account.again"), password=True).props(f"{_MAX} autocomplete=new-password")

    def change(user: users.User) -> None:
        if new.value != again.value:
            raise InputError("the two passwords differ; nothing was changed")
        old = str(current.value)
        bench.logins.confirm(login, old)
        bench.logins.keep(login, users.change_password(bench.ledger, user.name, old, str(new.value)))
        for field in (current, new, again):
            field.set_value("")
        ui.notify(say("account.changed"), type="positive")

    visitor.button("account.change", 'unelevated no-caps data-testid="change"', "read", change)


def _second_factor(visitor: Visitor, login: Login) -> None:
    """Removed with the password and a code, or set up with the square code and a first code."""
    ui.label(visitor.say("account.factor_about")).classes("dim")
    with ui.column() as box:
        # as the ledger has it now: the visitor's own record may be two seconds old, as old as the removal
        now = users.find_user(visitor.bench.ledger, visitor.user.name)
        if now is not None and now.second_factor:
            _factor_to_remove(visitor, login)
        else:
            _factor_to_set_up(visitor, login, box)


def _factor_to_remove(visitor: Visitor, login: Login) -> None:
    say, bench = visitor.say, visitor.bench
    ui.label(say("account.factor_on", number=users.recovery_left(bench.ledger, visitor.user.name))).classes("good")
    with ui.row().classes("form"):
        code = ui.input(say("account.factor_now")).props("maxlength=60 autocomplete=one-time-code")
        password = _current_password(visitor)

    def remove(user: users.User) -> None:
        bench.logins.confirm(login, str(password.value), str(code.value))
        users.remove_second_factor(bench.ledger, user.name, author=user.name)
        ui.navigate.to("/account")

    visitor.button("account.factor_remove", 'outline no-caps data-testid="remove-factor"', "read", remove)


def _factor_to_set_up(visitor: Visitor, login: Login, box: ui.column) -> None:
    say, bench, secret = visitor.say, visitor.bench, new_secret()
    uri = segno.make(address(secret, visitor.user.name), error="m").svg_data_uri(scale=4, light="white")
    ui.html(f'<img alt="{say("account.factor_code")}" src="{uri}">', sanitize=False)
    grouped = " ".join(secret[i : i + 4] for i in range(0, 32, 4))
    ui.label(grouped).classes("number").props('data-testid="secret"')
    with ui.row().classes("form"):
        code = ui.input(say("account.factor_first"))
        code.props("maxlength=10 autocomplete=one-time-code inputmode=numeric")
        password = _current_password(visitor)

    def set_up(user: users.User) -> None:
        bench.logins.confirm(login, str(password.value))
        codes = users.put_second_factor(bench.ledger, user.name, str(password.value), secret, str(code.value))
        box.clear()
        with box:
            ui.label(say("account.recovery")).classes("warn")
            for one in codes:
                ui.label(one).classes("number").props('data-testid="recovery"')

    visitor.button("account.factor_set_up", 'unelevated no-caps data-testid="set-up-factor"', "read", set_up)


def _logins(visitor: Visitor, name: str | None) -> None:
    """Where this user, or without a name anyone, is logged in."""
    say, logins = visitor.say, visitor.bench.logins
    with visitor.panel("account.logins"):
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
    def end(_: users.User) -> None:
        visitor.bench.logins.end(login, name)
        ui.navigate.reload()

    may = "administer" if name is None else "read"
    visitor.button("account.end", 'flat dense no-caps data-testid="end"', may, end)
