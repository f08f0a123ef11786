"""The drawing of the conventions page, every direction in it computed with the package's own rotation matrix."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from inclinometry.attitude.orientation import fields
from inclinometry.attitude.rotations import dcm
from inclinometry.report.figure import SERIES, new_figure, save_svg, styled

AZIMUTH, INCLINATION, TOOLFACE, DIP = np.radians([55.0, 40.0, 30.0, 65.0])
RIG, HOLE, TOOL = "#555555", SERIES[1], SERIES[0]


def _arrow(axes, tip, label, colour, *, start=(0.0, 0.0), off=(0.0, 0.0)):
    axes.annotate(
        "", tip, start, arrowprops={"arrowstyle": "-|>", "color": colour, "shrinkA": 0, "shrinkB": 0, "lw": 1.5}
    )
    axes.text(*(np.add(start, np.subtract(tip, start) * 1.12) + off), label, color=colour, ha="center", va="center")


def _arc(axes, first, last, radius, label, colour):
    """An arc from one direction to another, angles counter-clockwise from the x of the paper, with an arrow head."""
    turn = np.linspace(first, last, 60)
    x, y = radius * np.cos(turn), radius * np.sin(turn)
    axes.plot(x, y, color=colour, lw=1.1)
    axes.annotate("", (x[-1], y[-1]), (x[-4], y[-4]), arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.1})
    axes.text(x[30] * 1.28, y[30] * 1.28, label, color=colour, ha="center", va="center")


def _plan(axes):
    """From above: east to the right, north up."""
    axes.set_title("from above")
    hole = dcm(AZIMUTH, INCLINATION, TOOLFACE)[2]
    level = hole[[1, 0]] / np.hypot(*hole[:2])
    _arrow(axes, (0, 1), "north", RIG)
    _arrow(axes, (1, 0), "east", RIG)
    _arrow(axes, level, "hole", HOLE)
    _arc(axes, np.pi / 2, np.arctan2(level[1], level[0]), 0.45, "A", HOLE)


def _section(axes):
    """The vertical plane through the hole, seen from its right-hand side: ahead to the right, down below."""
    axes.set_title("in the vertical plane of the hole")
    turned = dcm(AZIMUTH, INCLINATION, 0.0)  # at toolface 0 x is the high side
    ahead = np.array([np.cos(AZIMUTH), np.sin(AZIMUTH), 0.0])

    def paper(v):
        return np.array([v @ ahead, -v[2]])

    z, high = paper(turned[2]), paper(turned[0])
    _arrow(axes, (0, -1), "down, g", RIG, off=(-0.05, 0))
    _arrow(axes, z, "z", TOOL)
    _arrow(axes, 0.8 * high, "high side", HOLE, off=(0.05, 0.03))
    _arc(axes, -np.pi / 2, np.arctan2(z[1], z[0]), 0.5, "I", HOLE)
    axes.axhline(0.0, color=RIG, lw=0.8, ls=":")


def _cross(axes):
    """Looking down hole: high side up, right of the hole to the right."""
    axes.set_title("looking down hole")
    still, turned = dcm(AZIMUTH, INCLINATION, 0.0), dcm(AZIMUTH, INCLINATION, TOOLFACE)

    def paper(v):
        return np.array([v @ still[1], v @ still[0]])

    turn = np.linspace(0.0, 2.0 * np.pi, 100)
    axes.plot(0.72 * np.cos(turn), 0.72 * np.sin(turn), color=RIG, lw=0.8)
    _arrow(axes, (0, 1), "high side", HOLE)
    x, y = paper(turned[0]), paper(turned[1])
    _arrow(axes, x, "x, index mark", TOOL, off=(0.22, 0.03))
    _arrow(axes, y, "y", TOOL)
    _arc(axes, np.pi / 2, np.arctan2(x[1], x[0]), 0.45, "T", HOLE)
    axes.plot(0, 0, "x", color=TOOL)
    axes.text(-0.1, -0.12, "z", color=TOOL)


@styled
def conventions(path: Path) -> None:
    """Draw azimuth, inclination and toolface as the conventions define them."""
    figure = new_figure(3.2, width=9.0)
    for axes, draw in zip(figure.subplots(1, 3), (_plan, _section, _cross), strict=True):
        axes.set_aspect("equal")
        axes.set_axis_off()
        draw(axes)
        axes.set(xlim=(-0.95, 1.35), ylim=(-1.2, 1.2))
    path.parent.mkdir(parents=True, exist_ok=True)
    save_svg(figure, path)


def example_attitude() -> dict[str, str]:
    """The attitude drawn, and the fields a tool sees there, for the text beside the drawing."""
    g, b = fields(AZIMUTH, INCLINATION, TOOLFACE, DIP)
    degrees = {
        n: f"{np.degrees(v):.0f}" for n, v in (("A", AZIMUTH), ("I", INCLINATION), ("T", TOOLFACE), ("dip", DIP))
    }
    vectors = {n: "(" + ", ".join(f"{x:.4f}" for x in v) + ")" for n, v in (("g", g), ("b", b))}
    return {f"drawn_{n}": text for n, text in (degrees | vectors).items()}
