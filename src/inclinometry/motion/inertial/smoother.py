"""The backward pass over everything recorded, and the gyro-only survey between two stations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from inclinometry.arrays import Array
from inclinometry.earth.site import Site
from inclinometry.errors import refused
from inclinometry.findings import Finding
from inclinometry.motion.inertial.filter import SETTLED, Engine, Node, row
from inclinometry.motion.inertial.state import (
    NO_GATE,
    STATES,
    InertialSettings,
    Model,
    State,
    Tape,
    blank_tape,
    corrected,
    error_transition,
)
from inclinometry.motion.inertial.window import Ends, reduce_window
from inclinometry.motion.result import BITS, Attitude, Samples, joined, refusals
from inclinometry.motion.window_filter import WindowBuffer, bridged
from inclinometry.rotations import dcm_from_quaternion, rotation_log
from inclinometry.tabular import check_record


def smoothed_attitude(
    samples: Samples,
    settings: InertialSettings | None = None,
    site: Site | None = None,
    start: Attitude | None = None,
) -> Attitude:
    """Attitude of a recorded run, every row from all samples before and after it; arguments as `inertial_attitude`.

    Modified Bryson-Frazier smoother (Bierman, Factorization Methods, 1977, chapter X): from the last sample back, lam
    = (1 - k h)' lam - h v / s, info = (1 - k h)' info (1 - k h) + h h' / s past a measurement, F' lam and F' info F
    past a step; smoothed error x - P lam, covariance P - P info P. No covariance is inverted. States are kept at the
    ends of windows only, whose steps are gone through again: memory grows by some kilobytes a window.
    """
    model = Model(settings or InertialSettings(), site or Site(), True)
    return _smoothed(samples, model, start, None, "smoother")


def continuous_survey(
    samples: Samples,
    start: Attitude,
    end: Attitude,
    settings: InertialSettings | None = None,
    site: Site | None = None,
) -> Attitude:
    """Gyro-only survey of a run between two north-seeking stations, its drift closed at both ends.

    Parameters
    ----------
    samples : Samples
        With `accel` and `gyro`; begins with the tool as at the first station and ends with it as at the second.
    start, end : Attitude
        The stations, azimuths from true north; of `start` the last row counts, of `end` the first
        (`north_seeking_attitude` makes such rows). Their covariances enter as they are.
    settings : InertialSettings, optional
    site : Site, optional
        Its latitude: without it the Earth rate is taken for drift.

    Returns
    -------
    Attitude
        A row a window, method "survey", north "true". A finding has the misclosure; where it is larger than the
        uncertainties allow, or the last window gives no attitude to close at, every row is flagged "misfit".

    Raises
    ------
    InputError
        Missing triads, stations that are refused, not from true north, or not at the ends of the run.

    Notes
    -----
    The filter of `gyro_attitude` from the first station, the second as a measurement of the attitude at the last row,
    and the backward pass of `smoothed_attitude`. What a constant gyro bias and scale error do to the azimuth grows in
    proportion to time and turns, is seen whole at the end, and leaves what random walk makes: most in the middle.
    """
    check_record(samples, Samples, "continuous_survey")
    model = Model(settings or InertialSettings(), site or Site(), False)
    if not len(end) or end.refused[0]:
        raise refused("input-station")
    if end.north != "true":
        raise refused("input-north", {"norths": (end.north, "true")})
    return _smoothed(samples, model, start, end, "survey")


def _smoothed(samples: Samples, model: Model, start: Attitude | None, end: Attitude | None, method: str) -> Attitude:
    buffer, engine = WindowBuffer(model.settings.window), Engine(model, start)
    windows = [bridged(window) for window in (*buffer.push(samples), *buffer.finish())]
    nodes = [engine.advance(window) for window in windows]
    if not nodes:
        if end is not None:
            raise refused("input-few", {"name": "windows", "count": 0, "least": 1})
        return refusals([], (), method, "magnetic" if model.magnetic else "true")
    lam, info, misclosure = np.zeros(STATES), np.zeros((STATES, STATES)), 0.0
    # a misfit in the last window leaves the survey open at its end; a run without any attitude is refused
    opened = nodes[-1].after is None and any(node.after is not None for node in nodes)
    if end is not None and not opened:
        misclosure = _close(nodes[-1], end, model, lam, info)
    rows = [
        _row(node, before, window, engine, lam, info, method)
        for node, before, window in zip(nodes[::-1], [*nodes[-2::-1], None], windows[::-1], strict=True)
    ]
    found = joined(rows[::-1])
    if end is None:
        return found
    if opened:
        bit, said = BITS["misfit"], Finding("motion-not-closed")
    else:
        # standard deviations, root mean square of three
        much = misclosure > 4.0
        bit = BITS["misfit"] if much else 0
        said = Finding("motion-misclosure", {"ratio": misclosure}, severity="warning" if much else "note")
    return replace(found, flags=(found.flags | bit).astype(np.uint32), findings=(*found.findings, said))


def _close(node: Node, end: Attitude, model: Model, lam: Array, info: Array) -> float:
    """The end station as a measurement at the last row; returns the misclosure in standard deviations."""
    from inclinometry.motion.inertial._recursions import backward

    if node.after is None:
        raise refused("input-station")
    late = float(end.time[0] - node.time)
    if abs(late) > model.settings.window:
        values = {"time_s": float(end.time[0]), "off_s": late, "most_s": model.settings.window}
        raise refused("input-station-far", values)
    difference = rotation_log(dcm_from_quaternion(node.after.quaternion) @ dcm_from_quaternion(end.quaternion[0]).T)
    p, tape = node.after.covariance.copy(), Tape(np.zeros((0, 13)), np.zeros((3, 34)), np.zeros(STATES))
    together = p[:3, :3] + end.covariance[0]
    ends = Ends(p, np.zeros(STATES), tape, 0)
    variances, axes = np.linalg.eigh(end.covariance[0])
    for value, axis in zip(variances, axes.T, strict=True):
        ends.measure(np.append(axis, np.zeros(STATES - 3)), float(axis @ difference), float(value), NO_GATE)
    backward(tape.steps, tape.updates, lam, info)
    return float(np.sqrt(difference @ np.linalg.solve(together, difference) / 3.0))


def _row(
    node: Node, before: Node | None, window: Samples, engine: Engine, lam: Array, info: Array, method: str
) -> Attitude:
    """Smoothed row of a window; lam and info go back to the end of the window `before`."""
    from inclinometry.motion.inertial._recursions import backward

    if node.before is None or node.after is None or node.seen is None:
        if node.seen is not None:  # the filter began again with nothing known, not even of the sensors
            lam[:], info[:] = 0.0, 0.0
        return engine.row(node, window, method)
    covariance = node.after.covariance
    state: State = corrected(node.after, -covariance @ lam)
    rest = covariance - covariance @ info @ covariance
    rest = 0.5 * (rest + rest.T)[:3, :3]
    found = row(node.time, state, rest, node.seen, SETTLED, window, engine.model, method)
    tape = blank_tape(len(window))
    reduce_window(node.before, window, node.model, tape)
    turn = error_transition(tape.error)
    lam[:], info[:] = turn.T @ lam, turn.T @ info @ turn
    backward(tape.steps, tape.updates, lam, info)
    if node.restarted:  # what came before tells nothing of this attitude, but of the sensors
        lam[:3], info[:3, :], info[:, :3] = 0.0, 0.0, 0.0
    elif before is not None and before.after is not None:  # errors of an attitude that was linearised again
        turn = np.eye(STATES)
        turn[:3, :3] = dcm_from_quaternion(node.before.quaternion) @ dcm_from_quaternion(before.after.quaternion).T
        lam[:], info[:] = turn.T @ lam, turn.T @ info @ turn
    return found
