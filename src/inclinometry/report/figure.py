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
from textwrap import wrap
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

from inclinometry.files.writing import write_bytes
from inclinometry.language import label, number

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
    "legend.fontsize": 10.5,
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


def new_figure(height: float, *, width: float = 4.12) -> Figure:
    """An empty figure, in; the object-oriented interface needs no pyplot and leaves nothing open.

    Three of the default width stand in a row of a page, one fills the screen of a telephone.
    """
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height))


def panel(
    height: float, x: str = "", y: str = "", *, width: float = 4.12
) -> Callable[[Callable[Concatenate[Axes, _P], None]], Callable[_P, Figure]]:
    """Make of a function that draws on axes one that returns their figure, in the style, with these labels."""

    def made(draw: Callable[Concatenate[Axes, _P], None]) -> Callable[_P, Figure]:
        @wraps(draw)
        def inside(*args: _P.args, **kwargs: _P.kwargs) -> Figure:
            with style():
                figure = new_figure(height, width=width)
                axes = figure.add_subplot()
                axes.set_xlabel(x)
                axes.set_ylabel(y)
                draw(axes, *args, **kwargs)
                return figure

        return inside

    return made


def look(n: int) -> dict[str, Any]:
    """Colour, dash and marker of the n-th curve of a panel."""
    return {
        "color": SERIES[n % len(SERIES)],
        "linestyle": DASHES[n % len(DASHES)],
        "marker": MARKERS[n % len(MARKERS)],
    }


def legend_above(axes: Axes, columns: int) -> None:
    """The legend over the axes, from their left edge; none where nothing has a name."""
    if axes.get_legend_handles_labels()[1]:
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, borderaxespad=0.2, columnspacing=1.2)


def matrix_axes(axes: Axes, names: list[str]) -> None:
    """Name rows and columns of a square matrix drawn from the top left."""
    axes.set_xlim(-0.5, len(names) - 0.5)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_aspect("equal")
    axes.set_xticks(range(len(names)), names, rotation=90, fontsize=8.5)
    axes.set_yticks(range(len(names)), names, fontsize=8.5)


