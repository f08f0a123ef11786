"""What happened to the instrument lately: lost lines, gaps, reconnections, in a list that keeps its height."""

from __future__ import annotations

from datetime import UTC, datetime
from html import escape
from typing import Final

from nicegui import ui

from inclinometry.io.instrument.sample import InstrumentEvent
from inclinometry.web.pages.calibrate.guided import Guided

SHOWN: Final = 5


def folded(events: tuple[InstrumentEvent, ...], most: int = SHOWN) -> list[tuple[InstrumentEvent, int]]:
    """The newest events, newest first, with how often each kind came in a row.

    Examples
    --------
    >>> bad = InstrumentEvent(1.0, "garbage", "no")
    >>> [(e.kind, n) for e, n in folded((bad, bad, InstrumentEvent(2.0, "connected", "yes")))]
    [('connected', 1), ('garbage', 2)]
    """
    found: list[tuple[InstrumentEvent, int]] = []
    for event in reversed(events):
        if found and found[-1][0].kind == event.kind:
            found[-1] = (found[-1][0], found[-1][1] + 1)
        elif len(found) == most:
            break
        else:
            found.append((event, 1))
    return found


class Events:
    """The list; `show` is called once a second and sends nothing when nothing happened."""

    def __init__(self, guided: Guided) -> None:
        self._guided, self._shown = guided, ""
        with ui.card().classes("panel events"):
            ui.label(guided.visitor.say("bench.events")).classes("subtitle")
            self._html = ui.html("", sanitize=False).props('data-testid="events" aria-live="off"')
        self.show()

    def show(self) -> None:
        """The newest events as they are now."""
        feed, say = self._guided.feed, self._guided.visitor.say
        lines = []
        for event, times in folded(() if feed is None else feed.events):
            clock = datetime.fromtimestamp(event.time, UTC).strftime("%H:%M:%S")
            often = f" ×{times}" if times > 1 else ""
            lines.append(f"<li data-kind='{escape(event.kind)}'>{clock} {escape(event.sentence)}{often}</li>")
        text = (
            f"<ul class='number'>{''.join(lines)}</ul>" if lines else f"<p class='dim'>{escape(say('bench.quiet'))}</p>"
        )
        if text != self._shown:
            self._shown = text
            self._html.set_content(text)
