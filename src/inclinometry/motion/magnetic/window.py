"""One window: from its samples and what is known of the tool to an attitude with covariance."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from inclinometry.attitude.orientation import angles
from inclinometry.attitude.rotations import cross_matrix, dcm, rotation_z
from inclinometry.core.arrays import Array, Mask
from inclinometry.motion.magnetic.band import BandFit, Basis, Complex, basis, fit
from inclinometry.motion.magnetic.circle import SECTORS, Circle, arc, fit_circle, sectors
from inclinometry.motion.magnetic.constants import ToolConstants
from inclinometry.motion.magnetic.demodulate import Demodulated, demodulate
from inclinometry.motion.magnetic.offset import Clocks, clocks, delay_evidence, gyro_evidence, summed
from inclinometry.motion.magnetic.phase import filtered
from inclinometry.motion.magnetic.regressors import prior, regressors
from inclinometry.motion.magnetic.settings import MagneticSettings
from inclinometry.motion.samples import Samples
from inclinometry.uncertainty.propagation import propagate

LEAST_FIELD_NT: Final = 500.0
"""Transverse field below which there is no phase to turn back by."""

MIRROR_ARC: Final = 4.0
"""rad, turned before the two triads' sense of rotation is compared."""
MOST_SPREAD: Final = 10
"""Samples over which a filter is thought to spread one that was clipped."""
KNOWN_OFFSET: Final = 2e-3
"""Of the transverse field: an offset less known spoils the phase so that a delay cannot be told."""
MIRROR_GRAVITY: Final = 0.5
"""m/s^2, of transverse gravity that stands still the wrong way round."""


@dataclass(frozen=True, eq=False)
class WindowFit:
    """Fields of one window in the frame that turns with the transverse field, and what was learnt of the tool."""

    gravity: Array
    field: Array
    covariance: Array
    phase: float
    phase_sigma: float
    rate: float
    arc: float
    circle: Circle
    ripple: float
    taken: float
    clipped: float
    constants: ToolConstants
    offset_sigma: float
    turn: float
    mirrored: bool
    stepped: bool


def fit_window(samples: Samples, settings: MagneticSettings, known: ToolConstants) -> WindowFit:
    """Fit the fields of a window.

    Parameters
    ----------
    samples : Samples
        Of one window: accelerometer and magnetometer, a gyro if there is one.
    settings : MagneticSettings
    known : ToolConstants
        From earlier windows that share no sample with this one.

    Notes
    -----
    With u the unit phasor of the transverse field, g_x + i g_y times u* is

        G + [c + r (omega^2 - i alpha)] u* + vibration

    where G is constant, c the accelerometer's offset and r its lever arm, constant in the tool. All is seen through
    Slepian sequences, i.e. in a narrow band about zero, where the vibration has little and white power; lines of the
    rotation outside the band drop out of the equations, and what is left is a mean.
    """
    step = settings.node(samples.interval)
    clipped = 0.0 if samples.clipped is None else clipped_share(samples.clipped)
    with_gyro = settings.use_gyro and samples.has("gyro")
    offset, clock = known.offset, clocks(known, settings)
    for _ in range(3):
        found = demodulate(
            samples, step, offset, with_gyro=with_gyro, delay=settings.mag_delay_s, gyro_lag=clock.gyro_lag
        )
        covered = arc(np.unwrap(np.angle(found.phasor)))
        points = found.field * found.phasor + offset
        circle, covered, met = _centre(points, covered, known, settings.least_arc)
        if abs(circle.centre - offset) < 1e-4 * circle.radius:
            break
        offset = circle.centre
    if float(np.linalg.eigvalsh(circle.covariance)[-1]) < (KNOWN_OFFSET * circle.radius) ** 2:
        if with_gyro:
            known = replace(known, gyro_lag=summed(known.gyro_lag, gyro_evidence(found, step * samples.interval)))
            lag = clocks(known, settings).gyro_lag
            if lag != found.gyro_lag:
                found = demodulate(samples, step, offset, with_gyro=True, delay=found.delay, gyro_lag=lag)
        known = replace(known, delay=summed(known.delay, delay_evidence(found, known)))
        clock = clocks(known, settings)
    if clock.delay != found.delay:
        found = demodulate(samples, step, offset, with_gyro=with_gyro, delay=clock.delay, gyro_lag=found.gyro_lag)
    fitted = _fields(found, settings, known, circle, covered, clipped, clock)
    return replace(fitted, constants=replace(fitted.constants, met=met))


