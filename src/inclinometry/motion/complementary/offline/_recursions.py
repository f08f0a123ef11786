"""Compiled backward pass over the blocks of the filter, and the rows of every sample. Arrays in and out, no checks."""

from __future__ import annotations

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
from inclinometry.motion.complementary import _recursions as f

N = k.STATES


@inlined
def _factor(a: Array) -> None:
    """Cholesky factor of a positive definite matrix, in the lower triangle of its place."""
    for j in range(N):
        for i in range(j, N):
            total = a[i, j]
            for c in range(j):
                total -= a[i, c] * a[j, c]
            if i == j:
                a[j, j] = math.sqrt(max(total, 1e-300))
            else:
                a[i, j] = total / a[j, j]


@inlined
def _solve(a: Array, b: Array) -> None:
    """b = (L L')^-1 b for all columns."""
    for c in range(N):
        for i in range(N):
            total = b[i, c]
            for j in range(i):
                total -= a[i, j] * b[j, c]
            b[i, c] = total / a[i, i]
        for i in range(N - 1, -1, -1):
            total = b[i, c]
            for j in range(i + 1, N):
                total -= a[j, i] * b[j, c]
            b[i, c] = total / a[i, i]


@compiled(types.void(MATRIX, VECTOR, MATRIX_OUT, CUBE_OUT))
def backward(history: Array, par: Array, change: Array, spread: Array) -> None:
    """Rauch-Tung-Striebel pass: what the later blocks change in the estimate after each block, and its covariance.

    change[j] = C (correction[j + 1] + change[j + 1]) with C = P F' P_before^-1: the forward pass feeds its corrections
    back at once, so they are what separates the estimates before and after the observations.
    """
    count = history.shape[0]
    a, b, d, gain = np.empty((N, N)), np.empty((N, N)), np.empty((N, N)), np.empty((N, N))
    last = history[count - 1]
    for i in range(N):
        change[count - 1, i] = 0.0
        for j in range(N):
            spread[count - 1, i, j] = last[f.H_AFTER + i * N + j]
    for row in range(count - 2, -1, -1):
        here, after = history[row], history[row + 1]
        for i in range(N):
            for j in range(N):
                a[i, j] = after[f.H_BEFORE + i * N + j]
                b[i, j] = here[f.H_AFTER + i * N + j]
                d[i, j] = spread[row + 1, i, j] - a[i, j]
        k.transition_rows(b, after[f.H_MATRIX : f.H_MATRIX + 9], here[f.H_ESTIMATE : f.H_ESTIMATE + k.NAV], par)
        _factor(a)
        _solve(a, b)
        for i in range(N):
            total = 0.0
            for j in range(N):
                total += b[j, i] * (after[f.H_CORRECTION + j] + change[row + 1, j])
                inner = 0.0
                for c in range(N):
                    inner += b[c, i] * d[c, j]
                gain[i, j] = inner
            change[row, i] = total
        for i in range(N):
            for j in range(i, N):
                inner = here[f.H_AFTER + i * N + j]
                for c in range(N):
                    inner += gain[i, c] * b[c, j]
                spread[row, i, j] = inner
                spread[row, j, i] = inner


@inlined
def _smooth(
    here: Array, after: Array, change: Array, spread: Array, row: int, share: float, nav: Array, par: Array,
    slow: Array, trial: Array, shown: Array,
) -> None:  # fmt: skip
    """Attitude at a share of the way from one block to the next, and what its row shows."""
    last = row + 1 >= change.shape[0]
    here_row = change[row]
    slope0, slope1 = here_row[k.SLOPE], here_row[k.SLOPE + 1]
    if not last:
        slope0 += share * (after[f.H_CORRECTION + k.SLOPE] + change[row + 1, k.SLOPE] - slope0)
        slope1 += share * (after[f.H_CORRECTION + k.SLOPE + 1] + change[row + 1, k.SLOPE + 1] - slope1)
    for c in range(3):
        value = here_row[k.FIELD + c]
        if not last:
            value += share * (after[f.H_CORRECTION + k.FIELD + c] + change[row + 1, k.FIELD + c] - value)
        trial[k.N_FIELD + c] = here[f.H_ESTIMATE + k.N_FIELD + c] + value
    k.tilt(nav, slope0, slope1, trial)
    f._show(trial, spread[row if last or share < 0.5 else row + 1], slow, par, shown, 0)


@inlined
def _rate(i: int, gyro: Array, good: Mask, nav: Array, held: Array, half: float, step: Array) -> None:
    """Half the rotation vector of a sample; a bad one repeats the last good one."""
    for c in range(3):
        if good[i]:
            held[c] = gyro[i, c]
        step[c] = half * (held[c] - nav[k.N_BIAS + c])


@compiled(
    types.void(
        MATRIX, MASK, VECTOR, types.int64, types.int64, types.int64, types.float64, MATRIX, MATRIX_OUT, CUBE_OUT,
        MATRIX_OUT, CUBE_OUT, VECTOR_OUT, VECTOR_OUT, FLAGS_OUT,
    )
)  # fmt: skip
def write_rows(
    gyro: Array,
    good: Mask,
    par: Array,
    size: int,
    every: int,
    start: int,
    moved: float,
    history: Array,
    change: Array,
    spread: Array,
    quaternion: Array,
    covariance: Array,
    rate: Array,
    quality: Array,
    flags: NDArray[np.uint32],
) -> None:
    """Rows of every `every`-th sample; the first record stands at sample `start` - 1. Flags add to those given;
    `moved` is the time, s, the tool was in motion in all."""
    r, trial, shown, nav = np.empty(9), np.zeros(k.NAV), np.zeros(f.SHOWN), np.zeros(k.NAV)
    slow, held, step = np.zeros(k.SLOW), np.zeros(3), np.zeros(3)
    slow[k.S_MOVED] = moved
    half, count = 0.5 * par[k.DT], gyro.shape[0]
    # the samples of the start are turned back from its end; the others forward from the end of the block before
    for index in range(count):
        i = start - 1 - index if index < start else index
        row = max(0, min((i - start) // size, history.shape[0] - 1))
        place = i - start - row * size
        if index == 0 or (index >= start and place == 0):
            for c in range(k.NAV):
                nav[c] = history[row, f.H_ESTIMATE + c]
        if index >= start:
            _rate(i, gyro, good, nav, held, half, step)
            nav[0], nav[1], nav[2], nav[3] = k.turn(nav[0], nav[1], nav[2], nav[3], step[0], step[1], step[2])
        if i % every == 0:
            at = i // every
            here, after = history[row], history[min(row + 1, history.shape[0] - 1)]
            share = min((place + 1) / size, 1.0) if index >= start else 0.0
            slow[k.S_EXCESS], slow[k.S_DOUBT] = here[f.H_EXCESS], here[f.H_DOUBT]
            _smooth(here, after, change, spread, row, share, nav, par, slow, trial, shown)
            k.level_matrix(trial[0], trial[1], trial[2], trial[3], r)
            before = flags[at]
            f._write(at, trial, r, shown, quaternion, covariance, quality, flags)
            flags[at] |= before
            rate[at] = held[2] - nav[k.N_BIAS + 2] if index >= start else gyro[i, 2] - nav[k.N_BIAS + 2]
        if index < start:
            _rate(i, gyro, good, nav, held, half, step)
            nav[0], nav[1], nav[2], nav[3] = k.turn(nav[0], nav[1], nav[2], nav[3], -step[0], -step[1], -step[2])
