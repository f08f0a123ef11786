"""Pages: tables and pictures in the shipped templates, everything that comes from outside escaped."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from html import escape, unescape
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any, NamedTuple

from inclinometry.language import current_language, label
from inclinometry.report.figure import inline_svg

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup
    from matplotlib.figure import Figure

MOST_ROWS = 500
"""Rows a table shows; the files hold the rest."""


def render(template: str, **content: Any) -> str:
    """A page from a template of this package.

    Numbers are formatted before they get here; text is escaped here, once, by the template engine.
    """
    try:
        release = version("inclinometry")
    except PackageNotFoundError:
        release = "source"
    page = _environment().get_template(template).render(version=release, language=current_language(), **content)
    return clean(_with_contents(page))


def _with_contents(page: str) -> str:
    """A page of several headings with a list of them under its title, and from each a way back to the top."""
    headings: list[str] = []

    def heading(found: re.Match[str]) -> str:
        headings.append(found[1])
        place, top = len(headings), escape(label("Back to the top"))
        return f'<h2 id="part-{place}">{found[1]} <a class="top" href="#top" aria-label="{top}">↑</a></h2>'

    # the headings of the index are links themselves
    page = re.sub(r"<h2>([^<]*)</h2>", heading, page)
    links = "\n".join(f'<a href="#part-{n}">{text}</a>' for n, text in enumerate(headings, 1))
    title = escape(label("Contents"))
    bar = f'<nav class="contents" aria-label="{title}">\n{links}\n</nav>' if len(headings) > 2 else ""
    return page.replace("<!-- contents -->", bar, 1)


def linked_back(page: str, href: str, text: str) -> str:
    """A report with a link to the page it is listed on."""
    link = f'<p class="back"><a href="{escape(href)}">← {escape(label(text))}</a></p>'
    return page.replace("<header>", f"<header>\n{link}", 1)


def clean(text: str) -> str:
    r"""Drop control characters and lone surrogates, which no page may hold.

    Examples
    --------
    >>> clean("a\x00b\ud800c\n")
    'abc\n'
    """
    kept = "".join(c for c in text if c in "\n\t" or (c >= " " and not "\x7f" <= c <= "\x9f"))
    return kept.encode("utf-8", "ignore").decode("utf-8")


@cache
def _environment() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("inclinometry.report", "templates")
    found = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    found.globals["say"] = label
    return found


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
    """A drawing, what stands above it, its width in pixels."""

    caption: str
    svg: Markup
    width: int


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


def report(
    kind: str,
    title: str,
    verdict: str,
    sections: Sequence[Section | None],
    facts: Sequence[tuple[str, str]],
    *,
    about: str,
    states: Sequence[tuple[object, str, str]],
    heading: str = "",
    conventions: str = CONVENTIONS,
    notes: Sequence[str] = (),
    warnings: Sequence[str] = (),
    inputs: Mapping[str, str] | None = None,
) -> str:
    """A page of sections, verdict first, with the first of `states` (whether it holds, colour, badge) that holds."""
    state, badge = next((colour, text) for holds, colour, text in states if holds)
    return render(
        "report.html",
        about=about,
        title=title,
        kind=kind,
        heading=heading or title,
        conventions=conventions,
        state=state,
        badge=badge,
        verdict=verdict,
        notes=list(notes),
        warnings=list(warnings),
        sections=[section for section in sections if section is not None],
        facts=[*facts, *digests(inputs)],
    )


def digests(inputs: Mapping[str, str] | None) -> list[tuple[str, str]]:
    """Facts on the files a page was made from."""
    return [(label("Digest of {name}", name=name), digest) for name, digest in (inputs or {}).items()]


def picture(figure: Figure, name: str, caption: str) -> Picture:
    """A figure as it goes into a page; `name` is unique there."""
    return Picture(caption, *inline_svg(figure, name, caption))


def limit_rows(table: Table) -> Table:
    """No more rows than a page bears; what is left out is said."""
    if len(table.body) <= MOST_ROWS:
        return table
    part = label("The first {most} of {count} rows; the data files hold all.", most=MOST_ROWS, count=len(table.body))
    note = f"{part} {label(table.note)}".strip()
    return Table(table.caption, table.head, table.body[:MOST_ROWS], note, table.text_columns)


class Entry(NamedTuple):
    """A report of the index: what it says in its verdict box, one figure of it, a file beside it or its SVG, and the
    files that were written with it."""

    title: str
    href: str
    state: str = ""
    badge: str = ""
    sentence: str = ""
    picture: str = ""
    svg: str = ""
    files: Sequence[str] = ()


def entry_of(title: str, href: str, report: str, picture: str = "") -> Entry:
    """Entry of a report; the verdict is read from its page, so that the index agrees with it."""
    box = r'<section class="verdict (\w*)"[^>]*>\s*<p class="badge">(.*?)</p>\s*<p class="sentence">(.*?)</p>'
    verdict, figure = re.search(box, report, re.DOTALL), re.search(r"<svg\b.*?</svg>", report, re.DOTALL)
    state, badge, sentence = ["", "", ""] if verdict is None else [unescape(text.strip()) for text in verdict.groups()]
    svg = "" if picture or figure is None else figure.group()
    return Entry(title, href, state, badge, sentence, picture, svg)


def index_page(heading: str, entries: Sequence[Entry]) -> str:
    """Entries as one HTML page.

    Examples
    --------
    >>> "a &lt;b&gt;</a>" in index_page("Reports", [Entry("a <b>", "a/report.html")])
    True
    """
    from markupsafe import Markup

    entries = [one._replace(svg=Markup(one.svg)) for one in entries]
    return render("index.html", title=heading, kind="Overview", heading=heading, conventions=CONVENTIONS, pages=entries)
