"""One window of the filter: strapdown and field sample by sample, then gravity, standstill and stations at its end."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array, Mask, frozen
from inclinometry.constants import EARTH_RATE
from inclinometry.errors import IdentifiabilityError, InputError, refused
from inclinometry.motion.inertial.state import (
    NO_GATE,
    NO_TAPE,
    NOMINAL,
    STATES,
    Model,
    Shaking,
    State,
    Tape,
    blank_tape,
    corrected,
)
from inclinometry.motion.reference import dip_sigma
from inclinometry.motion.result import Attitude, Samples
from inclinometry.rotations import (
    cross_matrix,
    dcm,
    dcm_from_quaternion,
    quaternion_exp,
    quaternion_from_dcm,
    quaternion_multiply,
)
from inclinometry.uncertainty import UNKNOWN
from inclinometry.wahba import solve_triad


class Ends:
    """Measurements at the end of a window, put on the tape after its samples."""

    def __init__(self, p: Array, x: Array, tape: Tape, size: int) -> None:
        self._p, self._x, self._tape, self._next = p, x, tape, size
        self._taped = len(tape.updates) > 0

    def measure(self, h: Array, z: float, variance: float, gate: float) -> float:
        from inclinometry.motion.inertial._recursions import measure

        row = self._tape.updates[self._next] if self._taped else np.empty(34)
        self._next += 1
        return float(measure(h, z, variance, gate, self._p, self._x, row))

    def innovation(self, h: Array, z: float) -> tuple[float, float]:
        """Of a measurement without noise, and its variance, before anything is done."""
        return float(z - h @ self._x), float(h @ self._p @ h)

    def widen(self, variance: Array, slope: float, most: float) -> None:
        """Add covariance (3, 3) to that of the attitude, and `slope` times as much to the bias's, up to `most`."""
        self._p[:3, :3] += variance
        self._p[3:6, 3:6] += variance * min(slope, most / max(float(np.trace(variance)), 1e-300))


# A window's gravity: its mean through a taper in the almost-inertial frame, and the noise shaking leaves in it.

MEMORY: Final = 10
"""Windows over which the noise that shaking leaves in gravity is averaged."""
ANY: Final = 1e6
"""Gate, in variances, of a window that is only linearised at."""
FREE: Final = 10 / 3.0
"""Degrees of freedom of that noise in one window and direction: 4 tapers in 3 directions less the lever arm."""


@lru_cache(maxsize=32)
def tapers(size: int, interval: float) -> Array:
    """Hann taper (sum 1), the taper times cosine and sine of 2 and 3 turns, and their second derivatives (n, 10).

    All of them and their slopes vanish at both ends, so that a bounded position shows in them only by its product with
    the second derivative.
    """
    phase = 2.0 * np.pi * (np.arange(size) + 0.5) / size
    scale = (2.0 * np.pi / (size * interval)) ** 2
    found = [(1.0 - np.cos(phase)) / size]
    bends = [np.cos(phase) / size * scale]
    # turns a window that see noise beside zero frequency; below 2 they would see gravity
    for turns in (2, 3):
        for wave in (np.cos, np.sin):
            parts = [(turns, 1.0), (turns - 1, -0.5), (turns + 1, -0.5)]
            found.append(sum((weight * wave(n * phase) for n, weight in parts), np.zeros(size)) / size)
            bends.append(sum((-scale * n * n * weight * wave(n * phase) for n, weight in parts), np.zeros(size)) / size)
    return frozen(np.ascontiguousarray(np.stack([*found, *bends], axis=1)))


