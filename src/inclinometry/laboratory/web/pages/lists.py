"""Tables of records, addresses made of names no one has checked, and the page that takes a file of readings."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any, Final, NamedTuple
from urllib.parse import quote

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from nicegui import events, ui
from nicegui.elements.mixins.text_element import TextElement

from inclinometry.errors import InclinometryError, refused
from inclinometry.laboratory.guided_plans import CALIBRATING
from inclinometry.laboratory.import_file import LARGEST, import_file
from inclinometry.laboratory.ledger.ledger import Record
from inclinometry.laboratory.registry import not_registered, rigs, sites, tools
from inclinometry.laboratory.session import PURPOSES
from inclinometry.laboratory.verification import protocols
from inclinometry.laboratory.web.frame import Visitor, aside, frame
from inclinometry.workflow.calibrate import Options


@ui.page("/import")
def import_page(request: Request, serial: str = "", rig: str = "") -> None:
    """Readings or tool.json, for a tool and a rig that are registered."""
    with frame(request, "import.title", needs="capture") as visitor, ui.card().classes("panel"):
        ui.label(visitor.say("import.about", size=LARGEST // 1_000_000)).classes("dim")
        _import_form(visitor, serial, rig)


def _import_form(visitor: Visitor, serial: str, rig: str) -> None:
    """Tool, rig, site, and the file; it is recorded as soon as it has arrived."""
    ledger, say = visitor.bench.ledger, visitor.say
    serials = [tool.serial for tool in tools(ledger) if not tool.retired or tool.serial == serial]
    names = [rig.name for rig in rigs(ledger)]
    places = [site.name for site in sites(ledger)]
    purposes = {name: say(f"purpose.{name}") for name in PURPOSES if name != "verify"}
    chosen = serial if serial in serials else None if serial else only(serials)
    with ui.row().classes("form"):
        tool = ui.select(serials, value=chosen, label=say("tools.serial"), with_input=True)
        stand = ui.select(names, value=rig if rig in names else only(names), label=say("start.rig"))
        site = ui.select(["", *places], value=only(places) or "", label=say("start.site"))
        purpose = ui.select(purposes, value="calibrate", label=say("tools.purpose"))
        left_handed = ui.switch(say("start.left_handed"))
    if not serials or not names:
        ui.label(say("import.register")).classes("warn")
    problem = ui.label("").classes("bad").props('role="alert" data-testid="form-problem"')
    if serial and chosen is None:
        problem.set_text(visitor.problem(not_registered("tool", serial)))

    def recorded(content: bytes, author: str) -> Record:
        options = Options(left_handed=bool(left_handed.value))
        about: dict[str, Any] = {"author": author, "site": str(site.value or ""), "purpose": str(purpose.value)}
        return import_file(ledger, content, str(tool.value), str(stand.value), options=options, **about)

    async def arrived(event: events.UploadEventArguments) -> None:
        try:
            user = visitor.require("capture")
            if event.file.size() > LARGEST:
                raise refused("file-large", {"what": "bytes", "size": event.file.size(), "most": LARGEST})
            if not tool.value or not stand.value:
                raise refused("web-choose", {"what": ("tool", "rig")})
            content = await event.file.read()
            made = await aside(lambda: recorded(content, user.name))
        except InclinometryError as error:
            upload.reset()
            problem.set_text(visitor.problem(error))
            return
        ui.navigate.to(f"{'/results' if made.kind == 'calibration' else '/calibrate'}/{made.id}")

    upload = ui.upload(
        label=say("import.file"), auto_upload=True, max_files=1, max_file_size=LARGEST, on_upload=arrived
    ).classes("wide")
    upload.on("rejected", lambda: problem.set_text(say("import.too_large")))


def only(choices: Sequence[str]) -> str | None:
    """The one there is; None where there is a choice."""
    return choices[0] if len(choices) == 1 else None


# Charts that follow the theme: lines, points with error bars.

BLUE: Final = "#2f7fd0"
GREY: Final = "#8896a4"
RED: Final = "#d0453b"
_BAR: Final = """(params, api) => {
    const low = api.coord([api.value(0), api.value(1)]), high = api.coord([api.value(0), api.value(2)]);
    const style = {stroke: api.visual("color"), lineWidth: 1};
    const line = (x1, y1, x2, y2) => ({type: "line", shape: {x1, y1, x2, y2}, style});
    return {type: "group", children: [line(low[0], low[1], high[0], high[1]),
        line(low[0] - 3, low[1], low[0] + 3, low[1]), line(high[0] - 3, high[1], high[0] + 3, high[1])]};
}"""

NUMBER: Final = """value => typeof value === "number"
    ? value.toLocaleString(document.documentElement.lang || "en", {maximumFractionDigits: 9}) : value"""
"""A number of a chart as the language of the page writes it."""


def legend(names: Sequence[str] | None = None) -> dict[str, Any]:
    """A legend above the curves; of these series only, when named."""
    found: dict[str, Any] = {"top": 0, "type": "scroll", "textStyle": {"color": GREY}}
    return found if names is None else found | {"data": list(names)}


def chart(
    label: str,
    series: Sequence[dict[str, Any]],
    x: dict[str, Any],
    y: dict[str, Any],
    *,
    height: str = "260px",
    **options: Any,
) -> None:
    """Series over two axes, with a name for those who cannot see them."""
    # colours of series that can be told apart on either paper
    palette = [BLUE, "#c77d14", "#2c9a56", "#b0529c", "#1ba3b5", GREY]
    common: dict[str, Any] = {"animation": False, "backgroundColor": "transparent", "color": palette}
    common |= {
        "grid": {"left": 60, "right": 20, "top": 30, "bottom": 45},
        "tooltip": {"trigger": "axis", ":valueFormatter": NUMBER},
    }
    common |= {"xAxis": x, "yAxis": y, "series": list(series)}
    ui.echart(common | options).style(f"height:{height};width:100%").props(f'role="img" aria-label="{label}"')


def axis(name: str, data: Sequence[str] | None = None, *, kind: str = "value") -> dict[str, Any]:
    """An axis with its name and unit; of these places where they are given."""
    kind = kind if data is None else "category"
    gap = 30 if kind != "value" else 45
    found: dict[str, Any] = {"type": kind, "name": name, "nameLocation": "middle", "nameGap": gap, "scale": True}
    found |= {"axisLabel": {"color": GREY}, "nameTextStyle": {"color": GREY, "lineHeight": 15}}
    if kind == "value":
        found["axisLabel"][":formatter"] = NUMBER
    found |= {"splitLine": {"lineStyle": {"opacity": 0.2}}}
    return found if data is None else found | {"data": list(data)}


def band(
    name: str, middle: Sequence[float | None], half: Sequence[float | None], colour: str = BLUE
) -> list[dict[str, Any]]:
    """Series of a line with its band: the lower edge, unseen, then the width stacked on it, then the line."""
    low = [None if m is None or h is None else m - h for m, h in zip(middle, half, strict=True)]
    width = [None if h is None else 2.0 * h for h in half]
    hidden = {"type": "line", "symbol": "none", "lineStyle": {"opacity": 0}, "tooltip": {"show": False}, "silent": True}
    hidden |= {"stack": name, "stackStrategy": "all"}
    own = {"color": colour}
    return [
        {**hidden, "name": f"{name} -", "data": low},
        {**hidden, "name": f"{name} +", "data": width, "areaStyle": {**own, "opacity": 0.2}},
        {"type": "line", "name": name, "data": list(middle), "lineStyle": own, "itemStyle": own},
    ]


def bars(
    name: str, middle: Sequence[float | None], half: Sequence[float | None], decisions: Sequence[str]
) -> list[dict[str, Any]]:
    """Series of points coloured by their decision, with bars."""
    decided = {"pass": "#2c9a56", "fail": RED, "inconclusive": "#b07a10"}
    colours = [decided.get(decision, GREY) for decision in decisions]
    points = [{"value": m, "itemStyle": {"color": c}} for m, c in zip(middle, colours, strict=True)]
    edges = [
        {"value": [place, m - h, m + h], "itemStyle": {"color": colours[place]}}
        for place, (m, h) in enumerate(zip(middle, half, strict=True))
        if m is not None and h is not None
    ]
    bar = {"type": "custom", "name": f"{name} ±", ":renderItem": _BAR, "encode": {"x": 0, "y": [1, 2]}, "data": edges}
    return [
        {"type": "scatter", "name": name, "symbolSize": 7, "data": points, "itemStyle": {"color": GREY}},
        {**bar, "silent": True, "tooltip": {"show": False}},
    ]


# The REST interface described on a page of its own, without anything from elsewhere.

router = APIRouter(include_in_schema=False)

_HEAD = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>REST interface - inclinometry</title>
<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="stylesheet" href="/static/bench.css">
</head><body><main class="page" style="display:block"><h1 class="title">REST interface</h1>
<p>Angles in degrees. A program logs in at <code>POST /api/v1/login</code> and sends
<code>Authorization: Bearer TOKEN</code>; a browser sends the header <code>X-CSRF-Token</code> that
<code>GET /api/v1/me</code> gives. The whole description: <a href="/api/openapi.json">openapi.json</a>.</p>"""


