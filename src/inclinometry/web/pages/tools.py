"""Tools: what they are, when they are due, and how their parameters went over the years."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
from fastapi import HTTPException, Request
from nicegui import ui

from inclinometry.core.errors import InputError
from inclinometry.store.users import User
from inclinometry.web.frame import Visitor, frame
from inclinometry.web.pages.charts import axis, band, chart
from inclinometry.workflow.laboratory.registry import RegisteredTool, find_tool, next_due, put_tool, tools
from inclinometry.workflow.laboratory.results import History, history
from inclinometry.workflow.laboratory.session import sessions

PAGE = 50
SHOWN_SESSIONS = 20


@ui.page("/tools")
def tools_page(request: Request, after: str = "") -> None:
    """All tools, a page at a time."""
    with frame(request, "tools.title") as visitor:
        found = tools(visitor.bench.ledger, limit=PAGE, after=after)
        with ui.card().classes("panel"):
            _table(visitor, found)
            if len(found) == PAGE:
                ui.link(visitor.say("tools.more"), f"/tools?after={found[-1].serial}")
        if visitor.user.may("capture"):
            with ui.card().classes("panel"):
                ui.label(visitor.say("tools.register")).classes("subtitle")
                ToolForm(visitor, None)


def _table(visitor: Visitor, found: list[RegisteredTool]) -> None:
    say, today = visitor.say, datetime.now(UTC).date()
    with ui.element("table").classes("list"):
        with ui.element("tr"):
            for key in ("serial", "name", "customer", "due"):
                with ui.element("th"):
                    ui.label(say(f"tools.{key}"))
        for tool in found:
            day = None if tool.retired else next_due(visitor.bench.ledger, tool)
            with ui.element("tr"):
                with ui.element("td"):
                    ui.link(tool.serial, f"/tools/{tool.serial}").classes("number")
                for text in (tool.name, tool.customer):
                    with ui.element("td"):
                        ui.label(text)
                with ui.element("td"):
                    due = say("tools.retired") if tool.retired else "" if day is None else f"{day:%Y-%m-%d}"
                    ui.label(due).classes("number" + (" bad" if day is not None and day <= today else ""))
    if not found:
        ui.label(say("tools.none")).classes("dim")


@ui.page("/tools/{serial}")
def tool_page(request: Request, serial: str) -> None:
    """One tool."""
    with frame(request, "tools.one") as visitor:
        tool = find_tool(visitor.bench.ledger, serial)
        if tool is None:
            raise HTTPException(404, f"there is no tool {serial!r:.80}")
        with ui.card().classes("panel"):
            ui.label(f"{tool.serial} · {tool.name}").classes("subtitle number")
            ui.label(" · ".join(x for x in (tool.manufacturer, tool.customer, tool.description) if x)).classes("dim")
            if visitor.user.may("capture"):
                ui.link(visitor.say("home.start"), f"/calibrate?serial={tool.serial}")
        _history(visitor, serial)
        _sessions(visitor, serial)
        if visitor.user.may("capture"):
            with ui.card().classes("panel"):
                ui.label(visitor.say("tools.change")).classes("subtitle")
                ToolForm(visitor, tool)


def _history(visitor: Visitor, serial: str) -> None:
    with ui.card().classes("panel"):
        ui.label(visitor.say("tools.drift")).classes("subtitle")
        try:
            found = history(visitor.bench.ledger, serial)
        except InputError:
            ui.label(visitor.say("tools.no_calibration")).classes("dim")
            return
        with ui.row():
            for record, created in zip(found.records[::-1], found.created[::-1], strict=True):
                ui.link(created[:16].replace("T", " "), f"/results/{record}").classes("number")
        names = list(found.values)
        box = ui.column().classes("w-full")

        def show(name: str) -> None:
            box.clear()
            with box:
                _drift(visitor, found, name)

        ui.select(names, value=names[0], label=visitor.say("tools.parameter"), on_change=lambda e: show(str(e.value)))
        show(names[0])


def _drift(visitor: Visitor, found: History, name: str) -> None:
    """Change of one parameter since the first calibration, with a band of two standard uncertainties."""
    change, spread = found.change(name)
    days = [created[:10] for created in found.created]
    options = {
        "xAxis": axis(visitor.say("tools.day"), kind="category", data=days),
        "yAxis": axis(visitor.say("tools.change_of", name=name)),
        "series": band(name, change.tolist(), (2.0 * spread).tolist()),
    }
    chart(options, visitor.say("tools.drift"))
    worst = float(np.max(np.abs(change) / np.where(spread > 0.0, spread, np.inf))) if len(found) > 1 else 0.0
    ui.label(visitor.say("tools.largest", ratio=f"{worst:.1f}")).classes("number " + ("bad" if worst > 3.0 else "dim"))


def _sessions(visitor: Visitor, serial: str) -> None:
    with ui.card().classes("panel"):
        ui.label(visitor.say("tools.sessions")).classes("subtitle")
        for record in sessions(visitor.bench.ledger, serial=serial, limit=SHOWN_SESSIONS):
            with ui.row():
                ui.link(record.created[:16].replace("T", " "), f"/calibrate/{record.id}").classes("number")
                ui.label(f"{record.keys['purpose']} · {record.body['plan']['name']} · {record.author}")


class ToolForm:
    """Fields of a tool; saved as a new record."""

    def __init__(self, visitor: Visitor, tool: RegisteredTool | None) -> None:
        self._visitor, self._old, say = visitor, tool, visitor.say
        low, high = (10.0, 90.0) if tool is None else np.degrees(tool.inclination_range)
        with ui.row().classes("form"):
            self.serial = ui.input(say("tools.serial"), value="" if tool is None else tool.serial).props(
                "maxlength=200"
            )
            self.serial.set_enabled(tool is None)
            self.name = ui.input(say("tools.name"), value="" if tool is None else tool.name).props("maxlength=2000")
            self.customer = ui.input(say("tools.customer"), value="" if tool is None else tool.customer)
            self.low = ui.number(say("tools.from"), value=round(float(low), 3), min=0, max=180)
            self.high = ui.number(say("tools.to"), value=round(float(high), 3), min=0, max=180)
            months = None if tool is None else tool.interval_months
            self.months = ui.number(say("tools.months"), value=months, min=1, max=120, step=1)
            self.retired = ui.switch(say("tools.retired"), value=tool is not None and tool.retired)
        ui.button(say("tools.save"), on_click=visitor.action("capture", self._save)).props("unelevated no-caps")

    def _save(self, user: User) -> None:
        ledger, serial = self._visitor.bench.ledger, str(self.serial.value).strip()
        if self._old is None and find_tool(ledger, serial) is not None:
            raise InputError(f"tool {serial!r} is registered already; change it on its own page")
        low, high = (float(np.radians(float(x.value or 0.0))) for x in (self.low, self.high))
        old = self._old or RegisteredTool(serial, "")
        tool = RegisteredTool(
            serial,
            str(self.name.value).strip() or serial,
            old.triads,
            old.manufacturer,
            str(self.customer.value).strip(),
            old.description,
            old.convention,
            (low, high),
            None if self.months.value is None else int(self.months.value),
            bool(self.retired.value),
        )
        put_tool(ledger, tool, author=user.name)
        ui.navigate.to(f"/tools/{serial}")
