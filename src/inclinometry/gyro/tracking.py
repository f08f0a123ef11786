"""The scale factor over a run: learnt from station to station, and from its temperature where that is measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Mask, finite, frozen, within
from inclinometry.errors import InputError, out_of_order, out_of_range, refused, wrong_shape
from inclinometry.findings import Finding
from inclinometry.gyro.joint import LARGEST
from inclinometry.gyro.point_mass import (
    FINEST,
    HIGHEST,
    JUMP,
    LOWEST,
    OWN,
    STEPS,
    WIDEST,
    Bank,
    Forward,
    Grid,
    Members,
    Rates,
    ScaleLaw,
    Smoothed,
    smoothed,
    solve_law,
)
from inclinometry.gyro.result import covariances, one_value, per_station, vectors
from inclinometry.opening import too_large
from inclinometry.tabular import Column, Tabular, draw

SPAN = 100.0
"""degC by which temperature is divided, so that coefficients are of one size."""

TEMPERATURES = (-273.15, 1000.0)
"""degC."""

MOST = 3000
"""Stations that `smooth_scale` takes at once."""


@dataclass(frozen=True, eq=False)
class ScaleState:
    """What is known of the scale factor before a run, as a function of temperature.

    scale(T) = c0 + c1 d + c2 d^2, d = (T - reference_temperature) / 100 degC.
    """

    coefficients: Array  #: (p,) of c0, c1 ...; p = 1, 2 or 3
    covariance: Array  #: (p, p)
    reference_temperature: float = 20.0  #: degC
    # degC in which the state was formed, None for one that was stated
    temperature_range: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        mean = finite(self.coefficients, "coefficients", (None,))
        spread = finite(self.covariance, "covariance")
        if mean.ndim != 1 or not 1 <= mean.size <= 3 or spread.shape != (mean.size, mean.size):
            raise wrong_shape("coefficients, covariance", f"{mean.shape}, {spread.shape}", "(p,), (p, p), 1 <= p <= 3")
        one_value(self.reference_temperature, "reference_temperature", *TEMPERATURES, "degC")
        if self.temperature_range is not None and not self.temperature_range[0] <= self.temperature_range[1]:
            low, high = self.temperature_range
            raise out_of_order("temperature_range", high, low, 2)
        if np.linalg.eigvalsh(spread).min() < -1e-12 * max(np.trace(spread), 1e-300):
            raise out_of_range("eig(covariance)", float(np.linalg.eigvalsh(spread).min()), ">= 0")
        object.__setattr__(self, "coefficients", frozen(mean))
        object.__setattr__(self, "covariance", frozen(spread))

    def basis(self, temperature: ArrayLike) -> Array:
        """Powers (n, p) of d."""
        d = (finite(temperature, "temperature") - self.reference_temperature) / SPAN
        return np.asarray(d[..., None] ** np.arange(self.coefficients.size))

    def predict(self, temperature: ArrayLike) -> tuple[Array, Array]:
        """Scale and its standard uncertainty (n,) at temperatures, degC."""
        powers = self.basis(temperature)
        return powers @ self.coefficients, np.sqrt(np.einsum("...i,ij,...j->...", powers, self.covariance, powers))


def quadratic_belief(
    scale: float = 1.0,
    sd: float = 0.001,
    *,
    slope_sd: float = 0.005,
    bend_sd: float = 0.003,
    reference_temperature: float = 20.0,
) -> ScaleState:
    """A scale known at one temperature, with an unknown slope and bend per 100 degC."""
    for name, value in (("sd", sd), ("slope_sd", slope_sd), ("bend_sd", bend_sd)):
        one_value(value, name, 0.0, 10.0)
    spread = np.diag(np.square([sd, slope_sd, bend_sd]))
    return ScaleState(np.array([scale, 0.0, 0.0]), spread, reference_temperature)


@dataclass(frozen=True, eq=False, repr=False)
class ScaleTrack(Tabular):
    """The scale factor along a run of n stations."""

    temperature: Array  #: (n,) degC; NaN without a thermometer
    # what was known of each station's scale without its own rates: give it to `estimate_north` as `scale`
    law: ScaleLaw
    # expected, expected_sd: (n,) its mean and standard deviation
    expected: Array
    expected_sd: Array
    # scale, scale_sd: (n,) with its own rates
    scale: Array
    scale_sd: Array
    observable: Mask  #: (n,) False where a station's rates say nothing of its scale
    state: ScaleState  #: what is known after the run, for the next one
    thermometer: bool = True  #: whether the temperatures were measured
    contradicted: bool = False  #: whether the readings contradict what was known before the run
    findings: tuple[Finding, ...] = ()
    # (n, r) factor F of F F', the covariance of the stations' scales given all readings of the run, without each
    # station's own deviation; no columns where stations only know those before them
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
            "observable": np.asarray(self.observable),
        }

    def plot(self, ax: Any = None) -> Any:
        """Scale factor by temperature, or by station, on matplotlib axes, which are returned."""
        place = self.temperature if self.thermometer else np.arange(1.0, len(self) + 1.0)
        lines = {"expected": (place, self.expected), "found": (place, self.scale)}
        return draw(ax, lines, "temperature, degC" if self.thermometer else "station", "scale factor", "o")


class ScaleStep(NamedTuple):
    """One station of a `ScaleTracker`, named as in `ScaleTrack`; azimuth, rad, with its sd by gyros and scale alone."""

    temperature: float
    expected: float
    expected_sd: float
    scale: float
    scale_sd: float
    observable: bool
    azimuth: float
    azimuth_sd: float


class ScaleTracker:
    """The scale factor station by station, as the readings come in: the forward half of the point-mass filter.

    Parameters
    ----------
    state : ScaleState
        What is known before the first station.
    latitude : float
        rad, north positive.
    thermometer : bool
        False where no temperature is measured.

    Notes
    -----
    The filters of `inclinometry.gyro.point_mass` run on; where the curve over temperature is to be fitted again, or a
    station's scale lies beyond the grid, they are laid again over all stations so far.

    Examples
    --------
    >>> from inclinometry.gyro.joint import earth_in_tool
    >>> tracker = ScaleTracker(quadratic_belief(), latitude=0.8)
    >>> for heat in (20.0, 30.0, 40.0):
    ...     step = tracker.add(earth_in_tool(0.8, 0.3, 0.8)[:2] / 1.001, 1e-8 * np.eye(2), 0.3, heat)
    >>> round(step.expected, 4), round(step.scale, 4), len(tracker.findings)
    (1.001, 1.001, 0)
    """

    def __init__(self, state: ScaleState, latitude: float, *, thermometer: bool = True) -> None:
        self.prior = _possible(state)
        self.latitude = one_value(latitude, "latitude", -np.pi / 2, np.pi / 2, "rad")
        self.thermometer = thermometer
        self.steps: list[ScaleStep] = []
        self._stations: list[tuple[Array, Array, float, float]] = []
        self._seen: list[Array] = []
        self._laws: list[tuple[Grid, Array]] = []
        self._laid, self._moved = 0, False

    def add(
        self, rates: ArrayLike, covariance: ArrayLike, inclination: float, temperature: float | None = None
    ) -> ScaleStep:
        """One station: rates (2,) or (3,) and their covariance as for `solve_joint`, rad, degC."""
        high = vectors(np.asarray(rates, dtype=np.float64)[None], "rates", LARGEST)
        cov = covariances(covariance, "covariance", np.isfinite(high[:, 2]), positive=True)
        slant = one_value(inclination, "inclination", 0.0, np.pi, "rad")
        if (temperature is not None) != self.thermometer:
            if self.thermometer:
                raise refused("input-missing", {"names": ("temperature",)})
            raise refused("input-not-with", {"name": "temperature", "other": "thermometer=False"})
        heat = np.nan if temperature is None else float(_temperatures([temperature], 1)[0])
        self._stations.append((high[0], cov[0], slant, heat))
        here = self._run(self._stations[-1:])
        self._seen.append(here.rates.likelihood(WHOLE)[0])
        return self._take(here)

    def _take(self, here: _Run) -> ScaleStep:
        heat = [station[3] for station in self._stations]
        moves = _moves(self.prior, min(heat), max(heat))
        # from half as long again on the curve over temperature is fitted again
        grown = moves and len(heat) > 1.5 * self._laid
        if not self.steps:
            self._lay()
            self._coarse.add(self._seen[0], np.zeros(0))
        elif not self._covers() or moves != self._moved or grown:
            self._lay()
        basis = here._replace(start=self._start, moves=moves).basis()[0]
        self._laws.append((self._grid, self._forward.expected(basis)))
        self._forward.add(here.rates.likelihood(self._grid)[0], basis)
        self.steps.append(_step(here.rates, ScaleLaw((self._laws[-1],)), here.heat[0]))
        return self.steps[-1]

    @property
    def law(self) -> ScaleLaw:
        """What was known of each station's scale before it."""
        return ScaleLaw(tuple(self._laws))

    def _covers(self) -> bool:
        """Whether the grid holds the station's likely scale factors; the filter on the coarse grid goes on."""
        coarse, seen = self._coarse, self._seen[-1]
        low, high = _likely(WHOLE, (coarse.expected(np.zeros(0)) * seen)[None])
        coarse.add(seen, np.zeros(0))
        return bool(self._grid.nodes[0] <= low and high <= self._grid.nodes[-1])

    def _run(self, stations: Sequence[tuple[Array, Array, float, float]]) -> _Run:
        high, cov, slant, heat = (np.array(part) for part in zip(*stations, strict=True))
        return _Run.of(Rates(high, cov, slant, self.latitude), heat, self.prior)

    def _lay(self) -> None:
        """The filters over all stations but the last."""
        run, used = self._run(self._stations), len(self._stations) - 1
        self._start, self._laid, self._moved = run.start, used + 1, run.moves
        found = run.laid(np.array(self._seen), used)
        self._grid, self._forward = found.grid, Forward(Bank(found.members, found.grid, found.first))
        if not used:
            self._coarse = Forward(Bank(PLAIN, WHOLE, found.plain_first))
        for row, powers in zip(found.likelihood[:used], run.basis(), strict=False):
            self._forward.add(row, powers)

    def laid(self) -> _Laid:
        """What the stations so far are filtered with."""
        return self._run(self._stations).laid(np.array(self._seen))

    @property
    def state(self) -> ScaleState:
        """What is known after the stations so far."""
        return self.laid().state if self._stations else self.prior

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What there is to say of the stations so far."""
        observable = np.array([step.observable for step in self.steps], dtype=bool)
        return _findings(self.laid(), observable) if self._stations else ()


PLAIN = Members.every((0.0,), np.zeros((1, 0)), np.ones(1))
"""The bank without a thermometer."""

WHOLE = Grid.over(LOWEST, HIGHEST, 2e-3)
"""The grid of all scale factors, on which it is first looked where those of a run are."""


class _Laid(NamedTuple):
    """What a run is filtered with, and what the filters without a thermometer say of it."""

    grid: Grid
    likelihood: Array
    members: Members
    first: Array
    plain_first: Array
    plain: Smoothed
    state: ScaleState
    contradicts: Finding | None


class _Run(NamedTuple):
    """Rates, temperatures (n,), NaN without a thermometer, and what is known before."""

    rates: Rates
    heat: Array
    state: ScaleState
    start: float  #: temperature of the first station
    moves: bool  #: whether temperature says anything

    @classmethod
    def of(cls, rates: Rates, heat: Array, state: ScaleState) -> _Run:
        """All stations of a run."""
        start = state.reference_temperature if np.isnan(heat[0]) else float(heat[0])
        return cls(rates, heat, state, start, _moves(state, float(heat.min()), float(heat.max())))

    def basis(self) -> Array:
        """Powers (n, c) of temperature, less those of the first station; c = 0 where temperature says nothing."""
        powers = self._powers()
        return powers if self.moves else powers[:, :0]

    def _powers(self) -> Array:
        heat = np.where(np.isnan(self.heat), self.start, self.heat)
        return np.asarray(self.state.basis(heat)[:, 1:] - self.state.basis(self.start)[1:])

    def laid(self, seen: Array, used: int | None = None) -> _Laid:
        """The grid and the bank, from the first `used` stations; the grid holds them all.

        seen : likelihood of the stations on `WHOLE`.
        """
        size = len(self.heat) if used is None else used
        # scale at the first station, and the curve from there on
        here = np.eye(self.state.coefficients.size)
        here[0] = self.state.basis(self.start)
        mean, spread = here @ self.state.coefficients, here @ self.state.covariance @ here.T
        plain_first = np.tile([mean[0], np.sqrt(spread[0, 0])], (len(PLAIN.step), 1))
        nothing = np.zeros((len(self.heat), 0))
        low, high = _likely(WHOLE, smoothed(PLAIN, WHOLE, plain_first, seen, nothing).expected * seen)
        noise = np.sqrt(np.min(np.diagonal(self.rates.covariance[:, :2, :2], axis1=1, axis2=2)))
        # what was stated is on the grid too, and what the next station may add before the grid is laid again
        reach, beyond = min(4.0 * np.sqrt(spread[0, 0]), JUMP), 0.01
        low, high = min(low - beyond, mean[0] - reach), max(high + beyond, mean[0] + reach)
        grid = Grid.over(low, high, float(np.clip(0.25 * noise, FINEST, WIDEST)))
        likelihood = self.rates.likelihood(grid)
        plain = smoothed(PLAIN, grid, plain_first, likelihood[:size], nothing[:size])
        end = _regression(mean, spread, self._powers()[:size], *_sites(grid, plain.expected, likelihood[:size]))
        back = np.linalg.inv(here)
        span = self.state.temperature_range
        if size and not np.isnan(self.heat[0]):
            ends = (*(span or ()), float(self.heat[:size].min()), float(self.heat[:size].max()))
            span = min(ends), max(ends)
        cov = back @ end[1] @ back.T
        state = ScaleState(back @ end[0], 0.5 * (cov + cov.T), self.state.reference_temperature, span)
        members, first = PLAIN, plain_first
        if self.moves:
            members, first = self._bank(mean, spread, end, grid, likelihood[:size])
            room = int(np.ceil(np.abs(members.curve @ self.basis().T).max() / grid.step))
            likelihood = np.pad(likelihood, ((0, 0), (room, room)), mode="edge")
            grid = Grid(grid.nodes[0] + grid.step * np.arange(-room, len(grid.nodes) + room), grid.step)
        off = plain.mean[0] - mean[0] if size else 0.0
        contradicts = None
        if size and abs(off) > 4.0 * np.sqrt(spread[0, 0] + plain.variance[0]):
            stated = {"stated": float(mean[0]), "sd_percent": 100.0 * float(np.sqrt(spread[0, 0]))}
            contradicts = Finding("gyro-scale-contradicted", {**stated, "fitted": float(plain.mean[0])})
        return _Laid(grid, likelihood, members, first, plain_first, plain, state, contradicts)

    def _bank(
        self, mean: Array, spread: Array, end: tuple[Array, Array], grid: Grid, likelihood: Array
    ) -> tuple[Members, Array]:
        """Members with the polynomials that the readings allow, and the first station's law of each."""
        size, centre = len(mean) - 1, end[0][1:]
        values, turn = np.linalg.eigh(end[1][1:, 1:])
        root = turn * np.sqrt(np.clip(values, 0.0, None))
        # nodes and weights of Gauss and Hermite, three in each direction
        node = np.array(np.meshgrid(*[np.sqrt(3.0) * np.array([0.0, -1.0, 1.0])] * size, indexing="ij")).reshape(
            size, -1
        )
        weight = np.prod(np.where(node == 0.0, 4.0, 1.0) / 6.0, axis=0)
        curve = centre + (root @ node).T
        inverse = np.linalg.pinv(spread[1:, 1:], hermitian=True)
        off = curve - mean[1:]
        before = -0.5 * np.einsum("ki,ij,kj->k", off, inverse, off) + 0.5 * np.sum(node**2, axis=0)
        weight = weight * np.exp(before - before.max())

        def first(members: Members) -> Array:
            gain = spread[0, 1:] @ inverse
            at = mean[0] + (members.curve - mean[1:]) @ gain
            return np.stack([at, np.full(len(at), np.sqrt(max(spread[0, 0] - gain @ spread[1:, 0], 0.0)))], axis=1)

        one = Members.every(OWN, centre[None], np.ones(1))
        forward = Forward(Bank(one, grid, first(one)))
        for row, powers in zip(likelihood, self.basis(), strict=False):
            forward.add(row, powers)
        chance = forward.bank.weights(forward.evidence)
        some = one.only(np.flatnonzero(chance > 1e-2 * chance.max()))
        step, jump, own = (np.repeat(part, len(curve)) for part in some[:3])
        members = Members(step, jump, own, np.tile(curve, (len(some.step), 1)), np.tile(weight, len(some.step)))
        return members, first(members)


