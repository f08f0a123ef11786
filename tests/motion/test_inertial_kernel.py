"""The compiled filter against dense plain-numpy forms of its equations, and what a first-order transition does."""

from __future__ import annotations

import numpy as np
import pytest

from inclinometry.arrays import Array
from inclinometry.motion.inertial import _recursions as kernels
from inclinometry.motion.inertial.window import tapers
from inclinometry.rotations import (
    cross_matrix,
    dcm,
    dcm_from_quaternion,
    quaternion_from_dcm,
    rotation_exp,
)

DT, SIZE, STRENGTH, DIP = 0.005, 240, 5e4, 1.1
AXIS = dcm(1.0, 0.5, 2.0)[2]
EARTH = np.array([4e-5, 0.0, -6e-5])
NOISE = np.concatenate(
    [np.full(3, 1e-10), np.full(3, 1e-14), np.full(3, 1e-14), np.full(3, 1e-8), np.full(3, 1e-2), [0]]
)
SPREAD = np.concatenate(
    [np.full(3, 0.02), np.full(3, 1e-3), np.full(3, 2e-3), np.full(3, 0.02), np.full(3, 100), [0.01]]
)
HELD = (0.2 * DT) ** 2


class Run:
    """A window of a spinning tool with wrong beginnings, and the kernel's answer."""

    def __init__(self, seed: int = 0, taped: bool = False, gate: float = 1e9) -> None:
        rng = np.random.default_rng(seed)
        time = DT * np.arange(SIZE)
        self.gyro = rng.normal(0.0, 0.3, (SIZE, 3)) + np.stack([0 * time, 0 * time, 12 + 8 * np.sin(3 * time)], axis=1)
        self.accel = rng.normal(0.0, 5.0, (SIZE, 3)) + [0.0, 1.0, 9.0]
        self.mag = rng.normal(0.0, 2e4, (SIZE, 3))
        self.marks = np.where(rng.random(SIZE) < 0.9, 1, 2).astype(np.uint8)
        self.q = quaternion_from_dcm(dcm(1.0, 0.5, 2.0))
        self.values = np.concatenate([rng.normal(0, 1e-3, 6), rng.normal(0, 0.02, 3), rng.normal(0, 50, 3), [DIP]])
        self.nominal = np.concatenate([self.q, self.values, np.zeros(3)])
        self.p, self.x = np.diag(SPREAD**2), np.zeros(16)
        self.last = self.gyro[0].copy()
        self.constants = np.array([DT, *(EARTH * DT), STRENGTH, 2500.0, gate, HELD, *NOISE, 1.0, *AXIS])
        self.sums = np.zeros(kernels.SUMS)
        self.tape = (np.zeros((SIZE if taped else 0, 13)), np.zeros((SIZE if taped else 0, 34)))
        self.tapers = tapers(SIZE, DT)
        before = (self.nominal.copy(), self.p.copy(), self.x.copy(), self.last.copy())
        kernels.forward(
            self.gyro, self.accel, self.mag, self.marks, self.tapers, self.constants,
            self.nominal, self.p, self.x, self.last, self.sums, *self.tape,
        )  # fmt: skip
        self.before = before


