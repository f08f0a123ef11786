"""Tools: what they are, when they are due, and how their parameters went over the years."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from typing import Final

import numpy as np
from fastapi import Request
from nicegui import ui

from inclinometry.arrays import Array
from inclinometry.errors import InputError
from inclinometry.laboratory import registry
from inclinometry.laboratory.drift import kept_drift
from inclinometry.laboratory.ledger.chain import LedgerError, missing
from inclinometry.laboratory.ledger.users import User
from inclinometry.laboratory.results import history
from inclinometry.laboratory.web.frame import Visitor, frame
from inclinometry.laboratory.web.pages import lists
from inclinometry.laboratory.web.pages.forms import RecordForm

SHOWN: Final = 20


@ui.page("/tools")
def tools_page(request: Request, after: str = "") -> None:
    """All tools, a page at a time."""
    page = 50
    with frame(request, "tools.title") as visitor:
        found = registry.tools(visitor.bench.ledger, limit=page, after=after)
        with ui.card().classes("panel"):
            _find(visitor)
            _table(visitor, found)
            with ui.row():
                if len(found) == page:
                    ui.link(visitor.say("tools.more"), lists.to("/tools", after=found[-1].serial))
                ui.link("CSV", "/api/v1/tables/tools.csv")
        if visitor.user.may("capture"):
            with visitor.panel("tools.register"):
                _form(visitor, None)


def _find(visitor: Visitor) -> None:
    """A serial number leads to its tool, or to the tools from there on."""
    with ui.row().classes("form"):
        text = ui.input(visitor.say("tools.serial")).props("maxlength=200")

        def go() -> None:
            serial = str(text.value or "").strip()
            known = serial and registry.find_tool(visitor.bench.ledger, serial) is not None
            ui.navigate.to(lists.to("/tools", serial) if known else lists.to("/tools", after=serial))

        text.on("keydown.enter", go)
        ui.button(visitor.say("ledger.search"), on_click=go).props("outline no-caps")


def _table(visitor: Visitor, found: list[registry.RegisteredTool]) -> None:
    say, today = visitor.say, datetime.now(UTC).date()
    due = registry.due_days(visitor.bench.ledger, found)

    def line(tool: registry.RegisteredTool) -> tuple[lists.Cell | str, ...]:
        when = due.get(tool.serial)
        text = say("tools.retired") if tool.retired else "" if when is None else f"{when:%Y-%m-%d}"
        late = "bad" if when is not None and when <= today else ""
        return (
            lists.Cell(tool.serial, lists.to("/tools", tool.serial)),
            tool.name,
            tool.customer,
            lists.Cell(text, style=late),
        )

    lists.table([say(key) for key in ("tools.serial", "field.name", "tools.customer", "tools.due")], map(line, found))
    if not found:
        ui.label(say("tools.none")).classes("dim")


@ui.page("/tools/{serial:path}")
def tool_page(request: Request, serial: str) -> None:
    """One tool."""
    with frame(request, "tools.one") as visitor:
        tool = registry.find_tool(visitor.bench.ledger, serial)
        if tool is None:
            raise LedgerError(missing("tool", serial, visitor.bench.ledger.shown))
        with ui.card().classes("panel"):
            ui.label(lists.visible(f"{tool.serial} · {tool.name}")).classes("subtitle number")
            about = " · ".join(x for x in (tool.manufacturer, tool.customer, tool.description) if x)
            if about:
                ui.label(lists.visible(about)).classes("dim")
            if tool.retired:
                ui.label(visitor.say("tools.retired")).classes("warn")
            else:
                due = registry.due_days(visitor.bench.ledger, [tool]).get(tool.serial)
                if due is None:
                    ui.label(visitor.say("tools.no_interval")).classes("dim")
                else:
                    late = due <= datetime.now(UTC).date()
                    when = ui.label(f"{visitor.say('tools.due')}{visitor.sentence(': ')}{due:%Y-%m-%d}")
                    when.classes("number " + ("bad" if late else "good"))
                _drift(visitor, tool)
            if visitor.user.may("capture"):
                with ui.row():
                    ui.link(visitor.say("home.start"), lists.to("/calibrate", serial=tool.serial))
                    ui.link(visitor.say("import.title"), lists.to("/import", serial=tool.serial))
        _history(visitor, serial)
        _sessions(visitor, serial)
        if visitor.user.may("capture"):
            with visitor.panel("tools.change"):
                _form(visitor, tool)


def _drift(visitor: Visitor, tool: registry.RegisteredTool) -> None:
    """Due date by the tool's own drift, alarm, what a check of six positions would reach, as `fleet fit` kept them."""
    found = kept_drift(visitor.bench.ledger, [tool]).get(tool.serial)
    if found is None:
        return
    due = str(found["due"])
    late = due <= datetime.now(UTC).date().isoformat()
    ui.label(visitor.say("tools.due_by_drift", day=due)).classes("number " + ("bad" if late else "good"))
    if found["alarm"]:
        ui.label(visitor.say("tools.alarm", sentence=visitor.sentence(found["alarm"]))).classes("bad")
    else:
        six, now = (f"{found[name]:.3f}" for name in ("six_deg", "now_deg"))
        ui.label(visitor.say("tools.six", six=six, now=now)).classes("dim number")
    stands = visitor.say("tools.fitted", day=found["day"], last=found["last"])
    ui.label(stands).classes("dim number")


