"""Compiled search for azimuth and scale factor of many stations. Arrays in and out, no checks.

Importing this module imports numba and compiles (or loads from the cache), so import it where a kernel is called.

The rates of a station, whitened, are h = k (e0 + e1 cos psi + e2 sin psi) + noise of unit variance; k = 1/scale has
the prior N(k0, 1/w). The cost of an azimuth, k at its best, is laid over a grid; its two lowest valleys are refined by
Newton's method on azimuth and k.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.compiled import MATRIX, MATRIX_OUT, VECTOR, VECTOR_OUT, compiled, inlined, math, types

GRID: Final = 64  # azimuths at which every cost is laid out; valleys are never narrower than 40 deg apart from twins
LEAST: Final = 1e-12  # information below which there is none
FLAT: Final = 0.5  # standard uncertainty, rad, beyond which the cost is called flat without looking at its shape
COLUMNS: Final = 14
CIRCLE: Final = 1440  # azimuths over which a posterior that is not Gaussian is summed

_TABLE = np.stack([np.cos(2.0 * np.pi * np.arange(GRID) / GRID), np.sin(2.0 * np.pi * np.arange(GRID) / GRID)])


@inlined
def _best_k(p: float, q: float, k0: float, w: float) -> float:
    """k that fits best at one azimuth: p = E.h, q = E.E; exactly k0 where that is known (w infinite)."""
    if w == math.inf:
        return k0
    k: float = (p + k0 * w) / (q + w) if q + w > 0.0 else k0
    return k if k > 0.0 else 0.0


@inlined
def _cost(h: Array, e: Array, c: float, s: float, k0: float, w: float) -> float:
    """Misfit of the rates and of k at an azimuth given by its cosine and sine."""
    x = e[0, 0] + e[1, 0] * c + e[2, 0] * s
    y = e[0, 1] + e[1, 1] * c + e[2, 1] * s
    z = e[0, 2] + e[1, 2] * c + e[2, 2] * s
    k = _best_k(x * h[0] + y * h[1] + z * h[2], x * x + y * y + z * z, k0, w)
    rx, ry, rz = h[0] - k * x, h[1] - k * y, h[2] - k * z
    miss: float = rx * rx + ry * ry + rz * rz
    if w != math.inf:
        miss += w * (k - k0) * (k - k0)
    return miss


@inlined
def _fisher(h: Array, e: Array, psi: float, k0: float, w: float, out: Array) -> None:
    """k, Fisher information (psi psi, psi k, k k), slope of the cost and second-order part of its curvature."""
    c, s = math.cos(psi), math.sin(psi)
    p, q, pp, pk, slope, bend, cross = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        model = e[0, i] + e[1, i] * c + e[2, i] * s
        p += model * h[i]
        q += model * model
    k = _best_k(p, q, k0, w)
    for i in range(3):
        model = e[0, i] + e[1, i] * c + e[2, i] * s
        turned = -e[1, i] * s + e[2, i] * c
        residual = h[i] - k * model
        pp += turned * turned
        pk += turned * model
        slope -= k * residual * turned
        bend += k * residual * (e[1, i] * c + e[2, i] * s)
        cross -= residual * turned
    out[0], out[1], out[2], out[3] = k, k * k * pp, k * pk, q + w
    out[4], out[5], out[6] = slope, bend, cross


@inlined
def _variance(fisher: Array, w: float) -> float:
    """Variance of azimuth by what `_fisher` found."""
    lost = 0.0 if w == math.inf else fisher[2] * fisher[2] / max(fisher[3], LEAST)
    variance: float = 1.0 / max(fisher[1] - lost, LEAST)
    return variance


@inlined
def _mass(fisher: Array, w: float) -> float:
    """Root of the variance of azimuth, times that of k in units of its prior's."""
    sharper: float = 1.0 if w == math.inf else math.sqrt(w / max(fisher[3], LEAST))
    return sharper * math.sqrt(_variance(fisher, w))


