"""A page that leads to others."""

from __future__ import annotations

from collections.abc import Sequence

from inclinometry.report.content import CONVENTIONS
from inclinometry.report.page import render


def index_page(heading: str, pages: Sequence[tuple[str, str]]) -> str:
    """Links (title, relative address) as one HTML page.

    Examples
    --------
    >>> "a &lt;b&gt;</a>" in index_page("Reports", [("a <b>", "a/report.html")])
    True
    """
    return render(
        "index.html", title=heading, kind="Overview", heading=heading, conventions=CONVENTIONS, pages=list(pages)
    )
