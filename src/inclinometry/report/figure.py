"""One style for every drawing, without any global state of matplotlib left behind.

Text and axes are drawn in a sentinel colour that becomes `currentColor` on the page, series in colours that become CSS
variables, so one SVG serves light and dark. Colours: Okabe and Ito's palette, safe for colour-blind readers; series
also differ in marker or dash.
"""

from __future__ import annotations

import csv
import io
import re
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any, NamedTuple, ParamSpec, TypeVar
from urllib.parse import quote
from weakref import WeakKeyDictionary

import numpy as np

from inclinometry.arrays import Array
from inclinometry.files.writing import write_bytes
from inclinometry.report.language import translated

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


PIXELS = 13.0 / 10.5
"""Pixels of a page for a point of a figure: every figure is shown at its own size, its text 13 pixels high."""


def new_figure(height: float, *, width: float = 4.12) -> Figure:
    """An empty figure, in; the object-oriented interface needs no pyplot and leaves nothing open.

    Three of the default width stand in a row of a page, one fills the screen of a telephone.
    """
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height))


_STATIONS: WeakKeyDictionary[Axes, list[str]] = WeakKeyDictionary()
"""Names of the stations that an x axis counts."""


_CELLS: WeakKeyDictionary[Axes, tuple[str, Array]] = WeakKeyDictionary()
"""What a matrix that is drawn cell by cell holds, and its values."""


def matrix_axes(axes: Axes, names: list[str], matrix: Array, meaning: str) -> None:
    """Name rows and columns of a square matrix drawn from the top left; its values go into the CSV, under `meaning`."""
    _STATIONS[axes], _CELLS[axes] = names, (meaning, matrix)
    axes.set_xlim(-0.5, len(names) - 0.5)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_aspect("equal")
    axes.set_xticks(range(len(names)), names, rotation=90, fontsize=8.5)
    axes.set_yticks(range(len(names)), names, fontsize=8.5)


