"""Attitude by the error-state filter: gyro, gravity and field, or gyro and gravity alone; whole or block by block."""

from __future__ import annotations

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.earth.site import Site
from inclinometry.motion.inertial.state import InertialSettings, Model, State
from inclinometry.motion.inertial.window import (
    LOST,
    MISFIT,
    MOST_REFUSED,
    Observation,
    azimuth_variance,
    initial_state,
    is_moving,
    is_still,
    linearised,
    reduce_window,
    reinitialise_attitude,
    start_from_attitude,
)
from inclinometry.motion.result import BITS, LARGEST_BREAK, METHODS, Attitude, Samples, refusals
from inclinometry.motion.window_filter import WindowStream
from inclinometry.rotations import dcm_from_quaternion
from inclinometry.tabular import check_record

# A state of the filter as a row of the common result: flags and quality.

SETTLED: Final = 2
"""Windows after a start of which the rows are flagged."""


def row(
    time: float,
    state: State,
    covariance: Array,
    seen: Observation,
    age: int,
    window: Samples,
    model: Model,
    method: str,
) -> Attitude:
    """One row; `age` counts windows since the start."""
    quaternion, dip = state.quaternion, float(state.nominal[16])
    covariance = with_gain(quaternion, covariance, dip, model.gain(np.asarray(window.gyro)), model.magnetic)
    covariance = covariance + common(
        quaternion, dip, float(np.sqrt(np.mean(np.asarray(window.gyro)[:, 2] ** 2))), model
    )
    names = _names(state, covariance, seen, age, window, model)
    # least of what uncertainty, field and gravity leave of their limits
    spread = float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    shares = [spread / model.settings.u_limit, 1.0 if seen.gravity < 0.0 else seen.gravity / model.settings.gate]
    if np.isfinite(seen.misfit):
        shares.append(max(seen.misfit / MISFIT - 1.0, seen.refused / MOST_REFUSED))
    return Attitude(
        time=np.array([time]),
        quaternion=quaternion[None] * (1.0 if quaternion[0] >= 0.0 else -1.0),
        covariance=covariance[None],
        rate=np.array([seen.rate]),
        quality=np.array([float(np.clip(1.0 - max(shares), 0.0, 1.0))]),
        flags=np.array([sum(BITS[name] for name in names)], dtype=np.uint32),
        method=np.array([METHODS.index(method)], dtype=np.uint8),
        north="magnetic" if model.magnetic else "true",
    )


def with_gain(quaternion: Array, covariance: Array, dip: float, gain: float, magnetic: bool) -> Array:
    """The covariance (3, 3) of an attitude, what an uncertain gain across the tool does to it added.

    A tilt in the vertical plane of the axis; azimuth from the field follows its tilt about north by tan(dip).
    """
    matrix = dcm_from_quaternion(quaternion)
    axis = matrix[2]
    level = np.hypot(axis[0], axis[1])
    if level == 0.0:
        return covariance
    turn = np.array([-axis[1], axis[0], 0.0]) / level
    if magnetic:
        turn[2] = turn[0] * np.tan(dip)
    tilt = matrix @ turn * (gain * level * axis[2])
    return np.asarray(covariance + np.outer(tilt, tilt))


def common(quaternion: Array, dip: float, speed: float, model: Model) -> Array:
    """Covariance (3, 3) of what is the same in every window of a turning tool: axes askew, clocks out of step.

    A field late by t is turned about the tool axis by `speed` t against gravity: azimuth follows, by what of that turn
    goes east over the horizontal field; a gyro late by t carries the toolface on as far.
    """
    settings, matrix = model.settings, dcm_from_quaternion(quaternion)
    # 0.1 rad/s about the tool axis: above it a tool counts as turning
    turning = speed / np.hypot(speed, 0.1)
    found = np.diag([1.0, 1.0, 0.0]) * (settings.coupling_sigma * turning) ** 2
    late = speed * settings.delay_sigma_s
    found[2, 2] += late**2
    if model.magnetic:
        north, east, down = matrix.T
        field = np.cos(dip) * north + np.sin(dip) * down
        across = np.cross([0.0, 0.0, 1.0], field) @ east / max(np.cos(dip), 1e-6)
        found += np.outer(down, down) * (late * across) ** 2
    return np.asarray(found)


