"""The scale factor over a run: learnt from station to station as the temperature changes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Mask, finite, frozen, within
from inclinometry.errors import InputError
from inclinometry.gyro.joint import LARGEST, SCALES, JointBatch, solve_joint
from inclinometry.gyro.result import covariances, one_value, per_station, vectors
from inclinometry.tabular import Column, Tabular, draw

SPAN = 100.0
"""degC by which temperature is divided, so that coefficients are of one size."""

TEMPERATURES = (-273.15, 1000.0)
"""degC."""

TIGHTEST = 1e-9
"""Standard uncertainty below which a scale factor need not be known."""


SURPRISE = 25.0
"""Squared distance, in variances, of a scale from what was expected, beyond which nothing is learnt from it."""

DOUBTFUL = 9.0
"""Squared misfit of a station, in variances, beyond which it speaks against what is believed of the scale."""


FINENESS = 2e-3
"""Relative step of the scale factors tried for that."""

UNSEEN = 2.0
"""degC by which two stations that follow one another may differ where no temperature is measured: 30 m of a steep
geothermal gradient."""

MOST = 3000
"""Stations that `smooth_scale` takes at once."""


@dataclass(frozen=True, eq=False)
class ScaleBelief:
    """What is known of the scale factor as a function of temperature.

    scale(T) = c0 + c1 d + c2 d^2 + w, d = (T - reference_temperature) / 100 degC; w wanders with temperature.

    coefficients, covariance : (p,), (p, p) of c0, c1 ...; p = 1, 2 or 3.
    walk : standard deviation of the wandering over 1 degC of change (it grows with the root of the change).
    wandered : value and variance of w where it stands, and that temperature, degC; None: zero at the reference.
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


@dataclass(frozen=True, eq=False, repr=False)
class ScaleTrack(Tabular):
    """The scale factor along a run of n stations.

    temperature : (n,) degC; without a thermometer a stand-in, `UNSEEN` degC from one station to the next.
    expected, expected_sd : (n,) what was known of each station's scale without its own rates: give these to
        `estimate_north` as `scale` and `scale_sd`.
    scale, scale_sd : (n,) with its own rates.
    learnt : (n,) False where nothing was learnt from a station: ambiguous, not Gaussian, or too far from expectation.
    belief : what is known after the run, for the next one.
    thermometer : whether the temperatures were measured.
    prior : what was known before the run: as given, or widened where the readings contradict it.
    shared : (n, r) factors F of F F', the covariance of the stations' scales that is left when all readings of the run
        are known, without what is each station's own; no columns where stations only know those before them.
    """

    temperature: Array
    expected: Array
    expected_sd: Array
    scale: Array
    scale_sd: Array
    learnt: Mask
    belief: ScaleBelief
    prior: ScaleBelief
    thermometer: bool = True
    notes: tuple[str, ...] = field(default=())
    shared: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def __len__(self) -> int:
        return len(self.scale)

    def to_dict(self) -> dict[str, Column]:
        """One row a station: temperature, the scale factor expected and found, whether something was learnt from it."""
        return {
            "temperature_degC": self.temperature,
            "expected": self.expected,
            "u_expected": self.expected_sd,
            "scale": self.scale,
            "u_scale": self.scale_sd,
            "learnt": np.asarray(self.learnt),
        }

    def plot(self, ax: Any = None) -> Any:
        """Scale factor by temperature on matplotlib axes, which are returned."""
        lines = {"expected": (self.temperature, self.expected), "found": (self.temperature, self.scale)}
        return draw(ax, lines, "temperature, degC", "scale factor", "o")


class ScaleStep(NamedTuple):
    """One station of a `ScaleTracker`, named as in `ScaleTrack`; azimuth, rad, with its sd by gyros and scale alone."""

    temperature: float
    expected: float
    expected_sd: float
    scale: float
    scale_sd: float
    learnt: bool
    azimuth: float
    azimuth_sd: float