def _moves(state: ScaleState, low: float, high: float) -> bool:
    """Whether temperatures say anything of the scale; NaN: there are none."""
    # within 1 degC what they say of the scale is below the smallest step that is tried
    return state.coefficients.size > 1 and high - low > 1.0


def _likely(grid: Grid, density: Array) -> tuple[float, float]:
    """Lowest and highest node that is not out of the question for any station."""
    used = grid.nodes[(density > 1e-7 * density.sum(axis=1, keepdims=True)).any(axis=0)]
    return float(used[0] - grid.step), float(used[-1] + grid.step)


def _sites(grid: Grid, expected: Array, likelihood: Array) -> tuple[Array, Array]:
    """The Gaussian (mean and variance (n,), infinite for nothing) by which a station's rates change what is known."""

    def moments(density: Array) -> tuple[Array, Array]:
        mean = density @ nodes / density.sum(axis=1)
        return mean, density @ nodes**2 / density.sum(axis=1) - mean**2 + grid.step**2

    nodes = grid.nodes - 1.0
    (before, wide), (after, narrow) = moments(expected), moments(expected * likelihood)
    gained = np.where(narrow < 0.999 * wide, 1.0 / narrow - 1.0 / wide, np.nan)
    value = (after / narrow - before / wide) / gained
    return 1.0 + np.nan_to_num(value), np.where(np.isnan(gained), np.inf, 1.0 / gained)


