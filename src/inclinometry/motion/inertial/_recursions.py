"""Compiled loops of the error-state filter: one window forward, one window backward. Arrays in and out, no checks.

Importing this module imports numba and compiles (or loads from the cache), so import it where a kernel is called.

Error state, estimate minus truth, 16 wide: attitude e (tool axes, dcm = (1 + [e x]) true dcm) 0-2, gyro bias 3-5, gyro
scale 6-8, accelerometer bias 9-11, hard iron 12-14, and in the place that pads the rows the dip of the reference field.
Within a window the strapdown attitude is left alone; the errors are estimated beside it and taken out at its end.
"""

from __future__ import annotations

from itertools import accumulate
from typing import Final

import numpy as np
from numpy.typing import NDArray

from inclinometry.arrays import Array
from inclinometry.compiled import MATRIX, MATRIX_OUT, VECTOR, VECTOR_OUT, compiled, inlined, math, types
from inclinometry.motion.inertial.state import STATES

TAPERS: Final = 10  # of a window; a row of 12 sums each, see `_keep`
# places in `out`
DRIFT, COUNTS, SUMS = accumulate((12 * TAPERS, 18, 8))

# rows of the tape: of a step (13) its exact rotation, half the interval, rates times it; of a measurement (34)
# direction h, gain k, innovation over its variance, one over the variance


