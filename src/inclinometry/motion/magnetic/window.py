"""The magnetic method, window by window: from samples to an attitude with covariance, of a whole run or a stream."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from inclinometry.arrays import Array, Mask
from inclinometry.constants import STANDARD_GRAVITY, STATED_GRAVITY_SD
from inclinometry.findings import Finding
from inclinometry.motion.magnetic.clocks import (
    SIGNIFICANT,
    Clocks,
    clock_findings,
    clocks,
    delay_evidence,
    gyro_evidence,
    sight_evidence,
    summed,
)
from inclinometry.motion.magnetic.demodulate import (
    MOST_TURN,
    Demodulated,
    Held,
    ToolConstants,
    axial_regressors,
    demodulate,
    prior,
    prior_constants,
    regressors,
)
from inclinometry.motion.magnetic.phase import (
    SECTORS,
    BandFit,
    Basis,
    Circle,
    Complex,
    MagneticSettings,
    arc,
    basis,
    filtered,
    fit,
    fit_circle,
    sectors,
)
from inclinometry.motion.magnetic.whirl import whirl_acceleration
from inclinometry.motion.reference import SiteCheck, departure, inflated, referenced
from inclinometry.motion.result import BITS, METHODS, Attitude, Fault, Samples, joined
from inclinometry.motion.window_filter import bridged
from inclinometry.orientation import angles, dip_angle, dip_jacobian
from inclinometry.rotations import cross_matrix, dcm, quaternion_from_dcm, rotation_z
from inclinometry.tabular import check_record
from inclinometry.uncertainty import propagate


@dataclass(frozen=True, eq=False)
class WindowFit:
    """Fields of one window in the frame that turns with the transverse field, and what was learnt of the tool."""

    # gravity, field: (3,) m/s^2 and nT, x along the transverse field, z along the tool
    gravity: Array
    field: Array
    # covariance, common: (6, 6) of both, and the part that all windows share
    covariance: Array
    common: Array
    phase: float  #: rad, by which the tool has turned at the middle instant
    phase_sigma: tuple[float, float]  #: rad, of the phase: by noise; by late stamps and the delay
    rate: float  #: rad/s, mean speed of rotation
    arc: float  #: rad, turned in the window or, where the run so far gave the circle, met by it
    circle: Circle  #: of the transverse field
    ripple: float  #: nT, scatter about the circle beyond noise
    taken: float  #: how many sums of the fit of gravity the regressors used up; 1 is a plain mean
    clipped: float  #: share of the samples
    constants: ToolConstants  #: with what this window tells
    offset_sigma: float  #: nT, of the mean field by the magnetic offset
    turn: float  #: rad, largest between two samples
    mirrored: bool  #: the fields turn in opposite directions: a wrong axis
    stepped: bool  #: the magnetometer is late by more than eddy currents explain
    whirl: float  #: m/s^2, lateral acceleration that turns otherwise than the tool


def fit_window(samples: Samples, settings: MagneticSettings, known: ToolConstants) -> WindowFit:
    """Fit the fields of a window, with what is known from earlier ones that share no sample with it.

    With u the unit phasor of the transverse field, g_x + i g_y times u* is G + [c + r (omega^2 - i alpha)] u* +
    vibration, where G is constant, c the accelerometer's offset and r its lever arm, constant in the tool. All is seen
    through Slepian sequences, i.e. in a narrow band about zero, where the vibration has little and white power; lines
    of the rotation outside the band drop out of the equations, and what is left is a mean.
    """
    step = settings.node(samples.interval)
    clipped = 0.0 if samples.clipped is None else clipped_share(samples.clipped)
    with_gyro = settings.use_gyro and samples.has("gyro")
    offset, clock = known.offset, clocks(known, settings)
    # nodes in 10 s, the longest stretch in which what goes with the speed is sought: speeds swing in some seconds
    most = round(10.0 / (step * samples.interval))
    for _ in range(3):
        found = demodulate(
            samples,
            step,
            offset,
            with_gyro=with_gyro,
            delay=settings.mag_delay_s,
            eddy=settings.lag_s,
            gyro_lag=clock.gyro_lag,
        )
        covered = arc(np.unwrap(np.angle(found.phasor)))
        points = found.field * found.phasor + offset
        circle, covered, met = _centre(points, covered, known, settings.least_arc)
        if abs(circle.centre - offset) < 1e-4 * circle.radius:
            break
        offset = circle.centre
    # of the transverse field: an offset less known damages the phase so that a delay cannot be told
    uncertain = float(np.sqrt(np.linalg.eigvalsh(circle.covariance)[-1])) / circle.radius
    if uncertain < 2e-2:
        if with_gyro and uncertain < 2e-3:
            known = replace(known, gyro_lag=summed(known.gyro_lag, gyro_evidence(found, step * samples.interval)))
            lag = clocks(known, settings).gyro_lag
            if lag != found.gyro_lag:
                found = demodulate(
                    samples,
                    step,
                    offset,
                    with_gyro=True,
                    delay=settings.mag_delay_s,
                    eddy=settings.lag_s,
                    gyro_lag=lag,
                )
        for piece in _pieces(found, most):
            known = replace(known, delay=summed(known.delay, delay_evidence(piece, known, circle.covariance)))
        clock = clocks(known, settings)
    if clock.delay + clock.eddy != found.delay:
        found = demodulate(
            samples,
            step,
            offset,
            with_gyro=with_gyro,
            delay=clock.delay,
            eddy=clock.eddy,
            gyro_lag=found.gyro_lag,
        )
    fitted = _fields(found, settings, known, circle, covered, clipped, clock, most)
    return replace(fitted, constants=replace(fitted.constants, met=met))


def gravity_to_field_angle(window: WindowFit, clock: float) -> tuple[float, float, float]:
    """Angle from field to gravity as read, its variance by noise, rad^2, and the speed; `clock` s were taken off
    gravity.
    """
    g, b = complex(*window.gravity[:2]), complex(*window.field[:2])
    noise = window.covariance - window.common
    variance = noise[0, 0] / max(abs(g) ** 2, 1e-12) + noise[3, 3] / max(abs(b) ** 2, 1e-12)
    return float(np.angle(g / b)) - clock * window.rate, float(variance), window.rate


def _pieces(d: Demodulated, most: int) -> list[Demodulated]:
    """Equal parts of at most so many nodes: the band of a longer window is too narrow for a swinging speed."""
    count = -(-d.rate.size // max(most, 1))
    if count == 1:
        return [d]
    size = d.rate.size // count
    names = ("gravity", "field", "axial_gravity", "axial_field", "back", "phasor", "rate", "acceleration", "lag")
    cuts = [slice(k * size, (k + 1) * size) for k in range(count)]
    return [replace(d, **{name: getattr(d, name)[cut] for name in names}) for cut in cuts]


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
    most: int,
) -> WindowFit:
    """Band-limited fits of the four series, put together."""
    of = basis(d.rate.size)
    one = np.ones((d.rate.size, 1))
    rows = regressors(d)
    g = fit(of, d.gravity, rows, np.concatenate([[0.0], known.motion]), prior(known.motion_covariance), known.trust[0])
    free, nothing = np.zeros((1, 1), dtype=np.complex128), np.zeros(1, dtype=np.complex128)
    b = fit(of, d.field, one, nothing, free, known.trust[1])
    # what turns with the tool is no whirl; at an even speed it lies outside the band of the fit
    fixed = np.linalg.lstsq(rows[:, 1:], d.gravity - g.value[0], rcond=None)[0]
    whirl = whirl_acceleration(d.gravity - g.value[0] - rows[:, 1:] @ fixed, np.unwrap(np.angle(d.phasor)))
    # an axis that leans outwards as it whirls leaves a part of that along the tool, in proportion to omega^2
    leaning = (settings.tilt_sigma * whirl / max(float(np.mean(d.rate**2)), 1e-6)) ** 2
    gz = _along(d, known, leaning, most)
    bz = fit(of, d.axial_field, one, nothing, free, known.trust[3])
    gravity = np.array([g.value[0].real, g.value[0].imag, gz.value[0].real])
    by_offset = _by_offset(of, d, g, b)
    gain = _by_gain(complex(g.value[0]), complex(b.value[0]), d.rate, settings.bandwidth_hz)
    hann = np.hanning(d.rate.size + 2)[1:-1]
    rate = float(hann @ d.rate / hann.sum())
    turn = _by_delay(complex(b.value[0]), rate * clock.sigma)
    kept = _by_eddies(complex(b.value[0]), d.rate, 0.5 * clock.eddy**2 + settings.lag_sigma_s * clock.sigma)
    shared = np.array([g.shared, g.shared, gz.shared, 0.0, 0.0, 0.0])
    # offsets along the tool that no rotation shows
    along = np.array([0.0, 0.0, settings.accel_sigma**2, 0.0, 0.0, settings.axial_sigma**2])
    common = np.diag(shared + along) + by_offset @ circle.covariance @ by_offset.T
    common += np.outer(gain, gain) + np.outer(turn, turn) + np.outer(kept, kept)
    noise = np.array([float(one.covariance[0, 0].real) for one in (g, g, gz, b, b, bz)])
    covariance = common + np.diag(np.maximum(noise - shared, 0.0)) + _by_clipping(clipped, gravity)
    constants = replace(
        known,
        offset=circle.centre,
        offset_covariance=circle.covariance,
        seen=known.seen or covered >= settings.least_arc,
        motion=g.value[1:],
        motion_covariance=g.covariance[1:, 1:],
        axial=gz.value[1:].real,
        axial_covariance=gz.covariance[1:, 1:].real,
        trust=np.stack([g.trust, b.trust, gz.trust, bz.trust]),
    )
    constants = _levelled(constants, known, d, abs(complex(g.value[0])), clipped > 0.0)
    return WindowFit(
        gravity=gravity,
        field=np.array([b.value[0].real, b.value[0].imag, bz.value[0].real]),
        covariance=covariance,
        common=common,
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
        whirl=whirl,
    )


def _along(d: Demodulated, known: ToolConstants, leaning: float, most: int) -> BandFit:
    """Gravity along the tool, and what of it goes with the speed; `leaning`: variance of the part with omega^2."""
    axial = np.concatenate([[0.0], known.axial]).astype(np.complex128)
    spread: Complex | Array = known.axial_covariance
    spread = spread + np.diag([max(leaning - spread[0, 0].real, 0.0), 0.0])
    pieces = _pieces(d, most)
    # a long window's band is too narrow for what swings in it: its parts tell first what goes with the speed
    for piece in [*(pieces if len(pieces) > 1 else []), d]:
        of, rows = basis(piece.rate.size), axial_regressors(piece)
        found = fit(of, piece.axial_gravity, rows, axial, prior(spread), known.trust[2])
        axial, spread = np.concatenate([[0.0], found.value[1:]]), found.covariance[1:, 1:]
    return found


def _levelled(
    constants: ToolConstants, known: ToolConstants, d: Demodulated, across: float, clipped: bool
) -> ToolConstants:
    """What axial gravity takes over of omega^2, told by the difference to the window before too, of other speeds.

    Within a window of few seconds the speed hardly changes; the hole points where it did, so that mean axial gravity
    changes by the couplings alone.
    """
    of, rows = basis(d.rate.size), axial_regressors(d)
    free = np.zeros((1, 1), dtype=np.complex128)
    mean = fit(of, d.axial_gravity, rows[:, :1], np.zeros(1, dtype=np.complex128), free, known.trust[2])
    weighed = (mean.gain @ (of.tapers @ rows[:, 1:])).real
    now = float(mean.value[0].real), float(weighed[0]), float(weighed[1]), float(mean.covariance[0, 0].real)
    before = known.levelled
    if clipped:
        return replace(constants, levelled=before)
    if before is not None:
        bends = 5e-4  # rad, by which a string that turns otherwise bends a tool otherwise
        slopes = np.subtract(now[1:3], before[1:3])
        off = now[0] - before[0] - float(slopes @ constants.axial)
        gain = constants.axial_covariance @ slopes
        variance = float(slopes @ gain) + now[3] + before[3] + (bends * across) ** 2
        # five standard deviations: the hole has been left
        if off**2 < SIGNIFICANT**2 * variance:
            constants = replace(
                constants,
                axial=constants.axial + gain * off / variance,
                axial_covariance=constants.axial_covariance - np.outer(gain, gain) / variance,
            )
    return replace(constants, levelled=now)


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


def _by_eddies(field: complex, rate: Array, square: float) -> Array:
    """Change (6,) by what eddy currents keep out beside their lag, half the square of omega tau: half is given back."""
    weak = 0.5 * float(np.mean(rate**2)) * square
    return np.array([0.0, 0.0, 0.0, weak * field.real, weak * field.imag, 0.0])


def _phase_sigma(d: Demodulated, mean: float, stamps: float, delay: float) -> tuple[float, float]:
    """rad, of the phase at the middle instant: noise; late stamps, and a delay seen at the mean speed of the window."""
    now = _middle(d.rate)
    return d.track.sigma, float(np.hypot(now * stamps, (now - mean) * delay))


def clipped_share(clipped: Mask) -> float:
    """Share of clipped samples, less what a filter after the clipping has spread them: the shortest run counts as one.

    Examples
    --------
    >>> clipped_share(np.array([False, True, True, False, True, True, True, False]))
    0.3125
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], clipped.view(np.int8), [0]])))
    runs = edges[1::2] - edges[::2]
    # samples over which a filter is thought to spread one that was clipped
    return float(clipped.mean() / min(int(runs.min()), 10)) if runs.size else 0.0


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
    # 4 rad turned, and 0.5 m/s^2 of transverse gravity that stands still the wrong way round
    return covered > 4.0 and wrong > 3.0 * right and wrong > 0.5


