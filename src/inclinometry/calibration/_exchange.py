"""Choosing stations by exchange on the information matrix: arrays in and out, no checks.

The variance of what is asked at attitude g with information F is v_g = sum_r h_gr' F^-1 h_gr. A station with factor L
(information L'L) added to F lowers it by |C^-1 L F^-1 h|^2, C C' = I + L F^-1 L' (Woodbury), for all candidates at
once. The worst of the v_g has corners on which an exchange of one station at a time sticks, so the search minimises
their norm (sum_g v_g^power)^(1/power), which comes as close to the worst as wanted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from inclinometry.core.arrays import Array, Index, Mask

_NEGLIGIBLE = 1e-7
"""Share of the objective that may be left out of a comparison."""
_FEW = 64
_BLOCK = 200_000
"""Multiplications in a product that OpenBLAS does in one thread: up to 2^18."""
_PASSES, _LAST_PASSES = 12, 4
"""Passes of an exchange at power 32, which finds its way, and at power 128, which is the worst to within a percent."""


@dataclass(frozen=True, eq=False)
class Problem:
    """What there is to choose from and what it is judged by.

    factors : (K, M, p) of each candidate, information L'L
    fixed : (p, p) information that is there anyway: captured stations and priors, regular
    gradients : (G, R, p) of the R quantities whose variances are summed at each of G attitudes
    allowed : (K,) whether a candidate may be chosen at all
    """

    factors: Array
    fixed: Array
    gradients: Array
    allowed: Mask

    def information(self, chosen: list[int]) -> Array:
        """Fixed information and that of the chosen candidates."""
        rows = self.factors[chosen].reshape(-1, self.factors.shape[2])
        return np.asarray(self.fixed + rows.T @ rows)

    def variances(self, information: Array) -> Array:
        """Variance (G,) at each attitude."""
        return attitude_variances(np.asarray(np.linalg.inv(information), dtype=np.float64), self.gradients)


@dataclass(frozen=True, eq=False)
class Exchanged:
    """Chosen candidates (n,), the worst variance with them, and the objective after every accepted exchange."""

    chosen: list[int]
    worst: float
    history: list[float]


def attitude_variances(covariance: Array, gradients: Array) -> Array:
    """Variances (G,) summed over the R quantities of each attitude, from the parameters' covariance (p, p)."""
    flat = gradients.reshape(-1, gradients.shape[2])
    return np.asarray(np.einsum("ij,ij->i", _product(flat, covariance), flat).reshape(gradients.shape[:2]).sum(axis=1))


def norm(variances: Array, doublings: int) -> float:
    """(sum v^power)^(1/power), power = 2^doublings: the largest, and a little more for every other that is as large."""
    largest = variances.max()
    return float(largest * _powers(variances / largest, doublings) ** (0.5**doublings))


def best_addition(problem: Problem, information: Array, taken: list[int], doublings: int) -> int:
    """The candidate whose addition makes the objective smallest, among those allowed and not taken.

    The objective over the worst few attitudes is a lower bound of the whole, so only candidates that are good there
    need the whole.
    """
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    before = attitude_variances(covariance, problem.gradients)
    order = np.argsort(-before, kind="stable")
    white = whitened(problem.factors, covariance)
    free = problem.allowed.copy()
    free[taken] = False
    candidates = np.flatnonzero(free)

    def after(chosen: Index, attitudes: Index) -> Array:
        return before[attitudes] - reductions(white[chosen], problem.gradients[attitudes])

    few = after(candidates, order[:_FEW])
    reference = few.max(axis=1).min()
    bound = _powers(few / reference, doublings)
    ranked = np.argsort(bound, kind="stable")
    first, rest = ranked[:_FEW], ranked[_FEW:]
    # no addition raises a variance: attitudes that matter little even without it are left out
    tail = np.cumsum(_power(before[order] / reference, doublings)[::-1])[::-1]
    order = order[tail > _NEGLIGIBLE * bound.min()]
    whole = _powers(after(candidates[first], order) / reference, doublings)
    more = rest[bound[rest] < whole.min()]
    whole = np.concatenate([whole, _powers(after(candidates[more], order) / reference, doublings)])
    return int(candidates[np.concatenate([first, more])[np.argmin(whole)]])