@router.get("/api")
def interface(request: Request) -> HTMLResponse:
    """Every route with what it takes."""
    content = request.app.openapi()
    parts = [_HEAD]
    for path, methods in content["paths"].items():
        for method, about in methods.items():
            takes = [f"{p['name']} ({p['in']})" for p in about.get("parameters", [])]
            body = about.get("requestBody", {}).get("content", {}).get("application/json", {}).get("schema", {})
            name = body.get("$ref", "").rpartition("/")[2]
            shown = ""
            if name:
                properties = content["components"]["schemas"][name].get("properties", {})
                shown = f"<pre>{escape(json.dumps(properties, indent=1, ensure_ascii=False))}</pre>"
            parts.append(
                f'<details class="panel" style="margin:.5rem 0"><summary><code>{method.upper()} {escape(path)}</code> '
                f"{escape(about.get('description', '').splitlines()[0])}</summary>"
                f"<p>{escape(', '.join(takes))}</p>{shown}</details>"
            )
    return HTMLResponse("".join([*parts, "</main></body></html>"]))


class Cell(NamedTuple):
    """A text, where it leads to, its style."""

    text: str
    link: str = ""
    style: str = ""


def plan_words(visitor: Visitor, name: str) -> str:
    """A plan or protocol as a visitor reads it; one of his own as it is called."""
    reach = re.fullmatch(r"(.+), (\d+) of (\d+) positions within reach of the rig", name)
    if reach is not None:
        first = plan_words(visitor, reach[1])
        return f"{first}, {visitor.say('home.progress', done=reach[2], all=reach[3])}"
    known = {*CALIBRATING, *protocols()}
    return visitor.say(f"plan.{name}") if name in known else visible(name)