def _middle(values: Array) -> float:
    """Value at the middle instant: a node's, or between the two in the middle by the cubic through four."""
    half = values.size // 2
    if values.size % 2:
        return float(values[half])
    a, b, c, d = values[half - 2 : half + 2]
    return float((9.0 * (b + c) - (a + d)) / 16.0)


def attitude_of(window: WindowFit) -> tuple[Array, Array, Array]:
    """Matrix from north-east-down to tool at the middle of the window, its covariance, rad^2, in tool axes, and the
    part of it that the windows of a run have in common.
    """
    g, b = window.gravity, window.field
    found = angles(g, b)
    matrix = dcm(found.azimuth, found.inclination, found.toolface)
    strength = float(np.linalg.norm(g))
    down, east = matrix[:, 2], matrix[:, 1]
    north_part, down_part = float(matrix[:, 0] @ b), float(down @ b)
    # small rotation of north, east and down as g and b change (see `orientation`)
    by_g = cross_matrix(down) / strength - np.outer(down, east) * down_part / (north_part * strength)
    by_b = np.outer(down, east) / north_part
    back = rotation_z(-window.phase)
    rows = back @ np.concatenate([by_g, by_b], axis=1)
    random, late = window.phase_sigma
    covariance, common = propagate(rows, window.covariance), propagate(rows, window.common)
    covariance[2, 2] += random**2 + late**2
    common[2, 2] += late**2
    return np.asarray(back @ matrix), 0.5 * (covariance + covariance.T), 0.5 * (common + common.T)