def whitened(factors: Array, covariance: Array) -> Array:
    """C^-1 L F^-1 (K, M, p) of every candidate, C C' = I + L F^-1 L'."""
    moved = factors @ covariance
    core = moved @ factors.swapaxes(1, 2)
    core[:, np.arange(core.shape[1]), np.arange(core.shape[1])] += 1.0
    return np.asarray(np.linalg.inv(np.linalg.cholesky(core)) @ moved)


def reductions(white: Array, gradients: Array) -> Array:
    """How much each candidate, added, lowers the variance at each attitude: (K, G)."""
    count, rank, width = white.shape
    shape = (count, rank, len(gradients), gradients.shape[1])
    seen = _product(white.reshape(-1, width), gradients.reshape(-1, width).T).reshape(shape)
    return np.asarray(np.einsum("kmgr,kmgr->kg", seen, seen))


def exchange(
    problem: Problem,
    chosen: list[int],
    random: np.random.Generator,
    doublings: int,
    passes: int,
    tick: Callable[[], None],
) -> Exchanged:
    """Replace one station at a time by the best candidate until no replacement helps, or `passes` times all of them."""
    chosen = list(chosen)
    information = problem.information(chosen)
    here = norm(problem.variances(information), doublings)
    history, stale = [here], 0
    for _ in range(passes):
        for place in random.permutation(len(chosen)):
            without = information - _own(problem, chosen[place])
            others = [c for i, c in enumerate(chosen) if i != place]
            best = best_addition(problem, without, others, doublings)
            stale += 1
            if best != chosen[place]:
                trial = without + _own(problem, best)
                there = norm(problem.variances(trial), doublings)
                if there < here * (1.0 - 1e-10):
                    chosen[place], information, here, stale = best, trial, there, 0
                    history.append(here)
            if stale >= len(chosen):
                break
        tick()
        if stale >= len(chosen):
            break
    return Exchanged(chosen, float(problem.variances(information).max()), history)


def fill(problem: Problem, chosen: list[int], count: int, doublings: int) -> list[int]:
    """Add the best candidate to those chosen until there are `count`."""
    chosen = list(chosen)
    information = problem.information(chosen)
    while len(chosen) < count:
        chosen.append(best_addition(problem, information, chosen, doublings))
        information = information + _own(problem, chosen[-1])
    return chosen


def search(
    problem: Problem, count: int, seed: int, restarts: int, progress: Callable[[float], None] | None
) -> Exchanged:
    """Best of several searches: the first from a greedy start, the others from a half filled at random."""
    random = np.random.default_rng(seed)
    pool: Index = np.flatnonzero(problem.allowed)
    passes, done = _PASSES + _LAST_PASSES, 0

    def tick() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done / (passes * restarts))

    best = Exchanged([], np.inf, [])
    for restart in range(restarts):
        first = [int(c) for c in random.choice(pool, count // 2 if restart else 0, replace=False)]
        rough = exchange(problem, fill(problem, first, count, 5), random, 5, _PASSES, tick)
        fine = exchange(problem, rough.chosen, random, 7, _LAST_PASSES, tick)
        best = min(best, rough, fine, key=lambda e: e.worst)
        # an exchange that settles early leaves passes unused
        done = (restart + 1) * passes - 1
        tick()
    return best


def _own(problem: Problem, candidate: int) -> Array:
    factor = problem.factors[candidate]
    return np.asarray(factor.T @ factor)


def _product(rows: Array, matrix: Array) -> Array:
    """rows @ matrix in blocks for which BLAS starts no threads: waiting for them costs more."""
    block = max(_BLOCK // matrix.size, 1)
    out = np.empty((len(rows), matrix.shape[1]))
    for start in range(0, len(rows), block):
        np.matmul(rows[start : start + block], matrix, out=out[start : start + block])
    return out


def _power(ratio: Array, doublings: int) -> Array:
    """ratio^(2^doublings), of ratios up to 100: any larger is equally bad; rounding may leave one just below zero."""
    value = np.clip(ratio, 0.0, 100.0)
    for _ in range(doublings):
        value = value * value
    return np.asarray(value)


def _powers(ratio: Array, doublings: int) -> Array:
    return np.asarray(_power(ratio, doublings).sum(axis=-1))
