"""Charts that follow the theme: lines, points with error bars."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from nicegui import ui

BLUE: Final = "#2f7fd0"
GREY: Final = "#8896a4"
RED: Final = "#d0453b"
GREEN: Final = "#2c9a56"
AMBER: Final = "#b07a10"
PALETTE: Final = [BLUE, "#c77d14", GREEN, "#b0529c", "#1ba3b5", GREY]
"""Colours of series that can be told apart on either paper."""
DECIDED: Final = {"pass": GREEN, "fail": RED, "inconclusive": AMBER}
_BAR: Final = """(params, api) => {
    const low = api.coord([api.value(0), api.value(1)]), high = api.coord([api.value(0), api.value(2)]);
    const style = {stroke: api.visual("color"), lineWidth: 1};
    const line = (x1, y1, x2, y2) => ({type: "line", shape: {x1, y1, x2, y2}, style});
    return {type: "group", children: [line(low[0], low[1], high[0], high[1]),
        line(low[0] - 3, low[1], low[0] + 3, low[1]), line(high[0] - 3, high[1], high[0] + 3, high[1])]};
}"""


def legend(names: Sequence[str] | None = None) -> dict[str, Any]:
    """A legend above the curves; of these series only, when named."""
    found: dict[str, Any] = {"top": 0, "type": "scroll", "textStyle": {"color": GREY}}
    return found if names is None else found | {"data": list(names)}


def chart(options: dict[str, Any], label: str, *, height: str = "260px") -> None:
    """A chart with a name for those who cannot see it."""
    common: dict[str, Any] = {
        "animation": False,
        "backgroundColor": "transparent",
        "color": PALETTE,
        "grid": {"left": 60, "right": 20, "top": 30, "bottom": 45},
        "tooltip": {"trigger": "axis"},
    }
    ui.echart(common | options).style(f"height:{height};width:100%").props(f'role="img" aria-label="{label}"')


def axis(name: str, *, kind: str = "value", data: Sequence[str] | None = None) -> dict[str, Any]:
    """An axis with its name and unit."""
    found: dict[str, Any] = {
        "type": kind,
        "name": name,
        "nameLocation": "middle",
        "nameGap": 30 if kind != "value" or data is not None else 45,
        "axisLabel": {"color": GREY},
        "nameTextStyle": {"color": GREY},
        "splitLine": {"lineStyle": {"opacity": 0.2}},
        "scale": True,
    }
    if data is not None:
        found["data"] = list(data)
    return found


def band(
    name: str, middle: Sequence[float | None], half: Sequence[float | None], colour: str = BLUE
) -> list[dict[str, Any]]:
    """Series of a line with its band: the lower edge, unseen, then the width stacked on it, then the line."""
    low = [None if m is None or h is None else m - h for m, h in zip(middle, half, strict=True)]
    width = [None if h is None else 2.0 * h for h in half]
    hidden = {"type": "line", "symbol": "none", "lineStyle": {"opacity": 0}, "tooltip": {"show": False}, "silent": True}
    return [
        {**hidden, "name": f"{name} -", "data": low, "stack": name, "stackStrategy": "all"},
        {
            **hidden,
            "name": f"{name} +",
            "data": width,
            "stack": name,
            "stackStrategy": "all",
            "areaStyle": {"color": colour, "opacity": 0.2},
        },
        {
            "type": "line",
            "name": name,
            "data": list(middle),
            "lineStyle": {"color": colour},
            "itemStyle": {"color": colour},
        },
    ]


def bars(
    name: str, middle: Sequence[float | None], half: Sequence[float | None], decisions: Sequence[str]
) -> list[dict[str, Any]]:
    """Series of points coloured by their decision, with bars."""
    colours = [DECIDED.get(decision, GREY) for decision in decisions]
    points = [{"value": m, "itemStyle": {"color": c}} for m, c in zip(middle, colours, strict=True)]
    edges = [
        {"value": [place, m - h, m + h], "itemStyle": {"color": colours[place]}}
        for place, (m, h) in enumerate(zip(middle, half, strict=True))
        if m is not None and h is not None
    ]
    bar = {"type": "custom", "name": f"{name} ±", ":renderItem": _BAR, "encode": {"x": 0, "y": [1, 2]}, "data": edges}
    return [
        {"type": "scatter", "name": name, "symbolSize": 7, "data": points, "itemStyle": {"color": BLUE}},
        {**bar, "silent": True, "tooltip": {"show": False}},
    ]
