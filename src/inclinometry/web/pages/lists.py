"""Tables of records, and addresses made of names nobody has checked."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Final, NamedTuple
from urllib.parse import quote

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

BIDI: Final = dict.fromkeys([0x061C, 0x200E, 0x200F, *range(0x202A, 0x202F), *range(0x2066, 0x206A)], "\ufffd")
_FROM_TO: Final = '(first, last, all) => first + " - " + last + " / " + all'


class Cell(NamedTuple):
    """A text, where it leads to, its style."""

    text: str
    link: str = ""
    style: str = ""


def visible(text: str) -> str:
    """A text whose characters are read in the order in which they stand: marks that turn it around are shown as such.

    Examples
    --------
    >>> visible("A\u202e1")
    'A�1'
    """
    return text.translate(BIDI)


def paged(columns: Sequence[dict[str, Any]], rows: Sequence[dict[str, Any]], key: str, size: int) -> None:
    """A long table, so many rows at a time; columns and rows as `ui.table` takes them."""
    made = ui.table(columns=list(columns), rows=list(rows), row_key=key, pagination=size)
    made.classes("number paged").props("flat dense")
    made.props[":rows-per-page-options"] = f"[{size}]"
    made.props[":pagination-label"] = _FROM_TO


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
                        _cell(cell if isinstance(cell, Cell) else Cell(cell))


def _cell(cell: Cell) -> None:
    if cell.link:
        with ui.element("td"):
            ui.link(visible(cell.text), cell.link).classes(f"number {cell.style}")
    else:
        TextElement(tag="td", text=visible(cell.text)).classes(f"number {cell.style}")


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
