"""Least squares on a manifold: one Levenberg-Marquardt loop for every fit of the package.

The problem says how it is stepped (`retract`) and what its normal equations are, so that a fit may keep unit vectors
on the sphere or eliminate its nuisance parameters block by block; the loop only damps, tests and stops.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from inclinometry.arrays import Array
from inclinometry.errors import ConvergenceError
from inclinometry.findings import Finding

State = TypeVar("State")


class Normal(NamedTuple):
    """Half the cost's gradient and Gauss-Newton Hessian at one state."""

    cost: float  #: sum of squared weighted residuals
    gradient: Array  #: (p,) J' W r
    hessian: Array  #: (p, p) J' W J
    eliminated: float = 0.0  #: decrement of parameters the problem has eliminated and steps on its own in `retract`


@dataclass(frozen=True)
class Fit(Generic[State]):
    """Where the loop stopped. `covariance` is the inverse Hessian: the estimate's covariance when weights are true."""

    estimate: State
    covariance: Array
    cost: float
    iterations: int


def levenberg_marquardt(
    normal: Callable[[State], Normal],
    start: State,
    retract: Callable[[State, Array], State],
    *,
    tolerance: float = 1e-10,
    iterations: int = 100,
) -> Fit[State]:
    """Minimise sum of squares from `start`; steps are scaled by the Hessian's diagonal.

    Ends when the Newton decrement g' H^-1 g is below tolerance^2 (1 + cost): the remaining step is a negligible part of
    a standard deviation. Damping after Nielsen, "Damping parameter in Marquardt's method", IMM-REP-1999-05.
    """
    state, here = start, normal(start)
    damping, growth = 1e-6, 2.0
    for count in range(iterations):
        if not np.isfinite(here.cost) or not np.isfinite(here.gradient).all():
            raise ConvergenceError(Finding("input-overflow", {"name": "fit"}))
        step, decrement = _damped_step(here, 0.0)
        if decrement + here.eliminated <= tolerance**2 * (1.0 + here.cost):
            state = retract(state, step)
            return Fit(state, inverse_spd(normal(state).hessian), here.cost, count)
        while True:
            if damping > 1e12:
                # no downhill step is left at all: the cost is flat to rounding here
                return Fit(state, inverse_spd(here.hessian), here.cost, count)
            step, decrement = _damped_step(here, damping)
            trial = retract(state, step)
            there = normal(trial)
            gain = here.cost - there.cost
            if np.isfinite(there.cost) and gain > 0.0:
                expected = max(decrement + here.eliminated, np.finfo(float).tiny)
                damping *= max(1.0 / 3.0, 1.0 - (2.0 * gain / expected - 1.0) ** 3)
                damping, growth = max(damping, 1e-15), 2.0
                state, here = trial, there
                break
            if decrement + here.eliminated <= 1e-16 * here.cost:
                # what remains to be gained is rounding of the cost
                return Fit(state, inverse_spd(here.hessian), here.cost, count)
            damping, growth = max(damping, 1e-12) * growth, growth * 2.0
    step, decrement = _damped_step(here, 0.0)
    if decrement + here.eliminated <= max(tolerance, 1e-6) * (1.0 + here.cost):
        # a curved valley is approached ever more slowly: the step that remains is still a negligible one
        return Fit(state, inverse_spd(here.hessian), here.cost, iterations)
    raise ConvergenceError(Finding("sensor-fit-unsettled", {"iterations": iterations}))


def _damped_step(at: Normal, damping: float) -> tuple[Array, float]:
    """Step and its decrement g' (H + damping diag H)^-1 g, in units where diag H = 1."""
    scale = np.sqrt(np.maximum(np.diagonal(at.hessian), np.finfo(float).tiny))
    unit = at.hessian / np.outer(scale, scale)
    unit[np.diag_indices_from(unit)] += damping
    gradient = at.gradient / scale
    try:
        factor = np.linalg.cholesky(unit)
        half = np.linalg.solve(factor, gradient)
        step = -np.linalg.solve(factor.T, half)
        return step / scale, float(half @ half)
    except np.linalg.LinAlgError:
        step = -np.linalg.lstsq(unit, gradient, rcond=1e-13)[0]
        return step / scale, float(-gradient @ step)


def inverse_spd(matrix: Array) -> Array:
    """Symmetric inverse in scaled units; pseudo-inverse over directions the data do not see.

    Examples
    --------
    >>> inverse_spd(np.diag([4.0, 1e-12])).diagonal()
    array([2.5e-01, 1.0e+12])
    """
    scale = np.sqrt(np.maximum(np.diagonal(matrix), np.finfo(float).tiny))
    unit = matrix / np.outer(scale, scale)
    values, vectors = np.linalg.eigh((unit + unit.T) / 2.0)
    keep = values > values[-1] * 1e-14
    inverse = (vectors[:, keep] / values[keep]) @ vectors[:, keep].T
    return np.asarray(inverse / np.outer(scale, scale))
