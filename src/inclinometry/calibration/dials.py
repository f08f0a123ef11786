"""Dial settings compared: which are the same place, and which differ only in how they are written."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inclinometry.arrays import Array, finite
from inclinometry.errors import wrong_shape
from inclinometry.findings import Finding
from inclinometry.rotations import TAU, wrap_positive, wrap_signed

Rows: TypeAlias = NDArray[np.intp]
"""Indices of stations."""

ANGLE_TOLERANCE = float(np.radians(1e-6))
"""How far a dial setting may be from the place a plan gives it, rad: rounding of degrees in a file, nothing more."""


def three_dials(azimuth: ArrayLike, inclination: ArrayLike, toolface: ArrayLike) -> tuple[Array, Array, Array]:
    """The settings as finite vectors of one length; an error that names the one that is not."""
    named = (("azimuth", azimuth), ("inclination", inclination), ("toolface", toolface))
    a, i, t = (finite(value, name, (None,)) for name, value in named)
    if not a.shape == i.shape == t.shape or a.ndim != 1:
        raise wrong_shape("azimuth, inclination, toolface", f"{a.shape}, {i.shape}, {t.shape}", "(K,)")
    return a, i, t


def same(angle: ArrayLike, place: float) -> NDArray[np.bool_]:
    """Boolean (...): which angles are at `place`, turns of 360 degrees apart or not.

    Examples
    --------
    >>> same(np.radians([90.0, -270.0, 91.0]), np.pi / 2)
    array([ True,  True, False])
    """
    return np.asarray(np.abs(wrap_signed(np.asarray(angle) - place)) <= ANGLE_TOLERANCE)


def unequal_steps(angle: ArrayLike) -> Finding | None:
    """Why the angles are not p >= 3 equal steps of a full turn (in any order, from any start); None when they are."""
    angles = finite(angle, "angle", (None,))
    if len(angles) < 3:
        return Finding("plan-steps-few", {"count": len(angles)})
    # measured from one of them, so that rounding at 0/360 degrees does not part equal settings
    turned = np.sort(wrap_signed(angles - angles[0]))
    steps = np.diff(turned, append=turned[0] + TAU)
    wanted = TAU / len(angles)
    worst = steps[np.argmax(np.abs(steps - wanted))]
    if abs(worst - wanted) <= 2.0 * ANGLE_TOLERANCE:
        return None
    steps_deg = {"wanted_deg": float(np.degrees(wanted)), "step_deg": float(np.degrees(worst))}
    return Finding("plan-steps-unequal", {"count": len(angles), **steps_deg})


def groups(angle: ArrayLike) -> list[Rows]:
    """Rows of equal angle, modulo a turn, as index arrays in order of first appearance.

    Examples
    --------
    >>> [rows.tolist() for rows in groups(np.radians([0.0, 120.0, 360.0, -240.0]))]
    [[0, 2], [1, 3]]
    """
    angles = finite(angle, "angle", (None,))
    left, found = np.ones(len(angles), dtype=bool), []
    for row in range(len(angles)):
        if left[row]:
            members = left & same(angles, float(angles[row]))
            left &= ~members
            found.append(np.flatnonzero(members))
    return found


def positive_inclination(azimuth: Array, inclination: Array, toolface: Array) -> tuple[Array, Array, Array]:
    """The same orientations written with inclination 0 to 180 degrees: (A, -I, T) is (A + 180, I, T + 180)."""
    signed = wrap_signed(inclination)
    over = np.where(signed < -ANGLE_TOLERANCE, np.pi, 0.0)
    return wrap_positive(azimuth + over), np.abs(signed), wrap_positive(toolface + over)


def at_azimuth(azimuth: Array, inclination: Array, toolface: Array, wanted: float) -> tuple[Array, Array, Array]:
    """The same orientations written with the azimuth `wanted` where that is possible.

    (A + 180, I, T) is (A, -I, T + 180); at inclination 0 only A + T counts, at 180 only T - A.
    """
    opposite, up, down = same(azimuth, wanted + np.pi), same(inclination, 0.0), same(inclination, np.pi)
    turn = wrap_signed(azimuth - wanted)
    rolled = np.select([up, down, opposite], [toolface + turn, toolface - turn, toolface + np.pi], toolface)
    tilted = np.where(opposite & ~up & ~down, -inclination, inclination)
    return np.where(opposite | up | down, wanted, azimuth), tilted, rolled