class ScaleTracker:
    """The scale factor station by station, as the readings come in.

    Parameters
    ----------
    belief : ScaleBelief
        What is known before the first station.
    latitude : float
        rad, north positive.
    thermometer : bool
        False where no temperature is measured: the scale then wanders as if it changed by `UNSEEN` degC a station.

    Notes
    -----
    A Kalman filter on the belief's coefficients. The measurement is the joint estimate itself: the belief is moved by
    the share in which the station's own rates sharpened its scale, so a station at K = 0 teaches nothing and does no
    harm. Where the stations so far contradict the belief, it is widened and they are learnt from anew: `steps` then
    holds all stations with the widened belief: what `add` said of the first ones rested on the contradicted one.

    Examples
    --------
    >>> from inclinometry.gyro.joint import earth_in_tool
    >>> tracker = ScaleTracker(quadratic_belief(), latitude=0.8)
    >>> for heat in (20.0, 30.0, 40.0):
    ...     step = tracker.add(earth_in_tool(0.8, 0.3, 0.8)[:2] / 1.001, 1e-8 * np.eye(2), 0.3, heat)
    >>> round(step.expected, 4), round(step.scale, 4), len(tracker.notes)
    (1.001, 1.001, 0)
    """

    def __init__(self, belief: ScaleBelief, latitude: float, *, thermometer: bool = True) -> None:
        self.stated = self.prior = belief
        self.latitude = one_value(latitude, "latitude", -np.pi / 2, np.pi / 2, "rad")
        self.thermometer = thermometer
        self._stations: list[tuple[Array, Array, float, float]] = []
        self.steps: list[ScaleStep] = []
        self._check = _BeliefCheck(belief, self.latitude)
        self._begin(belief)

    def _begin(self, belief: ScaleBelief) -> None:
        self.prior, self._at = belief, belief.stands[2]
        self._mean, self._spread = np.append(belief.coefficients, belief.stands[0]), _blocks(belief)

    def add(
        self, rates: ArrayLike, covariance: ArrayLike, inclination: float, temperature: float | None = None
    ) -> ScaleStep:
        """One station: rates (2,) or (3,) and their covariance as for `solve_joint`, rad, degC."""
        high = vectors(np.asarray(rates, dtype=np.float64)[None], "rates", LARGEST)
        cov = covariances(covariance, "covariance", np.isfinite(high[:, 2]), positive=True)
        slant = one_value(inclination, "inclination", 0.0, np.pi, "rad")
        if (temperature is not None) != self.thermometer:
            wanted = "needed" if self.thermometer else "not expected: the tracker was told there is no thermometer"
            raise InputError(f"temperature is {temperature}; it is {wanted}")
        last = self._stations[-1][3] if self._stations else self.stated.stands[2]
        heat = float(_temperatures([last + UNSEEN if temperature is None else temperature], 1)[0])
        self._stations.append((high, cov, slant, heat))
        self._check.add(high, cov, np.array([slant]), np.array([heat]))
        prior = self._check.verdict()
        if abs(prior.coefficients[0] - self.prior.coefficients[0]) > 0.1 * np.sqrt(prior.covariance[0, 0]):
            self._begin(prior)
            self.steps = [self._take(*station) for station in self._stations[:-1]]
        self.steps.append(self._take(high, cov, slant, heat))
        return self.steps[-1]

    def _take(self, high: Array, cov: Array, slant: float, heat: float) -> ScaleStep:
        belief = self.prior
        self._spread[-1, -1] += belief.walk**2 * abs(heat - self._at)
        self._at = heat
        row = np.append(belief.basis(heat), 1.0)
        here, variance = float(row @ self._mean), float(row @ self._spread @ row) + max(belief.jitter, TIGHTEST) ** 2
        found = solve_joint(high, cov, slant, self.latitude, scale=here, scale_sd=np.sqrt(variance))
        scale, left = _posterior(found)
        learnt = bool(_teaches(found, scale, left, np.array([here]), np.array([variance]))[0])
        if learnt:
            gain = self._spread @ row / variance
            self._mean = self._mean + gain * (scale[0] - here)
            self._spread = self._spread - np.outer(gain, gain) * (variance - left[0])
        own = float(scale[0]), float(np.sqrt(left[0]))
        turn = float(found.azimuth[0]), float(np.sqrt(found.var_azimuth[0]))
        return ScaleStep(heat, here, float(np.sqrt(variance)), *own, learnt, *turn)

    @property
    def belief(self) -> ScaleBelief:
        """What is known after the stations so far."""
        heat = np.array([heat for *_, heat in self._stations] or [self._at])
        return _moved(self.prior, self._mean, self._spread, heat)

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences for the user."""
        return (*widened(self.stated, self.prior), *_note(np.array([step.learnt for step in self.steps], dtype=bool)))


class _BeliefCheck:
    """Whether the readings contradict the prior of the scale.

    One scale factor for all stations, but for what the belief allows them to differ by, is tried over 0.5 to 2: a wrong
    root is another scale at every station, the right one is the same at all. The squared misfit of each station and
    that of the belief count up to 25 (five standard uncertainties), so that one disturbed station outvotes nothing, and
    two that agree outvote a statement.
    """

    def __init__(self, belief: ScaleBelief, latitude: float) -> None:
        self.belief, self.latitude = belief, latitude
        rest = belief.covariance.copy()
        rest[0, :] = rest[:, 0] = 0.0
        self._others = replace(belief, covariance=rest)
        self._centre, self._sd = (
            float(belief.coefficients[0]),
            float(np.hypot(belief.covariance[0, 0] ** 0.5, TIGHTEST)),
        )
        self._tried = np.append(self._centre, np.exp(np.arange(np.log(0.5), np.log(2.0), FINENESS)))
        self._cost, self._fits = np.zeros(len(self._tried)), np.zeros(len(self._tried))
        self._waiting: list[tuple[Array, ...]] = []
        self._size = self._against = 0

    def add(self, high: Array, covariance: Array, inclination: Array, heat: Array) -> None:
        """More stations; what costs time waits until two of them speak against the belief."""
        expected, sd = self.belief.predict(heat)
        here = solve_joint(high, covariance, inclination, self.latitude, scale=expected, scale_sd=sd)
        self._against += int(np.sum(here.cost > DOUBTFUL))
        self._size += len(high)
        self._waiting.append((high, covariance, inclination, heat))

    def verdict(self) -> ScaleBelief:
        """The belief; where it is contradicted, centred on what fits best and wide enough for the step."""
        if self._against < 2:
            return self.belief
        for high, covariance, inclination, heat in self._waiting:
            tried, size = self._tried[:, None], len(high)
            expected, differs = self._others.predict(heat)
            found = solve_joint(
                np.tile(high, (len(tried), 1)),
                np.tile(covariance, (len(tried), 1, 1)),
                np.tile(inclination, len(tried)),
                self.latitude,
                scale=np.clip(expected + tried - self._centre, *SCALES).ravel(),
                scale_sd=np.hypot(np.broadcast_to(differs, (len(tried), size)), 0.5 * FINENESS * tried).ravel(),
            )
            cost = found.cost.reshape(len(tried), size)
            self._cost += np.minimum(cost, SURPRISE).sum(axis=1)
            self._fits += np.sum(cost < DOUBTFUL, axis=1)
        self._waiting = []
        own = np.minimum(((self._tried - self._centre) / self._sd) ** 2, SURPRISE)
        best = int(np.argmin(self._cost + own))
        # squared distance, in variances: well before a station's own surprise keeps it from teaching anything
        if own[best] < 16.0 or self._fits[best] < 0.5 * self._size:
            return self.belief
        wide = self.belief.covariance.copy()
        wide[0, 0] += (self._tried[best] - self._centre) ** 2
        return replace(
            self.belief, coefficients=np.append(self._tried[best], self.belief.coefficients[1:]), covariance=wide
        )


def contradicted(
    rates: Array, covariance: Array, inclination: Array, latitude: float, temperature: Array, belief: ScaleBelief
) -> ScaleBelief:
    """The belief, or where the readings of a run contradict it the belief widened so that it covers what they say.

    Parameters as `track_scale`, checked.
    """
    # 200 stations are enough to ask
    rows = np.unique(np.linspace(0, len(rates) - 1, min(len(rates), 200)).astype(int))
    check = _BeliefCheck(belief, latitude)
    check.add(rates[rows], covariance[rows], inclination[rows], temperature[rows])
    return check.verdict()


def widened(stated: ScaleBelief, used: ScaleBelief) -> tuple[str, ...]:
    """What to say of a belief that the readings contradict."""
    if used is stated:
        return ()
    value, sd = stated.coefficients[0], stated.covariance[0, 0] ** 0.5
    found, wide = used.coefficients[0], used.covariance[0, 0] ** 0.5
    return (
        f"the scale factor stated, {value:.4g} +- {100.0 * sd:.2g} %, contradicts the readings, which fit {found:.4g}; "
        f"it was widened to {found:.4g} +- {100.0 * wide:.2g} %: state what is known of it (--scale-sd-percent), and "
        "check the calibration and the latitude",
    )


def track_scale(
    rates: ArrayLike,
    covariance: ArrayLike,
    inclination: ArrayLike,
    latitude: float,
    temperature: ArrayLike | None,
    belief: ScaleBelief,
) -> ScaleTrack:
    """Learn the scale factor online: each station uses what the stations before it have taught.

    Parameters
    ----------
    rates, covariance, inclination, latitude
        As for `solve_joint`, stations in the order they were taken.
    temperature : (n,) array_like or None
        degC; None where it is not measured: the scale then wanders as if it changed by `UNSEEN` degC a station.
    belief : ScaleBelief
        What is known before the first station.

    Returns
    -------
    ScaleTrack

    Raises
    ------
    InputError
        Temperatures not finite, or not one a station.

    Notes
    -----
    Station by station through a `ScaleTracker`, which see.

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
    slant = per_station(inclination, len(high), "inclination", 0.0, np.pi, "rad")
    heat = None if temperature is None else _temperatures(temperature, len(high)).tolist()
    tracker = ScaleTracker(belief, latitude, thermometer=heat is not None)
    for n in range(len(high)):
        tracker.add(high[n], cov[n], float(slant[n]), None if heat is None else heat[n])
    found = np.array([step[:5] for step in tracker.steps]).T
    learnt = np.array([step.learnt for step in tracker.steps], dtype=bool)
    measured = heat is not None
    return ScaleTrack(
        found[0], found[1], found[2], found[3], found[4], learnt, tracker.belief, tracker.prior, measured, tracker.notes
    )