def update_vibration(before: Shaking, tapered: Array, sensitivity: Array, floor: float) -> Shaking:
    """Vibration and lever arm from the tapers that gravity does not reach.

    Parameters
    ----------
    tapered : (4, 3); sensitivity : (4, 3, 3), their slopes by the lever arm.
    floor : variance of the Hann mean without any vibration.
    """
    residual = tapered - sensitivity @ before.lever
    own = 2.0 * np.mean(residual**2, axis=0)
    # a tool that stood still and now shakes: what it was like before tells nothing
    # its 10 degrees of freedom do so by chance once in a million windows
    restarted = not before.windows or bool(np.mean(own / np.maximum(before.scatter, floor)) > 6.0)
    count = 1 if restarted else before.level + 1
    scatter, bands = own if restarted else before.scatter, before.bands
    lever, information = before.lever, before.information
    for _ in range(3 if restarted else 1):  # the first window finds both from nothing
        weight = 1.0 / np.maximum(0.5 * scatter, 0.5 * floor)
        information = before.information + np.einsum("mni,n,mnj->ij", sensitivity, weight, sensitivity)
        step = np.linalg.solve(information, np.einsum("mni,n,mn->i", sensitivity, weight, residual))
        left = residual - sensitivity @ step
        seen = 2.0 * np.sum(left**2, axis=0) / FREE
        lever = before.lever + step
        scatter = seen if count == 1 else before.scatter + (seen - before.scatter) / min(count, MEMORY)
        square = (left**2).reshape(2, -1, 3).mean(axis=1)
        apart = np.stack([square[:, :2].mean(axis=1), square[:, 2]], axis=1)
        bands = apart if count == 1 else before.bands + (apart - before.bands) / min(count, MEMORY)
    return Shaking(scatter, bands, lever, information, before.windows + 1, count, before.slow)


def mean_weights(shaking: Shaking) -> Array:
    """Shares (3,) of the scatter that a mean feels, north, east, down.

    What shakes about a fixed place has no mean acceleration: its spectrum falls towards zero frequency, and is taken
    to do so as a + c f^2 through both bands (4 1/3 and 9 1/3 squared turns a window; the mean has 1/3), the more
    firmly the more windows were seen.
    """
    low, high = shaking.bands
    middle = np.maximum(0.5 * (low + high), 1e-300)
    seen = min(shaking.level, MEMORY)
    least_share = 0.15  # of the noise beside zero frequency that is always taken to reach zero
    share = np.clip(1.0 - 1.3 * seen / (seen + 1.0) * (high - low) / middle, least_share, 1.0)
    return np.asarray(share[[0, 0, 1]])


def measure_gravity(
    shaking: Shaking, nominal: Array, sums: Array, window: Samples, model: Model, ends: Ends
) -> tuple[float, Shaking]:
    """Apparent gravity through the Hann taper, put into the filter.

    Largest squared normalised innovation, negative when one was beyond the gate, and the shaking as now known. With
    psi the attitude error in north, east, down, the mean of c' a is g + g x psi_mean - mean(c') d(bias), and psi_mean
    = psi_end - D (bias, scale), D the drift from mean to end that the loop has summed.
    """
    from inclinometry.motion.inertial import _recursions as kernels

    settings, g = model.settings, model.gravity
    kept = sums[: kernels.DRIFT].reshape(-1, 12)
    half = len(kept) // 2
    # a lever arm accelerates by the second derivative of c' r; by parts, twice, that falls on the taper
    levers = -kept[half:, 3:].reshape(-1, 3, 3)
    shaking = update_vibration(shaking, kept[1:half, :3], levers[1:], _white(len(window), model))
    matrix, cross = dcm_from_quaternion(nominal[:4]), g * cross_matrix([0.0, 0.0, 1.0])
    rows = np.zeros((3, STATES))
    rows[:, :3] = cross @ matrix.T
    rows[:, 3:9] = -cross @ sums[kernels.DRIFT : kernels.COUNTS].reshape(3, 6)
    rows[:, 9:12] = -kept[0, 3:].reshape(3, 3)
    residual = kept[0, :3] - levers[0] @ shaking.lever - [0.0, 0.0, g]
    variance = _variance(shaking, levers[0], float(matrix[2, 2]), window, model)
    count = 3 if model.site.gravity is not None else 2
    expected = np.array([ends.innovation(rows[i], residual[i]) for i in range(count)])
    if settings.weight is not None:
        t = expected[:, 0] / np.sqrt(expected[:, 1] + variance[:count])
        variance[:count] /= np.maximum(settings.weight(t), 1e-12)
    spread = expected[:, 1] + variance[:count]
    known = slow_acceleration_variance(shaking.slow, matrix[2])
    refused = bool((expected[:, 0] ** 2 > settings.gate * (spread + known[:count])).any())
    found = known
    if settings.gate < ANY:  # what is only linearised at is not surprising
        shaking = shaking._replace(
            slow=_update_slow_variance(shaking, expected[:, 0], spread, matrix[2, :count], window, model)
        )
        found = slow_acceleration_variance(shaking.slow, matrix[2])
    # the windows before were believed too much by the same acceleration; that to the north tilts about east
    fresh = np.where(known == 0.0, found, 0.0) / g**2
    # and a straight line through so many of them gave the bias, by rate / tilt
    slope = 12.0 / max(float(shaking.slow[3, 0]), 1.0) ** 3 / (len(window) * window.interval) ** 2
    ends.widen(matrix @ np.diag([fresh[1], fresh[0], 0.0]) @ matrix.T, slope, settings.gyro_bias_sigma**2)
    known = found
    taken = [ends.measure(rows[i], float(residual[i]), variance[i] + known[i], settings.gate) for i in range(count)]
    return (-1.0 if refused or min(taken) < 0.0 else max(taken)), shaking


