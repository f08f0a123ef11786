"""The tool in its stand as a line drawing: azimuth, inclination and toolface without a graphics card."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np

from inclinometry.attitude.rotations import dcm
from inclinometry.core.arrays import Array

AZIMUTH_OF_EYE: Final = np.radians(155.0)
"""The picture is seen from the south-south-east ..."""
HEIGHT_OF_EYE: Final = np.radians(24.0)
"""... and from above."""
SCALE: Final = 100.0
LENGTH, RADIUS, NOSE = 0.82, 0.15, 0.30
RING, NORTH, COLLAR = 1.0, 1.28, 0.34
_TURN: Final = np.linspace(0.0, 2.0 * np.pi, 49)


def _eye() -> Array:
    """(3, 3) north, east, down -> right, up, toward the eye."""
    a, h = AZIMUTH_OF_EYE, HEIGHT_OF_EYE
    toward = np.array([np.cos(a) * np.cos(h), np.sin(a) * np.cos(h), -np.sin(h)])
    right = np.cross(-toward, [0.0, 0.0, -1.0])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, -toward), toward])


_EYE: Final = _eye()


def project(points: Array) -> Array:
    """Points (n, 3) north, east, down -> (n, 3) x right, y downward in the picture's units, depth to the eye.

    Examples
    --------
    Down is down in the picture, east is to the right of west:

    >>> project(np.array([[0.0, 0.0, 1.0]]))[0, :2].round(1) + 0.0
    array([ 0. , 91.4])
    >>> bool(project(np.array([[0.0, 1.0, 0.0]]))[0, 0] > 0.0)
    True
    """
    seen = np.asarray(points, dtype=float).reshape(-1, 3) @ _EYE.T
    return np.stack([SCALE * seen[:, 0], -SCALE * seen[:, 1], seen[:, 2]], axis=1)


def tool_axes(dial: tuple[float, float, float]) -> Array:
    """Axes of the tool in north, east, down: rows x (index mark), y, z (along the tool, toward the bit).

    Examples
    --------
    Lying toward the east with the index up:

    >>> tool_axes((np.pi / 2, np.pi / 2, 0.0)).round(6)[[0, 2]] + 0.0
    array([[ 0.,  0., -1.],
           [ 0.,  1.,  0.]])
    """
    return dcm(*dial)


def drawing(dial: tuple[float, float, float], label: str, words: tuple[str, str]) -> str:
    """The picture of a setting, as SVG.

    Parameters
    ----------
    dial : (azimuth, inclination, toolface)
        rad.
    label : str
        What the picture is, for those who do not see it; escaped by the caller.
    words : (str, str)
        "N" and "down" in the reader's language; escaped by the caller.
    """
    azimuth, inclination, toolface = dial
    x, _, z = axes = tool_axes(dial)
    high = dcm(azimuth, inclination, 0.0)
    heading = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    north, down = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    level = _arc(north, np.array([0.0, 1.0, 0.0]), _TURN)
    upright = _arc(down, heading, _TURN)
    collar = -0.45 * z + COLLAR * _arc(high[0], high[1], _TURN)
    back, front = [], []
    for ring in (level, upright, collar):
        halves = _halves(ring)
        back.append(_path(halves[0], "ring far"))
        front.append(_path(halves[1], "ring"))
    angles = [
        _path([_arc(north, np.array([0.0, 1.0, 0.0]), _sweep(azimuth))], "angle"),
        _path([_arc(down, heading, _sweep(inclination))], "angle"),
        _path([-0.45 * z + COLLAR * _arc(high[0], high[1], _sweep(toolface))], "angle"),
    ]
    fixed = _arrow(north * NORTH, "north", words[0]) + _arrow(down * NORTH, "down", words[1])
    body = _tool(axes) + _index(x, z)
    size = 'viewBox="-190 -135 380 275" preserveAspectRatio="xMidYMid meet"'
    inside = "".join([*back, fixed, body, *front, *angles])
    return f'<svg class="stand" role="img" aria-label="{label}" {size}>{inside}</svg>'


def _sweep(angle: float) -> Array:
    """From zero to an angle the short way round for negative ones, in small steps."""
    return np.linspace(0.0, angle, max(2, int(abs(angle) / 0.06) + 2))


def _arc(first: Array, second: Array, angle: Array) -> Array:
    return RING * (np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second)


def _halves(ring: Array) -> tuple[list[Array], list[Array]]:
    """The stretches of a ring behind and before its centre."""
    near = project(ring)[:, 2] >= project(ring.mean(axis=0))[0, 2]
    found: tuple[list[Array], list[Array]] = ([], [])
    begin = 0
    for i in range(1, len(ring)):
        if near[i] != near[begin] or i == len(ring) - 1:
            found[int(near[begin])].append(ring[begin : i + 1])
            begin = i
    return found


def _points(seen: Array) -> str:
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in seen[:, :2])


def _path(lines: Iterable[Array], name: str) -> str:
    return "".join(f'<polyline class="{name}" points="{_points(project(line))}"/>' for line in lines)


def _arrow(tip: Array, name: str, word: str) -> str:
    ends = project(np.stack([np.zeros(3), tip, 1.13 * tip]))
    along = ends[1, :2] - ends[0, :2]
    along /= np.linalg.norm(along)
    across = np.array([-along[1], along[0]])
    head = np.stack([ends[1, :2], ends[1, :2] - 11 * along + 5 * across, ends[1, :2] - 11 * along - 5 * across])
    line = f'<polyline class="{name}" points="{_points(ends[:2])}"/>'
    text = f'<text class="{name}" x="{ends[2, 0]:.1f}" y="{ends[2, 1] + 4:.1f}">{word}</text>'
    return f'{line}<polygon class="{name}" points="{_points(head)}"/>{text}'


def _tool(axes: Array) -> str:
    """A cylinder with a nose toward the bit, drawn from far to near."""
    x, y, z = axes
    circle = RADIUS * (np.cos(_TURN)[:, None] * x + np.sin(_TURN)[:, None] * y)
    top, shoulder, tip = circle - LENGTH * z, circle + (LENGTH - NOSE) * z, LENGTH * z[None]
    barrel = f'<polygon class="barrel" points="{_points(_hull(np.concatenate([top, shoulder])))}"/>'
    nose = f'<polygon class="nose" points="{_points(_hull(np.concatenate([shoulder, tip])))}"/>'
    if (_EYE @ z)[2] > 0.0:  # the nose points toward the eye
        return barrel + nose
    return f'{nose}{barrel}<polygon class="cap" points="{_points(project(top))}"/>'


def _index(x: Array, z: Array) -> str:
    """The index mark: a stripe along the tool and a pin; dashed where the tool hides it."""
    stripe = RADIUS * x + np.stack([-(LENGTH - 0.04) * z, (LENGTH - NOSE) * z])
    pin = np.stack([RADIUS * x - 0.45 * z, (COLLAR + 0.06) * x - 0.45 * z])
    hidden = "" if (_EYE @ x)[2] > -1e-9 else " hidden"
    return _path([stripe], f"mark{hidden}") + _path([pin], "pin")


def _hull(points: Array) -> Array:
    """Convex outline of projected points, (k, 2); Andrew's chain."""
    flat = sorted({(round(float(a), 2), round(float(b), 2)) for a, b in project(points)[:, :2]})
    chains: list[list[tuple[float, float]]] = []
    for order in (flat, flat[::-1]):
        chain: list[tuple[float, float]] = []
        for p in order:
            while len(chain) > 1 and _turns(chain[-2], chain[-1], p) <= 0.0:
                chain.pop()
            chain.append(p)
        chains.append(chain[:-1])
    return np.array(chains[0] + chains[1])


def _turns(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