def _history(visitor: Visitor, serial: str) -> None:
    drawn = 100  # calibrations in a drift plot, the newest
    with visitor.panel("tools.drift"):
        try:
            found = history(visitor.bench.ledger, serial, limit=drawn)
        except InputError:
            ui.label(visitor.say("tools.no_calibration")).classes("dim")
            return
        with ui.row().classes("list-of-links"):
            for record, when in list(zip(found.records, found.measured, strict=True))[: -SHOWN - 1 : -1]:
                ui.link(when.isoformat(), f"/results/{record}").classes("number")
            ui.link("CSV", lists.to("/api/v1/tables/history.csv", serial=serial))
        if len(found) == drawn:
            ui.label(visitor.say("tools.newest", number=drawn)).classes("dim")
        for kinds in dict.fromkeys(found.scale_unknown):
            days = [
                day.isoformat() for day, one in zip(found.measured, found.scale_unknown, strict=True) if one == kinds
            ]
            lists.scale_unknown(visitor, kinds, ", ".join(days) if len(days) < len(found) else "")
        names = {name: lists.parameter_words(visitor, name) for name in found.values}
        box = ui.column().classes("w-full")

        def show(name: str) -> None:
            box.clear()
            with box:
                # change of one parameter since the first calibration, with a band of two standard uncertainties
                change, spread = found.change(name)
                days = [when.isoformat() for when in found.measured]
                x, y = lists.axis(visitor.say("tools.day"), days), lists.axis(visitor.say("tools.axis"))
                ui.label(visitor.say("tools.change_of", name=names[name]))
                series = lists.band(names[name], _plain(change), _plain(2.0 * spread))
                lists.chart(visitor.say("tools.drift"), series, x, y)
                sizes = np.abs(change) / np.where(spread > 0.0, spread, np.inf)
                worst = float(np.nanmax(sizes)) if len(found) > 1 else 0.0
                largest = ui.label(visitor.say("tools.largest", ratio=f"{worst:.1f}"))
                largest.classes("number " + ("bad" if worst > 3.0 else "dim"))

        ui.select(
            names, value=next(iter(names)), label=visitor.say("tools.parameter"), on_change=lambda e: show(str(e.value))
        )
        show(next(iter(names)))


def _plain(values: Array) -> list[float | None]:
    """Numbers, None where a calibration does not have the parameter."""
    return [float(x) if np.isfinite(x) else None for x in values]


def _sessions(visitor: Visitor, serial: str) -> None:
    with visitor.panel("tools.sessions"):
        found = registry.listed(visitor.bench.ledger, "session", serial=serial, limit=SHOWN)
        if not found:
            ui.label(visitor.say("tools.no_session")).classes("dim")
            return
        lines = [
            (
                lists.Cell(lists.day(one.created), f"/calibrate/{one.id}"),
                visitor.say(f"purpose.{one.keys['purpose']}"),
                one.author,
            )
            for one in found
        ]
        lists.table([visitor.say("verify.when"), visitor.say("tools.purpose"), visitor.say("verify.by")], lines)


def _form(visitor: Visitor, tool: registry.RegisteredTool | None) -> None:
    """Fields of a tool; saved as a new record."""
    ledger = visitor.bench.ledger

    def save(user: User, made: registry.RegisteredTool) -> None:
        registry.put_tool(ledger, replace(made, name=made.name or made.serial), author=user.name)
        ui.navigate.to(lists.to("/tools", made.serial))

    hidden = ("triads", "convention")
    RecordForm(
        visitor,
        registry.RegisteredTool,
        tool,
        save,
        find=lambda serial: registry.find_tool(ledger, serial),
        leave_out=hidden,
    )