def _update_slow_variance(
    shaking: Shaking, innovation: Array, spread: Array, axis: Array, window: Samples, model: Model
) -> Array:
    """`slow` of `Shaking` after another window's innovations of gravity (2 or 3) of variance `spread`."""
    count = len(axis)
    along = axis / max(float(axis @ axis), 1e-3)
    square = np.append(innovation, along @ innovation) ** 2
    scatter = shaking.scatter[:count] * mean_weights(shaking)[:count]
    scatter = np.where(scatter > _white(len(window), model), scatter, 0.0)
    scatter, spread = np.append(scatter, along**2 @ scatter), np.append(spread, along**2 @ spread)
    # of Student's square with the freedom of a variance that is partly estimated the normal one of the same chance
    # (Wallace, Annals of Mathematical Statistics 30, 1959)
    free = FREE * min(shaking.level, MEMORY) * (spread / np.maximum(scatter, 1e-6 * spread)) ** 2
    normal = ((8.0 * free + 1.0) / (8.0 * free + 3.0)) ** 2 * free * np.log1p(square / spread / free)
    seen = np.zeros((4, 4))
    seen[:, [*range(count), 3]] = normal, (square - spread) / spread**2, 1.0 / spread**2, np.ones(count + 1)
    return np.asarray((1.0 - 1.0 / (2 * MEMORY)) * shaking.slow + seen)


def slow_acceleration_variance(slow: Array, axis: Array) -> Array:
    """Variance (3,) of a window's gravity by accelerations slower than the window: `slow` of `Shaking`, where it shows.

    It does, along north, east, down or the tool's axis (its direction is given), where the mean square, 1 expected,
    exceeds that by 2.5 of its standard deviations, sqrt(2 / windows), and by more in the first windows, whose square
    has a long tail: by chance in about one window of a hundred.
    """
    windows = np.maximum(slow[3], 1e-9)
    shows = slow[0] / windows > 1.0 + (2.5 + 3.0 / windows) * np.sqrt(2.0 / windows)
    found = np.where(shows, np.maximum(slow[1], 0.0) / np.maximum(slow[2], 1e-300), 0.0)
    return np.asarray(np.maximum(found[:3], found[3] * axis**2))


def _white(size: int, model: Model) -> float:
    """Variance of a Hann mean of samples at rest."""
    return 1.5 * model.settings.accel_noise**2 / size


def _variance(shaking: Shaking, lever: Array, cosine: float, window: Samples, model: Model) -> Array:
    """Variances (3,) of a window's gravity: shaking, lever arm, walk of the gyro, and errors that do not average.

    The strength of gravity and the gain across the tool (by sin^2 I) are the same in every window: the vertical, which
    they damage, is given their variance times the number of windows, so that it never tells more than one would.
    """
    g, size = model.gravity, len(window)
    seen = min(shaking.level, MEMORY)
    variance = shaking.scatter * mean_weights(shaking) * (1.0 + 2.0 / (FREE * seen))
    variance += np.einsum("ni,ij,nj->n", lever, np.linalg.inv(shaking.information), lever)
    variance = np.maximum(variance, _white(size, model))
    variance[:2] += model.gyro_noise**2 * size * window.interval / 3.0 * g**2
    strength = np.hypot(model.site.gravity_sigma or 0.0, model.gain(np.asarray(window.gyro)) * g * (1.0 - cosine**2))
    variance[2] += shaking.windows * strength**2
    return np.asarray(variance)


MOST_REFUSED: Final = 0.05
"""Share of field samples beyond the gate from which a window's field counts as disturbed."""
MISFIT: Final = 1.5
"""Mean squared normalised innovation of the field, 1 where nothing disturbs it, from which it does too."""