class Dense:
    """The same with full matrices, per sample; keeps what a Rauch-Tung-Striebel pass needs."""

    def __init__(self, run: Run) -> None:
        nominal, self.p, self.x, last = (a.copy() for a in run.before)
        matrix, v = dcm_from_quaternion(nominal[:4]), nominal[4:17]
        self.prior, self.post, self.steps, self.kept = [], [], [], []
        for i in range(SIZE):
            now = last if run.marks[i] & 2 else run.gyro[i]
            y = 0.5 * (last + now)
            last = now
            rotation = rotation_exp(-(y - y * v[3:6] - v[:3]) * DT)
            phi = np.eye(16)
            phi[:3, :3] = rotation
            half = 0.5 * DT * (np.eye(3) + rotation)
            phi[:3, 3:6], phi[:3, 6:9] = half, half @ np.diag(y)
            matrix = rotation @ matrix @ rotation_exp(EARTH * DT)
            more = NOISE + np.concatenate([np.full(3, HELD if run.marks[i] & 2 else 0.0), np.zeros(13)])
            self.x, self.p = phi @ self.x, phi @ self.p @ phi.T + np.diag(more)
            self.prior.append((self.x, self.p))
            if run.marks[i] & 1:
                self._field(matrix, run.mag[i], v, east=i % 2 == 0)
            self.post.append((self.x, self.p))
            self.steps.append(phi)
            self.kept.append(np.concatenate([matrix.T @ (run.accel[i] - v[6:9]), matrix.T.ravel()]))
        self.matrix = matrix

    def _field(self, matrix: Array, mag: Array, v: Array, *, east: bool) -> None:
        """By the definition: residual of the field along a direction of the reference, differentiated by hand."""
        field = STRENGTH * np.array([np.cos(v[12]), 0.0, np.sin(v[12])])
        by_dip = STRENGTH * np.array([-np.sin(v[12]), 0.0, np.cos(v[12])])
        u = np.array([0.0, 1.0, 0.0]) if east else by_dip / STRENGTH
        h = np.zeros(16)
        h[:3] = matrix @ u @ cross_matrix(matrix @ field)  # estimate minus truth: -u.(e x b)
        h[12:15], h[14], h[15] = -matrix @ u, -u @ AXIS, -u @ by_dip
        z = u @ (matrix.T @ (mag - v[9:12]) - field)
        s = h @ self.p @ h + 2500.0
        k = self.p @ h / s
        keep = np.eye(16) - np.outer(k, h)
        self.x = self.x + k * (z - h @ self.x)
        self.p = keep @ self.p @ keep.T + 2500.0 * np.outer(k, k)


def test_a_window_agrees_with_full_matrices() -> None:
    """240 steps and updates; rounding of 240 updates with gains of order one stays below 1e-9 of each sigma."""
    run = Run()
    dense = Dense(run)
    assert np.allclose(dcm_from_quaternion(run.nominal[:4]), dense.matrix, atol=1e-12)
    scale = np.sqrt(np.diag(dense.p))
    assert np.abs((run.p - dense.p) / np.outer(scale, scale)).max() < 1e-8
    assert np.abs((run.x - dense.x) / scale).max() < 1e-7
    assert np.abs(run.p - run.p.T).max() / scale.max() ** 2 < 1e-12
    assert np.linalg.eigvalsh(run.p / np.outer(scale, scale)).min() > 0.0


def test_sums_of_a_window_are_tapered_sums() -> None:
    """Each row of twelve is a taper times apparent gravity and the transposed matrix; rounding only."""
    run = Run(1)
    kept = np.array(Dense(run).kept)
    found = run.sums[: kernels.DRIFT].reshape(-1, 12)
    wanted = run.tapers.T @ kept
    assert np.abs(found - wanted).max() < 1e-11 * np.abs(wanted).max()


def test_backward_agrees_with_rauch_tung_striebel() -> None:
    """Smoothed error and covariance at the first step, by inverting every covariance; inversions cost 1e-5."""
    run = Run(2, taped=True)
    dense = Dense(run)
    x, p = dense.post[-1]
    for i in range(SIZE - 2, -1, -1):
        prior_x, prior_p = dense.prior[i + 1]
        gain = dense.post[i][1] @ dense.steps[i + 1].T @ np.linalg.inv(prior_p)
        x = dense.post[i][0] + gain @ (x - prior_x)
        p = dense.post[i][1] + gain @ (p - prior_p) @ gain.T
    lam, info = np.zeros(16), np.zeros((16, 16))
    kernels.backward(run.tape[0][1:], run.tape[1][1:], lam, info)
    first_x, first_p = dense.post[0]
    scale = np.sqrt(np.diag(p))
    assert np.abs((first_x - first_p @ lam - x) / scale).max() < 1e-4
    assert np.abs((first_p - first_p @ info @ first_p - p) / np.outer(scale, scale)).max() < 1e-4


