"""Variance components: how noisy the sensors are and how well the rig was set, told by the readings themselves.

Restricted maximum likelihood on the linearised model, V = sum_i f_i V_i, by Fisher scoring on the factors f_i. The
restriction matters: a bench run has few readings for its many parameters, and plain maximum likelihood would claim a
third less noise than there is.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Set
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, Mask, finite, within
from inclinometry.calibration.likelihood import Linear, Model, State
from inclinometry.calibration.readings import BenchReadings
from inclinometry.constants import KINDS
from inclinometry.errors import not_among, out_of_range, wrong_shape
from inclinometry.least_squares import levenberg_marquardt


@dataclass(frozen=True, eq=False)
class Components:
    """Factors on the model's present variances, and the standard uncertainty of each."""

    noise: dict[str, float]  #: kind -> factor on the noise variance
    rig: Array  #: (3,) factor on the variance of each dial's random errors
    repeating: Array  #: (3,) on that of its repeating ones
    relative_sd: Array  #: (n,) standard uncertainty of each factor relative to the factor: kinds, dials, repeating


# The prior of the dials, in logarithms of variances: they are alike within a factor of 7 in standard
# deviation (one standard deviation of this prior: e), and what repeats of their errors is some sixth of what does not.
_ALIKE: Final = 2.0
REPEATING: Final = -1.5