# What a window can be trusted for: flags, quality, refusal.

SHAKEN: Final = float(np.radians(0.5))
"""Uncertainty of inclination that is called too much vibration."""
LEVEL: Final = 0.02
"""Sine of inclination, or cosine of the angle of b to the horizon, below which azimuth is hardly or not defined."""


@dataclass(frozen=True)
class Verdict:
    """Row of a result: NaN attitude where refused."""

    quaternion: Array
    covariance: Array
    common: Array
    flags: tuple[str, ...]
    quality: float
    method: str
    far: Fault | None = None


def stuck(samples: Samples) -> bool:
    """Whether a transverse channel stands still while its partner moves: it is refused."""
    for triad in (samples.accel, samples.mag):
        if triad is not None and len(triad):
            # nearly always the first few samples tell
            still = [bool((triad[:20, k] == triad[0, k]).all() and (triad[:, k] == triad[0, k]).all()) for k in (0, 1)]
            if still[0] != still[1]:
                return True
    return False


def judge(window: WindowFit, settings: MagneticSettings, is_stuck: bool) -> Verdict:
    """Flags and quality of a window, and its attitude unless it is refused."""
    # sums taken by the regressors up to which the fit was a plain mean
    method = "mean" if window.taken < 1.2 else "magnetic"
    # names of what forbids an attitude
    transverse = float(np.hypot(window.field[0], window.field[1]))
    strength = float(np.linalg.norm(window.field))
    down = window.gravity / max(float(np.linalg.norm(window.gravity)), 1e-9)
    across = float(np.linalg.norm(np.cross(down, window.field))) / max(strength, 1e-9)
    # nT of the transverse field below which there is no phase to turn back by
    unphased = transverse < max(500.0, 3.0 * window.offset_sigma)
    found = {
        "clipped": window.clipped > settings.clipped_share,
        "stuck": is_stuck,
        "aliased": window.turn > MOST_TURN,
        "no-field": unphased or window.circle.scatter > 0.2 * window.circle.radius,  # no field to turn back by
        "axes": window.mirrored,
        "unobservable": unphased or across < LEVEL,
    }
    refused = tuple(name for name, yes in found.items() if yes)
    if refused:
        return _refused(refused, method)
    extra, far = departure(window.gravity, window.field, window.covariance, settings.site)
    if far:
        return _refused(("disturbed", "axes"), method, far)
    excess = _gravity_excess(window, settings)
    window = replace(
        window,
        covariance=inflated(window.covariance, extra, excess),
        common=inflated(window.common, extra, excess),
    )
    seen = window
    if not extra:
        change, covariance, common = referenced(
            window.gravity,
            window.field,
            window.covariance,
            window.common,
            settings.site,
            settings.mag_scale_sigma,
        )
        window = replace(
            window,
            gravity=window.gravity + change[:3],
            field=window.field + change[3:],
            covariance=covariance,
            common=common,
        )
    matrix, covariance, common = attitude_of(window)
    # from six times that on linear covariance and the small mean of shaking no longer hold
    if _tilt(covariance, matrix) > 6.0 * SHAKEN:
        return _refused(("vibration",), method)
    flags, worst = _quality_flags(seen, settings, covariance, matrix)
    flags += ("misfit",) if excess and "misfit" not in flags else ()
    return Verdict(
        quaternion_from_dcm(matrix), covariance, common, flags, float(np.clip(1.0 - worst, 0.0, 1.0)), method
    )