def _regression(mean: Array, spread: Array, basis: Array, value: Array, variance: Array) -> tuple[Array, Array]:
    """Scale at the end of a run, at the first temperature, and curve, by Kalman filters weighted by their evidence.

    Mean (p,) and covariance (p, p) before and after; basis (n, p - 1), value and variance (n,) of the stations.
    """
    step, own = (part.ravel() for part in np.meshgrid(STEPS, OWN, indexing="ij"))
    state, cov, evidence = np.tile(mean, (len(step), 1)), np.tile(spread, (len(step), 1, 1)), np.zeros(len(step))
    for n, powers in enumerate(basis):
        cov[:, 0, 0] += step**2 if n else 0.0
        row = np.append(1.0, powers)
        if np.isfinite(variance[n]):
            turned = cov @ row
            total = turned @ row + own**2 + variance[n]
            off = value[n] - state @ row
            evidence -= 0.5 * (np.log(total) + off**2 / total)
            state = state + turned * (off / total)[:, None]
            cov = cov - turned[:, :, None] * turned[:, None, :] / total[:, None, None]
    weight = np.exp(evidence - evidence.max())
    weight /= weight.sum()
    centre = weight @ state
    off = state - centre
    return centre, np.einsum("b,bij->ij", weight, cov + off[:, :, None] * off[:, None, :])


