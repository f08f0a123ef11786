"""Positions taken and to take, and what the fit would certify now."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from nicegui import ui

from inclinometry.web.pages.calibrate.guided import Guided


class Progress:
    """The list of positions; a click puts one on the card."""

    def __init__(self, guided: Guided, choose: Callable[[int], None]) -> None:
        self._guided, self._choose = guided, choose
        with ui.card().classes("panel"):
            ui.label(guided.visitor.say("bench.positions")).classes("subtitle")
            self._box = ui.element("div").classes("positions").props('role="list"')
        self.show()

    def show(self) -> None:
        """All positions as they are now."""
        guided, say = self._guided, self._guided.visitor.say
        odd = {} if guided.now is None else guided.now.odd
        self._box.clear()
        with self._box:
            for position in guided.positions:
                number = position.number
                state = "odd" if number in odd else "done" if guided.session.has(number) else "open"
                button = ui.button(str(number), on_click=lambda n=number: self._choose(n))
                angles = " / ".join(f"{np.degrees(x):.1f}" for x in position.dial)
                button.props(f'flat dense no-caps aria-label="{say(f"bench.state_{state}")} {number}: {angles}"')
                button.classes(f"place {state}" + (" here" if number == guided.chosen.number else ""))
                button.tooltip(odd.get(number, angles))


class Certifies:
    """What would be certified now, odd positions, warnings."""

    def __init__(self, guided: Guided, choose: Callable[[int], None]) -> None:
        self._guided, self._choose = guided, choose
        with ui.card().classes("panel"):
            ui.label(guided.visitor.say("bench.certifies")).classes("subtitle")
            self._box = ui.column().classes("gap-1")
        self.show()

    def show(self) -> None:
        """The running fit as it is now."""
        guided, say = self._guided, self._guided.visitor.say
        now = guided.now
        self._box.clear()
        with self._box:
            if now is None or now.calibration is None:
                ui.label(say("bench.no_fit") if now is None else now.waiting).classes("dim")
                return
            low, high = np.degrees(guided.goal.inclination_range)
            ui.label(say("bench.range", low=f"{low:g}", high=f"{high:g}")).classes("dim number")
            self._line("U_azimuth", now.u_azimuth, guided.goal.u_azimuth)
            self._line("U_inclination", now.u_inclination, guided.goal.u_inclination)
            if now.reached:
                ui.label(say("bench.reached")).classes("good")
            if guided.place is not None:
                ui.label(say("bench.proposed", number=guided.positions[-1].number)).classes("number")
            for number, sentence in now.odd.items():
                with ui.row().classes("odd-row"):
                    ui.label(sentence).classes("bad")
                    ui.button(say("bench.retake", number=number), on_click=lambda n=number: self._choose(n)).props(
                        "outline dense no-caps"
                    )
            others = [w for w in now.calibration.warnings if w not in now.odd.values()]
            for sentence in others[:4]:
                ui.label(sentence).classes("warn")

    def _line(self, name: str, value: float, wanted: float | None) -> None:
        say = self._guided.visitor.say
        if not np.isfinite(value):
            return
        text = f"{say(f'bench.{name}')} {np.degrees(value):.3f}°"
        if wanted is not None:
            text += f"  ({say('bench.wanted')} {np.degrees(wanted):.3f}°)"
        colour = "" if wanted is None else "good" if value <= wanted else "warn"
        ui.label(text).classes(f"uncertainty number {colour}")