def _refused(names: tuple[str, ...], method: str, far: Fault | None = None) -> Verdict:
    """No attitude, for these reasons."""
    nothing = np.full((3, 3), np.nan)
    return Verdict(np.full(4, np.nan), nothing, nothing, names, 0.0, method, far)


def _gravity_excess(window: WindowFit, settings: MagneticSettings) -> float:
    """m/s^2 by which the mean gravity of a tool that turns differs from the site's, where nothing else explains it.

    An axis that leans as it whirls turns lateral acceleration into a constant, seen as far as it lies along gravity; an
    offset or a scale error looks the same: the row is flagged as a misfit.
    """
    site = settings.site
    if site is None or site.gravity is None or abs(window.rate) * settings.window_s < 4.0 * np.pi:
        return 0.0
    strength = float(np.linalg.norm(window.gravity))
    along = window.gravity / strength
    spread = STATED_GRAVITY_SD * site.gravity if site.gravity_sigma is None else site.gravity_sigma
    own = float(along @ window.covariance[:3, :3] @ along)
    sigma = float(np.sqrt(own + (settings.coupling_sigma * site.gravity) ** 2 + spread**2))
    off = abs(strength - site.gravity)
    return off if off > 4.0 * sigma else 0.0


def _tilt(covariance: Array, matrix: Array) -> float:
    """Standard uncertainty of inclination, rad; 0 near the vertical."""
    down = matrix[:, 2]
    level = float(np.hypot(down[0], down[1]))
    across = np.array([down[1], -down[0]]) / max(level, 1e-12)
    return float(np.sqrt(across @ covariance[:2, :2] @ across)) if level > LEVEL else 0.0