@inlined
def _matrix(q: Array, c: Array) -> None:
    """Direction cosines of a unit quaternion."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    c[0, 0], c[0, 1], c[0, 2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    c[1, 0], c[1, 1], c[1, 2] = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    c[2, 0], c[2, 1], c[2, 2] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


@inlined
def _turn(x: float, y: float, z: float, q: Array) -> None:
    """Unit quaternion of the active rotation by a vector."""
    half = 0.5 * math.sqrt(x * x + y * y + z * z)
    ratio = 0.5 if half < 1e-8 else 0.5 * math.sin(half) / half
    q[0], q[1], q[2], q[3] = math.cos(half), ratio * x, ratio * y, ratio * z


@inlined
def _product(p: Array, q: Array, out: Array) -> None:
    """Hamilton product; `out` may be one of the factors."""
    w = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3]
    x = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2]
    y = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1]
    z = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]
    scale = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    out[0], out[1], out[2], out[3] = w * scale, x * scale, y * scale, z * scale


@inlined
def _predict(p: Array, x: Array, step: Array, noise: Array, held: float, t: Array) -> None:
    """Errors and covariance over one step: e' = R (e + h d) + h d, d = bias + rate x scale, h half the interval.

    Only the three rows of attitude change; what they become is written to their columns as well.
    """
    h, y0, y1, y2 = step[9], step[10], step[11], step[12]
    for j in range(STATES):
        d0, d1, d2 = h * p[3, j] + y0 * p[6, j], h * p[4, j] + y1 * p[7, j], h * p[5, j] + y2 * p[8, j]
        a0, a1, a2 = p[0, j] + d0, p[1, j] + d1, p[2, j] + d2
        t[0, j] = step[0] * a0 + step[1] * a1 + step[2] * a2 + d0
        t[1, j] = step[3] * a0 + step[4] * a1 + step[5] * a2 + d1
        t[2, j] = step[6] * a0 + step[7] * a1 + step[8] * a2 + d2
    for i in range(3):
        d0, d1, d2 = h * t[i, 3] + y0 * t[i, 6], h * t[i, 4] + y1 * t[i, 7], h * t[i, 5] + y2 * t[i, 8]
        a0, a1, a2 = t[i, 0] + d0, t[i, 1] + d1, t[i, 2] + d2
        t[i, 0] = step[0] * a0 + step[1] * a1 + step[2] * a2 + d0
        t[i, 1] = step[3] * a0 + step[4] * a1 + step[5] * a2 + d1
        t[i, 2] = step[6] * a0 + step[7] * a1 + step[8] * a2 + d2
    t[1, 0], t[2, 0], t[2, 1] = t[0, 1], t[0, 2], t[1, 2]
    for i in range(3):
        for j in range(STATES):
            p[i, j] = t[i, j]
        for j in range(3, STATES):
            p[j, i] = t[i, j]
        p[i, i] += held
    for i in range(STATES):
        p[i, i] += noise[i]
    d0, d1, d2 = h * x[3] + y0 * x[6], h * x[4] + y1 * x[7], h * x[5] + y2 * x[8]
    a0, a1, a2 = x[0] + d0, x[1] + d1, x[2] + d2
    x[0] = step[0] * a0 + step[1] * a1 + step[2] * a2 + d0
    x[1] = step[3] * a0 + step[4] * a1 + step[5] * a2 + d1
    x[2] = step[6] * a0 + step[7] * a1 + step[8] * a2 + d2


@inlined
def _update(p: Array, x: Array, h: Array, z: float, r: float, gate: float, u: Array, k: Array) -> tuple[float, float]:
    """One scalar measurement z = h x + noise of variance r, Joseph form; innovation over variance, one over variance.

    P - u k' - k u' + s k k' with u = P h: positive whatever the rounding of k. Beyond the gate (in variances) nothing
    is done and 0, -1 returned.
    """
    for j in range(STATES):
        u[j] = 0.0
    v = z
    for i in range(STATES):
        if h[i] != 0.0:
            v -= h[i] * x[i]
            for j in range(STATES):
                u[j] += h[i] * p[i, j]
    s = r
    for i in range(STATES):
        s += h[i] * u[i]
    if v * v > gate * s:
        return 0.0, -1.0
    inverse = 1.0 / s
    for i in range(STATES):
        k[i] = u[i] * inverse
        x[i] += k[i] * v
    for i in range(STATES):
        ui, ki = u[i], k[i]
        for j in range(STATES):
            p[i, j] += ki * (s * k[j] - u[j]) - ui * k[j]
    return v * inverse, inverse


@inlined
def _keep(c: Array, a: Array, row: Array) -> None:
    """What the tapers are put on: apparent gravity `a` in north, east, down, then c transposed, by rows."""
    for n in range(3):
        row[n] = c[0, n] * a[0] + c[1, n] * a[1] + c[2, n] * a[2]
        for j in range(3):
            row[3 + 3 * n + j] = c[j, n]


@inlined
def _taper(v: Array, tapers: Array, out: Array) -> None:
    """Sums of the rows of v times each taper; twelve running sums, so that they stay in registers."""
    for m in range(TAPERS):
        s0, s1, s2, s3, s4, s5, s6, s7, s8, s9, s10, s11 = (0.0,) * 12
        for i in range(v.shape[0]):
            w = tapers[i, m]
            s0, s1, s2, s3 = s0 + w * v[i, 0], s1 + w * v[i, 1], s2 + w * v[i, 2], s3 + w * v[i, 3]
            s4, s5, s6, s7 = s4 + w * v[i, 4], s5 + w * v[i, 5], s6 + w * v[i, 6], s7 + w * v[i, 7]
            s8, s9, s10, s11 = s8 + w * v[i, 8], s9 + w * v[i, 9], s10 + w * v[i, 10], s11 + w * v[i, 11]
        k = 12 * m
        out[k], out[k + 1], out[k + 2], out[k + 3], out[k + 4], out[k + 5] = s0, s1, s2, s3, s4, s5
        out[k + 6], out[k + 7], out[k + 8], out[k + 9], out[k + 10], out[k + 11] = s6, s7, s8, s9, s10, s11


@inlined
def _rates(sample: Array, lost: bool, nominal: Array, half: float, last: Array, y: Array, step: Array) -> None:
    """Mean of this and the last sample: as read, times half the interval, into the step; corrected into y."""
    step[9] = half
    for j in range(3):
        now = last[j] if lost else sample[j]
        mean = 0.5 * (last[j] + now)
        step[10 + j] = half * mean
        last[j] = now
        y[j] = mean - (mean * nominal[7 + j] + nominal[4 + j])


@inlined
def _drift(c: Array, step: Array, drift: Array) -> None:
    """Half a step of the integral of c' [1, rate], by which bias and scale turn the almost-inertial frame."""
    for n in range(3):
        for j in range(3):
            drift[6 * n + j] += step[9] * c[j, n]
            drift[6 * n + 3 + j] += step[10 + j] * c[j, n]


