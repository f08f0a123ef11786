"""Pages: jinja2 templates shipped with the package, everything that comes from outside escaped."""

from __future__ import annotations

from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment

MOST_ROWS = 500
"""Rows a table shows; the files hold the rest."""


def render(template: str, **content: Any) -> str:
    """A page from a template of this package.

    Numbers are formatted before they get here; text is escaped here, once, by the template engine.
    """
    text = _environment().get_template(template).render(version=_version(), clean=clean, **content)
    return clean(text)


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
    return Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)


def _version() -> str:
    try:
        return version("inclinometry")
    except PackageNotFoundError:
        return "source"
