"""Windows one after the other: start, gaps, standstills; shared by the streams, the smoother and the survey."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from inclinometry.core.errors import InputError
from inclinometry.motion._window_buffer import LARGEST_BREAK
from inclinometry.motion.inertial.model import Model
from inclinometry.motion.inertial.rows import LOST, row
from inclinometry.motion.inertial.start import azimuth_variance, blank, given, linearised, sought
from inclinometry.motion.inertial.state import State
from inclinometry.motion.inertial.window import Seen, is_still, reduce_window
from inclinometry.motion.result import Attitude, refusals
from inclinometry.motion.samples import Samples


class Node(NamedTuple):
    """A window as the backward pass needs it.

    before, after : states; before is what the forward pass began with, None where there was nothing to begin with.
    broken : its attitude does not continue that of the window before. age : windows since the
    start. time : s, of after.
    """

    before: State | None
    after: State | None
    seen: Seen | None
    broken: bool
    age: int
    time: float


class Engine:
    """Carries the state from window to window."""

    def __init__(self, model: Model, start: Attitude | None) -> None:
        self._model, self._start = model, start
        self._state: State | None = None
        self._age = 0
        self._first, self._count = np.nan, 0

    def advance(self, window: Samples) -> Node:
        """The window, reduced."""
        needed = ("accel", "gyro", "mag") if self._model.magnetic else ("accel", "gyro")
        missing = [name for name in needed if not window.has(name)]
        if missing:
            raise InputError(f"the samples have no {' and no '.join(missing)}; this filter needs {', '.join(needed)}")
        broken = self._placed(window)
        state = self._before(window, broken)
        self._count += len(window)
        time = self._first + window.interval * (self._count - 1)
        if state is None:
            return Node(None, None, None, True, 0, time)
        after, seen = reduce_window(state, window, self._model)
        self._state = after
        self._age += 1
        return Node(state, after, seen, broken or self._age == 1, self._age - 1, time)

    def row(self, node: Node, window: Samples, method: str) -> Attitude:
        """The forward pass's row."""
        if node.after is None or node.seen is None:
            north = "magnetic" if self._model.magnetic else "true"
            return refusals([node.time], ("clipped", "start"), method, north)
        covariance = node.after.covariance[:3, :3]
        return row(node.time, node.after, covariance, node.seen, node.age, window, self._model, method)

    def _placed(self, window: Samples) -> bool:
        """Whether the window does not continue the grid; the grid is then begun again at its first stamp."""
        expected = self._first + window.interval * self._count
        if abs(window.time[0] - expected) <= LARGEST_BREAK * window.interval + 4.0 * np.spacing(abs(window.time[0])):
            return False
        self._first, self._count = float(window.time[0]), 0
        return True

    def _before(self, window: Samples, broken: bool) -> State | None:
        """State before the window; None while there is no window without clipping to start from."""
        state, model = self._state, self._model
        fresh = state is None
        if state is None:
            state = blank(window, model)
        north = (
            not model.magnetic
            and azimuth_variance(state) > LOST**2
            and is_still(state, window, model, np.zeros(len(window), np.bool_))
        )
        if not (broken or fresh or (north and self._start is None)):
            return state
        if window.clipped is not None and window.clipped.any() and (self._start is None or not fresh):
            self._state = None if fresh else state
            return None if fresh else state
        if fresh and self._start is not None:
            return linearised(given(state, window, self._start, model), window, model)
        self._age = 0 if broken else self._age
        return linearised(sought(state, window, model), window, model)
