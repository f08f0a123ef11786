"""By how much the clocks of magnetometer, accelerometer and gyro differ: phase that grows with the speed of rotation.

Pairwise: the magnetometer against the accelerometer by the phases of field and gravity, the gyro against the
magnetometer by the angle it carries. A late gyro says nothing of the other two.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.errors import refused
from inclinometry.findings import Finding
from inclinometry.motion.magnetic.demodulate import (
    DELAY_SIGMA,
    Demodulated,
    Held,
    ToolConstants,
    demodulate,
    prior,
    prior_constants,
    regressors,
)
from inclinometry.motion.magnetic.phase import MagneticSettings, basis, filtered, fit, raised
from inclinometry.motion.result import Samples
from inclinometry.rotations import wrap_signed
from inclinometry.tabular import check_record

FLOOR_S: Final = 2e-5
"""Least standard deviation stated: what differences of filters leave."""
SIGNIFICANT: Final = 5.0
"""Standard deviations from which a delay is called one."""


@dataclass(frozen=True)
class ClockOffset:
    """Delays of magnetometer and gyro."""

    # of the magnetometer against the accelerometer, positive when its samples are late: they show what was true that
    # long ago
    delay_s: float
    sigma_s: float  #: its standard deviation. A run that turns evenly shows no delay: the sigma is then 0.05 s
    # gyro_lag_s, gyro_sigma_s: of the gyro against the magnetometer, likewise; NaN without a gyro
    gyro_lag_s: float
    gyro_sigma_s: float
    windows: int

    @property
    def significant(self) -> bool:
        """Whether the magnetometer's delay differs from nothing by five standard deviations."""
        return abs(self.delay_s) > SIGNIFICANT * self.sigma_s


class Clocks(NamedTuple):
    """What is made of the evidence so far, s."""

    # delay, eddy, sigma: of the magnetometer against the accelerometer: of its clock, by eddy currents in the collar,
    # and the standard deviation left of both together
    delay: float
    eddy: float
    sigma: float
    seen: bool  #: whether the readings tell more of it than the prior
    late: bool  #: whether it departs from the setting by five standard deviations
    stepped: bool  #: whether by more than eddy currents explain
    gyro_lag: float  #: of the gyro against the magnetometer; 0 unless it is five standard deviations


def clocks(known: ToolConstants, settings: MagneticSettings) -> Clocks:
    """Delays by what was known and what was found.

    Notes
    -----
    What is found of both together is shared out by what `delay_sigma_s` and `lag_sigma_s` allow each of them; one far
    beyond that is a clock's, and taken as it is: the tool is then not what was stated.
    """
    found, sigma = _found(known.delay)
    off = found - settings.mag_delay_s - settings.lag_s
    prior_sigma = float(np.hypot(settings.delay_sigma_s, settings.lag_sigma_s))
    both = float(np.hypot(sigma, prior_sigma))
    late = abs(off) > SIGNIFICANT * sigma
    stepped = abs(off) > SIGNIFICANT * float(np.hypot(sigma, settings.lag_sigma_s))
    seen = sigma < prior_sigma
    lag, lag_sigma = _found(known.gyro_lag)
    lag = lag if abs(lag) > SIGNIFICANT * lag_sigma else 0.0
    if abs(off) > SIGNIFICANT * both:
        return Clocks(found - settings.lag_s, settings.lag_s, sigma, True, late, stepped, lag)
    total = settings.mag_delay_s + settings.lag_s + off * (prior_sigma / both) ** 2
    # no current makes a field early
    eddy = max(settings.lag_s + off * (settings.lag_sigma_s / both) ** 2, 0.0)
    return Clocks(total - eddy, eddy, sigma * prior_sigma / both, seen, late, stepped, lag)


def _found(evidence: tuple[float, float]) -> tuple[float, float]:
    """Delay and standard deviation of summed evidence."""
    return evidence[1] / evidence[0], float(np.hypot(evidence[0] ** -0.5, FLOOR_S))


def clock_offset(samples: Samples, settings: MagneticSettings | None = None) -> ClockOffset:
    """Delays between the sensors, from the changes of the speed of rotation.

    Parameters
    ----------
    samples : Samples
        With magnetometer and accelerometer; a gyro, where there is one, is judged against the magnetometer.
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
    Gravity turned back by the field's phase is G exp(-i delay omega): the delay is fitted in the band of the window,
    beside the lever arm. The phase of the field, with the angle from the gyro added, is constant + drift t
    + scale error angle - lag omega: least squares. A conducting collar delays the field likewise (eddy currents) and
    is included.

    Examples
    --------
    >>> from inclinometry.orientation import fields
    >>> time = np.arange(4000) / 200.0
    >>> turn = 9.0 * time + 8.0 * np.sin(time)
    >>> late = 9.0 * (time - 0.003) + 8.0 * np.sin(time - 0.003)
    >>> (g, _), (_, b) = (fields(np.full(4000, 1.0), 0.5, angle, 1.1) for angle in (turn, late))
    >>> found = clock_offset(Samples(time, 0.005, accel=9.81 * g, mag=50_000.0 * b))
    >>> round(found.delay_s, 5), found.significant
    (0.003, True)
    """
    check_record(samples, Samples, "clock_offset")
    chosen = settings or MagneticSettings()
    samples.need("accel", "mag")
    step = chosen.node(samples.interval)
    size = chosen.nodes(samples.interval) * step
    if len(samples) < size:
        raise refused("input-few", {"name": "samples", "count": len(samples), "least": size})
    known = prior_constants(chosen)
    with_gyro = chosen.use_gyro and samples.has("gyro")
    delay, lag, windows = (DELAY_SIGMA**-2, 0.0), (DELAY_SIGMA**-2, 0.0), 0
    held = Held()
    held.add(samples)
    for start in range(0, len(samples) - size + 1, size):
        part = held.cut(start, start + size)
        d = demodulate(part, step, known.offset, with_gyro=with_gyro, delay=0.0)
        if with_gyro:
            lag = summed(lag, gyro_evidence(d, step * samples.interval))
            d = demodulate(part, step, known.offset, with_gyro=True, delay=0.0, gyro_lag=lag[1] / lag[0])
        delay, windows = summed(delay, delay_evidence(d, known)), windows + 1
    no_gyro = (np.nan, np.nan)
    return ClockOffset(*_found(delay), *(_found(lag) if with_gyro else no_gyro), windows)


