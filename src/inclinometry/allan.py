"""Noise of a sensor at rest: overlapping Allan deviation, and the coefficients fitted to it.

Terms of the Allan variance over averaging time t (IEEE Std 952-1997 annex C, IEEE Std 647-2006 annex C):

    quantisation 3 Q^2 / t^2,  angle random walk N^2 / t,  bias instability B^2 2 ln 2 / pi,
    rate random walk K^2 t / 3,  ramp R^2 t^2 / 2.

Units follow the record: a rate in rad/s gives N in rad/sqrt(s), B in rad/s, K in rad/s/sqrt(s), Q in rad, R in rad/s^2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, finite, frozen
from inclinometry.errors import not_among, out_of_range, refused, wrong_shape
from inclinometry.findings import Finding
from inclinometry.tabular import Column, Tabular, draw

# How the points of an overlapping Allan curve vary together.
#
# The record is the integrated rate theta sampled evenly; a point is the mean square of second differences
# D_m(k) = (theta[k + 2 m] - 2 theta[k + m] + theta[k]) / (sqrt(2) m). For noise that is Gaussian
#
# cov(v_m, v_m') = mean over k, k' of 2 c(k' - k)^2,      c(l) = cov(D_m(k), D_m'(k + l)),
#
# and c follows from the generalised covariance G of theta, of which second differences need nothing but (time in
# samples)
#
# white rate, N = 1: G = -|t| / 2;  flicker, B = 1: G = t^2 ln|t| / (2 pi);  random walk, K = 1: G = |t|^3 / 12;
# quantisation, Q = 1: G = 1 at t = 0 and 0 elsewhere;  a ramp of rate, R = 1, has c = 0 and mean D = m / sqrt(2).
#
# G gives the mean as well: v_m = (6 G(0) - 8 G(m) + 2 G(2 m)) / (2 m^2), the usual terms of IEEE Std 952-1997, annex C.

_STEPS = np.unique(np.concatenate([np.arange(9), np.round(9.0 * 1.15 ** np.arange(90))]).astype(np.int64))


def design(factor: Array) -> Array:
    """Allan variance (t, 5) of white, flicker, walk, quantisation and ramp with coefficient 1; time in samples."""
    m = factor
    return np.stack([1.0 / m, np.full(len(m), 2.0 * np.log(2.0) / np.pi), m / 3.0, 3.0 / m**2, m**2 / 2.0], axis=1)


def covariance_tensor(factor: Index, samples: int) -> Array:
    """(t, t, 5, 5): the covariance of the points is the quadratic form of this in the squared coefficients."""
    size = len(factor)
    tensor = np.zeros((size, size, 5, 5))
    for i in range(size):
        for j in range(i, size):
            m, other = int(factor[i]), int(factor[j])
            lag, weight = _lags(m, other, samples)
            c = _cross(lag, m, other)
            block = np.zeros((5, 5))
            block[:4, :4] = 2.0 * (c * weight) @ c.T
            # 4 mean(D_m) mean(D_m') c, shared between the two orders of (ramp, noise)
            block[4, :4] = block[:4, 4] = m * other * (c @ weight)
            tensor[i, j], tensor[j, i] = block, block
    return tensor


def _lags(m: int, other: int, samples: int) -> tuple[Index, Array]:
    """Lags at which c is evaluated, and what each stands for in the mean over all pairs.

    c has its kinks where ends of the two differences meet: dense there, geometric between.
    """
    count, count_other = samples + 1 - 2 * m, samples + 1 - 2 * other
    meets = np.unique([a * m - b * other for a in range(3) for b in range(3)])
    steps = _STEPS[: np.searchsorted(_STEPS, 2 * samples)]
    nodes = (meets[:, None] + np.concatenate([-steps[:0:-1], steps])).ravel()
    low, high = 1 - count, count_other - 1
    lag = np.unique(np.concatenate([nodes[(nodes > low) & (nodes < high)], [low, high]]))
    gap = np.diff(lag).astype(np.float64)
    weight = np.full(len(lag), 0.5)
    weight[0], weight[-1] = (0.5, 0.5) if len(lag) > 1 else (1.0, 1.0)
    weight[1:-1] = 0.0
    weight[:-1] += gap / 2.0
    weight[1:] += gap / 2.0
    pairs = np.minimum(count, count_other - lag) - np.maximum(0, -lag)
    return lag, weight * pairs / (float(count) * count_other)


def _cross(lag: Index, m: int, other: int) -> Array:
    """c at each lag for the four random terms, (4, n)."""
    place = np.arange(3)
    t = lag + np.asarray(other * place[:, None] - m * place)[..., None].astype(np.float64)
    weights = np.outer([1.0, -2.0, 1.0], [1.0, -2.0, 1.0])
    size = np.abs(t)
    with np.errstate(divide="ignore", invalid="ignore"):
        flicker = np.where(size > 0.0, t * t * np.log(size), 0.0) / (2.0 * np.pi)
    parts = (-size / 2.0, flicker, size**3 / 12.0, (size == 0.0).astype(np.float64))
    c = np.stack([np.tensordot(weights, part, 2) for part in parts]) / (2.0 * m * other)
    middle = lag + float(other - m)
    # distance, in longer differences, from which flicker follows its asymptote; nearer, digits are not yet lost
    far = np.abs(middle) > 20.0 * max(m, other)
    # fourth derivative of t^2 ln|t|; the other terms end where the differences no longer overlap
    c[:, far] = 0.0
    c[1, far] = -m * other / (2.0 * np.pi * middle[far] ** 2)
    return c


FLAT = float(np.sqrt(2.0 * np.log(2.0) / np.pi))
"""Allan deviation of flicker noise with B = 1: 0.664."""
SHORTEST = 64
"""Samples below which nothing is fitted."""
_NAMES = ("angle_random_walk", "bias_instability", "rate_random_walk", "quantisation", "ramp")


@dataclass(frozen=True, eq=False, repr=False)
class AllanCurve(Tabular):
    """Overlapping Allan deviation of `samples` values, `dt` s apart.

    tau : (t,) averaging times, `factor` x dt, s.
    deviation : (t,) or (t, m) in the unit of the record, m channels.
    edf : (t,) equivalent degrees of freedom for white noise (NIST SP 1065, section 5.4).
    """

    tau: Array
    deviation: Array
    edf: Array
    factor: Index
    dt: float
    samples: int

    def __len__(self) -> int:
        return len(self.tau)

    @property
    def u(self) -> Array:
        """Standard uncertainty of the deviation, same shape: deviation / sqrt(2 edf)."""
        relative = 1.0 / np.sqrt(2.0 * self.edf)
        return np.asarray(self.deviation * (relative if self.deviation.ndim == 1 else relative[:, None]))

    def channel(self, number: int) -> AllanCurve:
        """The curve of one channel of several."""
        one = self.deviation if self.deviation.ndim == 1 else self.deviation[:, number]
        return AllanCurve(self.tau, frozen(one), self.edf, self.factor, self.dt, self.samples)

    def to_dict(self) -> dict[str, Column]:
        """One row an averaging time; deviation and its standard uncertainty in the unit of the record."""
        found: dict[str, Column] = {"tau_s": self.tau, "edf": self.edf}
        if self.deviation.ndim == 1:
            return found | {"deviation": self.deviation, "u_deviation": self.u}
        for place in range(self.deviation.shape[1]):
            found |= {f"deviation_{place + 1}": self.deviation[:, place], f"u_deviation_{place + 1}": self.u[:, place]}
        return found

    def plot(self, ax: Any = None, *, unit: str = "unit of the record") -> Any:
        """Deviation by averaging time, both logarithmic, on matplotlib axes, which are returned."""
        several = np.atleast_2d(self.deviation.T)
        names = [str(place + 1) for place in range(len(several))] if len(several) > 1 else [""]
        lines = {name: (self.tau, one) for name, one in zip(names, several, strict=True)}
        ax = draw(ax, lines, "averaging time, s", f"Allan deviation, {unit}")
        ax.set_xscale("log")
        ax.set_yscale("log")
        return ax


@dataclass(frozen=True)
class Coefficient:
    """One coefficient of a noise model.

    value, u : the coefficient and its standard uncertainty; NaN where the record is too short to see it.
    limit : what it does not exceed, with 95 % confidence.
    """

    value: float
    u: float
    limit: float

    @property
    def seen(self) -> bool:
        """Whether the record shows it: its square is more than two standard deviations from zero."""
        return bool(np.isfinite(self.value))


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """Noise coefficients of one channel.

    angle_random_walk, bias_instability, rate_random_walk : N, B, K in units of the record, sqrt(s) and s.
    quantisation, ramp : Q, R, or None where they were not fitted.
    correlation : (q, q) between the squares of the fitted coefficients, in the order above.
    chi_square, dof : misfit of the curve, its correlation considered.
    """

    angle_random_walk: Coefficient
    bias_instability: Coefficient
    rate_random_walk: Coefficient
    quantisation: Coefficient | None
    ramp: Coefficient | None
    correlation: Array
    chi_square: float
    dof: int

    @property
    def coefficients(self) -> Mapping[str, Coefficient]:
        """Fitted coefficients by name."""
        found = {name: getattr(self, name) for name in _NAMES}
        return MappingProxyType({name: c for name, c in found.items() if c is not None})

    def parts(self, t: ArrayLike) -> dict[str, Array]:
        """Allan deviation of each coefficient that was seen, over averaging times t, s."""
        time = _positive(t, "t")
        deviations = np.sqrt(design(np.ravel(time))).T.reshape(-1, *time.shape)
        return {name: c.value * deviations[_NAMES.index(name)] for name, c in self.coefficients.items() if c.seen}

    def deviation(self, t: ArrayLike) -> Array:
        """Allan deviation of the whole model over averaging times t, s, same shape."""
        return self._deviation(t, _NAMES)

    def rate_sigma(self, t: ArrayLike) -> Array:
        """Standard deviation of a mean rate over t seconds, same shape as t, in the unit of the record.

        sqrt(N^2 / t + B^2 2 ln 2 / pi + K^2 t / 3): from white noise; from flicker as it stands against a reading of
        the same length before it (flicker has no standard deviation of its own); from a random walk that starts where
        the reading does. Coefficients that were not seen count as zero.
        """
        return self._deviation(t, _NAMES[:3])

    def _deviation(self, t: ArrayLike, names: Sequence[str]) -> Array:
        parts = [part**2 for name, part in self.parts(t).items() if name in names]
        return np.asarray(np.sqrt(sum(parts, np.zeros(np.shape(t)))))


def allan_deviation(rate: ArrayLike, dt: float, taus: ArrayLike | None = None) -> AllanCurve:
    """Overlapping Allan deviation of an evenly sampled record.

    Parameters
    ----------
    rate : (n,) or (n, m) array_like
        Means over successive intervals `dt`; any unit.
    dt : float
        s.
    taus : (t,) array_like, optional
        Averaging times, s; each is rounded to a whole number of samples. Ten a decade up to a third of the record when
        not given.

    Returns
    -------
    AllanCurve

    Raises
    ------
    InputError
        Fewer than three samples, values not finite, an averaging time shorter than `dt` or than twice in the record.

    Notes
    -----
    With theta the sum of rate x dt, sigma^2(tau) = mean over k of (theta[k+2m] - 2 theta[k+m] + theta[k])^2 / (2 tau^2)
    (IEEE Std 952-1997, equation C.10): one cumulative sum, then n operations for each averaging time.

    Examples
    --------
    Alternating readings average out in pairs:

    >>> curve = allan_deviation([1.0, -1.0] * 8, 0.5, [0.5, 1.0])
    >>> curve.deviation.round(6), curve.tau
    (array([1.414214, 0.      ]), array([0.5, 1. ]))
    """
    record = finite(rate, "rate")
    if record.ndim not in (1, 2) or len(record) < 3 or record.size == 0:
        raise wrong_shape("rate", record.shape, "(n,) | (n, m), n >= 3")
    step = float(_positive(dt, "dt"))
    size = len(record)
    factor = _factors(taus, step, size)
    phase = np.concatenate([np.zeros((1, *record.shape[1:])), np.cumsum(record - record.mean(axis=0), axis=0)])
    rows = []
    for m in factor.tolist():
        second = phase[2 * m :] - 2.0 * phase[m : size + 1 - m] + phase[: size + 1 - 2 * m]
        rows.append(np.sqrt(np.mean(second**2, axis=0) / 2.0) / m)
    return AllanCurve(frozen(factor * step), frozen(rows), frozen(_edf(factor, size)), factor, step, size)


def fit_noise(curve: AllanCurve, *, quantisation: bool = False, ramp: bool = False) -> NoiseModel:
    """Noise coefficients from the Allan curve of one channel.

    Parameters
    ----------
    curve : AllanCurve
        Of one channel, averaging times well spread (as `allan_deviation` chooses them).
    quantisation, ramp : bool
        Fit Q and R besides N, B and K.

    Returns
    -------
    NoiseModel
        Standard uncertainties hold for Gaussian noise of these kinds; `chi_square` far above `dof` says it is not.
        A coefficient the record is too short to see has an upper limit only.

    Raises
    ------
    InputError
        Several channels, fewer than 64 samples, too few averaging times, a record without any variation.

    Notes
    -----
    Generalised least squares on the Allan variance v = sum of squared coefficients x known functions. The covariance of
    overlapping points, in closed form for the fitted noise, is renewed until it agrees with the fit. The squares are
    fitted freely, so that those seen are not biased by keeping the others from going negative. Limits: Graybill and
    Wang, J. Am. Stat. Assoc. 75 (1980) 869, for a sum of variance components.

    Examples
    --------
    >>> rate = 0.1 * np.random.default_rng(1).standard_normal(20000)
    >>> model = fit_noise(allan_deviation(rate, 0.01))
    >>> n = model.angle_random_walk
    >>> round(n.value, 4), round(n.u, 5), model.rate_random_walk.seen
    (0.0099, 5e-05, False)
    """
    terms = [0, 1, 2] + [3] * quantisation + [4] * ramp
    if curve.deviation.ndim != 1:
        raise wrong_shape("curve.deviation", curve.deviation.shape, "(n,)")
    used = _spread(curve.factor)
    if curve.samples < SHORTEST or len(used) < len(terms) + 2:
        values = {"samples": curve.samples, "least": SHORTEST, "times": len(used), "least_times": len(terms) + 2}
        raise refused("allan-short", values)
    variance = curve.deviation[used] ** 2
    if not variance.max() > 0.0:
        raise refused("allan-constant")
    unit = float(variance.max())
    factor = curve.factor[used]
    tensor = covariance_tensor(factor, curve.samples)[..., terms, :][..., terms]
    functions = design(factor.astype(np.float64))[:, terms]
    squares, gain = _solve(variance / unit, functions, tensor, 2.0 / curve.edf[used])
    covariance = _covariance(tensor, squares)
    spread = gain @ covariance @ gain.T
    left = variance / unit - functions @ squares
    chi_square = float(left @ _inverse(covariance) @ left)
    # powers of the sampling interval that take the coefficients from samples to seconds
    scale = np.sqrt(unit) * np.array([curve.dt ** (0.5, 0.0, -0.5, 1.0, -1.0)[term] for term in terms])
    found = [
        _coefficient(place, squares, gain, tensor, float(spread[place, place]), float(scale[place]))
        for place in range(len(terms))
    ]
    rest = dict(zip(terms[3:], found[3:], strict=True))
    sd = np.sqrt(np.diagonal(spread))
    correlation = frozen(spread / np.multiply.outer(sd, sd))
    return NoiseModel(
        found[0], found[1], found[2], rest.get(3), rest.get(4), correlation, chi_square, len(used) - len(terms)
    )


def _solve(variance: Array, functions: Array, tensor: Array, first: Array) -> tuple[Array, Array]:
    """Squared coefficients, and the matrix that takes them from the variances."""
    weight = np.diag(1.0 / (first * np.maximum(variance, 1e-30) ** 2))
    squares, gain = np.zeros(functions.shape[1]), np.zeros(functions.T.shape)
    size = functions.max(axis=0)
    scaled = functions / size
    for _ in range(40):
        gain = np.linalg.pinv(scaled.T @ weight @ scaled, rcond=1e-14, hermitian=True) @ scaled.T @ weight
        gain = gain / size[:, None]
        before, squares = squares, gain @ variance
        if np.abs(squares - before) @ size <= 1e-9 * np.abs(squares) @ size:
            break
        weight = _inverse(_covariance(tensor, squares))
    return squares, gain


def _covariance(tensor: Array, squares: Array) -> Array:
    kept = np.maximum(squares, 0.0)
    if not kept.any():
        kept[0] = 1.0
    return np.asarray(np.einsum("ijqr,q,r->ij", tensor, kept, kept))


def _inverse(covariance: Array) -> Array:
    """Inverse by the correlation matrix, its smallest eigenvalues kept from being round-off."""
    sd = np.sqrt(np.diagonal(covariance))
    values, vectors = np.linalg.eigh(covariance / np.multiply.outer(sd, sd))
    whole = (vectors / np.maximum(values, 1e-6 * values[-1])) @ vectors.T
    return np.asarray(whole / np.multiply.outer(sd, sd))


def _coefficient(place: int, squares: Array, gain: Array, tensor: Array, variance: float, scale: float) -> Coefficient:
    """One coefficient from its square: value, uncertainty and limit in units of the record and seconds."""
    from scipy.stats import chi2

    row, square = gain[place], float(squares[place])
    without, alone = squares.copy(), np.zeros(len(squares))
    without[place], alone[place] = 0.0, 1.0
    null, both = (float(row @ _covariance(tensor, p) @ row) for p in (without, np.maximum(without, 0.0) + alone))
    # what a coefficient adds to the scatter of its own square: by itself, as degrees of freedom, and with the others
    own = max(float(row @ _covariance(tensor, alone) @ row), 1e-12)
    lost = 1.0 - float(chi2.ppf(0.05, 2.0 / own)) * own / 2.0
    one_sided_95 = 1.6448536269514722
    least, room, z2 = max(square, 0.0), 1.0 - lost**2, one_sided_95**2
    # (limit - square)^2 = z^2 (null + crossed limit) + (lost limit)^2
    half = least + z2 * max(both - null - own, 0.0) / 2.0
    limit = scale * float(np.sqrt((half + np.sqrt(half**2 - room * (least**2 - z2 * null))) / room))
    if square <= 2.0 * np.sqrt(null):
        return Coefficient(float("nan"), float("nan"), limit)
    value = float(np.sqrt(square))
    return Coefficient(scale * value, scale * float(np.sqrt(variance)) / (2.0 * value), limit)


def _positive(value: ArrayLike, name: str) -> Array:
    found = finite(value, name)
    if (found <= 0.0).any():
        raise out_of_range(name, float(found.min()), "> 0 s")
    return found


def _factors(taus: ArrayLike | None, dt: float, samples: int) -> Index:
    if taus is None:
        longest = max(samples // 3, 1)
        return np.unique(np.round(np.geomspace(1, longest, int(10 * np.log10(longest)) + 2)).astype(np.intp))
    wanted = np.atleast_1d(_positive(taus, "taus"))
    longest = samples // 2
    if wanted.max() > (longest + 0.5) * dt or wanted.min() < 0.5 * dt:
        shown = float(wanted.max() if wanted.max() > (longest + 0.5) * dt else wanted.min())
        raise out_of_range("taus", shown, f"{dt:g} .. {longest * dt:g} s")
    return np.unique(np.clip(np.round(wanted / dt), 1, longest).astype(np.intp))


def _edf(factor: Index, samples: int) -> Array:
    """Equivalent degrees of freedom for white noise of rate (NIST SP 1065, table 5), 1 at least."""
    m, points = factor.astype(np.float64), samples + 1.0
    first = 3.0 * (points - 1.0) / (2.0 * m) - 2.0 * (points - 2.0) / points
    return np.asarray(np.maximum(first * 4.0 * m**2 / (4.0 * m**2 + 5.0), 1.0))


def _spread(factor: Index) -> Index:
    """Rows of a curve that are fitted: averaging times so far apart that each adds something."""
    kept = [0]
    for row in range(1, len(factor)):
        # ratio of neighbouring averaging times in the fit: nearer ones say the same twice
        if factor[row] >= 1.5 * factor[kept[-1]]:
            kept.append(row)
    return np.array(kept, dtype=np.intp)


# The noise of every channel of an instrument at rest.


@dataclass(frozen=True, eq=False)
class ChannelNoise:
    """One channel.

    name : of its column, without the unit.
    kind : of its triad.
    unit : of the curve and the coefficients: rad/s, m/s^2, nT, or that of the signal.
    """

    name: str
    kind: str
    unit: str
    curve: AllanCurve
    model: NoiseModel


@dataclass(frozen=True, eq=False, repr=False)
class NoiseRecord(Tabular):
    """A log at rest.

    channels : in the order of the log's triads.
    dt, samples : sampling interval, s, and length of the log.
    inputs : name and digest of what was read.
    findings : what the log and the fit give rise to say.
    """

    channels: Sequence[ChannelNoise]
    dt: float
    samples: int
    inputs: Mapping[str, str]
    findings: tuple[Finding, ...] = ()

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of triads there are."""
        return tuple(dict.fromkeys(channel.kind for channel in self.channels))

    def of(self, kind: str) -> list[ChannelNoise]:
        """The channels of a triad."""
        return [channel for channel in self.channels if channel.kind == kind]

    def to_dict(self) -> dict[str, Column]:
        """One row a channel and averaging time; deviation and its standard uncertainty in the row's unit."""
        curves = [(channel, channel.curve) for channel in self.channels]
        return {
            "channel": [channel.name for channel, curve in curves for _ in curve.tau],
            "unit": [channel.unit for channel, curve in curves for _ in curve.tau],
            "tau_s": np.concatenate([curve.tau for _, curve in curves]),
            "deviation": np.concatenate([curve.deviation for _, curve in curves]),
            "u_deviation": np.concatenate([curve.u for _, curve in curves]),
        }

    def plot(self, ax: Any = None, kind: str | None = None) -> Any:
        """Deviation of the channels of one triad (else the first) by averaging time; returns the axes."""
        channels = self.of(kind or self.kinds[0])
        if not channels:
            raise not_among("kind", str(kind), self.kinds)
        for channel in channels:
            ax = channel.curve.plot(ax, unit=channel.unit)
            ax.lines[-1].set_label(channel.name)
        ax.legend()
        return ax
