"""The shapes templates take: tables of ready text and figures with a caption."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from inclinometry.report.figure import inline_svg
from inclinometry.report.page import MOST_ROWS

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.figure import Figure

CONVENTIONS = (
    "Conventions: azimuth clockwise from north seen from above; inclination 0 pointing down, 90 deg level; toolface "
    "clockwise looking down hole from high side to the tool's x axis; tool axes x at the index mark, y 90 deg "
    "clockwise of it looking down hole, z down hole; fields are the fields themselves (gravity points down); dip "
    "positive below the horizon; a sensor reports N a + U0 for a field along the unit vector a. u: standard "
    "uncertainty (k = 1); U = k u: expanded."
)


class TableRow(NamedTuple):
    """Cells of ready text; `state` "", "warn" or "bad" colours the row."""

    cells: Sequence[str]
    state: str = ""


@dataclass(frozen=True)
class Table:
    """A table; the first `text_columns` columns are text, the others numbers."""

    caption: str
    head: Sequence[str]
    body: Sequence[TableRow]
    note: str = ""
    text_columns: int = 1


@dataclass(frozen=True)
class Picture:
    """A drawing and what stands above it."""

    caption: str
    svg: Markup


@dataclass(frozen=True)
class Section:
    """What stands under one heading of a page; an empty one is left out."""

    heading: str
    sentences: Sequence[str] = ()
    tables: Sequence[Table | None] = ()
    pictures: Sequence[Picture] = ()
    steps: Sequence[str] = ()

    @property
    def filled(self) -> bool:
        """Whether anything stands there."""
        return bool(self.sentences or any(self.tables) or self.pictures or self.steps)


def picture(figure: Figure, name: str, caption: str) -> Picture:
    """A figure as it goes into a page; `name` is unique there."""
    return Picture(caption, inline_svg(figure, name, caption))


def cut(table: Table) -> Table:
    """No more rows than a page bears; what is left out is said."""
    if len(table.body) <= MOST_ROWS:
        return table
    note = f"The first {MOST_ROWS} of {len(table.body)} rows; the data files hold all. {table.note}".strip()
    return Table(table.caption, table.head, table.body[:MOST_ROWS], note, table.text_columns)
