"""One window of the filter: strapdown and field sample by sample, then gravity, standstill and stations at its end."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from inclinometry.attitude.rotations import cross_matrix, dcm_from_quaternion
from inclinometry.core.arrays import Array, Mask
from inclinometry.core.constants import STANDARD_GRAVITY
from inclinometry.earth.rate import earth_rate
from inclinometry.earth.site import Site
from inclinometry.motion.inertial.settings import InertialSettings
from inclinometry.motion.inertial.state import STATES, State, corrected
from inclinometry.motion.samples import Samples

MEMORY: Final = 10
"""Windows over which the noise that shaking leaves in gravity is averaged."""
HELD: Final = 0.2
"""rad/s, how far the rate may have moved while an unusable sample of the gyro was bridged."""
ENDS: Final = 12
"""Rows of the tape for the measurements at the end of a window: gravity, standstill, station, spare."""
NO_GATE: Final = 1e30


class Tape(NamedTuple):
    """Steps (n, 13) and updates (n + ENDS, 34) of a window, for the backward pass; no rows when not wanted."""

    steps: Array
    updates: Array


def blank_tape(size: int) -> Tape:
    """A tape for a window of `size` samples."""
    return Tape(np.zeros((size, 13)), np.zeros((size + ENDS, 34)))


NO_TAPE: Final = Tape(np.zeros((0, 13)), np.zeros((0, 34)))


@dataclass(frozen=True, eq=False)
class Model:
    """What a window is reduced with; `magnetic` tells whether the field is used."""

    settings: InertialSettings
    site: Site
    magnetic: bool

    @property
    def gravity(self) -> float:
        """m/s^2."""
        return STANDARD_GRAVITY if self.site.gravity is None else self.site.gravity

    @property
    def spin(self) -> Array:
        """Earth rate (3,) in north, east, down of the north that is used; nought without a latitude."""
        if self.site.latitude is None:
            return np.zeros(3)
        w = earth_rate(self.site.latitude)
        # east of true north, magnetic north sees the Earth's axis turned west
        turn = (self.site.declination or 0.0) if self.magnetic else 0.0
        return np.array([w[0] * np.cos(turn), -w[0] * np.sin(turn), w[2]])


class Seen(NamedTuple):
    """What a window tells besides the state: for flags and quality.

    rate : rad/s, mean about the tool axis. still : held as a standstill. clipped : gravity left out for it.
    refused : share of field samples beyond the gate, NaN where none was used. misfit : mean squared normalised
    innovation of the field. gravity : largest squared normalised innovation of gravity, negative when refused.
    """

    rate: float
    still: bool
    clipped: bool
    refused: float
    misfit: float
    gravity: float


def reduce_window(state: State, window: Samples, model: Model, tape: Tape = NO_TAPE) -> tuple[State, Seen]:
    """State at the last sample of the window from that at the sample before the first."""
    from inclinometry.motion.inertial import _recursions as kernels

    bad = np.zeros(len(window), np.bool_) if window.clipped is None else window.clipped
    gyro = np.asarray(window.gyro)
    still = is_still(state, window, model, bad)
    nominal, p, x = state.nominal.copy(), state.covariance.copy(), state.offset.copy()
    last = gyro[-1].copy() if not bad[-1] else state.last.copy()
    fed, before = gyro, state.last.copy()
    if still:
        before = _held_rate(state, model)
        fed = np.broadcast_to(before, gyro.shape).copy()
    sums = np.zeros(kernels.SUMS)
    kernels.forward(
        fed,
        window.accel,
        window.mag if model.magnetic else np.zeros((0, 3)),
        _marks(bad, model.magnetic, still),
        _tapers(len(window), window.interval),
        _constants(state, window.interval, model, still),
        nominal,
        p,
        x,
        before,
        sums,
        *tape,
    )
    ends = _Ends(p, x, tape, len(window))
    clipped = bool(bad.any())
    level, scatter = (-1.0, state.scatter) if clipped else _gravity(state, nominal, sums, window, model, ends)
    if still:
        _standstill(nominal, gyro.mean(axis=0), window.interval * len(window), model, ends)
    done = replace(
        state,
        nominal=nominal,
        covariance=0.5 * (p + p.T),
        offset=x,
        last=last,
        scatter=scatter,
        count=state.count + (not clipped),
    )
    used, refused = sums[54], sums[55]
    seen = Seen(
        float(sums[60]) / len(window),
        still,
        clipped,
        refused / (used + refused) if used + refused else np.nan,
        sums[56] / used if used else np.nan,
        level,
    )
    return corrected(done, x), seen


def hann_mean(state: State, window: Samples, vectors: Array) -> Array:
    """Hann mean (3,) of vectors (n, 3) in the axes the tool had before the window, turned back by the gyro alone."""
    from inclinometry.motion.inertial import _recursions as kernels

    nominal = np.zeros(len(state.nominal))
    nominal[0], nominal[4:10] = 1.0, state.nominal[4:10]
    constants = np.zeros(25)
    constants[0] = window.interval
    sums, nothing, zero = np.zeros(kernels.SUMS), np.zeros((STATES, STATES)), np.zeros(STATES)
    marks, tapers = np.zeros(len(window), np.uint8), _tapers(len(window), window.interval)
    first = np.asarray(window.gyro)[0].copy()
    kernels.forward(
        window.gyro, vectors, vectors, marks, tapers, constants, nominal, nothing, zero, first, sums, *NO_TAPE
    )
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


def measure_station(state: State, quaternion: Array, covariance: Array, tape: Tape) -> State:
    """The state after an attitude was measured at its instant, with covariance (3, 3) in tool axes."""
    from inclinometry.attitude.rotations import rotation_log

    p, x = state.covariance.copy(), state.offset.copy()
    ends = _Ends(p, x, tape, len(tape.steps), 6)
    difference = rotation_log(dcm_from_quaternion(state.quaternion) @ dcm_from_quaternion(quaternion).T)
    values, axes = np.linalg.eigh(covariance)
    for value, axis in zip(values, axes.T, strict=True):
        ends.measure(np.concatenate([axis, np.zeros(STATES - 3)]), float(axis @ difference), float(value), NO_GATE)
    return corrected(replace(state, covariance=0.5 * (p + p.T)), x)


class _Ends:
    """Measurements at the end of a window, put on the tape after its samples."""

    def __init__(self, p: Array, x: Array, tape: Tape, size: int, start: int = 0) -> None:
        self._p, self._x, self._tape, self._next = p, x, tape, size + start
        self._taped = len(tape.updates) > 0

    def measure(self, h: Array, z: float, variance: float, gate: float) -> float:
        from inclinometry.motion.inertial._recursions import UPDATE, measure

        row = self._tape.updates[self._next] if self._taped else np.empty(UPDATE)
        self._next += 1
        return float(measure(h, z, variance, gate, self._p, self._x, row))

    def surprise(self, h: Array, z: float, variance: float) -> float:
        """Normalised innovation, before anything is done."""
        return float((z - h @ self._x) / np.sqrt(h @ self._p @ h + variance))


def _held_rate(state: State, model: Model) -> Array:
    """The rate a held tool would read."""
    rate = dcm_from_quaternion(state.quaternion) @ model.spin
    return np.asarray((rate + state.nominal[4:7]) / (1.0 - state.nominal[7:10]))


def _marks(bad: Mask, magnetic: bool, still: bool) -> Array:
    """Bits of the kernel: 1 use the field, 2 hold the gyro."""
    marks = np.where(bad, 0 if still else 2, 1 if magnetic else 0)
    return marks.astype(np.uint8)


def _tapers(size: int, interval: float) -> Array:
    """Hann taper (sum 1), its second derivative, and the taper times cosine and sine of 2 and 3 turns (n, 6)."""
    phase = 2.0 * np.pi * (np.arange(size) + 0.5) / size
    hann = (1.0 - np.cos(phase)) / size
    bend = np.cos(phase) / size * (2.0 * np.pi / (size * interval)) ** 2
    others = [hann * f(turns * phase) for turns in (2, 3) for f in (np.cos, np.sin)]
    return np.ascontiguousarray(np.stack([hann, bend, *others], axis=1))


def _constants(state: State, interval: float, model: Model, still: bool) -> Array:
    settings = model.settings
    head = [
        interval,
        *(model.spin * interval),
        state.strength,
        settings.mag_noise**2,
        settings.gate,
        (HELD * interval) ** 2,
        *settings.step_variances(interval, still),
        0.0 if still else 1.0,
    ]
    return np.array(head)


def _gravity(
    state: State, nominal: Array, sums: Array, window: Samples, model: Model, ends: _Ends
) -> tuple[float, Array]:
    """Apparent gravity through the Hann window in the almost-inertial frame; surprise and scatter as they become."""
    settings, g = model.settings, model.gravity
    tapered, mean_c = sums[:18].reshape(6, 3), sums[18:27].reshape(3, 3)
    drift, lever = sums[27:45].reshape(3, 6), sums[45:54].reshape(3, 3)
    seen = 2.0 * np.mean(tapered[2:] ** 2, axis=0)
    weight = min(state.count + 1, MEMORY)
    scatter = state.scatter + (seen - state.scatter) / weight
    cross = g * cross_matrix([0.0, 0.0, 1.0])
    rows = np.zeros((3, STATES))
    rows[:, :3] = cross @ dcm_from_quaternion(nominal[:4]).T
    rows[:, 3:9] = -cross @ drift
    rows[:, 9:12] = -mean_c
    residual = tapered[0] - lever @ np.asarray(settings.lever_arm) - [0.0, 0.0, g]
    size = len(window)
    walked = settings.gyro_noise**2 * size * window.interval / 3.0 * np.array([g, g, 0.0]) ** 2
    white = 1.5 * settings.accel_noise**2 / size
    variance = scatter * (1.0 + 2.0 / (4.0 * weight)) + walked + settings.lever_sigma**2 * (lever**2).sum(axis=1)
    variance = np.maximum(variance, white) + [0.0, 0.0, (model.site.gravity_sigma or 0.0) ** 2]
    axes = range(3 if model.site.gravity is not None else 2)
    if settings.weight is not None:
        t = np.array([ends.surprise(rows[i], residual[i], variance[i]) for i in axes])
        variance[: len(t)] /= np.maximum(settings.weight(t), 1e-12)
    found = [ends.measure(rows[i], float(residual[i]), float(variance[i]), settings.gate) for i in axes]
    return (-1.0 if min(found) < 0.0 else max(found)), scatter


def _standstill(nominal: Array, rate: Array, seconds: float, model: Model, ends: _Ends) -> None:
    """The mean rate of a held tool is bias and Earth rate: 0 = rate (1 - scale) - bias - Earth rate."""
    settings = model.settings
    earth = dcm_from_quaternion(nominal[:4]) @ model.spin
    residual = rate * (1.0 - nominal[7:10]) - nominal[4:7] - earth
    rows = np.zeros((3, STATES))
    rows[:, :3], rows[:, 3:6], rows[:, 6:9] = cross_matrix(earth), -np.eye(3), -np.diag(rate)
    variance = settings.gyro_noise**2 / seconds
    for row, value in zip(rows, residual, strict=True):
        ends.measure(row, float(value), variance, NO_GATE)
