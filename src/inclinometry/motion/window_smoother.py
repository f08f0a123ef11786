"""Backward pass over the robust filter: every row with all rows before and after it, for what was recorded."""

from __future__ import annotations

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.motion._hole_direction import carried, offset_of, rolled, turned
from inclinometry.motion._window_model import Belief, Step, attitude_of, predicted_frame, process, transition
from inclinometry.motion._window_recursion import measured
from inclinometry.motion.result import BITS, Attitude
from inclinometry.motion.window_filter import RobustStream, WindowFilterSettings
from inclinometry.uncertainty.propagation import UNKNOWN


def smooth_windows(rows: Attitude, settings: WindowFilterSettings | None = None) -> Attitude:
    """Smooth window attitudes: the robust filter forward, then the Rauch-Tung-Striebel pass backward.

    Parameters
    ----------
    rows : Attitude
        As for `robust_filter`: windows that share no samples.
    settings : WindowFilterSettings, optional

    Returns
    -------
    Attitude
        A row for each row given, as `robust_filter`, with less uncertainty; bridged rows lean on both sides.

    Raises
    ------
    InputError
        Times that do not increase.

    Notes
    -----
    Rauch H.E., Tung F., Striebel C.T., AIAA J. 3(8), 1965: with the filter's belief x, P at a row and its prediction
    x-, P- for the next,

        K = P F' (P-)^-1,  x_s = x + K (x_s,next - x-),  P_s = P + K (P_s,next - P-) K'.

    The difference of directions is the rotation vector between the two frames. P- is the one after the adaptive factor,
    so nothing leaks backward across a bend. The toolface of a measured row is its own, corrected by the smoothed
    direction through their correlation; that of a bridged row is the filter's, without the rows after it.
    Rows before the filter's start are predicted backward from it and weighted likewise.

    Examples
    --------
    >>> from inclinometry.motion.result import refusals
    >>> rows = refusals([5.0, 15.0], ["clipped"], "magnetic", "magnetic")
    >>> bool(smooth_windows(rows).refused.all())
    True
    """
    chosen = settings or WindowFilterSettings()
    stream = RobustStream(chosen)
    steps = stream.steps(rows) + stream.last_steps()
    smoothed = list(steps)
    later: Belief | None = None
    seen_at = np.inf
    for place in range(len(steps) - 1, -1, -1):
        step = steps[place]
        if step.belief is None:
            if later is not None and seen_at - step.row.time <= chosen.longest_bridge:
                smoothed[place] = _before(chosen, step, later)
                later = smoothed[place].belief
            else:
                later = None
        else:
            following = steps[place + 1].predicted if place + 1 < len(steps) else None
            later = step.belief if later is None or following is None else _back(step.belief, following, later)
            smoothed[place] = _replaced(step, later)
        seen_at = step.row.time if step.row.matrix is not None else seen_at
    return attitude_of(smoothed, rows.north, "smoother", stream.common, rows.notes)


def _before(settings: WindowFilterSettings, step: Step, later: Belief) -> Step:
    """A row the filter had not started at, from the belief after it and its own attitude where it has one."""
    dt = later.time - step.row.time
    f = transition(-dt)
    added = process(dt, settings.direction_walk, settings.rate_walk)
    frame = predicted_frame(later, -dt)
    predicted = Belief(step.row.time, frame, later.rate, f @ (later.covariance + added) @ f.T)
    row = step.row._replace(flags=step.row.flags & ~BITS["start"])
    if row.matrix is not None and row.covariance is not None:
        return measured(settings, row, row.matrix, row.covariance, predicted, 1.0)[0]
    unknown = carried(frame, predicted.covariance[:2, :2], 0.0, UNKNOWN**2)
    return step._replace(row=row, belief=predicted, matrix=unknown[0], covariance=unknown[1], quality=0.0)


def _back(belief: Belief, predicted: Belief, later: Belief) -> Belief:
    """One step backward."""
    f = transition(predicted.time - belief.time)
    gain = np.linalg.solve(predicted.covariance, f @ belief.covariance).T
    change = gain @ np.concatenate([offset_of(predicted.frame, later.frame[2]), later.rate - predicted.rate])
    covariance = belief.covariance + gain @ (later.covariance - predicted.covariance) @ gain.T
    frame = turned(belief.frame, change[:2])
    return Belief(belief.time, frame, belief.rate + change[2:], 0.5 * (covariance + covariance.T))


def _replaced(step: Step, belief: Belief) -> Step:
    """The step with its tool attitude rebuilt on the smoothed direction."""
    found: tuple[Array, Array]
    spread = belief.covariance[:2, :2]
    if step.row.matrix is not None and step.row.covariance is not None:
        found = rolled(belief.frame, spread, step.row.matrix, step.factor * step.row.covariance)
    else:
        found = carried(belief.frame, spread, step.roll, step.roll_variance)
    return step._replace(matrix=found[0], covariance=found[1], belief=belief)
