"""Point-mass filter: a scale factor that walks from station to station, as a density on a grid.

    s_n = l_n + p(T_n) + own_n,   l_n = l_(n-1) + e_n,   e_n ~ (1 - pj) N(0, q^2) + pj N(0, 0.03^2)

p is a polynomial in temperature and own_n ~ N(0, j^2), both only where there is a thermometer. Nothing is fixed: a bank
of filters runs, one for each choice of q, pj, j and of the polynomial's coefficients. Each counts by its evidence, the
probability it gave to the readings. What a station's rates say of the scale factor is the sum over all azimuths that
fit: the two roots of the closed form are two bumps of one density, and none is chosen.

A node of the grid stands for the scale factors about it: a Gaussian of half a step. So a station's likelihood may be
sharper than the grid, down to readings without noise.

Source: Bucy R.S., Senne K.D., "Digital synthesis of non-linear filters", Automatica 7 (1971) 287-298 (the filter on a
grid); Magill D.T., IEEE Trans. Automatic Control 10 (1965) 434-439 (the bank weighted by evidence).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from inclinometry.arrays import Array, Index
from inclinometry.gyro.joint import JointBatch, earth_in_tool, earth_slopes, solve_joint
from inclinometry.gyro.result import weights
from inclinometry.rotations import wrap_positive, wrap_signed
from inclinometry.uncertainty import UNKNOWN

STEPS = (3e-5, 2e-4, 5e-4, 1e-3, 2e-3, 4e-3, 8e-3, 1.6e-2, 3e-2)
"""Standard deviations of a step from station to station that are tried."""

JUMP = 0.03
"""Standard deviation of a jump, and of the scale factor where what was stated of it does not hold."""

OWN = (3e-5, 5e-4, 2e-3)
"""Standard deviations of each station's own deviation from the curve over temperature."""

LOWEST, HIGHEST = 0.5, 2.0
"""Scale factors tried."""

FINEST, WIDEST = 1e-4, 4e-4
"""Limits of the fine step, a quarter of the noise in units of the Earth rate."""

FLOOR = 1e-14
"""Probability below which no node falls: nothing is impossible, and rounding does no harm."""


class Grid(NamedTuple):
    """Scale factors at equal distances: nodes (m,) and step."""

    nodes: Array
    step: float

    @classmethod
    def over(cls, low: float, high: float, step: float) -> Grid:
        """Nodes at whole steps from 1, between two scale factors."""
        first, last = np.floor((max(low, LOWEST) - 1.0) / step), np.ceil((min(high, HIGHEST) - 1.0) / step)
        return cls(1.0 + step * np.arange(first, last + 1.0), step)


class Rates(NamedTuple):
    """High-side rates (n, 3), z NaN where not measured, their covariance (n, 3, 3) and inclination (n,), checked."""

    high: Array
    covariance: Array
    inclination: Array
    latitude: float

    def at(self, rows: Index, grid: Grid, nodes: Array) -> JointBatch:
        """The joint estimate of stations `rows`, each with the scale factor of one node."""
        return solve_joint(
            self.high[rows], self.covariance[rows], self.inclination[rows], self.latitude,
            scale=nodes, scale_sd=0.5 * grid.step,
        )  # fmt: skip

    def likelihood(self, grid: Grid) -> Array:
        """Probability (n, m) of each station's rates at each node, the largest of a station being 1."""
        size, out = len(grid.nodes), np.empty((len(self.high), len(grid.nodes)))
        for n in range(len(out)):
            found = self.at(np.full(size, n), grid, grid.nodes)
            out[n] = _peaks(found)[0].sum(axis=0)
        return np.asarray(out / out.max(axis=1, keepdims=True))


