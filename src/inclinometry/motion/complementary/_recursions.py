"""Compiled recursion over the samples of the filter in the almost-inertial frame. Arrays in and out, no checks."""

from __future__ import annotations

from itertools import accumulate
from typing import Final

import numpy as np
from numpy.typing import NDArray

from inclinometry.arrays import Array, Mask
from inclinometry.compiled import (
    CUBE_OUT,
    FLAGS_OUT,
    MASK,
    MATRIX,
    MATRIX_OUT,
    VECTOR,
    VECTOR_OUT,
    compiled,
    inlined,
    math,
    types,
)
from inclinometry.motion.complementary import _kernels as k
from inclinometry.motion.result import BITS
from inclinometry.uncertainty import UNKNOWN

# places in `first`: sums of the start (gravity, field, samples; strapdown axes), last good gravity, field and rate
F_GRAVITY, F_FIELD, F_COUNT, F_ACCEL, F_MAG, F_GYRO, FIRST = 0, 3, 6, 7, 10, 13, 16
# places in `count`: samples seen, samples in the block, 1 after the start, blocks done
C_SEEN, C_BLOCK, C_RUNNING, C_BLOCKS, COUNT = 0, 1, 2, 3, 4
# places in `shown`, what the rows of a block share: half the turn to north (cosine, sine), covariance of the level
# frame's error (6), quality, flags
V_COSINE, V_SINE, V_COVARIANCE, V_QUALITY, V_FLAGS, SHOWN = 0, 1, 2, 8, 9, 10
# places in a block's record for the smoother: covariance before and after the observations, their correction, matrix,
# estimate after them, field as it was seen and whether the tool moved, by how much sway exceeds what is believed,
# doubt of the heading's field
H_BEFORE, H_AFTER, H_CORRECTION, H_MATRIX, H_ESTIMATE, H_SEEN, H_EXCESS, H_DOUBT, RECORD = accumulate(
    (0, k.STATES * k.STATES, k.STATES * k.STATES, k.STATES, 9, k.NAV, 4, 1, 1)
)

# places in `state`, all that lasts from sample to sample
AT_NAV, AT_BLOCK, AT_SLOW, AT_FIRST, AT_SHOWN, AT_COVARIANCE, STATE = accumulate(
    (0, k.NAV, k.BLOCK, k.SLOW, FIRST, SHOWN, k.STATES * k.STATES)
)

START, DISTURBED, DRIFT, VIBRATION = BITS["start"], BITS["disturbed"], BITS["drift"], BITS["vibration"]
CLIPPED, VERTICAL, UNOBSERVABLE = BITS["clipped"], BITS["vertical"], BITS["unobservable"]
PLUMB: Final = math.sin(math.radians(0.5))  # inclinations below are flagged vertical
WORST: Final = math.radians(10.0)  # standard uncertainty at which the quality is 0


@inlined
def _level(first: Array, nav: Array, out: Array) -> None:
    """Into `out` the level frame from the sums so far: the shortest turn that brings gravity down; the field in it."""
    x, y, z = first[F_GRAVITY], first[F_GRAVITY + 1], first[F_GRAVITY + 2]
    size = math.sqrt(x * x + y * y + z * z) + 1e-300
    w = math.sqrt(max(0.5 * (1.0 + z / size), 1e-12))
    a, b = 0.5 * y / size / w, -0.5 * x / size / w
    n = 1.0 / math.sqrt(w * w + a * a + b * b)
    w, a, b = w * n, a * n, b * n
    p, q, r, s = nav[0], nav[1], nav[2], nav[3]
    out[0], out[1] = w * p - a * q - b * r, w * q + a * p + b * s
    out[2], out[3] = w * r + b * p - a * s, w * s + a * r - b * q
    u, v, t = first[F_FIELD], first[F_FIELD + 1], first[F_FIELD + 2]
    c0, c1, c2 = 2.0 * b * t, -2.0 * a * t, 2.0 * (a * v - b * u)
    scale = 1.0 / max(first[F_COUNT], 1.0)
    out[k.N_FIELD] = (u + w * c0 + b * c2) * scale
    out[k.N_FIELD + 1] = (v + w * c1 - a * c2) * scale
    out[k.N_FIELD + 2] = (t + w * c2 + a * c1 - b * c0) * scale


@inlined
def _begin(p: Array, par: Array) -> None:
    """Covariance after the start."""
    for i in range(2):
        p[k.SWAY + i, k.SWAY + i] = par[k.R_SWAY] * par[k.TAU]
        p[k.SPEED + i, k.SPEED + i] = par[k.P_SPEED]
        p[k.SLOPE + i, k.SLOPE + i] = par[k.P_SLOPE]
    for i in range(3):
        p[k.BIAS + i, k.BIAS + i] = par[k.P_BIAS]
        p[k.FIELD + i, k.FIELD + i] = par[k.UNEVEN] * par[k.USE_MAG]


