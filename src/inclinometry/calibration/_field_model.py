"""Likelihood of a field calibration: tool parameters, dip, directions of the roll sets, a free attitude each station.

Everything is in units of the full field: signals are divided by the triad's mean conversion factor. Attitudes are
eliminated station by station (Schur complement), so the normal equations hold only the parameters that are shared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.norm import unit
from inclinometry.findings import Finding
from inclinometry.least_squares import Fit, Normal, inverse_spd, levenberg_marquardt

RIDGE = 1e-2
"""Information, 1/rad^2, given to every attitude and set direction: 10 rad, nothing beside a real reading. It keeps the
equations solvable where a direction is a matter of convention (heading without a magnetometer)."""


@dataclass(frozen=True, eq=False)
class Shots:
    """Readings as the fit sees them. `member` is the roll set of each station, -1 for none."""

    kinds: Sequence[str]
    signals: Sequence[Array]  #: (K, m) each, in units of full field
    relative: Sequence[Array]  #: (K, m) each, relative standard deviations of the readings, 1 on the average
    member: Array  #: (K,)
    sets: int

    @property
    def sizes(self) -> list[int]:
        """Sensors of each triad."""
        return [y.shape[1] for y in self.signals]

    @property
    def columns(self) -> list[slice]:
        """Where each triad's parameters, sensor by sensor (three tensor elements, offset), sit in the vector."""
        edges = np.concatenate([[0], np.cumsum([4 * m for m in self.sizes])]).tolist()
        return [slice(a, b) for a, b in pairwise(edges)]

    @property
    def rows(self) -> list[slice]:
        """Where each triad's readings sit in a station's residuals; the two of pointing come last."""
        edges = np.concatenate([[0], np.cumsum(self.sizes)]).tolist()
        return [slice(a, b) for a, b in pairwise(edges)]

    @property
    def tool(self) -> int:
        """Number of tool parameters; the dip follows, then two tangent angles for each roll set."""
        return 4 * sum(self.sizes)


@dataclass(frozen=True, eq=False)
class Unknowns:
    """A point of the fit. `attitude` takes north-east-down to tool axes, `pointing` is the tool axis of each set."""

    tensors: Sequence[Array]
    offsets: Sequence[Array]
    dip: float
    pointing: Array  #: (S, 3)
    attitude: Array  #: (K, 3, 3)


@dataclass(frozen=True, eq=False)
class Levels:
    """Noise of each triad (units of full field), of pointing (rad), and which blocks of which stations are used."""

    noise: tuple[float, ...]
    pointing: float
    used: Array  #: (K, kinds + 1), 1 or 0; the last column is pointing


@dataclass(frozen=True, eq=False)
class Linear:
    """Whitened residuals r (K, n), their slopes against the attitude, A (K, n, 3), and what is shared, J (K, n, P)."""

    residual: Array
    latent: Array
    shared: Array

    def reduced(self) -> tuple[Array, Array, Array]:
        """(A'A)^-1 (K, 3, 3), and J and r with what the attitude explains taken out."""
        inner = np.linalg.inv(np.swapaxes(self.latent, 1, 2) @ self.latent + RIDGE * np.eye(3))
        project = self.latent @ inner
        back = np.swapaxes(self.latent, 1, 2)
        shared = self.shared - project @ (back @ self.shared)
        residual = self.residual - (project @ (back @ self.residual[..., None]))[..., 0]
        return np.asarray(inner), shared, residual


def cross_matrices(v: Array) -> Array:
    """[v]x of each row: [v]x w = v x w."""
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def rotations(angle: Array) -> Array:
    """exp [angle]x of each row (Rodrigues)."""
    half = np.linalg.norm(angle, axis=-1)[..., None, None] / (2.0 * np.pi)
    k = cross_matrices(angle)
    # sin x / x and (1 - cos x) / x^2 = (sin(x/2) / (x/2))^2 / 2, which np.sinc(x / pi) knows at 0 too
    return np.asarray(np.eye(3) + np.sinc(2.0 * half) * k + 0.5 * np.sinc(half) ** 2 * (k @ k))


def tangent(u: Array) -> Array:
    """Two unit vectors at right angles to each u and each other, (..., 3, 2)."""
    helper = np.eye(3)[np.argmin(np.abs(u), axis=-1)]
    first = np.cross(u, helper)
    first = first / np.linalg.norm(first, axis=-1, keepdims=True)
    return np.stack([first, np.cross(u, first)], axis=-1)


