"""Compiled loops of the bulk products: counts as they are stored in, degrees as they are stored out."""

from __future__ import annotations

from typing import Any

import numpy as np

from inclinometry.compiled import (
    COMPILED,
    COT_EIGHTH,
    MATRIX_OUT,
    VECTOR,
    calibrated,
    coefficients,
    compiled,
    inlined,
    math,
    types,
)

_INTS = types.Array(types.int32, 1, "C", readonly=True)
_FLOATS = types.Array(types.float32, 1, "C", readonly=True)
_TIMES = types.Array(types.int64, 1, "C", readonly=True)
_FLOATS_OUT = types.Array(types.float32, 1, "C")
_TIMES_OUT = types.Array(types.int64, 1, "C")
_INTS_OUT = types.Array(types.int32, 1, "C")


_f32 = types.float32 if COMPILED else np.float32
# atan(t) = t + t s P(s), s = t^2, on [0, tan(pi/8)]: least squares at Chebyshev nodes, relative error 3e-9
_Q0, _Q1, _Q2, _Q3, _Q4 = -0.33333332, 0.19999547, -0.14264117, 0.10745046, -0.06455211
_BLOCK = 512  # samples whose directions are kept between the two loops


@inlined
def _eighth(y: Any, x: Any) -> Any:
    """(base, rest) with atan2(y, x) = base + rest, deg, for y, x >= 0."""
    near = y * _f32(COT_EIGHTH) < x
    far = x * _f32(COT_EIGHTH) < y
    t = (y if near else (-x if far else y - x)) / (x if near else (y if far else y + x))
    s = t * t
    p = _f32(_Q4) * s + _f32(_Q3)
    p = p * s + _f32(_Q2)
    p = p * s + _f32(_Q1)
    p = p * s + _f32(_Q0)
    base = _f32(0.0) if near else (_f32(90.0) if far else _f32(45.0))
    return base, (t * s * p + t) * _f32(180.0 / math.pi)


@inlined
def _turn(y: Any, x: Any) -> Any:
    """atan2(y, x) in [0, 360) deg."""
    base, rest = _eighth(abs(y), abs(x))
    back, down = x < _f32(0.0), y < _f32(0.0)
    base = _f32(180.0) - base if back else base
    rest = -rest if back else rest
    base = _f32(360.0) - base if down else base
    rest = -rest if down else rest
    angle = base + rest
    return _f32(0.0) if angle >= _f32(360.0) else angle


@compiled(*(types.void(*(of,) * 6, VECTOR, *(_FLOATS_OUT,) * 6) for of in (_INTS, _FLOATS)))
def _directions(
    ux: Any, uy: Any, uz: Any, vx: Any, vy: Any, vz: Any, c: Any,
    sine: Any, cosine: Any, level: Any, down: Any, tool_sine: Any, tool_cosine: Any,
) -> None:  # fmt: skip
    """What the angles are the arctangents of, worked out in double precision; see `compiled._attitude`."""
    k = coefficients(c)
    for i in range(sine.size):
        gx, gy, gz, bx, by, bz = calibrated(ux[i], uy[i], uz[i], vx[i], vy[i], vz[i], k)
        square = gx * gx + gy * gy
        # exactly vertical the whole turn is called toolface
        vertical = square == 0.0
        hand = math.copysign(1.0, gz)
        sine[i] = (gx * by - gy * bx) * math.sqrt(square + gz * gz)
        cosine[i] = 1.0 if vertical else bz * square - gz * (gx * bx + gy * by)
        level[i] = math.sqrt(square)
        down[i] = gz
        tool_sine[i] = -hand * by if vertical else gy
        tool_cosine[i] = hand * bx if vertical else -gx


@compiled(types.void(*(_FLOATS_OUT,) * 9))
def _angles(
    sine: Any, cosine: Any, level: Any, down: Any, tool_sine: Any, tool_cosine: Any, inc: Any, azi: Any, tf: Any
) -> None:
    """Inclination, azimuth and toolface, deg; within a last bit of what double precision would round to."""
    for i in range(inc.size):
        a = _turn(level[i], down[i])
        b = _turn(sine[i], cosine[i])
        t = _turn(tool_sine[i], tool_cosine[i])
        invalid = (a + b + t) * _f32(0.0)  # 0 or NaN
        inc[i], azi[i], tf[i] = a + invalid, b + invalid, t + invalid


@compiled(*(types.void(*(of,) * 6, VECTOR, *(_FLOATS_OUT,) * 3) for of in (_INTS, _FLOATS)))
def _degrees(ux: Any, uy: Any, uz: Any, vx: Any, vy: Any, vz: Any, c: Any, inc: Any, azi: Any, tf: Any) -> None:
    """Angles in degrees of n samples; `c` as in `compiled`; all NaN where a channel is."""
    kept = np.empty((6, _BLOCK), dtype=np.float32)
    for a in range(0, inc.size, _BLOCK):
        b = min(a + _BLOCK, inc.size)
        m = b - a
        s, k, h, d = kept[0, :m], kept[1, :m], kept[2, :m], kept[3, :m]
        p, q = kept[4, :m], kept[5, :m]
        _directions(ux[a:b], uy[a:b], uz[a:b], vx[a:b], vy[a:b], vz[a:b], c, s, k, h, d, p, q)
        _angles(s, k, h, d, p, q, inc[a:b], azi[a:b], tf[a:b])


_TEN = types.UniTuple(types.float64, 10)