def smooth_scale(
    rates: ArrayLike,
    covariance: ArrayLike,
    inclination: ArrayLike,
    latitude: float,
    temperature: ArrayLike | None,
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
    covariance = covariances(covariance, "covariance", np.isfinite(high[:, 2]), positive=True)
    slant = per_station(inclination, len(high), "inclination", 0.0, np.pi, "rad")
    unseen = belief.stands[2] + UNSEEN * np.arange(1.0, len(high) + 1.0)
    heat = _temperatures(unseen if temperature is None else temperature, len(high))
    if len(heat) > MOST:
        raise InputError(
            f"{len(heat)} stations; at most {MOST} at once: split the run, or learn from earlier ones only"
        )
    stated, belief = belief, contradicted(high, covariance, slant, latitude, heat, belief)
    powers = belief.basis(heat)
    walked = np.cumsum(belief.walk**2 * np.abs(np.diff(heat, prepend=belief.stands[2])))
    mean = powers @ belief.coefficients + belief.stands[0]
    shared = powers @ belief.covariance @ powers.T + np.minimum.outer(walked, walked) + belief.stands[1]
    prior = shared + max(belief.jitter, TIGHTEST) ** 2 * np.eye(len(heat))
    size = len(heat)
    precision, shift = np.zeros(size), np.zeros(size)  # what each station's own rates add, as a Gaussian
    # one station teaches the scale to this standard uncertainty at best: what is sharper drowns in rounding
    sharpest = 1e-7
    for _ in range(6):
        # mean and variance (n,) of each station's scale from all others, by (prior^-1 + precision)^-1
        factor = np.linalg.solve(np.eye(size) + prior * precision, prior)
        centre = mean + factor @ (shift - precision * mean)
        own = np.diagonal(factor)
        rest = 1.0 / own - precision
        expected, variance = (centre / own - shift) / rest, 1.0 / rest
        found = solve_joint(high, covariance, slant, latitude, scale=expected, scale_sd=np.sqrt(variance))
        scale, left = _posterior(found)
        learnt = _teaches(found, scale, left, expected, variance)
        sharp = np.clip(left, sharpest**2, variance)
        gained = np.where(learnt, 1.0 / sharp - 1.0 / variance, 0.0)
        moved = np.where(gained > 0.0, scale / sharp - expected / variance, 0.0)
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
    sd = np.sqrt(variance), np.sqrt(left)
    notes = (*widened(stated, belief), *_note(learnt))
    # what is left of the coefficients; of a wandering scale, which has as many values as stations, of those
    spread = shared - shared @ weights @ shared if belief.walk else end - state @ weights @ state.T
    values, turn = np.linalg.eigh(0.5 * (spread + spread.T))
    turn = turn if belief.walk else np.column_stack([powers, np.ones(size)]) @ turn
    left_open = turn * np.sqrt(np.clip(values, 0.0, None))
    left_open = left_open[:, values > 1e-9 * values[-1]]
    return ScaleTrack(
        heat, expected, sd[0], scale, sd[1], learnt, known, belief, temperature is not None, notes, left_open
    )


def _posterior(found: JointBatch) -> tuple[Array, Array]:
    """The scale, 1/k, with its own rates, and its variance."""
    k = np.maximum(found.k, 1e-6)
    return 1.0 / k, found.var_k / k**4


def _teaches(found: JointBatch, scale: Array, left: Array, expected: Array, variance: Array) -> Mask:
    """Stations whose scale, of the variance `left`, may be learnt from."""
    gained = variance - left
    with np.errstate(divide="ignore", invalid="ignore"):
        surprise = np.where(gained > 0.0, (scale - expected) ** 2 / gained, 0.0)
    return np.asarray(~found.ambiguous & ~found.weak & (gained > 0.0) & (surprise < SURPRISE))


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
    return (
        f"nothing was learnt of the scale factor from {left} of {len(learnt)} stations: it is not observable there (K "
        "near zero), or the station is out of line with the others",
    )
