"""The scale factor over a run: learnt from station to station as the temperature changes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array, Mask, finite, frozen, within
from inclinometry.core.errors import InputError
from inclinometry.gyro._input import covariances, one_value, per_station, vectors
from inclinometry.gyro.joint import LARGEST, JointBatch, solve_joint

SPAN = 100.0
"""degC by which temperature is divided, so that coefficients are of one size."""

TEMPERATURES = (-273.15, 1000.0)
"""degC."""

TIGHTEST = 1e-9
"""Standard uncertainty below which a scale factor need not be known."""

SURPRISE = 25.0
"""Squared distance, in variances, of a scale from what was expected, beyond which nothing is learnt from it."""

MOST = 3000
"""Stations that `smooth_scale` takes at once."""

SWEEPS = 6


@dataclass(frozen=True, eq=False)
class ScaleBelief:
    """What is known of the scale factor as a function of temperature.

    scale(T) = c0 + c1 d + c2 d^2 + w, d = (T - reference_temperature) / 100 degC; w wanders with temperature.

    coefficients, covariance : (p,), (p, p) of c0, c1 ...; p = 1, 2 or 3.
    walk : standard deviation of the wandering over 1 degC of change (it grows with the root of the change).
    wandered : value and variance of w where it stands, and that temperature, degC; None: nought at the reference.
    jitter : standard deviation of what is each station's own.
    reference_temperature : degC.
    temperature_range : degC in which the belief was formed, None for one that was stated.
    """

    coefficients: Array
    covariance: Array
    walk: float = 0.0
    jitter: float = 0.0
    reference_temperature: float = 20.0
    wandered: tuple[float, float, float] | None = None
    temperature_range: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        mean = finite(self.coefficients, "scale coefficients", (None,))
        spread = finite(self.covariance, "covariance of the scale coefficients")
        if mean.ndim != 1 or not 1 <= mean.size <= 3 or spread.shape != (mean.size, mean.size):
            raise InputError(f"scale coefficients {mean.shape} with covariance {spread.shape}; expected 1 to 3 of them")
        stands = (0.0, 0.0, self.reference_temperature) if self.wandered is None else self.wandered
        finite(stands, "wandered (value, variance, temperature)", (3,))
        for name, value in (("walk", self.walk), ("jitter", self.jitter), ("variance of wandered", stands[1])):
            one_value(value, name, 0.0, 1.0)
        one_value(self.reference_temperature, "reference_temperature", *TEMPERATURES, "degC")
        if self.temperature_range is not None and not self.temperature_range[0] <= self.temperature_range[1]:
            raise InputError(f"temperature_range is {self.temperature_range}; the lower temperature comes first")
        object.__setattr__(self, "wandered", tuple(float(v) for v in stands))
        if np.linalg.eigvalsh(spread).min() < -1e-12 * max(np.trace(spread), 1e-300):
            raise InputError(f"covariance of the scale coefficients is {spread.tolist()}; it must not be negative")
        object.__setattr__(self, "coefficients", frozen(mean))
        object.__setattr__(self, "covariance", frozen(spread))

    def basis(self, temperature: ArrayLike) -> Array:
        """Powers (n, p) of d."""
        d = (finite(temperature, "temperature") - self.reference_temperature) / SPAN
        return np.asarray(d[..., None] ** np.arange(self.coefficients.size))

    def predict(self, temperature: ArrayLike) -> tuple[Array, Array]:
        """Scale and its standard uncertainty (n,) at temperatures, wandering so far and jitter included.

        Examples
        --------
        >>> scale, sd = quadratic_belief().predict([20.0, 120.0])
        >>> scale, sd.round(4)
        (array([1., 1.]), array([0.0011, 0.0059]))
        """
        powers = self.basis(temperature)
        variance = np.einsum("...i,ij,...j->...", powers, self.covariance, powers)
        value, known, stands = self.stands
        since = self.walk**2 * np.abs(np.asarray(temperature, dtype=np.float64) - stands)
        return powers @ self.coefficients + value, np.sqrt(variance + known + since + self.jitter**2)

    @property
    def stands(self) -> tuple[float, float, float]:
        """Value and variance of what has wandered, and the temperature, degC, at which that was."""
        return self.wandered or (0.0, 0.0, self.reference_temperature)


def quadratic_belief(
    scale: float = 1.0,
    sd: float = 0.001,
    *,
    slope_sd: float = 0.005,
    bend_sd: float = 0.003,
    jitter: float = 0.0005,
    walk: float = 0.0,
    reference_temperature: float = 20.0,
) -> ScaleBelief:
    """A scale known at one temperature, with an unknown slope and bend per 100 degC."""
    for name, value in (("sd", sd), ("slope_sd", slope_sd), ("bend_sd", bend_sd)):
        one_value(value, name, 0.0, 10.0)
    spread = np.diag(np.square([sd, slope_sd, bend_sd]))
    return ScaleBelief(np.array([scale, 0.0, 0.0]), spread, walk, jitter, reference_temperature)


def walking_belief(
    scale: float = 1.0,
    sd: float = 0.001,
    *,
    walk: float = 0.0005,
    jitter: float = 0.0,
    reference_temperature: float = 20.0,
) -> ScaleBelief:
    """A scale known at the start that wanders with temperature: sd = walk x root of the change in degC."""
    one_value(sd, "sd", 0.0, 10.0)
    return ScaleBelief(np.array([scale]), np.array([[sd**2]]), walk, jitter, reference_temperature)


@dataclass(frozen=True, eq=False)
class ScaleTrack:
    """The scale factor along a run of n stations.

    temperature : (n,) degC.
    expected, expected_sd : (n,) what was known of each station's scale without its own rates: give these to
        `estimate_north` as `scale` and `scale_sd`.
    scale, scale_sd : (n,) with its own rates.
    learnt : (n,) False where nothing was learnt from a station: ambiguous, not Gaussian, or too far from expectation.
    belief : what is known after the run, for the next one.
    """

    temperature: Array
    expected: Array
    expected_sd: Array
    scale: Array
    scale_sd: Array
    learnt: Mask
    belief: ScaleBelief
    notes: tuple[str, ...] = field(default=())

    def __len__(self) -> int:
        return len(self.scale)


def track_scale(
    rates: ArrayLike,
    covariance: ArrayLike,
    inclination: ArrayLike,
    latitude: float,
    temperature: ArrayLike,
    belief: ScaleBelief,
) -> ScaleTrack:
    """Learn the scale factor online: each station uses what the stations before it have taught.

    Parameters
    ----------
    rates, covariance, inclination, latitude
        As for `solve_joint`, stations in the order they were taken.
    temperature : (n,) array_like
        degC.
    belief : ScaleBelief
        What is known before the first station.

    Returns
    -------
    ScaleTrack

    Raises
    ------
    InputError
        Temperatures missing or not finite, or not one a station.

    Notes
    -----
    A Kalman filter on the belief's coefficients. The measurement is the joint estimate itself: the belief is moved by
    the share in which the station's own rates sharpened its scale, so a station at K = 0 teaches nothing and does no
    harm.

    Examples
    --------
    >>> from inclinometry.gyro.joint import earth_in_tool
    >>> heat, azimuth, slant = np.linspace(20, 140, 60), np.full(60, 0.8), np.linspace(0.1, 0.9, 60)
    >>> readings = earth_in_tool(azimuth, slant, 0.8)[:, :2] / (1 + 0.005 * (heat[:, None] - 20) / 100)
    >>> track = track_scale(readings, np.tile(1e-8 * np.eye(2), (60, 1, 1)), slant, 0.8, heat, quadratic_belief())
    >>> float(track.scale[-1].round(4)), float(track.belief.coefficients[1].round(3))
    (1.006, 0.005)
    """
    high = vectors(rates, "rates", LARGEST)
    cov = covariances(covariance, "covariance", np.isfinite(high[:, 2]), positive=True)
    heat = _temperatures(temperature, len(high))
    slant = per_station(inclination, len(heat), "inclination", 0.0, np.pi, "rad")
    powers, steps = belief.basis(heat), _steps(heat, belief)
    mean = np.append(belief.coefficients, belief.stands[0])
    spread = _blocks(belief)
    expected, expected_sd, scale, scale_sd = (np.empty(len(heat)) for _ in range(4))
    learnt = np.zeros(len(heat), dtype=bool)
    for n in range(len(heat)):
        spread[-1, -1] += steps[n]
        row = np.append(powers[n], 1.0)
        here, variance = float(row @ mean), float(row @ spread @ row) + max(belief.jitter, TIGHTEST) ** 2
        found = solve_joint(high[n : n + 1], cov[n : n + 1], slant[n], latitude, scale=here, scale_sd=np.sqrt(variance))
        after = _posterior(found)
        expected[n], expected_sd[n] = here, np.sqrt(variance)
        scale[n], scale_sd[n] = after.scale[0], np.sqrt(after.variance[0])
        learnt[n] = bool(_teaches(found, after, np.array([here]), np.array([variance]))[0])
        if learnt[n]:
            gain = spread @ row / variance
            mean = mean + gain * (after.scale[0] - here)
            spread = spread - np.outer(gain, gain) * (variance - after.variance[0])
    known = _moved(belief, mean, spread, heat)
    return ScaleTrack(heat, expected, expected_sd, scale, scale_sd, learnt, known, _note(learnt))


def smooth_scale(
    rates: ArrayLike,
    covariance: ArrayLike,
    inclination: ArrayLike,
    latitude: float,
    temperature: ArrayLike,
    belief: ScaleBelief,
) -> ScaleTrack:
    """Learn the scale factor from the whole run: each station uses all others, those after it too.

    Parameters and errors as `track_scale`; for reading a run afterwards.

    Notes
    -----
    The belief is a Gaussian process over the stations. Each station's rates enter as the Gaussian that changes what the
    others say of its scale as the joint estimate does (expectation propagation), so the azimuths stay joint estimates.

    Examples
    --------
    >>> from inclinometry.gyro.joint import earth_in_tool
    >>> heat, slant = np.linspace(20, 140, 60), np.linspace(0.1, 0.9, 60)
    >>> readings = earth_in_tool(0.8, slant, 0.8)[:, :2] / 1.004
    >>> track = smooth_scale(readings, np.tile(1e-8 * np.eye(2), (60, 1, 1)), slant, 0.8, heat, quadratic_belief())
    >>> float(track.scale[0].round(4))
    1.004
    """
    high = vectors(rates, "rates", LARGEST)
    heat = _temperatures(temperature, len(high))
    if len(heat) > MOST:
        raise InputError(
            f"{len(heat)} stations; at most {MOST} at once: split the run, or learn from earlier ones only"
        )
    powers, walked = belief.basis(heat), np.cumsum(_steps(heat, belief))
    mean = powers @ belief.coefficients + belief.stands[0]
    shared = powers @ belief.covariance @ powers.T + np.minimum.outer(walked, walked) + belief.stands[1]
    prior = shared + max(belief.jitter, TIGHTEST) ** 2 * np.eye(len(heat))
    size = len(heat)
    precision, shift = np.zeros(size), np.zeros(size)  # what each station's own rates add, as a Gaussian
    for _ in range(SWEEPS):
        expected, variance = _without_own(prior, mean, precision, shift)
        found = solve_joint(high, covariance, inclination, latitude, scale=expected, scale_sd=np.sqrt(variance))
        after = _posterior(found)
        learnt = _teaches(found, after, expected, variance)
        gained = np.where(learnt, 1.0 / np.minimum(after.variance, variance) - 1.0 / variance, 0.0)
        moved = np.where(gained > 0.0, after.scale / after.variance - expected / variance, 0.0)
        done = np.allclose(gained, precision, rtol=1e-9, atol=1e-6) and np.allclose(moved, shift, rtol=1e-9, atol=1e-6)
        precision, shift = gained, moved
        if done:
            break
    state = np.concatenate([belief.covariance @ powers.T, np.reshape(walked + belief.stands[1], (1, size))])
    start = np.append(belief.coefficients, belief.stands[0])
    end = _blocks(belief)
    end[-1, -1] += walked[-1] if size else 0.0
    weights = np.linalg.solve(np.eye(size) + precision[:, None] * prior, np.diag(precision))
    centre = np.divide(shift, precision, out=mean.copy(), where=precision > 0.0)
    known = _moved(belief, start + state @ weights @ (centre - mean), end - state @ weights @ state.T, heat)
    sd = np.sqrt(variance), np.sqrt(after.variance)
    return ScaleTrack(heat, expected, sd[0], after.scale, sd[1], learnt, known, _note(learnt))


class _Posterior(NamedTuple):
    scale: Array
    variance: Array


def _posterior(found: JointBatch) -> _Posterior:
    """The scale, 1/k, with its own rates."""
    k = np.maximum(found.k, 1e-6)
    return _Posterior(1.0 / k, found.var_k / k**4)


def _teaches(found: JointBatch, after: _Posterior, expected: Array, variance: Array) -> Mask:
    """Stations whose scale may be learnt from."""
    gained = variance - after.variance
    with np.errstate(divide="ignore", invalid="ignore"):
        surprise = np.where(gained > 0.0, (after.scale - expected) ** 2 / gained, 0.0)
    return np.asarray(~found.ambiguous & ~found.weak & (gained > 0.0) & (surprise < SURPRISE))


def _without_own(prior: Array, mean: Array, precision: Array, shift: Array) -> tuple[Array, Array]:
    """Mean and variance (n,) of each station's scale from all others."""
    size = len(mean)
    factor = np.linalg.solve(np.eye(size) + prior * precision, prior)  # (prior^-1 + sites)^-1
    centre = mean + factor @ (shift - precision * mean)
    own = np.diagonal(factor)
    left = 1.0 / own - precision
    return (centre / own - shift) / left, 1.0 / left


