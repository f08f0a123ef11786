"""Compiled minimum curvature: depth, inclination and azimuth of many stations to positions. No checks.

Importing this module imports numba and compiles (or loads from the cache), so import it where a kernel is called.

A block of stations at a time: directions and displacements in loops without a branch, which become vector
instructions, then the running sum, which cannot. The sum carries its rounding along (Neumaier), so that a million
stations end as exactly as a hundred.
"""

from __future__ import annotations

import numpy as np

from inclinometry.arrays import Array
from inclinometry.compiled import MATRIX_OUT, VECTOR, VECTOR_OUT, _half_turn, compiled, inlined, math, types


@inlined
def sine_cosine(x: float) -> tuple[float, float]:
    """Sine and cosine of an angle of a few turns, without a branch."""
    # pi/2 in three parts; the first two have 33 bits, so that small multiples of them are exact
    k = math.floor(x * (2.0 / math.pi) + 0.5)
    y = ((x - k * 1.5707963267341256) - k * 6.077100506303966e-11) - k * 2.0222662487959506e-21
    s = y * y
    # sin(y) = y + y^3 S(y^2) and cos(y) = 1 - y^2/2 + y^4 C(y^2) to pi/4, interpolated at Chebyshev nodes in 60 digits;
    # errors 1.8e-17 of y and 8.9e-19
    p = 1.591812929460525e-10 * s - 2.5051131844999998e-08
    p = p * s + 2.755731610255242e-06
    p = p * s - 0.00019841269836758574
    p = p * s + 0.008333333333330948
    p = p * s - 0.16666666666666666
    sine = y * s * p + y
    q = -1.1382632425358213e-11 * s + 2.087614626840093e-09
    q = q * s - 2.755731727172978e-07
    q = q * s + 2.480158729876569e-05
    q = q * s - 0.0013888888888887398
    q = q * s + 0.041666666666666664
    cosine = q * s * s + (1.0 - 0.5 * s)
    quarter = k - 4.0 * math.floor(0.25 * k)  # 0, 1, 2 or 3
    odd = quarter == 1.0 or quarter == 3.0
    first = cosine if odd else sine
    second = sine if odd else cosine
    first = -first if quarter >= 2.0 else first
    second = -second if quarter == 1.0 or quarter == 2.0 else second
    return first, second


@inlined
def _add(total: float, lost: float, part: float) -> tuple[float, float]:
    """Sum so far and what rounding has taken from it, after another part."""
    new = total + part
    taken = (total - new) + part if abs(total) >= abs(part) else (part - new) + total
    return new, lost + taken


@compiled(types.void(VECTOR, VECTOR, MATRIX_OUT))
def _directions(inclination: Array, azimuth: Array, t: Array) -> None:
    """Rows north, east, down of the unit vectors along the hole."""
    for i in range(inclination.size):
        si, ci = sine_cosine(inclination[i])
        sa, ca = sine_cosine(azimuth[i])
        t[0, i] = si * ca
        t[1, i] = si * sa
        t[2, i] = ci


@compiled(types.void(VECTOR, MATRIX_OUT, MATRIX_OUT, VECTOR_OUT, VECTOR_OUT))
def _displacements(md: Array, t: Array, step: Array, dogleg: Array, severity: Array) -> None:
    """Rows north, east, down of the chords of the arcs, and the angles the arcs span."""
    for i in range(dogleg.size):
        pn, pe, pv = t[0, i] + t[0, i + 1], t[1, i] + t[1, i + 1], t[2, i] + t[2, i + 1]
        qn, qe, qv = t[0, i + 1] - t[0, i], t[1, i + 1] - t[1, i], t[2, i + 1] - t[2, i]
        p, q = math.sqrt(pn * pn + pe * pe + pv * pv), math.sqrt(qn * qn + qe * qe + qv * qv)
        half = _half_turn(q, p)
        length = md[i + 1] - md[i]
        straight = q == 0.0
        # tan(half)/half from q, p and an arctangent of them: nothing cancels, however small the angle
        ratio = (1.0 if straight else q) / (1.0 if straight else p * half)
        scale = 0.5 * length * ratio
        step[0, i], step[1, i], step[2, i] = scale * pn, scale * pe, scale * pv
        dogleg[i] = 2.0 * half
        severity[i] = 2.0 * half / length


@compiled(types.void(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR_OUT, VECTOR_OUT, VECTOR_OUT, VECTOR_OUT, VECTOR_OUT))
def minimum_curvature(
    md: Array,
    inclination: Array,
    azimuth: Array,
    start: Array,
    north: Array,
    east: Array,
    tvd: Array,
    dogleg: Array,
    severity: Array,
) -> None:
    """Positions (n,) of stations, dogleg (n - 1,) and its severity; NaN follows a dogleg of half a turn."""
    block = 256  # intervals; seven rows of work stay in the first-level cache
    t, step = np.empty((3, block + 1)), np.empty((3, block))
    n, e, v = 0.0, 0.0, 0.0
    dn, de, dv = 0.0, 0.0, 0.0
    n0, e0, v0 = start[0], start[1], start[2]
    north[0], east[0], tvd[0] = n0, e0, v0
    for first in range(0, dogleg.size, block):
        stop = min(first + block, dogleg.size)
        _directions(inclination[first : stop + 1], azimuth[first : stop + 1], t)
        _displacements(md[first : stop + 1], t, step, dogleg[first:stop], severity[first:stop])
        for i in range(stop - first):
            n, dn = _add(n, dn, step[0, i])
            e, de = _add(e, de, step[1, i])
            v, dv = _add(v, dv, step[2, i])
            north[first + i + 1] = n0 + (n + dn)
            east[first + i + 1] = e0 + (e + de)
            tvd[first + i + 1] = v0 + (v + dv)
