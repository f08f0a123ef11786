"""Small dialogs of the bench page, and how it says what went wrong."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

from nicegui import ui

from inclinometry.web.frame import Visitor


def say_problem(sentence: str) -> ui.notification:
    """A sentence that stays until it is put away."""
    return ui.notification(sentence, type="negative", multi_line=True, timeout=None, close_button="OK", position="top")


def ask_reason(
    visitor: Visitor, question: str, action: str, go: Callable[[str], Awaitable[None]], **values: Any
) -> None:
    """Ask for a reason in words; nothing is done without one."""
    say = visitor.say
    with ui.dialog() as dialog, ui.card().classes("panel"):
        ui.label(say(question, **values))
        reason = ui.input(say("bench.reason")).props('autofocus maxlength=2000 data-testid="reason"').classes("wide")

        async def sure() -> None:
            if str(reason.value).strip():
                dialog.close()
                await go(str(reason.value).strip())

        reason.on("keydown.enter", sure)
        with ui.row():
            ui.button(say(action), on_click=sure).props('outline no-caps data-testid="confirm"')
            ui.button(say("bench.cancel"), on_click=dialog.close).props('flat no-caps data-testid="cancel"')
    dialog.on("hide", dialog.delete)
    dialog.open()


def ask_sure(visitor: Visitor, question: str, action: str, go: Callable[[], Awaitable[None]], **values: Any) -> None:
    """Ask once more before something that is not meant to happen by a slip."""
    say = visitor.say
    with ui.dialog() as dialog, ui.card().classes("panel"):
        ui.label(say(question, **values))

        async def sure() -> None:
            dialog.close()
            await go()

        with ui.row():
            ui.button(say(action), on_click=sure).props('outline no-caps data-testid="confirm"')
            ui.button(say("bench.cancel"), on_click=dialog.close).props('flat no-caps autofocus data-testid="cancel"')
    dialog.on("hide", dialog.delete)
    dialog.open()