def references(kinds: Sequence[str], dip: float) -> list[tuple[Array, Array]]:
    """Unit field of each triad in north-east-down and its slope against the dip; a lone field counts as down."""
    down = (np.array([0.0, 0.0, 1.0]), np.zeros(3))
    c, s = np.cos(dip), np.sin(dip)
    field = (np.array([c, 0.0, s]), np.array([-s, 0.0, c]))
    return [field if k == "magnetometer" and len(kinds) == 2 else down for k in kinds]


class FieldProblem:
    """Cost, gradient and Hessian at given noise levels; the last linearisation is kept for the step back.

    `prior` of any triad before it is read: standard deviations of angles between axes, of the spread of scales.
    """

    def __init__(self, shots: Shots, prior: tuple[float, float], levels: Levels) -> None:
        self.shots, self.prior, self.levels = shots, prior, levels
        self._last: tuple[Unknowns, Linear] | None = None

    @property
    def size(self) -> int:
        return self.shots.tool + 1 + 2 * self.shots.sets

    def linear(self, at: Unknowns) -> Linear:
        """Whitened residuals and slopes, by hand: d(N a) = dN a - N [a]x delta for an attitude turned by delta."""
        if self._last is not None and self._last[0] is at:
            return self._last[1]
        shots, levels = self.shots, self.levels
        count, width = len(shots.member), sum(shots.sizes) + 2
        residual, latent = np.zeros((count, width)), np.zeros((count, width, 3))
        shared = np.zeros((count, width, self.size))
        for j, (field, slope) in enumerate(references(shots.kinds, at.dip)):
            rows, columns = shots.rows[j], shots.columns[j]
            weight = levels.used[:, j, None] / (levels.noise[j] * shots.relative[j])
            a = at.attitude @ field
            residual[:, rows] = (a @ at.tensors[j].T + at.offsets[j] - shots.signals[j]) * weight
            latent[:, rows] = -(at.tensors[j] @ cross_matrices(a)) * weight[..., None]
            for i in range(shots.sizes[j]):
                at_column = columns.start + 4 * i
                shared[:, rows.start + i, at_column : at_column + 3] = a * weight[:, i, None]
                shared[:, rows.start + i, at_column + 3] = weight[:, i]
            shared[:, rows, shots.tool] = (at.attitude @ slope @ at.tensors[j].T) * weight
        # tool axis of each station of a set against the set's direction, in the two tangent directions
        pointed = np.flatnonzero(self.shots.member >= 0)
        sets = self.shots.member[pointed]
        back = np.swapaxes(tangent(at.pointing)[sets], 1, 2)
        weight = self.levels.used[pointed, -1, None] / self.levels.pointing
        axis = at.attitude[pointed, 2, :]
        residual[pointed, -2:] = (back @ axis[..., None])[..., 0] * weight
        turn = cross_matrices(np.array([0.0, 0.0, 1.0]))
        latent[pointed, -2:] = back @ np.swapaxes(at.attitude[pointed], 1, 2) @ turn * weight[..., None]
        first = self.shots.tool + 1 + 2 * sets
        for i in range(2):
            shared[pointed, residual.shape[1] - 2 + i, first + i] = -weight[:, 0]
        linear = Linear(residual, latent, shared)
        self._last = (at, linear)
        return linear

    def normal(self, at: Unknowns) -> Normal:
        """Normal equations of the shared parameters."""
        linear = self.linear(at)
        _, shared, residual = linear.reduced()
        hessian = np.einsum("knp,knq->pq", shared, shared, optimize=True)
        gradient = np.einsum("knp,kn->p", linear.shared, residual)
        cost = float(np.sum(linear.residual**2))
        for value, slope in self._prior_rows(at):
            hessian += np.outer(slope, slope)
            gradient += slope * value
            cost += value**2
        gauge = self.gauge(at)
        hessian += np.outer(gauge, gauge) * float(np.mean(np.diagonal(hessian)[: self.shots.tool]))
        extra = np.arange(self.shots.tool, self.size)
        hessian[extra, extra] += RIDGE
        if len(self.shots.kinds) == 1:
            # one field alone shows no heading: keep each set's direction from wandering about the vertical
            sideways = np.cross(np.array([0.0, 0.0, 1.0]), at.pointing)
            for s, direction in enumerate(sideways):
                own = slice(self.shots.tool + 1 + 2 * s, self.shots.tool + 3 + 2 * s)
                heading = tangent(at.pointing[s]).T @ direction
                hessian[own, own] += (
                    np.outer(heading, heading)
                    * float(np.trace(hessian[own, own]))
                    / max(float(heading @ heading), 1e-6)
                )
        return Normal(cost, gradient, hessian)

    def gauge(self, at: Unknowns) -> Array:
        """Unit direction in which all readings stay the same: the tool axes turned about the tool axis."""
        out = np.zeros(self.size)
        turn = cross_matrices(np.array([0.0, 0.0, 1.0]))
        for columns, tensor in zip(self.shots.columns, at.tensors, strict=True):
            out[columns] = np.column_stack([tensor @ turn.T, np.zeros(len(tensor))]).ravel()
        return np.asarray(out / np.linalg.norm(out))

    def _prior_rows(self, at: Unknowns) -> list[tuple[float, Array]]:
        """Whitened value and slope of each prior: cosine between two axes (three sensors), logarithm of each scale."""
        out: list[tuple[float, Array]] = []
        angle, spread = self.prior
        for columns, tensor in zip(self.shots.columns, at.tensors, strict=True):
            length = np.linalg.norm(tensor, axis=1)
            axes = tensor / length[:, None]
            m = len(tensor)
            logs = np.log(length)
            for i in range(m):
                slope = np.zeros((self.size,))
                for j in range(m):
                    share = (1.0 if i == j else 0.0) - 1.0 / m
                    slope[columns.start + 4 * j : columns.start + 4 * j + 3] = share * axes[j] / length[j]
                out.append((float(logs[i] - logs.mean()) / spread, slope / spread))
            for i, j in ((0, 1), (0, 2), (1, 2)) if m == 3 else ():
                cosine, slope = float(axes[i] @ axes[j]), np.zeros(self.size)
                slope[columns.start + 4 * i : columns.start + 4 * i + 3] = (axes[j] - cosine * axes[i]) / length[i]
                slope[columns.start + 4 * j : columns.start + 4 * j + 3] = (axes[i] - cosine * axes[j]) / length[j]
                out.append((cosine / angle, slope / angle))
        return out

    def retract(self, at: Unknowns, step: Array) -> Unknowns:
        """Move the shared parameters by `step` and each attitude to its best place for them, to first order."""
        linear = self.linear(at)
        inner, _, _ = linear.reduced()
        ahead = linear.residual + linear.shared @ step
        turn = -(inner @ (np.swapaxes(linear.latent, 1, 2) @ ahead[..., None]))[..., 0]
        tensors, offsets = [], []
        for columns, tensor, offset in zip(self.shots.columns, at.tensors, at.offsets, strict=True):
            block = step[columns].reshape(-1, 4)
            tensors.append(tensor + block[:, :3])
            offsets.append(offset + block[:, 3])
        tilt = step[self.shots.tool + 1 :].reshape(self.shots.sets, 2)
        pointing = at.pointing + (tangent(at.pointing) @ tilt[..., None])[..., 0]
        pointing = pointing / np.linalg.norm(pointing, axis=1, keepdims=True)
        dip = at.dip + float(step[self.shots.tool])
        return Unknowns(tensors, offsets, dip, pointing, rotations(turn) @ at.attitude)

    def solve(self, start: Unknowns, tolerance: float = 1e-8) -> Fit[Unknowns]:
        """Levenberg-Marquardt from `start`."""
        return levenberg_marquardt(self.normal, start, self.retract, tolerance=tolerance, iterations=200)

    def redundancy(self, at: Unknowns) -> Array:
        """(K, n) share of each residual that the fit does not absorb, 0..1."""
        linear = self.linear(at)
        inner, shared, _ = linear.reduced()
        covariance = inverse_spd(self.normal(at).hessian)
        own = np.einsum("kni,kij,knj->kn", linear.latent, inner, linear.latent)
        common = np.einsum("knp,pq,knq->kn", shared, covariance, shared, optimize=True)
        return np.asarray(np.clip(1.0 - own - common, 0.0, 1.0))

    def with_levels(self, levels: Levels) -> FieldProblem:
        """The same shots at other noise levels."""
        return FieldProblem(self.shots, self.prior, levels)


