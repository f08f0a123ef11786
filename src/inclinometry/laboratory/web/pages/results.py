"""A recorded calibration: parameters, residuals, what is expected of it, what changed, other methods beside it."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from fastapi import HTTPException, Request
from nicegui import ui

from inclinometry.calibration.expected import ALL_ANGLES, expanded, expected_uncertainty
from inclinometry.calibration.result import Calibration
from inclinometry.constants import COVERAGE_FACTOR, INCLINATION_RANGE, INCLINATIONS
from inclinometry.errors import InclinometryError
from inclinometry.laboratory.ledger.ledger import LedgerError, Record
from inclinometry.laboratory.progress import Goal
from inclinometry.laboratory.registry import extract, find_tool, listed
from inclinometry.laboratory.results import calibration_of, parameters, recorded_parameters
from inclinometry.laboratory.session import bench_readings, load_session
from inclinometry.laboratory.web.frame import Visitor, aside, frame
from inclinometry.laboratory.web.pages.lists import (
    BLUE,
    axis,
    chart,
    day,
    legend,
    paged,
    parameter_words,
    plan_words,
    to,
)
from inclinometry.report.words import calibration_tests, rounded, significant
from inclinometry.workflow.calibrate import Options, compare

METHODS: Final = ("joint", "twelve", "orthogonal", "rotations", "field", "norm", "classical", "datasheet")
"""Methods that have a name in every language."""


@ui.page("/results/{calibration}")
def result_page(request: Request, calibration: str) -> None:
    """One calibration."""
    with frame(request, "results.title") as visitor:
        try:
            record = visitor.bench.ledger.get("calibration", calibration)
        except LedgerError as error:
            raise HTTPException(404, str(error)) from None
        found = calibration_of(record)
        _summary(visitor, record, found)
        # expanded uncertainty of the angles over inclination, as recorded
        table = record.body.get("capability_deg", {})
        if table:
            say, places = visitor.say, [f"{x:g}" for x in table["inclination_deg"]]
            series: list[dict[str, Any]] = [
                {"type": "line", "name": say(f"bench.{name}"), "data": table[f"U_{name}_deg"]}
                for name in ("inclination", "azimuth", "toolface")
                if f"U_{name}_deg" in table
            ]
            title = say("results.expected", k=f"{table['coverage_factor']:g}")
            with ui.card().classes("panel"):
                ui.label(title).classes("subtitle")
                options = {
                    "legend": legend(),
                    "xAxis": axis(say("results.inclination"), kind="category", data=places),
                    "yAxis": axis(say("results.degrees"), kind="log"),
                    "series": series,
                }
                chart(options, title)
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
        with ui.card().classes("panel"):
            ui.label(say("results.residuals")).classes("subtitle")
            idle = sum(int(np.isnan(values).sum()) for values in residuals.standardised.values())
            if idle:
                ui.label(say("results.not_judged", number=idle)).classes("dim")
            options = {
                "legend": legend(),
                "xAxis": axis(say("results.position"), kind="category", data=list(residuals.station)),
                "yAxis": axis(say("results.standardised")),
                "series": series,
            }
            chart(options, say("results.residuals"))
        _parameters(visitor, record, found)
        _methods(visitor, record)


def _summary(visitor: Visitor, record: Record, found: Calibration) -> None:
    say = visitor.say
    with ui.card().classes("panel"):
        ui.label(f"{record.keys['serial']} · {day(record.created)} UTC").classes("subtitle number")
        about = record.body.get("summary", {})
        plan = plan_words(visitor, str(about.get("plan", "")))
        method = say(f"method.{found.method}") if found.method in METHODS else found.method
        ui.label(" · ".join(filter(None, (plan, str(about.get("rig", "")), method, record.author)))).classes("dim")
        tests = calibration_tests(found)
        failed = [test for test in tests if test.passed is False]
        sound = not failed and not found.warnings
        ui.label(say("results.sound" if sound else "results.doubted")).classes(
            "judgement " + ("good" if sound else "warn")
        ).props('data-testid="verdict"')
        _headline(visitor, record)
        for sentence in found.warnings:
            ui.label(visitor.sentence(sentence)).classes("warn")
        for test in failed if not found.warnings else ():
            said = say("results.test_failed", what=visitor.sentence(test.what), found=test.found, limit=test.limit)
            ui.label(said).classes("warn")
        for sentence in found.notes:
            ui.label(visitor.sentence(sentence)).classes("dim")
        _next_step(visitor, record)


def _headline(visitor: Visitor, record: Record) -> None:
    """What one reading is worth at the worst attitude of the tool's range, as recorded."""
    say, table = visitor.say, record.body.get("capability_deg", {})
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
            parts.append(f"{say(f'bench.{name}')} ±{significant(max(values))}°")
    if parts:
        k = f"{table['coverage_factor']:g}"
        text = say("results.headline", values=", ".join(parts), low=f"{low:.0f}", high=f"{high:.0f}", k=k)
        ui.label(text).classes("subtitle number")


