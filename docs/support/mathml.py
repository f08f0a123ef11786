"""Formulas as MathML, which browsers draw themselves: no script, no font and no network is needed to read a page."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util import logging

_LOG = logging.getLogger(__name__)


# docutils puts a function, or a power of one, and its argument side by side
_NAME = r"<mi[^>]*>(?:sin|cos|tan|cot|log)</mi>"
_FUNCTION = re.compile(rf"(<msup>\s*{_NAME}.*?</msup>|{_NAME})(\s*<mo[^>]*>\()?", re.DOTALL)


def _spaced(found: re.Match[str]) -> str:
    """The function with a thin space after it, unless a bracket follows."""
    return found[0] if found[2] else found[1] + '<mspace width="0.17em"/>'


def _mathml(node: nodes.Node, *, block: bool) -> str:
    source = node.astext()
    try:
        return _FUNCTION.sub(_spaced, str(tex2mathml(source, as_block=block)))
    except (SyntaxError, ValueError, IndexError) as error:
        _LOG.warning("formula %r cannot be drawn: %s", source, error, location=node)
        return ""


def inline(translator: Any, node: nodes.Node) -> None:
    """A formula within a line."""
    translator.body.append(_mathml(node, block=False))
    raise nodes.SkipNode


def block(translator: Any, node: nodes.Node) -> None:
    """A formula on lines of its own; a wide one scrolls within the page."""
    translator.body.append(f'<div class="math-block">{_mathml(node, block=True)}</div>\n')
    raise nodes.SkipNode


def setup(app: Any) -> dict[str, bool]:
    """Register as Sphinx's renderer of formulas."""
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