def _names(state: State, covariance: Array, seen: Observation, age: int, window: Samples, model: Model) -> list[str]:
    down = dcm_from_quaternion(state.quaternion)[:, 2]
    told = model.settings.gyro_bias_sigma**2 + 3600.0 * model.settings.gyro_bias_walk**2  # s: an hour of its walk
    fastest = np.abs(np.asarray(window.gyro)).max() * window.interval
    conditions = {
        "clipped": seen.clipped,
        "start": age < SETTLED,
        "disturbed": seen.disturbed,
        # 16.3: a gyro bias as large as that is in one tool of a thousand, so the setting is not this tool's
        "misfit": (not seen.clipped and seen.gravity < 0.0) or bool(np.sum(state.nominal[4:7] ** 2) > 16.3 * told),
        # heave that a window's mean feels more than the sensor's offset and what shaking leaves by chance
        "vibration": seen.slow > max(model.settings.accel_bias_sigma, 3.0 * seen.shaking),
        "drift": (seen.disturbed or not model.magnetic) and not seen.still,
        # azimuth and toolface hardly defined
        "vertical": float(np.hypot(down[0], down[1])) < np.sin(float(np.radians(1.0))),
        "unobservable": float(down @ covariance @ down) > LOST**2,
        "aliased": fastest > 1.5,  # rad between two samples: the integration is no longer trusted
    }
    return [name for name, holds in conditions.items() if holds]


# Windows one after the other: start, gaps, standstills; shared by the streams, the smoother and the survey.

ROUGH: Final = 1.0
"""m/s^2, scatter of a window's mean gravity beyond which shaking is no longer a small error: nothing is said."""


class Node(NamedTuple):
    """A window as the backward pass needs it.

    before, after : states; before is what the forward pass began with, None where there was nothing to begin with; its
        attitude is not that of the window before where it was linearised again.
    again : its attitude does not continue that of the window before. age : windows since the
    start. time : s, of after. model : what the window was reduced with.
    """

    before: State | None
    after: State | None
    seen: Observation | None
    restarted: bool
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
        self._given = False  # the attitude rests on the start that was given
        self._misfits = 0  # windows in a row whose gravity contradicts the filter
        self._slow = np.zeros((4, 4))  # of `Shaking`, kept when the filter begins again
        self._first, self._count = np.nan, 0

    def advance(self, window: Samples) -> Node:
        """The window, reduced."""
        window.need(*(("accel", "gyro", "mag") if self.model.magnetic else ("accel", "gyro")))
        # count on, or begin the grid again at the first stamp of a window that does not continue it
        expected = self._first + window.interval * self._count
        slack = LARGEST_BREAK * window.interval + 4.0 * np.spacing(abs(window.time[0]))
        if not abs(window.time[0] - expected) <= slack:
            self._first, self._count, self._lost, self._seeking = float(window.time[0]), 0, True, False
        self._count += len(window)
        time = self._first + window.interval * (self._count - 1)
        stated = self._start is not None
        state, restarted, model = self._before(window)
        self._start, self._given = None, stated or (self._given and not restarted)  # a restart is of another time
        if state is None:
            return Node(None, None, None, True, 0, time, model)
        if not restarted and is_moving(state, window):
            # linearised again by the window, without a field that is disturbed
            before = state
            state = linearised(before, window, model, model.magnetic)
            after, seen = reduce_window(state, window, model)
            if seen.disturbed:
                state = linearised(before, window, model, False)
                after, seen = reduce_window(state, window, model)
        else:
            after, seen = reduce_window(state, window, model)
        if self._lost and not stated and (seen.disturbed or seen.gravity < 0.0):
            return Node(None, None, None, True, 0, time, model)  # no beginning to build on; the next window may be one
        self._age = 0 if self._lost else self._age + 1
        self._misfits = self._misfits + 1 if seen.gravity < 0.0 else 0
        self._state, self._lost = after, False
        rough = seen.shaking > ROUGH
        if rough or self._misfits >= 3 or (self._misfits and self._age < SETTLED and not self._given):
            # a filter that gravity contradicts three times in a row is wrong, however sure it is: begin again
            self._state, self._lost, self._slow = None, True, after.shaking.slow
            return Node(None, None, seen, True, 0, time, model)
        return Node(state, after, seen, restarted, self._age, time, model)

    def row(self, node: Node, window: Samples, method: str) -> Attitude:
        """The forward pass's row."""
        if node.after is None or node.seen is None:
            north = "magnetic" if self.model.magnetic else "true"
            why = "clipped" if window.clipped is not None and window.clipped.any() else "misfit"
            why = "vibration" if node.seen is not None and node.seen.shaking > ROUGH else why
            return refusals([node.time], (why, "start"), method, north)
        covariance = node.after.covariance[:3, :3]
        return row(node.time, node.after, covariance, node.seen, node.age, window, self.model, method)

    def _before(self, window: Samples) -> tuple[State | None, bool, Model]:
        """State before the window (None: nothing to start from), whether its attitude is a new one, and the model."""
        model, restarted, sought_before = self.model, self._lost, self._seeking
        state = self._state
        if state is None:
            state = initial_state(window, model)
            state = replace(state, shaking=state.shaking._replace(slow=self._slow))
        clipped = window.clipped is not None and bool(window.clipped.any())
        stated = self._start is not None
        if self._start is not None:
            state = start_from_attitude(state, window, self._start, model)
            restarted = False
        elif self._lost and clipped:
            return None, True, model
        self._seeking = False
        if not model.magnetic and (restarted or azimuth_variance(state) > LOST**2):
            self._seeking = is_still(state, window, model, np.zeros(len(window), np.bool_)) and not clipped
            model = replace(model, blind=not self._seeking)
            restarted = restarted or (
                self._seeking and not sought_before
            )  # later windows of the standstill add to the first
        if restarted:
            state = reinitialise_attitude(state, window, model)
        if restarted or stated:
            return linearised(state, window, model, model.magnetic), True, model
        return state, False, model


