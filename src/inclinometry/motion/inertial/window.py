"""One window of the filter: strapdown and field sample by sample, then gravity, standstill and stations at its end."""

from __future__ import annotations

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inclinometry.attitude.rotations import cross_matrix, dcm_from_quaternion
from inclinometry.core.arrays import Array, Mask
from inclinometry.motion.inertial.gravity import MEMORY, measure_gravity, tapers
from inclinometry.motion.inertial.model import Model
from inclinometry.motion.inertial.state import STATES, Shaking, State, corrected
from inclinometry.motion.inertial.tape import NO_GATE, NO_TAPE, Ends, Tape
from inclinometry.motion.samples import Samples

MOST_REFUSED: Final = 0.05
"""Share of field samples beyond the gate from which a window's field counts as disturbed."""
MISFIT: Final = 1.5
"""Mean squared normalised innovation of the field, 1 where nothing disturbs it, from which it does too."""
SLOW: Final = 30
"""Windows over which the direction of the tool is averaged for `_field`."""
HELD: Final = 0.2
"""rad/s, how far the rate may have moved while an unusable sample of the gyro was bridged."""


class Seen(NamedTuple):
    """What a window tells besides the state: for flags and quality.

    rate : rad/s, mean about the tool axis.
    still : held as a standstill.
    clipped : gravity left out for it.
    refused : share of field samples beyond the gate, NaN where none was used.
    misfit : mean squared normalised innovation of the field, NaN where none was used.
    noise : nT^2, variance of the field's samples by their second differences.
    disturbed : the field was left out.
    gravity : largest squared normalised innovation of gravity, negative when it was refused.
    shaking : m/s^2, what shaking leaves in a mean of the window, as far as known.
    """

    rate: float
    still: bool
    clipped: bool
    refused: float
    misfit: float
    noise: float
    disturbed: bool
    gravity: float
    shaking: float


def reduce_window(state: State, window: Samples, model: Model, tape: Tape = NO_TAPE) -> tuple[State, Seen]:
    """State at the last sample of the window from that at the sample before the first.

    A window whose field contradicts what was known by more than its noise is gone through again without the field: as
    many samples would soon have persuaded the filter.
    """
    done, seen = filter_window(state, window, model, model.magnetic, tape)
    if not (seen.refused > MOST_REFUSED or seen.misfit > MISFIT):
        return done, seen
    without, other = filter_window(state, window, model, False, tape)
    return without, seen._replace(disturbed=True, gravity=other.gravity, rate=other.rate)


def filter_window(
    state: State, window: Samples, model: Model, with_field: bool, tape: Tape = NO_TAPE
) -> tuple[State, Seen]:
    """`reduce_window` with the field or without it, whatever comes of it."""
    from inclinometry.motion.inertial import _recursions as kernels

    bad = np.zeros(len(window), np.bool_) if window.clipped is None else window.clipped
    gyro = np.asarray(window.gyro)
    still = is_still(state, window, model, bad)
    nominal, p, x = state.nominal.copy(), state.covariance.copy(), state.offset.copy()
    last = gyro[-1].copy() if not bad[-1] else state.last.copy()
    fed, before = gyro, state.last.copy()
    if still:
        before = nominal[4:7] / (1.0 - nominal[7:10])  # corrected: no rotation against the Earth at all
        fed = np.broadcast_to(before, gyro.shape).copy()
    sums = np.zeros(kernels.SUMS)
    kernels.forward(
        fed,
        np.asarray(window.accel),
        np.asarray(window.mag) if with_field else np.zeros((0, 3)),
        _marks(bad, with_field, still),
        tapers(len(window), window.interval),
        _constants(state, window.interval, model, still),
        nominal,
        p,
        x,
        before,
        sums,
        tape.steps,
        tape.updates,
    )
    ends = Ends(p, x, tape, len(window))
    clipped = bool(bad.any())
    level, shaking = -1.0, state.shaking
    if not clipped:
        level, shaking = measure_gravity(shaking, nominal, sums, window, model, ends)
    if still:
        _standstill(nominal, gyro.mean(axis=0), window.interval * len(window), model, ends)
    done = replace(
        state,
        nominal=nominal,
        covariance=0.5 * (p + p.T),
        offset=x,
        last=last,
        shaking=shaking,
    )
    seen = _seen(sums[kernels.COUNTS :], len(window), still, clipped, level, state, shaking)
    done = replace(done, field_variance=state.field_variance + (seen.noise - state.field_variance) / MEMORY)
    if len(tape.steps):
        tape.error[:] = x
    done = corrected(done, x)
    axis = dcm_from_quaternion(done.quaternion)[2]
    return replace(done, axis=axis if not state.axis.any() else state.axis + (axis - state.axis) / SLOW), seen


