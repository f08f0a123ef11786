"""The bench page of a session: one hand on the stand, one key to capture."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from fastapi import HTTPException, Request
from nicegui import run, ui
from nicegui.events import KeyEventArguments

from inclinometry.core.errors import InclinometryError
from inclinometry.store.ledger import LedgerError
from inclinometry.web.frame import frame
from inclinometry.web.pages.calibrate.guided import Guided
from inclinometry.web.pages.calibrate.show_live import PERIOD, Live, seen_now
from inclinometry.web.pages.calibrate.show_progress import Certifies, Progress
from inclinometry.web.pages.calibrate.show_target import Target

WATCH_S = 2.0
"""How often a page looks whether another browser has captured something."""


@ui.page("/calibrate/{session}")
async def bench_page(request: Request, session: str) -> None:
    """One session."""
    with frame(request, "bench.title", needs="capture") as visitor:
        try:
            guided = Guided(visitor, session)
        except LedgerError as error:
            raise HTTPException(404, str(error)) from None
        view = BenchView(guided)
    await view.refresh()


class BenchView:
    """The page's parts and what its keys and buttons do."""

    def __init__(self, guided: Guided) -> None:
        self.guided, self._busy = guided, False
        say = guided.visitor.say
        session = guided.session
        ui.label(f"{session.serial} · {session.plan} · {session.rig}").classes("number dim")
        with ui.element("div").classes("bench"):
            with ui.column().classes("left"):
                self._target = Target(guided)
                self._buttons()
            with ui.column().classes("right"):
                self._live = Live(guided)
                self._certifies = Certifies(guided, self._choose)
        self._progress = Progress(guided, self._choose)
        with ui.row():
            self._end = ui.button(say("bench.finish"), on_click=self._finish).props("outline no-caps")
            ui.button(say("bench.abandon"), on_click=self._ask_abandon).props("flat no-caps")
        ui.label(say("bench.keys")).classes("dim")
        self._keys: dict[str, Callable[[], Awaitable[None] | None]] = {
            " ": self._capture,
            "Enter": self._capture,
            "ArrowRight": lambda: self._step(1),
            "ArrowLeft": lambda: self._step(-1),
            "a": self._toggle,
            "n": self._next,
        }
        ui.keyboard(on_key=self._key, repeating=False)
        ui.timer(PERIOD, self._tick)
        ui.timer(WATCH_S, self._watch)

    def _buttons(self) -> None:
        say = self.guided.visitor.say
        with ui.row().classes("actions"):
            self._take = ui.button(say("bench.capture"), on_click=self._capture).props("unelevated no-caps size=lg")
            self._take.classes("capture")
            self._auto = ui.switch(say("bench.automatic"), on_change=self._automatic)
            ui.button(say("bench.next"), on_click=self._next).props("flat no-caps")

    async def refresh(self) -> None:
        """Judge what has been taken, then show everything."""
        await run.io_bound(self.guided.judge)
        self._show()

    def _show(self) -> None:
        self._target.show()
        self._progress.show()
        self._certifies.show()
        closed = bool(self.guided.session.closed)
        for part in (self._take, self._auto, self._end):
            part.set_enabled(not closed)
        self._end.set_enabled(not closed and self.guided.now is not None and self.guided.now.calibration is not None)

    async def _key(self, event: KeyEventArguments) -> None:
        do = self._keys.get(str(event.key)) or self._keys.get(str(event.key).lower())
        if do is None or not event.action.keydown or event.modifiers.ctrl or event.modifiers.alt:
            return
        found = do()
        if found is not None:
            await found

    def _choose(self, number: int) -> None:
        self._tried(lambda: self.guided.choose(number))
        self._show()

    def _step(self, by: int) -> None:
        self._tried(lambda: self.guided.step(by))
        self._show()

    def _next(self) -> None:
        self._tried(self.guided.choose_next)
        self._show()

    def _toggle(self) -> None:
        self._auto.set_value(not self._auto.value)

    def _automatic(self) -> None:
        self.guided.automatic = bool(self._auto.value)
        if self.guided.automatic and self.guided.rig is not None:
            self._next()

    async def _capture(self, how: str = "key") -> None:
        if self._busy:
            return
        self._busy = True
        try:
            number = self.guided.chosen.number
            await run.io_bound(self.guided.take, how)
            say = self.guided.visitor.say
            ui.notify(say("bench.taken", number=number), type="positive", timeout=1500, position="bottom")
            await run.io_bound(self.guided.judge)
            self.guided.choose_next()
        except InclinometryError as error:
            self.guided.reload()
            _say_problem(str(error))
        finally:
            self._busy = False
        self._show()

    async def _tick(self) -> None:
        seen = seen_now(self.guided.visitor.bench)
        self._live.show(seen)
        if seen is not None and not self._busy and self.guided.ready_by_itself(seen):
            await self._capture("automatic")

    async def _watch(self) -> None:
        mine = sum(self.guided.session.attempts.values())
        if not self._busy and await run.io_bound(lambda: self.guided.known) != mine:
            self.guided.reload()
            await self.refresh()

    async def _finish(self) -> None:
        try:
            record = await run.io_bound(self.guided.finish)
        except InclinometryError as error:
            _say_problem(str(error))
            return
        if record is not None:  # None when the server is being stopped
            ui.navigate.to(f"/results/{record.id}")

    def _ask_abandon(self) -> None:
        say = self.guided.visitor.say
        with ui.dialog() as dialog, ui.card().classes("panel"):
            ui.label(say("bench.abandon_ask"))
            reason = ui.input(say("bench.reason")).props("autofocus maxlength=2000")

            def go() -> None:
                if reason.value.strip() and self._tried(lambda: self.guided.abandon(reason.value.strip())):
                    ui.navigate.to("/")

            with ui.row():
                ui.button(say("bench.abandon"), on_click=go).props("outline no-caps")
                ui.button(say("bench.cancel"), on_click=dialog.close).props("flat no-caps")
        dialog.open()

    def _tried(self, do: Callable[[], None]) -> bool:
        try:
            do()
        except InclinometryError as error:
            _say_problem(str(error))
            return False
        return True


def _say_problem(sentence: str) -> None:
    ui.notify(sentence, type="negative", multi_line=True, timeout=0, close_button="OK", position="top")
