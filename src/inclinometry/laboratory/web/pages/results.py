"""A recorded calibration: parameters, residuals, what is expected of it, what changed, other methods beside it."""

from __future__ import annotations

from typing import Any

import numpy as np
from fastapi import HTTPException, Request
from nicegui import ui

from inclinometry.calibration.expected import ALL_ANGLES, FROM_CALIBRATION, expanded, expected_uncertainty
from inclinometry.calibration.result import Calibration
from inclinometry.constants import COVERAGE_FACTOR, INCLINATION_RANGE, INCLINATIONS
from inclinometry.errors import InclinometryError
from inclinometry.laboratory.ledger.ledger import LedgerError, Record
from inclinometry.laboratory.registry import extract, listed
from inclinometry.laboratory.results import calibration_of, parameters, recorded_parameters
from inclinometry.laboratory.session import bench_readings, load_session
from inclinometry.laboratory.web.frame import Visitor, aside, frame
from inclinometry.laboratory.web.pages.lists import BLUE, axis, chart, day, legend, paged, to
from inclinometry.report.words import calibration_tests
from inclinometry.workflow.calibrate import Options, compare


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
                name = f"{kind} {'xyz'[column] if column < 3 else column + 1}"
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
        text = f"{about.get('plan', '')} · {about.get('rig', '')} · {found.method} · {record.author}"
        ui.label(text).classes("dim")
        tests = calibration_tests(found)
        failed = [test for test in tests if test.passed is False]
        for sentence in found.warnings:
            ui.label(visitor.bench.without_path(sentence)).classes("warn")
        for test in failed if not found.warnings else ():
            ui.label(say("results.test_failed", what=test.what, found=test.found, limit=test.limit)).classes("warn")
        if not failed:
            ui.label(say("results.no_warnings")).classes("good")
        for sentence in found.notes:
            ui.label(visitor.bench.without_path(sentence)).classes("dim")
        with ui.row():
            ui.link(say("tools.one"), to("/tools", record.keys["serial"]))
            if visitor.user.may("capture"):
                ui.link(say("results.verify"), f"/verify?calibration={record.id}")
            if visitor.user.may("issue"):
                ui.link(say("results.certificate"), f"/certificates/new?calibration={record.id}")
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
                "min": 0.0,
                "max": float(np.quantile(values, 0.9)),
                "calculable": True,
                "precision": 4,
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
        ui.label(say("results.range", low=f"{low:.1f}", high=f"{high:.1f}")).classes("number")
        if max(degrees.values()) == 0:
            ui.label(say("results.constant")).classes("dim")
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
    rows = []
    for name, (value, u) in parameters(found).items():
        row: dict[str, Any] = {"name": name, "value": f"{value:.7g}", "u": f"{u:.2g}", "change": "", "ratio": ""}
        if name in before:
            change, spread = value - before[name][0], float(np.hypot(u, before[name][1]))
            row["change"] = f"{change:+.3g}"
            row["ratio"] = f"{abs(change) / spread:.1f}" if spread > 0.0 else ""
        rows.append(row)
    columns = [
        {"name": key, "label": say(f"results.{key}"), "field": key, "align": "left" if key == "name" else "right"}
        for key in ("name", "value", "u", "change", "ratio")
    ]
    with ui.card().classes("panel"):
        ui.label(say("results.parameters")).classes("subtitle")
        paged(columns, rows, "name", 12)


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
                lines = [visitor.bench.without_path(str(error))]
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
        if attempt.calibration is None:
            lines.append(f"{attempt.method}: {visitor.bench.without_path(attempt.reason)}")
        elif expected is not None:
            worst = ", ".join(f"{x:.3f}" for x in np.degrees(expected.from_calibration[:, ALL_ANGLES.index("azimuth")]))
            at = ", ".join(f"{x:g}" for x in np.degrees(found.inclination).round(9))
            lines.append(f"{attempt.method}: u(azimuth) {FROM_CALIBRATION} {worst} deg at {at} deg")
    return lines
