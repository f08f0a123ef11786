"""The bench page of a session: one hand on the stand, one key to capture.

For tests and assistive programs, `data-testid` names what does not depend on the language:

- `capture` the main button; its `data-state` is "capture", "turn" (a motorised rig stands elsewhere: a press turns it),
  "moving" or "closed"; `automatic` the switch; `next` the next open position; `reject` leaves the shown reading out;
- `verdict` the word on the stillness, its `data-state` is the word of `Stability`, "turn" of a tool that is still and
  not turned to its target yet, "far" of one captured far from it, or "lost";
- `target-azimuth`, `target-inclination`, `target-toolface` the large angles; `position-name`, `position-state`, `heat`;
- `position-N` the button of a position, its `data-state` open, done, outlier or proposed; `progress`;
- `u_azimuth`, `u_inclination` what would be certified now; `goal` the large sentence when the end is reached;
  `outlier-N` the sentence on an outlier, `retake-N` its button; `proposed` the next best position;
- `finish`, `abandon`; `rig` the state of the rig, `events` the log of the instrument, `picture` the drawing;
- `now-azimuth`, `now-inclination`, `now-toolface` the angles of the tool as it stands, `judged-by` the calibration that
  gives them; `strip` the last minute; `sound` and `large` switch the sound of a capture and the large display;
- in the dialogs `reason`, `confirm`, `cancel`.

Keys: space or Enter captures (when no button has the focus), arrows choose, N goes to the next open position, T turns a
motorised rig, A switches automatic capture, F the large display.
"""

from __future__ import annotations

import time
from collections.abc import Awaitable, Callable
from typing import Any

from fastapi import Request
from nicegui import ui
from nicegui.events import GenericEventArguments

from inclinometry.errors import InclinometryError
from inclinometry.laboratory.attitude import FarError
from inclinometry.laboratory.ledger.ledger import ConflictError
from inclinometry.laboratory.live import CaptureError
from inclinometry.laboratory.web.frame import aside, frame
from inclinometry.laboratory.web.pages.calibrate.guided import Guided, RigState
from inclinometry.laboratory.web.pages.calibrate.show_progress import (
    Certifies,
    Events,
    Live,
    Picture,
    PositionList,
    Strip,
    Target,
    far_words,
)
from inclinometry.laboratory.web.pages.calibrate.start import ask_reason, ask_sure, say_problem
from inclinometry.laboratory.web.pages.lists import plan_words


@ui.page("/calibrate/{session}", response_timeout=30.0)  # a rig may take its time to answer
async def bench_page(request: Request, session: str) -> None:
    """One session."""
    with frame(request, "bench.title", needs="capture") as visitor:
        ui.add_head_html('<script src="/static/bench.js" defer></script>')
        guided = Guided(visitor, session)
        view = BenchView(guided)
    await view.begin()