def _peaks(found: JointBatch) -> tuple[Array, Array, Array, Array]:
    """Probability, azimuth, its variance and k (2, m) of the one or two azimuths that fit, both near the best."""
    cost = np.stack([found.cost, found.rival_cost])
    azimuth = np.stack([found.azimuth, np.where(np.isfinite(found.rival), found.rival, found.azimuth)])
    # nothing is known of an azimuth that the rates do not depend on, and no more than that
    variance = np.stack([found.var_azimuth, found.rival_var])
    bound = np.minimum(1.0, UNKNOWN / np.sqrt(np.maximum(variance, 1e-300)))
    mass = np.stack([found.mass, found.rival_mass]) * bound
    weight = mass * np.exp(-0.5 * np.minimum(cost - found.cost.min(), 1400.0))
    return weight, azimuth, variance * bound**2, np.stack([found.k, found.rival_k])


class Members(NamedTuple):
    """A bank of b filters.

    step, jump, own : (b,) q, pj and j.
    curve : (b, c) coefficients of the polynomial, c = 0 without a thermometer.
    weight : (b,) before any reading.
    """

    step: Array
    jump: Array
    own: Array
    curve: Array
    weight: Array

    @classmethod
    def every(cls, own: Sequence[float], curve: Array, weight: Array) -> Members:
        """All combinations; `weight` (k,) of the coefficients `curve` (k, c)."""
        jumps = (0.003, 0.1)  # shares of the steps
        q, pj, j, c = (v.ravel() for v in np.meshgrid(STEPS, jumps, own, np.arange(len(curve)), indexing="ij"))
        return cls(q, pj, j, curve[c], weight[c] / weight[c].sum())

    def only(self, kept: Index) -> Members:
        """Some of them."""
        return Members(*(part[kept] for part in self))


def stated(grid: Grid, scale: Array, sd: Array) -> Array:
    """Densities (b, m) of a scale factor stated by its value and standard uncertainty (b,), which may not hold."""
    off, narrow = (grid.nodes - scale[:, None]) / grid.step, np.maximum(sd[:, None] / grid.step, 0.5)
    wide = np.maximum(narrow, JUMP / grid.step)
    holds, not_ = (np.exp(-0.5 * (off / width) ** 2) / width for width in (narrow, wide))
    # one statement in twenty does not hold
    density = 0.95 * holds + 0.05 * not_
    return np.asarray(np.maximum(density / density.sum(axis=1, keepdims=True), FLOOR))