class Observation(NamedTuple):
    """What a window tells besides the state: for flags and quality."""

    rate: float  #: rad/s, mean about the tool axis
    still: bool  #: held as a standstill
    clipped: bool  #: gravity left out for it
    refused: float  #: share of field samples beyond the gate, NaN where none was used
    misfit: float  #: mean squared normalised innovation of the field, NaN where none was used
    noise: float  #: nT^2, variance of the field's samples by their second differences
    disturbed: bool  #: the field was left out
    gravity: float  #: largest squared normalised innovation of gravity, negative when it was refused
    shaking: float  #: m/s^2, what shaking leaves in a mean of the window, as far as known
    slow: float  #: m/s^2, the same of accelerations slower than the window, where they show


def reduce_window(state: State, window: Samples, model: Model, tape: Tape = NO_TAPE) -> tuple[State, Observation]:
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
) -> tuple[State, Observation]:
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
        np.where(bad, 0 if still else 2, 1 if with_field else 0).astype(np.uint8),  # 1 use the field, 2 hold the gyro
        tapers(len(window), window.interval),
        _constants(state, window, model, still),
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
    axis, before_axis = (dcm_from_quaternion(one.quaternion)[2] for one in (done, state))
    mean = state.axis if state.axis.any() else axis
    # rad by which the axis of a tool that goes straight on may differ from one window to the next, and from its average
    moved = max(np.linalg.norm(axis - before_axis), np.linalg.norm(axis - mean)) > 0.03
    slow = 30  # windows over which the direction of the tool is averaged for `_field`
    return replace(done, axis=np.zeros(3) if moved else mean + (axis - mean) / slow), seen


