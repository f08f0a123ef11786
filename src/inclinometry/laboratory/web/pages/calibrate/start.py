"""Choosing a tool, a rig and a plan; registering them where there are none yet."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import astuple, replace
from typing import Any, get_args, get_type_hints

import numpy as np
from fastapi import Request
from nicegui import ui

from inclinometry.calibration.conventions import USUAL, Dials
from inclinometry.errors import InputError
from inclinometry.laboratory.guided import ADAPTIVE, CALIBRATING, plan_for
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.ledger.users import User
from inclinometry.laboratory.registry import (
    RegisteredRig,
    RegisteredSite,
    RegisteredTool,
    find_rig,
    find_site,
    put_rig,
    put_site,
    put_tool,
    rigs,
    sites,
    tools,
)
from inclinometry.laboratory.session import open_session
from inclinometry.laboratory.web.frame import Visitor, frame


def say_problem(sentence: str) -> ui.notification:
    """A sentence that stays until it is put away."""
    return ui.notification(sentence, type="negative", multi_line=True, timeout=None, close_button="OK", position="top")


def ask_reason(
    visitor: Visitor, question: str, action: str, go: Callable[[str], Awaitable[None]], **values: Any
) -> None:
    """Ask for a reason in words; nothing is done without one."""
    say = visitor.say
    with ui.dialog() as dialog, ui.card().classes("panel"):
        ui.label(say(question, **values))
        reason = ui.input(say("bench.reason")).props('autofocus maxlength=2000 data-testid="reason"').classes("wide")

        async def sure() -> None:
            if str(reason.value).strip():
                dialog.close()
                await go(str(reason.value).strip())

        reason.on("keydown.enter", sure)
        with ui.row():
            ui.button(say(action), on_click=sure).props('outline no-caps data-testid="confirm"')
            ui.button(say("bench.cancel"), on_click=dialog.close).props('flat no-caps data-testid="cancel"')
    dialog.on("hide", dialog.delete)
    dialog.open()


def ask_sure(visitor: Visitor, question: str, action: str, go: Callable[[], Awaitable[None]], **values: Any) -> None:
    """Ask once more before something that is not meant to happen by a slip."""
    say = visitor.say
    with ui.dialog() as dialog, ui.card().classes("panel"):
        ui.label(say(question, **values))

        async def sure() -> None:
            dialog.close()
            await go()

        with ui.row():
            ui.button(say(action), on_click=sure).props('outline no-caps data-testid="confirm"')
            ui.button(say("bench.cancel"), on_click=dialog.close).props('flat no-caps autofocus data-testid="cancel"')
    dialog.on("hide", dialog.delete)
    dialog.open()


@ui.page("/calibrate")
def start_page(request: Request, serial: str = "") -> None:
    """A form, and the session it opens."""
    with frame(request, "start.title", needs="capture") as visitor:
        with ui.card().classes("panel start"):
            StartForm(visitor, serial)
        names = [rig.name for rig in rigs(visitor.bench.ledger)]
        if names:
            with ui.card().classes("panel start"):
                ui.label(visitor.say("start.dials")).classes("subtitle")
                ui.label(visitor.say("start.dials_about")).classes("dim")
                DialsForm(visitor, names)


class DialsChoice:
    """How the three dials of a rig count; call within a form."""

    def __init__(self, visitor: Visitor, known: Dials = USUAL) -> None:
        say = visitor.say
        self.parts = []
        for name, allowed in get_type_hints(Dials).items():
            words = {word: say(f"dials.{word}") for word in get_args(allowed)}
            part = ui.select(words, value=getattr(known, name), label=say(f"start.{name}"))
            self.parts.append(part.props(f'data-testid="{name}"'))

    def show(self, known: Dials) -> None:
        """Those of a rig."""
        for part, value in zip(self.parts, astuple(known), strict=True):
            part.set_value(value)

    @property
    def dials(self) -> Dials:
        """What is chosen."""
        return Dials(*(part.value for part in self.parts))


class DialsForm:
    """Puts right how the dials of a registered rig count."""

    def __init__(self, visitor: Visitor, names: list[str]) -> None:
        self._visitor, say = visitor, visitor.say
        ledger = visitor.bench.ledger
        self.rig = ui.select(names, value=names[0], label=say("start.rig"), on_change=self._fill)
        found = find_rig(ledger, names[0])
        self.choice = DialsChoice(visitor, USUAL if found is None else found.dials)
        save = ui.button(say("tools.save"), on_click=visitor.action("capture", self._save))
        save.props('outline no-caps data-testid="save-dials"')

    def _fill(self) -> None:
        found = find_rig(self._visitor.bench.ledger, str(self.rig.value))
        self.choice.show(USUAL if found is None else found.dials)

    def _save(self, user: User) -> None:
        ledger = self._visitor.bench.ledger
        found = find_rig(ledger, str(self.rig.value))
        if found is not None and found.dials != self.choice.dials:
            put_rig(ledger, replace(found, dials=self.choice.dials), author=user.name)
        ui.notify(self._visitor.say("start.dials_saved", rig=self.rig.value), type="positive")


class StartForm:
    """Tool, rig, plan, wanted uncertainty."""

    def __init__(self, visitor: Visitor, serial: str) -> None:
        self._visitor, ledger, say = visitor, visitor.bench.ledger, visitor.say
        serials = [tool.serial for tool in tools(ledger) if not tool.retired]
        names = [rig.name for rig in rigs(ledger)]
        places = [""] + [site.name for site in sites(ledger)]
        self.serial = _known(say("start.tool"), "serials", serials, serial or (serials[0] if serials else ""))
        self.rig = _known(say("start.rig"), "rigs", names, names[0] if names else "")
        self.rig_sd = ui.number(say("start.rig_sd"), value=0.1, min=0.0, max=10.0, step=0.01)
        self.dials = DialsChoice(visitor)
        for part in (self.rig_sd, *self.dials.parts):
            part.bind_visibility_from(self.rig, "value", lambda name: bool(name) and str(name).strip() not in names)
        self.site = ui.select(places, label=say("start.site"), value=places[-1])
        self.dip = ui.number(say("start.dip"), value=None, min=-90.0, max=90.0, step=0.1)
        self.latitude = ui.number(say("start.latitude"), value=None, min=-90.0, max=90.0, step=0.1)
        for field in (self.dip, self.latitude):
            field.bind_visibility_from(self.site, "value", lambda name: not name)
        self.left_handed = ui.switch(say("start.left_handed"))
        plans = {name: say(f"plan.{name}") for name in CALIBRATING}
        self.plan = ui.select(plans, label=say("start.plan"), value="orthogonal").props('data-testid="plan"')
        self.number = ui.number(say("start.number"), value=16, min=6, max=200, step=1)
        self.number.bind_visibility_from(self.plan, "value", lambda name: name == "optimal")
        self.wanted = ui.number(say("start.wanted"), value=None, min=0.001, max=90.0, step=0.01)
        self.wanted_inclination = ui.number(say("start.wanted_inclination"), value=None, min=0.001, max=90.0, step=0.01)
        self.heat = ui.input(say("start.temperatures"), placeholder="20, 60, 100")
        go = ui.button(say("start.go"), on_click=visitor.action("capture", self._open))
        go.props('unelevated no-caps size=lg data-testid="begin"')

    def _open(self, user: User) -> None:
        # wanted uncertainties, degrees; an adaptive plan would not end without one
        asked = {"u_azimuth_deg": self.wanted.value, "u_inclination_deg": self.wanted_inclination.value}
        wanted = {name: float(value) for name, value in asked.items() if value is not None}
        if self.plan.value == ADAPTIVE and not wanted:
            raise InputError(self._visitor.say("start.needs_wanted"))
        ledger, author = self._visitor.bench.ledger, user.name
        serial, name = str(self.serial.value or "").strip(), str(self.rig.value or "").strip()
        if ledger.latest("tool", serial=serial) is None:
            put_tool(ledger, RegisteredTool(serial, serial), author=author)
        rig = find_rig(ledger, name)
        if rig is None:
            sd = float(np.radians(float(self.rig_sd.value or 0.0)))
            rig = RegisteredRig(name, (sd, sd, sd), dials=self.dials.dials)
            put_rig(ledger, rig, author=author)
        number = int(self.number.value) if self.plan.value == "optimal" and self.number.value else None
        heat = _temperatures(str(self.heat.value or ""))
        plan, settings = plan_for(str(self.plan.value), ledger, serial, rig, number=number, temperatures=heat)
        if self.site.value:
            settings["site"] = str(self.site.value)
        elif self.dip.value is not None or self.latitude.value is not None:
            settings["site"] = _site_of(ledger, name, self.dip.value, self.latitude.value, author)
        if self.left_handed.value:
            settings["settings"] = {**settings.get("settings", {}), "left_handed": True}
        if wanted:
            only = "inclination" if set(wanted) == {"u_inclination_deg"} else "azimuth"
            settings["wanted"] = {**wanted, "criterion": only}
        purpose = "temperature" if heat else "calibrate"
        session = open_session(ledger, serial, plan, rig=name, author=author, purpose=purpose, settings=settings)
        ui.navigate.to(f"/calibrate/{session.id}")


def _site_of(ledger: Ledger, rig: str, dip_deg: float | None, latitude_deg: float | None, author: str) -> str:
    """Name of the site of a rig with this dip and latitude; others are another site, so that none is changed."""
    stated = {"dip": dip_deg, "latitude": latitude_deg}
    known = {angle: float(degrees) for angle, degrees in stated.items() if degrees is not None}
    name = ", ".join([rig, *(f"{angle} {degrees:g}°" for angle, degrees in known.items())])
    if find_site(ledger, name) is None:
        radians = {angle: float(np.radians(degrees)) for angle, degrees in known.items()}
        put_site(ledger, RegisteredSite(name, **radians), author=author)  # type: ignore[arg-type]
    return name


def _known(label: str, name: str, values: list[str], value: str) -> ui.input:
    """A text with those known so far to choose from."""
    with ui.element("datalist").props(f"id={name}"):
        for known in values:
            ui.element("option").props["value"] = known
    return ui.input(label, value=value).props(f'list={name} maxlength=200 data-testid="{name}"')


def _temperatures(text: str) -> tuple[float, ...]:
    """Numbers between commas or blanks.

    Examples
    --------
    >>> _temperatures("20, 60 100")
    (20.0, 60.0, 100.0)
    """
    try:
        return tuple(float(part) for part in text.replace(",", " ").split())
    except ValueError:
        raise InputError(f"{text[:60]!r} are not temperatures; write numbers, e.g. 20, 60, 100") from None