def _quality_flags(
    window: WindowFit, settings: MagneticSettings, covariance: Array, matrix: Array
) -> tuple[tuple[str, ...], float]:
    """Names of what is suspect, and the largest share of a limit that is used up."""
    level = float(np.hypot(matrix[0, 2], matrix[1, 2]))
    tilt = _tilt(covariance, matrix)
    transverse = float(np.hypot(window.field[0], window.field[1]))
    site = settings.site
    gravity = site.gravity if site is not None and site.gravity is not None else STANDARD_GRAVITY
    strength = float(np.linalg.norm(window.gravity))
    along = window.gravity / max(strength, 1e-9)
    sigma = float(np.sqrt(along @ window.covariance[:3, :3] @ along))
    # departure of strength and dip from the site's, over what is allowed; zero where the site states none
    worst = 0.0
    # of the radius, scatter of the transverse field about its circle, less its noise; departure of the strength
    disturbed = 0.02
    if site is not None and site.b is not None:
        worst = abs(float(np.linalg.norm(window.field)) / site.b - 1.0) / disturbed
    if site is not None and site.dip is not None:
        worst = max(worst, abs(float(dip_angle(window.gravity, window.field)) - site.dip) / float(np.radians(1.0)))
    shares = {
        "clipped": window.clipped / max(settings.clipped_share, 1e-12),
        "disturbed": max(window.ripple / window.circle.radius / disturbed, worst),
        "vibration": tilt / SHAKEN,
        "offset": window.offset_sigma / transverse / float(np.radians(0.5)),  # turn of the field worth a flag
        # m/s^2 allowed, beside five standard deviations
        "misfit": abs(strength - gravity) / (0.1 + 5.0 * sigma),
        "aliased": window.turn / MOST_TURN,
    }
    flags = [name for name, share in shares.items() if share > 1.0]
    if window.clipped > 0.0 and "clipped" not in flags:
        flags.append("clipped")
    if not window.constants.seen:
        flags.append("little-arc")
    if level <= max(LEVEL, 3.0 * tilt):
        flags.append("vertical")
    if window.stepped:
        flags.append("step")
    if window.whirl > 0.0:
        flags.append("whirl")
    return tuple(flags), max(shares.values())