def reversed_z(at: Unknowns) -> Unknowns:
    """The same readings described in tool axes turned by half a turn about x: the tool axis points the other way."""
    turn = np.diag([1.0, -1.0, -1.0])
    return replace(at, tensors=[n @ turn for n in at.tensors], attitude=turn @ at.attitude, pointing=-at.pointing)


def turned(at: Unknowns, angle: float) -> Unknowns:
    """The same readings described in tool axes turned by `angle` about the tool axis."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return replace(at, tensors=[n @ turn.T for n in at.tensors], attitude=turn @ at.attitude)


@dataclass(frozen=True, eq=False)
class Estimate:
    """A fit with its noise levels. Columns of `square`, `free` and `weight`: each triad, then pointing."""

    problem: FieldProblem  #: at the information weights of the t distribution
    at: Unknowns
    square: Array  #: (K, g) sum of squared residuals in standard deviations, unweighted
    free: Array  #: (K, g) redundancy
    weight: Array  #: (K, g) weight of each block in the fit, 1 for a typical one, near 0 for a wild one
    blind: tuple[str, ...]  #: components whose level the shots cannot tell


def first_levels(kinds: int, member: Array) -> Levels:
    """Where the noise levels start: what is expected, everything used."""
    used = np.ones((len(member), kinds + 1))
    used[:, -1] = member >= 0
    # noise as a share of the full field; error of pointing a tool by hand at the same target, rad
    return Levels((0.002,) * kinds, float(np.radians(0.3)), used)


def estimate(problem: FieldProblem, at: Unknowns, rounds: int = 100) -> Estimate:
    """Fit, noise levels and weights together: iteratively reweighted least squares for Student's t.

    A block (one triad's reading at one station, or its pointing) with squared residual s on q degrees of freedom has
    weight (8 + q) / (8 + s). A level is where its weighted squares equal its redundancy (restricted maximum
    likelihood, Foerstner 1979), with a log-normal prior.
    """
    # degrees of freedom of Student's t: Lange, Little, Taylor, "Robust statistical modeling using the t distribution",
    # JASA 84 (1989). Light enough that normal readings lose about two per cent, heavy enough that one wild shot in
    # sixteen does not lead
    t_freedom = 8.0
    present = problem.levels.used > 0.0
    weight = np.ones_like(problem.levels.used)
    first = first_levels(len(problem.shots.kinds), problem.shots.member)
    expected = np.array([*first.noise, first.pointing])
    for count in range(rounds):
        at = problem.solve(at, 1e-4).estimate
        square, free = _sums(problem, at, np.where(present, weight, 1.0))
        updated = np.where(present, (t_freedom + free) / (t_freedom + square), 0.0)
        total, freedom = np.sum(updated * square, axis=0), free.sum(axis=0)
        old = np.array([*problem.levels.noise, problem.levels.pointing])
        new = np.where(present.any(axis=0), _levels(old, total, freedom, expected), old)
        if count >= 10:
            new = np.sqrt(old * new)  # halfway, where two components would keep handing the scatter to each other
        settled = np.all(np.abs(new / old - 1.0) < 2e-3) and np.all(np.abs(updated - weight)[present] < 1e-2)
        weight = updated
        problem = problem.with_levels(Levels(tuple(float(v) for v in new[:-1]), float(new[-1]), np.sqrt(weight)))
        if settled:
            break
    at = problem.solve(at).estimate
    square, free = _sums(problem, at, np.where(present, weight, 1.0))
    # information of t against a normal of the same scale; a block thrown far out tells nothing
    share = np.where(present & (weight > 0.1), (t_freedom + free) / (t_freedom + free + 2.0), 0.0)
    informed = problem.with_levels(replace(problem.levels, used=np.sqrt(share)))
    names = (*problem.shots.kinds, "pointing")
    freedom = free.sum(axis=0)
    blind = tuple(n for g, n in enumerate(names) if present[:, g].any() and freedom[g] < 2.0)
    return Estimate(informed, at, square, free, np.where(present, weight, 0.0), blind)


def _sums(problem: FieldProblem, at: Unknowns, weight: Array) -> tuple[Array, Array]:
    """Sum of squares (unweighted) and redundancy of each station and group, (K, groups)."""
    residual, redundancy = problem.linear(at).residual, problem.redundancy(at)
    last = sum(problem.shots.sizes)
    groups = [*problem.shots.rows, slice(last, last + 2)]
    square = np.stack([np.sum(residual[:, g] ** 2, axis=1) for g in groups], axis=1) / weight
    free = np.stack([np.sum(redundancy[:, g], axis=1) for g in groups], axis=1)
    return square, free * (problem.levels.used > 0.0)


def _levels(old: Array, total: Array, freedom: Array, expected: Array) -> Array:
    """Standard deviations where freedom - total (old/sd)^2 + log(sd / expected) / spread^2 = 0, by Newton in log sd."""
    start = np.log(old)
    log = start.copy()
    # standard deviation of the logarithm of a noise level about its expected value: a factor of e either way. Against
    # the forty degrees of freedom of a usual campaign this moves a level by a few per cent; it keeps a component that
    # has hardly any from falling to zero, which would trust it without limit
    spread = 1.0
    for _ in range(100):
        ratio = total * np.exp(2.0 * (start - log))
        value = freedom - ratio + (log - np.log(expected)) / spread**2
        step = np.clip(value / (2.0 * ratio + 1.0 / spread**2), -1.0, 1.0)
        log = log - step
        if np.all(np.abs(step) < 1e-10):
            break
    # least noise, of full field, and least pointing error, rad: what even exact simulated readings are given
    return np.maximum(np.exp(log), 1e-5)


def bad_shots(found: Estimate) -> list[tuple[int, int]]:
    """(station, group) of blocks beyond chance, worst first: an F test against the weighted rest of their group."""
    from scipy.special import fdtrc

    rest = np.sum(found.weight * found.square, axis=0) - found.weight * found.square
    left = found.free.sum(axis=0) - found.free
    judged = (found.free > 0.1) & (found.square > 0.0) & (left > 2.0)
    free, left, usual = found.free[judged], left[judged], np.maximum(rest[judged] / left[judged], 1e-300)
    # a t scale of 8 degrees of freedom squared is 0.82 of the variance of the normal noise it is fitted to
    chance = fdtrc(free, left, 0.82 * found.square[judged] / free / usual)
    # a shot is named as bad when a clean campaign would name one less often than this
    limit = 0.01 / max(len(chance), 1)
    blocks = np.argwhere(judged)
    return [(int(blocks[i, 0]), int(blocks[i, 1])) for i in np.argsort(chance) if chance[i] < limit]


def canonical(found: Estimate, flip: bool) -> tuple[Unknowns, Array]:
    """The fit in canonical tool axes, and the projection (P, P) that takes the gauge out of its covariance.

    The turn makes sum axis_0.x + axis_1.y largest over the first two sensors of the first triad, which is the polar
    decomposition of their projections on the x-y plane. Where these are mirror images (the sum is the same for every
    turn), the sensor lying more across the tool axis carries its own axis alone.
    """
    sign = -1.0 if flip else 1.0
    axes = sign * unit(found.at.tensors[0])
    # weights of the first two sensors in the convention
    size = np.hypot(axes[0, 0] + axes[1, 1], axes[0, 1] - axes[1, 0])
    weights = np.ones(2) if size > 0.3 else np.asarray(np.eye(2)[int(np.argmax(np.linalg.norm(axes[:2, :2], axis=1)))])
    # the sum after a turn by t is cos t (n0x + n1y) + sin t (n0y - n1x)
    along = weights[0] * axes[0, 0] + weights[1] * axes[1, 1]
    across = weights[0] * axes[0, 1] - weights[1] * axes[1, 0]
    at = turned(found.at, float(np.arctan2(across, along)))
    # I - g c' / (c' g): changes of the parameters with the convention h = n0y - n1x = 0 kept; c is the slope of h
    problem, tensor = found.problem, at.tensors[0]
    length = np.linalg.norm(tensor, axis=1)
    axes = tensor / length[:, None]
    slope = np.zeros(problem.size)
    for sensor, axis, factor in ((0, 1, weights[0]), (1, 0, -weights[1])):
        gradient = (np.eye(3)[axis] - axes[sensor] * axes[sensor, axis]) / length[sensor]
        slope[4 * sensor : 4 * sensor + 3] = sign * factor * gradient
    gauge = problem.gauge(at)
    return at, np.asarray(np.eye(problem.size) - np.outer(gauge, slope) / (slope @ gauge))


def warn_axes(kinds: Sequence[str], at: Unknowns, flip: bool) -> list[Finding]:
    """A warning for each triad of three whose sensors do not lie near the tool axes of the same name."""
    out = []
    for kind, tensor in zip(kinds, at.tensors, strict=True):
        if len(tensor) != 3:
            continue
        axes = unit(tensor) * (-1.0 if flip and kind == "accelerometer" else 1.0)
        if np.min(np.diagonal(axes)) < np.cos(np.radians(45.0)):
            out.append(Finding("bench-axes-exchanged", {"kind": kind, "axes": tuple(map(_nearest, axes))}))
    return out


def _nearest(axis: Array) -> str:
    """The signed tool axis nearest to a direction."""
    i = int(np.argmax(np.abs(axis)))
    return f"{'-' if axis[i] < 0 else '+'}{'xyz'[i]}"
