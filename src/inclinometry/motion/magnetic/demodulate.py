"""A window of samples turned back by the magnetic phase and gathered in nodes."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.errors import out_of_order, refused
from inclinometry.motion.magnetic.phase import SECTORS, Complex, MagneticSettings, Track, remembered, smooth, untried
from inclinometry.motion.result import LARGEST_BREAK, Samples


class Held:
    """Samples of a stream that are still needed, and their stamps.

    The stamps are kept apart: those of a cut would jitter against its first one by more than a whole block's may.
    """

    def __init__(self) -> None:
        self._blocks: list[Samples] = []
        self._stamps: list[Array] = []
        self._last: Samples | None = None

    def __len__(self) -> int:
        return sum(len(block) for block in self._blocks)

    def add(self, block: Samples) -> bool:
        """Take a block unless there is a gap before it; whether it was taken.

        Raises
        ------
        InputError
            Another interval, other triads, or a block that begins before the end of the last.
        """
        if self._last is not None and not _follows(self._last, block):
            return False
        if len(block):
            self._blocks.append(block)
            self._stamps.append(block.time)
            self._last = block
        return True

    def clear(self) -> None:
        """Forget everything, also what came before."""
        self._blocks, self._stamps, self._last = [], [], None

    def stamps(self, start: int, stop: int) -> Array:
        """Stamps as they were given."""
        self._merge()
        return self._stamps[0][start:stop]

    def cut(self, start: int, stop: int) -> Samples:
        """Samples start to stop - 1, with even times that begin at 0."""
        self._merge()
        return self._blocks[0].part(start, stop)

    def drop(self, count: int) -> None:
        """Forget the first ones."""
        self._merge()
        rest, stamps = self._blocks[0].part(count, len(self)), self._stamps[0][count:]
        self._blocks, self._stamps = ([rest], [stamps]) if len(rest) else ([], [])

    def _merge(self) -> None:
        """One block of all, on an even grid."""
        if not self._blocks:
            raise refused("input-few", {"name": "samples", "count": 0, "least": 1})
        if len(self._blocks) == 1 and self._blocks[0].time is not self._stamps[0]:
            return
        interval = self._blocks[0].interval
        names = [field.name for field in fields(Samples) if field.name not in ("time", "interval")]
        columns = {name: _column(name, self._blocks) for name in names}
        even = np.asarray(interval * np.arange(len(self)), dtype=np.float64)
        self._blocks, self._stamps = [Samples(even, interval, **columns)], [np.concatenate(self._stamps)]


def _column(name: str, blocks: list[Samples]) -> Any:
    """One column of several blocks."""
    parts = [getattr(block, name) for block in blocks]
    if name == "clipped" and any(part is not None for part in parts):
        parts = [np.zeros(len(b), dtype=np.bool_) if p is None else p for b, p in zip(blocks, parts, strict=True)]
    if parts[0] is None or len(parts) == 1:
        return parts[0]
    return np.concatenate(parts)


def _follows(last: Samples, block: Samples) -> bool:
    """Whether a block continues the last one without a gap."""
    names = ("accel", "mag", "gyro", "temperature")
    if last.interval != block.interval or any((getattr(last, n) is None) != (getattr(block, n) is None) for n in names):
        raise refused("input-block")
    if not len(block):
        return True
    off = float(block.time[0] - last.time[-1]) / block.interval - 1.0
    if off < -LARGEST_BREAK:
        raise out_of_order("time", float(block.time[0]), float(last.time[-1]), 1)
    return off <= LARGEST_BREAK


# What a run has taught of the tool so far: magnetic offset, accelerometer offset, lever arm.

DELAY_SIGMA: Final = 0.05
"""s: of the magnetometer's delay before anything is known."""


