"""Propagation of distributions by Monte Carlo (GUM Supplement 1), and the check of linear propagation against it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array, finite, frozen
from inclinometry.core.errors import InputError
from inclinometry.uncertainty.coverage import coverage_factor
from inclinometry.uncertainty.propagation import covariance_matrix, standard_deviations

Sampler = Callable[[np.random.Generator, int], Array]


@dataclass(frozen=True, eq=False)
class MonteCarlo:
    """Distribution of the m outputs.

    Attributes
    ----------
    mean : (m,) ndarray
    covariance : (m, m) ndarray
        Of the outputs (not of the mean), from `count` draws: relative standard error of a variance sqrt(2/count) for
        outputs that are nearly normal.
    low, high : (m,) ndarray
        Shortest interval of each output that holds `probability`.
    probability : float
    count, seed : int
        Draws, and what repeats them.
    """

    mean: Array
    covariance: Array
    low: Array
    high: Array
    probability: float
    count: int
    seed: int

    @property
    def standard_uncertainty(self) -> Array:
        """Standard deviation (m,) of each output."""
        return standard_deviations(self.covariance)


@dataclass(frozen=True, eq=False)
class LinearCheck:
    """Whether linear propagation gives the same interval as Monte Carlo, per output (m,).

    Attributes
    ----------
    low_difference, high_difference : (m,) ndarray
        Distances between the ends of the two intervals.
    tolerance : (m,) ndarray
        Half a unit in the last of the digits asked for.
    ratio : (m,) ndarray
        Linear standard uncertainty over that of Monte Carlo.
    valid : (m,) ndarray of bool
        Whether both differences are within the tolerance.
    """

    low_difference: Array
    high_difference: Array
    tolerance: Array
    ratio: Array
    valid: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


def normal_sampler(mean: ArrayLike, covariance: ArrayLike) -> Sampler:
    """Draws of normal inputs, for `monte_carlo`.

    Parameters
    ----------
    mean : (n,) array_like
    covariance : (n, n) array_like
        Positive semidefinite; directions of no variance are allowed.

    Raises
    ------
    InputError
        Shapes that do not go together, a matrix that is no covariance.

    Examples
    --------
    >>> normal_sampler([1.0, 2.0], np.zeros((2, 2)))(np.random.default_rng(1), 2)
    array([[1., 2.],
           [1., 2.]])
    """
    centre = finite(mean, "mean", (None,))
    matrix = covariance_matrix(covariance)
    if matrix.shape != (centre.size, centre.size):
        raise InputError(f"mean {centre.shape} and covariance {matrix.shape} do not go together")
    # scaled to unit variances, so that inputs of very different units do not lose digits to each other
    sigma = standard_deviations(matrix)
    scale = np.where(sigma > 0.0, sigma, 1.0)
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    factor = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))

    def draw(generator: np.random.Generator, count: int) -> Array:
        return np.asarray(centre + generator.standard_normal((count, centre.size)) @ factor.T)

    return draw


def monte_carlo(
    function: Callable[[Array], Array],
    sampler: Sampler,
    *,
    count: int,
    seed: int,
    probability: float = 0.95,
    block: int = 16384,
) -> MonteCarlo:
    """Distribution of f(x) for random inputs x.

    Parameters
    ----------
    function : callable
        (k, n) inputs -> (k, m) or (k,) outputs. An angle that may wrap must be returned as its difference from a
        nominal value, wrapped to [-pi, pi).
    sampler : callable
        (generator, k) -> (k, n); see `normal_sampler`.
    count : int
        Draws, at least 1000; 1e6 give 95 % ends to about 0.3 % of u.
    seed : int
        Of the random generator: the same seed gives the same result on the same machine.
    probability : float
        Of the coverage interval.
    block : int
        Draws evaluated at a time, so that memory holds only the outputs.

    Raises
    ------
    InputError
        Too few draws, a probability outside (0, 1), a function that returns other than k rows or values not finite.

    Notes
    -----
    JCGM 101:2008, clauses 7.3 to 7.7; shortest interval after 7.7.2 note 4.

    Examples
    --------
    >>> found = monte_carlo(lambda x: x[:, 0] + x[:, 1], normal_sampler([1, 2], np.eye(2)), count=20000, seed=1)
    >>> bool(abs(found.mean[0] - 3.0) < 0.05), bool(abs(found.covariance[0, 0] - 2.0) < 0.1)
    (True, True)
    """
    if count < 1000 or block < 1:
        raise InputError(f"count is {count}, block {block}; at least 1000 draws in blocks of 1 or more")
    if not 0.0 < probability < 1.0:
        raise InputError(f"probability is {probability}; it must lie between 0 and 1, e.g. 0.95")
    generator = np.random.default_rng(seed)
    blocks = []
    for start in range(0, count, block):
        size = min(block, count - start)
        outputs = finite(function(sampler(generator, size)), "output")
        if outputs.ndim not in (1, 2) or len(outputs) != size:
            raise InputError(f"the function returned shape {outputs.shape} for {size} draws; expected ({size}, m)")
        blocks.append(outputs.reshape(size, -1))
    samples = np.concatenate(blocks)
    mean = samples.mean(axis=0)
    low, high = shortest_interval(samples, probability)
    centred = samples - mean
    covariance = centred.T @ centred / (count - 1)
    return MonteCarlo(frozen(mean), frozen(covariance), frozen(low), frozen(high), probability, count, seed)


def shortest_interval(samples: ArrayLike, probability: float) -> tuple[Array, Array]:
    """Ends (m,) of the shortest intervals that hold the given part of the samples (k, m).

    Examples
    --------
    >>> low, high = shortest_interval(np.array([[0.0], [1.0], [1.1], [1.2], [9.0]]), 0.5)
    >>> float(low[0]), float(high[0])
    (1.0, 1.2)
    """
    ordered = np.sort(finite(samples, "samples", (None, None)), axis=0)
    count = len(ordered)
    # the samples that lie inside, ends included, reach across this many gaps
    gaps = min(max(int(np.ceil(probability * count)) - 1, 1), count - 1)
    lengths = ordered[gaps:] - ordered[: count - gaps]
    start = np.argmin(lengths, axis=0)
    columns = np.arange(ordered.shape[1])
    return ordered[start, columns], ordered[start + gaps, columns]


def numerical_tolerance(uncertainty: ArrayLike, digits: int = 2) -> Array:
    """Half a unit in the last of `digits` significant digits of each uncertainty; JCGM 101:2008, clause 7.9.2.

    Examples
    --------
    >>> numerical_tolerance([0.35, 0.098], digits=1)
    array([0.05 , 0.005])
    """
    u = finite(uncertainty, "uncertainty")
    if not (u > 0.0).all() or digits < 1:
        raise InputError(f"uncertainty is {u.min():g}, digits {digits}; both must be positive")
    exponent = np.floor(np.log10(u)) - (digits - 1)
    return np.asarray(0.5 * 10.0**exponent)


def check_linear(result: MonteCarlo, estimate: ArrayLike, covariance: ArrayLike, *, digits: int = 1) -> LinearCheck:
    """Compare y +- k u of linear propagation with the Monte-Carlo interval.

    Parameters
    ----------
    result : MonteCarlo
    estimate : (m,) array_like
        f at the best inputs.
    covariance : (m, m) array_like
        From `propagate`.
    digits : int
        Significant digits of u that must agree; 1 or 2. Two digits need some 1e6 draws.

    Raises
    ------
    InputError
        Shapes that do not go together, a variance that is not positive.

    Notes
    -----
    JCGM 101:2008, clause 8.1, equations (17) and (18), with the normal k for the result's probability.

    Examples
    --------
    >>> found = monte_carlo(lambda x: 2.0 * x, normal_sampler([0.0], [[1.0]]), count=100000, seed=1)
    >>> bool(check_linear(found, [0.0], [[4.0]]).valid[0])
    True
    """
    size = result.mean.size
    centre = finite(estimate, "estimate", (size,))
    u = standard_deviations(finite(covariance, "covariance", (size, size)))
    tolerance = numerical_tolerance(u, digits)
    reach = coverage_factor(result.probability) * u
    low, high = np.abs(centre - reach - result.low), np.abs(centre + reach - result.high)
    ratio = u / result.standard_uncertainty
    return LinearCheck(
        frozen(low), frozen(high), frozen(tolerance), frozen(ratio), (low <= tolerance) & (high <= tolerance)
    )
