"""Tables as CSV, for spreadsheets: a text that a spreadsheet would take for a formula is made a text."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence
from typing import Annotated, Any

from fastapi import APIRouter, Query, Response

from inclinometry.constants import ANGLES
from inclinometry.laboratory.registry import due_days, tools
from inclinometry.laboratory.results import history
from inclinometry.laboratory.web.api.access import REFUSALS, Reader, RecordId, TheLedger

router = APIRouter(prefix="/tables", tags=["tables"], responses=REFUSALS)

Cell = str | float | int | None


def plain(value: Cell) -> str:
    """A cell as a spreadsheet may show it but not calculate it.

    Examples
    --------
    >>> plain("=cmd()"), plain(-1.5), plain("-1.5"), plain(" =1+1"), plain("IN-7")
    ("'=cmd()", '-1.5', "'-1.5", "' =1+1", 'IN-7')
    """
    formula = tuple("=+-@\t\r\n|%")  # first characters that make spreadsheets calculate, or run, what a cell holds
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    if isinstance(value, str):
        return f"'{value}" if value.startswith(formula) or value.lstrip().startswith(formula) else value
    return repr(value)


def _csv(name: str, heads: Sequence[str], rows: Iterable[Sequence[Cell]]) -> Response:
    """The answer; with a byte order mark, without which spreadsheets misread what is not English."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow([plain(head) for head in heads])
    writer.writerows([plain(cell) for cell in row] for row in rows)
    headers = {"content-disposition": f'attachment; filename="{name}.csv"'}
    return Response("\ufeff" + text.getvalue(), media_type="text/csv; charset=utf-8", headers=headers)


@router.get("/tools.csv", response_class=Response)
def tools_table(ledger: TheLedger, _: Reader) -> Response:
    """All tools."""
    found = tools(ledger, limit=20_000)
    due = due_days(ledger, found)
    rows = [
        (t.serial, t.name, t.manufacturer, t.customer, t.interval_months, str(due.get(t.serial, "")), int(t.retired))
        for t in found
    ]
    heads = ("serial", "name", "manufacturer", "customer", "interval_months", "due", "retired")
    return _csv("tools", heads, rows)


@router.get("/history.csv", response_class=Response)
def history_table(
    ledger: TheLedger, _: Reader, serial: Annotated[str, Query(min_length=1, max_length=200)]
) -> Response:
    """The parameters of a tool, a row a calibration and parameter."""
    found = history(ledger, serial)
    rows = [
        (day.isoformat(), created, record, name, float(found.values[name][place]), float(found.u[name][place]))
        for place, (day, created, record) in enumerate(zip(found.measured, found.created, found.records, strict=True))
        for name in found.values
    ]
    return _csv("history", ("measured", "created", "calibration", "parameter", "value", "u"), rows)


@router.get("/verification/{verification}.csv", response_class=Response)
def verification_table(ledger: TheLedger, _: Reader, verification: RecordId) -> Response:
    """A recorded verification position by position, degrees."""
    report: dict[str, Any] = ledger.get("verification", verification).body["report"]
    fields = ("error_deg", "U_deg", "limit_deg", "decision")
    heads = ["position", "inclination_deg", "azimuth_deg", "toolface_deg"]
    heads += [f"{name}_{field}" for name in ANGLES for field in fields]
    rows = [
        [row[key] for key in heads[:4]] + [row[name].get(field) for name in ANGLES for field in fields]
        for row in report["positions"]
    ]
    return _csv("verification", heads, rows)