@inlined
def _refine(h: Array, e: Array, start: float, k0: float, w: float, out: Array) -> float:
    """Azimuth at the bottom of a valley; `out` is left as `_fisher` fills it there."""
    psi = start
    # at most; six are enough away from singular places
    for _ in range(40):
        _fisher(h, e, psi, k0, w, out)
        known = w == math.inf
        curvature = out[1] + out[5] - (0.0 if known else (out[2] + out[6]) ** 2 / out[3])
        steady = out[1] - (0.0 if known else out[2] * out[2] / out[3])
        if curvature <= 0.1 * steady:  # still outside the bowl: Gauss-Newton always goes down
            curvature = steady
        if not curvature > 0.0:
            break
        step = -out[4] / curvature
        step = min(max(step, -0.3), 0.3)
        psi += step
        if abs(step) < 4e-16 * (1.0 + abs(psi)):
            break
    _fisher(h, e, psi, k0, w, out)
    return psi


@inlined
def _whiten(rate: Array, cov: Array, inc: float, lat: float, h: Array, e: Array) -> None:
    """Whitened rates and model: rows of e are the constant, the cosine's and the sine's part."""
    ca, sa, ct, st = math.cos(lat), math.sin(lat), math.cos(inc), math.sin(inc)
    e[0, 0], e[0, 1], e[0, 2] = sa * st, 0.0, -sa * ct
    e[1, 0], e[1, 1], e[1, 2] = ca * ct, 0.0, ca * st
    e[2, 0], e[2, 1], e[2, 2] = 0.0, -ca, 0.0
    l00 = math.sqrt(cov[0])
    l10 = cov[1] / l00
    l11 = math.sqrt(cov[2] - l10 * l10)
    three = not math.isnan(rate[2])
    l20, l21, l22 = 0.0, 0.0, 1.0
    if three:
        l20 = cov[3] / l00
        l21 = (cov[4] - l20 * l10) / l11
        l22 = math.sqrt(cov[5] - l20 * l20 - l21 * l21)
    h[0] = rate[0] / l00
    h[1] = (rate[1] - l10 * h[0]) / l11
    h[2] = (rate[2] - l20 * h[0] - l21 * h[1]) / l22 if three else 0.0
    for row in range(3):
        e[row, 0] /= l00
        e[row, 1] = (e[row, 1] - l10 * e[row, 0]) / l11
        e[row, 2] = (e[row, 2] - l20 * e[row, 0] - l21 * e[row, 1]) / l22 if three else 0.0


@inlined
def _twin_starts(h: Array, e: Array, starts: Array) -> int:
    """Azimuths whose (unwhitened) direction of the cross-axis rates is the measured one: the closed form's two roots.

    (h0, h1) and the model are parallel there: c0 + c1 cos psi + c2 sin psi = 0. They keep apart two valleys that are
    nearer to each other than the grid is wide.
    """
    c0 = h[0] * e[0, 1] - h[1] * e[0, 0]
    c1 = h[0] * e[1, 1] - h[1] * e[1, 0]
    c2 = h[0] * e[2, 1] - h[1] * e[2, 0]
    size = math.sqrt(c1 * c1 + c2 * c2)
    if not size > 0.0:
        return 0
    middle = math.atan2(c2, c1)
    ratio = -c0 / size
    half = math.acos(min(max(ratio, -1.0), 1.0))
    starts[0], starts[1] = middle + half, middle - half
    return 2