@inlined
def _show(nav: Array, p: Array, slow: Array, par: Array, shown: Array, flags: int) -> None:
    """What the rows share until the next block: turn to north, covariance of the level frame, quality, flags."""
    bx, by = nav[k.N_FIELD], nav[k.N_FIELD + 1]
    beta = 0.5 * math.atan2(by, bx)
    shown[V_COSINE], shown[V_SINE] = math.cos(beta), -math.sin(beta)
    across = bx * bx + by * by
    gx, gy = -by / across, bx / across
    c = k.SLOPE
    f = k.FIELD
    over = slow[k.S_EXCESS]
    shown[V_COVARIANCE] = (1.0 + over) * p[c + 1, c + 1] + par[k.LEAST_SLOPE]
    shown[V_COVARIANCE + 1] = -(1.0 + over) * p[c, c + 1]
    shown[V_COVARIANCE + 2] = -(gx * p[c + 1, f] + gy * p[c + 1, f + 1])
    shown[V_COVARIANCE + 3] = (1.0 + over) * p[c, c] + par[k.LEAST_SLOPE]
    shown[V_COVARIANCE + 4] = gx * p[c, f] + gy * p[c, f + 1]
    heading = gx * gx * p[f, f] + 2.0 * gx * gy * p[f, f + 1] + gy * gy * p[f + 1, f + 1]
    if par[k.USE_MAG] == 0.0:
        flags |= UNOBSERVABLE
        heading += UNKNOWN * UNKNOWN
    else:
        # however long the tool stays, it has seen the field at so many places only
        heading = max(heading, par[k.UNEVEN] / (across * (1.0 + slow[k.S_MOVED] / par[k.PLACE])))
        # and a level frame that leans turns the field by its dip
        leaning = 0.5 * over * (p[c, c] + p[c + 1, c + 1]) * nav[k.N_FIELD + 2] ** 2
        heading += (leaning + slow[k.S_FOREIGN] + slow[k.S_DOUBT]) / across
    shown[V_COVARIANCE + 5] = min(heading, 2.0 * (UNKNOWN * UNKNOWN))
    if slow[k.S_JUDGED] > 1.0 or slow[k.S_FOREIGN] > par[k.UNEVEN]:
        flags |= DISTURBED
    # twice the standard deviation that the settings allow
    if over > 3.0:
        flags |= VIBRATION
    if slow[k.S_REJECTED] > par[k.ACCEPT]:
        flags |= DRIFT
    spread = math.sqrt(max(p[c, c] + p[c + 1, c + 1], 0.0 if par[k.USE_MAG] == 0.0 else heading)) / WORST
    shown[V_QUALITY] = max(0.0, 1.0 - max(spread, slow[k.S_JUDGED]))
    shown[V_FLAGS] = flags


@inlined
def _look(
    nav: Array, p: Array, e: Array, block: Array, slow: Array, par: Array, inverse: float, resting: bool
) -> float:
    """Mean field of the block without hard iron into `e`; factor on its variance."""
    r = block[k.B_MATRIX : k.B_MATRIX + 9]
    if not resting:
        k.find_iron(block, nav, p, slow, par, 1.0 / inverse)
    h0, h1, h2 = nav[k.N_IRON], nav[k.N_IRON + 1], nav[k.N_IRON + 2]
    for i in range(3):
        e[i] = (block[k.B_LEVEL + i] - r[3 * i] * h0 - r[3 * i + 1] * h1 - r[3 * i + 2] * h2) * inverse
    factor = k.judge_field(e, nav, p, slow, par, resting)
    # at rest the field is one sample of its unevenness, however long one looks
    return factor * math.exp(min((slow[k.S_REST] - par[k.REST_TIME]) / par[k.FRESH], 50.0)) if resting else factor


@inlined
def _record(record: Array, start: int, values: Array) -> None:
    """Copy into a block's record, where one is kept."""
    if record.size > 0:
        for i in range(values.size):
            record[start + i] = values[i]