def magnetic_attitude(samples: Samples, settings: MagneticSettings | None = None) -> Attitude:
    """Attitude from gravity turned back by the magnetic phase, one row a window at its middle instant.

    Parameters
    ----------
    samples : Samples
        With accelerometer and magnetometer; a gyro, where there is one, carries the phase from sample to sample.
    settings : MagneticSettings, optional

    Returns
    -------
    Attitude
        Azimuth from magnetic north. Method "magnetic" where lines of the rotation fell into the band of the fit and
        were removed, "mean" where none did. Rows of a run shorter than a window: none. Not in the covariance: the
        magnetometer's and accelerometer's scale errors and couplings, and the declination.

    Raises
    ------
    InputError
        No accelerometer or magnetometer, or samples too sparse for the window.

    Notes
    -----
    In the frame that turns with the transverse field gravity is constant while lateral vibration, which stands in the
    hole, has no power near zero frequency; offsets and the lever arm, which turn with the tool, are fitted as
    [1, omega^2 - i alpha] turned back likewise. See `fit_window` and `fit`.

    Examples
    --------
    >>> from inclinometry.orientation import fields
    >>> time = np.arange(2000) / 200.0
    >>> g, b = fields(np.full(2000, 1.0), 0.5, 9.0 * time, 1.1)
    >>> row = magnetic_attitude(Samples(time, 0.005, accel=9.81 * g, mag=50_000.0 * b), MagneticSettings(window_s=10.0))
    >>> [round(float(column[0]), 6) for column in row.angles[:2]], round(float(row.rate[0]), 6)
    ([0.5, 1.0], 9.0)
    """
    check_record(samples, Samples, "magnetic_attitude")
    stream = MagneticStream(settings)
    return joined([stream.push(samples), stream.finish()])


