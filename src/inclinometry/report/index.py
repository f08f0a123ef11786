"""A page that leads to others, each with the verdict and the first figure of its own report."""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import unescape
from typing import Final, NamedTuple

from inclinometry.report.content import CONVENTIONS
from inclinometry.report.page import render

_VERDICT: Final = re.compile(
    r'<section class="verdict (\w*)"[^>]*>\s*<p class="badge">(.*?)</p>\s*<p class="sentence">(.*?)</p>', re.DOTALL
)
_FIGURE: Final = re.compile(r"<svg\b.*?</svg>", re.DOTALL)


class Entry(NamedTuple):
    """A report of the index: what it says in its verdict box, and one figure of it, a file beside it or its SVG."""

    title: str
    href: str
    state: str = ""
    badge: str = ""
    sentence: str = ""
    picture: str = ""
    svg: str = ""


def entry_of(title: str, href: str, report: str, picture: str = "") -> Entry:
    """Entry of a report: the verdict as its page words it, so that the index cannot say anything else.

    Examples
    --------
    >>> page = '<section class="verdict good"><p class="badge">PASS</p><p class="sentence">a &lt; b</p></section>'
    >>> entry_of("Bench", "bench/report.html", page)[2:5]
    ('good', 'PASS', 'a < b')
    """
    verdict, figure = _VERDICT.search(report), _FIGURE.search(report)
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