def _centre(points: Complex, covered: float, known: ToolConstants, least: float) -> tuple[Circle, float, Complex]:
    """Circle of a window, or of the run so far when that is what it takes; the arc it rests on and the sectors met."""
    circle = fit_circle(points, known.offset, known.offset_covariance)
    if covered >= least or known.seen:
        met = known.met
        if covered < least:
            # an arc that was long enough once: the centre known from it is better than this window's
            circle = Circle(known.offset, known.offset_covariance, circle.radius, circle.scatter)
        return circle, covered, met
    met = known.met + sectors(points, known.offset)
    there = met[1].real > 0.0
    arc_met = float(there.sum()) * 2.0 * np.pi / SECTORS
    if arc_met < least:
        return Circle(known.offset, known.offset_covariance, circle.radius, circle.scatter), covered, met
    return fit_circle(met[0][there] / met[1][there].real, known.offset, known.offset_covariance), arc_met, met


def _fields(
    d: Demodulated,
    settings: MagneticSettings,
    known: ToolConstants,
    circle: Circle,
    covered: float,
    clipped: float,
    clock: Clocks,
) -> WindowFit:
    """Band-limited fits of the four series, put together."""
    of = basis(d.rate.size)
    one = np.ones((d.rate.size, 1))
    g = fit(of, d.gravity, regressors(d), np.concatenate([[0.0], known.motion]), prior(known), known.trust[0])
    free, nothing = np.zeros((1, 1), dtype=np.complex128), np.zeros(1, dtype=np.complex128)
    b, gz, bz = (
        fit(of, np.asarray(series), one, nothing, free, trust)
        for series, trust in zip((d.field, d.axial_gravity, d.axial_field), known.trust[1:], strict=True)
    )
    gravity = np.array([g.value[0].real, g.value[0].imag, gz.value[0].real])
    by_offset = _by_offset(of, d, g, b)
    gain = _by_gain(complex(g.value[0]), complex(b.value[0]), d.rate, settings.bandwidth_hz)
    covariance = _by_noise((g, gz, b, bz), settings) + by_offset @ circle.covariance @ by_offset.T
    covariance += np.outer(gain, gain) + _by_clipping(clipped, gravity)
    hann = np.hanning(d.rate.size + 2)[1:-1]
    rate = float(hann @ d.rate / hann.sum())
    turn = _by_delay(complex(b.value[0]), rate * clock.sigma)
    covariance += np.outer(turn, turn)
    constants = ToolConstants(
        circle.centre,
        circle.covariance,
        known.seen or covered >= settings.least_arc,
        g.value[1:],
        g.covariance[1:, 1:],
        np.stack([g.trust, b.trust, gz.trust, bz.trust]),
        known.delay,
        known.gyro_lag,
        known.met,
    )
    return WindowFit(
        gravity=gravity,
        field=np.array([b.value[0].real, b.value[0].imag, bz.value[0].real]),
        covariance=covariance,
        phase=_middle(np.unwrap(np.angle(d.phasor)) - d.lag),
        phase_sigma=_phase_sigma(d, rate, settings.delay_sigma_s, clock.sigma),
        rate=rate,
        arc=covered,
        circle=circle,
        ripple=float(np.sqrt(max(circle.scatter**2 - (d.track.noise * circle.radius) ** 2, 0.0))),
        taken=g.taken,
        clipped=clipped,
        constants=constants,
        offset_sigma=float(np.sqrt(np.linalg.eigvalsh(by_offset[3:5] @ circle.covariance @ by_offset[3:5].T)[-1])),
        turn=d.turn,
        mirrored=_mirrored(d, covered),
        stepped=clock.stepped,
    )


def _by_noise(fits: tuple[BandFit, BandFit, BandFit, BandFit], settings: MagneticSettings) -> Array:
    """Covariance (6, 6) of gravity and field by noise, and by axial offsets that no rotation shows."""
    g, gz, b, bz = (float(one.covariance[0, 0].real) for one in fits)
    return np.diag([g, g, gz + settings.accel_sigma**2, b, b, bz + settings.axial_sigma**2])


