"""The ledger: what was recorded, by whom, whether it is still what was recorded; everything in one file."""

from __future__ import annotations

import json

from fastapi import Request
from nicegui import run, ui

from inclinometry.store.kinds import KINDS
from inclinometry.store.ledger import Record
from inclinometry.store.verify import verify
from inclinometry.web.api.ledger import HIDDEN
from inclinometry.web.frame import Visitor, frame

PAGE = 50
LONGEST_SHOWN = 20_000


@ui.page("/ledger")
def ledger_page(request: Request, kind: str = "event", before: int = 0, key: str = "") -> None:
    """The audit trail of one kind of record, newest first."""
    with frame(request, "ledger.title") as visitor:
        _check(visitor)
        chosen = kind if kind in KINDS and kind not in HIDDEN else "event"
        _search(visitor, chosen, key)
        keys = {next(iter(KINDS[chosen].keys)): key} if key else {}
        records = visitor.bench.ledger.find(chosen, newest=True, after=max(before, 0), limit=PAGE, **keys)
        with ui.card().classes("panel"):
            for record in records:
                _row(record)
            if not records:
                ui.label(visitor.say("ledger.none")).classes("dim")
            if len(records) == PAGE:
                ui.link(visitor.say("ledger.older"), f"/ledger?kind={chosen}&before={records[-1].seq}&key={key}")


def _check(visitor: Visitor) -> None:
    say, ledger = visitor.say, visitor.bench.ledger
    with ui.card().classes("panel"):
        head = ledger.head()
        ui.label(say("ledger.records", number=head.seq)).classes("subtitle number")
        ui.label(say("ledger.head", head=str(head))).classes("dim number").style("overflow-wrap:anywhere")
        box = ui.column()

        async def check() -> None:
            box.clear()
            with box:
                ui.spinner()
            found = await run.io_bound(lambda: verify(ledger))
            box.clear()
            if found is None:
                return
            with box:
                if found.ok:
                    ui.label(say("ledger.sound", number=found.records)).classes("good")
                for fault in found.faults:
                    ui.label(str(fault)).classes("bad number")

        with ui.row():
            ui.button(say("ledger.verify"), on_click=check).props("outline no-caps")
            if visitor.user.may("administer"):
                ui.link(say("ledger.export"), "/api/v1/ledger/export")


def _search(visitor: Visitor, kind: str, key: str) -> None:
    say = visitor.say
    kinds = [name for name in KINDS if name not in HIDDEN]
    with ui.row().classes("form"):
        chosen = ui.select(kinds, value=kind, label=say("ledger.kind"))
        text = ui.input(say("ledger.key"), value=key).props("maxlength=200")

        def go() -> None:
            ui.navigate.to(f"/ledger?kind={chosen.value}&key={_quoted(str(text.value).strip())}")

        ui.button(say("ledger.search"), on_click=go).props("outline no-caps")


def _quoted(text: str) -> str:
    from urllib.parse import quote

    return quote(text, safe="")


def _row(record: Record) -> None:
    keys = ", ".join(f"{name} {value}" for name, value in record.keys.items())
    title = f"{record.seq} · {record.created[:19].replace('T', ' ')} · {record.author} · {keys}"
    with ui.expansion(title).classes("w-full number").props("dense") as box:
        loaded: list[bool] = []

        def show() -> None:
            if not loaded:
                loaded.append(True)
                text = json.dumps(dict(record.body), ensure_ascii=False, indent=1)
                with box:
                    ui.code(text[:LONGEST_SHOWN], language="json").classes("w-full")
                    ui.label(record.digest).classes("dim number").style("overflow-wrap:anywhere")

        box.on_value_change(show)