@dataclass(frozen=True, eq=False)
class ToolConstants:
    """Estimates with covariance, valid up to the end of the window they come from."""

    offset: complex  #: transverse magnetic offset, nT
    offset_covariance: Array  #: (2, 2) nT^2
    seen: bool  #: whether an arc sufficed for the offset to be fitted
    motion: Complex  #: (2,) transverse accelerometer offset, m/s^2, and lever arm, m, complex
    motion_covariance: Complex  #: (2, 2) per real component
    #: (2,) what axial gravity takes over of omega^2 and of its rate of change, m: lever arm times coupling
    axial: Array
    axial_covariance: Array  #: (2, 2) m^2
    trust: Array  #: (4, r) log weights of the noise spectra of transverse gravity and field, axial gravity and field
    # information about the magnetometer's delay against the accelerometer, 1/s^2, and information times delay
    delay: tuple[float, float]
    gyro_lag: tuple[float, float]  #: likewise of the gyro against the magnetometer
    met: Complex  #: (2, SECTORS) sums and numbers of the transverse field by direction, as long as no arc sufficed
    # of the last window: angle from field to gravity as read, its variance, rad^2, and the speed, rad/s
    sighted: tuple[float, float, float] | None = None
    # of the last window: mean axial gravity as read, m/s^2, the means of omega^2 and of its rate of change under the
    # same weights, and the variance of the first by noise
    levelled: tuple[float, float, float, float] | None = None

    def aged(self, seconds: float) -> ToolConstants:
        """After some time in which they may have wandered."""
        accel_walk = 1e-4  # m/s^2 / sqrt(s)
        lever_walk = 1e-5  # m / sqrt(s)
        walk = np.diag([accel_walk**2, lever_walk**2]) * seconds
        offset_walk = 1.0  # nT / sqrt(s), with temperature and stress
        axial_walk = 1e-8  # m / sqrt(s): the lever arm's times a coupling
        direction_walk = 2e-4  # rad / sqrt(s): 3 deg in 30 m at 60 m/h
        return replace(
            self,
            offset_covariance=self.offset_covariance + offset_walk**2 * seconds * np.eye(2),
            motion_covariance=self.motion_covariance + walk,
            axial_covariance=self.axial_covariance + axial_walk**2 * seconds * np.eye(2),
            trust=remembered(self.trust),
            levelled=self.levelled
            and (*self.levelled[:3], self.levelled[3] + (direction_walk * STANDARD_GRAVITY) ** 2 * seconds),
            sighted=self.sighted and (self.sighted[0], self.sighted[1] + direction_walk**2 * seconds, self.sighted[2]),
        )


def prior_constants(settings: MagneticSettings) -> ToolConstants:
    """What is known before the first window."""
    # m, per component: two couplings with two components of the lever arm
    axial = max(float(np.sqrt(2.0)) * settings.coupling_sigma * settings.lever_sigma, 1e-9)
    return ToolConstants(
        complex(settings.offset_x, settings.offset_y),
        settings.offset_sigma**2 * np.eye(2),
        False,
        np.zeros(2, dtype=np.complex128),
        np.diag([settings.accel_sigma**2, settings.lever_sigma**2]).astype(np.complex128),
        np.zeros(2),
        axial**2 * np.eye(2),
        np.tile(untried(), (4, 1)),
        (DELAY_SIGMA**-2, (settings.mag_delay_s + settings.lag_s) * DELAY_SIGMA**-2),
        (DELAY_SIGMA**-2, 0.0),
        np.zeros((2, SECTORS), dtype=np.complex128),
    )


MOST_TURN: Final = 1.5
"""Rotation from one node to the next, rad, beyond which the phase is taken for ambiguous or the series inexact."""


@dataclass(frozen=True, eq=False)
class Demodulated:
    """Nodes (m,) of one window, in the frame that turns with the transverse field."""

    # gravity, field: (m,) transverse parts as complex numbers, m/s^2 and nT
    gravity: Complex
    field: Complex
    # axial_gravity, axial_field: (m,)
    axial_gravity: Array
    axial_field: Array
    back: Complex  #: (m,) the factor by which they were turned, the conjugate of the phasor
    phasor: Complex  #: (m,) at the middle of the node
    # rate, acceleration: (m,) of the rotation about the tool axis, rad/s and rad/s^2
    rate: Array
    acceleration: Array
    track: Track
    turned: Array  #: (m,) angle by the gyro, rad; empty where none was used
    delay: float  #: s, by which the magnetometer was taken to be late against the accelerometer, eddy currents included
    gyro_lag: float  #: s, by which the gyro was taken to be late against the magnetometer
    lag: Array  #: (m,) phase by which the magnetometer is late, rad, already taken off gravity
    turn: float  #: largest rotation from one node to the next, rad