class MagneticStream:
    """The same block by block, with the same result to the last bit however the run is cut."""

    def __init__(self, settings: MagneticSettings | None = None) -> None:
        self.settings = settings or MagneticSettings()
        self._held = Held()
        self._first = 0  # index in the run of the first sample held
        self._known: list[tuple[int, ToolConstants]] = [(0, prior_constants(self.settings))]
        self._gaps = 0
        self._fastest = 0.0  # rad/s
        self._far: tuple[Fault | None, int] = (None, 0)  # why windows were refused, and how many
        self._rows = 0
        self._site_check = SiteCheck(self.settings.site)

    def push(self, samples: Samples) -> Attitude:
        """Take a block; rows of the windows it completes.

        Raises
        ------
        InputError
            No accelerometer or magnetometer, another interval or other triads than before, an overlapping block.
        """
        samples.need("accel", "mag")
        if not len(samples):
            return _table([], [], [])
        if not self._held.add(samples):
            self._gaps += 1
            self._first += len(self._held)
            self._held.clear()
            self._held.add(samples)
        step = self.settings.node(samples.interval)
        size, hop = self.settings.nodes(samples.interval) * step, self.settings.hop(samples.interval) * step
        count = len(self._held)
        if count < size:
            return _table([], [], [])
        times, rates, verdicts = [], [], []
        start = 0
        while start + size <= count:
            part = bridged(self._held.cut(start, start + size))
            rate, verdict = self._window(part, self._first + start, size)
            times.append(float(self._held.stamps(start, start + size).mean()))
            rates.append(rate)
            verdicts.append(verdict)
            start += hop
        self._held.drop(start)
        self._first += start
        self._rows += len(times)
        return _table(times, rates, verdicts)

    def rest(self, samples: Samples) -> None:
        """A window of the same run in which the tool was at rest: nothing turns, and no lag is in its field.

        Against it, the window that turned before and the one that turns next show theirs. The magnetic offset has to
        be known: at rest it turns the field, while it averages out where the tool turns.
        """
        end, known = self._known[-1]
        if not known.seen or samples.accel is None or samples.mag is None:
            return
        settings = self.settings
        g = complex(*samples.accel[:, :2].mean(axis=0)) - complex(known.motion[0])
        b = complex(*samples.mag[:, :2].mean(axis=0)) - known.offset
        offsets = float(known.motion_covariance[0, 0].real) / max(abs(g) ** 2, 1e-12)
        offsets += float(np.linalg.eigvalsh(known.offset_covariance)[-1]) / max(abs(b) ** 2, 1e-12)
        # scale errors and couplings, which average out where the tool turns as well
        variance = offsets + settings.coupling_sigma**2 + settings.mag_scale_sigma**2
        now = float(np.angle(g / b)), variance, 0.0
        if known.sighted is not None:
            known = replace(known, delay=summed(known.delay, sight_evidence(known.sighted, now)))
        self._known[-1] = end, replace(known, sighted=now)

    def finish(self) -> Attitude:
        """End of the run: no rows, but what was found out on the way."""
        constants = self._known[-1][1]
        found = []
        if constants.seen:
            sigma = float(np.sqrt(np.trace(constants.offset_covariance) / 2.0))
            offset = {"x_nT": float(constants.offset.real), "y_nT": float(constants.offset.imag), "u_nT": sigma}
            found.append(Finding("motion-offset-removed", offset, severity="note"))
        found += self._site_check.findings()
        found += clock_findings(constants, self.settings, self._fastest)
        far, count = self._far
        if far is not None:
            found.append(far.counted(count, self._rows))
        if self._gaps:
            found.append(Finding("motion-block-gaps", {"count": self._gaps}, severity="note"))
        if not self._rows:
            found.append(Finding("motion-no-window", {"window_s": self.settings.window_s}))
        return _table([], [], [], tuple(found))

    def _window(self, part: Samples, start: int, size: int) -> tuple[float, Verdict]:
        """Attitude of a window; the tool's constants come from windows that ended before it begins."""
        place = max(k for k, (end, _) in enumerate(self._known) if end <= start)
        end, constants = self._known[place]
        window = fit_window(part, self.settings, constants.aged((start + size - end) * part.interval))
        verdict = judge(window, self.settings, stuck(part))
        self._known = self._known[place:]
        told = not np.isnan(verdict.quaternion[0])
        if told and not set(verdict.flags) & {"clipped", "stuck", "aliased", "no-field"}:
            slopes = dip_jacobian(window.gravity, window.field)
            # of noise: what is allowed for steel along the tool does not excuse it
            u = float(np.sqrt(max(float(slopes @ (window.covariance - window.common) @ slopes), 0.0)))
            self._site_check.add(window.gravity, window.field, u)
        if verdict.far:
            self._far = (self._far[0] or verdict.far, self._far[1] + 1)
        if told:
            # what the field is turned by is no lag where it is disturbed
            if not set(verdict.flags) & {"clipped", "stuck", "aliased", "no-field", "disturbed", "misfit", "offset"}:
                found = clocks(window.constants, self.settings)
                now = gravity_to_field_angle(window, found.delay + found.eddy)
                before, delay = constants.sighted, window.constants.delay
                if before is not None:
                    delay = summed(delay, sight_evidence(before, now))
                window = replace(window, constants=replace(window.constants, delay=delay, sighted=now))
            self._known.append((start + size, window.constants))
            self._fastest = max(self._fastest, abs(window.rate))
        return window.rate, verdict


def _table(
    times: list[float], rates: list[float], verdicts: list[Verdict], findings: tuple[Finding, ...] = ()
) -> Attitude:
    """Rows from verdicts."""
    bits = [sum(BITS[name] for name in verdict.flags) for verdict in verdicts]
    return Attitude(
        time=np.array(times, dtype=np.float64),
        quaternion=np.array([v.quaternion for v in verdicts], dtype=np.float64).reshape(-1, 4),
        covariance=np.array([v.covariance for v in verdicts], dtype=np.float64).reshape(-1, 3, 3),
        common=np.array([v.common for v in verdicts], dtype=np.float64).reshape(-1, 3, 3),
        rate=np.array(rates, dtype=np.float64),
        quality=np.array([v.quality for v in verdicts], dtype=np.float64),
        flags=np.array(bits, dtype=np.uint32),
        method=np.array([METHODS.index(v.method) for v in verdicts], dtype=np.uint8),
        north="magnetic",
        findings=findings,
    )