class _Restricted:
    """Restricted likelihood of one linearised model; everything is done station by station.

    Factors multiply the variances of the noise of each kind, of the random errors of each dial, of its repeating ones.
    """

    def __init__(self, model: Model, at: Linear, state: State, free_noise: Set[str], free_rig: bool) -> None:
        self.jacobian, self.prior = at.jacobian, model.prior_information(state)
        off, known, sd = model.field_rows(state)
        self.pull, self.misfit = (known / sd[:, None] ** 2).T @ off, float(np.sum((off / sd) ** 2))
        # the residual without the estimated rig errors, since V accounts for them, and without the structured ones
        self.residual = without_rig_errors(model, at, state)
        # the parts of a station's covariance V = E E' + B B' are what each dial's error does, B, and each channel's
        # noise, E; all products of B, E, J and the residual are formed once, kind by kind, whose factors are numbers
        size, count = self.residual.shape
        noise = np.broadcast_to(np.diag(np.ones(count)), (size, count, count))
        parts = [noise * model.noise_sd[:, None], at.by_setting * model.rig_sd, at.jacobian, self.residual[..., None]]
        whole = np.concatenate(parts, axis=2) / model.noise_sd[..., None]
        edges = np.cumsum([0, *(signals.shape[1] for signals in model.signals.values())])
        self.channels = [slice(*ends) for ends in itertools.pairwise(edges)]
        kind_by_kind = [whole[:, channels] for channels in self.channels]
        # (kinds, K, 3 + M, q)
        self.cross = np.stack([part[..., : 3 + count].swapaxes(1, 2) @ part for part in kind_by_kind])
        flat = [part[..., 3 + count :].reshape(-1, part.shape[2] - 3 - count) for part in kind_by_kind]
        self.total = np.stack([part.T @ part for part in flat])
        self.log_noise = 2.0 * np.log(model.noise_sd).sum()
        kinds = len(model.signals)
        of_channel = np.repeat(np.arange(kinds), np.diff(edges))
        self.part = np.array([*of_channel, *(kinds + np.arange(3))])
        self.belongs = np.eye(kinds + 3)[self.part]
        first = self.jacobian.shape[2] - len(model.structure_dial)
        self.groups = [first + np.flatnonzero(model.structure_dial == dial) for dial in range(3)]
        self.member = np.zeros((self.jacobian.shape[2], 3))
        for place, group in enumerate(self.groups):
            self.member[group, place] = 1.0
        self.repeats = np.flatnonzero(self.member.any(axis=1))
        self.repeats_prior = self.prior[self.repeats, self.repeats]
        self.prior[self.repeats, self.repeats] = 0.0
        self.size = kinds + 6
        self.blind: bool | None = None  # whether the plan leaves directions unseen
        self.unit = np.concatenate([np.ones(first), model.structure_sd])
        open_dial = ~model.rig_known & (model.rig_sd > 0.0) & free_rig
        repeats = np.array([len(group) > 0 for group in self.groups]) & free_rig
        self.free = np.array([*(kind in free_noise for kind in model.signals), *open_dial, *repeats])
        # logarithms of the present variances of the dials, and what the logarithms of all factors do to their prior
        own = np.flatnonzero(open_dial)
        rows, offsets = [], []
        random = 2.0 * np.log(np.where(model.rig_sd > 0.0, model.rig_sd, 1.0))
        for dial in own if len(own) > 1 else ():
            row = np.zeros(self.size)
            row[kinds + own] = -1.0 / len(own)
            row[kinds + dial] += 1.0
            rows.append(row / _ALIKE)
            offsets.append((random[dial] - random[own].mean()) / _ALIKE)
        weighed = np.flatnonzero(model.rig_sd > 0.0)
        for dial in np.flatnonzero(repeats) if len(weighed) else ():
            now = 2.0 * np.log(model.structure_sd[self.groups[dial][0] - first])
            row = np.zeros(self.size)
            row[kinds + own] = -1.0 / len(weighed)
            row[kinds + 3 + dial] = 1.0
            rows.append(row / _ALIKE)
            offsets.append((now - random[weighed].mean() - REPEATING) / _ALIKE)
        self.alike, self.offset = np.reshape(rows, (len(rows), self.size)), np.array(offsets)

    def evaluate(self, factors: Array) -> tuple[float, Array, Array]:
        """Twice the negative log likelihood, its gradient by logarithms of factors, their expected information."""
        kinds, roots, width = self.size - 6, len(self.part), self.jacobian.shape[2]
        rows, spread = self._eliminated(factors, self.cross[:, :, roots - 3 : roots])
        value, root, shift = self._solved(factors, rows[..., roots:], spread)
        products = np.tensordot(1.0 / factors[:kinds], self.cross, axes=1)
        products -= rows[..., :roots].swapaxes(1, 2) @ rows
        # with S = [E, B]: S' V^-1 S (K, R, R), S' V^-1 J (K, R, p), S' V^-1 (y - J x)
        own, seen, pull = products[..., :roots], products[..., roots:-1], products[..., -1]
        pulls = np.sum((pull - seen @ shift) ** 2, axis=0)
        white = (seen.reshape(-1, width) @ root).reshape(seen.shape)  # S' V^-1 J C^1/2
        explained = white @ white.swapaxes(1, 2)
        blocks = self.size - 3
        gradient, information = np.zeros(self.size), np.zeros((self.size, self.size))
        gradient[:blocks] = self.belongs.T @ ((own - explained).sum(axis=0).diagonal() - pulls)
        # ||S_i' P S_j||^2 = tr(P V_i P V_j), station by station but for the last term
        squares = self.belongs.T @ np.sum(own * (own - 2.0 * explained), axis=0) @ self.belongs
        parts = [white[:, at].reshape(-1, width) for at in self.channels]
        parts += [white[:, dial] for dial in range(roots - 3, roots)]
        carried = np.stack([(g.T @ g).ravel() for g in parts])
        both = carried @ carried.T
        information[:blocks, :blocks] = 0.5 * (squares + both)
        if self.member.any():
            # with Z the columns of a group in units of their prior and f its factor: Z' P Z = 1/f - C/f^2
            root, shift = root / self.unit[:, None], shift / self.unit
            inner = root @ root.T
            f, count, trace = factors[blocks:], self.member.sum(axis=0), inner.diagonal() @ self.member
            gradient[blocks:] = (count - (trace + shift**2 @ self.member) / f) / f
            between = np.sum((white @ root.T) ** 2, axis=0) @ self.member / f**2
            information[:blocks, blocks:] = shared = 0.5 * self.belongs.T @ between
            information[blocks:, :blocks] = shared.T
            left = self.member.T @ inner**2 @ self.member / np.outer(f, f) + np.diag(count - 2.0 * trace / f)
            information[blocks:, blocks:] = 0.5 * left / np.outer(f, f)
        logs = self.alike @ np.log(factors) + self.offset
        gradient = gradient * factors + 2.0 * self.alike.T @ logs
        information = information * np.outer(factors, factors) + self.alike.T @ self.alike
        return float(value), gradient, information

    def _eliminated(self, factors: Array, cross: Array) -> tuple[Array, Array]:
        """Rows (..., K, 3, q) h of E, B, J, y with V^-1 = (E E')^-1 - h' h, and log|V| (...) less that of E E'.

        V = E E' + B F B' for factors F of the dials; h = L^-1 F^1/2 B' (E E')^-1 with 1 + F^1/2 B' (E E')^-1 B F^1/2 =
        L L'.
        """
        kinds = self.size - 6
        first = cross.shape[-1] - self.jacobian.shape[2] - 4  # column of B
        root = np.sqrt(factors[..., None, kinds : kinds + 3])
        rows = root[..., None] * np.tensordot(1.0 / factors[..., :kinds], cross, axes=1)
        head = rows[..., first : first + 3] * root[..., None, :]
        head[..., range(3), range(3)] += 1.0
        pivots = np.ones(rows.shape[:-2])
        for i in range(3):
            pivot = head[..., i, i].copy()
            pivots *= pivot
            below = head[..., i + 1 :, i] / pivot[..., None]
            head[..., i + 1 :, :] -= below[..., None] * head[..., i, None, :]
            rows[..., i + 1 :, :] -= below[..., None] * rows[..., i, None, :]
            rows[..., i, :] /= np.sqrt(pivot)[..., None]
        return rows, np.log(pivots).sum(axis=-1)

    def solve(self, factors: Array) -> tuple[Array, Array, Array]:
        """Generalised least squares for given factors (..., n).

        Twice the negative restricted log likelihood, covariance (..., p, p) of the parameters, parameters (..., p) of
        the linearisation minus estimate.
        """
        at = len(self.part) - 3
        rows, spread = self._eliminated(factors, self.cross[:, :, at : at + 3, at:])
        value, root, shift = self._solved(factors, rows[..., 3:], spread)
        return value, np.asarray(root @ root.swapaxes(-1, -2)), shift

    def _solved(self, factors: Array, rows: Array, spread: Array) -> tuple[Array, Array, Array]:
        """`solve` from the rows of J, y and the logarithm of `_eliminated`; C^1/2 (..., p, p) for the covariance C."""
        blocks = self.size - 3
        rows = rows.reshape(*factors.shape[:-1], -1, rows.shape[-1])
        whole = np.tensordot(1.0 / factors[..., : blocks - 3], self.total, axes=1) - rows.swapaxes(-1, -2) @ rows
        normal, pulled = whole[..., :-1, :-1] + self.prior, whole[..., :-1, -1] + self.pull  # J' V^-1 J, y
        channels = np.array([at.stop - at.start for at in self.channels])
        spread = spread + self.log_noise + len(self.residual) * np.log(factors[..., : blocks - 3]) @ channels
        repeating = factors[..., blocks:]
        normal[..., self.repeats, self.repeats] += self.repeats_prior / (repeating @ self.member.T)[..., self.repeats]
        spread = spread + np.log(repeating) @ self.member.sum(axis=0)
        scale = 1.0 / np.sqrt(np.diagonal(normal, axis1=-2, axis2=-1))
        unit = normal * (scale[..., :, None] * scale[..., None, :])
        if self.blind is None:
            self.blind = bool(np.linalg.eigvalsh(unit)[..., 0].min() < 1e-12)
        if not self.blind:
            try:
                root = np.linalg.cholesky(unit)
                log_normal = 2.0 * np.log(np.diagonal(root, axis1=-2, axis2=-1)).sum(axis=-1)
                root = np.linalg.inv(root).swapaxes(-1, -2)
            except np.linalg.LinAlgError:
                self.blind = True
        if self.blind:  # directions that the plan does not see at all are left out
            eigen, vectors = np.linalg.eigh(unit)
            eigen = np.where(eigen > 1e-13 * eigen[..., -1:], eigen, np.inf)
            root = vectors / np.sqrt(eigen)[..., None, :]
            log_normal = np.log(np.where(np.isinf(eigen), 1.0, eigen)).sum(axis=-1)
        root = root * scale[..., :, None]
        log_normal = log_normal - 2.0 * np.log(scale).sum(axis=-1)
        white = (root.swapaxes(-1, -2) @ pulled[..., None])[..., 0]
        misfit = whole[..., -1, -1] + self.misfit - np.sum(white**2, axis=-1)
        logs = np.log(factors) @ self.alike.T + self.offset
        value = np.asarray(spread + log_normal + misfit + np.sum(logs**2, axis=-1))
        return value, np.asarray(root), np.asarray((root @ white[..., None])[..., 0])


