"""Users and what they may do."""

from __future__ import annotations

from fastapi import Request
from nicegui import ui

from inclinometry.store.users import ROLES, User, find_user, guard_last_administrator, put_user, users
from inclinometry.web.frame import Visitor, frame
from inclinometry.web.pages.lists import visible
from inclinometry.web.words import LANGUAGES


@ui.page("/users")
def users_page(request: Request) -> None:
    """All users, and a form."""
    with frame(request, "people.title", needs="administer") as visitor:
        with ui.card().classes("panel"):
            known = users(visitor.bench.ledger)
            if not known:
                ui.label(visitor.say("people.none")).classes("dim")
            for user in known:
                with ui.row().classes("items-center"):
                    ui.label(user.name).classes("number")
                    ui.label(visitor.say(f"role.{user.role}"))
                    ui.label(visible(user.full_name)).classes("dim")
                    if not user.active:
                        ui.label(visitor.say("people.inactive")).classes("warn")
        with ui.card().classes("panel"):
            ui.label(visitor.say("people.put")).classes("subtitle")
            UserForm(visitor)


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
            self.password = ui.input(say("people.password"), password=True).props(
                "maxlength=200 autocomplete=new-password"
            )
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
