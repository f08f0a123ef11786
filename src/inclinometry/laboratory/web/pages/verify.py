"""Verification: choosing calibration, protocol and limits; the sessions under way and the verdicts recorded."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from textwrap import wrap
from typing import Any, Final

import numpy as np
from fastapi import Request
from nicegui import ui

from inclinometry.calibration.decision import AGREES, GUARDS, Limits
from inclinometry.constants import ANGLES, COVERAGE_FACTOR, DIALS
from inclinometry.errors import InclinometryError, refused
from inclinometry.files.json_codec import findings_in
from inclinometry.files.limits import limit_names, read_limits
from inclinometry.files.verification_json import stated_limits
from inclinometry.findings import only_notes, without_notes
from inclinometry.laboratory.ledger.ledger import LedgerError, Record
from inclinometry.laboratory.ledger.users import User
from inclinometry.laboratory.registry import cached_from_record, listed
from inclinometry.laboratory.session import closing_status, load_session
from inclinometry.laboratory.verification import (
    OWN,
    begin_verification,
    finish_verification,
    foreseen,
    judged,
    limits_content,
    limits_from,
    limits_of,
    missing_positions,
    protocols,
    recorded,
    report,
)
from inclinometry.laboratory.web.frame import Visitor, aside, frame
from inclinometry.laboratory.web.pages import lists

# Errors of a verified tool against its limits: curves, decisions, the verdict; before it is recorded and after.

Content = Mapping[str, Any]


@ui.page("/verify/{session}/finish")
def finish_page(request: Request, session: str) -> None:
    """How the positions captured so far are judged; recording the verdict."""
    with frame(request, "verify.judged") as visitor:
        ledger = visitor.bench.ledger
        seen = load_session(ledger, session)
        calibration = str(seen.settings.get("calibration", ""))
        if seen.closed or not calibration:
            ui.label(visitor.say("verify.closed")).classes("warn")
            ui.link(visitor.say("verify.recorded"), "/verify")
            return
        limits = limits_of(seen)
        done = visitor.say("home.progress", done=len(seen.valid), all=len(seen.positions))
        ui.label(f"{seen.serial} · {lists.plan_words(visitor, seen.plan)} · {done}").classes("subtitle number")
        ui.link(visitor.say("verify.capture"), f"/calibrate/{session}")
        try:
            found = judged(ledger, session, calibration, limits)
        except InclinometryError as error:
            ui.label(visitor.problem(error)).classes("warn")
            return
        lost = missing_positions(seen, found, limits)
        if lost:
            ui.label(visitor.sentence(lost)).classes("warn")
        verdict = "incomplete" if lost else found.verdict
        show_report(visitor, verdict, stated_limits(limits), report(found, seen))
        if not visitor.user.may("capture") or lost:
            return

        def judge(user: User) -> Record:
            agreed = limits_of(load_session(ledger, session))
            return finish_verification(ledger, session, calibration, author=user.name, limits=agreed)

        async def record() -> None:
            made = await visitor.attempt("capture", judge, visitor.complain, button)
            if made is not None:
                ui.navigate.to(f"/verifications/{made.id}")

        button = ui.button(visitor.say("verify.record"), on_click=record).props("unelevated no-caps")


@ui.page("/verifications/{verification}")
def verification_page(request: Request, verification: str) -> None:
    """A recorded verification."""
    with frame(request, "verify.one") as visitor:
        record = visitor.bench.ledger.get("verification", verification)
        say, serial = visitor.say, record.keys["serial"]
        calibration = record.keys["calibration"]
        with ui.row().classes("items-center"):
            ui.link(serial, lists.to("/tools", serial)).classes("number")
            ui.label(f"{lists.day(record.created)} UTC · {record.author}").classes("number")
            ui.link(say("verify.calibration"), f"/results/{calibration}")
            if visitor.user.may("issue"):
                address = lists.to("/certificates/new", calibration=calibration, verification=record.id)
                ui.link(say("results.certificate"), address)
            ui.link("CSV", f"/api/v1/tables/verification/{record.id}.csv")
        held = recorded(record)
        show_report(visitor, held["verdict"], held["limits"], held["report"])


def show_report(visitor: Visitor, verdict: str, limits: Content | None, content: Content) -> None:
    """Verdict, curves and table of a report in degrees, as `workflow.laboratory.verification.report` makes it."""
    say = visitor.say
    with ui.card().classes("panel"):
        # green only when nothing below speaks against relying on it
        found = findings_in(content)
        tone = "warn" if without_notes(found) else "good"
        word = f"{verdict} reserved" if verdict in ACCEPTED and tone == "warn" else verdict
        ui.label(say(f"verdict.{word}")).classes("judgement " + (tone if verdict in ACCEPTED else "bad"))
        if protocol := content.get("protocol"):
            ui.label(
                say("verify.of_protocol", **{**protocol, "name": lists.plan_words(visitor, str(protocol["name"]))})
            )
        for one in found:
            ui.label(visitor.sentence(one)).classes("" if one.severity == "note" else "warn")
        k = float(content.get("coverage_factor", COVERAGE_FACTOR))
        guard = "none" if limits is None else str(limits["guard"])
        if limits is None:
            ui.label(say("verify.rule.agreement", k=f"{k:.3g}")).classes("dim")
        else:
            source, name = (lists.visible(visitor.sentence(str(limits[key]))) for key in ("source", "name"))
            ui.label(say("verify.against", name=name, source=source))
            ui.label(say(f"verify.rule.{guard}", k=f"{k:.3g}")).classes("dim")
    for name in ANGLES:
        with visitor.panel("verify.errors_of", name=say(f"bench.{name}")) as title:
            _curves(visitor, title, name, content["positions"], guard)
    shown = []
    for row in content["positions"]:
        line = {"position": str(row["position"])}
        line |= {key: visitor.number(f"{row[f'{key}_deg']:g}") for key in DIALS}
        for name in ANGLES:
            error, u = _cell(row, name, "error_deg"), _cell(row, name, "U_deg")
            line[f"e_{name}"] = "" if error is None or u is None else visitor.number(f"{error:+.3f} ± {u:.3f}")
            line[f"d_{name}"] = say(f"decision.{row[name]['decision']}")
        shown.append(line)
    columns = [lists.column("position", say("verify.position"))]
    columns += [lists.column(key, f"{say(f'bench.{key}')} °") for key in DIALS]
    decision = say("verify.decision" if limits is not None else "verify.agreement")
    for name in ANGLES:
        columns.append(lists.column(f"e_{name}", say("verify.error_of", name=say(f"bench.{name}"))))
        columns.append(lists.column(f"d_{name}", decision, left=True))
    with visitor.panel("verify.positions"):
        lists.paged(columns, shown, "position", 24)


def _curves(visitor: Visitor, title: str, name: str, rows: list[Content], guard: str) -> None:
    """Errors with bars of U, limits where there are any, and where a guarded decision accepts."""
    say = visitor.say
    errors, expanded, limit = ([_cell(row, name, key) for row in rows] for key in ("error_deg", "U_deg", "limit_deg"))
    series = lists.bars(say("verify.error"), errors, expanded, [row[name]["decision"] for row in rows])
    series += _lines(say("verify.limit"), limit, lists.RED, "solid")
    if guard != "none":
        inside = [None if x is None or u is None else max(x - u, 0.0) for x, u in zip(limit, expanded, strict=True)]
        series += _lines(say("verify.acceptance"), inside, lists.GREY, "dashed")
    places = [
        f"{row['position']}: {row['azimuth_deg']:g}° {row['inclination_deg']:g}° {row['toolface_deg']:g}°"
        for row in rows
    ]
    # the name may take two lines of a telephone
    x, y = lists.axis("\n".join(wrap(say("verify.place"), 45)), places), lists.axis(say("results.degrees"))
    legend = lists.legend([s["name"] for s in series if not s.get("silent")])
    grid = {"left": 60, "right": 20, "top": 30, "bottom": 62}
    lists.chart(title, series, x, y, height="277px", legend=legend, grid=grid)


def _lines(name: str, values: list[float | None], colour: str, kind: str) -> list[dict[str, Any]]:
    """Upper and lower line of a symmetric limit; nothing where nothing is judged."""
    if all(value is None for value in values):
        return []
    line: dict[str, Any] = {"type": "line", "step": "middle", "symbol": "none", "name": name}
    line |= {"lineStyle": {"color": colour, "type": kind, "width": 1.5}, "itemStyle": {"color": colour}}
    return [{**line, "data": values}, {**line, "data": [None if x is None else -x for x in values], "silent": True}]


def _cell(row: Content, name: str, key: str) -> float | None:
    value = row[name].get(key)
    return None if value is None else round(float(value), 5)


UNCERTAINTY: Final = "certificate"
"""Choice of no limits: errors are compared with their uncertainty."""
ACCEPTED: Final = ("pass", AGREES)


@ui.page("/verify")
def verify_page(request: Request, calibration: str = "", before: int = 0) -> None:
    """A form, what is under way, what was found."""
    shown = 20
    with frame(request, "verify.title") as visitor:
        if visitor.user.may("capture"):
            with visitor.panel("verify.begin"):
                VerifyForm(visitor, calibration)
        ledger, say = visitor.bench.ledger, visitor.say
        found = listed(ledger, "session", purpose="verify", limit=shown)
        still_open = [one for one in found if not closing_status(ledger, one.id)]
        if still_open:
            with visitor.panel("verify.under_way"):
                lines = [
                    (
                        lists.Cell(one.keys["serial"], lists.to("/tools", one.keys["serial"])),
                        lists.day(one.created),
                        one.author,
                        lists.Cell(say("verify.capture"), f"/calibrate/{one.id}"),
                        lists.Cell(say("verify.judge"), f"/verify/{one.id}/finish"),
                    )
                    for one in still_open
                ]
                lists.table([say("tools.serial"), say("verify.begun"), say("verify.by"), "", ""], lines)
        found = listed(ledger, "verification", limit=shown, before=max(before, 0))
        with visitor.panel("verify.recorded"):
            heads = [say(f"verify.{key}") for key in ("when", "tool", "verdict", "limits", "by")]
            lists.table(heads, [_line(visitor, one) for one in found])
            if not found:
                ui.label(say("verify.none")).classes("dim")
            if len(found) == shown:
                ui.link(say("ledger.older"), lists.to("/verify", before=found[-1].seq))


def _line(visitor: Visitor, one: Record) -> tuple[lists.Cell | str, ...]:
    verdict, limits = cached_from_record(visitor.bench.ledger, one, "verdict", verdict_of)
    return (
        lists.Cell(lists.day(one.created), f"/verifications/{one.id}"),
        lists.Cell(one.keys["serial"], lists.to("/tools", one.keys["serial"])),
        lists.Cell(visitor.say(f"verdict.{verdict}"), style="good" if verdict in ACCEPTED else "bad"),
        limits_words(visitor, limits),
        one.author,
    )


def limits_words(visitor: Visitor, limits: str) -> str:
    """The name of agreed limits, or that none were agreed."""
    return visitor.sentence(limits) if limits else visitor.say("verify.own_uncertainty")


def verdict_of(record: Record) -> tuple[str, str]:
    """Verdict of a verification and the name of its limits, "" where none were agreed."""
    held = recorded(record)
    return str(held["verdict"]), "" if held["limits"] is None else str(held["limits"]["name"])


class VerifyForm:
    """Calibration, protocol, limits: a preset with its source, changed values as stated by the laboratory."""

    def __init__(self, visitor: Visitor, calibration: str) -> None:
        self._visitor, say = visitor, visitor.say
        choices = {one.id: f"{one.keys['serial']} · {lists.day(one.created)}" for one in self._offered(calibration)}
        chosen = calibration if calibration in choices else next(iter(choices), None)
        self.calibration = ui.select(choices, value=chosen, label=say("verify.calibration"), with_input=True)
        self.calibration.classes("wide")
        plans = {name: f"{lists.plan_words(visitor, name)} ({len(plan)})" for name, plan in protocols().items()}
        self.protocol = ui.select(plans, value=next(iter(plans)), label=say("verify.protocol")).classes("wide")
        presets = {UNCERTAINTY: say("verify.own_uncertainty"), **{name: name for name in limit_names()}}
        presets[OWN] = say("verify.own_values")
        self.preset = ui.select(presets, value=UNCERTAINTY, label=say("verify.limits"), on_change=self._fill)
        self.preset.classes("wide")
        with ui.column().classes("w-full") as box:
            with ui.row().classes("form"):
                self.values = {
                    name: ui.number(say("verify.limit_of", name=say(f"bench.{name}")), min=0.0001, max=180, step=0.01)
                    for name in ANGLES
                }
                self.low = ui.number(say("verify.low"), min=0, max=90, value=0)
                self.guard = ui.select({g: say(f"guard.{g}") for g in GUARDS}, value="none", label=say("verify.guard"))
            self.source = ui.textarea(say("verify.source")).props("autogrow maxlength=2000").classes("w-full")
            ui.label(say("verify.guard_about")).classes("dim")
        box.bind_visibility_from(self.preset, "value", lambda name: name != UNCERTAINTY)
        with ui.column().classes("w-full").props('aria-live="polite" data-testid="foreseen"') as self._foreseen:
            pass
        for field in (self.calibration, self.protocol, self.preset, self.low, self.guard, *self.values.values()):
            field.on_value_change(self._look)
        go = ui.button(say("verify.go"), on_click=visitor.action("capture", self._open)).props("unelevated no-caps")
        go.set_enabled(chosen is not None)
        ui.timer(0.1, self._look, once=True)
        if chosen is None:
            ui.label(say("verify.no_calibration")).classes("dim")

    def _offered(self, calibration: str) -> list[Record]:
        ledger = self._visitor.bench.ledger
        found = listed(ledger, "calibration", limit=200)
        if calibration and all(one.id != calibration for one in found):
            with suppress(LedgerError):
                found.insert(0, ledger.get("calibration", calibration))
        return found

    async def _look(self) -> None:
        """What these positions will find with these limits, before anything is opened."""
        calibration, protocol_ = self.calibration.value, str(self.protocol.value)
        lines: list[tuple[str, str]] = []
        try:
            # half a form is no mistake yet: figures are looked at before their source is written
            own = self.preset.value == OWN and all(field.value is None for field in self.values.values())
            limits = None if own else self.limits(source="-")
            if own:
                calibration = None
            if calibration is not None:
                ledger = self._visitor.bench.ledger
                found = await aside(lambda: foreseen(ledger, str(calibration), protocol_, limits))
                lines += [(self._visitor.sentence(one), "warn") for one in without_notes(found.findings)]
                lines += [(self._visitor.sentence(one), "dim") for one in only_notes(found.findings)]
        except InclinometryError as error:
            lines = [(self._visitor.problem(error), "warn")]
        self._foreseen.clear()
        with self._foreseen:
            for sentence, style in lines:
                ui.label(sentence).classes(style)

    def _fill(self) -> None:
        """Show what a preset says."""
        name = str(self.preset.value)
        if name in limit_names():
            limits = read_limits(name)
            for angle, field in self.values.items():
                value = getattr(limits, angle)
                field.value = None if value is None else round(float(np.degrees(value)), 6)
            self.low.value = round(float(np.degrees(limits.min_inclination_for_azimuth)), 6)
            self.guard.value = limits.guard
            self.source.value = limits.source
        elif name == OWN:
            self.source.value = ""

    def limits(self, source: str = "") -> Limits | None:
        """What was chosen; a preset that was changed becomes the laboratory's own statement.

        source : of figures of which none is written.
        """
        preset = str(self.preset.value)
        if preset == UNCERTAINTY:
            return None
        content: dict[str, Any] = {"name": OWN, "source": self.source.value or source, "guard": self.guard.value}
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
            raise refused("web-choose", {"what": ("calibration",)})
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