def _next_step(visitor: Visitor, record: Record) -> None:
    """What is to be done next as one button, the rest as links."""
    say, ledger, user = visitor.say, visitor.bench.ledger, visitor.user
    verify, certify = f"/verify?calibration={record.id}", f"/certificates/new?calibration={record.id}"
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
        ui.link(say("tools.one"), to("/tools", record.keys["serial"]))
        ui.link(say("results.tool_json"), f"/api/v1/calibrations/{record.id}")


def _map(visitor: Visitor, found: Calibration) -> None:
    """U(azimuth) from the calibration alone over inclination and azimuth, worst toolface."""
    inclinations = INCLINATIONS[1 : INCLINATIONS.index(max(INCLINATION_RANGE)) + 1]
    expected = expected_uncertainty(found, inclinations)
    if "azimuth" not in expected.angles:
        return
    spread = expected.components["calibration"][..., ALL_ANGLES.index("azimuth")].max(axis=2)
    values = np.degrees(expanded(np.sqrt(spread)))
    say, turns = visitor.say, values.shape[1]
    cells = [[a, i, round(float(values[i, a]), 4)] for i in range(len(values)) for a in range(turns)]
    title = say("results.map", k=f"{COVERAGE_FACTOR:g}")
    with ui.card().classes("panel"):
        ui.label(title).classes("subtitle")
        options = {
            "tooltip": {"trigger": "item"},
            "xAxis": axis(say("results.azimuth"), kind="category", data=[f"{360 * a / turns:g}" for a in range(turns)]),
            "yAxis": axis(
                say("results.inclination"),
                kind="category",
                data=[f"{x:g}" for x in np.degrees(inclinations).round(6)],
            ),
            "visualMap": {
                "min": float(values.min()),
                "max": float(np.quantile(values, 0.9)),
                "calculable": True,
                "precision": 3,
                "formatter": "{value}°",
                # from good to bad, to be told apart on either paper
                "inRange": {"color": ["#1f6fb4", "#58a6a6", "#e2c15a", "#d0703b"]},
                "right": 0,
                "textStyle": {"color": "#8896a4"},
            },
            "grid": {"left": 60, "right": 110, "top": 20, "bottom": 45},
            "series": [{"type": "heatmap", "data": cells}],
        }
        chart(options, title, height="300px")


def _heat(visitor: Visitor, found: Calibration) -> None:
    """Degree of the temperature polynomials, the range they hold in, and whether the tool is outside of it now."""
    heat_slack = 5.0  # beyond the calibrated range by more than this, degC, a reading is said to be extrapolated
    say, tool = visitor.say, found.tool
    degrees = {kind: len(triad.tensor) - 1 for kind, triad in tool.triads.items()}
    with ui.card().classes("panel"):
        ui.label(say("results.temperature")).classes("subtitle")
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
    seen = listed(ledger, "calibration", serial=record.keys["serial"], before=record.seq, limit=1)
    before = extract(ledger, seen[0], "parameters", recorded_parameters) if seen else {}
    units = {kind: triad.unit for kind, triad in found.tool.triads.items()}
    rows = []
    for name, (value, u) in parameters(found).items():
        unit = units.get(name.partition(".")[0], "")
        row: dict[str, Any] = {"key": name, "name": parameter_words(visitor, name), "unit": visitor.sentence(unit)}
        # as many digits as the uncertainty leaves
        row |= {"value": rounded(value, u), "u": significant(u), "change": "", "ratio": ""}
        if name in before:
            change, spread = value - before[name][0], float(np.hypot(u, before[name][1]))
            row["change"] = rounded(change, spread)
            row["ratio"] = f"{abs(change) / spread:.1f}" if spread > 0.0 else ""
        rows.append(row)
    columns = [
        {
            "name": key,
            "label": say(f"results.{key}"),
            "field": key,
            "align": "left" if key in ("name", "unit") else "right",
        }
        for key in ("name", "value", "u", "unit", "change", "ratio")
    ]
    with ui.card().classes("panel"):
        ui.label(say("results.parameters")).classes("subtitle")
        paged(columns, rows, "key", 12)


def _methods(visitor: Visitor, record: Record) -> None:
    """Other methods on the same readings, worked out when asked for."""
    say = visitor.say
    with ui.card().classes("panel"):
        ui.label(say("results.methods")).classes("subtitle")
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

        ui.button(say("results.compare"), on_click=work).props("outline no-caps").style(f"color:{BLUE}")


def _compared(visitor: Visitor, record: Record) -> list[str]:
    session = load_session(visitor.bench.ledger, record.keys["session"])
    left = bool(dict(session.settings.get("settings", {})).get("left_handed", False))
    found = compare(bench_readings(session), options=Options(left_handed=left))
    lines = []
    for attempt in found.attempts:
        expected = found.uncertainty.get(attempt.method)
        method = visitor.say(f"method.{attempt.method}") if attempt.method in METHODS else attempt.method
        if attempt.calibration is None:
            lines.append(f"{method}: {visitor.sentence(attempt.reason)}")
        elif expected is not None:
            worst = ", ".join(f"{x:.3f}" for x in np.degrees(expected.from_calibration[:, ALL_ANGLES.index("azimuth")]))
            at = ", ".join(f"{x:g}" for x in np.degrees(found.inclination).round(9))
            lines.append(visitor.say("results.method_line", method=method, values=worst, places=at))
    return lines