@inlined
def _finish_block(
    nav: Array, p: Array, dx: Array, work: Array, block: Array, slow: Array, par: Array, shown: Array, record: Array
) -> None:
    """Predict over the block, look for hard iron, judge the field, observe, correct."""
    inverse = par[k.DT] / par[k.TAU]
    k.drop_averaged(block, inverse)
    k.predict(nav, p, block, slow, par, inverse)
    resting = k.still(block, slow, par, inverse)
    e, factor = work[k.STATES :], 1.0
    if par[k.USE_MAG] > 0.0:
        factor = _look(nav, p, e, block, slow, par, inverse, resting)
    for i in range(k.STATES):
        dx[i] = 0.0
    _record(record, H_BEFORE, p.reshape(k.STATES * k.STATES))
    k.observe(nav, p, dx, work, block, slow, par, resting)
    if par[k.USE_MAG] > 0.0:
        for i in range(3):
            k.update(p, dx, work, k.FIELD + i, factor * par[k.R_FIELD], e[i] - nav[k.N_FIELD + i])
    k.feed_back(nav, dx)
    _record(record, H_AFTER, p.reshape(k.STATES * k.STATES))
    _record(record, H_CORRECTION, dx)
    _record(record, H_MATRIX, block[k.B_MATRIX : k.B_MATRIX + 9])
    _record(record, H_ESTIMATE, nav)
    _record(record, H_SEEN, e[:3])
    if record.size > 0:
        record[H_SEEN + 3] = 0.0 if resting else 1.0
        record[H_EXCESS], record[H_DOUBT] = slow[k.S_EXCESS], slow[k.S_DOUBT]
    for i in range(k.BLOCK):
        block[i] = 0.0
    _show(nav, p, slow, par, shown, 0)


@inlined
def _take(
    i: int,
    gyro: Array,
    accel: Array,
    mag: Array,
    good: bool,
    nav: Array,
    r: Array,
    block: Array,
    first: Array,
    par: Array,
) -> None:
    """One sample: turn the strapdown, add to the sums of the block; a bad sample repeats the last good one."""
    if good:
        for c in range(3):
            first[F_GYRO + c] = gyro[i, c]
            first[F_ACCEL + c] = accel[i, c]
        if par[k.USE_MAG] > 0.0:
            for c in range(3):
                first[F_MAG + c] = mag[i, c]
    else:
        block[k.B_HELD] += par[k.DT]
    w0, w1, w2 = first[F_GYRO], first[F_GYRO + 1], first[F_GYRO + 2]
    a0, a1, a2 = first[F_ACCEL], first[F_ACCEL + 1], first[F_ACCEL + 2]
    m0, m1, m2 = first[F_MAG], first[F_MAG + 1], first[F_MAG + 2]
    half, dt = 0.5 * par[k.DT], par[k.DT]
    x, y, z = half * (w0 - nav[k.N_BIAS]), half * (w1 - nav[k.N_BIAS + 1]), half * (w2 - nav[k.N_BIAS + 2])
    q0, q1, q2, q3 = k.turn(nav[0], nav[1], nav[2], nav[3], x, y, z)
    nav[0], nav[1], nav[2], nav[3] = q0, q1, q2, q3
    k.level_matrix(q0, q1, q2, q3, r)
    block[k.B_ONE] += dt * (r[0] * a0 + r[1] * a1 + r[2] * a2)
    block[k.B_ONE + 1] += dt * (r[3] * a0 + r[4] * a1 + r[5] * a2)
    block[k.B_TWO] += dt * block[k.B_ONE]
    block[k.B_TWO + 1] += dt * block[k.B_ONE + 1]
    for c in range(9):
        block[k.B_MATRIX + c] += r[c]
    for c in range(3):
        block[k.B_LEVEL + c] += r[3 * c] * m0 + r[3 * c + 1] * m1 + r[3 * c + 2] * m2
    for c in range(3):
        block[k.B_RATE + c] += first[F_GYRO + c]
        block[k.B_GRAVITY + c] += first[F_ACCEL + c]
        block[k.B_FIELD + c] += first[F_MAG + c]
    block[k.B_RATE2] += w0 * w0 + w1 * w1 + w2 * w2
    block[k.B_GRAVITY2] += a0 * a0 + a1 * a1 + a2 * a2
    block[k.B_FIELD2] += m0 * m0 + m1 * m1 + m2 * m2


@inlined
def _write(
    place: int,
    nav: Array,
    r: Array,
    shown: Array,
    quaternion: Array,
    covariance: Array,
    quality: Array,
    flags: NDArray[np.uint32],
) -> None:
    """One row: attitude from tool to level turned to north, its covariance in tool axes, quality and flags."""
    c, s = shown[V_COSINE], shown[V_SINE]
    q0, q1, q2, q3 = nav[0], nav[1], nav[2], nav[3]
    w, x, y, z = c * q0 - s * q3, c * q1 - s * q2, c * q2 + s * q1, c * q3 + s * q0
    sign = -1.0 if w < 0.0 else 1.0
    q = quaternion[place]
    q[0], q[1], q[2], q[3] = sign * w, -sign * x, -sign * y, -sign * z
    s0, s1, s2 = shown[V_COVARIANCE], shown[V_COVARIANCE + 1], shown[V_COVARIANCE + 2]
    s3, s4, s5 = shown[V_COVARIANCE + 3], shown[V_COVARIANCE + 4], shown[V_COVARIANCE + 5]
    out = covariance[place]
    for i in range(3):
        y0 = s0 * r[i] + s1 * r[3 + i] + s2 * r[6 + i]
        y1 = s1 * r[i] + s3 * r[3 + i] + s4 * r[6 + i]
        y2 = s2 * r[i] + s4 * r[3 + i] + s5 * r[6 + i]
        for j in range(i, 3):
            value = r[j] * y0 + r[3 + j] * y1 + r[6 + j] * y2
            out[i, j] = value
            out[j, i] = value
    quality[place] = shown[V_QUALITY]
    flat = r[6] * r[6] + r[7] * r[7] < PLUMB * PLUMB
    flags[place] = int(shown[V_FLAGS]) | (VERTICAL if flat else 0)


