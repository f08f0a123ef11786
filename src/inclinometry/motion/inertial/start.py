"""The attitude a filter starts from: out of the first window's gravity and field or Earth rate, or as given."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from inclinometry.attitude.rotations import (
    dcm,
    dcm_from_quaternion,
    quaternion_exp,
    quaternion_from_dcm,
    quaternion_multiply,
)
from inclinometry.attitude.wahba import solve_triad
from inclinometry.core.arrays import Array
from inclinometry.core.errors import IdentifiabilityError, InputError
from inclinometry.motion.inertial.settings import DIP_SIGMA
from inclinometry.motion.inertial.state import NOMINAL, STATES, Model, Shaking, State, blank_tape, corrected
from inclinometry.motion.inertial.window import filter_window, hann_mean
from inclinometry.motion.result import Attitude
from inclinometry.motion.samples import Samples
from inclinometry.uncertainty.propagation import UNKNOWN

TILT: Final = 0.3
"""rad, uncertainty beforehand of a tilt that the first window is only linearised at, not yet measured with."""
PASSES: Final = 3
"""Times the first window is linearised again at what its backward pass found: scale x turns bends the first one."""
BENT: Final = 0.2
"""rad that the scale's uncertainty may turn the end of the part of the first window that is looked at first."""
SHORTEST: Final = 64
"""Samples of that part, at least."""
GROWTH: Final = 4
"""Factor by which that part then grows."""
STRAIGHT: Final = 0.02
"""rad that bias and scale, as far as they are not known, may turn a window before it is linearised again: the square
of it, halved, is what a linear filter neglects."""
OPEN: Final = 1e6
"""Gate while a start is sought, squared normalised innovation."""
STATED_DIP: Final = float(np.radians(0.2))
"""Standard uncertainty of a dip that is given without one, rad."""


def blank(window: Samples, model: Model) -> State:
    """Nothing known but what the settings and the site say."""
    site = model.site
    dip_sigma = DIP_SIGMA if site.dip is None else (STATED_DIP if site.dip_sigma is None else site.dip_sigma)
    nominal = np.zeros(NOMINAL)
    nominal[0] = 1.0
    nominal[16] = 0.0 if site.dip is None else site.dip
    strength = 0.0
    if model.magnetic:
        strength = float(np.sqrt(np.mean(np.sum(np.asarray(window.mag) ** 2, axis=1)))) if site.b is None else site.b
    covariance = model.settings.prior(np.eye(3), dip_sigma)
    gyro = np.asarray(window.gyro)
    return State(nominal, covariance, np.zeros(STATES), gyro[0].copy(), strength, 0.0, unshaken(model), np.zeros(3))


def unshaken(model: Model) -> Shaking:
    """Before the first window."""
    settings = model.settings
    information = np.eye(3) / max(settings.lever_sigma, 1e-6) ** 2
    return Shaking(np.zeros(3), np.zeros((2, 2)), np.array(settings.lever_arm, dtype=np.float64), information, 0, 0)


def sought(state: State, window: Samples, model: Model) -> State:
    """The state with its attitude found anew from a window, and that of the sample before it.

    Magnetic: gravity and field averaged in the almost-inertial frame. Otherwise gravity, and azimuth by the rate that a
    standing tool reads or, where the model is blind, none; how good it is, is left to the measurements to judge.

    Raises
    ------
    IdentifiabilityError
        Field and gravity parallel.
    """
    window = beginning(window, model)
    gravity = hann_mean(state, window, np.asarray(window.accel))
    if model.magnetic:
        field = hann_mean(state, window, np.asarray(window.mag) - state.nominal[13:16])
        if model.site.dip is None:
            cosine = gravity @ field
            dip = float(np.arctan2(cosine, np.linalg.norm(np.cross(gravity, field))))
            nominal = state.nominal.copy()
            nominal[16] = dip
            state = replace(state, nominal=nominal)
        dip = float(state.nominal[16])
        matrix = solve_triad([gravity, field], [[0, 0, 1.0], [np.cos(dip), 0.0, np.sin(dip)]], [1.0, 1.0]).dcm
        attitude = np.eye(3)
    else:
        matrix = _level(gravity) if model.blind else _north(state, window, gravity, model)
        attitude = matrix @ np.diag([TILT**2, TILT**2, UNKNOWN**2]) @ matrix.T
    return placed(state, quaternion_from_dcm(matrix), attitude, np.asarray(window.gyro)[0])


