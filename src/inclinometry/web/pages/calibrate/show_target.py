"""The large card: where to turn the tool to, as numbers to be read from two metres and as a picture."""

from __future__ import annotations

import numpy as np
from nicegui import ui

from inclinometry.attitude.rotations import dcm
from inclinometry.core.arrays import Array
from inclinometry.web.frame import Visitor
from inclinometry.web.pages.calibrate.guided import Guided

_TO_SCENE = np.diag([1.0, -1.0, -1.0])
"""North, east, down -> the picture's x (north), y (west), z (up)."""


class Target:
    """Numbers and picture of the chosen position."""

    def __init__(self, guided: Guided) -> None:
        self._guided = guided
        say = guided.visitor.say
        with ui.card().classes("panel target"):
            with ui.row().classes("items-baseline justify-between"):
                self._name = ui.label().classes("subtitle number")
                self._state = ui.label().classes("number")
            with ui.element("div").classes("dials"):
                self._dials = [_dial(say(f"bench.{dial}")) for dial in ("azimuth", "inclination", "toolface")]
            self._scene = _Picture(guided.visitor)
        self.show()

    def show(self) -> None:
        """The chosen position as it is now."""
        guided, say = self._guided, self._guided.visitor.say
        chosen = guided.chosen
        self._name.set_text(say("bench.position", number=chosen.number, all=len(guided.positions)))
        done = guided.session.has(chosen.number)
        self._state.set_text(say("bench.captured") if done else say("bench.to_capture"))
        self._state.classes(replace="number good" if done else "number dim")
        for label, angle in zip(self._dials, chosen.dial, strict=True):
            label.set_text(f"{np.degrees(angle):.2f}°")
        self._scene.turn(dcm(*chosen.dial))


def _dial(name: str) -> ui.label:
    with ui.element("div").classes("dial"):
        ui.label(name).classes("dim")
        return ui.label("0.00°").classes("digits number")


class _Picture:
    """The tool in the stand, seen from the south-east and above."""

    def __init__(self, visitor: Visitor) -> None:
        with ui.scene(width=360, height=250, grid=(4, 4), background_color="#00000000").classes("scene") as self._scene:
            self._scene.props(f'aria-label="{visitor.say("bench.picture")}"')
            self._arrow([0.0, 0.0, 0.0], [1.6, 0.0, 0.0], "#b3261e")
            ui.scene.text("N", "color:#b3261e;font-weight:bold").move(1.8, 0.0, 0.0)
            with self._scene.group() as self._tool:
                body = self._scene.cylinder(0.16, 0.16, 2.2).material("#5b7f9d")
                body.rotate(np.pi / 2, 0.0, 0.0)
                head = self._scene.cylinder(0.0, 0.2, 0.4).material("#0b5cad")
                head.rotate(np.pi / 2, 0.0, 0.0).move(0.0, 0.0, 1.2)
                self._scene.box(0.1, 0.08, 1.6).material("#e8b100").move(0.18, 0.0, 0.0)
        self._scene.move_camera(x=2.2, y=-2.6, z=1.9, look_at_x=0, look_at_y=0, look_at_z=0, duration=0.0)

    def _arrow(self, start: list[float], end: list[float], colour: str) -> None:
        self._scene.line(start, end).material(colour)

    def turn(self, attitude: Array) -> None:
        """Show the tool at an attitude (north, east, down to tool)."""
        self._tool.rotate_R((_TO_SCENE @ attitude.T).tolist())
