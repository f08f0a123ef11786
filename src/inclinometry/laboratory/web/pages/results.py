"""A recorded calibration: parameters, residuals, what is expected of it, what changed, other methods beside it."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from fastapi import Request
from nicegui import ui

from inclinometry.calibration.expected import ALL_ANGLES, certified, expanded, expected_uncertainty
from inclinometry.calibration.result import Calibration
from inclinometry.constants import INCLINATION_RANGE, INCLINATIONS
from inclinometry.errors import InclinometryError
from inclinometry.findings import only_notes, without_notes
from inclinometry.laboratory import results
from inclinometry.laboratory.certificates import of_same_readings
from inclinometry.laboratory.ledger.ledger import Record
from inclinometry.laboratory.ledger.users import User
from inclinometry.laboratory.progress import Goal, options_of
from inclinometry.laboratory.registry import calibration_before, find_tool, listed, rig_of, sites
from inclinometry.laboratory.session import bench_readings, load_session
from inclinometry.laboratory.web.frame import Visitor, aside, frame
from inclinometry.laboratory.web.pages import lists
from inclinometry.report.words import calibration_tests, rounded, significant
from inclinometry.workflow.calibrate import compare

METHODS: Final = ("joint", "twelve", "orthogonal", "rotations", "field", "norm", "classical", "datasheet")
"""Methods that have a name in every language."""


@ui.page("/results/{calibration}")
def result_page(request: Request, calibration: str) -> None:
    """One calibration."""
    with frame(request, "results.title") as visitor:
        record = visitor.bench.ledger.get("calibration", calibration)
        found = results.calibration_of(record)
        table = results.expected_table(found)
        _summary(visitor, record, found, table)
        # expanded uncertainty of the angles over inclination, as a certificate states it
        if table:
            say, places = visitor.say, [f"{x:g}" for x in table["inclination_deg"]]
            series: list[dict[str, Any]] = [
                {"type": "line", "name": say(f"bench.{name}"), "data": table[f"U_{name}_deg"]}
                for name in ("inclination", "azimuth", "toolface")
                if f"U_{name}_deg" in table
            ]
            x, y = lists.axis(say("results.inclination"), places), lists.axis(say("results.degrees"), kind="log")
            with visitor.panel("results.expected", k=f"{table['coverage_factor']:g}") as title:
                lists.chart(title, series, x, y, legend=lists.legend())
        _map(visitor, found)
        _heat(visitor, found)
        # standardised residuals station by station
        say, residuals = visitor.say, found.residuals
        series = []
        for kind, values in residuals.standardised.items():
            for column in range(values.shape[1]):
                name = f"{say(f'live.{kind}')} {'XYZ'[column] if column < 3 else column + 1}"
                data = [None if np.isnan(v) else round(v, 3) for v in values[:, column].tolist()]
                series.append({"type": "scatter", "symbolSize": 7, "name": name, "data": data})
        with visitor.panel("results.residuals") as title:
            idle = sum(int(np.isnan(values).sum()) for values in residuals.standardised.values())
            if idle:
                ui.label(say("results.not_judged", number=idle)).classes("dim")
            x, y = lists.axis(say("results.position"), residuals.station), lists.axis(say("results.standardised"))
            lists.chart(title, series, x, y, legend=lists.legend())
        _parameters(visitor, record, found)
        _site(visitor, record)
        _methods(visitor, record)


def _summary(visitor: Visitor, record: Record, found: Calibration, table: dict[str, Any]) -> None:
    say = visitor.say
    with ui.card().classes("panel"):
        ui.label(f"{record.keys['serial']} · {lists.day(record.created)} UTC").classes("subtitle number")
        about = record.body.get("summary", {})
        plan = lists.plan_words(visitor, str(about.get("plan", "")))
        method = say(f"method.{found.method}") if found.method in METHODS else found.method
        ui.label(" · ".join(filter(None, (plan, str(about.get("rig", "")), method, record.author)))).classes("dim")
        tests = calibration_tests(found)
        failed = [test for test in tests if test.passed is False]
        warned = without_notes(found.findings)
        sound = not failed and not warned
        ui.label(say("results.sound" if sound else "results.open")).classes(
            "judgement " + ("good" if sound else "warn")
        ).props('data-testid="verdict"')
        _headline(visitor, record, table)
        for one in warned:
            ui.label(visitor.sentence(one)).classes("warn")
        if warned and results.can_be_evaluated_again(record):
            ui.link(say("results.again"), "#site")
        for test in failed if not warned else ():
            said = say("results.test_failed", what=visitor.sentence(test.what), found=test.found, limit=test.limit)
            ui.label(said).classes("warn")
        for one in only_notes(found.findings):
            ui.label(visitor.sentence(one)).classes("dim")
        _next_step(visitor, record)


def _headline(visitor: Visitor, record: Record, table: dict[str, Any]) -> None:
    """U of one reading at the worst attitude of the tool's range, as a certificate states it."""
    say = visitor.say
    if not table:
        return
    tool = find_tool(visitor.bench.ledger, record.keys["serial"])
    low, high = np.degrees(Goal().inclination_range if tool is None else tool.inclination_range)
    places = np.array(table["inclination_deg"])
    rows = (places >= low - 1e-6) & (places <= high + 1e-6)
    parts = []
    for name in ("azimuth", "inclination"):
        values = [
            x for x, inside in zip(table.get(f"U_{name}_deg", ()), rows, strict=False) if inside and x is not None
        ]
        if values:
            parts.append(f"{say(f'bench.{name}')} ±{visitor.number(significant(max(values)))}°")
    if parts:
        k = f"{table['coverage_factor']:g}"
        text = say(
            "results.headline", values=visitor.sentence(", ").join(parts), low=f"{low:.0f}", high=f"{high:.0f}", k=k
        )
        ui.label(text).classes("subtitle number")