class Bank:
    """The filters of a bank on one grid; `first` (b, 2): mean and sd of the first station's scale, for each member."""

    def __init__(self, members: Members, grid: Grid, first: Array) -> None:
        self.members, self.grid = members, grid
        # 3 sigma of a jump beyond the grid, before what leaves at one end comes in at the other
        self._size = _fast(len(grid.nodes) + int(3.0 * JUMP / grid.step))
        # a walk on the lattice, in continuous time: a density, of that variance, at any step
        wave = 1.0 - np.cos(2.0 * np.pi * np.arange(self._size // 2 + 1) / self._size)
        small, jump = (
            np.exp(-np.outer((members.step / grid.step) ** 2, wave)),
            np.exp(-((JUMP / grid.step) ** 2) * wave),
        )
        self._walk = small + members.jump[:, None] * (jump - small)
        self._owns, self._which = np.unique(members.own, return_inverse=True)
        self._own = np.exp(-np.outer((self._owns / grid.step) ** 2, wave))
        self.start = stated(grid, first[:, 0], first[:, 1])

    def _spread(self, density: Array, filters: Array) -> Array:
        return np.fft.irfft(np.fft.rfft(density, self._size) * filters, self._size)[:, : density.shape[1]]

    def walked(self, density: Array) -> Array:
        """A density (b, m) one station on, or back."""
        return np.maximum(self._spread(density, self._walk), FLOOR)

    def seen(self, likelihood: Array, basis: Array) -> Array:
        """Likelihood (b, m) of l from that of the station's scale factor (m,), basis (c,) the powers of temperature."""
        if not basis.size:
            return np.broadcast_to(likelihood, self.start.shape)
        own = np.maximum(self._spread(np.broadcast_to(likelihood, (len(self._owns), likelihood.size)), self._own), 0.0)
        return _shifted(own[self._which], -self.members.curve @ basis / self.grid.step)

    def scale(self, density: Array, basis: Array) -> Array:
        """Density (b, m) of the station's scale factor from that of l."""
        if not basis.size:
            return density
        moved = _shifted(density, self.members.curve @ basis / self.grid.step)
        return np.maximum(self._spread(moved, self._own[self._which]), 0.0)

    def weights(self, evidence: Array) -> Array:
        """Probability (b,) of the members, by the logarithm of their evidence."""
        total = evidence + np.log(np.maximum(self.members.weight, 1e-300))
        weight = np.exp(total - total.max())
        return np.asarray(weight / weight.sum())


class Forward:
    """The filters as the stations come in: what each says of the next l, and the logarithm of its evidence."""

    def __init__(self, bank: Bank) -> None:
        self.bank, self.density, self.evidence = bank, bank.start, np.zeros(len(bank.start))

    def expected(self, basis: Array) -> Array:
        """Density (m,) of the next station's scale factor."""
        out = self.bank.weights(self.evidence) @ self.bank.scale(self.density, basis)
        return np.asarray(out / out.sum())

    def add(self, likelihood: Array, basis: Array) -> None:
        """A station's rates."""
        seen = self.density * self.bank.seen(likelihood, basis)
        total = seen.sum(axis=1, keepdims=True)
        self.evidence = self.evidence + np.log(total[:, 0])
        self.density = self.bank.walked(seen / total)


class Smoothed(NamedTuple):
    """A run of n stations.

    expected : (n, m) density of each station's scale factor from all others.
    weight : (b,) of the members of `bank`, those that count.
    mean, variance : (n,) of l + p given the whole run; tie : (n - 1,) its covariance with the next station's.
    """

    expected: Array
    bank: Bank
    weight: Array
    mean: Array
    variance: Array
    tie: Array

    def factor(self, most: int = 256) -> Array:
        """F (n, r) of F F', the covariance of l + p: a Markov chain with these variances and ties.

        Of more than `most` stations the `most` largest components, by which neighbours err together.
        """
        size = len(self.mean)
        out = np.zeros((size, size))
        out[0, 0] = np.sqrt(self.variance[0])
        for n in range(1, size):
            gain = self.tie[n - 1] / self.variance[n - 1]
            out[n] = gain * out[n - 1]
            out[n, n] = np.sqrt(max(self.variance[n] - gain**2 * self.variance[n - 1], 0.0))
        if size <= most:
            return out
        # Halko N. et al., SIAM Review 53 (2011) 217-288, algorithm 4.4
        base = np.linalg.qr(out @ np.random.default_rng(0).standard_normal((size, most)))[0]
        for _ in range(2):
            base = np.linalg.qr(out @ (out.T @ base))[0]
        left, values, _ = np.linalg.svd(base.T @ out, full_matrices=False)
        return np.asarray(base @ (left * values))


def smoothed(members: Members, grid: Grid, first: Array, likelihood: Array, basis: Array) -> Smoothed:
    """Forward filter and backward smoother of n stations with likelihood (n, m) and basis (n, c)."""
    bank = Bank(members, grid, first)
    forward = Forward(bank)
    for row, powers in zip(likelihood, basis, strict=True):
        forward.add(row, powers)
    weight = bank.weights(forward.evidence)
    kept = np.flatnonzero(weight > 1e-3 * weight.max())
    weight = weight[kept] / weight[kept].sum()
    bank = Bank(members.only(kept), grid, first[kept])
    forward, before = Forward(bank), np.empty((len(likelihood), *bank.start.shape))
    for n, (row, powers) in enumerate(zip(likelihood, basis, strict=True)):
        before[n] = forward.density
        forward.add(row, powers)
    size, nodes = len(likelihood), grid.nodes - 1.0
    expected, mean, square = np.empty_like(likelihood), np.empty(size), np.empty((2, size))
    after, later = np.full(bank.start.shape, 1.0 / len(nodes)), np.zeros(bank.start.shape)
    for n in range(size - 1, -1, -1):
        seen, curve = bank.seen(likelihood[n], basis[n]), bank.members.curve @ basis[n]
        joint = before[n] * after * seen
        total = joint.sum(axis=1)
        expected[n] = (weight / total) @ bank.scale(before[n] * after, basis[n])
        here = joint @ nodes / total + curve
        mean[n] = weight @ here
        square[0, n] = weight @ (joint @ nodes**2 / total + 2.0 * curve * here - curve**2)
        # later: the mean of the next station's l + p for each l of this one, times `after`
        both = np.einsum("bm,bm,bm,m->b", before[n], seen, later, nodes) + curve * np.einsum(
            "bm,bm,bm->b", before[n], seen, later
        )
        square[1, n] = weight @ (both / total)
        after = after * seen
        scale = after.sum(axis=1, keepdims=True)
        # before the floor, so that what lies far out moves no mean
        later = bank._spread(after / scale * (nodes + curve[:, None]), bank._walk)
        after = bank.walked(after / scale)
    # a node is a Gaussian of half a step
    variance = np.maximum(square[0] - mean**2, 0.0) + 0.25 * grid.step**2
    tie = square[1, :-1] - mean[:-1] * mean[1:]
    return Smoothed(expected / expected.sum(axis=1, keepdims=True), bank, weight, 1.0 + mean, variance, tie)


def _shifted(density: Array, steps: Array) -> Array:
    """Densities (b, m) moved up by steps (b,), whole or not; the ends keep their values."""
    whole = np.floor(steps)
    part, at = (steps - whole)[:, None], np.arange(density.shape[1]) - whole.astype(np.int64)[:, None]
    last = density.shape[1] - 1
    one, two = (np.take_along_axis(density, np.clip(at - more, 0, last), axis=1) for more in (0, 1))
    return np.asarray((1.0 - part) * one + part * two)


def _fast(size: int) -> int:
    """Even length at which a Fourier transform is fast: 2^a or 3 2^a."""
    power = 1 << (size - 1).bit_length()
    return 3 * power // 4 if 3 * power // 4 >= size else power


class ScaleLaw(NamedTuple):
    """What is known of each station's scale factor without its own rates: a density on a grid for each station (n,)."""

    stations: tuple[tuple[Grid, Array], ...]

    def moments(self) -> tuple[Array, Array]:
        """Mean and standard deviation (n,)."""
        out = np.empty((2, len(self.stations)))
        for n, (grid, density) in enumerate(self.stations):
            off = grid.nodes - 1.0
            mean = density @ off / density.sum()
            square = density @ (off - mean) ** 2 / density.sum()
            out[:, n] = 1.0 + mean, np.sqrt(square + 0.25 * grid.step**2)
        return out[0], out[1]


def stated_law(scale: Array, sd: Array) -> ScaleLaw:
    """The law of stations of which no more is known than what is stated of their scale factors (n,)."""
    grids = [Grid.over(LOWEST, HIGHEST, float(np.clip(0.5 * one, FINEST, WIDEST))) for one in sd]
    return ScaleLaw(tuple((grid, stated(grid, scale[n : n + 1], sd[n : n + 1])[0]) for n, grid in enumerate(grids)))


class Posterior(NamedTuple):
    """Azimuth and scale factor of n stations by the rates and a `ScaleLaw`."""

    # the most probable pairs, as of `solve_joint`; variances about them by a Gaussian of the same var_k
    found: JointBatch
    azimuth_sd: Array  #: (n,) over all azimuths and scale factors
    # scale, scale_sd: (n,) mean and standard deviation over all of them
    scale: Array
    scale_sd: Array
    prior_sd: Array  #: (n,) of k, of the Gaussian that replaces the law in the variances of `found`
    surprise: Array  #: (n,) distance of the highest peak from that of the law, in standard uncertainties of a Gaussian


def solve_law(rates: Rates, law: ScaleLaw) -> Posterior:
    """Azimuths from the densities of the scale factor.

    The azimuth is the mean about the highest peak, its standard deviation is over all peaks and all scale factors.
    """
    out = np.array([_station(rates, n, *law.stations[n]) for n in range(len(rates.high))]).reshape(-1, 10).T
    psi, sd, k, sd_k, scale, scale_sd, rival, share, misfit, unlikely = out
    weight = weights(rates.covariance, np.isfinite(rates.high[:, 2]))
    model = earth_in_tool(psi, rates.inclination, rates.latitude)
    slope = k[:, None] * earth_slopes(psi, rates.inclination, np.full(len(psi), rates.latitude))[..., 0]
    pp, pk, kk = (np.einsum("ni,nij,nj->n", a, weight, b) for a, b in ((slope, slope), (slope, model), (model, model)))
    least = 1e-12
    prior = np.maximum(1.0 / sd_k**2 - (kk - pk**2 / np.maximum(pp, least)), least)
    var = 1.0 / np.maximum(pp - pk**2 / np.maximum(kk + prior, least), least)
    cross = -pk / np.maximum(kk + prior, least) * var
    var_k = 1.0 / np.maximum(kk + prior, least) - pk / np.maximum(kk + prior, least) * cross
    expected, spread = law.moments()
    cost = misfit + unlikely
    flat = solve_joint(*rates[:3], rates.latitude, scale=expected, scale_sd=spread).weak
    rival_cost = cost - 2.0 * np.log(np.maximum(share, 1e-300))
    found = JointBatch(
        wrap_positive(psi), k, var, cross, var_k, cost, rival, rival_cost, rival_cost - cost < 25.0, flat,
        *np.full((4, len(psi)), np.nan),
    )  # fmt: skip
    return Posterior(found, sd, scale, scale_sd, 1.0 / np.sqrt(prior), np.sqrt(unlikely))


def _station(rates: Rates, n: int, grid: Grid, density: Array) -> tuple[float, ...]:
    """One station: azimuth, sd; k, sd; scale, sd; azimuth of the next peak, its share of the first; cost of the
    highest peak by the rates, and by the density."""
    used = np.flatnonzero(density > 1e-13 * density.max())
    found = rates.at(np.full(used.size, n), grid, grid.nodes[used])
    weight, azimuth, variance, k = _peaks(found)
    weight = weight * density[used]
    weight /= weight.sum()
    top = np.unravel_index(np.argmax(weight / np.sqrt(np.maximum(variance, 1e-300))), weight.shape)
    off = wrap_signed(azimuth - azimuth[top])
    # at each node the azimuth on the side of the highest peak belongs to it
    row, column = np.argmin(np.abs(off), axis=0), np.arange(used.size)
    own = weight[row, column]
    mean = own @ off[row, column] / own.sum()
    sd = np.sqrt(np.sum(weight * (variance + wrap_signed(off - mean) ** 2)))
    k_mean = own @ k[row, column] / own.sum()
    inside = found.var_k[np.argmax(weight[0])]
    k_sd = np.sqrt(own @ (k[row, column] - k_mean) ** 2 / own.sum() + inside)
    scale = np.where(weight > 0.0, 1.0 / np.maximum(k, 0.2), 1.0)
    s_mean = np.sum(weight * scale)
    s_sd = np.sqrt(np.sum(weight * (scale - s_mean) ** 2) + inside * s_mean**4)
    other = weight[1 - row, column]
    second = np.argmax(other)
    share = other.sum() / own.sum()
    rival = float(azimuth[1 - row[second], second]) if share > 0.0 else np.nan
    return (
        float(azimuth[top] + mean), float(sd), float(k_mean), float(k_sd), float(s_mean), float(s_sd),
        rival, float(share), float((found.rival_cost if top[0] else found.cost)[top[1]]),
        float(2.0 * np.log(density.max() / density[used[top[1]]])),
    )  # fmt: skip
