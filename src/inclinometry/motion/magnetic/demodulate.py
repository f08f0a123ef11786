"""A window of samples turned back by the magnetic phase and gathered in nodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.motion.magnetic.phase import SECTORS, Complex, Track, remembered, smooth, untried
from inclinometry.motion.magnetic.settings import MagneticSettings
from inclinometry.motion.samples import Samples

# What a run has taught of the tool so far: magnetic offset, accelerometer offset, lever arm.

OFFSET_WALK: Final = 1.0
"""nT / sqrt(s): magnetic offset, with temperature and stress."""
ACCEL_WALK: Final = 1e-4
"""m/s^2 / sqrt(s)."""
DELAY_SIGMA: Final = 0.05
"""s: of the magnetometer's delay before anything is known."""
LEVER_WALK: Final = 1e-5
"""m / sqrt(s)."""


@dataclass(frozen=True, eq=False)
class ToolConstants:
    """Estimates with covariance, valid up to the end of the window they come from.

    Attributes
    ----------
    offset : complex
        Transverse magnetic offset, nT.
    offset_covariance : (2, 2) ndarray
        nT^2.
    seen : bool
        Whether an arc sufficed for the offset to be fitted.
    motion : (2,) ndarray
        Transverse accelerometer offset, m/s^2, and lever arm, m, complex.
    motion_covariance : (2, 2) ndarray
        Per real component.
    trust : (4, r) ndarray
        Log weights of the noise spectra of transverse gravity and field, axial gravity and field.
    delay : tuple of float
        Information about the magnetometer's delay against the accelerometer, 1/s^2, and information times delay.
    gyro_lag : tuple of float
        Likewise of the gyro against the magnetometer.
    met : (2, SECTORS) ndarray
        Sums and numbers of the transverse field by direction, as long as no arc sufficed.
    """

    offset: complex
    offset_covariance: Array
    seen: bool
    motion: Complex
    motion_covariance: Complex
    trust: Array
    delay: tuple[float, float]
    gyro_lag: tuple[float, float]
    met: Complex

    def aged(self, seconds: float) -> ToolConstants:
        """After some time in which they may have wandered."""
        walk = np.diag([ACCEL_WALK**2, LEVER_WALK**2]) * seconds
        return ToolConstants(
            self.offset,
            self.offset_covariance + OFFSET_WALK**2 * seconds * np.eye(2),
            self.seen,
            self.motion,
            self.motion_covariance + walk,
            remembered(self.trust),
            self.delay,
            self.gyro_lag,
            self.met,
        )


def beforehand(settings: MagneticSettings) -> ToolConstants:
    """What is known before the first window."""
    return ToolConstants(
        complex(settings.offset_x, settings.offset_y),
        settings.offset_sigma**2 * np.eye(2),
        False,
        np.zeros(2, dtype=np.complex128),
        np.diag([settings.accel_sigma**2, settings.lever_sigma**2]).astype(np.complex128),
        np.tile(untried(), (4, 1)),
        (DELAY_SIGMA**-2, settings.mag_delay_s * DELAY_SIGMA**-2),
        (DELAY_SIGMA**-2, 0.0),
        np.zeros((2, SECTORS), dtype=np.complex128),
    )


MOST_TURN: Final = 1.5
"""Rotation from one node to the next, rad, beyond which the phase is taken for ambiguous or the series inexact."""


@dataclass(frozen=True, eq=False)
class Demodulated:
    """Nodes (m,) of one window, in the frame that turns with the transverse field.

    Attributes
    ----------
    gravity, field : (m,) ndarray
        Transverse parts as complex numbers, m/s^2 and nT.
    axial_gravity, axial_field : (m,) ndarray
    back : (m,) ndarray
        The factor by which they were turned, the conjugate of the phasor.
    phasor : (m,) ndarray
        At the middle of the node.
    rate, acceleration : (m,) ndarray
        Of the rotation about the tool axis, rad/s and rad/s^2.
    track : Track
    turned : (m,) ndarray
        Angle by the gyro, rad; empty where none was used.
    delay : float
        s, by which the magnetometer was taken to be late against the accelerometer.
    gyro_lag : float
        s, by which the gyro was taken to be late against the magnetometer.
    lag : (m,) ndarray
        Phase by which the magnetometer is late, rad, already taken off gravity.
    turn : float
        Largest rotation from one node to the next, rad.
    """

    gravity: Complex
    field: Complex
    axial_gravity: Array
    axial_field: Array
    back: Complex
    phasor: Complex
    rate: Array
    acceleration: Array
    track: Track
    turned: Array
    delay: float
    gyro_lag: float
    lag: Array
    turn: float


def demodulate(
    samples: Samples, step: int, offset: complex, *, with_gyro: bool, delay: float, gyro_lag: float = 0.0
) -> Demodulated:
    """Turn a window back.

    Parameters
    ----------
    samples : Samples
        A whole number of nodes.
    step : int
        Samples of a node.
    offset : complex
        Transverse magnetic offset to take off, nT.
    with_gyro : bool
        Whether the gyro carries the phase from sample to sample; the magnetometer then only guides it, slowly.
    delay : float
        By how much the magnetometer is late against the accelerometer, s.
    gyro_lag : float
        By how much the gyro is late against the magnetometer, s: its angle is brought to the magnetometer's time.
    """
    from inclinometry.motion.magnetic import _kernels

    accel, mag, gyro = samples.accel, samples.mag, samples.gyro if with_gyro else None
    if accel is None or mag is None:  # the callers refuse before
        raise ValueError("needs accel and mag")
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
    lag = delay * rate
    late = np.exp(1j * lag)
    return Demodulated(
        gravity=(table[0] + 1j * table[1]) * late,
        field=np.asarray(table[3] + 1j * table[4], dtype=np.complex128),
        axial_gravity=table[2],
        axial_field=table[5],
        back=(table[6] + 1j * table[7]) * late,
        phasor=phasor,
        rate=rate,
        acceleration=acceleration,
        track=track,
        turned=middle,
        delay=delay,
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


def prior(known: ToolConstants) -> Complex:
    """Precision (3, 3) of their coefficients; nothing is known of gravity."""
    precision = np.zeros((3, 3), dtype=np.complex128)
    precision[1:, 1:] = np.linalg.inv(known.motion_covariance)
    return precision