@inlined
def _field(c: Array, m: Array, nominal: Array, strength: float, east: bool, axis: Array, h: Array) -> float:
    """Residual of the field along east, or in the meridian across the field, and its direction h in the errors.

    axis: the tool's, in north, east, down, averaged over minutes. The field leaves one direction open (azimuth with
    axial hard iron); taken from c, h would carry the same noise of the level as the residual, and their product pushes
    along that direction: 0.3 deg in half an hour. A tool whose axis moves has no such average (zero): c is taken.
    """
    cosine, sine = math.cos(nominal[16]), math.sin(nominal[16])
    z = 0.0
    for j in range(3):
        across = cosine * c[j, 2] - sine * c[j, 0]
        u = c[j, 1] if east else across
        z += u * (m[j] - nominal[13 + j])
        h[12 + j] = -u
        h[j] = -strength * across if east else strength * c[j, 1]
    if axis[0] != 0.0 or axis[1] != 0.0 or axis[2] != 0.0:
        h[14] = -(axis[1] if east else cosine * axis[2] - sine * axis[0])
    h[15] = 0.0 if east else -strength
    return z


@inlined
def _roughness(z: float, full: bool, place: int, past: Array, out: Array) -> None:
    """Second difference of the residuals along one of the two directions, when four samples went before."""
    if full:
        rough = z - 2.0 * past[place] + past[2 + place]
        out[COUNTS + 6] += rough * rough / 6.0
        out[COUNTS + 7] += 1.0
    past[2 + place] = past[place]
    past[place] = z


@inlined
def _note(row: Array, h: Array, k: Array, ratio: float, inverse: float) -> None:
    """Onto the tape; a measurement that was refused leaves no trace."""
    done = inverse > 0.0
    for j in range(STATES):
        row[j] = h[j] if done else 0.0
        row[STATES + j] = k[j] if done else 0.0
    row[2 * STATES], row[2 * STATES + 1] = ratio, inverse if done else 0.0