def _seen(counts: Array, size: int, still: bool, clipped: bool, level: float, state: State, shaking: Shaking) -> Seen:
    """Of a window, from what the loop counted."""
    used, refused = counts[0], counts[1]
    return Seen(
        rate=float(counts[5]) / size,
        still=still,
        clipped=clipped,
        refused=refused / (used + refused) if used + refused else np.nan,
        misfit=counts[2] / used if used else np.nan,
        noise=counts[6] / counts[7] if counts[7] else state.field_variance,
        disturbed=False,
        gravity=level,
        shaking=float(np.sqrt(np.max(shaking.scatter))) if shaking.windows else 0.0,
    )


def hann_mean(state: State, window: Samples, vectors: Array) -> Array:
    """Hann mean (3,) of vectors (n, 3) in the axes the tool had before the window, turned back by the gyro alone."""
    from inclinometry.motion.inertial import _recursions as kernels

    nominal = np.zeros(len(state.nominal))
    nominal[0], nominal[4:10] = 1.0, state.nominal[4:10]
    constants = np.zeros(28)
    constants[0] = window.interval
    sums, nothing, zero = np.zeros(kernels.SUMS), np.zeros((STATES, STATES)), np.zeros(STATES)
    marks, weights = np.zeros(len(window), np.uint8), tapers(len(window), window.interval)
    first = np.asarray(window.gyro)[0].copy()
    gyro, blank = np.asarray(window.gyro), NO_TAPE[:2]
    kernels.forward(gyro, vectors, vectors, marks, weights, constants, nominal, nothing, zero, first, sums, *blank)
    return sums[:3].copy()


def is_still(state: State, window: Samples, model: Model, bad: Mask) -> bool:
    """Whether nothing but the Earth moves the tool: rate, its scatter and that of the accelerometers are small."""
    settings = model.settings
    if bad.any():
        return False
    gyro, accel = np.asarray(window.gyro), np.asarray(window.accel)
    middle = len(window) // 2
    if np.linalg.norm(gyro.mean(axis=0) - state.nominal[4:7]) > settings.still_rate:
        return False
    if gyro.std(axis=0).max() > settings.still_rate:
        return False
    scatter = accel.std(axis=0).max()
    moved = np.abs(accel[:middle].mean(axis=0) - accel[middle:].mean(axis=0)).max()
    return bool(scatter <= settings.still_accel and moved <= 6.0 * 2.0 * scatter / np.sqrt(len(window)) + 1e-9)


def _marks(bad: Mask, magnetic: bool, still: bool) -> NDArray[np.uint8]:
    """Bits of the kernel: 1 use the field, 2 hold the gyro."""
    marks = np.where(bad, 0 if still else 2, 1 if magnetic else 0)
    return marks.astype(np.uint8)


def _constants(state: State, interval: float, model: Model, still: bool) -> Array:
    settings = model.settings
    head = [
        interval,
        *(0.0 * model.spin if still else model.spin * interval),
        state.strength,
        max(settings.mag_noise**2, state.field_variance),
        settings.gate,
        (HELD * interval) ** 2,
        *settings.step_variances(interval, settings.creep if still else model.gyro_noise),
        0.0 if still else 1.0,
        *(state.axis if state.axis.any() else dcm_from_quaternion(state.quaternion)[2]),
    ]
    return np.array(head)


def _standstill(nominal: Array, rate: Array, seconds: float, model: Model, ends: Ends) -> None:
    """The mean rate of a held tool is bias and Earth rate: 0 = rate (1 - scale) - bias - Earth rate."""
    earth = dcm_from_quaternion(nominal[:4]) @ model.spin
    residual = rate * (1.0 - nominal[7:10]) - nominal[4:7] - earth
    rows = np.zeros((3, STATES))
    rows[:, :3], rows[:, 3:6], rows[:, 6:9] = cross_matrix(earth), -np.eye(3), -np.diag(rate)
    variance = model.gyro_noise**2 / seconds
    for row, value in zip(rows, residual, strict=True):
        ends.measure(row, float(value), variance, NO_GATE)
