"""Compiled steps of the filter in the almost-inertial frame: error states, covariance, updates. No checks.

The level frame is level as far as the filter knows and turned from north by the direction of the field in it. Error
states (12): sway (2, m) and its speed (2, m/s) in the level plane, slope (2, horizontal gravity over g), gyro bias (3,
tool axes, rad/s), field (3, level frame, nT). Vectors and matrices are flat arrays with the places below.
"""

from __future__ import annotations

from typing import Final

from inclinometry.arrays import Array
from inclinometry.compiled import inlined, math

STATES: Final = 12
SWAY, SPEED, SLOPE, BIAS, FIELD = 0, 2, 4, 6, 9

# places in `nav`, the estimate: quaternion (tool to level), sway, speed, bias, field, hard iron (tool axes)
N_TURN, N_SWAY, N_SPEED, N_BIAS, N_FIELD, N_IRON, NAV = 0, 4, 6, 8, 11, 14, 17

# places in `block`, sums over the samples since the last update: specific force's first and second integral, matrix,
# field in level and in tool axes, rate, gravity, their squares, squared field, time bridged
B_ONE, B_TWO, B_MATRIX, B_LEVEL, B_FIELD, B_RATE, B_GRAVITY = 0, 2, 4, 13, 16, 19, 22
B_RATE2, B_GRAVITY2, B_FIELD2, B_HELD, BLOCK = 25, 26, 27, 28, 29

# places in `slow`, what lasts longer than a block: low-passed rate and gravity, time at rest, misfit of the field (in
# its squared unevenness) smoothed and judged, time it was rejected, the moving sums that find hard iron, another field
# that may be the new one: its strength across and along gravity and how long it was seen; the trend of the rate; time
# in motion; of sway and speed what `lasting` keeps, and the share beyond what is believed; what of the field across
# and along gravity is not as known, low-passed, how long that has lasted, and how far it has pulled the known one;
# variance of the heading's field while it lasts, and by the pull; the largest of both so far; 1 while calm; of the
# stretch of calm being watched: blocks, the length (s) at which it is looked at next, sum of squared times at the last
# look, 1 where that found it at rest; for gravity and the field what `_watch` keeps
S_RATE, S_GRAVITY, S_READY, S_REST, S_MISFIT, S_JUDGED, S_REJECTED = 0, 3, 6, 7, 8, 9, 10
S_COUNT, S_MATRIX, S_LEVEL, S_FIELD, S_FIELD2, S_ON, S_SOLVE = 11, 12, 21, 24, 27, 28, 29
S_OTHER_ACROSS, S_OTHER_ALONG, S_OTHER_TIME, S_TREND, S_MOVED = 30, 31, 32, 33, 36
S_SWAYS, S_MOVES, S_EXCESS, S_STRAYS, S_STRANGE, S_PULLED, S_FOREIGN, S_DOUBT, S_WORST = (
    37,
    40,
    43,
    44,
    46,
    47,
    49,
    50,
    51,
)
S_CALM, S_BLOCKS, S_LOOK, S_SPREAD, S_RESTS, S_SEEN_GRAVITY, S_SEEN_FIELD, SLOW = 52, 53, 54, 55, 56, 57, 77, 97
# of a vector v in tool axes, less the turn the gyro reads: the last one, sums of it, of it times its place, of v, the
# turn itself, sum of it times its time at the last look (3 each); sums of its squares and of its squared steps
W_LAST, W_SUM, W_MOMENT, W_V, W_TURN, W_USED, W_SQUARE, W_STEP, WATCH = 0, 3, 6, 9, 12, 15, 18, 19, 20

# places in `par`, settings in the units of the kernels
(
    DT, TAU, G, R_SWAY, R_SPEED, R_BIAS, R_FIELD, UNEVEN, FRESH, Q_NOISE, Q_RATE, Q_BIAS, Q_FIELD, GATE, REST_RATE,
    REST_GRAVITY, REST_BOUND, REST_TIME, A_REST, A_MISFIT, KEEP, IRON, ACCEPT, USE_MAG, START, P_BIAS, P_SPEED,
    P_SLOPE, BRIDGE, LEAST_SLOPE, SCALE, A_TREND, PLACE, LONGEST, LEAST_TURN, A_SWAY, A_SPEED, A_FIELD, A_LASTING,
    MOST_SWAY, MOST_SPEED, A_DOUBT, PAR,
) = range(43)  # fmt: skip