@inlined
def _start(
    nav: Array, r: Array, p: Array, block: Array, slow: Array, first: Array, shown: Array, par: Array, trial: Array
) -> bool:
    """A sample of the start: its attitude from the sums so far, in `trial`; true when the start is over."""
    for c in range(3):
        i = 3 * c
        first[F_GRAVITY + c] += r[i] * first[F_ACCEL] + r[i + 1] * first[F_ACCEL + 1] + r[i + 2] * first[F_ACCEL + 2]
        first[F_FIELD + c] += r[i] * first[F_MAG] + r[i + 1] * first[F_MAG + 1] + r[i + 2] * first[F_MAG + 2]
    first[F_COUNT] += 1.0
    for c in range(k.NAV):
        trial[c] = nav[c]
    _level(first, nav, trial)
    if par[k.USE_MAG] == 0.0:
        trial[k.N_FIELD], trial[k.N_FIELD + 1], trial[k.N_FIELD + 2] = 1.0, 0.0, 0.0
    _begin(p, par)
    _show(trial, p, slow, par, shown, START)
    shown[V_QUALITY] = 0.0
    k.level_matrix(trial[0], trial[1], trial[2], trial[3], r)
    for c in range(k.BLOCK):
        block[c] = 0.0
    return bool(first[F_COUNT] >= par[k.START])


@compiled(
    types.int64(
        MATRIX, MATRIX, MATRIX, MASK, VECTOR, types.int64, types.int64, VECTOR_OUT,
        types.Array(types.int64, 1, "C"), MATRIX_OUT, CUBE_OUT, VECTOR_OUT, VECTOR_OUT, FLAGS_OUT, MATRIX_OUT
    )
)  # fmt: skip
def advance(
    gyro: Array,
    accel: Array,
    mag: Array,
    good: Mask,
    par: Array,
    size: int,
    every: int,
    state: Array,
    count: NDArray[np.int64],
    quaternion: Array,
    covariance: Array,
    rate: Array,
    quality: Array,
    flags: NDArray[np.uint32],
    history: Array,
) -> int:
    """Run over samples, `size` to a block; write every `every`-th row, counted from the run's first sample.

    Returns the number of rows. All that lasts is in `state` and `count`, so a run may be cut anywhere.
    """
    nav, block = state[AT_NAV:AT_BLOCK], state[AT_BLOCK:AT_SLOW]
    slow, first = state[AT_SLOW:AT_FIRST], state[AT_FIRST:AT_SHOWN]
    shown, p = state[AT_SHOWN:AT_COVARIANCE], state[AT_COVARIANCE:STATE].reshape(k.STATES, k.STATES)
    r, dx, work, trial = np.empty(9), np.empty(k.STATES), np.empty(k.STATES + 3), np.empty(k.NAV)
    rows = 0
    for i in range(gyro.shape[0]):
        _take(i, gyro, accel, mag, good[i], nav, r, block, first, par)
        starting = count[C_RUNNING] == 0
        for c in range(4):
            trial[c] = nav[c]
        if starting:
            if (good[i] or first[F_COUNT] > 0.0) and _start(nav, r, p, block, slow, first, shown, par, trial):
                count[C_RUNNING] = 1
                for c in range(k.NAV):
                    nav[c] = trial[c]
        else:
            count[C_BLOCK] += 1
            if count[C_BLOCK] == size:
                count[C_BLOCK] = 0
                at = count[C_BLOCKS]
                _finish_block(nav, p, dx, work, block, slow, par, shown, history[at if at < history.shape[0] else 0])
                count[C_BLOCKS] += 1
        if count[C_SEEN] % every == 0:
            rate[rows] = first[F_GYRO + 2] - nav[k.N_BIAS + 2]
            _write(rows, trial, r, shown, quaternion, covariance, quality, flags)
            if not good[i]:
                flags[rows] |= CLIPPED
            if starting and first[F_COUNT] == 0.0:
                quality[rows] = 0.0
                for c in range(4):
                    quaternion[rows, c] = math.nan
                for c in range(9):
                    covariance[rows, c // 3, c % 3] = math.nan
            rows += 1
        count[C_SEEN] += 1
    return rows