def _step(rates: Rates, law: ScaleLaw, heat: float) -> ScaleStep:
    """A station's own estimate with what was known of its scale."""
    found, (expected, spread) = solve_law(rates, law), law.moments()
    scale, sd = float(found.scale[0]), float(found.scale_sd[0])
    observable = bool(sd < LEAST_GAIN * spread[0])
    return ScaleStep(
        float(heat), float(expected[0]), float(spread[0]), scale, sd, observable,
        float(found.found.azimuth[0]), float(found.azimuth_sd[0]),
    )  # fmt: skip


LEAST_GAIN = 0.999
"""Share of what was not known of a station's scale that its rates may leave at most where it is observable."""


def _checked(
    rates: ArrayLike,
    covariance: ArrayLike,
    inclination: ArrayLike,
    latitude: float,
    temperature: ArrayLike | None,
    state: ScaleState,
) -> _Run:
    high = vectors(rates, "rates", LARGEST)
    cov = covariances(covariance, "covariance", np.isfinite(high[:, 2]), positive=True)
    slant = per_station(inclination, len(high), "inclination", 0.0, np.pi, "rad")
    north = one_value(latitude, "latitude", -np.pi / 2, np.pi / 2, "rad")
    heat = np.full(len(high), np.nan) if temperature is None else _temperatures(temperature, len(high))
    return _Run.of(Rates(high, cov, slant, north), heat, _possible(state))


