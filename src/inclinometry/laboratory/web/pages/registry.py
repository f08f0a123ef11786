"""Pages of rigs, sites and reference standards, and of what the laboratory says of itself."""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from fastapi import Request
from nicegui import events, ui

from inclinometry.errors import InclinometryError
from inclinometry.laboratory import registry
from inclinometry.laboratory.certificate.laboratory import Laboratory, Standard
from inclinometry.laboratory.ledger.chain import LedgerError, missing
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.ledger.users import User
from inclinometry.laboratory.web.frame import Visitor, frame
from inclinometry.laboratory.web.pages.forms import RecordForm
from inclinometry.laboratory.web.pages.lists import Cell, table, to
from inclinometry.report.words import plain, significant


class _Kind(NamedTuple):
    """How one kind is kept: its declaration, its records, who may change it, what a list shows of it."""

    of: type[Any]
    all: Callable[[Ledger], Sequence[Any]]
    find: Callable[[Ledger, str], Any]
    put: Callable[..., Any]
    may: str
    leave_out: tuple[str, ...]
    columns: tuple[str, ...]
    title: str
    about: str
    none: str


_KINDS = {
    "rigs": _Kind(
        registry.RegisteredRig, registry.rigs, registry.find_rig, registry.put_rig, "capture", ("driver",),
        ("sd", "place", "traceability"), "rigs.title", "rigs.about", "rigs.none",
    ),
    "sites": _Kind(
        registry.RegisteredSite, registry.sites, registry.find_site, registry.put_site, "capture", ("laboratory",),
        ("g", "b", "dip", "latitude"), "sites.title", "sites.about", "sites.none",
    ),
    "standards": _Kind(
        Standard, registry.standards, registry.find_standard, registry.put_standard, "issue", (),
        ("certificate", "due", "description"), "standards.title", "standards.about", "standards.none",
    ),
}  # fmt: skip


def _registered(kind: str) -> None:
    @ui.page(f"/{kind}")
    def page(request: Request, name: str = "") -> None:
        """All of a kind; a form for one of them or a new one."""
        _page(request, kind, name)


for _kind in _KINDS:
    _registered(_kind)


def _page(request: Request, kind: str, name: str) -> None:
    about = _KINDS[kind]
    with frame(request, about.title) as visitor:
        ledger, say = visitor.bench.ledger, visitor.say
        old = about.find(ledger, name) if name else None
        if name and old is None:
            raise LedgerError(missing(kind.removesuffix("s"), name, ledger.shown))
        with ui.card().classes("panel"):
            ui.label(say(about.about)).classes("dim")
            found = about.all(ledger)
            heads = [say("field.name"), *(say(f"field.{column}") for column in about.columns)]
            table(heads, [_line(visitor, kind, one) for one in found])
            if not found:
                ui.label(say(about.none)).classes("dim")
        if not visitor.user.may(about.may):
            return

        def save(user: User, made: Any) -> None:
            about.put(ledger, made, author=user.name)
            ui.navigate.to(f"/{kind}")

        with ui.card().classes("panel"):
            with ui.row().classes("items-center"):
                ui.label(say("form.new") if old is None else name).classes("subtitle")
                if old is not None:
                    ui.link(say("form.new"), f"/{kind}")
            find = partial(about.find, ledger)
            RecordForm(visitor, about.of, old, save, find=find, leave_out=about.leave_out, may=about.may)


def _line(visitor: Visitor, kind: str, one: Any) -> tuple[Cell | str, ...]:
    today, cells = datetime.now(UTC).date(), []
    for column in _KINDS[kind].columns:
        value = getattr(one, column)
        if column == "due":
            late = one.overdue(today) and not one.retired
            text = ["" if value is None else value.isoformat(), *([visitor.say("standards.overdue")] if late else [])]
            cells.append(Cell(" · ".join(text), style="bad" if late else ""))
        elif column == "sd":
            cells.append(Cell(visitor.number(" / ".join(f"{significant(float(np.degrees(x)))}°" for x in value))))
        elif isinstance(value, float):
            angle = column in ("dip", "latitude")
            cells.append(Cell(visitor.number(plain(float(np.degrees(value)) if angle else value, 4))))
        else:
            cells.append(Cell(str(value or "")))
    retired = f" · {visitor.say('field.retired')}" if getattr(one, "retired", False) else ""
    return Cell(one.name + retired, to(f"/{kind}", name=one.name)), *cells


@ui.page("/laboratory")
def laboratory_page(request: Request) -> None:
    """Name, address, accreditation and logo, as certificates show them."""
    with frame(request, "settings.title", needs="administer") as visitor:
        ledger, say = visitor.bench.ledger, visitor.say
        known = registry.find_laboratory(ledger)
        with ui.card().classes("panel"):
            ui.label(say("settings.about")).classes("dim")

            def save(user: User, made: Laboratory) -> None:
                registry.put_laboratory(ledger, made, author=user.name)
                ui.navigate.to("/laboratory")

            RecordForm(visitor, Laboratory, known, save, may="administer")
        with ui.card().classes("panel"):
            ui.label(say("settings.logo", size=registry.LARGEST_LOGO // 1000)).classes("subtitle")
            if known is None:
                ui.label(say("settings.name_first")).classes("dim")
                return
            _logo_form(visitor, known)


def _logo_form(visitor: Visitor, laboratory: Laboratory) -> None:
    """The logo as it is, one to take its place, and a button that removes it."""
    say, ledger, most = visitor.say, visitor.bench.ledger, registry.LARGEST_LOGO
    logo = registry.find_logo(ledger)
    if logo is not None:
        # as a picture: whatever an SVG holds, nothing in it is run
        address = f"data:{logo[0]};base64,{base64.b64encode(logo[1]).decode()}"
        ui.image(address).classes("logo").props('fit=contain position="0 50%" no-spinner no-transition')
    problem = ui.label("").classes("bad").props('role="alert"')

    async def arrived(event: events.UploadEventArguments) -> None:
        try:
            user, content = visitor.require("administer"), await event.file.read()
            registry.put_laboratory(ledger, laboratory, author=user.name, logo=content or b"-")
        except InclinometryError as error:
            problem.set_text(visitor.problem(error))
            return
        ui.navigate.to("/laboratory")

    def remove(user: User) -> None:
        registry.put_laboratory(ledger, laboratory, author=user.name, logo=b"")
        ui.navigate.to("/laboratory")

    upload = ui.upload(label=say("import.file"), auto_upload=True, max_files=1, max_file_size=most, on_upload=arrived)
    upload.classes("wide").props('accept=".png,.svg"')
    upload.on("rejected", lambda: problem.set_text(say("import.too_large")))
    if logo is not None:
        visitor.button("settings.no_logo", "outline no-caps", "administer", remove)
