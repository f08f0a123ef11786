"""Errors of a verified tool against its limits: curves, decisions, the verdict; before it is recorded and after."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from fastapi import HTTPException, Request
from nicegui import ui

from inclinometry.calibration.acceptance import JUDGED
from inclinometry.core.constants import COVERAGE_FACTOR
from inclinometry.core.errors import InclinometryError
from inclinometry.store.ledger import Ledger, LedgerError, Record
from inclinometry.web.frame import Visitor, aside, frame
from inclinometry.web.pages.charts import GREY, RED, axis, bars, chart, legend
from inclinometry.web.pages.lists import day, paged, to, visible
from inclinometry.workflow.laboratory.agreed_limits import limits_of
from inclinometry.workflow.laboratory.session import load_session
from inclinometry.workflow.laboratory.verification import (
    finish_verification,
    judged,
    lacking,
    report,
    stated_limits,
)

ROWS: Final = 24
Content = Mapping[str, Any]


@ui.page("/verify/{session}/finish")
def finish_page(request: Request, session: str) -> None:
    """How the positions captured so far are judged; recording the verdict."""
    with frame(request, "verify.judged") as visitor:
        ledger = visitor.bench.ledger
        try:
            seen = load_session(ledger, session)
        except LedgerError as error:
            raise HTTPException(404, str(error)) from None
        calibration = str(seen.settings.get("calibration", ""))
        if seen.closed or not calibration:
            ui.label(visitor.say("verify.closed")).classes("warn")
            ui.link(visitor.say("verify.recorded"), "/verify")
            return
        limits = limits_of(seen)
        done = visitor.say("home.progress", done=len(seen.valid), all=len(seen.positions))
        ui.label(f"{seen.serial} · {seen.plan} · {done}").classes("subtitle number")
        ui.link(visitor.say("verify.capture"), f"/calibrate/{session}")
        try:
            found = judged(ledger, session, calibration, limits)
        except InclinometryError as error:
            ui.label(visitor.bench.told(str(error))).classes("warn")
            return
        lost = lacking(seen, found, limits)
        if lost:
            ui.label(lost).classes("warn")
        verdict = "incomplete" if lost else found.verdict
        show_report(visitor, verdict, stated_limits(found, limits), report(found, seen))
        if visitor.user.may("capture") and not lost:
            _record_button(visitor, ledger, session, calibration)


def _record_button(visitor: Visitor, ledger: Ledger, session: str, calibration: str) -> None:
    async def record() -> None:
        button.disable()
        try:
            user = visitor.require("capture")
            limits = limits_of(load_session(ledger, session))
            made = await aside(
                lambda: finish_verification(ledger, session, calibration, author=user.name, limits=limits)
            )
        except InclinometryError as error:
            ui.notify(visitor.bench.told(str(error)), type="negative", multi_line=True, timeout=0, close_button="OK")
            button.enable()
            return
        ui.navigate.to(f"/verifications/{made.id}")

    button = ui.button(visitor.say("verify.record"), on_click=record).props("unelevated no-caps")


@ui.page("/verifications/{verification}")
def verification_page(request: Request, verification: str) -> None:
    """A recorded verification."""
    with frame(request, "verify.one") as visitor:
        try:
            record = visitor.bench.ledger.get("verification", verification)
        except LedgerError as error:
            raise HTTPException(404, str(error)) from None
        _about(visitor, record)
        show_report(visitor, record.body["verdict"], record.body["limits"], record.body["report"])


def _about(visitor: Visitor, record: Record) -> None:
    say, serial = visitor.say, record.keys["serial"]
    calibration = record.keys["calibration"]
    with ui.row().classes("items-center"):
        ui.link(serial, to("/tools", serial)).classes("number")
        ui.label(f"{day(record.created)} UTC · {record.author}").classes("number")
        ui.link(say("verify.calibration"), f"/results/{calibration}")
        if visitor.user.may("issue"):
            address = to("/certificates/new", calibration=calibration, verification=record.id)
            ui.link(say("results.certificate"), address)
        ui.link("CSV", f"/api/v1/tables/verification/{record.id}.csv")


def show_report(visitor: Visitor, verdict: str, limits: Content, content: Content) -> None:
    """Verdict, curves and table of a report in degrees, as `workflow.laboratory.verification.report` makes it."""
    say = visitor.say
    with ui.card().classes("panel"):
        # green only when nothing below speaks against relying on it
        doubted = "warn" if content.get("warnings") else "good"
        ui.label(say(f"verdict.{verdict}")).classes("judgement " + (doubted if verdict == "pass" else "bad"))
        if protocol := content.get("protocol"):
            ui.label(say("verify.of_protocol", **protocol))
        for sentence in content.get("reasons", ()):
            ui.label(visitor.bench.told(str(sentence)))
        for sentence in content.get("warnings", ()):
            ui.label(visitor.bench.told(str(sentence))).classes("warn")
        ui.label(say("verify.against", name=str(limits.get("name", "")), source=visible(str(limits.get("source", "")))))
        guard = str(limits.get("guard", "none"))
        k = float(content.get("coverage_factor", 2.0))
        rule = guard if "guard" in limits else "derived"
        ui.label(say(f"verify.rule.{rule}", k=f"{k:.3g}")).classes("dim")
    for name in JUDGED:
        with ui.card().classes("panel"):
            ui.label(say("verify.errors_of", name=say(f"bench.{name}"))).classes("subtitle")
            _curves(visitor, name, content["positions"], guard, COVERAGE_FACTOR / k)
    _positions(visitor, content["positions"], COVERAGE_FACTOR / k)


def _curves(visitor: Visitor, name: str, rows: list[Content], guard: str, share: float) -> None:
    """Errors with bars of U for the usual k (a share of the recorded), limits, and where a guarded decision accepts."""
    say = visitor.say
    errors, expanded, limit = ([_cell(row, name, key) for row in rows] for key in ("error_deg", "U_deg", "limit_deg"))
    shown = [None if u is None else share * u for u in expanded]
    series = bars(say("verify.error"), errors, shown, [row[name]["decision"] for row in rows])
    series += _lines(say("verify.limit"), limit, RED, "solid")
    if guard != "none":
        inside = [None if x is None or u is None else max(x - u, 0.0) for x, u in zip(limit, expanded, strict=True)]
        series += _lines(say("verify.acceptance"), inside, GREY, "dashed")
    places = [
        f"{row['position']}: {row['inclination_deg']:g}° {row['azimuth_deg']:g}° {row['toolface_deg']:g}°"
        for row in rows
    ]
    options = {
        "legend": legend([s["name"] for s in series if not s.get("silent")]),
        "xAxis": axis(say("verify.place"), kind="category", data=places),
        "yAxis": axis(say("results.degrees")),
        "series": series,
    }
    chart(options, say("verify.errors_of", name=say(f"bench.{name}")))


def _lines(name: str, values: list[float | None], colour: str, kind: str) -> list[dict[str, Any]]:
    """Upper and lower line of a symmetric limit; nothing where nothing is judged."""
    if all(value is None for value in values):
        return []
    line = {
        "type": "line",
        "step": "middle",
        "symbol": "none",
        "name": name,
        "lineStyle": {"color": colour, "type": kind, "width": 1.5},
        "itemStyle": {"color": colour},
    }
    return [{**line, "data": values}, {**line, "data": [None if x is None else -x for x in values], "silent": True}]


def _cell(row: Content, name: str, key: str) -> float | None:
    value = row[name].get(key)
    return None if value is None else round(float(value), 5)


def _positions(visitor: Visitor, rows: list[Content], share: float) -> None:
    """Every position, with the U of the bars."""
    say = visitor.say
    shown = []
    for row in rows:
        line = {"position": str(row["position"])}
        line |= {key: f"{row[f'{key}_deg']:g}" for key in ("inclination", "azimuth", "toolface")}
        for name in JUDGED:
            error, u = _cell(row, name, "error_deg"), _cell(row, name, "U_deg")
            line[f"e_{name}"] = "" if error is None or u is None else f"{error:+.3f} ± {share * u:.3f}"
            line[f"d_{name}"] = say(f"decision.{row[name]['decision']}")
        shown.append(line)
    columns = [_column("position", say("verify.position"))]
    columns += [_column(key, f"{say(f'bench.{key}')} °") for key in ("inclination", "azimuth", "toolface")]
    for name in JUDGED:
        columns.append(_column(f"e_{name}", say("verify.error_of", name=say(f"bench.{name}"))))
        columns.append(_column(f"d_{name}", say("verify.decision")))
    with ui.card().classes("panel"):
        ui.label(say("verify.positions")).classes("subtitle")
        paged(columns, shown, "position", ROWS)


def _column(name: str, label: str) -> dict[str, Any]:
    return {"name": name, "label": label, "field": name, "align": "left" if name.startswith("d_") else "right"}