def _by_offset(of: Basis, d: Demodulated, g: BandFit, b: BandFit) -> Array:
    """Derivatives (6, 2) of gravity and field by the magnetic offset that was taken off.

    An offset h too large by dh turns the phase by -Im(dh u*) / |field|, as far as the smoother lets it through. At the
    frequency of rotation this meets the lever arm's centripetal part, which turns just as fast, and leaves a constant.
    """
    jacobian = np.zeros((6, 2))
    field = max(abs(complex(b.value[0])), 1.0)
    for k, unit in enumerate((1.0, 1j)):
        turn = filtered(-np.imag(unit * d.back) / field, d.track.half)
        gravity = complex(g.gain @ (of.tapers @ (-1j * turn * d.gravity)))
        magnetic = complex(b.gain @ (of.tapers @ (-1j * turn * d.field - unit * d.back)))
        jacobian[[0, 1, 3, 4], k] = gravity.real, gravity.imag, magnetic.real, magnetic.imag
    return jacobian


def _by_gain(gravity: complex, field: complex, rate: Array, bandwidth: float) -> Array:
    """Change (6,) of gravity and field when what turns is seen too small by a standard deviation."""
    sigma = 0.5 * float(np.mean(rate**2)) / (2.0 * np.pi * bandwidth) ** 2
    return sigma * np.array([gravity.real, gravity.imag, 0.0, field.real, field.imag, 0.0])


def _by_delay(field: complex, angle: float) -> Array:
    """Change (6,) of gravity and field when the magnetometer is late by so much of a turn: the stamps are gravity's."""
    return np.array([0.0, 0.0, 0.0, -angle * field.imag, angle * field.real, 0.0])


def _phase_sigma(d: Demodulated, mean: float, stamps: float, delay: float) -> float:
    """rad, of the phase at the middle instant: late stamps, and a delay seen at the mean speed of the window."""
    now = _middle(d.rate)
    return float(np.linalg.norm([d.track.sigma, now * stamps, (now - mean) * delay]))


def clipped_share(clipped: Mask) -> float:
    """Share of clipped samples, less what a filter after the clipping has spread them: the shortest run counts as one.

    Examples
    --------
    >>> clipped_share(np.array([False, True, True, False, True, True, True, False]))
    0.3125
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], clipped.view(np.int8), [0]])))
    runs = edges[1::2] - edges[::2]
    return float(clipped.mean() / min(int(runs.min()), MOST_SPREAD)) if runs.size else 0.0


def _by_clipping(share: float, gravity: Array) -> Array:
    """Covariance (6, 6) for what clipping takes from the mean of each axis: its share of clipped time."""
    covariance = np.zeros((6, 6))
    covariance[:2, :2] = share**2 * np.outer(gravity[:2], gravity[:2])
    covariance[2, 2] = (share * gravity[2]) ** 2
    return covariance


def _mirrored(d: Demodulated, covered: float) -> bool:
    """Whether gravity stands still when turned the other way round: an axis of one triad points the wrong way."""
    taper = np.hanning(d.rate.size + 2)[1:-1] / (d.rate.size / 2.0)
    right, wrong = abs(complex(taper @ d.gravity)), abs(complex(taper @ (d.gravity * d.phasor**2)))
    return covered > MIRROR_ARC and wrong > 3.0 * right and wrong > MIRROR_GRAVITY


def _middle(values: Array) -> float:
    """Value at the middle instant: a node's, or between the two in the middle by the cubic through four."""
    half = values.size // 2
    if values.size % 2:
        return float(values[half])
    a, b, c, d = values[half - 2 : half + 2]
    return float((9.0 * (b + c) - (a + d)) / 16.0)


def attitude_of(window: WindowFit) -> tuple[Array, Array]:
    """Matrix from north-east-down to tool at the middle of the window and its covariance, rad^2, in tool axes."""
    g, b = window.gravity, window.field
    found = angles(g, b)
    matrix = dcm(found.azimuth, found.inclination, found.toolface)
    strength = float(np.linalg.norm(g))
    down, east = matrix[:, 2], matrix[:, 1]
    north_part, down_part = float(matrix[:, 0] @ b), float(down @ b)
    # small rotation of north, east and down as g and b change (see attitude.orientation)
    by_g = cross_matrix(down) / strength - np.outer(down, east) * down_part / (north_part * strength)
    by_b = np.outer(down, east) / north_part
    covariance = propagate(np.concatenate([by_g, by_b], axis=1), window.covariance)
    back = rotation_z(-window.phase)
    covariance = back @ covariance @ back.T
    covariance[2, 2] += window.phase_sigma**2
    return np.asarray(back @ matrix), 0.5 * (covariance + covariance.T)


__all__ = ["Complex", "WindowFit", "attitude_of", "fit_window"]
