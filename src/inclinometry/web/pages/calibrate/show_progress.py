"""Positions taken and to take, and what the fit would certify now."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Final

import numpy as np
from nicegui import ui

from inclinometry.core.constants import COVERAGE_FACTOR
from inclinometry.report.digits import significant
from inclinometry.web.pages.calibrate.guided import Guided
from inclinometry.workflow.laboratory.session import Position

MANY: Final = 60
"""Positions beyond which the list is scrolled to the chosen one."""


class Progress:
    """The list of positions; a click puts one on the card. A button is changed only when its state is."""

    def __init__(self, guided: Guided, choose: Callable[[int], Awaitable[None]]) -> None:
        self._guided, self._choose = guided, choose
        self._buttons: dict[int, ui.html] = {}
        self._states: dict[int, tuple[str, str]] = {}
        self._here = 0
        with ui.card().classes("panel places"):
            self._title = ui.label().classes("subtitle number").props('data-testid="progress"')
            self._box = ui.element("div").classes("positions").props('role="group"')

    def show(self) -> None:
        """All positions as they are now."""
        guided, say = self._guided, self._guided.visitor.say
        done, total = len(guided.session.valid), len(guided.session.positions)
        planned = say("home.progress", done=done, all=total)
        self._title.set_text(say("bench.so_far", done=done) if guided.adaptive else planned)
        positions = {p.number: p for p in guided.positions}
        for number in [n for n in self._buttons if n not in positions]:
            self._buttons.pop(number).delete()
            self._states.pop(number)
        for position in positions.values():
            self._one(position)
        if len(positions) > MANY and self._here != guided.chosen.number:
            self._here = guided.chosen.number
            ui.run_javascript("benchHere()")

    def _one(self, position: Position) -> None:
        guided, say, number = self._guided, self._guided.visitor.say, position.number
        odd = {} if guided.now is None else guided.now.odd
        state = "odd" if number in odd else "done" if guided.session.has(number) else "open"
        if number == guided.proposed:
            state = "proposed"
        here = " here" if number == guided.chosen.number else ""
        angles = " / ".join(f"{np.degrees(x):.1f}°" for x in position.dial)
        heat = guided.target_temperature(number)
        angles += "" if heat is None else f", {heat:g} °C"
        shown = (f"place {state}{here}", angles)
        if self._states.get(number) == shown:
            return
        self._states[number] = shown
        if number not in self._buttons:
            with self._box:
                made = ui.html(str(number), tag="button", sanitize=False)
            made.on("click", lambda n=number: self._choose(n), [])
            self._buttons[number] = made
        button = self._buttons[number].classes(replace=shown[0])
        current = "true" if here else "false"
        label = f"{say(f'bench.state_{state}')} {number}: {angles}"
        button.props(f'type=button data-testid="position-{number}" aria-current="{current}"')
        button.props(f'aria-label="{label}" title="{label}" data-state="{state}"')


class Certifies:
    """What would be certified now, odd positions, the next best position, warnings; or how a verification stands."""

    def __init__(self, guided: Guided, choose: Callable[[int], Awaitable[None]], finish: Callable[[], object]) -> None:
        self._guided, self._choose = guided, choose
        say = guided.visitor.say
        with ui.card().classes("panel certifies"):
            title = "bench.verifying" if guided.verifies else "bench.certifies"
            ui.label(say(title)).classes("subtitle")
            self._box = ui.element("div").classes("found")
            text = say("bench.judge") if guided.verifies else say("bench.finish")
            self._end = ui.button(text, on_click=finish).props('no-caps data-testid="finish"').classes("finish")

    def show(self) -> None:
        """The running fit as it is now."""
        guided = self._guided
        self._box.clear()
        with self._box:
            self._goal()
            if guided.now is not None:
                self._odd()
                self._uncertainty()
                self._next_best()
        ready = (
            bool(guided.session.valid) if guided.verifies else guided.now is not None and bool(guided.now.calibration)
        )
        self._end.set_enabled(ready and not guided.session.closed)
        self._end.set_visibility(not guided.session.closed)
        ended = not guided.open_positions
        self._end.props("unelevated", remove="outline") if ended else self._end.props("outline", remove="unelevated")

    def _goal(self) -> None:
        """The one large sentence: closed, reached, or everything captured."""
        guided, say = self._guided, self._guided.visitor.say
        now = guided.now
        if guided.session.closed:
            text, colour = say(f"bench.closed_{guided.session.closed}"), "dim"
        elif now is not None and now.reached:
            text, colour = say("bench.reached"), "good"
        elif not guided.open_positions and not (now is not None and now.odd):
            text, colour = say("bench.complete"), "good"
        else:
            return
        ui.label(text).classes(f"word {colour}").props('data-testid="goal" role="status"')
        record = guided.ledger.latest("calibration", session=guided.session.id) if guided.session.closed else None
        if record is not None:
            ui.link(say("results.title"), f"/results/{record.id}")

    def _odd(self) -> None:
        guided, say = self._guided, self._guided.visitor.say
        for number, sentence in ({} if guided.now is None else guided.now.odd).items():
            with ui.element("div").classes("odd-row").props('role="alert"'):
                ui.label(sentence).classes("bad").props(f'data-testid="odd-{number}"')
                retake = ui.button(say("bench.retake", number=number), on_click=lambda n=number: self._choose(n))
                retake.props(f'outline dense no-caps data-testid="retake-{number}"')

    def _uncertainty(self) -> None:
        guided, say = self._guided, self._guided.visitor.say
        now = guided.now
        if now is None or now.calibration is None:
            ui.label(say("bench.no_fit") if now is None else guided.visitor.bench.told(now.waiting)).classes(
                "dim waiting"
            )
            return
        low, high = np.degrees(now.covered)
        with ui.element("div").classes("pair"):
            self._line("azimuth", now.u_azimuth, now.from_calibration[1], now.noise[1], guided.goal.u_azimuth)
            self._line(
                "inclination", now.u_inclination, now.from_calibration[0], now.noise[0], guided.goal.u_inclination
            )
        ui.label(say("bench.range", low=f"{low:.0f}", high=f"{high:.0f}", k=f"{COVERAGE_FACTOR:g}")).classes(
            "dim small number"
        )
        others = [w for w in now.calibration.warnings if w not in now.odd.values()]
        for sentence in others[:3]:
            ui.label(guided.visitor.bench.told(sentence)).classes("warn small")

    def _line(self, angle: str, value: float, alone: float, noise: float, wanted: float | None) -> None:
        """U of one reading as the certificate will print it; below, from the calibration alone, and what is wanted."""
        say, name, text = self._guided.visitor.say, f"U_{angle}", _degrees(value)
        colour = "" if wanted is None else "good" if value <= wanted else "warn"
        with ui.element("div").classes("uncertainty"):
            ui.label(say(f"bench.{name}")).classes("dim")
            ui.label(text).classes(f"value number {colour}").props(f'data-testid="{name.lower()}"')
            if np.isfinite(alone):
                ui.label(say("bench.alone", value=_degrees(alone))).classes("dim small number")
            if wanted is not None:
                ui.label(f"{say('bench.wanted')} {_degrees(wanted)}").classes("dim small number")
            if wanted is not None and noise > wanted:
                ui.label(say("bench.beyond", value=_degrees(noise))).classes("warn small").props('role="alert"')

    def _next_best(self) -> None:
        guided, say, number = self._guided, self._guided.visitor.say, self._guided.proposed
        if number is None or guided.session.closed:
            return
        gain = guided.gain()
        name = say(f"bench.U_{guided.goal.criterion}") if gain is not None else ""
        text = say("bench.proposed", number=number)
        if gain is not None:
            text += " · " + say("bench.gain", name=name, now=_degrees(gain[0]), then=_degrees(gain[1]))
        with ui.element("div").classes("odd-row"):
            ui.label(text).classes("number").props('data-testid="proposed"')
            if number != guided.chosen.number:
                ui.button(say("bench.take_it"), on_click=lambda: self._choose(number)).props("outline dense no-caps")


def _degrees(angle: float) -> str:
    """An angle to the digits of a certificate."""
    return f"{significant(float(np.degrees(angle)))}°" if np.isfinite(angle) else "–"
