"""Readings off the stand: the tool in attitudes that no dial reads; |g|, |b| and g.b are the same in all.

    |N_a^-1 (y_a - U_a)| = 1,   |N_m^-1 (y_m - U_m)| = l,   their scalar product = l sin(dip)

of each reading; l and the dip there are free, since the stand's own field is not. They determine all of a tool but the
turn of its axes, and see the magnetism of a cradle, of a chuck and of iron, which no plan on the stand does. How far
attitude and field scatter there is estimated, never taken from the sensors' noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement, product
from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.constants import VECTORS

GRID: Final = (np.array([1.0, 2.0, 5.0, 15.0]) * 3e-4, np.array([0.5, 1.0, 2.0, 4.0, 8.0]) * 6e-4)
"""Scatters that are tried, of the accelerometer and of the magnetometer, in units of their fields."""
_TAIL: Final = 5.0
"""Degrees of freedom of a reading's scatter: one that is far off hardly counts."""


@dataclass(frozen=True, eq=False)
class OffStand:
    """Readings off the stand as a joint model has them.

    signals, powers : kind -> (n, m); (n, P) of temperature. scatter : (2,) sd of a component of the accelerometer's
    field, the magnetometer's, in units of these. weight : (n,) of each reading. tried : the scatters that may be true.
    """

    signals: Mapping[str, Array]
    powers: Array
    scatter: Array
    weight: Array
    tried: Sequence[Array] = GRID

    def linear(self, coefficients: Mapping[str, Array], columns: Mapping[str, slice], width: int) -> OffLinear:
        """The readings at a state of the tool, linearised."""
        fields, slopes = dict[str, Array](), dict[str, Array]()
        for kind in (k for k in VECTORS if k in self.signals):
            values = np.tensordot(self.powers, coefficients[kind], axes=1)
            inverse = np.linalg.pinv(values[..., :3])
            field = (inverse @ (self.signals[kind] - values[..., 3])[..., None])[..., 0]
            regressor = self.powers[:, :, None] * np.append(field, np.full((len(field), 1), 1.0), axis=1)[:, None, :]
            slope = np.zeros((len(field), 3, width))
            # N df = dy - dN f - dU
            own = -inverse[:, :, None, :, None] * regressor[:, None, :, None, :]
            slope[..., columns[kind]] = own.reshape(*slope.shape[:2], -1)
            fields[kind], slopes[kind] = field, slope
        off, rows, along = list[Array](), list[Array](), list[Array]()
        pairs = list(combinations_with_replacement(fields, 2))
        for pair in pairs:
            share = 0.5 if pair[0] == pair[1] else 1.0
            moved = np.zeros((len(self.powers), len(fields), 3))
            for kind, other in (pair, pair[::-1]):
                moved[:, list(fields).index(kind)] += share * fields[other]
            off.append(share * (np.sum(fields[pair[0]] * fields[pair[1]], axis=1) - 1.0))
            rows.append(sum(np.einsum("ki,kip->kp", moved[:, k], slope) for k, slope in enumerate(slopes.values())))
            along.append(moved)
        unknown = [place for place, pair in enumerate(pairs) if "magnetometer" in pair]
        free = np.broadcast_to(np.eye(len(pairs))[:, unknown], (len(self.powers), len(pairs), len(unknown)))
        sizes = self.scatter[[VECTORS.index(kind) for kind in fields]]
        return OffLinear(np.stack(off, axis=1), np.stack(rows, axis=1), free, np.stack(along, axis=1), sizes)