def station_axis(axes: Axes, names: list[str], most: int = 12) -> None:
    """Label the x axis with station names, at most so many, long ones cut."""
    _STATIONS[axes] = names
    step = -(-len(names) // most)
    places = list(range(0, len(names), step))
    labels = [names[i] if len(names[i]) <= 9 else names[i][:8] + "…" for i in places]
    turned = max((len(label) for label in labels), default=0) > 3
    axes.set_xticks(places, labels, rotation=90 if turned else 0)
    axes.set_xlim(-0.7, len(names) - 0.3)
    axes.set_xlabel("station")


class Drawn(NamedTuple):
    """A figure for a page: its SVG, its width in pixels, the points drawn as CSV and where each stands in the SVG."""

    svg: Markup
    width: int
    csv: str
    places: str


def inline_svg(figure: Figure, name: str, description: str) -> Drawn:
    """A figure for a page: no prologue, unique ids, colours of the page, a description for those who do not see it.

    Its texts are put into the language that is spoken.

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

    with style():
        _translate(figure)
        _fit(figure)
    # text of the figure may hold anything: only tags are touched
    body = re.sub(r"<[^>]*>", tag, _svg(figure))
    body = re.sub(r'^<svg ([^>]*?)width="[^"]*"', r"<svg \1", body)
    body = re.sub(r'^<svg ([^>]*?)height="[^"]*"', r"<svg \1", body)
    svg = Markup(body.replace("<svg ", f'<svg role="img" aria-label="{escape(description)}" ', 1))
    table, places = _data(figure)
    return Drawn(svg, round(72.0 * PIXELS * figure.get_figwidth()), table, places)


def _translate(figure: Figure) -> None:
    """Every text of a figure, and the names on its axes, in the language that is spoken."""
    from matplotlib.text import Text
    from matplotlib.ticker import FixedLocator

    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            labels = [label.get_text() for label in axis.get_ticklabels()]
            said = [translated(label) for label in labels]
            if said != labels and isinstance(axis.get_major_locator(), FixedLocator):
                axis.set_ticklabels(said)
    for text in figure.findobj(Text):
        if isinstance(text, Text) and text.get_text():
            text.set_text(translated(text.get_text()))


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
    # the layout says so when there is no room
    for _ in range(4):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            figure.draw_without_rendering()
        if not any("collapsed" in str(one.message) for one in said):
            break
        figure.set_figheight(1.12 * figure.get_figheight())


class _Series(NamedTuple):
    """Points of one line, bar or map of a figure; `extra` the bar of each point, or the value a map shows there."""

    name: str
    axes: Axes
    x: Array
    y: Array
    extra: Array | None


def _series(figure: Figure) -> Iterator[_Series]:
    """What a figure draws from data; lines that only mark a level or a limit span the axes and are left out."""
    from matplotlib.collections import PathCollection, QuadMesh
    from matplotlib.container import BarContainer, ErrorbarContainer

    for axes in (one for one in figure.axes if one.get_label() != "<colorbar>"):
        bars: dict[int, tuple[str, Array | None]] = {}
        for held in axes.containers:
            if isinstance(held, ErrorbarContainer) and held[0] is not None:
                half = None
                if held[2]:
                    ends = np.array([part for part in held[2][-1].get_segments() if len(part) == 2])
                    half = 0.5 * np.abs(ends[:, 1] - ends[:, 0]).max(axis=1) if len(ends) else None
                bars[id(held[0])] = str(held.get_label() or ""), half
            elif isinstance(held, BarContainer):
                boxes = [(box.get_width(), box.get_y() + 0.5 * box.get_height()) for box in held]
                yield _Series(
                    str(held.get_label() or ""),
                    axes,
                    np.array([x for x, _ in boxes]),
                    np.array([y for _, y in boxes]),
                    None,
                )
        for line in axes.get_lines():
            x, y = (np.asarray(values, dtype=float) for values in line.get_data())
            if line.get_transform() == axes.transData and len(x) == len(y):
                name, half = bars.get(id(line), (str(line.get_label()), None))
                yield _Series(name, axes, x, y, half if half is not None and len(half) == len(x) else None)
        if axes in _CELLS:
            _, matrix = _CELLS[axes]
            row, column = (np.asarray(place, dtype=np.float64).ravel() for place in np.indices(matrix.shape))
            yield _Series("", axes, column, row, matrix.ravel())
        for found in axes.collections:
            values = found.get_array()
            if isinstance(found, PathCollection):
                places = np.asarray(found.get_offsets())
                yield _Series("", axes, places[:, 0], places[:, 1], None if values is None else np.asarray(values))
            elif isinstance(found, QuadMesh) and values is not None:
                corners = np.asarray(found.get_coordinates())
                middle = 0.25 * (corners[1:, 1:] + corners[1:, :-1] + corners[:-1, 1:] + corners[:-1, :-1])
                shown = np.ma.filled(values, np.nan).ravel()
                yield _Series("", axes, middle[..., 0].ravel(), middle[..., 1].ravel(), shown)


MOST_POINTS = 4000
"""Points of a figure that show their value under the pointer."""


def _data(figure: Figure) -> tuple[str, str]:
    """The points of a figure as CSV, and the place of each in the SVG, in tenths of its unit, in the same order."""
    every = [one for one in _series(figure) if np.isfinite(one.x * one.y).any()]
    if not every:
        return "", ""
    titles = {
        id(one.axes): tuple(" ".join(t.split()) for t in (one.axes.get_xlabel(), one.axes.get_ylabel()))
        for one in every
    }
    across = next((x for x, _ in titles.values() if x), "x")
    up = next(iter(titles.values()))[1] if len({y for _, y in titles.values()}) == 1 else ""
    stream, places = io.StringIO(), []
    table = csv.writer(stream, lineterminator="\n")
    extra = any(one.extra is not None for one in every)
    scales = (bar.get_ylabel() or bar.get_xlabel() for bar in figure.axes if bar.get_label() == "<colorbar>")
    cells = (translated(_CELLS[one][0]) for one in figure.axes if one in _CELLS)
    meaning = next(scales, next(cells, "±"))
    table.writerow([translated("series"), across, up or translated("value"), *([meaning] if extra else [])])
    tall = figure.get_figheight() * 72.0
    for one in every:
        label = "" if one.name.startswith("_") else one.name
        title = titles[id(one.axes)][1]
        name = label if up else ": ".join(text for text in (title, label) if text)
        stations = _STATIONS.get(one.axes)
        rows = [text.get_text() for text in one.axes.get_yticklabels()] if _named_rows(one) else None
        good = np.isfinite(one.x) & np.isfinite(one.y)
        at = np.asarray(one.axes.transData.transform(np.column_stack([one.x, one.y]))) * 72.0 / figure.dpi
        for k in np.flatnonzero(good).tolist():
            x, y = f"{one.x[k]:.7g}", f"{one.y[k]:.7g}"
            if stations is not None and 0 <= round(one.x[k]) < len(stations):
                x = stations[round(one.x[k])]
            if rows is not None and 0 <= round(one.y[k]) < len(rows):
                y = rows[round(one.y[k])]
            held = [] if not extra else [""] if one.extra is None else [f"{one.extra[k]:.4g}"]
            table.writerow([name, x, y, *held])
            places.append(f"{round(10 * at[k, 0])},{round(10 * (tall - at[k, 1]))}")
    link = "data:text/csv;charset=utf-8," + quote(stream.getvalue(), safe=",.:;/()+-_°", errors="replace")
    return link, " ".join(places) if len(places) <= MOST_POINTS else ""


def _named_rows(one: _Series) -> bool:
    """Whether the y axis names rows instead of measuring."""
    return any(text.get_text()[:1].isalpha() for text in one.axes.get_yticklabels())


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
