"""False movement of a casing, told from movement: bias, turned axes, shifted depths, sensitivity between two readings.

The change of a step is the sum of these errors, movement and noise. Movement is a walk along the casing from the end
that is fixed, rough or smooth, with jumps (a block that tilts) and single steps (a shear zone) where data need them.
The noise is that of the check-sums. An error is found by the log-likelihood ratio of the best fits with and without it.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array

LEAST_RATIO: Final = 8.0
"""Log-likelihood ratio of an error that is named; benchmarks.casings counts what that does to right pairs."""
_EVENT, _EVENT_FIXED, _EVENTS = 6.0, 12.0, 12
"""Log-likelihood that a jump or a single step has to gain, and one in the lowest or fixed steps; at most so many."""
_FIXED: Final = 5
_WALKS: Final = ((0, 0.0), *((1, 10.0**k) for k in range(-3, 3)), *((2, 10.0**k) for k in range(-6, 2)))
"""How often noise is summed to make a movement, and its variance over that of a step's noise."""
_PART: Final = 13.0
"""Log-likelihood that a sensitivity has to gain in addition: any part may have it, and walls bend as casings do."""
_DRIFT: Final = 5e-4
"""Usual change of a check-sum, as a sine, of a bias that drifts alike in both runs between readings: no error."""


class FalseMovement(NamedTuple):
    """Errors found between two readings.

    ratios : "bias a", "bias b", "rotation", "depth", "sensitivity a", .. b -> log-likelihood ratio. values : m a step,
    rad, m, relative. covariance : of values. steps : axis -> (p, n) change of each step for a unit of each, m.
    """

    ratios: Mapping[str, float]
    values: Array
    covariance: Array
    steps: Mapping[str, Array]


class _Fit(NamedTuple):
    """Negative log-likelihood, values and their covariance."""

    cost: float
    values: Array
    covariance: Array


@lru_cache(8)
def _walks(n: int, down: bool) -> list[tuple[Array, Array, float]]:
    """Of each kind of movement: the whitening matrix, single steps and jumps (n, 2 n) by it, half the log variance."""
    walk = np.tri(n) if down else np.tri(n).T
    found = list[tuple[Array, Array, float]]()
    for order, variance in _WALKS:
        away = np.linalg.matrix_power(walk, order)
        root = np.linalg.cholesky(np.eye(n) + (variance * away @ away.T if order else 0.0))
        white = np.asarray(np.linalg.inv(root), dtype=np.float64)
        found.append((white, np.concatenate([white, white @ walk], axis=1), float(np.log(np.diag(root)).sum())))
    return found


def _fit(columns: Array, change: Array, down: bool) -> _Fit:
    """The best fit of columns (p, k, n) and movement to a change (k, n), both over the noise."""
    k, n = change.shape
    price = np.full(2 * n, _EVENT)
    fixed = np.arange(_FIXED) if down else n - 1 - np.arange(_FIXED)
    price[np.concatenate([fixed, n + fixed])] = _EVENT_FIXED
    found = []
    for white, events, half in _walks(n, down):
        design = list((columns @ white.T).reshape(len(columns), k * n))
        seen = (change @ white.T).ravel()
        basis, _ = np.linalg.qr(np.array(design).T) if design else (np.zeros((k * n, 0)), None)
        rest = seen - basis @ (basis.T @ seen)
        size = np.tile((events**2).sum(axis=0), (k, 1))
        free = size - sum((np.square(one.reshape(k, n) @ events) for one in basis.T), np.zeros((k, 2 * n)))
        cost = k * half
        for _ in range(_EVENTS):
            gain = np.square(rest.reshape(k, n) @ events) / np.maximum(free, 1e-300)
            gain = np.where(free > 1e-6 * size, 0.5 * gain - price, -1.0)
            axis, event = np.unravel_index(int(gain.argmax()), gain.shape)
            if gain[axis, event] <= 0.0:
                break
            added = np.zeros((k, n))
            added[axis] = events[:, event]
            design.append(added.ravel())
            one = added.ravel() - basis @ (basis.T @ added.ravel())
            one /= np.linalg.norm(one)
            basis = np.column_stack([basis, one])
            rest -= one * (one @ rest)
            free -= np.square(one.reshape(k, n) @ events)
            cost += price[event]
        found.append((cost + 0.5 * float(rest @ rest), np.array(design).reshape(-1, k * n), seen))
    cost, rows, seen = min(found, key=lambda one: one[0])
    inverse = np.linalg.pinv(rows.T)
    p = len(columns)
    return _Fit(cost, (inverse @ seen)[:p], (inverse @ inverse.T)[:p, :p])


