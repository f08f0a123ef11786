"""By how much the magnetometer is late against accelerometer and gyro: phase that grows with the speed of rotation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from inclinometry.core.errors import InputError
from inclinometry.motion.magnetic.band import basis, fit
from inclinometry.motion.magnetic.blocks import Held
from inclinometry.motion.magnetic.circle import raised
from inclinometry.motion.magnetic.constants import DELAY_SIGMA, ToolConstants, beforehand
from inclinometry.motion.magnetic.demodulate import Demodulated, demodulate
from inclinometry.motion.magnetic.regressors import prior, regressors
from inclinometry.motion.magnetic.settings import MagneticSettings
from inclinometry.motion.samples import Samples

FLOOR_S: Final = 2e-5
"""Least standard deviation stated: what differences of filters leave."""
SIGNIFICANT: Final = 5.0
"""Standard deviations from which a delay is corrected."""


@dataclass(frozen=True)
class ClockOffset:
    """Delay of the magnetometer.

    Attributes
    ----------
    delay_s : float
        Positive when the magnetometer's samples are late: they show what was true that long ago.
    sigma_s : float
        Its standard deviation. A run that turns evenly shows no delay: the sigma is then that of the prior, 0.05 s.
    against : {"gyro", "accelerometer"}
        What it was compared with.
    windows : int
    """

    delay_s: float
    sigma_s: float
    against: str
    windows: int

    @property
    def significant(self) -> bool:
        """Whether it differs from nothing by five standard deviations."""
        return abs(self.delay_s) > SIGNIFICANT * self.sigma_s


def clock_offset(samples: Samples, settings: MagneticSettings | None = None) -> ClockOffset:
    """Delay of the magnetometer, from the changes of the speed of rotation.

    Parameters
    ----------
    samples : Samples
        With magnetometer and a gyro, or magnetometer and accelerometer.
    settings : MagneticSettings, optional
        Its window and offsets; `mag_delay_s` is not applied.

    Returns
    -------
    ClockOffset

    Raises
    ------
    InputError
        No accelerometer or magnetometer, or a run shorter than a window.

    Notes
    -----
    The phase of the field, with the angle from the gyro added, is constant + drift t + scale error angle + delay omega.
    Without a gyro gravity turned back is G exp(-i delay omega): the delay is fitted in the band of the window, beside
    the lever arm. A conducting collar delays the field likewise (eddy currents) and is included.

    Examples
    --------
    >>> from inclinometry.attitude.orientation import fields
    >>> time = np.arange(4000) / 200.0
    >>> turn = 9.0 * time + 8.0 * np.sin(time)
    >>> late = 9.0 * (time - 0.003) + 8.0 * np.sin(time - 0.003)
    >>> (g, _), (_, b) = (fields(np.full(4000, 1.0), 0.5, angle, 1.1) for angle in (turn, late))
    >>> found = clock_offset(Samples(time, 0.005, accel=9.81 * g, mag=50_000.0 * b))
    >>> round(found.delay_s, 5), found.against, found.significant
    (0.003, 'accelerometer', True)
    """
    chosen = settings or MagneticSettings()
    if not (samples.has("accel") and samples.has("mag")):
        raise InputError("the delay of the magnetometer needs an accelerometer and a magnetometer")
    step = chosen.node(samples.interval)
    size = chosen.nodes(samples.interval) * step
    if len(samples) < size:
        raise InputError(f"the run of {len(samples)} samples is shorter than a window of {size}; shorten the window")
    known = beforehand(chosen)
    with_gyro = chosen.use_gyro and samples.has("gyro")
    information, moment, windows = DELAY_SIGMA**-2, 0.0, 0
    held = Held()
    held.add(samples)
    for start in range(0, len(samples) - size + 1, size):
        part = held.cut(start, start + size)
        d = demodulate(part, step, known.offset, with_gyro=with_gyro, delay=0.0)
        gain, pull = window_delay(d, known, step * samples.interval)
        information, moment, windows = information + gain, moment + pull, windows + 1
    sigma = float(np.hypot(information**-0.5, FLOOR_S))
    return ClockOffset(moment / information, sigma, "gyro" if with_gyro else "accelerometer", windows)


def window_delay(d: Demodulated, known: ToolConstants, span: float) -> tuple[float, float]:
    """Information (1/s^2) about the delay in one window, and information times delay.

    Parameters
    ----------
    d : Demodulated
        Whatever delay was taken off is counted in.
    known : ToolConstants
    span : float
        s, of a node.
    """
    return _against_gyro(d, span) if d.turned.size else _against_gravity(d, known)


def _against_gyro(d: Demodulated, span: float) -> tuple[float, float]:
    """Least squares of the phase beyond the gyro's angle."""
    time = (np.arange(d.rate.size) - 0.5 * (d.rate.size - 1)) * span
    rows = np.stack([np.ones_like(time), time, d.turned - d.turned.mean(), d.rate - d.rate.mean()], axis=1)
    q, r = np.linalg.qr(rows[:, :3])
    del r
    clean = rows[:, 3] - q @ (q.T @ rows[:, 3])
    phase = d.track.given - q @ (q.T @ d.track.given)
    power = float(clean @ clean)
    # an even speed leaves rounding of its mean
    if power <= 1e-12 * float(d.rate @ d.rate):
        return 0.0, 0.0
    delay = float(clean @ phase) / power
    variance = max(raised(phase - delay * clean), 1e-18)
    information = 1.0 / (variance / power + FLOOR_S**2)
    return information, information * delay


def _against_gravity(d: Demodulated, known: ToolConstants) -> tuple[float, float]:
    """Fit of gravity turned back with one regressor more."""
    of, rows = basis(d.rate.size), regressors(d)
    mean = np.concatenate([[0.0], known.motion])
    gravity = fit(of, d.gravity, rows, mean, prior(known), known.trust[0]).value[0]
    slip = -1j * (d.rate - d.rate.mean()) * gravity
    wide = np.zeros((4, 4), dtype=np.complex128)
    wide[:3, :3] = prior(known)
    wide[3, 3] = DELAY_SIGMA**-2
    columns = np.concatenate([rows, slip[:, None]], axis=1)
    found = fit(of, d.gravity, columns, np.append(mean, 0.0), wide, known.trust[0])
    variance = float(found.covariance[3, 3].real)
    if variance >= 0.25 * DELAY_SIGMA**2:
        return 0.0, 0.0
    information = 1.0 / (variance + FLOOR_S**2)
    return information, information * (d.delay + float(found.value[3].real))
