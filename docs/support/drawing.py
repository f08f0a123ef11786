"""Drawings of the conventions and of the paper's rig, every direction computed with rotation matrices."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from inclinometry.calibration import plans
from inclinometry.calibration.plans import Plan
from inclinometry.laboratory.web.pages.calibrate.guided import drawing as stand_drawing
from inclinometry.orientation import fields
from inclinometry.report.figure import SERIES, new_figure, save_svg, styled
from inclinometry.rotations import dcm

AZIMUTH, INCLINATION, TOOLFACE, DIP = np.radians([55.0, 40.0, 30.0, 65.0])
STATIC = Path(__file__).parents[1] / "_static"
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


def paper_rig(alpha: float, theta: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Axes of phi, theta and alpha in the paper's rig axes X0, Y0, Z0: r_phi and r_theta by its printed matrices."""
    turn_alpha = np.array([[-np.cos(alpha), -np.sin(alpha), 0], [np.sin(alpha), -np.cos(alpha), 0], [0, 0, 1.0]])
    turn_theta = np.array([[np.cos(theta), 0, np.sin(theta)], [0, 1, 0], [-np.sin(theta), 0, np.cos(theta)]])
    return (turn_theta @ turn_alpha)[2], turn_alpha[1], np.array([0.0, 0.0, 1.0])


@styled
def rig(path: Path) -> None:
    """Draw the frames of the paper's rig: Y0 north, Z0 down, so X0 is west."""
    alpha, theta = np.radians([25.0, 55.0])
    along, across, _ = paper_rig(alpha, theta)
    figure = new_figure(3.4, width=8.0)
    above, plane = figure.subplots(1, 2)
    for axes in (above, plane):
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.set(xlim=(-1.5, 1.5), ylim=(-1.3, 1.45))

    def paper(v):  # seen from above, north up: X0 to the left
        return np.array([-v[0], v[1]])

    above.text(-1.5, 1.25, "from above")
    _arrow(above, paper((1, 0)), "X₀", RIG, off=(-0.08, 0.0))
    _arrow(above, paper((0, 1)), "Y₀, north", RIG)
    above.plot(0, 0, "x", color=RIG)
    above.text(0.1, -0.16, "Z₀, axis of α (down)", color=RIG)
    lean = along / np.hypot(*along[:2])
    _arrow(above, 0.85 * paper(lean), "lean of the tool", TOOL, off=(-0.2, 0.08))
    _arrow(above, 0.85 * paper(across), "axis of ϑ", HOLE)
    printed = np.array([np.sin(alpha), np.cos(alpha)])
    above.plot(*np.stack([(0, 0), 0.75 * paper(printed)]).T, color=HOLE, lw=1.0, ls=":")
    above.text(*(0.8 * paper(printed) + (-0.15, 0.06)), "axis of ϑ, as printed", color=HOLE, ha="center")
    _arc(above, np.pi, np.pi - alpha, 0.4, "α", TOOL)

    plane.text(-1.5, 1.25, "in the plane of the lean")
    _arrow(plane, (0, -1), "Z₀, axis of α, down", RIG)
    _arrow(plane, (np.sin(theta), -np.cos(theta)), "axis of φ: the tool", TOOL, off=(0.1, -0.08))
    _arc(plane, -np.pi / 2, -np.pi / 2 + theta, 0.45, "ϑ", TOOL)
    plane.axhline(0.0, color=RIG, lw=0.8, ls=":")
    save_svg(figure, path)


WORDS = {"U": (0, 0, -1), "D": (0, 0, 1), "N": (1, 0, 0), "S": (-1, 0, 0), "E": (0, 1, 0), "W": (0, -1, 0)}
STYLE = """
.ring { fill: none; stroke: #999; stroke-width: 1.2; } .far { stroke: #ddd; }
.angle { fill: none; stroke: #0b5cad; stroke-width: 3.5; stroke-linecap: round; }
polyline.north, polyline.down { fill: none; stroke: #b3261e; stroke-width: 2; } polyline.down { stroke: #777; }
polygon.north { fill: #b3261e; } polygon.down { fill: #777; }
text { font: 700 14px sans-serif; text-anchor: middle; fill: #b3261e; } text.down { font-weight: 400; fill: #777; }
text.number { font-size: 26px; fill: #222; text-anchor: start; }
text.axes { font-size: 17px; font-weight: 400; fill: #222; }
.barrel { fill: #7e95a8; stroke: #222; } .cap { fill: #a9bac8; stroke: #222; } .nose { fill: #3d566b; stroke: #222; }
.mark { fill: none; stroke: #ffcf33; stroke-width: 6; } .mark.hidden { stroke-width: 3; stroke-dasharray: 5 5; }
.pin { fill: none; stroke: #c98a00; stroke-width: 4; stroke-linecap: round; }
"""


def axis_words(azimuth: float, inclination: float, toolface: float) -> str:
    """Where x, y, z of the tool point, as U, D, N, S, E, W; angles where they point between.

    Examples
    --------
    >>> axis_words(0.0, np.pi / 2, np.pi / 2)
    'E D N'
    """
    found = []
    for axis in dcm(azimuth, inclination, toolface):
        word = max(WORDS, key=lambda name: float(np.dot(WORDS[name], axis)))
        if np.dot(WORDS[word], axis) < 0.999:
            a, i, t = np.degrees([azimuth, inclination, toolface])
            return f"A {a:g}, I {i:g}, T {t:g}"
        found.append(word)
    return " ".join(found)


def positions(path: Path, plan: Plan, columns: int = 6) -> None:
    """Draw each position of a plan with its number, by the drawing of the bench; below it where x, y, z point."""
    width, height = 380, 320
    cells = []
    for number, dial in enumerate(zip(plan.azimuth, plan.inclination, plan.toolface, strict=True)):
        x, y = width * (number % columns), height * (number // columns)
        words = axis_words(*map(float, dial))
        picture = stand_drawing(dial, f"position {number + 1}: {words}", ("N", "down"))
        placed = picture.replace("<svg ", f'<svg x="{x}" y="{y + 10}" width="{width}" height="275" ', 1)
        title = f'<text class="number" x="{x + 12}" y="{y + 30}">{number + 1}</text>'
        cells.append(placed + title + f'<text class="axes" x="{x + width / 2}" y="{y + 305}">{words}</text>')
    rows = -(-len(plan) // columns)
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {columns * width} {rows * height}">'
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"{head}<style>{STYLE}</style>{''.join(cells)}</svg>\n", encoding="utf-8")


def everything() -> dict[str, str]:
    """The attitude drawn, and the fields a tool sees there, for the text beside the drawings, which are drawn too."""
    conventions(STATIC / "conventions.svg")
    rig(STATIC / "rig.svg")
    positions(STATIC / "positions_24.svg", plans.orthogonal())
    positions(STATIC / "positions_12.svg", plans.twelve())
    g, b = fields(AZIMUTH, INCLINATION, TOOLFACE, DIP)
    degrees = {
        n: f"{np.degrees(v):.0f}" for n, v in (("A", AZIMUTH), ("I", INCLINATION), ("T", TOOLFACE), ("dip", DIP))
    }
    vectors = {n: "(" + ", ".join(f"{x:.4f}" for x in v) + ")" for n, v in (("g", g), ("b", b))}
    return {f"drawn_{n}": text for n, text in (degrees | vectors).items()}