def track_scale(
    rates: ArrayLike,
    covariance: ArrayLike,
    inclination: ArrayLike,
    latitude: float,
    temperature: ArrayLike | None,
    state: ScaleState,
) -> ScaleTrack:
    """Learn the scale factor by a `ScaleTracker`: each station uses those before it; temperature in degC."""
    run = _checked(rates, covariance, inclination, latitude, temperature, state)
    tracker = ScaleTracker(state, latitude, thermometer=temperature is not None)
    for n in range(len(run.heat)):
        tracker.add(
            run.rates.high[n],
            run.rates.covariance[n],
            run.rates.inclination[n],
            None if temperature is None else run.heat[n],
        )
    expected, sd, scale, scale_sd = np.array([step[1:5] for step in tracker.steps]).T
    observable = np.array([step.observable for step in tracker.steps], dtype=bool)
    laid = tracker.laid()
    return ScaleTrack(
        run.heat, tracker.law, expected, sd, scale, scale_sd, observable, laid.state, tracker.thermometer,
        laid.contradicts is not None, _findings(laid, observable),
    )  # fmt: skip


def smooth_scale(
    rates: ArrayLike,
    covariance: ArrayLike,
    inclination: ArrayLike,
    latitude: float,
    temperature: ArrayLike | None,
    state: ScaleState,
) -> ScaleTrack:
    """Learn the scale factor from the whole run: each station uses all others, those after it too.

    Parameters as `track_scale`; forward filter and backward smoother of `inclinometry.gyro.point_mass`.
    """
    run = _checked(rates, covariance, inclination, latitude, temperature, state)
    if len(run.heat) > MOST:
        raise InputError(too_large("stations", len(run.heat), MOST))
    laid = run.laid(run.rates.likelihood(WHOLE))
    whole = laid.plain
    if run.moves:
        whole = smoothed(laid.members, laid.grid, laid.first, laid.likelihood, run.basis())
    law = ScaleLaw(tuple((laid.grid, row) for row in whole.expected))
    found, (expected, sd) = solve_law(run.rates, law), law.moments()
    observable = found.scale_sd < LEAST_GAIN * sd
    return ScaleTrack(
        run.heat, law, expected, sd, found.scale, found.scale_sd, observable, laid.state, temperature is not None,
        laid.contradicts is not None, _findings(laid, observable), whole.factor(),
    )  # fmt: skip


def _possible(state: ScaleState) -> ScaleState:
    """A state whose scale factor is on the grid."""
    one_value(state.coefficients[0], "scale", LOWEST, HIGHEST)
    return state


def _temperatures(temperature: ArrayLike, size: int) -> Array:
    heat = finite(temperature, "temperature", (None,))
    within(heat, "temperature", *TEMPERATURES, "degC")
    if heat.shape != (size,) or not size:
        raise wrong_shape("temperature", heat.shape, f"({size},)")
    return heat


def _findings(laid: _Laid, observable: Mask) -> tuple[Finding, ...]:
    left = int(np.sum(~observable))
    unseen = Finding("gyro-scale-unseen", {"count": left, "total": len(observable)}, severity="note")
    return (*([laid.contradicts] if laid.contradicts else []), *([unseen] if left else []))
