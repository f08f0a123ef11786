"""Certificates: the list, one certificate with its documents, declaring it void."""

from __future__ import annotations

from typing import Final

from fastapi import HTTPException, Request
from nicegui import ui

from inclinometry.store.ledger import LedgerError
from inclinometry.store.users import User
from inclinometry.web.frame import Visitor, frame
from inclinometry.web.pages.lists import Cell, day, table, to, visible
from inclinometry.workflow.laboratory.certificates import MEDIA, Standing, certificates, digest_of, status, void

SHOWN: Final = 25
STYLES: Final = {"issued": "good", "void": "bad", "superseded": "warn"}


@ui.page("/certificates")
def certificates_page(request: Request, serial: str = "", before: int = 0) -> None:
    """All certificates, newest first, of one tool when asked."""
    with frame(request, "certificates.title") as visitor, ui.card().classes("panel"):
        say = visitor.say
        with ui.row().classes("form"):
            text = ui.input(say("tools.serial"), value=serial).props("maxlength=200")
            ui.button(
                say("ledger.search"), on_click=lambda: ui.navigate.to(to("/certificates", serial=text.value.strip()))
            ).props("outline no-caps")
            if visitor.user.may("issue"):
                ui.link(say("certificates.new"), "/certificates/new")
        found = certificates(visitor.bench.ledger, serial=serial or None, limit=SHOWN, before=max(before, 0))
        heads = [say(f"certificates.{key}") for key in ("number", "tool", "issued_on", "state", "customer", "by")]
        table(heads, [_line(visitor, one) for one in found])
        if not found:
            ui.label(say("certificates.none")).classes("dim")
        if len(found) == SHOWN:
            ui.link(say("ledger.older"), to("/certificates", serial=serial, before=found[-1].record.seq))


def _line(visitor: Visitor, one: Standing) -> tuple[Cell | str, ...]:
    record = one.record
    order = record.body["record"].get("order", {})
    return (
        Cell(one.number, to("/certificates", one.number)),
        Cell(record.keys["serial"], to("/tools", record.keys["serial"])),
        record.created[:10],
        Cell(visitor.say(f"state.{one.state}"), style=STYLES[one.state]),
        str(order.get("customer", "")) if isinstance(order, dict) else "",
        record.author,
    )


@ui.page("/certificates/{number}")
def certificate_page(request: Request, number: str) -> None:
    """One certificate; it is never edited."""
    with frame(request, "certificates.one") as visitor:
        ledger, say = visitor.bench.ledger, visitor.say
        try:
            found = status(ledger, number)
        except LedgerError as error:
            raise HTTPException(404, str(error)) from None
        _standing(visitor, found)
        record = found.record
        with ui.card().classes("panel"):
            ui.label(say("certificates.documents")).classes("subtitle")
            with ui.row():
                for name in MEDIA:
                    address = to("/api/v1/certificates", number) + f"/{name}"
                    ui.link(say(f"document.{name}"), address).props("download")
            ui.label(say("certificates.digest", digest=digest_of(record))).classes("dim number pre")
            ui.label(say("ledger.head", head=str(record.body["head"]))).classes("dim number pre")
        if found.state == "issued" and visitor.user.may("issue"):
            _change(visitor, found)


def _standing(visitor: Visitor, found: Standing) -> None:
    say, record = visitor.say, found.record
    with ui.card().classes("panel"):
        ui.label(found.number).classes("subtitle number")
        ui.label(say(f"state.{found.state}")).classes(f"judgement {STYLES[found.state]}")
        if found.reason:
            ui.label(say("certificates.because", reason=visible(found.reason)))
        if found.by:
            ui.link(say("certificates.replaced_by", number=found.by), to("/certificates", found.by))
        if record.body.get("supersedes"):
            old = str(record.body["supersedes"])
            ui.link(say("certificates.replaces", number=old), to("/certificates", old))
        with ui.row():
            ui.link(record.keys["serial"], to("/tools", record.keys["serial"])).classes("number")
            ui.label(f"{day(record.created)} UTC · {record.author}").classes("number")
            ui.link(say("verify.calibration"), f"/results/{record.body['calibration']}")
            if record.body.get("verification"):
                ui.link(say("verify.one"), f"/verifications/{record.body['verification']}")


def _change(visitor: Visitor, found: Standing) -> None:
    say, number = visitor.say, found.number
    with ui.dialog() as dialog, ui.card().classes("panel"):
        ui.label(say("certificates.void_ask", number=number))
        reason = ui.input(say("bench.reason")).props("autofocus maxlength=2000").classes("w-full")

        def declare(user: User) -> None:
            void(visitor.bench.ledger, number, str(reason.value or ""), author=user.name)
            ui.navigate.to(to("/certificates", number))

        with ui.row():
            ui.button(say("certificates.void"), on_click=visitor.action("issue", declare)).props(
                "no-caps color=negative"
            )
            ui.button(say("bench.cancel"), on_click=dialog.close).props("flat no-caps")
    with ui.card().classes("panel"):
        ui.label(say("certificates.change")).classes("subtitle")
        ui.label(say("certificates.never_edited")).classes("dim")
        with ui.row().classes("items-center"):
            ui.button(say("certificates.void"), on_click=dialog.open).props("outline no-caps color=negative")
            address = to("/certificates/new", calibration=str(found.record.body["calibration"]), supersedes=number)
            ui.link(say("certificates.supersede"), address)
