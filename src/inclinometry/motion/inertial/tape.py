"""Measurements at the end of a window, and the tape on which a window is noted for the backward pass."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from inclinometry.core.arrays import Array

ENDS: Final = 6
"""Rows of the tape for the measurements at the end of a window: gravity, standstill."""
NO_GATE: Final = 1e30


class Tape(NamedTuple):
    """What the backward pass needs of a window; no rows when it is not wanted.

    steps : (n, 13); updates : (n + ENDS, 34); error : (16,) taken out at the end.
    """

    steps: Array
    updates: Array
    error: Array


def blank_tape(size: int) -> Tape:
    """A tape for a window of `size` samples."""
    return Tape(np.zeros((size, 13)), np.zeros((size + ENDS, 34)), np.zeros(16))


NO_TAPE: Final = Tape(np.zeros((0, 13)), np.zeros((0, 34)), np.zeros(16))


class Ends:
    """Measurements at the end of a window, put on the tape after its samples."""

    def __init__(self, p: Array, x: Array, tape: Tape, size: int) -> None:
        self._p, self._x, self._tape, self._next = p, x, tape, size
        self._taped = len(tape.updates) > 0

    def measure(self, h: Array, z: float, variance: float, gate: float) -> float:
        from inclinometry.motion.inertial._recursions import UPDATE, measure

        row = self._tape.updates[self._next] if self._taped else np.empty(UPDATE)
        self._next += 1
        return float(measure(h, z, variance, gate, self._p, self._x, row))

    def surprise(self, h: Array, z: float, variance: float) -> float:
        """Normalised innovation, before anything is done."""
        return float((z - h @ self._x) / np.sqrt(h @ self._p @ h + variance))
