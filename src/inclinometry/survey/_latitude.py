"""Misfit of rates and gravity over latitude, azimuth and scale eliminated at each station; no checks in here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from inclinometry.core.arrays import Array, Index, Mask

_AZIMUTHS = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
_SIDES = np.radians([-1.7, 0.0, 1.7])
_SHRINKING = np.radians([1.7, 0.85, 0.42, 0.2, 0.1, 0.05, 0.02, 0.005, 0.0005])
_GRID = np.radians(np.arange(-90.0, 90.1, 2.0))
_MOST = 500  # stations that the coarse search over latitude looks at
_SAME = 9.0  # misfits closer than three standard deviations squared: either latitude may be the true one


class Projections(NamedTuple):
    """Products of the reading and of three unit vectors under the weight of the reading, each (n,).

    y: reading over the Earth rate; d: down; p, q: two horizontal directions. Where the azimuth counts from does not
    matter because it is eliminated: nothing here has a pole.
    """

    yy: Array
    yp: Array
    yq: Array
    yd: Array
    pp: Array
    pq: Array
    qq: Array
    pd: Array
    qd: Array
    dd: Array


@dataclass(frozen=True, eq=False)
class Misfit:
    """Weighted squared residuals of a run as a function of latitude.

    prior : 1/variance (n,) of the relative scale of each station; infinite where it is known.
    freedom : degrees of freedom at the best latitude.
    """

    products: Projections
    prior: Array
    freedom: int

    def at(self, latitude: float, *, roughly: bool = False) -> tuple[Array, Array]:
        """Misfit (n,) at the best azimuths and those azimuths (n,), rad from p to q.

        Near K = 0 two valleys lie closer together than the grid is wide. Stations that do not fit are therefore looked
        at from both sides of their valleys, unless `roughly` will do.
        """
        lowest, azimuth = self._descend(self._valleys(latitude), np.radians([2.5, 0.5, 0.05, 0.005, 0.0005]), latitude)
        poor = np.flatnonzero(lowest > _SAME)
        if not roughly and poor.size:
            some = self._rows(poor)
            starts = np.concatenate([some._valleys(latitude) + side for side in _SIDES])
            cost, there = some._descend(starts, _SHRINKING, latitude)
            better = cost < lowest[poor]
            lowest[poor[better]], azimuth[poor[better]] = cost[better], there[better]
        return lowest, azimuth

    def _descend(self, azimuth: Array, steps: Array, latitude: float) -> tuple[Array, Array]:
        """Least misfit (n,) and its azimuth (n,) from several starts (m, n)."""
        lowest = self.cost(latitude, azimuth)[0]
        for step in steps:
            before = self.cost(latitude, azimuth - step)[0]
            after = self.cost(latitude, azimuth + step)[0]
            bend = before - 2.0 * lowest + after
            move = np.where(bend > 0.0, 0.5 * (before - after) / np.where(bend > 0.0, bend, 1.0), 0.0)
            trial = azimuth + step * np.clip(move, -1.0, 1.0)
            centre = azimuth
            for there, cost in (
                (trial, self.cost(latitude, trial)[0]),
                (centre - step, before),
                (centre + step, after),
            ):
                azimuth, lowest = np.where(cost < lowest, there, azimuth), np.minimum(cost, lowest)
        row = lowest.argmin(axis=0)[None]
        return np.take_along_axis(lowest, row, axis=0)[0], np.take_along_axis(azimuth, row, axis=0)[0]

    def _rows(self, rows: Index) -> Misfit:
        return Misfit(Projections(*(x[rows] for x in self.products)), self.prior[rows], self.freedom)

    def _valleys(self, latitude: float) -> Array:
        """Azimuths (3, n) of the grid where the misfit is least among its neighbours, the lowest three.

        With little noise the grid's lowest point need not lie in the valley whose bottom is lowest.
        """
        found = np.empty((3, len(self.prior)))
        for rows in np.array_split(np.arange(len(self.prior)), 1 + len(self.prior) // 2000):
            cost = self._rows(rows).cost(latitude, _AZIMUTHS[:, None])[0]
            valley = (cost <= np.roll(cost, 1, axis=0)) & (cost <= np.roll(cost, -1, axis=0))
            order = np.argsort(np.where(valley, cost, np.inf), axis=0)[:3]
            found[:, rows] = _AZIMUTHS[order]
        return found

    def total(self, latitude: float, *, roughly: bool = False) -> float:
        """Misfit of the run."""
        return float(self.at(latitude, roughly=roughly)[0].sum())

    def cost(self, latitude: float, azimuth: Array) -> tuple[Array, Array]:
        """Misfit (..., n) and the relative scale (..., n) that is best with it, at azimuths (..., n)."""
        a, c, s = self.products, np.cos(latitude), np.sin(latitude)
        u, v = c * np.cos(azimuth), c * np.sin(azimuth)
        ym = u * a.yp + v * a.yq - s * a.yd
        mm = u * u * a.pp + v * v * a.qq + s * s * a.dd + 2.0 * (u * v * a.pq - s * (u * a.pd + v * a.qd))
        known = np.isinf(self.prior)
        prior = np.where(known, 1.0, self.prior)
        k = np.where(known, 1.0, (ym + prior) / (mm + prior))
        return a.yy - 2.0 * k * ym + k * k * mm + np.where(known, 0.0, prior) * (k - 1.0) ** 2, k

    def best(self, stated: float) -> tuple[float, float]:
        """Latitude of least misfit and that misfit; of several that fit as well the one nearest to `stated`."""
        from scipy.optimize import minimize_scalar

        coarse = self.some(_MOST)
        scan = np.array([coarse.total(float(x), roughly=True) for x in _GRID])
        padded = np.concatenate([[np.inf], scan, [np.inf]])
        valleys = np.flatnonzero((scan <= padded[:-2]) & (scan <= padded[2:]))
        found = []
        for place in valleys[np.argsort(scan[valleys])][:4]:
            low, high = _GRID[max(place - 1, 0)], _GRID[min(place + 1, len(_GRID) - 1)]
            fit = minimize_scalar(self.total, bounds=(low, high), method="bounded", options={"xatol": 1e-9})
            found.append((float(fit.x), float(fit.fun)))
        least = min(cost for _, cost in found)
        allowed = _SAME * max(1.0, least / max(self.freedom, 1))
        return min((x for x in found if x[1] <= least + allowed), key=lambda x: abs(x[0] - stated))

    def some(self, most: int) -> Misfit:
        """The same with at most so many stations, spread over the run."""
        size = len(self.prior)
        if size <= most:
            return self
        return self._rows(np.linspace(0, size - 1, most).astype(int))

    def sd(self, latitude: float, common: Array) -> float:
        """Standard uncertainty of the best latitude, rad.

        From the Fisher information with azimuth and scale eliminated, plus the shift by `common` (n,), the relative
        standard uncertainty of the scale, as if it were the same error at every station: a tool's scale factor is.
        """
        azimuth = self.at(latitude)[1]
        k = self.cost(latitude, azimuth)[1]
        c, s = np.cos(latitude), np.sin(latitude)
        u, v = np.cos(azimuth), np.sin(azimuth)
        zero = np.zeros_like(u)
        by_latitude = k * np.stack([-s * u, -s * v, zero - c])
        by_azimuth = k * np.stack([-c * v, c * u, zero])
        by_scale = np.stack([c * u, c * v, zero - s])
        turn = self._dot(by_azimuth, by_azimuth)
        turn = np.where(turn > 0.0, turn, np.inf)

        def seen(one: Array, other: Array) -> Array:
            return np.asarray(self._dot(one, other) - self._dot(one, by_azimuth) * self._dot(other, by_azimuth) / turn)

        mixed, scale = seen(by_latitude, by_scale), seen(by_scale, by_scale)
        known = np.isinf(self.prior)
        prior = np.where(known, 1.0, self.prior)
        share = np.where(known, 0.0, 1.0 / np.maximum(scale + prior, np.finfo(float).tiny))
        information = float((seen(by_latitude, by_latitude) - mixed**2 * share).sum())
        if not information > 0.0:
            return float("inf")
        pull = np.where(known, mixed, mixed * prior * share)
        # an azimuth fitted to noise finds some horizontal rate where there is none: it matters at the poles only.
        # Half of this to first order (Rice distribution), all of it where noise is all there is
        bias = c * float(np.median(np.minimum(1.0 / turn, 1.0)))
        shift = (pull * common).sum() / information
        return float(np.sqrt(1.0 / information + shift**2 + bias**2))

    def _dot(self, one: Array, other: Array) -> Array:
        """Product (n,) under the weights of two vectors given by their parts (3, n) along p, q, d."""
        a = self.products
        rows = ((a.pp, a.pq, a.pd), (a.pq, a.qq, a.qd), (a.pd, a.qd, a.dd))
        return np.asarray(sum(one[i] * rows[i][j] * other[j] for i in range(3) for j in range(3)))


def horizontals(down: Array) -> tuple[Array, Array]:
    """Two unit vectors (n, 3) that make a right-handed triad with each `down` (n, 3)."""
    helper = np.eye(3)[np.argmin(np.abs(down), axis=1)]
    p = helper - np.sum(helper * down, axis=1)[:, None] * down
    p /= np.linalg.norm(p, axis=1)[:, None]
    return p, np.cross(down, p)


def misfit(rate: Array, down: Array, weight: Array, seen: Mask, prior: Array) -> Misfit:
    """The misfit of rates (n, 3) over the Earth rate; their weight (n, 3, 3) is nought where z is not `seen` (n,)."""
    p, q = horizontals(down)
    y = np.where(np.isnan(rate), 0.0, rate)

    def dot(a: Array, b: Array) -> Array:
        return np.asarray(np.einsum("ni,nij,nj->n", a, weight, b))

    pairs = ((y, y), (y, p), (y, q), (y, down), (p, p), (p, q), (q, q), (p, down), (q, down), (down, down))
    # one azimuth a station is unknown, and one latitude; the scale's prior counts as an observation
    freedom = int((1 + seen.astype(int)).sum()) - 1
    return Misfit(Projections(*(dot(a, b) for a, b in pairs)), prior, freedom)


def weights(covariance: Array, seen: Mask) -> Array:
    """Inverse (n, 3, 3) of each covariance; over x and y only, z nought, where z is not `seen`."""
    full = np.where(np.isnan(covariance), 0.0, covariance).copy()
    full[~seen, 2, :] = full[~seen, :, 2] = 0.0
    full[~seen, 2, 2] = 1.0
    inverse = np.asarray(np.linalg.inv(full))
    inverse[~seen, 2, :] = inverse[~seen, :, 2] = 0.0
    return inverse
