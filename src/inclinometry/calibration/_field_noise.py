"""Noise levels from the residuals, with heavy tails: what a hand does to a reading, estimated and kept in its place."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from inclinometry.calibration._field_model import FieldProblem, Levels, Unknowns
from inclinometry.core.arrays import Array

NOISE: Final = 0.002
"""Expected noise of a reading, as a share of the full field."""

POINTING: Final = np.radians(0.3)
"""Expected error of pointing a tool by hand at the same target, rad."""

SPREAD: Final = 1.0
"""Standard deviation of the logarithm of a noise level about its expected value: a factor of e either way. Against the
forty degrees of freedom of a usual campaign this moves a level by a few per cent; it keeps a component that has hardly
any from falling to zero, which would trust it without limit."""

FREEDOM: Final = 8.0
"""Degrees of freedom of Student's t for one triad's reading (or pointing) at one station: Lange, Little, Taylor,
"Robust statistical modeling using the t distribution", JASA 84 (1989). Light enough that normal readings lose about two
per cent, heavy enough that one wild shot in sixteen does not lead."""

FLOOR: Final = 1e-5
"""Least noise, of full field, and least pointing error, rad: what even exact simulated readings are given."""

RAREST: Final = 0.01
"""A shot is named as bad when a clean campaign would name one less often than this."""


@dataclass(frozen=True)
class Estimate:
    """A fit with its noise levels. Columns of `square`, `free` and `weight`: each triad, then pointing."""

    problem: FieldProblem  # at the information weights of the t distribution
    at: Unknowns
    square: Array  # (K, g) sum of squared residuals in standard deviations, unweighted
    free: Array  # (K, g) redundancy
    weight: Array  # (K, g) weight of each block in the fit, 1 for a typical one, near 0 for a wild one
    blind: tuple[str, ...]  # components whose level the shots cannot tell


def first_levels(kinds: int, member: Array) -> Levels:
    """Where the noise levels start: what is expected, everything used."""
    used = np.ones((len(member), kinds + 1))
    used[:, -1] = member >= 0
    return Levels((NOISE,) * kinds, float(POINTING), used)


def estimate(problem: FieldProblem, at: Unknowns, rounds: int = 100) -> Estimate:
    """Fit, noise levels and weights together: iteratively reweighted least squares for Student's t.

    A block (one triad's reading at one station, or its pointing) with squared residual s on q degrees of freedom has
    weight (FREEDOM + q) / (FREEDOM + s). A level is where its weighted squares equal its redundancy (restricted maximum
    likelihood, Foerstner 1979), with the log-normal prior of `SPREAD`.
    """
    present = problem.levels.used > 0.0
    weight = np.ones_like(problem.levels.used)
    expected = np.array([*[NOISE] * len(problem.shots.kinds), POINTING])
    for count in range(rounds):
        at = problem.solve(at, 1e-4).estimate
        square, free = _sums(problem, at, np.where(present, weight, 1.0))
        updated = np.where(present, (FREEDOM + free) / (FREEDOM + square), 0.0)
        total, freedom = np.sum(updated * square, axis=0), free.sum(axis=0)
        old = np.array([*problem.levels.noise, problem.levels.pointing])
        new = np.where(present.any(axis=0), _levels(old, total, freedom, expected), old)
        if count >= 10:
            new = np.sqrt(old * new)  # halfway, where two components would keep handing the scatter to each other
        settled = np.all(np.abs(new / old - 1.0) < 2e-3) and np.all(np.abs(updated - weight)[present] < 1e-2)
        weight = updated
        problem = problem.with_levels(Levels(tuple(float(v) for v in new[:-1]), float(new[-1]), np.sqrt(weight)))
        if settled:
            break
    at = problem.solve(at).estimate
    square, free = _sums(problem, at, np.where(present, weight, 1.0))
    # information of t against a normal of the same scale; a block thrown far out tells nothing
    share = np.where(present & (weight > 0.1), (FREEDOM + free) / (FREEDOM + free + 2.0), 0.0)
    informed = problem.with_levels(replace(problem.levels, used=np.sqrt(share)))
    names = (*problem.shots.kinds, "pointing")
    freedom = free.sum(axis=0)
    blind = tuple(n for g, n in enumerate(names) if present[:, g].any() and freedom[g] < 2.0)
    return Estimate(informed, at, square, free, np.where(present, weight, 0.0), blind)


def _sums(problem: FieldProblem, at: Unknowns, weight: Array) -> tuple[Array, Array]:
    """Sum of squares (unweighted) and redundancy of each station and group, (K, groups)."""
    residual, redundancy = problem.linear(at).residual, problem.redundancy(at)
    last = sum(problem.shots.sizes)
    groups = [*problem.shots.rows, slice(last, last + 2)]
    square = np.stack([np.sum(residual[:, g] ** 2, axis=1) for g in groups], axis=1) / weight
    free = np.stack([np.sum(redundancy[:, g], axis=1) for g in groups], axis=1)
    return square, free * (problem.levels.used > 0.0)


def _levels(old: Array, total: Array, freedom: Array, expected: Array) -> Array:
    """Standard deviations where freedom - total (old/sd)^2 + log(sd / expected) / SPREAD^2 = 0, by Newton in log sd."""
    start = np.log(old)
    log = start.copy()
    for _ in range(100):
        ratio = total * np.exp(2.0 * (start - log))
        value = freedom - ratio + (log - np.log(expected)) / SPREAD**2
        step = np.clip(value / (2.0 * ratio + 1.0 / SPREAD**2), -1.0, 1.0)
        log = log - step
        if np.all(np.abs(step) < 1e-10):
            break
    return np.maximum(np.exp(log), FLOOR)


def bad_shots(found: Estimate) -> list[tuple[int, int]]:
    """(station, group) of blocks beyond chance, worst first: an F test against the weighted rest of their group."""
    from scipy.special import fdtrc

    judged = (found.free > 0.1) & (found.square > 0.0)
    rest = np.sum(found.weight * found.square, axis=0) - found.weight * found.square
    left = found.free.sum(axis=0) - found.free
    judged &= left > 2.0
    # a t scale of 8 degrees of freedom squared is 0.82 of the variance of the normal noise it is fitted to
    usual = np.maximum(rest / np.maximum(left, 1.0), 1e-300)
    ratio = np.where(judged, 0.82 * found.square / np.maximum(found.free, 0.1) / usual, 0.0)
    chance = np.where(judged, fdtrc(np.maximum(found.free, 0.1), np.maximum(left, 1.0), ratio), 1.0)
    order = np.argsort(chance, axis=None)
    limit = RAREST / max(int(np.count_nonzero(judged)), 1)
    rows, groups = np.unravel_index(order, chance.shape)
    return [(int(k), int(g)) for k, g in zip(rows, groups, strict=True) if chance[k, g] < limit]