def demodulate(
    samples: Samples,
    step: int,
    offset: complex,
    *,
    with_gyro: bool,
    delay: float,
    eddy: float = 0.0,
    gyro_lag: float = 0.0,
) -> Demodulated:
    """Turn a window of a whole number of nodes back, `step` samples each, the transverse `offset`, nT, taken off.

    With a gyro it carries the phase from sample to sample, and the magnetometer only guides it, slowly. delay,
    gyro_lag: s, by which magnetometer (against the accelerometer) and gyro (against the magnetometer) are late. eddy:
    s, time constant of the collar: the transverse field is late by atan(eddy omega), and weaker by sqrt(1 + (eddy
    omega)^2). The root of that is given back: a clock that is late takes nothing.
    """
    from inclinometry.motion.magnetic import _kernels

    accel, mag, gyro = np.asarray(samples.accel), np.asarray(samples.mag), samples.gyro if with_gyro else None
    count, span = len(samples) // step, step * samples.interval
    theta, middle = np.empty(0), np.empty(0)
    means = np.empty((2, count))
    if gyro is None:
        _kernels.averaged_as_is(mag, offset.real, offset.imag, step, means)
    else:
        theta = np.empty(len(samples))
        _kernels.turned(gyro, theta, samples.interval)
        if gyro_lag:
            theta += gyro_lag * gyro[:, 2]
        middle = 0.5 * (theta[(step - 1) // 2 :: step] + theta[step // 2 :: step])
        _kernels.averaged(mag, theta, middle, offset.real, offset.imag, step, means)
    phase = np.unwrap(np.angle(means[0] + 1j * means[1]) + (middle if middle.size else 0.0))
    track = smooth(phase)
    phasor = np.exp(1j * (track.phase - middle if middle.size else track.phase))
    if gyro is None:
        rate, acceleration = -track.slope / span, -track.bend / span**2
    else:
        rate = gyro[:, 2].reshape(count, step).mean(axis=1) - track.slope / span
        acceleration = np.gradient(rate, span)
    local = np.empty(len(samples))
    _kernels.phased(local, np.stack([track.slope / step, track.bend / step**2]), step, theta, middle)
    table = np.zeros((_kernels.COLUMNS, count))
    u = np.stack([phasor.real, phasor.imag])
    _kernels.demodulated(accel, mag, local, u, offset.real, offset.imag, step, table)
    table /= table[-1]
    lag = delay * rate + np.arctan(eddy * rate)
    late = np.exp(1j * lag)
    return Demodulated(
        gravity=(table[0] + 1j * table[1]) * late,
        field=np.asarray((table[3] + 1j * table[4]) * np.sqrt(np.hypot(1.0, eddy * rate)), dtype=np.complex128),
        axial_gravity=table[2],
        axial_field=table[5],
        back=(table[6] + 1j * table[7]) * late,
        phasor=phasor,
        rate=rate,
        acceleration=acceleration,
        track=track,
        turned=middle,
        delay=delay + eddy,
        gyro_lag=gyro_lag,
        lag=lag,
        turn=float(np.abs(np.diff(middle if middle.size else phase)).max(initial=0.0)),
    )


# What of transverse gravity stands still in the hole, and what turns with the tool.


def regressors(d: Demodulated) -> Complex:
    """Columns (m, 3): gravity, an accelerometer's offset, its lever arm.

    Notes
    -----
    An accelerometer at r from the axis reads the apparent gravity omega x (r x omega) - alpha x r, in the tool's
    transverse axes (omega^2 - i alpha) r.
    """
    lever = (d.rate**2 - 1j * d.acceleration) * d.back
    return np.stack([np.ones_like(d.back), d.back, lever], axis=1)


def axial_regressors(d: Demodulated) -> Array:
    """Columns (m, 3): axial gravity, and what a coupled or tilted axis takes over of the lever arm's accelerations.

    Notes
    -----
    A row (e_x, e_y) of couplings meets (omega^2 - i alpha) r: omega^2 e.r + alpha (e x r). At an even speed omega^2 is
    a constant like gravity: its share stays in the covariance, by the prior.
    """
    return np.stack([np.ones_like(d.rate), d.rate**2, d.acceleration], axis=1)


def prior(covariance: Complex | Array) -> Complex:
    """Precision (3, 3) of the coefficients of `regressors`, of the last two (2, 2) `covariance`; none of the first."""
    precision = np.zeros((3, 3), dtype=np.complex128)
    precision[1:, 1:] = np.linalg.inv(covariance)
    return precision