class OffLinear(NamedTuple):
    """Differences (n, h) of |g|^2/2, g.b, |b|^2/2 from their values, and what they follow."""

    off: Array
    rows: Array  #: (n, h, p) by parameters
    free: Array  #: (n, h, f) by g.b and |b|^2/2 there
    along: Array  #: (n, h, kinds, 3) by the fields seen
    scatter: Array  #: (kinds,)

    def known(self, weight: Array) -> tuple[Array, Array]:
        """White differences and rows (n h, p) without what |b| and the dip there explain."""
        white = np.linalg.inv(np.linalg.cholesky(self.spread(self.scatter))) * np.sqrt(weight)[:, None, None]
        whole = (white @ np.concatenate([self.off[..., None], self.rows], axis=2)).reshape(self.off.size, -1)
        space = np.linalg.qr((white @ self.free).reshape(self.off.size, -1))[0]
        whole = whole - space @ (space.T @ whole)
        return whole[:, 0], whole[:, 1:]

    def spread(self, scatter: Array) -> Array:
        """Covariance (n, h, h) of a reading."""
        return np.asarray(np.einsum("khci,c,kjci->khj", self.along, scatter**2, self.along))

    def misfit(self, scatter: Array, covariance: Array, estimate: Array) -> tuple[float, int]:
        """Chi-square of the readings at a scatter, with the stand's own result, and its degrees of freedom."""
        alone = self._replace(scatter=scatter)
        off, rows = alone.known(np.full(len(self.off), 1.0))
        left = off + rows @ estimate
        own = np.linalg.solve(np.eye(len(off)) + rows @ covariance @ rows.T, left)
        return float(left @ own), len(off) - self.free.shape[2]

    def solve(self, scatter: Array, covariance: Array, estimate: Array) -> Solution:
        """The solution at a scatter together with the stand's own result (estimate, covariance).

        Restricted likelihood of r = off + rows x + free z + e, z flat, e of Student's distribution: its weights by
        iteration, what is not known of x in them.
        """
        count, size = self.off.shape
        rows, free = (one.reshape(count * size, -1) for one in (self.rows, self.free))
        spread = self.spread(scatter)
        carried = covariance @ rows.T
        inner, r = rows @ carried, self.off.ravel() + rows @ estimate
        weight = np.full(count, 1.0)
        place = np.arange(count)
        apart = np.zeros((count, size, count, size))
        apart[place, :, place] = spread
        whole = apart.reshape(count * size, -1)
        for _ in range(8):
            own = whole / np.repeat(weight, size)
            marginal = np.linalg.inv(inner + own)
            seen = marginal @ free
            normal = free.T @ seen
            projector = marginal - seen @ np.linalg.solve(normal, seen.T)
            left = own @ projector @ r
            open_ = (own - own @ projector @ own).reshape(count, size, count, size)[place, :, place]
            second = left.reshape(count, size, 1) * left.reshape(count, 1, size) + open_
            square = np.trace(np.linalg.solve(spread, second), axis1=1, axis2=2)
            new = (_TAIL + size) / (_TAIL + square)
            settled = np.abs(np.log(new / weight)).max() < 0.01
            weight = new
            if settled:
                break
        value = np.linalg.slogdet(inner + own)[1] + np.linalg.slogdet(normal)[1] + r @ projector @ r
        value += np.sum((_TAIL + size) * np.log1p(square / _TAIL) - weight * square + size * np.log(weight))
        found = estimate - carried @ projector @ r
        return Solution(float(value), found, covariance - carried @ projector @ carried.T, weight)


class Solution(NamedTuple):
    """What readings on and off the stand say at one scatter."""

    value: float  #: twice the negative logarithm of the likelihood
    estimate: Array
    covariance: Array
    weight: Array


class Average(NamedTuple):
    """The mean over scatters by their likelihood."""

    scatter: Array  #: (2,) square root of the mean square
    weight: Array  #: (n,) of each reading
    estimate: Array
    covariance: Array


def average(linear: OffLinear, covariance: Array, estimate: Array, grid: Sequence[Array]) -> Average:
    """The solutions averaged over a grid of scatters, each by its likelihood."""
    tried = [np.array(one) for one in product(*grid)]
    found = [linear.solve(one, covariance, estimate) for one in tried]
    values = np.array([one.value for one in found])
    share = np.exp(-0.5 * (values - values.min()))
    share /= share.sum()
    estimates = np.array([one.estimate for one in found])
    mean = share @ estimates
    off = estimates - mean
    within = np.tensordot(share, [one.covariance for one in found], axes=1)
    return Average(
        np.sqrt(share @ np.square(tried)),
        share @ [one.weight for one in found],
        mean,
        within + (off.T * share) @ off,
    )
