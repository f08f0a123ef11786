"""Files of the command line brought into the ledger."""

from __future__ import annotations

from fastapi import Request
from nicegui import events, ui

from inclinometry.core.errors import InclinometryError, InputError
from inclinometry.store.ledger import Record
from inclinometry.web.frame import Visitor, aside, frame
from inclinometry.workflow.laboratory.import_file import LARGEST, import_file
from inclinometry.workflow.laboratory.registry import rigs, sites, tools
from inclinometry.workflow.laboratory.session import PURPOSES


@ui.page("/import")
def import_page(request: Request, serial: str = "") -> None:
    """Readings or tool.json, for a tool and a rig that are registered."""
    with frame(request, "import.title", needs="capture") as visitor, ui.card().classes("panel"):
        ui.label(visitor.say("import.about", size=LARGEST // 1_000_000)).classes("dim")
        ImportForm(visitor, serial)


class ImportForm:
    """Tool, rig, site, and the file; it is recorded as soon as it has arrived."""

    def __init__(self, visitor: Visitor, serial: str) -> None:
        self._visitor, ledger, say = visitor, visitor.bench.ledger, visitor.say
        serials = [tool.serial for tool in tools(ledger) if not tool.retired or tool.serial == serial]
        names = [rig.name for rig in rigs(ledger)]
        places = ["", *(site.name for site in sites(ledger))]
        chosen = serial if serial in serials else next(iter(serials), None)
        with ui.row().classes("form"):
            self.serial = ui.select(serials, value=chosen, label=say("tools.serial"), with_input=True)
            self.rig = ui.select(names, value=next(iter(names), None), label=say("start.rig"))
            self.site = ui.select(places, value=places[-1], label=say("start.site"))
            purposes = {name: say(f"purpose.{name}") for name in PURPOSES if name != "verify"}
            self.purpose = ui.select(purposes, value="calibrate", label=say("tools.purpose"))
        if not serials or not names:
            ui.label(say("import.register")).classes("warn")
        self.upload = ui.upload(
            label=say("import.file"), auto_upload=True, max_files=1, max_file_size=LARGEST, on_upload=self._arrived
        ).classes("wide")
        self.upload.on("rejected", lambda: ui.notify(say("import.too_large"), type="negative"))

    async def _arrived(self, event: events.UploadEventArguments) -> None:
        try:
            user = self._visitor.require("capture")
            if event.file.size() > LARGEST:
                raise InputError(self._visitor.say("import.too_large"))
            content = await event.file.read()
            made = await aside(lambda: self._recorded(content, user.name))
        except InclinometryError as error:
            self.upload.reset()
            ui.notify(
                self._visitor.bench.told(str(error)), type="negative", multi_line=True, timeout=0, close_button="OK"
            )
            return
        place = "/results" if made.kind == "calibration" else "/calibrate"
        ui.navigate.to(f"{place}/{made.id}")

    def _recorded(self, content: bytes, author: str) -> Record:
        return import_file(
            self._visitor.bench.ledger,
            content,
            str(self.serial.value or ""),
            str(self.rig.value or ""),
            author=author,
            site=str(self.site.value or ""),
            purpose=str(self.purpose.value),
        )