def _seen(
    counts: Array, size: int, still: bool, clipped: bool, level: float, state: State, shaking: Shaking
) -> Observation:
    """Of a window, from what the loop counted."""
    used, refused = counts[0], counts[1]
    return Observation(
        rate=float(counts[5]) / size,
        still=still,
        clipped=clipped,
        refused=refused / (used + refused) if used + refused else np.nan,
        misfit=counts[2] / used if used else np.nan,
        noise=counts[6] / counts[7] if counts[7] else state.field_variance,
        disturbed=False,
        gravity=level,
        shaking=float(np.sqrt(np.max(shaking.scatter))) if shaking.windows else 0.0,
        slow=float(np.sqrt(np.max(slow_acceleration_variance(shaking.slow, dcm_from_quaternion(state.quaternion)[2])))),
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


LOST: Final = 0.26
"""Standard uncertainty of azimuth, rad, from which nothing is said to determine it: no longer small."""


def is_still(state: State, window: Samples, model: Model, bad: Mask) -> bool:
    """Whether nothing but the Earth moves the tool, as far as a gyro alone can say.

    The mean rate must be bias and Earth rate: in the attitude found, or of its magnitude where the azimuth is not
    known. A gyro whose bias may hide a turn as fast as `still_rate` cannot say so, and the tool is taken to move: the
    strapdown is right either way. Gravity must stay where it is in tool axes, and the rate must not swing. With a field
    no tool is held: the field shows the bias at rest, and a turn of 0.002 deg/s compared with it tilts the tool.
    """
    settings, seconds = model.settings, window.interval * len(window)
    if model.magnetic or bad.any():
        return False
    gyro, accel = np.asarray(window.gyro), np.asarray(window.accel)
    rate = gyro.mean(axis=0)
    rows, residual = _rate_of_rest(state.nominal, rate, model)
    p = state.covariance
    own = rows[:, 3:9] @ p[3:9, 3:9] @ rows[:, 3:9].T + settings.gyro_noise**2 / seconds * np.eye(3)
    hidden = 4.0 * float(np.sqrt(np.linalg.eigvalsh(own)[-1]))  # 4 standard deviations: once in ten thousand windows
    if hidden > settings.still_rate:
        return False
    if azimuth_variance(state) > LOST**2:
        size = float(np.linalg.norm(rate * (1.0 - state.nominal[7:10]) - state.nominal[4:7]))
        if size > EARTH_RATE + hidden or (model.site.latitude is not None and size < EARTH_RATE - hidden):
            return False
    else:
        together = rows @ p @ rows.T + model.gyro_noise**2 / seconds * np.eye(3)
        off = residual - rows @ state.offset
        if off @ np.linalg.solve(together, off) > 22.0:  # chi-square of 3 degrees of freedom, the same chance
            return False
    swing = np.ptp(np.cumsum(gyro - rate, axis=0), axis=0).max() * window.interval
    if swing > settings.still_rate * seconds + 4.0 * settings.gyro_noise * np.sqrt(seconds):
        return False
    # the means of both halves must agree within the noise that the means of tenths show from one to the next
    count = min(10, len(accel)) // 2 * 2
    if accel.std(axis=0).max() > settings.still_accel or count < 4:
        return False
    means = np.array([part.mean(axis=0) for part in np.array_split(accel, count)])
    turned = means[: count // 2].mean(axis=0) - means[count // 2 :].mean(axis=0)
    variance = 2.0 / count * float(np.mean(np.diff(means, axis=0) ** 2))
    # 5: the noise has some 18 degrees of freedom; a steady turn without noise is at 11
    return bool(np.abs(turned).max() <= 5.0 * np.sqrt(variance) + 1e-9)


def _constants(state: State, window: Samples, model: Model, still: bool) -> Array:
    settings, interval = model.settings, window.interval
    uneven, most = (settings.mag_scale_sigma * state.strength) ** 2, 2.5**2  # standard deviations of one tool in eighty
    if window.mag is not None:  # a delay turns the transverse field by another angle as the speed changes
        late = settings.delay_sigma_s * float(np.std(np.asarray(window.gyro)[:, 2]))
        uneven += late**2 * float(np.mean(window.mag[:, :2] ** 2))
    head = [
        interval,
        *(0.0 * model.spin if still else model.spin * interval),
        state.strength,
        max(settings.mag_noise**2, state.field_variance, most * uneven),
        settings.gate,
        (0.2 * interval) ** 2,  # rad/s, how far the rate may have moved while an unusable sample was bridged
        *settings.step_variances(interval, settings.creep if still else model.gyro_noise),
        0.0 if still else 1.0,
        *state.axis,
    ]
    return np.array(head)


def _rate_of_rest(nominal: Array, rate: Array, model: Model) -> tuple[Array, Array]:
    """Rows (3, 16) and residual (3,) of the mean rate of a tool at rest: 0 = rate (1 - scale) - bias - Earth rate."""
    earth = dcm_from_quaternion(nominal[:4]) @ model.spin
    rows = np.zeros((3, STATES))
    rows[:, :3], rows[:, 3:6], rows[:, 6:9] = cross_matrix(earth), -np.eye(3), -np.diag(rate)
    return rows, rate * (1.0 - nominal[7:10]) - nominal[4:7] - earth


def _standstill(nominal: Array, rate: Array, seconds: float, model: Model, ends: Ends) -> None:
    """The mean rate of a held tool as a measurement."""
    variance = model.gyro_noise**2 / seconds
    for row, value in zip(*_rate_of_rest(nominal, rate, model), strict=True):
        ends.measure(row, float(value), variance, NO_GATE)


def initial_state(window: Samples, model: Model) -> State:
    """Nothing known but what the settings and the site say."""
    site = model.site
    # a dip that no site states is taken from the first window
    north_sd = np.radians(1.0) if site.dip is None else dip_sigma(site)
    nominal = np.zeros(NOMINAL)
    nominal[0] = 1.0
    nominal[16] = 0.0 if site.dip is None else site.dip
    strength = 0.0
    if model.magnetic:
        strength = float(np.sqrt(np.mean(np.sum(np.asarray(window.mag) ** 2, axis=1)))) if site.b is None else site.b
    covariance = model.settings.prior(np.eye(3), float(north_sd))
    gyro = np.asarray(window.gyro)
    return State(
        nominal, covariance, np.zeros(STATES), gyro[0].copy(), strength, 0.0, initial_vibration(model), np.zeros(3)
    )


def initial_vibration(model: Model) -> Shaking:
    """Before the first window."""
    settings = model.settings
    information = np.eye(3) / max(settings.lever_sigma, 1e-6) ** 2
    return Shaking(
        np.zeros(3),
        np.zeros((2, 2)),
        np.array(settings.lever_arm, dtype=np.float64),
        information,
        0,
        0,
        np.zeros((4, 4)),
    )


def reinitialise_attitude(state: State, window: Samples, model: Model) -> State:
    """The state with its attitude found again from a window, and that of the sample before it.

    Magnetic: gravity and field averaged in the almost-inertial frame. Otherwise gravity, and azimuth by the rate that
    a standing tool reads or, where the model is blind, none; how good it is, is left to the measurements to judge.
    """
    window = initial_segment(window, model)
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
        # rad, prior uncertainty of a tilt that the first window is only linearised at, not yet measured with
        tilt = 0.3
        attitude = matrix @ np.diag([tilt**2, tilt**2, UNKNOWN**2]) @ matrix.T
    return set_attitude(state, quaternion_from_dcm(matrix), attitude, np.asarray(window.gyro)[0])


def set_attitude(state: State, quaternion: Array, attitude: Array, last: Array) -> State:
    """The state with another attitude of covariance (3, 3), independent of the rest; `last` sample of the gyro."""
    nominal, covariance, offset = state.nominal.copy(), state.covariance.copy(), state.offset.copy()
    nominal[:4] = quaternion
    covariance[:3, :], covariance[:, :3], offset[:3] = 0.0, 0.0, 0.0
    covariance[:3, :3] = attitude
    return replace(state, nominal=nominal, covariance=covariance, offset=offset, last=last.copy(), axis=np.zeros(3))


def start_from_attitude(state: State, window: Samples, start: Attitude, model: Model) -> State:
    """The state at a stated attitude (its last row) of the first sample, taken one step back to the one before it.

    Raises
    ------
    InputError
        A row that was refused, counted from another north, or of another time.
    """
    north = "magnetic" if model.magnetic else "true"
    if not len(start) or start.refused[-1]:
        raise refused("input-station")
    if start.north != north:
        raise refused("input-north", {"norths": (start.north, north)})
    late = float(window.time[0] - start.time[-1])
    if abs(late) > model.settings.window:
        values = {"time_s": float(start.time[-1]), "off_s": late, "most_s": model.settings.window}
        raise refused("input-station-far", values)
    first = np.asarray(window.gyro)[0]
    rate = first * (1.0 - state.nominal[7:10]) - state.nominal[4:7]
    back = quaternion_multiply(quaternion_exp(rate * window.interval), start.quaternion[-1])
    return set_attitude(state, back, start.covariance[-1], first)


def initial_segment(window: Samples, model: Model) -> Samples:
    """So much of a window that an unknown scale has not yet turned its end far from its beginning."""
    turned = np.cumsum(np.linalg.norm(np.asarray(window.gyro), axis=1)) * window.interval
    # 0.2 rad that the scale's uncertainty may turn its end, but 64 samples at least
    size = int(np.searchsorted(turned * max(model.settings.gyro_scale_sigma, 1e-9), 0.2))

    return window.part(0, min(max(size, 64), len(window)))


def is_moving(state: State, window: Samples) -> bool:
    """Whether what is not known of bias and scale turns the tool too far in a window for the filter to be linear.

    After a standstill the bias is known and the scale is not: the first window that turns shows it, from the start.
    """
    gyro, p = np.asarray(window.gyro), state.covariance
    angle, elapsed = (
        np.cumsum(gyro, axis=0) * window.interval,
        np.arange(1.0, len(gyro) + 1.0)[:, None] * window.interval,
    )
    by_bias, both, by_scale = (np.diag(p[i : i + 3, j : j + 3]) for i, j in ((3, 3), (3, 6), (6, 6)))
    # rad that bias and scale, as far as they are not known, may turn a window before it is linearised again: the
    # square of it, halved, is what a linear filter neglects
    straight = 0.02
    return bool(np.max(elapsed**2 * by_bias + 2.0 * elapsed * angle * both + angle**2 * by_scale) > straight**2)


def linearised(state: State, window: Samples, model: Model, with_field: bool) -> State:
    """The same beliefs, linearised at what the window makes of its beginning: first a part of it, then the whole."""
    from inclinometry.motion.inertial._recursions import backward

    # nothing is surprising yet: what is refused now would be refused for ever, but for a millionfold variance
    model = replace(model, settings=replace(model.settings, gate=ANY, weight=None))
    size = len(initial_segment(window, model))
    while True:
        part = window.part(0, size)
        # three times: scale x turns bends the first one
        for _ in range(3):
            tape = blank_tape(size)
            seen = filter_window(state, part, model, with_field, tape)[1]
            lam, info = np.zeros(STATES), np.zeros((STATES, STATES))
            backward(tape.steps, tape.updates, lam, info)
            state = corrected(state, state.offset - state.covariance @ lam)
            if with_field:
                state = replace(state, field_variance=seen.noise)
        if size == len(window):
            return state
        size = min(4 * size, len(window))


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