def summed(one: tuple[float, float], other: tuple[float, float]) -> tuple[float, float]:
    """Evidence of both."""
    return one[0] + other[0], one[1] + other[1]


def gyro_evidence(d: Demodulated, span: float) -> tuple[float, float]:
    """Information (1/s^2) about the gyro's lag in one window of nodes of `span` s, and information times lag.

    Least squares of the phase beyond the gyro's angle; the lag that was taken off is counted in.
    """
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
    early = float(clean @ phase) / power
    variance = max(raised(phase - early * clean), 1e-18)
    information = 1.0 / (variance / power + FLOOR_S**2)
    return information, information * (d.gyro_lag - early)


def sight_evidence(before: tuple[float, float, float], now: tuple[float, float, float]) -> tuple[float, float]:
    """Information (1/s^2) about the magnetometer's delay, and information times delay, of two windows of other speeds.

    Notes
    -----
    The hole points where it did, so that the angle from field to gravity changes by the lag alone: by -(w2 - w1) tau.
    """
    faster = now[2] - before[2]
    bends = 2e-3  # rad, by which a string that turns otherwise bends a tool otherwise
    change = float(wrap_signed(now[0] - before[0]))
    variance = before[1] + now[1] + bends**2
    # five standard deviations of the lags there are: the hole has been left, or steel is nearby
    if abs(faster) < 0.5 or abs(change) > SIGNIFICANT * float(np.sqrt(variance + (5e-3 * faster) ** 2)):
        return 0.0, 0.0
    information = faster**2 / variance
    return information, -information * change / faster


def delay_evidence(d: Demodulated, known: ToolConstants, centre: Array | None = None) -> tuple[float, float]:
    """Information (1/s^2) about the magnetometer's delay against the accelerometer, and information times delay.

    Fit of gravity turned back with one regressor more; the delay that was taken off is counted in. `centre` is the
    covariance (2, 2) of the magnetic offset, nT^2: what it does to the phase is noise.
    """
    of, rows = basis(d.rate.size), regressors(d)
    mean = np.concatenate([[0.0], known.motion])
    precision = prior(known.motion_covariance)
    gravity = fit(of, d.gravity, rows, mean, precision, known.trust[0]).value[0]
    slip = -1j * (d.rate - d.rate.mean()) * gravity
    wide = np.zeros((4, 4), dtype=np.complex128)
    wide[1:, 1:] = precision
    wide[0, 0] = DELAY_SIGMA**-2
    columns = np.concatenate([slip[:, None], rows], axis=1)
    found = fit(of, d.gravity, columns, np.append(0.0, mean), wide, known.trust[0])
    variance = float(found.covariance[0, 0].real)
    if variance >= 0.25 * DELAY_SIGMA**2:
        return 0.0, 0.0
    if centre is not None:
        field = max(float(np.abs(d.field).mean()), 1.0)
        turns = [filtered(-np.imag(unit * d.back) / field, d.track.half) for unit in (1.0, 1j)]
        late = np.array([float((found.gain @ (of.tapers @ (-1j * turn * d.gravity))).real) for turn in turns])
        variance += float(late @ centre @ late)
    information = 1.0 / (variance + FLOOR_S**2)
    return information, information * (d.delay + float(found.value[0].real))


def clock_findings(known: ToolConstants, settings: MagneticSettings, fastest: float) -> list[Finding]:
    """What is to be said of the sensors' clocks after a run whose fastest window turned with `fastest` rad/s."""
    found = clocks(known, settings)
    delay, lag = 1e3 * _found(known.delay)[0], 1e3 * found.gyro_lag
    with_gyro = known.gyro_lag[0] > 4.0 * DELAY_SIGMA**-2
    # the gyro's lag against the accelerometer
    agrees = with_gyro and abs(lag + delay) < 1e3 * SIGNIFICANT * float(
        np.hypot(_found(known.gyro_lag)[1], _found(known.delay)[1])
    )
    if found.late and not settings.mag_delay_s and with_gyro and not lag:
        return [Finding("motion-late", {"sensor": "accelerometer", "late_ms": -delay}, severity="note")]
    said = []
    if found.late:
        late = Finding("motion-late", {"sensor": "magnetometer", "late_ms": delay}, severity="note")
        said.append(late if found.stepped else Finding("motion-mag-lag", {"late_ms": delay}, severity="note"))
    if lag and not agrees:
        said.append(Finding("motion-late", {"sensor": "gyro", "late_ms": lag}, severity="note"))
    shift = float(np.degrees(fastest * found.sigma))
    # deg, turn of the field by a delay that cannot be seen, from which it is said
    if not found.seen and shift > 0.01:
        values = {"sigma_ms": 1e3 * found.sigma, "turn_deg": shift}
        said.append(Finding("motion-delay-unseen", values, severity="note"))
    return said