@compiled(
    types.void(
        MATRIX,
        MATRIX,
        MATRIX,
        types.Array(types.uint8, 1, "C", readonly=True),
        MATRIX,
        VECTOR,
        VECTOR_OUT,
        MATRIX_OUT,
        VECTOR_OUT,
        VECTOR_OUT,
        VECTOR_OUT,
        MATRIX_OUT,
        MATRIX_OUT,
    )
)
def forward(
    gyro: Array,
    accel: Array,
    mag: Array,
    marks: NDArray[np.uint8],
    tapers: Array,
    c: Array,
    nominal: Array,
    p: Array,
    x: Array,
    last: Array,
    out: Array,
    steps: Array,
    updates: Array,
) -> None:
    """One window; nominal, p, x and last (the gyro's sample before) are carried on. No tape where steps has no rows.

    marks: bits, 1 use the field, 2 the gyro's sample was unusable. c: interval, three Earth-rate steps (rad), field
    strength, mag variance, gate, held variance, 16 variances of a step, 1 or 0 (a tool that is held: its bias and
    scale turn nothing), axis. out: sums of `_taper`, drift from mean to end, COUNTS: field samples used, refused,
    squared innovations; corrected rates; sum and number of squared second differences of the field's residuals.
    """
    dt, strength, variance, gate, held, coupled = c[0], c[4], c[5], c[6], c[7], c[24]
    noise, axis = c[8 : 8 + STATES], c[25:28]
    q, turn, earth = nominal[0:4], np.empty(4), np.empty(4)
    dcm, rotation, t = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, STATES))
    h, u, k = np.zeros(STATES), np.zeros(STATES), np.zeros(STATES)
    kept = np.empty((gyro.shape[0], 12))
    step, drift, a, y = np.empty(13), np.zeros(18), np.empty(3), np.empty(3)
    _turn(c[1], c[2], c[3], earth)
    _matrix(q, dcm)
    taped, run, past = steps.shape[0] > 0, 0, np.zeros(4)
    for i in range(gyro.shape[0]):
        lost = (marks[i] & 2) != 0
        _rates(gyro[i], lost, nominal, 0.5 * dt * coupled, last, y, step)
        for j in range(3):
            a[j] = accel[i, j] - nominal[10 + j]
            out[COUNTS + 3 + j] += y[j]
        _turn(-y[0] * dt, -y[1] * dt, -y[2] * dt, turn)
        _matrix(turn, rotation)
        for j in range(9):
            step[j] = rotation[j // 3, j % 3]
        _drift(dcm, step, drift)
        _product(turn, q, q)
        _product(q, earth, q)
        _matrix(q, dcm)
        _drift(dcm, step, drift)
        _predict(p, x, step, noise, held if lost else 0.0, t)
        _keep(dcm, a, kept[i])
        for j in range(18):
            out[DRIFT + j] += tapers[i, 0] * drift[j]
        ratio, inverse = 0.0, 0.0
        run = run if marks[i] & 1 else 0
        if marks[i] & 1:
            z = _field(dcm, mag[i], nominal, strength, i % 2 == 0, axis, h)
            run += 1
            _roughness(z, run > 4, i % 2, past, out)
            ratio, inverse = _update(p, x, h, z, variance, gate, u, k)
            out[COUNTS + (1 if inverse < 0.0 else 0)] += 1.0
            out[COUNTS + 2] += 0.0 if inverse <= 0.0 else ratio * ratio / inverse
        if taped:
            for j in range(13):
                steps[i, j] = step[j]
            _note(updates[i], h, k, ratio, inverse)
    _taper(kept, tapers, out)
    for j in range(18):
        out[DRIFT + j] = drift[j] - out[DRIFT + j]


@compiled(types.float64(VECTOR, types.float64, types.float64, types.float64, MATRIX_OUT, VECTOR_OUT, VECTOR_OUT))
def measure(h: Array, z: float, r: float, gate: float, p: Array, x: Array, row: Array) -> float:
    """One scalar measurement at the end of a window, noted on a row of the tape.

    Returns its squared normalised innovation, negative when it was beyond the gate.
    """
    u, k = np.zeros(STATES), np.zeros(STATES)
    ratio, inverse = _update(p, x, h, z, r, gate, u, k)
    _note(row, h, k, ratio, inverse)
    return -1.0 if inverse < 0.0 else ratio * ratio / inverse


@inlined
def _unmeasure(lam: Array, info: Array, row: Array, g: Array) -> None:
    """Adjoint of one measurement: lam = (1 - k h)' lam - h v/s, info = (1 - k h)' info (1 - k h) + h h'/s."""
    a, s = 0.0, row[2 * STATES + 1]
    for i in range(STATES):
        g[i] = 0.0
    for i in range(STATES):
        ki = row[STATES + i]
        a += ki * lam[i]
        for j in range(STATES):
            g[j] += ki * info[i, j]
    for i in range(STATES):
        s += row[STATES + i] * g[i]
    for i in range(STATES):
        hi = row[i]
        lam[i] -= hi * (a + row[2 * STATES])
        if hi != 0.0:
            for j in range(STATES):
                info[i, j] += hi * (s * row[j] - g[j])
    for i in range(STATES):
        gi = g[i]
        for j in range(STATES):
            info[i, j] -= gi * row[j]


@inlined
def _unpredict(lam: Array, info: Array, step: Array, t: Array) -> None:
    """Adjoint of one step: lam = F' lam, info = F' info F."""
    for j in range(STATES):
        for i in range(3):
            t[i, j] = step[i] * info[0, j] + step[3 + i] * info[1, j] + step[6 + i] * info[2, j]
    for i in range(3):
        for j in range(STATES):
            both = t[i, j] + info[i, j]
            info[i, j] = t[i, j]
            info[3 + i, j] += step[9] * both
            info[6 + i, j] += step[10 + i] * both
    for i in range(STATES):
        a0, a1, a2 = info[i, 0], info[i, 1], info[i, 2]
        for j in range(3):
            turned = step[j] * a0 + step[3 + j] * a1 + step[6 + j] * a2
            both = turned + (a0 if j == 0 else (a1 if j == 1 else a2))
            info[i, j] = turned
            info[i, 3 + j] += step[9] * both
            info[i, 6 + j] += step[10 + j] * both
    a0, a1, a2 = lam[0], lam[1], lam[2]
    for j in range(3):
        turned = step[j] * a0 + step[3 + j] * a1 + step[6 + j] * a2
        both = turned + (a0 if j == 0 else (a1 if j == 1 else a2))
        lam[j] = turned
        lam[3 + j] += step[9] * both
        lam[6 + j] += step[10 + j] * both


@compiled(types.void(MATRIX, MATRIX, VECTOR_OUT, MATRIX_OUT))
def backward(steps: Array, updates: Array, lam: Array, info: Array) -> None:
    """The tape of one window played backwards (modified Bryson-Frazier); updates after the last step come first."""
    g, t = np.empty(STATES), np.empty((3, STATES))
    count = steps.shape[0]
    for i in range(updates.shape[0] - 1, -1, -1):
        if updates[i, 2 * STATES + 1] > 0.0:
            _unmeasure(lam, info, updates[i], g)
        if i < count:
            _unpredict(lam, info, steps[i], t)
    for i in range(STATES):
        for j in range(i):
            info[i, j] = info[j, i] = 0.5 * (info[i, j] + info[j, i])
