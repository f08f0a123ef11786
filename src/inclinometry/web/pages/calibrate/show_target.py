"""The large card: where to turn the tool to, as numbers to be read from two metres, and as a picture."""

from __future__ import annotations

from html import escape

import numpy as np
from nicegui import ui

from inclinometry.web.pages.calibrate.guided import Guided
from inclinometry.web.pages.calibrate.picture import drawing
from inclinometry.workflow.laboratory.session import setting_of

DIALS = ("azimuth", "inclination", "toolface")


def big(angle: float) -> str:
    """An angle for the card, in degrees: the whole number large, what follows it smaller.

    Examples
    --------
    >>> big(np.pi / 2)
    "90<span class='rest'>.00°</span>"
    >>> big(-1e-9)
    "0<span class='rest'>.00°</span>"
    """
    whole, _, rest = f"{round(float(np.degrees(angle)), 2) + 0.0:.2f}".partition(".")
    return f"{whole.replace('-', '−')}<span class='rest'>.{rest}°</span>"


class Target:
    """Numbers of the chosen position; call within its card."""

    def __init__(self, guided: Guided) -> None:
        self._guided, self._shown = guided, ""
        say = guided.visitor.say
        with ui.element("div").classes("headline"):
            self._name = ui.label().classes("subtitle number").props('data-testid="position-name"')
            self._state = ui.label().props('data-testid="position-state"')
            self._leave = ui.button(say("bench.leave_out")).props('flat dense no-caps data-testid="reject"')
        self._dials = ui.html("", sanitize=False).classes("dials").props('data-testid="target"')
        self._heat = ui.label().classes("heat number").props('data-testid="heat"')
        self._heat.set_visibility(guided.target_temperature(1) is not None)

    @property
    def leave(self) -> ui.button:
        """Leaves the reading of the chosen position out."""
        return self._leave

    def show(self) -> None:
        """The chosen position as it is now."""
        guided, say = self._guided, self._guided.visitor.say
        chosen, taken = guided.chosen, guided.session.taken.get(guided.chosen.number)
        total = len(guided.session.positions)
        name = say("bench.added", number=chosen.number) if chosen.number > total or guided.adaptive else ""
        self._name.set_text(name or say("bench.position", number=chosen.number, all=total))
        text, colour = say("bench.to_capture"), "dim"
        if taken is not None and taken.rejected:
            text, colour = say("bench.was_rejected", attempt=taken.attempt, reason=taken.rejected[:80]), "warn"
        elif taken is not None:
            text, colour = say("bench.was_captured", attempt=taken.attempt, time=taken.created[11:16]), "good"
        self._state.set_text(text)
        self._state.classes(replace=f"state number {colour}")
        self._leave.set_visibility(guided.session.has(chosen.number) and not guided.session.closed)
        dials = zip(DIALS, chosen.dial, strict=True)
        cells = [
            f"<div class='dial'><span class='dim'>{escape(say(f'bench.{name}'))}</span>"
            f"<span class='digits number' data-testid='target-{name}'>{big(angle)}</span></div>"
            for name, angle in dials
        ]
        if "".join(cells) != self._shown:
            self._shown = "".join(cells)
            self._dials.set_content(self._shown)
        self.show_heat()

    def show_heat(self) -> None:
        """The target temperature beside the measured one; looked at every second."""
        guided, say = self._guided, self._guided.visitor.say
        target = guided.target_temperature(guided.chosen.number)
        if target is None:
            return
        heat, text, colour = guided.heat(), say("bench.heat_target", target=f"{target:g}"), "warn"
        if heat is None:
            text += " · " + say("bench.heat_unknown")
        else:
            rate = "–" if np.isnan(heat.rate) else f"{round(heat.rate, 1) + 0.0:+.1f}"
            word = "even" if heat.even and heat.near else "uneven" if heat.near else "far"
            measured = say("bench.heat_measured", measured=f"{heat.measured:.1f}", rate=rate)
            text, colour = f"{text} · {measured} · {say(f'bench.heat_{word}')}", "good" if word == "even" else "warn"
        self._heat.set_text(text)
        self._heat.classes(replace=f"heat number {colour}")


class Picture:
    """The tool in the stand at the chosen position."""

    def __init__(self, guided: Guided) -> None:
        self._guided, self._shown = guided, ""
        say = guided.visitor.say
        with ui.card().classes("panel picture"):
            self._html = ui.html("", sanitize=False).props('data-testid="picture"')
            ui.label(say("bench.picture_key")).classes("dim small")

    def show(self) -> None:
        """Drawn again when the position has changed."""
        say, session = self._guided.visitor.say, self._guided.session
        dial = setting_of(session.dials, self._guided.chosen.dial)
        words = (escape(say("bench.north")), escape(say("bench.down")))
        text = drawing(dial, escape(say("bench.picture"), quote=True), words)
        if text != self._shown:
            self._shown = text
            self._html.set_content(text)
