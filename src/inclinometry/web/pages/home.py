"""The first page: what is open, what is due, whether the instrument talks."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Final

from fastapi import Request
from nicegui import ui

from inclinometry.web.frame import Visitor, frame
from inclinometry.web.pages.lists import to
from inclinometry.workflow.laboratory.listing import due_days, listed
from inclinometry.workflow.laboratory.registry import tools
from inclinometry.workflow.laboratory.session import closing, load_session

SHOWN: Final = 10
LOOKED_AT: Final = 500
"""Tools asked for their next calibration."""


@ui.page("/")
def home(request: Request) -> None:
    """What to do next."""
    with frame(request, "home.title") as visitor:
        _open_sessions(visitor)
        _instrument(visitor)
        _due(visitor)


def _open_sessions(visitor: Visitor) -> None:
    ledger = visitor.bench.ledger
    with ui.card().classes("panel"):
        ui.label(visitor.say("home.open_sessions")).classes("subtitle")
        still_open = [one for one in listed(ledger, "session", limit=5 * SHOWN) if not closing(ledger, one.id)][:SHOWN]
        for record in still_open:
            session = load_session(ledger, record.id)
            with ui.row().classes("items-center"):
                ui.label(f"{session.serial}, {session.plan}").classes("number")
                done = visitor.say("home.progress", done=len(session.valid), all=len(session.positions))
                ui.label(done).classes("dim number")
                ui.link(visitor.say("home.resume"), f"/calibrate/{session.id}")
        if not still_open:
            ui.label(visitor.say("home.none_open")).classes("dim")
        if visitor.user.may("capture"):
            ui.link(visitor.say("home.start"), "/calibrate")


def _instrument(visitor: Visitor) -> None:
    with ui.card().classes("panel"):
        ui.label(visitor.say("home.instrument")).classes("subtitle")
        feed = visitor.bench.feed
        if feed is None:
            ui.label(visitor.say("home.no_instrument")).classes("dim")
        else:
            ui.label(visitor.bench.instrument).classes("number")
            connected = feed.connected
            word = visitor.say("home.connected" if connected else "home.not_connected")
            ui.label(word).classes("good" if connected else "bad")


def _due(visitor: Visitor) -> None:
    today = datetime.now(UTC).date()
    with ui.card().classes("panel"):
        ui.label(visitor.say("home.due")).classes("subtitle")
        days = due_days(visitor.bench.ledger, tools(visitor.bench.ledger, limit=LOOKED_AT))
        due = sorted((day, serial) for serial, day in days.items() if day <= today)
        for day, serial in due[:SHOWN]:
            ui.link(f"{serial} ({day:%Y-%m-%d})", to("/tools", serial)).classes("number")
        if len(due) > SHOWN:
            ui.link(visitor.say("home.more_due", number=len(due) - SHOWN), "/tools")
        if not due:
            ui.label(visitor.say("home.none_due")).classes("dim")
