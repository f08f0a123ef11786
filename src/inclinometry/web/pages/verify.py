"""Verification: choosing calibration, protocol and limits; the sessions under way and the verdicts recorded."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from fastapi import Request
from nicegui import ui

from inclinometry.calibration.acceptance import GUARDS, JUDGED, Limits
from inclinometry.core.errors import InputError
from inclinometry.io.limits import limit_names, read_limits
from inclinometry.store.ledger import LedgerError, Record
from inclinometry.store.users import User
from inclinometry.web.frame import Visitor, frame
from inclinometry.web.pages.lists import Cell, day, table, to
from inclinometry.workflow.laboratory.agreed_limits import OWN, limits_content, limits_from
from inclinometry.workflow.laboratory.begin_verification import begin_verification
from inclinometry.workflow.laboratory.listing import Listed, extract, listed
from inclinometry.workflow.laboratory.session import closing
from inclinometry.workflow.laboratory.verification import protocols

SHOWN: Final = 20
OFFERED: Final = 200
UNCERTAINTY: Final = "certificate"
"""Choice of holding each error against its own uncertainty."""


@ui.page("/verify")
def verify_page(request: Request, calibration: str = "", before: int = 0) -> None:
    """A form, what is under way, what was found."""
    with frame(request, "verify.title") as visitor:
        if visitor.user.may("capture"):
            with ui.card().classes("panel"):
                ui.label(visitor.say("verify.begin")).classes("subtitle")
                VerifyForm(visitor, calibration)
        _under_way(visitor)
        _recorded(visitor, max(before, 0))


def _under_way(visitor: Visitor) -> None:
    ledger, say = visitor.bench.ledger, visitor.say
    found = listed(ledger, "session", purpose="verify", limit=SHOWN)
    still_open = [one for one in found if not closing(ledger, one.id)]
    if not still_open:
        return
    with ui.card().classes("panel"):
        ui.label(say("verify.under_way")).classes("subtitle")
        lines = [
            (
                Cell(one.keys["serial"], to("/tools", one.keys["serial"])),
                day(one.created),
                one.author,
                Cell(say("verify.capture"), f"/calibrate/{one.id}"),
                Cell(say("verify.judge"), f"/verify/{one.id}/finish"),
            )
            for one in still_open
        ]
        table([say("tools.serial"), say("verify.begun"), say("verify.by"), "", ""], lines)


def _recorded(visitor: Visitor, before: int) -> None:
    ledger, say = visitor.bench.ledger, visitor.say
    found = listed(ledger, "verification", limit=SHOWN, before=before)
    with ui.card().classes("panel"):
        ui.label(say("verify.recorded")).classes("subtitle")
        table([say(f"verify.{key}") for key in ("when", "tool", "verdict", "limits", "by")], map(_line(visitor), found))
        if not found:
            ui.label(say("verify.none")).classes("dim")
        if len(found) == SHOWN:
            ui.link(say("ledger.older"), to("/verify", before=found[-1].seq))


def _line(visitor: Visitor) -> Any:
    def line(one: Listed) -> tuple[Cell | str, ...]:
        verdict, limits = extract(visitor.bench.ledger, one, "verdict", verdict_of)
        return (
            Cell(day(one.created), f"/verifications/{one.id}"),
            Cell(one.keys["serial"], to("/tools", one.keys["serial"])),
            Cell(visitor.say(f"verdict.{verdict}"), style="good" if verdict == "pass" else "bad"),
            limits,
            one.author,
        )

    return line


def verdict_of(record: Record) -> tuple[str, str]:
    """Verdict of a verification and the name of its limits."""
    return str(record.body["verdict"]), str(record.body["limits"].get("name", ""))


class VerifyForm:
    """Calibration, protocol, limits: a preset with its source, changed values as stated by the laboratory."""

    def __init__(self, visitor: Visitor, calibration: str) -> None:
        self._visitor, say = visitor, visitor.say
        choices = {one.id: f"{one.keys['serial']} · {day(one.created)}" for one in self._offered(calibration)}
        chosen = calibration if calibration in choices else next(iter(choices), None)
        self.calibration = ui.select(choices, value=chosen, label=say("verify.calibration"), with_input=True)
        self.calibration.classes("wide")
        plans = {name: f"{name}: {p.title} ({len(p.plan)})" for name, p in protocols().items()}
        self.protocol = ui.select(plans, value=next(iter(plans)), label=say("verify.protocol")).classes("wide")
        presets = {UNCERTAINTY: say("verify.own_uncertainty"), **{name: name for name in limit_names()}}
        presets[OWN] = say("verify.own_values")
        self.preset = ui.select(presets, value=UNCERTAINTY, label=say("verify.limits"), on_change=self._fill)
        self.preset.classes("wide")
        with ui.column().classes("w-full") as box:
            with ui.row().classes("form"):
                self.values = {
                    name: ui.number(say("verify.limit_of", name=say(f"bench.{name}")), min=0.0001, max=180, step=0.01)
                    for name in JUDGED
                }
                self.low = ui.number(say("verify.low"), min=0, max=90, value=0)
                self.guard = ui.select({g: say(f"guard.{g}") for g in GUARDS}, value="none", label=say("verify.guard"))
            self.source = ui.textarea(say("verify.source")).props("autogrow maxlength=2000").classes("w-full")
            ui.label(say("verify.guard_about")).classes("dim")
        box.bind_visibility_from(self.preset, "value", lambda name: name != UNCERTAINTY)
        go = ui.button(say("verify.go"), on_click=visitor.action("capture", self._open)).props("unelevated no-caps")
        go.set_enabled(chosen is not None)
        if chosen is None:
            ui.label(say("verify.no_calibration")).classes("dim")

    def _offered(self, calibration: str) -> list[Listed]:
        ledger = self._visitor.bench.ledger
        found = listed(ledger, "calibration", limit=OFFERED)
        if calibration and all(one.id != calibration for one in found):
            try:
                record = ledger.get("calibration", calibration)
            except LedgerError:
                return found
            found.insert(0, Listed(record.kind, record.id, record.seq, record.created, record.author, record.keys))
        return found

    def _fill(self) -> None:
        """Show what a preset says."""
        name = str(self.preset.value)
        if name in limit_names():
            self._show(read_limits(name))
        elif name == OWN:
            self.source.value = ""

    def _show(self, limits: Limits) -> None:
        for name, field in self.values.items():
            value = getattr(limits, name)
            field.value = None if value is None else round(float(np.degrees(value)), 6)
        self.low.value = round(float(np.degrees(limits.min_inclination_for_azimuth)), 6)
        self.guard.value = limits.guard
        self.source.value = limits.source

    def limits(self) -> Limits | None:
        """What was chosen; a preset that was changed becomes the laboratory's own statement."""
        preset = str(self.preset.value)
        if preset == UNCERTAINTY:
            return None
        content: dict[str, Any] = {"name": OWN, "source": self.source.value, "guard": self.guard.value}
        content |= {f"{name}_deg": field.value for name, field in self.values.items()}
        content["min_inclination_deg_for_azimuth"] = self.low.value
        if preset not in limit_names():
            return limits_from(content)
        shipped = limits_content(read_limits(preset))
        changed = [key for key in content if key != "name" and not _same(content[key], shipped[key])]
        if not changed:
            return read_limits(preset)
        if "source" not in changed:
            content["source"] = f"stated by the laboratory, changed from {preset}"
        return limits_from(content)

    def _open(self, user: User) -> None:
        if self.calibration.value is None:
            raise InputError(self._visitor.say("verify.no_calibration"))
        session = begin_verification(
            self._visitor.bench.ledger,
            str(self.calibration.value),
            str(self.protocol.value),
            author=user.name,
            limits=self.limits(),
        )
        ui.navigate.to(f"/calibrate/{session.id}")


def _same(one: Any, other: Any) -> bool:
    numbers = isinstance(one, int | float) and isinstance(other, int | float)
    return abs(one - other) < 1e-6 if numbers else bool(one == other)