def without_rig_errors(model: Model, at: Linear, state: State) -> Array:
    """Model minus reading (K, M) at the settings as dialled and without structured errors, to first order."""
    moved = (at.by_setting @ state.errors[..., None])[..., 0]
    return np.asarray(at.residual - moved - model.structure @ state.structured)


def estimate_components(model: Model, at: Linear, state: State, free_noise: Set[str], free_rig: bool) -> Components:
    """Factors by which the model's variances must be multiplied to agree with the readings.

    `free_noise`: kinds whose noise may change; `free_rig`: whether the variances of settings may that were not stated.
    """
    likelihood = _Restricted(model, at, state, free_noise, free_rig)
    factors, information = _maximise(likelihood, np.ones(likelihood.size), _floors(model))
    return _components(model, factors, _relative_sd(information, likelihood.free))


def raised_components(model: Model, at: Linear, state: State, free_noise: Set[str], free_rig: bool) -> Components:
    """Factors that raise estimated variances as far as they may well be: by twice their uncertainty.

    A variance hidden behind another one may be estimated many times too small; raised, it is better seen, and its
    uncertainty there tells how well it is bounded from above. Arguments as for `estimate_components`.
    """
    likelihood = _Restricted(model, at, state, free_noise, free_rig)
    ones = np.ones(likelihood.size)
    relative = _relative_sd(likelihood.evaluate(ones)[2], likelihood.free)
    factors = np.where(relative < 10.0, np.exp(np.minimum(2.0 * relative, 3.0)), 1.0)
    return _components(model, factors, _relative_sd(likelihood.evaluate(factors)[2], likelihood.free))