def test_a_measurement_beyond_the_gate_changes_nothing() -> None:
    run = Run(3, gate=1e-12)
    assert run.sums[kernels.COUNTS] == 0.0
    assert not run.x.any()


def test_tapers_vanish_at_the_ends_and_bend_as_stated() -> None:
    """Second differences of the tapers are their second derivatives to the order of the step squared."""
    found = tapers(2000, 0.005)
    assert found[:, 0].sum() == pytest.approx(1.0, abs=1e-12)
    assert np.abs(found[:, 1:5].sum(axis=0)).max() < 1e-12
    bent = np.diff(found[:, :5], 2, axis=0) / 0.005**2
    assert np.abs(bent - found[1:-1, 5:]).max() < 1e-4 * np.abs(found[:, 5:]).max()


def test_a_first_order_transition_diverges_where_the_exact_one_does_not() -> None:
    """120 rpm at 200 Hz without updates: (1 + (w dt)^2) a step, 1e70 after 42 000 steps; a rotation keeps its size."""
    turn = 4.0 * np.pi * DT
    naive, exact = np.eye(3) - cross_matrix([0.0, 0.0, turn]), rotation_exp([0.0, 0.0, -turn])
    p, q = np.eye(3), np.eye(3)
    for _ in range(42_000):
        p, q = naive @ p @ naive.T, exact @ q @ exact.T
    assert p.max() > 1e70
    assert p[0, 0] == pytest.approx((1.0 + turn**2) ** 42_000, rel=1e-6)
    assert np.abs(q - np.eye(3)).max() < 1e-9


@pytest.mark.long
def test_ten_million_steps_at_600_rpm_stay_finite() -> None:
    """The kernel alone, windows of 2000 samples, errors taken out after each as the filter does."""
    rate = 20.0 * np.pi
    matrix = dcm(1.0, 0.5, rate * DT * np.arange(2000))
    field = STRENGTH * np.array([np.cos(DIP), 0.0, np.sin(DIP)])
    rng = np.random.default_rng(0)
    clean, noise = matrix @ field, rng.normal(0.0, 50.0, (100_000, 3))
    accel, gyro = matrix @ [0.0, 0.0, 9.8], np.tile([0.0, 0.0, rate], (2000, 1))
    constants = np.array([DT, 0.0, 0.0, 0.0, STRENGTH, 2500.0, 36.0, HELD, *NOISE, 1.0, *AXIS])
    nominal = np.concatenate([quaternion_from_dcm(dcm(1.0, 0.5, -rate * DT)), np.zeros(12), [DIP, 0, 0, 0]])
    p, last, marks, weights = np.diag(SPREAD**2), gyro[0].copy(), np.ones(2000, np.uint8), tapers(2000, DT)
    blank = (np.zeros((0, 13)), np.zeros((0, 34)))
    for _ in range(5000):
        x, sums, place = np.zeros(16), np.zeros(kernels.SUMS), rng.integers(98_000)
        mag = clean + noise[place : place + 2000]
        kernels.forward(gyro, accel, mag, marks, weights, constants, nominal, p, x, last, sums, *blank)
        p = 0.5 * (p + p.T)
        turned = rotation_exp(-x[:3]) @ dcm_from_quaternion(nominal[:4])
        nominal[:4] = quaternion_from_dcm(turned)
        nominal[4:17] -= x[3:]
    assert np.isfinite(p).all()
    assert np.linalg.eigvalsh(p / np.sqrt(np.outer(p.diagonal(), p.diagonal()))).min() > 0.0
    # what the field leaves open is bounded by its own standard deviation
    assert np.abs(dcm_from_quaternion(nominal[:4]) - matrix[-1]).max() < 5.0 * np.sqrt(p[:3, :3].trace())