@compiled(
    *(_TEN(*(of,) * 6, *(_FLOATS,) * 3, *(types.float32,) * 3, VECTOR) for of in (_INTS, _FLOATS)),
    sums_in_any_order=True,
)
def _sums(
    ux: Any, uy: Any, uz: Any, vx: Any, vy: Any, vz: Any, inc: Any, azi: Any, tf: Any, a: Any, b: Any, t: Any, c: Any
) -> Any:
    """Of samples that count: their number, sums and squares of the angles from a, b, t, deg, and |g|^2, |b|^2, g.b."""
    k = coefficients(c)
    valid = sa = sb = st = qa = qb = qt = gg = bb = gb = 0.0
    for i in range(inc.size):
        counts = inc[i] == inc[i]
        da, db, dt = float(inc[i] - a), float(azi[i] - b), float(tf[i] - t)
        db = db - 360.0 if db > 180.0 else (db + 360.0 if db < -180.0 else db)
        dt = dt - 360.0 if dt > 180.0 else (dt + 360.0 if dt < -180.0 else dt)
        gx, gy, gz, bx, by, bz = calibrated(ux[i], uy[i], uz[i], vx[i], vy[i], vz[i], k)
        valid += 1.0 if counts else 0.0
        sa += da if counts else 0.0
        sb += db if counts else 0.0
        st += dt if counts else 0.0
        qa += da * da if counts else 0.0
        qb += db * db if counts else 0.0
        qt += dt * dt if counts else 0.0
        gg += gx * gx + gy * gy + gz * gz if counts else 0.0
        bb += bx * bx + by * by + bz * bz if counts else 0.0
        gb += gx * bx + gy * by + gz * bz if counts else 0.0
    return valid, sa, sb, st, qa, qb, qt, gg, bb, gb


@compiled(
    *(
        types.int64(
            _TIMES, *(of,) * 6, *(_FLOATS,) * 3, VECTOR, types.int64, types.int64, _TIMES_OUT, _INTS_OUT, MATRIX_OUT
        )
        for of in (_INTS, _FLOATS)
    )
)
def _windows(
    time: Any, ux: Any, uy: Any, uz: Any, vx: Any, vy: Any, vz: Any, inc: Any, azi: Any, tf: Any,
    c: Any, origin: int, width: int, start: Any, count: Any, out: Any,
) -> int:  # fmt: skip
    """Means and scatter of windows of `width` ns counted from `origin`; returns how many rows were written.

    out : (n, 9) means of the samples' inclination, azimuth, toolface and their standard deviations, deg; root mean
    square of gravity and field in units of the calibration's, the dip between them, deg. NaN where no sample counts.
    """
    rows, first, n = 0, 0, time.size
    while first < n:
        window = (time[first] - origin) // width
        end = origin + (window + 1) * width
        last = first + 1
        while last < n and time[last] < end:
            last += 1
        begin = first
        while begin < last and inc[begin] != inc[begin]:
            begin += 1
        start[rows] = origin + window * width
        if begin == last:
            count[rows] = 0
            for k in range(9):
                out[rows, k] = math.nan
        else:
            # about the first sample, the shorter way round; its angles are near the mean or the mean says nothing
            a, b, t = inc[begin], azi[begin], tf[begin]
            valid, sa, sb, st, qa, qb, qt, gg, bb, gb = _sums(
                ux[begin:last], uy[begin:last], uz[begin:last], vx[begin:last], vy[begin:last], vz[begin:last],
                inc[begin:last], azi[begin:last], tf[begin:last], a, b, t, c,
            )  # fmt: skip
            count[rows] = int(valid)
            azimuth, toolface = b + sb / valid, t + st / valid
            out[rows, 0] = a + sa / valid
            out[rows, 1] = azimuth - 360.0 * math.floor(azimuth / 360.0)
            out[rows, 2] = toolface - 360.0 * math.floor(toolface / 360.0)
            out[rows, 3] = math.sqrt(max(qa - sa * sa / valid, 0.0) / (valid - 1)) if valid > 1 else math.nan
            out[rows, 4] = math.sqrt(max(qb - sb * sb / valid, 0.0) / (valid - 1)) if valid > 1 else math.nan
            out[rows, 5] = math.sqrt(max(qt - st * st / valid, 0.0) / (valid - 1)) if valid > 1 else math.nan
            out[rows, 6], out[rows, 7] = math.sqrt(gg / valid), math.sqrt(bb / valid)
            level = gg * bb - gb * gb
            out[rows, 8] = math.atan2(gb, math.sqrt(level if level > 0.0 else 0.0)) * (180.0 / math.pi)
        rows += 1
        first = last
    return rows


def degrees(channels: list[Any], c: Any, out: list[Any] | None = None) -> list[Any]:
    """Inclination, azimuth, toolface, deg, float32, of six channels, int32 or float32 each; into `out` where given."""
    n = len(channels[0])
    angles = [np.empty(n, dtype=np.float32) for _ in range(3)] if out is None else [values[:n] for values in out]
    _degrees(*(*channels, c, *angles))
    return angles


def windows(
    time: Any, channels: list[Any], c: Any, origin: int, width: int, out: list[Any] | None = None
) -> tuple[Any, Any, Any]:
    """Start (ns), samples that count and the nine columns of `_windows` of each window that has a sample.

    `out` as of `degrees`; times do not run backwards.
    """
    most = min(len(time), int(time[-1] - time[0]) // width + 2) if len(time) else 0
    start, count, rows = np.empty(most, dtype=np.int64), np.empty(most, dtype=np.int32), np.empty((most, 9))
    n = _windows(*(time, *channels, *degrees(channels, c, out), c, origin, width, start, count, rows))
    return start[:n], count[:n], rows[:n]