def scale_unknown(visitor: Visitor, kinds: Sequence[str], day: str = "") -> None:
    """What a change, of a day where there are several, does not show where the strength of a field is not stated."""
    if kinds:
        named = visitor.sentence(", ").join(visitor.say(f"live.{kind}") for kind in kinds)
        key = "tools.scale_unknown" if day else "results.scale_unknown"
        ui.label(visitor.say(key, kinds=named, day=day)).classes("dim")


def parameter_words(visitor: Visitor, name: str) -> str:
    """A parameter of a tool as people call it: sensor and what of it; one of another form as it is called."""
    found = re.fullmatch(r"(\w+)\.(tensor|offset)\[(\d+)(?:,(\d+))?\](?:\.T(\d+))?", name)
    if found is None:
        return name
    kind, what, sensor, axis, power = found.groups()
    names = ["XYZ"[int(x)] if x is not None and int(x) < 3 else str(int(x or 0) + 1) for x in (sensor, axis)]
    of = f"{visitor.say(f'live.{kind}')} {names[0]}"
    key = "zero" if what == "offset" else "scale" if sensor == axis else "cross"
    said = visitor.say(f"parameter.{key}", sensor=of, axis=names[1])
    return f"{said}, °C{'⁻' + '⁰¹²³⁴⁵⁶⁷⁸⁹'[int(power)]}" if power else said


def visible(text: str) -> str:
    """A text whose characters are read in the order in which they stand: marks that turn it around are shown as such.

    Examples
    --------
    >>> visible("A\u202e1")
    'A�1'
    """
    turning = [0x061C, 0x200E, 0x200F, *range(0x202A, 0x202F), *range(0x2066, 0x206A)]
    return text.translate(dict.fromkeys(turning, "\ufffd"))


def column(name: str, label: str, *, left: bool = False) -> dict[str, Any]:
    """A column of `paged`."""
    return {"name": name, "label": label, "field": name, "align": "left" if left else "right"}


def paged(columns: Sequence[dict[str, Any]], rows: Sequence[dict[str, Any]], key: str, size: int) -> None:
    """A long table, so many rows at a time; columns and rows as `ui.table` takes them."""
    made = ui.table(columns=list(columns), rows=list(rows), row_key=key, pagination=size)
    made.classes("number paged").props("flat dense")
    made.props[":rows-per-page-options"] = f"[{size}]"
    made.props[":pagination-label"] = '(first, last, all) => first + " - " + last + " / " + all'


def table(heads: Sequence[str], lines: Iterable[Sequence[Cell | str]]) -> None:
    """A plain table, every cell shown as text; it scrolls by itself on a narrow screen."""
    with ui.element("div").classes("scroll"), ui.element("table").classes("list"):
        with ui.element("thead"), ui.element("tr"):
            for head in heads:
                TextElement(tag="th", text=head).props("scope=col")
        with ui.element("tbody"):
            for line in lines:
                with ui.element("tr"):
                    for cell in line:
                        text, link, style = cell if isinstance(cell, Cell) else Cell(cell)
                        if link:
                            with ui.element("td"):
                                ui.link(visible(text), link).classes(f"number {style}")
                        else:
                            TextElement(tag="td", text=visible(text)).classes(f"number {style}")


def to(place: str, name: str = "", **query: str | int) -> str:
    """An address below a place of this bench, whatever the name holds.

    Examples
    --------
    >>> to("/tools", "A/1?x"), to("/ledger", kind="event", key="a&b")
    ('/tools/A%2F1%3Fx', '/ledger?kind=event&key=a%26b')
    """
    path = f"{place}/{quote(name, safe='')}" if name else place
    asked = "&".join(f"{key}={quote(str(value), safe='')}" for key, value in query.items())
    return f"{path}?{asked}" if asked else path


def day(created: str) -> str:
    """Date and minute of a record's time.

    Examples
    --------
    >>> day("2026-03-01T12:30:15.000000+00:00")
    '2026-03-01 12:30'
    """
    return created[:16].replace("T", " ")
