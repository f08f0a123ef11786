"""One style for every drawing, without any global state of matplotlib left behind.

Text and axes are drawn in a sentinel colour that becomes `currentColor` on the page, series in colours that become CSS
variables, so one SVG serves light and dark. Colours: Okabe and Ito's palette, safe for colour-blind readers; series
also differ in marker or dash.
"""

from __future__ import annotations

import io
import re
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from inclinometry.files.writing import write_bytes

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK = "#010203"
SERIES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8a6d00", "#5b5bd6", "#56b4e9", "#777777")
BAD = "#c1272d"
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
DASHES = ("-", "--", "-.", ":")

_VARIABLES = {INK: "currentColor", BAD: f"var(--bad, {BAD})"} | {
    colour: f"var(--series-{n + 1}, {colour})" for n, colour in enumerate(SERIES)
}
_RC: dict[str, Any] = {
    "font.size": 10.5,
    "axes.titlesize": 10.5,
    "axes.labelsize": 10.5,
    "axes.titlelocation": "left",
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.alpha": 0.18,
    "grid.color": INK,
    "legend.frameon": False,
    "legend.fontsize": 10.0,
    "lines.linewidth": 1.6,
    "lines.markersize": 4.5,
    "text.parse_math": False,
    "axes.unicode_minus": True,
    "svg.fonttype": "none",
    "svg.hashsalt": "inclinometry",
    "figure.constrained_layout.use": True,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
} | dict.fromkeys(
    ("text.color", "axes.labelcolor", "axes.edgecolor", "axes.titlecolor", "xtick.color", "ytick.color"), INK
)
_LOCK = threading.RLock()
_P = ParamSpec("_P")
_R = TypeVar("_R")


@contextmanager
def style() -> Iterator[None]:
    """The package's style while the block runs, whatever the user's own settings; one thread at a time."""
    import matplotlib

    with _LOCK, matplotlib.rc_context(), warnings.catch_warnings():
        # a name in a script the font lacks is still drawn by the browser
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        matplotlib.rcdefaults()
        settings: Any = matplotlib.rcParams  # typed by a list of names that changes with every release
        settings.update(_RC)
        yield


def styled(draw: Callable[_P, _R]) -> Callable[_P, _R]:
    """Run a drawing function in the package's style."""

    @wraps(draw)
    def inside(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with style():
            return draw(*args, **kwargs)

    return inside


def new_figure(height: float, *, width: float = 4.6) -> Figure:
    """An empty figure, in; the object-oriented interface needs no pyplot and leaves nothing open.

    Its text stays readable when a figure of the default width is shown 360 pixels wide.
    """
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height))


def station_axis(axes: Axes, names: list[str], most: int = 12) -> None:
    """Label the x axis with station names, at most so many, long ones cut."""
    step = -(-len(names) // most)
    places = list(range(0, len(names), step))
    labels = [names[i] if len(names[i]) <= 9 else names[i][:8] + "…" for i in places]
    turned = max((len(label) for label in labels), default=0) > 3
    axes.set_xticks(places, labels, rotation=90 if turned else 0)
    axes.set_xlim(-0.7, len(names) - 0.3)
    axes.set_xlabel("station")


def inline_svg(figure: Figure, name: str, description: str) -> Markup:
    """SVG for a page: no prologue, unique ids, colours of the page, a description for those who do not see it.

    Parameters
    ----------
    figure : Figure
    name : str
        Prefix of every id; unique on the page, letters and digits.
    description : str
        Plain text.
    """
    from markupsafe import Markup, escape

    def tag(found: re.Match[str]) -> str:
        text = found.group(0)
        text = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{name}-", text)
        return _COLOUR.sub(lambda colour: _VARIABLES[colour.group(0)], text)

    # text of the figure may hold anything: only tags are touched
    body = re.sub(r"<[^>]*>", tag, _svg(figure))
    body = re.sub(r'^<svg ([^>]*?)width="[^"]*"', r"<svg \1", body)
    body = re.sub(r'^<svg ([^>]*?)height="[^"]*"', r"<svg \1", body)
    return Markup(body.replace("<svg ", f'<svg role="img" aria-label="{escape(description)}" ', 1))


def save_svg(figure: Figure, path: str | Path) -> None:
    """Write a figure as an SVG file of its own, black on white, the same bytes every time."""
    write_bytes(_svg(figure, paper="white").encode(), path)


def save_png(figure: Figure, path: str | Path, *, dpi: int = 150) -> None:
    """Write a figure as PNG, black on white, the same bytes every time with the same libraries."""
    with style():
        stream = io.BytesIO()
        figure.savefig(stream, format="png", dpi=dpi, facecolor="white", metadata={"Software": None})
    write_bytes(stream.getvalue(), path)


_COLOUR = re.compile("|".join(_VARIABLES))


def _svg(figure: Figure, paper: str = "none") -> str:
    with style():
        stream = io.StringIO()
        nothing = {"Date": None, "Creator": None, "Format": None, "Type": None}
        figure.savefig(stream, format="svg", facecolor=paper, metadata=nothing)
    text = stream.getvalue()
    return text[text.index("<svg") :]