@compiled(types.void(MATRIX, MATRIX, VECTOR, VECTOR, VECTOR, VECTOR, MATRIX_OUT))
def north(
    rate: Array, covariance: Array, inclination: Array, latitude: Array, k0: Array, weight: Array, out: Array
) -> None:
    """Azimuth and k of n stations: rate (n, 3) a, b, z (NaN: not measured) over the Earth rate, weight 1 / var k0.

    covariance (n, 6): aa ab bb az bz zz. out (n, 14): azimuth, k, their variances with the covariance between, cost;
    azimuth (NaN: none) and cost of the runner-up; cost at azimuth -/+ 2 standard uncertainties; mass; k, variance of
    azimuth and mass of the runner-up. Mass: integral of exp(-cost / 2) over azimuth and the prior of k, in units of
    sqrt(2 pi) exp(-cost at the bottom / 2).
    """
    table = _TABLE
    h, e, found, starts = np.empty(3), np.empty((3, 3)), np.empty(7), np.empty(4)
    lay = np.empty(GRID)
    for n in range(inclination.size):
        _whiten(rate[n], covariance[n], inclination[n], latitude[n], h, e)
        prior, w = k0[n], weight[n]
        for i in range(GRID):
            lay[i] = _cost(h, e, table[0, i], table[1, i], prior, w)
        count = _twin_starts(h, e, starts)
        best, best_cost, second, second_cost = 0.0, math.inf, math.nan, math.inf
        for i in range(GRID + count):
            if i < GRID:
                before, here, after = lay[i - 1], lay[i], lay[(i + 1) % GRID]
                if not (here < before and here <= after):
                    continue
                start = 2.0 * math.pi * i / GRID
            else:
                start = starts[i - GRID]
            psi = _refine(h, e, start, prior, w, found)
            cost = _cost(h, e, math.cos(psi), math.sin(psi), prior, w)
            same = abs(math.sin(0.5 * (psi - best))) < 1e-6
            if cost < best_cost:
                if not same and best_cost < math.inf:
                    second, second_cost = best, best_cost
                best, best_cost = psi, cost
            elif not same and cost < second_cost:
                second, second_cost = psi, cost
        if best_cost == math.inf:  # no valley at all, as where nothing was measured: all azimuths cost the same
            best_cost = lay[0]
        _fisher(h, e, best, prior, w, found)
        known = w == math.inf
        own = max(found[3], LEAST)
        variance = _variance(found, w)
        variance_k = 0.0
        covariance_k = 0.0
        if not known:
            # inverse of [[pp, pk], [pk, kk]] written so that nothing cancels
            covariance_k = -found[2] / own * variance
            variance_k = 1.0 / own - found[2] / own * covariance_k
        sd = min(math.sqrt(variance), FLAT)
        out[n, 0], out[n, 1] = best, found[0]
        out[n, 2], out[n, 3], out[n, 4] = variance, covariance_k, variance_k
        out[n, 5], out[n, 6], out[n, 7] = best_cost, second, second_cost
        for side in range(2):
            there = best + (2.0 * side - 1.0) * 2.0 * sd
            out[n, 8 + side] = _cost(h, e, math.cos(there), math.sin(there), prior, w)
        out[n, 10] = _mass(found, w)
        _fisher(h, e, second, prior, w, found)
        out[n, 11], out[n, 12], out[n, 13] = found[0], _variance(found, w), _mass(found, w)


@compiled(types.void(MATRIX, MATRIX, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR_OUT))
def spread(
    rate: Array,
    covariance: Array,
    inclination: Array,
    latitude: Array,
    k0: Array,
    weight: Array,
    azimuth: Array,
    out: Array,
) -> None:
    """Standard deviation (n,) of the azimuth about `azimuth` (n,) by the posterior of each station; stations as above.

    The sum over a circle that begins at `azimuth`, so that a narrow peak is met at its top; k is integrated out.
    """
    h, e, cost = np.empty(3), np.empty((3, 3)), np.empty(CIRCLE)
    for n in range(out.size):
        _whiten(rate[n], covariance[n], inclination[n], latitude[n], h, e)
        w, least = weight[n], math.inf
        for i in range(CIRCLE):
            psi = azimuth[n] + 2.0 * math.pi * i / CIRCLE
            cost[i] = _cost(h, e, math.cos(psi), math.sin(psi), k0[n], w)
            least = min(least, cost[i])
        total, square = 0.0, 0.0
        for i in range(CIRCLE):
            turn = 2.0 * math.pi * i / CIRCLE
            c, s = math.cos(azimuth[n] + turn), math.sin(azimuth[n] + turn)
            wide = 1.0
            if w != math.inf:
                wide = w
                for axis in range(3):
                    model = e[0, axis] + e[1, axis] * c + e[2, axis] * s
                    wide += model * model
            share = math.exp(-0.5 * (cost[i] - least)) / math.sqrt(wide)
            off = turn if turn <= math.pi else turn - 2.0 * math.pi
            total += share
            square += share * off * off
        out[n] = math.sqrt(square / total)