@inlined
def turn(q0: float, q1: float, q2: float, q3: float, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Quaternion times exp of the rotation vector whose half is (x, y, z), its length pulled to one.

    Series good to 1e-16 up to a half angle of 0.5 rad; the library's functions beyond.
    """
    a = x * x + y * y + z * z
    s = 1.0 - a / 6.0 * (1.0 - a / 20.0 * (1.0 - a / 42.0 * (1.0 - a / 72.0 * (1.0 - a / 110.0))))
    c = 1.0 - a / 2.0 * (1.0 - a / 12.0 * (1.0 - a / 30.0 * (1.0 - a / 56.0 * (1.0 - a / 90.0))))
    if a > 0.25:
        angle = math.sqrt(a)
        s, c = math.sin(angle) / angle, math.cos(angle)
    x, y, z = x * s, y * s, z * s
    p0 = q0 * c - q1 * x - q2 * y - q3 * z
    p1 = q0 * x + q1 * c + q2 * z - q3 * y
    p2 = q0 * y + q2 * c + q3 * x - q1 * z
    p3 = q0 * z + q3 * c + q1 * y - q2 * x
    n = 1.5 - 0.5 * (p0 * p0 + p1 * p1 + p2 * p2 + p3 * p3)
    return p0 * n, p1 * n, p2 * n, p3 * n


@inlined
def level_matrix(q0: float, q1: float, q2: float, q3: float, r: Array) -> None:
    """Matrix (9, by rows) from tool to level axes of a unit quaternion."""
    r[0] = 1.0 - 2.0 * (q2 * q2 + q3 * q3)
    r[1] = 2.0 * (q1 * q2 - q0 * q3)
    r[2] = 2.0 * (q1 * q3 + q0 * q2)
    r[3] = 2.0 * (q1 * q2 + q0 * q3)
    r[4] = 1.0 - 2.0 * (q1 * q1 + q3 * q3)
    r[5] = 2.0 * (q2 * q3 - q0 * q1)
    r[6] = 2.0 * (q1 * q3 - q0 * q2)
    r[7] = 2.0 * (q2 * q3 + q0 * q1)
    r[8] = 1.0 - 2.0 * (q1 * q1 + q2 * q2)


@inlined
def drop_averaged(block: Array, inverse: float) -> None:
    """Forget the mean direction of a tool axis that turned through whole turns within the block.

    What is left of it is as small as the errors of the gyro and goes with them: a bias seen through it runs away.
    """
    for c in range(3):
        x, y, z = block[B_MATRIX + c] * inverse, block[B_MATRIX + 3 + c] * inverse, block[B_MATRIX + 6 + c] * inverse
        # square of a mean direction that counts as none
        if x * x + y * y + z * z < 0.01:
            block[B_MATRIX + c], block[B_MATRIX + 3 + c], block[B_MATRIX + 6 + c] = 0.0, 0.0, 0.0


@inlined
def transition_rows(m: Array, r: Array, nav: Array, par: Array) -> None:
    """m = F m for the rows of a matrix of the error states; r is the matrix summed over the block."""
    t, dt, g = par[TAU], par[DT], par[G]
    bx, by = nav[N_FIELD], nav[N_FIELD + 1]
    for j in range(STATES):
        u0 = dt * (r[0] * m[BIAS, j] + r[1] * m[BIAS + 1, j] + r[2] * m[BIAS + 2, j])
        u1 = dt * (r[3] * m[BIAS, j] + r[4] * m[BIAS + 1, j] + r[5] * m[BIAS + 2, j])
        u2 = dt * (r[6] * m[BIAS, j] + r[7] * m[BIAS + 1, j] + r[8] * m[BIAS + 2, j])
        for k in range(2):
            m[SWAY + k, j] += t * m[SPEED + k, j] - 0.5 * g * t * t * m[SLOPE + k, j]
            m[SPEED + k, j] -= g * t * m[SLOPE + k, j]
        m[SLOPE, j] += u1
        m[SLOPE + 1, j] -= u0
        m[FIELD, j] -= by * u2
        m[FIELD + 1, j] += bx * u2


@inlined
def add_noise(p: Array, r: Array, nav: Array, block: Array, slow: Array, par: Array, inverse: float) -> None:
    """Process noise of a block: rotation (white, errors of scale and axes, bridged samples), bias, field, speed."""
    w0 = block[B_RATE] * inverse - slow[S_TREND]
    w1 = block[B_RATE + 1] * inverse - slow[S_TREND + 1]
    w2 = block[B_RATE + 2] * inverse - slow[S_TREND + 2]
    # a bridged sample errs by what rate and acceleration change meanwhile, which takes them a fifth of a second
    # 5 /s: changes of a hand's or a string's rotation
    held = block[B_HELD] * min(1.0, 5.0 * block[B_HELD])
    # errors of scale and axes turn with the tool: what does not average out over the block is the mean matrix's share;
    # those of a steady rate are in the bias
    rate2 = w0 * w0 + w1 * w1 + w2 * w2
    scale = par[Q_RATE] * rate2
    white = par[Q_NOISE] + held * held * block[B_RATE2] * inverse
    m00 = scale * _dot(r, 0, 0) * inverse * inverse + white
    m11 = scale * _dot(r, 3, 3) * inverse * inverse + white
    m22 = scale * _dot(r, 6, 6) * inverse * inverse + white
    m01 = scale * _dot(r, 0, 3) * inverse * inverse
    m02 = scale * _dot(r, 0, 6) * inverse * inverse
    m12 = scale * _dot(r, 3, 6) * inverse * inverse
    bx, by = nav[N_FIELD], nav[N_FIELD + 1]
    _add(p, SLOPE, SLOPE, m11)
    _add(p, SLOPE + 1, SLOPE + 1, m00)
    _add(p, SLOPE, SLOPE + 1, -m01)
    _add(p, SLOPE, FIELD, -by * m12)
    _add(p, SLOPE, FIELD + 1, bx * m12)
    _add(p, SLOPE + 1, FIELD, by * m02)
    _add(p, SLOPE + 1, FIELD + 1, -bx * m02)
    _add(p, FIELD, FIELD, by * by * m22)
    _add(p, FIELD + 1, FIELD + 1, bx * bx * m22)
    _add(p, FIELD, FIELD + 1, -bx * by * m22)
    gap = par[BRIDGE] * held
    for k in range(2):
        p[SPEED + k, SPEED + k] += gap * gap
    for k in range(3):
        p[BIAS + k, BIAS + k] += par[Q_BIAS]
        p[FIELD + k, FIELD + k] += par[Q_FIELD]


@inlined
def _dot(r: Array, i: int, j: int) -> float:
    """Product of two rows of a matrix that start at i and j."""
    value: float = r[i] * r[j] + r[i + 1] * r[j + 1] + r[i + 2] * r[j + 2]
    return value


@inlined
def _add(p: Array, i: int, j: int, value: float) -> None:
    """Add to an element and, off the diagonal, to its mirror."""
    p[i, j] += value
    if i != j:
        p[j, i] += value


@inlined
def _correct(p: Array, dx: Array, gain: Array, s: float, left: float) -> None:
    """Correction and covariance by a scalar observation: `gain` is P h, `s` its variance h'P h + r."""
    for i in range(STATES):
        k = gain[i] / s
        dx[i] += k * left
        for j in range(i, STATES):
            p[i, j] -= k * gain[j]
            p[j, i] = p[i, j]


@inlined
def update(p: Array, dx: Array, gain: Array, place: int, variance: float, residual: float) -> None:
    """Direct observation of one error state; `residual` as it was before the block's other observations."""
    s = p[place, place] + variance
    left = residual - dx[place]
    for i in range(STATES):
        gain[i] = p[i, place]
    _correct(p, dx, gain, s, left)


@inlined
def follow_trend(p: Array, block: Array, slow: Array, par: Array, inverse: float) -> None:
    """An error of scale is a bias that changes with the rate: variance for what the trend of the rate changed."""
    for k in range(3):
        old = slow[S_TREND + k]
        new = old + par[A_TREND] * (block[B_RATE + k] * inverse - old)
        slow[S_TREND + k] = new
        p[BIAS + k, BIAS + k] += par[SCALE] * abs(new * new - old * old)


@inlined
def update_bias(p: Array, dx: Array, gain: Array, h: tuple[float, float, float], variance: float, z: float) -> None:
    """Observation of h times the error of the bias (3); `z` as it was before the block's other observations."""
    left, s = z, variance
    for k in range(3):
        left -= h[k] * dx[BIAS + k]
    for i in range(STATES):
        gain[i] = h[0] * p[i, BIAS] + h[1] * p[i, BIAS + 1] + h[2] * p[i, BIAS + 2]
    for k in range(3):
        s += h[k] * gain[BIAS + k]
    _correct(p, dx, gain, s, left)


@inlined
def _watch(seen: Array, v: Array, block: Array, inverse: float, place: float, t: float) -> None:
    """Add a block's vector, less the turn that the gyro reads, to the sums of a stretch."""
    v0, v1, v2 = v[0] * inverse, v[1] * inverse, v[2] * inverse
    w0, w1, w2 = block[B_RATE] * inverse, block[B_RATE + 1] * inverse, block[B_RATE + 2] * inverse
    turn = (t * (v1 * w2 - v2 * w1), t * (v2 * w0 - v0 * w2), t * (v0 * w1 - v1 * w0))
    for k in range(3):
        # the block's own turn counts half: v is its mean
        now = v[k] * inverse - seen[W_TURN + k] - 0.5 * turn[k]
        seen[W_TURN + k] += turn[k]
        if place > 0.0:
            seen[W_STEP] += (now - seen[k]) ** 2 / 6.0
        seen[W_LAST + k] = now
        seen[W_SUM + k] += now
        seen[W_MOMENT + k] += place * now
        seen[W_V + k] += v[k] * inverse
        seen[W_SQUARE] += now * now


@inlined
def _bias_by_turn(
    seen: Array, spread: float, nav: Array, p: Array, dx: Array, gain: Array, slow: Array, par: Array
) -> float:
    """The bias from a vector v fixed in space: less the turn that the gyro reads it drifts by -v x bias in tool axes.

    A straight line by least squares; of a stretch that was looked at before only what came since is new. Where v itself
    drifts the tool turns, or it is carried to where v is another: that much of its drift may be no turn. Returned is
    the square of the turn, rad/s, that may hide in its noise, or less the square of the one that shows.
    """
    n, t = slow[S_BLOCKS], par[TAU]
    m0, m1, m2 = seen[W_V] / n, seen[W_V + 1] / n, seen[W_V + 2] / n
    about, new = 0.0, 1.0 / (spread - slow[S_SPREAD])
    moment = (
        (seen[W_MOMENT] - 0.5 * (n - 1.0) * seen[W_SUM]) * t,
        (seen[W_MOMENT + 1] - 0.5 * (n - 1.0) * seen[W_SUM + 1]) * t,
        (seen[W_MOMENT + 2] - 0.5 * (n - 1.0) * seen[W_SUM + 2]) * t,
    )
    drift = (
        (moment[0] - seen[W_USED]) * new,
        (moment[1] - seen[W_USED + 1]) * new,
        (moment[2] - seen[W_USED + 2]) * new,
    )
    for k in range(3):
        about += seen[W_SUM + k] ** 2 / n + moment[k] ** 2 / spread
        seen[W_USED + k] = moment[k]
    # noise that is no larger from block to block than about the line is white; smoother noise spoils the slope by as
    # much more as it is smoother. 1e-10: rounding
    size = m0 * m0 + m1 * m1 + m2 * m2
    white = max(seen[W_STEP] / (n - 1.0), 1e-10 * size)
    noise = max((seen[W_SQUARE] - about) / (3.0 * (n - 2.0)), white)
    # and the gyro's own, which the turn has summed
    variance = noise * noise / white * new + 1.2 * size * par[Q_NOISE] / (t * t * n) * spread * new
    # square of the drift of v itself, its own noise left out (chi-square of 3 degrees of freedom, one in a thousand)
    apart = -16.0 * noise * noise / white / spread
    for k in range(3):
        apart += (moment[k] / spread + seen[W_TURN + k] / (n * t)) ** 2
    variance += max(apart, 0.0) * spread * new
    b0, b1, b2 = nav[N_BIAS], nav[N_BIAS + 1], nav[N_BIAS + 2]
    update_bias(p, dx, gain, (0.0, m2, -m1), variance, drift[0] + m1 * b2 - m2 * b1)
    update_bias(p, dx, gain, (-m2, 0.0, m0), variance, drift[1] + m2 * b0 - m0 * b2)
    update_bias(p, dx, gain, (m1, -m0, 0.0), variance, drift[2] + m0 * b1 - m1 * b0)
    seen_turn: float = -apart / size if apart > 0.0 else 16.0 * noise * noise / white / spread / size
    return seen_turn


@inlined
def observe_bias(nav: Array, p: Array, dx: Array, gain: Array, block: Array, slow: Array, par: Array) -> None:
    """The bias of a calm tool, which rests or turns slowly and evenly: the rate less the turn of gravity and field.

    Where both stay in their places, so well that the least turn would show, and the rate is the bias within its
    uncertainty, the tool is at rest and the rate the bias. A turn about the vertical shows only in a field: without one
    nothing is taken for rest.
    """
    inverse, t = par[DT] / par[TAU], par[TAU]
    turn, unknown = 0.0, 0.5 * par[LEAST_TURN]
    for k in range(3):
        turn += (slow[S_RATE + k] - nav[N_BIAS + k]) ** 2
        unknown += 16.0 * p[BIAS + k, BIAS + k]
    ended = slow[S_RESTS] > 0.0 and turn > unknown
    if slow[S_CALM] == 0.0 or ended or slow[S_BLOCKS] * t >= par[LONGEST]:
        for k in range(S_BLOCKS, SLOW):
            slow[k] = 0.0
        slow[S_LOOK] = par[REST_TIME]
    if slow[S_CALM] == 0.0:
        return
    if slow[S_RESTS] > 0.0:
        for k in range(3):
            update(p, dx, gain, BIAS + k, par[R_BIAS], block[B_RATE + k] * inverse - nav[N_BIAS + k])
    n = slow[S_BLOCKS] + 1.0
    _watch(slow[S_SEEN_GRAVITY:S_SEEN_FIELD], block[B_GRAVITY : B_GRAVITY + 3], block, inverse, n - 1.0, t)
    _watch(slow[S_SEEN_FIELD:SLOW], block[B_FIELD : B_FIELD + 3], block, inverse, n - 1.0, t)
    slow[S_BLOCKS] = n
    if n * t >= slow[S_LOOK] and n >= 4.0:  # a line and its noise need four
        spread = t * t * n * (n * n - 1.0) / 12.0
        most = _bias_by_turn(slow[S_SEEN_GRAVITY:S_SEEN_FIELD], spread, nav, p, dx, gain, slow, par)
        least = most
        if par[USE_MAG] > 0.0:
            hidden = _bias_by_turn(slow[S_SEEN_FIELD:SLOW], spread, nav, p, dx, gain, slow, par)
            # only what of the field lies across gravity tells a turn about it
            across = nav[N_FIELD] ** 2 + nav[N_FIELD + 1] ** 2 + 1e-300
            most, least = max(most, (1.0 + nav[N_FIELD + 2] ** 2 / across) * hidden), min(least, hidden)
        if least < -par[LEAST_TURN] / 16.0 and slow[S_RESTS] > 0.0:
            # a turn that has begun was taken for bias meanwhile
            for k in range(3):
                p[BIAS + k, BIAS + k] -= least
        slow[S_RESTS] = 1.0 if par[USE_MAG] > 0.0 and least >= 0.0 and most < par[LEAST_TURN] else 0.0
        slow[S_SPREAD] = spread
        slow[S_LOOK] = 1.2 * slow[S_LOOK]


@inlined
def still(block: Array, slow: Array, par: Array, inverse: float) -> bool:
    """Whether the tool has been calm long enough; keeps the low-passed rate and gravity and the time.

    It rests or turns slowly and evenly, in one place: `observe_bias` tells them apart.
    """
    if slow[S_READY] == 0.0:
        slow[S_READY] = 1.0
        for k in range(3):
            slow[S_RATE + k] = block[B_RATE + k] * inverse
            slow[S_GRAVITY + k] = block[B_GRAVITY + k] * inverse
    rate, gravity, most, trend = block[B_RATE2] * inverse, block[B_GRAVITY2] * inverse, 0.0, 0.0
    for k in range(3):
        w, a = block[B_RATE + k] * inverse, block[B_GRAVITY + k] * inverse
        dw, da = w - slow[S_RATE + k], a - slow[S_GRAVITY + k]
        # mean square about the low-passed value: scatter within the block and departure of its mean
        rate += dw * dw - w * w
        gravity += da * da - a * a
        slow[S_RATE + k] += par[A_REST] * dw
        slow[S_GRAVITY + k] += par[A_REST] * da
        most = max(most, abs(slow[S_RATE + k]))
        trend += slow[S_RATE + k] * slow[S_RATE + k]
    calm = rate < par[REST_RATE] and gravity < par[REST_GRAVITY] and most < par[REST_BOUND]
    calm = calm and block[B_HELD] == 0.0
    slow[S_CALM] = 1.0 if calm else 0.0
    slow[S_REST] = slow[S_REST] + par[TAU] if calm else 0.0
    # a tool that only shakes sees the field of one place
    slow[S_MOVED] += par[TAU] if trend > par[REST_RATE] else 0.0
    return bool(slow[S_REST] >= par[REST_TIME])


@inlined
def judge_field(e: Array, nav: Array, p: Array, slow: Array, par: Array, resting: bool) -> float:
    """Factor on the field's variance: from strength across and along gravity, which say nothing about heading.

    A disturbance has no preferred direction, so its two visible components tell how large the third is. Beyond the
    gate the variance grows with the fourth power of the misfit: such a field is not a sample of the unevenness.
    """
    across = math.sqrt(e[0] * e[0] + e[1] * e[1])
    strength = math.sqrt(nav[N_FIELD] ** 2 + nav[N_FIELD + 1] ** 2)
    dx, dz = across - strength, e[2] - nav[N_FIELD + 2]
    misfit = 0.5 * (dx * dx + dz * dz) / (par[UNEVEN] + p[FIELD + 2, FIELD + 2])
    slow[S_MISFIT] += par[A_MISFIT] * (misfit - slow[S_MISFIT])
    worst = max(misfit, slow[S_MISFIT]) / par[GATE]
    _watch_other(across, e[2], slow, par, resting)
    if worst > 1.0 and slow[S_OTHER_TIME] > par[ACCEPT]:
        # how far the two fields differ is how little the old heading is worth
        old = slow[S_OTHER_ACROSS] / (strength + 1e-300)
        dx, dz = slow[S_OTHER_ACROSS] - strength, slow[S_OTHER_ALONG] - nav[N_FIELD + 2]
        nav[N_FIELD] *= old
        nav[N_FIELD + 1] *= old
        nav[N_FIELD + 2] = slow[S_OTHER_ALONG]
        doubt_heading(nav, p, 0.5 * (dx * dx + dz * dz))
        slow[S_PULLED] += dx
        slow[S_PULLED + 1] += dz
        slow[S_OTHER_TIME] = 0.0
        slow[S_MISFIT] = 0.0
        worst, dx, dz = 0.0, 0.0, 0.0
    slow[S_JUDGED] = worst
    _doubt_field(dx, dz, p[FIELD + 2, FIELD + 2] / max(worst * worst, 1.0), slow, par)
    slow[S_REJECTED] = slow[S_REJECTED] + par[TAU] if worst > 1.0 else max(0.0, slow[S_REJECTED] - 2.0 * par[TAU])
    return worst * worst if worst > 1.0 else 1.0


@inlined
def _doubt_field(dx: float, dz: float, known: float, slow: Array, par: Array) -> None:
    """Variance of the heading's field by one that lasts longer than unevenness does, as it is seen across and along.

    While it lasts, it is the true one as likely as its share of the time; afterwards there is what it has pulled the
    known one by. `known` is that one's variance over what a misfit adds to that of an observation.
    """
    slow[S_STRAYS] += par[A_FIELD] * (dx - slow[S_STRAYS])
    slow[S_STRAYS + 1] += par[A_FIELD] * (dz - slow[S_STRAYS + 1])
    strays = 0.5 * (slow[S_STRAYS] ** 2 + slow[S_STRAYS + 1] ** 2)
    # unevenness leaves half its variance
    slow[S_STRANGE] = slow[S_STRANGE] + par[TAU] if strays > 0.6 * par[UNEVEN] else 0.0
    gain = known / (known + par[R_FIELD])
    slow[S_PULLED] += gain * dx - par[A_DOUBT] * slow[S_PULLED]
    slow[S_PULLED + 1] += gain * dz - par[A_DOUBT] * slow[S_PULLED + 1]
    # three times the mean square of two components: they tell little of a third (Student's, 2 degrees of freedom)
    pulled = 2.4 * (slow[S_PULLED] ** 2 + slow[S_PULLED + 1] ** 2)
    slow[S_FOREIGN] = 4.8 * strays * slow[S_STRANGE] * par[A_DOUBT] / par[TAU]
    slow[S_DOUBT] = max(pulled - 0.2 * par[UNEVEN], 0.0)
    slow[S_WORST] = max(slow[S_WORST], slow[S_FOREIGN] + slow[S_DOUBT])


@inlined
def doubt_heading(nav: Array, p: Array, variance: float) -> None:
    """Add variance to the field across its own direction in the level plane: what heading rests on."""
    bx, by = nav[N_FIELD], nav[N_FIELD + 1]
    scale = variance / (bx * bx + by * by + 1e-300)
    p[FIELD, FIELD] += scale * by * by
    p[FIELD + 1, FIELD + 1] += scale * bx * bx
    p[FIELD, FIELD + 1] -= scale * bx * by
    p[FIELD + 1, FIELD] -= scale * bx * by


@inlined
def _watch_other(across: float, along: float, slow: Array, par: Array, resting: bool) -> None:
    """Follow the field as it is, and count how long it has stayed the same while the tool moved."""
    dx, dz = across - slow[S_OTHER_ACROSS], along - slow[S_OTHER_ALONG]
    if 0.5 * (dx * dx + dz * dz) < 2.0 * par[GATE] * par[UNEVEN]:
        step = par[TAU] / par[ACCEPT]
        slow[S_OTHER_ACROSS] += step * dx
        slow[S_OTHER_ALONG] += step * dz
        if not resting:
            slow[S_OTHER_TIME] += par[TAU]
    else:
        slow[S_OTHER_ACROSS], slow[S_OTHER_ALONG], slow[S_OTHER_TIME] = across, along, 0.0


@inlined
def find_iron(block: Array, nav: Array, p: Array, slow: Array, par: Array, count: float) -> None:
    """Moving sums of field and matrix, and from time to time the field that turns with the tool.

    Level field = field + matrix hard iron: with means over the samples the normal equations are
    (1 - M'M) h = mean tool field - M' mean level field. It is used when it explains more of the variance than is left.
    """
    keep = par[KEEP]
    slow[S_COUNT] = keep * slow[S_COUNT] + 1.0
    a, inverse = 1.0 / slow[S_COUNT], 1.0 / count
    for k in range(9):
        slow[S_MATRIX + k] += a * (block[B_MATRIX + k] * inverse - slow[S_MATRIX + k])
    for k in range(3):
        slow[S_LEVEL + k] += a * (block[B_LEVEL + k] * inverse - slow[S_LEVEL + k])
        slow[S_FIELD + k] += a * (block[B_FIELD + k] * inverse - slow[S_FIELD + k])
    slow[S_FIELD2] += a * (block[B_FIELD2] * inverse - slow[S_FIELD2])
    slow[S_SOLVE] += 1.0
    # every 10 blocks, and after 100 in motion: before that hard iron is not believed
    if slow[S_SOLVE] >= 10 and slow[S_COUNT] >= 100.0:
        slow[S_SOLVE] = 0.0
        _solve_iron(nav, p, slow, par)


@inlined
def _solve_iron(nav: Array, p: Array, slow: Array, par: Array) -> None:
    m = slow[S_MATRIX : S_MATRIX + 9]
    y0, y1, y2 = slow[S_LEVEL], slow[S_LEVEL + 1], slow[S_LEVEL + 2]
    ridge = 0.02  # share of the rotation that counts as none: a direction that never turned gets no hard iron
    c00 = 1.0 + ridge - m[0] * m[0] - m[3] * m[3] - m[6] * m[6]
    c11 = 1.0 + ridge - m[1] * m[1] - m[4] * m[4] - m[7] * m[7]
    c22 = 1.0 + ridge - m[2] * m[2] - m[5] * m[5] - m[8] * m[8]
    c01 = -(m[0] * m[1] + m[3] * m[4] + m[6] * m[7])
    c02 = -(m[0] * m[2] + m[3] * m[5] + m[6] * m[8])
    c12 = -(m[1] * m[2] + m[4] * m[5] + m[7] * m[8])
    d0 = slow[S_FIELD] - m[0] * y0 - m[3] * y1 - m[6] * y2
    d1 = slow[S_FIELD + 1] - m[1] * y0 - m[4] * y1 - m[7] * y2
    d2 = slow[S_FIELD + 2] - m[2] * y0 - m[5] * y1 - m[8] * y2
    i00, i01, i02 = c11 * c22 - c12 * c12, c02 * c12 - c01 * c22, c01 * c12 - c02 * c11
    i11, i12, i22 = c00 * c22 - c02 * c02, c01 * c02 - c00 * c12, c00 * c11 - c01 * c01
    det = c00 * i00 + c01 * i01 + c02 * i02
    h0 = (i00 * d0 + i01 * d1 + i02 * d2) / det
    h1 = (i01 * d0 + i11 * d1 + i12 * d2) / det
    h2 = (i02 * d0 + i12 * d1 + i22 * d2) / det
    explained = h0 * d0 + h1 * d1 + h2 * d2
    left = slow[S_FIELD2] - y0 * y0 - y1 * y1 - y2 * y2 - explained
    wanted = par[IRON] * max(left, par[UNEVEN])
    on = explained > (0.5 * wanted if slow[S_ON] > 0.0 else wanted)
    if not on:
        h0, h1, h2 = 0.0, 0.0, 0.0
    e0, e1, e2 = h0 - nav[N_IRON], h1 - nav[N_IRON + 1], h2 - nav[N_IRON + 2]
    nav[N_IRON], nav[N_IRON + 1], nav[N_IRON + 2] = h0, h1, h2
    # the field was averaged with the old hard iron in it
    if on == (slow[S_ON] > 0.0):
        for k in range(3):
            nav[N_FIELD + k] -= m[3 * k] * e0 + m[3 * k + 1] * e1 + m[3 * k + 2] * e2
    else:
        for k in range(3):
            nav[N_FIELD + k] = slow[S_LEVEL + k] - (m[3 * k] * h0 + m[3 * k + 1] * h1 + m[3 * k + 2] * h2)
            for j in range(STATES):
                p[FIELD + k, j] = 0.0
                p[j, FIELD + k] = 0.0
            p[FIELD + k, FIELD + k] = par[UNEVEN]
        slow[S_MISFIT] = 0.0
        slow[S_OTHER_TIME] = 0.0
        slow[S_REJECTED] = 0.0
    slow[S_ON] = 1.0 if on else 0.0


@inlined
def predict(nav: Array, p: Array, block: Array, slow: Array, par: Array, inverse: float) -> None:
    """Estimate and covariance to the end of the block."""
    t = par[TAU]
    for i in range(2):
        nav[N_SWAY + i] += t * nav[N_SPEED + i] + block[B_TWO + i]
        nav[N_SPEED + i] += block[B_ONE + i]
    r = block[B_MATRIX : B_MATRIX + 9]
    for _ in range(2):
        transition_rows(p, r, nav, par)
        for i in range(STATES):
            for j in range(i):
                p[i, j], p[j, i] = p[j, i], p[i, j]
    for i in range(STATES):
        for j in range(i):
            p[i, j] = 0.5 * (p[i, j] + p[j, i])
            p[j, i] = p[i, j]
    add_noise(p, r, nav, block, slow, par, inverse)
    follow_trend(p, block, slow, par, inverse)


@inlined
def lasting(kept: Array, first: float, second: float, share: float, memory: float) -> float:
    """Variance of an observation that would be white and yet leave as much as its two residuals leave when low-passed.

    `kept` are the two low-passed residuals, which take in `share` of a new one, and the mean square over a `memory`.
    What swings slower than the filter takes for noise passes for a slope, or turns the heading, and shows here first.
    """
    kept[0] += share * (first - kept[0])
    kept[1] += share * (second - kept[1])
    now = 0.5 * (kept[0] * kept[0] + kept[1] * kept[1]) * (2.0 - share) / share
    kept[2] += memory * (now - kept[2])
    # of a moment alone what white noise does once in eight thousand moments (chi-square of 2 degrees of freedom)
    worst: float = max(kept[2], now / 9.0)
    return worst


@inlined
def observe(nav: Array, p: Array, dx: Array, gain: Array, block: Array, slow: Array, par: Array, resting: bool) -> None:
    """Sway and, at rest, speed are nil; the bias of a calm tool.

    Where they last longer than noise they are believed less, within limits: a level frame that leans sways as well.
    What is beyond them counts in the covariance alone.
    """
    known = 0.5 * (p[SWAY, SWAY] + p[SWAY + 1, SWAY + 1])
    seen = lasting(slow[S_SWAYS:S_MOVES], nav[N_SWAY], nav[N_SWAY + 1], par[A_SWAY], par[A_LASTING])
    variance = min(max(par[R_SWAY], seen - known), par[MOST_SWAY])
    excess = seen / (variance + known)
    for i in range(2):
        update(p, dx, gain, SWAY + i, variance, -nav[N_SWAY + i])
    if resting:
        known = 0.5 * (p[SPEED, SPEED] + p[SPEED + 1, SPEED + 1])
        seen = lasting(slow[S_MOVES:S_EXCESS], nav[N_SPEED], nav[N_SPEED + 1], par[A_SPEED], par[A_LASTING])
        variance = min(max(par[R_SPEED], seen - known), par[MOST_SPEED])
        excess = max(excess, seen / (variance + known))
        for i in range(2):
            update(p, dx, gain, SPEED + i, variance, -nav[N_SPEED + i])
    slow[S_EXCESS] = max(2.0 * excess - 1.0, 0.0)
    observe_bias(nav, p, dx, gain, block, slow, par)


@inlined
def feed_back(nav: Array, dx: Array) -> None:
    """The correction goes into the estimate; the slope turns the level frame."""
    for i in range(2):
        nav[N_SWAY + i] += dx[SWAY + i]
        nav[N_SPEED + i] += dx[SPEED + i]
    for i in range(3):
        nav[N_BIAS + i] += dx[BIAS + i]
        nav[N_FIELD + i] += dx[FIELD + i]
    tilt(nav, dx[SLOPE], dx[SLOPE + 1], nav)


@inlined
def tilt(nav: Array, slope0: float, slope1: float, out: Array) -> None:
    """Into `out` the quaternion with the level frame turned by a slope."""
    a, b = 0.5 * slope1, -0.5 * slope0
    p, q, r, s = nav[0], nav[1], nav[2], nav[3]
    q0, q1 = p - a * q - b * r, q + a * p + b * s
    q2, q3 = r + b * p - a * s, s + a * r - b * q
    n = 1.0 / math.sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
    out[0], out[1], out[2], out[3] = q0 * n, q1 * n, q2 * n, q3 * n