def _next_step(visitor: Visitor, record: Record) -> None:
    """What is to be done next as one button, the rest as links."""
    say, ledger, user = visitor.say, visitor.bench.ledger, visitor.user
    verify, asked = f"/verify?calibration={record.id}", {"calibration": record.id}
    # a certificate of another evaluation of these readings is superseded, never left beside
    for one in of_same_readings(ledger, record):
        if one.state == "issued" and one.record.body["calibration"] != record.id:
            asked["supersedes"] = one.number
    certify = lists.to("/certificates/new", **asked)
    steps = [("results.verify", verify)] if user.may("capture") else []
    steps += [("results.certificate", certify)] if user.may("issue") else []
    if listed(ledger, "verification", calibration=record.id, limit=1):
        steps.reverse()
    with ui.row().classes("items-center"):
        for place, (key, path) in enumerate(steps):
            if place == 0:
                go = ui.button(say(key), on_click=lambda path=path: ui.navigate.to(path))
                go.props('unelevated no-caps size=lg data-testid="next-step"')
            else:
                ui.link(say(key), path)
        ui.link(say("tools.one"), lists.to("/tools", record.keys["serial"]))
        ui.link(say("results.tool_json"), f"/api/v1/calibrations/{record.id}")


def _map(visitor: Visitor, found: Calibration) -> None:
    """U(azimuth) from the calibration alone over inclination and azimuth, worst toolface."""
    inclinations = INCLINATIONS[1 : INCLINATIONS.index(max(INCLINATION_RANGE)) + 1]
    stated, k, _ = certified(found)
    expected = expected_uncertainty(stated, inclinations)
    if "azimuth" not in expected.angles:
        return
    spread = expected.components["calibration"][..., ALL_ANGLES.index("azimuth")].max(axis=2)
    values = np.degrees(expanded(np.sqrt(spread), k))
    say, turns = visitor.say, values.shape[1]
    cells = [[a, i, round(float(values[i, a]), 4)] for i in range(len(values)) for a in range(turns)]
    across = [f"{360 * a / turns:g}" for a in range(turns)]
    down = [f"{x:g}" for x in np.degrees(inclinations).round(6)]
    x, y = lists.axis(say("results.azimuth"), across), lists.axis(say("results.inclination"), down)
    colours = {
        "min": float(values.min()),
        "max": float(np.quantile(values, 0.9)),
        "calculable": True,
        "precision": 3,
        "formatter": "{value}°",
        # from good to bad, to be told apart on either paper
        "inRange": {"color": ["#1f6fb4", "#58a6a6", "#e2c15a", "#d0703b"]},
        "right": 0,
        "textStyle": {"color": "#8896a4"},
    }
    room = {"left": 60, "right": 110, "top": 20, "bottom": 45}
    with visitor.panel("results.map", k=f"{k:g}") as title:
        series = [{"type": "heatmap", "data": cells}]
        lists.chart(
            title,
            series,
            x,
            y,
            height="300px",
            tooltip={"trigger": "item", ":valueFormatter": lists.NUMBER},
            visualMap=colours,
            grid=room,
        )


def _heat(visitor: Visitor, found: Calibration) -> None:
    """Degree of the temperature polynomials, the range they hold in, and whether the tool is outside of it now."""
    heat_slack = 5.0  # beyond the calibrated range by more than this, degC, a reading is said to be extrapolated
    say, tool = visitor.say, found.tool
    degrees = {kind: len(triad.tensor) - 1 for kind, triad in tool.triads.items()}
    with visitor.panel("results.temperature"):
        for kind, degree in degrees.items():
            ui.label(say("results.degree", kind=say(f"results.{kind}"), degree=degree)).classes("number")
        if tool.temperature_range is None:
            ui.label(say("results.no_temperature")).classes("dim")
            return
        low, high = tool.temperature_range
        if max(degrees.values()) == 0:
            ends = dict.fromkeys((f"{low:.1f}", f"{high:.1f}"))
            ui.label(say("results.at", at=" … ".join(ends))).classes("number")
        else:
            ui.label(say("results.range", low=f"{low:.1f}", high=f"{high:.1f}")).classes("number")
        feed = visitor.bench.feed
        now = None if feed is None else feed.stability().temperature
        if now is not None and not low - heat_slack <= now <= high + heat_slack:
            ui.label(say("results.outside", now=f"{now:.1f}")).classes("warn")


