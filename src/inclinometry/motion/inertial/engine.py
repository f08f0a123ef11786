"""Windows one after the other: start, gaps, standstills; shared by the streams, the smoother and the survey."""

from __future__ import annotations

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from inclinometry.core.errors import InputError
from inclinometry.motion._window_buffer import LARGEST_BREAK
from inclinometry.motion.inertial.model import Model
from inclinometry.motion.inertial.rows import LOST, SETTLED, row
from inclinometry.motion.inertial.start import azimuth_variance, bent, blank, given, linearised, sought
from inclinometry.motion.inertial.state import State
from inclinometry.motion.inertial.window import Seen, is_still, reduce_window
from inclinometry.motion.result import Attitude, refusals
from inclinometry.motion.samples import Samples

ROUGH: Final = 1.0
"""m/s^2, scatter of a window's mean gravity beyond which shaking is no longer a small error: nothing is said."""
BELIEVED: Final = 3
"""Windows in a row whose gravity contradicts the filter, from which the filter is not believed."""


class Node(NamedTuple):
    """A window as the backward pass needs it.

    before, after : states; before is what the forward pass began with, None where there was nothing to begin with; its
        attitude is not that of the window before where it was linearised again.
    anew : its attitude does not continue that of the window before. age : windows since the
    start. time : s, of after. model : what the window was reduced with.
    """

    before: State | None
    after: State | None
    seen: Seen | None
    anew: bool
    age: int
    time: float
    model: Model


class Engine:
    """Carries the state from window to window."""

    def __init__(self, model: Model, start: Attitude | None) -> None:
        self.model, self._start = model, start
        self._state: State | None = None
        self._lost = True  # nothing tells the attitude: at the beginning and after a gap
        self._seeking = False  # a standstill in which azimuth is being found
        self._age = 0
        self._misfits = 0  # windows in a row whose gravity contradicts the filter
        self._first, self._count = np.nan, 0

    def advance(self, window: Samples) -> Node:
        """The window, reduced."""
        needed = ("accel", "gyro", "mag") if self.model.magnetic else ("accel", "gyro")
        missing = [name for name in needed if not window.has(name)]
        if missing:
            raise InputError(f"the samples have no {' and no '.join(missing)}; this filter needs {', '.join(needed)}")
        self._place(window)
        self._count += len(window)
        time = self._first + window.interval * (self._count - 1)
        state, anew, model = self._before(window)
        if state is None:
            return Node(None, None, None, True, 0, time, model)
        if not anew and bent(state, window):
            state, after, seen = _finer(state, window, model)
        else:
            after, seen = reduce_window(state, window, model)
        if self._lost and not self._stated and (seen.disturbed or seen.gravity < 0.0):
            return Node(None, None, None, True, 0, time, model)  # no beginning to build on; the next window may be one
        self._age = 0 if self._lost else self._age + 1
        self._misfits = self._misfits + 1 if seen.gravity < 0.0 else 0
        self._state, self._lost = after, False
        rough = seen.shaking > ROUGH
        if rough or self._misfits >= BELIEVED or (self._misfits and self._age < SETTLED):
            # a filter that gravity contradicts again and again is wrong, however sure it is: begin anew
            self._state, self._lost = None, True
            return Node(None, None, seen, True, 0, time, model)
        return Node(state, after, seen, anew, self._age, time, model)

    def row(self, node: Node, window: Samples, method: str) -> Attitude:
        """The forward pass's row."""
        if node.after is None or node.seen is None:
            north = "magnetic" if self.model.magnetic else "true"
            why = "clipped" if window.clipped is not None and window.clipped.any() else "misfit"
            why = "vibration" if node.seen is not None and node.seen.shaking > ROUGH else why
            return refusals([node.time], (why, "start"), method, north)
        covariance = node.after.covariance[:3, :3]
        return row(node.time, node.after, covariance, node.seen, node.age, window, self.model, method)

    @property
    def _stated(self) -> bool:
        """Whether the start that was given is still to be used."""
        return self._state is None and self._start is not None

    def _place(self, window: Samples) -> None:
        """Count on, or begin the grid again at the first stamp of a window that does not continue it."""
        expected = self._first + window.interval * self._count
        slack = LARGEST_BREAK * window.interval + 4.0 * np.spacing(abs(window.time[0]))
        if not abs(window.time[0] - expected) <= slack:
            self._first, self._count, self._lost, self._seeking = float(window.time[0]), 0, True, False

    def _before(self, window: Samples) -> tuple[State | None, bool, Model]:
        """State before the window (None: nothing to start from), whether its attitude is a new one, and the model."""
        model, anew, sought_before = self.model, self._lost, self._seeking
        state = blank(window, model) if self._state is None else self._state
        clipped = window.clipped is not None and bool(window.clipped.any())
        if self._stated and self._start is not None:
            state = given(state, window, self._start, model)
            anew = False
        elif self._lost and clipped:
            return None, True, model
        self._seeking = False
        if not model.magnetic and (anew or azimuth_variance(state) > LOST**2):
            self._seeking = is_still(state, window, model, np.zeros(len(window), np.bool_)) and not clipped
            model = replace(model, blind=not self._seeking)
            anew = anew or (self._seeking and not sought_before)  # later windows of the standstill add to the first
        if anew:
            state = sought(state, window, model)
        if anew or self._stated:
            return linearised(state, window, model, model.magnetic), True, model
        return state, False, model


def _finer(state: State, window: Samples, model: Model) -> tuple[State, State, Seen]:
    """The state linearised again by the window, without a field that is disturbed, and `reduce_window` of it."""
    finer = linearised(state, window, model, model.magnetic)
    after, seen = reduce_window(finer, window, model)
    if seen.disturbed:
        finer = linearised(state, window, model, False)
        after, seen = reduce_window(finer, window, model)
    return finer, after, seen
