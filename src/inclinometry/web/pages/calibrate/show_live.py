"""The live panel: channels, scatter, drift and the verdict, ten times a second in one message."""

from __future__ import annotations

import time
from collections.abc import Mapping
from html import escape
from typing import Final

import numpy as np
from nicegui import ui

from inclinometry.core.arrays import Array
from inclinometry.web.bench import Bench
from inclinometry.web.pages.calibrate.guided import Guided
from inclinometry.workflow.laboratory.live import Stability

PERIOD: Final = 0.1
GOOD: Final = ("still",)
WAIT: Final = ("learning", "few")
_FRESH: Final = 0.08

_LAST: dict[int, tuple[float, Stability]] = {}


def seen_now(bench: Bench) -> Stability | None:
    """The verdict as of now, worked out once for all browsers that ask within a tenth of a second."""
    feed = bench.feed
    if feed is None:
        return None
    last, now = _LAST.get(id(feed)), time.monotonic()
    if last is None or now - last[0] > _FRESH:
        last = (now, feed.stability())
        _LAST.clear()
        _LAST[id(feed)] = last
    return last[1]


class Live:
    """The panel; `show` is called ten times a second."""

    def __init__(self, guided: Guided) -> None:
        self._guided, self._shown = guided, ""
        say = guided.visitor.say
        with ui.card().classes("panel live"):
            ui.label(say("bench.live")).classes("subtitle")
            self._table = ui.html("", sanitize=False).props('aria-live="off"')
        self.show(seen_now(guided.visitor.bench))

    def show(self, seen: Stability | None) -> None:
        """Send the panel, when something in it changed."""
        text = self._text(seen)
        if text != self._shown:
            self._shown = text
            self._table.set_content(text)

    def _text(self, seen: Stability | None) -> str:
        say = self._guided.visitor.say
        if seen is None:
            return f"<p class='dim'>{escape(say('home.no_instrument'))}</p>"
        colour = "good" if seen.word in GOOD else "warn" if seen.word in WAIT else "bad"
        # the sentence keeps its two lines when it gets shorter, so that nothing below it moves
        word = f"<p class='verdict {colour}'>{escape(say(f'live.{seen.word}'))}</p>"
        reason = f"<p class='reason dim'>{escape(seen.reason)}</p>"
        head = "".join(f"<th>{escape(say(f'live.{name}'))}</th>" for name in ("channel", "mean", "sd", "drift"))
        rows = "".join(_rows(seen.mean, seen.sd, seen.drift, self._units()))
        heat = "" if seen.temperature is None else f"<p class='number dim'>{seen.temperature:.1f} °C</p>"
        return f"{word}{reason}<table class='number'><tr>{head}</tr>{rows}</table>{heat}"

    def _units(self) -> Mapping[str, str]:
        feed = self._guided.feed
        return {} if feed is None else feed.protocol.units


def _rows(
    mean: Mapping[str, Array], sd: Mapping[str, Array], drift: Mapping[str, Array], units: Mapping[str, str]
) -> list[str]:
    rows = []
    for kind, values in mean.items():
        digits = _digits(sd.get(kind))
        for axis, value in enumerate(values):
            numbers = (value, sd[kind][axis], drift[kind][axis])
            cells = "".join(f"<td>{x:.{digits}f}</td>" for x in numbers)
            name = f"{kind[:5]} {'xyz'[axis] if axis < 3 else axis + 1}"
            rows.append(
                f"<tr><td>{escape(name)} <span class='dim'>{escape(units.get(kind, ''))}</span></td>{cells}</tr>"
            )
    return rows


def _digits(spread: Array | None) -> int:
    """Decimals at which the scatter shows two digits."""
    least = float(np.min(spread)) if spread is not None and len(spread) else 1.0
    return int(np.clip(1 - np.floor(np.log10(least)), 0, 6)) if least > 0.0 else 1