def _parameters(visitor: Visitor, record: Record, found: Calibration) -> None:
    """Each parameter with its uncertainty and its change since the calibration before."""
    say = visitor.say
    # parameters of the calibration before this one
    ledger = visitor.bench.ledger
    older = calibration_before(ledger, record)
    before, unknown = ({}, ()) if older is None else results.comparable(results.calibration_of(older).tool, found.tool)
    units = {kind: triad.unit for kind, triad in found.tool.triads.items()}
    rows = []
    for name, (value, u) in results.parameters(found.tool).items():
        unit = units.get(name.partition(".")[0], "")
        row: dict[str, Any] = {
            "key": name,
            "name": lists.parameter_words(visitor, name),
            "unit": visitor.sentence(unit),
        }
        # as many digits as the uncertainty leaves
        row |= {
            "value": visitor.number(rounded(value, u)),
            "u": visitor.number(significant(u)),
            "change": "",
            "ratio": "",
        }
        if name in before and np.isfinite(before[name][0]):
            change, spread = value - before[name][0], float(np.hypot(u, before[name][1]))
            row["change"] = visitor.number(rounded(change, spread))
            row["ratio"] = visitor.number(f"{abs(change) / spread:.1f}") if spread > 0.0 else ""
        rows.append(row)
    keys = ("name", "value", "u", "unit", "change", "ratio")
    columns = [lists.column(key, say(f"results.{key}"), left=key in ("name", "unit")) for key in keys]
    with visitor.panel("results.parameters"):
        lists.scale_unknown(visitor, unknown)
        lists.paged(columns, rows, "key", 12)


def _site(visitor: Visitor, record: Record) -> None:
    """Fitting the same readings with the fields of another site."""
    say, ledger = visitor.say, visitor.bench.ledger
    if not results.can_be_evaluated_again(record):
        return
    session, again = ledger.get("session", record.keys["session"]), record.body.get("settings", {})
    newest = listed(ledger, "calibration", session=session.id, limit=1)[0]
    with ui.card().classes("panel").props("id=site"):
        ui.label(say("start.site")).classes("subtitle")
        ui.label(str(again.get("site", session.body.get("site", ""))) or say("results.no_site")).classes("number")
        if again:
            ui.link(say("results.before"), f"/results/{again['before']}")
        if newest.id != record.id:
            ui.link(say("results.newer"), f"/results/{newest.id}").classes("warn")
        elif visitor.user.may("capture"):
            _again(visitor, record)


def _again(visitor: Visitor, record: Record) -> None:
    say, ledger = visitor.say, visitor.bench.ledger
    ui.label(say("results.again_about")).classes("dim")
    places = [one.name for one in sites(ledger)]
    with ui.row().classes("form"):
        site = ui.select(places, label=say("start.site"), value=lists.only(places))
        ui.link(say("start.new_site"), "/sites")
        reason = ui.input(say("bench.reason")).props("maxlength=2000")

        async def go() -> None:
            session, name, why = record.keys["session"], str(site.value or ""), str(reason.value or "")

            def again(user: User) -> Record:
                return results.evaluate_again(ledger, session, name, author=user.name, reason=why)

            made = await visitor.attempt("capture", again, problem.set_text, button)
            if made is not None:
                ui.navigate.to(f"/results/{made.id}")

        button = ui.button(say("results.again"), on_click=go).props('outline no-caps data-testid="again"')
        button.bind_enabled_from(site, "value", bool)
    problem = ui.label("").classes("bad").props('role="alert"')


def _methods(visitor: Visitor, record: Record) -> None:
    """Other methods on the same readings, worked out when asked for."""
    say = visitor.say
    with visitor.panel("results.methods"):
        box = ui.column()

        async def work() -> None:
            box.clear()
            with box:
                ui.spinner()
            try:
                lines = await aside(lambda: _compared(visitor, record))
            except InclinometryError as error:
                lines = [visitor.problem(error)]
            box.clear()
            with box:
                for line in lines:
                    ui.label(line).classes("number")

        ui.button(say("results.compare"), on_click=work).props("outline no-caps").style(f"color:{lists.BLUE}")


def _compared(visitor: Visitor, record: Record) -> list[str]:
    session = load_session(visitor.bench.ledger, record.keys["session"])
    found = compare(bench_readings(session), options=options_of(session, rig_of(visitor.bench.ledger, session.id)))
    lines = []
    for attempt in found.attempts:
        expected = found.uncertainty.get(attempt.method)
        method = visitor.say(f"method.{attempt.method}") if attempt.method in METHODS else attempt.method
        if attempt.reason is not None:
            lines.append(f"{method}: {visitor.sentence(attempt.reason)}")
        elif expected is not None:
            worst = ", ".join(f"{x:.3f}" for x in np.degrees(expected.from_calibration[:, ALL_ANGLES.index("azimuth")]))
            at = ", ".join(f"{x:g}" for x in np.degrees(found.inclination).round(9))
            lines.append(visitor.say("results.method_line", method=method, values=worst, places=at))
    return lines
