"""Phase of the transverse field at the nodes, as smooth as the data themselves allow."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray

from inclinometry.arrays import Array
from inclinometry.constants import STRING_INTERFERENCE
from inclinometry.earth.site import Site
from inclinometry.errors import refused
from inclinometry.settings import Range, Settings

LAG_SIGMA: Final = 3e-3
"""s: a collar of 170 mm with a bore of 70 mm of non-magnetic steel (0.7 microohm m) lets a transverse field through
with about 2.7 ms (mu0 / rho times mean radius times half the wall, Kaden H., Wirbelstroeme und Schirmung, 1959)."""


@dataclass(frozen=True, kw_only=True)
class MagneticSettings(Settings):
    """How windows are laid and the prior of the tool."""

    window_s: Annotated[float, Range(0.5, 600.0, "s"), "Length of a window."] = 10.0
    overlap: Annotated[float, Range(0.0, 0.9), "Share of a window that the next one repeats."] = 0.5
    offset_x: Annotated[float, Range(-1e9, 1e9, "nT"), "Transverse magnetic offset known from a calibration."] = 0.0
    offset_y: Annotated[float, Range(-1e9, 1e9, "nT"), "The same along y."] = 0.0
    offset_sigma: Annotated[float, Range(1e-3, 1e5, "nT"), "Its sd per axis; fitted where the arc suffices."] = 300.0
    axial_sigma: Annotated[
        float, Range(1e-3, 1e5, "nT"), "Sd of the axial offset and interference: nothing in a window shows it."
    ] = STRING_INTERFERENCE
    accel_sigma: Annotated[float, Range(1e-9, 1.0, "m/s^2"), "Sd of the accelerometer's offset per axis."] = 0.01
    lever_sigma: Annotated[float, Range(1e-6, 1.0, "m"), "Sd of its distance from the axis of rotation, per axis."] = (
        0.03
    )
    coupling_sigma: Annotated[
        float,
        Range(0.0, 0.1),
        "Sd of the accelerometers' scale errors, couplings and tilt against the axis of rotation.",
    ] = 1e-3
    tilt_sigma: Annotated[float, Range(0.0, 0.1, "rad"), "Sd of the tilt of an axis that whirls."] = float(
        np.radians(0.1)
    )
    mag_scale_sigma: Annotated[
        float,
        Range(0.0, 0.1),
        "Sd of the magnetometer's scale errors and couplings, where the site is compared with it.",
    ] = 3e-3
    least_arc: Annotated[float, Range(0.2, 2.0 * np.pi, "rad"), "Arc from which a circle is fitted to the field."] = 4.0
    clipped_share: Annotated[float, Range(0.0, 0.5), "Share of clipped samples above which a window is refused."] = 0.01
    bandwidth_hz: Annotated[
        float, Range(1.0, 1e6, "Hz"), "What turns with f is thought smaller by a share of about (f / bandwidth)^2 / 2."
    ] = 250.0
    mag_delay_s: Annotated[float, Range(-0.1, 0.1, "s"), "Lateness of the magnetometer (see `clock_offset`)."] = 0.0
    delay_sigma_s: Annotated[
        float, Range(0.0, 0.01, "s"), "Sd of what that leaves; the default is of alike anti-alias filters."
    ] = 1e-4
    lag_s: Annotated[
        float, Range(0.0, 0.05, "s"), "Time constant of eddy currents in the collar: tan(lag) = omega lag_s."
    ] = 0.0
    lag_sigma_s: Annotated[
        float, Range(0.0, 0.05, "s"), "Its sd; a speed that changes shows it to some hundredths of a millisecond."
    ] = LAG_SIGMA
    use_gyro: bool = True
    site: Site | None = None

    def node(self, interval: float) -> int:
        """Samples of a node."""
        # at least 100 nodes a second: 600 rpm turns 0.6 rad between two
        return max(1, int(np.floor(1.0 / (100.0 * interval) + 1e-9)))

    def nodes(self, interval: float) -> int:
        """Nodes of a window.

        Raises
        ------
        InputError
            Samples so sparse that a window holds too few nodes.
        """
        count = round(self.window_s / (self.node(interval) * interval))
        least_nodes = 40  # for the band of the fit to lie well inside what the nodes can show
        if count < least_nodes:
            raise refused("input-few", {"name": "samples", "count": count, "least": least_nodes})
        return count

    def hop(self, interval: float) -> int:
        """Nodes from one window's beginning to the next one's."""
        return max(1, round(self.nodes(interval) * (1.0 - self.overlap)))


# Least squares inside a narrow band about zero frequency, with a noise whose slope in that band is found too.

COUNT: Final = 8
"""Slepian sequences a window is seen through."""
SLOPES: Final = ((2, (1.0, 1e1, 1e2, 1e3)), (4, (1.0, 1e1, 1e2, 1e3, 1e4, 1e5)))
"""Exponent of frequency, and powers that rise with it, averaged over the band, per white power; steeper look alike."""

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Basis:
    """Sequences (k, m) of unit energy, and for each spectrum that is tried what makes its noise white."""

    tapers: Array
    whiteners: Array
    log_determinants: Array


@dataclass(frozen=True, eq=False)
class BandFit:
    """Fit of a complex (or real) series."""

    value: Complex  #: (p,)
    # (p, p) per real component, priors included, widened for the degrees of freedom the noise is known with
    covariance: Complex
    gain: Complex  #: (k,) derivative of the first coefficient by the tapered sums
    trust: Array  #: (r,) logarithm of the weight of each spectrum, the largest 0
    taken: float  #: how many of the sums the regressors used up; 1 is a plain mean
    # variance of the first coefficient, per real component, that comes from the priors: what windows have in common
    shared: float


@lru_cache(maxsize=16)
def basis(size: int) -> Basis:
    """Slepian sequences for windows of `size` nodes.

    Slepian D., Bell System Technical Journal 57, 1978; Thomson D.J., Proceedings IEEE 70, 1982: of all sequences of
    that length they leave the least energy outside their band. Under a spectrum f^2 or f^4 the sums are correlated by
    the products of the sequences' spectra, weighted so.
    """
    from scipy.signal.windows import dpss

    half_band = 6.0  # cycles per window; the last of eight sequences leaves 5e-4 of its energy outside
    tapers = np.ascontiguousarray(dpss(size, half_band, COUNT))
    spectra = np.fft.rfft(tapers, 16 * size)
    # up to three bands a spectrum rises: what the sequences leave outside their band counts with what is there
    frequency = np.minimum(np.arange(spectra.shape[1]) / (16.0 * half_band), 3.0)
    models = [np.eye(COUNT)]
    for power, slopes in SLOPES:
        coloured = ((spectra * frequency**power) @ spectra.conj().T).real
        coloured *= COUNT / np.trace(coloured)
        models += [np.eye(COUNT) + slope * coloured for slope in slopes]
    factors = np.linalg.cholesky(np.stack(models))
    logs = 2.0 * np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(axis=1)
    return Basis(tapers, np.asarray(np.linalg.inv(factors)), logs)


def untried() -> Array:
    """Log weights (r,) of the spectra before the first window."""
    steps = [0, *(step + 1 for _, slopes in SLOPES for step in range(len(slopes)))]
    # nats by which each step of slope is less likely by the prior: white data else look steep once in a while, and
    # their mean is then believed too much (normalised square 2.6 instead of 1.4 in a first window; later ones 1.0)
    return -0.7 * np.array(steps, dtype=np.float64)


def remembered(trust: Array) -> Array:
    """Log weights for the next window from those after a window, (..., r)."""
    memory = 0.9  # of the evidence about spectra, what counts in the next window
    least_trust = -12.0  # nats: no spectrum is ruled out for ever, the next stand may shake otherwise
    return np.asarray(np.maximum(memory * trust + (1.0 - memory) * untried(), least_trust))


def fit(
    of: Basis, series: Complex | Array, regressors: Complex | Array, mean: Complex, precision: Complex, trust: Array
) -> BandFit:
    """Bayesian least squares of a series (m,) inside the band, on regressors (m, p) with prior mean and precision.

    For every spectrum the noise's variance is the residual's own over the sums less those the regressors took, S =
    |e|^2 / 2 (k - tr H), found in turn with the coefficients; Student's distribution widens the covariance by freedom
    / (freedom - 2). Spectra are averaged by their marginal likelihoods, earlier windows' (`trust`, (r,) logarithms)
    included, and what lies between them is added to the covariance.
    """
    parts = 2.0 if np.iscomplexobj(series) else 1.0
    y, x = of.tapers @ series, of.tapers @ regressors
    # series and sums err by 1e-7; an exact record must not make the noise vanish. Where a channel is exactly zero,
    # (m/s^2)^2 or nT^2 beside which priors do not vanish in rounding
    floor = max(1e-7**2 * float(np.vdot(y, y).real) / COUNT, 1e-10)
    y, x = of.whiteners @ y, of.whiteners @ x
    gram, projected = x.conj().swapaxes(1, 2) @ x, np.einsum("rkp,rk->rp", x.conj(), y)
    total = np.einsum("rk,rk->r", y.conj(), y).real
    noise = np.maximum(total / (parts * COUNT), floor)
    for _ in range(6):
        inverse = np.linalg.inv(gram / noise[:, None, None] + precision)
        value = np.einsum("rpq,rq->rp", inverse, projected / noise[:, None] + precision @ mean)
        taken = np.einsum("rpq,rqp->r", inverse, gram).real / noise
        error = y - np.einsum("rkp,rp->rk", x, value)
        misfit = np.einsum("rk,rk->r", error.conj(), error).real
        noise = np.maximum(misfit / (parts * np.maximum(COUNT - taken, 1.0)), floor)
    off = value - mean
    bill = misfit / noise + np.einsum("rp,pq,rq->r", off.conj(), precision, off).real
    information = gram / noise[:, None, None] + precision
    logs = COUNT * np.log(noise) + of.log_determinants + np.linalg.slogdet(information)[1]
    score = trust - 0.5 * (parts * logs + bill)
    score -= score.max()
    weight = np.exp(score)
    weight /= weight.sum()
    freedom = parts * np.maximum(COUNT - taken, 1.0)
    # the widening belongs to the noise, not to the prior
    wide = noise * freedom / np.maximum(freedom - 2.0, 1.0)
    covariance = np.linalg.inv(gram / wide[:, None, None] + precision)
    given = covariance[:, 0]
    weights = weight / noise
    gain = np.einsum("r,rp,rkp,rkl->l", weights, inverse[:, 0], x.conj(), of.whiteners)
    middle = weight @ value
    apart = value - middle
    between = np.einsum("r,rp,rq->pq", weight, apart, apart.conj()) / parts
    return BandFit(
        np.asarray(middle, dtype=np.complex128),
        np.asarray(np.einsum("r,rpq->pq", weight, covariance) + between, dtype=np.complex128),
        np.asarray(gain, dtype=np.complex128),
        score,
        float(weight @ taken),
        float(weight @ np.einsum("rp,pq,rq->r", given, precision, given.conj()).real),
    )


# Transverse magnetic offset: the centre of the circle that the field describes while the tool turns.

SECTORS: Final = 36
"""Of the turn, in which the field of a run is remembered until an arc suffices."""


@dataclass(frozen=True, eq=False)
class Circle:
    """Centre and radius of the transverse field."""

    centre: complex  #: nT
    covariance: Array  #: (2, 2) nT^2, of the real and imaginary part of the centre
    radius: float  #: nT
    scatter: float  #: standard deviation of the distances from the circle, nT


def arc(angle: Array) -> float:
    """Arc covered by an angle (m,) that grows or falls without jumps, rad, at most a full turn.

    Examples
    --------
    >>> arc(np.array([0.5, 1.5, 1.0])), round(arc(np.array([0.0, 100.0])), 3)
    (1.0, 6.283)
    """
    return float(min(np.ptp(angle), 2.0 * np.pi))


def sectors(points: Complex, centre: complex) -> Complex:
    """Sums and numbers (2, SECTORS) of points by their direction from a provisional centre."""
    turn = np.mod(np.angle(points - centre) / (2.0 * np.pi), 1.0)
    place = np.minimum((turn * SECTORS).astype(int), SECTORS - 1)
    found = np.zeros((2, SECTORS), dtype=np.complex128)
    np.add.at(found[0], place, points)
    np.add.at(found[1], place, 1.0)
    return found


def fit_circle(points: Complex, start: complex, prior: Array) -> Circle:
    """Circle of least squared distances, its centre known to (2, 2) `prior` covariance about `start`.

    Gauss-Newton on |z - h| - R. The variance is that of the distances; as they hang together in time (anomalies, a
    field that changes along the hole), their number is reduced by (1 - r) / (1 + r), r their correlation from one to
    the next.
    """
    information = np.zeros((3, 3))
    information[:2, :2] = np.linalg.inv(prior)
    origin = np.array([start.real, start.imag, 0.0])
    state = np.array([start.real, start.imag, float(np.mean(np.abs(points - start)))])
    variance, covariance = np.inf, prior
    # of the radius: what a calibrated magnetometer's scale errors and couplings leave of a circle, a least sigma
    least_roundness = 1e-4
    least_scatter = 1e-3  # nT, where there is no field at all
    for _ in range(20):
        away = points - complex(state[0], state[1])
        distance = np.maximum(np.abs(away), 1e-9)
        error = distance - state[2]
        variance = max(raised(error), (least_roundness * state[2]) ** 2, least_scatter**2)
        rows = np.stack([away.real / distance, away.imag / distance, np.ones_like(distance)], axis=1)
        normal = rows.T @ rows / variance + information
        shift = np.linalg.solve(normal, rows.T @ error / variance - information @ (state - origin))
        state = state + shift
        covariance = np.linalg.inv(normal)[:2, :2]
        if float(np.hypot(shift[0], shift[1])) < 1e-6 * state[2]:
            break
    scatter = float(np.std(np.abs(points - complex(state[0], state[1])) - state[2]))
    return Circle(complex(state[0], state[1]), covariance, float(state[2]), scatter)


def raised(error: Array) -> float:
    """Mean square of errors (m,), raised for their hanging together in time so that it gives the variance of means."""
    variance = float(np.mean(error**2))
    if variance == 0.0:
        return 0.0
    r = min(max(float(np.mean(error[1:] * error[:-1])) / variance, 0.0), 0.98)
    return variance * (1.0 + r) / (1.0 - r)


@dataclass(frozen=True, eq=False)
class Track:
    """Smoothed phase of a window, one value a node."""

    phase: Array  #: (m,) rad, without jumps
    # slope, bend: (m,) first and second derivative per node
    slope: Array
    bend: Array
    noise: float  #: standard deviation of the phase of one node, rad, from leaving each out in turn
    half: int  #: half length of the smoother, nodes
    sigma: float  #: standard deviation of the smoothed phase, rad: its noise, and what it gives away of the motion
    given: Array  #: (m,) the phase before smoothing


@lru_cache(maxsize=64)
def _kernels(half: int) -> tuple[Array, Array, Array]:
    """Weights of value, slope and bend of a local cubic (value: the same as of a local parabola)."""
    if half == 0:
        return np.ones(1), np.zeros(1), np.zeros(1)
    x = np.arange(-half, half + 1.0)
    degree = min(3, 2 * half)
    inverse = np.linalg.pinv(np.vander(x / half, degree + 1, increasing=True))
    return inverse[0], inverse[1] / half, 2.0 * inverse[2] / half**2


def smooth(phase: Array) -> Track:
    """Phase (m,), rad, unwrapped, smoothed by local cubics of the length that predicts best what it has not seen.

    Savitzky A., Golay M.J.E., Analytical Chemistry 36, 1964; the length by leave-one-out cross-validation: residual /
    (1 - h) with h the smoother's weight of the point itself. Beyond the ends the phase is mirrored in their points.
    """
    best: tuple[float, int, Array] | None = None
    values: dict[int, Array] = {0: phase}
    # half lengths that are tried, in nodes; a parabola through three points (1) would meet them all, and there is
    # nothing left to predict
    halves = (2, 3, 4, 6, 9, 13, 19, 28, 42, 63, 95, 142, 213, 320, 480)
    for half in halves:
        if half <= max(2, phase.size // 6):
            value = values[half] = filtered(phase, half)
            inner = slice(half, phase.size - half)
            error = (phase - value)[inner] / (1.0 - _kernels(half)[0][half])
            score = float(np.mean(error**2))
            # a straight line of an exact phase leaves rounding only: the longest is then as good
            if best is None or score < best[0]:
                best = score, half, value
    if best is None:
        zero = np.zeros_like(phase)
        return Track(phase, np.gradient(phase), zero, 0.0, 0, 0.0, phase)
    score, half, value = best
    weights = _kernels(half)[0]
    gain, noise = float(weights @ weights), _noise(score, weights)
    shorter = max(other for other in values if other < half)
    short = _kernels(shorter)[0]
    # two smoothers of which one sees more differ by the noise the other lets through, and by the motion it loses
    lost = float(np.mean((values[shorter] - value) ** 2)) - noise**2 * (float(short @ short) - gain)
    rate = max(half, 2)
    return Track(
        value,
        filtered(phase, rate, 1),
        filtered(phase, rate, 2),
        noise,
        half,
        float(np.sqrt(noise**2 * gain + max(lost, 0.0))),
        phase,
    )


def _noise(score: float, weights: Array) -> float:
    """Standard deviation of a node from the mean square of errors of prediction: node and prediction both err."""
    own = weights[weights.size // 2]
    rest = float(weights @ weights) - own**2
    return float(np.sqrt(score / (1.0 + rest / (1.0 - own) ** 2)))


def filtered(phase: Array, half: int, derivative: int = 0) -> Array:
    """Convolved with the weights, after continuing both ends."""
    left = 2.0 * phase[0] - phase[half:0:-1]
    right = 2.0 * phase[-1] - phase[-2 : -half - 2 : -1]
    weights = _kernels(half)[derivative]
    return np.convolve(np.concatenate([left, phase, right]), weights[::-1], mode="valid")