class _Stream(WindowStream):
    def __init__(self, model: Model, start: Attitude | None, method: str) -> None:
        engine, nothing = Engine(model, start), refusals([], (), method, "magnetic" if model.magnetic else "true")
        super().__init__(
            model.settings.window, lambda window: engine.row(engine.advance(window), window, method), nothing
        )


class InertialStream(_Stream):
    """`inertial_attitude` fed block by block; the same rows to the last bit."""

    def __init__(
        self, settings: InertialSettings | None = None, site: Site | None = None, start: Attitude | None = None
    ) -> None:
        super().__init__(Model(settings or InertialSettings(), site or Site(), True), start, "filter")


class GyroStream(_Stream):
    """`gyro_attitude` fed block by block; the same rows to the last bit."""

    def __init__(
        self, settings: InertialSettings | None = None, site: Site | None = None, start: Attitude | None = None
    ) -> None:
        super().__init__(Model(settings or InertialSettings(), site or Site(), False), start, "gyro")


def inertial_attitude(
    samples: Samples,
    settings: InertialSettings | None = None,
    site: Site | None = None,
    start: Attitude | None = None,
) -> Attitude:
    """Attitude of a turning, shaking tool from gyro, accelerometers and magnetometer: 15-state error-state filter.

    Parameters
    ----------
    samples : Samples
        With `accel`, `mag` and `gyro`. Where `clipped` is set field and gravity are not used (gravity for the whole
        window: its mean would be biased) and the rate before is held.
    settings : InertialSettings, optional
        What the sensors' errors may be; the covariance is no better than these.
    site : Site, optional
        Gravity (without it the vertical component of the accelerometers is not used), dip and flux density of the
        reference field (without them: from the first window), latitude and declination for the Earth rate (without a
        latitude: none).
    start : Attitude, optional
        Its last row, of the time of the first sample. Without it the first window's gravity and field are taken.

    Returns
    -------
    Attitude
        A row at the last sample of each window, method "filter", north "magnetic". The covariance is that of the
        linearised filter for independent errors of the stated sizes, plus `gain_sigma` and `ripple_sigma`; a magnetic
        disturbance from outside that stays below the gate is not in it. After a gap the attitude starts again, what was
        learnt of the sensors is kept.

    Raises
    ------
    InputError
        Missing triads; a start of another north or time.
    IdentifiabilityError
        Field and gravity parallel in the window that it would start from.

    Notes
    -----
    Errors: attitude e (dcm = (1 + [e x]) true dcm), gyro bias and scale, accelerometer bias, hard iron; as a sixteenth,
    the reference's dip. A step is exact: e' = exp(-[w dt x]) e + dt (bias + rate x scale) by the trapezoid; with a
    first-order transition the covariance grows by 1 + (w dt)^2 a step and overflows while the tool spins. Every sample
    measures the field,
    in turn along east and across the field in the meridian (its strength is left out: it says little of attitude and
    its reference errs); every window measures gravity: apparent gravity is turned into north, east, down by the
    strapdown attitude and averaged with a Hann taper, of which vibration and lever arm, second derivatives of a bounded
    position, leave next to nothing. The attitude error during the window follows from that at its end and from bias and
    scale, whose integrals are kept. The noise is what tapers of 2 and 3 turns a window show beside zero frequency, less
    what a lever arm, fitted to them, explains.

    Solà J., "Quaternion kinematics for the error-state Kalman filter", 2017,
    arXiv:1711.02508, for the error state; Bierman (1977) for sequential updates.

    Examples
    --------
    One turn a second for 20 s, 30 deg from vertical:

    >>> import numpy as np
    >>> from inclinometry.rotations import dcm
    >>> time = np.arange(2000) / 100.0
    >>> turned = dcm(np.radians(60.0), np.radians(30.0), 2.0 * np.pi * time)
    >>> dip = np.radians(65.0)
    >>> run = Samples(time, 0.01, accel=turned @ [0, 0, 9.81], mag=turned @ [5e4 * np.cos(dip), 0.0, 5e4 * np.sin(dip)],
    ...               gyro=np.tile([0.0, 0.0, 2.0 * np.pi], (2000, 1)))
    >>> rows = inertial_attitude(run)
    >>> np.degrees(rows.angles.inclination).round(3), np.degrees(rows.angles.azimuth).round(3)
    (array([30., 30., 30., 30.]), array([60., 60., 60., 60.]))
    """
    check_record(samples, Samples, "inertial_attitude")
    return InertialStream(settings, site, start).whole(samples)