def _agreement(lean: float, sums: float, u: float) -> float:
    """Log-likelihood ratio that the change of the mean check-sum has of a lean a step against none, all as sines."""

    def normal(value: float, sd: float) -> float:
        return float(np.exp(-0.5 * (value / sd) ** 2) / sd)

    drift = 2.0 * normal(sums, np.hypot(u, _DRIFT))
    match = normal(sums - 2.0 * lean, u) + normal(sums + 2.0 * lean, u)
    return float(np.log((match + drift) / (2.0 * normal(sums, u) + drift)))


def _of_part(change: Array, mean: Array, axis: int) -> Array:
    """The mean of one axis (k, n) over all steps, or a side, whichever is most in proportion to its change."""
    n = mean.shape[1]
    parts = np.array([np.full(n, 1.0), *np.tri(n)[4:-4:4], *np.tri(n).T[4:-4:4]]) * mean[axis]
    gain = (parts @ change[axis]) ** 2 / np.maximum(np.sum(parts**2, axis=1), 1e-300)
    gain[0] *= 1.05  # a part has to explain more
    return np.asarray(np.where(np.arange(len(mean))[:, None] == axis, parts[int(gain.argmax())], 0.0))


def false_movement(change: Array, mean: Array, noise: Array, sums: Array, step: float, *, down: bool) -> FalseMovement:
    """Errors between two readings of a casing.

    change, mean : (k, n) difference and mean of the deviations of one or two axes, m. noise : (k,) standard deviation
    of a change, m. sums : (k,) change of the mean check-sum, as a sine. down : the upper end is fixed.
    """
    k, n = change.shape
    units = {f"bias {'ab'[axis]}": np.repeat(np.eye(k)[axis][:, None], n, axis=1) for axis in range(k)}
    if k == 2:
        units["rotation"] = np.stack([mean[1], -mean[0]])
    units["depth"] = np.gradient(mean, step, axis=1)
    units |= {f"sensitivity {'ab'[axis]}": _of_part(change, mean, axis) for axis in range(k)}

    def fit(names: list[str]) -> _Fit:
        columns = np.array([units[name] for name in names]).reshape(-1, k, n)
        return _fit(columns / noise[:, None], change / noise[:, None], down)

    names = list(units)
    best, ratios = fit(names), dict.fromkeys(names, 0.0)
    if fit([]).cost - best.cost < 0.5 * LEAST_RATIO:  # nothing explains more than all; check-sums add a few units
        names = []
    while names and min(ratios.values()) < LEAST_RATIO:
        without = {name: fit([other for other in names if other != name]) for name in names}
        ratios = {name: without[name].cost - best.cost for name in names}
        for axis in range(k):
            if (name := f"sensitivity {'ab'[axis]}") in names:
                ratios[name] -= _PART
            if (name := f"bias {'ab'[axis]}") in names:
                lean, u = best.values[names.index(name)] / step, 2.0 * noise[axis] / step / np.sqrt(n)
                ratios[name] += _agreement(lean, sums[axis], u)
        least = min(names, key=lambda name: ratios[name])
        if ratios[least] < LEAST_RATIO:
            names.remove(least)
            best = without[least]
    steps = {"ab"[axis]: np.array([units[name][axis] for name in names]).reshape(-1, n) for axis in range(k)}
    return FalseMovement({name: ratios[name] for name in names}, best.values, best.covariance, steps)
