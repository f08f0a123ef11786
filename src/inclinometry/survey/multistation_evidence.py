"""How large a run's errors really are: noise by restricted maximum likelihood, sizes of priors by their evidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Final

import numpy as np

from inclinometry.arrays import Array, Index

STATED: Final[Mapping[float, float]] = {1.0: 0.99545, 3.0: 0.004, 10.0: 0.0005, 30.0: 0.00005}
"""Scale of a prior's standard deviations -> its probability before the run, for a size that a model or a user states:
it is only left for a larger one, against odds. Where the run tells nothing the standard deviation grows by 6 %."""

GUESSED: Final[Mapping[float, float]] = {0.1: 0.15, 0.3: 0.35, 0.6: 0.2, 1.0: 0.2486,
                                         3.0: 0.05, 10.0: 0.0012, 30.0: 0.0002}  # fmt: skip
"""The same for a size that is only known not to be larger as a rule. Where the run tells nothing the standard deviation
grows by 5 %."""

KEPT: Final[Mapping[float, float]] = {1.0: 0.95, 3.0: 0.05}
"""The same for all sensors of a tool together: one tool in twenty is worse than its model or its certificate has it.
Where the run tells nothing the standard deviation grows by 18 %."""


def averaged_over_sizes(
    root: Array, normal: Array, right: Array, blocks: Sequence[tuple[Index, Mapping[float, float]]]
) -> tuple[Array, Array, Array]:
    """Posterior of x = root z averaged over the sizes of the priors of `blocks` of x, each by its evidence.

    Estimate (p,), covariance (p, p), and the scale of each block, root of the mean square. root root' is the prior
    covariance P, normal = J' V^-1 J and right = J' V^-1 y of y = J x + noise. log p(y | P) = (right' C right + log|C| -
    log|P|) / 2 up to a constant, C = (normal + P^-1)^-1: -chi^2/2 and half the logarithm of posterior over prior volume
    (MacKay, "Bayesian interpolation", Neural Computation 4 (1992) 415).
    """
    grid = np.array(list(product(*(beliefs for _, beliefs in blocks))))
    belief = np.prod(list(product(*(beliefs.values() for _, beliefs in blocks))), axis=1)
    # two rarities at once are less likely than what no size explains
    grid, belief = grid[belief > 1e-6], belief[belief > 1e-6]
    stretch = np.ones((len(grid), len(root)))
    for column, (rows, _) in enumerate(blocks):
        stretch[:, rows] = grid[:, column, None]
    roots = stretch[:, :, None] * root
    turned = np.swapaxes(roots, 1, 2)
    # bordered by the right side b, so that the factor L of the Hessian has L^-1 b as its last row
    size = root.shape[1]
    bordered = np.empty((len(grid), size + 1, size + 1))
    bordered[:, :size, :size] = turned @ normal @ roots + np.eye(size)
    bordered[:, size, :size] = projected = turned @ right
    bordered[:, size, size] = 1.0 + np.sum(projected**2, axis=1)
    factor = np.linalg.cholesky(bordered)
    factor, half = factor[:, :size, :size], factor[:, size, :size]
    volume = np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)
    evidence = 0.5 * np.sum(half**2, axis=1) - volume + np.log(belief)
    weight = np.exp(evidence - evidence.max())
    likely = weight > 1e-9 * weight.sum()
    grid, weight = grid[likely], weight[likely] / weight[likely].sum()
    # columns of C = half' half
    half_spread = np.linalg.solve(factor[likely], turned[likely])
    x = (half[likely, None, :] @ half_spread)[:, 0]
    mean = weight @ x
    within = np.einsum("k,kpr->pr", weight, np.swapaxes(half_spread, 1, 2) @ half_spread)
    covariance = within + (weight[:, None] * (x - mean)).T @ (x - mean)
    return mean, 0.5 * (covariance + covariance.T), np.sqrt(weight @ grid**2)


def noise_factors(
    rows: Array, noise: Array, common: Array, residual: Array, jacobian: Array, start: Array, known: float
) -> Array:
    """Factors (2,) on the noise variances of accelerometers and magnetometers by restricted maximum likelihood.

    With S = V + J J' the likelihood is stationary where y' S^-1 V_k S^-1 y = tr(S^-1 V_k) for each part V_k of V = sum
    of f_k V_k; f_k grows by the ratio of the two (Harville, J. Am. Stat. Assoc. 72 (1977) 320). `common` is scaled as
    the magnetometers' noise; `known` is the number of residuals the stated noise is worth: an inverse gamma prior about
    1.
    """
    parts = []
    for kind in (slice(0, 3), slice(3, 6)):
        mine = rows[:, :, kind]
        parts.append(mine @ noise[:, kind, kind] @ np.swapaxes(mine, 1, 2))
    parts[1] = parts[1] + common
    found, size = np.array(start, dtype=np.float64), jacobian.shape[2]
    for _ in range(2):  # the two hardly share a residual, and the caller comes again with a better linearisation
        inverse = np.linalg.inv(found[0] * parts[0] + found[1] * parts[1])
        weighted = inverse @ jacobian
        flat = weighted.reshape(-1, size)
        covariance = np.linalg.inv(jacobian.reshape(-1, size).T @ flat + np.eye(size))
        y = inverse @ residual[:, :, None]
        y = y - (weighted @ (covariance @ (flat.T @ residual.ravel())))[:, :, None]
        for k, part in enumerate(parts):
            squares = np.sum(y * (part @ y))
            seen = flat.T @ (part @ weighted).reshape(-1, size)
            trace = np.sum(inverse * part) - np.sum(covariance * seen)
            found[k] *= (squares + known / found[k] ** 2) / (trace + known / found[k])
        # beyond three times the stated noise it is no noise, and the parameters are to show it
        found = np.minimum(found, 9.0)
    return found
