"""The verdict and the live channels: ten times a second, one small message a browser, worked out once for all."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from typing import Final

import numpy as np
from nicegui import ui

from inclinometry.core.arrays import Array
from inclinometry.web.bench import Bench
from inclinometry.web.pages.calibrate.guided import Guided
from inclinometry.workflow.laboratory.live import LiveFeed, Stability

PERIOD: Final = 0.1
COLOUR: Final = {"still": "good", "learning": "warn", "few": "warn"}
"""Of a verdict; bad for the others."""
_FRESH: Final = 0.08
_DASH: Final = "–"


@dataclass
class _Shared:
    """What all browsers are told of a feed."""

    feed: LiveFeed
    when: float = float("-inf")
    seen: Stability | None = None
    cells: list[str] = field(default_factory=list)
    digits: dict[str, int] = field(default_factory=dict)

    def fresh(self) -> _Shared:
        """Worked out again, when it is older than most of a tenth of a second."""
        now = time.monotonic()
        if now - self.when > _FRESH:
            self.when, self.seen = now, self.feed.stability()
            self.cells = self._cells(self.seen)
        return self

    def _cells(self, seen: Stability) -> list[str]:
        found = []
        for kind, count in channel_counts(self.feed).items():
            columns = (seen.mean.get(kind), seen.sd.get(kind), seen.drift.get(kind))
            digits = self._decimals(kind, seen.floor.get(kind), seen.sd.get(kind))
            for axis in range(count):
                found += [_DASH if c is None or axis >= len(c) else f"{c[axis]:.{digits}f}" for c in columns]
        return found

    def _decimals(self, kind: str, floor: Array | None, spread: Array | None) -> int:
        """Decimals at which the noise shows two digits; kept while they nearly fit, so that no number hops about."""
        noise = floor if floor is not None else spread
        least = float(np.min(noise)) if noise is not None and len(noise) else 0.0
        wanted = int(np.clip(1 - np.floor(np.log10(least)), 0, 6)) if least > 0.0 else 1
        if abs(self.digits.get(kind, -9) - wanted) > 1:
            self.digits[kind] = wanted
        return self.digits[kind]


_SHARED: list[_Shared] = []


def _shared(bench: Bench) -> _Shared | None:
    if bench.feed is None:
        return None
    if not _SHARED or _SHARED[0].feed is not bench.feed:
        _SHARED[:] = [_Shared(bench.feed)]
    return _SHARED[0].fresh()


def channel_counts(feed: LiveFeed) -> dict[str, int]:
    """Kind -> sensors, as the protocol has them: the table has all its rows before the first sample."""
    return {kind: len(channel.fields) for kind, channel in feed.protocol.channels.items()}


class Live:
    """The verdict and the table; `show` is called ten times a second.

    The two parts stand in different places of the page: `verdict` and `table` make them.
    """

    def __init__(self, guided: Guided) -> None:
        self._guided = guided
        say, bench = guided.visitor.say, guided.visitor.bench
        self._words: Mapping[str, tuple[str, str]] = {
            word: (say(f"live.{word}"), say(f"live.do_{word}"))
            for word in ("still", "learning", "few", "moving", "drifting", "knocked", "faulty", "stale", "disconnected")
        }
        self._shared = _shared(bench)

    def verdict(self) -> None:
        """The strip beside the capture button."""
        say = self._guided.visitor.say
        lost = escape(say("live.lost"), quote=True)
        if self._guided.feed is None:
            text = f"<p class='word bad'>{escape(say('live.none'))}</p><p class='advice'>"
            text += f"{escape(say('home.no_instrument'))}</p>"
        else:
            text = (
                f"<p class='word' id='live-word' role='status' data-testid='verdict' data-lost=\"{lost}\">{_DASH}</p>"
                "<p class='advice' id='live-advice'></p>"
            )
        ui.html(text, sanitize=False).classes("verdict-strip")

    def table(self) -> None:
        """The channels; its numbers are put in by `show`."""
        feed, say = self._guided.feed, self._guided.visitor.say
        if feed is None:
            return
        head = "".join(f"<th scope='col'>{escape(say(f'live.{name}'))}</th>" for name in ("mean", "sd", "drift"))
        rows, cell = [], 0
        for kind, count in channel_counts(feed).items():
            unit = escape(feed.protocol.units.get(kind, ""))
            for axis in range(count):
                name = f"{say(f'live.{kind}')} {'XYZ'[axis] if axis < 3 else axis + 1}"
                cells = "".join(f"<td id='live-{cell + j}'>{_DASH}</td>" for j in range(3))
                cell += 3
                rows.append(f"<tr><th scope='row'>{escape(name)} <span class='dim'>{unit}</span></th>{cells}</tr>")
        with ui.card().classes("panel live"):
            table = f"<table class='number'><tr><th scope='col'>{escape(say('live.channel'))}</th>{head}</tr>"
            foot = "<p class='detail dim number'><span id='live-heat'></span><span id='live-detail'></span></p>"
            ui.html(f"{table}{''.join(rows)}</table>{foot}", sanitize=False).props('aria-live="off"')

    def show(self) -> Stability | None:
        """Send the numbers as they are now."""
        found = _shared(self._guided.visitor.bench)
        if found is None or found.seen is None:
            return None
        seen = found.seen
        word, advice = self._words[seen.word]
        heat = "" if seen.temperature is None else f"{seen.temperature:.1f} °C"
        said = [seen.word, COLOUR.get(seen.word, "bad"), word, advice, heat, seen.reason, *found.cells]
        ui.run_javascript(f"benchLive({json.dumps(said, ensure_ascii=False, separators=(',', ':'))})")
        return seen