class BenchView:
    """The page's parts and what its keys and buttons do."""

    def __init__(self, guided: Guided) -> None:
        self.guided, self._busy, self._ended = guided, False, float("-inf")
        say, session = guided.visitor.say, guided.session
        about = f"{session.serial} · {plan_words(guided.visitor, session.plan)} · {session.rig}"
        with ui.row().classes("about"):
            ui.label(about).classes("number dim").props('data-testid="about"')
            for name, icon in (("sound", "volume_up"), ("large", "fullscreen")):
                button = ui.button(icon=icon).props(f'flat dense data-testid="{name}" id=bench-{name}')
                button.props(f'aria-label="{say(f"bench.{name}")}" title="{say(f"bench.{name}")}"')
                button.on("click", js_handler=f"() => bench{name.capitalize()}()")
        self._rig_shown: RigState | None = None
        self._problem: ui.notification | None = None
        live = Live(guided)
        self._live = live
        with ui.element("div").classes("bench"):
            with ui.element("div").classes("left"):
                with ui.card().classes("panel target"):
                    self._target = Target(guided)
                    live.verdict()
                    self._buttons()
                live.table()
                self._strip = Strip(guided)
            with ui.element("div").classes("right"):
                self._picture = Picture(guided)
                self._certifies = Certifies(guided, self._choose, self._finish)
        self._progress = PositionList(guided, self._choose)
        self._events = Events(guided)
        with ui.row().classes("end"):
            ui.label(say("bench.keys")).classes("dim small")
            ui.space()
            self._stop = ui.button(say("bench.abandon"), on_click=self._ask_abandon)
            self._stop.props('flat no-caps data-testid="abandon"')
        self._target.leave.on_click(self._ask_leave_out)
        self._keys: dict[str, Callable[[], Awaitable[None] | None]] = {
            "capture": self._press,
            "forward": lambda: self._move(lambda: guided.step(1)),
            "back": lambda: self._move(lambda: guided.step(-1)),
            "automatic": self._toggle,
            "next": self._next,
            "turn": self._turn,
        }
        ui.on("bench_key", self._key)
        ui.timer(0.1, self._tick)
        # how often a page looks whether another browser has captured something
        ui.timer(1.0, self._watch)
        if guided.turner is not None:
            ui.timer(0.4, self._ask_rig)

    def _buttons(self) -> None:
        say, motorised = self.guided.visitor.say, self.guided.turner is not None
        with ui.element("div").classes("actions"):
            self._take = ui.button(say("bench.capture"), on_click=self._press)
            self._take.props('unelevated no-caps size=lg data-testid="capture" data-state="capture"').classes("capture")
            self._auto = ui.switch(say("bench.automatic"), on_change=self._automatic)
            self._auto.props('data-testid="automatic"')
            ui.button(say("bench.next"), on_click=self._next).props('flat no-caps data-testid="next"')
            self._rig = ui.label("").classes("rig number").props('data-testid="rig" role="status"')
            self._rig.set_visibility(motorised)

    async def begin(self) -> None:
        """Show everything, then judge what has been taken: the fit must not keep the page waiting."""
        await self._ask_rig()
        self._show()
        ui.timer(0.01, self._first, once=True)

    async def _first(self) -> None:
        await self.refresh()
        if self.guided.session.has(self.guided.chosen.number) and self.guided.open_positions:
            self.guided.follow()
            self._show()

    async def refresh(self) -> None:
        """Judge what has been taken, then show everything."""
        await aside(self.guided.judge)
        self._show()

    def _show(self) -> None:
        for part in (self._target, self._picture, self._progress, self._certifies):
            part.show()
        self._show_rig()

    def _show_rig(self) -> None:
        """What the main button does now."""
        guided, say = self.guided, self.guided.visitor.say
        rig, state, text = guided.rig_state, "capture", say("bench.capture")
        self._rig_shown = rig
        if guided.session.has(guided.chosen.number):
            text = say("bench.capture_again")
        if guided.session.closed:
            state = "closed"
        elif rig is not None and rig.word == "moving":
            state, text = "moving", say("bench.turning")
        elif rig is not None and not rig.at(guided.chosen.dial):
            state, text = "turn", say("bench.turn")
        self._take.set_text(text)
        self._take.props(f'data-state="{state}"')
        self._take.set_enabled(state in ("capture", "turn"))
        # when all is captured the next thing to do is to finish
        left = bool(guided.open_positions)
        self._take.props("unelevated" if left else "outline", remove="outline" if left else "unelevated")
        closed = bool(guided.session.closed)
        self._auto.set_enabled(not closed)
        self._stop.set_enabled(not closed)
        self._rig.set_visibility(rig is not None and not closed)
        # replaced classes would lose what hides it
        if rig is not None and not closed:
            there = rig.word == "ready" and not rig.at(guided.chosen.dial)
            word = "elsewhere" if there else rig.word
            shown = say(f"bench.rig_{word}", number=guided.chosen.number)
            self._rig.set_text(shown if rig.reason is None else guided.visitor.sentence(rig.reason))
            self._rig.classes(
                replace=f"rig number {'good' if word == 'ready' else 'warn' if word != 'lost' else 'bad'}"
            )

    async def _key(self, event: GenericEventArguments) -> None:
        do = self._keys.get(str(event.args[0] if isinstance(event.args, list) else event.args))
        found = None if do is None else do()
        if found is not None:
            await found

    def _toggle(self) -> None:
        self._auto.set_value(not self._auto.value)

    async def _choose(self, number: int) -> None:
        await self._move(lambda: self.guided.choose(number))

    async def _next(self) -> None:
        await self._move(self.guided.choose_next)

    async def _move(self, choose: Callable[[], Any]) -> None:
        """Put another position on the card; in automatic work a motorised rig goes there at once."""
        if self._busy:
            return
        before = self.guided.chosen.number
        choose()
        if self.guided.automatic and self.guided.chosen.number != before:
            await self._turn()
        self._show()

    async def _turn(self) -> None:
        if self.guided.turner is not None and not self.guided.session.closed:
            await self._tried(self.guided.turn)
            self._show_rig()

    async def _automatic(self) -> None:
        guided = self.guided
        guided.automatic = bool(self._auto.value)
        if guided.automatic and guided.turner is not None and not guided.turner.state.at(guided.chosen.dial):
            await self._turn()

    async def _press(self) -> None:
        """The main button: capture, or turn a rig that stands elsewhere."""
        rig = self.guided.rig_state
        if rig is not None and rig.word == "ready" and not rig.at(self.guided.chosen.dial):
            await self._turn()
        elif rig is None or rig.word != "moving":
            await self._capture("key")

    async def _capture(self, how: str, reason: str = "") -> None:
        guided, say = self.guided, self.guided.visitor.say
        # a second press this soon after a capture is a slip of the finger
        slip = not reason and time.monotonic() - self._ended < 0.7
        if self._busy or guided.session.closed or slip:
            return
        self._busy = True
        try:
            number = guided.chosen.number
            if await self._tried(lambda: guided.take(how, reason), by_itself=how == "automatic"):
                ui.notify(say("bench.taken", number=number), type="positive", timeout=1500, position="bottom")
                ui.run_javascript("benchBeep()")
                self._progress.show()
                await aside(guided.judge)
                if guided.choose_next() and guided.turner is not None:
                    await self._tried(guided.turn)
        finally:
            self._busy, self._ended = False, time.monotonic()
        self._show()

    async def _tick(self) -> None:
        seen = self._live.show()
        if seen is not None and not self._busy and self.guided.ready_by_itself(seen):
            await self._capture("automatic")

    async def _watch(self) -> None:
        self._events.show()
        self._strip.show()
        self._target.show_heat()
        if not self._busy and await aside(self.guided.news) and not self._busy:
            await self.refresh()

    async def _ask_rig(self) -> None:
        guided = self.guided
        if guided.turner is not None:
            await aside(guided.turner.poll)
            # another page may have asked before this one: what counts is what is shown here
            if guided.rig_state != self._rig_shown:
                self._show_rig()

    async def _finish(self) -> None:
        guided = self.guided
        left, outliers = len(guided.open_positions), {} if guided.now is None else guided.now.outliers
        if left or outliers:
            question = "bench.finish_outliers" if outliers else "bench.finish_open"
            numbers = ", ".join(str(number) for number in outliers)
            ask_sure(guided.visitor, question, "bench.finish_anyway", self._end, number=left, numbers=numbers)
        else:
            await self._end()

    async def _end(self) -> None:
        """What is captured is enough: to the judgement of a verification, to the result of a calibration."""
        if self.guided.verifies:
            ui.navigate.to(f"/verify/{self.guided.session.id}/finish")
            return
        try:
            record = await aside(self.guided.finish)
        except InclinometryError as error:
            self._complain(error)
            return
        ui.navigate.to(f"/results/{record.id}")

    def _ask_abandon(self) -> None:
        async def go(reason: str) -> None:
            if await self._tried(lambda: self.guided.abandon(reason)):
                ui.navigate.to("/")

        ask_reason(self.guided.visitor, "bench.abandon_ask", "bench.abandon", go)

    def _ask_leave_out(self) -> None:
        number = self.guided.chosen.number

        async def go(reason: str) -> None:
            if await self._tried(lambda: self.guided.leave_out(number, reason)):
                await self.refresh()

        ask_reason(self.guided.visitor, "bench.leave_out_ask", "bench.leave_out", go, number=number)

    def _ask_far(self) -> None:
        """Why the tool is captured far from the target."""
        guided, seen = self.guided, self._live.show()
        off = None if seen is None else guided.off_now(seen)
        where = "" if off is None else far_words(guided.visitor, off)

        async def go(reason: str) -> None:
            await self._capture("key", reason)

        question = "bench.far_ask_verify" if guided.verifies else "bench.far_ask"
        ask_reason(guided.visitor, question, "bench.far_take", go, where=where)

    def _complain(self, error: InclinometryError) -> None:
        """Say what went wrong, instead of what was said before."""
        self._settle()
        self._problem = say_problem(self.guided.visitor.problem(error))

    def _settle(self) -> None:
        """What was said is out of date."""
        if self._problem is not None:
            self._problem.dismiss()
            self._problem = None

    async def _tried(self, do: Callable[[], Any], *, by_itself: bool = False) -> bool:
        """Do something that may take its time; what goes wrong is said, and ends automatic work."""
        try:
            await aside(do)
        except FarError:
            if not by_itself:
                self._settle()
                self._ask_far()
            return False
        except CaptureError as error:
            if not by_itself:  # the tool has just begun to move: it will be still again
                self._complain(error)
            return False
        except InclinometryError as error:
            self._complain(error)
            self._auto.set_value(False)
            if isinstance(error, ConflictError):
                self.guided.reload()
            return False
        self._settle()
        return True