def _steps(heat: Array, belief: ScaleBelief) -> Array:
    """Variance (n,) that the wandering gains before each station."""
    return np.asarray(belief.walk**2 * np.abs(np.diff(heat, prepend=belief.stands[2])))


def _temperatures(temperature: ArrayLike, size: int) -> Array:
    heat = finite(temperature, "temperature", (None,))
    within(heat, "temperature", *TEMPERATURES, "degC")
    if heat.shape != (size,) or not size:
        raise InputError(f"{heat.size} temperatures for {size} stations; one a station is needed to follow the scale")
    return heat


def _blocks(belief: ScaleBelief) -> Array:
    """Covariance of the coefficients and the wandering."""
    size = belief.coefficients.size
    spread = np.zeros((size + 1, size + 1))
    spread[:size, :size], spread[size, size] = belief.covariance, belief.stands[1]
    return spread


def _moved(belief: ScaleBelief, mean: Array, spread: Array, heat: Array) -> ScaleBelief:
    """The belief after a run; the wandering's correlation with the coefficients is given up."""
    size = belief.coefficients.size
    low, high = float(heat.min()), float(heat.max())
    if belief.temperature_range is not None:
        low, high = min(low, belief.temperature_range[0]), max(high, belief.temperature_range[1])
    coefficients = 0.5 * (spread + spread.T)[:size, :size]
    return ScaleBelief(
        mean[:size],
        coefficients,
        belief.walk,
        belief.jitter,
        belief.reference_temperature,
        (float(mean[size]), max(float(spread[size, size]), 0.0), float(heat[-1])),
        (low, high),
    )


def _note(learnt: Mask) -> tuple[str, ...]:
    left = int(np.sum(~learnt))
    if not left:
        return ()
    return (f"nothing was learnt of the scale from {left} of {len(learnt)} stations: K near nought or out of line",)