def gyro_attitude(
    samples: Samples,
    settings: InertialSettings | None = None,
    site: Site | None = None,
    start: Attitude | None = None,
) -> Attitude:
    """Attitude from gyro and accelerometers alone, azimuth from a start or from the Earth rate at standstill.

    Parameters
    ----------
    samples : Samples
        With `accel` and `gyro`; a magnetometer is not looked at.
    settings : InertialSettings, optional
    site : Site, optional
        Its latitude: without it there is no north in a gyro, and the Earth rate is taken for bias.
    start : Attitude, optional
        Its last row, of the time of the first sample, north "true". Without it azimuth is sought in every standstill
        until it is found; how well, depends on `gyro_bias_sigma`: u = bias / (Earth rate x cos latitude).

    Returns
    -------
    Attitude
        A row at the last sample of each window, method "gyro", north "true". Flag "drift" while the tool moves: azimuth
        then rests on the gyro since its last standstill. Flag "unobservable" where azimuth is not known to 0.26 rad:
        the filter is linear and would not be right about more.

    Raises
    ------
    InputError
        Missing triads; a start of another north or time.

    Notes
    -----
    As `inertial_attitude` without the field. In a window in which nothing but the Earth moves the tool the attitude is
    held and the mean rate measures bias + Earth rate, so that no sample counts as motion and as measurement. Between
    standstills gravity observes the drift about all directions but the vertical.

    Examples
    --------
    Standing at 50 deg north, 30 deg from vertical, azimuth 60 deg, a gyro with errors of 0.01 deg/h; the level's
    uncertainty, 0.02 m/s^2 of accelerometer bias, is what limits the azimuth:

    >>> import numpy as np
    >>> from inclinometry.rotations import dcm
    >>> from inclinometry.earth.rate import earth_rate
    >>> site = Site(latitude=np.radians(50.0), g=9.81)
    >>> matrix = dcm(np.radians(60.0), np.radians(30.0), np.radians(100.0))
    >>> still = Samples(np.arange(1000) / 50.0, 0.02, accel=np.tile(matrix @ [0, 0, 9.81], (1000, 1)),
    ...                 gyro=np.tile(matrix @ earth_rate(site.latitude), (1000, 1)))
    >>> settings = InertialSettings(gyro_bias_sigma=5e-8, gyro_bias_walk=0.0, gyro_noise=1e-8)
    >>> rows = gyro_attitude(still, settings, site)
    >>> [float(np.degrees(x[-1]).round(2)) for x in (rows.angles.azimuth, rows.u.azimuth)]
    [60.0, 0.28]
    """
    check_record(samples, Samples, "gyro_attitude")
    return GyroStream(settings, site, start).whole(samples)