def placed(state: State, quaternion: Array, attitude: Array, last: Array) -> State:
    """The state with another attitude of covariance (3, 3), independent of the rest; `last` sample of the gyro."""
    nominal, covariance, offset = state.nominal.copy(), state.covariance.copy(), state.offset.copy()
    nominal[:4] = quaternion
    covariance[:3, :], covariance[:, :3], offset[:3] = 0.0, 0.0, 0.0
    covariance[:3, :3] = attitude
    return replace(state, nominal=nominal, covariance=covariance, offset=offset, last=last.copy(), axis=np.zeros(3))


def given(state: State, window: Samples, start: Attitude, model: Model) -> State:
    """The state at a stated attitude (its last row) of the first sample, taken one step back to the one before it.

    Raises
    ------
    InputError
        A row that was refused, counted from another north, or of another time.
    """
    north = "magnetic" if model.magnetic else "true"
    if not len(start) or start.refused[-1]:
        raise InputError("the start attitude has no row with an attitude; give one that was measured")
    if start.north != north:
        raise InputError(f"the start's azimuth counts from {start.north} north; this filter needs {north}: convert it")
    late = float(window.time[0] - start.time[-1])
    if abs(late) > model.settings.window:
        raise InputError(
            f"the start attitude is of {start.time[-1]:.6g} s, {late:.3g} s before the first sample; allowed are "
            f"{model.settings.window:g} s either way"
        )
    first = np.asarray(window.gyro)[0]
    rate = first * (1.0 - state.nominal[7:10]) - state.nominal[4:7]
    back = quaternion_multiply(quaternion_exp(rate * window.interval), start.quaternion[-1])
    return placed(state, back, start.covariance[-1], first)


def beginning(window: Samples, model: Model) -> Samples:
    """So much of a window that an unknown scale has not yet turned its end far from its beginning."""
    turned = np.cumsum(np.linalg.norm(np.asarray(window.gyro), axis=1)) * window.interval
    size = int(np.searchsorted(turned * max(model.settings.gyro_scale_sigma, 1e-9), BENT))
    return window.part(0, min(max(size, SHORTEST), len(window)))


def bent(state: State, window: Samples) -> bool:
    """Whether what is not known of bias and scale turns the tool too far in a window for the filter to be linear.

    After a standstill the bias is known and the scale is not: the first window that turns shows it, from the start.
    """
    gyro, p = np.asarray(window.gyro), state.covariance
    angle, elapsed = (
        np.cumsum(gyro, axis=0) * window.interval,
        np.arange(1.0, len(gyro) + 1.0)[:, None] * window.interval,
    )
    by_bias, both, by_scale = (np.diag(p[i : i + 3, j : j + 3]) for i, j in ((3, 3), (3, 6), (6, 6)))
    return bool(np.max(elapsed**2 * by_bias + 2.0 * elapsed * angle * both + angle**2 * by_scale) > STRAIGHT**2)


def linearised(state: State, window: Samples, model: Model, with_field: bool) -> State:
    """The same beliefs, linearised at what the window makes of its beginning: first a part of it, then the whole."""
    from inclinometry.motion.inertial._recursions import backward

    # nothing is surprising yet: what is refused now would be refused for ever
    model = replace(model, settings=replace(model.settings, gate=OPEN, weight=None))
    size = len(beginning(window, model))
    while True:
        part = window.part(0, size)
        for _ in range(PASSES):
            tape = blank_tape(size)
            seen = filter_window(state, part, model, with_field, tape)[1]
            lam, info = np.zeros(STATES), np.zeros((STATES, STATES))
            backward(tape.steps, tape.updates, lam, info)
            state = corrected(state, state.offset - state.covariance @ lam)
            if with_field:
                state = replace(state, field_variance=seen.noise)
        if size == len(window):
            return state
        size = min(GROWTH * size, len(window))


def _north(state: State, window: Samples, gravity: Array, model: Model) -> Array:
    """Matrix of a tool that stands, from gravity and the rate it reads."""
    rate = (np.asarray(window.gyro) * (1.0 - state.nominal[7:10])).mean(axis=0) - state.nominal[4:7]
    try:
        return solve_triad([gravity, rate], np.stack([[0.0, 0.0, 1.0], model.spin]), [1.0, 1.0]).dcm
    except (IdentifiabilityError, InputError):  # no latitude, or the rate is along gravity: any azimuth will do
        return _level(gravity)


def _level(gravity: Array) -> Array:
    """Matrix of a tool at azimuth 0 (toolface 0 when it hangs) that sees gravity so."""
    g = gravity / np.linalg.norm(gravity)
    inclination = np.arctan2(np.hypot(g[0], g[1]), g[2])
    return dcm(0.0, inclination, np.arctan2(g[1], -g[0]))


def azimuth_variance(state: State) -> float:
    """rad^2, about the vertical."""
    down = dcm_from_quaternion(state.quaternion)[:, 2]
    return float(down @ state.covariance[:3, :3] @ down)
