"""Choosing a tool, a rig and a plan; registering them where there are none yet."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

import numpy as np
from fastapi import Request
from nicegui import context, ui

from inclinometry.errors import InclinometryError, InputError, wrong_kind
from inclinometry.laboratory import registry
from inclinometry.laboratory.guided_plans import ADAPTIVE, CALIBRATING, plan_for
from inclinometry.laboratory.ledger.engine import plain as is_plain
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.ledger.users import User
from inclinometry.laboratory.placeholders import stated
from inclinometry.laboratory.session import Session, closing_status, load_session, open_session
from inclinometry.laboratory.web.frame import Visitor, frame
from inclinometry.laboratory.web.pages.forms import LONGEST_KEY, DialsChoice, FieldError, NumberField, tell
from inclinometry.laboratory.web.pages.lists import day, only, visible
from inclinometry.workflow.plan import make_plan


def say_problem(sentence: str) -> ui.notification:
    """A sentence that stays until it is put away."""
    return ui.notification(sentence, type="negative", multi_line=True, timeout=None, close_button="OK", position="top")


def ask_reason(
    visitor: Visitor, question: str, action: str, go: Callable[[str], Awaitable[None]], **values: Any
) -> None:
    """Ask for a reason in words; nothing is done without one."""
    say, client = visitor.say, context.client
    with ui.dialog() as dialog, ui.card().classes("panel"):
        ui.label(say(question, **values))
        reason = ui.input(say("bench.reason")).props('autofocus maxlength=2000 data-testid="reason"').classes("wide")

        async def sure() -> None:
            if stated(str(reason.value)):
                dialog.close()
                with client:  # what takes its time outlives the dialog
                    await go(str(reason.value).strip())

        reason.on("keydown.enter", sure)
        with ui.row():
            ui.button(say(action), on_click=sure).props('outline no-caps data-testid="confirm"')
            ui.button(say("bench.cancel"), on_click=dialog.close).props('flat no-caps data-testid="cancel"')
    dialog.on("hide", dialog.delete)
    dialog.open()


def ask_sure(visitor: Visitor, question: str, action: str, go: Callable[[], Awaitable[None]], **values: Any) -> None:
    """Ask once more before something that is not meant to happen by a slip."""
    say, client = visitor.say, context.client
    with ui.dialog() as dialog, ui.card().classes("panel"):
        ui.label(say(question, **values))

        async def sure() -> None:
            dialog.close()
            with client:
                await go()

        with ui.row():
            ui.button(say(action), on_click=sure).props('outline no-caps data-testid="confirm"')
            ui.button(say("bench.cancel"), on_click=dialog.close).props('flat no-caps autofocus data-testid="cancel"')
    dialog.on("hide", dialog.delete)
    dialog.open()


@ui.page("/calibrate")
def start_page(request: Request, serial: str = "") -> None:
    """A form, and the session it opens."""
    with frame(request, "start.title", needs="capture") as visitor, ui.card().classes("panel start"):
        StartForm(visitor, serial)


class StartForm:
    """Tool, rig, plan, wanted uncertainty; of these only what the chosen plan takes."""

    def __init__(self, visitor: Visitor, serial: str) -> None:
        self._visitor, ledger, say = visitor, visitor.bench.ledger, visitor.say
        serials = [tool.serial for tool in registry.tools(ledger) if not tool.retired]
        names = [rig.name for rig in registry.rigs(ledger)]
        places = [site.name for site in registry.sites(ledger)]
        self.serial = _known(say("start.tool"), "serials", serials, serial or (serials[0] if serials else ""))
        self.rig = _known(say("start.rig"), "rigs", names, names[0] if names else "")
        self.rig_sd = NumberField(
            visitor, say("start.rig_sd"), 0.1, registry.limits_of(registry.RegisteredRig, "sd"), needed=True
        )
        self.dials = DialsChoice(visitor)
        for part in (self.rig_sd.input, *self.dials.parts):
            part.bind_visibility_from(self.rig, "value", lambda name: bool(name) and str(name).strip() not in names)
        with ui.row().classes("with-link"):
            self.site = ui.select(["", *places], label=say("start.site"), value=only(places) or "")
            ui.link(say("start.new_site"), "/sites")
        self.dip = NumberField(visitor, say("start.dip"), None, registry.limits_of(registry.RegisteredSite, "dip"))
        self.latitude = NumberField(
            visitor, say("start.latitude"), None, registry.limits_of(registry.RegisteredSite, "latitude")
        )
        for field in (self.dip, self.latitude):
            field.input.bind_visibility_from(self.site, "value", lambda name: not name)
        self._no_dip = (
            ui.label(say("start.no_dip")).classes("warn wide-row").props('role="status" data-testid="no-dip"')
        )
        for part in (self.site, self.dip.input):
            part.on_value_change(self._look_at_dip)
        self._look_at_dip()
        plans = {name: say(f"plan.{name}") for name in CALIBRATING}
        self.plan = ui.select(plans, label=say("start.plan"), value="orthogonal", on_change=self._count)
        self.plan.props('data-testid="plan"')
        self.number = NumberField(visitor, say("start.number"), 16, (6, 200), needed=True, whole=True)
        self.number.input.on_value_change(self._count)
        span = (0.001, 90.0)
        self.wanted = NumberField(visitor, say("start.wanted"), None, span)
        self.wanted_inclination = NumberField(visitor, say("start.wanted_inclination"), None, span)
        self.size = ui.label("").classes("number wide-row").props('data-testid="plan-size" role="status"')
        with ui.expansion(say("start.more")).classes("wide-row"):
            self.heat = ui.input(say("start.temperatures"), placeholder="20, 60, 100", on_change=self._count)
            self.left_handed = ui.switch(say("start.left_handed"))
        self._problem = ui.label("").classes("bad wide-row").props('role="alert" data-testid="form-problem"')
        self._resume = ui.link(say("home.resume"), "/").props('data-testid="resume"')
        self._resume.set_visibility(False)
        self._told = ""
        go = ui.button(say("start.go"), on_click=visitor.action("capture", self._open))
        go.props('unelevated no-caps size=lg data-testid="begin"')
        self._count()

    def _look_at_dip(self) -> None:
        """Say what is lost without the dip of the stand."""
        site = registry.find_site(self._visitor.bench.ledger, str(self.site.value or ""))
        stated = str(self.dip.input.value or "").strip() if site is None else site.dip is not None
        self._no_dip.set_visibility(not stated)

    def _count(self) -> None:
        """Which fields the plan takes, how many positions it has, how long they take."""
        say, name = self._visitor.say, str(self.plan.value)
        self.number.input.set_visibility(name == "optimal")
        for field in (self.wanted, self.wanted_inclination):
            field.input.set_visibility(name in (ADAPTIVE, "optimal"))
        try:
            number = int(self.number.read() or 0) if name == "optimal" else 0
            times = max(len(_temperatures(str(self.heat.value or ""))), 1)
        except (FieldError, InputError):
            self.size.set_text("")
            return
        # an adaptive plan takes nine positions at least
        count = times * (9 if name == ADAPTIVE else number or len(make_plan(name)))
        # min a position takes: turned by hand; by a motor, turning, settling and five seconds of samples
        minutes = count * (1.0 if self._visitor.bench.rig is None else 0.15)
        text = "start.size_least" if name == ADAPTIVE else "start.size"
        self.size.set_text(say(text, positions=count, minutes=max(round(minutes), 1)))

    def _read(self) -> dict[str, Any] | None:
        """What the form says; None when something in it cannot be used, which is then said at its field."""
        say, ledger, optimal = self._visitor.say, self._visitor.bench.ledger, self.plan.value == "optimal"
        aimed = optimal or self.plan.value == ADAPTIVE
        new_rig = registry.find_rig(ledger, str(self.rig.value or "").strip()) is None
        numbers = {
            "sd": (self.rig_sd, new_rig),
            "dip": (self.dip, not self.site.value),
            "latitude": (self.latitude, not self.site.value),
            "number": (self.number, optimal),
            "u_azimuth_deg": (self.wanted, aimed),
            "u_inclination_deg": (self.wanted_inclination, aimed),
        }
        found: dict[str, Any] = {}
        wrong = False
        for name, widget in (("serial", self.serial), ("rig", self.rig)):
            found[name] = str(widget.value or "").strip()
            label = say("start.tool" if name == "serial" else "start.rig")
            sentence = "" if is_plain(found[name]) else say("form.needed", field=label, most=LONGEST_KEY)
            tell(widget, sentence)
            wrong |= bool(sentence)
        for name, (field, asked) in numbers.items():
            try:
                found[name], sentence = field.read() if asked else None, ""
            except FieldError as error:
                sentence, wrong = str(error), True
            tell(field.input, sentence)
        try:
            found["heat"], sentence = _temperatures(str(self.heat.value or "")), ""
        except InputError:
            sentence, wrong = say("form.number", field=say("start.temperatures")), True
        tell(self.heat, sentence)
        # an adaptive plan would not end without a wanted uncertainty
        if not wrong and self.plan.value == ADAPTIVE and not (found["u_azimuth_deg"] or found["u_inclination_deg"]):
            tell(self.wanted.input, say("start.needs_wanted"))
            return None
        return None if wrong else found

    def _open(self, user: User) -> None:
        self._problem.set_text("")
        said = self._read()
        if said is None:
            return
        if self._still_open(said["serial"]):
            return
        try:
            session = self._begun(said, user.name)
        except InclinometryError as error:
            self._problem.set_text(self._visitor.problem(error))
            return
        ui.navigate.to(f"/calibrate/{session.id}")

    def _still_open(self, serial: str) -> bool:
        """Tell once, with the way there, of a session of this tool that is not finished; a second one is meant then."""
        ledger, newest = self._visitor.bench.ledger, 20
        unfinished = [
            one
            for one in registry.listed(ledger, "session", limit=newest, serial=serial)
            if not closing_status(ledger, one.id)
        ]
        self._resume.set_visibility(bool(unfinished))
        if not unfinished or self._told == unfinished[0].id:
            return False
        self._told = unfinished[0].id
        session = load_session(ledger, self._told)
        done = self._visitor.say("home.progress", done=len(session.valid), all=len(session.positions))
        when = day(unfinished[0].created)
        self._problem.set_text(self._visitor.say("start.still_open", tool=visible(serial), when=when, done=done))
        self._resume.props["href"] = f"/calibrate/{self._told}"
        self._resume.update()
        return True

    def _begun(self, said: dict[str, Any], author: str) -> Session:
        ledger, serial, name, heat = self._visitor.bench.ledger, said["serial"], said["rig"], said["heat"]
        wanted = {key: said[key] for key in ("u_azimuth_deg", "u_inclination_deg") if said[key] is not None}
        if ledger.latest("tool", serial=serial) is None:
            registry.put_tool(ledger, registry.RegisteredTool(serial, serial), author=author)
        rig = registry.find_rig(ledger, name)
        if rig is None:
            sd = float(np.radians(said["sd"]))
            rig = registry.RegisteredRig(name, (sd, sd, sd), dials=self.dials.dials)
            registry.put_rig(ledger, rig, author=author)
        number = None if said["number"] is None else int(said["number"])
        plan, settings = plan_for(str(self.plan.value), ledger, serial, rig, number=number, temperatures=heat)
        if self.site.value:
            settings["site"] = str(self.site.value)
        elif said["dip"] is not None or said["latitude"] is not None:
            settings["site"] = _site_of(ledger, name, said["dip"], said["latitude"], author)
        if self.left_handed.value:
            settings["settings"] = {**settings.get("settings", {}), "left_handed": True}
        if wanted:
            only = "inclination" if set(wanted) == {"u_inclination_deg"} else "azimuth"
            settings["target_u_deg"] = {**wanted, "criterion": only}
        purpose = "temperature" if heat else "calibrate"
        return open_session(ledger, serial, plan, rig=name, author=author, purpose=purpose, settings=settings)


def _site_of(ledger: Ledger, rig: str, dip_deg: float | None, latitude_deg: float | None, author: str) -> str:
    """Name of the site of a rig with this dip and latitude; others are another site, so that none is changed."""
    stated = {"dip": dip_deg, "latitude": latitude_deg}
    known = {angle: float(degrees) for angle, degrees in stated.items() if degrees is not None}
    name = ", ".join([rig, *(f"{angle} {degrees:g}°" for angle, degrees in known.items())])
    if registry.find_site(ledger, name) is None:
        radians = {angle: float(np.radians(degrees)) for angle, degrees in known.items()}
        registry.put_site(ledger, registry.RegisteredSite(name, **radians), author=author)  # type: ignore[arg-type]
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
        raise wrong_kind("temperatures", text[:60], "number") from None