def station_axis(axes: Axes, names: list[str], most: int = 12) -> None:
    """Label the x axis with station names, at most so many, long ones cut."""
    step = -(-len(names) // most)
    places = list(range(0, len(names), step))
    labels = [names[i] if len(names[i]) <= 9 else names[i][:8] + "…" for i in places]
    turned = max((len(label) for label in labels), default=0) > 3
    axes.set_xticks(places, labels, rotation=90 if turned else 0)
    axes.set_xlim(-0.7, len(names) - 0.3)
    axes.set_xlabel("station")


def inline_svg(figure: Figure, name: str, description: str) -> tuple[Markup, int]:
    """A figure for a page and its width in pixels: ids with prefix `name`, in the colours and language of the page."""
    from markupsafe import Markup, escape

    def tag(found: re.Match[str]) -> str:
        text = found.group(0)
        text = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{name}-", text)
        return _COLOUR.sub(lambda colour: _VARIABLES[colour.group(0)], text)

    with style():
        _translate(figure)
        _fit(figure)
    # text of the figure may hold anything: only tags are touched
    body = re.sub(r"<[^>]*>", tag, _svg(figure))
    body = re.sub(r'^<svg ([^>]*?)width="[^"]*"', r"<svg \1", body)
    body = re.sub(r'^<svg ([^>]*?)height="[^"]*"', r"<svg \1", body)
    svg = Markup(body.replace("<svg ", f'<svg role="img" aria-label="{escape(label(description))}" ', 1))
    # 13 / 10.5 pixels for a point: every figure is shown at its own size, its text 13 pixels high
    return svg, round(72.0 * 13.0 / 10.5 * figure.get_figwidth())


def decimal_signs(figure: Figure) -> None:
    """Let the ticks of a figure have the decimal sign of the language that is spoken."""
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        formatter = axis.get_major_formatter()
        ticks = formatter.format_ticks
        vars(formatter)["format_ticks"] = lambda values, ticks=ticks: list(map(number, ticks(values)))


def _translate(figure: Figure) -> None:
    """Every text of a figure, and the names on its axes, in the language that is spoken."""
    from matplotlib.text import Text
    from matplotlib.ticker import FixedLocator

    decimal_signs(figure)
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            labels = [tick.get_text() for tick in axis.get_ticklabels()]
            said = [label(name) for name in labels]
            if said != labels and isinstance(axis.get_major_locator(), FixedLocator):
                axis.set_ticklabels(said)
    for text in figure.findobj(Text):
        if isinstance(text, Text) and text.get_text():
            text.set_text(label(text.get_text()))


def _fit_legend(figure: Figure, axes: Axes) -> None:
    """A legend wider than its figure in fewer columns and with broken lines; the figure gets the height this adds."""
    legend = axes.get_legend()
    if legend is None:
        return
    legend.set_in_layout(False)
    figure.draw_without_rendering()
    box = legend.get_window_extent()
    # from where it begins to the right edge, should it stand above the axes
    room, columns = figure.bbox.width - max(box.x0, 0.0) - 2.0, int(getattr(legend, "_ncols", 1))
    if box.width > room and columns > 1:
        handles, _ = axes.get_legend_handles_labels()
        if len(handles) != len(legend.get_texts()):
            handles = [one for one in legend.legend_handles if one is not None]
        labels = [text.get_text() for text in legend.get_texts()]
    while columns > 1 and legend.get_window_extent().width > room:
        columns -= 1
        legend = axes.legend(
            handles, labels, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, borderaxespad=0.2
        )
        legend.set_in_layout(False)
        figure.draw_without_rendering()
    if legend.get_window_extent().width > room:
        for text in legend.get_texts():
            most = int(len(text.get_text()) * (room - 40.0) / max(text.get_window_extent().width, 1.0))
            text.set_text("\n".join(wrap(text.get_text(), max(most, 12))))
        figure.draw_without_rendering()
    more = legend.get_window_extent().height - box.height
    legend.set_in_layout(True)
    if more > 0.0:
        figure.set_figheight(figure.get_figheight() + more / figure.dpi)


def _fit(figure: Figure) -> None:
    """Titles longer than their axis are broken, legends fitted, and there is room for what stands between panels."""
    for axes in figure.axes:
        place = axes.get_subplotspec()
        share = 1.0 if place is None else place.get_position(figure).height
        letters = int(
            0.85 * share * figure.bbox.height / (0.55 * float(axes.yaxis.label.get_fontsize()) * figure.dpi / 72.0)
        )
        axes.set_ylabel("\n".join(wrap(axes.get_ylabel(), max(letters, 12), break_long_words=False)))
        _fit_legend(figure, axes)
    figure.draw_without_rendering()
    for axes in figure.axes:
        label, extent = axes.xaxis.label, axes.xaxis.label.get_window_extent()
        if extent.x1 > figure.bbox.width or extent.x0 < 0.0:
            most = int(len(label.get_text()) * axes.bbox.width / extent.width)
            label.set_text("\n".join(wrap(label.get_text(), max(most, 12), break_long_words=False)))
    # the layout says so when there is no room, by a warning of no class of its own
    for _ in range(4):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            figure.draw_without_rendering()
        if not any("collapsed" in str(one.message) for one in said):
            break
        figure.set_figheight(1.12 * figure.get_figheight())


def save_svg(figure: Figure, path: str | Path) -> None:
    """Write a figure as an SVG file of its own, black on white, the same bytes every time."""
    write_bytes(_svg(figure, paper="white").encode(), path)


def save_png(figure: Figure, path: str | Path, *, dpi: int = 150) -> None:
    """Write a figure as PNG, black on white, the same bytes every time with the same libraries."""
    with style():
        _translate(figure)
        _fit(figure)
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