def repeating_evidence(fitted: Fitted) -> Array:
    """Logarithm of the likelihood ratio (3,) of each dial's repeating errors against none; 0 where none are fitted."""
    likelihood = _Restricted(fitted.model, fitted.at, fitted.state, frozenset(), False)
    ratios = np.zeros(3)
    for dial in np.flatnonzero(likelihood.member.any(axis=0)):
        # what is gone of the repeating errors may be random ones
        factors = np.ones((5, likelihood.size))
        factors[1:, likelihood.size - 3 + dial] = 1e-6
        factors[1:, likelihood.size - 6 + dial] = 1.0, 3.0, 10.0, 30.0
        values = likelihood.solve(factors)[0]
        ratios[dial] = (values[1:].min() - values[0]) / 2.0
    return ratios


def average_over_variances(
    model: Model, at: Linear, state: State, free_noise: Set[str], free_rig: bool
) -> tuple[Array, Array, Array, Array] | None:
    """Covariance (p, p) of the parameters averaged over the variances' posterior; None where these are known.

    An estimated variance taken as known makes a short run look better than it is: in twelve positions one run in three
    would be off by more than its 95 % region. Restricted likelihood, flat in the logarithm, importance sampling. Beside
    it: mean factors (n,) on noise of each kind, dials, their repeating errors; their relative u, NaN where stated; the
    relative variance (p,) of each parameter's variance.
    """
    likelihood = _Restricted(model, at, state, free_noise, free_rig)
    if not likelihood.free.any():
        return None
    ones = np.ones(likelihood.size)
    index = np.flatnonzero(likelihood.free)
    information = likelihood.evaluate(ones)[2]
    open_sd = 2.0  # of the prior on the logarithm of a variance about its estimate
    # a variance the readings say nothing of may be anything within a factor of e^2 or so, not everything
    spread = np.linalg.inv(information[np.ix_(index, index)] + np.eye(len(index)) / open_sd**2)
    # relative uncertainty of the variances below which averaging over them changes nothing worth its time
    if np.sqrt(spread.diagonal().max()) < 0.03:
        return None
    generator = np.random.default_rng(0)
    dof = 4.0  # of the sampling density, heavier in the tails than the posterior
    draws = 128  # sets of variances over which a covariance is averaged
    normal = generator.standard_normal((draws, len(index)))
    tail = np.sqrt(dof / generator.chisquare(dof, draws))
    steps = (normal * tail[:, None]) @ np.linalg.cholesky(spread).T
    density = -0.5 * (dof + len(index)) * np.log1p(np.sum((normal * tail[:, None]) ** 2, axis=1) / dof)
    factors = np.ones((draws, likelihood.size))
    factors[:, index] = np.maximum(np.exp(steps), _floors(model)[index])
    best, _, start = likelihood.solve(ones)
    total, weight = np.zeros_like(likelihood.prior), np.zeros(draws)
    together = max(1, 150_000 // likelihood.jacobian.size)  # what fits into the processor's memory
    for first in range(0, draws, together):
        part = slice(first, first + together)
        value, inner, shift = likelihood.solve(factors[part])
        moved = shift - start
        prior = 0.5 * np.sum((steps[part] / open_sd) ** 2, axis=1)
        share = np.exp(np.clip(-0.5 * (value - best) - density[part] - prior, -700, 50))
        total += np.tensordot(share, inner, 1) + (moved.T * share) @ moved
        weight[part] = share
    means = weight @ factors / weight.sum()
    step = 1e-3  # of a logarithm: truncation 1e-7
    moved = np.exp(step * np.concatenate([np.eye(likelihood.size)[index], -np.eye(likelihood.size)[index]]))
    logs = np.log(np.maximum(np.diagonal(likelihood.solve(moved)[1], axis1=1, axis2=2), np.finfo(float).tiny))
    slope = (logs[: len(index)] - logs[len(index) :]) / (2.0 * step)
    own = np.einsum("ip,ij,jp->p", slope, spread, slope)
    return total / weight.sum(), means, _relative_sd(information, likelihood.free), own


def _components(model: Model, factors: Array, relative_sd: Array) -> Components:
    kinds = len(model.signals)
    noise = dict(zip(model.signals, factors[:kinds].tolist(), strict=True))
    return Components(noise, factors[kinds : kinds + 3], factors[kinds + 3 :], relative_sd)


def _relative_sd(information: Array, free: Mask) -> Array:
    """Standard uncertainty of each free factor relative to it; NaN for the others."""
    spread = np.full(len(information), np.nan)
    spread[free] = 1.0 / np.sqrt(np.maximum(np.diagonal(information)[free], 1e-12))
    return spread


def least_noise(signals: Array) -> Array:
    """Least standard deviation (m,) that channels (K, m) are taken to have."""
    # share of a channel's range below which its noise is rounding; less would leave no digits for the rig's part
    return np.asarray(np.maximum(1e-8 * np.ptp(signals, axis=0), np.finfo(float).tiny))


def _floors(model: Model) -> Array:
    """Least factor of each variance: rounding for the noise, what is called perfect for the rig."""
    floors, start = [], 0
    rounding = np.broadcast_to(model.rounding, model.noise_sd.shape)
    floor = 1e-8  # a rig variance this far below its starting value is called perfect
    for signals in model.signals.values():
        here = slice(start, start + signals.shape[1])
        start += signals.shape[1]
        sd = model.noise_sd[:, here]
        least = max(np.max(least_noise(signals) / sd), np.min(rounding[:, here] / sd))
        floors.append(max(floor, min(1.0, float(least**2))))
    return np.array([*floors, *[floor] * 6])


def _maximise(likelihood: _Restricted, factors: Array, floors: Array) -> tuple[Array, Array]:
    """Fisher scoring with halved steps inside factors >= floors; the factors, the information of their logarithms."""
    value, gradient, information = likelihood.evaluate(factors)
    for _ in range(60):
        # a factor at its floor with the likelihood falling upwards stays there
        active = likelihood.free & ~((factors <= floors) & (gradient > 0.0))
        if not active.any():
            break
        index = np.flatnonzero(active)
        relative = np.linalg.lstsq(information[np.ix_(index, index)], -0.5 * gradient[index], rcond=1e-10)[0]
        step = np.clip(relative, -0.9, 9.0) * factors[index]
        if np.abs(relative).max() < 1e-4:
            break
        length = 1.0
        while length > 1e-4:
            trial = factors.copy()
            trial[index] = np.maximum(factors[index] + length * step, floors[index])
            result = likelihood.evaluate(trial)
            if result[0] < value:
                break
            length /= 2.0
        else:
            break
        done = value - result[0] < 1e-5
        factors, (value, gradient, information) = trial, result
        if done:
            break
    return factors, information


# Fit a joint model and, where they are not known, the variances that weight it.


@dataclass(frozen=True, eq=False)
class Fitted:
    """A joint model at its maximum."""

    model: Model
    state: State
    covariance: Array
    cost: float
    at: Linear
    variance_freedom: Array | None = None  #: degrees of freedom of each variance: kinds, dials, their repeating errors
    relative_variance: Array | None = None  #: (p,) of each parameter's variance, where variances were estimated

    @property
    def degrees_of_freedom(self) -> int:
        """Readings minus parameters; the rig errors, random or structured, are none."""
        return int(self.at.residual.size - self.model.columns()[2].stop)

    def stand_misfit(self) -> tuple[float, float]:
        """Chi-square of the stations and its degrees of freedom, the readings off the stand left out."""
        apart, state = self.model.off_stand, self.state
        if apart is None:
            return self.cost, self.degrees_of_freedom
        tool, _, _, width = self.model.columns()
        off, rows = apart.linear(state.coefficients, tool, width).known(apart.weight)
        followed = float(np.sum((rows @ self.covariance) * rows))
        return self.cost - float(off @ off), self.degrees_of_freedom + followed

    @property
    def tangents(self) -> Array:
        """Covariance of the field directions, two tangent angles a triad in the order of the state, rad^2."""
        blocks = list(self.model.columns()[1].values())
        return self.covariance[blocks[0].start : blocks[-1].stop, blocks[0].start : blocks[-1].stop]

    def marginal_residual(self) -> Array:
        """Model minus reading (K, M) at the settings as dialled and without structured errors, to first order."""
        return without_rig_errors(self.model, self.at, self.state)

    def projected(self) -> tuple[Array, Array]:
        """V^-1 (K, M, M) and P r (K, M), with V the covariance of a station and P = V^-1 - V^-1 J C J' V^-1."""
        inverse = np.linalg.inv(self.model.station_covariance(self.at))
        jacobian, white = self.at.jacobian, (inverse @ self.marginal_residual()[..., None])[..., 0]
        pulled = self.covariance @ np.tensordot(jacobian, white, axes=([0, 1], [0, 1]))
        return np.asarray(inverse), np.asarray(white - (inverse @ (jacobian @ pulled)[..., None])[..., 0])


def fit(model: Model, start: State, tolerance: float = 1e-10) -> Fitted:
    """Maximum likelihood for given variances."""
    found = levenberg_marquardt(model.normal, start, model.retract, tolerance=tolerance)
    return Fitted(model, found.estimate, found.covariance, found.cost, found.estimate._elimination[0][0])


def fit_with_variances(model: Model, start: State, free_noise: Set[str], free_rig: bool) -> Fitted:
    """Fit, let the residuals correct the variances that may change, fit again until they agree."""
    if not (free_noise or free_rig):
        return fit(model, start)
    rough = 1e-3  # standard deviations; the variances are not known as well
    here = fit(model, start, rough)
    digits = np.concatenate([least_noise(v) for v in model.signals.values()])
    # of a noise that was stated the rounding is a part
    estimated = np.concatenate([np.full(v.shape[1], kind in free_noise) for kind, v in model.signals.items()])
    smallest = np.maximum(digits, np.where(estimated, model.rounding, 0.0))
    for _ in range(8):
        parts = estimate_components(here.model, here.at, here.state, free_noise, free_rig)
        noise_sd, rig_sd, structure_sd = _scaled(here.model, parts)
        rig_sd = np.where((rig_sd < 1e-9) & ~here.model.rig_known, 0.0, rig_sd)
        here = fit(here.model.with_weights(np.maximum(noise_sd, smallest), rig_sd, structure_sd), here.state, rough)
        changes = [*parts.noise.values(), *np.where(rig_sd > 0.0, parts.rig, 1.0), *parts.repeating]
        if np.abs(np.log(changes)).max() < 0.02:
            break
    return fit(here.model, here.state)


def fitted_without(fitted: Fitted, rest: Index, free_noise: Set[str], free_rig: bool) -> tuple[Model, Array, Array]:
    """What a fit of the stations `rest` alone would find, to first order.

    The whole model with the variances they tell, covariance (p, p) of the parameters, estimate as it is minus theirs.
    """
    at = Linear(fitted.at.jacobian[rest], fitted.at.by_setting[rest], fitted.at.residual[rest])
    state = replace(fitted.state, errors=fitted.state.errors[rest], _elimination=[])
    model = fitted.model.take(rest)
    likelihood = _Restricted(model, at, state, free_noise, free_rig)
    factors = _maximise(likelihood, np.ones(likelihood.size), _floors(model))[0]
    _, covariance, shift = likelihood.solve(factors)
    weights = _scaled(fitted.model, _components(model, factors, factors))
    return fitted.model.with_weights(*weights), covariance, shift


def fit_with_caution(fitted: Fitted, free_noise: Set[str], free_rig: bool) -> Fitted:
    """The same fit with its estimated variances as large as they may well be, and how well each of them is known."""
    parts = raised_components(fitted.model, fitted.at, fitted.state, free_noise, free_rig)
    raised = fit(fitted.model.with_weights(*_scaled(fitted.model, parts)), fitted.state)
    # a variance with relative uncertainty s is as well known as one from 2/s^2 degrees of freedom
    known = np.where(parts.relative_sd < 10.0, parts.relative_sd, 0.0)
    return replace(raised, variance_freedom=2.0 / np.maximum(known, 1e-3) ** 2)


def with_averaged_covariance(fitted: Fitted, free_noise: Set[str], free_rig: bool) -> Fitted:
    """The same fit, its covariance averaged over what is not known of the estimated variances."""
    average = average_over_variances(fitted.model, fitted.at, fitted.state, free_noise, free_rig)
    if average is None:
        return fitted
    covariance, _, relative, own = average
    freedom = 2.0 / np.where(np.isnan(relative), 1e-3, np.clip(relative, 1e-3, 2.0)) ** 2
    return replace(fitted, covariance=covariance, variance_freedom=freedom, relative_variance=own)


def effective_freedom(relative: Array | None, known: ArrayLike = 0.0) -> float:
    """Effective degrees of freedom of the variances of parameters, pooled; infinite where all were stated.

    nu = 2 / (relative variance of a variance): JCGM 100:2008, equation (E.7), and with several variances the formula of
    Welch and Satterthwaite, (G.2b). `known` (p,) is the share of each variance that comes from what is not estimated.
    """
    size = 0.0 if relative is None else float(np.mean((1.0 - np.asarray(known)) ** 2 * relative))
    return 2.0 / size if size > 0.0 else np.inf


def expected_variances(fitted: Fitted, free_noise: Set[str], free_rig: bool) -> tuple[Model, float]:
    """The fitted model with the means of its variances, which are larger than their likeliest values.

    Beside it the effective degrees of freedom of the tool's parameters.
    """
    average = average_over_variances(fitted.model, fitted.at, fitted.state, free_noise, free_rig)
    if average is None:
        return fitted.model, np.inf
    weights = _scaled(fitted.model, _components(fitted.model, average[1], average[1]))
    return fitted.model.with_weights(*weights), effective_freedom(average[3][: fitted.model.parameters])


def _scaled(model: Model, parts: Components) -> tuple[Array, Array, Array]:
    """Standard deviations of noise, dials and structured errors after their variances are multiplied."""
    factors = np.concatenate([np.full(v.shape[1], parts.noise[k]) for k, v in model.signals.items()])
    structured = np.where(model.structure_dial >= 0, parts.repeating[model.structure_dial], 1.0)
    rig = np.where(model.rig_known, 1.0, np.sqrt(parts.rig))
    return model.noise_sd * np.sqrt(factors), model.rig_sd * rig, model.structure_sd * np.sqrt(structured)


def rig_guess(given: ArrayLike | None) -> tuple[Array, Mask]:
    """Standard deviations (3,) of a setting to start with, rad, and which of them were stated; NaN is not."""
    sd = np.asarray(np.nan if given is None else given, dtype=np.float64)
    if sd.shape not in ((), (3,)):
        raise wrong_shape("rig_sd", sd.shape, "(3,)")
    known = np.broadcast_to(~np.isnan(sd) | (given is not None and sd.ndim == 0), (3,))
    # where the search for the rig's standard deviation starts, rad
    found = within(np.where(known, sd, np.radians(0.1)), "rig_sd", 0.0, np.radians(30.0), "rad")
    return found, known


def noise_guess(
    readings: BenchReadings, given: Mapping[str, object] | None, residual: Array
) -> tuple[Array, frozenset[str]]:
    """Standard deviations (K, M) to start with and the kinds whose noise the fit may change.

    A value given by the caller wins, then the standard deviations of the readings; otherwise a third of the starting
    residual, to be corrected by the variance components.
    """
    unknown = set(given or {}) - set(KINDS)
    if unknown:
        raise not_among("noise_sd", sorted(unknown)[0], KINDS)
    columns, free, start = [], [], 0
    size = len(readings)
    for kind, values in readings.channels.items():
        count = values.shape[1]
        rms = np.sqrt(np.mean(residual[:, start : start + count] ** 2)) / 3.0
        start += count
        least = least_noise(values)
        if given is not None and kind in given:
            sd = finite(given[kind], f"noise_sd.{kind}")  # type: ignore[arg-type]
            if sd.shape not in ((), (count,), (size, count)):
                raise wrong_shape(f"noise_sd.{kind}", sd.shape, f"({count},)")
            if (sd <= 0.0).any():
                raise out_of_range(f"noise_sd.{kind}", float(sd.min()), "> 0")
            columns.append(np.broadcast_to(sd, (size, count)))
        elif kind in readings.sd and (readings.sd[kind] > 0.0).any():
            # a mean of identical readings is still only known to the converter's step
            sd = np.hypot(readings.sd[kind], readings.rounding(kind))
            # nor is a mean without scatter exact where that step is unknown: it is assumed like the others
            columns.append(np.where(sd > 0.0, sd, np.sqrt(np.mean(sd[sd > 0.0] ** 2))))
        else:
            columns.append(np.maximum(np.maximum(rms, least), readings.rounding(kind)))
            free.append(kind)
    return np.concatenate(columns, axis=1), frozenset(free)
